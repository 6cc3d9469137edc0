//! Expected time of a run, extrapolated from probes: a few points of the study that are computed
//! and measured.
//!
//! A probe computes two consecutive frequencies of a case, without and with a warm start, or the
//! beginning of a unit of work whose points depend on each other. Probes lie at the beginning,
//! in the middle and at the end of the study. They end at a time limit, write nothing, and leave
//! no state behind, so the results of a run do not depend on them. Their times are processor
//! times: the expected time is that of a machine that does nothing else.

use crate::case::study::Study;
use crate::check::summary;
use crate::kinds;
use crate::kinds::kind::Probe;
use crate::run::thread_time::{ThreadClock, ThreadTime};
use crate::run::work::{Computed, Context, PreparedCase, Share, UnitTask, WorkUnits};
use crate::syntax::format::{format_estimate, plural_suffix};
use std::fmt;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, mpsc};
use std::time::{Duration, Instant};
use stickslip::model::Substructure;
use stickslip::structure::Reduction;
use stickslip_numerics::interrupt::StopFlag;

/// Limit of the processor time of all probes of a study.
const TIME_LIMIT: Duration = Duration::from_secs(1);
/// Additional processor time for a probe that does not end at the limit, because one of its steps
/// is long. After that, its thread is abandoned and ends after this step.
const GRACE_TIME: Duration = Duration::from_millis(500);
/// Longest wait for probes that get little processor time on a busy machine. After that, the time
/// is unknown.
const LONGEST_WAIT: Duration = Duration::from_secs(10);

/// Expected time of a run on one thread.
#[derive(Debug, Clone, PartialEq)]
pub enum ExpectedTime {
    /// The measured time of the probes, extrapolated to all points.
    Extrapolated {
        /// Time of all points, s.
        seconds: f64,
        /// The probes in words.
        probes: String,
        /// True if the probes later in the study were not computed, or a point of them was not
        /// finished: its points may take longer.
        is_least: bool,
        /// Computations that the probes do not contain, in words.
        excluded: Option<String>,
    },
    /// The first probe did not end within the time limit.
    MoreThan {
        /// The time limit, s.
        seconds: f64,
        /// Name of one of the parts of the study: a point, a branch.
        part: &'static str,
        /// Number of these parts.
        parts: usize,
    },
}

impl fmt::Display for ExpectedTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ExpectedTime::Extrapolated { seconds, probes, is_least, excluded } => {
                let least = if *is_least && *seconds >= 1.0 { "at least " } else { "" };
                write!(f, "{least}{} on one thread", format_estimate(*seconds))?;
                if *seconds >= 1.0 {
                    write!(f, ", from {probes}")?;
                }
                excluded.iter().try_for_each(|excluded| write!(f, ", without {excluded}"))
            }
            ExpectedTime::MoreThan { seconds, parts: 1, .. } => write!(f, "more than {seconds} s on one thread"),
            ExpectedTime::MoreThan { seconds, part, parts } => {
                write!(f, "more than {seconds} s on one thread for one of {parts} {}", plural(part))
            }
        }
    }
}

impl ExpectedTime {
    /// Returns the line of the expected time below a summary.
    pub fn summary_line(&self) -> String {
        summary::line("time", &self.to_string())
    }

    /// Returns the announcement of a long run; `None` for a short one.
    pub fn announcement(&self) -> Option<String> {
        let least = match self {
            ExpectedTime::Extrapolated { seconds, .. } => *seconds,
            ExpectedTime::MoreThan { seconds, parts, .. } => *seconds * *parts as f64,
        };
        // Expected time above which a run announces it, s.
        (least >= 3600.0).then(|| format!("this run takes {self}; Ctrl-C ends the run and keeps the finished points"))
    }
}

/// Returns the plural of a noun.
fn plural(noun: &str) -> String {
    if noun.ends_with("ch") { format!("{noun}es") } else { format!("{noun}s") }
}

