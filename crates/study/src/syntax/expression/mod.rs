//! Quantities and expressions: `"25 s/mm"`, `"m - m1/2"`, `"sqrt(k/m) * 1 rad"`.
//!
//! An expression has `+ - * / ^`, parentheses, numbers, numbers with a unit, names of
//! parameters, `pi`, `frequency` (the excitation frequency), and the functions of [`FUNCTIONS`].
//!
//! - `value`: numbers with or without a dimension;
//! - `operation`: the steps of an expression, and the reserved words;
//! - `parser`: from the text to the steps.
//!
//! **Bare numbers.** A bare number has no unit, and so no dimension yet. Its key supplies the
//! dimension: the number is in the SI unit that the key expects, also when it arrives through a
//! parameter. The rules:
//!
//! - `a + b`, `a - b`, `min`, `max`: the result of bare numbers is bare. A bare number combined
//!   with dimension `d` is in the SI unit of `d`, and the result has dimension `d`.
//! - `a * b`, `a / b`: the result of bare numbers is bare. A bare number combined with a
//!   dimension is a pure number.
//! - `a ^ b`: the exponent must be bare or a pure number. The result of a bare base is bare.
//! - `sqrt`, `abs`: the result of a bare number is bare.
//! - `sin`, `cos`, `tan`, `exp`, `ln`: a bare argument is in radians or a pure number, and its
//!   result is bare.
//!
//! The SI unit of a frequency is Hz here, and that of a sweep rate is Hz/s: `f = 121` and
//! `frequency = "f"` mean 121 Hz. A bare number that was computed with `pi` is refused as a
//! frequency, because it was probably meant in rad/s. A ratio of two masses is a pure number.
//! It is *not* bare, and it is refused as a stiffness.

mod operation;
mod parser;
mod value;

use crate::syntax::units::{TextError, power, times};
pub use operation::FUNCTIONS;
use operation::Operation;
pub(crate) use operation::is_reserved;
use parser::{EXCITATION_HELP, Parser};
use std::ops::Range;
use stickslip::dimension::Dimension;
pub use value::ExpressionValue;
pub(crate) use value::{dimension_text, quantity_text};

/// A compiled expression: steps of a stack machine.
///
/// Evaluation does not recurse, so deep nesting cannot exhaust the call stack.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    steps: Vec<(Operation, Range<usize>)>,
}

impl Expression {
    /// Returns the expression of one bare number.
    pub fn number(value: f64) -> Self {
        Expression { steps: vec![(Operation::Push(ExpressionValue::bare(value)), 0..0)] }
    }

    /// Returns the expression of one quantity.
    pub(crate) fn quantity(si: f64, dimension: Dimension) -> Self {
        Expression { steps: vec![(Operation::Push(ExpressionValue::new(si, dimension)), 0..0)] }
    }

    /// Returns the product with another expression of the same parameters. Its errors point into
    /// the text of this one.
    pub(crate) fn times(&self, factor: &Expression) -> Self {
        let of_factor = factor.steps.iter().map(|(operation, _)| (*operation, 0..0));
        let steps = self.steps.iter().cloned().chain(of_factor).chain([(Operation::Multiply, 0..0)]);
        Expression { steps: steps.collect() }
    }

    /// Compiles `text`. A name means the parameter at its index in `parameters`.
    ///
    /// # Errors
    /// Returns a [`TextError`] with the byte range of `text` that is wrong.
    ///
    /// # Example
    /// ```
    /// use stickslip::dimension::Dimension;
    /// use stickslip_study::expression::{Expression, ExpressionValue};
    /// let e = Expression::compile("m - m1/2", &["m", "m1"]).unwrap();
    /// let mass = ExpressionValue::new(0.182, Dimension::MASS);
    /// let value = e.evaluate(&[mass, ExpressionValue::bare(0.002)]).unwrap();
    /// assert_eq!(value.si_in(Dimension::MASS), Ok(0.181));
    /// ```
    pub fn compile<S: AsRef<str>>(text: &str, parameters: &[S]) -> Result<Self, TextError> {
        let index = |name: &str| parameters.iter().position(|p| p.as_ref() == name);
        let names: Vec<&str> = parameters.iter().map(AsRef::as_ref).collect();
        Expression::compile_with(text, &index, &|_| None, &names)
    }

