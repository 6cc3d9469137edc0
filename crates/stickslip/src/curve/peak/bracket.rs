//! The search for peaks between three points of a curve, with orbits that all quantities share.

use super::bracket_reduction::{BracketReduction, negative_inverse_square, parabola};
use super::{CurvePoint, Peak, QuantityPeak, UnresolvedPeak};
use crate::method::{Budget, Request, Solver};
use crate::orbit::Orbit;
use std::collections::BTreeMap;

/// Settings of the search for a peak.
#[derive(Debug, Clone)]
pub(super) struct PeakSettings {
    /// Maximum number of repetitions if the search for another quantity finds a higher point.
    pub(super) max_repetitions: usize,
    /// Maximum number of failed orbits in the search for one peak, because a failed search costs
    /// most.
    pub(super) max_failures: usize,
    /// Distance from the neighbour, relative to the initial bracket, beyond which a failed search
    /// is repeated with all fallbacks.
    pub(super) fallback_distance: f64,
    /// A missing orbit does not matter to a peak if the predicted relative rise towards it is
    /// below this value.
    pub(super) negligible_rise: f64,
    /// Relative fall of a quantity next to its highest point that shows an unfinished search. At
    /// the final bracket width (`min_distance`) the fall is 1e-7 at a kink, 1e-3 at a fold, and
    /// one half at an unbounded peak.
    pub(super) steep_fall: f64,
    /// A curve is unbounded, see [`Bracket::is_cut_off`], if `1/a²` falls in a straight line and
    /// would reach zero within this multiple of the initial bracket.
    pub(super) unbounded_within: f64,
    /// Distance of the distant point of that line, relative to the distance of the nearest point.
    pub(super) distance_ratio: f64,
    /// The line is straight if its slope to the nearest point is less than this multiple of its
    /// slope to the distant point.
    pub(super) max_slope_ratio: f64,
    /// Largest distance between the neighbours of the highest point, relative to the initial
    /// bracket, if a search has ended at a jump. A larger distance means an unfinished search. The
    /// value is `min_distance` on both sides, doubled by the last step.
    pub(super) closed_width: f64,
    /// Orbits closer than this fraction of the initial bracket differ by rounding only.
    pub(super) min_distance: f64,
    /// Maximum number of orbits for the peak of one quantity, in addition to the orbits of other
    /// quantities. Smooth peaks take 3 to 6, kinks up to 15.
    pub(super) max_orbits: usize,
}

impl Default for PeakSettings {
    fn default() -> Self {
        PeakSettings {
            max_repetitions: 3,
            max_failures: 2,
            fallback_distance: 1e-3,
            negligible_rise: 1e-5,
            steep_fall: 1e-2,
            unbounded_within: 0.5,
            distance_ratio: 4.0,
            max_slope_ratio: 1.5,
            closed_width: 4e-7,
            min_distance: 1e-7,
            max_orbits: 40,
        }
    }
}

/// Three points of a curve, with a maximum of some quantities in the middle, and the orbits that
/// the searches added between them.
pub(super) struct Bracket {
    pub(super) points: Vec<CurvePoint>,
    /// Initial distance of the ends, rad/s.
    width: f64,
    /// For each quantity, the frequency at which its last search ended (rad/s), and whether it
    /// found the peak.
    pub(super) ended: BTreeMap<usize, (f64, bool)>,
    settings: PeakSettings,
}

impl Bracket {
    pub(super) fn new(near: &[CurvePoint]) -> Self {
        let settings = PeakSettings::default();
        Bracket { points: near.to_vec(), width: near[2].omega - near[0].omega, ended: BTreeMap::new(), settings }
    }

    /// Returns the vertex value of the parabola at the highest point of a quantity.
    pub(super) fn vertex_value(&self, quantity: usize) -> f64 {
        let top = highest_inner(&self.points, quantity);
        vertex_value(&self.points[top - 1..=top + 1], quantity)
    }

