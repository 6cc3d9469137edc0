//! Bare numbers beside quantities with a unit, `["1100 rpm", 1200]`: a bare number counts in SI, which a reader of the others does not expect.

use crate::error::Problem;
use crate::expression::displayed;
use crate::near::shown;
use crate::statement::Quantity;
use crate::units;
use std::f64::consts::TAU;
use stickslip::dimension::Dimension;

/// Relative difference of two factors that is rounding.
const ROUNDING: f64 = 1e-12;

/// That one of these is a bare number and another one has a unit in which the number would be another quantity.
pub(crate) fn mixed<'a>(key: &str, all: impl IntoIterator<Item = &'a Quantity>) -> Option<Problem> {
    let all: Vec<&Quantity> = all.into_iter().collect();
    // a bare frequency is in Hz
    let bare = |dimension| if matches!(dimension, Dimension::FREQUENCY | Dimension::SWEEP_RATE) { TAU } else { 1.0 };
    let counts_so = |factor: f64, dimension| (factor / bare(dimension) - 1.0).abs() <= ROUNDING;
    // beside one whose unit is the one in which it counts it is meant so
    if all.iter().filter_map(|q| with_unit(q)).any(|(_, factor, dimension)| counts_so(factor, dimension)) {
        return None;
    }
    let (unit, _, dimension) = all.iter().find_map(|quantity| with_unit(quantity))?;
    let bare = bare(dimension);
    let (quantity, number) = all.iter().find_map(|quantity| Some((quantity, bare_number(quantity)?)))?;
    let counts = displayed(number * bare, Some(dimension));
    let text = shown(quantity.text.trim());
    let message = format!("the bare number {text} counts as {counts}, and stands beside quantities in {unit}");
    Some(quantity.problem(key, message).help(format!("say its unit: \"{text} {unit}\" or \"{counts}\"")))
}

/// The unit of a literal, its factor to SI and its dimension.
pub(crate) fn with_unit(quantity: &Quantity) -> Option<(&str, f64, Dimension)> {
    if !quantity.expression.is_literal() {
        return None;
    }
    let text = quantity.text.trim();
    let unit = &text[text.find(units::starts_unit).filter(|at| *at > 0)?..];
    // an exponent is no unit
    let unit =
        if unit.starts_with(['e', 'E']) && units::find(unit).is_none() { unit.split_once(' ')?.1.trim() } else { unit };
    let found = units::parse(unit)?;
    Some((unit, found.scale("1"), found.dimension))
}

/// A literal without a unit, unless it is zero.
fn bare_number(quantity: &Quantity) -> Option<f64> {
    if !quantity.expression.is_literal() {
        return None;
    }
    quantity.text.trim().parse::<f64>().ok().filter(|number| *number != 0.0)
}
