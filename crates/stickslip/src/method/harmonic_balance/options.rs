//! What a user may ask of a series: its length, its samples, its error.

use super::ports::{Port, Ports};
use crate::method::{MethodError, Options};
use crate::model::System;

/// Its name in study files.
pub const NAME: &str = "harmonic-balance";

/// Tolerance when none is given.
pub(super) const TOLERANCE: f64 = 1e-3;
/// First number of harmonics when none is given.
pub(super) const FIRST: usize = 7;
/// Samples per period, at least, and per harmonic. Sliders and stops need them to tell turning points apart only; laws with a memory
/// need as many as [`samples_for`] the tolerance.
const SAMPLES: usize = 1024;
const SAMPLES_PER_HARMONIC: usize = 16;
/// The same for laws that are steep or turn in a plane, whose samples place a change of sign to a sample only: they then grow with the
/// harmonics, so that the longer series sees what the samples of the shorter one missed.
const SAMPLES_OF_STEEP: usize = 128;
/// Error of a motion by 1024 samples, relative, that laws with a memory were seen to have (hysteresis in a plane, contacts that part): as many more are
/// taken as the tolerance asks for, and the estimate says whether they were enough.
const SEEN: f64 = 2e-5;
/// Samples from which that is reckoned, and at most as many.
const AT: f64 = 1024.0;
const MOST: f64 = 65536.0;
/// The share of the tolerance that they are to leave, where fewer than that do: beside the harmonics that are missing it is not seen.
pub(super) const LEFT: f64 = 0.05;

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
    pub(super) fn from_options(options: &Options) -> Result<Self, MethodError> {
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
    pub(super) fn samples_at(&self, top: usize, ports: &Ports, steep: bool) -> usize {
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
    pub(super) fn check(&self, highest: usize) -> Result<(), MethodError> {
        let option = |key, message| Err(MethodError::option(NAME, key, message));
        if let Some(harmonics) = self.harmonics
            && (harmonics < highest.max(1) || harmonics > 10_000)
        {
            let least = highest.max(1);
            return option(
                "harmonics",
                format!("must be from {least} (the highest harmonic of the excitation) to 10000, found {harmonics}"),
            );
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

/// Samples per period that laws with a memory need for an error of the motion, relative.
pub(super) fn samples_for(tolerance: f64) -> usize {
    (AT * (SEEN / tolerance).sqrt().max(1.0)).min(MOST) as usize
}

/// The same of laws in steps, which are exact on a straight way however long it is: fewer where the tolerance is larger.
pub(super) fn samples_of_steps(tolerance: f64) -> usize {
    let fewer = (SEEN / (LEFT * tolerance)).sqrt().min(1.0);
    (samples_for(tolerance) as f64 * fewer) as usize
}
