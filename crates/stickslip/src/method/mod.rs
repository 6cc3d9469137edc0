//! Methods: from a system and a drive frequency to an orbit.
//!
//! A method is named with options in a study file; [`TABLE`] lists them. To add one: write its file, then one line in [`TABLE`].
//! Of a [`Method`], [`Method::solver`] makes a [`Solver`] for one system, which keeps what can be reused from orbit to orbit.

mod assembly;
pub mod auto;
mod drive;
pub mod event_driven;
mod evidence;
mod exact_flow;
mod flow;
mod guess;
pub mod harmonic_balance;
mod incremental;
mod periodic;
pub mod settling;
pub mod shooting;
mod smooth;
mod stepped;
pub mod transient;

use crate::dimension::Dimension;
use crate::model::System;
use crate::orbit::Orbit;
use std::collections::BTreeMap;

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
    /// Prepares for one system.
    ///
    /// # Errors
    /// The system is none that this method can take: [`MethodError`] names the joint or place and what to use instead.
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
}

/// A method cannot take a system.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MethodError {
    /// A law lacks the view that the method needs.
    #[error("{method} cannot take the law `{law}` of joint `{joint}`; use {instead}")]
    Law {
        /// The method.
        method: &'static str,
        /// The joint.
        joint: String,
        /// Its law.
        law: &'static str,
        /// What to use instead.
        instead: &'static str,
    },
    /// A place has no mass.
    #[error("{method} needs a mass above zero at `{place}`; for a massless contact point use the law `jenkins`")]
    NeedsMass {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
    },
    /// A matrix is not positive definite.
    #[error("{method} needs a positive definite {matrix} matrix")]
    NotPositive {
        /// The method.
        method: &'static str,
        /// Which matrix.
        matrix: &'static str,
    },
    /// An option has an impossible value.
    #[error("option `{key}` of {method}: {message}")]
    Option {
        /// The method.
        method: &'static str,
        /// The key.
        key: &'static str,
        /// What is expected.
        message: String,
    },
}

/// Why a motion could not be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Breakdown {
    /// Too many switches.
    #[error("joint {joint} chatters at t = {time:.6e} s after {switches} switches", joint = joint + 1)]
    Chatter {
        /// When, s.
        time: f64,
        /// Switches until then.
        switches: usize,
        /// Index of the joint.
        joint: usize,
    },
    /// Rigid joints that form a loop stick together, and how they share the load is not unique.
    #[error(
        "joint {joint} and others stick in a loop of rigid contacts whose forces are not unique at t = {time:.6e} s; \
         give one of them a stiffness (law `jenkins`)", joint = joint + 1
    )]
    Redundant {
        /// When, s.
        time: f64,
        /// Index of one of the joints.
        joint: usize,
    },
    /// The contact problem has no solution.
    #[error("no stick-slip state is consistent at t = {time:.6e} s")]
    Undecidable {
        /// When, s.
        time: f64,
    },
    /// The linear motion of a pattern has no full set of modes.
    #[error(
        "two modes fall together at {lambda:.6e} rad/s (critical damping) at t = {time:.6e} s; change a damper slightly"
    )]
    Defective {
        /// When, s.
        time: f64,
        /// Modulus of the exponent, rad/s.
        lambda: f64,
    },
    /// The signals oscillate too fast for the period.
    #[error("modes far faster than the drive: no switch could be excluded within the allowed steps, t = {time:.6e} s")]
    TooFast {
        /// When, s.
        time: f64,
    },
    /// The step size of an integration became too small.
    #[error("the integration stalls at t = {time:.6e} s (step {step:.1e} s)")]
    Stalled {
        /// When, s.
        time: f64,
        /// The step, s.
        step: f64,
    },
    /// Equal steps, however short, do not reach the tolerance.
    #[error(
        "{steps} steps leave an estimated error of {estimate:.1e} where {tolerance:.1e} is wanted; \
         raise the tolerance, or soften what is far stiffer than the rest"
    )]
    Unresolved {
        /// Steps of the finest attempt.
        steps: usize,
        /// Its error relative to the motion, estimated.
        estimate: f64,
        /// The error that was allowed.
        tolerance: f64,
    },
    /// Numbers leave the range of floating point, or what they need to be solved with.
    #[error("masses, springs and dampers are too far apart to compute with at t = {time:.6e} s; check their units")]
    OutOfRange {
        /// When, s.
        time: f64,
    },
    /// A number is no longer finite.
    #[error("the motion grows beyond all bounds by t = {time:.6e} s")]
    Unbounded {
        /// When, s.
        time: f64,
    },
}

