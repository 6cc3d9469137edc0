//! Nastran OUTPUT2 (`.op2`): the matrices among its data blocks. Tables are listed, but not read.
//!
//! The file is a sequence of Fortran records. A record of one integer is a key: the number of words
//! in the next record, or a mark if it is zero or negative. Integers have four bytes, or eight in
//! 64-bit files. After an optional label, each data block has its name, a trailer with its sizes,
//! the name again, and its contents up to the key 0. The contents of a matrix are its columns. Each
//! record in a column begins with the row of its first number. Symmetric matrices are complete. A
//! second matrix of the same name is listed as `KAA#2`.
//!
//! Source: NX Nastran DMAP Programmer's Guide, module OUTPUT2; the trailer as in module MATMOD.

use crate::bytes::{ByteCursor, ByteOrder};
use crate::error::{Error, Location};
use crate::format::{COMPLEX, Format, Item};
use crate::matrix::{Matrix, Symmetry, TripletBuilder};

pub(crate) const FORMAT: Format = Format {
    name: "nastran-op2",
    summary: "Nastran OUTPUT2 (.op2), its matrices",
    sniff: |bytes| Op2Cursor::new(bytes).is_some(),
    open,
};

/// Most words in a date, title, name or trailer.
const MAX_HEAD: i64 = 1024;

/// A cursor over the records of a file.
#[derive(Clone)]
struct Op2Cursor<'a> {
    bytes: ByteCursor<'a>,
    /// Number of bytes of an integer.
    whole: usize,
}

/// A matrix, without its columns.
struct Op2Matrix {
    name: String,
    rows: usize,
    columns: usize,
    /// 1 and 2 are real numbers of single and double precision, 3 and 4 complex ones.
    kind: i64,
}

impl<'a> Op2Cursor<'a> {
    /// Returns a cursor if the file begins with the key of a date or of a name.
    fn new(bytes: &'a [u8]) -> Option<Self> {
        [ByteOrder::Little, ByteOrder::Big].into_iter().find_map(|order| {
            let whole = ByteCursor::new(bytes, order).u32().ok()? as usize;
            if whole != 4 && whole != 8 {
                return None;
            }
            let cursor = Op2Cursor { bytes: ByteCursor::new(bytes, order), whole };
            let mut start = cursor.clone();
            let words = start.key().ok()?;
            let named = (words == 2 || words == 3) && start.record().ok()?.len() == words as usize * whole;
            named.then_some(cursor)
        })
    }

