//! Which of several sizes leads, whatever rounding says: what is equal by symmetry comes out of a computation in any order.

/// Sizes that differ by less than this share are equal: far above the rounding and the residuals of orbits and modes, and below what a figure
/// or a table of six digits shows.
pub const EQUAL: f64 = 1e-6;

/// The first of the largest sizes, those equal to it but for [`EQUAL`]; `None` where none is positive and finite.
///
/// # Example
/// ```
/// use stickslip_numerics::leading::leading;
/// assert_eq!(leading([1.0, 3.0, 3.0 + 1e-12].into_iter()), Some(1));
/// assert_eq!(leading([0.0, f64::NAN].into_iter()), None);
/// ```
pub fn leading(sizes: impl Iterator<Item = f64> + Clone) -> Option<usize> {
    let largest = sizes.clone().filter(|size| size.is_finite()).fold(0.0, f64::max);
    let mut sizes = sizes.into_iter();
    (largest > 0.0).then(|| sizes.position(|size| size.is_finite() && size >= (1.0 - EQUAL) * largest)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is smaller by half of the share is equal, by twice of it not; a size that is no finite number never leads.
    #[test]
    fn of_equal_sizes_the_first_leads() {
        for (first, expected) in [(1.0 - 0.5 * EQUAL, 1), (1.0 - 2.0 * EQUAL, 2)] {
            assert_eq!(leading([f64::NAN, first, 1.0, f64::INFINITY].into_iter()), Some(expected));
        }
        assert_eq!(leading([0.0; 3].into_iter()), None);
        assert_eq!(leading(std::iter::empty()), None);
    }
}
