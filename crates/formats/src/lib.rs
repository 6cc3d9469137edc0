//! Reads and writes matrices: files of finite-element programs, MATLAB and
//! Python become one [`Matrix`] type. The module [`data`] reads measured tables, and [`mesh`] reads
//! meshes.
//!
//! ```
//! use stickslip_formats::{Matrix, Symmetry, list, read, write};
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("stiffness.mtx");
//! let stiffness =
//!     Matrix::new(2, 2, Symmetry::Symmetric, [(0, 0, 2e5), (1, 0, -1e5), (1, 1, 1e5)])?;
//! write(&path, &stiffness)?;
//!
//! // The content determines the format; a file with several matrices needs a name.
//! let back = read(&path, None, None)?;
//! assert_eq!(back.entries(), stiffness.entries());
//! assert_eq!(back.origin().format, "matrix-market");
//! assert_eq!(list(&path, None)?[0].to_string(), "2 x 2");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A matrix of a finite-element program, with the names of its rows:
//!
//! ```no_run
//! use stickslip_formats::{MatrixReport, list, names, read};
//!
//! for variable in list("blade.mat", None)? {
//!     println!("{variable}");                              // K (61098 x 61098), …
//! }
//! let stiffness = read("blade.mat", None, Some("K"))?;
//! println!("{}", MatrixReport::new(&stiffness));           // size, entries, symmetry
//! let rows = names::read("blade.dof", stiffness.rows())?;  // names such as 1353.y
//! let stiffness = stiffness.with_names(rows)?;
//! # Ok::<(), stickslip_formats::Error>(())
//! ```
//!
//! [`TABLE`] lists the formats, and [`names::TABLE`] the formats of row names.
//!
//! The reader does not trust sizes stated in a header: memory is bounded by the length of the
//! file, see [`MAX_EXPANSION`] for compressed files.

mod abaqus_element;
mod abaqus_input;
mod ansys_full;
mod bytes;
mod constrained;
mod coordinate;
pub mod data;
mod dense;
mod error;
mod file;
mod first_line;
mod format;
mod fortran;
mod harwell_boeing;
mod hdf5;
mod inflate;
mod mat5;
mod matrix;
mod matrix_market;
pub mod mesh;
pub mod names;
mod nastran_dmig;
mod nastran_op2;
mod nastran_op4;
mod npy;
mod npz;
mod report;
mod text;

use std::path::Path;

use file::{io, load};
use format::Item;

pub use constrained::{align_rows, constrained_rows};
pub use error::{Error, ErrorKind, Location};
pub use file::MAX_FILE_BYTES;
pub use format::{Format, Variable};
pub use inflate::{MAX_EXPANSION, MIN_DECOMPRESSED_LIMIT};
pub use matrix::{Entry, Matrix, Origin, Symmetry};
pub use report::MatrixReport;

/// All formats. The first format that recognizes the content reads the file.
pub const TABLE: &[Format] = &[
    matrix_market::FORMAT,
    hdf5::FORMAT,
    mat5::FORMAT,
    npy::FORMAT,
    npz::FORMAT,
    abaqus_element::FORMAT,
    abaqus_input::FORMAT,
    nastran_op2::FORMAT,
    nastran_op4::FORMAT,
    ansys_full::FORMAT,
    harwell_boeing::FORMAT,
    coordinate::FORMAT,
    // Other formats begin with rows of numbers too, so this one comes late.
    dense::FORMAT,
    // The cards may be anywhere in a file, so this format searches all of it.
    nastran_dmig::FORMAT,
];

/// Reads one matrix.
///
/// `format` is a name from [`TABLE`]; without it the content determines the format. `name` is
/// required if the file contains several matrices.
///
/// # Errors
/// [`Error`] with file, location, problem and remedy; see [`ErrorKind`].
pub fn read(path: impl AsRef<Path>, format: Option<&str>, name: Option<&str>) -> Result<Matrix, Error> {
    let path = path.as_ref();
    read_bytes(&load(path)?, format, name).map_err(|error| error.with_path(path))
}

/// Reads one matrix from a file in memory, like [`read`].
///
/// # Errors
/// Like [`read`], without the path.
pub fn read_bytes(bytes: &[u8], format: Option<&str>, name: Option<&str>) -> Result<Matrix, Error> {
    let bytes = without_bom(bytes);
    let format = find_format(bytes, format)?;
    let items = (format.open)(bytes)?;
    let item = select(format, &items, name)?;
    check_size(item.variable.rows, item.variable.columns, bytes.len())?;
    let mut matrix = (item.read)().map_err(|error| match item.variable.name.as_str() {
        "" => error,
        name => error.with_location(Location::Variable(name.to_string())),
    })?;
    check_size(matrix.rows(), matrix.columns(), bytes.len())?;
    matrix.set_origin(format.name, &item.variable.name);
    Ok(matrix)
}

/// Lists the contents of a file, in file order.
///
/// # Errors
/// Like [`read`].
pub fn list(path: impl AsRef<Path>, format: Option<&str>) -> Result<Vec<Variable>, Error> {
    let path = path.as_ref();
    list_bytes(&load(path)?, format).map_err(|error| error.with_path(path))
}

/// Lists the contents of a file in memory, like [`list`].
///
/// # Errors
/// Like [`list`], without the path.
pub fn list_bytes(bytes: &[u8], format: Option<&str>) -> Result<Vec<Variable>, Error> {
    let bytes = without_bom(bytes);
    let items = (find_format(bytes, format)?.open)(bytes)?;
    Ok(items.into_iter().map(|item| item.variable).collect())
}

