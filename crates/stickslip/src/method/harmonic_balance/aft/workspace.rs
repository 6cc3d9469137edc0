//! Scratch memory for the integration of laws with memory.

/// Change of the states over a period, relative to their size, at which they
/// count as periodic: the rounding of a thousand steps.
pub(in super::super) const PERIODICITY_TOLERANCE: f64 = 1e-12;

/// Returns the number of harmonics by which the forces at all samples are
/// differentiated at once, and the memory for that, bytes.
pub(in super::super) fn derivative_batch(axes: usize, samples: usize, harmonics: usize) -> (usize, f64) {
    // forces at all samples by both parts of one harmonic
    let each = 8.0 * 2.0 * (axes * axes) as f64 * samples as f64;
    // Memory for derivatives by the harmonics of a motion, bytes. Those of a long series are
    // computed in groups of harmonics.
    let count = harmonics.min((2.5e8 / each) as usize).max(1);
    (count, each * count as f64)
}

/// Scratch memory of one evaluation.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct StepWorkspace {
    /// Derivatives of every step.
    pub(super) rows: Vec<f64>,
    /// Derivatives of the initial step.
    pub(super) first: Vec<f64>,
    /// Derivatives of the forces by the states at t = 0, per sample.
    pub(super) by_state: Vec<f64>,
    /// Derivatives of the inputs by the harmonics of a motion.
    pub(super) input_factors: Vec<f64>,
    /// Derivatives of the forces by the inputs: [sample][axis][column].
    pub(super) columns: Vec<f64>,
    /// Changes of the states at t = 0 for these columns, [state][column].
    pub(super) shift: Vec<f64>,
    /// One of the columns over the samples.
    pub(super) signal: Vec<f64>,
    /// Matrix from samples to harmonics, and the harmonics of the columns.
    pub(super) projection: Vec<f64>,
    pub(super) spectrum: Vec<f64>,
    /// Derivatives of the harmonics of the forces by the states at t = 0.
    pub(super) of_states: Vec<f64>,
}
