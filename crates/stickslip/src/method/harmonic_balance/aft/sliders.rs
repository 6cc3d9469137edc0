//! Motion ports of sliders behind springs, and of stops: exact for the series.
//!
//! A slider that slips once forgets everything before, so that one period is enough. The
//! turning points of the motion determine its history. Between two of them the motion is
//! monotone. The slider first sticks, `f = ±limit + kt (u - u*)`, with the turning point `u*`
//! that ended the slip before. Then it slips, `f = ±limit`.
//!
//! Turning points and the onset of slip are zeros of the series, found by Newton's method
//! between grid points. The harmonics of the force are integrals over the intervals in closed
//! form. The force is therefore a differentiable function of the harmonics:
//! `δf = kt (δu - δu*)` in stick, `δf = 0` in slip, and the force is continuous between them.
//! Every stick interval adds one rank-one term to the derivative.

use super::StaticState;
use super::events::{BracketingGrid, Interval, OffsetSource, TurningPoint};
use super::frequency_time::{FrequencyTime, ZERO, add_block, as_block, spectrum_pair};
use super::series::{HarmonicSeries, rotations};
use num_complex::Complex64;
use std::f64::consts::{PI, TAU};

/// One of the parallel parts of a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ElasticPart {
    /// A slider behind a spring (N/m, N).
    Slider { stiffness: f64, limit: f64 },
    /// A spring beyond a gap (m, N/m).
    Stop { gap: f64, stiffness: f64 },
}

impl ElasticPart {
    /// Returns the stiffness at rest, N/m.
    pub fn stiffness(&self) -> f64 {
        match *self {
            ElasticPart::Slider { stiffness, .. } => stiffness,
            ElasticPart::Stop { gap, stiffness } => {
                if gap < 0.0 {
                    stiffness
                } else {
                    0.0
                }
            }
        }
    }

    /// Returns the stiffness in contact, N/m.
    pub fn closed(&self) -> f64 {
        match *self {
            ElasticPart::Slider { stiffness, .. } | ElasticPart::Stop { stiffness, .. } => stiffness,
        }
    }

    /// Returns the elongation at which the spring of a slider begins to slip, m; zero for a stop.
    pub fn reach(&self) -> f64 {
        match *self {
            ElasticPart::Slider { stiffness, limit } => limit / stiffness,
            ElasticPart::Stop { .. } => 0.0,
        }
    }
}

/// Returns the force of each part's slider in static equilibrium, N; zero for a stop.
fn static_forces<'a>(parts: &'a [ElasticPart], rest: &'a StaticState) -> impl Iterator<Item = f64> + 'a {
    let mut states = rest.states.iter();
    parts.iter().map(move |part| match part {
        ElasticPart::Slider { .. } => states.next().copied().unwrap_or(0.0),
        ElasticPart::Stop { .. } => 0.0,
    })
}

/// Newton step of an event, in grid steps, that counts as rounding.
const EVENT_TOLERANCE: f64 = 1e-11;

impl FrequencyTime {
    /// Adds the harmonics of the force of the parts in the motion `c` to
    /// `force`, and their derivative to `tangent`.
    pub(super) fn slider_forces(
        &mut self,
        parts: &[ElasticPart],
        rest: &StaticState,
        c: &[Complex64],
        force: &mut [Complex64],
        mut tangent: Option<&mut [f64]>,
    ) {
        self.find_turning_points(c);
        self.state.clear();
        let harmonics = std::mem::take(&mut self.harmonics);
        for (part, hold) in parts.iter().zip(static_forces(parts, rest)) {
            self.history(part, [rest.displacement[0], hold], HarmonicSeries { harmonics: &harmonics, c });
            self.add_intervals(&harmonics, c, force, tangent.as_deref_mut());
        }
        self.harmonics = harmonics;
    }

