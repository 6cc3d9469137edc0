//! What an orbit tells of places and joints over a period.

use crate::model::System;
use num_complex::Complex64;

/// Which return the orbit was closed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// `x(t + T/2) = -x(t)`.
    HalfPeriod,
    /// `x(t + T) = x(t)` only.
    FullPeriod,
}

impl Symmetry {
    /// Of orbits that repeat after so many periods of the drive: an odd number of them has a half after which an odd excitation is mirrored.
    pub(crate) fn of(system: &System, periods: usize) -> Symmetry {
        if system.is_odd() && periods % 2 == 1 { Symmetry::HalfPeriod } else { Symmetry::FullPeriod }
    }
}

/// Motion of one place over a period of the orbit.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceMotion {
    /// Name.
    pub name: String,
    /// Largest displacement, m.
    pub maximum: f64,
    /// Smallest displacement, m.
    pub minimum: f64,
    /// Mean displacement, m.
    pub mean: f64,
    /// First harmonic `X` in `x = Re(X e^{jΩt}) + …`, m.
    pub first_harmonic: Complex64,
    /// Of a rotation, whose values are rad instead of m: the radius (m) at which it counts beside displacements.
    pub radius: Option<f64>,
}

/// First harmonic, relative to the amplitude, that is rounding: under a drive that has none, orbits are closed to less.
const NO_PHASE: f64 = 1e-9;

impl PlaceMotion {
    /// Half of peak to peak, m.
    pub fn amplitude(&self) -> f64 {
        0.5 * (self.maximum - self.minimum)
    }
    /// The same as a length, m, where sizes of places are compared: of a rotation the arc at its radius.
    pub fn size(&self) -> f64 {
        self.amplitude() * self.radius.unwrap_or(1.0)
    }
    /// Phase of the first harmonic against `cos Ωt`, degrees in (-180, 180]; not a number where other harmonics are all of the motion.
    pub fn phase_deg(&self) -> f64 {
        let amplitude = self.amplitude();
        if amplitude > 0.0 && self.first_harmonic.norm() <= NO_PHASE * amplitude {
            return f64::NAN;
        }
        self.first_harmonic.arg().to_degrees()
    }
}

/// What one joint does over a period.
#[derive(Debug, Clone, PartialEq)]
pub struct JointMotion {
    /// Name.
    pub name: String,
    /// Energy lost in friction per period, J.
    pub dissipation: f64,
    /// Fraction of the period in which the joint slips.
    pub slip_fraction: f64,
    /// Fraction of the period in which its faces rest on each other.
    pub stick_fraction: f64,
    /// Fraction of the period in which its faces are apart. What the three fractions leave of one is a stop that touches.
    pub open_fraction: f64,
    /// Smallest and largest relative displacement along each of its directions, m.
    pub displacement: Vec<(f64, f64)>,
    /// Changes between stick and slip, or of the slip direction, per period.
    pub switches: usize,
}

/// Energies per period of the orbit, J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energy {
    /// Work of the forces and of imposed motion.
    pub work_in: f64,
    /// Loss in viscous dampers.
    pub viscous: f64,
    /// Loss in joints.
    pub friction: f64,
}
