//! The blade couple with a massless element between the blades: the limit `m1 → 0` of Eqs. (3)-(4).
//!
//! Source: Pust, Pesek, Radolfova (2015), Fig. 5b with the element of Fig. 1a.

use super::{GROUND, Model, Template, Values, force, joint, mass, parameter, spring};
use crate::dimension::Dimension;
use crate::law::Jenkins;
use std::sync::Arc;

pub(super) const TEMPLATE: Template = Template {
    name: "blade-couple-massless",
    summary: "two blades with a massless stick-slip element between them",
    parameters: &[
        parameter("m", Dimension::MASS, "182 g", 0.182, "mass of one blade"),
        parameter("k", Dimension::STIFFNESS, "105103 N/m", 105_103.0, "stiffness of a blade"),
        parameter("b", Dimension::DAMPING, "0.2 kg/s", 0.2, "viscous damping of a blade"),
        parameter("kt", Dimension::STIFFNESS, "10000 N/m", 1e4, "tangential contact stiffness"),
        parameter("Ft", Dimension::FORCE, "2 N", 2.0, "slip limit"),
        parameter("F0", Dimension::FORCE, "10 N", 10.0, "amplitude of the force on blade 1"),
    ],
    study: include_str!("blade_couple_massless.toml"),
    build,
};

fn build(values: &Values) -> Model {
    let law = Arc::new(Jenkins { stiffness: values["kt"], limit: values["Ft"] });
    Model {
        masses: vec![mass("blade1", values["m"]), mass("blade3", values["m"])],
        springs: vec![
            spring("blade1", GROUND, values["k"], values["b"]),
            spring("blade3", GROUND, values["k"], values["b"]),
        ],
        joints: vec![joint("shroud", "blade1", "blade3", law)],
        forces: vec![force("blade1", values["F0"])],
        ..Model::default()
    }
}
