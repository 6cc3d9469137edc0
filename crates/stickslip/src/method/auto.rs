//! Method `auto`: picks a method by the laws and the size of the system.
//!
//! It picks event-driven for exact laws and shooting for smooth laws. It picks harmonic balance
//! for cheaper or other systems, and for travelling waves on a disk.

use super::event_driven::EventDriven;
use super::flow::integrator_choice::IntegratorKind;
use super::harmonic_balance::HarmonicBalance;
use super::list::LIST;
use super::shooting::Shooting;
use super::{
    Budget, Choice, ErrorEstimate, Method, MethodError, MethodInfo, Options, Request, Seed, Solver, alternatives,
    event_driven, harmonic_balance, transient,
};
use crate::law::Law;
use crate::model::System;
use crate::orbit::{Accuracy, ObservedMotion, Orbit, OrbitError};

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: "auto",
    summary: "selects a method: event-driven for exact laws; shooting for smooth laws and for friction that falls with \
              velocity along a smooth curve, up to 12 joints and 24 degrees of freedom; harmonic balance for all \
              other systems, for places without mass, for travelling waves on a tuned disk, and if it is faster; \
              another method if the selected one refuses the system, and a second fast one if it finds no orbit",
    options: &[],
    build: |_| Ok(Box::new(Auto)),
};

/// Limits at which `auto` prefers one method to another.
#[derive(Debug, Clone, Copy)]
struct AutoSettings {
    /// Most joints with smooth laws for shooting. The cost of its sensitivity grows with the cube
    /// of the state size; the cost of harmonic balance grows linearly.
    shooting_joints: usize,
    /// Most degrees of freedom for shooting. Measured on chains with two joints and 30, 60, 100
    /// and 150 degrees of freedom: 0.014, 0.1, 0.5 and 2.3 s per point; harmonic balance takes
    /// 0.004 to 0.009 s. A chain of 60 given by matrices, with a `bouc-wen`, takes minutes;
    /// harmonic balance takes 1.3 s.
    shooting_dofs: usize,
    /// Most multiplications per orbit for event-driven, about one minute, whatever the other
    /// methods cost.
    event_driven_work: f64,
    /// Most multiplications for event-driven as the second method, a few seconds. Measured: a
    /// chain of 40 masses takes 1.2 s per point. A chain of 80 masses is above the bound and takes
    /// ten seconds or more.
    fallback_work: f64,
    /// Factor on the cost of an orbit with a close warm start. The spacing of the orbits is
    /// unknown here, so the factor lies between that cost and the cost without a warm start.
    spacing_factor: f64,
    /// Cost factor of an event-driven orbit without a warm start. Measured in rings of `coulomb`
    /// with 24, 36 and 60 masses: 57 ms, 0.34 s and 4.8 s; 36 sectors of two masses 1.8 s, 100 of
    /// one 6 to 17 s.
    cold_start_factor: f64,
}

impl Default for AutoSettings {
    fn default() -> Self {
        AutoSettings {
            shooting_joints: 12,
            shooting_dofs: 24,
            event_driven_work: 3e11,
            fallback_work: 1e10,
            spacing_factor: 2.0,
            cold_start_factor: 3.0,
        }
    }
}

/// Picks a method by the laws and the number of joints.
///
/// # Example
/// ```
/// use stickslip::method::{Method, auto::Auto};
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let choice = Auto.choice(&system).to_string();
/// assert_eq!(choice, "event-driven (chosen by auto: every law is exact)");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Auto;

impl Auto {
    /// Returns the picked method and the reason. If harmonic balance is picked and refuses a
    /// law, returns another method that takes the system.
    fn pick(system: &System) -> (Box<dyn Method>, String) {
        let (method, because) = Auto::pick_by_laws(system);
        if method.name() != harmonic_balance::NAME || HarmonicBalance::takes_laws(system) {
            return (method, because);
        }
        let methods = alternatives(system).methods;
        // `transient` is the last resort
        let other = methods.iter().find(|name| **name != transient::INFO.name).or(methods.first());
        match other.and_then(|name| build_named(name)) {
            Some(other) => (other, format!("{} refuses a law", harmonic_balance::NAME)),
            // the error of the refusing method lists the alternatives
            None => (method, because),
        }
    }

