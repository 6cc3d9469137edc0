//! The blade couple with a symmetric element (the paper's Figs. 9, 10): theory section 4.
//!
//! Half the sum of the blades' motions is linear for any contact; only half their difference
//! rubs.

#![allow(clippy::print_stdout)] // tests print measured values

use num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::{CoulombArctan, SharedLaw};
use stickslip::method::{Method, event_driven::EventDriven, shooting::Shooting};
use stickslip::model::System;
use stickslip::orbit::Orbit;
use stickslip_verification::{close, exact, harmonic, maximum, near, template, template_with, zero};

const M: f64 = 0.182;
const K: f64 = 105_103.0;
const B: f64 = 0.2;
const KT: f64 = 1e4;
const F0: f64 = 10.0;
/// Mass on each side: `m1 / 2` and `m1`.
const MU: [f64; 2] = [0.000_91, 0.001_82];

/// Returns `S(w)` of 4.1.
fn sum_response(mu: f64, hertz: f64) -> Complex64 {
    let w = TAU * hertz;
    0.5 * F0 / Complex64::new(K + KT - (M - mu) * w * w - KT * KT / (KT - mu * w * w), w * B)
}

/// Returns half the difference of the blades in stick: the small masses rest, and `kt` acts as
/// a spring to the ground.
fn stuck_difference(mu: f64, hertz: f64) -> Complex64 {
    let w = TAU * hertz;
    0.5 * F0 / Complex64::new(K + KT - (M - mu) * w * w, w * B)
}

/// Returns the amplitude of the contact force in stick, 4.2.
fn stuck_force(mu: f64, hertz: f64) -> f64 {
    KT * stuck_difference(mu, hertz).norm()
}

fn couple(mu: f64, ft: f64) -> System {
    template("symmetric-couple", &[("Ft", ft), ("mu", mu)])
}

/// Compares half the sum of the blades with `S(w)`: its first harmonic, and the whole motion,
/// so that no other harmonic exists.
fn check_sum(orbit: &Orbit, mu: f64, hertz: f64, tolerance: f64) {
    let expected = sum_response(mu, hertz);
    let first = 0.5 * (orbit.places[0].first_harmonic + orbit.places[3].first_harmonic);
    assert!((first - expected).norm() < tolerance * expected.norm(), "{hertz} Hz: {first} {expected}");
    for i in 0..97 {
        let phase = TAU * f64::from(i) / 97.0;
        let x = orbit.sample(phase / orbit.omega).displacement;
        let motion = (expected * Complex64::from_polar(1.0, phase)).re;
        near(&format!("half sum at {hertz} Hz"), 0.5 * (x[0] + x[3]), motion, tolerance * expected.norm());
    }
}

#[test]
fn theory_4_1_sum_of_the_blades_is_linear() {
    let (mut slipping, mut worst) = (0, 0.0f64);
    for mu in MU {
        for ft in [0.1, 1.0, 2.0, 4.0, 6.0, 8.0] {
            for hertz in [119.5, 120.4, 120.8, 120.93, 121.1, 121.5, 122.4] {
                let orbit = exact(&couple(mu, ft), TAU * hertz);
                check_sum(&orbit, mu, hertz, 1e-9);
                for n in [3, 5, 7] {
                    let other = harmonic(&orbit, n, |sample| 0.5 * (sample.displacement[0] + sample.displacement[3]));
                    worst = worst.max(other.norm() / sum_response(mu, hertz).norm());
                }
                slipping += usize::from(orbit.joints[0].slip_fraction > 0.0);
            }
        }
    }
    println!("{slipping} slipping orbits; largest other harmonic of the half sum {worst:.1e}");
    assert!(slipping > 30 && worst < 1e-9);
}

#[test]
fn theory_4_1_sum_of_the_blades_is_linear_for_the_smooth_law() {
    for alpha in [250.0, 25e3] {
        for (ft, hertz) in [(2.0, 120.93), (4.0, 121.1), (1.0, 120.5)] {
            let law = |limit| -> SharedLaw { Arc::new(CoulombArctan { limit, alpha }) };
            let system = template_with("symmetric-couple", &[("Ft", ft), ("mu", MU[0])], law);
            let method = Shooting { tolerance: 1e-10, width: None, ..Shooting::default() };
            let orbit = method.solver(&system).unwrap().orbit(TAU * hertz).unwrap();
            check_sum(&orbit, MU[0], hertz, 1e-7);
        }
    }
}

#[test]
fn theory_4_1_peak_of_the_sum() {
    for (mu, peak, at) in [(MU[0], 3.290247, 120.9293), (MU[1], 3.291719, 120.8752)] {
        let found = maximum(|f| 100.0 * sum_response(mu, f).norm(), [119.5, 122.5], 300, 1e-9);
        near("peak", found.1, peak, 0.5e-6);
        near("its frequency", found.0, at, 0.5e-4);
    }
}

