//! Newton's method on the return map: the state that comes back to itself after a period, or to its mirror image after half.
//!
//! Friction only dissipates, so the return map `R` does not increase the energy distance of two motions and `I - R` is monotone.
//! Newton's method uses its exact derivative; where the map has kinks and the step does not help, iterating the map itself
//! (letting the transient die) always comes closer, and Newton goes on from there.

use super::{Breakdown, OrbitError};
use crate::model::System;
use crate::orbit::Symmetry;
use nalgebra::{DMatrix, DVector};
use std::collections::VecDeque;
use stickslip_numerics::eigen;

/// A flow that can be returned.
pub(crate) trait ReturnMap {
    /// Replaces `state` by its return, and `derivative` by that of the return with respect to the state.
    fn returned(&mut self, state: &mut [f64], derivative: Option<&mut DMatrix<f64>>) -> Result<(), Breakdown>;
    /// Weights of the energy norm, one per state.
    fn weights(&self) -> &[f64];
    /// Tells it that the last return changed the state by `change`, relative; infinite before the first. Who chooses steps anew in every return
    /// errs otherwise in each, so that a motion may go round in what steps do, for ever: when it moves by no more, it must go in the same steps.
    fn moves(&mut self, _change: f64) {}
}

/// What the iteration aims at, and how long it may take.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Aim {
    /// Name, for errors.
    pub method: &'static str,
    /// Drive frequency, rad/s.
    pub omega: f64,
    /// Residual relative to the state at which the orbit is closed.
    pub residual: f64,
    /// Estimated distance to the orbit, relative to the state, above which a closed one is brought nearer by one more step.
    pub distance: f64,
    /// +1: the return is the state; -1: its mirror image.
    pub sign: f64,
    /// Energy norm below which a state counts as rest, √J: residuals are relative to the state or to this.
    pub rest: f64,
}

/// A closed orbit.
#[derive(Debug)]
pub(crate) struct Closed {
    pub state: Vec<f64>,
    /// The state less what returns.
    pub gap: DVector<f64>,
    /// Derivative of the return map (with its sign as it is, not mirrored).
    pub derivative: DMatrix<f64>,
    pub residual: f64,
    pub iterations: usize,
    /// Estimated distance to the orbit relative to the state, where the search stopped before it was at rounding.
    pub missing: Option<f64>,
}

/// How the state that returns to itself is looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Search {
    /// Newton's method.
    Newton,
    /// Waiting until the transient has died.
    Settle {
        /// Estimated distance to the orbit, relative to the state, at which it counts as dead.
        tolerance: f64,
        /// Returns after which the search is given up.
        returns: usize,
    },
}

impl Search {
    /// The return that is closed. A stuck contact keeps its offset, which half a period would mirror for ever: who waits, waits for whole periods.
    pub fn symmetry(self, system: &System, periods: usize) -> Symmetry {
        match self {
            Search::Newton => Symmetry::of(system, periods),
            Search::Settle { .. } => Symmetry::FullPeriod,
        }
    }

    /// The search of a vibration that has this share of the size of its states.
    pub fn of_share(self, share: f64) -> Search {
        match self {
            Search::Newton => Search::Newton,
            Search::Settle { tolerance, returns } => Search::Settle { tolerance: share * tolerance, returns },
        }
    }

    /// From the state of a neighbouring orbit if there is one of the right length and it leads anywhere, else from a first guess, and from rest where
    /// that is far beyond what the loads do and leads nowhere: a resonance that friction holds does not get there.
    pub fn find<M: ReturnMap>(
        self,
        map: &mut M,
        neighbour: Option<&[f64]>,
        guess: impl FnOnce(&M) -> Vec<f64>,
        aim: Aim,
    ) -> Result<Closed, OrbitError> {
        let states = map.weights().len();
        if let Some(start) = neighbour.filter(|state| state.len() == states)
            && let Ok(closed) = self.close(map, start, aim)
        {
            return Ok(closed);
        }
        let first = guess(map);
        let found = self.close(map, &first, aim);
        let far = aim.rest > 0.0 && norm(map.weights(), &first) > FAR * aim.rest;
        match found {
            Err(error) if far => self.close(map, &vec![0.0; states], aim).map_err(|_| error),
            found => found,
        }
    }

