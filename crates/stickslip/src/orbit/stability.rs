//! Stability of an orbit against small disturbances.
//!
//! If no two motions of the system diverge, every orbit is stable, and nothing is computed
//! ([`System::is_incrementally_stable`]). Otherwise the Floquet multipliers of largest modulus
//! decide. They are eigenvalues of the derivative of the return map.
//!
//! [`System::is_incrementally_stable`]: crate::model::System::is_incrementally_stable

use super::{Orbit, Symmetry};
use nalgebra::DMatrix;
use num_complex::Complex64;
use std::borrow::Cow;
use stickslip_numerics::eigen;

/// Knowledge about the stability of an orbit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stability {
    /// No disturbance grows, by theorem: see [`crate::model::System::is_incrementally_stable`].
    Proven,
    /// Determined by the Floquet multipliers.
    Computed {
        /// Largest modulus of the multipliers over the full period.
        largest: f64,
    },
    /// The method did not compute a return map, or the computation of its eigenvalues failed.
    Unknown,
}

impl Orbit {
    /// Tells whether the orbit is stable, and the source of this knowledge.
    pub fn stability(&self) -> Stability {
        if self.contracts {
            return Stability::Proven;
        }
        if self.return_map.is_empty() && !self.places.is_empty() {
            return Stability::Unknown;
        }
        match eigen::largest_modulus(&self.return_map) {
            Some(modulus) => Stability::Computed { largest: self.full_period(modulus.into()).norm() },
            None => Stability::Unknown,
        }
    }

    /// Tells whether no small disturbance grows; `None` if unknown (see [`Orbit::stability`]).
    pub fn is_stable(&self) -> Option<bool> {
        match self.stability() {
            Stability::Proven => Some(true),
            // A multiplier that exceeds one by less than this counts as on the unit circle.
            // Multipliers of stick offsets and of undamped systems equal one. The eigenvalues of
            // a return map have a rounding error of about 1e-12, or its square root if two of
            // them coincide.
            Stability::Computed { largest } => Some(largest <= 1.0 + 1e-6),
            Stability::Unknown => None,
        }
    }

    /// Returns all Floquet multipliers of the full period, in decreasing order of modulus.
    /// `None` without a return map (places without mass, exact and smooth laws mixed), or if the
    /// computation of the eigenvalues failed. A stuck contact contributes zeros, because it
    /// absorbs disturbances. A permanently stuck contact also contributes a one for its free
    /// offset.
    ///
    /// Source: Leine and Nijmeijer (2004), Ch. 7.
    pub fn multipliers(&self) -> Option<Vec<Complex64>> {
        let map = if self.return_map.is_empty() && !self.places.is_empty() {
            Cow::Owned(self.path.return_map(&self.initial_state, self.symmetry)?)
        } else {
            Cow::<DMatrix<f64>>::Borrowed(&self.return_map)
        };
        let found = eigen::eigenvalues(&map)?;
        let mut multipliers: Vec<Complex64> = found.into_iter().map(|value| self.full_period(value)).collect();
        multipliers.sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()).then(b.im.total_cmp(&a.im)));
        Some(multipliers)
    }

    /// Returns the distance between the state at t = 0 and its return under an independent time
    /// integration, relative to the vibration, in the energy norm
    /// ([`super::Evidence::return_defect`]). It works for systems of any size: if the defect is
    /// not known yet, this call integrates the motion over one return. `None` if no integrator
    /// supports the laws of the system.
    pub fn return_defect(&self) -> Option<f64> {
        self.evidence.return_defect.or_else(|| self.path.return_defect(&self.initial_state, self.symmetry))
    }

    /// Converts the multiplier of a return into that of the full period.
    fn full_period(&self, value: Complex64) -> Complex64 {
        match self.symmetry {
            // the signed half-period map is the square root of the full map
            Symmetry::HalfPeriod => value * value,
            Symmetry::FullPeriod => value,
        }
    }
}
