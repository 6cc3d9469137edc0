//! The orbit's numbers from its integration steps.

use super::flow::{SmoothFlow, StepRecord};
use crate::law::{Contact, SLIPS_ABOVE};
use crate::method::drive::Drive;
use crate::method::periodic::Closed;
use crate::model::System;
use crate::orbit::{Accuracy, Energy, Evidence, JointMotion, JointSample, Orbit, Path, PlaceMotion, Sample, Symmetry};
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::radau::{C, quintic};

use super::step::{LawPoint, Structure};

/// Turning points are refined until the step in time is below this fraction of the integration step.
const REFINED: f64 = 1e-12;

pub(crate) struct SteppedPath {
    steps: Vec<StepRecord>,
    structure: Structure,
    drive: Drive,
    system: System,
    symmetry: Symmetry,
    period: f64,
}

/// Makes the orbit of the flow's last, recorded run.
pub(crate) fn orbit(
    (system, contracts): (&System, bool),
    flow: &SmoothFlow,
    method: &'static str,
    omega: f64,
    symmetry: Symmetry,
    closed: Closed,
) -> Orbit {
    let times = if symmetry == Symmetry::HalfPeriod { 2.0 } else { 1.0 };
    let period = std::f64::consts::TAU / omega;
    let places = places(system, flow, omega, symmetry);
    let joints = joints(system, flow, period, symmetry);
    let energy = energy(system, flow, times);
    let path = SteppedPath::new(system, flow, symmetry, period);
    let balance = energy.work_in - energy.viscous - energy.friction;
    Orbit {
        method,
        omega,
        symmetry,
        start: closed.state,
        evidence: Evidence {
            residual: closed.residual,
            energy_gap: if energy.work_in.abs() > 0.0 { balance.abs() / energy.work_in.abs() } else { balance.abs() },
            switches: joints.iter().map(|joint| joint.switches).sum(),
            iterations: closed.iterations,
            truncation: closed.missing,
            accuracy: Accuracy::Converged,
            stuck: joints.iter().filter(|joint| joint.slip_fraction == 0.0).map(|joint| joint.name.clone()).collect(),
        },
        places,
        joints,
        energy,
        return_map: closed.derivative,
        contracts,
        path: Arc::new(path),
    }
}

impl SteppedPath {
    /// The recorded steps of the flow's last run.
    pub fn new(system: &System, flow: &SmoothFlow, symmetry: Symmetry, period: f64) -> Self {
        SteppedPath {
            steps: flow.steps.clone(),
            structure: flow.structure.clone(),
            drive: flow.drive.clone(),
            system: system.clone(),
            symmetry,
            period,
        }
    }
}

impl StepRecord {
    /// Displacement, velocity, acceleration of degree of freedom `i` at `s` in [0, 1] of the step.
    fn motion(&self, n: usize, i: usize, s: f64) -> (f64, f64, f64) {
        let end = |state: &[f64], a: &[f64]| [state[i], state[n + i], a[i]];
        quintic(s, self.length, end(&self.from, &self.accelerations.0), end(&self.to, &self.accelerations.1))
    }

    /// Least and largest displacement over the step.
    fn extremes(&self, n: usize, i: usize) -> (f64, f64) {
        let (a, b) = (self.from[i], self.to[i]);
        let (low, high) = (a.min(b), a.max(b));
        if self.from[n + i] * self.to[n + i] >= 0.0 {
            return (low, high);
        }
        // one turning point inside: bisection on the velocity
        let (mut left, mut right) = (0.0, 1.0);
        while right - left > REFINED {
            let middle = 0.5 * (left + right);
            if self.motion(n, i, middle).1 * self.from[n + i] > 0.0 { left = middle } else { right = middle }
        }
        let turning = self.motion(n, i, 0.5 * (left + right)).0;
        (low.min(turning), high.max(turning))
    }
}

fn places(system: &System, flow: &SmoothFlow, omega: f64, symmetry: Symmetry) -> Vec<PlaceMotion> {
    let n = system.dofs();
    let period = std::f64::consts::TAU / omega;
    (0..n)
        .map(|i| {
            let (mut minimum, mut maximum) = (f64::INFINITY, f64::NEG_INFINITY);
            for step in &flow.steps {
                let (low, high) = step.extremes(n, i);
                (minimum, maximum) = (minimum.min(low), maximum.max(high));
            }
            let part = |turn: fn(f64) -> f64| {
                flow.integral(|step, stage| {
                    step.stages[stage * n + i] * turn(omega * (step.start + C[stage] * step.length))
                })
            };
            let mut mean = flow.integral(|step, stage| step.stages[stage * n + i]) / period;
            let mut first_harmonic = Complex64::new(part(f64::cos), -part(f64::sin)) * (2.0 / period);
            if symmetry == Symmetry::HalfPeriod {
                maximum = maximum.max(-minimum);
                minimum = -maximum;
                mean = 0.0;
                first_harmonic *= 2.0;
            }
            PlaceMotion { name: system.places()[i].clone(), maximum, minimum, mean, first_harmonic }
        })
        .collect()
}

