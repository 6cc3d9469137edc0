//! Newton's method on the period of an integration: stiff and of high order for smooth laws, in equal steps for laws that know only steps and for
//! mixtures.
//!
//! The arctan law creeps in stick with time constants of seconds, so that waiting for a transient to die proves nothing; the
//! return map of the integrator with its exact derivative is closed by Newton's method instead.

use super::assembly::{Assembly, NEAR_REST};
use super::event_driven::MISSING_WORK;
use super::flow::Flow;
use super::followed::Kind;
use super::guess::Guess;
use super::incremental::flow::{FIRST, IncrementalFlow, MOST, estimate};
use super::option::{PERIOD, periods, width};
use super::periodic::{Aim, Beyond, Closed, ReturnMap, Search, approached, close, descended, newton_step, norm};
use super::repeated::Afresh;
use super::residual_traction::{Closing, ElasticSlider, as_in_equilibrium};
use super::smooth::flow::{Lengths, SmoothFlow};
use super::static_equilibrium::{StaticEquilibrium, states_at};
use super::stepped::SteppedPath;
use super::switched::flow::SwitchedFlow;
use super::{Breakdown, Method, MethodError, MethodInfo, MethodOption, OrbitError, Solver, WIDTH, vibration};
use crate::dimension::Dimension;
use crate::model::System;
use crate::orbit::measure::{NO_WORK, measure};
use crate::orbit::{Accuracy, Evidence, Orbit, Path, Symmetry, history};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

const NAME: &str = "shooting";

/// Relative error per step when none is given: orbits of the paper's couple are then within 1e-7 (see the verification tests).
const TOLERANCE: f64 = 1e-8;
/// A step with the derivative of that search leaves at most this share of what the one before moved.
const CLOSER: f64 = 0.3;
/// Residual of the first search, in which every run chooses its steps anew: the map is then smooth only to about their error.
const NEAR: f64 = 1e-6;
/// Relative error per step, and residual, of the approach before that search, for orbits that are asked for in shorter steps. Longer ones jump over
/// layers, and would take two thirds of the time of these.
const LONG_STEPS: f64 = 1e-8;
const COARSE_RESIDUAL: f64 = 1e-5;
/// Residual at which the orbit is closed on the steps of the last free run, on which the map is smooth.
const CLOSED: f64 = 1e-11;
/// The same of an orbit between located switches, where every run chooses its steps.
const CLOSED_SWITCHED: f64 = 1e-10;
/// Meshes made for one orbit: the first is as good as the first search, the second nearly always enough.
const MESHES: usize = 6;
/// A mesh is good when closing the orbit on it moves the state by at most this many times the error per step: that is what the
/// choice of the steps alone does. A motion that is waited for and changes by no more from one return to the next goes on in the same steps.
const SETTLED: f64 = 100.0;
/// Energy gap above which an orbit is not reported as converged, and what the last mesh may move it by, relative.
const ENERGY_GAP: f64 = 1e-5;
/// Error of an orbit in equal steps, in errors per step of the stiff integration: 1e-5 of the motion when no tolerance is given.
const EQUAL_STEPS: f64 = 1e3;
/// Residual at which an orbit in equal steps is closed.
const CLOSED_STEPS: f64 = 1e-10;
/// Relative error per step, and distance to the orbit, with which a motion is waited for at first: no digits are needed on the way.
const COARSE: f64 = 1e-5;
/// Returns for which it is waited so. What is not near the orbit by then is followed as exactly as the orbit from the start.
const COARSE_RETURNS: usize = 1024;
/// Orbits in steps of twice the length differ by less than this share of the motion where they are the same one: 256 steps of a period err by 1e-3
/// at a Q of ten, and in proportion to it.
const NEIGHBOUR: f64 = 0.1;
/// Instants of a return at which such orbits are compared.
const INSTANTS: usize = 8;

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "smooth laws and laws of steps: Newton on the period of an implicit integration, exact sensitivities",
    options: &[
        MethodOption {
            key: "tolerance",
            dimension: Dimension::NONE,
            count: false,
            doc: "relative error per step of the integration, a thousandth of that of orbits in equal steps; 1e-8 when absent",
        },
        MethodOption {
            key: WIDTH,
            dimension: Dimension::VELOCITY,
            count: false,
            doc: "replaces exact laws by smooth ones that change sign over this velocity; exact laws are refused when absent",
        },
        PERIOD,
    ],
    build: |options| {
        let tolerance = options.get("tolerance").copied().unwrap_or(TOLERANCE);
        if !(1e-13..=1e-3).contains(&tolerance) {
            let message = format!("must lie between 1e-13 and 1e-3, found {tolerance}");
            return Err(MethodError::option(NAME, "tolerance", message));
        }
        Ok(Box::new(Shooting { tolerance, width: width(NAME, options)?, period: periods(NAME, options)? }))
    },
};

