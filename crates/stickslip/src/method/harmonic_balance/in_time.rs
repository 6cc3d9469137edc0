//! Starts from motions that were followed in time, where no neighbour and no guess leads to an orbit.

use super::NAME;
use super::balance::Balance;
use super::equations::Solution;
use super::found_by::FoundBy;
use crate::method::OrbitError;
use crate::method::course::course;
use crate::method::guess::Guess;
use crate::method::periodic::APPROACH;
use crate::orbit::{Course, JointSample, Orbit, Path};
use num_complex::Complex64;
use std::f64::consts::TAU;

/// Frequencies without an orbit at which the motion is followed, for seconds each, to say what it does; of a sweep in every one of its blocks.
const MOST_FOLLOWED: usize = 8;
/// Degrees of freedom up to which it is followed to find an orbit: steps of integrations multiply full matrices.
const MOST_DOFS_IN_TIME: usize = 60;
/// Series that are tried from a motion that has settled, each with twice the harmonics of the one before.
const LONGER: usize = 3;
/// Returns of a motion from the state of a neighbouring orbit before it is read: what it brings along from there, Newton's method does away with.
const LED: usize = 1;

impl Balance {
    /// A start near a motion that repeats after several periods: the describing functions know none, and Newton's method would never leave those
    /// that repeat after one. So the motion is followed in time for a while, if some flow follows the system; where motions do not separate there is
    /// none to be found.
    pub(super) fn approached(&mut self, top: usize, omega: f64, guess: Option<&Guess>) -> Option<Solution> {
        let start = guess.filter(|_| self.periods > 1 && !self.judge.proves())?.state(self.system.dofs());
        let path = self.judge.approach(&self.system, omega, start, APPROACH)?;
        self.series_of(&*path, top, omega)
    }

    /// A start near the motion that a state of another solver's orbit leads to. Where motions separate it says which of several orbits is meant; a solver
    /// knows the harmonics of its own orbits only.
    pub(super) fn led(&mut self, start: &[f64], omega: f64) -> Option<(usize, Solution)> {
        let dofs = self.system.dofs();
        if self.judge.proves() || self.periods > 1 || dofs > MOST_DOFS_IN_TIME || start.len() < 2 * dofs {
            return None;
        }
        let top = self.method.harmonics.unwrap_or(self.first);
        self.level(top, omega).ok()?;
        let path = self.judge.approach(&self.system, omega, start[..2 * dofs].to_vec(), LED)?;
        Some((top, self.series_of(&*path, top, omega)?))
    }

    /// Where the search has found no orbit: from the motion that rest comes to in time, `None` where it is not followed. Of frequencies at which there is
    /// more than one orbit it leads to one that attracts. Where springs that carry no mean let it drift, friction carries what it can.
    pub(super) fn by_time(&mut self, omega: f64) -> Option<Orbit> {
        // twice the harmonics, since with few of them there may be a motion that leads nowhere
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

    /// The state of static equilibrium, or that of all things unloaded where there is none.
    fn standing(&self) -> Vec<f64> {
        self.static_start.clone().unwrap_or_else(|| vec![0.0; 2 * self.system.dofs()])
    }

    /// The harmonics of a motion that was followed over a period.
    pub(super) fn series_of(&mut self, path: &dyn Path, top: usize, omega: f64) -> Option<Solution> {
        let level = self.levels.get_mut(&top)?;
        let (nh, n) = (level.harmonics().len(), level.alternation.samples());
        let mut motion = Solution { found_by: FoundBy::TimeIntegration, ..Solution::rest(level.linear.len()) };
        let samples: Vec<_> = (0..n).map(|i| path.sample(TAU / omega * i as f64 / n as f64).joints).collect();
        for port in self.ports.iter() {
            for q in port.range() {
                let (joint, axis) = self.ports.place(q);
                // what does the work of all
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

    /// Where contacts alone hold, and no orbit was found: the motion from rest leads to one, or shows what there is instead. `None` where it is
    /// not followed.
    pub(super) fn by_its_course(&mut self, omega: f64) -> Option<Result<Orbit, OrbitError>> {
        let top = self.method.harmonics.unwrap_or(self.first);
        let vibrates = self.system.harmonics_of_excitation(|z| z != Complex64::ZERO).iter().any(|h| *h > 0);
        if self.periods > 1 || !vibrates || !self.levels.get(&top)?.stands() {
            return None;
        }
        let drive = self.drive;
        let no_orbit = |course, state| Some(Err(OrbitError::NoOrbit { method: NAME, omega: drive, course, state }));
        if let Some((_, course, state)) = self.followed.iter().find(|(at, ..)| *at == omega) {
            return no_orbit(course.clone(), state.clone());
        }
        if self.followed.len() >= MOST_FOLLOWED {
            return None;
        }
        let (course, path, state) = course(&self.system, omega, self.standing())?;
        if matches!(course, Course::Settles | Course::Settling { .. }) {
            // contacts that part and close again may have no solution with few harmonics
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
