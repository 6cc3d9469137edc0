//! The stick-slip element with a small mass at its slider, Fig. 1b: `m1 x'' + kt (x - x1) + friction(x') = 0`.
//!
//! Source: Pust, Pesek, Radolfova (2015), Sec. 3.

use super::{GROUND, Model, Template, Values, joint, mass, motion, parameter, spring};
use crate::dimension::Dimension;
use crate::law::Coulomb;
use std::sync::Arc;

pub(super) const TEMPLATE: Template = Template {
    name: "element-with-mass",
    summary: "stick-slip element with a small mass and imposed motion (paper Figs. 1b, 4)",
    parameters: &[
        parameter("m1", Dimension::MASS, "2 g", 2e-3, "mass of the deformed part"),
        parameter("kt", Dimension::STIFFNESS, "1 N/m", 1.0, "tangential contact stiffness"),
        parameter("Ft", Dimension::FORCE, "1 mN", 1e-3, "slip limit"),
        parameter("a", Dimension::LENGTH, "2 mm", 2e-3, "amplitude of the imposed motion"),
    ],
    study: include_str!("element_with_mass.toml"),
    build,
};

fn build(values: &Values) -> Model {
    Model {
        masses: vec![mass("slider", values["m1"])],
        springs: vec![spring("mover", "slider", values["kt"], 0.0)],
        motions: vec![motion("mover", values["a"])],
        joints: vec![joint("contact", "slider", GROUND, Arc::new(Coulomb { limit: values["Ft"] }))],
        ..Model::default()
    }
}
