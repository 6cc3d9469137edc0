//! Properties of any law, computed through the trait [`Law`](crate::law::Law).
//!
//! - `check`: parameter ranges, consistency, and the claims of the implementation.
//! - `force_at_rest`: the force before a joint moves.
//! - `odd_symmetry`: whether the force is odd.
//! - `proportionality`: the ratio of the forces of two laws.
//! - `linear_references`: the law without friction, and the law stuck, with `linear_springs`.

mod check;
mod force_at_rest;
mod linear_references;
mod linear_springs;
mod odd_symmetry;
mod proportionality;
