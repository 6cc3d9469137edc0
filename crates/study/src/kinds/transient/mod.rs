//! Transients: the motion in time from rest or from given displacements; free decay,
//! switched-on excitation, or run-up.

mod extremes;
mod figure;
mod further_tables;
pub(super) mod record;
mod signal;

use super::orbit::write_sample;
use super::shared::keys::MAX_SAMPLES;
use crate::case::initial_state::{Start, StartKeys, begin_values};
use crate::case::values::{Values, hertz};
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::warnings::motion_warnings;
use crate::kinds::info::{KeyError, KindInfo};
use crate::kinds::kind::{Kind, Probe};
use crate::results::decay::{Cycle, Decay, PlaceMotionFn};
use crate::results::drawing::MAX_PANELS;
use crate::results::notes::{Note, WARNING};
use crate::results::table_builder::TableBuilder;
use crate::run::point_row::describe_location;
use crate::run::work::{CONVERGED, Computed, NOT_CONVERGED, NOT_REACHED, PreparedCase, UnitResult, UnitSize, UnitTask};
use crate::syntax::format::format_significant;
use crate::syntax::key::{Bounds, FREQUENCY_RANGE, Key, ValueType, default, optional, required};
use extremes::Extremes;
use further_tables::History;
use record::Records;
use std::f64::consts::TAU;
use stickslip::dimension::Dimension;
use stickslip::method::WIDTH;
use stickslip::method::time_history::{Excitation, SweepScale, TimeHistory, TimeHistoryError, TimeSample};
use stickslip::model::Model;
use stickslip::orbit::Sample;

/// Name of the time column.
const TIME: &str = "time_s";

const FREQUENCY: ValueType = ValueType::Quantity(Dimension::FREQUENCY, Bounds::Positive);
const DURATION: ValueType = ValueType::Quantity(Dimension::TIME, Bounds::Positive);

const RUN_UP: &[Key] = &[
    required("from", FREQUENCY, "excitation frequency at the start", "\"110 Hz\""),
    required("to", FREQUENCY, "excitation frequency at the end; it may be lower than `from`", "\"130 Hz\""),
    required("duration", DURATION, "time of the change", "\"10 s\""),
    default("scale", ValueType::Choice(sweep_scales), "linear", "linear or logarithmic in time", "\"log\""),
];

fn sweep_scales() -> Vec<(&'static str, &'static str)> {
    vec![("linear", "equal differences in equal times"), ("log", "equal ratios in equal times")]
}

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "transient",
        summary: "motion over time from rest or given displacements: free decay, switched-on excitation, run-up",
        keys: &[
            optional(
                "frequency",
                ValueType::Frequencies(FREQUENCY_RANGE),
                "excitation frequency; without it and without `run_up` the motion is a free decay",
                "\"121 Hz\"",
            ),
            optional(
                "run_up",
                ValueType::Table(RUN_UP),
                "excitation frequency that changes in time. It is constant within each cycle, and cycles end at the instants of \
                 the continuous change",
                "{ from = \"110 Hz\", to = \"130 Hz\", duration = \"10 s\" }",
            ),
            optional("duration", DURATION, "computed time; default for a run-up: its duration", "\"2 s\""),
            optional("cycles", ValueType::Count(1, 1_000_000), "computed time in periods of `frequency`", "200"),
            optional(
                "start",
                ValueType::ByName(Dimension::LENGTH),
                "initial displacements of masses and places that are pulled and released, see `begin`; default: zero",
                "{ blade1 = \"1 mm\" }",
            ),
            optional(
                "begin",
                ValueType::Choice(begin_values),
                "initial state of the other masses and joints; default: `equilibrium` with `start`, otherwise \
                 `unloaded`",
                "\"unloaded\"",
            ),
            optional(
                "start_velocity",
                ValueType::ByName(Dimension::VELOCITY),
                "initial velocities of masses; default: zero",
                "{ blade1 = \"0.1 m/s\" }",
            ),
            default(
                "samples_per_cycle",
                ValueType::Count(8, MAX_SAMPLES),
                "64",
                "points of the table per excitation period (for a run-up: of its highest frequency)",
                "64",
            ),
            optional(
                "also",
                ValueType::Names,
                "further tables: `joint_work` (work done on every joint since the beginning, with the energy in its springs), \
                 `spectrum` (power spectral density of every displacement), `shock_spectrum` (largest acceleration of \
                 oscillators with 5 % damping on every place)",
                "[\"joint_work\"]",
            ),
            optional("time_step", DURATION, "time step of the table; required for a free decay", "\"0.1 ms\""),
        ],
        check,
        axes: [Some(Dimension::TIME), Some(Dimension::LENGTH)],
        // exact and smooth laws are both integrated in time; no orbit is computed
        uses_method: false,
        needs: |_, options, system| TimeHistory::check(system, options.get(WIDTH).copied()),
        adapts: false,
        tables: &[
            "motion",
            "motion_summary",
            "decay",
            "decay_summary",
            further_tables::JOINT_WORK,
            further_tables::SPECTRUM,
            further_tables::SHOCK_SPECTRUM,
        ],
    },
    unit_size: |_| UnitSize::Case,
    size,
    warnings: motion_warnings,
    probe: Probe::Unit { name: "case" },
    compute,
    draw: figure::draw,
};

