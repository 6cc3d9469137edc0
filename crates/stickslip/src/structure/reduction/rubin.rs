//! Rubin's reduction: free modes with residual vectors at the ports, of higher order on
//! request.
//!
//! One set of modes and residual vectors yields reductions of any smaller size: an omitted mode
//! returns to the residual vectors, `Xⱼ + φ φᵀF / (λ - σ)ʲ⁺¹`. The coordinates are Ritz
//! vectors, the natural modes of the structure in the space of modes and residual vectors. Mass
//! and stiffness are diagonal: first the modes of the structure itself, then those that
//! represent all others.
//!
//! MacNeal's method is Rubin's without the mass of the residual vectors; this implementation
//! retains it. With order J, the receptance agrees with that of the whole structure at σ in the
//! first 2 J terms of its series, in addition to the modes.
//!
//! Sources: as in `residual_flexibility`; Craig and Chang (1977), "On the use of attachment modes
//! in substructure coupling for dynamic analysis".

use super::{
    COLUMN_BLOCK, FullStructure, ReducedMatrices, ReductionError, StructureDamping, damping, natural, product,
    residual_flexibility, symmetric,
};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;
use stickslip_numerics::dense::{Transpose, cholesky_blocked, solve_lower_blocked};
use stickslip_numerics::eigen;
use stickslip_numerics::sparse::{NaturalModes, SparseMatrix, multi_vector};

/// Relative stiffness below which residual vectors of unit size are linearly dependent. This
/// occurs for ports that observe the same motion, up to rounding. A port whose residual
/// flexibility is below this fraction of its total flexibility has only rounding there.
pub(super) const DEPENDENCE_TOLERANCE: f64 = 1e-11;

/// Modes and residual vectors, the source of reductions.
#[derive(Debug, Clone)]
pub struct RubinBasis<'a> {
    whole: &'a FullStructure,
    /// λ of the modes, rad²/s².
    pub(super) values: Vec<f64>,
    /// Expansion point of the residual vectors, rad²/s².
    pub(super) shift: f64,
    /// Numbers of ports and of orders of the residual vectors.
    pub(super) counts: (usize, usize),
    /// Modes, then the residual vectors order by order: n × (k + p J).
    basis: Arc<Vec<f64>>,
    /// `Bᵀ M B`, `Bᵀ K B`, `Bᵀ C B` for a damping matrix, and the rows of the ports over B.
    pub(super) mass: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    damping: Option<DMatrix<f64>>,
    pub(super) ports: DMatrix<f64>,
}

impl<'a> RubinBasis<'a> {
    /// Computes residual vectors of orders below `order`, around `shift` (rad²/s²), for all
    /// lowest modes without gaps. The shift is zero, or any value that is not an eigenvalue.
    ///
    /// # Errors
    /// [`ReductionError::Singular`] if `modes` lacks a free motion, or if the shift remains at
    /// an eigenvalue.
    pub fn new(
        whole: &'a FullStructure,
        modes: &NaturalModes,
        shift: f64,
        order: usize,
    ) -> Result<Self, ReductionError> {
        let n = whole.dofs();
        let (basis, shift) = residual_flexibility::basis(whole, modes, shift, order)?;
        let own = match &whole.damping {
            StructureDamping::Matrix(c) => Some(multi_vector::inner_products(n, &basis, &c.multiply_columns(&basis))),
            _ => None,
        };
        let mass = square(&whole.mass, &basis);
        let ports = whole.rows_of(&basis);
        let counts = (whole.ports().len(), order);
        let stiffness = square(&whole.stiffness, &basis);
        // a nonzero value from rounding would restrain the free motion, and a constant load
        // would displace it by kilometres
        let mut values = modes.values.clone();
        values[..modes.rigid_body_count()].fill(0.0);
        Ok(RubinBasis { whole, values, shift, counts, basis: Arc::new(basis), mass, stiffness, damping: own, ports })
    }

