//! Each table as `<name>.csv`: a header, then one line per row.
//!
//! A number is written with the fewest digits that read back as the same 64-bit value; a number that does not exist
//! (NaN) and an unknown flag are empty cells. Same dataset, same bytes.

use crate::file::{File, Output, ReportError, file_name};
use stickslip_study::dataset::{Dataset, Table, Values};

/// The output `csv`.
pub const OUTPUT: Output =
    Output { name: "csv", summary: "every table as NAME.csv, numbers with all their digits", make: files };

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    for (i, table) in dataset.tables.iter().enumerate() {
        if dataset.tables[..i].iter().any(|other| other.name.eq_ignore_ascii_case(&table.name)) {
            return Err(ReportError::SameName(table.name.clone()));
        }
    }
    dataset
        .tables
        .iter()
        .map(|table| Ok(File::new(format!("{}.csv", file_name(&table.name, "table")?), to_csv(table)?)))
        .collect()
}

/// A table as CSV (RFC 4180, line feed, header first).
/// # Errors
/// [`ReportError::Uneven`] if the columns differ in length.
pub fn to_csv(table: &Table) -> Result<Vec<u8>, ReportError> {
    let rows = table.rows();
    if let Some(column) = table.columns.iter().find(|column| column.values.len() != rows) {
        return Err(ReportError::Uneven {
            table: table.name.clone(),
            column: column.name.clone(),
            rows: column.values.len(),
            expected: rows,
        });
    }
    if table.columns.is_empty() {
        return Ok(Vec::new());
    }
    let fail = |reason: &dyn std::fmt::Display| ReportError::encode(format!("{}.csv", table.name), reason);
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    writer.write_record(table.columns.iter().map(|column| &column.name)).map_err(|e| fail(&e))?;
    for row in 0..rows {
        writer.write_record(table.columns.iter().map(|column| cell(&column.values, row))).map_err(|e| fail(&e))?;
    }
    writer.into_inner().map_err(|e| fail(&e))
}

/// The text of one cell.
pub(crate) fn cell(values: &Values, row: usize) -> String {
    match values {
        Values::Number(v) if v[row].is_nan() => String::new(),
        Values::Number(v) => format!("{:?}", v[row]),
        Values::Integer(v) => v[row].to_string(),
        Values::Text(v) => v[row].clone(),
        Values::Flag(v) => v[row].map_or(String::new(), |flag| flag.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_study::dataset::Column;

    fn column(name: &str, values: Values) -> Column {
        Column { name: name.into(), values }
    }

    #[test]
    fn numbers_read_back_bit_for_bit() {
        let values = vec![0.1 + 0.2, 1.0 / 3.0, -0.0, 5e-324, f64::MAX, 1.2125e-9, 121.25, f64::NAN, f64::INFINITY];
        let table = Table {
            name: "t".into(),
            columns: vec![
                column("x_m", Values::Number(values.clone())),
                column("n", Values::Integer(vec![u64::MAX; 9])),
                column("why, \"if\" any", Values::Text(vec!["a,b\n\"c\" <é>".into(); 9])),
                column("stable", Values::Flag([Some(true), Some(false), None].repeat(3))),
            ],
        };
        let bytes = to_csv(&table).unwrap();
        let mut reader = ::csv::Reader::from_reader(bytes.as_slice());
        assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>(), ["x_m", "n", "why, \"if\" any", "stable"]);
        let records: Vec<_> = reader.records().map(Result::unwrap).collect();
        assert_eq!(records.len(), 9);
        for (record, value) in records.iter().zip(&values) {
            if value.is_nan() {
                assert_eq!(&record[0], "");
            } else {
                assert_eq!(record[0].parse::<f64>().unwrap().to_bits(), value.to_bits());
            }
            assert_eq!(record[1].parse::<u64>().unwrap(), u64::MAX);
            assert_eq!(&record[2], "a,b\n\"c\" <é>");
        }
        assert_eq!([&records[0][3], &records[1][3], &records[2][3]], ["true", "false", ""]);
    }

    #[test]
    fn empty_tables_keep_their_header_and_uneven_ones_are_refused() {
        let empty = Table { name: "e".into(), columns: vec![column("a", Values::Number(vec![]))] };
        assert_eq!(to_csv(&empty).unwrap(), b"a\n");
        assert_eq!(to_csv(&Table { name: "none".into(), columns: vec![] }).unwrap(), b"");
        let mut uneven = empty;
        uneven.columns.push(column("b", Values::Number(vec![1.0])));
        let message = to_csv(&uneven).unwrap_err().to_string();
        assert!(message.contains("`e`") && message.contains("`b`"), "{message}");
    }
}
