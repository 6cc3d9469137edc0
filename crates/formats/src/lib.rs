//! Matrices from and to files: what finite-element programs, MATLAB and Python write becomes one [`Matrix`] type.
//!
//! ```
//! use stickslip_formats::{Matrix, Symmetry, list, read, write};
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("stiffness.mtx");
//! let stiffness = Matrix::new(2, 2, Symmetry::Symmetric, [(0, 0, 2e5), (1, 0, -1e5), (1, 1, 1e5)])?;
//! write(&path, &stiffness)?;
//!
//! // The format is found by content; a name is needed where a file holds several matrices.
//! let back = read(&path, None, None)?;
//! assert_eq!(back.entries(), stiffness.entries());
//! assert_eq!(back.origin().format, "matrix-market");
//! assert_eq!(list(&path, None)?[0].to_string(), "2 x 2");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Formats are rows of [`TABLE`]; names of rows have a table of their own, [`names::TABLE`]. What a header says of sizes is not
//! believed: memory follows what is really in the file, see [`EXPANSION`] for compressed ones.

mod abaqus_element;
mod abaqus_input;
mod ansys_full;
mod bytes;
mod constrained;
mod coordinate;
mod dense;
mod error;
mod file;
mod format;
mod fortran;
mod harwell_boeing;
mod hdf5;
mod inflate;
mod mat5;
mod matrix;
mod matrix_market;
pub mod names;
mod nastran_dmig;
mod nastran_op4;
mod npy;
mod npz;
mod report;
mod sizes;
mod text;

use std::path::Path;

use file::{io, load};
use format::Item;

pub use constrained::{aligned, constrained};
pub use error::{Error, Kind, Location};
pub use file::LARGEST_FILE;
pub use format::{Format, Variable};
pub use inflate::{EXPANSION, UNPACKED_ALWAYS};
pub use matrix::{Entry, Matrix, Origin, Symmetry};
pub use report::Report;

/// All formats. The first whose sniff is right reads a file.
pub const TABLE: &[Format] = &[
    matrix_market::FORMAT,
    hdf5::FORMAT,
    mat5::FORMAT,
    npy::FORMAT,
    npz::FORMAT,
    abaqus_element::FORMAT,
    abaqus_input::FORMAT,
    nastran_op4::FORMAT,
    ansys_full::FORMAT,
    harwell_boeing::FORMAT,
    coordinate::FORMAT,
    // Rows of numbers begin as many other files do.
    dense::FORMAT,
    // Its cards may stand anywhere in a file, so that it looks through all of it.
    nastran_dmig::FORMAT,
];

/// Reads one matrix.
///
/// `format` is a name of [`TABLE`]; without it the content decides. `name` is needed where the file holds several matrices.
///
/// # Errors
/// With file, location, what was expected, and what to do, see [`Kind`].
pub fn read(path: impl AsRef<Path>, format: Option<&str>, name: Option<&str>) -> Result<Matrix, Error> {
    let path = path.as_ref();
    read_bytes(&load(path)?, format, name).map_err(|error| error.of(path))
}

/// As [`read`], from a file in memory.
///
/// # Errors
/// As [`read`], without the name of a file.
pub fn read_bytes(bytes: &[u8], format: Option<&str>, name: Option<&str>) -> Result<Matrix, Error> {
    let bytes = unmarked(bytes);
    let format = find(bytes, format)?;
    let items = (format.open)(bytes)?;
    let item = pick(format, &items, name)?;
    check_size(item.variable.rows, item.variable.columns, bytes.len())?;
    let mut matrix = (item.read)().map_err(|error| match item.variable.name.as_str() {
        "" => error,
        name => error.at(Location::Variable(name.to_string())),
    })?;
    check_size(matrix.rows(), matrix.columns(), bytes.len())?;
    matrix.set_origin(format.name, &item.variable.name);
    Ok(matrix)
}

/// What a file holds, in its order.
///
/// # Errors
/// As [`read`].
pub fn list(path: impl AsRef<Path>, format: Option<&str>) -> Result<Vec<Variable>, Error> {
    let path = path.as_ref();
    list_bytes(&load(path)?, format).map_err(|error| error.of(path))
}

/// As [`list`], of a file in memory.
///
/// # Errors
/// As [`list`], without the name of a file.
pub fn list_bytes(bytes: &[u8], format: Option<&str>) -> Result<Vec<Variable>, Error> {
    let bytes = unmarked(bytes);
    let items = (find(bytes, format)?.open)(bytes)?;
    Ok(items.into_iter().map(|item| item.variable).collect())
}

