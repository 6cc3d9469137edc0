//! Performance curves: the resonance peak over a design parameter, and its minimum.

mod tables;

pub use tables::{Curve, Optimum, Point, curves};

use super::keys::{FREQUENCY, anything, check_masses};
use super::peak_of::{PEAK_OF, check_peak_of, peak_places};
use crate::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY as DRIVE, WAY_BACK};
use crate::cost::{Cost, Costing, Shape};
use crate::dataset::{Axis, Figure, Panel, Series};
use crate::drawing::{Drawing, Stretch, largest, numbers};
use crate::info::Complaint;
use crate::info::KindInfo;
use crate::kind::Kind;
use crate::note::Note;
use crate::note::WARNING;
use crate::percentiles::percentiles;
use crate::rows::Rows;
use crate::study::{VariedValue, varied_text};
use crate::values::{Values, hertz};
use crate::warnings::sampled;
use crate::work::{CONVERGED, Computed, Grain, Part, Prepared, Work};
use stickslip::curve::bidirectional_sweep;
use stickslip::curve::peak::held_amplitude;
use stickslip::curve::performance::{Performance, PerformanceCurve, PerformanceError, PerformanceRow};
use stickslip::dimension::Dimension;
use stickslip::method::MethodError;
use stickslip::model::Model;
use stickslip::orbit::Accuracy;

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: tables::NAME,
        summary: "the resonance peak over a design parameter (the last one of `vary`), with the optimum refined",
        keys: &[FREQUENCY, PEAK_OF],
        check,
        axes: [None, Some(Dimension::LENGTH)],
        uses_method: true,
        needs: anything,
        adapts: false,
        tables: &[tables::PERFORMANCE, tables::OPTIMUM],
    },
    grain: |_| Grain::Curve,
    cost,
    warnings: sampled,
    compute,
    draw,
};

/// Orbits that refine a peak, and parameter values that the search for an optimum tries.
const REFINING: f64 = 12.0;
const OPTIMUM: f64 = 35.0;

fn cost(costing: &Costing<'_>) -> Cost {
    let (cases, curves) = (costing.cases, costing.curves());
    let back = f64::from(u8::from(bidirectional_sweep::is_followed(costing.system())));
    let peak = costing.frequencies * costing.orbit() + (back * costing.frequencies + REFINING) * costing.between();
    let tried = if costing.study.last_varied() < FEWEST_VALUES { 0.0 } else { curves * OPTIMUM };
    Cost {
        tables: vec![
            Shape { rows: cases, numbers: costing.varied + 4.0, words: 1.0 },
            Shape { rows: curves, numbers: costing.varied + 2.0, words: 1.0 },
        ],
        drawn: cases,
        unit: costing.orbit_bytes(),
        work: (cases + tried) * peak,
        spared: (tried > 0.0).then_some((tried * peak, "if no optimum lies between the values")),
    }
}

/// Smallest number of parameter values, and of frequencies, that form a curve.
const FEWEST_VALUES: usize = 3;

fn check(values: &Values, model: &Model, _: usize) -> Result<(), Complaint> {
    check_masses(model)?;
    check_peak_of(values, model)?;
    if values.frequencies("frequency").is_some_and(|f| f.len() < FEWEST_VALUES) {
        let help = "write frequency = { from = …, to = …, points = … } around the resonance";
        return Err(Complaint::new("frequency", "a peak needs a range of frequencies", help));
    }
    Ok(())
}

