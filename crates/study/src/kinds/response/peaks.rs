//! The peaks of a stretch of a response curve.

use super::super::peak_of::{named_places, worst};
use crate::work::Work;
use stickslip::curve::peak::{self, Peak, Point};
use stickslip::method::MethodError;
use stickslip::orbit::Orbit;
use stickslip_numerics::leading::leading;

/// Amplitudes below this share of the largest are rounding.
const ROUNDING: f64 = 1e-10;
/// Two points before a peak that differ from it by less than this share are level with it: more than the rounding of an orbit, and less
/// than a resonance falls between two points of any curve that can be drawn.
const LEVEL: f64 = 1e-8;

/// The amplitudes whose peaks are sought: of every mass, or the largest of the named ones and then each of these.
pub(super) fn amplitudes(orbit: &Orbit, named: &[usize]) -> Vec<f64> {
    if named.is_empty() {
        return orbit.places.iter().map(|place| place.amplitude()).collect();
    }
    std::iter::once(worst(orbit, named)).chain(named.iter().map(|place| orbit.places[*place].amplitude())).collect()
}

pub(super) fn point(orbit: &Orbit, named: &[usize]) -> Point {
    Point::new(orbit, &|orbit| amplitudes(orbit, named))
}

/// A peak and the mass that has it.
pub(super) struct Found {
    pub(super) mass: usize,
    pub(super) peak: Peak,
}

/// The peaks of a stretch of a curve, by frequency. The ends of the whole curve count as peaks at the end of the range if it falls away
/// from them.
pub(super) fn peaks_of(work: &Work<'_>, points: Vec<Point>) -> Result<Vec<Found>, MethodError> {
    let prepared = work.case();
    let named = named_places(prepared);
    let omegas = prepared
        .case
        .frequencies
        .as_ref()
        .map_or((0.0, 0.0), |f| (f.get(0).unwrap_or(0.0), f.get(f.len() - 1).unwrap_or(0.0)));
    let wanted = if named.is_empty() { prepared.system.places().len() } else { 1 };
    let found = |quantity: usize, peak: Peak, values: &[f64]| {
        let worst = || leading(values.iter().skip(1).copied()).unwrap_or(0);
        Found { mass: if named.is_empty() { quantity } else { named[worst()] }, peak }
    };
    let at_end = |end: &Point, neighbour: &Point| -> Vec<Found> {
        let falls = |q: &usize| neighbour.values.get(*q).is_some_and(|value| end.values[*q] > *value);
        (0..wanted.min(end.values.len()))
            .filter(falls)
            .map(|q| {
                found(q, Peak { omega: end.omega, value: end.values[q], at_end: true, unsettled: false }, &end.values)
            })
            .collect()
    };
    let (mut first, mut last) = (Vec::new(), Vec::new());
    if let [end, neighbour, ..] = &points[..]
        && end.omega == omegas.0
    {
        first = at_end(end, neighbour);
    }
    if let [.., neighbour, end] = &points[..]
        && end.omega == omegas.1
    {
        last = at_end(end, neighbour);
    }
    let quantities = |orbit: &Orbit| amplitudes(orbit, &named);
    // a place that friction holds moves by rounding only
    let largest = points.iter().flat_map(|point| &point.values).fold(0.0f64, |a, b| a.max(*b));
    let mut inner = peak::all(&*prepared.method, &prepared.system, &points, wanted, &quantities)?;
    inner.retain(|peak| peak.peak.value > ROUNDING * largest && !ends_a_level(&points, peak.quantity, &peak.peak));
    let inner = inner.into_iter().map(|peak| found(peak.quantity, peak.peak, &peak.values));
    Ok(first.into_iter().chain(inner).chain(last).collect())
}

/// Whether a peak is only where a level stretch ends: a mass that rides along with what moves it until a joint breaks loose.
fn ends_a_level(points: &[Point], quantity: usize, peak: &Peak) -> bool {
    let at = points.partition_point(|point| point.omega < peak.omega);
    let as_high = |point: &Point| {
        point.values.get(quantity).is_some_and(|value| (value - peak.value).abs() <= LEVEL * peak.value)
    };
    at >= 2 && points[at - 2..at].iter().all(as_high)
}
