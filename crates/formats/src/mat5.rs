//! MATLAB `.mat` of version 5 to 7: tagged elements, each variable optionally compressed.
//! MATLAB's `save` without `-v7.3` and SciPy's `savemat` write it.
//!
//! The stored type of the numbers may be smaller than their class, for example
//! `uint8` for a `double` array of integers. A small element is stored in its
//! tag. Matrices in structures have names such as `model.K`.
//! Source: MathWorks, MAT-File Format (R2023a), chapter 1.

use std::borrow::Cow;

use crate::bytes::{ByteCursor, ByteOrder, NumberType};
use crate::error::{Error, ErrorKind, Location};
use crate::format::{COMPLEX, Format, Item};
use crate::inflate::{Container, DecompressionLimit, beginning, inflate};
use crate::matrix::{DenseLayout, Matrix, StorageOrder, Symmetry, TripletBuilder, for_each_compressed, from_dense};

pub(crate) const FORMAT: Format = Format {
    name: "matlab",
    summary: "MATLAB (.mat) up to version 7: `save`, `scipy.io.savemat`; full, sparse, in structures",
    sniff: |bytes| order(bytes).is_some(),
    open,
};

/// Size of the file header in bytes: a text, an offset, a version and the byte order.
pub(crate) const HEADER: usize = 128;

/// Number of bytes of a compressed variable that certainly contain its class, size and name.
const BEGINNING: usize = 4096;

/// Maximum depth of nested structures.
pub(crate) const DEPTH: usize = 8;

/// Types of elements.
pub(crate) const MATRIX: u32 = 14;
pub(crate) const COMPRESSED: u32 = 15;

/// Classes of variables.
pub(crate) const STRUCTURE: u8 = 2;
pub(crate) const SPARSE: u8 = 5;

/// Returns the byte order, if the file has a header of version 5.
pub(crate) fn order(bytes: &[u8]) -> Option<ByteOrder> {
    let [major_or_minor @ .., a, b] = bytes.get(HEADER - 4..HEADER)? else { return None };
    match (major_or_minor, [*a, *b]) {
        ([_, 1], [b'I', b'M']) => Some(ByteOrder::Little),
        ([1, _], [b'M', b'I']) => Some(ByteOrder::Big),
        _ => None,
    }
}

/// Returns true if the file begins like version 4, which is another format: a type in decimal
/// digits, sizes, and a name that ends with a zero byte.
pub(crate) fn is_version_4(bytes: &[u8]) -> bool {
    let number = |at: usize, read: fn([u8; 4]) -> u32| Some(read(bytes.get(at..at + 4)?.try_into().ok()?));
    [u32::from_le_bytes, u32::from_be_bytes].into_iter().any(|read| {
        let numbers: Option<Vec<u32>> = (0..5).map(|k| number(4 * k, read)).collect();
        let Some([kind, rows, columns, complex, name]) = numbers.as_deref() else { return false };
        // Digits of the type: thousands are the byte order, hundreds are zero, tens are the
        // number type, ones are full, text or sparse.
        let known = *kind < 5000 && kind / 100 % 10 == 0 && kind / 10 % 10 <= 5 && kind % 10 <= 2;
        let named = bytes.get(20..20 + (*name).min(64) as usize).and_then(<[u8]>::split_last);
        let named =
            named.is_some_and(|(end, name)| *end == 0 && !name.is_empty() && name.iter().all(u8::is_ascii_graphic));
        known && *rows > 0 && *columns > 0 && *complex <= 1 && named
    })
}

/// An element: its type and its bytes.
pub(crate) struct MatElement<'a> {
    pub kind: u32,
    pub data: &'a [u8],
    pub location: Location,
}

/// Reads the next element and moves the cursor after it.
pub(crate) fn element<'a>(bytes: &mut ByteCursor<'a>) -> Result<MatElement<'a>, Error> {
    let location = bytes.location();
    let kind = bytes.u32()?;
    // A small element stores its length in the upper half of its type, and its
    // data in place of the length.
    if kind >> 16 != 0 {
        let length = (kind >> 16) as usize;
        let data = bytes.take(4)?;
        let data = data.get(..length).ok_or_else(|| bytes.malformed("a small element of at most 4 bytes", length))?;
        return Ok(MatElement { kind: kind & 0xffff, data, location });
    }
    let length = bytes.u32()? as usize;
    let data = bytes.take(length)?;
    if kind != COMPRESSED {
        bytes.skip(length.next_multiple_of(8) - length);
    }
    Ok(MatElement { kind, data, location })
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let order = order(bytes)
        .ok_or_else(|| ByteCursor::new(bytes, ByteOrder::Little).malformed("the header of MATLAB 5", "none"))?;
    let mut file = ByteCursor::new(bytes, order);
    file.skip(HEADER);
    let limit = DecompressionLimit::for_file(bytes.len());
    let mut items = Vec::new();
    while file.remaining() >= 8 {
        let MatElement { kind, data, location } = element(&mut file)?;
        let found = match kind {
            MATRIX => variable(VariableBytes { data: Cow::Borrowed(data), packed: None, order, location }),
            COMPRESSED => {
                let start = beginning(data, Container::Zlib, BEGINNING);
                variable(VariableBytes { data: start.into(), packed: Some((data, limit)), order, location })
            }
            _ => continue,
        };
        items.extend(found?);
    }
    Ok(items)
}

