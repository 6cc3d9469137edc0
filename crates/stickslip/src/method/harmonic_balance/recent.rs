//! The last orbits, from which their neighbours begin.

use super::equations::Solution;
use num_complex::Complex64;

/// Orbits whose harmonics are kept as starts for their neighbours: those between which a peak is refined.
pub(super) const RECENT: usize = 8;
/// Distance from the last frequency, relative to that between the last two, up to which many contacts begin on the line through both motions.
const AHEAD: f64 = 1.5;

/// An orbit that was found.
pub(super) struct Recent {
    /// Its state at t = 0.
    pub(super) start: Vec<f64>,
    pub(super) omega: f64,
    /// Its highest harmonic.
    pub(super) top: usize,
    pub(super) motion: Solution,
}

impl Recent {
    /// The motion at a frequency on the line through this one and the one before, up to [`AHEAD`] times as far.
    pub(super) fn towards(&self, before: &Recent, omega: f64) -> Solution {
        let share = (omega - self.omega) / (self.omega - before.omega);
        let mut motion = self.motion.clone();
        if share.abs() <= AHEAD {
            let line = |now: &mut [Complex64], before: &[Complex64]| {
                now.iter_mut().zip(before).for_each(|(now, before)| *now += (*now - before) * share);
            };
            line(&mut motion.c, &before.motion.c);
            line(&mut motion.force, &before.motion.force);
        }
        motion
    }
}
