//! Statistics at the minimum: covariance, intervals, directions that the data do not determine,
//! and structure of the residuals.
//!
//! With the weighted derivatives `J` of the residuals `r` by the scaled parameters, the covariance
//! is `s² (JᵀJ)⁻¹`, `s² = Σ r² / (n - p)`: the weights state relative sizes of the errors, and the
//! residuals their common size. As many residuals as parameters tell no size: then the weights
//! count as absolute standard deviations. Intervals use Student's distribution. They hold for
//! residuals without structure and a model that is nearly linear within them.
//!
//! With a loss `ρ` that limits outliers, the residuals have the slopes `ψ = ρ'(r²) r`, and the
//! covariance is `s² (JᵀJ)⁻¹ / m²`, `s² = Σ ψ² / (n - p)`, with the mean `m` of the
//! derivatives `dψ/dr`. For squares, `ψ = r` and `m = 1`.
//! Sources: G. A. F. Seber, C. J. Wild, Nonlinear Regression (1989), chapters 2 and 5; P. J. Huber,
//! Robust Statistics (1981), section 7.6.

use super::problem::{FitProblem, UsedRows};
use super::search::{Fixed, Found, SearchSettings, minimize};
use crate::syntax::format::plural_suffix;
use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

/// Weight of a residual that is larger than its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Loss {
    Squares,
    SoftL1,
    Huber,
    Cauchy,
}

impl Loss {
    /// Returns `Σ ρ(r²)/2`.
    pub fn sum(self, residuals: &[f64]) -> f64 {
        let one = |r: &f64| {
            let z = r * r;
            0.5 * match self {
                Loss::Squares => z,
                Loss::SoftL1 => 2.0 * ((1.0 + z).sqrt() - 1.0),
                Loss::Huber => {
                    if z <= 1.0 {
                        z
                    } else {
                        2.0 * r.abs() - 1.0
                    }
                }
                Loss::Cauchy => z.ln_1p(),
            }
        };
        residuals.iter().map(one).sum()
    }

    /// Returns `ρ'(r²)`, the weight of a residual in the linearized problem.
    fn weight(self, r: f64) -> f64 {
        let z = r * r;
        match self {
            Loss::Squares => 1.0,
            Loss::SoftL1 => 1.0 / (1.0 + z).sqrt(),
            Loss::Huber => {
                if z <= 1.0 {
                    1.0
                } else {
                    1.0 / r.abs()
                }
            }
            Loss::Cauchy => 1.0 / (1.0 + z),
        }
    }

    /// Returns the derivative of the slope `ρ'(r²) r`.
    fn slope_derivative(self, r: f64) -> f64 {
        let z = r * r;
        match self {
            Loss::Squares => 1.0,
            Loss::SoftL1 => (1.0 + z).powf(-1.5),
            Loss::Huber => f64::from(z <= 1.0),
            Loss::Cauchy => (1.0 - z) / (1.0 + z).powi(2),
        }
    }
}

/// Reliability of a parameter's estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Estimate {
    Determined,
    /// At an end of its range, so that it has no standard error.
    AtBound,
    /// Changes along a direction that the data do not determine.
    NotDetermined,
}

impl Estimate {
    pub fn word(self) -> &'static str {
        match self {
            Estimate::Determined => "determined",
            Estimate::AtBound => "at-bound",
            Estimate::NotDetermined => "not-determined",
        }
    }
}

/// A fitted parameter in SI.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ParameterEstimate {
    pub value: f64,
    pub standard_error: f64,
    /// Ends of the 95 % interval.
    pub low: f64,
    pub high: f64,
    pub estimate: Estimate,
}

/// A direction that the data do not determine.
#[derive(Debug, Clone, PartialEq)]
struct Undetermined {
    /// Change of the scaled parameters, of unit length.
    change: Vec<f64>,
    /// Standard deviation along it, on the scale of the parameters, at most their range.
    deviation: f64,
    /// Indices of the parameters that it makes uncertain.
    parameters: Vec<usize>,
}

