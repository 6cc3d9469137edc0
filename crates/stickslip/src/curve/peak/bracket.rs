//! The orbits between three points of a curve, and the peaks that they settle.

use super::shrink::{Shrink, form, parabola};
use super::{Peak, PeakOf, Point, Unsettled};
use crate::method::Solver;
use crate::orbit::Orbit;
use std::collections::BTreeMap;

/// How often a peak is sought again because the search for another one has met something higher.
const OVERTAKEN: usize = 3;
/// Orbits that may fail while the peak of one quantity is refined: what fails costs most.
const FAILURES: usize = 2;
/// Share of the first bracket beyond which an orbit that its neighbour does not lead to is sought in every way.
const AWAY: f64 = 1e-3;
/// Relative rise to an orbit that was not found, below which that no longer matters to a peak.
const SETTLED: f64 = 1e-5;
/// Fall of a quantity beside its highest point, as a share, from which a search that has ended there has not found how high the peak is. [`CLOSEST`]
/// leaves 1e-7 of it beside a kink, 1e-3 beside a fold, and half of it where nothing bounds the peak.
const STEEP: f64 = 1e-2;
/// Share of the first bracket over which a straight `1/a²` that comes to nothing says that nothing in sight bounds the curve. Its slope to a point so many
/// times as far away as the nearest tells straight from bent: less than the first one over this.
const REACH: f64 = 0.5;
const FARTHER: f64 = 4.0;
const BENT: f64 = 1.5;
/// Share of the first bracket that neighbours of the highest point have left between them where a search has come to its end at a jump: more means that it
/// was not ended. [`CLOSEST`] on both sides, doubled by the last step.
const OPEN: f64 = 4.0 * CLOSEST;
/// Two orbits closer than this share of the first bracket tell nothing but rounding.
pub(super) const CLOSEST: f64 = 1e-7;
/// Orbits that the peak of one quantity may take beside those that others have asked for; smooth peaks take 3 to 6, kinks up to 15.
pub(super) const ORBITS: usize = 40;
/// The work of these searches together, as a share of what one point of a curve may take, at which a search ends where each of them takes long.
const EFFORT: f64 = 1.0;

/// Three points of a curve, of which the middle one is a maximum of some quantities, and the orbits between them that were asked for since.
pub(super) struct Bracket {
    pub(super) points: Vec<Point>,
    /// Distance of the ends, rad/s.
    width: f64,
    /// Where the last search for the peak of a quantity ended (rad/s), and whether it had found it.
    pub(super) ended: BTreeMap<usize, (f64, bool)>,
}

impl Bracket {
    pub(super) fn new(near: &[Point]) -> Self {
        Bracket { points: near.to_vec(), width: near[2].omega - near[0].omega, ended: BTreeMap::new() }
    }

    /// What the parabola about the highest point of a quantity reaches.
    pub(super) fn reach(&self, quantity: usize) -> f64 {
        let top = best(&self.points, quantity);
        reach(&self.points[top - 1..=top + 1], quantity)
    }

    /// Asks for orbits until the peak of a quantity is found.
    pub(super) fn refine(&mut self, solver: &mut dyn Solver, quantity: usize, quantities: &dyn Fn(&Orbit) -> Vec<f64>) {
        let points = &mut self.points;
        let mut shrink = Shrink::default();
        let (mut failures, mut effort) = (0, 0.0);
        for _ in 0..ORBITS {
            let best = best(points, quantity);
            let Some(omega) = shrink.next(points, best, quantity, CLOSEST * self.width) else { break };
            if failures == FAILURES || effort > EFFORT {
                break;
            }
            // the orbit's neighbour on the side of the new point is as good a start as any
            let start = points[best].start.as_deref();
            let error = points[best].error;
            start.into_iter().for_each(|start| solver.begin_at(points[best].omega, start));
            let found = match solver.between(omega, start) {
                // far from the neighbour it takes more than its help; close to it there is nothing to be gained
                Err(_) if (omega - points[best].omega).abs() > AWAY * self.width => solver.orbit(omega, start),
                found => found,
            };
            effort += solver.effort();
            let point = match found {
                Ok(orbit) => Point { omega, error, ..Point::new(&orbit, quantities) },
                Err(_) => {
                    failures += 1;
                    Point::failed(omega)
                }
            };
            let at = points.partition_point(|point| point.omega < omega);
            points.insert(at, point);
        }
        let top = best(points, quantity);
        self.ended.insert(quantity, (points[top].omega, shrink.found));
    }

    /// Seeks the peaks of quantities again above which others have met a higher point since: between two points of a curve there may be several tops.
    pub(super) fn refine_overtaken(&mut self, solver: &mut dyn Solver, quantities: &dyn Fn(&Orbit) -> Vec<f64>) {
        for _ in 0..OVERTAKEN {
            let moved = |(quantity, (omega, _)): (&usize, &(f64, bool))| {
                (self.points[best(&self.points, *quantity)].omega != *omega).then_some(*quantity)
            };
            let overtaken: Vec<usize> = self.ended.iter().filter_map(moved).collect();
            if overtaken.is_empty() {
                break;
            }
            overtaken.into_iter().for_each(|quantity| self.refine(solver, quantity, quantities));
        }
    }

    /// Whether the highest point of a quantity is a peak that its search has found.
    fn found(&self, quantity: usize) -> bool {
        let omega = self.points[best(&self.points, quantity)].omega;
        self.ended.get(&quantity) == Some(&(omega, true))
    }

