//! Hysteresis loops: force over displacement of joints and moved places, over one period of an
//! orbit.

mod tables;

pub use tables::{Loop, loops};

use self::tables::{DAMPING, DISPLACEMENT, DISSIPATION, FORCE, JOINT, LOOPS, STIFFNESS, SUMMARY, TIME};
use super::keys::{FREQUENCY, SAMPLES, anything};
use super::orbits;
use crate::columns::{ENERGY_GAP, FREQUENCY as DRIVE, RESIDUAL};
use crate::cost::{Cost, Costing, Shape};
use crate::dataset::{Figure, Panel, Series};
use crate::drawing::{Drawing, Stretch, join, largest, numbers, words};
use crate::draws;
use crate::info::Complaint;
use crate::info::KindInfo;
use crate::key::{Takes, default, optional};
use crate::kind::Kind;
use crate::names::Names;
use crate::rows::Rows;
use crate::study::varied_text;
use crate::values::{Values, hertz};
use crate::warnings::driven;
use crate::words::shown_hertz;
use crate::work::{Computed, Grain, Part, Prepared, Work};
use std::collections::BTreeSet;
use stickslip::dimension::Dimension;
use stickslip::law::MAX_DIRECTIONS;
use stickslip::model::{Axis as Along, Model};
use stickslip::orbit::{Orbit, Sample};
use stickslip_numerics::quadrature::FIVE;

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: tables::NAME,
        summary: "force-displacement loops with dissipation, equivalent stiffness and damping",
        keys: &[
            FREQUENCY,
            optional(
                "loop",
                Takes::Names,
                "joints or moved places (with the force that moves them) whose loops are computed; default: every \
                 joint",
                "\"shroud\"",
            ),
            optional(
                "against",
                Takes::Name,
                "the mass whose displacement is the abscissa of the loops; default: the relative displacement of the \
                 joint",
                "\"blade1\"",
            ),
            default("sum", Takes::Flag, "false", "adds the forces of the joints to one loop per direction", "true"),
            SAMPLES,
        ],
        check,
        axes: [Some(Dimension::LENGTH), Some(Dimension::FORCE)],
        uses_method: true,
        needs: anything,
        adapts: false,
        tables: &[LOOPS, SUMMARY],
    },
    grain: |_| Grain::Frequencies,
    cost,
    warnings: driven,
    compute,
    draw,
};

fn cost(costing: &Costing<'_>) -> Cost {
    let (values, points) = (&costing.case.values, costing.points());
    let loops = match values.names("loop") {
        _ if values.flag("sum") == Some(true) => MAX_DIRECTIONS as f64,
        None if costing.joints == 0.0 => costing.case.model.motions.len() as f64,
        _ => wanted(values, &costing.case.model).len() as f64,
    };
    let rows = points * loops * costing.instants();
    let keys = costing.varied + costing.several();
    let read = costing.instants() + loops * (QUADRATURE * FIVE.len()) as f64;
    Cost {
        tables: vec![
            Shape { rows, numbers: keys + 3.0, words: 1.0 },
            Shape { rows: points * loops, numbers: keys + 5.0, words: 2.0 },
        ],
        drawn: rows,
        unit: costing.kept_orbits() + costing.samples_bytes(),
        spared: None,
        work: points * (costing.orbit() + costing.reading(read)),
    }
}

fn check(values: &Values, model: &Model, _: usize) -> Result<(), Complaint> {
    let known = known(model);
    for name in values.names("loop").unwrap_or_default() {
        known.all("loop", "joint or moved place", name)?;
    }
    if let Some(name) = values.text("against") {
        Names::of_displacements(model).one("against", "mass", name)?;
    }
    if values.flag("sum") == Some(true) && values.text("against").is_none() {
        let wanted = wanted(values, model);
        let labelled = model.joints.iter().zip(model.joint_labels());
        let summed = labelled.filter(|(_, labels)| labels.iter().any(|label| wanted.contains(label)));
        let mut ends = summed.map(|(joint, _)| &joint.between);
        let first = ends.next();
        if ends.any(|between| Some(between) != first) {
            let message = "the summed joints connect different places, so they have no common relative displacement";
            return Err(Complaint::new(
                "sum",
                message,
                "name the place whose displacement is used: against = \"NAME\"",
            ));
        }
    }
    if known.is_empty() {
        let help = "add a [[joint]] or a [[motion]], or use kind = \"orbit\"";
        return Err(Complaint::new("kind", "the model has no joint and no [[motion]], so it has no loop", help));
    }
    Ok(())
}

