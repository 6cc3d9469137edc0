//! Elastic dry friction smoothed over velocity: a massless spring in series with an arctangent
//! slider.
//!
//! The balance `kt (s - u) + limit (2/π) arctan(alpha s') = 0` gives `f = kt (u - s)` and
//! `f' = kt (u' - tan(π f / (2 limit)) / alpha)`, `|f| < limit`.
//! Source: Pust, Pesek, Radolfova (2015), Sec. 3, the equation of Fig. 3.

use super::interface::describing_function;
use super::{
    CoulombArctan, IdealElement, Law, LawInfo, Parameter, ProxView, RateLaw, RateView, RelativeMotion, SampleMeans,
};
use crate::dimension::Dimension;
use num_complex::Complex64;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "jenkins-arctan",
    summary: "spring and smoothed slider in series, f' = kt (u' - tan(pi f/(2 limit))/alpha)",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "tangential contact stiffness"),
        Parameter::limit("friction force at high sliding velocity"),
        Parameter::positive("alpha", Dimension::INVERSE_VELOCITY, "steepness of the arctangent at rest"),
    ],
    sample: &[10_000.0, 2.0, 25_000.0],
    build: |values| Arc::new(JenkinsArctan { stiffness: values[0], limit: values[1], alpha: values[2] }),
};

/// Spring and smooth slider in series.
///
/// The internal state is `z = asinh(alpha s')` with the slider velocity `s'`, dimensionless. The
/// state is unbounded, so no solver step can violate `|f| < limit`. It resolves the creep of the
/// stuck contact (`z` near 0) and grows only logarithmically in slip.
/// `f = limit (2/π) arctan(sinh z)`, `z' = kt (π / (2 limit)) cosh z (u' - sinh(z) / alpha)`.
///
/// # Example
/// ```
/// use stickslip::law::{JenkinsArctan, RateLaw, RelativeMotion};
/// let law = JenkinsArctan { stiffness: 1e4, limit: 2.0, alpha: 25e3 };
/// let mut rate = [0.0];
/// let force = law.evaluate(&RelativeMotion::along(0.0, 1e-3), &[0.0], &mut rate);
/// assert_eq!(force[0], 0.0);
/// assert!((rate[0] - 1e4 * std::f64::consts::PI / 4.0 * 1e-3).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JenkinsArctan {
    /// Stiffness of the spring `kt`, N/m.
    pub stiffness: f64,
    /// Limit of the slider force at high velocity, N.
    pub limit: f64,
    /// Steepness of the slider's arctangent at zero velocity, s/m.
    pub alpha: f64,
}

impl Law for JenkinsArctan {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.limit, self.alpha]
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
    fn prox(&self) -> Option<&dyn ProxView> {
        Some(self)
    }
    fn is_incrementally_passive(&self) -> bool {
        true // the spring stores δf²/(2 kt), and the slider velocity grows with the force
    }
    fn describing_function(&self, amplitude: f64, _omega: f64) -> Complex64 {
        // The exact law is a sufficient initial guess for the smooth one.
        describing_function::slider_or_stop(&IdealElement::slider(Some(self.stiffness), self.limit), amplitude)
    }
}

impl JenkinsArctan {
    /// Returns the slider without its spring.
    fn slider(&self) -> CoulombArctan {
        CoulombArctan { limit: self.limit, alpha: self.alpha }
    }
}

impl ProxView for JenkinsArctan {
    fn resolve(&self, y: &[f64], penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        self.slider().resolve(y, penalty, force, slope);
    }
    fn force_at_velocity(&self, velocity: f64) -> Option<(f64, f64)> {
        self.slider().force_at_velocity(velocity)
    }
    fn mean_at_velocity(&self, velocity: f64, e: f64) -> Option<SampleMeans> {
        self.slider().mean_at_velocity(velocity, e)
    }
    fn compliance(&self) -> f64 {
        1.0 / self.stiffness
    }
}

impl RateLaw for JenkinsArctan {
    #[inline]
    fn states(&self) -> usize {
        usize::from(self.limit > 0.0) // without a limit, the spring carries no force
    }
    fn state_from_force(&self, force: &[f64], z: &mut [f64]) -> bool {
        // Largest force that determines a state, relative to the limit.
        let max_force_ratio = 1.0 - 1e-12;
        // Forces beyond the limit are replaced by values just below it.
        let share = (force[0] / self.limit).clamp(-max_force_ratio, max_force_ratio);
        z.fill((share / FRAC_2_PI).tan().asinh());
        true
    }
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
        let zero = S::from(0.0);
        if z.is_empty() {
            return [zero, zero, zero];
        }
        let (sinh, cosh) = (z[0].sinh(), z[0].cosh());
        let creep = motion.velocity[0] - sinh * (1.0 / self.alpha);
        rate[0] = cosh * creep * (self.stiffness * FRAC_PI_2 / self.limit);
        [sinh.atan() * (self.limit * FRAC_2_PI), zero, zero]
    }
}
