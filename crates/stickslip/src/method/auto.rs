//! Picks a method: event-driven for exact laws, shooting for smooth ones, harmonic balance where it costs less and for waves around a disk.

use super::followed::Kind;
use super::harmonic_balance::HarmonicBalance;
use super::list::LIST;
use super::{
    Choice, Method, MethodError, MethodInfo, Options, Solver, event_driven, event_driven::EventDriven,
    harmonic_balance, shooting::Shooting, transient, ways,
};
use crate::law::Law;
use crate::model::System;
use crate::orbit::{Orbit, OrbitError};

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: "auto",
    summary: "event-driven where all laws are exact, shooting where all are smooth, or friction falls with velocity along a smooth curve; harmonic balance where neither holds (friction in a plane or with \
              a normal force, mixtures), where a place has no mass, where fewer multiplications are counted for it than from event to event, beyond 12 smooth \
              joints or 24 degrees of freedom with them, and for waves around a tuned disk; what it does not take goes to the method that does, \
              and a point that it does not find to the next one that takes it within seconds",
    options: &[],
    build: |_| Ok(Box::new(Auto)),
};

/// Joints with smooth laws up to which shooting follows the motion: it carries a sensitivity as wide as the state, whose cost is the cube of the size, that
/// of harmonic balance the first power.
const FOLLOWED: usize = 12;
/// Degrees of freedom up to which it does. Measured on chains with two joints, seconds a point: 0.014, 0.1, 0.5, 2.3 with 30, 60, 100, 150 of them;
/// harmonic balance 0.004 to 0.009. A chain of 60 by its matrices with a `bouc-wen` took minutes, and 1.3 s as a series.
const DOFS: usize = 24;
/// Multiplications for an orbit beyond which nothing is followed from event to event, whatever the other way costs: a minute.
const DEAREST: f64 = 3e11;
/// The same of a point that another method did not find: seconds. Measured: a chain of 40 masses 1.2 s a point, of 80, which are above it, ten and more.
const SECOND: f64 = 1e10;
/// How far apart orbits are is not known: between near and alone.
const APART: f64 = 2.0;

/// The choice by the laws of a system's joints and their number.
///
/// # Example
/// ```
/// use stickslip::method::{Method, auto::Auto};
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// assert_eq!(Auto.choice(&system).to_string(), "event-driven (chosen by auto: every law is exact)");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Auto;

impl Auto {
    /// The method and why; where harmonic balance refuses a law, one that takes the system.
    fn chosen(system: &System) -> (Box<dyn Method>, String) {
        let (method, because) = Auto::by_laws(system);
        if method.name() != harmonic_balance::NAME || HarmonicBalance::takes_laws(system) {
            return (method, because);
        }
        let methods = ways(system).methods;
        // waiting is the last resort
        let other = methods.iter().find(|name| **name != transient::INFO.name).or(methods.first());
        match other.and_then(|name| named(name)) {
            Some(other) => (other, format!("{} refuses a law", harmonic_balance::NAME)),
            // who refuses says what else there is
            None => (method, because),
        }
    }

    /// The choice by laws and sizes.
    fn by_laws(system: &System) -> (Box<dyn Method>, String) {
        let joints = system.joints().len();
        let smooth = system.joints().iter().all(|joint| joint.law().rate().is_some());
        let massless = (0..system.dofs()).any(|dof| system.structure().own_mass(dof) <= 0.0);
        let events = event_driven::orbit_work(system).map(|work| APART * work);
        let balance =
            |because: String| -> (Box<dyn Method>, String) { (Box::new(HarmonicBalance::default()), because) };
        if joints > 0 && system.cyclic().is_some() {
            balance("one of equal sectors is solved".to_owned())
        } else if massless {
            balance("a place has no mass".to_owned())
        } else if !system.structure().has_definite_mass() {
            balance("some motion has no mass".to_owned())
        } else if let Some(events) = events {
            if events > DEAREST || events > harmonic_balance::orbit_work(system) {
                let sizes = format!("{} degrees of freedom and {joints} joints", system.dofs());
                return balance(format!("faster than from event to event with {sizes}"));
            }
            let because = if joints == 0 { "there are no joints" } else { "every law is exact" };
            (Box::new(EventDriven), because.to_owned())
        } else if falls(system)
            && Kind::of(system, None) == Kind::Switched
            && system.dofs() <= DOFS
            && joints <= FOLLOWED
        {
            let because = "friction falls with velocity, and its switches are located";
            (Box::new(Shooting::default()), because.to_owned())
        } else if !smooth {
            balance("neither are all laws exact nor all smooth".to_owned())
        } else if system.dofs() > DOFS {
            balance(format!("{} degrees of freedom are more than {DOFS}", system.dofs()))
        } else if joints > FOLLOWED {
            balance(format!("{joints} joints are more than {FOLLOWED}"))
        } else {
            (Box::new(Shooting::default()), "the laws are smooth".to_owned())
        }
    }
}

