//! Equal steps over a time interval, with their number controlled by the estimated error.

use super::acceleration_step::{AccelerationElimination, AccelerationStep};
use super::law_step;
use super::sensitivity::Sensitivity;
use crate::law::IdealElement;
use crate::method::flow::Flow;
use crate::method::flow::assembly::{Assembly, NEAR_REST};
use crate::method::flow::excitation::HarmonicExcitation;
use crate::method::flow::step_record::{StepRecord, extrapolate};
use crate::method::flow::trajectory::Trajectory;
use crate::method::orbit_search::residual_traction::ElasticSlider;
use crate::method::orbit_search::return_map::norm;
use crate::method::{IntegrationError, MethodError};
use crate::model::System;
use crate::orbit::{Path, Symmetry};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Settings of the integration in equal steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EqualStepSettings {
    /// Initial number of steps of an interval.
    pub initial_steps: usize,
    /// Largest number of steps of an interval. Linear motion then has an error below 1e-9, and a
    /// run takes about 0.1 s for one joint.
    pub max_steps: usize,
    /// Default relative error of an interval of a transient: the change of the extrapolated limit
    /// from two step sizes when both are halved.
    pub tolerance: f64,
    /// Fraction of the tolerance below which the next interval tries half as many steps. Halving
    /// the steps reduces the error to a sixteenth without kinks, and to a quarter with kinks.
    pub coarsening_fraction: f64,
    /// Smallest number of steps of an interval of a transient.
    pub min_steps: usize,
}

impl Default for EqualStepSettings {
    fn default() -> Self {
        EqualStepSettings {
            initial_steps: 256,
            max_steps: 1 << 16,
            tolerance: 1e-6,
            coarsening_fraction: 0.05,
            min_steps: 64,
        }
    }
}

/// Reason for rejecting a law without a smooth approximation.
const DROPS: &str =
    "its friction drops abruptly at the onset of slip; only a law with a `velocity` above zero can be regularized";

/// Reason for rejecting a rigid slider.
const RIGID: &str = "its slider is rigid, and `event-driven` does not take all laws of the model; set `width`, or add a \
                     spring in series";

/// Flow of a structure with any laws except rigid sliders.
pub(crate) struct AverageAccelerationFlow {
    pub assembly: Assembly,
    pub excitation: HarmonicExcitation,
    /// Number of steps of a run; the run uses the fraction `share` of it.
    pub count: usize,
    /// Relative error of an interval, see [`EqualStepSettings::tolerance`].
    tolerance: f64,
    share: f64,
    keep: bool,
    steps: StepRecord,
    step: AccelerationStep,
    eliminated: Option<AccelerationElimination>,
    /// Scratch memory: the loads at an instant.
    load: Vec<f64>,
}

/// Returns the estimated error of the finer of two solutions.
///
/// `last` is the difference of both solutions, and `earlier` that of the coarser one and its
/// predecessor. The estimate sums all further differences, with the same ratio of decrease. It
/// is at least a third of `last`, as at second order.
pub(crate) fn estimate(earlier: Option<f64>, last: f64) -> f64 {
    let ratio = earlier.map_or(2.0, |earlier| earlier / last.max(f64::MIN_POSITIVE)).clamp(1.25, 4.0);
    last / (ratio - 1.0)
}

impl AverageAccelerationFlow {
    /// Creates the flow of a system.
    ///
    /// # Errors
    /// A law with neither a step nor a rate view, a rigid slider, or a place without mass.
    pub fn new(system: &System, width: Option<f64>, method: &'static str) -> Result<Self, MethodError> {
        let settings = EqualStepSettings::default();
        let assembly = Assembly::new(system, method, |joint| {
            let regular = width.and_then(|width| joint.smooth_counterpart(width));
            let chosen = regular.unwrap_or_else(|| joint.clone());
            match law_step::states(&chosen) {
                Some((states, scale)) => Ok((chosen, states, scale)),
                None if chosen
                    .ideal_elements()
                    .is_some_and(|elements| elements.iter().any(IdealElement::has_force_drop)) =>
                {
                    Err(DROPS)
                }
                None if chosen.ideal_elements().is_some() => Err(RIGID),
                None => Err("it defines neither the force after a step nor a differential equation"),
            }
        })?;
        Ok(AverageAccelerationFlow {
            excitation: HarmonicExcitation::default(),
            count: settings.initial_steps,
            tolerance: settings.tolerance,
            share: 1.0,
            keep: false,
            steps: StepRecord::new(vec![(1.0, 1.0)], &assembly),
            step: AccelerationStep::new(&assembly),
            eliminated: None,
            load: vec![0.0; assembly.n],
            assembly,
        })
    }

