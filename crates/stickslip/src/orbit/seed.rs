//! A neighbouring orbit, from which the search for the next one begins.

use super::Orbit;
use num_complex::Complex64;
use std::sync::Arc;

/// An orbit from which the search for a neighbouring orbit begins.
///
/// It carries everything that helps this search. A cheap clone shares the series.
///
/// # Example
/// ```
/// use stickslip::method::{Method, event_driven::EventDriven};
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let mut solver = EventDriven.solver(&system).unwrap();
/// let orbit = solver.orbit(760.0).unwrap();
/// let next = solver.orbit_near(761.0, Some(&orbit.seed())).unwrap();
/// assert!(next.evidence.residual < 1e-9);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Seed {
    /// Excitation frequency of the orbit, rad/s.
    pub omega: f64,
    /// State at t = 0: displacements (m), velocities (m/s), then the states of the joints.
    pub state: Vec<f64>,
    /// Amplitude (m) and first harmonic of every place; empty if they are unknown.
    pub(crate) places: Vec<(f64, Complex64)>,
    /// Series of the joints, if harmonic balance found the orbit.
    pub(crate) series: Option<Arc<JointSeries>>,
    /// True if the second method of `auto` found the orbit.
    pub(crate) by_fallback: bool,
}

impl Seed {
    /// Creates a seed from a state that need not belong to an orbit of the solver.
    pub fn from_state(omega: f64, state: Vec<f64>) -> Self {
        Seed { omega, state, places: Vec::new(), series: None, by_fallback: false }
    }

    /// Removes the series, which takes most of the memory of a large system.
    pub fn drop_series(&mut self) {
        self.series = None;
    }
}

/// Fourier series of the relative motions and forces of the joints.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JointSeries {
    pub highest_harmonic: usize,
    /// Harmonics of the motions along the axes, [axis][harmonic], m.
    pub motions: Vec<Complex64>,
    /// Harmonics of the forces along them, N.
    pub forces: Vec<Complex64>,
}

impl Orbit {
    /// Returns the orbit as the beginning of the search for a neighbouring one.
    pub fn seed(&self) -> Seed {
        Seed {
            omega: self.omega,
            state: self.initial_state.clone(),
            places: self.places.iter().map(|place| (place.amplitude(), place.first_harmonic)).collect(),
            series: self.series.clone(),
            by_fallback: self.evidence.fallback_from.is_some(),
        }
    }
}
