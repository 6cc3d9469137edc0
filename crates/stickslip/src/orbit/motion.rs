//! Results of an orbit for places and joints over a period.

use crate::model::System;
use num_complex::Complex64;

/// The return over which the orbit was closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// `x(t + T/2) = -x(t)`.
    HalfPeriod,
    /// `x(t + T) = x(t)` only.
    FullPeriod,
}

impl Symmetry {
    /// Returns the symmetry of orbits that repeat after `periods` excitation periods. An odd
    /// excitation is mirrored after half of an odd number of periods.
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
    /// Only for a rotation, with values in rad instead of m: the radius (m) that converts it
    /// into a displacement.
    pub rotation_radius: Option<f64>,
}

impl PlaceMotion {
    /// Returns half of the peak-to-peak value, m.
    pub fn amplitude(&self) -> f64 {
        0.5 * (self.maximum - self.minimum)
    }
    /// Returns the amplitude as a length, m, for comparisons between places. For a rotation it
    /// is the arc at its radius.
    pub fn length_amplitude(&self) -> f64 {
        self.amplitude() * self.rotation_radius.unwrap_or(1.0)
    }
    /// Returns the phase of the first harmonic relative to `cos Ωt`, degrees in (-180, 180]. NaN
    /// if the motion has no first harmonic.
    pub fn phase_deg(&self) -> f64 {
        let amplitude = self.amplitude();
        // A first harmonic below this fraction of the amplitude is rounding. Orbits are more
        // accurate than this.
        if amplitude > 0.0 && self.first_harmonic.norm() <= 1e-9 * amplitude {
            return f64::NAN;
        }
        self.first_harmonic.arg().to_degrees()
    }
}

/// Motion of one joint over a period.
#[derive(Debug, Clone, PartialEq)]
pub struct JointMotion {
    /// Name.
    pub name: String,
    /// Energy dissipated by friction per period, J.
    pub dissipation: f64,
    /// Fraction of the period in which the joint slips.
    pub slip_fraction: f64,
    /// Fraction of the period in which the faces stick.
    pub stick_fraction: f64,
    /// Fraction of the period in which the faces are separated. The rest of the period is the
    /// contact of a stop.
    pub open_fraction: f64,
    /// Smallest and largest relative displacement in each direction, m.
    pub displacement: Vec<(f64, f64)>,
    /// Transitions between stick and slip, or changes of the slip direction, per period.
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