    /// From `start` to the closed orbit.
    pub fn close(self, map: &mut dyn ReturnMap, start: &[f64], aim: Aim) -> Result<Closed, OrbitError> {
        match self {
            Search::Newton => close(map, start, aim),
            Search::Settle { tolerance, returns } => settle(map, start, aim, tolerance, returns),
        }
    }
}

/// Returns by which a motion comes near an orbit that repeats after several periods, before Newton's method begins: it would find one that
/// repeats after one period first.
pub(crate) const APPROACH: usize = 60;

/// The state to which one comes by itself after a while.
pub(crate) fn approached(map: &mut dyn ReturnMap, mut state: Vec<f64>, sign: f64) -> Vec<f64> {
    for _ in 0..APPROACH {
        let mut next = state.clone();
        if map.returned(&mut next, None).is_err() || next.iter().any(|z| !z.is_finite()) {
            break;
        }
        state = next.iter().map(|z| sign * z).collect();
    }
    state
}

/// Returns over which the rate of decay is measured: beats of neighbouring modes average out.
const DECAY_WINDOW: usize = 256;
/// The first, short window, and by how much windows grow: who has died early is not waited for. Beats do not average out over it, so that the
/// derivative of the return is asked too.
const FIRST_WINDOW: usize = 8;

/// Iterates the return map. "The period changed by little" proves nothing where a motion creeps: with the decay rate `ρ` per return, measured
/// over a window, a change `d` leaves about `d ρ / (1 - ρ)` to go, and that is what must be small. Windows grow up to [`DECAY_WINDOW`]; what a
/// shorter one says must also be what the derivative of the return says, which knows of beats and of creeping.
fn settle(
    map: &mut dyn ReturnMap,
    start: &[f64],
    aim: Aim,
    tolerance: f64,
    returns: usize,
) -> Result<Closed, OrbitError> {
    let broke = |cause| OrbitError::Breakdown { method: aim.method, omega: aim.omega, cause };
    let n = start.len();
    let mut state = start.to_vec();
    let mut changes = Vec::new(); // of every return, relative to the state
    let mut last_states = VecDeque::with_capacity(MOST_REPEATS + 1);
    let mut hopeless = 0;
    let mut smallest = f64::INFINITY;
    map.moves(f64::INFINITY);
    for count in 1..=returns {
        let before = state.clone();
        map.returned(&mut state, None).map_err(broke)?;
        state.iter_mut().for_each(|z| *z *= aim.sign);
        if state.iter().any(|z| !z.is_finite()) {
            return Err(broke(Breakdown::Unbounded { time: f64::INFINITY, place: None }));
        }
        let change: Vec<f64> = state.iter().zip(&before).map(|(a, b)| a - b).collect();
        let size = norm(map.weights(), &state).max(aim.rest).max(f64::MIN_POSITIVE);
        let residual = norm(map.weights(), &change) / size;
        if residual.is_nan() {
            return Err(broke(Breakdown::OutOfRange { time: 0.0 })); // no later return has a size either
        }
        if too_large(size, aim) {
            return Err(OrbitError::not_converged(aim.method, aim.omega, count, 1.0));
        }
        map.moves(residual);
        smallest = f64::min(smallest, residual);
        changes.push(residual);
        last_states.push_front(before);
        last_states.truncate(MOST_REPEATS);
        if count >= PATIENCE && count.is_power_of_two() {
            let distance = |earlier: &Vec<f64>| {
                let apart: Vec<f64> = state.iter().zip(earlier).map(|(a, b)| a - aim.sign * b).collect();
                norm(map.weights(), &apart) / size
            };
            // the first of them is one return ago
            let repeats = last_states.iter().position(|earlier| distance(earlier) <= REPEATS * residual);
            let needed = returns_needed(&changes, tolerance);
            hopeless = if needed <= (returns - count) as f64 { 0 } else { hopeless + 1 };
            if residual > tolerance && (repeats.is_some() || hopeless == HOPELESS) {
                let (method, omega) = (aim.method, aim.omega);
                let repeats = repeats.map(|back| back + 1);
                return Err(OrbitError::Unsettled {
                    method,
                    omega,
                    returns: count,
                    change: residual,
                    repeats,
                    needed: Some(count as f64 + needed).filter(|needed| needed.is_finite()),
                    instead: String::new(),
                });
            }
        }
        let Some(window) = window(count) else { continue };
        let of = |last: usize| changes[count - last - window..count - last].iter().sum::<f64>();
        let (earlier, last) = (of(window), of(0));
        // the decay of a whole window; all later windows together move the state by a geometric series of this one
        let decay: f64 = if earlier > 0.0 { last / earlier } else { 0.0 };
        let mut missing = if decay < 1.0 { last * decay / (1.0 - decay) } else { f64::INFINITY };
        let at_rounding = last <= window as f64 * ROUNDING;
        if !at_rounding && (missing.is_nan() || missing > tolerance) {
            continue;
        }
        let mut derivative = DMatrix::identity(n, n);
        let gap = evaluate(map, &state, aim, &mut derivative).map_err(broke)?;
        if window < DECAY_WINDOW && !at_rounding {
            let to_go = newton_step(&derivative, &gap, aim.sign, map.weights());
            missing = missing.max(norm(map.weights(), to_go.as_slice()) / size);
            if missing.is_nan() || missing > tolerance {
                continue;
            }
        }
        let residual = norm(map.weights(), gap.as_slice()) / size;
        let missing = if at_rounding { ROUNDING } else { missing };
        return Ok(Closed { state, gap, derivative, residual, iterations: count, missing: Some(missing) });
    }
    Err(OrbitError::not_converged(aim.method, aim.omega, returns, smallest))
}

