//! Symbolic analysis of sparse matrices, and the factors made from it.

use super::factor::{ComplexFactor, LdlFactor, Singular};
use super::matrix::SparseMatrix;
use super::symbolic::Pattern;
use num_complex::Complex64;
use std::sync::Arc;

/// The common pattern of several matrices, ordered for elimination.
///
/// It serves to factor any sum of these matrices, any number of times: `K - ω² M` for every
/// shift, `K - ω² M + jω C` for every frequency.
///
/// # Example
/// ```
/// use stickslip_numerics::sparse::{SparseMatrix, SymbolicAnalysis};
/// // three equal masses between walls, on four equal springs: ω² = 2 - √2, 2, 2 + √2
/// let k =
///     (0..3).flat_map(|i: usize| (0..3).map(move |l| (i, l, [2.0, -1.0, 0.0][i.abs_diff(l)])));
/// let k = SparseMatrix::from_triplets(3, k).unwrap();
/// let m = SparseMatrix::from_triplets(3, (0..3).map(|i| (i, i, 1.0))).unwrap();
/// let analysis = SymbolicAnalysis::new(&[&k, &m]);
/// // the number of negative pivots is the number of eigenvalues below the shift
/// assert_eq!(analysis.factor(&[(1.0, &k), (-1.9, &m)]).unwrap().negative_pivots(), 1);
/// assert_eq!(analysis.factor(&[(1.0, &k), (-2.1, &m)]).unwrap().negative_pivots(), 2);
/// let mut x = [1.0, 0.0, 0.0];
/// analysis.factor(&[(1.0, &k)]).unwrap().solve(&mut x);
/// assert!((x[0] - 0.75).abs() < 1e-15, "{x:?}");
/// ```
#[derive(Debug, Clone)]
pub struct SymbolicAnalysis {
    pub(super) pattern: Arc<Pattern>,
}

impl SymbolicAnalysis {
    /// Analyses matrices of one size. A pattern need not be symmetric: the
    /// mirrored entries are added.
    ///
    /// # Panics
    /// If the matrices differ in size, or if the entries of the factor exceed the 32-bit indices.
    pub fn new(matrices: &[&SparseMatrix]) -> Self {
        SymbolicAnalysis { pattern: Arc::new(Pattern::new(matrices)) }
    }

    /// Analyses other matrices of the same size, with the elimination order of this analysis.
    ///
    /// Any order is valid. It is as good as for the analysed matrices if the entries lie within
    /// their pattern. A new order takes longer than a factor of few entries.
    ///
    /// # Panics
    /// If the matrices have another size, or if the entries of the factor
    /// exceed the 32-bit indices.
    #[must_use]
    pub fn with_same_order(&self, matrices: &[&SparseMatrix]) -> Self {
        SymbolicAnalysis { pattern: Arc::new(self.pattern.with_order(matrices)) }
    }

    /// Returns the number of rows and columns.
    pub fn n(&self) -> usize {
        self.pattern.n
    }

    /// Returns the number of entries of a real factor, eight bytes each.
    pub fn factor_entries(&self) -> usize {
        if self.pattern.n == 0 { 0 } else { self.pattern.real().cholesky.len_val() }
    }

    /// Returns the memory of the factor of a symmetric complex sum, bytes. Real and imaginary
    /// parts form blocks of two rows and two columns.
    pub fn complex_bytes(&self) -> usize {
        if self.pattern.n == 0 {
            return 0;
        }
        size_of::<f64>() * (self.pattern.complex().cholesky.len_val() + 2 * self.pattern.n)
    }

    /// Factors a sum of symmetric matrices as `L D Lᵀ` in real numbers. Only
    /// the lower triangle of each matrix is read.
    ///
    /// # Errors
    /// [`Singular`] if the sum is singular to rounding.
    ///
    /// # Panics
    /// If an entry lies outside the analysed pattern.
    pub fn factor(&self, sum: &[(f64, &SparseMatrix)]) -> Result<LdlFactor, Singular> {
        LdlFactor::new(&self.pattern, sum, vec![])
    }

    /// Factors a sum of matrices in complex numbers.
    ///
    /// A symmetric sum is factored as `L D Lᵀ`. A sum that is not symmetric, or whose factor is not
    /// accurate, gets an LU factorization with row exchanges. This takes a few times as long.
    ///
    /// # Errors
    /// [`Singular`] if the sum is singular to rounding.
    ///
    /// # Panics
    /// If an entry lies outside the analysed pattern.
    pub fn factor_complex(&self, sum: &[(Complex64, &SparseMatrix)]) -> Result<ComplexFactor, Singular> {
        ComplexFactor::new(&self.pattern, self.pattern.sum(sum))
    }
}
