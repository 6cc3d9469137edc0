//! Harmonic balance: the orbit as a Fourier series, with joint forces by alternating
//! frequency-time (AFT).
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
//! - `balance`: the solver of a system, with its warm starts;
//! - `length`: the number of harmonics, doubled until the estimated error meets the tolerance;
//! - `kept`: the set of harmonics in a series;
//! - `recent`: the last orbits, for warm starts and the secant predictor;
//! - `in_time`: initial guesses from time integration;
//! - `subharmonic`: orbits of several periods of the excitation;
//! - `static_equilibrium`: the equilibrium under the constant loads, by harmonic 0 alone;
//! - `other_histories`: sensitivity of amplitudes to the history of permanently stuck joints;
//! - `budget`, `work`, `storage`: work limits, operation counts, estimates of memory.
//!
//! The equations:
//! - `equations`: residual and Jacobian along the joints;
//! - `ports`: harmonics of joint forces from harmonics of joint motions, with exact
//!   derivatives;
//! - `penalty`, `hold`: parameter ε of rigid contacts; regularization of singular equations;
//! - `closed`: mean position of bodies that only contacts support;
//! - `linear`: the Jacobian as a matrix; `sparse`: large systems in banded form;
//! - `rest`, `receptance`, `modal`, `uncoupled`, `waves`: receptances of the linear part.
//!
//! The nonlinear solution:
//! - `solve`: Newton's method with line search, and the order in which the other searches
//!   follow;
//! - `interior`: interior point method for rigid friction;
//! - `proximal`: proximal point method for forces that the equations leave undetermined;
//! - `ease`: parameters of the homotopies;
//! - `coupled`: Newton steps by GMRES;
//! - `clusters`, `window`: nonlinear elimination of contacts that dominate the residual;
//! - `found_by`: the search that found a solution.
//!
//! Results:
//! - `estimate`, `sampling`: truncation error; sampling error;
//! - `path`: displacements, energies and evidence of an orbit from its harmonics.
//!
//! Continuation and nonlinear modes:
//! - `branch`: the equations with a parameter;
//! - `mode`, `arc`: nonlinear modes and arc-length steps along them;
//! - `open`: the minimum-norm step of a singular system.

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
pub use work::{factor_bytes, orbit_work};

/// Entry of this method in [`super::TABLE`].
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
