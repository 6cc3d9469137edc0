//! The equations of harmonic balance with a parameter, for continuation.

use crate::method::harmonic_balance::accuracy::truncation_error::{ComparedSolution, truncation_error};
use crate::method::harmonic_balance::aft::Ports;
use crate::method::harmonic_balance::dynamics::banded::DESCRIBING_DOFS;
use crate::method::harmonic_balance::dynamics::linear_dynamics::LinearDynamics;
use crate::method::harmonic_balance::equations::harmonic_set::HarmonicSet;
use crate::method::harmonic_balance::equations::{Discretization, HarmonicSolution, with_harmonics};
use crate::method::harmonic_balance::memory_estimate::{check_memory, unbanded_memory};
use crate::method::harmonic_balance::options::{HarmonicBalance, TOLERANCE};
use crate::method::harmonic_balance::postprocess;
use crate::method::harmonic_balance::solver::MOST_ELIMINATED_UNKNOWNS;
use crate::method::orbit_search::describing_guess::DescribingGuess;
use crate::method::orbit_search::evidence::OrbitCheck;
use crate::method::{MethodError, OrbitError, alternatives};
use crate::model::System;
use crate::orbit::Orbit;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::continuation::ParametricEquations;

/// Settings of the equations of a branch.
#[derive(Debug, Clone, Copy)]
struct BranchSettings {
    /// Default number of harmonics, in units of the excitation's greatest common divisor.
    harmonics: usize,
    /// Step of the central difference with respect to the parameter, relative to the larger of the
    /// parameter and its range. It is near the cube root of rounding.
    difference: f64,
    /// Newton iterations of the solution for the error estimate.
    estimate_iterations: usize,
    /// Unit of the unknowns relative to the first motion. Motions grow towards a resonance, and
    /// the unknowns then stay of order one.
    unit_of_motion: f64,
}

impl Default for BranchSettings {
    fn default() -> Self {
        BranchSettings { harmonics: 15, difference: 1e-6, estimate_iterations: 30, unit_of_motion: 30.0 }
    }
}

/// Equations whose unknowns are the harmonics along the joints, relative to the size of the
/// first orbit.
pub(crate) struct BranchEquations<'a> {
    /// Returns the system and the excitation frequency (rad/s) for a value of the parameter.
    system_at: &'a dyn Fn(f64) -> (System, f64),
    system: Arc<System>,
    omega: f64,
    value: f64,
    range_length: f64,
    ports: Ports,
    around: Option<Ports>,
    dynamics: LinearDynamics,
    /// System to which `dynamics` belongs.
    receptance_of: Arc<System>,
    discretization: Discretization,
    /// Equations with twice the harmonics for the error estimate, unless they are too large.
    finer: Option<Discretization>,
    tolerance: f64,
    motion: HarmonicSolution,
    /// Unit of motions, m.
    length: f64,
    orbit_check: OrbitCheck,
    harmonic_set: HarmonicSet,
}

impl<'a> BranchEquations<'a> {
    /// Makes the equations for a range of the parameter that begins at `range.0`.
    pub fn new(
        at: &'a dyn Fn(f64) -> (System, f64),
        method: HarmonicBalance,
        range: (f64, f64),
    ) -> Result<Self, MethodError> {
        let settings = BranchSettings::default();
        let (system, omega) = at(range.0);
        let system = Arc::new(system);
        // a force that is zero at the first value may be nonzero later
        let harmonic_set = HarmonicSet::new(&system, |_| true);
        method.check(harmonic_set.highest)?;
        let top = method.harmonics.unwrap_or((settings.harmonics * harmonic_set.unit).max(harmonic_set.highest));
        let (ports, around) =
            Ports::for_sector(&system).map_err(|error| error.with_alternatives(alternatives(&system)))?;
        let dynamics = LinearDynamics::new(&system, &ports);
        let method = HarmonicBalance { harmonics: Some(top), ..method };
        let discretization = |top: usize| {
            Discretization::new(
                harmonic_set.up_to(top),
                method.samples_at(top, &ports, ports.has_steep()),
                &ports,
                None,
            )
            .with_matrix()
        };
        let harmonics = harmonic_set.up_to(top).len();
        check_memory(unbanded_memory(&ports, &dynamics, harmonics, true), &ports, harmonics, 1)?;
        let few = 2 * ports.count() * harmonic_set.up_to(harmonic_set.doubled(top)).len() <= MOST_ELIMINATED_UNKNOWNS;
        let (finer, discretization) = (few.then(|| discretization(harmonic_set.doubled(top))), discretization(top));
        let motion = HarmonicSolution::zero(discretization.linear.motion.len());
        Ok(BranchEquations {
            system_at: at,
            receptance_of: system.clone(),
            orbit_check: OrbitCheck::new(&system),
            system,
            omega,
            value: f64::NAN,
            range_length: (range.1 - range.0).abs(),
            ports,
            around,
            dynamics,
            discretization,
            finer,
            tolerance: method.tolerance.unwrap_or(TOLERANCE),
            motion,
            length: 1.0,
            harmonic_set,
        })
    }