    /// Returns the number of multiplications of one step, roughly.
    pub fn step_multiplications(&self) -> f64 {
        let (n, axes) = (self.assembly.n as f64, self.assembly.axes.len() as f64);
        // Newton iterations of a step; and multiplications that take as long as a law's evaluation.
        // Measured: 0.9 ms per step of a ring with 60 degrees of freedom and 96 axes.
        let (iterations, law) = (3.0, 200.0);
        n * (3.0 * n + axes) + iterations * (axes * axes * axes / 3.0 + law * axes)
    }

    /// Returns the sliders in series with springs, whose forces are among the states.
    pub fn springs(&self) -> Vec<ElasticSlider> {
        let mut springs = Vec::new();
        for (joint, placed) in self.assembly.joints.iter().enumerate() {
            let first = 2 * self.assembly.n + placed.first_state;
            let sliders = law_step::springs(&placed.law).into_iter().enumerate();
            springs.extend(sliders.map(|(s, (stiffness, limit))| ElasticSlider {
                joint,
                state: first + s,
                stiffness,
                limit,
            }));
        }
        springs
    }

    /// Sets the limits of all sliders of [`AverageAccelerationFlow::springs`].
    pub fn limit(&mut self, springs: &[ElasticSlider]) {
        let mut limits = springs.iter().map(|spring| spring.limit);
        self.step.laws.iter_mut().for_each(|law| law.limit(&mut limits));
    }

    /// Runs from `state` and returns the end state with the record of the run.
    fn trial(&mut self, state: &[f64], duration: f64) -> Result<(Vec<f64>, StepRecord), IntegrationError> {
        let mut end = state.to_vec();
        self.run(&mut end, duration, None)?;
        let empty = StepRecord::new(self.steps.nodes.clone(), &self.assembly);
        Ok((end, std::mem::replace(&mut self.steps, empty)))
    }

    fn keep_instant(&mut self, state: &[f64], time: f64) {
        let force = self.step.force.as_slice();
        self.excitation.load(time, &mut self.load);
        let acceleration = self.steps.push_instant(state, force);
        self.assembly.accelerate(state, &mut self.load, force, acceleration);
    }

    fn keep_step(&mut self, state: &[f64], time: f64, h: f64) {
        let n = self.assembly.n;
        let velocity: Vec<f64> = (0..self.assembly.axes.len())
            .map(|axis| self.assembly.relative(axis, state, &self.excitation, time + h).1)
            .collect();
        let laws = self.assembly.joints.iter().zip(&self.step.laws);
        let contact = laws.map(|(joint, law)| law.contact(&joint.law, &velocity[joint.axes()]));
        let (x, rest) = state.split_at(n);
        self.steps.spans.push((time, h));
        self.steps.push_node([x, &rest[..n]], [&velocity, self.step.force.as_slice()], contact);
        self.keep_instant(state, time + h);
    }

    /// Returns the path of the last stored run, which repeats after `period`.
    pub fn stepped(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Trajectory {
        Trajectory::new((system, &self.assembly), &self.excitation, &self.steps, (symmetry, period))
    }
}

impl Flow for AverageAccelerationFlow {
    fn states(&self) -> usize {
        self.assembly.states()
    }

    fn set_excitation(&mut self, system: &System, omega: f64) {
        self.excitation = self.assembly.excitation(system, omega);
    }

    fn weights(&self) -> Vec<f64> {
        self.assembly.weights(&self.excitation)
    }

    fn energy_scale(&self) -> f64 {
        self.assembly.energy_scale(&self.excitation)
    }

    fn has_equal_steps(&self) -> bool {
        true
    }

    fn set_step_fraction(&mut self, share: f64) {
        self.share = share;
    }

