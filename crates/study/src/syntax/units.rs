//! Units: converts a text such as `N s/m` to a factor and a dimension.
//!
//! A factor is a fraction times a power of ten times a power of π. It is applied to the number
//! as decimal text: `25 s/mm` is exactly 25000, and `0.1 mm` is the f64 nearest to 0.0001. The
//! radian is a base unit, so `1 Hz` is `2π rad/s`.
//!
//! A unit follows a number. After it, `*`, `·`, `/` or a space continue the unit if a known
//! unit follows; `^2`, `^-1` and `²` are powers. `N s/m` is `(N s)/m`. A space after a `/`
//! (`N/m s`) is refused, because readers disagree on its meaning.

use crate::syntax::suggest::{excerpt, suggest};
use std::ops::Range;
use stickslip::dimension::Dimension;

/// An error in a quantity or an expression: its place in the text, what is wrong, and what to
/// do.
#[derive(Debug, Clone, PartialEq)]
pub struct TextError {
    /// Byte range of the text that is wrong; empty at a place where something is missing.
    pub span: Range<usize>,
    /// Description of the error, and the expected text.
    pub message: String,
    /// Advice for the user.
    pub help: Option<String>,
}

impl TextError {
    pub(crate) fn new(span: Range<usize>, message: impl Into<String>) -> Self {
        TextError { span, message: message.into(), help: None }
    }

    pub(crate) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// A unit: `numerator / denominator · 10^exponent · π^pi` SI units of `dimension`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unit {
    numerator: u64,
    denominator: u64,
    exponent: i32,
    pi: i32,
    /// The dimension that it measures.
    pub dimension: Dimension,
}

const ONE: Unit = Unit { numerator: 1, denominator: 1, exponent: 0, pi: 0, dimension: Dimension::NONE };

/// A named unit, and whether it takes prefixes.
struct NamedUnit {
    name: &'static str,
    prefixes: bool,
    unit: Unit,
}

const fn named_unit(
    name: &'static str,
    prefixes: bool,
    factor: (u64, u64, i32, i32),
    base: (i8, i8, i8, i8),
) -> NamedUnit {
    let (numerator, denominator, exponent, pi) = factor;
    let (kg, m, s, rad) = base;
    NamedUnit {
        name,
        prefixes,
        unit: Unit { numerator, denominator, exponent, pi, dimension: Dimension { kg, m, s, rad } },
    }
}

// name, prefixes, (numerator, denominator, power of ten, power of π), (kg, m, s, rad)
const UNITS: &[NamedUnit] = &[
    named_unit("m", true, (1, 1, 0, 0), (0, 1, 0, 0)),
    named_unit("g", true, (1, 1, -3, 0), (1, 0, 0, 0)),
    named_unit("s", true, (1, 1, 0, 0), (0, 0, 1, 0)),
    named_unit("N", true, (1, 1, 0, 0), (1, 1, -2, 0)),
    named_unit("Pa", true, (1, 1, 0, 0), (1, -1, -2, 0)),
    named_unit("J", true, (1, 1, 0, 0), (1, 2, -2, 0)),
    named_unit("W", true, (1, 1, 0, 0), (1, 2, -3, 0)),
    named_unit("Hz", true, (2, 1, 0, 1), (0, 0, -1, 1)),
    named_unit("rad", true, (1, 1, 0, 0), (0, 0, 0, 1)),
    named_unit("deg", false, (1, 18, -1, 1), (0, 0, 0, 1)),
    named_unit("°", false, (1, 18, -1, 1), (0, 0, 0, 1)),
    named_unit("rev", false, (2, 1, 0, 1), (0, 0, 0, 1)),
    named_unit("rpm", false, (1, 3, -1, 1), (0, 0, -1, 1)),
    named_unit("min", false, (6, 1, 1, 0), (0, 0, 1, 0)),
    named_unit("h", false, (36, 1, 2, 0), (0, 0, 1, 0)),
    named_unit("t", false, (1, 1, 3, 0), (1, 0, 0, 0)),
    named_unit("in", false, (254, 1, -4, 0), (0, 1, 0, 0)),
    named_unit("ft", false, (3048, 1, -4, 0), (0, 1, 0, 0)),
    named_unit("lb", false, (45_359_237, 1, -8, 0), (1, 0, 0, 0)),
    named_unit("lbf", false, (44_482_216_152_605, 1, -13, 0), (1, 1, -2, 0)),
    named_unit("%", false, (1, 1, -2, 0), (0, 0, 0, 0)),
];

