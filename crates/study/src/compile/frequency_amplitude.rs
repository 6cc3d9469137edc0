//! Amplitudes of forces that depend on the excitation frequency, such as the unbalance `m e Ω²`.
//!
//! Methods take a force as a polynomial of second degree in the excitation frequency. The
//! expression is sampled, and other expressions are refused.

use super::compiled::{CompiledQuantity, Environment};
use crate::syntax::error::Problem;
use stickslip::dimension::Dimension;

/// An amplitude over the excitation frequency, as it is stated.
#[derive(Debug, Clone)]
pub(crate) struct FrequencyAmplitude {
    pub quantity: CompiledQuantity,
    pub dimension: Dimension,
    pub example: &'static str,
}

/// The amplitude `constant + linear Ω + quadratic Ω²`, in SI with Ω in rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FrequencyPolynomial {
    pub constant: f64,
    pub linear: f64,
    pub quadratic: f64,
}

impl FrequencyPolynomial {
    fn at(self, omega: f64) -> f64 {
        self.constant + omega * (self.linear + omega * self.quadratic)
    }
}

impl FrequencyAmplitude {
    /// Returns the polynomial that the expression is.
    ///
    /// # Errors
    /// The expression has another dimension, or it is no polynomial of second degree.
    pub fn polynomial(&self, key: &str, environment: &Environment<'_>) -> Result<FrequencyPolynomial, Problem> {
        let at = |omega: f64| {
            let value = self.quantity.value_at(omega, key, environment)?;
            self.quantity.convert(value, self.dimension, key, self.example, environment)
        };
        // three frequencies with equal ratios determine it, others test it
        let step = 100.0;
        let (first, second, third) = (at(step)?, at(2.0 * step)?, at(4.0 * step)?);
        let (rise, last) = ((second - first) / step, (third - second) / (2.0 * step));
        let quadratic = (last - rise) / (3.0 * step);
        let linear = rise - 3.0 * step * quadratic;
        let found = FrequencyPolynomial { constant: first - step * (linear + step * quadratic), linear, quadratic };
        // a term below the rounding of the three values is absent
        let rounding = 1e-14 * first.abs().max(third.abs());
        let kept = |term: f64, at: f64| if (term * at).abs() > rounding { term } else { 0.0 };
        let found = FrequencyPolynomial {
            constant: kept(found.constant, 1.0),
            linear: kept(found.linear, step),
            quadratic: kept(found.quadratic, step * step),
        };
        for omega in [0.37 * step, 30.0 * step] {
            let (value, fitted) = (at(omega)?, found.at(omega));
            if (value - fitted).abs() > 1e-9 * value.abs().max(fitted.abs()) {
                let message = "an amplitude over `frequency` must be a sum of a constant, a multiple of `frequency` and a \
                    multiple of `frequency^2`";
                return Err(self.quantity.problem(key, message).help(
                    "an unbalance is \"m_e * frequency^2 / (1 rad)^2\"; for another dependence, use kind = \"orbit\" and \
                     vary a parameter that `frequency` and the amplitude read",
                ));
            }
        }
        Ok(found)
    }
}