/// Expects the time of a run. `first` is the first case, if it is prepared; `stop` ends the probes
/// early.
///
/// Returns `None` if a probe failed, after a stop, or if the machine is too busy for the probes.
pub(super) fn expected_time(
    study: &Study,
    first: Option<Arc<PreparedCase>>,
    stop: &Arc<AtomicBool>,
) -> Option<ExpectedTime> {
    let plan = Plan::new(study);
    let (study, ended, clock) = (study.clone(), stop.clone(), Arc::new(OnceLock::new()));
    let (send, receive) = mpsc::channel();
    let own = clock.clone();
    std::thread::Builder::new()
        .spawn(move || {
            let all = measure_on_one_thread(&study, first, &plan, &ended, &own);
            // the receiver is gone if this thread was abandoned
            let _ = send.send(all.map(|all| plan.extrapolate(&all)));
        })
        .ok()?;
    let (limit, begun) = (TIME_LIMIT + GRACE_TIME, Instant::now());
    let mut wait = limit;
    loop {
        let time = receive.recv_timeout(wait);
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        match time {
            Ok(time) => return time?,
            Err(mpsc::RecvTimeoutError::Disconnected) => return None,
            Err(mpsc::RecvTimeoutError::Timeout) => {}
        }
        let used = match clock.get() {
            // the thread has not begun
            None => Duration::ZERO,
            // without a clock the time of this thread decides
            Some(clock) => clock.as_ref().and_then(ThreadClock::read).unwrap_or(limit),
        };
        if used >= limit {
            return Some(plan.more_than_limit());
        }
        if begun.elapsed() >= LONGEST_WAIT {
            return None;
        }
        wait = (limit - used).max(Duration::from_millis(50));
    }
}

/// The probes of a study.
#[derive(Debug, Clone, Copy)]
struct Plan {
    probe: Probe,
    /// Computations that the probes do not contain, in words.
    excluded: Option<&'static str>,
    /// True if points with slip are solved again with a larger basis of a reduced structure.
    checks_reduction: bool,
    cases: usize,
    /// Frequencies of a case.
    frequencies: usize,
    units: WorkUnits,
}

/// One probe.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Selection {
    cases: Range<usize>,
    points: Range<usize>,
}

/// The measured processor times of one probe, s.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Measurement {
    /// Preparation of the cases.
    preparing: f64,
    /// First point, without a warm start; of a unit, the time of all its parts.
    first: f64,
    /// Every other point.
    other: f64,
    /// Number of computed points.
    points: usize,
    /// True if the probe was computed to its end.
    complete: bool,
}

impl Plan {
    fn new(study: &Study) -> Plan {
        let kind = kinds::kind_of(study);
        let cases = study.cases();
        let frequencies = (study.points() / cases.max(1)).max(1);
        // the number of adaptive frequencies is known at the end of a curve only
        let probe = if study.is_adaptive() { Probe::Unit { name: "case" } } else { kind.probe };
        let excluded = match probe {
            Probe::Points { excluded, .. } => excluded(study),
            Probe::Unit { .. } => None,
        };
        let is_reduced = |own: &Substructure| !matches!(own.reduction, Reduction::None { .. });
        let checks_reduction = matches!(probe, Probe::Points { .. })
            && study.case(0).is_ok_and(|case| case.model.substructure.as_ref().is_some_and(is_reduced));
        Plan {
            probe,
            excluded,
            checks_reduction,
            cases,
            frequencies,
            units: WorkUnits::new(study, (kind.unit_size)(study)),
        }
    }

    /// Returns the number of parts of the study of which a probe computes one or two.
    fn parts(&self) -> usize {
        match self.probe {
            Probe::Points { .. } => self.cases * self.frequencies,
            Probe::Unit { .. } => self.units.len(),
        }
    }

    /// Returns the probes: at the beginning, in the middle and at the end.
    fn selections(&self) -> Vec<Selection> {
        let last = self.parts().saturating_sub(1);
        let mut all: Vec<Selection> = [0, last / 2, last].into_iter().map(|part| self.selection(part)).collect();
        all.dedup();
        all
    }

    fn selection(&self, part: usize) -> Selection {
        match self.probe {
            Probe::Points { .. } => {
                let (case, begin) = (part / self.frequencies, part % self.frequencies);
                let begin = begin.min(self.frequencies.saturating_sub(2));
                Selection { cases: case..case + 1, points: begin..(begin + 2).min(self.frequencies) }
            }
            Probe::Unit { .. } => {
                let unit = self.units.get(part);
                Selection { cases: unit.cases, points: unit.points }
            }
        }
    }

