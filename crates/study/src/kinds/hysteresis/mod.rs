//! Hysteresis loops: force over displacement of joints and moved places, over one period of an
//! orbit.
//!
//! - `tables`: names, columns and typed values of the tables;
//! - `figure`: the figure.

mod figure;
mod tables;

pub use tables::{Loop, loops};

use self::tables::{DAMPING, DISPLACEMENT, DISSIPATION, FORCE, JOINT, LOOPS, STIFFNESS, SUMMARY, TIME};
use super::shared::keys::{FREQUENCY, SAMPLES, no_requirements};
use super::shared::orbit_sweep;
use crate::case::names::ModelNames;
use crate::case::values::{Values, hertz};
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::warnings::excitation_warnings;
use crate::kinds::info::{KeyError, KindInfo};
use crate::kinds::kind::{Kind, Probe};
use crate::results::columns::{ENERGY_GAP, FREQUENCY as DRIVE, RESIDUAL};
use crate::results::table_builder::TableBuilder;
use crate::run::work::{Computed, PreparedCase, UnitResult, UnitSize, UnitTask};
use crate::syntax::key::{ValueType, default, optional};
use std::collections::BTreeSet;
use stickslip::dimension::Dimension;
use stickslip::law::MAX_DIRECTIONS;
use stickslip::model::{Axis as Along, Model};
use stickslip::orbit::{Orbit, Sample};
use stickslip_numerics::quadrature::GAUSS_5;

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: tables::NAME,
        summary: "force-displacement loops with dissipation, equivalent stiffness and damping",
        keys: &[
            FREQUENCY,
            optional(
                "loop",
                ValueType::Names,
                "joints or moved places (with the force that moves them) whose loops are computed; default: every \
                 joint",
                "\"shroud\"",
            ),
            optional(
                "against",
                ValueType::Name,
                "the mass whose displacement is the abscissa of the loops; default: the relative displacement of the \
                 joint",
                "\"blade1\"",
            ),
            default(
                "sum",
                ValueType::Flag,
                "false",
                "true: sums the forces of all joints, one loop per direction",
                "true",
            ),
            SAMPLES,
        ],
        check,
        axes: [Some(Dimension::LENGTH), Some(Dimension::FORCE)],
        uses_method: true,
        needs: no_requirements,
        adapts: false,
        tables: &[LOOPS, SUMMARY],
    },
    unit_size: |_| UnitSize::Frequencies,
    size,
    warnings: excitation_warnings,
    probe: Probe::Points { compute, excluded: |_| None },
    compute,
    draw: figure::draw,
};

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let (values, points) = (&inputs.case.values, inputs.points());
    let loops = match values.names("loop") {
        _ if values.flag("sum") == Some(true) => MAX_DIRECTIONS as f64,
        None if inputs.joints == 0.0 => inputs.case.model.motions.len() as f64,
        _ => requested_loops(values, &inputs.case.model).len() as f64,
    };
    let rows = points * loops * inputs.instants();
    let keys = inputs.varied + inputs.frequency_columns();
    PlannedSize {
        tables: vec![
            TableShape { rows, numbers: keys + 3.0, words: 1.0 },
            TableShape { rows: points * loops, numbers: keys + 5.0, words: 2.0 },
        ],
        drawn: rows,
        unit: inputs.kept_orbits() + inputs.samples_bytes(),
    }
}

