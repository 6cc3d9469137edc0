//! Rings of many nodes, each in contact with the next along one to three directions.

use num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::{BoucWen, Dahl, FrictionContact, Jenkins, Jenkins2d, SharedLaw};
use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
use stickslip::model::{Axis, Force, GROUND, Joint, Mass, Model, Spring, System};
use stickslip::orbit::{Orbit, Seed};
use stickslip::structure::Structure;
use stickslip_numerics::sparse::SparseMatrix;

/// Returns nodes of `directions` degrees of freedom on springs. Springs and a contact couple
/// each node to the next. The excitation is a travelling wave with one period per
/// `nodes / waves` nodes.
fn ring(nodes: usize, waves: usize, directions: usize, law: SharedLaw) -> System {
    let (mass, stiffness, coupling, damping) = (0.2, 1e5, 4e3, 1.5);
    let at = |node: usize, direction: usize| (node % nodes) * directions + direction;
    let n = nodes * directions;
    let diagonal = |value: f64| SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, value))).unwrap();
    let mut springs = Vec::new();
    for node in 0..nodes {
        for d in 0..directions {
            let (i, k) = (at(node, d), at(node + 1, d));
            springs.push((i, i, stiffness * (1.0 + 0.1 * d as f64)));
            springs.extend([(i, i, coupling), (k, k, coupling), (i, k, -coupling), (k, i, -coupling)]);
        }
    }
    let names = (0..n).map(|i| format!("{i}")).collect();
    let structure =
        Structure::sparse(names, diagonal(mass), diagonal(damping), SparseMatrix::from_triplets(n, springs).unwrap())
            .unwrap();
    let mut builder = System::builder(structure);
    for node in 0..nodes {
        let axes = (0..directions).map(|d| Axis::new(vec![(at(node, d), 1.0), (at(node + 1, d), -1.0)]));
        builder = builder.joint(format!("j{node}"), law.clone(), axes.collect());
        for d in 0..directions {
            let phase = TAU * (waves * node) as f64 / nodes as f64 + d as f64;
            builder = builder.force(at(node, d), 1, Complex64::from_polar(10.0 / (1.0 + d as f64), phase));
        }
    }
    builder.build().unwrap()
}

/// Computes orbits over a resonance, each with a warm start from the previous one.
fn sweep(system: &System, omegas: &[f64]) -> Vec<Orbit> {
    let method = HarmonicBalance { harmonics: Some(3), samples: Some(256), tolerance: None };
    let mut solver = method.solver(system).unwrap();
    let mut start: Option<Seed> = None;
    let mut orbits = Vec::new();
    for &omega in omegas {
        let orbit = solver.orbit_near(omega, start.as_ref()).unwrap_or_else(|error| panic!("{error}"));
        start = Some(orbit.seed());
        orbits.push(orbit);
    }
    orbits
}

/// The phase between adjacent nodes is a quarter of a period, so that four nodes move like any
/// multiple of four.
fn check(directions: usize, law: SharedLaw, nodes: usize, omegas: &[f64]) {
    let small = sweep(&ring(4, 1, directions, law.clone()), omegas);
    let large = sweep(&ring(nodes, nodes / 4, directions, law), omegas);
    for (small, large) in small.iter().zip(&large) {
        for (i, place) in large.places.iter().enumerate() {
            let expected = small.places[i % (4 * directions)].amplitude();
            assert!(
                (place.amplitude() - expected).abs() < 1e-7 * expected,
                "{} {i}: {} {expected}",
                small.omega,
                place.amplitude()
            );
        }
        assert!(large.joints[0].slip_fraction > 0.0 || large.energy.friction > 0.0);
    }
}

const OMEGAS: [f64; 4] = [690.0, 720.0, 750.0, 760.0];

#[test]
fn contacts_in_a_plane() {
    check(2, Arc::new(Jenkins2d { stiffness: 1e4, limit: 3.0 }), 100, &OMEGAS);
}

#[test]
fn contacts_that_separate() {
    let law = FrictionContact { tangential: 1e4, normal: 1.5e4, friction: 0.3, preload: 12.0, tangents: 2 };
    check(3, Arc::new(law), 100, &OMEGAS[1..3]);
}

#[test]
fn laws_of_rates() {
    let bouc_wen = BoucWen { stiffness: 1e4, beta: 2e3, gamma: 1e3, exponent: 1.0 };
    check(1, Arc::new(bouc_wen), 200, &OMEGAS[1..3]);
    check(1, Arc::new(Dahl { stiffness: 1e4, limit: 3.0 }), 200, &OMEGAS[1..3]);
}

/// Returns blades with stiffnesses spread irregularly by 2 %, with a damper joint between
/// adjacent blades, under engine order 5.
fn mistuned(blades: usize) -> System {
    let mut model = Model::default();
    let name = |i: usize| format!("b{}", i % blades);
    // an odd multiplier modulo 2^32 (Knuth), summed to a spread with a standard deviation of
    // one
    let mut state = 12345u32;
    let mut uniform = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state) / 2f64.powi(32)
    };
    for i in 0..blades {
        let spread = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        model.masses.push(Mass::new(name(i), 0.2));
        let stiffness = 1e5 * (1.0 + 0.02 * spread);
        model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness, damping: 0.5 });
        let phase = TAU * 5.0 * i as f64 / blades as f64;
        model.forces.push(Force { on: name(i), amplitude: 5.0, phase, harmonic: 1 });
        let law = Arc::new(Jenkins { stiffness: 2e4, limit: 2.0 });
        model.joints.push(Joint { name: format!("j{i}"), between: [name(i), name(i + 1)], law });
    }
    model.assemble().unwrap()
}

/// Returns mean and maximum of the Newton iterations of a point, each with a warm start from
/// `step` Hz below.
fn iterations(blades: usize, from: f64, step: f64, points: u32) -> (f64, usize) {
    let system = mistuned(blades);
    let method = HarmonicBalance { harmonics: Some(5), samples: None, tolerance: Some(0.1) };
    let mut solver = method.solver(&system).unwrap();
    let mut start = solver.orbit(TAU * from).unwrap().seed();
    let counts: Vec<usize> = (1..=points)
        .map(|i| {
            let orbit = solver.orbit_near(TAU * (from + step * f64::from(i)), Some(&start)).unwrap();
            start = orbit.seed();
            orbit.evidence.iterations
        })
        .collect();
    (counts.iter().sum::<usize>() as f64 / f64::from(points), counts.into_iter().max().unwrap())
}

/// With more dampers, more of them begin to slip or stick between two points. The line search
/// still finds every orbit of a ring of 192 blades, in steps that grow far less than the number of
/// blades.
#[test]
fn steps_grow_slower_than_the_number_of_blades() {
    let (few, _) = iterations(24, 113.5, 0.05, 12);
    let (many, most) = iterations(192, 113.5, 0.05, 12);
    assert!(many <= 8.0f64.sqrt() * few && most <= 60, "{few}, {many}, {most}");
}
