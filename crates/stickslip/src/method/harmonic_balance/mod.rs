//! Harmonic balance: the orbit as a Fourier series, friction sampled over the period.
//!
//! - `ports`: from the harmonics of relative motions to those of the laws' forces, with the exact derivative;
//! - `rest`: the receptance of the linear rest, in closed form from its modes;
//! - `static_equilibrium`: where every vibration begins: the equilibrium under the constant loads;
//! - `closed`: the mean of bodies that nothing but contacts holds;
//! - `equations`: those along the joints, and their derivative;
//! - `linear`: their derivative as a matrix; `coupled`: steps by its products;
//! - `solve`: Newton's method on them; `estimate`: the error by a finer solution; `sampling`: what samples leave out; `interior`: all rigid joints at once;
//!   `proximal`: the way to forces that nothing decides;
//! - `path`: the orbit's numbers from its harmonics.
//!
//! The unknowns are the harmonics of the joints' relative motions, or of their forces where the velocity alone decides them: the cost
//! follows joints and harmonics, not degrees of freedom. Only multiples of the excitation's common divisor occur, and only the odd ones if
//! it has no others. The error of a solution is estimated from a second one with twice the harmonics.
//! Source: Krack and Gross, "Harmonic Balance for Nonlinear Vibration Problems" (2019); Cameron and Griffin (1989).

mod arc;
mod balance;
mod branch;
mod budget;
mod closed;
mod clusters;
mod coupled;
mod ease;
mod equations;
mod estimate;
mod found_by;
mod hold;
mod in_time;
mod interior;
mod kept;
mod length;
mod linear;
mod modal;
mod mode;
mod open;
mod options;
mod other_histories;
mod path;
mod penalty;
mod ports;
mod proximal;
mod recent;
mod receptance;
mod rest;
mod sampling;
mod solve;
mod sparse;
mod static_equilibrium;
mod storage;
mod subharmonic;
mod uncoupled;
mod waves;
mod window;
mod work;

use super::option::{PERIOD, periods};
use super::{Method, MethodError, MethodInfo, MethodOption, Solver};
use crate::dimension::Dimension;
use crate::model::System;
pub(crate) use arc::{ModeArc, Step as ModeStep};
use balance::Balance;
pub(crate) use branch::BranchEquations;
pub(crate) use mode::{LinearMode, ModeEquations, ModeState};
pub use options::{HarmonicBalance, NAME};
pub(crate) use static_equilibrium::static_equilibrium_of;
pub use subharmonic::Subharmonic;
pub use work::{doubling_work, factor_bytes, most_work, orbit_work, step_work};

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "Fourier series of the joint motions, friction sampled over the period, with an error estimate",
    options: &[
        MethodOption {
            key: "harmonics",
            dimension: Dimension::NONE,
            count: true,
            doc: "highest harmonic; default: doubled until the estimated error is below `tolerance`",
        },
        MethodOption {
            key: "samples",
            dimension: Dimension::NONE,
            count: true,
            doc: "samples per period: even, at least 4 (harmonics + 1), and without `harmonics` at least 16 per \
                  harmonic; default: 16 per harmonic and at least 1024, 128 per harmonic for steep laws and for \
                  friction in a plane, and fewer for laws with steps (such as contacts that separate) if `tolerance` \
                  is above 0.001",
        },
        MethodOption {
            key: "tolerance",
            dimension: Dimension::NONE,
            count: false,
            doc: "permitted error of the motion relative to the largest amplitude; without `harmonics`, the method \
                  extends the series until it is reached; a point with a larger error is `truncated`; default 0.001",
        },
        PERIOD,
    ],
    build: |options| {
        let balance = HarmonicBalance::from_options(options)?;
        Ok(match periods(NAME, options)? {
            1 => Box::new(balance),
            period => Box::new(Subharmonic { balance, period }),
        })
    },
};

impl Method for HarmonicBalance {
    fn name(&self) -> &'static str {
        NAME
    }
    fn closes_motions(&self, _system: &System) -> bool {
        false
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        Ok(Box::new(Balance::new(system.clone(), *self, 1)?))
    }
}
