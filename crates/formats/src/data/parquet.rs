//! Parquet: numbers in columns, also within structures.
//!
//! A null becomes NaN, a truth value 0 or 1. The readers of pages know the encodings plain,
//! dictionary, run length, delta of integers and byte stream split, and the compressions Snappy,
//! gzip and Zstandard.
//! Source: the Apache Parquet format 2.9 (`Encodings.md`, `parquet.thrift`); the format of Snappy.

use super::thrift::{ThriftValue, varint, zigzag};
use super::{Column, DataFile, DataFormat};
use crate::bytes::{ByteCursor, ByteOrder};
use crate::error::{Error, ErrorKind, Location};
use crate::inflate::{Container, DecompressionLimit, inflate};
use std::borrow::Cow;

pub(super) const FORMAT: DataFormat = DataFormat {
    name: "parquet",
    summary: "Apache Parquet (.parquet): columns of numbers, uncompressed or with Snappy, gzip or Zstandard",
    sniff: |bytes| bytes.starts_with(MAGIC),
    read,
};

const MAGIC: &[u8] = b"PAR1";

/// Deepest nesting of structures.
const MAX_DEPTH: usize = 16;

/// Encodings of values.
mod encoding {
    pub const PLAIN: i64 = 0;
    pub const PLAIN_DICTIONARY: i64 = 2;
    pub const RLE: i64 = 3;
    pub const DELTA_BINARY_PACKED: i64 = 5;
    pub const RLE_DICTIONARY: i64 = 8;
    pub const BYTE_STREAM_SPLIT: i64 = 9;
}

/// Types of pages.
mod page {
    pub const DATA: i64 = 0;
    pub const DICTIONARY: i64 = 2;
    pub const DATA_2: i64 = 3;
}

/// The stored type of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StoredType {
    Boolean,
    Int32,
    Int64,
    Float,
    Double,
}

impl StoredType {
    fn size(self) -> usize {
        match self {
            StoredType::Boolean => 1,
            StoredType::Int32 | StoredType::Float => 4,
            StoredType::Int64 | StoredType::Double => 8,
        }
    }
}

/// A column of numbers.
#[derive(Debug, Clone)]
struct Leaf {
    /// Names of the structures and of the column.
    path: Vec<String>,
    stored: StoredType,
    is_unsigned: bool,
    /// Factor of a decimal number.
    factor: f64,
    /// Number of structures, and the column itself, that may be null.
    optional: u32,
}

impl Leaf {
    /// Returns the number of a stored integer.
    fn integer(&self, value: i64) -> f64 {
        self.factor
            * match (self.is_unsigned, self.stored) {
                (true, StoredType::Int32) => f64::from(value as u32),
                (true, _) => value as u64 as f64,
                (false, StoredType::Int32) => f64::from(value as i32),
                (false, _) => value as f64,
            }
    }
}

fn malformed(problem: String) -> Error {
    Error::new(ErrorKind::Malformed, Location::File, problem, "the file is damaged; export or copy it again")
}

fn read(bytes: &[u8]) -> Result<DataFile, Error> {
    let end = bytes.len();
    let tail = end.checked_sub(8).filter(|_| bytes.ends_with(MAGIC));
    let tail = tail.ok_or_else(|| {
        let problem = "the file does not end like a Parquet table".to_owned();
        Error::new(ErrorKind::Truncated, Location::File, problem, "it is not complete; export or copy it again")
    })?;
    let length = ByteCursor::new(&bytes[tail..], ByteOrder::Little).u32()? as usize;
    let begin = tail.checked_sub(length).ok_or_else(|| malformed("the description is longer than the file".into()))?;
    let footer = ThriftValue::structure(&mut ByteCursor::new(&bytes[begin..tail], ByteOrder::Little))?;
    let mut file = DataFile::default();
    let mut schema = Schema { elements: footer.list(2), at: 1, leaves: Vec::new(), skipped: Vec::new() };
    let children = schema.elements.first().and_then(|root| root.number(5)).unwrap_or(0);
    schema.children(children, &Parent::default())?;
    let Schema { leaves, skipped, .. } = schema;
    file.skipped = skipped;
    let limit = DecompressionLimit::for_file(bytes.len());
    let mut numbers = 0u64;
    for (place, leaf) in leaves {
        let mut values = Vec::new();
        for group in footer.list(4) {
            let chunk = group.list(1).get(place).ok_or_else(|| malformed("a group of rows lacks a column".into()))?;
            let rows = group.number(3).and_then(|rows| u64::try_from(rows).ok()).unwrap_or(0);
            numbers = numbers.saturating_add(rows);
            if numbers > limit.numbers() {
                let problem =
                    format!("the columns have more than {} numbers, the limit for this file", limit.numbers());
                return Err(Error::new(ErrorKind::TooLarge, Location::File, problem, "divide the table"));
            }
            let chunk = Chunk { leaf: &leaf, meta: chunk.field(3), rows: rows as usize, limit };
            chunk.read(bytes, &mut values).map_err(|error| {
                Error { location: Location::File, ..error }.with_location(Location::Variable(leaf.path.join(".")))
            })?;
        }
        file.columns.push(Column { name: leaf.path.join("."), values, ..Column::default() });
    }
    Ok(file)
}

