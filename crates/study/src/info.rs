//! What a study kind says of itself: its name, its keys, and what must hold before anything is computed.

use crate::key::Key;
use crate::near;
use crate::values::Values;
use stickslip::dimension::Dimension;
use stickslip::method::{MethodError, Options};
use stickslip::model::{Model, System};

/// What a study kind says of itself; a study knows of its kind no more than this.
#[derive(Debug, Clone, Copy)]
pub struct KindInfo {
    /// Name in study files.
    pub name: &'static str,
    /// One line of what it computes.
    pub summary: &'static str,
    /// Its keys of `[study]`, beside those that every kind has.
    pub keys: &'static [Key],
    /// What one key alone cannot tell: conditions between keys, names that must exist in the model, and how many values the last parameter
    /// of `vary` must have (1 if there is none).
    pub check: fn(&Values, &Model, usize) -> Result<(), Complaint>,
    /// Dimensions of the two axes of its figure, if they are the same in every panel.
    pub axes: [Option<Dimension>; 2],
    /// Whether it finds its orbits with the method of `[method]`, which must then be able to take the model.
    pub uses_method: bool,
    /// What it needs of a system, beside what its method needs; a kind that uses no method may read options of `[method]` all the same.
    pub needs: fn(&Values, &Options, &System) -> Result<(), MethodError>,
    /// Whether it can place its frequencies where the curve bends.
    pub adapts: bool,
    /// Its tables, the most important first.
    pub tables: &'static [&'static str],
}

/// What a kind finds wrong in the values of its keys.
#[derive(Debug, Clone, PartialEq)]
pub struct Complaint {
    /// The key; the error stands at its value, or at `[study]` if it is absent.
    pub key: &'static str,
    /// The name inside the key's value that is wrong, if it is one.
    pub name: Option<String>,
    /// What is wrong and what was expected.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
}

impl Complaint {
    pub(crate) fn new(key: &'static str, message: impl Into<String>, help: impl Into<String>) -> Self {
        Complaint { key, name: None, message: message.into(), help: Some(help.into()) }
    }

    /// A name in the value of `key` that is none of `candidates`.
    pub(crate) fn unknown(key: &'static str, what: &str, name: &str, candidates: &[&str]) -> Self {
        let help = match near::nearest(name, candidates.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None if candidates.is_empty() => format!("the model has no {what}"),
            None => format!("choose {}", near::one_of(candidates.iter().take(12).copied())),
        };
        let message = format!("there is no {what} `{}`", near::shown(name));
        Complaint { key, name: Some(name.to_owned()), message, help: Some(help) }
    }
}
