//! Orbits: periodic motions with their evidence.
//!
//! All methods return the same [`Orbit`]. The method that found the orbit computes its results
//! (amplitudes, energies, slip), in closed form if possible. [`Orbit::sample`] returns the
//! motion at any time.

mod error;
mod evidence;
mod motion;
mod path;
pub(crate) mod postprocess;
mod sampled_path;
mod seed;
mod stability;

pub use crate::law::Contact;
use crate::law::{IdealElement, SharedLaw, Slider};
use crate::model::System;
pub use error::{IntegrationError, ObservedMotion, OrbitError};
pub use evidence::{Accuracy, Evidence};
pub use motion::{Energy, JointMotion, PlaceMotion, Symmetry};
use nalgebra::DMatrix;
pub use path::{JointSample, Path, Sample};
pub(crate) use seed::JointSeries;
pub use seed::Seed;
pub use stability::Stability;
use std::fmt;
use std::sync::Arc;

/// A converged periodic motion of a system.
#[derive(Clone)]
pub struct Orbit {
    /// Name of the method that found it.
    pub method: &'static str,
    /// Excitation frequency Ω, rad/s.
    pub omega: f64,
    /// Number of excitation periods after which the motion repeats.
    pub periods: usize,
    /// The return that was closed: `x(t + T/2) = -x(t)`, or the full period.
    pub symmetry: Symmetry,
    /// State at t = 0: displacements (m), velocities (m/s), then the states of the joints. It
    /// serves as initial guess for neighbouring orbits.
    pub initial_state: Vec<f64>,
    /// One entry per place.
    pub places: Vec<PlaceMotion>,
    /// One entry per joint.
    pub joints: Vec<JointMotion>,
    /// Work and losses per period, J.
    pub energy: Energy,
    /// Evidence for the orbit.
    pub evidence: Evidence,
    /// Derivative of the state after one return (half or full period by `symmetry`) with respect
    /// to the state at t = 0. It is 0 × 0 if the method did not need it; [`Orbit::multipliers`]
    /// then computes it.
    pub return_map: DMatrix<f64>,
    /// No two motions of the system diverge: [`crate::model::System::is_incrementally_stable`].
    pub(crate) contracts: bool,
    pub(crate) path: Arc<dyn Path>,
    /// Series of the joints, if harmonic balance found the orbit.
    pub(crate) series: Option<Arc<JointSeries>>,
}

/// Returns the laws of a system's joints.
pub(crate) fn laws(system: &System) -> impl Iterator<Item = &SharedLaw> {
    system.joints().iter().map(|joint| joint.law())
}

/// Returns the names of joints whose history affects the orbit: see
/// [`Evidence::history_dependent`]. The laws are those that the method used.
pub(crate) fn history_dependent_joints<'a>(
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
        let sliders = law.ideal_elements().into_iter().flatten().filter_map(|piece| match piece {
            IdealElement::Slider(Slider { stiffness: Some(stiffness), limit, .. }) => Some((stiffness, limit)),
            _ => None,
        });
        let mut reaches = sliders.filter(|(_, limit)| *limit > 0.0).map(|(stiffness, limit)| limit / stiffness);
        let inner = law.masing().is_some_and(|law| travel <= 2.0 * law.slip_displacement());
        stuck.contains(&motion.name) || inner || reaches.any(|reach| travel <= 2.0 * reach)
    };
    let kept = laws.zip(joints).filter(|(law, motion)| holds(law, motion));
    kept.map(|(_, motion)| motion.name.clone()).collect()
}

/// Data that a method supplies with the path of an orbit.
#[derive(Debug, Clone, PartialEq)]
pub struct OrbitData {
    /// Name of the method.
    pub method: &'static str,
    /// Excitation frequency Ω, rad/s.
    pub omega: f64,
    /// Number of excitation periods after which the motion repeats.
    pub periods: usize,
    /// The return that was closed.
    pub symmetry: Symmetry,
    /// State at t = 0: displacements (m), velocities (m/s), then the states of the joints.
    pub initial_state: Vec<f64>,
    /// Relative residual of the method's equations.
    pub residual: f64,
    /// Iterations of the method.
    pub iterations: usize,
    /// Estimated relative error of the amplitudes, if available.
    pub error_estimate: Option<f64>,
    /// Comparison of that error with the tolerance.
    pub accuracy: Accuracy,
}