    /// Updates all data that depend on the parameter.
    ///
    /// Returns false if the frequency is not positive, or if the joints or their kinds of law
    /// have changed, so that the unknowns differ. Returns false at a resonance without damping
    /// too.
    fn set_parameter(&mut self, value: f64) -> bool {
        if value == self.value {
            return true;
        }
        let (system, omega) = (self.system_at)(value);
        let system = Arc::new(system);
        match Ports::for_sector(&system) {
            Ok((found, around))
                if omega > 0.0
                    && found.wave() == self.ports.wave()
                    && found.len() == self.ports.len()
                    && found.iter().zip(self.ports.iter()).all(|(a, b)| a.is_like(b)) =>
            {
                (self.ports, self.around) = (found, around);
            }
            _ => return false,
        }
        let same = system.structure() == self.receptance_of.structure();
        if !same {
            self.dynamics = LinearDynamics::new(&system, &self.ports);
            self.receptance_of = system.clone();
        }
        if self.discretization.set_frequency(&system, &self.ports, &self.dynamics, omega).is_err() {
            return false;
        }
        if !same || self.system.joints() != system.joints() {
            self.orbit_check = OrbitCheck::new(&system);
        }
        (self.system, self.omega, self.value) = (system, omega, value);
        true
    }

    /// Returns the error for a search that did not converge.
    fn not_converged(&self, iterations: usize, residual: f64) -> OrbitError {
        OrbitError::not_converged(crate::method::harmonic_balance::NAME, self.omega, iterations, residual)
    }

    /// Finds the first point from the describing functions.
    pub fn start(&mut self, value: f64) -> Result<Vec<f64>, OrbitError> {
        let settings = BranchSettings::default();
        if !self.set_parameter(value) {
            return Err(OrbitError::Frequency { omega: self.omega });
        }
        // as for a single point: the initial guess solves the whole structure; large systems
        // start without friction
        let guess = (self.system.dofs() < DESCRIBING_DOFS).then(|| DescribingGuess::new(&self.system, self.omega));
        let start = self.discretization.initial_guess(&self.system, &self.ports, guess.as_ref(), self.omega);
        self.discretization.begin_point();
        let solved = self.discretization.solve(&self.ports, self.omega, start);
        self.motion = solved.map_err(|error| self.not_converged(error.iterations, error.residual))?;
        let norm = |c: &[Complex64]| c.iter().map(|c| c.norm_sqr()).sum::<f64>().sqrt();
        let size = norm(&self.motion.c).max(1e-3 * norm(&self.discretization.linear.motion));
        self.length = (settings.unit_of_motion * size).max(f64::MIN_POSITIVE);
        Ok(self.discretization.pack(&self.ports, &self.motion, self.length))
    }

