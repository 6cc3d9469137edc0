//! Compares several runs of one kind: their curves in one figure, and the differences of their
//! numbers.
//!
//! - Every run is compared with the first.
//! - Rows match if they have the same varied parameters, mass and joint.
//! - If the abscissae are equal, rows are compared one by one. Otherwise the later run is
//!   interpolated linearly to the abscissae of the first, and the table states this.
//! - A relative difference refers to the largest absolute value in that column of the first
//!   run, so that it stays finite at a zero of the curve.

mod column_roles;
mod differences;
mod labels;
mod overlay;
mod row_matching;
mod table;

pub use table::for_terminal;

use crate::output::result_file::{ReportError, file_name};
use crate::output::{Outputs, write_dataset};
use crate::run::stored::{COMPARISON, Stored, StoredError};
use differences::{Differences, LabelledRun};
use labels::{folder_name, labels};
use overlay::overlay;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use stickslip_study::dataset::{Dataset, Figure, Record};

/// Reason why runs cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// Only one run was given.
    #[error("a comparison needs at least two runs: give the folder of each")]
    Single,
    /// The runs have different kinds.
    #[error("{} contains results of the kind `{kind}`, {} of the kind `{other_kind}`; only runs of one kind can be compared", folder.display(), other.display())]
    Kinds {
        /// Folder of the first run.
        folder: PathBuf,
        /// Kind of the first run.
        kind: String,
        /// Folder of the other run.
        other: PathBuf,
        /// Kind of the other run.
        other_kind: String,
    },
}

/// Returns the runs in one figure, with tables of their differences.
///
/// The table `differences` has the largest difference in every column. Peaks and optima are
/// also compared one by one.
///
/// # Errors
/// [`CompareError`] if there is only one run or if the kinds differ.
pub fn compare(runs: &[Stored]) -> Result<Dataset, CompareError> {
    let [first, others @ ..] = runs else { return Err(CompareError::Single) };
    if others.is_empty() {
        return Err(CompareError::Single);
    }
    if let Some(other) = others.iter().find(|run| run.dataset.kind != first.dataset.kind) {
        return Err(CompareError::Kinds {
            folder: first.folder.clone(),
            kind: first.dataset.kind.clone(),
            other: other.folder.clone(),
            other_kind: other.dataset.kind.clone(),
        });
    }
    let labels = labels(runs);
    let mut notes = vec![format!(
        "Every run is compared with {}. Relative differences refer to the largest absolute value of the column \
         in that run.",
        labels[0]
    )];
    for (run, label) in runs.iter().zip(&labels).filter(|(run, _)| run.dataset.record.interrupted) {
        notes.push(format!("{label}: the run in {} was interrupted.", run.folder.display()));
    }
    let mut differences = Differences::default();
    for (run, label) in others.iter().zip(&labels[1..]) {
        differences.add(LabelledRun { run: first, label: &labels[0] }, LabelledRun { run, label });
    }
    notes.append(&mut differences.notes);
    let titles: BTreeSet<&str> = runs.iter().map(|run| run.dataset.title.as_str()).collect();
    let title =
        if titles.len() == 1 { first.dataset.title.clone() } else { format!("Comparison of {} runs", runs.len()) };
    let figures: Vec<(&str, &Figure)> =
        labels.iter().map(String::as_str).zip(runs.iter().map(|run| &run.dataset.figure)).collect();
    let joined = overlay(&figures);
    let named = [title.as_str(), &joined.title];
    let figure_title = named.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" – ");
    let figure = Figure { title: figure_title, ..joined };
    let about = runs.iter().zip(&labels).map(|(run, label)| {
        serde_json::json!({
            "folder": run.folder.display().to_string(),
            "label": label,
            "version": run.dataset.record.version,
            "methods": run.dataset.record.methods,
            "interrupted": run.dataset.record.interrupted,
        })
    });
    Ok(Dataset {
        mesh: None,
        name: name(runs),
        title,
        source: None,
        kind: COMPARISON.to_owned(),
        tables: differences.tables(),
        figure,
        notes,
        failures: Vec::new(),
        record: Record {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            study: serde_json::json!({ "runs": about.collect::<Vec<_>>() }),
            threads: 1,
            ..Record::default()
        },
    })
}
/// Writes a comparison into `out/NAME/`, which must be absent or hold a comparison.
///
/// # Errors
/// [`ReportError`] if the folder holds a run or a file cannot be written.
pub fn write(comparison: &Dataset, out: &Path, outputs: &Outputs) -> Result<Vec<PathBuf>, ReportError> {
    let folder = out.join(file_name(&comparison.name, "comparison")?);
    match crate::run::stored::read(&folder) {
        // Unreadable results may still be a run.
        Err(StoredError::NoRecord { .. } | StoredError::Comparison { .. }) => write_dataset(comparison, out, outputs),
        _ => Err(ReportError::Write {
            path: folder,
            cause: std::io::Error::other("the folder contains the results of a run; choose another --out"),
        }),
    }
}

/// Joins the names of the folders.
fn name(runs: &[Stored]) -> String {
    // Maximum number of run names in the name of a comparison. Further runs are counted.
    let most_names = 2;
    let mut names: Vec<String> = runs.iter().take(most_names).map(|run| folder_name(&run.folder)).collect();
    if runs.len() > most_names {
        names.push(format!("{} more", runs.len() - most_names));
    }
    names.join("+")
}
