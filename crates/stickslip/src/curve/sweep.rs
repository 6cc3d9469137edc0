//! Orbits at given frequencies, each with its neighbour as seed.
//!
//! The frequencies are divided into blocks of fixed length. A block begins without a seed
//! and runs in order; blocks run in parallel. The seed of every point is therefore the
//! same for any number of threads, and the results are identical in all bits.
//!
//! At a fold of the curve, the points beyond it have no orbit near the previous one. They are
//! then solved in reverse, from the first orbit found after them. A point that is found from
//! neither side is solved without a seed.

use super::PointBudget;
pub use super::branch_following::solver;
use crate::method::{Method, MethodError, OrbitError, Request, Solver};
use crate::model::System;
use crate::orbit::{Orbit, Seed};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Points per block. A point without a seed costs about as much as five points with one.
pub const BLOCK: usize = 61;

/// Progress and cancellation of a sweep.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// Called once per finished point, from any thread.
    pub finished: &'a (dyn Fn() + Sync),
    /// If true, the sweep ends early; points that were not reached are `None`.
    pub stop: &'a AtomicBool,
}

impl Watch<'static> {
    /// Returns a watch that counts nothing and never stops.
    pub fn none() -> Watch<'static> {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Watch { finished: &|| (), stop: &NEVER }
    }
}

/// Solves `system` at the frequencies `omega(0), …, omega(count - 1)` (rad/s). `row` converts
/// each outcome into the stored result.
///
/// # Errors
/// The method does not support the system.
///
/// # Example
/// ```
/// use std::sync::atomic::AtomicBool;
/// use stickslip::curve::sweep::{Watch, sweep};
/// use stickslip::method::event_driven::EventDriven;
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let watch = Watch { finished: &|| (), stop: &AtomicBool::new(false) };
/// let curve = sweep(&EventDriven, &system, 3, &|i| 760.0 + i as f64, watch, &|_, orbit| {
///     orbit.map(|orbit| orbit.places[0].amplitude()).ok()
/// }).unwrap();
/// assert!(curve.iter().all(|point| point.unwrap().is_some()));
/// ```
pub fn sweep<R: Send>(
    method: &dyn Method,
    system: &System,
    count: usize,
    omega: &(dyn Fn(usize) -> f64 + Sync),
    watch: Watch<'_>,
    row: &(dyn Fn(usize, Result<&Orbit, &OrbitError>) -> R + Sync),
) -> Result<Vec<Option<R>>, MethodError> {
    let blocks: Vec<Result<Vec<Option<R>>, MethodError>> = (0..count.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let range = block * BLOCK..((block + 1) * BLOCK).min(count);
            let mut rows = Vec::with_capacity(range.len());
            solve_sequence(&mut *solver(method, system)?, &mut range.clone().map(omega), watch, &mut |_, outcome| {
                let index = range.start + rows.len();
                rows.push(outcome.map(|outcome| row(index, outcome)));
            });
            Ok(rows)
        })
        .collect();
    let mut all = Vec::with_capacity(count);
    for block in blocks {
        all.extend(block?);
    }
    Ok(all)
}

/// Receives an outcome at a frequency (rad/s); `None` if the sweep was stopped before.
pub type Observer<'a> = dyn FnMut(f64, Option<Result<&Orbit, &OrbitError>>) + 'a;

/// Solves at several frequencies (rad/s) in sequence, each with the previous orbit as seed.
/// Points without an orbit from there are solved in reverse from the next orbit. `see`
/// receives the outcomes in order.
pub fn solve_sequence(
    solver: &mut dyn Solver,
    omegas: &mut dyn Iterator<Item = f64>,
    watch: Watch<'_>,
    see: &mut Observer<'_>,
) {
    let (mut seed, mut budget): (Option<Seed>, _) = (None, PointBudget::default());
    // points without an orbit, until the next orbit is found
    let mut missing: Vec<PendingPoint> = Vec::new();
    let mut omegas = omegas.peekable();
    while let Some(omega) = omegas.next() {
        if watch.stop.load(Ordering::Relaxed) {
            missing.drain(..).for_each(|point| see(point.omega, Some(point.outcome.as_ref())));
            see(omega, None);
            continue;
        }
        let outcome = budget.solve(solver, &Request::at(omega).near(seed.as_ref()));
        let had_seed = seed.is_some();
        (watch.finished)();
        // After a failure, the next point has no seed, because the last orbit may be far away.
        seed = outcome.as_ref().ok().map(Orbit::seed);
        missing.push(PendingPoint { omega, outcome, had_seed });
        if seed.is_none() && omegas.peek().is_some() {
            continue;
        }
        if let Some(behind) = &seed {
            let before = missing.len() - 1;
            solve_missing_in_reverse(solver, &mut budget, behind, &mut missing[..before], watch);
        }
        for point in &mut missing {
            point.solve_without_seed(solver, &mut budget, watch);
            see(point.omega, Some(point.outcome.as_ref()));
        }
        missing.clear();
    }
}

