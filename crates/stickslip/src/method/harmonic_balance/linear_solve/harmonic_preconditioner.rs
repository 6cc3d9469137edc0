//! Preconditioner with one complex matrix over the axes for each harmonic.
//!
//! It has the equations with the mean stiffness of every joint over the period. Rigid friction
//! couples the lowest harmonics by more than their mean; these harmonics are factored together.

use super::linearization::LinearizedEquations;
use crate::method::harmonic_balance::aft::Ports;
use nalgebra::DMatrix;
use num_complex::Complex64;
use stickslip_numerics::dense::{ComplexLu, DenseLu};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Settings of the preconditioner.
#[derive(Debug, Clone, Copy)]
pub(super) struct HarmonicPreconditionerSettings {
    /// Number of unknowns of the lowest harmonics that are factored together to precondition a
    /// step with long series. Measured: with a quarter of the harmonics a step takes 80 products,
    /// with an eighth 150. With none, each harmonic by its mean, it does not converge in hundreds.
    pub lowest_unknowns: usize,
}

impl Default for HarmonicPreconditionerSettings {
    fn default() -> Self {
        HarmonicPreconditionerSettings { lowest_unknowns: 1000 }
    }
}

/// Preconditioner with the lowest harmonics together, and the others one by one.
#[derive(Debug, Clone)]
pub(super) struct HarmonicPreconditioner {
    lowest: LowestHarmonicsFactor,
    others: Vec<ComplexLu>,
}

impl HarmonicPreconditioner {
    /// Factors the equations at a motion. `None` if a harmonic is singular.
    pub fn new(linear: &LinearizedEquations, receptance: &[DMatrix<Complex64>]) -> Option<Self> {
        let lowest = lowest_harmonics(linear, receptance)?;
        let rest = receptance.iter().enumerate().skip(lowest.count);
        let others = rest.map(|(k, matrix)| harmonic_block(linear, k, matrix)).collect::<Option<_>>()?;
        Some(HarmonicPreconditioner { lowest, others })
    }

    /// Replaces a residual in units by a step in units.
    pub fn apply(&self, linear: &LinearizedEquations, v: &mut [f64]) {
        let pair = 2 * linear.harmonics.len();
        let count = self.lowest.count;
        let together = self.lowest.apply(v, pair);
        linear.multiply_by_residual_units(v);
        let mut column = vec![ZERO; v.len() / pair];
        for (k, factor) in (count..).zip(&self.others) {
            for (c, v) in column.iter_mut().zip(v.chunks_exact(pair)) {
                *c = Complex64::new(v[2 * k], v[2 * k + 1]);
            }
            factor.solve(&mut column);
            for (c, v) in column.iter().zip(v.chunks_exact_mut(pair)) {
                (v[2 * k], v[2 * k + 1]) = (c.re, c.im);
            }
        }
        linear.divide_by_step_units(v);
        if count > 0 {
            let steps = v.chunks_exact_mut(pair).zip(together.chunks_exact(2 * count));
            steps.for_each(|(v, own)| v[..2 * count].copy_from_slice(own));
        }
    }

    /// Returns its memory, bytes.
    #[cfg(test)]
    pub fn bytes(&self) -> usize {
        self.others.iter().map(ComplexLu::bytes).sum::<usize>() + self.lowest.transposed.bytes()
    }
}

/// Returns the number of entries in the factor of the lowest harmonics.
pub(crate) fn lowest_factor_entries(ports: &Ports, harmonics: usize) -> usize {
    (2 * ports.count() * lowest_count(ports, harmonics)).pow(2)
}

/// Returns the number of lowest harmonics that are factored together; zero if it would be one.
fn lowest_count(ports: &Ports, harmonics: usize) -> usize {
    let settings = HarmonicPreconditionerSettings::default();
    let count = if ports.has_forces() { settings.lowest_unknowns / (2 * ports.count()) } else { 0 };
    if count < 2 { 0 } else { count.min(harmonics) }
}

/// Factors the equations of the lowest harmonics, if forces are unknown.
fn lowest_harmonics(linear: &LinearizedEquations, receptance: &[DMatrix<Complex64>]) -> Option<LowestHarmonicsFactor> {
    let count = lowest_count(linear.ports, linear.harmonics.len());
    let mut matrix = Vec::new();
    linear.matrix(receptance, count, (&mut Vec::new(), &mut matrix));
    // the matrix is row-major: its transpose is factored
    let transposed = DenseLu::new(matrix, 2 * count * linear.ports.count()).ok()?;
    Some(LowestHarmonicsFactor { count, transposed })
}

/// Factors the equations of one harmonic with the mean tangents.
fn harmonic_block(linear: &LinearizedEquations, k: usize, receptance: &DMatrix<Complex64>) -> Option<ComplexLu> {
    let size = receptance.nrows();
    let moved = |q: usize| &receptance.as_slice()[q * size..][..size];
    let mut matrix = vec![ZERO; size * size];
    // R f_y
    for (p, port) in linear.ports.iter().enumerate() {
        for b in 0..port.axes {
            let column = &mut matrix[(port.first_axis + b) * size..][..size];
            if port.is_force() {
                column.copy_from_slice(moved(port.first_axis + b));
                continue;
            }
            for a in 0..port.axes {
                let stiffness = linear.mean(linear.tangent(p, port), port.axes, a, b, k);
                column.iter_mut().zip(moved(port.first_axis + a)).for_each(|(out, r)| *out += r * stiffness);
            }
        }
    }
    let h = linear.harmonics[k];
    for (p, port) in linear.ports.iter().enumerate() {
        if !port.is_force() {
            port.range().for_each(|q| matrix[q * size + q] += 1.0);
            continue;
        }
        let rate = linear.contacts[p].motion_derivative(h, linear.omega);
        let turn: Vec<Complex64> = (0..port.axes * port.axes)
            .map(|ab| linear.mean(linear.tangent(p, port), port.axes, ab / port.axes, ab % port.axes, k))
            .collect();
        for column in matrix.chunks_exact_mut(size) {
            let moved: Vec<Complex64> = port.range().map(|q| column[q] * rate).collect();
            for (a, q) in port.range().enumerate() {
                column[q] = (0..port.axes).map(|b| turn[a * port.axes + b] * moved[b]).sum();
            }
        }
        for (a, q) in port.range().enumerate() {
            matrix[q * size + q] += 1.0 + linear.homotopy.diagonal_term(h);
            for (b, column) in port.range().enumerate() {
                matrix[column * size + q] -= turn[a * port.axes + b];
            }
        }
    }
    ComplexLu::new(matrix, size).ok()
}

/// The factor of the lowest harmonics together.
#[derive(Debug, Clone)]
struct LowestHarmonicsFactor {
    count: usize,
    /// The transposed Jacobian, in units.
    transposed: DenseLu<f64>,
}

impl LowestHarmonicsFactor {
    /// Returns the step of these harmonics alone, from the residual of all; both in units.
    fn apply(&self, v: &[f64], pair: usize) -> Vec<f64> {
        let mut own: Vec<f64> = v.chunks_exact(pair).flat_map(|v| &v[..2 * self.count]).copied().collect();
        self.transposed.solve_adjoint(&mut own);
        own
    }
}
