//! Reads the results of a run from their folder and draws their figure again.
//!
//! Tables hold numbers with all digits, so the values read are bit for bit the computed ones. A
//! table that does not match its record was changed by hand. It gives an error with file and
//! line.

use crate::output::folder::{self, RECORD};
use crate::output::result_file::{File, ReportError, file_name, write_if_changed};
use crate::output::{FIGURES, Outputs};
use serde_json::Value;
use std::path::{Path, PathBuf};
use stickslip_study::dataset::{CellValues, Column, Dataset, Record, Table};
use stickslip_study::{Study, StudyError, read_for_results, run};

/// Kind of a dataset that compares runs. Such a dataset has no study.
pub const COMPARISON: &str = "comparison";

/// The results of one run.
#[derive(Debug, Clone)]
pub struct Stored {
    /// Folder of the results.
    pub folder: PathBuf,
    /// The study, read again from the record.
    pub study: Study,
    /// The results, with a newly drawn figure.
    pub dataset: Dataset,
    /// The record in the folder.
    record: Value,
}

/// Reason why results cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum StoredError {
    /// The folder has no record.
    #[error("no results in {}: the folder has no record.json{}", folder.display(), list_folders(.inside))]
    NoRecord {
        /// The folder.
        folder: PathBuf,
        /// Folders inside it that have results.
        inside: Vec<PathBuf>,
    },
    /// The folder holds a comparison, which has no study that could draw it.
    #[error("{} contains a comparison, which cannot be drawn again: give the folders of the compared \
             runs", folder.display())]
    Comparison {
        /// The folder.
        folder: PathBuf,
    },
    /// A file cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        cause: std::io::Error,
    },
    /// The record is not valid.
    #[error("{}: {reason}", path.display())]
    Record {
        /// Path of the record.
        path: PathBuf,
        /// Description of the error.
        reason: String,
    },
    /// The file of a table in the record does not exist.
    #[error("cannot find {}, which the figure needs: {reason}", path.display())]
    NoTable {
        /// Path of the table.
        path: PathBuf,
        /// The cause, and the remedy.
        reason: &'static str,
    },
    /// A table does not match its record.
    #[error("{}, line {line}: {reason}; the file was changed after the run: run the study again", path.display())]
    Table {
        /// Path of the table.
        path: PathBuf,
        /// Line number, from 1.
        line: u64,
        /// Description of the error.
        reason: String,
    },
    /// The study in the record cannot be read.
    #[error("{}: cannot read the study in this record: {cause}", path.display())]
    Study {
        /// Path of the record.
        path: PathBuf,
        /// Error in the study.
        cause: Box<StudyError>,
    },
}

fn list_folders(inside: &[PathBuf]) -> String {
    let names: Vec<String> = inside.iter().map(|folder| folder.display().to_string()).collect();
    if names.is_empty() {
        String::new()
    } else {
        format!("; these folders inside it have results: {}", names.join(", "))
    }
}

