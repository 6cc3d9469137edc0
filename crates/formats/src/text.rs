//! Text files: numbered lines, fields, and numbers in Fortran notation.

use crate::error::{Error, ErrorKind, Location};

/// The lines of a file, counted from one.
#[derive(Clone)]
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, number: 0 }
    }

    /// Returns the next line. `what` describes the expected content in the error.
    pub fn expect(&mut self, what: &str) -> Result<Line<'a>, Error> {
        let location = Location::Line(self.number + 1);
        self.next().ok_or_else(|| truncated(location, what))
    }

    /// Returns the next line that is not blank.
    pub fn expect_filled(&mut self, what: &str) -> Result<Line<'a>, Error> {
        loop {
            let line = self.expect(what)?;
            if !line.text.trim_ascii().is_empty() {
                return Ok(line);
            }
        }
    }

    /// Returns the bytes not read yet.
    pub fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Returns the number of bytes not read yet.
    pub fn remaining(&self) -> usize {
        self.rest.len()
    }

    /// Skips bytes after the last line read, such as binary data.
    pub fn skip_bytes(&mut self, count: usize) {
        self.rest = &self.rest[count.min(self.rest.len())..];
    }

    /// Returns the location of the last line read.
    pub fn location(&self) -> Location {
        Location::Line(self.number)
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|&byte| byte == b'\n');
        let text = &self.rest[..end.unwrap_or(self.rest.len())];
        self.rest = end.map_or(&[], |end| &self.rest[end + 1..]);
        self.number += 1;
        Some(Line { text: text.strip_suffix(b"\r").unwrap_or(text), number: self.number })
    }
}

/// A line of a file.
#[derive(Clone, Copy)]
pub(crate) struct Line<'a> {
    pub text: &'a [u8],
    pub number: usize,
}

impl<'a> Line<'a> {
    pub fn location(&self) -> Location {
        Location::Line(self.number)
    }

    /// Returns the fields between spaces.
    pub fn words(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        self.text.split(|byte| byte.is_ascii_whitespace()).filter(|word| !word.is_empty())
    }

    /// Returns exactly `N` fields between spaces.
    pub fn exactly<const N: usize>(&self, what: &str) -> Result<[&'a [u8]; N], Error> {
        let mut fields = [&[][..]; N];
        let mut count = 0;
        for word in self.words() {
            if count < N {
                fields[count] = word;
            }
            count += 1;
        }
        if count == N { Ok(fields) } else { Err(self.malformed(what, &format!("{count} fields"))) }
    }

    /// Returns the text between two columns, counted from zero; it is shorter
    /// or empty if the line ends earlier.
    pub fn columns(&self, from: usize, to: usize) -> &'a [u8] {
        let to = to.min(self.text.len());
        self.text[from.min(to)..to].trim_ascii()
    }

    pub fn real(&self, field: &[u8]) -> Result<f64, Error> {
        real(field).ok_or_else(|| self.malformed("a number", &quoted(field)))
    }

    pub fn integer(&self, field: &[u8]) -> Result<i64, Error> {
        integer(field).ok_or_else(|| self.malformed("a whole number", &quoted(field)))
    }

    /// Reads a count or size, which is not negative.
    pub fn count(&self, field: &[u8]) -> Result<usize, Error> {
        let count = integer(field).and_then(|value| usize::try_from(value).ok());
        count.ok_or_else(|| self.malformed("a count", &quoted(field)))
    }

    /// Reads a row or column, counted from one in the file and from zero in the result.
    pub fn index(&self, field: &[u8]) -> Result<usize, Error> {
        match integer(field).map(|value| usize::try_from(value - 1)) {
            Some(Ok(index)) => Ok(index),
            _ => Err(self.malformed("a row or column from 1", &quoted(field))),
        }
    }

    /// Creates an error for unexpected content in this line.
    pub fn malformed(&self, expected: &str, found: &str) -> Error {
        Error::new(
            ErrorKind::Malformed,
            self.location(),
            format!("expected {expected}, found {found}"),
            "the file is damaged or has another format; export it again, or state its format",
        )
    }
}