fn compute(work: &Work<'_>) -> Computed {
    let mut part = Part::default();
    if work.case().case.varied.is_empty() || work.cases.len() < FEWEST_VALUES {
        part.notes.push(Note::Said(format!(
            "A performance curve needs at least {FEWEST_VALUES} values of one parameter: add vary = {{ Ft = [ … ] }} to [study]."
        )));
    }
    // the curve has ascending values, the table has them as listed
    let value = |case: &usize| split(&work.cases[*case]).map_or(0.0, |(_, inner)| inner.si);
    let mut order: Vec<usize> = (0..work.cases.len()).collect();
    order.sort_by(|a, b| value(a).total_cmp(&value(b)));
    let values: Vec<f64> = order.iter().map(value).collect();
    let curve = curve(work, &values).map_err(|error| (work.case().case.index, error))?;
    let mut listed: Vec<_> = order.iter().zip(&curve.rows).collect();
    listed.sort_by_key(|(case, _)| **case);
    let (mut rows, mut optima) = (Rows::default(), Rows::default());
    for (&case, row) in listed {
        let prepared = &work.cases[case];
        let (failed, status) = (row.failed > 0 || row.peak.is_none(), status(row));
        let reason = || match row.peak.and_then(|peak| peak.unresolved) {
            Some(why) => why.to_string(),
            None => format!("{} of the orbits on the frequency grid did not converge", row.failed),
        };
        part.count(|| prepared.case.label(), status, failed.then(reason));
        if row.inaccurate > 0 {
            let text = format!(
                "at {} frequencies of the grid the series is too short: its truncation error exceeds the `tolerance` \
                 of the method; examine one of them with kind = \"response\".",
                row.inaccurate
            );
            Note::of_case(&prepared.case.label(), text).join(&mut part.notes);
        }
        rows.varied(&prepared.case);
        rows.number(DRIVE, row.peak.map_or(f64::NAN, |peak| hertz(peak.omega)));
        rows.number(AMPLITUDE, row.peak.map_or(f64::NAN, |peak| peak.value));
        rows.flag(AT_RANGE_END, row.peak.map(|peak| peak.at_end));
        if bidirectional_sweep::is_followed(&prepared.system) {
            rows.flag(WAY_BACK, row.peak.map(|_| row.reverse_sweep_only));
        }
        rows.integer(tables::FAILED, row.failed as u64);
        rows.reduced(prepared.system.reduction_evidence());
        rows.text("status", status);
        rows.end();
    }
    if let Some((outer, inner)) = split(work.case()) {
        let best = curve.optimum;
        let peak = best.and_then(|row| row.peak);
        outer.iter().map(VariedValue::column).for_each(|(name, value)| optima.number(&name, value));
        let at_best = best.map(|row| VariedValue { si: row.value, ..inner.clone() });
        optima.number(&inner.column().0, at_best.map_or(f64::NAN, |value| value.column().1));
        optima.number(DRIVE, peak.map_or(f64::NAN, |peak| hertz(peak.omega)));
        optima.number(AMPLITUDE, peak.map_or(f64::NAN, |peak| peak.value));
        optima.reduced(work.case().system.reduction_evidence());
        optima.text("status", best.as_ref().map_or("none", status));
        optima.end();
        if best.is_none() {
            let why = no_optimum(work, &curve, (&inner.name, &order));
            Note::of_case(&varied_text(outer), format!("{WARNING}{why}")).join(&mut part.notes);
        }
    }
    part.tables = vec![rows, optima];
    Ok(part)
}

/// States why there is no optimum; `order` has the case of every row of the curve.
fn no_optimum(work: &Work<'_>, curve: &PerformanceCurve, (parameter, order): (&str, &[usize])) -> String {
    let level = curve.lowest();
    let height = |row: &usize| curve.rows[*row].peak.map_or(f64::NAN, |peak| peak.value);
    let text = |row: Option<&usize>| {
        let value = row.and_then(|row| work.cases[order[*row]].case.varied.last());
        value.map_or_else(String::new, |value| value.text.clone())
    };
    match level[..] {
        [] => format!("no peak was found at any value of {parameter}"),
        [_] => format!("the lowest peak is at an end of the values of {parameter}: extend the values"),
        _ if level.len() == curve.rows.len() && level.iter().all(|row| height(row) == 0.0) => format!(
            "no place of `peak_of` moves at any value of {parameter}, so there is no optimum: friction holds these \
             places, or no force reaches them; increase the excitation, or use other values"
        ),
        _ => format!(
            "{} values of {parameter}, from {} to {}, have the same lowest peak, so there is no single optimum",
            level.len(),
            text(level.first()),
            text(level.last())
        ),
    }
}

/// Returns the status of the orbits that support a peak.
fn status(row: &PerformanceRow) -> &'static str {
    match (row.failed > 0 || row.peak.is_none(), row.inaccurate) {
        (true, _) => "some-failed",
        (false, 0) => CONVERGED,
        (false, _) => Accuracy::Truncated.status(),
    }
}

/// Returns the outer varied parameters of a case, and the last one.
fn split(prepared: &Prepared) -> Option<(&[VariedValue], &VariedValue)> {
    prepared.case.varied.split_last().map(|(last, outer)| (outer, last))
}

