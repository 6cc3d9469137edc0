//! Dataset 58: a function at a node, such as a time history or a frequency response.
//!
//! The abscissa is even or uneven, the ordinate real or complex, in single or double precision.
//! Text has six or four numbers per line. Binary data follow eleven lines of text; the first line
//! states byte order and length. Over an uneven abscissa, numbers of double precision have an
//! abscissa of single or of double precision, depending on the program.
//! Columns: `N.x`, and `N.y` or `N.real` and `N.imaginary`; N is the position of the dataset.

use super::fields::{Widths, append_numbers, integer_at, integers};
use super::{TextSet, is_delimiter, words};
use crate::bytes::{ByteCursor, ByteOrder, NumberType};
use crate::data::decoded;
use crate::data::{Column, DataFile};
use crate::error::{Error, ErrorKind, Location};
use crate::text::{Line, Lines};

/// Number of lines before the numbers.
const HEADER_LINES: usize = 11;

/// Names of the types of functions, by their number.
const FUNCTIONS: [&str; 20] = [
    "general",
    "time response",
    "auto spectrum",
    "cross spectrum",
    "frequency response function",
    "transmissibility",
    "coherence",
    "auto correlation",
    "cross correlation",
    "power spectral density",
    "energy spectral density",
    "probability density function",
    "spectrum",
    "cumulative frequency distribution",
    "peaks valley",
    "stress/cycles",
    "strain/cycles",
    "orbit",
    "mode indicator function",
    "force pattern",
];

/// The content of the lines before the numbers.
struct FunctionHeader {
    label: String,
    notes: Vec<String>,
    complex: bool,
    double: bool,
    count: usize,
    even: bool,
    first: f64,
    step: f64,
    abscissa: AxisText,
    ordinate: AxisText,
    denominator: AxisText,
}

/// Name and unit of an axis.
struct AxisText {
    name: String,
    unit: String,
}