/// Reads the results in `folder`.
///
/// # Errors
/// [`StoredError`] if there are no results, if a newer version wrote them, or if a table does
/// not match its record.
pub fn read(folder: &Path) -> Result<Stored, StoredError> {
    let path = folder.join(RECORD);
    if !path.is_file() {
        let mut inside: Vec<PathBuf> = std::fs::read_dir(folder)
            .map(|entries| entries.flatten().map(|entry| entry.path()).filter(|p| p.join(RECORD).is_file()).collect())
            .unwrap_or_default();
        inside.sort();
        // Maximum number of subfolders with results that an error message names.
        inside.truncate(5);
        return Err(StoredError::NoRecord { folder: folder.to_owned(), inside });
    }
    let wrong = |reason: String| StoredError::Record { path: path.clone(), reason };
    let bytes = std::fs::read(&path).map_err(|cause| StoredError::Read { path: path.clone(), cause })?;
    let record: Value = serde_json::from_slice(&bytes)
        .map_err(|error| wrong(format!("this file is not the record of a run: {error}")))?;
    let text = |value: &Value, key: &str| {
        value[key]
            .as_str()
            .map(str::to_owned)
            .ok_or_else(|| wrong(format!("this file is not the record of a run: the text `{key}` is missing")))
    };
    let version = text(&record, "version")?;
    let newer = version_numbers(&version) > version_numbers(env!("CARGO_PKG_VERSION"));
    let schema = record["study"]["schema"].as_i64();
    if newer || schema.is_some_and(|schema| schema > stickslip_study::schema::VERSION) {
        let own = env!("CARGO_PKG_VERSION");
        return Err(wrong(format!(
            "the results were written by version {version}, which is newer than this version ({own}): install \
             the newer version"
        )));
    }
    let kind = text(&record, "kind")?;
    if kind == COMPARISON {
        return Err(StoredError::Comparison { folder: folder.to_owned() });
    }
    let study = study_of(&record["study"], &path)?;
    if study.kind().name != kind {
        return Err(wrong(format!(
            "the record states the kind `{kind}`, but its study has the kind `{}`",
            study.kind().name
        )));
    }
    let entries = record["tables"].as_array().ok_or_else(|| wrong("the record lists no tables".to_owned()))?;
    let tables = entries.iter().map(|entry| table(folder, entry, &record, &wrong)).collect::<Result<Vec<_>, _>>()?;
    let part = |key: &str| record[key].clone();
    let dataset = Dataset {
        mesh: None,
        name: text(&record, "name")?,
        title: study.title().to_owned(),
        source: record["source"].as_str().map(str::to_owned),
        kind,
        figure: run::figure_of_tables(&study, &tables),
        tables,
        notes: serde_json::from_value(part("notes")).unwrap_or_default(),
        failures: serde_json::from_value(part("failures")).unwrap_or_default(),
        record: Record {
            version,
            study: part("study"),
            methods: serde_json::from_value(part("methods")).unwrap_or_default(),
            seed: record["seed"].as_u64(),
            threads: record["threads"].as_u64().unwrap_or(0) as usize,
            wall_time_s: record["wall_time_s"].as_f64().unwrap_or(0.0),
            points: serde_json::from_value(part("points")).unwrap_or_default(),
            interrupted: record["interrupted"] == Value::Bool(true),
        },
    };
    Ok(Stored { folder: folder.to_owned(), study, dataset, record })
}

/// Splits a version into numbers for comparison.
fn version_numbers(version: &str) -> Vec<u64> {
    let release = version.split(['-', '+']).next().unwrap_or(version);
    release.split('.').map(|part| part.parse().unwrap_or(0)).collect()
}

/// Reads the study of a record: its text, its overrides and the method set on the command line.
///
/// `path` is the path of the record, for error messages.
///
/// # Errors
/// [`StoredError`] if the record has no study or the study cannot be read.
pub fn study_of(stored: &Value, path: &Path) -> Result<Study, StoredError> {
    let wrong = |reason: &str| StoredError::Record { path: path.to_owned(), reason: reason.to_owned() };
    let (Some(name), Some(text)) = (stored["name"].as_str(), stored["file"].as_str()) else {
        return Err(wrong("the record contains no study"));
    };
    let set: Vec<(String, String)> = serde_json::from_value(stored["set"].clone()).unwrap_or_default();
    let failed = |cause| StoredError::Study { path: path.to_owned(), cause: Box::new(cause) };
    let study = read_for_results(&format!("{name}.toml"), text, &set).map_err(failed)?;
    match stored["cases"][0]["method"]["kind"].as_str() {
        Some(method) => study.with_method(method).map_err(failed),
        None => Ok(study),
    }
}

