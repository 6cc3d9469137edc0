//! Motions that repeat after several periods of the drive.

use super::balance::Balance;
use super::kept::Kept;
use super::{HarmonicBalance, NAME};
use crate::method::option::PERIOD;
use crate::method::repeated::Afresh;
use crate::method::{Method, MethodError, Solver};
use crate::model::System;
use num_complex::Complex64;

/// Harmonic balance for motions that repeat after several periods of the drive: a series of its fraction.
///
/// # Example
/// Friction at a constant limit allows no other motion than one that repeats with the drive, and that is found.
/// ```
/// use stickslip::method::{Method, harmonic_balance::{HarmonicBalance, Subharmonic}};
/// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
/// let method = Subharmonic { balance: HarmonicBalance { harmonics: Some(7), ..HarmonicBalance::default() }, period: 3 };
/// let orbit = method.solver(&system).unwrap().orbit(std::f64::consts::TAU * 121.0, None).unwrap();
/// assert_eq!(orbit.periods, 3);
/// assert!((orbit.place("blade1").unwrap().first_harmonic.norm() / orbit.places[0].amplitude() - 1.0).abs() < 0.01);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Subharmonic {
    /// Its options; harmonics and samples count for one period of the drive.
    pub balance: HarmonicBalance,
    /// Periods of the drive after which the motion repeats.
    pub period: usize,
}

impl Method for Subharmonic {
    fn name(&self) -> &'static str {
        NAME
    }
    fn closes_motions(&self, _system: &System) -> bool {
        false
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let highest = Kept::new(system, |z| z != Complex64::new(0.0, 0.0)).highest;
        self.balance.check(highest)?;
        let (period, times) = (self.period.max(1), |count: usize| count.saturating_mul(self.period.max(1)));
        let too_high = |_| {
            let message = format!("{period} periods with harmonic {highest} are too many; use fewer periods");
            MethodError::option(NAME, PERIOD.key, message)
        };
        u32::try_from(times(highest)).map_err(too_high)?;
        let HarmonicBalance { harmonics, samples, tolerance } = self.balance;
        let balance = HarmonicBalance { harmonics: harmonics.map(times), samples: samples.map(times), tolerance };
        let slowed = system.slowed(u32::try_from(period).map_err(too_high)?);
        Ok(Box::new(Afresh(Balance::new(slowed, balance, period)?)))
    }
}