/// No orbit was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OrbitError {
    /// The iteration did not converge.
    #[error(
        "{method} stopped at Ω = {omega:.4} rad/s after {iterations} iterations, residual {residual:.1e}; \
         start from a neighbouring orbit, or check that a periodic motion exists (undamped resonance has none)"
    )]
    NotConverged {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// Iterations made.
        iterations: usize,
        /// Smallest residual reached.
        residual: f64,
    },
    /// The motion broke down.
    #[error("{method} broke down at Ω = {omega:.4} rad/s: {cause}")]
    Breakdown {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// The cause.
        cause: Breakdown,
    },
    /// The evidence contradicts the orbit.
    #[error("{method} closed an orbit at Ω = {omega:.4} rad/s that fails its check: energy gap {energy_gap:.1e}")]
    Evidence {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// The gap.
        energy_gap: f64,
    },
    /// The series that the method may take is too short for the tolerance.
    #[error(
        "{method} reaches an estimated error of {estimate:.1e} at Ω = {omega:.4} rad/s with {harmonics} harmonics, not {tolerance:.1e}; \
         raise `tolerance`, or use method `event-driven` (exact laws) or `shooting` (smooth ones)"
    )]
    Truncation {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// Highest harmonic tried.
        harmonics: usize,
        /// Error of the motion relative to its amplitude, estimated.
        estimate: f64,
        /// The error that was allowed.
        tolerance: f64,
    },
    /// Nothing holds the structure against the mean of the forces, or only friction does.
    #[error(
        "{method} finds no motion at Ω = {omega:.4} rad/s that stays where it is: nothing but friction holds the structure against \
         a mean force; add the spring that holds it (where friction is enough, method `event-driven` finds the motion)"
    )]
    Drift {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
    },
    /// A path that a method gave is no periodic motion.
    #[error("the motion of {method} at Ω = {omega:.4} rad/s {what}")]
    NotAnOrbit {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// What is wrong.
        what: &'static str,
    },
    /// The drive frequency is no positive finite number.
    #[error("the drive frequency must be positive and finite, found {omega} rad/s")]
    Frequency {
        /// What was given, rad/s.
        omega: f64,
    },
}

impl OrbitError {
    /// One word for tables.
    pub fn status(&self) -> &'static str {
        match self {
            OrbitError::NotConverged { .. } => "not-converged",
            OrbitError::Breakdown { .. } => "breakdown",
            OrbitError::Evidence { .. } => "evidence-fails",
            OrbitError::Truncation { .. } => "tolerance-not-reached",
            OrbitError::Drift { .. } => "drifts",
            OrbitError::NotAnOrbit { .. } => "not-an-orbit",
            OrbitError::Frequency { .. } => "bad-frequency",
        }
    }
}

/// An option of a method: a key in `[method]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodOption {
    /// Key in `[method]`.
    pub key: &'static str,
    /// Physical dimension.
    pub dimension: Dimension,
    /// Whether it is a count: a whole number from 1.
    pub count: bool,
    /// One line, with what happens when it is absent.
    pub doc: &'static str,
}

/// How many periods of the drive an orbit takes.
const PERIOD: MethodOption = MethodOption {
    key: "period",
    dimension: Dimension::NONE,
    count: true,
    doc: "periods of the drive after which the motion repeats; motions that repeat earlier are found too; 1 when absent",
};

/// The option [`PERIOD`].
fn periods(options: &Options) -> usize {
    options.get(PERIOD.key).map_or(1, |periods| *periods as usize)
}

/// Options of a method that were given, by key, SI.
pub type Options = BTreeMap<String, f64>;

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

/// Every method there is.
pub const TABLE: &[MethodInfo] =
    &[auto::INFO, event_driven::INFO, settling::INFO, shooting::INFO, harmonic_balance::INFO];

/// The method with this name.
pub fn find(name: &str) -> Option<&'static MethodInfo> {
    TABLE.iter().find(|method| method.name == name)
}
