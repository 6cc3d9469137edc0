//! Peaks of response curves, refined between the points of the curve.
//!
//! Near a resonance the inverse square of an amplitude is a parabola in the frequency (exactly so for a linear oscillator of light
//! damping), so that parabolas through `1/a²` find the peak in a few orbits. Where the highest point is a kink, the onset of slip, two
//! straight lines do. All quantities of an orbit share the orbits: what one mass asks for narrows the brackets of all others.

use crate::method::{Method, MethodError, Solver};
use crate::model::System;
use crate::orbit::Orbit;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A refined peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Frequency, rad/s.
    pub omega: f64,
    /// The quantity that was maximised.
    pub value: f64,
    /// True if the largest value stands at an end of the range: the real peak may lie beyond.
    pub at_end: bool,
    /// Why the real peak may be higher; `None` where the search found it.
    pub unsettled: Option<Unsettled>,
}

/// Why a search for a peak left open how high it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unsettled {
    /// Orbits beside the highest one were not found.
    Neighbours,
    /// The curve still rises steeply from both sides where the search ends.
    Needle,
}

impl std::fmt::Display for Unsettled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Unsettled::Neighbours => {
                "orbits beside this peak were not found, and the real one may be higher: much higher with little or no damping, or where friction \
                 cannot bound the motion; look closer with a finer range or another method"
            }
            Unsettled::Needle => {
                "this peak is narrower than its search resolves, and the real one is higher, or has no bound: without damping friction bounds a \
                 resonance only up to a force; add the damping that the structure has, or take a narrower range"
            }
        })
    }
}

/// A point of a curve on which peaks are sought.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Frequency, rad/s.
    pub omega: f64,
    /// The quantities; empty if there is no orbit.
    pub values: Vec<f64>,
    /// State of the orbit, a start for its neighbours.
    pub start: Option<Vec<f64>>,
    /// Estimated relative error of the quantities; zero of exact orbits.
    pub error: f64,
}

impl Point {
    /// What a curve keeps of an orbit.
    pub fn new(orbit: &Orbit, quantities: &dyn Fn(&Orbit) -> Vec<f64>) -> Self {
        let error = orbit.evidence.truncation.unwrap_or(0.0);
        Point { omega: orbit.omega, values: quantities(orbit), start: Some(orbit.start.clone()), error }
    }

    /// A frequency at which no orbit was found.
    pub fn failed(omega: f64) -> Self {
        Point { omega, values: Vec::new(), start: None, error: 0.0 }
    }

    /// A quantity; below all others if there is no orbit.
    fn value(&self, quantity: usize) -> f64 {
        self.values.get(quantity).copied().filter(|value| value.is_finite()).unwrap_or(f64::NEG_INFINITY)
    }
}

/// Relative rise of a quantity, as the parabola predicts it, below which its peak counts as found: a hundred times the rounding of a
/// closed orbit. The frequency is then known to 1e-5 of the width of the peak.
const RISE: f64 = 1e-10;
/// Share of the estimated error of an orbit below which a rise is its noise, and the largest rise that counts as such: the switches of a
/// sampled series move in steps.
const NOISE: f64 = 1e-4;
const MOST_NOISE: f64 = 1e-7;
/// How often a peak is sought again because the search for another one has met something higher.
const OVERTAKEN: usize = 3;
/// Orbits that may fail while the peak of one quantity is refined: what fails costs most.
const FAILURES: usize = 2;
/// Share of the first bracket beyond which an orbit that its neighbour does not lead to is sought in every way.
const AWAY: f64 = 1e-3;
/// Relative rise to an orbit that was not found, below which that no longer matters to a peak.
const SETTLED: f64 = 1e-5;
/// A point that stands out from its neighbours by less than this share is the rounding of a level curve, not a peak.
const LEVEL: f64 = 1e-10;
/// Two orbits closer than this share of the first bracket tell nothing but rounding.
const CLOSEST: f64 = 1e-7;
/// Share of the rise that a parabola predicts which must come true for the next trial to be a parabola again.
const KEPT: f64 = 0.5;
/// Peaks about one point that share a solver with its memory: few enough for two hundred peaks about a handful of points to keep all threads at work,
/// and the same on any number of these.
const TOGETHER: usize = 12;
/// Broken promises after which only halving is left.
const JUMP: usize = 15;
/// Orbits that the peak of one quantity may take beside those that others have asked for; smooth peaks take 3 to 6, kinks up to 15.
const ORBITS: usize = 40;
/// Maxima of the given points whose parabola reaches less than this share of the highest cannot hide the highest peak between them, unless these are
/// far too few; and the same once other quantities have asked for orbits between them.
const CANDIDATE: f64 = 0.8;
const LIKELY: f64 = 0.95;

