//! Arc-length continuation of a nonlinear mode from large amplitudes, and evaluation of its
//! motions.

use crate::method::harmonic_balance::{LinearMode, ModeArc, ModeEquations, ModeState, ModeStep, SmallMode};
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
        "the curve of this mode turns there and returns to large amplitudes: it merges with another mode and does not exist at smaller amplitudes"
    )]
    Merged,
    /// The curve turned and did not return to smaller amplitudes.
    #[error(
        "the curve of this mode turns there and has not returned to smaller amplitudes after 1000 steps; try fewer harmonics"
    )]
    Turned,
    /// The corrector fails even at the smallest step size.
    #[error("the continuation found no neighbouring motion; try more harmonics")]
    Stalled,
    /// The damping ratio exceeds ten over many steps.
    #[error("the damping ratio exceeds ten there (overdamped), and the continuation stops; choose larger amplitudes")]
    Overdamped,
    /// Laws with internal states exceeded their work limit.
    #[error(
        "the continuation reached its work limit, because the internal states of a law change very fast there; choose other amplitudes"
    )]
    WorkLimit,
    /// Another harmonic exceeds the first.
    #[error(
        "another harmonic exceeds the first there: the curve continues as a vibration of another mode at a multiple of the \
         frequency"
    )]
    OtherMode,
    /// The curve from small amplitudes is another motion where it should meet the one from large
    /// amplitudes.
    #[error(
        "the curve from large amplitudes ends there; the rows at smaller amplitudes follow the stuck mode of the most \
         similar shape, and the two curves do not join; compare the neighbouring modes"
    )]
    Apart,
    /// The maximum number of steps is reached.
    #[error("the continuation did not reach the end within 4000 steps; try fewer harmonics")]
    StepLimit,
}
/// Settings of the continuation of a nonlinear mode.
#[derive(Debug, Clone)]
struct ModeCurveSettings {
    /// Ratio of friction to the forces of the linear mode at which the continuation begins.
    /// Frequency and damping of the linear mode are then accurate to this ratio.
    friction_ratio: f64,
    /// Ratio of friction to the difference from the nearest mode at which the continuation begins.
    /// The linear shape is then accurate to one percent.
    separation_ratio: f64,
    /// Factors on the initial amplitude, tried in this order if Newton's method does not converge
    /// from the linear mode. This happens if a joint hardly moves in the linear mode: friction
    /// alone then determines its motion and the phase of its force.
    start_factors: [f64; 7],
    /// Maximum number of steps, including rejected ones. The blade couples take about 100,
    /// internal resonances some hundreds.
    max_steps: usize,
    /// Maximum number of steps without a new smallest amplitude. The curve then runs in a loop, or
    /// follows another mode.
    max_steps_without_progress: usize,
    /// Damping ratio above which a motion counts as overdamped, ten times critical damping.
    overdamped: f64,
    /// Work limit of overdamped motions: harmonics times samples, summed over the steps; about two
    /// seconds. Following rigid friction down to a nanometre would take thousands of expensive
    /// steps without a useful result.
    overdamped_work: usize,
    /// Work limit of laws with memory, in steps of the law; about ten seconds. A curve of one
    /// joint takes a few million.
    memory_work: usize,
    /// Longest step in arc length, see [`ModeEquations::step`]. It changes the amplitude by up to
    /// a half, or the shape by a fifth.
    max_step: f64,
    /// First step, also after a leap.
    initial_step: f64,
    /// A step below this is rounding: the curve ends.
    min_step: f64,
    /// Steps below this may pass a corner. The curve has kinks at the points at which a sampled
    /// joint begins to slip.
    corner_step: f64,
    /// Largest distance of a solution from the predictor, relative to such a step: a corner of up
    /// to 79 degrees.
    max_corner_distance: f64,
    /// Arc length over which the curve may jump. A sampled force is discontinuous if its reversal
    /// moves to another sample. Measured: 1e-6.
    jump_length: f64,
    /// Smallest cosine between the tangents at both ends of a step.
    min_tangent_cosine: f64,
    /// Largest distance of a solution from the predictor, relative to the step.
    max_predictor_error: f64,
    /// Smallest modal assurance criterion between neighbours.
    min_mac: f64,
    /// A step that takes at most this many Newton iterations is followed by a longer one. At
    /// kinks, Newton's method takes more than the usual three without being close to failure.
    few_iterations: usize,
    /// Step of an upward continuation from which on it tries to skip a kink. Some kinks have many
    /// short parts.
    leap_step: f64,
    /// Fractions of a decade in amplitude by which a leap skips a part of the curve that cannot be
    /// followed.
    leaps: [f64; 6],
    /// Rigidity of the shape, see [`ModeEquations::phase_collinearity`], below which two modes
    /// count as merging. In the blade couple it falls to 0.3 with one harmonic, to 0.03 with 15
    /// and to 0.1 with 31. The three cases connect the modes differently.
    merging_collinearity: f64,
    /// Number of short steps from a computed state to a nearby amplitude, if a single step fails.
    refined_steps: u32,
    /// Relative change of amplitude up to which a turn is an effect of the sampled force and is
    /// not reported.
    min_turn: f64,
    /// Relative tolerance of the amplitude with the largest damping. The damping is then accurate
    /// to its square.
    peak_tolerance: f64,
}