    fn more_than_limit(&self) -> ExpectedTime {
        let part = match self.probe {
            Probe::Points { .. } => "point",
            Probe::Unit { name, .. } => name,
        };
        ExpectedTime::MoreThan { seconds: TIME_LIMIT.as_secs_f64(), part, parts: self.parts() }
    }

    /// Extrapolates measured times to the whole study; `None` without a measurement.
    fn extrapolate(&self, all: &[Measurement]) -> Option<ExpectedTime> {
        if all.is_empty() {
            return Some(self.more_than_limit());
        }
        let is_least = all.len() < self.selections().len() || all.iter().any(|one| one.points == 0);
        let mean = |of: &dyn Fn(&Measurement) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        let (parts, units) = (self.parts() as f64, self.units.len() as f64);
        let (first, other) = (mean(&|one| one.first), mean(&|one| one.other));
        let preparing = units * mean(&|one| one.preparing);
        let (seconds, probes) = match self.probe {
            Probe::Points { .. } => {
                // a unit of frequencies and each case begin without a warm start
                let cold = units.max(self.cases as f64).min(parts);
                let points = all.iter().map(|one| one.points).sum();
                let probes = format!("{points} probe point{}", plural_suffix(points));
                (cold * first + (parts - cold) * other, probes)
            }
            Probe::Unit { name } => {
                let whole = all.iter().all(|one| one.complete);
                let probes = match (all.len(), whole) {
                    (1, true) => format!("one {name}"),
                    (1, false) => format!("a part of one {name}"),
                    (count, true) => format!("{count} {}", plural(name)),
                    (count, false) => format!("parts of {count} {}", plural(name)),
                };
                (parts * first, probes)
            }
        };
        let seconds = seconds + preparing;
        // what the probes lack takes less than they do, unless structures are reduced
        let excluded = match (self.excluded, self.checks_reduction) {
            (Some(excluded), true) => Some(format!("{excluded} and the check of the reduction")),
            (None, true) => Some("the check of the reduction".to_owned()),
            (excluded, false) => excluded.filter(|_| seconds >= 1.0).map(str::to_owned),
        };
        seconds.is_finite().then_some(ExpectedTime::Extrapolated { seconds, probes, is_least, excluded })
    }
}

/// Measures the probes in a pool of one thread; `None` if a probe failed.
fn measure_on_one_thread(
    study: &Study,
    first: Option<Arc<PreparedCase>>,
    plan: &Plan,
    stop: &Arc<AtomicBool>,
    clock: &OnceLock<Option<ThreadClock>>,
) -> Option<Vec<Measurement>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().ok()?;
    pool.install(|| {
        let _ = clock.set(ThreadClock::of_this_thread());
        let begun = ThreadTime::now();
        let selections = plan.selections();
        let mut all = Vec::with_capacity(selections.len());
        for (index, selection) in selections.iter().enumerate() {
            let limits = Limits {
                begun,
                probe: TIME_LIMIT.as_secs_f64() * (index + 1) as f64 / selections.len() as f64,
                all: TIME_LIMIT.as_secs_f64(),
                stop,
            };
            match measure(study, first.as_ref(), plan.probe, selection, &limits) {
                ProbeOutcome::Measured(one) => all.push(one),
                // one point of this probe takes longer than this
                ProbeOutcome::Nothing(seconds) if !all.is_empty() => {
                    let one =
                        Measurement { preparing: 0.0, first: seconds, other: seconds, points: 0, complete: false };
                    all.push(one);
                    break;
                }
                ProbeOutcome::Nothing(_) => break,
                ProbeOutcome::Failed => return None,
            }
        }
        Some(all)
    })
}

/// When a probe ends.
struct Limits<'a> {
    /// Beginning of all probes.
    begun: ThreadTime,
    /// Processor time after which the probe ends if it has a point, s.
    probe: f64,
    /// Processor time after which it ends in any case, s.
    all: f64,
    /// The stop flag of the caller.
    stop: &'a Arc<AtomicBool>,
}

