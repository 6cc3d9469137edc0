//! Branches of orbits by continuation, along the excitation frequency or a parameter, around
//! turning points.
//!
//! - `prominence`: peaks that exceed the error of their rows;
//! - `figure`: the figure.

mod figure;
mod prominence;

use self::prominence::LocalMaximum;
use super::shared::keys::{HARMONICS, OUTPUT, SERIES_SAMPLES, check_masses, check_output, check_samples};
use super::shared::orbit_sweep;
use super::shared::peak_of::{PEAK_OF, check_peak_of, largest_amplitude, peak_places};
use crate::case::study::{Study, VariedValue, varied_text};
use crate::case::values::{Frequencies, Values, hertz};
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::warnings::{resonance_warnings, undamped_resonance};
use crate::kinds::info::{KeyError, KindInfo};
use crate::kinds::kind::{Kind, Probe};
use crate::results::notes::Note;
use crate::results::table_builder::TableBuilder;
use crate::run::point_row::PointRow;
use crate::run::work::{Computed, UnitResult, UnitSize, UnitTask};
use crate::syntax::key::{Bounds, END_POINTS_RANGE, ValueType, default, required};
use std::f64::consts::TAU;
use stickslip::curve::continuation::{Branch, BranchContinuation, BranchEnd, TraceError};
use stickslip::dimension::Dimension;
use stickslip::method::Method;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::model::{Model, System};

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "branch",
        summary: "a branch of orbits by continuation around turning points: over a range of `frequency`, or at one \
            frequency over the last parameter of `vary`, from its first value to its last",
        keys: &[
            required(
                "frequency",
                ValueType::Frequencies(END_POINTS_RANGE),
                "excitation frequency: a range with its ends in either order (`steps` sets the spacing), or one \
                 value for a branch along a parameter",
                "{ from = \"119 Hz\", to = \"123 Hz\" }",
            ),
            default(
                "steps",
                ValueType::Count(2, 100_000),
                "100",
                "minimum number of steps over the range; steps shorten where the branch bends",
                "100",
            ),
            PEAK_OF,
            OUTPUT,
            default("harmonics", ValueType::Count(1, 255), "15", "highest harmonic", "15"),
            default("samples", ValueType::Count(8, 1 << 16), "1024", "samples per period", "1024"),
            default(
                "tolerance",
                ValueType::Quantity(Dimension::NONE, Bounds::Positive),
                // the truncation error of 15 harmonics with rigid friction, whose force decays
                // as 1/h, was measured as 5e-3 to 1e-2. The default is not higher, because a
                // branch turns at every border of stick, and 127 harmonics take forty times as
                // long
                "0.01",
                "a point whose estimated error, relative to the largest amplitude, exceeds this value is `truncated`",
                "0.001",
            ),
        ],
        check,
        axes: [None, Some(Dimension::LENGTH)],
        // branches always use harmonic balance
        uses_method: false,
        needs: |values, _, system| method(values).solver(system).map(drop),
        adapts: false,
        tables: &["branch", "peaks", "turns"],
    },
    // the cases of one branch along a parameter differ in the last parameter only
    unit_size: |study| if along_parameter(study) { UnitSize::Curve } else { UnitSize::Case },
    size,
    warnings: |cases| resonance_warnings(cases).into_iter().chain(undamped_resonance(cases)).collect(),
    probe: Probe::Unit { name: "branch" },
    compute,
    draw: figure::draw,
};

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let values = &inputs.case.values;
    let branches = if along_parameter(inputs.study) { inputs.curves() } else { inputs.cases };
    let steps = branches * values.count("steps").unwrap_or(100) as f64;
    let length = values.count("harmonics").unwrap_or(HARMONICS) as f64;
    let samples = values.count("samples").unwrap_or(SERIES_SAMPLES) as f64;
    // Points of a branch per requested step; the continuation shortens steps where the branch
    // bends. Measured: 3 to 15, and 109 for a ring of three whose branch turns at every border
    // of stick.
    let rows = steps * 5.0;
    PlannedSize {
        tables: vec![
            inputs.orbits(rows),
            // Peaks and turning points per branch.
            TableShape { rows: branches * 2.0, numbers: inputs.varied + 2.0, words: 0.0 },
        ],
        drawn: rows * inputs.places,
        unit: rows / branches * inputs.kept_series_bytes(length, samples) + inputs.series_bytes(length),
    }
}

