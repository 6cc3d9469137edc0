//! The peaks of a range of a response curve.

use crate::kinds::shared::peak_of::{largest_amplitude, named_places};
use crate::run::work::{PreparedCase, UnitTask};
use stickslip::curve::bidirectional_sweep::other_intervals;
use stickslip::curve::peak::{self, CurvePoint, Peak, held_amplitude};
use stickslip::method::MethodError;
use stickslip::model::System;
use stickslip::orbit::{Orbit, PlaceMotion};
use stickslip_numerics::tie_break::first_largest;

/// The quantities of an orbit for the peak search.
pub(super) struct PeakQuantities {
    /// The places whose largest amplitude counts; empty if each place has separate peaks.
    named: Vec<usize>,
    places: usize,
    /// True if the shape at the peaks is kept, for a disk.
    shapes: bool,
}

impl PeakQuantities {
    pub(super) fn new(prepared: &PreparedCase) -> Self {
        let shapes = prepared.case.model.ring.is_some();
        PeakQuantities { named: named_places(prepared), places: prepared.system.places().len(), shapes }
    }

    /// Returns the amplitudes for the peak search.
    ///
    /// These are the amplitudes of every place, or the largest of the named places followed by
    /// each of them.
    pub(super) fn amplitudes(&self, orbit: &Orbit) -> Vec<f64> {
        let Self { named, .. } = self;
        if named.is_empty() {
            // rotations have no peaks, because they are not lengths
            let height = |place: &PlaceMotion| if place.rotation_radius.is_some() { 0.0 } else { place.amplitude() };
            return orbit.places.iter().map(height).collect();
        }
        std::iter::once(largest_amplitude(orbit, named))
            .chain(named.iter().map(|place| orbit.places[*place].amplitude()))
            .collect()
    }

    /// Returns amplitude and phase (degrees) of every place; empty if no shape is kept.
    pub(super) fn shape(&self, orbit: &Orbit) -> Vec<f64> {
        let places = orbit.places.iter().filter(|_| self.shapes);
        places.flat_map(|place| [place.amplitude(), place.phase_deg()]).collect()
    }

    /// Returns the amplitudes followed by the shape.
    pub(super) fn quantities(&self, orbit: &Orbit) -> Vec<f64> {
        let mut quantities = self.amplitudes(orbit);
        quantities.extend(self.shape(orbit));
        quantities
    }

    /// Returns the number of amplitudes.
    fn amplitudes_count(&self) -> usize {
        if self.named.is_empty() { self.places } else { 1 + self.named.len() }
    }

    /// Returns the index of the quantity of a peak.
    fn quantity(&self, found: &FoundPeak) -> usize {
        if self.named.is_empty() { found.mass } else { 0 }
    }

    /// Returns the place that has the peak of a quantity.
    fn mass(&self, quantity: usize, values: &[f64]) -> usize {
        let amplitudes = &values[..self.amplitudes_count()];
        let worst = || first_largest(amplitudes.iter().skip(1).copied()).unwrap_or(0);
        if self.named.is_empty() { quantity } else { self.named[worst()] }
    }
}

/// A peak and its place.
pub(super) struct FoundPeak {
    pub(super) mass: usize,
    pub(super) peak: Peak,
    /// Amplitude (m) and phase (degrees) of every place, for a refined peak of a disk.
    pub(super) shape: Vec<f64>,
    /// True if only the reverse sweep has the peak.
    pub(super) reverse_sweep: bool,
}

impl FoundPeak {
    /// Returns true if no place moves more at the peak; the first of equal places counts.
    pub(super) fn is_largest(&self, system: &System) -> bool {
        let amplitudes = self.shape.iter().step_by(2).zip(system.place_axes());
        first_largest(amplitudes.map(|(amplitude, place)| if place.is_rotation() { 0.0 } else { *amplitude }))
            == Some(self.mass)
    }
}

/// Returns the peaks of both sweeps by frequency; `others` are the other orbits of the reverse
/// sweep.
pub(super) fn all(
    work: &UnitTask<'_>,
    points: Vec<CurvePoint>,
    others: &[CurvePoint],
) -> Result<Vec<FoundPeak>, MethodError> {
    let mut reverse_peaks = Vec::new();
    for interval in other_intervals(&points, others) {
        let known = |omega: f64| others.iter().any(|other| other.omega == omega);
        let neighbours: Vec<f64> = interval.iter().map(|point| point.omega).filter(|omega| !known(*omega)).collect();
        let found = peaks_of(work, interval)?.into_iter().filter(|found| !neighbours.contains(&found.peak.omega));
        reverse_peaks.extend(found.map(|found| FoundPeak { reverse_sweep: true, ..found }));
    }
    let sought = PeakQuantities::new(work.case());
    reverse_peaks.retain(|found| !is_jump_to_forward(found, &points, others, &sought));
    let omegas: Vec<f64> = points.iter().map(|point| point.omega).collect();
    let mut all = peaks_of(work, points)?;
    all.retain(|found| !is_jump_to_branch(found, &omegas, others, &sought));
    for found in reverse_peaks {
        match all.iter_mut().find(|other| is_same_peak(other, &found, &omegas)) {
            Some(same) if found.peak.value > same.peak.value => *same = FoundPeak { reverse_sweep: false, ..found },
            Some(_) => {}
            None => all.push(found),
        }
    }
    all.sort_by(|a, b| a.peak.omega.total_cmp(&b.peak.omega));
    Ok(all)
}

