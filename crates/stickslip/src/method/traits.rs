//! What a method is and what its solvers do, and how a table knows them.

use super::{MethodError, MethodOption, Options, OrbitError};
use crate::model::System;
use crate::orbit::Orbit;

/// Turns systems into orbits.
pub trait Method: Send + Sync + std::fmt::Debug {
    /// Name in study files.
    fn name(&self) -> &'static str;
    /// What finds the orbits of this system: the method itself, unless it picks another one.
    fn choice(&self, _system: &System) -> Choice {
        Choice { method: self.name(), because: None }
    }
    /// Whether its orbits of this system are motions in time that were closed: their residual then is their return defect. A series is none.
    fn closes_motions(&self, _system: &System) -> bool {
        true
    }
    /// Its solver for one system. [`advised`](super::advised) gives the same with errors that say what to use instead.
    ///
    /// # Errors
    /// The system is none that this method can take: [`MethodError`] names the joint or place, and what the method misses.
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError>;
}

/// The method that finds the orbits of a system.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Choice {
    /// Its name.
    pub method: &'static str,
    /// Why it was picked, if it was.
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
    /// The orbit at drive frequency `omega` (rad/s, positive), from the state `start` of a neighbouring orbit if given.
    ///
    /// # Errors
    /// No orbit was found: [`OrbitError`] says how far the method got and what to try. A motion that did not converge is never
    /// returned as an orbit.
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError>;

    /// The same orbit without an estimate of its error, where that costs extra: for searches between orbits whose errors are known.
    ///
    /// # Errors
    /// As [`Solver::orbit`].
    fn between(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        self.orbit(omega, start)
    }

    /// The work of the last search as a share of what one point may take, of methods that count it: a way of many searches ends by it, and not by the
    /// clock.
    fn effort(&self) -> f64 {
        0.0
    }

    /// Says at which frequency (rad/s) the state `start` is an orbit from which others will be sought, to whoever goes on along its branch.
    fn begin_at(&mut self, _omega: f64, _start: &[f64]) {}
}

/// A row of the table of methods.
#[derive(Debug, Clone, Copy)]
pub struct MethodInfo {
    /// Name in study files.
    pub name: &'static str,
    /// One line of what it is.
    pub summary: &'static str,
    /// Its options, all optional.
    pub options: &'static [MethodOption],
    /// Builds the method from its options.
    pub build: fn(&Options) -> Result<Box<dyn Method>, MethodError>,
}
