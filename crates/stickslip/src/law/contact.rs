//! Whether faces rest on each other, slide, or are apart.

use serde::{Deserialize, Serialize};

/// What the faces of a joint do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Contact {
    /// They rest on each other.
    Stick,
    /// They slide with `u' > 0`.
    SlipForward,
    /// They slide with `u' < 0`.
    SlipBackward,
    /// They slide in a plane.
    Slip,
    /// They touch, and the law does not tell whether they slide: a stop.
    Touch,
    /// They do not touch.
    Open,
}

/// A smooth law never quite sticks: it counts as slipping while its force is above this fraction of its limit.
pub(crate) const SLIPS_ABOVE: f64 = 0.95;
/// Any other is at its limit while it slips, but for the rounding of what it has summed up to there.
const AT: f64 = 1.0 - 1e-9;

impl Contact {
    /// The slip direction along one direction: +1, -1, or 0.
    pub fn sign(self) -> f64 {
        match self {
            Contact::SlipForward => 1.0,
            Contact::SlipBackward => -1.0,
            Contact::Stick | Contact::Slip | Contact::Touch | Contact::Open => 0.0,
        }
    }

    /// Whether the faces slide.
    pub fn slips(self) -> bool {
        matches!(self, Contact::SlipForward | Contact::SlipBackward | Contact::Slip)
    }

    /// The same contact in the mirrored motion.
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

    /// By the force of a smooth law against its limit, along all directions. A limit of zero holds nothing: the faces slide as they move.
    pub fn by_limit(limit: f64, velocity: &[f64], force: &[f64]) -> Self {
        Contact::above(SLIPS_ABOVE, limit, velocity, force)
    }

    /// The same of a law that sticks below its limit.
    pub fn at_limit(limit: f64, velocity: &[f64], force: &[f64]) -> Self {
        Contact::above(AT, limit, velocity, force)
    }

    fn above(fraction: f64, limit: f64, velocity: &[f64], force: &[f64]) -> Self {
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