/// The highest peak of the first `wanted` quantities over a curve whose points are `points` (rising), refined between its neighbours with orbits of
/// `solver`. Each quantity's tops are sought by themselves: the highest of several quantities is the highest of their own peaks, while the largest of
/// them at every frequency would hide the top of one behind the flank of another.
///
/// Returns `None` if no point converged.
///
/// # Example
/// ```
/// use stickslip::curve::peak::{Point, highest};
/// use stickslip::method::{Method, event_driven::EventDriven};
/// use stickslip::orbit::Orbit;
/// let mut couple = stickslip::model::example::blade_couple();
/// couple.joints[0].law = std::sync::Arc::new(stickslip::law::Coulomb { limit: 4.0 });
/// let system = couple.assemble().unwrap();
/// let mut solver = EventDriven.solver(&system).unwrap();
/// let amplitude = |orbit: &Orbit| vec![orbit.places[0].amplitude()];
/// let omegas = (0..9).map(|i| std::f64::consts::TAU * (120.9 + 0.1 * f64::from(i)));
/// let points: Vec<Point> = omegas.map(|w| Point::new(&solver.orbit(w, None).unwrap(), &amplitude)).collect();
/// let peak = highest(&mut *solver, &points, 1, &amplitude).unwrap();
/// assert!((peak.value - 0.032_338).abs() < 1e-6);
/// ```
pub fn highest(
    solver: &mut dyn Solver,
    points: &[Point],
    wanted: usize,
    quantities: &dyn Fn(&Orbit) -> Vec<f64>,
) -> Option<Peak> {
    let largest = |point: &Point| (0..wanted).map(|quantity| point.value(quantity)).fold(f64::NEG_INFINITY, f64::max);
    let finite = (0..points.len()).filter(|&i| largest(&points[i]).is_finite());
    let best = finite.max_by(|&a, &b| largest(&points[a]).total_cmp(&largest(&points[b])))?;
    let at_end = best == 0 || best + 1 == points.len();
    let mut peak = Peak { omega: points[best].omega, value: largest(&points[best]), at_end, unsettled: None };
    let mut tops: Vec<(f64, usize, Vec<usize>)> = (1..points.len().saturating_sub(1))
        .filter_map(|i| {
            let near = &points[i - 1..=i + 1];
            let mut here: Vec<usize> = (0..wanted).filter(|&quantity| is_maximum(near, quantity)).collect();
            here.sort_by(|&a, &b| reach(near, b).total_cmp(&reach(near, a)));
            Some((reach(near, *here.first()?), i, here))
        })
        .collect();
    // the most promising first: what it reaches leaves fewer of the others to look at
    tops.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, i, here) in tops {
        let mut bracket = Bracket::new(&points[i - 1..=i + 1]);
        for quantity in here {
            // what others have asked for tells more of this one than the points of the curve
            let share = if bracket.points.len() > 3 { LIKELY } else { CANDIDATE };
            if bracket.reach(quantity) >= share * peak.value {
                bracket.refine(solver, quantity, quantities);
                peak = higher(peak, bracket.peak(quantity).peak);
            }
        }
        bracket.refine_overtaken(solver, quantities);
        let refined: Vec<usize> = bracket.ended.keys().copied().collect();
        peak = refined.into_iter().map(|quantity| bracket.peak(quantity).peak).fold(peak, higher);
    }
    Some(peak)
}

/// The higher one of two peaks; of equal ones the one that is not at an end.
fn higher(one: Peak, other: Peak) -> Peak {
    if other.value > one.value || (other.value == one.value && one.at_end) { other } else { one }
}

/// A peak of one of several quantities.
#[derive(Debug, Clone, PartialEq)]
pub struct PeakOf {
    /// The number of the quantity.
    pub quantity: usize,
    /// The peak.
    pub peak: Peak,
    /// All quantities there.
    pub values: Vec<f64>,
}

