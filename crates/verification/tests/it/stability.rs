//! Stability: the theorem against computed multipliers, systems that it does not cover, and
//! difficult eigenvalue problems.

#![allow(clippy::print_stdout)] // tests print measured values

use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::{Coulomb, CoulombArctan, Gap, Jenkins, JenkinsArctan, SharedLaw};
use stickslip::method::event_driven::EventDriven;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::shooting::Shooting;
use stickslip::method::{Method, OrbitError};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring, System};
use stickslip::orbit::{Orbit, Stability};
use stickslip::structure::StructureError;
use stickslip_verification::Random;
use stickslip_verification::with_mass;

fn mass(name: &str, mass: f64) -> Mass {
    Mass::new(name, mass)
}

fn spring(a: &str, b: &str, stiffness: f64, damping: f64) -> Spring {
    Spring { between: [a.into(), b.into()], stiffness, damping }
}

fn joint(name: &str, a: &str, b: &str, law: SharedLaw) -> Joint {
    Joint { name: name.into(), between: [a.into(), b.into()], law }
}

fn force(on: &str, amplitude: f64, phase: f64) -> Force {
    Force { on: on.into(), amplitude, phase, harmonic: 1 }
}

fn find(method: &dyn Method, system: &System, omega: f64) -> Result<Orbit, OrbitError> {
    method.solver(system).unwrap().orbit(omega)
}

fn series(harmonics: usize) -> HarmonicBalance {
    HarmonicBalance { harmonics: Some(harmonics), ..HarmonicBalance::default() }
}

/// Returns one mass on ten parallel sliders that slip one after the other.
fn ten_sliders() -> System {
    Model {
        masses: vec![mass("m", 1.0)],
        springs: vec![spring("m", GROUND, 1e4, 2.0)],
        joints: (1..=10)
            .map(|i| {
                let law = Arc::new(Jenkins { stiffness: 200.0, limit: 0.04 * f64::from(i) });
                joint(&format!("j{i}"), "m", GROUND, law)
            })
            .collect(),
        forces: vec![force("m", 2.0, 0.0)],
        ..Model::default()
    }
    .assemble()
    .unwrap()
}

/// Returns a ring of blades with a joint from each to the next; `mistuning` is relative,
/// `damping` in N s/m.
fn ring(count: usize, drive: f64, mistuning: f64, damping: f64) -> System {
    let mut random = Random::new(5);
    let name = |i: usize| format!("b{}", i % count);
    Model {
        masses: (0..count).map(|i| mass(&name(i), 0.2)).collect(),
        springs: (0..count)
            .map(|i| spring(&name(i), GROUND, 105e3 * (1.0 + random.between(-mistuning, mistuning)), damping))
            .collect(),
        joints: (0..count)
            .map(|i| {
                let law = Arc::new(Jenkins { stiffness: 1e4, limit: 2.0 });
                joint(&format!("j{i}"), &name(i), &name(i + 1), law)
            })
            .collect(),
        forces: (0..count).map(|i| force(&name(i), drive, -3.0 * TAU * i as f64 / count as f64)).collect(),
        ..Model::default()
    }
    .assemble()
    .unwrap()
}

/// The eigenvalue iteration ends for return maps of many sliders, which are nilpotent in large
/// parts.
#[test]
fn eigenvalues_of_nilpotent_return_maps_converge() {
    for (what, system, hertz) in
        [("ten sliders", ten_sliders(), 14.35), ("ring that sticks", ring(12, 0.01, 0.0, 0.5), 116.0)]
    {
        for method in [&EventDriven as &dyn Method, &series(15)] {
            let orbit = find(method, &system, TAU * hertz).unwrap();
            let found = orbit.multipliers().unwrap();
            assert_eq!(orbit.stability(), Stability::Proven);
            assert_eq!(found.len(), 2 * system.dofs() + system.joints().len());
            assert!(found[0].norm() <= 1.0 + 1e-6, "{what}: {}", found[0]);
        }
    }
}

