//! Parameters of the homotopies, and the tolerance of a solution.

use crate::method::harmonic_balance::aft::Ports;
use crate::method::harmonic_balance::equations::regularization::force_regularization;

/// Residual, relative to the motion and to the slip limits, at which the equations count as
/// solved. The usual rounding is a thousandth of it; larger rounding ends an iteration too, see
/// [`NewtonSettings`](crate::method::harmonic_balance::settings::NewtonSettings).
pub(crate) const RESIDUAL_TOLERANCE: f64 = 1e-10;

/// Parameters of the homotopy between easier equations and the given ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Homotopy {
    /// Factor `L` on the slip limits. Every law gives the force `L f(u / L)`, so that nonlinear
    /// effects begin only at large motions.
    pub limit_factor: f64,
    /// Weight `s` of the proximal term `s (λ - λ₀)`; λ₀ is the anchor of the search.
    pub proximal_weight: f64,
}

/// Parameters of the given equations.
pub(crate) const GIVEN_EQUATIONS: Homotopy = Homotopy { limit_factor: 1.0, proximal_weight: 0.0 };

impl Homotopy {
    /// Returns the term on the diagonal of the Jacobian of a force equation, at harmonic `h`.
    pub fn diagonal_term(self, h: usize) -> f64 {
        self.proximal_weight + force_regularization(h)
    }
}

/// The equations of one search: ports, frequency and homotopy.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SearchContext<'a> {
    pub ports: &'a Ports,
    /// Frequency of the motion, rad/s.
    pub omega: f64,
    pub homotopy: Homotopy,
}

impl<'a> SearchContext<'a> {
    /// Returns the context of the given equations.
    pub fn given(ports: &'a Ports, omega: f64) -> Self {
        SearchContext { ports, omega, homotopy: GIVEN_EQUATIONS }
    }
}
