//! Reduction of the bracket of one peak.
//!
//! Near a resonance, the inverse square of an amplitude is a parabola in frequency (exactly for
//! a linear oscillator with light damping). Parabolas through `1/a²` therefore find the peak in
//! a few orbits. If the peak is a kink (the onset of slip), the intersection of two straight
//! lines finds it.

use super::CurvePoint;

/// Settings of the reduction of a bracket.
#[derive(Debug, Clone)]
pub(super) struct ReductionSettings {
    /// Predicted relative rise below which a peak counts as found: a hundred times the rounding of
    /// a closed orbit. The frequency is then accurate to 1e-5 of the peak's width.
    pub(super) min_rise: f64,
    /// A rise below this multiple of the estimated error of an orbit is noise, at most
    /// `max_noise`. The transitions of a sampled series move in steps.
    pub(super) noise: f64,
    /// Largest relative rise that counts as noise.
    pub(super) max_noise: f64,
    /// Fraction of the predicted rise that must be reached, so that the next trial is a parabola
    /// again.
    pub(super) confirmed_fraction: f64,
    /// Number of consecutive failed predictions after which only bisection is used.
    pub(super) max_failed_predictions: usize,
    /// A parabolic step is not longer than this fraction of the step before the last one (R. P.
    /// Brent, Algorithms for minimization without derivatives, 1973). Otherwise parabolas would
    /// converge too slowly near a jump.
    pub(super) step_ratio: f64,
}

impl Default for ReductionSettings {
    fn default() -> Self {
        ReductionSettings {
            min_rise: 1e-10,
            noise: 1e-4,
            max_noise: 1e-7,
            confirmed_fraction: 0.5,
            max_failed_predictions: 15,
            step_ratio: 0.5,
        }
    }
}

/// State of the bracket reduction for one quantity. Parabolas are used while their predictions
/// are confirmed; otherwise intersecting lines and bisection.
#[derive(Debug, Default)]
pub(super) struct BracketReduction {
    /// Value that the last trial was predicted to reach.
    predicted: Option<f64>,
    /// Number of failed predictions since the last confirmed one.
    failed_predictions: usize,
    /// If the last trial was an intersection of two lines: its frequency and the predicted value
    /// of the interpolated function.
    kink: Option<(f64, f64)>,
    /// Distances of the last two trials from the highest point at their time.
    steps: [Option<f64>; 2],
    /// True if the peak is found.
    pub(super) found: bool,
    settings: ReductionSettings,
}

impl BracketReduction {
    /// Returns the frequency of the next orbit; `None` if the peak is found.
    pub(super) fn next(&mut self, points: &[CurvePoint], best: usize, quantity: usize, closest: f64) -> Option<f64> {
        let [left, middle, right] = [best - 1, best, best + 1].map(|i| points[i].omega);
        let value = points[best].value(quantity);
        let (rise, vertex) = parabola(points, best, quantity);
        let floor = closest.max(4.0 * f64::EPSILON * middle);
        let enough = (self.settings.noise * points[best].error).clamp(self.settings.min_rise, self.settings.max_noise);
        let at_kink = self.kink.is_some_and(|(omega, promised)| {
            omega == middle && (negative_inverse_square(value) - promised).abs() <= enough * promised.abs()
        });
        match self.predicted {
            Some(promised) if value < promised => self.failed_predictions += 1,
            _ => self.failed_predictions = 0,
        }
        // A prediction of no further rise counts only if the previous prediction was confirmed.
        self.found = (rise <= enough && self.failed_predictions == 0) || at_kink;
        if self.found || right - left <= 2.0 * floor {
            return None;
        }
        self.predicted = Some(value * (1.0 + self.settings.confirmed_fraction * rise));
        self.kink = None;
        let wider = if right - middle > middle - left { 0.5 * (middle + right) } else { 0.5 * (left + middle) };
        let inside = |omega: &f64| *omega > left + floor && *omega < right - floor;
        let creeps =
            |omega: &f64| self.steps[1].is_some_and(|step| (omega - middle).abs() > self.settings.step_ratio * step);
        // a curve that fits neither form has a jump
        let form = if self.failed_predictions < self.settings.max_failed_predictions {
            self.failed_predictions % 3
        } else {
            2
        };
        let trial = match form {
            0 => vertex.filter(inside).filter(|omega| !creeps(omega)),
            1 => {
                self.kink = line_intersection(points, best, quantity).filter(|(omega, _)| inside(omega));
                self.kink.map(|(omega, _)| omega)
            }
            _ => None,
        };
        let mut trial = trial.unwrap_or(wider);
        if (trial - middle).abs() < floor {
            // a minimal step towards the wider side closes the bracket there
            trial = middle + if right - middle > middle - left { floor } else { -floor };
        }
        self.steps = [Some((trial - middle).abs()), self.steps[0]];
        inside(&trial).then_some(trial)
    }
}

/// The interpolated function `-1/a²` of a positive quantity, which rises with the quantity.
/// Negative infinity if the quantity is not positive.
pub(super) fn negative_inverse_square(value: f64) -> f64 {
    if value > 0.0 { -1.0 / (value * value) } else { f64::NEG_INFINITY }
}

