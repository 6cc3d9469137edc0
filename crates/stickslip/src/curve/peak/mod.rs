//! Peaks of response curves, refined between the points of the curve.
//!
//! All quantities share the computed orbits: an orbit for one quantity narrows the brackets of
//! all others.

mod bracket;
mod bracket_reduction;
mod point;

use super::branch_following;
use crate::method::{Method, MethodError, Solver};
use crate::model::System;
use crate::orbit::Orbit;
use bracket::{Bracket, highest_inner, refine, vertex_value};
pub use point::{CurvePoint, Peak, QuantityPeak, UnresolvedPeak};
use rayon::prelude::*;

/// Returns the highest peak of the first `wanted` quantities over a curve. `points` are in order
/// of frequency; `solver` refines the peak between its neighbours. Each quantity is searched
/// separately. The maximum over all quantities at each frequency would hide the peak of one
/// quantity behind the flank of another.
///
/// Returns `None` if no point converged.
///
/// # Example
/// ```
/// use stickslip::curve::peak::{CurvePoint, highest_peak};
/// use stickslip::method::{Method, event_driven::EventDriven};
/// use stickslip::orbit::Orbit;
/// let mut couple = stickslip::model::example::blade_couple();
/// couple.joints[0].law = std::sync::Arc::new(stickslip::law::Coulomb { limit: 4.0 });
/// let system = couple.assemble().unwrap();
/// let mut solver = EventDriven.solver(&system).unwrap();
/// let amplitude = |orbit: &Orbit| vec![orbit.places[0].amplitude()];
/// let omegas = (0..9).map(|i| std::f64::consts::TAU * (120.9 + 0.1 * f64::from(i)));
/// let points: Vec<CurvePoint> =
///     omegas.map(|w| CurvePoint::new(&solver.orbit(w).unwrap(), &amplitude)).collect();
/// let peak = highest_peak(&mut *solver, &points, 1, &amplitude).unwrap();
/// assert!((peak.value - 0.032_338).abs() < 1e-6);
/// ```
pub fn highest_peak(
    solver: &mut dyn Solver,
    points: &[CurvePoint],
    wanted: usize,
    quantities: &dyn Fn(&Orbit) -> Vec<f64>,
) -> Option<Peak> {
    let largest =
        |point: &CurvePoint| (0..wanted).map(|quantity| point.value(quantity)).fold(f64::NEG_INFINITY, f64::max);
    let finite = (0..points.len()).filter(|&i| largest(&points[i]).is_finite());
    let best = finite.max_by(|&a, &b| largest(&points[a]).total_cmp(&largest(&points[b])))?;
    let at_end = best == 0 || best + 1 == points.len();
    let mut peak = Peak { omega: points[best].omega, value: largest(&points[best]), at_end, unresolved: None };
    let mut tops: Vec<(f64, usize, Vec<usize>)> = (1..points.len().saturating_sub(1))
        .filter_map(|i| {
            let near = &points[i - 1..=i + 1];
            let mut here: Vec<usize> = (0..wanted).filter(|&quantity| is_maximum(near, quantity)).collect();
            here.sort_by(|&a, &b| vertex_value(near, b).total_cmp(&vertex_value(near, a)));
            Some((vertex_value(near, *here.first()?), i, here))
        })
        .collect();
    // The most promising maximum comes first, because its value excludes other maxima.
    tops.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, i, here) in tops {
        let mut bracket = Bracket::new(&points[i - 1..=i + 1]);
        for quantity in here {
            // orbits that others added predict the peak better than the points of the curve
            // A maximum is searched only if the vertex of its parabola reaches this fraction of
            // the highest value. Other maxima cannot contain the highest peak, unless the points
            // are far too few. The second value applies after other quantities have added
            // orbits.
            let share = if bracket.points.len() > 3 { 0.95 } else { 0.8 };
            if bracket.vertex_value(quantity) >= share * peak.value {
                bracket.refine(solver, quantity, quantities);
                peak = higher(peak, bracket.peak(quantity).peak);
            }
        }
        bracket.repeat_overtaken(solver, quantities);
        let refined: Vec<usize> = bracket.ended.keys().copied().collect();
        peak = refined.into_iter().map(|quantity| bracket.peak(quantity).peak).fold(peak, higher);
    }
    Some(peak)
}

