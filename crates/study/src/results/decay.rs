//! Damping from a free decay, cycle by cycle.
//!
//! Three consecutive turning points form a cycle of two swings `s` and `s'`. A swing is half
//! the distance between two turning points, so an offset cancels. A drifting mean, as friction
//! with memory has, lengthens every other swing, but it cancels in the sum of two consecutive
//! swings. So the logarithmic decrement of a cycle compares two such sums, half a cycle apart:
//!
//! `δ = 2 ln((s + s')/(s' + s''))`, with the next swing `s''`.
//!
//! The formula is exact for a linear oscillator. The amplitude of the cycle is the geometric mean
//! of both sums, `√((s + s')(s' + s''))/2`, which is about the middle swing. `ζ = δ/√(4π² + δ²)` is
//! the damping ratio of the linear oscillator with the same decrement.
//!
//! The next swing of a motion that comes to rest is zero. If the record ends during the motion, the
//! last cycle without a next swing is left out; a decay of two swings only compares these. Ripples
//! of a higher mode, swings much shorter than later ones, are no cycles.

use std::f64::consts::TAU;

/// One cycle of a decay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Start time, s.
    pub time: f64,
    /// Amplitude in its middle, to which the damping ratio belongs, m.
    pub amplitude: f64,
    /// Inverse of its duration, Hz.
    pub frequency: f64,
    /// Damping ratio of the linear oscillator with the same decrement.
    pub damping_ratio: f64,
}

/// Displacement (m) and velocity (m/s) of a place at a time (s) between two samples.
pub type PlaceMotionFn<'a> = dyn Fn(f64) -> [f64; 2] + 'a;

/// The turning points of one place, detected as samples arrive.
#[derive(Debug, Clone, Default)]
pub struct Decay {
    first: Option<[f64; 3]>,
    last: Option<[f64; 3]>,
    /// Largest speed of a sample, m/s.
    fastest: f64,
    turns: Vec<(f64, f64)>,
    /// Smallest and largest displacement of a sample, m.
    extent: Option<(f64, f64)>,
}

impl Decay {
    /// Adds a sample: time (s), displacement (m), velocity (m/s).
    ///
    /// Locates a turning point since the last sample by `motion`, or by the cubic through both
    /// samples if `motion` is `None`. The cubic has an error where the acceleration jumps, as
    /// at the turning points of dry friction.
    pub fn add(&mut self, [time, displacement, velocity]: [f64; 3], motion: Option<&PlaceMotionFn<'_>>) {
        self.first.get_or_insert([time, displacement, velocity]);
        self.fastest = self.fastest.max(velocity.abs());
        match self.last {
            Some([t, x, v]) if v != 0.0 && v * velocity <= 0.0 => {
                let cubic = cubic([t, x, v], [time, displacement, velocity]);
                self.turns.push(turning_point(motion.unwrap_or(&cubic), [t, time], v));
            }
            _ => {}
        }
        let (low, high) = self.extent.unwrap_or((displacement, displacement));
        self.extent = Some((low.min(displacement), high.max(displacement)));
        self.last = Some([time, displacement, velocity]);
    }

    /// Returns the range of the displacements so far, m.
    pub fn extent(&self) -> f64 {
        self.extent.map_or(0.0, |(low, high)| high - low)
    }

    /// Returns the largest swing, m.
    pub fn largest(&self) -> f64 {
        self.turns().windows(2).map(|pair| swing(pair[0], pair[1])).fold(0.0, f64::max)
    }

    /// Returns the turning points. A motion that begins at rest begins with one.
    fn turns(&self) -> Vec<(f64, f64)> {
        // the velocities and accelerations of static equilibrium are rounding
        let rounding = 1e-9;
        let first = self.first.filter(|[_, _, velocity]| velocity.abs() <= rounding * self.fastest);
        let first = first.map(|[time, displacement, _]| (time, displacement));
        let least = rounding * self.extent();
        // a first velocity of the other sign than the next one makes a second turning point there
        let later = self.turns.iter().skip_while(|turn| first.is_some_and(|first| swing(first, **turn) <= least));
        first.into_iter().chain(later.copied()).collect()
    }

    /// Returns the consecutive cycles until the motion rests.
    pub fn cycles(&self) -> Vec<Cycle> {
        // Swings below this share of the largest swing count as rest.
        let least = 1e-9 * self.largest();
        let turns = without_ripples(&self.turns(), least);
        let swings: Vec<f64> = turns.windows(2).map(|pair| swing(pair[0], pair[1])).collect();
        let moves = swings.iter().position(|swing| *swing <= least).unwrap_or(swings.len());
        let swings = &swings[..moves];
        let rests = moves + 1 < turns.len() || self.last.is_some_and(|[_, _, velocity]| velocity == 0.0);
        let complete = if rests || moves == 2 { moves } else { moves.saturating_sub(1) };
        let cycles = (1..complete).step_by(2).map_while(|second| {
            let duration = turns[second + 1].0 - turns[second - 1].0;
            (duration > 0.0).then(|| {
                let [before, after] = means(swings, second);
                let decrement = 2.0 * (before / after).ln();
                Cycle {
                    time: turns[second - 1].0,
                    amplitude: (before * after).sqrt(),
                    frequency: 1.0 / duration,
                    damping_ratio: decrement / TAU.hypot(decrement),
                }
            })
        });
        cycles.collect()
    }
}

