//! Fortran format descriptions for lines of fixed fields, such as `(8I10)`,
//! `(1X,8I9)` and `(3(1P,E24.16))`.
//!
//! If a format ends before the numbers do, it restarts on the next line at its last group. A scale
//! factor `kP` holds for all later fields: it multiplies a number without an exponent by `10^k`.
//! Source: ISO/IEC 1539-1 (Fortran 2018), 13.3 to 13.8.

use std::str::from_utf8;

use crate::error::Error;
use crate::text::{Line, Lines, quoted};

/// An edit descriptor, with repetitions expanded.
#[derive(Clone, Copy, Debug, PartialEq)]
enum EditDescriptor {
    /// A number in the next `width` characters. `decimals` is the number of
    /// digits after an implied decimal point.
    Field { width: usize, decimals: usize },
    /// Skips characters, backwards if negative.
    Skip(isize),
    /// Moves to a character of the line, counted from zero.
    Column(usize),
    /// Numbers without an exponent are multiplied by `10^k` in the file.
    Scale(i32),
    /// Continues on the next line.
    Line,
}

/// A format description.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FortranFormat {
    edits: Vec<EditDescriptor>,
    /// Index of the edit at which the format restarts.
    restart: usize,
}

/// A field of a line.
pub(crate) struct Field<'a> {
    pub line: Line<'a>,
    pub text: &'a [u8],
    decimals: usize,
    scale: i32,
}

/// Maximum value of columns, repetitions and fields. Larger values indicate another format.
const MOST: usize = 10_000;

impl FortranFormat {
    /// Parses a format. Returns `None` if the text is not a format of numbers.
    pub fn new(text: &str) -> Option<Self> {
        let text: Vec<u8> = text.to_uppercase().bytes().filter(|byte| !byte.is_ascii_whitespace()).collect();
        let mut parser = Parser { rest: text.strip_prefix(b"(")?, restart: 0 };
        let mut edits = Vec::new();
        parser.list(&mut edits, 0)?;
        let restart = parser.restart;
        let has_field = edits[restart..].iter().any(|edit| matches!(edit, EditDescriptor::Field { .. }));
        (parser.rest.is_empty() && has_field).then_some(Self { edits, restart })
    }

    /// Reads `count` fields from the necessary number of lines.
    pub fn read<'a, T>(
        &self,
        lines: &mut Lines<'a>,
        count: usize,
        what: &str,
        mut read: impl FnMut(Field<'a>) -> Result<T, Error>,
    ) -> Result<Vec<T>, Error> {
        // A field has at least a digit and a separator or line end.
        let mut found = Vec::with_capacity(count.min(lines.remaining() / 2 + 1));
        let (mut line, mut column, mut scale, mut next) = (None, 0_usize, 0, 0);
        while found.len() < count {
            let Some(edit) = self.edits.get(next) else {
                (line, next) = (None, self.restart);
                continue;
            };
            let current = match line {
                Some(line) => line,
                None => {
                    column = 0;
                    *line.insert(lines.expect(what)?)
                }
            };
            match *edit {
                EditDescriptor::Field { width, decimals } => {
                    let text = current.columns(column, column + width);
                    if text.is_empty() {
                        let columns = format!("nothing in columns {} to {}", column + 1, column + width);
                        return Err(current.malformed(what, &columns));
                    }
                    found.push(read(Field { line: current, text, decimals, scale })?);
                    column += width;
                }
                EditDescriptor::Skip(by) => column = column.saturating_add_signed(by),
                EditDescriptor::Column(at) => column = at,
                EditDescriptor::Scale(power) => scale = power,
                EditDescriptor::Line => line = None,
            }
            next += 1;
        }
        Ok(found)
    }
}

