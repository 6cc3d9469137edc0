//! Branches of harmonic balance by arc length.

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use stickslip::curve::continuation::BranchContinuation;
use stickslip::curve::performance::Performance;
use stickslip::curve::sweep::Watch;
use stickslip::law::{Coulomb, Jenkins};
use stickslip::method::{Method, event_driven::EventDriven, harmonic_balance::HarmonicBalance};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring};
use stickslip::orbit::Orbit;
use stickslip_numerics::continuation::BranchEnd;
use stickslip_study::templates;

fn balance(harmonics: usize) -> HarmonicBalance {
    HarmonicBalance { harmonics: Some(harmonics), ..HarmonicBalance::default() }
}

/// A branch along frequency with onset of slip covers the whole range. Its peak agrees with the
/// maximum over frequency.
#[test]
fn along_frequency_to_the_peak() {
    for (template, harmonics) in [("blade-couple-massless", 9), ("blade-couple", 3)] {
        for limit in [2.0, 4.0, 6.0] {
            let couple = templates::find(template).unwrap();
            let system = couple.model_with(&[("Ft", limit)]).unwrap().assemble().unwrap();
            let branch = BranchContinuation {
                system_at: &|omega| (system.clone(), omega),
                method: balance(harmonics),
                range: (TAU * 119.5, TAU * 122.5),
                step: TAU * 0.1,
                quantity: &|orbit: &Orbit| orbit.places[0].amplitude(),
            }
            .branch()
            .unwrap();
            assert_eq!(branch.end, BranchEnd::Border, "{template} {limit} N after {} points", branch.points.len());
            assert!(branch.turns.is_empty(), "a response with friction and damping is unique");
            let method = balance(harmonics);
            let performance = Performance {
                system: &|limit| couple.model_with(&[("Ft", limit)]).unwrap().assemble(),
                method: &method,
                range: (TAU * 119.5, TAU * 122.5),
                points: 61,
                quantities: &|orbit: &Orbit| vec![orbit.places[0].amplitude()],
                watch: Watch::none(),
            };
            let peak = performance.peak(limit).unwrap().peak.unwrap();
            let highest = branch.peaks.iter().map(|p| p.1).fold(0.0, f64::max);
            assert!((highest / peak.value - 1.0).abs() < 1e-7, "{template} {limit} N: {highest} {peak:?}");
        }
    }
}

/// Figs. 6, 7 and 10 by continuation: rigid friction with a contact mass, whole curves for all
/// four slip limits. The branch has no turning point, and its points agree with single
/// solutions.
#[test]
fn figures_6_7_and_10_by_continuation() {
    let cases: [(&str, &[(&str, f64)]); 3] =
        [("blade-couple", &[]), ("blade-couple", &[("m1", 0.00091)]), ("symmetric-couple", &[])];
    for (template, changes) in cases {
        for limit in [2.0, 4.0, 6.0, 8.0] {
            let mut all = changes.to_vec();
            all.push(("Ft", limit));
            let system = templates::find(template).unwrap().model_with(&all).unwrap().assemble().unwrap();
            for harmonics in [3, 9] {
                let method = balance(harmonics);
                let branch = BranchContinuation {
                    system_at: &|omega| (system.clone(), omega),
                    method,
                    range: (TAU * 119.5, TAU * 122.5),
                    step: TAU * 0.05,
                    quantity: &|orbit: &Orbit| orbit.places[0].amplitude(),
                }
                .branch()
                .unwrap();
                assert_eq!(
                    branch.end,
                    BranchEnd::Border,
                    "{template} {all:?} H = {harmonics}: {} points",
                    branch.points.len()
                );
                // a dissipative structure with a constant friction limit has one periodic
                // motion per frequency
                assert!(branch.turns.is_empty());
                // the corrector may move as far as the step
                assert!(branch.points.windows(2).all(|pair| pair[1].value - pair[0].value < TAU * 0.1));
                let mut solver = method.solver(&system).unwrap();
                for point in branch.points.iter().step_by(20) {
                    let alone = solver.orbit(point.value).unwrap();
                    let (a, b) = (alone.places[0].amplitude(), point.orbit.places[0].amplitude());
                    assert!((a / b - 1.0).abs() < 1e-9, "{template} {all:?} H = {harmonics}, {}: {a} {b}", point.value);
                }
            }
        }
    }
}

