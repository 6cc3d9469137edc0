//! Modes of a structure that its damping does not couple, computed once.
//!
//! Structures reduced by free modes and residual vectors already have such coordinates. Other
//! full structures are transformed to them.

use super::{Matrices, Structure};
use nalgebra::DMatrix;
use std::sync::Arc;
use stickslip_numerics::dense::{ProductShape, Transpose, multiply_blocked};
use stickslip_numerics::eigen;

/// A structure in its own modes.
#[derive(Debug)]
pub(crate) struct UncoupledModes {
    /// Modal mass, damping and stiffness.
    pub own: Vec<[f64; 3]>,
    /// Mode shapes at the places, n × n; `None` if the coordinates are already the modes.
    pub shapes: Option<DMatrix<f64>>,
}

impl Structure {
    /// Returns its modes; `None` if damping couples them, or if there are too many. The first
    /// call computes them.
    pub(crate) fn uncoupled(&self) -> Option<&Arc<UncoupledModes>> {
        let find = || match self.diagonals() {
            Some(own) => Some(UncoupledModes { own, shapes: None }),
            // Largest number of degrees of freedom for which modes are computed; the
            // decomposition then takes a minute.
            None if self.is_sparse() || self.dofs() > 4000 => None,
            None => {
                let (own, shapes) = modes(self.full())?;
                Some(UncoupledModes { own, shapes: Some(shapes) })
            }
        };
        self.0.uncoupled.get_or_init(|| find().map(Arc::new)).as_ref()
    }

    /// Returns mass, damping and stiffness if all matrices are diagonal, as after a reduction
    /// by free modes.
    pub(crate) fn diagonals(&self) -> Option<Vec<[f64; 3]>> {
        if self.damped_modes().is_some() {
            return None;
        }
        let mut own = vec![[0.0; 3]; self.dofs()];
        for (i, k, values) in self.entries() {
            if i != k {
                return None;
            }
            own[i] = values;
        }
        Some(own)
    }
}

/// Computes modes `X` with `Xᵀ (K + σ M) X = 1` and `Xᵀ M X = θ`. Motions without mass have
/// `θ = 0`: modal mass θ and stiffness `1 - σ θ`.
fn modes(matrices: &Matrices) -> Option<(Vec<[f64; 3]>, DMatrix<f64>)> {
    // Damping between modes that counts as rounding: relative to the damping of the two modes,
    // and to the largest of all.
    let uncoupled = [1e-9, 1e-13];
    let Matrices { mass, damping, stiffness } = matrices;
    let n = mass.nrows();
    let mut ratios: Vec<f64> =
        (0..n).map(|i| stiffness[(i, i)] / mass[(i, i)]).filter(|v| v.is_finite() && *v > 0.0).collect();
    ratios.sort_by(f64::total_cmp);
    // Shift for free motions, relative to the lowest ratio of stiffness to mass on the
    // diagonals.
    let shift = 1e-3 * ratios.first().copied().unwrap_or(1.0);
    let (values, shapes) = eigen::generalized_symmetric(mass, &(stiffness + mass * shift))?;
    let product = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
        let mut out = DMatrix::zeros(n, n);
        multiply_blocked(
            a.as_slice(),
            b.as_slice(),
            out.as_mut_slice(),
            ProductShape { rows: n, inner: n, columns: n },
            Transpose::No,
        );
        out
    };
    let modal = product(&shapes.transpose(), &product(damping, &shapes));
    let size = modal.diagonal().amax();
    for (i, k) in (0..n).flat_map(|k| (0..k).map(move |i| (i, k))) {
        let both = (modal[(i, i)] * modal[(k, k)]).abs().sqrt();
        let off_diagonal = modal[(i, k)].abs().max(modal[(k, i)].abs());
        if off_diagonal > uncoupled[0] * both + uncoupled[1] * size {
            return None;
        }
    }
    // a negative mass is rounding of zero
    let own = values.iter().enumerate().map(|(m, theta)| {
        let mass = theta.max(0.0);
        [mass, modal[(m, m)], 1.0 - shift * mass]
    });
    Some((own.collect(), shapes))
}
