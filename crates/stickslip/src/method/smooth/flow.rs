//! Steps of controlled length over a stretch of time.
//!
//! Step lengths are powers of two of a tick and start at multiples of themselves, so that every step of one length shares one
//! elimination of the structure and every run over the same stretch ends exactly at its end.

use super::step::{Eliminated, LawPoint, StageLoads, Step, Structure};
use crate::method::Breakdown;
use crate::method::drive::Drive;
use nalgebra::{DMatrix, DVector};
use stickslip_numerics::radau::{A, C, ERROR, REAL, STAGES};

/// A stretch has `2^LEVELS` ticks; the finest layers of the arctan law need about `2^20` of half a period.
const LEVELS: usize = 44;
/// The longest step is the stretch divided by `2^COARSEST`.
const COARSEST: usize = 4;
/// The first step of a run is the stretch divided by `2^FIRST_LEVEL`; the control corrects it at once.
const FIRST_LEVEL: usize = 12;
/// Steps of one run, tried ones too, beyond which it stalls. The returns of the verification tests take 300 on average, at most 6900; these
/// take a second for one mass.
const STEP_LIMIT: usize = 200_000;
/// The new step aims at this share of the tolerance.
const SAFETY: f64 = 0.8;
/// Order of the error estimate plus one.
const ORDER: f64 = 4.0;

/// What is kept of an accepted step.
#[derive(Debug, Clone)]
pub(crate) struct StepRecord {
    pub start: f64,
    pub length: f64,
    /// State at the start, then at the end: (x, v, internal).
    pub from: Vec<f64>,
    pub to: Vec<f64>,
    /// Accelerations at the start and at the end.
    pub accelerations: (Vec<f64>, Vec<f64>),
    /// Stage displacements and velocities, 6n.
    pub stages: Vec<f64>,
    /// Relative velocity and force of the joints at the stages, stage after stage.
    pub joints: Vec<(f64, f64)>,
}

/// Runs the motion of a smooth structure.
pub(crate) struct SmoothFlow {
    pub structure: Structure,
    pub drive: Drive,
    /// Relative error per step.
    pub tolerance: f64,
    /// Whether accepted steps are kept.
    pub record: bool,
    pub steps: Vec<StepRecord>,
    /// Whether runs repeat the step lengths of the last free run: the end state is then a smooth function of the start.
    pub frozen: bool,
    /// Levels of the accepted steps of the last free run, in order.
    mesh: Vec<usize>,
    /// Accepted steps of the last run.
    pub accepted: usize,
    /// Rejected steps of the last run.
    pub rejected: usize,
    stretch: f64,
    eliminated: Vec<Option<Eliminated>>,
    step: Step,
    loads: StageLoads,
    level: usize,
}

impl SmoothFlow {
    pub fn new(structure: Structure, tolerance: f64) -> Self {
        let step = Step::new(&structure);
        SmoothFlow {
            structure,
            drive: Drive::default(),
            tolerance,
            record: false,
            steps: Vec::new(),
            frozen: false,
            mesh: Vec::new(),
            accepted: 0,
            rejected: 0,
            stretch: 0.0,
            eliminated: vec![None; LEVELS + 1],
            step,
            loads: StageLoads::default(),
            level: FIRST_LEVEL,
        }
    }

