//! Products of a complex matrix with one vector, in real arithmetic.
//!
//! Each column of the matrix is stored as pairs of real and imaginary parts. Then `A Re(v)` and
//! `A Im(v)` are one real matrix times two vectors, and `A v = A Re(v) + j A Im(v)`. This takes
//! half the time of a product in complex numbers.

use crate::dense::{ProductShape, Transpose, multiply_blocked};
use num_complex::Complex64;

/// A square complex matrix, stored for products with one vector.
#[derive(Debug, Clone, PartialEq)]
pub struct ComplexGemv {
    n: usize,
    /// Column-major, `2 n × n`: pairs of real and imaginary parts.
    interleaved: Vec<f64>,
}

impl ComplexGemv {
    /// Stores a column-major matrix, `n × n`.
    ///
    /// # Panics
    /// If `matrix` does not have n² entries.
    pub fn new(matrix: &[Complex64], n: usize) -> Self {
        assert_eq!(matrix.len(), n * n, "the matrix must be square");
        ComplexGemv { n, interleaved: matrix.iter().flat_map(|a| [a.re, a.im]).collect() }
    }

    /// Returns the memory of the entries, bytes.
    pub fn bytes(&self) -> usize {
        size_of::<f64>() * self.interleaved.len()
    }

    /// Replaces `v` by `A v`. `scratch` is working memory.
    ///
    /// # Example
    /// ```
    /// use num_complex::Complex64;
    /// use stickslip_numerics::complex_gemv::ComplexGemv;
    /// let (one, j) = (Complex64::ONE, Complex64::I);
    /// let mut v = [one, j];
    /// ComplexGemv::new(&[one, j, j, 2.0 * one], 2).apply(&mut v, &mut Vec::new());
    /// assert_eq!(v, [0.0 * one, 3.0 * j]);
    /// ```
    ///
    /// # Panics
    /// If the length of `v` is not n.
    pub fn apply(&self, v: &mut [Complex64], scratch: &mut Vec<f64>) {
        let n = self.n;
        assert_eq!(v.len(), n, "the vector must be as long as the matrix");
        scratch.resize(6 * n, 0.0);
        let (parts, products) = scratch.split_at_mut(2 * n);
        let (re, im) = parts.split_at_mut(n);
        re.iter_mut().zip(im).zip(&*v).for_each(|((re, im), v)| (*re, *im) = (v.re, v.im));
        multiply_blocked(
            &self.interleaved,
            parts,
            products,
            ProductShape { rows: 2 * n, inner: n, columns: 2 },
            Transpose::No,
        );
        let (by_re, by_im) = products.split_at(2 * n);
        for (v, (by_re, by_im)) in v.iter_mut().zip(by_re.chunks_exact(2).zip(by_im.chunks_exact(2))) {
            *v = Complex64::new(by_re[0] - by_im[1], by_re[1] + by_im[0]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_complex_numbers() {
        for n in [1, 3, 12, 48, 61] {
            let entry = |i: usize| Complex64::new(((i * 7919 + 13) as f64).sin(), ((i * 31 + 5) as f64).cos());
            let matrix: Vec<Complex64> = (0..n * n).map(entry).collect();
            let v: Vec<Complex64> = (0..n).map(|i| entry(i + 1000)).collect();
            let mut product = v.clone();
            ComplexGemv::new(&matrix, n).apply(&mut product, &mut Vec::new());
            for (i, product) in product.iter().enumerate() {
                let sum: Complex64 = (0..n).map(|k| matrix[k * n + i] * v[k]).sum();
                assert!((product - sum).norm() < 1e-13 * n as f64, "{n}: {product} {sum}");
            }
        }
    }
}
