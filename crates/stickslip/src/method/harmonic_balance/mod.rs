//! Harmonic balance: the orbit as a Fourier series, friction sampled over the period.
//!
//! - `joints`: from the harmonics of relative motions to those of friction forces, with the exact derivative;
//! - `rest`: the receptance of the linear rest, in closed form from its modes;
//! - `solve`: the equations along the joints, and Newton's method on them;
//! - `path`: the orbit's numbers from its harmonics.
//!
//! The unknowns are the harmonics of the joints' relative motions: the cost follows joints and harmonics, not degrees of freedom. Under
//! odd excitation only odd harmonics occur. The error of a solution is estimated from a second one with twice the harmonics.
//! Source: Krack and Gross, "Harmonic Balance for Nonlinear Vibration Problems" (2019); Cameron and Griffin (1989).

mod branch;
mod joints;
mod judge;
mod mode;
mod path;
mod rest;
mod solve;
mod sparse;

use super::guess::Guess;
use super::{Method, MethodError, MethodInfo, MethodOption, Options, OrbitError, Solver};
use crate::dimension::Dimension;
use crate::model::System;
use crate::orbit::Orbit;
pub(crate) use branch::BranchEquations;
use joints::{Coordinate, Slider};
use judge::Judge;
pub(crate) use mode::{ModeEquations, ModeState};
use nalgebra::DVector;
use num_complex::Complex64;
use rest::Rest;
use solve::{Level, Lost, Motion};
use sparse::Sparse;
use std::collections::BTreeMap;

pub(crate) const NAME: &str = "harmonic-balance";

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
            doc: "samples per period, even, at least 4 (harmonics + 1); absent: 16 per harmonic, at least 1024",
        },
        MethodOption {
            key: "tolerance",
            dimension: Dimension::NONE,
            count: false,
            doc: "error of the motion relative to the largest amplitude that is aimed at when `harmonics` is absent; 0.001",
        },
    ],
    build: |options| Ok(Box::new(HarmonicBalance::from_options(options)?)),
};

/// Tolerance when none is given.
const TOLERANCE: f64 = 1e-3;
/// First number of harmonics when none is given.
const FIRST: usize = 7;
/// Highest harmonic that the program chooses itself.
const MOST: usize = 511;
/// Unknowns beyond which the ladder of harmonics ends: the elimination would take seconds.
const LARGEST: usize = 700;
/// What a doubling of the harmonics leaves of the error where rigid friction makes accelerations jump: half, by the order 1 that is
/// observed. Without rigid friction it leaves next to nothing.
const RIGID_LEFT: f64 = 0.5;
/// Samples per period, at least, and per harmonic: the force of a slider is then placed to 1e-6 of the period.
const SAMPLES: usize = 1024;
const SAMPLES_PER_HARMONIC: usize = 16;

/// Harmonic balance.
///
/// # Example
/// ```
/// use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
/// let system = stickslip::model::templates::find("blade-couple-massless").unwrap().model().assemble().unwrap();
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
    /// Error relative to the largest amplitude, aimed at when `harmonics` is absent.
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
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let highest = highest_excitation(system);
        self.check(highest)?;
        let coordinates = joints::coordinates(system)?;
        let rest = Rest::new(system, &coordinates);
        let rigid = coordinates.iter().flat_map(|c| &c.sliders).filter(|s| matches!(s, Slider::Rigid { .. })).count();
        let odd = system.is_odd();
        Ok(Box::new(Balance {
            system,
            method: *self,
            coordinates,
            rest,
            rigid,
            odd,
            first: FIRST.max(highest),
            judge: Judge::new(system),
            levels: BTreeMap::new(),
            last: None,
        }))
    }
}

fn highest_excitation(system: &System) -> usize {
    let loads = system.loads.iter().map(|load| load.harmonic);
    let imposed = system.joints.iter().flat_map(|joint| joint.imposed.iter().map(|(h, _)| *h));
    let moved = system.moved.iter().flat_map(|place| place.motion.iter().map(|(h, _)| *h));
    loads.chain(imposed).chain(moved).max().unwrap_or(0) as usize
}

struct Balance<'a> {
    system: &'a System,
    method: HarmonicBalance,
    coordinates: Vec<Coordinate>,
    rest: Rest,
    rigid: usize,
    odd: bool,
    first: usize,
    judge: Judge,
    levels: BTreeMap<usize, Level>,
    /// The last orbit: its state at t = 0, its highest harmonic and its motion.
    last: Option<(Vec<f64>, usize, Motion)>,
}