    /// Runs from `state` (changed to the end state) over `[start, start + duration]`; see `Flow::run` of the exact method.
    pub fn run(
        &mut self,
        state: &mut [f64],
        start: f64,
        duration: f64,
        mut sensitivity: Option<&mut DMatrix<f64>>,
    ) -> Result<(), Breakdown> {
        if self.stretch != duration {
            self.stretch = duration;
            self.eliminated.iter_mut().for_each(|e| *e = None);
        }
        (self.accepted, self.rejected) = (0, 0);
        self.steps.clear();
        let tick = duration / (1u64 << LEVELS) as f64;
        let scale = self.scales(state);
        let total = 1u64 << LEVELS;
        let mut position = 0u64;
        // level: the step is 2^(LEVELS - level) ticks; a run starts like every run of the same stretch does, for equal bits
        self.level = FIRST_LEVEL;
        let frozen = self.frozen && !self.mesh.is_empty();
        if !frozen {
            self.mesh.clear();
        }
        let (n, j) = (self.structure.n, self.structure.joints.len());
        let mut slope = self.slope(state, start);
        let mut previous: Option<(f64, Vec<f64>)> = None;
        while position < total {
            if frozen {
                // the mesh covers the stretch exactly
                self.level = self.mesh[self.accepted];
            }
            let ticks = 1u64 << (LEVELS - self.level);
            let time = start + position as f64 * tick;
            let h = ticks as f64 * tick;
            if self.accepted + self.rejected >= STEP_LIMIT {
                return Err(Breakdown::Stalled { time, step: h });
            }
            if self.eliminated[self.level].is_none() {
                self.eliminated[self.level] = Some(Eliminated::new(&self.structure, h));
            }
            self.set_loads(time, h);
            self.predict(state, h, previous.as_ref(), time);
            let eliminated = self.eliminated[self.level].as_ref().expect("just made");
            let solved = self.step.solve(&self.structure, eliminated, &self.loads, state, scale.1);
            let error = match (solved, frozen) {
                (true, true) => 0.0,
                (true, false) => self.error(state, &slope, time, h, scale),
                (false, true) => {
                    // a layer has moved out of its fine steps: from now on the mesh has two halves here
                    if self.level == LEVELS {
                        return Err(Breakdown::Stalled { time, step: h });
                    }
                    self.rejected += 1;
                    self.mesh[self.accepted] += 1;
                    self.mesh.insert(self.accepted, self.level + 1);
                    continue;
                }
                (false, false) => f64::INFINITY,
            };
            if !error.is_finite() || error > 1.0 {
                self.rejected += 1;
                // an estimate of order 4 in h: how many halvings bring it below one
                let halvings = if error.is_finite() {
                    ((error / SAFETY).log2() / ORDER).ceil().clamp(1.0, 4.0) as usize
                } else {
                    2
                };
                self.level += halvings;
                if self.level > LEVELS {
                    return Err(Breakdown::Stalled { time, step: h });
                }
                continue;
            }
            let mut next = vec![0.0; state.len()];
            next[..n].copy_from_slice(&self.step.stages.as_slice()[(STAGES - 1) * n..STAGES * n]);
            next[n..2 * n].copy_from_slice(&self.step.stages.as_slice()[(2 * STAGES - 1) * n..]);
            let internal = self.structure.internal;
            let last = STAGES * j + (STAGES - 1) * internal;
            next[2 * n..].copy_from_slice(&self.step.unknown.as_slice()[last..last + internal]);
            if next.iter().any(|z| !z.is_finite()) {
                return Err(Breakdown::Unbounded { time });
            }
            if let Some(sensitivity) = sensitivity.as_deref_mut() {
                self.step.carry(&self.structure, eliminated, sensitivity);
            }
            let next_slope = self.slope(&next, time + h);
            if self.record {
                self.keep(time, h, state, &next, &slope, &next_slope);
            }
            previous = Some((h, self.step.unknown.as_slice().to_vec()));
            state.copy_from_slice(&next);
            slope = next_slope;
            self.accepted += 1;
            if !frozen {
                self.mesh.push(self.level);
            }
            position += ticks;
            // a longer step only where it starts at a multiple of itself and its error is expected to pass
            if self.level > COARSEST
                && position.is_multiple_of(1u64 << (LEVELS - self.level + 1))
                && error * 2f64.powf(ORDER) < SAFETY
            {
                self.level -= 1;
            }
        }
        Ok(())
    }

    /// Scales of displacement and velocity for the error norm.
    fn scales(&self, state: &[f64]) -> (f64, f64) {
        let n = self.structure.n;
        let natural = (0..n).map(|i| (self.structure.stiffness[(i, i)] / self.structure.mass[(i, i)]).sqrt());
        // without a drive the structure's own frequencies set the time scale
        let rate = if self.drive.omega > 0.0 { self.drive.omega } else { natural.fold(f64::MIN_POSITIVE, f64::max) };
        let x = state[..n].iter().fold(0.0f64, |a, x| a.max(x.abs()));
        let v = state[n..2 * n].iter().fold(0.0f64, |a, v| a.max(v.abs()));
        let mobility = if n == 0 { 0.0 } else { self.structure.inverse_mass.amax().sqrt() };
        let loads = self.drive.energy_scale(&self.structure.mass, &self.structure.stiffness) * mobility;
        let velocity = v.max(x * rate).max(self.drive.imposed_velocity()).max(1e-3 * loads).max(f64::MIN_POSITIVE);
        (velocity / rate, velocity)
    }

