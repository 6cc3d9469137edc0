//! Harmonic balance: the orbit as a Fourier series, friction sampled over the period.
//!
//! - `ports`: from the harmonics of relative motions to those of the laws' forces, with the exact derivative;
//! - `rest`: the receptance of the linear rest, in closed form from its modes;
//! - `closed`: the mean of bodies that nothing but contacts holds;
//! - `equations`: those along the joints, and their derivative;
//! - `linear`: their derivative as a matrix; `coupled`: steps by its products;
//! - `solve`: Newton's method on them; `estimate`: the error by a finer solution; `sampling`: what samples leave out; `interior`: all rigid joints at once;
//!   `proximal`: the way to forces that nothing decides;
//! - `path`: the orbit's numbers from its harmonics.
//!
//! The unknowns are the harmonics of the joints' relative motions, or of their forces where the velocity alone decides them: the cost
//! follows joints and harmonics, not degrees of freedom. Only multiples of the excitation's common divisor occur, and only the odd ones if
//! it has no others. The error of a solution is estimated from a second one with twice the harmonics.
//! Source: Krack and Gross, "Harmonic Balance for Nonlinear Vibration Problems" (2019); Cameron and Griffin (1989).

mod arc;
mod balance;
mod branch;
mod budget;
mod closed;
mod clusters;
mod coupled;
mod ease;
mod equations;
mod estimate;
mod hold;
mod in_time;
mod interior;
mod kept;
mod length;
mod linear;
mod modal;
mod mode;
mod open;
mod path;
mod ports;
mod proximal;
mod recent;
mod receptance;
mod rest;
mod sampling;
mod solve;
mod sparse;
mod storage;
mod subharmonic;
mod uncoupled;
mod waves;
mod window;
mod work;

use super::{Method, MethodError, MethodInfo, MethodOption, Options, PERIOD, Solver, periods};
use crate::dimension::Dimension;
use crate::model::System;
pub(crate) use arc::{ModeArc, Step as ModeStep};
use balance::Balance;
pub(crate) use branch::BranchEquations;
pub(crate) use mode::{LinearMode, ModeEquations, ModeState};
use ports::{Port, Ports};
use sampling::{samples_for, samples_of_steps};
pub use subharmonic::Subharmonic;
pub use work::{doubling_work, factor_bytes, most_work, orbit_work, step_work};

/// Its name in study files.
pub const NAME: &str = "harmonic-balance";

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "Fourier series along the joints, friction sampled over the period, with an error estimate",
    options: &[
        MethodOption {
            key: "harmonics",
            dimension: Dimension::NONE,
            count: true,
            doc: "highest harmonic; absent: doubled until the estimated error is below `tolerance`",
        },
        MethodOption {
            key: "samples",
            dimension: Dimension::NONE,
            count: true,
            doc: "samples per period, even, at least 4 (harmonics + 1), and 16 per harmonic if `harmonics` is absent; absent: 16 per \
                  harmonic, at least 1024, and 128 per harmonic for steep laws and for friction in a plane; fewer for laws in steps, such as contacts \
                  that part, where `tolerance` is above 0.001",
        },
        MethodOption {
            key: "tolerance",
            dimension: Dimension::NONE,
            count: false,
            doc: "error of the motion relative to the largest amplitude: aimed at when `harmonics` is absent, and beyond it a \
                  point is `truncated`; 0.001",
        },
        PERIOD,
    ],
    build: |options| {
        let balance = HarmonicBalance::from_options(options)?;
        Ok(match periods(NAME, options)? {
            1 => Box::new(balance),
            period => Box::new(Subharmonic { balance, period }),
        })
    },
};

/// Tolerance when none is given.
const TOLERANCE: f64 = 1e-3;
/// First number of harmonics when none is given.
const FIRST: usize = 7;
/// Samples per period, at least, and per harmonic. Sliders and stops need them to tell turning points apart only; laws with a memory
/// need as many as [`samples_for`] the tolerance.
const SAMPLES: usize = 1024;
const SAMPLES_PER_HARMONIC: usize = 16;
/// The same for laws that are steep or turn in a plane, whose samples place a change of sign to a sample only: they then grow with the
/// harmonics, so that the longer series sees what the samples of the shorter one missed.
const SAMPLES_OF_STEEP: usize = 128;

