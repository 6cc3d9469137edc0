//! Searches that follow if Newton's method fails from its initial guess.
//!
//! - `ease`: parameters of the homotopies, and the tolerance of a solution
//! - `interior`: interior point method for rigid friction
//! - `proximal`: proximal point method for forces that the equations leave undetermined
//! - `clusters`: nonlinear elimination of contacts that dominate the residual
//! - `window`: subdomains of large structures for the nonlinear elimination
//! - `in_time`: initial guesses from time integration
//! - `found_by`: the search that found a solution

pub(super) mod clusters;
pub(super) mod ease;
pub(super) mod found_by;
pub(super) mod in_time;
pub(super) mod interior;
pub(super) mod proximal;
pub(super) mod window;
