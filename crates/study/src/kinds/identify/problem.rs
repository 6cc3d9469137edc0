//! The least-squares problem: weighted residuals over scaled parameters, and their derivatives.
//!
//! A scaled parameter runs from 0 to 1 over its range, by differences or by ratios. Derivatives
//! are differences of second order with a fraction [`FitProblem::DIFFERENCE`] of the range, central
//! inside and one-sided at its ends; all orbits begin from the orbit at the parameters.

use super::targets::{Fitted, RowStates, Target};
use crate::case::study::{Case, Study};
use crate::case::values::FitRange;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// The targets whose derivatives are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DerivativesOf {
    FittedTargets,
    AllTargets,
}

/// The rows that a minimization uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum UsedRows {
    All,
    /// The beginning of every motion over time: this number of times its first two cycles.
    Beginnings(usize),
}

/// The residuals of a case.
#[derive(Debug)]
pub(super) struct FitProblem {
    study: Study,
    case: Case,
    pub targets: Vec<Box<dyn Target>>,
    pub ranges: Vec<FitRange>,
    stop: Arc<AtomicBool>,
    evaluations: AtomicU64,
    /// The last reason why the model had no residuals.
    failure: Mutex<Option<String>>,
    /// Warm starts of every target, from the last successful evaluation of the search.
    states: Mutex<Vec<RowStates>>,
}

impl FitProblem {
    /// Fraction of a range by which derivatives change a parameter. The error of a central
    /// difference is of the order of its square, 1e-8; orbits and motions in time, whose steps are
    /// adapted, differ by up to 1e-9 in addition.
    pub const DIFFERENCE: f64 = 1e-4;

    /// The residuals of a case; `stop` ends all computations.
    pub fn new(study: &Study, case: &Case, targets: Vec<Box<dyn Target>>, stop: &Arc<AtomicBool>) -> Self {
        let states = vec![RowStates::new(); targets.len()];
        FitProblem {
            study: study.clone(),
            case: case.clone(),
            targets,
            ranges: case.values.fit("fit").unwrap_or_default().to_vec(),
            stop: stop.clone(),
            evaluations: AtomicU64::new(0),
            failure: Mutex::new(None),
            states: Mutex::new(states),
        }
    }

    /// Returns the number of computed models.
    pub fn evaluations(&self) -> u64 {
        self.evaluations.load(Ordering::Relaxed)
    }

    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Returns the last reason why the model had no residuals.
    pub fn failure(&self) -> Option<String> {
        self.failure.lock().ok().and_then(|failure| failure.clone())
    }

    /// Returns the indices of all parameters.
    pub fn all(&self) -> Vec<usize> {
        (0..self.ranges.len()).collect()
    }

    /// Returns the parameters in SI.
    pub fn parameters(&self, x: &[f64]) -> Vec<f64> {
        self.ranges.iter().zip(x).map(|(range, x)| range.at(*x)).collect()
    }

    /// Returns the stated values of the parameters on the scale from 0 to 1, within it.
    pub fn stated(&self) -> Vec<f64> {
        let stated = |range: &FitRange| {
            let si = self.case.parameters.get(&range.name).map_or(range.from, |(si, _)| *si);
            range.scaled(si).clamp(0.01, 0.99)
        };
        self.ranges.iter().map(stated).collect()
    }

    /// Computes the model in place of all measured numbers, target by target.
    ///
    /// # Errors
    /// The reason why the model has no such numbers.
    pub fn fitted(&self, x: &[f64]) -> Result<Vec<Fitted>, String> {
        let states = self.states.lock().map_err(|_| "another computation failed".to_owned())?.clone();
        let found = self.fitted_from(x, &states, &|_| true)?;
        if let Ok(mut states) = self.states.lock() {
            *states = found.iter().map(|fitted| fitted.states.clone()).collect();
        }
        Ok(found)
    }

    /// Computes the targets that `of` selects from given warm starts; the others are empty.
    fn fitted_from(
        &self,
        x: &[f64],
        states: &[RowStates],
        of: &dyn Fn(&dyn Target) -> bool,
    ) -> Result<Vec<Fitted>, String> {
        if self.is_stopped() {
            return Err("the run was stopped".to_owned());
        }
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        let values = self.parameters(x);
        let named: Vec<(&str, f64)> = self.ranges.iter().map(|range| range.name.as_str()).zip(values).collect();
        let computed = self.study.case_with_parameters(self.case.index, &named).map_err(|error| error.to_string());
        let computed = computed.and_then(|case| {
            let one = |(target, states): (&dyn Target, &RowStates)| {
                if of(target) { target.fitted(&case, states) } else { Ok(Fitted::default()) }
            };
            self.targets.iter().map(|target| &**target).zip(states).map(one).collect::<Result<Vec<_>, String>>()
        });
        if let (Err(reason), Ok(mut failure)) = (&computed, self.failure.lock()) {
            *failure = Some(reason.clone());
        }
        computed
    }