fn joints(system: &System, flow: &SmoothFlow, period: f64, symmetry: Symmetry) -> Vec<JointMotion> {
    let j = flow.structure.joints.len();
    let times = if symmetry == Symmetry::HalfPeriod { 2.0 } else { 1.0 };
    system
        .joints()
        .iter()
        .enumerate()
        .map(|(q, joint)| {
            let limit = flow.structure.joints[q].limit;
            let slips = |force: f64| force.abs() >= SLIPS_ABOVE * limit;
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            let (mut switches, mut before) = (0, None);
            for step in &flow.steps {
                for (state, time) in [(&step.from, step.start), (&step.to, step.start + step.length)] {
                    let structural: f64 = joint.axes()[0].along(state);
                    let u = structural + flow.drive.imposed_at(q, time, 0);
                    (low, high) = (low.min(u), high.max(u));
                }
                let force = step.joints[2 * j + q].1;
                let now = if slips(force) { Contact::slip(force) } else { Contact::Stick };
                switches += usize::from(before.is_some_and(|b| b != now));
                before = Some(now);
            }
            if symmetry == Symmetry::HalfPeriod {
                high = high.max(-low);
                low = -high;
            }
            JointMotion {
                name: joint.name().to_owned(),
                dissipation: times
                    * flow.integral(|step, stage| step.joints[stage * j + q].0 * step.joints[stage * j + q].1),
                slip_fraction: times / period
                    * flow.integral(|step, stage| f64::from(u8::from(slips(step.joints[stage * j + q].1)))),
                displacement: vec![(low, high)],
                switches: times as usize * switches,
            }
        })
        .collect()
}

fn energy(system: &System, flow: &SmoothFlow, times: f64) -> Energy {
    let (n, j) = (system.dofs(), system.joints().len());
    let velocity = |step: &StepRecord, stage: usize, i: usize| step.stages[(C.len() + stage) * n + i];
    let time = |step: &StepRecord, stage: usize| step.start + C[stage] * step.length;
    let work = flow.integral(|step, stage| {
        let mut force = nalgebra::DVector::zeros(n);
        flow.drive.add_force(time(step, stage), 0, &mut force);
        let on_masses: f64 = (0..n).map(|i| force[i] * velocity(step, stage, i)).sum();
        let at = MovedAt::new(system, flow.drive.omega, time(step, stage));
        let x: Vec<f64> = (0..n).map(|i| step.stages[stage * n + i]).collect();
        let v: Vec<f64> = (0..n).map(|i| velocity(step, stage, i)).collect();
        let forces: Vec<f64> = (0..j).map(|q| step.joints[stage * j + q].1).collect();
        let by_motion: f64 = (0..system.moved().len())
            .map(|m| {
                let place = &system.moved()[m];
                let coupling: f64 = (0..n)
                    .map(|i| (place.stiffness.0[i] * at.motion[m].0 + place.damping.0[i] * at.motion[m].1) * v[i])
                    .sum();
                at.reaction(system, m, &x, &v, &forces) * at.motion[m].1 + coupling
            })
            .sum();
        on_masses + by_motion
    });
    let viscous = flow.integral(|step, stage| {
        let at = MovedAt::new(system, flow.drive.omega, time(step, stage));
        let mut sum = 0.0;
        for i in 0..n {
            for k in 0..n {
                sum += system.structure().damping()[(i, k)] * velocity(step, stage, i) * velocity(step, stage, k);
            }
            for (m, place) in system.moved().iter().enumerate() {
                sum += 2.0 * place.damping.0[i] * velocity(step, stage, i) * at.motion[m].1;
            }
        }
        for (m, place) in system.moved().iter().enumerate() {
            for (other, c) in place.damping.1.iter().enumerate() {
                sum += c * at.motion[m].1 * at.motion[other].1;
            }
        }
        sum
    });
    let friction =
        (0..j).map(|q| flow.integral(|s, stage| s.joints[stage * j + q].0 * s.joints[stage * j + q].1)).sum::<f64>();
    Energy { work_in: times * work, viscous: times * viscous, friction: times * friction }
}

/// Displacement, velocity and acceleration of the moved places at one instant.
struct MovedAt {
    motion: Vec<(f64, f64, f64)>,
}

impl MovedAt {
    fn new(system: &System, omega: f64, time: f64) -> Self {
        let motion = system.moved().iter().map(|place| {
            let mut out = (0.0, 0.0, 0.0);
            for &(h, amplitude) in &place.motion {
                let rate = f64::from(h) * omega;
                let (sin, cos) = (rate * time).sin_cos();
                let z = amplitude * Complex64::new(cos, sin);
                out.0 += z.re;
                out.1 -= z.im * rate;
                out.2 -= z.re * rate * rate;
            }
            out
        });
        MovedAt { motion: motion.collect() }
    }