/// The bytes of a variable. For a compressed variable, `data` is the beginning
/// and `packed` the whole.
#[derive(Clone)]
struct VariableBytes<'a> {
    data: Cow<'a, [u8]>,
    packed: Option<(&'a [u8], DecompressionLimit)>,
    order: ByteOrder,
    location: Location,
}

impl<'a> VariableBytes<'a> {
    /// Returns all bytes of the variable, after the tag.
    fn whole(&self) -> Result<Cow<'_, [u8]>, Error> {
        let Some((packed, limit)) = self.packed else { return Ok(Cow::Borrowed(&self.data)) };
        let mut all = inflate(packed, Container::Zlib, limit, &self.location)?;
        // Drop the tag of the inner matrix element.
        all.drain(..all.len().min(8));
        Ok(Cow::Owned(all))
    }
}

/// The header of a variable.
pub(crate) struct VariableHeader {
    pub class: u8,
    pub complex: bool,
    pub rows: usize,
    pub columns: usize,
    dimensions: usize,
    pub name: String,
}

pub(crate) fn head(parts: &mut ByteCursor) -> Result<VariableHeader, Error> {
    let flags = element(parts)?;
    let [class, bits] = match (parts.order, flags.data) {
        (ByteOrder::Little, [class, bits, ..]) => [*class, *bits],
        (ByteOrder::Big, [_, _, bits, class, ..]) => [*class, *bits],
        _ => return Err(parts.malformed("the flags of a variable", "less")),
    };
    let sizes = element(parts)?;
    let mut cursor = ByteCursor::new(sizes.data, parts.order);
    let sizes: Vec<usize> =
        (0..sizes.data.len() / 4).map(|_| NumberType::I32.index(&mut cursor)).collect::<Result<_, _>>()?;
    let name = String::from_utf8_lossy(element(parts)?.data).into_owned();
    let [rows, columns, ..] = sizes[..] else {
        return Err(parts.malformed("at least two dimensions", sizes.len()));
    };
    Ok(VariableHeader { class, complex: bits & 8 != 0, rows, columns, dimensions: sizes.len(), name })
}

/// Returns the description of a class that is not a matrix.
pub(crate) fn class_name(class: u8) -> Option<&'static str> {
    match class {
        SPARSE..=15 => None,
        1 => Some("a cell array"),
        STRUCTURE => Some("a structure"),
        3 | 17 => Some("an object"),
        4 => Some("text"),
        16 => Some("a function"),
        _ => Some("a variable of unknown class"),
    }
}

/// Returns the items of one variable: itself, or the matrices of a structure.
fn variable(mut source: VariableBytes) -> Result<Vec<Item>, Error> {
    if source.packed.is_some() {
        let mut inside = ByteCursor::new(&source.data, source.order);
        let kind = inside.u32().map_err(|_| damaged(&source.location))?;
        if kind != MATRIX {
            return Err(damaged(&source.location));
        }
        let rest = source.data.get(8..).unwrap_or_default().to_vec();
        source.data = rest.into();
    }
    let head = head(&mut ByteCursor::new(&source.data, source.order)).map_err(|error| error_in(error, &source))?;
    if head.class == STRUCTURE {
        return structure(&source, &head.name, DEPTH);
    }
    Ok(vec![item(source, head)])
}

fn damaged(location: &Location) -> Error {
    let problem = "the beginning of a compressed variable is damaged".into();
    Error::new(ErrorKind::Malformed, location.clone(), problem, "save or copy the file again")
}

/// Replaces the location of an error, relative to a variable, by the location
/// of the variable in the file.
fn error_in(error: Error, source: &VariableBytes) -> Error {
    Error { location: source.location.clone(), ..error }
}

