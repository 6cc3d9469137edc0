//! The table of outputs, and how their files reach the disk: whole or not at all.

use crate::folder;
use std::io::Write;
use std::path::{Path, PathBuf};
use stickslip_study::dataset::Dataset;

/// One kind of output: what it is called and how its files are made.
#[derive(Debug)]
pub struct Output {
    /// Name, for flags and lists.
    pub name: &'static str,
    /// What it writes, in one line.
    pub summary: &'static str,
    /// Makes the files: name inside the study's folder, and content.
    pub make: fn(&Dataset) -> Result<Vec<File>, ReportError>,
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

/// All outputs, in the order in which they are written.
pub static TABLE: &[Output] =
    &[crate::csv::OUTPUT, crate::json::OUTPUT, crate::svg::OUTPUT, crate::png::OUTPUT, crate::html::OUTPUT];

/// Which outputs to write.
#[derive(Debug, Clone)]
pub struct Outputs(Vec<&'static Output>);

impl Default for Outputs {
    fn default() -> Outputs {
        Outputs::all()
    }
}

impl Outputs {
    /// Every output of [`TABLE`].
    pub fn all() -> Outputs {
        Outputs(TABLE.iter().collect())
    }

    /// The outputs of these names, in the order of [`TABLE`].
    /// # Errors
    /// [`ReportError::UnknownOutput`] for a name that is not in [`TABLE`].
    pub fn only<S: AsRef<str>>(names: &[S]) -> Result<Outputs, ReportError> {
        if let Some(unknown) = names.iter().map(S::as_ref).find(|name| TABLE.iter().all(|output| output.name != *name))
        {
            return Err(ReportError::UnknownOutput { name: unknown.to_owned(), known: known() });
        }
        Ok(Outputs(TABLE.iter().filter(|output| names.iter().any(|name| name.as_ref() == output.name)).collect()))
    }

    /// The chosen outputs.
    pub fn iter(&self) -> impl Iterator<Item = &'static Output> + '_ {
        self.0.iter().copied()
    }
}

fn known() -> String {
    TABLE.iter().map(|output| output.name).collect::<Vec<_>>().join(", ")
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

/// Writes the chosen outputs of a dataset into `out/NAME/` and returns the paths of the files, in that order. Files that
/// studies share go into `out`, unless they are there already, and are not among the paths: they are no results.
///
/// The files replace those of an earlier run there, all or none; files that no run wrote stay. The record is always among them: it lists what
/// belongs to the run. The results of an interrupted run go to `out/NAME.interrupted/` where `out/NAME/` holds a whole one.
/// # Errors
/// [`ReportError`] says which file and why; what was there before stays.
pub fn write_dataset(dataset: &Dataset, out: &Path, outputs: &Outputs) -> Result<Vec<PathBuf>, ReportError> {
    let name = file_name(&dataset.name, "study")?;
    let mut files = Vec::new();
    for output in outputs.iter() {
        files.extend((output.make)(dataset)?);
    }
    let (shared, mut files): (Vec<File>, Vec<File>) = files.into_iter().partition(|file| file.shared);
    if files.iter().all(|file| file.name != folder::RECORD) {
        files.push(File::new(folder::RECORD, Vec::new()));
    }
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    for file in files.iter_mut().filter(|file| file.name == folder::RECORD) {
        file.content = crate::json::to_json(dataset, &names)?.into_bytes();
    }
    // shared files first: a page must not appear before what it needs
    for file in &shared {
        write_once(&out.join(file_name(&file.name, "result")?), &file.content)?;
    }
    folder::replace(&folder::of_run(out, name, dataset.record.interrupted), &files)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn writes_every_file_whole_and_leaves_nothing_else() {
        let out = tempfile::tempdir().unwrap();
        let files = write_dataset(&samples::response(), out.path(), &Outputs::all()).unwrap();
        let mut names: Vec<_> = files.iter().map(|f| f.file_name().unwrap().to_str().unwrap().to_owned()).collect();
        assert_eq!(names, ["curve.csv", "peaks.csv", "record.json", "figure.svg", "figure.png", "figure.html"]);
        let folder = out.path().join("fig06");
        let mut found: Vec<_> =
            std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        found.sort();
        assert_eq!(found, names);
        // the script of the interactive figure stands beside the folder, once
        let script = out.path().join(crate::html::script_name());
        let written = std::fs::metadata(&script).unwrap().modified().unwrap();
        write_dataset(&samples::hysteresis(), out.path(), &Outputs::all()).unwrap();
        assert_eq!(std::fs::metadata(&script).unwrap().modified().unwrap(), written);
        assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 3);
        // one that is broken is written anew
        std::fs::write(&script, "half a scr").unwrap();
        write_dataset(&samples::response(), out.path(), &Outputs::only(&["html"]).unwrap()).unwrap();
        assert_eq!(std::fs::read_to_string(&script).unwrap(), crate::html::script());
        // a second run replaces the files
        write_dataset(&samples::response(), out.path(), &Outputs::only(&["csv"]).unwrap()).unwrap();
    }

    #[test]
    fn the_same_dataset_gives_the_same_bytes() {
        for dataset in samples::all() {
            for output in TABLE {
                assert_eq!((output.make)(&dataset).unwrap(), (output.make)(&dataset).unwrap(), "{}", output.name);
            }
        }
    }

    #[test]
    fn errors_name_the_path_and_leave_no_part() {
        let out = tempfile::tempdir().unwrap();
        let taken = out.path().join("fig06");
        std::fs::write(&taken, "a file where the folder should be").unwrap();
        let error = write_dataset(&samples::response(), out.path(), &Outputs::all()).unwrap_err();
        assert!(error.to_string().contains(taken.to_str().unwrap()), "{error}");
        std::fs::create_dir(out.path().join("target")).unwrap();
        assert!(write_file(&out.path().join("target"), b"x").is_err()); // a folder has the name
        // and the script, which is written first
        assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 3);
    }

    #[test]
    fn names_stay_inside_the_folder() {
        let out = tempfile::tempdir().unwrap();
        for name in ["", "..", "../up", "a/b", ".hidden", "a\\b", "nul\0", "con:"] {
            let dataset = Dataset { name: name.into(), ..samples::response() };
            assert!(write_dataset(&dataset, out.path(), &Outputs::all()).is_err(), "{name:?}");
        }
        assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 0);
    }

    #[test]
    fn an_unknown_output_is_named_with_those_that_exist() {
        let error = Outputs::only(&["svg", "pdf"]).unwrap_err().to_string();
        assert!(error.contains("`pdf`") && error.contains("svg") && error.contains("html"), "{error}");
        assert_eq!(Outputs::only(&["png", "csv"]).unwrap().iter().map(|o| o.name).collect::<Vec<_>>(), ["csv", "png"]);
    }
}
