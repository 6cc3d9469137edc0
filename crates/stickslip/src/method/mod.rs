//! Methods: from a system and a drive frequency to an orbit.
//!
//! A method is named with options in a study file; [`TABLE`] lists them. To add one: write its file, then one line in [`TABLE`].
//! Of a [`Method`], [`Method::solver`] makes a [`Solver`] for one system, which keeps what can be reused from orbit to orbit.

mod assembly;
pub mod auto;
mod course;
mod drive;
pub mod event_driven;
mod evidence;
mod exact_flow;
mod flow;
mod followed;
mod guess;
pub mod harmonic_balance;
mod incremental;
mod periodic;
mod relaxed;
mod repeated;
pub mod shooting;
mod smooth;
mod stepped;
pub mod time_history;
pub mod transient;
mod vibration;
mod ways;

use crate::dimension::Dimension;
use crate::model::{System, SystemJoint};
use crate::orbit::Orbit;
pub use crate::orbit::{Breakdown, OrbitError};
use crate::structure::MOST_IN_FULL;
pub use evidence::evidence_steps;
use std::collections::BTreeMap;
use ways::Advised;
pub use ways::Ways;

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
    /// The system is none that this method can take: [`MethodError`] names the joint or place, and what the method misses.
    fn prepare<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError>;
    /// The same for who is to be told what to use instead, also where no orbit is found.
    ///
    /// # Errors
    /// As [`Method::prepare`], with the methods that take the system.
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let solver = self.prepare(system).map_err(|error| error.with_ways(system))?;
        Ok(Box::new(Advised { solver, system }))
    }
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

    /// Says at which frequency (rad/s) the state `start` is an orbit from which others will be sought, to whoever goes on along its branch.
    fn begin_at(&mut self, _omega: f64, _start: &[f64]) {}
}

