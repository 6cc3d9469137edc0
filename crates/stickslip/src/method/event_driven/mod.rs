//! The exact event-driven method: closed-form motion between switches, which are zeros of
//! analytic signals.
//!
//! - `mechanics`: the system as masses, springs, ideal sliders and stops
//! - `pattern`: the linear motion in one pattern of stick and slip, open and closed
//! - `pattern_cache`: cache of patterns with a memory limit
//! - `transition`: transition to the next pattern at a switch
//! - `segments`: segments joined at the switches, with exact sensitivities
//! - `postprocess`: results of an orbit from its segments
//! - `cost_model`: cost estimate of an orbit
//! - `settings`: tolerances and limits
//!
//! Newton's method on the return map finds the periodic orbit. If the excitation has only odd
//! harmonics, the solver uses the half period `x(t + T/2) = -x(t)`. This halves the work, and
//! the map stays regular if a joint sticks for the whole period.

mod cost_model;
mod mechanics;
mod pattern;
mod pattern_cache;
mod postprocess;
mod segments;
mod settings;
mod transition;

pub use cost_model::orbit_work;
use mechanics::PartKind;
pub(crate) use mechanics::{Mechanics, supports};
pub(crate) use postprocess::ExactPath;
pub(crate) use segments::SegmentedMotion;
pub(crate) use settings::EventDrivenSettings;
use settings::NAME;

use super::flow::excitation::HarmonicExcitation;
use super::options::{PERIOD, periods};
use super::orbit_search::cold_restart::ColdRestart;
use super::orbit_search::describing_guess::DescribingGuess;
use super::orbit_search::residual_traction::{ElasticSlider, OrbitMap, select_equilibrium_orbit};
use super::orbit_search::return_map::{ClosedState, ClosingMethod, ClosingTargets, ReturnMap, iterate_map};
use super::orbit_search::vibration_share;
use super::static_equilibrium::{StaticEquilibrium, states_at};
use super::{Budget, IntegrationError, Method, MethodError, MethodInfo, OrbitError, Request, Solver};
use crate::model::System;
use crate::orbit::{Orbit, Symmetry};
use nalgebra::DMatrix;
use std::sync::Arc;
use stickslip_numerics::eigen;

/// The entry of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "exact: closed-form motion between switches, Newton's method on the period",
    options: &[PERIOD],
    build: |options| match periods(NAME, options)? {
        1 => Ok(Box::new(EventDriven)),
        period => Ok(Box::new(SubharmonicEventDriven { period })),
    },
};

/// The exact event-driven method.
///
/// # Example
/// ```
/// use stickslip::method::{Method, event_driven::EventDriven};
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let orbit = EventDriven.solver(&system).unwrap().orbit(std::f64::consts::TAU * 121.25).unwrap();
/// assert!((orbit.place("blade1").unwrap().amplitude() - 0.0489246).abs() < 1e-6);
/// assert!(orbit.evidence.energy_gap < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EventDriven;

impl Method for EventDriven {
    fn name(&self) -> &'static str {
        NAME
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        Ok(Box::new(ExactSolver::new(system, NAME, ClosingMethod::Newton, 1)?))
    }
}

/// The exact method for orbits that repeat after several periods of the excitation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SubharmonicEventDriven {
    /// Number of periods of the excitation after which the orbit repeats.
    pub period: usize,
}

impl Method for SubharmonicEventDriven {
    fn name(&self) -> &'static str {
        NAME
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        Ok(Box::new(ColdRestart(ExactSolver::new(system, NAME, ClosingMethod::Newton, self.period)?)))
    }
}

/// Solver for orbits by exact motion, with Newton's method or by waiting.
pub(crate) struct ExactSolver<'a> {
    system: &'a System,
    /// The system, shared with the returned orbits.
    shared: Arc<System>,
    /// Name of the calling method.
    name: &'static str,
    search: ClosingMethod,
    flow: SegmentedMotion,
    weights: Vec<f64>,
    duration: f64,
    /// Number of periods of the excitation after which the orbit repeats.
    periods: usize,
    contracts: bool,
    /// Static equilibrium as the initial guess; `None` without constant loads.
    equilibrium: Option<StaticEquilibrium>,
}

