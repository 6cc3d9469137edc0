//! Damped Newton iteration: whole steps where they reduce the residual, shorter ones elsewhere.
//!
//! It serves orbits of harmonic balance, nonlinear modes and arc-length continuation, which
//! describe their equations by [`NewtonEquations`].
//!
//! Source: Dennis and Schnabel, "Numerical Methods for Unconstrained Optimization and Nonlinear
//! Equations" (1996), Ch. 6.

use crate::interrupt;

/// Equations with a current point, an approximate solution.
pub trait NewtonEquations {
    /// Solves for the Newton step at the current point, which has this residual, and keeps this
    /// point as the start of the step. Returns false if there is no step.
    fn solve_step(&mut self, residual: f64) -> bool;

    /// Moves from the start of the step by a fraction of it, from 0 (back to the start) to 1, in
    /// any order. Returns the norm of the residual there, which is not finite if the point is not
    /// allowed.
    fn move_by(&mut self, fraction: f64) -> f64;

    /// Is called with the step that leads to the current point. Returns the residual there if the
    /// unit of residuals has changed.
    fn accept(&mut self, _step: AcceptedStep) -> Option<f64> {
        None
    }

    /// Returns false if the last step had an approximate Jacobian. A residual that it does not
    /// reduce need not be rounding.
    fn has_exact_jacobian(&self) -> bool {
        true
    }

    /// Returns true if the iteration has used its work limit.
    fn is_budget_used(&self) -> bool {
        false
    }
}

/// The result of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AcceptedStep {
    /// Residual at the start of the step.
    pub before: f64,
    /// Residual after it.
    pub after: f64,
    /// True if all earlier steps since the last change of unit led to larger residuals.
    pub is_least: bool,
}

/// Settings of the iteration.
///
/// # Example
/// `arctan x = 0`, where whole steps from `x = 3` diverge:
/// ```
/// use stickslip_numerics::newton::{DampedNewton, NewtonEnd, NewtonEquations};
/// struct Arctan {
///     start: f64,
///     step: f64,
///     x: f64,
/// }
/// impl NewtonEquations for Arctan {
///     fn solve_step(&mut self, _: f64) -> bool {
///         (self.start, self.step) = (self.x, self.x.atan() * (1.0 + self.x * self.x));
///         true
///     }
///     fn move_by(&mut self, fraction: f64) -> f64 {
///         self.x = self.start - fraction * self.step;
///         self.x.atan().abs()
///     }
/// }
/// let newton = DampedNewton { tolerance: 1e-12, ..DampedNewton::default() };
/// let mut equations = Arctan { start: 3.0, step: 0.0, x: 3.0 };
/// assert_eq!(newton.run(&mut equations, 3f64.atan()).end, NewtonEnd::Converged);
/// assert!(equations.x.abs() < 1e-12);
///
/// let whole_steps = DampedNewton { halvings: 0, largest_growth: f64::INFINITY, ..newton };
/// let mut equations = Arctan { start: 3.0, step: 0.0, x: 3.0 };
/// assert_ne!(whole_steps.run(&mut equations, 3f64.atan()).end, NewtonEnd::Converged);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DampedNewton {
    /// Residual at which the iteration has converged. Default 1e-10.
    pub tolerance: f64,
    /// Largest residual that counts as rounding: the iteration ends at the start of the step if no
    /// fraction of the step reduces it. Default 0: never.
    pub rounding: f64,
    /// Largest number of steps. Default 60.
    pub iterations: usize,
    /// Largest number of halvings of a step. Default 7: slip sets change within a hundredth of a
    /// step.
    pub halvings: usize,
    /// Sufficient decrease: a step of fraction `t` must reduce the residual to at most
    /// `1 - t decrease` of its value. Default 1e-3: nearly every decrease is accepted.
    pub decrease: f64,
    /// Largest growth of the residual in a step. If no fraction of a step reduces the residual,
    /// the whole step is taken within this growth, which may break a cycle of slipping samples.
    /// Default 100; 0 takes no such step.
    pub largest_growth: f64,
    /// Number of steps without a halved least residual beyond which the iteration stagnates.
    /// Default: never.
    pub patience: usize,
}

impl Default for DampedNewton {
    fn default() -> Self {
        DampedNewton {
            tolerance: 1e-10,
            rounding: 0.0,
            iterations: 60,
            halvings: 7,
            decrease: 1e-3,
            largest_growth: 100.0,
            patience: usize::MAX,
        }
    }
}

/// The reason why an iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NewtonEnd {
    /// The residual is at most the tolerance.
    Converged,
    /// The residual is rounding.
    Rounding,
    /// There is no Newton step.
    Singular,
    /// The last step is not permitted: the residual grows too much, is not finite, or is not
    /// reduced by any fraction while `largest_growth` is 0.
    Diverged,
    /// The residual did not halve.
    Stagnated,
    /// The largest number of steps was taken.
    Iterations,
    /// The work limit was used.
    Budget,
}

/// The result of an iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewtonResult {
    /// Why it ended.
    pub end: NewtonEnd,
    /// Residual of the current point. After [`NewtonEnd::Diverged`] the equations stand at the
    /// refused point, and this is the residual before it.
    pub residual: f64,
    /// Least residual after a step; infinite before the first step and after a change of unit.
    pub least: f64,
    /// Number of steps, also the refused one.
    pub iterations: usize,
}

