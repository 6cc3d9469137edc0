//! Friction in the alternation between frequency and time: from the harmonics of a relative motion to the harmonics of the
//! friction force, with the exact derivative.
//!
//! - A slider behind a spring keeps a history. It is run until it repeats, which takes one period: a slider that moves once
//!   forgets everything before. In stick `f = ±limit + kt (u - u*)`, with `u*` the turning point of `u` that ended the slip
//!   before, so `δf = kt (δu - δu*)`; in slip `δf = 0`. Every stick interval adds one product of a column and a row to the derivative.
//! - A rigid slider's force is set-valued: `λ ∈ limit Sgn(v)`. It is written as a projection,
//!   `λ = proj[-limit, limit]((limit v + width λ₀) / (w + width))`, with a multiplier `λ₀` that is replaced by λ until nothing changes.
//!   At `λ₀ = λ` the condition is `λ ∈ limit Sgn(v)` whatever the width. Source: Alart and Curnier (1991); Nacivet et al. (2003).
//! - Sharp laws of velocity change within a sample. Their mean over the sample is taken, in closed form for a velocity that is linear
//!   there: `w` is half of the change of velocity over the sample. So a zero of the velocity is placed within its sample.

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

impl Slider {
    pub fn limit(&self) -> f64 {
        match *self {
            Slider::Elastic { limit, .. } | Slider::Rigid { limit, .. } | Slider::Smooth { limit, .. } => limit,
        }
    }
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
        let unsupported =
            |instead| MethodError::Law { method: super::NAME, joint: joint.name.clone(), law: joint.law.name(), instead };
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
    slope_w: Vec<f64>,
    sticks: Vec<Stick>,
    spectrum: Vec<Complex64>,
    spectrum_w: Vec<Complex64>,
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
            slope_w: zeros,
            sticks: Vec::new(),
            spectrum: vec![ZERO; 2 * top + 1],
            spectrum_w: vec![ZERO; 2 * top + 1],
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
        next: &mut [Vec<f64>],
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
        next: &mut [Vec<f64>],
    ) {
        match *slider {
            Slider::Elastic { stiffness, limit } => {
                let mean = if self.harmonics.first() == Some(&0) { c[0].re } else { 0.0 };
                self.history(stiffness, limit * sharpness.limits, mean);
            }
            Slider::Rigid { limit, index } => self.rigid(limit, sharpness.width, &multipliers[index], &mut next[index]),
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
            if moves {
                slip = trial.signum();
                (hold, from, anchor) = (slip * limit, now, Some(i as f64));
                trial = hold;
            }
            if step >= n {
                self.force[i] = trial;
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

    fn rigid(&mut self, limit: f64, width: f64, multipliers: &[f64], next: &mut [f64]) {
        let n = self.samples();
        self.mean = true;
        for i in 0..n {
            let v = self.velocity[i];
            let change = 0.25 * (self.velocity[(i + 1) % n] - self.velocity[(i + n - 1) % n]);
            let spread = change.abs() + width;
            let free = (limit * v + width * multipliers[i]) / spread;
            let moves = free.abs() >= limit;
            let force = free.clamp(-limit, limit);
            (self.force[i], next[i], self.slips[i]) = (force, force, moves);
            self.slope[i] = if moves { 0.0 } else { limit / spread };
            self.slope_w[i] = if moves { 0.0 } else { -free / spread * change.signum() };
        }
    }

    fn smooth(&mut self, limit: f64, alpha: f64) {
        let n = self.samples();
        let factor = limit * FRAC_2_PI;
        let speed = self.velocity.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let pointwise = alpha * speed * TAU * self.harmonics.last().map_or(1.0, |&h| h as f64) / (n as f64) < SMOOTH;
        self.mean = !pointwise;
        // integral of the arctangent
        let integral = |x: f64| x * x.atan() - 0.5 * (x * x).ln_1p();
        for i in 0..n {
            let x = alpha * self.velocity[i];
            let change = 0.25 * alpha * (self.velocity[(i + 1) % n] - self.velocity[(i + n - 1) % n]);
            let w = change.abs();
            let (value, by_x, by_w) = if pointwise || w < 1e-4 {
                (x.atan(), 1.0 / (1.0 + x * x), 0.0)
            } else {
                let mean = (integral(x + w) - integral(x - w)) / (2.0 * w);
                let (high, low) = ((x + w).atan(), (x - w).atan());
                (mean, (high - low) / (2.0 * w), (0.5 * (high + low) - mean) / w)
            };
            self.force[i] = factor * value;
            self.slips[i] = x.abs() > 1.0;
            self.slope[i] = factor * alpha * by_x;
            self.slope_w[i] = factor * alpha * by_w * change.signum();
        }
    }

    /// Adds the harmonics of the sampled force.
    fn add_force(&mut self, force: &mut [Complex64]) {
        let n = self.samples();
        self.work.copy_from_slice(&self.force);
        let mean = self.mean;
        let sums = self.fourier.sums(&mut self.work);
        for (f, &h) in force.iter_mut().zip(&self.harmonics) {
            let scale = if h == 0 { 1.0 } else { 2.0 } / n as f64;
            *f += sums[h] * (scale * if mean { sinc(h, n) } else { 1.0 });
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
        let mean = self.mean;
        self.work.copy_from_slice(&self.slope);
        let sums = self.fourier.sums(&mut self.work);
        for m in 0..top {
            self.spectrum[m] = sums[m] / n as f64;
        }
        self.spectrum_w.fill(ZERO);
        if mean {
            self.work.copy_from_slice(&self.slope_w);
            let sums = self.fourier.sums(&mut self.work);
            for m in 0..top {
                self.spectrum_w[m] = sums[m] / n as f64;
            }
        }
        let size = 2 * self.harmonics.len();
        let angle = TAU / n as f64;
        for (a, &h) in self.harmonics.iter().enumerate() {
            let factor = if mean { sinc(h, n) } else { 1.0 };
            for (b, &k) in self.harmonics.iter().enumerate() {
                let (minus, plus) = pair(&self.spectrum, h, k);
                let (minus_w, plus_w) = pair(&self.spectrum_w, h, k);
                // the change over the sample of e^{jkθ} is j sin(kφ)/2 times it
                let change = Complex64::new(0.0, 0.5 * (k as f64 * angle).sin());
                let (minus, plus) = (minus + minus_w * change, plus + plus_w * change.conj());
                let block = [minus.re + plus.re, plus.im - minus.im, minus.im + plus.im, minus.re - plus.re];
                // columns: δv = jkΩ δU, so x goes to the imaginary and y to the negative real part
                let rate = k as f64 * omega * factor;
                let turned = [block[1] * rate, -block[0] * rate, block[3] * rate, -block[2] * rate];
                add_block(tangent, size, (a, h), (b, k), turned);
            }
        }
    }

    /// `sin(πh/N)/(πh/N)`: what the mean over a sample leaves of harmonic h.
    pub fn filter(&self, h: usize) -> f64 {
        sinc(h, self.samples())
    }
}

fn sinc(h: usize, n: usize) -> f64 {
    let x = PI * h as f64 / n as f64;
    if h == 0 { 1.0 } else { x.sin() / x }
}

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
