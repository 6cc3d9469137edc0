//! Valanis hysteresis (endochronic theory), for bolted joints: stiff in stick, softer in slip,
//! with a knee between them.
//!
//! `f' = E0 u' (1 + q) / (1 + kappa q)`, `q = (lambda / E0) sgn(u') (Et u - f)`. Under monotonic
//! loading f tends to a line of slope Et. kappa between 0 and 1 makes the knee sharper. The law
//! is rate-independent.
//! Source: Valanis (1971); for joints Gaul and Lenz, "Nonlinear dynamics of structures assembled
//! by bolted joints" (1997); Gaul and Nitsche, "The role of friction in mechanical joints"
//! (2001).
//!
//! The law gives no energy in a closed motion: apart from the spring Et, the slope at a given
//! force is never larger in loading than in unloading.

use super::kernels::kink::{abs, sign};
use super::{Law, LawInfo, Parameter, Range, RateLaw, RateView, RelativeMotion};
use crate::dimension::Dimension;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "valanis",
    summary: "joint with stick and slip stiffness, f' = E0 u' (1 + q)/(1 + kappa q), q = (lambda/E0) sgn(u') (Et u - f)",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "initial stiffness, E0"),
        Parameter::new(
            "slip_stiffness",
            Dimension::STIFFNESS,
            Range::ZeroOrMore,
            "stiffness in slip, Et; below `stiffness`",
        ),
        Parameter::positive(
            "lambda",
            Dimension::INVERSE_LENGTH,
            "reciprocal of the displacement over which stick turns into slip",
        ),
        Parameter::new(
            "kappa",
            Dimension::NONE,
            Range::Within(0.0, 1.0),
            "sharpness of the transition to slip, not 1 itself; near 1 there is no micro-slip",
        ),
    ],
    sample: &[10_000.0, 1000.0, 5000.0, 0.6],
    build: |values| {
        Arc::new(Valanis { stiffness: values[0], slip_stiffness: values[1], lambda: values[2], kappa: values[3] })
    },
};

/// A joint with different stiffnesses in stick and in slip. The internal state is
/// `y = (lambda / E0) (f - Et u)`, dimensionless, between -1 and 1.
///
/// # Example
/// ```
/// use stickslip::law::{RateLaw, RelativeMotion, Valanis};
/// let law = Valanis { stiffness: 1e4, slip_stiffness: 1e3, lambda: 5e3, kappa: 0.0 };
/// // without kappa the slope falls linearly with the force
/// let mut rate = [0.0_f64];
/// law.evaluate(&RelativeMotion::along(0.0, 1.0), &[0.5], &mut rate);
/// assert!((rate[0] - 5e3 * (0.5 - 0.1)).abs() < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Valanis {
    /// Initial stiffness `E0`, N/m.
    pub stiffness: f64,
    /// Stiffness in slip `Et`, N/m.
    pub slip_stiffness: f64,
    /// Rate of the transition from stick to slip, 1/m.
    pub lambda: f64,
    /// Sharpness of the knee, from 0 to below 1.
    pub kappa: f64,
}

impl Law for Valanis {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.slip_stiffness, self.lambda, self.kappa]
    }
    fn is_odd(&self) -> bool {
        true
    }
    /// The limit of the force beyond the spring Et in slip.
    fn force_scale(&self) -> f64 {
        self.stiffness / self.lambda * self.slip_state()
    }
    /// Without friction, the slip stiffness remains.
    fn reference_springs(&self) -> Option<[Vec<f64>; 2]> {
        Some([vec![self.slip_stiffness], vec![self.stiffness]])
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    fn check_consistency(&self) -> Result<(), String> {
        if self.slip_stiffness >= self.stiffness {
            return Err("`slip_stiffness` must be below `stiffness`; otherwise the joint does not slip".to_owned());
        }
        if self.kappa >= 1.0 {
            return Err("`kappa` must be below 1; at 1 the joint is a linear spring".to_owned());
        }
        Ok(())
    }
}

impl Valanis {
    /// Returns the limit of the state in slip.
    fn slip_state(&self) -> f64 {
        let (stick, slip) = (self.stiffness, self.slip_stiffness);
        (stick - slip) / (stick - self.kappa * slip)
    }
}

impl RateLaw for Valanis {
    fn states(&self) -> usize {
        1
    }
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
        let (u, v, y) = (motion.displacement[0], motion.velocity[0], z[0]);
        let mut knee = S::from(1.0) - y * (self.kappa * sign(v.re()));
        // No motion exceeds the limit of the state, but iterations may. The pole at
        // `|y| = 1/kappa` would give them a spurious solution.
        let least = 1.0 - self.kappa * self.slip_state();
        if knee.re() < least {
            knee = S::from(least);
        }
        rate[0] = ((v - abs(v) * y) / knee - v * (self.slip_stiffness / self.stiffness)) * self.lambda;
        [u * self.slip_stiffness + y * (self.stiffness / self.lambda), S::from(0.0), S::from(0.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_has_the_slope_of_its_equation() {
        let law = Valanis { stiffness: 10.0, slip_stiffness: 2.0, lambda: 3.0, kappa: 0.7 };
        for (u, force, v) in [(0.3, 1.1, 0.5), (0.3, 1.1, -0.5), (-2.0, -5.0, 1.0), (0.0, 0.0, -3.0)] {
            let y = law.lambda / law.stiffness * (force - law.slip_stiffness * u);
            let mut rate = [0.0];
            let found = law.evaluate(&RelativeMotion::along(u, v), &[y], &mut rate)[0];
            // f' from the rate of the state
            let slope = law.slip_stiffness * v + rate[0] * law.stiffness / law.lambda;
            let q = law.lambda / law.stiffness * v.signum() * (law.slip_stiffness * u - force);
            let expected = law.stiffness * v * (1.0 + q) / (1.0 + law.kappa * q);
            assert!((found - force).abs() < 1e-14 && (slope - expected).abs() < 1e-12, "{u} {force} {v}");
        }
    }

    #[test]
    fn a_state_beyond_slip_returns() {
        let law = Valanis { stiffness: 10.0, slip_stiffness: 2.0, lambda: 3.0, kappa: 0.98 };
        for y in [1.0, 1.0 / 0.98, 1.1, 2.0_f64] {
            for sign in [1.0, -1.0] {
                let mut rate = [0.0_f64];
                law.evaluate(&RelativeMotion::along(0.0, sign), &[sign * y], &mut rate);
                assert!(rate[0] * sign < 0.0 && rate[0].is_finite(), "{y} {sign}: {}", rate[0]);
            }
        }
    }

    #[test]
    fn slip_force_is_the_scale() {
        let law = Valanis { stiffness: 10.0, slip_stiffness: 2.0, lambda: 3.0, kappa: 0.7 };
        let mut rate = [1.0];
        law.evaluate(&RelativeMotion::along(0.0, 1.0), &[law.force_scale() * law.lambda / law.stiffness], &mut rate);
        assert!(rate[0].abs() < 1e-14);
    }
}
