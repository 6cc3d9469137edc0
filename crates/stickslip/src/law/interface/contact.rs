//! Contact states: stick, slip, separation.

use serde::{Deserialize, Serialize};

/// State of the faces of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Contact {
    /// The faces stick.
    Stick,
    /// The faces slip with `u' > 0`.
    SlipForward,
    /// The faces slip with `u' < 0`.
    SlipBackward,
    /// The faces slip in a plane.
    Slip,
    /// The faces touch, and the law does not distinguish stick and slip (a stop).
    Touch,
    /// The faces are separated.
    Open,
}

impl Contact {
    /// Returns the sign of the slip velocity in one direction: +1, -1, or 0.
    pub fn sign(self) -> f64 {
        match self {
            Contact::SlipForward => 1.0,
            Contact::SlipBackward => -1.0,
            Contact::Stick | Contact::Slip | Contact::Touch | Contact::Open => 0.0,
        }
    }

    /// Tells whether the faces slip.
    pub fn slips(self) -> bool {
        matches!(self, Contact::SlipForward | Contact::SlipBackward | Contact::Slip)
    }

    /// Returns the state in the mirrored motion.
    pub fn mirrored(self) -> Self {
        match self {
            Contact::SlipForward => Contact::SlipBackward,
            Contact::SlipBackward => Contact::SlipForward,
            other => other,
        }
    }

    pub(crate) fn slip(sign: f64) -> Self {
        if sign > 0.0 { Contact::SlipForward } else { Contact::SlipBackward }
    }

    /// Returns the state of a smooth law from its force relative to its limit, over all
    /// directions. With a limit of zero the faces slip in the direction of the velocity.
    pub fn of_smooth_law(limit: f64, velocity: &[f64], force: &[f64]) -> Self {
        // A smooth law never sticks completely. It counts as slipping while its force exceeds
        // this fraction of its limit.
        Contact::from_fraction(0.95, limit, velocity, force)
    }

    /// Returns the state of a law that sticks below its limit.
    pub fn of_sticking_law(limit: f64, velocity: &[f64], force: &[f64]) -> Self {
        // A law with stick carries its limit during slip, up to accumulated rounding.
        Contact::from_fraction(1.0 - 1e-9, limit, velocity, force)
    }

    fn from_fraction(fraction: f64, limit: f64, velocity: &[f64], force: &[f64]) -> Self {
        let size = force.iter().map(|f| f * f).sum::<f64>().sqrt();
        if limit.is_infinite() || size < fraction * limit {
            return Contact::Stick;
        }
        match (force, velocity) {
            ([force], [velocity]) => Contact::slip(if limit > 0.0 { *force } else { *velocity }),
            _ => Contact::Slip,
        }
    }
}
