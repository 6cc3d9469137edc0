//! Motion in equal, implicit steps, for laws that know steps of a displacement and no rates, and for mixtures of all laws.
//!
//! - `law`: what any law answers to a step, with its derivative;
//! - `step`: one step of average acceleration (Newmark 1959, β = ¼, γ = ½), the structure eliminated onto the joints' axes;
//! - `carried`: the derivatives of a run, carried over its steps;
//! - `flow`: as many equal steps as the estimated error asks for.
//!
//! The steps are of second order, also across kinks of the force, and neither lose nor give energy in the structure. Their error is estimated by
//! halving them (Richardson).

mod carried;
pub(crate) mod flow;
pub(super) mod law;
mod step;
