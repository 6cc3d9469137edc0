//! Which harmonics a motion has.

use crate::model::System;
use num_complex::Complex64;

/// Which harmonics the motion has: the multiples of `unit`, the greatest common divisor of the excitation's, and of these the odd ones if
/// the excitation has no others and all laws are odd. Any other would be found zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kept {
    pub unit: usize,
    /// The harmonic of the slowest excitation: what one drive frequency is among harmonics.
    pub scale: usize,
    odd: bool,
    /// The excitation's highest.
    pub highest: usize,
}

impl Kept {
    /// By the harmonics of the excitation that `counts` accepts, by their amplitudes.
    pub fn new(system: &System, counts: impl Fn(Complex64) -> bool) -> Self {
        let present = Kept::present(system, counts);
        let unit = present.iter().fold(0, |a, &b| common_divisor(a, b)).max(1);
        Kept::by(system, &present, (unit, unit))
    }

    /// Of a motion that may repeat after `periods` periods of the drive only: all harmonics of its own frequency, but for what the laws' symmetry
    /// leaves out.
    pub fn slowed(system: &System, periods: usize) -> Self {
        let present = Kept::present(system, |z| z != Complex64::new(0.0, 0.0));
        Kept::by(system, &present, (1, periods))
    }

    fn present(system: &System, counts: impl Fn(Complex64) -> bool) -> Vec<usize> {
        system.harmonics_of_excitation(counts).into_iter().map(|h| h as usize).collect()
    }

    fn by(system: &System, present: &[usize], (unit, scale): (usize, usize)) -> Self {
        let highest = present.iter().copied().max().unwrap_or(0);
        let laws = system.joints().iter().all(|joint| joint.law().is_odd());
        Kept { unit, scale, odd: laws && present.iter().all(|h| (h / unit) % 2 == 1), highest }
    }

    /// The harmonics up to `top`.
    pub fn up_to(self, top: usize) -> Vec<usize> {
        let first = if self.odd { self.unit } else { 0 };
        (first..=top.max(first)).step_by(if self.odd { 2 * self.unit } else { self.unit }).collect()
    }

    pub fn has(self, h: usize) -> bool {
        h.is_multiple_of(self.unit) && !(self.odd && (h / self.unit).is_multiple_of(2))
    }

    /// Twice as many.
    pub fn double(self, top: usize) -> usize {
        2 * top + self.unit
    }

    /// The motion changes its sign after half a period.
    pub fn half_period(self) -> bool {
        self.odd && self.unit % 2 == 1
    }
}

fn common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

/// Weight of a harmonic in norms: that of its velocity.
pub(super) fn weight(h: usize) -> f64 {
    ((h * h) as f64).max(1.0)
}
