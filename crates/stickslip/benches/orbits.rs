//! Speed of orbits of the paper's couple on one core. The verification tests check these
//! orbits.

use divan::Bencher;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::{Coulomb, Coulomb2d, CoulombArctan, Iwan, Jenkins2d, SharedLaw, Stribeck};
use stickslip::method::{Method, auto::Auto, event_driven::EventDriven, shooting::Shooting};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring, System, example};
use stickslip::orbit::Seed;

fn main() {
    divan::main();
}

fn couple(ft: f64, alpha: Option<f64>) -> System {
    let mut model = example::blade_couple();
    model.joints[0].law = match alpha {
        None => Arc::new(Coulomb { limit: ft }),
        Some(alpha) => Arc::new(CoulombArctan { limit: ft, alpha }),
    };
    model.assemble().unwrap()
}

/// One orbit in slip (2 N) and in stick-slip (4, 8 N), with a warm start from 0.0125 Hz below,
/// as in a sweep.
#[divan::bench(args = [(2, 12125), (4, 12075), (8, 12100)])]
fn event_driven_orbit_warm(bencher: Bencher, (ft, centihertz): (u32, u32)) {
    let system = couple(f64::from(ft), None);
    let hertz = f64::from(centihertz) / 100.0;
    let mut solver = EventDriven.solver(&system).unwrap();
    let start = solver.orbit(TAU * (hertz - 0.0125)).unwrap().seed();
    bencher.bench_local(|| solver.orbit_near(TAU * hertz, Some(&start)).unwrap());
}

/// The complete Fig. 6: 4 x 241 orbits with amplitudes, phases, losses and stability.
#[divan::bench(sample_count = 20)]
fn figure_6_exact() {
    for ft in [2.0, 4.0, 6.0, 8.0] {
        let system = couple(ft, None);
        let mut solver = EventDriven.solver(&system).unwrap();
        let mut start: Option<Seed> = None;
        for i in 0..241 {
            let orbit = solver.orbit_near(TAU * (119.5 + f64::from(i) / 80.0), start.as_ref()).unwrap();
            divan::black_box(orbit.is_stable());
            start = Some(orbit.seed());
        }
    }
}

/// One orbit of the arctan law at 25 s/mm, with a warm start from 0.0125 Hz below; the error is
/// below 1e-7.
#[divan::bench(args = [(2, 12125), (4, 12075), (8, 12100)], sample_count = 50)]
fn smooth_orbit_warm(bencher: Bencher, (ft, centihertz): (u32, u32)) {
    let system = couple(f64::from(ft), Some(25e3));
    let hertz = f64::from(centihertz) / 100.0;
    let mut solver = Shooting::default().solver(&system).unwrap();
    let start = solver.orbit(TAU * (hertz - 0.0125)).unwrap().seed();
    bencher.bench_local(|| solver.orbit_near(TAU * hertz, Some(&start)).unwrap());
}

/// A mass of 1 kg on a spring of 10 N/mm and a damper of 3 N s/m under 6 N, with a law to the
/// ground.
fn mass(law: SharedLaw) -> System {
    let between = || ["m".to_owned(), GROUND.to_owned()];
    let model = Model {
        masses: vec![Mass::new("m", 1.0)],
        springs: vec![Spring { between: between(), stiffness: 1e4, damping: 3.0 }],
        joints: vec![Joint { name: "j".to_owned(), between: between(), law }],
        forces: vec![Force { on: "m".to_owned(), amplitude: 6.0, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    };
    model.assemble().unwrap()
}

/// Times one orbit of method `auto`, with a warm start from 0.05 Hz below.
fn warm(bencher: Bencher, system: &System, hertz: f64) {
    let mut solver = Auto.solver(system).unwrap();
    let start = solver.orbit(TAU * (hertz - 0.05)).unwrap().seed();
    bencher.bench_local(|| solver.orbit_near(TAU * hertz, Some(&start)).unwrap());
}

/// Decreasing friction in a motion that sticks (4, 8 Hz), reverses immediately (12 Hz) and
/// slips far (15 Hz).
#[divan::bench(args = [4, 8, 12, 15], sample_count = 20)]
fn stribeck_orbit_warm(bencher: Bencher, hertz: u32) {
    let law = Arc::new(Stribeck { limit: 2.0, static_limit: 3.0, velocity: 0.02 });
    warm(bencher, &mass(law), f64::from(hertz));
}

/// The continuous distribution (0), and 32 and 300 sliders in its place, beyond complete slip.
#[divan::bench(args = [0, 32, 300], sample_count = 20)]
fn iwan_orbit_warm(bencher: Bencher, elements: u32) {
    let law = Arc::new(Iwan { stiffness: 5e3, limit: 4.0, chi: -0.5, beta: 0.3, elements });
    warm(bencher, &mass(law), 17.0);
}

/// Two masses that move in a plane, with a law from each one to the ground.
fn plane([of_a, of_b]: [SharedLaw; 2]) -> System {
    let mass = |name: &str| Mass { directions: ["x", "y"].map(str::to_owned).to_vec(), ..Mass::new(name, 1.0) };
    let spring =
        |between: [&str; 2], stiffness: f64| Spring { between: between.map(str::to_owned), stiffness, damping: 2.0 };
    let joint = |on: &str, law: SharedLaw| Joint {
        name: format!("contact_{on}"),
        between: [on.to_owned(), GROUND.to_owned()],
        law,
    };
    let force = |on: &str, amplitude: f64, phase: f64| Force { on: on.to_owned(), amplitude, phase, harmonic: 1 };
    let model = Model {
        masses: vec![mass("a"), mass("b")],
        springs: vec![
            spring(["a.x", GROUND], 1e4),
            spring(["a.y", GROUND], 1.5e4),
            spring(["a.x", "b.x"], 1e4),
            spring(["a.y", "b.y"], 1e4),
        ],
        joints: vec![joint("a", of_a), joint("b", of_b)],
        forces: vec![force("b.x", 6.0, 0.0), force("b.y", 4.0, 1.2)],
        ..Model::default()
    };
    model.assemble().unwrap()
}

/// Friction in a plane: rigid, with a tangential spring, and both in one model.
#[divan::bench(args = ["coulomb-2d", "jenkins-2d", "coulomb-2d and jenkins-2d"], sample_count = 20)]
fn plane_friction_orbit_warm(bencher: Bencher, laws: &str) {
    let rigid: SharedLaw = Arc::new(Coulomb2d { limit: 1.0 });
    let elastic: SharedLaw = Arc::new(Jenkins2d { stiffness: 2e4, limit: 2.0 });
    let laws = match laws {
        "coulomb-2d" => [rigid.clone(), rigid],
        "jenkins-2d" => [elastic.clone(), elastic],
        _ => [rigid, elastic],
    };
    warm(bencher, &plane(laws), 17.0);
}
