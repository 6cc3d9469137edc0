//! The traits of methods and solvers, and the row of the table of methods.

use super::{Budget, MethodError, MethodOption, Options, OrbitError};
use crate::model::System;
use crate::orbit::{Orbit, Seed};

/// A method: makes solvers that find the orbits of a system.
pub trait Method: Send + Sync + std::fmt::Debug {
    /// Returns the name in study files.
    fn name(&self) -> &'static str;
    /// Returns the method that finds the orbits of this system: this method, unless it picks
    /// another.
    fn choice(&self, _system: &System) -> Choice {
        Choice { method: self.name(), because: None }
    }
    /// Returns true if the method closes motions in time, so that their residual is a return
    /// defect. Harmonic balance returns false: its residual is not a return defect.
    fn closes_motions(&self, _system: &System) -> bool {
        true
    }
    /// Makes the solver for one system.
    ///
    /// [`solver_with_alternatives`](super::solver_with_alternatives) makes the same solver, with
    /// errors that name alternative methods.
    ///
    /// # Errors
    /// Returns [`MethodError`] if the method cannot take the system. The error names the joint
    /// or place and the missing property.
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError>;
}

/// The method that finds the orbits of a system.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Choice {
    /// Name of the method.
    pub method: &'static str,
    /// Reason for the choice; `None` if the user named the method.
    pub because: Option<String>,
}

impl std::fmt::Display for Choice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.because {
            Some(because) => write!(f, "{} ({because})", self.method),
            None => write!(f, "{}", self.method),
        }
    }
}

/// One orbit to find.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// Excitation frequency, rad/s, positive.
    pub omega: f64,
    /// A neighbouring orbit, from which the search begins. Without one, the method makes its own
    /// initial guess.
    pub seed: Option<&'a Seed>,
    /// States if an error estimate that costs extra is needed.
    pub estimate: ErrorEstimate,
}

impl<'a> Request<'a> {
    /// Requests the orbit at a frequency (rad/s), with an error estimate.
    pub fn at(omega: f64) -> Self {
        Request { omega, seed: None, estimate: ErrorEstimate::Required }
    }

    /// Begins the search from a neighbouring orbit, if there is one.
    pub fn near(self, seed: Option<&'a Seed>) -> Self {
        Request { seed, ..self }
    }

    /// Skips the error estimate, and the check by a time integration of an orbit that another
    /// method found: for searches between orbits with known errors, and for fits, which compare
    /// thousands of orbits with measured values.
    pub fn without_estimate(self) -> Self {
        Request { estimate: ErrorEstimate::Skipped, ..self }
    }
}

/// Need for an error estimate that costs extra.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorEstimate {
    /// Every orbit gets an error estimate, if the method has one.
    Required,
    /// The orbit may have no error estimate, no stability and no return defect.
    Skipped,
}

/// Finds orbits of one system.
pub trait Solver {
    /// Finds one orbit and charges the work to the budget.
    ///
    /// The evidence of the orbit names the algorithm that found it
    /// ([`Evidence::found_by`](crate::orbit::Evidence::found_by)), and [`Orbit::seed`] begins the
    /// next search.
    ///
    /// # Errors
    /// Returns [`OrbitError`] if the solver finds no orbit within the budget. The error says how
    /// far the solver got and what to try. A motion that did not converge is never returned as an
    /// orbit.
    fn solve(&mut self, request: &Request<'_>, budget: &mut Budget) -> Result<Orbit, OrbitError>;

    /// Finds the orbit at the excitation frequency `omega` (rad/s, positive), without a seed and
    /// within the budget of one orbit.
    ///
    /// # Errors
    /// Same as [`Solver::solve`].
    fn orbit(&mut self, omega: f64) -> Result<Orbit, OrbitError> {
        self.solve(&Request::at(omega), &mut Budget::default())
    }

    /// Finds the orbit at the excitation frequency `omega` (rad/s, positive) near another orbit,
    /// if there is one, within the budget of one orbit.
    ///
    /// # Errors
    /// Same as [`Solver::solve`].
    fn orbit_near(&mut self, omega: f64, seed: Option<&Seed>) -> Result<Orbit, OrbitError> {
        self.solve(&Request { seed, ..Request::at(omega) }, &mut Budget::default())
    }
}

/// A row of the table of methods.
#[derive(Debug, Clone, Copy)]
pub struct MethodInfo {
    /// Name in study files.
    pub name: &'static str,
    /// One line that describes the method.
    pub summary: &'static str,
    /// Options of the method, all optional.
    pub options: &'static [MethodOption],
    /// Builds the method from its options.
    pub build: fn(&Options) -> Result<Box<dyn Method>, MethodError>,
}
