//! Radau IIA of order 9: coefficients of the stiff integrator, and interpolation within a step.
//!
//! Source: Hairer and Wanner, "Solving Ordinary Differential Equations II" (1996), Sec. IV.5
//! and IV.8; for five stages Hairer and Wanner, "Stiff differential equations solved by Radau
//! methods", J. Comput. Appl. Math. 111 (1999) 93-111.

/// Number of stages.
pub const STAGES: usize = 5;

/// Nodes within a step: the zeros of `d⁴/dx⁴ (x⁴ (x - 1)⁵)`. The last is the end of the step.
pub const NODES: [f64; STAGES] =
    [0.057_104_196_114_517_68, 0.276_843_013_638_123_8, 0.583_590_432_368_916_8, 0.860_240_135_656_219_5, 1.0];

/// Matrix of the method, `∫₀^cᵢ ℓⱼ` with the Lagrange polynomials ℓ of the nodes. Its last row
/// is the quadrature of order 9 over the step.
pub const BUTCHER_MATRIX: [[f64; STAGES]; STAGES] = [
    [
        0.072_998_864_317_903_33,
        -0.026_735_331_107_945_57,
        0.018_676_929_763_984_353,
        -0.012_879_106_093_306_44,
        0.005_042_839_233_882_015,
    ],
    [
        0.153_775_231_479_182_46,
        0.146_214_867_847_493_52,
        -0.036_444_568_905_128_09,
        0.021_233_063_119_304_72,
        -0.007_935_579_902_728_777,
    ],
    [
        0.140_063_045_684_809_87,
        0.298_967_129_491_283_46,
        0.167_585_070_135_248_95,
        -0.033_969_101_686_617_74,
        0.010_944_288_744_192_253,
    ],
    [
        0.144_894_308_109_534_77,
        0.276_500_068_760_159_2,
        0.325_797_922_910_421_03,
        0.128_756_753_254_909_76,
        -0.015_708_917_378_805_327,
    ],
    [0.143_713_560_791_225_94, 0.281_356_015_149_462_07, 0.311_826_522_975_741_26, 0.223_103_901_083_570_75, 0.04],
];

/// Weights of the stage increments in the embedded error estimate of order 5. For a polynomial
/// of degree 5 the weighted sum is minus its slope at the start.
pub const ERROR_WEIGHTS: [f64; STAGES] =
    [-27.780_933_944_064_64, 3.641_478_498_049_213, -1.252_547_721_169_118_7, 0.592_003_167_184_542_8, -0.2];

/// Order of the embedded estimate in the step size h: the estimate vanishes like `h⁶`.
pub const ESTIMATE_ORDER: i32 = STAGES as i32 + 1;

/// The real eigenvalue of the inverse of [`BUTCHER_MATRIX`]. The error estimate is filtered by
/// `(γ - J)⁻¹` with γ = `REAL_EIGENVALUE / h`.
pub const REAL_EIGENVALUE: f64 = 6.286_704_751_729_276_5;

/// Returns `A²`, which gives displacements from accelerations.
pub fn matrix_squared() -> [[f64; STAGES]; STAGES] {
    let mut out = [[0.0; STAGES]; STAGES];
    for i in 0..STAGES {
        for j in 0..STAGES {
            out[i][j] = (0..STAGES).map(|k| BUTCHER_MATRIX[i][k] * BUTCHER_MATRIX[k][j]).sum();
        }
    }
    out
}

/// Interpolates by the quintic with given value, slope and curvature at both
/// ends of a step of length `h`.
///
/// Returns its value, first and second derivative at `s` in [0, 1]. The
/// interpolation error is of order `h⁶`.
///
/// # Example
/// ```
/// let (x, v, _) = stickslip_numerics::radau::quintic(0.5, 2.0, [0.0, 1.0, 0.0], [2.0, 1.0, 0.0]);
/// assert!((x - 1.0).abs() < 1e-15 && (v - 1.0).abs() < 1e-15); // a straight line
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

    /// The nodes are the zeros of `d⁴/dx⁴ (x⁴ (x - 1)⁵)`, which is proportional to
    /// `126 x⁵ - 350 x⁴ + 350 x³ - 150 x² + 25 x - 1`.
    #[test]
    fn nodes_are_those_of_radau() {
        for x in NODES {
            let value = ((((126.0 * x - 350.0) * x + 350.0) * x - 150.0) * x + 25.0) * x - 1.0;
            assert!(value.abs() < 350.0 * 4.0 * f64::EPSILON, "{x}: {value}");
        }
    }

    /// Collocation: `Σ_j a_ij c_j^(k-1) = c_i^k / k` for k up to the number of
    /// stages. The quadrature is exact up to degree 8.
    #[test]
    fn coefficients_satisfy_the_order_conditions() {
        for i in 0..STAGES {
            for k in 1..=STAGES as i32 {
                let sum: f64 = (0..STAGES).map(|j| BUTCHER_MATRIX[i][j] * NODES[j].powi(k - 1)).sum();
                assert!((sum - NODES[i].powi(k) / f64::from(k)).abs() < 1e-15, "stage {i}, degree {k}");
            }
        }
        for k in 1..=9 {
            let sum: f64 = (0..STAGES).map(|j| BUTCHER_MATRIX[STAGES - 1][j] * NODES[j].powi(k - 1)).sum();
            assert!((sum - 1.0 / f64::from(k)).abs() < 1e-15, "degree {k}");
        }
    }

    /// For increments of polynomials up to degree 5 the estimate is minus the slope at the start.
    #[test]
    fn the_estimate_vanishes_to_order_five() {
        for k in 1..=STAGES as i32 {
            let sum: f64 = ERROR_WEIGHTS.iter().zip(NODES).map(|(weight, c)| weight * c.powi(k)).sum();
            assert!((sum + if k == 1 { 1.0 } else { 0.0 }).abs() < 1e-14, "degree {k}: {sum}");
        }
    }

    /// The denominator of the stability function, the (4,5) Padé approximation of the
    /// exponential, vanishes at the real eigenvalue.
    #[test]
    fn the_real_eigenvalue_is_a_pole() {
        let mut term = 1.0;
        let mut sum = 1.0;
        for j in 1..=STAGES {
            let (left, of) = ((STAGES + 1 - j) as f64, (2 * STAGES - j) as f64);
            term *= -REAL_EIGENVALUE * left / (of * j as f64);
            sum += term;
        }
        assert!(sum.abs() < 1e-14, "{sum}");
    }
}
