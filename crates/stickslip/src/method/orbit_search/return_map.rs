//! Newton's method on the return map: `z = R(z)` after one period, or `z = -R(z)` after half a
//! period.
//!
//! Friction only dissipates, so the return map `R` does not increase the energy distance of two
//! motions, and `I - R` is monotone. Newton's method uses the exact derivative of `R`. At kinks
//! of the map a Newton step may fail. The solver then iterates the map itself, which lets the
//! transient decay, and starts Newton's method again.

use crate::method::{IntegrationError, OrbitError};
use crate::model::System;
use crate::orbit::Symmetry;
use nalgebra::{DMatrix, DVector};
use std::collections::VecDeque;
use stickslip_numerics::eigen;

/// A map from a state to its state after one return.
pub(crate) trait ReturnMap {
    /// Replaces `state` by its return, and `derivative` by the derivative of the return by the
    /// state.
    fn apply(&mut self, state: &mut [f64], derivative: Option<&mut DMatrix<f64>>) -> Result<(), IntegrationError>;
    /// Returns the weights of the energy norm, one per state.
    fn weights(&self) -> &[f64];
    /// Reports the relative change of the state in the last return; infinite before the first.
    ///
    /// A flow that chooses new steps in every return has a different error in each, so the
    /// iteration may never settle. Once the change is as small as this error, the flow must
    /// keep its steps.
    fn report_change(&mut self, _change: f64) {}
}

/// Targets of the iteration.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClosingTargets {
    /// Name of the method, for errors.
    pub method: &'static str,
    /// Excitation frequency, rad/s.
    pub omega: f64,
    /// Residual, relative to the state, at which the orbit is closed.
    pub residual: f64,
    /// Estimated distance to the orbit, relative to the state, above which a closed orbit gets
    /// one more Newton step.
    pub distance: f64,
    /// +1 if the return equals the state, -1 if it equals its mirror image.
    pub sign: f64,
    /// Energy norm below which a state counts as at rest, √J. Residuals are relative to the
    /// larger of this and the norm of the state.
    pub rest: f64,
}

/// A closed orbit.
#[derive(Debug)]
pub(crate) struct ClosedState {
    pub state: Vec<f64>,
    /// The state minus its return.
    pub gap: DVector<f64>,
    /// Derivative of the return map, without the sign of the mirror image.
    pub derivative: DMatrix<f64>,
    pub residual: f64,
    pub iterations: usize,
    /// Estimated distance to the orbit, relative to the state, if the search stopped before
    /// rounding.
    pub distance: Option<f64>,
}

/// The algorithm that searches for the closed orbit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ClosingMethod {
    /// Newton's method.
    Newton,
    /// Iteration of the map until the transient has decayed.
    Settle {
        /// Estimated distance to the orbit, relative to the state, at which the transient
        /// counts as decayed.
        tolerance: f64,
        /// Most returns.
        returns: usize,
    },
}

impl ClosingMethod {
    /// Returns the symmetry of the return. A stuck contact keeps its offset, and half a period
    /// would mirror it in every return; iteration therefore uses whole periods.
    pub fn symmetry(self, system: &System, periods: usize) -> Symmetry {
        match self {
            ClosingMethod::Newton => Symmetry::of(system, periods),
            ClosingMethod::Settle { .. } => Symmetry::FullPeriod,
        }
    }

    /// Returns the search for a vibration that is this fraction of the size of its states.
    pub fn of_share(self, share: f64) -> ClosingMethod {
        match self {
            ClosingMethod::Newton => ClosingMethod::Newton,
            ClosingMethod::Settle { tolerance, returns } => {
                ClosingMethod::Settle { tolerance: share * tolerance, returns }
            }
        }
    }