/// Common spellings of units that have another name here, in lower case, and what to write
/// instead.
const OTHER_SPELLINGS: &[(&[&str], &str)] = &[
    (&["lbs", "pound", "pounds", "lbm"], "write `lb` for a mass, `lbf` for a force"),
    (&["kgf", "kp"], "a kilogram-force is 9.80665 N"),
    (&["kip", "kips"], "write 1000 lbf"),
    (&["oz"], "an ounce is 0.0625 lb, as a force 0.0625 lbf"),
    (&["psi"], "write `lbf/in^2`"),
    (&["mil", "mils", "thou"], "write 0.001 in"),
    (&["inch", "inches"], "write `in`"),
    (&["foot", "feet"], "write `ft`"),
    (&["micron", "microns"], "write `um`"),
    (&["sec", "secs", "second", "seconds"], "write `s`"),
    (&["mins", "minute", "minutes"], "write `min`"),
    (&["hour", "hours", "hr", "hrs"], "write `h`"),
    (&["degree", "degrees", "degs"], "write `deg`"),
    (&["radian", "radians", "rads"], "write `rad`"),
    (&["kgs", "kilo", "kilos"], "write `kg`"),
    (&["newton", "newtons"], "write `N`"),
    (&["hertz", "cps"], "write `Hz`"),
    (&["gram", "grams", "gr"], "write `g`"),
    (&["meter", "meters", "metre", "metres"], "write `m`"),
    (&["tonne", "tonnes", "ton", "tons"], "write `t`, which is 1000 kg"),
];

const PREFIXES: &[(&str, i32)] = &[
    ("p", -12),
    ("n", -9),
    ("u", -6),
    ("µ", -6), // micro sign
    ("μ", -6), // Greek mu
    ("m", -3),
    ("c", -2),
    ("d", -1),
    ("da", 1),
    ("h", 2),
    ("k", 3),
    ("M", 6),
    ("G", 9),
];

/// Returns the unit with this name, prefix included.
pub(crate) fn find(name: &str) -> Option<Unit> {
    if let Some(row) = UNITS.iter().find(|row| row.name == name) {
        return Some(row.unit);
    }
    UNITS.iter().filter(|row| row.prefixes).find_map(|row| {
        let prefix = name.strip_suffix(row.name)?;
        let (_, exponent) = PREFIXES.iter().find(|(p, _)| *p == prefix)?;
        Some(Unit { exponent: row.unit.exponent + exponent, ..row.unit })
    })
}

/// Reads a text that is a unit as a whole: `mm`, `rad/s`, `kN/mm`.
pub(crate) fn parse(text: &str) -> Option<Unit> {
    let names = ReservedNames { parameter: &|_| false, function: &|_| false };
    read(text, 0, &names).ok().filter(|(_, end)| *end == text.len()).map(|(unit, _)| unit)
}

/// Suggests a unit for `name`: one that differs by case or a typing error, two joined units
/// (`Nm`), or a power (`mm2`).
pub(crate) fn suggest_unit(name: &str) -> Option<String> {
    let base = name.trim_end_matches(|c: char| c.is_ascii_digit());
    if base.len() < name.len() && find(base).is_some() {
        return Some(format!("{base}^{}", &name[base.len()..]));
    }
    let cut = name.char_indices().skip(1).map(|(i, _)| name.split_at(i));
    if let Some((a, b)) = cut.take(8).find(|(a, b)| find(a).is_some() && find(b).is_some()) {
        return Some(format!("{a} {b}"));
    }
    let mut all: Vec<String> = UNITS.iter().map(|row| row.name.to_owned()).collect();
    for row in UNITS.iter().filter(|row| row.prefixes) {
        all.extend(["m", "k", "M"].iter().map(|prefix| format!("{prefix}{}", row.name)));
    }
    let same = all.iter().find(|unit| unit.to_lowercase() == name.to_lowercase());
    same.cloned().or_else(|| suggest(name, all.iter().map(String::as_str)).map(str::to_owned))
}

/// Returns the factor from the unit `from` to the unit `to`. Returns `None` if their dimensions
/// differ or a unit is unknown.
pub fn ratio(from: &str, to: &str) -> Option<f64> {
    if from == to {
        return Some(1.0);
    }
    let (from, to) = (parse(from)?, parse(to)?);
    (from.dimension == to.dimension).then(|| from.si_value("1") / to.si_value("1"))
}