    fn set_loads(&mut self, time: f64, h: f64) {
        let (n, j) = (self.structure.n, self.structure.joints.len());
        self.loads.force.resize_vertically_mut(STAGES * n, 0.0);
        self.loads.stage.clear();
        let mut force = DVector::zeros(n);
        for (i, c) in C.iter().enumerate() {
            let at = time + c * h;
            force.fill(0.0);
            self.drive.add_force(at, 0, &mut force);
            self.loads.force.rows_mut(i * n, n).copy_from(&force);
            for q in 0..j {
                self.loads.stage.push((self.drive.imposed_at(q, at, 0), self.drive.imposed_at(q, at, 1)));
            }
        }
    }

    /// First guess of the step's unknowns: the last step's collocation polynomial continued, or the state held.
    fn predict(&mut self, state: &[f64], h: f64, previous: Option<&(f64, Vec<f64>)>, time: f64) {
        let (n, j, internal) = (self.structure.n, self.structure.joints.len(), self.structure.internal);
        let unknown = &mut self.step.unknown;
        match previous {
            Some((length, values)) => {
                let count = j + internal;
                let at = |stage: usize, k: usize| {
                    if k < j { values[stage * j + k] } else { values[STAGES * j + stage * internal + k - j] }
                };
                for (i, c) in C.iter().enumerate() {
                    let s = 1.0 + c * h / length;
                    // Lagrange polynomial through the three stages
                    let weights = [
                        (s - C[1]) * (s - C[2]) / ((C[0] - C[1]) * (C[0] - C[2])),
                        (s - C[0]) * (s - C[2]) / ((C[1] - C[0]) * (C[1] - C[2])),
                        (s - C[0]) * (s - C[1]) / ((C[2] - C[0]) * (C[2] - C[1])),
                    ];
                    for k in 0..count {
                        let value: f64 = (0..STAGES).map(|q| weights[q] * at(q, k)).sum();
                        let index = if k < j { i * j + k } else { STAGES * j + i * internal + k - j };
                        unknown[index] = value;
                    }
                }
            }
            None => {
                for i in 0..STAGES {
                    for (q, joint) in self.structure.joints.iter().enumerate() {
                        let structural: f64 = (0..n).map(|k| joint.direction[k] * state[n + k]).sum();
                        unknown[i * j + q] = structural + self.drive.imposed_at(q, time, 1);
                    }
                    for s in 0..internal {
                        unknown[STAGES * j + i * internal + s] = state[2 * n + s];
                    }
                }
            }
        }
    }

    /// Time derivative of the state.
    pub fn slope(&self, state: &[f64], time: f64) -> Vec<f64> {
        let n = self.structure.n;
        let mut force = DVector::zeros(n);
        self.drive.add_force(time, 0, &mut force);
        let mut slope = vec![0.0; state.len()];
        for i in 0..n {
            slope[n + i] = (0..n)
                .map(|k| {
                    self.structure.inverse_mass[(i, k)] * force[k]
                        - self.structure.stiffness_rate[(i, k)] * state[k]
                        - self.structure.damping_rate[(i, k)] * state[n + k]
                })
                .sum();
        }
        for (q, joint) in self.structure.joints.iter().enumerate() {
            let point = self.law_point(q, state, time);
            for i in 0..n {
                slope[n + i] -= joint.mobility[i] * point.force;
            }
            for s in 0..joint.states {
                slope[2 * n + joint.first_state + s] = point.rate[s];
            }
        }
        slope[..n].copy_from_slice(&state[n..2 * n]);
        slope
    }

    /// The law of joint `q` at a state.
    pub fn law_point(&self, q: usize, state: &[f64], time: f64) -> LawPoint {
        let (n, joint) = (self.structure.n, &self.structure.joints[q]);
        let along = |v: &[f64]| (0..n).map(|i| joint.direction[i] * v[i]).sum::<f64>();
        let u = along(&state[..n]) + self.drive.imposed_at(q, time, 0);
        let velocity = along(&state[n..2 * n]) + self.drive.imposed_at(q, time, 1);
        let first = 2 * n + joint.first_state;
        LawPoint::new(&*joint.law, u, velocity, &state[first..first + joint.states])
    }

