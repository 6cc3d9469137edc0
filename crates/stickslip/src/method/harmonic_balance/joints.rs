//! Friction in the alternation between frequency and time: from the harmonics of a relative motion to the harmonics of the
//! friction force, with the exact derivative.
//!
//! - A slider behind a spring keeps a history. It is run until it repeats, which takes one period: a slider that moves once
//!   forgets everything before. In stick `f = ±limit + kt (u - u*)`, with `u*` the turning point of `u` that ended the slip
//!   before, so `δf = kt (δu - δu*)`; in slip `δf = 0`. Every stick interval adds one product of a column and a row to the derivative.
//! - A rigid slider's force is set-valued: `λ ∈ limit Sgn(v)`. It is written as a projection,
//!   `λ = proj[-limit, limit](λ₀ + limit v / width)`, with a multiplier `λ₀` that is replaced by λ until nothing changes.
//!   At `λ₀ = λ` the condition is `λ ∈ limit Sgn(v)` whatever the width. Source: Alart and Curnier (1991); Nacivet et al. (2003).
//! - Sharp laws of velocity change within a sample. Their power `φ(v)` is averaged over it for a velocity `v + cξ`, `-1 < ξ < 1`,
//!   that is linear there, and the forces are the derivative of that mean: so a zero of the velocity is placed within its sample,
//!   and the forces stay what friction must be, the gradient of a convex function.

use crate::law::Rate;
use crate::method::MethodError;
use crate::model::System;
use num_complex::Complex64;
use std::f64::consts::{FRAC_2_PI, PI, TAU};
use stickslip_numerics::fourier::Fourier;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// A velocity law counts as smooth over a sample if its argument `alpha v` changes by less than this there: the point value is
/// then exact to spectral accuracy, and the mean would be the less accurate of the two.
const SMOOTH: f64 = 0.1;

/// One slider of a coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Slider {
    /// Behind a spring (N/m).
    Elastic { stiffness: f64, limit: f64 },
    /// Rigid; `index` numbers the multipliers.
    Rigid { limit: f64, index: usize },
    /// Arctangent of the velocity.
    Smooth { limit: f64, alpha: f64 },
}

/// An unknown relative motion: that of a joint, or of a joint's inner slider behind a spring.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Coordinate {
    /// The joint.
    pub joint: usize,
    /// Compliance of the spring between the joint and this coordinate, m/N; zero if it is the joint's own motion.
    pub series: f64,
    /// What acts on it, side by side.
    pub sliders: Vec<Slider>,
}

/// The coordinates of a system.
///
/// # Errors
/// A law with more than one direction.
pub(super) fn coordinates(system: &System) -> Result<Vec<Coordinate>, MethodError> {
    let mut rigid = 0;
    let mut list = Vec::new();
    for (j, joint) in system.joints.iter().enumerate() {
        let unsupported = |instead| MethodError::Law {
            method: super::NAME,
            joint: joint.name.clone(),
            law: joint.law.name(),
            instead,
        };
        if joint.direction.ncols() != 1 {
            return Err(unsupported("a law with one direction"));
        }
        if let Some(branches) = joint.law.network() {
            let sliders = branches
                .iter()
                .map(|branch| match branch.stiffness {
                    Some(stiffness) => Slider::Elastic { stiffness, limit: branch.limit },
                    None => {
                        rigid += 1;
                        Slider::Rigid { limit: branch.limit, index: rigid - 1 }
                    }
                })
                .collect();
            list.push(Coordinate { joint: j, series: 0.0, sliders });
            continue;
        }
        list.push(match joint.law.rate() {
            Some(Rate::CoulombArctan(law)) => {
                let sliders = vec![Slider::Smooth { limit: law.limit, alpha: law.alpha }];
                Coordinate { joint: j, series: 0.0, sliders }
            }
            Some(Rate::JenkinsArctan(law)) => {
                let sliders = vec![Slider::Smooth { limit: law.limit, alpha: law.alpha }];
                Coordinate { joint: j, series: 1.0 / law.stiffness, sliders }
            }
            #[allow(unreachable_patterns)] // a law of rate form that is added later
            _ => return Err(unsupported("method `shooting`")),
        });
    }
    Ok(list)
}

