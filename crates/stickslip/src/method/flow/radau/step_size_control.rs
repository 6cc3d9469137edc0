//! Step size control for the smooth flow.
//!
//! A step size is a power of two times a tick, and a step starts at a multiple of its size.
//! Therefore all steps of one size share one elimination of the structure, and every run over
//! the same interval ends exactly at its end.

use super::radau_step::{RadauElimination, RadauStep, StageLoads, evaluation_points, extrapolation_weights};
use crate::law::RatePoint;
use crate::method::IntegrationError;
use crate::method::flow::Flow;
use crate::method::flow::assembly::Assembly;
use crate::method::flow::excitation::HarmonicExcitation;
use crate::method::flow::step_record::StepRecord;
use crate::method::flow::trajectory::Trajectory;
use crate::model::System;
use crate::orbit::{Path, Symmetry};
use nalgebra::DMatrix;
use std::sync::Arc;
use stickslip_numerics::radau::{BUTCHER_MATRIX, ERROR_WEIGHTS, ESTIMATE_ORDER, NODES, REAL_EIGENVALUE, STAGES};

/// Settings of the step size control.
#[derive(Debug, Clone, Copy)]
struct RadauSettings {
    /// The time interval has `2^levels` ticks. The finest layers of the arctan law need about
    /// `2^20` steps per half period.
    levels: usize,
    /// The largest step is the interval divided by `2^min_level`.
    min_level: usize,
    /// The first step of a run is the interval divided by `2^first_level`. The step size control
    /// corrects it at once.
    first_level: usize,
    /// Largest number of steps of one run, including rejected ones. The returns of the
    /// verification tests take 300 on average, at most 6900. This limit takes a second for one
    /// mass.
    step_limit: usize,
    /// Ratio of the velocity to the initial scale above which a motion without an acceptable step
    /// size counts as unbounded. Errors are relative to the initial scale and vanish in rounding
    /// at a ratio of 1e7. Contacts that are too stiff fail at ratios of a few.
    unbounded_ratio: f64,
    /// Fraction of the tolerance for the error of the next step.
    safety: f64,
    /// Growth of the number of steps at which halved steps are replaced by newly chosen ones.
    /// Layers move and leave short steps behind.
    rechoice_ratio: usize,
}

impl Default for RadauSettings {
    fn default() -> Self {
        RadauSettings {
            levels: 44,
            min_level: 4,
            first_level: 12,
            step_limit: 200_000,
            unbounded_ratio: 1e5,
            safety: 0.8,
            rechoice_ratio: 2,
        }
    }
}

/// The source of the step sizes of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StepSizes {
    /// The error estimate of each step.
    Chosen,
    /// The steps of the last run, halved where the error requires it.
    ///
    /// Runs from nearby states then use the same steps, whereas chosen steps would differ by up
    /// to their error. The error of a halved step does not exceed that of a chosen one.
    Halved,
    /// The steps of the last run, unchanged. The end state is then a smooth function of the
    /// initial state.
    Repeated,
}

/// Flow of a structure with smooth laws.
pub(crate) struct RadauFlow {
    settings: RadauSettings,
    pub assembly: Assembly,
    pub excitation: HarmonicExcitation,
    /// Relative error per step.
    pub tolerance: f64,
    keep: bool,
    steps: StepRecord,
    pub lengths: StepSizes,
    /// Levels of the accepted steps of the last run, in order. `chosen` is their number when
    /// they were chosen.
    mesh: Vec<usize>,
    chosen: usize,
    /// Numbers of accepted and rejected steps of the last run. `again` marks the first attempt
    /// and an attempt after a rejection.
    accepted: usize,
    rejected: usize,
    again: bool,
    interval: f64,
    eliminated: Vec<Option<RadauElimination>>,
    /// Extrapolation weights from the stages of one step to those of the next one, by the
    /// difference of their levels.
    onward: Vec<Option<[[f64; STAGES]; STAGES]>>,
    step: RadauStep,
    loads: StageLoads,
    level: usize,
    /// The laws and the time derivative of the state at the start of the step.
    laws: Vec<RatePoint>,
    slope: Vec<f64>,
    next: Vec<f64>,
    next_slope: Vec<f64>,
    /// The sensitivity of a run, row by row.
    derivative: Vec<f64>,
    /// Scratch memory: unknowns of the last step, two error estimates, loads and forces at an
    /// instant.
    previous: Vec<f64>,
    error: Vec<f64>,
    second: Vec<f64>,
    load: Vec<f64>,
    force: Vec<f64>,
}

