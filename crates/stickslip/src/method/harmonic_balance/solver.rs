//! The solver of harmonic balance: one orbit after another, with warm starts.

use super::aft::{Ports, StaticState};
use super::budget::{WorkShare, is_affordable};
use super::dynamics::banded::{self, BandedForm};
use super::dynamics::linear_dynamics::LinearDynamics;
use super::equations::harmonic_set::HarmonicSet;
use super::equations::{self, Discretization, HarmonicSolution};
use super::globalization::SearchSettings;
use super::linear_solve::newton_krylov;
use super::memory_estimate::{MEMORY, check_memory, level_memory};
use super::newton::SolveError;
use super::options::{FIRST_HARMONICS, HarmonicBalance, NAME, TOLERANCE};
use super::settings::WorkSettings;
use super::static_equilibrium::{Regularization, SolvedEquilibrium, static_equilibrium};
use super::{cost_model, postprocess};
use crate::method::orbit_search::describing_guess::DescribingGuess;
use crate::method::orbit_search::evidence::OrbitCheck;
use crate::method::{Budget, ErrorEstimate, MethodError, OrbitError, Request, Solver};
use crate::model::System;
use crate::orbit::{ObservedMotion, Orbit, Seed};
use nalgebra::DVector;
use num_complex::Complex64;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Highest harmonic of a cold start with force ports. Longer series start from the solution
/// with half the harmonics, in which the slipping samples are nearly known.
const COLD_START_HARMONICS: usize = 15;
/// Number of unknowns beyond which elimination is too slow for an error estimate. One
/// elimination would take seconds, and a search takes ten or more.
pub(super) const MOST_ELIMINATED_UNKNOWNS: usize = 2600;
/// Largest number of harmonics times squared number of axes for which an error is estimated
/// with GMRES. Products with all of them then take a tenth of a second.
const MOST_ESTIMATE_PRODUCTS: f64 = 1e7;

/// Solver of a system.
pub(super) struct HarmonicBalanceSolver {
    pub(super) system: Arc<System>,
    pub(super) method: HarmonicBalance,
    /// Number of excitation periods in one period of the orbit. Harmonics are multiples of the
    /// orbit's frequency.
    pub(super) periods: usize,
    /// Frequency of the excitation, rad/s. In this method, `omega` is the frequency of the
    /// orbit.
    pub(super) excitation_frequency: f64,
    /// Ports. For a ring in a travelling wave, those of the first sector.
    pub(super) ports: Ports,
    /// Ports of the whole ring, for a travelling wave.
    pub(super) ring_ports: Option<Ports>,
    /// Receptance of the linear part.
    pub(super) receptance: LinearDynamics,
    /// One harmonic in banded form, if the system has that form. It sizes the work and memory
    /// of longer series.
    pub(super) banded: Option<BandedForm>,
    /// Set of harmonics in a series.
    pub(super) harmonic_set: HarmonicSet,
    /// Highest harmonic of the first series.
    pub(super) first: usize,
    /// True once a law was met whose force jumps between two samples.
    pub(super) steep: bool,
    /// Check of orbits by time integration.
    pub(super) orbit_check: OrbitCheck,
    /// False for orbits that no time integration checks.
    is_checked: bool,
    /// History of the last orbit, if a growing vibration found it: orbits between it and the next
    /// one begin there.
    pub(super) grown_history: Option<Vec<StaticState>>,
    /// State in static equilibrium: displacements, velocities (zero), internal states of the
    /// joints.
    pub(super) static_state: Option<Vec<f64>>,
    /// Equations by their highest harmonic.
    pub(super) discretizations: BTreeMap<usize, Discretization>,
    /// Work limit of the present point, relative to the default.
    pub(super) point_limit: f64,
    /// Lower work limit of the present point, if it has an orbit whose error it tries to reduce.
    pub(super) limit: Option<WorkShare>,
    /// Frequencies (rad/s) without an orbit at which the motion was integrated in time, and how
    /// that motion behaved and ended.
    pub(super) failed_frequencies: Vec<(f64, ObservedMotion, Vec<f64>)>,
    /// Number of time integrations that were made to find an orbit.
    pub(super) time_integrations: usize,
    /// Work of the present point that its discretizations do not count, as a fraction of the
    /// default limit: integrations in time, and searches before them.
    pub(super) earlier_work: f64,
}

