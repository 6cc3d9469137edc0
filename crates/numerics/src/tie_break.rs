//! Index of the largest of several sizes, independent of rounding.
//!
//! Symmetric problems have sizes that are equal except for rounding; of these,
//! the first is returned.

/// Sizes that differ by less than this fraction are equal.
///
/// It is far above the rounding and the residuals of orbits and modes. It is below the
/// resolution of a figure or of a table of six digits.
pub const RELATIVE_TIE: f64 = 1e-6;

/// Returns the index of the first size within [`RELATIVE_TIE`] of the largest, or
/// `None` if no size is positive and finite.
///
/// # Example
/// ```
/// use stickslip_numerics::tie_break::first_largest;
/// assert_eq!(first_largest([1.0, 3.0, 3.0 + 1e-12].into_iter()), Some(1));
/// assert_eq!(first_largest([0.0, f64::NAN].into_iter()), None);
/// ```
pub fn first_largest(sizes: impl Iterator<Item = f64> + Clone) -> Option<usize> {
    let largest = sizes.clone().filter(|size| size.is_finite()).fold(0.0, f64::max);
    let mut sizes = sizes.into_iter();
    (largest > 0.0).then(|| sizes.position(|size| size.is_finite() && size >= (1.0 - RELATIVE_TIE) * largest)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A size smaller by half of the tolerance is equal, by twice the tolerance it is not. A
    /// size that is not finite is never the largest.
    #[test]
    fn first_of_equal_sizes_is_returned() {
        for (first, expected) in [(1.0 - 0.5 * RELATIVE_TIE, 1), (1.0 - 2.0 * RELATIVE_TIE, 2)] {
            assert_eq!(first_largest([f64::NAN, first, 1.0, f64::INFINITY].into_iter()), Some(expected));
        }
        assert_eq!(first_largest([0.0; 3].into_iter()), None);
        assert_eq!(first_largest(std::iter::empty()), None);
    }
}
