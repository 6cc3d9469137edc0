//! The last orbits, for warm starts, with a secant predictor.

use super::equations::HarmonicSolution;
use num_complex::Complex64;

/// Number of orbits that are kept for warm starts. A peak is refined between that many.
pub(super) const RECENT: usize = 8;
/// Largest extrapolation of the secant predictor, relative to the last frequency step.
const LONGEST_EXTRAPOLATION: f64 = 1.5;

/// An orbit that was found.
pub(super) struct RecentOrbit {
    /// State at t = 0.
    pub(super) start: Vec<f64>,
    /// Frequency of the orbit, rad/s.
    pub(super) omega: f64,
    /// Highest harmonic.
    pub(super) highest_harmonic: usize,
    pub(super) solution: HarmonicSolution,
}

impl RecentOrbit {
    /// Returns the motion at `omega` on the line through this orbit and the previous one
    /// (secant predictor). Returns this motion if the extrapolation is longer than
    /// [`LONGEST_EXTRAPOLATION`].
    pub(super) fn extrapolate(&self, before: &RecentOrbit, omega: f64) -> HarmonicSolution {
        let share = (omega - self.omega) / (self.omega - before.omega);
        let mut motion = self.solution.clone();
        if share.abs() <= LONGEST_EXTRAPOLATION {
            let line = |now: &mut [Complex64], before: &[Complex64]| {
                now.iter_mut().zip(before).for_each(|(now, before)| *now += (*now - before) * share);
            };
            line(&mut motion.c, &before.solution.c);
            line(&mut motion.force, &before.solution.force);
        }
        motion
    }
}
