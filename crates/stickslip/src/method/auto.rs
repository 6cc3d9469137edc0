//! Picks a method: event-driven for exact laws, shooting for smooth ones, harmonic balance for many joints and for waves around a disk.

use super::event_driven::takes;
use super::harmonic_balance::HarmonicBalance;
use super::{
    Choice, Method, MethodError, MethodInfo, Options, Solver, Ways, event_driven::EventDriven, harmonic_balance,
    shooting::Shooting, transient,
};
use crate::law::Slider;
use crate::model::System;

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: "auto",
    summary: "event-driven where all laws are exact, shooting where all are smooth; harmonic balance where neither holds (friction in a plane or with \
              a normal force, mixtures), where a place has no mass, beyond 12 joints (48 rigid ones), 100 sliders or 60 degrees of freedom, and for waves around a tuned disk; \
              what it does not take goes to the method that does",
    options: &[],
    build: |_| Ok(Box::new(Auto)),
};

/// Joints up to which the motion is followed in time. Event-driven meets new patterns of stick and slip at nearly every switch of many
/// joints, and shooting carries a sensitivity as wide as the state: both cost the cube of the size, harmonic balance the first power.
const FOLLOWED: usize = 12;
/// The same where every joint is rigid, which adds no state, and makes forces jump, of which the series converges slowly. Measured on rings with
/// `coulomb` joints between neighbours, seconds a point: event-driven 0.15, 1.1, 3.2, 9.7 with 16, 24, 36, 48 of them, all points found; harmonic balance
/// more than 30 with 24, and with 12 it misses its tolerance at two points of three.
const FOLLOWED_RIGID: usize = 48;
/// Sliders and stops of all joints up to which they are followed one by one: each switches four times a period, at a cost that grows with their
/// number. A law of 600 sliders takes event-driven a second a point, harmonic balance a hundredth.
const PIECES: usize = 100;

/// Degrees of freedom up to which the motion is followed in time. Measured on chains with two `jenkins` joints, seconds a point: event-driven
/// 0.014, 0.1, 0.5, 2.3 with 30, 60, 100, 150 of them; harmonic balance 0.004 to 0.009.
pub(super) const DOFS: usize = 60;

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
        let methods = Ways::of(system).methods;
        // waiting is the last resort
        let other = methods.iter().find(|name| **name != transient::INFO.name).or(methods.first());
        match other.and_then(|name| super::find(name)).and_then(|row| (row.build)(&Options::new()).ok()) {
            Some(other) => (other, format!("{} refuses a law", harmonic_balance::NAME)),
            // who refuses says what else there is
            None => (method, because),
        }
    }

    /// The choice by laws and sizes.
    fn by_laws(system: &System) -> (Box<dyn Method>, String) {
        let joints = system.joints().len();
        let exact = system.joints().iter().all(|joint| takes(joint.law().as_ref()));
        let smooth = system.joints().iter().all(|joint| joint.law().rate().is_some());
        let pieces: usize =
            system.joints().iter().map(|joint| joint.law().pieces().map_or(0, |pieces| pieces.len())).sum();
        let rigid = |slider: &Slider| slider.stiffness.is_none();
        let all_rigid = exact
            && system
                .joints()
                .iter()
                .all(|joint| joint.law().sliders().is_some_and(|sliders| sliders.iter().all(rigid)));
        let most = if all_rigid { FOLLOWED_RIGID } else { FOLLOWED };
        let massless = (0..system.dofs()).any(|dof| system.structure().own_mass(dof) <= 0.0);
        let balance =
            |because: String| -> (Box<dyn Method>, String) { (Box::new(HarmonicBalance::default()), because) };
        if system.dofs() > DOFS {
            balance(format!("{} degrees of freedom are more than {DOFS}", system.dofs()))
        } else if joints > 0 && system.cyclic().is_some() {
            balance("one of equal sectors is solved".to_owned())
        } else if joints > most {
            balance(format!("{joints} joints are more than {most}"))
        } else if exact && pieces > PIECES {
            balance(format!("{pieces} sliders and stops are more than {PIECES}"))
        } else if massless {
            balance("a place has no mass".to_owned())
        } else if exact {
            let because = if joints == 0 { "there are no joints" } else { "every law is exact" };
            (Box::new(EventDriven), because.to_owned())
        } else if !smooth {
            balance("neither are all laws exact nor all smooth".to_owned())
        } else {
            (Box::new(Shooting::default()), "the laws are smooth".to_owned())
        }
    }
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
    fn prepare<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        Auto::chosen(system).0.prepare(system)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Iwan, Jenkins, SharedLaw, Stribeck};
    use crate::model::{GROUND, Joint, example};
    use std::sync::Arc;

    #[test]
    fn many_sliders_of_one_joint_are_not_followed_one_by_one() {
        for (elements, method) in [(32, "event-driven"), (600, "harmonic-balance")] {
            let mut model = example::blade_couple();
            model.joints[0].law = Arc::new(Iwan { stiffness: 2e4, limit: 4.0, chi: -0.5, beta: 0.3, elements });
            assert_eq!(Auto.choice(&model.assemble().unwrap()).method, method);
        }
    }

    /// Rigid joints are followed up to a larger number than those with springs.
    #[test]
    fn rigid_joints_are_followed_longer() {
        let rigid: SharedLaw = Arc::new(Coulomb { limit: 2.0 });
        let spring: SharedLaw = Arc::new(Jenkins { stiffness: 1e5, limit: 2.0 });
        for (law, joints, method) in [
            (&rigid, FOLLOWED_RIGID, "event-driven"),
            (&rigid, FOLLOWED_RIGID + 1, "harmonic-balance"),
            (&spring, FOLLOWED, "event-driven"),
            (&spring, FOLLOWED + 1, "harmonic-balance"),
        ] {
            let mut model = example::blade_couple();
            let between = ["blade1".to_owned(), GROUND.to_owned()];
            let joint = |i| Joint { name: format!("j{i}"), between: between.clone(), law: law.clone() };
            model.joints = (0..joints).map(joint).collect();
            assert_eq!(Auto.choice(&model.assemble().unwrap()).method, method, "{joints} of {}", law.name());
        }
    }

    /// Harmonic balance takes places without mass, and event-driven a static limit above the dynamic one at any number of joints.
    #[test]
    fn what_the_first_choice_refuses_goes_to_who_takes_it() {
        let mut massless = example::blade_couple();
        massless.masses[1].mass = 0.0;
        let mut many = example::blade_couple();
        let drops = Arc::new(Stribeck { limit: 2.0, static_limit: 3.0, velocity: 0.0 });
        for i in 0..=FOLLOWED_RIGID {
            let between = ["blade1".into(), GROUND.into()];
            many.joints.push(Joint { name: format!("j{i}"), between, law: drops.clone() });
        }
        for (model, method) in [(massless, "harmonic-balance"), (many, "event-driven")] {
            let system = model.assemble().unwrap();
            assert_eq!(Auto.choice(&system).method, method);
            assert!(Auto.prepare(&system).is_ok(), "{}", Auto.choice(&system));
        }
    }
}