impl Default for ModeCurveSettings {
    fn default() -> Self {
        ModeCurveSettings {
            friction_ratio: 1e-4,
            separation_ratio: 1e-2,
            start_factors: [1.0, 0.1, 0.01, 1e-3, 10.0, 100.0, 1e4],
            max_steps: 4000,
            max_steps_without_progress: 1000,
            overdamped: 10.0,
            overdamped_work: 8_000_000,
            memory_work: 4_000_000,
            max_step: 0.2,
            initial_step: 0.02,
            min_step: 1e-7,
            corner_step: 1e-3,
            max_corner_distance: 5.0,
            jump_length: 1e-5,
            min_tangent_cosine: 0.9,
            max_predictor_error: 0.5,
            min_mac: 0.9,
            few_iterations: 8,
            leap_step: 1e-5,
            leaps: [0.01, 0.03, 0.1, 0.2, 0.4, 0.7],
            merging_collinearity: 1.0 / 3.0,
            refined_steps: 16,
            min_turn: 1e-3,
            peak_tolerance: 1e-3,
        }
    }
}

/// The curve of a mode.
pub(super) struct ModeCurve {
    /// Linear mode without joints from which the curve goes down; `None` if it goes up.
    linear: Option<LinearMode>,
    /// True if the mode is one of the two travelling waves of a pair.
    travels: bool,
    arcs: Vec<ModeArc>,
    /// True if all motions below the last computed one are its multiples, because the joints
    /// stick.
    sticks: bool,
    pub(super) ended: Option<ModeEnd>,
    settings: ModeCurveSettings,
}

