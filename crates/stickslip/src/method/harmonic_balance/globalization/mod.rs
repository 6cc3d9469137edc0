//! Searches that follow if Newton's method fails from its initial guess.
//!
//! - `homotopy`: parameters of the homotopies, and the tolerance of a solution
//! - `interior_point`: interior point method for rigid friction
//! - `proximal_point`: proximal point method for forces that the equations leave undetermined
//! - `nonlinear_elimination`: nonlinear elimination of contacts that dominate the residual
//! - `subdomain`: subdomains of large structures for the nonlinear elimination
//! - `time_start`: initial guesses from time integration
//! - `found_by`: the search that found a solution

pub(super) mod found_by;
pub(super) mod homotopy;
pub(super) mod interior_point;
pub(super) mod nonlinear_elimination;
pub(super) mod proximal_point;
pub(super) mod subdomain;
pub(super) mod time_start;