/// The result of a probe.
enum ProbeOutcome {
    Measured(Measurement),
    /// The time limit came before the first point, after this time of computation, s.
    Nothing(f64),
    /// The method refuses the model of a case.
    Failed,
}

fn measure(
    study: &Study,
    first: Option<&Arc<PreparedCase>>,
    probe: Probe,
    selection: &Selection,
    limits: &Limits<'_>,
) -> ProbeOutcome {
    let (finished, share) = (Arc::new(Mutex::new(Vec::new())), Arc::new(Share::default()));
    let stamps = finished.clone();
    let stop_flag = {
        let (finished, share) = (finished.clone(), share.clone());
        let (begun, of_probe, of_all, stop) = (limits.begun, limits.probe, limits.all, limits.stop.clone());
        StopFlag::with_callback(move || {
            let any = match probe {
                Probe::Points { .. } => !finished.lock().unwrap_or_else(PoisonError::into_inner).is_empty(),
                Probe::Unit { .. } => share.get() > 0.0,
            };
            stop.load(Ordering::Relaxed)
                || ThreadTime::now().seconds_since(begun) >= if any { of_probe } else { of_all }
        })
    };
    let points = selection.points.len();
    let last_point = Arc::new(AtomicBool::new(false));
    let is_last = last_point.clone();
    let context = Context {
        threads: 1,
        // after the last point, nothing that belongs to the whole curve is computed
        stop: last_point,
        finished: Arc::new(move || {
            let mut stamps = stamps.lock().unwrap_or_else(PoisonError::into_inner);
            stamps.push(ThreadTime::now());
            is_last.store(matches!(probe, Probe::Points { .. }) && stamps.len() >= points, Ordering::Relaxed);
        }),
    };
    let begun = ThreadTime::now();
    let mut prepared = begun;
    let computed = catch_unwind(AssertUnwindSafe(|| {
        stop_flag.watch(|| {
            let case = |index: usize| match (index, first) {
                (0, Some(first)) => Some(first.clone()),
                _ => PreparedCase::new(study, index).ok().map(Arc::new),
            };
            let cases = selection.cases.clone().map(case).collect::<Option<Vec<_>>>()?;
            prepared = ThreadTime::now();
            let task = UnitTask { study, cases, points: selection.points.clone(), context: &context, share: &share };
            compute(study, probe, &task).ok()
        })
    }));
    let ended = ThreadTime::now();
    let complete = match computed {
        Ok(Some(_)) => true,
        Ok(None) => return ProbeOutcome::Failed,
        Err(_) if stop_flag.is_set() => false,
        // a panic belongs to the run
        Err(_) => return ProbeOutcome::Failed,
    };
    let preparing = prepared.seconds_since(begun);
    let stamps = finished.lock().unwrap_or_else(PoisonError::into_inner);
    match probe {
        Probe::Points { .. } => {
            let Some(cold) = stamps.first() else { return ProbeOutcome::Nothing(ended.seconds_since(prepared)) };
            let (first, rest) = (cold.seconds_since(prepared), ended.seconds_since(*cold));
            // the work after the last point belongs to all points in equal parts
            let (first, other) = match stamps.len() {
                1 => (first + if complete { rest } else { 0.0 }, first),
                count => (first, rest / (count - 1) as f64),
            };
            ProbeOutcome::Measured(Measurement { preparing, first, other, points: stamps.len(), complete })
        }
        Probe::Unit { .. } => {
            let share = if complete { 1.0 } else { share.get() };
            let first = ended.seconds_since(prepared) / share;
            match share > 0.0 {
                true => ProbeOutcome::Measured(Measurement { preparing, first, other: first, points: 1, complete }),
                false => ProbeOutcome::Nothing(ended.seconds_since(prepared)),
            }
        }
    }
}

