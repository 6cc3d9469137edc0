//! Hysteresis loops: force over displacement of joints and moved places, over one period of the steady motion.

use super::{Complaint, Computed, FREQUENCY, Kind, SAMPLES, orbits};
use crate::dataset::{Axis, Panel, Series, Style};
use crate::run::{Context, Outcome, Prepared, Rows, display_unit, place_of};
use crate::schema::{Takes, optional};
use crate::study::Study;
use crate::values::{Values, hertz};
use std::f64::consts::TAU;
use stickslip::model::Model;
use stickslip::orbit::{Orbit, Sample};

pub(super) const KIND: Kind = Kind {
    name: "hysteresis",
    summary: "force-displacement loops with dissipation, equivalent stiffness and damping",
    keys: &[
        FREQUENCY,
        optional(
            "loop",
            Takes::Names,
            "joints, or moved places (the force that moves them), whose loops are wanted; every joint when absent",
            "\"shroud\"",
        ),
        SAMPLES,
    ],
    check,
    uses_method: true,
    run,
};

fn check(values: &Values, model: &Model) -> Result<(), Complaint> {
    let mut known: Vec<&str> = model.joints.iter().map(|joint| joint.name.as_str()).collect();
    known.extend(model.motions.iter().map(|motion| motion.on.as_str()));
    for name in values.names("loop").unwrap_or_default() {
        if !known.contains(&name.as_str()) {
            return Err(Complaint::unknown("loop", "joint or moved place", name, &known));
        }
    }
    if known.is_empty() {
        let help = "add a [[joint]] or a [[motion]], or ask for kind = \"orbit\"";
        return Err(Complaint::new("kind", "the model has no joint and no moved place, so it has no loop", help));
    }
    Ok(())
}

/// One loop to be drawn.
struct Loop {
    case: usize,
    omega: f64,
    name: String,
    displacement: Vec<f64>,
    force: Vec<f64>,
}

/// Where the force and displacement of a loop stand in a sample.
#[derive(Clone, Copy)]
enum Source {
    Joint(usize),
    Moved(usize),
}

impl Source {
    /// Displacement (m) and force (N).
    fn read(self, sample: &Sample) -> (f64, f64) {
        match self {
            Source::Joint(j) => (sample.joints[j].displacement, sample.joints[j].force),
            Source::Moved(m) => sample.moved[m],
        }
    }
}

fn run(_: &Study, cases: &[Prepared], context: &Context<'_>) -> Computed {
    let mut outcome = Outcome::default();
    let (mut table, mut summary) = (Rows::default(), Rows::default());
    let mut loops = Vec::new();
    let mut inaccurate = orbits::Inaccurate::default();
    let several = cases.iter().any(|prepared| prepared.case.frequencies.as_ref().is_some_and(|f| f.len() > 1));
    for (index, (prepared, points)) in cases.iter().zip(orbits::all(cases, context)).enumerate() {
        let sources = sources(prepared);
        for (omega, point) in points {
            let orbit = match point {
                Some(Ok(orbit)) => orbit,
                other => {
                    orbits::count_missing(&mut outcome, &prepared.case, omega, other.as_ref());
                    continue;
                }
            };
            outcome.count(|| place_of(&prepared.case, omega), orbit.evidence.accuracy.status(), None);
            inaccurate.add(&orbit);
            let times = orbits::times(&orbit, prepared.case.values.count("samples").unwrap_or(720) as usize);
            let samples: Vec<Sample> = times.iter().map(|t| orbit.sample(*t)).collect();
            for (name, source) in &sources {
                let mut one = Loop { case: index, omega, name: name.clone(), displacement: vec![], force: vec![] };
                for (time, sample) in times.iter().zip(&samples) {
                    let (displacement, force) = source.read(sample);
                    table.varied(&prepared.case);
                    if several {
                        table.number("frequency_Hz", hertz(omega));
                    }
                    table.text("joint", name);
                    table.number("time_s", *time);
                    table.number("displacement_m", displacement);
                    table.number("force_N", force);
                    table.end();
                    one.displacement.push(displacement);
                    one.force.push(force);
                }
                loops.push(one);
                let first = First::new(&orbit, *source);
                summary.varied(&prepared.case);
                if several {
                    summary.number("frequency_Hz", hertz(omega));
                }
                summary.text("joint", name);
                summary.number("dissipation_J", exact_loss(prepared, &orbit, *source).unwrap_or(first.loss));
                summary.number("equivalent_stiffness_N_per_m", first.stiffness);
                summary.number("equivalent_damping_kg_per_s", first.damping);
                summary.number("residual", orbit.evidence.residual);
                summary.number("energy_gap", orbit.evidence.energy_gap);
                summary.text("status", orbit.evidence.accuracy.status());
                summary.end();
            }
        }
    }
    outcome.notes.extend(inaccurate.notes());
    outcome.tables = vec![table.table("loops"), summary.table("loops_summary")];
    outcome.figure = panels(cases, &loops, several);
    Ok(outcome)
}