impl HarmonicBalanceSolver {
    pub(super) fn new(system: System, method: HarmonicBalance, periods: usize) -> Result<Self, MethodError> {
        let kept = if periods > 1 {
            HarmonicSet::subharmonic(&system, periods)
        } else {
            HarmonicSet::new(&system, |z| z != Complex64::new(0.0, 0.0))
        };
        method.check(kept.highest)?;
        if let Some(error) = MethodError::only_joints(NAME, &system) {
            return Err(error);
        }
        let (mut ports, mut around) = Ports::for_sector(&system)?;
        let dynamics = LinearDynamics::new(&system, &ports);
        let system = Arc::new(system);
        let first = (FIRST_HARMONICS * kept.count_factor).max(kept.highest);
        let harmonics = kept.up_to(method.harmonics.unwrap_or(first));
        let banded = BandedForm::new(&system, &ports, &[1]);
        let steep = ports.has_steep();
        let samples = method.samples_at(method.harmonics.unwrap_or(first), &ports, steep);
        let bytes = level_memory(banded.as_ref(), &ports, &dynamics, (harmonics.len(), samples));
        check_memory(bytes, &ports, harmonics.len(), periods)?;
        let mut static_start = None;
        let equilibrium =
            |regularization| static_equilibrium(&system, (&ports, around.as_ref()), &dynamics, regularization);
        if kept.contains(0)
            // the search begins there and has its own springs, so an error is harmless
            && let Some(SolvedEquilibrium { orbit, states }) =
                [Regularization::Robust, Regularization::Exact].into_iter().find_map(equilibrium)
        {
            ports.set_static_states(&states);
            around.iter_mut().for_each(|around| around.set_static_states(&states));
            static_start = Some(orbit.initial_state);
        }
        Ok(HarmonicBalanceSolver {
            method,
            periods,
            excitation_frequency: 0.0,
            ports,
            ring_ports: around,
            receptance: dynamics,
            banded,
            harmonic_set: kept,
            first,
            steep,
            orbit_check: OrbitCheck::new(&system),
            is_checked: true,
            system,
            grown_history: None,
            static_state: static_start,
            discretizations: BTreeMap::new(),
            point_limit: 1.0,
            limit: None,
            failed_frequencies: Vec::new(),
            time_integrations: 0,
            earlier_work: 0.0,
        })
    }

    /// Returns the equations up to harmonic `top`, prepared for `omega`.
    ///
    /// # Errors
    /// A resonance without damping.
    pub(super) fn discretization(&mut self, top: usize, omega: f64) -> Result<&mut Discretization, SolveError> {
        let harmonics = self.harmonic_set.up_to(top);
        let samples = self.method.samples_at(top, &self.ports, self.steep);
        let (system, ports) = (&self.system, &self.ports);
        let discretization = self.discretizations.entry(top).or_insert_with(|| {
            let banded = BandedForm::new(system, ports, &harmonics);
            Discretization::new(harmonics, samples, ports, banded)
        });
        discretization
            .set_frequency(&self.system, &self.ports, &self.receptance, omega)
            .map_err(SolveError::resonance)?;
        let elsewhere = self.work_used(Some(top));
        let allowed = self.work_limit();
        let discretization = self.discretizations.get_mut(&top).expect("made above");
        (discretization.work.elsewhere, discretization.work.limit) = (elsewhere, allowed);
        Ok(discretization)
    }

    /// Resets the work counters for a new point with a work limit relative to the default.
    pub(super) fn begin_point(&mut self, excitation: f64, limit: f64) {
        self.excitation_frequency = excitation;
        self.point_limit = limit;
        self.limit = None;
        self.earlier_work = 0.0;
        self.discretizations.values_mut().for_each(Discretization::begin_point);
    }

