//! Equal steps over a stretch of time, as many as the estimated error asks for.

use super::carried::Carried;
use super::law;
use super::step::{Eliminated, Step};
use crate::law::Piece;
use crate::method::assembly::{Assembly, NEAR_REST};
use crate::method::drive::Drive;
use crate::method::flow::Flow;
use crate::method::periodic::norm;
use crate::method::residual_traction::ElasticSlider;
use crate::method::stepped::SteppedPath;
use crate::method::steps::{Steps, extrapolate};
use crate::method::{Breakdown, MethodError};
use crate::model::System;
use crate::orbit::{Path, Symmetry};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Steps of a stretch at first.
pub(crate) const FIRST: usize = 256;
/// Steps of a stretch at most: linear motion is then within 1e-9 of the truth, and a run takes about 0.1 s for one joint.
pub(crate) const MOST: usize = 1 << 16;
/// Error of a stretch of a transient, relative to its motion: by how much the limit that two step lengths promise changes when both are halved.
const TOLERANCE: f64 = 1e-6;
/// Steps are doubled only where they must be: the next stretch tries half as many when the error is below this share of the tolerance, which
/// without kinks falls to a sixteenth and at kinks to a quarter.
const EASY: f64 = 0.05;
/// Steps of a stretch of a transient at least.
const FIRST_FOLLOWED: usize = 64;

/// What is missed in a law of which no smooth neighbour is left either.
const DROPS: &str =
    "its friction drops abruptly at the onset of slip; only a law with a `velocity` above zero can be regularized";

/// Runs the motion of a structure with any laws but rigid sliders.
pub(crate) struct IncrementalFlow {
    pub assembly: Assembly,
    pub drive: Drive,
    /// Steps of a run, of which it takes this share.
    pub count: usize,
    share: f64,
    keep: bool,
    steps: Steps,
    step: Step,
    eliminated: Option<Eliminated>,
    /// Memory: the loads at an instant.
    load: Vec<f64>,
}

/// Estimated error of the finer of two solutions that differ by `last`, where the coarser one and the one before it differ by `earlier`:
/// what all further halvings will do if the differences fall on as they fell. Never less than a third of the difference, as at second order.
pub(crate) fn estimate(earlier: Option<f64>, last: f64) -> f64 {
    let ratio = earlier.map_or(2.0, |earlier| earlier / last.max(f64::MIN_POSITIVE)).clamp(1.25, 4.0);
    last / (ratio - 1.0)
}

impl IncrementalFlow {
    /// # Errors
    /// A law that knows neither steps nor rates, or a rigid slider; a place without mass.
    pub fn new(system: &System, width: Option<f64>, method: &'static str) -> Result<Self, MethodError> {
        let assembly = Assembly::new(system, method, |joint| {
            let regular = width.and_then(|width| joint.regularised(width));
            let chosen = regular.unwrap_or_else(|| joint.clone());
            match law::states(&chosen) {
                Some((states, scale)) => Ok((chosen, states, scale)),
                None if chosen.pieces().is_some_and(|pieces| pieces.iter().any(Piece::drops)) => Err(DROPS),
                None if chosen.pieces().is_some() => Err("its slider is rigid; it needs a spring in series"),
                None => Err("it defines neither a step view nor a rate view"),
            }
        })?;
        Ok(IncrementalFlow {
            drive: Drive::default(),
            count: FIRST,
            share: 1.0,
            keep: false,
            steps: Steps::new(vec![(1.0, 1.0)], &assembly),
            step: Step::new(&assembly),
            eliminated: None,
            load: vec![0.0; assembly.n],
            assembly,
        })
    }

    /// The sliders behind springs whose forces are among the states.
    pub fn springs(&self) -> Vec<ElasticSlider> {
        let mut springs = Vec::new();
        for (joint, placed) in self.assembly.joints.iter().enumerate() {
            let first = 2 * self.assembly.n + placed.first_state;
            let sliders = law::springs(&placed.law).into_iter().enumerate();
            springs.extend(sliders.map(|(s, (stiffness, limit))| ElasticSlider {
                joint,
                state: first + s,
                stiffness,
                limit,
            }));
        }
        springs
    }

    /// Gives all of [`IncrementalFlow::springs`] the limits that these state.
    pub fn limit(&mut self, springs: &[ElasticSlider]) {
        let mut limits = springs.iter().map(|spring| spring.limit);
        self.step.laws.iter_mut().for_each(|law| law.limit(&mut limits));
    }

    /// The end of a run from `state` with its record.
    fn tried(&mut self, state: &[f64], duration: f64) -> Result<(Vec<f64>, Steps), Breakdown> {
        let mut end = state.to_vec();
        self.run(&mut end, duration, None)?;
        let empty = Steps::new(self.steps.nodes.clone(), &self.assembly);
        Ok((end, std::mem::replace(&mut self.steps, empty)))
    }

    fn keep_instant(&mut self, state: &[f64], time: f64) {
        let force = self.step.force.as_slice();
        self.drive.load(time, &mut self.load);
        let acceleration = self.steps.keep_instant(state, force);
        self.assembly.accelerate(state, &mut self.load, force, acceleration);
    }