impl Unit {
    fn times(self, other: Unit) -> Option<Unit> {
        Some(Unit {
            numerator: self.numerator.checked_mul(other.numerator)?,
            denominator: self.denominator.checked_mul(other.denominator)?,
            exponent: self.exponent.checked_add(other.exponent)?,
            pi: self.pi.checked_add(other.pi)?,
            dimension: times(self.dimension, other.dimension)?,
        })
    }

    fn inverse(self) -> Option<Unit> {
        Some(Unit {
            numerator: self.denominator,
            denominator: self.numerator,
            exponent: self.exponent.checked_neg()?,
            pi: self.pi.checked_neg()?,
            dimension: power(self.dimension, -1.0)?,
        })
    }

    fn power(self, exponent: i32) -> Option<Unit> {
        let base = if exponent < 0 { self.inverse()? } else { self };
        (0..exponent.unsigned_abs()).try_fold(ONE, |product, _| product.times(base))
    }

    /// Returns the SI value of `literal` (digits, a point, an exponent) in this unit. The
    /// result is rounded once if the unit has no fraction and no π.
    pub(crate) fn si_value(&self, literal: &str) -> f64 {
        let (mantissa, exponent) = literal.split_once(['e', 'E']).unwrap_or((literal, "0"));
        // an exponent out of the range of i32 is far out of the range of f64
        let clamped = if exponent.starts_with('-') { -100_000 } else { 100_000 };
        let exponent = exponent.parse::<i32>().unwrap_or(clamped).clamp(-100_000, 100_000);
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let digits = format!("{whole}{fraction}");
        let exponent = i64::from(exponent) + i64::from(self.exponent) - fraction.len() as i64;
        let parse = |digits: &str| format!("{digits}e{exponent}").parse::<f64>().unwrap_or(f64::NAN);
        let exact = digits.parse::<u128>().ok().and_then(|d| d.checked_mul(u128::from(self.numerator)));
        let scaled = match exact {
            Some(product) => parse(&product.to_string()),
            None => parse(&digits) * self.numerator as f64,
        };
        let scaled = if self.denominator == 1 { scaled } else { scaled / self.denominator as f64 };
        if self.pi == 0 { scaled } else { scaled * std::f64::consts::PI.powi(self.pi) }
    }
}

impl Unit {
    /// Like [`Unit::si_value`], for a number with an optional minus sign.
    pub(crate) fn signed_si_value(&self, literal: &str) -> f64 {
        match literal.strip_prefix('-') {
            Some(positive) => -self.si_value(positive),
            None => self.si_value(literal),
        }
    }
}

/// Returns the product of two dimensions; `None` if an exponent overflows.
pub(crate) fn times(a: Dimension, b: Dimension) -> Option<Dimension> {
    Some(Dimension {
        kg: a.kg.checked_add(b.kg)?,
        m: a.m.checked_add(b.m)?,
        s: a.s.checked_add(b.s)?,
        rad: a.rad.checked_add(b.rad)?,
    })
}

/// Returns the power of a dimension; `None` if an exponent is not a whole number or too large.
pub(crate) fn power(a: Dimension, exponent: f64) -> Option<Dimension> {
    let part = |base: i8| {
        let value = f64::from(base) * exponent;
        let whole = value.round();
        // an exponent such as 1/3 is not exact in binary
        ((value - whole).abs() < 1e-9 && whole.abs() <= 100.0).then_some(whole as i8)
    };
    Some(Dimension { kg: part(a.kg)?, m: part(a.m)?, s: part(a.s)?, rad: part(a.rad)? })
}

/// Returns whether a unit's name can contain this character.
pub(crate) fn is_unit_char(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || c == '°' || c == '%' || (!c.is_ascii() && c.is_alphabetic())
}

/// Returns whether a unit's name can start with this character.
pub(crate) fn starts_unit(c: char) -> bool {
    is_unit_char(c) && !c.is_ascii_digit()
}

/// Names that the reader of units must distinguish from units.
pub(crate) struct ReservedNames<'a> {
    /// Returns whether this is the name of a parameter.
    pub parameter: &'a dyn Fn(&str) -> bool,
    /// Returns whether this is the name of a function.
    pub function: &'a dyn Fn(&str) -> bool,
}