    /// Searches from the neighbour's state if it has the right length, else or on failure from
    /// the initial guess. If that fails too and the guess is far beyond the response to the
    /// loads, searches from zero: friction may suppress the resonance of the guess.
    pub fn find<M: ReturnMap>(
        self,
        map: &mut M,
        neighbour: Option<&[f64]>,
        guess: impl FnOnce(&M) -> Vec<f64>,
        aim: ClosingTargets,
    ) -> Result<ClosedState, OrbitError> {
        let settings = ClosingSettings::default();
        let states = map.weights().len();
        if let Some(start) = neighbour.filter(|state| state.len() == states)
            && let Ok(closed) = self.close(map, start, aim)
        {
            return Ok(closed);
        }
        let first = guess(map);
        let found = self.close(map, &first, aim);
        let far = aim.rest > 0.0 && norm(map.weights(), &first) > settings.resonant_guess * aim.rest;
        match found {
            Err(error) if far => self.close(map, &vec![0.0; states], aim).map_err(|_| error),
            found => found,
        }
    }

    /// Closes the orbit from `start`.
    pub fn close(self, map: &mut dyn ReturnMap, start: &[f64], aim: ClosingTargets) -> Result<ClosedState, OrbitError> {
        match self {
            ClosingMethod::Newton => close(map, start, aim),
            ClosingMethod::Settle { tolerance, returns } => settle(map, start, aim, tolerance, returns),
        }
    }
}

/// Number of returns before Newton's method for an orbit of several periods. Newton's method
/// alone would first find an orbit of one period.
pub(crate) const APPROACH: usize = 60;

/// Iterates the map [`APPROACH`] times and returns the state.
pub(crate) fn iterate_map(map: &mut dyn ReturnMap, mut state: Vec<f64>, sign: f64) -> Vec<f64> {
    for _ in 0..APPROACH {
        let mut next = state.clone();
        if map.apply(&mut next, None).is_err() || next.iter().any(|z| !z.is_finite()) {
            break;
        }
        state = next.iter().map(|z| sign * z).collect();
    }
    state
}

/// Settings of the search that iterates the return map until the transient has decayed.
#[derive(Debug, Clone, Copy)]
struct SettlingSearchSettings {
    /// Most returns over which the decay is measured; beats of neighbouring modes average out.
    window: usize,
    /// The first window, so that a fast decay ends the search early. Beats do not average out over
    /// it, so the derivative of the return is checked too.
    first_window: usize,
    /// Number of returns before the first check for progress; later checks follow whenever it
    /// doubles. Beats of neighbouring modes rise and fall, but not over growing windows.
    first_progress_check: usize,
    /// Number of negative checks in a row after which the search fails.
    failed_checks: usize,
    /// Most periods of a repeating motion that the check detects.
    repeats: usize,
    /// Largest distance of two repetitions relative to the change of one return.
    repeat_distance: f64,
}

impl Default for SettlingSearchSettings {
    fn default() -> Self {
        SettlingSearchSettings {
            window: 256,
            first_window: 8,
            first_progress_check: 1024,
            failed_checks: 3,
            repeats: 8,
            repeat_distance: 1e-3,
        }
    }
}

