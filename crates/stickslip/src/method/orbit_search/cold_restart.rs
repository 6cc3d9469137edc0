//! Second search for orbits of several excitation periods, used where a warm start leads to an
//! unstable orbit.
//!
//! The orbit that repeats after one period exists at all frequencies. A warm-started search
//! stays on it even where it is unstable and the stable orbit repeats after several periods. A
//! search without a warm start first integrates the motion for a while.

use crate::method::{Budget, ErrorEstimate, OrbitError, Request, Solver};
use crate::orbit::Orbit;

/// A solver that searches again without a warm start if the warm-started orbit is unstable.
pub(crate) struct ColdRestart<S>(pub S);

impl<S: Solver> Solver for ColdRestart<S> {
    fn solve(&mut self, request: &Request<'_>, budget: &mut Budget) -> Result<Orbit, OrbitError> {
        let near = self.0.solve(request, budget)?;
        let restarts = request.seed.is_some() && request.estimate == ErrorEstimate::Required;
        if !restarts || near.is_stable() != Some(false) {
            return Ok(near);
        }
        // prefer, of two unstable orbits, the one of more periods; the motion is known to leave
        // the other
        let better =
            |afresh: &Orbit| afresh.is_stable() == Some(true) || afresh.minimal_periods() > near.minimal_periods();
        let cold = Request { seed: None, ..*request };
        Ok(self.0.solve(&cold, budget).ok().filter(better).unwrap_or(near))
    }
}