/// Returns the names that can have a loop.
fn known(model: &Model) -> Names {
    Names::default().and_joints(model).and_moved(model)
}

/// Returns the names of the requested loops: joints by direction, and moved places; by default
/// every joint.
fn wanted(values: &Values, model: &Model) -> Vec<String> {
    let known = known(model);
    let meant =
        |name: &String| known.all("loop", "joint or moved place", name).map(<[String]>::to_vec).unwrap_or_default();
    let every = || model.joint_labels().into_iter().flatten().collect();
    let mut wanted: Vec<String> =
        values.names("loop").map_or_else(every, |names| names.iter().flat_map(meant).collect());
    // the list may contain a joint and one of its directions
    let mut seen = BTreeSet::new();
    wanted.retain(|name| seen.insert(name.clone()));
    wanted
}

/// The origin of force and displacement of a loop in a sample.
#[derive(Debug, Clone, PartialEq)]
struct Source {
    force: Of,
    /// The place whose displacement replaces that of the joint or moved place.
    against: Option<Along>,
}

#[derive(Debug, Clone, PartialEq)]
enum Of {
    /// The sum over these joints, each with the index of an axis.
    Joints(Vec<(usize, usize)>),
    Moved(usize),
}

impl Source {
    /// Returns displacement (m) and force (N).
    fn read(&self, sample: &Sample) -> (f64, f64) {
        let (displacement, force) = match &self.force {
            Of::Joints(joints) => {
                let force = joints.iter().map(|(j, axis)| sample.joints[*j].force[*axis]).sum();
                let (first, axis) = joints[0];
                (sample.joints[first].displacement[axis], force)
            }
            Of::Moved(m) => sample.imposed[*m],
        };
        (self.against.as_ref().map_or(displacement, |place| place.component(&sample.displacement)), force)
    }
}

fn compute(work: &Work<'_>) -> Computed {
    let mut part = Part::default();
    let (mut table, mut summary) = (Rows::default(), Rows::default());
    let prepared = work.case();
    let several = work.several_frequencies();
    let sources = sources(prepared);
    for (orbit, _) in orbits::found(work, &mut part)? {
        let omega = orbit.omega;
        let times = orbits::times(&orbit, prepared.case.values.count("samples").unwrap_or(720) as usize);
        let samples: Vec<Sample> = times.iter().map(|t| orbit.sample(*t)).collect();
        for (name, source) in &sources {
            for (time, sample) in times.iter().zip(&samples) {
                let (displacement, force) = source.read(sample);
                table.varied(&prepared.case);
                if several {
                    table.number(DRIVE, hertz(omega));
                }
                table.text(JOINT, name);
                table.number(TIME, *time);
                table.number(DISPLACEMENT, displacement);
                table.number(FORCE, force);
                table.end();
            }
            let first = First::new(&orbit, source);
            summary.varied(&prepared.case);
            if several {
                summary.number(DRIVE, hertz(omega));
            }
            summary.text(JOINT, name);
            summary.number(DISSIPATION, exact_loss(prepared, &orbit, source).unwrap_or(first.loss));
            summary.number(STIFFNESS, first.stiffness);
            summary.number(DAMPING, first.damping);
            summary.number(RESIDUAL, orbit.evidence.residual);
            summary.number(ENERGY_GAP, orbit.evidence.energy_gap);
            summary.reduced(prepared.system.reduction_evidence());
            summary.text("status", orbit.evidence.accuracy.status());
            summary.end();
        }
    }
    part.tables = vec![table, summary];
    Ok(part)
}

