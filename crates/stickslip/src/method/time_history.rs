//! Motion in time from given displacements: free decay, constant excitation, run-up.
//!
//! Exact laws are integrated from event to event, smooth laws by a stiff integration, other
//! laws and mixtures in equal steps. The motion is computed in intervals of one excitation
//! period. In a run-up, every cycle has a constant frequency, and the phase is continuous, as
//! in a stepped-sine test.

use super::flow::Flow;
use super::flow::integrator_choice;
use super::{IntegrationError, MethodError, alternatives};
use crate::model::System;
use crate::orbit::{Path, Sample, Symmetry};
use std::f64::consts::TAU;
use std::sync::Arc;

const NAME: &str = "transient";

/// Relative error per step for smooth laws.
const TOLERANCE: f64 = 1e-9;
/// Samples per interval of a free decay.
const SAMPLES_PER_INTERVAL: usize = 64;

/// The excitation of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Excitation {
    /// Constant forces only.
    Free,
    /// A constant excitation frequency, rad/s.
    Steady(f64),
    /// A frequency that changes from `from` to `to` (rad/s) within `duration` (s).
    RunUp {
        /// First frequency, rad/s.
        from: f64,
        /// Last frequency, rad/s.
        to: f64,
        /// Duration of the change, s.
        duration: f64,
        /// Law of the frequency change.
        scale: SweepScale,
    },
}

/// Change of the frequency of a run-up over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SweepScale {
    /// Equal differences in equal times.
    Linear,
    /// Equal ratios in equal times: `f = f₀ (f₁/f₀)^(t/T)`.
    Logarithmic,
}

/// The excitation of one interval of a motion: that of a system at one frequency, from phase zero
/// at the beginning of the interval.
#[derive(Debug, Clone)]
pub struct DrivenInterval {
    /// The system with its excitation. All intervals have the same structure, joints and laws.
    pub system: Arc<System>,
    /// Excitation frequency, rad/s; at zero, only the constant forces act.
    pub omega: f64,
    /// Frequency that samples report, rad/s.
    pub reported: f64,
    /// Length, s.
    pub length: f64,
}

/// A motion to compute.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeHistory {
    /// Displacements at the start, length n, m.
    pub displacement: Vec<f64>,
    /// Velocities at the start, length n, m/s.
    pub velocity: Vec<f64>,
    /// Internal states of the joints at the start, in the form of
    /// [`StaticEquilibrium`](super::StaticEquilibrium). If empty, the joints start unloaded.
    pub states: Vec<f64>,
    /// The excitation.
    pub excitation: Excitation,
    /// Length of the computed motion, s.
    pub duration: f64,
    /// Time between samples, s.
    pub step: f64,
    /// Velocity over which exact laws are smoothed, m/s; without it, they stay exact.
    pub width: Option<f64>,
    /// Relative error of the integration. Without it: 1e-9 per step if the steps are controlled,
    /// and 1e-6 per interval in equal steps.
    pub tolerance: Option<f64>,
}

/// The reason why a motion was not computed, or not to its end.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TimeHistoryError {
    /// No integration takes the system.
    #[error(transparent)]
    Method(#[from] MethodError),
    /// The motion broke down. The visitor has received all samples before that, and they are
    /// valid.
    #[error("{cause}; {}", good(*.last))]
    Breakdown {
        /// Time of the last valid sample, s; `None` if the motion breaks down before the first.
        last: Option<f64>,
        /// The cause, with its time.
        cause: IntegrationError,
    },
}

fn good(last: Option<f64>) -> String {
    last.map_or("no sample is valid".to_owned(), |last| format!("the samples up to t = {last:.6e} s are valid"))
}

/// Most attempts to recompute an interval in which the motion broke down. Each attempt ends
/// where the last one broke down, or at half of its length if the cause names no time. This is
/// enough to find one of [`SAMPLES_PER_INTERVAL`] samples.
const RECOMPUTE_ATTEMPTS: usize = 6;

/// The motion in an interval that starts at `begin` (s).
struct TimeInterval {
    begin: f64,
    length: f64,
    /// Index of its last sample, if it has one.
    last: Option<usize>,
    path: Arc<dyn Path>,
}

