//! Warm starts from the series of a neighbouring orbit, with a secant predictor.

use super::equations::HarmonicSolution;
use crate::orbit::JointSeries;
use num_complex::Complex64;

/// Largest extrapolation of the secant predictor, relative to the last frequency step.
const LONGEST_EXTRAPOLATION: f64 = 1.5;

/// Returns the motion at `omega` on the line through an orbit and the one before it (secant
/// predictor). Returns the orbit's own motion if the extrapolation is longer than
/// [`LONGEST_EXTRAPOLATION`], or if no orbit before it is known.
pub(super) fn extrapolate(series: &JointSeries, omega: f64) -> HarmonicSolution {
    let mut motion = HarmonicSolution::from_series(series);
    let Some(before) = &series.previous else { return motion };
    let share = (omega - series.omega) / (series.omega - before.omega);
    if share.abs() <= LONGEST_EXTRAPOLATION {
        let line = |now: &mut [Complex64], before: &[Complex64]| {
            now.iter_mut().zip(before).for_each(|(now, before)| *now += (*now - before) * share);
        };
        line(&mut motion.c, &before.motions);
        line(&mut motion.force, &before.forces);
    }
    motion
}