/// Returns the vertex of the parabola through a point and its neighbours: its rise above the
/// point, relative to the quantity, and its frequency. The rise is infinite without a parabola
/// (a failed neighbour, a straight line).
pub(super) fn parabola(points: &[CurvePoint], best: usize, quantity: usize) -> (f64, Option<f64>) {
    let [a, x, b] = [best - 1, best, best + 1].map(|i| points[i].omega);
    let [fa, fx, fb] = [best - 1, best, best + 1].map(|i| negative_inverse_square(points[i].value(quantity)));
    let (left, right) = ((fx - fa) / (x - a), (fx - fb) / (b - x));
    let curvature = (left + right) / (b - a);
    if !(curvature.is_finite() && curvature > 0.0) {
        return (f64::INFINITY, None);
    }
    // slope of the parabola at the middle point
    let slope = (left * (b - x) - right * (x - a)) / (b - a);
    let rise = slope * slope / (4.0 * curvature);
    // f = -a⁻²: a relative rise r of the quantity changes f by 2 r |f|
    (0.5 * rise / fx.abs(), Some(x + 0.5 * slope / curvature))
}

/// Returns the intersection of the two straight lines through the points left and right of the
/// best one, and the interpolated function there.
fn line_intersection(points: &[CurvePoint], best: usize, quantity: usize) -> Option<(f64, f64)> {
    let at = |i: usize| Some((points.get(i)?.omega, negative_inverse_square(points.get(i)?.value(quantity))));
    let (before, after) = (at(best.checked_sub(2)?)?, at(best + 2)?);
    let (left, here, right) = (at(best - 1)?, at(best)?, at(best + 1)?);
    let slope = |p: (f64, f64), q: (f64, f64)| (q.1 - p.1) / (q.0 - p.0);
    let meet = |p: (f64, f64), s: f64, q: (f64, f64), t: f64| {
        let omega = p.0 + (q.1 - p.1 - t * (q.0 - p.0)) / (s - t);
        (omega, p.1 + s * (omega - p.0))
    };
    // the best point belongs to one of the two lines
    let rising = meet(here, slope(left, here), right, slope(right, after));
    let falling = meet(left, slope(before, left), here, slope(here, right));
    // an intersection below the best point is invalid
    [rising, falling].into_iter().find(|(omega, form)| *omega > left.0 && *omega < right.0 && *form >= here.1)
}

#[cfg(test)]
mod tests {
    use super::super::bracket::{PeakSettings, highest_inner};
    use super::*;

    /// Refines the middle one of three points of a given curve. Returns frequency, value and
    /// number of evaluations.
    fn check(curve: &dyn Fn(f64) -> f64, [a, x, b]: [f64; 3]) -> (f64, f64, usize) {
        let point = |omega: f64| CurvePoint { omega, values: vec![curve(omega)], seed: None, error: 0.0 };
        let mut points = vec![point(a), point(x), point(b)];
        let (mut shrink, settings) = (BracketReduction::default(), PeakSettings::default());
        let mut count = 0;
        while count < settings.max_orbits {
            let top = highest_inner(&points, 0);
            let Some(omega) = shrink.next(&points, top, 0, settings.min_distance * (b - a)) else { break };
            let at = points.partition_point(|point| point.omega < omega);
            points.insert(at, point(omega));
            count += 1;
        }
        let top = &points[highest_inner(&points, 0)];
        (top.omega, top.value(0), count)
    }

    #[test]
    fn the_peak_of_a_linear_oscillator_takes_a_handful_of_orbits() {
        // |1/(1 - w² + 2 j ζ w)| has the maximum 1/(2 ζ √(1 - ζ²)) at w² = 1 - 2 ζ²
        let zeta: f64 = 1e-3;
        let curve = |w: f64| 1.0 / (1.0 - w * w).hypot(2.0 * zeta * w);
        let (omega, value, count) = check(&curve, [0.99, 0.9991, 1.01]);
        assert!((value * 2.0 * zeta * (1.0 - zeta * zeta).sqrt() - 1.0).abs() < 1e-10, "{value}");
        assert!((omega - (1.0 - 2.0 * zeta * zeta).sqrt()).abs() < 1e-5 * zeta, "{omega}");
        assert!(count <= 8, "{count}");
    }

    #[test]
    fn a_kink_is_found_as_well() {
        let curve =
            |w: f64| if w < 1.05 { 1.0 + 3.0 * (w - 1.05) } else { 1.0 - 0.2 * (w - 1.05) + (w - 1.05).powi(2) };
        let (omega, value, count) = check(&curve, [0.9, 1.1, 1.2]);
        assert!((value - 1.0).abs() < 1e-7 && (omega - 1.05).abs() < 1e-7, "{omega} {value} {count}");
        assert!(count <= 24, "{count}");
    }

    #[test]
    fn a_peak_just_before_a_jump_is_found() {
        // The curve is level just before the fold, then it falls to another orbit.
        let top = |w: f64| 1.0 / (1.0 + (100.0 * (w - 1.0)).powi(2) + (60.0 * (w - 1.0)).powi(3)).sqrt();
        for fold in [1.0003, 1.001, 1.003] {
            let curve = |w: f64| if w < fold { top(w) } else { 0.3 * fold / w };
            let (omega, value, count) = check(&curve, [0.98, 0.992, 1.012]);
            assert!((value - 1.0).abs() < 1e-8 && (omega - 1.0).abs() < 1e-5, "{omega} {value} {count}");
            assert!(count <= 24, "{count}");
        }
    }

    #[test]
    fn a_jump_ends_within_the_bound() {
        let (omega, _, count) = check(&|w| if w < 1.05 { 1.0 + w } else { 0.1 }, [0.9, 1.0, 1.2]);
        // Parabolas approach the jump slowly from below, and every third step is a bisection.
        // The search ends close to the edge.
        assert!((omega - 1.05).abs() < 2e-5 * 0.3, "{omega} {count}");
        assert!(count <= PeakSettings::default().max_orbits, "{count}");
    }
}