/// Reads one table and compares it with the record.
fn table(
    folder: &Path,
    entry: &Value,
    record: &Value,
    wrong: &dyn Fn(String) -> StoredError,
) -> Result<Table, StoredError> {
    let file = entry["file"].as_str().unwrap_or_default();
    let Some(name) = file_name(file, "table").ok().and_then(|file| file.strip_suffix(".csv")) else {
        return Err(wrong(format!("`{file}` is not the file name of a table")));
    };
    let names: Vec<String> = serde_json::from_value(entry["columns"].clone()).unwrap_or_default();
    let sorts: Vec<String> = serde_json::from_value(entry["values"].clone()).unwrap_or_default();
    let (Some(rows), false, true) = (entry["rows"].as_u64(), names.is_empty(), sorts.len() == names.len()) else {
        return Err(wrong(format!(
            "the record does not describe the columns of {file}; run the study again with this version"
        )));
    };
    let path = folder.join(file);
    if !path.is_file() {
        let written = record["files"].as_array().is_some_and(|files| files.iter().any(|name| name == file));
        let reason = match written {
            true => "the file was removed after the run; run the study again",
            false => "the run did not write csv files; run it again with `csv` among its outputs",
        };
        return Err(StoredError::NoTable { path, reason });
    }
    let bytes = std::fs::read(&path).map_err(|cause| StoredError::Read { path: path.clone(), cause })?;
    let failed = |line: u64, reason: String| StoredError::Table { path: path.clone(), line, reason };
    let mut columns = names
        .iter()
        .zip(&sorts)
        .map(|(name, sort)| Some(Column { name: name.clone(), values: empty(sort)? }))
        .collect::<Option<Vec<_>>>()
        .ok_or_else(|| {
            wrong(format!("the record does not describe the columns of {file}; run the study again with this version"))
        })?;
    let mut reader = ::csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(bytes.as_slice());
    let mut line = 1;
    let mut found = 0;
    for (number, cells) in reader.records().enumerate() {
        let cells = cells.map_err(|error| {
            let at = error.position().map_or(line, ::csv::Position::line);
            failed(at, "this line is not valid CSV in UTF-8".to_owned())
        })?;
        line = cells.position().map_or(line, ::csv::Position::line);
        if number == 0 {
            header(&names, &cells).map_err(|reason| failed(line, reason))?;
            continue;
        }
        if cells.len() != columns.len() {
            return Err(failed(line, format!("{} cells, expected {}", cells.len(), columns.len())));
        }
        for (column, cell) in columns.iter_mut().zip(&cells) {
            push(&mut column.values, cell)
                .map_err(|what| failed(line, format!("`{cell}` in the column `{}` is not {what}", column.name)))?;
        }
        found += 1;
    }
    if found != rows {
        return Err(failed(line, format!("the table has {found} rows, but the record states {rows}")));
    }
    Ok(Table { name: name.to_owned(), columns })
}

/// Compares the header of a table with the record. The error describes the difference.
fn header(names: &[String], cells: &::csv::StringRecord) -> Result<(), String> {
    if let Some((i, (cell, name))) = cells.iter().zip(names).enumerate().find(|(_, (cell, name))| cell != name) {
        return Err(format!("column {} is `{cell}`, but the record states `{name}`", i + 1));
    }
    if cells.len() != names.len() {
        return Err(format!("{} columns, but the record states {}", cells.len(), names.len()));
    }
    Ok(())
}

fn empty(sort: &str) -> Option<CellValues> {
    Some(match sort {
        "number" => CellValues::Number(Vec::new()),
        "integer" => CellValues::Integer(Vec::new()),
        "text" => CellValues::Text(Vec::new()),
        "flag" => CellValues::Flag(Vec::new()),
        _ => return None,
    })
}

/// Adds a cell, or returns the name of the expected type.
fn push(values: &mut CellValues, cell: &str) -> Result<(), &'static str> {
    match values {
        CellValues::Number(v) if cell.is_empty() => v.push(f64::NAN),
        CellValues::Number(v) => v.push(cell.parse().map_err(|_| "a number")?),
        CellValues::Integer(v) => v.push(cell.parse().map_err(|_| "a count")?),
        CellValues::Text(v) => v.push(cell.to_owned()),
        CellValues::Flag(v) => v.push(match cell {
            "" => None,
            "true" => Some(true),
            "false" => Some(false),
            _ => return Err("`true` or `false`"),
        }),
    }
    Ok(())
}

