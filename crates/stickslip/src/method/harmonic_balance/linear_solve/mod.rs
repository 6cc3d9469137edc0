//! The linear system of a Newton step.
//!
//! - `linear`: the Jacobian as a dense matrix, eliminated
//! - `coupled`: the Jacobian as a product, solved by GMRES with preconditioners
//! - `open`: null directions and minimum-norm steps of a singular system
//!
//! The banded form of the system is with its dynamics, in `dynamics/sparse`.

pub(super) mod coupled;
pub(super) mod linear;
pub(super) mod open;
