//! Shooting: Newton's method on the return map of a time integration.
//!
//! Smooth laws use a stiff integration of high order. Laws with a step only, and mixtures, use
//! equal steps. The arctan law creeps during stick with time constants of seconds, so waiting
//! for the transient to decay proves nothing. Newton's method with the exact derivative of the
//! integrator's return map closes the orbit instead.

use super::event_driven::EventDrivenSettings;
use super::flow::Flow;
use super::flow::assembly::{Assembly, NEAR_REST};
use super::flow::average_acceleration::equal_steps::{AverageAccelerationFlow, EqualStepSettings, estimate};
use super::flow::integrator_choice::IntegratorKind;
use super::flow::radau::step_size_control::{RadauFlow, StepSizes};
use super::flow::set_valued::located_switches::SetValuedFlow;
use super::flow::trajectory::Trajectory;
use super::options::{PERIOD, periods, width};
use super::orbit_search::cold_restart::ColdRestart;
use super::orbit_search::describing_guess::DescribingGuess;
use super::orbit_search::residual_traction::{ElasticSlider, OrbitMap, select_equilibrium_orbit};
use super::orbit_search::return_map::{
    ClosedState, ClosingMethod, ClosingTargets, LargeIncrease, ReturnMap, close, iterate_map, newton_step,
    newton_with_line_search, norm,
};
use super::orbit_search::vibration_share;
use super::static_equilibrium::{StaticEquilibrium, states_at};
use super::{
    Budget, IntegrationError, Method, MethodError, MethodInfo, MethodOption, OrbitError, Request, Solver, WIDTH,
};
use crate::dimension::Dimension;
use crate::model::System;
use crate::orbit::postprocess::{CONSERVATIVE_WORK, results};
use crate::orbit::{Accuracy, Evidence, Orbit, Path, Symmetry, history_dependent_joints};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

const NAME: &str = "shooting";

/// Settings of the search for an orbit by time integration.
#[derive(Debug, Clone, Copy)]
struct ShootingSettings {
    /// Largest ratio of successive steps that reuse the derivative of the search.
    shrink_ratio: f64,
    /// Residual of the first search. Every run chooses its own steps there, so the map is smooth
    /// only to about their error.
    free_residual: f64,
    /// Smallest relative error per step of the coarse search before orbits with shorter steps.
    /// Longer steps jump over the layers of a law and would still take two thirds of the time.
    long_steps: f64,
    /// Residual of this coarse search.
    coarse_residual: f64,
    /// Residual at which the orbit is closed on the fixed steps of the last free run; the map is
    /// smooth on them.
    closed: f64,
    /// Residual at which an orbit between located switches is closed; every run chooses its own
    /// steps.
    closed_switched: f64,
    /// Most meshes of steps for one orbit. The first is as good as the first search; the second is
    /// nearly always enough.
    meshes: usize,
    /// Largest move, in errors per step, of the state when the orbit is closed on a good mesh. The
    /// choice of the steps alone moves the state by this much. When a settling motion changes by
    /// less per return, it keeps its steps.
    settled: f64,
    /// Largest relative energy gap of a converged orbit, and largest relative move on the last
    /// mesh.
    energy_gap: f64,
    /// Error of an orbit in equal steps, in errors per step of the stiff integration: 1e-5 of the
    /// motion by default.
    equal_steps: f64,
    /// Residual at which an orbit in equal steps is closed.
    closed_steps: f64,
    /// Smallest relative error per step, and distance to the orbit, of the first phase of waiting,
    /// which needs no accuracy.
    coarse_settling: f64,
    /// Most returns of the first phase of waiting. If it fails, the motion is integrated
    /// accurately from the start.
    coarse_returns: usize,
    /// Largest distance between the same orbit in equal steps of length h and 2h, relative to the
    /// motion. 256 steps per period have an error of 1e-3 at a Q of ten; the error is proportional
    /// to Q.
    same_orbit: f64,
    /// Instants of a return at which orbits in equal steps are compared.
    instants: usize,
    /// Fraction of the vibration in its state below which an energy imbalance is attributed to
    /// lost digits.
    small_vibration: f64,
}

