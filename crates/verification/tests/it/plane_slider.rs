//! An elastic slider in a plane (`jenkins-2d`) against an integration with located switches.
//!
//! A mass of 0.5 kg stands on springs of 900 and 1600 N/m with dampers of 1.2 kg/s, and on a
//! slider of 400 N/m and 2 N. The forces are `3 cos Ωt` and `2 cos(Ωt - 1)` N.
//!
//! The reference uses SciPy 1.17: `solve_ivp` (DOP853, `rtol = 1e-12`) over 200 periods, with an
//! event at every switch. In stick `f' = k v`; in slip `|f| = L` and `f' = k (v - (v·n) n)` with
//! `n = f/L`, until `v·n` changes its sign. The last two periods differ by less than 1e-12.

use nalgebra::DMatrix;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip::law::Jenkins2d;
use stickslip::method::Method;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::shooting::Shooting;
use stickslip::model::{Axis, System};
use stickslip::structure::Structure;

/// Frequencies (rad/s) and half of peak to peak in both directions (m). The slider slips twice
/// per period.
const REFERENCE: [(f64, [f64; 2]); 5] = [
    (42.0, [1.274_350_523_0e-2, 2.127_052_959_5e-3]),
    (48.0, [1.429_170_232_9e-2, 3.155_274_586_9e-3]),
    (52.0, [9.813_807_689_0e-3, 3.208_211_714_2e-3]),
    (60.0, [4.386_257_543_3e-3, 9.473_755_462_5e-3]),
    (66.0, [3.163_051_895_5e-3, 6.411_012_638_3e-3]),
];

fn system() -> System {
    let diagonal = |a: f64, b: f64| DMatrix::from_row_slice(2, 2, &[a, 0.0, 0.0, b]);
    let names = vec!["x".to_owned(), "y".to_owned()];
    let structure = Structure::new(names, diagonal(0.5, 0.5), diagonal(1.2, 1.2), diagonal(900.0, 1600.0)).unwrap();
    let axes = (0..2).map(|row| Axis::new(vec![(row, 1.0)])).collect();
    System::builder(structure)
        .joint("slider", Arc::new(Jenkins2d { stiffness: 400.0, limit: 2.0 }), axes)
        .force(0, 1, Complex64::new(3.0, 0.0))
        .force(1, 1, Complex64::from_polar(2.0, -1.0))
        .build()
        .unwrap()
}

/// Returns the largest difference from the reference, relative to the larger amplitude.
fn distance(method: &dyn Method, omega: f64, reference: [f64; 2]) -> (f64, f64) {
    let system = system();
    let found = method.solver(&system).unwrap().orbit(omega).unwrap();
    let size = reference[0].max(reference[1]);
    let pairs = found.places.iter().zip(reference);
    let apart = pairs.map(|(place, reference)| (place.amplitude() - reference).abs() / size).fold(0.0, f64::max);
    (apart, found.evidence.error_estimate.unwrap_or(0.0))
}

/// Shooting integrates each period to 1e-6. A difference shrinks by a factor of
/// `exp(-c T/(2 m)) = 0.84` per period, so that the error of the orbit is up to six times as large.
#[test]
fn shooting_agrees_with_located_switches() {
    for (omega, reference) in REFERENCE {
        let (apart, _) = distance(&Shooting::default(), omega, reference);
        assert!(apart < 6e-6, "{omega} rad/s: {apart:.1e}");
    }
}

#[test]
fn harmonic_balance_is_within_its_error_estimate() {
    let method = HarmonicBalance { tolerance: Some(1e-4), ..HarmonicBalance::default() };
    for (omega, reference) in REFERENCE {
        let (apart, estimate) = distance(&method, omega, reference);
        assert!(estimate <= 1e-4 && apart <= 3.0 * estimate, "{omega} rad/s: {apart:.1e} {estimate:.1e}");
    }
}
