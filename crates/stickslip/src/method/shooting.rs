//! Newton's method on the period of a stiff integration, for smooth laws.
//!
//! The arctan law creeps in stick with time constants of seconds, so that waiting for a transient to die proves nothing; the
//! return map of the integrator with its exact derivative is closed by Newton's method instead.

use super::drive::Drive;
use super::event_driven::MISSING_WORK;
use super::guess::Guess;
use super::periodic::{Aim, Closed, ReturnMap, Search, close, norm};
use super::smooth::flow::SmoothFlow;
use super::smooth::path;
use super::smooth::step::Structure;
use super::{Breakdown, Method, MethodError, MethodInfo, MethodOption, OrbitError, Solver};
use crate::dimension::Dimension;
use crate::model::System;
use crate::orbit::{Orbit, Symmetry};
use nalgebra::DMatrix;

const NAME: &str = "shooting";

/// Relative error per step when none is given: orbits of the paper's couple are then within 1e-7 (see the verification tests).
const TOLERANCE: f64 = 1e-8;
/// Residual of the first search, in which every run chooses its steps anew: the map is then smooth only to about their error.
const NEAR: f64 = 1e-6;
/// Residual at which the orbit is closed on the steps of the last free run, on which the map is smooth.
const CLOSED: f64 = 1e-11;
/// Meshes made for one orbit: the first is as good as the first search, the second nearly always enough.
const MESHES: usize = 6;
/// A mesh is good when closing the orbit on it moves the state by at most this many times the error per step: that is what the
/// choice of the steps alone does.
const SETTLED: f64 = 100.0;
/// Energy gap above which an orbit is not reported as converged.
const ENERGY_GAP: f64 = 1e-5;
/// A state counts as rest below this fraction of what the loads could cause.
const NEAR_REST: f64 = 1e-3;

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "smooth laws: Newton on the period of a stiff integration, exact sensitivities",
    options: &[
        MethodOption {
            key: "tolerance",
            dimension: Dimension::NONE,
            count: false,
            doc: "relative error per step of the integration; 1e-8 when absent",
        },
        MethodOption {
            key: "width",
            dimension: Dimension::VELOCITY,
            count: false,
            doc: "replaces exact laws by smooth ones that change sign over this velocity; exact laws are refused when absent",
        },
    ],
    build: |options| {
        let tolerance = options.get("tolerance").copied().unwrap_or(TOLERANCE);
        if !(1e-13..=1e-3).contains(&tolerance) {
            let message = format!("must lie between 1e-13 and 1e-3, found {tolerance}");
            return Err(MethodError::Option { method: NAME, key: "tolerance", message });
        }
        Ok(Box::new(Shooting { tolerance, width: options.get("width").copied() }))
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
}

impl Default for Shooting {
    fn default() -> Self {
        Shooting { tolerance: TOLERANCE, width: None }
    }
}

impl Method for Shooting {
    fn name(&self) -> &'static str {
        NAME
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        Ok(Box::new(Smooth::new(system, *self, NAME, Search::Newton)?))
    }
}

/// Finds orbits by stiff integration, with either search.
pub(super) struct Smooth<'a> {
    system: &'a System,
    /// The method that it works for.
    name: &'static str,
    search: Search,
    flow: SmoothFlow,
    owners: Vec<usize>,
    weights: Vec<f64>,
    duration: f64,
    contracts: bool,
}

impl ReturnMap for Smooth<'_> {
    fn returned(&mut self, state: &mut [f64], derivative: Option<&mut DMatrix<f64>>) -> Result<(), Breakdown> {
        self.flow.run(state, 0.0, self.duration, derivative)
    }
    fn weights(&self) -> &[f64] {
        &self.weights
    }
}

impl<'a> Smooth<'a> {
    /// # Errors
    /// See [`Structure::new`].
    pub fn new(system: &'a System, options: Shooting, name: &'static str, search: Search) -> Result<Self, MethodError> {
        let structure = Structure::new(system, options.width, name)?;
        let weights = vec![1.0; structure.states()];
        let owners = (0..system.joints().len()).collect();
        let flow = SmoothFlow::new(structure, options.tolerance);
        // smooth neighbours are passive where the exact laws are
        let contracts = system.contracts();
        Ok(Smooth { system, name, search, flow, owners, weights, duration: 0.0, contracts })
    }

    /// Weights of the energy norm; internal states count with the scale of the motion.
    fn set_weights(&mut self, omega: f64) {
        let structure = &self.flow.structure;
        let n = structure.n;
        for i in 0..n {
            let inertia = omega * omega * structure.mass[(i, i)];
            self.weights[i] = structure.stiffness[(i, i)].max(inertia).sqrt();
            self.weights[n + i] = structure.mass[(i, i)].sqrt();
        }
        let energy = self.flow.drive.energy_scale(&structure.mass, &structure.stiffness);
        self.weights[2 * n..].fill(if energy > 0.0 { NEAR_REST * energy } else { 1.0 });
    }

    fn first_state(&self, omega: f64) -> Vec<f64> {
        let structure = &self.flow.structure;
        let mut state = Guess::new(self.system, omega).state(structure.n);
        state.resize(structure.states(), 0.0);
        state
    }
}

impl Solver for Smooth<'_> {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        self.flow.drive = Drive::new(self.system, &self.owners, omega);
        self.set_weights(omega);
        let (symmetry, sign, share) =
            if self.system.is_odd() { (Symmetry::HalfPeriod, -1.0, 0.5) } else { (Symmetry::FullPeriod, 1.0, 1.0) };
        self.duration = share * std::f64::consts::TAU / omega;
        let structure = &self.flow.structure;
        let rest = NEAR_REST * self.flow.drive.energy_scale(&structure.mass, &structure.stiffness);
        let (name, search) = (self.name, self.search);
        let aim = Aim { method: name, omega, residual: NEAR, sign, rest };
        (self.flow.record, self.flow.frozen) = (false, false);
        let near = search.find(self, start, |smooth| smooth.first_state(omega), aim)?;
        let broke = |cause| OrbitError::Breakdown { method: name, omega, cause };
        // steps made for a state close the orbit only as well as they fit it: make them anew until that moves it no more
        let mut closed = near;
        // a settled motion is left as it is: nothing but time has found it
        let meshes = if search == Search::Newton { MESHES } else { 0 };
        for _ in 0..meshes {
            self.flow.frozen = false;
            self.flow.run(&mut closed.state.clone(), 0.0, self.duration, None).map_err(broke)?;
            self.flow.frozen = true;
            let again = close(self, &closed.state, Aim { residual: CLOSED, ..aim })?;
            let moved: Vec<f64> = again.state.iter().zip(&closed.state).map(|(a, b)| a - b).collect();
            let size = norm(&self.weights, &again.state).max(rest).max(f64::MIN_POSITIVE);
            let settled = norm(&self.weights, &moved) <= SETTLED * self.flow.tolerance * size;
            closed = Closed { iterations: closed.iterations + again.iterations, ..again };
            if settled {
                break;
            }
        }
        self.flow.record = true;
        let mut end = closed.state.clone();
        self.flow.run(&mut end, 0.0, self.duration, None).map_err(broke)?;
        let orbit = path::orbit((self.system, self.contracts), &self.flow, name, omega, symmetry, closed);
        let allowed = ENERGY_GAP + MISSING_WORK * orbit.evidence.truncation.unwrap_or(0.0);
        if orbit.evidence.energy_gap > allowed {
            return Err(OrbitError::Evidence { method: name, omega, energy_gap: orbit.evidence.energy_gap });
        }
        Ok(orbit)
    }
}
