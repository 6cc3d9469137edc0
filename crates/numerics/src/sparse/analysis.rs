//! What is known of a factor before any number: the order of elimination, and where entries appear.

use super::factor::{ComplexFactor, Factor, Singular};
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
use num_complex::Complex64;
use std::ops::{AddAssign, Mul};
use std::sync::{Arc, OnceLock};

/// The common pattern of some matrices, ordered for elimination.
///
/// Any sum of these matrices is factored by it, as often as one likes: `K - ω² M` for every shift, `K - ω² M + jω C` for every frequency.
///
/// # Example
/// ```
/// use stickslip_numerics::sparse::{Analysis, Matrix};
/// // three equal masses between walls, on four equal springs: ω² = 2 - √2, 2, 2 + √2
/// let k = (0..3).flat_map(|i: usize| (0..3).map(move |l| (i, l, [2.0, -1.0, 0.0][i.abs_diff(l)])));
/// let k = Matrix::from_triplets(3, k).unwrap();
/// let m = Matrix::from_triplets(3, (0..3).map(|i| (i, i, 1.0))).unwrap();
/// let analysis = Analysis::new(&[&k, &m]);
/// // as many pivots are negative as there are eigenvalues below the shift
/// assert_eq!(analysis.factor(&[(1.0, &k), (-1.9, &m)]).unwrap().negative(), 1);
/// assert_eq!(analysis.factor(&[(1.0, &k), (-2.1, &m)]).unwrap().negative(), 2);
/// let mut x = [1.0, 0.0, 0.0];
/// analysis.factor(&[(1.0, &k)]).unwrap().solve(&mut x);
/// assert!((x[0] - 0.75).abs() < 1e-15, "{x:?}");
/// ```
#[derive(Debug, Clone)]
pub struct Analysis {
    pub(super) pattern: Arc<Pattern>,
}

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

impl Analysis {
    /// Of matrices of one size. The pattern need not be symmetric; its mirror image is added.
    ///
    /// # Panics
    /// If the matrices have different sizes, or factors that 32 bits do not count.
    pub fn new(matrices: &[&Matrix]) -> Self {
        let n = matrices.first().map_or(0, |matrix| matrix.n());
        assert!(matrices.iter().all(|matrix| matrix.n() == n), "the matrices of a sum have one size");
        let (starts, rows) = union(n, matrices);
        let order = order(n, &starts, &rows);
        let mut inverse = vec![0; n];
        order.iter().enumerate().for_each(|(at, &row)| inverse[row as usize] = at as u32);
        let (real, complex, unsymmetric) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
        Analysis { pattern: Arc::new(Pattern { n, starts, rows, order, inverse, real, complex, unsymmetric }) }
    }

    /// Rows, and columns.
    pub fn n(&self) -> usize {
        self.pattern.n
    }

    /// Entries of a real factor: eight bytes each.
    pub fn fill(&self) -> usize {
        if self.pattern.n == 0 { 0 } else { self.pattern.real().cholesky.len_val() }
    }

    /// Factors the sum of symmetric matrices with real factors, `L D Lᵀ`; of every matrix the lower triangle counts.
    ///
    /// # Errors
    /// [`Singular`] if the sum is singular to rounding.
    ///
    /// # Panics
    /// If an entry stands where none of the analysed matrices has one.
    pub fn factor(&self, sum: &[(f64, &Matrix)]) -> Result<Factor, Singular> {
        Factor::new(&self.pattern, self.pattern.sum(sum))
    }

    /// Factors the sum of matrices with complex factors. Symmetric sums take `L D Lᵀ`, others, and those that it does not factor accurately, an
    /// elimination with row exchanges, which takes a few times as long.
    ///
    /// # Errors
    /// [`Singular`] if the sum is singular to rounding.
    ///
    /// # Panics
    /// If an entry stands where none of the analysed matrices has one.
    pub fn factor_complex(&self, sum: &[(Complex64, &Matrix)]) -> Result<ComplexFactor, Singular> {
        ComplexFactor::new(&self.pattern, self.pattern.sum(sum))
    }
}

impl Pattern {
    /// The entries of a sum, in the places of the pattern.
    fn sum<T: Copy + Default + AddAssign + Mul<f64, Output = T>>(&self, sum: &[(T, &Matrix)]) -> Vec<T> {
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
