//! Amplification: the largest amplitude of a mistuned disk over that of the tuned disk, each at
//! its peak.

use super::peaks::FoundPeak;
use super::tables;
use crate::case::study::varied_text;
use crate::case::values::{Frequencies, Values, hertz};
use crate::check::survey::SurveyedCase;
use crate::kinds::info::KeyError;
use crate::kinds::shared::peak_of::{displacements, largest_amplitude, named_places};
use crate::results::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY};
use crate::results::dataset::{Axis, Panel};
use crate::results::drawing::{CaseRows, FigureInput, numbers};
use crate::results::histogram;
use crate::results::table_builder::TableBuilder;
use crate::run::work::UnitTask;
use crate::syntax::key::{Key, ValueType, default};
use stickslip::curve::PointBudget;
use stickslip::curve::adaptive::AdaptiveCurve;
use stickslip::curve::peak::{self, CurvePoint, Peak};
use stickslip::method::{Request, solver_with_alternatives};
use stickslip::model::Model;
use stickslip::orbit::Orbit;

/// The key `amplification`.
pub(super) const KEY: Key = default(
    "amplification",
    ValueType::Flag,
    "false",
    "for a mistuned disk: its largest peak over the peak of the tuned disk, case by case in amplification.csv, with \
     the distribution over the cases",
    "true",
);

/// Checks the requirements of the key.
pub(super) fn check(values: &Values, model: &Model) -> Result<(), KeyError> {
    if values.flag(KEY.name) != Some(true) {
        return Ok(());
    }
    let (message, help) = if model.ring.is_none() {
        (
            "only a bladed disk has an amplification by mistuning",
            "state one sector, and add [disk] with `sectors` and `mistuning`",
        )
    } else if values.flag("peaks") == Some(false) {
        ("the amplification needs peaks, but `peaks` is false", "remove `peaks`")
    } else {
        return Ok(());
    };
    Err(KeyError::new(KEY.name, message, help))
}

/// Warns if no blade differs in any case, so that every amplification is one.
pub(super) fn tuned_warning(cases: &[SurveyedCase]) -> Option<String> {
    let asked = cases.iter().any(|one| one.case.values.flag(KEY.name) == Some(true));
    let tuned = cases.iter().all(|one| one.case.model.ring.is_some_and(|ring| ring.equal));
    (asked && tuned).then(|| {
        "all blades are equal, so the amplification is 1; add `mistuning` with a deviation to [disk]".to_owned()
    })
}

/// Writes the row of a case with the peaks `found`; returns the reason if there is no row.
pub(super) fn row(work: &UnitTask<'_>, found: &[FoundPeak], rows: &mut TableBuilder) -> Result<(), String> {
    let (prepared, largest) = (work.case(), |a: &&FoundPeak, b: &&FoundPeak| a.peak.value.total_cmp(&b.peak.value));
    let highest = found.iter().max_by(largest).ok_or("no peak was found")?;
    let tuned = tuned_peak(work)?.ok_or("the tuned disk has no peak")?;
    rows.varied(&prepared.case);
    rows.text(tables::MASS, &prepared.system.places()[highest.mass]);
    rows.number(FREQUENCY, hertz(highest.peak.omega));
    rows.number(AMPLITUDE, highest.peak.value);
    rows.number(tables::TUNED_FREQUENCY, hertz(tuned.omega));
    rows.number(tables::TUNED_AMPLITUDE, tuned.value);
    rows.number(tables::AMPLIFICATION_RATIO, highest.peak.value / tuned.value);
    rows.flag(AT_RANGE_END, Some(highest.peak.at_end || tuned.at_end));
    rows.reduction_error(prepared.system.reduction_evidence());
    rows.end_row();
    Ok(())
}

/// Returns the highest peak of the case without mistuning, at the same frequencies.
fn tuned_peak(work: &UnitTask<'_>) -> Result<Option<Peak>, String> {
    let prepared = work.case();
    let case = work.study.without_mistuning().case(prepared.case.index).map_err(|error| error.to_string())?;
    let system = case.model.assemble().map_err(|error| error.to_string())?;
    let mut places = named_places(prepared);
    if places.is_empty() {
        places = displacements(&system);
    }
    let quantities = |orbit: &Orbit| vec![largest_amplitude(orbit, &places)];
    let method = &*prepared.method;
    let points: Vec<CurvePoint> = match &case.frequencies {
        Some(Frequencies::Adaptive { from, to, tolerance }) => {
            let adaptive = AdaptiveCurve { range: (*from, *to), tolerance: *tolerance };
            let stop = || work.context.stopped();
            let curve =
                adaptive.curve(method, &system, &quantities, &|_| (), &stop).map_err(|error| error.to_string())?;
            curve.into_iter().map(|(point, ())| point).collect()
        }
        _ => {
            let mut solver = solver_with_alternatives(method, &system).map_err(|error| error.to_string())?;
            let (mut points, mut budget) = (Vec::<CurvePoint>::new(), PointBudget::default());
            for index in work.points.clone().take_while(|_| !work.context.stopped()) {
                let request = Request::at(work.omega(index)).near(points.last().and_then(|point| point.seed.as_ref()));
                let found = budget.solve(&mut *solver, &request);
                points.push(found.map_or_else(
                    |_| CurvePoint::failed(work.omega(index)),
                    |orbit| CurvePoint::new(&orbit, &quantities),
                ));
            }
            points
        }
    };
    let inner = peak::local_peaks(method, &system, &points, 1, &quantities).map_err(|error| error.to_string())?;
    let end = |point: &CurvePoint| {
        Some(Peak { omega: point.omega, value: *point.values.first()?, at_end: true, unresolved: None })
    };
    let ends = [points.first(), points.last()].into_iter().flatten().filter_map(end);
    Ok(inner.into_iter().map(|peak| peak.peak).chain(ends).max_by(|a, b| a.value.total_cmp(&b.value)))
}

/// Draws histograms of the amplification of many disks.
///
/// Draws, or the values of the last parameter of `vary`, form one histogram.
pub(super) fn panels(drawing: &FigureInput<'_>) -> Vec<Panel> {
    let Some(table) = drawing.table(tables::AMPLIFICATION) else { return Vec::new() };
    let cases = drawing.case_rows(table);
    let outer = |case_rows: &CaseRows| varied_text(&case_rows.varied[..case_rows.varied.len().saturating_sub(1)]);
    let groups: Vec<(String, Vec<&CaseRows>)> = match drawing.study.draws() {
        Some(_) => drawing.group_draws(&cases),
        None => cases.chunk_by(|a, b| outer(a) == outer(b)).map(|all| (outer(&all[0]), all.iter().collect())).collect(),
    };
    let x = Axis::new("amplification of the worst place", "");
    let at_end = table.flags(AT_RANGE_END).unwrap_or_default();
    let group_panel = |(words, group): (String, Vec<&CaseRows>)| {
        let rows = || group.iter().flat_map(|case_rows| case_rows.rows.clone());
        let values: Vec<f64> =
            rows().flat_map(|row| numbers(table, tables::AMPLIFICATION_RATIO, row..row + 1)).collect();
        let ends = rows().filter(|row| at_end.get(*row) == Some(&Some(true))).count();
        let ends = match ends {
            0 => String::new(),
            1 => "1 peak at the end of the range".to_owned(),
            ends => format!("{ends} peaks at the end of the range"),
        };
        let title = [words, "amplification".to_owned(), ends].into_iter().filter(|part| !part.is_empty());
        histogram::panel_of_maxima(&values, &x, &title.collect::<Vec<_>>().join(", "), "disks")
    };
    groups.into_iter().filter_map(group_panel).collect()
}
