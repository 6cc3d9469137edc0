//! Result files: their content in memory, the outputs that make them, and atomic writing to
//! disk.

use std::io::Write;
use std::path::{Path, PathBuf};
use stickslip_study::dataset::{Dataset, Table};

/// One kind of output: its name and the function that makes its files.
#[derive(Debug)]
pub struct Output {
    /// Name, for command-line flags and lists.
    pub name: &'static str,
    /// One line that says what the output writes.
    pub summary: &'static str,
    /// Makes the files: each has a name inside the study's folder and a content.
    pub make: fn(&Dataset) -> Result<Vec<File>, ReportError>,
    /// Writes a table row by row, for results too large for memory. `None` if the output is not
    /// a table.
    pub sink: Option<Sink>,
    /// `true` if the output is written by default.
    pub is_default: bool,
}

/// Begins the file of a table in a writer. The table gives the columns; its rows are not
/// written.
pub type BeginTable = for<'a> fn(&Table, Box<dyn Write + 'a>) -> Result<Box<dyn TableWriter + 'a>, ReportError>;

/// Writer of one file per table, to which rows are appended as they are computed.
#[derive(Debug, Clone, Copy)]
pub struct Sink {
    /// File name extension, without the dot, after the name of the table.
    pub extension: &'static str,
    /// Begins the file of a table in a writer. The table gives the columns; its rows are not
    /// written.
    pub begin: BeginTable,
}

/// The file of a table while it is being written.
pub trait TableWriter {
    /// Appends these rows. The columns must be those that the file was begun with.
    ///
    /// # Errors
    /// [`ReportError`] if the columns differ in length or the writer fails.
    fn rows(&mut self, table: &Table) -> Result<(), ReportError>;

    /// Finishes the file.
    ///
    /// # Errors
    /// [`ReportError`] if the writer fails.
    fn end(self: Box<Self>) -> Result<(), ReportError>;
}

impl Sink {
    /// Returns the files of all tables of a dataset.
    ///
    /// # Errors
    /// [`ReportError`] if the columns of a table differ in length, or if two tables have the
    /// same name.
    pub fn files(&self, dataset: &Dataset) -> Result<Vec<File>, ReportError> {
        for (i, table) in dataset.tables.iter().enumerate() {
            if dataset.tables[..i].iter().any(|other| other.name.eq_ignore_ascii_case(&table.name)) {
                return Err(ReportError::SameName(table.name.clone()));
            }
        }
        let file = |table: &Table| Ok(File::new(self.file_name(&table.name)?, self.file(table)?));
        dataset.tables.iter().map(file).collect()
    }

    /// Returns the content of the file of a table.
    ///
    /// # Errors
    /// [`ReportError`] if the columns differ in length.
    pub fn file(&self, table: &Table) -> Result<Vec<u8>, ReportError> {
        let mut bytes = Vec::new();
        let mut rows = (self.begin)(table, Box::new(&mut bytes))?;
        rows.rows(table)?;
        rows.end()?;
        Ok(bytes)
    }

    /// Returns the file name for a table.
    ///
    /// # Errors
    /// [`ReportError::Name`] if the table's name cannot be a file name.
    pub fn file_name(&self, table: &str) -> Result<String, ReportError> {
        Ok(format!("{}.{}", file_name(table, "table")?, self.extension))
    }
}

/// Returns an error if the columns of a table differ in length.
pub(crate) fn check_equal_lengths(table: &Table) -> Result<(), ReportError> {
    let rows = table.rows();
    match table.columns.iter().find(|column| column.values.len() != rows) {
        None => Ok(()),
        Some(column) => Err(ReportError::Uneven {
            table: table.name.clone(),
            column: column.name.clone(),
            rows: column.values.len(),
            expected: rows,
        }),
    }
}

