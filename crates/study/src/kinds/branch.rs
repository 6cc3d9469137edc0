//! Branches of orbits by continuation, along the excitation frequency or a parameter, around
//! turning points.

mod standing;

use self::standing::Top;
use super::keys::{HARMONICS, OUTPUT, SERIES_SAMPLES, check_masses, check_output, check_samples};
use super::orbits;
use super::peak_of::{PEAK_OF, check_peak_of, displacements, peak_places, worst};
use crate::cost::{Cost, Costing, Shape};
use crate::dataset::{Axis, Figure, Panel, Series, Style, Table};
use crate::drawing::{Drawing, Stretch, largest, numbers};
use crate::draws;
use crate::info::Complaint;
use crate::info::KindInfo;
use crate::key::ENDS;
use crate::key::{Takes, Within, default, required};
use crate::kind::Kind;
use crate::note::Note;
use crate::point::Summary;
use crate::rows::Rows;
use crate::study::{Study, VariedValue, varied_text};
use crate::values::{Frequencies, Values, hertz};
use crate::warnings::{resonant, undamped};
use crate::work::{Computed, Grain, Part, Prepared, Work};
use std::f64::consts::TAU;
use stickslip::curve::continuation::{Branch, BranchContinuation, End, TraceError};
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
                Takes::Frequencies(ENDS),
                "excitation frequency: a range with its ends in either order (`steps` sets the spacing), or one \
                 value for a branch along a parameter",
                "{ from = \"119 Hz\", to = \"123 Hz\" }",
            ),
            default(
                "steps",
                Takes::Count(2, 100_000),
                "100",
                "minimum number of steps over the range; steps shorten where the branch bends",
                "100",
            ),
            PEAK_OF,
            OUTPUT,
            default("harmonics", Takes::Count(1, 255), "15", "highest harmonic", "15"),
            default("samples", Takes::Count(8, 1 << 16), "1024", "samples per period", "1024"),
            default(
                "tolerance",
                Takes::Quantity(Dimension::NONE, Within::Positive),
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
    grain: |study| if along_parameter(study) { Grain::Curve } else { Grain::Case },
    cost,
    warnings: |cases| resonant(cases).into_iter().chain(undamped(cases)).collect(),
    compute,
    draw,
};

/// Points of a branch per requested step; the continuation shortens steps where the branch
/// bends.
///
/// Measured: 3 to 15, and 109 for a ring of three whose branch turns at every border of stick.
const POINTS: f64 = 5.0;
/// Solutions of the full equations per requested step.
const FOLLOWED: f64 = 15.0;
/// Peaks and turning points per branch.
const MARKS: f64 = 2.0;

fn cost(costing: &Costing<'_>) -> Cost {
    let values = &costing.case.values;
    let branches = if along_parameter(costing.study) { costing.curves() } else { costing.cases };
    let steps = branches * values.count("steps").unwrap_or(100) as f64;
    let harmonics = values.count("harmonics").map(|h| h as f64);
    let length = harmonics.unwrap_or(HARMONICS as f64);
    let samples = values.count("samples").unwrap_or(SERIES_SAMPLES) as f64;
    let rows = steps * POINTS;
    Cost {
        tables: vec![costing.orbits(rows), Shape { rows: branches * MARKS, numbers: costing.varied + 2.0, words: 0.0 }],
        drawn: rows * costing.places,
        unit: rows / branches * costing.kept_series_bytes(length, samples) + costing.series_bytes(length),
        spared: None,
        work: rows * costing.extra() + steps * FOLLOWED * costing.sector() * costing.series(harmonics),
    }
}

fn check(values: &Values, model: &Model, values_of_last: usize) -> Result<(), Complaint> {
    check_masses(model)?;
    let none = |f: &Frequencies| f.get(0) == f.get(f.len() - 1) && (f.len() > 1 || values_of_last < 2);
    if values.frequencies("frequency").is_some_and(none) {
        return Err(Complaint::new("frequency", "a branch needs a range", RANGE));
    }
    check_peak_of(values, model)?;
    check_output(values)?;
    if values.quantity("tolerance").is_some_and(|tolerance| tolerance >= 1.0) {
        return Err(Complaint::new(
            "tolerance",
            "the tolerance must be below 1",
            "0.001 is a thousandth of the amplitude",
        ));
    }
    check_samples(values)
}

