//! Shared by the kinds with whole orbits: the orbits of a unit, their instants, and failures.

use crate::note::Note;
use crate::point::location_of;
use crate::study::{Case, Study};
use crate::work::{Grain, NOT_REACHED, Part, Work};
use stickslip::curve::sweep::{Observer, Watch, solve_sequence, solver};
use stickslip::method::{MethodError, OrbitError};
use stickslip::orbit::Orbit;

/// A frequency (rad/s) and its outcome; `None` if the run was stopped before.
type Point = (f64, Option<Result<Orbit, OrbitError>>);

/// Returns the unit of work of a study.
///
/// A unit is a range of frequencies with a cold start. If a law allows several orbits at a
/// frequency, the unit is the whole curve. A cold start could then lead to another orbit than a
/// warm start. The laws of the first case represent all cases.
pub(super) fn grain(study: &Study) -> Grain {
    let unique = |case: Case| case.model.joints.iter().all(|joint| joint.law.is_incrementally_passive());
    if study.case(0).is_ok_and(unique) { Grain::Frequencies } else { Grain::Case }
}

/// Solves the frequencies of a unit of one case, each with a warm start from the previous one.
///
/// `see` receives each outcome immediately.
pub(super) fn sweep(work: &Work<'_>, see: &mut Observer<'_>) -> Result<(), MethodError> {
    let prepared = work.case();
    let watch = Watch { finished: &*work.context.finished, stop: &work.context.stop };
    let mut omegas = work.points.clone().map(|index| work.omega(index));
    solve_sequence(&mut *solver(&*prepared.method, &prepared.system)?, &mut omegas, watch, see);
    Ok(())
}

/// Returns the outcomes of a unit of one case.
fn all(work: &Work<'_>) -> Result<Vec<Point>, (usize, MethodError)> {
    let mut points = Vec::with_capacity(work.points.len());
    sweep(work, &mut |omega, outcome| {
        points.push((omega, outcome.map(|outcome| outcome.cloned().map_err(Clone::clone))));
    })
    .map_err(|error| (work.case().case.index, error))?;
    Ok(points)
}

/// An orbit, and its stability if known.
type Judged = (Orbit, Option<bool>);

/// Returns the orbits of a unit of one case. Counts all its points and records the failures.
pub(super) fn found(work: &Work<'_>, part: &mut Part) -> Result<Vec<Judged>, (usize, MethodError)> {
    let case = &work.case().case;
    let mut orbits = Vec::with_capacity(work.points.len());
    for (omega, point) in all(work)? {
        match point {
            Some(Ok(orbit)) => {
                let stable = orbit.is_stable();
                count(part, case, &orbit, (stable, |note| note));
                orbits.push((orbit, stable));
            }
            other => count_missing(part, case, omega, other.as_ref()),
        }
    }
    Ok(orbits)
}

/// Counts an orbit and adds the notes on its stability and accuracy, worded by the kind.
pub(super) fn count(part: &mut Part, case: &Case, orbit: &Orbit, (stable, words): (Option<bool>, fn(Note) -> Note)) {
    part.count(|| location_of(case, orbit.omega), orbit.evidence.accuracy.status(), None);
    Note::of_orbit(&case.model, orbit, stable).into_iter().map(words).for_each(|note| note.join(&mut part.notes));
}

/// Counts a point without an orbit.
fn count_missing(part: &mut Part, case: &Case, omega: f64, point: Option<&Result<Orbit, OrbitError>>) {
    match point {
        Some(Err(error)) => part.count(|| location_of(case, omega), error.status(), Some(error.to_string())),
        _ => part.count(|| location_of(case, omega), NOT_REACHED, None),
    }
}

/// Returns the instants of a period, ascending, s: `samples` equal steps with both ends, and
/// every switch.
pub(super) fn times(orbit: &Orbit, samples: usize) -> Vec<f64> {
    let period = orbit.period();
    let mut times: Vec<f64> = (0..=samples).map(|i| period * i as f64 / samples as f64).collect();
    times.extend(orbit.transition_times());
    times.sort_by(f64::total_cmp);
    // a switch at an instant of the grid is kept once
    times.dedup_by(|a, b| (*a - *b).abs() <= 1e-12 * period);
    times
}
