//! Models that come ready: the paper's, with their parameters.
//!
//! To add one: write its file (and the starting study beside it), then one line in [`TABLE`].

mod blade_couple;
mod blade_couple_massless;
mod element;
mod element_with_mass;
mod symmetric_couple;

use super::{Force, GROUND, Joint, Mass, Model, Motion, Spring};
use crate::dimension::Dimension;
use crate::law::SharedLaw;
use std::collections::BTreeMap;

/// A ready model with named parameters.
#[derive(Debug, Clone, Copy)]
pub struct Template {
    /// Name in study files.
    pub name: &'static str,
    /// One line of what it is.
    pub summary: &'static str,
    /// Its parameters.
    pub parameters: &'static [TemplateParameter],
    /// A whole study file that states this model with lists, for `stickslip new`.
    pub study: &'static str,
    build: fn(&Values) -> Model,
}

/// A parameter of a template.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemplateParameter {
    /// Name.
    pub key: &'static str,
    /// Physical dimension.
    pub dimension: Dimension,
    /// Default as in a study file: a quantity, or an expression over the parameters before it.
    pub default: &'static str,
    /// The same number in SI, with the other parameters at their defaults.
    pub value: f64,
    /// One line.
    pub doc: &'static str,
}

/// Values by parameter name, SI.
type Values = BTreeMap<&'static str, f64>;

/// Every template there is.
pub const TABLE: &[Template] = &[
    element::TEMPLATE,
    element_with_mass::TEMPLATE,
    blade_couple::TEMPLATE,
    blade_couple_massless::TEMPLATE,
    symmetric_couple::TEMPLATE,
];

/// The template with this name.
pub fn find(name: &str) -> Option<&'static Template> {
    TABLE.iter().find(|template| template.name == name)
}

impl Template {
    /// The model with every parameter at its default.
    pub fn model(&self) -> Model {
        self.model_with(&[]).expect("no parameter is given that could be unknown")
    }

    /// The model with some parameters changed (SI). A parameter whose default is an expression keeps its default value
    /// unless it is given too.
    ///
    /// # Errors
    /// The first name that is no parameter of this template.
    ///
    /// # Example
    /// ```
    /// let couple = stickslip::model::templates::find("blade-couple").unwrap();
    /// let model = couple.model_with(&[("Ft", 4.0)]).unwrap();
    /// assert_eq!(model.joints[0].law.values(), [4.0]);
    /// assert_eq!(couple.model_with(&[("Fx", 4.0)]), Err("Fx".to_owned()));
    /// ```
    pub fn model_with(&self, changes: &[(&str, f64)]) -> Result<Model, String> {
        let mut values: Values = self.parameters.iter().map(|p| (p.key, p.value)).collect();
        for (key, value) in changes {
            let parameter = self.parameters.iter().find(|p| p.key == *key).ok_or_else(|| (*key).to_owned())?;
            values.insert(parameter.key, *value);
        }
        Ok((self.build)(&values))
    }
}

const fn parameter(
    key: &'static str,
    dimension: Dimension,
    default: &'static str,
    value: f64,
    doc: &'static str,
) -> TemplateParameter {
    TemplateParameter { key, dimension, default, value, doc }
}

fn mass(name: &str, mass: f64) -> Mass {
    Mass::new(name, mass)
}

fn spring(a: &str, b: &str, stiffness: f64, damping: f64) -> Spring {
    Spring { between: [a.to_owned(), b.to_owned()], stiffness, damping }
}

fn joint(name: &str, a: &str, b: &str, law: SharedLaw) -> Joint {
    Joint { name: name.to_owned(), between: [a.to_owned(), b.to_owned()], law }
}

fn force(on: &str, amplitude: f64) -> Force {
    Force { on: on.to_owned(), amplitude, phase: 0.0, harmonic: 1 }
}

fn motion(on: &str, amplitude: f64) -> Motion {
    Motion { on: on.to_owned(), amplitude, phase: 0.0, harmonic: 1 }
}
