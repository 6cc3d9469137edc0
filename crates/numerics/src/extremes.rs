//! Least and largest value of a signal over a stretch of time, proved by bounds.
//!
//! Between two times at which value `g`, slope `g'` and curvature `g''` are known, the curvature is within `(g''₁ + g''₂ ± max|g'''| h) / 2` and
//! `± max|g''|`, and by that the signal below two parabolas that begin at the ends. What cannot leave the range that is known already is left
//! out; where the curvature has one sign there is one turning point at most, which Newton's method finds; the rest is halved.

use crate::signal::{Basis, bounded_by, real_dot, size_of};
use num_complex::Complex64;

/// A mode whose part of a signal is below this fraction of it is rounding: it moves no extreme, but turns millions of times where it is very fast.
const NEGLIGIBLE: f64 = 64.0 * f64::EPSILON;
/// An extreme is sought up to this fraction of the sizes that a signal is the sum of: the rounding of its values.
const ROUNDING: f64 = 2.0 * f64::EPSILON;
/// Times at which one signal is looked at before it counts as too fast. A turning point takes some three of them: a mode that rings undamped at a
/// hundred times the drive frequency turns two hundred times in a period.
const MOST_TIMES: usize = 20_000;
/// Steps towards one turning point; they converge cubically in value, and the last of these would be a bisection.
const STEPS: usize = 60;

/// The range of values that signals are known to take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Whether every value stands for its opposite too.
    mirrored: bool,
}

impl Range {
    /// Nothing yet; if `mirrored`, every value stands for its opposite too.
    pub fn new(mirrored: bool) -> Self {
        Range { low: f64::INFINITY, high: f64::NEG_INFINITY, mirrored }
    }

    /// Takes a value in.
    #[inline]
    pub fn take(&mut self, value: f64) {
        (self.low, self.high) = (self.low.min(value), self.high.max(value));
        if self.mirrored {
            self.high = self.high.max(-self.low);
            self.low = -self.high;
        }
    }
}

/// The signal turns too often to be followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooFast;

/// Memory of [`Basis::extend`], kept between calls.
#[derive(Debug, Clone, Default)]
pub struct Extremes {
    values: Vec<Complex64>,
    /// The signal without what is rounding of it, and its derivatives.
    slopes: [Vec<Complex64>; 3],
    /// Sizes of the basis functions, of the exponents, of the coefficients of the second derivative, and bounds on those of the third.
    magnitudes: Vec<f64>,
    speeds: Vec<f64>,
    sizes: [Vec<f64>; 2],
    open: Vec<[At; 2]>,
}

/// A signal at one time.
#[derive(Debug, Clone, Copy)]
struct At {
    time: f64,
    value: f64,
    slope: f64,
    curvature: f64,
    /// Bounds on the second and third derivative from then on.
    second: f64,
    third: f64,
}

impl Extremes {
    fn prepare(&mut self, nb: usize) {
        let zero = Complex64::new(0.0, 0.0);
        self.values.resize(nb, zero);
        self.slopes.iter_mut().for_each(|slope| slope.resize(nb, zero));
        self.magnitudes.resize(nb, 0.0);
        self.speeds.resize(nb, 0.0);
        self.sizes.iter_mut().for_each(|sizes| sizes.resize(nb, 0.0));
        self.open.clear();
    }

    /// Derivatives of the signal without what is rounding of it, and bounds; returns the size of its terms.
    fn differentiate(&mut self, basis: &Basis, signal: &[Complex64], length: f64) -> f64 {
        self.prepare(basis.len());
        let Extremes { slopes: [kept, first, second], magnitudes, speeds, sizes: [weights, third], .. } = self;
        basis.magnitudes(length, magnitudes);
        weights.iter_mut().zip(signal).for_each(|(weight, c)| *weight = size_of(c));
        let size = bounded_by(weights, magnitudes);
        kept.copy_from_slice(signal);
        for ((kept, weight), exponent) in kept.iter_mut().zip(&*weights).zip(&basis.exponents) {
            if exponent.re <= 0.0 && *weight <= NEGLIGIBLE * size {
                *kept = Complex64::new(0.0, 0.0);
            }
        }
        basis.differentiate(kept, first);
        basis.differentiate(first, second);
        weights.iter_mut().zip(&*second).for_each(|(weight, c)| *weight = size_of(c));
        basis.speeds(speeds);
        basis.differentiate_sizes(weights, speeds, third);
        size
    }

