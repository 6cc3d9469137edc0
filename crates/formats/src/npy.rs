//! NumPy `.npy`: a header in Python notation, then the numbers.
//!
//! ```text
//! \x93NUMPY 1 0 <length> {'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }
//! ```
//! Source: NumPy Enhancement Proposal 1, A Simple File Format for NumPy Arrays.

use crate::bytes::{ByteCursor, ByteOrder, NumberType};
use crate::error::{Error, ErrorKind, Location};
use crate::format::{COMPLEX, Format, Item};
use crate::matrix::{DenseLayout, Matrix, StorageOrder, from_dense};
use crate::text::quoted;

pub(crate) const FORMAT: Format = Format {
    name: "npy",
    summary: "NumPy (.npy): a dense array of one or two dimensions, `numpy.save`",
    sniff: |bytes| bytes.starts_with(MAGIC),
    open,
};

pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";

/// The type of the elements of an array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ElementType {
    Number(NumberType),
    /// Complex, with the type of its parts if it is supported.
    Complex(Option<NumberType>),
    /// Text of the given number of bytes.
    Text(usize),
    /// Any other type, by NumPy's name.
    Other(String),
}

/// An array whose header is read, and whose numbers are not read yet.
pub(crate) struct NpyArray<'a> {
    pub element: ElementType,
    pub shape: Vec<usize>,
    fortran: bool,
    data: ByteCursor<'a>,
}

/// Real and imaginary parts of an array, by columns; no imaginary parts if the array is real.
pub(crate) struct ComplexParts {
    pub real: Vec<f64>,
    pub imaginary: Vec<f64>,
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let item = match NpyArray::new(bytes)?.size() {
        Ok((rows, columns)) => Item::new("", rows, columns, move || NpyArray::new(bytes)?.matrix()),
        Err(note) => Item::not_a_matrix("", note),
    };
    Ok(vec![item])
}

impl<'a> NpyArray<'a> {
    pub fn new(bytes: &'a [u8]) -> Result<Self, Error> {
        // Maximum length of a header. A longer one is damaged, because a plain array has one
        // type and few dimensions.
        let longest_header: usize = 4096;
        let mut data = ByteCursor::new(bytes, ByteOrder::Little);
        if data.take(MAGIC.len())? != MAGIC {
            return Err(data.malformed("the signature of NumPy", "something else"));
        }
        let major = data.u8()?;
        data.skip(1);
        let length = match major {
            1 => data.u16()?.into(),
            2 | 3 => data.u32()? as usize,
            other => return Err(data.malformed("version 1, 2 or 3", other)),
        };
        if length > longest_header {
            return Err(data.malformed(&format!("a header of at most {longest_header} bytes"), length));
        }
        let at = data.clone();
        let header = data.take(length)?;
        let (element, fortran, shape) = std::str::from_utf8(header)
            .ok()
            .and_then(|text| {
                let shape = shape(text)?;
                Some((value(text, "descr")?, value(text, "fortran_order")?.starts_with("True"), shape))
            })
            .ok_or_else(|| at.malformed("a header with descr, fortran_order and shape", quoted(header)))?;
        let (element, order) = element_of(element);
        data.order = order;
        Ok(Self { element, shape, fortran, data })
    }

    /// Returns rows and columns, or a description of an array that is not a matrix.
    pub fn size(&self) -> Result<(usize, usize), String> {
        match &self.element {
            ElementType::Number(_) => {}
            ElementType::Complex(_) => return Err(COMPLEX.into()),
            ElementType::Text(_) => return Err("text".into()),
            ElementType::Other(name) => return Err(format!("an array of type {name}")),
        }
        match self.shape[..] {
            [] => Ok((1, 1)),
            [rows] => Ok((rows, 1)),
            [rows, columns] => Ok((rows, columns)),
            _ => Err(format!("an array of {} dimensions", self.shape.len())),
        }
    }

    /// Reads the numbers in file order.
    pub fn numbers<T>(
        mut self,
        read: impl Fn(NumberType, &mut ByteCursor) -> Result<T, Error>,
    ) -> Result<Vec<T>, Error> {
        let ElementType::Number(number) = self.element else {
            return Err(self.data.malformed("an array of numbers", format!("{:?}", self.element)));
        };
        let count = self.count(number)?;
        (0..count).map(|_| read(number, &mut self.data)).collect()
    }

