//! The linear system of a Newton step.
//!
//! - `linearization`: the Jacobian as a dense matrix, eliminated
//! - `newton_krylov`: the Jacobian as a product, solved by GMRES with preconditioners
//!
//! The banded form of the system is with its dynamics, in `dynamics/banded`.

pub(super) mod linearization;
pub(super) mod newton_krylov;
