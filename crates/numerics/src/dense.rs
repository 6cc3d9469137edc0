//! Dense linear algebra in memory that the caller owns.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::{LltParams, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::lu::partial_pivoting::factor::{PartialPivLuParams, lu_in_place, lu_in_place_scratch};
use faer::linalg::lu::partial_pivoting::solve::{
    solve_in_place, solve_in_place_scratch, solve_transpose_in_place, solve_transpose_in_place_scratch,
    solve_transpose_in_place_with_conj,
};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::perm::PermRef;
use faer::traits::ComplexField;
use faer::traits::math_utils::one;
use faer::{Accum, Conj, MatMut, MatRef, Par, Spec};
use num_complex::Complex64;

/// Size from which elimination in blocks is faster.
const BLOCKED_FROM: usize = 96;

/// Solves `A x = b` by elimination with row exchanges. Returns false if a pivot
/// is zero or not finite.
///
/// `matrix` is A, row-major, `n × n`; it is overwritten. `right` is b and becomes x.
///
/// Source: Golub and Van Loan, "Matrix Computations" (2013), Sec. 3.4; in blocks, Sec. 3.2.11.
///
/// # Example
/// ```
/// let (mut a, mut b) = (vec![0.0, 2.0, 4.0, 1.0], vec![2.0, 9.0]);
/// assert!(stickslip_numerics::dense::solve(&mut a, 2, &mut b));
/// assert_eq!(b, [2.0, 1.0]);
/// ```
pub fn solve(matrix: &mut [f64], n: usize, right: &mut [f64]) -> bool {
    solve_with_determinant_sign(matrix, n, right).is_some()
}

/// Solves `A x = b` like [`solve`]. Returns the sign ±1 of the determinant of
/// A, or `None` if [`solve`] returns false.
pub fn solve_with_determinant_sign(matrix: &mut [f64], n: usize, right: &mut [f64]) -> Option<f64> {
    if n >= BLOCKED_FROM {
        return solve_blocked(&mut matrix[..n * n], n, &mut right[..n]);
    }
    let exchanges = eliminate(matrix, n, right)?;
    for k in (0..n).rev() {
        let row = &matrix[k * n..(k + 1) * n];
        let sum: f64 = row[k + 1..].iter().zip(&right[k + 1..n]).map(|(a, x)| a * x).sum();
        right[k] = (right[k] - sum) / row[k];
    }
    let negative = (0..n).filter(|k| matrix[k * n + k] < 0.0).count() + exchanges;
    let sign = if negative.is_multiple_of(2) { 1.0 } else { -1.0 };
    right[..n].iter().all(|x| x.is_finite()).then_some(sign)
}

/// Eliminates all columns with exchanges of whole rows. Returns the number of exchanges.
fn eliminate(matrix: &mut [f64], n: usize, right: &mut [f64]) -> Option<usize> {
    let mut exchanges = 0;
    for k in 0..n {
        let mut pivot = k;
        for i in k + 1..n {
            if matrix[i * n + k].abs() > matrix[pivot * n + k].abs() {
                pivot = i;
            }
        }
        let largest = matrix[pivot * n + k];
        if largest == 0.0 || !largest.is_finite() {
            return None;
        }
        if pivot != k {
            exchanges += 1;
            let (top, bottom) = matrix.split_at_mut(pivot * n);
            top[k * n..(k + 1) * n].swap_with_slice(&mut bottom[..n]);
            right.swap(k, pivot);
        }
        let (top, bottom) = matrix.split_at_mut((k + 1) * n);
        let pivot_row = &top[k * n + k..];
        let inverse = 1.0 / largest;
        for (i, row) in bottom.chunks_exact_mut(n).take(n - 1 - k).enumerate() {
            let factor = row[k] * inverse;
            row[k] = factor;
            if factor != 0.0 {
                for (x, p) in row[k + 1..].iter_mut().zip(&pivot_row[1..]) {
                    *x -= factor * p;
                }
                right[k + 1 + i] -= factor * right[k];
            }
        }
    }
    Some(exchanges)
}

