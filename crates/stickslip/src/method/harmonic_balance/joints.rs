//! Friction in the alternation between frequency and time: from the harmonics of a motion to the harmonics of the friction force, with
//! the exact derivative.
//!
//! - A slider behind a spring keeps a history. It is run until it repeats, which takes one period: a slider that moves once
//!   forgets everything before. In stick `f = ±limit + kt (u - u*)`, with `u*` the turning point of `u` that ended the slip
//!   before, so `δf = kt (δu - δu*)`; in slip `δf = 0`. Every stick interval adds one product of a column and a row to the derivative.
//! - A law of velocity, `λ = φ(v)`, rigid or smooth, is taken by its resolvent: for any `ε > 0` it says the same as `λ = J(λ + ε v)` with
//!   `J = (1 + ε φ⁻¹)⁻¹`, which for rigid friction is the projection onto `[-limit, limit]`. `J` never rises faster than its argument,
//!   however steep φ is. Source: Alart and Curnier (1991); Nacivet et al. (2003); Parikh and Boyd, "Proximal Algorithms" (2014).
//! - Steep maps change within a sample. Their mean over it is taken for an argument `y + eξ`, `-1 < ξ < 1`, that is linear there: so a
//!   zero of the velocity is placed within its sample, and the forces stay the gradient of a convex function.

use crate::law::SLIPS_ABOVE;
use crate::method::MethodError;
use crate::model::System;
use num_complex::Complex64;
use std::f64::consts::{FRAC_2_PI, PI, TAU};
use stickslip_numerics::fourier::Fourier;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// A velocity law counts as smooth over a sample if its argument `alpha v` changes by less than this there: the point value is
/// then exact to spectral accuracy, and the mean would be the less accurate of the two.
const SMOOTH: f64 = 0.1;

/// What acts along a coordinate.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Element {
    /// Sliders behind springs, side by side.
    Springs(Vec<Spring>),
    /// A force that the velocity alone decides.
    Velocity(Velocity),
}

/// A slider behind a spring (N/m, N).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spring {
    pub stiffness: f64,
    pub limit: f64,
}

/// A law of velocity: limit in N, steepness in s/m, infinite for rigid friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Velocity {
    pub limit: f64,
    pub alpha: f64,
}

impl Velocity {
    pub fn is_rigid(self) -> bool {
        self.alpha.is_infinite()
    }
}

/// A relative motion with what acts along it: that of a joint, or of a joint's inner slider behind a spring. A joint has one for its
/// sliders behind springs and one for its rigid ones; both move alike.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Coordinate {
    /// The joint.
    pub joint: usize,
    /// Compliance of the spring between the joint and this coordinate, m/N; zero if it is the joint's own motion.
    pub series: f64,
    pub element: Element,
}

/// The coordinates of a system; a joint that carries no force has none.
///
/// # Errors
/// A law with more than one direction.
pub(super) fn coordinates(system: &System) -> Result<Vec<Coordinate>, MethodError> {
    let mut list = Vec::new();
    for (j, joint) in system.joints().iter().enumerate() {
        let unsupported = |instead| MethodError::Law {
            method: super::NAME,
            joint: joint.name().to_owned(),
            law: joint.law().name(),
            instead,
        };
        if joint.axes().len() != 1 {
            return Err(unsupported("a law with one direction"));
        }
        let mut add = |series, element| list.push(Coordinate { joint: j, series, element });
        if let Some(branches) = joint.law().sliders() {
            let springs = branches.iter().filter_map(|branch| {
                let stiffness = branch.stiffness?;
                Some(Spring { stiffness, limit: branch.limit })
            });
            let springs: Vec<Spring> = springs.collect();
            if !springs.is_empty() {
                add(0.0, Element::Springs(springs));
            }
            // rigid sliders side by side are one
            let limit: f64 =
                branches.iter().filter(|branch| branch.stiffness.is_none()).map(|branch| branch.limit).sum();
            if limit > 0.0 {
                add(0.0, Element::Velocity(Velocity { limit, alpha: f64::INFINITY }));
            }
            continue;
        }
        let (Some(prox), Some(alpha)) = (joint.law().prox(), joint.law().value("alpha")) else {
            return Err(unsupported("method `shooting`"));
        };
        let (series, law) = (prox.compliance(), Velocity { limit: joint.law().scale(), alpha });
        if law.limit > 0.0 {
            add(series, Element::Velocity(law));
        }
    }
    Ok(list)
}