    /// Compiles `text` with named bare numbers (`constant`).
    ///
    /// `names` are the candidates that an error suggests for an unknown name.
    pub(crate) fn compile_with(
        text: &str,
        index: &dyn Fn(&str) -> Option<usize>,
        constant: &dyn Fn(&str) -> Option<f64>,
        names: &[&str],
    ) -> Result<Self, TextError> {
        let mut parser = Parser { text, position: 0, index, constant, names, depth: 0, steps: Vec::new() };
        parser.space();
        if parser.peek().is_none() {
            return Err(TextError::new(0..text.len(), "the text is empty: write a number or an expression"));
        }
        parser.sum()?;
        if let Some(c) = parser.peek() {
            return Err(parser.unexpected(c));
        }
        Ok(Expression { steps: parser.steps })
    }

    /// Iterates over the indices of the parameters that the expression reads.
    pub fn parameters(&self) -> impl Iterator<Item = usize> + '_ {
        self.steps.iter().filter_map(|(operation, _)| match operation {
            Operation::Parameter(index) => Some(*index),
            _ => None,
        })
    }

    /// Iterates over the indices of parameters in arguments of `sin`, `cos` and `tan`.
    ///
    /// Arguments that contain `pi` are left out, because they are in radians.
    pub(crate) fn angles(&self) -> impl Iterator<Item = usize> + '_ {
        let turns =
            |operation: &Operation| matches!(operation, Operation::Call { function: "sin" | "cos" | "tan", .. });
        let within = |span: &Range<usize>| {
            let span = span.clone();
            self.steps.iter().filter(move |(_, part)| span.start <= part.start && part.end <= span.end)
        };
        let calls = self.steps.iter().filter(move |(operation, _)| turns(operation)).map(|(_, span)| span);
        let has_pi =
            move |span: &Range<usize>| within(span).any(|(step, _)| matches!(step, Operation::Push(v) if v.with_pi));
        calls.filter(move |span| !has_pi(span)).flat_map(within).filter_map(|(operation, _)| match operation {
            Operation::Parameter(index) => Some(*index),
            _ => None,
        })
    }

    /// Returns true if the expression is one literal number, with or without a unit and a sign.
    pub fn is_literal(&self) -> bool {
        matches!(self.steps.as_slice(), [(Operation::Push(_), _)] | [(Operation::Push(_), _), (Operation::Negate, _)])
    }

    /// Evaluates the expression with `parameters` by index.
    ///
    /// # Errors
    /// Returns a [`TextError`] with the byte range of the sub-expression whose dimensions do not
    /// fit or whose value is not finite.
    pub fn evaluate(&self, parameters: &[ExpressionValue]) -> Result<ExpressionValue, TextError> {
        self.evaluate_at(None, parameters)
    }

    /// Returns true if the expression reads the excitation frequency.
    pub(crate) fn reads_frequency(&self) -> bool {
        self.steps.iter().any(|(operation, _)| *operation == Operation::Frequency)
    }

    /// Does the same as [`Expression::evaluate`] at an excitation frequency (rad/s).
    ///
    /// # Errors
    /// Those of [`Expression::evaluate`], and an expression that reads the frequency without one.
    pub(crate) fn evaluate_at(
        &self,
        frequency: Option<f64>,
        parameters: &[ExpressionValue],
    ) -> Result<ExpressionValue, TextError> {
        let mut stack: Vec<ExpressionValue> = Vec::with_capacity(8);
        for (operation, span) in &self.steps {
            let fault = |message: String| TextError::new(span.clone(), message);
            // the parser balances the stack
            let mut pop = || stack.pop().unwrap_or(ExpressionValue::bare(f64::NAN));
            let value = match *operation {
                Operation::Push(value) => value,
                Operation::Parameter(index) => {
                    parameters.get(index).copied().unwrap_or(ExpressionValue::bare(f64::NAN))
                }
                Operation::Frequency => {
                    let omega = frequency.ok_or_else(|| {
                        fault("the excitation frequency has no value here".to_owned()).help(EXCITATION_HELP)
                    })?;
                    ExpressionValue::new(omega, Dimension::FREQUENCY)
                }
                Operation::Negate => {
                    let a = pop();
                    ExpressionValue { si: -a.si, ..a }
                }
                Operation::Add | Operation::Subtract => {
                    let (b, a) = (pop(), pop());
                    let (verb, sign) = if *operation == Operation::Add { ("add", 1.0) } else { ("subtract", -1.0) };
                    let (x, y, value) = common_dimension(a, b).map_err(|e| e.into_text_error(span, verb))?;
                    ExpressionValue { si: x + sign * y, ..value }
                }
                Operation::Multiply | Operation::Divide => {
                    let (b, a) = (pop(), pop());
                    let divide = *operation == Operation::Divide;
                    let one = Dimension::NONE;
                    let dimension = match (a.dimension, b.dimension) {
                        (None, None) => None,
                        (da, db) => {
                            let db = power(db.unwrap_or(one), if divide { -1.0 } else { 1.0 });
                            let product = db.and_then(|db| times(da.unwrap_or(one), db));
                            Some(product.ok_or_else(|| fault("the powers of the unit become too large".to_owned()))?)
                        }
                    };
                    let si = if divide { a.si / b.si } else { a.si * b.si };
                    if divide && b.si == 0.0 {
                        return Err(fault("this divides by zero".to_owned()));
                    }
                    ExpressionValue { si, dimension, with_pi: a.with_pi || b.with_pi }
                }
                Operation::Power => {
                    let (b, a) = (pop(), pop());
                    if b.dimension.is_some_and(|d| d != Dimension::NONE) {
                        let found = dimension_text(b.dimension.unwrap_or(Dimension::NONE));
                        return Err(fault(format!("an exponent must be a pure number, found {found}")));
                    }
                    let dimension = match a.dimension {
                        None => None,
                        Some(d) => Some(power(d, b.si).ok_or_else(|| {
                            fault(format!("{} cannot be raised to the power {}", dimension_text(d), b.si))
                        })?),
                    };
                    ExpressionValue { si: a.si.powf(b.si), dimension, with_pi: a.with_pi || b.with_pi }
                }
                Operation::Call { function: function @ ("min" | "max"), arguments } => {
                    let mut best = pop();
                    for _ in 1..arguments {
                        let (x, y, value) =
                            common_dimension(best, pop()).map_err(|e| e.into_text_error(span, "compare"))?;
                        best = ExpressionValue { si: if function == "min" { x.min(y) } else { x.max(y) }, ..value };
                    }
                    best
                }
                Operation::Call { function, .. } => call(function, pop()).map_err(fault)?,
            };
            if !value.si.is_finite() {
                return Err(fault("this is not a finite number".to_owned()));
            }
            stack.push(value);
        }
        Ok(stack.pop().unwrap_or(ExpressionValue::bare(f64::NAN)))
    }
}