/// Help text: a branch needs a range of the frequency or of a parameter.
const RANGE: &str = "write frequency = { from = …, to = … }, or vary = { Ft = [ … ] } with two different values";

/// The reason why a branch is missing.
enum Missing {
    NoRange,
    Trace(TraceError),
}

/// Returns true if branches run along the last varied parameter at one frequency.
fn along_parameter(study: &Study) -> bool {
    !study.varied().is_empty() && study.points() == study.cases()
}

/// Separates the parameters that distinguish branches from the parameter along a branch.
fn split<'v>(study: &Study, varied: &'v [VariedValue]) -> (&'v [VariedValue], Option<&'v VariedValue>) {
    match varied.split_last() {
        Some((last, outer)) if along_parameter(study) => (outer, Some(last)),
        _ => (varied, None),
    }
}

/// Returns the column name of the parameter along a branch, and its factor from SI.
fn axis(along: Option<&VariedValue>) -> (String, f64) {
    along.map_or_else(|| ("frequency_Hz".to_owned(), 1.0 / TAU), |parameter| (parameter.name.clone(), 1.0))
}

fn compute(work: &Work<'_>) -> Computed {
    let prepared = work.case();
    let (outer, along) = split(work.study, &prepared.case.varied);
    let label = || varied_text(outer);
    let mut part = Part::default();
    let range = range(work, along);
    let found = follow(work, along, range);
    (0..work.cases.len() * work.points.len()).for_each(|_| (work.context.finished)());
    let branch = match found {
        Ok(branch) => branch,
        Err(Missing::Trace(TraceError::Method(error))) => return Err((prepared.case.index, error)),
        Err(Missing::Trace(TraceError::Start(error))) => {
            part.count(label, error.status(), Some(error.to_string()));
            return Ok(part);
        }
        Err(Missing::NoRange) => {
            part.count(label, "no-range", Some(format!("a branch needs a range: {RANGE}")));
            return Ok(part);
        }
    };
    let places = peak_places(prepared);
    let (name, factor) = axis(along);
    let begin = |rows: &mut Rows, value: f64| {
        outer.iter().map(VariedValue::column).for_each(|(name, value)| rows.number(&name, value));
        let (column, value) = match along {
            None => ("frequency_Hz".to_owned(), hertz(value)),
            Some(parameter) => VariedValue { si: value, ..parameter.clone() }.column(),
        };
        rows.number(&column, value);
    };
    let (mut rows, mut peaks, mut turns) = (Rows::default(), Rows::default(), Rows::default());
    for point in &branch.points {
        let stable = point.orbit.is_stable();
        orbits::count(&mut part, &prepared.case, &point.orbit, (stable, Note::on_branch));
        begin(&mut rows, point.value);
        Summary::of(prepared, &point.orbit, stable).write(prepared, &mut rows);
        rows.end();
    }
    for (value, height) in peaks_of(&branch, &places) {
        begin(&mut peaks, value);
        peaks.number("amplitude_m", height);
        peaks.reduced(prepared.system.reduction_evidence());
        peaks.end();
    }
    for point in branch.turns.iter().map(|turn| &branch.points[*turn]) {
        begin(&mut turns, point.value);
        turns.number("amplitude_m", worst(&point.orbit, &places));
        turns.reduced(prepared.system.reduction_evidence());
        turns.end();
    }
    let reason = match branch.end {
        End::Border => missing(&branch, range, (name.as_str(), factor)),
        End::Stalled { at } => {
            Some(format!("the continuation stopped at {name} = {:.9}: no step converges", at * factor))
        }
        End::Points => Some("the branch does not reach the end of its range".to_owned()),
        End::Stopped => {
            Some("the next point is not an orbit: its mean forces or its energies do not balance".to_owned())
        }
    };
    if let Some(reason) = reason {
        let kept = format!(
            "{reason}; the tables contain the {} points up to there, and kind = \"response\" solves each point \
             separately",
            branch.points.len()
        );
        part.count(label, "stalled", Some(kept));
    }
    part.tables = vec![rows, peaks, turns];
    Ok(part)
}

