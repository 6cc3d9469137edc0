//! The trait of all time integrations: motion over one return for orbits, or over successive
//! intervals for transients.
//!
//! [`integrator_choice`] chooses the integration by the laws of a system.
//!
//! The integrations:
//! - `event_flow`: event-driven motion
//! - `radau`: stiff integration (Radau IIA-9) of smooth laws
//! - `set_valued`: set-valued friction with located switches
//! - `average_acceleration`: average acceleration in equal steps
//!
//! Their common parts:
//! - `assembly`: the system as full matrices and laws with indices
//! - `excitation`: the excitation at one frequency
//! - `step_record`: the record of a run in steps
//! - `trajectory`: the recorded motion at any time

pub(super) mod assembly;
pub(super) mod average_acceleration;
pub(super) mod event_flow;
pub(super) mod excitation;
pub(super) mod integrator_choice;
pub(super) mod radau;
pub(super) mod set_valued;
pub(super) mod step_record;
pub(super) mod trajectory;

use super::IntegrationError;
use crate::model::System;
use crate::orbit::{Path, Symmetry};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Integrates the motion of one system.
pub(crate) trait Flow: Send {
    /// Returns the length of the state: displacements, velocities, states of the joints.
    fn states(&self) -> usize;
    /// Sets the excitation frequency, rad/s; at zero, only the constant forces act.
    fn set_excitation(&mut self, system: &System, omega: f64);
    /// Returns the weights of the energy norm under the excitation, one per state.
    fn weights(&self) -> Vec<f64>;
    /// Returns the square root of an energy that the loads can supply, √J.
    fn energy_scale(&self) -> f64;
    /// Sets the error relative to the state: per step of a flow with controlled steps, per
    /// interval of [`Flow::run_accurately`] in equal steps.
    fn set_tolerance(&mut self, _tolerance: f64) {}
    /// Tells whether the flow takes equal steps, whose error it does not control.
    fn has_equal_steps(&self) -> bool {
        false
    }
    /// Sets the fraction of the steps of a full run, for a flow in equal steps. A run over the
    /// same fraction of the duration then keeps the step length.
    fn set_step_fraction(&mut self, _share: f64) {}
    /// Integrates from `state` over `duration` (s), beginning at excitation phase zero, and
    /// replaces `state` by the end state. `sensitivity`, if given, is multiplied from the left
    /// by the derivative of the end state by the initial state.
    fn run(
        &mut self,
        state: &mut [f64],
        duration: f64,
        sensitivity: Option<&mut DMatrix<f64>>,
    ) -> Result<(), IntegrationError>;
    /// Integrates with an error that the flow controls, for a motion that is not closed to an
    /// orbit.
    fn run_accurately(&mut self, state: &mut [f64], duration: f64) -> Result<(), IntegrationError> {
        self.run(state, duration, None)
    }
    /// Multiplies the slip limits of these joints by a factor, until a call with the inverse
    /// factor.
    fn scale_limits(&mut self, _joints: &[usize], _factor: f64) {}
    /// Switches the recording of later runs for [`Flow::path`] on or off.
    fn set_recording(&mut self, keep: bool);
    /// Returns the motion of the last recorded run, with the period `period` (s).
    fn path(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Arc<dyn Path>;
}