/// Returns the higher of two peaks; among equal ones, the one that is not at an end.
fn higher(one: Peak, other: Peak) -> Peak {
    if other.value > one.value || (other.value == one.value && one.at_end) { other } else { one }
}

/// Returns the amplitude (m) below which a place counts as held at a frequency: a fraction of
/// the largest `F / (k + Ω²m)`.
pub fn held_amplitude(system: &System, omega: f64) -> f64 {
    let structure = system.structure();
    let alone = |i: usize, force: f64| {
        force / (structure.diagonal_stiffness(i).abs() + omega * omega * structure.diagonal_mass(i))
    };
    let loads = system.excitation(omega);
    let sizes = loads.iter().flat_map(|(_, force)| force.iter().enumerate().map(|(i, f)| alone(i, f.norm())));
    // Amplitudes below this fraction of the response of a single mass to the loads are rounding:
    // friction holds the mass.
    1e-10 * sizes.filter(|size| size.is_finite()).fold(0.0, f64::max)
}

/// Returns all local maxima of the first `wanted` quantities among the inner `points`, refined,
/// in order of frequency. `points` are in order of frequency.
///
/// # Errors
/// The method does not support the system.
///
/// # Example
/// ```
/// use stickslip::curve::peak::{CurvePoint, local_peaks};
/// use stickslip::method::{Method, event_driven::EventDriven};
/// use stickslip::orbit::Orbit;
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let amplitudes = |orbit: &Orbit| orbit.places.iter().map(|place| place.amplitude()).collect();
/// let mut solver = EventDriven.solver(&system).unwrap();
/// let points: Vec<CurvePoint> = (0..9)
///     .map(|i| solver.orbit(std::f64::consts::TAU * (120.5 + 0.2 * f64::from(i))).unwrap())
///     .map(|orbit| CurvePoint::new(&orbit, &amplitudes))
///     .collect();
/// let peaks = local_peaks(&EventDriven, &system, &points, 3, &amplitudes).unwrap();
/// assert_eq!(peaks.iter().filter(|peak| peak.quantity == 0).count(), 1);
/// ```
pub fn local_peaks(
    method: &dyn Method,
    system: &System,
    points: &[CurvePoint],
    wanted: usize,
    quantities: &(dyn Fn(&Orbit) -> Vec<f64> + Sync),
) -> Result<Vec<QuantityPeak>, MethodError> {
    let tops = (1..points.len().saturating_sub(1)).flat_map(|i| {
        let near = &points[i - 1..=i + 1];
        let here: Vec<usize> = (0..wanted).filter(|&quantity| is_maximum(near, quantity)).collect();
        // Number of peaks at one point that share a solver and its stored data. It is small
        // enough to keep all threads busy, and does not depend on their number.
        here.chunks(12).map(|some| (near, some.to_vec())).collect::<Vec<_>>()
    });
    let tops: Vec<(&[CurvePoint], Vec<usize>)> = tops.collect();
    let found: Vec<Result<Vec<QuantityPeak>, MethodError>> = tops
        .par_iter()
        .map(|(near, wanted)| Ok(refine(&mut *branch_following::solver(method, system)?, near, wanted, quantities)))
        .collect();
    let mut peaks = Vec::new();
    for some in found {
        peaks.extend(some?);
    }
    Ok(sorted(peaks))
}