impl Stored {
    /// Replaces the figure in the folder and returns the figure's files.
    ///
    /// The tables stay. The record then lists the figure's files as well.
    ///
    /// # Errors
    /// [`ReportError`] names the file and the cause. The earlier files then stay.
    pub fn write_figure(&self, outputs: &Outputs) -> Result<Vec<PathBuf>, ReportError> {
        let mut files = Vec::new();
        for output in outputs.iter().filter(|output| FIGURES.contains(&output.name)) {
            files.extend((output.make)(&self.dataset)?);
        }
        let (shared, mut files): (Vec<File>, Vec<File>) = files.into_iter().partition(|file| file.shared);
        let mut record = self.record.clone();
        if let Some(listed) = record["files"].as_array_mut() {
            for file in &files {
                let name = Value::from(file.name.as_str());
                if !listed.contains(&name) {
                    listed.push(name);
                }
            }
        }
        let text = serde_json::to_string_pretty(&record).map_err(|e| ReportError::encode(RECORD, e))?;
        files.push(File::new(RECORD, text + "\n"));
        let above = match self.folder.parent() {
            // A path without a file name, such as `..`, has its parent elsewhere.
            Some(above) if self.folder.file_name().is_some() => above.to_owned(),
            _ => self.folder.join(".."),
        };
        for file in &shared {
            write_if_changed(&above.join(file_name(&file.name, "result")?), &file.content)?;
        }
        let mut written = folder::replace_some(&self.folder, &files)?;
        written.retain(|path| path.file_name().is_none_or(|name| name != RECORD));
        Ok(written)
    }

    /// Returns the overrides of the study's values with which the run was started.
    pub fn overrides(&self) -> Vec<(String, String)> {
        serde_json::from_value(self.record["study"]["set"].clone()).unwrap_or_default()
    }