/// How sharp friction is at present; the end of every search is [`Sharpness::EXACT`] but for the width of multipliers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sharpness {
    /// Velocity over which rigid sliders hold on to their multiplier, m/s.
    pub width: f64,
    /// Velocity that is added to the width `1/alpha` of smooth laws, m/s.
    pub blur: f64,
    /// Factor on the slip limit of sliders behind springs.
    pub limits: f64,
    /// Rigid sliders that were free (inside their limits) in the forces found last are left unclamped, and the others where they are:
    /// the first step after a change of width or multipliers.
    pub hold: bool,
}

/// Velocity changes over a sample beyond this many widths need no multiplier: the sample has a zero of the velocity, and its mean force
/// is known from where the zero is, whatever the width.
const CROSSES: f64 = 2.0;

/// What a sample of a rigid slider was found to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Seen {
    /// It carries this force, N: inside the limits the slider is free to take any other, at a limit it slips.
    Force(f64),
    /// The velocity passes through zero within the sample.
    Crossing,
}

/// The transform's memory for one number of harmonics and samples.
#[derive(Debug, Clone)]
pub(super) struct Alternation {
    pub harmonics: Vec<usize>,
    pub fourier: Fourier,
    pairs: Vec<(usize, Complex64)>,
    pub displacement: Vec<f64>,
    pub velocity: Vec<f64>,
    /// Force of the slider evaluated last, per sample.
    pub force: Vec<f64>,
    /// Per sample of the slider evaluated last: it moves.
    pub slips: Vec<bool>,
    work: Vec<f64>,
    slope: Vec<f64>,
    moment: Vec<f64>,
    slope_first: Vec<f64>,
    slope_second: Vec<f64>,
    sticks: Vec<Stick>,
    spectrum: Vec<Complex64>,
    spectrum_first: Vec<Complex64>,
    spectrum_second: Vec<Complex64>,
    column: Vec<Complex64>,
    /// The sampled force is the mean over a sample, not the value at its middle.
    mean: bool,
}

/// A stick interval: samples `first..=last` (they may run past N) and the turning point that it started from, in samples.
#[derive(Debug, Clone, Copy)]
struct Stick {
    first: usize,
    last: usize,
    anchor: Option<f64>,
}

impl Alternation {
    pub fn new(harmonics: Vec<usize>, samples: usize) -> Self {
        let zeros = vec![0.0; samples];
        let top = harmonics.last().copied().unwrap_or(0);
        Alternation {
            fourier: Fourier::new(samples),
            pairs: harmonics.iter().map(|&h| (h, ZERO)).collect(),
            displacement: zeros.clone(),
            velocity: zeros.clone(),
            force: zeros.clone(),
            slips: vec![false; samples],
            work: zeros.clone(),
            slope: zeros.clone(),
            moment: zeros.clone(),
            slope_first: zeros.clone(),
            slope_second: zeros,
            sticks: Vec::new(),
            spectrum: vec![ZERO; 2 * top + 1],
            spectrum_first: vec![ZERO; 2 * top + 1],
            spectrum_second: vec![ZERO; 2 * top + 1],
            column: vec![ZERO; harmonics.len()],
            harmonics,
            mean: false,
        }
    }

    pub fn samples(&self) -> usize {
        self.displacement.len()
    }

    /// Samples of the motion with harmonics `c`, and of its velocity.
    pub fn synthesise(&mut self, c: &[Complex64], omega: f64) {
        for (pair, value) in self.pairs.iter_mut().zip(c) {
            pair.1 = *value;
        }
        self.fourier.synthesise(&self.pairs, &mut self.displacement);
        for (pair, value) in self.pairs.iter_mut().zip(c) {
            pair.1 = value * Complex64::new(0.0, pair.0 as f64 * omega);
        }
        self.fourier.synthesise(&self.pairs, &mut self.velocity);
    }

    /// Harmonics of the force of all sliders of a coordinate that moves with the harmonics `c`, into `force`; the derivative with
    /// respect to (Re, Im) of the harmonics into `tangent` (row-major, 2 × harmonics squared). `multipliers` holds λ₀, `next` gets λ.
    #[allow(clippy::too_many_arguments)] // buffers of one kernel
    pub fn evaluate(
        &mut self,
        coordinate: &Coordinate,
        c: &[Complex64],
        omega: f64,
        sharpness: Sharpness,
        multipliers: &[Vec<f64>],
        next: &mut [Vec<Seen>],
        force: &mut [Complex64],
        mut tangent: Option<&mut [f64]>,
    ) {
        self.synthesise(c, omega);
        force.fill(ZERO);
        if let Some(tangent) = tangent.as_deref_mut() {
            tangent.fill(0.0);
        }
        for slider in &coordinate.sliders {
            self.slide(slider, c, sharpness, multipliers, next);
            self.add_force(force);
            if let Some(tangent) = tangent.as_deref_mut() {
                match slider {
                    Slider::Elastic { stiffness, .. } => self.add_elastic_tangent(*stiffness, tangent),
                    _ => self.add_velocity_tangent(omega, tangent),
                }
            }
        }
    }

