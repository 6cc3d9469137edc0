//! Cursor over binary data in either byte order, which never reads beyond the end.

use crate::error::{Error, ErrorKind, Location};

/// Byte order of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByteOrder {
    Little,
    Big,
}

/// A cursor over binary data.
#[derive(Clone)]
pub(crate) struct ByteCursor<'a> {
    all: &'a [u8],
    at: usize,
    pub order: ByteOrder,
}

macro_rules! number {
    ($($name:ident: $type:ty),*) => {$(
        pub fn $name(&mut self) -> Result<$type, Error> {
            let mut bytes = [0; size_of::<$type>()];
            bytes.copy_from_slice(self.take(size_of::<$type>())?);
            Ok(match self.order {
                ByteOrder::Little => <$type>::from_le_bytes(bytes),
                ByteOrder::Big => <$type>::from_be_bytes(bytes),
            })
        }
    )*};
}

impl<'a> ByteCursor<'a> {
    pub fn new(all: &'a [u8], order: ByteOrder) -> Self {
        Self { all, at: 0, order }
    }

    number! { i8: i8, u8: u8, i16: i16, u16: u16, i32: i32, u32: u32, i64: i64, u64: u64, f32: f32, f64: f64 }

    /// Returns the next `count` bytes.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], Error> {
        let end = self.at.checked_add(count).filter(|&end| end <= self.all.len());
        let end = end.ok_or_else(|| {
            Error::new(
                ErrorKind::Truncated,
                self.location(),
                format!("expected {count} more bytes, but the file ends after {}", self.remaining()),
                "the file is not complete; export or copy it again",
            )
        })?;
        let taken = &self.all[self.at..end];
        self.at = end;
        Ok(taken)
    }

    /// Skips bytes, up to the end.
    pub fn skip(&mut self, count: usize) {
        self.at = self.at.saturating_add(count).min(self.all.len());
    }

    /// Returns a cursor `count` bytes ahead, up to the end.
    pub fn ahead(&self, count: usize) -> Self {
        let mut ahead = self.clone();
        ahead.skip(count);
        ahead
    }

    /// Moves to a byte, counted from zero.
    pub fn seek(&mut self, at: usize) -> Result<(), Error> {
        self.at = 0;
        self.take(at).map(|_| ())
    }

    /// Returns the number of bytes not read yet.
    pub fn remaining(&self) -> usize {
        self.all.len() - self.at
    }

    pub fn location(&self) -> Location {
        Location::Byte(self.at)
    }

    /// Creates an error for unexpected content at this location.
    pub fn malformed(&self, expected: &str, found: impl std::fmt::Display) -> Error {
        Error::new(
            ErrorKind::Malformed,
            self.location(),
            format!("expected {expected}, found {found}"),
            "the file is damaged or has another format; export it again, or state its format",
        )
    }
}

/// Types of numbers in binary files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl NumberType {
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Reads the next number as a real number; integers are exact up to 2^53.
    pub fn real(self, bytes: &mut ByteCursor) -> Result<f64, Error> {
        Ok(match self {
            Self::I8 => bytes.i8()?.into(),
            Self::U8 => bytes.u8()?.into(),
            Self::I16 => bytes.i16()?.into(),
            Self::U16 => bytes.u16()?.into(),
            Self::I32 => bytes.i32()?.into(),
            Self::U32 => bytes.u32()?.into(),
            Self::I64 => bytes.i64()? as f64,
            Self::U64 => bytes.u64()? as f64,
            Self::F32 => bytes.f32()?.into(),
            Self::F64 => bytes.f64()?,
        })
    }

    /// Reads the next number as an index or count from zero.
    pub fn index(self, bytes: &mut ByteCursor) -> Result<usize, Error> {
        let before = bytes.clone();
        let value = self.real(bytes)?;
        // no file holds 2^53 entries, beyond which a number may be rounded
        let is_index = value >= 0.0 && value.fract() == 0.0 && value < (1u64 << 53) as f64;
        if is_index { Ok(value as usize) } else { Err(before.malformed("an index from zero", value)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cursor_reads_both_orders_and_stops_at_the_end() -> Result<(), Error> {
        let bytes = [0, 0, 1, 0, 7];
        assert_eq!(ByteCursor::new(&bytes, ByteOrder::Big).u32()?, 256);
        let mut cursor = ByteCursor::new(&bytes, ByteOrder::Little);
        assert_eq!(cursor.u32()?, 65536);
        assert_eq!(cursor.u16().map_err(|e| (e.kind, e.location)), Err((ErrorKind::Truncated, Location::Byte(4))));
        assert_eq!(cursor.u8()?, 7);
        assert_eq!(cursor.take(usize::MAX).map_err(|e| e.kind), Err(ErrorKind::Truncated));
        assert_eq!(cursor.seek(6).map_err(|e| e.kind), Err(ErrorKind::Truncated));
        cursor.seek(4)?;
        assert_eq!(cursor.remaining(), 1);
        Ok(())
    }

    #[test]
    fn a_negative_index_is_refused_where_it_stands() {
        let bytes = [255; 8];
        let found = NumberType::I64.index(&mut ByteCursor::new(&bytes, ByteOrder::Little));
        assert_eq!(found.map_err(|e| e.location), Err(Location::Byte(0)));
    }
}
