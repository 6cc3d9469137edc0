//! Follows the curve of a mode from its large end, by arc length, and reads motions from it.

use crate::method::harmonic_balance::{LinearMode, ModeArc, ModeEquations, ModeState, ModeStep as Step};
use std::convert::Infallible;
use stickslip_numerics::maximum::maximum;

/// A part of the curve that turns back: the values below `at` are not those that end at `at`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// Modal amplitude below which the motion is another one, m √kg.
    pub at: f64,
    /// Modal amplitude to which the curve goes back before it falls for good; between both there are several motions.
    pub up: f64,
}

/// A mode that ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lost {
    /// Modal amplitude of the last motion, m √kg.
    pub at: f64,
    /// Why.
    pub reason: Reason,
}

/// Why a mode ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Reason {
    /// The structure without joints has no such mode, or its frequency is zero.
    #[error("no motion near the mode of the structure without its joints was found, or that mode has no frequency")]
    NoBeginning,
    /// The curve turned and went back to where friction hardly matters.
    #[error(
        "its curve turns there and goes back to large amplitudes: it becomes one with another mode, and does not exist below"
    )]
    Merged,
    /// The curve turned and did not come back to smaller amplitudes.
    #[error("its curve turns there and has not come back to smaller amplitudes after 1000 steps; try fewer harmonics")]
    Turned,
    /// No shorter step converged.
    #[error("no neighbouring motion was found; try more harmonics")]
    Stalled,
    /// The damping ratio is above ten for many steps.
    #[error(
        "its damping ratio is above ten there: nothing vibrates, and it is not followed further; ask for larger amplitudes"
    )]
    Overdamped,
    /// It is followed from its small end to there, and from its large end not at all.
    #[error(
        "it is followed from small amplitudes to there, where nothing vibrates or no neighbouring motion was found, and at large amplitudes no motion \
         was found either"
    )]
    FromRest,
    /// The states of a law took too many steps.
    #[error(
        "it is not followed further: the states of a law change so fast there that every motion takes long; ask for other amplitudes"
    )]
    Dear,
    /// All steps are used up.
    #[error("it was not followed to the end within 4000 steps; try fewer harmonics")]
    Steps,
}
/// Share of friction in the forces of the linear mode at which a mode begins: its frequency and damping are then right to this share.
const FAINT: f64 = 1e-4;
/// The same relative to what distinguishes it from the nearest mode: its shape is then the linear one to a percent.
const APART: f64 = 1e-2;
/// Factors by which a mode may begin lower or higher, if Newton's method does not come from the linear mode to the nonlinear one: where a joint
/// hardly moves in the linear mode, friction alone decides how it does, and with it the phase of its force.
const OTHERS: [f64; 7] = [1.0, 0.1, 0.01, 1e-3, 10.0, 100.0, 1e4];
/// Steps, refused ones included. The couples take about 100, internal resonances some hundreds.
const MOST_STEPS: usize = 4000;
/// Steps without an amplitude below all before, after which the curve is left: it runs in a loop, or to another mode.
const PATIENCE: usize = 1000;
/// Damping ratio, a tenth of which is critical, from which nothing has vibrated for long.
const OVERDAMPED: f64 = 10.0;
/// Harmonics times samples of all steps that are spent on such motions: two seconds or so. Rigid friction that is followed to a nanometre takes
/// thousands of steps, of which nobody has anything where each is dear.
const CREEPING: usize = 8_000_000;
/// Steps of laws with memory that a curve may take: ten seconds or so. A curve of one joint takes
/// a few millions.
const MARCHED: usize = 4_000_000;
/// Arc lengths, see [`ModeEquations::step`]: the longest step changes the amplitude by up to a half, or a fifth of the shape.
const LONGEST: f64 = 0.2;
/// The first step, and that after a leap.
const FIRST: f64 = 0.02;
/// A step below this is rounding: the curve ends.
const SHORTEST: f64 = 1e-7;
/// Steps below this may take a corner: where a sampled joint begins to slip, the curve has kinks.
const CORNER: f64 = 1e-3;
/// Most distance of a solution from where the tangent pointed, relative to such a step: a corner of up to 79 degrees.
const BENT: f64 = 5.0;
/// Arc length over which the curve may jump: where a sampled force turns within another sample, it is not continuous. Measured 1e-6.
const GAP: f64 = 1e-5;
/// Least cosine between the tangents at both ends of a step.
const STRAIGHT: f64 = 0.9;
/// Most distance of a solution from where the tangent pointed, relative to the step.
const OFF: f64 = 0.5;
/// Least modal assurance between neighbours.
const SHAPE: f64 = 0.9;
/// A step is lengthened after at most this many Newton iterations: at kinks it takes more than the usual three without being in danger.
const FEW: usize = 8;
/// Parts of a decade by which a mode is sought below where its curve cannot be followed.
const LEAPS: [f64; 6] = [0.01, 0.03, 0.1, 0.2, 0.4, 0.7];
/// Rigidity of the shape, see [`ModeEquations::rigidity`], below which two modes count as merging. In the blade couple it falls to 0.3 with one
/// harmonic, to 0.03 with 15, to 0.1 with 31, and which mode goes on to which motion is not the same in the three.
const MERGING: f64 = 1.0 / 3.0;
/// Short steps from a followed state to an amplitude beside it, where one long step fails.
const PARTS: u32 = 16;
/// Relative amplitude up to which a turn is one of the sampled force and not of the mode, and is not told.
const TREMOR: f64 = 1e-3;
/// Relative amplitude to which the largest damping is located: its value is then right to the square of this.
const LOCATED: f64 = 1e-3;

