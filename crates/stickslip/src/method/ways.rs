//! What to use instead of a method that cannot take a system: every method of the table is asked.

use super::{MethodInfo, Options, TABLE, WIDTH};
use crate::model::System;
use std::fmt;

/// The methods that take a system, those that pick another one left out.
///
/// # Example
/// ```
/// use stickslip::law::Stribeck;
/// use std::sync::Arc;
/// use stickslip::method::{Method, event_driven::EventDriven, find};
/// let mut model = stickslip::model::example::blade_couple();
/// model.joints[0].law = Arc::new(Stribeck { limit: 2.0, static_limit: 3.0, velocity: 0.01 });
/// let system = model.assemble().unwrap();
/// let error = EventDriven.solver(&system).err().unwrap();
/// let ways = error.ways().unwrap();
/// assert_eq!(ways.methods, ["harmonic-balance"]);
/// assert_eq!(ways.with_width, ["transient", "shooting"]);
/// let options = [("width".to_owned(), 1e-4)].into();
/// assert!((find("shooting").unwrap().build)(&options).unwrap().solver(&system).is_ok());
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ways {
    /// Those that take it as it is.
    pub methods: Vec<&'static str>,
    /// Those that take it only with a `width`, which smooths its laws.
    pub with_width: Vec<&'static str>,
    /// What every method misses, where none takes it: methods, and what all of them say.
    pub missing: Vec<(Vec<&'static str>, String)>,
}

/// A velocity, m/s, over which friction is smoothed to see whether it can be: laws have smooth neighbours of every width or of none.
const ANY_WIDTH: f64 = 1e-3;

impl Ways {
    /// Asks every method.
    pub fn of(system: &System) -> Ways {
        let mut ways = Ways::default();
        for row in TABLE {
            let plain = Options::new();
            // what picks another method asks here itself
            if row.name == super::auto::INFO.name {
                continue;
            }
            let smoothed = Options::from([(WIDTH.to_owned(), ANY_WIDTH)]);
            let smooths = row.options.iter().any(|option| option.key == WIDTH);
            // what a method misses in smoothed laws is what is really in its way
            let last = if smooths { &smoothed } else { &plain };
            match (refusal(row, &plain, system), refusal(row, last, system)) {
                (None, _) => ways.methods.push(row.name),
                (Some(_), None) => ways.with_width.push(row.name),
                (Some(_), Some(refusal)) => {
                    let said =
                        refusal.strip_prefix(row.name).map(|rest| rest.trim_start().to_owned()).unwrap_or(refusal);
                    match ways.missing.iter_mut().find(|(_, known)| *known == said) {
                        Some((methods, _)) => methods.push(row.name),
                        None => ways.missing.push((vec![row.name], said)),
                    }
                }
            }
        }
        if ways.any() {
            ways.missing.clear();
        }
        ways
    }

    /// Whether a method takes it.
    pub fn any(&self) -> bool {
        !(self.methods.is_empty() && self.with_width.is_empty())
    }

    /// In words, behind a sentence that says what is wrong; empty where nobody has asked.
    pub(super) fn behind(&self) -> String {
        if *self == Ways::default() { String::new() } else { format!("; {self}") }
    }
}

/// Why a method refuses a system, if it does.
fn refusal(row: &MethodInfo, options: &Options, system: &System) -> Option<String> {
    let prepared = (row.build)(options).and_then(|method| method.prepare(system).map(drop));
    prepared.err().map(|error| error.alone().to_string())
}

/// `` `a`, `b` or `c` ``.
fn one_of(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match quoted.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => quoted.concat(),
    }
}

impl fmt::Display for Ways {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = "with a `width` (m/s) over which friction changes its sign";
        match (&self.methods[..], &self.with_width[..]) {
            ([], []) => {
                let one = |(methods, said): &(Vec<&str>, String)| format!("{} {said}", methods.join(" and "));
                write!(f, "no method takes it: {}", self.missing.iter().map(one).collect::<Vec<_>>().join("; "))
            }
            (methods, []) => write!(f, "use method {}", one_of(methods)),
            ([], smoothing) => write!(f, "use method {} {width}", one_of(smoothing)),
            (methods, smoothing) => write!(f, "use method {}, or {} {width}", one_of(methods), one_of(smoothing)),
        }
    }
}