/// A method cannot take a system.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MethodError {
    /// A law lacks the view that the method needs.
    #[error("{method} cannot take the law `{law}` of joint `{joint}`: {misses}{}", .ways.behind())]
    Law {
        /// The method.
        method: &'static str,
        /// The joint.
        joint: String,
        /// Its law.
        law: &'static str,
        /// What the method misses in it.
        misses: &'static str,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// A place has no mass.
    #[error("{method} needs a mass above zero at `{place}` (the law `jenkins` stands for a spring, a massless place and a slider){}", .ways.behind())]
    NeedsMass {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// A place that has nothing but joints.
    #[error(
        "{method} needs a mass, a spring or a damper at `{place}`: nothing else says how it moves between its joints; of joints in series make one, as \
         of two `jenkins`, which have the smaller limit and the springs of both in series{}", .ways.behind()
    )]
    Empty {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// A place so light between rigid joints that its inertia is lost.
    #[error(
        "{method} loses the inertia of `{place}`, which is {ratio:.0e} times lighter than what it rubs on at joint `{joint}` and rubs on something else, \
         too: of rigid joints in series the weaker one slips, so leave the other and the place out, or give it {least:.0e} of that mass{}", .ways.behind()
    )]
    Light {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
        /// The joint.
        joint: String,
        /// The other mass by its own.
        ratio: f64,
        /// The share of the other mass that is enough.
        least: f64,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// More degrees of freedom than the method's full matrices may have.
    #[error("{method} carries full matrices over at most {most} places, and there are {dofs}{}", .ways.behind())]
    TooLarge {
        /// The method.
        method: &'static str,
        /// Degrees of freedom of the system.
        dofs: usize,
        /// Most that the method takes.
        most: usize,
        /// What to use instead.
        ways: Box<Ways>,
    },
    /// A matrix is not positive definite.
    #[error("{method} needs a positive definite {matrix} matrix{}", .ways.behind())]
    NotPositive {
        /// The method.
        method: &'static str,
        /// Which matrix.
        matrix: &'static str,
        /// What to use instead.
        ways: Box<Ways>,
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

impl MethodError {
    /// `method` misses something in the law of a joint.
    pub fn law(method: &'static str, joint: &SystemJoint, misses: &'static str) -> Self {
        let (joint, law) = (joint.name().to_owned(), joint.law().name());
        MethodError::Law { method, joint, law, misses, ways: Box::default() }
    }

    /// `method` needs a mass where a system has none.
    pub(crate) fn needs_mass(method: &'static str, system: &System, place: usize) -> Self {
        MethodError::NeedsMass { method, place: system.structure().places()[place].clone(), ways: Box::default() }
    }

    /// `method` needs anything but joints at a place: whether a system has one without.
    pub(crate) fn empty(method: &'static str, system: &System) -> Option<Self> {
        let mut empty: Vec<bool> = (0..system.dofs()).map(|row| system.structure().own_mass(row) == 0.0).collect();
        if !empty.contains(&true) {
            return None; // what has mass is not looked through
        }
        system.structure().entries().for_each(|(row, _, _)| empty[row] = false);
        let place = system.structure().places()[empty.iter().position(|empty| *empty)?].clone();
        Some(MethodError::Empty { method, place, ways: Box::default() })
    }

    /// `method` carries full matrices: whether those of a system are too large for it.
    pub(crate) fn too_large(method: &'static str, system: &System) -> Option<Self> {
        let (dofs, most) = (system.dofs(), MOST_IN_FULL);
        (dofs > most).then(|| MethodError::TooLarge { method, dofs, most, ways: Box::default() })
    }

    /// `method` needs a positive definite mass matrix.
    pub(crate) fn mass_not_positive(method: &'static str) -> Self {
        MethodError::NotPositive { method, matrix: "mass", ways: Box::default() }
    }

    /// What to use instead; `None` where another value of an option is all that is needed.
    pub fn ways(&self) -> Option<&Ways> {
        match self {
            MethodError::Law { ways, .. }
            | MethodError::NeedsMass { ways, .. }
            | MethodError::Empty { ways, .. }
            | MethodError::Light { ways, .. }
            | MethodError::TooLarge { ways, .. }
            | MethodError::NotPositive { ways, .. } => Some(&**ways),
            MethodError::Option { .. } => None,
        }
    }

    /// The same refusal of this system, with the methods that take it.
    #[must_use]
    pub fn with_ways(self, system: &System) -> MethodError {
        self.with(Ways::of(system))
    }

    /// The same refusal, without what to use instead.
    #[must_use]
    pub fn alone(self) -> MethodError {
        self.with(Ways::default())
    }

    fn with(mut self, instead: Ways) -> MethodError {
        match &mut self {
            MethodError::Law { ways, .. }
            | MethodError::NeedsMass { ways, .. }
            | MethodError::Empty { ways, .. }
            | MethodError::Light { ways, .. }
            | MethodError::TooLarge { ways, .. }
            | MethodError::NotPositive { ways, .. } => {
                **ways = instead;
            }
            MethodError::Option { .. } => {}
        }
        self
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

/// Most periods of the drive that one of the motion may take: more are another motion than one that repeats.
const MOST_PERIODS: f64 = 100.0;

/// The option [`PERIOD`] of a method.
fn periods(method: &'static str, options: &Options) -> Result<usize, MethodError> {
    let periods = options.get(PERIOD.key).copied().unwrap_or(1.0);
    if (1.0..=MOST_PERIODS).contains(&periods) {
        return Ok(periods as usize);
    }
    let message = format!("must lie between 1 and {MOST_PERIODS}, found {periods}");
    Err(MethodError::Option { method, key: PERIOD.key, message })
}

/// The key of the velocity over which exact laws are smoothed, of the methods that can do so.
pub const WIDTH: &str = "width";

/// The option [`WIDTH`] of a method, m/s.
fn width(method: &'static str, options: &Options) -> Result<Option<f64>, MethodError> {
    match options.get(WIDTH).copied() {
        Some(width) if !(width.is_finite() && width > 0.0) => {
            let message =
                format!("must be more than zero, found {width}; leave it out where laws are smooth by themselves");
            Err(MethodError::Option { method, key: WIDTH, message })
        }
        width => Ok(width),
    }
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
    &[auto::INFO, event_driven::INFO, transient::INFO, shooting::INFO, harmonic_balance::INFO];

/// The method with this name.
pub fn find(name: &str) -> Option<&'static MethodInfo> {
    TABLE.iter().find(|method| method.name == name)
}
