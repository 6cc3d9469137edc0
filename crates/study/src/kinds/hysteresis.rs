//! Hysteresis loops: force over displacement of joints and moved places, over one period of the steady motion.

use super::{Complaint, FREQUENCY, Kind, SAMPLES};
use crate::schema::{Takes, optional};
use crate::values::Values;
use stickslip::model::Model;

pub(super) const KIND: Kind = Kind {
    name: "hysteresis",
    summary: "force-displacement loops with dissipation, equivalent stiffness and damping",
    keys: &[
        FREQUENCY,
        optional(
            "loop",
            Takes::Names,
            "joints, or moved places (the force that moves them), whose loops are wanted; every joint when absent",
            "\"shroud\"",
        ),
        SAMPLES,
    ],
    check,
};

fn check(values: &Values, model: &Model) -> Result<(), Complaint> {
    let mut known: Vec<&str> = model.joints.iter().map(|joint| joint.name.as_str()).collect();
    known.extend(model.motions.iter().map(|motion| motion.on.as_str()));
    for name in values.names("loop").unwrap_or_default() {
        if !known.contains(&name.as_str()) {
            return Err(Complaint::unknown("loop", "joint or moved place", name, &known));
        }
    }
    if known.is_empty() {
        let help = "add a [[joint]] or a [[motion]], or ask for kind = \"orbit\"";
        return Err(Complaint::new("kind", "the model has no joint and no moved place, so it has no loop", help));
    }
    Ok(())
}