/// Returns the duration of one transient (s) and the number of its samples.
fn lengths(inputs: &SizeInputs<'_>) -> (f64, f64) {
    let values = &inputs.case.values;
    let (low, high) = inputs.range().unzip();
    let period = |omega: f64| TAU / omega;
    let cycles = values.count("cycles").zip(low).map(|(cycles, omega)| cycles as f64 * period(omega));
    let run_up = values.table("run_up").and_then(|table| table.quantity("duration"));
    let duration = values.quantity("duration").or(cycles).or(run_up).unwrap_or(0.0);
    let per_cycle = values.count("samples_per_cycle").unwrap_or(64) as f64;
    let step = values.quantity("time_step").or(high.map(|omega| period(omega) / per_cycle));
    (duration, step.filter(|step| *step > 0.0).map_or(0.0, |step| duration / step + 1.0))
}

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let (duration, samples) = lengths(inputs);
    let points = inputs.points();
    let table = inputs.motion(points * samples);
    // the steps resolve both the excitation and the modes
    let fastest = inputs.range().map_or(0.0, |(_, high)| high).max(inputs.slowest_mode());
    let periods = duration * fastest / TAU;
    // the cycles of a free decay, and their summary
    let free = inputs.range().is_none();
    let cycles = if free { points * periods.floor() } else { 0.0 };
    let summaries = if free { points } else { 0.0 };
    let wanted = inputs.case.values.names("also").unwrap_or_default();
    let wants = |name: &str| wanted.iter().any(|wanted| wanted == name);
    let further = |name: &str, rows: f64| TableShape {
        rows: if wants(name) { points * rows } else { 0.0 },
        numbers: table.numbers,
        words: 0.0,
    };
    // displacements and work of all samples, and accelerations of all instants
    let instants = if wants(further_tables::SHOCK_SPECTRUM) { further_tables::INSTANTS } else { 0 };
    let kept = if wanted.is_empty() { 0.0 } else { 8.0 * (2 + instants) as f64 * samples * table.numbers };
    PlannedSize {
        tables: vec![
            TableShape { numbers: table.numbers + inputs.frequency_columns(), ..table },
            TableShape {
                rows: points * inputs.places,
                numbers: inputs.varied + inputs.frequency_columns() + 3.0,
                words: 1.0,
            },
            TableShape { rows: cycles, numbers: inputs.varied + 4.0, words: 1.0 },
            TableShape { rows: summaries, numbers: inputs.varied + 10.0, words: 1.0 },
            further(further_tables::JOINT_WORK, samples),
            further(further_tables::SPECTRUM, samples / 9.0),
            further(further_tables::SHOCK_SPECTRUM, 300.0),
        ],
        drawn: points.min(MAX_PANELS as f64) * samples * inputs.places,
        unit: kept,
    }
}

