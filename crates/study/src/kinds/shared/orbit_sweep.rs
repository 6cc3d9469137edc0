//! Shared by the kinds with whole orbits: the orbits of a unit, their instants, and failures.

use crate::case::study::{Case, Study};
use crate::results::notes::Note;
use crate::run::point_row::describe_location;
use crate::run::work::{Computed, NOT_REACHED, UnitResult, UnitSize, UnitTask};
use stickslip::curve::sweep::{Observer, Watch, solve_sequence, solver};
use stickslip::method::{MethodError, OrbitError};
use stickslip::orbit::Orbit;

/// A frequency (rad/s) and its outcome; `None` if the run was stopped before.
type SweepOutcome = (f64, Option<Result<Orbit, OrbitError>>);

/// Returns the unit of work of a study.
///
/// A unit is a range of frequencies with a cold start. If a law allows several orbits at a
/// frequency, the unit is the whole curve. A cold start could then lead to another orbit than a
/// warm start. The laws of the first case represent all cases.
pub(in crate::kinds) fn grain(study: &Study) -> UnitSize {
    let unique = |case: Case| case.model.joints.iter().all(|joint| joint.law.is_incrementally_passive());
    if study.case(0).is_ok_and(unique) { UnitSize::Frequencies } else { UnitSize::Case }
}

/// Solves the frequencies of a unit of one case, each with a warm start from the previous one.
///
/// `see` receives each outcome immediately.
pub(in crate::kinds) fn sweep(work: &UnitTask<'_>, see: &mut Observer<'_>) -> Result<(), MethodError> {
    let prepared = work.case();
    let watch = Watch { finished: &*work.context.finished, stop: &work.context.stop };
    let mut omegas = work.points.clone().map(|index| work.omega(index));
    solve_sequence(&mut *solver(&*prepared.method, &prepared.system)?, &mut omegas, watch, see);
    Ok(())
}

/// Returns the outcomes of a unit of one case.
fn all(work: &UnitTask<'_>) -> Result<Vec<SweepOutcome>, (usize, MethodError)> {
    let mut points = Vec::with_capacity(work.points.len());
    sweep(work, &mut |omega, outcome| {
        points.push((omega, outcome.map(|outcome| outcome.cloned().map_err(Clone::clone))));
    })
    .map_err(|error| (work.case().case.index, error))?;
    Ok(points)
}

/// Computes the orbits of some frequencies, as the search for a peak does: the probe of kinds that
/// refine peaks.
pub(in crate::kinds) fn probe(work: &UnitTask<'_>) -> Computed {
    let mut part = UnitResult::default();
    converged_orbits(work, &mut part)?;
    Ok(part)
}

/// An orbit, and its stability if known.
type OrbitAndStability = (Orbit, Option<bool>);

/// Returns the orbits of a unit of one case. Counts all its points and records the failures.
pub(in crate::kinds) fn converged_orbits(
    work: &UnitTask<'_>,
    part: &mut UnitResult,
) -> Result<Vec<OrbitAndStability>, (usize, MethodError)> {
    let case = &work.case().case;
    let mut orbits = Vec::with_capacity(work.points.len());
    for (omega, point) in all(work)? {
        match point {
            Some(Ok(orbit)) => {
                let stable = orbit.is_stable();
                count(part, case, &orbit, stable, |note| note);
                orbits.push((orbit, stable));
            }
            other => count_missing(part, case, omega, other.as_ref()),
        }
    }
    Ok(orbits)
}

/// Counts an orbit and adds the notes on its stability and accuracy, worded by the kind.
pub(in crate::kinds) fn count(
    part: &mut UnitResult,
    case: &Case,
    orbit: &Orbit,
    stable: Option<bool>,
    words: fn(Note) -> Note,
) {
    part.count(|| describe_location(case, orbit.omega), orbit.evidence.accuracy.status(), None);
    Note::for_orbit(&case.model, orbit, stable)
        .into_iter()
        .map(words)
        .for_each(|note| note.merge_into(&mut part.notes));
}

/// Counts a point without an orbit.
fn count_missing(part: &mut UnitResult, case: &Case, omega: f64, point: Option<&Result<Orbit, OrbitError>>) {
    match point {
        Some(Err(error)) => part.count(|| describe_location(case, omega), error.status(), Some(error.to_string())),
        _ => part.count(|| describe_location(case, omega), NOT_REACHED, None),
    }
}

/// Returns the instants of a period, ascending, s: `samples` equal steps with both ends, and
/// every switch.
pub(in crate::kinds) fn times(orbit: &Orbit, samples: usize) -> Vec<f64> {
    let period = orbit.period();
    let mut times: Vec<f64> = (0..=samples).map(|i| period * i as f64 / samples as f64).collect();
    times.extend(orbit.transition_times());
    times.sort_by(f64::total_cmp);
    // a switch at an instant of the grid is kept once
    times.dedup_by(|a, b| (*a - *b).abs() <= 1e-12 * period);
    times
}