/// Harmonic balance.
///
/// # Example
/// ```
/// use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
/// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
/// let method = HarmonicBalance { harmonics: Some(15), ..HarmonicBalance::default() };
/// let orbit = method.solver(&system).unwrap().orbit(std::f64::consts::TAU * 121.0, None).unwrap();
/// assert!(orbit.evidence.truncation.unwrap() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HarmonicBalance {
    /// Highest harmonic; chosen by the estimated error if absent.
    pub harmonics: Option<usize>,
    /// Samples per period; chosen if absent.
    pub samples: Option<usize>,
    /// Error relative to the largest amplitude: aimed at when `harmonics` is absent; an orbit beyond it is [`Accuracy::Truncated`].
    ///
    /// [`Accuracy::Truncated`]: crate::orbit::Accuracy::Truncated
    pub tolerance: Option<f64>,
}

impl HarmonicBalance {
    fn from_options(options: &Options) -> Result<Self, MethodError> {
        let count = |key: &str| options.get(key).map(|value| *value as usize);
        let method = HarmonicBalance {
            harmonics: count("harmonics"),
            samples: count("samples"),
            tolerance: options.get("tolerance").copied(),
        };
        method.check(0)?;
        Ok(method)
    }

    /// Whether it has a port for every law of a system.
    pub(crate) fn takes_laws(system: &System) -> bool {
        Ports::new(system).is_ok()
    }

    /// Samples at a number of harmonics: what the user gave holds for the user's harmonics; the solution that checks it takes as many as
    /// it needs, so that too few are seen in the estimate. `steep`: see [`Ports::has_steep`] and [`Level::jumps`](equations::Level::jumps).
    fn samples_at(&self, top: usize, ports: &Ports, steep: bool) -> usize {
        let each = if steep { SAMPLES_OF_STEEP } else { SAMPLES_PER_HARMONIC };
        let remembered = ports.iter().any(Port::marches);
        let tolerance = self.tolerance.unwrap_or(TOLERANCE);
        let steps = !ports.is_empty() && ports.iter().all(Port::steps);
        let (few, least) = match remembered {
            true if steps => (samples_of_steps(tolerance), 0),
            true => (samples_for(tolerance), SAMPLES),
            false => (0, SAMPLES),
        };
        let needed = (each * (top + 1)).max(few).next_power_of_two();
        match (self.samples, self.harmonics) {
            (Some(samples), Some(harmonics)) if top <= harmonics => samples,
            (Some(samples), Some(_)) => samples.max(needed).max(least),
            (Some(samples), None) => samples.max(needed),
            (None, _) => needed.max(least),
        }
    }

    /// Whether the options fit each other and excitation up to harmonic `highest`.
    fn check(&self, highest: usize) -> Result<(), MethodError> {
        let option = |key, message| Err(MethodError::Option { method: NAME, key, message });
        if let Some(harmonics) = self.harmonics
            && (harmonics < highest.max(1) || harmonics > 10_000)
        {
            let least = highest.max(1);
            return option("harmonics", format!("must be {least} (the excitation's) to 10000, found {harmonics}"));
        }
        if let Some(samples) = self.samples {
            let least = 4 * (self.harmonics.unwrap_or(FIRST.max(highest)) + 1);
            if samples < least || samples % 2 == 1 {
                return option("samples", format!("must be even and at least {least}, found {samples}"));
            }
        }
        if let Some(tolerance) = self.tolerance
            && !(tolerance > 0.0 && tolerance < 1.0)
        {
            return option("tolerance", format!("must be between 0 and 1, found {tolerance}"));
        }
        Ok(())
    }
}

impl Method for HarmonicBalance {
    fn name(&self) -> &'static str {
        NAME
    }
    fn closes_motions(&self, _system: &System) -> bool {
        false
    }
    fn prepare<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        Ok(Box::new(Balance::new(system.clone(), *self, 1)?))
    }
}
