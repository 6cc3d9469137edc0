//! The items of the corpus by class. The seeds and numbers are frozen: a record of today must be
//! comparable with one of last year.

use crate::random::{Chance, study_text};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use stickslip::method::TABLE as METHODS;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::{Method, Options, Solver};
use stickslip::model::System;
use stickslip::orbit::{Orbit, OrbitError, Seed};
use stickslip_study::dataset::{CellValues, Column, Table};
use stickslip_study::run::{Context, check, run};
use stickslip_study::{Study, read_file, read_study};
use stickslip_verification::loose_dampers::loose_damper;
use stickslip_verification::{random_row, random_system};

/// Names of the classes.
pub const CLASSES: [&str; 6] = ["paper", "gallery", "random", "audit", "rows", "loose"];
/// Class of the studies in a folder that the user names.
pub const FILES: &str = "files";

/// One model or study of the corpus.
pub struct Item {
    pub name: String,
    run: Box<dyn Fn() -> Result<Vec<Table>, String> + Send + Sync>,
}

impl Item {
    /// Returns the computed tables.
    ///
    /// # Errors
    /// The reason why a study is refused.
    pub fn tables(&self) -> Result<Vec<Table>, String> {
        (self.run)()
    }

    fn new(name: String, run: impl Fn() -> Result<Vec<Table>, String> + Send + Sync + 'static) -> Self {
        Item { name, run: Box::new(run) }
    }
}

/// Returns the items of a class, or `None` if no class has this name.
pub fn items(class: &str, folder: Option<&Path>) -> Option<Vec<Item>> {
    let studies = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../studies");
    let items = match class {
        "paper" => below(&studies.join("paper")),
        "gallery" => below(&studies.join("gallery")),
        // Number of random studies, systems, rows and loose dampers.
        "random" => (1..=1000).map(random_study).collect(),
        "audit" => (0..1000).map(audited).collect(),
        "rows" => (0..60).map(row).collect(),
        "loose" => (0..60).map(loose).collect(),
        FILES => below(folder?),
        _ => return None,
    };
    Some(items)
}

/// Every study file below a folder, in the order of its path.
fn below(folder: &Path) -> Vec<Item> {
    let mut files = Vec::new();
    collect(folder, &mut files);
    files.sort();
    let item = |file: PathBuf| {
        let name = file.strip_prefix(folder).unwrap_or(&file).with_extension("");
        let name = name.to_string_lossy().replace(['/', '\\'], "-");
        Item::new(name, move || tables(read_file(&file, &[]).map_err(|error| error.to_string())?))
    };
    files.into_iter().map(item).collect()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|end| end == "toml") {
            files.push(path);
        }
    }
}

fn tables(study: Study) -> Result<Vec<Table>, String> {
    check(&study).map_err(|error| error.to_string())?;
    Ok(run(&study, &Context::without_progress(1)).map_err(|error| error.to_string())?.tables)
}

fn random_study(seed: u64) -> Item {
    Item::new(format!("{seed:04}"), move || {
        let text = study_text(&mut Chance::new(seed));
        let study = read_study("random.toml", &text, &[]).map_err(|error| error.to_string())?;
        let points: usize = (0..study.cases()).filter_map(|k| Some(study.case(k).ok()?.frequencies?.len())).sum();
        // Points of a random study above which it is skipped: it would take minutes.
        if points > 2000 {
            return Err(format!("{points} points"));
        }
        tables(study)
    })
}

/// A random system in every method that takes it, except `auto` and `transient`.
fn audited(seed: u64) -> Item {
    Item::new(format!("{seed:04}"), move || {
        let (system, omega) = random_system(seed);
        let methods = METHODS.iter().filter(|row| !["auto", "transient"].contains(&row.name));
        let table = |row: &stickslip::method::MethodInfo| {
            let method = (row.build)(&Options::new()).ok()?;
            let mut solver = method.solver(&system).ok()?;
            Some(points(row.name, &system, &mut *solver, &[omega]))
        };
        Ok(methods.filter_map(table).collect())
    })
}

fn row(seed: u64) -> Item {
    Item::new(format!("{seed:04}"), move || {
        let (system, omega) = random_row(seed);
        by_harmonic_balance(&system, &[omega, 1.02 * omega])
    })
}

fn loose(seed: u64) -> Item {
    Item::new(format!("{seed:04}"), move || {
        let damper = loose_damper(seed);
        by_harmonic_balance(&damper.system(), &damper.frequencies)
    })
}

fn by_harmonic_balance(system: &System, rates: &[f64]) -> Result<Vec<Table>, String> {
    let method = HarmonicBalance::default();
    let mut solver = method.solver(system).map_err(|error| error.to_string())?;
    Ok(vec![points(method.name(), system, &mut *solver, rates)])
}

/// A table of orbits at these frequencies (rad/s), each with a warm start at the last one.
fn points(name: &str, system: &System, solver: &mut dyn Solver, rates: &[f64]) -> Table {
    let mut start: Option<Seed> = None;
    let found: Vec<Result<Orbit, OrbitError>> = rates
        .iter()
        .map(|omega| {
            let found = solver.orbit_near(*omega, start.as_ref());
            start = found.as_ref().ok().map(|orbit| orbit.seed());
            found
        })
        .collect();
    let number = |name: String, value: &dyn Fn(&Orbit) -> f64| Column {
        name,
        values: CellValues::Number(found.iter().map(|found| found.as_ref().map_or(f64::NAN, value)).collect()),
    };
    let mut columns = vec![Column {
        name: "frequency_Hz".to_owned(),
        values: CellValues::Number(rates.iter().map(|w| w / TAU).collect()),
    }];
    for place in 0..system.places().len() {
        columns.push(number(format!("amplitude_{place}_m"), &|orbit| orbit.places[place].amplitude()));
    }
    columns.push(number("truncation".to_owned(), &|orbit| orbit.evidence.error_estimate.unwrap_or(f64::NAN)));
    let iterations = |found: &Result<Orbit, OrbitError>| found.as_ref().map_or(0, |o| o.evidence.iterations as u64);
    columns.push(Column {
        name: "iterations".to_owned(),
        values: CellValues::Integer(found.iter().map(iterations).collect()),
    });
    let text = |name: &str, value: &dyn Fn(&Result<Orbit, OrbitError>) -> &'static str| Column {
        name: name.to_owned(),
        values: CellValues::Text(found.iter().map(|found| value(found).to_owned()).collect()),
    };
    columns.push(text("found_by", &|found| found.as_ref().map_or("", |orbit| orbit.evidence.found_by)));
    columns.push(text("status", &|found| match found {
        Ok(orbit) => orbit.evidence.accuracy.status(),
        Err(error) => error.status(),
    }));
    Table { name: name.to_owned(), columns }
}
