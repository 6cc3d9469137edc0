//! Performance curves: the resonance peak over a design parameter, and its minimum.
//!
//! - `tables`: names, columns and typed values of the tables;
//! - `figure`: the figure.

mod figure;
mod tables;

pub use tables::{Optimum, PeakCurve, PerformancePoint, curves};

use super::shared::keys::{FREQUENCY, check_masses, no_requirements};
use super::shared::orbit_sweep;
use super::shared::peak_of::{PEAK_OF, check_peak_of, peak_places};
use crate::case::study::{VariedValue, varied_text};
use crate::case::values::{Values, hertz};
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::warnings::sampling_warnings;
use crate::kinds::info::{KeyError, KindInfo};
use crate::kinds::kind::{Kind, Probe};
use crate::results::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY as DRIVE, REVERSE_SWEEP};
use crate::results::notes::{Note, WARNING};
use crate::results::table_builder::TableBuilder;
use crate::run::work::{CONVERGED, Computed, PreparedCase, UnitResult, UnitSize, UnitTask};
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
        needs: no_requirements,
        adapts: false,
        tables: &[tables::PERFORMANCE, tables::OPTIMUM],
    },
    unit_size: |_| UnitSize::Curve,
    size,
    warnings: sampling_warnings,
    probe: Probe::Points { compute: probe, excluded: |_| Some("the search for the optimum") },
    compute,
    draw: figure::draw,
};

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let (cases, curves) = (inputs.cases, inputs.curves());
    PlannedSize {
        tables: vec![
            TableShape { rows: cases, numbers: inputs.varied + 4.0, words: 1.0 },
            TableShape { rows: curves, numbers: inputs.varied + 2.0, words: 1.0 },
        ],
        drawn: cases,
        unit: inputs.orbit_bytes(),
    }
}

/// Smallest number of parameter values, and of frequencies, that form a curve.
const FEWEST_VALUES: usize = 3;

fn check(values: &Values, model: &Model, _: usize) -> Result<(), KeyError> {
    check_masses(model)?;
    check_peak_of(values, model)?;
    if values.frequencies("frequency").is_some_and(|f| f.len() < FEWEST_VALUES) {
        let help = "write frequency = { from = …, to = …, points = … } around the resonance";
        return Err(KeyError::new("frequency", "a peak needs a range of frequencies", help));
    }
    Ok(())
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let mut part = UnitResult::default();
    if work.case().case.varied.is_empty() || work.cases.len() < FEWEST_VALUES {
        part.notes.push(Note::Sentence(format!(
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
    let (mut rows, mut optima) = (TableBuilder::default(), TableBuilder::default());
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
            Note::for_case(&prepared.case.label(), text).merge_into(&mut part.notes);
        }
        rows.varied(&prepared.case);
        rows.number(DRIVE, row.peak.map_or(f64::NAN, |peak| hertz(peak.omega)));
        rows.number(AMPLITUDE, row.peak.map_or(f64::NAN, |peak| peak.value));
        rows.flag(AT_RANGE_END, row.peak.map(|peak| peak.at_end));
        if bidirectional_sweep::is_followed(&prepared.system) {
            rows.flag(REVERSE_SWEEP, row.peak.map(|_| row.reverse_sweep_only));
        }
        rows.integer(tables::FAILED, row.failed as u64);
        rows.reduction_error(prepared.system.reduction_evidence());
        rows.text("status", status);
        rows.end_row();
    }
    if let Some((outer, inner)) = split(work.case()) {
        let best = curve.optimum;
        let peak = best.and_then(|row| row.peak);
        outer.iter().map(VariedValue::column).for_each(|(name, value)| optima.number(&name, value));
        let at_best = best.map(|row| VariedValue { si: row.value, ..inner.clone() });
        optima.number(&inner.column().0, at_best.map_or(f64::NAN, |value| value.column().1));
        optima.number(DRIVE, peak.map_or(f64::NAN, |peak| hertz(peak.omega)));
        optima.number(AMPLITUDE, peak.map_or(f64::NAN, |peak| peak.value));
        optima.reduction_error(work.case().system.reduction_evidence());
        optima.text("status", best.as_ref().map_or("none", status));
        optima.end_row();
        if best.is_none() {
            let why = no_optimum(work, &curve, &inner.name, &order);
            Note::for_case(&varied_text(outer), format!("{WARNING}{why}")).merge_into(&mut part.notes);
        }
    }
    part.tables = vec![rows, optima];
    Ok(part)
}

/// Computes the orbits of some frequencies, as the search for a peak does.
fn probe(work: &UnitTask<'_>) -> Computed {
    let mut part = UnitResult::default();
    orbit_sweep::converged_orbits(work, &mut part)?;
    Ok(part)
}

/// States why there is no optimum; `order` has the case of every row of the curve.
fn no_optimum(work: &UnitTask<'_>, curve: &PerformanceCurve, parameter: &str, order: &[usize]) -> String {
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
fn split(prepared: &PreparedCase) -> Option<(&[VariedValue], &VariedValue)> {
    prepared.case.varied.split_last().map(|(last, outer)| (outer, last))
}

fn curve(work: &UnitTask<'_>, values: &[f64]) -> Result<PerformanceCurve, MethodError> {
    let first = work.case();
    let places = peak_places(first);
    let frequencies: Vec<f64> = work.points.clone().map(|index| work.omega(index)).collect();
    let range = frequencies.iter().fold((f64::INFINITY, 0.0f64), |(a, b), w| (a.min(*w), b.max(*w)));
    let parameter = split(first).map(|(_, inner)| inner.name.clone());
    let build = |value: f64| {
        let Some(name) = &parameter else { return Ok(first.system.clone()) };
        let case = work.study.case_with_parameter(first.case.index, name, value).map_err(|error| error.to_string())?;
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
