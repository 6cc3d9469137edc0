//! A joint in one mode, as a smooth law: it sticks, or it slips in one direction.

use crate::law::{Contact, Law, LawInfo, MAX_DIRECTIONS, RateLaw, RateView, RelativeMotion, SharedLaw};
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// The mode of a joint until the next switch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum FrictionMode {
    /// The joint sticks: its relative velocity is zero, and the force is the reaction.
    Stick,
    /// The joint slips in the direction of this sign.
    Slip(f64),
}

impl FrictionMode {
    pub fn contact(self) -> Contact {
        match self {
            FrictionMode::Stick => Contact::Stick,
            FrictionMode::Slip(sign) => Contact::slip(sign),
        }
    }
}

/// A law of friction in one mode. In stick, the unknown is the force instead of the velocity,
/// scaled like a damper with coefficient `unit`.
#[derive(Debug, Clone)]
struct LawInMode {
    law: SharedLaw,
    mode: FrictionMode,
    /// Force per unknown of a stuck joint, N s/m. It gives the unknown the magnitude of a
    /// velocity.
    unit: f64,
}

/// Returns the law of a joint in a mode.
pub(super) fn in_mode(law: &SharedLaw, mode: FrictionMode, unit: f64) -> SharedLaw {
    Arc::new(LawInMode { law: law.clone(), mode, unit })
}

impl Law for LawInMode {
    fn info(&self) -> &'static LawInfo {
        self.law.info()
    }
    fn values(&self) -> Vec<f64> {
        self.law.values()
    }
    fn force_scale(&self) -> f64 {
        self.law.force_scale()
    }
    fn is_odd(&self) -> bool {
        false
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
}

impl RateLaw for LawInMode {
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; MAX_DIRECTIONS] {
        let v = motion.velocity[0];
        let force = match self.mode {
            FrictionMode::Stick => v * self.unit,
            FrictionMode::Slip(sign) => {
                let (force, slope) = self.law.sliding().map_or((0.0, 0.0), |law| law.slip_force(v.re()));
                ((v - v.re()) * slope + force) * sign
            }
        };
        [force, S::from(0.0), S::from(0.0)]
    }
}
