//! Branch following: finds the next orbit of a curve on the branch of the previous one.
//!
//! If several orbits exist at a frequency, a search from a distant initial guess can converge to
//! another branch. The curve then jumps although its branch continues. If an orbit differs much
//! from its initial guess, the solver repeats the interval in smaller steps. Either these steps
//! reach the frequency, or the branch ends between both frequencies.

use crate::method::{Method, MethodError, OrbitError, Solver, solver_with_alternatives};
use crate::model::System;
use crate::orbit::Orbit;
use num_complex::Complex64;

/// Largest difference between two consecutive orbits of a branch, relative to the largest
/// amplitude. It applies to amplitudes and to first harmonics, which include the phase.
const MAX_CHANGE: f64 = 0.2;

/// Tells whether curves of a system use branch following and the reverse sweep: the system is
/// small, and several orbits may exist at a frequency.
pub fn is_followed(system: &System) -> bool {
    let directions: usize = system.joints().iter().map(|joint| joint.law().directions()).sum();
    // Largest number of degrees of freedom plus joint directions for branch following and the
    // reverse sweep, which takes as much time as the curve.
    system.dofs() + directions <= 24 && !system.is_incrementally_stable()
}

/// Returns a solver with branch following for systems that use it; otherwise the method's own
/// solver.
///
/// # Errors
/// The method does not support the system.
pub(crate) fn solver<'a>(method: &dyn Method, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
    let solver = solver_with_alternatives(method, system)?;
    Ok(if is_followed(system) {
        Box::new(BranchFollower { solver, last: None, announced: None, end: None, work_limit_reached: false })
    } else {
        solver
    })
}

struct BranchFollower<'a> {
    solver: Box<dyn Solver + Send + 'a>,
    last: Option<BranchPoint>,
    /// The orbit that [`Solver::begin_branch`] announced.
    announced: Option<BranchPoint>,
    /// The end of a branch at which smaller steps failed.
    end: Option<BranchEnd>,
    /// True after the steps in an interval exceeded the work limit. No interval is repeated
    /// after that.
    work_limit_reached: bool,
}

/// The end of a branch: the last orbit on it, and a nearby frequency (rad/s) at which the branch
/// has no orbit.
struct BranchEnd {
    last: BranchPoint,
    beyond: f64,
}

impl BranchEnd {
    /// Tells whether the interval from an orbit to a frequency contains this end.
    fn lies_between(&self, from: &BranchPoint, omega: f64) -> bool {
        let ahead = (self.beyond - self.last.omega).signum();
        (self.beyond - from.omega) * ahead > 0.0 && (omega - self.beyond) * ahead >= 0.0 && from.is_near(&self.last)
    }
}

/// The last orbit of a curve.
#[derive(Clone)]
struct BranchPoint {
    omega: f64,
    start: Vec<f64>,
    /// Amplitude (m) and first harmonic of every place.
    places: Vec<(f64, Complex64)>,
}

impl BranchPoint {
    fn new(orbit: &Orbit) -> Self {
        let places = orbit.places.iter().map(|place| (place.amplitude(), place.first_harmonic)).collect();
        BranchPoint { omega: orbit.omega, start: orbit.initial_state.clone(), places }
    }

    /// Tells whether an orbit can be the next one of the branch.
    fn may_precede(&self, orbit: &Orbit) -> bool {
        self.is_near(&BranchPoint::new(orbit))
    }

    /// Tells whether amplitudes and phases differ little.
    fn is_near(&self, other: &BranchPoint) -> bool {
        let pairs = || self.places.iter().zip(&other.places);
        let largest = pairs().fold(0.0f64, |largest, (a, b)| largest.max(a.0).max(b.0));
        pairs().all(|(a, b)| (a.0 - b.0).abs().max((a.1 - b.1).norm()) <= MAX_CHANGE * largest)
    }
}

impl BranchFollower<'_> {
    fn solve(&mut self, omega: f64, start: Option<&[f64]>, between: bool) -> Result<Orbit, OrbitError> {
        if between { self.solver.orbit_without_estimate(omega, start) } else { self.solver.orbit(omega, start) }
    }

    fn next(&mut self, omega: f64, start: Option<&[f64]>, between: bool) -> Result<Orbit, OrbitError> {
        let mut found = self.solve(omega, start, between);
        let known = [&self.last, &self.announced].into_iter().flatten().find(|last| start == Some(&last.start[..]));
        if let (Some(last), Ok(orbit)) = (known, &found)
            && !self.work_limit_reached
            && !last.may_precede(orbit)
            && self.end.as_ref().is_none_or(|end| !end.lies_between(last, omega))
            && let Some(orbit) = self.followed(last.clone(), omega, between)
        {
            found = Ok(orbit);
        }
        self.last = found.as_ref().ok().map(BranchPoint::new);
        found
    }

    /// Returns the orbit at `omega` if smaller steps reach it.
    fn followed(&mut self, mut last: BranchPoint, omega: f64, between: bool) -> Option<Orbit> {
        let from = last.omega;
        let (mut at, mut step, mut effort) = (0.0, 0.5, 0.0);
        let mut beyond;
        // Maximum number of steps in an interval.
        for _ in 0..80 {
            let share: f64 = at + step;
            let arrives = share >= 1.0;
            let target = if arrives { omega } else { from + share * (omega - from) };
            let found = self.solve(target, Some(&last.start), between || !arrives);
            effort += self.solver.work_fraction();
            // Work limit of all steps in an interval, as a fraction of the work limit of a
            // point. After it is exceeded, no interval is repeated in smaller steps.
            self.work_limit_reached =
                effort > 0.3 || matches!(found, Err(OrbitError::NotConverged { work_limit_reached: true, .. }));
            match found.ok().filter(|orbit| last.may_precede(orbit)) {
                Some(orbit) if arrives => return Some(orbit),
                _ if self.work_limit_reached => return None,
                Some(orbit) => (last, at, step, beyond) = (BranchPoint::new(&orbit), share, 2.0 * step, omega),
                None => (step, beyond) = (0.5 * step, target),
            }
            step = step.min(1.0 - at);
            // A step below this fraction of the interval is not halved again: the branch ends or
            // turns there.
            if step < (1.0 / 512.0) {
                self.end = Some(BranchEnd { last, beyond });
                return None;
            }
        }
        None
    }
}

