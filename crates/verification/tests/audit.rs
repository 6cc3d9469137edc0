//! Random systems with full matrices and random laws, in every method that takes them, each orbit held against small steps in time
//! ([`stickslip_verification::reference`]), which share no code with any method.
//!
//! `STICKSLIP_AUDIT_MODELS=1000` and `STICKSLIP_AUDIT_FIRST=SEED` make it longer; it prints what converged, what was refused or failed and why.

#![allow(clippy::print_stdout)] // tests say what they measured

use nalgebra::DMatrix;
use num_complex::Complex64;
use std::collections::BTreeMap;
use std::time::Instant;
use stickslip::law::{SharedLaw, TABLE};
use stickslip::method::TABLE as METHODS;
use stickslip::model::{Axis, System};
use stickslip::orbit::Orbit;
use stickslip::structure::Structure;
use stickslip_verification::Random;
use stickslip_verification::reference::Reference;

/// Models without a wish.
const MODELS: u64 = 12;
/// Steps a period of the reference; its own error is then some 1e-4: (2π 3/500)²/12 for the third harmonic.
const STEPS: usize = 500;
/// Periods that the reference is given to settle.
const PERIODS: usize = 40;
/// Difference to the reference, relative to the largest amplitude, that is its own error or that of a method's tolerance of 1e-3.
const NEAR: f64 = 5e-3;
/// Change over the last period below which the reference has settled.
const SETTLED: f64 = 1e-4;
/// Tolerance of method `transient`.
const WAITED: f64 = 1e-6;
/// Seconds for one orbit that are worth a line.
const SLOW: f64 = 5.0;
/// Share of orbits that may fail without a reason that explains it.
const UNEXPLAINED: f64 = 0.02;

