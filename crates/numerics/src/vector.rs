//! Sums over vectors.

/// Returns the scalar product, summed from the first entry to the last.
///
/// # Example
/// ```
/// assert_eq!(stickslip_numerics::vector::dot(&[1.0, 2.0], &[3.0, 4.0]), 11.0);
/// ```
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
