//! The table of outputs, and the function that writes all files of a study or none.
//!
//! - `result_file`: a file of results, an output, and the errors of writing.
//! - `folder`: replaces the results of a run completely or not at all.
//! - `csv`, `parquet`, `json`, `fitted`, `vtk`, `motion`: one output each; figures are in `figure`.

pub mod csv;
pub mod fitted;
pub mod folder;
pub mod json;
pub mod motion;
pub mod parquet;
pub mod result_file;
pub mod vtk;

use json::{TableShape, record_json};
use result_file::{File, Output, ReportError, file_name, write_if_changed};
use std::path::{Path, PathBuf};
use stickslip_study::dataset::Dataset;

/// All outputs, in the order in which they are written.
pub static TABLE: &[Output] = &[
    csv::OUTPUT,
    parquet::OUTPUT,
    json::OUTPUT,
    fitted::OUTPUT,
    vtk::OUTPUT,
    motion::OUTPUT,
    crate::figure::svg::OUTPUT,
    crate::figure::png::OUTPUT,
    crate::figure::html::OUTPUT,
];

/// Names of the outputs that are figures.
pub(crate) const FIGURES: [&str; 3] =
    [crate::figure::svg::OUTPUT.name, crate::figure::png::OUTPUT.name, crate::figure::html::OUTPUT.name];

