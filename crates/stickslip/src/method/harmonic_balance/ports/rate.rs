//! Motion ports of laws in rate form.
//!
//! Without internal states the force is sampled, and its derivative is the spectrum of the sampled slopes. States are integrated along the
//! series by Radau IIA of order 3 with two stages, one step from sample to sample: displacement and velocity are known at the stages exactly, so
//! the error over a period falls with the third power of the samples (about 1e-7 of the force at 1024 samples and slip by a tenth
//! of the state's reach per sample), and no stiffness makes it ring. Where a rate has a kink, the step over it has order 2.
//! Source: Hairer and Wanner, "Solving Ordinary Differential Equations II" (1996), Sec. IV.5.

use super::Port;
use super::alternation::Alternation;
use super::march::March;
use crate::law::{MAX_DIRECTIONS, RatePoint, RateView, RelativeMotion};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::f64::consts::TAU;

/// Newton iterations of one step; three are usual.
const ITERATIONS: usize = 60;
/// Longest change in an iteration, relative to the size of states: some states are logarithms of what they stand for.
const LONGEST: f64 = 2.0;
/// Change of the stages, relative to the size of states, at which a step is solved: its square is rounding.
const SOLVED: f64 = 1e-9;
/// Coefficients of Radau IIA of order 3; its stages lie at a third of the step and at its end.
const RADAU: [[f64; 2]; 2] = [[5.0 / 12.0, -1.0 / 12.0], [0.75, 0.25]];
/// Share of the step that is left at the first stage.
const LEFT: f64 = 2.0 / 3.0;
/// Before the first period the joint is moved from static equilibrium to where the period begins, in this share of a period.
const LEAD: f64 = 0.25;

impl Alternation {
    /// Adds the harmonics of the force in the motion `c`, [axis][harmonic], to `force`, and their derivative to `tangent`.
    pub(super) fn rate(
        &mut self,
        rate: &dyn RateView,
        port: &Port,
        omega: f64,
        c: &[Complex64],
        force: &mut [Complex64],
        tangent: Option<&mut [f64]>,
    ) {
        let (axes, nh) = (port.axes, self.harmonics.len());
        let turn = |h: usize| Complex64::new(0.0, h as f64 * omega);
        for a in 0..axes {
            let c = &c[a * nh..(a + 1) * nh];
            self.synthesise(c, |_| Complex64::new(1.0, 0.0));
            self.displacement[a].copy_from_slice(&self.signal);
            self.synthesise(c, turn);
            self.velocity[a].copy_from_slice(&self.signal);
        }
        if rate.states() > 0 {
            return self.integrate(rate, port, omega, c, force, tangent);
        }
        self.state.clear();
        self.reserve_slopes(2 * axes * axes);
        let mut point = RatePoint::new(axes, 0);
        for i in 0..self.samples() {
            let motion = RelativeMotion {
                displacement: std::array::from_fn(|a| self.displacement[a][i]),
                velocity: std::array::from_fn(|a| self.velocity[a][i]),
            };
            if tangent.is_none() {
                let values = rate.evaluate_values(&motion, &[], &mut []);
                (0..axes).for_each(|a| self.force[a][i] = values[a]);
                continue;
            }
            rate.evaluate_with_derivatives(axes, &motion, &[], &mut point);
            for a in 0..axes {
                self.force[a][i] = point.force[a];
                for (b, slope) in point.force_slope(a).iter().enumerate() {
                    self.slopes[2 * axes * a + b][i] = *slope;
                }
            }
        }
        for a in 0..axes {
            self.add_force(a, &mut force[a * nh..(a + 1) * nh]);
        }
        let Some(tangent) = tangent else { return };
        if self.by_frequency.is_some() {
            for a in 0..axes {
                let mut by = vec![0.0; self.samples()];
                for b in 0..axes {
                    let slope = &self.slopes[2 * axes * a + axes + b];
                    let speeds = slope.iter().zip(&self.velocity[b]);
                    by.iter_mut().zip(speeds).for_each(|(by, (slope, v))| *by += slope * v / omega);
                }
                self.add_by_frequency(a, &mut by);
            }
        }
        for a in 0..axes {
            for b in 0..axes {
                if self.slope_spectrum(2 * axes * a + b, 0) {
                    self.add_slope(tangent, (a, b), axes, |_| Complex64::new(1.0, 0.0));
                }
                if self.slope_spectrum(2 * axes * a + axes + b, 0) {
                    self.add_slope(tangent, (a, b), axes, turn);
                }
            }
        }
    }

