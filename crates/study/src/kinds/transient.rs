//! Transients: the motion in time from rest or from given displacements; free decay,
//! switched-on excitation, or run-up.

use super::keys::MOST_SAMPLES;
use super::orbit::write_sample;
use crate::cost::{Cost, Costing, Shape};
use crate::dataset::{Axis, Figure, Panel, Series, Table};
use crate::decay::{Decay, Motion};
use crate::drawing::{Drawing, MOST_CURVES, MOST_PANELS, Stretch, join, largest, numbers, thinned, words};
use crate::draws;
use crate::info::Complaint;
use crate::info::KindInfo;
use crate::key::RANGE;
use crate::key::{Key, Takes, Within, default, optional, required};
use crate::kind::Kind;
use crate::names::Names;
use crate::note::{Note, WARNING};
use crate::point::location_of;
use crate::rows::Rows;
use crate::start::{EQUILIBRIUM, Start, UNLOADED, beginnings, given, pulled};
use crate::values::{Values, hertz};
use crate::warnings::moved;
use crate::words::{display_unit, shown_hertz};
use crate::work::{CONVERGED, Computed, Grain, NOT_REACHED, Part, Prepared, Work};
use std::f64::consts::TAU;
use std::ops::Range;
use stickslip::dimension::Dimension;
use stickslip::method::WIDTH;
use stickslip::method::time_history::{Excitation, Instant, TimeHistory, TimeHistoryError};
use stickslip::model::Model;
use stickslip::orbit::Sample;

const FREQUENCY: Takes = Takes::Quantity(Dimension::FREQUENCY, Within::Positive);
const DURATION: Takes = Takes::Quantity(Dimension::TIME, Within::Positive);

/// Largest number of samples of one transient.
const MOST_STEPS: f64 = 1e7;

const RUN_UP: &[Key] = &[
    required("from", FREQUENCY, "excitation frequency at the start", "\"110 Hz\""),
    required("to", FREQUENCY, "excitation frequency at the end; it may be lower than `from`", "\"130 Hz\""),
    required("duration", DURATION, "time of the linear ramp", "\"10 s\""),
];

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "transient",
        summary: "motion in time from rest or given displacements: free decay, switched-on excitation, run-up",
        keys: &[
            optional(
                "frequency",
                Takes::Frequencies(RANGE),
                "excitation frequency; without it and without `run_up` the motion is a free decay",
                "\"121 Hz\"",
            ),
            optional(
                "run_up",
                Takes::Table(RUN_UP),
                "excitation frequency that changes linearly in time, in steps of one cycle: each cycle has a \
                 constant frequency and ends when the cycle of the linear ramp ends",
                "{ from = \"110 Hz\", to = \"130 Hz\", duration = \"10 s\" }",
            ),
            optional("duration", DURATION, "computed time; default for a run-up: its duration", "\"2 s\""),
            optional("cycles", Takes::Count(1, 1_000_000), "computed time in periods of `frequency`", "200"),
            optional(
                "start",
                Takes::ByName(Dimension::LENGTH),
                "initial displacements of masses that are pulled and released, see `begin`; default: zero",
                "{ blade1 = \"1 mm\" }",
            ),
            optional(
                "begin",
                Takes::Choice(beginnings),
                "initial state of the other masses and joints; default: `equilibrium` with `start`, otherwise \
                 `unloaded`",
                "\"unloaded\"",
            ),
            optional(
                "start_velocity",
                Takes::ByName(Dimension::VELOCITY),
                "initial velocities; default: zero",
                "{ blade1 = \"0.1 m/s\" }",
            ),
            default(
                "samples_per_cycle",
                Takes::Count(8, MOST_SAMPLES),
                "64",
                "points of the table per excitation period (for a run-up: of its highest frequency)",
                "64",
            ),
            optional("time_step", DURATION, "time step of the table; required for a free decay", "\"0.1 ms\""),
        ],
        check,
        axes: [Some(Dimension::TIME), Some(Dimension::LENGTH)],
        // exact and smooth laws are both integrated in time; no orbit is computed
        uses_method: false,
        needs: |_, options, system| TimeHistory::check(system, options.get(WIDTH).copied()),
        adapts: false,
        tables: &["motion", "motion_summary", "decay", "decay_summary"],
    },
    grain: |_| Grain::Case,
    cost,
    warnings: moved,
    compute,
    draw,
};

