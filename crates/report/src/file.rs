//! A file of results before it is written, what makes such files, and how one reaches the disk: whole or not at all.

use std::io::Write;
use std::path::{Path, PathBuf};
use stickslip_study::dataset::{Dataset, Table};

/// One kind of output: what it is called and how its files are made.
#[derive(Debug)]
pub struct Output {
    /// Name, for flags and lists.
    pub name: &'static str,
    /// What it writes, in one line.
    pub summary: &'static str,
    /// Makes the files: name inside the study's folder, and content.
    pub make: fn(&Dataset) -> Result<Vec<File>, ReportError>,
    /// Writes a table row by row, for results that need not be in memory as a whole; `None` if it is no output of tables.
    pub sink: Option<Sink>,
    /// Whether it is written when nobody says what.
    pub usual: bool,
}

/// Begins a file for the rows of a table, whose columns it has.
pub type Begin = for<'a> fn(&Table, Box<dyn Write + 'a>) -> Result<Box<dyn Rows + 'a>, ReportError>;

/// A file per table, to which rows are written as they come.
#[derive(Debug, Clone, Copy)]
pub struct Sink {
    /// What the name of the file ends in, after the name of the table and a dot.
    pub extension: &'static str,
    /// Begins the file of a table with these columns, whose rows do not count, in a writer.
    pub begin: Begin,
}

/// The file of a table that is being written.
pub trait Rows {
    /// Writes these rows after those before; the columns are those that it was begun with.
    ///
    /// # Errors
    /// [`ReportError`]: the columns are uneven, or the writer refuses.
    fn rows(&mut self, table: &Table) -> Result<(), ReportError>;

    /// Ends the file.
    ///
    /// # Errors
    /// [`ReportError`]: the writer refuses.
    fn end(self: Box<Self>) -> Result<(), ReportError>;
}

impl Sink {
    /// The files of all tables of a dataset.
    ///
    /// # Errors
    /// [`ReportError`]: the columns of a table differ in length, or two tables have one name.
    pub fn files(&self, dataset: &Dataset) -> Result<Vec<File>, ReportError> {
        for (i, table) in dataset.tables.iter().enumerate() {
            if dataset.tables[..i].iter().any(|other| other.name.eq_ignore_ascii_case(&table.name)) {
                return Err(ReportError::SameName(table.name.clone()));
            }
        }
        let file = |table: &Table| Ok(File::new(self.file_name(&table.name)?, self.file(table)?));
        dataset.tables.iter().map(file).collect()
    }

    /// The file of a table.
    ///
    /// # Errors
    /// [`ReportError`]: its columns differ in length.
    pub fn file(&self, table: &Table) -> Result<Vec<u8>, ReportError> {
        let mut bytes = Vec::new();
        let mut rows = (self.begin)(table, Box::new(&mut bytes))?;
        rows.rows(table)?;
        rows.end()?;
        Ok(bytes)
    }

    /// The name of the file of a table.
    ///
    /// # Errors
    /// [`ReportError::Name`]: the table has no name for a file.
    pub fn file_name(&self, table: &str) -> Result<String, ReportError> {
        Ok(format!("{}.{}", file_name(table, "table")?, self.extension))
    }
}

/// Refuses columns of different length.
pub(crate) fn even(table: &Table) -> Result<(), ReportError> {
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

/// A file before it is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// Name inside its folder.
    pub name: String,
    /// The bytes.
    pub content: Vec<u8>,
    /// Whether its folder is the one that holds the studies' folders: the same file serves them all.
    pub shared: bool,
}

impl File {
    /// A file of this name and content in the study's folder.
    pub fn new(name: impl Into<String>, content: impl Into<Vec<u8>>) -> File {
        File { name: name.into(), content: content.into(), shared: false }
    }
    /// A file that all studies share, in the folder that holds theirs.
    pub fn shared(name: impl Into<String>, content: impl Into<Vec<u8>>) -> File {
        File { shared: true, ..File::new(name, content) }
    }
}

/// Why a result could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The file system refused.
    #[error("cannot write {}: {cause}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The reason of the operating system.
        #[source]
        cause: std::io::Error,
    },
    /// A name that cannot be the name of a file.
    #[error("`{name}` cannot name the file of a {what}: use letters, digits, `_`, `-` and `.`")]
    Name {
        /// The name.
        name: String,
        /// What has the name.
        what: &'static str,
    },
    /// Two tables would be the same file.
    #[error("two tables are named `{0}`; each needs a name of its own")]
    SameName(String),
    /// The columns of a table differ in length.
    #[error("table `{table}`: column `{column}` has {rows} rows, the first column has {expected}")]
    Uneven {
        /// The table.
        table: String,
        /// The column that differs from the first.
        column: String,
        /// Its rows.
        rows: usize,
        /// The rows of the first column.
        expected: usize,
    },
    /// There is no output of this name.
    #[error("there is no output `{name}`; there are: {known}")]
    UnknownOutput {
        /// The name asked for.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// A library could not encode a file.
    #[error("cannot make {file}: {reason}")]
    Encode {
        /// The file.
        file: String,
        /// The reason.
        reason: String,
    },
}

impl ReportError {
    pub(crate) fn encode(file: impl Into<String>, reason: impl ToString) -> ReportError {
        ReportError::Encode { file: file.into(), reason: reason.to_string() }
    }
}

/// Writes a file unless it is there with this content.
pub(crate) fn write_once(path: &Path, content: &[u8]) -> Result<(), ReportError> {
    if std::fs::read(path).is_ok_and(|found| found == content) {
        return Ok(());
    }
    write_file(path, content).map(|_| ())
}

/// Writes one file, whole or not at all: a temporary file in the same folder, renamed when complete. Makes the folder
/// if need be. Returns the path.
/// # Errors
/// [`ReportError::Write`] with the path and the cause.
pub fn write_file(path: &Path, content: &[u8]) -> Result<PathBuf, ReportError> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(|cause| ReportError::Write { path: folder.to_owned(), cause })?;
    // the process id keeps two runs into the same folder apart
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
            let _ = std::fs::remove_file(&part); // may not exist; the first cause is the one to tell
            Err(ReportError::Write { path: path.to_owned(), cause })
        }
    }
}

/// The name itself if it can name a file in a folder on any system.
pub(crate) fn file_name<'a>(name: &'a str, what: &'static str) -> Result<&'a str, ReportError> {
    let forbidden = |c: char| c.is_control() || "/\\:*?\"<>|".contains(c);
    if name.is_empty() || name.starts_with('.') || name.ends_with(['.', ' ']) || name.contains(forbidden) {
        return Err(ReportError::Name { name: name.to_owned(), what });
    }
    Ok(name)
}