/// A sample of the motion, and the motion since the previous sample.
pub struct TimeSample<'a> {
    /// Time, s.
    pub time: f64,
    /// Excitation frequency, rad/s; zero if free.
    pub omega: f64,
    /// The state.
    pub state: &'a Sample,
    /// Returns the state at any time (s) between the previous sample and this one, from the
    /// computed motion.
    pub between: &'a dyn Fn(f64) -> Sample,
}

impl TimeInterval {
    /// Returns the state at a time of this interval, s.
    fn at(&self, time: f64) -> Sample {
        self.path.sample((time - self.begin).clamp(0.0, self.length))
    }
}

impl TimeHistory {
    /// Computes the motion.
    ///
    /// `sample` receives the time (s), the excitation frequency (rad/s, zero if free) and the
    /// state. It stops the computation by returning false.
    ///
    /// # Errors
    /// Returns [`TimeHistoryError`] if no integration takes the system, or if the motion breaks
    /// down.
    ///
    /// # Example
    /// A sliding oscillator loses `4 F/k` of amplitude per cycle.
    /// ```
    /// use stickslip::law::{Coulomb, Law};
    /// use std::sync::Arc;
    /// use stickslip::method::time_history::{Excitation, TimeHistory};
    /// use stickslip::model::{GROUND, Joint, Mass, Model, Spring};
    /// let model = Model {
    ///     masses: vec![Mass::new("m", 1.0)],
    ///     springs: vec![Spring {
    ///         between: ["m".into(), GROUND.into()],
    ///         stiffness: 1.0,
    ///         damping: 0.0,
    ///     }],
    ///     joints: vec![Joint {
    ///         name: "j".into(),
    ///         between: ["m".into(), GROUND.into()],
    ///         law: Arc::new(Coulomb { limit: 0.01 }),
    ///     }],
    ///     ..Model::default()
    /// };
    /// let motion = TimeHistory {
    ///     displacement: vec![1.0],
    ///     velocity: vec![0.0],
    ///     states: vec![],
    ///     excitation: Excitation::Free,
    ///     duration: std::f64::consts::TAU,
    ///     step: std::f64::consts::TAU,
    ///     width: None,
    ///     tolerance: None,
    /// };
    /// let mut last = 0.0;
    /// let system = model.assemble().unwrap();
    /// motion
    ///     .run(&system, &mut |_, _, state| {
    ///         last = state.displacement[0];
    ///         true
    ///     })
    ///     .unwrap();
    /// assert!((last - 0.96).abs() < 1e-12);
    /// ```
    pub fn run(
        &self,
        system: &System,
        sample: &mut dyn FnMut(f64, f64, &Sample) -> bool,
    ) -> Result<(), TimeHistoryError> {
        self.visit(system, &mut |instant| sample(instant.time, instant.omega, instant.state))
    }