/// A file in memory, before it is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// File name inside its folder.
    pub name: String,
    /// Content in bytes.
    pub content: Vec<u8>,
    /// `true` if the file belongs to the folder that holds the studies' folders, because all
    /// studies share it.
    pub shared: bool,
}

impl File {
    /// Creates a file of the study's folder.
    pub fn new(name: impl Into<String>, content: impl Into<Vec<u8>>) -> File {
        File { name: name.into(), content: content.into(), shared: false }
    }
    /// Creates a file that all studies share, in the folder that holds the studies' folders.
    pub fn shared(name: impl Into<String>, content: impl Into<Vec<u8>>) -> File {
        File { shared: true, ..File::new(name, content) }
    }
}

/// Reason why a result could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The file system returned an error.
    #[error("cannot write {}: {cause}", path.display())]
    Write {
        /// File or folder that could not be written.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        cause: std::io::Error,
    },
    /// The name cannot be a file name.
    #[error("`{name}` is not a valid file name for a {what}: use letters, digits, `_`, `-` and `.`")]
    Name {
        /// The rejected name.
        name: String,
        /// Kind of object that has the name, such as `table`.
        what: &'static str,
    },
    /// Two tables would be written to the same file.
    #[error("two tables have the name `{0}`; give each table a different name")]
    SameName(String),
    /// The columns of a table differ in length.
    #[error("table `{table}`: column `{column}` has {rows} rows, the first column has {expected}")]
    Uneven {
        /// Name of the table.
        table: String,
        /// Name of the column whose length differs from that of the first column.
        column: String,
        /// Number of rows of this column.
        rows: usize,
        /// Number of rows of the first column.
        expected: usize,
    },
    /// No output has this name.
    #[error("unknown output `{name}`; the outputs are: {known}")]
    UnknownOutput {
        /// The requested name.
        name: String,
        /// The names of all outputs, separated by commas.
        known: String,
    },
    /// A library could not encode a file.
    #[error("cannot create {file}: {reason}")]
    Encode {
        /// Name of the file.
        file: String,
        /// Error text of the library.
        reason: String,
    },
}

impl ReportError {
    pub(crate) fn encode(file: impl Into<String>, reason: impl ToString) -> ReportError {
        ReportError::Encode { file: file.into(), reason: reason.to_string() }
    }
}

/// Writes a file unless it already exists with this content.
pub(crate) fn write_if_changed(path: &Path, content: &[u8]) -> Result<(), ReportError> {
    if std::fs::read(path).is_ok_and(|found| found == content) {
        return Ok(());
    }
    write_file(path, content).map(|_| ())
}

/// Writes one file completely or not at all, and returns its path.
///
/// The function writes a temporary file in the same folder and renames it when it is complete.
/// It creates the folder if necessary.
/// # Errors
/// [`ReportError::Write`] with the path and the cause.
pub fn write_file(path: &Path, content: &[u8]) -> Result<PathBuf, ReportError> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(|cause| ReportError::Write { path: folder.to_owned(), cause })?;
    // The process id separates two runs that write into the same folder.
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.part", std::process::id()));
    let part = folder.join(name);
    let written = std::fs::File::create(&part)
        .and_then(|mut file| file.write_all(content).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&part, path));
    match written {
        Ok(()) => Ok(path.to_owned()),
        Err(cause) => {
            // The file may not exist; the first error is the one to report.
            let _ = std::fs::remove_file(&part);
            Err(ReportError::Write { path: path.to_owned(), cause })
        }
    }
}

/// Returns the name if it is a valid file name on every operating system.
pub(crate) fn file_name<'a>(name: &'a str, what: &'static str) -> Result<&'a str, ReportError> {
    let forbidden = |c: char| c.is_control() || "/\\:*?\"<>|".contains(c);
    if name.is_empty() || name.starts_with('.') || name.ends_with(['.', ' ']) || name.contains(forbidden) {
        return Err(ReportError::Name { name: name.to_owned(), what });
    }
    Ok(name)
}