    /// Picks a method by the laws and sizes.
    fn pick_by_laws(system: &System) -> (Box<dyn Method>, String) {
        let settings = AutoSettings::default();
        let joints = system.joints().len();
        let smooth = system.joints().iter().all(|joint| joint.law().rate().is_some());
        let massless = (0..system.dofs()).any(|dof| system.structure().diagonal_mass(dof) <= 0.0);
        let events = event_driven::orbit_work(system).map(|work| settings.spacing_factor * work);
        let balance =
            |because: String| -> (Box<dyn Method>, String) { (Box::new(HarmonicBalance::default()), because) };
        if joints > 0 && system.cyclic().is_some() {
            balance("it solves one sector of the tuned disk".to_owned())
        } else if massless {
            balance("a place has no mass".to_owned())
        } else if !system.structure().has_definite_mass() {
            balance("the mass matrix is singular".to_owned())
        } else if let Some(events) = events {
            if events > settings.event_driven_work || events > harmonic_balance::orbit_work(system) {
                let sizes = format!("{} degrees of freedom and {joints} joints", system.dofs());
                return balance(format!("faster than event-driven with {sizes}"));
            }
            let because = if joints == 0 { "there are no joints" } else { "every law is exact" };
            (Box::new(EventDriven), because.to_owned())
        } else if has_falling_friction(system)
            && IntegratorKind::of(system, None) == IntegratorKind::Switched
            && system.dofs() <= settings.shooting_dofs
            && joints <= settings.shooting_joints
        {
            let because = "friction falls with velocity along a smooth curve; shooting locates its switches";
            (Box::new(Shooting::default()), because.to_owned())
        } else if !smooth {
            balance("the laws are neither all exact nor all smooth".to_owned())
        } else if system.dofs() > settings.shooting_dofs {
            balance(format!(
                "{} degrees of freedom exceed the limit of {} for shooting",
                system.dofs(),
                settings.shooting_dofs
            ))
        } else if joints > settings.shooting_joints {
            balance(format!("{joints} joints exceed the limit of {} for shooting", settings.shooting_joints))
        } else {
            (Box::new(Shooting::default()), "the laws are smooth".to_owned())
        }
    }
}

/// Returns true if the friction of a joint falls with velocity; a series then needs many
/// harmonics.
fn has_falling_friction(system: &System) -> bool {
    let falls = |law: &dyn Law| law.sliding().is_some() && !law.is_incrementally_passive();
    system.joints().iter().any(|joint| falls(&**joint.law()))
}

impl Method for Auto {
    fn name(&self) -> &'static str {
        INFO.name
    }
    fn choice(&self, system: &System) -> Choice {
        let (method, because) = Auto::pick(system);
        Choice { method: method.name(), because: Some(format!("chosen by auto: {because}")) }
    }
    fn closes_motions(&self, system: &System) -> bool {
        Auto::pick(system).0.closes_motions(system)
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let (method, _) = Auto::pick(system);
        let first = method.solver(system)?;
        Ok(Box::new(WithFallback { first, chosen: method.name(), system, second: None }))
    }
}

/// The picked method, and a second method that takes over if the first finds no orbit. The
/// second method must take the system and need only seconds.
struct WithFallback<'a> {
    first: Box<dyn Solver + Send + 'a>,
    chosen: &'static str,
    system: &'a System,
    /// The second method and its name, made at the first use; the inner value is `None` if none
    /// exists.
    second: Option<Option<(&'static str, Box<dyn Solver + Send + 'a>)>>,
}

impl<'a> WithFallback<'a> {
    /// Returns the second method. It is never `transient`, which can take minutes.
    fn fallback(&self) -> Option<(&'static str, Box<dyn Solver + Send + 'a>)> {
        let settings = AutoSettings::default();
        let (system, joints) = (self.system, self.system.joints().len());
        let cheap = |name: &str| match name {
            harmonic_balance::NAME => true,
            name if name == event_driven::INFO.name => event_driven::orbit_work(system)
                .is_some_and(|work| settings.cold_start_factor * work <= settings.fallback_work),
            name => {
                name != transient::INFO.name
                    && system.dofs() <= settings.shooting_dofs
                    && joints <= settings.shooting_joints
            }
        };
        let methods = alternatives(system).methods;
        let name = methods.into_iter().find(|name| *name != self.chosen && cheap(name))?;
        Some((name, build_named(name)?.solver(system).ok()?))
    }

