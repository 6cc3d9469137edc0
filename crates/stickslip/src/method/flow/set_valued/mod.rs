//! Flow of set-valued friction with a smooth slip curve, together with smooth laws: stiff
//! integration between located switches.
//!
//! - `friction_mode`: a joint that sticks, as a constraint, or slips in one direction
//! - `located_switches`: step size control between switches, which are zeros on the collocation
//!   polynomial
//! - `transition`: stick or slip after a switch, and the saltation of sensitivities

mod friction_mode;
pub(crate) mod located_switches;
#[cfg(test)]
mod tests;
mod transition;

use super::assembly::{Assembly, carries_nothing};
use crate::law::Law;
use crate::method::MethodError;
use crate::model::System;

/// Returns whether this integration supports a system: all joints are smooth or have a smooth
/// slip curve, and at least one has a slip curve.
pub(crate) fn supports(system: &System) -> bool {
    let slides = |law: &dyn Law| law.sliding().is_some() && law.force_scale() > 0.0;
    let joints = || system.joints().iter();
    // a joint between two moved places cannot stick
    let moves = |axes: &[crate::model::Axis]| axes.iter().all(|axis| !axis.rows().is_empty());
    joints().any(|joint| slides(&**joint.law()))
        && joints().all(|joint| match slides(&**joint.law()) {
            true => joint.axes().len() == 1 && moves(joint.axes()),
            false => joint.law().rate().is_some() || carries_nothing(joint.law()),
        })
}

/// Creates the assembly of a system for this integration.
///
/// # Errors
/// A joint whose law is neither smooth nor has a smooth slip curve, or a place without mass.
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