fn check(values: &Values, model: &Model, values_of_last: usize) -> Result<(), KeyError> {
    check_masses(model)?;
    let none = |f: &Frequencies| f.get(0) == f.get(f.len() - 1) && (f.len() > 1 || values_of_last < 2);
    if values.frequencies("frequency").is_some_and(none) {
        return Err(KeyError::new("frequency", "a branch needs a range", RANGE_HELP));
    }
    check_peak_of(values, model)?;
    check_output(values)?;
    if values.quantity("tolerance").is_some_and(|tolerance| tolerance >= 1.0) {
        return Err(KeyError::new(
            "tolerance",
            "the tolerance must be below 1",
            "0.001 is a thousandth of the amplitude",
        ));
    }
    check_samples(values)
}

/// Help text: a branch needs a range of the frequency or of a parameter.
const RANGE_HELP: &str = "write frequency = { from = …, to = … }, or vary = { Ft = [ … ] } with two different values";

/// The reason why a branch is missing.
enum BranchFailure {
    NoRange,
    Trace(TraceError),
}

/// Returns true if branches run along the last varied parameter at one frequency.
fn along_parameter(study: &Study) -> bool {
    !study.varied().is_empty() && study.points() == study.cases()
}

/// Separates the parameters that distinguish branches from the parameter along a branch.
fn split_varied<'v>(study: &Study, varied: &'v [VariedValue]) -> (&'v [VariedValue], Option<&'v VariedValue>) {
    match varied.split_last() {
        Some((last, outer)) if along_parameter(study) => (outer, Some(last)),
        _ => (varied, None),
    }
}

/// Returns the column name of the parameter along a branch, and its factor from SI.
fn abscissa_column(along: Option<&VariedValue>) -> (String, f64) {
    along.map_or_else(|| ("frequency_Hz".to_owned(), 1.0 / TAU), |parameter| (parameter.name.clone(), 1.0))
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let prepared = work.case();
    let (outer, along) = split_varied(work.study, &prepared.case.varied);
    let label = || varied_text(outer);
    let mut part = UnitResult::default();
    let range = range(work, along);
    let found = follow(work, along, range);
    (0..work.cases.len() * work.points.len()).for_each(|_| (work.context.finished)());
    let branch = match found {
        Ok(branch) => branch,
        Err(BranchFailure::Trace(TraceError::Method(error))) => return Err((prepared.case.index, error)),
        Err(BranchFailure::Trace(TraceError::Start(error))) => {
            part.count(label, error.status(), Some(error.to_string()));
            return Ok(part);
        }
        Err(BranchFailure::NoRange) => {
            part.count(label, "no-range", Some(format!("a branch needs a range: {RANGE_HELP}")));
            return Ok(part);
        }
    };
    let places = peak_places(prepared);
    let (name, factor) = abscissa_column(along);
    let begin = |rows: &mut TableBuilder, value: f64| {
        outer.iter().map(VariedValue::column).for_each(|(name, value)| rows.number(&name, value));
        let (column, value) = match along {
            None => ("frequency_Hz".to_owned(), hertz(value)),
            Some(parameter) => VariedValue { si: value, ..parameter.clone() }.column(),
        };
        rows.number(&column, value);
    };
    let (mut rows, mut peaks, mut turns) = (TableBuilder::default(), TableBuilder::default(), TableBuilder::default());
    for point in &branch.points {
        let stable = point.orbit.is_stable();
        orbit_sweep::count(&mut part, &prepared.case, &point.orbit, stable, Note::for_branch);
        begin(&mut rows, point.value);
        PointRow::with_stability(prepared, &point.orbit, stable).write(prepared, &mut rows);
        rows.end_row();
    }
    for (value, height) in peaks_of(&branch, &places) {
        begin(&mut peaks, value);
        peaks.number("amplitude_m", height);
        peaks.reduction_error(prepared.system.reduction_evidence());
        peaks.end_row();
    }
    for point in branch.turns.iter().map(|turn| &branch.points[*turn]) {
        begin(&mut turns, point.value);
        turns.number("amplitude_m", largest_amplitude(&point.orbit, &places));
        turns.reduction_error(prepared.system.reduction_evidence());
        turns.end_row();
    }
    let reason = match branch.end {
        BranchEnd::Border => missing_range_text(&branch, range.0, range.1, &name, factor),
        BranchEnd::Stalled { parameter: at } => {
            Some(format!("the continuation stopped at {name} = {:.9}: no step converges", at * factor))
        }
        BranchEnd::Points => Some("the branch does not reach the end of its range".to_owned()),
        BranchEnd::Stopped => {
            Some("the next point is not an orbit: its mean forces or its energies do not balance".to_owned())
        }
    };
    if let Some(reason) = reason {
        let kept = format!(
            "{reason}; the tables contain the points up to there ({}). Try other `harmonics`, more `steps`, or kind = \
             \"response\", which solves each point separately",
            branch.points.len()
        );
        part.count(label, "stalled", Some(kept));
    }
    part.tables = vec![rows, peaks, turns];
    Ok(part)
}