impl RadauFlow {
    pub fn new(assembly: Assembly, tolerance: f64) -> Self {
        let (states, n, j) = (assembly.states(), assembly.n, assembly.axes.len());
        let nodes = NODES.into_iter().zip(BUTCHER_MATRIX[STAGES - 1]).collect();
        let settings = RadauSettings::default();
        RadauFlow {
            settings,
            excitation: HarmonicExcitation::default(),
            tolerance,
            keep: false,
            steps: StepRecord::new(nodes, &assembly),
            lengths: StepSizes::Chosen,
            mesh: Vec::new(),
            chosen: 0,
            accepted: 0,
            rejected: 0,
            again: false,
            interval: 0.0,
            eliminated: vec![None; settings.levels + 1],
            onward: vec![None; 2 * settings.levels + 1],
            step: RadauStep::new(&assembly),
            loads: StageLoads::default(),
            level: settings.first_level,
            laws: evaluation_points(&assembly),
            slope: vec![0.0; states],
            next: vec![0.0; states],
            next_slope: vec![0.0; states],
            derivative: Vec::new(),
            previous: Vec::new(),
            error: vec![0.0; states],
            second: vec![0.0; states],
            load: vec![0.0; n],
            force: vec![0.0; j],
            assembly,
        }
    }

    /// Returns the scales of displacement and velocity for the error norm.
    fn scales(&self, state: &[f64]) -> (f64, f64) {
        self.assembly.scales(state, &self.excitation)
    }

    /// Sets the initial guess of the step's unknowns: the extrapolated collocation polynomial
    /// of the last step, or the constant state.
    fn predict(&mut self, state: &[f64], h: f64, last: Option<(usize, f64)>, time: f64) {
        let (n, j, internal) = (self.assembly.n, self.assembly.axes.len(), self.assembly.internal);
        let Some((level, length)) = last else {
            let unknown = &mut self.step.unknown;
            for i in 0..STAGES {
                for axis in 0..j {
                    unknown[i * j + axis] = self.assembly.relative(axis, state, &self.excitation, time).1;
                }
                let first = STAGES * j + i * internal;
                unknown[first..first + internal].copy_from_slice(&state[2 * n..]);
            }
            return;
        };
        let onward = self.onward[self.settings.levels + self.level - level]
            .get_or_insert_with(|| NODES.map(|c| extrapolation_weights(1.0 + c * h / length)));
        self.step.extrapolate(&self.assembly, &self.previous, onward);
    }

    /// Evaluates the laws at a state, in `laws`.
    fn set_laws(&mut self, state: &[f64], time: f64) {
        let n = self.assembly.n;
        for (joint, point) in self.assembly.joints.iter().zip(&mut self.laws) {
            let motion = self.assembly.motion_of(joint, state, &self.excitation, time);
            let first = 2 * n + joint.first_state;
            if let Some(rate) = joint.law.rate() {
                rate.evaluate_with_derivatives(joint.directions, &motion, &state[first..first + joint.states], point);
            }
        }
    }

