//! A periodic motion, with the evidence for it.
//!
//! All methods return the same [`Orbit`]. Its numbers (amplitudes, energies, slip) are computed by the method that found it, in
//! closed form where it can; [`Orbit::sample`] gives the motion at any time.

mod error;
pub(crate) mod measure;
mod sampled;
mod stability;

pub use crate::law::Contact;
use crate::law::{MOST_DIRECTIONS, Piece, SharedLaw, Slider};
use crate::model::System;
pub use error::{Breakdown, Course, OrbitError};
use nalgebra::DMatrix;
use num_complex::Complex64;
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

/// Which return the orbit was closed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// `x(t + T/2) = -x(t)`.
    HalfPeriod,
    /// `x(t + T) = x(t)` only.
    FullPeriod,
}

impl Symmetry {
    /// Of orbits that repeat after so many periods of the drive: an odd number of them has a half after which an odd excitation is mirrored.
    pub(crate) fn of(system: &System, periods: usize) -> Symmetry {
        if system.is_odd() && periods % 2 == 1 { Symmetry::HalfPeriod } else { Symmetry::FullPeriod }
    }
}

/// Motion of one place over a period of the orbit.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceMotion {
    /// Name.
    pub name: String,
    /// Largest displacement, m.
    pub maximum: f64,
    /// Smallest displacement, m.
    pub minimum: f64,
    /// Mean displacement, m.
    pub mean: f64,
    /// First harmonic `X` in `x = Re(X e^{jΩt}) + …`, m.
    pub first_harmonic: Complex64,
}

impl PlaceMotion {
    /// Half of peak to peak, m.
    pub fn amplitude(&self) -> f64 {
        0.5 * (self.maximum - self.minimum)
    }
    /// Phase of the first harmonic against `cos Ωt`, degrees in (-180, 180].
    pub fn phase_deg(&self) -> f64 {
        self.first_harmonic.arg().to_degrees()
    }
}

/// What one joint does over a period.
#[derive(Debug, Clone, PartialEq)]
pub struct JointMotion {
    /// Name.
    pub name: String,
    /// Energy lost in friction per period, J.
    pub dissipation: f64,
    /// Fraction of the period in which the joint slips.
    pub slip_fraction: f64,
    /// Fraction of the period in which its faces rest on each other.
    pub stick_fraction: f64,
    /// Fraction of the period in which its faces are apart. What the three fractions leave of one is a stop that touches.
    pub open_fraction: f64,
    /// Smallest and largest relative displacement along each of its directions, m.
    pub displacement: Vec<(f64, f64)>,
    /// Changes between stick and slip, or of the slip direction, per period.
    pub switches: usize,
}

/// Energies per period of the orbit, J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energy {
    /// Work of the forces and of imposed motion.
    pub work_in: f64,
    /// Loss in viscous dampers.
    pub viscous: f64,
    /// Loss in joints.
    pub friction: f64,
}

/// Whether an orbit, whose equations are solved, is as accurate as it was asked to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accuracy {
    /// It is: exactly, or by the estimate of its error.
    Converged,
    /// The estimated error of its series is larger than the tolerance.
    Truncated,
    /// It is a series whose error was not estimated.
    Unchecked,
}

impl Accuracy {
    /// The status that tables show.
    pub fn status(self) -> &'static str {
        match self {
            Accuracy::Converged => "converged",
            Accuracy::Truncated => "truncated",
            Accuracy::Unchecked => "unchecked",
        }
    }
}

