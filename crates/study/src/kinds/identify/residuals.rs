//! Residuals of an identification and their derivatives, for solvers of other programs.

use super::problem::FitProblem;
use super::targets;
use crate::case::study::Study;
use crate::syntax::error::StudyError;
use nalgebra::DMatrix;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The weighted residuals of a study of kind `identify`, over its fitted parameters in SI.
///
/// # Example
/// ```
/// use stickslip_study::{kinds::identify::Residuals, read_file};
/// let folder = tempfile::tempdir().unwrap();
/// let rows = "displacement_m,force_N\n0,0\n1e-3,2.5\n0,0.1\n";
/// std::fs::write(folder.path().join("rig.csv"), rows).unwrap();
/// let text = r#"
/// schema = 1
/// data = [{ name = "rig", file = "rig.csv" }]
/// [parameters]
/// k = "1 N/mm"
/// [[mass]]
/// name = "m"
/// mass = "1 kg"
/// [[joint]]
/// name = "pad"
/// between = ["m", "ground"]
/// law = { kind = "jenkins", stiffness = "k", limit = "10 N" }
/// [study]
/// kind = "identify"
/// fit.k = { from = "0.1 N/mm", to = "10 N/mm" }
/// targets = [{ data = "rig", is = "loop", at = "pad", weight = "0.1 N" }]
/// "#;
/// std::fs::write(folder.path().join("study.toml"), text).unwrap();
/// let study = read_file(&folder.path().join("study.toml"), &[]).unwrap();
/// let residuals = Residuals::new(&study, 0).unwrap();
/// assert_eq!(residuals.names(), ["k"]);
/// // k u = 2 N instead of 2.5 N, and 0 N instead of 0.1 N
/// let found = residuals.values(&[2e3]).unwrap();
/// assert!((found[1] + 5.0).abs() < 1e-12 && (found[2] + 1.0).abs() < 1e-12);
/// // du/dk over the weight
/// assert!((residuals.derivatives(&[2e3]).unwrap()[(1, 0)] - 1e-2).abs() < 1e-9);
/// ```
#[derive(Debug)]
pub struct Residuals {
    problem: FitProblem,
}

impl Residuals {
    /// Collects the targets of a case.
    ///
    /// # Errors
    /// The study is of another kind, or it has no such case.
    pub fn new(study: &Study, case: usize) -> Result<Residuals, StudyError> {
        let refuse = |message: String| study.error_at("study", 0, "kind", message, None);
        if study.kind().name != super::NAME {
            return Err(refuse(format!("residuals need a study of kind `identify`, not `{}`", study.kind().name)));
        }
        let case = study.case(case)?;
        let targets = targets::build(study, &case).map_err(|error| refuse(error.message))?;
        Ok(Residuals { problem: FitProblem::new(study, &case, targets, &Arc::new(AtomicBool::new(false))) })
    }

    /// Returns the names of the fitted parameters.
    pub fn names(&self) -> Vec<String> {
        self.problem.ranges.iter().map(|range| range.name.clone()).collect()
    }

    /// Returns the ends of the range of every parameter, in SI.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        self.problem.ranges.iter().map(|range| [range.from, range.to]).collect()
    }

    /// Returns the values at which the search begins, in SI.
    pub fn start(&self) -> Vec<f64> {
        self.problem.parameters(&self.problem.stated())
    }

    /// Returns the weighted residuals at parameters in SI.
    ///
    /// # Errors
    /// The reason why the model has no residuals there.
    pub fn values(&self, parameters: &[f64]) -> Result<Vec<f64>, String> {
        let found = self.problem.residuals(&self.scaled(parameters)?);
        self.finite(found.iter().all(|value| value.is_finite())).map(|()| found)
    }

    /// Returns their derivatives by the parameters in SI, one column for each.
    ///
    /// # Errors
    /// The reason why the model has no derivatives there.
    pub fn derivatives(&self, parameters: &[f64]) -> Result<DMatrix<f64>, String> {
        let x = self.scaled(parameters)?;
        let mut jacobian = self.problem.jacobian(&x, &self.problem.all());
        for (k, range) in self.problem.ranges.iter().enumerate() {
            jacobian.column_mut(k).scale_mut(1.0 / range.slope(x[k]));
        }
        self.finite(jacobian.iter().all(|value| value.is_finite())).map(|()| jacobian)
    }

    fn finite(&self, is_finite: bool) -> Result<(), String> {
        let reason = || self.problem.failure().unwrap_or_else(|| "the model has no finite residuals".to_owned());
        if is_finite { Ok(()) } else { Err(reason()) }
    }

    /// Returns the parameters on their scales from 0 to 1.
    fn scaled(&self, parameters: &[f64]) -> Result<Vec<f64>, String> {
        let ranges = &self.problem.ranges;
        if parameters.len() != ranges.len() {
            return Err(format!("found {} parameters, expected {}", parameters.len(), ranges.len()));
        }
        let outside = ranges.iter().zip(parameters).find(|(range, x)| !(range.from..=range.to).contains(*x));
        if let Some((range, x)) = outside {
            return Err(format!("`{}` = {x} is outside of its range, {} to {}", range.name, range.from, range.to));
        }
        Ok(ranges.iter().zip(parameters).map(|(range, x)| range.scaled(*x).clamp(0.0, 1.0)).collect())
    }
}
