//! Runs of studies. The newest run of a page wins: it stops the older one of the same slot.
//!
//! An answer is a sequence of lines, each a JSON object: `begin`, `progress`, `partial` (the
//! results of the finished units of a run that takes long), and at the end
//! `result`, `error`, `expect` (the study takes long and waits) or `superseded`. A client that
//! disappears stops its run.

use super::access::Refusal;
use super::routes::State;
use crate::study::answer::{Tables, answer, partial_answer};
use crate::study::catalog::Source;
use crate::study::change::{Change, changed};
use crate::study::description;
use crate::study::response_quantity::ResponseQuantity;
use crate::study::view::{View, ViewSettings, show};
use axum::body::Body;
use axum::http::StatusCode;
use futures_util::stream;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::convert::Infallible;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use stickslip_study::read_study_with;
use stickslip_study::result_block::Block;
use stickslip_study::run::{CheckedStudy, Context, ExpectedTime, check};
use tokio::sync::mpsc;

/// A request for a run.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RunRequest {
    /// Identifier of the page.
    client: String,
    /// Part of the page. A new run of a slot stops the older one.
    slot: String,
    /// The study, an entry of the catalog.
    study: String,
    /// Its changes.
    #[serde(default)]
    changes: Vec<Change>,
    /// Subject of the computation.
    view: View,
    /// True for an answer with all tables.
    #[serde(default)]
    tables: bool,
    /// The quantity of a response that is drawn; the amplitude if absent.
    quantity: Option<ResponseQuantity>,
    /// True if a run that takes longer than [`RunSettings::patience`] must wait.
    #[serde(default)]
    wait: bool,
}

/// Limits of runs.
#[derive(Debug, Clone, Copy)]
struct RunSettings {
    /// Largest number of runs at a time. Default 24: ten pages with two slots each, and some more.
    runs: usize,
    /// Largest number of threads of runs, with those that have lost their slot and end after
    /// their current orbits. Default 96; a thread that waits takes 0.1 MB.
    threads: usize,
    /// Largest length of a name in a request. Default 64.
    name: usize,
    /// Expected time above which a run waits for a button, s. Default 2.
    patience: f64,
    /// Interval between two lines of progress. Default 100 ms.
    progress: Duration,
    /// Least interval between two partial results. Default 300 ms; a figure that takes long to
    /// make is sent less often.
    partial: Duration,
    /// Memory limit of a run, bytes. Default 1 GB: several runs fit into the memory of a laptop.
    memory: u64,
}

impl Default for RunSettings {
    fn default() -> Self {
        RunSettings {
            runs: 24,
            threads: 96,
            name: 64,
            patience: 2.0,
            progress: Duration::from_millis(100),
            partial: Duration::from_millis(300),
            memory: 1_000_000_000,
        }
    }
}

/// The runs of all pages.
#[derive(Debug, Default)]
pub(crate) struct Runs {
    newest: Mutex<HashMap<Slot, Newest>>,
    /// Number of runs that have not ended.
    running: AtomicUsize,
    settings: RunSettings,
}

/// The newest run of a slot.
#[derive(Debug)]
struct Newest {
    stop: Arc<AtomicBool>,
    events: mpsc::UnboundedSender<Value>,
}

impl Newest {
    /// Stops the run and ends its answer. Its client does not wait for its current orbits.
    fn supersede(&self) {
        self.stop.store(true, Ordering::Relaxed);
        // the receiver is gone if the client is
        let _ = self.events.send(superseded());
    }
}

fn superseded() -> Value {
    json!({ "event": "superseded" })
}

/// A part of a page.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Slot {
    client: String,
    part: String,
}

