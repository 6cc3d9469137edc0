//! Picks a method: event-driven for exact laws, shooting for smooth ones, harmonic balance for many joints and for waves around a disk.

use super::event_driven::takes;
use super::harmonic_balance::HarmonicBalance;
use super::{Choice, Method, MethodError, MethodInfo, Solver, event_driven::EventDriven, shooting::Shooting};
use crate::model::System;
use crate::structure::MOST_IN_FULL;

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: "auto",
    summary: "event-driven for exact laws, shooting for smooth laws, harmonic balance for more than a dozen joints or a hundred sliders and for \
              waves around a tuned disk",
    options: &[],
    build: |_| Ok(Box::new(Auto)),
};

/// Joints up to which the motion is followed in time. Event-driven meets new patterns of stick and slip at nearly every switch of many
/// joints, and shooting carries a sensitivity as wide as the state: both cost the cube of the size, harmonic balance the first power.
const FOLLOWED: usize = 12;
/// Sliders and stops of all joints up to which they are followed one by one: each switches four times a period, at a cost that grows with their
/// number. A law of 600 sliders takes event-driven a second a point, harmonic balance a hundredth.
const PIECES: usize = 100;

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
    fn chosen(system: &System) -> (Box<dyn Method>, String) {
        let joints = system.joints().len();
        let exact = system.joints().iter().all(|joint| takes(joint.law().as_ref()));
        let smooth = system.joints().iter().all(|joint| joint.law().rate().is_some());
        let pieces: usize =
            system.joints().iter().map(|joint| joint.law().pieces().map_or(0, |pieces| pieces.len())).sum();
        if system.dofs() > MOST_IN_FULL {
            let because = format!("{} places are more than {MOST_IN_FULL}", system.dofs());
            (Box::new(HarmonicBalance::default()), because)
        } else if joints > 0 && system.cyclic().is_some() {
            (Box::new(HarmonicBalance::default()), "one of equal sectors is solved".to_owned())
        } else if joints > FOLLOWED {
            let because = format!("{joints} joints are more than {FOLLOWED}");
            (Box::new(HarmonicBalance::default()), because)
        } else if exact && pieces > PIECES {
            let because = format!("{pieces} sliders and stops are more than {PIECES}");
            (Box::new(HarmonicBalance::default()), because)
        } else if exact {
            let because = if joints == 0 { "there are no joints" } else { "every law is exact" };
            (Box::new(EventDriven), because.to_owned())
        } else if !smooth {
            (Box::new(HarmonicBalance::default()), "neither are all laws exact nor all smooth".to_owned())
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
    use crate::law::Iwan;
    use crate::model::example;
    use std::sync::Arc;

    #[test]
    fn many_sliders_of_one_joint_are_not_followed_one_by_one() {
        for (elements, method) in [(32, "event-driven"), (600, "harmonic-balance")] {
            let mut model = example::blade_couple();
            model.joints[0].law = Arc::new(Iwan { stiffness: 2e4, limit: 4.0, chi: -0.5, beta: 0.3, elements });
            assert_eq!(Auto.choice(&model.assemble().unwrap()).method, method);
        }
    }
}
