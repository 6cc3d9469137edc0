//! What is known of a factor before any number, and the factors made with it.

use super::factor::{ComplexFactor, Factor, Singular};
use super::matrix::Matrix;
use super::pattern::Pattern;
use num_complex::Complex64;
use std::sync::Arc;

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

impl Analysis {
    /// Of matrices of one size. The pattern need not be symmetric; its mirror image is added.
    ///
    /// # Panics
    /// If the matrices have different sizes, or factors that 32 bits do not count.
    pub fn new(matrices: &[&Matrix]) -> Self {
        Analysis { pattern: Arc::new(Pattern::new(matrices)) }
    }

    /// Of other matrices of the same size in the order of this one. Any order will do; where their entries stand among those that were analysed, it is
    /// as good for them as for those, and seeking one of their own takes longer than a factor of few entries.
    ///
    /// # Panics
    /// If the matrices have another size, or factors that 32 bits do not count.
    #[must_use]
    pub fn in_order(&self, matrices: &[&Matrix]) -> Self {
        Analysis { pattern: Arc::new(self.pattern.in_order(matrices)) }
    }

    /// Rows, and columns.
    pub fn n(&self) -> usize {
        self.pattern.n
    }

    /// Entries of a real factor: eight bytes each.
    pub fn fill(&self) -> usize {
        if self.pattern.n == 0 { 0 } else { self.pattern.real().cholesky.len_val() }
    }

    /// Memory of the factor of a symmetric complex sum, bytes: real and imaginary parts stand in blocks of two rows and columns.
    pub fn complex_bytes(&self) -> usize {
        if self.pattern.n == 0 {
            return 0;
        }
        size_of::<f64>() * (self.pattern.complex().cholesky.len_val() + 2 * self.pattern.n)
    }

    /// Factors the sum of symmetric matrices with real factors, `L D Lᵀ`; of every matrix the lower triangle counts.
    ///
    /// # Errors
    /// [`Singular`] if the sum is singular to rounding.
    ///
    /// # Panics
    /// If an entry stands where none of the analysed matrices has one.
    pub fn factor(&self, sum: &[(f64, &Matrix)]) -> Result<Factor, Singular> {
        Factor::new(&self.pattern, sum, vec![])
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
