//! Random systems with random laws in every method that takes them: small systems with full
//! matrices, and long rows and rings.
//!
//! Each orbit is compared with small steps in time ([`stickslip_verification::newmark_reference`]),
//! which share no code with any method. Environment variables extend the audit:
//!
//! - `STICKSLIP_AUDIT_MODELS=1000`: number of small systems;
//! - `STICKSLIP_AUDIT_ANY=300`: number of systems with any law parameters;
//! - `STICKSLIP_AUDIT_ROWS=100`: number of rows and rings;
//! - `STICKSLIP_AUDIT_FIRST=SEED`: first seed.
//!
//! The audit prints the orbits that agree, the refusals and failures with their reasons, and
//! the orbits that the reference cannot judge. An unjudged orbit does not count as correct.

#![allow(clippy::print_stdout)] // tests print measured values

use std::collections::BTreeMap;
use stickslip::method::TABLE as METHODS;
use stickslip::model::System;
use stickslip::orbit::Orbit;
use stickslip_verification::newmark_reference::Reference;
use stickslip_verification::{random_row, random_system, random_system_of_any_parameters};

/// Default numbers of models.
const MODELS: u64 = 12;
const ANY: u64 = 12;
const ROWS: u64 = 2;
/// Default first seed of the systems with any law parameters; the reference settles for the
/// default ones.
const FIRST_OF_ANY: u64 = 20;
/// Default first seed of the rows; the default rows and the small systems take 15 s.
const FIRST_ROW: u64 = 4;
/// Steps per period of the reference, and the finer steps if it disagrees. Its error is some
/// 1e-4: `(2π 3/500)²/12` for the third harmonic.
const STEPS: [usize; 2] = [500, 4000];
/// Most periods until the reference settles.
const PERIODS: usize = 40;
/// Allowed difference to the reference, relative to the largest amplitude: the error of the
/// reference, or of a method's tolerance of 1e-3.
const NEAR: f64 = 5e-3;
/// If finer steps reduce the difference by this factor, the reference converges to the orbit
/// and is merely too coarse. It smooths rigid and steep laws, and their creep in stick is
/// proportional to its step.
const COMES: f64 = 0.5;
/// Relative change over the last period below which the reference has settled.
const SETTLED: f64 = 1e-4;
/// Tolerance of method `transient`.
const WAITED: f64 = 1e-6;
/// In a long audit, method `transient` runs for one in this number of models with step laws.
const RARELY: u64 = 8;
/// Largest fraction of orbits without a judgement; one more orbit is allowed.
const UNJUDGED: f64 = 0.05;
/// Largest fraction of orbits that may fail; one more orbit is allowed.
const UNEXPLAINED: f64 = 0.02;

