//! Models of rotation: every `mass` is a moment of inertia in kg m², so that places turn in rad
//! and joints transmit moments in N m.
//!
//! A force becomes a moment, and a length becomes an angle. A dimension `kg^a m^b s^c rad^d` is a
//! product of `a` forces and `b - a` lengths, so it becomes `kg^a m^2a s^c rad^(d + b - a)`.

use super::compiled::{CompiledQuantity, CompiledTable, CompiledValue, LawCoordinate};
use super::source_model::{ModelLists, SourceModel};
use crate::syntax::error::Problem;
use crate::syntax::expression::ExpressionValue;
use crate::syntax::suggest::excerpt;
use stickslip::dimension::Dimension;

/// Returns the dimension that a quantity of displacements and forces has for rotations and
/// moments.
pub(crate) fn of_rotation(dimension: Dimension) -> Dimension {
    let Dimension { kg, m, s, rad } = dimension;
    // the inertia of a rotation has no radian
    if dimension == Dimension::MASS {
        return Dimension::INERTIA;
    }
    Dimension { kg, m: 2 * kg, s, rad: rad + m - kg }
}

/// Returns an example of a quantity of this dimension, as TOML.
fn example_of_rotation(dimension: Dimension) -> &'static str {
    match dimension {
        Dimension::INERTIA => "\"0.05 kg m^2\"",
        Dimension::ANGLE => "\"0.1 deg\"",
        Dimension::ENERGY => "\"2 N m\"",
        Dimension::ANGULAR_STIFFNESS => "\"500 N m/rad\"",
        Dimension::ANGULAR_DAMPING => "\"0.01 N m s/rad\"",
        _ => "",
    }
}

/// Gives the quantities of a table the dimensions of rotations.
fn turn(table: &mut CompiledTable) {
    for entry in &mut table.entries {
        match &mut entry.value {
            CompiledValue::Quantity { dimension, example, .. } if of_rotation(*dimension) != *dimension => {
                *dimension = of_rotation(*dimension);
                *example = example_of_rotation(*dimension);
            }
            CompiledValue::OverFrequency(amplitude) => {
                amplitude.dimension = of_rotation(amplitude.dimension);
                amplitude.example = example_of_rotation(amplitude.dimension);
            }
            CompiledValue::ByName(_, dimension) | CompiledValue::Quantities(_, dimension, ..) => {
                *dimension = of_rotation(*dimension);
            }
            CompiledValue::Law(_, table, coordinate) => {
                *coordinate = LawCoordinate::Angle;
                turn(table);
            }
            CompiledValue::Table(table) => turn(table),
            CompiledValue::Tables(tables) => tables.iter_mut().for_each(turn),
            _ => {}
        }
    }
}

/// Returns the problem of a speed without a unit, which would count in Hz as a frequency does.
fn bare_speed(table: &CompiledTable, parameters: &[ExpressionValue]) -> Option<Problem> {
    let is_bare = |quantity: &CompiledQuantity| {
        let value = quantity.expression.evaluate(parameters);
        value.is_ok_and(|value| value.dimension.is_none() && value.si != 0.0)
    };
    table.entries.iter().find_map(|entry| {
        let quantities: Vec<&CompiledQuantity> = match &entry.value {
            CompiledValue::Quantity { quantity, dimension: Dimension::VELOCITY, .. } => vec![quantity],
            CompiledValue::ByName(list, Dimension::VELOCITY) => list.iter().map(|(.., quantity)| quantity).collect(),
            CompiledValue::Law(_, table, _) | CompiledValue::Table(table) => return bare_speed(table, parameters),
            CompiledValue::Tables(tables) => {
                return tables.iter().find_map(|table| bare_speed(table, parameters));
            }
            _ => return None,
        };
        quantities.into_iter().find(|quantity| is_bare(quantity)).map(|quantity| {
            let number = excerpt(quantity.text.trim());
            quantity
                .problem(entry.key, format!("the speed of rotation {number} has no unit"))
                .help("state it in rad/s or rpm, such as \"100 rad/s\"")
        })
    })
}