    /// Returns the whole structure.
    pub(super) fn whole(&self) -> &FullStructure {
        self.whole
    }

    /// Returns the number of modes.
    pub fn modes(&self) -> usize {
        self.values.len()
    }

    /// Returns `Xⱼ` for fewer modes, as a combination of the basis.
    pub(super) fn residual_vectors(&self, modes: usize, order: usize) -> DMatrix<f64> {
        let (k, p) = (self.modes(), self.counts.0);
        let mut combination = DMatrix::zeros(self.mass.nrows(), p);
        for port in 0..p {
            combination[(k + order * p + port, port)] = 1.0;
            for mode in modes..k {
                let distance = self.values[mode] - self.shift;
                combination[(mode, port)] = self.ports[(port, mode)] / distance.powi(order as i32 + 1);
            }
        }
        combination
    }

    /// Returns the structure reduced to its first `modes` modes and residual vectors of orders
    /// below `order`.
    ///
    /// # Errors
    /// [`ReductionError::OutOfRange`].
    ///
    /// # Panics
    /// If fewer modes or orders are available.
    pub fn reduced(&self, modes: usize, order: usize) -> Result<ReducedMatrices, ReductionError> {
        assert!(modes <= self.modes() && order <= self.counts.1, "of {} modes, {} orders", self.modes(), self.counts.1);
        // with all modes, the residual vectors contain only rounding
        let order = if modes < self.whole.dofs() { order } else { 0 };
        let (small, own) = self.combination(modes, order).ok_or(ReductionError::OutOfRange)?;
        let diagonal =
            |which: usize| DMatrix::from_diagonal(&DVector::from_iterator(own.len(), own.iter().map(|o| o[which])));
        let (mass, stiffness) = (diagonal(0), diagonal(1));
        let own = self
            .damping
            .as_ref()
            .map(|c| multi_vector::inner_products(c.nrows(), small.as_slice(), product(c, &small).as_slice()));
        let damping = damping(&self.whole.damping, &mass, &stiffness, own)?;
        let n = self.whole.dofs();
        let (residual, plural) = (small.ncols() - modes, |count: usize| if count == 1 { "" } else { "s" });
        let kind = match residual {
            0 => format!("{modes} free mode{}", plural(modes)),
            _ => format!(
                "{modes} free mode{}, {residual} residual vector{} of {order} order{}",
                plural(modes),
                plural(residual),
                plural(order)
            ),
        };
        let ports = product(&self.ports, &small);
        Ok(ReducedMatrices { kind, mass, damping, stiffness, ports, basis: self.basis.clone(), weights: small, n })
    }

    /// Returns the natural modes in the space of the first modes and independent residual
    /// vectors, with the mass and stiffness of each. They have unit mass, or unit stiffness if
    /// they have no mass.
    fn combination(&self, modes: usize, order: usize) -> Option<(DMatrix<f64>, Vec<[f64; 2]>)> {
        let all = self.mass.nrows();
        let along = |a: &DMatrix<f64>, matrix: &DMatrix<f64>, b: &DMatrix<f64>| {
            multi_vector::inner_products(all, a.as_slice(), product(matrix, b).as_slice())
        };
        let mut vectors = DMatrix::zeros(all, 0);
        for order in 0..order {
            let mut block = self.residual_vectors(modes, order);
            // twice: the second pass removes the rounding of the first
            for _ in 0..if vectors.is_empty() { 1 } else { 2 } {
                block -= product(&vectors, &along(&vectors, &self.stiffness, &block));
                block = independent(&block, &self.stiffness)?;
            }
            vectors = join(&vectors, &block);
        }
        let chosen = DMatrix::from_fn(all, modes, |i, k| f64::from(u8::from(i == k)));
        let together = join(&chosen, &vectors);
        let [mass, stiffness] =
            [&self.mass, &self.stiffness].map(|matrix| symmetric(along(&together, matrix, &together)));
        let (values, shapes) = natural(&mass, &stiffness)?;
        let own = values.into_iter().map(|value| if value.is_finite() { [1.0, value] } else { [0.0, 1.0] });
        Some((product(&together, &shapes), own.collect()))
    }
}