    /// Samples the force and the slip of the parts. Writes the forces of the
    /// sliders at t = 0 into `self.state`.
    pub(super) fn sample_slides(&mut self, parts: &[ElasticPart], rest: &StaticState, c: &[Complex64]) {
        self.find_turning_points(c);
        self.synthesise(c, |_| Complex64::new(1.0, 0.0));
        self.state.clear();
        self.force[0].fill(0.0);
        self.slips.fill(false);
        let n = self.samples();
        let harmonics = std::mem::take(&mut self.harmonics);
        for (part, hold) in parts.iter().zip(static_forces(parts, rest)) {
            self.history(part, [rest.displacement[0], hold], HarmonicSeries { harmonics: &harmonics, c });
            let before = self.force[0][0];
            for interval in &self.intervals {
                let sample = |phase: f64| (phase * n as f64 / TAU).ceil() as isize;
                let (from, to) = (sample(interval.begin), sample(interval.end));
                for turn in from.div_euclid(n as isize)..=to.div_euclid(n as isize) {
                    let within = |i: isize| (i - turn * n as isize).clamp(0, n as isize) as usize;
                    let range = within(from)..within(to).max(within(from));
                    let forces = self.force[0][range.clone()].iter_mut().zip(&self.signal[range.clone()]);
                    forces.for_each(|(force, u)| *force += interval.stiffness * u + interval.offset);
                    if interval.slips {
                        self.slips[range].fill(true);
                    }
                }
            }
            if matches!(part, ElasticPart::Slider { .. }) {
                self.state.push(self.force[0][0] - before);
            }
        }
        self.harmonics = harmonics;
    }

    /// Samples the motion on the grid, and finds its turning points.
    pub(super) fn find_turning_points(&mut self, c: &[Complex64]) {
        let BracketingGrid { fourier, pairs, value, slope } = &mut self.grid;
        pairs.clear();
        pairs.extend(self.harmonics.iter().copied().zip(c.iter().copied()));
        fourier.synthesize(pairs, value);
        for pair in pairs.iter_mut() {
            pair.1 *= Complex64::new(0.0, pair.0 as f64);
        }
        fourier.synthesize(pairs, slope);
        let series = HarmonicSeries { harmonics: &self.harmonics, c };
        let n = value.len();
        let angle = TAU / n as f64;
        self.extremes.clear();
        let extremes = &mut self.extremes;
        let mut add = |(low, high): (f64, f64), start: f64, sign: f64| {
            let at = series.zero((low, high), start, sign, EVENT_TOLERANCE * angle, |series, theta| {
                let (_, slope, bend) = series.at(theta);
                (slope, bend)
            });
            extremes.push(TurningPoint { phase: at, value: series.at(at).0 });
        };
        // upper bound of the change of the slope between two grid points
        let change: f64 = self.harmonics.iter().zip(c).map(|(&h, c)| (h * h) as f64 * c.l1_norm()).sum::<f64>() * angle;
        for i in 0..n {
            if slope[i].abs() > change {
                continue;
            }
            let (u, v) = (value[i], slope[i] * angle);
            let next = if i + 1 == n { 0 } else { i + 1 };
            let (w, z) = (value[next], slope[next] * angle);
            let low = i as f64 * angle;
            if (v > 0.0) != (z > 0.0) {
                add((low, low + angle), low + angle * v / (v - z), if z > 0.0 { 1.0 } else { -1.0 });
                continue;
            }
            // a pair of zeros between two grid points: the slope of the cubic Hermite
            // interpolant is v + 2 p s + 3 q s², 0 < s < 1
            let (p, q) = (3.0 * (w - u) - 2.0 * v - z, v + z - 2.0 * (w - u));
            let under = p * p - 3.0 * q * v;
            if q == 0.0 || under <= 0.0 || p * q >= 0.0 {
                continue;
            }
            // between the grid points the slope has an extreme on the other side of zero
            let middle = -p / (3.0 * q);
            let theta = low + angle * middle;
            if middle < 1.0 && (series.at(theta).1 > 0.0) != (v > 0.0) {
                let spread = angle * under.sqrt() / (3.0 * q.abs());
                let sign = if v > 0.0 { -1.0 } else { 1.0 };
                add((low, theta), theta - spread, sign);
                add((theta, low + angle), theta + spread, -sign);
            }
        }
    }

    /// Computes the intervals of one part, from the motion and its turning points. `rest` is
    /// its displacement and its force in static equilibrium.
    fn history(&mut self, part: &ElasticPart, rest: [f64; 2], series: HarmonicSeries) {
        self.intervals.clear();
        match *part {
            ElasticPart::Slider { stiffness, limit } => {
                self.slider(stiffness, limit, rest.map(|x| x * self.static_share), series);
            }
            ElasticPart::Stop { gap, stiffness } => self.stop(gap, stiffness, series),
        }
    }

