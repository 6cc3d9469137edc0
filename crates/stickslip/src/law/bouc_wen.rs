//! Bouc-Wen smooth hysteresis.
//!
//! `f = k z`, `z' = u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n`. Under monotonic loading z
//! tends to `(beta + gamma)^(-1/n)`; a larger n makes the knee sharper. `beta` creates the
//! hysteresis loop (with `beta = 0` the law is a spring), `gamma` changes its shape. The law is
//! rate-independent.
//! Source: Bouc (1967); Wen, "Method for random vibration of hysteretic systems" (1976).
//!
//! The law gives no energy in a closed motion for any `beta >= 0`: at the same z, the slope in
//! loading does not exceed that in unloading.

use super::kernels::kink::{abs, power};
use super::{Law, LawInfo, Parameter, Range, RateLaw, RateView, RelativeMotion};
use crate::dimension::Dimension;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Key of the exponent, to which the dimensions of beta and gamma are raised.
const EXPONENT: &str = "exponent";

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "bouc-wen",
    summary: "smooth hysteresis, f = stiffness z, z' = u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n with n = exponent",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "initial stiffness"),
        Parameter::new("beta", Dimension::INVERSE_LENGTH, Range::ZeroOrMore, "size of the hysteresis loop")
            .with_power_of(EXPONENT),
        Parameter::new(
            "gamma",
            Dimension::INVERSE_LENGTH,
            Range::Any,
            "shape of the hysteresis loop; beta + gamma must be more than zero",
        )
        .with_power_of(EXPONENT),
        // Units are written up to the 9th power. At the corner of the bilinear loop (the limit of
        // high exponents) the force is then 0.930 of its bound. For a sharper knee, use `jenkins`.
        Parameter::new(EXPONENT, Dimension::NONE, Range::Within(1.0, 9.0), "sharpness of the knee").with_default(1.0),
    ],
    sample: &[10_000.0, 1.5e7, 1e7, 2.0],
    build: |values| Arc::new(BoucWen { stiffness: values[0], beta: values[1], gamma: values[2], exponent: values[3] }),
};

/// Smooth hysteresis. The internal state is z divided by its limit, dimensionless, between -1
/// and 1.
///
/// # Example
/// ```
/// use stickslip::law::{BoucWen, Law};
/// let law = BoucWen { stiffness: 1e4, beta: 3e3, gamma: 2e3, exponent: 1.0 };
/// assert_eq!(law.force_scale(), 2.0); // stiffness / (beta + gamma)
/// // the force would be unbounded
/// assert!(BoucWen { gamma: -4e3, ..law }.check_consistency().is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoucWen {
    /// Initial stiffness, N/m.
    pub stiffness: f64,
    /// Parameter that creates the loop, 1/m to the power `exponent`.
    pub beta: f64,
    /// Parameter that shapes the loop, 1/m to the power `exponent`.
    pub gamma: f64,
    /// Sharpness of the knee, 1 or more.
    pub exponent: f64,
}

impl BoucWen {
    /// Returns the limit of z, m.
    fn state_limit(&self) -> f64 {
        (self.beta + self.gamma).powf(-1.0 / self.exponent)
    }
}

impl Law for BoucWen {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.beta, self.gamma, self.exponent]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        self.stiffness * self.state_limit()
    }
    fn reference_springs(&self) -> Option<[Vec<f64>; 2]> {
        Some([vec![0.0], vec![self.stiffness]])
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    fn check_consistency(&self) -> Result<(), String> {
        if self.beta + self.gamma > 0.0 {
            return Ok(());
        }
        Err(format!(
            "`beta + gamma` is {}; it must be more than zero, otherwise the force is unbounded",
            self.beta + self.gamma
        ))
    }
}

impl RateLaw for BoucWen {
    fn states(&self) -> usize {
        1
    }
    fn state_from_force(&self, force: &[f64], z: &mut [f64]) -> bool {
        z.fill((force[0] / self.force_scale()).clamp(-1.0, 1.0));
        true
    }
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
        let (zero, v, z) = (S::from(0.0), motion.velocity[0], z[0]);
        let sum = self.beta + self.gamma;
        // |z|^(n-1) z |u'| = |z|^n sgn z |u'|
        let loop_making = abs(v) * super::kernels::kink::sign(z.re()) * (self.beta / sum);
        rate[0] = (v - power(z, self.exponent) * (loop_making + v * (self.gamma / sum))) / self.state_limit();
        [z * self.force_scale(), zero, zero]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_the_equation() {
        let law = BoucWen { stiffness: 3.0, beta: 0.5, gamma: -0.2, exponent: 1.7 };
        for z in [-1.1, -0.4, 0.0, 0.9] {
            for v in [-2.0, 0.7] {
                let mut rate = [0.0];
                let force = law.evaluate(&RelativeMotion::along(0.0, v), &[z / law.state_limit()], &mut rate)[0];
                let expected = v - 0.5 * f64::abs(v) * f64::abs(z).powf(0.7) * z + 0.2 * v * f64::abs(z).powf(1.7);
                assert!((rate[0] * law.state_limit() - expected).abs() < 1e-14 && (force - 3.0 * z).abs() < 1e-14);
            }
        }
    }
}