    /// The same of a law with internal states.
    fn integrate(
        &mut self,
        rate: &dyn RateView,
        port: &Port,
        omega: f64,
        c: &[Complex64],
        force: &mut [Complex64],
        tangent: Option<&mut [f64]>,
    ) {
        let (n, nh, axes) = (self.samples(), self.harmonics.len(), port.axes);
        let (rest, at_rest) = self.at_rest(port);
        let angle = TAU / n as f64;
        let mut stages: [[Vec<f64>; MAX_DIRECTIONS]; 2] = Default::default();
        for a in 0..axes {
            let c = &c[a * nh..(a + 1) * nh];
            for (kind, stage) in stages.iter_mut().enumerate() {
                let power =
                    |h: usize| if kind == 0 { Complex64::new(1.0, 0.0) } else { Complex64::new(0.0, h as f64 * omega) };
                self.synthesise(c, |h| power(h) * Complex64::cis(-LEFT * angle * h as f64));
                stage[a] = self.signal.clone();
            }
        }
        let displacement = std::mem::take(&mut self.displacement);
        let velocity = std::mem::take(&mut self.velocity);
        let states = rate.states();
        let mut march = RateMarch {
            rate,
            axes,
            omega,
            length: angle / omega,
            at: [&displacement, &velocity],
            stages: &stages,
            rest,
            at_rest,
            points: [RatePoint::new(axes, states), RatePoint::new(axes, states)],
            stage: DVector::zeros(2 * states),
            frequency: self.by_frequency.is_some(),
        };
        self.march(&mut march, force, tangent);
        (self.displacement, self.velocity) = (displacement, velocity);
    }
}

/// Displacements or velocities, [axis][sample].
type Signals = [Vec<f64>; MAX_DIRECTIONS];

/// Steps of a rate law along a sampled motion. Inputs of a step: displacements and velocities at the first stage, then at the end.
struct RateMarch<'a> {
    rate: &'a dyn RateView,
    axes: usize,
    omega: f64,
    /// Time from sample to sample, s.
    length: f64,
    /// Displacements and velocities at the samples.
    at: [&'a Signals; 2],
    /// The same at the first stage of the step that ends at the sample.
    stages: &'a [Signals; 2],
    /// Displacements and states in static equilibrium, where the first movement begins.
    rest: [f64; MAX_DIRECTIONS],
    at_rest: Vec<f64>,
    points: [RatePoint; 2],
    stage: DVector<f64>,
    /// The derivative by ω is wanted.
    frequency: bool,
}

impl RateMarch<'_> {
    fn advance(
        &mut self,
        (length, motions): (f64, [RelativeMotion<f64>; 2]),
        before: &[f64],
        after: &mut [f64],
        force: &mut [f64; MAX_DIRECTIONS],
        rows: Option<&mut [f64]>,
    ) -> bool {
        let (m, d) = (before.len(), self.axes);
        let scale = self.rate.state_scale();
        for s in 0..m {
            (self.stage[s], self.stage[m + s]) = (before[s], before[s]);
        }
        let mut factor = None;
        for _ in 0..ITERATIONS {
            for (stage, motion) in motions.iter().enumerate() {
                let z = &self.stage.as_slice()[stage * m..(stage + 1) * m];
                self.rate.evaluate_with_derivatives(d, motion, z, &mut self.points[stage]);
            }
            let points = &self.points;
            let matrix = DMatrix::from_fn(2 * m, 2 * m, |row, column| {
                let (i, s, k, t) = (row / m, row % m, column / m, column % m);
                let one = if row == column { 1.0 } else { 0.0 };
                one - length * RADAU[i][k] * points[k].rate_slope(s)[2 * d + t]
            });
            let right = DVector::from_fn(2 * m, |row, _| {
                let (i, s) = (row / m, row % m);
                let pull: f64 = (0..2).map(|k| RADAU[i][k] * points[k].rate[s]).sum();
                before[s] + length * pull - self.stage[row]
            });
            let lu = matrix.lu();
            let Some(mut change) = lu.solve(&right) else { return false };
            let size = change.amax();
            if !size.is_finite() {
                return false;
            }
            if size > LONGEST * scale {
                change *= LONGEST * scale / size;
            }
            self.stage += &change;
            factor = Some(lu);
            if size <= SOLVED * scale {
                break;
            }
        }
        after.copy_from_slice(&self.stage.as_slice()[m..]);
        let Some(rows) = rows else {
            *force = self.rate.evaluate_values(&motions[1], after, &mut vec![0.0; m]);
            return true;
        };
        self.rate.evaluate_with_derivatives(d, &motions[1], after, &mut self.points[1]);
        *force = self.points[1].force;
        let inputs = 4 * d;
        let width = inputs + m + usize::from(self.frequency);
        let (points, omega) = (&self.points, self.omega);
        // velocities grow with ω, and the time of a step falls
        let faster = |slope: &[f64], stage: usize| -> f64 {
            (0..d).map(|a| slope[d + a] * motions[stage].velocity[a] / omega).sum()
        };
        // stages by inputs and by the states before
        let right = DMatrix::from_fn(2 * m, width, |row, column| {
            let (i, s) = (row / m, row % m);
            match column.checked_sub(inputs) {
                Some(t) if t == m => {
                    let by = |k: usize| faster(points[k].rate_slope(s), k) - points[k].rate[s] / omega;
                    length * (0..2).map(|k| RADAU[i][k] * by(k)).sum::<f64>()
                }
                Some(t) => f64::from(u8::from(s == t)),
                None => length * RADAU[i][column / (2 * d)] * points[column / (2 * d)].rate_slope(s)[column % (2 * d)],
            }
        });
        let Some(by) = factor.and_then(|lu| lu.solve(&right)) else { return false };
        for column in 0..width {
            for s in 0..m {
                rows[s * width + column] = by[(m + s, column)];
            }
            for a in 0..d {
                let slope = points[1].force_slope(a);
                let own = match column.checked_sub(2 * d) {
                    _ if column == inputs + m => faster(slope, 1),
                    Some(at) if column < inputs => slope[at],
                    _ => 0.0,
                };
                rows[(m + a) * width + column] =
                    own + (0..m).map(|s| slope[2 * d + s] * by[(m + s, column)]).sum::<f64>();
            }
        }
        true
    }
}

