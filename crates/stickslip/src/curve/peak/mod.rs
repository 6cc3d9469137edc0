//! Peaks of response curves, refined between the points of the curve.
//!
//! All quantities of an orbit share the orbits: what one mass asks for narrows the brackets of all others.

mod bracket;
mod point;
mod shrink;

use super::onward;
use crate::method::{Method, MethodError, Solver};
use crate::model::System;
use crate::orbit::Orbit;
use bracket::{Bracket, reach, refine};
pub use point::{Peak, PeakOf, Point, Unsettled};
use rayon::prelude::*;

/// A point that stands out from its neighbours by less than this share is the rounding of a level curve, not a peak.
const LEVEL: f64 = 1e-10;
/// Peaks about one point that share a solver with its memory: few enough for two hundred peaks about a handful of points to keep all threads at work,
/// and the same on any number of these.
const TOGETHER: usize = 12;
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

/// Amplitudes below this share of what the loads would do to a mass by itself are rounding: friction holds it.
const HELD: f64 = 1e-10;

/// The amplitude (m) below which a place counts as held at a frequency: a share of `F / (k + Ω²m)`, the largest there is.
pub fn held(system: &System, omega: f64) -> f64 {
    let (mass, stiffness) = (system.structure().mass(), system.structure().stiffness());
    let alone = |i: usize, force: f64| force / (stiffness[(i, i)].abs() + omega * omega * mass[(i, i)]);
    let loads = system.excitation(omega);
    let sizes = loads.iter().flat_map(|(_, force)| force.iter().enumerate().map(|(i, f)| alone(i, f.norm())));
    HELD * sizes.filter(|size| size.is_finite()).fold(0.0, f64::max)
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
        .map(|(near, wanted)| Ok(refine(&mut *onward::solver(method, system)?, near, wanted, quantities)))
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

#[cfg(test)]
mod tests {
    use super::shrink::RISE;
    use super::*;
    use crate::method::event_driven::EventDriven;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring};

    #[test]
    fn level_curves_and_failed_neighbours_have_no_peak() {
        let point = |values: &[f64]| Point { omega: 1.0, values: values.to_vec(), start: None, error: 0.0 };
        assert!(!is_maximum(&[point(&[1.0]), point(&[1.0 + 1e-13]), point(&[1.0])], 0));
        assert!(!is_maximum(&[point(&[]), point(&[2.0]), point(&[1.0])], 0));
        assert!(is_maximum(&[point(&[1.0]), point(&[2.0]), point(&[1.0])], 0));
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

    /// A stop on one side bends the resonance over: without damping it grows without a bound towards `2 / (1/ω + 1/ω')` with the frequencies `ω` off and `ω'`
    /// on the stop, 117.1573 rad/s, and is lost before; with damping it has a top in front of its fold.
    #[test]
    fn a_peak_that_is_lost_on_its_way_up_is_open() {
        let peak = |damping: f64, points: usize| {
            let mut model = Model::default();
            model.masses.push(Mass::new("m", 1.0));
            model.springs.push(Spring { between: ["m".to_owned(), GROUND.to_owned()], stiffness: 1e4, damping });
            model.forces.push(Force { on: "m".to_owned(), amplitude: 2.0, phase: 0.0, harmonic: 1 });
            let law = std::sync::Arc::new(crate::law::Gap { gap: 1e-3, stiffness: 1e4 });
            model.joints.push(Joint { name: "j".to_owned(), between: ["m".to_owned(), GROUND.to_owned()], law });
            let system = model.assemble().unwrap();
            let amplitude = |orbit: &Orbit| vec![orbit.places[0].amplitude()];
            let (mut solver, mut found) = (EventDriven.solver(&system).unwrap(), Vec::<Point>::new());
            for i in 0..=points {
                let start = found.last().and_then(|point| point.start.as_deref());
                let omega = 100.0 + 30.0 * i as f64 / points as f64;
                let orbit = solver.orbit(omega, start);
                found.push(orbit.map_or(Point::failed(omega), |orbit| Point::new(&orbit, &amplitude)));
            }
            highest(&mut *solver, &found, 1, &amplitude).unwrap()
        };
        for points in [10, 31, 310, 1000] {
            let open = peak(0.0, points);
            assert!(open.unsettled.is_some() && open.omega < 117.158, "{points}: {open:?}");
            assert_eq!(peak(2.0, points).unsettled, None, "{points}");
        }
    }
}
