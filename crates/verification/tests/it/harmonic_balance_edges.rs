//! Difficult cases of harmonic balance: orbits that it must find, and systems that it must
//! refuse.

use nalgebra::DMatrix;
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::{Coulomb, Coulomb2d, CoulombArctan, Gap, Jenkins, Jenkins2d, JenkinsArctan, SharedLaw, Stribeck};
use stickslip::method::shooting::Shooting;
use stickslip::method::{Method, event_driven::EventDriven, harmonic_balance::HarmonicBalance};
use stickslip::model::{Axis, Force, GROUND, Joint, Mass, Model, Motion, Spring, System, example};
use stickslip::orbit::{Accuracy, Orbit};
use stickslip::structure::Structure;
use stickslip_verification::random_system;

fn mass(name: &str, mass: f64) -> Mass {
    Mass::new(name, mass)
}

fn spring(a: &str, b: &str, stiffness: f64, damping: f64) -> Spring {
    Spring { between: [a.into(), b.into()], stiffness, damping }
}

fn joint(a: &str, b: &str, law: SharedLaw) -> Joint {
    Joint { name: "joint".into(), between: [a.into(), b.into()], law }
}

fn force(on: &str, amplitude: f64, harmonic: u32) -> Force {
    Force { on: on.into(), amplitude, phase: 0.0, harmonic }
}

fn orbit(method: &dyn Method, system: &System, omega: f64) -> Orbit {
    method.solver(system).unwrap().orbit(omega).unwrap()
}

/// Asserts that the amplitudes of both methods agree within three times the reported error, and
/// that this error is within the tolerance.
fn agrees(model: &Model, omega: f64) {
    let system = model.assemble().unwrap();
    let (found, exact) = (orbit(&HarmonicBalance::default(), &system, omega), orbit(&EventDriven, &system, omega));
    let estimate = found.evidence.error_estimate.unwrap();
    assert_eq!(found.evidence.accuracy, Accuracy::Converged);
    let largest = exact.places.iter().map(|place| place.amplitude()).fold(0.0, f64::max);
    for (a, b) in found.places.iter().zip(&exact.places) {
        let error = (a.amplitude() - b.amplitude()).abs() / largest;
        assert!(error < 3.0 * estimate + 1e-9, "{a:?} {b:?}, estimate {estimate:.1e}");
    }
}

/// Permanently stuck contacts with limits up to 1e100. A body stuck to the ground supports a
/// driven body through a spring. The amplitude is `F/|k + c - m ω² + i b ω|`. The test covers
/// smooth and falling friction too.
#[test]
fn permanently_stuck_contacts_are_springs() {
    let (stiffness, coupling, omega) = (100.0, 40.0, 7.0);
    let expected = 1.0 / f64::hypot(stiffness + coupling - 2.0 * omega * omega, 0.3 * omega);
    for exponent in [3, 9, 15, 20, 100] {
        let limit = 10f64.powi(exponent);
        let laws: [SharedLaw; 3] = [
            Arc::new(Coulomb { limit }),
            Arc::new(Stribeck { limit, static_limit: limit, velocity: 1.0 }),
            Arc::new(CoulombArctan { limit, alpha: 1e9 }),
        ];
        for law in laws {
            let named = format!("{law:?}");
            let model = Model {
                masses: vec![mass("a", 2.0), mass("b", 1.0)],
                springs: vec![spring("a", GROUND, stiffness, 0.3), spring("a", "b", coupling, 0.0)],
                joints: vec![joint("b", GROUND, law)],
                forces: vec![force("a", 1.0, 1)],
                ..Model::default()
            };
            let system = model.assemble().unwrap();
            for harmonics in [None, Some(1), Some(15)] {
                let method = HarmonicBalance { harmonics, ..HarmonicBalance::default() };
                let orbit = method.solver(&system).unwrap().orbit(omega);
                let found =
                    orbit.unwrap_or_else(|error| panic!("{named}, {harmonics:?}: {error}")).places[0].amplitude();
                assert!((found / expected - 1.0).abs() < 1e-6, "{named}, {harmonics:?}: {found} instead of {expected}");
            }
        }
    }
}