fn curve(work: &Work<'_>, values: &[f64]) -> Result<PerformanceCurve, MethodError> {
    let first = work.case();
    let places = peak_places(first);
    let frequencies: Vec<f64> = work.points.clone().map(|index| work.omega(index)).collect();
    let range = frequencies.iter().fold((f64::INFINITY, 0.0f64), |(a, b), w| (a.min(*w), b.max(*w)));
    let parameter = split(first).map(|(_, inner)| inner.name.clone());
    let build = |value: f64| {
        let Some(name) = &parameter else { return Ok(first.system.clone()) };
        let case = work.study.case_with(first.case.index, name, value).map_err(|error| error.to_string())?;
        case.model.assemble().map_err(|error| error.to_string())
    };
    let performance = Performance {
        system: &build,
        method: &*first.method,
        range,
        points: frequencies.len(),
        quantities: &|orbit| {
            let held = held_amplitude(&first.system, orbit.omega);
            let amplitudes = places.iter().map(|place| orbit.places[*place].amplitude());
            amplitudes.map(|amplitude| if amplitude > held { amplitude } else { 0.0 }).collect()
        },
    };
    let result = performance.curve(values);
    (0..work.cases.len() * frequencies.len()).for_each(|_| (work.context.finished)());
    match result {
        Ok(curve) => Ok(curve),
        Err(PerformanceError::Method(error)) => Err(error),
        // every case was assembled before; intermediate values belong to the same model
        Err(PerformanceError::System { .. }) => Ok(PerformanceCurve { rows: Vec::new(), optimum: None }),
    }
}

/// Largest number of bands in the panel; more bands hide each other.
const MOST_BANDS: usize = 7;

fn draw(drawing: &Drawing<'_>) -> Figure {
    let (Some(table), outer) = (drawing.table(tables::PERFORMANCE), drawing.study.varied().len().saturating_sub(1))
    else {
        return Figure::default();
    };
    let stretches = drawing.stretches_of(table, outer);
    let Some(inner) = stretches.first().and_then(|stretch| stretch.varied.last()) else { return Figure::default() };
    let (y_axis, factor) = drawing.axis(1, "resonance peak", largest(table, [AMPLITUDE.to_owned()]), "m");
    let column = inner.column().0;
    let parameter = |table: &crate::dataset::Table, rows| numbers(table, &column, rows);
    let height = |table, rows| numbers(table, AMPLITUDE, rows).iter().map(|y| y * factor).collect::<Vec<f64>>();
    // several outer parameters have no common colour scale
    let varied = if outer == 1 { drawing.varied_axis(&stretches, 0) } else { None };
    let value = |curve: usize| {
        let parameter = varied.as_ref().and(stretches.get(curve))?.varied.first();
        parameter.map(|parameter| parameter.as_written().0)
    };
    let panel = |title: String, series| Panel {
        title,
        x: Axis::new(&inner.name, inner.on_axis().1),
        y: y_axis.clone(),
        series,
        ..Panel::default()
    };
    if drawing.study.draws().is_some() {
        // the stretches hold all parameters but the last; the first case represents a stretch
        let groups = drawing.by_listed(&stretches);
        let draws = drawing.draws(groups.iter().map(|(_, group)| group.len()).max().unwrap_or(0));
        let bands = groups.iter().take(MOST_BANDS).enumerate().flat_map(|(colour, (_, group))| {
            let curve =
                |stretch: &&Stretch| (parameter(table, stretch.rows.clone()), height(table, stretch.rows.clone()));
            let outer =
                group.first().map_or(&[][..], |stretch| &stretch.varied[drawing.study.drawn().min(outer)..outer]);
            percentiles(&group.iter().map(curve).collect::<Vec<_>>(), &varied_text(outer), colour)
        });
        return Figure { panels: vec![panel(draws, bands.collect())], ..Figure::default() };
    }
    let mut series = Vec::new();
    for (colour, stretch) in stretches.iter().enumerate() {
        let label = varied_text(&stretch.varied[..outer]);
        let label = if label.is_empty() { "peak".to_owned() } else { label };
        let (x, y) = (parameter(table, stretch.rows.clone()), height(table, stretch.rows.clone()));
        let mut points: Vec<(f64, f64)> = x.into_iter().zip(y).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(optima) = drawing.table(tables::OPTIMUM).filter(|optima| colour < optima.rows()) {
            // one row per curve; the refined optimum is a point of the line
            let best = (parameter(optima, colour..colour + 1)[0], height(optima, colour..colour + 1)[0]);
            if best.0.is_finite() {
                let at = points.partition_point(|point| point.0 < best.0);
                points.insert(at, best);
            }
        }
        let (x, y) = points.into_iter().unzip();
        series.push(Series { value: value(colour), ..Series::line(label, x, y, colour) });
    }
    if let Some(optima) = drawing.table(tables::OPTIMUM) {
        // one row per curve
        for row in 0..optima.rows() {
            let (x, y) = (parameter(optima, row..row + 1), height(optima, row..row + 1));
            if x[0].is_finite() {
                series.push(Series { value: value(row), ..Series::marks("optimum", x, y, row) });
            }
        }
    }
    Figure { panels: vec![panel(String::new(), series)], varied, ..Figure::default() }
}