/// Whether friction falls with velocity somewhere, of which a series needs many harmonics.
fn falls(system: &System) -> bool {
    let falls = |law: &dyn Law| law.sliding().is_some() && !law.is_incrementally_passive();
    system.joints().iter().any(|joint| falls(&**joint.law()))
}

impl Method for Auto {
    fn name(&self) -> &'static str {
        INFO.name
    }
    fn choice(&self, system: &System) -> Choice {
        let (method, because) = Auto::chosen(system);
        Choice { method: method.name(), because: Some(format!("chosen by auto: {because}")) }
    }
    fn closes_motions(&self, system: &System) -> bool {
        Auto::chosen(system).0.closes_motions(system)
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let (method, _) = Auto::chosen(system);
        let first = method.solver(system)?;
        Ok(Box::new(WithSecond { first, chosen: method.name(), system, second: None, last: None, effort: 0.0 }))
    }
}

/// The method that was chosen, and where it finds nothing the next one that takes the system within seconds.
struct WithSecond<'a> {
    first: Box<dyn Solver + Send + 'a>,
    chosen: &'static str,
    system: &'a System,
    /// Once it was needed, with its name; `None` inside if there is none.
    second: Option<Option<(&'static str, Box<dyn Solver + Send + 'a>)>>,
    /// The start of the last orbit that the second one found, which says nothing to the first.
    last: Option<Vec<f64>>,
    /// The work of those that were asked for the last orbit.
    effort: f64,
}

impl<'a> WithSecond<'a> {
    /// The method to ask next. Waiting for a transient takes minutes.
    fn next(&self) -> Option<(&'static str, Box<dyn Solver + Send + 'a>)> {
        let (system, joints) = (self.system, self.system.joints().len());
        let cheap = |name: &str| match name {
            harmonic_balance::NAME => true,
            name if name == event_driven::INFO.name => {
                event_driven::orbit_work(system).is_some_and(|work| event_driven::ALONE * work <= SECOND)
            }
            name => name != transient::INFO.name && system.dofs() <= DOFS && joints <= FOLLOWED,
        };
        let methods = ways(system).methods;
        let name = methods.into_iter().find(|name| *name != self.chosen && cheap(name))?;
        Some((name, named(name)?.solver(system).ok()?))
    }

    /// By the first method, and by the second one where that finds nothing that it may have missed.
    fn seek(&mut self, omega: f64, start: Option<&[f64]>, between: bool) -> Result<Orbit, OrbitError> {
        let by = |solver: &mut (dyn Solver + Send + 'a), start| match between {
            true => solver.between(omega, start),
            false => solver.orbit(omega, start),
        };
        let own = start.filter(|start| self.last.as_deref() != Some(*start));
        let found = by(&mut *self.first, own);
        self.effort = self.first.effort();
        let error = match found {
            Err(error) if misses(&error) => error,
            outcome => return outcome,
        };
        if self.second.is_none() {
            self.second = Some(self.next());
        }
        let Some((name, second)) = self.second.as_mut().and_then(Option::as_mut) else { return Err(error) };
        let near = start.filter(|start| self.last.as_deref() == Some(*start));
        let found = by(&mut **second, near);
        self.effort += second.effort();
        let mut orbit = found.map_err(|_| error.after(name))?;
        orbit.evidence.instead_of = Some(self.chosen);
        self.last = Some(orbit.start.clone());
        Ok(orbit)
    }
}

/// The method of the list with this name, without options.
fn named(name: &str) -> Option<Box<dyn Method>> {
    (LIST.iter().find(|row| row.name == name)?.build)(&Options::new()).ok()
}

/// Whether another method may find what this one says that it did not.
fn misses(error: &OrbitError) -> bool {
    matches!(
        error,
        OrbitError::NotConverged { .. }
            | OrbitError::Breakdown { .. }
            | OrbitError::Evidence { .. }
            | OrbitError::Truncation { .. }
    )
}