fn check(values: &Values, model: &Model, _: usize) -> Result<(), KeyError> {
    // Largest number of samples of one transient.
    let max_steps = 1e7;
    StartKeys::of(values).check_names(model)?;
    let unknown =
        values.names("also").unwrap_or_default().iter().find(|name| !further_tables::ALL.contains(&name.as_str()));
    if let Some(name) = unknown {
        return Err(KeyError::unknown_name("also", "table", name, &further_tables::ALL));
    }
    let (drive, run_up) = (values.frequencies("frequency"), values.table("run_up"));
    let (duration, cycles) = (values.quantity("duration"), values.count("cycles"));
    if run_up.is_some() && drive.is_some() {
        return Err(KeyError::new("run_up", "`frequency` and `run_up` exclude each other", "remove one of them"));
    }
    if duration.is_some() && cycles.is_some() {
        return Err(KeyError::new("cycles", "`duration` and `cycles` exclude each other", "remove one of them"));
    }
    if cycles.is_some() && drive.is_none() {
        let help = "write `duration` instead, or add `frequency`";
        return Err(KeyError::new("cycles", "`cycles` counts periods of `frequency`, which is absent", help));
    }
    if let Some(run_up) = run_up
        && run_up.quantity("from") == run_up.quantity("to")
    {
        let help = "write `frequency` for a constant excitation frequency";
        return Err(KeyError::new("run_up", "`from` and `to` are the same frequency", help));
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
        return Err(KeyError::new("duration", "the duration of the motion is missing", help));
    };
    let per_cycle = values.count("samples_per_cycle").unwrap_or(64) as f64;
    let Some(step) = values.quantity("time_step").or(highest.map(|omega| period(omega) / per_cycle)) else {
        let help = "add `time_step`, for example \"0.1 ms\"";
        return Err(KeyError::new("time_step", "a free decay has no period to divide into samples", help));
    };
    if time / step > max_steps {
        let message = format!("the study needs {:.3e} samples; the limit is {max_steps:e}", time / step);
        return Err(KeyError::new("duration", message, "shorten `duration` or use fewer samples"));
    }
    Ok(())
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let prepared = work.case();
    let case = &prepared.case;
    let values = &case.values;
    let run_up = values.table("run_up").map(|table| Excitation::RunUp {
        from: table.quantity("from").unwrap_or(0.0),
        to: table.quantity("to").unwrap_or(0.0),
        duration: table.quantity("duration").unwrap_or(0.0),
        scale: if table.text("scale") == Some("log") { SweepScale::Logarithmic } else { SweepScale::Linear },
    });
    // errors of records are found before the run
    let records = Records::new(work.study, case).unwrap_or(None);
    let drives: Vec<Option<f64>> = match &case.frequencies {
        Some(frequencies) => frequencies.iter().map(Some).collect(),
        None => vec![None],
    };
    let mut part = UnitResult::default();
    let start = Start::new(&prepared.system, &StartKeys::of(values));
    if start.lacks_equilibrium {
        let reason = "no static equilibrium was found to begin with: hold every body by a spring, a contact or \
            `start`, or use begin = \"unloaded\"";
        for drive in drives {
            let location = || drive.map_or_else(|| case.label(), |omega| describe_location(case, omega));
            part.count(location, NOT_CONVERGED, Some(reason.to_owned()));
            (work.context.finished)();
        }
        part.tables = (0..4 + further_tables::ALL.len()).map(|_| TableBuilder::default()).collect();
        return Ok(part);
    }
    if records.as_ref().is_some_and(Records::ground_moves) {
        let text = "the ground moves; displacements and velocities are relative to it, shock response spectra are not.";
        part.notes.push(Note::for_case(&case.label(), text));
    }
    let (mut rows, mut extremes) = (TableBuilder::default(), TableBuilder::default());
    let (mut decay, mut summary) = (TableBuilder::default(), TableBuilder::default());
    let wanted = values.names("also").unwrap_or_default();
    let mut further: Vec<TableBuilder> = further_tables::ALL.iter().map(|_| TableBuilder::default()).collect();
    let motions = drives.len() as f64;
    for (number, drive) in drives.into_iter().enumerate() {
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
            velocity: start.velocity.clone(),
            states: start.states.clone(),
            excitation,
            duration,
            step,
            width: case.method.options.get(WIDTH).copied(),
            tolerance: case.method.time_history_tolerance(),
        };
        let (mut sampled, mut stopped) = (false, false);
        let mut extremes_of_places = vec![Extremes::default(); prepared.system.places().len()];
        let mut decays = vec![Decay::default(); prepared.system.places().len()];
        let mut history = History::new(wanted);
        let is_free = excitation == Excitation::Free && records.is_none();
        let mut visitor = |instant: TimeSample<'_>| {
            let TimeSample { time, omega, state: sample, between: since } = instant;
            rows.varied(case);
            if work.several_frequencies() {
                rows.number("drive_frequency_Hz", hertz(drive.unwrap_or(0.0)));
            }
            rows.number(TIME, time);
            rows.number("frequency_Hz", hertz(omega));
            write_sample(prepared, sample, &mut rows);
            rows.end_row();
            sampled = true;
            if !wanted.is_empty() {
                history.add(prepared, records.as_ref(), (time, sample), since);
            }
            // the turning points are located exactly only for the place that moves most
            let most = largest_range(&decays).filter(|_| is_free);
            for (i, (decay, along)) in decays.iter_mut().zip(prepared.system.place_axes()).enumerate() {
                let motion_along =
                    |sample: &Sample| [&sample.displacement, &sample.velocity].map(|x| along.component(x));
                let [x, v] = motion_along(sample);
                let motion = |time: f64| motion_along(&since(time));
                decay.add([time, x, v], (Some(i) == most).then_some(&motion as &PlaceMotionFn<'_>));
                extremes_of_places[i].add([time, x, v]);
            }
            work.share.reach((number as f64 + time / duration) / motions);
            stopped = work.context.stopped();
            !stopped
        };
        let end = match &records {
            Some(records) => {
                let rest = duration + 2.0 * step;
                transient.visit_intervals(&mut |begin| records.interval(begin, rest), &mut visitor)
            }
            None => transient.visit(&prepared.system, &mut visitor),
        };
        let begin_row = |table: &mut TableBuilder| {
            table.varied(case);
            if work.several_frequencies() {
                table.number("drive_frequency_Hz", hertz(drive.unwrap_or(0.0)));
            }
        };
        history.write(prepared, &begin_row, &mut further);
        // a motion without a sample has no largest displacement
        let displacements = prepared.system.place_axes().iter().map(|along| !along.is_rotation());
        let places = prepared.system.places().iter().zip(&extremes_of_places).zip(displacements);
        let places: Vec<_> = places.filter(|(_, counts)| *counts && sampled).map(|(of, _)| of).collect();
        part.notes.extend(coarse_samples(&places).map(|text| Note::for_case(&case.label(), text)));
        for (place, found) in places {
            extremes.varied(case);
            if work.several_frequencies() {
                extremes.number("drive_frequency_Hz", hertz(drive.unwrap_or(0.0)));
            }
            extremes.text("mass", place);
            extremes.number("largest_displacement_m", found.largest);
            extremes.number(TIME, found.time);
            extremes.number("rms_displacement_m", found.rms());
            extremes.reduction_error(prepared.system.reduction_evidence());
            extremes.end_row();
        }
        if let Some(reduction) = prepared.system.reduction_evidence().filter(|_| !prepared.system.joints().is_empty()) {
            Note::TimeHistory(reduction.up_to).merge_into(&mut part.notes);
        }
        if is_free {
            let warning = write_decay(prepared, &decays, step, &mut decay, &mut summary);
            part.notes.extend(warning.map(|text| Note::for_case(&case.label(), text)));
        }
        (work.context.finished)();
        let location = || drive.map_or_else(|| case.label(), |omega| describe_location(case, omega));
        match end {
            Ok(()) if stopped => part.count(location, NOT_REACHED, None),
            Ok(()) => part.count(location, CONVERGED, None),
            Err(TimeHistoryError::Method(error)) => return Err((case.index, error)),
            Err(error) => part.count(location, "breakdown", Some(error.to_string())),
        }
    }
    part.tables = vec![rows, extremes, decay, summary];
    part.tables.extend(further);
    Ok(part)
}