    fn at(&mut self, basis: &Basis, signal: &[Complex64], time: f64) -> At {
        let Extremes { values, slopes: [_, first, second], magnitudes, sizes: [weights, third], .. } = self;
        basis.evaluate_and(time, values, |b, size| {
            if basis.exponents[b].re < 0.0 {
                magnitudes[b] = size; // from then on it is smaller
            }
        });
        At {
            time,
            value: real_dot(signal, values),
            slope: real_dot(first, values),
            curvature: real_dot(second, values),
            second: bounded_by(weights, magnitudes),
            third: bounded_by(third, magnitudes),
        }
    }

    /// Where the slope vanishes between two times at which it has opposite signs, and between which the curvature has one.
    fn turning(&mut self, basis: &Basis, signal: &[Complex64], [left, right]: [At; 2], rounding: f64) -> f64 {
        let (mut from, mut to) = (left.time, right.time);
        let mut time = from + (to - from) * first_guess(&left, &right);
        let mut value = left.value;
        for _ in 0..STEPS {
            let at = self.at(basis, signal, time);
            let step = -at.slope / at.curvature;
            value = at.value + 0.5 * at.slope * step;
            if left.third * step.abs().powi(3) <= rounding {
                break;
            }
            if at.slope * left.slope > 0.0 {
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

/// Where the cubic of these slopes and curvatures vanishes, by one step from where the chord does, as a share of the interval.
fn first_guess(left: &At, right: &At) -> f64 {
    let h = right.time - left.time;
    let s = left.slope / (left.slope - right.slope);
    // of the chord the cubic deviates by s (1 - s) (p (1 - s) - q s)
    let rise = right.slope - left.slope;
    let (p, q) = (left.curvature * h - rise, right.curvature * h - rise);
    let value = s * (1.0 - s) * (p * (1.0 - s) - q * s);
    let slope = rise + p * (1.0 - s) * (1.0 - 3.0 * s) - q * s * (2.0 - 3.0 * s);
    let better = s - value / slope;
    if 0.0 < better && better < 1.0 { better } else { s }
}

/// Upper bound of a signal between two times, where its curvature is at most `most`: below the parabolas that begin at the ends.
fn highest(h: f64, left: (f64, f64), right: (f64, f64), most: f64) -> f64 {
    let curvature = most.max(0.0);
    let opening = left.1 - right.1 + curvature * h;
    if opening <= 0.0 {
        return left.0.max(right.0);
    }
    let meet = (right.0 - left.0 - right.1 * h + 0.5 * curvature * h * h) / opening;
    let meet = meet.clamp(0.0, h);
    (left.0 + meet * (left.1 + 0.5 * curvature * meet)).max(left.0).max(right.0)
}

impl Basis {
    /// Extends a range by the values of a signal over `[0, length]`; `at_end` are the basis functions at `length`.
    ///
    /// # Errors
    /// [`TooFast`] if the signal turns too often.
    pub fn extend(
        &self,
        range: &mut Range,
        (signal, at_end): (&[Complex64], &[Complex64]),
        length: f64,
        memory: &mut Extremes,
    ) -> Result<(), TooFast> {
        let rounding = ROUNDING * memory.differentiate(self, signal, length);
        let begin = memory.at(self, signal, 0.0);
        let [_, first, second] = &memory.slopes;
        let end = At {
            time: length,
            value: real_dot(signal, at_end),
            slope: real_dot(first, at_end),
            curvature: real_dot(second, at_end),
            second: 0.0,
            third: 0.0,
        };
        range.take(begin.value);
        range.take(end.value);
        memory.open.push([begin, end]);
        let mut times = 0;
        while let Some([left, right]) = memory.open.pop() {
            let h = right.time - left.time;
            let (middle, change) = (0.5 * (left.curvature + right.curvature), 0.5 * left.third * h);
            let (least, most) = ((middle - change).max(-left.second), (middle + change).min(left.second));
            let above = highest(h, (left.value, left.slope), (right.value, right.slope), most);
            let below = -highest(h, (-left.value, -left.slope), (-right.value, -right.slope), -least);
            if above <= range.high + rounding && below >= range.low - rounding {
                continue;
            }
            let turned = left.slope * right.slope <= 0.0;
            if most < 0.0 || least > 0.0 {
                if turned {
                    let value = memory.turning(self, signal, [left, right], rounding);
                    range.take(value);
                }
                continue;
            }
            // the slope does not come back to zero in so short a time
            if !turned && left.slope.abs() + right.slope.abs() > h * most.max(-least) {
                continue;
            }
            let time = 0.5 * (left.time + right.time);
            if time <= left.time || time >= right.time {
                continue; // time has no room for more digits
            }
            times += 1;
            if times > MOST_TIMES {
                return Err(TooFast);
            }
            let between = memory.at(self, signal, time);
            range.take(between.value);
            memory.open.push([left, between]);
            memory.open.push([between, right]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Random signals: no sample lies outside their range, and near its ends there is one.
    #[test]
    fn ranges_hold_all_values_and_no_more() {
        let c = Complex64::new;
        let (random, mut drawn) = (Stream::new(7), 0);
        let mut memory = Extremes::default();
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
            let basis = Basis { resonant, driven_by: vec![2], exponents, drifts: case % 2 == 0 };
            let mut signal: Vec<Complex64> = (0..basis.len()).map(|_| c(draw(1.0), draw(1.0))).collect();
            signal[3] *= [0.0, 1e-3, 1e-17][case % 3];
            let length = 0.1 + draw(5.0).abs();
            let mut values = signal.clone();
            let mut seen = Range::new(case % 2 == 0);
            const SAMPLES: usize = 20_000;
            for k in 0..=SAMPLES {
                basis.evaluate(length * k as f64 / SAMPLES as f64, &mut values);
                seen.take(real_dot(&signal, &values));
            }
            basis.evaluate(length, &mut values);
            let mut range = Range::new(case % 2 == 0);
            basis.extend(&mut range, (&signal, &values), length, &mut memory).unwrap();
            // at the nearest sample the signal is lower by its curvature
            let (digits, missed) = (1e-14, 10.0 * (length / SAMPLES as f64).powi(2));
            assert!(range.high >= seen.high - digits && range.high <= seen.high + missed, "{case}: {range:?} {seen:?}");
            assert!(range.low <= seen.low + digits && range.low >= seen.low - missed, "{case}: {range:?} {seen:?}");
        }
    }

    /// cos τ over many periods, beside a mode that is far too fast but rounding; and a mode that is too fast.
    #[test]
    fn fast_modes_are_followed_only_where_they_count() {
        let basis = Basis { exponents: vec![Complex64::new(0.0, 1.0), Complex64::new(0.0, 1e9)], ..Basis::default() };
        let zero = Complex64::new(0.0, 0.0);
        let mut memory = Extremes::default();
        let mut of = |amplitude: f64| {
            let signal = [Complex64::new(0.0, -1.0), Complex64::new(amplitude, 0.0), zero];
            let mut values = [zero; 3];
            basis.evaluate(100.0, &mut values);
            let mut range = Range::new(false);
            basis.extend(&mut range, (&signal, &values), 100.0, &mut memory).map(|()| range)
        };
        let range = of(1e-17).unwrap();
        assert!((range.high - 1.0).abs() < 1e-15 && (range.low + 1.0).abs() < 1e-15, "{range:?}");
        assert_eq!(of(1e-3), Err(TooFast));
    }
}
