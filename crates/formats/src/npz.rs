//! NumPy `.npz`: a zip of `.npy` files. A file of SciPy's `save_npz` contains
//! the parts of one sparse matrix.
//!
//! Source: APPNOTE.TXT - .ZIP File Format Specification (PKWARE); SciPy reference,
//! `scipy.sparse.save_npz`.

use std::borrow::Cow;

use crate::bytes::{ByteCursor, ByteOrder, NumberType};
use crate::error::{Error, ErrorKind, Location};
use crate::format::{Format, Item};
use crate::inflate::{Container, DecompressionLimit, beginning, inflate};
use crate::matrix::{Entry, Matrix, Symmetry, TripletBuilder, for_each_compressed};
use crate::npy::{self, NpyArray};
use crate::text::quoted;

pub(crate) const FORMAT: Format = Format {
    name: "npz",
    summary: "NumPy and SciPy (.npz): `numpy.savez`, `scipy.sparse.save_npz` (csc, csr, coo)",
    sniff: is_zip,
    open,
};

/// The supported layouts of SciPy.
const LAYOUTS: &str = "csc, csr or coo";

/// Returns whether the content is a zip.
pub(crate) fn is_zip(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06")
}

/// A member by its name, without the extension `.npy`, and its bytes.
pub(crate) struct MemberContents<'a> {
    pub name: String,
    pub bytes: Result<Cow<'a, [u8]>, Error>,
}

/// Returns the contents of the members.
pub(crate) fn contents(bytes: &[u8]) -> Result<impl Iterator<Item = MemberContents<'_>>, Error> {
    let members = members(bytes)?.into_iter();
    Ok(members.map(|member| MemberContents { name: member.name.clone(), bytes: member.contents() }))
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let members = members(bytes)?;
    let sparse = |name| members.iter().any(|member| member.name == name);
    if sparse("format") && sparse("shape") && sparse("data") {
        let size = array(&find(&members, "shape")?.contents()?)?.numbers(NumberType::index)?;
        let [rows, columns] = size[..] else {
            let location = Location::Variable("shape".into());
            let problem = format!("the array `shape` has {} numbers instead of two", size.len());
            return Err(Error::new(ErrorKind::Unsupported, location, problem, "save a matrix of two dimensions"));
        };
        return Ok(vec![Item::new("", rows, columns, move || read_sparse(&members, rows, columns))]);
    }
    members.into_iter().map(item).collect()
}

/// Returns a member as an item: an array, or something else.
fn item(member: Member) -> Result<Item, Error> {
    let start = member.beginning();
    if !start.starts_with(npy::MAGIC) {
        return Ok(Item::not_a_matrix(member.name.clone(), "not an array"));
    }
    let array = NpyArray::new(&start).map_err(|error| error.with_location(Location::Variable(member.name.clone())))?;
    Ok(match array.size() {
        Ok((rows, columns)) => {
            Item::new(member.name.clone(), rows, columns, move || self::array(&member.contents()?)?.matrix())
        }
        Err(note) => Item::not_a_matrix(member.name.clone(), note),
    })
}

fn array(contents: &[u8]) -> Result<NpyArray<'_>, Error> {
    NpyArray::new(contents)
}

fn find<'m, 'a>(members: &'m [Member<'a>], name: &str) -> Result<&'m Member<'a>, Error> {
    members.iter().find(|member| member.name == name).ok_or_else(|| {
        let problem = format!("the sparse matrix has no array `{name}`");
        Error::new(ErrorKind::Malformed, Location::File, problem, "write the file with scipy.sparse.save_npz")
    })
}