    /// Force and derivative samples of one slider; [`Alternation::synthesise`] has been called.
    pub fn slide(
        &mut self,
        slider: &Slider,
        c: &[Complex64],
        sharpness: Sharpness,
        multipliers: &[Vec<f64>],
        next: &mut [Vec<Seen>],
    ) {
        match *slider {
            Slider::Elastic { stiffness, limit } => {
                let mean = if self.harmonics.first() == Some(&0) { c[0].re } else { 0.0 };
                self.history(stiffness, limit * sharpness.limits, mean);
            }
            Slider::Rigid { limit, index } => self.rigid(limit, sharpness, &multipliers[index], &mut next[index]),
            Slider::Smooth { limit, alpha } => self.smooth(limit, 1.0 / (1.0 / alpha + sharpness.blur)),
        }
    }

    /// Runs the slider behind its spring for one period, and records the second.
    fn history(&mut self, kt: f64, limit: f64, mean: f64) {
        let n = self.samples();
        self.mean = false;
        let u = &self.displacement;
        // force and displacement at the anchor; where the anchor is, in samples; the sign of the slip now
        let (mut hold, mut from, mut anchor, mut slip) = (0.0, mean, None, 0.0f64);
        self.sticks.clear();
        let mut open: Option<Stick> = None;
        for step in 0..2 * n {
            let i = if step >= n { step - n } else { step };
            let now = u[i];
            let mut trial = hold + kt * (now - from);
            if slip != 0.0 && trial * slip < limit {
                // the slip has ended between the samples: the anchor is the vertex of the parabola through three of them
                let before = u[(i + n - 2) % n];
                let at = u[(i + n - 1) % n];
                let bend = before - 2.0 * at + now;
                if bend * slip < 0.0 {
                    let shift = (-0.5 * (now - before) / bend).clamp(-1.0, 1.0);
                    from = at + 0.5 * (now - before) * shift + 0.5 * bend * shift * shift;
                    anchor = Some((i + n - 1) as f64 % n as f64 + shift);
                    trial = hold + kt * (now - from);
                }
                slip = 0.0;
            }
            let moves = trial.abs() > limit;
            let mut late = 0.0;
            if moves {
                if slip == 0.0 {
                    // the slip began between the samples: what the chord through them leaves out of the area, less what the sum over
                    // samples gains on both sides of a kink (Euler and Maclaurin)
                    let before = u[(i + n - 1) % n];
                    let missing = limit - (hold + kt * (before - from)) * trial.signum();
                    let rise = kt * (now - before) * trial.signum();
                    let missing = missing.clamp(0.0, rise.max(0.0));
                    if rise > 0.0 {
                        late = (0.5 * missing * (1.0 - missing / rise) - rise / 12.0) * trial.signum();
                    }
                }
                slip = trial.signum();
                (hold, from, anchor) = (slip * limit, now, Some(i as f64));
                trial = hold;
            }
            if step >= n {
                self.force[i] = trial + late;
                self.slips[i] = moves;
                match (moves, &mut open) {
                    (false, Some(stick)) => stick.last = i,
                    (false, None) => open = Some(Stick { first: i, last: i, anchor }),
                    (true, Some(stick)) => {
                        self.sticks.push(*stick);
                        open = None;
                    }
                    (true, None) => {}
                }
            }
        }
        self.sticks.extend(open);
    }