/// Statistics of a minimum.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Statistics {
    pub parameters: Vec<ParameterEstimate>,
    pub correlations: DMatrix<f64>,
    /// Covariance of the scaled parameters.
    covariance: DMatrix<f64>,
    /// Quantile of Student's distribution for a 95 % interval.
    pub quantile: f64,
    /// Variance of the normalized residuals; for a loss that limits outliers, that of the slopes
    /// over the curvature.
    pub variance: f64,
    /// Number of residuals.
    pub count: usize,
    /// Root mean square of the residuals, in standard deviations.
    pub rms: f64,
    /// Correlation of residuals in neighbouring rows.
    pub autocorrelation: f64,
    /// Information criteria of Akaike and of Schwarz, for laws that compete over the same data.
    pub aic: f64,
    /// Akaike's criterion corrected for few residuals.
    pub aicc: f64,
    pub bic: f64,
    /// Length of the remaining Gauss-Newton step, in standard errors.
    distance: f64,
    undetermined: Vec<Undetermined>,
    /// Indices of the parameters that the data do not bound on one side, and of those with an
    /// interval by the profile likelihood.
    unbounded: Vec<usize>,
    widened: Vec<usize>,
    searches: usize,
    agreeing: usize,
}

/// A scaled parameter closer than this to an end of its range is at the end.
const AT_BOUND: f64 = 2e-3;
/// A standard error of this fraction of the range makes a direction undetermined.
const UNDETERMINED: f64 = 0.3;
/// Ratio of a parameter's deviation along an undetermined direction to its other standard error,
/// above which the direction makes it uncertain too.
const UNCERTAIN: f64 = 3.0;
/// Changes of a scaled parameter below this are rounding of the derivatives.
const ROUNDING: f64 = 1e-3;
/// Smallest eigenvalue of the correlations of the derivatives that differs from zero. Derivatives
/// have relative errors of about 1e-6.
const SINGULAR: f64 = 1e-10;
/// Rise of the loss at an end of an interval, relative to that of the linear model, below which the
/// end is computed by the profile likelihood.
const FLAT: f64 = 0.5;
/// Fits of the other parameters for such an end: steps of a factor of three, then bisection.
const END_FITS: usize = 10;
/// Remaining step, in standard errors, above which the minimum was not reached.
const LARGEST_STEP: f64 = 0.5;
/// Root mean square of residuals that are rounding, in standard deviations.
const EXACT: f64 = 1e-5;

impl Statistics {
    pub fn new(problem: &FitProblem, found: &Found, loss: Loss) -> Self {
        let (x, p) = (&found.x, found.x.len());
        let residuals = problem.residuals(x);
        let jacobian = problem.jacobian(x, &problem.all());
        let at_bound: Vec<bool> = x.iter().map(|x| *x < AT_BOUND || *x > 1.0 - AT_BOUND).collect();
        let free: Vec<usize> = (0..p).filter(|k| !at_bound[*k]).collect();
        let n = residuals.len();
        let weights: Vec<f64> = residuals.iter().map(|r| loss.weight(*r)).collect();
        let sum: f64 = residuals.iter().zip(&weights).map(|(r, w)| w * r * r).sum();
        let slopes: Vec<f64> = residuals.iter().zip(&weights).map(|(r, w)| w * r).collect();
        let freedom = n.saturating_sub(free.len());
        let curvature = mean_curvature(loss, &residuals, &weights);
        // without a residual to spare, only the stated weights tell the size of the errors
        let squares: f64 = slopes.iter().map(|slope| slope * slope).sum();
        let variance = if freedom > 0 { squares / freedom as f64 / curvature } else { 1.0 };
        let normal = |members: &[usize]| NormalEquations::new(&jacobian, curvature, members);
        let mut covariance: DMatrix<f64> = DMatrix::zeros(p, p);
        let mut squared_step = 0.0;
        let of_free = normal(&free);
        let along = |k: usize| (0..n).map(|i| jacobian[(i, k)] * slopes[i]).sum::<f64>();
        let gradient: Vec<f64> = free.iter().map(|k| along(*k)).collect();
        for Direction { value, change } in of_free.directions().filter(|direction| direction.value > SINGULAR) {
            for (a, k) in free.iter().enumerate() {
                for (b, l) in free.iter().enumerate() {
                    covariance[(*k, *l)] += variance / value * change[a] * change[b];
                }
            }
            squared_step +=
                gradient.iter().zip(&change).map(|(slope, change)| slope * change).sum::<f64>().powi(2) / value;
        }
        let undetermined = undetermined(&normal(&problem.all()), variance);
        let quantile = student_quantile(if freedom > 0 { freedom as f64 } else { f64::INFINITY });
        let in_undetermined = |k: usize| undetermined.iter().any(|direction| direction.parameters.contains(&k));
        let estimate = |k: usize| {
            if at_bound[k] {
                Estimate::AtBound
            } else if in_undetermined(k) {
                Estimate::NotDetermined
            } else {
                Estimate::Determined
            }
        };
        let parameters = problem.ranges.iter().enumerate().map(|(k, range)| {
            let estimate = estimate(k);
            let scaled_error = if estimate == Estimate::Determined { covariance[(k, k)].sqrt() } else { f64::NAN };
            let value = range.at(x[k]);
            let standard_error = scaled_error * range.slope(x[k]);
            let end = |sign: f64| {
                if range.is_log {
                    value * (sign * quantile * standard_error / value).exp()
                } else {
                    value + sign * quantile * standard_error
                }
            };
            ParameterEstimate { value, standard_error, low: end(-1.0), high: end(1.0), estimate }
        });
        let correlations = DMatrix::from_fn(p, p, |k, l| {
            let size = (covariance[(k, k)] * covariance[(l, l)]).sqrt();
            if size > 0.0 { covariance[(k, l)] / size } else { f64::NAN }
        });
        let (count, parameter_count) = (n as f64, free.len() as f64 + 1.0);
        let likelihood = count * (sum / count).ln();
        Statistics {
            parameters: parameters.collect(),
            correlations,
            covariance,
            quantile,
            variance: variance.max(f64::MIN_POSITIVE),
            count: n,
            rms: (residuals.iter().map(|r| r * r).sum::<f64>() / count).sqrt(),
            autocorrelation: autocorrelation(problem, &residuals),
            aic: likelihood + 2.0 * parameter_count,
            aicc: likelihood + 2.0 * parameter_count * count / (count - parameter_count - 1.0).max(1.0),
            bic: likelihood + count.ln() * parameter_count,
            distance: (squared_step / variance / free.len().max(1) as f64).sqrt(),
            undetermined,
            unbounded: Vec::new(),
            widened: Vec::new(),
            searches: found.searches,
            agreeing: found.agreeing,
        }
    }