fn check(values: &Values, model: &Model, _: usize) -> Result<(), KeyError> {
    let known = loop_names(model);
    for name in values.names("loop").unwrap_or_default() {
        known.labels("loop", "joint or moved place", name)?;
    }
    if let Some(name) = values.text("against") {
        ModelNames::displacements(model).single_label("against", "place", name)?;
    }
    if values.flag("sum") == Some(true) && values.text("against").is_none() {
        let wanted = requested_loops(values, model);
        let labelled = model.joints.iter().zip(model.joint_labels());
        let summed = labelled.filter(|(_, labels)| labels.iter().any(|label| wanted.contains(label)));
        let mut ends = summed.map(|(joint, _)| &joint.between);
        let first = ends.next();
        if ends.any(|between| Some(between) != first) {
            let message = "the summed joints connect different places, so they have no common relative displacement";
            return Err(KeyError::new("sum", message, "name the place whose displacement is used: against = \"NAME\""));
        }
    }
    if known.is_empty() {
        let help = "add a [[joint]] or a [[motion]], or use kind = \"orbit\"";
        return Err(KeyError::new("kind", "the model has no joint and no [[motion]], so it has no loop", help));
    }
    Ok(())
}

/// Returns the names that can have a loop.
fn loop_names(model: &Model) -> ModelNames {
    ModelNames::default().with_joints(model).with_imposed_motions(model)
}

/// Returns the names of the requested loops: joints by direction, and moved places; by default
/// every joint.
fn requested_loops(values: &Values, model: &Model) -> Vec<String> {
    let known = loop_names(model);
    let meant =
        |name: &String| known.labels("loop", "joint or moved place", name).map(<[String]>::to_vec).unwrap_or_default();
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
struct LoopSource {
    force: ForceSource,
    /// The place whose displacement replaces that of the joint or moved place.
    against: Option<Along>,
}

#[derive(Debug, Clone, PartialEq)]
enum ForceSource {
    /// The sum over these joints, each with the index of an axis.
    Joints(Vec<(usize, usize)>),
    Moved(usize),
}

impl LoopSource {
    /// Returns displacement (m) and force (N).
    fn read(&self, sample: &Sample) -> (f64, f64) {
        let (displacement, force) = match &self.force {
            ForceSource::Joints(joints) => {
                let force = joints.iter().map(|(j, axis)| sample.joints[*j].force[*axis]).sum();
                let (first, axis) = joints[0];
                (sample.joints[first].displacement[axis], force)
            }
            ForceSource::Moved(m) => sample.imposed[*m],
        };
        (self.against.as_ref().map_or(displacement, |place| place.component(&sample.displacement)), force)
    }
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let mut part = UnitResult::default();
    let (mut table, mut summary) = (TableBuilder::default(), TableBuilder::default());
    let prepared = work.case();
    let several = work.several_frequencies();
    let sources = sources(prepared);
    for (orbit, _) in orbit_sweep::converged_orbits(work, &mut part)? {
        let omega = orbit.omega;
        let times = orbit_sweep::times(&orbit, prepared.case.values.count("samples").unwrap_or(720) as usize);
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
                table.end_row();
            }
            let first = FirstHarmonic::new(&orbit, source);
            summary.varied(&prepared.case);
            if several {
                summary.number(DRIVE, hertz(omega));
            }
            summary.text(JOINT, name);
            summary.number(DISSIPATION, exact_loss(prepared, &orbit, source).unwrap_or(first.loss));
            summary.number(STIFFNESS, first.stiffness);
            summary.number(DAMPING, first.equivalent_damping);
            summary.number(RESIDUAL, orbit.evidence.residual);
            summary.number(ENERGY_GAP, orbit.evidence.energy_gap);
            summary.reduction_error(prepared.system.reduction_evidence());
            summary.text("status", orbit.evidence.accuracy.status());
            summary.end_row();
        }
    }
    part.tables = vec![table, summary];
    Ok(part)
}