impl Default for ShootingSettings {
    fn default() -> Self {
        ShootingSettings {
            shrink_ratio: 0.3,
            free_residual: 1e-6,
            long_steps: 1e-8,
            coarse_residual: 1e-5,
            closed: 1e-11,
            closed_switched: 1e-10,
            meshes: 6,
            settled: 100.0,
            energy_gap: 1e-5,
            equal_steps: 1e3,
            closed_steps: 1e-10,
            coarse_settling: 1e-5,
            coarse_returns: 1024,
            same_orbit: 0.1,
            instants: 8,
            small_vibration: 1e-3,
        }
    }
}

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "smooth laws, and laws given by a rule for one time step: Newton's method on the return map of an implicit integration, with exact sensitivities",
    options: &[
        MethodOption {
            key: "tolerance",
            dimension: Dimension::NONE,
            count: false,
            doc: "relative error per time step; orbits of laws that need equal time steps have 1000 times this error; default 1e-8",
        },
        MethodOption {
            key: WIDTH,
            dimension: Dimension::VELOCITY,
            count: false,
            doc: "smooths exact laws: friction changes sign over this velocity; without it, exact laws are refused",
        },
        PERIOD,
    ],
    build: |options| {
        let tolerance = options.get("tolerance").copied().unwrap_or(Shooting::default().tolerance);
        if !(1e-13..=1e-3).contains(&tolerance) {
            let message = format!("must lie between 1e-13 and 1e-3, found {tolerance}");
            return Err(MethodError::option(NAME, "tolerance", message));
        }
        Ok(Box::new(Shooting { tolerance, width: width(NAME, options)?, period: periods(NAME, options)? }))
    },
};

/// Method `shooting`: Newton's method on the period of an integration.
///
/// # Example
/// ```
/// use stickslip::law::CoulombArctan;
/// use std::sync::Arc;
/// use stickslip::method::{Method, shooting::Shooting};
/// let mut model = stickslip::model::example::blade_couple();
/// model.joints[0].law = Arc::new(CoulombArctan { limit: 2.0, alpha: 25e3 });
/// let system = model.assemble().unwrap();
/// let omega = std::f64::consts::TAU * 121.25;
/// let orbit = Shooting::default().solver(&system).unwrap().orbit(omega).unwrap();
/// assert!(orbit.evidence.residual < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shooting {
    /// Relative error per step of the integration.
    pub tolerance: f64,
    /// Velocity over which exact laws are smoothed, m/s; without it, exact laws are refused.
    pub width: Option<f64>,
    /// Excitation periods after which the motion repeats.
    pub period: usize,
}

impl Default for Shooting {
    fn default() -> Self {
        // Orbits of the couple are within 1e-7 (see the verification tests).
        Shooting { tolerance: 1e-8, width: None, period: 1 }
    }
}

impl Method for Shooting {
    fn name(&self) -> &'static str {
        NAME
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let shooter = ShootingSolver::new(system, *self, NAME, ClosingMethod::Newton)?;
        Ok(if self.period > 1 { Box::new(ColdRestart(shooter)) } else { Box::new(shooter) })
    }
}

/// The time integration.
enum StepIntegrator {
    Smooth(Box<RadauFlow>),
    Switched(Box<SetValuedFlow>),
    Incremental(Box<AverageAccelerationFlow>),
}

impl StepIntegrator {
    fn flow(&mut self) -> &mut dyn Flow {
        match self {
            StepIntegrator::Smooth(flow) => flow.as_mut(),
            StepIntegrator::Switched(flow) => flow.as_mut(),
            StepIntegrator::Incremental(flow) => flow.as_mut(),
        }
    }

    fn assembly(&self) -> &Assembly {
        match self {
            StepIntegrator::Smooth(flow) => &flow.assembly,
            StepIntegrator::Switched(flow) => &flow.assembly,
            StepIntegrator::Incremental(flow) => &flow.assembly,
        }
    }

