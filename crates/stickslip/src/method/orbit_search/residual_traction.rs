//! Choice of one orbit from a continuum: permanently stuck sliders keep their static
//! equilibrium.
//!
//! Consider a slider behind a spring that does not slip over the whole period:
//! `kt (u_max - u_min) <= 2 limit`. It keeps the place `o` at which its spring is relaxed. The
//! return map then has a multiplier of one, and every possible `o` has its own orbit. If the
//! motion is its own mirror image, `o` is zero. Otherwise the mean depends on `o`; with a gap
//! or another law of position, so does the whole motion.
//!
//! All methods choose `o = u_s - f_s/kt` of static equilibrium
//! ([`crate::method::static_equilibrium`]), or the nearest place that respects the limit.
//! Harmonic balance finds this orbit directly. Newton's method on a return map may find any orbit
//! of the continuum. This file replaces the rows of such sliders by `z = kt (u - o)` and iterates
//! `o`.

use super::return_map::{ClosedState, ClosingTargets, ReturnMap, close};
use crate::method::OrbitError;
use crate::method::static_equilibrium::StaticEquilibrium;
use crate::model::System;
use crate::orbit::{IntegrationError, Orbit, Symmetry};
use nalgebra::{DMatrix, DVector};
use stickslip_numerics::eigen;

/// Settings of the iteration for the relaxed places.
#[derive(Debug, Clone, Copy)]
struct ResidualTractionSettings {
    /// Most rounds of the iteration. One or two are enough without gaps, a few more with gaps.
    rounds: usize,
    /// Tolerance on the force of a spring, in slip limits: 100 times the residual of orbits in
    /// equal steps.
    tolerance: f64,
    /// Most earlier rounds for the extrapolation; more are useless with few gaps that open and
    /// close.
    look_back: usize,
    /// Differences between rounds below this fraction of the largest count as zero.
    equal: f64,
    /// Factor on the limit of a held slider, which may pass its limit during the iteration.
    limit_factor: f64,
}

impl Default for ResidualTractionSettings {
    fn default() -> Self {
        ResidualTractionSettings { rounds: 40, tolerance: 1e-8, look_back: 4, equal: 1e-8, limit_factor: 1e3 }
    }
}

/// A slider in series with a spring, in a flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ElasticSlider {
    pub joint: usize,
    /// Index of its force in the state of the flow.
    pub state: usize,
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Slip limit, N.
    pub limit: f64,
}

/// A slider that is held for the whole period, and the place of its relaxed spring.
#[derive(Debug, Clone)]
struct HeldSlider {
    spring: ElasticSlider,
    /// Projection of the displacements onto the joint's axis.
    direction: DVector<f64>,
    /// Displacement of the relaxed spring minus the imposed motion at t = 0, m.
    place: f64,
}

impl HeldSlider {
    fn force(&self, state: &[f64]) -> f64 {
        let along: f64 = self.direction.iter().zip(state).map(|(w, x)| w * x).sum();
        self.spring.stiffness * (along - self.place)
    }
}

/// A return map with held sliders: their forces follow from the given places instead of the
/// return.
struct HeldMap<'m> {
    map: &'m mut dyn OrbitMap,
    pins: &'m [HeldSlider],
    /// Derivative of the last return without the held sliders.
    own: DMatrix<f64>,
}

impl ReturnMap for HeldMap<'_> {
    fn apply(&mut self, state: &mut [f64], mut derivative: Option<&mut DMatrix<f64>>) -> Result<(), IntegrationError> {
        let forces: Vec<f64> = self.pins.iter().map(|pin| pin.force(state)).collect();
        self.map.apply(state, derivative.as_deref_mut())?;
        if let Some(derivative) = derivative.as_deref() {
            self.own.copy_from(derivative);
        }
        for (pin, force) in self.pins.iter().zip(forces) {
            let row = pin.spring.state;
            state[row] = force;
            if let Some(derivative) = derivative.as_deref_mut() {
                derivative.row_mut(row).fill(0.0);
                for (i, w) in pin.direction.iter().enumerate() {
                    derivative[(row, i)] = pin.spring.stiffness * w;
                }
            }
        }
        Ok(())
    }
    fn weights(&self) -> &[f64] {
        self.map.weights()
    }
}

