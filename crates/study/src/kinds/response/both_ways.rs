//! A curve followed in both directions, where several orbits may exist at one frequency: what the points of the table do not show.

use super::super::peak_of::held;
use super::peaks::Sought;
use crate::note::Note;
use crate::point::Summary;
use crate::summary::may_have_several;
use crate::work::Work;
use stickslip::curve::peak::Point;
use stickslip::curve::sweep::back;
use stickslip::method::{MethodError, OrbitError};
use stickslip::model::System;
use stickslip::orbit::Orbit;

/// Degrees of freedom and directions of joints beyond which the way back is left out: it takes as long as the curve.
const LARGE: usize = 24;
/// Orbits are others whose amplitudes differ by more than this share of the largest, and by more than so many of their estimated errors.
const OTHER: f64 = 1e-2;
const ERRORS: f64 = 3.0;
/// Amplitudes below this share of a mean are its rounding.
const ROUNDING: f64 = 1e-10;

/// The points of a stretch of a curve, as they were found on the way there.
pub(super) struct BothWays {
    points: Vec<Point>,
}

/// An orbit of the way back at a frequency where the way there has another one.
pub(super) struct Other {
    /// What is kept of it.
    pub(super) summary: Summary,
    /// It, among which peaks are sought.
    pub(super) point: Point,
    /// That there are two.
    pub(super) note: Note,
}

fn amplitudes(orbit: &Orbit) -> Vec<f64> {
    orbit.places.iter().map(|place| place.amplitude()).collect()
}

impl BothWays {
    /// `None` where there is one orbit at a frequency, or the model is large.
    pub(super) fn of(work: &Work<'_>) -> Option<Self> {
        applies(&work.case().system).then(|| BothWays { points: Vec::new() })
    }

    pub(super) fn add(&mut self, omega: f64, outcome: Result<&Orbit, &OrbitError>) {
        self.add_point(outcome.map_or_else(|_| Point::failed(omega), |orbit| Point::new(orbit, &amplitudes)));
    }

    /// A point with the amplitudes of all places, or none.
    pub(super) fn add_point(&mut self, point: Point) {
        self.points.push(point);
    }

    /// Follows the points back, from what is found alone at the last one: the other orbits that are found, in the order of the way there.
    pub(super) fn others(&self, work: &Work<'_>) -> Result<Vec<Other>, MethodError> {
        let prepared = work.case();
        let (method, system) = (&*prepared.method, &prepared.system);
        let Some(last) = self.points.last() else { return Ok(Vec::new()) };
        let mut solver = method.solver(system)?;
        // what is found there alone need not be what the points before lead to
        let start = solver.orbit(last.omega, None).ok().map(|orbit| orbit.start);
        let mut omegas = self.points.iter().rev().map(|point| point.omega);
        let mut others = Vec::new();
        let sought = Sought::new(prepared);
        back(method, system, start, &mut omegas, &work.context.stop, &mut |orbit| {
            let Some(point) = self.points.iter().find(|point| point.omega == orbit.omega) else { return };
            let held = held(system, orbit.omega);
            let differs = |orbit: &Orbit| other(point, orbit, held);
            // the way back asks for no errors: of an orbit that is shown they are known
            let shown = differs(orbit).and_then(|_| solver.orbit(orbit.omega, Some(&orbit.start)).ok());
            if let Some((orbit, note)) = shown.and_then(|orbit| differs(&orbit).map(|note| (orbit, note))) {
                let point = Point::new(&orbit, &|orbit| sought.quantities(orbit));
                others.push(Other { summary: Summary::new(prepared, Ok(&orbit)), point, note });
            }
        })?;
        others.reverse();
        Ok(others)
    }
}

/// The stretches of the way back on which it has other orbits than the way there, whose points are `there`: each with its neighbours of both ways.
pub(super) fn stretches(there: &[Point], others: &[Other]) -> Vec<Vec<Point>> {
    let mut stretches: Vec<Vec<Point>> = Vec::new();
    let mut others = others.iter().map(|other| &other.point).peekable();
    let mut open = false;
    for (i, point) in there.iter().enumerate() {
        match others.next_if(|other| other.omega == point.omega) {
            Some(other) => {
                if !open {
                    stretches.push(i.checked_sub(1).map(|before| there[before].clone()).into_iter().collect());
                }
                stretches.last_mut().into_iter().for_each(|stretch| stretch.push(other.clone()));
                open = true;
            }
            None if open => {
                stretches.last_mut().into_iter().for_each(|stretch| stretch.push(point.clone()));
                open = false;
            }
            None => {}
        }
    }
    stretches
}

/// Whether a curve of this system is followed both ways.
pub(super) fn applies(system: &System) -> bool {
    let directions: usize = system.joints().iter().map(|joint| joint.law().directions()).sum();
    system.dofs() + directions <= LARGE && may_have_several(system)
}

/// That an orbit is another one than that of a point at its frequency; `None` if there is none there or it is the same. What friction holds, or nothing
/// drives, moves by rounding, of its mean or of `held`, m.
fn other(point: &Point, orbit: &Orbit, held: f64) -> Option<Note> {
    let found = amplitudes(orbit);
    let held = orbit.places.iter().map(|place| ROUNDING * place.mean.abs()).fold(held, f64::max);
    let largest = |values: &[f64]| values.iter().copied().fold(held.max(f64::MIN_POSITIVE), f64::max);
    let (here, there) = (largest(&point.values), largest(&found));
    let enough = (OTHER.max(ERRORS * point.error) * here.max(there)).max(held);
    let differs = point.values.iter().zip(&found).any(|(a, b)| (a - b).abs() > enough);
    let ratio = (there / here).clamp(f64::MIN_POSITIVE, f64::MAX);
    differs.then_some(Note::OtherOrbit { points: 1, from: point.omega, to: point.omega, ratios: [ratio; 2] })
}