    /// Returns the work of the point so far, without that of the equations up to harmonic
    /// `but`.
    pub(super) fn work_used(&self, but: Option<usize>) -> WorkShare {
        let counted = self.discretizations.iter().filter(|(top, _)| but != Some(**top));
        counted
            .map(|(_, discretization)| discretization.point_work_used(&self.ports))
            .fold(WorkShare::default(), WorkShare::and)
    }

    /// Returns the work limit of the point.
    fn work_limit(&self) -> WorkShare {
        let allowed = WorkSettings::default().point.times(self.point_limit.min(1.0));
        self.limit.map_or(allowed, |limit| limit.and_at_most(allowed))
    }

    /// Returns true if the point has used its work limit.
    pub(super) fn is_budget_used(&self) -> bool {
        self.work_used(None).exceeds(self.work_limit())
    }

    /// Returns the work of the point as a fraction of the default limit.
    pub(super) fn work_fraction(&self) -> f64 {
        let (used, limit) = (self.work_used(None), WorkSettings::default().point);
        self.earlier_work + (used.multiplications / limit.multiplications).max(used.time_steps / limit.time_steps)
    }

    /// Returns true if a solution with twice the harmonics takes at most seconds and fits in
    /// memory. The budget of a point that has used `taken` must cover it too.
    pub(super) fn can_estimate_error(&self, top: usize, taken: WorkShare) -> bool {
        let harmonics = self.harmonic_set.up_to(self.harmonic_set.doubled(top)).len();
        let axes = self.ports.count();
        let products = (harmonics * axes * axes) as f64;
        let size = 2 * axes * harmonics;
        let multiplied = newton_krylov::uses_krylov(size, &self.ports) && products <= MOST_ESTIMATE_PRODUCTS;
        let few = match &self.banded {
            Some(_) => true,
            None => size <= MOST_ELIMINATED_UNKNOWNS || multiplied,
        };
        let bounded = self.banded.is_some() || self.ports.has_forces();
        let affordable = !bounded
            || is_affordable(
                cost_model::step_multiplications(self.banded.as_ref(), &self.ports, harmonics),
                taken,
                self.work_limit(),
            );
        // the error estimate also takes twice the samples
        let samples = 2 * self.method.samples_at(self.harmonic_set.doubled(top), &self.ports, self.steep);
        let fits = level_memory(self.banded.as_ref(), &self.ports, &self.receptance, (harmonics, samples)) <= MEMORY;
        few && affordable && fits
    }

    /// Solves with harmonics up to `top`, from a solution with another number of harmonics or
    /// from an initial guess.
    ///
    /// If the solution shows that a law is steep, the method solves again with the samples that
    /// steep laws need. All later solutions use these samples too.
    pub(super) fn solve(
        &mut self,
        top: usize,
        omega: f64,
        from: Option<(usize, &HarmonicSolution)>,
    ) -> Result<HarmonicSolution, SolveError> {
        let motion = self.solve_with_present_samples(top, omega, from)?;
        if self.steep || !self.discretizations[&top].states_cross_within_sample(&self.ports, &motion) {
            return Ok(motion);
        }
        self.steep = true;
        self.discretizations.clear();
        self.solve_with_present_samples(top, omega, Some((top, &motion)))
    }

