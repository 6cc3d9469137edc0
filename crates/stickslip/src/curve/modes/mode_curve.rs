//! Arc-length continuation of a nonlinear mode from large amplitudes, and evaluation of its
//! motions.

use crate::method::harmonic_balance::{LinearMode, ModeArc, ModeEquations, ModeState, ModeStep};
use std::convert::Infallible;
use stickslip_numerics::golden_section::golden_section;

/// A part of the curve that turns back. Below `at`, the motion does not continue the motion at
/// `at`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurningPart {
    /// Modal amplitude below which the motion is a different one, m √kg.
    pub amplitude: f64,
    /// Modal amplitude to which the curve returns before it falls, m √kg. Several motions exist
    /// between both amplitudes.
    pub return_amplitude: f64,
}

/// The end of a mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModeEnd {
    /// Modal amplitude of the last motion, m √kg.
    pub at: f64,
    /// Cause of the end.
    pub reason: ModeEndCause,
}

/// Cause of the end of a mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ModeEndCause {
    /// The structure without joints has no such mode, or its frequency is zero.
    #[error("no motion was found near the linear mode without joints, or this mode has zero frequency")]
    NoStart,
    /// The curve turned and returned to amplitudes at which friction is negligible.
    #[error(
        "its curve turns there and returns to large amplitudes: it coalesces with another mode and does not exist below"
    )]
    Merged,
    /// The curve turned and did not return to smaller amplitudes.
    #[error("its curve turns there and has not returned to smaller amplitudes after 1000 steps; try fewer harmonics")]
    Turned,
    /// The corrector fails even at the smallest step size.
    #[error("the continuation found no neighbouring motion; try more harmonics")]
    Stalled,
    /// The damping ratio exceeds ten over many steps.
    #[error("its damping ratio exceeds ten there (overdamped), and the continuation stops; choose larger amplitudes")]
    Overdamped,
    /// The branch from small amplitudes ends there, and no branch from large amplitudes was
    /// found.
    #[error(
        "the branch from small amplitudes ends there (overdamped, or no neighbouring motion was found), and at large \
         amplitudes no motion was found either"
    )]
    FromSmallAmplitudes,
    /// Laws with internal states exceeded their work limit.
    #[error(
        "the continuation reached its work limit, because the internal states of a law change very fast there; choose other amplitudes"
    )]
    WorkLimit,
    /// The maximum number of steps is reached.
    #[error("the continuation did not reach the end within 4000 steps; try fewer harmonics")]
    StepLimit,
}
/// Ratio of friction to the forces of the linear mode at which the continuation begins.
/// Frequency and damping of the linear mode are then accurate to this ratio.
const FRICTION_RATIO: f64 = 1e-4;
/// Ratio of friction to the difference from the nearest mode at which the continuation begins.
/// The linear shape is then accurate to one percent.
const SEPARATION_RATIO: f64 = 1e-2;
/// Factors on the initial amplitude, tried in this order if Newton's method does not converge
/// from the linear mode. This happens if a joint hardly moves in the linear mode: friction alone
/// then determines its motion and the phase of its force.
const START_FACTORS: [f64; 7] = [1.0, 0.1, 0.01, 1e-3, 10.0, 100.0, 1e4];
/// Maximum number of steps, including rejected ones. The blade couples take about 100, internal
/// resonances some hundreds.
const MAX_STEPS: usize = 4000;
/// Maximum number of steps without a new smallest amplitude. The curve then runs in a loop, or
/// follows another mode.
const MAX_STEPS_WITHOUT_PROGRESS: usize = 1000;
/// Damping ratio above which a motion counts as overdamped, ten times critical damping.
const OVERDAMPED: f64 = 10.0;
/// Work limit of overdamped motions: harmonics times samples, summed over the steps; about two
/// seconds. Following rigid friction down to a nanometre would take thousands of expensive steps
/// without a useful result.
const OVERDAMPED_WORK: usize = 8_000_000;
/// Work limit of laws with memory, in steps of the law; about ten seconds. A curve of one joint
/// takes a few million.
const MEMORY_WORK: usize = 4_000_000;
/// Longest step in arc length, see [`ModeEquations::step`]. It changes the amplitude by up to a
/// half, or the shape by a fifth.
const MAX_STEP: f64 = 0.2;
/// First step, also after a leap.
const INITIAL_STEP: f64 = 0.02;
/// A step below this is rounding: the curve ends.
const MIN_STEP: f64 = 1e-7;
/// Steps below this may pass a corner. The curve has kinks at the points at which a sampled
/// joint begins to slip.
const CORNER: f64 = 1e-3;
/// Largest distance of a solution from the predictor, relative to such a step: a corner of up to
/// 79 degrees.
const MAX_CORNER: f64 = 5.0;
/// Arc length over which the curve may jump. A sampled force is discontinuous if its reversal
/// moves to another sample. Measured: 1e-6.
const GAP: f64 = 1e-5;
/// Smallest cosine between the tangents at both ends of a step.
const MIN_TANGENT_COSINE: f64 = 0.9;
/// Largest distance of a solution from the predictor, relative to the step.
const MAX_PREDICTOR_ERROR: f64 = 0.5;
/// Smallest modal assurance criterion between neighbours.
const MIN_MAC: f64 = 0.9;
/// A step that takes at most this many Newton iterations is followed by a longer one. At kinks,
/// Newton's method takes more than the usual three without being close to failure.
const FEW_ITERATIONS: usize = 8;
/// Fractions of a decade in amplitude by which a leap skips a part of the curve that cannot be
/// followed.
const LEAPS: [f64; 6] = [0.01, 0.03, 0.1, 0.2, 0.4, 0.7];
/// Rigidity of the shape, see [`ModeEquations::phase_collinearity`], below which two modes count
/// as merging. In the blade couple it falls to 0.3 with one harmonic, to 0.03 with 15 and to 0.1
/// with 31. The three cases connect the modes differently.
const MERGING: f64 = 1.0 / 3.0;
/// Number of short steps from a computed state to a nearby amplitude, if a single step fails.
const PARTS: u32 = 16;
/// Relative change of amplitude up to which a turn is an effect of the sampled force and is not
/// reported.
const MIN_TURN: f64 = 1e-3;
/// Relative tolerance of the amplitude with the largest damping. The damping is then accurate to
/// its square.
const PEAK_TOLERANCE: f64 = 1e-3;