/// The theorem applies to a series of a system that is too large for a return map.
#[test]
fn large_systems_are_stable_by_theorem() {
    let orbit = find(&series(3), &ring(36, 1.0, 0.01, 0.5), TAU * 115.0).unwrap();
    assert_eq!((orbit.stability(), orbit.is_stable()), (Stability::Proven, Some(true)));
    let orbit = find(&series(3), &ring(36, 1.0, 0.01, -1e-3), TAU * 100.0).unwrap();
    assert_eq!((orbit.stability(), orbit.is_stable()), (Stability::Unknown, None));
}

fn random_law(random: &mut Random, smooth: bool) -> SharedLaw {
    let (limit, stiffness, alpha) = (random.between(0.1, 2.0), random.between(0.5, 5.0), random.between(2.0, 50.0));
    match (smooth, random.unit() < 0.5) {
        (false, false) => Arc::new(Coulomb { limit }),
        (false, true) => Arc::new(Jenkins { stiffness, limit }),
        (true, false) => Arc::new(CoulombArctan { limit, alpha }),
        (true, true) => Arc::new(JenkinsArctan { stiffness, limit, alpha }),
    }
}

/// Returns up to four masses with random joints. Damping is positive or zero.
fn random_system(seed: u64, smooth: bool) -> System {
    let mut random = Random::new(seed);
    let count = 1 + (random.unit() * 4.0) as usize;
    let name = |i: usize| format!("m{i}");
    let damper = |random: &mut Random| if random.unit() < 0.3 { 0.0 } else { random.between(0.01, 0.3) };
    let mut model = Model::default();
    for i in 0..count {
        model.masses.push(mass(&name(i), random.between(0.3, 2.0)));
        let (k, c) = (random.between(0.5, 3.0), damper(&mut random));
        model.springs.push(spring(&name(i), GROUND, k, c));
        let other = if i == 0 { GROUND.to_owned() } else { name(i - 1) };
        if i > 0 {
            let (k, c) = (random.between(0.1, 3.0), damper(&mut random));
            model.springs.push(spring(&name(i), &other, k, c));
        }
        if i == 0 || random.unit() < 0.6 {
            model.joints.push(joint(&format!("j{i}"), &name(i), &other, random_law(&mut random, smooth)));
        }
        model.forces.push(force(&name(i), random.between(0.2, 3.0), random.between(0.0, TAU)));
    }
    model.assemble().unwrap()
}

/// If the theorem proves stability, no multiplier of the orbit is outside the unit circle.
#[test]
fn theorem_against_multipliers() {
    let (mut compared, mut largest) = (0, 0.0f64);
    for seed in 0..60 {
        let smooth = seed % 4 == 3;
        let system = random_system(seed, smooth);
        assert!(system.is_incrementally_stable());
        let omega = Random::new(seed + 1000).between(0.3, 2.5);
        let exact: &dyn Method =
            if smooth { &Shooting { tolerance: 1e-8, width: None, ..Shooting::default() } } else { &EventDriven };
        let Ok(orbit) = find(exact, &system, omega) else { continue };
        assert_eq!(orbit.is_stable(), Some(true));
        let computed = orbit.multipliers().unwrap()[0].norm();
        assert!(computed <= 1.0 + 1e-6, "seed {seed}: {computed}");
        (compared, largest) = (compared + 1, largest.max(computed));
    }
    println!("{compared} orbits, largest multiplier {largest:.9}");
    assert!(compared >= 50, "{compared}");
}

