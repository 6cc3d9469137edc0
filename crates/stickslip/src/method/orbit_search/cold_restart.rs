//! Second search for orbits of several excitation periods, used where a warm start leads to an
//! unstable orbit.
//!
//! The orbit that repeats after one period exists at all frequencies. A warm-started search
//! stays on it even where it is unstable and the stable orbit repeats after several periods. A
//! search without a warm start first integrates the motion for a while.

use crate::method::{OrbitError, Solver};
use crate::orbit::Orbit;

/// A solver that searches again without a warm start if the warm-started orbit is unstable.
pub(crate) struct ColdRestart<S>(pub S);

impl<S: Solver> Solver for ColdRestart<S> {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        let near = self.0.orbit(omega, start)?;
        if start.is_none() || near.is_stable() != Some(false) {
            return Ok(near);
        }
        // prefer, of two unstable orbits, the one of more periods; the motion is known to leave
        // the other
        let better =
            |afresh: &Orbit| afresh.is_stable() == Some(true) || afresh.minimal_periods() > near.minimal_periods();
        Ok(self.0.orbit(omega, None).ok().filter(better).unwrap_or(near))
    }

    fn orbit_without_estimate(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.0.orbit_without_estimate(omega, start)
    }

    fn work_fraction(&self) -> f64 {
        self.0.work_fraction()
    }
}