    /// Whether the curve jumps down on one side of the highest point and rises to it from the other as straight as to something without a bound, or has come
    /// to an end of the bracket, which is where a sweep found another orbit and not where this one ends. To a fold it rises with the root of the distance,
    /// to a top in front of one ever less.
    fn is_cut_off(&self, top: usize, quantity: usize) -> bool {
        let here = &self.points[top];
        let value = here.value(quantity);
        let jumps = |point: &Point| value - point.value(quantity) > STEEP * value;
        let straight = |side: &mut dyn Iterator<Item = &Point>| {
            let slopes = side.map(|point| {
                let run = (here.omega - point.omega).abs();
                (run, (form(value) - form(point.value(quantity))) / run)
            });
            let slopes: Vec<(f64, f64)> = slopes.collect();
            let Some(&(nearest, slope)) = slopes.first() else { return false };
            let farther = slopes.iter().find(|(run, _)| *run >= FARTHER * nearest);
            slope * REACH * self.width > -form(value) && farther.is_some_and(|(_, other)| slope < BENT * other)
        };
        let at_end = |end: &Point| (here.omega - end.omega).abs() <= OPEN * self.width && jumps(end);
        let (left, right) = self.points.split_at(top);
        (jumps(&right[1]) && straight(&mut left.iter().rev()))
            || (jumps(&left[top - 1]) && straight(&mut right[1..].iter()))
            || [self.points.first(), self.points.last()].into_iter().flatten().any(at_end)
    }

    /// Whether the search has ended while there was more to be had between the neighbours of the highest point.
    fn is_open(&self, top: usize, quantity: usize) -> bool {
        let near = &self.points[top - 1..=top + 1];
        near[2].omega - near[0].omega > OPEN * self.width && parabola(near, 1, quantity).0 > SETTLED
    }

    /// The peak of a quantity, as far as it is refined.
    pub(super) fn peak(&self, quantity: usize) -> PeakOf {
        let top = best(&self.points, quantity);
        let point = &self.points[top];
        let near = &self.points[top - 1..=top + 1];
        let unsettled = if lacks_neighbours(near, quantity) {
            Some(Unsettled::Neighbours)
        } else if self.found(quantity) {
            None
        } else if is_needle(near, quantity) {
            Some(Unsettled::Needle)
        } else if self.is_cut_off(top, quantity) {
            Some(Unsettled::CutOff)
        } else {
            self.is_open(top, quantity).then_some(Unsettled::Open)
        };
        let peak = Peak { omega: point.omega, value: point.value(quantity), at_end: false, unsettled };
        PeakOf { quantity, peak, values: point.values.clone() }
    }
}

/// The peaks of the `wanted` quantities, each of which is largest at the middle one of three points.
pub(super) fn refine(
    solver: &mut dyn Solver,
    near: &[Point],
    wanted: &[usize],
    quantities: &dyn Fn(&Orbit) -> Vec<f64>,
) -> Vec<PeakOf> {
    let mut bracket = Bracket::new(near);
    wanted.iter().for_each(|&quantity| bracket.refine(solver, quantity, quantities));
    bracket.refine_overtaken(solver, quantities);
    wanted.iter().map(|&quantity| bracket.peak(quantity)).collect()
}

/// The value at the vertex of the parabola through three points of which the middle one is the highest: a bound where the points are further apart than
/// the peak is wide, and infinite where they say nothing of its height.
pub(super) fn reach(near: &[Point], quantity: usize) -> f64 {
    let value = near[1].value(quantity);
    let (rise, _) = parabola(near, 1, quantity);
    // of 1/a² the relative rise is twice that of a, for small ones: the square says it for all
    let left = 1.0 - 2.0 * rise;
    if left > 0.0 { value / left.sqrt() } else { f64::INFINITY }
}

/// Whether an orbit beside the highest of three points was not found, and the line from the other side through that point rises to there.
fn lacks_neighbours(near: &[Point], quantity: usize) -> bool {
    let rises = |other: usize, failed: usize| {
        let run = (near[failed].omega - near[1].omega) / (near[1].omega - near[other].omega);
        let here = form(near[1].value(quantity));
        let rise = (here - form(near[other].value(quantity))) * run / (2.0 * here.abs());
        // without an orbit on the other side nothing is known
        near[failed].values.is_empty() && (near[other].values.is_empty() || rise > SETTLED)
    };
    rises(0, 2) || rises(2, 0)
}

/// Whether a quantity falls on both sides of the middle one of three points by more than it does beside a kink or a fold by the time that the bracket is
/// closed: near a fold with the root of the distance, on one side.
fn is_needle(near: &[Point], quantity: usize) -> bool {
    let value = near[1].value(quantity);
    let falls = |point: &Point| value - point.value(quantity) > STEEP * value;
    falls(&near[0]) && falls(&near[2])
}

/// The highest inner point; the first and the last one are not above it.
pub(super) fn best(points: &[Point], quantity: usize) -> usize {
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
        fn orbit(&mut self, omega: f64, _: Option<&[f64]>) -> Result<Orbit, OrbitError> {
            Err(OrbitError::Frequency { omega })
        }
    }

    #[test]
    fn orbits_that_fail_leave_the_point_of_the_grid() {
        let curve = |w: f64| 2.0 - (w - 1.0).powi(2);
        let near = [0.9, 1.01, 1.1].map(|omega| Point { omega, values: vec![curve(omega)], start: None, error: 0.0 });
        let peak = refine(&mut Nothing, &near, &[0], &|_| Vec::new())[0].peak;
        assert_eq!((peak.omega, peak.value, peak.unsettled), (1.01, curve(1.01), Some(Unsettled::Neighbours)));
    }
}
