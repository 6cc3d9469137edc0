//! Modes of a small structure: its response at every frequency is a sum over them.

use crate::method::harmonic_balance::equations::regularization::REGULARIZING_FREQUENCY;
use crate::model::System;
use nalgebra::DMatrix;
use num_complex::Complex64;
use stickslip_numerics::quadratic_modes::QuadraticModes;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Modes, and their components along the axes.
#[derive(Debug, Clone)]
pub(crate) struct ComplexModes {
    pub lambda: Vec<Complex64>,
    /// Right modes, n × modes, and left modes, modes × n.
    pub shape: DMatrix<Complex64>,
    pub left: DMatrix<Complex64>,
    /// Their components along the axes: q × modes, and modes × q.
    pub shape_along: DMatrix<Complex64>,
    pub left_along: DMatrix<Complex64>,
    /// Free directions, n × r, and their components along the axes, r × q.
    pub free: DMatrix<f64>,
    pub free_along: DMatrix<f64>,
}

impl ComplexModes {
    /// Computes the modes in the structure's coordinates. `None` if the mass matrix is not
    /// positive definite, nearly singular, or if modes coincide. The equations are then solved
    /// at every frequency.
    pub fn new(system: &System, direction: &DMatrix<f64>) -> Option<Self> {
        let n = system.dofs();
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
        })
    }
}

/// Returns `1/(s - λ)` and `1/(s - λ*)`, limited near a pole.
pub(crate) fn partial_fractions(s: Complex64, lambda: Complex64, omega: f64) -> (Complex64, Complex64) {
    let hold = REGULARIZING_FREQUENCY * REGULARIZING_FREQUENCY * omega;
    let one = |d: Complex64| if d.norm() < hold { Complex64::new(1.0 / hold, 0.0) } else { 1.0 / d };
    (one(s - lambda), one(s - lambda.conj()))
}

/// Returns `1/s²`; at rest, the value with the soft spring.
pub(crate) fn rigid_body_fraction(s: Complex64, omega: f64) -> Complex64 {
    if s == ZERO { Complex64::new((REGULARIZING_FREQUENCY * omega).powi(-2), 0.0) } else { 1.0 / (s * s) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::{Method, harmonic_balance::HarmonicBalance};
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use nalgebra::{DVector, dmatrix, dvector};

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
