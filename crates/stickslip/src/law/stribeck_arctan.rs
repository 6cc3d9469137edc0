//! Friction that falls with velocity, smoothed by an arctangent.
//!
//! `f = (2/π) arctan(alpha u') (Fc + (Fs - Fc) exp(-(u'/vs)²))`. It never sticks: it creeps. The
//! smoothing reduces the largest force below the static limit, less so for larger `alpha vs`. At
//! `alpha vs = 1000` and `Fc = 0.8 Fs` the largest force is 0.8 % below Fs.
//! Source: the arctangent of Pust, Pesek, Radolfova (2015), Eq. (2), multiplied by the Stribeck
//! curve.

use super::interface::parameter::STATIC_LIMIT;
use super::kernels::stribeck_curve::{check_limits, stribeck_force};
use super::{Contact, Law, LawInfo, Parameter, Range, RateLaw, RateView, RelativeMotion};
use crate::dimension::Dimension;
use std::f64::consts::FRAC_2_PI;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "stribeck-arctan",
    summary: "smoothed friction that falls with velocity, f = (2/pi) arctan(alpha u') (Fc + (Fs - Fc) exp(-(u'/vs)^2))",
    parameters: &[
        Parameter::limit("friction force at high velocity, Fc"),
        Parameter::new(
            STATIC_LIMIT,
            Dimension::FORCE,
            Range::ZeroOrMore,
            "friction force at low velocity, Fs; not below `limit`",
        ),
        Parameter::positive("velocity", Dimension::VELOCITY, "velocity over which friction falls, vs"),
        Parameter::positive("alpha", Dimension::INVERSE_VELOCITY, "steepness of the arctangent at rest"),
    ],
    sample: &[2.0, 2.5, 0.01, 25_000.0],
    build: |values| {
        Arc::new(StribeckArctan { limit: values[0], static_limit: values[1], velocity: values[2], alpha: values[3] })
    },
};

/// Smoothed friction that falls with velocity.
///
/// # Example
/// ```
/// use stickslip::law::{RateLaw, RelativeMotion, StribeckArctan};
/// let law = StribeckArctan { limit: 2.0, static_limit: 2.5, velocity: 1.0, alpha: 1.0 };
/// let force = law.evaluate(&RelativeMotion::along(0.0, 1.0), &[], &mut []);
/// assert!((force[0] - 0.5 * (2.0 + 0.5 / std::f64::consts::E)).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StribeckArctan {
    /// Friction force at high velocity `Fc`, N.
    pub limit: f64,
    /// Friction force at low velocity `Fs`, N.
    pub static_limit: f64,
    /// Velocity `vs` over which friction falls, m/s.
    pub velocity: f64,
    /// Steepness at zero velocity, s/m.
    pub alpha: f64,
}

impl Law for StribeckArctan {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.limit, self.static_limit, self.velocity, self.alpha]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        self.static_limit
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    fn contact_state(&self, velocity: &[f64], force: &[f64]) -> Contact {
        Contact::of_smooth_law(
            stribeck_force(velocity[0], self.limit, self.static_limit, self.velocity),
            velocity,
            force,
        )
    }
    fn check_consistency(&self) -> Result<(), String> {
        check_limits(self.limit, self.static_limit)
    }
}

impl RateLaw for StribeckArctan {
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; 3] {
        let (zero, v) = (S::from(0.0), motion.velocity[0]);
        let friction = stribeck_force(v, self.limit, self.static_limit, self.velocity);
        [(v * self.alpha).atan() * friction * FRAC_2_PI, zero, zero]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_reduces_the_static_limit_by_0_8_percent() {
        let law = StribeckArctan { limit: 0.8, static_limit: 1.0, velocity: 1.0, alpha: 1000.0 };
        let force = |v: f64| law.evaluate(&RelativeMotion::along(0.0, v), &[], &mut [])[0];
        let most = (1..10_000).map(|k| force(f64::from(k) * 1e-4)).fold(0.0, f64::max);
        assert!((0.0075..0.0085).contains(&(1.0 - most)), "{most}");
    }
}