    /// Checks every interval by the loss itself. If the loss is flat at one end of one interval,
    /// the profile likelihood gives all ends.
    ///
    /// The linear model is wrong where a residual has a kink at the minimum. Example: an Iwan joint
    /// that reaches macro-slip at its largest measured displacement. A smaller slip limit changes
    /// the force there, a larger one with another `beta` changes nothing.
    pub fn check_intervals(&mut self, problem: &FitProblem, settings: &SearchSettings, found: &Found) {
        let has_error = |k: &usize| self.scaled_error(*k).is_finite() && self.scaled_error(*k) > 0.0;
        let checked: Vec<usize> = (0..found.x.len()).filter(has_error).collect();
        let is_flat = |k: &usize| [-1.0, 1.0].iter().any(|sign| self.is_flat(*k, *sign, problem, settings, found));
        if !checked.iter().any(is_flat) {
            return;
        }
        for k in checked {
            let error = self.scaled_error(k);
            let ends = [-1.0, 1.0].map(|sign| self.end(k, sign, problem, settings, found));
            let Some(ends) = ends[0].zip(ends[1]) else {
                self.parameters[k].estimate = Estimate::NotDetermined;
                self.unbounded.push(k);
                continue;
            };
            let range = &problem.ranges[k];
            let parameter = &mut self.parameters[k];
            if ends.0 < found.x[k] - 1.5 * self.quantile * error || ends.1 > found.x[k] + 1.5 * self.quantile * error {
                (parameter.low, parameter.high) = (range.at(ends.0), range.at(ends.1));
                parameter.standard_error = range.slope(found.x[k]) * (ends.1 - ends.0) / (2.0 * self.quantile);
                self.widened.push(k);
            }
        }
        for k in &self.unbounded {
            let parameter = &mut self.parameters[*k];
            (parameter.standard_error, parameter.low, parameter.high) = (f64::NAN, f64::NAN, f64::NAN);
        }
    }

    /// Returns whether the loss at an end of an interval is far below that of the linear model, in
    /// which the other parameters follow.
    fn is_flat(&self, k: usize, sign: f64, problem: &FitProblem, settings: &SearchSettings, found: &Found) -> bool {
        let step = sign * self.quantile / self.scaled_error(k);
        let moved: Vec<f64> = (0..found.x.len()).map(|l| found.x[l] + step * self.covariance[(l, k)]).collect();
        let is_inside = moved.iter().all(|x| (0.0..=1.0).contains(x));
        is_inside && self.rise(settings.loss.sum(&problem.residuals(&moved)), found) < FLAT * self.quantile.powi(2)
    }

    /// Returns the rise of the loss in squared standard errors.
    fn rise(&self, cost: f64, found: &Found) -> f64 {
        2.0 * (cost - found.cost) / self.variance
    }

