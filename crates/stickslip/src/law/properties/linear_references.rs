//! The linear references of a law: the joint without friction, and the stuck joint.

use super::linear_springs::LinearSprings;
use crate::law::interface::ideal_elements::UNREACHABLE_LIMIT;
use crate::law::interface::parameter::{LIMIT, STATIC_LIMIT};
use crate::law::{Law, SharedLaw};

impl dyn Law + '_ {
    /// Returns the law with another slip limit (N), dynamic and static; `None` if it has no slip
    /// limit.
    fn with_slip_limit(&self, limit: f64) -> Option<SharedLaw> {
        let law = self.with_value(LIMIT, limit)?;
        Some(law.with_value(STATIC_LIMIT, limit).unwrap_or(law))
    }

    /// Returns the linear reference without friction: the slip limit is zero, or the faces stay
    /// apart. `None` if the law has neither a slip limit nor faces that separate.
    pub fn frictionless_reference(&self) -> Option<SharedLaw> {
        match self.closed_stiffness() {
            Some(along) => Some(LinearSprings::shared(&vec![0.0; along.len()])),
            None => {
                let springs = self.reference_springs().map(|[free, _]| LinearSprings::shared(&free));
                springs.or_else(|| self.with_slip_limit(0.0))
            }
        }
    }

    /// Returns the linear reference that is permanently stuck: no force reaches the slip limit,
    /// and the faces stay closed. `None` if the law has neither a slip limit nor faces that
    /// separate.
    pub fn stuck_reference(&self) -> Option<SharedLaw> {
        match self.closed_stiffness() {
            Some(along) => Some(LinearSprings::shared(&along)),
            None => {
                let springs = self.reference_springs().map(|[_, stuck]| LinearSprings::shared(&stuck));
                springs.or_else(|| self.with_slip_limit(UNREACHABLE_LIMIT))
            }
        }
    }
}
