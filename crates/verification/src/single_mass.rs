//! A test system for every law of the table: one mass on a spring and the law, along each
//! direction of the law.

use nalgebra::DMatrix;
use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip::law::SharedLaw;
use stickslip::model::{Axis, System};
use stickslip::structure::Structure;

/// Mass, kg.
pub const MASS: f64 = 0.182;
/// Stiffness along each direction, N/m.
pub const STIFFNESS: f64 = 105_103.0;
/// Amplitude of the force along the first direction, N.
pub const FORCE: f64 = 10.0;
/// Excitation frequency, rad/s.
pub const OMEGA: f64 = TAU * 118.0;

/// Returns the complex amplitude of the force along a direction, N.
pub fn load(a: usize) -> Complex64 {
    Complex64::from_polar(FORCE / (1 + a) as f64, 0.9 * a as f64)
}

/// Returns the mass with viscous `damping` (N s/m) along each direction, under [`load`] and the
/// constant force `constant` (N) along all directions.
pub fn mass_on_law(law: &SharedLaw, damping: f64, constant: f64) -> System {
    let d = law.directions();
    let one = DMatrix::identity(d, d);
    let places = (0..d).map(|a| format!("x{a}")).collect();
    let structure = Structure::new(places, &one * MASS, &one * damping, &one * STIFFNESS).unwrap();
    let axes = (0..d).map(|a| Axis::new(vec![(a, 1.0)])).collect();
    let mut builder = System::builder(structure).joint("j", law.clone(), axes);
    for a in 0..d {
        builder = builder.force(a, 1, load(a));
        if constant != 0.0 {
            builder = builder.force(a, 0, Complex64::new(constant, 0.0));
        }
    }
    builder.build().unwrap()
}