/// The window over which the decay is measured after so many returns: half of them while they are few, and then every [`DECAY_WINDOW`].
fn window(count: usize) -> Option<usize> {
    if count >= 2 * DECAY_WINDOW {
        return count.is_multiple_of(DECAY_WINDOW).then_some(DECAY_WINDOW);
    }
    count.is_multiple_of(2 * FIRST_WINDOW).then_some(count / 2)
}

/// Returns after which it is first asked whether the motion settles at all, and then whenever they have doubled. It must look hopeless so many
/// times in a row: beats of neighbouring modes rise and fall, and do not over windows that grow.
const PATIENCE: usize = 1024;
const HOPELESS: usize = 3;
/// Returns that are looked at for a motion that repeats after several, and share of the change of one return below which it does.
const MOST_REPEATS: usize = 8;
const REPEATS: f64 = 1e-3;

/// Returns after which a motion reaches the tolerance if its changes go on to fall as they fell over the last half of all
/// returns; infinite where they did not fall.
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

/// A change per return below this is rounding.
const ROUNDING: f64 = 1e-14;

/// Newton iterations in all; a warm start takes 2 to 4, a cold one 5 to 15.
const ITERATIONS: usize = 60;
/// Times that the transient is let die before the search is given up.
const RESCUES: usize = 6;
/// Halvings of a Newton step before the transient is let die instead.
const HALVINGS: i32 = 4;
/// Returns by which the transient dies between Newton attempts.
const RETURNS: usize = 40;
/// A state this many times larger than rest (10^7 times what the loads do statically) is no orbit that could be checked.
const LARGEST: f64 = 1e10;
/// A first guess this many times larger than rest (10^3 times what the loads do statically) may be a resonance that friction does not let happen.
const FAR: f64 = 1e6;

/// Whether a state is so large that the work of the loads drowns in rounding, and a return changes nothing of it: an undamped resonance.
fn too_large(size: f64, aim: Aim) -> bool {
    aim.rest > 0.0 && size > LARGEST * aim.rest
}
/// A step must leave at most this share of the residual.
const DECREASE: f64 = 0.95;
/// Singular values below this fraction of the largest belong to the continuum of stick offsets.
const CONTINUUM: f64 = 1e-10;