    /// Computes the motion for a visitor that also needs the motion between two samples.
    ///
    /// # Errors
    /// Same as [`TimeHistory::run`].
    pub fn visit(
        &self,
        system: &System,
        visitor: &mut dyn FnMut(TimeSample<'_>) -> bool,
    ) -> Result<(), TimeHistoryError> {
        let shared = Arc::new(system.clone());
        let mut next = |begin: f64| {
            let omega = self.frequency(begin);
            let length = if omega > 0.0 { TAU / omega } else { SAMPLES_PER_INTERVAL as f64 * self.step };
            // shorten a cycle that outlasts the motion
            let length = if length > self.duration { self.duration + self.step } else { length };
            DrivenInterval { system: shared.clone(), omega, reported: omega, length }
        };
        self.visit_intervals(&mut next, visitor)
    }

    /// Computes the motion under an excitation that is given interval by interval. `excitation`
    /// receives the time at which an interval begins, s, from zero on. The field `excitation` of
    /// the motion has no effect.
    ///
    /// # Errors
    /// Same as [`TimeHistory::run`].
    pub fn visit_intervals(
        &self,
        excitation: &mut dyn FnMut(f64) -> DrivenInterval,
        visitor: &mut dyn FnMut(TimeSample<'_>) -> bool,
    ) -> Result<(), TimeHistoryError> {
        let mut interval = excitation(0.0);
        let mut flow = TimeHistory::flow(&interval.system, self.width, self.tolerance)?;
        flow.set_recording(true);
        let mut state = [self.displacement.as_slice(), &self.velocity].concat();
        if state.len() + self.states.len() == flow.states() {
            state.extend(&self.states);
        }
        state.resize(flow.states(), 0.0);
        let mut begin = 0.0;
        let mut next = 0usize; // index of the next sample
        // the interval of the previous sample, and all later ones
        let mut intervals: Vec<TimeInterval> = Vec::new();
        let samples = (self.duration / self.step * (1.0 + f64::EPSILON)).floor() as usize;
        while next <= samples {
            if begin > 0.0 {
                interval = excitation(begin);
            }
            let length = interval.length;
            flow.set_excitation(&interval.system, interval.omega);
            let start = state.clone();
            let followed = flow.run_accurately(&mut state, length);
            let end = begin + length;
            let inside = (next..=samples).take_while(|i| (*i as f64 * self.step) < end);
            let whole = inside.last();
            let stretch = match &followed {
                Ok(()) => {
                    let path = flow.path(&interval.system, Symmetry::FullPeriod, length);
                    Some(TimeInterval { begin, length, last: whole, path })
                }
                Err(cause) => whole
                    .and_then(|last| self.recompute_before_breakdown(&interval, &start, (begin, next, last), cause)),
            };
            if let Some(stretch) = stretch {
                let last = stretch.last;
                intervals.push(stretch);
                let since = |time: f64| {
                    let later = intervals.partition_point(|interval| interval.begin <= time);
                    intervals[later.saturating_sub(1)].at(time)
                };
                while last.is_some_and(|last| next <= last) {
                    let time = next as f64 * self.step;
                    let state = &since(time);
                    if !visitor(TimeSample { time, omega: interval.reported, state, between: &since }) {
                        return Ok(());
                    }
                    next += 1;
                }
                if last.is_some() {
                    intervals.drain(..intervals.len() - 1);
                }
            }
            followed.map_err(|cause| TimeHistoryError::Breakdown {
                last: next.checked_sub(1).map(|last| last as f64 * self.step),
                cause: cause.shifted(begin),
            })?;
            begin = end;
        }
        Ok(())
    }

    /// Recomputes the part of an interval before a breakdown, up to a sample.
    ///
    /// The interval begins at `begin` from the state `start` and has the samples `first` to
    /// `last`. Returns `None` if it has no motion or no sample before the breakdown.
    fn recompute_before_breakdown(
        &self,
        interval: &DrivenInterval,
        start: &[f64],
        (begin, first, mut last): (f64, usize, usize),
        cause: &IntegrationError,
    ) -> Option<TimeInterval> {
        let since = |sample: usize| sample as f64 * self.step - begin;
        let mut cause = cause.clone();
        for _ in 0..RECOMPUTE_ATTEMPTS {
            let reached = cause.time().unwrap_or(0.5 * since(last + 1));
            last = (first..=last).take_while(|sample| since(*sample) < reached).last()?;
            // a sample at the very start needs a short motion behind it
            let length = if since(last) > 0.0 { since(last) } else { 0.5 * reached };
            // a new flow, without memory of the failed attempt
            let mut flow = TimeHistory::flow(&interval.system, self.width, self.tolerance).ok()?;
            flow.set_recording(true);
            flow.set_excitation(&interval.system, interval.omega);
            match flow.run_accurately(&mut start.to_vec(), length) {
                Ok(()) => {
                    let path = flow.path(&interval.system, Symmetry::FullPeriod, length);
                    return Some(TimeInterval { begin, length, last: Some(last), path });
                }
                Err(again) => cause = again,
            }
        }
        None
    }

    /// Checks that motions of a system can be computed, with laws smoothed over `width` (m/s)
    /// if given.
    ///
    /// # Errors
    /// Returns [`MethodError`] if no integration takes the system.
    pub fn check(system: &System, width: Option<f64>) -> Result<(), MethodError> {
        TimeHistory::flow(system, width, None).map(drop)
    }

    fn flow(system: &System, width: Option<f64>, tolerance: Option<f64>) -> Result<Box<dyn Flow>, MethodError> {
        let mut flow = integrator_choice::integrator(system, width, TOLERANCE, NAME)
            .map_err(|error| error.with_alternatives(alternatives(system)))?;
        if let Some(tolerance) = tolerance {
            flow.set_tolerance(tolerance);
        }
        Ok(flow)
    }

    /// Returns the excitation frequency of the cycle that begins at `time`.
    ///
    /// In a run-up, this constant frequency ends the cycle at the same time as the continuously
    /// changing frequency, so the phase never lags.
    fn frequency(&self, time: f64) -> f64 {
        match self.excitation {
            Excitation::Free => 0.0,
            Excitation::Steady(omega) => omega,
            Excitation::RunUp { from, to, duration, scale: SweepScale::Logarithmic } => {
                let (rate, left) = ((to / from).ln() / duration, duration - time);
                if left <= 0.0 {
                    return to;
                }
                let begin = from * (rate * time).exp();
                // `ω (e^{rτ} - 1)/r = 2π`; a falling frequency may never complete the cycle
                let growth = TAU * rate / begin;
                let whole = if growth > -1.0 { growth.ln_1p() / rate } else { f64::INFINITY };
                if whole <= left {
                    return TAU / whole;
                }
                let turned = begin * (rate * left).exp_m1() / rate;
                TAU / (left + (TAU - turned) / to)
            }
            Excitation::RunUp { from, to, duration, scale: SweepScale::Linear } => {
                let (rate, left) = ((to - from) / duration, duration - time);
                if left <= 0.0 {
                    return to;
                }
                let begin = from + rate * time;
                // `ω τ + ½ ω' τ² = 2π`
                let discriminant = begin * begin + 2.0 * TAU * rate;
                let whole = 2.0 * TAU / (begin + discriminant.max(0.0).sqrt());
                if discriminant >= 0.0 && whole <= left {
                    return TAU / whole;
                }
                // the last frequency applies after the end of the change
                let turned = begin * left + 0.5 * rate * left * left;
                TAU / (left + (TAU - turned) / to)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cycles of a run-up end where the phase `2π f₀ T/ln r (r^(t/T) - 1)` is a multiple of
    /// 2π.
    #[test]
    fn cycles_of_a_logarithmic_run_up_keep_its_phase() {
        for (from, to) in [(10.0, 80.0), (80.0, 10.0)] {
            let duration = 20.0;
            let excitation = Excitation::RunUp { from, to, duration, scale: SweepScale::Logarithmic };
            let motion = TimeHistory {
                displacement: vec![],
                velocity: vec![],
                states: vec![],
                excitation,
                duration,
                step: 1.0,
                width: None,
                tolerance: None,
            };
            let (mut time, mut cycles) = (0.0, 0.0);
            let rate = (to / from).ln() / duration;
            while time < 0.9 * duration {
                time += TAU / motion.frequency(time);
                cycles += 1.0;
                let phase = from * (rate * time).exp_m1() / rate;
                assert!((phase / TAU - cycles).abs() < 1e-9, "{phase} {cycles}");
            }
            assert_eq!(motion.frequency(duration), to);
        }
    }
    use crate::law::{Coulomb, Cubic, FrictionContact, SharedLaw};
    use crate::model::{Axis, Force, GROUND, Joint, Mass, Model, Spring};
    use crate::structure::Structure;
    use nalgebra::dmatrix;

    /// A contact with preload sets off from rest. While it stays closed and its tangent does
    /// not move, its normal acts as a spring: `x = x₀ (1 - cos ωt)`, with
    /// `x₀ = preload/(k + kn)` about the static position.
    #[test]
    fn a_pressed_contact_sets_off_from_rest() {
        let (mass, k, kn, preload) = (2.0, 3e4, 5e3, 40.0);
        let law: SharedLaw =
            Arc::new(FrictionContact { tangential: 1e3, normal: kn, friction: 0.3, preload, tangents: 1 });
        let structure = Structure::new(
            vec!["x".into(), "y".into()],
            dmatrix![mass, 0.0; 0.0, mass],
            dmatrix![0.0, 0.0; 0.0, 0.0],
            dmatrix![k, 0.0; 0.0, k],
        );
        let axes = vec![Axis::new(vec![(0, 1.0)]), Axis::new(vec![(1, 1.0)])];
        let system = System::builder(structure.unwrap()).joint("j", law, axes).build().unwrap();
        let omega = ((k + kn) / mass).sqrt();
        let motion = TimeHistory {
            displacement: vec![0.0; 2],
            velocity: vec![0.0; 2],
            states: vec![],
            excitation: Excitation::Free,
            duration: 3.0 * TAU / omega,
            step: TAU / omega / 40.0,
            width: None,
            tolerance: None,
        };
        // the preload pushes against the closing direction
        let static_position = -preload / (k + kn);
        let mut worst = 0.0f64;
        let run = motion.run(&system, &mut |time, _, sample| {
            let expected = static_position * (1.0 - (omega * time).cos());
            worst = worst.max((sample.displacement[1] - expected).abs() / static_position.abs());
            assert_eq!(sample.displacement[0], 0.0);
            true
        });
        assert!(run.is_ok() && worst < 1e-4, "{run:?} {worst}");
    }

    /// `x'' + x - 2 x³ = 0` from rest at 1 is `1/cos t`. It is infinite at π/2, in the second
    /// interval, after 100 samples.
    #[test]
    fn a_motion_that_escapes_is_followed_until_it_does() {
        let between = || ["m".to_owned(), GROUND.to_owned()];
        let model = Model {
            masses: vec![Mass::new("m", 1.0)],
            springs: vec![Spring { between: between(), stiffness: 1.0, damping: 0.0 }],
            joints: vec![Joint { name: "j".into(), between: between(), law: Arc::new(Cubic { stiffness: -2.0 }) }],
            ..Model::default()
        };
        let end = 0.25 * TAU;
        let motion = TimeHistory {
            displacement: vec![1.0],
            velocity: vec![0.0],
            states: vec![],
            excitation: Excitation::Free,
            duration: 3.0 * end,
            step: end / 100.5,
            width: None,
            tolerance: None,
        };
        let mut count = 0;
        let run = motion.run(&model.assemble().unwrap(), &mut |time, _, sample| {
            let expected = 1.0 / time.cos();
            // the remaining time to infinity loses as many digits as the motion gained
            let error = (sample.displacement[0] / expected - 1.0).abs();
            assert!(error < 1e-6, "{time}: {error:e}");
            count += 1;
            true
        });
        let Err(TimeHistoryError::Breakdown { last: Some(last), cause: IntegrationError::Unbounded { time, place } }) =
            run
        else {
            panic!("{run:?}")
        };
        assert_eq!((count, place.as_deref()), (101, Some("m")));
        assert!((last - 100.0 * motion.step).abs() < 1e-12, "{last}");
        // the breakdown is reported at 1e5 times the velocity at the start of the interval (64
        // samples); the velocity is 1/(π/2 - t)²
        let began = 64.0 * motion.step;
        let left = (began.cos().powi(2) / began.sin() / 1e5).sqrt();
        assert!((0.0..left).contains(&(end - time)), "{time}");
    }

    /// Three rigid joints in a triangle share their forces in no unique way once all stick. The
    /// samples before that equal those of a shorter run, and the error carries the time.
    #[test]
    fn what_comes_before_a_breakdown_is_handed_on() {
        let between = [["a", GROUND], ["b", GROUND], ["a", "b"]].map(|pair| pair.map(str::to_owned));
        let law: SharedLaw = Arc::new(Coulomb { limit: 5.0 });
        let springs = between.iter().zip([2e4, 3e4]);
        let force = |on: &str, amplitude| Force { on: on.into(), amplitude, phase: 0.0, harmonic: 1 };
        let model = Model {
            masses: vec![Mass::new("a", 1.0), Mass::new("b", 0.7)],
            springs: springs
                .map(|(between, stiffness)| Spring { between: between.clone(), stiffness, damping: 3.0 })
                .collect(),
            joints: between
                .iter()
                .map(|between| Joint { name: between.concat(), between: between.clone(), law: law.clone() })
                .collect(),
            forces: vec![force("a", 20.0), Force { phase: 0.7, ..force("b", 12.0) }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let omega = TAU * 5.0;
        let motion = TimeHistory {
            displacement: vec![0.0; 2],
            velocity: vec![0.0; 2],
            states: vec![],
            excitation: Excitation::Steady(omega),
            duration: 1.0,
            step: TAU / omega / 64.0,
            width: None,
            tolerance: None,
        };
        let samples = |motion: &TimeHistory| {
            let mut samples = Vec::new();
            let run = motion.run(&system, &mut |time, _, sample| {
                samples.push((time, sample.displacement.clone()));
                true
            });
            (run, samples)
        };
        let (run, found) = samples(&motion);
        let Err(TimeHistoryError::Breakdown { last: Some(last), cause: IntegrationError::Redundant { time, .. } }) =
            run
        else {
            panic!("{run:?}")
        };
        assert!(last < time && time <= last + motion.step, "{last} {time}");
        assert_eq!(found.last().unwrap().0, last);
        let (run, short) = samples(&TimeHistory { duration: last - 0.5 * motion.step, ..motion.clone() });
        assert!(run.is_ok() && short.len() + 1 == found.len(), "{run:?}");
        for ((time, a), (_, b)) in short.iter().zip(&found) {
            a.iter().zip(b).for_each(|(a, b)| assert!((a - b).abs() < 1e-15, "{time}: {a} {b}"));
        }
    }

    /// A linear oscillator runs up through its resonance. The reference is the classical
    /// Runge-Kutta method with the phase of a continuously changing frequency.
    #[test]
    fn a_run_up_has_the_phase_of_its_frequency() {
        let between = || ["m".to_owned(), GROUND.to_owned()];
        let model = Model {
            masses: vec![Mass::new("m", 1.0)],
            springs: vec![Spring { between: between(), stiffness: 1e4, damping: 2.0 }],
            forces: vec![Force { on: "m".into(), amplitude: 5.0, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        };
        let (from, to) = (TAU * 10.0, TAU * 22.0);
        for (from, to, duration) in [(from, to, 2.0), (to, from, 3.0), (from, to, 20.0)] {
            let step = 1e-3;
            let run_up = TimeHistory {
                displacement: vec![0.0],
                velocity: vec![0.0],
                states: vec![],
                excitation: Excitation::RunUp { from, to, duration, scale: SweepScale::Linear },
                duration,
                step,
                width: None,
                tolerance: None,
            };
            let mut motion = Vec::new();
            run_up
                .run(&model.assemble().unwrap(), &mut |_, _, state| {
                    motion.push(state.displacement[0]);
                    true
                })
                .unwrap();
            let rate = |t: f64, [x, v]: [f64; 2]| {
                let phase = from * t + 0.5 * (to - from) / duration * t * t;
                [v, 5.0 * phase.cos() - 1e4 * x - 2.0 * v]
            };
            let (mut state, mut largest, mut worst) = ([0.0f64; 2], 0.0f64, 0.0f64);
            let small = step / 10.0;
            for (i, x) in motion.iter().enumerate() {
                largest = largest.max(state[0].abs());
                worst = worst.max((x - state[0]).abs());
                for j in 0..10 {
                    let t = i as f64 * step + f64::from(j) * small;
                    let on = |k: [f64; 2], h: f64| [state[0] + h * k[0], state[1] + h * k[1]];
                    let a = rate(t, state);
                    let b = rate(t + 0.5 * small, on(a, 0.5 * small));
                    let c = rate(t + 0.5 * small, on(b, 0.5 * small));
                    let d = rate(t + small, on(c, small));
                    state = std::array::from_fn(|k| state[k] + small / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]));
                }
            }
            // the frequency is constant in a cycle, so the phase error is the change over a
            // quarter of a cycle
            let change = (to - from).abs() / duration * (TAU / from.min(to)).powi(2) / 8.0;
            assert!(worst < (0.002 + change) * largest, "{from} {duration}: {worst} of {largest}, {change}");
        }
    }
}
