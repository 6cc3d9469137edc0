//! Dampers that only contacts and a constant load hold. The reference is an integration in time
//! that shares no code with the library and begins at the same static equilibrium.
//!
//! `STICKSLIP_LOOSE_DAMPERS=200` sets the number of random dampers,
//! `STICKSLIP_LOOSE_FIRST=SEED` the first seed. The test prints every point that differs, fails
//! or cannot be judged, and the counts.

#![allow(clippy::print_stdout)] // tests print measured values

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::time::Instant;
use stickslip::method::Method;
use stickslip::method::auto::Auto;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::orbit::Seed;
use stickslip_verification::loose_dampers::{LooseDamper, Settings, loose_damper, roof_damper};

/// Default number of random dampers.
const DAMPERS: u64 = 6;
/// Settings of the reference, and longer ones for points that differ. Undamped ringing on the
/// contacts needs an excitation that grows slowly, and a resonance needs many steps.
const COURSES: [Settings; 3] = [
    Settings { steps: 1000, growth: 40, periods: 3000, settled: 1e-5 },
    Settings { steps: 2000, growth: 1000, periods: 6000, settled: 2e-6 },
    Settings { steps: 8000, growth: 1000, periods: 6000, settled: 2e-6 },
];
/// Difference that is always allowed.
const NEAR: f64 = 1e-3;

