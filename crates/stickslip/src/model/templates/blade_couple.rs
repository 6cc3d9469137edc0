//! The paper's blade couple with a non-symmetric element, Fig. 5b and Eqs. (3)-(4) as corrected: friction between blade 1 and
//! the small mass, a spring from the small mass to blade 3.
//!
//! Source: Pust, Pesek, Radolfova (2015), Sec. 4. `k` follows from the resonance at 121.25 Hz, `b` from the peak of 5 cm.

use super::{GROUND, Model, Template, Values, force, joint, mass, parameter, spring};
use crate::dimension::Dimension;
use crate::law::Coulomb;
use std::sync::Arc;

pub(super) const TEMPLATE: Template = Template {
    name: "blade-couple",
    summary: "two blades, a small contact mass, friction on the driven side (paper Eqs. (3)-(4), Figs. 6-8)",
    parameters: &[
        parameter("m", Dimension::MASS, "182 g", 0.182, "mass of one blade"),
        parameter("m1", Dimension::MASS, "m / 100", 0.00182, "mass of the deformed part at the contact"),
        parameter("k", Dimension::STIFFNESS, "105103 N/m", 105_103.0, "stiffness of a blade"),
        parameter("b", Dimension::DAMPING, "0.2 kg/s", 0.2, "viscous damping of a blade"),
        parameter("kt", Dimension::STIFFNESS, "10000 N/m", 1e4, "tangential contact stiffness"),
        parameter("Ft", Dimension::FORCE, "2 N", 2.0, "slip limit"),
        parameter("F0", Dimension::FORCE, "10 N", 10.0, "amplitude of the force on blade 1"),
    ],
    study: include_str!("blade_couple.toml"),
    build,
};

#[doc(alias = "eq3")]
fn build(values: &Values) -> Model {
    let blade = values["m"] - values["m1"] / 2.0; // m* of Eq. (3)
    Model {
        masses: vec![mass("blade1", blade), mass("contact", values["m1"]), mass("blade3", blade)],
        springs: vec![
            spring("blade1", GROUND, values["k"], values["b"]),
            spring("blade3", GROUND, values["k"], values["b"]),
            spring("contact", "blade3", values["kt"], 0.0),
        ],
        joints: vec![joint("shroud", "blade1", "contact", Arc::new(Coulomb { limit: values["Ft"] }))],
        forces: vec![force("blade1", values["F0"])],
        ..Model::default()
    }
}