impl ReturnMap for ExactSolver<'_> {
    fn apply(&mut self, state: &mut [f64], derivative: Option<&mut DMatrix<f64>>) -> Result<(), IntegrationError> {
        self.flow.run(state, 0.0, self.duration, derivative)
    }
    fn weights(&self) -> &[f64] {
        &self.weights
    }
}

impl OrbitMap for ExactSolver<'_> {
    fn springs(&self) -> Vec<ElasticSlider> {
        let mechanics = &self.flow.mechanics;
        let springs = mechanics.parts.iter().filter_map(|part| match part.kind {
            PartKind::Elastic { stiffness, limit, state } => {
                Some(ElasticSlider { joint: part.joint, state: 2 * mechanics.n + state, stiffness, limit })
            }
            _ => None,
        });
        springs.collect()
    }
    fn limit(&mut self, springs: &[ElasticSlider]) {
        let mut springs = springs.iter();
        let mechanics = &mut self.flow.mechanics;
        let mut parts = mechanics.parts.to_vec();
        for part in &mut parts {
            if let PartKind::Elastic { limit, .. } = &mut part.kind
                && let Some(spring) = springs.next()
            {
                *limit = spring.limit;
            }
        }
        mechanics.parts = parts.into();
    }
    /// Creates the orbit from the segments of the last run, which started from the converged
    /// state.
    fn finish(&mut self, closed: ClosedState) -> Result<Orbit, OrbitError> {
        let omega = self.flow.excitation.omega;
        let symmetry = self.search.symmetry(self.system, self.periods);
        let (at, closed) = ((omega, self.periods), (closed, self.weights.as_slice()));
        let orbit = postprocess::orbit(&self.shared, self.contracts, &self.flow, at, symmetry, closed)
            .map_err(|cause| OrbitError::Breakdown { method: self.name, omega, cause })?;
        Ok(Orbit { method: self.name, ..orbit })
    }
}

impl<'a> ExactSolver<'a> {
    /// Creates a solver for a system.
    ///
    /// # Errors
    /// See [`Mechanics::new`].
    pub fn new(
        system: &'a System,
        name: &'static str,
        search: ClosingMethod,
        periods: usize,
    ) -> Result<Self, MethodError> {
        let mechanics = Mechanics::new(system, name)?;
        let weights = vec![1.0; mechanics.states()];
        let flow = SegmentedMotion::new(mechanics, HarmonicExcitation::default());
        Ok(ExactSolver {
            system,
            shared: Arc::new(system.clone()),
            name,
            search,
            flow,
            weights,
            duration: 0.0,
            periods,
            contracts: system.is_incrementally_stable(),
            equilibrium: StaticEquilibrium::under_load(system),
        })
    }

    /// Returns whether only friction balances the constant forces.
    fn is_held_by_friction(&self) -> bool {
        let settings = EventDrivenSettings::default();
        let (mechanics, force) = (&self.flow.mechanics, &self.flow.excitation.constant);
        if force.amax() == 0.0 || mechanics.parts.iter().any(|part| !part.is_slider()) {
            return false;
        }
        let at_rest = eigen::svd(mechanics.stiffness.clone())
            .and_then(|svd| svd.solve(force, settings.support * svd.singular_values.amax()).ok());
        at_rest.is_some_and(|x| (force - &mechanics.stiffness * x).amax() > settings.support * force.amax())
    }

    /// Runs a search and returns its orbit.
    fn search(
        &mut self,
        start: Option<&[f64]>,
        search: ClosingMethod,
        aim: ClosingTargets,
    ) -> Result<Orbit, OrbitError> {
        let ClosingTargets { method, omega, .. } = aim;
        let closed = match search.find(self, start, |exact| exact.first_state(omega), aim) {
            Err(OrbitError::NotConverged { .. } | OrbitError::Unsettled { .. }) if self.is_held_by_friction() => {
                // the friction forces depend on the history, so that a guess does not contain
                // their mean; start from rest
                let rest = vec![0.0; self.weights.len()];
                let near = iterate_map(self, rest, aim.sign);
                search.close(self, &near, aim).map_err(|_| OrbitError::drift(method, omega))?
            }
            found => found?,
        };
        self.finish(closed)
    }