impl Runs {
    fn newest(&self) -> MutexGuard<'_, HashMap<Slot, Newest>> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn stop_all(&self) {
        self.newest().values().for_each(|run| run.stop.store(true, Ordering::Relaxed));
    }

    /// Begins a run and stops the older one of the slot. `None` if too many are running.
    fn begin(&self, slot: Slot, state: Arc<State>, events: mpsc::UnboundedSender<Value>) -> Option<Run> {
        let mut newest = self.newest();
        if newest.len() >= self.settings.runs && !newest.contains_key(&slot) {
            return None;
        }
        let counted = self.running.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |count| {
            (count < self.settings.threads).then_some(count + 1)
        });
        counted.ok()?;
        let stop = Arc::new(AtomicBool::new(false));
        if let Some(older) = newest.insert(slot.clone(), Newest { stop: stop.clone(), events }) {
            older.supersede();
        }
        Some(Run { slot, stop, state })
    }
}

/// A run in progress. Dropping it frees its place.
struct Run {
    slot: Slot,
    stop: Arc<AtomicBool>,
    state: Arc<State>,
}

impl Drop for Run {
    fn drop(&mut self) {
        let runs = &self.state.runs;
        runs.running.fetch_sub(1, Ordering::Relaxed);
        let mut newest = runs.newest();
        if newest.get(&self.slot).is_some_and(|run| Arc::ptr_eq(&run.stop, &self.stop)) {
            newest.remove(&self.slot);
        }
    }
}

/// Stops a run when its answer is dropped, because the client is gone.
struct StopGuard(Arc<AtomicBool>);