/// Reads the sparse matrix that SciPy stored as several members.
fn read_sparse(members: &[Member], rows: usize, columns: usize) -> Result<Matrix, Error> {
    let part = |name: &str| -> Result<Cow<[u8]>, Error> { find(members, name)?.contents() };
    let indices = |name: &str| -> Result<Vec<usize>, Error> {
        array(&part(name)?)?
            .numbers(NumberType::index)
            .map_err(|error| error.with_location(Location::Variable(name.into())))
    };
    let layout = part("format")?;
    let layout: Vec<u8> = array(&layout)?.text()?.iter().copied().filter(|&byte| byte != 0).collect();
    let data = part("data")?;
    let values = array(&data)?;
    if matches!(values.element, npy::ElementType::Complex(_)) {
        let location = Location::Variable("data".into());
        return Err(Error::new(
            ErrorKind::Complex,
            location,
            "the matrix is complex, but it must be real".into(),
            "save its real part",
        ));
    }
    let values = values.numbers(NumberType::real)?;
    let mut triplets = TripletBuilder::new(rows, columns, values.len(), Location::File)?;
    match &layout[..] {
        b"csc" | b"csr" => {
            let (pointers, inner) = (indices("indptr")?, indices("indices")?);
            let outer = if layout == b"csc" { columns } else { rows };
            for_each_compressed(&pointers, &inner, &values, outer, |outer, inner, value| {
                let (row, column) = if layout == b"csc" { (inner, outer) } else { (outer, inner) };
                triplets.push(row, column, value, Location::Variable("data".into()))
            })?;
        }
        b"coo" => {
            let (row, column) = (indices("row")?, indices("col")?);
            if row.len() != values.len() || column.len() != values.len() {
                let problem = format!(
                    "the arrays have different lengths: {} rows, {} columns, {} values",
                    row.len(),
                    column.len(),
                    values.len()
                );
                return Err(Error::new(
                    ErrorKind::Count,
                    Location::File,
                    problem,
                    "write the file again with scipy.sparse.save_npz",
                ));
            }
            for ((row, column), value) in row.into_iter().zip(column).zip(values) {
                triplets.push(row, column, value, Location::Variable("data".into()))?;
            }
        }
        other => {
            let problem = format!("the matrix is stored as {}; supported are {LAYOUTS}", quoted(other));
            let location = Location::Variable("format".into());
            return Err(Error::new(
                ErrorKind::Unsupported,
                location,
                problem,
                "save it as csc: save_npz(path, matrix.tocsc())",
            ));
        }
    }
    triplets.finish(Symmetry::General)
}

/// A file in a zip.
struct Member<'a> {
    /// Name without the extension `.npy`.
    name: String,
    deflated: bool,
    packed: &'a [u8],
    crc: u32,
    limit: DecompressionLimit,
}

impl<'a> Member<'a> {
    fn location(&self) -> Location {
        Location::Variable(self.name.clone())
    }

    fn beginning(&self) -> Cow<'a, [u8]> {
        // Number of bytes of a member that certainly contain the header of an array.
        let header = 8192;
        match self.deflated {
            true => Cow::Owned(beginning(self.packed, Container::Bare, header)),
            false => Cow::Borrowed(&self.packed[..self.packed.len().min(header)]),
        }
    }

    fn contents(&self) -> Result<Cow<'a, [u8]>, Error> {
        let contents = match self.deflated {
            true => Cow::Owned(inflate(self.packed, Container::Bare, self.limit, &self.location())?),
            false => Cow::Borrowed(self.packed),
        };
        let mut crc = flate2::Crc::new();
        crc.update(&contents);
        if crc.sum() == self.crc {
            return Ok(contents);
        }
        let problem = "the checksum of the member differs from the one in the zip".into();
        Err(Error::new(ErrorKind::Malformed, self.location(), problem, "the file is damaged; copy or export it again"))
    }
}

/// Records of a zip by their signatures.
#[derive(Debug, Clone, Copy)]
enum Record {
    Local = 0x0403_4b50,
    Central = 0x0201_4b50,
    End = 0x0605_4b50,
    End64 = 0x0606_4b50,
    Locator64 = 0x0706_4b50,
}

impl Record {
    fn signature(self) -> u32 {
        self as u32
    }
}

/// Value of a 32-bit field if the number is in the 64-bit extra field.
const IN_EXTRA: usize = u32::MAX as usize;