    /// Returns the error of the step relative to the tolerance: the embedded estimate with a
    /// filter, so that stiff components do not dominate.
    ///
    /// A step at the border of a layer is stiff at only one end. A filter from the stiff end
    /// would hide an error at the layer. Therefore the larger of both filtered estimates
    /// counts.
    fn error(&mut self, state: &[f64], time: f64, scale: (f64, f64)) -> f64 {
        if self.assembly.states() == 0 {
            return self.error_of_work(time, scale.0);
        }
        let Some(eliminated) = &self.eliminated[self.level] else { return f64::INFINITY };
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
        // initial value of the second filter
        for ((second, raw), slope) in self.second.iter_mut().zip(&self.error).zip(&self.slope) {
            *second = raw - slope;
        }
        self.step.filter(assembly, eliminated, &self.laws, &mut self.error);
        let size = at_end.max(self.size(&self.error, state, scale));
        if size < 1.0 || !self.again {
            return size;
        }
        // Hairer and Wanner's second filter, for first steps and those after a rejection
        for (shifted, (z, error)) in self.next.iter_mut().zip(state.iter().zip(&self.error)) {
            *shifted = z + error;
        }
        let mut shifted = std::mem::take(&mut self.next);
        let laws = self.laws.clone();
        self.set_laws(&shifted, time);
        time_derivative(
            &self.assembly,
            (&shifted, &mut self.load, &mut self.force),
            &self.laws,
            &self.excitation,
            time,
            &mut self.error,
        );
        self.laws = laws;
        std::mem::swap(&mut self.next, &mut shifted);
        self.second.iter_mut().zip(&self.error).for_each(|(second, again)| *second += again);
        let Some(eliminated) = &self.eliminated[self.level] else { return size };
        self.step.filter(&self.assembly, eliminated, &self.laws, &mut self.second);
        self.size(&self.second, state, scale).min(size)
    }

    /// Returns the size of an error estimate relative to the tolerance.
    fn size(&self, error: &[f64], state: &[f64], scale: (f64, f64)) -> f64 {
        self.assembly.error_size(error, state, scale) / self.tolerance
    }

    /// Returns the error for joints with imposed motion only. Only their work is integrated
    /// there, and its estimate controls the steps.
    fn error_of_work(&self, time: f64, travel: f64) -> f64 {
        let j = self.assembly.axes.len();
        let h = self.eliminated[self.level].as_ref().map_or(0.0, |eliminated| eliminated.length);
        let mut largest = 0.0f64;
        for (joint, point) in self.assembly.joints.iter().zip(&self.laws) {
            for (d, axis) in joint.axes().enumerate() {
                let power = |k: usize| self.step.unknown[k * j + axis] * self.step.force[k * j + axis];
                let mut raw = point.force[d] * self.excitation.relative_at(axis, time).1;
                for (weight, row) in ERROR_WEIGHTS.iter().zip(BUTCHER_MATRIX) {
                    raw += weight * row.iter().enumerate().map(|(k, a)| a * power(k)).sum::<f64>();
                }
                // the reference of an unbounded law is its present force
                let limit = joint.law.force_scale();
                let force = if limit.is_finite() { limit } else { self.step.force.amax().max(point.force[d].abs()) };
                if raw != 0.0 {
                    largest = largest.max((raw * h / REAL_EIGENVALUE).abs() / (force * travel * self.tolerance));
                }
            }
        }
        largest
    }

    fn keep_instant(&mut self, state: &[f64], time: f64) {
        forces(&self.assembly, &self.laws, &mut self.force);
        self.excitation.load(time, &mut self.load);
        let acceleration = self.steps.push_instant(state, &self.force);
        self.assembly.accelerate(state, &mut self.load, &self.force, acceleration);
    }

    fn keep_step(&mut self, time: f64) {
        let Some(eliminated) = &self.eliminated[self.level] else { return };
        self.step.record(
            (&self.assembly, eliminated, &self.loads),
            time,
            &mut self.steps,
            |_, joint, velocity, force| joint.law.contact_state(velocity, force),
        );
    }

    /// Returns the size of a step of the present level, s.
    fn length(&self, tick: f64) -> f64 {
        (1u64 << (self.settings.levels - self.level)) as f64 * tick
    }