impl Balance<'_> {
    /// The level of highest harmonic `top`, ready for `omega`.
    fn level(&mut self, top: usize, omega: f64) -> &mut Level {
        let harmonics: Vec<usize> = if self.odd { (1..=top).step_by(2).collect() } else { (0..=top).collect() };
        let samples = self.samples(top);
        let (count, rigid) = (self.coordinates.len(), self.rigid);
        let (system, coordinates) = (self.system, &self.coordinates);
        let level = self.levels.entry(top).or_insert_with(|| {
            let sparse = Sparse::new(system, coordinates, &harmonics);
            Level::new(harmonics, samples, (count, rigid), sparse)
        });
        level.drive(self.system, &self.coordinates, &self.rest, omega);
        level
    }

    fn samples(&self, top: usize) -> usize {
        let needed = (SAMPLES_PER_HARMONIC * (top + 1)).next_power_of_two();
        match self.method.samples {
            Some(samples) if samples >= 4 * (top + 1) => samples,
            Some(samples) => samples * 2,
            None => needed.max(SAMPLES),
        }
    }

    fn unknowns(&self, top: usize) -> usize {
        2 * self.coordinates.len() * if self.odd { top.div_ceil(2) } else { top + 1 }
    }

    /// Solves at `top`, from a motion at another number of harmonics or from the first guess.
    fn solve(&mut self, top: usize, omega: f64, from: Option<(usize, &Motion)>) -> Result<Motion, Lost> {
        let start = match from {
            Some((other, motion)) => {
                let harmonics = self.levels[&other].harmonics().to_vec();
                let coordinates = self.coordinates.len();
                let level = self.level(top, omega);
                solve::transfer(motion, &harmonics, level.harmonics(), level.alternation.samples(), coordinates)
            }
            None => self.guess(top, omega),
        };
        let warm = from.is_some();
        let level = self.levels.get_mut(&top).expect("made above");
        level.solve(&self.coordinates, omega, start, warm)
    }

    /// The describing function's motion.
    fn guess(&mut self, top: usize, omega: f64) -> Motion {
        let n = self.system.dofs();
        // the guess solves the whole structure densely: large systems begin without friction
        let guess = (n < sparse::LARGE).then(|| Guess::new(self.system, omega));
        let guess = guess.map_or_else(Vec::new, |guess| guess.harmonics);
        let coordinates = self.coordinates.clone();
        let (system, rigid) = (self.system, self.rigid);
        let level = self.level(top, omega);
        let nh = level.harmonics().len();
        let zero = Complex64::new(0.0, 0.0);
        let mut c = level.linear.clone();
        for (q, coordinate) in coordinates.iter().enumerate() {
            let joint = &system.joints[coordinate.joint];
            for (rate, x) in &guess {
                let h = (rate / omega).round() as usize;
                if let Ok(k) = level.harmonics().binary_search(&h) {
                    let g = joint.imposed.iter().find(|(k, _)| *k as usize == h).map_or(zero, |(_, g)| *g);
                    c[q * nh + k] = (0..n).map(|i| x[i] * joint.direction[(i, 0)]).sum::<Complex64>() + g;
                }
            }
        }
        Motion {
            force: vec![zero; c.len()],
            c,
            multipliers: vec![vec![0.0; level.alternation.samples()]; rigid],
            ..Motion::default()
        }
    }

    fn lost(&self, omega: f64, lost: Lost) -> OrbitError {
        OrbitError::NotConverged { method: NAME, omega, iterations: lost.iterations, residual: lost.residual }
    }

    /// Harmonics of the places.
    fn places(&mut self, top: usize, omega: f64, motion: &Motion) -> Vec<DVector<Complex64>> {
        path::places(self.levels.get_mut(&top).expect("solved"), &self.rest, omega, motion)
    }

    /// Distance of two motions, as the largest of the places, relative to the largest motion of a place; without means.
    fn distance(&self, coarse: (usize, &[DVector<Complex64>]), fine: (usize, &[DVector<Complex64>])) -> f64 {
        let (few, many) = (self.levels[&coarse.0].harmonics(), self.levels[&fine.0].harmonics());
        let n = self.system.dofs();
        let (mut distance, mut size) = (0.0f64, 0.0f64);
        for i in 0..n {
            let (mut d, mut s) = (0.0, 0.0);
            for (k, h) in many.iter().enumerate() {
                if *h == 0 {
                    continue;
                }
                let x = few.binary_search(h).map_or(Complex64::new(0.0, 0.0), |l| coarse.1[l][i]);
                d += (x - fine.1[k][i]).norm_sqr();
                s += fine.1[k][i].norm_sqr();
            }
            (distance, size) = (distance.max(d), size.max(s));
        }
        if size > 0.0 { (distance / size).sqrt() } else { 0.0 }
    }

    fn finish(
        &mut self,
        top: usize,
        omega: f64,
        motion: Motion,
        x: Vec<DVector<Complex64>>,
        truncation: Option<f64>,
    ) -> Orbit {
        let context = path::Context {
            system: self.system,
            coordinates: &self.coordinates,
            omega,
            odd: self.odd,
            truncation: truncation.map(|error| error + motion.left),
            judge: Some(&mut self.judge),
        };
        let level = self.levels.get_mut(&top).expect("solved");
        let orbit = path::orbit(context, level, &motion, x);
        self.last = Some((orbit.start.clone(), top, motion));
        orbit
    }

    /// The user's number of harmonics, with an estimate of its error.
    fn fixed(&mut self, top: usize, omega: f64, warm: Option<(usize, Motion)>) -> Result<Orbit, OrbitError> {
        let motion = self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.lost(omega, l))?;
        let x = self.places(top, omega, &motion);
        let double = 2 * top + 1;
        let sparse = self.levels[&top].sparse.is_some();
        let truncation =
            if sparse || self.unknowns(double) <= LARGEST { self.check(top, omega, &motion, &x) } else { None };
        Ok(self.finish(top, omega, motion, x, truncation))
    }

    /// Error of `motion` by one with twice the harmonics.
    fn check(&mut self, top: usize, omega: f64, motion: &Motion, x: &[DVector<Complex64>]) -> Option<f64> {
        let double = 2 * top + 1;
        let better = self.solve(double, omega, Some((top, motion))).ok()?;
        let y = self.places(double, omega, &better);
        let left = if self.rigid > 0 { RIGID_LEFT } else { 0.0 };
        Some(self.distance((top, x), (double, &y)) / (1.0 - left))
    }

    /// As many harmonics as the tolerance needs.
    fn chosen(&mut self, omega: f64, warm: Option<(usize, Motion)>) -> Result<Orbit, OrbitError> {
        let tolerance = self.method.tolerance.unwrap_or(TOLERANCE);
        let mut top = self.first;
        let mut motion =
            self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.lost(omega, l))?;
        let mut x = self.places(top, omega, &motion);
        let mut error = f64::INFINITY;
        while 2 * top < MOST && self.unknowns(2 * top + 1) <= LARGEST {
            let double = 2 * top + 1;
            let fine = self.solve(double, omega, Some((top, &motion))).map_err(|l| self.lost(omega, l))?;
            let y = self.places(double, omega, &fine);
            error = self.distance((top, &x), (double, &y));
            if self.rigid > 0 {
                // the error of the finer of the two, which is the better one
                error *= RIGID_LEFT / (1.0 - RIGID_LEFT);
            } else if error <= tolerance {
                return Ok(self.finish(top, omega, motion, x, Some(error)));
            }
            (top, motion, x) = (double, fine, y);
            if error <= tolerance {
                return Ok(self.finish(top, omega, motion, x, Some(error)));
            }
        }
        Err(OrbitError::Truncation { method: NAME, omega, harmonics: top, estimate: error, tolerance })
    }
}

