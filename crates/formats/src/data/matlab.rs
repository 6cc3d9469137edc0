//! Arrays of MATLAB `.mat` files of version 5 to 7.
//!
//! Arrays in structures have names such as `run.force`, in arrays of structures `run(2).force`,
//! in cells `run{2}`. Texts are notes.

use super::arrays::Array;
use super::{DataFile, DataFormat};
use crate::bytes::{ByteCursor, ByteOrder, NumberType};
use crate::error::{Error, ErrorKind, Location};
use crate::inflate::{Container, DecompressionLimit, inflate};
use crate::mat5::{self, MatElement};

pub(super) const FORMAT: DataFormat = DataFormat {
    name: "matlab",
    summary: "MATLAB (.mat) up to version 7: arrays, real and complex, in structures, arrays of structures and cells",
    sniff: |bytes| mat5::order(bytes).is_some(),
    read,
};

/// Classes of variables without numbers: cell, structure, object, text.
const CELL: u8 = 1;
const TEXT: u8 = 4;
/// First and last class of full arrays of numbers.
const NUMBERS: std::ops::RangeInclusive<u8> = 6..=15;

/// Most elements of an array of structures or a cell that are read.
const MAX_ELEMENTS: usize = 10_000;

fn read(bytes: &[u8]) -> Result<DataFile, Error> {
    let Some(order) = mat5::order(bytes) else {
        return Err(ByteCursor::new(bytes, ByteOrder::Little).malformed("the header of MATLAB 5", "none"));
    };
    let limit = DecompressionLimit::for_file(bytes.len());
    let mut walk = StructWalk { order, file: DataFile::default(), budget: limit.numbers() };
    let mut cursor = ByteCursor::new(bytes, order);
    cursor.skip(mat5::HEADER);
    while cursor.remaining() >= 8 {
        let MatElement { kind, data, location } = mat5::element(&mut cursor)?;
        match kind {
            mat5::MATRIX => walk.variable(data, None, mat5::DEPTH)?,
            mat5::COMPRESSED => {
                let all = inflate(data, Container::Zlib, limit, &location)?;
                let inner = mat5::element(&mut ByteCursor::new(&all, order))?;
                if inner.kind == mat5::MATRIX {
                    walk.variable(inner.data, None, mat5::DEPTH)?;
                }
            }
            _ => {}
        }
    }
    Ok(walk.file)
}

/// A walk through the variables of a file.
struct StructWalk {
    order: ByteOrder,
    file: DataFile,
    /// Numbers that may still be read. Compressed variables can state many.
    budget: u64,
}

impl StructWalk {
    /// Reads a variable from the bytes of its element. `path` replaces its own name.
    fn variable(&mut self, data: &[u8], path: Option<String>, depth: usize) -> Result<(), Error> {
        let mut parts = ByteCursor::new(data, self.order);
        let head = mat5::head(&mut parts)?;
        let name = path.unwrap_or_else(|| head.name.clone());
        let count = head.rows.saturating_mul(head.columns);
        match head.class {
            mat5::STRUCTURE if depth > 0 => self.structure(&mut parts, count, &name, depth),
            CELL if depth > 0 => {
                for at in 0..count.min(MAX_ELEMENTS) {
                    if parts.remaining() < 8 {
                        break;
                    }
                    let element = mat5::element(&mut parts)?;
                    self.nested(&element, format!("{name}{{{}}}", at + 1), depth)?;
                }
                Ok(())
            }
            TEXT => {
                let text = self.text(&mut parts)?;
                self.file.notes.push(format!("{name} = {text}"));
                Ok(())
            }
            class if NUMBERS.contains(&class) => self.numbers(&mut parts, &head, name),
            mat5::SPARSE => self.skip(name, "a sparse matrix"),
            class => self.skip(name, mat5::class_name(class).unwrap_or("of another class")),
        }
    }

    fn skip(&mut self, name: String, what: &str) -> Result<(), Error> {
        self.file.skipped.push(format!("`{name}` is {what}"));
        Ok(())
    }

    fn nested(&mut self, element: &MatElement<'_>, name: String, depth: usize) -> Result<(), Error> {
        if element.kind != mat5::MATRIX || element.data.is_empty() {
            return self.skip(name, "empty");
        }
        self.variable(element.data, Some(name), depth - 1)
    }

    fn structure(&mut self, parts: &mut ByteCursor<'_>, count: usize, name: &str, depth: usize) -> Result<(), Error> {
        let length = mat5::element(parts)?;
        let length = NumberType::I32.index(&mut ByteCursor::new(length.data, self.order))?;
        let names = mat5::element(parts)?.data;
        if length == 0 {
            return Ok(());
        }
        let fields: Vec<String> = names
            .chunks(length)
            .map(|field| {
                let end = field.iter().position(|byte| *byte == 0).unwrap_or(field.len());
                String::from_utf8_lossy(&field[..end]).into_owned()
            })
            .collect();
        for at in 0..count.min(MAX_ELEMENTS) {
            let owner = if count == 1 { name.to_owned() } else { format!("{name}({})", at + 1) };
            for field in &fields {
                if parts.remaining() < 8 {
                    return Ok(());
                }
                let element = mat5::element(parts)?;
                self.nested(&element, format!("{owner}.{field}"), depth)?;
            }
        }
        Ok(())
    }

    fn text(&self, parts: &mut ByteCursor<'_>) -> Result<String, Error> {
        let element = mat5::element(parts)?;
        let units: Vec<u16> = match mat5::number(element.kind) {
            Some(NumberType::U16) => {
                let mut cursor = ByteCursor::new(element.data, self.order);
                (0..element.data.len() / 2).map(|_| cursor.u16()).collect::<Result<_, _>>()?
            }
            _ => {
                return Ok(String::from_utf8_lossy(&element.data[..element.data.len().min(200)]).trim_end().to_owned());
            }
        };
        Ok(String::from_utf16_lossy(&units[..units.len().min(200)]).trim_end().to_owned())
    }

    fn numbers(&mut self, parts: &mut ByteCursor<'_>, head: &mat5::VariableHeader, name: String) -> Result<(), Error> {
        let real = self.values(parts)?;
        let imaginary = if head.complex { self.values(parts)? } else { Vec::new() };
        // arrays of more dimensions have their first one upright
        if real.is_empty() || head.rows == 0 || !real.len().is_multiple_of(head.rows) {
            return self.skip(name, "empty, or of another size than stated");
        }
        match (Array { name, rows: head.rows, real, imaginary }).into_columns() {
            Ok(columns) => self.file.columns.extend(columns),
            Err(why) => self.file.skipped.push(why),
        }
        Ok(())
    }

    fn values(&mut self, parts: &mut ByteCursor<'_>) -> Result<Vec<f64>, Error> {
        let MatElement { kind, data, location } = mat5::element(parts)?;
        let number =
            mat5::number(kind).ok_or_else(|| parts.malformed("numbers", format!("an element of type {kind}")))?;
        let count = data.len() / number.size();
        self.budget = self.budget.checked_sub(count as u64).ok_or_else(|| too_many(location))?;
        let mut cursor = ByteCursor::new(data, self.order);
        (0..count).map(|_| number.real(&mut cursor)).collect()
    }
}

/// Returns the error for a file that expands to more numbers than its length allows.
pub(super) fn too_many(location: Location) -> Error {
    let problem = "the file expands to more numbers than a file of this length may have".to_owned();
    Error::new(ErrorKind::TooLarge, location, problem, "save it without compression, or in several files")
}
