//! Whether a symmetric matrix is positive semidefinite, and of which rank: Cholesky's factorisation with pivots from the diagonal.
//!
//! Source: Higham, "Accuracy and Stability of Numerical Algorithms" (2002), Sec. 10.3.

use nalgebra::DMatrix;

/// Rounding of a row per entry, relative to its diagonal: sums of springs cancel to this, and so does the elimination.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// The rank of a symmetric positive semidefinite matrix; `None` if the matrix is not symmetric, has an entry that is not finite, or has a
/// negative eigenvalue beyond rounding. The rows are scaled to ones on the diagonal, so that a small negative entry counts beside large ones.
///
/// # Example
/// ```
/// use nalgebra::dmatrix;
/// use stickslip_numerics::definite::semidefinite;
/// assert_eq!(semidefinite(&dmatrix![2.0, -2.0; -2.0, 2.0]), Some(1));
/// assert_eq!(semidefinite(&dmatrix![1e9, 0.0; 0.0, -1e-9]), None);
/// ```
pub fn semidefinite(matrix: &DMatrix<f64>) -> Option<usize> {
    let n = matrix.nrows();
    let zero = ROUNDING * n as f64;
    if (0..n).any(|i| !(matrix[(i, i)] >= 0.0 && matrix[(i, i)].is_finite())) {
        return None;
    }
    let scale: Vec<f64> = (0..n).map(|i| matrix[(i, i)].sqrt()).collect();
    let mut rest = DMatrix::zeros(n, n);
    for i in 0..n {
        for k in 0..n {
            let value = matrix[(i, k)];
            if !value.is_finite() || (value != 0.0 && (scale[i] == 0.0 || scale[k] == 0.0)) {
                return None; // beside a zero on the diagonal everything is zero
            }
            rest[(i, k)] = if value == 0.0 { 0.0 } else { value / scale[i] / scale[k] };
        }
    }
    if (0..n).any(|i| (0..i).any(|k| (rest[(i, k)] - rest[(k, i)]).abs() > zero)) {
        return None;
    }
    let mut left: Vec<usize> = (0..n).filter(|&i| scale[i] > 0.0).collect();
    let mut rank = 0;
    while !left.is_empty() {
        let at = (0..left.len())
            .fold(0, |best, k| if rest[(left[k], left[k])] > rest[(left[best], left[best])] { k } else { best });
        let pivot = left.swap_remove(at);
        let value = rest[(pivot, pivot)];
        if value <= zero {
            left.push(pivot);
            break;
        }
        rank += 1;
        let linked: Vec<usize> = left.iter().copied().filter(|&i| rest[(i, pivot)] != 0.0).collect();
        for &k in &linked {
            let factor = rest[(k, pivot)] / value;
            for &i in &linked {
                rest[(i, k)] -= factor * rest[(i, pivot)];
            }
        }
    }
    // what is left has no pivot above rounding: it is zero, or it has a negative eigenvalue
    left.iter().all(|&i| left.iter().all(|&k| rest[(i, k)].abs() <= zero)).then_some(rank)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Springs from each to the next and, at the ends, to the ground.
    fn chain(n: usize, between: f64, ends: [f64; 2]) -> DMatrix<f64> {
        let mut k = DMatrix::zeros(n, n);
        for i in 1..n {
            k[(i, i)] += between;
            k[(i - 1, i - 1)] += between;
            k[(i, i - 1)] -= between;
            k[(i - 1, i)] -= between;
        }
        k[(0, 0)] += ends[0];
        k[(n - 1, n - 1)] += ends[1];
        k
    }

    #[test]
    fn chains() {
        for n in [2, 5, 40, 200] {
            assert_eq!(semidefinite(&chain(n, 0.3, [0.7, 0.0])), Some(n));
            assert_eq!(semidefinite(&chain(n, 0.3, [0.0, 0.0])), Some(n - 1));
            assert_eq!(semidefinite(&chain(n, 0.3, [0.7, -0.7])), None);
            assert_eq!(semidefinite(&(chain(n, 0.3, [0.0, 0.0]) * -1.0)), None);
        }
        // softer than rounding beside a stiff neighbour
        assert_eq!(semidefinite(&chain(2, 1e9, [1e-3, -2e-3])), None);
    }

    #[test]
    fn neither_symmetric_nor_finite() {
        use nalgebra::dmatrix;
        assert_eq!(semidefinite(&dmatrix![1.0, 0.1; -0.1, 1.0]), None);
        assert_eq!(semidefinite(&dmatrix![1.0, f64::NAN; f64::NAN, 1.0]), None);
        assert_eq!(semidefinite(&dmatrix![f64::INFINITY]), None);
        assert_eq!(semidefinite(&dmatrix![0.0, 1.0; 1.0, 0.0]), None);
        assert_eq!(semidefinite(&dmatrix![1.0, 2.0; 2.0, 1.0]), None);
        assert_eq!(semidefinite(&DMatrix::zeros(3, 3)), Some(0));
        assert_eq!(semidefinite(&DMatrix::zeros(0, 0)), Some(0));
    }

    proptest! {
        /// `A Aᵀ` has the rank of `A`; less a little of the identity it has a negative eigenvalue.
        #[test]
        fn products(entries in proptest::collection::vec(-1.0f64..1.0, 18), shift in 1e-6f64..1.0) {
            let a = DMatrix::from_vec(6, 3, entries);
            let product = &a * a.transpose();
            prop_assume!(a.singular_values().min() > 1e-3);
            prop_assert_eq!(semidefinite(&product), Some(3));
            prop_assert_eq!(semidefinite(&(&product - DMatrix::identity(6, 6) * shift)), None);
            prop_assert_eq!(semidefinite(&(&product + DMatrix::identity(6, 6) * shift)), Some(6));
        }
    }
}