impl Solver for BranchFollower<'_> {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.next(omega, start, false)
    }

    fn orbit_without_estimate(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.next(omega, start, true)
    }

    fn work_fraction(&self) -> f64 {
        self.solver.work_fraction()
    }

    fn begin_branch(&mut self, omega: f64, start: &[f64]) {
        if [&self.last, &self.announced].into_iter().flatten().all(|last| last.start != start) {
            let orbit = self.solver.orbit_without_estimate(omega, Some(start));
            self.announced = orbit.ok().map(|orbit| BranchPoint { start: start.to_vec(), ..BranchPoint::new(&orbit) });
        }
        self.solver.begin_branch(omega, start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::event_driven::EventDriven;
    use std::f64::consts::TAU;

    /// Finds the requested orbits. Each search between them takes `effort`, and fails if that is
    /// the whole work limit of a point.
    struct Slow<'a> {
        solver: Box<dyn Solver + Send + 'a>,
        effort: f64,
        asked: std::sync::Arc<std::sync::atomic::AtomicUsize>,
    }

    impl Solver for Slow<'_> {
        fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
            self.solver.orbit(omega, start)
        }
        fn orbit_without_estimate(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
            self.asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            if self.effort < 1.0 {
                return self.solver.orbit_without_estimate(omega, start);
            }
            let (iterations, residual, advice) = (9, 1e-2, String::new());
            Err(OrbitError::NotConverged {
                method: "slow",
                omega,
                iterations,
                residual,
                work_limit_reached: true,
                advice,
            })
        }
        fn work_fraction(&self) -> f64 {
            self.effort
        }
    }

    /// Counts the searches between three orbits that are far apart, for a given effort.
    fn searches(effort: f64) -> usize {
        let system = crate::model::example::blade_couple().assemble().unwrap();
        let asked = std::sync::Arc::default();
        let solver = EventDriven.solver(&system).unwrap();
        let solver = Slow { solver, effort, asked: std::sync::Arc::clone(&asked) };
        let mut onward = BranchFollower {
            solver: Box::new(solver),
            last: None,
            announced: None,
            end: None,
            work_limit_reached: false,
        };
        let mut start: Option<Vec<f64>> = None;
        let mut amplitudes = Vec::new();
        for hertz in [119.5, 120.5, 121.5] {
            let orbit = onward.orbit(TAU * hertz, start.as_deref()).unwrap();
            amplitudes.push(orbit.places[0].amplitude());
            start = Some(orbit.initial_state);
        }
        assert!(amplitudes.windows(2).all(|pair| (pair[0] / pair[1] - 1.0).abs() > MAX_CHANGE), "{amplitudes:?}");
        asked.load(std::sync::atomic::Ordering::Relaxed)
    }

    /// A branch that ends at a frequency, and another branch beyond it.
    struct Ends<'a> {
        solver: Box<dyn Solver + Send + 'a>,
        end: f64,
        asked: std::sync::Arc<std::sync::atomic::AtomicUsize>,
    }

    impl Solver for Ends<'_> {
        fn orbit(&mut self, omega: f64, _: Option<&[f64]>) -> Result<Orbit, OrbitError> {
            self.asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            let other = if omega < self.end { 0.0 } else { 50.0 };
            self.solver.orbit(omega + other, None).map(|orbit| Orbit { omega, ..orbit })
        }
    }

    #[test]
    fn the_end_of_a_branch_is_located_once() {
        let system = crate::model::example::blade_couple().assemble().unwrap();
        let asked: std::sync::Arc<std::sync::atomic::AtomicUsize> = std::sync::Arc::default();
        let from = TAU * 119.5;
        let solver = EventDriven.solver(&system).unwrap();
        let solver = Ends { solver, end: from + 0.2, asked: std::sync::Arc::clone(&asked) };
        let mut onward = BranchFollower {
            solver: Box::new(solver),
            last: None,
            announced: None,
            end: None,
            work_limit_reached: false,
        };
        let start = onward.orbit(from, None).unwrap().initial_state;
        let count = || asked.load(std::sync::atomic::Ordering::Relaxed);
        let mut searches = |beyond: f64| {
            onward.begin_branch(from, &start);
            let before = count();
            onward.orbit_without_estimate(from + beyond, Some(&start)).unwrap();
            count() - before
        };
        // The first interval locates the end. The next two contain the known end and take one
        // search each. A target before the recorded frequency is followed again.
        let found = [1.0, 0.9, 0.5].map(&mut searches);
        assert!(found[0] > 6 && found[1..] == [1, 1], "{found:?}");
        assert!(searches(0.2001) > 1);
    }

    #[test]
    fn no_interval_is_repeated_after_the_work_limit() {
        assert!(searches(0.0) > 6, "the intervals must need searches");
        assert_eq!((searches(1.0), searches(0.2)), (1, 2));
    }
}