/// Returns the members of a zip, by its central directory.
fn members(bytes: &[u8]) -> Result<Vec<Member<'_>>, Error> {
    let mut zip = ByteCursor::new(bytes, ByteOrder::Little);
    zip.seek(directory(bytes)?)?;
    let limit = DecompressionLimit::for_file(bytes.len());
    let mut members = Vec::new();
    while zip.clone().u32().is_ok_and(|mark| mark == Record::Central.signature()) {
        zip.skip(8);
        let flags = zip.u16()?;
        let method = zip.u16()?;
        zip.skip(4);
        let crc = zip.u32()?;
        let (packed, full) = (zip.u32()? as usize, zip.u32()? as usize);
        let (name, extra, comment) = (zip.u16()?.into(), zip.u16()?.into(), zip.u16()?.into());
        zip.skip(8);
        let local = zip.u32()? as usize;
        let name = String::from_utf8_lossy(zip.take(name)?).into_owned();
        let extra = zip.take(extra)?;
        zip.skip(comment);
        let [_, packed, local] = sizes_64(extra, [full, packed, local])?;
        let name = name.strip_suffix(".npy").map_or_else(|| name.clone(), str::to_string);
        if flags & 1 != 0 || !matches!(method, 0 | 8) {
            let problem =
                format!("the member is encrypted or compressed with method {method}; only deflate is supported");
            let remedy = "write the file with numpy.savez or numpy.savez_compressed";
            return Err(Error::new(ErrorKind::Unsupported, Location::Variable(name), problem, remedy));
        }
        let mut data = ByteCursor::new(bytes, ByteOrder::Little);
        data.seek(local)?;
        if data.u32()? != Record::Local.signature() {
            return Err(data.malformed("the header of a member of a zip", "something else"));
        }
        data.skip(22);
        let skip = usize::from(data.u16()?) + usize::from(data.u16()?);
        data.skip(skip);
        members.push(Member { name, deflated: method == 8, packed: data.take(packed)?, crc, limit });
    }
    Ok(members)
}

/// Replaces sizes that need 64 bits by those of the extra field.
fn sizes_64<const N: usize>(extra: &[u8], mut sizes: [usize; N]) -> Result<[usize; N], Error> {
    let mut extra = ByteCursor::new(extra, ByteOrder::Little);
    while extra.remaining() >= 4 {
        let (kind, length) = (extra.u16()?, usize::from(extra.u16()?));
        let field = extra.take(length.min(extra.remaining()))?;
        if kind == 1 {
            let mut field = ByteCursor::new(field, ByteOrder::Little);
            for size in sizes.iter_mut().filter(|size| **size == IN_EXTRA) {
                *size = NumberType::U64.index(&mut field)?;
            }
        }
    }
    Ok(sizes)
}

/// Returns the start of the central directory of a zip.
fn directory(bytes: &[u8]) -> Result<usize, Error> {
    // The end record has 22 bytes, followed by a comment of at most 65535 bytes.
    let from = bytes.len().saturating_sub(22 + 65535);
    let mark = Record::End.signature().to_le_bytes();
    let end = bytes[from..].windows(4).rposition(|four| four == mark).map(|at| from + at).ok_or_else(|| {
        let problem = "the zip has no central directory at its end".into();
        Error::new(
            ErrorKind::Truncated,
            Location::Byte(bytes.len()),
            problem,
            "the file is not complete; export or copy it again",
        )
    })?;
    let mut zip = ByteCursor::new(bytes, ByteOrder::Little);
    zip.seek(end + 16)?;
    let start = zip.u32()? as usize;
    if start != IN_EXTRA {
        return Ok(start);
    }
    zip.seek(end.saturating_sub(20))?;
    if zip.u32()? != Record::Locator64.signature() {
        return Ok(start);
    }
    zip.skip(4);
    let record = NumberType::U64.index(&mut zip)?;
    zip.seek(record)?;
    if zip.u32()? != Record::End64.signature() {
        return Err(zip.malformed("the 64-bit end record of a zip", "something else"));
    }
    zip.skip(44);
    NumberType::U64.index(&mut zip)
}

