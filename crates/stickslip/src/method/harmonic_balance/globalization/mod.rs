//! The solution of a point: Newton's method, then the searches of one table.
//!
//! Newton's method begins at an initial guess or a warm start. If it fails, the rows of
//! [`FALLBACKS`] follow in their order. Each receives the same initial guess; the slip-limit
//! homotopy ignores it. If all of them fail, the solver lets the vibration grow
//! (`growing_vibration`), and at last begins from a time integration (`time_start`). These two are
//! no rows of the table, because they search several times.
//!
//! To add a search: its file and `mod` line, one row of [`FALLBACKS`], and a variant of [`FoundBy`]
//! with its name, which [`Evidence::found_by`](crate::orbit::Evidence::found_by) and the book's
//! page on harmonic balance list. Quick and general searches come first. The work limit of a point
//! ([`WorkSettings`](super::settings::WorkSettings)) covers all of them together.
//!
//! - `interior_point`: interior point method for rigid friction
//! - `proximal_point`: proximal point method for forces that the equations leave undetermined
//! - `slip_limit_homotopy`: homotopy in the slip limits
//! - `time_start`: initial guesses from time integration
//! - `growing_vibration`: search with a vibration that grows slowly from static equilibrium

mod growing_vibration;
pub(super) mod interior_point;
pub(super) mod proximal_point;
mod slip_limit_homotopy;
pub(super) mod time_start;

use super::aft::Ports;
use super::equations::homotopy::SearchContext;
use super::equations::{Discretization, HarmonicSolution};
use super::found_by::FoundBy;
use super::newton::{SolveError, StopCriterion};
use super::settings::NewtonSettings;

/// A search that follows if Newton's method fails.
struct Fallback {
    found_by: FoundBy,
    /// True if the search can help with these ports.
    applies: fn(&Ports) -> bool,
    /// False if the search ignores the initial guess. It then does not follow a guess from an
    /// adjacent orbit, from a growing vibration or from a time integration: it was tried before, or
    /// the point can be omitted.
    uses_guess: bool,
    /// Replaces the initial guess in the last argument by a solution of the given equations:
    /// motion, force and residual. Adds its iterations to those of the guess; if it fails, only
    /// these are used. It ends when [`Discretization::is_budget_used`], and restores everything
    /// else that it changes in the discretization.
    ///
    /// [`Discretization::begin_search`] forgets the states of laws with memory and begins the
    /// budget of another search. Without it, a search continues both.
    search: fn(&mut Discretization, &Ports, f64, &mut HarmonicSolution) -> Result<(), SolveError>,
}

/// The searches that follow Newton's method, in the order in which they are tried.
const FALLBACKS: &[Fallback] = &[
    Fallback {
        found_by: FoundBy::InteriorPoints,
        applies: Ports::has_forces,
        uses_guess: true,
        search: Discretization::interior_point_method,
    },
    Fallback {
        found_by: FoundBy::ProximalPoints,
        applies: Ports::has_forces,
        uses_guess: true,
        search: Discretization::proximal_point_method,
    },
    Fallback {
        found_by: FoundBy::SlipLimitHomotopy,
        applies: |_| true,
        uses_guess: false,
        search: Discretization::slip_limit_homotopy,
    },
];

/// Settings of a search for the solution near an initial guess.
#[derive(Debug, Clone, Copy)]
pub(super) struct SearchSettings {
    /// Largest number of Newton iterations. Default 60; 3 to 15 are usual.
    pub iterations: usize,
    /// Largest number of iterations that do not halve the residual. With forces as unknowns, the
    /// number of [`NewtonSettings`] applies.
    pub patience: usize,
    /// Residual at which Newton's method ends. The fallbacks ignore it.
    pub goal: StopCriterion,
    /// True for an orbit between known ones. Only fallbacks that use the guess follow.
    pub between_orbits: bool,
}

impl Default for SearchSettings {
    fn default() -> Self {
        SearchSettings {
            iterations: NewtonSettings::default().iterations,
            patience: NewtonSettings::default().iterations,
            goal: StopCriterion::Solved,
            between_orbits: false,
        }
    }
}

impl Discretization {
    /// Solves from the initial guess `start`, with the default settings.
    pub fn solve(
        &mut self,
        ports: &Ports,
        omega: f64,
        start: HarmonicSolution,
    ) -> Result<HarmonicSolution, SolveError> {
        self.solve_with(ports, omega, start, SearchSettings::default())
    }

    /// Solves from the initial guess `start`.
    pub fn solve_with(
        &mut self,
        ports: &Ports,
        omega: f64,
        start: HarmonicSolution,
        settings: SearchSettings,
    ) -> Result<HarmonicSolution, SolveError> {
        let begin = HarmonicSolution { iterations: 0, ..start };
        let mut motion = begin.clone();
        self.begin_search(ports);
        let newton = self.newton(SearchContext::given(ports, omega), &mut motion, settings);
        let mut failure = match self.supported(newton, &motion) {
            Ok(()) => return Ok(motion),
            Err(failure) => failure,
        };
        let near =
            settings.between_orbits || matches!(begin.found_by, FoundBy::GrowingVibration | FoundBy::TimeIntegration);
        let follows = |fallback: &&Fallback| (fallback.applies)(ports) && (fallback.uses_guess || !near);
        for fallback in FALLBACKS.iter().filter(follows) {
            motion = HarmonicSolution { iterations: motion.iterations, ..begin.clone() };
            let found = (fallback.search)(self, ports, omega, &mut motion);
            match self.supported(found, &motion) {
                Ok(()) => return Ok(HarmonicSolution { found_by: fallback.found_by, ..motion }),
                Err(other) => failure = failure.and(other),
            }
        }
        Err(failure)
    }

    /// Converts a solution whose mean left the contacts that alone support a body to a failure.
    fn supported(&self, found: Result<(), SolveError>, motion: &HarmonicSolution) -> Result<(), SolveError> {
        match found {
            Ok(()) if self.left_contacts(motion) => {
                Err(SolveError { left_contacts: true, ..SolveError::not_converged(motion.iterations, motion.residual) })
            }
            found => found,
        }
    }
}
