//! The linear system of a Newton step.
//!
//! - `linearization`: the Jacobian as a dense matrix, eliminated
//! - `newton_krylov`: the Jacobian as a product, solved by GMRES
//! - `harmonic_preconditioner`: preconditioner by harmonics
//! - `modal_preconditioner`: preconditioner for large structures in modes
//!
//! The banded form of the system is with its dynamics, in `dynamics/banded`.

pub(super) mod harmonic_preconditioner;
pub(super) mod linearization;
mod modal_preconditioner;
pub(super) mod newton_krylov;
