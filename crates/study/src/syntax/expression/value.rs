//! Numbers with or without a dimension.

use crate::syntax::dimension_advice;
use std::f64::consts::TAU;
use stickslip::dimension::Dimension;

/// A number with or without a dimension.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpressionValue {
    /// The number in SI (rad/s for frequencies), or as written for a bare number.
    pub si: f64,
    /// The dimension; `None` for a bare number.
    pub dimension: Option<Dimension>,
    /// True if a bare number was computed with `pi`.
    pub(crate) with_pi: bool,
}

impl ExpressionValue {
    /// Returns a bare number.
    pub fn bare(si: f64) -> Self {
        ExpressionValue { si, dimension: None, with_pi: false }
    }

    /// Returns a number in SI with a dimension.
    pub fn new(si: f64, dimension: Dimension) -> Self {
        ExpressionValue { si, dimension: Some(dimension), with_pi: false }
    }

    /// Returns the number in SI as a quantity of dimension `expected`.
    ///
    /// # Errors
    /// Returns message and help if the value has another dimension.
    pub fn si_in(self, expected: Dimension) -> Result<f64, (String, Option<String>)> {
        self.written_as("", expected)
    }

    /// Does the same as [`ExpressionValue::si_in`]; errors quote `text`, which the user wrote.
    pub(crate) fn written_as(self, text: &str, expected: Dimension) -> Result<f64, (String, Option<String>)> {
        let Some(found) = self.dimension else {
            return self.in_si_unit_of(expected);
        };
        if found == expected {
            return Ok(self.si);
        }
        let only_radians = Dimension { rad: expected.rad, ..found } == expected;
        let help = match (only_radians, expected.rad.cmp(&found.rad)) {
            (true, std::cmp::Ordering::Greater) if expected == Dimension::FREQUENCY => Some(
                "1/s does not say whether it counts radians or cycles: multiply by `1 rad`, as in \"sqrt(k/m) * 1 rad\", \
                 or by `1 rev`"
                    .to_owned(),
            ),
            (true, order) if order.is_ne() => Some(radian_advice(expected.rad - found.rad)),
            _ => dimension_advice::dimension_advice(expected, found, text),
        };
        Err((format!("expected {}, found {}", dimension_text(expected), dimension_text(found)), help))
    }

    pub(super) fn in_si_unit_of(self, dimension: Dimension) -> Result<f64, (String, Option<String>)> {
        let counts_cycles = dimension == Dimension::FREQUENCY || dimension == Dimension::SWEEP_RATE;
        if counts_cycles && self.with_pi {
            return Err((
                "a bare number is in Hz here, but this one was computed with `pi`".to_owned(),
                Some("state the unit: \"… * 1 rad/s\" or \"… * 1 Hz\"".to_owned()),
            ));
        }
        Ok(if counts_cycles { self.si * TAU } else { self.si })
    }
}

/// Returns the advice to multiply by radians, as many as are missing; a negative number are too
/// many.
fn radian_advice(missing: i8) -> String {
    let what = if missing > 0 { "missing: multiply by" } else { "too many: divide by" };
    match missing.unsigned_abs() {
        1 if missing > 0 => "a radian is missing: multiply by `1 rad`".to_owned(),
        1 => "there is one radian too many: divide by `1 rad`".to_owned(),
        count => format!("{count} radians are {what} `(1 rad)^{count}`"),
    }
}

/// Returns the dimension as error texts name it: `stiffness (N/m)`, `a pure number`.
pub(crate) fn dimension_text(dimension: Dimension) -> String {
    match dimension {
        Dimension::NONE => "a pure number".to_owned(),
        other if other.name_and_unit().is_none() => format!("a quantity in {other}"),
        other => format!("{other}"),
    }
}

/// Formats a number in the main unit of its dimension, with up to nine digits: `2.5 N`,
/// `121 Hz`.
pub(crate) fn quantity_text(si: f64, dimension: Option<Dimension>) -> String {
    let (value, unit) = match dimension {
        None | Some(Dimension::NONE) => (si, String::new()),
        Some(Dimension::FREQUENCY) => (si / TAU, "Hz".to_owned()),
        Some(Dimension::SWEEP_RATE) => (si / TAU, "Hz/s".to_owned()),
        Some(other) => (si, other.name_and_unit().map_or_else(|| other.to_string(), |(_, unit)| unit.to_owned())),
    };
    let rounded: f64 = format!("{value:.8e}").parse().unwrap_or(value);
    let number = if rounded != 0.0 && !(1e-4..1e7).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        rounded.to_string()
    };
    if unit.is_empty() { number } else { format!("{number} {unit}") }
}