    /// Returns the residuals `(fitted - measured)/deviation` of the fitted targets.
    pub fn residuals_of(&self, fitted: &[Fitted]) -> Vec<f64> {
        let fitted = self.targets.iter().zip(fitted).filter(|(target, _)| !target.measured().is_predicted);
        fitted
            .flat_map(|(target, fitted)| {
                target
                    .measured()
                    .values
                    .iter()
                    .zip(&fitted.values)
                    .map(|(measured, value)| (value - measured.value) / measured.deviation)
            })
            .collect()
    }

    /// Returns a sentence for each quantity whose measured values differ from the computed ones by
    /// orders of magnitude, as they do in another unit, or have the opposite sign.
    ///
    /// Motions over time are compared at their beginning, before a wrong frequency matters.
    pub fn scale_differences(&self, fitted: &[Fitted]) -> Vec<String> {
        let mut sentences = Vec::new();
        for (target, fitted) in self.targets.iter().zip(fitted).filter(|(target, _)| !target.measured().is_predicted) {
            let names = target.quantities();
            let rows = beginning(&**target);
            for (k, name) in names.iter().enumerate() {
                let measured = target.measured().values.iter().map(|measured| measured.value).skip(k);
                let measured = measured.step_by(names.len()).take(rows);
                let computed = fitted.values.iter().copied().skip(k).step_by(names.len()).take(rows);
                let product: f64 = measured.clone().zip(computed.clone()).map(|(a, b)| a * b).sum();
                let (measured, computed) = (sum_of_squares(measured), sum_of_squares(computed));
                let values = format!("the measured values of `{name}` in `{}`", target.measured().data);
                // Correlation of -0.5: noise and a poor model hardly reach it.
                if product < -0.5 * (measured * computed).sqrt() {
                    let advice = match target.first_cycles() {
                        Some(_) => "reverse the sign of their column or of `start`, or state their `quantity`",
                        None => "reverse the sign of their column",
                    };
                    sentences.push(format!("{values} have the opposite sign of the computed ones: {advice}."));
                }
                let ratio = (measured / computed).sqrt();
                // Ratio that a poor model hardly reaches, and that most pairs of units exceed.
                if ratio.is_finite() && ratio > 0.0 && !(0.01..=100.0).contains(&ratio) {
                    let advice = match target.first_cycles() {
                        Some(_) => {
                            "check the units of their columns, their `quantity`, and that the first row is the initial \
                             state"
                        }
                        None => "check the units of their columns",
                    };
                    sentences.push(format!("{values} are about {ratio:.0e} times the computed ones: {advice}."));
                }
            }
        }
        sentences
    }

    /// Returns the parts of the data that successive minimizations use, from the first cycles of
    /// the motions over time to all rows. Without such motions, all rows are used at once.
    pub fn stages(&self) -> Vec<UsedRows> {
        let fitted = self.targets.iter().filter(|target| !target.measured().is_predicted);
        let ratio = |target: &dyn Target| Some(target.measured().values.len() / target.first_cycles()?.max(1));
        let longest = fitted.filter_map(|target| ratio(&**target)).max().unwrap_or(1);
        // Three times the cycles: the frequency of the last minimum is accurate enough not to lose
        // a cycle, and a record of a hundred cycles takes five minimizations.
        let beginnings =
            std::iter::successors(Some(1), |cycles| Some(3 * cycles)).take_while(|cycles| *cycles < longest);
        beginnings.map(UsedRows::Beginnings).chain([UsedRows::All]).collect()
    }

    /// Tells for every residual whether it is used.
    pub fn is_used(&self, rows: UsedRows) -> Vec<bool> {
        let of = |target: &dyn Target| {
            let count = target.measured().values.len();
            let used = match (rows, target.first_cycles()) {
                // enough rows to determine the parameters
                (UsedRows::Beginnings(cycles), Some(first)) => (cycles * first).max(4 * self.ranges.len()),
                _ => count,
            };
            (0..count).map(move |row| row < used)
        };
        self.targets.iter().filter(|target| !target.measured().is_predicted).flat_map(|target| of(&**target)).collect()
    }

    /// Returns the number of residuals.
    pub fn count(&self) -> usize {
        self.targets
            .iter()
            .filter(|target| !target.measured().is_predicted)
            .map(|target| target.measured().values.len())
            .sum()
    }

    /// Returns the residuals; NaN if the model has none.
    pub fn residuals(&self, x: &[f64]) -> Vec<f64> {
        let fit = |target: &dyn Target| !target.measured().is_predicted;
        let states = self.states.lock().map(|states| states.clone()).unwrap_or_default();
        match self.fitted_from(x, &states, &fit) {
            Ok(found) => {
                let residuals = self.residuals_of(&found);
                if let Ok(mut states) = self.states.lock() {
                    *states = found.into_iter().map(|fitted| fitted.states).collect();
                }
                residuals
            }
            Err(_) => vec![f64::NAN; self.count()],
        }
    }

