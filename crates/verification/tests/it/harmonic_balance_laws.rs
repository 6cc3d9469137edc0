//! Every law in harmonic balance: a view of the law, not the port, evaluates the forces under
//! the orbit's motion. These forces must balance the structure and dissipate the reported
//! energy.

use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip::law::{SharedLaw, TABLE};
use stickslip::method::{Method, MethodError, Refusal, harmonic_balance::HarmonicBalance, solver_with_alternatives};
use stickslip::model::{Axis, System};
use stickslip::orbit::Orbit;
use stickslip_verification::law_driver::{self, View};
use stickslip_verification::single_mass::{FORCE, MASS, OMEGA, STIFFNESS, load, mass_on_law};

/// Viscous damping, N s/m.
const DAMPING: f64 = 5.0;

/// Largest force error due to the series, in estimated errors of the motion. Elastic forces are
/// ten times the excitation, and a steep law responds to the ripple of the series.
const SERIES: f64 = 100.0;
/// Largest return defect due to the series, in the same unit; velocities count there like
/// displacements.
const RETURN: f64 = 30.0;
/// Error due to the samples of a port: the motion between two of 1024 samples is curved, and
/// the steps of a rate law have order 3.
const SAMPLED: f64 = 5e-6;

/// Numbers of periods of the orbit's motion after which the forces may balance. Some laws
/// forget their start at once, others creep for hundreds of periods. A wrong orbit does not
/// balance after any of them.
const PERIODS: [usize; 4] = [5, 20, 80, 320];

/// Returns the forces of the law over the last of `periods` periods of the orbit's motion, and
/// their loss.
fn answer(law: &SharedLaw, view: View, orbit: &Orbit, periods: usize) -> (Vec<[f64; 3]>, f64) {
    const SAMPLES: usize = 4096;
    let period = orbit.period();
    let motion = |t: f64| {
        let joint = orbit.sample(t).joints[0];
        (joint.displacement, joint.velocity)
    };
    let times: Vec<f64> = (0..=SAMPLES * periods).map(|i| period * i as f64 / SAMPLES as f64).collect();
    let forces = law_driver::forces(&**law, view, &motion, &times);
    let last = SAMPLES * (periods - 1);
    let loss = law_driver::dissipated(&motion, &times[last..], &forces[last..]);
    (forces[last..times.len() - 1].to_vec(), loss)
}

/// Returns the amplitude of a harmonic of samples along a direction.
fn harmonic(samples: &[[f64; 3]], a: usize, h: usize) -> Complex64 {
    let n = samples.len() as f64;
    let scale = if h == 0 { 1.0 } else { 2.0 } / n;
    samples.iter().enumerate().map(|(i, f)| Complex64::cis(-TAU * (h * i) as f64 / n) * (f[a] * scale)).sum()
}

/// Returns the errors of loss, and of the balance in first harmonic and mean along each
/// direction. They are relative to the work and the force of the excitation.
fn off_balance(law: &SharedLaw, view: View, orbit: &Orbit, constant: f64, periods: usize) -> Vec<f64> {
    let (forces, loss) = answer(law, view, orbit, periods);
    let mut off = vec![(orbit.joints[0].dissipation - loss).abs() / orbit.energy.work_in];
    for (a, place) in orbit.places.iter().enumerate() {
        let dynamic = Complex64::new(STIFFNESS - OMEGA * OMEGA * MASS, OMEGA * DAMPING);
        let moving = dynamic * place.first_harmonic + harmonic(&forces, a, 1) - load(a);
        let mean = STIFFNESS * place.mean + harmonic(&forces, a, 0).re - constant;
        off.extend([moving.norm() / FORCE, mean.abs() / FORCE]);
    }
    off
}

#[test]
fn every_law_balances_the_structure() {
    let (mut taken, mut returned) = (0, 0);
    for (info, constant) in TABLE.iter().flat_map(|info| [(info, 0.0), (info, 1.5)]) {
        let law = (info.build)(info.sample);
        let system = mass_on_law(&law, DAMPING, constant);
        let method = HarmonicBalance { harmonics: Some(31), ..HarmonicBalance::default() };
        let mut solver = match solver_with_alternatives(&method, &system) {
            Ok(solver) => solver,
            // harmonic balance may refuse a law by name, with alternative methods
            Err(MethodError { refusal: Refusal::Law { .. }, alternatives: ways }) => {
                assert!(ways.methods.contains(&"event-driven"), "{}: {ways}", info.name);
                continue;
            }
            Err(error) => panic!("{}: {error}", info.name),
        };
        taken += 1;
        let orbit = solver.orbit(OMEGA).unwrap_or_else(|error| panic!("{} {constant}: {error}", info.name));
        let views = law_driver::views(&*law);
        // the resolvent of a rigid law leaves the force at rest free, and a series never quite
        // rests: prefer any other view
        let view = *views.iter().find(|view| **view != View::Prox).unwrap_or(&views[0]);
        // the time integration from the start of the series, with the states of the port,
        // returns
        if let Some(defect) = orbit.evidence.return_defect {
            let bound = SAMPLED + RETURN * orbit.evidence.error_estimate.expect("an estimate");
            assert!(defect < bound, "{} {constant}: returns {defect:.1e} of {bound:.1e}", info.name);
            returned += 1;
        }
        let bound = SAMPLED + SERIES * orbit.evidence.error_estimate.expect("an estimate");
        let off = |periods: &usize| off_balance(&law, view, &orbit, constant, *periods);
        let balances = |off: Vec<f64>| off.iter().all(|off| *off < bound);
        assert!(
            PERIODS.iter().map(off).any(balances),
            "{} {constant}: {:?} of {bound:.1e}",
            info.name,
            off(&PERIODS[3])
        );
    }
    assert!(taken > TABLE.len() && 2 * returned > taken, "most laws: {taken} {returned}");
}

/// Orbits exist for a force too small for slip, and for a large force.
#[test]
fn every_law_has_small_and_large_orbits() {
    for (info, share) in TABLE.iter().flat_map(|info| [(info, 0.01), (info, 10.0)]) {
        let law = (info.build)(info.sample);
        let d = law.directions();
        let mut builder = System::builder(mass_on_law(&law, DAMPING, 0.0).structure().clone()).joint(
            "j",
            law.clone(),
            (0..d).map(|a| Axis::new(vec![(a, 1.0)])).collect(),
        );
        for a in 0..d {
            builder = builder.force(a, 1, load(a) * share);
        }
        let system = builder.build().unwrap();
        let Ok(mut solver) = HarmonicBalance { harmonics: Some(9), ..HarmonicBalance::default() }.solver(&system)
        else {
            continue;
        };
        let orbit = solver.orbit(OMEGA).unwrap_or_else(|error| panic!("{} {share}: {error}", info.name));
        // if rigid friction holds everything, the remainder is rounding
        let unit = FORCE * FORCE * share * share / STIFFNESS;
        let energy = orbit.energy;
        let gap = (energy.work_in - energy.viscous - energy.friction).abs();
        assert!(gap < 1e-6 * energy.work_in.abs() + 1e-12 * unit, "{} {share}: {energy:?}", info.name);
        assert!(energy.friction > -1e-9 * unit, "{} {share}: {energy:?}", info.name);
    }
}
