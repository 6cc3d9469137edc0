//! Definiteness and rank of symmetric matrices, by Cholesky factorization with diagonal pivoting.
//!
//! Large matrices are first factored in blocks without pivoting, which is
//! enough if they are definite.
//!
//! A matrix is positive semidefinite if it passes one of two tests, each with its own rounding:
//! - With the diagonal scaled to ones. A small negative entry counts even if
//!   other entries are large.
//! - With the largest entry scaled to one. A matrix assembled from others, such as `Tᵀ M T` of
//!   a rigid link or a superelement, has the rounding of its largest entries everywhere.
//!   Negative eigenvalues of that size count as zero.
//!
//! Source: Higham, "Accuracy and Stability of Numerical Algorithms" (2002), Sec. 10.3.

use crate::eigen::symmetric_blocked;
use crate::sparse::{SparseMatrix, SymbolicAnalysis};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltParams, cholesky_in_place, cholesky_in_place_scratch};
use faer::{MatMut, Par, Spec};
use nalgebra::DMatrix;

/// Rounding per row, relative to the diagonal: sums of springs cancel to this,
/// and so does the elimination.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Returns the rank of a symmetric positive semidefinite matrix.
///
/// Returns `None` if the matrix is not symmetric, has an entry that is not
/// finite, or has a negative eigenvalue beyond rounding.
///
/// # Example
/// ```
/// use nalgebra::dmatrix;
/// use stickslip_numerics::definiteness::semidefinite_rank;
/// assert_eq!(semidefinite_rank(&dmatrix![2.0, -2.0; -2.0, 2.0]), Some(1));
/// assert_eq!(semidefinite_rank(&dmatrix![1e9, 0.0; 0.0, -1e-3]), None);
/// ```
pub fn semidefinite_rank(matrix: &DMatrix<f64>) -> Option<usize> {
    rank_scaled(matrix).or_else(|| {
        let size = largest(matrix)?;
        let (values, _) = symmetric_blocked(&(matrix / size))?;
        let zero = ROUNDING * matrix.nrows() as f64;
        values.iter().all(|value| *value >= -zero).then(|| values.iter().filter(|value| **value > zero).count())
    })
}

/// Returns the largest magnitude of an entry, or `None` if the matrix is zero, not finite, or
/// not symmetric to the rounding of that magnitude.
fn largest(matrix: &DMatrix<f64>) -> Option<f64> {
    let n = matrix.nrows();
    let size = matrix.iter().fold(0.0, |size: f64, value| size.max(value.abs()));
    let zero = ROUNDING * n as f64 * size;
    let symmetric = || (0..n).all(|i| (0..i).all(|k| (matrix[(i, k)] - matrix[(k, i)]).abs() <= zero));
    (size > 0.0 && matrix.iter().all(|value| value.is_finite()) && symmetric()).then_some(size)
}

/// Returns the rank by the test with ones on the diagonal.
fn rank_scaled(matrix: &DMatrix<f64>) -> Option<usize> {
    let n = matrix.nrows();
    let zero = ROUNDING * n as f64;
    let (mut rest, scale) = scaled(matrix)?;
    // Every pivot is at least the smallest eigenvalue, so the rank is full if
    // all eigenvalues exceed `zero`.
    if n >= BLOCKED_FROM && is_positive_definite(&rest, -zero) {
        return Some(n);
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
    // The remaining matrix has no pivot above rounding: it is zero, or it has a
    // negative eigenvalue.
    left.iter().all(|&i| left.iter().all(|&k| rest[(i, k)].abs() <= zero)).then_some(rank)
}

/// Returns true if a symmetric matrix is positive semidefinite, by the tests of
/// [`semidefinite_rank`].
///
/// It does not compute the rank, so semidefinite large matrices are factored in blocks too.
///
/// # Example
/// ```
/// use nalgebra::dmatrix;
/// use stickslip_numerics::definiteness::is_semidefinite;
/// assert!(
///     is_semidefinite(&dmatrix![2.0, -2.0; -2.0, 2.0])
///         && !is_semidefinite(&dmatrix![1.0, 2.0; 2.0, 1.0])
/// );
/// ```
pub fn is_semidefinite(matrix: &DMatrix<f64>) -> bool {
    let n = matrix.nrows();
    let zero = ROUNDING * n as f64;
    if n < BLOCKED_FROM {
        return semidefinite_rank(matrix).is_some();
    }
    scaled(matrix).is_some_and(|(rows, _)| is_positive_definite(&rows, zero))
        || largest(matrix).is_some_and(|size| is_positive_definite(&(matrix / size), zero))
}

/// Size from which factors in blocks are faster, as in [`dense`](crate::dense).
const BLOCKED_FROM: usize = 96;

/// Returns the matrix with rows and columns scaled to ones on the diagonal, and
/// the square roots of the diagonal.
///
/// Returns `None` if the matrix is not symmetric, or if an entry is not finite.
/// Returns `None` also for a negative diagonal entry, and for a nonzero entry
/// in the row or column of a zero diagonal entry.
fn scaled(matrix: &DMatrix<f64>) -> Option<(DMatrix<f64>, Vec<f64>)> {
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
                return None; // a zero diagonal entry requires a zero row and column
            }
            rest[(i, k)] = if value == 0.0 { 0.0 } else { value / scale[i] / scale[k] };
        }
    }
    if (0..n).any(|i| (0..i).any(|k| (rest[(i, k)] - rest[(k, i)]).abs() > zero)) {
        return None;
    }
    Some((rest, scale))
}

