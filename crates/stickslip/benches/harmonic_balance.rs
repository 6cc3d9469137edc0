//! Speed of harmonic balance on one core: the massless couple of the paper by number of
//! harmonics, complete curves of the couple with contact mass, chains, mistuned rings.

#![allow(clippy::print_stdout)] // a bench prints its result

use divan::Bencher;
use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Instant;
use stickslip::curve::performance::Performance;
use stickslip::curve::sweep::Watch;
use stickslip::law::{Coulomb, Jenkins};
use stickslip::method::{Method, Solver, event_driven::EventDriven, harmonic_balance::HarmonicBalance};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring, System, example};
use stickslip::orbit::Seed;

/// Numbers of blades of the chains.
const CHAINS: [usize; 4] = [10, 30, 100, 300];
/// Numbers of blades of the rings.
const RINGS: [usize; 6] = [30, 48, 60, 120, 240, 480];

fn main() {
    divan::main();
    // cargo test --benches passes --test, and a filter selects other benches
    if std::env::args().skip(1).all(|argument| argument == "--bench") {
        println!("time of a point of a chain ~ blades^{:.2}", growth(&CHAINS, &|blades| chain(blades), 5));
        println!("time of a point of a mistuned ring ~ blades^{:.2}", growth(&RINGS, &|blades| ring(blades), 7));
    }
}

/// Returns the exponent of the time per point over the number of blades, by least squares in
/// the logarithms.
fn growth(sizes: &[usize], made: &dyn Fn(usize) -> System, harmonics: usize) -> f64 {
    let points: Vec<(f64, f64)> = sizes
        .iter()
        .map(|&blades| {
            let system = made(blades);
            let mut series = Neighbours::new(&system, harmonics);
            let mut seconds: Vec<f64> = (0..11)
                .map(|_| {
                    let begin = Instant::now();
                    series.next();
                    begin.elapsed().as_secs_f64()
                })
                .collect();
            seconds.sort_by(f64::total_cmp);
            ((blades as f64).ln(), seconds[5].ln())
        })
        .collect();
    let mean = |read: fn(&(f64, f64)) -> f64| points.iter().map(read).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>()
        / points.iter().map(|p| (p.0 - x) * (p.0 - x)).sum::<f64>()
}

/// Successive points from 121 Hz upward, each with a warm start from the previous one. No point
/// repeats, because an identical point would need no step.
struct Neighbours<'a> {
    solver: Box<dyn Solver + Send + 'a>,
    start: Seed,
    count: u32,
}

impl<'a> Neighbours<'a> {
    fn new(system: &'a System, harmonics: usize) -> Self {
        let mut solver = balance(harmonics).solver(system).unwrap();
        let start = solver.orbit(TAU * 121.0).unwrap().seed();
        Neighbours { solver, start, count: 0 }
    }

    fn next(&mut self) {
        self.count += 1;
        let omega = TAU * (121.0 + 0.02 * f64::from(self.count));
        self.start = self.solver.orbit_near(omega, Some(&self.start)).unwrap().seed();
    }
}

fn balance(harmonics: usize) -> HarmonicBalance {
    HarmonicBalance { harmonics: Some(harmonics), samples: Some(1024), tolerance: None }
}

/// Computes a curve of `points` orbits from 119.5 to 122.5 Hz.
fn curve(method: HarmonicBalance, system: &System, points: u32) {
    let mut solver = method.solver(system).unwrap();
    let mut start: Option<Seed> = None;
    for i in 0..points {
        let orbit =
            solver.orbit_near(TAU * (119.5 + 3.0 * f64::from(i) / f64::from(points - 1)), start.as_ref()).unwrap();
        start = Some(orbit.seed());
    }
}

/// 100 points of the massless couple at 2 N, with error estimate and stability. Divide the time
/// by 100.
#[divan::bench(args = [1, 3, 5, 9, 15])]
fn massless_couple_100_points(bencher: Bencher, harmonics: usize) {
    let system = example::blade_couple_massless().assemble().unwrap();
    bencher.bench_local(|| curve(balance(harmonics), &system, 100));
}

/// The complete Fig. 6: 4 x 241 orbits of rigid friction with a contact mass, nine harmonics.
#[divan::bench(sample_count = 3)]
fn figure_6_whole(bencher: Bencher) {
    bencher.bench_local(|| {
        for limit in [2.0, 4.0, 6.0, 8.0] {
            curve(balance(9), &couple(limit).assemble().unwrap(), 241);
        }
    });
}

/// Returns the couple with a contact mass and this slip limit, N.
fn couple(limit: f64) -> Model {
    let mut couple = example::blade_couple();
    couple.joints[0].law = Arc::new(Coulomb { limit });
    couple
}

/// Returns blades under engine order 3 with a joint between adjacent blades, and one between
/// the last and the first if `closed`. `mistuning` spreads the stiffnesses uniformly, in an
/// order that does not repeat.
fn row(blades: usize, closed: bool, mistuning: f64) -> System {
    let name = |i: usize| format!("b{i}");
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let mut model = Model::default();
    for i in 0..blades {
        let spread = 2.0 * (i as f64 * golden).fract() - 1.0;
        let stiffness = 105_103.0 * (1.0 + mistuning * spread);
        model.masses.push(Mass::new(name(i), 0.182));
        model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness, damping: 0.2 });
        let phase = TAU * 3.0 * i as f64 / blades as f64;
        model.forces.push(Force { on: name(i), amplitude: 10.0, phase, harmonic: 1 });
        if i > 0 || closed {
            let law = Arc::new(Jenkins { stiffness: 1e4, limit: 2.0 });
            let before = name((i + blades - 1) % blades);
            model.joints.push(Joint { name: format!("j{i}"), between: [before, name(i)], law });
        }
    }
    model.assemble().unwrap()
}

fn chain(blades: usize) -> System {
    row(blades, false, 0.0)
}

/// Returns a ring with a mistuning of one percent.
fn ring(blades: usize) -> System {
    row(blades, true, 0.01)
}

/// One point of a chain of blades with a joint between adjacent blades, five harmonics, with a
/// warm start from 0.02 Hz below.
#[divan::bench(args = CHAINS, sample_count = 5)]
fn chain_point(bencher: Bencher, blades: usize) {
    let system = chain(blades);
    let mut series = Neighbours::new(&system, 5);
    bencher.bench_local(|| series.next());
}

/// One point of a mistuned ring, seven harmonics, with error estimate, with a warm start from
/// 0.02 Hz below.
#[divan::bench(args = RINGS, sample_count = 5)]
fn ring_point(bencher: Bencher, blades: usize) {
    let system = ring(blades);
    let mut series = Neighbours::new(&system, 7);
    bencher.bench_local(|| series.next());
}

/// A performance curve of 50 slip limits with its optimum, by the exact method.
#[divan::bench(sample_count = 3)]
fn performance_curve_50_slip_limits(bencher: Bencher) {
    let limits: Vec<f64> = (0..50).map(|i| 0.5 + 0.25 * f64::from(i)).collect();
    bencher.bench_local(|| {
        let curve = Performance {
            system: &|limit| couple(limit).assemble(),
            method: &EventDriven,
            range: (TAU * 120.0, TAU * 121.5),
            points: 31,
            quantities: &|orbit| vec![orbit.places[0].amplitude()],
            watch: Watch::none(),
        }
        .curve(&limits)
        .unwrap();
        assert!(curve.optimum.is_some());
    });
}