    fn rigid(&mut self, limit: f64, sharpness: Sharpness, multipliers: &[f64], next: &mut [Seen]) {
        let Sharpness { width, hold, .. } = sharpness;
        let n = self.samples();
        self.mean = true;
        let (stiffness, inverse) = (limit / width, 1.0 / width);
        for i in 0..n {
            let y = self.velocity[i] * inverse + multipliers[i] / limit;
            let e = 0.25 * inverse * (self.velocity[(i + 1) % n] - self.velocity[(i + n - 1) % n]);
            let mean = match next[i] {
                Seen::Force(force) if hold && force.abs() >= limit => {
                    Mean { zeroth: force.signum(), ..Mean::default() }
                }
                Seen::Force(_) if hold => Mean::linear(y, e),
                _ => Mean::saturation(y, e),
            };
            if !hold {
                next[i] = if e.abs() > CROSSES && mean.slope > 0.0 {
                    Seen::Crossing
                } else {
                    Seen::Force(limit * mean.zeroth)
                };
            }
            self.slips[i] = mean.zeroth.abs() >= 1.0;
            self.store(i, &mean, limit, stiffness);
        }
    }

    fn smooth(&mut self, limit: f64, alpha: f64) {
        let n = self.samples();
        let factor = limit * FRAC_2_PI;
        let speed = self.velocity.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let highest = self.harmonics.last().map_or(1.0, |&h| h as f64);
        let pointwise = alpha * speed * TAU * highest / (n as f64) < SMOOTH;
        self.mean = !pointwise;
        for i in 0..n {
            let y = alpha * self.velocity[i];
            let e = 0.25 * alpha * (self.velocity[(i + 1) % n] - self.velocity[(i + n - 1) % n]);
            let mean = if pointwise {
                Mean { zeroth: y.atan(), slope: 1.0 / (1.0 + y * y), ..Mean::default() }
            } else {
                Mean::arctangent(y, e)
            };
            self.slips[i] = y.abs() > 1.0;
            self.store(i, &mean, factor, factor * alpha);
        }
    }

    #[inline]
    fn store(&mut self, i: usize, mean: &Mean, force: f64, stiffness: f64) {
        self.force[i] = force * mean.zeroth;
        self.moment[i] = force * mean.first;
        self.slope[i] = stiffness * mean.slope;
        self.slope_first[i] = stiffness * mean.slope_first;
        self.slope_second[i] = stiffness * mean.slope_second;
    }

    /// Adds the harmonics of the sampled force.
    fn add_force(&mut self, force: &mut [Complex64]) {
        let n = self.samples();
        let scale = |h: usize| if h == 0 { 1.0 } else { 2.0 } / n as f64;
        self.work.copy_from_slice(&self.force);
        let sums = self.fourier.sums(&mut self.work);
        for (f, &h) in force.iter_mut().zip(&self.harmonics) {
            *f += sums[h] * scale(h);
        }
        if self.mean {
            self.work.copy_from_slice(&self.moment);
            let sums = self.fourier.sums(&mut self.work);
            for (f, &h) in force.iter_mut().zip(&self.harmonics) {
                *f += sums[h] * scale(h) * change(h, n).conj();
            }
        }
    }

    /// `δf_h = Σ_k (G_{h-k} δU_k + G_{h+k} δU_k*)` with the spectrum G of the stiffness over time, and the anchors.
    fn add_elastic_tangent(&mut self, kt: f64, tangent: &mut [f64]) {
        let n = self.samples();
        let top = self.spectrum.len();
        self.spectrum.fill(ZERO);
        for stick in &self.sticks {
            for m in 0..top {
                self.spectrum[m] += interval_sum(stick, m, n) * (kt / n as f64);
            }
        }
        let size = 2 * self.harmonics.len();
        for (a, &h) in self.harmonics.iter().enumerate() {
            for (b, &k) in self.harmonics.iter().enumerate() {
                let (minus, plus) = pair(&self.spectrum, h, k);
                let block = [minus.re + plus.re, plus.im - minus.im, minus.im + plus.im, minus.re - plus.re];
                add_block(tangent, size, (a, h), (b, k), block);
            }
        }
        for stick in &self.sticks {
            for (value, &h) in self.column.iter_mut().zip(&self.harmonics) {
                let scale = if h == 0 { 1.0 } else { 2.0 };
                *value = interval_sum(stick, h, n) * (-kt * scale / n as f64);
            }
            for (b, &k) in self.harmonics.iter().enumerate() {
                let row = match stick.anchor {
                    Some(at) => Complex64::cis(k as f64 * at * TAU / n as f64),
                    None if k == 0 => Complex64::new(1.0, 0.0),
                    None => continue,
                };
                // δu* = Re(row δU) = row.re x - row.im y
                for (a, &h) in self.harmonics.iter().enumerate() {
                    let f = self.column[a];
                    let block = [f.re * row.re, -f.re * row.im, f.im * row.re, -f.im * row.im];
                    add_entries(tangent, size, (a, h), (b, k), block);
                }
            }
        }
    }