    /// Returns an orbit without truncation error, if the second method is event-driven and finds
    /// one.
    fn exact_orbit(&mut self, request: &Request<'_>, budget: &mut Budget) -> Option<Orbit> {
        let chosen = self.chosen;
        let (name, second) = self.second()?;
        if *name != event_driven::INFO.name {
            return None;
        }
        let near = Request { seed: request.seed.filter(|seed| seed.by_fallback), ..*request };
        let mut orbit = second.solve(&near, budget).ok()?;
        orbit.evidence.fallback_from = Some(chosen);
        Some(orbit)
    }

    /// Returns the second method with its name, made at the first use.
    fn second(&mut self) -> Option<&mut (&'static str, Box<dyn Solver + Send + 'a>)> {
        if self.second.is_none() {
            self.second = Some(self.fallback());
        }
        self.second.as_mut()?.as_mut()
    }
}

/// Builds the method with this name from the list, without options.
fn build_named(name: &str) -> Option<Box<dyn Method>> {
    (LIST.iter().find(|row| row.name == name)?.build)(&Options::new()).ok()
}

/// Returns true if another method may find an orbit after this error.
fn may_succeed_elsewhere(error: &OrbitError) -> bool {
    matches!(
        error,
        OrbitError::NotConverged { .. }
            | OrbitError::Breakdown { .. }
            | OrbitError::Evidence { .. }
            | OrbitError::Truncation { .. }
            | OrbitError::NoOrbit { observed: ObservedMotion::Settles | ObservedMotion::Settling { .. }, .. }
    )
}

/// Returns the largest change of an amplitude, relative to the largest of the first orbit.
fn amplitude_change(one: &Orbit, other: &Orbit) -> f64 {
    let size = one.places.iter().map(|place| place.amplitude()).fold(f64::MIN_POSITIVE, f64::max);
    let pairs = one.places.iter().zip(&other.places);
    pairs.map(|(a, b)| (a.amplitude() - b.amplitude()).abs() / size).fold(0.0, f64::max)
}