impl ModeCurve {
    /// Follows mode `index` down to the modal amplitude `low`. If forces grow with amplitude,
    /// follows it up to `high` as well.
    pub(super) fn follow(equations: &mut ModeEquations<'_>, index: usize, low: f64, high: f64) -> Self {
        let settings = ModeCurveSettings::default();
        let modes = equations.linear_modes();
        let begun = equations.time_steps();
        let none = |linear| {
            let ended = ModeEnd { at: f64::INFINITY, reason: ModeEndCause::NoStart };
            ModeCurve {
                linear,
                travels: false,
                arcs: Vec::new(),
                sticks: false,
                ended: Some(ended),
                settings: ModeCurveSettings::default(),
            }
        };
        let Some(linear) = modes.get(index).cloned() else { return none(None) };
        let faint =
            equations.weak_friction_amplitude(&modes, index, settings.friction_ratio, settings.separation_ratio);
        // without friction, any amplitude serves
        let faint = if faint > 0.0 { faint } else { low };
        // If the joints of a pair of modes are not alike, a travelling wave is not a motion. The
        // standing shape is then tried.
        let shapes = [Some(linear.clone()), linear.standing()];
        let start = shapes.into_iter().flatten().find_map(|linear| {
            equations.may_be_singular = linear.standing_mode.is_some();
            let start = settings.start_factors.iter().find_map(|factor| {
                if equations.time_steps() - begun > settings.memory_work {
                    return None;
                }
                let amplitude = factor * faint;
                let guess = equations.linear_state(&linear, amplitude)?;
                let state = equations.solve(&guess, amplitude, amplitude)?;
                (equations.modal_assurance(&guess, &state) >= settings.min_mac)
                    .then(|| equations.start_curve(&state, amplitude))?
            });
            Some((linear, start?))
        });
        let Some((linear, start)) = start else { return none(Some(linear)) };
        let top = start.amplitude;
        let mut arcs =
            if equations.is_unbounded() { follow_upwards(equations, &settings, &start, high).0 } else { Vec::new() };
        arcs.push(start);
        let (mut lowest, mut since, mut creeping) = (arcs.len() - 1, 0, 0);
        let travels = linear.standing_mode.is_some();
        let mut path =
            ModeCurve { linear: Some(linear), travels, arcs, sticks: false, ended: None, settings: settings.clone() };
        let mut length = settings.initial_step;
        for _ in 0..settings.max_steps {
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
            let step = try_step(equations, &settings, now, length);
            since += 1;
            if now.state.damping > settings.overdamped {
                creeping += equations.resolution();
            }
            let reason = match step {
                _ if creeping > settings.overdamped_work => {
                    path.ended = Some(ModeEnd { at: path.smallest_amplitude(), reason: ModeEndCause::Overdamped });
                    return path;
                }
                _ if equations.time_steps() - begun > settings.memory_work => {
                    path.ended = Some(ModeEnd { at: path.smallest_amplitude(), reason: ModeEndCause::WorkLimit });
                    return path;
                }
                _ if at > top => ModeEndCause::Merged,
                _ if since > settings.max_steps_without_progress => ModeEndCause::Turned,
                Some(step) => {
                    if step.iterations <= settings.few_iterations {
                        length = (1.5 * length).min(settings.max_step);
                    }
                    path.arcs.push(step.to);
                    if path.arcs[path.arcs.len() - 1].amplitude < path.arcs[lowest].amplitude {
                        (lowest, since) = (path.arcs.len() - 1, 0);
                    }
                    continue;
                }
                None if length > settings.min_step => {
                    length *= 0.5;
                    continue;
                }
                None => ModeEndCause::Stalled,
            };
            // continue with the same shape at a smaller amplitude
            let Some(next) = leap(equations, &settings, &path.arcs[lowest], -1.0) else {
                path.ended = Some(ModeEnd { at: path.arcs[lowest].amplitude, reason });
                return path;
            };
            path.arcs.push(next);
            (length, lowest, since) = (settings.initial_step, path.arcs.len() - 1, 0);
        }
        path.ended = Some(ModeEnd { at: path.smallest_amplitude(), reason: ModeEndCause::StepLimit });
        path
    }

    /// Follows mode `index` upwards from the modal amplitude `low` to `high`, beginning with all
    /// joints linearized for small motion. `None` if no motion is found at `low`.
    pub(super) fn from_small_amplitude(
        equations: &mut ModeEquations<'_>,
        index: usize,
        low: f64,
        high: f64,
    ) -> Option<Self> {
        let settings = ModeCurveSettings::default();
        let SmallMode { state, standing } = equations.small_amplitude_mode(index, low)?;
        // if the joints of a pair of modes are not alike, a travelling wave is not a motion
        let guesses = [(standing.is_some(), Some(state)), (false, standing)];
        let (travels, start) = guesses.into_iter().find_map(|(travels, guess)| {
            let guess = guess?;
            equations.may_be_singular = travels;
            equations.hold_free_bodies(guess.omega);
            let state = equations
                .solve(&guess, low, low)
                .filter(|state| equations.modal_assurance(&guess, state) >= settings.min_mac)?;
            Some((travels, equations.start_curve(&state, low)?))
        })?;
        let (mut arcs, reason) = follow_upwards(equations, &settings, &start, high);
        arcs.push(start);
        let mut curve = ModeCurve { linear: None, travels, arcs, sticks: false, ended: None, settings };
        curve.ended = reason.map(|reason| ModeEnd { at: curve.largest_amplitude(), reason });
        curve.drop_other_mode(equations);
        Some(curve)
    }