/// Iterates the return map until the transient has decayed.
///
/// A small change per return proves nothing if the motion creeps. With the decay rate `ρ` per
/// return, measured over a window, a change `d` leaves a distance of about `d ρ / (1 - ρ)`.
/// This distance must be small. Windows grow up to [`SettlingSearchSettings::window`]. The estimate
/// of a shorter window must agree with that of the derivative of the return, which covers beats and
/// creep.
fn settle(
    map: &mut dyn ReturnMap,
    start: &[f64],
    aim: ClosingTargets,
    tolerance: f64,
    returns: usize,
) -> Result<ClosedState, OrbitError> {
    let settings = SettlingSearchSettings::default();
    let broke = |cause| OrbitError::Breakdown { method: aim.method, omega: aim.omega, cause };
    let n = start.len();
    let mut state = start.to_vec();
    // Change of the state in every return. If a motion grows steadily, its relative change falls.
    let mut changes = Vec::new();
    let mut last_states = VecDeque::with_capacity(settings.repeats + 1);
    let mut hopeless = 0;
    // A change per return below this value is rounding.
    let rounding = 1e-14;
    let mut smallest = f64::INFINITY;
    map.report_change(f64::INFINITY);
    for count in 1..=returns {
        let before = state.clone();
        map.apply(&mut state, None).map_err(broke)?;
        state.iter_mut().for_each(|z| *z *= aim.sign);
        if state.iter().any(|z| !z.is_finite()) {
            return Err(broke(IntegrationError::Unbounded { time: f64::INFINITY, place: None }));
        }
        let change: Vec<f64> = state.iter().zip(&before).map(|(a, b)| a - b).collect();
        let size = norm(map.weights(), &state).max(aim.rest).max(f64::MIN_POSITIVE);
        let changed = norm(map.weights(), &change);
        let residual = changed / size;
        if residual.is_nan() {
            // later returns have no size either
            return Err(broke(IntegrationError::OutOfRange { time: 0.0 }));
        }
        if too_large(size, aim) {
            return Err(OrbitError::not_converged(aim.method, aim.omega, count, 1.0));
        }
        map.report_change(residual);
        smallest = f64::min(smallest, residual);
        changes.push(changed);
        last_states.push_front(before);
        last_states.truncate(settings.repeats);
        if count >= settings.first_progress_check && count.is_power_of_two() {
            let distance = |earlier: &Vec<f64>| {
                let apart: Vec<f64> = state.iter().zip(earlier).map(|(a, b)| a - aim.sign * b).collect();
                norm(map.weights(), &apart) / size
            };
            // the first of these states is one return old
            let repeats =
                last_states.iter().position(|earlier| distance(earlier) <= settings.repeat_distance * residual);
            let needed = returns_needed(&changes, tolerance * size);
            hopeless = if needed <= (returns - count) as f64 { 0 } else { hopeless + 1 };
            if residual > tolerance && (repeats.is_some() || hopeless == settings.failed_checks) {
                let (method, omega) = (aim.method, aim.omega);
                let repeats = repeats.map(|back| back + 1);
                return Err(OrbitError::Unsettled {
                    method,
                    omega,
                    returns: count,
                    change: residual,
                    repeats,
                    needed: Some(count as f64 + needed).filter(|needed| needed.is_finite()),
                    advice: String::new(),
                });
            }
        }
        let Some(window) = window(count) else { continue };
        let of = |last: usize| changes[count - last - window..count - last].iter().sum::<f64>();
        let (earlier, last) = (of(window) / size, of(0) / size);
        // decay over a whole window; all later changes form a geometric series
        let decay: f64 = if earlier > 0.0 { last / earlier } else { 0.0 };
        let mut missing = if decay < 1.0 { last * decay / (1.0 - decay) } else { f64::INFINITY };
        let at_rounding = last <= window as f64 * rounding;
        if !at_rounding && (missing.is_nan() || missing > tolerance) {
            continue;
        }
        let mut derivative = DMatrix::identity(n, n);
        let gap = evaluate(map, &state, aim, &mut derivative).map_err(broke)?;
        if window < settings.window && !at_rounding {
            let to_go = newton_step(&derivative, &gap, aim.sign, map.weights());
            missing = missing.max(norm(map.weights(), to_go.as_slice()) / size);
            if missing.is_nan() || missing > tolerance {
                continue;
            }
        }
        let residual = norm(map.weights(), gap.as_slice()) / size;
        let missing = if at_rounding { rounding } else { missing };
        return Ok(ClosedState { state, gap, derivative, residual, iterations: count, distance: Some(missing) });
    }
    Err(OrbitError::not_converged(aim.method, aim.omega, returns, smallest))
}

/// Returns the window for the decay after this number of returns: half of them at first, then
/// [`SettlingSearchSettings::window`].
fn window(count: usize) -> Option<usize> {
    let settings = SettlingSearchSettings::default();
    if count >= 2 * settings.window {
        return count.is_multiple_of(settings.window).then_some(settings.window);
    }
    count.is_multiple_of(2 * settings.first_window).then_some(count / 2)
}

/// Returns the number of further returns until the remaining change is `tolerance`, if the changes
/// keep their decay over the last half of all returns. Infinite if they do not decay.
fn returns_needed(changes: &[f64], tolerance: f64) -> f64 {
    let window = changes.len() / 4;
    let of = |last: usize| changes[changes.len() - last - window..changes.len() - last].iter().sum::<f64>();
    let (earlier, last) = (of(window), of(0));
    if last == 0.0 {
        return 0.0;
    }
    let decay = last / earlier;
    if decay.is_nan() || decay >= 1.0 {
        return f64::INFINITY;
    }
    let missing = last * decay / (1.0 - decay);
    (window as f64 * (missing / tolerance).ln() / -decay.ln()).max(0.0)
}

