//! Stability: what becomes of a small disturbance of an orbit.
//!
//! Where no two motions of the system ever separate, every orbit is stable and nothing is computed ([`System::contracts`]). Elsewhere the
//! largest Floquet multipliers decide, eigenvalues of the derivative of the return map.
//!
//! [`System::contracts`]: crate::model::System::contracts

use super::{Orbit, Symmetry};
use nalgebra::DMatrix;
use num_complex::Complex64;
use std::borrow::Cow;
use stickslip_numerics::eigen;

/// A multiplier up to this much above one counts as on the unit circle: those of stick offsets and of undamped systems are
/// exactly one, and the eigenvalues of a return map carry about its rounding, 1e-12, or the square root of it if they meet.
const NEUTRAL: f64 = 1e-6;

/// What is known of an orbit's stability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stability {
    /// No disturbance grows, by theorem: see [`crate::model::System::contracts`].
    Proven,
    /// By the Floquet multipliers.
    Computed {
        /// The largest modulus of them, over the full period.
        largest: f64,
    },
    /// The method made no return map to tell, or its eigenvalues were not found.
    Unknown,
}

impl Orbit {
    /// Whether no small disturbance grows, and how that is known.
    pub fn stability(&self) -> Stability {
        if self.contracts {
            return Stability::Proven;
        }
        if self.return_map.is_empty() && !self.places.is_empty() {
            return Stability::Unknown;
        }
        match eigen::largest_modulus(&self.return_map) {
            Some(modulus) => Stability::Computed { largest: self.over_period(modulus.into()).norm() },
            None => Stability::Unknown,
        }
    }

    /// Whether no small disturbance grows; `None` if that is not known (see [`Orbit::stability`]).
    pub fn is_stable(&self) -> Option<bool> {
        match self.stability() {
            Stability::Proven => Some(true),
            Stability::Computed { largest } => Some(largest <= 1.0 + NEUTRAL),
            Stability::Unknown => None,
        }
    }

    /// All Floquet multipliers of the full period, by falling modulus; `None` if there is no return map (places without mass, exact
    /// and smooth laws mixed), or if its eigenvalues were not found. Stuck contacts contribute zeros (they swallow disturbances)
    /// and, while they stick for the whole period, a one for their free offset.
    ///
    /// Source: Leine and Nijmeijer (2004), Ch. 7.
    pub fn multipliers(&self) -> Option<Vec<Complex64>> {
        let map = if self.return_map.is_empty() && !self.places.is_empty() {
            Cow::Owned(self.path.return_map(&self.start, self.symmetry)?)
        } else {
            Cow::<DMatrix<f64>>::Borrowed(&self.return_map)
        };
        let found = eigen::eigenvalues(&map)?;
        let mut multipliers: Vec<Complex64> = found.into_iter().map(|value| self.over_period(value)).collect();
        multipliers.sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()).then(b.im.total_cmp(&a.im)));
        Some(multipliers)
    }

    /// Distance between the state at t = 0 and where an independent flow brings it after a return, relative to the vibration, in the energy norm
    /// ([`super::Evidence::return_defect`]), of an orbit of any size: where its method did not follow the motion, it is followed now, over one period.
    /// `None` where no flow takes the laws of the system.
    pub fn return_defect(&self) -> Option<f64> {
        self.evidence.return_defect.or_else(|| self.path.return_defect(&self.start, self.symmetry))
    }

    /// The multiplier of the full period from that of a return.
    fn over_period(&self, value: Complex64) -> Complex64 {
        match self.symmetry {
            // the half-period map with its sign is the square root of the full one
            Symmetry::HalfPeriod => value * value,
            Symmetry::FullPeriod => value,
        }
    }
}