impl March for RateMarch<'_> {
    fn states(&self) -> usize {
        self.rate.states()
    }
    fn state_scale(&self) -> f64 {
        self.rate.state_scale()
    }
    fn axes(&self) -> usize {
        self.axes
    }
    fn inputs(&self) -> usize {
        4
    }
    fn knows_frequency(&self) -> bool {
        self.frequency
    }
    fn waves(&self, h: usize, angle: f64, at: Complex64) -> [Complex64; 4] {
        let turn = Complex64::new(0.0, h as f64 * self.omega);
        let stage = at * Complex64::cis(-LEFT * angle * h as f64);
        [stage, stage * turn, at, at * turn]
    }
    fn first_waves(&self, _h: usize) -> [Complex64; 4] {
        let rate = self.omega / (TAU * LEAD);
        [1.0 - LEFT, rate, 1.0, rate].map(|x| Complex64::new(x, 0.0))
    }
    fn around(&mut self, z: &mut [f64], force: &mut [Vec<f64>; MAX_DIRECTIONS], mut rows: Option<&mut [f64]>) -> bool {
        let (n, m, d) = (self.at[0][0].len(), z.len(), self.axes);
        let size = (m + d) * (4 * d + m + usize::from(self.frequency));
        let read = |signals: [&Signals; 2], i: usize| RelativeMotion {
            displacement: std::array::from_fn(|a| if a < d { signals[0][a][i] } else { 0.0 }),
            velocity: std::array::from_fn(|a| if a < d { signals[1][a][i] } else { 0.0 }),
        };
        let (mut before, mut now) = (z.to_vec(), [0.0; MAX_DIRECTIONS]);
        for step in 1..=n {
            let i = step % n;
            let motions = [read([&self.stages[0], &self.stages[1]], i), read(self.at, i)];
            let rows = rows.as_deref_mut().map(|rows| &mut rows[i * size..(i + 1) * size]);
            if !self.advance((self.length, motions), &before, z, &mut now, rows) {
                return false;
            }
            before.copy_from_slice(z);
            force.iter_mut().zip(now).take(d).for_each(|(force, now)| force[i] = now);
        }
        true
    }
    fn first(&mut self, after: &mut [f64], force: &mut [f64; MAX_DIRECTIONS], rows: Option<&mut [f64]>) -> bool {
        let duration = TAU * LEAD / self.omega;
        let to: [f64; MAX_DIRECTIONS] = std::array::from_fn(|a| if a < self.axes { self.at[0][a][0] } else { 0.0 });
        let velocity = std::array::from_fn(|a| (to[a] - self.rest[a]) / duration);
        let third = std::array::from_fn(|a| LEFT * self.rest[a] + (1.0 - LEFT) * to[a]);
        let motions = [third, to].map(|displacement| RelativeMotion { displacement, velocity });
        let before = std::mem::take(&mut self.at_rest);
        let found = self.advance((duration, motions), &before, after, force, rows);
        self.at_rest = before;
        found
    }
}