/// Solves like [`solve_with_determinant_sign`], in blocks that stay in the cache.
///
/// `faer` reads the row-major memory by columns and therefore factors the transpose. The
/// solution uses the transpose of these factors.
fn solve_blocked(matrix: &mut [f64], n: usize, right: &mut [f64]) -> Option<f64> {
    let params = Spec::<PartialPivLuParams, f64>::default();
    let mut memory = MemBuffer::new(StackReq::any_of(&[
        lu_in_place_scratch::<u32, f64>(n, n, Par::Seq, params),
        solve_transpose_in_place_scratch::<u32, f64>(n, 1, Par::Seq),
    ]));
    let stack = MemStack::new(&mut memory);
    let (mut order, mut inverse) = (vec![0u32; n], vec![0u32; n]);
    let mut factors = MatMut::from_column_major_slice_mut(matrix, n, n);
    let (info, exchanges) = lu_in_place(factors.as_mut(), &mut order, &mut inverse, Par::Seq, stack, params);
    let mut negative = info.transposition_count;
    for k in 0..n {
        let pivot = factors[(k, k)];
        if pivot == 0.0 || !pivot.is_finite() {
            return None;
        }
        negative += usize::from(pivot < 0.0);
    }
    let right_column = MatMut::from_column_major_slice_mut(right, n, 1);
    solve_transpose_in_place(factors.as_ref(), factors.as_ref(), exchanges, right_column, Par::Seq, stack);
    let sign = if negative.is_multiple_of(2) { 1.0 } else { -1.0 };
    right.iter().all(|x| x.is_finite()).then_some(sign)
}

/// The sizes of a product of matrices: `rows × inner` times `inner × columns`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProductShape {
    /// Rows of the left factor and of the product.
    pub rows: usize,
    /// Columns of the left factor and rows of the right one.
    pub inner: usize,
    /// Columns of the right factor and of the product.
    pub columns: usize,
}

/// Says whether a matrix is used as it is stored, or transposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transpose {
    /// The matrix in its stored order.
    No,
    /// Transposed.
    Yes,
}

/// Rows and columns of a tile of a product, whose sums are kept in registers.
const TILE: usize = 4;

/// Computes `C = A B` of column-major matrices: A is `rows × inner`, B `inner × columns`.
///
/// Every entry is summed in rising order of the inner index, without fused operations. The result
/// has the same bits on every processor; `gemm` of nalgebra does not promise this above some size.
///
/// # Example
/// ```
/// use stickslip_numerics::dense::{ProductShape, multiply};
/// let mut c = [0.0; 2];
/// let shape = ProductShape { rows: 2, inner: 2, columns: 1 };
/// multiply(&[1.0, 2.0, 3.0, 4.0], &[5.0, 6.0], &mut c, shape);
/// assert_eq!(c, [23.0, 34.0]);
/// ```
pub fn multiply(a: &[f64], b: &[f64], c: &mut [f64], shape: ProductShape) {
    let ProductShape { rows, inner, columns } = shape;
    if rows == 0 || columns == 0 {
        return;
    }
    let c = &mut c[..rows * columns];
    if inner == 0 {
        c.fill(0.0);
        return;
    }
    let whole = rows - rows % TILE;
    for (b, c) in b[..inner * columns].chunks(TILE * inner).zip(c.chunks_mut(TILE * rows)) {
        let wide = c.len() == TILE * rows;
        for row in (0..if wide { whole } else { 0 }).step_by(TILE) {
            let mut sums = [[0.0; TILE]; TILE];
            for (k, a) in a.chunks_exact(rows).enumerate().take(inner) {
                let a: [f64; TILE] = std::array::from_fn(|r| a[row + r]);
                for (j, sum) in sums.iter_mut().enumerate() {
                    let factor = b[j * inner + k];
                    sum.iter_mut().zip(a).for_each(|(sum, a)| *sum += a * factor);
                }
            }
            sums.iter().enumerate().for_each(|(j, sum)| c[j * rows + row..j * rows + row + TILE].copy_from_slice(sum));
        }
        let from = if wide { whole } else { 0 };
        for (b, c) in b.chunks_exact(inner).zip(c.chunks_exact_mut(rows)) {
            let rest = &mut c[from..];
            rest.fill(0.0);
            for (a, factor) in a.chunks_exact(rows).zip(b) {
                rest.iter_mut().zip(&a[from..]).for_each(|(sum, a)| *sum += a * factor);
            }
        }
    }
}