/// Shooting on smooth laws.
///
/// # Example
/// ```
/// use stickslip::law::CoulombArctan;
/// use std::sync::Arc;
/// use stickslip::method::{Method, shooting::Shooting};
/// let mut model = stickslip::model::example::blade_couple();
/// model.joints[0].law = Arc::new(CoulombArctan { limit: 2.0, alpha: 25e3 });
/// let system = model.assemble().unwrap();
/// let orbit = Shooting::default().solver(&system).unwrap().orbit(std::f64::consts::TAU * 121.25, None).unwrap();
/// assert!(orbit.evidence.residual < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shooting {
    /// Relative error per step of the integration.
    pub tolerance: f64,
    /// Velocity over which exact laws are smoothed, m/s; without it exact laws are refused.
    pub width: Option<f64>,
    /// Periods of the drive after which the motion repeats.
    pub period: usize,
}

impl Default for Shooting {
    fn default() -> Self {
        Shooting { tolerance: TOLERANCE, width: None, period: 1 }
    }
}

impl Method for Shooting {
    fn name(&self) -> &'static str {
        NAME
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let shooter = Shooter::new(system, *self, NAME, Search::Newton)?;
        Ok(if self.period > 1 { Box::new(Afresh(shooter)) } else { Box::new(shooter) })
    }
}

/// How the motion is integrated.
enum Stepping {
    Smooth(Box<SmoothFlow>),
    Switched(Box<SwitchedFlow>),
    Incremental(Box<IncrementalFlow>),
}

impl Stepping {
    fn flow(&mut self) -> &mut dyn Flow {
        match self {
            Stepping::Smooth(flow) => flow.as_mut(),
            Stepping::Switched(flow) => flow.as_mut(),
            Stepping::Incremental(flow) => flow.as_mut(),
        }
    }

    fn assembly(&self) -> &Assembly {
        match self {
            Stepping::Smooth(flow) => &flow.assembly,
            Stepping::Switched(flow) => &flow.assembly,
            Stepping::Incremental(flow) => &flow.assembly,
        }
    }

    fn path(&self, system: &Arc<System>, symmetry: Symmetry, period: f64) -> SteppedPath {
        match self {
            Stepping::Smooth(flow) => flow.stepped(system, symmetry, period),
            Stepping::Switched(flow) => flow.stepped(system, symmetry, period),
            Stepping::Incremental(flow) => flow.stepped(system, symmetry, period),
        }
    }
}

/// Finds orbits by integration, with either search.
pub(super) struct Shooter<'a> {
    system: &'a System,
    shared: Arc<System>,
    /// The method that it works for.
    name: &'static str,
    /// Search, and relative error per step, of the vibration.
    asked: (Search, f64),
    /// The vibration's share of the size of its states.
    share: f64,
    /// The same search and error relative to the states.
    search: Search,
    tolerance: f64,
    periods: usize,
    stepping: Stepping,
    weights: Vec<f64>,
    omega: f64,
    duration: f64,
    /// Energy norm below which a state counts as rest, √J.
    rest: f64,
    contracts: bool,
    /// Where a motion begins; none where no constant load acts.
    equilibrium: Option<StaticEquilibrium>,
}