    /// Reads real and imaginary parts, by columns; the imaginary part of real numbers is empty.
    /// Returns `None` for an array of another type.
    pub fn columns(mut self) -> Result<Option<ComplexParts>, Error> {
        let (number, parts) = match self.element {
            ElementType::Number(number) => (number, 1),
            ElementType::Complex(Some(number)) => (number, 2),
            _ => return Ok(None),
        };
        let rows = self.shape.first().copied().unwrap_or(1);
        let across = self.shape.get(1).copied().unwrap_or(1);
        let stated = rows.checked_mul(across).and_then(|count| count.checked_mul(parts));
        if stated.is_none_or(|stated| stated > self.data.remaining() / number.size()) {
            // the error with the numbers in it
            self.shape.push(parts);
            self.count(number)?;
        }
        let mut planes = vec![vec![0.0; rows * across]; parts];
        for at in 0..rows * across {
            let place = if self.fortran { at } else { at % across * rows + at / across };
            for plane in &mut planes {
                plane[place] = number.real(&mut self.data)?;
            }
        }
        let imaginary = if parts == 2 { planes.pop() } else { None };
        Ok(Some(ComplexParts { real: planes.pop().unwrap_or_default(), imaginary: imaginary.unwrap_or_default() }))
    }

    /// Returns the bytes of an array of one text.
    pub fn text(mut self) -> Result<&'a [u8], Error> {
        match self.element {
            ElementType::Text(length) => self.data.take(length),
            ref other => Err(self.data.malformed("a text", format!("{other:?}"))),
        }
    }

    /// Returns the number of elements. Fails if the file does not have enough bytes.
    fn count(&self, number: NumberType) -> Result<usize, Error> {
        let count = self.shape.iter().try_fold(1_usize, |product, &size| product.checked_mul(size));
        let room = self.data.remaining() / number.size();
        match count {
            Some(count) if count <= room => Ok(count),
            _ => Err(Error::new(
                ErrorKind::Truncated,
                self.data.location(),
                format!("the header states the shape {:?}, but the file contains {room} numbers", self.shape),
                "the file is not complete; export or copy it again",
            )),
        }
    }

    pub fn matrix(self) -> Result<Matrix, Error> {
        let size = self.size().map_err(|note| {
            let kind = if matches!(self.element, ElementType::Complex(_)) {
                ErrorKind::Complex
            } else {
                ErrorKind::Unsupported
            };
            let remedy = "save a real array of two dimensions";
            Error::new(kind, Location::File, format!("this is not a real matrix: {note}"), remedy)
        });
        let (rows, columns) = size?;
        let ElementType::Number(number) = self.element else {
            return Err(self.data.malformed("an array of numbers", format!("{:?}", self.element)));
        };
        // All numbers are in the file, so no position lies beyond the end.
        self.count(number)?;
        let order = if self.fortran { StorageOrder::Columns } else { StorageOrder::Rows };
        from_dense(DenseLayout { rows, columns, order }, &self.data.location(), |at| {
            number.real(&mut self.data.ahead(at * number.size()))
        })
    }
}

/// Returns the text after a key of the header.
fn value<'t>(header: &'t str, key: &str) -> Option<&'t str> {
    let (_, rest) = header.split_once(&format!("'{key}'"))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

fn shape(header: &str) -> Option<Vec<usize>> {
    let (inside, _) = value(header, "shape")?.strip_prefix('(')?.split_once(')')?;
    // Python 2 wrote long integers with an L.
    let sizes = inside.split(',').map(|size| size.trim().trim_end_matches('L')).filter(|size| !size.is_empty());
    sizes.map(|size| size.parse().ok()).collect()
}

