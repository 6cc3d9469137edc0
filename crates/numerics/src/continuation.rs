//! Continuation of the solutions of `F(x, p) = 0` along the parameter p by arc length:
//! predictor, corrector, step size control.
//!
//! Source: Keller (1977); Allgower and Georg, "Introduction to Numerical Continuation Methods"
//! (2003), Ch. 6.

use crate::dense;
use crate::newton::{DampedNewton, NewtonEnd, NewtonEquations};

/// Equations with a parameter.
///
/// The unknowns and the range of the parameter should be of the order of one,
/// because the arc length adds them.
pub trait ParametricEquations {
    /// Returns the number of unknowns.
    fn size(&self) -> usize;
    /// Evaluates `F` and its derivatives with respect to x (row-major, size²)
    /// and to p. Returns false if this fails.
    fn evaluate(&mut self, x: &[f64], p: f64, f: &mut [f64], by_x: &mut [f64], by_p: &mut [f64]) -> bool;
    /// Returns the norm of F at which a point counts as solved.
    fn tolerance(&self) -> f64;
    /// Finds a solution at p by other means than the corrector, from the last point in `x`.
    ///
    /// It is called if short steps fail, at kinks that the corrector cannot
    /// pass. Returns false if it finds no solution.
    fn jump_kink(&mut self, _x: &mut [f64], _p: f64) -> bool {
        false
    }
}

/// Range, direction and step sizes of a continuation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContinuationSettings {
    /// Least and largest value of the parameter.
    pub range: (f64, f64),
    /// +1 to start with a rising parameter, -1 with a falling one.
    pub direction: f64,
    /// Unit of the parameter in the arc length.
    pub unit: f64,
    /// Largest step size, as arc length. It grows with the norm of the unknowns above one.
    pub largest_step: f64,
    /// Smallest step size, as arc length.
    pub smallest_step: f64,
    /// Maximum number of points.
    pub points: usize,
}

impl ContinuationSettings {
    /// Returns the steps from one value to another, with a step of at most
    /// `step` along the parameter.
    pub fn between(from: f64, to: f64, step: f64) -> Self {
        ContinuationSettings {
            range: (from.min(to), from.max(to)),
            direction: if to < from { -1.0 } else { 1.0 },
            unit: (to - from).abs(),
            largest_step: step / (to - from).abs(),
            smallest_step: 1e-9,
            points: 100_000,
        }
    }
}

/// The reason why a branch ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BranchEnd {
    /// The parameter has reached the border of its range: the last point is on it.
    Border,
    /// The maximum number of points is reached.
    Points,
    /// The corrector failed at the smallest step size.
    Stalled {
        /// Parameter at the last point.
        parameter: f64,
    },
    /// The visitor ended the continuation.
    Stopped,
}

