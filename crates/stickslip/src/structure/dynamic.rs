//! The dynamic stiffness of a structure: `(s² M + s C + K) x = F` at `s = jhΩ`.

use super::modal_damping::ModallyDampedFactor;
use super::{Storage, Structure};
use nalgebra::DMatrix;
use num_complex::Complex64;
use stickslip_numerics::dense::ComplexLu;
use stickslip_numerics::sparse::{ComplexFactor, Singular, SymbolicAnalysis};

/// The factored dynamic stiffness of a structure at one complex frequency. It solves for any
/// number of loads.
#[derive(Debug, Clone)]
pub struct DynamicStiffness {
    factor: DynamicFactor,
}

#[derive(Debug, Clone)]
enum DynamicFactor {
    Full(ComplexLu),
    Sparse(ComplexFactor),
    Modal(Box<ModallyDampedFactor>),
}

impl Structure {
    /// Factors `s² M + s C + K` at a complex frequency `s` (1/s). Harmonic h of the frequency Ω
    /// has `s = jhΩ`.
    ///
    /// # Errors
    /// [`Singular`]: an undamped resonance, or a structure with free motions at `s = 0`.
    pub fn dynamic_stiffness(&self, s: Complex64) -> Result<DynamicStiffness, Singular> {
        self.shifted_dynamic_stiffness(s, 0.0)
    }

    /// Factors the dynamic stiffness with additional springs of `hold` (1/s²) times the mass
    /// matrix.
    pub(crate) fn shifted_dynamic_stiffness(&self, s: Complex64, hold: f64) -> Result<DynamicStiffness, Singular> {
        let of_mass = s * s + hold;
        let factor = match &self.0.form {
            Storage::Full(full) => {
                let n = self.dofs();
                let entries = full.mass.iter().zip(full.damping.iter()).zip(full.stiffness.iter());
                let sum = entries.map(|((m, c), k)| of_mass * m + s * c + k).collect();
                DynamicFactor::Full(ComplexLu::new(sum, n).map_err(|row| Singular { row })?)
            }
            Storage::Sparse { mass, damping, stiffness, modes, analysis, .. } => {
                let analysis = analysis.get_or_init(|| SymbolicAnalysis::new(&[mass, damping, stiffness]));
                let one = Complex64::new(1.0, 0.0);
                let factor = analysis.factor_complex(&[(of_mass, mass), (s, damping), (one, stiffness)])?;
                match modes {
                    Some(modes) if s != Complex64::ZERO => {
                        DynamicFactor::Modal(Box::new(ModallyDampedFactor::new(factor, modes, s)?))
                    }
                    _ => DynamicFactor::Sparse(factor),
                }
            }
            Storage::Ring { .. } => return self.expanded().shifted_dynamic_stiffness(s, hold),
        };
        Ok(DynamicStiffness { factor })
    }

    /// Factors the dynamic stiffness of a wave given in its real form of twice the size,
    /// `[[Re A, -Im A], [Im A, Re A]]`, as the complex matrix A of the size of a sector. This
    /// takes an eighth of the work.
    pub(super) fn complex_dynamic_stiffness(&self, s: Complex64, hold: f64) -> Result<DynamicStiffness, Singular> {
        let of_mass = s * s + hold;
        let (full, n) = (self.full(), self.dofs() / 2);
        let part = |matrix: &DMatrix<f64>, i: usize, k: usize| Complex64::new(matrix[(i, k)], matrix[(n + i, k)]);
        let entry = |(i, k): (usize, usize)| {
            of_mass * part(&full.mass, i, k) + s * part(&full.damping, i, k) + part(&full.stiffness, i, k)
        };
        let sum = (0..n).flat_map(|k| (0..n).map(move |i| (i, k))).map(entry).collect();
        Ok(DynamicStiffness { factor: DynamicFactor::Full(ComplexLu::new(sum, n).map_err(|row| Singular { row })?) })
    }

    /// Returns the memory of a [`DynamicStiffness`] of a sparse structure, bytes, from its
    /// sparsity pattern without a factorization. Zero for full matrices.
    pub(crate) fn factor_bytes(&self) -> usize {
        match &self.0.form {
            Storage::Full(_) => 0,
            Storage::Sparse { mass, damping, stiffness, analysis, .. } => {
                let analysis = analysis.get_or_init(|| SymbolicAnalysis::new(&[mass, damping, stiffness]));
                analysis.complex_bytes()
            }
            Storage::Ring { .. } => self.expanded().factor_bytes(),
        }
    }
}

impl DynamicStiffness {
    /// Returns its memory, bytes.
    pub(crate) fn bytes(&self) -> usize {
        match &self.factor {
            DynamicFactor::Full(factor) => factor.bytes(),
            DynamicFactor::Sparse(factor) => factor.bytes(),
            DynamicFactor::Modal(factor) => factor.bytes(),
        }
    }

    /// Computes displacements (m) from forces (N) in place. The columns of length n are stored
    /// one after the other.
    ///
    /// # Panics
    /// If the length of `loads` is not a multiple of n.
    pub fn solve(&self, loads: &mut [Complex64]) {
        match &self.factor {
            DynamicFactor::Full(factor) => factor.solve(loads),
            DynamicFactor::Sparse(factor) => factor.solve(loads),
            DynamicFactor::Modal(factor) => factor.solve(loads),
        }
    }
}