struct DimensionMismatch {
    a: Dimension,
    b: Dimension,
    other: Option<(String, Option<String>)>,
}

impl DimensionMismatch {
    fn into_text_error(self, span: &Range<usize>, verb: &str) -> TextError {
        match self.other {
            Some((message, help)) => TextError { span: span.clone(), message, help },
            None => TextError::new(
                span.clone(),
                format!("cannot {verb} {} and {}", dimension_text(self.a), dimension_text(self.b)),
            ),
        }
    }
}

/// Brings two values to one dimension: both numbers, and a value with the dimension of the
/// result.
fn common_dimension(a: ExpressionValue, b: ExpressionValue) -> Result<(f64, f64, ExpressionValue), DimensionMismatch> {
    let none = Dimension::NONE;
    let unit = |value: ExpressionValue, d| {
        value.in_si_unit_of(d).map_err(|e| DimensionMismatch { a: none, b: none, other: Some(e) })
    };
    match (a.dimension, b.dimension) {
        (None, None) => Ok((a.si, b.si, ExpressionValue { with_pi: a.with_pi || b.with_pi, ..a })),
        (Some(d), None) => Ok((a.si, unit(b, d)?, a)),
        (None, Some(d)) => Ok((unit(a, d)?, b.si, b)),
        (Some(d), Some(e)) if d == e => Ok((a.si, b.si, a)),
        (Some(a), Some(b)) => Err(DimensionMismatch { a, b, other: None }),
    }
}

fn call(function: &str, a: ExpressionValue) -> Result<ExpressionValue, String> {
    let pure = |allowed: &[Dimension], value: f64| match a.dimension {
        None => Ok(ExpressionValue { si: value, ..a }),
        Some(d) if allowed.contains(&d) => Ok(ExpressionValue::new(value, Dimension::NONE)),
        Some(d) => Err(format!("`{function}` takes {}, found {}", dimension_text(allowed[0]), dimension_text(d))),
    };
    let angle = &[Dimension::ANGLE, Dimension::NONE];
    match function {
        "sin" => pure(angle, a.si.sin()),
        "cos" => pure(angle, a.si.cos()),
        "tan" => pure(angle, a.si.tan()),
        "exp" => pure(&[Dimension::NONE], a.si.exp()),
        "ln" => pure(&[Dimension::NONE], a.si.ln()),
        "abs" => Ok(ExpressionValue { si: a.si.abs(), ..a }),
        _ => {
            let dimension = match a.dimension {
                None => None,
                Some(d) => Some(power(d, 0.5).ok_or_else(|| format!("{} has no square root", dimension_text(d)))?),
            };
            if a.si < 0.0 {
                return Err(format!("the square root of a negative number ({})", a.si));
            }
            Ok(ExpressionValue { si: a.si.sqrt(), dimension, ..a })
        }
    }
}