    fn run(
        &mut self,
        state: &mut [f64],
        duration: f64,
        sensitivity: Option<&mut DMatrix<f64>>,
    ) -> Result<(), IntegrationError> {
        let count = (self.count as f64 * self.share).ceil();
        let h = duration / count;
        if self.eliminated.as_ref().is_none_or(|eliminated| eliminated.length != h) {
            self.eliminated = AccelerationElimination::new(&self.assembly, h);
        }
        let eliminated = self.eliminated.take().ok_or(IntegrationError::OutOfRange { time: 0.0 })?;
        self.steps.clear();
        self.step.start(&self.assembly, state, &self.excitation);
        let mut carried =
            sensitivity.as_deref().map(|sensitivity| Sensitivity::new(&self.assembly, &self.step.laws, sensitivity));
        // a preloaded joint can start the motion of a system at rest without loads
        let pushed = NEAR_REST * duration * self.assembly.largest_acceleration(self.step.force.as_slice());
        let scale = self.assembly.scales(state, &self.excitation).1.max(pushed);
        if self.keep {
            self.keep_instant(state, 0.0);
        }
        for i in 0..count as usize {
            let time = i as f64 * h;
            if !self.step.advance(&self.assembly, &eliminated, &self.excitation, (time, state), scale) {
                return Err(match self.step.without_number(&self.assembly) {
                    Some(joint) => joint.not_finite_error(time),
                    None => IntegrationError::Stalled { time, step: h },
                });
            }
            if state.iter().any(|z| !z.is_finite()) {
                return Err(IntegrationError::Unbounded { time, place: self.assembly.farthest(state) });
            }
            if let Some(carried) = &mut carried {
                carried.advance(&self.assembly, &eliminated, &self.step.laws, &self.step.lu);
            }
            if self.keep {
                self.keep_step(state, time, h);
            }
        }
        if let (Some(carried), Some(sensitivity)) = (carried, sensitivity) {
            carried.write(sensitivity);
        }
        self.eliminated = Some(eliminated);
        Ok(())
    }

    fn run_accurately(&mut self, state: &mut [f64], duration: f64) -> Result<(), IntegrationError> {
        let settings = EqualStepSettings::default();
        let (weights, rest) = (self.weights(), NEAR_REST * self.energy_scale());
        let mut coarse = loop {
            match self.trial(state, duration) {
                // steps that are too large for the states of a law are halved
                Err(IntegrationError::Stalled { .. } | IntegrationError::NotFinite { .. })
                    if self.count < settings.max_steps =>
                {
                    self.count *= 2
                }
                found => break found?,
            }
        };
        let mut before: Option<Vec<f64>> = None;
        loop {
            self.count *= 2;
            let fine = self.trial(state, duration)?;
            let mut end = coarse.0;
            extrapolate(&mut end, &fine.0);
            if let Some(before) = before {
                let change: Vec<f64> = end.iter().zip(&before).map(|(a, b)| a - b).collect();
                let size = norm(&weights, &end).max(norm(&weights, state)).max(rest).max(f64::MIN_POSITIVE);
                let error = norm(&weights, &change) / size;
                if error <= self.tolerance {
                    state.copy_from_slice(&end);
                    self.steps = coarse.1.extrapolated(&fine.1);
                    // the next interval begins with the same number of steps, or with half of
                    // it
                    self.count = (self.count
                        / if error < settings.coarsening_fraction * self.tolerance { 8 } else { 4 })
                    .max(settings.min_steps);
                    return Ok(());
                }
                if self.count >= settings.max_steps {
                    return Err(IntegrationError::Unresolved {
                        steps: self.count,
                        estimate: error,
                        tolerance: self.tolerance,
                    });
                }
            }
            (before, coarse) = (Some(end), fine);
        }
    }

    fn scale_limits(&mut self, joints: &[usize], factor: f64) {
        for &joint in joints {
            self.step.laws[joint].scale_limits(factor);
            let law = &mut self.assembly.joints[joint].law;
            if let Some(scaled) = law.with_limit_factor(factor) {
                *law = scaled;
            }
        }
    }

    fn set_recording(&mut self, keep: bool) {
        self.keep = keep;
    }

    fn set_tolerance(&mut self, tolerance: f64) {
        self.tolerance = tolerance;
    }

    fn path(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Arc<dyn Path> {
        Arc::new(self.stepped(system, symmetry, period))
    }
}
