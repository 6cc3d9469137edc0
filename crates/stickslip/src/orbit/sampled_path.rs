//! Results of any path from its samples alone, by Gauss quadrature between its transitions.

use super::postprocess::{ContactFractions, ContactSummary, PathSignals, extremes};
use super::{Path, Sample};
use crate::model::{Axis, System};
use num_complex::Complex64;
use std::convert::Infallible;
use stickslip_numerics::quadrature;

/// A path at the nodes of a quadrature over its period.
pub(super) struct Sampled<'a> {
    system: &'a System,
    axes: Vec<(usize, &'a Axis)>,
    omega: f64,
    period: f64,
    /// Time and weight, s.
    nodes: Vec<(f64, f64)>,
    samples: Vec<Sample>,
}

impl<'a> Sampled<'a> {
    pub fn new(system: &'a System, path: &dyn Path, omega: f64, period: f64) -> Self {
        let mut cuts: Vec<f64> = path.transition_times().into_iter().filter(|t| *t > 0.0 && *t < period).collect();
        cuts.push(0.0);
        cuts.push(period);
        cuts.sort_by(f64::total_cmp);
        let mut nodes = Vec::new();
        for pair in cuts.windows(2) {
            // Intervals per period, with at least two between transitions. Harmonics up to the
            // twentieth are then integrated to 1e-9.
            let count = (512.0 * (pair[1] - pair[0]) / period).ceil().max(2.0);
            let length = (pair[1] - pair[0]) / count;
            for i in 0..count as usize {
                let at = |(node, weight)| (pair[0] + (i as f64 + 0.5 + 0.5 * node) * length, 0.5 * weight * length);
                nodes.extend(quadrature::GAUSS_3.map(at));
            }
        }
        let samples = nodes.iter().map(|(time, _)| path.sample(*time)).collect();
        Sampled { system, axes: system.axes().collect(), omega, period, nodes, samples }
    }

    /// Returns the joint of an axis, and the direction of the axis within the joint.
    fn direction(&self, axis: usize) -> (usize, usize) {
        let (joint, _) = self.axes[axis];
        (joint, (0..axis).filter(|before| self.axes[*before].0 == joint).count())
    }

    fn all(&self, at: impl Fn(&Sample) -> f64) -> Vec<f64> {
        self.samples.iter().map(at).collect()
    }

    /// Returns the smallest and the largest value over the period, from value, slope and
    /// curvature at each node.
    fn range_of(&self, at: impl Fn(usize) -> [f64; 3]) -> (f64, f64) {
        let count = self.nodes.len();
        let spans = (0..count).map(|i| {
            let next = (i + 1) % count;
            let length = (self.nodes[next].0 - self.nodes[i].0).rem_euclid(self.period);
            (length, at(i), at(next))
        });
        extremes(spans)
    }
}

/// Signals are values at the nodes.
impl PathSignals for Sampled<'_> {
    type Signal = Vec<f64>;
    type Error = Infallible;

    fn displacement(&self, row: usize) -> Vec<f64> {
        self.all(|sample| sample.displacement[row])
    }
    fn velocity(&self, row: usize) -> Vec<f64> {
        self.all(|sample| sample.velocity[row])
    }
    fn relative_velocity(&self, axis: usize) -> Vec<f64> {
        let (joint, direction) = self.direction(axis);
        self.all(|sample| sample.joints[joint].velocity[direction])
    }
    fn force(&self, axis: usize) -> Vec<f64> {
        let (joint, direction) = self.direction(axis);
        self.all(|sample| sample.joints[joint].force[direction])
    }
    fn harmonics(&self, parts: &[(f64, Complex64)]) -> Vec<f64> {
        let at = |time: f64| parts.iter().map(|(rate, a)| (a * Complex64::cis(rate * time)).re).sum();
        self.nodes.iter().map(|(time, _)| at(*time)).collect()
    }
    fn add(&self, to: &mut Vec<f64>, signal: &Vec<f64>, factor: f64) {
        to.iter_mut().zip(signal).for_each(|(to, value)| *to += factor * value);
    }
    fn product(&self, a: &Vec<f64>, b: &Vec<f64>) -> f64 {
        a.iter().zip(b).zip(&self.nodes).map(|((a, b), (_, weight))| weight * a * b).sum()
    }
    fn fourier(&self, signal: &Vec<f64>, omega: f64) -> Complex64 {
        let terms = signal.iter().zip(&self.nodes);
        terms.map(|(value, (time, weight))| Complex64::cis(-omega * time) * (weight * value)).sum()
    }
    fn range(&self, place: &Axis) -> Result<(f64, f64), Infallible> {
        let at = |i: usize| {
            let Sample { displacement, velocity, acceleration, .. } = &self.samples[i];
            [displacement, velocity, acceleration].map(|values| place.component(values))
        };
        Ok(self.range_of(at))
    }
    fn relative_range(&self, axis: usize) -> Result<(f64, f64), Infallible> {
        let (joint, direction) = self.direction(axis);
        let along = self.axes[axis].1;
        let at = |i: usize| {
            let (sample, time) = (&self.samples[i], self.nodes[i].0);
            let imposed = along.imposed().iter().map(|(h, g)| {
                let rate = f64::from(*h) * self.omega;
                -rate * rate * (g * Complex64::cis(rate * time)).re
            });
            let motion = &sample.joints[joint];
            let acceleration = along.component(&sample.acceleration) + imposed.sum::<f64>();
            [motion.displacement[direction], motion.velocity[direction], acceleration]
        };
        Ok(self.range_of(at))
    }
    fn faces(&self, joint: usize) -> ContactSummary {
        let contact = |i: usize| self.samples[i % self.nodes.len()].joints[joint].contact;
        let count = self.nodes.len();
        let shares = ContactFractions::of((0..count).map(|i| (contact(i), self.nodes[i].1)));
        let switches = (0..count).filter(|&i| contact(i) != contact(i + 1)).count();
        ContactSummary::of_samples(shares, switches, (0..count).map(contact))
    }
}

impl Sampled<'_> {
    /// Tells whether every sample matches the numbers of degrees of freedom and joints, and is
    /// finite.
    pub fn is_consistent(&self) -> bool {
        let n = self.system.dofs();
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        self.samples.iter().all(|sample| {
            let parts = [&sample.displacement, &sample.velocity, &sample.acceleration];
            parts.iter().all(|part| part.len() == n && finite(part))
                && sample.joints.len() == self.system.joints().len()
                && sample.joints.iter().all(|j| finite(&j.displacement) && finite(&j.velocity) && finite(&j.force))
        })
    }
}