/// A mode's curve, followed from its large end.
pub(super) struct ModeCurve {
    linear: Option<LinearMode>,
    arcs: Vec<ModeArc>,
    /// Whether all motions below the last followed one are its multiples: the joints stick.
    sticks: bool,
    pub(super) lost: Option<Lost>,
}

impl ModeCurve {
    /// Follows mode `index` until it is below the modal amplitude `low`; where forces grow with amplitude, up to `high` as well.
    pub(super) fn follow(equations: &mut ModeEquations<'_>, index: usize, (low, high): (f64, f64)) -> Self {
        let modes = equations.linear_modes();
        let begun = equations.marched();
        let none = |linear| {
            let lost = Lost { at: f64::INFINITY, reason: Reason::NoBeginning };
            ModeCurve { linear, arcs: Vec::new(), sticks: false, lost: Some(lost) }
        };
        let Some(linear) = modes.get(index).cloned() else { return none(None) };
        let faint = equations.faint(&modes, index, FAINT, APART);
        // without friction any amplitude will do
        let faint = if faint > 0.0 { faint } else { low };
        // of a pair whose joints are not alike no wave is a motion
        let shapes = [Some(linear.clone()), linear.standing()];
        let start = shapes.into_iter().flatten().find_map(|linear| {
            equations.mixes = linear.stands.is_some();
            let start = OTHERS.iter().find_map(|factor| {
                if equations.marched() - begun > MARCHED {
                    return None;
                }
                let amplitude = factor * faint;
                let guess = equations.linear(&linear, amplitude)?;
                let state = equations.solve(&guess, amplitude, amplitude)?;
                (equations.assurance(&guess, &state) >= SHAPE).then(|| equations.begin(&state, amplitude))?
            });
            Some((linear, start?))
        });
        let Some((linear, start)) = start else { return none(Some(linear)) };
        let top = start.amplitude;
        let mut arcs = if equations.is_unbounded() { risen(equations, &start, high) } else { Vec::new() };
        arcs.push(start);
        let (mut lowest, mut since, mut creeping) = (arcs.len() - 1, 0, 0);
        let mut path = ModeCurve { linear: Some(linear), arcs, sticks: false, lost: None };
        let mut length = FIRST;
        for _ in 0..MOST_STEPS {
            let now = &path.arcs[path.arcs.len() - 1];
            let at = now.amplitude;
            if at < low {
                return path;
            }
            // of equal blades whose joints stick any mixture is a motion as good, and no step would find its way among them
            if equations.is_proportional(&now.state, at) {
                path.sticks = true;
                return path;
            }
            let step = taken(equations, now, length);
            since += 1;
            if now.state.damping > OVERDAMPED {
                creeping += equations.resolution();
            }
            let reason = match step {
                _ if creeping > CREEPING => {
                    path.lost = Some(Lost { at: path.end(), reason: Reason::Overdamped });
                    return path;
                }
                _ if equations.marched() - begun > MARCHED => {
                    path.lost = Some(Lost { at: path.end(), reason: Reason::Dear });
                    return path;
                }
                _ if at > top => Reason::Merged,
                _ if since > PATIENCE => Reason::Turned,
                Some(step) => {
                    if step.iterations <= FEW {
                        length = (1.5 * length).min(LONGEST);
                    }
                    path.arcs.push(step.to);
                    if path.arcs[path.arcs.len() - 1].amplitude < path.arcs[lowest].amplitude {
                        (lowest, since) = (path.arcs.len() - 1, 0);
                    }
                    continue;
                }
                None if length > SHORTEST => {
                    length *= 0.5;
                    continue;
                }
                None => Reason::Stalled,
            };
            // the mode goes on where its shape does
            let Some(next) = leap(equations, &path.arcs[lowest]) else {
                path.lost = Some(Lost { at: path.arcs[lowest].amplitude, reason });
                return path;
            };
            path.arcs.push(next);
            (length, lowest, since) = (FIRST, path.arcs.len() - 1, 0);
        }
        path.lost = Some(Lost { at: path.end(), reason: Reason::Steps });
        path
    }

