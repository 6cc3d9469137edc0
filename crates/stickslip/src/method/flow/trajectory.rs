//! The motion of an integration in steps, evaluated at any time, and its measured quantities.

use super::assembly::{Assembly, IndexedLaw};
use super::excitation::HarmonicExcitation;
use super::step_record::{RecordedInstant, StepRecord};
use crate::law::{Contact, MAX_DIRECTIONS, RelativeMotion};
use crate::model::{Axis, System};
use crate::orbit::postprocess::{ContactFractions, ContactSummary, PathSignals, extremes};
use crate::orbit::{JointSample, Path, Sample, Symmetry};
use num_complex::Complex64;
use std::convert::Infallible;
use std::sync::Arc;
use stickslip_numerics::radau::quintic;

pub(crate) struct Trajectory {
    steps: StepRecord,
    assembly: Assembly,
    excitation: HarmonicExcitation,
    system: Arc<System>,
    symmetry: Symmetry,
    period: f64,
}

impl Trajectory {
    /// Makes the path of a recorded run that repeats after `period`.
    pub fn new(
        (system, assembly): (&Arc<System>, &Assembly),
        excitation: &HarmonicExcitation,
        steps: &StepRecord,
        (symmetry, period): (Symmetry, f64),
    ) -> Self {
        Trajectory {
            steps: steps.clone(),
            assembly: assembly.clone(),
            excitation: excitation.clone(),
            system: system.clone(),
            symmetry,
            period,
        }
    }

    /// Returns value, slope and curvature at both ends of a step for the quantity that `of`
    /// computes from the degrees of freedom.
    fn ends(&self, step: usize, of: impl Fn(&[f64]) -> f64) -> [[f64; 3]; 2] {
        self.steps.ends(step).map(|instant| [instant.displacement, instant.velocity, instant.acceleration].map(&of))
    }

    /// Returns relative displacement, velocity and acceleration along an axis at both ends of a
    /// step.
    fn relative_ends(&self, step: usize, axis: usize) -> [[f64; 3]; 2] {
        let (start, length) = self.steps.spans[step];
        let end = |instant: RecordedInstant, time: f64| {
            let (g, speed) = self.excitation.relative_at(axis, time);
            let along = &self.assembly.axes[axis];
            let acceleration = along.component(instant.acceleration) + self.excitation.imposed_at(axis, time, 2);
            [along.component(instant.displacement) + g, along.component(instant.velocity) + speed, acceleration]
        };
        let [from, to] = self.steps.ends(step);
        [end(from, start), end(to, start + length)]
    }

    /// Returns the least and largest value over all steps; each step is a quintic between its
    /// ends.
    fn range_of(&self, ends: impl Fn(usize) -> [[f64; 3]; 2]) -> (f64, f64) {
        extremes(self.steps.spans.iter().enumerate().map(|(step, (_, length))| {
            let [from, to] = ends(step);
            (*length, from, to)
        }))
    }

    /// Returns the force along an axis at `s` in [0, 1] of a step. It is the polynomial through
    /// the values at the step's start and at the nodes.
    ///
    /// The polynomial may overshoot at a layer, so it is clamped to the law's `scale` if the
    /// values respect that. A law with a stiffness or damping on top of its slip limit does
    /// not.
    fn force_between(&self, step: usize, axis: usize, s: f64, scale: f64) -> f64 {
        let count = self.steps.nodes.len();
        let node = |i: usize| if i == 0 { 0.0 } else { self.steps.nodes[i - 1].0 };
        let value = |i: usize| match i {
            0 => self.steps.ends(step)[0].force[axis],
            _ => self.steps.node(step * count + i - 1).force[axis],
        };
        let sum = (0..=count).map(|i| {
            let others = (0..=count).filter(|k| *k != i);
            value(i) * others.map(|k| (s - node(k)) / (node(i) - node(k))).product::<f64>()
        });
        let (between, largest) = (sum.sum::<f64>(), (0..=count).map(|i| value(i).abs()).fold(0.0, f64::max));
        // Rounding may exceed the scale of a law by a fraction of 1e-9.
        if largest > scale * (1.0 + 1e-9) { between } else { between.clamp(-scale, scale) }
    }

    /// Returns the forces of a joint at `s` in [0, 1] of a step with the given relative motion.
    fn forces(
        &self,
        joint: &IndexedLaw,
        (step, s): (usize, f64),
        motion: &RelativeMotion<f64>,
    ) -> [f64; MAX_DIRECTIONS] {
        if let Some(rate) = joint.law.rate().filter(|_| joint.states == 0 && self.steps.nodes.len() > 1) {
            return rate.evaluate_values(motion, &[], &mut []);
        }
        let mut force = [0.0; MAX_DIRECTIONS];
        // a limit bounds the force along one direction; along several it bounds at most their
        // norm
        let scale = if joint.directions == 1 { joint.law.force_scale() } else { f64::INFINITY };
        joint.axes().enumerate().for_each(|(d, axis)| force[d] = self.force_between(step, axis, s, scale));
        force
    }

