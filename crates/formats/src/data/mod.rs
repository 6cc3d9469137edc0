//! Reads measured or computed tables: columns of numbers with names and units.
//!
//! A [`DataFile`] is a flat list of [`Column`]s. The columns of one record, such as a function
//! of a universal file, share the beginning of their names. The content decides the format.
//!
//! - `column`: a column with its name, unit and sampling;
//! - `delimited`: text with any separator;
//! - `universal`: Universal File Format;
//! - `wav`: sampled sound;
//! - `parquet`: tables of Parquet, described by values of `thrift`;
//! - `matlab`, `hdf5`, `numpy`: arrays of MATLAB, HDF5 and NumPy;
//! - `arrays`: from an array to columns;
//! - `abaqus_report`, `calculix_print`, `calculix_results`: results of finite-element programs at
//!   nodes, as `blocks`.
//!
//! ```
//! use stickslip_formats::data::read_bytes;
//! let file = read_bytes(b"time_s;force [N]\n0;1,5\n0,5;2\n1;-3\n")?;
//! let force = file.column("force").unwrap();
//! assert_eq!((force.unit.as_str(), &force.values[..]), ("N", &[1.5, 2.0, -3.0][..]));
//! assert_eq!(file.column("time_s").unwrap().sampling().unwrap().step, 0.5);
//! # Ok::<(), stickslip_formats::Error>(())
//! ```

mod abaqus_report;
mod arrays;
mod blocks;
mod calculix_print;
mod calculix_results;
mod column;
mod delimited;
mod hdf5;
mod matlab;
mod numpy;
mod parquet;
mod thrift;
mod universal;
mod wav;

use crate::error::{Error, ErrorKind, Location};
use crate::file::load;
use std::path::Path;

pub use column::{Column, Sampling, split_unit};

/// The content of a file of data.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DataFile {
    /// Name of the format, a row of [`TABLE`].
    pub format: &'static str,
    /// The columns, in file order. Their lengths may differ.
    pub columns: Vec<Column>,
    /// Content that was not read, with the reason.
    pub skipped: Vec<String>,
    /// Notes for a reader of the data: titles, units, repaired faults.
    pub notes: Vec<String>,
}

impl DataFile {
    /// Returns the column with this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }
}

/// A file format for data.
pub struct DataFormat {
    /// Name of the format.
    pub name: &'static str,
    /// Short description, with the programs that write the format.
    pub summary: &'static str,
    /// Returns true if the content looks like this format.
    sniff: fn(&[u8]) -> bool,
    read: fn(&[u8]) -> Result<DataFile, Error>,
}

/// All formats of data. The first format that recognizes the content reads the file.
pub const TABLE: &[DataFormat] = &[
    universal::FORMAT,
    wav::FORMAT,
    parquet::FORMAT,
    hdf5::FORMAT,
    matlab::FORMAT,
    numpy::NPY,
    numpy::NPZ,
    calculix_results::FORMAT,
    calculix_print::FORMAT,
    abaqus_report::FORMAT,
    // Any text may be a table, so this format comes last.
    delimited::FORMAT,
];

/// Reads a file of data.
///
/// # Errors
/// [`Error`] with file, location, problem and remedy.
pub fn read(path: impl AsRef<Path>) -> Result<DataFile, Error> {
    let path = path.as_ref();
    read_bytes(&load(path)?).map_err(|error| error.with_path(path))
}

/// Reads a file of data in memory.
///
/// # Errors
/// Like [`read`], without the path.
pub fn read_bytes(bytes: &[u8]) -> Result<DataFile, Error> {
    let refuse = |problem: &str, remedy: &str| {
        Err(Error::new(ErrorKind::Format, Location::File, problem.to_owned(), remedy.to_owned()))
    };
    if bytes.is_empty() {
        return refuse("the file is empty", "export or copy it again");
    }
    if bytes.starts_with(&[0x1f, 0x8b]) {
        return refuse("the file is compressed with gzip", "decompress it first: gunzip FILE");
    }
    if crate::mat5::is_version_4(bytes) {
        return refuse(
            "the file has the format of MATLAB version 4, which is not supported",
            "save it again: save('data.mat', 'x', '-v7'), or scipy.io.savemat with format='5'",
        );
    }
    // a table of another encoding becomes UTF-8 first
    let decoded = decode_utf16(bytes);
    let bytes = decoded.as_deref().unwrap_or_else(|| crate::without_bom(bytes));
    match TABLE.iter().find(|format| (format.sniff)(bytes)) {
        Some(format) => (format.read)(bytes).map(|file| DataFile { format: format.name, ..file }),
        None => {
            let names: Vec<&str> = TABLE.iter().map(|format| format.name).collect();
            refuse(
                "the content matches no known data format",
                &format!("export the data in one of the formats {}", names.join(", ")),
            )
        }
    }
}

/// Returns UTF-16 text with a byte order mark as UTF-8.
fn decode_utf16(bytes: &[u8]) -> Option<Vec<u8>> {
    let unit: fn([u8; 2]) -> u16 = match bytes {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return None,
    };
    let units: Vec<u16> = bytes[2..].chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect();
    Some(String::from_utf16_lossy(&units).into_bytes())
}

/// Returns text without blanks at its ends, which is UTF-8, or Latin-1 if it is not.
fn decoded(text: &[u8]) -> String {
    let text = text.trim_ascii();
    match std::str::from_utf8(text) {
        Ok(text) => text.to_owned(),
        Err(_) => text.iter().map(|byte| char::from(*byte)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_no_tables_are_refused_with_a_remedy() {
        for (bytes, part) in [
            (&b""[..], "empty"),
            (b"\x1f\x8b\x08", "gunzip"),
            (b"PAR1\x00\x00", "not complete"),
            (b"\x00\x01\x02\x03\xff\xfe", "no known data format"),
            (b"hello\nworld\n", "no number"),
        ] {
            let error = read_bytes(bytes).expect_err("no table").to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn utf_16_tables_are_read() {
        let text = "t;F\r\n0;1\r\n1;2\r\n";
        let bytes: Vec<u8> = [0xff, 0xfe].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect();
        let file = read_bytes(&bytes).expect("a table");
        assert_eq!(file.column("F").expect("the column").values, [1.0, 2.0]);
    }
}
