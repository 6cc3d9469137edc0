//! Set-valued friction with a smooth slip curve beside smooth laws: stiff integration between located switches.
//!
//! - `mode`: a joint that rests, as a constraint, or slips in one direction;
//! - `flow`: steps of controlled length between switches, which are located as zeros of the motion in a step;
//! - `switch`: what rests and slips from a switch on, and what it does to derivatives.

pub(crate) mod flow;
mod mode;
mod switch;
#[cfg(test)]
mod tests;

use super::MethodError;
use super::assembly::{Assembly, carries_nothing};
use crate::law::Law;
use crate::model::System;

/// Whether this integration follows a system: all joints are smooth or slide along a smooth curve, and one of them does.
pub(crate) fn takes(system: &System) -> bool {
    let slides = |law: &dyn Law| law.sliding().is_some() && law.scale() > 0.0;
    let joints = || system.joints().iter();
    // a joint between places that both are moved cannot be held
    let moves = |axes: &[crate::model::Axis]| axes.iter().all(|axis| !axis.rows().is_empty());
    joints().any(|joint| slides(&**joint.law()))
        && joints().all(|joint| match slides(&**joint.law()) {
            true => joint.axes().len() == 1 && moves(joint.axes()),
            false => joint.law().rate().is_some() || carries_nothing(joint.law()),
        })
}

/// A system as this integration sees it.
///
/// # Errors
/// A joint whose law is neither smooth nor slides along a smooth curve, a place without mass.
fn assembly(system: &System, method: &'static str) -> Result<Assembly, MethodError> {
    Assembly::new(system, method, |law| {
        let nothing = carries_nothing(law).then_some((0, 1.0));
        let slides = law.sliding().is_some().then_some((0, 1.0));
        let (states, scale) = nothing
            .or(slides)
            .or_else(|| law.rate().map(|rate| (rate.states(), rate.state_scale())))
            .ok_or("it is neither smooth nor does it have a smooth slip curve")?;
        Ok((law.clone(), states, scale))
    })
}