/// Returns the type and the byte order of a descr such as `'<f8'`.
fn element_of(descr: &str) -> (ElementType, ByteOrder) {
    let other = |name: &str| (ElementType::Other(name.chars().take(20).collect()), ByteOrder::Little);
    let Some(name) = descr.strip_prefix('\'').and_then(|rest| rest.split_once('\'')).map(|(name, _)| name) else {
        return other("a record");
    };
    let order = if name.starts_with('>') { ByteOrder::Big } else { ByteOrder::Little };
    let element = match name.trim_start_matches(['<', '>', '|', '=']) {
        "b1" | "u1" => ElementType::Number(NumberType::U8),
        "i1" => ElementType::Number(NumberType::I8),
        "i2" => ElementType::Number(NumberType::I16),
        "u2" => ElementType::Number(NumberType::U16),
        "i4" => ElementType::Number(NumberType::I32),
        "u4" => ElementType::Number(NumberType::U32),
        "i8" => ElementType::Number(NumberType::I64),
        "u8" => ElementType::Number(NumberType::U64),
        "f4" => ElementType::Number(NumberType::F32),
        "f8" => ElementType::Number(NumberType::F64),
        "c8" => ElementType::Complex(Some(NumberType::F32)),
        "c16" => ElementType::Complex(Some(NumberType::F64)),
        "c32" => ElementType::Complex(None),
        text => match (text.strip_prefix('S'), text.strip_prefix('U')) {
            (Some(length), _) if length.parse::<usize>().is_ok() => ElementType::Text(length.parse().unwrap_or(0)),
            // Four bytes per character.
            (_, Some(length)) if length.parse::<u32>().is_ok() => {
                ElementType::Text(length.parse::<u32>().map_or(0, |length| length as usize * 4))
            }
            _ => return other(text),
        },
    };
    (element, order)
}

/// Returns an array as a file. `descr` and `shape` are in NumPy's notation.
pub(crate) fn write(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    // Magic, version and length take 10 bytes. The data begins at a multiple of
    // 64, after a line break.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    header.push_str(&" ".repeat(length - header.len() - 1));
    header.push('\n');
    let mut bytes = [MAGIC, &[1, 0], &(length as u16).to_le_bytes(), header.as_bytes()].concat();
    bytes.extend_from_slice(data);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_bytes;

    fn doubles(values: &[f64]) -> Vec<u8> {
        values.iter().flat_map(|value| value.to_le_bytes()).collect()
    }

    #[test]
    fn rows_or_columns_come_first() -> Result<(), Error> {
        let values = doubles(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let c = read_bytes(&write("<f8", "(2, 3)", &values), None, None)?;
        assert_eq!((c.get(0, 1), c.get(1, 0)), (2.0, 4.0));
        let fortran = String::from_utf8_lossy(&write("<f8", "(2, 3)", &[])[10..]).replace("False", "True ");
        let file = [&write("<f8", "(2, 3)", &[])[..10], fortran.as_bytes(), &values].concat();
        let f = read_bytes(&file, None, None)?;
        assert_eq!((f.get(1, 0), f.get(0, 1)), (2.0, 3.0));
        Ok(())
    }

    #[test]
    fn types_and_orders() -> Result<(), Error> {
        let check = |descr, shape, data: &[u8], value| -> Result<(), Error> {
            let matrix = read_bytes(&write(descr, shape, data), None, None)?;
            assert_eq!(matrix.get(matrix.rows() - 1, matrix.columns() - 1), value, "{descr}");
            Ok(())
        };
        check(">f8", "(1, 1)", &1.5_f64.to_be_bytes(), 1.5)?;
        check("<f4", "(2,)", &[0, 0, 0, 0, 0, 0, 0xc0, 0x3f], 1.5)?;
        check(">i2", "()", &[0xff, 0xfe], -2.0)?;
        check("|b1", "(1L, 2L)", &[0, 1], 1.0)?;
        check("<u8", "(1, 1)", &7_u64.to_le_bytes(), 7.0)?;
        Ok(())
    }

    #[test]
    fn errors_state_their_kind() {
        let check = |descr, shape, data: &[u8], kind| {
            let found = read_bytes(&write(descr, shape, data), Some("npy"), None).map(|_| ());
            assert_eq!(found.map_err(|e| e.kind), Err(kind), "{descr} {shape}");
        };
        check("<f8", "(2, 3)", &doubles(&[1.0; 5]), ErrorKind::Truncated);
        check("<f8", "(1, 1)", &doubles(&[f64::NAN]), ErrorKind::NotFinite);
        check("<c16", "(1, 1)", &doubles(&[1.0; 2]), ErrorKind::Complex);
        check("<f8", "(1, 1, 1)", &doubles(&[1.0]), ErrorKind::Unsupported);
        check("|O", "(1, 1)", &doubles(&[1.0]), ErrorKind::Unsupported);
        check("<f8", "(99999999999, 99999999999)", &doubles(&[1.0]), ErrorKind::TooLarge);
        check("<f8", "(-1, 2)", &[], ErrorKind::Malformed);
        check("<f8", "2, 2", &[], ErrorKind::Malformed);
        assert_eq!(read_bytes(MAGIC, None, None).map_err(|e| e.kind), Err(ErrorKind::Truncated));
    }
}
