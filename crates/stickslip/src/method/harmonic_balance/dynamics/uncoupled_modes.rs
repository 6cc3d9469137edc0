//! Receptance by uncoupled modes, for large structures whose damping does not couple their
//! modes.
//!
//! `R(s) = Φ diag(1 / (m s² + c s + k)) Φᵀ`, with the axes by modes, Φ, which the structure
//! keeps. Φ is real and the same at all frequencies, and no matrix is factored at any
//! frequency.

use super::harmonic_dynamics::{HarmonicDynamics, diagonal, rate};
use crate::method::harmonic_balance::equations::regularization::REGULARIZING_FREQUENCY;
use crate::structure::{Structure, UncoupledModes};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::dense::{ProductShape, Transpose, multiply_blocked};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Singular dynamic stiffness: a resonance without damping.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct UndampedResonance;

/// Structure in modal coordinates.
#[derive(Debug, Clone)]
pub(crate) struct UncoupledDynamics {
    modes: Arc<UncoupledModes>,
    /// Axes by modes, p × n, column by column.
    pub at: Vec<f64>,
    pub axes: usize,
}

impl UncoupledDynamics {
    /// Returns `None` if damping couples the modes, or if there are too many.
    pub fn new(structure: &Structure, directions: &[Vec<(usize, f64)>]) -> Option<Self> {
        let modes = structure.uncoupled()?.clone();
        let (n, axes) = (structure.dofs(), directions.len());
        let mut at = vec![0.0; axes * n];
        for (q, rows) in directions.iter().enumerate() {
            rows.iter().for_each(|&(i, w)| at[i * axes + q] += w);
        }
        if let Some(shapes) = &modes.shapes {
            let along = std::mem::replace(&mut at, vec![0.0; axes * n]);
            multiply_blocked(
                &along,
                shapes.as_slice(),
                &mut at,
                ProductShape { rows: axes, inner: n, columns: n },
                Transpose::No,
            );
        }
        Some(UncoupledDynamics { modes, at, axes })
    }

    /// Returns modal mass, damping and stiffness.
    pub fn modal_coefficients(&self) -> &[[f64; 3]] {
        &self.modes.own
    }

    /// Returns `m s² + c s + k` of mode `m`, with the regularizing spring at `s = 0`.
    ///
    /// # Errors
    /// A resonance without damping.
    pub fn stiffness(&self, m: usize, s: Complex64, omega: f64) -> Result<Complex64, UndampedResonance> {
        let [mass, damping, stiffness] = self.modal_coefficients()[m];
        let hold = if s == ZERO { (REGULARIZING_FREQUENCY * omega).powi(2) } else { 0.0 };
        let of_mass = (s * s + hold) * mass;
        let sum = of_mass + s * damping + stiffness;
        let size = of_mass.norm() + (s * damping).norm() + stiffness.abs();
        // Ratio of a modal dynamic stiffness to its terms below which it is rounding: a resonance
        // without damping.
        if sum.norm() > 1e-14 * size { Ok(sum) } else { Err(UndampedResonance) }
    }

    /// Returns the inverse modal dynamic stiffness of all modes.
    pub fn modal_receptances(&self, s: Complex64, omega: f64) -> Result<Vec<Complex64>, UndampedResonance> {
        (0..self.modal_coefficients().len()).map(|m| Ok(1.0 / self.stiffness(m, s, omega)?)).collect()
    }

    /// Returns the receptance of the axes, p × p.
    fn receptance_at(&self, s: Complex64, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        let (p, n) = (self.axes, self.modal_coefficients().len());
        let gains = self.modal_receptances(s, omega)?;
        let part = |read: fn(&Complex64) -> f64| {
            let columns = self.at.chunks_exact(p.max(1)).zip(&gains);
            let weighted: Vec<f64> = columns.flat_map(|(at, g)| at.iter().map(move |a| a * read(g))).collect();
            let mut product = vec![0.0; p * p];
            multiply_blocked(
                &weighted,
                &self.at,
                &mut product,
                ProductShape { rows: p, inner: n, columns: p },
                Transpose::Yes,
            );
            product
        };
        let re = part(|g| g.re);
        // at rest and along the real axis the imaginary part is zero
        let im = if gains.iter().all(|g| g.im == 0.0) { vec![0.0; p * p] } else { part(|g| g.im) };
        Ok(DMatrix::from_iterator(p, p, re.into_iter().zip(im).map(|(re, im)| Complex64::new(re, im))))
    }

    /// Returns the diagonal of the receptance.
    pub fn diagonal_receptance(&self, gains: &[Complex64]) -> Vec<Complex64> {
        let mut sum = vec![ZERO; self.axes];
        for (at, gain) in self.at.chunks_exact(self.axes.max(1)).zip(gains) {
            sum.iter_mut().zip(at).for_each(|(sum, a)| *sum += gain * (a * a));
        }
        sum
    }

    /// Returns the modal forces of forces on all places.
    pub fn modal_forces(&self, force: &DVector<f64>) -> DVector<f64> {
        self.modes.shapes.as_ref().map_or_else(|| force.clone(), |shapes| shapes.tr_mul(force))
    }