/// Returns the loops that the study requests.
fn sources(prepared: &Prepared) -> Vec<(String, Source)> {
    let (system, values) = (&prepared.system, &prepared.case.values);
    let against = values.text("against").and_then(|name| system.places().iter().position(|place| place == name));
    let against = against.map(|place| system.place_axes()[place].clone());
    let axes: Vec<(String, (usize, usize))> = system
        .joints()
        .iter()
        .enumerate()
        .flat_map(|(j, joint)| joint.labels().enumerate().map(move |(axis, label)| (label, (j, axis))))
        .collect();
    let mut names = wanted(values, &prepared.case.model);
    if names.is_empty() {
        let moved = system.moved_places().iter().filter(|place| !prepared.case.model.is_rotation(&place.name));
        names = moved.map(|place| place.name.clone()).collect();
    }
    let joint = |name: &String| axes.iter().find(|(label, _)| label == name).map(|(_, at)| *at);
    if values.flag("sum") == Some(true) {
        // forces along different directions are not added: each direction has its sum
        let mut sums: Vec<Sum> = Vec::new();
        for (name, (j, axis)) in names.into_iter().filter_map(|name| Some((name.clone(), joint(&name)?))) {
            let direction = system.joints()[j].axes()[axis].name();
            let at = sums.iter().position(|sum| sum.direction == direction).unwrap_or_else(|| {
                sums.push(Sum { direction, names: Vec::new(), joints: Vec::new() });
                sums.len() - 1
            });
            sums[at].names.push(name);
            sums[at].joints.push((j, axis));
        }
        let one =
            |sum: Sum| (sum.names.join(" + "), Source { force: Of::Joints(sum.joints), against: against.clone() });
        return sums.into_iter().map(one).collect();
    }
    let find = |name: &String| {
        let joint = joint(name).map(|joint| Of::Joints(vec![joint]));
        joint.or_else(|| system.moved_places().iter().position(|place| place.name == *name).map(Of::Moved))
    };
    names
        .iter()
        .filter_map(|name| Some((name.clone(), Source { force: find(name)?, against: against.clone() })))
        .collect()
}

/// The joints whose forces along one direction are added.
struct Sum<'a> {
    /// Name of the direction; `None` for joints with one direction.
    direction: Option<&'a str>,
    names: Vec<String>,
    joints: Vec<(usize, usize)>,
}

/// Returns the loss per period if the orbit has it in closed form.
///
/// This holds for joints over their relative displacement, and for a moved place that is the
/// only source of work.
fn exact_loss(prepared: &Prepared, orbit: &Orbit, source: &Source) -> Option<f64> {
    match &source.force {
        _ if source.against.is_some() => None,
        // the dissipation of a joint is not known per direction
        Of::Joints(joints) if joints.iter().any(|(j, _)| prepared.system.joints()[*j].axes().len() > 1) => None,
        Of::Joints(joints) => Some(joints.iter().map(|(j, _)| orbit.joints[*j].dissipation).sum()),
        Of::Moved(_) if prepared.system.moved_places().len() == 1 && prepared.case.model.forces.is_empty() => {
            Some(orbit.energy.work_in)
        }
        Of::Moved(_) => None,
    }
}

/// First harmonic of a loop.
struct First {
    loss: f64,
    stiffness: f64,
    damping: f64,
}

