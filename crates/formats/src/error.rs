//! What is wrong with a file: where, what was expected, what to do.

use std::fmt;
use std::path::{Path, PathBuf};

/// A file that could not be read or written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{problem}; {remedy}", Prefix(.path.as_deref(), .location))]
pub struct Error {
    /// What kind of fault it is.
    pub kind: Kind,
    /// The file, where it is known.
    pub path: Option<PathBuf>,
    /// Where in the file.
    pub location: Location,
    /// What is there, and what was expected.
    pub problem: String,
    /// What to do about it.
    pub remedy: String,
}

impl Error {
    /// An error that does not know its file yet.
    pub(crate) fn new(kind: Kind, location: Location, problem: String, remedy: impl Into<String>) -> Self {
        Self { kind, path: None, location, problem, remedy: remedy.into() }
    }

    /// The same error, of the file at `path`.
    pub(crate) fn of(mut self, path: &Path) -> Self {
        self.path.get_or_insert_with(|| path.to_path_buf());
        self
    }

    /// The same error at another location, where it knows none yet.
    pub(crate) fn at(mut self, location: Location) -> Self {
        if self.location == Location::File {
            self.location = location;
        }
        self
    }
}

/// Kinds of faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// The system could not read or write the file.
    Io,
    /// No format of the table reads this, or there is none of the given name.
    Format,
    /// The file ends too early.
    Truncated,
    /// A line, number or header that is not as the format says.
    Malformed,
    /// More or fewer entries than the header says, or entries beyond its size.
    Count,
    /// Complex numbers.
    Complex,
    /// NaN or infinity.
    NotFinite,
    /// Sizes beyond what any file of this length can hold, or beyond 32 bits.
    TooLarge,
    /// The format has this, but it is not read.
    Unsupported,
    /// No matrix of that name, or several and no name.
    Choice,
    /// Names of rows that do not match the matrix.
    Names,
    /// A matrix with another number of rows than columns where a square one is needed.
    NotSquare,
    /// Two triangles that differ.
    NotSymmetric,
}

/// Where in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// The file as a whole.
    File,
    /// A line, from one.
    Line(usize),
    /// A byte, from zero.
    Byte(usize),
    /// One matrix or member of the file, by its name.
    Variable(String),
}

/// `path, line 3: ` of an error message.
struct Prefix<'a>(Option<&'a Path>, &'a Location);

impl fmt::Display for Prefix<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(path, location) = self;
        // the root of a file has no name of its own
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
        let error =
            Error::new(Kind::Count, Location::Line(3), "two numbers, three were expected".into(), "export it again");
        assert_eq!(error.to_string(), "line 3: two numbers, three were expected; export it again");
        let error = error.of(Path::new("blade.mtx"));
        assert_eq!(error.to_string(), "blade.mtx, line 3: two numbers, three were expected; export it again");
        let whole = Error::new(Kind::Io, Location::File, "no such file".into(), "check the path");
        assert_eq!(whole.clone().of(Path::new("a")).to_string(), "a: no such file; check the path");
        assert_eq!(whole.to_string(), "no such file; check the path");
    }
}