    /// Returns the reason why no step is small enough.
    ///
    /// The motion diverges (in finite time if a force grows faster than the displacement), a
    /// law returns NaN, or the equations are too stiff. `speed` is the velocity scale at the
    /// start, m/s.
    fn stalled(&self, state: &[f64], time: f64, step: f64, speed: f64) -> IntegrationError {
        let n = self.assembly.n;
        let fastest = state[n..2 * n].iter().fold(0.0f64, |fast, v| fast.max(v.abs()));
        if fastest > self.settings.unbounded_ratio * speed {
            return IntegrationError::Unbounded { time, place: self.assembly.farthest(state) };
        }
        self.step.stalled(&self.assembly, time, step)
    }

    /// Returns the size of the next attempt (s), or `None` at the step limit. Sets the level if
    /// the mesh is given.
    fn attempt(&mut self, lengths: StepSizes, tick: f64) -> Option<f64> {
        if lengths != StepSizes::Chosen {
            // the mesh covers the interval exactly
            self.level = self.mesh[self.accepted];
        }
        let h = self.length(tick);
        if self.accepted + self.rejected >= self.settings.step_limit {
            return None;
        }
        if self.eliminated[self.level].is_none() {
            self.eliminated[self.level] = Some(RadauElimination::new(&self.assembly, h));
        }
        Some(h)
    }

    /// Reduces the step after a failed attempt. Returns false if it is already the smallest.
    fn shorten(&mut self, lengths: StepSizes, error: f64) -> bool {
        self.rejected += 1;
        if lengths != StepSizes::Chosen {
            // a layer has moved out of its small steps; split this step of the mesh into two
            // halves
            if self.level == self.settings.levels {
                return false;
            }
            self.mesh[self.accepted] += 1;
            self.mesh.insert(self.accepted, self.level + 1);
            return true;
        }
        // number of halvings that bring the error below one
        let halvings = if error.is_finite() {
            ((error / self.settings.safety).log2() / f64::from(ESTIMATE_ORDER)).ceil().clamp(1.0, 4.0) as usize
        } else {
            2
        };
        self.level += halvings;
        self.level <= self.settings.levels
    }
}

/// Collects the forces along the axes.
fn forces(assembly: &Assembly, laws: &[RatePoint], force: &mut [f64]) {
    for (joint, point) in assembly.joints.iter().zip(laws) {
        force[joint.axes()].copy_from_slice(&point.force[..joint.directions]);
    }
}

/// Computes the time derivative of a state for evaluated laws.
pub(in crate::method) fn time_derivative(
    assembly: &Assembly,
    (state, load, force): (&[f64], &mut [f64], &mut [f64]),
    laws: &[RatePoint],
    excitation: &HarmonicExcitation,
    time: f64,
    out: &mut [f64],
) {
    let n = assembly.n;
    excitation.load(time, load);
    forces(assembly, laws, force);
    let (x, rest) = out.split_at_mut(n);
    let (v, internal) = rest.split_at_mut(n);
    x.copy_from_slice(&state[n..2 * n]);
    assembly.accelerate(state, load, force, v);
    for (joint, point) in assembly.joints.iter().zip(laws) {
        internal[joint.internal()].copy_from_slice(&point.rate);
    }
}

