//! A periodic motion, with the evidence for it.
//!
//! All methods return the same [`Orbit`]. Its numbers (amplitudes, energies, slip) are computed by the method that found it, in
//! closed form where it can; [`Orbit::sample`] gives the motion at any time.

mod error;
mod evidence;
pub(crate) mod measure;
mod motion;
mod path;
mod sampled;
mod stability;

pub use crate::law::Contact;
use crate::law::{Piece, SharedLaw, Slider};
use crate::model::System;
pub use error::{Breakdown, Course, OrbitError};
pub use evidence::{Accuracy, Evidence};
pub use motion::{Energy, JointMotion, PlaceMotion, Symmetry};
use nalgebra::DMatrix;
pub use path::{JointSample, Path, Sample};
pub use stability::Stability;
use std::fmt;
use std::sync::Arc;

/// A converged periodic motion of a system.
#[derive(Clone)]
pub struct Orbit {
    /// Name of the method that found it.
    pub method: &'static str,
    /// Drive frequency Ω, rad/s.
    pub omega: f64,
    /// Periods of the drive after which the motion repeats.
    pub periods: usize,
    /// Whether the orbit was found as one with `x(t + T/2) = -x(t)` or over the full period.
    pub symmetry: Symmetry,
    /// State at t = 0: displacements (m), velocities (m/s), then the states of the joints. A start for neighbouring orbits.
    pub start: Vec<f64>,
    /// One entry per degree of freedom.
    pub places: Vec<PlaceMotion>,
    /// One entry per joint.
    pub joints: Vec<JointMotion>,
    /// Work and losses per period, J.
    pub energy: Energy,
    /// Why the orbit may be trusted.
    pub evidence: Evidence,
    /// Derivative of the state after one return (half or full period by `symmetry`) with respect to the state at t = 0; 0 × 0 if the method
    /// had no need of it ([`Orbit::multipliers`] makes it then).
    pub return_map: DMatrix<f64>,
    /// No two motions of the system separate: [`crate::model::System::contracts`].
    pub(crate) contracts: bool,
    pub(crate) path: Arc<dyn Path>,
}

/// The laws of a system's joints.
pub(crate) fn laws(system: &System) -> impl Iterator<Item = &SharedLaw> {
    system.joints().iter().map(|joint| joint.law())
}

/// Names of joints whose past an orbit keeps: see [`Evidence::history`]. The laws are those by which the orbit was found.
pub(crate) fn history<'a>(
    laws: impl Iterator<Item = &'a SharedLaw>,
    joints: &[JointMotion],
    stuck: &[String],
    symmetry: Symmetry,
) -> Vec<String> {
    if symmetry == Symmetry::HalfPeriod {
        return Vec::new();
    }
    let holds = |law: &SharedLaw, motion: &JointMotion| {
        let travel = motion.displacement.first().map_or(0.0, |(low, high)| high - low);
        let sliders = law.pieces().into_iter().flatten().filter_map(|piece| match piece {
            Piece::Slider(Slider { stiffness: Some(stiffness), limit, .. }) => Some((stiffness, limit)),
            _ => None,
        });
        let mut reaches = sliders.filter(|(_, limit)| *limit > 0.0).map(|(stiffness, limit)| limit / stiffness);
        let inner = law.masing().is_some_and(|law| travel <= 2.0 * law.slips_at());
        stuck.contains(&motion.name) || inner || reaches.any(|reach| travel <= 2.0 * reach)
    };
    let kept = laws.zip(joints).filter(|(law, motion)| holds(law, motion));
    kept.map(|(_, motion)| motion.name.clone()).collect()
}

/// What a method says of an orbit beside its path.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Name of the method.
    pub method: &'static str,
    /// Drive frequency Ω, rad/s.
    pub omega: f64,
    /// Periods of the drive after which the motion repeats.
    pub periods: usize,
    /// Which return it was closed on.
    pub symmetry: Symmetry,
    /// State at t = 0: displacements (m), velocities (m/s), then the states of the joints.
    pub start: Vec<f64>,
    /// Residual of the method's equations, relative.
    pub residual: f64,
    /// Iterations of the method.
    pub iterations: usize,
    /// Estimated relative error of the amplitudes, if there is an estimate.
    pub truncation: Option<f64>,
    /// Whether that is as little as was asked for.
    pub accuracy: Accuracy,
}