    /// Drops the last points if another harmonic exceeds the first in all of them: the curve has
    /// become a vibration of another mode. Its frequency is near a multiple of that of this mode.
    pub(super) fn drop_other_mode(&mut self, equations: &ModeEquations<'_>) {
        let rises = self.linear.is_none();
        let own = |arc: &ModeArc| equations.is_mainly_first_harmonic(&arc.state);
        let (first, last) = (self.arcs.iter().position(own), self.arcs.iter().rposition(own));
        let (Some(first), Some(last)) = (first, last) else { return };
        let dropped = if rises { first } else { self.arcs.len() - 1 - last };
        if dropped == 0 {
            return;
        }
        self.arcs = if rises { self.arcs.split_off(first) } else { self.arcs.drain(..=last).collect() };
        self.sticks = false;
        let at = if rises { self.largest_amplitude() } else { self.smallest_amplitude() };
        self.ended = Some(ModeEnd { at, reason: ModeEndCause::OtherMode });
    }

    /// Returns the largest amplitude on the curve.
    pub(super) fn largest_amplitude(&self) -> f64 {
        self.arcs.iter().fold(0.0, |most, arc| most.max(arc.amplitude))
    }

    /// Tells whether the mode is one of the two travelling waves of a pair.
    pub(super) fn travels(&self) -> bool {
        self.travels
    }

    /// Returns the motion with the smallest amplitude on the curve.
    pub(super) fn last_state(&self) -> Option<&ModeState> {
        self.arcs.iter().min_by(|a, b| a.amplitude.total_cmp(&b.amplitude)).map(|arc| &arc.state)
    }

    /// Returns the smallest amplitude on the curve.
    pub(super) fn smallest_amplitude(&self) -> f64 {
        if self.sticks {
            return 0.0;
        }
        self.arcs.iter().fold(f64::INFINITY, |least, arc| least.min(arc.amplitude))
    }

    /// Tells whether a curve from small amplitudes has the shape of this one at its end.
    pub(super) fn meets(&self, rising: &ModeCurve, equations: &mut ModeEquations<'_>) -> bool {
        let lowest = self.arcs.iter().min_by(|a, b| a.amplitude.total_cmp(&b.amplitude));
        lowest.is_none_or(|end| {
            let found = rising.state_at(equations, end.amplitude);
            found.is_some_and(|state| equations.modal_assurance(&end.state, &state) >= self.settings.min_mac)
        })
    }

    /// Returns the motion at modal amplitude `a`, at the first passage of the curve.
    pub(super) fn state_at(&self, equations: &mut ModeEquations<'_>, a: f64) -> Option<ModeState> {
        let first = self.arcs.first()?;
        if a >= first.amplitude {
            let guess = equations.linear_state(self.linear.as_ref()?, a)?;
            let found = equations.solve(&guess, a, a).or_else(|| equations.solve(&first.state, first.amplitude, a))?;
            return (equations.modal_assurance(&guess, &found) >= self.settings.min_mac).then_some(found);
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
        for part in 1..=self.settings.refined_steps {
            let next = pair[0].amplitude
                * (a / pair[0].amplitude).powf(f64::from(part) / f64::from(self.settings.refined_steps));
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
            |above, below| above - below <= self.settings.peak_tolerance,
            |at| Ok::<_, Infallible>(damping(at)),
        );
        Some(top)
    }

    /// Returns the amplitudes of the computed states with the smallest rigidity, one for each
    /// part of the curve below `merging_collinearity`.
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
            if rigidity >= self.settings.merging_collinearity {
                merges.extend(least.take().map(|(_, at)| at));
            } else if least.is_none_or(|(before, _)| rigidity < before) {
                least = Some((rigidity, arc.amplitude));
            }
        }
        merges.extend(least.map(|(_, at)| at));
        merges
    }

    /// Returns the parts of the curve that turn back and later continue to new, smaller
    /// amplitudes. A curve that goes up may begin within such a part.
    pub(super) fn turns(&self) -> Vec<TurningPart> {
        let part = |least: f64, up: Option<f64>| {
            let turn = TurningPart { amplitude: least, return_amplitude: up? };
            (turn.return_amplitude > (1.0 + self.settings.min_turn) * turn.amplitude).then_some(turn)
        };
        let mut turns = Vec::new();
        let (mut least, mut up): (f64, Option<f64>) = (f64::INFINITY, None);
        for arc in &self.arcs {
            let a = arc.amplitude;
            if a > least {
                up = Some(up.map_or(a, |up| up.max(a)));
            } else {
                turns.extend(part(least, up.take()));
                least = a;
            }
        }
        turns.extend(part(least, up.filter(|_| self.linear.is_none())));
        turns
    }
}

