//! The system as the event-driven method sees it: masses, springs, ideal sliders, one drive frequency.

use crate::method::MethodError;
use crate::model::System;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use serde::{Deserialize, Serialize};

/// Whether a slider rests or moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Contact {
    /// The faces rest on each other.
    Stick,
    /// They slide with `u' > 0`.
    SlipForward,
    /// They slide with `u' < 0`.
    SlipBackward,
}

impl Contact {
    /// The slip direction: +1, -1, or 0 in stick.
    pub fn sign(self) -> f64 {
        match self {
            Contact::Stick => 0.0,
            Contact::SlipForward => 1.0,
            Contact::SlipBackward => -1.0,
        }
    }

    pub(crate) fn slip(sign: f64) -> Self {
        if sign > 0.0 { Contact::SlipForward } else { Contact::SlipBackward }
    }
}

/// One ideal slider, rigid or behind a spring.
#[derive(Debug, Clone)]
pub(crate) struct Slider {
    /// The joint it belongs to.
    pub joint: usize,
    /// Direction, length n.
    pub direction: DVector<f64>,
    /// Spring in front of it, N/m.
    pub stiffness: Option<f64>,
    /// Slip limit, N.
    pub limit: f64,
    /// Index of its force among the states, for a slider behind a spring.
    pub state: Option<usize>,
}

/// Matrices and sliders; independent of the drive frequency.
#[derive(Debug, Clone)]
pub(crate) struct Mechanics {
    pub n: usize,
    pub mass: DMatrix<f64>,
    pub inverse_mass: DMatrix<f64>,
    pub damping: DMatrix<f64>,
    pub stiffness: DMatrix<f64>,
    pub sliders: Vec<Slider>,
    /// Number of sliders behind springs.
    pub elastic: usize,
    /// Estimate of the fastest natural frequency, rad/s.
    pub fastest: f64,
}

impl Mechanics {
    /// # Errors
    /// A joint whose law has no exact view, or that acts in more than one direction; a place without mass.
    pub fn new(system: &System) -> Result<Self, MethodError> {
        let n = system.dofs();
        if let Some(i) = (0..n).find(|&i| system.mass[(i, i)] <= 0.0) {
            return Err(MethodError::NeedsMass { method: super::NAME, place: system.places[i].clone() });
        }
        let mut sliders = Vec::new();
        let mut elastic = 0;
        for (j, joint) in system.joints.iter().enumerate() {
            let unsupported = |instead: &'static str| MethodError::Law {
                method: super::NAME,
                joint: joint.name.clone(),
                law: joint.law.name(),
                instead,
            };
            let branches = joint.law.network().ok_or_else(|| unsupported("method `shooting`, or the exact law"))?;
            if joint.direction.ncols() != 1 {
                return Err(unsupported("a law with one direction"));
            }
            for branch in branches {
                let state = branch.stiffness.map(|_| {
                    elastic += 1;
                    elastic - 1
                });
                sliders.push(Slider {
                    joint: j,
                    direction: joint.direction.column(0).into_owned(),
                    stiffness: branch.stiffness,
                    limit: branch.limit,
                    state,
                });
            }
        }
        let inverse_mass = system
            .mass
            .clone()
            .try_inverse()
            .ok_or(MethodError::NotPositive { method: super::NAME, matrix: "mass" })?;
        let fastest = (0..n).map(|i| (system.stiffness[(i, i)] / system.mass[(i, i)]).sqrt()).fold(0.0, f64::max);
        Ok(Mechanics {
            n,
            fastest,
            mass: system.mass.clone(),
            inverse_mass,
            damping: system.damping.clone(),
            stiffness: system.stiffness.clone(),
            sliders,
            elastic,
        })
    }

    /// Length of the state `(x, v, forces of sliders behind springs)`.
    pub fn states(&self) -> usize {
        2 * self.n + self.elastic
    }
}

/// The excitation at one drive frequency.
#[derive(Debug, Clone, Default)]
pub(crate) struct Drive {
    /// Drive frequency Ω, rad/s.
    pub omega: f64,
    /// Frequencies hΩ of the harmonics that occur, rad/s, rising.
    pub rates: Vec<f64>,
    /// Force amplitudes, per harmonic, N.
    pub forces: Vec<DVector<Complex64>>,
    /// Constant force, N.
    pub constant: DVector<f64>,
    /// Imposed relative motion per harmonic and slider, m (without its constant part, which changes nothing).
    pub imposed: Vec<Vec<Complex64>>,
    /// Square root of an energy that the loads can give to the structure, √J: the scale of a state near rest.
    pub energy_scale: f64,
    /// A velocity well below those of a moving structure, m/s: the scale of velocities near rest.
    pub velocity_scale: f64,
}