/// Returns the duration of one transient (s) and the number of its samples.
fn lengths(costing: &Costing<'_>) -> (f64, f64) {
    let values = &costing.case.values;
    let (low, high) = costing.range().unzip();
    let period = |omega: f64| TAU / omega;
    let cycles = values.count("cycles").zip(low).map(|(cycles, omega)| cycles as f64 * period(omega));
    let run_up = values.table("run_up").and_then(|table| table.quantity("duration"));
    let duration = values.quantity("duration").or(cycles).or(run_up).unwrap_or(0.0);
    let per_cycle = values.count("samples_per_cycle").unwrap_or(64) as f64;
    let step = values.quantity("time_step").or(high.map(|omega| period(omega) / per_cycle));
    (duration, step.filter(|step| *step > 0.0).map_or(0.0, |step| duration / step + 1.0))
}

fn cost(costing: &Costing<'_>) -> Cost {
    let (duration, samples) = lengths(costing);
    let points = costing.points();
    let table = costing.motion(points * samples);
    // the steps resolve both the excitation and the modes
    let fastest = costing.range().map_or(0.0, |(_, high)| high).max(costing.slowest_mode());
    let periods = duration * fastest / TAU;
    // the cycles of a free decay, and their summary
    let free = costing.range().is_none();
    let cycles = if free { points * periods.floor() } else { 0.0 };
    let summaries = if free { points } else { 0.0 };
    Cost {
        tables: vec![
            Shape { numbers: table.numbers + costing.several(), ..table },
            Shape { rows: points * costing.places, numbers: costing.varied + costing.several() + 2.0, words: 1.0 },
            Shape { rows: cycles, numbers: costing.varied + 4.0, words: 1.0 },
            Shape { rows: summaries, numbers: costing.varied + 10.0, words: 1.0 },
        ],
        drawn: points.min(MOST_PANELS as f64) * samples * costing.places,
        unit: 0.0,
        spared: None,
        work: points * (periods * costing.period() + costing.patterns(periods) + costing.reading(samples)),
    }
}

fn check(values: &Values, model: &Model, _: usize) -> Result<(), Complaint> {
    let free = Names::of_free_masses(model);
    for key in ["start", "start_velocity"] {
        for name in values.by_name(key).into_iter().flat_map(|table| table.keys()) {
            free.one(key, "free mass", name)?;
        }
    }
    let (drive, run_up) = (values.frequencies("frequency"), values.table("run_up"));
    let (duration, cycles) = (values.quantity("duration"), values.count("cycles"));
    if run_up.is_some() && drive.is_some() {
        return Err(Complaint::new("run_up", "`frequency` and `run_up` exclude each other", "remove one of them"));
    }
    if duration.is_some() && cycles.is_some() {
        return Err(Complaint::new("cycles", "`duration` and `cycles` exclude each other", "remove one of them"));
    }
    if cycles.is_some() && drive.is_none() {
        let help = "write `duration` instead, or add `frequency`";
        return Err(Complaint::new("cycles", "`cycles` counts periods of `frequency`, which is absent", help));
    }
    if let Some(run_up) = run_up
        && run_up.quantity("from") == run_up.quantity("to")
    {
        let help = "write `frequency` for a constant excitation frequency";
        return Err(Complaint::new("run_up", "`from` and `to` are the same frequency", help));
    }
    let lowest = drive.map(|f| f.iter().fold(f64::INFINITY, f64::min));
    let highest = match (drive, run_up) {
        (Some(f), _) => Some(f.iter().fold(0.0, f64::max)),
        (None, Some(r)) => r.quantity("from").into_iter().chain(r.quantity("to")).reduce(f64::max),
        (None, None) => None,
    };
    let period = |omega: f64| TAU / omega;
    let time = duration
        .or_else(|| Some(cycles? as f64 * period(lowest?)))
        .or_else(|| run_up.and_then(|run_up| run_up.quantity("duration")));
    let Some(time) = time else {
        let help = if drive.is_some() { "add `duration` or `cycles`" } else { "add `duration`" };
        return Err(Complaint::new("duration", "the duration of the motion is missing", help));
    };
    let per_cycle = values.count("samples_per_cycle").unwrap_or(64) as f64;
    let Some(step) = values.quantity("time_step").or(highest.map(|omega| period(omega) / per_cycle)) else {
        let help = "add `time_step`, for example \"0.1 ms\"";
        return Err(Complaint::new("time_step", "a free decay has no period to divide into samples", help));
    };
    if time / step > MOST_STEPS {
        let message = format!("the study needs {:.3e} samples; the limit is {MOST_STEPS:e}", time / step);
        return Err(Complaint::new("duration", message, "shorten `duration` or use fewer samples"));
    }
    Ok(())
}

