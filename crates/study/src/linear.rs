//! Linear references of a model: every joint free, or every joint stuck.

use stickslip::law::{Law, SharedLaw};
use stickslip::model::Model;

/// A linear reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reference {
    /// No joint carries a force.
    Free,
    /// No joint slips or opens.
    Stuck,
}

impl Reference {
    /// Both references.
    pub const ALL: [Reference; 2] = [Reference::Free, Reference::Stuck];

    /// Returns the state of its joints as a word.
    pub fn name(self) -> &'static str {
        match self {
            Reference::Free => "free",
            Reference::Stuck => "stuck",
        }
    }

    /// Returns the model with every joint in this state, or a sentence that says why this is
    /// impossible.
    pub fn model(self, model: &Model) -> Result<Model, String> {
        let mut model = model.clone();
        for joint in &mut model.joints {
            let law: &dyn Law = &*joint.law;
            let changed: Option<SharedLaw> = match self {
                Reference::Free => law.frictionless_reference(),
                Reference::Stuck => law.stuck_reference(),
            };
            let none =
                || self.missing(&format!("the law `{}` of joint `{}` has no slip limit", law.name(), joint.name));
            joint.law = changed.ok_or_else(none)?;
        }
        Ok(model)
    }

    /// Returns the sentence that says why there is no such reference curve.
    pub fn missing(self, why: &str) -> String {
        format!("there is no reference curve with all joints {}: {why}", self.name())
    }
}
