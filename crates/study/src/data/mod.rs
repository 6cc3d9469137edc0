//! Tables of `[[data]]`: measured or given columns by their use, with units.
//!
//! - `table`: a table and its columns in SI;
//! - `column_unit`: the unit at the end of a column's name.

mod column_unit;
mod table;

pub(crate) use table::{ColumnError, DataTable};