/// Computes `C = A B`, or `A Bᵀ` with [`Transpose::Yes`], of large real or complex column-major
/// matrices, in blocks that stay in the cache.
///
/// A is `rows × inner`. B is `inner × columns`, or `columns × inner` if it is transposed. The
/// result has the same bits on every run, but may differ between processors.
///
/// # Example
/// ```
/// use stickslip_numerics::dense::{ProductShape, Transpose, multiply_blocked};
/// let (a, b) = ([1.0, 2.0, 3.0, 4.0], [5.0, 6.0]);
/// let mut c = [0.0; 2];
/// let shape = ProductShape { rows: 2, inner: 2, columns: 1 };
/// multiply_blocked(&a, &b, &mut c, shape, Transpose::No);
/// assert_eq!(c, [23.0, 34.0]);
/// multiply_blocked(&a, &b, &mut c, shape, Transpose::Yes);
/// assert_eq!(c, [23.0, 34.0]);
/// ```
pub fn multiply_blocked<T: Scalar>(a: &[T], b: &[T], c: &mut [T], shape: ProductShape, transpose: Transpose) {
    let ProductShape { rows, inner, columns } = shape;
    let a = MatRef::from_column_major_slice(&a[..rows * inner], rows, inner);
    let b = &b[..inner * columns];
    let b = match transpose {
        Transpose::Yes => MatRef::from_column_major_slice(b, columns, inner).transpose(),
        Transpose::No => MatRef::from_column_major_slice(b, inner, columns),
    };
    let c = MatMut::from_column_major_slice_mut(&mut c[..rows * columns], rows, columns);
    matmul(c, Accum::Replace, a, b, one(), Par::Seq);
}

/// Computes `A = L Lᵀ` of a symmetric column-major matrix `n × n`, in blocks
/// that stay in the cache.
///
/// Reads the lower triangle and replaces it by L. Returns false if the matrix
/// is not positive definite or not finite.
///
/// # Example
/// ```
/// let mut matrix = [4.0, 2.0, 2.0, 17.0];
/// assert!(stickslip_numerics::dense::cholesky_blocked(&mut matrix, 2));
/// assert_eq!((matrix[0], matrix[1], matrix[3]), (2.0, 1.0, 4.0));
/// assert!(!stickslip_numerics::dense::cholesky_blocked(&mut [1.0, 2.0, 2.0, 3.0], 2));
/// ```
pub fn cholesky_blocked(matrix: &mut [f64], n: usize) -> bool {
    let params = Spec::<LltParams, f64>::default();
    let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(n, Par::Seq, params));
    let lower = MatMut::from_column_major_slice_mut(&mut matrix[..n * n], n, n);
    cholesky_in_place(lower, Default::default(), Par::Seq, MemStack::new(&mut memory), params).is_ok()
        && (0..n).all(|k| matrix[k * n + k].is_finite())
}

/// Solves `L X = B`, or `Lᵀ X = B` with [`Transpose::Yes`], in place and in blocks that stay in
/// the cache.
///
/// L is the lower triangle of a column-major matrix `n × n`. `right` holds the
/// columns of B, each of length n, and becomes X.
///
/// # Example
/// ```
/// use stickslip_numerics::dense::{Transpose, solve_lower_blocked};
/// let (lower, mut right) = ([2.0, 1.0, 0.0, 4.0], [2.0, 9.0]);
/// solve_lower_blocked(&lower, 2, &mut right, Transpose::No);
/// assert_eq!(right, [1.0, 2.0]);
/// solve_lower_blocked(&lower, 2, &mut right, Transpose::Yes);
/// assert_eq!(right, [0.25, 0.5]);
/// ```
pub fn solve_lower_blocked(lower: &[f64], n: usize, right: &mut [f64], transpose: Transpose) {
    let columns = right.len() / n.max(1);
    let lower = MatRef::from_column_major_slice(&lower[..n * n], n, n);
    let right = MatMut::from_column_major_slice_mut(&mut right[..n * columns], n, columns);
    match transpose {
        Transpose::No => solve_lower_triangular_in_place(lower, right, Par::Seq),
        Transpose::Yes => solve_upper_triangular_in_place(lower.transpose(), right, Par::Seq),
    }
}