    /// Returns the contact state of a joint at `s` in [0, 1] of a step.
    fn contact(&self, joint: usize, step: usize, s: f64) -> Contact {
        if self.steps.jumps {
            return self.steps.contact_at_end(step)[joint];
        }
        let (joint, length) = (&self.assembly.joints[joint], self.steps.spans[step].1);
        let mut motion = RelativeMotion::along(0.0, 0.0);
        for (d, axis) in joint.axes().enumerate() {
            let [from, to] = self.relative_ends(step, axis);
            (motion.displacement[d], motion.velocity[d], _) = quintic(s, length, from, to);
        }
        let force = self.forces(joint, (step, s), &motion);
        joint.law.contact_state(&motion.velocity[..joint.directions], &force[..joint.directions])
    }

    /// Returns the first `s` in [0, 1], at most `to`, at which a joint leaves the contact state
    /// of `from`.
    fn contact_change(&self, joint: usize, step: usize, from: (f64, Contact), to: f64) -> f64 {
        let (mut low, mut high) = (from.0, to);
        // Halvings of the interval between two nodes with different contact states; a millionth
        // remains.
        for _ in 0..20 {
            let between = 0.5 * (low + high);
            if self.contact(joint, step, between) == from.1 { low = between } else { high = between }
        }
        high
    }

    /// Returns the contact states between the nodes of a step and their durations. The state is
    /// constant between nodes with equal states, and changes once, at a bisected instant,
    /// between others.
    fn contact_intervals(&self, joint: usize, step: usize) -> impl Iterator<Item = (Contact, f64)> {
        let (count, length) = (self.steps.nodes.len(), self.steps.spans[step].1);
        let mut last = (0.0, self.contact(joint, step, 0.0));
        (0..count).flat_map(move |i| {
            let next = (self.steps.nodes[i].0, self.steps.node(step * count + i).contact[joint]);
            let (from, to) = (std::mem::replace(&mut last, next), next);
            let change = if from.1 == to.1 { to.0 } else { self.contact_change(joint, step, from, to.0) };
            [(from.1, (change - from.0) * length), (to.1, (to.0 - change) * length)]
        })
    }

    /// Returns the motion of the joints at `s` in [0, 1] of a step, for this time and state of
    /// the structure; mirrored if `sign` is -1.
    fn joints(&self, step: usize, s: f64, time: f64, state: &[f64], sign: f64) -> Vec<JointSample> {
        let count = self.steps.nodes.len();
        let sample = |(q, joint): (usize, &IndexedLaw)| {
            let mut motion = self.assembly.motion_of(joint, state, &self.excitation, time);
            let mut force = self.forces(joint, (step, s), &motion);
            for values in [&mut motion.displacement, &mut motion.velocity, &mut force] {
                values.iter_mut().for_each(|value| *value *= sign);
            }
            let contact = if count > 1 && !self.steps.jumps {
                joint.law.contact_state(&motion.velocity[..joint.directions], &force[..joint.directions])
            } else {
                let contact = self.steps.contact_at_end(step)[q];
                if sign < 0.0 { contact.mirrored() } else { contact }
            };
            JointSample { displacement: motion.displacement, velocity: motion.velocity, force, contact }
        };
        self.assembly.joints.iter().enumerate().map(sample).collect()
    }
}

impl Path for Trajectory {
    fn sample(&self, time: f64) -> Sample {
        let half = 0.5 * self.period;
        let (time, sign) = match self.symmetry {
            Symmetry::HalfPeriod if time >= half => (time - half, -1.0),
            _ => (time, 1.0),
        };
        let n = self.assembly.n;
        let step = self.steps.spans.partition_point(|(start, _)| *start <= time).max(1) - 1;
        let (start, length) = self.steps.spans[step];
        let s = ((time - start) / length).clamp(0.0, 1.0);
        let mut state = vec![0.0; 2 * n];
        let mut acceleration = vec![0.0; n];
        for row in 0..n {
            let [from, to] = self.ends(step, |values| values[row]);
            (state[row], state[n + row], acceleration[row]) = quintic(s, length, from, to);
        }
        let joints = self.joints(step, s, time, &state, sign);
        let forces: Vec<f64> = joints
            .iter()
            .zip(&self.assembly.joints)
            .flat_map(|(sample, joint)| sample.force[..joint.directions].iter().map(|f| sign * f))
            .collect();
        let (x, v) = state.split_at(n);
        let moved = reactions(&self.system, self.excitation.omega, time, [x, v, &acceleration, &forces]);
        let signed = |values: &[f64]| values.iter().map(|value| sign * value).collect();
        Sample {
            displacement: signed(x),
            velocity: signed(v),
            acceleration: signed(&acceleration),
            joints,
            imposed: moved.into_iter().map(|(motion, force)| (sign * motion, sign * force)).collect(),
        }
    }

