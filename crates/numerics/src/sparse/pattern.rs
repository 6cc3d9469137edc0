//! Where the entries of some matrices stand, the order of their elimination, and where entries of a factor appear.

use super::matrix::Matrix;
use faer::Side;
use faer::perm::PermRef;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::linalg::lu::{LuSymbolicParams, SymbolicLu, factorize_symbolic_lu};
use feral_metis::{CscPattern, metis_order};
use std::ops::{AddAssign, Mul};
use std::sync::OnceLock;

/// Shared by the factors that were made with it.
#[derive(Debug)]
pub(super) struct Pattern {
    pub n: usize,
    /// Both triangles, the diagonal whole.
    pub starts: Vec<u32>,
    pub rows: Vec<u32>,
    /// The place of every row in the order of elimination, and its inverse.
    order: Vec<u32>,
    inverse: Vec<u32>,
    real: OnceLock<Symbolic>,
    complex: OnceLock<Symbolic>,
    unsymmetric: OnceLock<SymbolicLu<u32>>,
}

/// Lower triangle and the entries of its factor.
#[derive(Debug)]
pub(super) struct Symbolic {
    pub starts: Vec<u32>,
    pub rows: Vec<u32>,
    pub cholesky: SymbolicCholesky<u32>,
}

impl Pattern {
    /// Of matrices of one size and their mirror images.
    pub fn new(matrices: &[&Matrix]) -> Self {
        let n = matrices.first().map_or(0, |matrix| matrix.n());
        assert!(matrices.iter().all(|matrix| matrix.n() == n), "the matrices of a sum have one size");
        let (starts, rows) = union(n, matrices);
        let order = order(n, &starts, &rows);
        let mut inverse = vec![0; n];
        order.iter().enumerate().for_each(|(at, &row)| inverse[row as usize] = at as u32);
        let (real, complex, unsymmetric) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
        Pattern { n, starts, rows, order, inverse, real, complex, unsymmetric }
    }

    /// The entries of a sum, in the places of the pattern.
    pub fn sum<T: Copy + Default + AddAssign + Mul<f64, Output = T>>(&self, sum: &[(T, &Matrix)]) -> Vec<T> {
        let mut values = vec![T::default(); self.rows.len()];
        for &(factor, matrix) in sum {
            assert_eq!(matrix.n(), self.n, "the matrices of a sum have the size of those analysed");
            for column in 0..self.n {
                let mut at = self.starts[column] as usize;
                for (row, value) in matrix.column(column) {
                    while self.rows[at] as usize != row {
                        at += 1;
                        assert!(at < self.starts[column + 1] as usize, "({row}, {column}) was not analysed");
                    }
                    values[at] += factor * value;
                }
            }
        }
        values
    }

    /// Of the real factor.
    pub fn real(&self) -> &Symbolic {
        self.real.get_or_init(|| {
            let mut lower = (vec![0], Vec::new());
            for column in 0..self.n {
                let rows = &self.rows[self.starts[column] as usize..self.starts[column + 1] as usize];
                lower.1.extend(rows.iter().copied().filter(|row| *row as usize >= column));
                lower.0.push(lower.1.len() as u32);
            }
            self.symbolic(lower, &self.order, &self.inverse)
        })
    }

    /// Of the factor of `[Re Im; Im -Re]`, row by row and column by column: a symmetric complex matrix as a symmetric real one of twice
    /// the size, whose products are those of the complex one with the conjugate.
    pub fn complex(&self) -> &Symbolic {
        self.complex.get_or_init(|| {
            let mut lower = (vec![0], Vec::new());
            for column in 0..self.n {
                let rows = &self.rows[self.starts[column] as usize..self.starts[column + 1] as usize];
                for part in 0..2 {
                    for &row in rows.iter().filter(|row| **row as usize >= column) {
                        // on the diagonal the upper entry belongs to the other triangle
                        let first = if row as usize == column { part } else { 0 };
                        lower.1.extend((first..2).map(|other| 2 * row + other));
                    }
                    lower.0.push(lower.1.len() as u32);
                }
            }
            let double = |order: &[u32]| order.iter().flat_map(|row| [2 * row, 2 * row + 1]).collect::<Vec<u32>>();
            self.symbolic(lower, &double(&self.order), &double(&self.inverse))
        })
    }

    fn symbolic(&self, (starts, rows): (Vec<u32>, Vec<u32>), order: &[u32], inverse: &[u32]) -> Symbolic {
        let n = order.len();
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &rows);
        let ordering = SymmetricOrdering::Custom(PermRef::new_checked(order, inverse, n));
        // blocks of columns always: rows are exchanged inside of them only
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let cholesky = factorize_symbolic_cholesky(pattern, Side::Lower, ordering, params)
            .unwrap_or_else(|error| panic!("{n} rows, {} entries: {error:?}", rows.len()));
        Symbolic { starts, rows, cholesky }
    }

    /// Of the factor with row exchanges.
    pub fn unsymmetric(&self) -> &SymbolicLu<u32> {
        self.unsymmetric.get_or_init(|| {
            let pattern = SymbolicSparseColMatRef::new_checked(self.n, self.n, &self.starts, None, &self.rows);
            factorize_symbolic_lu(pattern, LuSymbolicParams::default())
                .unwrap_or_else(|error| panic!("{} rows, {} entries: {error:?}", self.n, self.rows.len()))
        })
    }
}

/// Where any of the matrices, or its mirror image, has an entry, and the diagonal: columns with rising rows.
fn union(n: usize, matrices: &[&Matrix]) -> (Vec<u32>, Vec<u32>) {
    let mut columns: Vec<Vec<u32>> = (0..n as u32).map(|i| vec![i]).collect();
    for matrix in matrices {
        for column in 0..n {
            for (row, _) in matrix.column(column) {
                columns[column].push(row as u32);
                columns[row].push(column as u32);
            }
        }
        for column in &mut columns {
            column.sort_unstable();
            column.dedup();
        }
    }
    let mut starts = vec![0];
    for column in &columns {
        starts.push(starts[starts.len() - 1] + column.len() as u32);
    }
    (starts, columns.concat())
}

/// The rows in the order of their elimination: nested dissection.
fn order(n: usize, starts: &[u32], rows: &[u32]) -> Vec<u32> {
    let signed = |values: &[u32]| values.iter().map(|v| *v as i32).collect::<Vec<i32>>();
    let (starts, rows) = (signed(starts), signed(rows));
    let pattern = CscPattern::new(n, &starts, &rows).expect("the union of the patterns is one");
    let order = metis_order(&pattern).unwrap_or_else(|error| panic!("{n} rows, {} entries: {error:?}", rows.len()));
    order.iter().map(|row| *row as u32).collect()
}
