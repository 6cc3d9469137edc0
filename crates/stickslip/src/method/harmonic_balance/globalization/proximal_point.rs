//! Proximal point method for friction forces that the equations leave undetermined.
//!
//! Forces of redundant contacts that stick are not unique. They change from one Newton step to
//! the next, and the set of slipping samples changes with them. A proximal term makes them
//! unique:
//!
//! `λ - P J(λ + ε u') + s (λ - λ₀) = 0`
//!
//! With a large `s` the forces stay near λ₀; with a small `s` the equations are nearly the
//! given ones. The forces of each solution are the next λ₀. `s` need not vanish: the residual
//! of the given equations is `s |λ - λ₀|`.
//!
//! Source: Rockafellar (1976), "Monotone operators and the proximal point algorithm".

use super::SearchSettings;
use super::homotopy::{GIVEN_EQUATIONS, Homotopy, RESIDUAL_TOLERANCE, SearchContext};
use crate::method::harmonic_balance::aft::Ports;
use crate::method::harmonic_balance::equations::{DerivativeScope, Discretization, HarmonicSolution};
use crate::method::harmonic_balance::newton::SolveError;

/// First value of `s`.
const FIRST_WEIGHT: f64 = 1.0;
/// Largest value of `s`. Beyond it a proximal point hardly moves.
const LARGEST_WEIGHT: f64 = 1e4;
/// Bounds of the factor by which `s` shrinks after a point. The factor is squared after few
/// Newton iterations, within these bounds; failures increase it.
const REDUCTION: [f64; 2] = [0.1, 0.3];
/// Factor above which a failure keeps `s` in the next try. A failure with an unchanged `s`
/// increases it.
const RETRY_FACTOR: f64 = 0.5;
/// Residual at which the last point counts as the solution if the next one is not found. It is
/// a thousandth of the usual truncation error. The total force of redundant contacts is then
/// known to this accuracy; only its distribution among them is not.
const ACCEPTED_RESIDUAL: f64 = 1e-6;
/// Largest number of points and tries; ten are usual.
const MOST: usize = 40;
/// Newton iterations per point; 2 to 10 are usual.
const ITERATIONS: usize = 30;
/// Newton iterations up to which a point was found quickly.
const QUICK: usize = 8;

impl Discretization {
    /// Solves by the proximal point method from `motion`. If that fails, `motion` is the last
    /// point found.
    pub(crate) fn proximal_point_method(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
    ) -> Result<(), SolveError> {
        self.begin_search(ports);
        self.search.anchor.clone_from(&motion.force);
        let mut good = HarmonicSolution { residual: f64::INFINITY, ..motion.clone() };
        let (mut pull, mut factor) = (FIRST_WEIGHT, 1.0f64);
        for _ in 0..MOST {
            let next = pull * factor;
            let before = motion.iterations;
            let found = self.newton(
                SearchContext { ports, omega, homotopy: Homotopy { proximal_weight: next, ..GIVEN_EQUATIONS } },
                motion,
                SearchSettings { iterations: ITERATIONS, ..SearchSettings::default() },
            );
            if found.is_ok() {
                let length = self.motion_scale(motion);
                motion.residual =
                    self.evaluate(SearchContext::given(ports, omega), motion, length, DerivativeScope::None);
                if motion.residual <= RESIDUAL_TOLERANCE {
                    return Ok(());
                }
                good.copy_from(motion);
                self.search.anchor.clone_from(&motion.force);
                pull = next;
                if motion.iterations - before <= QUICK || factor == 1.0 {
                    factor = (factor * factor).clamp(REDUCTION[0], REDUCTION[1]);
                }
            } else {
                good.iterations = motion.iterations;
                motion.copy_from(&good);
                match factor {
                    ..RETRY_FACTOR => factor = factor.sqrt(),
                    ..1.0 => factor = 1.0,
                    _ => pull /= REDUCTION[0],
                }
            }
            if pull > LARGEST_WEIGHT
                || self.is_budget_used(ports)
                || (found.is_err() && good.residual <= ACCEPTED_RESIDUAL)
            {
                break;
            }
        }
        motion.copy_from(&good);
        if motion.residual <= ACCEPTED_RESIDUAL {
            Ok(())
        } else {
            Err(SolveError::not_converged(motion.iterations, motion.residual))
        }
    }
}