/// Performs a reverse sweep: solves at some frequencies (rad/s) in sequence. The first search
/// begins from the orbit `seed`, each other one from the previous orbit. If several orbits
/// exist, the reverse sweep jumps between branches at other frequencies than the forward sweep.
/// `see` receives the orbits that are found; their errors are not estimated. A failed point is
/// skipped, and the next one is solved without a seed.
///
/// # Errors
/// The method does not support the system.
pub fn reverse_sweep(
    method: &dyn Method,
    system: &System,
    seed: Option<Seed>,
    omegas: &mut dyn Iterator<Item = f64>,
    stop: &AtomicBool,
    see: &mut dyn FnMut(&Orbit),
) -> Result<(), MethodError> {
    let (mut solver, mut budget) = (solver(method, system)?, PointBudget::default());
    let mut seed = seed;
    for omega in omegas {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let request = Request::at(omega).near(seed.as_ref()).without_estimate();
        let found = budget.solve(&mut *solver, &request).ok();
        found.iter().for_each(&mut *see);
        seed = found.as_ref().map(Orbit::seed);
    }
    Ok(())
}

/// A point whose outcome is not yet reported.
struct PendingPoint {
    omega: f64,
    outcome: Result<Orbit, OrbitError>,
    /// True if the search began from the previous orbit.
    had_seed: bool,
}

impl PendingPoint {
    /// Tells whether another initial guess may help. It does not for a series that is too short.
    fn may_succeed_from_another_seed(&self) -> bool {
        self.outcome.as_ref().is_err_and(|error| !matches!(error, OrbitError::Truncation { .. }))
    }

    /// Solves the point without initial guess, if the searches from its neighbours failed.
    fn solve_without_seed(&mut self, solver: &mut dyn Solver, budget: &mut PointBudget, watch: Watch<'_>) {
        if self.had_seed && self.may_succeed_from_another_seed() && !watch.stop.load(Ordering::Relaxed) {
            self.outcome = budget.solve(solver, &Request::at(self.omega)).or(self.outcome.clone());
        }
    }
}

/// Solves the missing points in reverse from the next orbit, until one of them fails.
fn solve_missing_in_reverse(
    solver: &mut dyn Solver,
    budget: &mut PointBudget,
    behind: &Seed,
    missing: &mut [PendingPoint],
    watch: Watch<'_>,
) {
    let mut seed = behind.clone();
    for PendingPoint { omega, outcome, had_seed } in
        missing.iter_mut().rev().take_while(|point| point.may_succeed_from_another_seed())
    {
        if watch.stop.load(Ordering::Relaxed) {
            return;
        }
        match budget.solve(solver, &Request::at(*omega).near(Some(&seed))) {
            Ok(orbit) => {
                seed = orbit.seed();
                *outcome = Ok(orbit);
            }
            Err(error) => {
                // a search that exhausted the work limit is not repeated
                *had_seed &= !matches!(error, OrbitError::NotConverged { work_limit_reached: true, .. });
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::Budget;
    use crate::method::event_driven::EventDriven;

    /// Finds no orbit between the frequencies of `fold` unless the search begins from above.
    #[derive(Debug)]
    struct Folded {
        fold: (f64, f64),
    }

    struct FoldedSolver<'a> {
        solver: Box<dyn Solver + Send + 'a>,
        fold: (f64, f64),
    }

    impl Method for Folded {
        fn name(&self) -> &'static str {
            "folded"
        }
        fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
            Ok(Box::new(FoldedSolver { solver: EventDriven.solver(system)?, fold: self.fold }))
        }
    }

    impl Solver for FoldedSolver<'_> {
        fn solve(&mut self, request: &Request<'_>, budget: &mut Budget) -> Result<Orbit, OrbitError> {
            let omega = request.omega;
            let from_above = request.seed.is_some_and(|seed| seed.omega > omega);
            if omega > self.fold.0 && omega < self.fold.1 && !from_above {
                return Err(OrbitError::not_converged("folded", omega, 1, 1.0));
            }
            self.solver.solve(request, budget)
        }
    }

    fn outcomes(fold: (f64, f64), omegas: &[f64]) -> Vec<(f64, bool)> {
        let system = crate::model::example::blade_couple().assemble().unwrap();
        let watch = Watch { finished: &|| (), stop: &AtomicBool::new(false) };
        let mut seen = Vec::new();
        let mut solver = Folded { fold }.solver(&system).unwrap();
        solve_sequence(&mut *solver, &mut omegas.iter().copied(), watch, &mut |omega, outcome| {
            let outcome = outcome.expect("not stopped");
            if let Ok(orbit) = outcome {
                assert_eq!(orbit.omega, omega);
            }
            seen.push((omega, outcome.is_ok()));
        });
        seen
    }

    #[test]
    fn points_beyond_a_fold_are_solved_in_reverse_and_reported_in_order() {
        let omegas: Vec<f64> = (0..8).map(|i| 750.0 + 5.0 * f64::from(i)).collect();
        let found = outcomes((757.0, 773.0), &omegas);
        assert_eq!(found, omegas.iter().map(|omega| (*omega, true)).collect::<Vec<_>>());
        // no orbit follows the last point
        let lost = outcomes((777.0, 1e3), &omegas);
        assert_eq!(lost, omegas.iter().map(|omega| (*omega, *omega < 777.0)).collect::<Vec<_>>());
    }
}