/// Returns all local maxima of quantity 0, which is the largest of the others, among the inner
/// `points`, refined, in order of frequency. `points` are in order of frequency.
///
/// Between three points, several quantities may have a peak. The peak of quantity 0 there is the
/// highest of them.
///
/// # Errors
/// The method does not support the system.
///
/// # Example
/// ```
/// use stickslip::curve::peak::{CurvePoint, envelope_peaks};
/// use stickslip::method::{Method, event_driven::EventDriven};
/// use stickslip::orbit::Orbit;
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let amplitudes = |orbit: &Orbit| {
///     let places: Vec<f64> = orbit.places.iter().map(|place| place.amplitude()).collect();
///     [vec![places.iter().copied().fold(0.0, f64::max)], places].concat()
/// };
/// let mut solver = EventDriven.solver(&system).unwrap();
/// let points: Vec<CurvePoint> = (0..9)
///     .map(|i| solver.orbit(std::f64::consts::TAU * (120.5 + 0.2 * f64::from(i))).unwrap())
///     .map(|orbit| CurvePoint::new(&orbit, &amplitudes))
///     .collect();
/// let peaks = envelope_peaks(&EventDriven, &system, &points, 3, &amplitudes).unwrap();
/// assert!(peaks.iter().all(|peak| peak.peak.value >= peak.values[1]));
/// ```
pub fn envelope_peaks(
    method: &dyn Method,
    system: &System,
    points: &[CurvePoint],
    others: usize,
    quantities: &(dyn Fn(&Orbit) -> Vec<f64> + Sync),
) -> Result<Vec<QuantityPeak>, MethodError> {
    let inner = 1..points.len().saturating_sub(1);
    let tops: Vec<usize> = inner.filter(|&i| is_maximum(&points[i - 1..=i + 1], 0)).collect();
    let found: Vec<Result<QuantityPeak, MethodError>> = tops
        .par_iter()
        .map(|&i| {
            let solver = &mut *branch_following::solver(method, system)?;
            Ok(envelope_peak(solver, points, i, others, quantities))
        })
        .collect();
    let mut peaks = sorted(found.into_iter().collect::<Result<_, _>>()?);
    peaks.dedup_by_key(|peak| peak.peak.omega);
    Ok(peaks)
}

/// Returns the peak of quantity 0 next to point `i`, at which it has a maximum. Another quantity
/// may have a higher peak up to two points away.
fn envelope_peak(
    solver: &mut dyn Solver,
    points: &[CurvePoint],
    i: usize,
    others: usize,
    quantities: &dyn Fn(&Orbit) -> Vec<f64>,
) -> QuantityPeak {
    // A quantity is searched only if the vertex of its parabola reaches this fraction of the
    // highest value. Orbits that the search for quantity 0 added predict it well.
    let share = 0.98;
    let mut bracket = Bracket::new(&points[i - 1..=i + 1]);
    bracket.refine(solver, 0, quantities);
    let mut highest = bracket.peak(0);
    bracket.points.splice(0..0, i.checked_sub(2).map(|before| points[before].clone()));
    bracket.points.extend(points.get(i + 2).cloned());
    let mut candidates: Vec<usize> = (1..=others).collect();
    candidates.sort_by(|&a, &b| bracket.vertex_value(b).total_cmp(&bracket.vertex_value(a)));
    for quantity in candidates {
        let top = highest_inner(&bracket.points, quantity);
        // a quantity that is the largest one at the peak has been searched with it
        let is_higher = bracket.points[top].omega != highest.peak.omega
            && is_maximum(&bracket.points[top - 1..=top + 1], quantity)
            && bracket.vertex_value(quantity) >= share * highest.peak.value;
        if is_higher {
            bracket.refine(solver, quantity, quantities);
            let found = bracket.peak(quantity);
            if found.values[0] > highest.peak.value {
                let peak = Peak { value: found.values[0], ..found.peak };
                highest = QuantityPeak { quantity: 0, peak, ..found };
            }
        }
    }
    highest
}

/// Returns the peaks in order of frequency; peaks at one point stay in the order of their
/// quantities.
fn sorted(mut peaks: Vec<QuantityPeak>) -> Vec<QuantityPeak> {
    peaks.sort_by(|a, b| a.peak.omega.total_cmp(&b.peak.omega));
    peaks
}

/// Drops the series of the point before the last one, unless a peak search begins there. Series
/// take most of the memory of a long curve of a large system.
pub fn drop_unused_series(points: &mut [CurvePoint]) {
    let Some(near) = points.len().checked_sub(3).map(|first| &mut points[first..]) else { return };
    let is_top = (0..near[1].values.len()).any(|quantity| is_maximum(near, quantity));
    if let Some(seed) = near[1].seed.as_mut().filter(|_| !is_top) {
        seed.drop_series();
    }
}

/// Tells whether the middle one of three points is a maximum. Among two equal points, the second
/// one counts.
fn is_maximum(near: &[CurvePoint], quantity: usize) -> bool {
    let [left, here, right] = [0, 1, 2].map(|i| near[i].value(quantity));
    let known = near.iter().all(|point| !point.values.is_empty());
    // A point that exceeds its neighbours by less than this fraction is rounding, not a peak.
    known && here >= left && here > right && here - left.min(right) > 1e-10 * here.abs()
}

#[cfg(test)]
mod tests {
    use super::bracket_reduction::ReductionSettings;
    use super::*;
    use crate::method::event_driven::EventDriven;
    use crate::method::{Budget, Request};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring};

    #[test]
    fn level_curves_and_failed_neighbours_have_no_peak() {
        let point = |values: &[f64]| CurvePoint { omega: 1.0, values: values.to_vec(), seed: None, error: 0.0 };
        assert!(!is_maximum(&[point(&[1.0]), point(&[1.0 + 1e-13]), point(&[1.0])], 0));
        assert!(!is_maximum(&[point(&[]), point(&[2.0]), point(&[1.0])], 0));
        assert!(is_maximum(&[point(&[1.0]), point(&[2.0]), point(&[1.0])], 0));
    }

    /// Two separate masses with resonances of |x| = F / (c ω): a wide one of 2.5 mm, and a
    /// narrow one of 9.1 mm. The 13 points, five half-widths apart, show the narrow one as 1.8
    /// mm, below the wide one.
    #[test]
    fn a_narrow_peak_between_points_is_found() {
        let mut model = Model::default();
        for (name, stiffness, damping) in [("wide", 1e4, 4.0), ("narrow", 1.21e4, 1.0)] {
            model.masses.push(Mass::new(name, 1.0));
            model.springs.push(Spring { between: [name.to_owned(), GROUND.to_owned()], stiffness, damping });
            model.forces.push(Force { on: name.to_owned(), amplitude: 1.0, phase: 0.0, harmonic: 1 });
        }
        let system = model.assemble().unwrap();
        let amplitudes = |orbit: &Orbit| orbit.places.iter().map(|place| place.amplitude()).collect::<Vec<f64>>();
        let mut solver = EventDriven.solver(&system).unwrap();
        let mut point = |i: i32| CurvePoint::new(&solver.orbit(82.5 + 5.0 * f64::from(i)).unwrap(), &amplitudes);
        let points: Vec<CurvePoint> = (0..13).map(&mut point).collect();
        let peak = highest_peak(&mut *EventDriven.solver(&system).unwrap(), &points, 2, &amplitudes).unwrap();
        // F / (c √(k/m - c²/4m²))
        let expected = 1.0 / f64::sqrt(1.21e4 - 0.25);
        assert!(
            (peak.value / expected - 1.0).abs() < ReductionSettings::default().min_rise && peak.unresolved.is_none(),
            "{peak:?}"
        );
    }

    /// Two separate masses with resonances of |x| = F / (c ω) at 100.1 and 100.55 rad/s, half a
    /// distance of the points apart. The first is the larger one at the points; the second has the
    /// higher peak.
    #[test]
    fn the_largest_of_several_places_has_their_highest_peak() {
        let mut model = Model::default();
        for (name, omega, amplitude) in [("first", 100.1f64, 1.0), ("second", 100.55, 1.02)] {
            model.masses.push(Mass::new(name, 1.0));
            let stiffness = omega * omega;
            model.springs.push(Spring { between: [name.to_owned(), GROUND.to_owned()], stiffness, damping: 1.0 });
            model.forces.push(Force { on: name.to_owned(), amplitude, phase: 0.0, harmonic: 1 });
        }
        let system = model.assemble().unwrap();
        let amplitudes = |orbit: &Orbit| {
            let places: Vec<f64> = orbit.places.iter().map(|place| place.amplitude()).collect();
            vec![places[0].max(places[1]), places[0], places[1]]
        };
        let mut solver = EventDriven.solver(&system).unwrap();
        let mut point = |i: i32| CurvePoint::new(&solver.orbit(f64::from(i)).unwrap(), &amplitudes);
        let points: Vec<CurvePoint> = (95..107).map(&mut point).collect();
        assert!(points[5].values[0] > points[6].values[0] && points[5].values[0] == points[5].values[1]);
        let peaks = envelope_peaks(&EventDriven, &system, &points, 2, &amplitudes).unwrap();
        // F / (c √(k/m - c²/4m²))
        let expected = 1.02 / f64::sqrt(100.55 * 100.55 - 0.25);
        assert_eq!(peaks.len(), 1);
        assert!((peaks[0].peak.value / expected - 1.0).abs() < 1e-6, "{:?} {expected}", peaks[0]);
    }

    /// Without damping, a slider of 2 N cannot bound the response to 10 N, since 4/π·2 N < 10 N.
    /// With sufficient damping the peak is found.
    #[test]
    fn an_unbounded_peak_is_unresolved() {
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
            let points: Vec<CurvePoint> = (0..9)
                .map(|i| 95.3 + 1.1 * f64::from(i))
                .map(|omega| {
                    solver.orbit(omega).map_or(CurvePoint::failed(omega), |orbit| CurvePoint::new(&orbit, &amplitude))
                })
                .collect();
            highest_peak(&mut *solver, &points, 1, &amplitude).unwrap()
        };
        assert!(peak(0.0).unresolved.is_some(), "{:?}", peak(0.0));
        assert_eq!(peak(0.5).unresolved, None);
    }

    /// A one-sided stop bends the resonance to higher frequencies. Without damping, the response
    /// grows without bound towards `2 / (1/ω + 1/ω')`, 117.1573 rad/s, with the frequencies `ω`
    /// off and `ω'` on the stop. The branch is lost before. With damping the curve has a maximum
    /// before its fold.
    #[test]
    fn a_peak_whose_branch_is_lost_is_unresolved() {
        let peak = |damping: f64, points: usize| {
            let mut model = Model::default();
            model.masses.push(Mass::new("m", 1.0));
            model.springs.push(Spring { between: ["m".to_owned(), GROUND.to_owned()], stiffness: 1e4, damping });
            model.forces.push(Force { on: "m".to_owned(), amplitude: 2.0, phase: 0.0, harmonic: 1 });
            let law = std::sync::Arc::new(crate::law::Gap { gap: 1e-3, stiffness: 1e4 });
            model.joints.push(Joint { name: "j".to_owned(), between: ["m".to_owned(), GROUND.to_owned()], law });
            let system = model.assemble().unwrap();
            let amplitude = |orbit: &Orbit| vec![orbit.places[0].amplitude()];
            let (mut solver, mut found) = (EventDriven.solver(&system).unwrap(), Vec::<CurvePoint>::new());
            for i in 0..=points {
                let omega = 100.0 + 30.0 * i as f64 / points as f64;
                let seed = found.last().and_then(|point| point.seed.as_ref());
                let orbit = solver.solve(&Request::at(omega).near(seed), &mut Budget::default());
                found.push(orbit.map_or(CurvePoint::failed(omega), |orbit| CurvePoint::new(&orbit, &amplitude)));
            }
            highest_peak(&mut *solver, &found, 1, &amplitude).unwrap()
        };
        for points in [10, 31, 310, 1000] {
            let open = peak(0.0, points);
            assert!(open.unresolved.is_some() && open.omega < 117.158, "{points}: {open:?}");
            assert_eq!(peak(2.0, points).unresolved, None, "{points}");
        }
    }
}