    fn first_state(&self, omega: f64) -> Vec<f64> {
        let mechanics = &self.flow.mechanics;
        let guess = DescribingGuess::new(self.system, omega);
        let mut state = guess.state(mechanics.n);
        let count = mechanics.states() - state.len();
        let states = states_at(self.equilibrium.as_ref(), self.system, &state[..mechanics.n], count);
        state.extend(states);
        state
    }
}

impl Solver for ExactSolver<'_> {
    fn solve(&mut self, request: &Request<'_>, _budget: &mut Budget) -> Result<Orbit, OrbitError> {
        let settings = EventDrivenSettings::default();
        let (omega, start) = (request.omega, request.seed.map(|seed| &seed.state[..]));
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        let excitation = HarmonicExcitation::new(self.system, &self.flow.mechanics.part_joints(), omega);
        self.flow.set_excitation(excitation);
        self.weights = self.flow.mechanics.weights(omega);
        let symmetry = self.search.symmetry(self.system, self.periods);
        let (sign, share) = if symmetry == Symmetry::HalfPeriod { (-1.0, 0.5) } else { (1.0, 1.0) };
        self.duration = share * self.periods as f64 * std::f64::consts::TAU / omega;
        let (name, search) = (self.name, self.search);
        let rest = settings.rest_fraction * self.flow.energy_scale;
        let aim = ClosingTargets {
            method: name,
            omega,
            residual: settings.residual,
            distance: settings.refinement_distance,
            sign,
            rest,
        };
        let near;
        let known = start.filter(|state| state.len() == self.weights.len());
        let start = if self.periods > 1 && search == ClosingMethod::Newton && known.is_none() {
            let first = self.first_state(omega);
            near = iterate_map(self, first, sign);
            Some(near.as_slice())
        } else {
            known
        };
        let mut orbit = self.search(start, search, aim)?;
        if search == ClosingMethod::Newton {
            let system = self.system;
            let equilibrium = self.equilibrium.clone();
            orbit = select_equilibrium_orbit(self, (system, equilibrium.as_ref()), orbit, aim);
        } else {
            // only a waiting search must know the amplitude of the vibration; closed forms are
            // accurate to all digits
            let broke = |cause| OrbitError::Breakdown { method: name, omega, cause };
            let (mut taken, at) = (1.0, (symmetry, orbit.period()));
            let share = |exact: &Self, orbit: &Orbit| {
                vibration_share::fraction(orbit.path.as_ref(), at, &orbit.initial_state, (&exact.weights, aim.rest))
            };
            while let Some(share) = vibration_share::next_fraction(taken, share(self, &orbit)).map_err(broke)? {
                taken = share;
                orbit = self.search(Some(&orbit.initial_state), search.of_share(share), aim)?;
            }
        }
        // an estimated distance from the settled motion causes a proportional energy gap
        let allowed = settings.energy_gap + settings.gap_per_distance * orbit.evidence.error_estimate.unwrap_or(0.0);
        if orbit.evidence.energy_gap > allowed {
            return Err(OrbitError::Evidence { method: name, omega, energy_gap: orbit.evidence.energy_gap });
        }
        Ok(orbit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Coulomb;
    use crate::method::Seed;
    use crate::method::transient::Transient;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, example};

    /// At 8 N the return starts in stick, but that of the adjacent frequency's state starts in
    /// slip. One Newton step crosses the kink between them. The orbit is the same from below,
    /// from above and without an initial guess.
    #[test]
    fn orbits_do_not_depend_on_the_initial_guess() {
        let mut model = example::blade_couple();
        model.joints[0].law = Arc::new(Coulomb { limit: 8.0 });
        let system = model.assemble().unwrap();
        let mut solver = EventDriven.solver(&system).unwrap();
        let mut orbit =
            |hertz: f64, seed: Option<&Seed>| solver.orbit_near(std::f64::consts::TAU * hertz, seed).unwrap();
        let cold = orbit(121.0, None);
        for neighbour in [120.9875, 121.0125] {
            let seed = orbit(neighbour, None).seed();
            let warm = orbit(121.0, Some(&seed));
            assert!(warm.evidence.iterations <= 5, "{} iterations from {neighbour} Hz", warm.evidence.iterations);
            for (one, other) in warm.places.iter().zip(&cold.places) {
                let apart = (one.amplitude() / other.amplitude() - 1.0).abs();
                assert!(apart < 6e-11, "{}: {apart:.1e} from {neighbour} Hz", one.name);
            }
        }
    }

    /// An undamped resonance with a force above the slip limit but below `4/π` of it. The mass
    /// slips a little in each half period with a bounded amplitude: 0.1618 mm, as in an
    /// independent time integration from rest with small steps.
    ///
    /// The amplitude of the linear guess is arbitrary here. If friction cannot bound the
    /// motion, no orbit exists, even if a return changes such a large motion only slightly.
    #[test]
    fn friction_holds_an_undamped_resonance() {
        let between = || ["m".to_owned(), GROUND.to_owned()];
        let system = |limit: f64| {
            let model = Model {
                masses: vec![Mass::new("m", 1.0)],
                springs: vec![Spring { between: between(), stiffness: 1e3, damping: 0.0 }],
                joints: vec![Joint { name: "j".into(), between: between(), law: Arc::new(Coulomb { limit }) }],
                forces: vec![Force { on: "m".into(), amplitude: 5.0, phase: 0.0, harmonic: 1 }],
                ..Model::default()
            };
            model.assemble().unwrap()
        };
        let (held, let_go) = (system(4.5), system(1.0));
        for omega in [1000f64.sqrt(), 31.622_77, 31.62] {
            let waits = Transient::default();
            for method in [&EventDriven as &dyn Method, &waits] {
                let orbit = method.solver(&held).unwrap().orbit(omega);
                let amplitude = orbit.unwrap_or_else(|error| panic!("{omega}: {error}")).places[0].amplitude();
                assert!((amplitude / 1.618e-4 - 1.0).abs() < 1e-3, "{omega}: {amplitude}");
            }
        }
        for method in [&EventDriven as &dyn Method, &Transient { periods: 200, ..Transient::default() }] {
            assert!(method.solver(&let_go).unwrap().orbit(1000f64.sqrt()).is_err(), "{}", method.name());
        }
    }

    /// A mass of 1 kg on 10 N/mm with friction of 1 N, excited near its resonance, and a second
    /// mass. `ends` are the places of a second rigid joint.
    fn with_another(mass: f64, ends: [&str; 2], stiffness: f64) -> Model {
        let joint = |name: &str, between: [&str; 2], limit| Joint {
            name: name.into(),
            between: between.map(String::from),
            law: Arc::new(Coulomb { limit }),
        };
        let spring = |on: &str, stiffness, damping| Spring { between: [on.into(), GROUND.into()], stiffness, damping };
        Model {
            masses: vec![Mass::new("a", 1.0), Mass::new("b", mass)],
            springs: vec![spring("a", 1e4, 2.0), spring("b", stiffness, 0.0)],
            joints: vec![joint("j1", ["a", ends[0]], 1.0), joint("j2", ["b", ends[1]], 2.0)],
            forces: vec![Force { on: "a".into(), amplitude: 3.0, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        }
    }

    /// The threshold for zero acceleration of a joint depends on its own masses: an uncoupled
    /// body, however light, changes nothing.
    #[test]
    fn uncoupled_light_body_changes_no_orbit() {
        let amplitude = |mass: f64| {
            let system = with_another(mass, [GROUND, GROUND], 1e4).assemble().unwrap();
            let orbit = EventDriven.solver(&system).unwrap().orbit(std::f64::consts::TAU * 16.0).unwrap();
            orbit.places[0].amplitude()
        };
        let alone = amplitude(1.0);
        for mass in [1e-6, 1e-9, 1e-12, 1e-15] {
            assert!((amplitude(mass) / alone - 1.0).abs() < 1e-9, "{mass}: {} and {alone}", amplitude(mass));
        }
    }

    /// The weaker of two rigid joints in series slips. The method solves this as long as
    /// the inertia between them has significant digits, and rejects it otherwise.
    #[test]
    fn light_mass_between_joints_is_solved_or_rejected() {
        let orbit = |mass: f64| -> Result<f64, String> {
            let system = with_another(mass, ["b", GROUND], 0.0).assemble().unwrap();
            let mut solver = EventDriven.solver(&system).map_err(|error| error.to_string())?;
            let orbit = solver.orbit(std::f64::consts::TAU * 16.0).map_err(|error| error.to_string())?;
            Ok(orbit.places[0].amplitude())
        };
        let system = with_another(1.0, [GROUND, GROUND], 1e4).assemble().unwrap();
        let alone = EventDriven.solver(&system).unwrap().orbit(std::f64::consts::TAU * 16.0).unwrap();
        for mass in [1e-3, 1e-6, 1.1e-8] {
            let found = orbit(mass).unwrap();
            assert!((found / alone.places[0].amplitude() - 1.0).abs() < 1e-9, "{mass}: {found}");
        }
        for mass in [0.9e-8, 1e-12, 1e-15] {
            let refused = orbit(mass).unwrap_err();
            assert!(
                refused.contains("cannot resolve the inertia of `b`") && refused.contains("joint `j1`"),
                "{refused}"
            );
        }
    }

    /// A load whose peak exceeds the slip limit shifts a mass on rigid friction until a spring
    /// carries the excess. The mass creeps to that position at a decreasing rate, and the orbit
    /// sticks between `(peak - limit) / k` and `(trough + limit) / k`.
    #[test]
    fn creeping_mass_ends_in_stick() {
        let (stiffness, limit) = (1e4, 3.7);
        for (damping, excess, omega) in [(0.5, 1e-3, 20.0), (5.0, 0.06, 64.0), (13.0, 0.3, 95.0), (50.0, 1.0, 150.0)] {
            for (constant, phase) in [(1.46, 0.0), (1.46, 0.7), (1.2, 2.5)] {
                let peak = limit + excess;
                let between = || ["m".to_owned(), GROUND.to_owned()];
                let force = |amplitude: f64, harmonic: u32| Force { on: "m".into(), amplitude, phase, harmonic };
                let model = Model {
                    masses: vec![Mass::new("m", 1.0)],
                    springs: vec![Spring { between: between(), stiffness, damping }],
                    joints: vec![Joint { name: "j".into(), between: between(), law: Arc::new(Coulomb { limit }) }],
                    forces: vec![Force { phase: 0.0, ..force(constant, 0) }, force(peak - constant, 1)],
                    ..Model::default()
                };
                let orbit = EventDriven.solver(&model.assemble().unwrap()).unwrap().orbit(omega);
                let orbit = orbit.unwrap_or_else(|error| panic!("{damping} {excess} {omega} {constant}: {error}"));
                let place = &orbit.places[0];
                let stuck = excess / stiffness..(2.0 * constant - excess) / stiffness;
                assert!(place.amplitude() < 1e-15 && stuck.contains(&place.mean), "{place:?} {stuck:?}");
            }
        }
    }

    /// Without damper and joint, no work is done over a period, so that an energy gap relative
    /// to the work would be rounding. The orbits converge nevertheless, up to a relative
    /// distance of 1e-7 from the resonance, where mode and excitation form a resonant pair.
    /// Their amplitude is `F / |k - m ω²|`, at any phase.
    #[test]
    fn undamped_orbits_have_no_energy_gap() {
        let (mass, stiffness, amplitude) = (0.182, 105_103.0, 10.0);
        let model = Model {
            masses: vec![Mass::new("m", mass)],
            springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness, damping: 0.0 }],
            forces: vec![Force { on: "m".into(), amplitude, phase: 0.3, harmonic: 1 }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let mut solver = EventDriven.solver(&system).unwrap();
        let natural = f64::sqrt(stiffness / mass);
        for exponent in 1..=28 {
            for sign in [-1.0, 1.0] {
                let omega = natural * (1.0 + sign * 10f64.powf(-0.25 * f64::from(exponent)));
                let orbit = solver.orbit(omega).unwrap_or_else(|error| panic!("{omega}: {error}"));
                let expected = amplitude / (stiffness - mass * omega * omega).abs();
                let error = (orbit.places[0].amplitude() / expected - 1.0).abs();
                // cancellation in the denominator loses as many digits as the relative distance
                // to the resonance
                assert!(error < 1e-14 * 10f64.powf(0.25 * f64::from(exponent)) * 100.0, "{omega}: {error:e}");
                assert!(
                    orbit.evidence.energy_gap < EventDrivenSettings::default().energy_gap,
                    "{omega}: {:e}",
                    orbit.evidence.energy_gap
                );
            }
        }
    }
}
