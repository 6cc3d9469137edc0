//! Memory that a march through the samples needs again and again.

use num_complex::Complex64;

/// Distance of the states from those a period later, relative to their size, at which they repeat: the rounding of a thousand steps.
pub(in super::super) const REPEATS: f64 = 1e-12;

/// Memory in which the derivatives by the harmonics of a motion are followed, bytes: of those of a long series, some after the others.
const AT_ONCE: f64 = 2.5e8;

/// Harmonics of a motion by which the forces of a law at so many samples are derived at once, and what that takes, bytes.
pub(in super::super) fn at_once(axes: usize, samples: usize, harmonics: usize) -> (usize, f64) {
    // parts of the forces at all samples, and what the harmonics make of the inputs
    let each = 8.0 * 2.0 * (axes * axes) as f64 * samples as f64;
    let count = harmonics.min((AT_ONCE / each) as usize).max(1);
    (count, each * count as f64)
}

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
