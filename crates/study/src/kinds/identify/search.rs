//! The minimization: starts from the stated values and from a Sobol sequence, and the trust
//! region reflective method from the best of them. Motions over time are fitted to their first
//! cycles, then to three times as many, and so on.
//!
//! Source: M. A. Branch, T. F. Coleman, Y. Li (1999), by the crate `basin`.

use super::problem::{FitProblem, UsedRows};
use super::statistics::Loss;
use crate::case::sample::Design;
use crate::case::values::Values;
use basin::{
    BoxBounds, CauchyLoss, ConstraintDescription, ConstraintSet, Constraints, CostFunction, DenseMatrix, Executor,
    HuberLoss, IncumbentState, Jacobian, LossFunction, Residual, RobustLeastSquares, SoftL1Loss, SquaredLoss,
    TrustRegionReflective,
};
use std::convert::Infallible;

/// Settings of the search.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SearchSettings {
    /// Starts in addition to the stated values. Default 64, a few per cent of the evaluations of a
    /// fit: of 200 ring-downs of 240 rows, it leads to 196 right minima, and 16 to 183.
    pub starts: usize,
    /// Starts that are followed to a minimum, in addition to the stated values. Default 4: of 64
    /// starts of a loop with three parameters over four decades, 47 lead to the right minimum.
    pub followed: usize,
    /// Largest number of steps of one minimization. Default 100.
    pub steps: u64,
    /// Relative decrease of the sum of squares below which a minimization ends. Default 1e-10.
    pub tolerance: f64,
    /// Weight of large residuals.
    pub loss: Loss,
}

impl SearchSettings {
    pub fn of(values: &Values) -> Self {
        let loss = values.text("loss").and_then(|name| LOSSES.iter().find(|row| row.0 == name));
        SearchSettings {
            starts: values.count("starts").unwrap_or(64) as usize,
            followed: 4,
            steps: 100,
            tolerance: 1e-10,
            loss: loss.map_or(Loss::Squares, |row| row.2),
        }
    }
}

const LOSSES: [(&str, &str, Loss); 4] = [
    ("squares", "sum of squares", Loss::Squares),
    ("soft-l1", "grows linearly beyond one standard deviation, smooth", Loss::SoftL1),
    ("huber", "squares up to one standard deviation, linear beyond", Loss::Huber),
    ("cauchy", "grows logarithmically; outliers hardly count", Loss::Cauchy),
];

/// The values of the key `loss`.
pub(super) fn losses() -> Vec<(&'static str, &'static str)> {
    LOSSES.iter().map(|(name, summary, _)| (*name, *summary)).collect()
}

/// The best minimum.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    /// Scaled parameters.
    pub x: Vec<f64>,
    /// Loss at the minimum.
    pub cost: f64,
    /// Minimizations, and those that ended at this minimum.
    pub searches: usize,
    pub agreeing: usize,
}

/// Loss difference below which two minima are the same, relative.
const SAME_COST: f64 = 1e-4;

/// Finds the minimum with the smallest loss.
///
/// # Errors
/// The model has no residuals at any start, or no minimization converged.
pub(super) fn search(problem: &FitProblem, settings: &SearchSettings) -> Result<Found, String> {
    let stated = problem.stated();
    let stages = problem.stages();
    let is_used = problem.is_used(stages[0]);
    let dimensions = stated.len();
    let sobol = |index: usize| -> Vec<f64> {
        (0..dimensions).map(|k| Design::Sobol.coordinate(1, index, settings.starts, k)).collect()
    };
    let mut starts: Vec<(f64, Vec<f64>)> = Vec::new();
    for x in (0..settings.starts).map(sobol) {
        problem.forget();
        let mut residuals = problem.residuals(&x);
        set_unused_to_zero(&mut residuals, &is_used);
        let cost = settings.loss.sum(&residuals);
        if cost.is_finite() {
            starts.push((cost, x));
        }
        if problem.is_stopped() {
            return Err("the run was stopped".to_owned());
        }
    }
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let chosen = std::iter::once(stated).chain(starts.into_iter().take(settings.followed).map(|(_, x)| x));
    let mut minima: Vec<(f64, Vec<f64>)> = Vec::new();
    let mut searches = 0;
    for start in chosen {
        problem.forget();
        if !settings.loss.sum(&problem.residuals(&start)).is_finite() {
            continue;
        }
        searches += 1;
        let minimum = stages.iter().try_fold((0.0, start), |(_, x), rows| minimize(problem, settings, x, None, *rows));
        minima.extend(minimum);
        if problem.is_stopped() {
            return Err("the run was stopped".to_owned());
        }
    }
    let Some(best) = minima.iter().min_by(|a, b| a.0.total_cmp(&b.0)).cloned() else {
        let reason = problem.failure().unwrap_or_else(|| "no minimization converged".to_owned());
        return Err(format!(
            "the search for the parameters failed: {reason}; check units and ranges, or increase `starts`"
        ));
    };
    let agreeing = minima.iter().filter(|(cost, _)| cost - best.0 <= SAME_COST * best.0 + 1e-12).count();
    Ok(Found { x: best.1, cost: best.0, searches, agreeing })
}