fn compute(study: &Study, probe: Probe, task: &UnitTask<'_>) -> Computed {
    match probe {
        Probe::Points { compute, .. } => compute(task),
        Probe::Unit { .. } => (kinds::kind_of(study).compute)(task),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{CheckedStudy, check};
    use crate::{read_study, templates};

    fn couple(edits: &[(&str, &str)]) -> CheckedStudy {
        let text = templates::find("blade-couple").unwrap().study.to_owned();
        let text = edits.iter().fold(text, |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        });
        check(&read_study("couple.toml", &text, &[]).unwrap()).unwrap()
    }

    fn measurement(first: f64, other: f64) -> Measurement {
        Measurement { preparing: 0.0, first, other, points: 2, complete: true }
    }

    #[test]
    fn probes_are_two_points_at_the_beginning_the_middle_and_the_end() {
        // 4 cases of 241 frequencies
        let all = Plan::new(couple(&[]).study()).selections();
        let of = |case: usize, points: Range<usize>| Selection { cases: case..case + 1, points };
        assert_eq!(all, [of(0, 0..2), of(1, 239..241), of(3, 239..241)]);
        let plan = Plan::new(couple(&[("points = 241", "points = 2")]).study());
        assert_eq!(plan.selections(), [of(0, 0..2), of(1, 0..2), of(3, 0..2)]);
    }

    #[test]
    fn times_are_extrapolated_to_all_points() {
        let plan = Plan::new(couple(&[]).study());
        // four blocks of frequencies per case begin without a warm start
        let time = plan.extrapolate(&[measurement(1.0, 0.1), measurement(2.0, 0.1), measurement(3.0, 0.1)]).unwrap();
        let ExpectedTime::Extrapolated { seconds, .. } = &time else { panic!("{time:?}") };
        assert!((seconds - (16.0 * 2.0 + 948.0 * 0.1)).abs() < 1e-9, "{seconds}");
        let words = "about 2 minutes on one thread, from 6 probe points, without the refinement of peaks";
        assert_eq!(time.to_string(), words);
        assert_eq!(time.announcement(), None);
        let long = plan.extrapolate(&[measurement(20.0, 10.0)]).unwrap();
        assert!(long.announcement().unwrap().contains("Ctrl-C"), "{long}");
        // a quick run needs no remark, unless points of a reduced structure are solved again
        let quick = plan.extrapolate(&[measurement(1e-4, 1e-4); 3]).unwrap();
        assert_eq!(quick.to_string(), "less than a second on one thread");
        let reduced = Plan { checks_reduction: true, ..plan }.extrapolate(&[measurement(1e-4, 1e-4); 3]).unwrap();
        let words = "less than a second on one thread, without the refinement of peaks and the check of the reduction";
        assert_eq!(reduced.to_string(), words);
        // the last probe was not computed
        let least = plan.extrapolate(&[measurement(1.0, 0.1), measurement(1.0, 0.1)]).unwrap();
        assert!(least.to_string().starts_with("at least about 2 minutes on one thread"), "{least}");
        let unknown = plan.extrapolate(&[]).unwrap();
        assert_eq!(unknown.to_string(), "more than 1 s on one thread for one of 964 points");
    }

    #[test]
    fn a_stop_ends_the_probes() {
        let (running, stopped) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(true)));
        let checked = couple(&[]);
        assert!(checked.expected_time(&running).is_some());
        assert_eq!(checked.expected_time(&stopped), None);
    }

    /// Probes of every kind have a time.
    #[test]
    fn every_kind_is_probed() {
        let drive = "kind = \"response\"\nfrequency = { from = \"119.5 Hz\", to = \"122.5 Hz\", points = 241 }";
        let few = drive.replace("241", "9");
        let of = |kind: &str| few.replace("response", kind);
        let studies = [
            of("response"),
            of("orbit"),
            of("hysteresis"),
            of("performance"),
            format!(
                "{}\nover = {{ kt = {{ from = \"9 kN/m\", to = \"10 kN/m\", points = 2 }}, F0 = {{ from = \"9 N\", to = \"10 N\", \
                 points = 2 }} }}",
                of("map")
            ),
            drive.replace("points = 241", "tolerance = \"10 %\""),
            "kind = \"transient\"\nfrequency = \"121 Hz\"\ncycles = 20".to_owned(),
            "kind = \"campbell\"\nspeed = { from = \"10 Hz\", to = \"120 Hz\", points = 12 }".to_owned(),
        ];
        for text in studies {
            let checked = couple(&[(drive, &text)]);
            let time = checked.expected_time(&Arc::new(AtomicBool::new(false)));
            assert!(time.is_some(), "{text}");
        }
    }
}