/// Follows the branch from `(x, p)`, which solves the equations.
///
/// `visit` receives every point and returns true to continue.
///
/// # Example
/// A circle, past its turning points:
/// ```
/// use stickslip_numerics::continuation::{
///     BranchEnd, ContinuationSettings, ParametricEquations, trace,
/// };
/// struct Circle;
/// impl ParametricEquations for Circle {
///     fn size(&self) -> usize {
///         1
///     }
///     fn evaluate(
///         &mut self,
///         x: &[f64],
///         p: f64,
///         f: &mut [f64],
///         by_x: &mut [f64],
///         by_p: &mut [f64],
///     ) -> bool {
///         (f[0], by_x[0], by_p[0]) = (x[0] * x[0] + p * p - 1.0, 2.0 * x[0], 2.0 * p);
///         true
///     }
///     fn tolerance(&self) -> f64 {
///         1e-12
///     }
/// }
/// let steps = ContinuationSettings {
///     unit: 1.0,
///     points: 200,
///     ..ContinuationSettings::between(-2.0, 2.0, 0.1)
/// };
/// let mut lowest = 1.0f64;
/// let end = trace(&mut Circle, &[1.0], 0.0, steps, &mut |_, x, _| {
///     lowest = lowest.min(x[0]);
///     true
/// });
/// assert_eq!(end, BranchEnd::Points);
/// assert!(lowest < -0.99);
/// ```
pub fn trace<E: ParametricEquations>(
    equations: &mut E,
    x: &[f64],
    p: f64,
    steps: ContinuationSettings,
    visit: &mut dyn FnMut(&mut E, &[f64], f64) -> bool,
) -> BranchEnd {
    // A step below the largest step size divided by this number calls
    // `ParametricEquations::jump_kink`.
    let jump_divisor = 32.0;
    let n = equations.size();
    let mut corrector = Corrector::new(n);
    let (mut x, mut p) = (x.to_vec(), p);
    let mut tangent = vec![0.0; n + 1];
    tangent[n] = steps.direction;
    let mut step_size = 0.25 * steps.largest_step;
    if !visit(equations, &x, p) {
        return BranchEnd::Stopped;
    }
    let mut tangent_outdated = true;
    let mut direction = steps.direction;
    for _ in 1..steps.points {
        // The largest step size grows with the norm of x, so a branch to infinity takes few steps.
        let longest = steps.largest_step * x.iter().map(|x| x * x).sum::<f64>().sqrt().max(1.0);
        step_size = step_size.min(longest);
        if tangent_outdated {
            corrector.tangent(equations, &x, p, steps.unit, &mut tangent);
            tangent_outdated = false;
        }
        let (low, high) = steps.range;
        let mut next: Vec<f64> = x.iter().zip(&tangent).map(|(x, t)| x + step_size * t).collect();
        let mut q = p + step_size * tangent[n] * steps.unit;
        // A step that leaves the range ends on the border, with the parameter fixed.
        let border = if q > high {
            Some(high)
        } else if q < low {
            Some(low)
        } else {
            None
        };
        let solved = match border {
            Some(value) => {
                let share = if q == p { 0.0 } else { (value - p) / (q - p) };
                next = x.iter().zip(&tangent).map(|(x, t)| x + share * step_size * t).collect();
                q = value;
                corrector.correct(equations, &mut next, &mut q, steps.unit, None)
            }
            None => {
                let predicted = (next.clone(), q);
                corrector.correct(equations, &mut next, &mut q, steps.unit, Some((&tangent, &predicted)))
            }
        };
        let inside = q >= low && q <= high;
        // A corrector that moves too far has converged to another branch.
        let moved: f64 = next.iter().zip(&x).map(|(a, b)| (a - b) * (a - b)).sum::<f64>()
            + ((q - p) / steps.unit) * ((q - p) / steps.unit);
        let close_to_last_point = moved.sqrt() <= 2.0 * step_size + 1e-12;
        let accepted = match solved {
            Some(iterations) if inside && close_to_last_point => Some(iterations),
            _ => None,
        };
        let Some(iterations) = accepted else {
            step_size *= 0.5;
            if step_size < longest / jump_divisor {
                // Let the equations jump over the kink, by a fraction of the largest step size.
                let q = (p + (4.0 / jump_divisor) * steps.largest_step * steps.unit * direction).clamp(low, high);
                next.copy_from_slice(&x);
                if q != p && equations.jump_kink(&mut next, q) {
                    let border = q == low || q == high;
                    (x, p, tangent_outdated, step_size) = (next, q, true, 0.25 * steps.largest_step);
                    tangent.fill(0.0);
                    tangent[n] = direction;
                    if !visit(equations, &x, p) {
                        return BranchEnd::Stopped;
                    }
                    if border {
                        return BranchEnd::Border;
                    }
                    continue;
                }
            }
            if step_size < steps.smallest_step {
                return BranchEnd::Stalled { parameter: p };
            }
            continue;
        };
        direction = if q < p { -1.0 } else { 1.0 };
        (x, p, tangent_outdated) = (next, q, true);
        if !visit(equations, &x, p) {
            return BranchEnd::Stopped;
        }
        if border.is_some() {
            return BranchEnd::Border;
        }
        // A step with at most this number of corrector iterations makes the next step longer.
        if iterations <= 10 {
            step_size *= 1.5;
        }
    }
    BranchEnd::Points
}

/// A predicted point: unknowns and parameter.
type Predicted = (Vec<f64>, f64);

struct Corrector {
    n: usize,
    f: Vec<f64>,
    by_x: Vec<f64>,
    by_p: Vec<f64>,
    bordered: Vec<f64>,
    right: Vec<f64>,
}

impl Corrector {
    fn new(n: usize) -> Self {
        Corrector {
            n,
            f: vec![0.0; n],
            by_x: vec![0.0; n * n],
            by_p: vec![0.0; n],
            bordered: vec![0.0; (n + 1) * (n + 1)],
            right: vec![0.0; n + 1],
        }
    }

    /// Fills the Jacobian bordered by `row`, with the parameter in units of the arc length.
    fn border(&mut self, unit: f64, row: &[f64]) {
        let n = self.n;
        for i in 0..n {
            self.bordered[i * (n + 1)..i * (n + 1) + n].copy_from_slice(&self.by_x[i * n..(i + 1) * n]);
            self.bordered[i * (n + 1) + n] = self.by_p[i] * unit;
        }
        self.bordered[n * (n + 1)..].copy_from_slice(row);
    }

    /// Computes the unit tangent in the direction of `tangent`. Leaves it
    /// unchanged if the point is singular.
    fn tangent<E: ParametricEquations>(
        &mut self,
        equations: &mut E,
        x: &[f64],
        p: f64,
        unit: f64,
        tangent: &mut [f64],
    ) {
        let n = self.n;
        if !equations.evaluate(x, p, &mut self.f, &mut self.by_x, &mut self.by_p) {
            return;
        }
        self.border(unit, tangent);
        self.right.fill(0.0);
        self.right[n] = 1.0;
        if dense::solve(&mut self.bordered, n + 1, &mut self.right) {
            let norm = self.right.iter().map(|t| t * t).sum::<f64>().sqrt();
            for (t, r) in tangent.iter_mut().zip(&self.right) {
                *t = r / norm;
            }
        }
    }

