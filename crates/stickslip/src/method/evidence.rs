//! What an independent flow says of an orbit: whether its state at t = 0 returns, and what becomes of small disturbances.
//!
//! A series that solves its own equations proves nothing by that. The motion that starts at the orbit's state is therefore followed over one
//! return, exactly for laws that are exact and by implicit integration for others. How far it comes back from the start is the return
//! defect; its derivative is the return map that stability asks for, where no theorem answers it ([`System::contracts`]).

use super::assembly::NEAR_REST;
use super::flow::{self, Flow, Kind};
use super::incremental::flow::IncrementalFlow;
use super::periodic::norm;
use crate::model::System;
use nalgebra::DMatrix;
use std::f64::consts::TAU;

/// Degrees of freedom up to which orbits are judged without being asked: the return map is dense, and its cost grows with the cube.
const LARGEST: usize = 24;
/// Joints up to which the return of a motion whose stability is proven is followed all the same.
const JOINTS: usize = 12;
/// Relative error per step of the integration of smooth laws.
const TOLERANCE: f64 = 1e-8;
/// Equal steps per return for laws that know only steps: they follow the motion to about 1e-6.
const STEPS: usize = 4096;

/// The flow of a system between two returns.
pub(crate) struct Judge {
    /// `None` if the system is too large, or if no flow takes its laws.
    flow: Option<Box<dyn Flow>>,
    /// No two motions separate.
    proven: bool,
}

/// What a flow says of an orbit.
#[derive(Debug, Clone, Default)]
pub(crate) struct Judged {
    /// Derivative of the return with respect to the state at t = 0; `None` where stability is proven, or where no flow follows the motion.
    pub derivative: Option<DMatrix<f64>>,
    /// Distance between the state and its return, relative to the state, in the energy norm.
    pub defect: Option<f64>,
}

impl Judge {
    pub fn new(system: &System) -> Self {
        let proven = system.contracts();
        if system.dofs() > LARGEST || (proven && system.joints().len() > JOINTS) {
            return Judge { flow: None, proven };
        }
        Judge { proven, ..Judge::of_any_size(system) }
    }

    /// A flow, also where it is not needed or long.
    pub fn of_any_size(system: &System) -> Self {
        let name = "the judge of stability"; // no error of it is ever shown
        let flow: Option<Box<dyn Flow>> = match Kind::of(system, None) {
            _ if system.dofs() == 0 => None,
            Kind::Incremental => IncrementalFlow::new(system, None, name).ok().map(|mut flow| -> Box<dyn Flow> {
                flow.count = STEPS;
                Box::new(flow)
            }),
            Kind::Exact | Kind::Smooth => flow::of(system, None, TOLERANCE, name).ok(),
        };
        Judge { flow, proven: false }
    }

    /// Whether stability is proven.
    pub fn proves(&self) -> bool {
        self.proven
    }

    /// Follows the return, over the half period if `odd`, from the state at t = 0, which begins with `start`.
    pub fn judge(&mut self, system: &System, omega: f64, odd: bool, start: &[f64]) -> Judged {
        let Some(flow) = &mut self.flow else { return Judged::default() };
        let (share, sign) = if odd { (0.5, -1.0) } else { (1.0, 1.0) };
        flow.set_drive(system, omega);
        let states = flow.states();
        let mut state = start.to_vec();
        state.resize(states, 0.0);
        let mut derivative = (!self.proven).then(|| DMatrix::identity(states, states));
        if flow.run(&mut state, share * TAU / omega, derivative.as_mut()).is_err() {
            return Judged::default();
        }
        // states that the method does not know begin wrong, and their return says nothing of the orbit
        let known = start.len() == states;
        let weights = flow.weights();
        let gap: Vec<f64> = state.iter().zip(start).map(|(end, start)| sign * end - start).collect();
        let size = norm(&weights, start).max(NEAR_REST * flow.energy_scale()).max(f64::MIN_POSITIVE);
        Judged { derivative, defect: known.then(|| norm(&weights, &gap) / size) }
    }
}