fn variable(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Returns the distance between an orbit and the motion that small steps reach from its state,
/// in m and relative to its largest amplitude. Returns `None` if that motion does not settle.
fn distance(system: &System, omega: f64, orbit: &Orbit, steps: usize) -> Option<(f64, f64)> {
    let start = orbit.sample(0.0);
    let reference = Reference::new(system, omega, steps, &start.displacement, &start.velocity);
    let mut reference = reference.with_states(orbit.initial_state.get(2 * system.dofs()..).unwrap_or_default());
    let (amplitudes, change) = reference.settle(PERIODS, SETTLED);
    if change > SETTLED || reference.unsolved_steps > 0 {
        return None;
    }
    let size = amplitudes.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let places = orbit.places.iter().zip(&amplitudes);
    let apart = places.map(|(place, a)| (place.amplitude() - a).abs()).fold(0.0, f64::max);
    Some((apart, apart / size))
}

#[test]
fn every_orbit_is_a_motion() {
    let models = variable("STICKSLIP_AUDIT_MODELS", MODELS);
    audit(&random_system, 0, models, models > MODELS);
}

/// Laws with any valid parameters: zero, either sign, any count.
#[test]
fn every_orbit_of_any_parameters_is_a_motion() {
    audit(&random_system_of_any_parameters, FIRST_OF_ANY, variable("STICKSLIP_AUDIT_ANY", ANY), false);
}

/// Harmonic balance uses modes or the banded form here, and has a dozen coupled joints.
#[test]
fn every_orbit_of_a_row_is_a_motion() {
    audit(&random_row, FIRST_ROW, variable("STICKSLIP_AUDIT_ROWS", ROWS), false);
}

/// Runs all methods on the models of `made`. A `long` audit also runs `transient` in equal
/// steps on some models, which takes up to half a minute per orbit.
fn audit(made: &dyn Fn(u64) -> (System, f64), first: u64, models: u64, long: bool) {
    let first = variable("STICKSLIP_AUDIT_FIRST", first);
    let mut counts: BTreeMap<(&str, String), usize> = BTreeMap::new();
    let (mut wrong, mut unexplained, mut unjudged) = (Vec::new(), Vec::new(), Vec::new());
    let (mut tried, mut agree) = (0usize, 0usize);
    for seed in first..first + models {
        let (system, omega) = made(seed);
        let laws: Vec<&str> = system.joints().iter().map(|joint| joint.law().name()).collect();
        for row in METHODS.iter().filter(|row| row.name != "auto") {
            // method `transient` is slow; this tolerance is enough here
            let options = row.options.iter().filter(|o| row.name == "transient" && o.key == "tolerance");
            let method = (row.build)(&options.map(|o| (o.key.to_owned(), WAITED)).collect()).unwrap();
            let quick = system
                .joints()
                .iter()
                .all(|joint| joint.law().ideal_elements().is_some() || joint.law().rate().is_some());
            if row.name == "transient" && !quick && (!long || seed % RARELY != 0) {
                continue;
            }
            let mut count = |what: String| *counts.entry((row.name, what)).or_default() += 1;
            let mut solver = match method.solver(&system) {
                Ok(solver) => solver,
                // a method that cannot take a law names it
                Err(error) => {
                    assert!(laws.iter().any(|law| error.to_string().contains(law)), "{seed}: {error}");
                    count("refused".to_owned());
                    continue;
                }
            };
            tried += 1;
            let orbit = match solver.orbit(omega) {
                Ok(orbit) => orbit,
                Err(error) => {
                    count(error.status().to_owned());
                    unexplained.push(format!("{seed} {laws:?} {}: {error}", row.name));
                    continue;
                }
            };
            let allowed = NEAR + 3.0 * orbit.evidence.error_estimate.unwrap_or(0.0);
            // a reference that is too coarse for a law cannot judge
            let (mut coarser, mut judged) = (None, None);
            for steps in STEPS {
                (coarser, judged) = (judged, distance(&system, omega, &orbit, steps));
                if judged.is_some_and(|(_, distance)| distance <= allowed) {
                    break;
                }
            }
            let comes = coarser.zip(judged).is_some_and(|((coarser, _), (apart, _))| apart <= COMES * coarser);
            let name = format!("{seed} {laws:?} {}", row.name);
            let mut silent = |why: &'static str| {
                count(format!("unjudged: {why}"));
                unjudged.push(format!("{name}: {why}"));
            };
            match judged {
                Some((_, distance)) if distance <= allowed => {
                    agree += 1;
                    count("agrees".to_owned());
                }
                Some(_) if comes => silent("the reference is too coarse"),
                // small steps leave an unstable orbit sooner or later
                _ if orbit.is_stable() == Some(false) => silent("unstable, and says so"),
                None => silent("the reference does not settle"),
                Some((_, distance)) => {
                    count("differs".to_owned());
                    wrong.push(format!("{name}: {distance:.1e} of {allowed:.1e}"));
                }
            }
        }
    }
    for ((method, what), count) in &counts {
        println!("{method}: {what}: {count}");
    }
    let found = agree + wrong.len() + unjudged.len();
    println!("{agree} of {found} orbits agree, {} differ, {} are unjudged", wrong.len(), unjudged.len());
    unjudged.iter().chain(&unexplained).chain(&wrong).for_each(|line| println!("{line}"));
    let share = unjudged.len() as f64 / found as f64;
    assert!(unjudged.len() as f64 <= UNJUDGED * found as f64 + 1.0, "{share:.3} of the orbits are unjudged");
    assert!(wrong.is_empty(), "{} orbits are no motions of their systems", wrong.len());
    assert!(unexplained.len() as f64 <= UNEXPLAINED * tried as f64 + 1.0, "{} of {tried} failed", unexplained.len());
}