/// A map from a signal to a force, sample by sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Map {
    /// The projection onto `[-limit, limit]`.
    Projection { limit: f64 },
    /// The arctangent law itself, of a velocity.
    Arctangent { limit: f64, alpha: f64 },
    /// The resolvent of the arctangent law: `λ` with `λ + ε φ⁻¹(λ) = y`.
    Resolvent { limit: f64, alpha: f64, penalty: f64 },
}

/// The transform's memory for one number of harmonics and samples.
#[derive(Debug, Clone)]
pub(super) struct Alternation {
    pub harmonics: Vec<usize>,
    pub fourier: Fourier,
    pairs: Vec<(usize, Complex64)>,
    /// The signal that was synthesised last.
    pub signal: Vec<f64>,
    argument: Vec<Complex64>,
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
    row: Vec<Complex64>,
    /// The sampled force is the mean over a sample, not the value at its middle.
    mean: bool,
}

/// A stick interval: samples `first..=last` (they may run past N) and the turning point that it started from, in samples.
#[derive(Debug, Clone, Copy)]
struct Stick {
    first: usize,
    last: usize,
    anchor: Option<f64>,
    onset: Option<Onset>,
}

/// What the start of the slip that ends a stick adds to the force of its first sample, see [`Alternation::history`]: the sample, and
/// the derivatives, over the stiffness, by the way since the anchor and by that within the sample.
#[derive(Debug, Clone, Copy)]
struct Onset {
    at: usize,
    since: f64,
    within: f64,
}

impl Alternation {
    pub fn new(harmonics: Vec<usize>, samples: usize) -> Self {
        let zeros = vec![0.0; samples];
        let top = harmonics.last().copied().unwrap_or(0);
        Alternation {
            fourier: Fourier::new(samples),
            pairs: harmonics.iter().map(|&h| (h, ZERO)).collect(),
            signal: zeros.clone(),
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
            row: vec![ZERO; harmonics.len()],
            argument: vec![ZERO; harmonics.len()],
            harmonics,
            mean: false,
        }
    }

    pub fn samples(&self) -> usize {
        self.signal.len()
    }

    /// Samples of the signal with harmonics `c`.
    pub fn synthesise(&mut self, c: &[Complex64]) {
        for (pair, value) in self.pairs.iter_mut().zip(c) {
            pair.1 = *value;
        }
        self.fourier.synthesise(&self.pairs, &mut self.signal);
    }

    /// Harmonics of the force of springs with sliders that move with the harmonics `c`, into `force`, with slip limits times `limits`; the
    /// derivative with respect to (Re, Im) of the harmonics into `tangent` (row-major, 2 × harmonics squared).
    pub fn springs(
        &mut self,
        springs: &[Spring],
        limits: f64,
        c: &[Complex64],
        force: &mut [Complex64],
        mut tangent: Option<&mut [f64]>,
    ) {
        self.synthesise(c);
        force.fill(ZERO);
        if let Some(tangent) = tangent.as_deref_mut() {
            tangent.fill(0.0);
        }
        for spring in springs {
            self.slide(spring, limits, c);
            self.add_force(force);
            if let Some(tangent) = tangent.as_deref_mut() {
                self.add_elastic_tangent(spring.stiffness, tangent);
            }
        }
    }

    /// Force samples of one spring with its slider; the motion `c` has been synthesised.
    pub fn slide(&mut self, spring: &Spring, limits: f64, c: &[Complex64]) {
        let mean = if self.harmonics.first() == Some(&0) { c[0].re } else { 0.0 };
        self.history(spring.stiffness, spring.limit * limits, mean);
    }

