//! Parameters of a model by name, for setting and varying them.

use crate::law::python_law;
use crate::{error, law, quantity};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use stickslip::dimension::Dimension;
use stickslip::model::Model;

/// Varied parameters with their values, one per point.
pub type VariedParameters = Vec<(String, Vec<f64>)>;

/// Sets a parameter of the model to a value in SI units. [`dimension`] must know its name.
///
/// # Errors
/// The law rejects the value. Masses, springs, forces and motions are checked when the model is
/// assembled.
pub fn set(model: &mut Model, name: &str, value: f64) -> Result<(), String> {
    let Some((of, key)) = name.rsplit_once('.') else { return Ok(()) };
    match key {
        "mass" => {
            model.masses.iter_mut().filter(|mass| mass.name == of).for_each(|mass| mass.mass = value);
            model.bodies.iter_mut().filter(|body| body.name == of).for_each(|body| body.mass = value);
        }
        "force" => model.forces.iter_mut().filter(|force| force.on == of).for_each(|force| force.amplitude = value),
        "motion" => {
            model.motions.iter_mut().filter(|motion| motion.on == of).for_each(|motion| motion.amplitude = value);
        }
        "stiffness" | "damping" if of.contains('-') => {
            for spring in model.springs.iter_mut().filter(|spring| spring.between.join("-") == of) {
                *(if key == "stiffness" { &mut spring.stiffness } else { &mut spring.damping }) = value;
            }
        }
        _ => {
            for joint in model.joints.iter_mut().filter(|joint| joint.name == of) {
                joint.law = law::with(&joint.law, key, value)?;
            }
        }
    }
    Ok(())
}

/// Returns the dimensions of the stiffness and the damping of a spring between two places.
pub fn spring_dimensions(model: &Model, between: [&str; 2]) -> [Dimension; 2] {
    if between.into_iter().any(|end| model.is_rotation(end)) {
        [Dimension::ANGULAR_STIFFNESS, Dimension::ANGULAR_DAMPING]
    } else {
        [Dimension::STIFFNESS, Dimension::DAMPING]
    }
}

/// Returns the dimension of a parameter of the model, or `None` if the model has no such
/// parameter.
///
/// The inner `None` means that any dimension is accepted.
pub fn dimension(model: &Model, name: &str) -> Option<Option<Dimension>> {
    let (of, key) = name.rsplit_once('.')?;
    match key {
        "mass" => {
            let masses = model.masses.iter().map(|mass| &mass.name);
            masses
                .chain(model.bodies.iter().map(|body| &body.name))
                .any(|name| name == of)
                .then_some(Some(Dimension::MASS))
        }
        "force" => {
            let dimension = if model.is_rotation(of) { Dimension::ENERGY } else { Dimension::FORCE };
            model.forces.iter().any(|force| force.on == of).then_some(Some(dimension))
        }
        "motion" => {
            let dimension = if model.is_rotation(of) { Dimension::ANGLE } else { Dimension::LENGTH };
            model.motions.iter().any(|motion| motion.on == of).then_some(Some(dimension))
        }
        "stiffness" | "damping" if of.contains('-') => {
            let spring = model.springs.iter().find(|spring| spring.between.join("-") == of)?;
            let [stiffness, damping] = spring_dimensions(model, spring.between.each_ref().map(String::as_str));
            Some(Some(if key == "stiffness" { stiffness } else { damping }))
        }
        _ => {
            let law = &model.joints.iter().find(|joint| joint.name == of)?.law;
            let parameter = law.info().parameters.iter().find(|parameter| parameter.key == key)?;
            if python_law::is_written(law) && parameter.dimension == Dimension::NONE {
                return Some(None); // The author of the law gave a number in SI units.
            }
            // A quantity raised to a fractional power is a plain number.
            Some(Some(parameter.dimension_for(|key| law.value(key)).unwrap_or(Dimension::NONE)))
        }
    }
}

/// Parses `vary`. All lists, including the frequencies, get the same length.
pub fn parse_varied(
    py: Python<'_>,
    model: &Model,
    vary: Option<&Bound<'_, PyDict>>,
    omegas: &mut Vec<f64>,
) -> PyResult<VariedParameters> {
    let mut varied = VariedParameters::new();
    for (name, values) in vary.into_iter().flatten() {
        let name: String = name.extract()?;
        let Some(dimension) = dimension(model, &name) else {
            let message = format!(
                "the model has no parameter `{name}`: use JOINT.KEY for a parameter of a law, PLACE.mass, \
                 PLACE.force, PLACE.motion, A-B.stiffness or A-B.damping"
            );
            return Err(error::model(py, message));
        };
        let values = quantity::many(&values, dimension, &format!("`{name}`"))?;
        varied.push((name, values));
    }
    if omegas.is_empty() {
        return Err(error::model(py, "`frequency` has no values"));
    }
    let count = varied.iter().map(|(_, values)| values.len()).chain([omegas.len()]).max().unwrap_or(0);
    let lists = varied.iter_mut().map(|(name, values)| (name.as_str(), values));
    for (name, list) in lists.chain([("frequency", omegas)]) {
        match list.len() {
            len if len == count => {}
            1 => list.resize(count, list[0]),
            len => {
                let message =
                    format!("`{name}` has {len} values, but {count} are required: give {count} values, or one");
                return Err(error::model(py, message));
            }
        }
    }
    Ok(varied)
}