/// A return map that can make orbits from closed states.
pub(crate) trait OrbitMap: ReturnMap {
    /// Returns its sliders in series with springs.
    fn springs(&self) -> Vec<ElasticSlider>;
    /// Sets the limits of the sliders to those in `springs`, which lists all of
    /// [`OrbitMap::springs`].
    fn limit(&mut self, springs: &[ElasticSlider]);
    /// Makes the orbit of the last closed state.
    fn finish(&mut self, closed: ClosedState) -> Result<Orbit, OrbitError>;
}

/// Returns the orbit of the continuum around `first` in which held sliders keep their static
/// equilibrium, or are unloaded without one. Closes it with the same targets.
///
/// Returns `first` if it is a single orbit, or if both iterations fail.
pub(crate) fn select_equilibrium_orbit(
    map: &mut dyn OrbitMap,
    (system, equilibrium): (&System, Option<&StaticEquilibrium>),
    first: Orbit,
    aim: ClosingTargets,
) -> Orbit {
    // `history_dependent` does not decide: at the end of the continuum, rounding can make a held
    // slider slip
    if first.symmetry == Symmetry::HalfPeriod {
        return first;
    }
    let springs = map.springs();
    let places: Vec<f64> = springs.iter().map(|spring| place(system, equilibrium, spring)).collect();
    // if the search ended far from static equilibrium, its places can alternate
    let found = [FirstPlaces::Limited, FirstPlaces::Unlimited]
        .into_iter()
        .find_map(|begin| iterate(map, system, &first, (&springs, &places, begin), aim));
    map.limit(&springs);
    found.unwrap_or(first)
}

/// Places at which the iteration begins.
#[derive(Clone, Copy, PartialEq)]
enum FirstPlaces {
    /// Those of static equilibrium, moved as far as the limits require in the orbit that was found.
    Limited,
    /// Those of static equilibrium.
    Unlimited,
}

fn iterate(
    map: &mut dyn OrbitMap,
    system: &System,
    first: &Orbit,
    (springs, equilibrium, begin): (&[ElasticSlider], &[f64], FirstPlaces),
    aim: ClosingTargets,
) -> Option<Orbit> {
    let settings = ResidualTractionSettings::default();
    let (mut orbit, mut rounds) = (first.clone(), AndersonHistory::default());
    for round in 0..settings.rounds {
        let held = held(&orbit, springs, equilibrium);
        if held
            .iter()
            .all(|slider| slider.gap().abs() <= settings.tolerance * slider.spring.limit / slider.spring.stiffness)
        {
            return Some(orbit);
        }
        let places = if round == 0 && begin == FirstPlaces::Unlimited {
            DVector::from_iterator(held.len(), held.iter().map(|slider| slider.equilibrium))
        } else {
            rounds.next(&held)
        };
        let pins: Vec<HeldSlider> = held
            .iter()
            .zip(&places)
            .map(|(slider, place)| {
                let direction = system.joints()[slider.spring.joint].axes()[0].dense(system.dofs());
                let imposed =
                    slider.begin - direction.iter().zip(&orbit.initial_state).map(|(w, x)| w * x).sum::<f64>();
                HeldSlider { spring: slider.spring, direction, place: place - imposed }
            })
            .collect();
        let mut state = orbit.initial_state.clone();
        pins.iter().for_each(|pin| state[pin.spring.state] = pin.force(&orbit.initial_state));
        let mut limits = springs.to_vec();
        for spring in &mut limits {
            if pins.iter().any(|pin| pin.spring.state == spring.state) {
                spring.limit *= settings.limit_factor;
            }
        }
        map.limit(&limits);
        let own = DMatrix::zeros(state.len(), state.len());
        let mut pinned = HeldMap { map: &mut *map, pins: &pins, own };
        let closed = close(&mut pinned, &state, aim).ok()?;
        let derivative = pinned.own;
        let iterations = orbit.evidence.iterations + closed.iterations;
        let missing = orbit.evidence.error_estimate;
        orbit = map.finish(ClosedState { iterations, distance: missing, derivative, ..closed }).ok()?;
    }
    None
}