/// Returns whether a text that begins with `/` continues with a unit that cannot be a
/// parameter: `/m`, `/s`.
pub(crate) fn starts_with_divisor(text: &str, names: &ReservedNames<'_>) -> bool {
    let Some(after) = text.strip_prefix('/') else { return false };
    let reader = UnitParser { text: after.trim_start(), position: 0, names, depth: 0 };
    reader.unit_here() && !(names.parameter)(reader.word())
}

/// Reads the unit that starts at byte `start` of `text`, and returns it with the byte position
/// after it.
///
/// The text at `start` must satisfy [`starts_unit`] or [`starts_with_divisor`].
pub(crate) fn read(text: &str, start: usize, names: &ReservedNames<'_>) -> Result<(Unit, usize), TextError> {
    let mut reader = UnitParser { text, position: start, names, depth: 0 };
    let unit = reader.product(false)?;
    Ok((unit, reader.position))
}

struct UnitParser<'a> {
    text: &'a str,
    position: usize,
    names: &'a ReservedNames<'a>,
    depth: usize,
}

impl UnitParser<'_> {
    fn rest(&self) -> &str {
        &self.text[self.position..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn skip_space(&mut self) -> bool {
        let before = self.position;
        self.position += self.rest().len() - self.rest().trim_start().len();
        self.position > before
    }

    fn word(&self) -> &str {
        let rest = self.rest();
        &rest[..rest.find(|c| !is_unit_char(c)).unwrap_or(rest.len())]
    }

    /// Returns whether a unit is at the current position: a known name that is not a function
    /// call.
    fn unit_here(&self) -> bool {
        let word = self.word();
        find(word).is_some()
            && !((self.names.function)(word) && self.rest()[word.len()..].trim_start().starts_with('('))
    }

    fn product(&mut self, group: bool) -> Result<Unit, TextError> {
        let start = self.position;
        let mut unit = if self.peek() == Some('/') { ONE } else { self.factor()? };
        let mut divided = false;
        loop {
            let before = self.position;
            let space = self.skip_space();
            let Some(next) = self.peek() else { break };
            let (inverse, operator) = match next {
                '*' | '·' | '⋅' | '×' => (false, true),
                '/' => (true, true),
                c if starts_unit(c) => (false, false),
                _ => {
                    self.position = before;
                    break;
                }
            };
            let symbol = self.position;
            if operator {
                self.position += next.len_utf8();
                let space_after = self.skip_space();
                match self.peek() {
                    None => {
                        let message = format!("the unit is incomplete: after `{next}` a unit is missing");
                        return Err(TextError::new(symbol..self.text.len(), message)
                            .help("complete the unit, as in \"10 N/m\", or remove the sign"));
                    }
                    Some('(') if self.group_here() => {}
                    Some(_) if self.unit_here() => {
                        let word = self.word();
                        if space && space_after && (self.names.parameter)(word) {
                            let span = self.position..self.position + word.len();
                            let message =
                                format!("`{word}` is ambiguous here: the unit `{word}` or the parameter `{word}`");
                            let (before, after) = (self.text[..symbol].trim(), &self.text[self.position..]);
                            let help = format!(
                                "for the unit remove the spaces around `{next}`; for the parameter write \"({}) \
                                 {next} {}\"",
                                excerpt(before),
                                excerpt(after)
                            );
                            return Err(TextError::new(span, message).help(help));
                        }
                    }
                    Some(_) if group => return Err(self.unknown()),
                    // the operator belongs to the expression, not to the unit
                    Some(_) => {
                        self.position = before;
                        break;
                    }
                }
            } else {
                if !self.unit_here() {
                    return Err(self.unknown());
                }
                if divided {
                    let word = self.word();
                    let message = format!("it is not clear whether `{word}` belongs to the denominator");
                    return Err(TextError::new(self.position..self.position + word.len(), message)
                        .help("write \"N s/m\" or \"N/(m s)\""));
                }
            }
            divided |= inverse;
            let factor = self.factor()?;
            let factor = if inverse { factor.inverse() } else { Some(factor) };
            unit = factor.and_then(|factor| unit.times(factor)).ok_or_else(|| self.too_large(start))?;
        }
        Ok(unit)
    }

    /// Returns whether the parenthesis at the current position contains only a unit.
    fn group_here(&self) -> bool {
        let mut trial = UnitParser { text: self.text, position: self.position, names: self.names, depth: self.depth };
        trial.factor().is_ok()
    }

    fn factor(&mut self) -> Result<Unit, TextError> {
        let start = self.position;
        let unit = if self.peek() == Some('(') {
            self.depth += 1;
            // Maximum depth of parentheses in a unit.
            if self.depth > 8 {
                return Err(TextError::new(start..start + 1, "too many parentheses in a unit"));
            }
            self.position += 1;
            self.skip_space();
            if !self.peek().is_some_and(|c| starts_unit(c) || c == '(') {
                return Err(TextError::new(self.position..self.position, "a unit is missing here"));
            }
            let inner = self.product(true)?;
            self.skip_space();
            if self.peek() != Some(')') {
                return Err(TextError::new(start..start + 1, "this parenthesis is not closed"));
            }
            self.position += 1;
            self.depth -= 1;
            inner
        } else {
            let unit = find(self.word()).ok_or_else(|| self.unknown())?;
            self.position += self.word().len();
            unit
        };
        match self.exponent()? {
            None => Ok(unit),
            Some(exponent) => unit.power(exponent).ok_or_else(|| self.too_large(start)),
        }
    }

    fn exponent(&mut self) -> Result<Option<i32>, TextError> {
        // Maximum power of a unit.
        let max_power = 9;
        const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
        let start = self.position;
        let raised: String = self.rest().chars().take_while(|c| *c == '⁻' || RAISED.contains(c)).collect();
        let digits: String = if raised.is_empty() {
            let rest = self.rest().trim_start();
            let Some(after) = rest.strip_prefix('^') else { return Ok(None) };
            let trimmed = after.trim_start();
            let (inner, close) = match trimmed.strip_prefix('(') {
                Some(inner) => (inner.trim_start(), true),
                None => (trimmed, false),
            };
            let digits: String = inner.chars().take_while(|c| matches!(c, '-' | '+' | '.' | '0'..='9')).collect();
            let mut rest = &inner[digits.len()..];
            if close {
                rest = rest.trim_start();
                rest = rest.strip_prefix(')').unwrap_or("\0");
            }
            let fault = rest.starts_with('\0') || digits.is_empty();
            self.position = if fault { self.text.len() } else { self.text.len() - rest.len() };
            if fault { String::new() } else { digits }
        } else {
            self.position += raised.len();
            let plain = |c: char| match RAISED.iter().position(|r| *r == c) {
                Some(digit) => (b'0' + digit as u8) as char,
                None => '-',
            };
            raised.chars().map(plain).collect()
        };
        match digits.parse::<i32>() {
            Ok(exponent) if exponent.abs() <= max_power => Ok(Some(exponent)),
            _ => Err(TextError::new(
                start..self.position,
                format!("the power of a unit must be a whole number from -{max_power} to {max_power}"),
            )
            .help("to raise a quantity to another power, put it in parentheses: \"(2 m)^0.5\"")),
        }
    }

    fn too_large(&self, start: usize) -> TextError {
        TextError::new(start..self.position, "the powers in this unit are too large")
    }

    fn unknown(&self) -> TextError {
        let word = self.word();
        if word.is_empty() {
            return TextError::new(self.position..self.position, "a unit is missing here");
        }
        let span = self.position..self.position + word.len();
        let fault = TextError::new(span, format!("there is no unit `{}`", excerpt(word)));
        if (self.names.parameter)(word) {
            return fault.help(format!("a number is followed by its unit; for the parameter write \"* {word}\""));
        }
        if let Some((_, advice)) =
            OTHER_SPELLINGS.iter().find(|(words, _)| words.contains(&word.to_lowercase().as_str()))
        {
            return fault.help(*advice);
        }
        match suggest_unit(word) {
            Some(unit) => fault.help(format!("did you mean `{unit}`?")),
            None => fault.help("units are m, kg, s, N, J, Pa, W, Hz, rad, deg, rpm, with prefixes such as m and k"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: f64, dimension: Dimension) {
        let names = ReservedNames { parameter: &|_| false, function: &|name| name == "min" };
        let cut = text.find(' ').unwrap();
        let (unit, end) = read(text, cut + 1, &names).unwrap();
        assert_eq!((end, unit.dimension), (text.len(), dimension), "{text}");
        assert_eq!(unit.si_value(&text[..cut]), expected, "{text}");
    }

    #[test]
    fn decimal_numbers_are_exact() {
        check("25 s/mm", 25_000.0, Dimension::INVERSE_VELOCITY);
        check("0.1 mm", 0.0001, Dimension::LENGTH);
        check("0.3 mm", 0.0003, Dimension::LENGTH);
        check("182 g", 0.182, Dimension::MASS);
        check("1.5e-3 m", 0.0015, Dimension::LENGTH);
        check("1 mN", 0.001, Dimension::FORCE);
        check("1 in", 0.0254, Dimension::LENGTH);
        check("0.1 lbf", 0.444_822_161_526_05, Dimension::FORCE);
        check("10.51 N/cm", 1051.0, Dimension::STIFFNESS);
        check("90 min", 5400.0, Dimension::TIME);
        check("123456789012345678901234567890123456789012 mm", 1.234_567_890_123_456_8e38, Dimension::LENGTH);
    }

    #[test]
    fn cycles_and_radians_differ() {
        use std::f64::consts::{PI, TAU};
        check("121 Hz", 121.0 * TAU, Dimension::FREQUENCY);
        check("2 rad/s", 2.0, Dimension::FREQUENCY);
        check("3000 rpm", 50.0 * TAU, Dimension::FREQUENCY);
        check("3000 rev/min", 50.0 * TAU, Dimension::FREQUENCY);
        check("180 deg", PI, Dimension::ANGLE);
        check("90 °", PI / 2.0, Dimension::ANGLE);
        check("0.5 Hz/s", PI, Dimension::SWEEP_RATE);
    }

    #[test]
    fn products_powers_and_groups() {
        check("10 N s/m", 10.0, Dimension::DAMPING);
        check("10 N·s/m", 10.0, Dimension::DAMPING);
        check("10 N/(m/s)", 10.0, Dimension::DAMPING);
        check("1 kg*m/s^2", 1.0, Dimension::FORCE);
        check("1 kg m s^-2", 1.0, Dimension::FORCE);
        check("1 kg·m·s⁻²", 1.0, Dimension::FORCE);
        check("1 kN/mm", 1e6, Dimension::STIFFNESS);
        check("3 mm²", 3e-6, Dimension { kg: 0, m: 2, s: 0, rad: 0 });
        check("3 mm^(2)", 3e-6, Dimension { kg: 0, m: 2, s: 0, rad: 0 });
    }

    fn refuse(text: &str, words: &str) {
        let names = ReservedNames { parameter: &|name| name == "m", function: &|_| false };
        let fault = read(text, text.find(' ').unwrap() + 1, &names).unwrap_err();
        let all = format!("{} {}", fault.message, fault.help.unwrap_or_default());
        assert!(all.contains(words), "{text}: {all}");
    }

    /// No explained spelling is a unit, and every proposed unit exists.
    #[test]
    fn other_spellings_name_known_units() {
        for (words, advice) in OTHER_SPELLINGS {
            assert!(words.iter().all(|word| find(word).is_none()), "{words:?}");
            let proposed = advice.split('`').skip(1).step_by(2);
            for unit in proposed {
                check(&format!("1 {unit}"), quantity_of(unit), read_dimension(unit));
            }
        }
    }

    fn read_unit(unit: &str) -> Unit {
        let names = ReservedNames { parameter: &|_| false, function: &|_| false };
        read(unit, 0, &names).unwrap().0
    }

    fn quantity_of(unit: &str) -> f64 {
        read_unit(unit).si_value("1")
    }

    fn read_dimension(unit: &str) -> Dimension {
        read_unit(unit).dimension
    }

    #[test]
    fn faults_say_what_is_missing() {
        refuse("10 N/", "after `/` a unit is missing");
        refuse("10 N*", "after `*` a unit is missing");
        refuse("10 Nm", "did you mean `N m`?");
        refuse("10 mm2", "did you mean `mm^2`?");
        refuse("10 hz", "did you mean `Hz`?");
        refuse("2 lbs", "write `lb` for a mass, `lbf` for a force");
        refuse("2 Pounds", "write `lb` for a mass, `lbf` for a force");
        refuse("0.1 sec", "write `s`");
        refuse("10 N/m s", "whether `s` belongs to the denominator");
        refuse("10 N / m", "the parameter `m`");
        refuse("10 m^", "whole number");
        refuse("10 m^0.5", "whole number");
        refuse("10 m^99", "whole number");
        refuse("10 m⁹⁹", "whole number");
        refuse("10 m^9 m^9 m^9 m^9 m^9 m^9 m^9 m^9 m^9 m^9 m^9 m^9 m^9 m^9 m^9", "too large");
    }
}