/// Settings of Newton's method on the return map.
#[derive(Debug, Clone)]
struct ClosingSettings {
    /// Most Newton iterations. A search takes 2 to 4 with a warm start and 5 to 15 without.
    iterations: usize,
    /// Most phases of iterating the map before the search fails.
    decay_phases: usize,
    /// Most halvings of a Newton step before a phase of iterating the map.
    halvings: i32,
    /// Number of returns in the first phase; each later phase is longer by half.
    returns: usize,
    /// A state larger than rest by this factor (10^7 times the static response) cannot be checked.
    largest: f64,
    /// An initial guess larger than rest by this factor (10^3 times the static response) may be a
    /// resonance that friction suppresses.
    resonant_guess: f64,
    /// A Newton step must leave at most this fraction of the residual.
    decrease: f64,
    /// Singular values below this fraction of the largest belong to the continuum of stick
    /// offsets.
    continuum: f64,
    /// Largest factor by which one full step may increase the residual. Beyond a kink the next
    /// step mostly converges, where shortened steps would creep up to the kink. Where shortened
    /// steps succeed, the full steps increase the residual less than twofold.
    largest_increase: f64,
    /// Range of the residual ratio of a full step near a double root: 1/4 where the distance
    /// halves, 1/3 where the period begins in slip.
    ///
    /// Such a root is the edge of a continuum of stick offsets. A motion that creeps towards it
    /// slips by the square of its distance. The residual reaches rounding when only half of the
    /// digits are correct, and the remaining slip fails the energy balance.
    double_root_ratio: std::ops::Range<f64>,
    /// Number of full steps taken at once after two such steps in a row: two lead to the root, the
    /// rest into the range where the contact sticks. The return from there is at rest.
    double_root_step: f64,
    /// Largest ratio of the residuals after and before this step. A stuck contact leaves no
    /// residual; a contact that slips on the other side leaves some thousandths.
    double_root_decrease: f64,
}

impl Default for ClosingSettings {
    fn default() -> Self {
        ClosingSettings {
            iterations: 60,
            decay_phases: 6,
            halvings: 4,
            returns: 40,
            largest: 1e10,
            resonant_guess: 1e6,
            decrease: 0.95,
            continuum: 1e-10,
            largest_increase: 3.0,
            double_root_ratio: 0.2..0.4,
            double_root_step: 2.125,
            double_root_decrease: 1e-3,
        }
    }
}

/// Returns true if the state of an undamped resonance is so large that the work of the loads is
/// lost in rounding.
fn too_large(size: f64, aim: ClosingTargets) -> bool {
    let settings = ClosingSettings::default();
    aim.rest > 0.0 && size > settings.largest * aim.rest
}

/// Closes an orbit by Newton's method. Where it stalls, lets the transient decay before the
/// next attempt.
pub(crate) fn close(map: &mut dyn ReturnMap, start: &[f64], aim: ClosingTargets) -> Result<ClosedState, OrbitError> {
    let settings = ClosingSettings::default();
    let broke = |cause| OrbitError::Breakdown { method: aim.method, omega: aim.omega, cause };
    let (mut iterations, mut smallest, mut returns) = (0, f64::INFINITY, settings.returns);
    let mut state = start.to_vec();
    for rescue in 0..=settings.decay_phases {
        let end = newton_with_line_search(map, &state, aim, LargeIncrease::Shortens, &mut iterations)?;
        if end.residual <= aim.residual {
            return polish(map, end, aim);
        }
        smallest = smallest.min(end.residual);
        if rescue == settings.decay_phases || iterations >= settings.iterations {
            break;
        }
        state = end.state;
        for _ in 0..returns {
            map.apply(&mut state, None).map_err(broke)?;
            state.iter_mut().for_each(|z| *z *= aim.sign);
            if state.iter().any(|z| !z.is_finite()) {
                return Err(broke(IntegrationError::Unbounded { time: f64::INFINITY, place: None }));
            }
        }
        returns = returns * 3 / 2;
    }
    Err(OrbitError::not_converged(aim.method, aim.omega, iterations, smallest))
}