    fn record(&mut self) -> Result<&'a [u8], Error> {
        let length = self.bytes.u32()? as usize;
        let data = self.bytes.take(length)?;
        let behind = self.bytes.u32()? as usize;
        if behind == length {
            Ok(data)
        } else {
            Err(self.bytes.malformed(&format!("the length {length} after a record"), behind))
        }
    }

    fn integer(&self, record: &mut ByteCursor) -> Result<i64, Error> {
        if self.whole == 8 { record.i64() } else { record.i32().map(i64::from) }
    }

    fn key(&mut self) -> Result<i64, Error> {
        let location = self.bytes.clone();
        let record = self.record()?;
        if record.len() != self.whole {
            return Err(location.malformed("a key", format_args!("a record of {} bytes", record.len())));
        }
        self.integer(&mut ByteCursor::new(record, self.bytes.order))
    }

    /// Reads keys that have no meaning.
    fn skip_keys(&mut self, count: usize) -> Result<(), Error> {
        (0..count).try_for_each(|_| self.key().map(|_| ()))
    }

    /// Reads a key and the record of as many words.
    fn head(&mut self) -> Result<&'a [u8], Error> {
        let location = self.bytes.clone();
        match self.key()? {
            words if (1..=MAX_HEAD).contains(&words) => self.record(),
            words => Err(location.malformed("the number of words in a record", words)),
        }
    }

    /// Skips the label at the beginning of a file.
    fn skip_label(&mut self) -> Result<(), Error> {
        if self.clone().key()? == 3 {
            (0..3).try_for_each(|_| self.head().map(|_| ()))?;
            self.skip_keys(2)?;
        }
        Ok(())
    }

    /// Reads the start of a data block: its name, its trailer, and whether it is a matrix. Returns
    /// `None` at the end of the file.
    fn block(&mut self) -> Result<Option<(String, Vec<i64>, bool)>, Error> {
        // many files have no mark at their end
        if self.bytes.remaining() == 0 || self.clone().key()? == 0 {
            return Ok(None);
        }
        let name: Vec<u8> = self.head()?.iter().copied().filter(u8::is_ascii_graphic).collect();
        self.skip_keys(1)?;
        let mut record = ByteCursor::new(self.head()?, self.bytes.order);
        let mut trailer = Vec::new();
        while record.remaining() >= self.whole {
            trailer.push(self.integer(&mut record)?);
        }
        self.skip_keys(3)?;
        self.head()?;
        self.skip_keys(2)?;
        let is_matrix = self.key()? > 0;
        Ok(Some((String::from_utf8_lossy(&name).into_owned(), trailer, is_matrix)))
    }

    /// Reads the records of a data block up to its end, each with its place and the number of its
    /// group. A group is a column of a matrix.
    fn contents(
        &mut self,
        mut each: impl FnMut(usize, ByteCursor<'a>, &'a [u8]) -> Result<(), Error>,
    ) -> Result<(), Error> {
        for group in 0.. {
            let mut key = self.key()?;
            if key == 0 {
                break;
            }
            while key > 0 {
                let location = self.bytes.clone();
                each(group, location, self.record()?)?;
                key = self.key()?;
            }
            // after the last column, the second key is 0, as before a table
            self.skip_keys(2)?;
        }
        Ok(())
    }
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let mut file = Op2Cursor::new(bytes).ok_or_else(|| {
        ByteCursor::new(bytes, ByteOrder::Little).malformed("the key of a label or of a name", "something else")
    })?;
    file.skip_label()?;
    let mut items = Vec::new();
    loop {
        let location = file.bytes.clone();
        let Some((mut name, trailer, is_matrix)) = file.block()? else { break };
        let earlier = items.iter().filter(|item: &&Item| item.variable.name.split('#').next() == Some(&name)).count();
        if earlier > 0 {
            name = format!("{name}#{}", earlier + 1);
        }
        let start = file.clone();
        file.contents(|_, _, _| Ok(()))?;
        if !is_matrix {
            items.push(Item::not_a_matrix(name, "table"));
            continue;
        }
        let wrong = || location.malformed("a trailer with columns, rows and type of a matrix", "something else");
        let size = |at: usize| trailer.get(at).and_then(|size| u32::try_from(*size).ok()).ok_or_else(wrong);
        let (columns, rows) = (size(1)? as usize, size(2)? as usize);
        let kind = trailer.get(4).copied().filter(|kind| (1..=4).contains(kind)).ok_or_else(wrong)?;
        items.push(match kind {
            1 | 2 => {
                let matrix = Op2Matrix { name: name.clone(), rows, columns, kind };
                Item::new(name, rows, columns, move || matrix.read(start.clone()))
            }
            _ => Item::not_a_matrix(name, COMPLEX),
        });
    }
    Ok(items)
}

impl Op2Matrix {
    fn read(&self, mut file: Op2Cursor<'_>) -> Result<Matrix, Error> {
        let (order, whole) = (file.bytes.order, file.whole);
        let double = self.kind == 2 || whole == 8;
        let start = file.clone();
        let mut triplets = TripletBuilder::new(self.rows, self.columns, 0, Location::Variable(self.name.clone()))?;
        file.contents(|column, location, record| {
            let place = location.location();
            let at_record = |error: Error| Error { location: place.clone(), ..error };
            let mut record = ByteCursor::new(record, order);
            let first = start.integer(&mut record).map_err(at_record)?;
            let mut row = usize::try_from(first - 1).map_err(|_| location.malformed("a row from 1", first))?;
            while record.remaining() > 0 {
                let value = if double { record.f64() } else { record.f32().map(f64::from) };
                triplets.push(row, column, value.map_err(at_record)?, place.clone())?;
                row = row.saturating_add(1);
            }
            Ok(())
        })?;
        triplets.finish(Symmetry::General)
    }
}