/// Returns true if a symmetric matrix with `shift` added to its diagonal is positive definite.
fn is_positive_definite(matrix: &DMatrix<f64>, shift: f64) -> bool {
    let n = matrix.nrows();
    let mut shifted = matrix.clone();
    (0..n).for_each(|i| shifted[(i, i)] += shift);
    let params = Spec::<LltParams, f64>::default();
    let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(n, Par::Seq, params));
    let whole = MatMut::from_column_major_slice_mut(shifted.as_mut_slice(), n, n);
    cholesky_in_place(whole, Default::default(), Par::Seq, MemStack::new(&mut memory), params).is_ok()
}

/// Tests a sparse symmetric matrix by the signs of the pivots, with the
/// diagonal shifted by rounding to either side.
///
/// Returns `Some(true)` if it is positive definite, `Some(false)` if it is positive
/// semidefinite only, and `None` if it is neither, or not symmetric.
///
/// # Example
/// ```
/// use stickslip_numerics::{definiteness::sparse_definite, sparse::SparseMatrix};
/// let spring = |ground: f64| {
///     SparseMatrix::from_triplets(
///         2,
///         [(0, 0, 2.0 + ground), (1, 1, 2.0), (0, 1, -2.0), (1, 0, -2.0)],
///     )
/// };
/// let definite = [1.0, 0.0, -1.0].map(|ground| sparse_definite(&spring(ground).unwrap()));
/// assert_eq!(definite, [Some(true), Some(false), None]);
/// ```
pub fn sparse_definite(matrix: &SparseMatrix) -> Option<bool> {
    definite(matrix, SymbolicAnalysis::new)
}

/// Tests a matrix like [`sparse_definite`], in the known elimination order of `analysis`.
///
/// Any order gives the same result. The order of an analysis whose matrices have entries
/// wherever this one has keeps the fill-in small.
///
/// # Panics
/// If the matrix does not have the size of the matrices analysed.
pub fn sparse_definite_with_order(matrix: &SparseMatrix, analysis: &SymbolicAnalysis) -> Option<bool> {
    definite(matrix, |matrices| analysis.with_same_order(matrices))
}

fn definite(matrix: &SparseMatrix, analysis: impl Fn(&[&SparseMatrix]) -> SymbolicAnalysis) -> Option<bool> {
    let n = matrix.n();
    // Larger than the threshold at which a sparse factor treats a pivot as rounding.
    let rounding = ROUNDING * n.max(16) as f64;
    let one = SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 1.0))).ok()?;
    let analysis = analysis(&[matrix, &one]);
    let positive = |rows: &SparseMatrix, shift: f64| {
        analysis.factor(&[(1.0, rows), (shift, &one)]).is_ok_and(|factor| factor.negative_pivots() == 0)
    };
    if let Some(rows) = sparse_scaled(matrix).filter(|rows| rows.asymmetry(rounding).is_none()) {
        if (0..n).all(|i| matrix.get(i, i) > 0.0) && positive(&rows, -rounding) {
            return Some(true);
        }
        if positive(&rows, rounding) {
            return Some(false);
        }
    }
    let size = matrix.max_abs();
    let whole = SparseMatrix::from_triplets(n, matrix.entries().map(|(i, k, value)| (i, k, value / size))).ok()?;
    (whole.asymmetry(rounding).is_none() && positive(&whole, rounding)).then_some(false)
}

