//! The resonance peak of a case: the conditions of its search, its row in a table, and its
//! status.

use super::keys::check_masses;
use super::peak_of::check_peak_of;
use crate::case::values::{Values, hertz};
use crate::kinds::info::KeyError;
use crate::results::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY, REVERSE_SWEEP};
use crate::results::notes::{Note, WARNING};
use crate::results::table_builder::TableBuilder;
use crate::run::work::{CONVERGED, PreparedCase, UnitResult, UnitTask};
use stickslip::curve::bidirectional_sweep;
use stickslip::curve::performance::PerformanceRow;
use stickslip::model::Model;
use stickslip::orbit::Accuracy;

/// Name of the column with the number of orbits on the frequency grid that were not found.
pub(in crate::kinds) const FAILED: &str = "failed_orbits";

/// Status of a peak for which orbits on the frequency grid are missing.
pub(in crate::kinds) const SOME_FAILED: &str = "some-failed";

/// Smallest number of parameter values, and of frequencies, that form a curve.
pub(in crate::kinds) const FEWEST_VALUES: usize = 3;

/// Checks that a study can have a resonance peak.
pub(in crate::kinds) fn check(values: &Values, model: &Model, _: usize) -> Result<(), KeyError> {
    check_masses(model)?;
    check_peak_of(values, model)?;
    if values.frequencies("frequency").is_some_and(|f| f.len() < FEWEST_VALUES) {
        let help = "write frequency = { from = …, to = …, points = … } around the resonance";
        return Err(KeyError::new("frequency", "a peak needs a range of frequencies", help));
    }
    Ok(())
}

/// Returns the lowest and the highest frequency of a unit, rad/s.
pub(in crate::kinds) fn range(work: &UnitTask<'_>) -> (f64, f64) {
    let frequencies = work.points.clone().map(|index| work.omega(index));
    frequencies.fold((f64::INFINITY, 0.0f64), |(low, high), omega| (low.min(omega), high.max(omega)))
}

/// Counts the peak of a case. Adds its failure and the note on its accuracy.
pub(in crate::kinds) fn count(prepared: &PreparedCase, row: &PerformanceRow, part: &mut UnitResult) {
    let failed = row.failed > 0 || row.peak.is_none();
    let reason = || match row.peak.and_then(|peak| peak.unresolved) {
        Some(why) => why.to_string(),
        None => format!("{} of the orbits on the frequency grid did not converge", row.failed),
    };
    part.count(|| prepared.case.label(), status(row), failed.then(reason));
    if row.inaccurate > 0 {
        let text = format!(
            "at {} of the grid the series is too short: its truncation error exceeds the `tolerance` of the method; \
             examine one of them with kind = \"response\".",
            frequencies(row.inaccurate)
        );
        Note::for_case(&prepared.case.label(), text).merge_into(&mut part.notes);
    }
    if row.unstable > 0 {
        let text = format!(
            "{WARNING}at {} of the grid the orbit is unstable: the real motion leaves it and may be larger than the \
             peak; examine it with kind = \"response\" or \"transient\".",
            frequencies(row.unstable)
        );
        Note::for_case(&prepared.case.label(), text).merge_into(&mut part.notes);
    }
    if row.peak.is_some_and(|peak| peak.at_end && peak.value > 0.0) {
        let text = "the largest amplitude is at an end of `frequency`, so the peak may lie outside; widen the range.";
        Note::for_case(&prepared.case.label(), format!("{WARNING}{text}")).merge_into(&mut part.notes);
    }
}

/// Returns a number of frequencies in words.
fn frequencies(count: usize) -> String {
    format!("{count} {}", if count == 1 { "frequency" } else { "frequencies" })
}

/// Writes the row of a case: its varied parameters, the peak and its status.
pub(in crate::kinds) fn write(prepared: &PreparedCase, row: &PerformanceRow, rows: &mut TableBuilder) {
    rows.varied(&prepared.case);
    rows.number(FREQUENCY, row.peak.map_or(f64::NAN, |peak| hertz(peak.omega)));
    rows.number(AMPLITUDE, row.peak.map_or(f64::NAN, |peak| peak.value));
    rows.flag(AT_RANGE_END, row.peak.map(|peak| peak.at_end));
    if bidirectional_sweep::is_followed(&prepared.system) {
        rows.flag(REVERSE_SWEEP, row.peak.map(|_| row.reverse_sweep_only));
    }
    rows.integer(FAILED, row.failed as u64);
    rows.reduction_error(prepared.system.reduction_evidence());
    rows.text("status", status(row));
    rows.end_row();
}

/// Returns the status of the orbits that support a peak.
pub(in crate::kinds) fn status(row: &PerformanceRow) -> &'static str {
    match (row.failed > 0 || row.peak.is_none(), row.inaccurate) {
        (true, _) => SOME_FAILED,
        (false, 0) => CONVERGED,
        (false, _) => Accuracy::Truncated.status(),
    }
}