    /// Returns the displacements of all places from modal displacements.
    pub fn physical_displacements(&self, modal: &DVector<f64>) -> DVector<f64> {
        self.modes.shapes.as_ref().map_or_else(|| modal.clone(), |shapes| shapes * modal)
    }
}

impl HarmonicDynamics for UncoupledDynamics {
    fn receptance(&self, harmonic: usize, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        self.receptance_at(rate(harmonic, omega), omega)
    }

    fn respond(
        &self,
        harmonic: usize,
        omega: f64,
        force: &DVector<Complex64>,
    ) -> Result<DVector<Complex64>, UndampedResonance> {
        let gains = self.modal_receptances(rate(harmonic, omega), omega)?;
        let Some(shapes) = &self.modes.shapes else {
            return Ok(DVector::from_iterator(force.len(), force.iter().zip(&gains).map(|(f, g)| f * g)));
        };
        let modal = |read: fn(&Complex64) -> f64| shapes.tr_mul(&force.map(|f| read(&f)));
        let (re, im) = (modal(|f| f.re), modal(|f| f.im));
        let moved: Vec<Complex64> =
            gains.iter().zip(re.iter().zip(im.iter())).map(|(g, (re, im))| g * Complex64::new(*re, *im)).collect();
        let part = |read: fn(&Complex64) -> f64| shapes * DVector::from_iterator(moved.len(), moved.iter().map(read));
        Ok(part(|z| z.re).zip_map(&part(|z| z.im), Complex64::new))
    }

    fn static_receptances(&self, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        let own = self.diagonal_receptance(&self.modal_receptances(ZERO, omega)?);
        Ok(own.iter().map(|r| r.norm()).collect())
    }

    fn direct_receptances(&self, rate: f64, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        Ok(diagonal(&self.receptance_at(Complex64::new(rate, 0.0), omega)?))
    }

    fn natural_frequencies(&self) -> Vec<f64> {
        let frequency = |[mass, damping, stiffness]: &[f64; 3]| {
            let decay = 0.5 * damping / mass;
            (stiffness / mass - decay * decay).max(0.0).sqrt()
        };
        self.modal_coefficients().iter().filter(|[mass, ..]| *mass > 0.0).map(frequency).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(i: usize) -> f64 {
        ((i * 7919 + 13) as f64).sin()
    }

    /// Uncoupled modes respond like the dynamic stiffness, with massless and with free
    /// directions. Damping that couples the modes is detected.
    #[test]
    fn modal_receptance_equals_inverse_dynamic_stiffness() {
        let n = 12;
        let spread = DMatrix::from_fn(n, n - 1, |i, k| noise(i * n + k));
        let stiffness = &spread * spread.transpose();
        let mut light = DMatrix::from_fn(n, n, |i, k| noise(i + n * k + 500));
        light = &light * light.transpose() + DMatrix::identity(n, n) * 0.1;
        // no mass in two places
        for i in [3, 7] {
            light.fill_row(i, 0.0);
            light.fill_column(i, 0.0);
        }
        let damping = &light * 0.03 + &stiffness * 0.002;
        let names = || (0..n).map(|i| i.to_string()).collect::<Vec<_>>();
        let structure = Structure::new(names(), light.clone(), damping.clone(), stiffness.clone()).unwrap();
        let directions = [vec![(0, 1.0), (4, -0.5)], vec![(3, 1.0)], vec![(7, 2.0), (1, 1.0)]];
        let modes = UncoupledDynamics::new(&structure, &directions).unwrap();
        // later callers get the same modes
        assert!(Arc::ptr_eq(&modes.modes, structure.clone().uncoupled().unwrap()));
        let omega = 0.8;
        for harmonic in [1, 3] {
            let s = rate(harmonic, omega);
            let receptance = modes.receptance(harmonic, omega).unwrap();
            let gains = modes.modal_receptances(s, omega).unwrap();
            let own = modes.diagonal_receptance(&gains);
            for (b, direction) in directions.iter().enumerate() {
                let mut x = DVector::from_element(n, ZERO);
                direction.iter().for_each(|&(i, w)| x[i] += Complex64::new(w, 0.0));
                let answer = modes.respond(harmonic, omega, &x).unwrap();
                structure.dynamic_stiffness(s).unwrap().solve(x.as_mut_slice());
                let size = x.iter().map(|x| x.norm()).fold(0.0, f64::max);
                assert!(x.iter().zip(answer.iter()).all(|(x, a)| (x - a).norm() < 1e-9 * size), "{s}: {x} {answer}");
                for (a, direction) in directions.iter().enumerate() {
                    let along: Complex64 = direction.iter().map(|&(i, w)| x[i] * w).sum();
                    assert!((receptance[(a, b)] - along).norm() < 1e-9 * size);
                }
                assert!((own[b] - receptance[(b, b)]).norm() < 1e-12 * size);
            }
        }
        let mut coupled = damping;
        coupled[(0, 0)] += 0.01;
        let structure = Structure::new(names(), light, coupled, stiffness).unwrap();
        assert!(UncoupledDynamics::new(&structure, &directions).is_none());
    }
}