impl Solver for Balance<'_> {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        // the harmonics of a neighbouring orbit are at hand if it is the last one
        let warm = match (&self.last, start) {
            (Some((state, top, motion)), Some(start)) if state == start => Some((*top, motion.clone())),
            _ => None,
        };
        match self.method.harmonics {
            Some(top) => self.fixed(top, omega, warm),
            None => self.chosen(omega, warm),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The width at which rigid friction hands over to multipliers is a matter of numerics: a hundredfold changes nothing.
    #[test]
    fn rigid_friction_does_not_depend_on_the_width() {
        let couple = crate::model::templates::find("blade-couple").unwrap();
        for (limit, hertz) in [(2.0, 121.25), (4.0, 120.75), (6.0, 121.0), (8.0, 120.5)] {
            let system = couple.model_with(&[("Ft", limit)]).unwrap().assemble().unwrap();
            let coordinates = joints::coordinates(&system).unwrap();
            let rest = Rest::new(&system, &coordinates);
            let omega = std::f64::consts::TAU * hertz;
            let solution = |width: f64| {
                let mut level = Level::new((1..=15).step_by(2).collect(), 1024, (1, 1), None);
                level.drive(&system, &coordinates, &rest, omega);
                level.width = width;
                let zero = vec![Complex64::new(0.0, 0.0); 8];
                let start =
                    Motion { c: zero.clone(), force: zero, multipliers: vec![vec![0.0; 1024]], ..Motion::default() };
                let motion = level.solve(&coordinates, omega, start, false).unwrap();
                path::places(&mut level, &rest, omega, &motion)
            };
            let (one, other) = (solution(1e-8), solution(1e-6));
            for (a, b) in one.iter().zip(&other) {
                // the equations are solved to 1e-10, and the resonance (Q = 700) multiplies what is left
                assert!(
                    (a - b).norm() < 700.0 * solve::SOLVED * one[0].norm(),
                    "{limit} N, {hertz} Hz: {:.1e}",
                    (a - b).norm()
                );
            }
        }
    }
}