/// Velocities of a structure near rest are measured against this fraction of the velocity that its loads could cause.
const NEAR_REST: f64 = 1e-3;

impl Drive {
    pub fn new(system: &System, mechanics: &Mechanics, omega: f64) -> Self {
        let n = mechanics.n;
        let excitation = system.excitation(omega);
        let mut harmonics: Vec<u32> = excitation.iter().map(|(h, _)| *h).collect();
        harmonics.extend(system.joints.iter().flat_map(|joint| joint.imposed.iter().map(|(h, _)| *h)));
        harmonics.extend(system.moved.iter().flat_map(|place| place.motion.iter().map(|(h, _)| *h)));
        harmonics.sort_unstable();
        harmonics.dedup();
        harmonics.retain(|&h| h > 0);
        let force_at = |h: u32| excitation.iter().find(|(k, _)| *k == h).map(|(_, f)| f.clone());
        let zero = || DVector::from_element(n, Complex64::new(0.0, 0.0));
        let imposed_at = |h: u32| {
            mechanics
                .sliders
                .iter()
                .map(|slider| {
                    let imposed = &system.joints[slider.joint].imposed;
                    imposed.iter().find(|(k, _)| *k == h).map_or(Complex64::new(0.0, 0.0), |(_, g)| *g)
                })
                .collect()
        };
        let mut drive = Drive {
            omega,
            rates: harmonics.iter().map(|&h| f64::from(h) * omega).collect(),
            forces: harmonics.iter().map(|&h| force_at(h).unwrap_or_else(zero)).collect(),
            constant: force_at(0).map_or_else(|| DVector::zeros(n), |f| f.map(|z| z.re)),
            imposed: harmonics.iter().map(|&h| imposed_at(h)).collect(),
            ..Drive::default()
        };
        drive.set_scales(mechanics);
        drive
    }

    fn set_scales(&mut self, mechanics: &Mechanics) {
        let loads = (0..mechanics.n).map(|i| {
            let force = self.constant[i].abs() + self.forces.iter().map(|f| f[i].norm()).sum::<f64>();
            let inertia = self.omega * self.omega * mechanics.mass[(i, i)];
            force / mechanics.stiffness[(i, i)].max(inertia).sqrt()
        });
        let springs = mechanics.sliders.iter().filter_map(|slider| Some(slider.limit / slider.stiffness?.sqrt()));
        self.energy_scale = loads.chain(springs).sum();
        let mobility = if mechanics.n == 0 { 0.0 } else { mechanics.inverse_mass.amax().sqrt() };
        let imposed = self.imposed.iter().zip(&self.rates).flat_map(|(g, rate)| g.iter().map(move |g| g.norm() * rate));
        self.velocity_scale = imposed.fold(NEAR_REST * self.energy_scale * mobility, f64::max).max(f64::MIN_POSITIVE);
    }

    /// The k-th time derivative of the force at `time`, added to `out`.
    pub fn add_force(&self, time: f64, derivative: u32, out: &mut DVector<f64>) {
        if derivative == 0 {
            *out += &self.constant;
        }
        for (rate, force) in self.rates.iter().zip(&self.forces) {
            let turn = phasor(*rate, time, derivative);
            for (o, f) in out.iter_mut().zip(force.iter()) {
                *o += (f * turn).re;
            }
        }
    }

    /// The k-th time derivative of the imposed motion of a slider.
    pub fn imposed_at(&self, slider: usize, time: f64, derivative: u32) -> f64 {
        self.rates.iter().zip(&self.imposed).map(|(rate, g)| (g[slider] * phasor(*rate, time, derivative)).re).sum()
    }
}

/// `(jω)^k e^{jωt}`
fn phasor(rate: f64, time: f64, derivative: u32) -> Complex64 {
    let (sin, cos) = (rate * time).sin_cos();
    let turn = Complex64::new(cos, sin);
    if derivative == 0 { turn } else { turn * Complex64::new(0.0, rate).powu(derivative) }
}