#[test]
fn theory_4_2_contact_force_and_onset_of_slip() {
    let mu = MU[0];
    let printed = [(119.5, 3.8425), (120.0, 4.1131), (120.93, 4.7373), (121.25, 4.9997), (122.0, 5.7495)];
    for (hertz, printed) in printed {
        near("printed contact force", stuck_force(mu, hertz), printed, 0.5e-4);
        let orbit = exact(&couple(mu, 1e3), TAU * hertz);
        let force = |time: f64| orbit.sample(time).joints[0].force[0];
        close("contact force", force(0.0).hypot(force(0.25 * orbit.period())), stuck_force(mu, hertz), 1e-8);
        // slip begins where the limit falls below the contact force
        let slips = |ft: f64| match EventDriven.solver(&couple(mu, ft)).unwrap().orbit(TAU * hertz) {
            Ok(orbit) if orbit.joints[0].slip_fraction == 0.0 => -1.0,
            Ok(_) => 1.0,
            Err(error) => {
                // the contact force exceeds its limit by less than rounding
                assert!((ft / stuck_force(mu, hertz) - 1.0).abs() < 1e-9, "{error}");
                1.0
            }
        };
        let found = zero(slips, [0.999 * stuck_force(mu, hertz), 1.001 * stuck_force(mu, hertz)]);
        close("onset of slip", found, stuck_force(mu, hertz), 1e-8);
    }
    let resonance = ((K + KT) / (M - mu)).sqrt() / TAU;
    // 126.887: the printed digits are truncated, not rounded
    near("anti-phase resonance", resonance, 126.88, 0.01);
    for (ft, printed, digit) in [(6.0, 122.208, 0.5e-3), (4.0, 119.7995, 0.5e-4), (2.0, 112.26, 0.5e-2)] {
        let border = zero(|f| stuck_force(mu, f) - ft, [100.0, 126.0]);
        near("printed border", border, printed, digit);
        let system = couple(mu, ft);
        let side = |f: f64| match EventDriven.solver(&system).unwrap().orbit(TAU * f) {
            Ok(orbit) => {
                if orbit.joints[0].slip_fraction > 0.0 {
                    1.0
                } else {
                    -1.0
                }
            }
            Err(error) => {
                assert!((f / border - 1.0).abs() < 1e-10, "{error}");
                1.0
            }
        };
        close("border", zero(side, [border - 1e-3, border + 1e-3]), border, 1e-8);
    }
}

/// Fig. 10 with the exact law: all points converge, and the stuck ones are exactly linear.
#[test]
fn theory_4_2_stuck_curves_are_exactly_linear() {
    let (mut points, mut stuck) = (0, 0);
    for mu in MU {
        for ft in [2.0, 4.0, 6.0, 8.0] {
            let system = couple(mu, ft);
            let mut solver = EventDriven.solver(&system).unwrap();
            for i in 0..=240 {
                let hertz = 119.5 + f64::from(i) / 80.0;
                let orbit = solver.orbit(TAU * hertz).unwrap();
                assert!(orbit.evidence.residual < 1e-10 && orbit.evidence.energy_gap < 1e-9, "{orbit:?}");
                points += 1;
                assert_eq!(orbit.joints[0].slip_fraction == 0.0, stuck_force(mu, hertz) <= ft, "{ft} N, {hertz} Hz");
                if stuck_force(mu, hertz) > ft {
                    continue;
                }
                stuck += 1;
                let (s, d) = (sum_response(mu, hertz), stuck_difference(mu, hertz));
                let w = TAU * hertz;
                let small = s * KT / (KT - mu * w * w); // both small masses move as half their sum
                for (place, expected) in orbit.places.iter().zip([s + d, small, small, s - d]) {
                    close("stuck amplitude", place.amplitude(), expected.norm(), 1e-8);
                    assert!((place.first_harmonic - expected).norm() < 1e-8 * expected.norm());
                }
            }
        }
    }
    println!("{points} points, {stuck} of them stuck and exactly linear");
    assert_eq!(points, 2 * 4 * 241);
}

/// The lower bound of 4.3: friction damps only the difference, so the larger blade amplitude
/// cannot fall below the sum's resonance.
#[test]
fn theory_4_3_friction_cannot_damp_the_sum() {
    let mu = MU[0];
    let floor = F0 / (2.0 * B * TAU * 120.9293);
    near("floor in cm", 100.0 * floor, 3.29, 0.5e-2);
    let peak = maximum(|f| sum_response(mu, f).norm(), [119.5, 122.5], 300, 1e-9);
    close("peak of the sum", peak.1, floor, 1e-3);
    for ft in [0.5, 1.0, 2.0, 3.0, 4.0, 4.7, 5.0, 8.0, 100.0] {
        let orbit = exact(&couple(mu, ft), TAU * peak.0);
        let larger = orbit.places[0].amplitude().max(orbit.places[3].amplitude());
        assert!(larger > 0.999 * peak.1, "{ft} N: {larger}");
    }
}
