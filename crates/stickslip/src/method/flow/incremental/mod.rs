//! Time integration with equal implicit steps, for laws with a step view only and for mixtures
//! of all laws.
//!
//! - `law`: evaluation of any law over a step, with derivatives
//! - `step`: one step of average acceleration (Newmark 1959, β = ¼, γ = ½), with the
//!   structure eliminated onto the joints' axes
//! - `carried`: sensitivities of a run
//! - `flow`: the number of equal steps according to the estimated error
//!
//! The steps are of second order, also across kinks of the force, and conserve the energy of
//! the structure. Richardson extrapolation with halved steps estimates their error.

mod carried;
pub(crate) mod flow;
pub(crate) mod law;
mod step;