/// The curve of a mode.
pub(super) struct ModeCurve {
    linear: Option<LinearMode>,
    arcs: Vec<ModeArc>,
    /// True if all motions below the last computed one are its multiples, because the joints
    /// stick.
    sticks: bool,
    pub(super) ended: Option<ModeEnd>,
}

impl ModeCurve {
    /// Follows mode `index` down to the modal amplitude `low`. If forces grow with amplitude,
    /// follows it up to `high` as well.
    pub(super) fn follow(equations: &mut ModeEquations<'_>, index: usize, (low, high): (f64, f64)) -> Self {
        let modes = equations.linear_modes();
        let begun = equations.time_steps();
        let none = |linear| {
            let ended = ModeEnd { at: f64::INFINITY, reason: ModeEndCause::NoStart };
            ModeCurve { linear, arcs: Vec::new(), sticks: false, ended: Some(ended) }
        };
        let Some(linear) = modes.get(index).cloned() else { return none(None) };
        let faint = equations.weak_friction_amplitude(&modes, index, FRICTION_RATIO, SEPARATION_RATIO);
        // without friction, any amplitude serves
        let faint = if faint > 0.0 { faint } else { low };
        // If the joints of a pair of modes are not alike, a travelling wave is not a motion. The
        // standing shape is then tried.
        let shapes = [Some(linear.clone()), linear.standing()];
        let start = shapes.into_iter().flatten().find_map(|linear| {
            equations.may_be_singular = linear.standing_mode.is_some();
            let start = START_FACTORS.iter().find_map(|factor| {
                if equations.time_steps() - begun > MEMORY_WORK {
                    return None;
                }
                let amplitude = factor * faint;
                let guess = equations.linear_state(&linear, amplitude)?;
                let state = equations.solve(&guess, amplitude, amplitude)?;
                (equations.modal_assurance(&guess, &state) >= MIN_MAC)
                    .then(|| equations.start_curve(&state, amplitude))?
            });
            Some((linear, start?))
        });
        let Some((linear, start)) = start else { return none(Some(linear)) };
        let top = start.amplitude;
        let mut arcs = if equations.is_unbounded() { follow_upwards(equations, &start, high) } else { Vec::new() };
        arcs.push(start);
        let (mut lowest, mut since, mut creeping) = (arcs.len() - 1, 0, 0);
        let mut path = ModeCurve { linear: Some(linear), arcs, sticks: false, ended: None };
        let mut length = INITIAL_STEP;
        for _ in 0..MAX_STEPS {
            let now = &path.arcs[path.arcs.len() - 1];
            let at = now.amplitude;
            if at < low {
                return path;
            }
            // With equal blades whose joints stick, any combination of modes is a motion, and a
            // step could not choose among them.
            if equations.is_proportional(&now.state, at) {
                path.sticks = true;
                return path;
            }
            let step = try_step(equations, now, length);
            since += 1;
            if now.state.damping > OVERDAMPED {
                creeping += equations.resolution();
            }
            let reason = match step {
                _ if creeping > OVERDAMPED_WORK => {
                    path.ended = Some(ModeEnd { at: path.smallest_amplitude(), reason: ModeEndCause::Overdamped });
                    return path;
                }
                _ if equations.time_steps() - begun > MEMORY_WORK => {
                    path.ended = Some(ModeEnd { at: path.smallest_amplitude(), reason: ModeEndCause::WorkLimit });
                    return path;
                }
                _ if at > top => ModeEndCause::Merged,
                _ if since > MAX_STEPS_WITHOUT_PROGRESS => ModeEndCause::Turned,
                Some(step) => {
                    if step.iterations <= FEW_ITERATIONS {
                        length = (1.5 * length).min(MAX_STEP);
                    }
                    path.arcs.push(step.to);
                    if path.arcs[path.arcs.len() - 1].amplitude < path.arcs[lowest].amplitude {
                        (lowest, since) = (path.arcs.len() - 1, 0);
                    }
                    continue;
                }
                None if length > MIN_STEP => {
                    length *= 0.5;
                    continue;
                }
                None => ModeEndCause::Stalled,
            };
            // continue with the same shape at a smaller amplitude
            let Some(next) = leap(equations, &path.arcs[lowest]) else {
                path.ended = Some(ModeEnd { at: path.arcs[lowest].amplitude, reason });
                return path;
            };
            path.arcs.push(next);
            (length, lowest, since) = (INITIAL_STEP, path.arcs.len() - 1, 0);
        }
        path.ended = Some(ModeEnd { at: path.smallest_amplitude(), reason: ModeEndCause::StepLimit });
        path
    }

