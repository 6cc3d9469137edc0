//! Branches of harmonic balance by arc length.

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use stickslip::curve::performance::Performance;
use stickslip::curve::trace::Trace;
use stickslip::law::{Jenkins, Law};
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring, templates};
use stickslip::orbit::Orbit;
use stickslip_numerics::continuation::End;

fn balance(harmonics: usize) -> HarmonicBalance {
    HarmonicBalance { harmonics: Some(harmonics), ..HarmonicBalance::default() }
}

/// Along frequency, with onset of slip on the way: the whole range, and the peak that maximising over frequency finds.
#[test]
fn along_frequency_to_the_peak() {
    for (template, harmonics) in [("blade-couple-massless", 9), ("blade-couple", 3)] {
        for limit in [2.0, 4.0, 6.0] {
            let couple = templates::find(template).unwrap();
            let system = couple.model_with(&[("Ft", limit)]).unwrap().assemble().unwrap();
            let branch = Trace {
                at: &|omega| (system.clone(), omega),
                method: balance(harmonics),
                range: (TAU * 119.5, TAU * 122.5),
                step: TAU * 0.1,
                quantity: &|orbit: &Orbit| orbit.places[0].amplitude(),
            }
            .branch()
            .unwrap();
            assert_eq!(branch.end, End::Border, "{template} {limit} N after {} points", branch.points.len());
            assert!(branch.turns.is_empty(), "a response with friction and damping is unique");
            let method = balance(harmonics);
            let performance = Performance {
                system: &|limit| couple.model_with(&[("Ft", limit)]).unwrap().assemble(),
                method: &method,
                range: (TAU * 119.5, TAU * 122.5),
                points: 61,
                quantity: &|orbit: &Orbit| orbit.places[0].amplitude(),
            };
            let peak = performance.peak(limit).unwrap().peak.unwrap();
            let highest = branch.peaks.iter().map(|p| p.1).fold(0.0, f64::max);
            assert!((highest / peak.value - 1.0).abs() < 1e-7, "{template} {limit} N: {highest} {peak:?}");
        }
    }
}

/// Along the force on an oscillator with negative damping, where friction holds small motions and lets large ones go: the branch turns
/// back at the force beyond which no bounded motion exists. All points satisfy the closed form of one harmonic, (2.4).
#[test]
fn along_a_force_around_a_turning_point() {
    let (kt, omega, damping) = (0.2, 1.0488, -0.03);
    let model = |force: f64| Model {
        masses: vec![Mass { name: "m".into(), mass: 1.0 }],
        springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: 1.0, damping }],
        joints: vec![Joint {
            name: "damper".into(),
            between: ["m".into(), GROUND.into()],
            law: Law::Jenkins(Jenkins { stiffness: kt, limit: 1.0 }),
        }],
        forces: vec![Force { on: "m".into(), amplitude: force, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    };
    let branch = Trace {
        at: &|force| (model(force).assemble().unwrap(), omega),
        method: HarmonicBalance { harmonics: Some(1), samples: Some(4096), tolerance: None },
        range: (0.05, 2.0),
        step: 0.02,
        quantity: &|orbit: &Orbit| orbit.places[0].amplitude(),
    }
    .branch()
    .unwrap();
    assert!(!branch.turns.is_empty(), "{:?} {:?}", branch.end, branch.points.len());
    assert_eq!(branch.end, End::Border);
    for point in &branch.points {
        let a = point.orbit.places[0].amplitude();
        let stiffness = if a <= 1.0 / kt {
            Complex64::new(kt, 0.0)
        } else {
            let slip = (1.0f64 - 2.0 / (kt * a)).acos();
            kt / PI * Complex64::new(slip - 0.5 * (2.0 * slip).sin(), slip.sin().powi(2))
        };
        let force = (Complex64::new(1.0 - omega * omega, damping * omega) + stiffness).norm() * a;
        assert!((force - point.value).abs() < 1e-7, "amplitude {a}: {force} instead of {}", point.value);
    }
}
