//! Compliance at loaded rows, `Fᵀ A⁻¹ F`, by a forward substitution only.
//!
//! With `A = L D Lᵀ` this is `Yᵀ D⁻¹ Y` with `L Y = F`. If a force acts on few rows, Y has
//! entries only on the paths from these rows to the root of the elimination tree.

use super::factor::LdlFactor;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_unit_lower_triangular_in_place;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::DMatrix;

impl LdlFactor {
    /// Returns `Fᵀ A⁻¹ F` for columns F with few entries each, given as (row, value).
    ///
    /// # Panics
    /// If an entry lies outside the matrix.
    ///
    /// # Example
    /// ```
    /// use stickslip_numerics::sparse::{SparseMatrix, SymbolicAnalysis};
    /// let springs =
    ///     SparseMatrix::from_triplets(2, [(0, 0, 3.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)])
    ///         .unwrap();
    /// let factor = SymbolicAnalysis::new(&[&springs]).factor(&[(1.0, &springs)]).unwrap();
    /// let compliance = factor.compliance(&[vec![(1, 1.0)], vec![(0, 1.0), (1, -1.0)]]);
    /// assert!(
    ///     (compliance[(0, 0)] - 1.5).abs() < 1e-15 && (compliance[(0, 1)] + 1.0).abs() < 1e-15
    /// );
    /// ```
    pub fn compliance(&self, forces: &[Vec<(usize, f64)>]) -> DMatrix<f64> {
        let k = forces.len();
        let mut compliance = DMatrix::zeros(k, k);
        let Some(supernodes) = self.supernodes() else { return compliance };
        // The rows of Y in elimination order, k numbers each.
        let mut y = vec![0.0; self.n() * k];
        let mut moved = vec![false; self.n()];
        for (column, force) in forces.iter().enumerate() {
            for &(row, value) in force {
                let at = self.elimination_place(row);
                y[at * k + column] += value;
                moved[at] = true;
            }
        }
        let (mut below, mut weighted) = (Vec::new(), Vec::new());
        for s in 0..supernodes.symbolic().n_supernodes() {
            let part = supernodes.supernode(s);
            let (first, values) = (part.start(), part.val());
            let size = values.ncols();
            if !moved[first..first + size].contains(&true) {
                continue;
            }
            let own = first * k..(first + size) * k;
            let (top, bottom) = values.split_at_row(size);
            let whole = MatMut::from_row_major_slice_mut(&mut y[own.clone()], size, k);
            solve_unit_lower_triangular_in_place(top, whole, Par::Seq);
            below.resize(bottom.nrows() * k, 0.0);
            matmul(
                MatMut::from_row_major_slice_mut(&mut below, bottom.nrows(), k),
                Accum::Replace,
                bottom,
                MatRef::from_row_major_slice(&y[own.clone()], size, k),
                1.0,
                Par::Seq,
            );
            for (&row, below) in part.pattern().iter().zip(below.chunks_exact(k)) {
                let at = self.pivoted_place(row as usize);
                y[at * k..(at + 1) * k].iter_mut().zip(below).for_each(|(y, below)| *y -= below);
                moved[at] = true;
            }
            weighted.clear();
            weighted.extend_from_slice(&y[own.clone()]);
            self.divide_by_pivots(first, values, &mut weighted, k);
            matmul(
                MatMut::from_column_major_slice_mut(compliance.as_mut_slice(), k, k),
                Accum::Add,
                MatRef::from_row_major_slice(&y[own], size, k).transpose(),
                MatRef::from_row_major_slice(&weighted, size, k),
                1.0,
                Par::Seq,
            );
        }
        compliance
    }
}

#[cfg(test)]
mod tests {
    use crate::sparse::{SparseMatrix, SymbolicAnalysis};
    use nalgebra::DMatrix;

    /// Matrices with pivots of one and of two rows, compared with full solutions.
    #[test]
    fn half_a_solution_against_a_whole_one() {
        let n = 90;
        let noise = |i: usize| ((i * 7919 + 13) as f64).sin();
        let pairs = (0..n / 2).flat_map(|i| [(2 * i, 2 * i + 1, 2.0), (2 * i + 1, 2 * i, 2.0)]);
        let chain = (1..n).flat_map(|i| [(i, i - 1, noise(i)), (i - 1, i, noise(i)), (i, i, 0.01 * noise(i + n))]);
        let matrix = SparseMatrix::from_triplets(n, pairs.chain(chain)).unwrap();
        let factor = SymbolicAnalysis::new(&[&matrix]).factor(&[(1.0, &matrix)]).unwrap();
        let forces: Vec<Vec<(usize, f64)>> =
            (0..7).map(|k| (0..=k % 3).map(|i| ((11 * k + 5 * i) % n, noise(k + i))).collect()).collect();
        let mut x = DMatrix::zeros(n, forces.len());
        let entries = forces.iter().enumerate().flat_map(|(k, force)| force.iter().map(move |part| (k, part)));
        entries.clone().for_each(|(k, (row, value))| x[(*row, k)] += value);
        let f = x.clone();
        factor.solve(x.as_mut_slice());
        let (half, whole) = (factor.compliance(&forces), f.transpose() * x);
        assert!((&half - &whole).amax() < 1e-13 * whole.amax(), "{half} {whole}");
        assert!(factor.compliance(&[]).is_empty());
    }
}
