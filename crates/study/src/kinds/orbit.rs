//! Orbits over one period, in time.

use super::keys::{FREQUENCY, OUTPUT, SAMPLES, anything, check_output};
use super::orbits;
use crate::cost::{Cost, Costing, Shape};
use crate::dataset::{Axis, Figure, Panel, Series};
use crate::drawing::{Drawing, MOST_PANELS, Stretch, join, largest, numbers};
use crate::draws;
use crate::info::KindInfo;
use crate::key::{Takes, default};
use crate::kind::Kind;
use crate::note::Note;
use crate::point::{Summary, location_of};
use crate::rows::Rows;
use crate::values::hertz;
use crate::warnings::driven;
use crate::words::{display_unit, shown_hertz};
use crate::work::{Computed, Part, Prepared, Work};
use std::ops::Range;
use stickslip::dimension::Dimension;
use stickslip::orbit::{Contact, Orbit, Sample, Symmetry};

/// Length of the state, with the states of joints, up to which the return of an orbit is
/// checked for every method. Measured: 12 s for a mistuned ring of 48 blades and joints, whose
/// state has length 144.
const FOLLOWED: usize = 200;

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "orbit",
        summary: "an orbit over one period: displacements, velocities, joint forces",
        keys: &[
            FREQUENCY,
            SAMPLES,
            OUTPUT,
            default(
                "multipliers",
                Takes::Flag,
                "false",
                "computes all Floquet multipliers into `multipliers.csv`; `stable` needs only the largest one",
                "true",
            ),
        ],
        check: |values, _, _| check_output(values),
        axes: [Some(Dimension::TIME), None],
        uses_method: true,
        needs: anything,
        adapts: false,
        tables: &["orbit", "orbits", "multipliers"],
    },
    grain: orbits::grain,
    cost,
    warnings: driven,
    compute,
    draw,
};

fn cost(costing: &Costing<'_>) -> Cost {
    let points = costing.points();
    let rows = points * costing.instants();
    let orbits = costing.orbits(points);
    let wanted = costing.case.values.flag("multipliers") == Some(true);
    // the return check of a harmonic balance orbit takes one period; multipliers take one more,
    // with the derivative
    let followed = if costing.is_series() { costing.period() } else { 0.0 };
    let (multipliers, map) = if wanted { (points * 2.0 * costing.masses, costing.period()) } else { (0.0, 0.0) };
    Cost {
        tables: vec![
            costing.motion(rows),
            Shape { numbers: orbits.numbers + 4.0, ..orbits },
            Shape { rows: multipliers, numbers: costing.varied + 5.0, words: 0.0 },
        ],
        // the panels beyond the limit are also built
        drawn: rows * (costing.places + costing.joints),
        unit: costing.kept_orbits(),
        spared: None,
        work: points * (costing.orbit() + followed + map + costing.extra() + costing.reading(costing.instants())),
    }
}

fn compute(work: &Work<'_>) -> Computed {
    let mut part = Part::default();
    let (mut motion, mut summary, mut multipliers) = (Rows::default(), Rows::default(), Rows::default());
    let prepared = work.case();
    for (orbit, stable) in orbits::found(work, &mut part)? {
        let omega = orbit.omega;
        one_of_many(prepared, &orbit).into_iter().for_each(|note| note.join(&mut part.notes));
        summary.varied(&prepared.case);
        summary.number("frequency_Hz", hertz(omega));
        let mut row = Summary::of(prepared, &orbit, stable);
        if orbit.initial_state.len() <= FOLLOWED {
            row.return_defect = orbit.return_defect().unwrap_or(f64::NAN);
        }
        row.write(prepared, &mut summary);
        summary.number("work_in_J", orbit.energy.work_in);
        summary.number("viscous_J", orbit.energy.viscous);
        summary.number("friction_J", orbit.energy.friction);
        summary.integer("switches", orbit.evidence.switches as u64);
        summary.end();
        let wanted = prepared.case.values.flag("multipliers") == Some(true);
        let all = if wanted { orbit.multipliers() } else { Some(Vec::new()) };
        if all.is_none() {
            let place = location_of(&prepared.case, omega);
            let text = "the multipliers are unknown, because the orbit has no return map.";
            Note::of_case(&place, text).join(&mut part.notes);
        }
        for (index, multiplier) in all.unwrap_or_default().iter().enumerate() {
            multipliers.varied(&prepared.case);
            multipliers.number("frequency_Hz", hertz(omega));
            multipliers.integer("index", index as u64 + 1);
            multipliers.number("real", multiplier.re);
            multipliers.number("imaginary", multiplier.im);
            multipliers.number("modulus", multiplier.norm());
            multipliers.reduced(prepared.system.reduction_evidence());
            multipliers.end();
        }
        for time in orbits::times(&orbit, prepared.case.values.count("samples").unwrap_or(720) as usize) {
            motion.varied(&prepared.case);
            motion.number("frequency_Hz", hertz(omega));
            motion.number("time_s", time);
            write_sample(prepared, &orbit.sample(time), &mut motion);
            motion.end();
        }
    }
    part.tables = vec![motion, summary, multipliers];
    Ok(part)
}

