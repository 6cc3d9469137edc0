//! Description of a file format, and of the variables in a file.

use std::fmt;

use crate::error::{Error, ErrorKind, Location};
use crate::matrix::Matrix;

/// A file format for matrices.
pub struct Format {
    /// Name of the format, as in `format = "…"`.
    pub name: &'static str,
    /// Short description, with the programs that write the format.
    pub summary: &'static str,
    /// Returns true if the content looks like this format.
    pub(crate) sniff: fn(&[u8]) -> bool,
    /// Returns the variables of a file. Their numbers are not read yet.
    pub(crate) open: for<'a> fn(&'a [u8]) -> Result<Vec<Item<'a>>, Error>,
}

/// The note of a complex matrix.
pub(crate) const COMPLEX: &str = "complex";

/// A variable of a file, with the function that reads it.
pub(crate) struct Item<'a> {
    pub variable: Variable,
    pub read: Box<dyn Fn() -> Result<Matrix, Error> + 'a>,
}

impl<'a> Item<'a> {
    pub fn new(
        name: impl Into<String>,
        rows: usize,
        columns: usize,
        read: impl Fn() -> Result<Matrix, Error> + 'a,
    ) -> Self {
        Self { variable: Variable { name: name.into(), rows, columns, note: None }, read: Box::new(read) }
    }

    /// Creates an item that is not a real matrix. `note` describes it.
    pub fn not_a_matrix(name: impl Into<String>, note: impl Into<String>) -> Self {
        let (name, note) = (name.into(), note.into());
        let (kind, remedy) = match note == COMPLEX {
            true => (ErrorKind::Complex, "save its real part, or select another matrix"),
            false => (ErrorKind::Unsupported, "select another matrix"),
        };
        let location = if name.is_empty() { Location::File } else { Location::Variable(name.clone()) };
        let error = Error::new(kind, location, format!("this is not a real matrix: {note}"), remedy);
        let variable = Variable { name, rows: 0, columns: 0, note: Some(note) };
        Self { variable, read: Box::new(move || Err(error.clone())) }
    }
}

/// A variable of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Name of the variable; empty if the format has no names.
    pub name: String,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Description of a variable that is not a real matrix.
    pub note: Option<String>,
}

impl fmt::Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, rows, columns, note } = self;
        match note {
            Some(note) if name.is_empty() => f.write_str(note),
            Some(note) => write!(f, "{name} ({note})"),
            None if name.is_empty() => write!(f, "{rows} x {columns}"),
            None => write!(f, "{name} ({rows} x {columns})"),
        }
    }
}
