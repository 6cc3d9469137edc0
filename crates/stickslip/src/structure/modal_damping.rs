//! Modal damping `U Uᵀ` with one column `√(2 ζ ω) M φ` per mode.
//!
//! It couples all rows. Therefore sparse structures store these columns instead of a matrix.
//! The inverse of the dynamic stiffness follows from one solution per column:
//! `(Z + s U Uᵀ)⁻¹ = Z⁻¹ - s Z⁻¹ U (1 + s Uᵀ Z⁻¹ U)⁻¹ Uᵀ Z⁻¹`.
//!
//! Sources: Woodbury (1950), "Inverting modified matrices", Memorandum Rept. 42, Statistical
//! Research Group, Princeton. Damping: Wilson and Penzien (1972), "Evaluation of orthogonal
//! damping matrices", Int. J. Numer. Meth. Engng 4, 5-10.

use nalgebra::{DMatrix, DMatrixView};
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::dense::ComplexLu;
use stickslip_numerics::sparse::{ComplexFactor, Singular};
use stickslip_numerics::vector::dot;

/// Columns of U, one after the other, each as long as the structure.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalDamping {
    n: usize,
    columns: Arc<Vec<f64>>,
}

impl ModalDamping {
    /// Creates modal damping from columns of length n.
    ///
    /// # Panics
    /// If the length of `columns` is not a multiple of n.
    pub fn new(n: usize, columns: Arc<Vec<f64>>) -> Self {
        assert!(columns.len().is_multiple_of(n.max(1)), "{} numbers are no columns of {n}", columns.len());
        ModalDamping { n, columns }
    }

    /// Returns the length of the columns, n.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Returns whether there are no columns.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Iterates over the columns.
    pub fn iter(&self) -> impl Iterator<Item = &[f64]> {
        self.columns.chunks_exact(self.n.max(1))
    }

    /// Returns an entry of `U Uᵀ`, kg/s.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.iter().map(|u| u[row] * u[column]).sum()
    }

    /// Computes `C += U Uᵀ`.
    pub(super) fn add_to(&self, damping: &mut DMatrix<f64>) {
        let columns = DMatrixView::from_slice(&self.columns, self.n, self.columns.len() / self.n.max(1));
        damping.gemm(1.0, &columns, &columns.transpose(), 1.0);
    }

    /// Returns `vᵀ U Uᵀ v`: the power dissipated at velocities `v`, W.
    pub fn power(&self, v: &[f64]) -> f64 {
        self.iter().map(|u| dot(u, v).powi(2)).sum()
    }
}

/// A factored dynamic stiffness with the damping of modes.
#[derive(Debug, Clone)]
pub(super) struct ModallyDampedFactor {
    without: ComplexFactor,
    modes: ModalDamping,
    /// `s Z⁻¹ U`.
    answers: Vec<Complex64>,
    /// `1 + s Uᵀ Z⁻¹ U`.
    small: ComplexLu,
}

impl ModallyDampedFactor {
    /// Creates it from the factor at complex frequency s.
    pub fn new(without: ComplexFactor, modes: &ModalDamping, s: Complex64) -> Result<Self, Singular> {
        let mut answers: Vec<Complex64> = modes.columns.iter().map(|u| s * u).collect();
        without.solve(&mut answers);
        let count = modes.iter().count();
        let mut small = along(modes, &answers);
        (0..count).for_each(|k| small[k * count + k] += 1.0);
        // the small system mixes all rows, so that the error names row 0
        let small = ComplexLu::new(small, count).map_err(|_| Singular { row: 0 })?;
        Ok(ModallyDampedFactor { without, modes: modes.clone(), answers, small })
    }

    pub fn bytes(&self) -> usize {
        self.without.bytes() + self.small.bytes() + size_of_val(&self.answers[..])
    }

    pub fn solve(&self, loads: &mut [Complex64]) {
        self.without.solve(loads);
        let mut shares = along(&self.modes, loads);
        self.small.solve(&mut shares);
        let n = self.modes.n;
        for (x, shares) in loads.chunks_exact_mut(n).zip(shares.chunks_exact(self.answers.len() / n)) {
            for (answer, share) in self.answers.chunks_exact(n).zip(shares) {
                x.iter_mut().zip(answer).for_each(|(x, a)| *x -= a * share);
            }
        }
    }
}

/// Returns `Uᵀ X`, column by column.
fn along(modes: &ModalDamping, x: &[Complex64]) -> Vec<Complex64> {
    let each = |x: &[Complex64], u: &[f64]| -> Complex64 { x.iter().zip(u).map(|(x, u)| x * u).sum() };
    x.chunks_exact(modes.n).flat_map(|x| modes.iter().map(move |u| each(x, u))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::structure::{MIN_SPARSE_DOFS, Structure};
    use nalgebra::DVector;

    /// Sparse and full structures give the same modal damping, that of the dense product.
    #[test]
    fn sparse_and_full_modal_damping_agree() {
        let n = MIN_SPARSE_DOFS + 5;
        let tridiagonal = |own: f64, next: f64| DMatrix::from_fn(n, n, |i, k| [own, next, 0.0][i.abs_diff(k).min(2)]);
        let (m, c, k) = (tridiagonal(1.0, 0.2), tridiagonal(0.01, 0.0), tridiagonal(2.0, -1.0));
        let u = DMatrix::from_fn(n, 3, |i, mode| 0.3 * (0.7 * (i * (mode + 1)) as f64).sin());
        let modes = ModalDamping::new(n, Arc::new(u.as_slice().to_vec()));
        let all = &c + &u * u.transpose();
        let places: Vec<String> = (0..n).map(|i| i.to_string()).collect();
        let sparse = Structure::new(places.clone(), m.clone(), c, k.clone()).unwrap().with_damped_modes(&modes);
        let full = Structure::new(places, m.clone(), all.clone(), k.clone()).unwrap();
        assert!(sparse.is_sparse() && !full.is_sparse() && sparse.is_dissipative());
        assert!((sparse.damping() - &all).amax() < 1e-15);
        assert!((sparse.largest()[1] - all.amax()).abs() < 1e-15);
        assert_ne!(
            sparse,
            Structure::new(sparse.places().to_vec(), m.clone(), tridiagonal(0.01, 0.0), k.clone()).unwrap()
        );
        // full matrices absorb the modal damping
        let twice = full.with_damped_modes(&modes);
        assert!(twice.damped_modes().is_none() && (twice.damping() - (&all + &u * u.transpose())).amax() < 1e-15);
        let v: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let lost = (u.transpose() * DVector::from_vec(v.clone())).norm_squared();
        assert!((modes.power(&v) / lost - 1.0).abs() < 1e-14);
        for s in [Complex64::ZERO, Complex64::new(0.0, 0.7), Complex64::new(0.4, 0.1)] {
            let [mut a, mut b] = [(); 2].map(|()| vec![Complex64::new(1.0, -0.5); 2 * n]);
            sparse.dynamic_stiffness(s).unwrap().solve(&mut a);
            full.dynamic_stiffness(s).unwrap().solve(&mut b);
            let size = b.iter().fold(0.0f64, |size, b| size.max(b.norm()));
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).norm() < 1e-11 * size), "{s}");
        }
    }
}