/// Returns the warning for samples that do not follow the motion.
fn coarse_samples(places: &[(&String, &Extremes)]) -> Option<String> {
    // Distance of a sample from the cubic through its neighbours, relative to the largest
    // displacement: that of a sine at six samples a period.
    let coarse = 0.05;
    let largest = places.iter().map(|(_, found)| found.largest).fold(0.0, f64::max);
    let (place, _) = places.iter().find(|(_, found)| found.unresolved > coarse * largest)?;
    Some(format!(
        "{WARNING}the samples are too far apart to follow the motion of `{place}`: largest displacements, spectra and \
         figures depend on `time_step`; make it smaller"
    ))
}

/// Returns the place with the largest range of samples.
fn largest_range(decays: &[Decay]) -> Option<usize> {
    (0..decays.len()).max_by(|&a, &b| decays[a].extent().total_cmp(&decays[b].extent()))
}

/// Writes frequency and damping, cycle by cycle, of the place that moves most.
///
/// Returns the warning for too few samples, or for several modes.
fn write_decay(
    prepared: &PreparedCase,
    decays: &[Decay],
    step: f64,
    rows: &mut TableBuilder,
    summary: &mut TableBuilder,
) -> Option<String> {
    let displacements = (0..decays.len()).filter(|place| !prepared.system.place_axes()[*place].is_rotation());
    let most = displacements.max_by(|&a, &b| decays[a].largest().total_cmp(&decays[b].largest()));
    let (mass, cycles) = most.map(|most| (&prepared.system.places()[most], decays[most].cycles()))?;
    // Samples per cycle that turning points need. With 20 the damping ratio has an error of 1e-3
    // of the decrement of a cycle; with 3 it is meaningless.
    let highest = cycles.iter().map(|cycle| cycle.frequency).fold(0.0, f64::max);
    if highest * step * 20.0 > 1.0 {
        return Some(format!(
            "{WARNING}the samples are too far apart to compute damping from the decay: use a `time_step` of at most \
             {} ms, a twentieth of the shortest cycle",
            format_significant(1e3 / (20.0 * highest), 2)
        ));
    }
    for cycle in &cycles {
        rows.varied(&prepared.case);
        rows.number(TIME, cycle.time);
        rows.text("mass", mass);
        rows.number("amplitude_m", cycle.amplitude);
        rows.number("frequency_Hz", cycle.frequency);
        rows.number("damping_ratio", cycle.damping_ratio);
        rows.reduction_error(prepared.system.reduction_evidence());
        rows.end_row();
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
    summary.reduction_error(prepared.system.reduction_evidence());
    summary.end_row();
    growing_swings(mass, &cycles)
}

/// Returns the warning for a decay whose swings grow, as those of several modes do.
fn growing_swings(place: &str, cycles: &[Cycle]) -> Option<String> {
    // Growth in one cycle, as a negative damping ratio, above the error of the turning points.
    let growth = -1e-3;
    let growing = cycles.iter().filter(|cycle| cycle.damping_ratio < growth).count();
    (growing > 0).then(|| {
        format!(
            "{WARNING}the swings of `{place}` grow in {growing} of {} cycles, so that several modes take part, or \
             something supplies energy: frequency and damping of a cycle are not those of one mode; begin with a \
             displacement in the shape of one mode, or use kind `modes`",
            cycles.len()
        )
    })
}
