//! The peaks of a stretch of a response curve.

use super::super::peak_of::{named_places, worst};
use crate::work::{Prepared, Work};
use stickslip::curve::both_ways::stretches;
use stickslip::curve::peak::{self, Peak, Point, held};
use stickslip::method::MethodError;
use stickslip::model::System;
use stickslip::orbit::{Orbit, PlaceMotion};
use stickslip_numerics::leading::leading;

/// Amplitudes below this share of the largest are rounding.
const ROUNDING: f64 = 1e-10;
/// Two points before a peak that differ from it by less than this share are level with it: more than the rounding of an orbit, and less
/// than a resonance falls between two points of any curve that can be drawn.
const LEVEL: f64 = 1e-8;

/// Two peaks between the same frequencies of both ways that differ by less than this share are one: searches on a level top end where their first points
/// lead them.
const SAME: f64 = 1e-2;

/// What is read off an orbit where peaks are sought.
pub(super) struct Sought {
    /// The places of which the worst counts; none if each does.
    named: Vec<usize>,
    places: usize,
    /// Whether the shape at the peaks is kept: that of a disk.
    shapes: bool,
}

impl Sought {
    pub(super) fn new(prepared: &Prepared) -> Self {
        let shapes = prepared.case.model.ring.is_some();
        Sought { named: named_places(prepared), places: prepared.system.places().len(), shapes }
    }

    /// The amplitudes whose peaks are sought: of every mass, or the largest of the named ones and then each of these.
    pub(super) fn amplitudes(&self, orbit: &Orbit) -> Vec<f64> {
        let Self { named, .. } = self;
        if named.is_empty() {
            // a rotation has no height among lengths: no peak of it is sought
            let height = |place: &PlaceMotion| if place.radius.is_some() { 0.0 } else { place.amplitude() };
            return orbit.places.iter().map(height).collect();
        }
        std::iter::once(worst(orbit, named)).chain(named.iter().map(|place| orbit.places[*place].amplitude())).collect()
    }

    /// Amplitude and phase (degrees) of every place; none where no shape is kept.
    pub(super) fn shape(&self, orbit: &Orbit) -> Vec<f64> {
        let places = orbit.places.iter().filter(|_| self.shapes);
        places.flat_map(|place| [place.amplitude(), place.phase_deg()]).collect()
    }

    /// These amplitudes and then the shape.
    pub(super) fn quantities(&self, orbit: &Orbit) -> Vec<f64> {
        let mut quantities = self.amplitudes(orbit);
        quantities.extend(self.shape(orbit));
        quantities
    }

    /// How many amplitudes there are.
    fn amplitudes_count(&self) -> usize {
        if self.named.is_empty() { self.places } else { 1 + self.named.len() }
    }

    /// The quantity of which something is a peak.
    fn quantity(&self, found: &Found) -> usize {
        if self.named.is_empty() { found.mass } else { 0 }
    }

    /// The mass that has the peak of a quantity.
    fn mass(&self, quantity: usize, values: &[f64]) -> usize {
        let amplitudes = &values[..self.amplitudes_count()];
        let worst = || leading(amplitudes.iter().skip(1).copied()).unwrap_or(0);
        if self.named.is_empty() { quantity } else { self.named[worst()] }
    }
}

/// A peak and the mass that has it.
pub(super) struct Found {
    pub(super) mass: usize,
    pub(super) peak: Peak,
    /// Amplitude (m) and phase (degrees) of every place, of a disk at a refined peak.
    pub(super) shape: Vec<f64>,
    /// Whether only the way back has it.
    pub(super) way_back: bool,
}

impl Found {
    /// Whether no place moves more there; of those that move alike the first does.
    pub(super) fn leads(&self, system: &System) -> bool {
        let amplitudes = self.shape.iter().step_by(2).zip(system.seen());
        leading(amplitudes.map(|(amplitude, place)| if place.is_rotation() { 0.0 } else { *amplitude }))
            == Some(self.mass)
    }
}

/// The peaks of a curve and those that only the way back has, whose orbits are `others`, by frequency.
pub(super) fn all(work: &Work<'_>, points: Vec<Point>, others: &[Point]) -> Result<Vec<Found>, MethodError> {
    let mut of_others = Vec::new();
    for stretch in stretches(&points, others) {
        let known = |omega: f64| others.iter().any(|other| other.omega == omega);
        let neighbours: Vec<f64> = stretch.iter().map(|point| point.omega).filter(|omega| !known(*omega)).collect();
        let found = peaks_of(work, stretch)?.into_iter().filter(|found| !neighbours.contains(&found.peak.omega));
        of_others.extend(found.map(|found| Found { way_back: true, ..found }));
    }
    let sought = Sought::new(work.case());
    of_others.retain(|found| !is_of_the_way_there(found, &points, others, &sought));
    let omegas: Vec<f64> = points.iter().map(|point| point.omega).collect();
    let mut all = peaks_of(work, points)?;
    all.retain(|found| !is_edge(found, &omegas, others, &sought));
    for found in of_others {
        match all.iter_mut().find(|other| is_same(other, &found, &omegas)) {
            Some(same) if found.peak.value > same.peak.value => *same = Found { way_back: false, ..found },
            Some(_) => {}
            None => all.push(found),
        }
    }
    all.sort_by(|a, b| a.peak.omega.total_cmp(&b.peak.omega));
    Ok(all)
}

