//! The equations of harmonic balance with a parameter, for continuation.

use super::joints::Coordinate;
use super::judge::Judge;
use super::rest::Rest;
use super::solve::{Level, Motion};
use super::{HarmonicBalance, highest_excitation, path};
use crate::method::guess::Guess;
use crate::method::{MethodError, OrbitError};
use crate::model::System;
use crate::orbit::Orbit;
use num_complex::Complex64;
use stickslip_numerics::continuation::Equations;

/// Harmonics when none are given.
const HARMONICS: usize = 15;
/// Step of the difference with respect to the parameter, relative to it: the cube root of rounding, for central differences.
const DIFFERENCE: f64 = 1e-6;

/// Motions grow towards resonance: the unknowns are measured by this many times the first motion, so that they stay of order one.
const RESONANCE: f64 = 30.0;

/// The equations; unknowns are the harmonics of the joints' motions, relative to the size of the first orbit.
pub(crate) struct BranchEquations<'a> {
    at: &'a dyn Fn(f64) -> (System, f64),
    system: System,
    omega: f64,
    value: f64,
    coordinates: Vec<Coordinate>,
    rest: Rest,
    rest_of: System,
    level: Level,
    motion: Motion,
    /// Unit of motions, m.
    length: f64,
    judge: Judge,
    odd: bool,
}

impl<'a> BranchEquations<'a> {
    pub fn new(at: &'a dyn Fn(f64) -> (System, f64), method: HarmonicBalance, value: f64) -> Result<Self, MethodError> {
        let (system, omega) = at(value);
        let highest = highest_excitation(&system);
        method.check(highest)?;
        let top = method.harmonics.unwrap_or(HARMONICS.max(highest));
        let coordinates = super::joints::coordinates(&system)?;
        let rest = Rest::new(&system, &coordinates);
        let odd = system.is_odd();
        let harmonics: Vec<usize> = if odd { (1..=top).step_by(2).collect() } else { (0..=top).collect() };
        let samples = method.samples.unwrap_or(1024.max((16 * (top + 1)).next_power_of_two()));
        let level = Level::new(harmonics, samples, coordinates.len(), None);
        let motion = Motion::rest(level.linear.len());
        Ok(BranchEquations {
            at,
            rest_of: system.clone(),
            judge: Judge::new(&system),
            system,
            omega,
            value: f64::NAN,
            coordinates,
            rest,
            level,
            motion,
            length: 1.0,
            odd,
        })
    }

    /// Makes everything that depends on the parameter.
    fn set(&mut self, value: f64) {
        if value == self.value {
            return;
        }
        let (system, omega) = (self.at)(value);
        if let Ok(coordinates) = super::joints::coordinates(&system)
            && coordinates.len() == self.coordinates.len()
        {
            self.coordinates = coordinates;
        }
        let same = system.mass == self.rest_of.mass
            && system.damping == self.rest_of.damping
            && system.stiffness == self.rest_of.stiffness;
        if !same {
            self.rest = Rest::new(&system, &self.coordinates);
            self.rest_of = system.clone();
        }
        self.level.drive(&system, &self.coordinates, &self.rest, omega);
        if !same || self.system.joints != system.joints {
            self.judge = Judge::new(&system);
        }
        (self.system, self.omega, self.value) = (system, omega, value);
    }

    fn lost(&self, iterations: usize, residual: f64) -> OrbitError {
        OrbitError::NotConverged { method: super::NAME, omega: self.omega, iterations, residual }
    }

    /// The first point, found from the describing function.
    pub fn start(&mut self, value: f64) -> Result<Vec<f64>, OrbitError> {
        self.set(value);
        let guess = Guess::new(&self.system, self.omega);
        let start = self.level.begin(&self.system, &self.coordinates, Some(&guess), self.omega);
        let solved = self.level.solve(&self.coordinates, self.omega, start);
        self.motion = solved.map_err(|lost| self.lost(lost.iterations, lost.residual))?;
        let norm = |c: &[Complex64]| c.iter().map(|c| c.norm_sqr()).sum::<f64>().sqrt();
        let size = norm(&self.motion.c).max(1e-3 * norm(&self.level.linear));
        self.length = (RESONANCE * size).max(f64::MIN_POSITIVE);
        Ok(self.level.pack(&self.coordinates, &self.motion, self.length))
    }

    /// The orbit of a point of the branch.
    pub fn orbit(&mut self, x: &[f64], value: f64) -> Option<Orbit> {
        self.set(value);
        self.level.unpack(&self.coordinates, (x, self.length), &mut self.motion);
        self.level.polish(&self.coordinates, self.omega, &mut self.motion, 10).ok()?;
        let places = path::places(&mut self.level, &self.rest, self.omega, &self.motion);
        let context = path::Context {
            system: &self.system,
            coordinates: &self.coordinates,
            omega: self.omega,
            odd: self.odd,
            truncation: None,
            tolerance: 0.0,
            judge: Some(&mut self.judge),
        };
        Some(path::orbit(context, &mut self.level, &self.motion, places))
    }

    /// The orbit at `value` that Newton's method finds from the point `x` nearby.
    pub fn near(&mut self, x: &[f64], value: f64) -> Option<Orbit> {
        let mut x = x.to_vec();
        self.leap(&mut x, value).then(|| self.orbit(&x, value))?
    }
}

impl Equations for BranchEquations<'_> {
    fn size(&self) -> usize {
        2 * self.motion.c.len()
    }

    fn tolerance(&self) -> f64 {
        super::solve::SOLVED / RESONANCE
    }

    fn evaluate(&mut self, x: &[f64], p: f64, f: &mut [f64], by_x: &mut [f64], by_p: &mut [f64]) -> bool {
        if !p.is_finite() || x.iter().any(|x| !x.is_finite()) {
            return false;
        }
        let step = DIFFERENCE * p.abs().max(f64::MIN_POSITIVE);
        for (sign, at) in [(1.0, p + step), (-1.0, p - step)] {
            self.set(at);
            if self.omega <= 0.0 {
                return false;
            }
            self.level.residual_at(&self.coordinates, self.omega, (x, self.length), &mut self.motion, f, None);
            for (d, r) in by_p.iter_mut().zip(f.iter()) {
                *d = if sign > 0.0 { *r } else { (*d - *r) / (2.0 * step) };
            }
        }
        self.set(p);
        self.level.residual_at(&self.coordinates, self.omega, (x, self.length), &mut self.motion, f, Some(by_x));
        true
    }

    fn leap(&mut self, x: &mut [f64], p: f64) -> bool {
        self.set(p);
        let mut start = self.motion.clone();
        self.level.unpack(&self.coordinates, (x, self.length), &mut start);
        let Ok(motion) = self.level.solve(&self.coordinates, self.omega, start) else { return false };
        self.motion = motion;
        x.copy_from_slice(&self.level.pack(&self.coordinates, &self.motion, self.length));
        true
    }
}
