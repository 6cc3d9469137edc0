//! Random studies of every kind: each ends within ten times its time estimate and little
//! memory, without a panic.
//!
//! No row that counts as converged contains NaN. The studies are texts, so the test includes
//! the reader. The time is that of the computing thread if the system provides it, so other
//! work on the machine does not count. `STICKSLIP_RANDOM_STUDIES=20000` runs more studies,
//! `STICKSLIP_RANDOM_SEED=…` others.

#![allow(clippy::print_stdout)] // tests print their measurements

mod random;

use nalgebra::DMatrix;
use random::{Chance, study_text};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use stickslip::method::event_driven::EventDriven;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::{self, Method, Options};
use stickslip::orbit::{Accuracy, Orbit};
use stickslip_study::dataset::{CellValues, Dataset, Table};
use stickslip_study::run::{CONVERGED, Context, check, run};
use stickslip_study::summary::ModelSummary;
use stickslip_study::{Study, read_study};

/// Number of studies of a normal run, and the first seed.
const STUDIES: usize = 1000;
const SEED: u64 = 1;
/// Largest ratio of the time of a study to its estimate.
const FACTOR: f64 = 10.0;
/// Additional time, s. Estimates below it do not matter. A search without an orbit takes up to
/// half a second where a successful one takes a millisecond.
const SLACK: f64 = 4.0;
/// Number of factorizations of matrices with 24 rows, and their total time, s, in a test build
/// on the machine of the estimates. The time is long enough for a clock with ticks of 4 ms.
const FACTORS: u32 = 20_000;
const ALL_FACTORS: f64 = 0.05;
/// Studies with a longer estimate are only read and checked, s.
const LONG: f64 = 10.0;
/// Number of studies closest to their limits that are printed.
const NEAREST: usize = 8;
/// Largest memory of the whole process, bytes.
const MEMORY: u64 = 500_000_000;
/// Smallest percentage of accepted studies. The others test that refusals are errors.
const ACCEPTED: usize = 60;

/// A clock of the thread that created it: its processor time, or the time of day if the system
/// does not provide it.
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

/// Returns the time of this machine relative to that of the estimates, at least one. It is
/// measured by factorizations of small dense matrices, which no change of the program affects.
fn slowness() -> f64 {
    let matrix = DMatrix::from_fn(24, 24, |i, k| ((i * 7919 + k * 104_729 + 1) as f64).sin());
    let factors = || {
        let clock = Clock::start();
        let sum: f64 = (0..FACTORS).map(|k| (&matrix * (1.0 + f64::from(k))).lu().determinant()).sum();
        std::hint::black_box(sum);
        clock.seconds()
    };
    (0..5).map(|_| factors()).fold(f64::INFINITY, f64::min).max(ALL_FACTORS) / ALL_FACTORS
}

/// The study that a thread is running.
struct Running {
    seed: u64,
    text: String,
    limit: f64,
    clock: Clock,
}

/// Returns the peak memory of the process, bytes; `None` if the system does not provide it.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// Returns the error of a dataset, if there is one.
fn fault(study: &Study, dataset: &Dataset) -> Option<String> {
    if dataset.record.interrupted {
        return Some("the run was interrupted".to_owned());
    }
    if dataset.kind != study.kind().name || dataset.record.points.values().sum::<u64>() == 0 {
        return Some(format!("points are missing: {:?}", dataset.record.points));
    }
    // An undamped or unconstrained linear structure has no response that could be a reference.
    dataset.tables.iter().filter(|table| table.name != "references").find_map(not_finite)
}

/// Returns whether a column of a converged orbit must be finite. The phase of a free structure
/// and the truncation of methods without a series do not exist.
fn must_be_finite(name: &str) -> bool {
    ["_amplitude_m", "_mean_m", "_dissipation_J", "_slip_fraction", "residual", "energy_gap"]
        .iter()
        .any(|end| name.ends_with(end))
}