/// A permanently stuck contact behaves the same for constant friction and for friction that
/// falls steeply with velocity.
#[test]
fn friction_that_falls_holds_too() {
    let couple = |law: SharedLaw| {
        let mut model = example::blade_couple();
        model.joints[0].law = law;
        model.assemble().unwrap()
    };
    let exact = couple(Arc::new(Coulomb { limit: 100.0 }));
    for velocity in [1e-3, 1e-2, 0.1] {
        let falling = couple(Arc::new(Stribeck { limit: 100.0, static_limit: 120.0, velocity }));
        let method = HarmonicBalance { harmonics: Some(7), ..HarmonicBalance::default() };
        for hertz in [119.5, 120.5, 121.5] {
            let (found, expected) = (orbit(&method, &falling, TAU * hertz), orbit(&EventDriven, &exact, TAU * hertz));
            for (a, b) in found.places.iter().zip(&expected.places) {
                assert!((a.amplitude() / b.amplitude() - 1.0).abs() < 1e-9, "{velocity} m/s, {hertz} Hz: {a:?} {b:?}");
            }
        }
    }
}

/// Excitation of the sixth harmonic alone: the motion has multiples of six, and refinement
/// doubles these.
#[test]
fn excitation_without_a_fundamental() {
    let law = Arc::new(Jenkins { stiffness: 0.5, limit: 0.15 });
    let model = Model {
        masses: vec![mass("a", 1.0), mass("tip", 0.01)],
        springs: vec![spring("a", GROUND, 1.0, 0.01), spring("a", "tip", 0.09, 0.0)],
        joints: vec![joint("tip", GROUND, law)],
        forces: vec![force("a", 0.3, 6)],
        ..Model::default()
    };
    for omega in [0.175, 0.18, 0.19] {
        agrees(&model, omega);
    }
    // a motion without the excitation frequency has no phase relative to it
    let system = model.assemble().unwrap();
    for method in [&EventDriven as &dyn Method, &HarmonicBalance::default()] {
        let found = orbit(method, &system, 0.18);
        assert!(found.places.iter().all(|place| place.amplitude() > 0.0 && place.phase_deg().is_nan()), "{found:?}");
    }
}

/// A light part resonates at the seventeenth harmonic, above the first comparison of 7 with
/// 15 harmonics.
#[test]
fn a_resonance_above_the_series() {
    let model = Model {
        masses: vec![mass("body", 1.0), mass("tail", 0.001)],
        springs: vec![spring("body", GROUND, 0.1, 0.01), spring("body", "tail", 0.288_711, 1.7e-7)],
        joints: vec![joint("body", GROUND, Arc::new(Jenkins { stiffness: 5.0, limit: 0.5 }))],
        forces: vec![force("body", 1.0, 1)],
        ..Model::default()
    };
    agrees(&model, 1.0);
}

/// The highest harmonic meets an undamped resonance. The series still resolves the force of the
/// contact.
#[test]
fn a_resonance_at_the_highest_harmonic() {
    let model = Model {
        masses: vec![mass("a", 1.0)],
        springs: vec![spring("a", GROUND, 225.0, 0.0)],
        joints: vec![joint("a", GROUND, Arc::new(Coulomb { limit: 0.1 }))],
        forces: vec![force("a", 1.0, 1)],
        ..Model::default()
    };
    let system = model.assemble().unwrap();
    for omega in [1.0, 1.0001] {
        let method = HarmonicBalance { harmonics: Some(15), ..HarmonicBalance::default() };
        let (found, exact) = (orbit(&method, &system, omega), orbit(&EventDriven, &system, omega));
        let error = (found.places[0].amplitude() / exact.places[0].amplitude() - 1.0).abs();
        assert!(error < 3.0 * found.evidence.error_estimate.unwrap(), "{error:.1e} {:?}", found.evidence);
    }
}