impl ReturnMap for Shooter<'_> {
    fn returned(&mut self, state: &mut [f64], derivative: Option<&mut DMatrix<f64>>) -> Result<(), Breakdown> {
        let duration = self.duration;
        self.stepping.flow().run(state, duration, derivative)
    }
    fn weights(&self) -> &[f64] {
        &self.weights
    }
    fn moves(&mut self, change: f64) {
        if let Stepping::Smooth(flow) = &mut self.stepping {
            let apart = change > SETTLED * flow.tolerance;
            flow.lengths = if apart { Lengths::Chosen } else { Lengths::Halved };
        }
    }
}

impl Closing for Shooter<'_> {
    fn springs(&self) -> Vec<ElasticSlider> {
        match &self.stepping {
            Stepping::Smooth(_) | Stepping::Switched(_) => Vec::new(),
            Stepping::Incremental(flow) => flow.springs(),
        }
    }
    fn limit(&mut self, springs: &[ElasticSlider]) {
        if let Stepping::Incremental(flow) = &mut self.stepping {
            flow.limit(springs);
        }
    }
    fn finish(&mut self, closed: Closed) -> Result<Orbit, OrbitError> {
        self.record(&closed)?;
        let symmetry = self.search.symmetry(self.system, self.periods);
        Ok(self.orbit_of(self.omega, symmetry, closed))
    }
}

impl<'a> Shooter<'a> {
    /// # Errors
    /// A law that no integration takes, a place without mass.
    pub fn new(system: &'a System, options: Shooting, name: &'static str, search: Search) -> Result<Self, MethodError> {
        let stepping = match Kind::integrated(system, options.width) {
            Kind::Incremental => Stepping::Incremental(Box::new(IncrementalFlow::new(system, options.width, name)?)),
            Kind::Switched => Stepping::Switched(Box::new(SwitchedFlow::new(system, options.tolerance, name)?)),
            // exact laws, if they are meant to be smoothed, are told so by the assembly
            Kind::Smooth | Kind::Exact => {
                let assembly = super::smooth::assembly(system, options.width, name)?;
                Stepping::Smooth(Box::new(SmoothFlow::new(assembly, options.tolerance)))
            }
        };
        Ok(Shooter {
            system,
            shared: Arc::new(system.clone()),
            name,
            search,
            periods: options.period,
            asked: (search, options.tolerance),
            share: 1.0,
            tolerance: options.tolerance,
            weights: vec![1.0; stepping.assembly().states()],
            stepping,
            omega: 0.0,
            duration: 0.0,
            rest: 0.0,
            // smooth neighbours are passive where the exact laws are
            contracts: system.contracts(),
            equilibrium: StaticEquilibrium::under_load(system),
        })
    }

    fn first_state(&self, omega: f64) -> Vec<f64> {
        let assembly = self.stepping.assembly();
        let mut state = Guess::new(self.system, omega).state(assembly.n);
        let count = assembly.states() - state.len();
        let states = states_at(self.equilibrium.as_ref(), self.system, &state[..assembly.n], count);
        state.extend(states);
        state
    }

    /// The orbit of the search.
    fn found(&mut self, start: Option<&[f64]>, symmetry: Symmetry, aim: Aim) -> Result<Orbit, OrbitError> {
        let closed = match self.stepping {
            Stepping::Smooth(_) => self.smooth_orbit(start, aim)?,
            Stepping::Switched(_) => self.switched_orbit(start, aim)?,
            Stepping::Incremental(_) => self.stepped_orbit(start, aim)?,
        };
        Ok(self.orbit_of(aim.omega, symmetry, closed))
    }