/// Every local maximum of the first `wanted` quantities among the inner points of `points` (rising), refined, by frequency.
///
/// # Errors
/// The method cannot take the system.
///
/// # Example
/// ```
/// use stickslip::curve::peak::{Point, all};
/// use stickslip::method::{Method, event_driven::EventDriven};
/// use stickslip::orbit::Orbit;
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let amplitudes = |orbit: &Orbit| orbit.places.iter().map(|place| place.amplitude()).collect();
/// let mut solver = EventDriven.solver(&system).unwrap();
/// let points: Vec<Point> = (0..9)
///     .map(|i| solver.orbit(std::f64::consts::TAU * (120.5 + 0.2 * f64::from(i)), None).unwrap())
///     .map(|orbit| Point::new(&orbit, &amplitudes))
///     .collect();
/// let peaks = all(&EventDriven, &system, &points, 3, &amplitudes).unwrap();
/// assert_eq!(peaks.iter().filter(|peak| peak.quantity == 0).count(), 1);
/// ```
pub fn all(
    method: &dyn Method,
    system: &System,
    points: &[Point],
    wanted: usize,
    quantities: &(dyn Fn(&Orbit) -> Vec<f64> + Sync),
) -> Result<Vec<PeakOf>, MethodError> {
    let tops = (1..points.len().saturating_sub(1)).flat_map(|i| {
        let near = &points[i - 1..=i + 1];
        let here: Vec<usize> = (0..wanted).filter(|&quantity| is_maximum(near, quantity)).collect();
        here.chunks(TOGETHER).map(|some| (near, some.to_vec())).collect::<Vec<_>>()
    });
    let tops: Vec<(&[Point], Vec<usize>)> = tops.collect();
    let found: Vec<Result<Vec<PeakOf>, MethodError>> = tops
        .par_iter()
        .map(|(near, wanted)| Ok(refine(&mut *method.solver(system)?, near, wanted, quantities)))
        .collect();
    let mut peaks = Vec::new();
    for some in found {
        peaks.extend(some?);
    }
    // peaks about one point are in the order of their quantities
    peaks.sort_by(|a, b| a.peak.omega.total_cmp(&b.peak.omega));
    Ok(peaks)
}

/// Whether the middle one of three points stands out; of two equal ones the second does.
fn is_maximum(near: &[Point], quantity: usize) -> bool {
    let [left, here, right] = [0, 1, 2].map(|i| near[i].value(quantity));
    let known = near.iter().all(|point| !point.values.is_empty());
    known && here >= left && here > right && here - left.min(right) > LEVEL * here.abs()
}

/// Three points of a curve, of which the middle one is a maximum of some quantities, and the orbits between them that were asked for since.
struct Bracket {
    points: Vec<Point>,
    /// Distance of the ends, rad/s.
    width: f64,
    /// Where the last search for the peak of a quantity ended (rad/s), and whether it had found it.
    ended: BTreeMap<usize, (f64, bool)>,
}

impl Bracket {
    fn new(near: &[Point]) -> Self {
        Bracket { points: near.to_vec(), width: near[2].omega - near[0].omega, ended: BTreeMap::new() }
    }

    /// What the parabola about the highest point of a quantity reaches.
    fn reach(&self, quantity: usize) -> f64 {
        let top = best(&self.points, quantity);
        reach(&self.points[top - 1..=top + 1], quantity)
    }