/// The numbers that say how far an orbit may be trusted.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Distance between the state and its return, relative to the vibration (the state without its mean), in the energy norm.
    pub residual: f64,
    /// `|work in - viscous - friction| / work in`, from independent integrals.
    pub energy_gap: f64,
    /// Switches per period.
    pub switches: usize,
    /// Iterations of the method.
    pub iterations: usize,
    /// The highest harmonic of the motion's own frequency in it, if it is a series.
    pub harmonics: Option<usize>,
    /// Estimated relative error of the amplitudes from discretisation; `None` for a method that has none.
    pub truncation: Option<f64>,
    /// Whether that is as little as was asked for.
    pub accuracy: Accuracy,
    /// Distance between the state at t = 0 and where an independent flow brings it after a return, relative to the vibration, in the energy norm;
    /// the residual itself where the orbit was found by a flow, `None` where no flow follows the system, or where it is too large to be followed
    /// without being asked ([`Orbit::return_defect`]).
    pub return_defect: Option<f64>,
    /// Names of joints that stick for the whole period: their offset is not unique, the orbit is one of a continuum
    /// (the symmetric one, with [`Symmetry::HalfPeriod`]).
    pub stuck: Vec<String>,
    /// Names of joints of which a part, a slider behind a spring or all, sticks for the whole period of a motion that is not its own mirror image:
    /// where it is relaxed depends on how the motion began, and with it the means, and the amplitudes too where a law knows positions. The orbit
    /// is then the one in which what sticks behind a spring carries no mean force, as it is where joints creep; with method `transient`
    /// the one that its motion led to.
    pub history: Vec<String>,
    /// The method that was to find it and did not, where another one did: see [`Auto`](crate::method::auto::Auto).
    pub instead_of: Option<&'static str>,
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
        stuck.contains(&motion.name) || reaches.any(|reach| travel <= 2.0 * reach)
    };
    let kept = laws.zip(joints).filter(|(law, motion)| holds(law, motion));
    kept.map(|(_, motion)| motion.name.clone()).collect()
}

/// The state of a motion at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Displacements, length n, m.
    pub displacement: Vec<f64>,
    /// Velocities, length n, m/s.
    pub velocity: Vec<f64>,
    /// Accelerations, length n, m/s².
    pub acceleration: Vec<f64>,
    /// The joints.
    pub joints: Vec<JointSample>,
    /// Displacement of, and force that moves, each place with imposed motion: m, N.
    pub moved: Vec<(f64, f64)>,
}

/// A joint at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSample {
    /// Relative displacement, m; along the joint's directions, as many as it has, like all that follows.
    pub displacement: [f64; MOST_DIRECTIONS],
    /// Relative velocity, m/s.
    pub velocity: [f64; MOST_DIRECTIONS],
    /// Force, N.
    pub force: [f64; MOST_DIRECTIONS],
    /// Stick, slip or apart.
    pub contact: Contact,
}

impl JointSample {
    /// Of a joint with one direction.
    pub fn along(displacement: f64, velocity: f64, force: f64, contact: Contact) -> Self {
        let first = |value: f64| [value, 0.0, 0.0];
        JointSample { displacement: first(displacement), velocity: first(velocity), force: first(force), contact }
    }

    /// Power that the joint takes, W.
    pub fn power(&self) -> f64 {
        self.force.iter().zip(self.velocity).map(|(f, v)| f * v).sum()
    }
}

/// A motion that can be evaluated at any time of its period; with [`Orbit::new`] the motion of a method from elsewhere becomes an orbit.
pub trait Path: Send + Sync {
    /// The state at `time` in `[0, T)`.
    fn sample(&self, time: f64) -> Sample;
    /// The instants at which something switches, in `[0, T)`, rising.
    fn switch_times(&self) -> Vec<f64>;
    /// The derivative of the return from `start`, of a method that makes none by itself; `None` if there is none.
    fn return_map(&self, _start: &[f64], _symmetry: Symmetry) -> Option<DMatrix<f64>> {
        None
    }
    /// How far an independent motion from `start` is from it after a return, relative to the vibration, of a method that finds its orbits in another
    /// way than by motion; `None` if nothing follows it.
    fn return_defect(&self, _start: &[f64], _symmetry: Symmetry) -> Option<f64> {
        None
    }
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
        let size = self.places.iter().map(|place| place.amplitude()).fold(0.0, f64::max);
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
