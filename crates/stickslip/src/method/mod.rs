//! Methods that turn a system and an excitation frequency into an orbit.
//!
//! A study file names a method with its options. [`TABLE`] lists `auto`, which picks a method,
//! and the methods of `list.rs`. To add a method, write its file and add one line to `list.rs`.
//!
//! [`Method::solver`] makes a [`Solver`] for one system. The solver keeps data that it can
//! reuse from orbit to orbit.
//!
//! The methods:
//! - `event_driven/`: closed-form motion between switches
//! - `shooting`: Newton's method on the return map of a time integration
//! - `harmonic_balance/`: Fourier series of the joint motions
//! - `transient`: integration until the transient has decayed
//! - `auto`: picks one of them
//!
//! Parts that several methods use:
//! - `flow/`: time integrations
//! - `orbit_search/`: initial guess, return map, evidence
//! - `static_equilibrium`: the equilibrium under the constant loads
//! - `alternatives`, `with_alternatives`: methods that take a system instead of one that does not
//! - `traits`, `options`, `error`, `list`: the interface of a method
//! - `budget`: bound on the work of a search
//!
//! `time_history` integrates a motion from given displacements, without an orbit.

mod alternatives;
pub mod auto;
mod budget;
mod error;
pub mod event_driven;
mod flow;
pub mod harmonic_balance;
mod list;
mod options;
mod orbit_search;
pub mod shooting;
mod static_equilibrium;
pub mod time_history;
mod traits;
pub mod transient;
mod with_alternatives;

pub use crate::orbit::{IntegrationError, OrbitError, Seed};
pub use alternatives::Alternatives;
pub use budget::Budget;
pub use error::{MethodError, Refusal};
use list::LIST;
pub use options::{MethodOption, Options, WIDTH};
pub use static_equilibrium::StaticEquilibrium;
pub use traits::{Choice, ErrorEstimate, Method, MethodInfo, Request, Solver};
pub use with_alternatives::{alternatives, solver_with_alternatives};

/// All methods: `auto` and the rows of `list.rs`.
pub const TABLE: &[MethodInfo] = &{
    let mut table = [auto::INFO; 1 + LIST.len()];
    let mut row = 0;
    while row < LIST.len() {
        table[1 + row] = LIST[row];
        row += 1;
    }
    table
};

/// Returns the method with this name, or `None` if the table has no such row.
pub fn find(name: &str) -> Option<&'static MethodInfo> {
    TABLE.iter().find(|method| method.name == name)
}