/// The tree of columns, depth first.
struct Schema<'a> {
    elements: &'a [ThriftValue<'a>],
    at: usize,
    /// Number of the column among all columns, and the column.
    leaves: Vec<(usize, Leaf)>,
    skipped: Vec<String>,
}

/// The structures around an element.
#[derive(Debug, Clone, Default)]
struct Parent {
    path: Vec<String>,
    optional: u32,
    is_repeated: bool,
}

impl Schema<'_> {
    /// Collects `count` elements and what they contain. Returns the number of columns.
    fn children(&mut self, count: i64, parent: &Parent) -> Result<(), Error> {
        if parent.path.len() > MAX_DEPTH {
            return Err(malformed(format!("structures are nested more than {MAX_DEPTH} times")));
        }
        for _ in 0..count {
            let elements = self.elements;
            let element = elements.get(self.at).ok_or_else(|| malformed("a column has no description".into()))?;
            self.at += 1;
            let name = String::from_utf8_lossy(element.bytes(4).unwrap_or_default()).into_owned();
            let repetition = element.number(3).unwrap_or(0);
            let own = Parent {
                path: [&parent.path[..], &[name]].concat(),
                optional: parent.optional + u32::from(repetition == 1),
                is_repeated: parent.is_repeated || repetition == 2,
            };
            match element.number(5) {
                Some(count) if count > 0 => self.children(count, &own)?,
                _ => self.leaf(element, own),
            }
        }
        Ok(())
    }

    fn leaf(&mut self, element: &ThriftValue<'_>, own: Parent) {
        let number = self.leaves.len() + self.skipped.len();
        let (converted, logical) = (element.number(6), element.field(10));
        // kinds of the union of logical types: decimal 5, date 6, time 7, timestamp 8, integer 10
        let is = |codes: &[i64], kinds: &[i64]| {
            converted.is_some_and(|code| codes.contains(&code))
                || logical.is_some_and(|logical| kinds.iter().any(|kind| logical.field(*kind).is_some()))
        };
        let stored = match element.number(1) {
            Some(0) => Some(StoredType::Boolean),
            Some(1) => Some(StoredType::Int32),
            Some(2) => Some(StoredType::Int64),
            Some(4) => Some(StoredType::Float),
            Some(5) => Some(StoredType::Double),
            _ => None,
        };
        let name = own.path.join(".");
        let reason = match stored {
            _ if own.is_repeated => "is a list",
            _ if is(&[6, 7, 8, 9, 10], &[6, 7, 8]) => "is a date or a time; save it as a number of seconds",
            None => "has no numbers",
            Some(stored) => {
                let signed = logical.and_then(|logical| logical.field(10)).and_then(|integer| integer.number(2));
                let is_unsigned = converted.is_some_and(|code| (11..=14).contains(&code)) || signed == Some(0);
                let scale = if is(&[5], &[5]) { element.number(7).unwrap_or(0) } else { 0 };
                let factor = 10f64.powi(-scale.clamp(0, 300) as i32);
                let leaf = Leaf { path: own.path, stored, is_unsigned, factor, optional: own.optional };
                self.leaves.push((number, leaf));
                return;
            }
        };
        self.skipped.push(format!("`{name}` {reason}"));
    }
}

/// A column in a group of rows.
struct Chunk<'a> {
    leaf: &'a Leaf,
    meta: Option<&'a ThriftValue<'a>>,
    rows: usize,
    limit: DecompressionLimit,
}

