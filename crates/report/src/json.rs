//! `record.json`: what was run, with which values, how it went.
//!
//! The wall time is the only entry that differs between two runs of the same study.

use crate::output::{File, Output, ReportError};
use stickslip_study::dataset::Dataset;

/// The output `json`.
pub const OUTPUT: Output =
    Output { name: "json", summary: "record.json: versions, resolved study, seed, points by status", make: files };

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    Ok(vec![File::new("record.json", to_json(dataset, &[])?)])
}

/// The record of a run and what a reader of the results must know, as indented JSON with a final line feed; `files` are the names of the
/// files that belong to the run.
/// # Errors
/// [`ReportError::Encode`] if a value cannot be written as JSON.
pub fn to_json(dataset: &Dataset, files: &[String]) -> Result<String, ReportError> {
    let record = &dataset.record;
    let value = serde_json::json!({
        "name": dataset.name,
        "title": dataset.title,
        "source": dataset.source,
        "kind": dataset.kind,
        "version": record.version,
        "methods": record.methods,
        "seed": record.seed,
        "threads": record.threads,
        "wall_time_s": record.wall_time_s,
        "interrupted": record.interrupted,
        "points": record.points,
        "notes": dataset.notes,
        "failures": dataset.failures,
        "files": files,
        "tables": dataset.tables.iter().map(|t| serde_json::json!({
            "file": format!("{}.csv", t.name),
            "rows": t.rows(),
            "columns": t.columns.iter().map(|c| &c.name).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
        "study": record.study,
    });
    let text = serde_json::to_string_pretty(&value).map_err(|e| ReportError::encode("record.json", e))?;
    Ok(text + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn the_record_holds_what_a_repetition_needs() {
        let dataset = samples::hostile();
        let value: serde_json::Value =
            serde_json::from_str(&to_json(&dataset, &["record.json".to_owned()]).unwrap()).unwrap();
        assert_eq!(value["title"], dataset.title.as_str());
        assert_eq!(value["study"], dataset.record.study);
        assert_eq!(value["seed"], 7);
        assert_eq!(value["files"][0], "record.json");
        assert_eq!(value["failures"].as_array().unwrap().len(), dataset.failures.len());
        assert_eq!(value["failures"][0]["reason"], dataset.failures[0].reason.as_str());
        assert_eq!(value["points"]["converged"], 240);
    }
}
