//! What a format of the table is, and what it finds in a file.

use std::fmt;

use crate::error::{Error, Kind, Location};
use crate::matrix::Matrix;

/// A format of files that hold matrices.
pub struct Format {
    /// What `format = "…"` calls it.
    pub name: &'static str,
    /// What it is, and which programs write it.
    pub summary: &'static str,
    /// Whether a file looks like it, by its content.
    pub(crate) sniff: fn(&[u8]) -> bool,
    /// The matrices in a file, not yet read.
    pub(crate) open: for<'a> fn(&'a [u8]) -> Result<Vec<Item<'a>>, Error>,
}

/// What a matrix of complex numbers is noted as.
pub(crate) const COMPLEX: &str = "complex";

/// A matrix that waits in a file.
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

    /// Something that is no real matrix: `note` says what it is instead.
    pub fn other(name: impl Into<String>, note: impl Into<String>) -> Self {
        let (name, note) = (name.into(), note.into());
        let (kind, remedy) = match note == COMPLEX {
            true => (Kind::Complex, "save its real part, or name another one"),
            false => (Kind::Unsupported, "name another one"),
        };
        let location = if name.is_empty() { Location::File } else { Location::Variable(name.clone()) };
        let error = Error::new(kind, location, format!("a real matrix was expected, this is {note}"), remedy);
        let variable = Variable { name, rows: 0, columns: 0, note: Some(note) };
        Self { variable, read: Box::new(move || Err(error.clone())) }
    }
}

/// What a file holds under one name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Its name; empty in formats that hold one matrix without a name.
    pub name: String,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// What it is, if it is no real matrix.
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
