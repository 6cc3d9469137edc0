//! Equations on the way to the given ones, and when they count as solved.

use super::hold::stay;

/// Residual relative to the motion, and to the slip limits, at which the equations count as solved: a thousand times the rounding of a
/// stiff system.
pub(super) const SOLVED: f64 = 1e-10;

/// The equations between the given ones and those that are easier to solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ease {
    /// Every law gives this many times the force that it has at the inverse share of the motion: with a large one slip limits are high, and
    /// whatever is not linear is far away.
    pub limits: f64,
    /// Share of its distance from a given force by which a force is drawn there, see [`super::equations::Level::anchor`].
    pub pull: f64,
}

pub(super) const GIVEN: Ease = Ease { limits: 1.0, pull: 0.0 };

impl Ease {
    /// What is added to the diagonal of a force equation's derivative, at a harmonic.
    pub fn stay(self, h: usize) -> f64 {
        self.pull + stay(h)
    }
}