impl Solver for WithFallback<'_> {
    /// Searches with the first method, and with the second if the first reports an error that
    /// the second may avoid.
    fn solve(&mut self, request: &Request<'_>, budget: &mut Budget) -> Result<Orbit, OrbitError> {
        // the first method cannot use an orbit of the second one
        let by_second = request.seed.filter(|seed| seed.by_fallback);
        let own = Request { seed: request.seed.filter(|seed| !seed.by_fallback), ..*request };
        let error = match self.first.solve(&own, budget) {
            // an orbit between those of the first method can be omitted
            Err(error) if request.estimate == ErrorEstimate::Skipped && by_second.is_none() => return Err(error),
            Ok(orbit) if orbit.evidence.accuracy == Accuracy::Truncated => {
                return Ok(self.exact_orbit(request, budget).unwrap_or(orbit));
            }
            Err(error) if may_succeed_elsewhere(&error) => error,
            outcome => return outcome,
        };
        let chosen = self.chosen;
        let Some((name, second)) = self.second() else { return Err(error) };
        let candidate = error.candidate().map(|state| Seed::from_state(request.omega, state.to_vec()));
        let near = Request { seed: by_second.or(candidate.as_ref()), ..*request };
        let mut orbit = second.solve(&near, budget).map_err(|_| error.with_failed_alternative(name))?;
        if candidate.is_some() && by_second.is_none() && !orbit.evidence.history_dependent.is_empty() {
            // the candidate and the static equilibrium are two histories of the stuck joints
            let other = second.solve(&Request { seed: None, ..*request }, budget);
            orbit.evidence.history_spread = other.ok().map(|other| amplitude_change(&orbit, &other));
        }
        orbit.evidence.fallback_from = Some(chosen);
        Ok(orbit)
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

    /// Returns a ring of unequal masses with this law between neighbours.
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

    /// Measured seconds per point in a sweep, event-driven and harmonic balance.
    ///
    /// - `coulomb`, 36 masses: 0.068 and more than 1.3; 100 masses: 6 to 15 and 1 to 12.
    /// - `jenkins`, 4 masses: 0.0021 and 0.0013; 12 masses: 0.0106 and 0.0047; 36 masses: 0.44
    ///   and 0.012; 200 masses, harmonic balance alone: 0.13.
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

    /// Harmonic balance takes places without mass. Event-driven takes a static limit above the
    /// dynamic one at any number of joints.
    #[test]
    fn refused_systems_go_to_another_method() {
        let mut massless = example::blade_couple();
        massless.masses[1].mass = 0.0;
        let many = ring(200, &(Arc::new(Stribeck { limit: 2.0, static_limit: 3.0, velocity: 0.0 }) as SharedLaw));
        for (model, method) in [(massless, "harmonic-balance"), (many, "event-driven")] {
            let system = model.assemble().unwrap();
            assert_eq!(Auto.choice(&system).method, method);
            assert!(Auto.solver(&system).is_ok(), "{}", Auto.choice(&system));
        }
    }

    /// A solver that finds no orbit. It asserts that it gets no warm start from another method.
    struct FailingSolver;

    impl Solver for FailingSolver {
        fn solve(&mut self, request: &Request<'_>, _budget: &mut Budget) -> Result<Orbit, OrbitError> {
            assert!(request.seed.is_none());
            Err(OrbitError::not_converged("nothing", request.omega, 1, 1.0))
        }
    }

    #[test]
    fn what_the_first_choice_does_not_find_the_next_one_may() {
        let system = example::blade_couple().assemble().unwrap();
        for (chosen, next) in [("event-driven", "harmonic-balance"), ("harmonic-balance", "event-driven")] {
            let first = Box::new(FailingSolver);
            let mut solver = WithFallback { first, chosen, system: &system, second: None };
            let orbit = solver.orbit(TAU * 121.0).unwrap();
            let neighbour = solver.orbit_near(TAU * 121.1, Some(&orbit.seed())).unwrap();
            assert_eq!((orbit.method, neighbour.method), (next, next));
            assert_eq!(orbit.evidence.fallback_from, Some(chosen));
            // the second method continues its own orbits, but begins none between others
            let (mut budget, seed) = (Budget::default(), neighbour.seed());
            let between = Request::at(TAU * 121.2).without_estimate();
            assert!(solver.solve(&between.near(Some(&seed)), &mut budget).is_ok());
            assert!(solver.solve(&between, &mut budget).is_err());
        }
    }

    /// After both methods failed, the error advises neither of them.
    #[test]
    fn failed_methods_are_not_advised() {
        let system = example::blade_couple().assemble().unwrap();
        let second = Some(Some(("harmonic-balance", Box::new(FailingSolver) as Box<dyn Solver + Send>)));
        let first = Box::new(FailingSolver);
        let mut solver = WithFallback { first, chosen: "event-driven", system: &system, second };
        let said = solver.orbit(TAU * 121.0).unwrap_err().to_string();
        assert!(said.ends_with("; `harmonic-balance` found no orbit either"), "{said}");
    }

    /// No affordable series reaches this tolerance. The solver refuses it after a few short
    /// series and reports the required number of harmonics.
    #[test]
    fn rigid_friction_that_needs_too_many_harmonics_is_refused_early() {
        let mut model = ring(36, &(Arc::new(Coulomb { limit: 0.3 }) as SharedLaw));
        model.forces.push(Force { on: "b0".to_owned(), amplitude: 5.0, phase: 0.0, harmonic: 1 });
        let system = model.assemble().unwrap();
        let method = HarmonicBalance { tolerance: Some(1e-6), ..HarmonicBalance::default() };
        let error = method.solver(&system).unwrap().orbit(TAU * 112.0).unwrap_err();
        let OrbitError::Truncation { harmonics, needed: Some(needed), .. } = error else { panic!("{error}") };
        assert!(harmonics < 100 && needed > 500, "{harmonics} {needed}");
        assert!(error.to_string().contains("jenkins"), "{error}");
    }
}
