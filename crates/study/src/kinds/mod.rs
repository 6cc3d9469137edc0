//! Study kinds: the available computations. Each kind is one folder and one line in [`TABLE`].
//!
//! A kind states its keys of `[study]`; the reader checks them and passes their
//! [`Values`](crate::Values) for every case.
//!
//! - `NAME/mod.rs`: keys, conditions, size and computation of a kind; `NAME/figure.rs` draws its
//!   tables, `NAME/tables.rs` reads them back as typed values;
//! - `info`: the description of a kind: keys and conditions;
//! - `kind`: a row of the table: how studies of the kind are divided, computed and drawn;
//! - `shared`: shared by several kinds.

mod branch;
mod campbell;
pub mod hysteresis;
pub(crate) mod info;
pub(crate) mod kind;
mod map;
mod modes;
mod nodal_diameter;
mod orbit;
pub mod performance;
pub mod response;
mod shared;
mod transient;

use crate::case::study::Study;
use crate::run::output_columns;

pub use crate::kinds::info::{KeyError, KindInfo};
pub use crate::kinds::kind::Kind;

/// All study kinds, in the order in which lists show them.
pub const TABLE: &[Kind] = &[
    hysteresis::KIND,
    orbit::KIND,
    response::KIND,
    transient::KIND,
    performance::KIND,
    map::KIND,
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
pub(crate) fn kind_of(study: &Study) -> &'static Kind {
    let name = study.kind().name;
    find(name).unwrap_or_else(|| unreachable!("the reader takes kinds from this table, `{name}` is not in it"))
}

/// Returns the choices of `output`: name and one-line description.
pub fn outputs() -> Vec<(&'static str, &'static str)> {
    output_columns::TABLE.iter().map(|extra| (extra.name, extra.doc)).collect()
}