    /// Forgets the warm starts, for a search from elsewhere.
    pub fn forget(&self) {
        if let Ok(mut states) = self.states.lock() {
            states.iter_mut().for_each(Vec::clear);
        }
    }

    /// Returns the derivatives of all numbers of all targets by the scaled parameters, one column
    /// each; of predicted targets only for [`DerivativesOf::AllTargets`]. NaN where the model has
    /// none.
    pub fn derivatives(&self, x: &[f64], columns: &[usize], which: DerivativesOf) -> Vec<DMatrix<f64>> {
        let used = |target: &dyn Target| which == DerivativesOf::AllTargets || !target.measured().is_predicted;
        let before = self.states.lock().map(|states| states.clone()).unwrap_or_default();
        let (states, here) = match self.fitted_from(x, &before, &used) {
            Ok(found) => found.into_iter().map(|fitted| (fitted.states, fitted.values)).unzip(),
            Err(_) => (before, Vec::new()),
        };
        let none = || self.targets.iter().map(|target| vec![f64::NAN; target.measured().values.len()]).collect();
        let column = |k: usize| -> Vec<Vec<f64>> {
            let at = |steps: f64| {
                let mut x = x.to_vec();
                x[k] += steps * Self::DIFFERENCE;
                self.fitted_from(&x, &states, &used).ok()
            };
            // at an end of the range, the two other points lie on the same side
            let side = f64::from(i8::from(x[k] < Self::DIFFERENCE) - i8::from(x[k] > 1.0 - Self::DIFFERENCE));
            let (Some(one), Some(other)) =
                (at(if side == 0.0 { -1.0 } else { side }), at(if side == 0.0 { 1.0 } else { 2.0 * side }))
            else {
                return none();
            };
            if side != 0.0 && here.is_empty() {
                return none();
            }
            let slope = |target: usize| {
                let pairs = one[target].values.iter().zip(&other[target].values).enumerate();
                let rise = |(row, (one, other)): (usize, (&f64, &f64))| {
                    if side == 0.0 { other - one } else { side * (4.0 * one - other - 3.0 * here[target][row]) }
                };
                pairs.map(|pair| rise(pair) / (2.0 * Self::DIFFERENCE)).collect()
            };
            (0..one.len()).map(slope).collect()
        };
        let columns: Vec<Vec<Vec<f64>>> = columns.par_iter().map(|k| column(*k)).collect();
        (0..self.targets.len())
            .map(|target| {
                let rows = columns.first().map_or(0, |column| column[target].len());
                DMatrix::from_fn(rows, columns.len(), |row, k| columns[k][target][row])
            })
            .collect()
    }

    /// Returns the derivatives of the residuals by the scaled parameters with these indices.
    pub fn jacobian(&self, x: &[f64], columns: &[usize]) -> DMatrix<f64> {
        self.jacobian_of(columns.len(), &self.derivatives(x, columns, DerivativesOf::FittedTargets))
    }

    /// Returns the derivatives of the residuals from those of the numbers.
    fn jacobian_of(&self, columns: usize, derivatives: &[DMatrix<f64>]) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(self.count(), columns);
        let mut at = 0;
        for (target, derivatives) in
            self.targets.iter().zip(derivatives).filter(|(target, _)| !target.measured().is_predicted)
        {
            for (row, measured) in target.measured().values.iter().enumerate() {
                for k in 0..columns {
                    jacobian[(at, k)] = derivatives[(row, k)] / measured.deviation;
                }
                at += 1;
            }
        }
        jacobian
    }
}

impl FitRange {
    /// Returns the value at a scaled parameter.
    pub(super) fn at(&self, x: f64) -> f64 {
        if self.is_log { self.from * (self.to / self.from).powf(x) } else { self.from + (self.to - self.from) * x }
    }

    /// Returns the scaled parameter of a value.
    pub(super) fn scaled(&self, si: f64) -> f64 {
        if self.is_log {
            (si / self.from).ln() / (self.to / self.from).ln()
        } else {
            (si - self.from) / (self.to - self.from)
        }
    }

    /// Returns the derivative of the value by the scaled parameter.
    pub(super) fn slope(&self, x: f64) -> f64 {
        if self.is_log { self.at(x) * (self.to / self.from).ln() } else { self.to - self.from }
    }
}

/// Returns the number of rows before which a motion over time has hardly changed: the first row if
/// it is not much smaller than the others, otherwise a quarter of a cycle. All rows of other
/// targets.
fn beginning(target: &dyn Target) -> usize {
    let Some(two_cycles) = target.first_cycles() else { return usize::MAX };
    let largest = target.measured().values.iter().fold(0.0f64, |largest, row| largest.max(row.value.abs()));
    let first = target.measured().values[0].value.abs();
    if first > 0.25 * largest { 1 } else { (two_cycles / 8).max(1) }
}

fn sum_of_squares(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|value| value * value).sum()
}