    /// Computes orbits until the peak of a quantity is found, within the budget of one point.
    pub(super) fn refine(&mut self, solver: &mut dyn Solver, quantity: usize, quantities: &dyn Fn(&Orbit) -> Vec<f64>) {
        let points = &mut self.points;
        let mut shrink = BracketReduction::default();
        let (mut failures, mut budget) = (0, Budget::default());
        for _ in 0..self.settings.max_orbits {
            let best = highest_inner(points, quantity);
            let Some(omega) = shrink.next(points, best, quantity, self.settings.min_distance * self.width) else {
                break;
            };
            if failures == self.settings.max_failures || budget.is_used_up() {
                break;
            }
            // The highest point is a sufficient initial guess on either side.
            let error = points[best].error;
            let request = Request::at(omega).near(points[best].seed.as_ref());
            let found = match solver.solve(&request.without_estimate(), &mut budget) {
                // Far from the neighbour, all fallbacks are tried; close to it they gain
                // nothing.
                Err(_) if (omega - points[best].omega).abs() > self.settings.fallback_distance * self.width => {
                    solver.solve(&request, &mut budget)
                }
                found => found,
            };
            let point = match found {
                Ok(orbit) => CurvePoint { omega, error, ..CurvePoint::new(&orbit, quantities) },
                Err(_) => {
                    failures += 1;
                    CurvePoint::failed(omega)
                }
            };
            let at = points.partition_point(|point| point.omega < omega);
            points.insert(at, point);
        }
        let top = highest_inner(points, quantity);
        self.ended.insert(quantity, (points[top].omega, shrink.found));
    }

    /// Repeats the search for quantities if another search has found a higher point since. There
    /// may be several maxima between two points of a curve.
    pub(super) fn repeat_overtaken(&mut self, solver: &mut dyn Solver, quantities: &dyn Fn(&Orbit) -> Vec<f64>) {
        for _ in 0..self.settings.max_repetitions {
            let moved = |(quantity, (omega, _)): (&usize, &(f64, bool))| {
                (self.points[highest_inner(&self.points, *quantity)].omega != *omega).then_some(*quantity)
            };
            let overtaken: Vec<usize> = self.ended.iter().filter_map(moved).collect();
            if overtaken.is_empty() {
                break;
            }
            overtaken.into_iter().for_each(|quantity| self.refine(solver, quantity, quantities));
        }
    }

    /// Tells whether the highest point of a quantity is a peak that its search has found.
    fn found(&self, quantity: usize) -> bool {
        let omega = self.points[highest_inner(&self.points, quantity)].omega;
        self.ended.get(&quantity) == Some(&(omega, true))
    }

    /// Tells whether the peak is cut off by a jump. There are two cases. In the first case, the
    /// curve jumps down on one side of the highest point. From the other side it rises in a
    /// straight line, as to an unbounded peak. In the second case, the highest point is next to
    /// an end of the bracket, where the sweep found another orbit although this one continues.
    /// The curve rises to a fold with the square root of the distance, and flattens towards a
    /// maximum.
    fn is_cut_off(&self, top: usize, quantity: usize) -> bool {
        let here = &self.points[top];
        let value = here.value(quantity);
        let jumps = |point: &CurvePoint| value - point.value(quantity) > self.settings.steep_fall * value;
        let straight = |side: &mut dyn Iterator<Item = &CurvePoint>| {
            let slopes = side.map(|point| {
                let run = (here.omega - point.omega).abs();
                (run, (negative_inverse_square(value) - negative_inverse_square(point.value(quantity))) / run)
            });
            let slopes: Vec<(f64, f64)> = slopes.collect();
            let Some(&(nearest, slope)) = slopes.first() else { return false };
            let distant = slopes.iter().find(|(run, _)| *run >= self.settings.distance_ratio * nearest);
            slope * self.settings.unbounded_within * self.width > -negative_inverse_square(value)
                && distant.is_some_and(|(_, other)| slope < self.settings.max_slope_ratio * other)
        };
        let at_end =
            |end: &CurvePoint| (here.omega - end.omega).abs() <= self.settings.closed_width * self.width && jumps(end);
        let (left, right) = self.points.split_at(top);
        (jumps(&right[1]) && straight(&mut left.iter().rev()))
            || (jumps(&left[top - 1]) && straight(&mut right[1..].iter()))
            || [self.points.first(), self.points.last()].into_iter().flatten().any(at_end)
    }

    /// Tells whether the search ended although the neighbours of the highest point predict a
    /// higher value.
    fn is_unfinished(&self, top: usize, quantity: usize) -> bool {
        let near = &self.points[top - 1..=top + 1];
        near[2].omega - near[0].omega > self.settings.closed_width * self.width
            && parabola(near, 1, quantity).0 > self.settings.negligible_rise
    }

