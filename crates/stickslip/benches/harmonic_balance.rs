//! Speed of harmonic balance, on one core: the massless couple of the paper by number of harmonics, its hard neighbour whole, chains.

use divan::Bencher;
use std::f64::consts::TAU;
use stickslip::curve::performance::Performance;
use stickslip::law::{Jenkins, Law};
use stickslip::method::{Method, event_driven::EventDriven, harmonic_balance::HarmonicBalance};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring, System, templates};

fn main() {
    divan::main();
}

fn balance(harmonics: usize) -> HarmonicBalance {
    HarmonicBalance { harmonics: Some(harmonics), samples: Some(1024), tolerance: None }
}

/// A curve of `points` orbits from 119.5 to 122.5 Hz.
fn curve(method: HarmonicBalance, system: &System, points: u32) {
    let mut solver = method.solver(system).unwrap();
    let mut start: Option<Vec<f64>> = None;
    for i in 0..points {
        let orbit = solver.orbit(TAU * (119.5 + 3.0 * f64::from(i) / f64::from(points - 1)), start.as_deref()).unwrap();
        start = Some(orbit.start);
    }
}

/// 100 points of the massless couple at 2 N, with error estimate and stability: divide by 100.
#[divan::bench(args = [1, 3, 5, 9, 15])]
fn massless_couple_100_points(bencher: Bencher, harmonics: usize) {
    let system = templates::find("blade-couple-massless").unwrap().model().assemble().unwrap();
    bencher.bench_local(|| curve(balance(harmonics), &system, 100));
}

/// Fig. 6 whole, 4 x 241 orbits of rigid friction with a contact mass, nine harmonics.
#[divan::bench(sample_count = 3)]
fn figure_6_whole(bencher: Bencher) {
    bencher.bench_local(|| {
        for limit in [2.0, 4.0, 6.0, 8.0] {
            let couple = templates::find("blade-couple").unwrap();
            curve(balance(9), &couple.model_with(&[("Ft", limit)]).unwrap().assemble().unwrap(), 241);
        }
    });
}

fn chain(blades: usize) -> System {
    let name = |i: usize| format!("b{i}");
    let mut model = Model::default();
    for i in 0..blades {
        model.masses.push(Mass { name: name(i), mass: 0.182 });
        model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness: 105_103.0, damping: 0.2 });
        let phase = TAU * 3.0 * i as f64 / blades as f64;
        model.forces.push(Force { on: name(i), amplitude: 10.0, phase, harmonic: 1 });
        if i > 0 {
            let law = Law::Jenkins(Jenkins { stiffness: 1e4, limit: 2.0 });
            model.joints.push(Joint { name: format!("j{i}"), between: [name(i - 1), name(i)], law });
        }
    }
    model.assemble().unwrap()
}

/// One point of a chain of blades with a joint between neighbours, five harmonics, started from the point 0.02 Hz below.
#[divan::bench(args = [10, 30, 100, 300], sample_count = 5)]
fn chain_point(bencher: Bencher, blades: usize) {
    let system = chain(blades);
    let mut solver = balance(5).solver(&system).unwrap();
    let mut start = solver.orbit(TAU * 121.0, None).unwrap().start;
    let mut point = 0u32;
    bencher.bench_local(|| {
        point += 1;
        let orbit = solver.orbit(TAU * (121.0 + 0.02 * f64::from(point % 2)), Some(&start)).unwrap();
        start = orbit.start;
    });
}

/// A performance curve of 50 slip limits with its optimum, by the exact method.
#[divan::bench(sample_count = 3)]
fn performance_curve_50_slip_limits(bencher: Bencher) {
    let couple = templates::find("blade-couple").unwrap();
    let limits: Vec<f64> = (0..50).map(|i| 0.5 + 0.25 * f64::from(i)).collect();
    bencher.bench_local(|| {
        let curve = Performance {
            system: &|limit| couple.model_with(&[("Ft", limit)]).unwrap().assemble(),
            method: &EventDriven,
            range: (TAU * 120.0, TAU * 121.5),
            points: 31,
            quantity: &|orbit| orbit.places[0].amplitude(),
        }
        .curve(&limits)
        .unwrap();
        assert!(curve.optimum.is_some());
    });
}
