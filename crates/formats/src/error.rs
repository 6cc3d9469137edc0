//! Errors of files: location, problem and remedy.

use std::fmt;
use std::path::{Path, PathBuf};

/// A failure to read or write a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{problem}; {remedy}", Prefix(.path.as_deref(), .location))]
pub struct Error {
    /// The kind of the failure.
    pub kind: ErrorKind,
    /// The file, if it is known.
    pub path: Option<PathBuf>,
    /// The location in the file.
    pub location: Location,
    /// The problem: the actual and the expected content.
    pub problem: String,
    /// The remedy for the user.
    pub remedy: String,
}

impl Error {
    /// Creates an error without a path.
    pub(crate) fn new(kind: ErrorKind, location: Location, problem: String, remedy: impl Into<String>) -> Self {
        Self { kind, path: None, location, problem, remedy: remedy.into() }
    }

    /// Returns the error with a path, if it has none yet.
    pub(crate) fn with_path(mut self, path: &Path) -> Self {
        self.path.get_or_insert_with(|| path.to_path_buf());
        self
    }

    /// Returns the error with a location, if it has none yet.
    pub(crate) fn with_location(mut self, location: Location) -> Self {
        if self.location == Location::File {
            self.location = location;
        }
        self
    }
}

/// Kinds of failures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The system could not read or write the file.
    Io,
    /// No format recognizes the content, or no format has the given name.
    Format,
    /// The file ends too early.
    Truncated,
    /// A line, number or header violates the format.
    Malformed,
    /// The number of entries differs from the header, or an entry lies outside the size.
    Count,
    /// The numbers are complex.
    Complex,
    /// A number is NaN or infinite.
    NotFinite,
    /// A size exceeds the capacity of a file of this length, or 32 bits.
    TooLarge,
    /// The content is valid in the format, but the reader does not support it.
    Unsupported,
    /// No matrix has the given name, or the name of one of several matrices is missing.
    Selection,
    /// Row names do not match the matrix.
    Names,
    /// A square matrix is required.
    NotSquare,
    /// The two triangles of a symmetric matrix differ.
    NotSymmetric,
}

/// A location in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// The file as a whole.
    File,
    /// A line, counted from one.
    Line(usize),
    /// A byte, counted from zero.
    Byte(usize),
    /// A matrix or member of the file, by its name.
    Variable(String),
}

/// The beginning of an error message: `path, line 3: `.
struct Prefix<'a>(Option<&'a Path>, &'a Location);

impl fmt::Display for Prefix<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(path, location) = self;
        // The root of a file has an empty name.
        let location = match location {
            Location::Variable(name) if name.is_empty() => &Location::File,
            other => other,
        };
        if let Some(path) = path {
            write!(f, "{}", path.display())?;
        }
        if path.is_some() && *location != Location::File {
            f.write_str(", ")?;
        }
        match location {
            Location::File => {}
            Location::Line(line) => write!(f, "line {line}")?,
            Location::Byte(byte) => write!(f, "byte {byte}")?,
            Location::Variable(name) => write!(f, "`{name}`")?,
        }
        if path.is_some() || *location != Location::File { f.write_str(": ") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_says_file_place_problem_and_remedy() {
        let error = Error::new(
            ErrorKind::Count,
            Location::Line(3),
            "two numbers, three were expected".into(),
            "export it again",
        );
        assert_eq!(error.to_string(), "line 3: two numbers, three were expected; export it again");
        let error = error.with_path(Path::new("blade.mtx"));
        assert_eq!(error.to_string(), "blade.mtx, line 3: two numbers, three were expected; export it again");
        let whole = Error::new(ErrorKind::Io, Location::File, "no such file".into(), "check the path");
        assert_eq!(whole.clone().with_path(Path::new("a")).to_string(), "a: no such file; check the path");
        assert_eq!(whole.to_string(), "no such file; check the path");
    }
}