/// Writes a matrix as Matrix Market (`.mtx`) or for SciPy (`.npz`), by the ending of the path.
///
/// Every number reads back to its last bit. Names of rows go into a file of their own, see [`names::write`].
///
/// # Errors
/// [`Kind::Format`] for another ending, [`Kind::Io`].
pub fn write(path: impl AsRef<Path>, matrix: &Matrix) -> Result<(), Error> {
    let path = path.as_ref();
    let bytes = match path.extension().and_then(|ending| ending.to_str()) {
        Some("mtx") => matrix_market::write(matrix),
        Some("npz") => npz::write(matrix).map_err(|error| error.of(path))?,
        _ => {
            let problem = "matrices are written as .mtx (Matrix Market) or .npz (SciPy)".into();
            return Err(
                Error::new(Kind::Format, Location::File, problem, "give the file one of these endings").of(path)
            );
        }
    };
    std::fs::write(path, bytes).map_err(|error| io(path, &error))
}

/// Without the mark that some editors put before text in UTF-8.
fn unmarked(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// The format of that name, or the one that the content is of.
fn find(bytes: &[u8], name: Option<&str>) -> Result<&'static Format, Error> {
    let names = || TABLE.iter().map(|format| format.name).collect::<Vec<_>>().join(", ");
    let fault = |problem, remedy| Error::new(Kind::Format, Location::File, problem, remedy);
    if let Some(name) = name {
        let found = TABLE.iter().find(|format| format.name == name);
        return found.ok_or_else(|| fault(format!("no format is called `{name}`"), format!("there are {}", names())));
    }
    if bytes.is_empty() {
        return Err(fault("the file is empty".into(), "export or copy it again".into()));
    }
    if bytes.starts_with(&[0x1f, 0x8b]) {
        return Err(fault("the file is compressed by gzip".into(), "unpack it first: gunzip FILE".into()));
    }
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(fault(
            "the file is text in UTF-16".into(),
            "save it as UTF-8: PowerShell's > writes UTF-16".into(),
        ));
    }
    let found = TABLE.iter().find(|format| (format.sniff)(bytes));
    found.ok_or_else(|| {
        if mat5::is_version_4(bytes) {
            return fault(
                "the file is of MATLAB version 4".into(),
                "save it again: save('matrices.mat', 'K', 'M', '-v7'), or scipy.io.savemat with format='5'".into(),
            );
        }
        fault(
            "no format is known by this content".into(),
            format!("state the format if it is one of {}, else export the matrix in one of these", names()),
        )
    })
}

/// The matrix of that name, or the only one.
fn pick<'i, 'a>(format: &Format, items: &'i [Item<'a>], name: Option<&str>) -> Result<&'i Item<'a>, Error> {
    let fault = |problem: String, remedy: &str| Err(Error::new(Kind::Choice, Location::File, problem, remedy));
    let there = || match items {
        [] => "nothing".to_string(),
        items => items.iter().map(|item| item.variable.to_string()).collect::<Vec<_>>().join(", "),
    };
    let filled = |variable: &Variable| variable.note.is_none() && variable.rows.min(variable.columns) > 0;
    let matrices: Vec<_> = items.iter().filter(|item| filled(&item.variable)).collect();
    match (name, matrices.as_slice()) {
        (Some(name), _) => match items.iter().find(|item| item.variable.name == name && !name.is_empty()) {
            Some(item) => Ok(item),
            None if items.iter().all(|item| item.variable.name.is_empty()) => fault(
                format!("a file of format {} holds one matrix, which has no name", format.name),
                "leave the name out",
            ),
            None => fault(format!("nothing is called `{name}`, the file holds {}", there()), "take one of these names"),
        },
        (None, [one]) => Ok(one),
        // Its own error says more than that there is no matrix.
        (None, []) if items.len() == 1 => Ok(&items[0]),
        (None, []) if items.is_empty() => fault("the file holds nothing".into(), "export the matrix again"),
        (None, []) => fault(format!("the file holds no real matrix, but {}", there()), "export the matrix again"),
        (None, several) if several.iter().any(|item| item.variable.name.is_empty()) => fault(
            format!("the file holds {}", there()),
            "say which one by its name; export one without a name in a file of its own",
        ),
        (None, _) => fault(format!("the file holds {}", there()), "say which one by its name"),
    }
}

/// Rows and columns beyond this many, and beyond [`ROWS_PER_BYTE`], are no size of this file but a damaged number.
const ROWS_ALWAYS: usize = 1 << 20;

/// Rows and columns for every byte of a file. A row with an entry takes a line of text, and that of a diagonal some two bytes where its numbers are
/// compressed; so many rows without any stand in small files only.
const ROWS_PER_BYTE: usize = 1;

/// Refuses sizes that a file of this length cannot fill: whoever holds one number a row shall not run out of memory.
fn check_size(rows: usize, columns: usize, length: usize) -> Result<(), Error> {
    let most = ROWS_ALWAYS.max(length.saturating_mul(ROWS_PER_BYTE));
    if rows.max(columns) <= most {
        return Ok(());
    }
    Err(Error::new(
        Kind::TooLarge,
        Location::File,
        format!("{rows} rows and {columns} columns in a file of {length} bytes"),
        "an index or a size in it is damaged: export it again",
    ))
}