/// Difference of displacements, relative to their size, and of velocities, relative to it times Ω, by which the ends of a period, or the start and
/// the path, may differ: a series of a few harmonics is no more accurate.
const CLOSES: f64 = 1e-3;
/// Difference, relative to the largest amplitude (velocities to it times Ω), below which two states of a motion are the same, and instants of the
/// period at which that is asked: methods in time close orbits to 1e-9, stiff contacts make of that 1e-7.
const REPEATS: f64 = 1e-6;
const REPEATED_AT: usize = 8;
/// How far before the end of the period it is looked at, as a share of it.
const BEFORE: f64 = 1e-9;
/// Energy gap above which a motion is no orbit of the system at all.
const LARGEST_GAP: f64 = 0.1;

impl Orbit {
    /// Makes an orbit of a path. All its numbers are measured from samples of the path, so that they are evidence about it.
    ///
    /// # Errors
    /// [`OrbitError::NotAnOrbit`] if the path does not fit the system, does not close, or does not begin at `start`;
    /// [`OrbitError::Evidence`] if its energies are out of balance by a tenth.
    ///
    /// # Example
    /// An oscillator without joints, whose motion is known.
    /// ```
    /// use nalgebra::dmatrix;
    /// use num_complex::Complex64;
    /// use std::sync::Arc;
    /// use stickslip::model::System;
    /// use stickslip::orbit::{Accuracy, Found, Orbit, Path, Sample, Symmetry};
    /// use stickslip::structure::Structure;
    ///
    /// struct Harmonic { x: Complex64, omega: f64 }
    ///
    /// impl Path for Harmonic {
    ///     fn sample(&self, time: f64) -> Sample {
    ///         let (x, s) = (self.x * Complex64::cis(self.omega * time), Complex64::new(0.0, self.omega));
    ///         let [displacement, velocity, acceleration] = [x, s * x, s * s * x].map(|z| vec![z.re]);
    ///         Sample { displacement, velocity, acceleration, joints: Vec::new(), moved: Vec::new() }
    ///     }
    ///     fn switch_times(&self) -> Vec<f64> {
    ///         Vec::new()
    ///     }
    /// }
    ///
    /// let structure = Structure::new(vec!["m".into()], dmatrix![1.0], dmatrix![0.1], dmatrix![4.0]).unwrap();
    /// let system = System::builder(structure).force(0, 1, Complex64::new(1.0, 0.0)).build().unwrap();
    /// let omega = 1.5;
    /// let x = 1.0 / Complex64::new(4.0 - omega * omega, 0.1 * omega);
    /// let found = |x: Complex64| Found {
    ///     method: "by hand", omega, periods: 1, symmetry: Symmetry::HalfPeriod,
    ///     start: vec![x.re, -omega * x.im], residual: 0.0, iterations: 1, truncation: None, accuracy: Accuracy::Converged,
    /// };
    /// let orbit = Orbit::new(&system, Arc::new(Harmonic { x, omega }), found(x)).unwrap();
    /// assert!((orbit.places[0].amplitude() - x.norm()).abs() < 1e-9);
    /// assert!(orbit.evidence.energy_gap < 1e-9);
    /// // a motion that is none of the system
    /// let wrong = Harmonic { x: 2.0 * x, omega };
    /// assert!(Orbit::new(&system, Arc::new(wrong), found(2.0 * x)).is_err());
    /// ```
    pub fn new(system: &System, path: Arc<dyn Path>, found: Found) -> Result<Orbit, OrbitError> {
        let Found { method, omega, periods, symmetry, start, residual, iterations, truncation, accuracy } = found;
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        let wrong = |what| OrbitError::NotAnOrbit { method, omega, what };
        let (n, period) = (system.dofs(), periods as f64 * std::f64::consts::TAU / omega);
        if periods == 0 {
            return Err(wrong("takes no period: `periods` counts from 1"));
        }
        if start.len() < 2 * n || !start.iter().all(|z| z.is_finite()) {
            return Err(wrong("has no start of displacements and velocities of all places"));
        }
        let sampled = sampled::Sampled::new(system, path.as_ref(), omega, period);
        if !sampled.fits() {
            return Err(wrong("has samples that do not fit the places and joints, or are not finite"));
        }
        let Ok(measured) = measure::measure(system, &sampled, omega, (Symmetry::FullPeriod, period));
        let size = measured.places.iter().map(|place| place.maximum.abs().max(place.minimum.abs())).fold(0.0, f64::max);
        let apart =
            |a: &[f64], sign: f64, b: &[f64]| a.iter().zip(b).any(|(a, b)| (a - sign * b).abs() > CLOSES * size);
        let rated = |sample: Sample| -> Vec<f64> {
            sample.displacement.into_iter().chain(sample.velocity.into_iter().map(|v| v / omega)).collect()
        };
        let begin = rated(path.sample(0.0));
        let stated: Vec<f64> = (0..2 * n).map(|i| if i < n { start[i] } else { start[i] / omega }).collect();
        if apart(&begin, 1.0, &stated) {
            return Err(wrong("does not begin at its start"));
        }
        if apart(&begin, 1.0, &rated(path.sample(period * (1.0 - BEFORE)))) {
            return Err(wrong("does not return to its start after its period"));
        }
        if symmetry == Symmetry::HalfPeriod && apart(&begin, -1.0, &rated(path.sample(0.5 * period))) {
            return Err(wrong("is not mirrored after half of its period"));
        }
        let energy_gap = measured.energy_gap(0.0);
        if energy_gap > LARGEST_GAP {
            return Err(OrbitError::Evidence { method, omega, energy_gap });
        }
        Ok(Orbit {
            method,
            omega,
            periods,
            symmetry,
            start,
            evidence: Evidence {
                residual,
                energy_gap,
                switches: measured.joints.iter().map(|joint| joint.switches).sum(),
                iterations,
                harmonics: None,
                truncation,
                accuracy,
                return_defect: None,
                history: history(laws(system), &measured.joints, &measured.stuck, symmetry),
                stuck: measured.stuck,
                history_spread: None,
                found_by: method,
                instead_of: None,
            },
            places: measured.places,
            joints: measured.joints,
            energy: measured.energy,
            return_map: DMatrix::zeros(0, 0),
            contracts: system.contracts(),
            path,
        })
    }

