//! How many harmonics an orbit has: the user's, or as many as the tolerance needs; and the error that they leave.

use super::balance::Balance;
use super::budget::Work;
use super::equations::{self, Level, Solution};
use super::estimate::{Compared, estimate};
use super::options::{NAME, TOLERANCE};
use super::ports::Port;
use super::solve::{Goal, Lost};
use crate::method::OrbitError;
use crate::orbit::Orbit;
use nalgebra::DVector;
use num_complex::Complex64;
use std::iter::successors;

/// Highest harmonic that the program chooses itself; it is checked with twice as many.
const MOST: usize = 511;
/// Power of the number of harmonics by which the error of rigid friction falls at most: no series is refused that may be long enough. Between 1 and 3/2 are
/// usual, see [`estimate`]; 80 masses left 3.0e-3 with 31 harmonics and less than 1e-3 with 63.
const ORDER: f64 = 2.0;
/// Where friction is rigid or steep, one doubling is not believed to have left less than this share of the distance of the one before: two
/// motions may be near each other by chance, as 1.3e-3 where the error is 1e-2.
const CHANCE: f64 = 0.1;
/// Share of the residual that a shorter series leaves in the longer one to which that is solved for an estimate of the error: the estimate is off by about as
/// much of itself. One step of Newton's method leaves less where friction is elastic, so that the second one is spared.
const KNOWN: f64 = 1e-3;

impl Balance {
    /// The user's number of harmonics, with an estimate of its error.
    pub(super) fn fixed(
        &mut self,
        top: usize,
        omega: f64,
        warm: Option<(usize, Solution)>,
    ) -> Result<Orbit, OrbitError> {
        let motion = self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.lost(l))?;
        let x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        let truncation = if self.can_compare(top, Work::default()) {
            // what was asked for is there: its error may take as much again
            self.levels.values_mut().for_each(Level::begin_point);
            self.compare(top, omega, &motion, &x).ok().map(|(error, _)| error)
        } else {
            None
        };
        self.finish(top, omega, motion, x, truncation)
    }

    /// Error of `motion` by one with twice the harmonics, and of laws with a memory with twice the samples too, which is returned.
    pub(super) fn compare(
        &mut self,
        top: usize,
        omega: f64,
        motion: &Solution,
        x: &[DVector<Complex64>],
    ) -> Result<(f64, Solution), Lost> {
        let double = self.kept.double(top);
        let start = self.refined(top, motion);
        let (few, many) = (self.kept.up_to(top), self.kept.up_to(double));
        let coarse = equations::transfer(motion, &few, &many);
        let states = self.levels.get(&top).map(|level| level.states.clone());
        self.level(double, omega)?;
        let finer = self.levels.get_mut(&double).expect("made above");
        finer.prolongs = true;
        let goal = if self.ports.iter().any(Port::marches) { Goal::Solved } else { Goal::Share(KNOWN) };
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
        let coarse = Compared { harmonics: &few, places: x, along: &motion.c };
        let at = (self.kept, omega, self.steep);
        let error = estimate(self.system.seen(), &self.ports, &self.rest, at, &coarse, (finer, &better, &y));
        Ok((error, better))
    }

    /// A start with twice the harmonics: a solution, and what these added to the last one that was compared.
    pub(super) fn refined(&self, top: usize, motion: &Solution) -> Solution {
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

    /// The first of the doubled numbers of harmonics that may leave no more than the tolerance of rigid friction, where `top` leave so many times as much.
    pub(super) fn needed(&self, top: usize, times: f64) -> usize {
        let least = top as f64 * times.powf(1.0 / ORDER);
        let doubled = successors(Some(top), |top| Some(self.kept.double(*top)));
        doubled.skip(1).find(|top| *top as f64 >= least || *top > MOST * self.kept.scale).expect("they grow")
    }

    /// Whether a series with twice the harmonics can be solved and compared.
    fn can_go_on(&self, top: usize) -> bool {
        let double = self.kept.double(top);
        double <= MOST * self.kept.scale && self.can_compare(double, self.taken(None))
    }

    /// As many harmonics as the tolerance needs. The solution that is returned is not the finest that was found, but the one whose error
    /// is known from it.
    pub(super) fn chosen(
        &mut self,
        top: usize,
        omega: f64,
        warm: Option<(usize, Solution)>,
    ) -> Result<Orbit, OrbitError> {
        let mut returned = None;
        // an orbit whose return is farther away than allowed is better than none, and says so
        self.doubled(top, omega, warm, &mut returned).or_else(|error| returned.ok_or(error))
    }

    fn doubled(
        &mut self,
        mut top: usize,
        omega: f64,
        warm: Option<(usize, Solution)>,
        returned: &mut Option<Orbit>,
    ) -> Result<Orbit, OrbitError> {
        let tolerance = self.method.tolerance.unwrap_or(TOLERANCE);
        let first = top;
        let mut motion = self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.lost(l))?;
        let mut x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        // nothing is known of the error until two solutions can be compared
        let (mut checked, mut estimate) = (top, 1.0);
        let mut needed = None;
        while top <= MOST * self.kept.scale && self.can_compare(top, self.taken(None)) {
            let (mut error, finer) = match self.compare(top, omega, &motion, &x) {
                Ok(compared) => compared,
                // what was found has an error that is known
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
            // where friction falls with velocity chance is frequent: the first distance has none before it that would show it
            let shown = top > first || !(self.steep && self.ports.has_falling());
            if error <= tolerance && shown {
                let orbit = self.finish(top, omega, motion.clone(), x.clone(), Some(error))?;
                let judged = orbit.evidence.truncation.unwrap_or(error);
                let before = returned.as_ref().and_then(|orbit| orbit.evidence.truncation);
                let closer = before.is_none_or(|before| judged <= 0.5 * before);
                if judged <= tolerance || !closer || !self.can_go_on(top) {
                    return Ok(orbit);
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
            // the finer one is solved as far as the error asks for, or by other samples
            motion = self.solve(top, omega, Some((top, &finer))).map_err(|l| self.lost(l))?;
            x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        }
        let harmonics = checked / self.periods;
        let state = self.orbit_of(top, omega, &motion, x, None).map_or_else(|_| Vec::new(), |orbit| orbit.start);
        Err(OrbitError::Truncation {
            method: NAME,
            omega: self.drive,
            harmonics,
            needed: needed.map(|needed| needed / self.periods),
            estimate,
            tolerance,
            state,
            instead: String::new(),
        })
    }
}