    /// Solves with the number of samples that is set.
    fn solve_with_present_samples(
        &mut self,
        top: usize,
        omega: f64,
        from: Option<(usize, &HarmonicSolution)>,
    ) -> Result<HarmonicSolution, SolveError> {
        let start = match from {
            Some((other, motion)) => {
                let harmonics = self.harmonic_set.up_to(other);
                equations::with_harmonics(motion, &harmonics, self.discretization(top, omega)?.harmonics())
            }
            None if self.ports.has_forces()
                && top > COLD_START_HARMONICS * self.harmonic_set.count_factor
                && top / 2 >= self.first =>
            {
                let coarse = self.solve(top / 2, omega, None)?;
                return self.solve(top, omega, Some((top / 2, &coarse)));
            }
            None => {
                // the initial guess solves the whole structure densely; large systems start
                // without friction
                let guess =
                    (self.system.dofs() < banded::DESCRIBING_DOFS).then(|| DescribingGuess::new(&self.system, omega));
                self.discretization(top, omega)?;
                let begun = self.discretizations[&top].initial_guess(&self.system, &self.ports, guess.as_ref(), omega);
                self.guess_by_integration(top, omega, guess.as_ref()).unwrap_or(begun)
            }
        };
        let discretization = self.discretizations.get_mut(&top).expect("made above");
        discretization.solve(&self.ports, omega, start)
    }

    /// Converts the failure of a search to the error of the method.
    pub(super) fn solve_error(&self, error: SolveError) -> OrbitError {
        if let Some(resonance) = error.resonance {
            return OrbitError::Resonance { method: NAME, omega: self.excitation_frequency, resonance };
        }
        if error.left_contacts {
            return OrbitError::drift(NAME, self.excitation_frequency);
        }
        OrbitError::NotConverged {
            method: NAME,
            omega: self.excitation_frequency,
            iterations: error.iterations,
            residual: error.residual,
            work_limit_reached: self.is_budget_used(),
            advice: String::new(),
        }
    }

    /// Returns the harmonics of all places.
    pub(super) fn places(
        &mut self,
        top: usize,
        omega: f64,
        motion: &HarmonicSolution,
    ) -> Result<Vec<DVector<Complex64>>, SolveError> {
        postprocess::places(self.discretizations.get_mut(&top).expect("solved"), &self.receptance, omega, motion)
            .map_err(SolveError::resonance)
    }

    /// Makes the orbit of a solution, checks its energy balance, and keeps it for warm starts.
    pub(super) fn make_orbit(
        &mut self,
        top: usize,
        omega: f64,
        motion: HarmonicSolution,
        x: Vec<DVector<Complex64>>,
        truncation: Option<f64>,
    ) -> Result<Orbit, OrbitError> {
        let orbit = self.orbit_of(top, omega, &motion, x, truncation)?;
        let series = motion.into_series(top);
        Ok(Orbit { series: Some(Arc::new(series)), ..orbit })
    }

    /// Makes the orbit of a solution and checks its energy balance.
    pub(super) fn orbit_of(
        &mut self,
        top: usize,
        omega: f64,
        motion: &HarmonicSolution,
        x: Vec<DVector<Complex64>>,
        truncation: Option<f64>,
    ) -> Result<Orbit, OrbitError> {
        let setting = postprocess::OrbitInput {
            system: &self.system,
            ports: &self.ports,
            dynamics: &self.receptance,
            ring_ports: self.ring_ports.as_ref(),
            omega,
            excitation_harmonic: self.periods,
            half_period: self.harmonic_set.has_half_period_symmetry(),
            truncation,
            tolerance: self.method.tolerance.unwrap_or(TOLERANCE),
            orbit_check: if self.is_checked { Some(&mut self.orbit_check) } else { None },
        };
        let discretization = self.discretizations.get_mut(&top).expect("solved");
        let orbit = postprocess::orbit(setting, discretization, motion, x)
            .ok_or(OrbitError::drift(NAME, self.excitation_frequency))?;
        if !postprocess::energies_balance(&self.system, &orbit) {
            let error = SolveError::not_converged(motion.iterations, orbit.evidence.energy_gap);
            return Err(self.solve_error(error));
        }
        Ok(Orbit { omega: self.excitation_frequency, periods: self.periods, ..orbit })
    }