/// Adds one Newton step to a closed orbit if its estimated distance to the orbit exceeds
/// `aim.distance`.
///
/// Near a resonance the residual is a small fraction of that distance, and the result would
/// depend on the path of the iteration.
fn polish(map: &mut dyn ReturnMap, closed: ClosedState, aim: ClosingTargets) -> Result<ClosedState, OrbitError> {
    // A residual below 1e-14 is rounding.
    if closed.residual <= 1e-14 || aim.distance == f64::INFINITY {
        return Ok(closed);
    }
    let step = newton_step(&closed.derivative, &closed.gap, aim.sign, map.weights());
    let size = |map: &dyn ReturnMap, state: &[f64]| norm(map.weights(), state).max(aim.rest).max(f64::MIN_POSITIVE);
    if norm(map.weights(), step.as_slice()) <= aim.distance * size(map, &closed.state) {
        return Ok(closed);
    }
    let state: Vec<f64> = closed.state.iter().zip(step.iter()).map(|(z, d)| z + d).collect();
    let mut derivative = DMatrix::identity(state.len(), state.len());
    if let Ok(gap) = evaluate(map, &state, aim, &mut derivative) {
        let residual = norm(map.weights(), gap.as_slice()) / size(map, &state);
        if residual <= closed.residual {
            return Ok(ClosedState {
                state,
                gap,
                derivative,
                residual,
                iterations: closed.iterations + 1,
                distance: None,
            });
        }
    }
    // the last run must be that of the closed state
    derivative.fill_with_identity();
    let broke = |cause| OrbitError::Breakdown { method: aim.method, omega: aim.omega, cause };
    evaluate(map, &closed.state, aim, &mut derivative).map_err(broke)?;
    Ok(closed)
}

/// Reaction to a full step that increases the residual by more than
/// [`ClosingSettings::largest_increase`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LargeIncrease {
    /// The solver shortens the step.
    Shortens,
    /// The search ends. The integration steps jump over the layers of a law, so the derivative
    /// is meaningless.
    Ends,
}

/// Takes Newton steps, shortened where they fail, and returns the last state.
///
/// It stops when the orbit is closed, when no step reduces the residual enough, when a step
/// goes too far for `beyond`, or after [`ClosingSettings::iterations`]. One full step may increase
/// the residual by [`ClosingSettings::largest_increase`].
pub(crate) fn newton_with_line_search(
    map: &mut dyn ReturnMap,
    start: &[f64],
    aim: ClosingTargets,
    beyond: LargeIncrease,
    iterations: &mut usize,
) -> Result<ClosedState, OrbitError> {
    let settings = ClosingSettings::default();
    let n = start.len();
    let broke = |cause| OrbitError::Breakdown { method: aim.method, omega: aim.omega, cause };
    // a single increase is allowed only for cheap maps: an integration may take forever from a
    // remote state
    let (mut state, mut may_increase) = (start.to_vec(), beyond == LargeIncrease::Ends || aim.distance.is_finite());
    let mut derivative = DMatrix::identity(n, n);
    let mut gap = evaluate(map, &state, aim, &mut derivative).map_err(broke)?;
    let mut before_increase = None; // state before the single increase, until the residual is below that again
    let mut shares = [1.0; 2]; // residual ratios of the last two steps
    loop {
        *iterations += 1;
        let size = norm(map.weights(), &state).max(aim.rest).max(f64::MIN_POSITIVE);
        let before = norm(map.weights(), gap.as_slice());
        let residual = before / size;
        if residual.is_nan() {
            return Err(broke(IntegrationError::OutOfRange { time: 0.0 }));
        }
        if too_large(size, aim) {
            return Err(OrbitError::not_converged(aim.method, aim.omega, *iterations, 1.0));
        }
        let mut accepted = false;
        if residual > aim.residual && *iterations < settings.iterations {
            let step = newton_step(&derivative, &gap, aim.sign, map.weights());
            let onto = shares
                .iter()
                .all(|share| settings.double_root_ratio.contains(share))
                .then_some((settings.double_root_step, settings.double_root_decrease));
            let shorter = (0..=settings.halvings).map(|halvings| (0.5f64.powi(halvings), settings.decrease));
            for (fraction, enough) in onto.into_iter().chain(shorter) {
                let mut trial: Vec<f64> = state.iter().zip(step.iter()).map(|(z, d)| z + fraction * d).collect();
                if fraction > 1.0 {
                    if map.apply(&mut trial, None).is_err() {
                        continue;
                    }
                    trial.iter_mut().for_each(|z| *z *= aim.sign);
                }
                let mut trial_derivative = DMatrix::identity(n, n);
                if let Ok(trial_gap) = evaluate(map, &trial, aim, &mut trial_derivative) {
                    let after = norm(map.weights(), trial_gap.as_slice());
                    let less = after <= enough * before;
                    if less || (may_increase && fraction == 1.0 && after <= settings.largest_increase * before) {
                        if !less {
                            (may_increase, before_increase) = (false, Some((state, before, gap, derivative)));
                        } else if before_increase.as_ref().is_some_and(|(_, least, ..)| after <= *least) {
                            before_increase = None;
                        }
                        (state, gap, derivative) = (trial, trial_gap, trial_derivative);
                        shares = [shares[1], if fraction == 1.0 { after / before } else { 1.0 }];
                        accepted = true;
                        break;
                    }
                    if beyond == LargeIncrease::Ends && fraction <= 1.0 && after > settings.largest_increase * before {
                        break;
                    }
                }
            }
        }
        if !accepted {
            // undo the single increase, since no later step improved on it
            if residual > aim.residual
                && *iterations < settings.iterations
                && beyond == LargeIncrease::Shortens
                && let Some((from, _, its_gap, its_derivative)) = before_increase.take()
            {
                (state, gap, derivative) = (from, its_gap, its_derivative);
                continue;
            }
            return Ok(ClosedState { state, gap, derivative, residual, iterations: *iterations, distance: None });
        }
    }
}

