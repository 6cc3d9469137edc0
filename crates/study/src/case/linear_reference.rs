//! Linear references of a model: every joint free, or every joint stuck.

use stickslip::law::{Law, SharedLaw};
use stickslip::model::Model;

/// A linear reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LinearReference {
    /// No joint carries a force.
    Free,
    /// No joint slips or opens.
    Stuck,
}

impl LinearReference {
    /// Both references.
    pub const ALL: [LinearReference; 2] = [LinearReference::Free, LinearReference::Stuck];

    /// Returns the state of its joints as a word.
    pub fn name(self) -> &'static str {
        match self {
            LinearReference::Free => "free",
            LinearReference::Stuck => "stuck",
        }
    }

    /// Returns the model with every joint in this state, or a sentence that says why this is
    /// impossible.
    pub fn model(self, model: &Model) -> Result<Model, String> {
        let mut model = model.clone();
        for joint in &mut model.joints {
            let law: &dyn Law = &*joint.law;
            let changed: Option<SharedLaw> = match self {
                LinearReference::Free => law.frictionless_reference(),
                LinearReference::Stuck => law.stuck_reference(),
            };
            let none =
                || self.no_reference(&format!("the law `{}` of joint `{}` has no slip limit", law.name(), joint.name));
            joint.law = changed.ok_or_else(none)?;
        }
        Ok(model)
    }

    /// Returns the sentence that says why there is no such reference curve.
    pub fn no_reference(self, why: &str) -> String {
        format!("there is no reference curve with all joints {}: {why}", self.name())
    }
}
