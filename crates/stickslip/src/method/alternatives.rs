//! The methods that accept a system which another method refuses.

use std::fmt;

/// The methods that take a system, without `auto`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Alternatives {
    /// Methods that take the system unchanged.
    pub methods: Vec<&'static str>,
    /// Methods that take the system only with a `width`, which smooths its laws.
    pub with_width: Vec<&'static str>,
    /// Reasons of all methods if none takes the system: the methods with the same reason, and
    /// the reason.
    pub reasons: Vec<(Vec<&'static str>, String)>,
}

impl Alternatives {
    /// Returns true if at least one method takes the system.
    pub fn any(&self) -> bool {
        !(self.methods.is_empty() && self.with_width.is_empty())
    }

    /// Returns the text that follows an error message; empty if no methods are known.
    pub(super) fn suffix(&self) -> String {
        if *self == Alternatives::default() { String::new() } else { format!("; {self}") }
    }
}

/// Formats names as `` `a`, `b` or `c` ``.
fn one_of(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match quoted.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => quoted.concat(),
    }
}

impl fmt::Display for Alternatives {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = "with the option `width` (m/s), which smooths the friction";
        match (&self.methods[..], &self.with_width[..]) {
            ([], []) => {
                let one = |(methods, said): &(Vec<&str>, String)| match &methods[..] {
                    [only] => format!("{only} {said}"),
                    [first, other] => format!("{first} {said} (also {other})"),
                    [first, others @ ..] => format!("{first} {said} (also {})", others.join(" and ")),
                    [] => said.clone(),
                };
                write!(
                    f,
                    "no method accepts this system: {}",
                    self.reasons.iter().map(one).collect::<Vec<_>>().join("; ")
                )
            }
            (methods, []) => write!(f, "use method {}", one_of(methods)),
            ([], smoothing) => write!(f, "use method {} {width}", one_of(smoothing)),
            (methods, smoothing) => write!(f, "use method {}, or {} {width}", one_of(methods), one_of(smoothing)),
        }
    }
}
