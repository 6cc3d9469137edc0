//! Masses that cannot move: so stiffly held that their inertia makes no difference.
//!
//! In `k - m Ω²` the second term is lost in the rounding of the first where `m Ω² < ε k`, with ε = 2.2e-16: the result is the same for a mass of
//! zero. Such a stiffness stands for "rigid", costs the exact method `√(k/m)/Ω` > 7e7 oscillations per period, and is refused.

use crate::expression::displayed;
use std::collections::HashMap;
use stickslip::dimension::Dimension;
use stickslip::law::Law;
use stickslip::model::{Element, GROUND, Model, ModelError};

/// The element that holds a mass so that it does not move at the drive frequency `omega`, rad/s; `None` if there is none.
pub(crate) fn immovable(model: &Model, omega: f64) -> Option<ModelError> {
    let mut stiffest: HashMap<&str, (f64, Element)> = HashMap::new();
    let springs = model.springs.iter().enumerate().map(|(i, s)| (&s.between, s.stiffness, Element::Spring(i)));
    let joints = model.joints.iter().enumerate().map(|(i, j)| (&j.between, stiffness(&*j.law), Element::Joint(i)));
    for (between, stiffness, element) in springs.chain(joints) {
        for place in between.iter().filter(|place| *place != GROUND) {
            let known = stiffest.entry(place).or_insert((stiffness, element));
            if stiffness > known.0 {
                *known = (stiffness, element);
            }
        }
    }
    // a place without mass is no mistake of its stiffness, a moved one moves
    let free = |name: &str| model.motions.iter().all(|motion| motion.on != name);
    model.masses.iter().filter(|mass| mass.mass > 0.0 && free(&mass.name)).find_map(|mass| {
        let &(stiffness, element) = stiffest.get(mass.name.as_str())?;
        if mass.mass * omega * omega >= f64::EPSILON * stiffness {
            return None;
        }
        let message = format!(
            "{} is so stiff for {} that `{}` does not move at {}: the inertia is lost in the rounding of the stiffness. Connect its \
             neighbours to `ground`, make one mass of two, or take `coulomb` for rigid friction",
            displayed(stiffness, Some(Dimension::STIFFNESS)),
            displayed(mass.mass, Some(Dimension::MASS)),
            mass.name,
            displayed(omega, Some(Dimension::FREQUENCY)),
        );
        let key = if matches!(element, Element::Joint(_)) { "law" } else { "stiffness" };
        Some(ModelError { element, key, message, wrong_name: None })
    })
}

/// Stiffness of a law while it sticks, N/m; zero of a rigid one, and of one that holds nothing.
fn stiffness(law: &dyn Law) -> f64 {
    law.value("stiffness").filter(|_| !law.is_free()).unwrap_or(0.0)
}
