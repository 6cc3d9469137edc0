//! Dry friction smoothed over velocity: the paper's arctangent.
//!
//! `f = limit · (2/π) · arctan(alpha u')`.   Eq. (2)
//! It never sticks: at `|f| < limit` it creeps with `u' = tan(π f / (2 limit)) / alpha`.
//! Source: Pust, Pesek, Radolfova (2015), Eq. (2). The paper's alpha = 25 s/mm is 25 000 s/m in SI.

use super::{FrictionLaw, Parameter, Rate, RateLaw, Relative};
use crate::dimension::Dimension;
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_2_PI, PI};
use stickslip_numerics::dual::Real;

/// Smooth dry friction.
///
/// # Example
/// ```
/// use stickslip::law::{CoulombArctan, RateLaw, Relative};
/// let law = CoulombArctan { limit: 2.0, alpha: 1.0 };
/// let force = law.evaluate(&Relative::along(0.0, 1.0), &[], &mut []);
/// assert!((force[0] - 1.0).abs() < 1e-15);   // arctan 1 = π/4, half the limit
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CoulombArctan {
    /// Force that the law tends to at high velocity, N.
    pub limit: f64,
    /// Steepness at rest, s/m.
    pub alpha: f64,
}

impl FrictionLaw for CoulombArctan {
    const NAME: &'static str = "coulomb-arctan";
    const SUMMARY: &'static str = "smoothed dry friction, f = limit (2/pi) arctan(alpha u'), paper Eq. (2)";
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::limit("friction force at high sliding velocity"),
        Parameter::positive("alpha", Dimension::INVERSE_VELOCITY, "steepness of the arctangent at rest"),
    ];

    fn from_values(values: &[f64]) -> Self {
        CoulombArctan { limit: values[0], alpha: values[1] }
    }
    fn values(&self) -> Vec<f64> {
        vec![self.limit, self.alpha]
    }
    fn rate(&self) -> Option<Rate> {
        Some(Rate::CoulombArctan(*self))
    }
    fn is_incrementally_passive(&self) -> bool {
        true // the force grows with velocity
    }
    fn linearised(&self, amplitude: f64, omega: f64) -> Complex64 {
        if self.limit == 0.0 {
            return Complex64::new(0.0, 0.0); // also without motion
        }
        // first harmonic of arctan(z cos θ), z the scaled velocity; written without cancellation for small z
        let z = self.alpha * amplitude * omega;
        let first = self.limit * 4.0 / PI * z / ((1.0 + z * z).sqrt() + 1.0);
        Complex64::new(0.0, first / amplitude)
    }
}

impl RateLaw for CoulombArctan {
    #[inline]
    fn states(&self) -> usize {
        0
    }
    #[doc(alias = "eq2")]
    #[inline]
    fn evaluate<S: Real>(&self, contact: &Relative<S>, _z: &[S], _z_rate: &mut [S]) -> [S; 3] {
        let zero = S::from_f64(0.0);
        let scaled = contact.velocity[0] * S::from_f64(self.alpha);
        [scaled.atan() * S::from_f64(self.limit * FRAC_2_PI), zero, zero] // Eq. (2)
    }
}