/// Intervals of the quadrature per period. They end at the switches, so exact laws are smooth
/// within each interval.
const QUADRATURE: usize = 256;
impl First {
    /// Integrates `F₁ = (keq + jω ceq) U₁` with the first harmonics of force and displacement,
    /// and the loss `∮ F du`.
    fn new(orbit: &Orbit, source: &Source) -> Self {
        let (omega, times) = (orbit.omega, orbits::times(orbit, QUADRATURE));
        // u cos, u sin, F cos, F sin
        let mut sums = [0.0; 4];
        let mut corners = Vec::with_capacity(times.len());
        for pair in times.windows(2) {
            let (middle, half) = (0.5 * (pair[0] + pair[1]), 0.5 * (pair[1] - pair[0]));
            for (node, weight) in FIVE {
                let time = middle + node * half;
                let (u, force) = source.read(&orbit.sample(time));
                let (sin, cos) = (omega * time).sin_cos();
                for (sum, value) in sums.iter_mut().zip([u * cos, u * sin, force * cos, force * sin]) {
                    *sum += weight * half * value;
                }
                corners.push((u, force));
            }
        }
        let [uc, us, fc, fs] = sums;
        let size = uc * uc + us * us;
        // (F₁ U₁*)/|U₁|² with U₁ = uc - j us
        let (stiffness, reactive) = ((fc * uc + fs * us) / size, (fc * us - fs * uc) / size);
        let area: f64 = (0..corners.len())
            .map(|i| {
                let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                0.5 * (a.1 + b.1) * (b.0 - a.0)
            })
            .sum();
        First { loss: area, stiffness, damping: reactive / omega }
    }
}

/// Draws the loops. The last varied parameter and the frequency distinguish loops in a panel;
/// the others distinguish panels.
fn draw(drawing: &Drawing<'_>) -> Figure {
    let Some(table) = drawing.table(LOOPS) else { return Figure::default() };
    let (x_axis, x_factor) = drawing.axis(0, "displacement", largest(table, [DISPLACEMENT.to_owned()]), "m");
    let (y_axis, y_factor) = drawing.axis(1, "force", largest(table, [FORCE.to_owned()]), "N");
    let joints = words(table, JOINT);
    // a table from another source may lack columns
    if joints.len() != table.rows() {
        return Figure::default();
    }
    let frequencies = table.numbers(DRIVE);
    let several = joints.iter().any(|joint| *joint != joints[0]);
    let panels_of = |stretches: &[Stretch], words: &dyn Fn(&Stretch) -> (String, String)| {
        let mut panels: Vec<Panel> = Vec::new();
        for stretch in stretches {
            let (outer, inner) = words(stretch);
            for rows in tables::single(table, stretch.rows.clone()) {
                let from = rows.start;
                let joint = Some(joints[from].clone()).filter(|_| several);
                let title = join([outer.clone()].into_iter().chain(joint));
                let frequency = frequencies.map(|frequencies| shown_hertz(frequencies[from]));
                let label = join([inner.clone()].into_iter().chain(frequency));
                let label = if label.is_empty() { joints[from].clone() } else { label };
                let at = panels.iter().position(|panel| panel.title == title).unwrap_or_else(|| {
                    let (x, y) = (x_axis.clone(), y_axis.clone());
                    panels.push(Panel { title, x, y, ..Panel::default() });
                    panels.len() - 1
                });
                let x = numbers(table, DISPLACEMENT, rows.clone()).iter().map(|u| u * x_factor).collect();
                let y = numbers(table, FORCE, rows).iter().map(|f| f * y_factor).collect();
                let colour = panels[at].series.len();
                panels[at].series.push(Series::line(label, x, y, colour));
            }
        }
        panels
    };
    let stretches = drawing.stretches(table);
    if drawing.study.draws().is_some() {
        let of_draw = |stretch: &Stretch, title: String| {
            panels_of(std::slice::from_ref(stretch), &|_| (title.clone(), String::new()))
        };
        return Figure { panels: draws::panels(drawing, &stretches, &of_draw), ..Figure::default() };
    }
    let split = |stretch: &Stretch| {
        let (outer, inner) = stretch.varied.split_at(stretch.varied.len().saturating_sub(1));
        (varied_text(outer), varied_text(inner))
    };
    Figure { panels: panels_of(&stretches, &split), ..Figure::default() }
}
