//! Following the solutions of `F(x, p) = 0` along the parameter p by arc length: tangent, corrector, step control.
//!
//! Source: Keller (1977); Allgower and Georg, "Introduction to Numerical Continuation Methods" (2003), Ch. 6.

use crate::dense;

/// Equations with a parameter. Unknowns should be of the order of one, and so should the range of the parameter: arc length adds them.
pub trait Equations {
    /// Number of unknowns.
    fn size(&self) -> usize;
    /// `F`, its derivative with respect to x (row-major, size²) and to p. False if it cannot be evaluated.
    fn evaluate(&mut self, x: &[f64], p: f64, f: &mut [f64], by_x: &mut [f64], by_p: &mut [f64]) -> bool;
    /// Size of F at which a point counts as solved.
    fn tolerance(&self) -> f64;
    /// A point at p by other means than from its neighbour: called where short steps fail, at kinks that the corrector cannot pass.
    /// False if there is none.
    fn leap(&mut self, _x: &mut [f64], _p: f64) -> bool {
        false
    }
}

/// Where to go, and how fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steps {
    /// Least and largest value of the parameter.
    pub range: (f64, f64),
    /// +1 to begin with a rising parameter, -1 with a falling one.
    pub direction: f64,
    /// Unit of the parameter in the arc length.
    pub unit: f64,
    /// Longest and shortest step of the arc, in this unit. Where the unknowns are larger than one the longest is in proportion to them.
    pub longest: f64,
    /// See `longest`.
    pub shortest: f64,
    /// Points at most.
    pub points: usize,
}

impl Steps {
    /// From one value to another, with steps of at most `step` along the parameter.
    pub fn between(from: f64, to: f64, step: f64) -> Self {
        Steps {
            range: (from.min(to), from.max(to)),
            direction: if to < from { -1.0 } else { 1.0 },
            unit: (to - from).abs(),
            longest: step / (to - from).abs(),
            shortest: 1e-9,
            points: 100_000,
        }
    }
}

/// Why a branch ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// The parameter has left its range: the last point is on its border.
    Border,
    /// All points are used up.
    Points,
    /// No shorter step converged.
    Stalled {
        /// Parameter at the last point.
        at: f64,
    },
    /// The visitor ended it.
    Stopped,
}

/// Corrector iterations. A step that took at most [`FEW`] of them is lengthened: where equations have kinks, Newton's method first has to
/// find on which side of each it is, and takes more than the usual three without being in danger.
const ITERATIONS: usize = 20;
/// See [`ITERATIONS`].
const FEW: usize = 10;
/// A step below this fraction of the longest asks for a leap.
const LEAP: f64 = 32.0;

/// Follows the branch from `(x, p)`, which solves the equations. `visit` sees every point and says whether to go on.
///
/// # Example
/// A circle, past its turning points:
/// ```
/// use stickslip_numerics::continuation::{End, Equations, Steps, trace};
/// struct Circle;
/// impl Equations for Circle {
///     fn size(&self) -> usize { 1 }
///     fn evaluate(&mut self, x: &[f64], p: f64, f: &mut [f64], by_x: &mut [f64], by_p: &mut [f64]) -> bool {
///         (f[0], by_x[0], by_p[0]) = (x[0] * x[0] + p * p - 1.0, 2.0 * x[0], 2.0 * p);
///         true
///     }
///     fn tolerance(&self) -> f64 { 1e-12 }
/// }
/// let steps = Steps { unit: 1.0, points: 200, ..Steps::between(-2.0, 2.0, 0.1) };
/// let mut lowest = 1.0f64;
/// let end = trace(&mut Circle, &[1.0], 0.0, steps, &mut |_, x, _| { lowest = lowest.min(x[0]); true });
/// assert_eq!(end, End::Points);
/// assert!(lowest < -0.99);
/// ```
pub fn trace<E: Equations>(
    equations: &mut E,
    x: &[f64],
    p: f64,
    steps: Steps,
    visit: &mut dyn FnMut(&mut E, &[f64], f64) -> bool,
) -> End {
    let n = equations.size();
    let mut work = Work::new(n);
    let (mut x, mut p) = (x.to_vec(), p);
    let mut tangent = vec![0.0; n + 1];
    tangent[n] = steps.direction;
    let mut length = 0.25 * steps.longest;
    if !visit(equations, &x, p) {
        return End::Stopped;
    }
    let mut fresh = true;
    let mut ahead = steps.direction;
    for _ in 1..steps.points {
        // far out steps are as long as the way is far, so that one that leads to infinity is not followed for ever
        let longest = steps.longest * x.iter().map(|x| x * x).sum::<f64>().sqrt().max(1.0);
        length = length.min(longest);
        if fresh {
            work.tangent(equations, &x, p, steps.unit, &mut tangent);
            fresh = false;
        }
        let (low, high) = steps.range;
        let mut next: Vec<f64> = x.iter().zip(&tangent).map(|(x, t)| x + length * t).collect();
        let mut q = p + length * tangent[n] * steps.unit;
        // a step that leaves the range ends on its border, with the parameter held
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
                next = x.iter().zip(&tangent).map(|(x, t)| x + share * length * t).collect();
                q = value;
                work.correct(equations, &mut next, &mut q, steps.unit, None)
            }
            None => {
                let predicted = (next.clone(), q);
                work.correct(equations, &mut next, &mut q, steps.unit, Some((&tangent, &predicted)))
            }
        };
        let inside = q >= low && q <= high;
        // a corrector that runs away has found another branch
        let moved: f64 = next.iter().zip(&x).map(|(a, b)| (a - b) * (a - b)).sum::<f64>()
            + ((q - p) / steps.unit) * ((q - p) / steps.unit);
        let near = moved.sqrt() <= 2.0 * length + 1e-12;
        let accepted = match solved {
            Some(iterations) if inside && near => Some(iterations),
            _ => None,
        };
        let Some(iterations) = accepted else {
            length *= 0.5;
            if length < longest / LEAP {
                // over the kink, by the step that was meant, if the equations know how
                let q = (p + (4.0 / LEAP) * steps.longest * steps.unit * ahead).clamp(low, high);
                next.copy_from_slice(&x);
                if q != p && equations.leap(&mut next, q) {
                    let border = q == low || q == high;
                    (x, p, fresh, length) = (next, q, true, 0.25 * steps.longest);
                    tangent.fill(0.0);
                    tangent[n] = ahead;
                    if !visit(equations, &x, p) {
                        return End::Stopped;
                    }
                    if border {
                        return End::Border;
                    }
                    continue;
                }
            }
            if length < steps.shortest {
                return End::Stalled { at: p };
            }
            continue;
        };
        ahead = if q < p { -1.0 } else { 1.0 };
        (x, p, fresh) = (next, q, true);
        if !visit(equations, &x, p) {
            return End::Stopped;
        }
        if border.is_some() {
            return End::Border;
        }
        if iterations <= FEW {
            length *= 1.5;
        }
    }
    End::Points
}