/// The numbers of a matrix: real or complex.
pub trait Scalar: ComplexField + Copy {
    /// Returns true if the number is finite and not zero.
    fn is_pivot(self) -> bool;
}

impl Scalar for f64 {
    fn is_pivot(self) -> bool {
        self != 0.0 && self.is_finite()
    }
}

impl Scalar for Complex64 {
    fn is_pivot(self) -> bool {
        self != Complex64::ZERO && self.is_finite()
    }
}

/// The factorization `P A = L U` of a real or complex matrix in blocks that
/// stay in the cache, for many right sides.
///
/// # Example
/// ```
/// use num_complex::Complex64;
/// use stickslip_numerics::dense::ComplexLu;
/// let j = Complex64::I;
/// // columns (0, j) and (2, 0)
/// let factor = ComplexLu::new(vec![0.0 * j, j, 2.0 + 0.0 * j, 0.0 * j], 2).unwrap();
/// let mut x = [Complex64::ONE, Complex64::ONE];
/// factor.solve(&mut x);
/// assert_eq!(x, [-j, 0.5 + 0.0 * j]);
/// ```
#[derive(Debug, Clone)]
pub struct DenseLu<T> {
    n: usize,
    factors: Vec<T>,
    order: Vec<u32>,
    inverse: Vec<u32>,
}

/// The factorization of a complex matrix.
pub type ComplexLu = DenseLu<Complex64>;

impl<T: Scalar> DenseLu<T> {
    /// Returns the memory of the factors, bytes.
    pub fn bytes(&self) -> usize {
        size_of::<T>() * self.factors.len()
    }

    /// Factors a column-major matrix, n × n.
    ///
    /// # Errors
    /// The first column without a usable pivot.
    pub fn new(mut matrix: Vec<T>, n: usize) -> Result<Self, usize> {
        let params = Spec::<PartialPivLuParams, T>::default();
        let mut memory = MemBuffer::new(lu_in_place_scratch::<u32, T>(n, n, Par::Seq, params));
        let (mut order, mut inverse) = (vec![0; n], vec![0; n]);
        let mut factors = MatMut::from_column_major_slice_mut(&mut matrix, n, n);
        lu_in_place(factors.as_mut(), &mut order, &mut inverse, Par::Seq, MemStack::new(&mut memory), params);
        let weak = (0..n).find(|&k| !factors[(k, k)].is_pivot());
        weak.map_or(Ok(DenseLu { n, factors: matrix, order, inverse }), Err)
    }

    /// Solves in place for right sides of length n, stored consecutively.
    ///
    /// # Panics
    /// If the length of `right` is not a multiple of n.
    pub fn solve(&self, right: &mut [T]) {
        self.apply(right, solve_in_place_scratch::<u32, T>, |factors, exchanges, right, stack| {
            solve_in_place(factors, factors, exchanges, right, Par::Seq, stack);
        });
    }

    /// Solves with the conjugate transpose of the matrix, like [`DenseLu::solve`].
    ///
    /// # Panics
    /// If the length of `right` is not a multiple of n.
    pub fn solve_adjoint(&self, right: &mut [T]) {
        self.apply(right, solve_transpose_in_place_scratch::<u32, T>, |factors, exchanges, right, stack| {
            solve_transpose_in_place_with_conj(factors, factors, exchanges, Conj::Yes, right, Par::Seq, stack);
        });
    }

