//! Performance curves: the resonance peak as a function of a design parameter, and its best value.

use super::peak_of::{check_peak_of, peak_place};
use super::{Complaint, Computed, FREQUENCY, Kind};
use crate::dataset::{Axis, Panel, Series, Style};
use crate::run::{CONVERGED, Context, NOT_REACHED, Outcome, Prepared, Rows, display_unit};
use crate::schema::{Takes, optional};
use crate::study::{Study, VariedValue, varied_text};
use crate::summary::WARNING;
use crate::values::Values;
use std::f64::consts::TAU;
use stickslip::curve::performance::{Performance, PerformanceCurve, PerformanceError, Row};
use stickslip::method::MethodError;
use stickslip::model::Model;
use stickslip::orbit::Accuracy;

pub(super) const KIND: Kind = Kind {
    name: "performance",
    summary: "the resonance peak over a design parameter (the last one of `vary`), with the optimum refined",
    keys: &[
        FREQUENCY,
        optional(
            "peak_of",
            Takes::Names,
            "the mass whose peak counts; the first one that a force acts on when absent",
            "\"blade1\"",
        ),
    ],
    check,
    uses_method: true,
    run,
};

/// Values of the parameter that make a curve.
const FEWEST_VALUES: usize = 3;

fn check(values: &Values, model: &Model) -> Result<(), Complaint> {
    check_peak_of(values, model, "name the mass whose peak is to be low")?;
    if values.frequencies("frequency").is_some_and(|f| f.len() < FEWEST_VALUES) {
        let help = "write frequency = { from = …, to = …, points = … } around the resonance";
        return Err(Complaint::new("frequency", "a peak needs a range of frequencies", help));
    }
    Ok(())
}

/// One curve: the cases that differ in the last varied parameter only.
struct Group<'a> {
    cases: &'a [Prepared],
    curve: PerformanceCurve,
}

fn run(study: &Study, cases: &[Prepared], context: &Context<'_>) -> Computed {
    let mut outcome = Outcome::default();
    let outer = |prepared: &Prepared| -> Vec<u64> {
        let varied = &prepared.case.varied;
        varied[..varied.len().saturating_sub(1)].iter().map(|v| v.si.to_bits()).collect()
    };
    let mut groups = Vec::new();
    for group in cases.chunk_by(|a, b| outer(a) == outer(b)) {
        let first = group[0].case.index;
        if group[0].case.varied.is_empty() || group.len() < FEWEST_VALUES {
            outcome.notes.push(format!(
                "A performance curve needs at least {FEWEST_VALUES} values of one parameter: add vary = {{ Ft = [ … ] }} to [study]."
            ));
        }
        if context.stopped() {
            outcome.count(|| group[0].case.label(), NOT_REACHED, None);
            continue;
        }
        let curve = curve(study, group, context).map_err(|error| (first, error))?;
        groups.push(Group { cases: group, curve });
    }
    let (mut rows, mut optima) = (Rows::default(), Rows::default());
    for group in &groups {
        for (prepared, row) in group.cases.iter().zip(&group.curve.rows) {
            let (failed, status) = (row.failed > 0 || row.peak.is_none(), status(row));
            let reason = || format!("{} of the orbits on the frequency grid did not converge", row.failed);
            outcome.count(|| prepared.case.label(), status, failed.then(reason));
            if row.inaccurate > 0 {
                outcome.notes.push(format!(
                    "{}: at {} frequencies of the grid the series is too short for the `tolerance` of the method; look at one with \
                     kind = \"response\".",
                    prepared.case.label(),
                    row.inaccurate
                ));
            }
            rows.varied(&prepared.case);
            rows.number("frequency_Hz", row.peak.map_or(f64::NAN, |peak| peak.omega / TAU));
            rows.number("amplitude_m", row.peak.map_or(f64::NAN, |peak| peak.value));
            rows.flag("at_range_end", row.peak.map(|peak| peak.at_end));
            rows.integer("failed_orbits", row.failed as u64);
            rows.text("status", status);
            rows.end();
        }
        let Some((varied, inner)) = split(&group.cases[0]) else { continue };
        for v in varied {
            optima.number(&v.name, v.si);
        }
        let best = group.curve.optimum;
        optima.number(&inner.name, best.map_or(f64::NAN, |row| row.value));
        optima.number("frequency_Hz", best.and_then(|row| row.peak).map_or(f64::NAN, |peak| peak.omega / TAU));
        optima.number("amplitude_m", best.and_then(|row| row.peak).map_or(f64::NAN, |peak| peak.value));
        optima.text("status", best.as_ref().map_or("none", status));
        optima.end();
        if best.is_none() {
            let at = if varied.is_empty() { String::new() } else { format!(" at {}", varied_text(varied)) };
            outcome.notes.push(format!(
                "{WARNING}the lowest peak stands at an end of the values of {}{at}: widen them",
                inner.name
            ));
        }
    }
    outcome.tables = vec![rows.table("performance"), optima.table("optimum")];
    outcome.figure = panel(&groups).into_iter().collect();
    Ok(outcome)
}

