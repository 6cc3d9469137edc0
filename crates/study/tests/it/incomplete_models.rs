//! Random studies with absent parts: `check` and `run` refuse them with a message, or run to
//! complete results.
//!
//! Parts of the model are absent, every place has an imposed motion, a node has one direction,
//! or an entry occurs twice. `STICKSLIP_ABSENT_PARTS=2000` runs more studies,
//! `STICKSLIP_RANDOM_SEED=…` others.

#![allow(clippy::print_stdout)] // tests print their measurements

use crate::random::Chance;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use stickslip_numerics::interrupt::{Interrupted, StopFlag};
use stickslip_study::dataset::Dataset;
use stickslip_study::read_study;
use stickslip_study::run::{Context, check, run};
use stickslip_study::summary::ModelSummary;

/// Number of studies of a normal run, and the first seed.
const STUDIES: u64 = 200;
const SEED: u64 = 1;
/// Largest number of solver steps of a study: Newton steps, switches, time steps.
const STEPS: u64 = 10_000_000;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// Names of the model that the rest of the study uses.
#[derive(Default)]
struct Named {
    /// Nodes with their directions. A mass with one unnamed direction has an empty list.
    nodes: Vec<(String, Vec<&'static str>)>,
    joints: Vec<String>,
}

impl Named {
    /// Returns every place of the nodes.
    fn places(&self) -> Vec<String> {
        let of_node = |(node, directions): &(String, Vec<&str>)| -> Vec<String> {
            match directions.is_empty() {
                true => vec![node.clone()],
                false => directions.iter().map(|direction| format!("{node}.{direction}")).collect(),
            }
        };
        self.nodes.iter().flat_map(of_node).collect()
    }
}

/// Writes an entry, sometimes twice.
fn stated(chance: &mut Chance, text: &mut String, entry: &str) {
    let times = if chance.one_in(40) { 2 } else { 1 };
    (0..times).for_each(|_| text.push_str(entry));
}

fn other_end(chance: &mut Chance, places: &[String], place: &str) -> String {
    let others: Vec<&str> = places.iter().map(String::as_str).filter(|other| *other != place).collect();
    let same = chance.one_in(60);
    match others.is_empty() || chance.one_in(2) {
        _ if same => place.to_owned(),
        true => "ground".to_owned(),
        false => chance.of(&others).to_owned(),
    }
}

fn masses(chance: &mut Chance, text: &mut String) -> Named {
    let mut named = Named::default();
    let count = if chance.one_in(12) { 0 } else { chance.count(1, 3) };
    for i in 1..=count {
        let name = format!("m{i}");
        let directions: &[&str] = match chance.count(1, 6) {
            1 => &["x"],
            2 => &["x", "y"],
            3 => &["t", "n"],
            _ => &[],
        };
        let mut entry = format!("[[mass]]\nname = \"{name}\"\nmass = {:e}\n", chance.between(0.5, 2.0));
        if chance.one_in(20) {
            entry = format!("[[mass]]\nname = \"{name}\"\nmass = 0\n");
        }
        if !directions.is_empty() {
            let _ = writeln!(entry, "directions = {directions:?}");
        }
        stated(chance, text, &entry);
        named.nodes.push((name, directions.to_vec()));
    }
    named
}

fn springs(chance: &mut Chance, text: &mut String, places: &[String]) {
    if chance.one_in(6) {
        return;
    }
    for place in places {
        let entry = format!(
            "[[spring]]\nbetween = [\"{place}\", \"{}\"]\nstiffness = {:e}\ndamping = {:e}\n",
            other_end(chance, places, place),
            chance.between(5e3, 2e4),
            if chance.one_in(12) { 0.0 } else { chance.between(2.0, 20.0) }
        );
        stated(chance, text, &entry);
        if chance.one_in(2) {
            let entry = format!("[[spring]]\nbetween = [\"{place}\", \"ground\"]\nstiffness = 1e4\ndamping = 5\n");
            stated(chance, text, &entry);
        }
    }
}

const LAWS: &[&str] = &[
    "{ kind = \"jenkins\", stiffness = 5e3, limit = 2 }",
    "{ kind = \"coulomb\", limit = 1 }",
    "{ kind = \"gap\", gap = \"0.1 mm\", stiffness = 2e4 }",
    "{ kind = \"cubic\", stiffness = 1e9 }",
    "{ kind = \"jenkins\", stiffness = 5e3, limit = 0 }",
];
const LAWS_OF_A_PLANE: &[&str] = &[
    "{ kind = \"friction-contact\", tangential = 2e4, normal = 3e4, friction = 0.4, preload = 5 }",
    "{ kind = \"jenkins-2d\", stiffness = 5e3, limit = 2 }",
    "{ kind = \"coulomb-2d\", limit = 1 }",
];

fn joints(chance: &mut Chance, text: &mut String, named: &mut Named) {
    if named.nodes.is_empty() || chance.one_in(6) {
        return;
    }
    for j in 0..chance.count(1, 2) {
        let (node, directions) = named.nodes[chance.count(0, named.nodes.len() - 1)].clone();
        let (law, places) = match directions.len() {
            2 if chance.one_in(2) => (chance.of(LAWS_OF_A_PLANE), vec![node.clone()]),
            0 => (chance.of(LAWS), vec![node.clone()]),
            _ => (chance.of(LAWS), directions.iter().map(|direction| format!("{node}.{direction}")).collect()),
        };
        let place = places[chance.count(0, places.len() - 1)].clone();
        let other = match place == node {
            true if !directions.is_empty() => "ground".to_owned(),
            _ => other_end(chance, &named.places(), &place),
        };
        let name = format!("j{j}");
        let entry = format!("[[joint]]\nname = \"{name}\"\nbetween = [\"{place}\", \"{other}\"]\nlaw = {law}\n");
        stated(chance, text, &entry);
        named.joints.push(name);
    }
}

fn excitation(chance: &mut Chance, text: &mut String, places: &[String]) {
    let harmonic = |chance: &mut Chance| if chance.one_in(6) { chance.count(0, 3) } else { 1 };
    let every = chance.one_in(6);
    let moved = if every { places.len() } else { usize::from(chance.one_in(8)).min(places.len()) };
    for place in &places[..moved] {
        let amplitude = chance.between(1e-5, 3e-4);
        let entry =
            format!("[[motion]]\non = \"{place}\"\namplitude = {amplitude:e}\nharmonic = {}\n", harmonic(chance));
        stated(chance, text, &entry);
    }
    if moved == places.len() || chance.one_in(8) {
        return;
    }
    for _ in 0..chance.count(1, 2) {
        let on = &places[chance.count(moved, places.len() - 1)];
        let entry = format!(
            "[[force]]\non = \"{on}\"\namplitude = {:e}\nharmonic = {}\n",
            chance.between(0.5, 5.0),
            harmonic(chance)
        );
        stated(chance, text, &entry);
    }
}

fn study(chance: &mut Chance, text: &mut String, named: &Named) {
    let kinds: &[&str] = match named.joints.is_empty() {
        true => &["response", "orbit", "transient", "campbell", "modes", "nodal-diameter"],
        false => &[
            "response",
            "orbit",
            "hysteresis",
            "hysteresis",
            "transient",
            "performance",
            "branch",
            "modes",
            "campbell",
        ],
    };
    let kind = chance.of(kinds);
    let keys = match kind {
        "response" => "frequency = { from = \"12 Hz\", to = \"20 Hz\", points = 5 }",
        "orbit" => "frequency = \"15 Hz\"\nsamples = 16",
        "hysteresis" => "frequency = \"15 Hz\"\nsamples = 16",
        "transient" => "frequency = \"15 Hz\"\ncycles = 3",
        "performance" => {
            "frequency = { from = \"14 Hz\", to = \"18 Hz\", points = 3 }\nvary = { F = [\"0.5 N\", \"1 N\", \"2 N\"] }"
        }
        "branch" => {
            "frequency = { from = \"12 Hz\", to = \"20 Hz\" }\nsteps = 4\nharmonics = 3\nsamples = 64\ntolerance = 0.5"
        }
        "modes" => "amplitude = { from = \"1 um\", to = \"1 mm\", points = 3 }\nharmonics = 3\nsamples = 64",
        "campbell" => "speed = { from = \"1 Hz\", to = \"10 Hz\", points = 3 }",
        _ => "modes = 2\n[disk]\nsectors = 3",
    };
    let _ = writeln!(text, "[study]\nkind = \"{kind}\"\n{keys}");
}

/// Generates a study whose parts may be absent.
fn study_text(chance: &mut Chance) -> String {
    let mut text = "schema = 1\n[parameters]\nF = \"1 N\"\n".to_owned();
    let mut named = masses(chance, &mut text);
    let places = named.places();
    springs(chance, &mut text, &places);
    joints(chance, &mut text, &mut named);
    excitation(chance, &mut text, &places);
    study(chance, &mut text, &named);
    text
}

/// Outcome of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Ending {
    Refused,
    /// The run ended with a complete dataset.
    Ran,
}

