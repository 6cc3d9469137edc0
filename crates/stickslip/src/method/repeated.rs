//! Motions that repeat after several periods of the drive, sought again where the neighbour leads to an unstable one.
//!
//! The orbit that repeats after one period is there at all frequencies, and a search that starts from its neighbour stays on it, also where it is
//! unstable and the motion that is stable repeats after several. A search without a neighbour follows the motion in time for a while first.

use super::{OrbitError, Solver};
use crate::orbit::Orbit;

/// A solver of orbits of several periods that looks afresh where it finds an unstable one from a neighbour.
pub(crate) struct Afresh<S>(pub S);

impl<S: Solver> Solver for Afresh<S> {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        let near = self.0.orbit(omega, start)?;
        if start.is_none() || near.is_stable() != Some(false) {
            return Ok(near);
        }
        // of two unstable ones that which takes all the periods that were asked for: the other is known to lead away from itself
        let better = |afresh: &Orbit| afresh.is_stable() == Some(true) || afresh.repeats() > near.repeats();
        Ok(self.0.orbit(omega, None).ok().filter(better).unwrap_or(near))
    }

    fn between(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.0.between(omega, start)
    }

    fn effort(&self) -> f64 {
        self.0.effort()
    }
}