    /// Follows mode `index` upwards from the modal amplitude `low`, beginning with all joints
    /// linearized for small motion. Ends above `high` or when no step succeeds. `None` if no
    /// motion is found at `low`.
    pub(super) fn from_small_amplitude(
        equations: &mut ModeEquations<'_>,
        index: usize,
        (low, high): (f64, f64),
    ) -> Option<Self> {
        equations.may_be_singular = false;
        let guess = equations.small_amplitude_mode(index, low)?;
        let state =
            equations.solve(&guess, low, low).filter(|state| equations.modal_assurance(&guess, state) >= MIN_MAC)?;
        let start = equations.start_curve(&state, low)?;
        let mut arcs = follow_upwards(equations, &start, high);
        arcs.push(start);
        Some(ModeCurve { linear: None, arcs, sticks: false, ended: None })
    }

    /// Returns the largest amplitude on the curve.
    pub(super) fn largest_amplitude(&self) -> f64 {
        self.arcs.iter().fold(0.0, |most, arc| most.max(arc.amplitude))
    }

    /// Tells whether the mode is one of the two travelling waves of a pair.
    pub(super) fn travels(&self) -> bool {
        self.linear.as_ref().is_some_and(|linear| linear.standing_mode.is_some())
    }

    /// Returns the smallest amplitude on the curve.
    pub(super) fn smallest_amplitude(&self) -> f64 {
        if self.sticks {
            return 0.0;
        }
        self.arcs.iter().fold(f64::INFINITY, |least, arc| least.min(arc.amplitude))
    }

