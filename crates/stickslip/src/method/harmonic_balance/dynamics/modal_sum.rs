//! Modes of a small structure: its response at every frequency is a sum over them.

use super::factored::FactoredDynamics;
use super::harmonic_dynamics::{Directions, HarmonicDynamics, columns, diagonal, rate};
use super::uncoupled_modes::UndampedResonance;
use crate::method::harmonic_balance::equations::regularization::REGULARIZING_FREQUENCY;
use crate::model::System;
use crate::structure::Structure;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use stickslip_numerics::quadratic_modes::QuadraticModes;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Modes `(λ, φ)` of `M x'' + C x' + K x`, and their components along the axes.
///
/// The response to `Re(F e^{st})` is the sum of `φ (ψᵀF) / (s - λ)`. A frequency costs the number
/// of modes times the square of the number of axes, and no matrix is factored.
#[derive(Debug, Clone)]
pub(super) struct ComplexModes {
    lambda: Vec<Complex64>,
    /// Right modes, n × modes, and left modes, modes × n.
    shape: DMatrix<Complex64>,
    left: DMatrix<Complex64>,
    /// Their components along the axes: q × modes, and modes × q.
    shape_along: DMatrix<Complex64>,
    left_along: DMatrix<Complex64>,
    /// Free directions, n × r, and their components along the axes, r × q.
    free: DMatrix<f64>,
    free_along: DMatrix<f64>,
    structure: Structure,
    directions: Directions,
}

impl ComplexModes {
    /// Computes the modes in the structure's coordinates. `None` if the mass matrix is not
    /// positive definite, nearly singular, or if modes coincide. The equations are then solved
    /// at every frequency.
    pub fn new(system: &System, directions: &Directions) -> Option<Self> {
        let n = system.dofs();
        let direction = &columns(n, directions);
        // M = L Lᵀ; in q = Lᵀ x the mass matrix is the identity
        let mass = system.structure().mass();
        let lower = mass.clone().cholesky()?.l();
        // These coordinates lose the digits that the pivots lack, relative to the diagonal. With
        // 1e-6, the sum keeps ten digits. Pivots of consistent and reduced mass matrices are above
        // 1e-3; those of nearly massless motions are below.
        if (0..n).any(|i| lower[(i, i)].powi(2) < 1e-6 * mass[(i, i)]) {
            return None;
        }
        let to = lower.solve_lower_triangular(&DMatrix::identity(n, n))?;
        let back = to.transpose();
        let modes = QuadraticModes::new(
            &(&to * system.structure().damping() * &back),
            &(&to * system.structure().stiffness() * &back),
        )
        .ok()?;
        let complex = |matrix: &DMatrix<f64>| matrix.map(|w| Complex64::new(w, 0.0));
        let shape = complex(&back) * modes.shape;
        let left = modes.from_velocity * complex(&to);
        let free = back * modes.free;
        let along = complex(direction);
        Some(ComplexModes {
            shape_along: along.transpose() * &shape,
            left_along: &left * along,
            free_along: free.transpose() * direction,
            lambda: modes.lambda,
            shape,
            left,
            free,
            structure: system.structure().clone(),
            directions: directions.clone(),
        })
    }

    fn receptance_at(&self, s: Complex64, omega: f64) -> DMatrix<Complex64> {
        let q = self.directions.len();
        let mut sum = DMatrix::from_element(q, q, ZERO);
        for (m, &lambda) in self.lambda.iter().enumerate() {
            let (up, down) = partial_fractions(s, lambda, omega);
            for b in 0..q {
                for a in 0..q {
                    let product = self.shape_along[(a, m)] * self.left_along[(m, b)];
                    sum[(a, b)] += (product * up + product.conj() * down) * 0.5;
                }
            }
        }
        let free = rigid_body_fraction(s, omega);
        for r in 0..self.free_along.nrows() {
            for b in 0..q {
                for a in 0..q {
                    sum[(a, b)] += self.free_along[(r, a)] * self.free_along[(r, b)] * free;
                }
            }
        }
        sum
    }
}

impl HarmonicDynamics for ComplexModes {
    fn receptance(&self, harmonic: usize, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        Ok(self.receptance_at(rate(harmonic, omega), omega))
    }