    /// Returns an end of the interval of a scaled parameter by the profile likelihood, at least
    /// that of the linear model; `None` if the data do not bound the parameter on that side within
    /// [`UNDETERMINED`] of its range.
    fn end(&self, k: usize, sign: f64, problem: &FitProblem, settings: &SearchSettings, found: &Found) -> Option<f64> {
        let step = self.quantile * self.scaled_error(k);
        let (mut inside, mut outside, mut others) = (0.0, None, found.x.clone());
        let mut distance = step;
        for _ in 0..END_FITS {
            let x = (found.x[k] + sign * distance).clamp(0.0, 1.0);
            others[k] = x;
            problem.forget();
            match minimize(problem, settings, others.clone(), Some(Fixed(k)), UsedRows::All) {
                Some((cost, best)) if self.rise(cost, found) < self.quantile.powi(2) => {
                    (inside, others) = (distance, best);
                    if distance > UNDETERMINED || x == 0.0 || x == 1.0 {
                        return None;
                    }
                }
                _ if inside == 0.0 => return Some(found.x[k] + sign * step),
                _ => outside = Some(distance),
            }
            distance = outside.map_or(3.0 * distance, |outside| 0.5 * (inside + outside));
        }
        Some(found.x[k] + sign * outside.unwrap_or(distance))
    }

    /// Returns the standard error of a scaled parameter; NaN if it has none.
    pub fn scaled_error(&self, k: usize) -> f64 {
        match self.parameters[k].estimate {
            Estimate::Determined => self.covariance[(k, k)].sqrt(),
            Estimate::AtBound | Estimate::NotDetermined => f64::NAN,
        }
    }

    /// Returns why the minimum was not reached, if it was not.
    pub fn failure(&self, problem: &FitProblem) -> Option<String> {
        let reached = self.rms <= EXACT || self.distance <= LARGEST_STEP;
        if !reached && self.distance.is_nan() {
            let reason = problem.failure().unwrap_or_else(|| "a derivative is not a number".to_owned());
            return Some(format!("the model has no derivatives where the search ended: {reason}; use narrower ranges"));
        }
        (!reached).then(|| {
            format!(
                "the search did not converge: it ended about {:.1} standard errors from the minimum; use more `starts`, or \
                 narrower ranges, and subtract an offset or a trend of the measured values",
                self.distance
            )
        })
    }

    /// Returns half the width of the 95 % band of a number with these derivatives by the scaled
    /// parameters.
    pub fn band(&self, derivatives: &[f64]) -> f64 {
        let g = DVector::from_column_slice(derivatives);
        self.quantile * (g.transpose() * &self.covariance * &g)[(0, 0)].max(0.0).sqrt()
    }

    /// Returns what a reader must know of the estimates, as sentences.
    pub fn warnings(&self, problem: &FitProblem) -> Vec<String> {
        let mut warnings = Vec::new();
        for (range, parameter) in problem.ranges.iter().zip(&self.parameters) {
            if parameter.estimate == Estimate::AtBound {
                warnings.push(format!(
                    "`{}` ended at an end of its range, so it is not an estimate; the errors of the others hold for this \
                     value. Widen the range, or fix the parameter.",
                    range.name
                ));
            }
        }
        // further combinations tell little more
        let listed = self.undetermined.len().min(3);
        warnings.extend(self.undetermined[..listed].iter().map(|direction| direction.text(problem)));
        if self.undetermined.len() > listed {
            let more = self.undetermined.len() - listed;
            warnings.push(format!(
                "the data do not determine {more} further combination{} of the parameters either.",
                plural_suffix(more)
            ));
        }
        let name = |k: &usize| &problem.ranges[*k].name;
        warnings.extend(self.unbounded.iter().map(|k| {
            format!(
                "the data do not determine `{}`: values far from the estimate, with other values of the other \
                parameters, explain them as well.",
                name(k)
            )
        }));
        warnings.extend(self.widened.iter().map(|k| {
            format!(
                "the sum of squares over `{}` is flat on one side of the estimate; its interval is that of the profile \
                likelihood.",
                name(k)
            )
        }));
        if self.count <= self.parameters.len() {
            warnings.push(format!(
                "{} measured number{} for {} parameter{}: no row is left to test the model, and the standard errors follow \
                 from `weight` alone. Add rows.",
                self.count,
                plural_suffix(self.count),
                self.parameters.len(),
                plural_suffix(self.parameters.len())
            ));
        }
        let significant = 3.0 / (self.count as f64).sqrt();
        if self.autocorrelation > significant && self.rms > EXACT {
            warnings.push(format!(
                "neighbouring residuals are correlated (coefficient {:.2}), so the model leaves out part of the measured behaviour; the \
                 parameters are less certain than their standard errors.",
                self.autocorrelation
            ));
        }
        if self.agreeing == 1 && self.searches > 1 {
            warnings.push(format!(
                "only one of {} searches ended at this minimum; use more `starts`, or narrower ranges.",
                self.searches
            ));
        }
        warnings
    }
}

