//! Dry friction smoothed over velocity by an arctangent.
//!
//! `f = limit · (2/π) · arctan(alpha u')`. Eq. (2)
//! It never sticks: at `|f| < limit` it creeps with `u' = tan(π f / (2 limit)) / alpha`.
//! Source: Pust, Pesek, Radolfova (2015), Eq. (2). The paper's alpha = 25 s/mm is 25 000 s/m in
//! SI.

use super::interface::prox::resolve_saturating;
use super::{Law, LawInfo, Parameter, ProxView, RateLaw, RateView, RelativeMotion, SampleMeans};
use crate::dimension::Dimension;
use num_complex::Complex64;
use std::f64::consts::{FRAC_2_PI, PI};
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "coulomb-arctan",
    summary: "smoothed dry friction, f = limit (2/pi) arctan(alpha u'), paper Eq. (2)",
    parameters: &[
        Parameter::limit("friction force at high sliding velocity"),
        Parameter::positive("alpha", Dimension::INVERSE_VELOCITY, "steepness of the arctangent at zero velocity"),
    ],
    sample: &[2.0, 25_000.0],
    build: |values| Arc::new(CoulombArctan { limit: values[0], alpha: values[1] }),
};

/// Smooth dry friction.
///
/// # Example
/// ```
/// use stickslip::law::{CoulombArctan, RateLaw, RelativeMotion};
/// let law = CoulombArctan { limit: 2.0, alpha: 1.0 };
/// let force = law.evaluate::<f64>(&RelativeMotion::along(0.0, 1.0), &[], &mut []);
/// assert!((force[0] - 1.0).abs() < 1e-15);   // arctan 1 = π/4, half the limit
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoulombArctan {
    /// Limit of the force at high velocity, N.
    pub limit: f64,
    /// Steepness at zero velocity, s/m.
    pub alpha: f64,
}

impl Law for CoulombArctan {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.limit, self.alpha]
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
        true // the force grows with velocity
    }
    fn describing_function(&self, amplitude: f64, omega: f64) -> Complex64 {
        if self.limit == 0.0 {
            return Complex64::new(0.0, 0.0); // also at zero amplitude
        }
        // First harmonic of arctan(z cos θ) with the scaled velocity z. This form has no
        // cancellation at small z.
        let z = self.alpha * amplitude * omega;
        let first = self.limit * 4.0 / PI * z / ((1.0 + z * z).sqrt() + 1.0);
        Complex64::new(0.0, first / amplitude)
    }
}

impl RateLaw for CoulombArctan {
    #[doc(alias = "eq2")]
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; 3] {
        let zero = S::from(0.0);
        let scaled = motion.velocity[0] * self.alpha;
        [scaled.atan() * (self.limit * FRAC_2_PI), zero, zero] // Eq. (2)
    }
}

impl ProxView for CoulombArctan {
    fn resolve(&self, y: &[f64], penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        let (value, rise) =
            resolve_saturating(y[0] / self.limit, self.alpha * self.limit / penalty, arctangent_with_slope);
        (force[0], slope[0]) = (self.limit * value, rise);
    }
    fn force_at_velocity(&self, velocity: f64) -> Option<(f64, f64)> {
        let (value, slope) = arctangent_with_slope(self.alpha * velocity);
        Some((self.limit * value, self.limit * self.alpha * slope))
    }
    fn mean_at_velocity(&self, velocity: f64, e: f64) -> Option<SampleMeans> {
        let mean = mean_of_arctangent(self.alpha * velocity, self.alpha * e);
        Some(mean.scaled(self.limit * FRAC_2_PI, self.alpha))
    }
}

/// Returns `(2/π) arctan x` and its derivative.
fn arctangent_with_slope(x: f64) -> (f64, f64) {
    (FRAC_2_PI * x.atan(), FRAC_2_PI / (1.0 + x * x))
}

/// Returns means of `arctan(y + eξ)` over `-1 < ξ < 1`, in closed form, or by quadrature if the
/// closed form would lose digits to cancellation.
fn mean_of_arctangent(y: f64, e: f64) -> SampleMeans {
    let reach = e.abs();
    // Largest half-width of a sample, relative to the scale `1 + |y|` of the arctangent, at
    // which the quadrature of `SampleMeans::by_quadrature` is exact to rounding.
    if reach < 0.2 * (1.0 + y.abs()) {
        return SampleMeans::by_quadrature(y, e, |x| (x.atan(), 1.0 / (1.0 + x * x)));
    }
    SampleMeans::by_antiderivatives(y, e, |x| {
        let (atan, log) = (x.atan(), (x * x).ln_1p());
        [atan, x * atan - 0.5 * log, 0.5 * (x * x - 1.0) * atan + 0.5 * x - 0.5 * x * log]
    })
}