/// Returns what a dataset lacks.
fn lacks(dataset: &Dataset) -> Option<String> {
    if dataset.record.points.values().sum::<u64>() == 0 {
        return Some("it has no points".to_owned());
    }
    let uneven = |table: &&stickslip_study::dataset::Table| {
        table.columns.iter().any(|column| column.values.len() != table.rows())
    };
    dataset.tables.iter().find(uneven).map(|table| format!("columns of {} differ in length", table.name))
}

/// Reads, checks and runs a study.
fn one(text: &str) -> Result<Ending, String> {
    let Ok(study) = read_study("study.toml", text, &[]) else { return Ok(Ending::Refused) };
    if check(&study).is_err() {
        return match run(&study, &Context::without_progress(1)) {
            Err(_) => Ok(Ending::Refused),
            Ok(_) => Err("check refuses it, and it runs".to_owned()),
        };
    }
    ModelSummary::new(&study).map_err(|error| format!("it has no summary: {error}"))?;
    let dataset =
        run(&study, &Context::without_progress(1)).map_err(|error| format!("accepted, and then refused: {error}"))?;
    lacks(&dataset).map_or(Ok(Ending::Ran), Err)
}

/// Runs [`one`] on one thread. A panic is an error of the study, and so are too many solver
/// steps: the studies have few masses and points.
fn watched(text: &str) -> Result<Ending, String> {
    let steps = AtomicU64::new(0);
    let stop = StopFlag::with_callback(move || steps.fetch_add(1, Ordering::Relaxed) >= STEPS);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    // the pool has one thread, so the flag reaches all units
    let ended = pool.install(|| catch_unwind(AssertUnwindSafe(|| stop.watch(|| one(text)))));
    ended.unwrap_or_else(|panic| match panic.is::<Interrupted>() {
        true => Err(format!("it has not ended after {STEPS} solver steps")),
        false => Err(format!("it panics: {}", panic.downcast_ref::<String>().cloned().unwrap_or_default())),
    })
}