impl Solver for WithSecond<'_> {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.seek(omega, start, false)
    }
    fn between(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.seek(omega, start, true)
    }
    fn effort(&self) -> f64 {
        self.effort
    }
    fn begin_at(&mut self, omega: f64, start: &[f64]) {
        match self.second.as_mut().and_then(Option::as_mut).filter(|_| self.last.as_deref() == Some(start)) {
            Some((_, second)) => second.begin_at(omega, start),
            None => self.first.begin_at(omega, start),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Iwan, Jenkins, SharedLaw, Stribeck};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, example};
    use std::f64::consts::TAU;
    use std::sync::Arc;

    #[test]
    fn many_sliders_of_one_joint_are_not_followed_one_by_one() {
        for (elements, method) in [(8, "event-driven"), (600, "harmonic-balance")] {
            let mut model = example::blade_couple();
            model.joints[0].law = Arc::new(Iwan { stiffness: 2e4, limit: 4.0, chi: -0.5, beta: 0.3, elements });
            assert_eq!(Auto.choice(&model.assemble().unwrap()).method, method);
        }
    }

    /// A ring of masses that differ, with this law between neighbours.
    fn ring(masses: usize, law: &SharedLaw) -> Model {
        let name = |i: usize| format!("b{}", i % masses);
        let spring = |between, stiffness| Spring { between, stiffness, damping: 1.0 };
        let mut model = Model::default();
        for i in 0..masses {
            let next = [name(i), name(i + 1)];
            model.masses.push(Mass::new(name(i), 0.2 + 0.001 * (i as f64).sin()));
            model.springs.push(spring([name(i), GROUND.to_owned()], 1e5));
            model.springs.push(spring(next.clone(), 6e3));
            model.joints.push(Joint { name: format!("j{i}"), between: next, law: law.clone() });
        }
        model
    }

    /// What was measured, seconds a point in a sweep: `coulomb` 0.068 from event to event and more than 1.3 as a series for 36 masses, 6 to 15 and 1 to 12
    /// for 100; `jenkins` 0.0021 and 0.0013, 0.0106 and 0.0047, 0.44 and 0.012 for 4, 12 and 36; as a series 0.13 for 200 of them.
    #[test]
    fn the_faster_method_is_chosen() {
        let rigid: SharedLaw = Arc::new(Coulomb { limit: 2.0 });
        let spring: SharedLaw = Arc::new(Jenkins { stiffness: 1e4, limit: 2.0 });
        for (law, masses, method) in [
            (&rigid, 4, "event-driven"),
            (&rigid, 36, "event-driven"),
            (&rigid, 200, "harmonic-balance"),
            (&spring, 4, "event-driven"),
            (&spring, 12, "harmonic-balance"),
            (&spring, 36, "harmonic-balance"),
        ] {
            let system = ring(masses, law).assemble().unwrap();
            assert_eq!(Auto.choice(&system).method, method, "{masses} of {}", law.name());
        }
    }

    /// Harmonic balance takes places without mass, and event-driven a static limit above the dynamic one at any number of joints.
    #[test]
    fn what_the_first_choice_refuses_goes_to_who_takes_it() {
        let mut massless = example::blade_couple();
        massless.masses[1].mass = 0.0;
        let many = ring(200, &(Arc::new(Stribeck { limit: 2.0, static_limit: 3.0, velocity: 0.0 }) as SharedLaw));
        for (model, method) in [(massless, "harmonic-balance"), (many, "event-driven")] {
            let system = model.assemble().unwrap();
            assert_eq!(Auto.choice(&system).method, method);
            assert!(Auto.solver(&system).is_ok(), "{}", Auto.choice(&system));
        }
    }

    /// Finds nothing, and has to be asked without the start that another method left.
    struct Nothing;

    impl Solver for Nothing {
        fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
            assert!(start.is_none());
            Err(OrbitError::not_converged("nothing", omega, 1, 1.0))
        }
    }

    #[test]
    fn what_the_first_choice_does_not_find_the_next_one_may() {
        let system = example::blade_couple().assemble().unwrap();
        for (chosen, next) in [("event-driven", "harmonic-balance"), ("harmonic-balance", "event-driven")] {
            let first = Box::new(Nothing);
            let mut solver = WithSecond { first, chosen, system: &system, second: None, last: None, effort: 0.0 };
            let orbit = solver.orbit(TAU * 121.0, None).unwrap();
            let neighbour = solver.orbit(TAU * 121.1, Some(&orbit.start)).unwrap();
            assert_eq!((orbit.method, neighbour.method), (next, next));
            assert_eq!(orbit.evidence.instead_of, Some(chosen));
        }
    }

    /// What both were asked for in vain sends nobody from one to the other.
    #[test]
    fn who_was_asked_in_vain_is_not_advised() {
        let system = example::blade_couple().assemble().unwrap();
        let second = Some(Some(("harmonic-balance", Box::new(Nothing) as Box<dyn Solver + Send>)));
        let first = Box::new(Nothing);
        let mut solver = WithSecond { first, chosen: "event-driven", system: &system, second, last: None, effort: 0.0 };
        let said = solver.orbit(TAU * 121.0, None).unwrap_err().to_string();
        assert!(said.ends_with("; `harmonic-balance` finds none either"), "{said}");
    }

    /// A tolerance that no series which a point can pay for reaches is refused after a few short ones, with how many harmonics it would take.
    #[test]
    fn rigid_friction_that_needs_too_many_harmonics_is_refused_early() {
        let mut model = ring(36, &(Arc::new(Coulomb { limit: 0.3 }) as SharedLaw));
        model.forces.push(Force { on: "b0".to_owned(), amplitude: 5.0, phase: 0.0, harmonic: 1 });
        let system = model.assemble().unwrap();
        let method = HarmonicBalance { tolerance: Some(1e-6), ..HarmonicBalance::default() };
        let error = method.solver(&system).unwrap().orbit(TAU * 112.0, None).unwrap_err();
        let OrbitError::Truncation { harmonics, needed: Some(needed), .. } = error else { panic!("{error}") };
        assert!(harmonics < 100 && needed > 500, "{harmonics} {needed}");
        assert!(error.to_string().contains("jenkins"), "{error}");
    }
}