/// Newton's method, and where it comes no further, letting the transient die before the next attempt.
pub(crate) fn close(map: &mut dyn ReturnMap, start: &[f64], aim: Aim) -> Result<Closed, OrbitError> {
    let broke = |cause| OrbitError::Breakdown { method: aim.method, omega: aim.omega, cause };
    let (mut iterations, mut smallest, mut returns) = (0, f64::INFINITY, RETURNS);
    let mut state = start.to_vec();
    for rescue in 0..=RESCUES {
        let end = descended(map, &state, aim, Beyond::Shortens, &mut iterations)?;
        if end.residual <= aim.residual {
            return nearer(map, end, aim);
        }
        smallest = smallest.min(end.residual);
        if rescue == RESCUES || iterations >= ITERATIONS {
            break;
        }
        state = end.state;
        for _ in 0..returns {
            map.returned(&mut state, None).map_err(broke)?;
            state.iter_mut().for_each(|z| *z *= aim.sign);
            if state.iter().any(|z| !z.is_finite()) {
                return Err(broke(Breakdown::Unbounded { time: f64::INFINITY, place: None }));
            }
        }
        returns = returns * 3 / 2;
    }
    Err(OrbitError::not_converged(aim.method, aim.omega, iterations, smallest))
}

/// A closed orbit with one more step where its estimated distance to the orbit asks for it: near a resonance residuals are a small share of that, and
/// curves would go with the way on which they were closed.
fn nearer(map: &mut dyn ReturnMap, closed: Closed, aim: Aim) -> Result<Closed, OrbitError> {
    if closed.residual <= ROUNDING || aim.distance == f64::INFINITY {
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
            return Ok(Closed { state, gap, derivative, residual, iterations: closed.iterations + 1, missing: None });
        }
    }
    // the last run is that of the closed state
    derivative.fill_with_identity();
    let broke = |cause| OrbitError::Breakdown { method: aim.method, omega: aim.omega, cause };
    evaluate(map, &closed.state, aim, &mut derivative).map_err(broke)?;
    Ok(closed)
}

/// What one whole step may multiply the residual by: beyond a kink the next one mostly arrives, where shortened ones would creep up to it. Where
/// shortened steps have success the residual of the whole ones grows to less than twice.
const WILD: f64 = 3.0;

/// Share of the residual that a whole step leaves before a double root: a quarter where the distance is halved, a third where the period begins in slip.
/// Such a root is the edge of a continuum of stick offsets: a motion that creeps towards it slips by the square of what is missing, so that the residual
/// is at rounding where half of the digits are, and what slip is left fails the energy balance.
const HALVES: std::ops::Range<f64> = 0.2..0.4;
/// After two such steps in a row, how many of them are taken at once: two to the root, and a little on to where the contact sticks. What returns from
/// there is at rest.
const ONTO: f64 = 2.125;
/// Share of the residual that this must leave at most: a contact that sticks leaves nothing, one that slips on the other side some thousandths.
const MOSTLY: f64 = 1e-3;

/// What is done where a whole step multiplies the residual by more than [`WILD`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Beyond {
    /// The step is shortened.
    Shortens,
    /// The search ends: steps of an integration that jump over the layers of a law, so that its derivative means nothing.
    Ends,
}