    fn slider(&mut self, kt: f64, limit: f64, [initial_position, initial_force]: [f64; 2], series: HarmonicSeries) {
        let count = self.extremes.len();
        let sticking = |force: f64, position: f64, anchor: OffsetSource, begin: f64, end: f64| Interval {
            begin,
            end,
            stiffness: kt,
            offset: force - kt * position,
            anchor,
            slips: false,
        };
        let slipping = |begin: f64, end: f64, offset: f64| {
            let anchor = OffsetSource::Nothing;
            Interval { begin, end, stiffness: 0.0, offset, anchor, slips: true }
        };
        // force and displacement at the anchor
        let (mut force, mut position, mut anchor) = (initial_force, initial_position, OffsetSource::Nothing);
        let force_at_start = initial_force + kt * (self.grid.value[0] - initial_position);
        if count == 0 && force_at_start.abs() > limit {
            // the slider was dragged to a position at which nothing moves any more
            self.intervals.push(Interval { slips: false, ..slipping(0.0, TAU, limit.copysign(force_at_start)) });
            return;
        }
        let mut slipped = None;
        for leg in 0..2 * count {
            let TurningPoint { phase: at, value } = self.extremes[leg % count];
            let trial = force + kt * (value - position);
            if trial.abs() > limit {
                (force, position, anchor) = (limit.copysign(trial), value, OffsetSource::At(at));
                if leg >= count {
                    slipped = Some(leg);
                    break;
                }
            }
        }
        let Some(first) = slipped else {
            self.intervals.push(sticking(force, position, anchor, 0.0, TAU));
            return;
        };
        // one period from the end of that slip
        let phase = |leg: usize, extremes: &[TurningPoint]| extremes[leg % count].phase + TAU * (leg / count) as f64;
        let mut begin = phase(first, &self.extremes);
        for leg in first + 1..=first + count {
            let (before, end) = (phase(leg - 1, &self.extremes), phase(leg, &self.extremes));
            let value = self.extremes[leg % count].value;
            let trial = force + kt * (value - position);
            if trial.abs() > limit {
                let slip = limit.copysign(trial);
                let onset = self.passage(series, before, end, position + (slip - force) / kt, slip.signum());
                self.intervals.push(sticking(force, position, anchor, begin, onset));
                self.intervals.push(slipping(onset, end, slip));
                (force, position, anchor, begin) = (slip, value, OffsetSource::At(end), end);
            } else if leg == first + count {
                // only reached through rounding
                self.intervals.push(sticking(force, position, anchor, begin, end));
            }
        }
    }

    fn stop(&mut self, gap: f64, stiffness: f64, series: HarmonicSeries) {
        let closed = |begin: f64, end: f64| Interval {
            begin,
            end,
            stiffness,
            offset: -stiffness * gap,
            anchor: OffsetSource::Nothing,
            slips: false,
        };
        let count = self.extremes.len();
        let mut opened = None;
        for leg in 0..count {
            let (a, b) = (self.extremes[leg], self.extremes[(leg + 1) % count]);
            let end = b.phase + if leg + 1 == count { TAU } else { 0.0 };
            // the first passage out of the gap, into contact
            if a.value <= gap && b.value > gap {
                opened = Some((leg, self.passage(series, a.phase, end, gap, 1.0)));
                break;
            }
        }
        let Some((first, mut begin)) = opened else {
            if self.grid.value[0] > gap {
                self.intervals.push(closed(0.0, TAU));
            }
            return;
        };
        let mut touching = true;
        for leg in first + 1..=first + count {
            let (a, b) = (self.extremes[leg % count], self.extremes[(leg + 1) % count]);
            let turns = |leg: usize| TAU * (leg / count) as f64;
            let (from, to) = (a.phase + turns(leg), b.phase + turns(leg + 1));
            if touching && b.value <= gap {
                let end = self.passage(series, from, to, gap, -1.0);
                self.intervals.push(closed(begin, end));
                touching = false;
            } else if !touching && b.value > gap && leg < first + count {
                begin = self.passage(series, from, to, gap, 1.0);
                touching = true;
            }
        }
    }

