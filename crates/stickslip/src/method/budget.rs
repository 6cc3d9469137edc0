//! Deterministic bound on computing, so that a result does not depend on the machine.

/// Bound on the work of one or more searches. The unit is the work that the search for one
/// orbit may take by default.
///
/// A budget is handed down from search to search. Methods that do not count their work charge
/// nothing.
///
/// # Example
/// ```
/// use stickslip::method::{Budget, Method, Request, harmonic_balance::HarmonicBalance};
/// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
/// let mut solver = HarmonicBalance::default().solver(&system).unwrap();
/// let mut budget = Budget::points(0.5);
/// solver.solve(&Request::at(760.0), &mut budget).unwrap();
/// assert!(budget.used() > 0.0 && !budget.is_used_up());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    limit: f64,
    used: f64,
}

impl Budget {
    /// Creates a budget as a multiple of the default for one orbit.
    pub fn points(limit: f64) -> Self {
        Budget { limit, used: 0.0 }
    }

    /// Returns the work used so far.
    pub fn used(&self) -> f64 {
        self.used
    }

    /// Returns the work that is left.
    pub fn remaining(&self) -> f64 {
        (self.limit - self.used).max(0.0)
    }

    /// Returns true if no work is left.
    pub fn is_used_up(&self) -> bool {
        self.used >= self.limit
    }

    /// Adds work that was done.
    pub fn charge(&mut self, work: f64) {
        self.used += work;
    }

    /// Returns a new budget of at most `limit` and at most the remaining work.
    pub fn part(&self, limit: f64) -> Budget {
        Budget::points(limit.min(self.remaining()))
    }
}

impl Default for Budget {
    /// The budget of one orbit.
    fn default() -> Self {
        Budget::points(1.0)
    }
}
