//! Random studies of every kind: each ends within its time estimate times ten, within a little memory, without a panic, and says of no number
//! that does not exist that it converged.
//!
//! The studies are texts, so that the reader takes part. Time is that of the thread that computes, where the system tells it: other work on the
//! same machine does not count. `STICKSLIP_RANDOM_STUDIES=20000` runs more of them, `STICKSLIP_RANDOM_SEED=…` others.

#![allow(clippy::print_stdout)] // tests say what they measured

mod random;

use random::{Chance, study_text};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use stickslip_study::dataset::{Dataset, Table, Values};
use stickslip_study::run::{CONVERGED, Context, check, run};
use stickslip_study::summary::ModelSummary;
use stickslip_study::{Study, read_study};

/// Studies of a usual run, and the first seed.
const STUDIES: usize = 1000;
const SEED: u64 = 1;
/// How much longer than estimated a study may take.
const FACTOR: f64 = 10.0;
/// What it may take beside, s: estimates below that are of no interest to anybody.
const SLACK: f64 = 1.0;
/// Studies that are estimated to take longer than this are read and checked only, s.
const LONG: f64 = 2.0;
/// Most memory of the whole process, bytes.
const MEMORY: u64 = 500_000_000;
/// Fewest studies in a hundred that are accepted; the others test that refusals are errors.
const ACCEPTED: usize = 60;

/// A clock of the thread that made it: the time that it computed, where Linux tells it, or the time of day.
struct Clock {
    schedstat: Option<PathBuf>,
    start: Instant,
    computed: f64,
}

impl Clock {
    fn start() -> Self {
        let task = std::fs::read_link("/proc/thread-self").ok();
        let schedstat = task.map(|task| PathBuf::from("/proc").join(task).join("schedstat"));
        let mut clock = Clock { schedstat, start: Instant::now(), computed: 0.0 };
        clock.computed = clock.total();
        clock
    }

    fn total(&self) -> f64 {
        let text = self.schedstat.as_ref().and_then(|path| std::fs::read_to_string(path).ok());
        let nanoseconds = text.as_ref().and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
        nanoseconds.map_or_else(|| self.start.elapsed().as_secs_f64(), |nanoseconds| nanoseconds * 1e-9)
    }

    fn seconds(&self) -> f64 {
        self.total() - self.computed
    }
}

/// What a thread is at.
struct Running {
    seed: u64,
    text: String,
    limit: f64,
    clock: Clock,
}

/// Most memory that the process has had, bytes, where Linux tells it.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// What is wrong with a dataset, if anything is.
fn fault(study: &Study, dataset: &Dataset) -> Option<String> {
    if dataset.record.interrupted {
        return Some("the run was interrupted".to_owned());
    }
    if dataset.kind != study.kind().name || dataset.record.points.values().sum::<u64>() == 0 {
        return Some(format!("points are missing: {:?}", dataset.record.points));
    }
    dataset.tables.iter().find_map(|table| not_finite(table))
}

/// Columns that a converged orbit has: of a free structure the phase, and of methods that need no series the truncation, do not exist.
fn must_be_finite(name: &str) -> bool {
    ["_amplitude_m", "_mean_m", "_dissipation_J", "_slip_fraction", "residual", "energy_gap"]
        .iter()
        .any(|end| name.ends_with(end))
}

fn not_finite(table: &Table) -> Option<String> {
    let status = table.columns.iter().find(|column| column.name == "status");
    let all: Vec<String>;
    let status = match status.map(|column| &column.values) {
        Some(Values::Text(status)) => status,
        // motions and loops are of orbits that converged
        _ => {
            all = vec![CONVERGED.to_owned(); table.rows()];
            &all
        }
    };
    let timed = ["orbit", "loops", "motion"].contains(&table.name.as_str());
    for column in &table.columns {
        let Values::Number(values) = &column.values else { continue };
        if !timed && !must_be_finite(&column.name) {
            continue;
        }
        for (row, value) in values.iter().enumerate() {
            if status.get(row).is_some_and(|status| status == CONVERGED) && !value.is_finite() {
                return Some(format!("{}.{} in row {row} is {value}, and converged", table.name, column.name));
            }
        }
    }
    None
}