    fn path(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> Trajectory {
        match self {
            StepIntegrator::Smooth(flow) => flow.stepped(system, symmetry, period),
            StepIntegrator::Switched(flow) => flow.stepped(system, symmetry, period),
            StepIntegrator::Incremental(flow) => flow.stepped(system, symmetry, period),
        }
    }
}

/// Finds orbits by time integration, by Newton's method or by waiting until the motion settles.
pub(super) struct ShootingSolver<'a> {
    settings: ShootingSettings,
    system: &'a System,
    shared: Arc<System>,
    /// Name of the method that uses this solver.
    name: &'static str,
    /// Search and relative error per step, relative to the vibration.
    relative_to_vibration: (ClosingMethod, f64),
    /// Size of the vibration over the size of its states.
    vibration_fraction: f64,
    /// Search and relative error per step, relative to the states.
    search: ClosingMethod,
    tolerance: f64,
    periods: usize,
    stepping: StepIntegrator,
    weights: Vec<f64>,
    omega: f64,
    duration: f64,
    /// Energy norm below which a state counts as at rest, √J.
    rest: f64,
    contracts: bool,
    /// Static equilibrium from which motions begin; `None` if no constant load acts.
    equilibrium: Option<StaticEquilibrium>,
}

impl ReturnMap for ShootingSolver<'_> {
    fn apply(&mut self, state: &mut [f64], derivative: Option<&mut DMatrix<f64>>) -> Result<(), IntegrationError> {
        let duration = self.duration;
        self.stepping.flow().run(state, duration, derivative)
    }
    fn weights(&self) -> &[f64] {
        &self.weights
    }
    fn report_change(&mut self, change: f64) {
        if let StepIntegrator::Smooth(flow) = &mut self.stepping {
            let apart = change > self.settings.settled * flow.tolerance;
            flow.lengths = if apart { StepSizes::Chosen } else { StepSizes::Halved };
        }
    }
}

impl OrbitMap for ShootingSolver<'_> {
    fn springs(&self) -> Vec<ElasticSlider> {
        match &self.stepping {
            StepIntegrator::Smooth(_) | StepIntegrator::Switched(_) => Vec::new(),
            StepIntegrator::Incremental(flow) => flow.springs(),
        }
    }
    fn limit(&mut self, springs: &[ElasticSlider]) {
        if let StepIntegrator::Incremental(flow) = &mut self.stepping {
            flow.limit(springs);
        }
    }
    fn finish(&mut self, closed: ClosedState) -> Result<Orbit, OrbitError> {
        self.record(&closed)?;
        let symmetry = self.search.symmetry(self.system, self.periods);
        Ok(self.orbit_of(self.omega, symmetry, closed))
    }
}

impl<'a> ShootingSolver<'a> {
    /// # Errors
    /// Fails if no integration takes a law, or if a place has no mass.
    pub fn new(
        system: &'a System,
        options: Shooting,
        name: &'static str,
        search: ClosingMethod,
    ) -> Result<Self, MethodError> {
        let stepping = match IntegratorKind::stepping(system, options.width) {
            IntegratorKind::Incremental => {
                StepIntegrator::Incremental(Box::new(AverageAccelerationFlow::new(system, options.width, name)?))
            }
            IntegratorKind::Switched => {
                StepIntegrator::Switched(Box::new(SetValuedFlow::new(system, options.tolerance, name)?))
            }
            // the assembly smooths exact laws if a width is given, else it refuses them
            IntegratorKind::Smooth | IntegratorKind::Exact => {
                let assembly = super::flow::radau::assembly(system, options.width, name)?;
                StepIntegrator::Smooth(Box::new(RadauFlow::new(assembly, options.tolerance)))
            }
        };
        Ok(ShootingSolver {
            settings: ShootingSettings::default(),
            system,
            shared: Arc::new(system.clone()),
            name,
            search,
            periods: options.period,
            relative_to_vibration: (search, options.tolerance),
            vibration_fraction: 1.0,
            tolerance: options.tolerance,
            weights: vec![1.0; stepping.assembly().states()],
            stepping,
            omega: 0.0,
            duration: 0.0,
            rest: 0.0,
            // the smoothed laws are passive if the exact laws are
            contracts: system.is_incrementally_stable(),
            equilibrium: StaticEquilibrium::under_load(system),
        })
    }

