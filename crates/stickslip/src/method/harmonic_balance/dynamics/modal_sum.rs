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
    /// positive definite or modes coincide. The equations are then solved at every frequency.
    pub fn new(system: &System, direction: &DMatrix<f64>) -> Option<Self> {
        let n = system.dofs();
        // M = L Lᵀ; in q = Lᵀ x the mass matrix is the identity
        let factor = system.structure().mass().clone().cholesky()?;
        let to = factor.l().solve_lower_triangular(&DMatrix::identity(n, n))?;
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
