//! The tables of performance curves: names, columns, and their content as typed values.

use crate::case::study::{Study, VariedValue};
use crate::kinds::shared::peak_search::FAILED;
use crate::results::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY};
use crate::results::dataset::Dataset;
use crate::results::{Peak, Results, ResultsError};

/// Name of the kind.
pub(super) const NAME: &str = "performance";
/// One row per value of the parameter.
pub(super) const PERFORMANCE: &str = "performance";
/// One row per curve.
pub(super) const OPTIMUM: &str = "optimum";

/// The resonance peak over a parameter, the last one of `vary`.
#[derive(Debug, Clone, PartialEq)]
pub struct PeakCurve {
    /// The peak at each value of the parameter.
    pub points: Vec<PerformancePoint>,
    /// Its lowest point, refined between the values; `None` without an optimum between them.
    pub optimum: Option<Optimum>,
}

/// The resonance peak at one value of the parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct PerformancePoint {
    /// The varied parameters of the case; the last one is the parameter of the curve.
    pub varied: Vec<VariedValue>,
    /// The peak; `None` if no orbit was found.
    pub peak: Option<Peak>,
    /// Number of orbits on the frequency grid that were not found.
    pub failed_orbits: u64,
}

/// The value of the parameter with the lowest peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Optimum {
    /// The value in the unit of its column: SI, but hertz and degrees, as in
    /// [`VariedValue::column`].
    pub value: f64,
    /// Frequency of the peak, Hz.
    pub frequency: f64,
    /// The peak, m.
    pub amplitude: f64,
}

/// Returns the curves of a performance study, one for each combination of the outer parameters.
///
/// Curves that an interrupted run did not reach are absent.
///
/// # Errors
/// Returns a [`ResultsError`] if the dataset is of another kind or is not the result of
/// [`run`](crate::run::run()) for this study.
///
/// # Example
/// ```
/// use stickslip_study::{kinds::performance, read_study, run::{Context, run}};
/// let text = r#"
/// schema = 1
/// title = "Best slip limit"
/// [model]
/// template = "blade-couple"
/// [study]
/// kind = "performance"
/// frequency = { from = "120 Hz", to = "121.5 Hz", points = 31 }
/// vary = { Ft = ["5.5 N", "6.5 N", "7.5 N"] }
/// "#;
/// let study = read_study("couple.toml", text, &[]).unwrap();
/// let dataset = run(&study, &Context::without_progress(1)).unwrap();
/// let curves = performance::curves(&study, &dataset).unwrap();
/// assert!((curves[0].optimum.unwrap().value - 6.684).abs() < 0.01);
/// ```
pub fn curves(study: &Study, dataset: &Dataset) -> Result<Vec<PeakCurve>, ResultsError> {
    let results = Results::new(NAME, study, dataset)?;
    let Some(table) = results.table(PERFORMANCE)? else { return Ok(Vec::new()) };
    let (frequency, amplitude) = (table.numbers(FREQUENCY)?, table.numbers(AMPLITUDE)?);
    let (at_range_end, failed) = (table.flags(AT_RANGE_END)?, table.integers(FAILED)?);
    let varied = study.varied();
    let mut curves = Vec::new();
    for case_rows in results.case_rows(&table, varied.len().saturating_sub(1))? {
        let point = |row: usize| {
            let varied_values = study.varied_values(case_rows.case + row - case_rows.rows.start);
            let peak = |at_range_end| Peak { frequency: frequency[row], amplitude: amplitude[row], at_range_end };
            Some(PerformancePoint {
                varied: varied_values?,
                peak: at_range_end[row].map(peak),
                failed_orbits: failed[row],
            })
        };
        let points: Option<Vec<PerformancePoint>> = case_rows.rows.clone().map(point).collect();
        curves.push(PeakCurve { points: points.ok_or_else(|| table.foreign_rows())?, optimum: None });
    }
    let (Some(optima), true) = (results.table(OPTIMUM)?, !varied.is_empty()) else { return Ok(curves) };
    if optima.table.rows() != curves.len() {
        return Err(optima.foreign_rows());
    }
    let (frequency, amplitude) = (optima.numbers(FREQUENCY)?, optima.numbers(AMPLITUDE)?);
    for (row, curve) in curves.iter_mut().enumerate() {
        let parameter = curve.points.first().and_then(|point| point.varied.last());
        let column = parameter.ok_or_else(|| table.foreign_rows())?.column().0;
        let (value, frequency, amplitude) = (optima.numbers(&column)?[row], frequency[row], amplitude[row]);
        curve.optimum = value.is_finite().then_some(Optimum { value, frequency, amplitude });
    }
    Ok(curves)
}
