//! Refuses bare numbers next to quantities with a unit, such as `["1100 rpm", 1200]`. A bare
//! number counts in SI, which is probably not the unit that the user means.

use crate::compile::compiled::CompiledQuantity;
use crate::syntax::error::Problem;
use crate::syntax::expression::quantity_text;
use crate::syntax::suggest::excerpt;
use crate::syntax::units;
use std::f64::consts::TAU;
use stickslip::dimension::Dimension;

/// Returns a problem if one quantity is a bare number and another one has a unit with a
/// different factor to SI.
pub(crate) fn bare_number_problem<'a>(
    key: &str,
    all: impl IntoIterator<Item = &'a CompiledQuantity>,
) -> Option<Problem> {
    let all: Vec<&CompiledQuantity> = all.into_iter().collect();
    // a bare frequency is in Hz
    let bare = |dimension| if matches!(dimension, Dimension::FREQUENCY | Dimension::SWEEP_RATE) { TAU } else { 1.0 };
    // Relative difference of two factors that counts as rounding.
    let is_bare_unit = |factor: f64, dimension| (factor / bare(dimension) - 1.0).abs() <= 1e-12;
    // no problem if one of the quantities has the unit in which a bare number counts
    if all.iter().filter_map(|q| literal_unit(q)).any(|(_, factor, dimension)| is_bare_unit(factor, dimension)) {
        return None;
    }
    let (unit, _, dimension) = all.iter().find_map(|quantity| literal_unit(quantity))?;
    let bare = bare(dimension);
    let (quantity, number) = all.iter().find_map(|quantity| Some((quantity, bare_number(quantity)?)))?;
    let counts = quantity_text(number * bare, Some(dimension));
    let text = excerpt(quantity.text.trim());
    let message = format!("the bare number {text} counts as {counts}, but other values of this key are in {unit}");
    Some(quantity.problem(key, message).help(format!("add the unit: \"{text} {unit}\" or \"{counts}\"")))
}

/// Returns the unit of a literal, its factor to SI and its dimension.
pub(crate) fn literal_unit(quantity: &CompiledQuantity) -> Option<(&str, f64, Dimension)> {
    if !quantity.expression.is_literal() {
        return None;
    }
    let text = quantity.text.trim();
    let unit = &text[text.find(units::starts_unit).filter(|at| *at > 0)?..];
    // the `e` of an exponent does not begin a unit
    let unit =
        if unit.starts_with(['e', 'E']) && units::find(unit).is_none() { unit.split_once(' ')?.1.trim() } else { unit };
    let found = units::parse(unit)?;
    Some((unit, found.si_value("1"), found.dimension))
}

/// Returns the value of a literal without a unit, unless it is zero.
fn bare_number(quantity: &CompiledQuantity) -> Option<f64> {
    if !quantity.expression.is_literal() {
        return None;
    }
    quantity.text.trim().parse::<f64>().ok().filter(|number| *number != 0.0)
}