    /// Period of the motion: as many periods `2π/Ω` of the drive as [`Orbit::periods`] says, s.
    pub fn period(&self) -> f64 {
        self.periods as f64 * std::f64::consts::TAU / self.omega
    }

    /// Periods of the drive after which the motion really repeats: a search for motions of several periods also finds those of fewer. Of motions
    /// that differ by less than a millionth, it is one.
    pub fn repeats(&self) -> usize {
        let state = |time: f64| {
            let sample = self.sample(time);
            let velocities = sample.velocity.into_iter().map(|v| v / self.omega);
            sample.displacement.into_iter().chain(velocities).collect::<Vec<f64>>()
        };
        let size = self.places.iter().map(|place| place.size()).fold(0.0, f64::max);
        let drive = self.period() / self.periods as f64;
        let after = |periods: usize| {
            (0..REPEATED_AT).all(|i| {
                let time = self.period() * i as f64 / REPEATED_AT as f64;
                let (now, later) = (state(time), state(time + periods as f64 * drive));
                now.iter().zip(&later).all(|(now, later)| (now - later).abs() <= REPEATS * size)
            })
        };
        (1..self.periods)
            .filter(|periods| self.periods.is_multiple_of(*periods))
            .find(|p| after(*p))
            .unwrap_or(self.periods)
    }

    /// The state at any time (s).
    pub fn sample(&self, time: f64) -> Sample {
        self.path.sample(time.rem_euclid(self.period()))
    }

    /// Instants within `[0, T)` at which a joint switches, rising, s.
    pub fn switch_times(&self) -> Vec<f64> {
        self.path.switch_times()
    }

    /// The motion of a place by its name.
    pub fn place(&self, name: &str) -> Option<&PlaceMotion> {
        self.places.iter().find(|place| place.name == name)
    }

    /// A joint by its name.
    pub fn joint(&self, name: &str) -> Option<&JointMotion> {
        self.joints.iter().find(|joint| joint.name == name)
    }

    /// Whether a joint sticks for the whole period, so that the orbit is one of a continuum.
    pub fn is_one_of_many(&self) -> bool {
        !self.evidence.stuck.is_empty()
    }
}

impl fmt::Debug for Orbit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Orbit")
            .field("method", &self.method)
            .field("omega", &self.omega)
            .field("periods", &self.periods)
            .field("symmetry", &self.symmetry)
            .field("places", &self.places)
            .field("joints", &self.joints)
            .field("energy", &self.energy)
            .field("evidence", &self.evidence)
            .finish_non_exhaustive()
    }
}
