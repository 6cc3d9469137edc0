//! Work limits of the points of a curve.

use crate::method::{Budget, OrbitError, Request, Solver};
use crate::orbit::Orbit;

/// Solves the points of a curve, each within its own budget.
///
/// After two consecutive failures that took more than a tenth of the default budget, the next
/// points get this tenth, until one succeeds. Nearly all orbits take less, and a curve without
/// orbits ends soon.
#[derive(Debug, Default)]
pub struct PointBudget {
    expensive_failures: usize,
}

impl PointBudget {
    /// Solves a point.
    ///
    /// # Errors
    /// Those of the solver.
    pub fn solve(&mut self, solver: &mut dyn Solver, request: &Request<'_>) -> Result<Orbit, OrbitError> {
        let reduced = 0.1;
        let mut budget = Budget::points(if self.expensive_failures < 2 { 1.0 } else { reduced });
        let found = solver.solve(request, &mut budget);
        match &found {
            Ok(_) => self.expensive_failures = 0,
            Err(_) if budget.used() > reduced => self.expensive_failures += 1,
            Err(_) => {}
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails with the work that it is given.
    struct Failing(f64);

    impl Solver for Failing {
        fn solve(&mut self, request: &Request<'_>, budget: &mut Budget) -> Result<Orbit, OrbitError> {
            let limit = budget.remaining();
            budget.charge(self.0);
            Err(OrbitError::not_converged("failing", request.omega, 1, limit))
        }
    }

    /// Returns the budgets of four points whose searches fail with this work.
    fn budgets(work: f64) -> Vec<f64> {
        let (mut budget, mut solver) = (PointBudget::default(), Failing(work));
        let limit = |found: Result<Orbit, OrbitError>| match found {
            Err(OrbitError::NotConverged { residual, .. }) => residual,
            _ => panic!("the solver fails"),
        };
        (0..4).map(|_| limit(budget.solve(&mut solver, &Request::at(1.0)))).collect()
    }

    #[test]
    fn expensive_failures_reduce_the_budget_of_the_next_points() {
        assert_eq!(budgets(1.1), [1.0, 1.0, 0.1, 0.1]);
        assert_eq!(budgets(0.05), [1.0; 4]);
    }
}
