//! Mass matrices whose null space is not along coordinates: the response of the structure against
//! a solution with the dynamic stiffness.
//!
//! `STICKSLIP_MASSLESS=1000` sets the number of structures.

#![allow(clippy::print_stdout)] // tests print measured values

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use stickslip::method::Method;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::model::{Axis, System};
use stickslip::structure::Structure;
use stickslip_numerics::random::Stream;

/// Returns a matrix of normally distributed entries.
fn normal_matrix(rows: usize, columns: usize, random: Stream, first: u64) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |i, k| random.normal(first + (i * columns + k) as u64))
}

/// Returns a mass matrix of `n` coordinates, `massless` combinations of which have no mass. The
/// kinds are rigid links, masses on pairs of coordinates, masses over eight decades in rotated
/// coordinates, and a superelement with eigenvalues of -1e-16.
fn mass_matrix(kind: usize, n: usize, massless: usize, random: Stream) -> DMatrix<f64> {
    let mass = match kind {
        0 => {
            let links = normal_matrix(n - massless, n, random, 0);
            links.transpose() * links
        }
        1 => {
            let mut mass = DMatrix::<f64>::zeros(n, n);
            for k in 0..n - massless {
                let mut pair = DVector::<f64>::zeros(n);
                pair[(random.uniform(4 * k as u64) * n as f64) as usize] += 1.0;
                pair[(random.uniform(4 * k as u64 + 1) * n as f64) as usize] += random.normal(4 * k as u64 + 2);
                mass += &pair * pair.transpose() * (0.1 + 10.0 * random.uniform(4 * k as u64 + 3));
            }
            mass
        }
        _ => {
            let rotation = normal_matrix(n, n, random, 0).qr().q();
            let value = |i: usize| match (i < massless, kind) {
                (true, 2) => 0.0,
                (true, _) => -1e-16,
                (false, 2) => 10f64.powf(8.0 * random.uniform(10_000 + i as u64) - 6.0),
                (false, _) => 0.5 + random.uniform(10_000 + i as u64),
            };
            &rotation * DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| value(i))) * rotation.transpose()
        }
    };
    (&mass + mass.transpose()) * 0.5
}

/// Structures without damping and with damping proportional to stiffness, at a frequency at which
/// the dynamic stiffness is well conditioned.
#[test]
fn structures_with_massless_combinations_respond_like_their_dynamic_stiffness() {
    let count = std::env::var("STICKSLIP_MASSLESS").ok().and_then(|text| text.parse().ok()).unwrap_or(80);
    let (mut compared, mut worst) = (0, 0.0f64);
    for seed in 0..count {
        let random = Stream::new(seed);
        let n = 3 + (random.uniform(20_000) * 22.0) as usize;
        let massless = 1 + (random.uniform(20_001) * (n - 1) as f64) as usize;
        let mass = mass_matrix(seed as usize % 4, n, massless.min(n - 1), random);
        let spread = normal_matrix(n, n, random, 30_000);
        let stiffness = (&spread * spread.transpose() + DMatrix::identity(n, n) * n as f64) * 1e6;
        let damping = &stiffness * if seed % 8 < 4 { 0.0 } else { 2e-7 };
        let omega = (0.3 + random.uniform(20_002)) * (stiffness.trace() / mass.trace()).sqrt();
        let dynamic = (&stiffness - &mass * (omega * omega)).map(|v| Complex64::new(v, 0.0))
            + damping.map(|v| Complex64::new(0.0, omega * v));
        let singular = dynamic.clone().singular_values();
        if singular.min() < 1e-5 * singular.max() {
            continue;
        }
        let mut load = DVector::<Complex64>::zeros(n);
        load[0] = Complex64::new(1.0, 0.0);
        let expected = dynamic.lu().solve(&load).unwrap();
        let names = (0..n).map(|i| format!("p{i}")).collect();
        let structure = Structure::new(names, mass, damping, stiffness).unwrap_or_else(|e| panic!("{seed}: {e}"));
        let mut builder = System::builder(structure).force(0, 1, load[0]);
        for i in 0..n {
            builder = builder.place(format!("p{i}"), Axis::new(vec![(i, 1.0)]));
        }
        let system = builder.build().unwrap();
        let orbit = HarmonicBalance::default().solver(&system).unwrap().orbit(omega);
        let orbit = orbit.unwrap_or_else(|e| panic!("{seed}: {e}"));
        let size = expected.iter().map(|x| x.norm()).fold(0.0, f64::max);
        let apart = orbit.places.iter().zip(&expected).map(|(place, x)| (place.amplitude() - x.norm()).abs() / size);
        let apart = apart.fold(0.0, f64::max);
        assert!(apart < 1e-8, "{seed}: {n} coordinates, {massless} massless: {apart:.1e}");
        (compared, worst) = (compared + 1, worst.max(apart));
    }
    println!("{compared} of {count} structures compared, largest difference {worst:.1e}");
    assert!(2 * compared > count as usize);
}
