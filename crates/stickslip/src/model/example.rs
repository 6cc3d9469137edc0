//! Two example models, built by calls: the blade couples of Pust, Pesek, Radolfova (2015),
//! Sec. 4.
//!
//! Values in SI: blades of 0.182 kg on springs of 105103 N/m with dampers of 0.2 kg/s. The contact
//! stiffness is 1e4 N/m and the slip limit 2 N. A force of 10 N acts on blade 1. A single blade
//! has its resonance at 121.25 Hz.

use super::{Force, GROUND, Joint, Mass, Model, Spring};
use crate::law::{Coulomb, Jenkins, SharedLaw};
use std::sync::Arc;

/// Returns two blades with friction between the first blade and a small contact mass. A spring
/// connects the contact mass to the second blade: Fig. 5b, Eqs. (3)-(4).
///
/// # Example
/// ```
/// use std::sync::Arc;
/// use stickslip::law::Coulomb;
/// use stickslip::model::example;
/// let mut model = example::blade_couple();
/// model.joints[0].law = Arc::new(Coulomb { limit: 4.0 });   // N
/// assert_eq!(model.assemble().unwrap().places(), ["blade1", "contact", "blade3"]);
/// ```
pub fn blade_couple() -> Model {
    let contact = 0.001_82; // kg, the part that deforms at the contact
    let mut model = blades(0.182 - contact / 2.0); // m* of Eq. (3)
    model.masses.insert(1, Mass::new("contact", contact));
    model.springs.push(Spring { between: between("contact", "blade3"), stiffness: 1e4, damping: 0.0 });
    model.joints.push(shroud("contact", Arc::new(Coulomb { limit: 2.0 })));
    model
}

/// Returns the couple without the contact mass: a spring in series with a slider connects the
/// blades.
///
/// # Example
/// ```
/// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
/// assert_eq!(system.places(), ["blade1", "blade3"]);
/// ```
pub fn blade_couple_massless() -> Model {
    let mut model = blades(0.182);
    model.joints.push(shroud("blade3", Arc::new(Jenkins { stiffness: 1e4, limit: 2.0 })));
    model
}

fn between(a: &str, b: &str) -> [String; 2] {
    [a.to_owned(), b.to_owned()]
}

fn shroud(other: &str, law: SharedLaw) -> Joint {
    Joint { name: "shroud".to_owned(), between: between("blade1", other), law }
}

/// Returns two blades without contact; a force acts on the first blade.
fn blades(mass: f64) -> Model {
    let names = ["blade1", "blade3"];
    Model {
        masses: names.map(|name| Mass::new(name, mass)).to_vec(),
        springs: names
            .map(|name| Spring { between: between(name, GROUND), stiffness: 105_103.0, damping: 0.2 })
            .to_vec(),
        forces: vec![Force { on: "blade1".to_owned(), amplitude: 10.0, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    }
}
