//! Study kinds: the available computations. Each kind is one file and one line in [`TABLE`].
//!
//! A kind states its keys of `[study]`; the reader checks them and passes their
//! [`Values`](crate::Values) for every case.

mod branch;
mod campbell;
pub mod hysteresis;
mod keys;
mod modes;
mod nodal_diameter;
mod orbit;
mod orbits;
mod peak_of;
pub mod performance;
pub mod response;
mod shares;
mod transient;
mod wheel;

use crate::extra;
use crate::study::Study;

pub use crate::info::{Complaint, KindInfo};
pub use crate::kind::Kind;

/// All study kinds, in the order in which lists show them.
pub const TABLE: &[Kind] = &[
    hysteresis::KIND,
    orbit::KIND,
    response::KIND,
    transient::KIND,
    performance::KIND,
    modes::KIND,
    branch::KIND,
    nodal_diameter::KIND,
    campbell::KIND,
];

/// Returns the kind with this name.
pub fn find(name: &str) -> Option<&'static Kind> {
    TABLE.iter().find(|kind| kind.info.name == name)
}

/// Returns the kind of a study.
pub(crate) fn of(study: &Study) -> &'static Kind {
    let name = study.kind().name;
    find(name).unwrap_or_else(|| unreachable!("the reader takes kinds from this table, `{name}` is not in it"))
}

/// Returns the choices of `output`: name and one-line description.
pub fn outputs() -> Vec<(&'static str, &'static str)> {
    extra::TABLE.iter().map(|extra| (extra.name, extra.doc)).collect()
}