    /// Finds the solution near another one, without an error estimate and without the fallbacks
    /// that ignore the initial guess.
    ///
    /// Searches between orbits use it. They can do without a failed point.
    pub(super) fn solve_nearby(
        &mut self,
        top: usize,
        omega: f64,
        near: &HarmonicSolution,
    ) -> Result<Orbit, OrbitError> {
        self.discretization(top, omega).map(|_| ()).map_err(|l| self.solve_error(l))?;
        let discretization = self.discretizations.get_mut(&top).expect("made above");
        // from a warm start, 2 to 5 iterations are usual
        let settings = SearchSettings { iterations: 20, between_orbits: true, ..SearchSettings::default() };
        let found = discretization.solve_with(&self.ports, omega, near.clone(), settings);
        let motion = found.map_err(|error| self.solve_error(error))?;
        let x = self.places(top, omega, &motion).map_err(|l| self.solve_error(l))?;
        self.make_orbit(top, omega, motion, x, None)
    }

    /// Finds the orbit with the user's number of harmonics. Without one, doubles the harmonics
    /// from `first` until the tolerance is met.
    pub(super) fn converge(
        &mut self,
        first: usize,
        omega: f64,
        warm: Option<(usize, HarmonicSolution)>,
    ) -> Result<Orbit, OrbitError> {
        match self.method.harmonics {
            Some(top) => self.with_given_harmonics(top, omega, warm),
            None => self.with_chosen_harmonics(first, omega, warm),
        }
    }

    /// Returns the series of a seed as warm start, if it fits this system.
    pub(super) fn series_of(&self, seed: &Seed) -> Option<(usize, HarmonicSolution)> {
        let series = seed.series.as_deref()?;
        let length = self.ports.count() * self.harmonic_set.up_to(series.highest_harmonic).len();
        (series.motions.len() == length).then(|| (series.highest_harmonic, HarmonicSolution::from_series(series)))
    }

    /// Finds the orbit of a request within the work limit that is set.
    fn solve_point(&mut self, request: &Request<'_>, omega: f64) -> Result<Orbit, OrbitError> {
        let series = request.seed.and_then(|seed| self.series_of(seed));
        if let (ErrorEstimate::Skipped, Some((top, motion))) = (request.estimate, &series) {
            // the number of harmonics of the neighbouring orbit is sufficient
            let nearby = |solver: &mut Self| solver.solve_nearby(*top, omega, motion);
            let growing = |solver: &mut Self| solver.solve_with_growing_vibration(request, omega);
            return match self.grown_history {
                Some(_) => growing(self).map_or_else(|| nearby(self), Ok),
                None => nearby(self).or_else(|error| growing(self).ok_or(error)),
            };
        }
        self.grown_history = None;
        // without a series, a time integration begins at the seed's state
        let warm = series.or_else(|| self.guess_from_state(&request.seed?.state, omega));
        let mut found = match self.converge(self.first, omega, warm) {
            Err(error @ (OrbitError::NotConverged { .. } | OrbitError::Drift { .. })) => {
                if let Some(orbit) = self.solve_with_growing_vibration(request, omega) {
                    return Ok(orbit);
                }
                self.solve_or_classify(self.first, omega)
                    .unwrap_or_else(|| self.solve_after_integration(omega).ok_or(error))
            }
            // a longer series was not reached from the shorter one
            Err(error @ OrbitError::Truncation { harmonics, needed: None, .. }) => {
                let longer = self.harmonic_set.doubled(harmonics * self.periods);
                self.solve_or_classify(longer, omega).and_then(Result::ok).ok_or(error)
            }
            found => found,
        };
        if let (Ok(orbit), true) = (&mut found, self.is_checked) {
            orbit.evidence.history_spread = self.history_spread(orbit, omega);
        }
        found
    }
}