impl Flow for RadauFlow {
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
        if self.interval != duration {
            self.interval = duration;
            self.eliminated.fill(None);
            self.onward.fill(None);
        }
        (self.accepted, self.rejected, self.again) = (0, 0, true);
        self.steps.clear();
        let tick = duration / (1u64 << self.settings.levels) as f64;
        let scale = self.scales(state);
        let total = 1u64 << self.settings.levels;
        let mut position = 0u64;
        // a step has 2^(levels - level) ticks; all runs over the same interval start at the
        // same level, for equal bits
        self.level = self.settings.first_level;
        let lengths = match self.lengths {
            StepSizes::Halved if self.mesh.len() > self.settings.rechoice_ratio * self.chosen => StepSizes::Chosen,
            _ if self.mesh.is_empty() => StepSizes::Chosen,
            lengths => lengths,
        };
        if lengths == StepSizes::Chosen {
            self.mesh.clear();
        }
        let joints = self.assembly.joints.len();
        self.set_laws(state, 0.0);
        time_derivative(
            &self.assembly,
            (state, &mut self.load, &mut self.force),
            &self.laws,
            &self.excitation,
            0.0,
            &mut self.slope,
        );
        if self.keep {
            self.keep_instant(state, 0.0);
        }
        if let Some(sensitivity) = sensitivity.as_deref() {
            self.derivative.clear();
            self.derivative.extend_from_slice(sensitivity.transpose().as_slice());
        }
        let mut last = None;
        while position < total {
            let time = position as f64 * tick;
            let h = self.attempt(lengths, tick).ok_or_else(|| self.stalled(state, time, self.length(tick), scale.1))?;
            let ticks = 1u64 << (self.settings.levels - self.level);
            self.loads.set(&self.assembly, &self.excitation, time, h);
            self.predict(state, h, last, time);
            let Some(eliminated) = &self.eliminated[self.level] else {
                return Err(IntegrationError::Stalled { time, step: h });
            };
            let how = (scale.1, sensitivity.is_some());
            let solved = self.step.solve(&self.assembly, eliminated, &self.loads, state, how);
            let error = match (solved, lengths) {
                (true, StepSizes::Repeated) => 0.0,
                (true, StepSizes::Chosen | StepSizes::Halved) => self.error(state, time, scale),
                (false, _) => f64::INFINITY,
            };
            self.again = !error.is_finite() || error > 1.0;
            if self.again {
                if !self.shorten(lengths, error) {
                    return Err(self.stalled(state, time, h, scale.1));
                }
                continue;
            }
            let Some(eliminated) = &self.eliminated[self.level] else {
                return Err(IntegrationError::Stalled { time, step: h });
            };
            self.step.end(&self.assembly, eliminated, &self.loads, &mut self.next);
            if self.next.iter().any(|z| !z.is_finite()) {
                return Err(IntegrationError::Unbounded { time, place: self.assembly.farthest(&self.next) });
            }
            if let Some(sensitivity) = sensitivity.as_deref() {
                self.step.carry(&self.assembly, eliminated, &mut self.derivative, sensitivity.ncols());
            }
            // the last stage is the end of the step
            self.laws.swap_with_slice(&mut self.step.points[(STAGES - 1) * joints..]);
            if lengths != StepSizes::Repeated {
                let work = (self.next.as_slice(), self.load.as_mut_slice(), self.force.as_mut_slice());
                time_derivative(&self.assembly, work, &self.laws, &self.excitation, time + h, &mut self.next_slope);
                std::mem::swap(&mut self.slope, &mut self.next_slope);
            }
            state.copy_from_slice(&self.next);
            if self.keep {
                self.keep_step(time);
                self.keep_instant(state, time + h);
            }
            last = Some((self.level, h));
            std::mem::swap(&mut self.previous, &mut self.step.unknown);
            self.step.unknown.resize(self.previous.len(), 0.0);
            self.accepted += 1;
            if lengths == StepSizes::Chosen {
                self.mesh.push(self.level);
            }
            position += ticks;
            // double the step only if it starts at a multiple of its size and its expected
            // error passes
            if self.level > self.settings.min_level
                && position.is_multiple_of(1u64 << (self.settings.levels - self.level + 1))
                && error * 2f64.powi(ESTIMATE_ORDER) < self.settings.safety
            {
                self.level -= 1;
            }
        }
        if lengths == StepSizes::Chosen {
            self.chosen = self.mesh.len();
        }
        if let Some(sensitivity) = sensitivity {
            let columns = sensitivity.ncols();
            for (at, entry) in self.derivative.iter().enumerate() {
                sensitivity[(at / columns, at % columns)] = *entry;
            }
        }
        Ok(())
    }

    fn set_recording(&mut self, keep: bool) {
        self.keep = keep;
    }

    fn path(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Arc<dyn Path> {
        Arc::new(self.stepped(system, symmetry, period))
    }
}

impl RadauFlow {
    /// Returns the path of the last stored run, which repeats after `period`.
    pub fn stepped(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Trajectory {
        Trajectory::new((system, &self.assembly), &self.excitation, &self.steps, (symmetry, period))
    }
}
