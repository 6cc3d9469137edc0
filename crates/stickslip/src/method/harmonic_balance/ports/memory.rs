//! Memory that a march through the samples needs again and again.

use num_complex::Complex64;

/// Memory of a march.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct Memory {
    /// Derivatives of every step.
    pub(super) rows: Vec<f64>,
    /// Those of the first movement.
    pub(super) first: Vec<f64>,
    /// Forces by the states at t = 0, per sample.
    pub(super) by_state: Vec<f64>,
    pub(super) re: Vec<f64>,
    pub(super) im: Vec<f64>,
    pub(super) columns: Vec<Complex64>,
}