fn item(source: VariableBytes, head: VariableHeader) -> Item {
    let name = head.name.clone();
    if let Some(note) = class_name(head.class) {
        return Item::not_a_matrix(name, note);
    }
    if head.complex {
        return Item::not_a_matrix(name, COMPLEX);
    }
    if head.dimensions != 2 {
        return Item::not_a_matrix(name, format!("an array of {} dimensions", head.dimensions));
    }
    Item::new(name, head.rows, head.columns, move || {
        let bytes = source.whole()?;
        matrix(&bytes, source.order).map_err(|error| match error.location {
            Location::Byte(_) => error_in(error, &source),
            _ => error,
        })
    })
}

/// Returns the matrices of a structure of one element, as `name.field`.
fn structure<'a>(source: &VariableBytes<'a>, name: &str, depth: usize) -> Result<Vec<Item<'a>>, Error> {
    let whole = source.whole()?;
    let mut parts = ByteCursor::new(&whole, source.order);
    let head = head(&mut parts).map_err(|error| error_in(error, source))?;
    if (head.rows, head.columns, head.dimensions) != (1, 1, 2) || depth == 0 {
        return Ok(vec![Item::not_a_matrix(name, "an array of structures")]);
    }
    let fields = (|| -> Result<_, Error> {
        let length = element(&mut parts)?;
        let length = NumberType::I32.index(&mut ByteCursor::new(length.data, source.order))?;
        let names = element(&mut parts)?.data;
        if length == 0 {
            return Ok(Vec::new());
        }
        let field = |name: &[u8]| {
            let end = name.iter().position(|&byte| byte == 0).unwrap_or(name.len());
            let name = String::from_utf8_lossy(&name[..end]).into_owned();
            Ok((name, element(&mut parts)?))
        };
        names.chunks(length).map(field).collect()
    })();
    let mut items = Vec::new();
    for (field, found) in fields.map_err(|error| error_in(error, source))? {
        let name = format!("{name}.{field}");
        if found.kind != MATRIX || found.data.is_empty() {
            items.push(Item::not_a_matrix(name, "empty"));
            continue;
        }
        // The item owns the decompressed bytes of its structure.
        let inner = VariableBytes {
            data: found.data.to_vec().into(),
            packed: None,
            order: source.order,
            location: source.location.clone(),
        };
        let head =
            self::head(&mut ByteCursor::new(&inner.data, inner.order)).map_err(|error| error_in(error, source))?;
        if head.class == STRUCTURE {
            items.extend(structure(&inner, &name, depth - 1)?);
        } else {
            items.push(item(inner, VariableHeader { name, ..head }));
        }
    }
    Ok(items)
}

/// Returns the number type of an element.
pub(crate) fn number(kind: u32) -> Option<NumberType> {
    Some(match kind {
        1 => NumberType::I8,
        2 => NumberType::U8,
        3 => NumberType::I16,
        4 => NumberType::U16,
        5 => NumberType::I32,
        6 => NumberType::U32,
        7 => NumberType::F32,
        9 => NumberType::F64,
        12 => NumberType::I64,
        13 => NumberType::U64,
        _ => return None,
    })
}

/// Reads all numbers of the next element.
fn numbers<T>(
    parts: &mut ByteCursor,
    read: impl Fn(NumberType, &mut ByteCursor) -> Result<T, Error>,
) -> Result<Vec<T>, Error> {
    let MatElement { kind, data, .. } = element(parts)?;
    let number = number(kind).ok_or_else(|| parts.malformed("numbers", format!("an element of type {kind}")))?;
    let mut data = ByteCursor::new(data, parts.order);
    (0..data.remaining() / number.size()).map(|_| read(number, &mut data)).collect()
}

