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
use crate::method::harmonic_balance::aft::Ports;
use crate::method::harmonic_balance::equations::homotopy::{
    GIVEN_EQUATIONS, Homotopy, RESIDUAL_TOLERANCE, SearchContext,
};
use crate::method::harmonic_balance::equations::{DerivativeScope, Discretization, HarmonicSolution};
use crate::method::harmonic_balance::newton::SolveError;
use crate::method::harmonic_balance::settings::ProximalSettings;

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
        let settings = ProximalSettings::default();
        let (mut pull, mut factor) = (settings.first_weight, 1.0f64);
        for _ in 0..settings.points {
            let next = pull * factor;
            let before = motion.iterations;
            let found = self.newton(
                SearchContext { ports, omega, homotopy: Homotopy { proximal_weight: next, ..GIVEN_EQUATIONS } },
                motion,
                SearchSettings { iterations: settings.iterations, ..SearchSettings::default() },
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
                if motion.iterations - before <= settings.quick_iterations || factor == 1.0 {
                    factor = (factor * factor).clamp(settings.reduction[0], settings.reduction[1]);
                }
            } else {
                good.iterations = motion.iterations;
                motion.copy_from(&good);
                if factor < settings.retry_factor {
                    factor = factor.sqrt();
                } else if factor < 1.0 {
                    factor = 1.0;
                } else {
                    pull /= settings.reduction[0];
                }
            }
            if pull > settings.largest_weight
                || self.is_budget_used(ports)
                || (found.is_err() && good.residual <= settings.accepted_residual)
            {
                break;
            }
        }
        motion.copy_from(&good);
        if motion.residual <= settings.accepted_residual {
            Ok(())
        } else {
            Err(SolveError::not_converged(motion.iterations, motion.residual))
        }
    }
}