/// A free body drifts under a mean force above the friction, and stays under a smaller one.
#[test]
fn a_free_body_drifts_or_sticks() {
    let model = |limit: f64| Model {
        masses: vec![mass("body", 1.0)],
        joints: vec![joint("body", GROUND, Arc::new(Coulomb { limit }))],
        forces: vec![force("body", 5.0, 1), force("body", 1.0, 0)],
        ..Model::default()
    };
    let drifting = model(3.0).assemble().unwrap();
    let error = HarmonicBalance::default().solver(&drifting).unwrap().orbit(1.0).unwrap_err();
    assert_eq!(error.status(), "drifts");
    let held = orbit(&HarmonicBalance::default(), &model(30.0).assemble().unwrap(), 1.0);
    assert!(held.places[0].amplitude() < 1e-9 && held.evidence.stuck == ["joint"], "{held:?}");
}

/// A slider is the only support of a body, and nothing excites the body. A constant force above
/// the limit drags the body away; a smaller force only bends the spring.
#[test]
fn a_constant_force_beyond_the_limit_is_not_held() {
    let model = |push: f64| Model {
        masses: vec![mass("blade", 5.0), mass("shoe", 2.0)],
        springs: vec![spring("blade", GROUND, 177e3, 2.0)],
        joints: vec![joint("shoe", GROUND, Arc::new(Jenkins { stiffness: 45e3, limit: 6.0 }))],
        forces: vec![force("blade", 400.0, 1), force("shoe", push, 0)],
        ..Model::default()
    };
    for method in [&HarmonicBalance::default() as &dyn Method, &EventDriven] {
        for push in [36.0, -6.01] {
            let system = model(push).assemble().unwrap();
            let error = method.solver(&system).unwrap().orbit(TAU * 5.0).unwrap_err();
            assert!(["drifts", "not-settled"].contains(&error.status()), "{error}");
        }
        let held = orbit(method, &model(5.9).assemble().unwrap(), TAU * 5.0);
        assert!((held.places[1].mean / (5.9 / 45e3) - 1.0).abs() < 1e-9, "{}: {:?}", method.name(), held.places[1]);
    }
}

/// Near the stability limit the multipliers are those of the time integration's own orbit. An
/// error of 4e-4 of the series moved a pair of modulus 1.0047 inside the unit circle.
/// Multipliers of the series have an error of a few return defects.
#[test]
fn a_series_beside_the_limit_of_stability_knows_its_side() {
    let stop = |name: &str, a: &str, b: &str, gap, stiffness| Joint {
        name: name.into(),
        between: [a.into(), b.into()],
        law: Arc::new(Gap { gap, stiffness }),
    };
    let model = Model {
        masses: vec![mass("a", 1441.0), mass("b", 1257.0), mass("c", 869.0)],
        springs: vec![
            spring("a", GROUND, 2.252e6, 1791.0),
            spring("b", GROUND, 4.412e6, 179.1),
            spring("b", "a", 5.225e5, 179.1),
            spring("c", GROUND, 5.761e6, 179.1),
            spring("c", "b", 4.973e5, 1791.0),
        ],
        joints: vec![stop("pressed", "c", "a", -1.546e-4, 3.3e7), stop("open", "a", "c", 0.0, 4.28e6)],
        forces: vec![Force { phase: -127f64.to_radians(), ..force("a", 1095.0, 1) }],
        ..Model::default()
    };
    let system = model.assemble().unwrap();
    let (found, exact) = (orbit(&HarmonicBalance::default(), &system, 50.52), orbit(&EventDriven, &system, 50.52));
    let (largest, its) = (exact.multipliers().unwrap()[0].norm(), found.multipliers().unwrap()[0].norm());
    let defect = found.evidence.return_defect.unwrap();
    assert!(largest > 1.004 && its > 1.004 && (its - largest).abs() < 10.0 * defect, "{its} {largest} {defect}");
}