/// A slider that is held in an orbit.
struct StuckSlider {
    spring: ElasticSlider,
    /// Relative displacement at t = 0, m.
    begin: f64,
    /// Displacement of the relaxed spring in static equilibrium, m.
    equilibrium: f64,
    /// Actual displacement of the relaxed spring, m.
    actual: f64,
    /// Required displacement of the relaxed spring, m.
    required: f64,
}

impl StuckSlider {
    fn gap(&self) -> f64 {
        self.required - self.actual
    }
}

/// Returns the displacement of the relaxed spring of a slider in static equilibrium, m.
fn place(system: &System, equilibrium: Option<&StaticEquilibrium>, spring: &ElasticSlider) -> f64 {
    let Some(known) = equilibrium else { return 0.0 };
    let axis = &system.joints()[spring.joint].axes()[0];
    let displacement = axis.component(known.displacement()) + axis.imposed_at(0).re;
    let force = known.joint_states().get(spring.state - 2 * system.dofs()).copied().unwrap_or(0.0);
    displacement - force / spring.stiffness
}

fn held(orbit: &Orbit, springs: &[ElasticSlider], equilibrium: &[f64]) -> Vec<StuckSlider> {
    let settings = ResidualTractionSettings::default();
    let begin = orbit.sample(0.0);
    springs
        .iter()
        .zip(equilibrium)
        .filter_map(|(&spring, place)| {
            let (low, high) = orbit.joints[spring.joint].displacement[0];
            let reach = spring.limit / spring.stiffness;
            if high - low > 2.0 * reach {
                return None;
            }
            // rounding makes a slider slip that is exactly at its limit
            let reach = (reach * (1.0 - 2.0 * settings.tolerance)).max(0.5 * (high - low));
            let begin = begin.joints[spring.joint].displacement[0];
            let is = begin - orbit.initial_state[spring.state] / spring.stiffness;
            let required = place.max(high - reach).min(low + reach);
            Some(StuckSlider { spring, begin, equilibrium: *place, actual: is, required })
        })
        .collect()
}

/// Places and gaps of the rounds in which the same sliders are held.
#[derive(Default)]
struct AndersonHistory {
    states: Vec<usize>,
    places: Vec<DVector<f64>>,
    gaps: Vec<DVector<f64>>,
}

impl AndersonHistory {
    /// Returns the next places: those at which a linear map through the last rounds has no gap.
    ///
    /// Source: Walker and Ni (2011), "Anderson acceleration for fixed-point iterations".
    fn next(&mut self, held: &[StuckSlider]) -> DVector<f64> {
        let settings = ResidualTractionSettings::default();
        let states: Vec<usize> = held.iter().map(|slider| slider.spring.state).collect();
        if states != self.states {
            *self = AndersonHistory { states, ..AndersonHistory::default() };
        }
        let place = DVector::from_iterator(held.len(), held.iter().map(|slider| slider.actual));
        let gap = DVector::from_iterator(held.len(), held.iter().map(StuckSlider::gap));
        let mut next = &place + &gap;
        let count = self.places.len();
        if count > 0 {
            let back = count.min(settings.look_back);
            let column = |list: &[DVector<f64>], now: &DVector<f64>, k: usize| now - &list[count - 1 - k];
            let gaps = DMatrix::from_columns(&(0..back).map(|k| column(&self.gaps, &gap, k)).collect::<Vec<_>>());
            let moved = DMatrix::from_columns(&(0..back).map(|k| column(&self.places, &place, k)).collect::<Vec<_>>());
            let share = eigen::svd(gaps.clone())
                .and_then(|svd| svd.solve(&gap, settings.equal * svd.singular_values.amax()).ok());
            if let Some(share) = share {
                next -= (moved + gaps) * share;
            }
        }
        self.places.push(place);
        self.gaps.push(gap);
        next
    }
}