fn variable(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Numbers of points by result.
#[derive(Debug, Default)]
struct Counts {
    agree: usize,
    /// The difference is within the range of other histories of a stuck contact.
    within_histories: usize,
    differ: usize,
    /// No orbit, but the reference settles.
    missed: usize,
    /// No orbit, and the reference does not settle.
    unsettled: usize,
    /// An orbit, but the reference does not settle.
    unjudged: usize,
    /// An orbit that is reported as unstable; the reference leaves it.
    unstable: usize,
    /// Reported error above 1 %.
    inaccurate: usize,
    /// Orbits by the algorithm that found them.
    found_by: BTreeMap<&'static str, usize>,
    /// Time of every point without an initial guess or from the last one, s.
    times: Vec<f64>,
}

/// Median, 95 % and longest of the times.
fn print_times(times: &mut [f64]) {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!("a point takes {:.3} s (median), {:.3} s (95 %), {:.3} s (longest)", at(0.5), at(0.95), at(1.0));
}

/// Returns the largest difference of the blades' amplitudes from the reference, relative to the
/// largest amplitude.
fn apart(damper: &LooseDamper, amplitudes: &[f64], reference: &[f64]) -> f64 {
    let size = reference[..damper.blades].iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let pairs = amplitudes.iter().zip(reference).take(damper.blades);
    pairs.map(|(a, b)| (a - b).abs() / size).fold(0.0, f64::max)
}

/// Returns the difference from the reference. The integration is refined while the difference is
/// larger than `allowed`. If it does not settle, the reference is the linear motion on stuck
/// contacts, whose ringing nothing damps.
fn distance(damper: &LooseDamper, amplitudes: &[f64], omega: f64, allowed: f64) -> Option<f64> {
    let mut found = None;
    for course in COURSES {
        found = damper.settled(omega, course).map(|reference| apart(damper, amplitudes, &reference)).or(found);
        if found.is_some_and(|found| found <= allowed) {
            return found;
        }
        if found.is_none()
            && let Some(reference) = damper.stuck(omega)
        {
            return Some(apart(damper, amplitudes, &reference));
        }
    }
    found
}

fn judge(damper: &LooseDamper, name: &str, counts: &mut Counts) {
    let system = damper.system();
    let mut solver = Auto.solver(&system).unwrap();
    for &omega in &damper.frequencies {
        let begun = Instant::now();
        let found = solver.orbit(omega);
        counts.times.push(begun.elapsed().as_secs_f64());
        let hertz = omega / TAU;
        let orbit = match found {
            Ok(orbit) => orbit,
            Err(error) => {
                let settles = damper.settled(omega, COURSES[0]).is_some();
                let count = if settles { &mut counts.missed } else { &mut counts.unsettled };
                *count += 1;
                println!("{name} at {hertz:.3} Hz, reference settles: {settles}: {error}");
                continue;
            }
        };
        *counts.found_by.entry(orbit.evidence.found_by).or_default() += 1;
        let amplitudes: Vec<f64> = orbit.places.iter().map(|place| place.amplitude()).collect();
        let error = orbit.evidence.error_estimate.unwrap_or(0.0);
        counts.inaccurate += usize::from(error > 0.01);
        let allowed = NEAR.max(error);
        let distance = distance(damper, &amplitudes, omega, allowed);
        let spread = orbit.evidence.history_spread.unwrap_or(0.0);
        match distance {
            Some(distance) if distance <= allowed => {
                counts.agree += 1;
                continue;
            }
            _ if orbit.is_stable() == Some(false) => counts.unstable += 1,
            None => counts.unjudged += 1,
            Some(distance) if distance <= allowed + spread => counts.within_histories += 1,
            Some(_) => counts.differ += 1,
        }
        let by = orbit.evidence.found_by;
        println!("{name} at {hertz:.3} Hz by {by}: apart {distance:?}, error {error:.1e}, histories {spread:.1e}");
    }
}

/// Wedges, roofs and cylinders at 20 to 70 degrees, with friction of 0.1 to 0.6. Loads of 3 N
/// to 3 kN press them. The motions include full slip and lift-off.
#[test]
fn random_loose_dampers_vibrate_as_they_do_in_time() {
    let first = variable("STICKSLIP_LOOSE_FIRST", 0);
    let dampers = variable("STICKSLIP_LOOSE_DAMPERS", DAMPERS);
    let mut counts = Counts::default();
    for seed in first..first + dampers {
        let damper = loose_damper(seed);
        judge(&damper, &format!("{} {seed}", damper.kind), &mut counts);
    }
    print_times(&mut std::mem::take(&mut counts.times));
    println!("{counts:?}");
    let found = counts.agree + counts.within_histories + counts.differ + counts.unjudged + counts.unstable;
    assert_eq!(counts.differ, 0, "{counts:?}");
    assert!(counts.missed as f64 <= 0.01 * (found + counts.missed) as f64, "{counts:?}");
    assert!(counts.inaccurate as f64 <= 0.05 * found as f64, "{counts:?}");
}

/// The first blade's amplitude with stuck contacts agrees with an independent integration in C.
/// The solver finds orbits at all rotation speeds.
#[test]
fn a_roof_damper_has_its_orbits_at_all_speeds() {
    let damper = roof_damper(1000.0);
    let system = damper.system();
    let mut solver = HarmonicBalance::default().solver(&system).unwrap();
    for (hertz, micrometres) in [(120.0, 53.652), (150.0, 11.520), (165.0, 6.7442), (175.5, 5.1345)] {
        let orbit = solver.orbit(TAU * hertz).unwrap();
        let amplitude = 1e6 * orbit.places[0].amplitude();
        assert!((amplitude / micrometres - 1.0).abs() < 1e-4, "{hertz} Hz: {amplitude} {micrometres}");
    }
    let mut missed = Vec::new();
    for speed in [500.0, 1000.0, 2000.0, 4000.0] {
        let damper = roof_damper(speed);
        let system = damper.system();
        let mut solver = HarmonicBalance::default().solver(&system).unwrap();
        let mut start: Option<Seed> = None;
        for &omega in damper.frequencies.iter().step_by(5) {
            match solver.orbit_near(omega, start.as_ref()) {
                Ok(orbit) => start = Some(orbit.seed()),
                Err(error) => missed.push(format!("{speed} rpm, {} Hz: {error}", omega / TAU)),
            }
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

/// Newton's method does not reach an orbit from a guess, but it does with a vibration that grows.
/// The second method finds an orbit that depends on the history, and reports how much.
#[test]
fn orbits_are_found_by_a_growing_vibration_and_by_the_second_method() {
    let orbit_of = |damper: &LooseDamper, hertz: f64| {
        let away = |omega: &&f64| (*omega / TAU - hertz).abs();
        let omega = *damper.frequencies.iter().min_by(|a, b| away(a).total_cmp(&away(b))).unwrap();
        (omega, Auto.solver(&damper.system()).unwrap().orbit(omega).unwrap())
    };
    let damper = loose_damper(66);
    let (omega, orbit) = orbit_of(&damper, 240.838);
    assert_eq!(orbit.evidence.found_by, "growing-vibration");
    let amplitudes: Vec<f64> = orbit.places.iter().map(|place| place.amplitude()).collect();
    let distance = apart(&damper, &amplitudes, &damper.settled(omega, COURSES[1]).unwrap());
    let error = orbit.evidence.error_estimate.unwrap();
    assert!(error < 0.01 && distance < NEAR.max(error), "{distance:.1e} {error:.1e}");
    // stuck contacts have 4.0922 um, slipping ones up to 4.1020 um
    let (_, orbit) = orbit_of(&loose_damper(40), 58.345);
    assert_eq!(orbit.evidence.fallback_from, Some("harmonic-balance"));
    let spread = orbit.evidence.history_spread.unwrap();
    assert!((1e-3..2.4e-3).contains(&spread), "{spread:.1e}");
}