/// Evaluates a quantity without parameters, in SI, for a key that expects `dimension`.
///
/// # Errors
/// Returns a [`TextError`] if the text is not an expression or has another dimension.
///
/// # Example
/// ```
/// use stickslip::dimension::Dimension;
/// use stickslip_study::expression::quantity;
/// assert_eq!(quantity("25 s/mm", Dimension::INVERSE_VELOCITY), Ok(25_000.0));
/// assert!(quantity("10 kg", Dimension::STIFFNESS).is_err());
/// ```
pub fn quantity(text: &str, dimension: Dimension) -> Result<f64, TextError> {
    let value = Expression::compile::<&str>(text, &[])?.evaluate(&[])?;
    value.written_as(text, dimension).map_err(|(message, help)| TextError { span: 0..text.len(), message, help })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const PARAMETERS: [&str; 6] = ["m", "m1", "k", "f", "Ft", "omega"];

    fn values() -> [ExpressionValue; 6] {
        [
            ExpressionValue::new(0.182, Dimension::MASS),
            ExpressionValue::bare(0.002),
            ExpressionValue::new(105_103.0, Dimension::STIFFNESS),
            ExpressionValue::bare(121.0),
            ExpressionValue::new(2.0, Dimension::FORCE),
            ExpressionValue::new(760.0, Dimension::FREQUENCY),
        ]
    }

    fn evaluate(text: &str, dimension: Dimension) -> Result<f64, TextError> {
        let value = Expression::compile(text, &PARAMETERS)?.evaluate(&values())?;
        value.si_in(dimension).map_err(|(message, help)| TextError { span: 0..text.len(), message, help })
    }

    fn check(text: &str, dimension: Dimension, expected: f64) {
        assert_eq!(evaluate(text, dimension), Ok(expected), "{text}");
    }

    #[test]
    fn dimensions_follow_the_algebra() {
        check("m - m1/2", Dimension::MASS, 0.182 - 0.002 / 2.0);
        check("m1 - m1/2", Dimension::MASS, 0.001);
        check("20 /s", Dimension { kg: 0, m: 0, s: -1, rad: 0 }, 20.0);
        check("20/ms * 1 mm", Dimension::VELOCITY, 20.0 / 1e-3 * 1e-3);
        // `m` is the parameter, not metre
        check("0.182 kg * 8/m", Dimension::NONE, 0.182 * 8.0 / 0.182);
        check("-2^2", Dimension::NONE, -4.0);
        check("2^-1", Dimension::NONE, 0.5);
        check("2^3^2", Dimension::NONE, 512.0);
        check("sqrt(k/m) * 1 rad", Dimension::FREQUENCY, (105_103.0f64 / 0.182).sqrt());
        check("k * 2 mm", Dimension::FORCE, 105_103.0 * 0.002);
        // a number may have an inverse unit, unless the name after `/` is a parameter
        for text in ["5 /mm", "5/mm", "5 1/mm", "5 mm^-1"] {
            check(text, Dimension { m: -1, ..Dimension::NONE }, 5000.0);
        }
        check("1/m", Dimension { kg: -1, ..Dimension::NONE }, 1.0 / 0.182);
        check("2 mm + 1e-3", Dimension::LENGTH, 0.003);
        check("min(Ft, 1, 3 N)", Dimension::FORCE, 1.0);
        check("max(1, 2)", Dimension::FORCE, 2.0);
        check("m/m", Dimension::NONE, 1.0);
        check("Ft*sin(30 deg)", Dimension::FORCE, 2.0 * (std::f64::consts::PI / 6.0).sin());
        check("2 N * min(1, 2)", Dimension::FORCE, 2.0);
        check("pi/2", Dimension::ANGLE, std::f64::consts::FRAC_PI_2);
        check("3N", Dimension::FORCE, 3.0);
        check("(m)(".trim_end_matches('('), Dimension::MASS, 0.182);
    }

    #[test]
    fn bare_frequencies_are_in_hertz() {
        check("f", Dimension::FREQUENCY, 121.0 * TAU);
        check("f + 1 Hz", Dimension::FREQUENCY, 121.0 * TAU + TAU);
        check("omega", Dimension::FREQUENCY, 760.0);
        check("121", Dimension::FREQUENCY, 121.0 * TAU);
        refuse("2*pi*f", Dimension::FREQUENCY, "computed with `pi`", 0..6);
        refuse("sqrt(k/m)", Dimension::FREQUENCY, "multiply by `1 rad`", 0..9);
    }

    fn refuse(text: &str, dimension: Dimension, words: &str, span: Range<usize>) {
        let fault = evaluate(text, dimension).unwrap_err();
        let all = format!("{} {}", fault.message, fault.help.clone().unwrap_or_default());
        assert!(all.contains(words), "{text}: {all}");
        assert_eq!(fault.span, span, "{text}: {all}");
    }

    #[test]
    fn faults_point_at_the_part_that_is_wrong() {
        refuse("m + Ft", Dimension::MASS, "cannot add mass (kg) and force (N)", 0..6);
        refuse("2 * (m - k)", Dimension::MASS, "subtract", 5..10);
        refuse("10 kg", Dimension::STIFFNESS, "expected stiffness (N/m), found mass (kg)", 0..5);
        refuse("kt * 2", Dimension::FORCE, "there is no parameter `kt`", 0..2);
        refuse("ft * 2", Dimension::FORCE, "a unit needs a number", 0..2);
        refuse("F * 2", Dimension::FORCE, "did you mean", 0..1);
        refuse("nan N", Dimension::FORCE, "finite number", 0..3);
        refuse("-inf", Dimension::FORCE, "finite number", 1..4);
        refuse("1e999 N", Dimension::FORCE, "too large", 0..5);
        refuse("1e-999 N", Dimension::FORCE, "too small", 0..6);
        refuse("Ft/(1-1)", Dimension::FORCE, "divides by zero", 0..8);
        refuse("10 N/", Dimension::FORCE, "after `/` a unit is missing", 4..5);
        refuse("N", Dimension::FORCE, "number before it", 0..1);
        refuse("  ", Dimension::FORCE, "empty", 0..2);
        refuse("2 *", Dimension::FORCE, "ends too early", 3..3);
        refuse("(2", Dimension::FORCE, "not closed", 0..1);
        refuse("2)", Dimension::FORCE, "no opening parenthesis", 1..2);
        refuse("1,5 N", Dimension::FORCE, "use a decimal point", 0..3);
        refuse("2 Ft", Dimension::FORCE, "write \"* Ft\"", 2..4);
        refuse("2 ** 3", Dimension::NONE, "`^`", 2..4);
        refuse("sqrt 2", Dimension::NONE, "parentheses", 0..4);
        refuse("sqr(2)", Dimension::NONE, "did you mean `sqrt`?", 0..3);
        refuse("sqrt(m)", Dimension::MASS, "no square root", 0..7);
        refuse("sqrt(0-1)", Dimension::NONE, "negative", 0..9);
        refuse("exp(m)", Dimension::NONE, "pure number", 0..6);
        refuse("min(1)", Dimension::NONE, "two or more", 0..6);
        refuse("2 m^2", Dimension::LENGTH, "found a quantity in m^2", 0..5);
        refuse("k^0.3", Dimension::NONE, "raised", 0..5);
    }

    #[test]
    fn no_depth_exhausts_the_stack() {
        for text in [
            "(".repeat(100_000),
            "-".repeat(100_000),
            "2^".repeat(100_000),
            "sqrt(".repeat(100_000),
            format!("2 N/{}", "(".repeat(100_000)),
        ] {
            assert!(evaluate(&text, Dimension::NONE).is_err());
        }
        let long = format!("1{}", "+1".repeat(100_000));
        check(&long, Dimension::NONE, 100_001.0);
    }

    #[test]
    fn values_are_shown_as_a_reader_would_write_them() {
        assert_eq!(quantity_text(0.1 + 0.2, Some(Dimension::FORCE)), "0.3 N");
        assert_eq!(quantity_text(121.0 * TAU, Some(Dimension::FREQUENCY)), "121 Hz");
        assert_eq!(quantity_text(2.0, None), "2");
    }
}
