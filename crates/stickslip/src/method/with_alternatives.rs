//! Advice for a method that refuses a system or finds no orbit: alternative methods, and bodies
//! that friction alone holds.
//!
//! The functions try to make a solver of every method in the list.

use super::list::LIST;
use super::{
    Alternatives, Budget, Method, MethodError, MethodInfo, Options, OrbitError, Request, Solver, WIDTH, event_driven,
    transient,
};
use crate::model::{FrictionDirection, System};
use crate::orbit::Orbit;
use std::sync::OnceLock;

/// Makes the solver of a method for one system, with errors that name alternative methods.
///
/// # Errors
/// Same as [`Method::solver`], and the error also names the methods that take the system.
///
/// # Example
/// ```
/// use stickslip::law::Stribeck;
/// use std::sync::Arc;
/// use stickslip::method::{solver_with_alternatives, event_driven::EventDriven, find};
/// let mut model = stickslip::model::example::blade_couple();
/// model.joints[0].law = Arc::new(Stribeck { limit: 2.0, static_limit: 3.0, velocity: 0.01 });
/// let system = model.assemble().unwrap();
/// let error = solver_with_alternatives(&EventDriven, &system).err().unwrap();
/// let alternatives = error.alternatives().unwrap();
/// assert_eq!(alternatives.methods, ["transient", "shooting", "harmonic-balance"]);
/// let shooting = (find("shooting").unwrap().build)(&Default::default()).unwrap();
/// assert!(shooting.solver(&system).is_ok());
/// ```
pub fn solver_with_alternatives<'a>(
    method: &dyn Method,
    system: &'a System,
) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
    let solver = method.solver(system).map_err(|error| error.with_alternatives(alternatives(system)))?;
    Ok(Box::new(WithAlternatives { solver, system, creeping: OnceLock::new() }))
}

/// Returns the methods of the list that take a system.
pub fn alternatives(system: &System) -> Alternatives {
    alternatives_among(system, |_| true)
}

/// Tests the methods with names that `asked` accepts.
fn alternatives_among(system: &System, asked: impl Fn(&str) -> bool) -> Alternatives {
    let mut alternatives = Alternatives::default();
    for row in LIST.iter().filter(|row| asked(row.name)) {
        let plain = Options::new();
        // A width (m/s) with which to test for smoothing. Laws can be smoothed over every width or
        // over none.
        let smoothed = Options::from([(WIDTH.to_owned(), 1e-3)]);
        let smooths = row.options.iter().any(|option| option.key == WIDTH);
        // the refusal of smoothed laws names the real obstacle
        let last = if smooths { &smoothed } else { &plain };
        match (refusal(row, &plain, system), refusal(row, last, system)) {
            (None, _) => alternatives.methods.push(row.name),
            (Some(_), None) => alternatives.with_width.push(row.name),
            (Some(_), Some(refusal)) => {
                let said = refusal.strip_prefix(row.name).map(|rest| rest.trim_start().to_owned()).unwrap_or(refusal);
                match alternatives.reasons.iter_mut().find(|(_, known)| *known == said) {
                    Some((methods, _)) => methods.push(row.name),
                    None => alternatives.reasons.push((vec![row.name], said)),
                }
            }
        }
    }
    if alternatives.any() {
        alternatives.reasons.clear();
    }
    alternatives
}

/// A solver whose errors name other methods that may find the orbit, and bodies that may creep.
struct WithAlternatives<'a> {
    solver: Box<dyn Solver + Send + 'a>,
    system: &'a System,
    /// Directions in which friction alone holds a body, computed at the first failure.
    creeping: OnceLock<Vec<FrictionDirection>>,
}

