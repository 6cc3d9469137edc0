//! Stability of a harmonic-balance orbit. Where no two motions of the system separate there is nothing to compute; elsewhere it is by the
//! judge of the other methods: the derivative of the return map along the motion that starts at the orbit's state, exact for laws that
//! are exact and by implicit integration for smooth ones.

use crate::method::drive::Drive;
use crate::method::event_driven::{Flow, Mechanics};
use crate::method::smooth::flow::SmoothFlow;
use crate::method::smooth::step::Structure;
use crate::model::System;
use nalgebra::DMatrix;

/// Degrees of freedom up to which orbits are judged without being asked: the return map is dense, and its cost grows with the cube.
const LARGEST: usize = 24;
/// Relative error per step of the integration of smooth laws.
const TOLERANCE: f64 = 1e-8;

/// The flow of a system between two returns.
pub(super) enum Judge {
    /// No two motions separate.
    Proven,
    Exact(Box<Flow>),
    Smooth(Box<SmoothFlow>),
    /// The system is too large, or its laws are mixed.
    None,
}

impl Judge {
    pub fn new(system: &System) -> Self {
        if system.contracts() {
            return Judge::Proven;
        }
        if system.dofs() > LARGEST { Judge::None } else { Judge::of_any_size(system) }
    }

    /// A flow, also where it is not needed or long.
    pub fn of_any_size(system: &System) -> Self {
        if system.dofs() == 0 {
            return Judge::None;
        }
        if let Ok(mechanics) = Mechanics::new(system) {
            return Judge::Exact(Box::new(Flow::new(mechanics, Drive::default())));
        }
        match Structure::new(system, None, super::NAME) {
            Ok(structure) => Judge::Smooth(Box::new(SmoothFlow::new(structure, TOLERANCE))),
            Err(_) => Judge::None,
        }
    }

    /// Derivative of the return, over the half period if `odd`, with respect to the state at t = 0, which begins with `start`.
    pub fn derivative(&mut self, system: &System, omega: f64, odd: bool, start: &[f64]) -> Option<DMatrix<f64>> {
        let duration = if odd { 0.5 } else { 1.0 } * std::f64::consts::TAU / omega;
        match self {
            Judge::Exact(flow) => {
                let states = flow.mechanics.states();
                let mut state = start.to_vec();
                state.resize(states, 0.0);
                let owners = flow.mechanics.owners();
                flow.set_drive(Drive::new(system, &owners, omega));
                let mut derivative = DMatrix::identity(states, states);
                flow.run(&mut state, 0.0, duration, Some(&mut derivative)).ok()?;
                Some(derivative)
            }
            Judge::Smooth(flow) => {
                let owners: Vec<usize> = (0..system.joints().len()).collect();
                flow.drive = Drive::new(system, &owners, omega);
                let states = 2 * flow.structure.n + flow.structure.internal;
                let mut state = start.to_vec();
                state.resize(states, 0.0);
                let mut derivative = DMatrix::identity(states, states);
                flow.run(&mut state, 0.0, duration, Some(&mut derivative)).ok()?;
                Some(derivative)
            }
            Judge::Proven | Judge::None => None,
        }
    }
}