    fn first_state(&self, omega: f64) -> Vec<f64> {
        let assembly = self.stepping.assembly();
        let mut state = DescribingGuess::new(self.system, omega).state(assembly.n);
        let count = assembly.states() - state.len();
        let states = states_at(self.equilibrium.as_ref(), self.system, &state[..assembly.n], count);
        state.extend(states);
        state
    }

    /// Returns the orbit that the search finds.
    fn found(&mut self, start: Option<&[f64]>, symmetry: Symmetry, aim: ClosingTargets) -> Result<Orbit, OrbitError> {
        let closed = match self.stepping {
            StepIntegrator::Smooth(_) => self.smooth_orbit(start, aim)?,
            StepIntegrator::Switched(_) => self.switched_orbit(start, aim)?,
            StepIntegrator::Incremental(_) => self.stepped_orbit(start, aim)?,
        };
        Ok(self.orbit_of(aim.omega, symmetry, closed))
    }

    /// Returns the size of the vibration over the size of the state at t = 0; both are at least
    /// `rest` (√J).
    fn share_in(&self, orbit: &Orbit, rest: f64) -> f64 {
        vibration_share::fraction(
            orbit.path.as_ref(),
            (orbit.symmetry, orbit.period()),
            &orbit.initial_state,
            (&self.weights, rest),
        )
    }

    fn breakdown_error(&self, omega: f64) -> impl Fn(IntegrationError) -> OrbitError {
        let method = self.name;
        move |cause| OrbitError::Breakdown { method, omega, cause }
    }

    /// Returns the error that the vibration is too small a fraction of its state to have
    /// accurate digits.
    fn too_few_digits(&self, omega: f64, share: f64) -> OrbitError {
        self.breakdown_error(omega)(IntegrationError::Offset { share })
    }

    /// Finds the orbit of the stiff integration: a search, steps with the derivative of the
    /// search, and closing on fixed steps.
    fn smooth_orbit(&mut self, start: Option<&[f64]>, aim: ClosingTargets) -> Result<ClosedState, OrbitError> {
        let search = self.search;
        self.set_lengths(StepSizes::Chosen);
        if let ClosingMethod::Settle { tolerance, returns } = search {
            let fine = self.set_tolerance(self.tolerance.max(self.settings.coarse_settling * self.vibration_fraction));
            let coarse = ClosingMethod::Settle {
                tolerance: tolerance.max(self.settings.coarse_settling * self.vibration_fraction),
                returns: returns.min(self.settings.coarse_returns),
            };
            let near = coarse.find(self, start, |shooter| shooter.first_state(aim.omega), aim);
            self.set_tolerance(fine);
            let near = match near {
                Err(error @ OrbitError::Unsettled { .. }) => return Err(error),
                near => near.ok().map(|near| near.state),
            };
            // a settled motion stays as it is, independent of Newton's method
            let closed = search.find(self, near.as_deref().or(start), |shooter| shooter.first_state(aim.omega), aim)?;
            self.record(&closed)?;
            return Ok(closed);
        }
        let mut iterations = 0;
        let near = self.coarse_search(start, aim, &mut iterations);
        let start = near.as_ref().map(|near| near.state.as_slice()).or(start);
        let (near, fine) = match near {
            Some(near) if near.residual <= self.settings.coarse_residual => (near, self.long_steps() == self.tolerance),
            _ => {
                let near = search.find(self, start, |shooter| shooter.first_state(aim.omega), aim)?;
                iterations += near.iterations;
                (near, true)
            }
        };
        let (mut state, mut fits) = match self.refine_on_mesh((&near, fine), aim, &mut iterations) {
            Some(state) => (state, true),
            None => (near.state, false),
        };
        // the orbit on fixed steps is as good as the fit of the steps to the state: make new
        // steps until the state no longer moves
        let mut mesh = 0;
        loop {
            mesh += 1;
            if !fits {
                self.set_lengths(StepSizes::Chosen);
                self.apply(&mut state.clone(), None).map_err(self.breakdown_error(aim.omega))?;
            }
            self.set_lengths(StepSizes::Repeated);
            self.stepping.flow().set_recording(true);
            let residual = self.settings.closed;
            let closed = close(self, &state, ClosingTargets { residual, ..aim });
            self.stepping.flow().set_recording(false);
            let closed = closed?;
            iterations += closed.iterations;
            let moved: Vec<f64> = closed.state.iter().zip(&state).map(|(a, b)| a - b).collect();
            let moved = norm(&self.weights, &moved) / self.size(&closed.state, aim);
            if moved <= self.settings.settled * self.tolerance
                || (mesh == self.settings.meshes && moved <= self.settings.energy_gap)
            {
                // the last run was that of the closed state
                return Ok(ClosedState { iterations, ..closed });
            }
            if mesh == self.settings.meshes {
                return Err(OrbitError::not_converged(NAME, aim.omega, iterations, moved));
            }
            (state, fits) = (closed.state, false);
        }
    }

