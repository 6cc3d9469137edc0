//! Random studies of every kind: each ends with little memory and without a panic.
//!
//! No row that counts as converged contains NaN. The studies are texts, so the test includes
//! the reader. A study ends early after a number of solver steps, which is the same on every
//! machine. `STICKSLIP_RANDOM_STUDIES=20000` runs more studies, `STICKSLIP_RANDOM_SEED=…`
//! others, `STICKSLIP_RANDOM_STEPS=…` longer ones.

#![allow(clippy::print_stdout)] // tests print their measurements

use crate::random::{Chance, NOT_DRAWN, study_text};
use allocation_counter::measure;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use stickslip::method::event_driven::EventDriven;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::{self, Method, Options};
use stickslip::orbit::{Accuracy, Orbit};
use stickslip_numerics::interrupt::{Interrupted, StopFlag};
use stickslip_study::dataset::{CellValues, Dataset, Table};
use stickslip_study::run::{CONVERGED, Context, check, run};
use stickslip_study::{Study, read_study};

/// Number of studies of a normal run, and the first seed.
const STUDIES: usize = 400;
const SEED: u64 = 1;
/// Number of solver steps after which a study ends: Newton steps, switches, time steps.
const STEPS: u64 = 2000;
/// Fraction of the steps for studies of modes: a step solves all harmonics of the structure at
/// once, which takes up to 50 ms for a template with twelve blades.
const STEPS_OF_MODES: u64 = 10;
/// Number of studies with the most steps that are printed.
const LONGEST: usize = 8;
/// Largest memory of a study, bytes.
const MEMORY: u64 = 500_000_000;
/// Smallest percentage of accepted studies. The others test that refusals are errors.
const ACCEPTED: usize = 60;
/// Largest percentage of studies that end early.
const ENDED_EARLY: usize = 25;

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
    steps: u64,
    /// Largest memory at one time, bytes.
    memory: u64,
    /// Number of points by status; `None` if the study ended early.
    points: Option<BTreeMap<String, u64>>,
}

/// Reads and runs one study; returns `None` if it was refused.
fn one(seed: u64, text: &str) -> Result<Option<Done>, String> {
    let Ok(study) = read_study("random.toml", text, &[]) else { return Ok(None) };
    if check(&study).is_err() {
        return Ok(None);
    }
    if number("STICKSLIP_RANDOM_STUDIES") == Some(1) {
        println!("{text}");
    }
    let share = if study.kind().name == "modes" { STEPS_OF_MODES } else { 1 };
    let most = number("STICKSLIP_RANDOM_STEPS").unwrap_or(STEPS) / share;
    let steps = Arc::new(AtomicU64::new(0));
    let count = steps.clone();
    let stop = StopFlag::with_callback(move || count.fetch_add(1, Ordering::Relaxed) >= most);
    // the pool has one thread, so the flag reaches all units
    let mut ran = None;
    let memory = measure(|| {
        ran = Some(catch_unwind(AssertUnwindSafe(|| stop.watch(|| run(&study, &Context::without_progress(1))))));
    });
    let (kind, memory) = (study.kind().name, memory.bytes_max);
    let done = |points| Done { seed, kind, steps: steps.load(Ordering::Relaxed), memory, points };
    match ran.expect("the study ran") {
        Err(panic) if panic.is::<Interrupted>() => Ok(Some(done(None))),
        Err(_) => Err("it panics".to_owned()),
        Ok(Err(error)) => Err(format!("accepted, and then refused: {error}")),
        Ok(Ok(dataset)) => match fault(&study, &dataset) {
            Some(fault) => Err(fault),
            None => Ok(Some(done(Some(dataset.record.points)))),
        },
    }
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

#[test]
fn random_studies_end_without_faults() {
    let count = number("STICKSLIP_RANDOM_STUDIES").map_or(STUDIES, |count| count as usize);
    let first = number("STICKSLIP_RANDOM_SEED").unwrap_or(SEED);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let next = Arc::new(AtomicUsize::new(0));
    let faults: Arc<Mutex<Vec<String>>> = Arc::default();
    let done: Arc<Mutex<Vec<Done>>> = Arc::default();
    let workers: Vec<_> = (0..threads)
        .map(|_| {
            let (next, faults, done) = (next.clone(), faults.clone(), done.clone());
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
                    let run = || catch_unwind(|| one(seed, &text));
                    let result = pool.install(run).unwrap_or_else(|_| Err("it panics".to_owned()));
                    match result {
                        Ok(Some(one)) => done.lock().unwrap().push(one),
                        Ok(None) => {}
                        Err(fault) => faults.lock().unwrap().push(format!("study {seed}: {fault}\n{text}")),
                    }
                }
            })
        })
        .collect();
    workers.into_iter().for_each(|worker| worker.join().unwrap());
    let faults = faults.lock().unwrap();
    faults.iter().for_each(|fault| println!("{}", fault.lines().next().unwrap_or_default()));
    assert!(faults.is_empty(), "{} faults, the first: {}", faults.len(), faults[0]);
    let done = done.lock().unwrap();
    assert!(done.len() * 100 >= ACCEPTED * count, "{} of {count} are accepted", done.len());
    let early = done.iter().filter(|one| one.points.is_none()).count();
    assert!(early * 100 <= ENDED_EARLY * count.max(100), "{early} of {count} end early");
    for kind in stickslip_study::kinds::TABLE.iter().filter(|kind| !NOT_DRAWN.contains(&kind.info.name)) {
        let of_kind: Vec<&Done> = done.iter().filter(|one| one.kind == kind.info.name).collect();
        let mut points: BTreeMap<&str, u64> = BTreeMap::new();
        for (status, count) in of_kind.iter().filter_map(|one| one.points.as_ref()).flatten() {
            *points.entry(status).or_default() += count;
        }
        let early = of_kind.iter().filter(|one| one.points.is_none()).count();
        println!("{}: {} studies, {early} end early; {points:?}", kind.info.name, of_kind.len());
        assert!(of_kind.len() * 30 >= count / 2, "{} of {count} are of the kind {}", of_kind.len(), kind.info.name);
    }
    let mut longest: Vec<&Done> = done.iter().collect();
    longest.sort_by_key(|one| std::cmp::Reverse(one.steps));
    for one in longest.iter().take(LONGEST) {
        println!("study {}, {}: {} steps", one.seed, one.kind, one.steps);
    }
    if let Some(largest) = done.iter().max_by_key(|one| one.memory) {
        println!("study {}, {}: {} MB", largest.seed, largest.kind, largest.memory / 1_000_000);
        assert!(largest.memory <= MEMORY, "study {}: {} bytes", largest.seed, largest.memory);
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
        let Ok(exact) = exact.orbit(omega) else { continue };
        let others: [Box<dyn Method>; 2] = [
            Box::new(HarmonicBalance::default()),
            method::find("transient").map(|row| (row.build)(&settled())).unwrap().unwrap(),
        ];
        for (which, method) in others.iter().enumerate() {
            let Ok(mut solver) = method.solver(&system) else { continue };
            let Ok(orbit) = solver.orbit(omega) else { continue };
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
