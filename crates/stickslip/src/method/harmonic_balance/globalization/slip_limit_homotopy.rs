//! Homotopy in the slip limits, from limits at which all joints stick.
//!
//! With all joints stuck the equations are linear. The limits then fall to the given ones, and
//! each solution is the initial guess of the next.

use super::SearchSettings;
use crate::method::harmonic_balance::aft::Ports;
use crate::method::harmonic_balance::equations::homotopy::{GIVEN_EQUATIONS, Homotopy, SearchContext};
use crate::method::harmonic_balance::equations::{Discretization, HarmonicSolution};
use crate::method::harmonic_balance::newton::SolveError;
use crate::method::harmonic_balance::settings::SlipHomotopySettings;

impl Discretization {
    /// Lowers the slip limits from values at which all joints stick to the given ones.
    ///
    /// It begins without a solution, or from static equilibrium if only contacts support a body.
    pub(crate) fn slip_limit_homotopy(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
    ) -> Result<(), SolveError> {
        let mut good = HarmonicSolution { iterations: motion.iterations, ..self.frictionless_motion() };
        let settings = SlipHomotopySettings::default();
        let mut limits: f64 = 1.0;
        // with all joints stuck, the equations are linear
        let mut raised = Err(SolveError::not_converged(good.iterations, f64::INFINITY));
        for attempt in 0..60 {
            limits *= 4.0;
            if attempt == 1 {
                // steep friction, such as friction that falls with velocity, needs far higher
                // limits
                limits = limits.max(self.sticking_limit_factor(ports));
            }
            let iterations = good.iterations;
            good = match self.is_held_by_contacts() {
                true => HarmonicSolution { iterations, ..self.static_solution(limits) },
                false => HarmonicSolution { iterations, ..self.frictionless_motion() },
            };
            let most = match self.is_held_by_contacts() {
                true => settings.stuck_iterations,
                false => SearchSettings::default().iterations,
            };
            raised = self.newton(
                SearchContext { ports, omega, homotopy: Homotopy { limit_factor: limits, ..GIVEN_EQUATIONS } },
                &mut good,
                SearchSettings { iterations: most, ..SearchSettings::default() },
            );
            if raised.is_ok()
                || self.is_budget_used(ports)
                || good.iterations - motion.iterations > settings.raising_iterations
            {
                break;
            }
        }
        raised?;
        let mut factor: f64 = 0.5;
        while limits > 1.0 {
            motion.copy_from(&good);
            let next = (limits * factor).max(1.0);
            let done = self.newton(
                SearchContext { ports, omega, homotopy: Homotopy { limit_factor: next, ..GIVEN_EQUATIONS } },
                motion,
                SearchSettings::default(),
            );
            good.iterations = motion.iterations;
            match done {
                Ok(()) => {
                    good.copy_from(motion);
                    limits = next;
                }
                Err(error) => {
                    factor = factor.sqrt();
                    if factor > 0.995 || self.is_budget_used(ports) || good.iterations > settings.iterations {
                        return Err(error);
                    }
                }
            }
        }
        motion.copy_from(&good);
        Ok(())
    }
}