/// Refuses a file that ends within a line, if it does not state its number of
/// lines: the last number may lack digits.
pub(crate) fn require_final_newline(bytes: &[u8]) -> Result<(), Error> {
    if bytes.last().is_none_or(|last| *last == b'\n') {
        return Ok(());
    }
    let remedy = "if the file is not complete, export or copy it again; otherwise add a line break at its end";
    let location = Location::Line(Lines::new(bytes).count());
    Err(Error::new(ErrorKind::Truncated, location, "the file ends within a line".into(), remedy))
}

/// Creates the error for a file that ends before `what`.
pub(crate) fn truncated(location: Location, what: &str) -> Error {
    Error::new(
        ErrorKind::Truncated,
        location,
        format!("the file ends before {what}"),
        "the file is not complete; export or copy it again",
    )
}

/// Returns a field in the notation of a message.
pub(crate) fn quoted(field: &[u8]) -> String {
    let text = String::from_utf8_lossy(field);
    // Number of characters of a wrong field that a message shows.
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    format!("`{}`", short.escape_debug())
}

/// Reads an integer below 2^62 in magnitude.
pub(crate) fn integer(field: &[u8]) -> Option<i64> {
    let text = std::str::from_utf8(field).ok()?;
    let value: i64 = text.strip_prefix('+').unwrap_or(text).parse().ok()?;
    // The difference of two such integers does not overflow.
    (value.unsigned_abs() < 1 << 62).then_some(value)
}

/// Reads a number in C or Fortran notation: `1.5`, `1.`, `.5`, `1e3`, `1.5D+03`, `1.0-5`.
pub(crate) fn real(field: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(field).ok()?;
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    // A limit on the length, because the following steps copy the text.
    if text.len() > 400 || !text.bytes().all(|byte| byte.is_ascii_digit() || b"+-.dDeE".contains(&byte)) {
        return None;
    }
    let mut plain = String::with_capacity(text.len() + 1);
    let mut before = None;
    for c in text.chars() {
        let letter = matches!(c, 'd' | 'D' | 'e' | 'E');
        // Fortran omits the letter if the exponent has three digits, Nastran often.
        if matches!(c, '+' | '-') && before.is_some_and(|b: char| b.is_ascii_digit() || b == '.') {
            plain.push('e');
        }
        plain.push(if letter { 'e' } else { c });
        before = Some(c);
    }
    plain.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_fortran_and_nastran() {
        let check = |text: &str, value: f64| assert_eq!(real(text.as_bytes()), Some(value), "{text}");
        check("1", 1.0);
        check("-1.", -1.0);
        check(".5", 0.5);
        check("+1.5D+03", 1500.0);
        check("1.5d3", 1500.0);
        check("1.0-5", 1e-5);
        check("-1.0+5", -1e5);
        check("2.5-101", 2.5e-101);
        check("0.4935897435897E+05", 0.4935897435897e5);
        for wrong in ["", "a", "1.0x", "1e", "1.0--5", "--1", "e5", "1 2", "0x10", "1_000"] {
            assert_eq!(real(wrong.as_bytes()), None, "{wrong}");
        }
        assert_eq!(
            real(b"1e999"),
            Some(f64::INFINITY),
            "refused as not finite, where the position in the matrix is known"
        );
        assert_eq!(integer(b"9223372036854775807"), None);
        assert_eq!(integer(b"+12"), Some(12));
    }

    #[test]
    fn lines_end_with_or_without_a_return() {
        let lines: Vec<_> = Lines::new(b"a\r\n\nb c").map(|line| (line.number, line.text)).collect();
        assert_eq!(lines, [(1, &b"a"[..]), (2, b""), (3, b"b c")]);
        let line = Line { text: b"b c", number: 3 };
        assert_eq!(line.exactly::<2>("two fields"), Ok([&b"b"[..], b"c"]));
        assert_eq!(line.exactly::<3>("three fields").map_err(|e| e.location), Err(Location::Line(3)));
        assert_eq!((line.columns(2, 9), line.columns(7, 9)), (&b"c"[..], &b""[..]));
    }
}