impl FunctionHeader {
    fn new(lines: &[Line<'_>]) -> Result<Self, Error> {
        let set = TextSet { position: 0, lines: lines.to_vec() };
        let line = |index: usize| set.line(index, "the eleven lines of its header");
        let titles = (0..5).map(|i| line(i).map(|line| words(&line))).collect::<Result<Vec<_>, Error>>()?;
        let notes = titles.into_iter().filter(|text| !text.is_empty() && text != "NONE").collect();
        let entity = line(5)?;
        let format = line(6)?;
        let mut numbers = Vec::new();
        append_numbers(&format, Widths(&[10, 10, 10, 13, 13, 13]), &mut numbers)?;
        let [kind, count, spacing, first, step, ..] = numbers[..] else {
            return Err(format.malformed(
                "type, number of values, spacing, first abscissa and step",
                &format!("{} numbers", numbers.len()),
            ));
        };
        let (double, complex) = match kind as i64 {
            2 => (false, false),
            4 => (true, false),
            5 => (false, true),
            6 => (true, true),
            other => return Err(format.malformed("a type of 2, 4, 5 or 6", &other.to_string())),
        };
        if !(count >= 0.0 && count.fract() == 0.0 && count < 9e15) {
            return Err(format.malformed("a number of values", &count.to_string()));
        }
        let (abscissa, ordinate, denominator) = (axis(&line(7)?), axis(&line(8)?), axis(&line(9)?));
        line(10)?;
        Ok(FunctionHeader {
            label: entity_label(&entity),
            notes,
            complex,
            double,
            count: count as usize,
            even: spacing != 0.0,
            first,
            step,
            abscissa,
            ordinate,
            denominator,
        })
    }

    /// Returns the number of numbers of one value, with its abscissa.
    fn numbers_per_value(&self) -> usize {
        1 + usize::from(self.complex) + usize::from(!self.even)
    }

    fn push_columns(&self, position: usize, numbers: &[f64], file: &mut DataFile) {
        let per = self.numbers_per_value();
        let of =
            |offset: usize| numbers.iter().skip(offset).step_by(per).take(self.count).copied().collect::<Vec<f64>>();
        let values = usize::from(!self.even);
        let abscissa =
            if self.even { (0..self.count).map(|i| self.first + self.step * i as f64).collect() } else { of(0) };
        let unit = match (self.ordinate.unit.as_str(), self.denominator.unit.as_str()) {
            (unit, "") => unit.to_owned(),
            ("", below) => format!("1/({below})"),
            (unit, below) => format!("({unit})/({below})"),
        };
        let mut push = |name: &str, label: String, unit: &str, values: Vec<f64>| {
            let (name, unit) = (format!("{position}.{name}"), unit.to_owned());
            file.columns.push(Column { name, unit, label, values, ..Column::default() });
        };
        let label = [self.label.as_str(), &self.ordinate.name]
            .iter()
            .filter(|text| !text.is_empty())
            .copied()
            .collect::<Vec<_>>()
            .join(", ");
        push("x", self.abscissa.name.clone(), &self.abscissa.unit, abscissa);
        if self.complex {
            push("real", label.clone(), &unit, of(values));
            push("imaginary", label, &unit, of(values + 1));
        } else {
            push("y", label, &unit, of(values));
        }
        for note in &self.notes {
            let note = format!("dataset {position}: {note}");
            if !file.notes.contains(&note) {
                file.notes.push(note);
            }
        }
    }
}

/// Describes the function by its type and its nodes: `frequency response function 12 +z / 3 +x`.
fn entity_label(line: &Line<'_>) -> String {
    let kind = integer_at(line, 0, 5);
    let name = usize::try_from(kind).ok().and_then(|kind| FUNCTIONS.get(kind)).copied();
    let point = |name: (usize, usize), node: (usize, usize), direction: (usize, usize)| {
        let entity = decoded(line.columns(name.0, name.1));
        let node = integer_at(line, node.0, node.1);
        let direction = match integer_at(line, direction.0, direction.1) {
            0 => String::new(),
            number => {
                let sign = if number < 0 { '-' } else { '+' };
                let axis =
                    ["x", "y", "z", "rx", "ry", "rz"].get(number.unsigned_abs() as usize - 1).copied().unwrap_or("?");
                format!(" {sign}{axis}")
            }
        };
        let entity = if entity.is_empty() || entity == "NONE" { String::new() } else { format!("{entity} ") };
        format!("{entity}{node}{direction}")
    };
    let response = point((31, 41), (41, 51), (51, 55));
    let reference = point((56, 66), (66, 76), (76, 80));
    let reference = if reference == "0" { String::new() } else { format!(" / {reference}") };
    format!("{} {response}{reference}", name.unwrap_or("function"))
}

/// Reads the texts of an axis: `I10, 3I5, 2(1X, 20A1)`.
fn axis(line: &Line<'_>) -> AxisText {
    let text = |from: usize, to: usize| {
        let text = decoded(line.columns(from, to));
        if text.eq_ignore_ascii_case("none") { String::new() } else { text }
    };
    AxisText { name: text(26, 46), unit: text(47, 67) }
}

pub(super) fn read_text(set: &TextSet<'_>, file: &mut DataFile) -> Result<(), Error> {
    let header = FunctionHeader::new(&set.lines[..set.lines.len().min(HEADER_LINES)])?;
    let widths = match (header.double, header.even, header.complex) {
        (false, ..) => Widths(&[13]),
        (true, true, _) => Widths(&[20]),
        (true, false, false) => Widths(&[13, 20]),
        (true, false, true) => Widths(&[13, 20, 20]),
    };
    let mut numbers = Vec::new();
    for line in set.lines.iter().skip(HEADER_LINES) {
        append_numbers(line, widths, &mut numbers)?;
    }
    let expected = header.count.saturating_mul(header.numbers_per_value());
    if numbers.len() < expected {
        let location = set.lines.last().map_or(Location::File, Line::location);
        return Err(missing(location, expected, numbers.len()));
    }
    header.push_columns(set.position, &numbers, file);
    Ok(())
}

fn missing(location: Location, expected: usize, found: usize) -> Error {
    let problem = format!("the header of the function states {expected} numbers, but it has {found}");
    Error::new(ErrorKind::Truncated, location, problem, "the file is not complete; export or copy it again")
}

/// Reads a binary dataset: `58b`, byte order, kind of floating-point numbers, lines, bytes.
pub(super) fn read_binary(
    position: usize,
    head: &Line<'_>,
    lines: &mut Lines<'_>,
    file: &mut DataFile,
) -> Result<(), Error> {
    let stated = integers(&Line {
        text: &head.text[head.text.iter().position(|byte| byte.eq_ignore_ascii_case(&b'b')).map_or(0, |at| at + 1)..],
        number: head.number,
    })?;
    let [order, kind, header_lines, bytes, ..] = stated[..] else {
        return Err(
            head.malformed("byte order, kind of numbers, lines and bytes", &format!("{} numbers", stated.len()))
        );
    };
    let order = match order {
        1 => ByteOrder::Little,
        2 => ByteOrder::Big,
        other => return Err(head.malformed("byte order 1 or 2", &other.to_string())),
    };
    if kind != 2 {
        let problem = format!("the numbers have the floating-point format {kind}; only 2, IEEE 754, is supported");
        return Err(Error::new(
            ErrorKind::Unsupported,
            head.location(),
            problem,
            "export the file with IEEE 754 numbers",
        ));
    }
    let header_lines =
        usize::try_from(header_lines).ok().filter(|lines| (HEADER_LINES..=100).contains(lines)).unwrap_or(HEADER_LINES);
    let mut header = Vec::new();
    for _ in 0..header_lines {
        header.push(lines.expect("the header of a function")?);
    }
    let header = FunctionHeader::new(&header)?;
    let data = lines.rest();
    let layout = layout(&header, usize::try_from(bytes).unwrap_or(0), data).ok_or_else(|| {
        let expected = header.count.saturating_mul(header.numbers_per_value());
        missing(lines.location(), expected, data.len() / if header.double { 8 } else { 4 })
    })?;
    let length = layout.bytes(&header);
    if length as i64 != bytes {
        file.notes.push(format!("dataset {position} states {bytes} bytes of numbers, but has {length}"));
    }
    let mut cursor = ByteCursor::new(&data[..length], order);
    let mut numbers = Vec::with_capacity(header.count * header.numbers_per_value());
    for _ in 0..header.count {
        if !header.even {
            numbers.push(layout.abscissa.real(&mut cursor)?);
        }
        for _ in 0..1 + usize::from(header.complex) {
            numbers.push(layout.ordinate.real(&mut cursor)?);
        }
    }
    header.push_columns(position, &numbers, file);
    lines.skip_bytes(length);
    // the delimiter may follow at once, without a line break before it
    for line in lines.by_ref() {
        if is_delimiter(&line) {
            return Ok(());
        }
    }
    file.notes.push(format!("dataset {position} has no delimiter at its end"));
    Ok(())
}

/// Precision of the numbers of a binary function.
#[derive(Debug, Clone, Copy)]
struct BinaryLayout {
    abscissa: NumberType,
    ordinate: NumberType,
}

impl BinaryLayout {
    fn bytes(self, header: &FunctionHeader) -> usize {
        let abscissa = if header.even { 0 } else { self.abscissa.size() };
        header.count.saturating_mul(abscissa + self.ordinate.size() * (1 + usize::from(header.complex)))
    }
}

/// Returns the layout of the numbers in `data`. It is the one after which a delimiter follows,
/// or whose length is the stated one; `None` if the data are too short for every layout.
fn layout(header: &FunctionHeader, stated: usize, data: &[u8]) -> Option<BinaryLayout> {
    let ordinate = if header.double { NumberType::F64 } else { NumberType::F32 };
    let candidates =
        [BinaryLayout { abscissa: ordinate, ordinate }, BinaryLayout { abscissa: NumberType::F32, ordinate }];
    let fitting = || candidates.into_iter().filter(|layout| layout.bytes(header) <= data.len());
    let closed = |layout: &BinaryLayout| {
        let rest = data[layout.bytes(header)..].trim_ascii_start();
        rest.starts_with(b"-1")
    };
    fitting()
        .find(|layout| layout.bytes(header) == stated && closed(layout))
        .or_else(|| fitting().find(closed))
        .or_else(|| fitting().find(|layout| layout.bytes(header) == stated))
        .or_else(|| fitting().next())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::read_bytes;

    /// A file with one function: first line, type, spacing, and the numbers.
    fn function(first: &str, kind: usize, count: usize, even: usize, data: &[u8]) -> Vec<u8> {
        let mut bytes = format!(
            "    -1\n{first}\nNONE\nNONE\nNONE\nNONE\nNONE\n    4         0    0         0 NONE               3  -2 NONE               1   1\n\
             {kind:10}{count:10}{even:10}  1.00000e+00  5.00000e-01  0.00000e+00\n        18    0    0    0 Frequency            Hz                  \n\
             \x20       12    0    0    0 Acceleration         m/s^2               \n        13    0    0    0 Force                N                   \n\
             \x20        0    0    0    0 NONE                 NONE                \n"
        )
        .into_bytes();
        bytes.extend(data);
        bytes.extend(b"    -1\n");
        bytes
    }

    fn check(bytes: &[u8], columns: &[(&str, &[f64])]) {
        let file = read_bytes(bytes).unwrap_or_else(|error| panic!("{error}"));
        let found: Vec<(&str, &[f64])> =
            file.columns.iter().map(|column| (column.name.as_str(), &column.values[..])).collect();
        assert_eq!(found, columns);
        assert_eq!(file.columns[1].unit, "(m/s^2)/(N)");
        assert!(file.columns[1].label.contains("3 -y / 1 +x"), "{}", file.columns[1].label);
    }

    #[test]
    fn every_type_and_spacing_as_text() {
        check(
            &function("    58", 2, 2, 1, b"  1.00000e+00 -2.00000e+00\n"),
            &[("1.x", &[1.0, 1.5]), ("1.y", &[1.0, -2.0])],
        );
        check(
            &function("    58", 2, 2, 0, b"  0.10000e+00  1.00000e+00  0.30000e+00\n  2.00000e+00\n"),
            &[("1.x", &[0.1, 0.3]), ("1.y", &[1.0, 2.0])],
        );
        check(
            &function("    58", 5, 1, 0, b" -1.00000e+00-2.00000e+00-3.00000e+00\n"),
            &[("1.x", &[-1.0]), ("1.real", &[-2.0]), ("1.imaginary", &[-3.0])],
        );
        check(
            &function("    58", 6, 1, 1, b"  1.234567890123E+00 -1.234567890123E+00\n"),
            &[("1.x", &[1.0]), ("1.real", &[1.234567890123]), ("1.imaginary", &[-1.234567890123])],
        );
    }

    #[test]
    fn every_type_order_and_spacing_in_binary() {
        let single: Vec<u8> = [0.5f32, 2.0, 0.75, 3.0].iter().flat_map(|value| value.to_be_bytes()).collect();
        check(
            &function(
                "    58b     2     2          11          16     0     0           0           0",
                2,
                2,
                0,
                &single,
            ),
            &[("1.x", &[0.5, 0.75]), ("1.y", &[2.0, 3.0])],
        );
        let double: Vec<u8> = [0.1f64, 0.2].iter().flat_map(|value| value.to_le_bytes()).collect();
        // a wrong byte count is repaired
        let file = function(
            "    58b     1     2          11          99     0     0           0           0",
            6,
            1,
            1,
            &double,
        );
        check(&file, &[("1.x", &[1.0]), ("1.real", &[0.1]), ("1.imaginary", &[0.2])]);
        assert_eq!(read_bytes(&file).expect("a file").notes.len(), 1);
        // an abscissa of single precision
        let mixed = [&0.5f32.to_le_bytes()[..], &0.1f64.to_le_bytes()].concat();
        check(
            &function(
                "    58b     1     2          11          12     0     0           0           0",
                4,
                1,
                0,
                &mixed,
            ),
            &[("1.x", &[0.5]), ("1.y", &[0.1])],
        );
    }

    #[test]
    fn missing_numbers_are_an_error_with_a_place() {
        let error = read_bytes(&function("    58", 2, 9, 1, b"  1.00000e+00\n")).expect_err("too few numbers");
        assert!(error.to_string().contains("states 9 numbers, but it has 1"), "{error}");
        let file = function(
            "    58b     1     2          11          99     0     0           0           0",
            4,
            999_999_999,
            1,
            &[0; 8],
        );
        let error = read_bytes(&file).expect_err("too few numbers");
        assert_eq!(error.kind, ErrorKind::Truncated, "{error}");
    }
}