/// A branch along the force on an oscillator with negative damping; friction stabilizes small
/// motions, not large ones. The branch turns at the largest force with a bounded motion. All
/// points satisfy the closed form of one harmonic, (2.4).
#[test]
fn along_a_force_around_a_turning_point() {
    let (kt, omega, damping) = (0.2, 1.0488, -0.03);
    let model = |force: f64| Model {
        masses: vec![Mass::new("m", 1.0)],
        springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: 1.0, damping }],
        joints: vec![Joint {
            name: "damper".into(),
            between: ["m".into(), GROUND.into()],
            law: Arc::new(Jenkins { stiffness: kt, limit: 1.0 }),
        }],
        forces: vec![Force { on: "m".into(), amplitude: force, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    };
    let branch = BranchContinuation {
        system_at: &|force| (model(force).assemble().unwrap(), omega),
        method: HarmonicBalance { harmonics: Some(1), samples: Some(4096), tolerance: None },
        range: (0.05, 2.0),
        step: 0.02,
        quantity: &|orbit: &Orbit| orbit.places[0].amplitude(),
    }
    .branch()
    .unwrap();
    assert!(!branch.turns.is_empty(), "{:?} {:?}", branch.end, branch.points.len());
    assert_eq!(branch.end, BranchEnd::Border);
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

/// Rigid friction on an oscillator with negative damping, along the force.
///
/// The branch begins in slip without stops, up to the smallest force with such a motion. It
/// turns back through unstable motions, and turns again at the onset of large slip, down into
/// stick. The exact method checks it, with the points of the branch as warm starts.
#[test]
fn rigid_friction_around_two_turning_points() {
    let omega = 1.1f64.sqrt();
    let system = |force: f64| {
        let model = Model {
            masses: vec![Mass::new("m", 1.0)],
            springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: 1.0, damping: -0.03 }],
            joints: vec![Joint {
                name: "contact".into(),
                between: ["m".into(), GROUND.into()],
                law: Arc::new(Coulomb { limit: 1.0 }),
            }],
            forces: vec![Force { on: "m".into(), amplitude: force, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        };
        model.assemble().unwrap()
    };
    let branch = BranchContinuation {
        system_at: &|force| (system(force), omega),
        method: balance(31),
        range: (2.0, 0.5),
        step: 0.02,
        quantity: &|orbit: &Orbit| orbit.places[0].amplitude(),
    }
    .branch()
    .unwrap();
    assert_eq!((branch.end, branch.turns.len()), (BranchEnd::Border, 2));
    // for one harmonic the first turn is at `F² = ((1 - ω²) a)² + (4/π - 0.03 ω a)²`, minimized
    // over a
    let first = |a: f64| (0.1 * a).hypot(4.0 / PI - 0.03 * omega * a);
    let lowest = (0..1000).map(|i| first(0.01 * f64::from(i))).fold(f64::INFINITY, f64::min);
    let turn = branch.points[branch.turns[0]].value;
    assert!((turn / lowest - 1.0).abs() < 0.05, "{turn} {lowest}");
    let (mut judged, mut failed) = (0, 0);
    for (i, point) in branch.points.iter().enumerate() {
        let a = point.orbit.places[0].amplitude();
        let between = i > branch.turns[0] && i < branch.turns[1];
        let beside = branch.turns.iter().any(|turn| i.abs_diff(*turn) < 3);
        assert!(beside || point.orbit.is_stable() == Some(!between), "{i} {} {a}", point.value);
        if point.value < 1.0 {
            assert!(a < 1e-9, "{} {a}", point.value);
            continue;
        }
        // near the turns one force has several amplitudes, and the exact method may find the
        // other branch
        if a < 1e-3 || branch.turns.iter().any(|turn| (branch.points[*turn].value - point.value).abs() < 5e-3) {
            continue;
        }
        judged += 1;
        let Ok(exact) = EventDriven.solver(&system(point.value)).unwrap().orbit_near(omega, Some(&point.orbit.seed()))
        else {
            failed += 1;
            continue;
        };
        // the branch is flat between the turns: the force there differs by less than 1 %
        let bound = if point.value > 1.3 { 0.01 } else { 0.15 };
        assert!(
            (a / exact.places[0].amplitude() - 1.0).abs() < bound,
            "{i} {} {a} {}",
            point.value,
            exact.places[0].amplitude()
        );
    }
    assert!(judged > 300 && failed == 0, "{failed} of {judged}");
}
