//! What a structure answers to harmonic forces: `(s² M + s C + K) x = F` at `s = jhΩ`.

use super::modal::WithModes;
use super::{Form, Structure};
use num_complex::Complex64;
use stickslip_numerics::dense::ComplexLu;
use stickslip_numerics::sparse::{Analysis, ComplexFactor, Singular};

/// The dynamic stiffness of a structure at one rate, factored: it answers as many loads as one likes.
#[derive(Debug, Clone)]
pub struct DynamicStiffness {
    factor: Factor,
}

#[derive(Debug, Clone)]
enum Factor {
    Full(ComplexLu),
    Sparse(ComplexFactor),
    Modal(Box<WithModes>),
}

impl Structure {
    /// `s² M + s C + K` at any rate `s` (1/s), factored; harmonic h of the frequency Ω has `s = jhΩ`.
    ///
    /// # Errors
    /// [`Singular`]: a resonance without damping, or at rest a structure that can drift.
    pub fn dynamic_stiffness(&self, s: Complex64) -> Result<DynamicStiffness, Singular> {
        self.held_stiffness(s, 0.0)
    }

    /// The same with springs of `hold` (1/s²) times every mass.
    pub(crate) fn held_stiffness(&self, s: Complex64, hold: f64) -> Result<DynamicStiffness, Singular> {
        let of_mass = s * s + hold;
        let factor = match &self.0.form {
            Form::Full(full) => {
                let n = self.dofs();
                let entries = full.mass.iter().zip(full.damping.iter()).zip(full.stiffness.iter());
                let sum = entries.map(|((m, c), k)| of_mass * m + s * c + k).collect();
                Factor::Full(ComplexLu::new(sum, n).map_err(|row| Singular { row })?)
            }
            Form::Sparse { mass, damping, stiffness, modes, analysis, .. } => {
                let analysis = analysis.get_or_init(|| Analysis::new(&[mass, damping, stiffness]));
                let one = Complex64::new(1.0, 0.0);
                let factor = analysis.factor_complex(&[(of_mass, mass), (s, damping), (one, stiffness)])?;
                match modes {
                    Some(modes) if s != Complex64::ZERO => Factor::Modal(Box::new(WithModes::new(factor, modes, s)?)),
                    _ => Factor::Sparse(factor),
                }
            }
        };
        Ok(DynamicStiffness { factor })
    }

    /// Memory of a [`DynamicStiffness`] of a sparse structure, bytes, from where its entries stand: nothing is factored. Zero of any other.
    pub(crate) fn factor_bytes(&self) -> usize {
        match &self.0.form {
            Form::Full(_) => 0,
            Form::Sparse { mass, damping, stiffness, analysis, .. } => {
                let analysis = analysis.get_or_init(|| Analysis::new(&[mass, damping, stiffness]));
                analysis.complex_bytes()
            }
        }
    }
}

impl DynamicStiffness {
    /// Memory of it, bytes.
    pub(crate) fn bytes(&self) -> usize {
        match &self.factor {
            Factor::Full(factor) => factor.bytes(),
            Factor::Sparse(factor) => factor.bytes(),
            Factor::Modal(factor) => factor.bytes(),
        }
    }

    /// Displacements (m) from forces (N), in place: columns of length n, one after the other.
    ///
    /// # Panics
    /// If the length of `loads` is no multiple of n.
    pub fn solve(&self, loads: &mut [Complex64]) {
        match &self.factor {
            Factor::Full(factor) => factor.solve(loads),
            Factor::Sparse(factor) => factor.solve(loads),
            Factor::Modal(factor) => factor.solve(loads),
        }
    }
}
