//! Orbits: the steady motion over one period, in time.

use super::{Computed, FREQUENCY, Kind, SAMPLES, orbits};
use crate::dataset::{Axis, Panel, Series, Style};
use crate::run::{Context, Outcome, Prepared, Rows, Summary, display_unit, place_of};
use crate::study::Study;
use crate::values::hertz;
use stickslip::orbit::{Contact, Orbit, Sample, Symmetry};

pub(super) const KIND: Kind = Kind {
    name: "orbit",
    summary: "the steady motion over one period: displacements, velocities, joint forces",
    keys: &[FREQUENCY, SAMPLES],
    check: |_, _| Ok(()),
    uses_method: true,
    run,
};

fn run(_: &Study, cases: &[Prepared], context: &Context<'_>) -> Computed {
    let mut outcome = Outcome::default();
    let (mut motion, mut summary, mut multipliers) = (Rows::default(), Rows::default(), Rows::default());
    let all = orbits::all(cases, context);
    let estimated = |point: &orbits::Point| matches!(&point.1, Some(Ok(orbit)) if orbit.evidence.truncation.is_some());
    let truncated = all.iter().flatten().any(estimated);
    let mut inaccurate = orbits::Inaccurate::default();
    for (prepared, points) in cases.iter().zip(all) {
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
            if orbit.is_one_of_many() {
                let which = match orbit.symmetry {
                    Symmetry::HalfPeriod => "the symmetric one is shown",
                    Symmetry::FullPeriod => "the one nearest to the first guess is shown",
                };
                outcome.notes.push(format!(
                    "{}: {} sticks for the whole period; the orbit is one of a continuum, {which}.",
                    place_of(&prepared.case, omega),
                    orbit.evidence.stuck.join(", ")
                ));
            }
            summary.varied(&prepared.case);
            summary.number("frequency_Hz", hertz(omega));
            Summary::new(&prepared.system, Ok(&orbit)).write(&prepared.system, truncated, &mut summary);
            summary.number("work_in_J", orbit.energy.work_in);
            summary.number("viscous_J", orbit.energy.viscous);
            summary.number("friction_J", orbit.energy.friction);
            summary.integer("switches", orbit.evidence.switches as u64);
            summary.end();
            for (index, multiplier) in orbit.multipliers().iter().enumerate() {
                multipliers.varied(&prepared.case);
                multipliers.number("frequency_Hz", hertz(omega));
                multipliers.integer("index", index as u64 + 1);
                multipliers.number("real", multiplier.re);
                multipliers.number("imaginary", multiplier.im);
                multipliers.number("modulus", multiplier.norm());
                multipliers.end();
            }
            let times = orbits::times(&orbit, prepared.case.values.count("samples").unwrap_or(720) as usize);
            let samples: Vec<Sample> = times.iter().map(|t| orbit.sample(*t)).collect();
            for (time, sample) in times.iter().zip(&samples) {
                motion.varied(&prepared.case);
                motion.number("frequency_Hz", hertz(omega));
                motion.number("time_s", *time);
                write_sample(prepared, sample, &mut motion);
                motion.end();
            }
            outcome.figure.extend(panels(prepared, &orbit, &times, &samples));
        }
    }
    outcome.notes.extend(inaccurate.notes());
    outcome.figure.truncate(MOST_PANELS);
    outcome.tables = vec![motion.table("orbit"), summary.table("orbits"), multipliers.table("multipliers")];
    Ok(outcome)
}

/// More panels than this say nothing; the tables have all.
const MOST_PANELS: usize = 12;

/// The cells of one instant.
pub(super) fn write_sample(prepared: &Prepared, sample: &Sample, rows: &mut Rows) {
    for (i, place) in prepared.system.places.iter().enumerate() {
        rows.number(&format!("{place}_displacement_m"), sample.displacement[i]);
        rows.number(&format!("{place}_velocity_m_per_s"), sample.velocity[i]);
    }
    for (joint, state) in prepared.system.joints.iter().zip(&sample.joints) {
        rows.number(&format!("{}_displacement_m", joint.name), state.displacement);
        rows.number(&format!("{}_velocity_m_per_s", joint.name), state.velocity);
        rows.number(&format!("{}_force_N", joint.name), state.force);
        rows.text(&format!("{}_contact", joint.name), word(state.contact));
    }
}

fn word(contact: Contact) -> &'static str {
    match contact {
        Contact::Stick => "stick",
        Contact::SlipForward => "slip+",
        Contact::SlipBackward => "slip-",
    }
}

/// Displacements of the masses, and forces of the joints, over time.
fn panels(prepared: &Prepared, orbit: &Orbit, times: &[f64], samples: &[Sample]) -> Vec<Panel> {
    let title = place_of(&prepared.case, orbit.omega);
    let (time_unit, time_factor) = display_unit(orbit.period(), "s");
    let x: Vec<f64> = times.iter().map(|t| t * time_factor).collect();
    let panel = |what: &str, si: &str, names: Vec<&str>, read: &dyn Fn(&Sample, usize) -> f64| {
        let largest = samples.iter().flat_map(|s| (0..names.len()).map(|i| read(s, i).abs())).fold(0.0, f64::max);
        let (unit, factor) = display_unit(largest, si);
        Panel {
            title: title.clone(),
            x: Axis { quantity: "time".to_owned(), unit: time_unit.clone() },
            y: Axis { quantity: what.to_owned(), unit },
            series: names
                .iter()
                .enumerate()
                .map(|(i, name)| Series {
                    label: (*name).to_owned(),
                    x: x.clone(),
                    y: samples.iter().map(|s| read(s, i) * factor).collect(),
                    style: Style::Solid,
                    colour: i,
                })
                .collect(),
        }
    };
    let system = &prepared.system;
    let mut panels = Vec::new();
    if system.dofs() > 0 {
        let names = system.places.iter().map(String::as_str).collect();
        panels.push(panel("displacement", "m", names, &|s, i| s.displacement[i]));
    }
    if !system.joints.is_empty() {
        let names = system.joints.iter().map(|joint| joint.name.as_str()).collect();
        panels.push(panel("joint force", "N", names, &|s, j| s.joints[j].force));
    }
    panels
}
