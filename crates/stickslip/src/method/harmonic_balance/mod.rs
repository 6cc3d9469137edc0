//! Harmonic balance: the orbit as a Fourier series, with joint forces in closed form between
//! turning points or by alternating frequency-time (AFT).
//!
//! The equations are written along the joints. Per harmonic, `u = u_lin - R f` relates the
//! relative motions `u` of the joints, their forces `f` and the receptance `R` of the linear
//! part. The unknowns are the harmonics of the relative motions, or of the forces of joints
//! whose force depends on the velocity alone. The cost grows with the number of joints and
//! harmonics, not with the number of degrees of freedom. Only multiples of the greatest common
//! divisor of the excitation's harmonics occur. If all of these are odd multiples and all laws
//! are odd, only odd multiples occur. The truncation error is estimated from a second solution
//! with twice the harmonics.
//!
//! Sources: Krack and Gross, "Harmonic Balance for Nonlinear Vibration Problems" (2019);
//! Cameron and Griffin (1989).
//!
//! The solver and its options:
//! - `options`: number of harmonics, number of samples, tolerance;
//! - `settings`: the knobs of the searches;
//! - `solver`: the solver of a system, with its warm starts;
//! - `subharmonic`: orbits of several periods of the excitation;
//! - `static_equilibrium`: the equilibrium under the constant loads, by harmonic 0 alone;
//! - `budget`, `cost_model`, `memory_estimate`: work limits, operation counts, estimates of
//!   memory;
//! - `found_by`: the search that found a solution.
//!
//! The equations and their solution:
//! - `equations/`: residual and Jacobian along the joints, set of harmonics, scaling;
//! - `aft/`: harmonics of joint forces from harmonics of joint motions, with exact derivatives;
//! - `dynamics/`: receptances of the linear part;
//! - `linear_solve/`: the linear system of a Newton step;
//! - `newton`: Newton's method for the equations of a search;
//! - `globalization/`: the fallbacks if Newton's method fails, in one table.
//!
//! Results:
//! - `accuracy/`: number of harmonics, truncation error, sampling error;
//! - `postprocess`: displacements, energies and evidence of an orbit from its harmonics;
//! - `modes/`: nonlinear modes, and branches of orbits with a parameter.

mod accuracy;
mod aft;
mod budget;
mod cost_model;
mod dynamics;
mod equations;
mod found_by;
mod globalization;
mod linear_solve;
mod memory_estimate;
mod modes;
mod newton;
mod options;
mod postprocess;
mod settings;
mod solver;
mod static_equilibrium;
mod subharmonic;

use super::options::{PERIOD, periods};
use super::{Method, MethodError, MethodInfo, MethodOption, Solver};
use crate::dimension::Dimension;
use crate::model::System;
pub use cost_model::{factor_bytes, orbit_work};
pub(crate) use modes::branch_equations::BranchEquations;
pub(crate) use modes::mode_continuation::{ModeArc, ModeStep};
pub(crate) use modes::nonlinear_mode::{LinearMode, ModeEquations, ModeState, SmallMode};
pub use options::{HarmonicBalance, NAME};
use solver::HarmonicBalanceSolver;
pub(crate) use static_equilibrium::static_equilibrium_of;
pub use subharmonic::Subharmonic;

/// Entry of this method in `super::list::LIST`.
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "Fourier series of the joint motions, with an error estimate",
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
            doc: "samples per period, an even number of at least 4 (harmonics + 1), without `harmonics` at least 16 per \
                  harmonic; default: at least 1024 and 16 per harmonic; steep laws and friction in a plane have 128 \
                  per harmonic, and laws with steps (such as contacts that separate) have fewer if `tolerance` is \
                  above 0.001",
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
        Ok(Box::new(HarmonicBalanceSolver::new(system.clone(), *self, 1)?))
    }
}
