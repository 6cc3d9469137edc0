//! Step size control between located switches.
//!
//! The motion is smooth while no joint changes between stick and slip. The steps are then those
//! of smooth laws: powers of two of a tick, so that steps of one size share one elimination of
//! the structure.
//!
//! Every step is searched, on its collocation polynomial, for the event that ends the mode of a
//! joint: the zero of the velocity of a slipping joint, or the force of a stuck joint at its
//! limit. Newton's method on the end of the step then shortens the step to that zero, with
//! order 9. The motion continues in the new modes. The first steps after a switch return to the
//! ticks.

use super::friction_mode::{FrictionMode, in_mode};
use super::transition::{apply_saltation, contact_modes, delassus_matrix, remove_velocity};
use crate::law::{RatePoint, RelativeMotion, SharedLaw};
use crate::method::flow::Flow;
use crate::method::flow::assembly::Assembly;
use crate::method::flow::excitation::HarmonicExcitation;
use crate::method::flow::radau::radau_step::{
    RadauElimination, RadauStep, StageLoads, evaluation_points, extrapolation_weights,
};
use crate::method::flow::radau::step_size_control::time_derivative;
use crate::method::flow::step_record::StepRecord;
use crate::method::flow::trajectory::Trajectory;
use crate::method::{IntegrationError, MethodError};
use crate::model::System;
use crate::orbit::{Path, Symmetry};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;
use stickslip_numerics::radau::{BUTCHER_MATRIX, ESTIMATE_ORDER, NODES, STAGES};

/// Settings of the steps and of the search for switches.
#[derive(Debug, Clone, Copy)]
struct SetValuedSettings {
    /// The time interval has `2^levels` ticks.
    levels: usize,
    /// The largest step is the interval divided by `2^min_level`.
    min_level: usize,
    /// The first step of a run is the interval divided by `2^first_level`.
    first_level: usize,
    /// Largest number of steps of one run, including rejected ones. Beyond it, the run stalls.
    step_limit: usize,
    /// Largest number of switches of one run. Beyond it, the motion chatters.
    switch_limit: usize,
    /// Fraction of the tolerance for the error of the next step.
    safety: f64,
    /// Relative velocities and forces that count as rounding.
    rounding: f64,
    /// Fraction of the interval that counts as zero: a switch this close to the end is at the end.
    end_tolerance: f64,
    /// Number of instants of a step at which switches are searched, including its end.
    search_instants: usize,
    /// Largest number of Newton iterations for a switch; two are typical.
    location_iterations: usize,
}

impl Default for SetValuedSettings {
    fn default() -> Self {
        SetValuedSettings {
            levels: 40,
            min_level: 3,
            first_level: 7,
            step_limit: 100_000,
            switch_limit: 10_000,
            safety: 0.8,
            rounding: 1e-12,
            end_tolerance: 16.0 * f64::EPSILON,
            search_instants: 8,
            location_iterations: 12,
        }
    }
}

/// A joint with set-valued friction.
struct FrictionJoint {
    joint: usize,
    axis: usize,
    law: SharedLaw,
    /// Static limit of the force, N.
    limit: f64,
    mode: FrictionMode,
    /// Its law in each mode, for the present velocity scale: stuck, forward slip, backward
    /// slip.
    laws: [SharedLaw; 3],
    /// Force per unknown, N s/m; see [`in_mode`].
    unit: f64,
}

impl FrictionJoint {
    fn in_modes(law: &SharedLaw, unit: f64) -> [SharedLaw; 3] {
        [FrictionMode::Stick, FrictionMode::Slip(1.0), FrictionMode::Slip(-1.0)].map(|mode| in_mode(law, mode, unit))
    }

    fn now(&self) -> &SharedLaw {
        match self.mode {
            FrictionMode::Stick => &self.laws[0],
            FrictionMode::Slip(sign) => &self.laws[if sign > 0.0 { 1 } else { 2 }],
        }
    }
}