    fn transition_times(&self) -> Vec<f64> {
        let mut times: Vec<f64> = (1..self.steps.spans.len())
            .filter(|&step| self.steps.contact_at_end(step - 1) != self.steps.contact_at_end(step))
            .map(|step| self.steps.spans[step].0)
            .collect();
        if self.symmetry == Symmetry::HalfPeriod {
            let second: Vec<f64> = times.iter().map(|t| t + 0.5 * self.period).collect();
            times.extend(second);
        }
        times
    }
}

/// Returns the displacements of the moved places at one instant and the forces that move them.
fn reactions(system: &System, omega: f64, time: f64, [x, v, a, forces]: [&[f64]; 4]) -> Vec<(f64, f64)> {
    let motion: Vec<[f64; 3]> = system
        .moved_places()
        .iter()
        .map(|place| {
            place.motion.iter().fold([0.0; 3], |sum, &(h, amplitude)| {
                let rate = f64::from(h) * omega;
                let z = amplitude * Complex64::cis(rate * time);
                [sum[0] + z.re, sum[1] - z.im * rate, sum[2] - z.re * rate * rate]
            })
        })
        .collect();
    let reaction = |(m, place): (usize, &crate::model::MovedPlace)| {
        let mut force = 0.0;
        for (h, f) in &place.force {
            force -= (f * Complex64::cis(f64::from(*h) * omega * time)).re;
        }
        for (other, [x, v, a]) in motion.iter().enumerate() {
            force += place.stiffness.1[other] * x + place.damping.1[other] * v + place.mass.1[other] * a;
        }
        for i in 0..x.len() {
            force += place.stiffness.0[i] * x[i] + place.damping.0[i] * v[i] + place.mass.0[i] * a[i];
        }
        (motion[m][0], force + place.joints.iter().zip(forces).map(|(sign, f)| sign * f).sum::<f64>())
    };
    system.moved_places().iter().enumerate().map(reaction).collect()
}

/// A signal is the list of its values at the nodes.
impl PathSignals for Trajectory {
    type Signal = Vec<f64>;
    type Error = Infallible;

    fn displacement(&self, row: usize) -> Vec<f64> {
        self.steps.nodes().map(|node| node.displacement[row]).collect()
    }
    fn velocity(&self, row: usize) -> Vec<f64> {
        self.steps.nodes().map(|node| node.velocity[row]).collect()
    }
    fn relative_velocity(&self, axis: usize) -> Vec<f64> {
        self.steps.nodes().map(|node| node.relative[axis]).collect()
    }
    fn force(&self, axis: usize) -> Vec<f64> {
        self.steps.nodes().map(|node| node.force[axis]).collect()
    }
    fn harmonics(&self, parts: &[(f64, Complex64)]) -> Vec<f64> {
        let at = |time: f64| parts.iter().map(|(rate, a)| (a * Complex64::cis(rate * time)).re).sum();
        (0..self.steps.count()).map(|i| at(self.steps.time(i).0)).collect()
    }
    fn add(&self, to: &mut Vec<f64>, signal: &Vec<f64>, factor: f64) {
        to.iter_mut().zip(signal).for_each(|(to, value)| *to += factor * value);
    }
    fn product(&self, a: &Vec<f64>, b: &Vec<f64>) -> f64 {
        a.iter().zip(b).enumerate().map(|(i, (a, b))| self.steps.time(i).1 * a * b).sum()
    }
    fn fourier(&self, signal: &Vec<f64>, omega: f64) -> Complex64 {
        let term = |(i, value): (usize, &f64)| {
            let (time, weight) = self.steps.time(i);
            Complex64::cis(-omega * time) * (weight * value)
        };
        signal.iter().enumerate().map(term).sum()
    }
    fn range(&self, place: &Axis) -> Result<(f64, f64), Infallible> {
        Ok(self.range_of(|step| self.ends(step, |values| place.component(values))))
    }
    fn relative_range(&self, axis: usize) -> Result<(f64, f64), Infallible> {
        Ok(self.range_of(|step| self.relative_ends(step, axis)))
    }
    fn faces(&self, joint: usize) -> ContactSummary {
        let shares = if self.steps.nodes.len() > 1 {
            ContactFractions::of((0..self.steps.spans.len()).flat_map(|step| self.contact_intervals(joint, step)))
        } else {
            let nodes = self.steps.nodes().enumerate();
            ContactFractions::of(nodes.map(|(i, node)| (node.contact[joint], self.steps.time(i).1)))
        };
        let at_end = |step: usize| self.steps.contact_at_end(step)[joint];
        let steps = self.steps.spans.len();
        let mut switches = (1..steps).filter(|&step| at_end(step - 1) != at_end(step)).count();
        if steps > 0 {
            let last = at_end(steps - 1);
            let before = if self.symmetry == Symmetry::HalfPeriod { last.mirrored() } else { last };
            switches += usize::from(before != at_end(0));
        }
        ContactSummary::of_samples(shares, switches, self.steps.nodes().map(|node| node.contact[joint]))
    }
}
