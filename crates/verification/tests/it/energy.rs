//! Energy of orbits: theory section 9, for every template and for several joints.
//!
//! The tests compute work, viscous loss and friction loss from harmonics and samples, without
//! the library's closed forms.

#![allow(clippy::print_stdout)] // tests print measured values

use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use stickslip::law::{CoulombArctan, SharedLaw};
use stickslip::method::{Method, event_driven::EventDriven, shooting::Shooting};
use stickslip::model::System;
use stickslip::orbit::Orbit;
use stickslip_verification::{close, exact, integral, random_model, template, template_with};

/// The couples of the paper: slip without stops, slip with stops, and almost stuck.
const POINTS: [(&str, f64, f64); 8] = [
    ("blade-couple", 2.0, 121.25),
    ("blade-couple", 4.0, 120.75),
    ("blade-couple", 8.0, 121.0),
    ("blade-couple", 6.0, 121.2),
    ("blade-couple-massless", 2.0, 120.9),
    ("blade-couple-massless", 4.0, 121.1),
    ("symmetric-couple", 2.0, 120.93),
    ("symmetric-couple", 4.0, 121.6),
];

/// Returns the loop area of joint `j`: force times velocity, integrated between the switches.
fn area(orbit: &Orbit, j: usize) -> f64 {
    let mut breaks = orbit.transition_times();
    breaks.push(0.5 * orbit.period());
    let power = |t: f64| {
        let joint = orbit.sample(t).joints[j];
        joint.power()
    };
    integral(power, orbit.period(), &breaks)
}

/// Returns `-π F0 Im X1` for the force `F0 cos Ωt` on blade 1.
fn work_in(orbit: &Orbit) -> f64 {
    -PI * 10.0 * orbit.places[0].first_harmonic.im
}

/// Returns `Σ π b w n² |X_n|²` over the dampers to the ground; the harmonics are sums over
/// samples.
fn viscous(orbit: &Orbit, blades: [usize; 2]) -> f64 {
    const SAMPLES: usize = 2048;
    const HARMONICS: usize = 255;
    let samples: Vec<Vec<f64>> =
        (0..SAMPLES).map(|k| orbit.sample(orbit.period() * k as f64 / SAMPLES as f64).displacement).collect();
    let mut loss = 0.0;
    for blade in blades {
        for n in (1..=HARMONICS).step_by(2) {
            let (mut re, mut im) = (0.0, 0.0);
            for (k, x) in samples.iter().enumerate() {
                let (sin, cos) = (TAU * (k * n % SAMPLES) as f64 / SAMPLES as f64).sin_cos();
                re += x[blade] * cos * 2.0 / SAMPLES as f64;
                im -= x[blade] * sin * 2.0 / SAMPLES as f64;
            }
            loss += PI * 0.2 * orbit.omega * (n * n) as f64 * (re * re + im * im);
        }
    }
    loss
}

#[test]
fn theory_9_energies_from_harmonics_and_loops() {
    for (name, ft, hertz) in POINTS {
        let orbit = exact(&template(name, &[("Ft", ft)]), TAU * hertz);
        let what = format!("{name}, {ft} N, {hertz} Hz");
        let last = orbit.places.len() - 1;
        close(&format!("{what}: work in"), orbit.energy.work_in, work_in(&orbit), 1e-10);
        // `n² |X_n|²` falls at least as n^-4: harmonics above 255 contribute less than 1e-8
        close(&format!("{what}: viscous"), orbit.energy.viscous, viscous(&orbit, [0, last]), 1e-8);
        close(&format!("{what}: loop area"), orbit.energy.friction, area(&orbit, 0), 1e-9);
        let balance = work_in(&orbit) - viscous(&orbit, [0, last]) - area(&orbit, 0);
        assert!(balance.abs() < 1e-8 * work_in(&orbit), "{what}: {balance}");
    }
}

#[test]
fn theory_9_energies_of_the_smooth_law() {
    for (name, ft, hertz) in POINTS {
        let law = |limit| -> SharedLaw { Arc::new(CoulombArctan { limit, alpha: 25e3 }) };
        let system = template_with(name, &[("Ft", ft)], law);
        let orbit = Shooting { tolerance: 1e-10, width: None, ..Shooting::default() }
            .solver(&system)
            .unwrap()
            .orbit(TAU * hertz)
            .unwrap();
        let what = format!("{name}, {ft} N, {hertz} Hz");
        let last = orbit.places.len() - 1;
        assert!(orbit.evidence.energy_gap < 1e-9, "{what}: {:?}", orbit.evidence);
        close(&format!("{what}: work in"), orbit.energy.work_in, work_in(&orbit), 1e-8);
        close(&format!("{what}: viscous"), orbit.energy.viscous, viscous(&orbit, [0, last]), 1e-7);
    }
}

/// Work and losses from samples agree with the reported energies, for models with up to three
/// joints and several harmonics of force.
#[test]
fn theory_9_balance_of_random_models() {
    let (mut tried, mut worst) = (0, 0.0f64);
    for seed in 0..150 {
        let (model, omega) = random_model(seed);
        let system: System = model.assemble().unwrap();
        let Ok(orbit) = EventDriven.solver(&system).unwrap().orbit(omega) else { continue };
        let mut breaks = orbit.transition_times();
        breaks.push(0.5 * orbit.period());
        let powers = |t: f64| {
            let sample = orbit.sample(t);
            let mut work = 0.0;
            for (harmonic, force) in system.excitation(omega) {
                let turn = num_complex::Complex64::from_polar(1.0, f64::from(harmonic) * omega * t);
                work += (0..system.dofs()).map(|i| (force[i] * turn).re * sample.velocity[i]).sum::<f64>();
            }
            let mut viscous = 0.0;
            for i in 0..system.dofs() {
                for k in 0..system.dofs() {
                    viscous += system.structure().damping()[(i, k)] * sample.velocity[i] * sample.velocity[k];
                }
            }
            let friction: f64 = sample.joints.iter().map(|joint| joint.power()).sum();
            [work, viscous, friction]
        };
        let [work, viscous, friction] = [0, 1, 2].map(|which| integral(|t| powers(t)[which], orbit.period(), &breaks));
        let size = work.abs().max(viscous);
        if size < 1e-9 {
            continue; // hardly any motion
        }
        tried += 1;
        for (reported, found) in
            [(orbit.energy.work_in, work), (orbit.energy.viscous, viscous), (orbit.energy.friction, friction)]
        {
            worst = worst.max((reported - found).abs() / size);
        }
        for (j, joint) in orbit.joints.iter().enumerate() {
            assert!(joint.dissipation >= -1e-12 * size, "seed {seed}, joint {j}: {}", joint.dissipation);
            if joint.slip_fraction == 0.0 {
                assert!(joint.dissipation.abs() < 1e-12 * size);
            }
        }
    }
    println!("{tried} random models, largest difference of an energy {worst:.1e}");
    assert!(tried > 100 && worst < 1e-8);
}