fn not_finite(table: &Table) -> Option<String> {
    let status = table.columns.iter().find(|column| column.name == "status");
    let all: Vec<String>;
    let status = match status.map(|column| &column.values) {
        Some(CellValues::Text(status)) => status,
        // tables without a status contain converged orbits only
        _ => {
            all = vec![CONVERGED.to_owned(); table.rows()];
            &all
        }
    };
    let timed = ["orbit", "loops", "motion"].contains(&table.name.as_str());
    for column in &table.columns {
        let CellValues::Number(values) = &column.values else { continue };
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

/// A study that was accepted.
struct Done {
    seed: u64,
    kind: &'static str,
    /// Measured and estimated time, s; zero if the study was not run because it would take too
    /// long.
    seconds: f64,
    estimate: f64,
    usual: f64,
    /// Number of points by status.
    points: BTreeMap<String, u64>,
}

/// Reads and runs one study; returns `None` if it was refused.
fn one(seed: u64, text: &str, slot: &Mutex<Option<Running>>, slowness: f64) -> Result<Option<Done>, String> {
    let running =
        |limit: f64| Some(Running { seed, text: text.to_owned(), limit: limit * slowness, clock: Clock::start() });
    *slot.lock().unwrap() = running(SLACK);
    let Ok(study) = read_study("random.toml", text, &[]) else { return Ok(None) };
    if check(&study).is_err() {
        return Ok(None);
    }
    let summary = ModelSummary::new(&study).map_err(|error| error.to_string())?;
    let (estimate, usual) = (summary.longest_time_s, summary.usual_time_s);
    if estimate > number("STICKSLIP_RANDOM_LONG").map_or(LONG, |long| long as f64) {
        let kind = study.kind().name;
        return Ok(Some(Done { seed, kind, seconds: 0.0, estimate: 0.0, usual: 0.0, points: BTreeMap::new() }));
    }
    *slot.lock().unwrap() = running(SLACK + FACTOR * estimate);
    if number("STICKSLIP_RANDOM_STUDIES") == Some(1) {
        println!("{text}\nestimated {estimate:.2} s");
    }
    let clock = Clock::start();
    let dataset =
        run(&study, &Context::without_progress(1)).map_err(|error| format!("accepted, and then refused: {error}"))?;
    match fault(&study, &dataset) {
        Some(fault) => Err(fault),
        None => {
            let kind = study.kind().name;
            Ok(Some(Done { seed, kind, seconds: clock.seconds(), estimate, usual, points: dataset.record.points }))
        }
    }
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

#[test]
fn random_studies_end_in_time() {
    let slowness = slowness();
    let count = number("STICKSLIP_RANDOM_STUDIES").map_or(STUDIES, |count| count as usize);
    let first = number("STICKSLIP_RANDOM_SEED").unwrap_or(SEED);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let next = Arc::new(AtomicUsize::new(0));
    let slots: Vec<Arc<Mutex<Option<Running>>>> = (0..threads).map(|_| Arc::default()).collect();
    let faults: Arc<Mutex<Vec<String>>> = Arc::default();
    let done: Arc<Mutex<Vec<Done>>> = Arc::default();
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
                    // a panic of the program is an error of its study
                    let run = || std::panic::catch_unwind(|| one(seed, &text, &slot, slowness));
                    let result = pool.install(run).unwrap_or_else(|_| Err("it panics".to_owned()));
                    *slot.lock().unwrap() = None;
                    match result {
                        Ok(Some(one)) => done.lock().unwrap().push(one),
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
        let of_kind: Vec<&Done> = done.iter().filter(|one| one.kind == kind.info.name).collect();
        let sum = |of: fn(&Done) -> f64| of_kind.iter().map(|one| of(one)).sum::<f64>();
        let (time, estimate, usual) = (sum(|one| one.seconds), sum(|one| one.estimate), sum(|one| one.usual));
        let longer = of_kind.iter().filter(|one| one.seconds > 2.0 * one.usual + 0.05).count();
        let mut points: BTreeMap<&str, u64> = BTreeMap::new();
        for (status, count) in of_kind.iter().flat_map(|one| &one.points) {
            *points.entry(status).or_default() += count;
        }
        println!(
            "{}: {} studies, {time:.1} s, estimated {usual:.1} to {estimate:.1} s, {longer} take longer than twice the first; {points:?}",
            kind.info.name,
            of_kind.len()
        );
        assert!(of_kind.len() * 30 >= count / 2, "{} of {count} are of the kind {}", of_kind.len(), kind.info.name);
    }
    // the studies closest to their limits
    let share = |one: &Done| one.seconds / slowness / (SLACK + FACTOR * one.estimate);
    let mut nearest: Vec<&Done> = done.iter().collect();
    nearest.sort_by(|a, b| share(b).total_cmp(&share(a)));
    for one in nearest.iter().take(NEAREST) {
        println!(
            "study {}, {}: {:.2} s, estimated {:.2} to {:.2} s",
            one.seed, one.kind, one.seconds, one.usual, one.estimate
        );
    }
    if let Some(peak) = peak_memory() {
        println!("{} MB", peak / 1_000_000);
        assert!(peak <= MEMORY, "{peak} bytes");
    }
}

/// Number of models whose methods are compared.
const COMPARED: usize = 400;
/// Largest ratio of an error to its estimate. Estimates come from the omitted harmonics or from
/// the decay of the transient. Measured on 3000 models: 4.6 with harmonic balance, 8 with
/// `transient`, each on one model.
const ESTIMATE: f64 = 10.0;
/// Relative difference of amplitudes below which methods are not compared: residuals are at
/// most 1e-9.
const CLOSED: f64 = 1e-7;

/// Returns the largest amplitude, and the largest difference of amplitudes.
fn distance(one: &Orbit, other: &Orbit) -> (f64, f64) {
    let pairs = one.places.iter().zip(&other.places).map(|(a, b)| (a.amplitude(), b.amplitude()));
    pairs.fold((0.0, 0.0), |(size, gap), (a, b)| (size.max(a), gap.max((a - b).abs())))
}

#[test]
fn methods_agree_within_their_errors() {
    let count = number("STICKSLIP_RANDOM_STUDIES").map_or(COMPARED, |count| count as usize);
    let first = number("STICKSLIP_RANDOM_SEED").unwrap_or(SEED);
    let (mut compared, mut faults) = ([0, 0], Vec::new());
    for seed in first..first + count as u64 {
        let text = study_text(&mut Chance::new(seed));
        let Ok(study) = read_study("random.toml", &text, &[]) else { continue };
        let case = study.case(0).unwrap();
        let (Some(omega), Ok(system)) = (case.frequencies.and_then(|f| f.get(0)), case.model.assemble()) else {
            continue;
        };
        // the system has at most one orbit, except for offsets of stuck joints
        if !system.is_incrementally_stable() {
            continue;
        }
        let Ok(mut exact) = EventDriven.solver(&system) else { continue };
        let Ok(exact) = exact.orbit(omega, None) else { continue };
        let others: [Box<dyn Method>; 2] = [
            Box::new(HarmonicBalance::default()),
            method::find("transient").map(|row| (row.build)(&settled())).unwrap().unwrap(),
        ];
        for (which, method) in others.iter().enumerate() {
            let Ok(mut solver) = method.solver(&system) else { continue };
            let Ok(orbit) = solver.orbit(omega, None) else { continue };
            if exact.is_in_continuum() || orbit.is_in_continuum() || orbit.evidence.accuracy != Accuracy::Converged {
                continue;
            }
            compared[which] += 1;
            let allowed = ESTIMATE * orbit.evidence.error_estimate.unwrap_or(0.0) + CLOSED;
            let (size, gap) = distance(&exact, &orbit);
            if gap > allowed * size {
                let name = method.name();
                faults.push(format!(
                    "study {seed}: {name} is {:.1e} away, allowed are {allowed:.1e}\n{text}",
                    gap / size
                ));
            }
        }
    }
    println!("{compared:?} orbits compared");
    faults.iter().for_each(|fault| println!("{}", fault.lines().next().unwrap_or_default()));
    assert!(faults.is_empty(), "{} of {compared:?}: {}", faults.len(), faults[0]);
    assert!(compared.iter().all(|compared| *compared * 10 >= count), "{compared:?} of {count}");
}

/// Options of method `transient`: an end after this number of periods.
fn settled() -> Options {
    Options::from([("periods".to_owned(), 2000.0)])
}