    /// Tells whether an orbit next to the highest of three points is missing, and the line from
    /// the other side rises towards it.
    fn lacks_neighbours(&self, near: &[CurvePoint], quantity: usize) -> bool {
        let rises = |other: usize, failed: usize| {
            let run = (near[failed].omega - near[1].omega) / (near[1].omega - near[other].omega);
            let here = negative_inverse_square(near[1].value(quantity));
            let rise = (here - negative_inverse_square(near[other].value(quantity))) * run / (2.0 * here.abs());
            // without an orbit on the other side, the rise is unknown
            near[failed].values.is_empty() && (near[other].values.is_empty() || rise > self.settings.negligible_rise)
        };
        rises(0, 2) || rises(2, 0)
    }

    /// Tells whether a quantity falls steeply on both sides of the middle one of three points.
    /// Such a fall is larger than that of a kink or a fold in a closed bracket. Near a fold the
    /// fall is steep on one side only.
    fn is_too_narrow(&self, near: &[CurvePoint], quantity: usize) -> bool {
        let value = near[1].value(quantity);
        let falls = |point: &CurvePoint| value - point.value(quantity) > self.settings.steep_fall * value;
        falls(&near[0]) && falls(&near[2])
    }

    /// Returns the peak of a quantity in its present state.
    pub(super) fn peak(&self, quantity: usize) -> QuantityPeak {
        let top = highest_inner(&self.points, quantity);
        let point = &self.points[top];
        let near = &self.points[top - 1..=top + 1];
        let unresolved = if self.lacks_neighbours(near, quantity) {
            Some(UnresolvedPeak::MissingNeighbours)
        } else if self.found(quantity) {
            None
        } else if self.is_too_narrow(near, quantity) {
            Some(UnresolvedPeak::TooNarrow)
        } else if self.is_cut_off(top, quantity) {
            Some(UnresolvedPeak::CutOff)
        } else {
            self.is_unfinished(top, quantity).then_some(UnresolvedPeak::OrbitLimit)
        };
        let peak = Peak { omega: point.omega, value: point.value(quantity), at_end: false, unresolved };
        QuantityPeak { quantity, peak, values: point.values.clone() }
    }
}

/// Returns the peaks of the `wanted` quantities, each of which has its maximum at the middle one
/// of three points.
pub(super) fn refine(
    solver: &mut dyn Solver,
    near: &[CurvePoint],
    wanted: &[usize],
    quantities: &dyn Fn(&Orbit) -> Vec<f64>,
) -> Vec<QuantityPeak> {
    let mut bracket = Bracket::new(near);
    wanted.iter().for_each(|&quantity| bracket.refine(solver, quantity, quantities));
    bracket.repeat_overtaken(solver, quantities);
    wanted.iter().map(|&quantity| bracket.peak(quantity)).collect()
}

/// Returns the vertex value of the parabola through three points with the highest in the middle.
/// It is an upper bound if the points are further apart than the width of the peak. It is
/// infinite if they do not determine the height.
pub(super) fn vertex_value(near: &[CurvePoint], quantity: usize) -> f64 {
    let value = near[1].value(quantity);
    let (rise, _) = parabola(near, 1, quantity);
    // For small rises, the relative change of 1/a² is twice that of a; the square root is exact
    // for all rises.
    let left = 1.0 - 2.0 * rise;
    if left > 0.0 { value / left.sqrt() } else { f64::INFINITY }
}

/// Returns the index of the highest inner point; the first and the last point are not higher.
pub(super) fn highest_inner(points: &[CurvePoint], quantity: usize) -> usize {
    (1..points.len() - 1)
        .max_by(|&a, &b| points[a].value(quantity).total_cmp(&points[b].value(quantity)))
        .unwrap_or(points.len() / 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::OrbitError;

    /// Finds no orbit.
    struct Nothing;

    impl Solver for Nothing {
        fn solve(&mut self, request: &Request<'_>, _budget: &mut Budget) -> Result<Orbit, OrbitError> {
            Err(OrbitError::Frequency { omega: request.omega })
        }
    }

    #[test]
    fn orbits_that_fail_leave_the_point_of_the_grid() {
        let curve = |w: f64| 2.0 - (w - 1.0).powi(2);
        let near =
            [0.9, 1.01, 1.1].map(|omega| CurvePoint { omega, values: vec![curve(omega)], seed: None, error: 0.0 });
        let peak = refine(&mut Nothing, &near, &[0], &|_| Vec::new())[0].peak;
        assert_eq!(
            (peak.omega, peak.value, peak.unresolved),
            (1.01, curve(1.01), Some(UnresolvedPeak::MissingNeighbours))
        );
    }
}
