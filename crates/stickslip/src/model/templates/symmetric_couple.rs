//! The blade couple with a symmetric element, Fig. 9: a spring and a small mass on each side, friction between the masses.
//!
//! The paper states neither equations nor masses. Here the total mass is `2 m` for every `mu`; the default `mu = m1/2` deforms as
//! much mass in all as the non-symmetric couple does and leaves the blades with the same `m - m1/2`.
//! Source: Pust, Pesek, Radolfova (2015), Sec. 5, Figs. 9 and 10.

use super::{GROUND, Model, Template, Values, force, joint, mass, parameter, spring};
use crate::dimension::Dimension;
use crate::law::Coulomb;
use std::sync::Arc;

pub(super) const TEMPLATE: Template = Template {
    name: "symmetric-couple",
    summary: "two blades, a small mass on each side, friction between the small masses (paper Figs. 9, 10)",
    parameters: &[
        parameter("m", Dimension::MASS, "182 g", 0.182, "mass of one blade"),
        parameter("m1", Dimension::MASS, "m / 100", 0.00182, "deformed mass at the contact, both sides together"),
        parameter("mu", Dimension::MASS, "m1 / 2", 0.00091, "deformed mass on each side (the paper leaves it open)"),
        parameter("k", Dimension::STIFFNESS, "105103 N/m", 105_103.0, "stiffness of a blade"),
        parameter("b", Dimension::DAMPING, "0.2 kg/s", 0.2, "viscous damping of a blade"),
        parameter("kt", Dimension::STIFFNESS, "10000 N/m", 1e4, "tangential contact stiffness on each side"),
        parameter("Ft", Dimension::FORCE, "2 N", 2.0, "slip limit"),
        parameter("F0", Dimension::FORCE, "10 N", 10.0, "amplitude of the force on blade 1"),
    ],
    study: include_str!("symmetric_couple.toml"),
    build,
};

fn build(values: &Values) -> Model {
    let (blade, small) = (values["m"] - values["mu"], values["mu"]);
    Model {
        masses: vec![mass("blade1", blade), mass("contact2", small), mass("contact3", small), mass("blade4", blade)],
        springs: vec![
            spring("blade1", GROUND, values["k"], values["b"]),
            spring("blade4", GROUND, values["k"], values["b"]),
            spring("blade1", "contact2", values["kt"], 0.0),
            spring("contact3", "blade4", values["kt"], 0.0),
        ],
        joints: vec![joint("shroud", "contact2", "contact3", Arc::new(Coulomb { limit: values["Ft"] }))],
        forces: vec![force("blade1", values["F0"])],
        ..Model::default()
    }
}