    /// Follows mode `index` from where all joints hold as in small motion, at the modal amplitude
    /// `low`, until it is above `high` or no step goes on. `None`
    /// where no motion is found there.
    pub(super) fn from_rest(equations: &mut ModeEquations<'_>, index: usize, (low, high): (f64, f64)) -> Option<Self> {
        equations.mixes = false;
        let guess = equations.at_rest(index, low)?;
        let state = equations.solve(&guess, low, low).filter(|state| equations.assurance(&guess, state) >= SHAPE)?;
        let start = equations.begin(&state, low)?;
        let mut arcs = risen(equations, &start, high);
        arcs.push(start);
        Some(ModeCurve { linear: None, arcs, sticks: false, lost: None })
    }

    /// The largest amplitude that was reached.
    pub(super) fn top(&self) -> f64 {
        self.arcs.iter().fold(0.0, |most, arc| most.max(arc.amplitude))
    }

    /// Whether it is one of the two waves of a pair.
    pub(super) fn travels(&self) -> bool {
        self.linear.as_ref().is_some_and(|linear| linear.stands.is_some())
    }

    /// The smallest amplitude that was reached.
    pub(super) fn end(&self) -> f64 {
        if self.sticks {
            return 0.0;
        }
        self.arcs.iter().fold(f64::INFINITY, |least, arc| least.min(arc.amplitude))
    }

    /// The motion at modal amplitude `a`, where the curve passes it first.
    pub(super) fn at(&self, equations: &mut ModeEquations<'_>, a: f64) -> Option<ModeState> {
        let first = self.arcs.first()?;
        if a >= first.amplitude {
            let guess = equations.linear(self.linear.as_ref()?, a)?;
            let found = equations.solve(&guess, a, a).or_else(|| equations.solve(&first.state, first.amplitude, a))?;
            return (equations.assurance(&guess, &found) >= SHAPE).then_some(found);
        }
        // a curve from its small end begins at an amplitude that is asked for
        if let Some(last) = self.arcs.last().filter(|last| last.amplitude == a) {
            return Some(last.state.clone());
        }
        let Some(pair) = self.arcs.windows(2).find(|pair| pair[0].amplitude >= a && pair[1].amplitude < a) else {
            let last = self.arcs.last().filter(|_| self.sticks)?;
            return Some(equations.scaled(&last.state, a / last.amplitude));
        };
        let guess = pair[0].between(&pair[1], a);
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
        // between kinks: in short steps from above
        let (mut before, mut state) = (pair[0].amplitude, pair[0].state.clone());
        for part in 1..=PARTS {
            let next = pair[0].amplitude * (a / pair[0].amplitude).powf(f64::from(part) / f64::from(PARTS));
            state = equations.solve(&state, before, next)?;
            before = next;
        }
        near(equations, &state, before)
    }

