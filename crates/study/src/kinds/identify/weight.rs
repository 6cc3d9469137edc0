//! Standard deviations of measured values, as a target states them.

use crate::syntax::expression::{Expression, dimension_text};
use stickslip::dimension::Dimension;

/// The weight of a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Weight {
    /// A fraction of each value.
    Relative(f64),
    /// A fraction of the largest value in the group.
    OfLargest(f64),
    /// One value for all rows, in SI.
    Absolute(f64),
}

/// Beginning and end of a text that state a fraction.
const RELATIVE: &str = "relative ";
const OF_LARGEST: &str = " of largest";

impl Weight {
    /// Reads the weight of a quantity of this dimension.
    ///
    /// # Errors
    /// A sentence about what is wrong.
    pub fn read(text: &str, dimension: Dimension) -> Result<Weight, String> {
        let number = |text: &str, dimension: Dimension| {
            let value = Expression::compile::<&str>(text, &[]).and_then(|expression| expression.evaluate(&[]));
            let value = value.map_err(|error| format!("`weight` is not readable: {}", error.message))?;
            if value.dimension.unwrap_or(dimension) != dimension {
                return Err(format!("`weight` must be {}, or a fraction of the values", dimension_text(dimension)));
            }
            if value.si > 0.0 && value.si.is_finite() {
                Ok(value.si)
            } else {
                Err("`weight` must be more than zero".to_owned())
            }
        };
        let text = text.trim();
        if let Some(fraction) = text.strip_prefix(RELATIVE) {
            return Ok(Weight::Relative(number(fraction, Dimension::NONE)?));
        }
        if let Some(fraction) = text.strip_suffix(OF_LARGEST) {
            return Ok(Weight::OfLargest(number(fraction, Dimension::NONE)?));
        }
        Ok(Weight::Absolute(number(text, dimension)?))
    }

    /// Returns the standard deviations of the magnitudes of one group.
    ///
    /// A relative weight has a floor of a millionth of the largest value, so that a value of
    /// zero has a finite weight.
    pub fn deviations(self, magnitudes: &[f64]) -> Vec<f64> {
        let largest = magnitudes.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
        let largest = if largest > 0.0 { largest } else { 1.0 };
        let one = |value: &f64| match self {
            Weight::Relative(fraction) => fraction * value.abs().max(1e-6 * largest),
            Weight::OfLargest(fraction) => fraction * largest,
            Weight::Absolute(deviation) => deviation,
        };
        magnitudes.iter().map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_fractions_or_quantities() {
        let read = |text: &str| Weight::read(text, Dimension::FORCE);
        assert_eq!(read("relative 2 %"), Ok(Weight::Relative(0.02)));
        assert_eq!(read("1 % of largest"), Ok(Weight::OfLargest(0.01)));
        assert_eq!(read("0.5 kN"), Ok(Weight::Absolute(500.0)));
        assert!(read("1 mm").is_err() && read("-1 N").is_err() && read("relative").is_err() && read("0 N").is_err());
        assert_eq!(Weight::Relative(0.5).deviations(&[0.0, -2.0]), [1e-6, 1.0]);
        assert_eq!(Weight::OfLargest(0.5).deviations(&[1.0, -2.0]), [1.0, 1.0]);
    }
}