/// Rigid and elastic friction in a plane under a force along one direction equal friction along
/// that direction. The series is as long as rigid friction requires, and the law with memory
/// gets enough samples for it.
#[test]
fn rigid_and_elastic_friction_in_a_plane_have_their_long_series() {
    let (mass, damping, stiffness) = (679.4, 97.44, [743_700.0, 1_931_000.0]);
    let (elastic, limit, rigid, drive, omega) = (1_842_000.0, 521.0, 11.69, 18.95, 203.3);
    let structure = |stiffness: &[f64]| {
        let n = stiffness.len();
        let names = (0..n).map(|i| i.to_string()).collect();
        let diagonal =
            |value: &dyn Fn(usize) -> f64| DMatrix::from_fn(n, n, |i, k| if i == k { value(i) } else { 0.0 });
        Structure::new(names, diagonal(&|_| mass), diagonal(&|_| damping), diagonal(&|i| stiffness[i])).unwrap()
    };
    let axes = |n: usize| (0..n).map(|row| Axis::new(vec![(row, 1.0)])).collect::<Vec<_>>();
    let system = |stiffness: &[f64], laws: [SharedLaw; 2]| {
        let (n, [first, second]) = (stiffness.len(), laws);
        let builder =
            System::builder(structure(stiffness)).joint("elastic", first, axes(n)).joint("rigid", second, axes(n));
        builder.force(n - 1, 1, Complex64::new(drive, 0.0)).build().unwrap()
    };
    let plane: [SharedLaw; 2] =
        [Arc::new(Jenkins2d { stiffness: elastic, limit }), Arc::new(Coulomb2d { limit: rigid })];
    let line: [SharedLaw; 2] = [Arc::new(Jenkins { stiffness: elastic, limit }), Arc::new(Coulomb { limit: rigid })];
    let found = orbit(&HarmonicBalance::default(), &system(&stiffness, plane), omega);
    let exact = orbit(&EventDriven, &system(&stiffness[1..], line), omega);
    let error = (found.places[1].amplitude() / exact.places[0].amplitude() - 1.0).abs();
    assert_eq!(found.evidence.accuracy, Accuracy::Converged);
    assert!(error < 2e-3 && error < 3.0 * found.evidence.error_estimate.unwrap(), "{error:.1e} {:?}", found.evidence);
}

/// Without excitation the orbit is at rest.
#[test]
fn no_excitation_is_rest() {
    for law in [Arc::new(Jenkins { stiffness: 2.0, limit: 0.5 }) as SharedLaw, Arc::new(Coulomb { limit: 0.5 })] {
        let model = Model {
            masses: vec![mass("a", 1.0)],
            springs: vec![spring("a", GROUND, 1.0, 0.05)],
            joints: vec![joint("a", GROUND, law)],
            ..Model::default()
        };
        let found = orbit(&HarmonicBalance::default(), &model.assemble().unwrap(), 0.9);
        assert_eq!(found.places[0].amplitude(), 0.0);
    }
}

/// An even harmonic moves a place without mass. Its work is the loss of the spring's damper, π
/// c h Ω a².
#[test]
fn a_moved_place_without_a_mass() {
    let motion = |on: &str, harmonic| Motion { on: on.into(), amplitude: 1.0, phase: 0.0, harmonic };
    let model = Model {
        masses: vec![mass("a", 1.0)],
        springs: vec![spring("mover", GROUND, 1.0, 0.1), spring("a", "other", 3.0, 0.1)],
        joints: vec![joint("a", GROUND, Arc::new(Jenkins { stiffness: 1.0, limit: 1.0 }))],
        motions: vec![motion("mover", 2), motion("other", 1)],
        ..Model::default()
    };
    let system = model.assemble().unwrap();
    let (found, exact) = (orbit(&HarmonicBalance::default(), &system, 1.0), orbit(&EventDriven, &system, 1.0));
    assert!((found.energy.viscous / exact.energy.viscous - 1.0).abs() < 1e-3, "{:?} {:?}", found.energy, exact.energy);
    assert!(found.energy.viscous > TAU / 2.0 * 0.1 * 2.0);
}