/// Returns the dimension of the `mass` of an entry, if its expression determines it.
fn mass_dimension(mass: &CompiledTable, parameters: &[ExpressionValue]) -> Option<Dimension> {
    match &mass.entry("mass")?.value {
        CompiledValue::Quantity { quantity, .. } => quantity.expression.evaluate(parameters).ok()?.dimension,
        _ => None,
    }
}

/// Finds out whether the masses of a model are moments of inertia, and then gives its quantities
/// and those of `[study]` the dimensions of rotations. `parameters` are the values of
/// `[parameters]`.
///
/// # Errors
/// The model mixes masses with moments of inertia, has parts without rotations, or a speed without
/// a unit.
pub(crate) fn use_moments_of_inertia(
    structure: &mut SourceModel,
    study: &mut CompiledTable,
    parameters: &[ExpressionValue],
) -> Result<(), Problem> {
    let dimensions: Vec<Option<Dimension>> =
        structure.lists.mass.iter().map(|mass| mass_dimension(mass, parameters)).collect();
    let Some(first) = dimensions.iter().position(|dimension| *dimension == Some(Dimension::INERTIA)) else {
        return Ok(());
    };
    let lists = &structure.lists;
    let problem = |table: &CompiledTable, key: &'static str, message: String| {
        Err(Problem::new(table.location_of(key, None), key, table.with_repetition(&message)).help(
            "a model has masses in kg or moments of inertia in kg m^2; a [[body]] with `inertia` has both \
             displacements and rotations",
        ))
    };
    let name = |mass: &CompiledTable| mass.name().unwrap_or_default().to_owned();
    let inertia = name(&lists.mass[first]);
    if let Some(other) = dimensions.iter().position(|dimension| *dimension == Some(Dimension::MASS)) {
        let message =
            format!("`{}` is a mass (kg), but `{inertia}` is a moment of inertia (kg m^2)", name(&lists.mass[other]));
        return problem(&lists.mass[other], "mass", message);
    }
    if let Some(mass) = lists.mass.iter().find(|mass| mass.entry("directions").is_some()) {
        let message =
            format!("`{}` is a moment of inertia (kg m^2) about one axis, which has no `directions`", name(mass));
        return problem(mass, "directions", message);
    }
    if let Some(body) = lists.body.first() {
        return problem(
            body,
            "name",
            format!("the mass `{inertia}` is a moment of inertia (kg m^2), but a [[body]] has displacements"),
        );
    }
    if let Some(matrices) = &structure.matrices {
        let message = format!("the mass `{inertia}` is a moment of inertia (kg m^2), but a [structure] is in metres");
        return problem(&matrices.table, "mass", message);
    }
    let ModelLists { mass, spring, joint, force, motion, is_torsional, .. } = &mut structure.lists;
    let entries = || mass.iter().chain(&*spring).chain(&*joint).chain(&*force).chain(&*motion);
    if let Some(problem) = entries().chain([&*study]).find_map(|table| bare_speed(table, parameters)) {
        return Err(problem);
    }
    mass.iter_mut().chain(spring).chain(joint).chain(force).chain(motion).for_each(turn);
    turn(study);
    *is_torsional = true;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forces_become_moments_and_lengths_become_angles() {
        for (displacement, rotation) in [
            (Dimension::MASS, Dimension::INERTIA),
            (Dimension::FORCE, Dimension::ENERGY),
            (Dimension::LENGTH, Dimension::ANGLE),
            (Dimension::STIFFNESS, Dimension::ANGULAR_STIFFNESS),
            (Dimension::DAMPING, Dimension::ANGULAR_DAMPING),
            (Dimension::VELOCITY, Dimension::FREQUENCY),
            (Dimension::CUBIC_STIFFNESS, Dimension { kg: 1, m: 2, s: -2, rad: -3 }),
            (Dimension::INVERSE_VELOCITY, Dimension { kg: 0, m: 0, s: 1, rad: -1 }),
            (Dimension::FREQUENCY, Dimension::FREQUENCY),
            (Dimension::TIME, Dimension::TIME),
            (Dimension::ANGLE, Dimension::ANGLE),
            (Dimension::NONE, Dimension::NONE),
        ] {
            assert_eq!(of_rotation(displacement), rotation, "{displacement}");
        }
    }
}