    fn keep_step(&mut self, state: &[f64], (time, h): (f64, f64)) {
        let n = self.assembly.n;
        let velocity: Vec<f64> = (0..self.assembly.axes.len())
            .map(|axis| self.assembly.relative(axis, state, &self.drive, time + h).1)
            .collect();
        let laws = self.assembly.joints.iter().zip(&self.step.laws);
        let contact = laws.map(|(joint, law)| law.contact(&joint.law, &velocity[joint.axes()]));
        let (x, rest) = state.split_at(n);
        self.steps.spans.push((time, h));
        self.steps.keep_node([x, &rest[..n]], [&velocity, self.step.force.as_slice()], contact);
        self.keep_instant(state, time + h);
    }

    /// The motion of the last kept run, which repeats after `period`.
    pub fn stepped(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> SteppedPath {
        SteppedPath::new((system, &self.assembly), &self.drive, &self.steps, (symmetry, period))
    }
}

impl Flow for IncrementalFlow {
    fn states(&self) -> usize {
        self.assembly.states()
    }

    fn set_drive(&mut self, system: &System, omega: f64) {
        self.drive = self.assembly.drive(system, omega);
    }

    fn weights(&self) -> Vec<f64> {
        self.assembly.weights(&self.drive)
    }

    fn energy_scale(&self) -> f64 {
        self.assembly.energy_scale(&self.drive)
    }

    fn set_share(&mut self, share: f64) {
        self.share = share;
    }

    fn run(
        &mut self,
        state: &mut [f64],
        duration: f64,
        sensitivity: Option<&mut DMatrix<f64>>,
    ) -> Result<(), Breakdown> {
        let count = (self.count as f64 * self.share).ceil();
        let h = duration / count;
        if self.eliminated.as_ref().is_none_or(|eliminated| eliminated.length != h) {
            self.eliminated = Eliminated::new(&self.assembly, h);
        }
        let eliminated = self.eliminated.take().ok_or(Breakdown::OutOfRange { time: 0.0 })?;
        self.steps.clear();
        self.step.start(&self.assembly, state, &self.drive);
        let mut carried =
            sensitivity.as_deref().map(|sensitivity| Carried::new(&self.assembly, &self.step.laws, sensitivity));
        // joints that are pressed at rest set in motion what neither moves nor is loaded
        let pushed = NEAR_REST * duration * self.assembly.pushed(self.step.force.as_slice());
        let scale = self.assembly.scales(state, &self.drive).1.max(pushed);
        if self.keep {
            self.keep_instant(state, 0.0);
        }
        for i in 0..count as usize {
            let time = i as f64 * h;
            if !self.step.advance(&self.assembly, &eliminated, &self.drive, (time, state), scale) {
                return Err(match self.step.without_number(&self.assembly) {
                    Some(joint) => joint.no_number(time),
                    None => Breakdown::Stalled { time, step: h },
                });
            }
            if state.iter().any(|z| !z.is_finite()) {
                return Err(Breakdown::Unbounded { time, place: self.assembly.farthest(state) });
            }
            if let Some(carried) = &mut carried {
                carried.advance(&self.assembly, &eliminated, &self.step.laws, &self.step.lu);
            }
            if self.keep {
                self.keep_step(state, (time, h));
            }
        }
        if let (Some(carried), Some(sensitivity)) = (carried, sensitivity) {
            carried.write(sensitivity);
        }
        self.eliminated = Some(eliminated);
        Ok(())
    }

    fn follow(&mut self, state: &mut [f64], duration: f64) -> Result<(), Breakdown> {
        let (weights, rest) = (self.weights(), NEAR_REST * self.energy_scale());
        let mut coarse = loop {
            match self.tried(state, duration) {
                // steps that are too long for a law's states are no reason to give up
                Err(Breakdown::Stalled { .. } | Breakdown::NoNumber { .. }) if self.count < MOST => self.count *= 2,
                found => break found?,
            }
        };
        let mut before: Option<Vec<f64>> = None;
        loop {
            self.count *= 2;
            let fine = self.tried(state, duration)?;
            let mut end = coarse.0;
            extrapolate(&mut end, &fine.0);
            if let Some(before) = before {
                let change: Vec<f64> = end.iter().zip(&before).map(|(a, b)| a - b).collect();
                let size = norm(&weights, &end).max(norm(&weights, state)).max(rest).max(f64::MIN_POSITIVE);
                let error = norm(&weights, &change) / size;
                if error <= TOLERANCE {
                    state.copy_from_slice(&end);
                    self.steps = coarse.1.extrapolated(&fine.1);
                    // the next stretch begins as this one did, or with half as many
                    self.count = (self.count / if error < EASY * TOLERANCE { 8 } else { 4 }).max(FIRST_FOLLOWED);
                    return Ok(());
                }
                if self.count >= MOST {
                    return Err(Breakdown::Unresolved { steps: self.count, estimate: error, tolerance: TOLERANCE });
                }
            }
            (before, coarse) = (Some(end), fine);
        }
    }

    fn strengthen(&mut self, joints: &[usize], factor: f64) {
        let mut springs = self.springs();
        springs.iter_mut().filter(|spring| joints.contains(&spring.joint)).for_each(|spring| spring.limit *= factor);
        self.limit(&springs);
    }

    fn keep(&mut self, keep: bool) {
        self.keep = keep;
    }

    fn path(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Arc<dyn Path> {
        Arc::new(self.stepped(system, symmetry, period))
    }
}