fn matrix(bytes: &[u8], order: ByteOrder) -> Result<Matrix, Error> {
    let mut parts = ByteCursor::new(bytes, order);
    let VariableHeader { class, rows, columns, .. } = head(&mut parts)?;
    if class == SPARSE {
        let inner = numbers(&mut parts, NumberType::index)?;
        let pointers = numbers(&mut parts, NumberType::index)?;
        let values = numbers(&mut parts, NumberType::real)?;
        let mut triplets = TripletBuilder::new(rows, columns, values.len(), Location::File)?;
        for_each_compressed(&pointers, &inner, &values, columns, |column, row, value| {
            triplets.push(row, column, value, Location::File)
        })?;
        return triplets.finish(Symmetry::General);
    }
    let MatElement { kind, data, .. } = element(&mut parts)?;
    let number = number(kind).ok_or_else(|| parts.malformed("numbers", format!("an element of type {kind}")))?;
    let data = ByteCursor::new(data, order);
    let there = data.remaining() / number.size();
    if rows.checked_mul(columns) != Some(there) {
        let problem = format!("expected {rows} x {columns} numbers, found {there}");
        return Err(Error::new(ErrorKind::Count, Location::File, problem, "save or copy the file again"));
    }
    from_dense(DenseLayout { rows, columns, order: StorageOrder::Columns }, &Location::File, |at| {
        number.real(&mut data.ahead(at * number.size()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{list_bytes, read_bytes};

    /// An element with its tag and padding.
    fn tagged(kind: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    }

    fn words(values: &[i32]) -> Vec<u8> {
        values.iter().flat_map(|value| value.to_le_bytes()).collect()
    }

    /// A variable: class and flags, sizes, name, and its parts.
    fn variable(class: i32, sizes: &[i32], name: &str, parts: &[Vec<u8>]) -> Vec<u8> {
        let head = [tagged(6, &words(&[class, 0])), tagged(5, &words(sizes)), tagged(1, name.as_bytes())];
        tagged(MATRIX, &[head.concat(), parts.concat()].concat())
    }

    fn file(variables: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = vec![b' '; 124];
        bytes.extend([0, 1, b'I', b'M']);
        bytes.extend(variables.concat());
        bytes
    }

    #[test]
    fn doubles_stored_as_bytes_and_small_elements() -> Result<(), Error> {
        // Four numbers of type uint8 within the tag: type 2, length 4.
        let small = [[2, 0, 4, 0], [1, 2, 3, 4]].concat();
        let bytes = file(&[variable(6, &[2, 2], "K", &[small])]);
        let matrix = read_bytes(&bytes, None, None)?;
        assert_eq!((matrix.get(1, 0), matrix.get(0, 1)), (2.0, 3.0));
        assert_eq!(matrix.origin().variable, "K");
        Ok(())
    }

    #[test]
    fn a_structure_gives_the_matrices_in_it() -> Result<(), Error> {
        let one = |value: f64| variable(6, &[1, 1], "", &[tagged(9, &value.to_le_bytes())]);
        let inner = variable(2, &[1, 1], "", &[tagged(5, &words(&[2])), tagged(1, b"M\0"), one(7.0)]);
        let names = [tagged(5, &words(&[4])), tagged(1, b"K\0\0\0sub\0")];
        let bytes = file(&[variable(2, &[1, 1], "model", &[names.concat(), one(5.0), inner])]);
        let listed: Vec<_> = list_bytes(&bytes, None)?.iter().map(ToString::to_string).collect();
        assert_eq!(listed, ["model.K (1 x 1)", "model.sub.M (1 x 1)"]);
        assert_eq!(read_bytes(&bytes, None, Some("model.sub.M"))?.get(0, 0), 7.0);
        Ok(())
    }

    #[test]
    fn errors_state_their_kind() {
        let check = |variable: Vec<u8>, kind| {
            let found = read_bytes(&file(&[variable]), None, Some("K")).map(|_| ());
            assert_eq!(found.map_err(|e| e.kind), Err(kind));
        };
        let double = |value: f64| tagged(9, &value.to_le_bytes());
        check(variable(6, &[2, 1], "K", &[double(1.0)]), ErrorKind::Count);
        check(variable(6, &[-1, 1], "K", &[double(1.0)]), ErrorKind::Malformed);
        check(variable(6, &[1, 1], "K", &[double(f64::INFINITY)]), ErrorKind::NotFinite);
        check(variable(6 + 0x800, &[1, 1], "K", &[double(1.0)]), ErrorKind::Complex);
        check(variable(4, &[1, 1], "K", &[double(1.0)]), ErrorKind::Unsupported);
        check(variable(6, &[1, 1, 1], "K", &[double(1.0)]), ErrorKind::Unsupported);
        check(variable(6, &[2_000_000_000, 2_000_000_000], "K", &[double(1.0)]), ErrorKind::TooLarge);
        check(variable(6, &[1, 1], "K", &[]), ErrorKind::Truncated);
        let sparse = [tagged(5, &words(&[0])), tagged(5, &words(&[0, 2])), double(1.0)];
        check(variable(5, &[1, 1], "K", &sparse), ErrorKind::Count);
        let mut short = file(&[variable(6, &[1, 1], "K", &[double(1.0)])]);
        short.truncate(short.len() - 4);
        assert_eq!(read_bytes(&short, None, None).map_err(|e| e.kind), Err(ErrorKind::Truncated));
    }
}