    /// The same for forces that depend on velocity, and on its change over the sample.
    fn add_velocity_tangent(&mut self, omega: f64, tangent: &mut [f64]) {
        let n = self.samples();
        let top = self.spectrum.len();
        for (values, spectrum) in [
            (&self.slope, &mut self.spectrum),
            (&self.slope_first, &mut self.spectrum_first),
            (&self.slope_second, &mut self.spectrum_second),
        ] {
            self.work.copy_from_slice(values);
            let sums = self.fourier.sums(&mut self.work);
            for m in 0..top {
                spectrum[m] = sums[m] / n as f64;
            }
            if !self.mean {
                break;
            }
        }
        let size = 2 * self.harmonics.len();
        for (a, &h) in self.harmonics.iter().enumerate() {
            for (b, &k) in self.harmonics.iter().enumerate() {
                let (mut minus, mut plus) = pair(&self.spectrum, h, k);
                if self.mean {
                    let (row, column) = (change(h, n).conj(), change(k, n));
                    let (minus_1, plus_1) = pair(&self.spectrum_first, h, k);
                    let (minus_2, plus_2) = pair(&self.spectrum_second, h, k);
                    minus += (row + column) * minus_1 + row * column * minus_2;
                    plus += (row + column.conj()) * plus_1 + row * column.conj() * plus_2;
                }
                let block = [minus.re + plus.re, plus.im - minus.im, minus.im + plus.im, minus.re - plus.re];
                // columns: δv = jkΩ δU, so x goes to the imaginary and y to the negative real part
                let rate = k as f64 * omega;
                let turned = [block[1] * rate, -block[0] * rate, block[3] * rate, -block[2] * rate];
                add_block(tangent, size, (a, h), (b, k), turned);
            }
        }
    }
}

/// Half of the change of `e^{jhθ}` over a sample, relative to its middle.
fn change(h: usize, n: usize) -> Complex64 {
    Complex64::new(0.0, 0.5 * (h as f64 * TAU / n as f64).sin())
}

/// Means over `-1 < ξ < 1` of `g(y + eξ)` and `ξ g`, and of `g'`, `ξ g'`, `ξ² g'`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Mean {
    zeroth: f64,
    first: f64,
    slope: f64,
    slope_first: f64,
    slope_second: f64,
}

impl Mean {
    /// g(x) = x.
    #[inline]
    fn linear(y: f64, e: f64) -> Mean {
        Mean { zeroth: y, first: e / 3.0, slope: 1.0, slope_first: 0.0, slope_second: 1.0 / 3.0 }
    }

    /// g(x) = x cut off at ±1.
    #[inline]
    fn saturation(y: f64, e: f64) -> Mean {
        let (at, reach) = (y.abs(), e.abs());
        if at >= 1.0 + reach {
            return Mean { zeroth: y.signum(), ..Mean::default() };
        }
        if at + reach <= 1.0 {
            return Mean::linear(y, e);
        }
        let mut mean = if reach <= 1.0 - at + 2.0 * (at.min(1.0)) && at - reach >= -1.0 {
            // only the upper end of the ramp lies within the sample, at ξ = t
            let t = ((1.0 - at) / reach).clamp(-1.0, 1.0);
            Mean {
                zeroth: 1.0 - 0.25 * reach * (t + 1.0) * (t + 1.0),
                first: -0.5 * reach * (t * t * t / 6.0 - 0.5 * t - 1.0 / 3.0),
                slope: 0.5 * (t + 1.0),
                slope_first: 0.25 * (t * t - 1.0),
                slope_second: (t * t * t + 1.0) / 6.0,
            }
        } else {
            // both ends: from ξ = s to ξ = t
            let (s, t) = ((-1.0 - at) / reach, (1.0 - at) / reach);
            let (s, t) = (s.clamp(-1.0, 1.0), t.clamp(-1.0, 1.0));
            let ramp = |power: i32| (t.powi(power) - s.powi(power)) / f64::from(power);
            let (r1, r2, r3) = (ramp(1), ramp(2), ramp(3));
            Mean {
                zeroth: 0.5 * (at * r1 + reach * r2 + (1.0 - t) - (s + 1.0)),
                first: 0.5 * (at * r2 + reach * r3 + 0.5 * (1.0 - t * t) - 0.5 * (s * s - 1.0)),
                slope: 0.5 * r1,
                slope_first: 0.5 * r2,
                slope_second: 0.5 * r3,
            }
        };
        if y < 0.0 {
            (mean.zeroth, mean.slope_first) = (-mean.zeroth, -mean.slope_first);
        }
        if e < 0.0 {
            (mean.first, mean.slope_first) = (-mean.first, -mean.slope_first);
        }
        mean
    }