/// The loops that the study asks for.
fn sources(prepared: &Prepared) -> Vec<(String, Source)> {
    let system = &prepared.system;
    let all = || system.joints.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
    let mut names = prepared.case.values.names("loop").map_or_else(all, <[String]>::to_vec);
    if names.is_empty() {
        names = system.moved.iter().map(|place| place.name.clone()).collect();
    }
    let find = |name: &String| {
        let joint = system.joints.iter().position(|joint| joint.name == *name).map(Source::Joint);
        joint.or_else(|| system.moved.iter().position(|place| place.name == *name).map(Source::Moved))
    };
    names.iter().filter_map(|name| Some((name.clone(), find(name)?))).collect()
}

/// Loss per period where the orbit knows it in closed form: of a joint, and of the only source of work.
fn exact_loss(prepared: &Prepared, orbit: &Orbit, source: Source) -> Option<f64> {
    match source {
        Source::Joint(j) => Some(orbit.joints[j].dissipation),
        Source::Moved(_) if prepared.system.moved.len() == 1 && prepared.case.model.forces.is_empty() => {
            Some(orbit.energy.work_in)
        }
        Source::Moved(_) => None,
    }
}

/// First harmonic of a loop.
struct First {
    loss: f64,
    stiffness: f64,
    damping: f64,
}

/// Panels of the quadrature per period; they end at the switches, so that exact laws are smooth within each.
const QUADRATURE: usize = 256;
/// Nodes and weights of the 5-point Gauss-Legendre rule on [-1, 1]. Abramowitz and Stegun, Table 25.4.
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

impl First {
    /// `F₁ = (keq + jω ceq) U₁` with the first harmonics of force and displacement; loss `∮ F du`.
    fn new(orbit: &Orbit, source: Source) -> Self {
        let (omega, times) = (orbit.omega, orbits::times(orbit, QUADRATURE));
        // u cos, u sin, F cos, F sin
        let mut sums = [0.0; 4];
        let mut corners = Vec::with_capacity(times.len());
        for pair in times.windows(2) {
            let (middle, half) = (0.5 * (pair[0] + pair[1]), 0.5 * (pair[1] - pair[0]));
            for (node, weight) in GAUSS {
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

fn panels(cases: &[Prepared], loops: &[Loop], several: bool) -> Vec<Panel> {
    let largest = |values: fn(&Loop) -> &[f64]| loops.iter().flat_map(values).fold(0.0f64, |a, v| a.max(v.abs()));
    let (x_unit, x_factor) = display_unit(largest(|l| &l.displacement), "m");
    let (y_unit, y_factor) = display_unit(largest(|l| &l.force), "N");
    let mut panels: Vec<Panel> = Vec::new();
    let names: std::collections::BTreeSet<&str> = loops.iter().map(|l| l.name.as_str()).collect();
    for one in loops {
        let varied = &cases[one.case].case.varied;
        // the fastest varied parameter tells the loops of one panel apart, the others the panels
        let (outer, inner) = varied.split_at(varied.len().saturating_sub(1));
        let mut title: Vec<String> = outer.iter().map(|v| v.text.clone()).collect();
        if names.len() > 1 {
            title.push(one.name.clone());
        }
        let title = title.join(", ");
        let mut label: Vec<String> = inner.iter().map(|v| v.text.clone()).collect();
        if several {
            label.push(format!("{:.4} Hz", one.omega / TAU));
        }
        let at = panels.iter().position(|panel| panel.title == title).unwrap_or_else(|| {
            panels.push(Panel {
                title: title.clone(),
                x: Axis { quantity: "displacement".to_owned(), unit: x_unit.clone() },
                y: Axis { quantity: "force".to_owned(), unit: y_unit.clone() },
                series: Vec::new(),
            });
            panels.len() - 1
        });
        let colour = panels[at].series.len();
        panels[at].series.push(Series {
            label: if label.is_empty() { one.name.clone() } else { label.join(", ") },
            x: one.displacement.iter().map(|u| u * x_factor).collect(),
            y: one.force.iter().map(|f| f * y_factor).collect(),
            style: Style::Solid,
            colour,
        });
    }
    panels
}