/// Takes a step. `None` if the corrector fails or leaves the curve.
fn try_step(
    equations: &mut ModeEquations<'_>,
    settings: &ModeCurveSettings,
    now: &ModeArc,
    length: f64,
) -> Option<ModeStep> {
    let step = equations.step(now, length, length < settings.corner_step)?;
    let smooth = step.predictor_distance <= settings.max_predictor_error * length
        && step.tangent_cosine >= settings.min_tangent_cosine
        && step.to.determinant_sign * now.determinant_sign >= 0.0;
    let corner = length < settings.corner_step
        && step.predictor_distance <= settings.max_corner_distance * length + settings.jump_length;
    ((smooth || corner) && equations.modal_assurance(&now.state, &step.to.state) >= settings.min_mac).then_some(step)
}

/// Follows the curve upwards from `start` to `high`. Returns the points in decreasing order of
/// amplitude, and the reason if the curve ends below `high`.
///
/// It serves modes that begin at small motions, and forces that grow with amplitude: the linear
/// mode is then not a useful initial guess.
fn follow_upwards(
    equations: &mut ModeEquations<'_>,
    settings: &ModeCurveSettings,
    start: &ModeArc,
    high: f64,
) -> (Vec<ModeArc>, Option<ModeEndCause>) {
    let mut arcs = Vec::new();
    let (mut now, mut length, mut creeping, begun) =
        (start.reversed(), settings.initial_step, 0, equations.time_steps());
    let mut ended = Some(ModeEndCause::StepLimit);
    for _ in 0..settings.max_steps {
        if now.state.damping > settings.overdamped {
            creeping += equations.resolution();
        }
        let reason = match () {
            _ if now.amplitude > high => None,
            _ if length <= settings.min_step => Some(ModeEndCause::Stalled),
            _ if creeping > settings.overdamped_work => Some(ModeEndCause::Overdamped),
            _ if equations.time_steps() - begun > settings.memory_work => Some(ModeEndCause::WorkLimit),
            _ => {
                match try_step(equations, settings, &now, length) {
                    Some(step) => {
                        if step.iterations <= settings.few_iterations {
                            length = (1.5 * length).min(settings.max_step);
                        }
                        now = step.to;
                        arcs.push(now.clone());
                    }
                    None => {
                        length *= 0.5;
                        // once for every kink
                        let is_kink = length <= settings.leap_step && 2.0 * length > settings.leap_step;
                        if let Some(next) = is_kink.then(|| leap(equations, settings, &now, 1.0)).flatten() {
                            (now, length) = (next.reversed(), settings.initial_step);
                            arcs.push(now.clone());
                        }
                    }
                }
                continue;
            }
        };
        ended = reason;
        break;
    }
    arcs.reverse();
    (arcs, ended)
}

/// Skips a kink that no step passes, or leaves a curve that does not return. Solves at a smaller
/// amplitude for the same shape, or at a larger one if `sign` is positive.
fn leap(equations: &mut ModeEquations<'_>, settings: &ModeCurveSettings, now: &ModeArc, sign: f64) -> Option<ModeArc> {
    settings.leaps.iter().find_map(|part| {
        let amplitude = now.amplitude * 10f64.powf(sign * part);
        let state = equations.solve(&now.state, now.amplitude, amplitude)?;
        (equations.modal_assurance(&now.state, &state) >= settings.min_mac)
            .then(|| equations.start_curve(&state, amplitude))?
    })
}
