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
pub mod identify;
pub(crate) mod info;
pub(crate) mod kind;
mod map;
pub mod modes;
mod nodal_diameter;
mod orbit;
pub mod performance;
pub mod response;
mod shared;
mod transient;

use crate::case::study::Study;
use crate::run::output_columns;
use crate::syntax::error::StudyError;

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
    identify::KIND,
];

/// Returns the kind with this name.
pub fn find(name: &str) -> Option<&'static Kind> {
    TABLE.iter().find(|kind| kind.info.name == name)
}

/// Checks what a kind requires of the tables of `[[data]]`.
pub(crate) fn check_data(study: &Study) -> Result<(), StudyError> {
    check_records(study)?;
    if study.kind().name == identify::NAME { identify::check_data(study) } else { Ok(()) }
}

/// Checks the forces and motions from records.
fn check_records(study: &Study) -> Result<(), StudyError> {
    for (list, index) in study.structure.lists.records() {
        let refuse = |key: &str, message: &str, help: &str| {
            Err(study.error_at(list, index, key, message, Some(help.to_owned())))
        };
        let is_signal = study.structure.lists.get(list).get(index).is_some_and(|table| table.entry("signal").is_some());
        let key = if is_signal { "signal" } else { "data" };
        if study.kind().name != "transient" {
            return refuse(key, "a time history needs a study of kind `transient`", "write kind = \"transient\"");
        }
        if study.structure.lists.disk.is_some() {
            return refuse(
                key,
                "a time history is not possible on a bladed disk",
                "state the whole model without [disk]",
            );
        }
        let values = study.case(0)?.values;
        if values.frequencies("frequency").is_some() || values.table("run_up").is_some() {
            let help = "remove `frequency` and `run_up`, and state `duration` and `time_step`";
            return refuse(key, "a time history and an excitation frequency exclude each other", help);
        }
    }
    match transient::record::check(study, &study.case(0)?) {
        Ok(()) => Ok(()),
        Err(transient::record::RecordError { list, index, key, error }) => {
            Err(study.error_at(list, index, key, error.message, Some(error.help)))
        }
    }
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