impl Orbit {
    /// Creates an orbit from a path. All results are computed from samples of the path, so they
    /// are independent evidence.
    ///
    /// # Errors
    /// [`OrbitError::NotAnOrbit`] if the path does not fit the system, does not close, or does
    /// not begin at `initial_state`; [`OrbitError::Evidence`] if its energy gap exceeds 0.1.
    ///
    /// # Example
    /// An oscillator without joints, with a known solution.
    /// ```
    /// use nalgebra::dmatrix;
    /// use num_complex::Complex64;
    /// use std::sync::Arc;
    /// use stickslip::model::System;
    /// use stickslip::orbit::{Accuracy, Orbit, OrbitData, Path, Sample, Symmetry};
    /// use stickslip::structure::Structure;
    ///
    /// struct Harmonic {
    ///     x: Complex64,
    ///     omega: f64,
    /// }
    ///
    /// impl Path for Harmonic {
    ///     fn sample(&self, time: f64) -> Sample {
    ///         let (x, s) =
    ///             (self.x * Complex64::cis(self.omega * time), Complex64::new(0.0, self.omega));
    ///         let [displacement, velocity, acceleration] =
    ///             [x, s * x, s * s * x].map(|z| vec![z.re]);
    ///         Sample {
    ///             displacement,
    ///             velocity,
    ///             acceleration,
    ///             joints: Vec::new(),
    ///             imposed: Vec::new(),
    ///         }
    ///     }
    ///     fn transition_times(&self) -> Vec<f64> {
    ///         Vec::new()
    ///     }
    /// }
    ///
    /// let structure =
    ///     Structure::new(vec!["m".into()], dmatrix![1.0], dmatrix![0.1], dmatrix![4.0]).unwrap();
    /// let system =
    ///     System::builder(structure).force(0, 1, Complex64::new(1.0, 0.0)).build().unwrap();
    /// let omega = 1.5;
    /// let x = 1.0 / Complex64::new(4.0 - omega * omega, 0.1 * omega);
    /// let found = |x: Complex64| OrbitData {
    ///     method: "by hand",
    ///     omega,
    ///     periods: 1,
    ///     symmetry: Symmetry::HalfPeriod,
    ///     initial_state: vec![x.re, -omega * x.im],
    ///     residual: 0.0,
    ///     iterations: 1,
    ///     error_estimate: None,
    ///     accuracy: Accuracy::Converged,
    /// };
    /// let orbit = Orbit::new(&system, Arc::new(Harmonic { x, omega }), found(x)).unwrap();
    /// assert!((orbit.places[0].amplitude() - x.norm()).abs() < 1e-9);
    /// assert!(orbit.evidence.energy_gap < 1e-9);
    /// // a motion that does not belong to the system
    /// let wrong = Harmonic { x: 2.0 * x, omega };
    /// assert!(Orbit::new(&system, Arc::new(wrong), found(2.0 * x)).is_err());
    /// ```
    pub fn new(system: &System, path: Arc<dyn Path>, found: OrbitData) -> Result<Orbit, OrbitError> {
        let OrbitData {
            method,
            omega,
            periods,
            symmetry,
            initial_state,
            residual,
            iterations,
            error_estimate,
            accuracy,
        } = found;
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        let wrong = |problem| OrbitError::NotAnOrbit { method, omega, problem };
        let (n, period) = (system.dofs(), periods as f64 * std::f64::consts::TAU / omega);
        if periods == 0 {
            return Err(wrong("has `periods` = 0; `periods` must be at least 1"));
        }
        if initial_state.len() < 2 * n || !initial_state.iter().all(|z| z.is_finite()) {
            return Err(wrong("has a `start` without finite displacements and velocities of all degrees of freedom"));
        }
        let sampled = sampled_path::Sampled::new(system, path.as_ref(), omega, period);
        if !sampled.is_consistent() {
            return Err(wrong("has samples with a wrong number of values, or with NaN or infinity"));
        }
        let Ok(measured) = postprocess::results(system, &sampled, omega, (Symmetry::FullPeriod, period));
        let size = measured.places.iter().map(|place| place.maximum.abs().max(place.minimum.abs())).fold(0.0, f64::max);
        // Permitted difference between the ends of a period, and between `initial_state` and the
        // path. Displacements are relative to their size, velocities to their size times Ω. A
        // series of a few harmonics is no more accurate.
        let apart = |a: &[f64], sign: f64, b: &[f64]| a.iter().zip(b).any(|(a, b)| (a - sign * b).abs() > 1e-3 * size);
        let rated = |sample: Sample| -> Vec<f64> {
            sample.displacement.into_iter().chain(sample.velocity.into_iter().map(|v| v / omega)).collect()
        };
        let begin = rated(path.sample(0.0));
        let stated: Vec<f64> =
            (0..2 * n).map(|i| if i < n { initial_state[i] } else { initial_state[i] / omega }).collect();
        if apart(&begin, 1.0, &stated) {
            return Err(wrong("does not begin at `initial_state`"));
        }
        // Distance from the end of the period at which the path is evaluated, relative to the
        // period.
        if apart(&begin, 1.0, &rated(path.sample(period * (1.0 - 1e-9)))) {
            return Err(wrong("does not return to its initial state after one period"));
        }
        if symmetry == Symmetry::HalfPeriod && apart(&begin, -1.0, &rated(path.sample(0.5 * period))) {
            return Err(wrong("is not the mirrored initial state after half a period"));
        }
        let energy_gap = measured.energy_gap(0.0);
        // Energy gap above which a motion is not an orbit of the system.
        if energy_gap > 0.1 {
            return Err(OrbitError::Evidence { method, omega, energy_gap });
        }
        let stuck = measured.stuck_names();
        Ok(Orbit {
            method,
            omega,
            periods,
            symmetry,
            initial_state,
            evidence: Evidence {
                residual,
                energy_gap,
                switches: measured.joints.iter().map(|joint| joint.switches).sum(),
                iterations,
                harmonics: None,
                error_estimate,
                accuracy,
                return_defect: None,
                history_dependent: history_dependent_joints(laws(system), &measured.joints, &stuck, symmetry),
                stuck,
                history_spread: None,
                found_by: method,
                fallback_from: None,
            },
            places: measured.places,
            joints: measured.joints,
            energy: measured.energy,
            return_map: DMatrix::zeros(0, 0),
            contracts: system.is_incrementally_stable(),
            path,
            series: None,
        })
    }