/// Returns the matrix with rows and columns scaled to ones on the diagonal.
/// Zero rows get a one, which does not change the signs.
///
/// Returns `None` if a diagonal entry is negative, or if a nonzero entry lies
/// in the row or column of a zero diagonal entry.
fn sparse_scaled(matrix: &SparseMatrix) -> Option<SparseMatrix> {
    let n = matrix.n();
    let diagonal: Vec<f64> = (0..n).map(|i| matrix.get(i, i)).collect();
    let beside_zero = |(i, k, _): (usize, usize, f64)| i != k && (diagonal[i] == 0.0 || diagonal[k] == 0.0);
    if diagonal.iter().any(|d| *d < 0.0) || matrix.entries().any(beside_zero) {
        return None;
    }
    // Ones on the diagonal: a small negative entry counts even if other entries are large.
    let scale: Vec<f64> = diagonal.iter().map(|d| if *d > 0.0 { d.sqrt() } else { 1.0 }).collect();
    let scaled = matrix.entries().map(|(i, k, value)| (i, k, value / scale[i] / scale[k]));
    let empty = (0..n).filter(|i| diagonal[*i] == 0.0).map(|i| (i, i, 1.0));
    SparseMatrix::from_triplets(n, scaled.chain(empty)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Springs between consecutive masses and, at the ends, to the ground.
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
            assert_eq!(semidefinite_rank(&chain(n, 0.3, [0.7, 0.0])), Some(n));
            assert_eq!(semidefinite_rank(&chain(n, 0.3, [0.0, 0.0])), Some(n - 1));
            assert_eq!(semidefinite_rank(&chain(n, 0.3, [0.7, -0.7])), None);
            assert_eq!(semidefinite_rank(&(chain(n, 0.3, [0.0, 0.0]) * -1.0)), None);
            let sparse = |ends: [f64; 2]| {
                let full = chain(n, 0.3, ends);
                let all = (0..n * n).map(|at| (at / n, at % n, full[(at / n, at % n)]));
                let matrix = SparseMatrix::from_triplets(n, all).unwrap();
                let alone = sparse_definite(&matrix);
                // The elimination order does not change the result, even if it
                // is that of a matrix with other entries.
                let [wide, none] = [9, 0].map(|far| (0..far.min(n - 1)).map(|i| (i, n - 1 - i, 1.0)));
                for other in [wide, none] {
                    let order = SymbolicAnalysis::new(&[&SparseMatrix::from_triplets(n, other).unwrap()]);
                    assert_eq!(sparse_definite_with_order(&matrix, &order), alone);
                }
                alone
            };
            assert_eq!([sparse([0.7, 0.0]), sparse([0.0, 0.0]), sparse([0.7, -0.7])], [Some(true), Some(false), None]);
        }
        // The ground spring is softer than the rounding of the stiff spring.
        assert_eq!(semidefinite_rank(&chain(2, 1e9, [1e-3, -2e-3])), None);
    }

    /// Masses at some rows only, in the elimination order of a structure that connects all
    /// rows. Zero rows do not affect the result.
    #[test]
    fn places_without_mass_in_the_order_of_the_structure() {
        let n = 60;
        let springs = (1..n).flat_map(|i| [(i, i - 1, -1.0), (i - 1, i, -1.0)]).chain((0..n).map(|i| (i, i, 2.0)));
        let order = SymbolicAnalysis::new(&[&SparseMatrix::from_triplets(n, springs).unwrap()]);
        let masses = |last: f64| {
            let each = (0..n).filter(|i| i % 3 == 0).map(|i| (i, i, 1.0));
            let far = [(0, 57, 0.5), (57, 0, 0.5), (3, 3, last)];
            SparseMatrix::from_triplets(n, each.chain(far)).unwrap()
        };
        for (last, expected) in [(1.0, Some(false)), (-1.0, Some(false)), (-2.0, None)] {
            let mass = masses(last);
            assert_eq!([sparse_definite_with_order(&mass, &order), sparse_definite(&mass)], [expected; 2], "{last}");
        }
    }

    /// `v vᵀ` of a rigid link whose far end hardly moves: small entries have the rounding of
    /// the largest entry. Larger deviations are not rounding.
    #[test]
    fn rounding_of_the_largest_entry_is_no_negative_mass() {
        let link = 1e-6;
        let cases = [([link, link * link - 2e-16], Some(1)), ([0.0, -1e-16], Some(1)), ([link, 0.0], None)];
        for ([coupling, own], expected) in cases.into_iter().chain([([0.0, -1e-12], None)]) {
            for size in [2, 2 * BLOCKED_FROM] {
                // The 2 × 2 block of the link, repeated.
                let mut mass = DMatrix::zeros(size, size);
                for i in (0..size).step_by(2) {
                    (mass[(i, i)], mass[(i + 1, i + 1)]) = (3.0, 3.0 * own);
                    (mass[(i, i + 1)], mass[(i + 1, i)]) = (3.0 * coupling, 3.0 * coupling);
                }
                assert_eq!(rank_scaled(&mass), None, "judged row by row, the mass is negative");
                assert_eq!(semidefinite_rank(&mass), expected.map(|rank: usize| rank * size / 2), "{coupling} {own}");
                assert_eq!(is_semidefinite(&mass), expected.is_some(), "{coupling} {own}");
                let all = (0..size * size).map(|at| (at / size, at % size, mass[at]));
                let sparse = SparseMatrix::from_triplets(size, all).unwrap();
                assert_eq!(sparse_definite(&sparse), expected.map(|_| false), "{coupling} {own}");
            }
        }
    }

    #[test]
    fn neither_symmetric_nor_finite() {
        use nalgebra::dmatrix;
        assert_eq!(semidefinite_rank(&dmatrix![1.0, 0.1; -0.1, 1.0]), None);
        assert_eq!(semidefinite_rank(&dmatrix![1.0, f64::NAN; f64::NAN, 1.0]), None);
        assert_eq!(semidefinite_rank(&dmatrix![f64::INFINITY]), None);
        assert_eq!(semidefinite_rank(&dmatrix![0.0, 1.0; 1.0, 0.0]), None);
        assert_eq!(semidefinite_rank(&dmatrix![1.0, 2.0; 2.0, 1.0]), None);
        assert_eq!(semidefinite_rank(&DMatrix::zeros(3, 3)), Some(0));
        assert_eq!(semidefinite_rank(&DMatrix::zeros(0, 0)), Some(0));
    }

    proptest! {
        /// `A Aᵀ` has the rank of `A`. After subtraction of a multiple of the
        /// identity it has a negative eigenvalue.
        #[test]
        fn products(entries in proptest::collection::vec(-1.0f64..1.0, 18), shift in 1e-6f64..1.0) {
            let a = DMatrix::from_vec(6, 3, entries);
            let product = &a * a.transpose();
            prop_assume!(a.singular_values().min() > 1e-3);
            prop_assert_eq!(semidefinite_rank(&product), Some(3));
            prop_assert_eq!(semidefinite_rank(&(&product - DMatrix::identity(6, 6) * shift)), None);
            prop_assert_eq!(semidefinite_rank(&(&product + DMatrix::identity(6, 6) * shift)), Some(6));
        }
    }

    /// Large matrices have the ranks of small ones, with the same bounds.
    #[test]
    fn large_matrices_use_the_same_bounds() {
        let n = 3 * BLOCKED_FROM;
        for (ends, rank) in [([0.7, 0.0], Some(n)), ([0.0, 0.0], Some(n - 1)), ([0.7, -0.7], None)] {
            let chain = chain(n, 0.3, ends);
            assert_eq!((semidefinite_rank(&chain), is_semidefinite(&chain)), (rank, rank.is_some()), "{ends:?}");
        }
        let mut gap = chain(n, 0.3, [0.7, 0.0]);
        (0..n).for_each(|i| (gap[(i, 5)], gap[(5, i)]) = (0.0, 0.0));
        assert_eq!((semidefinite_rank(&gap), is_semidefinite(&gap)), (Some(n - 1), true));
        gap[(5, 5)] = -1e-9;
        assert_eq!((semidefinite_rank(&gap), is_semidefinite(&gap)), (None, false));
    }
}
