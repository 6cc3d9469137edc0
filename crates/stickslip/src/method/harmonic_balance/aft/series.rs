//! A motion along an axis at any phase: value, slope and curvature of its
//! series, its zeros, and its range.

use super::events::BracketingGrid;
use super::frequency_time::FrequencyTime;
use num_complex::Complex64;
use std::f64::consts::TAU;

/// A Fourier series with equally spaced harmonics.
#[derive(Clone, Copy)]
pub(super) struct HarmonicSeries<'a> {
    pub(super) harmonics: &'a [usize],
    pub(super) c: &'a [Complex64],
}

impl HarmonicSeries<'_> {
    /// Returns value, slope and curvature at a phase.
    pub(super) fn at(&self, theta: f64) -> (f64, f64, f64) {
        let (mut turn, step) = rotations(self.harmonics, theta);
        let (mut value, mut slope, mut bend) = (0.0, 0.0, 0.0);
        for (&h, c) in self.harmonics.iter().zip(self.c) {
            let h = h as f64;
            let z = c * turn;
            value += z.re;
            slope -= h * z.im;
            bend -= h * h * z.re;
            turn *= step;
        }
        (value, slope, bend)
    }

    /// Finds the zero of a function between two phases at which its signs differ. `sign` is its
    /// sign at the upper end. `f` returns its value and its slope.
    pub(super) fn zero(
        &self,
        (mut low, mut high): (f64, f64),
        start: f64,
        sign: f64,
        tolerance: f64,
        f: impl Fn(&Self, f64) -> (f64, f64),
    ) -> f64 {
        let mut at = start.clamp(low, high);
        // Maximum number of Newton iterations for an event; three are usual. A step out of the
        // bracket is replaced by bisection.
        for _ in 0..60 {
            let (value, slope) = f(self, at);
            if value * sign > 0.0 {
                high = at
            } else {
                low = at
            }
            let mut next = at - value / slope;
            if !(next >= low && next <= high) {
                next = 0.5 * (low + high);
            }
            let moved = (next - at).abs();
            at = next;
            if moved <= tolerance {
                break;
            }
        }
        at
    }

    /// Returns the value at the turning point next to a phase. `None` if the
    /// iteration moves more than `reach`.
    fn turning(&self, mut theta: f64, reach: f64) -> Option<f64> {
        let (mut best, mut moved) = (0.0, 0.0f64);
        // Maximum number of Newton iterations from a grid point to a turning point; three are
        // usual.
        for _ in 0..8 {
            let (value, slope, bend) = self.at(theta);
            let step = slope / bend;
            moved += step.abs();
            if moved.is_nan() || moved > reach {
                return None;
            }
            theta -= step;
            // the vertex of the local parabola; its error is of third order in the step
            best = value - 0.5 * slope * step;
            if step * step < f64::EPSILON {
                break;
            }
        }
        Some(best)
    }
}

impl FrequencyTime {
    /// Returns the least and the largest value of the motion with harmonics `c`. Between two
    /// grid points the motion exceeds both by no more than its curvature allows. Newton's
    /// method refines the grid points that are this close to the extreme ones.
    pub fn range(&mut self, c: &[Complex64]) -> (f64, f64) {
        let BracketingGrid { fourier, pairs, value, .. } = &mut self.grid;
        pairs.clear();
        pairs.extend(self.harmonics.iter().copied().zip(c.iter().copied()));
        fourier.synthesize(pairs, value);
        let series = HarmonicSeries { harmonics: &self.harmonics, c };
        let angle = TAU / value.len() as f64;
        let bend: f64 = self.harmonics.iter().zip(c).map(|(&h, c)| (h * h) as f64 * c.l1_norm()).sum();
        let above = 0.125 * bend * angle * angle;
        let (mut low, mut high) = (value[0], value[0]);
        for &u in &value[1..] {
            low = if u < low { u } else { low };
            high = if u > high { u } else { high };
        }
        let (mut least, mut most) = (low, high);
        for (i, &u) in value.iter().enumerate() {
            if u > low + above && u < high - above {
                continue;
            }
            if let Some(value) = series.turning(i as f64 * angle, angle) {
                (least, most) = (least.min(value), most.max(value));
            }
        }
        (least, most)
    }
}

/// Returns `e^{jhθ}` of the first harmonic, and the factor from each harmonic to the next.
#[inline]
pub(super) fn rotations(harmonics: &[usize], theta: f64) -> (Complex64, Complex64) {
    let first = harmonics[0];
    let gap = harmonics.get(1).map_or(0, |h| h - first);
    let step = Complex64::cis(gap as f64 * theta);
    // 0, 1, … and 1, 3, … need only one rotation
    match (first, gap) {
        (0, _) => (Complex64::new(1.0, 0.0), step),
        (1, 2) => {
            let turn = Complex64::cis(theta);
            (turn, turn * turn)
        }
        _ => (Complex64::cis(first as f64 * theta), step),
    }
}
