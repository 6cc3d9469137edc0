//! Free vibration of a structure with gyroscopic damping.
//!
//! The gyroscopic part of the damping does no work. The frequencies are eigenvalues of
//! `q'' + D q' + Λ q = 0` in the undamped modes. `D` couples modes according to their
//! frequencies, so that much higher modes can be omitted.
//!
//! Source: Genta, "Dynamics of Rotating Systems" (2005), Ch. 2.

use nalgebra::DMatrix;
use stickslip_numerics::eigen;

/// A free vibration `exp(λ t)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FreeVibration {
    /// `Im λ`, rad/s.
    pub omega: f64,
    /// `-Re λ / |λ|`.
    pub damping: f64,
}

/// Returns all free vibrations in ascending order of frequency, for modes with squared
/// frequencies Λ and damping `D_ik = φᵢᵀ C φₖ`. Returns `None` if D is symmetric.
pub(crate) fn free_vibrations(squares: &[f64], damping: &DMatrix<f64>) -> Option<Vec<FreeVibration>> {
    let n = squares.len();
    // matrices can have ten digits
    let rounding = 1e-9 * damping.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    if (0..n).all(|i| (0..i).all(|k| (damping[(i, k)] - damping[(k, i)]).abs() <= rounding)) {
        return None;
    }
    let first_order = DMatrix::from_fn(2 * n, 2 * n, |row, column| match (row.checked_sub(n), column.checked_sub(n)) {
        (None, Some(column)) if column == row => 1.0,
        (Some(row), Some(column)) => -damping[(row, column)],
        (Some(row), None) if column == row => -squares[row],
        _ => 0.0,
    });
    let values = eigen::eigenvalues(&first_order)?;
    // the double zero of a free motion splits by the square root of the rounding error
    let least = 1e-6 * values.iter().fold(0.0, |most: f64, value| most.max(value.norm()));
    let vibrating = values.iter().filter(|value| value.im > least);
    let mut found: Vec<FreeVibration> =
        vibrating.map(|value| FreeVibration { omega: value.im, damping: -value.re / value.norm() }).collect();
    found.sort_by(|a, b| a.omega.total_cmp(&b.omega));
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    /// A shaft in two directions: `λ² + (c ± jg) λ + ω₀² = 0`, with the roots
    /// `λ = -(c ± jg)/2 + sqrt((c ± jg)²/4 - ω₀²)`.
    #[test]
    fn a_shaft_whirls_forward_and_backward() {
        let (c, g, square) = (10.0, 60.0, 2e5);
        let found = free_vibrations(&[square, square], &dmatrix![c, g; -g, c]).unwrap();
        let root = |g: f64| {
            let half = num_complex::Complex64::new(c, g) / 2.0;
            [-half + (half * half - square).sqrt(), -half - (half * half - square).sqrt()]
        };
        let mut expected: Vec<_> = [g, -g].into_iter().flat_map(root).filter(|value| value.im > 0.0).collect();
        expected.sort_by(|a, b| a.im.total_cmp(&b.im));
        assert_eq!(found.len(), 2);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found.omega / expected.im - 1.0).abs() < 1e-13);
            assert!((found.damping / (-expected.re / expected.norm()) - 1.0).abs() < 1e-10);
        }
        assert_eq!(free_vibrations(&[square, square], &dmatrix![c, g; g, c]), None);
        // a free rotor: two motions without a restoring force, and their nutation
        let free = free_vibrations(&[0.0, 0.0], &dmatrix![0.0, g; -g, 0.0]).unwrap();
        assert!(free.len() == 1 && (free[0].omega / g - 1.0).abs() < 1e-13);
    }
}