/// The normal equations over some parameters, with columns of unit length.
struct NormalEquations {
    lengths: Vec<f64>,
    eigen: SymmetricEigen<f64, Dyn>,
}

/// An eigenvector of the normal equations.
struct Direction {
    value: f64,
    /// Change of the scaled parameters along it.
    change: Vec<f64>,
}

impl NormalEquations {
    /// Creates the equations of some parameters. Each residual has the same curvature.
    fn new(jacobian: &DMatrix<f64>, curvature: f64, members: &[usize]) -> Self {
        let column = |k: &usize| jacobian.column(*k) * curvature.sqrt();
        let columns: Vec<DVector<f64>> = members.iter().map(column).collect();
        let lengths: Vec<f64> = columns.iter().map(|column| column.norm()).collect();
        let unit = |a: usize| if lengths[a] > 0.0 { lengths[a] } else { 1.0 };
        let product = |a: usize, b: usize| columns[a].dot(&columns[b]) / (unit(a) * unit(b));
        // nalgebra refuses an empty matrix: all parameters ended at a bound
        let eigen = match members.len() {
            0 => SymmetricEigen { eigenvalues: DVector::zeros(0), eigenvectors: DMatrix::zeros(0, 0) },
            p => SymmetricEigen::new(DMatrix::from_fn(p, p, product)),
        };
        NormalEquations { lengths, eigen }
    }

    fn directions(&self) -> impl Iterator<Item = Direction> + '_ {
        let change = |index: usize, a: usize| {
            let part = self.eigen.eigenvectors[(a, index)];
            if self.lengths[a] > 0.0 { part / self.lengths[a] } else { part }
        };
        self.eigen.eigenvalues.iter().enumerate().map(move |(index, value)| Direction {
            value: *value,
            change: (0..self.lengths.len()).map(|a| change(index, a)).collect(),
        })
    }
}

/// Returns the mean of the second derivative of the loss by a residual.
fn mean_curvature(loss: Loss, residuals: &[f64], weights: &[f64]) -> f64 {
    let mean = |sum: f64| sum / residuals.len().max(1) as f64;
    let curvature = mean(residuals.iter().map(|r| loss.slope_derivative(*r)).sum());
    // If nearly all residuals exceed their standard deviation, positive and negative curvatures of
    // a bounded loss cancel. The mean is then at least this fraction of the mean weight.
    let least = 0.1 * mean(weights.iter().sum());
    curvature.max(least).max(f64::MIN_POSITIVE)
}

/// Returns the directions that the data do not determine. Parameters at an end of their range
/// count: they may move away from it, and take others along.
fn undetermined(normal: &NormalEquations, variance: f64) -> Vec<Undetermined> {
    let p = normal.lengths.len();
    // variances by the directions that the data determine
    let mut own = vec![0.0; p];
    let mut undetermined: Vec<Undetermined> = Vec::new();
    for Direction { value, change } in normal.directions() {
        let size = change.iter().map(|change| change * change).sum::<f64>().sqrt();
        let deviation = if value > SINGULAR { (variance / value).sqrt() * size } else { f64::INFINITY };
        if deviation > UNDETERMINED || value <= SINGULAR && normal.lengths.contains(&0.0) {
            let change = change.iter().map(|change| change / size).collect();
            undetermined.push(Undetermined { change, deviation: deviation.min(1.0), parameters: Vec::new() });
        } else {
            own.iter_mut().zip(&change).for_each(|(own, change)| *own += variance / value * change * change);
        }
    }
    for direction in &mut undetermined {
        let largest = direction.change.iter().fold(0.0f64, |largest, change| largest.max(change.abs()));
        let makes_uncertain = |k: &usize| {
            let change = direction.change[*k].abs();
            change > 0.1 * largest || change * direction.deviation > UNCERTAIN * own[*k].sqrt() + ROUNDING
        };
        direction.parameters = (0..p).filter(makes_uncertain).collect();
    }
    undetermined
}

