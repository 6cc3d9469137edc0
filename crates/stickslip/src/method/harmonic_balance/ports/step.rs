//! Motion ports of laws in step form: the return map is taken from sample to sample.
//!
//! A straight step is exact for elastic-plastic laws along one direction; between samples the motion is curved, and what that
//! leaves out is `(2π h/N)²/8` of the motion at harmonic h, some 5e-6 at 1024 samples.

use super::alternation::Alternation;
use super::march::March;
use crate::law::{MOST_DIRECTIONS, Step, StepPoint};
use num_complex::Complex64;

impl Alternation {
    /// Adds the harmonics of the force in the motion `c`, [axis][harmonic], to `force`, and their derivative to `tangent`.
    pub(super) fn step(
        &mut self,
        step: &dyn Step,
        axes: usize,
        c: &[Complex64],
        force: &mut [Complex64],
        tangent: Option<&mut [f64]>,
    ) {
        let nh = self.harmonics.len();
        let mut mean = [0.0; MOST_DIRECTIONS];
        for a in 0..axes {
            let c = &c[a * nh..(a + 1) * nh];
            self.synthesise(c, |_| Complex64::new(1.0, 0.0));
            self.displacement[a].copy_from_slice(&self.signal);
            mean[a] = if self.harmonics[0] == 0 { c[0].re } else { 0.0 };
        }
        let displacement = std::mem::take(&mut self.displacement);
        let mut march = StepMarch { step, axes, at: &displacement, mean, point: StepPoint::new(axes, step.states()) };
        self.march(&mut march, force, tangent);
        self.displacement = displacement;
    }
}

/// Steps of a law from sample to sample. Inputs of a step: displacements before it, then after it.
struct StepMarch<'a> {
    step: &'a dyn Step,
    axes: usize,
    at: &'a [Vec<f64>; MOST_DIRECTIONS],
    mean: [f64; MOST_DIRECTIONS],
    point: StepPoint,
}

impl StepMarch<'_> {
    fn read(&self, i: usize) -> [f64; MOST_DIRECTIONS] {
        std::array::from_fn(|a| if a < self.axes { self.at[a][i] } else { 0.0 })
    }

    fn advance(
        &mut self,
        (from, to): (&[f64; MOST_DIRECTIONS], &[f64; MOST_DIRECTIONS]),
        before: &[f64],
        after: &mut [f64],
        force: &mut [f64; MOST_DIRECTIONS],
        rows: Option<&mut [f64]>,
    ) -> bool {
        let Some(rows) = rows else {
            after.copy_from_slice(before);
            *force = self.step.value(from, to, after);
            return after.iter().all(|z| z.is_finite());
        };
        self.step.linearise(self.axes, from, to, before, &mut self.point);
        *force = self.point.force;
        after.copy_from_slice(&self.point.state);
        let (m, width) = (before.len(), 2 * self.axes + before.len());
        for s in 0..m {
            rows[s * width..(s + 1) * width].copy_from_slice(self.point.state_slope(s));
        }
        for a in 0..self.axes {
            rows[(m + a) * width..(m + a + 1) * width].copy_from_slice(self.point.force_slope(a));
        }
        after.iter().all(|z| z.is_finite())
    }
}

impl March for StepMarch<'_> {
    fn states(&self) -> usize {
        self.step.states()
    }
    fn state_scale(&self) -> f64 {
        self.step.state_scale()
    }
    fn axes(&self) -> usize {
        self.axes
    }
    fn inputs(&self) -> usize {
        2
    }
    fn waves(&self, h: usize, angle: f64, at: Complex64) -> [Complex64; 4] {
        let zero = Complex64::new(0.0, 0.0);
        [at * Complex64::cis(-angle * h as f64), at, zero, zero]
    }
    fn first_waves(&self, h: usize) -> [Complex64; 4] {
        [if h == 0 { 1.0 } else { 0.0 }, 1.0, 0.0, 0.0].map(|x| Complex64::new(x, 0.0))
    }
    fn step(
        &mut self,
        i: usize,
        before: &[f64],
        after: &mut [f64],
        force: &mut [f64; MOST_DIRECTIONS],
        rows: Option<&mut [f64]>,
    ) -> bool {
        let n = self.at[0].len();
        let (from, to) = (self.read((i + n - 1) % n), self.read(i));
        self.advance((&from, &to), before, after, force, rows)
    }
    fn first(
        &mut self,
        before: &[f64],
        after: &mut [f64],
        force: &mut [f64; MOST_DIRECTIONS],
        rows: Option<&mut [f64]>,
    ) -> bool {
        let (from, to) = (self.mean, self.read(0));
        self.advance((&from, &to), before, after, force, rows)
    }
}
