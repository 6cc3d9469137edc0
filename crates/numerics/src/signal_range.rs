//! Minimum and maximum of a signal over an interval, proved by bounds.
//!
//! Values `g`, slopes `g'` and curvatures `g''` are known at both ends of a subinterval of length
//! h. The curvature in between lies within `(g''₁ + g''₂ ± max|g'''| h) / 2` and `± max|g''|`. The
//! signal therefore lies below two parabolas that start at the ends, and likewise above two.
//! Subintervals that cannot extend the known range are skipped. If the curvature has one sign,
//! Newton's method finds the single turning point. All other subintervals are halved.

use crate::signal::{ExponentialBasis, magnitude, magnitude_bound, real_dot};
use num_complex::Complex64;

/// The range of the values that signals are known to take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueRange {
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// If true, every value also adds its negative.
    mirrored: bool,
}

impl ValueRange {
    /// Creates an empty range. If `mirrored`, every value also adds its negative.
    pub fn new(mirrored: bool) -> Self {
        ValueRange { low: f64::INFINITY, high: f64::NEG_INFINITY, mirrored }
    }

    /// Extends the range by a value.
    #[inline]
    pub fn include(&mut self, value: f64) {
        (self.low, self.high) = (self.low.min(value), self.high.max(value));
        if self.mirrored {
            self.high = self.high.max(-self.low);
            self.low = -self.high;
        }
    }
}

/// A signal over the time interval `[0, length]`.
#[derive(Debug, Clone, Copy)]
pub struct SignalSegment<'a> {
    /// Coefficients of the signal.
    pub coefficients: &'a [Complex64],
    /// Basis functions at the end of the interval.
    pub at_end: &'a [Complex64],
    /// Length of the interval, s.
    pub length: f64,
}

/// Error: the signal has too many turning points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooFast;

/// Scratch memory of [`ExponentialBasis::extend_range`], reused between calls.
#[derive(Debug, Clone, Default)]
pub struct RangeScratch {
    values: Vec<Complex64>,
    /// The signal without negligible modes, and its first two derivatives.
    slopes: [Vec<Complex64>; 3],
    /// Bounds on the basis functions.
    magnitudes: Vec<f64>,
    /// Magnitudes of the exponents.
    exponent_magnitudes: Vec<f64>,
    /// Magnitudes of the coefficients of the second derivative, and bounds on those of the third.
    sizes: [Vec<f64>; 2],
    intervals: Vec<[SignalSample; 2]>,
}

/// A signal and its derivatives at one time.
#[derive(Debug, Clone, Copy)]
struct SignalSample {
    time: f64,
    value: f64,
    slope: f64,
    curvature: f64,
    /// Bounds on the second and third derivative from this time on.
    second: f64,
    third: f64,
}

impl RangeScratch {
    fn prepare(&mut self, nb: usize) {
        let zero = Complex64::new(0.0, 0.0);
        self.values.resize(nb, zero);
        self.slopes.iter_mut().for_each(|slope| slope.resize(nb, zero));
        self.magnitudes.resize(nb, 0.0);
        self.exponent_magnitudes.resize(nb, 0.0);
        self.sizes.iter_mut().for_each(|sizes| sizes.resize(nb, 0.0));
        self.intervals.clear();
    }

    /// Computes the derivatives of the signal without negligible modes, and their bounds.
    /// Returns the size of the signal's terms.
    fn differentiate(&mut self, basis: &ExponentialBasis, signal: &[Complex64], length: f64) -> f64 {
        self.prepare(basis.len());
        let RangeScratch {
            slopes: [kept, first, second],
            magnitudes,
            exponent_magnitudes,
            sizes: [weights, third],
            ..
        } = self;
        basis.magnitudes(length, magnitudes);
        weights.iter_mut().zip(signal).for_each(|(weight, c)| *weight = magnitude(c));
        let size = magnitude_bound(weights, magnitudes);
        kept.copy_from_slice(signal);
        for ((kept, weight), exponent) in kept.iter_mut().zip(&*weights).zip(&basis.exponents) {
            // A mode below this fraction of a signal is rounding. It does not change an extreme,
            // but a very fast one turns millions of times.
            if exponent.re <= 0.0 && *weight <= (64.0 * f64::EPSILON) * size {
                *kept = Complex64::new(0.0, 0.0);
            }
        }
        basis.differentiate(kept, first);
        basis.differentiate(first, second);
        weights.iter_mut().zip(&*second).for_each(|(weight, c)| *weight = magnitude(c));
        basis.exponent_magnitudes(exponent_magnitudes);
        basis.differentiate_sizes(weights, exponent_magnitudes, third);
        size
    }

