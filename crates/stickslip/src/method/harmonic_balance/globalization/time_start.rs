//! Initial guesses from time integration, if neither warm starts nor describing functions lead
//! to an orbit.

use super::found_by::FoundBy;
use crate::method::OrbitError;
use crate::method::harmonic_balance::NAME;
use crate::method::harmonic_balance::equations::HarmonicSolution;
use crate::method::harmonic_balance::solver::HarmonicBalanceSolver;
use crate::method::orbit_search::describing_guess::DescribingGuess;
use crate::method::orbit_search::return_map::APPROACH;
use crate::method::orbit_search::settling::course;
use crate::orbit::{JointSample, ObservedMotion, Orbit, Path};
use num_complex::Complex64;
use std::f64::consts::TAU;

/// Largest number of frequencies at which the motion is integrated after a failure, in each
/// block of a sweep. Each integration takes seconds.
const MOST_FOLLOWED: usize = 8;
/// Largest number of degrees of freedom for time integration. Its steps multiply full matrices.
const MOST_DOFS_IN_TIME: usize = 60;
/// Number of series lengths that are tried from a settled motion, each with twice the
/// harmonics.
const LONGER: usize = 3;
/// Number of returns from the state of another solver's orbit before the motion is read.
/// Newton's method removes the remaining transient.
const LED: usize = 1;

impl HarmonicBalanceSolver {
    /// Returns an initial guess for an orbit of several excitation periods.
    ///
    /// Describing functions know no such orbit, and Newton's method does not leave orbits of one
    /// period. The guess is the motion after [`APPROACH`] returns of time integration. Returns
    /// `None` for orbits of one period, if no integration takes the system, or if motions never
    /// separate, so that no such orbit exists.
    pub(crate) fn approached(
        &mut self,
        top: usize,
        omega: f64,
        guess: Option<&DescribingGuess>,
    ) -> Option<HarmonicSolution> {
        let start = guess.filter(|_| self.periods > 1 && !self.judge.proves())?.state(self.system.dofs());
        let path = self.judge.approach(&self.system, omega, start, APPROACH)?;
        self.series_of(&*path, top, omega)
    }

    /// Returns an initial guess from the state of another solver's orbit.
    ///
    /// A solver knows only the harmonics of the orbits that it found. If motions can separate,
    /// the state selects one of several orbits.
    pub(crate) fn led(&mut self, start: &[f64], omega: f64) -> Option<(usize, HarmonicSolution)> {
        let dofs = self.system.dofs();
        if self.judge.proves() || self.periods > 1 || dofs > MOST_DOFS_IN_TIME || start.len() < 2 * dofs {
            return None;
        }
        let top = self.method.harmonics.unwrap_or(self.first);
        self.level(top, omega).ok()?;
        let path = self.judge.approach(&self.system, omega, start[..2 * dofs].to_vec(), LED)?;
        Some((top, self.series_of(&*path, top, omega)?))
    }

    /// Searches from the motion that time integration reaches from static equilibrium. Returns
    /// `None` if the system is not integrated or the search fails.
    ///
    /// If several orbits exist at the frequency, the integration leads to a stable one.
    pub(crate) fn by_time(&mut self, omega: f64) -> Option<Orbit> {
        // twice the first harmonics, because a shorter series may have a spurious solution
        let top = self.method.harmonics.unwrap_or(self.kept.double(self.first));
        if self.periods > 1 || self.system.dofs() > MOST_DOFS_IN_TIME || self.tried_in_time >= MOST_FOLLOWED {
            return None;
        }
        self.tried_in_time += 1;
        self.level(top, omega).ok()?;
        let path = self.judge.approach(&self.system, omega, self.standing(), APPROACH)?;
        let motion = self.series_of(&*path, top, omega)?;
        self.from(top, omega, Some((top, motion))).ok()
    }

    /// Returns the state of static equilibrium, or the unloaded state if there is none.
    fn standing(&self) -> Vec<f64> {
        self.static_start.clone().unwrap_or_else(|| vec![0.0; 2 * self.system.dofs()])
    }

    /// Returns the harmonics of a motion that was integrated over a period.
    pub(crate) fn series_of(&mut self, path: &dyn Path, top: usize, omega: f64) -> Option<HarmonicSolution> {
        let level = self.levels.get_mut(&top)?;
        let (nh, n) = (level.harmonics().len(), level.alternation.samples());
        let mut motion =
            HarmonicSolution { found_by: FoundBy::TimeIntegration, ..HarmonicSolution::rest(level.linear.len()) };
        let samples: Vec<_> = (0..n).map(|i| path.sample(TAU / omega * i as f64 / n as f64).joints).collect();
        for port in self.ports.iter() {
            for q in port.range() {
                let (joint, axis) = self.ports.place(q);
                // the force of the port does the work of all its joints
                let work = |now: &[JointSample]| -> f64 {
                    port.members.iter().map(|member| member.factor * now[member.joint].force[axis]).sum()
                };
                let force: Vec<f64> = samples.iter().map(|now| work(now)).collect();
                let moved = samples.iter().zip(&force).map(|(now, f)| now[joint].displacement[axis] - f * port.series);
                let range = q * nh..(q + 1) * nh;
                level.alternation.add_signal(&mut moved.collect::<Vec<f64>>(), &mut motion.c[range.clone()]);
                level.alternation.add_signal(&mut force.clone(), &mut motion.force[range]);
            }
        }
        Some(motion)
    }

    /// Integrates in time if only contacts support a body and no orbit was found.
    ///
    /// The search continues from the settled motion. If that fails, the error describes the
    /// motion. Returns `None` if the motion is not integrated.
    pub(crate) fn by_its_course(&mut self, omega: f64) -> Option<Result<Orbit, OrbitError>> {
        let top = self.method.harmonics.unwrap_or(self.first);
        let vibrates = self.system.harmonics_of_excitation(|z| z != Complex64::ZERO).iter().any(|h| *h > 0);
        if self.periods > 1 || !vibrates || !self.levels.get(&top)?.stands() {
            return None;
        }
        let drive = self.drive;
        let no_orbit =
            |course, state| Some(Err(OrbitError::NoOrbit { method: NAME, omega: drive, observed: course, state }));
        if let Some((_, course, state)) = self.followed.iter().find(|(at, ..)| *at == omega) {
            return no_orbit(course.clone(), state.clone());
        }
        if self.followed.len() >= MOST_FOLLOWED {
            return None;
        }
        let (course, path, state) = course(&self.system, omega, self.standing())?;
        if matches!(course, ObservedMotion::Settles | ObservedMotion::Settling { .. }) {
            // contacts that open and close may have no solution with few harmonics
            let mut top = top;
            for _ in 0..LONGER {
                let found = self.level(top, omega).is_ok().then(|| self.series_of(&*path, top, omega)).flatten();
                if let Some(motion) = found
                    && let Ok(orbit) = self.from(top, omega, Some((top, motion)))
                {
                    return Some(Ok(orbit));
                }
                if self.method.harmonics.is_some() {
                    break;
                }
                top = self.kept.double(top);
            }
        }
        self.followed.push((omega, course.clone(), state.clone()));
        no_orbit(course, state)
    }
}
