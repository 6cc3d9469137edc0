//! Motion in time from given displacements: free decay, switched-on drive, run-up.
//!
//! Exact laws are followed by events, smooth laws by stiff integration, both in stretches of one drive period. In a run-up every
//! cycle has its own frequency, constant over the cycle and continuous in phase, as in a stepped-sine test.

use super::drive::Drive;
use super::event_driven::{ExactPath, Flow, Mechanics};
use super::smooth::flow::SmoothFlow;
use super::smooth::path::SteppedPath;
use super::smooth::step::Structure;
use super::{Breakdown, MethodError};
use crate::model::System;
use crate::orbit::{Path, Sample, Symmetry};
use std::f64::consts::TAU;

const NAME: &str = "transient";

/// Relative error per step for smooth laws.
const TOLERANCE: f64 = 1e-9;
/// A free decay is followed in stretches of this many samples.
const STRETCH: usize = 64;

/// What drives the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Excitation {
    /// Nothing but constant forces.
    Free,
    /// A constant drive frequency, rad/s.
    Steady(f64),
    /// A drive frequency that changes linearly from `from` to `to` (rad/s) within `duration` (s).
    RunUp {
        /// First frequency, rad/s.
        from: f64,
        /// Last frequency, rad/s.
        to: f64,
        /// Time between them, s.
        duration: f64,
    },
}

/// A motion to be computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Transient {
    /// Displacements at the start, length n, m.
    pub displacement: Vec<f64>,
    /// Velocities at the start, length n, m/s.
    pub velocity: Vec<f64>,
    /// What drives it.
    pub excitation: Excitation,
    /// Time to be computed, s.
    pub duration: f64,
    /// Distance of the samples, s.
    pub step: f64,
    /// Velocity over which exact laws are smoothed, m/s; exact when absent.
    pub width: Option<f64>,
}

/// Why a transient was not computed, or not to its end.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TransientError {
    /// The laws do not fit together.
    #[error(transparent)]
    Method(#[from] MethodError),
    /// The motion broke down; the samples until then are good.
    #[error("{cause}; the samples until t = {time:.6e} s are good")]
    Breakdown {
        /// End of the good samples, s.
        time: f64,
        /// Why.
        cause: Breakdown,
    },
}

/// Either way to follow a motion.
enum Runner {
    Exact(Box<Flow>),
    Smooth(Box<SmoothFlow>),
}

impl Transient {
    /// Computes the motion; `sample` receives time (s), drive frequency (rad/s, zero if free) and state, and stops the motion by
    /// returning false.
    ///
    /// # Errors
    /// [`TransientError`].
    ///
    /// # Example
    /// A sliding oscillator loses `4 F/k` of amplitude per cycle.
    /// ```
    /// use stickslip::law::{Coulomb, Law};
    /// use stickslip::method::transient::{Excitation, Transient};
    /// use stickslip::model::{GROUND, Joint, Mass, Model, Spring};
    /// let model = Model {
    ///     masses: vec![Mass { name: "m".into(), mass: 1.0 }],
    ///     springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: 1.0, damping: 0.0 }],
    ///     joints: vec![Joint { name: "j".into(), between: ["m".into(), GROUND.into()], law: Law::Coulomb(Coulomb { limit: 0.01 }) }],
    ///     ..Model::default()
    /// };
    /// let motion = Transient { displacement: vec![1.0], velocity: vec![0.0], excitation: Excitation::Free,
    ///     duration: std::f64::consts::TAU, step: std::f64::consts::TAU, width: None };
    /// let mut last = 0.0;
    /// motion.run(&model.assemble().unwrap(), &mut |_, _, state| { last = state.displacement[0]; true }).unwrap();
    /// assert!((last - 0.96).abs() < 1e-12);
    /// ```
    pub fn run(
        &self,
        system: &System,
        sample: &mut dyn FnMut(f64, f64, &Sample) -> bool,
    ) -> Result<(), TransientError> {
        let exact = self.width.is_none() && system.joints.iter().all(|joint| joint.law.network().is_some());
        let (mut runner, contacts) = if exact {
            let mechanics = Mechanics::new(system)?;
            let owners = mechanics.owners();
            (Runner::Exact(Box::new(Flow::new(mechanics, Drive::default()))), owners)
        } else {
            let structure = Structure::new(system, self.width, NAME)?;
            let mut flow = SmoothFlow::new(structure, TOLERANCE);
            flow.record = true;
            (Runner::Smooth(Box::new(flow)), (0..system.joints.len()).collect())
        };
        let mut state = [self.displacement.as_slice(), &self.velocity].concat();
        state.resize(runner.states(), 0.0);
        let mut begin = 0.0;
        let mut next = 0usize; // index of the next sample
        let samples = (self.duration / self.step * (1.0 + f64::EPSILON)).floor() as usize;
        while next <= samples {
            let omega = self.frequency(begin);
            let length = if omega > 0.0 { TAU / omega } else { STRETCH as f64 * self.step };
            let drive = if omega > 0.0 {
                Drive::new(system, &contacts, omega)
            } else {
                Drive::without_harmonics(system, &contacts)
            };
            let path = runner
                .stretch(system, drive, &mut state, length)
                .map_err(|cause| TransientError::Breakdown { time: begin, cause })?;
            let end = begin + length;
            while next <= samples && next as f64 * self.step < end {
                let time = next as f64 * self.step;
                if !sample(time, omega, &path.sample((time - begin).clamp(0.0, length))) {
                    return Ok(());
                }
                next += 1;
            }
            begin = end;
        }
        Ok(())
    }

    /// Drive frequency of the cycle that begins at `time`.
    fn frequency(&self, time: f64) -> f64 {
        match self.excitation {
            Excitation::Free => 0.0,
            Excitation::Steady(omega) => omega,
            Excitation::RunUp { from, to, duration } => from + (to - from) * (time / duration).min(1.0),
        }
    }
}

impl Runner {
    fn states(&self) -> usize {
        match self {
            Runner::Exact(flow) => flow.mechanics.states(),
            Runner::Smooth(flow) => flow.structure.states(),
        }
    }

    /// Runs over one stretch from local time zero, where the drive has phase zero.
    fn stretch(
        &mut self,
        system: &System,
        drive: Drive,
        state: &mut [f64],
        length: f64,
    ) -> Result<Box<dyn Path>, Breakdown> {
        match self {
            Runner::Exact(flow) => {
                flow.set_drive(drive);
                flow.run(state, 0.0, length, None)?;
                Ok(Box::new(ExactPath::new(system, flow, Symmetry::FullPeriod, length)))
            }
            Runner::Smooth(flow) => {
                flow.drive = drive;
                flow.run(state, 0.0, length, None)?;
                Ok(Box::new(SteppedPath::new(system, flow, Symmetry::FullPeriod, length)))
            }
        }
    }
}