    /// Harmonics of the force that a map makes of the signal `y`, and their derivative, as in [`Alternation::springs`].
    pub fn map(&mut self, map: Map, y: &[Complex64], force: &mut [Complex64], tangent: Option<&mut [f64]>) {
        let highest = self.harmonics.last().map_or(1.0, |&h| h as f64);
        let largest: f64 = y.iter().map(|y| y.norm()).sum();
        let change_by = |scale: f64| scale * largest * TAU * highest / self.samples() as f64;
        // a signal whose map is smooth over a sample is exact to spectral accuracy in its middle; the projection has kinks wherever it goes
        self.mean = match map {
            Map::Projection { .. } => true,
            Map::Arctangent { alpha, .. } => change_by(alpha) >= SMOOTH,
            Map::Resolvent { limit, .. } => change_by(1.0 / limit) >= SMOOTH,
        };
        // where the map is the identity, the force of a sticking contact has to be the signal: the mean over a sample is undone before
        let undo = self.mean && !matches!(map, Map::Arctangent { .. });
        let n = self.samples();
        let widen = |h: usize| if undo { 1.0 / (1.0 + change(h, n).norm_sqr() / 3.0) } else { 1.0 };
        for (pair, y) in self.pairs.iter_mut().zip(y) {
            pair.1 = y * widen(pair.0);
        }
        self.fourier.synthesise(&self.pairs, &mut self.signal);
        match map {
            Map::Projection { limit } => self.each(1.0 / limit, limit, 1.0, Mean::saturation),
            Map::Arctangent { limit, alpha } => {
                self.each(alpha, limit * FRAC_2_PI, limit * FRAC_2_PI * alpha, Mean::arctangent);
            }
            Map::Resolvent { limit, alpha, penalty } => {
                let steepness = alpha * limit / penalty;
                self.each(1.0 / limit, limit, 1.0, |y, e| Mean::resolvent(y, e, steepness));
            }
        }
        force.fill(ZERO);
        self.add_force(force);
        if let Some(tangent) = tangent {
            tangent.fill(0.0);
            self.add_map_tangent(tangent);
            if undo {
                for row in tangent.chunks_exact_mut(2 * self.harmonics.len()) {
                    for (pair, &h) in row.chunks_exact_mut(2).zip(&self.harmonics) {
                        pair.iter_mut().for_each(|t| *t *= widen(h));
                    }
                }
            }
        }
    }

    /// Harmonics of a law of velocity of the motion with harmonics `c`; rigid friction changes its sign over the velocity `width`.
    pub fn velocity(&mut self, law: Velocity, width: f64, omega: f64, c: &[Complex64], force: &mut [Complex64]) {
        let (map, factor) = if law.is_rigid() {
            (Map::Projection { limit: law.limit }, law.limit / width.max(f64::MIN_POSITIVE))
        } else {
            (Map::Arctangent { limit: law.limit, alpha: law.alpha }, 1.0)
        };
        let mut signal = std::mem::take(&mut self.argument);
        for ((y, c), &h) in signal.iter_mut().zip(c).zip(&self.harmonics) {
            *y = c * Complex64::new(0.0, factor * h as f64 * omega);
        }
        self.map(map, &signal, force, None);
        self.argument = signal;
    }

    /// The map `mean` of every sample times `scale`, where `mean` is told the value in the middle and half of the change.
    fn each(&mut self, scale: f64, force: f64, stiffness: f64, mean: impl Fn(f64, f64) -> Mean) {
        let n = self.samples();
        for i in 0..n {
            let y = scale * self.signal[i];
            let (before, after) =
                (self.signal[if i == 0 { n - 1 } else { i - 1 }], self.signal[if i + 1 == n { 0 } else { i + 1 }]);
            let e = if self.mean { 0.25 * scale * (after - before) } else { 0.0 };
            let mean = mean(y, e);
            self.slips[i] = mean.slips;
            self.force[i] = force * mean.zeroth;
            self.moment[i] = force * mean.first;
            self.slope[i] = stiffness * mean.slope;
            self.slope_first[i] = stiffness * mean.slope_first;
            self.slope_second[i] = stiffness * mean.slope_second;
        }
    }

