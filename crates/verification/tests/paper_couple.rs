//! The blade couple of Pust, Pesek, Radolfova (2015), exact law: theory sections 6 and 8.

use std::f64::consts::TAU;
use stickslip::method::{Method, event_driven::EventDriven};
use stickslip::model::templates;
use stickslip::orbit::Orbit;

/// Orbit of a template with some parameters changed, at `hertz`.
fn orbit(template: &str, changes: &[(&str, f64)], hertz: f64) -> Orbit {
    let model = templates::find(template).unwrap().model_with(changes).unwrap();
    let system = model.assemble().unwrap();
    EventDriven.solver(&system).unwrap().orbit(TAU * hertz, None).unwrap()
}

/// Amplitudes in cm against printed digits, which are maxima over samples: half a unit of the last digit and 3e-5 relative.
fn check_cm(orbit: &Orbit, expected: &[f64]) {
    assert!(orbit.evidence.residual < 1e-11, "{:?}", orbit.evidence);
    assert!(orbit.evidence.energy_gap < 1e-9, "{:?} {:?}", orbit.evidence, orbit.energy);
    for (place, expected) in orbit.places.iter().zip(expected) {
        let cm = 100.0 * place.amplitude();
        assert!((cm - expected).abs() < 3e-5 * expected + 0.5e-5, "{}: {cm} instead of {expected}", place.name);
    }
}

#[test]
fn theory_6_3_event_driven_references() {
    check_cm(&orbit("blade-couple", &[("Ft", 2.0)], 121.25), &[4.89246, 0.37775, 0.23742]);
    check_cm(&orbit("blade-couple", &[("Ft", 4.0)], 121.25), &[3.22744, 0.75549, 0.47484]);
    check_cm(&orbit("blade-couple", &[("Ft", 4.0)], 120.75), &[1.47944, 1.47619, 1.35928]);
    check_cm(&orbit("blade-couple", &[("Ft", 8.0)], 121.0), &[2.01529, 1.31898, 1.27630]);
    check_cm(&orbit("symmetric-couple", &[("Ft", 2.0)], 120.93), &[4.81192, 5.07765, 1.86772, 1.76857]);
}
