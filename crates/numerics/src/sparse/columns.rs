//! Vectors of one length side by side in one slice, and their products.

use super::matrix::Matrix;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::DMatrix;

/// `Vᵀ W` of columns of length `n`.
///
/// # Panics
/// If a length is no multiple of `n`.
///
/// # Example
/// ```
/// use stickslip_numerics::sparse::columns;
/// let product = columns::products(2, &[1.0, 2.0], &[3.0, 4.0, 5.0, 6.0]);
/// assert_eq!((product[(0, 0)], product[(0, 1)]), (11.0, 17.0));
/// ```
pub fn products(n: usize, v: &[f64], w: &[f64]) -> DMatrix<f64> {
    let (rows, columns) = (count(n, v), count(n, w));
    let mut product = DMatrix::zeros(rows, columns);
    if rows * columns > 0 {
        matmul(
            MatMut::from_column_major_slice_mut(product.as_mut_slice(), rows, columns),
            Accum::Replace,
            MatRef::from_column_major_slice(v, n, rows).transpose(),
            MatRef::from_column_major_slice(w, n, columns),
            1.0,
            Par::Seq,
        );
    }
    product
}

/// `W += factor V S` of columns of length `n`.
///
/// # Panics
/// If a length is no multiple of `n`, or `S` has not a row for every column of V and a column for every one of W.
pub fn add(n: usize, w: &mut [f64], factor: f64, v: &[f64], s: &DMatrix<f64>) {
    let (inner, columns) = (count(n, v), count(n, w));
    assert_eq!(s.shape(), (inner, columns), "a combination of {inner} columns to {columns}");
    if inner * columns > 0 {
        matmul(
            MatMut::from_column_major_slice_mut(w, n, columns),
            Accum::Add,
            MatRef::from_column_major_slice(v, n, inner),
            MatRef::from_column_major_slice(s.as_slice(), inner, columns),
            factor,
            Par::Seq,
        );
    }
}

/// `V S` of columns of length `n`.
///
/// # Panics
/// As [`add`].
pub fn combination(n: usize, v: &[f64], s: &DMatrix<f64>) -> Vec<f64> {
    let mut w = vec![0.0; n * s.ncols()];
    add(n, &mut w, 1.0, v, s);
    w
}

impl Matrix {
    /// `A V` of columns of length n.
    ///
    /// # Panics
    /// If the length of `v` is no multiple of n.
    pub fn times_columns(&self, v: &[f64]) -> Vec<f64> {
        let n = self.n();
        let mut product = vec![0.0; n * count(n, v)];
        for (w, v) in product.chunks_exact_mut(n.max(1)).zip(v.chunks_exact(n.max(1))) {
            for (column, &x) in v.iter().enumerate() {
                self.column(column).for_each(|(row, value)| w[row] += value * x);
            }
        }
        product
    }
}

/// How many columns of length `n`.
fn count(n: usize, v: &[f64]) -> usize {
    if n == 0 {
        assert!(v.is_empty(), "{} numbers are no columns of length zero", v.len());
        return 0;
    }
    assert!(v.len().is_multiple_of(n), "{} numbers are no columns of {n}", v.len());
    v.len() / n
}
