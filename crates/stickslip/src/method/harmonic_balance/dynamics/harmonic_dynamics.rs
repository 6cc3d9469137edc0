//! The interface of a structure's linear dynamics: motions under harmonic forces.

use super::uncoupled_modes::UndampedResonance;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::fmt::Debug;
use std::sync::Arc;

/// Rows of the coordinates that move along an axis, in ascending order, with their weights.
pub(super) type Directions = Arc<[Vec<(usize, f64)>]>;

/// Motions of a structure without its joints under forces `Re(F e^{st})`, `s = jhΩ`.
///
/// All methods fail at an undamped resonance.
pub(super) trait HarmonicDynamics: Debug {
    /// Returns the displacements along the axes under unit forces along them, q × q, m/N.
    fn receptance(&self, harmonic: usize, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance>;

    /// Returns the displacements of all places (length n, m) under forces on them, N.
    fn respond(
        &self,
        harmonic: usize,
        omega: f64,
        force: &DVector<Complex64>,
    ) -> Result<DVector<Complex64>, UndampedResonance>;

    /// Returns the displacement along each axis at rest under a constant unit force along it
    /// alone, m/N.
    fn static_receptances(&self, omega: f64) -> Result<Vec<f64>, UndampedResonance>;

    /// Returns the displacement along each axis under a unit force along it alone, m/N, at a rate
    /// (1/s) on the positive real axis, which is free of resonances.
    fn direct_receptances(&self, rate: f64, omega: f64) -> Result<Vec<f64>, UndampedResonance>;

    /// Returns the displacements of all places under unit forces along the axes, n × q, if they
    /// are known from the receptance.
    fn known_unit_responses(&self, _harmonic: usize, _omega: f64) -> Option<Arc<DMatrix<Complex64>>> {
        None
    }

    /// Returns the damped natural frequencies, rad/s, if the modes are known.
    fn natural_frequencies(&self) -> Vec<f64> {
        Vec::new()
    }
}

/// Returns the rate of a harmonic, 1/s.
pub(super) fn rate(harmonic: usize, omega: f64) -> Complex64 {
    Complex64::new(0.0, harmonic as f64 * omega)
}

/// Returns the norms of the diagonal of a receptance.
pub(super) fn diagonal(receptance: &DMatrix<Complex64>) -> Vec<f64> {
    receptance.diagonal().iter().map(|r| r.norm()).collect()
}

/// Returns the directions as columns, n × q.
pub(super) fn columns(n: usize, directions: &[Vec<(usize, f64)>]) -> DMatrix<f64> {
    let mut columns = DMatrix::zeros(n, directions.len());
    for (q, rows) in directions.iter().enumerate() {
        rows.iter().for_each(|&(i, w)| columns[(i, q)] = w);
    }
    columns
}
