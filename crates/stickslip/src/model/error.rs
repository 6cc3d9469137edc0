//! Errors of an invalid model.

use super::{Model, Spring};
use std::fmt;

/// The element of a model that an error concerns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)] // index into the list of the same name in the model
pub enum Element {
    Mass(usize),
    Body(usize),
    Spring(usize),
    Joint(usize),
    Force(usize),
    Motion(usize),
    Place(usize),
    Substructure,
    Whole,
}

impl Element {
    /// Returns the name of the element's list, as in study files, and the index in that list.
    /// The index is `None` for elements that exist only once.
    pub fn entry(self) -> (&'static str, Option<usize>) {
        match self {
            Element::Mass(i) => ("mass", Some(i)),
            Element::Body(i) => ("body", Some(i)),
            Element::Spring(i) => ("spring", Some(i)),
            Element::Joint(i) => ("joint", Some(i)),
            Element::Force(i) => ("force", Some(i)),
            Element::Motion(i) => ("motion", Some(i)),
            Element::Place(i) => ("place", Some(i)),
            Element::Substructure => ("structure", None),
            Element::Whole => ("model", None),
        }
    }

    /// Returns the name of the element for messages: its own name, or the places on which it
    /// acts.
    ///
    /// # Example
    /// ```
    /// use stickslip::model::{Element, example};
    /// let couple = example::blade_couple();
    /// assert_eq!(Element::Joint(0).named(&couple), "joint `shroud`");
    /// assert_eq!(Element::Spring(0).named(&couple), "spring between `blade1` and `ground`");
    /// ```
    pub fn named(self, model: &Model) -> String {
        let name = match self {
            Element::Mass(i) => model.masses.get(i).map(|mass| format!("mass `{}`", mass.name)),
            Element::Body(i) => model.bodies.get(i).map(|body| format!("body `{}`", body.name)),
            Element::Spring(i) => {
                model.springs.get(i).map(|Spring { between: [a, b], .. }| format!("spring between `{a}` and `{b}`"))
            }
            Element::Joint(i) => model.joints.get(i).map(|joint| format!("joint `{}`", joint.name)),
            Element::Force(i) => model.forces.get(i).map(|force| format!("force on `{}`", force.on)),
            Element::Motion(i) => model.motions.get(i).map(|motion| format!("motion of `{}`", motion.on)),
            Element::Place(i) => model.places.get(i).map(|place| format!("place `{}`", place.name)),
            Element::Substructure | Element::Whole => None,
        };
        name.unwrap_or_else(|| self.to_string())
    }
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.entry() {
            (what, Some(index)) => write!(f, "{what} {}", index + 1),
            (what, None) => f.write_str(what),
        }
    }
}

/// The reason why a model is invalid: the element, its key and the fault.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{element}, `{key}`: {message}")]
pub struct ModelError {
    /// The element.
    pub element: Element,
    /// Its key, as in the study file.
    pub key: &'static str,
    /// The fault and the expected value.
    pub message: String,
    /// A name that does not exist, for which a caller can suggest a similar one.
    pub wrong_name: Option<String>,
}

impl ModelError {
    pub(super) fn new(element: Element, key: &'static str, message: impl Into<String>) -> Self {
        ModelError { element, key, message: message.into(), wrong_name: None }
    }
}

/// A fault of an element that is not yet part of a model.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{key}`: {message} ({help})")]
pub struct ElementFault {
    /// Its key, as in the study file.
    pub key: &'static str,
    /// The fault and the expected value.
    pub message: String,
    /// A remedy.
    pub help: &'static str,
}

impl ElementFault {
    pub(super) fn new(key: &'static str, message: String, help: &'static str) -> Self {
        ElementFault { key, message, help }
    }
}
