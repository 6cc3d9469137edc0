//! Writes each table as `<name>.csv`: a header, then one line per row.
//!
//! A number has the fewest digits that read back as the same 64-bit value. NaN and unknown
//! flags are empty cells. Equal datasets give equal bytes.

use crate::output::result_file::{Output, ReportError, Sink, TableWriter, check_equal_lengths};
use rayon::prelude::*;
use std::fmt::Write as _;
use std::io::Write;
use std::ops::Range;
use stickslip_study::dataset::{CellValues, Table};

/// The output `csv`.
pub const OUTPUT: Output = Output {
    name: "csv",
    summary: "every table as NAME.csv, with numbers in full precision",
    make: |dataset| SINK.files(dataset),
    sink: Some(SINK),
    is_default: true,
};

const SINK: Sink = Sink { extension: "csv", begin };

/// Returns a table as CSV (RFC 4180, line feed, header first).
/// # Errors
/// [`ReportError::Uneven`] if the columns differ in length.
pub fn to_csv(table: &Table) -> Result<Vec<u8>, ReportError> {
    SINK.file(table)
}

struct CsvWriter<'a>(Box<dyn Write + 'a>);

fn begin<'a>(table: &Table, mut writer: Box<dyn Write + 'a>) -> Result<Box<dyn TableWriter + 'a>, ReportError> {
    if !table.columns.is_empty() {
        let header = lines(table, |text| text.write_record(table.columns.iter().map(|column| &column.name)))?;
        writer.write_all(&header).map_err(|cause| failed(table, &cause))?;
    }
    Ok(Box::new(CsvWriter(writer)))
}

impl TableWriter for CsvWriter<'_> {
    fn rows(&mut self, table: &Table) -> Result<(), ReportError> {
        // Number of rows that one thread converts to text at a time.
        let rows = 1024;
        check_equal_lengths(table)?;
        let stretches: Vec<Range<usize>> =
            (0..table.rows()).step_by(rows).map(|from| from..(from + rows).min(table.rows())).collect();
        let texts: Vec<Result<Vec<u8>, ReportError>> =
            stretches.into_par_iter().map(|rows| lines(table, |text| cells(table, rows, text))).collect();
        for text in texts {
            self.0.write_all(&text?).map_err(|cause| failed(table, &cause))?;
        }
        Ok(())
    }

    fn end(mut self: Box<Self>) -> Result<(), ReportError> {
        self.0.flush().map_err(|cause| ReportError::encode("a table", cause))
    }
}

fn failed(table: &Table, reason: &dyn std::fmt::Display) -> ReportError {
    ReportError::encode(format!("{}.csv", table.name), reason)
}

type RecordWriter = ::csv::Writer<Vec<u8>>;

/// Returns the bytes that `write` writes.
fn lines(table: &Table, write: impl FnOnce(&mut RecordWriter) -> ::csv::Result<()>) -> Result<Vec<u8>, ReportError> {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    write(&mut writer).map_err(|cause| failed(table, &cause))?;
    writer.into_inner().map_err(|cause| failed(table, &cause))
}

fn cells(table: &Table, rows: Range<usize>, writer: &mut RecordWriter) -> ::csv::Result<()> {
    let mut text = String::new();
    for row in rows {
        for column in &table.columns {
            text.clear();
            write_cell(&column.values, row, &mut text);
            writer.write_field(&text)?;
        }
        writer.write_record(None::<&[u8]>)?;
    }
    Ok(())
}

/// Returns the text of one cell.
pub(crate) fn cell(values: &CellValues, row: usize) -> String {
    let mut text = String::new();
    write_cell(values, row, &mut text);
    text
}

fn write_cell(values: &CellValues, row: usize, text: &mut String) {
    // Writing to a string cannot fail.
    let _ = match values {
        CellValues::Number(v) if v[row].is_nan() => Ok(()),
        CellValues::Number(v) => write!(text, "{:?}", v[row]),
        CellValues::Integer(v) => write!(text, "{}", v[row]),
        CellValues::Text(v) => text.write_str(&v[row]),
        CellValues::Flag(v) => v[row].map_or(Ok(()), |flag| write!(text, "{flag}")),
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_study::dataset::Column;

    fn column(name: &str, values: CellValues) -> Column {
        Column { name: name.into(), values }
    }

    #[test]
    fn numbers_read_back_bit_for_bit() {
        let values = vec![0.1 + 0.2, 1.0 / 3.0, -0.0, 5e-324, f64::MAX, 1.2125e-9, 121.25, f64::NAN, f64::INFINITY];
        let table = Table {
            name: "t".into(),
            columns: vec![
                column("x_m", CellValues::Number(values.clone())),
                column("n", CellValues::Integer(vec![u64::MAX; 9])),
                column("why, \"if\" any", CellValues::Text(vec!["a,b\n\"c\" <é>".into(); 9])),
                column("stable", CellValues::Flag([Some(true), Some(false), None].repeat(3))),
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
        let empty = Table { name: "e".into(), columns: vec![column("a", CellValues::Number(vec![]))] };
        assert_eq!(to_csv(&empty).unwrap(), b"a\n");
        assert_eq!(to_csv(&Table { name: "none".into(), columns: vec![] }).unwrap(), b"");
        let mut uneven = empty;
        uneven.columns.push(column("b", CellValues::Number(vec![1.0])));
        let message = to_csv(&uneven).unwrap_err().to_string();
        assert!(message.contains("`e`") && message.contains("`b`"), "{message}");
    }
}
