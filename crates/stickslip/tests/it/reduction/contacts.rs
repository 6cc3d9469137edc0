//! Contacts that a block couples: compares harmonic balance with time integration.

use super::brick::Brick;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip::law::FrictionContact;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::{Method, shooting::Shooting};
use stickslip::model::{Axis, System};
use stickslip::structure::Structure;

/// Relative error of one integration step, and of an orbit.
const STEP: f64 = 1e-7;
const INTEGRATED: f64 = 1e3 * STEP;
/// Approximate first natural frequency of the cube, rad/s: `√(G L / (m/3))`.
const FIRST: f64 = 2.8e5;

/// Returns a cube of 20 mm that is fixed at one face. `nodes` corners of the opposite face are
/// pressed to the ground and pulled along it.
fn cube(nodes: usize) -> System {
    let brick = Brick::new([1, 1, 1], [0.02; 3], true);
    let n = brick.dofs();
    let full = |matrix: &stickslip_numerics::sparse::SparseMatrix| {
        let mut full = nalgebra::DMatrix::zeros(n, n);
        matrix.entries().for_each(|(i, k, value)| full[(i, k)] += value);
        full
    };
    let (mass, stiffness) = (full(&brick.mass), full(&brick.stiffness));
    let damping = &stiffness * (2.0 * 0.01 / FIRST);
    let names = (0..n).map(|i| format!("{i}")).collect();
    let mut builder = System::builder(Structure::new(names, mass, damping, stiffness).unwrap());
    let ports = brick.face(nodes);
    let axis = |port: usize| Axis::new(ports[port].clone());
    for node in 0..nodes {
        let law = FrictionContact { tangential: 3e8, normal: 3e8, friction: 0.3, preload: 100.0, tangents: 2 };
        let axes = [1, 2, 0].map(|direction| axis(3 * node + direction)).to_vec();
        builder = builder.joint(format!("c{node}"), Arc::new(law), axes);
        builder = builder.force(ports[3 * node + 1][0].0, 1, Complex64::new(120.0, 0.0));
        builder = builder.force(ports[3 * node + 2][0].0, 1, Complex64::new(50.0, 6.0));
    }
    builder.build().unwrap()
}

/// Both orbits agree within their reported errors, below and next to the resonance.
#[test]
fn contacts_of_a_block_move_as_in_time() {
    for (nodes, omega) in [(1, 0.6 * FIRST), (2, 0.8 * FIRST)] {
        let system = cube(nodes);
        let balance = HarmonicBalance { harmonics: Some(9), ..HarmonicBalance::default() };
        let series = balance.solver(&system).unwrap().orbit(omega).unwrap();
        let shooting = Shooting { tolerance: STEP, ..Shooting::default() };
        let in_time = shooting.solver(&system).unwrap().orbit_near(omega, Some(&series.seed())).unwrap();
        let slip = series.joints.iter().map(|joint| joint.slip_fraction).fold(0.0, f64::max);
        assert!(slip > 0.1 && slip < 0.99, "{nodes}: {slip}");
        let truncation = series.evidence.error_estimate.unwrap();
        assert!(truncation < 0.02, "{truncation}");
        let largest = in_time.places.iter().map(|place| place.amplitude()).fold(0.0, f64::max);
        let distance = series.places.iter().zip(&in_time.places).map(|(a, b)| (a.amplitude() - b.amplitude()).abs());
        let distance = distance.fold(0.0, f64::max) / largest;
        assert!(distance <= truncation + INTEGRATED, "{nodes}: {distance:.1e}, estimated {truncation:.1e}");
    }
}
