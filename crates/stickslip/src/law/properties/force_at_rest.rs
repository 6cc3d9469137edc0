//! The force of a law before its joint moves.

use crate::law::{Law, MAX_DIRECTIONS, RelativeMotion};

impl dyn Law + '_ {
    /// Returns the forces at zero displacement from the initial states, N.
    pub(crate) fn force_at_rest(&self) -> [f64; MAX_DIRECTIONS] {
        let rest = [0.0; MAX_DIRECTIONS];
        match (self.step(), self.rate()) {
            (Some(step), _) => step.advance_values(&rest, &rest, &mut vec![0.0; step.states()]),
            (None, Some(rate)) => {
                let mut z = vec![0.0; rate.states()];
                rate.evaluate_values(&RelativeMotion { displacement: rest, velocity: rest }, &z.clone(), &mut z)
            }
            (None, None) => rest,
        }
    }
}