/// The multipliers of an element with an inner slider do not depend on the phase of the force,
/// and agree with shooting.
#[test]
fn multipliers_of_an_inner_slider() {
    let law = Arc::new(JenkinsArctan { stiffness: 1.0, limit: 1.0, alpha: 3.0 });
    for phase in [0.0, 1.2] {
        let model = Model {
            masses: vec![mass("body", 1.0)],
            springs: vec![spring("body", GROUND, 1.0, 0.02)],
            joints: vec![joint("body", GROUND, law.clone())],
            forces: vec![Force { phase, ..force("body", 1.0, 1) }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let (found, judge) =
            (orbit(&HarmonicBalance::default(), &system, 1.3), orbit(&Shooting::default(), &system, 1.3));
        for (a, b) in found.multipliers().unwrap().iter().zip(judge.multipliers().unwrap()) {
            // the series is within 1e-3 of the motion
            assert!((a.norm() - b.norm()).abs() < 1e-3, "{phase}: {a} {b}");
        }
    }
}

/// Several forms of the same rigid friction: parallel contacts that share its limit, and plane
/// friction with motion along one line. The distribution of the force in stick is undetermined;
/// the motion is that of one contact.
#[test]
fn friction_that_is_shared_is_that_of_one_contact() {
    let (limit, omega) = (3.068, 50.137);
    let along = |weight: f64| Axis::new(vec![(0, weight)]);
    let one: Vec<(SharedLaw, Vec<Axis>)> = vec![(Arc::new(Coulomb { limit }), vec![along(1.0)])];
    let parts = [0.23, 0.4, 0.37].map(|share| Arc::new(Coulomb { limit: share * limit }) as SharedLaw);
    let parallel = parts.into_iter().map(|law| (law, vec![along(1.0)])).collect();
    let line = vec![(Arc::new(Coulomb2d { limit }) as SharedLaw, vec![along(0.6), along(0.8)])];
    let same = 0.5f64.sqrt();
    let twice = vec![(Arc::new(Coulomb2d { limit }) as SharedLaw, vec![along(same), along(same)])];
    let amplitude = |joints: Vec<(SharedLaw, Vec<Axis>)>, force: f64| {
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        let structure = Structure::new(vec!["p".to_owned()], one(0.9), one(20.0), one(1.7e4)).unwrap();
        let mut builder = System::builder(structure).force(0, 1, Complex64::new(force, 0.0));
        for (j, (law, axes)) in joints.into_iter().enumerate() {
            builder = builder.joint(format!("j{j}"), law, axes);
        }
        let system = builder.build().unwrap();
        let method = HarmonicBalance { harmonics: Some(63), ..HarmonicBalance::default() };
        let orbit = method.solver(&system).unwrap().orbit(omega).unwrap();
        assert!(orbit.evidence.residual <= 1e-6, "{}", orbit.evidence.residual);
        (orbit.places[0].amplitude(), orbit.evidence.error_estimate.unwrap())
    };
    // mostly in stick, and mostly in slip
    for force in [5.0, 12.0] {
        let (expected, error) = amplitude(one.clone(), force);
        for (what, joints) in [("parallel", &parallel), ("line", &line), ("twice", &twice)] {
            let (found, own) = amplitude(Vec::clone(joints), force);
            assert!(
                (found / expected - 1.0).abs() < error + own,
                "{force} N, {what}: {found} {expected} {error} {own}"
            );
        }
    }
}

/// A spring stiffens a thousandfold over the motion, and Newton's method fails from the linear
/// motion. An integration in time from rest leads to the orbit, which agrees with shooting.
#[test]
fn time_leads_to_orbits_that_newton_misses() {
    let (system, omega) = random_system(987);
    let [balance, shooting]: [&dyn Method; 2] = [&HarmonicBalance::default(), &Shooting::default()];
    let (found, expected) = (orbit(balance, &system, omega), orbit(shooting, &system, omega));
    for (a, b) in found.places.iter().zip(&expected.places) {
        assert!((a.amplitude() / b.amplitude() - 1.0).abs() < 1e-5, "{} {}", a.amplitude(), b.amplitude());
    }
}
