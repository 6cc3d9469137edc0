//! Writes `record.json`: the study, its values, and the outcome of the run.
//!
//! Two runs of the same study differ in the wall time only.

use crate::output::result_file::{File, Output, ReportError};
use serde::ser::{Serialize, SerializeMap, Serializer};
use stickslip_study::dataset::{CellValues, Dataset, Table};

/// The output `json`.
pub const OUTPUT: Output = Output {
    name: "json",
    summary: "record.json: versions, resolved study, seed, points by status",
    make: files,
    sink: None,
    is_default: true,
};

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    Ok(vec![File::new("record.json", to_json(dataset, &[])?)])
}

/// Columns and number of rows of a table, for the record.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TableShape {
    /// The columns, without rows.
    pub header: Table,
    pub rows: usize,
}

impl TableShape {
    pub fn of(table: &Table) -> TableShape {
        TableShape { header: table.header(), rows: table.rows() }
    }

    /// Adds more rows of the same table.
    pub fn add(&mut self, more: TableShape) {
        self.header.append(more.header);
        self.rows += more.rows;
    }

    /// Returns these rows with all columns of the table.
    pub fn filled(&self, rows: Table) -> Table {
        let mut filled = self.header.clone();
        filled.append(rows);
        filled
    }
}

/// Returns the record of a run as indented JSON with a final line feed.
///
/// `files` are the names of the files that belong to the run.
/// # Errors
/// [`ReportError::Encode`] if a value cannot be written as JSON.
pub fn to_json(dataset: &Dataset, files: &[String]) -> Result<String, ReportError> {
    let shapes: Vec<TableShape> = dataset.tables.iter().map(TableShape::of).collect();
    record_json(dataset, &shapes, files)
}

/// Returns the record of a run whose tables are not completely in memory.
pub(crate) fn record_json(dataset: &Dataset, shapes: &[TableShape], files: &[String]) -> Result<String, ReportError> {
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
        "tables": shapes.iter().map(|t| serde_json::json!({
            "file": format!("{}.csv", t.header.name),
            "rows": t.rows,
            "columns": t.header.columns.iter().map(|c| &c.name).collect::<Vec<_>>(),
            "values": t.header.columns.iter().map(|c| value_type(&c.values)).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
        "study": record.study,
    });
    let text = serde_json::to_string_pretty(&value).map_err(|e| ReportError::encode("record.json", e))?;
    Ok(text + "\n")
}

/// Returns the type name of a column's cells, which reading the table back requires.
pub(crate) fn value_type(values: &CellValues) -> &'static str {
    match values {
        CellValues::Number(_) => "number",
        CellValues::Integer(_) => "integer",
        CellValues::Text(_) => "text",
        CellValues::Flag(_) => "flag",
    }
}

/// Writes the dataset as one line of JSON for other programs.
///
/// The object contains the record and every table as a list of rows. A row is an object from
/// column name to value. NaN, infinity and unknown flags are `null`.
/// # Errors
/// Returns an error if `writer` fails.
pub fn write_dataset_json(dataset: &Dataset, writer: impl std::io::Write) -> Result<(), std::io::Error> {
    serde_json::to_writer(writer, &DatasetJson(dataset)).map_err(std::io::Error::from)
}

struct DatasetJson<'a>(&'a Dataset);
struct TablesJson<'a>(&'a [Table]);
struct RowList<'a>(&'a Table);
struct RowObject<'a>(&'a Table, usize);

impl Serialize for DatasetJson<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let DatasetJson(dataset) = self;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("name", &dataset.name)?;
        map.serialize_entry("title", &dataset.title)?;
        map.serialize_entry("source", &dataset.source)?;
        map.serialize_entry("kind", &dataset.kind)?;
        map.serialize_entry("notes", &dataset.notes)?;
        map.serialize_entry("failures", &dataset.failures)?;
        map.serialize_entry("record", &dataset.record)?;
        map.serialize_entry("tables", &TablesJson(&dataset.tables))?;
        map.end()
    }
}

impl Serialize for TablesJson<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|table| (&table.name, RowList(table))))
    }
}

impl Serialize for RowList<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq((0..self.0.rows()).map(|row| RowObject(self.0, row)))
    }
}

impl Serialize for RowObject<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let RowObject(table, row) = self;
        let mut map = serializer.serialize_map(Some(table.columns.len()))?;
        for column in &table.columns {
            match &column.values {
                // JSON has neither NaN nor infinity.
                CellValues::Number(v) => {
                    map.serialize_entry(&column.name, &v.get(*row).copied().filter(|value| value.is_finite()))?;
                }
                CellValues::Integer(v) => map.serialize_entry(&column.name, &v.get(*row))?,
                CellValues::Text(v) => map.serialize_entry(&column.name, &v.get(*row))?,
                CellValues::Flag(v) => map.serialize_entry(&column.name, &v.get(*row).copied().flatten())?,
            }
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn rows_are_objects_and_what_does_not_exist_is_null() {
        for dataset in samples::all() {
            let mut bytes = Vec::new();
            write_dataset_json(&dataset, &mut bytes).unwrap();
            let value: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
            assert_eq!(value["tables"].as_object().unwrap().len(), dataset.tables.len());
            for table in &dataset.tables {
                assert_eq!(value["tables"][&table.name].as_array().unwrap().len(), table.rows(), "{}", table.name);
            }
        }
        let mut bytes = Vec::new();
        write_dataset_json(&samples::hostile(), &mut bytes).unwrap();
        let value: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
        let expected = serde_json::json!([
            { "frequency_Hz": null, "mass": "<b>", "amplitude_m": 1e300 },
            { "frequency_Hz": 1e-300, "mass": "a,b", "amplitude_m": -0.0 },
            { "frequency_Hz": 121.25, "mass": "位移", "amplitude_m": 0.0487321 },
        ]);
        assert_eq!(value["tables"]["peaks"], expected);
        assert_eq!(value["record"]["points"]["converged"], 240);
    }

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