    /// The vibration's share of the size of the state at t = 0; less than `rest` (√J) counts as that.
    fn share_in(&self, orbit: &Orbit, rest: f64) -> f64 {
        vibration::share(orbit.path.as_ref(), (orbit.symmetry, orbit.period()), &orbit.start, (&self.weights, rest))
    }

    fn broke(&self, omega: f64) -> impl Fn(Breakdown) -> OrbitError {
        let method = self.name;
        move |cause| OrbitError::Breakdown { method, omega, cause }
    }

    /// The vibration is so small a share of its state that the digits are missing.
    fn lost(&self, omega: f64, share: f64) -> OrbitError {
        self.broke(omega)(Breakdown::Offset { share })
    }

    /// The orbit of the stiff integration: searched, brought near, and closed on the steps of one run.
    fn smooth_orbit(&mut self, start: Option<&[f64]>, aim: Aim) -> Result<Closed, OrbitError> {
        let search = self.search;
        self.set_lengths(Lengths::Chosen);
        if let Search::Settle { tolerance, returns } = search {
            let fine = self.set_tolerance(self.tolerance.max(COARSE * self.share));
            let coarse =
                Search::Settle { tolerance: tolerance.max(COARSE * self.share), returns: returns.min(COARSE_RETURNS) };
            let near = coarse.find(self, start, |shooter| shooter.first_state(aim.omega), aim);
            self.set_tolerance(fine);
            let near = match near {
                Err(error @ OrbitError::Unsettled { .. }) => return Err(error),
                near => near.ok().map(|near| near.state),
            };
            // a settled motion is left as it is: nothing but time has found it
            let closed = search.find(self, near.as_deref().or(start), |shooter| shooter.first_state(aim.omega), aim)?;
            self.record(&closed)?;
            return Ok(closed);
        }
        let mut iterations = 0;
        let near = self.coarsely(start, aim, &mut iterations);
        let start = near.as_ref().map(|near| near.state.as_slice()).or(start);
        let (near, fine) = match near {
            Some(near) if near.residual <= COARSE_RESIDUAL => (near, self.long_steps() == self.tolerance),
            _ => {
                let near = search.find(self, start, |shooter| shooter.first_state(aim.omega), aim)?;
                iterations += near.iterations;
                (near, true)
            }
        };
        let (mut state, mut fits) = match self.brought_near((&near, fine), aim, &mut iterations) {
            Some(state) => (state, true),
            None => (near.state, false),
        };
        // steps made for a state close the orbit only as well as they fit it: make them anew until that moves it no more
        let mut mesh = 0;
        loop {
            mesh += 1;
            if !fits {
                self.set_lengths(Lengths::Chosen);
                self.returned(&mut state.clone(), None).map_err(self.broke(aim.omega))?;
            }
            self.set_lengths(Lengths::Repeated);
            self.stepping.flow().keep(true);
            let closed = close(self, &state, Aim { residual: CLOSED, ..aim });
            self.stepping.flow().keep(false);
            let closed = closed?;
            iterations += closed.iterations;
            let moved: Vec<f64> = closed.state.iter().zip(&state).map(|(a, b)| a - b).collect();
            let moved = norm(&self.weights, &moved) / self.size(&closed.state, aim);
            if moved <= SETTLED * self.tolerance || (mesh == MESHES && moved <= ENERGY_GAP) {
                // the last run of the iteration was that of the closed state
                return Ok(Closed { iterations, ..closed });
            }
            if mesh == MESHES {
                return Err(OrbitError::not_converged(NAME, aim.omega, iterations, moved));
            }
            (state, fits) = (closed.state, false);
        }
    }

    /// The orbit between located switches: the return is smooth to the error of its steps.
    fn switched_orbit(&mut self, start: Option<&[f64]>, aim: Aim) -> Result<Closed, OrbitError> {
        let aim = Aim { residual: CLOSED_SWITCHED * self.share, ..aim };
        let closed = self.search.find(self, start, |shooter| shooter.first_state(aim.omega), aim)?;
        self.record(&closed)?;
        Ok(closed)
    }

