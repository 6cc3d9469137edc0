//! A results folder, whose files all belong to one run.
//!
//! The files of a run are written to a temporary subfolder. When all are complete, the files of
//! the earlier run move out and the new files move in. If a move fails, the earlier files move
//! back. Files that no run wrote stay unchanged.
//!
//! `record.json` moves out first and moves in last. While it exists, the files that it lists
//! all come from one run. An interrupted run does not replace a complete run: its results go to
//! `NAME.interrupted`.

use crate::output::result_file::{File, ReportError, file_name};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// File name of the record of a run.
pub(crate) const RECORD: &str = "record.json";

/// Files that every run may write in addition to its tables, even if no record lists them.
const ALWAYS_OWNED: [&str; 4] = [RECORD, "figure.svg", "figure.png", "figure.html"];

/// Suffix of the folder for an interrupted run when the folder `NAME` holds a complete run.
const INTERRUPTED_SUFFIX: &str = "interrupted";

/// Returns the folder for the results of a run.
///
/// The folder is `out/NAME`, or `out/NAME.interrupted` if this run was interrupted and
/// `out/NAME` holds a complete run.
pub(crate) fn run_folder(out: &Path, name: &str, interrupted: bool) -> PathBuf {
    let folder = out.join(name);
    if interrupted && holds_whole_run(&folder) { out.join(format!("{name}.{INTERRUPTED_SUFFIX}")) } else { folder }
}

/// Returns `true` if the folder holds the results of an interrupted run.
pub(crate) fn holds_interrupted_run(folder: &Path) -> bool {
    record(folder).is_some_and(|record| record["interrupted"] == Value::Bool(true))
}

/// Returns `true` if the folder holds the results of a complete run.
fn holds_whole_run(folder: &Path) -> bool {
    match record(folder) {
        Some(record) => record["interrupted"] != Value::Bool(true),
        None => ALWAYS_OWNED.iter().any(|name| folder.join(name).is_file()),
    }
}

fn record(folder: &Path) -> Option<Value> {
    serde_json::from_slice(&fs::read(folder.join(RECORD)).ok()?).ok()
}

/// Returns the names of the files in the folder that an earlier run wrote.
fn written_before(folder: &Path) -> BTreeSet<String> {
    let record = record(folder).unwrap_or_default();
    let files = record["files"].as_array().into_iter().flatten().filter_map(Value::as_str);
    let tables = record["tables"].as_array().into_iter().flatten().filter_map(|table| table["file"].as_str());
    let names = files.chain(tables).chain(ALWAYS_OWNED).filter(|name| file_name(name, "result").is_ok());
    names.filter(|name| folder.join(name).is_file()).map(str::to_owned).collect()
}

/// Writes the files of a run into `folder` in place of those of an earlier run, all or none.
///
/// Returns the paths of the files.
///
/// # Errors
/// [`ReportError`] names the file and the cause. The content of the folder is then as before.
pub(crate) fn replace(folder: &Path, files: &[File]) -> Result<Vec<PathBuf>, ReportError> {
    Staging::new(staging_folder(folder)).replace(folder, files)
}

/// Replaces only these files of a run; its other files stay.
///
/// # Errors
/// See [`replace`].
pub(crate) fn replace_some(folder: &Path, files: &[File]) -> Result<Vec<PathBuf>, ReportError> {
    commit(folder, files, Staging::new(staging_folder(folder)), &BTreeSet::new)
}

/// Returns the temporary folder for new files. The process id separates two runs that write
/// into the same folder.
fn staging_folder(folder: &Path) -> PathBuf {
    folder.join(format!(".{}.part", std::process::id()))
}

/// Files written incrementally to a temporary folder on the file system of their destination.
#[derive(Debug)]
pub(crate) struct Staging {
    folder: PathBuf,
    written: Vec<(String, fs::File)>,
}

impl Staging {
    /// Uses `folder` as the temporary folder, which is created with the first file.
    pub fn new(folder: PathBuf) -> Staging {
        Staging { folder, written: Vec::new() }
    }

    fn new_files(&self) -> PathBuf {
        self.folder.join("new")
    }

    /// Begins a file.
    ///
    /// # Errors
    /// [`ReportError`] gives the reason why the file cannot be created.
    pub fn file(&mut self, name: &str) -> Result<fs::File, ReportError> {
        let path = self.new_files().join(file_name(name, "result")?);
        let failed = |cause| ReportError::Write { path: path.clone(), cause };
        fs::create_dir_all(self.new_files()).map_err(failed)?;
        let file = fs::File::create(&path).map_err(failed)?;
        self.written.push((name.to_owned(), file.try_clone().map_err(failed)?));
        Ok(file)
    }

