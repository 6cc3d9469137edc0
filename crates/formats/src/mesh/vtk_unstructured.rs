//! Unstructured grids of VTK (`.vtu`): ParaView, PyVista, meshio.
//!
//! Arrays may be text, base64, or appended behind the tree, raw or base64; they may be compressed
//! by zlib. Points have the numbers of `GlobalNodeId` or `GlobalPointIds`, otherwise from one;
//! cells from one. An array of integers 0 and 1 on points or cells becomes the set of its name.
//!
//! Source: VTK file formats, "XML file formats"; `vtkCellType.h`.

use super::builder::{MeshBuilder, SetKind};
use super::shape::{Family, Shape};
use super::{MeshFile, MeshFormat};
use crate::bytes::{ByteCursor, ByteOrder, NumberType};
use crate::error::{Error, ErrorKind, Location};
use crate::inflate::{Container, DecompressionLimit, inflate};
use crate::text::{Line, real};

pub(super) const FORMAT: MeshFormat =
    MeshFormat { name: "vtk-unstructured", summary: "unstructured grids of VTK (.vtu)", sniff, read };

/// Cell types in `vtkCellType.h`, with their family, without and with middle nodes.
const CELL_TYPES: [(u8, Family, bool); 12] = [
    (5, Family::Triangle, false),
    (9, Family::Quadrilateral, false),
    (10, Family::Tetrahedron, false),
    (12, Family::Hexahedron, false),
    (13, Family::Wedge, false),
    (14, Family::Pyramid, false),
    (22, Family::Triangle, true),
    (23, Family::Quadrilateral, true),
    (24, Family::Tetrahedron, true),
    (25, Family::Hexahedron, true),
    (26, Family::Wedge, true),
    (27, Family::Pyramid, true),
];

/// Returns the number of a shape in `vtkCellType.h`.
pub fn vtk_cell_type(shape: Shape) -> u8 {
    let found =
        CELL_TYPES.iter().find(|(_, family, quadratic)| (*family, *quadratic) == (shape.family, shape.quadratic));
    found.expect("every shape has a cell type").0
}

fn sniff(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(2000)];
    find(head, b"<VTKFile").is_some() && find(head, b"\"UnstructuredGrid\"").is_some()
}

fn find(bytes: &[u8], text: &[u8]) -> Option<usize> {
    bytes.windows(text.len()).position(|window| window == text)
}

/// A tag, with the text up to the next one.
#[derive(Clone, Copy)]
struct Tag<'a> {
    /// Name and attributes, without brackets.
    head: &'a [u8],
    text: &'a [u8],
    /// Byte of the file at which it begins.
    at: usize,
}

impl<'a> Tag<'a> {
    fn name(&self) -> &'a [u8] {
        self.head.split(|byte| byte.is_ascii_whitespace()).next().unwrap_or_default()
    }

    fn attribute(&self, name: &str) -> Option<String> {
        let text = String::from_utf8_lossy(self.head).into_owned();
        let start = text.match_indices(name).find(|(at, _)| {
            text[..*at].ends_with(char::is_whitespace) && text[at + name.len()..].trim_start().starts_with('=')
        })?;
        let mut parts = text[start.0 + name.len()..].trim_start().get(1..)?.trim_start().split(['"', '\'']);
        parts.next();
        parts.next().map(str::to_owned)
    }

    fn malformed(&self, problem: String) -> Error {
        Error::new(ErrorKind::Malformed, Location::Byte(self.at), problem, "write the file again, or save it as text")
    }
}

/// Returns the tags before the appended data, and these data.
fn tags(bytes: &[u8]) -> (Vec<Tag<'_>>, &[u8]) {
    let (mut tags, mut at) = (Vec::new(), 0);
    while let Some(open) = bytes[at..].iter().position(|byte| *byte == b'<').map(|open| at + open) {
        let Some(close) = bytes[open..].iter().position(|byte| *byte == b'>').map(|close| open + close) else { break };
        let next = bytes[close..].iter().position(|byte| *byte == b'<').map_or(bytes.len(), |next| close + next);
        let tag = Tag { head: &bytes[open + 1..close], text: &bytes[close + 1..next], at: open };
        tags.push(tag);
        if tag.name() == b"AppendedData" {
            let data =
                bytes[close..].iter().position(|byte| *byte == b'_').map_or(&[][..], |at| &bytes[close + at + 1..]);
            return (tags, data);
        }
        at = next;
    }
    (tags, &[])
}