/// Returns the note that a permanently stuck joint makes the orbit one of a continuum.
///
/// It covers orbits with half-period symmetry; [`Note::History`] covers the others.
fn one_of_many(prepared: &Prepared, orbit: &Orbit) -> Option<Note> {
    (orbit.is_in_continuum() && orbit.symmetry == Symmetry::HalfPeriod).then(|| {
        let stuck = orbit.evidence.stuck.join(", ");
        let text =
            format!("permanently stuck: {stuck}; the orbit is one of a continuum, and the symmetric orbit is shown.");
        Note::of_case(&location_of(&prepared.case, orbit.omega), text)
    })
}

/// Writes the cells of one instant.
pub(super) fn write_sample(prepared: &Prepared, sample: &Sample, rows: &mut Rows) {
    let system = &prepared.system;
    for (place, along) in system.places().iter().zip(system.place_axes()) {
        let (what, unit) = if along.is_rotation() { ("rotation", "rad") } else { ("displacement", "m") };
        rows.number(&format!("{place}_{what}_{unit}"), along.component(&sample.displacement));
        rows.number(&format!("{place}_velocity_{unit}_per_s"), along.component(&sample.velocity));
    }
    for (joint, state) in prepared.system.joints().iter().zip(&sample.joints) {
        for (a, label) in joint.labels().enumerate() {
            rows.number(&format!("{label}_displacement_m"), state.displacement[a]);
            rows.number(&format!("{label}_velocity_m_per_s"), state.velocity[a]);
            rows.number(&format!("{label}_force_N"), state.force[a]);
        }
        let contact = if joint.law().has_faces() { word(state.contact) } else { "" };
        rows.text(&format!("{}_contact", joint.name()), contact);
    }
}

fn word(contact: Contact) -> &'static str {
    match contact {
        Contact::Stick => "stick",
        Contact::SlipForward => "slip+",
        Contact::SlipBackward => "slip-",
        Contact::Slip => "slip",
        Contact::Touch => "touch",
        Contact::Open => "open",
    }
}

/// Draws displacements of the places and forces of the joints over time: two panels per orbit.
fn draw(drawing: &Drawing<'_>) -> Figure {
    let (Some(motion), Some(system)) = (drawing.table("orbit"), drawing.system()) else { return Figure::default() };
    // a table from another source may lack columns
    let Some(frequencies) = motion.numbers("frequency_Hz") else { return Figure::default() };
    let times_of = |rows: Range<usize>| numbers(motion, "time_s", rows);
    let longest = times_of(0..motion.rows()).into_iter().fold(0.0, f64::max);
    let of_orbit = |title: &str, rows: Range<usize>| {
        let times = times_of(rows.clone());
        // draws in one panel share one unit
        let last = if drawing.study.draws().is_some() { longest } else { times.last().copied().unwrap_or(0.0) };
        let (time_unit, time_factor) = display_unit(last, "s");
        let x: Vec<f64> = times.iter().map(|time| time * time_factor).collect();
        let panel = |what: &str, si: &str, names: Vec<&str>, column: &str, colour: usize| {
            let columns: Vec<String> = names.iter().map(|name| format!("{name}_{column}")).collect();
            let (unit, factor) = display_unit(largest(motion, columns.clone()), si);
            let line = |(i, column): (usize, &String)| {
                let y = numbers(motion, column, rows.clone()).iter().map(|value| value * factor).collect();
                Series::line(names[i], x.clone(), y, colour + i)
            };
            Panel {
                title: format!("{what}, {title}"),
                x: Axis::new("time", time_unit.clone()),
                y: Axis::new(what, unit),
                series: columns.iter().enumerate().map(line).collect(),
                ..Panel::default()
            }
        };
        let mut panels = Vec::new();
        if !system.places().is_empty() {
            let shown = drawing.displacements(&system);
            let names = shown.iter().map(|(name, _)| name.as_str()).collect();
            panels.push(panel("displacement", "m", names, "displacement_m", 0));
        }
        if !system.joints().is_empty() {
            let labels: Vec<String> = system.joints().iter().flat_map(|joint| joint.labels()).collect();
            let names = labels.iter().map(String::as_str).filter(|name| drawing.shows(name)).collect();
            panels.push(panel("joint force", "N", names, "force_N", system.places().len()));
        }
        panels.retain(|panel| !panel.series.is_empty());
        panels
    };
    let of_case = |stretch: &Stretch, title: String| -> Vec<Panel> {
        let mut from = stretch.rows.start;
        let runs = frequencies[stretch.rows.clone()].chunk_by(|a, b| a == b).take(MOST_PANELS);
        let of_run = |run: &[f64]| {
            let rows = from..from + run.len();
            from = rows.end;
            of_orbit(&join([title.clone(), shown_hertz(run[0])]), rows)
        };
        runs.flat_map(of_run).collect()
    };
    let mut panels = draws::panels(drawing, &drawing.stretches(motion), &of_case);
    panels.truncate(MOST_PANELS);
    Figure { panels, ..Figure::default() }
}