    /// Moves these files and those begun here into `folder`, in place of the files of an
    /// earlier run.
    ///
    /// Either all files are replaced or none. The files begun here must be complete. Returns
    /// the paths, with those of the files begun here first.
    ///
    /// # Errors
    /// [`ReportError`] names the file and the cause. The content of the folder is then as
    /// before.
    pub fn replace(self, folder: &Path, files: &[File]) -> Result<Vec<PathBuf>, ReportError> {
        commit(folder, files, self, &|| written_before(folder))
    }

    /// Removes the files that were begun, because they are no longer needed.
    pub fn remove(self) {
        // A file that cannot be removed is not an error.
        let _ = fs::remove_dir_all(self.new_files());
        let _ = fs::remove_dir(&self.folder);
    }
}

fn commit(
    folder: &Path,
    files: &[File],
    staging: Staging,
    before: &dyn Fn() -> BTreeSet<String>,
) -> Result<Vec<PathBuf>, ReportError> {
    let mut names = BTreeSet::new();
    let begun = staging.written.iter().map(|(name, _)| name.as_str());
    for name in begun.chain(files.iter().map(|file| file.name.as_str())) {
        if !names.insert(file_name(name, "result")?) {
            return Err(ReportError::SameName(name.to_owned()));
        }
        let path = folder.join(name);
        if path.is_dir() {
            return Err(ReportError::Write { path, cause: std::io::ErrorKind::IsADirectory.into() });
        }
    }
    let names: Vec<&str> = staging
        .written
        .iter()
        .map(|(name, _)| name.as_str())
        .chain(files.iter().map(|file| file.name.as_str()))
        .collect();
    let fresh = !folder.exists();
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |cause| ReportError::Write { path, cause }
    };
    fs::create_dir_all(folder).map_err(failed(folder))?;
    let (new, old) = (staging.new_files(), staging.folder.join("old"));
    let done = [&new, &old]
        .into_iter()
        .try_for_each(|part| fs::create_dir_all(part).map_err(failed(folder)))
        .and_then(|()| files.iter().try_for_each(|file| write(&new.join(&file.name), file).map_err(failed(folder))))
        .and_then(|()| {
            let mut begun = staging.written.iter();
            begun.try_for_each(|(name, file)| file.sync_all().map_err(failed(&folder.join(name))))
        })
        .and_then(|()| swap(folder, &new, &old, &names, before()));
    // Only files of this run are removed. A file that cannot be removed is not an error.
    let _ = fs::remove_dir_all(&old);
    drop(names);
    staging.remove();
    if done.is_err() && fresh {
        let _ = fs::remove_dir(folder);
    }
    done
}

fn write(path: &Path, file: &File) -> std::io::Result<()> {
    let mut handle = fs::File::create(path)?;
    handle.write_all(&file.content)?;
    handle.sync_all()
}

/// Moves out the old files and those with the new names, then moves in the new files.
///
/// If a move fails, all moves are reversed.
fn swap(
    folder: &Path,
    new: &Path,
    old: &Path,
    files: &[&str],
    mut out: BTreeSet<String>,
) -> Result<Vec<PathBuf>, ReportError> {
    let record_last = |name: &&str| *name == RECORD;
    out.extend(files.iter().filter(|name| folder.join(name).is_file()).map(|name| (*name).to_owned()));
    let mut out: Vec<String> = out.into_iter().collect();
    out.sort_by_key(|name| !record_last(&name.as_str()));
    let mut names: Vec<&str> = files.to_vec();
    names.sort_by_key(record_last);

    let mut moves: Vec<(PathBuf, PathBuf)> = Vec::new();
    let outward = out.iter().map(|name| (folder.join(name), old.join(name)));
    let inward = names.iter().map(|name| (new.join(name), folder.join(name)));
    for (from, to) in outward.chain(inward) {
        if let Err(cause) = fs::rename(&from, &to) {
            for (from, to) in moves.iter().rev() {
                let _ = fs::rename(to, from); // The first error is the one to report.
            }
            let path = if to.starts_with(old) { from } else { to };
            return Err(ReportError::Write { path, cause });
        }
        moves.push((from, to));
    }
    Ok(files.iter().map(|name| folder.join(name)).collect())
}

