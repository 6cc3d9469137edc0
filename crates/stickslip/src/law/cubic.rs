//! Cubic spring: zero stiffness at zero displacement, stiffening with the cube of the
//! elongation.
//!
//! `f = k u³`. In parallel with a linear spring, it is the restoring force of the Duffing
//! oscillator.
//! Source: Duffing (1918).

use super::{Law, LawInfo, Parameter, Range, RateLaw, RateView, RelativeMotion};
use crate::dimension::Dimension;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "cubic",
    summary: "cubic spring, f = stiffness u^3",
    parameters: &[Parameter::new(
        "stiffness",
        Dimension::CUBIC_STIFFNESS,
        Range::Any,
        "force per cube of the elongation; negative: softening",
    )],
    sample: &[4e9],
    build: |values| Arc::new(Cubic { stiffness: values[0] }),
};

/// A cubic spring.
///
/// # Example
/// ```
/// use stickslip::law::{Cubic, Law};
/// let law = Cubic { stiffness: 4e9 };
/// assert_eq!(law.describing_function(1e-3, 1.0).re, 3e3); // ¾ k a²
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cubic {
    /// Force per cube of the elongation, N/m³.
    pub stiffness: f64,
}

impl Law for Cubic {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    /// `cos³ θ = ¾ cos θ + ¼ cos 3θ`.
    fn describing_function(&self, amplitude: f64, _omega: f64) -> Complex64 {
        Complex64::new(0.75 * self.stiffness * amplitude * amplitude, 0.0)
    }
}

impl RateLaw for Cubic {
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; 3] {
        let (zero, u) = (S::from(0.0), motion.displacement[0]);
        [u * u * u * self.stiffness, zero, zero]
    }
}
