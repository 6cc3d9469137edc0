//! Set of harmonics in the series of a motion.

use crate::model::System;
use num_complex::Complex64;

/// Set of harmonics: the multiples of `unit`, the greatest common divisor of the excitation's
/// harmonics.
///
/// If the excitation has only odd multiples and all laws are odd, the set has only odd
/// multiples. All other harmonics are zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct HarmonicSet {
    pub unit: usize,
    /// Factor on harmonic counts: `unit`, or the number of excitation periods in one period of
    /// the orbit.
    pub count_factor: usize,
    /// True if only odd multiples occur.
    odd: bool,
    /// Highest harmonic of the excitation.
    pub highest: usize,
}

impl HarmonicSet {
    /// Returns the set for the harmonics of the excitation whose amplitude `counts` accepts.
    pub fn new(system: &System, counts: impl Fn(Complex64) -> bool) -> Self {
        let present = HarmonicSet::excitation_harmonics(system, counts);
        let unit = present.iter().fold(0, |a, &b| common_divisor(a, b)).max(1);
        HarmonicSet::from_harmonics(system, &present, unit, unit)
    }

    /// Returns the set for an orbit of `periods` excitation periods: all harmonics of the
    /// orbit's frequency, except those that vanish by the symmetry of the laws.
    pub fn subharmonic(system: &System, periods: usize) -> Self {
        let present = HarmonicSet::excitation_harmonics(system, |z| z != Complex64::new(0.0, 0.0));
        HarmonicSet::from_harmonics(system, &present, 1, periods)
    }

    /// Returns the harmonics of the excitation whose amplitude `counts` accepts.
    fn excitation_harmonics(system: &System, counts: impl Fn(Complex64) -> bool) -> Vec<usize> {
        system.harmonics_of_excitation(counts).into_iter().map(|h| h as usize).collect()
    }

    fn from_harmonics(system: &System, present: &[usize], unit: usize, scale: usize) -> Self {
        let highest = present.iter().copied().max().unwrap_or(0);
        let laws = system.joints().iter().all(|joint| joint.law().is_odd());
        HarmonicSet { unit, count_factor: scale, odd: laws && present.iter().all(|h| (h / unit) % 2 == 1), highest }
    }

    /// Returns the harmonics up to `top`.
    pub fn up_to(self, top: usize) -> Vec<usize> {
        let first = if self.odd { self.unit } else { 0 };
        (first..=top.max(first)).step_by(if self.odd { 2 * self.unit } else { self.unit }).collect()
    }

    /// Returns true if the set contains harmonic `h`.
    pub fn contains(self, h: usize) -> bool {
        h.is_multiple_of(self.unit) && !(self.odd && (h / self.unit).is_multiple_of(2))
    }

    /// Returns the highest harmonic of a series with twice as many harmonics.
    pub fn doubled(self, top: usize) -> usize {
        2 * top + self.unit
    }

    /// Returns true if the motion changes its sign after half a period.
    pub fn has_half_period_symmetry(self) -> bool {
        self.odd && self.unit % 2 == 1
    }
}

fn common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

/// Returns the weight of a squared harmonic in norms: the norm is that of the velocity.
pub(crate) fn velocity_weight(h: usize) -> f64 {
    ((h * h) as f64).max(1.0)
}
