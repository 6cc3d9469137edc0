//! A motion that can be evaluated at any time.

use super::Symmetry;
use crate::law::{Contact, MAX_DIRECTIONS};
use nalgebra::DMatrix;

/// State of a motion at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Displacements of the degrees of freedom, m.
    pub displacement: Vec<f64>,
    /// Velocities of the degrees of freedom, m/s.
    pub velocity: Vec<f64>,
    /// Accelerations of the degrees of freedom, m/s².
    pub acceleration: Vec<f64>,
    /// State of each joint.
    pub joints: Vec<JointSample>,
    /// Displacement (m) and driving force (N) of each place with imposed motion.
    pub imposed: Vec<(f64, f64)>,
}

/// State of a joint at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSample {
    /// Relative displacement in the joint's directions, m. In this and the following arrays,
    /// only the joint's directions are used.
    pub displacement: [f64; MAX_DIRECTIONS],
    /// Relative velocity, m/s.
    pub velocity: [f64; MAX_DIRECTIONS],
    /// Force, N.
    pub force: [f64; MAX_DIRECTIONS],
    /// Contact state.
    pub contact: Contact,
}

impl JointSample {
    /// Creates the state of a joint with one direction.
    pub fn one_dimensional(displacement: f64, velocity: f64, force: f64, contact: Contact) -> Self {
        let first = |value: f64| [value, 0.0, 0.0];
        JointSample { displacement: first(displacement), velocity: first(velocity), force: first(force), contact }
    }

    /// Returns the power that the joint absorbs, W.
    pub fn power(&self) -> f64 {
        self.force.iter().zip(self.velocity).map(|(f, v)| f * v).sum()
    }
}

/// A motion that can be evaluated at any time of its period. [`Orbit::new`](super::Orbit::new)
/// creates an orbit from a path of another crate.
pub trait Path: Send + Sync {
    /// Returns the state at `time` in `[0, T)`.
    fn sample(&self, time: f64) -> Sample;
    /// Returns the times of all transitions in `[0, T)`, in increasing order.
    fn transition_times(&self) -> Vec<f64>;
    /// Returns the derivative of the return map at `start`, for a method that does not compute
    /// it during its search. `None` if it is not available.
    fn return_map(&self, _start: &[f64], _symmetry: Symmetry) -> Option<DMatrix<f64>> {
        None
    }
    /// Returns the distance between an independently integrated motion from `start` and the
    /// orbit after a return, relative to the vibration. For methods without time integration.
    /// `None` if no integrator supports the system.
    fn return_defect(&self, _start: &[f64], _symmetry: Symmetry) -> Option<f64> {
        None
    }
}
