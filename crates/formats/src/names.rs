//! Names of the rows of a matrix, in a separate file, because most matrix formats have no names.
//!
//! A name is `node.direction`, such as `1353.y`. The directions are
//! `x y z rx ry rz`; other degrees of freedom keep their number.
//!
//! ```
//! use stickslip_formats::names;
//!
//! let csv = "row,name\n1,root\n2,tip.x\n";
//! assert_eq!(names::read_bytes(csv.as_bytes(), 2)?, ["root", "tip.x"]);
//! // CalculiX: node 10, direction 1. As a floating-point number it would equal 10.10.
//! assert_eq!(names::read_bytes(b"10.1\n10.2\n", 2)?, ["10.x", "10.y"]);
//! # Ok::<(), stickslip_formats::Error>(())
//! ```

use std::path::Path;

use crate::error::{Error, ErrorKind, Location};
use crate::file::{io, load};
use crate::matrix::Matrix;
use crate::text::{Line, Lines, integer, quoted};

/// A file format for row names.
pub struct NameFormat {
    /// Name of the format.
    pub name: &'static str,
    /// Short description, with the programs that write the format.
    pub summary: &'static str,
    /// Returns true if the first line is of this format.
    sniff: fn(&Line) -> bool,
    /// Returns the name in a line, or `None` for titles. The second argument is
    /// the number of preceding lines.
    line: fn(&Line, usize) -> Result<Option<Named>, Error>,
}

/// A row, counted from zero, and its name.
type Named = (usize, String);

/// All formats of row names.
pub const TABLE: &[NameFormat] = &[
    NameFormat {
        name: "csv",
        summary: "CSV with the columns `row,name`, rows from 1; rows without a line have no name",
        sniff: |line| String::from_utf8_lossy(line.text).trim().replace(' ', "").eq_ignore_ascii_case("row,name"),
        line: csv_line,
    },
    NameFormat {
        name: "calculix",
        summary: "CalculiX (.dof): a line `node.direction` for every row",
        sniff: |line| dof(line.text.trim_ascii()).is_some(),
        line: dof_line,
    },
    NameFormat {
        name: "ansys",
        summary: "ANSYS (.mapping): a line `equation node label` for every row, from HBMAT",
        sniff: |line| String::from_utf8_lossy(line.text).to_lowercase().contains("node") || mapping(line).is_some(),
        line: mapping_line,
    },
];

/// Reads the names of `rows` rows. A row without a name gets an empty one.
///
/// # Errors
/// [`ErrorKind::Names`] if the names do not match the rows, [`ErrorKind::Format`] if no
/// format of [`TABLE`] recognizes the file.
pub fn read(path: impl AsRef<Path>, rows: usize) -> Result<Vec<String>, Error> {
    let path = path.as_ref();
    read_bytes(&load(path)?, rows).map_err(|error| error.with_path(path))
}

/// Reads names from a file in memory, like [`read`].
///
/// # Errors
/// Like [`read`], without the path.
pub fn read_bytes(bytes: &[u8], rows: usize) -> Result<Vec<String>, Error> {
    let mut lines = Lines::new(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    let first = lines.expect_filled("names of rows")?;
    let format = TABLE.iter().find(|format| (format.sniff)(&first)).ok_or_else(|| {
        let problem = format!("expected row names, found {}", quoted(first.text));
        let known = TABLE.iter().map(|format| format.summary).collect::<Vec<_>>().join("; ");
        Error::new(ErrorKind::Format, first.location(), problem, format!("use one of these formats: {known}"))
    })?;
    let mut names = NameList { names: Vec::new(), rows };
    for (index, line) in
        std::iter::once(first).chain(lines).filter(|line| !line.text.trim_ascii().is_empty()).enumerate()
    {
        if let Some((row, name)) = (format.line)(&line, index)? {
            names.put(row, name, &line)?;
        }
    }
    names.finish(format.name == "csv")
}

/// Writes the row names of a matrix as CSV `row,name`.
///
/// # Errors
/// [`ErrorKind::Names`] if the matrix has no names, [`ErrorKind::Io`].
pub fn write(path: impl AsRef<Path>, matrix: &Matrix) -> Result<(), Error> {
    let path = path.as_ref();
    let names = matrix.names().ok_or_else(|| {
        let problem = "the rows of the matrix have no names".into();
        Error::new(ErrorKind::Names, Location::File, problem, "give it names first").with_path(path)
    })?;
    let mut text = String::from("row,name\n");
    for (index, name) in names.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
        text.push_str(&format!("{},{}\n", index + 1, csv_field(name)));
    }
    std::fs::write(path, text).map_err(|error| io(path, &error))
}