/// Start of the present step, s, and its tick.
#[derive(Clone, Copy)]
struct StepBegin {
    time: f64,
    /// Number of the tick; `None` after a switch, when the time is between two ticks.
    tick: Option<u64>,
}

/// A switch in a step: the index of the joint in `frictions`, and the time as a fraction of the
/// step.
#[derive(Clone, Copy)]
struct Switch {
    friction: usize,
    at: f64,
}

/// Flow of a structure with set-valued friction and smooth laws.
pub(crate) struct SetValuedFlow {
    settings: SetValuedSettings,
    /// The assembly with the laws of the present modes.
    pub assembly: Assembly,
    /// The assembly with the original laws.
    plain: Assembly,
    pub excitation: HarmonicExcitation,
    /// Relative error per step.
    pub tolerance: f64,
    keep: bool,
    steps: StepRecord,
    frictions: Vec<FrictionJoint>,
    stretch: f64,
    eliminated: Vec<Option<RadauElimination>>,
    step: RadauStep,
    loads: StageLoads,
    level: usize,
    tried: usize,
    /// The laws and the time derivative of the state at the start of the step.
    laws: Vec<RatePoint>,
    slope: Vec<f64>,
    next: Vec<f64>,
    derivative: Vec<f64>,
    previous: Vec<f64>,
    error: Vec<f64>,
    second: Vec<f64>,
    load: Vec<f64>,
    force: Vec<f64>,
}

impl SetValuedFlow {
    /// Creates the flow of a system.
    ///
    /// # Errors
    /// See [`super::assembly`].
    pub fn new(system: &System, tolerance: f64, method: &'static str) -> Result<Self, MethodError> {
        let plain = super::assembly(system, method)?;
        let frictions = plain.joints.iter().enumerate().filter_map(|(joint, placed)| {
            let law = placed.law.clone();
            let limit = law.sliding()?.slip_force(0.0).0;
            let laws = FrictionJoint::in_modes(&law, 1.0);
            let friction = FrictionJoint {
                joint,
                axis: placed.first_axis,
                law,
                limit,
                mode: FrictionMode::Stick,
                laws,
                unit: 1.0,
            };
            (limit > 0.0).then_some(friction)
        });
        let frictions = frictions.collect();
        let (states, n, j) = (plain.states(), plain.n, plain.axes.len());
        let nodes = NODES.into_iter().zip(BUTCHER_MATRIX[STAGES - 1]).collect();
        let settings = SetValuedSettings::default();
        Ok(SetValuedFlow {
            settings,
            assembly: plain.clone(),
            excitation: HarmonicExcitation::default(),
            tolerance,
            keep: false,
            steps: StepRecord::with_jumps(nodes, &plain),
            frictions,
            stretch: 0.0,
            eliminated: vec![None; settings.levels + 1],
            step: RadauStep::new(&plain),
            loads: StageLoads::default(),
            level: settings.first_level,
            tried: 0,
            laws: evaluation_points(&plain),
            slope: vec![0.0; states],
            next: vec![0.0; states],
            derivative: Vec::new(),
            previous: Vec::new(),
            error: vec![0.0; states],
            second: vec![0.0; states],
            load: vec![0.0; n],
            force: vec![0.0; j],
            plain,
        })
    }

