//! Ratios of computing time between `harmonic-balance` and the Python package pyHarm for the
//! same curve in the same run.
//!
//! `cargo bench -p stickslip --bench peers_harmonic_balance` creates a virtual environment
//! under `target/` and installs pyHarm there (1.3 GB with its dependencies). It needs Python 3
//! and the package index.
//!
//! The case is the massless blade couple at 2 N, 119.5 to 122.5 Hz, odd harmonics up to H, 1024
//! samples per period. Each point has a warm start from the previous one. A point of Stickslip
//! includes its stability and its error estimate, a second solution with twice the harmonics. A
//! point of pyHarm includes neither.
//!
//! The amplitudes differ because of the sampling. With 16384 samples, those of pyHarm change by
//! up to 1.2e-5. Those of Stickslip change by 3e-7 (five harmonics), because it locates the
//! switches between samples.

#![allow(clippy::print_stdout)] // a bench prints its table

mod python;

use python::{Peer, number};
use std::f64::consts::TAU;
use std::time::Instant;
use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
use stickslip::model::{System, example};
use stickslip::orbit::Seed;

const PYHARM: Peer = Peer { package: "pyharm-os", version: "1.2.2", folder: "peers-pyharm" };
const HARMONICS: [usize; 5] = [1, 3, 5, 9, 15];
const SAMPLES: usize = 1024;
/// Frequency range, Hz, and number of points of the curve.
const RANGE: (f64, f64) = (119.5, 122.5);
const POINTS: usize = 241;
/// Options of pyHarm for the derivatives of its Jenkins element.
const JACOBIANS: [&str; 2] = ["analytical", "jax"];
/// Number of runs of Stickslip per number of harmonics; the median counts.
const RUNS: usize = 21;

fn main() {
    // cargo test --benches passes --test: nothing to test here
    if std::env::args().any(|a| a == "--test") {
        return;
    }
    let system = example::blade_couple_massless().assemble().unwrap();
    let ours: Vec<f64> = HARMONICS.iter().map(|harmonics| seconds_per_point(*harmonics, &system)).collect();
    let theirs = pyharm().unwrap_or_else(|reason| {
        println!("pyHarm could not be measured: {reason}");
        Vec::new()
    });
    println!("one core, per converged point                                      largest relative difference");
    println!(" H   Stickslip    pyHarm     Jacobian     converged   pyHarm / Stickslip   of amplitudes of blade 1");
    for (i, (harmonics, ours)) in HARMONICS.iter().zip(&ours).enumerate() {
        let lines = theirs.iter().skip(JACOBIANS.len() * i).take(JACOBIANS.len());
        if theirs.is_empty() {
            println!("{harmonics:2} {:8.1} us", ours * 1e6);
        }
        for (jacobian, line) in JACOBIANS.iter().zip(lines) {
            let Some(curve) = Curve::read(line) else {
                println!("{harmonics:2} {:8.1} us      {jacobian:10}   failed: {line}", ours * 1e6);
                continue;
            };
            let theirs = curve.seconds / curve.hertz.len() as f64;
            println!(
                "{harmonics:2} {:8.1} us  {:8.3} ms  {jacobian:10}   {:4} / {:3}   {:8.0}             {:10.1e}",
                ours * 1e6,
                theirs * 1e3,
                curve.hertz.len(),
                curve.points,
                theirs / ours,
                curve.difference(*harmonics, &system)
            );
        }
    }
}

/// Returns the amplitudes of blade 1 at the frequencies `hertz`, with warm starts.
fn amplitudes(harmonics: usize, system: &System, hertz: impl Iterator<Item = f64>) -> Vec<f64> {
    let method = HarmonicBalance { harmonics: Some(harmonics), samples: Some(SAMPLES), tolerance: None };
    let mut solver = method.solver(system).unwrap();
    let mut start: Option<Seed> = None;
    hertz
        .map(|hertz| {
            let orbit = solver.orbit_near(TAU * hertz, start.as_ref()).unwrap();
            let amplitude = orbit.places[0].amplitude();
            start = Some(orbit.seed());
            amplitude
        })
        .collect()
}

/// Returns the median over the runs of the mean time per point, s.
fn seconds_per_point(harmonics: usize, system: &System) -> f64 {
    let step = (RANGE.1 - RANGE.0) / (POINTS - 1) as f64;
    let mut seconds: Vec<f64> = (0..RUNS)
        .map(|_| {
            let begin = Instant::now();
            let curve = amplitudes(harmonics, system, (0..POINTS).map(|i| RANGE.0 + step * i as f64));
            begin.elapsed().as_secs_f64() / curve.len() as f64
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds[RUNS / 2]
}

/// Returns one line per number of harmonics and Jacobian.
fn pyharm() -> Result<Vec<String>, String> {
    let cases: Vec<String> = HARMONICS
        .iter()
        .flat_map(|harmonics| JACOBIANS.map(|jacobian| (harmonics, jacobian)))
        .map(|(harmonics, jacobian)| {
            let (from, to) = RANGE;
            format!(
                "{{\"harmonics\": {harmonics}, \"samples\": {SAMPLES}, \"jacobian\": \"{jacobian}\", \
                 \"from\": {from}, \"to\": {to}, \"points\": {POINTS}}}"
            )
        })
        .collect();
    PYHARM.measure("pyharm_couple.py", &format!("[{}]", cases.join(", ")))
}

/// Results of pyHarm: its converged points, and the total number of points.
struct Curve {
    seconds: f64,
    points: f64,
    hertz: Vec<f64>,
    amplitudes: Vec<f64>,
}

impl Curve {
    fn read(line: &str) -> Option<Self> {
        Some(Curve {
            seconds: number(line, "seconds")?,
            points: number(line, "points")?,
            hertz: numbers(line, "hertz")?,
            amplitudes: numbers(line, "amplitudes")?,
        })
    }

    /// Returns the largest relative difference to the amplitudes of Stickslip at the same
    /// frequencies.
    fn difference(&self, harmonics: usize, system: &System) -> f64 {
        let ours = amplitudes(harmonics, system, self.hertz.iter().copied());
        ours.iter().zip(&self.amplitudes).map(|(a, b)| (a - b).abs() / a).fold(0.0, f64::max)
    }
}

/// Returns the numbers of the list with `"key":` in a line of JSON.
fn numbers(line: &str, key: &str) -> Option<Vec<f64>> {
    let rest = line.split_once(&format!("\"{key}\": ["))?.1;
    rest.split_once(']')?.0.split(',').map(|number| number.trim().parse().ok()).collect()
}
