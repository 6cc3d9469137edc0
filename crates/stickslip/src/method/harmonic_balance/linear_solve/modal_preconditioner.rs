//! Preconditioner for large structures in modes: `(1 + R K)⁻¹` with `R = S + Φ diag(g) Φᵀ`.
//!
//! The residual flexibility S of modes far above the harmonics is the same for all harmonics. So
//! is the factor of `1 + S K` with one stiffness for all. The other modes enter by Woodbury's
//! formula, with one row per mode.

use super::linearization::LinearizedEquations;
use crate::method::harmonic_balance::aft::{Port, Ports};
use crate::method::harmonic_balance::dynamics::receptance::ModalReceptance;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::dense::{ComplexLu, DenseLu, ProductShape, Transpose, multiply_blocked};

/// Settings of the preconditioner.
#[derive(Debug, Clone, Copy)]
struct ModalPreconditionerSettings {
    /// Modes with frequencies above this multiple of the highest harmonic respond almost
    /// statically.
    above: f64,
}

impl Default for ModalPreconditionerSettings {
    fn default() -> Self {
        ModalPreconditionerSettings { above: 3.0 }
    }
}

/// The preconditioner `(1 + R K)⁻¹` with one real K for all harmonics, for a structure in modes.
#[derive(Debug, Clone)]
pub(super) struct ModalPreconditioner {
    /// Frequency, rad/s, up to which modes are taken individually.
    pub bound: f64,
    /// True if the mean has closed contacts. These already precondition it.
    closed: bool,
    /// Numbers of these modes.
    low_modes: Vec<usize>,
    /// Residual flexibility S of the other modes, with the springs in series. It does not
    /// depend on the stiffness of the joints.
    pub residual_flexibility: Arc<Vec<f64>>,
    /// `1 + S K`, factored.
    factor: DenseLu<f64>,
    /// `Φᵀ K`, modes × axes, and `(1 + S K)⁻¹ Φ`, axes × modes.
    modal_stiffness: Vec<f64>,
    solved_modes: Vec<f64>,
    /// `Φᵀ K (1 + S K)⁻¹ Φ`.
    core: Vec<f64>,
    /// `core` plus the dynamic stiffness of the modes, factored, per harmonic
    /// at one excitation frequency.
    harmonics: Vec<ComplexLu>,
    omega: f64,
}

impl ModalPreconditioner {
    /// Returns the bound, rounded up so that nearby frequencies share it.
    pub fn bound(modal: &ModalReceptance) -> f64 {
        let top = modal.rates.iter().map(|s| s.im).fold(modal.omega, f64::max);
        ModalPreconditionerSettings::default().above * top.log2().ceil().exp2()
    }

    /// Creates the split from `stiffness(p, port, a, b)` of the joints. `above`
    /// is S, if it is known for this bound.
    pub fn new(
        modal: &ModalReceptance,
        (bound, above): (f64, Option<Arc<Vec<f64>>>),
        stiffness: impl Fn(usize, &Port, usize, usize) -> f64,
        ports: &Ports,
    ) -> Option<Self> {
        let structure = &modal.structure;
        let (p, n) = (structure.axes, structure.modal_coefficients().len());
        let is_low = |own: &[f64; 3]| own[2] <= bound * bound * own[0];
        let (low, high): (Vec<usize>, Vec<usize>) = (0..n).partition(|&m| is_low(&structure.modal_coefficients()[m]));
        let column = |m: usize| &structure.at[m * p..(m + 1) * p];
        let above = above.unwrap_or_else(|| {
            let above: Vec<f64> = high.iter().flat_map(|&m| column(m)).copied().collect();
            let weighted: Vec<f64> = high
                .iter()
                .flat_map(|&m| column(m).iter().map(move |a| a / structure.modal_coefficients()[m][2]))
                .collect();
            let mut sum = vec![0.0; p * p];
            multiply_blocked(
                &weighted,
                &above,
                &mut sum,
                ProductShape { rows: p, inner: high.len(), columns: p },
                Transpose::Yes,
            );
            (0..p).for_each(|q| sum[q * p + q] += modal.series[q]);
            Arc::new(sum)
        });
        let mut matrix = vec![0.0; p * p];
        let mut pull = vec![0.0; low.len() * p];
        for (number, port) in ports.iter().enumerate() {
            for (a, row) in port.range().enumerate() {
                for (b, q) in port.range().enumerate() {
                    let k = stiffness(number, port, a, b);
                    let moved = &above[row * p..(row + 1) * p];
                    matrix[q * p..(q + 1) * p].iter_mut().zip(moved).for_each(|(out, s)| *out += s * k);
                    for (pull, &m) in pull[q * low.len()..].iter_mut().zip(&low) {
                        *pull += structure.at[m * p + row] * k;
                    }
                }
            }
        }
        (0..p).for_each(|q| matrix[q * p + q] += 1.0);
        let factor = DenseLu::new(matrix, p).ok()?;
        let mut moved: Vec<f64> = low.iter().flat_map(|&m| column(m)).copied().collect();
        factor.solve(&mut moved);
        let l = low.len();
        let mut core = vec![0.0; l * l];
        multiply_blocked(&pull, &moved, &mut core, ProductShape { rows: l, inner: p, columns: l }, Transpose::No);
        let closed = modal.closed.is_some();
        Some(ModalPreconditioner {
            bound,
            closed,
            low_modes: low,
            residual_flexibility: above,
            factor,
            modal_stiffness: pull,
            solved_modes: moved,
            core,
            harmonics: Vec::new(),
            omega: f64::NAN,
        })
    }