    /// Returns the path of the last stored run, which repeats after `period`.
    pub fn stepped(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Trajectory {
        Trajectory::new((system, &self.plain), &self.excitation, &self.steps, (symmetry, period))
    }

    /// Returns the relative velocity along an axis.
    fn velocity(&self, axis: usize, state: &[f64], time: f64) -> f64 {
        self.assembly.relative(axis, state, &self.excitation, time).1
    }

    /// Returns the relative acceleration along an axis for the present time derivative, m/s².
    fn acceleration(&self, axis: usize, time: f64) -> f64 {
        let n = self.assembly.n;
        self.assembly.axes[axis].component(&self.slope[n..2 * n]) + self.excitation.imposed_at(axis, time, 2)
    }

    fn held(&self) -> impl Iterator<Item = &FrictionJoint> {
        self.frictions.iter().filter(|friction| friction.mode == FrictionMode::Stick)
    }

    /// Sets the law of every joint to that of its mode.
    fn enter_modes(&mut self) {
        self.step.held.fill(false);
        for friction in &self.frictions {
            self.assembly.joints[friction.joint].law = friction.now().clone();
            self.step.held[friction.axis] = friction.mode == FrictionMode::Stick;
        }
    }

    /// Computes laws, forces and the time derivative of a state in the present modes. Stuck
    /// joints carry the force that keeps them at rest. Returns false if these forces are not
    /// unique.
    fn set_slope(&mut self, state: &[f64], time: f64) -> bool {
        self.evaluate_laws(state, time);
        let held: Vec<usize> = self.held().map(|friction| friction.axis).collect();
        if held.is_empty() {
            return true;
        }
        // accelerations without the forces of the stuck joints
        let free: Vec<f64> = held.iter().map(|&axis| self.acceleration(axis, time)).collect();
        let Some(force) = delassus_matrix(&self.assembly, &held).lu().solve(&DVector::from_vec(free)) else {
            return false;
        };
        let each: Vec<(usize, f64)> = self.held().zip(force.iter()).map(|(own, f)| (own.joint, f / own.unit)).collect();
        for (joint, unknown) in each {
            let motion = RelativeMotion::along(0.0, unknown);
            if let Some(rate) = self.assembly.joints[joint].law.rate() {
                rate.evaluate_with_derivatives(1, &motion, &[], &mut self.laws[joint]);
            }
        }
        self.set_motion(state, time);
        true
    }

    /// Evaluates the laws at a state, with zero force for stuck joints, and the time
    /// derivative.
    fn evaluate_laws(&mut self, state: &[f64], time: f64) {
        let n = self.assembly.n;
        for (q, (joint, point)) in self.assembly.joints.iter().zip(&mut self.laws).enumerate() {
            let holds = |friction: &FrictionJoint| friction.joint == q && friction.mode == FrictionMode::Stick;
            let motion = match self.frictions.iter().any(holds) {
                true => RelativeMotion::along(0.0, 0.0),
                false => self.assembly.motion_of(joint, state, &self.excitation, time),
            };
            let first = 2 * n + joint.first_state;
            if let Some(rate) = joint.law.rate() {
                rate.evaluate_with_derivatives(joint.directions, &motion, &state[first..first + joint.states], point);
            }
        }
        self.set_motion(state, time);
    }

    /// Computes the time derivative of a state under the present forces of the laws.
    fn set_motion(&mut self, state: &[f64], time: f64) {
        let work = (state, self.load.as_mut_slice(), self.force.as_mut_slice());
        time_derivative(&self.assembly, work, &self.laws, &self.excitation, time, &mut self.slope);
    }

    /// Determines the modes at the start of a run: moving joints slip, and joints at rest are
    /// decided.
    fn begin(&mut self, state: &mut [f64], scale: f64) -> Result<(), IntegrationError> {
        let mut resting = Vec::new();
        for k in 0..self.frictions.len() {
            let friction = &self.frictions[k];
            let (velocity, unit) = (self.velocity(friction.axis, state, 0.0), friction.limit / scale);
            let laws = FrictionJoint::in_modes(&friction.law, unit);
            let friction = &mut self.frictions[k];
            (friction.laws, friction.unit) = (laws, unit);
            friction.mode = FrictionMode::Slip(velocity.signum());
            if velocity.abs() <= self.settings.rounding * scale {
                resting.push(k);
            }
        }
        self.decide_at_rest(&resting, state, 0.0)
    }

    /// Decides on joints at rest. Sets the velocity of stuck ones exactly to zero.
    fn decide_at_rest(&mut self, resting: &[usize], state: &mut [f64], time: f64) -> Result<(), IntegrationError> {
        if !resting.is_empty() {
            let axes: Vec<usize> = resting.iter().map(|&k| self.frictions[k].axis).collect();
            let limits: Vec<f64> = resting.iter().map(|&k| self.frictions[k].limit).collect();
            resting.iter().for_each(|&k| self.frictions[k].mode = FrictionMode::Stick);
            self.enter_modes();
            self.evaluate_laws(state, time);
            let free: Vec<f64> = axes.iter().map(|&axis| self.acceleration(axis, time)).collect();
            let modes = contact_modes(&delassus_matrix(&self.assembly, &axes), &free, &limits);
            let modes = modes.ok_or(IntegrationError::NoContactState { time })?;
            resting.iter().zip(modes).for_each(|(&k, mode)| self.frictions[k].mode = mode);
        }
        self.enter_modes();
        let held: Vec<usize> = self.held().map(|friction| friction.axis).collect();
        let imposed: Vec<f64> = held.iter().map(|&axis| self.excitation.relative_at(axis, time).1).collect();
        let n = self.assembly.n;
        let stopped = remove_velocity(&self.assembly, &held, &imposed, (&mut state[n..2 * n], 1));
        if stopped && self.set_slope(state, time) { Ok(()) } else { Err(self.redundant(time)) }
    }

    fn redundant(&self, time: f64) -> IntegrationError {
        let joint = self.held().next().map_or(0, |friction| friction.joint);
        IntegrationError::Redundant { time, joint: self.assembly.joints[joint].joint.clone() }
    }

    /// Projects the sensitivity at a stop of velocities.
    fn project(&mut self, columns: usize) {
        let n = self.assembly.n;
        let held: Vec<usize> = self.held().map(|friction| friction.axis).collect();
        let rows = &mut self.derivative[n * columns..2 * n * columns];
        remove_velocity(&self.assembly, &held, &vec![0.0; held.len()], (rows, columns));
    }

    /// Sets the initial guess of the step's unknowns: the extrapolated collocation polynomial
    /// of the last step, or the initial state.
    fn predict(&mut self, state: &[f64], time: f64, h: f64, last: Option<f64>) {
        let (n, j, internal) = (self.assembly.n, self.assembly.axes.len(), self.assembly.internal);
        if let Some(length) = last {
            let weights = NODES.map(|c| extrapolation_weights(1.0 + c * h / length));
            return self.step.extrapolate(&self.assembly, &self.previous, &weights);
        }
        let start: Vec<f64> = (0..j).map(|axis| self.velocity(axis, state, time)).collect();
        for i in 0..STAGES {
            self.step.unknown[i * j..(i + 1) * j].copy_from_slice(&start);
            for friction in self.frictions.iter().filter(|friction| friction.mode == FrictionMode::Stick) {
                self.step.unknown[i * j + friction.axis] = self.laws[friction.joint].force[0] / friction.unit;
            }
            let first = STAGES * j + i * internal;
            self.step.unknown[first..first + internal].copy_from_slice(&state[2 * n..]);
        }
    }

    /// Solves a step. Returns false if the iteration does not converge.
    fn attempt(
        &mut self,
        eliminated: &RadauElimination,
        state: &[f64],
        (begin, last): (StepBegin, Option<f64>),
        (scale, derivatives): (f64, bool),
    ) -> bool {
        self.tried += 1;
        self.loads.set(&self.assembly, &self.excitation, begin.time, eliminated.length);
        self.predict(state, begin.time, eliminated.length, last);
        let solved = self.step.solve(&self.assembly, eliminated, &self.loads, state, (scale, derivatives));
        if solved {
            self.step.end(&self.assembly, eliminated, &self.loads, &mut self.next);
        }
        solved && self.next.iter().all(|z| z.is_finite())
    }

    /// Returns the error of the step relative to the tolerance: the embedded estimate, filtered
    /// at both ends.
    fn error(&mut self, eliminated: &RadauElimination, state: &[f64], scale: (f64, f64)) -> f64 {
        let assembly = &self.assembly;
        self.step.raw_error(assembly, eliminated, &self.loads, (state, &self.slope), &mut self.error);
        self.second.copy_from_slice(&self.error);
        if !self.step.filter_at_end(assembly, eliminated, &mut self.second) {
            return f64::INFINITY;
        }
        let at_end = self.size(&self.second, state, scale);
        if !self.step.prepare_filter(assembly, eliminated, &self.laws) {
            return f64::INFINITY;
        }
        self.step.filter(assembly, eliminated, &self.laws, &mut self.error);
        at_end.max(self.size(&self.error, state, scale))
    }

    /// Returns the size of an error estimate relative to the tolerance.
    fn size(&self, error: &[f64], state: &[f64], scale: (f64, f64)) -> f64 {
        self.assembly.error_size(error, state, scale) / self.tolerance
    }

    /// Returns the margin of a joint's mode at `s` in [0, 1] of the last solved step, relative
    /// to its scale. It is positive while the mode lasts.
    fn margin(&self, friction: &FrictionJoint, start: f64, s: f64, scale: f64) -> f64 {
        let j = self.assembly.axes.len();
        // the polynomial through the start and the stages
        let node = |i: usize| if i == 0 { 0.0 } else { NODES[i - 1] };
        let value = |i: usize| if i == 0 { start } else { self.step.unknown[(i - 1) * j + friction.axis] };
        let weight = |i: usize| {
            let others = (0..=STAGES).filter(|k| *k != i);
            others.map(|k| (s - node(k)) / (node(i) - node(k))).product::<f64>()
        };
        let now: f64 = (0..=STAGES).map(|i| weight(i) * value(i)).sum();
        match friction.mode {
            FrictionMode::Slip(sign) => sign * now / scale,
            // the unit of the unknown is the limit divided by the velocity scale
            FrictionMode::Stick => 1.0 - (now * friction.unit / friction.limit).abs(),
        }
    }

    /// Returns the first switch in the last solved step.
    fn switch(&self, state: &[f64], time: f64, scale: f64) -> Option<Switch> {
        let mut first: Option<Switch> = None;
        for (k, friction) in self.frictions.iter().enumerate() {
            let start = match friction.mode {
                FrictionMode::Slip(_) => self.velocity(friction.axis, state, time),
                FrictionMode::Stick => self.laws[friction.joint].force[0] / friction.unit,
            };
            let margin = |s: f64| self.margin(friction, start, s, scale);
            let mut before = 0.0;
            for look in 1..=self.settings.search_instants {
                let s = look as f64 / self.settings.search_instants as f64;
                if margin(s) >= -self.settings.rounding {
                    before = s;
                    continue;
                }
                let (mut low, mut high) = (before, s);
                while high - low > f64::EPSILON {
                    let middle = 0.5 * (low + high);
                    if middle <= low || middle >= high {
                        break;
                    }
                    if margin(middle) >= 0.0 { low = middle } else { high = middle }
                }
                if first.is_none_or(|switch| high < switch.at) {
                    first = Some(Switch { friction: k, at: high });
                }
                break;
            }
        }
        first
    }

    /// Returns the margin of a joint's mode and its rate (1/s) at the end of the last solved
    /// step. Sets `slope` to the time derivative there.
    fn at_end(&mut self, switch: Switch, time: f64, h: f64, scale: f64) -> Option<(f64, f64)> {
        let next = self.next.clone();
        if !self.set_slope(&next, time) {
            return None;
        }
        let friction = &self.frictions[switch.friction];
        match friction.mode {
            FrictionMode::Slip(sign) => {
                let (velocity, rate) =
                    (self.velocity(friction.axis, &next, time), self.acceleration(friction.axis, time));
                Some((sign * velocity / scale, sign * rate / scale))
            }
            FrictionMode::Stick => {
                let force = self.laws[friction.joint].force[0];
                let j = self.assembly.axes.len();
                // The rate of the polynomial through the stages, near its end. It only steers the
                // search for the switch.
                let ends = [0.95, 1.0].map(|s| {
                    let weights = extrapolation_weights(s);
                    (0..STAGES).map(|q| weights[q] * self.step.unknown[q * j + friction.axis]).sum::<f64>()
                });
                let rate = (ends[1] - ends[0]) / (0.05 * h) * friction.unit;
                Some((1.0 - force.abs() / friction.limit, -force.signum() * rate / friction.limit))
            }
        }
    }

    /// Shortens the step to a switch in it. Afterwards the step is solved, and `slope` is the
    /// time derivative at its end. Returns `None` on failure.
    fn locate(
        &mut self,
        switch: Switch,
        state: &[f64],
        (begin, longest): (StepBegin, f64),
        (scale, derivatives): (f64, bool),
    ) -> Option<RadauElimination> {
        let mut h = switch.at * longest;
        for _ in 0..self.settings.location_iterations {
            let eliminated = RadauElimination::new(&self.assembly, h);
            // the initial guess needs the time derivative at the start of the step
            if !self.set_slope(state, begin.time)
                || !self.attempt(&eliminated, state, (begin, None), (scale, derivatives))
            {
                return None;
            }
            let (margin, rate) = self.at_end(switch, begin.time + h, h, scale)?;
            let change = -margin / rate;
            // rounding of the time, and of the zero
            if margin.abs() <= self.settings.rounding || change.abs() <= f64::EPSILON * self.stretch {
                return Some(eliminated);
            }
            if !change.is_finite() {
                return None;
            }
            h = (h + change).clamp(0.1 * h, longest.min(10.0 * h));
        }
        None
    }

    /// Determines the modes after a switch at the present state, for which the time derivative
    /// before the switch is known. Multiplies the sensitivity by the saltation matrix.
    fn switched(
        &mut self,
        switch: Switch,
        state: &mut [f64],
        (time, scale): (f64, f64),
        columns: usize,
    ) -> Result<(), IntegrationError> {
        let friction = &mut self.frictions[switch.friction];
        if friction.mode == FrictionMode::Stick {
            // the force and all other quantities are continuous
            friction.mode = FrictionMode::Slip(self.laws[friction.joint].force[0].signum());
            self.enter_modes();
            return if self.set_slope(state, time) { Ok(()) } else { Err(self.redundant(time)) };
        }
        let mut next = Some(switch.friction);
        let mut stopped = Vec::new();
        while let Some(k) = next {
            stopped.push(k);
            let (axis, before) = (self.frictions[k].axis, self.slope.clone());
            let rate = self.acceleration(axis, time);
            let resting: Vec<usize> = (0..self.frictions.len())
                .filter(|&i| i == k || self.frictions[i].mode == FrictionMode::Stick)
                .collect();
            self.decide_at_rest(&resting, state, time)?;
            if columns > 0 {
                apply_saltation(&self.assembly, (axis, rate), (&before, &self.slope), (&mut self.derivative, columns));
            }
            // other joints that stop at the same instant, because their bodies move alike
            next = (0..self.frictions.len()).filter(|i| !stopped.contains(i)).find(|&i| {
                let own = &self.frictions[i];
                let FrictionMode::Slip(sign) = own.mode else { return false };
                let stops = sign * self.velocity(own.axis, state, time) <= self.settings.rounding * scale;
                stops && sign * self.acceleration(own.axis, time) < 0.0
            });
        }
        if columns > 0 {
            self.project(columns);
        }
        Ok(())
    }

    fn keep_instant(&mut self, state: &[f64]) {
        let n = self.assembly.n;
        for (joint, point) in self.assembly.joints.iter().zip(&self.laws) {
            self.force[joint.axes()].copy_from_slice(&point.force[..joint.directions]);
        }
        self.steps.push_instant(state, &self.force).copy_from_slice(&self.slope[n..2 * n]);
    }

    fn keep_step(&mut self, eliminated: &RadauElimination, time: f64) {
        let frictions = &self.frictions;
        let of_step = (&self.assembly, eliminated, &self.loads);
        self.step.record(of_step, time, &mut self.steps, |q, joint, velocity, force| {
            let own = frictions.iter().find(|friction| friction.joint == q);
            own.map_or_else(|| joint.law.contact_state(velocity, force), |friction| friction.mode.contact())
        });
    }

    /// Returns the size of the next step, and the tick at its end.
    fn length(&self, begin: StepBegin) -> (f64, u64) {
        let (tick, ticks) =
            (self.stretch / (1u64 << self.settings.levels) as f64, 1u64 << (self.settings.levels - self.level));
        if let Some(at) = begin.tick {
            return (ticks as f64 * tick, at + ticks);
        }
        // to the next tick of the level, but not by a tiny step
        let end = ((begin.time / tick / ticks as f64 + 0.1).floor() as u64 + 1) * ticks;
        let end = end.min(1 << self.settings.levels);
        (end as f64 * tick - begin.time, end)
    }

    fn stalled(&self, time: f64, step: f64) -> IntegrationError {
        self.step.stalled(&self.assembly, time, step)
    }

    /// Returns the eliminated structure for a step. Steps to or from a switch have a separate
    /// elimination.
    fn elimination(&mut self, begin: StepBegin, h: f64) -> RadauElimination {
        let kept = begin.tick.and_then(|_| self.eliminated[self.level].take());
        kept.unwrap_or_else(|| RadauElimination::new(&self.assembly, h))
    }

    fn store_elimination(&mut self, begin: StepBegin, eliminated: RadauElimination, level: usize) {
        if begin.tick.is_some() {
            self.eliminated[level] = Some(eliminated);
        }
    }

    /// Performs one step from `begin`, to its end or to the first switch in it.
    ///
    /// Returns the start of the next step, the size of this step if the next one can
    /// extrapolate it, and whether the interval ends here.
    fn advance(
        &mut self,
        state: &mut [f64],
        (begin, last): (StepBegin, Option<f64>),
        scale: (f64, f64),
        columns: usize,
    ) -> Result<(StepBegin, Option<f64>, bool), IntegrationError> {
        loop {
            let (h, end) = self.length(begin);
            if self.tried >= self.settings.step_limit || self.level > self.settings.levels {
                return Err(self.stalled(begin.time, h));
            }
            let (eliminated, level) = (self.elimination(begin, h), self.level);
            let solved = self.attempt(&eliminated, state, (begin, last), (scale.1, columns > 0));
            let error = if solved { self.error(&eliminated, state, scale) } else { f64::INFINITY };
            if error.is_nan() || error > 1.0 {
                let halvings = (error / self.settings.safety).log2() / f64::from(ESTIMATE_ORDER);
                self.level += if error.is_finite() { halvings.ceil().clamp(1.0, 4.0) as usize } else { 2 };
                self.store_elimination(begin, eliminated, level);
                continue;
            }
            let Some(switch) = self.switch(state, begin.time, scale.1) else {
                let time = begin.time + h;
                self.accept(&eliminated, state, (begin.time, time), columns)?;
                self.store_elimination(begin, eliminated, level);
                let aligned =
                    end.is_multiple_of(1 << (self.settings.levels - self.level + 1).min(self.settings.levels));
                if self.level > self.settings.min_level
                    && aligned
                    && error * 2f64.powi(ESTIMATE_ORDER) < self.settings.safety
                {
                    self.level -= 1;
                }
                let tick = self.stretch / (1u64 << self.settings.levels) as f64;
                return Ok((
                    StepBegin { time: end as f64 * tick, tick: Some(end) },
                    Some(h),
                    end == 1 << self.settings.levels,
                ));
            };
            self.store_elimination(begin, eliminated, level);
            let located = self.locate(switch, state, (begin, h), (scale.1, columns > 0));
            let Some(eliminated) = located else {
                // a smaller step locates the switch better
                self.level += 1;
                if !self.set_slope(state, begin.time) {
                    return Err(self.redundant(begin.time));
                }
                continue;
            };
            let time = begin.time + eliminated.length;
            self.accept(&eliminated, state, (begin.time, time), columns)?;
            self.switched(switch, state, (time, scale.1), columns)?;
            let ends = time >= self.stretch * (1.0 - self.settings.end_tolerance);
            return Ok((StepBegin { time, tick: None }, None, ends));
        }
    }

    /// Accepts the last solved step.
    fn accept(
        &mut self,
        eliminated: &RadauElimination,
        state: &mut [f64],
        (before, time): (f64, f64),
        columns: usize,
    ) -> Result<(), IntegrationError> {
        if columns > 0 {
            self.step.carry(&self.assembly, eliminated, &mut self.derivative, columns);
        }
        if self.keep {
            if !self.set_slope(state, before) {
                return Err(self.redundant(before));
            }
            self.keep_instant(state);
            self.keep_step(eliminated, before);
        }
        state.copy_from_slice(&self.next);
        if !self.set_slope(state, time) {
            return Err(self.redundant(time));
        }
        if self.keep {
            self.keep_instant(state);
        }
        std::mem::swap(&mut self.previous, &mut self.step.unknown);
        self.step.unknown.resize(self.previous.len(), 0.0);
        Ok(())
    }
}

impl Flow for SetValuedFlow {
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