/// Encoding of the arrays of a file.
struct Encoding<'a> {
    header: NumberType,
    order: ByteOrder,
    compressed: bool,
    appended: &'a [u8],
    appended_base64: bool,
    limit: DecompressionLimit,
}

/// An array: its numbers, and whether they are integers.
struct DataArray {
    values: Vec<f64>,
    is_integer: bool,
}

fn number_type(name: &str) -> Option<NumberType> {
    Some(match name {
        "Int8" => NumberType::I8,
        "UInt8" => NumberType::U8,
        "Int16" => NumberType::I16,
        "UInt16" => NumberType::U16,
        "Int32" => NumberType::I32,
        "UInt32" => NumberType::U32,
        "Int64" => NumberType::I64,
        "UInt64" => NumberType::U64,
        "Float32" => NumberType::F32,
        "Float64" => NumberType::F64,
        _ => return None,
    })
}

impl Encoding<'_> {
    fn array(&self, tag: &Tag) -> Result<DataArray, Error> {
        let kind = tag.attribute("type").unwrap_or_default();
        let number = number_type(&kind).ok_or_else(|| tag.malformed(format!("an array has the type `{kind}`")))?;
        let is_integer = !matches!(number, NumberType::F32 | NumberType::F64);
        let format = tag.attribute("format").unwrap_or_else(|| "ascii".to_owned());
        let bytes = match format.as_str() {
            "ascii" => {
                let words = tag.text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
                let number = |word: &[u8]| {
                    real(word)
                        .ok_or_else(|| tag.malformed(format!("`{}` is not a number", String::from_utf8_lossy(word))))
                };
                return Ok(DataArray { values: words.map(number).collect::<Result<_, _>>()?, is_integer });
            }
            "binary" => self.decode(tag, tag.text.trim_ascii(), true)?,
            "appended" => {
                let offset = tag.attribute("offset").and_then(|offset| offset.parse::<usize>().ok());
                let data = offset.and_then(|offset| self.appended.get(offset..));
                let data = data.ok_or_else(|| tag.malformed("the data of an array lie beyond the end".to_owned()))?;
                self.decode(tag, data, self.appended_base64)?
            }
            other => return Err(tag.malformed(format!("an array has the format `{other}`"))),
        };
        let mut cursor = ByteCursor::new(&bytes, self.order);
        let mut values = Vec::with_capacity(bytes.len() / number.size());
        while cursor.remaining() >= number.size() {
            values.push(number.real(&mut cursor)?);
        }
        Ok(DataArray { values, is_integer })
    }

    /// Decodes one array: a header with its size, or the sizes of its compressed blocks, then the
    /// data. Base64 encodes the header of compressed data separately.
    fn decode(&self, tag: &Tag, data: &[u8], base64: bool) -> Result<Vec<u8>, Error> {
        let short = || tag.malformed("the data of an array end too early".to_owned());
        let part = |from: usize, count: usize| -> Result<Vec<u8>, Error> {
            match base64 {
                true => decode_base64(data.get(from..).unwrap_or_default(), count).ok_or_else(short),
                false => data.get(from..).and_then(|data| data.get(..count)).map(<[u8]>::to_vec).ok_or_else(short),
            }
        };
        let sizes = |bytes: &[u8]| -> Result<Vec<usize>, Error> {
            let mut cursor = ByteCursor::new(bytes, self.order);
            (0..bytes.len() / self.header.size()).map(|_| self.header.index(&mut cursor)).collect()
        };
        let word = self.header.size();
        if !self.compressed {
            let count = sizes(&part(0, word)?)?[0];
            let whole = part(0, word.checked_add(count).filter(|whole| *whole <= data.len()).ok_or_else(short)?)?;
            return Ok(whole[word..].to_vec());
        }
        let blocks = sizes(&part(0, word)?)?[0];
        let header = blocks.checked_add(3).and_then(|n| n.checked_mul(word)).filter(|n| *n <= data.len());
        let header = header.ok_or_else(short)?;
        let sizes = sizes(&part(0, header)?)?;
        let start = if base64 { header.div_ceil(3) * 4 } else { header };
        let total = sizes[3..].iter().try_fold(0usize, |sum, size| sum.checked_add(*size));
        let packed = part(start, total.filter(|total| *total <= data.len()).ok_or_else(short)?)?;
        let (mut all, mut at) = (Vec::new(), 0);
        for size in &sizes[3..] {
            all.extend(inflate(&packed[at..at + size], Container::Zlib, self.limit, &Location::Byte(tag.at))?);
            at += size;
        }
        Ok(all)
    }
}