#[test]
fn incomplete_studies_run_or_are_refused() {
    let count = number("STICKSLIP_ABSENT_PARTS").unwrap_or(STUDIES);
    let first = number("STICKSLIP_RANDOM_SEED").unwrap_or(SEED);
    let mut endings = BTreeMap::<Ending, u64>::new();
    let mut faults = Vec::new();
    for seed in first..first + count {
        let text = study_text(&mut Chance::new(seed));
        match watched(&text) {
            Ok(ending) => *endings.entry(ending).or_default() += 1,
            Err(fault) => faults.push(format!("study {seed}: {fault}\n{text}")),
        }
    }
    println!("{count} studies: {endings:?}");
    faults.iter().for_each(|fault| println!("{}", fault.lines().next().unwrap_or_default()));
    assert!(faults.is_empty(), "{} faults, the first: {}", faults.len(), faults[0]);
    let ran = endings.get(&Ending::Ran).copied().unwrap_or_default();
    assert!(2 * ran >= count, "{ran} of {count} run to the end");
}

/// A contact with a preload whose two directions are imposed, so that nothing can move freely,
/// has its loop.
#[test]
fn an_imposed_contact_has_its_loop() {
    let text = r#"
schema = 1
[[motion]]
on = "m.t"
amplitude = "20 um"
[[mass]]
name = "m"
mass = "1 g"
directions = ["t", "n"]
[[motion]]
on = "m.n"
amplitude = "3 um"
[[joint]]
name = "pad"
between = ["m", "ground"]
law = { kind = "friction-contact", tangential = "20 N/um", normal = "25 N/um", friction = 0.4, preload = "100 N" }
[study]
kind = "hysteresis"
frequency = "100 Hz"
"#;
    let study = read_study("study.toml", text, &[]).unwrap();
    check(&study).unwrap();
    let found = run(&study, &Context::without_progress(1)).unwrap();
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    let work: f64 = found.tables.iter().find_map(|table| table.numbers("dissipation_J")).unwrap().iter().sum();
    // reference: 200,000 steps of a period in Python, for a slider whose limit is 0.4 of the
    // normal force
    let expected = 2.733_375e-3;
    assert!((work / expected - 1.0).abs() < 1e-3, "{work} J instead of {expected} J");
}