/// Whether two peaks, of the way there and of the way back, are one.
fn is_same(there: &Found, back: &Found, omegas: &[f64]) -> bool {
    let below = |peak: &Peak| omegas.partition_point(|omega| *omega <= peak.omega);
    let (a, b) = (&there.peak, &back.peak);
    !there.way_back && there.mass == back.mass && below(a) == below(b) && (a.value - b.value).abs() <= SAME * a.value
}

/// Whether a peak of the way back is only where it jumps to the orbits of the way there: nearer to these at the closest frequency than to its own, and no
/// higher.
fn is_of_the_way_there(found: &Found, points: &[Point], others: &[Point], sought: &Sought) -> bool {
    let distance = |point: &&Point| (point.omega - found.peak.omega).abs();
    let Some(own) = others.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else { return false };
    let there = points.iter().find(|point| point.omega == own.omega);
    let value = |point: &Point| point.values.get(sought.quantity(found)).copied();
    let (Some(there), Some(own)) = (there.and_then(value), value(own)) else { return false };
    there >= found.peak.value && there - found.peak.value < (own - found.peak.value).abs()
}

/// Whether a peak, between two of the frequencies, is only where the way there jumps onto a branch that the way back follows on to something higher.
fn is_edge(found: &Found, omegas: &[f64], others: &[Point], sought: &Sought) -> bool {
    let quantity = sought.quantity(found);
    let Some(other) = others.iter().rfind(|other| other.omega < found.peak.omega) else { return false };
    let next = omegas.iter().find(|omega| **omega > other.omega);
    next.is_some_and(|next| found.peak.omega <= *next)
        && other.values.get(quantity).is_some_and(|value| *value >= found.peak.value)
}

/// The peaks of a stretch of a curve, by frequency. The ends of the whole curve count as peaks at the end of the range if it falls away
/// from them.
fn peaks_of(work: &Work<'_>, points: Vec<Point>) -> Result<Vec<Found>, MethodError> {
    let prepared = work.case();
    let sought = Sought::new(prepared);
    let count = sought.amplitudes_count();
    let omegas = prepared
        .case
        .frequencies
        .as_ref()
        .map_or((0.0, 0.0), |f| (f.get(0).unwrap_or(0.0), f.get(f.len() - 1).unwrap_or(0.0)));
    let wanted = if sought.named.is_empty() { count } else { 1 };
    let at_end = |end: &Point, neighbour: &Point| -> Vec<Found> {
        let falls = |q: &usize| neighbour.values.get(*q).is_some_and(|value| end.values[*q] > *value);
        (0..wanted.min(end.values.len()))
            .filter(falls)
            .map(|q| {
                let peak = Peak { omega: end.omega, value: end.values[q], at_end: true, unsettled: None };
                Found { mass: sought.mass(q, &end.values), peak, shape: Vec::new(), way_back: false }
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
    // a place that friction holds moves by rounding only
    let largest = points.iter().flat_map(|point| point.values.iter().take(count)).fold(0.0f64, |a, b| a.max(*b));
    let moves = |peak: &Peak| peak.value > (ROUNDING * largest).max(held(&prepared.system, peak.omega));
    let quantities = |orbit: &Orbit| sought.quantities(orbit);
    let mut inner = peak::all(&*prepared.method, &prepared.system, &points, wanted, &quantities)?;
    inner.retain(|found| !ends_a_level(&points, found.quantity, &found.peak));
    let inner = inner.into_iter().map(|found| {
        let mass = sought.mass(found.quantity, &found.values);
        Found { mass, peak: found.peak, shape: found.values[count..].to_vec(), way_back: false }
    });
    Ok(first.into_iter().chain(inner).chain(last).filter(|found| moves(&found.peak)).collect())
}

/// Whether a peak is only where a level stretch ends: a mass that rides along with what moves it until a joint breaks loose.
fn ends_a_level(points: &[Point], quantity: usize, peak: &Peak) -> bool {
    let at = points.partition_point(|point| point.omega < peak.omega);
    let as_high = |point: &Point| {
        point.values.get(quantity).is_some_and(|value| (value - peak.value).abs() <= LEVEL * peak.value)
    };
    at >= 2 && points[at - 2..at].iter().all(as_high)
}