    fn sample(&mut self, basis: &ExponentialBasis, signal: &[Complex64], time: f64) -> SignalSample {
        let RangeScratch { values, slopes: [_, first, second], magnitudes, sizes: [weights, third], .. } = self;
        basis.evaluate_and(time, values, |b, size| {
            if basis.exponents[b].re < 0.0 {
                magnitudes[b] = size; // it decays from then on
            }
        });
        SignalSample {
            time,
            value: real_dot(signal, values),
            slope: real_dot(first, values),
            curvature: real_dot(second, values),
            second: magnitude_bound(weights, magnitudes),
            third: magnitude_bound(third, magnitudes),
        }
    }

    /// Returns the extreme value between two times with slopes of opposite sign
    /// and a curvature of one sign.
    fn turning_value(
        &mut self,
        basis: &ExponentialBasis,
        signal: &[Complex64],
        [left, right]: [SignalSample; 2],
        rounding: f64,
    ) -> f64 {
        let (mut from, mut to) = (left.time, right.time);
        let mut time = from + (to - from) * first_guess(&left, &right);
        let mut value = left.value;
        // Maximum number of steps towards one turning point. They converge cubically in value;
        // bisection is the fallback.
        for _ in 0..60 {
            let sample = self.sample(basis, signal, time);
            let step = -sample.slope / sample.curvature;
            value = sample.value + 0.5 * sample.slope * step;
            if left.third * step.abs().powi(3) <= rounding {
                break;
            }
            if sample.slope * left.slope > 0.0 {
                from = time
            } else {
                to = time
            }
            time += step;
            if !(from < time && time < to) {
                time = 0.5 * (from + to);
            }
        }
        value
    }
}

/// Returns the zero of the cubic with these slopes and curvatures as a fraction of the
/// interval. It takes one Newton step from the zero of the chord.
fn first_guess(left: &SignalSample, right: &SignalSample) -> f64 {
    let h = right.time - left.time;
    let s = left.slope / (left.slope - right.slope);
    // The cubic deviates from the chord by s (1 - s) (p (1 - s) - q s).
    let rise = right.slope - left.slope;
    let (p, q) = (left.curvature * h - rise, right.curvature * h - rise);
    let value = s * (1.0 - s) * (p * (1.0 - s) - q * s);
    let slope = rise + p * (1.0 - s) * (1.0 - 3.0 * s) - q * s * (2.0 - 3.0 * s);
    let better = s - value / slope;
    if 0.0 < better && better < 1.0 { better } else { s }
}

/// Returns an upper bound of a signal over an interval of length `h`.
///
/// `left` and `right` are value and slope at the ends. The curvature is at most `most`, so the
/// signal lies below the parabolas that start at the ends.
fn upper_bound(h: f64, left: (f64, f64), right: (f64, f64), most: f64) -> f64 {
    let curvature = most.max(0.0);
    let opening = left.1 - right.1 + curvature * h;
    if opening <= 0.0 {
        return left.0.max(right.0);
    }
    let meet = (right.0 - left.0 - right.1 * h + 0.5 * curvature * h * h) / opening;
    let meet = meet.clamp(0.0, h);
    (left.0 + meet * (left.1 + 0.5 * curvature * meet)).max(left.0).max(right.0)
}