/// Returns the loops that the study requests.
fn sources(prepared: &PreparedCase) -> Vec<(String, LoopSource)> {
    let (system, values) = (&prepared.system, &prepared.case.values);
    let against = values.text("against").and_then(|name| system.places().iter().position(|place| place == name));
    let against = against.map(|place| system.place_axes()[place].clone());
    let axes: Vec<(String, (usize, usize))> = system
        .joints()
        .iter()
        .enumerate()
        .flat_map(|(j, joint)| joint.labels().enumerate().map(move |(axis, label)| (label, (j, axis))))
        .collect();
    let mut names = requested_loops(values, &prepared.case.model);
    if names.is_empty() {
        let moved = system.moved_places().iter().filter(|place| !prepared.case.model.is_rotation(&place.name));
        names = moved.map(|place| place.name.clone()).collect();
    }
    let joint = |name: &String| axes.iter().find(|(label, _)| label == name).map(|(_, at)| *at);
    if values.flag("sum") == Some(true) {
        // forces along different directions are not added: each direction has its sum
        let mut sums: Vec<JointSum> = Vec::new();
        for (name, (j, axis)) in names.into_iter().filter_map(|name| Some((name.clone(), joint(&name)?))) {
            let direction = system.joints()[j].axes()[axis].name();
            let index = sums.iter().position(|sum| sum.direction == direction).unwrap_or_else(|| {
                sums.push(JointSum { direction, names: Vec::new(), joints: Vec::new() });
                sums.len() - 1
            });
            sums[index].names.push(name);
            sums[index].joints.push((j, axis));
        }
        let one = |sum: JointSum| {
            (sum.names.join(" + "), LoopSource { force: ForceSource::Joints(sum.joints), against: against.clone() })
        };
        return sums.into_iter().map(one).collect();
    }
    let find = |name: &String| {
        let joint = joint(name).map(|joint| ForceSource::Joints(vec![joint]));
        joint.or_else(|| system.moved_places().iter().position(|place| place.name == *name).map(ForceSource::Moved))
    };
    names
        .iter()
        .filter_map(|name| Some((name.clone(), LoopSource { force: find(name)?, against: against.clone() })))
        .collect()
}

/// The joints whose forces along one direction are added.
struct JointSum<'a> {
    /// Name of the direction; `None` for joints with one direction.
    direction: Option<&'a str>,
    names: Vec<String>,
    joints: Vec<(usize, usize)>,
}

/// Returns the loss per period if the orbit has it in closed form.
///
/// This holds for joints over their relative displacement, and for a moved place that is the
/// only source of work.
fn exact_loss(prepared: &PreparedCase, orbit: &Orbit, source: &LoopSource) -> Option<f64> {
    match &source.force {
        _ if source.against.is_some() => None,
        // the dissipation of a joint is not known per direction
        ForceSource::Joints(joints) if joints.iter().any(|(j, _)| prepared.system.joints()[*j].axes().len() > 1) => {
            None
        }
        ForceSource::Joints(joints) => Some(joints.iter().map(|(j, _)| orbit.joints[*j].dissipation).sum()),
        ForceSource::Moved(_) if prepared.system.moved_places().len() == 1 && prepared.case.model.forces.is_empty() => {
            Some(orbit.energy.work_in)
        }
        ForceSource::Moved(_) => None,
    }
}

/// First harmonic of a loop.
struct FirstHarmonic {
    loss: f64,
    stiffness: f64,
    equivalent_damping: f64,
}

impl FirstHarmonic {
    /// Integrates `F₁ = (keq + jω ceq) U₁` with the first harmonics of force and displacement,
    /// and the loss `∮ F du`.
    fn new(orbit: &Orbit, source: &LoopSource) -> Self {
        // Intervals of the quadrature per period. They end at the switches, so exact laws are
        // smooth within each interval.
        let (omega, times) = (orbit.omega, orbit_sweep::times(orbit, 256));
        // u cos, u sin, F cos, F sin
        let mut sums = [0.0; 4];
        let mut corners = Vec::with_capacity(times.len());
        for pair in times.windows(2) {
            let (middle, half) = (0.5 * (pair[0] + pair[1]), 0.5 * (pair[1] - pair[0]));
            for (node, weight) in GAUSS_5 {
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
        FirstHarmonic { loss: area, stiffness, equivalent_damping: reactive / omega }
    }
}
