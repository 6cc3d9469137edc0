//! The description of a study kind: its name, its keys, and conditions checked before
//! computing.

use crate::case::values::Values;
use crate::syntax::key::Key;
use crate::syntax::suggest;
use stickslip::dimension::Dimension;
use stickslip::method::{MethodError, Options};
use stickslip::model::{Model, System};

/// The description of a study kind; a study knows nothing else about its kind.
#[derive(Debug, Clone, Copy)]
pub struct KindInfo {
    /// Name in study files.
    pub name: &'static str,
    /// One line that says what the kind computes.
    pub summary: &'static str,
    /// Keys of `[study]`, in addition to the keys that every kind has.
    pub keys: &'static [Key],
    /// Checks conditions between keys, and names that must exist in the model.
    ///
    /// The last argument is the number of values of the last parameter of `vary`, 1 without
    /// `vary`.
    pub check: fn(&Values, &Model, usize) -> Result<(), KeyError>,
    /// Dimensions of the two axes of the figure, if they are the same in every panel.
    pub axes: [Option<Dimension>; 2],
    /// True if the kind finds its orbits with the method of `[method]`, which must then support
    /// the model.
    pub uses_method: bool,
    /// Checks requirements on the system in addition to those of the method.
    ///
    /// A kind that uses no method may still read options of `[method]`.
    pub needs: fn(&Values, &Options, &System) -> Result<(), MethodError>,
    /// True if the kind can refine its frequencies where the curve bends.
    pub adapts: bool,
    /// Names of its tables, the most important first.
    pub tables: &'static [&'static str],
}

/// An error that a kind finds in the values of its keys.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyError {
    /// The key; the error is reported at its value, or at `[study]` if the key is absent.
    pub key: &'static str,
    /// The wrong name inside the value of the key, if the error is about a name.
    pub name: Option<String>,
    /// States what is wrong and what was expected.
    pub message: String,
    /// States what to do.
    pub help: Option<String>,
}

impl KeyError {
    pub(crate) fn new(key: &'static str, message: impl Into<String>, help: impl Into<String>) -> Self {
        KeyError { key, name: None, message: message.into(), help: Some(help.into()) }
    }

    /// Returns the complaint about a name in the value of `key` that is not one of
    /// `candidates`.
    pub(crate) fn unknown_name(key: &'static str, what: &str, name: &str, candidates: &[&str]) -> Self {
        let help = match suggest::suggest(name, candidates.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None if candidates.is_empty() => format!("the model has no {what}"),
            None => format!("choose {}", suggest::alternatives(candidates.iter().take(12).copied())),
        };
        let message = format!("there is no {what} `{}`", suggest::excerpt(name));
        KeyError { key, name: Some(name.to_owned()), message, help: Some(help) }
    }
}
