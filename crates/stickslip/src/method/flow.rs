//! Motion in time, whatever follows it: between two returns for periodic motion, stretch by stretch for transients.
//!
//! [`super::followed`] tells which flow a system's laws ask for.

use super::Breakdown;
use crate::model::System;
use crate::orbit::{Path, Symmetry};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Follows the motion of one system.
pub(crate) trait Flow: Send {
    /// Length of its state: displacements, velocities, states of the joints.
    fn states(&self) -> usize;
    /// Sets the drive frequency, rad/s; at zero only constant forces are left.
    fn set_drive(&mut self, system: &System, omega: f64);
    /// Weights of the energy norm under the drive, one for each state.
    fn weights(&self) -> Vec<f64>;
    /// Square root of an energy that the loads can give, √J.
    fn energy_scale(&self) -> f64;
    /// Sets the error per step, relative to the state, of a flow that chooses its steps by it.
    fn set_tolerance(&mut self, _tolerance: f64) {}
    /// Takes only this share of the steps of a run, of a flow in equal steps: a run that is as
    /// much shorter then has steps of the same length.
    fn set_share(&mut self, _share: f64) {}
    /// Runs from `state`, which becomes the end state, over `duration` (s) from the instant at which the drive has phase zero. `sensitivity`,
    /// if given, is multiplied from the left by the derivative of the end state with respect to the initial state.
    fn run(
        &mut self,
        state: &mut [f64],
        duration: f64,
        sensitivity: Option<&mut DMatrix<f64>>,
    ) -> Result<(), Breakdown>;
    /// Runs with an error that the flow itself keeps small: for a motion that is followed, and not closed.
    fn follow(&mut self, state: &mut [f64], duration: f64) -> Result<(), Breakdown> {
        self.run(state, duration, None)
    }
    /// Multiplies the slip limits of these joints by a factor, until it is divided by it again.
    fn strengthen(&mut self, _joints: &[usize], _factor: f64) {}
    /// Whether runs from now on are kept for [`Flow::path`].
    fn keep(&mut self, keep: bool);
    /// The motion of the last kept run, which repeats after `period` (s).
    fn path(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Arc<dyn Path>;
}