/// Returns the peaks of a branch whose prominence exceeds the error of its rows.
fn peaks_of(branch: &Branch, places: &[usize]) -> Vec<(f64, f64)> {
    let heights: Vec<f64> = branch.points.iter().map(|point| worst(&point.orbit, places)).collect();
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
    let place = |peak: &(f64, f64)| rows.find(|row| near(*row, *peak)).map(|row| Top { row, height: peak.1 });
    let Some(tops) = branch.peaks.iter().map(place).collect::<Option<Vec<Top>>>() else { return branch.peaks.clone() };
    let kept = standing::out(&tops, &heights, &errors);
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
fn missing(branch: &Branch, (from, to): (f64, f64), (name, factor): (&str, f64)) -> Option<String> {
    let reached = branch
        .points
        .iter()
        .map(|point| point.value)
        .fold(from, |far, value| if (value - from).abs() > (far - from).abs() { value } else { far });
    (!branch.reaches(to)).then(|| {
        format!(
            "the branch turns at {name} = {:.9} and leaves the range at its beginning, so the range up to {:.9} is \
             missing; begin where there is a single orbit, or at the other end",
            reached * factor,
            to * factor
        )
    })
}

/// Returns the first and last value along a branch.
fn range(work: &Work<'_>, along: Option<&VariedValue>) -> (f64, f64) {
    let last = &work.cases[work.cases.len() - 1];
    match (along, split(work.study, &last.case.varied).1) {
        (Some(first), Some(last)) => (first.si, last.si),
        _ => (work.omega(work.points.start), work.omega(work.points.end - 1)),
    }
}

fn follow(work: &Work<'_>, along: Option<&VariedValue>, range: (f64, f64)) -> Result<Branch, Missing> {
    let prepared = work.case();
    if range.0 == range.1 {
        return Err(Missing::NoRange);
    }
    let values = &prepared.case.values;
    let system = |value: f64| -> Option<System> {
        let case = work.study.case_with(prepared.case.index, &along?.name, value).ok()?;
        case.model.assemble().ok()
    };
    // the model has no excitation at an invalid value, so the branch ends before it
    let at = |value: f64| match along {
        None => (prepared.system.clone(), value),
        Some(_) => system(value).map_or((prepared.system.clone(), 0.0), |system| (system, work.omega(0))),
    };
    let places = peak_places(prepared);
    let trace = BranchContinuation {
        system_at: &at,
        method: method(values),
        range,
        step: (range.1 - range.0).abs() / values.count("steps").unwrap_or(100) as f64,
        quantity: &|orbit| worst(orbit, &places),
    };
    trace.branch().map_err(Missing::Trace)
}

/// Draws the branches; with several branches, only the place whose peak counts.
fn draw(drawing: &Drawing<'_>) -> Figure {
    let (Some(table), Ok(prepared)) = (drawing.table("branch"), Prepared::new(drawing.study, 0)) else {
        return Figure::default();
    };
    let (system, places) = (&prepared.system, peak_places(&prepared));
    let (outer, along) = split(drawing.study, &prepared.case.varied);
    let column = |place: usize| format!("{}_amplitude_m", system.places()[place]);
    let all = displacements(system);
    let (y, factor) = drawing.axis(1, "amplitude", largest(table, all.iter().copied().map(column)), "m");
    let (name, _) = axis(along);
    let along_unit = along.map_or("Hz".to_owned(), |parameter| parameter.on_axis().1);
    let stretches = drawing.stretches_of(table, outer.len());
    let one = stretches.len() == 1;
    let names: Vec<&str> = places.iter().map(|place| system.places()[*place].as_str()).collect();
    let y = if one { y } else { Axis { quantity: format!("amplitude of {}", names.join(", ")), ..y } };
    // with several branches, the curve is the largest amplitude of the places whose peak counts
    let shown: Vec<Vec<usize>> = match one {
        true => drawing.displacements(system).into_iter().map(|(_, place)| vec![place]).collect(),
        false => vec![places],
    };
    let unstable = unstable(table);
    let line_of = |stretch: &Stretch, places: &[usize], label: &str, colour: usize| -> Vec<Series> {
        let mut from = stretch.rows.start;
        // between two equal values at an end of the range, the branch runs outside the range
        let at = numbers(table, &name_of_axis(table, outer.len()), stretch.rows.clone());
        let leaves = |row: usize| row > 0 && at[row - 1] == at[row];
        let rows: Vec<usize> = (0..stretch.rows.len()).collect();
        let unstable = &unstable[stretch.rows.clone()];
        // unstable stretches are dashed; each stretch begins at the last point of the previous
        // stretch
        let runs = rows.chunk_by(|a, b| unstable[*a] == unstable[*b] && !leaves(*b)).map(|rows| {
            let run = &unstable[rows[0]..];
            let joined = usize::from(rows[0] > 0 && !leaves(rows[0]));
            let shown = from - joined..from + rows.len();
            from += rows.len();
            let all: Vec<Vec<f64>> = places.iter().map(|p| numbers(table, &column(*p), shown.clone())).collect();
            let largest = |i: usize| all.iter().map(|y| y[i]).fold(f64::NAN, f64::max);
            let y = (0..shown.len()).map(|i| largest(i) * factor).collect();
            let label = if run[0] { format!("{label}, unstable") } else { label.to_owned() };
            let line = Series::line(label, numbers(table, &name_of_axis(table, outer.len()), shown), y, colour);
            if run[0] { Series { style: Style::Dashed, ..line } } else { line }
        });
        runs.collect()
    };
    let quantity = if along.is_some() { name } else { "frequency".to_owned() };
    let x = Axis::new(quantity, along_unit);
    let panel = |title: String, series| Panel { title, x: x.clone(), y: y.clone(), series, ..Panel::default() };
    if drawing.study.draws().is_some() {
        let name = |places: &[usize]| {
            places.iter().map(|place| system.places()[*place].as_str()).collect::<Vec<_>>().join(", ")
        };
        let of_draw = |stretch: &Stretch, title: String| {
            let lines =
                shown.iter().enumerate().flat_map(|(colour, places)| line_of(stretch, places, &name(places), colour));
            vec![panel(title, lines.collect())]
        };
        // the parameter along the branch does not distinguish draws
        let apart: Vec<Stretch> = stretches
            .iter()
            .map(|stretch| Stretch { varied: stretch.varied[..outer.len()].to_vec(), ..stretch.clone() })
            .collect();
        return Figure { panels: draws::panels(drawing, &apart, &of_draw), ..Figure::default() };
    }
    let several = stretches.iter().flat_map(|stretch| shown.iter().map(move |places| (stretch, places)));
    let line = |(colour, (stretch, places)): (usize, (&Stretch, &Vec<usize>))| {
        let varied = || varied_text(&stretch.varied[..outer.len()]);
        let label = if one { system.places()[places[0]].clone() } else { varied() };
        line_of(stretch, places, &label, colour)
    };
    let series = several.enumerate().flat_map(line).collect();
    Figure { panels: vec![panel(String::new(), series)], ..Figure::default() }
}

/// Returns the name of the column along the branch, which follows the outer varied parameters.
fn name_of_axis(table: &Table, outer: usize) -> String {
    table.columns.get(outer).map_or_else(String::new, |column| column.name.clone())
}

/// Returns for every row whether it is known to be unstable.
fn unstable(table: &Table) -> Vec<bool> {
    match table.flags("stable") {
        Some(flags) => flags.iter().map(|stable| *stable == Some(false)).collect(),
        None => vec![false; table.rows()],
    }
}
