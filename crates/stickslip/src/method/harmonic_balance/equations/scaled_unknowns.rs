//! The equations as a function of unknowns of order one, for continuation.

use super::{DerivativeScope, Discretization, HarmonicSolution};
use crate::method::harmonic_balance::aft::Ports;
use crate::method::harmonic_balance::equations::homotopy::SearchContext;
use num_complex::Complex64;

impl Discretization {
    /// Computes the residual at `unknowns` (per axis a motion or a force,
    /// relative to [`unit`]) into `residual`, in the same units. Writes the
    /// derivative into `jacobian`, row-major. Only in the dense form.
    pub fn residual_at(
        &mut self,
        ports: &Ports,
        omega: f64,
        (unknowns, length): (&[f64], f64),
        motion: &mut HarmonicSolution,
        residual: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) {
        self.unpack(ports, unknowns, length, motion);
        let slopes = if jacobian.is_some() { DerivativeScope::All } else { DerivativeScope::None };
        self.evaluate(SearchContext::given(ports, omega), motion, length, slopes);
        for ((out, r), unit) in residual.iter_mut().zip(&self.workspace.residual).zip(&self.workspace.units) {
            *out = r / unit;
        }
        if let Some(jacobian) = jacobian {
            if self.assemble(SearchContext::given(ports, omega), length) {
                jacobian.copy_from_slice(&self.workspace.jacobian);
            } else {
                jacobian.fill(f64::NAN);
            }
        }
    }

    /// Returns the unknowns of a motion, see [`Discretization::residual_at`].
    pub fn pack(&self, ports: &Ports, motion: &HarmonicSolution, length: f64) -> Vec<f64> {
        let nh = self.harmonics().len();
        let mut out = Vec::with_capacity(2 * motion.c.len());
        for port in ports.iter() {
            let values = if port.is_force() { &motion.force } else { &motion.c };
            for value in &values[port.first_axis * nh..(port.first_axis + port.axes) * nh] {
                let value = value / port.unit(length);
                out.extend([value.re, value.im]);
            }
        }
        out
    }

    /// Writes unknowns into a motion: the inverse of [`Discretization::pack`].
    pub fn unpack(&self, ports: &Ports, unknowns: &[f64], length: f64, motion: &mut HarmonicSolution) {
        let nh = self.harmonics().len();
        for port in ports.iter() {
            let values = if port.is_force() { &mut motion.force } else { &mut motion.c };
            let range = port.first_axis * nh..(port.first_axis + port.axes) * nh;
            for (value, pair) in values[range.clone()].iter_mut().zip(unknowns[2 * range.start..].chunks_exact(2)) {
                *value = Complex64::new(pair[0], pair[1]) * port.unit(length);
            }
        }
    }
}