/// A selection of outputs to write.
#[derive(Debug, Clone)]
pub struct Outputs(Vec<&'static Output>);

impl Default for Outputs {
    fn default() -> Outputs {
        Outputs::defaults()
    }
}

impl Outputs {
    /// Selects every output of [`TABLE`].
    pub fn all() -> Outputs {
        Outputs(TABLE.iter().collect())
    }

    /// Selects the default outputs.
    pub fn defaults() -> Outputs {
        Outputs(TABLE.iter().filter(|output| output.is_default).collect())
    }

    /// Returns these outputs together with `others`.
    #[must_use]
    pub fn union(&self, others: &Outputs) -> Outputs {
        let is_in = |outputs: &Outputs, output: &Output| outputs.iter().any(|known| known.name == output.name);
        Outputs(TABLE.iter().filter(|output| is_in(self, output) || is_in(others, output)).collect())
    }

    /// Selects the outputs with these names, in the order of [`TABLE`].
    /// # Errors
    /// [`ReportError::UnknownOutput`] for a name that is not in [`TABLE`].
    pub fn select<S: AsRef<str>>(names: &[S]) -> Result<Outputs, ReportError> {
        if let Some(unknown) = names.iter().map(S::as_ref).find(|name| TABLE.iter().all(|output| output.name != *name))
        {
            return Err(ReportError::UnknownOutput { name: unknown.to_owned(), known: known() });
        }
        Ok(Outputs(TABLE.iter().filter(|output| names.iter().any(|name| name.as_ref() == output.name)).collect()))
    }

    /// Iterates over the selected outputs.
    pub fn iter(&self) -> impl Iterator<Item = &'static Output> + '_ {
        self.0.iter().copied()
    }
}

fn known() -> String {
    TABLE.iter().map(|output| output.name).collect::<Vec<_>>().join(", ")
}

/// Writes the selected outputs of a dataset into `out/NAME/`.
///
/// Returns the paths of the written files, in the order of the outputs. Files that several
/// studies share go into `out`, unless they already exist there. Shared files are not results,
/// and the returned paths do not contain them.
///
/// The new files replace all files of an earlier run, or none of them. Files that no run wrote
/// stay. The record is always written, because it lists the files of the run. If `out/NAME/`
/// holds the results of a complete run, an interrupted run writes to `out/NAME.interrupted/`.
/// # Errors
/// [`ReportError`] names the file and the cause. The earlier files then stay.
pub fn write_dataset(dataset: &Dataset, out: &Path, outputs: &Outputs) -> Result<Vec<PathBuf>, ReportError> {
    let name = file_name(&dataset.name, "study")?;
    let mut files = Vec::new();
    for output in outputs.iter() {
        files.extend((output.make)(dataset)?);
    }
    let shapes: Vec<TableShape> = dataset.tables.iter().map(TableShape::of).collect();
    let files = with_record(dataset, &shapes, out, &[], files)?;
    folder::replace(&folder::run_folder(out, name, dataset.record.interrupted), &files)
}

/// Writes the files that studies share, and returns the other files of the run with the record.
///
/// The record lists the returned files and those in `begun`, which are already on disk.
pub(crate) fn with_record(
    dataset: &Dataset,
    shapes: &[TableShape],
    out: &Path,
    begun: &[String],
    files: Vec<File>,
) -> Result<Vec<File>, ReportError> {
    let (shared, mut files): (Vec<File>, Vec<File>) = files.into_iter().partition(|file| file.shared);
    if files.iter().all(|file| file.name != folder::RECORD) {
        files.push(File::new(folder::RECORD, Vec::new()));
    }
    let names: Vec<String> = begun.iter().cloned().chain(files.iter().map(|file| file.name.clone())).collect();
    for file in files.iter_mut().filter(|file| file.name == folder::RECORD) {
        file.content = record_json(dataset, shapes, &names)?.into_bytes();
    }
    // Shared files come first: a page must not appear before its script.
    for file in &shared {
        write_if_changed(&out.join(file_name(&file.name, "result")?), &file.content)?;
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;
    use result_file::write_file;

    #[test]
    fn writes_every_file_whole_and_leaves_nothing_else() {
        let out = tempfile::tempdir().unwrap();
        let files = write_dataset(&samples::response(), out.path(), &Outputs::all()).unwrap();
        let mut names: Vec<_> = files.iter().map(|f| f.file_name().unwrap().to_str().unwrap().to_owned()).collect();
        let expected = [
            "curve.csv",
            "peaks.csv",
            "curve.parquet",
            "peaks.parquet",
            "record.json",
            "figure.svg",
            "figure.png",
            "figure.html",
        ];
        assert_eq!(names, expected);
        let usual = Outputs::defaults();
        assert!(usual.iter().all(|output| output.name != "parquet") && usual.iter().count() == TABLE.len() - 1);
        assert_eq!(usual.union(&Outputs::select(&["parquet"]).unwrap()).iter().count(), TABLE.len());
        let folder = out.path().join("fig06");
        let mut found: Vec<_> =
            std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        found.sort();
        assert_eq!(found, names);
        // The script of the interactive figure is next to the study's folder, and is written
        // once.
        let script = out.path().join(crate::figure::html::script_name());
        let written = std::fs::metadata(&script).unwrap().modified().unwrap();
        write_dataset(&samples::hysteresis(), out.path(), &Outputs::all()).unwrap();
        assert_eq!(std::fs::metadata(&script).unwrap().modified().unwrap(), written);
        assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 3);
        // A damaged script is written again.
        std::fs::write(&script, "half a scr").unwrap();
        write_dataset(&samples::response(), out.path(), &Outputs::select(&["html"]).unwrap()).unwrap();
        assert_eq!(std::fs::read_to_string(&script).unwrap(), crate::figure::html::script());
        // A second run replaces the files.
        write_dataset(&samples::response(), out.path(), &Outputs::select(&["csv"]).unwrap()).unwrap();
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
        // A folder already has this name.
        assert!(write_file(&out.path().join("target"), b"x").is_err());
        // The third entry is the script, which is written first.
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
        let error = Outputs::select(&["svg", "pdf"]).unwrap_err().to_string();
        assert!(error.contains("`pdf`") && error.contains("svg") && error.contains("html"), "{error}");
        assert_eq!(
            Outputs::select(&["png", "csv"]).unwrap().iter().map(|o| o.name).collect::<Vec<_>>(),
            ["csv", "png"]
        );
    }
}