/// Returns the means of two consecutive swings, half a cycle apart, of the cycle whose second swing
/// has index `second`.
fn means(swings: &[f64], second: usize) -> [f64; 2] {
    let pair = |first: usize| 0.5 * (swings[first] + swings.get(first + 1).copied().unwrap_or(0.0));
    match swings.len() {
        2 => [swings[0], swings[1]],
        _ => [pair(second - 1), pair(second)],
    }
}

/// Returns the turning points without those of ripples: swings that are not longer than both
/// neighbouring ones, and much shorter than a later one. Swings up to `least` are rest.
fn without_ripples(turns: &[(f64, f64)], least: f64) -> Vec<(f64, f64)> {
    // A swing shorter than this share of a later one is a ripple: swings of a decay become shorter.
    // A drift that lengthens every other swing needs 60 % of the amplitude in half a cycle to make
    // this ratio.
    let share = 0.25;
    // the longest swing from each turning point on
    let mut later = vec![0.0; turns.len()];
    for i in (1..turns.len()).rev() {
        later[i - 1] = swing(turns[i - 1], turns[i]).max(later[i]);
    }
    let mut kept: Vec<usize> = Vec::with_capacity(turns.len());
    for next in 0..turns.len() {
        kept.push(next);
        while let [.., a, b, c, d] = kept[..] {
            let [before, own, after] = [(a, b), (b, c), (c, d)].map(|(from, to)| swing(turns[from], turns[to]));
            if own <= least || own > before.min(after) || own >= share * later[c] {
                break;
            }
            kept.truncate(kept.len() - 3);
            kept.push(d);
        }
    }
    if kept.len() < turns.len() {
        // ripples after the last long swing, and that swing, which may end at one of them
        let is_ripple = |kept: &[usize]| match *kept {
            [.., a, b, c] => {
                let lasts = |from: usize, to: usize| turns[to].0 - turns[from].0;
                let own = swing(turns[b], turns[c]);
                own > least && own < share * swing(turns[a], turns[b]) && 2.0 * lasts(b, c) < lasts(a, b)
            }
            _ => false,
        };
        while is_ripple(&kept) {
            kept.pop();
        }
        kept.pop();
    }
    kept.into_iter().map(|turn| turns[turn]).collect()
}

fn swing(a: (f64, f64), b: (f64, f64)) -> f64 {
    0.5 * (a.1 - b.1).abs()
}

/// Returns the cubic through two samples and their velocities.
fn cubic([t0, x0, v0]: [f64; 3], [t1, x1, v1]: [f64; 3]) -> impl Fn(f64) -> [f64; 2] {
    let step = t1 - t0;
    // x = x0 + step (v0 s + b s² + c s³) with 0 <= s <= 1
    let mean = (x1 - x0) / step;
    let (b, c) = (3.0 * mean - 2.0 * v0 - v1, v0 + v1 - 2.0 * mean);
    move |time| {
        let s = (time - t0) / step;
        [x0 + step * s * (v0 + s * (b + s * c)), v0 + s * (2.0 * b + s * 3.0 * c)]
    }
}