    /// Returns the phase between two adjacent turning points at which the
    /// motion passes `value`. `upwards` is 1 or -1.
    pub(super) fn passage(&self, series: HarmonicSeries, before: f64, after: f64, value: f64, upwards: f64) -> f64 {
        let n = self.grid.value.len() as isize;
        let angle = TAU / n as f64;
        let u = |i: isize| self.grid.value[i.rem_euclid(n) as usize];
        // bisection over the grid points strictly between
        let (mut low, mut high) = ((before / angle).floor() as isize, (after / angle).ceil() as isize);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if (u(middle) - value) * upwards > 0.0 { high = middle } else { low = middle }
        }
        let bounds = ((low as f64 * angle).max(before), (high as f64 * angle).min(after));
        let rise = u(high) - u(low);
        let share = if rise != 0.0 { (value - u(low)) / rise } else { 0.5 };
        series.zero(
            bounds,
            (low as f64 + share.clamp(0.0, 1.0)) * angle,
            upwards,
            EVENT_TOLERANCE * angle,
            |series, theta| {
                let (at, slope, _) = series.at(theta);
                (at - value, slope)
            },
        )
    }

    /// Adds the harmonics of the force, and their derivative.
    fn add_intervals(
        &mut self,
        harmonics: &[usize],
        c: &[Complex64],
        force: &mut [Complex64],
        mut tangent: Option<&mut [f64]>,
    ) {
        let size = 2 * harmonics.len();
        let scale = |h: usize| if h == 0 { 1.0 / TAU } else { 1.0 / PI };
        let [stiffness, integrals, _] = &mut self.spectra;
        stiffness.fill(ZERO);
        for interval in &self.intervals {
            integrate_over(interval.begin, interval.end, integrals);
            for (sum, integral) in stiffness.iter_mut().zip(&*integrals) {
                *sum += integral * (interval.stiffness / TAU);
            }
            for (value, &h) in self.column.iter_mut().zip(harmonics) {
                *value = integrals[h] * scale(h);
            }
            for (force, integral) in force.iter_mut().zip(&self.column) {
                *force += integral * interval.offset;
            }
            let Some(tangent) = tangent.as_deref_mut() else { continue };
            let by = Complex64::new(-interval.stiffness, 0.0);
            match interval.anchor {
                OffsetSource::Nothing => continue,
                OffsetSource::At(phase) => {
                    let (mut turn, step) = rotations(harmonics, phase);
                    for value in &mut self.row {
                        *value = turn * by;
                        turn *= step;
                    }
                    if harmonics[0] == 0 {
                        self.row[0].im = 0.0;
                    }
                }
            }
            // δu* = Re(row δU) = row.re x - row.im y
            for ((rows, f), &h) in tangent.chunks_exact_mut(2 * size).zip(&self.column).zip(harmonics) {
                let (re, im) = rows.split_at_mut(size);
                add_multiple(re, f.re, &self.row);
                if h > 0 {
                    add_multiple(im, f.im, &self.row);
                }
            }
        }
        for (a, &h) in harmonics.iter().enumerate() {
            let mut sum = ZERO;
            for (b, &k) in harmonics.iter().enumerate() {
                let (minus, plus) = spectrum_pair(stiffness, h, k);
                sum += minus * c[b] + plus * c[b].conj();
                if let Some(tangent) = tangent.as_deref_mut() {
                    add_block(tangent, size, (a, h), (b, k), as_block(minus, plus));
                }
            }
            force[a] += if h == 0 { Complex64::new(0.5 * sum.re, 0.0) } else { sum };
        }
    }
}

/// Adds `f Re(row δU)` to a row of the derivative by the parts of U.
#[inline]
pub(super) fn add_multiple(to: &mut [f64], f: f64, row: &[Complex64]) {
    for (to, r) in to.chunks_exact_mut(2).zip(row) {
        to[0] += f * r.re;
        to[1] -= f * r.im;
    }
}

/// Computes `∫ e^{-jmθ} dθ` over an interval, for m = 0, 1, …
pub(super) fn integrate_over(begin: f64, end: f64, out: &mut [Complex64]) {
    let width = end - begin;
    if width >= TAU {
        out.fill(ZERO);
        out[0] = Complex64::new(TAU, 0.0);
        return;
    }
    let (middle, half) = (Complex64::cis(-0.5 * (begin + end)), Complex64::cis(0.5 * width));
    let (mut turn, mut reach) = (middle, half);
    out[0] = Complex64::new(width, 0.0);
    for (m, out) in out.iter_mut().enumerate().skip(1) {
        *out = turn * (2.0 * reach.im / m as f64);
        turn *= middle;
        reach *= half;
    }
}