/// Returns a matrix as a file for SciPy's `load_npz`: compressed columns, both
/// triangles, not compressed by deflate.
pub(crate) fn write(matrix: &Matrix) -> Result<Vec<u8>, Error> {
    let mut entries: Vec<Entry> = matrix.both_triangles().collect();
    entries.sort_by_key(|e| (e.column, e.row));
    let largest = i32::MAX as usize;
    if matrix.rows().max(matrix.columns()).max(entries.len()) > largest {
        let problem = format!("more than {largest} rows, columns or entries");
        return Err(Error::new(ErrorKind::TooLarge, Location::File, problem, "write it as Matrix Market"));
    }
    let mut pointers = vec![0_i32; matrix.columns() + 1];
    for e in &entries {
        pointers[e.column as usize + 1] += 1;
    }
    for column in 0..matrix.columns() {
        pointers[column + 1] += pointers[column];
    }
    let shape = [matrix.rows() as i64, matrix.columns() as i64];
    let count = format!("({},)", entries.len());
    let le = |values: &mut dyn Iterator<Item = i32>| values.flat_map(i32::to_le_bytes).collect::<Vec<u8>>();
    let parts = [
        ("indices", npy::write("<i4", &count, &le(&mut entries.iter().map(|e| e.row as i32)))),
        ("indptr", npy::write("<i4", &format!("({},)", pointers.len()), &le(&mut pointers.iter().copied()))),
        ("format", npy::write("|S3", "()", b"csc")),
        ("shape", npy::write("<i8", "(2,)", &shape.iter().flat_map(|size| size.to_le_bytes()).collect::<Vec<u8>>())),
        ("data", npy::write("<f8", &count, &entries.iter().flat_map(|e| e.value.to_le_bytes()).collect::<Vec<u8>>())),
    ];
    zip(&parts)
}