/// The theorem does not cover negative damping. The largest multiplier is that of a linear
/// oscillator without friction, of modulus `e^{-cT/2m}`.
#[test]
fn negative_damping_is_computed() {
    for (c, stable) in [(-0.02, false), (0.02, true)] {
        // the joint acts on the undriven mass, and has no effect
        let system = Model {
            masses: vec![mass("driven", 1.0), mass("idle", 1.0)],
            springs: vec![spring("driven", GROUND, 1.0, c), spring("idle", GROUND, 1.0, 0.5)],
            joints: vec![joint("j", "idle", GROUND, Arc::new(Jenkins { stiffness: 1.0, limit: 1.0 }))],
            forces: vec![force("driven", 1.0, 0.0)],
            ..Model::default()
        }
        .assemble()
        .unwrap();
        let omega = 1.7;
        let expected = (-0.5 * c * TAU / omega).exp();
        for method in [&EventDriven as &dyn Method, &series(5)] {
            let orbit = find(method, &system, omega).unwrap();
            assert_eq!(orbit.is_stable(), Some(stable), "{}", orbit.method);
            match orbit.stability() {
                Stability::Proven => assert!(stable),
                Stability::Computed { largest } => assert!((largest - expected).abs() < 1e-9, "{largest} {expected}"),
                Stability::Unknown => panic!("{} reports no stability", orbit.method),
            }
            assert_eq!(matches!(orbit.stability(), Stability::Proven), stable);
        }
    }
}

/// Two masses coupled by an off-diagonal mass: all methods agree with the closed form of
/// `M x'' + K x = F cos Ωt`.
#[test]
fn masses_that_couple_places() {
    let system = Model {
        masses: vec![mass("a", 1.0), mass("b", 1.5)],
        springs: vec![spring("a", GROUND, 1.0, 0.0), spring("b", GROUND, 2.0, 0.0)],
        // far below its limit: a spring
        joints: vec![joint("j", "a", "b", Arc::new(Jenkins { stiffness: 0.3, limit: 1e3 }))],
        forces: vec![force("a", 1.0, 0.0)],
        ..Model::default()
    }
    .assemble()
    .unwrap();
    let system = with_mass(&system, |mass| (mass[(0, 1)], mass[(1, 0)]) = (0.4, 0.4)).unwrap();
    assert!(system.is_incrementally_stable());
    let omega: f64 = 0.9;
    let square = omega * omega;
    let (aa, ab, bb) = (1.3 - square, -0.3 - 0.4 * square, 2.3 - 1.5 * square);
    let determinant = aa * bb - ab * ab;
    let expected = [bb / determinant, -ab / determinant];
    // an indefinite mass matrix is refused
    let indefinite = with_mass(&system, |mass| (mass[(0, 1)], mass[(1, 0)]) = (4.0, 4.0));
    assert_eq!(indefinite.unwrap_err(), StructureError::NegativeMass);
    for method in [&EventDriven as &dyn Method, &series(5), &series(1)] {
        let orbit = find(method, &system, omega).unwrap();
        for (place, expected) in orbit.places.iter().zip(expected) {
            let found = place.first_harmonic;
            assert!((found - expected).norm() < 1e-9 * expected.abs(), "{}: {found} {expected}", orbit.method);
        }
    }
}

/// Extreme numbers end quickly in an orbit or in an error with a reason. No method hangs or
/// panics.
#[test]
fn extreme_numbers_end_without_hanging() {
    let smooth = |kt: f64, limit: f64| -> SharedLaw { Arc::new(JenkinsArctan { stiffness: kt, limit, alpha: 25e3 }) };
    let exact = |kt: f64, limit: f64| -> SharedLaw { Arc::new(Jenkins { stiffness: kt, limit }) };
    let rigid = |_: f64, limit: f64| -> SharedLaw { Arc::new(Coulomb { limit }) };
    let creeping = |_: f64, limit: f64| -> SharedLaw { Arc::new(CoulombArctan { limit, alpha: 25e3 }) };
    let shooting = Shooting::default();
    let balance = HarmonicBalance::default();
    type Make<'a> = &'a dyn Fn(f64, f64) -> SharedLaw;
    let pairs: [(&dyn Method, Make); 6] = [
        (&EventDriven, &exact),
        (&EventDriven, &rigid),
        (&balance, &exact),
        (&balance, &smooth),
        (&shooting, &creeping),
        (&shooting, &smooth),
    ];
    // mass, stiffness, stiffness of the joint, limit
    let usual = [1.0, 1e4, 200.0, 0.5];
    let (mut orbits, mut errors) = (0, 0);
    for (method, law) in pairs {
        for which in 0..4 {
            for value in [1e-300, 1e-150, 1e-20, 1e20, 1e23, 1e28, 1e150, 1e300] {
                let mut numbers = usual;
                numbers[which] = value;
                let [m, k, kt, limit] = numbers;
                let model = Model {
                    masses: vec![mass("m", m)],
                    springs: vec![spring("m", GROUND, k, 2.0)],
                    joints: vec![joint("j", "m", GROUND, law(kt, limit))],
                    forces: vec![force("m", 2.0, 0.0)],
                    ..Model::default()
                };
                let system = model.assemble().unwrap();
                let found = method.solver(&system).map(|mut solver| solver.orbit(TAU * 14.0));
                match found {
                    Ok(Ok(orbit)) => {
                        assert!(orbit.places[0].amplitude().is_finite());
                        orbits += 1;
                    }
                    _ => errors += 1,
                }
            }
        }
    }
    assert!(orbits > 60 && errors > 0, "{orbits} {errors}");
}

