//! Parses the text of an expression into steps by recursive descent.

use super::ExpressionValue;
use super::operation::{FREQUENCY, FUNCTIONS, Operation, is_not_finite};
use crate::syntax::suggest::{excerpt, suggest};
use crate::syntax::units::{self, ReservedNames, TextError};
use std::ops::Range;
use stickslip::dimension::Dimension;

/// Lower-case names that users give to the excitation frequency.
const EXCITATION_NAMES: [&str; 4] = ["freq", "omega", "ohm", "w"];
/// Help text: most expressions read parameters only, so the frequency must be a parameter.
pub(super) const EXCITATION_HELP: &str = "only the amplitude of a [[force]] can read the excitation frequency, by the \
    name `frequency`. For other quantities define a parameter \
    f = \"100 Hz\" in [parameters], use `f` here, and set kind = \"orbit\", frequency = \"f\" and \
    vary = { f = { from = \"90 Hz\", to = \"110 Hz\", points = 41 } }";

pub(super) struct Parser<'a> {
    pub(super) text: &'a str,
    pub(super) position: usize,
    pub(super) index: &'a dyn Fn(&str) -> Option<usize>,
    pub(super) constant: &'a dyn Fn(&str) -> Option<f64>,
    pub(super) names: &'a [&'a str],
    pub(super) depth: usize,
    pub(super) steps: Vec<(Operation, Range<usize>)>,
}

