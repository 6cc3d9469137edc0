//! Time integration with equal implicit steps, for laws with a step view only and for mixtures
//! of all laws.
//!
//! - `law_step`: evaluation of any law over a step, with derivatives
//! - `acceleration_step`: one step of average acceleration (Newmark 1959, β = ¼, γ = ½), with the
//!   structure eliminated onto the joints' axes
//! - `sensitivity`: sensitivities of a run
//! - `equal_steps`: the number of equal steps according to the estimated error
//!
//! The steps are of second order, also across kinks of the force, and conserve the energy of
//! the structure. Richardson extrapolation with halved steps estimates their error.

mod acceleration_step;
pub(crate) mod equal_steps;
pub(crate) mod law_step;
mod sensitivity;