/// A predicted point.
type Predicted = (Vec<f64>, f64);

struct Work {
    n: usize,
    f: Vec<f64>,
    by_x: Vec<f64>,
    by_p: Vec<f64>,
    bordered: Vec<f64>,
    right: Vec<f64>,
}

impl Work {
    fn new(n: usize) -> Self {
        Work {
            n,
            f: vec![0.0; n],
            by_x: vec![0.0; n * n],
            by_p: vec![0.0; n],
            bordered: vec![0.0; (n + 1) * (n + 1)],
            right: vec![0.0; n + 1],
        }
    }

    /// The equations' derivative bordered by `row`, in units of the arc.
    fn border(&mut self, unit: f64, row: &[f64]) {
        let n = self.n;
        for i in 0..n {
            self.bordered[i * (n + 1)..i * (n + 1) + n].copy_from_slice(&self.by_x[i * n..(i + 1) * n]);
            self.bordered[i * (n + 1) + n] = self.by_p[i] * unit;
        }
        self.bordered[n * (n + 1)..].copy_from_slice(row);
    }

    /// The unit tangent that continues `tangent`; unchanged if the point is singular.
    fn tangent<E: Equations>(&mut self, equations: &mut E, x: &[f64], p: f64, unit: f64, tangent: &mut [f64]) {
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

    /// Newton's method across the arc, or with the parameter held. Returns the iterations it took.
    fn correct<E: Equations>(
        &mut self,
        equations: &mut E,
        x: &mut [f64],
        p: &mut f64,
        unit: f64,
        across: Option<(&[f64], &Predicted)>,
    ) -> Option<usize> {
        let n = self.n;
        let mut held = vec![0.0; n + 1];
        held[n] = 1.0;
        for iteration in 0..=ITERATIONS {
            if !equations.evaluate(x, *p, &mut self.f, &mut self.by_x, &mut self.by_p) {
                return None;
            }
            let size = self.f.iter().map(|f| f * f).sum::<f64>().sqrt();
            if size <= equations.tolerance() {
                return Some(iteration);
            }
            if !size.is_finite() || iteration == ITERATIONS {
                return None;
            }
            self.right[..n].copy_from_slice(&self.f);
            match across {
                Some((tangent, (from, start))) => {
                    self.border(unit, tangent);
                    let along: f64 = x.iter().zip(from).zip(tangent).map(|((x, f), t)| (x - f) * t).sum();
                    self.right[n] = along + (*p - start) / unit * tangent[n];
                }
                None => {
                    self.border(unit, &held);
                    self.right[n] = 0.0;
                }
            }
            if !dense::solve(&mut self.bordered, n + 1, &mut self.right) {
                return None;
            }
            for (x, d) in x.iter_mut().zip(&self.right) {
                *x -= d;
            }
            *p -= self.right[n] * unit;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x (1 - p) = 1`, a resonance without damping.
    struct Pole;

    impl Equations for Pole {
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
        fn leap(&mut self, _: &mut [f64], _: f64) -> bool {
            false
        }
    }

    /// Steps of a tenth of the way out: 193 of them to a hundred million, and not a thousand million.
    #[test]
    fn what_leads_to_infinity_takes_few_steps() {
        let (mut visited, mut farthest) = (0, 0.0f64);
        let end = trace(&mut Pole, &[1.0], 0.0, Steps::between(0.0, 2.0, 0.2), &mut |_, x, p| {
            visited += 1;
            farthest = farthest.max(x[0]);
            assert!((x[0] * (1.0 - p) - 1.0).abs() < 1e-6, "{x:?} {p}");
            x[0] < 1e6
        });
        assert_eq!(end, End::Stopped);
        assert!(farthest >= 1e6 && visited < 400, "{farthest} {visited} {end:?}");
    }
}