    /// Runs the slider behind its spring for one period, and records the second.
    fn history(&mut self, kt: f64, limit: f64, mean: f64) {
        let n = self.samples();
        self.mean = false;
        let u = &self.signal;
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
            let (mut late, mut onset) = (0.0, None);
            if moves {
                if slip == 0.0 {
                    // the slip began between the samples: what the chord through them leaves out of the area, less what the sum over
                    // samples gains on both sides of a kink (Euler and Maclaurin)
                    let before = u[(i + n - 1) % n];
                    let missing = limit - (hold + kt * (before - from)) * trial.signum();
                    let rise = kt * (now - before) * trial.signum();
                    let missing = missing.clamp(0.0, rise.max(0.0));
                    if rise > 0.0 {
                        let share = missing / rise;
                        late = (0.5 * missing * (1.0 - share) - rise / 12.0) * trial.signum();
                        onset = Some(Onset { at: i, since: share - 0.5, within: 0.5 * share * share - 1.0 / 12.0 });
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
                    (false, None) => open = Some(Stick { first: i, last: i, anchor, onset: None }),
                    (true, Some(stick)) => {
                        self.sticks.push(Stick { onset, ..*stick });
                        open = None;
                    }
                    (true, None) => {}
                }
            }
        }
        self.sticks.extend(open);
    }

    /// Any harmonics below half of the samples of the force that was sampled last.
    pub fn add_harmonics(&mut self, wanted: &[usize], mut add: impl FnMut(usize, Complex64)) {
        let n = self.samples();
        self.work.copy_from_slice(&self.force);
        let sums = self.fourier.sums(&mut self.work);
        for (k, &h) in wanted.iter().enumerate().filter(|(_, h)| 2 * **h < n) {
            add(k, sums[h] * 2.0 / n as f64);
        }
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
            let moved = |k: usize, at: f64| Complex64::cis(k as f64 * at * TAU / n as f64);
            // δu* = Re(row δU) = row.re x - row.im y
            let anchor = |k: usize| match stick.anchor {
                Some(at) => moved(k, at),
                None => Complex64::new(if k == 0 { 1.0 } else { 0.0 }, 0.0),
            };
            let scale = |h: usize| kt * if h == 0 { 1.0 } else { 2.0 } / n as f64;
            for (value, &h) in self.column.iter_mut().zip(&self.harmonics) {
                *value = interval_sum(stick, h, n) * -scale(h);
            }
            for (value, &k) in self.row.iter_mut().zip(&self.harmonics) {
                *value = anchor(k);
            }
            add_product(tangent, &self.harmonics, &self.column, &self.row);
            if let Some(Onset { at, since, within }) = stick.onset {
                for (value, &h) in self.column.iter_mut().zip(&self.harmonics) {
                    *value = moved(h, at as f64).conj() * scale(h);
                }
                for (value, &k) in self.row.iter_mut().zip(&self.harmonics) {
                    let (before, now) = (moved(k, at as f64 - 1.0), moved(k, at as f64));
                    *value = (before - *value) * since + (now - before) * within;
                }
                add_product(tangent, &self.harmonics, &self.column, &self.row);
            }
        }
    }

    /// The same for a map of a signal, and of its change over the sample.
    fn add_map_tangent(&mut self, tangent: &mut [f64]) {
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
                add_block(tangent, size, (a, h), (b, k), block);
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
    /// The contact counts as slipping: at its limit, or for the arctangent above [`SLIPS_ABOVE`] of it.
    slips: bool,
}

impl Mean {
    /// g(x) = x.
    #[inline]
    fn linear(y: f64, e: f64) -> Mean {
        Mean { zeroth: y, first: e / 3.0, slope: 1.0, slope_second: 1.0 / 3.0, ..Mean::default() }
    }