/// The parameter that a minimization does not change, by its index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Fixed(pub usize);

/// Minimizes from one start. Returns loss and scaled parameters.
pub(super) fn minimize(
    problem: &FitProblem,
    settings: &SearchSettings,
    start: Vec<f64>,
    fixed: Option<Fixed>,
    rows: UsedRows,
) -> Option<(f64, Vec<f64>)> {
    fn run<L: LossFunction<f64>>(
        loss: L,
        problem: &FitProblem,
        settings: &SearchSettings,
        start: Vec<f64>,
        fixed: Option<Fixed>,
        rows: UsedRows,
    ) -> Option<Vec<f64>> {
        let free: Vec<usize> = (0..start.len()).filter(|k| fixed != Some(Fixed(*k))).collect();
        let bounded = Bounded {
            problem,
            lower: vec![0.0; free.len()],
            upper: vec![1.0; free.len()],
            all: start.clone(),
            free,
            is_used: problem.is_used(rows),
        };
        if bounded.free.is_empty() {
            return Some(start);
        }
        let start: Vec<f64> = bounded.free.iter().map(|k| start[*k]).collect();
        let (all, free) = (bounded.all.clone(), bounded.free.clone());
        let solver = TrustRegionReflective::new().with_relative_cost_change_tolerance(settings.tolerance);
        let executor = Executor::from_start(RobustLeastSquares::new(bounded, loss), solver, start);
        let result = executor.max_iter(settings.steps).run().ok()?;
        // there is no best point if the run was stopped before the first one
        Some(with_free(&all, &free, result.state.incumbent_record()?.param))
    }
    let x = match settings.loss {
        Loss::Squares => run(SquaredLoss, problem, settings, start, fixed, rows),
        Loss::SoftL1 => run(SoftL1Loss, problem, settings, start, fixed, rows),
        Loss::Huber => run(HuberLoss, problem, settings, start, fixed, rows),
        Loss::Cauchy => run(CauchyLoss, problem, settings, start, fixed, rows),
    }?;
    let cost = settings.loss.sum(&problem.residuals(&x));
    cost.is_finite().then_some((cost, x))
}

/// The problem in the form of the solver.
struct Bounded<'p> {
    problem: &'p FitProblem,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// All parameters; those that are not free keep these values.
    all: Vec<f64>,
    /// Indices of the free parameters.
    free: Vec<usize>,
    /// For every residual.
    is_used: Vec<bool>,
}

fn set_unused_to_zero(residuals: &mut [f64], is_used: &[bool]) {
    residuals.iter_mut().zip(is_used).filter(|(_, is_used)| !**is_used).for_each(|(residual, _)| *residual = 0.0);
}

/// Returns all parameters with other values of the free ones.
fn with_free(all: &[f64], free: &[usize], x: &[f64]) -> Vec<f64> {
    let mut all = all.to_vec();
    free.iter().zip(x).for_each(|(k, x)| all[*k] = *x);
    all
}

impl Bounded<'_> {
    fn all(&self, x: &[f64]) -> Vec<f64> {
        with_free(&self.all, &self.free, x)
    }

    fn residuals(&self, x: &[f64]) -> Vec<f64> {
        let mut residuals = self.problem.residuals(&self.all(x));
        set_unused_to_zero(&mut residuals, &self.is_used);
        residuals
    }
}

impl Constraints for Bounded<'_> {
    type Set = ConstraintSet<BoxBounds<Vec<f64>>>;
    fn constraints(&self) -> <Self::Set as ConstraintDescription>::Borrowed<'_> {
        ConstraintSet::new().with_bounds(BoxBounds::new(Some(&self.lower), Some(&self.upper)))
    }
}

impl CostFunction for Bounded<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Infallible;
    fn cost(&self, x: &Vec<f64>) -> Result<f64, Infallible> {
        Ok(Loss::Squares.sum(&self.residuals(x)))
    }
}

impl Residual for Bounded<'_> {
    type Param = Vec<f64>;
    type Output = Vec<f64>;
    type Error = Infallible;
    fn residual(&self, x: &Vec<f64>) -> Result<Vec<f64>, Infallible> {
        Ok(self.residuals(x))
    }
}

impl Jacobian for Bounded<'_> {
    type Jacobian = DenseMatrix;
    fn jacobian(&self, x: &Vec<f64>) -> Result<DenseMatrix, Infallible> {
        let mut jacobian = self.problem.jacobian(&self.all(x), &self.free);
        (0..jacobian.nrows()).filter(|row| !self.is_used[*row]).for_each(|row| jacobian.row_mut(row).fill(0.0));
        let rows: Vec<f64> = jacobian.row_iter().flat_map(|row| row.iter().copied().collect::<Vec<_>>()).collect();
        Ok(DenseMatrix::from_row_slice(jacobian.nrows(), jacobian.ncols(), &rows))
    }
}
