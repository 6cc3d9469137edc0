//! The traits of methods and solvers, and the row of the table of methods.

use super::{MethodError, MethodOption, Options, OrbitError};
use crate::model::System;
use crate::orbit::Orbit;

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

/// Finds orbits of one system.
pub trait Solver {
    /// Finds the orbit at the excitation frequency `omega` (rad/s, positive).
    ///
    /// `start` is the warm start: the state of a neighbouring orbit.
    ///
    /// # Errors
    /// Returns [`OrbitError`] if the solver finds no orbit. The error says how far the solver
    /// got and what to try. A motion that did not converge is never returned as an orbit.
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError>;

    /// Finds the same orbit, but skips an error estimate that costs extra.
    ///
    /// Use it for searches between orbits with known errors.
    ///
    /// # Errors
    /// Same as [`Solver::orbit`].
    fn orbit_without_estimate(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.orbit(omega, start)
    }

    /// Returns the work of the last search as a fraction of the work limit of one point.
    ///
    /// Methods that do not count work return zero. A search through many orbits stops by this
    /// number, not by the clock, so its result does not depend on the machine.
    fn work_fraction(&self) -> f64 {
        0.0
    }

    /// Announces that the next searches continue along the branch of the orbit with the state
    /// `start` at the frequency `omega` (rad/s).
    fn begin_branch(&mut self, _omega: f64, _start: &[f64]) {}
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
