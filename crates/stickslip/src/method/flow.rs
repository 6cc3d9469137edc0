//! Motion in time, whatever follows it: between two returns for periodic motion, stretch by stretch for transients.
//!
//! | flow | laws | motion |
//! | --- | --- | --- |
//! | [`ExactFlow`](super::exact_flow::ExactFlow) | sliders | closed forms between switches |
//! | [`SmoothFlow`](super::smooth::flow::SmoothFlow) | rate | Radau IIA-5 with controlled steps |
//! | [`IncrementalFlow`](super::incremental::flow::IncrementalFlow) | step and rate side by side | average acceleration on equal steps |

use super::event_driven::Mechanics;
use super::exact_flow::ExactFlow;
use super::incremental::flow::IncrementalFlow;
use super::smooth::flow::SmoothFlow;
use super::{Breakdown, MethodError};
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
    /// Whether runs from now on are kept for [`Flow::path`].
    fn keep(&mut self, keep: bool);
    /// The motion of the last kept run, which repeats after `period` (s).
    fn path(&self, system: &System, symmetry: Symmetry, period: f64) -> Arc<dyn Path>;
}

/// The flow that a system's laws ask for; smooth laws are integrated with this relative error per step, and `width` (m/s) smooths exact ones.
///
/// # Errors
/// A joint whose law no flow takes; a place without mass.
pub(crate) fn of(
    system: &System,
    width: Option<f64>,
    tolerance: f64,
    method: &'static str,
) -> Result<Box<dyn Flow>, MethodError> {
    match Kind::of(system, width) {
        Kind::Exact => Ok(Box::new(ExactFlow::new(Mechanics::new(system)?))),
        Kind::Smooth => Ok(Box::new(SmoothFlow::new(super::smooth::assembly(system, width, method)?, tolerance))),
        Kind::Incremental => Ok(Box::new(IncrementalFlow::new(system, width, method)?)),
    }
}

/// Which flow a system is followed by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Exact,
    Smooth,
    Incremental,
}

impl Kind {
    /// Sliders alone are followed exactly, laws with a rate alone by integration, everything else in small steps.
    pub fn of(system: &System, width: Option<f64>) -> Kind {
        let all = |has: &dyn Fn(&crate::law::SharedLaw) -> bool| system.joints().iter().all(|joint| has(joint.law()));
        if width.is_none() && all(&|law| law.sliders().is_some()) {
            return Kind::Exact;
        }
        let regular = |law: &crate::law::SharedLaw| width.and_then(|width| law.regularised(width));
        if all(&|law| regular(law).as_ref().unwrap_or(law).rate().is_some()) { Kind::Smooth } else { Kind::Incremental }
    }
}