/// Returns true if a peak of the forward sweep and a peak of the reverse sweep are the same.
fn is_same_peak(there: &FoundPeak, back: &FoundPeak, omegas: &[f64]) -> bool {
    let below = |peak: &Peak| omegas.partition_point(|omega| *omega <= peak.omega);
    let (a, b) = (&there.peak, &back.peak);
    // Largest relative difference of two peaks of both sweeps, between the same frequencies,
    // that count as one. Searches on a level top end at points that depend on the warm start.
    !there.reverse_sweep
        && there.mass == back.mass
        && below(a) == below(b)
        && (a.value - b.value).abs() <= 1e-2 * a.value
}

/// Returns true if a peak of the reverse sweep is only its jump to the orbits of the forward
/// sweep.
///
/// The nearest frequency decides: the peak must be closer to the orbit of the forward sweep
/// than to that of the reverse sweep, and not higher.
fn is_jump_to_forward(
    found: &FoundPeak,
    points: &[CurvePoint],
    others: &[CurvePoint],
    sought: &PeakQuantities,
) -> bool {
    let distance = |point: &&CurvePoint| (point.omega - found.peak.omega).abs();
    let Some(own) = others.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else { return false };
    let there = points.iter().find(|point| point.omega == own.omega);
    let value = |point: &CurvePoint| point.values.get(sought.quantity(found)).copied();
    let (Some(there), Some(own)) = (there.and_then(value), value(own)) else { return false };
    there >= found.peak.value && there - found.peak.value < (own - found.peak.value).abs()
}

/// Returns true if a peak is only the jump of the forward sweep to a branch on which the
/// reverse sweep reaches a higher amplitude.
fn is_jump_to_branch(found: &FoundPeak, omegas: &[f64], others: &[CurvePoint], sought: &PeakQuantities) -> bool {
    let quantity = sought.quantity(found);
    let Some(other) = others.iter().rfind(|other| other.omega < found.peak.omega) else { return false };
    let next = omegas.iter().find(|omega| **omega > other.omega);
    next.is_some_and(|next| found.peak.omega <= *next)
        && other.values.get(quantity).is_some_and(|value| *value >= found.peak.value)
}

/// Returns the peaks of a range of a curve by frequency.
///
/// An end of the whole curve is a peak at the range end if the curve falls from it.
fn peaks_of(work: &UnitTask<'_>, points: Vec<CurvePoint>) -> Result<Vec<FoundPeak>, MethodError> {
    let prepared = work.case();
    let sought = PeakQuantities::new(prepared);
    let count = sought.amplitudes_count();
    let omegas = prepared
        .case
        .frequencies
        .as_ref()
        .map_or((0.0, 0.0), |f| (f.get(0).unwrap_or(0.0), f.get(f.len() - 1).unwrap_or(0.0)));
    let wanted = if sought.named.is_empty() { count } else { 1 };
    let at_end = |end: &CurvePoint, neighbour: &CurvePoint| -> Vec<FoundPeak> {
        let falls = |q: &usize| neighbour.values.get(*q).is_some_and(|value| end.values[*q] > *value);
        (0..wanted.min(end.values.len()))
            .filter(falls)
            .map(|q| {
                let peak = Peak { omega: end.omega, value: end.values[q], at_end: true, unresolved: None };
                FoundPeak { mass: sought.mass(q, &end.values), peak, shape: Vec::new(), reverse_sweep: false }
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
    // the amplitude of a place held by friction is rounding only
    let largest = points.iter().flat_map(|point| point.values.iter().take(count)).fold(0.0f64, |a, b| a.max(*b));
    // Amplitudes below this share of the largest are rounding.
    let moves = |peak: &Peak| peak.value > (1e-10 * largest).max(held_amplitude(&prepared.system, peak.omega));
    let quantities = |orbit: &Orbit| sought.quantities(orbit);
    let (method, system) = (&*prepared.method, &prepared.system);
    let mut inner = match sought.named.len() {
        0 => peak::local_peaks(method, system, &points, wanted, &quantities)?,
        others => peak::envelope_peaks(method, system, &points, others, &quantities)?,
    };
    inner.retain(|found| !is_end_of_plateau(&points, found.quantity, &found.peak));
    let inner = inner.into_iter().map(|found| {
        let mass = sought.mass(found.quantity, &found.values);
        FoundPeak { mass, peak: found.peak, shape: found.values[count..].to_vec(), reverse_sweep: false }
    });
    Ok(first.into_iter().chain(inner).chain(last).filter(|found| moves(&found.peak)).collect())
}

/// Returns true if a peak is only the end of a level range.
///
/// An example is a mass that moves with its support until a joint slips.
fn is_end_of_plateau(points: &[CurvePoint], quantity: usize, peak: &Peak) -> bool {
    let index = points.partition_point(|point| point.omega < peak.omega);
    let as_high = |point: &CurvePoint| {
        // Largest relative difference of two points before a peak that counts as level. It is
        // above the rounding of an orbit, and below the fall of a resonance between two points
        // of any curve that can be drawn.
        point.values.get(quantity).is_some_and(|value| (value - peak.value).abs() <= 1e-8 * peak.value)
    };
    index >= 2 && points[index - 2..index].iter().all(as_high)
}
