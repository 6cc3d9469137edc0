//! Number of harmonics of an orbit: the user's, or doubled until the estimated error meets the
//! tolerance.

use super::truncation_error::{ComparedSolution, estimate};
use crate::method::OrbitError;
use crate::method::harmonic_balance::aft::Port;
use crate::method::harmonic_balance::budget::{self, WorkShare};
use crate::method::harmonic_balance::equations::{self, Discretization, HarmonicSolution};
use crate::method::harmonic_balance::newton::{SolveError, StopCriterion};
use crate::method::harmonic_balance::options::{NAME, TOLERANCE};
use crate::method::harmonic_balance::solver::HarmonicBalanceSolver;
use crate::orbit::Orbit;
use nalgebra::DVector;
use num_complex::Complex64;
use std::iter::successors;

/// Highest harmonic that the method chooses. The error estimate takes twice as many.
const MOST: usize = 511;
/// Highest order at which the truncation error of rigid friction decays with the number of
/// harmonics. Orders of 1 to 3/2 are usual, see [`estimate`]. The larger value avoids that a
/// sufficient series is refused: 80 masses had an error of 3.0e-3 with 31 harmonics and less
/// than 1e-3 with 63.
const ORDER: f64 = 2.0;
/// Least share of the previous error estimate that remains after a doubling with rigid or steep
/// friction. A smaller distance is not believed, because two solutions may be close by chance: a
/// distance of 1.3e-3 was seen with an error of 1e-2.
const CHANCE: f64 = 0.1;
/// Reduction of the residual to which the finer solution of an error estimate is solved. The
/// relative error of the estimate is about as large. With elastic friction one Newton step
/// reaches it.
const KNOWN: f64 = 1e-3;

