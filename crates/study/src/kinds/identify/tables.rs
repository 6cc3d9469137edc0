//! Tables of an identification.

use super::agreement::Agreement;
use super::problem::{DerivativesOf, FitProblem};
use super::profile::Profile;
use super::search::Found;
use super::statistics::Statistics;
use super::targets::{Fitted, Measured, Target};
use crate::case::values::table_unit;
use crate::results::table_builder::TableBuilder;
use crate::run::work::UnitTask;
use nalgebra::DMatrix;
use num_complex::Complex64;
use stickslip::dimension::Dimension;

/// The fitted parameters.
pub(super) const PARAMETERS: &str = "parameters";
/// Measured and fitted values, row by row.
pub(super) const FIT: &str = "fit";
/// Agreement in every group of every target.
pub(super) const TARGETS: &str = "fit_targets";
/// Quality of the fit.
pub(super) const SUMMARY: &str = "fit_summary";
/// Correlations of the parameters.
pub(super) const CORRELATIONS: &str = "correlations";

/// Rise of the loss over each parameter.
pub(super) const PROFILE: &str = "profile";

/// The result of a case.
pub(super) struct FitOutcome<'a> {
    pub found: &'a Found,
    pub statistics: &'a Statistics,
    pub fitted: &'a [Fitted],
    pub agreements: &'a [Agreement],
    /// One profile for each parameter; empty if none was requested.
    pub profiles: &'a [Profile],
}

/// Writes the rows of all tables of a case.
pub(super) fn write(work: &UnitTask<'_>, problem: &FitProblem, outcome: &FitOutcome<'_>) -> Vec<TableBuilder> {
    let case = &work.case().case;
    let statistics = outcome.statistics;
    let (mut parameters, mut fit) = (TableBuilder::default(), TableBuilder::default());
    let (mut summary, mut correlations) = (TableBuilder::default(), TableBuilder::default());
    for (k, (range, parameter)) in problem.ranges.iter().zip(&statistics.parameters).enumerate() {
        parameters.varied(case);
        parameters.text("parameter", &range.name);
        parameters.number("value", parameter.value);
        parameters.number("standard_error", parameter.standard_error);
        parameters.number("low_95", parameter.low);
        parameters.number("high_95", parameter.high);
        if let Some(profile) = outcome.profiles.get(k) {
            parameters.number("profile_low_95", range.at(profile.low));
            parameters.number("profile_high_95", range.at(profile.high));
        }
        parameters.text("unit", &si_unit(range.dimension));
        parameters.text("status", parameter.estimate.word());
        parameters.end_row();
    }
    let derivatives = problem.derivatives(&outcome.found.x, &problem.all(), DerivativesOf::AllTargets);
    for (number, (target, fitted)) in problem.targets.iter().zip(outcome.fitted).enumerate() {
        let (per_row, names) = (target.quantities().len(), target.quantities());
        let rows = target.measured().values.chunks(per_row).zip(fitted.values.chunks(per_row));
        for (row, (measured, values)) in rows.enumerate() {
            let slopes =
                |part: usize| -> Vec<f64> { derivatives[number].row(row * per_row + part).iter().copied().collect() };
            for shown in shown_values(&**target, measured, values, &slopes) {
                fit.varied(case);
                fit.text("target", &label(problem, number));
                fit.text("quantity", &names[shown.part]);
                fit.number("group", measured[0].group);
                fit.integer("row", measured[0].row as u64);
                fit.text("x_name", target.abscissa());
                fit.number("x", measured[0].x);
                fit.number("measured", shown.measured);
                fit.number("fitted", shown.fitted);
                let half = statistics.band(&shown.slopes);
                fit.number("fitted_low_95", shown.fitted - half);
                fit.number("fitted_high_95", shown.fitted + half);
                if problem.targets.iter().any(|target| target.is_complex()) {
                    fit.number("measured_phase_deg", shown.phases[0]);
                    fit.number("fitted_phase_deg", shown.phases[1]);
                }
                fit.number("normalized_residual", shown.residual);
                fit.text("use", use_of(&**target));
                fit.end_row();
            }
        }
    }
    let mut targets = TableBuilder::default();
    for found in outcome.agreements {
        let target = &problem.targets[found.target];
        targets.varied(case);
        targets.text("target", &label(problem, found.target));
        targets.text("quantity", &found.quantity);
        targets.number("group", found.group);
        targets.text("use", use_of(&**target));
        targets.integer("rows", found.rows as u64);
        targets.number("rms_residual", found.rms_residual);
        targets.number("relative_deviation", found.deviation);
        targets.number("measured_largest", found.measured.value);
        targets.number("fitted_largest", found.fitted.value);
        targets.text("x_name", target.abscissa());
        targets.number("measured_largest_x", found.measured.x);
        targets.number("fitted_largest_x", found.fitted.x);
        targets.end_row();
    }
    summary.varied(case);
    summary.integer("residuals", statistics.count as u64);
    summary.integer("parameters", problem.ranges.len() as u64);
    summary.number("rms_residual", statistics.rms);
    summary.number("autocorrelation", statistics.autocorrelation);
    summary.number("aic", statistics.aic);
    summary.number("aicc", statistics.aicc);
    summary.number("bic", statistics.bic);
    summary.integer("searches", outcome.found.searches as u64);
    summary.integer("agreeing", outcome.found.agreeing as u64);
    summary.integer("evaluations", problem.evaluations());
    summary.end_row();
    for (k, first) in problem.ranges.iter().enumerate() {
        for (l, second) in problem.ranges.iter().enumerate() {
            correlations.varied(case);
            correlations.text("parameter", &first.name);
            correlations.text("with", &second.name);
            correlations.number("correlation", correlation(&statistics.correlations, k, l));
            correlations.end_row();
        }
    }
    let mut rises = TableBuilder::default();
    for (range, profile) in problem.ranges.iter().zip(outcome.profiles) {
        for point in &profile.points {
            rises.varied(case);
            rises.text("parameter", &range.name);
            rises.number("value", range.at(point.x));
            rises.text("unit", &si_unit(range.dimension));
            rises.number("rise", point.rise);
            rises.flag("within_95", Some(point.rise <= statistics.quantile.powi(2)));
            rises.end_row();
        }
    }
    vec![parameters, fit, targets, summary, correlations, rises]
}