    /// Corrects by Newton's method in the plane orthogonal to a tangent through a predicted point,
    /// or with the parameter fixed. Returns the number of iterations, or `None` if it fails.
    fn correct<E: ParametricEquations>(
        &mut self,
        equations: &mut E,
        x: &mut [f64],
        p: &mut f64,
        unit: f64,
        plane: Option<(&[f64], &Predicted)>,
    ) -> Option<usize> {
        let newton = DampedNewton {
            tolerance: equations.tolerance(),
            // At kinks, Newton's method first has to find the right side of each kink. It then
            // takes more than the usual three iterations without a risk of failure.
            iterations: 20,
            halvings: 0,
            largest_growth: f64::INFINITY,
            ..DampedNewton::default()
        };
        let start = (x.to_vec(), *p);
        let mut correction = Correction { corrector: self, equations, unit, plane, start, at: (x.to_vec(), *p) };
        correction.corrector.right.fill(0.0);
        let first = correction.move_by(0.0);
        let result = newton.run(&mut correction, first);
        let (found, parameter) = correction.at;
        x.copy_from_slice(&found);
        *p = parameter;
        (result.end == NewtonEnd::Converged).then_some(result.iterations)
    }
}

/// The iteration of one correction.
struct Correction<'a, E> {
    corrector: &'a mut Corrector,
    equations: &'a mut E,
    unit: f64,
    plane: Option<(&'a [f64], &'a Predicted)>,
    /// Start of the step.
    start: Predicted,
    /// Current point.
    at: Predicted,
}

impl<E: ParametricEquations> NewtonEquations for Correction<'_, E> {
    fn solve_step(&mut self, _residual: f64) -> bool {
        let Correction { corrector, unit, plane, start, at, .. } = self;
        let n = corrector.n;
        start.clone_from(at);
        corrector.right[..n].copy_from_slice(&corrector.f);
        match *plane {
            Some((tangent, (from, parameter))) => {
                corrector.border(*unit, tangent);
                let along: f64 = at.0.iter().zip(from).zip(tangent).map(|((x, f), t)| (x - f) * t).sum();
                corrector.right[n] = along + (at.1 - parameter) / *unit * tangent[n];
            }
            None => {
                let mut fixed_parameter = vec![0.0; n + 1];
                fixed_parameter[n] = 1.0;
                corrector.border(*unit, &fixed_parameter);
                corrector.right[n] = 0.0;
            }
        }
        dense::solve(&mut corrector.bordered, n + 1, &mut corrector.right)
    }

    fn move_by(&mut self, fraction: f64) -> f64 {
        let Corrector { f, by_x, by_p, right, n, .. } = &mut *self.corrector;
        for ((x, start), d) in self.at.0.iter_mut().zip(&self.start.0).zip(right.iter()) {
            *x = start - fraction * d;
        }
        self.at.1 = self.start.1 - fraction * right[*n] * self.unit;
        if !self.equations.evaluate(&self.at.0, self.at.1, f, by_x, by_p) {
            return f64::INFINITY;
        }
        f.iter().map(|f| f * f).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x (1 - p) = 1`: a resonance without damping.
    struct Pole;

    impl ParametricEquations for Pole {
        fn size(&self) -> usize {
            1
        }
        fn tolerance(&self) -> f64 {
            1e-10
        }
        fn evaluate(&mut self, x: &[f64], p: f64, f: &mut [f64], by_x: &mut [f64], by_p: &mut [f64]) -> bool {
            (f[0], by_x[0], by_p[0]) = (x[0] * (1.0 - p) - 1.0, 1.0 - p, -x[0]);
            true
        }
        fn jump_kink(&mut self, _: &mut [f64], _: f64) -> bool {
            false
        }
    }

    /// Each step is at most a tenth of the distance covered, so 193 steps reach a hundred million.
    #[test]
    fn branches_to_infinity_take_few_steps() {
        let (mut visited, mut farthest) = (0, 0.0f64);
        let end = trace(&mut Pole, &[1.0], 0.0, ContinuationSettings::between(0.0, 2.0, 0.2), &mut |_, x, p| {
            visited += 1;
            farthest = farthest.max(x[0]);
            assert!((x[0] * (1.0 - p) - 1.0).abs() < 1e-6, "{x:?} {p}");
            x[0] < 1e6
        });
        assert_eq!(end, BranchEnd::Stopped);
        assert!(farthest >= 1e6 && visited < 400, "{farthest} {visited} {end:?}");
    }
}