impl Solver for WithAlternatives<'_> {
    fn solve(&mut self, request: &Request<'_>, budget: &mut Budget) -> Result<Orbit, OrbitError> {
        self.solver.solve(request, budget).map_err(|error| {
            let mut error = with_alternatives(error, self.system);
            if let OrbitError::NotConverged { advice, omega, .. } | OrbitError::Drift { advice, omega, .. } = &mut error
            {
                let creeping = self.creeping.get_or_init(|| self.system.directions_held_by_friction());
                advice.push_str(&creeping_advice(creeping, *omega));
            }
            error
        })
    }
}

/// Returns advice about bodies that friction alone holds along some directions, as text that
/// follows other text. Without such bodies it is empty.
fn creeping_advice(directions: &[FrictionDirection], omega: f64) -> String {
    // Number of directions that are named.
    let max_named = 3;
    let Some(first) = directions.first() else { return String::new() };
    let names: Vec<String> = directions.iter().take(max_named).map(|one| format!("`{}`", one.place)).collect();
    let more = directions.len().saturating_sub(max_named);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!(
        "; friction alone holds {}{more}, where a body may drift: support it as the real part is supported, or by a soft \
         spring ({:.1e} {} on `{}` is a tenth of its inertia)",
        names.join(", "),
        first.spring(omega),
        first.spring_unit(),
        first.place,
    )
}

/// Adds alternative methods to an error.
fn with_alternatives(mut error: OrbitError, system: &System) -> OrbitError {
    // Errors of larger systems name no alternatives: no other method is fast enough there, and
    // testing all methods takes 0.1 s.
    if system.dofs() > 200 {
        return error;
    }
    let words = |asked: &dyn Fn(&str) -> bool| {
        let alternatives = alternatives_among(system, asked);
        if alternatives.any() { format!(", or {alternatives}") } else { String::new() }
    };
    match &mut error {
        // `transient` is the last resort; the method that failed is not named again
        OrbitError::Truncation { method, advice, .. } | OrbitError::NotConverged { method, advice, .. }
            if advice.is_empty() =>
        {
            *advice = words(&|name| ![*method, transient::INFO.name].contains(&name));
        }
        OrbitError::Unsettled { method, advice, repeats: None, .. } => *advice = words(&|name| name != *method),
        OrbitError::Drift { method, advice, .. } if *method != event_driven::INFO.name => {
            let exact = words(&|name| name == event_driven::INFO.name);
            *advice =
                if exact.is_empty() { exact } else { format!("{exact}, which may find a motion that friction holds") };
        }
        _ => {}
    }
    error
}

/// Returns the reason for which a method refuses a system, or `None` if it accepts the system.
fn refusal(row: &MethodInfo, options: &Options, system: &System) -> Option<String> {
    let solver = (row.build)(options).and_then(|method| method.solver(system).map(drop));
    solver.err().map(|error| error.without_alternatives().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, SharedLaw};
    use crate::method::harmonic_balance::HarmonicBalance;
    use std::sync::Arc;

    /// No series of this length reaches the tolerance. The error names methods that take the
    /// law, and no method that refuses it.
    #[test]
    fn errors_name_methods_that_take_the_system() {
        let exact: SharedLaw = Arc::new(Coulomb { limit: 4.0 });
        for (law, named, unnamed) in [
            (exact, "`event-driven`, or `shooting` with the option `width`", "`transient`"),
            (Arc::new(CoulombArctan { limit: 4.0, alpha: 1e4 }), "`shooting`", "event-driven"),
        ] {
            let mut model = crate::model::example::blade_couple();
            model.joints[0].law = law;
            let system = model.assemble().unwrap();
            let method = HarmonicBalance { tolerance: Some(1e-11), ..HarmonicBalance::default() };
            let error =
                solver_with_alternatives(&method, &system).unwrap().orbit(std::f64::consts::TAU * 121.0).unwrap_err();
            let said = error.to_string();
            assert!(matches!(error, OrbitError::Truncation { .. }), "{said}");
            assert!(said.contains(named) && !said.contains(unnamed), "{said}");
        }
    }
}
