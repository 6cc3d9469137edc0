//! Ratios of computing time between Stickslip and SciPy for the same orbits in the same run.
//!
//! `cargo bench -p stickslip --bench peers` creates a virtual environment under `target/` and
//! installs SciPy there. It needs Python 3 and the package index. Every orbit has a warm start
//! from 0.0125 Hz below.

#![allow(clippy::print_stdout)] // a bench prints its table

mod python;

use python::{Peer, number};
use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Instant;
use stickslip::law::{Coulomb, CoulombArctan};
use stickslip::method::{Method, event_driven::EventDriven, shooting::Shooting};
use stickslip::model::{System, example};

const SCIPY: Peer = Peer { package: "scipy", version: "1.17.1", folder: "peers" };
/// Slip limit (N) and frequency (Hz): slip only, stick-slip, stick-slip.
const CASES: [(f64, f64); 3] = [(2.0, 121.25), (4.0, 120.75), (8.0, 121.0)];
/// Steepness in the paper, s/m.
const ALPHA: f64 = 25e3;
/// Number of runs of Stickslip per case; the median counts.
const RUNS: usize = 101;

fn main() {
    // cargo test --benches passes --test: nothing to test here
    if std::env::args().any(|a| a == "--test") {
        return;
    }
    let ours: Vec<Ours> = CASES.iter().map(|case| Ours::new(*case)).collect();
    let theirs = match scipy(&ours) {
        Ok(theirs) => theirs,
        Err(reason) => {
            println!("SciPy could not be measured: {reason}");
            Vec::new()
        }
    };
    println!("one orbit, warm start, one core       time        amplitude of blade 1     SciPy / Stickslip");
    for (i, (ft, hertz)) in CASES.iter().enumerate() {
        println!("Ft = {ft} N, {hertz} Hz");
        println!("  Stickslip, exact law            {:9.3} ms   {:.9} m", ours[i].exact.0 * 1e3, ours[i].exact.1);
        println!("  Stickslip, arctan, shooting     {:9.3} ms   {:.9} m", ours[i].smooth.0 * 1e3, ours[i].smooth.1);
        for line in theirs.iter().skip(2 * i).take(2) {
            let seconds = number(line, "seconds").unwrap_or(f64::NAN);
            let ratios =
                format!("{:.0} (arctan), {:.0} (exact)", seconds / ours[i].smooth.0, seconds / ours[i].exact.0);
            let method = if line.contains("LSODA") { "LSODA" } else { "Radau" };
            match number(line, "amplitude") {
                Some(amplitude) => {
                    println!(
                        "  SciPy {method}, arctan, shooting  {:9.3} ms   {amplitude:.9} m            {ratios}",
                        seconds * 1e3
                    );
                }
                None => println!("  SciPy {method}, arctan, shooting  {:9.3} ms   failed: {line}", seconds * 1e3),
            }
        }
    }
}

struct Ours {
    exact: (f64, f64),
    smooth: (f64, f64),
    start: Vec<f64>,
}

impl Ours {
    fn new((ft, hertz): (f64, f64)) -> Self {
        let couple = |smooth: bool| -> System {
            let mut model = example::blade_couple();
            model.joints[0].law = if smooth {
                Arc::new(CoulombArctan { limit: ft, alpha: ALPHA })
            } else {
                Arc::new(Coulomb { limit: ft })
            };
            model.assemble().unwrap()
        };
        let (_, exact) = time(&EventDriven, &couple(false), hertz);
        let (start, smooth) = time(&Shooting::default(), &couple(true), hertz);
        Ours { exact, smooth, start }
    }
}

/// Returns the initial state, and the median time (s) and the amplitude of the orbit.
fn time(method: &dyn Method, system: &System, hertz: f64) -> (Vec<f64>, (f64, f64)) {
    let mut solver = method.solver(system).unwrap();
    let start = solver.orbit(TAU * (hertz - 0.0125)).unwrap().seed();
    let mut amplitude = 0.0;
    let mut seconds: Vec<f64> = (0..RUNS)
        .map(|_| {
            let begin = Instant::now();
            let orbit = solver.orbit_near(TAU * hertz, Some(&start)).unwrap();
            let seconds = begin.elapsed().as_secs_f64();
            amplitude = orbit.places[0].amplitude();
            seconds
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    (start.state, (seconds[RUNS / 2], amplitude))
}

fn scipy(ours: &[Ours]) -> Result<Vec<String>, String> {
    let cases: Vec<String> = CASES
        .iter()
        .zip(ours)
        .map(|((ft, hertz), ours)| {
            format!("{{\"ft\": {ft}, \"hertz\": {hertz}, \"alpha\": {ALPHA}, \"start\": {:?}}}", &ours.start[..6])
        })
        .collect();
    SCIPY.measure("scipy_couple.py", &format!("[{}]", cases.join(", ")))
}