/// Steps of Newton's method, shortened where they do not help, until the orbit is closed, no step leaves less of the residual, one goes too far for
/// `beyond`, or `iterations` have been used up: how far it came. One whole step may multiply the residual by [`WILD`].
pub(crate) fn descended(
    map: &mut dyn ReturnMap,
    start: &[f64],
    aim: Aim,
    beyond: Beyond,
    iterations: &mut usize,
) -> Result<Closed, OrbitError> {
    let n = start.len();
    let broke = |cause| OrbitError::Breakdown { method: aim.method, omega: aim.omega, cause };
    // a motion that is integrated may take for ever from where a bold step leads, unless the search ends there
    let (mut state, mut bold) = (start.to_vec(), beyond == Beyond::Ends || aim.distance.is_finite());
    let mut derivative = DMatrix::identity(n, n);
    let mut gap = evaluate(map, &state, aim, &mut derivative).map_err(broke)?;
    let mut left = None; // where the bold step began, until another has come nearer than that
    let mut shares = [1.0; 2]; // of the residual, which the last two steps left
    loop {
        *iterations += 1;
        let size = norm(map.weights(), &state).max(aim.rest).max(f64::MIN_POSITIVE);
        let before = norm(map.weights(), gap.as_slice());
        let residual = before / size;
        if residual.is_nan() {
            return Err(broke(Breakdown::OutOfRange { time: 0.0 }));
        }
        if too_large(size, aim) {
            return Err(OrbitError::not_converged(aim.method, aim.omega, *iterations, 1.0));
        }
        let mut accepted = false;
        if residual > aim.residual && *iterations < ITERATIONS {
            let step = newton_step(&derivative, &gap, aim.sign, map.weights());
            let onto = shares.iter().all(|share| HALVES.contains(share)).then_some((ONTO, MOSTLY));
            let shorter = (0..=HALVINGS).map(|halvings| (0.5f64.powi(halvings), DECREASE));
            for (fraction, enough) in onto.into_iter().chain(shorter) {
                let mut trial: Vec<f64> = state.iter().zip(step.iter()).map(|(z, d)| z + fraction * d).collect();
                if fraction > 1.0 {
                    if map.returned(&mut trial, None).is_err() {
                        continue;
                    }
                    trial.iter_mut().for_each(|z| *z *= aim.sign);
                }
                let mut trial_derivative = DMatrix::identity(n, n);
                if let Ok(trial_gap) = evaluate(map, &trial, aim, &mut trial_derivative) {
                    let after = norm(map.weights(), trial_gap.as_slice());
                    let less = after <= enough * before;
                    if less || (bold && fraction == 1.0 && after <= WILD * before) {
                        if !less {
                            (bold, left) = (false, Some((state, before, gap, derivative)));
                        } else if left.as_ref().is_some_and(|(_, least, ..)| after <= *least) {
                            left = None;
                        }
                        (state, gap, derivative) = (trial, trial_gap, trial_derivative);
                        shares = [shares[1], if fraction == 1.0 { after / before } else { 1.0 }];
                        accepted = true;
                        break;
                    }
                    if beyond == Beyond::Ends && fraction <= 1.0 && after > WILD * before {
                        break;
                    }
                }
            }
        }
        if !accepted {
            // a bold step that led nowhere is taken back
            if residual > aim.residual
                && *iterations < ITERATIONS
                && beyond == Beyond::Shortens
                && let Some((from, _, its_gap, its_derivative)) = left.take()
            {
                (state, gap, derivative) = (from, its_gap, its_derivative);
                continue;
            }
            return Ok(Closed { state, gap, derivative, residual, iterations: *iterations, missing: None });
        }
    }
}

/// `z - sign · R(z)`, with the derivative of R.
fn evaluate(
    map: &mut dyn ReturnMap,
    state: &[f64],
    aim: Aim,
    derivative: &mut DMatrix<f64>,
) -> Result<DVector<f64>, Breakdown> {
    let mut end = state.to_vec();
    map.returned(&mut end, Some(derivative))?;
    if end.iter().any(|z| !z.is_finite()) {
        return Err(Breakdown::Unbounded { time: f64::INFINITY, place: None });
    }
    Ok(DVector::from_iterator(state.len(), state.iter().zip(&end).map(|(z, e)| z - aim.sign * e)))
}

/// `-(I - sign · R')⁻¹ gap`; of least energy norm where the matrix is singular.
pub(crate) fn newton_step(derivative: &DMatrix<f64>, gap: &DVector<f64>, sign: f64, weights: &[f64]) -> DVector<f64> {
    let n = gap.len();
    // in energy coordinates, so that singular values and the least norm mean something
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
    let solution = if n > 0 && least > CONTINUUM * most {
        lu.solve(&right)
    } else {
        // numbers out of range have no least step: the transient is let die instead
        eigen::singular(scaled()).and_then(|svd| svd.solve(&right, CONTINUUM * svd.singular_values.amax()).ok())
    };
    let mut step = solution.unwrap_or_else(|| right.clone());
    for i in 0..n {
        step[i] /= weights[i];
    }
    step
}

/// Energy norm.
pub(crate) fn norm(weights: &[f64], vector: &[f64]) -> f64 {
    weights.iter().zip(vector).map(|(w, z)| (w * z) * (w * z)).sum::<f64>().sqrt()
}