impl Drop for StopGuard {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Starts a run and returns its answer.
///
/// # Errors
/// A refusal: a name is too long, or too many runs are in progress.
pub(crate) fn start(state: Arc<State>, request: RunRequest) -> Result<Body, Refusal> {
    let settings = state.runs.settings;
    if [&request.client, &request.slot].iter().any(|name| name.len() > settings.name) {
        return Err(Refusal { status: StatusCode::BAD_REQUEST, reason: "a name in the request is too long" });
    }
    let slot = Slot { client: request.client.clone(), part: request.slot.clone() };
    let busy = Refusal { status: StatusCode::SERVICE_UNAVAILABLE, reason: "too many runs are in progress" };
    let (send, receive) = mpsc::unbounded_channel();
    let run = state.runs.begin(slot, state.clone(), send.clone()).ok_or(busy)?;
    let guard = StopGuard(run.stop.clone());
    let progress = send.clone();
    let points = Arc::new(AtomicUsize::new(0));
    let (counted, stop) = (points.clone(), run.stop.clone());
    let unread = Arc::new(AtomicBool::new(false));
    let read = unread.clone();
    tokio::task::spawn_blocking(move || {
        let answers = Answers { send: send.clone(), unread };
        let last = catch_unwind(AssertUnwindSafe(|| execute(&run, &request, &points, &answers)));
        let last = last.unwrap_or_else(|_| {
            json!({ "event": "error", "message": "the computation failed; this is a bug of Stickslip, please report the study" })
        });
        let stopped = run.stop.load(Ordering::Relaxed);
        // the receiver is gone if the client is
        let _ = send.send(if stopped { superseded() } else { last });
    });
    tokio::spawn(async move {
        let mut known = 0;
        while !stop.load(Ordering::Relaxed) && !progress.is_closed() {
            tokio::time::sleep(settings.progress).await;
            let now = counted.load(Ordering::Relaxed);
            if now == usize::MAX {
                return;
            }
            if std::mem::replace(&mut known, now) != now
                && progress.send(json!({ "event": "progress", "done": now })).is_err()
            {
                return;
            }
        }
    });
    let lines = stream::unfold(Some((receive, guard, read)), |open| async move {
        let (mut receive, guard, read) = open?;
        let value: Value = receive.recv().await?;
        if value["event"] == "partial" {
            read.store(false, Ordering::Relaxed);
        }
        // the answer ends with its last event, even if a report of progress is still on its way
        let goes_on = ["begin", "progress", "partial"].iter().any(|event| value["event"] == *event);
        let rest = goes_on.then_some((receive, guard, read));
        Some((Ok::<String, Infallible>(format!("{value}\n")), rest))
    });
    Ok(Body::from_stream(lines))
}

/// The way of the events of a run to its client.
struct Answers {
    send: mpsc::UnboundedSender<Value>,
    /// True while the client has not read the last partial result.
    unread: Arc<AtomicBool>,
}

/// When partial results are sent.
struct PartialResults {
    due: Instant,
    least: Duration,
}

impl PartialResults {
    /// Sends a partial result if it is time for one and the client has read the last one.
    fn send(&mut self, answers: &Answers, result: impl FnOnce() -> Value) {
        let begun = Instant::now();
        if begun < self.due || answers.unread.swap(true, Ordering::Relaxed) {
            return;
        }
        // the receiver is gone if the client is
        let _ = answers.send.send(result());
        // at most a tenth of the time is spent on partial results
        self.due = Instant::now() + self.least.max(9 * begun.elapsed());
    }
}

/// Computes the last line of an answer. `points` counts finished points, and is the largest
/// number at the end.
fn execute(run: &Run, request: &RunRequest, points: &Arc<AtomicUsize>, answers: &Answers) -> Value {
    let last = compute(run, request, points, answers).unwrap_or_else(|error| error);
    points.store(usize::MAX, Ordering::Relaxed);
    last
}

fn compute(run: &Run, request: &RunRequest, points: &Arc<AtomicUsize>, answers: &Answers) -> Result<Value, Value> {
    let wrong = |message: String| json!({ "event": "error", "message": message });
    let settings = run.state.runs.settings;
    let source = run.state.catalog.source(&request.study).map_err(wrong)?;
    let mut document = changed(&source.text, &request.changes).map_err(|error| wrong(error.to_string()))?;
    let mut view = request.view.clone();
    if let (View::Study { output, .. }, Some(name)) = (&mut view, request.quantity.and_then(ResponseQuantity::output)) {
        output.push(name.to_owned());
    }
    show(&mut document, &view, &ViewSettings::default()).map_err(|error| wrong(error.to_string()))?;
    let Source { file, .. } = &source;
    let invalid = |error| description::error(&error, &source);
    let study = read_study_with(file, &document.to_string(), &run.state.structures).map_err(invalid)?;
    let study = study.with_memory_limit(settings.memory);
    let checked = check(&study).map_err(invalid)?;
    if request.wait
        && let Some(expected) = long(&checked, run, settings.patience)
    {
        return Ok(json!({ "event": "expect", "text": expected.to_string() }));
    }
    let all = (!study.is_adaptive()).then(|| study.points());
    // the receiver is gone if the client is
    let _ = answers.send.send(json!({ "event": "begin", "points": all }));
    let counter = points.clone();
    let context = Context {
        threads: run.state.threads,
        stop: run.stop.clone(),
        finished: Arc::new(move || _ = counter.fetch_add(1, Ordering::Relaxed)),
    };
    let mut partial = PartialResults { due: Instant::now() + settings.partial, least: settings.partial };
    let mut seen = |block: &Block| partial.send(answers, || partial_answer(&study, block));
    let dataset = checked.run_in_parts(&context, &mut seen).map_err(invalid)?;
    if run.stop.load(Ordering::Relaxed) {
        return Ok(Value::Null);
    }
    let tables = match (&request.view, request.tables) {
        (View::Orbit { .. }, _) => Tables::Motion,
        (_, true) => Tables::All,
        (_, false) => Tables::Small,
    };
    Ok(answer(&study, &dataset, tables, request.quantity))
}

/// Returns the expected time of a run if it is longer than `patience`.
fn long(checked: &CheckedStudy, run: &Run, patience: f64) -> Option<ExpectedTime> {
    let threads = run.state.threads.max(1) as f64;
    checked.expected_time(&run.stop).filter(|time| match time {
        ExpectedTime::Extrapolated { seconds, .. } => *seconds > patience * threads,
        ExpectedTime::MoreThan { .. } => true,
    })
}