/// Decodes the first `count` bytes; `None` if there are fewer, or another character.
fn decode_base64(text: &[u8], count: usize) -> Option<Vec<u8>> {
    let characters = count.checked_mul(4)?.div_ceil(3);
    let value = |byte: u8| match byte {
        b'A'..=b'Z' => Some(byte - b'A'),
        b'a'..=b'z' => Some(byte - b'a' + 26),
        b'0'..=b'9' => Some(byte - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let mut bytes = Vec::with_capacity(count.min(text.len()));
    let (mut bits, mut held) = (0u32, 0);
    for byte in text.get(..characters)? {
        (bits, held) = (bits << 6 | u32::from(value(*byte)?), held + 6);
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
        }
    }
    Some(bytes)
}

fn read(file: &MeshFile<'_>, builder: &mut MeshBuilder) -> Result<(), Error> {
    let (tags, appended) = tags(file.bytes);
    let root = tags.iter().find(|tag| tag.name() == b"VTKFile");
    let of_root = |name: &str| root.and_then(|tag| tag.attribute(name));
    let compressor = of_root("compressor");
    if let Some(other) = compressor.as_deref().filter(|name| *name != "vtkZLibDataCompressor") {
        let problem = format!("the arrays are compressed by {other}");
        let remedy = "save the file as text, or compressed by zlib";
        return Err(Error::new(ErrorKind::Unsupported, Location::File, problem, remedy));
    }
    let last = tags.last().filter(|tag| tag.name() == b"AppendedData");
    let encoding = Encoding {
        header: if of_root("header_type").as_deref() == Some("UInt64") { NumberType::U64 } else { NumberType::U32 },
        order: if of_root("byte_order").as_deref() == Some("BigEndian") { ByteOrder::Big } else { ByteOrder::Little },
        compressed: compressor.is_some(),
        appended,
        appended_base64: last.is_some_and(|tag| tag.attribute("encoding").as_deref() == Some("base64")),
        limit: DecompressionLimit::for_file(file.bytes.len()),
    };
    let pieces: Vec<usize> = (0..tags.len()).filter(|at| tags[*at].name() == b"Piece").collect();
    let [piece] = pieces[..] else {
        let problem = format!("the file has {} pieces", pieces.len());
        let remedy = "merge them to one piece, as in ParaView by `Clean to Grid`";
        return Err(Error::new(ErrorKind::Unsupported, Location::File, problem, remedy));
    };
    Piece::read(&tags[piece..], &encoding)?.add(builder)
}

/// The arrays of a piece.
struct Piece<'a> {
    tag: Tag<'a>,
    points: Vec<f64>,
    connectivity: Vec<f64>,
    offsets: Vec<f64>,
    types: Vec<f64>,
    /// Sets of points and of cells.
    sets: Vec<(String, SetKind, Vec<f64>)>,
    numbers: Option<Vec<f64>>,
}

