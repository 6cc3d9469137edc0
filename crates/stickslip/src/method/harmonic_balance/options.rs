//! Options of harmonic balance: number of harmonics, number of samples, tolerance.

use super::aft::{Port, Ports};
use crate::method::{MethodError, Options};
use crate::model::System;

/// Name of the method in study files.
pub const NAME: &str = "harmonic-balance";

/// Default tolerance.
pub(super) const TOLERANCE: f64 = 1e-3;
/// Highest harmonic of the first series if the user gives none.
pub(super) const FIRST_HARMONICS: usize = 7;
/// Least number of samples per period. Sliders and stops need samples only to separate turning
/// points. Laws with memory need [`samples_for`] the tolerance.
const SAMPLES: usize = 1024;
/// Least number of samples per harmonic.
const SAMPLES_PER_HARMONIC: usize = 16;
/// Least number of samples per harmonic for laws that are steep or act in a plane. Their
/// samples resolve a change of sign only to one sample spacing. The number grows with the
/// harmonics, so that the longer series detects the sampling error of the shorter one.
const SAMPLES_OF_STEEP: usize = 128;
/// Relative error of the motion that laws with memory showed at [`SAMPLING_ERROR_SAMPLES`]
/// samples. Measured on hysteresis in a plane and on contacts that open. The number of samples
/// grows with the tolerance from there, and the error estimate includes the rest.
const SAMPLING_ERROR: f64 = 2e-5;
/// Number of samples to which [`SAMPLING_ERROR`] belongs.
const SAMPLING_ERROR_SAMPLES: f64 = 1024.0;
/// Largest number of samples that a tolerance asks for.
const MOST_SAMPLES: f64 = 65536.0;
/// Share of the tolerance that the sampling error of laws with a step may use. The truncation
/// error hides an error of this size.
pub(super) const SAMPLING_SHARE: f64 = 0.05;

/// Harmonic balance: the orbit as a Fourier series.
///
/// # Example
/// ```
/// use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
/// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
/// let method = HarmonicBalance { harmonics: Some(15), ..HarmonicBalance::default() };
/// let orbit = method.solver(&system).unwrap().orbit(std::f64::consts::TAU * 121.0).unwrap();
/// assert!(orbit.evidence.error_estimate.unwrap() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HarmonicBalance {
    /// Highest harmonic. If absent, the method chooses it by the estimated error.
    pub harmonics: Option<usize>,
    /// Samples per period. If absent, the method chooses the number.
    pub samples: Option<usize>,
    /// Error relative to the largest amplitude. If `harmonics` is absent, the method doubles
    /// the harmonics until the estimated error is below it. An orbit above it is
    /// [`Accuracy::Truncated`].
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

    /// Returns true if the method has a port for every law of the system.
    pub(crate) fn takes_laws(system: &System) -> bool {
        Ports::new(system).is_ok()
    }

    /// Returns the number of samples for a series up to harmonic `top`.
    ///
    /// The user's number of samples applies to the user's number of harmonics. The finer
    /// solution that checks the error takes as many samples as it needs, so that its estimate
    /// shows if the user's number is too small. For `steep`, see [`Ports::has_steep`] and
    /// `Discretization::states_cross_within_sample`.
    pub(super) fn samples_at(&self, top: usize, ports: &Ports, steep: bool) -> usize {
        let each = if steep { SAMPLES_OF_STEEP } else { SAMPLES_PER_HARMONIC };
        let remembered = ports.iter().any(Port::has_memory_steps);
        let tolerance = self.tolerance.unwrap_or(TOLERANCE);
        let steps = !ports.is_empty() && ports.iter().all(Port::uses_return_map);
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

    /// Checks that the options fit each other and an excitation up to harmonic `highest`.
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
            let least = 4 * (self.harmonics.unwrap_or(FIRST_HARMONICS.max(highest)) + 1);
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

/// Returns the samples per period that laws with memory need for a relative error of the
/// motion.
pub(super) fn samples_for(tolerance: f64) -> usize {
    (SAMPLING_ERROR_SAMPLES * (SAMPLING_ERROR / tolerance).sqrt().max(1.0)).min(MOST_SAMPLES) as usize
}

/// Returns the same number for laws with a step only. These are exact along a straight path of
/// any length, so a larger tolerance needs fewer samples.
pub(super) fn samples_of_steps(tolerance: f64) -> usize {
    let fewer = (SAMPLING_ERROR / (SAMPLING_SHARE * tolerance)).sqrt().min(1.0);
    (samples_for(tolerance) as f64 * fewer) as usize
}