    /// Returns the orbit of a point of the branch.
    pub fn orbit(&mut self, x: &[f64], value: f64) -> Option<Orbit> {
        let settings = BranchSettings::default();
        if !self.set_parameter(value) {
            return None;
        }
        self.discretization.unpack(&self.ports, x, self.length, &mut self.motion);
        self.discretization.begin_point();
        self.discretization.newton_from(&self.ports, self.omega, &mut self.motion, 10).ok()?;
        let places = postprocess::places(&mut self.discretization, &self.dynamics, self.omega, &self.motion).ok()?;
        let truncation = self.finer.as_mut().and_then(|finer| {
            finer.set_frequency(&self.system, &self.ports, &self.dynamics, self.omega).ok()?;
            let mut motion = with_harmonics(&self.motion, self.discretization.harmonics(), finer.harmonics());
            // Newton's method alone: a search would find another branch near a turning point
            finer.begin_point();
            finer.newton_from(&self.ports, self.omega, &mut motion, settings.estimate_iterations).ok()?;
            let better = postprocess::places(finer, &self.dynamics, self.omega, &motion).ok()?;
            let coarse =
                ComparedSolution { harmonics: self.discretization.harmonics(), places: &places, along: &self.motion.c };
            let steep =
                self.ports.has_steep() || self.discretization.states_cross_within_sample(&self.ports, &self.motion);
            let at = (self.harmonic_set, self.omega, steep);
            Some(truncation_error(
                self.system.place_axes(),
                &self.ports,
                &self.dynamics,
                at,
                &coarse,
                (finer, &motion, &better),
            ))
        });
        let setting = postprocess::OrbitInput {
            system: &self.system,
            ports: &self.ports,
            dynamics: &self.dynamics,
            ring_ports: self.around.as_ref(),
            omega: self.omega,
            excitation_harmonic: 1,
            half_period: self.harmonic_set.has_half_period_symmetry(),
            truncation,
            tolerance: self.tolerance,
            orbit_check: Some(&mut self.orbit_check),
        };
        postprocess::orbit(setting, &mut self.discretization, &self.motion, places)
            .filter(|orbit| postprocess::energies_balance(&self.system, orbit))
    }

    /// Returns the orbit at `value` that the solver finds from the nearby point `x`.
    pub fn orbit_near(&mut self, x: &[f64], value: f64) -> Option<Orbit> {
        let mut x = x.to_vec();
        self.jump_kink(&mut x, value).then(|| self.orbit(&x, value))?
    }
}

impl ParametricEquations for BranchEquations<'_> {
    fn size(&self) -> usize {
        2 * self.motion.c.len()
    }

    fn tolerance(&self) -> f64 {
        let settings = BranchSettings::default();
        crate::method::harmonic_balance::equations::homotopy::RESIDUAL_TOLERANCE / settings.unit_of_motion
    }

    fn evaluate(&mut self, x: &[f64], p: f64, f: &mut [f64], by_x: &mut [f64], by_p: &mut [f64]) -> bool {
        let settings = BranchSettings::default();
        if !p.is_finite() || x.iter().any(|x| !x.is_finite()) {
            return false;
        }
        let step = settings.difference * p.abs().max(self.range_length);
        for (sign, at) in [(1.0, p + step), (-1.0, p - step)] {
            if !self.set_parameter(at) {
                return false;
            }
            self.discretization.residual_at(&self.ports, self.omega, (x, self.length), &mut self.motion, f, None);
            for (d, r) in by_p.iter_mut().zip(f.iter()) {
                *d = if sign > 0.0 { *r } else { (*d - *r) / (2.0 * step) };
            }
        }
        if !self.set_parameter(p) {
            return false;
        }
        self.discretization.residual_at(&self.ports, self.omega, (x, self.length), &mut self.motion, f, Some(by_x));
        true
    }

    fn jump_kink(&mut self, x: &mut [f64], p: f64) -> bool {
        if !self.set_parameter(p) {
            return false;
        }
        let mut start = self.motion.clone();
        self.discretization.unpack(&self.ports, x, self.length, &mut start);
        self.discretization.begin_point();
        let Ok(motion) = self.discretization.solve(&self.ports, self.omega, start) else { return false };
        self.motion = motion;
        x.copy_from_slice(&self.discretization.pack(&self.ports, &self.motion, self.length));
        true
    }
}