impl DampedNewton {
    /// Iterates from the current point of the equations, which has the residual `first`.
    pub fn run(&self, equations: &mut impl NewtonEquations, first: f64) -> NewtonResult {
        let mut result =
            NewtonResult { end: NewtonEnd::Iterations, residual: first, least: f64::INFINITY, iterations: 0 };
        let (mut to_halve, mut stagnating) = (first, 0);
        loop {
            interrupt::check();
            let before = result.residual;
            let ended = |end| NewtonResult { end, ..result };
            if before <= self.tolerance {
                return ended(NewtonEnd::Converged);
            }
            if result.iterations == self.iterations {
                return ended(NewtonEnd::Iterations);
            }
            if equations.is_budget_used() {
                return ended(NewtonEnd::Budget);
            }
            if stagnating > self.patience && result.least < f64::INFINITY {
                return ended(NewtonEnd::Stagnated);
            }
            if !equations.solve_step(before) {
                return ended(NewtonEnd::Singular);
            }
            result.iterations += 1;
            let after = match self.line_search(equations, before) {
                Ok(reduced) => reduced,
                Err(_) if before <= self.rounding && equations.has_exact_jacobian() => {
                    result.residual = equations.move_by(0.0);
                    equations.accept(AcceptedStep { before, after: result.residual, is_least: false });
                    return NewtonResult { end: NewtonEnd::Rounding, ..result };
                }
                Err(_) if self.largest_growth == 0.0 => return NewtonResult { end: NewtonEnd::Diverged, ..result },
                Err(whole) if self.halvings == 0 => whole,
                Err(_) => equations.move_by(1.0),
            };
            if !after.is_finite() || after > self.largest_growth.max(1.0) * before {
                return NewtonResult { end: NewtonEnd::Diverged, ..result };
            }
            result.residual = after;
            let is_least = after < result.least;
            result.least = result.least.min(after);
            if result.least < 0.5 * to_halve {
                (to_halve, stagnating) = (result.least, 0);
            } else {
                stagnating += 1;
            }
            if let Some(residual) = equations.accept(AcceptedStep { before, after, is_least }) {
                (result.residual, result.least) = (residual, f64::INFINITY);
            }
        }
    }

    /// Moves to the first fraction of 1, ½, ¼, … that reduces the residual, and returns
    /// the residual there. Fails with the residual of the shortest step if none does.
    fn line_search(&self, equations: &mut impl NewtonEquations, before: f64) -> Result<f64, f64> {
        let (mut fraction, mut after) = (1.0, f64::INFINITY);
        for _ in 0..=self.halvings {
            after = equations.move_by(fraction);
            if after < (1.0 - self.decrease * fraction) * before {
                return Ok(after);
            }
            fraction *= 0.5;
        }
        Err(after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equations of one unknown: the residual at `x` and the Newton step there.
    struct OneUnknown {
        residual: fn(f64) -> f64,
        newton_step: fn(f64) -> f64,
        start: f64,
        x: f64,
        moves: usize,
    }

    impl OneUnknown {
        fn new(x: f64, residual: fn(f64) -> f64, newton_step: fn(f64) -> f64) -> OneUnknown {
            OneUnknown { residual, newton_step, start: x, x, moves: 0 }
        }

        fn run(&mut self, newton: DampedNewton) -> NewtonResult {
            newton.run(self, (self.residual)(self.x))
        }
    }

    impl NewtonEquations for OneUnknown {
        fn solve_step(&mut self, _: f64) -> bool {
            self.start = self.x;
            (self.newton_step)(self.x) != 0.0
        }
        fn move_by(&mut self, fraction: f64) -> f64 {
            self.moves += 1;
            self.x = self.start - fraction * (self.newton_step)(self.start);
            (self.residual)(self.x)
        }
    }

    /// Rounding leaves a residual of 1e-9: steps from there change the point and reduce nothing.
    #[test]
    fn a_residual_of_rounding_ends_the_iteration_at_the_last_good_point() {
        let rounded = || OneUnknown::new(1.0, |x| x.abs().max(1e-9), |x| if x.abs() > 1e-11 { x } else { 1e-12 });
        let mut equations = rounded();
        let result = equations.run(DampedNewton { rounding: 1e-8, ..DampedNewton::default() });
        assert_eq!((result.end, result.residual), (NewtonEnd::Rounding, 1e-9));
        assert_eq!(equations.x, equations.start);
        assert_eq!(rounded().run(DampedNewton::default()).end, NewtonEnd::Iterations);
        let patience = DampedNewton { patience: 3, ..DampedNewton::default() };
        assert_eq!(rounded().run(patience).end, NewtonEnd::Stagnated);
    }

    /// The whole steps of `x^(1/3) = 0` lead to `-2 x`: the residual grows by the factor 1.26.
    #[test]
    fn whole_steps_may_let_the_residual_grow_within_a_limit() {
        let cubic_root = || OneUnknown::new(1.0, |x| x.cbrt().abs(), |x| 3.0 * x);
        let whole = |largest_growth| DampedNewton { halvings: 0, largest_growth, ..DampedNewton::default() };
        assert_eq!(cubic_root().run(whole(1.2)).end, NewtonEnd::Diverged);
        assert_eq!(cubic_root().run(whole(0.0)).end, NewtonEnd::Diverged);
        assert_eq!(cubic_root().run(whole(1.3)).end, NewtonEnd::Iterations);
        assert_eq!(
            cubic_root().run(DampedNewton { iterations: 200, ..DampedNewton::default() }).end,
            NewtonEnd::Converged
        );
        assert_eq!(OneUnknown::new(1.0, |_| 1.0, |_| 0.0).run(whole(1.2)).end, NewtonEnd::Singular);
    }
}
