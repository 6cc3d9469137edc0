//! Number of harmonics of an orbit: the user's, or doubled until the estimated error meets the
//! tolerance.

use super::truncation_error::{ComparedSolution, truncation_error};
use crate::method::OrbitError;
use crate::method::harmonic_balance::aft::Port;
use crate::method::harmonic_balance::budget::WorkShare;
use crate::method::harmonic_balance::equations::{self, Discretization, HarmonicSolution};
use crate::method::harmonic_balance::globalization::SearchSettings;
use crate::method::harmonic_balance::newton::{SolveError, StopCriterion};
use crate::method::harmonic_balance::options::{NAME, TOLERANCE};
use crate::method::harmonic_balance::postprocess::mean_forces_balance;
use crate::method::harmonic_balance::settings::WorkSettings;
use crate::method::harmonic_balance::solver::HarmonicBalanceSolver;
use crate::orbit::Orbit;
use nalgebra::DVector;
use num_complex::Complex64;
use std::iter::successors;

/// Settings of the choice of the number of harmonics.
#[derive(Debug, Clone, Copy)]
struct RefinementSettings {
    /// Highest harmonic that the method chooses. The error estimate takes twice as many.
    most_harmonics: usize,
    /// Highest order at which the truncation error of rigid friction decays with the number of
    /// harmonics. Orders of 1 to 3/2 are usual, see [`truncation_error`]. The larger value avoids
    /// that a sufficient series is refused: 80 masses had an error of 3.0e-3 with 31 harmonics and
    /// less than 1e-3 with 63.
    order: f64,
    /// Least share of the previous error estimate that remains after a doubling with rigid or
    /// steep friction. A smaller distance is not believed, because two solutions may be close by
    /// chance: a distance of 1.3e-3 was seen with an error of 1e-2.
    least_error_ratio: f64,
    /// Largest error estimate, in tolerances, with which an orbit is still returned, as truncated.
    /// Default 10: errors up to 1 % are usable, and a series with larger ones may show another
    /// motion.
    accepted_error: f64,
    /// Reduction of the residual to which the finer solution of an error estimate is solved. The
    /// relative error of the estimate is about as large. With elastic friction one Newton step
    /// reaches it.
    estimate_reduction: f64,
}

impl Default for RefinementSettings {
    fn default() -> Self {
        RefinementSettings {
            most_harmonics: 511,
            order: 2.0,
            least_error_ratio: 0.1,
            accepted_error: 10.0,
            estimate_reduction: 1e-3,
        }
    }
}