/// Returns the number and the data of a target, as the tables name it.
fn label(problem: &FitProblem, target: usize) -> String {
    format!("{} {}", target + 1, problem.targets[target].measured().data)
}

fn use_of(target: &dyn Target) -> &'static str {
    if target.measured().is_predicted { "prediction" } else { "fit" }
}

fn correlation(correlations: &DMatrix<f64>, k: usize, l: usize) -> f64 {
    if k == l { 1.0 } else { correlations[(k, l)] }
}

/// Returns the SI unit of a dimension, in which the table states values.
fn si_unit(dimension: Option<Dimension>) -> String {
    match dimension {
        Some(Dimension::FREQUENCY) => "rad/s".to_owned(),
        Some(Dimension::ANGLE) => "rad".to_owned(),
        Some(Dimension::SWEEP_RATE) => "rad/s^2".to_owned(),
        Some(other) => table_unit(other).map_or_else(String::new, |(_, unit)| unit),
        None => String::new(),
    }
}

/// A number as the table shows it: a complex number as magnitude and phase.
pub(super) struct ShownValue {
    /// Index of the quantity of the target.
    pub part: usize,
    pub measured: f64,
    pub fitted: f64,
    slopes: Vec<f64>,
    /// Measured and fitted phase, degrees.
    phases: [f64; 2],
    pub residual: f64,
}

/// Returns the numbers of a row, with the derivatives that `slopes` gives for each of its parts.
pub(super) fn shown_values(
    target: &dyn Target,
    measured: &[Measured],
    values: &[f64],
    slopes: &dyn Fn(usize) -> Vec<f64>,
) -> Vec<ShownValue> {
    let residual = |part: usize| (values[part] - measured[part].value) / measured[part].deviation;
    if !target.is_complex() {
        let one = |part: usize| ShownValue {
            part,
            measured: measured[part].value,
            fitted: values[part],
            slopes: slopes(part),
            phases: [f64::NAN; 2],
            residual: residual(part),
        };
        return (0..values.len()).map(one).collect();
    }
    let number = |re: f64, im: f64| Complex64::new(re, im);
    let (found, given) = (number(values[0], values[1]), number(measured[0].value, measured[1].value));
    let size = found.norm().max(f64::MIN_POSITIVE);
    let slopes = slopes(0).iter().zip(slopes(1)).map(|(re, im)| (found.re * re + found.im * im) / size).collect();
    vec![ShownValue {
        part: 0,
        measured: given.norm(),
        fitted: found.norm(),
        slopes,
        phases: [given.arg().to_degrees(), found.arg().to_degrees()],
        residual: residual(0).hypot(residual(1)),
    }]
}