impl<'a> Piece<'a> {
    fn read(tags: &[Tag<'a>], encoding: &Encoding) -> Result<Piece<'a>, Error> {
        let empty = Vec::new;
        let mut piece = Piece {
            tag: tags[0],
            points: empty(),
            connectivity: empty(),
            offsets: empty(),
            types: empty(),
            sets: Vec::new(),
            numbers: None,
        };
        let mut section: &[u8] = b"";
        for tag in tags {
            let name = tag.attribute("Name").unwrap_or_default();
            match (tag.name(), section, name.as_str()) {
                (b"Points" | b"Cells" | b"PointData" | b"CellData", ..) => section = tag.name(),
                (b"DataArray", b"Points", _) => piece.points = encoding.array(tag)?.values,
                (b"DataArray", b"Cells", "connectivity") => piece.connectivity = encoding.array(tag)?.values,
                (b"DataArray", b"Cells", "offsets") => piece.offsets = encoding.array(tag)?.values,
                (b"DataArray", b"Cells", "types") => piece.types = encoding.array(tag)?.values,
                (b"DataArray", b"PointData", "GlobalNodeId" | "GlobalPointIds") => {
                    piece.numbers = Some(encoding.array(tag)?.values);
                }
                (b"DataArray", b"PointData" | b"CellData", _)
                    if tag.attribute("type").is_some_and(|t| t.contains("Int")) =>
                {
                    let DataArray { values, is_integer } = encoding.array(tag)?;
                    if is_integer && values.contains(&1.0) && values.iter().all(|value| *value == 0.0 || *value == 1.0)
                    {
                        let kind = if section == b"PointData" { SetKind::Nodes } else { SetKind::Elements };
                        piece.sets.push((name, kind, values));
                    }
                }
                (b"/Piece", ..) => break,
                _ => {}
            }
        }
        Ok(piece)
    }

    fn add(self, builder: &mut MeshBuilder) -> Result<(), Error> {
        // the builder locates its errors by lines; here the numbers of points and cells say where
        let line = Line { text: b"", number: 0 };
        let located = |error: Error| Error { location: Location::Byte(self.tag.at), ..error };
        let number = |point: usize| match &self.numbers {
            Some(numbers) => numbers.get(point).map_or(0, |number| *number as i64),
            None => point as i64 + 1,
        };
        for (point, position) in self.points.chunks_exact(3).enumerate() {
            builder.node(number(point), [position[0], position[1], position[2]], &line).map_err(located)?;
        }
        let count = self.points.len() / 3;
        let mut from = 0;
        for (cell, (offset, kind)) in self.offsets.iter().zip(&self.types).enumerate() {
            let to = *offset as usize;
            let points = self.connectivity.get(from..to.max(from));
            let points = points.ok_or_else(|| self.tag.malformed(format!("cell {} has no points", cell + 1)))?;
            from = to.max(from);
            // points and lines
            if matches!(*kind as i64, 1 | 3 | 21) {
                continue;
            }
            let shape = CELL_TYPES.iter().find(|(code, ..)| i64::from(*code) == *kind as i64);
            let shape = shape.map(|&(_, family, quadratic)| Shape { family, quadratic });
            let Some(shape) = shape else {
                builder.leave_out(&format!("{kind} of VTK"));
                continue;
            };
            let inside = |point: &f64| (*point >= 0.0 && (*point as usize) < count).then(|| number(*point as usize));
            let nodes: Option<Vec<i64>> = points.iter().map(inside).collect();
            let nodes =
                nodes.ok_or_else(|| self.tag.malformed(format!("a point of cell {} does not exist", cell + 1)))?;
            builder.element(cell as i64 + 1, shape, &nodes, &line).map_err(located)?;
        }
        for (name, kind, values) in &self.sets {
            let members = values.iter().enumerate().filter(|(_, value)| **value == 1.0).map(|(at, _)| match kind {
                SetKind::Nodes => number(at),
                _ => at as i64 + 1,
            });
            builder.add(name, *kind, members);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::mesh::{Mesh, read_bytes};

    fn file(arrays: &str, root: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\" {root}>\n\
             <UnstructuredGrid>\n<Piece NumberOfPoints=\"4\" NumberOfCells=\"2\">\n{arrays}</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
        )
    }

    const TEXT: &str = "<Points>\n<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\n0 0 0 2 0 0\n0 3 0 0 0 1\n</DataArray>\n</Points>\n\
        <Cells>\n<DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2 3 0 2 1</DataArray>\n\
        <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">4 7</DataArray>\n<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10 5</DataArray>\n</Cells>\n\
        <PointData>\n<DataArray type=\"Int32\" Name=\"FOOT\" format=\"ascii\">1 1 1 0</DataArray>\n<DataArray type=\"Float64\" Name=\"T\" format=\"ascii\">1 0 0 1</DataArray>\n\
        <DataArray type=\"Int64\" Name=\"GlobalNodeId\" format=\"ascii\">11 12 13 14</DataArray>\n</PointData>\n\
        <CellData>\n<DataArray type=\"Int32\" Name=\"PLATE\" format=\"ascii\">0 1</DataArray>\n</CellData>\n";

    fn check(mesh: &Mesh) {
        assert_eq!((mesh.nodes().len(), mesh.elements().len(), mesh.format()), (4, 2, "vtk-unstructured"));
        for name in ["FOOT", "PLATE"] {
            let patch = mesh.patch(name).unwrap();
            assert!((patch.area() - 3.0).abs() < 1e-14 && patch.nodes()[0].normal == [0.0, 0.0, -1.0], "{name}");
        }
    }

    #[test]
    fn arrays_of_text() {
        let mesh = read_bytes(file(TEXT, "").as_bytes()).unwrap();
        check(&mesh);
        assert_eq!((mesh.nodes()[0].number, mesh.sets().len()), (11, 2));
    }

    /// The points, 4 bytes of size and 96 of data, by Python's `base64.b64encode`.
    #[test]
    fn arrays_of_base64_and_appended_ones() {
        let encoded = "YAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAABAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAACEAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAADwPw==";
        let plain = "format=\"ascii\">\n0 0 0 2 0 0\n0 3 0 0 0 1\n</DataArray>";
        let inline = TEXT.replace(plain, &format!("format=\"binary\">\n{encoded}\n</DataArray>"));
        check(&read_bytes(file(&inline, "header_type=\"UInt32\"").as_bytes()).unwrap());
        let points: [f64; 12] = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 1.0];
        let raw: Vec<u8> = points.iter().flat_map(|x| x.to_le_bytes()).collect();
        let mut appended = file(&TEXT.replace(plain, "format=\"appended\" offset=\"2\"/>"), "header_type=\"UInt64\"");
        appended.truncate(appended.len() - "</VTKFile>\n".len());
        let bytes = [
            appended.as_bytes(),
            b"<AppendedData encoding=\"raw\">_..",
            &96u64.to_le_bytes(),
            &raw,
            b"</AppendedData>",
        ];
        check(&read_bytes(&bytes.concat()).unwrap());
    }

    #[test]
    fn damaged_files_are_refused() {
        for (text, words) in [
            (file(TEXT, "compressor=\"vtkLZ4DataCompressor\""), "LZ4"),
            (file(&TEXT.replace("0 1 2 3 0 2 1", "0 1 2 9 0 2 1"), ""), "a point of cell 1"),
            (file(&TEXT.replace("4 7<", "4 9<"), ""), "cell 2 has no points"),
            (file(&TEXT.replace("0 3 0", "0 x 0"), ""), "`x`"),
            (file(&TEXT.replace("format=\"ascii\">4 7", "format=\"binary\">CAAA"), ""), "end too early"),
            (file(&TEXT.replace("10 5", "24 5"), ""), "the 10 nodes of element 1"),
        ] {
            let error = read_bytes(text.as_bytes()).map(|_| ()).expect_err(&text);
            assert!(error.to_string().contains(words), "{words}: {error}");
        }
    }
}