impl HarmonicBalanceSolver {
    /// Finds the orbit with the user's number of harmonics and estimates its error.
    pub(crate) fn with_given_harmonics(
        &mut self,
        top: usize,
        omega: f64,
        warm: Option<(usize, HarmonicSolution)>,
    ) -> Result<Orbit, OrbitError> {
        let motion = self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.solve_error(l))?;
        let x = self.places(top, omega, &motion).map_err(|l| self.solve_error(l))?;
        let truncation = if self.can_estimate_error(top, WorkShare::default()) {
            // the orbit is found; its error estimate gets a budget as large as that of a point
            self.discretizations.values_mut().for_each(Discretization::begin_point);
            self.estimate_error(top, omega, &motion, &x).ok().map(|(error, _)| error)
        } else {
            None
        };
        self.make_orbit(top, omega, motion, x, truncation)
    }

    /// Returns the truncation error of `motion` and the finer solution from which it is
    /// estimated.
    ///
    /// The finer solution has twice the harmonics. For laws with memory it also has twice the
    /// samples.
    pub(crate) fn estimate_error(
        &mut self,
        top: usize,
        omega: f64,
        motion: &HarmonicSolution,
        x: &[DVector<Complex64>],
    ) -> Result<(f64, HarmonicSolution), SolveError> {
        let settings = RefinementSettings::default();
        let double = self.harmonic_set.doubled(top);
        let (few, many) = (self.harmonic_set.up_to(top), self.harmonic_set.up_to(double));
        let coarse = equations::with_harmonics(motion, &few, &many);
        let states = self.discretizations.get(&top).map(|discretization| discretization.search.states.clone());
        self.discretization(double, omega)?;
        let finer = self.discretizations.get_mut(&double).expect("made above");
        finer.work.extends_shorter = true;
        let goal = if self.ports.iter().any(Port::has_memory_steps) {
            StopCriterion::Solved
        } else {
            StopCriterion::Share(settings.estimate_reduction)
        };
        let better = match finer.solve_twice_the_samples(&self.ports, omega, &coarse, states.as_deref()) {
            Some(better) => better,
            None => {
                let settings = SearchSettings { goal, ..SearchSettings::default() };
                let solved = finer.solve_with(&self.ports, omega, coarse.clone(), settings)?;
                finer
                    .correct_twice_the_samples(&self.ports, omega, &solved, &coarse)
                    .map_or(solved, |(motion, _)| motion)
            }
        };
        let y = self.places(double, omega, &better)?;
        let finer = self.discretizations.get_mut(&double).expect("solved");
        let coarse = ComparedSolution { harmonics: &few, places: x, along: &motion.c };
        let at = (self.harmonic_set, omega, self.steep);
        let error = truncation_error(
            self.system.place_axes(),
            &self.ports,
            &self.receptance,
            at,
            &coarse,
            (finer, &better, &y),
        );
        Ok((error, better))
    }

    /// Returns the first doubled number of harmonics that may meet the tolerance with rigid
    /// friction. `times` is the ratio of the error at `top` to the tolerance.
    pub(crate) fn needed_harmonics(&self, top: usize, times: f64) -> usize {
        let settings = RefinementSettings::default();
        let least = top as f64 * times.powf(1.0 / settings.order);
        let doubled = successors(Some(top), |top| Some(self.harmonic_set.doubled(*top)));
        doubled
            .skip(1)
            .find(|top| *top as f64 >= least || *top > settings.most_harmonics * self.harmonic_set.count_factor)
            .expect("they grow")
    }

    /// Returns true if a series with twice the harmonics can be solved and compared.
    fn can_double(&self, top: usize) -> bool {
        let settings = RefinementSettings::default();
        let double = self.harmonic_set.doubled(top);
        double <= settings.most_harmonics * self.harmonic_set.count_factor
            && self.can_estimate_error(double, self.work_used(None))
    }

    /// Doubles the harmonics until the tolerance is met.
    ///
    /// The result is not the finest solution, but the last one whose error is known.
    pub(crate) fn with_chosen_harmonics(
        &mut self,
        top: usize,
        omega: f64,
        warm: Option<(usize, HarmonicSolution)>,
    ) -> Result<Orbit, OrbitError> {
        let mut inaccurate = None;
        // if the error by the time integration exceeds the tolerance, the orbit is still returned,
        // and its evidence shows it
        self.double_until_tolerance(top, omega, warm, &mut inaccurate).or_else(|error| inaccurate.ok_or(error))
    }

    /// Doubles the harmonics. `inaccurate` keeps an orbit whose error by the time integration
    /// exceeds the tolerance.
    fn double_until_tolerance(
        &mut self,
        mut top: usize,
        omega: f64,
        warm: Option<(usize, HarmonicSolution)>,
        inaccurate: &mut Option<Orbit>,
    ) -> Result<Orbit, OrbitError> {
        let settings = RefinementSettings::default();
        let tolerance = self.method.tolerance.unwrap_or(TOLERANCE);
        let first = top;
        let mut motion =
            self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.solve_error(l))?;
        let mut x = self.places(top, omega, &motion).map_err(|l| self.solve_error(l))?;
        // the error is unknown until two solutions can be compared
        let (mut checked, mut estimate) = (top, 1.0);
        let mut needed = None;
        while top <= settings.most_harmonics * self.harmonic_set.count_factor
            && self.can_estimate_error(top, self.work_used(None))
        {
            let (mut error, finer) = match self.estimate_error(top, omega, &motion, &x) {
                Ok(compared) => compared,
                // the error of the last solution is known
                Err(_) if top > first && self.ports.has_forces() => {
                    needed = self.is_budget_used().then(|| self.harmonic_set.doubled(top));
                    break;
                }
                Err(_) if top > first && !self.is_budget_used() => break,
                Err(error) => return Err(self.solve_error(error)),
            };
            // a body that drifts may have a periodic solution with few harmonics, and one that does
            // not drift may lack it, so only longer series decide
            let structure = (&*self.system, &self.ports, &self.receptance);
            if top > first && !mean_forces_balance(structure, &self.discretizations[&top], &motion, &x) {
                *inaccurate = None;
                return Err(OrbitError::drift(NAME, self.excitation_frequency));
            }
            if (self.ports.has_forces() || self.steep) && top > first {
                error = error.max(settings.least_error_ratio * estimate);
            }
            // friction that falls with velocity makes chance agreement frequent, so one
            // comparison is not enough
            let shown = top > first || !(self.steep && self.ports.has_falling());
            if error <= tolerance && shown {
                let orbit = self.make_orbit(top, omega, motion.clone(), x.clone(), Some(error))?;
                let judged = orbit.evidence.error_estimate.unwrap_or(error);
                let before = inaccurate.as_ref().and_then(|orbit| orbit.evidence.error_estimate);
                let closer = before.is_none_or(|before| judged <= 0.5 * before);
                if judged <= tolerance || !closer || !self.can_double(top) {
                    return Ok(orbit);
                }
                if inaccurate.is_none() {
                    self.limit = Some(self.work_used(None).times(WorkSettings::default().improvement));
                }
                *inaccurate = Some(orbit);
                error = judged;
            }
            (checked, estimate) = (top, error);
            if self.ports.has_forces() && top > first {
                let enough = self.needed_harmonics(top, error / tolerance);
                if !self.can_estimate_error(enough, self.work_used(None)) {
                    needed = Some(enough);
                    break;
                }
            }
            top = self.harmonic_set.doubled(top);
            // the comparison solved the finer series less accurately, or with other samples
            motion = self.solve(top, omega, Some((top, &finer))).map_err(|l| self.solve_error(l))?;
            x = self.places(top, omega, &motion).map_err(|l| self.solve_error(l))?;
        }
        if estimate <= settings.accepted_error * tolerance {
            return self.make_orbit(top, omega, motion, x, Some(estimate));
        }
        let harmonics = checked / self.periods;
        let state =
            self.orbit_of(top, omega, &motion, x, None).map_or_else(|_| Vec::new(), |orbit| orbit.initial_state);
        Err(OrbitError::Truncation {
            method: NAME,
            omega: self.excitation_frequency,
            harmonics,
            needed: needed.map(|needed| needed / self.periods),
            estimate,
            tolerance,
            state,
            advice: String::new(),
        })
    }
}
