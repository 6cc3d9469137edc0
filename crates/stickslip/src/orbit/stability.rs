//! Floquet multipliers: what becomes of a small disturbance after one period.

use super::{Orbit, Symmetry};
use num_complex::Complex64;

/// A multiplier up to this much above one counts as on the unit circle: those of stick offsets and of undamped systems are
/// exactly one, and the eigenvalues of a return map carry about its rounding, 1e-12, or the square root of it if they meet.
const NEUTRAL: f64 = 1e-6;

impl Orbit {
    /// Floquet multipliers of the full period, by falling modulus. Stuck contacts contribute zeros (they swallow disturbances)
    /// and, while they stick for the whole period, a one for their free offset.
    ///
    /// Source: Leine and Nijmeijer (2004), Ch. 7.
    pub fn multipliers(&self) -> Vec<Complex64> {
        let mut multipliers: Vec<Complex64> = match self.return_map.nrows() {
            0 => Vec::new(),
            _ => self.return_map.complex_eigenvalues().iter().copied().collect(),
        };
        if self.symmetry == Symmetry::HalfPeriod {
            // the half-period map with its sign is the square root of the full one
            multipliers.iter_mut().for_each(|m| *m *= *m);
        }
        multipliers.sort_by(|a, b| b.norm_sqr().total_cmp(&a.norm_sqr()).then(b.im.total_cmp(&a.im)));
        multipliers
    }

    /// Whether no small disturbance grows; `None` if the method made no return map to tell (harmonic balance of many degrees of
    /// freedom).
    pub fn is_stable(&self) -> Option<bool> {
        if self.return_map.is_empty() && !self.places.is_empty() {
            return None;
        }
        Some(self.multipliers().first().is_none_or(|m| m.norm() <= 1.0 + NEUTRAL))
    }
}