    /// The force that moves place `m`.
    fn reaction(&self, system: &System, m: usize, x: &[f64], v: &[f64], forces: &[f64]) -> f64 {
        let place = &system.moved()[m];
        let mut force = place.mass * self.motion[m].2;
        for (other, (k, c)) in place.stiffness.1.iter().zip(&place.damping.1).enumerate() {
            force += k * self.motion[other].0 + c * self.motion[other].1;
        }
        for i in 0..x.len() {
            force += place.stiffness.0[i] * x[i] + place.damping.0[i] * v[i];
        }
        force + place.joints.iter().zip(forces).map(|(sign, f)| sign * f).sum::<f64>()
    }
}

impl SteppedPath {
    /// Force of a joint with internal states at `s` in [0, 1] of a step: the cubic through its value at the step's start and
    /// those at the three stages.
    fn force_between(&self, step: &StepRecord, q: usize, s: f64) -> f64 {
        let (n, j, joint) = (self.structure.n, self.structure.joints.len(), &self.structure.joints[q]);
        let along = |v: &[f64]| (0..n).map(|i| joint.direction[i] * v[i]).sum::<f64>();
        let u = along(&step.from[..n]) + self.drive.imposed_at(q, step.start, 0);
        let velocity = along(&step.from[n..2 * n]) + self.drive.imposed_at(q, step.start, 1);
        let first = 2 * n + joint.first_state;
        let begin = LawPoint::new(&*joint.law, u, velocity, &step.from[first..first + joint.states]).force;
        let nodes = [0.0, C[0], C[1], C[2]];
        let values = [begin, step.joints[q].1, step.joints[j + q].1, step.joints[2 * j + q].1];
        (0..nodes.len())
            .map(|i| {
                let others = nodes.iter().enumerate().filter(|(k, _)| *k != i);
                values[i] * others.map(|(_, node)| (s - node) / (nodes[i] - node)).product::<f64>()
            })
            .sum::<f64>()
            .clamp(-joint.limit, joint.limit) // the cubic may overshoot at a layer, the law never does
    }
}

impl Path for SteppedPath {
    fn sample(&self, time: f64) -> Sample {
        let half = 0.5 * self.period;
        let (time, sign) = match self.symmetry {
            Symmetry::HalfPeriod if time >= half => (time - half, -1.0),
            _ => (time, 1.0),
        };
        let n = self.structure.n;
        let index = self.steps.partition_point(|step| step.start <= time).max(1) - 1;
        let step = &self.steps[index];
        let s = ((time - step.start) / step.length).clamp(0.0, 1.0);
        let rows: Vec<(f64, f64, f64)> = (0..n).map(|i| step.motion(n, i, s)).collect();
        let (x, v): (Vec<f64>, Vec<f64>) = rows.iter().map(|r| (r.0, r.1)).unzip();
        let joints: Vec<JointSample> = self
            .structure
            .joints
            .iter()
            .enumerate()
            .map(|(q, joint)| {
                let along = |v: &[f64]| (0..n).map(|i| joint.direction[i] * v[i]).sum::<f64>();
                let u = along(&x) + self.drive.imposed_at(q, time, 0);
                let velocity = along(&v) + self.drive.imposed_at(q, time, 1);
                let force = match joint.states {
                    0 => LawPoint::new(&*joint.law, u, velocity, &[]).force,
                    _ => self.force_between(step, q, s),
                };
                let slips = force.abs() >= SLIPS_ABOVE * joint.limit;
                let along_force = if joint.limit > 0.0 { force } else { velocity };
                JointSample::along(
                    sign * u,
                    sign * velocity,
                    sign * force,
                    if slips { Contact::slip(sign * along_force) } else { Contact::Stick },
                )
            })
            .collect();
        let at = MovedAt::new(&self.system, self.drive.omega, time);
        let forces: Vec<f64> = joints.iter().map(|joint| sign * joint.force[0]).collect();
        let moved = (0..self.system.moved().len())
            .map(|m| (sign * at.motion[m].0, sign * at.reaction(&self.system, m, &x, &v, &forces)))
            .collect();
        Sample {
            displacement: x.iter().map(|x| sign * x).collect(),
            velocity: v.iter().map(|v| sign * v).collect(),
            acceleration: rows.iter().map(|r| sign * r.2).collect(),
            joints,
            moved,
        }
    }

    fn switch_times(&self) -> Vec<f64> {
        let j = self.structure.joints.len();
        let slips = |step: &StepRecord, q: usize| {
            step.joints[2 * j + q].1.abs() >= SLIPS_ABOVE * self.structure.joints[q].limit
        };
        let mut times: Vec<f64> = (1..self.steps.len())
            .filter(|&i| (0..j).any(|q| slips(&self.steps[i - 1], q) != slips(&self.steps[i], q)))
            .map(|i| self.steps[i].start)
            .collect();
        if self.symmetry == Symmetry::HalfPeriod {
            let second: Vec<f64> = times.iter().map(|t| t + 0.5 * self.period).collect();
            times.extend(second);
        }
        times
    }
}
