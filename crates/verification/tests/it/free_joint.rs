//! A joint with a slip limit of zero carries no force; it is the free reference of every
//! damper.
//!
//! Each method that takes a law must take it with this limit too, and give the motion of the
//! structure without the joint.

use std::f64::consts::TAU;
use stickslip::law::{self, SharedLaw};
use stickslip::method::{self, Method, Options};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Motion, Spring};
use stickslip::orbit::{Contact, Orbit};

/// Relative tolerance of the time integrations; harmonic balance and event-driven are far
/// below.
const NEAR: f64 = 1e-6;

/// Largest apparent loss of an elastic joint, as a fraction of the work per period. The energy
/// that its force exchanges is a thousand times that work, and orbits in equal steps are closed
/// to 1e-10.
const LOSSLESS: f64 = 1e-8;

/// Returns the laws of one direction that can be free, with their names: with the sample's
/// values, and free.
fn laws() -> Vec<(&'static str, SharedLaw, SharedLaw)> {
    let rows = law::TABLE.iter().map(|row| (row.name, row.sample()));
    rows.filter(|(_, law)| law.directions() == 1)
        .filter_map(|(name, law)| {
            Some((name, law.clone(), law.frictionless_reference().filter(|law| law.carries_no_force())?))
        })
        .collect()
}

/// Returns a mass of 1 kg on 1e4 N/m and 20 kg/s with these joints to the ground, under a force
/// of 3 N.
fn oscillator(laws: &[SharedLaw]) -> Model {
    let between = || ["m".to_owned(), GROUND.to_owned()];
    Model {
        masses: vec![Mass::new("m", 1.0)],
        springs: vec![Spring { between: between(), stiffness: 1e4, damping: 20.0 }],
        joints: laws
            .iter()
            .enumerate()
            .map(|(i, law)| Joint { name: format!("joint{i}"), between: between(), law: law.clone() })
            .collect(),
        forces: vec![Force { on: "m".into(), amplitude: 3.0, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    }
}

/// Returns the methods that take this law, with a width if they need one.
fn methods(law: SharedLaw) -> Vec<(&'static str, Box<dyn Method>)> {
    let system = oscillator(std::slice::from_ref(&law)).assemble().unwrap();
    let mut all = Vec::new();
    for row in method::TABLE {
        let widths = [Options::new(), Options::from([("width".to_owned(), 1e-5)])];
        let mut tried = widths.iter().filter_map(|options| (row.build)(options).ok());
        if let Some(method) = tried.find(|method| method.solver(&system).is_ok()) {
            all.push((row.name, method));
        }
    }
    all
}

fn orbit(method: &dyn Method, model: &Model, omega: f64) -> Orbit {
    let system = model.assemble().unwrap();
    method.solver(&system).unwrap().orbit(omega).unwrap()
}

#[test]
fn every_method_gives_the_linear_motion() {
    let mut combinations = 0;
    for (law, _, free) in laws() {
        for (name, method) in methods(free.clone()) {
            for omega in [30.0, 99.0, 250.0] {
                let orbit = orbit(&*method, &oscillator(std::slice::from_ref(&free)), omega);
                let expected = 3.0 / ((1e4 - omega * omega).powi(2) + (20.0 * omega).powi(2)).sqrt();
                let found = orbit.places[0].amplitude();
                assert!((found / expected - 1.0).abs() < NEAR, "{}, {name}, {omega}: {found} {expected}", law);
                let joint = &orbit.joints[0];
                assert_eq!(joint.dissipation, 0.0, "{}, {name}", law);
                // methods in steps sum their step lengths
                assert!((joint.slip_fraction - 1.0).abs() < 1e-12, "{}, {name}: {}", law, joint.slip_fraction);
                assert!(!orbit.is_in_continuum(), "{}, {name}", law);
                let sample = orbit.sample(0.3 * orbit.period());
                assert_eq!(sample.joints[0].force[0], 0.0, "{}, {name}", law);
                let forward = sample.joints[0].velocity[0] > 0.0;
                let contact = if forward { Contact::SlipForward } else { Contact::SlipBackward };
                assert_eq!(sample.joints[0].contact, contact, "{}, {name}", law);
            }
            combinations += 1;
        }
    }
    // at least `auto` and one other method take every law
    assert!(combinations >= 2 * laws().len(), "{combinations}");
}

/// A free joint next to a joint with a limit has no effect.
#[test]
fn beside_another_joint_it_is_not_there() {
    for (law, other, free) in laws() {
        for (name, method) in methods(other.clone()) {
            let with = orbit(&*method, &oscillator(&[free.clone(), other.clone(), free.clone()]), 95.0);
            let without = orbit(&*method, &oscillator(std::slice::from_ref(&other)), 95.0);
            let (a, b) = (with.places[0].amplitude(), without.places[0].amplitude());
            assert!((a / b - 1.0).abs() < NEAR, "{}, {name}: {a} {b}", law);
            let (a, b) = (with.joints[1].dissipation, without.joints[0].dissipation);
            assert!((a - b).abs() <= 1e2 * NEAR * b + LOSSLESS * without.energy.work_in, "{}, {name}: {a} {b}", law);
        }
    }
}

/// A free joint under an imposed motion has a loop without area.
#[test]
fn its_loop_has_no_area() {
    for (law, _, free) in laws() {
        let model = Model {
            joints: vec![Joint { name: "j".into(), between: ["mover".into(), GROUND.into()], law: free }],
            motions: vec![Motion { on: "mover".into(), amplitude: 1e-3, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        };
        let method = (method::find("auto").unwrap().build)(&Options::new()).unwrap();
        let orbit = orbit(&*method, &model, TAU);
        assert_eq!((orbit.energy.friction, orbit.joints[0].slip_fraction), (0.0, 1.0), "{}", law);
        let (low, high) = orbit.joints[0].displacement[0];
        assert!((low + 1e-3).abs() < 1e-9 && (high - 1e-3).abs() < 1e-9, "{}: {low} {high}", law);
    }
}

/// A permanently stuck joint acts as a spring for any limit. The test runs at the resonance of
/// the stuck structure, where an orbit that is not quite closed would show.
#[test]
fn a_limit_that_nothing_reaches_makes_a_spring() {
    for limit in [1e3, 1e6, 1e12] {
        let law: SharedLaw = std::sync::Arc::new(law::Jenkins { stiffness: 5e3, limit });
        let system = oscillator(std::slice::from_ref(&law)).assemble().unwrap();
        let omega = (1.5e4f64).sqrt();
        // `F/(c Ω)` where `k + kt = m Ω²`
        let expected = 3.0 / (20.0 * omega);
        // a smoothed slider creeps
        for (name, method) in methods(law).into_iter().filter(|(name, _)| *name != "shooting") {
            let orbit = method.solver(&system).unwrap().orbit(omega).unwrap();
            let ratio = orbit.places[0].amplitude() / expected - 1.0;
            assert!(ratio.abs() < NEAR, "{name} with {limit:e} N: {ratio:e}");
        }
    }
}