    /// Finds the orbit between located switches. The return map is smooth to the error of its
    /// steps.
    fn switched_orbit(&mut self, start: Option<&[f64]>, aim: ClosingTargets) -> Result<ClosedState, OrbitError> {
        let aim = ClosingTargets { residual: self.settings.closed_switched * self.vibration_fraction, ..aim };
        let closed = self.search.find(self, start, |shooter| shooter.first_state(aim.omega), aim)?;
        self.record(&closed)?;
        Ok(closed)
    }

    /// Returns the relative error per step of the coarse search.
    fn long_steps(&self) -> f64 {
        self.tolerance.max(self.settings.long_steps * self.vibration_fraction)
    }

    /// Approaches the orbit with long steps; returns `None` if they fail.
    fn coarse_search(
        &mut self,
        start: Option<&[f64]>,
        aim: ClosingTargets,
        iterations: &mut usize,
    ) -> Option<ClosedState> {
        let first = match start.filter(|state| state.len() == self.weights.len()) {
            Some(start) => start.to_vec(),
            None => self.first_state(aim.omega),
        };
        let fine = self.set_tolerance(self.long_steps());
        let residual = self.settings.coarse_residual;
        let near =
            newton_with_line_search(self, &first, ClosingTargets { residual, ..aim }, LargeIncrease::Ends, iterations);
        self.set_tolerance(fine);
        near.ok()
    }

    /// Moves the state of the search to one that fits the steps of the last run.
    ///
    /// It reuses the derivative of the search; its runs carry none. If the search was `fine`,
    /// the last run of the search is the first of these. Returns `None` if the steps do not
    /// shrink fast enough.
    fn refine_on_mesh(
        &mut self,
        (near, fine): (&ClosedState, bool),
        aim: ClosingTargets,
        iterations: &mut usize,
    ) -> Option<Vec<f64>> {
        let (mut state, mut before) = (near.state.clone(), f64::INFINITY);
        let mut known = fine.then(|| near.gap.clone());
        for _ in 0..self.settings.meshes {
            *iterations += 1;
            let gap = match known.take() {
                Some(gap) => gap,
                None => {
                    let mut end = state.clone();
                    self.apply(&mut end, None).ok()?;
                    DVector::from_fn(state.len(), |i, _| state[i] - aim.sign * end[i])
                }
            };
            let step = newton_step(&near.derivative, &gap, aim.sign, &self.weights);
            state.iter_mut().zip(step.iter()).for_each(|(z, d)| *z += d);
            let moved = norm(&self.weights, step.as_slice()) / self.size(&state, aim);
            if moved <= self.settings.settled * self.tolerance {
                return Some(state);
            }
            if moved.is_nan() || moved > self.settings.shrink_ratio * before {
                return None;
            }
            before = moved;
        }
        None
    }