    /// Returns the period of the motion, s: [`Orbit::periods`] times the excitation period
    /// `2π/Ω`.
    pub fn period(&self) -> f64 {
        self.periods as f64 * std::f64::consts::TAU / self.omega
    }

    /// Returns the smallest number of excitation periods after which the motion repeats. A
    /// search for motions of several periods also finds those of fewer. States that differ by
    /// less than 1e-6 count as equal.
    pub fn minimal_periods(&self) -> usize {
        let compared_instants: usize = 8;
        let state = |time: f64| {
            let sample = self.sample(time);
            let velocities = sample.velocity.into_iter().map(|v| v / self.omega);
            sample.displacement.into_iter().chain(velocities).collect::<Vec<f64>>()
        };
        let size = self.places.iter().map(|place| place.length_amplitude()).fold(0.0, f64::max);
        let drive = self.period() / self.periods as f64;
        let after = |periods: usize| {
            (0..compared_instants).all(|i| {
                let time = self.period() * i as f64 / compared_instants as f64;
                let (now, later) = (state(time), state(time + periods as f64 * drive));
                // Two states are equal below this difference relative to the largest amplitude
                // (velocities: times Ω). Time integration closes orbits to 1e-9, which stiff
                // contacts degrade to 1e-7. The second constant is the number of instants that
                // are compared.
                now.iter().zip(&later).all(|(now, later)| (now - later).abs() <= 1e-6 * size)
            })
        };
        (1..self.periods)
            .filter(|periods| self.periods.is_multiple_of(*periods))
            .find(|p| after(*p))
            .unwrap_or(self.periods)
    }

    /// Returns the state at any time (s).
    pub fn sample(&self, time: f64) -> Sample {
        self.path.sample(time.rem_euclid(self.period()))
    }

    /// Returns the times in `[0, T)` at which a joint switches, in increasing order, s.
    pub fn transition_times(&self) -> Vec<f64> {
        self.path.transition_times()
    }

    /// Returns the motion of a place by name.
    pub fn place(&self, name: &str) -> Option<&PlaceMotion> {
        self.places.iter().find(|place| place.name == name)
    }

    /// Returns the motion of a joint by name.
    pub fn joint(&self, name: &str) -> Option<&JointMotion> {
        self.joints.iter().find(|joint| joint.name == name)
    }

    /// Tells whether a joint sticks for the whole period, so that the orbit belongs to a
    /// continuum.
    pub fn is_in_continuum(&self) -> bool {
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