    /// Followed states within a range, where the curve passes an amplitude first, and those at its ends, by falling amplitude; with the
    /// number of the followed state before them.
    pub(super) fn within(
        &self,
        equations: &mut ModeEquations<'_>,
        (low, high): (f64, f64),
    ) -> Vec<(usize, f64, ModeState)> {
        let low = low.max(self.end());
        let before = |a: f64| self.arcs.windows(2).position(|pair| pair[0].amplitude >= a && pair[1].amplitude < a);
        let mut all = Vec::new();
        if let Some(state) = self.at(equations, high) {
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
        if let Some(state) = self.at(equations, low) {
            all.push((before(low).unwrap_or(self.arcs.len()), low, state));
        }
        all
    }

    /// Amplitude and motion where damping is largest within a range: among the followed states, then by golden-section search between
    /// the neighbours of the best.
    pub(super) fn largest(&self, equations: &mut ModeEquations<'_>, range: (f64, f64)) -> Option<(f64, ModeState)> {
        let all = self.within(equations, range);
        let best = (0..all.len()).max_by(|&i, &k| all[i].2.damping.total_cmp(&all[k].2.damping))?;
        let (_, amplitude, state) = &all[best];
        let mut top = (*amplitude, state.clone());
        let (low, high) = (all[(best + 1).min(all.len() - 1)].1.ln(), all[best.saturating_sub(1)].1.ln());
        // where there is no motion it is not larger
        let mut damping = |at: f64| {
            let Some(found) = self.at(equations, at.exp()) else { return f64::NEG_INFINITY };
            let damping = found.damping;
            if damping > top.1.damping {
                top = (at.exp(), found);
            }
            damping
        };
        let Ok(_) =
            maximum((high, low), |above, below| above - below <= LOCATED, |at| Ok::<_, Infallible>(damping(at)));
        Some(top)
    }

    /// Amplitudes of the followed states at which the shape is least rigid, of every stretch of the curve where it is [`MERGING`].
    pub(super) fn merges(&self, equations: &ModeEquations<'_>) -> Vec<f64> {
        let mut merges = Vec::new();
        // a wave is orthogonal to itself all along: its partner is the wave that runs the other way
        if self.travels() {
            return merges;
        }
        let mut least: Option<(f64, f64)> = None;
        for arc in &self.arcs {
            let rigidity = equations.rigidity(&arc.state);
            if rigidity >= MERGING {
                merges.extend(least.take().map(|(_, at)| at));
            } else if least.is_none_or(|(before, _)| rigidity < before) {
                least = Some((rigidity, arc.amplitude));
            }
        }
        merges.extend(least.map(|(_, at)| at));
        merges
    }

    /// Where the curve turns back and then passes on to amplitudes that it has not had.
    pub(super) fn turns(&self) -> Vec<Turn> {
        let mut turns = Vec::new();
        let (mut least, mut up): (f64, Option<f64>) = (f64::INFINITY, None);
        for arc in &self.arcs {
            let a = arc.amplitude;
            if a > least {
                up = Some(up.map_or(a, |up| up.max(a)));
            } else {
                let turn = up.take().map(|up| Turn { at: least, up });
                turns.extend(turn.filter(|turn| turn.up > (1.0 + TREMOR) * turn.at));
                least = a;
            }
        }
        turns
    }
}

/// A step of the curve, if it stays with it.
fn taken(equations: &mut ModeEquations<'_>, now: &ModeArc, length: f64) -> Option<Step> {
    let step = equations.step(now, length, length < CORNER)?;
    let smooth = step.off <= OFF * length && step.straight >= STRAIGHT && step.to.side * now.side >= 0.0;
    let corner = length < CORNER && step.off <= BENT * length + GAP;
    ((smooth || corner) && equations.assurance(&now.state, &step.to.state) >= SHAPE).then_some(step)
}

/// What the curve is above its beginning, by falling amplitude, up to `high` or to where no step goes on: the linear mode is no guess where
/// forces grow with amplitude.
fn risen(equations: &mut ModeEquations<'_>, start: &ModeArc, high: f64) -> Vec<ModeArc> {
    let mut arcs = Vec::new();
    let (mut now, mut length, mut creeping, begun) = (start.reversed(), FIRST, 0, equations.marched());
    for _ in 0..MOST_STEPS {
        if now.amplitude > high || length <= SHORTEST {
            break;
        }
        if now.state.damping > OVERDAMPED {
            creeping += equations.resolution();
        }
        if creeping > CREEPING || equations.marched() - begun > MARCHED {
            break;
        }
        match taken(equations, &now, length) {
            Some(step) => {
                if step.iterations <= FEW {
                    length = (1.5 * length).min(LONGEST);
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

/// Over a kink that no step passes, or off a curve that does not come back, by solving at a smaller amplitude for the same shape.
fn leap(equations: &mut ModeEquations<'_>, now: &ModeArc) -> Option<ModeArc> {
    LEAPS.iter().find_map(|part| {
        let amplitude = now.amplitude * 10f64.powf(-part);
        let state = equations.solve(&now.state, now.amplitude, amplitude)?;
        (equations.assurance(&now.state, &state) >= SHAPE).then(|| equations.begin(&state, amplitude))?
    })
}