impl Field<'_> {
    /// Returns the field as a real number.
    pub fn real(&self) -> Result<f64, Error> {
        let value = self.line.real(self.text)?;
        if self.decimals > 0 && value != 0.0 && value.is_finite() && !self.text.contains(&b'.') {
            // Fortran places the decimal point before the last digits, other programs after them.
            return Err(self.line.malformed("a number with a decimal point", &quoted(self.text)));
        }
        let is_exponent = |(at, byte): (usize, &u8)| byte.is_ascii_alphabetic() || (at > 0 && b"+-".contains(byte));
        match self.text.iter().enumerate().any(is_exponent) {
            true => Ok(value),
            false => Ok(value / 10_f64.powi(self.scale)),
        }
    }
}

/// The state of the parser.
struct Parser<'t> {
    rest: &'t [u8],
    /// Start of the last top-level group.
    restart: usize,
}

impl Parser<'_> {
    /// Parses a list up to its closing parenthesis.
    fn list(&mut self, edits: &mut Vec<EditDescriptor>, depth: usize) -> Option<()> {
        loop {
            match self.letter()? {
                b')' => return Some(()),
                b',' => {}
                b'/' => edits.push(EditDescriptor::Line),
                first => self.item(first, edits, depth)?,
            }
            if edits.len() > MOST {
                return None;
            }
        }
    }

    /// Parses an item with the given first character.
    fn item(&mut self, first: u8, edits: &mut Vec<EditDescriptor>, depth: usize) -> Option<()> {
        let negative = first == b'-';
        let (count, letter) = match first {
            b'+' | b'-' => (Some(self.number()?), self.letter()?),
            b'0'..=b'9' => {
                let count = self.number_after(first)?;
                (Some(count), self.letter()?)
            }
            letter => (None, letter),
        };
        match letter {
            b'P' => {
                let power = i32::try_from(count?).ok()?;
                edits.push(EditDescriptor::Scale(if negative { -power } else { power }));
                return Some(());
            }
            _ if negative || count == Some(0) => return None,
            _ => {}
        }
        let count = count.unwrap_or(1);
        match letter {
            b'(' if depth < 8 => self.group(count, edits, depth)?,
            b'X' => edits.push(EditDescriptor::Skip(count as isize)),
            b'T' => edits.push(match self.rest.first()? {
                b'L' => EditDescriptor::Skip(-(self.number_behind()? as isize)),
                b'R' => EditDescriptor::Skip(self.number_behind()? as isize),
                _ => EditDescriptor::Column(self.number()?.checked_sub(1)?),
            }),
            // Control of signs and blanks, which does not change the reading of numbers.
            b'S' | b'B' => self.skip(b"PSNZ"),
            b'I' | b'E' | b'D' | b'F' | b'G' => {
                let field = self.field(letter)?;
                edits.extend(std::iter::repeat_n(field, count));
            }
            _ => return None,
        }
        Some(())
    }

    /// Parses a group and repeats it `count` times.
    fn group(&mut self, count: usize, edits: &mut Vec<EditDescriptor>, depth: usize) -> Option<()> {
        let start = edits.len();
        if depth == 0 {
            self.restart = start;
        }
        self.list(edits, depth + 1)?;
        let group = edits[start..].to_vec();
        if group.len().saturating_mul(count) > MOST {
            return None;
        }
        (1..count).for_each(|_| edits.extend(&group));
        Some(())
    }

    /// Parses `w`, `w.d` or `w.dEe` after the letter of a field.
    fn field(&mut self, letter: u8) -> Option<EditDescriptor> {
        if letter == b'E' {
            self.skip(b"SNX");
        }
        let width = self.number().filter(|width| *width > 0)?;
        let mut decimals = 0;
        if self.rest.first() == Some(&b'.') {
            decimals = self.number_behind()?;
            if self.rest.first() == Some(&b'E') {
                self.number_behind()?;
            }
        }
        Some(EditDescriptor::Field { width, decimals: if letter == b'I' { 0 } else { decimals } })
    }

    fn letter(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    fn skip(&mut self, letters: &[u8]) {
        if self.rest.first().is_some_and(|letter| letters.contains(letter)) {
            self.rest = &self.rest[1..];
        }
    }

    fn number(&mut self) -> Option<usize> {
        let digits = self.rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let (number, rest) = self.rest.split_at(digits);
        self.rest = rest;
        from_utf8(number).ok()?.parse().ok().filter(|number| *number <= MOST)
    }

    /// Skips one character and parses a number.
    fn number_behind(&mut self) -> Option<usize> {
        self.letter()?;
        self.number()
    }

    /// Parses a number with the given first digit.
    fn number_after(&mut self, first: u8) -> Option<usize> {
        let digits = self.rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let (others, rest) = self.rest.split_at(digits);
        self.rest = rest;
        let number = format!("{}{}", first as char, from_utf8(others).ok()?);
        number.parse().ok().filter(|number| *number <= MOST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reals(format: &str, text: &str, count: usize) -> Result<Vec<f64>, Error> {
        let fixed = FortranFormat::new(format).unwrap_or_else(|| panic!("{format}"));
        fixed.read(&mut Lines::new(text.as_bytes()), count, "a number", |field| field.real())
    }

    #[test]
    fn formats_of_one_kind_of_field() {
        let check = |text: &str, expected: Option<(usize, usize)>| {
            let fields = FortranFormat::new(text).map(|fixed| {
                let widths: Vec<usize> = (fixed.edits.iter())
                    .filter_map(|edit| match edit {
                        EditDescriptor::Field { width, .. } => Some(*width),
                        _ => None,
                    })
                    .collect();
                (widths.len(), widths[0])
            });
            assert_eq!(fields, expected, "{text}");
        };
        check("(8I10)", Some((8, 10)));
        check("(1X,8I9)", Some((8, 9)));
        check("(8I10.10)", Some((8, 10)));
        check("(1P,4E20.12)", Some((4, 20)));
        check("(1P,4(E20.12))", Some((4, 20)));
        check("(3(1P,E24.16))", Some((3, 24)));
        check("(2(2(1P,ES24.16E3)))", Some((4, 24)));
        check("(1p4d25.16e3)", Some((4, 25)));
        check("(SP,BN,4F20.12)", Some((4, 20)));
        check("(I14)", Some((1, 14)));
        check("( 3 F 12.4 )", Some((3, 12)));
        let wrong =
            ["(8A10)", "8I10", "(8I)", "(0I4)", "(4I0)", "(99999999999I4)", "()", "(é)", "(*)", "(1X)", "(I5))"];
        for text in wrong.into_iter().chain(["(9999(9999(I1)))", "((((((((((I1))))))))))", "(I5,2(1X))", "(I5"]) {
            check(text, None);
        }
    }

    /// Output of gfortran 13 in these formats reads back.
    #[test]
    fn lines_of_every_kind_of_format() -> Result<(), Error> {
        assert_eq!(reals("(1X,3I4)", "    1   2   3\n    4\n", 4)?, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(reals("(2(1X,I3))", "   1   2\n   3\n", 3)?, [1.0, 2.0, 3.0]);
        assert_eq!(reals("(I3,2(1X,I3))", "  1   2   3\n   4   5\n", 5)?, [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(reals("(I3/I4)", "  1\n   2\n  3\n", 3)?, [1.0, 2.0, 3.0]);
        assert_eq!(reals("(T5,I2,TR1,I2,T1,I4)", "1234 5  6\n", 3)?, [5.0, 6.0, 1234.0]);
        // A scale factor affects numbers without an exponent, from its position on.
        assert_eq!(reals("(F7.3,1P,2F7.3)", "  1.500 15.000  1.5E1\n", 3)?, [1.5, 1.5, 15.0]);
        assert_eq!(reals("(1P,E13.5)", "  1.50000E+01\n", 1)?, [15.0]);
        assert!(reals("(F7.3)", "   1500\n", 1).is_err(), "Fortran reads 1.5, others 1500");
        assert_eq!(reals("(F7.3)", "      0\n", 1)?, [0.0]);
        assert!(reals("(2I4)", "   1\n   2\n", 2).is_err(), "a line that is too short");
        Ok(())
    }
}