    /// Returns the energy norm of a state, at least that of rest.
    fn size(&self, state: &[f64], aim: ClosingTargets) -> f64 {
        norm(&self.weights, state).max(aim.rest).max(f64::MIN_POSITIVE)
    }

    /// Runs from a closed state and records the motion.
    fn record(&mut self, closed: &ClosedState) -> Result<(), OrbitError> {
        self.stepping.flow().set_recording(true);
        let kept = self.apply(&mut closed.state.clone(), None);
        self.stepping.flow().set_recording(false);
        kept.map_err(self.breakdown_error(self.omega))
    }

    fn set_lengths(&mut self, lengths: StepSizes) {
        if let StepIntegrator::Smooth(flow) = &mut self.stepping {
            flow.lengths = lengths;
        }
    }

    /// Sets the relative error per step and returns the old one.
    fn set_tolerance(&mut self, tolerance: f64) -> f64 {
        match &mut self.stepping {
            StepIntegrator::Smooth(flow) => std::mem::replace(&mut flow.tolerance, tolerance),
            StepIntegrator::Switched(flow) => std::mem::replace(&mut flow.tolerance, tolerance),
            StepIntegrator::Incremental(_) => self.tolerance,
        }
    }

    /// Sets the vibration's fraction of the size of its states.
    fn set_share(&mut self, share: f64) {
        let (search, tolerance) = self.relative_to_vibration;
        (self.vibration_fraction, self.search, self.tolerance) = (share, search.of_share(share), share * tolerance);
        self.set_tolerance(self.tolerance);
    }

    fn set_count(&mut self, count: usize) {
        if let StepIntegrator::Incremental(flow) = &mut self.stepping {
            flow.count = count;
        }
    }

    /// Finds the orbit in equal steps, and halves the steps until the estimated error is below
    /// the tolerance.
    fn stepped_orbit(&mut self, start: Option<&[f64]>, aim: ClosingTargets) -> Result<ClosedState, OrbitError> {
        let steps = EqualStepSettings::default();
        let tolerance = self.settings.equal_steps * self.tolerance;
        let aim = ClosingTargets { residual: self.settings.closed_steps, ..aim };
        let search = self.search;
        let mut count = steps.initial_steps * self.periods;
        self.set_count(count);
        // steps too long for the states of a law are not a failure: halve them
        let mut coarse = loop {
            match search.find(self, start, |shooter| shooter.first_state(aim.omega), aim) {
                Err(OrbitError::Breakdown {
                    cause: IntegrationError::Stalled { .. } | IntegrationError::NotFinite { .. },
                    ..
                }) if count < steps.max_steps => {
                    count *= 2;
                    self.set_count(count);
                }
                found => break found?,
            }
        };
        let (mut earlier, mut motion) = (None, self.instants(&coarse)?);
        loop {
            count *= 2;
            self.set_count(count);
            let state = coarse.state.clone();
            let fine = match self.refined(&coarse, aim) {
                Some(fine) => fine,
                None => search.find(self, Some(&state), |shooter| shooter.first_state(aim.omega), aim)?,
            };
            let finer = self.instants(&fine)?;
            let apart = motion.iter().zip(&finer).map(|(before, now)| self.relative_distance(now, before, aim));
            let last = apart.fold(self.relative_distance(&fine.state, &coarse.state, aim), f64::max);
            let error = estimate(earlier, last);
            let iterations = coarse.iterations + fine.iterations;
            if error <= tolerance {
                let missing = Some(error.max(fine.distance.unwrap_or(0.0)));
                return Ok(ClosedState { iterations, distance: missing, ..fine });
            }
            if count >= steps.max_steps {
                let cause = IntegrationError::Unresolved { steps: count, estimate: error, tolerance };
                return Err(OrbitError::Breakdown { method: self.name, omega: aim.omega, cause });
            }
            (earlier, motion, coarse) = (Some(last), finer, ClosedState { iterations, ..fine });
        }
    }