    /// Asks for orbits until the peak of a quantity is found.
    fn refine(&mut self, solver: &mut dyn Solver, quantity: usize, quantities: &dyn Fn(&Orbit) -> Vec<f64>) {
        let points = &mut self.points;
        let mut shrink = Shrink::default();
        let mut failures = 0;
        for _ in 0..ORBITS {
            let best = best(points, quantity);
            let Some(omega) = shrink.next(points, best, quantity, CLOSEST * self.width) else { break };
            if failures == FAILURES {
                break;
            }
            // the orbit's neighbour on the side of the new point is as good a start as any
            let start = points[best].start.as_deref();
            let error = points[best].error;
            let found = match solver.between(omega, start) {
                // far from the neighbour it takes more than its help; close to it there is nothing to be gained
                Err(_) if (omega - points[best].omega).abs() > AWAY * self.width => solver.orbit(omega, start),
                found => found,
            };
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
    fn refine_overtaken(&mut self, solver: &mut dyn Solver, quantities: &dyn Fn(&Orbit) -> Vec<f64>) {
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

    /// The peak of a quantity, as far as it is refined.
    fn peak(&self, quantity: usize) -> PeakOf {
        let top = best(&self.points, quantity);
        let point = &self.points[top];
        let near = &self.points[top - 1..=top + 1];
        let unsettled = if lacks_neighbours(near, quantity) {
            Some(Unsettled::Neighbours)
        } else {
            (!self.found(quantity) && is_needle(near, quantity)).then_some(Unsettled::Needle)
        };
        let peak = Peak { omega: point.omega, value: point.value(quantity), at_end: false, unsettled };
        PeakOf { quantity, peak, values: point.values.clone() }
    }
}

/// The peaks of the `wanted` quantities, each of which is largest at the middle one of three points.
fn refine(
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
fn reach(near: &[Point], quantity: usize) -> f64 {
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

/// Whether a quantity falls on both sides of the middle one of three points by more than a peak that is found, and the parabola through them rises as
/// much above it. Beside a kink or a jump it does so on one side at most, by the time that the bracket is closed.
fn is_needle(near: &[Point], quantity: usize) -> bool {
    let value = near[1].value(quantity);
    let falls = |point: &Point| value - point.value(quantity) > SETTLED * value;
    falls(&near[0]) && falls(&near[2]) && parabola(near, 1, quantity).0 > SETTLED
}

/// The highest inner point; the first and the last one are not above it.
fn best(points: &[Point], quantity: usize) -> usize {
    (1..points.len() - 1)
        .max_by(|&a, &b| points[a].value(quantity).total_cmp(&points[b].value(quantity)))
        .unwrap_or(points.len() / 2)
}

/// How the bracket of one quantity shrinks: by parabolas as long as they keep what they promise, else by crossing lines and by halving.
#[derive(Debug, Default)]
struct Shrink {
    /// The quantity that the last trial was to reach.
    promised: Option<f64>,
    /// Trials that did not keep their promise since one did.
    broken: usize,
    /// Where the last trial was two lines that cross: the form there, as promised.
    kink: Option<(f64, f64)>,
    /// Whether the peak is found: there is nothing more to be had.
    found: bool,
}

impl Shrink {
    /// The frequency of the next orbit; `None` if the peak is found.
    fn next(&mut self, points: &[Point], best: usize, quantity: usize, closest: f64) -> Option<f64> {
        let [left, middle, right] = [best - 1, best, best + 1].map(|i| points[i].omega);
        let value = points[best].value(quantity);
        let (rise, vertex) = parabola(points, best, quantity);
        let floor = closest.max(4.0 * f64::EPSILON * middle);
        let enough = (NOISE * points[best].error).clamp(RISE, MOST_NOISE);
        let at_kink = self.kink.is_some_and(|(omega, promised)| {
            omega == middle && (form(value) - promised).abs() <= enough * promised.abs()
        });
        match self.promised {
            Some(promised) if value < promised => self.broken += 1,
            _ => self.broken = 0,
        }
        // a promise that nothing more is to be had counts only from who has kept the last one
        self.found = (rise <= enough && self.broken == 0) || at_kink;
        if self.found || right - left <= 2.0 * floor {
            return None;
        }
        self.promised = Some(value * (1.0 + KEPT * rise));
        self.kink = None;
        let wider = if right - middle > middle - left { 0.5 * (middle + right) } else { 0.5 * (left + middle) };
        let inside = |omega: &f64| *omega > left + floor && *omega < right - floor;
        // what neither describes is a jump
        let form = if self.broken < JUMP { self.broken % 3 } else { 2 };
        let trial = match form {
            0 => vertex.filter(inside),
            1 => {
                self.kink = crossing(points, best, quantity).filter(|(omega, _)| inside(omega));
                self.kink.map(|(omega, _)| omega)
            }
            _ => None,
        };
        let mut trial = trial.unwrap_or(wider);
        if (trial - middle).abs() < floor {
            // a step to the side on which the bracket is wider closes it there
            trial = middle + if right - middle > middle - left { floor } else { -floor };
        }
        inside(&trial).then_some(trial)
    }
}

/// What is interpolated: `1/a²` of positive quantities, which falls where they rise.
fn form(value: f64) -> f64 {
    if value > 0.0 { -1.0 / (value * value) } else { f64::NEG_INFINITY }
}

/// Of the parabola through a point and its neighbours: how far its vertex lies above the point, as a share of the quantity, and where.
/// Without one (a failed neighbour, a straight line) the rise is unbounded.
fn parabola(points: &[Point], best: usize, quantity: usize) -> (f64, Option<f64>) {
    let [a, x, b] = [best - 1, best, best + 1].map(|i| points[i].omega);
    let [fa, fx, fb] = [best - 1, best, best + 1].map(|i| form(points[i].value(quantity)));
    let (left, right) = ((fx - fa) / (x - a), (fx - fb) / (b - x));
    let curvature = (left + right) / (b - a);
    if !(curvature.is_finite() && curvature > 0.0) {
        return (f64::INFINITY, None);
    }
    // slope of the parabola at the middle point
    let slope = (left * (b - x) - right * (x - a)) / (b - a);
    let rise = slope * slope / (4.0 * curvature);
    // f = -a⁻²: a relative rise r of the quantity is 2 r |f|
    (0.5 * rise / fx.abs(), Some(x + 0.5 * slope / curvature))
}

/// Where the two straight lines cross that the points left and right of the best one lie on, and the form there.
fn crossing(points: &[Point], best: usize, quantity: usize) -> Option<(f64, f64)> {
    let at = |i: usize| Some((points.get(i)?.omega, form(points.get(i)?.value(quantity))));
    let (before, after) = (at(best.checked_sub(2)?)?, at(best + 2)?);
    let (left, here, right) = (at(best - 1)?, at(best)?, at(best + 1)?);
    let slope = |p: (f64, f64), q: (f64, f64)| (q.1 - p.1) / (q.0 - p.0);
    let meet = |p: (f64, f64), s: f64, q: (f64, f64), t: f64| {
        let omega = p.0 + (q.1 - p.1 - t * (q.0 - p.0)) / (s - t);
        (omega, p.1 + s * (omega - p.0))
    };
    // the best point lies on the one line or on the other
    let rising = meet(here, slope(left, here), right, slope(right, after));
    let falling = meet(left, slope(before, left), here, slope(here, right));
    // a crossing below the best point is none
    [rising, falling].into_iter().find(|(omega, form)| *omega > left.0 && *omega < right.0 && *form >= here.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::OrbitError;
    use crate::method::event_driven::EventDriven;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring};

    /// A solver for curves that are given: every orbit fails, the value is noted before.
    struct Formula<'a> {
        curve: &'a dyn Fn(f64) -> f64,
    }

    /// Refines the middle one of three points of a formula; returns frequency, value, and evaluations.
    fn check(curve: &dyn Fn(f64) -> f64, [a, x, b]: [f64; 3]) -> (f64, f64, usize) {
        let formula = Formula { curve };
        let point = |omega: f64| Point { omega, values: vec![(formula.curve)(omega)], start: None, error: 0.0 };
        let mut points = vec![point(a), point(x), point(b)];
        let mut shrink = Shrink::default();
        let mut count = 0;
        while count < ORBITS {
            let top = best(&points, 0);
            let Some(omega) = shrink.next(&points, top, 0, CLOSEST * (b - a)) else { break };
            let at = points.partition_point(|point| point.omega < omega);
            points.insert(at, point(omega));
            count += 1;
        }
        let top = &points[best(&points, 0)];
        (top.omega, top.value(0), count)
    }

    #[test]
    fn the_peak_of_a_linear_oscillator_takes_a_handful_of_orbits() {
        // |1/(1 - w² + 2 j ζ w)| is highest at w² = 1 - 2 ζ² with 1/(2 ζ √(1 - ζ²))
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
    fn a_jump_ends_within_the_bound() {
        let (omega, _, count) = check(&|w| if w < 1.05 { 1.0 + w } else { 0.1 }, [0.9, 1.0, 1.2]);
        // the points below the jump lie on a slope that a parabola creeps up: it ends close to the edge
        assert!((omega - 1.05).abs() < 1e-4 * 0.3, "{omega}");
        assert!(count <= ORBITS, "{count}");
    }

    #[test]
    fn level_curves_and_failed_neighbours_have_no_peak() {
        let point = |values: &[f64]| Point { omega: 1.0, values: values.to_vec(), start: None, error: 0.0 };
        assert!(!is_maximum(&[point(&[1.0]), point(&[1.0 + 1e-13]), point(&[1.0])], 0));
        assert!(!is_maximum(&[point(&[]), point(&[2.0]), point(&[1.0])], 0));
        assert!(is_maximum(&[point(&[1.0]), point(&[2.0]), point(&[1.0])], 0));
    }

    impl Solver for Formula<'_> {
        fn orbit(&mut self, omega: f64, _: Option<&[f64]>) -> Result<Orbit, OrbitError> {
            Err(OrbitError::Frequency { omega })
        }
    }

    #[test]
    fn orbits_that_fail_leave_the_point_of_the_grid() {
        let curve = |w: f64| 2.0 - (w - 1.0).powi(2);
        let mut formula = Formula { curve: &curve };
        let near = [0.9, 1.01, 1.1].map(|omega| Point { omega, values: vec![curve(omega)], start: None, error: 0.0 });
        let peak = refine(&mut formula, &near, &[0], &|_| Vec::new())[0].peak;
        assert_eq!((peak.omega, peak.value, peak.unsettled), (1.01, curve(1.01), Some(Unsettled::Neighbours)));
    }

    /// Two masses side by side, |x| = F / (c ω) at their resonances: a wide one of 2.5 mm, and a narrow one of 9.1 mm that 13 points five half-widths
    /// apart show as 1.8 mm, below the wide one.
    #[test]
    fn a_narrow_top_between_two_points_counts_beside_a_wide_one() {
        let mut model = Model::default();
        for (name, stiffness, damping) in [("wide", 1e4, 4.0), ("narrow", 1.21e4, 1.0)] {
            model.masses.push(Mass::new(name, 1.0));
            model.springs.push(Spring { between: [name.to_owned(), GROUND.to_owned()], stiffness, damping });
            model.forces.push(Force { on: name.to_owned(), amplitude: 1.0, phase: 0.0, harmonic: 1 });
        }
        let system = model.assemble().unwrap();
        let amplitudes = |orbit: &Orbit| orbit.places.iter().map(|place| place.amplitude()).collect::<Vec<f64>>();
        let mut solver = EventDriven.solver(&system).unwrap();
        let mut point = |i: i32| Point::new(&solver.orbit(82.5 + 5.0 * f64::from(i), None).unwrap(), &amplitudes);
        let points: Vec<Point> = (0..13).map(&mut point).collect();
        let peak = highest(&mut *EventDriven.solver(&system).unwrap(), &points, 2, &amplitudes).unwrap();
        // F / (c √(k/m - c²/4m²))
        let expected = 1.0 / f64::sqrt(1.21e4 - 0.25);
        assert!((peak.value / expected - 1.0).abs() < RISE && peak.unsettled.is_none(), "{peak:?}");
    }

    /// Without damping a slider of 2 N bounds nothing that 10 N drive: 4/π·2 N < 10 N. With as much damping as bounds it the peak is found.
    #[test]
    fn a_peak_without_a_bound_is_open() {
        let peak = |damping: f64| {
            let mut model = Model::default();
            model.masses.push(Mass::new("m", 1.0));
            model.springs.push(Spring { between: ["m".to_owned(), GROUND.to_owned()], stiffness: 1e4, damping });
            model.forces.push(Force { on: "m".to_owned(), amplitude: 10.0, phase: 0.0, harmonic: 1 });
            let law = std::sync::Arc::new(crate::law::Jenkins { stiffness: 1e3, limit: 2.0 });
            model.joints.push(Joint { name: "j".to_owned(), between: ["m".to_owned(), GROUND.to_owned()], law });
            let system = model.assemble().unwrap();
            let amplitude = |orbit: &Orbit| vec![orbit.places[0].amplitude()];
            let mut solver = EventDriven.solver(&system).unwrap();
            let points: Vec<Point> = (0..9)
                .map(|i| 95.3 + 1.1 * f64::from(i))
                .map(|omega| {
                    solver.orbit(omega, None).map_or(Point::failed(omega), |orbit| Point::new(&orbit, &amplitude))
                })
                .collect();
            highest(&mut *solver, &points, 1, &amplitude).unwrap()
        };
        assert!(peak(0.0).unsettled.is_some(), "{:?}", peak(0.0));
        assert_eq!(peak(0.5).unsettled, None);
    }
}