#[cfg(test)]
mod tests {
    /// Writes a file with the matrix `[[2, 0, -1], [0, 0, 0.5]]`, a table and a complex matrix. The
    /// second column is empty, and the third is divided into two records.
    fn file(big: bool, whole: usize, double: bool, labelled: bool) -> Vec<u8> {
        let mut bytes = Vec::new();
        let int = |value: i64| -> Vec<u8> {
            let all = if big { value.to_be_bytes() } else { value.to_le_bytes() };
            if big { all[8 - whole..].to_vec() } else { all[..whole].to_vec() }
        };
        let real = |value: f64| -> Vec<u8> {
            match (double || whole == 8, big) {
                (true, true) => value.to_be_bytes().to_vec(),
                (true, false) => value.to_le_bytes().to_vec(),
                (false, true) => (value as f32).to_be_bytes().to_vec(),
                (false, false) => (value as f32).to_le_bytes().to_vec(),
            }
        };
        let mut record = |data: Vec<u8>| {
            let length = (data.len() as u32).to_le_bytes();
            let length = if big { (data.len() as u32).to_be_bytes() } else { length };
            bytes.extend([&length[..], &data, &length[..]].concat());
        };
        let name = |name: &str| format!("{name:width$}", width = 2 * whole).into_bytes();
        if labelled {
            for (words, data) in [(3, [int(11), int(28), int(26)].concat()), (7, vec![b'N'; 7 * whole]), (2, name("X"))]
            {
                record(int(words));
                record(data);
            }
            record(int(-1));
            record(int(0));
        }
        let kind = if double { 2 } else { 1 };
        for (title, trailer, is_matrix) in [
            ("KAA", [101, 3, 2, 2, kind, 2, 0], 1),
            ("GEOM1", [102, 0, 0, 0, 0, 0, 0], 0),
            ("CAA", [103, 1, 1, 6, 4, 2, 0], 1),
        ] {
            record(int(2));
            record(name(title));
            record(int(-1));
            record(int(7));
            record(trailer.iter().flat_map(|word| int(*word)).collect());
            [-2, 1, 0].iter().for_each(|key| record(int(*key)));
            record(int(2));
            record(name(title));
            [-3, 1, is_matrix].iter().for_each(|key| record(int(*key)));
            let words = |count: i64| int(1 + count);
            match title {
                "KAA" => {
                    record(words(1));
                    record([int(1), real(2.0)].concat());
                    [-4, 1, 1, -5, 1, 1].iter().for_each(|key| record(int(*key)));
                    for (row, value) in [(1, -1.0), (2, 0.5)] {
                        record(words(1));
                        record([int(row), real(value)].concat());
                    }
                    [-6, 1, 0, 0].iter().for_each(|key| record(int(*key)));
                }
                "GEOM1" => {
                    record(int(2));
                    record([int(4), int(5)].concat());
                    [-4, 1, 0, 0].iter().for_each(|key| record(int(*key)));
                }
                _ => {
                    record(int(5));
                    record([int(1), 1f64.to_le_bytes().to_vec(), 2f64.to_le_bytes().to_vec()].concat());
                    [-4, 1, 0, 0].iter().for_each(|key| record(int(*key)));
                }
            }
        }
        record(int(0));
        bytes
    }

    #[test]
    fn matrices_of_every_precision_and_byte_order_are_read() {
        for (big, whole, double, labelled) in [
            (false, 4, true, true),
            (true, 4, true, false),
            (false, 4, false, false),
            (true, 4, false, true),
            (false, 8, true, true),
            (true, 8, false, false),
        ] {
            let bytes = file(big, whole, double, labelled);
            let listed = crate::list_bytes(&bytes, None).unwrap();
            let texts: Vec<String> = listed.iter().map(ToString::to_string).collect();
            assert_eq!(texts, ["KAA (2 x 3)", "GEOM1 (table)", "CAA (complex)"]);
            let found = crate::read_bytes(&bytes, None, Some("KAA")).unwrap();
            let expected = [[2.0, 0.0, -1.0], [0.0, 0.0, 0.5]];
            assert!((0..2).all(|i| (0..3).all(|k| found.get(i, k) == expected[i][k])), "{big} {whole} {double}");
            assert_eq!(found.origin().format, "nastran-op2");
        }
    }

    /// A file that ends between two data blocks has fewer of them.
    #[test]
    fn incomplete_files_are_errors() {
        let bytes = file(false, 4, true, true);
        let mut shorter = Vec::new();
        for end in 0..bytes.len() - 12 {
            let found = crate::list_bytes(&bytes[..end], Some("nastran-op2"));
            shorter.extend(found.ok().map(|found| found.len()));
        }
        assert_eq!(shorter, [0, 1, 2]);
    }
}