impl Undetermined {
    /// Describes the direction in words.
    fn text(&self, problem: &FitProblem) -> String {
        let direction = &self.change;
        let name = |k: &usize| format!("`{}`", problem.ranges[*k].name);
        match self.parameters.as_slice() {
            [one] => format!("the data do not determine {}: the residuals do not depend on it.", name(one)),
            several => {
                let names: Vec<String> = several.iter().map(name).collect();
                let all_log = several.iter().all(|k| problem.ranges[*k].is_log);
                // relative changes: a step of a logarithmically scaled parameter is a ratio
                let change = |k: &usize| {
                    let range = &problem.ranges[*k];
                    if all_log { direction[*k] * (range.to / range.from).ln() } else { direction[*k] }
                };
                let unit = if all_log { "%" } else { "% of its range" };
                let largest = several.iter().map(change).fold(0.0, |largest, change| change.abs().max(largest));
                let unity = largest.copysign(change(&several[0]));
                let said = |k: &usize| {
                    let percent = change(k) / unity;
                    let word = if percent > 0.0 { "raised" } else { "lowered" };
                    format!("{} {word} by {:.2} {unit}", name(k), percent.abs())
                };
                // changes that round to zero
                let changes: Vec<String> =
                    several.iter().filter(|k| (change(k) / unity).abs() >= 0.005).map(said).collect();
                format!(
                    "the data do not determine {} separately: {} changes no residual noticeably. Fix one of them, or add data.",
                    names.join(" and "),
                    changes.join(" with ")
                )
            }
        }
    }
}

/// Returns the correlation of residuals in neighbouring rows of the same group.
fn autocorrelation(problem: &FitProblem, residuals: &[f64]) -> f64 {
    let (mut products, mut squares, mut at) = (0.0, 0.0, 0);
    for target in problem.targets.iter().filter(|target| !target.measured().is_predicted) {
        let (measured, per_row) = (&target.measured().values, target.quantities().len());
        for i in 0..measured.len() {
            let here = residuals[at + i];
            squares += here * here;
            if i + per_row < measured.len() && measured[i].group == measured[i + per_row].group {
                products += here * residuals[at + i + per_row];
            }
        }
        at += measured.len();
    }
    if squares > 0.0 { products / squares } else { 0.0 }
}

/// Returns the 97.5 % quantile of Student's distribution with `nu` degrees of freedom.
/// Source: G. W. Hill (1970), Algorithm 396: expansion about the normal quantile, to 1e-3 from five
/// degrees of freedom on; below, the exact values.
fn student_quantile(nu: f64) -> f64 {
    let few = [12.706_204_736, 4.302_652_730, 3.182_446_305, 2.776_445_105];
    if let Some(exact) = few.get(nu as usize - 1) {
        return *exact;
    }
    let z = 1.959_963_984_540_054f64;
    let (z2, z3) = (z * z, z * z * z);
    z + (z3 + z) / (4.0 * nu)
        + (5.0 * z3 * z2 + 16.0 * z3 + 3.0 * z) / (96.0 * nu * nu)
        + (3.0 * z3 * z2 * z2 + 19.0 * z3 * z2 + 17.0 * z3 - 15.0 * z) / (384.0 * nu * nu * nu)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles from tables of Student's distribution.
    #[test]
    fn quantiles_of_students_distribution() {
        for (nu, quantile) in [
            (1.0, 12.7062),
            (2.0, 4.3027),
            (3.0, 3.1824),
            (5.0, 2.5706),
            (10.0, 2.2281),
            (30.0, 2.0423),
            (1e9, 1.95996),
        ] {
            assert!((student_quantile(nu) - quantile).abs() < 5e-3, "{nu} {}", student_quantile(nu));
        }
    }

    #[test]
    fn weights_are_derivatives_of_the_losses() {
        for loss in [Loss::Squares, Loss::SoftL1, Loss::Huber, Loss::Cauchy] {
            for r in [0.3, 0.9, 2.0, 7.0] {
                let h = 1e-5;
                let slope = (loss.sum(&[r + h]) - loss.sum(&[r - h])) / (2.0 * h);
                assert!((slope - loss.weight(r) * r).abs() < 1e-8, "{loss:?} {r}");
                let slope = |r: f64| loss.weight(r) * r;
                let derivative = (slope(r + h) - slope(r - h)) / (2.0 * h);
                assert!((derivative - loss.slope_derivative(r)).abs() < 1e-8, "{loss:?} {r}");
            }
        }
    }
}
