//! Receptances: the motions along the axes under forces along them. Large ones
//! are applied by modes and not formed.

use super::linear_dynamics::ClosedContacts;
use super::uncoupled_modes::{UncoupledDynamics, UndampedResonance};
use nalgebra::DMatrix;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::dense::{DenseLu, ProductShape, Transpose, multiply_blocked};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Receptances at the harmonics of a discretization, m/N.
#[derive(Debug, Clone)]
pub(crate) enum Receptance {
    /// One matrix per harmonic, axes × axes.
    Formed(ReceptanceMatrices),
    /// By the modes of the structure.
    Modal(ModalReceptance),
}

/// Receptance matrices.
#[derive(Debug, Clone, Default)]
pub(crate) struct ReceptanceMatrices {
    pub matrices: Vec<DMatrix<Complex64>>,
    /// Forces and motions of one harmonic.
    force: Vec<Complex64>,
}

impl ReceptanceMatrices {
    pub fn new(matrices: Vec<DMatrix<Complex64>>) -> Self {
        ReceptanceMatrices { matrices, ..ReceptanceMatrices::default() }
    }

    /// Returns the memory of the matrices, bytes.
    #[cfg(test)]
    pub fn bytes(&self) -> usize {
        self.matrices.iter().map(|matrix| size_of_val(matrix.as_slice())).sum::<usize>()
    }

    fn apply(&mut self, force: &[Complex64], moved: &mut [Complex64]) {
        let nh = self.matrices.len();
        let axes = moved.len() / nh;
        self.force.resize(2 * axes, ZERO);
        let (forces, sum) = self.force.split_at_mut(axes);
        for (k, matrix) in self.matrices.iter().enumerate() {
            forces.iter_mut().zip(force[k..].iter().step_by(nh)).for_each(|(own, force)| *own = *force);
            if multiplies_in_blocks(axes) {
                multiply_blocked(
                    matrix.as_slice(),
                    forces,
                    sum,
                    ProductShape { rows: axes, inner: axes, columns: 1 },
                    Transpose::No,
                );
            } else {
                // column by column, the order in memory
                sum.fill(ZERO);
                for (column, f) in matrix.as_slice().chunks_exact(axes).zip(&*forces) {
                    sum.iter_mut().zip(column).for_each(|(sum, r)| *sum += r * f);
                }
            }
            moved[k..].iter_mut().step_by(nh).zip(&*sum).for_each(|(moved, sum)| *moved = *sum);
        }
    }
}

/// Receptances by modes, at the harmonics of an excitation frequency.
#[derive(Debug, Clone)]
pub(crate) struct ModalReceptance {
    pub structure: Arc<UncoupledDynamics>,
    /// Excitation frequency, rad/s, and rates of the harmonics, 1/s.
    pub omega: f64,
    pub rates: Vec<Complex64>,
    gains: Vec<Vec<Complex64>>,
    /// Factor that replaces the first gains, if the mean has closed contacts.
    pub closed: Option<Arc<DenseLu<f64>>>,
    /// Compliances in series with the axes, m/N.
    pub series: Vec<f64>,
    /// Size of the mean motion along each axis under a unit force along it, m/N.
    mean: Vec<f64>,
    forces: Vec<f64>,
    modal: Vec<f64>,
    moved: Vec<f64>,
}

impl ModalReceptance {
    pub fn new(
        (structure, closed): (&Arc<UncoupledDynamics>, Option<&ClosedContacts>),
        (harmonics, omega): (&[usize], f64),
        series: &[f64],
    ) -> Result<Self, UndampedResonance> {
        let rates: Vec<Complex64> = harmonics.iter().map(|h| Complex64::new(0.0, *h as f64 * omega)).collect();
        let gains = rates.iter().map(|s| structure.modal_receptances(*s, omega)).collect::<Result<Vec<_>, _>>()?;
        let mean = match (harmonics[0], closed) {
            // the force of a spring is at most its stiffness times the displacement
            (0, Some(closed)) => closed.springs.iter().map(|k| if *k > 0.0 { k.recip() } else { 0.0 }).collect(),
            (0, None) => {
                structure.diagonal_receptance(&gains[0]).iter().zip(series).map(|(r, s)| r.norm() + s).collect()
            }
            _ => vec![0.0; structure.axes],
        };
        Ok(ModalReceptance {
            structure: structure.clone(),
            omega,
            rates,
            gains,
            closed: closed.and_then(|closed| closed.modal_factor(omega)).transpose()?,
            series: series.to_vec(),
            mean,
            forces: Vec::new(),
            modal: Vec::new(),
            moved: Vec::new(),
        })
    }

    /// Applies the receptances to the forces of all harmonics at once.
    fn apply(&mut self, force: &[Complex64], moved: &mut [Complex64]) {
        let (nh, p, n) = (self.rates.len(), self.structure.axes, self.structure.modal_coefficients().len());
        let tall = 2 * nh;
        self.forces.clear();
        self.forces.extend(force.iter().flat_map(|f| [f.re, f.im]));
        self.modal.resize(tall * n, 0.0);
        multiply_blocked(
            &self.forces,
            &self.structure.at,
            &mut self.modal,
            ProductShape { rows: tall, inner: p, columns: n },
            Transpose::No,
        );
        let coupled = usize::from(self.closed.is_some());
        if let Some(closed) = &self.closed {
            let mut mean: Vec<f64> = self.modal.chunks_exact(tall).map(|column| column[0]).collect();
            closed.solve(&mut mean);
            self.modal.chunks_exact_mut(tall).zip(mean).for_each(|(column, x)| column[..2].copy_from_slice(&[x, 0.0]));
        }
        for (m, column) in self.modal.chunks_exact_mut(tall).enumerate() {
            for (k, pair) in column.chunks_exact_mut(2).enumerate().skip(coupled) {
                let z = Complex64::new(pair[0], pair[1]) * self.gains[k][m];
                (pair[0], pair[1]) = (z.re, z.im);
            }
        }
        self.moved.resize(tall * p, 0.0);
        multiply_blocked(
            &self.modal,
            &self.structure.at,
            &mut self.moved,
            ProductShape { rows: tall, inner: n, columns: p },
            Transpose::Yes,
        );
        for (at, (u, pair)) in moved.iter_mut().zip(self.moved.chunks_exact(2)).enumerate() {
            *u = Complex64::new(pair[0], pair[1]) + force[at] * self.series[at / nh];
        }
    }
}

impl Receptance {
    /// Computes the motions along all axes at all harmonics, [axis][harmonic],
    /// under the forces along them.
    pub fn apply(&mut self, force: &[Complex64], moved: &mut [Complex64]) {
        match self {
            // without joints
            Receptance::Formed(_) if moved.is_empty() => {}
            Receptance::Formed(formed) => formed.apply(force, moved),
            Receptance::Modal(modal) => modal.apply(force, moved),
        }
    }

    /// Returns the size of the motion along an axis under a unit force along it, at the first
    /// harmonic, m/N. The first harmonic must be the mean.
    pub fn mean_receptance(&self, q: usize) -> f64 {
        match self {
            Receptance::Formed(formed) => formed.matrices.first().map_or(0.0, |r| r[(q, q)].norm()),
            Receptance::Modal(modal) => modal.mean[q],
        }
    }
}
/// Returns true if products in blocks are faster for this number of axes.
fn multiplies_in_blocks(axes: usize) -> bool {
    axes >= 12
}
