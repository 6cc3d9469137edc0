//! Results of the search for natural modes, and its errors.

use crate::sparse::Singular;

/// Vectors of a block.
///
/// One run finds eigenvalues of multiplicity up to four. A solution for four right sides takes
/// much less than four times the time of one.
pub(super) const BLOCK: usize = 4;

/// The lowest natural modes, without gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct NaturalModes {
    /// Eigenvalues λ = ω², rad²/s², rising. Rigid-body modes have rounding around zero.
    pub values: Vec<f64>,
    /// Mode shapes φ with `φᵀ M φ = 1`: columns of length n, stored consecutively.
    pub shapes: Vec<f64>,
    /// Residual of every mode, `‖φ - (λ - σ)(K - σM)⁻¹ M φ‖` in the norm of M.
    ///
    /// There is an eigenvalue whose distance from the shift σ agrees with
    /// `λ - σ` to this relative error.
    pub residuals: Vec<f64>,
    /// A typical `k_ii / m_ii`, rad²/s². The rounding of λ is far below it.
    pub scale: f64,
    /// Cost of the search.
    pub cost: ModesCost,
}

/// Cost of a search for modes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ModesCost {
    /// Number of factorizations.
    pub factors: usize,
    /// Number of Lanczos vectors.
    pub vectors: usize,
}

/// Returns the frequency of an eigenvalue in rad²/s², Hz.
fn hertz(eigenvalue: f64) -> f64 {
    eigenvalue.max(0.0).sqrt() / std::f64::consts::TAU
}

/// The reason why the search for modes failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModesError {
    /// A motion has neither mass nor stiffness.
    #[error("a motion has neither mass nor stiffness: {0}")]
    Massless(Singular),
    /// The stiffness is not positive semidefinite.
    #[error(
        "{} below {below:.3e} rad²/s²: the stiffness matrix is not positive semidefinite; check its signs, and check \
         that the structure is not loaded beyond buckling",
        if *count == 1 { "1 eigenvalue lies".to_owned() } else { format!("{count} eigenvalues lie") }
    )]
    Negative {
        /// Number of eigenvalues.
        count: usize,
        /// Bound that they lie below, rad²/s².
        below: f64,
    },
    /// The mass is not positive semidefinite.
    #[error("the mass matrix gives some motion a negative mass; it must be positive semidefinite")]
    NegativeMass,
    /// More modes lie below the bound than allowed.
    #[error("{count} modes lie below {:.6e} Hz, but at most {most} are allowed; lower the upper frequency", hertz(*below))]
    TooMany {
        /// Number of modes.
        count: usize,
        /// The bound, rad²/s².
        below: f64,
        /// Number of modes allowed.
        most: usize,
    },
    /// The factor is not accurate enough.
    #[error(
        "the mode at {:.6e} Hz has a residual of {residual:.1e}: stiffness and mass cover too many orders of magnitude, \
         so rounding dominates; replace nearly rigid parts by constraints, or use longer elements",
        hertz(*value)
    )]
    Inaccurate {
        /// λ, rad²/s².
        value: f64,
        /// Its residual, see [`NaturalModes::residuals`].
        residual: f64,
    },
    /// Numbers overflow.
    #[error("the entries of mass and stiffness exceed the range of floating-point numbers; choose other units")]
    OutOfRange,
    /// The number of modes found differs from the count, or the search finds no further mode.
    #[error(
        "the search found {found} modes below {:.6e} Hz, but the negative pivots count {counted}; choose units that \
         give the matrix entries similar magnitudes",
        hertz(*below)
    )]
    NotConverged {
        /// Modes found below the bound.
        found: usize,
        /// Eigenvalues counted below the bound.
        counted: usize,
        /// The bound, rad²/s².
        below: f64,
    },
}

impl NaturalModes {
    pub(super) fn empty() -> Self {
        NaturalModes { values: vec![], shapes: vec![], residuals: vec![], scale: 0.0, cost: ModesCost::default() }
    }

    /// Returns the number of modes.
    pub fn count(&self) -> usize {
        self.values.len()
    }

    /// Returns the number of rigid-body modes: eigenvalues that are zero to the
    /// ten digits of a file, and far below the next.
    pub fn rigid_body_count(&self) -> usize {
        let values = &self.values;
        // The first elastic eigenvalue exceeds those of the rigid-body modes by more than this
        // factor. Consecutive eigenvalues of a slender beam, however small, have a smaller
        // ratio.
        let separated = |k: &usize| *k == 0 || *k == values.len() || values[*k] > 1e3 * values[*k - 1].abs();
        // Eigenvalues below this fraction of a typical `k_ii / m_ii` may be rigid-body modes, in
        // matrices of ten digits.
        (0..=self.below(1e-10 * self.scale)).rev().find(separated).unwrap_or(0)
    }

    /// Returns the shape φ of a mode, counted from 0.
    ///
    /// # Panics
    /// If the mode does not exist.
    pub fn shape(&self, mode: usize) -> &[f64] {
        let n = self.shapes.len() / self.count();
        &self.shapes[mode * n..(mode + 1) * n]
    }

    /// Keeps the first `count` modes.
    pub fn truncate(&mut self, count: usize) {
        if count < self.count() {
            let n = self.shapes.len() / self.count();
            self.shapes.truncate(count * n);
            self.values.truncate(count);
            self.residuals.truncate(count);
        }
    }

    /// Returns the number of modes below a value.
    pub(super) fn below(&self, value: f64) -> usize {
        self.values.partition_point(|v| *v < value)
    }

    /// Adds modes and sorts all by eigenvalue.
    pub(super) fn merge(&mut self, n: usize, other: NaturalModes) {
        self.values.extend(other.values);
        self.shapes.extend(other.shapes);
        self.residuals.extend(other.residuals);
        let mut order: Vec<usize> = (0..self.count()).collect();
        order.sort_by(|&a, &b| self.values[a].total_cmp(&self.values[b]));
        if order.is_sorted() {
            return;
        }
        self.values = order.iter().map(|&k| self.values[k]).collect();
        self.residuals = order.iter().map(|&k| self.residuals[k]).collect();
        self.shapes = order.iter().flat_map(|&k| self.shapes[k * n..(k + 1) * n].iter().copied()).collect();
    }
}
