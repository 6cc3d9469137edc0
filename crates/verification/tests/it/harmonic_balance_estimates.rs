//! Error estimates of harmonic balance for every law that it takes, on random systems with full
//! matrices. An estimate may be too low only by a bounded factor.
//!
//! The reference is shooting, with a thousandth of the error. For laws that shooting cannot
//! take, it is harmonic balance with a thirtieth of the tolerance and sixteen times the
//! samples. `STICKSLIP_ESTIMATES=50` sets the number of models per law. The test prints the
//! worst case of every law. `STICKSLIP_OPENING=500` sets the number of models with contacts that open.

#![allow(clippy::print_stdout)] // tests print measured values

use std::sync::Arc;
use stickslip::law::{BoucWen, Dahl, LuGre, SharedLaw, TABLE};
use stickslip::method::{Method, harmonic_balance::HarmonicBalance, shooting::Shooting};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring, System};
use stickslip::orbit::Orbit;
use stickslip_verification::located_contacts::{LocatedSettings, contact_model};
use stickslip_verification::random_system_of;

/// Default number of models per law.
const MODELS: u64 = 5;
/// Largest true error in estimates, as the book states. Measured: up to 1.2, and 2.7 for
/// `stribeck`.
const FACTOR: f64 = 3.0;
/// Relative error of the reference motions.
const TRUE: f64 = 3e-5;
/// Samples of harmonic balance as the reference.
const SAMPLES: usize = 16_384;

fn judge(system: &System, omega: f64) -> Option<Orbit> {
    if let Ok(mut solver) = Shooting::default().solver(system) {
        return solver.orbit(omega).ok();
    }
    let method = HarmonicBalance { tolerance: Some(3e-5), samples: Some(SAMPLES), ..HarmonicBalance::default() };
    method.solver(system).ok()?.orbit(omega).ok()
}

/// Returns the largest root mean square difference of a place without its mean, relative to the
/// largest motion.
fn distance(one: &Orbit, other: &Orbit) -> f64 {
    let (points, period) = (2000, one.period());
    let (mut apart, mut size) = (vec![0.0; one.places.len()], vec![0.0; one.places.len()]);
    for k in 0..points {
        let time = period * f64::from(k) / f64::from(points);
        let (a, b) = (one.sample(time), other.sample(time));
        for i in 0..one.places.len() {
            let (x, y) = (a.displacement[i] - one.places[i].mean, b.displacement[i] - other.places[i].mean);
            apart[i] += (x - y) * (x - y);
            size[i] += y * y;
        }
    }
    let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    (most(&apart) / most(&size)).sqrt()
}

#[test]
fn the_estimate_holds_for_every_law() {
    let models = std::env::var("STICKSLIP_ESTIMATES").ok().and_then(|text| text.parse().ok()).unwrap_or(MODELS);
    let only = std::env::var("STICKSLIP_ESTIMATES_OF").ok();
    let mut low = Vec::new();
    for info in TABLE.iter().filter(|info| only.as_deref().is_none_or(|only| only == info.name)) {
        let (mut worst, mut judged, mut errors) = (0.0f64, 0, Vec::new());
        for seed in 0..models {
            let (system, omega) = random_system_of(seed, &[info]);
            let Ok(mut solver) = HarmonicBalance::default().solver(&system) else { continue };
            let Ok(found) = solver.orbit(omega) else {
                println!("{} {seed}: nothing found", info.name);
                continue;
            };
            let Some(truth) = judge(&system, omega) else { continue };
            let (error, estimate) = (distance(&found, &truth), found.evidence.error_estimate.unwrap());
            judged += 1;
            errors.push(error);
            if error > TRUE {
                worst = worst.max(error / estimate);
            }
            if error > TRUE + FACTOR * estimate {
                low.push(format!("{} {seed}: error {error:.1e}, estimate {estimate:.1e}", info.name));
            }
        }
        let largest = errors.iter().copied().fold(0.0, f64::max);
        println!("{}: {judged} judged, error / estimate up to {worst:.2}, error up to {largest:.1e}", info.name);
    }
    assert!(low.is_empty(), "{}", low.join("\n"));
}

