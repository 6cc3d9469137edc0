//! Performance curves: the resonance peak over a design parameter, and its minimum.
//!
//! - `tables`: names, columns and typed values of the tables;
//! - `figure`: the figure.

mod figure;
mod tables;

pub use tables::{Optimum, PeakCurve, PerformancePoint, curves};

use super::shared::keys::{FREQUENCY, no_requirements};
use super::shared::orbit_sweep;
use super::shared::peak_of::{PEAK_OF, moving_amplitudes, peak_places};
use super::shared::peak_search::{self, FEWEST_VALUES};
use crate::case::study::{VariedValue, varied_text};
use crate::case::values::hertz;
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::warnings::sampling_warnings;
use crate::kinds::info::KindInfo;
use crate::kinds::kind::{Kind, Probe};
use crate::results::columns::{AMPLITUDE, FREQUENCY as DRIVE};
use crate::results::notes::{Note, WARNING};
use crate::results::table_builder::TableBuilder;
use crate::run::work::{Computed, PreparedCase, UnitResult, UnitSize, UnitTask};
use stickslip::curve::performance::{Performance, PerformanceCurve, PerformanceError};
use stickslip::curve::sweep::Watch;
use stickslip::dimension::Dimension;
use stickslip::method::MethodError;

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: tables::NAME,
        summary: "the resonance peak over a design parameter (the last one of `vary`), with the optimum refined",
        keys: &[FREQUENCY, PEAK_OF],
        check: peak_search::check,
        axes: [None, Some(Dimension::LENGTH)],
        uses_method: true,
        needs: no_requirements,
        adapts: false,
        tables: &[tables::PERFORMANCE, tables::OPTIMUM],
    },
    unit_size: |_| UnitSize::Curve,
    size,
    warnings: sampling_warnings,
    probe: Probe::Points {
        compute: orbit_sweep::probe,
        excluded: |_| Some("the search for the optimum, which takes about 20 further values"),
    },
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
    if work.context.stopped() {
        return Ok(UnitResult::not_reached(work.cases.len() * work.points.len()));
    }
    let mut listed: Vec<_> = order.iter().zip(&curve.rows).collect();
    listed.sort_by_key(|(case, _)| **case);
    let (mut rows, mut optima) = (TableBuilder::default(), TableBuilder::default());
    for (&case, row) in listed {
        let prepared = &work.cases[case];
        peak_search::count(prepared, row, &mut part);
        peak_search::write(prepared, row, &mut rows);
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
        optima.text("status", best.as_ref().map_or("none", peak_search::status));
        optima.end_row();
        if best.is_none() {
            let why = no_optimum(work, &curve, &inner.name, &order);
            Note::for_case(&varied_text(outer), format!("{WARNING}{why}")).merge_into(&mut part.notes);
        }
    }
    part.tables = vec![rows, optima];
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

/// Returns the outer varied parameters of a case, and the last one.
fn split(prepared: &PreparedCase) -> Option<(&[VariedValue], &VariedValue)> {
    prepared.case.varied.split_last().map(|(last, outer)| (outer, last))
}

fn curve(work: &UnitTask<'_>, values: &[f64]) -> Result<PerformanceCurve, MethodError> {
    let first = work.case();
    let places = peak_places(first);
    let parameter = split(first).map(|(_, inner)| inner.name.clone());
    let build = |value: f64| {
        let Some(name) = &parameter else { return Ok(first.system.clone()) };
        let case = work.study.case_with_parameter(first.case.index, name, value).map_err(|error| error.to_string())?;
        case.model.assemble().map_err(|error| error.to_string())
    };
    let performance = Performance {
        system: &build,
        method: &*first.method,
        range: peak_search::range(work),
        points: work.points.len(),
        quantities: &|orbit| moving_amplitudes(&first.system, orbit, &places),
        watch: Watch { finished: &*work.context.finished, stop: &work.context.stop },
    };
    match performance.curve(values) {
        Ok(curve) => Ok(curve),
        Err(PerformanceError::Method(error)) => Err(error),
        // every case was assembled before; intermediate values belong to the same model
        Err(PerformanceError::System { .. }) => Ok(PerformanceCurve { rows: Vec::new(), optimum: None }),
    }
}