    /// Records a closed motion and returns its displacements and velocities at instants of its
    /// return.
    ///
    /// With the free offset of a stuck contact, two different motions may begin with equal
    /// states.
    fn instants(&mut self, closed: &ClosedState) -> Result<Vec<Vec<f64>>, OrbitError> {
        self.record(closed)?;
        let path = self.stepping.path(&self.shared, Symmetry::FullPeriod, self.duration);
        let at = |k: usize| {
            let sample = path.sample(self.duration * k as f64 / self.settings.instants as f64);
            sample.displacement.into_iter().chain(sample.velocity).collect()
        };
        Ok((0..self.settings.instants).map(at).collect())
    }

    /// Finds the settled orbit in finer steps by Newton's method; returns `None` if that fails
    /// or leads to another orbit.
    fn refined(&mut self, settled: &ClosedState, aim: ClosingTargets) -> Option<ClosedState> {
        if self.search == ClosingMethod::Newton {
            return None;
        }
        let fine = close(self, &settled.state, aim).ok()?;
        (self.relative_distance(&fine.state, &settled.state, aim) <= self.settings.same_orbit).then_some(fine)
    }

    /// Returns the distance of two states, or of their displacements and velocities, relative
    /// to the first.
    fn relative_distance(&self, state: &[f64], other: &[f64], aim: ClosingTargets) -> f64 {
        let change: Vec<f64> = state.iter().zip(other).map(|(a, b)| a - b).collect();
        norm(&self.weights, &change) / self.size(state, aim)
    }

    /// Makes the orbit from its last recorded run.
    fn orbit_of(&self, omega: f64, symmetry: Symmetry, closed: ClosedState) -> Orbit {
        let period = self.periods as f64 * std::f64::consts::TAU / omega;
        let path = self.stepping.path(&self.shared, symmetry, period);
        let Ok(measured) = results(self.system, &path, omega, (symmetry, period));
        let laws = self.stepping.assembly().joints.iter().map(|joint| &joint.law);
        // a joint may stick right up to its limit. Its derivative is then that of an instant of
        // slip, which does not hold for nearby motions that stick
        let at_its_limit = measured.stuck.iter().any(|&joint| measured.joints[joint].slip_fraction > 0.0);
        let stuck = measured.stuck_names();
        // the residual of the closed state may do work on a vibration as small as rest
        let left = self.settings.closed * norm(&self.weights, &closed.state) * self.rest;
        let least = f64::max(CONSERVATIVE_WORK * self.rest * self.rest, left / self.settings.energy_gap);
        Orbit {
            method: self.name,
            omega,
            periods: self.periods,
            symmetry,
            initial_state: closed.state,
            evidence: Evidence {
                residual: closed.residual,
                energy_gap: measured.energy_gap(least),
                switches: measured.joints.iter().map(|joint| joint.switches).sum(),
                iterations: closed.iterations,
                harmonics: None,
                error_estimate: closed.distance,
                accuracy: Accuracy::Converged,
                return_defect: Some(closed.residual),
                history_dependent: history_dependent_joints(laws, &measured.joints, &stuck, symmetry),
                stuck,
                history_spread: None,
                found_by: self.name,
                fallback_from: None,
            },
            places: measured.places,
            joints: measured.joints,
            energy: measured.energy,
            return_map: if at_its_limit { DMatrix::zeros(0, 0) } else { closed.derivative },
            contracts: self.contracts,
            path: Arc::new(path),
            series: None,
        }
    }
}