impl Parser<'_> {
    fn rest(&self) -> &str {
        &self.text[self.position..]
    }

    pub(super) fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    pub(super) fn space(&mut self) {
        self.position += self.rest().len() - self.rest().trim_start().len();
    }

    fn next(&mut self, c: char) {
        self.position += c.len_utf8();
        self.space();
    }

    fn push(&mut self, operation: Operation, start: usize) {
        let end = self.text[..self.position].trim_end().len().max(start);
        self.steps.push((operation, start..end));
    }

    fn check_depth(&mut self) -> Result<(), TextError> {
        // Greatest depth of nested parentheses and powers.
        let max_depth: usize = 64;
        self.depth += 1;
        if self.depth > max_depth {
            let message = format!("more than {max_depth} nested parentheses or powers");
            return Err(TextError::new(self.position..self.position, message)
                .help("define parts of the expression as parameters"));
        }
        Ok(())
    }

    pub(super) fn sum(&mut self) -> Result<(), TextError> {
        let start = self.position;
        self.product()?;
        while let Some(c @ ('+' | '-' | '−')) = self.peek() {
            self.next(c);
            self.product()?;
            self.push(if c == '+' { Operation::Add } else { Operation::Subtract }, start);
        }
        Ok(())
    }

    fn product(&mut self) -> Result<(), TextError> {
        let start = self.position;
        self.signed()?;
        while let Some(c @ ('*' | '/' | '·' | '⋅' | '×')) = self.peek() {
            if self.rest().starts_with("**") {
                return Err(TextError::new(self.position..self.position + 2, "`**` is not an operator")
                    .help("write a power with `^`"));
            }
            self.next(c);
            self.signed()?;
            self.push(if c == '/' { Operation::Divide } else { Operation::Multiply }, start);
        }
        Ok(())
    }

    fn signed(&mut self) -> Result<(), TextError> {
        let start = self.position;
        let mut negative = false;
        while let Some(c @ ('+' | '-' | '−')) = self.peek() {
            negative ^= c != '+';
            self.next(c);
        }
        self.power()?;
        if negative {
            self.push(Operation::Negate, start);
        }
        Ok(())
    }

    fn power(&mut self) -> Result<(), TextError> {
        let start = self.position;
        self.atom()?;
        if self.peek() == Some('^') {
            self.next('^');
            self.check_depth()?;
            self.signed()?;
            self.depth -= 1;
            self.push(Operation::Power, start);
        }
        Ok(())
    }

    fn atom(&mut self) -> Result<(), TextError> {
        let start = self.position;
        match self.peek() {
            None => Err(TextError::new(start..start, "the expression ends too early: a value is missing here")),
            Some('(') => {
                self.next('(');
                self.check_depth()?;
                self.sum()?;
                self.close(start)?;
                self.depth -= 1;
                Ok(())
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => self.name(),
            Some(c) => Err(self.unexpected(c)),
        }
    }

    fn close(&mut self, open: usize) -> Result<(), TextError> {
        match self.peek() {
            Some(')') => {
                self.next(')');
                Ok(())
            }
            None => {
                Err(TextError::new(open..open + 1, "this parenthesis is not closed")
                    .help("add `)` where it should close"))
            }
            Some(c) => Err(self.unexpected(c)),
        }
    }

    fn number(&mut self) -> Result<(), TextError> {
        let start = self.position;
        let bytes = self.text.as_bytes();
        let digits = |mut at: usize| {
            while bytes.get(at).is_some_and(u8::is_ascii_digit) {
                at += 1;
            }
            at
        };
        let mut end = digits(start);
        if bytes.get(end) == Some(&b'.') {
            end = digits(end + 1);
        }
        if end == start + 1 && bytes[start] == b'.' {
            return Err(TextError::new(start..end, "a number needs digits"));
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            let after = digits(end + 1 + sign);
            if after > end + 1 + sign {
                end = after;
            }
        }
        let literal = &self.text[start..end];
        if matches!(bytes.get(end), Some(b'.' | b',')) && bytes.get(end + 1).is_some_and(u8::is_ascii_digit) {
            return Err(TextError::new(start..digits(end + 1), "this is not one number")
                .help("use a decimal point and no digit grouping: \"10000.5 N/m\""));
        }
        self.position = end;
        self.space();
        let parameter = |name: &str| (self.index)(name).is_some() || (self.constant)(name).is_some();
        let function = |name: &str| FUNCTIONS.contains(&name);
        let names = ReservedNames { parameter: &parameter, function: &function };
        // `5000 1/m` means `5000 /m`; two numbers in a row have no other meaning
        if self.rest().strip_prefix('1').is_some_and(|rest| units::starts_with_divisor(rest, &names)) {
            self.position += 1;
        }
        let value = match self.peek() {
            Some(c) if units::starts_unit(c) || units::starts_with_divisor(self.rest(), &names) => {
                let (unit, end) = units::read(self.text, self.position, &names)?;
                self.position = end;
                ExpressionValue::new(unit.si_value(literal), unit.dimension)
            }
            Some('/') => match self.inverse_unit() {
                Some((unit, inverse, end)) => {
                    self.position = end;
                    ExpressionValue::new(literal.parse().unwrap_or(f64::NAN) / unit.si_value("1"), inverse)
                }
                None => ExpressionValue::bare(literal.parse().unwrap_or(f64::NAN)),
            },
            _ => ExpressionValue::bare(literal.parse().unwrap_or(f64::NAN)),
        };
        if !value.si.is_finite() {
            return Err(TextError::new(start..end, "this number is too large"));
        }
        let mantissa = literal.split(['e', 'E']).next().unwrap_or(literal);
        if value.si == 0.0 && mantissa.bytes().any(|b| (b'1'..=b'9').contains(&b)) {
            return Err(
                TextError::new(start..end, "this number is too small").help("write 0 if it is meant to be zero")
            );
        }
        self.push(Operation::Push(value), start);
        self.space();
        Ok(())
    }

    /// Reads the unit after `/` in `20 /s`: the unit, the inverse dimension, and the byte where
    /// it ends.
    ///
    /// Returns `None` if a parameter has the name of the unit.
    fn inverse_unit(&self) -> Option<(units::Unit, Dimension, usize)> {
        let start = self.position + 1;
        let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let name = self.text[start..].split(|c| !word(c)).next().filter(|name| !name.is_empty())?;
        let end = start + name.len();
        let taken = (self.index)(name).is_some()
            || (self.constant)(name).is_some()
            || self.text[end..].trim_start().starts_with('^');
        let unit = units::find(name).filter(|_| !taken)?;
        Some((unit, unit.dimension.pow(-1.0)?, end))
    }

    fn name(&mut self) -> Result<(), TextError> {
        let start = self.position;
        let rest = self.rest();
        let end = start + rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(rest.len());
        let name = &self.text[start..end];
        self.position = end;
        self.space();
        if self.peek() == Some('(') {
            return self.call(name, start..end);
        }
        if let Some(value) = (self.constant)(name) {
            self.push(Operation::Push(ExpressionValue::bare(value)), start);
            return Ok(());
        }
        if let Some(index) = (self.index)(name) {
            self.push(Operation::Parameter(index), start);
            return Ok(());
        }
        if name == FREQUENCY {
            self.push(Operation::Frequency, start);
            return Ok(());
        }
        if name == "pi" {
            let value = ExpressionValue { si: std::f64::consts::PI, dimension: None, with_pi: true };
            self.push(Operation::Push(value), start);
            return Ok(());
        }
        if is_not_finite(name) {
            return Err(TextError::new(start..end, format!("expected a finite number, found `{name}`")));
        }
        if FUNCTIONS.contains(&name) {
            return Err(TextError::new(start..end, format!("the function `{name}` needs its argument in parentheses")));
        }
        let fault = TextError::new(start..end, format!("there is no parameter `{}`", excerpt(name)));
        Err(if units::find(name).is_some() {
            let help = if self.steps.is_empty() {
                format!("a unit needs a number before it, as in \"1 {name}\"")
            } else {
                format!("a unit must follow a number, as in \"1 {name}\" or \"1 {name}^-1\"")
            };
            fault.help(help)
        } else if let Some(near) = suggest(name, self.names.iter().copied()) {
            fault.help(format!("did you mean `{near}`?"))
        } else if EXCITATION_NAMES.contains(&name.to_lowercase().as_str()) {
            fault.help(EXCITATION_HELP)
        } else if let Some(unit) = units::suggest_unit(name).filter(|_| !self.steps.is_empty()) {
            fault.help(format!("did you mean the unit `{unit}`?"))
        } else {
            fault.help(format!("add it to [parameters]: {} = \"…\"", excerpt(name)))
        })
    }

    fn call(&mut self, name: &str, span: Range<usize>) -> Result<(), TextError> {
        let Some(&function) = FUNCTIONS.iter().find(|f| **f == name) else {
            let fault = TextError::new(span, format!("there is no function `{}`", excerpt(name)));
            return Err(match suggest(name, FUNCTIONS.iter().copied()) {
                Some(near) => fault.help(format!("did you mean `{near}`?")),
                None => fault.help(format!("the functions are {}; write a product with `*`", FUNCTIONS.join(", "))),
            });
        };
        let open = self.position;
        self.next('(');
        self.check_depth()?;
        let mut arguments = 1;
        self.sum()?;
        while self.peek() == Some(',') {
            self.next(',');
            self.sum()?;
            arguments += 1;
        }
        self.close(open)?;
        self.depth -= 1;
        let several = matches!(function, "min" | "max");
        if several != (arguments > 1) {
            let needed = if several { "two or more arguments" } else { "one argument" };
            return Err(TextError::new(
                span.start..self.position,
                format!("`{function}` takes {needed}, found {arguments}"),
            ));
        }
        self.push(Operation::Call { function, arguments }, span.start);
        Ok(())
    }

    pub(super) fn unexpected(&self, c: char) -> TextError {
        let span = self.position..self.position + c.len_utf8();
        match c {
            ')' => TextError::new(span, "this closing parenthesis has no opening parenthesis"),
            ',' => {
                TextError::new(span, "`,` separates the arguments of `min` and `max` only").help("use a decimal point")
            }
            c if c.is_alphanumeric() => {
                TextError::new(span, "an operator is missing here").help("write a product with `*`")
            }
            c => TextError::new(span, format!("unexpected `{}`", excerpt(&c.to_string()))),
        }
    }
}
