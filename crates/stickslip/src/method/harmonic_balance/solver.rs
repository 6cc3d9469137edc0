//! The solver of harmonic balance: one orbit after another, with warm starts.

use super::aft::Ports;
use super::budget::{self, POINT_LIMIT, WorkShare, is_affordable};
use super::dynamics::banded::{self, BandedForm};
use super::dynamics::linear_dynamics::LinearDynamics;
use super::equations::harmonic_set::HarmonicSet;
use super::equations::{self, Discretization, HarmonicSolution};
use super::globalization::found_by::FoundBy;
use super::linear_solve::newton_krylov;
use super::memory_estimate::{MEMORY, check_memory, level_memory};
use super::newton::SolveError;
use super::options::{FIRST_HARMONICS, HarmonicBalance, NAME, TOLERANCE};
use super::static_equilibrium::{SolvedEquilibrium, static_equilibrium};
use super::warm_start::{RECENT, RecentOrbit};
use super::{cost_model, postprocess};
use crate::method::orbit_search::describing_guess::DescribingGuess;
use crate::method::orbit_search::evidence::OrbitCheck;
use crate::method::{MethodError, OrbitError, Solver};
use crate::model::System;
use crate::orbit::{ObservedMotion, Orbit};
use nalgebra::DVector;
use num_complex::Complex64;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Newton iterations from a warm start; 2 to 5 are usual.
const WARM_ITERATIONS: usize = 20;
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
    /// State in static equilibrium: displacements, velocities (zero), internal states of the
    /// joints.
    pub(super) static_state: Option<Vec<f64>>,
    /// Equations by their highest harmonic.
    pub(super) discretizations: BTreeMap<usize, Discretization>,
    /// Number of consecutive failed points that used much of the work limit, see
    /// [`budget::REDUCED_SHARE`].
    pub(super) expensive_failures: usize,
    /// Lower work limit of the present point, if it has an orbit whose error it tries to reduce.
    pub(super) limit: Option<WorkShare>,
    /// The last orbits, newest first.
    pub(super) recent: VecDeque<RecentOrbit>,
    /// Frequency (rad/s) and state from which the next searches continue, see
    /// [`Solver::begin_branch`].
    pub(super) branch_start: Option<(f64, Vec<f64>)>,
    /// Frequencies (rad/s) without an orbit at which the motion was integrated in time, and how
    /// that motion behaved and ended.
    pub(super) failed_frequencies: Vec<(f64, ObservedMotion, Vec<f64>)>,
    /// Number of time integrations that were made to find an orbit.
    pub(super) time_integrations: usize,
    /// By highest harmonic, in systems with many contacts: the last solution whose error was
    /// estimated, and the finer solution with twice the harmonics.
    pub(super) comparisons: BTreeMap<usize, [HarmonicSolution; 2]>,
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
        check_memory(bytes, &ports, (harmonics.len(), periods))?;
        let mut static_start = None;
        if kept.contains(0)
            && let Some(SolvedEquilibrium { orbit, states }) =
                static_equilibrium(&system, (&ports, around.as_ref()), &dynamics)
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
            system,
            static_state: static_start,
            discretizations: BTreeMap::new(),
            expensive_failures: 0,
            limit: None,
            recent: VecDeque::new(),
            branch_start: None,
            failed_frequencies: Vec::new(),
            time_integrations: 0,
            comparisons: BTreeMap::new(),
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
        (discretization.work_elsewhere, discretization.work_limit) = (elsewhere, allowed);
        Ok(discretization)
    }

    /// Resets the work counters for a new point.
    pub(super) fn begin_point(&mut self, excitation: f64) {
        self.excitation_frequency = excitation;
        self.limit = None;
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
        let allowed = budget::work_limit_after(self.expensive_failures);
        self.limit.map_or(allowed, |limit| limit.and_at_most(allowed))
    }

    /// Returns true if the point has used its work limit.
    pub(super) fn is_budget_used(&self) -> bool {
        self.work_used(None).exceeds(self.work_limit())
    }

    /// Ends a point. Counts consecutive expensive failures, which shrink the limit of the next
    /// point.
    fn end_point(&mut self, found: Result<Orbit, OrbitError>) -> Result<Orbit, OrbitError> {
        match &found {
            Ok(_) => self.expensive_failures = 0,
            Err(_) if self.work_used(None).exceeds(POINT_LIMIT.times(budget::REDUCED_SHARE)) => {
                self.expensive_failures += 1
            }
            Err(_) => {}
        }
        found
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
        self.comparisons.clear();
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
        self.recent.truncate(RECENT - 1);
        self.recent.push_front(RecentOrbit {
            start: orbit.initial_state.clone(),
            omega,
            highest_harmonic: top,
            solution: motion,
        });
        Ok(orbit)
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
            ring_ports: self.ring_ports.as_ref(),
            omega,
            excitation_harmonic: self.periods,
            half_period: self.harmonic_set.has_half_period_symmetry(),
            truncation,
            tolerance: self.method.tolerance.unwrap_or(TOLERANCE),
            orbit_check: Some(&mut self.orbit_check),
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

    /// Finds the solution near another one, without an error estimate and without the
    /// slip-limit homotopy of [`Discretization::solve`].
    ///
    /// Searches between orbits use it. They can do without a failed point.
    pub(super) fn solve_nearby(
        &mut self,
        top: usize,
        omega: f64,
        near: &HarmonicSolution,
    ) -> Result<Orbit, OrbitError> {
        self.discretization(top, omega).map(|_| ()).map_err(|l| self.solve_error(l))?;
        let mut motion = HarmonicSolution { iterations: 0, ..near.clone() };
        let discretization = self.discretizations.get_mut(&top).expect("made above");
        let mut found = discretization.newton_from(&self.ports, omega, &mut motion, WARM_ITERATIONS);
        if found.is_err() && self.ports.has_forces() {
            motion = HarmonicSolution { iterations: motion.iterations, ..near.clone() };
            found = discretization.interior_point_method(&self.ports, omega, &mut motion);
            motion.found_by = FoundBy::InteriorPoints;
            if found.is_err() {
                motion = HarmonicSolution { iterations: motion.iterations, ..near.clone() };
                found = discretization.proximal_point_method(&self.ports, omega, &mut motion);
                motion.found_by = FoundBy::ProximalPoints;
            }
        }
        found.map_err(|l| self.solve_error(l))?;
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

    /// Returns true if warm starts extrapolate the last two orbits (secant predictor).
    ///
    /// This holds in systems with many contacts. It also holds for elastic friction if no two
    /// motions separate, because every initial guess then leads to the same orbit. With rigid
    /// friction the set of slipping samples changes abruptly, and extrapolation does not help.
    pub(super) fn extrapolates(&self, top: usize) -> bool {
        let unique = self.orbit_check.proves() && !self.ports.has_forces();
        unique || self.discretizations.get(&top).is_some_and(Discretization::uses_krylov)
    }

    /// Returns the initial guess.
    ///
    /// If `start` belongs to an orbit of this solver, the guess is a warm start. If it belongs
    /// to an orbit of another solver and several orbits may exist, the guess comes from a time
    /// integration that begins there.
    pub(super) fn initial_guess(&mut self, start: Option<&[f64]>, omega: f64) -> Option<(usize, HarmonicSolution)> {
        let foreign = start.filter(|start| self.recent.iter().all(|recent| recent.start != *start));
        let led =
            foreign.filter(|_| omega.is_finite() && omega > 0.0).and_then(|start| self.guess_from_state(start, omega));
        led.or_else(|| self.warm_start(start, omega))
    }

    /// Returns the index of the recent orbit with this start.
    fn recent_with_start(&self, start: &[f64]) -> Option<usize> {
        self.recent.iter().position(|recent| recent.start == start)
    }

    /// Returns the index of the recent orbit that tells how many harmonics a search from
    /// `start` needs.
    ///
    /// This is the orbit with that start. Otherwise, if `start` is the announced state of
    /// [`Solver::begin_branch`], it is the orbit at the nearest frequency, provided that it is
    /// nearer than that state.
    fn recent_for_length(&self, start: &[f64], omega: f64) -> Option<usize> {
        let distance = |at: &usize| (self.recent[*at].omega - omega).abs();
        let nearer = || {
            let (from, _) = self.branch_start.as_ref().filter(|(_, begun)| begun == start)?;
            let nearest = (0..self.recent.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            (distance(&nearest) <= (from - omega).abs()).then_some(nearest)
        };
        self.recent_with_start(start).or_else(nearer)
    }

    /// Returns the warm start from the recent orbit with this start, or otherwise from the last
    /// orbit. Both are closer than an initial guess.
    pub(super) fn warm_start(&self, start: Option<&[f64]>, omega: f64) -> Option<(usize, HarmonicSolution)> {
        self.warm_start_from(self.recent_with_start(start?).unwrap_or(0), omega)
    }

    /// Returns the warm start from a recent orbit.
    fn warm_start_from(&self, at: usize, omega: f64) -> Option<(usize, HarmonicSolution)> {
        let near = self.recent.get(at)?;
        let before = self.recent.iter().skip(at + 1).find(|recent| recent.highest_harmonic == near.highest_harmonic);
        let motion = match before {
            Some(before) if self.extrapolates(near.highest_harmonic) => near.extrapolate(before, omega),
            _ => near.solution.clone(),
        };
        Some((near.highest_harmonic, HarmonicSolution { found_by: FoundBy::Newton, ..motion }))
    }
}

impl Solver for HarmonicBalanceSolver {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        self.begin_point(omega);
        let omega = omega / self.periods as f64;
        let warm = self.initial_guess(start, omega);
        let found = match self.converge(self.first, omega, warm) {
            Err(error @ (OrbitError::NotConverged { .. } | OrbitError::Drift { .. })) => {
                self.solve_or_classify(omega).unwrap_or_else(|| self.solve_after_integration(omega).ok_or(error))
            }
            found => found,
        };
        let mut found = found;
        if let Ok(orbit) = &mut found {
            orbit.evidence.history_spread = self.history_spread(orbit, omega);
        }
        self.end_point(found)
    }

    fn orbit_without_estimate(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        let at = omega / self.periods as f64;
        let known =
            start.filter(|_| omega.is_finite() && omega > 0.0).and_then(|start| self.recent_for_length(start, at));
        match known.and_then(|known| self.warm_start_from(known, at)) {
            // the number of harmonics of the neighbouring orbit is sufficient
            Some((top, motion)) => {
                self.begin_point(omega);
                let found = self.solve_nearby(top, at, &motion);
                self.end_point(found)
            }
            // no suitable orbit is known, so the number of harmonics is chosen anew
            _ => self.orbit(omega, start),
        }
    }

    fn begin_branch(&mut self, omega: f64, start: &[f64]) {
        self.branch_start = Some((omega / self.periods as f64, start.to_vec()));
    }

    fn work_fraction(&self) -> f64 {
        let WorkShare { multiplications: eliminated, time_steps: marched } = self.work_used(None);
        (eliminated / POINT_LIMIT.multiplications).max(marched / POINT_LIMIT.time_steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Coulomb;
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
        let mut starts: Vec<Vec<f64>> = Vec::new();
        for i in 0..21 {
            let start = starts.last().map(Vec::as_slice);
            starts.push(solver.orbit(rate(12.0 + 0.35 * f64::from(i)), start).unwrap().initial_state);
        }
        solver.begin_branch(rate(15.85), &starts[11]);
        let between = solver.orbit_without_estimate(rate(15.7276), Some(&starts[11])).unwrap();
        let exact = EventDriven.solver(&system).unwrap().orbit(rate(15.7276), None).unwrap();
        let error = (between.places[0].amplitude() / exact.places[0].amplitude() - 1.0).abs();
        assert!(error < 1e-3, "{error:.1e} with {:?} harmonics", between.evidence.harmonics);
    }

    /// Expensive failed points shrink the work limit of the next point. A success restores it.
    #[test]
    fn expensive_failures_reduce_the_work_limit() {
        let system = example::blade_couple_massless().assemble().unwrap();
        let mut balance = HarmonicBalanceSolver::new(system, HarmonicBalance::default(), 1).unwrap();
        let omega = std::f64::consts::TAU * 121.0;
        let vain = |balance: &mut HarmonicBalanceSolver, marched: usize| {
            balance.begin_point(omega);
            balance.discretization(7, omega).unwrap().aft.law_steps = marched;
            balance.end_point(Err(OrbitError::Frequency { omega })).unwrap_err();
            balance.work_limit()
        };
        assert_eq!([0, usize::MAX / 2, 0].map(|marched| vain(&mut balance, marched)), [POINT_LIMIT; 3]);
        let less = vain(&mut balance, usize::MAX / 2);
        assert_eq!(less, POINT_LIMIT.times(budget::REDUCED_SHARE));
        assert_eq!(balance.discretization(7, omega).unwrap().work_limit, less);
        assert!(balance.work_fraction() > 1.0);
        balance.orbit(omega, None).unwrap();
        assert_eq!(balance.work_limit(), POINT_LIMIT);
        assert!(balance.work_fraction() > 0.0 && balance.work_fraction() < 1e-3, "{}", balance.work_fraction());
    }
}
