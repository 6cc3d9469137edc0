//! Radau IIA of order 5: the coefficients of the stiff integrator, and interpolation between its steps.
//!
//! Source: Hairer and Wanner, "Solving Ordinary Differential Equations II" (1996), Sec. IV.5 and IV.8.

/// Number of stages.
pub const STAGES: usize = 3;

const SQRT6: f64 = 2.449_489_742_783_178;

/// Nodes within a step; the last is the step's end.
pub const C: [f64; STAGES] = [(4.0 - SQRT6) / 10.0, (4.0 + SQRT6) / 10.0, 1.0];

/// Matrix of the method; its last row is also the quadrature of order 5 over the step.
pub const A: [[f64; STAGES]; STAGES] = [
    [(88.0 - 7.0 * SQRT6) / 360.0, (296.0 - 169.0 * SQRT6) / 1800.0, (-2.0 + 3.0 * SQRT6) / 225.0],
    [(296.0 + 169.0 * SQRT6) / 1800.0, (88.0 + 7.0 * SQRT6) / 360.0, (-2.0 - 3.0 * SQRT6) / 225.0],
    [(16.0 - SQRT6) / 36.0, (16.0 + SQRT6) / 36.0, 1.0 / 9.0],
];

/// Weights of the stage increments in the embedded error estimate of order 3.
pub const ERROR: [f64; STAGES] = [-(13.0 + 7.0 * SQRT6) / 3.0, (-13.0 + 7.0 * SQRT6) / 3.0, -1.0 / 3.0];

/// The real eigenvalue of the inverse of [`A`]; the error estimate is filtered by `(REAL/h - J)⁻¹`.
/// `30 / (6 + 81^(1/3) - 9^(1/3))`
pub const REAL: f64 = 3.637_834_252_744_496;

/// `A²`, for displacements from accelerations.
pub fn squared() -> [[f64; STAGES]; STAGES] {
    let mut out = [[0.0; STAGES]; STAGES];
    for i in 0..STAGES {
        for j in 0..STAGES {
            out[i][j] = (0..STAGES).map(|k| A[i][k] * A[k][j]).sum();
        }
    }
    out
}

/// Value, first and second derivative at `s` in [0, 1] of the quintic with given value, slope and curvature at both ends of a
/// step of length `h`. Its error is of order `h⁶`.
///
/// # Example
/// ```
/// let (x, v, _) = stickslip_numerics::radau::quintic(0.5, 2.0, [0.0, 1.0, 0.0], [2.0, 1.0, 0.0]);
/// assert!((x - 1.0).abs() < 1e-15 && (v - 1.0).abs() < 1e-15);   // a straight line
/// ```
pub fn quintic(s: f64, h: f64, start: [f64; 3], end: [f64; 3]) -> (f64, f64, f64) {
    let (v0, a0) = (start[1] * h, start[2] * h * h);
    let (v1, a1) = (end[1] * h, end[2] * h * h);
    let rise = end[0] - start[0];
    // x = x0 + v0 s + a0 s²/2 + c3 s³ + c4 s⁴ + c5 s⁵
    let c3 = 10.0 * rise - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
    let c4 = -15.0 * rise + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
    let c5 = 6.0 * rise - 3.0 * (v0 + v1) - 0.5 * (a0 - a1);
    let x = start[0] + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))));
    let v = v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)));
    let a = a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5));
    (x, v / h, a / (h * h))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Collocation: `Σ_j a_ij c_j^(k-1) = c_i^k / k` for k = 1, 2, 3, and the quadrature is exact to degree 4.
    #[test]
    fn coefficients_satisfy_the_order_conditions() {
        for i in 0..STAGES {
            for k in 1..=3 {
                let sum: f64 = (0..STAGES).map(|j| A[i][j] * C[j].powi(k - 1)).sum();
                assert!((sum - C[i].powi(k) / f64::from(k)).abs() < 1e-15, "stage {i}, degree {k}");
            }
        }
        for k in 1..=5 {
            let sum: f64 = (0..STAGES).map(|j| A[2][j] * C[j].powi(k - 1)).sum();
            assert!((sum - 1.0 / f64::from(k)).abs() < 1e-15, "degree {k}");
        }
        assert!((REAL - 30.0 / (6.0 + 81f64.cbrt() - 9f64.cbrt())).abs() < 1e-14);
    }
}
