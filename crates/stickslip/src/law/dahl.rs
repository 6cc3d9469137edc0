//! Dahl's presliding friction: a spring whose tangent stiffness falls as its force approaches
//! the slip limit.
//!
//! `f' = k u' (1 - (f / limit) sgn u')`. The law is rate-independent and approaches the limit
//! without reaching it. It is the Bouc-Wen law with `n = 1`, `gamma = 0`, `beta = k / limit`.
//! Source: Dahl, "A solid friction model" (1968), exponent 1.

use super::kernels::kink::abs;
use super::{Law, LawInfo, Parameter, RateLaw, RateView, RelativeMotion};
use crate::dimension::Dimension;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "dahl",
    summary: "presliding friction, f' = stiffness u' (1 - (f/limit) sgn u')",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "initial stiffness"),
        Parameter::limit("slip limit; the force approaches it under monotonic loading"),
    ],
    sample: &[10_000.0, 2.0],
    build: |values| Arc::new(Dahl { stiffness: values[0], limit: values[1] }),
};

/// Presliding friction. The internal state is the force divided by the limit.
///
/// # Example
/// ```
/// use stickslip::law::{Dahl, RateLaw, RelativeMotion};
/// let law = Dahl { stiffness: 1e4, limit: 2.0 };
/// let mut rate = [0.0];
/// let force = law.evaluate(&RelativeMotion::along(0.0, 1e-3), &[0.5], &mut rate);
/// assert_eq!((force[0], rate[0]), (1.0, 2.5)); // at half the limit, half the stiffness
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dahl {
    /// Initial stiffness, N/m.
    pub stiffness: f64,
    /// Slip limit, N.
    pub limit: f64,
}

impl Law for Dahl {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.limit]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        self.limit
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
}

impl RateLaw for Dahl {
    fn states(&self) -> usize {
        usize::from(self.limit > 0.0) // without a limit, the law carries no force
    }
    fn state_from_force(&self, force: &[f64], z: &mut [f64]) -> bool {
        z.fill((force[0] / self.limit).clamp(-1.0, 1.0));
        true
    }
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
        let zero = S::from(0.0);
        let Some(&share) = z.first() else { return [zero; 3] };
        let v = motion.velocity[0];
        rate[0] = (v - abs(v) * share) * (self.stiffness / self.limit);
        [share * self.limit, zero, zero]
    }
}