    /// Draws the figure with the title and the `[figure]` table of another version of the study
    /// file.
    ///
    /// Returns `true` if that version still describes the stored results.
    pub fn apply_figure_of(&mut self, like: &Study) -> bool {
        let cases = |study: &Study| study.to_record()["cases"].take();
        let same = like.kind().name == self.study.kind().name && cases(like) == cases(&self.study);
        self.study = self.study.clone().with_figure_of(like);
        self.dataset.title = self.study.title().to_owned();
        self.dataset.figure = run::figure_of_tables(&self.study, &self.dataset.tables);
        same
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::write_dataset;
    use std::fs;
    use stickslip_study::read_study;
    use stickslip_study::run::Context;
    use tempfile::TempDir;

    /// One mass with friction to the ground.
    const STUDY: &str = r#"
schema = 1
title = "Rubbing"
[parameters]
Ft = "1 N"
[[mass]]
name = "body"
mass = "1 kg"
[[spring]]
between = ["body", "ground"]
stiffness = "10 N/mm"
damping = "2 N s/m"
[[joint]]
name = "foot"
between = ["body", "ground"]
law = { kind = "jenkins", stiffness = "2 N/mm", limit = "Ft" }
[[force]]
on = "body"
amplitude = "2 N"
"#;

    /// One study of every kind.
    const KINDS: [&str; 7] = [
        "kind = \"response\"\nfrequency = { from = \"14 Hz\", to = \"19 Hz\", points = 9 }\nvary = { Ft = [\"1 N\", \"2 N\"] }",
        "kind = \"orbit\"\nfrequency = \"16.5 Hz\"\nsamples = 24",
        "kind = \"hysteresis\"\nfrequency = \"16.5 Hz\"\nvary = { Ft = [\"1 N\", \"2 N\"] }\nsamples = 24",
        "kind = \"transient\"\nfrequency = \"16.5 Hz\"\ncycles = 4",
        "kind = \"performance\"\nfrequency = { from = \"14 Hz\", to = \"19 Hz\", points = 9 }\npeak_of = \"body\"\nvary = { Ft = [\"1 N\", \"2 N\", \"3 N\"] }",
        "kind = \"modes\"\namplitude = { from = \"10 um\", to = \"10 mm\", points = 9 }",
        "kind = \"branch\"\nfrequency = { from = \"14 Hz\", to = \"19 Hz\", points = 2 }\nsteps = 10\npeak_of = \"body\"",
    ];

    fn ran(kind: &str) -> Dataset {
        let study = read_study("rub.toml", &format!("{STUDY}[study]\n{kind}\n"), &[]).unwrap();
        run::run(&study, &Context::without_progress(1)).unwrap()
    }

    fn written(kind: &str) -> (TempDir, PathBuf) {
        let out = TempDir::new().unwrap();
        write_dataset(&ran(kind), out.path(), &Outputs::select(&["csv", "svg"]).unwrap()).unwrap();
        let folder = out.path().join("rub");
        (out, folder)
    }

    #[test]
    fn every_kind_is_drawn_from_its_files_as_it_was() {
        for kind in KINDS {
            let dataset = ran(kind);
            let out = TempDir::new().unwrap();
            write_dataset(&dataset, out.path(), &Outputs::all()).unwrap();
            let stored = read(&out.path().join("rub")).unwrap();
            assert!(!dataset.figure.panels.is_empty(), "{kind}");
            assert_eq!(crate::figure::svg::to_svg(&stored.dataset.figure), crate::figure::svg::to_svg(&dataset.figure));
            // Comparing numbers would fail for NaN; comparing cells does not.
            assert_eq!(stored.dataset.tables.len(), dataset.tables.len());
            for (a, b) in stored.dataset.tables.iter().zip(&dataset.tables) {
                assert_eq!(crate::output::csv::to_csv(a).unwrap(), crate::output::csv::to_csv(b).unwrap(), "{kind}");
            }
            assert_eq!(stored.dataset.record, dataset.record);
            assert_eq!((&stored.dataset.notes, &stored.dataset.failures), (&dataset.notes, &dataset.failures));
        }
    }

    #[test]
    fn a_figure_replaces_the_old_one_and_nothing_else() {
        let (_out, folder) = written(KINDS[0]);
        let before = [fs::read(folder.join("curve.csv")).unwrap(), fs::read(folder.join("record.json")).unwrap()];
        fs::write(folder.join("figure.svg"), "old").unwrap();
        let mut stored = read(&folder).unwrap();
        let files = stored.write_figure(&Outputs::select(&["svg"]).unwrap()).unwrap();
        assert_eq!(files, [folder.join("figure.svg")]);
        let linear = fs::read_to_string(&files[0]).unwrap();
        assert!(linear.contains("</svg>"));
        // The record is the same, bit for bit.
        assert_eq!(
            [fs::read(folder.join("curve.csv")).unwrap(), fs::read(folder.join("record.json")).unwrap()],
            before
        );
        let text = format!("{STUDY}[study]\n{}\n[figure]\ny = \"log\"\n", KINDS[0]).replace("Rubbing", "Logarithmic");
        assert!(stored.apply_figure_of(&read_study("rub.toml", &text, &[]).unwrap()));
        assert_eq!(stored.dataset.figure.panels[0].y.scale, stickslip_study::dataset::Scale::Log);
        stored.write_figure(&Outputs::select(&["svg", "png", "csv"]).unwrap()).unwrap();
        assert!(fs::read_to_string(&files[0]).unwrap().contains("Logarithmic"));
        let record: Value = serde_json::from_slice(&fs::read(folder.join("record.json")).unwrap()).unwrap();
        let listed = serde_json::json!(["curve.csv", "peaks.csv", "figure.svg", "record.json", "figure.png"]);
        assert_eq!(record["files"], listed);
        // `apply_figure_of` reports a changed model.
        assert!(!stored.apply_figure_of(&read_study("rub.toml", &text.replace("1 kg", "2 kg"), &[]).unwrap()));
    }

    #[test]
    fn tables_that_were_changed_name_their_line() {
        type Change = fn(&str) -> String;
        let cases: [(Change, &str); 6] = [
            (
                |t| t.replacen("frequency_Hz", "frequency", 1),
                "line 1: column 2 is `frequency`, but the record states `frequency_Hz`",
            ),
            (
                |t| t.lines().take(4).map(|l| format!("{l}\n")).collect(),
                "line 4: the table has 3 rows, but the record states 18",
            ),
            (
                |t| t.replacen("\n1.0,14.625,", "\n1.0,fourteen,", 1),
                "line 3: `fourteen` in the column `frequency_Hz` is not a number",
            ),
            (|t| t.replacen("\n1.0,14.625,", "\n14.625,", 1), "line 3: "),
            (|t| t.replacen("true", "yes", 1), "line 2: `yes` in the column `stable` is not `true` or `false`"),
            (|_| String::new(), "line 1: the table has 0 rows, but the record states 18"),
        ];
        let (_out, folder) = written(KINDS[0]);
        let path = folder.join("curve.csv");
        let whole = fs::read_to_string(&path).unwrap();
        for (change, words) in cases {
            let text = change(&whole);
            assert_ne!(text, whole, "{words}");
            fs::write(&path, text).unwrap();
            let error = read(&folder).unwrap_err().to_string();
            assert!(error.contains("curve.csv, ") && error.contains(words), "{error}");
        }
        fs::write(&path, [0xff, 0xfe, b'\n']).unwrap();
        assert!(read(&folder).unwrap_err().to_string().contains("line 1: "));
        fs::remove_file(&path).unwrap();
        assert!(read(&folder).unwrap_err().to_string().contains("removed after the run"));
    }

    #[test]
    fn what_is_no_run_of_this_version_is_refused() {
        let (out, folder) = written(KINDS[1]);
        let error = read(out.path()).unwrap_err().to_string();
        assert!(error.contains("no results") && error.contains(folder.to_str().unwrap()), "{error}");
        assert!(read(&out.path().join("nowhere")).unwrap_err().to_string().contains("no record.json"));
        let path = folder.join("record.json");
        let whole: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        let with = |change: &dyn Fn(&mut Value)| {
            let mut record = whole.clone();
            change(&mut record);
            fs::write(&path, record.to_string()).unwrap();
            read(&folder).map(|stored| stored.dataset.figure)
        };
        assert!(with(&|_| ()).is_ok());
        let words = |change: &dyn Fn(&mut Value)| with(change).unwrap_err().to_string();
        assert!(words(&|r| r["version"] = "99.0.0".into()).contains("newer than this version"));
        assert!(words(&|r| r["study"]["schema"] = 9.into()).contains("newer than this version"));
        assert!(words(&|r| r["kind"] = "modes".into()).contains("its study has the kind `orbit`"));
        assert!(words(&|r| r["tables"][0]["file"] = "../../x.csv".into()).contains("is not the file name of a table"));
        assert!(words(&|r| r["tables"][0]["values"] = Value::Null).contains("run the study again"));
        assert!(words(&|r| r["study"]["file"] = "schema = 1".into()).contains("cannot read the study"));
        assert!(words(&|r| r["kind"] = COMPARISON.into()).contains("comparison"));
        fs::write(&path, "{").unwrap();
        assert!(read(&folder).unwrap_err().to_string().contains("not the record of a run"));
        fs::write(&path, "[]").unwrap();
        assert!(read(&folder).unwrap_err().to_string().contains("not the record of a run"));
    }

    #[test]
    fn columns_that_are_missing_everywhere_make_no_panic() {
        for kind in KINDS {
            let (_out, folder) = written(kind);
            let stored = read(&folder).unwrap();
            for (t, table) in stored.dataset.tables.iter().enumerate() {
                for column in 0..table.columns.len() {
                    // The record and the table agree, but they belong to no possible run.
                    let mut cut = table.clone();
                    cut.columns.remove(column);
                    let mut tables = stored.dataset.tables.clone();
                    tables[t] = cut;
                    assert_eq!(run::figure_of_tables(&stored.study, &tables).title, "Rubbing");
                }
            }
        }
    }
}