impl Solver for HarmonicBalanceSolver {
    fn solve(&mut self, request: &Request<'_>, budget: &mut Budget) -> Result<Orbit, OrbitError> {
        let omega = request.omega;
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        self.begin_point(omega, budget.remaining());
        self.is_checked = request.estimate == ErrorEstimate::Required;
        let found = self.solve_point(request, omega / self.periods as f64);
        budget.charge(self.work_fraction());
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Cubic, Jenkins, SharedLaw};
    use crate::method::Method;
    use crate::method::event_driven::EventDriven;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, example};

    /// Near the end of a curve the joint sticks, and few harmonics suffice. A later search at
    /// the peak, where the joint slips, uses the harmonics of the peak. With those of the last
    /// orbit the peak was 2.4 % too low.
    #[test]
    fn a_later_peak_search_uses_the_harmonics_of_the_peak() {
        let spring = |on: &str, stiffness, damping| Spring { between: [on.into(), GROUND.into()], stiffness, damping };
        let model = Model {
            masses: vec![Mass::new("a", 1.0), Mass::new("d", 0.2)],
            springs: vec![spring("a", 1e4, 1.0), spring("d", 500.0, 0.1)],
            joints: vec![Joint {
                name: "j".into(),
                between: ["a".into(), "d".into()],
                law: Arc::new(Coulomb { limit: 1.436_363_636_363_64 }),
            }],
            forces: vec![Force { on: "a".into(), amplitude: 2.0, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let rate = |hertz: f64| std::f64::consts::TAU * hertz;
        let mut solver = HarmonicBalance::default().solver(&system).unwrap();
        let mut seeds: Vec<Seed> = Vec::new();
        for i in 0..21 {
            let request = Request::at(rate(12.0 + 0.35 * f64::from(i))).near(seeds.last());
            let orbit = solver.solve(&request, &mut Budget::default()).unwrap();
            seeds.push(orbit.seed());
        }
        let request = Request::at(rate(15.7276)).near(Some(&seeds[11])).without_estimate();
        let between = solver.solve(&request, &mut Budget::default()).unwrap();
        let exact = EventDriven.solver(&system).unwrap().orbit(rate(15.7276)).unwrap();
        let error = (between.places[0].amplitude() / exact.places[0].amplitude() - 1.0).abs();
        assert!(error < 1e-3, "{error:.1e} with {:?} harmonics", between.evidence.harmonics);
    }

    /// A joint that sticks for a whole period at one frequency slips at the next. Its limit is
    /// raised only while the derivative of the stuck orbit is computed.
    #[test]
    fn a_return_is_checked_with_the_given_limits_after_a_stuck_orbit() {
        let ground =
            |law: SharedLaw, name: &str| Joint { name: name.into(), between: ["m".into(), GROUND.into()], law };
        let model = Model {
            masses: vec![Mass::new("m", 1.0)],
            springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: 1.0, damping: 0.02 }],
            joints: vec![
                ground(Arc::new(Jenkins { stiffness: 20.0, limit: 1.0 }), "slider"),
                ground(Arc::new(Cubic { stiffness: 1.0 }), "cubic"),
            ],
            forces: vec![Force { on: "m".into(), amplitude: 1.0, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let mut solver = HarmonicBalance::default().solver(&system).unwrap();
        let stuck = solver.orbit(0.5).unwrap();
        assert_eq!(stuck.joints[0].slip_fraction, 0.0);
        let slipping = solver.orbit(1.4).unwrap();
        assert!(slipping.joints[0].slip_fraction > 0.1);
        let defect = slipping.evidence.return_defect.unwrap();
        assert!(defect < 0.02 && slipping.is_stable() == Some(true), "{defect}");
    }

    /// A search ends when its budget is used up, and charges its work.
    #[test]
    fn a_search_keeps_within_its_budget() {
        let system = example::blade_couple_massless().assemble().unwrap();
        let mut solver = HarmonicBalance::default().solver(&system).unwrap();
        let request = Request::at(std::f64::consts::TAU * 121.0);
        let mut budget = Budget::default();
        solver.solve(&request, &mut budget).unwrap();
        let work = budget.used();
        assert!(work > 0.0 && work < 1e-3, "{work}");
        let mut small = Budget::points(0.1 * work);
        let error = solver.solve(&request, &mut small).unwrap_err();
        assert!(matches!(error, OrbitError::NotConverged { work_limit_reached: true, .. }), "{error}");
        assert!(small.is_used_up() && small.used() < work, "{} of {work}", small.used());
    }
}