    fn apply(
        &self,
        right: &mut [T],
        scratch: fn(usize, usize, Par) -> StackReq,
        solve: impl FnOnce(MatRef<'_, T>, PermRef<'_, u32>, MatMut<'_, T>, &mut MemStack),
    ) {
        let n = self.n;
        if n == 0 || right.is_empty() {
            return;
        }
        assert!(right.len().is_multiple_of(n), "{} numbers do not form columns of length {n}", right.len());
        let columns = right.len() / n;
        let mut memory = MemBuffer::new(scratch(n, columns, Par::Seq));
        let factors = MatRef::from_column_major_slice(&self.factors, n, n);
        let exchanges = PermRef::new_checked(&self.order, &self.inverse, n);
        let right = MatMut::from_column_major_slice_mut(right, n, columns);
        solve(factors, exchanges, right, MemStack::new(&mut memory));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The product in tiles has the bits of the plain sums, at sizes around the tile size.
    #[test]
    fn products_have_the_bits_of_plain_sums() {
        let entry = |at: usize| ((at * 7919 + 13) as f64).sin();
        for (rows, inner, columns) in [(1, 1, 1), (4, 3, 4), (5, 7, 9), (8, 0, 2), (0, 3, 2), (13, 6, 3), (16, 40, 21)]
        {
            let a: Vec<f64> = (0..rows * inner).map(entry).collect();
            let b: Vec<f64> = (0..inner * columns).map(|at| entry(at + 1000)).collect();
            let mut c = vec![f64::NAN; rows * columns];
            multiply(&a, &b, &mut c, ProductShape { rows, inner, columns });
            for (at, c) in c.iter().enumerate() {
                let (i, j) = (at % rows, at / rows);
                let sum = (0..inner).fold(0.0, |sum, k| sum + a[k * rows + i] * b[j * inner + k]);
                assert_eq!(c.to_bits(), sum.to_bits(), "{rows} {inner} {columns}: {i}, {j}");
            }
        }
    }

    /// With and without blocks, the solution is the vector that the matrix was multiplied with.
    #[test]
    fn large_systems_are_solved_in_blocks() {
        for n in [1, 7, BLOCKED_FROM - 1, BLOCKED_FROM, 2 * BLOCKED_FROM + 5] {
            // Entries without a pattern between -1 and 1. The zero diagonal forces row exchanges.
            let entry =
                |i: usize, k: usize| if i == k && n > 1 { 0.0 } else { ((i * 7919 + k * 104_729 + 1) as f64).sin() };
            let mut matrix: Vec<f64> = (0..n * n).map(|at| entry(at / n, at % n)).collect();
            let x: Vec<f64> = (0..n).map(|i| 1.0 + i as f64).collect();
            let mut right: Vec<f64> = (0..n).map(|i| (0..n).map(|k| entry(i, k) * x[k]).sum()).collect();
            assert!(solve(&mut matrix, n, &mut right));
            for (a, b) in right.iter().zip(&x) {
                assert!((a - b).abs() < 1e-8 * n as f64, "{n}: {a} instead of {b}");
            }
        }
        // A cyclic permutation of n rows has the sign (-1)^(n - 1). Every second entry is negative.
        for n in [1, 2, 3, 4, 2 * BLOCKED_FROM + 5, 2 * BLOCKED_FROM + 6, 2 * BLOCKED_FROM + 7] {
            let mut matrix = vec![0.0; n * n];
            for i in 0..n {
                matrix[i * n + (i + 1) % n] = if i % 2 == 1 { -2.0 } else { 3.0 };
            }
            let sign = if (n - 1 + n / 2).is_multiple_of(2) { 1.0 } else { -1.0 };
            assert_eq!(solve_with_determinant_sign(&mut matrix, n, &mut vec![1.0; n]), Some(sign), "{n}");
        }
        let mut singular = vec![1.0; 4];
        assert!(!solve(&mut singular, 2, &mut [1.0, 2.0]));
    }

    /// The product of the matrix and the solution is the right side, in every column.
    #[test]
    fn complex_systems_with_many_right_sides() {
        for n in [1, 5, 130] {
            let entry =
                |i: usize, k: usize| Complex64::new(((i * 7919 + k * 31) as f64).sin(), ((i + 5 * k) as f64).cos());
            let matrix: Vec<Complex64> = (0..n * n).map(|at| entry(at % n, at / n)).collect();
            let right: Vec<Complex64> = (0..3 * n).map(|i| entry(i, 7)).collect();
            let mut x = right.clone();
            ComplexLu::new(matrix.clone(), n).unwrap().solve(&mut x);
            for (x, right) in x.chunks(n).zip(right.chunks(n)) {
                for i in 0..n {
                    let product: Complex64 = (0..n).map(|k| matrix[k * n + i] * x[k]).sum();
                    assert!((product - right[i]).norm() < 1e-9, "{n}: {product} {}", right[i]);
                }
            }
        }
        assert_eq!(ComplexLu::new(vec![Complex64::ONE; 4], 2).unwrap_err(), 1);
    }
}
