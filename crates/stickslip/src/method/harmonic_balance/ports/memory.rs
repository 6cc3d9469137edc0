//! Memory that a march through the samples needs again and again.

use num_complex::Complex64;

/// Distance of the states from those a period later, relative to their size, at which they repeat: the rounding of a thousand steps.
pub(in super::super) const REPEATS: f64 = 1e-12;

/// Memory of a march.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct Memory {
    /// Derivatives of every step.
    pub(super) rows: Vec<f64>,
    /// Those of the first movement.
    pub(super) first: Vec<f64>,
    /// Forces by the states at t = 0, per sample.
    pub(super) by_state: Vec<f64>,
    /// What the harmonics of a motion make of the inputs.
    pub(super) waves: Vec<f64>,
    /// Of which steps these are.
    pub(super) steps: Vec<[Complex64; 4]>,
    /// Forces by inputs: [sample][axis][column].
    pub(super) columns: Vec<f64>,
    /// Changes of the states at t = 0 that go with these columns, [state][column].
    pub(super) shift: Vec<f64>,
    /// One of the columns over the samples.
    pub(super) signal: Vec<f64>,
    /// From samples to harmonics, and these.
    pub(super) projection: Vec<f64>,
    pub(super) spectrum: Vec<f64>,
    /// Harmonics of the forces by the states at t = 0.
    pub(super) of_states: Vec<f64>,
}