impl ExponentialBasis {
    /// Extends a range by the values of a signal over a time interval.
    ///
    /// # Errors
    /// [`TooFast`] if the signal has too many turning points.
    pub fn extend_range(
        &self,
        range: &mut ValueRange,
        segment: SignalSegment,
        memory: &mut RangeScratch,
    ) -> Result<(), TooFast> {
        let SignalSegment { coefficients: signal, at_end, length } = segment;
        // Accuracy of an extreme, relative to the sum of the sizes of the terms of the signal:
        // the rounding of its values.
        let rounding = (2.0 * f64::EPSILON) * memory.differentiate(self, signal, length);
        let begin = memory.sample(self, signal, 0.0);
        let [_, first, second] = &memory.slopes;
        let end = SignalSample {
            time: length,
            value: real_dot(signal, at_end),
            slope: real_dot(first, at_end),
            curvature: real_dot(second, at_end),
            second: 0.0,
            third: 0.0,
        };
        range.include(begin.value);
        range.include(end.value);
        memory.intervals.push([begin, end]);
        let mut times = 0;
        while let Some([left, right]) = memory.intervals.pop() {
            let h = right.time - left.time;
            let (middle, change) = (0.5 * (left.curvature + right.curvature), 0.5 * left.third * h);
            let (least, most) = ((middle - change).max(-left.second), (middle + change).min(left.second));
            let above = upper_bound(h, (left.value, left.slope), (right.value, right.slope), most);
            let below = -upper_bound(h, (-left.value, -left.slope), (-right.value, -right.slope), -least);
            if above <= range.high + rounding && below >= range.low - rounding {
                continue;
            }
            let turned = left.slope * right.slope <= 0.0;
            if most < 0.0 || least > 0.0 {
                if turned {
                    let value = memory.turning_value(self, signal, [left, right], rounding);
                    range.include(value);
                }
                continue;
            }
            // The slope cannot reach zero within the interval.
            if !turned && left.slope.abs() + right.slope.abs() > h * most.max(-least) {
                continue;
            }
            let time = 0.5 * (left.time + right.time);
            if time <= left.time || time >= right.time {
                continue; // no number lies in between
            }
            times += 1;
            // Maximum number of subdivisions of one signal, after which it counts as too fast. A
            // turning point takes about three. A mode that vibrates undamped at a hundred times
            // the excitation frequency has two hundred turning points in a period.
            if times > 20_000 {
                return Err(TooFast);
            }
            let between = memory.sample(self, signal, time);
            range.include(between.value);
            memory.intervals.push([left, between]);
            memory.intervals.push([between, right]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Random signals: no sample lies outside the range, and some sample is
    /// close to either end of it.
    #[test]
    fn ranges_hold_all_values_and_no_more() {
        let c = Complex64::new;
        let (random, mut drawn) = (Stream::new(7), 0);
        let mut memory = RangeScratch::default();
        for case in 0..200 {
            let mut draw = |scale: f64| {
                drawn += 1;
                scale * (2.0 * random.uniform(drawn) - 1.0)
            };
            let mut exponents: Vec<Complex64> = [1.0, 3.0, 1.0, 40.0]
                .map(|speed| c(if case % 3 == 0 { 0.0 } else { -0.2 * draw(speed).abs() }, speed + draw(0.5)))
                .to_vec();
            exponents[2] = exponents[0] + c(0.0, 1e-6);
            let resonant = vec![(exponents[0], c(0.0, 1e-6))];
            let basis = ExponentialBasis { resonant, driven_by: vec![2], exponents, drifts: case % 2 == 0 };
            let mut signal: Vec<Complex64> = (0..basis.len()).map(|_| c(draw(1.0), draw(1.0))).collect();
            signal[3] *= [0.0, 1e-3, 1e-17][case % 3];
            let length = 0.1 + draw(5.0).abs();
            let mut values = signal.clone();
            let mut seen = ValueRange::new(case % 2 == 0);
            const SAMPLES: usize = 20_000;
            for k in 0..=SAMPLES {
                basis.evaluate(length * k as f64 / SAMPLES as f64, &mut values);
                seen.include(real_dot(&signal, &values));
            }
            basis.evaluate(length, &mut values);
            let mut range = ValueRange::new(case % 2 == 0);
            basis
                .extend_range(&mut range, SignalSegment { coefficients: &signal, at_end: &values, length }, &mut memory)
                .unwrap();
            // At the nearest sample the signal is lower than its maximum by its curvature.
            let (digits, missed) = (1e-14, 10.0 * (length / SAMPLES as f64).powi(2));
            assert!(range.high >= seen.high - digits && range.high <= seen.high + missed, "{case}: {range:?} {seen:?}");
            assert!(range.low <= seen.low + digits && range.low >= seen.low - missed, "{case}: {range:?} {seen:?}");
        }
    }

    /// cos τ over many periods, with a very fast mode that is negligible; then
    /// with a fast mode that is not.
    #[test]
    fn fast_modes_are_followed_only_where_they_count() {
        let basis = ExponentialBasis {
            exponents: vec![Complex64::new(0.0, 1.0), Complex64::new(0.0, 1e9)],
            ..ExponentialBasis::default()
        };
        let zero = Complex64::new(0.0, 0.0);
        let mut memory = RangeScratch::default();
        let mut of = |amplitude: f64| {
            let signal = [Complex64::new(0.0, -1.0), Complex64::new(amplitude, 0.0), zero];
            let mut values = [zero; 3];
            basis.evaluate(100.0, &mut values);
            let mut range = ValueRange::new(false);
            let segment = SignalSegment { coefficients: &signal, at_end: &values, length: 100.0 };
            basis.extend_range(&mut range, segment, &mut memory).map(|()| range)
        };
        let range = of(1e-17).unwrap();
        assert!((range.high - 1.0).abs() < 1e-15 && (range.low + 1.0).abs() < 1e-15, "{range:?}");
        assert_eq!(of(1e-3), Err(TooFast));
    }
}