/// Checks that results can be written into `folder`, which need not exist. Leaves no files
/// behind.
///
/// # Errors
/// [`ReportError::Write`] with the path that prevents writing and the cause.
pub fn check_writable(folder: &Path) -> Result<(), ReportError> {
    let mut there = folder;
    while !there.exists() {
        there = match there.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
    }
    let refuse = |path: &Path, cause| Err(ReportError::Write { path: path.to_owned(), cause });
    if !there.is_dir() {
        return refuse(there, std::io::ErrorKind::NotADirectory.into());
    }
    let probe = there.join(format!(".{}.probe", std::process::id()));
    match fs::File::create(&probe).and_then(|_| fs::remove_file(&probe)) {
        Ok(()) => Ok(()),
        Err(cause) => refuse(folder, cause),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::{Outputs, write_dataset};
    use crate::samples;
    use stickslip_study::dataset::Dataset;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn only(names: &[&str]) -> Outputs {
        Outputs::select(names).unwrap()
    }

    #[test]
    fn a_run_replaces_the_results_of_another_and_nothing_else() {
        let out = tempfile::tempdir().unwrap();
        write_dataset(&samples::response(), out.path(), &Outputs::all()).unwrap();
        let folder = out.path().join("fig06");
        fs::write(folder.join("notes.txt"), "mine").unwrap();
        // A study of another kind with the same name writes only tables. No figure or table of
        // the first stays.
        let other = Dataset { name: "fig06".into(), ..samples::hysteresis() };
        write_dataset(&other, out.path(), &only(&["csv"])).unwrap();
        assert_eq!(names(&folder), ["loops_summary.csv", "notes.txt", "record.json"]);
        assert_eq!(fs::read_to_string(folder.join("notes.txt")).unwrap(), "mine");
        let files = &record(&folder).unwrap()["files"];
        assert_eq!(*files, serde_json::json!(["loops_summary.csv", "record.json"]));
        // A record that names files in other folders does not affect them.
        fs::write(folder.join(RECORD), r#"{"files": ["../fig06/notes.txt", "..", "/etc/passwd", ""]}"#).unwrap();
        assert!(written_before(&folder).iter().all(|name| name == RECORD));
    }

    #[test]
    fn an_interrupted_run_does_not_replace_a_whole_one() {
        let out = tempfile::tempdir().unwrap();
        let whole = samples::response();
        let mut cut = samples::response();
        cut.record.interrupted = true;
        let folder_of = |dataset: &Dataset| {
            let files = write_dataset(dataset, out.path(), &only(&["csv"])).unwrap();
            files[0].parent().unwrap().file_name().unwrap().to_str().unwrap().to_owned()
        };
        assert_eq!(folder_of(&cut), "fig06", "nothing to destroy");
        assert_eq!(folder_of(&cut), "fig06", "nor here");
        assert!(holds_interrupted_run(&out.path().join("fig06")));
        assert_eq!(folder_of(&whole), "fig06");
        assert!(!holds_interrupted_run(&out.path().join("fig06")));
        let before = fs::read(out.path().join("fig06").join(RECORD)).unwrap();
        assert_eq!(folder_of(&cut), "fig06.interrupted");
        assert_eq!(fs::read(out.path().join("fig06").join(RECORD)).unwrap(), before);
    }

    #[test]
    fn a_failure_leaves_everything_as_it_was() {
        let out = tempfile::tempdir().unwrap();
        let folder = out.path().join("run");
        let file = |name: &str, text: &str| File::new(name, text);
        replace(&folder, &[file(RECORD, r#"{"files": ["a.csv"]}"#), file("a.csv", "old")]).unwrap();
        fs::create_dir(folder.join("b.csv")).unwrap();
        let error = replace(&folder, &[file("a.csv", "new"), file("b.csv", "new")]).unwrap_err().to_string();
        assert!(error.contains("b.csv"), "{error}");
        assert_eq!(names(&folder), ["a.csv", "b.csv", RECORD]);
        assert_eq!(fs::read_to_string(folder.join("a.csv")).unwrap(), "old");
        // The failure happens in the middle of the moves: only then is the third name taken.
        let new = out.path().join("new");
        let old = out.path().join("old");
        fs::create_dir_all(&new).unwrap();
        fs::create_dir_all(&old).unwrap();
        fs::write(new.join("a.csv"), "new").unwrap();
        // The second file was not written.
        assert!(swap(&folder, &new, &old, &["a.csv", "c.csv"], written_before(&folder)).is_err());
        assert_eq!(names(&folder), ["a.csv", "b.csv", RECORD]);
        assert_eq!(fs::read_to_string(folder.join("a.csv")).unwrap(), "old");
        assert!(replace(&folder, &[file("x.csv", ""), file("x.csv", "")]).is_err());
    }

    #[test]
    fn a_folder_that_cannot_be_is_found_without_writing() {
        let out = tempfile::tempdir().unwrap();
        check_writable(&out.path().join("a/b/c")).unwrap();
        assert!(names(out.path()).is_empty());
        let file = out.path().join("file");
        fs::write(&file, "").unwrap();
        let error = check_writable(&file.join("deeper")).unwrap_err().to_string();
        assert!(error.contains(file.to_str().unwrap()), "{error}");
    }
}
