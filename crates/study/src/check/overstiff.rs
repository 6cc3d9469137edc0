//! Errors for masses whose stiffness is so high that their inertia has no effect.
//!
//! In `k - m Ω²` the second term is lost in the rounding of the first if `m Ω² < ε k`, with
//! `ε = 2.2e-16`; a mass of zero gives the same result. Such a stiffness is meant as "rigid". It
//! costs the exact method `√(k/m)/Ω` > 7e7 oscillations per period, and it is refused. If this
//! holds for every mass, the excitation is too slow. Conversely, a spring can be lost in the
//! rounding of the inertia. A mode far below the excitation creates terms of `Ω/ω` times the
//! motion; they cancel, and only rounding remains.

use crate::kinds::info::KeyError;
use crate::syntax::expression::quantity_text;
use std::collections::HashMap;
use std::f64::consts::TAU;
use stickslip::dimension::Dimension;
use stickslip::law::{Law, Parameter};
use stickslip::model::{Element, GROUND, Mass, Model, ModelError};

/// A mass and the stiffest element attached to it.
struct AttachedMass<'a> {
    mass: &'a Mass,
    stiffness: f64,
    element: Element,
}

impl AttachedMass<'_> {
    /// Returns the excitation frequency below which the inertia is lost, rad/s.
    fn slowest(&self) -> f64 {
        (f64::EPSILON * self.stiffness / self.mass.mass).sqrt()
    }
}

/// Iterates over the masses with an attached stiffness.
///
/// Places without mass and places with an imposed motion are left out.
fn attached_masses(model: &Model) -> impl Iterator<Item = AttachedMass<'_>> {
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
    let free = |name: &str| model.motions.iter().all(|motion| motion.on != name);
    model.masses.iter().filter(move |mass| mass.mass > 0.0 && free(&mass.name)).filter_map(move |mass| {
        let &(stiffness, by) = stiffest.get(mass.name.as_str())?;
        (stiffness > 0.0).then_some(AttachedMass { mass, stiffness, element: by })
    })
}

/// Returns the error of an element so stiff that a mass does not move at `omega`, rad/s; `None`
/// without one.
pub(crate) fn overstiff_element(model: &Model, omega: f64) -> Option<ModelError> {
    let AttachedMass { mass, stiffness, element: by } = attached_masses(model).find(|held| omega < held.slowest())?;
    let message = format!(
        "a stiffness of {} is too high for a mass of {}: `{}` cannot move at {}, because its inertia is smaller than \
         the rounding of the spring force; replace this place by `ground`, merge the two masses, or use the law `coulomb` for rigid friction",
        quantity_text(stiffness, Some(Dimension::STIFFNESS)),
        quantity_text(mass.mass, Some(Dimension::MASS)),
        mass.name,
        quantity_text(omega, Some(Dimension::FREQUENCY)),
    );
    Some(element_error(by, message))
}

/// Returns the error of a spring whose stiffness is lost in the rounding of the inertia at
/// `omega`, rad/s.
///
/// The condition is `ε √(m Ω²/k) > 1e-6` for the stiffest element of a mass.
/// Returns `None` without such a spring.
pub(crate) fn too_soft(model: &Model, omega: f64) -> Option<ModelError> {
    // Share of a motion that rounding may reach because of a mode far below the excitation.
    let lost = |held: &AttachedMass<'_>| f64::EPSILON * omega > 1e-6 * (held.stiffness / held.mass.mass).sqrt();
    let AttachedMass { mass, stiffness, element: by } = attached_masses(model).find(lost)?;
    let message = format!(
        "a stiffness of {} is too low for a mass of {}: it has no effect on `{}` at {}, because its force is \
         smaller than the rounding of the inertia; remove it, or correct the mass",
        quantity_text(stiffness, Some(Dimension::STIFFNESS)),
        quantity_text(mass.mass, Some(Dimension::MASS)),
        mass.name,
        quantity_text(omega, Some(Dimension::FREQUENCY)),
    );
    Some(element_error(by, message))
}

/// Builds the error of an element.
fn element_error(by: Element, message: String) -> ModelError {
    let key = if matches!(by, Element::Joint(_)) { "law" } else { "stiffness" };
    ModelError { element: by, key, message, wrong_name: None }
}

/// Returns the error of an excitation frequency `omega`, rad/s, that is too slow for every
/// mass.
pub(crate) fn too_slow(model: &Model, omega: f64) -> Option<KeyError> {
    let mut slowest = 0.0f64;
    let mut softest: Option<(f64, &str)> = None;
    for held in attached_masses(model) {
        if omega >= held.slowest() {
            return None;
        }
        slowest = slowest.max(held.slowest());
        let own = held.slowest() / f64::EPSILON.sqrt();
        if softest.is_none_or(|(known, _)| own < known) {
            softest = Some((own, held.mass.name.as_str()));
        }
    }
    let (own, name) = softest?;
    let shown = |omega: f64| quantity_text(omega, Some(Dimension::FREQUENCY));
    // Factor of inertia over rounding at the suggested frequency; the motion is still
    // quasi-static there.
    let enough = TAU * 10f64.powf((100f64.sqrt() * slowest / TAU).log10().ceil());
    let message = format!(
        "at {} inertia has no effect, because it is smaller than the rounding of spring forces; the lowest natural frequency of a single mass is \
         {}, that of `{name}`",
        shown(omega),
        shown(own)
    );
    let help = format!(
        "use a frequency of at least {} (inertia is still negligible there), or lower stiffnesses that only \
         represent rigid parts",
        shown(enough)
    );
    Some(KeyError::new("frequency", message, help))
}

/// Returns the stiffness of a law while it sticks, N/m; zero for a rigid law and for one
/// without force.
fn stiffness(law: &dyn Law) -> f64 {
    // the stiffness of a cubic spring depends on the motion
    let is_stiffness =
        |parameter: &Parameter| parameter.key == "stiffness" && parameter.dimension == Dimension::STIFFNESS;
    let linear = law.info().parameters.iter().any(is_stiffness);
    law.value("stiffness").filter(|_| linear && !law.carries_no_force()).unwrap_or(0.0)
}
