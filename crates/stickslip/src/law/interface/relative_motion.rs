//! The relative motion at a joint.

use stickslip_numerics::dual::Real;

/// Largest number of directions of a joint.
pub const MAX_DIRECTIONS: usize = 3;

/// Relative motion at a joint in up to three directions. Only the law's first directions are
/// used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeMotion<S> {
    /// Relative displacement `u`, m.
    pub displacement: [S; MAX_DIRECTIONS],
    /// Relative velocity `u'`, m/s.
    pub velocity: [S; MAX_DIRECTIONS],
}

impl<S: Real> RelativeMotion<S> {
    /// Returns a motion in one direction.
    pub fn along(displacement: S, velocity: S) -> Self {
        let zero = S::from(0.0);
        RelativeMotion { displacement: [displacement, zero, zero], velocity: [velocity, zero, zero] }
    }
}