    /// Prepares the factors for an excitation frequency.
    pub fn set_frequency(&mut self, modal: &ModalReceptance) -> Option<()> {
        if self.omega == modal.omega && self.harmonics.len() == modal.rates.len() {
            return Some(());
        }
        let l = self.low_modes.len();
        self.harmonics.clear();
        for rate in &modal.rates {
            let mut matrix: Vec<Complex64> = self.core.iter().map(|x| Complex64::new(*x, 0.0)).collect();
            for (i, &m) in self.low_modes.iter().enumerate() {
                matrix[i * l + i] += modal.structure.stiffness(m, *rate, modal.omega).ok()?;
            }
            self.harmonics.push(ComplexLu::new(matrix, l).ok()?);
        }
        self.omega = modal.omega;
        Some(())
    }

    /// Replaces a residual in units by a step in units.
    pub fn apply(&self, linear: &LinearizedEquations, v: &mut [f64]) {
        linear.multiply_by_residual_units(v);
        self.solve(v);
        linear.divide_by_step_units(v);
    }

    /// Applies the preconditioner to [axis][harmonic]:
    /// `(1 + R K)⁻¹ v = y - (1 + S K)⁻¹ Φ (1/g + core)⁻¹ Φᵀ K y`, with `y = (1 + S K)⁻¹ v`.
    fn solve(&self, v: &mut [f64]) {
        let (nh, l) = (self.harmonics.len(), self.low_modes.len());
        let wide = 2 * nh;
        let p = v.len() / wide;
        let mut columns = vec![0.0; v.len()];
        for (q, v) in v.chunks_exact(wide).enumerate() {
            v.iter().enumerate().for_each(|(i, v)| columns[i * p + q] = *v);
        }
        self.factor.solve(&mut columns);
        if l > 0 {
            let mut pulled = vec![0.0; l * wide];
            multiply_blocked(
                &self.modal_stiffness,
                &columns,
                &mut pulled,
                ProductShape { rows: l, inner: p, columns: wide },
                Transpose::No,
            );
            for (k, factor) in self.harmonics.iter().enumerate() {
                let (re, im) = pulled[2 * k * l..2 * (k + 1) * l].split_at_mut(l);
                let mut modal: Vec<Complex64> = re.iter().zip(&*im).map(|(re, im)| Complex64::new(*re, *im)).collect();
                factor.solve(&mut modal);
                for (i, z) in modal.iter().enumerate() {
                    (re[i], im[i]) = (z.re, z.im);
                }
            }
            let mut moved = vec![0.0; p * wide];
            multiply_blocked(
                &self.solved_modes,
                &pulled,
                &mut moved,
                ProductShape { rows: p, inner: l, columns: wide },
                Transpose::No,
            );
            columns.iter_mut().zip(&moved).for_each(|(c, m)| *c -= m);
        }
        for (q, v) in v.chunks_exact_mut(wide).enumerate() {
            let first = if self.closed { 2 } else { 0 };
            v.iter_mut().enumerate().skip(first).for_each(|(i, v)| *v = columns[i * p + q]);
        }
    }
}