    /// Relative error per step of the approach.
    fn long_steps(&self) -> f64 {
        self.tolerance.max(LONG_STEPS * self.share)
    }

    /// How near to the orbit one comes in long steps; `None` where they lead nowhere.
    fn coarsely(&mut self, start: Option<&[f64]>, aim: Aim, iterations: &mut usize) -> Option<Closed> {
        let first = match start.filter(|state| state.len() == self.weights.len()) {
            Some(start) => start.to_vec(),
            None => self.first_state(aim.omega),
        };
        let fine = self.set_tolerance(self.long_steps());
        let near = descended(self, &first, Aim { residual: COARSE_RESIDUAL, ..aim }, Beyond::Ends, iterations);
        self.set_tolerance(fine);
        near.ok()
    }

    /// From the orbit that the search has found to a state for which the steps of the last run were made, with the derivative of the search and
    /// runs that carry none; `None` if that does not come closer. If the search was `fine`, its own last run is the first of them.
    fn brought_near(&mut self, (near, fine): (&Closed, bool), aim: Aim, iterations: &mut usize) -> Option<Vec<f64>> {
        let (mut state, mut before) = (near.state.clone(), f64::INFINITY);
        let mut known = fine.then(|| near.gap.clone());
        for _ in 0..MESHES {
            *iterations += 1;
            let gap = match known.take() {
                Some(gap) => gap,
                None => {
                    let mut end = state.clone();
                    self.returned(&mut end, None).ok()?;
                    DVector::from_fn(state.len(), |i, _| state[i] - aim.sign * end[i])
                }
            };
            let step = newton_step(&near.derivative, &gap, aim.sign, &self.weights);
            state.iter_mut().zip(step.iter()).for_each(|(z, d)| *z += d);
            let moved = norm(&self.weights, step.as_slice()) / self.size(&state, aim);
            if moved <= SETTLED * self.tolerance {
                return Some(state);
            }
            if moved.is_nan() || moved > CLOSER * before {
                return None;
            }
            before = moved;
        }
        None
    }

    /// Energy norm of a state, or of rest.
    fn size(&self, state: &[f64], aim: Aim) -> f64 {
        norm(&self.weights, state).max(aim.rest).max(f64::MIN_POSITIVE)
    }

    /// Runs from a closed state and keeps the motion.
    fn record(&mut self, closed: &Closed) -> Result<(), OrbitError> {
        self.stepping.flow().keep(true);
        let kept = self.returned(&mut closed.state.clone(), None);
        self.stepping.flow().keep(false);
        kept.map_err(self.broke(self.omega))
    }

    fn set_lengths(&mut self, lengths: Lengths) {
        if let Stepping::Smooth(flow) = &mut self.stepping {
            flow.lengths = lengths;
        }
    }

    /// Sets the relative error per step; returns what it was.
    fn set_tolerance(&mut self, tolerance: f64) -> f64 {
        match &mut self.stepping {
            Stepping::Smooth(flow) => std::mem::replace(&mut flow.tolerance, tolerance),
            Stepping::Switched(flow) => std::mem::replace(&mut flow.tolerance, tolerance),
            Stepping::Incremental(_) => self.tolerance,
        }
    }

    /// Takes the vibration for this share of the size of its states.
    fn set_share(&mut self, share: f64) {
        let (search, tolerance) = self.asked;
        (self.share, self.search, self.tolerance) = (share, search.of_share(share), share * tolerance);
        self.set_tolerance(self.tolerance);
    }

    fn set_count(&mut self, count: usize) {
        if let Stepping::Incremental(flow) = &mut self.stepping {
            flow.count = count;
        }
    }