/// Returns a name as a CSV field, in quotes if necessary.
fn csv_field(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name.into() }
}

/// Returns the name of a degree of freedom: 1 to 6 are `x y z rx ry rz`, others keep their number.
pub(crate) fn direction(number: i64) -> String {
    match number {
        1..=6 => ["x", "y", "z", "rx", "ry", "rz"][number as usize - 1].into(),
        other => other.to_string(),
    }
}

/// The names read so far.
struct NameList {
    names: Vec<String>,
    rows: usize,
}

impl NameList {
    fn put(&mut self, row: usize, name: String, line: &Line) -> Result<(), Error> {
        let fault = |problem| {
            let remedy = "provide the file of row names that was written with the matrix";
            Err(Error::new(ErrorKind::Names, line.location(), problem, remedy))
        };
        if row >= self.rows {
            return fault(format!("the file names row {}, but the matrix has {} rows", row + 1, self.rows));
        }
        if name.is_empty() {
            return fault(format!("row {} has an empty name", row + 1));
        }
        if self.names.len() <= row {
            self.names.resize(row + 1, String::new());
        }
        if !self.names[row].is_empty() {
            return fault(format!("row {} has two names: `{}` and `{name}`", row + 1, self.names[row]));
        }
        self.names[row] = name;
        Ok(())
    }

    fn finish(mut self, gaps: bool) -> Result<Vec<String>, Error> {
        let named = self.names.iter().filter(|name| !name.is_empty()).count();
        if named != self.rows && !gaps {
            return Err(Error::new(
                ErrorKind::Names,
                Location::File,
                format!("the file has {named} names for {} rows", self.rows),
                "provide the file of row names that was written with the matrix",
            ));
        }
        let mut order: Vec<usize> = (0..self.names.len()).filter(|row| !self.names[*row].is_empty()).collect();
        order.sort_by(|a, b| self.names[*a].cmp(&self.names[*b]));
        if let Some(&[a, b]) = order.array_windows().find(|[a, b]| self.names[*a] == self.names[*b]) {
            let problem = format!("rows {} and {} have the same name `{}`", a + 1, b + 1, self.names[a]);
            return Err(Error::new(ErrorKind::Names, Location::File, problem, "give every row a unique name"));
        }
        self.names.resize(self.rows, String::new());
        Ok(self.names)
    }
}

fn csv_line(line: &Line, index: usize) -> Result<Option<Named>, Error> {
    if index == 0 {
        return Ok(None);
    }
    let text = std::str::from_utf8(line.text).map_err(|_| line.malformed("`row,name` in UTF-8", &quoted(line.text)))?;
    let (row, name) = text.split_once(',').ok_or_else(|| line.malformed("`row,name`", &quoted(line.text)))?;
    let name = name.trim();
    let name = match name.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')) {
        Some(inner) => inner.replace("\"\"", "\""),
        None => name.to_string(),
    };
    Ok(Some((line.index(row.trim().as_bytes())?, name)))
}

/// Returns node and direction of a text such as `10.1`.
fn dof(text: &[u8]) -> Option<(i64, i64)> {
    let dot = text.iter().position(|&byte| byte == b'.')?;
    Some((integer(&text[..dot])?, integer(&text[dot + 1..])?))
}

