//! Speed of orbits of the paper's couple, on one core. The same orbits are checked in the verification tests.

use divan::Bencher;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::{Coulomb, CoulombArctan};
use stickslip::method::{Method, event_driven::EventDriven, shooting::Shooting};
use stickslip::model::{System, example};

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

/// One orbit in slip (2 N) and in stick-slip (4, 8 N), started from the orbit 0.0125 Hz below, as in a sweep.
#[divan::bench(args = [(2, 12125), (4, 12075), (8, 12100)])]
fn event_driven_orbit_warm(bencher: Bencher, (ft, centihertz): (u32, u32)) {
    let system = couple(f64::from(ft), None);
    let hertz = f64::from(centihertz) / 100.0;
    let mut solver = EventDriven.solver(&system).unwrap();
    let start = solver.orbit(TAU * (hertz - 0.0125), None).unwrap().start;
    bencher.bench_local(|| solver.orbit(TAU * hertz, Some(&start)).unwrap());
}

/// Fig. 6 whole: 4 x 241 orbits with amplitudes, phases, losses and stability.
#[divan::bench(sample_count = 20)]
fn figure_6_exact() {
    for ft in [2.0, 4.0, 6.0, 8.0] {
        let system = couple(ft, None);
        let mut solver = EventDriven.solver(&system).unwrap();
        let mut start: Option<Vec<f64>> = None;
        for i in 0..241 {
            let orbit = solver.orbit(TAU * (119.5 + f64::from(i) / 80.0), start.as_deref()).unwrap();
            divan::black_box(orbit.is_stable());
            start = Some(orbit.start);
        }
    }
}

/// One orbit of the arctan law at 25 s/mm, started from the orbit 0.0125 Hz below; error below 1e-7.
#[divan::bench(args = [(2, 12125), (4, 12075), (8, 12100)], sample_count = 50)]
fn smooth_orbit_warm(bencher: Bencher, (ft, centihertz): (u32, u32)) {
    let system = couple(f64::from(ft), Some(25e3));
    let hertz = f64::from(centihertz) / 100.0;
    let mut solver = Shooting::default().solver(&system).unwrap();
    let start = solver.orbit(TAU * (hertz - 0.0125), None).unwrap().start;
    bencher.bench_local(|| solver.orbit(TAU * hertz, Some(&start)).unwrap());
}
