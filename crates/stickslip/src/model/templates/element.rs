//! The massless stick-slip element moved at its end, Fig. 1a and Fig. 2: `F_t = kt (x1 - x)`, slider `x` on the ground.
//!
//! Source: Pust, Pesek, Radolfova (2015), Sec. 2, Eq. (1) with its sign corrected.

use super::{GROUND, Model, Template, Values, joint, motion, parameter};
use crate::dimension::Dimension;
use crate::law::Jenkins;
use std::sync::Arc;

pub(super) const TEMPLATE: Template = Template {
    name: "element",
    summary: "massless stick-slip element with imposed motion (paper Figs. 1a, 2, 3)",
    parameters: &[
        parameter("kt", Dimension::STIFFNESS, "1 N/m", 1.0, "tangential contact stiffness"),
        parameter("Ft", Dimension::FORCE, "1 mN", 1e-3, "slip limit"),
        parameter("a", Dimension::LENGTH, "2 mm", 2e-3, "amplitude of the imposed motion"),
    ],
    study: include_str!("element.toml"),
    build,
};

fn build(values: &Values) -> Model {
    let law = Arc::new(Jenkins { stiffness: values["kt"], limit: values["Ft"] });
    Model {
        motions: vec![motion("mover", values["a"])],
        joints: vec![joint("contact", "mover", GROUND, law)],
        ..Model::default()
    }
}