/// Laws with states that cross their range between two samples act like rigid friction on a
/// series. Samples locate a change of sign only to one sample, so two series may be close by
/// chance (9.8e-6 where the error was 1.9e-4). The states cross their range over a thousandth
/// to a millionth of the motion.
#[test]
fn the_estimate_holds_for_stiff_laws_with_states() {
    let laws = |stiffness: f64| -> [SharedLaw; 3] {
        let range = 0.3 / stiffness;
        [
            Arc::new(Dahl { stiffness, limit: 0.5 }),
            Arc::new(BoucWen { stiffness, beta: 1.0 / (range * range), gamma: 0.0, exponent: 2.0 }),
            Arc::new(LuGre { stiffness, damping: 0.0, viscous: 0.1, limit: 0.4, static_limit: 0.5, velocity: 1e-2 }),
        ]
    };
    let mut low = Vec::new();
    for stiffness in [1e4, 1e5, 1e6] {
        for law in laws(stiffness) {
            let ground = GROUND.to_owned();
            let between = ["m".to_owned(), ground.clone()];
            let spring = Spring { between: between.clone(), stiffness: 100.0, damping: 0.5 };
            let model = Model {
                masses: vec![Mass::new("m", 1.0)],
                springs: vec![spring],
                joints: vec![Joint { name: "j".to_owned(), between, law: law.clone() }],
                forces: vec![Force { on: "m".to_owned(), amplitude: 1.0, phase: 0.0, harmonic: 1 }],
                ..Model::default()
            };
            let (system, omega) = (model.assemble().unwrap(), 1.5 * std::f64::consts::TAU);
            let truth = Shooting { tolerance: 1e-10, ..Shooting::default() }.solver(&system).unwrap().orbit(omega);
            let truth = truth.unwrap();
            for tolerance in [1e-3, 2e-4] {
                let method = HarmonicBalance { tolerance: Some(tolerance), ..HarmonicBalance::default() };
                let found = method.solver(&system).unwrap().orbit(omega);
                let Ok(found) = found else { continue };
                let (error, estimate) = (distance(&found, &truth), found.evidence.error_estimate.unwrap());
                println!("{} {stiffness:.0e} {tolerance:.0e}: error {error:.1e}, estimate {estimate:.1e}", law.name());
                if error > FACTOR * estimate {
                    low.push(format!("{} {stiffness:e}: error {error:.1e}, estimate {estimate:.1e}", law.name()));
                }
            }
        }
    }
    assert!(low.is_empty(), "{}", low.join("\n"));
}

/// Contacts that open in every period. The truth is an integration in time that locates every
/// switch and begins at the orbit. Nearly all estimates lie within a factor of three of the error.
#[test]
fn the_estimate_holds_for_contacts_that_open() {
    let models = std::env::var("STICKSLIP_OPENING").ok().and_then(|text| text.parse().ok()).unwrap_or(20);
    let settings = LocatedSettings { steps: 2000, periods: 400, settled: 1e-9 };
    let mut ratios: Vec<f64> = Vec::new();
    let (mut missed, mut unsettled) = (0, 0);
    let mut seed = 0;
    while ratios.len() < models {
        seed += 1;
        let model = contact_model(seed);
        let Ok(found) = HarmonicBalance::default().solver(&model.system()).unwrap().orbit(model.omega) else {
            missed += 1;
            continue;
        };
        if found.is_stable() == Some(false) {
            continue;
        }
        let Some((truth, open)) = model.settled(&found.initial_state, settings) else {
            unsettled += 1;
            continue;
        };
        if !(0.01..0.99).contains(&open) {
            continue;
        }
        let mean = truth.column_mean();
        let (mut apart, mut size) = (vec![0.0; truth.nrows()], vec![0.0; truth.nrows()]);
        for (k, column) in truth.column_iter().enumerate() {
            let sample = found.sample(found.period() * k as f64 / settings.steps as f64);
            for i in 0..truth.nrows() {
                let vibration = column[i] - mean[i];
                apart[i] += (sample.displacement[i] - found.places[i].mean - vibration).powi(2);
                size[i] += vibration * vibration;
            }
        }
        let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let error = (most(&apart) / most(&size)).sqrt();
        let estimate = found.evidence.error_estimate.unwrap();
        if error / estimate > 3.0 || error / estimate < 1.0 / 3.0 {
            println!("{seed}: error {error:.2e}, estimate {estimate:.2e}, open {open:.2}");
        }
        ratios.push(error / estimate);
    }
    let share = |low: f64, high: f64| {
        ratios.iter().filter(|ratio| **ratio > low && **ratio <= high).count() as f64 / ratios.len() as f64
    };
    let (near, low) = (share(1.0 / 3.0, 3.0), share(3.0, f64::INFINITY));
    println!("{seed} models, {missed} without an orbit, {unsettled} that do not settle; {} judged", ratios.len());
    println!("within a factor of three: {:.1} %, less than a third: {:.1} %", 100.0 * near, 100.0 * low);
    assert!(near >= 0.95 && low <= 0.01, "{near} {low}");
}