/// Returns `Bᵀ A B` of a symmetric matrix, computed in blocks of columns.
fn square(matrix: &SparseMatrix, basis: &[f64]) -> DMatrix<f64> {
    let n = matrix.n().max(1);
    let all = basis.len() / n;
    let mut square = DMatrix::zeros(all, all);
    for first in (0..all).step_by(COLUMN_BLOCK) {
        let last = all.min(first + COLUMN_BLOCK);
        let moved = matrix.multiply_columns(&basis[first * n..last * n]);
        let below = multi_vector::inner_products(n, &basis[first * n..], &moved);
        for (k, i) in (first..last).flat_map(|k| (k..all).map(move |i| (k, i))) {
            let value = below[(i - first, k - first)];
            (square[(i, k)], square[(k, i)]) = (value, value);
        }
    }
    square
}

fn join(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(
        b.nrows(),
        a.ncols() + b.ncols(),
        |i, k| {
            if k < a.ncols() { a[(i, k)] } else { b[(i, k - a.ncols())] }
        },
    )
}

/// Returns combinations of columns that are orthonormal in `stiffness`, without linearly
/// dependent ones.
pub(super) fn independent(vectors: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let energies =
        multi_vector::inner_products(vectors.nrows(), vectors.as_slice(), product(stiffness, vectors).as_slice());
    let energies = symmetric(energies);
    let size = |i: usize| energies[(i, i)].max(0.0).sqrt();
    let moving: Vec<usize> = (0..vectors.ncols()).filter(|&i| size(i) > 0.0).collect();
    if moving.is_empty() {
        return Some(DMatrix::zeros(vectors.nrows(), 0));
    }
    let unit = DMatrix::from_fn(moving.len(), moving.len(), |i, k| {
        energies[(moving[i], moving[k])] / (size(moving[i]) * size(moving[k]))
    });
    let mut weights = match inverse_factor_if_independent(&unit) {
        Some(weights) => weights,
        None => independent_eigenvectors(&unit)?,
    };
    for (mut row, &i) in weights.row_iter_mut().zip(&moving) {
        row /= size(i);
    }
    Some(product(&vectors.select_columns(&moving), &weights))
}

/// Returns `L⁻ᵀ` of `A = L Lᵀ` with a unit diagonal, if the vectors are certainly independent.
///
/// The largest eigenvalue is at most n, and the smallest is at least the reciprocal of the
/// trace of `A⁻¹`. `None` means that their ratio could be below [`DEPENDENCE_TOLERANCE`].
fn inverse_factor_if_independent(unit: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = unit.nrows();
    let mut lower = unit.clone();
    if !cholesky_blocked(lower.as_mut_slice(), n) {
        return None;
    }
    let mut inverse = DMatrix::identity(n, n);
    solve_lower_blocked(lower.as_slice(), n, inverse.as_mut_slice(), Transpose::Yes);
    (DEPENDENCE_TOLERANCE * n as f64 * inverse.norm_squared() < 1.0).then_some(inverse)
}

/// Returns eigenvectors divided by the square roots of their eigenvalues, without those at the
/// level of rounding. They are independent combinations of vectors with these products.
pub(super) fn independent_eigenvectors(products: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (values, vectors) = eigen::symmetric_blocked(products)?;
    let least = DEPENDENCE_TOLERANCE * values.last().copied().unwrap_or(0.0);
    let kept: Vec<usize> = (0..values.len()).filter(|&k| values[k] > least).collect();
    let mut vectors = vectors.select_columns(&kept);
    for (mut column, &k) in vectors.column_iter_mut().zip(&kept) {
        column /= values[k].sqrt();
    }
    Some(vectors)
}
