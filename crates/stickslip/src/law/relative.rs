//! The relative motion at a joint.

use stickslip_numerics::dual::Real;

/// The most directions that a joint can have.
pub const MOST_DIRECTIONS: usize = 3;

/// The relative motion at a joint, along up to three directions; the first ones count, as many as the law has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relative<S> {
    /// Relative displacement `u`, m.
    pub displacement: [S; MOST_DIRECTIONS],
    /// Relative velocity `u'`, m/s.
    pub velocity: [S; MOST_DIRECTIONS],
}

impl<S: Real> Relative<S> {
    /// Motion along one direction.
    pub fn along(displacement: S, velocity: S) -> Self {
        let zero = S::from(0.0);
        Relative { displacement: [displacement, zero, zero], velocity: [velocity, zero, zero] }
    }
}