/// Returns `z - sign · R(z)` and the derivative of R.
fn evaluate(
    map: &mut dyn ReturnMap,
    state: &[f64],
    aim: ClosingTargets,
    derivative: &mut DMatrix<f64>,
) -> Result<DVector<f64>, IntegrationError> {
    let mut end = state.to_vec();
    map.apply(&mut end, Some(derivative))?;
    if end.iter().any(|z| !z.is_finite()) {
        return Err(IntegrationError::Unbounded { time: f64::INFINITY, place: None });
    }
    Ok(DVector::from_iterator(state.len(), state.iter().zip(&end).map(|(z, e)| z - aim.sign * e)))
}

/// Returns `-(I - sign · R')⁻¹ gap`, of least energy norm if the matrix is singular.
pub(crate) fn newton_step(derivative: &DMatrix<f64>, gap: &DVector<f64>, sign: f64, weights: &[f64]) -> DVector<f64> {
    let settings = ClosingSettings::default();
    let n = gap.len();
    // energy coordinates give the singular values and the least norm a meaning
    let scaled = || {
        DMatrix::from_fn(n, n, |i, j| {
            let identity = if i == j { 1.0 } else { 0.0 };
            weights[i] * (identity - sign * derivative[(i, j)]) / weights[j]
        })
    };
    let right = DVector::from_fn(n, |i, _| -weights[i] * gap[i]);
    let lu = scaled().lu();
    let pivots = || (0..n).map(|i| lu.lu_internal()[(i, i)].abs());
    let (least, most) = (pivots().fold(f64::INFINITY, f64::min), pivots().fold(0.0, f64::max));
    let solution = if n > 0 && least > settings.continuum * most {
        lu.solve(&right)
    } else {
        // values out of range have no singular value decomposition; the step is then one
        // iteration of the map
        eigen::svd(scaled()).and_then(|svd| svd.solve(&right, settings.continuum * svd.singular_values.amax()).ok())
    };
    let mut step = solution.unwrap_or_else(|| right.clone());
    for i in 0..n {
        step[i] /= weights[i];
    }
    step
}

/// Returns the energy norm.
pub(crate) fn norm(weights: &[f64], vector: &[f64]) -> f64 {
    weights.iter().zip(vector).map(|(w, z)| (w * z) * (w * z)).sum::<f64>().sqrt()
}