impl HarmonicBalanceSolver {
    /// Finds the orbit with the user's number of harmonics and estimates its error.
    pub(crate) fn fixed(
        &mut self,
        top: usize,
        omega: f64,
        warm: Option<(usize, HarmonicSolution)>,
    ) -> Result<Orbit, OrbitError> {
        let motion = self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.lost(l))?;
        let x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        let truncation = if self.can_compare(top, WorkShare::default()) {
            // the orbit is found; its error estimate gets a budget as large as that of a point
            self.levels.values_mut().for_each(Discretization::begin_point);
            self.compare(top, omega, &motion, &x).ok().map(|(error, _)| error)
        } else {
            None
        };
        self.finish(top, omega, motion, x, truncation)
    }

    /// Returns the truncation error of `motion` and the finer solution from which it is
    /// estimated.
    ///
    /// The finer solution has twice the harmonics. For laws with memory it also has twice the
    /// samples.
    pub(crate) fn compare(
        &mut self,
        top: usize,
        omega: f64,
        motion: &HarmonicSolution,
        x: &[DVector<Complex64>],
    ) -> Result<(f64, HarmonicSolution), SolveError> {
        let double = self.kept.double(top);
        let start = self.refined(top, motion);
        let (few, many) = (self.kept.up_to(top), self.kept.up_to(double));
        let coarse = equations::transfer(motion, &few, &many);
        let states = self.levels.get(&top).map(|level| level.states.clone());
        self.level(double, omega)?;
        let finer = self.levels.get_mut(&double).expect("made above");
        finer.prolongs = true;
        let goal =
            if self.ports.iter().any(Port::marches) { StopCriterion::Solved } else { StopCriterion::Share(KNOWN) };
        let better = match finer.approach_by_twice_the_samples(&self.ports, omega, &start, &coarse, states.as_deref()) {
            Some(better) => better,
            None => {
                let solved = finer.solve_to(&self.ports, omega, start, goal)?;
                finer.by_twice_the_samples(&self.ports, omega, &solved, &coarse).map_or(solved, |(motion, _)| motion)
            }
        };
        if finer.is_coupled() {
            self.compared.insert(top, [motion.clone(), better.clone()]);
        }
        let y = self.places(double, omega, &better)?;
        let finer = self.levels.get_mut(&double).expect("solved");
        let coarse = ComparedSolution { harmonics: &few, places: x, along: &motion.c };
        let at = (self.kept, omega, self.steep);
        let error = estimate(self.system.place_axes(), &self.ports, &self.rest, at, &coarse, (finer, &better, &y));
        Ok((error, better))
    }

    /// Returns an initial guess with twice the harmonics.
    ///
    /// It is the solution plus the correction that the finer series made at the last
    /// comparison.
    pub(crate) fn refined(&self, top: usize, motion: &HarmonicSolution) -> HarmonicSolution {
        let harmonics = |top: usize| self.kept.up_to(top);
        let (few, many) = (harmonics(top), harmonics(self.kept.double(top)));
        let mut start = equations::transfer(motion, &few, &many);
        if let Some([coarse, fine]) = self.compared.get(&top) {
            let coarse = equations::transfer(coarse, &few, &many);
            let add = |to: &mut [Complex64], coarse: &[Complex64], fine: &[Complex64]| {
                to.iter_mut().zip(fine.iter().zip(coarse)).for_each(|(to, (fine, coarse))| *to += fine - coarse);
            };
            add(&mut start.c, &coarse.c, &fine.c);
            add(&mut start.force, &coarse.force, &fine.force);
        }
        start
    }

    /// Returns the first doubled number of harmonics that may meet the tolerance with rigid
    /// friction. `times` is the ratio of the error at `top` to the tolerance.
    pub(crate) fn needed(&self, top: usize, times: f64) -> usize {
        let least = top as f64 * times.powf(1.0 / ORDER);
        let doubled = successors(Some(top), |top| Some(self.kept.double(*top)));
        doubled.skip(1).find(|top| *top as f64 >= least || *top > MOST * self.kept.scale).expect("they grow")
    }

    /// Returns true if a series with twice the harmonics can be solved and compared.
    fn can_go_on(&self, top: usize) -> bool {
        let double = self.kept.double(top);
        double <= MOST * self.kept.scale && self.can_compare(double, self.taken(None))
    }

    /// Doubles the harmonics until the tolerance is met.
    ///
    /// The result is not the finest solution, but the last one whose error is known.
    pub(crate) fn chosen(
        &mut self,
        top: usize,
        omega: f64,
        warm: Option<(usize, HarmonicSolution)>,
    ) -> Result<Orbit, OrbitError> {
        let mut returned = None;
        // if the return defect exceeds the tolerance, the orbit is still returned, and its
        // evidence shows it
        self.doubled(top, omega, warm, &mut returned).or_else(|error| returned.ok_or(error))
    }

    /// Doubles the harmonics. `returned` keeps an orbit whose return defect exceeds the
    /// tolerance.
    fn doubled(
        &mut self,
        mut top: usize,
        omega: f64,
        warm: Option<(usize, HarmonicSolution)>,
        returned: &mut Option<Orbit>,
    ) -> Result<Orbit, OrbitError> {
        let tolerance = self.method.tolerance.unwrap_or(TOLERANCE);
        let first = top;
        let mut motion = self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.lost(l))?;
        let mut x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        // the error is unknown until two solutions can be compared
        let (mut checked, mut estimate) = (top, 1.0);
        let mut needed = None;
        while top <= MOST * self.kept.scale && self.can_compare(top, self.taken(None)) {
            let (mut error, finer) = match self.compare(top, omega, &motion, &x) {
                Ok(compared) => compared,
                // the error of the last solution is known
                Err(_) if top > first && self.ports.has_forces() => {
                    needed = self.is_spent().then(|| self.kept.double(top));
                    break;
                }
                Err(_) if top > first && !self.is_spent() => break,
                Err(lost) => return Err(self.lost(lost)),
            };
            if (self.ports.has_forces() || self.steep) && top > first {
                error = error.max(CHANCE * estimate);
            }
            // friction that falls with velocity makes chance agreement frequent, so one
            // comparison is not enough
            let shown = top > first || !(self.steep && self.ports.has_falling());
            if error <= tolerance && shown {
                let orbit = self.finish(top, omega, motion.clone(), x.clone(), Some(error))?;
                let judged = orbit.evidence.error_estimate.unwrap_or(error);
                let before = returned.as_ref().and_then(|orbit| orbit.evidence.error_estimate);
                let closer = before.is_none_or(|before| judged <= 0.5 * before);
                if judged <= tolerance || !closer || !self.can_go_on(top) {
                    return Ok(orbit);
                }
                if returned.is_none() {
                    self.limit = Some(budget::to_improve(self.taken(None)));
                }
                *returned = Some(orbit);
                error = judged;
            }
            (checked, estimate) = (top, error);
            if self.ports.has_forces() && top > first {
                let enough = self.needed(top, error / tolerance);
                if !self.can_compare(enough, self.taken(None)) {
                    needed = Some(enough);
                    break;
                }
            }
            top = self.kept.double(top);
            // the comparison solved the finer series less accurately, or with other samples
            motion = self.solve(top, omega, Some((top, &finer))).map_err(|l| self.lost(l))?;
            x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        }
        let harmonics = checked / self.periods;
        let state =
            self.orbit_of(top, omega, &motion, x, None).map_or_else(|_| Vec::new(), |orbit| orbit.initial_state);
        Err(OrbitError::Truncation {
            method: NAME,
            omega: self.drive,
            harmonics,
            needed: needed.map(|needed| needed / self.periods),
            estimate,
            tolerance,
            state,
            advice: String::new(),
        })
    }
}
