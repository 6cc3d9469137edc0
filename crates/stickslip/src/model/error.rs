//! Why a model is refused.

use std::fmt;

/// The element of a model that an error is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)] // index into the list of the model that has the same name
pub enum Element {
    Mass(usize),
    Spring(usize),
    Joint(usize),
    Force(usize),
    Motion(usize),
    Place(usize),
    Substructure,
    Whole,
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, index) = match self {
            Element::Mass(i) => ("mass", i),
            Element::Spring(i) => ("spring", i),
            Element::Joint(i) => ("joint", i),
            Element::Force(i) => ("force", i),
            Element::Motion(i) => ("motion", i),
            Element::Place(i) => ("place", i),
            Element::Substructure => return write!(f, "structure"),
            Element::Whole => return write!(f, "model"),
        };
        write!(f, "{what} {}", index + 1)
    }
}

/// Why a model is refused: which element, which key of it, what is wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{element}, `{key}`: {message}")]
pub struct ModelError {
    /// The element.
    pub element: Element,
    /// Its key (as in the study file).
    pub key: &'static str,
    /// What is wrong and what was expected.
    pub message: String,
    /// The name that was probably meant, if there is one like it.
    pub wrong_name: Option<String>,
}

impl ModelError {
    pub(super) fn new(element: Element, key: &'static str, message: impl Into<String>) -> Self {
        ModelError { element, key, message: message.into(), wrong_name: None }
    }
}