impl Solver for ShootingSolver<'_> {
    fn solve(&mut self, request: &Request<'_>, _budget: &mut Budget) -> Result<Orbit, OrbitError> {
        let steps = EqualStepSettings::default();
        let (omega, start) = (request.omega, request.seed.map(|seed| &seed.state[..]));
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        let flow = self.stepping.flow();
        flow.set_excitation(self.system, omega);
        self.weights = flow.weights();
        let rest = NEAR_REST * flow.energy_scale();
        self.rest = rest;
        let flow = self.stepping.flow();
        flow.set_recording(false);
        let symmetry = self.search.symmetry(self.system, self.periods);
        let (sign, share) = if symmetry == Symmetry::HalfPeriod { (-1.0, 0.5) } else { (1.0, 1.0) };
        self.omega = omega;
        self.duration = share * self.periods as f64 * std::f64::consts::TAU / omega;
        let aim = ClosingTargets {
            method: self.name,
            omega,
            residual: self.settings.free_residual,
            distance: f64::INFINITY,
            sign,
            rest,
        };
        let near;
        let known = start.filter(|state| state.len() == self.weights.len());
        let start = if self.periods > 1 && known.is_none() {
            self.set_lengths(StepSizes::Chosen);
            self.set_count(steps.initial_steps * self.periods);
            let first = self.first_state(omega);
            near = iterate_map(self, first, sign);
            Some(near.as_slice())
        } else {
            known
        };
        // neighbouring orbits have almost the same fraction of vibration
        self.set_share(if known.is_some() { self.vibration_fraction } else { 1.0 });
        let mut orbit = match self.found(start, symmetry, aim) {
            // the neighbour's fraction may be too small for this orbit
            Err(_) if self.vibration_fraction < 1.0 => {
                self.set_share(1.0);
                self.found(start, symmetry, aim)?
            }
            found => found?,
        };
        while let Some(share) = vibration_share::next_fraction(self.vibration_fraction, self.share_in(&orbit, rest))
            .map_err(self.breakdown_error(omega))?
        {
            self.set_share(share);
            // an orbit accurate as a state but not as a vibration has too few digits
            orbit =
                self.found(Some(&orbit.initial_state), symmetry, aim).map_err(|_| self.too_few_digits(omega, share))?;
        }
        if self.search == ClosingMethod::Newton {
            let system = self.system;
            let equilibrium = self.equilibrium.clone();
            let aim = ClosingTargets { residual: self.settings.closed_steps, ..aim };
            orbit = select_equilibrium_orbit(self, (system, equilibrium.as_ref()), orbit, aim);
        }
        let share = self.share_in(&orbit, rest);
        vibration_share::rescale_evidence(&mut orbit.evidence, share);
        let allowed = self.settings.energy_gap
            + EventDrivenSettings::default().gap_per_distance * orbit.evidence.error_estimate.unwrap_or(0.0);
        if orbit.evidence.energy_gap > allowed {
            if share < self.settings.small_vibration {
                return Err(self.too_few_digits(omega, share));
            }
            return Err(OrbitError::Evidence { method: self.name, omega, energy_gap: orbit.evidence.energy_gap });
        }
        Ok(orbit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Gap;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring};

    /// A constant force presses a mass against a stop. It rests at `(f + k₂ gap) / (k + k₂)`,
    /// and no force does work.
    #[test]
    fn rest_under_a_constant_force_balances() {
        let between = || ["m".to_owned(), GROUND.to_owned()];
        let model = Model {
            masses: vec![Mass::new("m", 1.0)],
            springs: vec![Spring { between: between(), stiffness: 1e3, damping: 1.0 }],
            joints: vec![Joint {
                name: "j".into(),
                between: between(),
                law: Arc::new(Gap { gap: 1e-3, stiffness: 800.0 }),
            }],
            forces: vec![Force { on: "m".into(), amplitude: 3.0, phase: 0.0, harmonic: 0 }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let orbit = Shooting::default().solver(&system).unwrap().orbit(20.0).unwrap();
        let (place, expected) = (&orbit.places[0], 3.8 / 1.8e3);
        assert!((place.mean / expected - 1.0).abs() < 1e-9 && place.amplitude() < 1e-9 * expected, "{place:?}");
        assert!(orbit.evidence.energy_gap < 1e-5, "{:?}", orbit.evidence);
    }
}
