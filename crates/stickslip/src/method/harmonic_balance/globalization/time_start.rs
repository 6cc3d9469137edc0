//! Initial guesses from time integration: for orbits of several periods, from the state of another
//! method's orbit, and after all other searches failed.

use crate::method::OrbitError;
use crate::method::harmonic_balance::NAME;
use crate::method::harmonic_balance::equations::{Discretization, HarmonicSolution};
use crate::method::harmonic_balance::found_by::FoundBy;
use crate::method::harmonic_balance::settings::{TimeStartSettings, WorkSettings};
use crate::method::harmonic_balance::solver::HarmonicBalanceSolver;
use crate::method::orbit_search::describing_guess::DescribingGuess;
use crate::method::orbit_search::return_map::APPROACH;
use crate::method::orbit_search::settling::{ClassifiedMotion, classify_motion};
use crate::orbit::{JointSample, ObservedMotion, Orbit, Path};
use num_complex::Complex64;
use std::f64::consts::TAU;

impl HarmonicBalanceSolver {
    /// Returns an initial guess for an orbit of several excitation periods.
    ///
    /// Describing functions know no such orbit, and Newton's method does not leave orbits of one
    /// period. The guess is the motion after [`APPROACH`] returns of time integration. Returns
    /// `None` for orbits of one period, if no integration takes the system, or if motions never
    /// separate, so that no such orbit exists.
    pub(crate) fn guess_by_integration(
        &mut self,
        top: usize,
        omega: f64,
        guess: Option<&DescribingGuess>,
    ) -> Option<HarmonicSolution> {
        let start = guess.filter(|_| self.periods > 1 && !self.orbit_check.proves())?.state(self.system.dofs());
        let path = self.orbit_check.settle_and_record(&self.system, omega, start, APPROACH)?;
        self.fourier_series(&*path, top, omega)
    }

    /// Returns an initial guess from the state of another solver's orbit.
    ///
    /// A solver knows only the harmonics of the orbits that it found. If motions can separate,
    /// the state selects one of several orbits.
    pub(crate) fn guess_from_state(&mut self, start: &[f64], omega: f64) -> Option<(usize, HarmonicSolution)> {
        let dofs = self.system.dofs();
        if self.orbit_check.proves()
            || self.periods > 1
            || dofs > TimeStartSettings::default().dofs
            || start.len() < 2 * dofs
        {
            return None;
        }
        let top = self.method.harmonics.unwrap_or(self.first);
        self.discretization(top, omega).ok()?;
        // one return, after which Newton's method removes the remaining transient
        let path = self.orbit_check.settle_and_record(&self.system, omega, start[..2 * dofs].to_vec(), 1)?;
        Some((top, self.fourier_series(&*path, top, omega)?))
    }

    /// Searches from the motion that time integration reaches from static equilibrium. Returns
    /// `None` if the system is not integrated or the search fails.
    ///
    /// If several orbits exist at the frequency, the integration leads to a stable one.
    pub(crate) fn solve_after_integration(&mut self, omega: f64) -> Option<Orbit> {
        // twice the first harmonics, because a shorter series may have a spurious solution
        let top = self.method.harmonics.unwrap_or(self.harmonic_set.doubled(self.first));
        let settings = TimeStartSettings::default();
        if self.periods > 1 || self.system.dofs() > settings.dofs || self.time_integrations >= settings.integrations {
            return None;
        }
        self.time_integrations += 1;
        self.discretization(top, omega).ok()?;
        let path = self.orbit_check.settle_and_record(&self.system, omega, self.static_state_or_zero(), APPROACH)?;
        let motion = self.fourier_series(&*path, top, omega)?;
        self.converge(top, omega, Some((top, motion))).ok()
    }

    /// Gives the next search a budget as large as that of a point.
    pub(super) fn begin_second_search(&mut self) {
        (self.earlier_work, self.limit) = (self.work_fraction(), None);
        self.discretizations.values_mut().for_each(Discretization::begin_point);
    }

    /// Returns the state of static equilibrium, or the unloaded state if there is none.
    fn static_state_or_zero(&self) -> Vec<f64> {
        self.static_state.clone().unwrap_or_else(|| vec![0.0; 2 * self.system.dofs()])
    }