/// Reads and runs one study; whether it was accepted.
fn one(seed: u64, text: &str, slot: &Mutex<Option<Running>>) -> Result<Option<(String, f64, f64)>, String> {
    let running = |limit: f64| Some(Running { seed, text: text.to_owned(), limit, clock: Clock::start() });
    *slot.lock().unwrap() = running(SLACK);
    let Ok(study) = read_study("random.toml", text, &[]) else { return Ok(None) };
    if check(&study).is_err() {
        return Ok(None);
    }
    let estimate = ModelSummary::new(&study).map_err(|error| error.to_string())?.seconds;
    if estimate > number("STICKSLIP_RANDOM_LONG").map_or(LONG, |long| long as f64) {
        return Ok(Some((study.kind().name.to_owned(), 0.0, 0.0)));
    }
    *slot.lock().unwrap() = running(SLACK + FACTOR * estimate);
    if number("STICKSLIP_RANDOM_STUDIES") == Some(1) {
        println!("{text}\nestimated {estimate:.2} s");
    }
    let clock = Clock::start();
    let dataset =
        run(&study, &Context::unwatched(1)).map_err(|error| format!("accepted, and then refused: {error}"))?;
    match fault(&study, &dataset) {
        Some(fault) => Err(fault),
        None => Ok(Some((study.kind().name.to_owned(), clock.seconds(), estimate))),
    }
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

#[test]
fn random_studies_end_in_time() {
    let count = number("STICKSLIP_RANDOM_STUDIES").map_or(STUDIES, |count| count as usize);
    let first = number("STICKSLIP_RANDOM_SEED").unwrap_or(SEED);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let next = Arc::new(AtomicUsize::new(0));
    let slots: Vec<Arc<Mutex<Option<Running>>>> = (0..threads).map(|_| Arc::default()).collect();
    let faults: Arc<Mutex<Vec<String>>> = Arc::default();
    let done: Arc<Mutex<Vec<(String, f64, f64)>>> = Arc::default();
    let workers: Vec<_> = slots
        .iter()
        .map(|slot| {
            let (next, slot, faults, done) = (next.clone(), slot.clone(), faults.clone(), done.clone());
            std::thread::spawn(move || {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= count {
                        break;
                    }
                    let seed = first + index as u64;
                    let text = study_text(&mut Chance::new(seed));
                    // a panic of the program is a fault of its study
                    let run = || std::panic::catch_unwind(|| one(seed, &text, &slot));
                    let result = pool.install(run).unwrap_or_else(|_| Err("it panics".to_owned()));
                    *slot.lock().unwrap() = None;
                    match result {
                        Ok(Some(times)) => done.lock().unwrap().push(times),
                        Ok(None) => {}
                        Err(fault) => faults.lock().unwrap().push(format!("study {seed}: {fault}\n{text}")),
                    }
                }
            })
        })
        .collect();
    // this thread is the watchdog
    while workers.iter().any(|worker| !worker.is_finished()) {
        std::thread::sleep(Duration::from_millis(50));
        for slot in &slots {
            let slot = slot.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            if let Some(Running { seed, text, limit, clock }) = &*slot {
                let seconds = clock.seconds();
                assert!(seconds <= *limit, "study {seed} takes {seconds:.1} s, more than {limit:.1} s:\n{text}");
            }
        }
    }
    let faults = faults.lock().unwrap();
    faults.iter().for_each(|fault| println!("{}", fault.lines().next().unwrap_or_default()));
    assert!(faults.is_empty(), "{} faults, the first: {}", faults.len(), faults[0]);
    let done = done.lock().unwrap();
    assert!(done.len() * 100 >= ACCEPTED * count, "{} of {count} are accepted", done.len());
    for kind in stickslip_study::kinds::TABLE {
        let of_kind: Vec<_> = done.iter().filter(|one| one.0 == kind.name).collect();
        let (time, estimate) = of_kind.iter().fold((0.0, 0.0), |(a, b), one| (a + one.1, b + one.2));
        println!("{}: {} studies, {time:.1} s, estimated {estimate:.1} s", kind.name, of_kind.len());
        assert!(of_kind.len() * 30 >= count / 2, "{} of {count} are of the kind {}", of_kind.len(), kind.name);
    }
    if let Some(peak) = peak_memory() {
        println!("{} MB", peak / 1_000_000);
        assert!(peak <= MEMORY, "{peak} bytes");
    }
}
