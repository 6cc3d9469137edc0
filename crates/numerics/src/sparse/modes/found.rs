//! Natural modes that were found, and why there are none.

use crate::sparse::Singular;

/// Vectors of a block: eigenvalues of multiplicity up to four are found in one run, and a solution for four right sides takes much less
/// than four times one.
pub(super) const BLOCK: usize = 4;
/// Eigenvalues below this share of a usual `k_ii / m_ii` are those of free motions, in matrices of ten digits.
const FREE: f64 = 1e-10;
/// So many times as large is the first eigenvalue of another motion; those of a slender beam, as small as it may be, follow each other closer.
const APART: f64 = 1e3;

/// The lowest natural modes, complete.
#[derive(Debug, Clone, PartialEq)]
pub struct NaturalModes {
    /// λ = ω², rad²/s², rising. Free motions have rounding around zero.
    pub values: Vec<f64>,
    /// Shapes φ, columns of length n one after the other, with `φᵀ M φ = 1`.
    pub shapes: Vec<f64>,
    /// Of every mode `‖φ - (λ - σ)(K - σM)⁻¹ M φ‖` in the norm of M: some eigenvalue has a distance from the shift σ that differs by no more
    /// than this share.
    pub residuals: Vec<f64>,
    /// A usual `k_ii / m_ii`, rad²/s²: rounding of λ is far below it.
    pub scale: f64,
    /// What they took.
    pub effort: Effort,
}

/// What modes took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Effort {
    /// Factors.
    pub factors: usize,
    /// Vectors of the Lanczos process.
    pub vectors: usize,
}

/// Why there are no modes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModesError {
    /// A motion has neither mass nor stiffness.
    #[error("a motion has neither mass nor stiffness: {0}")]
    Massless(Singular),
    /// The stiffness is not positive semidefinite.
    #[error(
        "{} below {below:.3e} rad²/s²: the stiffness is not positive semidefinite; check its signs, or a state beyond buckling",
        if *count == 1 { "1 eigenvalue lies".to_owned() } else { format!("{count} eigenvalues lie") }
    )]
    Negative {
        /// How many.
        count: usize,
        /// Below this, rad²/s².
        below: f64,
    },
    /// The mass is not positive semidefinite.
    #[error("some motion has a negative mass; the mass matrix must be positive semidefinite")]
    NegativeMass,
    /// More modes than asked for.
    #[error("{count} modes lie below {below:.3e} rad²/s², and at most {most} are allowed; lower the bound")]
    TooMany {
        /// How many.
        count: usize,
        /// The bound, rad²/s².
        below: f64,
        /// How many are allowed.
        most: usize,
    },
    /// The factor is too inaccurate.
    #[error(
        "the mode at {value:.6e} rad²/s² keeps a residual of {residual:.1e}: stiffness and mass range over so many orders that rounding drowns it; \
         replace what is nearly rigid by constraints, or take longer elements"
    )]
    Inaccurate {
        /// λ, rad²/s².
        value: f64,
        /// As [`NaturalModes::residuals`].
        residual: f64,
    },
    /// Numbers left the range.
    #[error("the entries of mass and stiffness leave the range of numbers; choose other units")]
    OutOfRange,
    /// The count and the modes found disagree, or nothing more is found.
    #[error(
        "the search for modes ended with {found} below {below:.3e} rad²/s², where the count of negative pivots is {counted}; \
         matrices whose entries are scaled very differently need better units"
    )]
    NotConverged {
        /// Modes found below.
        found: usize,
        /// Eigenvalues below.
        counted: usize,
        /// Where, rad²/s².
        below: f64,
    },
}

impl NaturalModes {
    pub(super) fn none() -> Self {
        NaturalModes { values: vec![], shapes: vec![], residuals: vec![], scale: 0.0, effort: Effort::default() }
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.values.len()
    }

    /// How many of them are free motions: eigenvalues that are zero to the ten digits of a file, and far below the next.
    pub fn free(&self) -> usize {
        let values = &self.values;
        let apart = |k: &usize| *k == 0 || *k == values.len() || values[*k] > APART * values[*k - 1].abs();
        (0..=self.below(FREE * self.scale)).rev().find(apart).unwrap_or(0)
    }

    /// Shape φ of a mode, from 0.
    ///
    /// # Panics
    /// If there is no such mode.
    pub fn shape(&self, mode: usize) -> &[f64] {
        let n = self.shapes.len() / self.count();
        &self.shapes[mode * n..(mode + 1) * n]
    }

    /// The first `count` of them.
    pub fn truncate(&mut self, count: usize) {
        if count < self.count() {
            let n = self.shapes.len() / self.count();
            self.shapes.truncate(count * n);
            self.values.truncate(count);
            self.residuals.truncate(count);
        }
    }

    pub(super) fn below(&self, value: f64) -> usize {
        self.values.partition_point(|v| *v < value)
    }

    /// Adds modes and sorts all.
    pub(super) fn join(&mut self, n: usize, other: NaturalModes) {
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
