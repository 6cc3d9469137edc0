//! Cost estimate of an orbit, before any computation.

use super::mechanics::supports;
use crate::law::IdealElement;
use crate::model::System;

/// Returns the number of multiplications for an orbit with a warm start; `None` if a law does
/// not consist of sliders and stops.
///
/// # Example
/// ```
/// use stickslip::method::event_driven::orbit_work;
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// // three masses and one rigid slider
/// assert_eq!(orbit_work(&system), Some(100.0 * 27.0 + 50.0 * 3.0 * 36.0));
/// ```
pub fn orbit_work(system: &System) -> Option<f64> {
    let (mut springs, mut others) = (0.0, 0.0);
    for joint in system.joints() {
        let law = joint.law().as_ref();
        if !supports(law) {
            return None;
        }
        for piece in law.ideal_elements().unwrap_or_default().iter().filter(|piece| !piece.carries_no_force()) {
            match piece {
                IdealElement::Slider(slider) if slider.stiffness.is_some() => springs += 1.0,
                _ => others += 1.0,
            }
        }
    }
    let n = system.dofs() as f64;
    let states = 2.0 * n + springs;
    // Decomposition of a pattern. Without sliders and stops, there is one pattern. Measured: 8 and
    // 29 ms for 60 and 100 masses, 13 s and more for 900.
    let decomposition = 100.0 * n.powi(3);
    // Each slider and stop switches some times in each of several returns. New patterns are
    // decomposed, and the sensitivity is carried through all of them. Rigid sticking reduces the
    // size of the decomposition. Measured in sweeps of rings with joints between adjacent masses:
    // `jenkins` 11, 97 and 440 ms for 12, 24 and 36 masses, `iwan` with six sliders 67 and 490 ms
    // for 8 and 16, `coulomb` 19, 68 and 800 ms for 24, 36 and 60.
    let switches = (150.0 * springs + 50.0 * others) * n * states * states;
    Some(decomposition + switches)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Cubic, Jenkins, SharedLaw};
    use crate::model::example;
    use std::sync::Arc;

    fn work(law: SharedLaw) -> Option<f64> {
        let mut model = example::blade_couple();
        model.joints[0].law = law;
        orbit_work(&model.assemble().unwrap())
    }

    /// A slider in series with a spring costs more, a slider without force costs nothing, and
    /// an unsupported law has no cost.
    #[test]
    fn cost_counts_sliders_and_stops() {
        let rigid = work(Arc::new(Coulomb { limit: 1.0 })).unwrap();
        assert!(work(Arc::new(Jenkins { stiffness: 1e4, limit: 1.0 })).unwrap() > 2.0 * rigid);
        assert_eq!(work(Arc::new(Coulomb { limit: 0.0 })), Some(100.0 * 27.0));
        assert_eq!(work(Arc::new(Cubic { stiffness: 1e4 })), None);
    }
}