/// Returns time and displacement of the first turning point, or onset of stick, between two
/// times.
///
/// The motion has velocity `v0` at the first time; the search ends where the velocity in the
/// direction of `v0` vanishes.
fn turning_point(motion: &PlaceMotionFn<'_>, [mut low, mut high]: [f64; 2], v0: f64) -> (f64, f64) {
    // Number of bisections of the time between two samples: all bits of a double.
    for _ in 0..53 {
        let middle = 0.5 * (low + high);
        if motion(middle)[1] * v0 > 0.0 { low = middle } else { high = middle }
    }
    let time = 0.5 * (low + high);
    (time, motion(time)[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn decay(motion: impl Fn(f64) -> (f64, f64), duration: f64, step: f64) -> Vec<Cycle> {
        let mut decay = Decay::default();
        for i in 0..=(duration / step) as usize {
            let time = i as f64 * step;
            let (x, v) = motion(time);
            decay.add([time, x, v], None);
        }
        decay.cycles()
    }

    /// `x = e^(-ζ ω t) cos(ω_d t)` with an offset.
    #[test]
    fn a_linear_oscillator_has_its_damping_ratio_in_every_cycle() {
        let (zeta, omega) = (0.03f64, TAU * 10.0);
        let damped = omega * (1.0 - zeta * zeta).sqrt();
        let motion = |t: f64| {
            let fall = (-zeta * omega * t).exp();
            let (cos, sin) = ((damped * t).cos(), (damped * t).sin());
            (0.2 + fall * cos, -fall * (zeta * omega * cos + damped * sin))
        };
        let cycles = decay(motion, 1.0, 1e-3);
        assert!(cycles.len() >= 8, "{}", cycles.len());
        for cycle in &cycles {
            // samples are 1/100 of a period apart; the cubic has an error of 1e-7
            assert!((cycle.damping_ratio - zeta).abs() < 1e-5, "{cycle:?}");
            assert!((cycle.frequency - damped / TAU).abs() < 1e-4, "{cycle:?}");
            // the envelope at the turning points, three half cycles from the first one to the last
            let envelope = damped / omega * (-zeta * omega * (cycle.time + 1.5 * PI / damped)).exp();
            let mean = (0.5 * zeta * omega * PI / damped).cosh().powi(2);
            assert!((cycle.amplitude / (envelope * mean) - 1.0).abs() < 1e-5, "{cycle:?} {envelope}");
        }
    }

    /// The mean drifts by more than the decay of the amplitude: linearly, and with a mean that
    /// comes to rest.
    #[test]
    fn a_drifting_mean_does_not_change_the_damping() {
        let (zeta, omega) = (0.002f64, TAU * 10.0);
        let damped = omega * (1.0 - zeta * zeta).sqrt();
        for creep in [-0.3, 0.3] {
            let motion = |t: f64| {
                let fall = (-zeta * omega * t).exp();
                let (cos, sin) = ((damped * t).cos(), (damped * t).sin());
                let (mean, rate) = (-creep * (-t).exp(), creep * (-t).exp());
                (mean + fall * cos, rate - fall * (zeta * omega * cos + damped * sin))
            };
            let cycles = decay(motion, 2.0, 1e-3);
            assert!(cycles.len() >= 18, "{}", cycles.len());
            for cycle in &cycles {
                // the remaining error is the second difference of the drift over half a cycle,
                // 0.3 (1/20)² of an amplitude of 1, over 2π
                assert!((cycle.damping_ratio - zeta).abs() < 1.3e-4, "{cycle:?}");
            }
        }
    }

    /// With Coulomb friction every swing is shorter than the one before by `limit/k`. All cycles
    /// obey the formula, wherever the record ends.
    #[test]
    fn every_cycle_of_a_dry_decay_is_complete() {
        let (offset, loss, omega) = (1.0f64, 0.06, TAU * 5.0);
        let motion = |t: f64| {
            let half = (omega * t / PI).floor();
            let (sign, amplitude) = (if half % 2.0 == 0.0 { 1.0 } else { -1.0 }, offset - loss * (2.0 * half + 1.0));
            let phase = omega * t - PI * half;
            (sign * (amplitude * phase.cos() + loss), -sign * amplitude * omega * phase.sin())
        };
        let swing = |i: usize| offset - loss * (2.0 * i as f64 + 1.0);
        // the velocity at the beginning is zero, or rounding
        let begins = [0.0, 1e-14, -1e-14];
        for (duration, velocity) in [0.41, 0.45, 0.49, 0.51, 0.55, 0.59].into_iter().zip(begins.into_iter().cycle()) {
            let cycles = decay(|t| if t > 0.0 { motion(t) } else { (motion(t).0, velocity) }, duration, 1e-3);
            assert_eq!(cycles.len(), if duration < 0.5 { 1 } else { 2 });
            for (i, cycle) in cycles.iter().enumerate() {
                let sum = |first: usize| swing(first) + swing(first + 1);
                let decrement = 2.0 * (sum(2 * i) / sum(2 * i + 1)).ln();
                let expected = decrement / TAU.hypot(decrement);
                assert!((cycle.damping_ratio - expected).abs() < 1e-4, "{duration}: {cycle:?}, not {expected}");
            }
        }
    }

    /// A higher mode of 2 % of the amplitude adds turning points.
    #[test]
    fn ripples_of_a_higher_mode_are_no_cycles() {
        let (zeta, omega) = (0.03f64, TAU * 10.0);
        let motion = |t: f64| {
            let (fall, ripple) = ((-zeta * omega * t).exp(), 0.02 * (-3.0 * t).exp());
            let (fast, phase) = (31.0 * omega * t, omega * t);
            let slow_rate = -fall * omega * (zeta * phase.cos() + phase.sin());
            let fast_rate = ripple * (31.0 * omega * fast.cos() - 3.0 * fast.sin());
            (fall * phase.cos() + ripple * fast.sin(), slow_rate + fast_rate)
        };
        let cycles = decay(motion, 1.0, 1e-4);
        assert!((8..=10).contains(&cycles.len()), "{}", cycles.len());
        for cycle in &cycles {
            assert!((cycle.frequency - 10.0).abs() < 0.5 && (cycle.damping_ratio - zeta).abs() < 0.02, "{cycle:?}");
        }
    }

    #[test]
    fn rest_and_a_single_swing_have_no_cycle() {
        assert!(decay(|_| (1.0, 0.0), 1.0, 0.01).is_empty());
        assert!(decay(|t| (t * t, 2.0 * t), 1.0, 0.01).is_empty());
    }
}