/// Writes a matrix as Matrix Market (`.mtx`) or for SciPy (`.npz`), according
/// to the file extension.
///
/// Every number reads back to its last bit. [`names::write`] writes the row
/// names to a separate file.
///
/// # Errors
/// [`ErrorKind::Format`] for another extension, [`ErrorKind::Io`].
pub fn write(path: impl AsRef<Path>, matrix: &Matrix) -> Result<(), Error> {
    let path = path.as_ref();
    let bytes = match path.extension().and_then(|ending| ending.to_str()) {
        Some("mtx") => matrix_market::write(matrix),
        Some("npz") => npz::write(matrix).map_err(|error| error.with_path(path))?,
        _ => {
            let problem = "the file extension is neither .mtx (Matrix Market) nor .npz (SciPy)".into();
            return Err(
                Error::new(ErrorKind::Format, Location::File, problem, "use one of these extensions").with_path(path)
            );
        }
    };
    std::fs::write(path, bytes).map_err(|error| io(path, &error))
}

/// Returns the content without the UTF-8 byte order mark that some editors write.
fn without_bom(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// Returns the format with the given name, or the one that recognizes the content.
fn find_format(bytes: &[u8], name: Option<&str>) -> Result<&'static Format, Error> {
    let names = || TABLE.iter().map(|format| format.name).collect::<Vec<_>>().join(", ");
    let fault = |problem, remedy| Error::new(ErrorKind::Format, Location::File, problem, remedy);
    if let Some(name) = name {
        let found = TABLE.iter().find(|format| format.name == name);
        return found.ok_or_else(|| fault(format!("there is no format `{name}`"), format!("use one of: {}", names())));
    }
    if bytes.is_empty() {
        return Err(fault("the file is empty".into(), "export or copy it again".into()));
    }
    if bytes.starts_with(&[0x1f, 0x8b]) {
        return Err(fault("the file is compressed with gzip".into(), "decompress it first: gunzip FILE".into()));
    }
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(fault(
            "the file is UTF-16 text".into(),
            "save it as UTF-8 (the redirection > of PowerShell writes UTF-16)".into(),
        ));
    }
    let found = TABLE.iter().find(|format| (format.sniff)(bytes));
    found.ok_or_else(|| {
        if mat5::is_version_4(bytes) {
            return fault(
                "the file has the format of MATLAB version 4, which is not supported".into(),
                "save it again: save('matrices.mat', 'K', 'M', '-v7'), or scipy.io.savemat with format='5'".into(),
            );
        }
        let line = bytes.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii).find(|line| !line.is_empty());
        let is_text = |line: &&[u8]| line.iter().all(|byte| *byte >= b' ' || *byte == b'\t');
        let begins = line.filter(is_text).map(|line| format!(", which begins with {}", text::quoted(line)));
        fault(
            format!("no known format matches the content of the file{}", begins.unwrap_or_default()),
            format!(
                "state the format if it is one of {}; otherwise export the matrix in one of these formats",
                names()
            ),
        )
    })
}

/// Returns the matrix with the given name, or the only one.
fn select<'i, 'a>(format: &Format, items: &'i [Item<'a>], name: Option<&str>) -> Result<&'i Item<'a>, Error> {
    let fault = |problem: String, remedy: &str| Err(Error::new(ErrorKind::Selection, Location::File, problem, remedy));
    let there = || match items {
        [] => "nothing".to_string(),
        items => items.iter().map(|item| item.variable.to_string()).collect::<Vec<_>>().join(", "),
    };
    let filled = |variable: &Variable| variable.note.is_none() && variable.rows.min(variable.columns) > 0;
    let matrices: Vec<_> = items.iter().filter(|item| filled(&item.variable)).collect();
    match (name, matrices.as_slice()) {
        (Some(name), _) => match items.iter().find(|item| item.variable.name == name && !name.is_empty()) {
            Some(item) => Ok(item),
            None if items.iter().all(|item| item.variable.name.is_empty()) => {
                fault(format!("a file of format {} contains one matrix without a name", format.name), "omit the name")
            }
            None => {
                fault(format!("there is no matrix `{name}`; the file contains {}", there()), "use one of these names")
            }
        },
        (None, [one]) => Ok(one),
        // The error of the item says more than that there is no matrix.
        (None, []) if items.len() == 1 => Ok(&items[0]),
        (None, []) if items.is_empty() => fault("the file contains no matrix".into(), "export the matrix again"),
        (None, []) => fault(format!("the file contains no real matrix, only {}", there()), "export the matrix again"),
        (None, several) if several.iter().any(|item| item.variable.name.is_empty()) => fault(
            format!("the file contains several matrices: {}", there()),
            "select one by its name; export a matrix without a name to a separate file",
        ),
        (None, _) => fault(format!("the file contains several matrices: {}", there()), "select one by its name"),
    }
}

/// Rejects sizes that a file of this length cannot fill, because users allocate
/// at least one number per row.
fn check_size(rows: usize, columns: usize, length: usize) -> Result<(), Error> {
    // The limit is the number of bytes, and at least 2²⁰. A row with an entry takes a line of
    // text, or about two bytes if it belongs to a compressed diagonal. Only small files have
    // more empty rows.
    let most = length.max(1 << 20);
    if rows.max(columns) <= most {
        return Ok(());
    }
    Err(Error::new(
        ErrorKind::TooLarge,
        Location::File,
        format!("the file states {rows} rows and {columns} columns, too many for its {length} bytes"),
        "an index or a size in the file is damaged; export it again",
    ))
}
