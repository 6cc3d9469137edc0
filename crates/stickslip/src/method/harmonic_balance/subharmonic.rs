//! Orbits of several periods of the excitation.

use super::equations::harmonic_set::HarmonicSet;
use super::solver::HarmonicBalanceSolver;
use super::{HarmonicBalance, NAME};
use crate::method::options::PERIOD;
use crate::method::orbit_search::cold_restart::ColdRestart;
use crate::method::{Method, MethodError, Solver};
use crate::model::System;
use num_complex::Complex64;

/// Harmonic balance for orbits that repeat after several periods of the excitation.
///
/// The series is one of a fraction of the excitation frequency.
///
/// # Example
/// Friction at a constant limit has only orbits that repeat with the excitation, and the method
/// finds that orbit.
/// ```
/// use stickslip::method::{Method, harmonic_balance::{HarmonicBalance, Subharmonic}};
/// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
/// let balance = HarmonicBalance { harmonics: Some(7), ..HarmonicBalance::default() };
/// let method = Subharmonic { balance, period: 3 };
/// let orbit = method.solver(&system).unwrap().orbit(std::f64::consts::TAU * 121.0).unwrap();
/// assert_eq!(orbit.periods, 3);
/// let first = orbit.place("blade1").unwrap().first_harmonic.norm();
/// assert!((first / orbit.places[0].amplitude() - 1.0).abs() < 0.01);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Subharmonic {
    /// Options of the method. Harmonics and samples count for one period of the excitation.
    pub balance: HarmonicBalance,
    /// Number of excitation periods after which the motion repeats.
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
        let highest = HarmonicSet::new(system, |z| z != Complex64::new(0.0, 0.0)).highest;
        self.balance.check(highest)?;
        let (period, times) = (self.period.max(1), |count: usize| count.saturating_mul(self.period.max(1)));
        let too_high = |_| {
            let message = format!("{period} periods with harmonic {highest} are too many; use fewer periods");
            MethodError::option(NAME, PERIOD.key, message)
        };
        u32::try_from(times(highest)).map_err(too_high)?;
        let HarmonicBalance { harmonics, samples, tolerance } = self.balance;
        let balance = HarmonicBalance { harmonics: harmonics.map(times), samples: samples.map(times), tolerance };
        let slowed = system.subharmonic(u32::try_from(period).map_err(too_high)?);
        Ok(Box::new(ColdRestart(HarmonicBalanceSolver::new(slowed, balance, period)?)))
    }
}