/// How far the orbits behind a peak may be trusted.
fn status(row: &Row) -> &'static str {
    match (row.failed > 0 || row.peak.is_none(), row.inaccurate) {
        (true, _) => "some-failed",
        (false, 0) => CONVERGED,
        (false, _) => Accuracy::Truncated.status(),
    }
}

/// The outer varied parameters of a case, and the last.
fn split(prepared: &Prepared) -> Option<(&[VariedValue], &VariedValue)> {
    prepared.case.varied.split_last().map(|(last, outer)| (outer, last))
}

fn curve(study: &Study, group: &[Prepared], context: &Context<'_>) -> Result<PerformanceCurve, MethodError> {
    let first = &group[0];
    let system = &first.system;
    let place = peak_place(first);
    let frequencies: Vec<f64> = first.case.frequencies.iter().flat_map(|f| f.iter()).collect();
    let range = frequencies.iter().fold((f64::INFINITY, 0.0f64), |(a, b), w| (a.min(*w), b.max(*w)));
    let parameter = split(first).map(|(_, inner)| inner.name.clone());
    let build = |value: f64| {
        let Some(name) = &parameter else { return Ok(system.clone()) };
        let case = study.case_with(first.case.index, name, value).map_err(|error| error.to_string())?;
        case.model.assemble().map_err(|error| error.to_string())
    };
    let performance = Performance {
        system: &build,
        method: &*first.method,
        range,
        points: frequencies.len(),
        quantity: &|orbit| orbit.places[place].amplitude(),
    };
    let values: Vec<f64> = group.iter().map(|p| split(p).map_or(0.0, |(_, inner)| inner.si)).collect();
    let result = performance.curve(&values);
    (0..group.len() * frequencies.len()).for_each(|_| (context.finished)());
    match result {
        Ok(curve) => Ok(curve),
        Err(PerformanceError::Method(error)) => Err(error),
        // every case was assembled when it was prepared; values between them are of the same model
        Err(PerformanceError::System { .. }) => Ok(PerformanceCurve { rows: Vec::new(), optimum: None }),
    }
}

fn panel(groups: &[Group<'_>]) -> Option<Panel> {
    let (_, inner) = split(groups.first()?.cases.first()?)?;
    let peaks = groups.iter().flat_map(|group| group.curve.rows.iter().filter_map(|row| row.peak));
    let (unit, factor) = display_unit(peaks.map(|peak| peak.value).fold(0.0, f64::max), "m");
    let si = inner.dimension.and_then(|d| d.name_and_unit()).map_or("", |(_, unit)| unit);
    let mut series = Vec::new();
    for (colour, group) in groups.iter().enumerate() {
        let rows = || group.curve.rows.iter().filter_map(|row| Some((row.value, row.peak?.value * factor)));
        let label = split(&group.cases[0]).map(|(outer, _)| varied_text(outer)).filter(|t| !t.is_empty());
        let (x, y) = rows().unzip();
        series.push(Series { label: label.unwrap_or_else(|| "peak".to_owned()), x, y, style: Style::Solid, colour });
        if let Some((value, peak)) = group.curve.optimum.and_then(|row| Some((row.value, row.peak?))) {
            let (x, y) = (vec![value], vec![peak.value * factor]);
            series.push(Series { label: "optimum".to_owned(), x, y, style: Style::Marks, colour });
        }
    }
    Some(Panel {
        title: String::new(),
        x: Axis { quantity: inner.name.clone(), unit: si.to_owned() },
        y: Axis { quantity: "resonance peak".to_owned(), unit },
        series,
    })
}