fn dof_line(line: &Line, index: usize) -> Result<Option<Named>, Error> {
    let text = line.text.trim_ascii();
    let (node, number) = dof(text).ok_or_else(|| line.malformed("`node.direction`", &quoted(text)))?;
    Ok(Some((index, format!("{node}.{}", direction(number)))))
}

/// Returns equation, node and label of a line of HBMAT's mapping file.
fn mapping(line: &Line) -> Option<(usize, i64, String)> {
    let [equation, node, label] = line.exactly("").ok()?;
    let equation = usize::try_from(integer(equation)?.checked_sub(1)?).ok()?;
    // The label must begin with a letter, because a matrix entry is also a line of three fields.
    let label = std::str::from_utf8(label).ok().filter(|label| label.starts_with(char::is_alphabetic))?.to_uppercase();
    let label = match label.strip_prefix("ROT") {
        Some(axis) => format!("r{}", axis.to_lowercase()),
        None => match label.as_str() {
            "UX" | "UY" | "UZ" => label[1..].to_lowercase(),
            _ => label,
        },
    };
    Some((equation, integer(node)?, label))
}

fn mapping_line(line: &Line, index: usize) -> Result<Option<Named>, Error> {
    match mapping(line) {
        Some((equation, node, label)) => Ok(Some((equation, format!("{node}.{label}")))),
        // The column titles.
        None if index == 0 => Ok(None),
        None => Err(line.malformed("`equation node label`", &quoted(line.text))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, rows: usize, expected: Result<&[&str], (ErrorKind, Location)>) {
        let found = read_bytes(text.as_bytes(), rows).map_err(|e| (e.kind, e.location));
        assert_eq!(found, expected.map(|names| names.iter().map(ToString::to_string).collect()), "{text}");
    }

    #[test]
    fn csv_may_leave_rows_without_a_name() {
        check("row,name\n3,tip\n1,\"a, \"\"b\"\"\"\n", 3, Ok(&["a, \"b\"", "", "tip"]));
        check("\u{feff}Row, Name\r\n1,x\r\n", 1, Ok(&["x"]));
        check("row,name\n1,a\n1,b\n", 2, Err((ErrorKind::Names, Location::Line(3))));
        check("row,name\n3,a\n", 2, Err((ErrorKind::Names, Location::Line(2))));
        check("row,name\n0,a\n", 2, Err((ErrorKind::Malformed, Location::Line(2))));
        check("row,name\n1,\n", 2, Err((ErrorKind::Names, Location::Line(2))));
        check("row,name\nx\n", 2, Err((ErrorKind::Malformed, Location::Line(2))));
    }

    #[test]
    fn calculix_directions_are_no_decimals() {
        check("10.1\n10.10\n7.4\n", 3, Ok(&["10.x", "10.10", "7.rx"]));
        check("10.1\n10.2\n", 3, Err((ErrorKind::Names, Location::File)));
        check("10.1\n10.2\n", 1, Err((ErrorKind::Names, Location::Line(2))));
        check("10.1\n10.2\n10.1\n", 3, Err((ErrorKind::Names, Location::File)));
        check("10.1\nx\n", 2, Err((ErrorKind::Malformed, Location::Line(2))));
    }

    #[test]
    fn ansys_labels_become_directions() {
        let text = "   Matrix Eqn      Node      DOF\n       2         7     ROTZ\n       1         7     UX\n";
        check(text, 2, Ok(&["7.x", "7.rz"]));
        check("1 7 UX\n2 7 TEMP\n", 2, Ok(&["7.x", "7.TEMP"]));
        check("1 7 UX\nmore\n", 2, Err((ErrorKind::Malformed, Location::Line(2))));
    }

    #[test]
    fn other_files_are_refused() {
        check("hello\n", 1, Err((ErrorKind::Format, Location::Line(1))));
        check("", 1, Err((ErrorKind::Truncated, Location::Line(1))));
    }
}