/// Returns the peaks of a branch whose prominence exceeds the error of its rows.
fn peaks_of(branch: &Branch, places: &[usize]) -> Vec<(f64, f64)> {
    let heights: Vec<f64> = branch.points.iter().map(|point| largest_amplitude(&point.orbit, places)).collect();
    let errors: Vec<f64> =
        branch.points.iter().map(|point| point.orbit.evidence.error_estimate.unwrap_or(f64::NAN)).collect();
    // a peak lies between the rows before and after its nearest row
    let near = |row: usize, (value, height): (f64, f64)| {
        let [a, b, c] = [row - 1, row, row + 1].map(|row| branch.points[row].value);
        (a.min(b).min(c)..=a.max(b).max(c)).contains(&value)
            && heights[row] >= heights[row - 1]
            && heights[row] > heights[row + 1]
            && height >= heights[row]
    };
    let mut rows = 1..heights.len().saturating_sub(1);
    let place = |peak: &(f64, f64)| rows.find(|row| near(*row, *peak)).map(|row| LocalMaximum { row, height: peak.1 });
    let Some(tops) = branch.peaks.iter().map(place).collect::<Option<Vec<LocalMaximum>>>() else {
        return branch.peaks.clone();
    };
    let kept = prominence::prominent(&tops, &heights, &errors);
    branch.peaks.iter().zip(kept).filter(|(_, kept)| *kept).map(|(peak, _)| *peak).collect()
}

/// Returns the method that solves the orbits of a branch.
fn method(values: &Values) -> HarmonicBalance {
    let count = |key: &str, default: u64| values.count(key).unwrap_or(default) as usize;
    HarmonicBalance {
        harmonics: Some(count("harmonics", HARMONICS)),
        samples: Some(count("samples", SERIES_SAMPLES)),
        tolerance: values.quantity("tolerance"),
    }
}

/// States which part of the range is missing after the branch left the range, and what to do.
fn missing_range_text(branch: &Branch, from: f64, to: f64, name: &str, factor: f64) -> Option<String> {
    let reached = branch
        .points
        .iter()
        .map(|point| point.value)
        .fold(from, |far, value| if (value - from).abs() > (far - from).abs() { value } else { far });
    (!branch.reaches(to)).then(|| {
        format!(
            "the branch turns at {name} = {:.9} and leaves the range at its beginning, so the range up to {:.9} is \
             missing; begin at a value with a single orbit, or at the other end",
            reached * factor,
            to * factor
        )
    })
}

/// Returns the first and last value along a branch.
fn range(work: &UnitTask<'_>, along: Option<&VariedValue>) -> (f64, f64) {
    let last = &work.cases[work.cases.len() - 1];
    match (along, split_varied(work.study, &last.case.varied).1) {
        (Some(first), Some(last)) => (first.si, last.si),
        _ => (work.omega(work.points.start), work.omega(work.points.end - 1)),
    }
}

fn follow(work: &UnitTask<'_>, along: Option<&VariedValue>, range: (f64, f64)) -> Result<Branch, BranchFailure> {
    let prepared = work.case();
    if range.0 == range.1 {
        return Err(BranchFailure::NoRange);
    }
    let values = &prepared.case.values;
    let system = |value: f64| -> Option<System> {
        let case = work.study.case_with_parameter(prepared.case.index, &along?.name, value).ok()?;
        case.model.assemble().ok()
    };
    let steps = values.count("steps").unwrap_or(100) as f64;
    let at = |value: f64| {
        // derivatives also evaluate values near a point, so only whole steps count
        work.share.reach((steps * (value - range.0) / (range.1 - range.0)).floor() / steps);
        match along {
            None => (prepared.system.clone(), value),
            // the model has no excitation at an invalid value, so the branch ends before it
            Some(_) => system(value).map_or((prepared.system.clone(), 0.0), |system| (system, work.omega(0))),
        }
    };
    let places = peak_places(prepared);
    let trace = BranchContinuation {
        system_at: &at,
        method: method(values),
        range,
        step: (range.1 - range.0).abs() / steps,
        quantity: &|orbit| largest_amplitude(orbit, &places),
    };
    trace.branch().map_err(BranchFailure::Trace)
}