    /// Returns the motion at modal amplitude `a`, at the first passage of the curve.
    pub(super) fn state_at(&self, equations: &mut ModeEquations<'_>, a: f64) -> Option<ModeState> {
        let first = self.arcs.first()?;
        if a >= first.amplitude {
            let guess = equations.linear_state(self.linear.as_ref()?, a)?;
            let found = equations.solve(&guess, a, a).or_else(|| equations.solve(&first.state, first.amplitude, a))?;
            return (equations.modal_assurance(&guess, &found) >= MIN_MAC).then_some(found);
        }
        // A branch from small amplitudes begins at a requested amplitude.
        if let Some(last) = self.arcs.last().filter(|last| last.amplitude == a) {
            return Some(last.state.clone());
        }
        let Some(pair) = self.arcs.windows(2).find(|pair| pair[0].amplitude >= a && pair[1].amplitude < a) else {
            let last = self.arcs.last().filter(|_| self.sticks)?;
            return Some(equations.scaled(&last.state, a / last.amplitude));
        };
        let guess = pair[0].interpolated(&pair[1], a);
        let room = equations.distance(&pair[0], &pair[1].state, pair[1].amplitude);
        let near = |equations: &mut ModeEquations<'_>, from: &ModeState, before: f64| {
            let found = equations.solve(from, before, a)?;
            let apart = pair.iter().map(|arc| equations.distance(arc, &found, a)).fold(f64::INFINITY, f64::min);
            (apart <= room).then_some(found)
        };
        for (from, before) in [(&guess, a), (&pair[1].state, pair[1].amplitude)] {
            if let Some(found) = near(equations, from, before) {
                return Some(found);
            }
        }
        // between kinks: short steps from above
        let (mut before, mut state) = (pair[0].amplitude, pair[0].state.clone());
        for part in 1..=PARTS {
            let next = pair[0].amplitude * (a / pair[0].amplitude).powf(f64::from(part) / f64::from(PARTS));
            state = equations.solve(&state, before, next)?;
            before = next;
        }
        near(equations, &state, before)
    }

    /// Returns the computed states within a range, at the first passage of each amplitude, and
    /// the states at its ends, in decreasing order of amplitude. The index is that of the
    /// preceding computed state.
    pub(super) fn states_within(
        &self,
        equations: &mut ModeEquations<'_>,
        (low, high): (f64, f64),
    ) -> Vec<(usize, f64, ModeState)> {
        let low = low.max(self.smallest_amplitude());
        let before = |a: f64| self.arcs.windows(2).position(|pair| pair[0].amplitude >= a && pair[1].amplitude < a);
        let mut all = Vec::new();
        if let Some(state) = self.state_at(equations, high) {
            all.push((before(high).unwrap_or(0), high, state));
        }
        let mut least = f64::INFINITY;
        for (i, arc) in self.arcs.iter().enumerate() {
            if arc.amplitude < least {
                least = arc.amplitude;
                if low <= least && least < high {
                    all.push((i, least, arc.state.clone()));
                }
            }
        }
        if let Some(state) = self.state_at(equations, low) {
            all.push((before(low).unwrap_or(self.arcs.len()), low, state));
        }
        all
    }

    /// Returns amplitude and motion with the largest damping within a range: the best computed
    /// state, then golden-section search between its neighbours.
    pub(super) fn largest_damping(
        &self,
        equations: &mut ModeEquations<'_>,
        range: (f64, f64),
    ) -> Option<(f64, ModeState)> {
        let all = self.states_within(equations, range);
        let best = (0..all.len()).max_by(|&i, &k| all[i].2.damping.total_cmp(&all[k].2.damping))?;
        let (_, amplitude, state) = &all[best];
        let mut top = (*amplitude, state.clone());
        let (low, high) = (all[(best + 1).min(all.len() - 1)].1.ln(), all[best.saturating_sub(1)].1.ln());
        // no motion counts as no damping
        let mut damping = |at: f64| {
            let Some(found) = self.state_at(equations, at.exp()) else { return f64::NEG_INFINITY };
            let damping = found.damping;
            if damping > top.1.damping {
                top = (at.exp(), found);
            }
            damping
        };
        let Ok(_) = golden_section(
            (high, low),
            |above, below| above - below <= PEAK_TOLERANCE,
            |at| Ok::<_, Infallible>(damping(at)),
        );
        Some(top)
    }

    /// Returns the amplitudes of the computed states with the smallest rigidity, one for each
    /// part of the curve below [`MERGING`].
    pub(super) fn merges(&self, equations: &ModeEquations<'_>) -> Vec<f64> {
        let mut merges = Vec::new();
        // A travelling wave is orthogonal to itself everywhere; its partner is the wave in the
        // opposite direction.
        if self.travels() {
            return merges;
        }
        let mut least: Option<(f64, f64)> = None;
        for arc in &self.arcs {
            let rigidity = equations.phase_collinearity(&arc.state);
            if rigidity >= MERGING {
                merges.extend(least.take().map(|(_, at)| at));
            } else if least.is_none_or(|(before, _)| rigidity < before) {
                least = Some((rigidity, arc.amplitude));
            }
        }
        merges.extend(least.map(|(_, at)| at));
        merges
    }

    /// Returns the parts of the curve that turn back and later continue to new, smaller
    /// amplitudes.
    pub(super) fn turns(&self) -> Vec<TurningPart> {
        let mut turns = Vec::new();
        let (mut least, mut up): (f64, Option<f64>) = (f64::INFINITY, None);
        for arc in &self.arcs {
            let a = arc.amplitude;
            if a > least {
                up = Some(up.map_or(a, |up| up.max(a)));
            } else {
                let turn = up.take().map(|up| TurningPart { amplitude: least, return_amplitude: up });
                turns.extend(turn.filter(|turn| turn.return_amplitude > (1.0 + MIN_TURN) * turn.amplitude));
                least = a;
            }
        }
        turns
    }
}