fn compute(work: &Work<'_>) -> Computed {
    let prepared = work.case();
    let case = &prepared.case;
    let values = &case.values;
    let run_up = values.table("run_up").map(|table| Excitation::RunUp {
        from: table.quantity("from").unwrap_or(0.0),
        to: table.quantity("to").unwrap_or(0.0),
        duration: table.quantity("duration").unwrap_or(0.0),
    });
    let drives: Vec<Option<f64>> = match &case.frequencies {
        Some(frequencies) => frequencies.iter().map(Some).collect(),
        None => vec![None],
    };
    let mut part = Part::default();
    let pull = values.by_name("start");
    let begin = values.text("begin").unwrap_or(if pull.is_some() { EQUILIBRIUM } else { UNLOADED });
    let pulled = if begin == EQUILIBRIUM { pulled(&case.model, &prepared.system, pull) } else { None };
    if begin == EQUILIBRIUM && pulled.is_none() {
        let text = "the pulled structure has no static equilibrium, so the motion begins with unloaded joints, as \
            with begin = \"unloaded\"";
        part.notes.push(Note::of_case(&case.label(), format!("{WARNING}{text}")));
    }
    let start = pulled.unwrap_or_else(|| Start { displacement: given(&prepared.system, pull), states: Vec::new() });
    let (mut rows, mut extremes) = (Rows::default(), Rows::default());
    let (mut decay, mut summary) = (Rows::default(), Rows::default());
    for drive in drives {
        let excitation = drive.map(Excitation::Steady).or(run_up).unwrap_or(Excitation::Free);
        let fastest = match excitation {
            Excitation::Free => None,
            Excitation::Steady(omega) => Some(omega),
            Excitation::RunUp { from, to, .. } => Some(from.max(to)),
        };
        let cycles = values.count("cycles").zip(drive).map(|(cycles, omega)| cycles as f64 * TAU / omega);
        let run_up_time = values.table("run_up").and_then(|table| table.quantity("duration"));
        // `check` ensures that both values are given
        let duration = values.quantity("duration").or(cycles).or(run_up_time).unwrap_or(0.0);
        let per_cycle = values.count("samples_per_cycle").unwrap_or(64) as f64;
        let step = values.quantity("time_step").or(fastest.map(|w| TAU / w / per_cycle)).unwrap_or(duration);
        let transient = TimeHistory {
            displacement: start.displacement.clone(),
            velocity: given(&prepared.system, values.by_name("start_velocity")),
            states: start.states.clone(),
            excitation,
            duration,
            step,
            width: case.method.options.get(WIDTH).copied(),
        };
        let (mut sampled, mut stopped) = (false, false);
        // largest displacement of every place, and its time
        let mut largest = vec![(0.0f64, 0.0); prepared.system.places().len()];
        let mut decays = vec![Decay::default(); prepared.system.places().len()];
        let end = transient.visit(&prepared.system, &mut |instant| {
            let Instant { time, omega, state: sample, since } = instant;
            rows.varied(case);
            if work.several_frequencies() {
                rows.number("drive_frequency_Hz", hertz(drive.unwrap_or(0.0)));
            }
            rows.number(TIME, time);
            rows.number("frequency_Hz", hertz(omega));
            write_sample(prepared, sample, &mut rows);
            rows.end();
            sampled = true;
            // the turning points are located exactly only for the place that moves most
            let most = leader(&decays).filter(|_| excitation == Excitation::Free);
            for (i, (decay, along)) in decays.iter_mut().zip(prepared.system.place_axes()).enumerate() {
                let of_place = |sample: &Sample| [&sample.displacement, &sample.velocity].map(|x| along.component(x));
                let [x, v] = of_place(sample);
                let motion = |time: f64| of_place(&since(time));
                decay.add([time, x, v], (Some(i) == most).then_some(&motion as &Motion<'_>));
                if x.abs() > largest[i].0 {
                    largest[i] = (x.abs(), time);
                }
            }
            stopped = work.context.stopped();
            !stopped
        });
        // a motion without a sample has no largest displacement
        let displacements = prepared.system.place_axes().iter().map(|along| !along.is_rotation());
        let places = prepared.system.places().iter().zip(largest).zip(displacements).filter(|(_, counts)| *counts);
        for (place, (displacement, time)) in places.map(|(of, _)| of).filter(|_| sampled) {
            extremes.varied(case);
            if work.several_frequencies() {
                extremes.number("drive_frequency_Hz", hertz(drive.unwrap_or(0.0)));
            }
            extremes.text("mass", place);
            extremes.number("largest_displacement_m", displacement);
            extremes.number(TIME, time);
            extremes.reduced(prepared.system.reduction_evidence());
            extremes.end();
        }
        if let Some(reduction) = prepared.system.reduction_evidence().filter(|_| !prepared.system.joints().is_empty()) {
            Note::InTime(reduction.up_to).join(&mut part.notes);
        }
        if excitation == Excitation::Free {
            let unread = read_off(prepared, &decays, step, &mut decay, &mut summary);
            part.notes.extend(unread.map(|text| Note::of_case(&case.label(), text)));
        }
        (work.context.finished)();
        let at = || drive.map_or_else(|| case.label(), |omega| location_of(case, omega));
        match end {
            Ok(()) if stopped => part.count(at, NOT_REACHED, None),
            Ok(()) => part.count(at, CONVERGED, None),
            Err(TimeHistoryError::Method(error)) => return Err((case.index, error)),
            Err(error) => part.count(at, "breakdown", Some(error.to_string())),
        }
    }
    part.tables = vec![rows, extremes, decay, summary];
    Ok(part)
}

/// Returns the place with the largest range of samples.
fn leader(decays: &[Decay]) -> Option<usize> {
    (0..decays.len()).max_by(|&a, &b| decays[a].extent().total_cmp(&decays[b].extent()))
}

/// Samples per cycle that turning points need.
///
/// With 20 the damping ratio has an error of 1e-3 of the decrement of a cycle; with 3 it is
/// meaningless.
const PER_CYCLE: f64 = 20.0;

/// Writes frequency and damping, cycle by cycle, of the place that moves most.
///
/// Returns the warning for too few samples.
fn read_off(
    prepared: &Prepared,
    decays: &[Decay],
    step: f64,
    rows: &mut Rows,
    summary: &mut Rows,
) -> Option<&'static str> {
    let displacements = (0..decays.len()).filter(|place| !prepared.system.place_axes()[*place].is_rotation());
    let most = displacements.max_by(|&a, &b| decays[a].largest().total_cmp(&decays[b].largest()));
    let (mass, cycles) = most.map(|most| (&prepared.system.places()[most], decays[most].cycles()))?;
    if cycles.iter().any(|cycle| cycle.frequency * step * PER_CYCLE > 1.0) {
        return Some(
            "warning: the samples are too far apart to compute damping from the decay: use a `time_step` below a \
             twentieth of the period",
        );
    }
    for cycle in &cycles {
        rows.varied(&prepared.case);
        rows.number(TIME, cycle.time);
        rows.text("mass", mass);
        rows.number("amplitude_m", cycle.amplitude);
        rows.number("frequency_Hz", cycle.frequency);
        rows.number("damping_ratio", cycle.damping_ratio);
        rows.reduced(prepared.system.reduction_evidence());
        rows.end();
    }
    let highest = cycles.iter().max_by(|a, b| a.damping_ratio.total_cmp(&b.damping_ratio));
    let (Some(first), Some(last), Some(highest)) = (cycles.first(), cycles.last(), highest) else { return None };
    summary.varied(&prepared.case);
    summary.text("mass", mass);
    summary.integer("cycles", cycles.len() as u64);
    let named = [("first", first), ("largest", highest), ("last", last)];
    named.iter().for_each(|(when, cycle)| summary.number(&format!("{when}_damping_ratio"), cycle.damping_ratio));
    named.iter().for_each(|(when, cycle)| summary.number(&format!("{when}_amplitude_m"), cycle.amplitude));
    named.iter().for_each(|(when, cycle)| summary.number(&format!("{when}_frequency_Hz"), cycle.frequency));
    summary.reduced(prepared.system.reduction_evidence());
    summary.end();
    None
}

/// Name of the time column.
const TIME: &str = "time_s";

/// Draws damping over amplitude, cycle by cycle, of the place that moves most, with a curve for
/// every case.
fn damping(drawing: &Drawing<'_>, table: &Table, places: &[String]) -> Panel {
    let (unit, factor) = display_unit(largest(table, ["amplitude_m".to_owned()]), "m");
    let stretches = drawing.stretches(table);
    let line = |(colour, stretch): (usize, &&Stretch)| {
        let x = numbers(table, "amplitude_m", stretch.rows.clone()).iter().map(|x| x * factor).collect();
        let y = numbers(table, "damping_ratio", stretch.rows.clone()).iter().map(|y| 100.0 * y).collect();
        let place = words(table, "mass").get(stretch.rows.start).cloned().unwrap_or_default();
        // a single case has the colour of its place in the other panels
        if stretch.varied.is_empty() {
            let colour = places.iter().position(|name| *name == place).unwrap_or(colour);
            return Series::line(place, x, y, colour);
        }
        Series::line(stretch.label(), x, y, colour)
    };
    Panel {
        title: "damping of each cycle".to_owned(),
        x: Axis::new("amplitude", unit).log(),
        y: Axis::new("equivalent damping ratio", "%"),
        series: thinned(&stretches, MOST_CURVES).iter().enumerate().map(line).collect(),
        ..Panel::default()
    }
}

/// Draws a panel for every case and frequency, with a line for every place.
fn draw(drawing: &Drawing<'_>) -> Figure {
    let (Some(motion), Some(system)) = (drawing.table("motion"), drawing.system()) else { return Figure::default() };
    let drives = motion.numbers("drive_frequency_Hz");
    let column = |place: &String| format!("{place}_displacement_m");
    let panel = |title: String, rows: Range<usize>| {
        // draws in one panel share one unit
        let scope = if drawing.study.draws().is_some() { 0..motion.rows() } else { rows.clone() };
        let shown = drawing.displacements(&system);
        let places = system.places().iter().zip(system.place_axes()).filter(|(_, along)| !along.is_rotation());
        let all = places.flat_map(|(place, _)| numbers(motion, &column(place), scope.clone()));
        let highest = all.map(f64::abs).filter(|x| x.is_finite()).fold(0.0, f64::max);
        let (y, factor) = drawing.axis(1, "displacement", highest, "m");
        let last = numbers(motion, TIME, scope.clone()).into_iter().fold(0.0, f64::max);
        let (x, x_factor) = drawing.axis(0, "time", last, "s");
        let times: Vec<f64> = numbers(motion, TIME, rows.clone()).iter().map(|time| time * x_factor).collect();
        let line = |(place, i): &(String, usize)| {
            let displacement = numbers(motion, &column(place), rows.clone());
            Series::line(place, times.clone(), displacement.iter().map(|y| y * factor).collect(), *i)
        };
        Panel { title, x, y, series: shown.iter().map(line).collect(), ..Panel::default() }
    };
    let of_case = |stretch: &Stretch, title: String| -> Vec<Panel> {
        let Some(drives) = drives else { return vec![panel(title, stretch.rows.clone())] };
        let mut from = stretch.rows.start;
        let of_drive = |run: &[f64]| {
            let rows = from..from + run.len();
            from = rows.end;
            panel(join([title.clone(), format!("frequency = {}", shown_hertz(run[0]))]), rows)
        };
        let runs = drives[stretch.rows.clone()].chunk_by(|a, b| a == b);
        runs.take(MOST_PANELS).map(of_drive).collect()
    };
    let mut panels = draws::panels(drawing, &drawing.stretches(motion), &of_case);
    panels.truncate(MOST_PANELS);
    if let Some(decay) =
        drawing.table("decay").filter(|_| drawing.study.draws().is_none() && panels.len() < MOST_PANELS)
    {
        panels.push(damping(drawing, decay, system.places()));
    }
    Figure { panels, ..Figure::default() }
}