impl Chunk<'_> {
    /// Reads all pages and appends their values.
    fn read(&self, bytes: &[u8], values: &mut Vec<f64>) -> Result<(), Error> {
        let meta = self.meta.ok_or_else(|| malformed("the column has no description".into()))?;
        let offset = |id: i64| meta.number(id).and_then(|offset| usize::try_from(offset).ok());
        let codec = meta.number(4).unwrap_or(0);
        // files without dictionary may state the offset 0
        let begin = offset(11).filter(|begin| *begin > 0).into_iter().chain(offset(9)).min();
        let range = begin.zip(offset(7)).and_then(|(begin, length)| Some(begin..begin.checked_add(length)?));
        let pages = range.and_then(|range| bytes.get(range));
        let pages = pages.ok_or_else(|| malformed("the column lies outside of the file".into()))?;
        let mut pages = ByteCursor::new(pages, ByteOrder::Little);
        let end = values.len() + self.rows;
        let mut dictionary = Vec::new();
        while values.len() < end {
            let header = ThriftValue::structure(&mut pages)?;
            let size = |id: i64| header.number(id).and_then(|size| usize::try_from(size).ok()).unwrap_or(usize::MAX);
            let packed = pages.take(size(3))?;
            let body = |from: usize| -> Result<Cow<'_, [u8]>, Error> {
                let (packed, size) = (packed.get(from..), size(2).checked_sub(from));
                let (Some(packed), Some(size)) = (packed, size) else {
                    return Err(malformed("a page is shorter than its levels".into()));
                };
                decompress(packed, codec, size, self.limit)
            };
            match header.number(1) {
                Some(page::DICTIONARY) => {
                    let head = header.field(7);
                    let count = head.and_then(|head| head.number(1)).and_then(|count| usize::try_from(count).ok());
                    dictionary = self.plain(&body(0)?, count.unwrap_or(0))?;
                }
                Some(page::DATA) => {
                    let head = Page::new(header.field(5), 2)?;
                    let body = body(0)?;
                    let mut cursor = ByteCursor::new(&body, ByteOrder::Little);
                    let levels = if self.leaf.optional > 0 {
                        let length = cursor.u32()? as usize;
                        cursor.take(length)?
                    } else {
                        &[]
                    };
                    let rest = cursor.remaining();
                    self.page(&head, levels, cursor.take(rest)?, &dictionary, (values, end))?;
                }
                Some(page::DATA_2) => {
                    let head = Page::new(header.field(8), 4)?;
                    let length = |id| header.field(8).and_then(|head| head.number(id)).unwrap_or(0).max(0) as usize;
                    let (repetition, definition) = (length(6), length(5));
                    let from = repetition.saturating_add(definition);
                    let is_plain = header.field(8).and_then(|head| head.number(7)) == Some(0);
                    let levels = packed.get(repetition..from);
                    let levels = levels.ok_or_else(|| malformed("a page is shorter than its levels".into()))?;
                    let values_of_page = if is_plain { Cow::Borrowed(&packed[from..]) } else { body(from)? };
                    self.page(&head, levels, &values_of_page, &dictionary, (values, end))?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Appends the values of a page, and NaN for every null, up to `end` values.
    fn page(
        &self,
        head: &Page,
        levels: &[u8],
        body: &[u8],
        dictionary: &[f64],
        (values, end): (&mut Vec<f64>, usize),
    ) -> Result<(), Error> {
        if head.count == 0 || values.len() + head.count > end {
            return Err(malformed(format!("a page has {} values, more or less than its group", head.count)));
        }
        let most = self.leaf.optional;
        let levels = if most > 0 { runs(levels, u32::BITS - most.leading_zeros(), head.count)? } else { Vec::new() };
        let there = if most > 0 { levels.iter().filter(|level| **level == most).count() } else { head.count };
        let found = match head.encoding {
            encoding::PLAIN => self.plain(body, there)?,
            encoding::PLAIN_DICTIONARY | encoding::RLE_DICTIONARY if there > 0 => {
                let width = body.first().copied().unwrap_or(0).into();
                let entry = |number: &u32| dictionary.get(*number as usize).copied();
                let entries: Option<Vec<f64>> =
                    runs(&body[1.min(body.len())..], width, there)?.iter().map(entry).collect();
                entries.ok_or_else(|| malformed("a value lies outside of the dictionary".into()))?
            }
            encoding::PLAIN_DICTIONARY | encoding::RLE_DICTIONARY => Vec::new(),
            encoding::RLE if self.leaf.stored == StoredType::Boolean => {
                runs(body.get(4..).unwrap_or_default(), 1, there)?.into_iter().map(f64::from).collect()
            }
            encoding::DELTA_BINARY_PACKED => {
                deltas(body, there)?.into_iter().map(|value| self.leaf.integer(value)).collect()
            }
            encoding::BYTE_STREAM_SPLIT => {
                let size = self.leaf.stored.size();
                let bytes: Option<Vec<u8>> =
                    (0..there * size).map(|i| body.get(i % size * there + i / size).copied()).collect();
                self.plain(&bytes.ok_or_else(|| malformed("a page ends too early".into()))?, there)?
            }
            other => return Err(unsupported(format!("the encoding {other}"))),
        };
        if most == 0 {
            values.extend(found);
        } else {
            let mut found = found.into_iter();
            values.extend(
                levels.iter().map(|level| if *level == most { found.next().unwrap_or(f64::NAN) } else { f64::NAN }),
            );
        }
        Ok(())
    }

    /// Reads `count` values that follow one another.
    fn plain(&self, bytes: &[u8], count: usize) -> Result<Vec<f64>, Error> {
        let stored = self.leaf.stored;
        let length =
            if stored == StoredType::Boolean { count.div_ceil(8) } else { count.saturating_mul(stored.size()) };
        let mut cursor = ByteCursor::new(bytes, ByteOrder::Little);
        if length > cursor.remaining() {
            return Err(malformed(format!("a page ends before its {count} values")));
        }
        let mut one = |i: usize| {
            Ok(match stored {
                StoredType::Boolean => f64::from(bytes[i / 8] >> (i % 8) & 1),
                StoredType::Int32 => self.leaf.integer(cursor.i32()?.into()),
                StoredType::Int64 => self.leaf.integer(cursor.i64()?),
                StoredType::Float => cursor.f32()?.into(),
                StoredType::Double => cursor.f64()?,
            })
        };
        (0..count).map(&mut one).collect()
    }
}

/// The header of a page of values.
struct Page {
    count: usize,
    encoding: i64,
}

impl Page {
    /// Reads the header, whose field number `encoding` is the encoding of the values.
    fn new(header: Option<&ThriftValue<'_>>, encoding: i64) -> Result<Page, Error> {
        let number = |id: i64| header.and_then(|header| header.number(id));
        match (number(1).map(usize::try_from), number(encoding)) {
            (Some(Ok(count)), Some(encoding)) => Ok(Page { count, encoding }),
            _ => Err(malformed("a page has no header".into())),
        }
    }
}

fn unsupported(what: String) -> Error {
    Error::new(
        ErrorKind::Unsupported,
        Location::File,
        format!("{what} is not supported"),
        "save the table with Snappy, or as CSV",
    )
}

/// Returns the `size` decompressed bytes of a page.
fn decompress(packed: &[u8], codec: i64, size: usize, limit: DecompressionLimit) -> Result<Cow<'_, [u8]>, Error> {
    if size as u64 / 8 > limit.numbers() {
        let problem = format!("a page of {size} bytes is larger than the limit for this file");
        return Err(Error::new(ErrorKind::TooLarge, Location::File, problem, "save the table without compression"));
    }
    let plain = match codec {
        0 => return Ok(Cow::Borrowed(packed)),
        1 => snappy(packed, size)?,
        2 => inflate(packed, Container::Gzip, limit, &Location::File)?,
        6 => inflate(packed, Container::Zstandard, limit, &Location::File)?,
        3 => return Err(unsupported("the compression LZO".into())),
        4 => return Err(unsupported("the compression Brotli".into())),
        5 | 7 => return Err(unsupported("the compression LZ4".into())),
        other => return Err(unsupported(format!("the compression {other}"))),
    };
    if plain.len() == size {
        Ok(Cow::Owned(plain))
    } else {
        Err(malformed(format!("a page has {} bytes instead of {size}", plain.len())))
    }
}

/// Decompresses `size` bytes of Snappy: literals, and copies of earlier bytes.
fn snappy(packed: &[u8], size: usize) -> Result<Vec<u8>, Error> {
    let mut cursor = ByteCursor::new(packed, ByteOrder::Little);
    if varint(&mut cursor)? != size as u64 {
        return Err(malformed("a page has another length than its header states".into()));
    }
    let mut plain = Vec::new();
    while cursor.remaining() > 0 {
        let tag = cursor.u8()?;
        let high = usize::from(tag >> 2);
        let (length, back) = match tag & 3 {
            0 => {
                let length = match high {
                    60.. => {
                        cursor.take(high - 59)?.iter().rev().fold(0, |length, byte| length << 8 | usize::from(*byte))
                    }
                    short => short,
                };
                plain.extend_from_slice(cursor.take(length + 1)?);
                continue;
            }
            1 => (4 + (high & 7), usize::from(tag >> 5) << 8 | usize::from(cursor.u8()?)),
            2 => (high + 1, cursor.u16()?.into()),
            _ => (high + 1, cursor.u32()? as usize),
        };
        let from = plain.len().checked_sub(back).filter(|_| back > 0 && plain.len() + length <= size);
        let from = from.ok_or_else(|| malformed("the compressed part is damaged".into()))?;
        // a copy may overlap its own end
        (from..from + length).for_each(|i| plain.push(plain[i]));
    }
    Ok(plain)
}

/// Reads `count` numbers of `width` bits: runs of one number, and packed groups of eight.
fn runs(bytes: &[u8], width: u32, count: usize) -> Result<Vec<u32>, Error> {
    if width > 32 {
        return Err(malformed(format!("numbers of {width} bits")));
    }
    let mut cursor = ByteCursor::new(bytes, ByteOrder::Little);
    let mut numbers = Vec::new();
    while numbers.len() < count {
        let left = count - numbers.len();
        let head = varint(&mut cursor)?;
        let length = usize::try_from(head >> 1).unwrap_or(usize::MAX);
        if head & 1 == 1 {
            let packed = cursor.take(length.saturating_mul(width as usize).min(cursor.remaining()))?;
            let packed = unpack(packed, width, left.min(length.saturating_mul(8)))?;
            numbers.extend(packed.into_iter().map(|number| number as u32));
        } else {
            let value = cursor.take(width.div_ceil(8) as usize)?;
            let value = value.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
            numbers.resize(numbers.len() + left.min(length), value);
        }
    }
    Ok(numbers)
}

/// Reads numbers of `width` bits, low bits first.
fn unpack(bytes: &[u8], width: u32, count: usize) -> Result<Vec<u64>, Error> {
    if width > 64 || bytes.len() as u64 * 8 < count as u64 * u64::from(width) {
        return Err(malformed("a page ends too early".into()));
    }
    let number = |i: usize| {
        let first = i as u64 * u64::from(width);
        (0..u64::from(width)).fold(0, |number, bit| {
            let at = first + bit;
            number | u64::from(bytes[(at / 8) as usize] >> (at % 8) & 1) << bit
        })
    };
    Ok((0..count).map(number).collect())
}

/// Reads integers that are stored as differences, in blocks.
fn deltas(bytes: &[u8], count: usize) -> Result<Vec<i64>, Error> {
    let mut cursor = ByteCursor::new(bytes, ByteOrder::Little);
    let (block, parts) = (varint(&mut cursor)?, varint(&mut cursor)?);
    let total = varint(&mut cursor)?;
    let per_part = block.checked_div(parts).filter(|size| *size > 0 && size % 8 == 0 && *size <= 1 << 20);
    let per_part = per_part.ok_or_else(|| malformed("blocks of integers have no valid size".into()))? as usize;
    if total < count as u64 {
        return Err(malformed(format!("a page has {total} integers instead of {count}")));
    }
    let mut value = zigzag(&mut cursor)?;
    let mut values = if count > 0 { vec![value] } else { Vec::new() };
    while values.len() < count {
        let least = zigzag(&mut cursor)?;
        let widths = cursor.take(usize::try_from(parts).unwrap_or(usize::MAX))?;
        for width in widths {
            let left = count - values.len();
            if left == 0 {
                break;
            }
            // the last part may be cut
            let length = per_part / 8 * usize::from(*width);
            let packed = cursor.take(length.min(cursor.remaining()))?;
            for delta in unpack(packed, (*width).into(), left.min(per_part))? {
                value = value.wrapping_add(least).wrapping_add(delta as i64);
                values.push(value);
            }
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the specification of encodings: 0 to 7 with three bits, and a run.
    #[test]
    fn runs_are_those_of_the_specification() {
        let packed = [0x03, 0b1000_1000, 0b1100_0110, 0b1111_1010, 0x08, 0x05];
        let found = runs(&packed, 3, 12).expect("numbers");
        assert_eq!(found, [0, 1, 2, 3, 4, 5, 6, 7, 5, 5, 5, 5]);
        assert!(runs(&packed[..3], 3, 8).is_err() && runs(&packed, 33, 8).is_err());
    }

    /// The first example of the specification: 1 to 5 in one block of 128.
    #[test]
    fn differences_are_those_of_the_specification() {
        let bytes = [0x80, 0x01, 0x04, 0x05, 0x02, 0x02, 0, 0, 0, 0];
        assert_eq!(deltas(&bytes, 5).expect("integers"), [1, 2, 3, 4, 5]);
        assert!(deltas(&bytes, 6).is_err());
    }

    #[test]
    fn copies_of_snappy_may_overlap() {
        // "ab", then 6 bytes from two bytes before
        assert_eq!(snappy(&[8, 1 << 2, b'a', b'b', 5 << 2 | 2, 2, 0], 8).expect("bytes"), b"abababab");
        assert!(snappy(&[8, 1 << 2, b'a', b'b', 5 << 2 | 2, 3, 0], 8).is_err());
    }
}