    /// The orbit in equal steps, which are halved until that changes it by less than the tolerance.
    fn stepped_orbit(&mut self, start: Option<&[f64]>, aim: Aim) -> Result<Closed, OrbitError> {
        let tolerance = EQUAL_STEPS * self.tolerance;
        let aim = Aim { residual: CLOSED_STEPS, ..aim };
        let search = self.search;
        let mut count = FIRST * self.periods;
        self.set_count(count);
        // steps that are too long for a law's states are no reason to give up
        let mut coarse = loop {
            match search.find(self, start, |shooter| shooter.first_state(aim.omega), aim) {
                Err(OrbitError::Breakdown {
                    cause: Breakdown::Stalled { .. } | Breakdown::NoNumber { .. }, ..
                }) if count < MOST => {
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
            let apart = motion.iter().zip(&finer).map(|(before, now)| self.apart(now, before, aim));
            let last = apart.fold(self.apart(&fine.state, &coarse.state, aim), f64::max);
            let error = estimate(earlier, last);
            let iterations = coarse.iterations + fine.iterations;
            if error <= tolerance {
                let missing = Some(error.max(fine.missing.unwrap_or(0.0)));
                return Ok(Closed { iterations, missing, ..fine });
            }
            if count >= MOST {
                let cause = Breakdown::Unresolved { steps: count, estimate: error, tolerance };
                return Err(OrbitError::Breakdown { method: self.name, omega: aim.omega, cause });
            }
            (earlier, motion, coarse) = (Some(last), finer, Closed { iterations, ..fine });
        }
    }

    /// Displacements and velocities of a closed motion, which is kept, at instants of its return: where a contact that sticks leaves an offset open,
    /// two motions may begin alike and differ.
    fn instants(&mut self, closed: &Closed) -> Result<Vec<Vec<f64>>, OrbitError> {
        self.record(closed)?;
        let path = self.stepping.path(&self.shared, Symmetry::FullPeriod, self.duration);
        let at = |k: usize| {
            let sample = path.sample(self.duration * k as f64 / INSTANTS as f64);
            sample.displacement.into_iter().chain(sample.velocity).collect()
        };
        Ok((0..INSTANTS).map(at).collect())
    }

    /// The orbit to which a motion has settled, in finer steps: Newton's method takes it there, and not to another one.
    fn refined(&mut self, settled: &Closed, aim: Aim) -> Option<Closed> {
        if self.search == Search::Newton {
            return None;
        }
        let fine = close(self, &settled.state, aim).ok()?;
        (self.apart(&fine.state, &settled.state, aim) <= NEIGHBOUR).then_some(fine)
    }

    /// Distance of two states, or of their displacements and velocities, relative to the first.
    fn apart(&self, state: &[f64], other: &[f64], aim: Aim) -> f64 {
        let change: Vec<f64> = state.iter().zip(other).map(|(a, b)| a - b).collect();
        norm(&self.weights, &change) / self.size(state, aim)
    }

    /// Puts the orbit together from its last, kept run.
    fn orbit_of(&self, omega: f64, symmetry: Symmetry, closed: Closed) -> Orbit {
        let period = self.periods as f64 * std::f64::consts::TAU / omega;
        let path = self.stepping.path(&self.shared, symmetry, period);
        let Ok(measured) = measure(self.system, &path, omega, (symmetry, period));
        let laws = self.stepping.assembly().joints.iter().map(|joint| &joint.law);
        // of what sticks up to its very limit the derivative is that of an instant of slip, and says nothing of the neighbours that stick
        let at_its_limit =
            measured.joints.iter().any(|joint| joint.slip_fraction > 0.0 && measured.stuck.contains(&joint.name));
        // what closing leaves of a state may have worked on a vibration as small as rest
        let left = CLOSED * norm(&self.weights, &closed.state) * self.rest;
        let least = f64::max(NO_WORK * self.rest * self.rest, left / ENERGY_GAP);
        Orbit {
            method: self.name,
            omega,
            periods: self.periods,
            symmetry,
            start: closed.state,
            evidence: Evidence {
                residual: closed.residual,
                energy_gap: measured.energy_gap(least),
                switches: measured.joints.iter().map(|joint| joint.switches).sum(),
                iterations: closed.iterations,
                harmonics: None,
                truncation: closed.missing,
                accuracy: Accuracy::Converged,
                return_defect: Some(closed.residual),
                history: history(laws, &measured.joints, &measured.stuck, symmetry),
                stuck: measured.stuck,
                history_spread: None,
                found_by: self.name,
                instead_of: None,
            },
            places: measured.places,
            joints: measured.joints,
            energy: measured.energy,
            return_map: if at_its_limit { DMatrix::zeros(0, 0) } else { closed.derivative },
            contracts: self.contracts,
            path: Arc::new(path),
        }
    }
}

impl Solver for Shooter<'_> {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        let flow = self.stepping.flow();
        flow.set_drive(self.system, omega);
        self.weights = flow.weights();
        let rest = NEAR_REST * flow.energy_scale();
        self.rest = rest;
        let flow = self.stepping.flow();
        flow.keep(false);
        let symmetry = self.search.symmetry(self.system, self.periods);
        let (sign, share) = if symmetry == Symmetry::HalfPeriod { (-1.0, 0.5) } else { (1.0, 1.0) };
        self.omega = omega;
        self.duration = share * self.periods as f64 * std::f64::consts::TAU / omega;
        let aim = Aim { method: self.name, omega, residual: NEAR, distance: f64::INFINITY, sign, rest };
        let near;
        let known = start.filter(|state| state.len() == self.weights.len());
        let start = if self.periods > 1 && known.is_none() {
            self.set_lengths(Lengths::Chosen);
            self.set_count(FIRST * self.periods);
            let first = self.first_state(omega);
            near = approached(self, first, sign);
            Some(near.as_slice())
        } else {
            known
        };
        // neighbours vibrate by much the same share
        self.set_share(if known.is_some() { self.share } else { 1.0 });
        let mut orbit = match self.found(start, symmetry, aim) {
            // the neighbour's share may be too small for this one
            Err(_) if self.share < 1.0 => {
                self.set_share(1.0);
                self.found(start, symmetry, aim)?
            }
            found => found?,
        };
        while let Some(share) = vibration::next(self.share, self.share_in(&orbit, rest)).map_err(self.broke(omega))? {
            self.set_share(share);
            // what is found as a state and not as a vibration lacks the digits of that
            orbit = self.found(Some(&orbit.start), symmetry, aim).map_err(|_| self.lost(omega, share))?;
        }
        if self.search == Search::Newton {
            let system = self.system;
            let equilibrium = self.equilibrium.clone();
            let aim = Aim { residual: CLOSED_STEPS, ..aim };
            orbit = as_in_equilibrium(self, (system, equilibrium.as_ref()), orbit, aim);
        }
        let share = self.share_in(&orbit, rest);
        vibration::relate(&mut orbit.evidence, share);
        let allowed = ENERGY_GAP + MISSING_WORK * orbit.evidence.truncation.unwrap_or(0.0);
        if orbit.evidence.energy_gap > allowed {
            if share < vibration::SMALL {
                return Err(self.lost(omega, share));
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

    /// A constant force presses a mass against a stop: it rests at `(f + k₂ gap) / (k + k₂)`, and nothing works.
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
        let orbit = Shooting::default().solver(&system).unwrap().orbit(20.0, None).unwrap();
        let (place, expected) = (&orbit.places[0], 3.8 / 1.8e3);
        assert!((place.mean / expected - 1.0).abs() < 1e-9 && place.amplitude() < 1e-9 * expected, "{place:?}");
        assert!(orbit.evidence.energy_gap < 1e-5, "{:?}", orbit.evidence);
    }
}
