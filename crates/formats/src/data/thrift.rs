//! Values in Thrift's compact protocol, in which Parquet describes its tables.
//!
//! Source: Apache Thrift, `thrift-compact-protocol.md`.

use crate::bytes::ByteCursor;
use crate::error::Error;

/// A value. Fields of a structure have numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ThriftValue<'a> {
    /// An integer, or a truth value as 0 or 1.
    Number(i64),
    Bytes(&'a [u8]),
    List(Vec<ThriftValue<'a>>),
    Struct(Vec<(i64, ThriftValue<'a>)>),
    /// A value of a type that Parquet does not use for columns.
    Other,
}

/// Deepest nesting of structures and lists.
const MAX_DEPTH: usize = 32;

impl<'a> ThriftValue<'a> {
    /// Reads a structure.
    pub fn structure(cursor: &mut ByteCursor<'a>) -> Result<Self, Error> {
        fields(cursor, 0)
    }

    /// Returns the field with this number of a structure.
    pub fn field(&self, id: i64) -> Option<&ThriftValue<'a>> {
        let ThriftValue::Struct(fields) = self else { return None };
        fields.iter().find(|(own, _)| *own == id).map(|(_, value)| value)
    }

    pub fn number(&self, id: i64) -> Option<i64> {
        if let ThriftValue::Number(number) = self.field(id)? { Some(*number) } else { None }
    }

    pub fn bytes(&self, id: i64) -> Option<&'a [u8]> {
        if let ThriftValue::Bytes(bytes) = self.field(id)? { Some(bytes) } else { None }
    }

    pub fn list(&self, id: i64) -> &[ThriftValue<'a>] {
        if let Some(ThriftValue::List(values)) = self.field(id) { values } else { &[] }
    }
}

/// Reads an unsigned integer, seven bits in a byte.
pub(super) fn varint(cursor: &mut ByteCursor<'_>) -> Result<u64, Error> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let byte = cursor.u8()?;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Ok(value);
        }
    }
    Err(cursor.malformed("an integer of at most ten bytes", "a longer one"))
}

/// Reads a signed integer.
pub(super) fn zigzag(cursor: &mut ByteCursor<'_>) -> Result<i64, Error> {
    let value = varint(cursor)?;
    Ok((value >> 1) as i64 ^ -((value & 1) as i64))
}

fn fields<'a>(cursor: &mut ByteCursor<'a>, depth: usize) -> Result<ThriftValue<'a>, Error> {
    let (mut found, mut id) = (Vec::new(), 0i64);
    loop {
        let head = cursor.u8()?;
        if head == 0 {
            return Ok(ThriftValue::Struct(found));
        }
        id = if head >> 4 == 0 { zigzag(cursor)? } else { id.wrapping_add((head >> 4).into()) };
        let value = match head & 15 {
            1 => ThriftValue::Number(1),
            2 => ThriftValue::Number(0),
            kind => value(cursor, kind, depth + 1)?,
        };
        found.push((id, value));
    }
}

fn value<'a>(cursor: &mut ByteCursor<'a>, kind: u8, depth: usize) -> Result<ThriftValue<'a>, Error> {
    if depth > MAX_DEPTH {
        return Err(cursor.malformed("at most 32 nested values", "more"));
    }
    Ok(match kind {
        1..=3 => ThriftValue::Number(cursor.i8()?.into()),
        4..=6 => ThriftValue::Number(zigzag(cursor)?),
        7 => cursor.take(8).map(|_| ThriftValue::Other)?,
        8 => {
            let length = usize::try_from(varint(cursor)?).unwrap_or(usize::MAX);
            ThriftValue::Bytes(cursor.take(length)?)
        }
        9 | 10 => {
            let head = cursor.u8()?;
            let count = if head >> 4 == 15 { varint(cursor)? } else { (head >> 4).into() };
            ThriftValue::List((0..count).map(|_| value(cursor, head & 15, depth + 1)).collect::<Result<_, _>>()?)
        }
        11 => {
            let count = varint(cursor)?;
            let kinds = if count > 0 { cursor.u8()? } else { 0 };
            for _ in 0..count {
                value(cursor, kinds >> 4, depth + 1)?;
                value(cursor, kinds & 15, depth + 1)?;
            }
            ThriftValue::Other
        }
        12 => fields(cursor, depth)?,
        13 => cursor.take(16).map(|_| ThriftValue::Other)?,
        other => return Err(cursor.malformed("a type of the compact protocol", other)),
    })
}
