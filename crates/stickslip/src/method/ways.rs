//! What to use instead of a method that cannot take a system: every method of the table is asked.

use super::{MethodInfo, Options, Solver, TABLE, WIDTH, auto, event_driven, transient};
use crate::model::System;
use crate::orbit::{Orbit, OrbitError};
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
        // what picks another method asks here itself
        Ways::among(system, |name| name != auto::INFO.name)
    }

    /// Asks the methods whose names `asked` accepts.
    fn among(system: &System, asked: impl Fn(&str) -> bool) -> Ways {
        let mut ways = Ways::default();
        for row in TABLE.iter().filter(|row| asked(row.name)) {
            let plain = Options::new();
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

/// A solver whose errors name the methods that may find what it did not: only such as take the system.
pub(super) struct Advised<'a> {
    pub solver: Box<dyn Solver + Send + 'a>,
    pub system: &'a System,
}

impl Solver for Advised<'_> {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.solver.orbit(omega, start).map_err(|error| advised(error, self.system))
    }
    fn between(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.solver.between(omega, start).map_err(|error| advised(error, self.system))
    }
    fn begin_at(&mut self, omega: f64, start: &[f64]) {
        self.solver.begin_at(omega, start);
    }
}

/// Degrees of freedom beyond which no other method is fast enough to be named, and to ask all of them takes a tenth of a second.
const ASKED: usize = 200;

/// An error with what to use instead.
fn advised(mut error: OrbitError, system: &System) -> OrbitError {
    if system.dofs() > ASKED {
        return error;
    }
    let words = |asked: &dyn Fn(&str) -> bool| {
        let ways = Ways::among(system, |name| name != auto::INFO.name && asked(name));
        if ways.any() { format!(", or {ways}") } else { String::new() }
    };
    match &mut error {
        // waiting is the last resort
        OrbitError::Truncation { method, instead, .. } | OrbitError::NotConverged { method, instead, .. } => {
            *instead = words(&|name| ![*method, transient::INFO.name].contains(&name));
        }
        OrbitError::Unsettled { method, instead, repeats: None, .. } => *instead = words(&|name| name != *method),
        OrbitError::Drift { method, instead, .. } if *method != event_driven::INFO.name => {
            *instead = words(&|name| name == event_driven::INFO.name);
        }
        _ => {}
    }
    error
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
                let one = |(methods, said): &(Vec<&str>, String)| match &methods[..] {
                    [only] => format!("{only} {said}"),
                    [first, other] => format!("{first} {said}, and so does {other}"),
                    [first, others @ ..] => format!("{first} {said}, and so do {}", others.join(" and ")),
                    [] => said.clone(),
                };
                write!(f, "no method takes it: {}", self.missing.iter().map(one).collect::<Vec<_>>().join("; "))
            }
            (methods, []) => write!(f, "use method {}", one_of(methods)),
            ([], smoothing) => write!(f, "use method {} {width}", one_of(smoothing)),
            (methods, smoothing) => write!(f, "use method {}, or {} {width}", one_of(methods), one_of(smoothing)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, SharedLaw};
    use crate::method::{Method, harmonic_balance::HarmonicBalance};
    use std::sync::Arc;

    /// A tolerance that no series of this length reaches: what is named takes the law, and what does not take it is not named.
    #[test]
    fn errors_name_methods_that_take_the_system() {
        let exact: SharedLaw = Arc::new(Coulomb { limit: 4.0 });
        for (law, named, unnamed) in [
            (exact, "`event-driven`, or `shooting` with a `width`", "`transient`"),
            (Arc::new(CoulombArctan { limit: 4.0, alpha: 1e4 }), "`shooting`", "event-driven"),
        ] {
            let mut model = crate::model::example::blade_couple();
            model.joints[0].law = law;
            let system = model.assemble().unwrap();
            let method = HarmonicBalance { tolerance: Some(1e-11), ..HarmonicBalance::default() };
            let error = method.solver(&system).unwrap().orbit(std::f64::consts::TAU * 121.0, None).unwrap_err();
            let said = error.to_string();
            assert!(matches!(error, OrbitError::Truncation { .. }), "{said}");
            assert!(said.contains(named) && !said.contains(unnamed), "{said}");
        }
    }
}