/// Returns a zip with members that are not compressed.
fn zip(parts: &[(&str, Vec<u8>)]) -> Result<Vec<u8>, Error> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    let small = |size: usize| {
        let problem = format!("{size} bytes exceed the limit of a 32-bit zip");
        u32::try_from(size)
            .map_err(|_| Error::new(ErrorKind::TooLarge, Location::File, problem, "write it as Matrix Market"))
    };
    for (name, contents) in parts {
        let name = format!("{name}.npy");
        let mut crc = flate2::Crc::new();
        crc.update(contents);
        let size = small(contents.len())?.to_le_bytes();
        // Version 2.0, no flags, not compressed, with the earliest date of a zip: 1 January 1980.
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        common.extend([crc.sum().to_le_bytes(), size, size].concat());
        common.extend([name.len() as u8, 0, 0, 0]);
        let local = small(bytes.len())?;
        bytes.extend(Record::Local.signature().to_le_bytes());
        bytes.extend(&common);
        bytes.extend(name.as_bytes());
        bytes.extend(contents);
        directory.extend(Record::Central.signature().to_le_bytes());
        directory.extend([20, 0]);
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend(local.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let start = small(bytes.len())?.to_le_bytes();
    let count = (parts.len() as u16).to_le_bytes();
    let length = small(directory.len())?.to_le_bytes();
    bytes.extend(directory);
    bytes.extend(Record::End.signature().to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend([count, count].concat());
    bytes.extend([length, start].concat());
    bytes.extend([0; 2]);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{list_bytes, read_bytes};

    fn ints(values: &[i64]) -> Vec<u8> {
        npy::write(
            "<i8",
            &format!("({},)", values.len()),
            &values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>(),
        )
    }

    fn doubles(values: &[f64]) -> Vec<u8> {
        npy::write(
            "<f8",
            &format!("({},)", values.len()),
            &values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>(),
        )
    }

    fn csc(pointers: &[i64], rows: &[i64], values: &[f64], format: &[u8; 3]) -> Result<Vec<u8>, Error> {
        zip(&[
            ("format", npy::write("|S3", "()", format)),
            ("shape", ints(&[2, 3])),
            ("data", doubles(values)),
            ("indptr", ints(pointers)),
            ("indices", ints(rows)),
        ])
    }

    #[test]
    fn what_is_written_reads_back_with_both_triangles() -> Result<(), Error> {
        let matrix = Matrix::new(3, 3, Symmetry::Symmetric, [(0, 0, 1.0 / 3.0), (2, 0, -1e-300), (2, 2, 5.0)])?;
        let back = read_bytes(&write(&matrix)?, None, None)?;
        assert_eq!((back.is_symmetric(), back.entries()), (true, matrix.entries()));
        Ok(())
    }

    #[test]
    fn several_arrays_are_listed_and_one_is_picked() -> Result<(), Error> {
        let file =
            zip(&[("K", doubles(&[1.0])), ("M", doubles(&[2.0, 3.0])), ("note", npy::write("|S2", "()", b"hi"))])?;
        let listed: Vec<_> = list_bytes(&file, None)?.iter().map(ToString::to_string).collect();
        assert_eq!(listed, ["K (1 x 1)", "M (2 x 1)", "note (text)"]);
        assert_eq!(read_bytes(&file, None, Some("M"))?.get(1, 0), 3.0);
        let several = read_bytes(&file, None, None).map(|_| ()).map_err(|e| e.to_string());
        assert_eq!(
            several,
            Err("the file contains several matrices: K (1 x 1), M (2 x 1), note (text); select one by its name".into())
        );
        assert_eq!(read_bytes(&file, None, Some("C")).map_err(|e| e.kind), Err(ErrorKind::Selection));
        assert_eq!(read_bytes(&file, None, Some("note")).map_err(|e| e.kind), Err(ErrorKind::Unsupported));
        Ok(())
    }

    #[test]
    fn pointers_that_do_not_fit_are_refused() -> Result<(), Error> {
        let good = read_bytes(&csc(&[0, 1, 1, 2], &[1, 0], &[5.0, 6.0], b"csc")?, None, None)?;
        assert_eq!((good.get(1, 0), good.get(0, 2)), (5.0, 6.0));
        let check = |pointers: &[i64], rows: &[i64], format, kind| -> Result<(), Error> {
            let found = read_bytes(&csc(pointers, rows, &[5.0, 6.0], format)?, None, None);
            assert_eq!(found.map_err(|e| e.kind), Err(kind), "{pointers:?} {rows:?}");
            Ok(())
        };
        check(&[0, 1, 2], &[1, 0], b"csc", ErrorKind::Count)?;
        check(&[0, 1, 1, 3], &[1, 0], b"csc", ErrorKind::Count)?;
        check(&[0, 2, 1, 2], &[1, 0], b"csc", ErrorKind::Count)?;
        check(&[1, 1, 1, 2], &[1, 0], b"csc", ErrorKind::Count)?;
        check(&[0, 1, 1, 2], &[2, 0], b"csc", ErrorKind::Count)?;
        check(&[0, 1, 1, 2], &[-1, 0], b"csc", ErrorKind::Malformed)?;
        check(&[0, 1, 1, 2], &[1, 0], b"dia", ErrorKind::Unsupported)?;
        check(&[0, 1, 1, 2], &[1, 0], b"coo", ErrorKind::Malformed)?;
        Ok(())
    }

    #[test]
    fn damage_is_found_by_the_checksum() -> Result<(), Error> {
        let mut file = csc(&[0, 1, 1, 2], &[1, 0], &[5.0, 6.0], b"csc")?;
        let at = file.windows(8).position(|eight| eight == 6.0_f64.to_le_bytes()).unwrap_or_default();
        file[at] ^= 1;
        assert_eq!(read_bytes(&file, None, None).map_err(|e| e.kind), Err(ErrorKind::Malformed));
        let half = &file[..file.len() / 2];
        assert_eq!(read_bytes(half, None, None).map_err(|e| e.kind), Err(ErrorKind::Truncated));
        Ok(())
    }
}
