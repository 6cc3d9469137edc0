//! Agreement of measured and fitted values, target by target and group by group.

use super::problem::FitProblem;
use super::tables::{ShownValue, shown_values};
use super::targets::Fitted;

/// A value and its place on the abscissa.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extreme {
    pub value: f64,
    pub x: f64,
}

/// Agreement in one group of a target, for one of its quantities.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Agreement {
    /// Index of the target, from 0.
    pub target: usize,
    /// Column name of the quantity.
    pub quantity: String,
    pub group: f64,
    pub rows: usize,
    /// The values with the largest magnitude.
    pub measured: Extreme,
    pub fitted: Extreme,
    /// Root mean square of the differences, relative to the largest measured magnitude.
    pub deviation: f64,
    /// Root mean square of the residuals, in standard deviations.
    pub rms_residual: f64,
}

/// Compares the values of all targets. A complex quantity counts by its magnitude, except in the
/// residuals.
pub(super) fn agreements(problem: &FitProblem, fitted: &[Fitted]) -> Vec<Agreement> {
    let mut found = Vec::new();
    for (index, (target, fitted)) in problem.targets.iter().zip(fitted).enumerate() {
        let names = target.quantities();
        let rows: Vec<_> =
            target.measured().values.chunks(names.len()).zip(fitted.values.chunks(names.len())).collect();
        for group in rows.chunk_by(|a, b| a.0[0].group == b.0[0].group) {
            let shown: Vec<_> = group
                .iter()
                .flat_map(|(measured, values)| {
                    let shown = shown_values(&**target, measured, values, &|_| Vec::new());
                    shown.into_iter().map(|value| (measured[0].x, value))
                })
                .collect();
            for (part, quantity) in names.iter().enumerate() {
                let own: Vec<_> = shown.iter().filter(|(_, value)| value.part == part).collect();
                let largest = |of: &dyn Fn(&ShownValue) -> f64| {
                    let values = own.iter().map(|(x, value)| Extreme { value: of(value), x: *x });
                    values.max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()))
                };
                let (Some(measured), Some(fitted)) = (largest(&|value| value.measured), largest(&|value| value.fitted))
                else {
                    continue;
                };
                let rms = |of: &dyn Fn(&ShownValue) -> f64| {
                    (own.iter().map(|(_, value)| of(value).powi(2)).sum::<f64>() / own.len() as f64).sqrt()
                };
                found.push(Agreement {
                    target: index,
                    quantity: quantity.clone(),
                    group: group[0].0[0].group,
                    rows: own.len(),
                    measured,
                    fitted,
                    deviation: rms(&|value| value.fitted - value.measured) / measured.value.abs(),
                    rms_residual: rms(&|value| value.residual),
                });
            }
        }
    }
    found
}

/// Returns a sentence for each group of the targets that were predicted: the largest value and its
/// place, and the typical deviation.
pub(super) fn predictions(problem: &FitProblem, agreements: &[Agreement]) -> Vec<String> {
    let predicted = agreements.iter().filter(|found| problem.targets[found.target].measured().is_predicted);
    let sentence = |found: &Agreement| {
        let target = &problem.targets[found.target];
        let (measured, predicted) = (found.measured, found.fitted);
        format!(
            "prediction of `{}`, group {}: largest value {:.6}, measured {:.6} ({:+.2} %), at {} {:.6}, measured {:.6} \
             ({:+.3} %); rms deviation of the rows {:.2} % of the largest value.",
            target.measured().data,
            found.group,
            predicted.value,
            measured.value,
            100.0 * (predicted.value / measured.value - 1.0),
            target.abscissa(),
            predicted.x,
            measured.x,
            100.0 * (predicted.x / measured.x - 1.0),
            100.0 * found.deviation
        )
    };
    predicted.map(sentence).collect()
}