    /// Error of the step relative to the tolerance: the embedded estimate, filtered so that stiff components do not dominate it.
    fn error(&self, state: &[f64], slope: &[f64], time: f64, h: f64, scale: (f64, f64)) -> f64 {
        let (n, j, internal, states) =
            (self.structure.n, self.structure.joints.len(), self.structure.internal, self.structure.states());
        if states == 0 {
            return self.error_of_work(time, h, scale.0);
        }
        let mut raw = DVector::from_column_slice(slope);
        for (i, weight) in ERROR.iter().enumerate() {
            for k in 0..n {
                raw[k] += weight / h * (self.step.stages[i * n + k] - state[k]);
                raw[n + k] += weight / h * (self.step.stages[(STAGES + i) * n + k] - state[n + k]);
            }
            for s in 0..internal {
                let stage = self.step.unknown[STAGES * j + i * internal + s];
                raw[2 * n + s] += weight / h * (stage - state[2 * n + s]);
            }
        }
        let mut filter = DMatrix::from_diagonal_element(states, states, REAL / h);
        for i in 0..n {
            filter[(i, n + i)] -= 1.0;
            for k in 0..n {
                filter[(n + i, k)] += self.structure.stiffness_rate[(i, k)];
                filter[(n + i, n + k)] += self.structure.damping_rate[(i, k)];
            }
        }
        for q in 0..j {
            let point = self.law_point(q, state, time);
            let joint = &self.structure.joints[q];
            for i in 0..n {
                for k in 0..n {
                    let outer = joint.mobility[i] * joint.direction[k];
                    filter[(n + i, k)] += outer * point.force_slope[0];
                    filter[(n + i, n + k)] += outer * point.force_slope[1];
                }
            }
            for s in 0..joint.states {
                let own = 2 * n + joint.first_state + s;
                for k in 0..n {
                    filter[(own, k)] -= point.rate_slope[s][0] * joint.direction[k];
                    filter[(own, n + k)] -= point.rate_slope[s][1] * joint.direction[k];
                    filter[(n + k, own)] += joint.mobility[k] * point.force_slope[2 + s];
                }
                for t in 0..joint.states {
                    filter[(own, 2 * n + joint.first_state + t)] -= point.rate_slope[s][2 + t];
                }
            }
        }
        let factor = filter.lu();
        let norm = |error: &DVector<f64>| {
            let mut largest = 0.0f64;
            for i in 0..n {
                largest = largest.max(error[i].abs() / scale.0).max(error[n + i].abs() / scale.1);
            }
            for s in 0..internal {
                largest = largest.max(error[2 * n + s].abs() / (1.0 + state[2 * n + s].abs()));
            }
            largest / self.tolerance
        };
        let Some(error) = factor.solve(&raw) else { return f64::INFINITY };
        let mut size = norm(&error);
        if size >= 1.0 {
            // Hairer and Wanner's second filter, for steps across a layer
            let shifted: Vec<f64> = state.iter().zip(error.iter()).map(|(z, e)| z + e).collect();
            let again = self.slope(&shifted, time);
            let second = DVector::from_fn(states, |i, _| raw[i] - slope[i] + again[i]);
            if let Some(error) = factor.solve(&second) {
                size = norm(&error).min(size);
            }
        }
        size
    }

    /// The same for joints that are only moved: nothing is integrated there but their work, so its estimate chooses the steps.
    fn error_of_work(&self, time: f64, h: f64, travel: f64) -> f64 {
        let j = self.structure.joints.len();
        let mut largest = 0.0f64;
        for (q, joint) in self.structure.joints.iter().enumerate() {
            let power = |k: usize| self.step.unknown[k * j + q] * self.step.force[k * j + q];
            let mut raw = self.law_point(q, &[], time).force * self.drive.imposed_at(q, time, 1);
            for (weight, row) in ERROR.iter().zip(A) {
                raw += weight * row.iter().enumerate().map(|(k, a)| a * power(k)).sum::<f64>();
            }
            largest = largest.max((raw * h / REAL).abs() / (joint.limit * travel * self.tolerance));
        }
        largest
    }

    fn keep(&mut self, start: f64, length: f64, from: &[f64], to: &[f64], slope: &[f64], next: &[f64]) {
        let n = self.structure.n;
        let j = self.structure.joints.len();
        self.steps.push(StepRecord {
            start,
            length,
            from: from.to_vec(),
            to: to.to_vec(),
            accelerations: (slope[n..2 * n].to_vec(), next[n..2 * n].to_vec()),
            stages: self.step.stages.as_slice().to_vec(),
            joints: (0..STAGES * j).map(|i| (self.step.unknown[i], self.step.force[i])).collect(),
        });
    }

    /// Integrates a function of (stage in 0..3, step) over the recorded steps with the method's own quadrature.
    pub fn integral(&self, mut at: impl FnMut(&StepRecord, usize) -> f64) -> f64 {
        self.steps
            .iter()
            .map(|step| step.length * (0..STAGES).map(|i| A[STAGES - 1][i] * at(step, i)).sum::<f64>())
            .sum()
    }
}