    /// g(x) = x cut off at ±1.
    #[inline]
    fn saturation(y: f64, e: f64) -> Mean {
        let (at, reach) = (y.abs(), e.abs());
        if at >= 1.0 + reach {
            return Mean { zeroth: y.signum(), slips: true, ..Mean::default() };
        }
        if at + reach <= 1.0 {
            return Mean::linear(y, e);
        }
        let mut mean = if at - reach >= -1.0 {
            // only the upper end of the ramp lies within the sample, at ξ = t
            let t = ((1.0 - at) / reach).clamp(-1.0, 1.0);
            Mean {
                zeroth: 1.0 - 0.25 * reach * (t + 1.0) * (t + 1.0),
                first: -0.5 * reach * (t * t * t / 6.0 - 0.5 * t - 1.0 / 3.0),
                slope: 0.5 * (t + 1.0),
                slope_first: 0.25 * (t * t - 1.0),
                slope_second: (t * t * t + 1.0) / 6.0,
                slips: at >= 1.0,
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
                slips: at >= 1.0,
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
        let slips = y.abs() >= (SLIPS_ABOVE / FRAC_2_PI).tan();
        if reach == 0.0 {
            return Mean { zeroth: y.atan(), slope: 1.0 / (1.0 + y * y), slips, ..Mean::default() };
        }
        if reach < GENTLE * (1.0 + y.abs()) {
            return Mean { slips, ..Mean::quadrature(y, e, |x| (x.atan(), 1.0 / (1.0 + x * x))) };
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
            slips,
        }
    }

    /// g = the resolvent of `λ = (2/π) atan(s w)`: λ with `λ + w = y`.
    #[inline]
    fn resolvent(y: f64, e: f64, steepness: f64) -> Mean {
        if e == 0.0 {
            let (zeroth, slope) = resolve(y, steepness);
            return Mean { zeroth, slope, slips: zeroth.abs() >= SLIPS_ABOVE, ..Mean::default() };
        }
        let mean = Mean::quadrature(y, e, |y| resolve(y, steepness));
        Mean { slips: mean.zeroth.abs() >= SLIPS_ABOVE, ..mean }
    }

    /// By quadrature of g and g'.
    #[inline]
    fn quadrature(y: f64, e: f64, g: impl Fn(f64) -> (f64, f64)) -> Mean {
        let mut mean = Mean::default();
        for (node, weight) in GAUSS {
            for xi in [-node, node] {
                let (value, slope) = g(y + e * xi);
                mean.zeroth += 0.5 * weight * value;
                mean.first += 0.5 * weight * xi * value;
                mean.slope += 0.5 * weight * slope;
                mean.slope_first += 0.5 * weight * xi * slope;
                mean.slope_second += 0.5 * weight * xi * xi * slope;
            }
        }
        mean
    }
}

/// `λ` and `dλ/dy` of `λ + w = y`, `λ = (2/π) atan(s w)`.
fn resolve(y: f64, s: f64) -> (f64, f64) {
    let target = y.abs();
    // the left side rises with a falling slope in w: Newton's method from a w that is too small never passes the root
    let mut w = (target - 1.0).max(target / (1.0 + FRAC_2_PI * s));
    for _ in 0..RESOLVED {
        let left = w + FRAC_2_PI * (s * w).atan() - target;
        let slope = 1.0 + FRAC_2_PI * s / (1.0 + s * s * w * w);
        let step = left / slope;
        w -= step;
        // the left side is rounded to this; what is no number ends too
        if step.abs() <= 4.0 * f64::EPSILON * target || step.is_nan() {
            break;
        }
    }
    let slope = FRAC_2_PI * s / (1.0 + s * s * w * w);
    ((target - w).copysign(y), slope / (1.0 + slope))
}

/// Iterations of [`resolve`], which doubles its digits.
const RESOLVED: usize = 60;

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

/// Adds the force `column` times the displacement `Re Σ row_k U_k`.
fn add_product(tangent: &mut [f64], harmonics: &[usize], column: &[Complex64], row: &[Complex64]) {
    let size = 2 * harmonics.len();
    for (a, (&h, f)) in harmonics.iter().zip(column).enumerate() {
        for (b, (&k, r)) in harmonics.iter().zip(row).enumerate() {
            add_entries(tangent, size, (a, h), (b, k), [f.re * r.re, -f.re * r.im, f.im * r.re, -f.im * r.im]);
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
