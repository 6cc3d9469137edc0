//! Approximate null space of a nearly singular matrix: its right singular
//! vectors with the smallest singular values.
//!
//! Small matrices use the singular value decomposition. Large matrices use
//! inverse iteration with `QᴴQ`: one factorization, and two solutions per step.
//! The iteration converges faster the closer the matrix is to singular. Two steps
//! are enough if the matrix is a polynomial matrix at one of its eigenvalues.
//! Source: Golub and Van Loan, "Matrix Computations" (2013), Sec. 8.2.3 (orthogonal iteration).

use crate::dense::ComplexLu;
use crate::eigen;
use nalgebra::DMatrix;
use num_complex::Complex64;

/// Rows from which the iteration takes less time than the singular value decomposition.
const ITERATED_FROM: usize = 8;

/// Returns an orthonormal basis, by columns, of the `dimension` directions with
/// the smallest singular values.
///
/// Returns `None` if an entry is not finite or the decomposition does not converge.
pub(crate) fn null_space(matrix: &DMatrix<Complex64>, dimension: usize) -> Option<DMatrix<Complex64>> {
    let r = matrix.nrows();
    if r == 1 {
        return Some(DMatrix::from_element(1, 1, Complex64::ONE));
    }
    let converged = if r >= ITERATED_FROM && dimension < r { by_inverse_iteration(matrix, dimension) } else { None };
    converged.or_else(|| by_svd(matrix, dimension))
}

/// Computes the basis by the singular value decomposition.
fn by_svd(matrix: &DMatrix<Complex64>, dimension: usize) -> Option<DMatrix<Complex64>> {
    let r = matrix.nrows();
    let svd = eigen::svd(matrix.clone())?;
    let v_t = svd.v_t.expect("asked for");
    let mut order: Vec<usize> = (0..r).collect();
    order.sort_by(|&a, &b| svd.singular_values[a].total_cmp(&svd.singular_values[b]));
    Some(DMatrix::from_fn(r, dimension.min(r), |i, j| v_t[(order[j], i)].conj()))
}

/// Computes the basis by inverse iteration. Returns `None` if it does not
/// converge because the next singular value is not much larger.
fn by_inverse_iteration(matrix: &DMatrix<Complex64>, dimension: usize) -> Option<DMatrix<Complex64>> {
    let r = matrix.nrows();
    let factor = ComplexLu::new(matrix.as_slice().to_vec(), r).or_else(|_| {
        let size = matrix.iter().map(|z| z.norm()).fold(0.0, f64::max);
        // If the factorization finds no pivot, this fraction of the largest entry is added to
        // the diagonal. It is within the rounding of the matrix.
        let shifted = matrix + DMatrix::from_diagonal_element(r, r, Complex64::new(f64::EPSILON * size, 0.0));
        ComplexLu::new(shifted.as_slice().to_vec(), r)
    });
    let factor = factor.ok()?;
    // Start columns without a pattern. If they are orthogonal to the null space by chance, the
    // iteration fails and the decomposition takes over.
    let mut found = DMatrix::from_fn(r, dimension, |i, j| {
        let at = (i * dimension + j) as f64;
        Complex64::new((1.0 + 7.0 * at).sin(), (2.0 + 11.0 * at).sin())
    });
    found = orthonormal(found)?;
    // Maximum number of steps. Each step divides the error by the square of the ratio of the
    // singular values, which is at least 10⁶ where the iteration is useful.
    for _ in 0..6 {
        let mut next = found.clone();
        factor.solve_adjoint(next.as_mut_slice());
        next = orthonormal(next)?;
        factor.solve(next.as_mut_slice());
        next = orthonormal(next)?;
        let change = &next - &found * (found.adjoint() * &next);
        found = next;
        // The iteration stops when a step changes the directions by less than this: a few times
        // the rounding of a solution.
        if change.iter().all(|z| z.norm() <= 1e-13) {
            return Some(found);
        }
    }
    None
}

/// Returns orthonormal columns with the same span, or `None` if an entry is not finite.
fn orthonormal(mut columns: DMatrix<Complex64>) -> Option<DMatrix<Complex64>> {
    // Scale the columns first: the solution of a nearly singular matrix may overflow when squared.
    for mut column in columns.column_iter_mut() {
        let size = column.iter().map(|z| z.re.abs().max(z.im.abs())).fold(0.0, f64::max);
        let finite = column.iter().all(|z| z.is_finite());
        if !finite || size == 0.0 {
            return None;
        }
        column /= Complex64::new(size, 0.0);
    }
    Some(columns.qr().q())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns `U Σ Vᴴ` with random directions and the given singular values, and V.
    fn made(values: &[f64], seed: f64) -> (DMatrix<Complex64>, DMatrix<Complex64>) {
        let r = values.len();
        let random = |first: f64| {
            let entry = |i: usize, j: usize| {
                let at = first + (i * r + j) as f64;
                Complex64::new((1.3 * at * at).sin(), (0.7 * at * at + 1.0).sin())
            };
            DMatrix::from_fn(r, r, entry).qr().q()
        };
        let (u, v) = (random(seed), random(seed + 0.5));
        let sigma = DMatrix::from_fn(r, r, |i, j| Complex64::new(if i == j { values[i] } else { 0.0 }, 0.0));
        (u * sigma * v.adjoint(), v)
    }

    /// Both methods find the directions that the matrix was made with: one or
    /// several, singular to rounding or not.
    #[test]
    fn both_methods_find_the_directions() {
        for least in [0.0, 1e-16, 1e-9] {
            for dimension in [1, 2, 3] {
                let values: Vec<f64> = (0..ITERATED_FROM + 5)
                    .map(|i| if i < dimension { least * (1.0 + i as f64) } else { 1.0 + i as f64 })
                    .collect();
                let (matrix, v) = made(&values, 3.0 + dimension as f64);
                let exact = v.columns(0, dimension);
                let of_iteration = by_inverse_iteration(&matrix, dimension).expect("it settles");
                for found in [&of_iteration, &by_svd(&matrix, dimension).unwrap()] {
                    assert!((found.adjoint() * found - DMatrix::identity(dimension, dimension)).camax() < 1e-14);
                    let missed = found - exact * (exact.adjoint() * found);
                    assert!(missed.camax() < 1e-13, "{least} {dimension}: {:.1e}", missed.camax());
                }
            }
        }
    }

    /// If the next singular value is as small, the iteration does not converge
    /// and the decomposition answers.
    #[test]
    fn directions_that_are_not_apart_are_left_to_the_decomposition() {
        let values: Vec<f64> = (0..ITERATED_FROM + 2).map(|i| 1.0 + 0.01 * i as f64).collect();
        let (matrix, _) = made(&values, 5.0);
        assert!(by_inverse_iteration(&matrix, 1).is_none());
        let found = null_space(&matrix, 1).unwrap();
        assert!(((&matrix * &found).norm() - 1.0).abs() < 1e-13);
    }

    /// A matrix with an entry that is not finite has no null space.
    #[test]
    fn non_finite_matrices_are_refused() {
        let mut matrix = DMatrix::from_element(ITERATED_FROM, ITERATED_FROM, Complex64::ONE);
        matrix[(1, 2)] = Complex64::new(f64::NAN, 0.0);
        assert!(null_space(&matrix, 1).is_none());
    }
}