fn variable(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// A symmetric matrix with eigenvalues from `least` up.
fn definite(random: &mut Random, n: usize, least: f64, size: f64) -> DMatrix<f64> {
    let b = DMatrix::from_fn(n, n, |_, _| random.between(-1.0, 1.0));
    DMatrix::identity(n, n) * least + &b * b.transpose() * size
}

/// A law of the table with parameters up to twice or half of its sample's.
fn law(random: &mut Random) -> SharedLaw {
    let row = TABLE[(random.unit() * TABLE.len() as f64) as usize];
    for _ in 0..20 {
        let values: Vec<f64> = row
            .sample
            .iter()
            .zip(row.parameters)
            .map(|(value, p)| if p.default.is_some() { *value } else { value * 2f64.powf(random.between(-1.0, 1.0)) })
            .collect();
        let keys = row.parameters.iter().map(|p| p.key).zip(values).collect();
        if let Ok(law) = row.build(&keys) {
            return law;
        }
    }
    row.sample()
}

/// Up to four degrees of freedom, up to two joints.
fn system(seed: u64) -> (System, f64) {
    let mut random = Random::new(seed);
    let n = 1 + (random.unit() * 4.0) as usize;
    let mass = definite(&mut random, n, 0.5, 1.0);
    let stiffness = definite(&mut random, n, 1e4, 1e4);
    let natural = (stiffness[(0, 0)] / mass[(0, 0)]).sqrt();
    // damping ratios of some percent, so that transients die
    let damping = definite(&mut random, n, 0.1 * natural, 0.05 * natural);
    let places = (0..n).map(|i| format!("p{i}")).collect();
    let structure = Structure::new(places, mass, damping, stiffness).unwrap();
    let mut builder = System::builder(structure);
    for j in 0..1 + (random.unit() * 2.0) as usize {
        let law = law(&mut random);
        let axes = (0..law.directions()).map(|_| {
            let one = (random.unit() * n as f64) as usize;
            let other = (random.unit() * n as f64) as usize;
            Axis::new(if one == other { vec![(one, 1.0)] } else { vec![(one, 1.0), (other, -0.7)] })
        });
        let axes = axes.collect();
        builder = builder.joint(format!("j{j}"), law, axes);
    }
    builder = builder.force(0, 1, Complex64::from_polar(random.between(2.0, 20.0), random.between(0.0, 6.0)));
    if random.unit() < 0.3 {
        builder = builder.force(n - 1, 0, Complex64::new(random.between(-5.0, 5.0), 0.0));
    }
    if random.unit() < 0.2 {
        builder = builder.force(n - 1, 2, Complex64::from_polar(random.between(0.5, 4.0), random.between(0.0, 6.0)));
    }
    (builder.build().unwrap(), natural * random.between(0.4, 1.6))
}

/// How far an orbit is from the motion that small steps reach from its own state; `None` if that does not settle.
fn distance(system: &System, omega: f64, orbit: &Orbit) -> Option<f64> {
    let start = orbit.sample(0.0);
    let mut reference = Reference::new(system, omega, STEPS, &start.displacement, &start.velocity);
    let (amplitudes, change) = reference.settle(PERIODS, SETTLED);
    if change > SETTLED || reference.lost > 0 {
        return None;
    }
    let size = amplitudes.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let places = orbit.places.iter().zip(&amplitudes);
    Some(places.map(|(place, a)| (place.amplitude() - a).abs() / size).fold(0.0, f64::max))
}

#[test]
fn every_orbit_is_a_motion() {
    let (first, models) = (variable("STICKSLIP_AUDIT_FIRST", 0), variable("STICKSLIP_AUDIT_MODELS", MODELS));
    let mut counts: BTreeMap<(&str, String), usize> = BTreeMap::new();
    let (mut wrong, mut unexplained, mut restless, mut tried) = (Vec::new(), Vec::new(), Vec::new(), 0usize);
    for seed in first..first + models {
        let (system, omega) = system(seed);
        let laws: Vec<&str> = system.joints().iter().map(|joint| joint.law().name()).collect();
        for row in METHODS.iter().filter(|row| row.name != "auto") {
            // waiting for transients is brute force: so much of it is enough here
            let options = row.options.iter().filter(|o| row.name == "transient" && o.key == "tolerance");
            let method = (row.build)(&options.map(|o| (o.key.to_owned(), WAITED)).collect()).unwrap();
            // waiting in equal steps takes up to half a minute an orbit: only in long audits
            let quick =
                system.joints().iter().all(|joint| joint.law().pieces().is_some() || joint.law().rate().is_some());
            if row.name == "transient" && !quick && models <= MODELS {
                continue;
            }
            let mut count = |what: String| *counts.entry((row.name, what)).or_default() += 1;
            let mut solver = match method.solver(&system) {
                Ok(solver) => solver,
                // a method that cannot take a law says which
                Err(error) => {
                    assert!(laws.iter().any(|law| error.to_string().contains(law)), "{seed}: {error}");
                    count("refused".to_owned());
                    continue;
                }
            };
            tried += 1;
            let begun = Instant::now();
            let found = solver.orbit(omega, None);
            let seconds = begun.elapsed().as_secs_f64();
            if seconds > SLOW {
                println!("{seed} {laws:?} {}: {seconds:.1} s", row.name);
            }
            let orbit = match found {
                Ok(orbit) => orbit,
                Err(error) => {
                    count(error.status().to_owned());
                    unexplained.push(format!("{seed} {laws:?} {}: {error}", row.name));
                    continue;
                }
            };
            let allowed = NEAR + 3.0 * orbit.evidence.truncation.unwrap_or(0.0);
            match distance(&system, omega, &orbit) {
                Some(distance) if distance <= allowed => count("agrees".to_owned()),
                _ if orbit.is_stable() == Some(false) => count("unstable, and says so".to_owned()),
                None => {
                    count("the reference does not settle".to_owned());
                    restless.push(format!("{seed} {laws:?} {}", row.name));
                }
                Some(distance) => {
                    count("differs".to_owned());
                    wrong.push(format!("{seed} {laws:?} {}: {distance:.1e} of {allowed:.1e}", row.name));
                }
            }
        }
    }
    for ((method, what), count) in &counts {
        println!("{method}: {what}: {count}");
    }
    println!("not settled: {}", restless.join("; "));
    unexplained.iter().chain(&wrong).for_each(|line| println!("{line}"));
    assert!(wrong.is_empty(), "{} orbits are no motions of their systems", wrong.len());
    assert!(unexplained.len() as f64 <= UNEXPLAINED * tried as f64 + 1.0, "{} of {tried} failed", unexplained.len());
}
