//! Methods that turn a system and an excitation frequency into an orbit.
//!
//! A study file names a method with its options. [`TABLE`] lists `auto`, which picks a method,
//! and the methods of `list.rs`. To add a method, write its file and add one line to `list.rs`.
//!
//! [`Method::solver`] makes a [`Solver`] for one system. The solver keeps data that it can
//! reuse from orbit to orbit.

mod advice;
mod assembly;
pub mod auto;
mod course;
mod drive;
mod error;
pub mod event_driven;
mod evidence;
mod exact_flow;
mod flow;
mod followed;
mod guess;
pub mod harmonic_balance;
mod incremental;
mod list;
mod option;
mod periodic;
mod repeated;
mod residual_traction;
pub mod shooting;
mod smooth;
mod static_equilibrium;
mod stepped;
mod steps;
mod switched;
pub mod time_history;
mod traits;
pub mod transient;
mod vibration;
mod ways;

pub use crate::orbit::{IntegrationError, OrbitError};
pub use advice::{advised, ways};
pub use error::{MethodError, Refusal};
use list::LIST;
pub use option::{MethodOption, Options, WIDTH};
pub use static_equilibrium::StaticEquilibrium;
pub use traits::{Choice, Method, MethodInfo, Solver};
pub use ways::Ways;

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
