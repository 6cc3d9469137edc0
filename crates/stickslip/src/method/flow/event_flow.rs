//! Event-driven motion as a [`Flow`].

use super::Flow;
use super::excitation::HarmonicExcitation;
use crate::method::IntegrationError;
use crate::method::event_driven::{ExactPath, Mechanics, SegmentedMotion};
use crate::model::System;
use crate::orbit::{Path, Symmetry};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Integrates systems of ideal sliders from event to event.
pub(crate) struct ExactFlow {
    segments: SegmentedMotion,
}

impl ExactFlow {
    pub fn new(mechanics: Mechanics) -> Self {
        ExactFlow { segments: SegmentedMotion::new(mechanics, HarmonicExcitation::default()) }
    }
}

impl Flow for ExactFlow {
    fn states(&self) -> usize {
        self.segments.mechanics.states()
    }
    fn set_excitation(&mut self, system: &System, omega: f64) {
        let owners = self.segments.mechanics.part_joints();
        self.segments.set_excitation(HarmonicExcitation::at(system, &owners, omega));
    }
    fn weights(&self) -> Vec<f64> {
        self.segments.mechanics.weights(self.segments.excitation.omega)
    }
    fn energy_scale(&self) -> f64 {
        self.segments.energy_scale
    }
    fn run(
        &mut self,
        state: &mut [f64],
        duration: f64,
        sensitivity: Option<&mut DMatrix<f64>>,
    ) -> Result<(), IntegrationError> {
        self.segments.run(state, 0.0, duration, sensitivity)
    }
    fn scale_limits(&mut self, joints: &[usize], factor: f64) {
        self.segments.mechanics.scale_limits(joints, factor);
    }
    // the computation needs the segments, so it always records them
    fn set_recording(&mut self, _keep: bool) {}
    fn path(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Arc<dyn Path> {
        Arc::new(ExactPath::new(system.clone(), &self.segments, symmetry, period))
    }
}