/// A spring in series with a slider carries its load right up to the limit, together with a
/// stop.
///
/// Within the error of harmonic balance, the slider would slip for an instant, and the
/// multipliers would be those of slip. The multipliers must be those of the stuck motion, as
/// the exact method finds them. Apart from the one of the stick offset, they multiply to
/// `exp(-T tr(M⁻¹C))` (Liouville).
#[test]
fn stick_at_the_limit_has_the_multipliers_of_stick() {
    let force = |on: &str, harmonic, amplitude, phase| Force { harmonic, ..force(on, amplitude, phase) };
    let preloaded = Model {
        masses: vec![mass("m0", 0.41), mass("m1", 0.13)],
        springs: vec![spring("m0", GROUND, 4590.0, 0.12), spring("m1", GROUND, 2659.0, 0.36)],
        joints: vec![
            joint("j", "m0", "m1", Arc::new(Jenkins { stiffness: 2598.0, limit: 1.51 })),
            joint("g", "m1", GROUND, Arc::new(Gap { gap: -0.000_172, stiffness: 11_743.0 })),
        ],
        forces: vec![force("m0", 1, 3.4, 0.0), force("m1", 0, 0.5, 0.0)],
        ..Model::default()
    };
    let beside_a_gap = Model {
        masses: vec![mass("m0", 0.311), mass("m1", 0.133)],
        springs: vec![spring("m0", GROUND, 6183.8, 0.312), spring("m1", GROUND, 638.7, 0.198)],
        joints: vec![
            joint("j0", "m0", "m1", Arc::new(Jenkins { stiffness: 2605.1, limit: 1.912 })),
            joint("j1", "m1", "m0", Arc::new(Gap { gap: 9.5e-5, stiffness: 3379.7 })),
        ],
        forces: vec![force("m0", 1, 2.401, 0.0), force("m1", 0, 0.334, 0.0), force("m0", 2, 0.554, 1.0)],
        ..Model::default()
    };
    for (model, hertz, loss) in
        [(preloaded, 27.15, 0.12 / 0.41 + 0.36 / 0.13), (beside_a_gap, 28.92, 0.312 / 0.311 + 0.198 / 0.133)]
    {
        let system = model.assemble().unwrap();
        let orbit = HarmonicBalance::default().solver(&system).unwrap().orbit(TAU * hertz).unwrap();
        assert_eq!(orbit.joints[0].slip_fraction, 0.0);
        let exact = EventDriven.solver(&system).unwrap().orbit(TAU * hertz).unwrap();
        assert!((orbit.places[0].amplitude() / exact.places[0].amplitude() - 1.0).abs() < 2e-3);
        assert_eq!(orbit.is_stable(), exact.is_stable(), "{hertz} Hz: {:?}", orbit.multipliers());
        let product: f64 = orbit.multipliers().unwrap().iter().map(|m| m.norm()).product();
        assert!((product / f64::exp(-loss / hertz) - 1.0).abs() < 1e-6, "{hertz} Hz: {product}");
    }
}
