//! Branch following: finds the next orbit of a curve on the branch of the previous one.
//!
//! If several orbits exist at a frequency, a search from a distant initial guess can converge to
//! another branch. The curve then jumps although its branch continues. If an orbit differs much
//! from its initial guess, the solver repeats the interval in smaller steps. Either these steps
//! reach the frequency, or the branch ends between both frequencies.

use crate::method::{
    Budget, ErrorEstimate, Method, MethodError, OrbitError, Request, Solver, solver_with_alternatives,
};
use crate::model::System;
use crate::orbit::{Orbit, Seed};

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

/// Returns a solver for [`solve_sequence`](super::sweep::solve_sequence). For systems that use
/// branch following, it continues the branch of its seed in smaller steps before it changes to
/// another branch; otherwise it is the method's own solver.
///
/// # Errors
/// The method does not support the system.
pub fn solver<'a>(method: &dyn Method, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
    let solver = solver_with_alternatives(method, system)?;
    Ok(if is_followed(system) {
        Box::new(BranchFollower { solver, end: None, work_limit_reached: false })
    } else {
        solver
    })
}

struct BranchFollower<'a> {
    solver: Box<dyn Solver + Send + 'a>,
    /// The end of a branch at which smaller steps failed.
    end: Option<BranchEnd>,
    /// True after the steps in an interval exceeded the work limit. No interval is repeated
    /// after that.
    work_limit_reached: bool,
}

/// The end of a branch: the last orbit on it, and a nearby frequency (rad/s) at which the branch
/// has no orbit.
struct BranchEnd {
    last: Seed,
    beyond: f64,
}

impl BranchEnd {
    /// Tells whether the interval from an orbit to a frequency contains this end.
    fn lies_between(&self, from: &Seed, omega: f64) -> bool {
        let ahead = (self.beyond - self.last.omega).signum();
        (self.beyond - from.omega) * ahead > 0.0 && (omega - self.beyond) * ahead >= 0.0 && is_near(from, &self.last)
    }
}

/// Tells whether amplitudes and phases of two orbits differ little.
fn is_near(one: &Seed, other: &Seed) -> bool {
    let pairs = || one.places.iter().zip(&other.places);
    let largest = pairs().fold(0.0f64, |largest, (a, b)| largest.max(a.0).max(b.0));
    pairs().all(|(a, b)| (a.0 - b.0).abs().max((a.1 - b.1).norm()) <= MAX_CHANGE * largest)
}

impl BranchFollower<'_> {
    /// Returns the orbit of a request if smaller steps from the orbit `last` reach it.
    fn followed(&mut self, request: &Request<'_>, last: &Seed, budget: &mut Budget) -> Option<Orbit> {
        let (from, omega, mut last) = (last.omega, request.omega, last.clone());
        let (mut at, mut step) = (0.0, 0.5);
        let mut beyond;
        // Maximum number of steps in an interval.
        for _ in 0..80 {
            let share: f64 = at + step;
            let arrives = share >= 1.0;
            let target = if arrives { omega } else { from + share * (omega - from) };
            let estimate = if arrives { request.estimate } else { ErrorEstimate::Skipped };
            let found = self.solver.solve(&Request { omega: target, seed: Some(&last), estimate }, budget);
            // After the work limit of all steps of an interval, no interval is repeated in smaller
            // steps.
            self.work_limit_reached =
                budget.is_used_up() || matches!(found, Err(OrbitError::NotConverged { work_limit_reached: true, .. }));
            let next = found.ok().map(|orbit| (orbit.seed(), orbit));
            match next.filter(|(seed, _)| is_near(&last, seed)) {
                Some((_, orbit)) if arrives => return Some(orbit),
                _ if self.work_limit_reached => return None,
                Some((seed, _)) => (last, at, step, beyond) = (seed, share, 2.0 * step, omega),
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
    fn solve(&mut self, request: &Request<'_>, budget: &mut Budget) -> Result<Orbit, OrbitError> {
        let found = self.solver.solve(request, budget);
        let known = request.seed.filter(|seed| !seed.places.is_empty());
        if let (Some(last), Ok(orbit)) = (known, &found)
            && !self.work_limit_reached
            && !is_near(last, &orbit.seed())
            && self.end.as_ref().is_none_or(|end| !end.lies_between(last, request.omega))
        {
            // no interval takes more, and none is repeated after one that did
            let mut steps = budget.part(0.3);
            let followed = self.followed(request, last, &mut steps);
            budget.charge(steps.used());
            return followed.map_or(found, Ok);
        }
        found
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
        fn solve(&mut self, request: &Request<'_>, budget: &mut Budget) -> Result<Orbit, OrbitError> {
            if request.estimate == ErrorEstimate::Required {
                return self.solver.solve(request, budget);
            }
            self.asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            budget.charge(self.effort);
            if self.effort < 1.0 {
                return self.solver.solve(request, budget);
            }
            Err(OrbitError::NotConverged {
                method: "slow",
                omega: request.omega,
                iterations: 9,
                residual: 1e-2,
                work_limit_reached: true,
                advice: String::new(),
            })
        }
    }

    /// Counts the searches between three orbits that are far apart, for a given effort.
    fn searches(effort: f64) -> usize {
        let system = crate::model::example::blade_couple().assemble().unwrap();
        let asked = std::sync::Arc::default();
        let solver = EventDriven.solver(&system).unwrap();
        let solver = Slow { solver, effort, asked: std::sync::Arc::clone(&asked) };
        let mut follower = BranchFollower { solver: Box::new(solver), end: None, work_limit_reached: false };
        let mut seed: Option<Seed> = None;
        let mut amplitudes = Vec::new();
        for hertz in [119.5, 120.5, 121.5] {
            let request = Request::at(TAU * hertz).near(seed.as_ref());
            let orbit = follower.solve(&request, &mut Budget::default()).unwrap();
            amplitudes.push(orbit.places[0].amplitude());
            seed = Some(orbit.seed());
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
        fn solve(&mut self, request: &Request<'_>, _budget: &mut Budget) -> Result<Orbit, OrbitError> {
            self.asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            let other = if request.omega < self.end { 0.0 } else { 50.0 };
            self.solver.orbit(request.omega + other).map(|orbit| Orbit { omega: request.omega, ..orbit })
        }
    }

    #[test]
    fn the_end_of_a_branch_is_located_once() {
        let system = crate::model::example::blade_couple().assemble().unwrap();
        let asked: std::sync::Arc<std::sync::atomic::AtomicUsize> = std::sync::Arc::default();
        let from = TAU * 119.5;
        let solver = EventDriven.solver(&system).unwrap();
        let solver = Ends { solver, end: from + 0.2, asked: std::sync::Arc::clone(&asked) };
        let mut follower = BranchFollower { solver: Box::new(solver), end: None, work_limit_reached: false };
        let seed = follower.orbit(from).unwrap().seed();
        let count = || asked.load(std::sync::atomic::Ordering::Relaxed);
        let mut searches = |beyond: f64| {
            let before = count();
            let request = Request::at(from + beyond).near(Some(&seed)).without_estimate();
            follower.solve(&request, &mut Budget::default()).unwrap();
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
