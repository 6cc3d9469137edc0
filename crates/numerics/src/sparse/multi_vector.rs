//! Products with blocks of vectors, stored column by column in one slice.

use super::matrix::SparseMatrix;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::DMatrix;

/// Returns `Vᵀ W` of columns of length `n`.
///
/// # Panics
/// If a length is not a multiple of `n`.
///
/// # Example
/// ```
/// use stickslip_numerics::sparse::multi_vector;
/// let product = multi_vector::inner_products(2, &[1.0, 2.0], &[3.0, 4.0, 5.0, 6.0]);
/// assert_eq!((product[(0, 0)], product[(0, 1)]), (11.0, 17.0));
/// ```
pub fn inner_products(n: usize, v: &[f64], w: &[f64]) -> DMatrix<f64> {
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

/// Computes `W += factor V S` of columns of length `n`.
///
/// # Panics
/// If a length is not a multiple of `n`. Also if `S` does not have a row for
/// every column of V and a column for every column of W.
pub fn add(n: usize, w: &mut [f64], factor: f64, v: &[f64], s: &DMatrix<f64>) {
    let (inner, columns) = (count(n, v), count(n, w));
    assert_eq!(s.shape(), (inner, columns), "S must have {inner} rows and {columns} columns");
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

/// Returns `V S` of columns of length `n`.
///
/// # Panics
/// Under the conditions of [`add`].
pub fn combine(n: usize, v: &[f64], s: &DMatrix<f64>) -> Vec<f64> {
    let mut w = vec![0.0; n * s.ncols()];
    add(n, &mut w, 1.0, v, s);
    w
}

impl SparseMatrix {
    /// Returns `A V` of columns of length n.
    ///
    /// # Panics
    /// If the length of `v` is not a multiple of n.
    pub fn multiply_columns(&self, v: &[f64]) -> Vec<f64> {
        let n = self.n();
        let all = count(n, v);
        let mut product = vec![0.0; n * all];
        let at = |column: usize| column * n;
        let whole = all / COLUMNS_AT_ONCE * COLUMNS_AT_ONCE;
        self.multiply_n::<COLUMNS_AT_ONCE>(&v[..at(whole)], &mut product[..at(whole)]);
        let rest = (&v[at(whole)..], &mut product[at(whole)..]);
        match all - whole {
            0 => {}
            1 => self.multiply_n::<1>(rest.0, rest.1),
            2 => self.multiply_n::<2>(rest.0, rest.1),
            3 | 4 => self.multiply_n::<4>(rest.0, rest.1),
            _ => self.multiply_n::<COLUMNS_AT_ONCE>(rest.0, rest.1),
        }
        product
    }

    /// Computes `A V` for `N` columns at once, with zeros in place of missing columns. The columns
    /// are stored row by row, so an entry meets one row of all columns in consecutive memory.
    fn multiply_n<const N: usize>(&self, v: &[f64], product: &mut [f64]) {
        let n = self.n();
        if v.is_empty() {
            return;
        }
        let (mut from, mut to) = (vec![[0.0; N]; n], vec![[0.0; N]; n]);
        for (w, v) in product.chunks_mut(n * N).zip(v.chunks(n * N)) {
            if v.len() < n * N {
                from.fill([0.0; N]);
            }
            for (k, v) in v.chunks_exact(n).enumerate() {
                from.iter_mut().zip(v).for_each(|(from, x)| from[k] = *x);
            }
            to.fill([0.0; N]);
            for (column, from) in from.iter().enumerate() {
                let range = self.range(column);
                add_column(*from, &self.rows[range.clone()], &self.values[range], &mut to);
            }
            for (k, w) in w.chunks_exact_mut(n).enumerate() {
                w.iter_mut().zip(&to).for_each(|(w, to)| *w = to[k]);
            }
        }
    }
}

/// Adds a matrix column times `from` to `to`: N products at once.
#[inline]
fn add_column<const N: usize>(from: [f64; N], rows: &[u32], values: &[f64], to: &mut [[f64; N]]) {
    for (&row, &value) in rows.iter().zip(values) {
        // Copied arrays cannot overlap, so the compiler uses vector registers.
        let to = &mut to[row as usize];
        let mut sum = *to;
        for k in 0..N {
            sum[k] += value * from[k];
        }
        *to = sum;
    }
}

/// Number of columns multiplied at once: the entries are read once for all of them.
const COLUMNS_AT_ONCE: usize = 8;

/// Returns the number of columns of length `n`.
fn count(n: usize, v: &[f64]) -> usize {
    if n == 0 {
        assert!(v.is_empty(), "{} numbers do not form columns of length zero", v.len());
        return 0;
    }
    assert!(v.len().is_multiple_of(n), "{} numbers do not form columns of length {n}", v.len());
    v.len() / n
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns multiplied together have the same bits as columns multiplied alone.
    #[test]
    fn columns_together_are_columns_alone() {
        let n = 9;
        let noise = |i: usize| ((i * 7919 + 13) as f64).sin();
        let entries = (0..40).map(|i| ((i * 5) % n, (i * 7 + 3) % n, noise(i)));
        let matrix = SparseMatrix::from_triplets(n, entries).unwrap();
        for columns in 0..20 {
            let v: Vec<f64> = (0..n * columns).map(|i| noise(i + 100)).collect();
            let together = matrix.multiply_columns(&v);
            for (v, w) in v.chunks_exact(n).zip(together.chunks_exact(n)) {
                assert_eq!(matrix.multiply_columns(v), w);
            }
        }
        assert!(SparseMatrix::from_triplets(0, []).unwrap().multiply_columns(&[]).is_empty());
    }
}
