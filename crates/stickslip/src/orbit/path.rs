//! A motion that can be evaluated at any time.

use super::Symmetry;
use crate::law::{Contact, MOST_DIRECTIONS};
use nalgebra::DMatrix;

/// The state of a motion at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Displacements, length n, m.
    pub displacement: Vec<f64>,
    /// Velocities, length n, m/s.
    pub velocity: Vec<f64>,
    /// Accelerations, length n, m/s².
    pub acceleration: Vec<f64>,
    /// The joints.
    pub joints: Vec<JointSample>,
    /// Displacement of, and force that moves, each place with imposed motion: m, N.
    pub moved: Vec<(f64, f64)>,
}

/// A joint at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSample {
    /// Relative displacement, m; along the joint's directions, as many as it has, like all that follows.
    pub displacement: [f64; MOST_DIRECTIONS],
    /// Relative velocity, m/s.
    pub velocity: [f64; MOST_DIRECTIONS],
    /// Force, N.
    pub force: [f64; MOST_DIRECTIONS],
    /// Stick, slip or apart.
    pub contact: Contact,
}

impl JointSample {
    /// Of a joint with one direction.
    pub fn along(displacement: f64, velocity: f64, force: f64, contact: Contact) -> Self {
        let first = |value: f64| [value, 0.0, 0.0];
        JointSample { displacement: first(displacement), velocity: first(velocity), force: first(force), contact }
    }

    /// Power that the joint takes, W.
    pub fn power(&self) -> f64 {
        self.force.iter().zip(self.velocity).map(|(f, v)| f * v).sum()
    }
}

/// A motion that can be evaluated at any time of its period; with [`Orbit::new`](super::Orbit::new) the motion of a method from elsewhere becomes an orbit.
pub trait Path: Send + Sync {
    /// The state at `time` in `[0, T)`.
    fn sample(&self, time: f64) -> Sample;
    /// The instants at which something switches, in `[0, T)`, rising.
    fn switch_times(&self) -> Vec<f64>;
    /// The derivative of the return from `start`, of a method that makes none by itself; `None` if there is none.
    fn return_map(&self, _start: &[f64], _symmetry: Symmetry) -> Option<DMatrix<f64>> {
        None
    }
    /// How far an independent motion from `start` is from it after a return, relative to the vibration, of a method that finds its orbits in another
    /// way than by motion; `None` if nothing follows it.
    fn return_defect(&self, _start: &[f64], _symmetry: Symmetry) -> Option<f64> {
        None
    }
}