    fn set_tolerance(&mut self, tolerance: f64) {
        self.tolerance = tolerance;
    }

    fn run(
        &mut self,
        state: &mut [f64],
        duration: f64,
        sensitivity: Option<&mut DMatrix<f64>>,
    ) -> Result<(), IntegrationError> {
        if self.stretch != duration {
            self.stretch = duration;
            self.eliminated.fill(None);
        }
        self.steps.clear();
        (self.level, self.tried) = (self.settings.first_level, 0);
        let scale = self.assembly.scales(state, &self.excitation);
        let columns = sensitivity.as_deref().map_or(0, |matrix| matrix.ncols());
        if let Some(sensitivity) = sensitivity.as_deref() {
            self.derivative.clear();
            self.derivative.extend_from_slice(sensitivity.transpose().as_slice());
        }
        self.begin(state, scale.1)?;
        if columns > 0 {
            self.project(columns);
        }
        let (mut begin, mut last, mut switches) = (StepBegin { time: 0.0, tick: Some(0) }, None, 0);
        loop {
            let (next, length, ends) = self.advance(state, (begin, last), scale, columns)?;
            if ends {
                break;
            }
            switches += usize::from(length.is_none());
            if switches > self.settings.switch_limit {
                let joint = self.frictions.first().map_or(0, |friction| friction.joint);
                let joint = self.assembly.joints[joint].joint.clone();
                return Err(IntegrationError::Chatter { time: next.time, switches, joint });
            }
            (begin, last) = (next, length);
        }
        if let Some(sensitivity) = sensitivity {
            for (at, entry) in self.derivative.iter().enumerate() {
                sensitivity[(at / columns, at % columns)] = *entry;
            }
        }
        Ok(())
    }

    fn scale_limits(&mut self, joints: &[usize], factor: f64) {
        for friction in self.frictions.iter_mut().filter(|friction| joints.contains(&friction.joint)) {
            friction.limit *= factor;
        }
    }

    fn set_recording(&mut self, keep: bool) {
        self.keep = keep;
    }

    fn path(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Arc<dyn Path> {
        Arc::new(self.stepped(system, symmetry, period))
    }
}
