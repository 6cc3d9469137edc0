//! Checks of `[figure]` that need the model and the kind.

use crate::case::names::ModelNames;
use crate::case::values::Values;
use crate::kinds::info::KeyError;
use crate::syntax::{suggest, units};
use stickslip::dimension::Dimension;
use stickslip::model::Model;

/// Dimensions of the axes of a kind's figure, as far as each axis has one.
pub(crate) struct AxisDimensions {
    pub kind: &'static str,
    pub axes: [Option<Dimension>; 2],
}

/// Checks the values of `[figure]`.
pub(crate) fn check(figure: &Values, expected: &AxisDimensions, model: &Model) -> Result<(), KeyError> {
    let known = ModelNames::places(model).with_joints(model);
    for name in figure.names("only").unwrap_or_default() {
        if model.is_rotation(name) {
            let message = format!("`{name}` is a rotation; figures show displacements only");
            let help = "name a [[place]] of the body; the tables contain its rotations in rad";
            return Err(KeyError { name: Some(name.clone()), ..KeyError::new("only", message, help) });
        }
        known.labels("only", "mass or joint", name)?;
    }
    for (key, axis) in [("x_unit", expected.axes[0]), ("y_unit", expected.axes[1])] {
        let Some(text) = figure.text(key) else { continue };
        let Some(expected) = axis else {
            let message = format!("a figure of kind `{}` has no single unit on this axis", expected.kind);
            return Err(KeyError::new(key, message, "remove this key"));
        };
        let example = expected.name_and_unit().map_or("", |(_, unit)| unit);
        match units::parse(text) {
            Some(unit) if unit.dimension == expected => {}
            found => {
                let what = if found.is_some() { "a unit of another quantity" } else { "not a known unit" };
                let help = format!("write a unit such as {example}");
                return Err(KeyError::new(key, format!("`{}` is {what}", suggest::excerpt(text)), help));
            }
        }
    }
    Ok(())
}