    /// Returns the harmonics of a motion that was integrated over a period.
    pub(crate) fn fourier_series(&mut self, path: &dyn Path, top: usize, omega: f64) -> Option<HarmonicSolution> {
        let discretization = self.discretizations.get_mut(&top)?;
        let (nh, n) = (discretization.harmonics().len(), discretization.aft.samples());
        let mut motion = HarmonicSolution {
            found_by: FoundBy::TimeIntegration,
            ..HarmonicSolution::zero(discretization.linear.motion.len())
        };
        let samples: Vec<_> = (0..n).map(|i| path.sample(TAU / omega * i as f64 / n as f64).joints).collect();
        for port in self.ports.iter() {
            for q in port.range() {
                let (joint, axis) = self.ports.joint_axis(q);
                // the force of the port does the work of all its joints
                let work = |now: &[JointSample]| -> f64 {
                    port.members.iter().map(|member| member.motion_ratio * now[member.joint].force[axis]).sum()
                };
                let force: Vec<f64> = samples.iter().map(|now| work(now)).collect();
                let moved = samples
                    .iter()
                    .zip(&force)
                    .map(|(now, f)| now[joint].displacement[axis] - f * port.series_compliance);
                let range = q * nh..(q + 1) * nh;
                discretization.aft.add_signal(&mut moved.collect::<Vec<f64>>(), &mut motion.c[range.clone()]);
                discretization.aft.add_signal(&mut force.clone(), &mut motion.force[range]);
            }
        }
        Some(motion)
    }

    /// Integrates in time if only contacts support a body and no orbit with harmonics up to
    /// `top` was found.
    ///
    /// The search continues from the settled motion. If that fails, the error describes the
    /// motion. Returns `None` if the motion is not integrated.
    pub(crate) fn solve_or_classify(&mut self, top: usize, omega: f64) -> Option<Result<Orbit, OrbitError>> {
        let top = self.method.harmonics.unwrap_or(top);
        let vibrates = self.system.harmonics_of_excitation(|z| z != Complex64::ZERO).iter().any(|h| *h > 0);
        if self.periods > 1 || !vibrates || !self.discretization(top, omega).ok()?.is_held_by_contacts() {
            return None;
        }
        let excitation = self.excitation_frequency;
        let no_orbit =
            |course, state| Some(Err(OrbitError::NoOrbit { method: NAME, omega: excitation, observed: course, state }));
        if let Some((_, course, state)) = self.failed_frequencies.iter().find(|(at, ..)| *at == omega) {
            return no_orbit(course.clone(), state.clone());
        }
        if self.failed_frequencies.len() >= TimeStartSettings::default().integrations {
            return None;
        }
        let WorkSettings { multiplications: of_search, point, .. } = WorkSettings::default();
        let most = of_search * self.point_limit.min(1.0);
        let ClassifiedMotion { course, creep, path, state, multiplications } =
            classify_motion(&self.system, omega, self.static_state_or_zero(), most)?;
        self.earlier_work += multiplications / (of_search * point.multiplications);
        if matches!(course, ObservedMotion::Settles | ObservedMotion::Settling { .. }) {
            // An orbit exists: searches from its motion get a budget as large as that of a point,
            // whatever the searches that failed have used.
            self.begin_second_search();
            // contacts that open and close may have no solution with few harmonics
            let mut top = top;
            for _ in 0..TimeStartSettings::default().series_lengths {
                let found =
                    self.discretization(top, omega).is_ok().then(|| self.fourier_series(&*path, top, omega)).flatten();
                if let Some(motion) = found
                    && let Ok(orbit) = self.converge(top, omega, Some((top, motion)))
                {
                    return Some(Ok(orbit));
                }
                if self.method.harmonics.is_some() {
                    break;
                }
                top = self.harmonic_set.doubled(top);
            }
        }
        let course = creep.unwrap_or(course);
        self.failed_frequencies.push((omega, course.clone(), state.clone()));
        no_orbit(course, state)
    }
}