/// Takes a step. `None` if the corrector fails or leaves the curve.
fn try_step(equations: &mut ModeEquations<'_>, now: &ModeArc, length: f64) -> Option<ModeStep> {
    let step = equations.step(now, length, length < CORNER)?;
    let smooth = step.predictor_distance <= MAX_PREDICTOR_ERROR * length
        && step.tangent_cosine >= MIN_TANGENT_COSINE
        && step.to.determinant_sign * now.determinant_sign >= 0.0;
    let corner = length < CORNER && step.predictor_distance <= MAX_CORNER * length + GAP;
    ((smooth || corner) && equations.modal_assurance(&now.state, &step.to.state) >= MIN_MAC).then_some(step)
}

/// Follows the curve upwards from `start` to `high`, or until no step succeeds. Returns the
/// points in decreasing order of amplitude. It is needed for forces that grow with amplitude,
/// because the linear mode is then not a useful initial guess.
fn follow_upwards(equations: &mut ModeEquations<'_>, start: &ModeArc, high: f64) -> Vec<ModeArc> {
    let mut arcs = Vec::new();
    let (mut now, mut length, mut creeping, begun) = (start.reversed(), INITIAL_STEP, 0, equations.time_steps());
    for _ in 0..MAX_STEPS {
        if now.amplitude > high || length <= MIN_STEP {
            break;
        }
        if now.state.damping > OVERDAMPED {
            creeping += equations.resolution();
        }
        if creeping > OVERDAMPED_WORK || equations.time_steps() - begun > MEMORY_WORK {
            break;
        }
        match try_step(equations, &now, length) {
            Some(step) => {
                if step.iterations <= FEW_ITERATIONS {
                    length = (1.5 * length).min(MAX_STEP);
                }
                now = step.to;
                arcs.push(now.clone());
            }
            None => length *= 0.5,
        }
    }
    arcs.reverse();
    arcs
}

/// Skips a kink that no step passes, or leaves a curve that does not return. Solves at a smaller
/// amplitude for the same shape.
fn leap(equations: &mut ModeEquations<'_>, now: &ModeArc) -> Option<ModeArc> {
    LEAPS.iter().find_map(|part| {
        let amplitude = now.amplitude * 10f64.powf(-part);
        let state = equations.solve(&now.state, now.amplitude, amplitude)?;
        (equations.modal_assurance(&now.state, &state) >= MIN_MAC).then(|| equations.start_curve(&state, amplitude))?
    })
}