    /// g = arctan, in closed form, or by quadrature where that cancels.
    #[inline]
    fn arctangent(y: f64, e: f64) -> Mean {
        let reach = e.abs();
        if reach < GENTLE * (1.0 + y.abs()) {
            let mut mean = Mean::default();
            for (node, weight) in GAUSS {
                for xi in [-node, node] {
                    let x = y + e * xi;
                    let (value, slope) = (x.atan(), 1.0 / (1.0 + x * x));
                    mean.zeroth += 0.5 * weight * value;
                    mean.first += 0.5 * weight * xi * value;
                    mean.slope += 0.5 * weight * slope;
                    mean.slope_first += 0.5 * weight * xi * slope;
                    mean.slope_second += 0.5 * weight * xi * xi * slope;
                }
            }
            return mean;
        }
        let (low, high) = (y - reach, y + reach);
        let (low_value, high_value) = (low.atan(), high.atan());
        let once = |x: f64, atan: f64| x * atan - 0.5 * (x * x).ln_1p();
        let twice = |x: f64, atan: f64| 0.5 * (x * x - 1.0) * atan + 0.5 * x - 0.5 * x * (x * x).ln_1p();
        let (low_1, high_1) = (once(low, low_value), once(high, high_value));
        let zeroth = (high_1 - low_1) / (2.0 * reach);
        let first = (high_1 + low_1) / (2.0 * reach)
            - (twice(high, high_value) - twice(low, low_value)) / (2.0 * reach * reach);
        let slope = (high_value - low_value) / (2.0 * reach);
        let sign = e.signum();
        Mean {
            zeroth,
            first: first * sign,
            slope,
            slope_first: ((high_value + low_value) / (2.0 * reach) - zeroth / reach) * sign,
            slope_second: slope - 2.0 * first / reach,
        }
    }
}

/// Change of the argument over a sample, relative to the length over which the arctangent changes, up to which the quadrature is
/// exact to rounding.
const GENTLE: f64 = 0.2;
/// Nodes and weights of the 6-point Gauss-Legendre rule, positive half. Abramowitz and Stegun, Table 25.4.
const GAUSS: [(f64, f64); 3] = [
    (0.238_619_186_083_196_9, 0.467_913_934_572_691),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.932_469_514_203_152, 0.171_324_492_379_170_35),
];

/// `G_{h-k}` and `G_{h+k}` of a real signal.
#[inline]
fn pair(spectrum: &[Complex64], h: usize, k: usize) -> (Complex64, Complex64) {
    (if h >= k { spectrum[h - k] } else { spectrum[k - h].conj() }, spectrum[h + k])
}

/// Adds a 2 × 2 block; the mean has half the weight of the others and no imaginary part.
#[inline]
fn add_block(tangent: &mut [f64], size: usize, row: (usize, usize), column: (usize, usize), block: [f64; 4]) {
    let weight = if row.1 == 0 { 0.5 } else { 1.0 };
    add_entries(tangent, size, row, column, block.map(|x| weight * x));
}

#[inline]
fn add_entries(tangent: &mut [f64], size: usize, (a, h): (usize, usize), (b, k): (usize, usize), block: [f64; 4]) {
    let at = 2 * a * size + 2 * b;
    tangent[at] += block[0];
    if k > 0 {
        tangent[at + 1] += block[1];
    }
    if h > 0 {
        tangent[at + size] += block[2];
        if k > 0 {
            tangent[at + size + 1] += block[3];
        }
    }
}

/// `Σ_{i=first..=last} e^{-jmθ_i}`.
fn interval_sum(stick: &Stick, m: usize, n: usize) -> Complex64 {
    let count = (stick.last - stick.first + 1) as f64;
    if m == 0 {
        return Complex64::new(count, 0.0);
    }
    let half = m as f64 * PI / n as f64;
    Complex64::cis(-half * (stick.first + stick.last) as f64) * ((count * half).sin() / half.sin())
}