    fn respond(
        &self,
        harmonic: usize,
        omega: f64,
        force: &DVector<Complex64>,
    ) -> Result<DVector<Complex64>, UndampedResonance> {
        let (s, n) = (rate(harmonic, omega), force.len());
        let mut x = DVector::from_element(n, ZERO);
        for (m, &lambda) in self.lambda.iter().enumerate() {
            let (up, down) = partial_fractions(s, lambda, omega);
            let (mut one, mut two) = (ZERO, ZERO);
            for i in 0..n {
                one += self.left[(m, i)] * force[i];
                two += self.left[(m, i)].conj() * force[i];
            }
            let (one, two) = (one * up * 0.5, two * down * 0.5);
            for i in 0..n {
                x[i] += self.shape[(i, m)] * one + self.shape[(i, m)].conj() * two;
            }
        }
        let free = rigid_body_fraction(s, omega);
        for r in 0..self.free.ncols() {
            let push: Complex64 = (0..n).map(|i| force[i] * self.free[(i, r)]).sum::<Complex64>() * free;
            for i in 0..n {
                x[i] += push * self.free[(i, r)];
            }
        }
        Ok(x)
    }

    /// Not from modes: for damped free motions, their rounding acts as a stiffness.
    fn static_receptances(&self, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        FactoredDynamics::new(&self.structure, &self.directions).static_receptances(omega)
    }

    fn direct_receptances(&self, rate: f64, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        Ok(diagonal(&self.receptance_at(Complex64::new(rate, 0.0), omega)))
    }

    fn natural_frequencies(&self) -> Vec<f64> {
        self.lambda.iter().map(|lambda| lambda.im.abs()).collect()
    }
}

/// Returns `1/(s - λ)` and `1/(s - λ*)`, limited near a pole.
fn partial_fractions(s: Complex64, lambda: Complex64, omega: f64) -> (Complex64, Complex64) {
    let hold = REGULARIZING_FREQUENCY * REGULARIZING_FREQUENCY * omega;
    let one = |d: Complex64| if d.norm() < hold { Complex64::new(1.0 / hold, 0.0) } else { 1.0 / d };
    (one(s - lambda), one(s - lambda.conj()))
}

/// Returns `1/s²`; at rest, the value with the soft spring.
fn rigid_body_fraction(s: Complex64, omega: f64) -> Complex64 {
    if s == ZERO { Complex64::new((REGULARIZING_FREQUENCY * omega).powi(-2), 0.0) } else { 1.0 / (s * s) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::{Method, harmonic_balance::HarmonicBalance};
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use nalgebra::{dmatrix, dvector};

    /// A combination of three places has almost no mass, as after a rigid link with rounding.
    /// The response is that of the dynamic stiffness. By the modal sum it was up to 14 times as
    /// large.
    #[test]
    fn nearly_massless_combinations_have_the_response_of_the_dynamic_stiffness() {
        let stiffness = dmatrix![6.58e6, -2.52e6, 0.19e6; -2.52e6, 6.55e6, -0.04e6; 0.19e6, -0.04e6, 3.11e6];
        let links = dmatrix![0.6, 0.2, -0.1; 0.3, 0.9, -0.33];
        let combination: DVector<f64> = dvector![0.024, 0.168, 0.48];
        let massless = combination.normalize();
        assert!((&links * &massless).norm() < 1e-15);
        for mass in [0.0, 1e-17, 1e-15, 1e-13, 1e-9, 1e-6, 1e-3] {
            let mass = links.transpose() * &links + &massless * massless.transpose() * mass;
            let omega = 1000.0;
            let expected = (&stiffness - &mass * (omega * omega)).lu().solve(&dvector![1.0, 0.0, 0.0]).unwrap();
            let names = ["a", "b", "c"].map(String::from).to_vec();
            let structure = Structure::new(names, mass, DMatrix::zeros(3, 3), stiffness.clone()).unwrap();
            let mut builder = System::builder(structure).force(0, 1, Complex64::new(1.0, 0.0));
            for (i, name) in ["a", "b", "c"].into_iter().enumerate() {
                builder = builder.place(name, Axis::new(vec![(i, 1.0)]));
            }
            let system = builder.build().unwrap();
            let orbit = HarmonicBalance::default().solver(&system).unwrap().orbit(omega).unwrap();
            for (place, expected) in orbit.places.iter().zip(&expected) {
                let error = (place.amplitude() - expected.abs()).abs() / expected.abs();
                assert!(error < 1e-9, "{}: {error:.1e}", place.name);
            }
        }
    }
}
