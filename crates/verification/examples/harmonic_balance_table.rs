//! Amplitude error of harmonic balance against the exact method over the paper's curves, by
//! number of harmonics.
//!
//! `cargo run --release -p stickslip-verification --example harmonic_balance_table`

#![allow(clippy::print_stdout)] // the example prints a table

use std::f64::consts::TAU;
use std::time::Instant;
use stickslip::method::{Method, event_driven::EventDriven, harmonic_balance::HarmonicBalance};
use stickslip::orbit::Seed;
use stickslip_study::templates;

/// Points of a curve, 119.5 to 122.5 Hz.
const POINTS: u32 = 49;

/// Figure, template, changed parameters.
type Case = (&'static str, &'static str, &'static [(&'static str, f64)]);

fn main() {
    let cases: [Case; 4] = [
        ("Fig. 6", "blade-couple", &[]),
        ("Fig. 7", "blade-couple", &[("m1", 0.00091)]),
        ("Fig. 10", "symmetric-couple", &[]),
        ("massless", "blade-couple-massless", &[]),
    ];
    let fixed = |harmonics| HarmonicBalance { harmonics: Some(harmonics), ..HarmonicBalance::default() };
    let chosen = |tolerance| HarmonicBalance { tolerance: Some(tolerance), ..HarmonicBalance::default() };
    let mut methods: Vec<(String, HarmonicBalance)> =
        [1, 3, 5, 9, 15, 31].into_iter().map(|h| (format!("H = {h}"), fixed(h))).collect();
    methods.push(("1e-3".into(), chosen(1e-3)));
    methods.push(("1e-4".into(), chosen(1e-4)));
    println!("largest amplitude error over the curve, relative to the largest amplitude at that frequency");
    println!("curve     Ft/N  method   error     estimate  failed  first reason                us/point");
    for (figure, template, changes) in cases {
        for limit in [2.0, 4.0, 6.0, 8.0] {
            let mut all = changes.to_vec();
            all.push(("Ft", limit));
            let system = templates::find(template).unwrap().model_with(&all).unwrap().assemble().unwrap();
            let mut exact = EventDriven.solver(&system).unwrap();
            let mut start: Option<Seed> = None;
            let omegas: Vec<f64> =
                (0..POINTS).map(|i| TAU * (119.5 + 3.0 * f64::from(i) / f64::from(POINTS - 1))).collect();
            let reference: Vec<Vec<f64>> = omegas
                .iter()
                .map(|omega| {
                    let orbit = exact.orbit_near(*omega, start.as_ref()).unwrap();
                    let amplitudes = orbit.places.iter().map(|p| p.amplitude()).collect();
                    start = Some(orbit.seed());
                    amplitudes
                })
                .collect();
            for (name, method) in &methods {
                let mut solver = method.solver(&system).unwrap();
                let mut start: Option<Seed> = None;
                let (mut worst, mut estimate, mut failed, mut reason) = (0.0f64, 0.0f64, 0, "");
                let begin = Instant::now();
                // many harmonics take long: every eighth point shows the reached error
                let stride = if method.tolerance.is_some_and(|tolerance| tolerance < 1e-3) { 8 } else { 1 };
                for (omega, judge) in omegas.iter().zip(&reference).step_by(stride) {
                    match solver.orbit_near(*omega, start.as_ref()) {
                        Ok(orbit) => {
                            let size = judge.iter().copied().fold(0.0, f64::max);
                            for (place, exact) in orbit.places.iter().zip(judge) {
                                worst = worst.max((place.amplitude() - exact).abs() / size);
                            }
                            estimate = estimate.max(orbit.evidence.error_estimate.unwrap_or(0.0));
                            start = Some(orbit.seed());
                        }
                        Err(error) => {
                            failed += 1;
                            reason = error.status();
                            start = None;
                        }
                    }
                }
                let time = begin.elapsed().as_secs_f64() * 1e6 * stride as f64 / omegas.len() as f64;
                println!(
                    "{figure:9} {limit:4} {name:>8}  {worst:.1e}   {estimate:.1e}   {failed:6}  {reason:24} {time:10.0}"
                );
            }
        }
    }
}
