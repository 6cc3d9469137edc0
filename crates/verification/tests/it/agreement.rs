//! All methods choose the same orbit of a continuum: permanently stuck friction keeps its
//! static equilibrium under the constant loads. Every method reports that more orbits exist.

use nalgebra::dmatrix;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip::law::{Coulomb, FrictionContact, Gap, Iwan, Jenkins, SharedLaw, Valanis};
use stickslip::method::Method;
use stickslip::method::event_driven::EventDriven;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::shooting::Shooting;
use stickslip::method::transient::Transient;
use stickslip::model::{Axis, Force, GROUND, Joint, Mass, Model, Spring, System};
use stickslip::orbit::{Orbit, Symmetry};
use stickslip::structure::Structure;

/// Returns a mass with joints to the ground, a harmonic force and a constant force.
fn mass(laws: &[SharedLaw], drive: f64, constant: f64) -> System {
    let one = |value: f64| dmatrix![value];
    let structure = Structure::new(vec!["m".into()], one(1.0), one(8.0), one(1e4)).unwrap();
    let mut builder = System::builder(structure);
    for (j, law) in laws.iter().enumerate() {
        builder = builder.joint(format!("j{j}"), law.clone(), vec![Axis::new(vec![(0, 1.0)])]);
    }
    builder = builder.force(0, 1, Complex64::new(drive, 0.0)).force(0, 0, Complex64::new(constant, 0.0));
    builder.build().unwrap()
}

fn orbit(method: &dyn Method, system: &System, omega: f64) -> Orbit {
    method.solver(system).unwrap().orbit(omega).unwrap()
}

/// Permanently stuck inner sliders of Iwan's law, or a stuck Jenkins element, together with a
/// gap, which depends on position.
#[test]
fn methods_agree_where_parts_of_a_joint_never_slip() {
    let iwan: SharedLaw = Arc::new(Iwan { stiffness: 4e3, limit: 3.0, chi: -0.5, beta: 0.3, elements: 16 });
    let stuck: SharedLaw = Arc::new(Jenkins { stiffness: 2e4, limit: 40.0 });
    let gap: SharedLaw = Arc::new(Gap { gap: 3e-4, stiffness: 6e3 });
    let precise = HarmonicBalance { tolerance: Some(1e-5), ..HarmonicBalance::default() };
    for (friction, drive, constant, omega) in
        [(&iwan, 2.0, 5.0, 90.0), (&iwan, 1.5, -2.0, 118.0), (&stuck, 5.0, 4.0, 100.0), (&stuck, 5.0, 9.0, 190.0)]
    {
        let system = mass(&[friction.clone(), gap.clone()], drive, constant);
        let exact = orbit(&EventDriven, &system, omega);
        for (name, other, allowed) in [
            ("harmonic balance", orbit(&precise, &system, omega), 2e-5),
            // 1e-5 of a motion with a mean of some times its amplitude
            ("shooting", orbit(&Shooting::default(), &system, omega), 1e-4),
        ] {
            let (a, b) = (&exact.places[0], &other.places[0]);
            let off = (a.maximum - b.maximum).abs().max((a.minimum - b.minimum).abs()) / a.amplitude();
            assert!(off < allowed, "{name} {friction:?} {omega}: {off:.1e}, {a:?} {b:?}");
            assert_eq!(other.evidence.history_dependent, ["j0"], "{name}");
            // the position of the stuck slider is free: a multiplier of one for the exact
            // method, which has the slider in its map
            assert_eq!(exact.is_stable(), Some(true));
            let one = exact.multipliers().unwrap()[0];
            assert!((one.norm() - 1.0).abs() < 1e-6, "{one}");
        }
        assert_eq!(exact.evidence.history_dependent, ["j0"]);
        // `transient` may find any of the orbits and reports this; the mean force of the stuck
        // parts then differs
        let waited = orbit(&Transient { tolerance: 1e-6, ..Transient::default() }, &system, omega);
        assert_eq!(waited.evidence.history_dependent, ["j0"]);
    }
}

/// A permanently stuck spring carries its share of a constant force that was applied with the
/// spring in place. The mean position is `F/(k + kt)`.
#[test]
fn a_stuck_spring_carries_its_share_of_a_constant_force() {
    let system = mass(&[Arc::new(Jenkins { stiffness: 2e4, limit: 40.0 })], 5.0, 4.0);
    for method in [&EventDriven as &dyn Method, &HarmonicBalance::default()] {
        // apart from the constant force, the system is odd
        let found = orbit(method, &system, 100.0);
        assert_eq!(found.symmetry, Symmetry::FullPeriod);
        assert!((found.places[0].mean / (4.0 / 3e4) - 1.0).abs() < 1e-7, "{:?}", found.places[0]);
    }
}

/// Two stuck springs on a soft structure: the search may end far from static equilibrium. There the
/// far spring is relaxed at zero. The near one has moved until it just reaches its limit, so its
/// mean force is the limit minus `kt` times the amplitude.
#[test]
fn stuck_springs_stay_near_static_equilibrium() {
    let (outer, inner, [near, far], limit, omega) =
        (1104.6, [1697.0, 81784.7], [1359.1, 96641.6], 3.08, 10.0 * std::f64::consts::TAU);
    let (masses, damping, [vibration, load]) = ([1.127, 0.886, 0.955], [2.473, 4.058, 4.292], [8.75, 2.09]);
    let names = ["a", "b", "c"].map(String::from);
    let spring = |ends: [&str; 2], stiffness, damping| Spring { between: ends.map(String::from), stiffness, damping };
    let joint = |name: &str, on: &str, stiffness, limit| Joint {
        name: name.into(),
        between: [on.into(), GROUND.into()],
        law: Arc::new(Jenkins { stiffness, limit }),
    };
    let model = Model {
        masses: names.iter().zip(masses).map(|(name, mass)| Mass::new(name.clone(), mass)).collect(),
        springs: vec![
            spring(["a", GROUND], outer, damping[0]),
            spring(["a", "b"], inner[0], damping[1]),
            spring(["b", "c"], inner[1], damping[2]),
        ],
        joints: vec![joint("near", "b", near, limit), joint("far", "a", far, 7.727)],
        forces: [(vibration, 1), (load, 0)]
            .map(|(amplitude, harmonic)| Force { on: "c".into(), amplitude, phase: 0.0, harmonic })
            .to_vec(),
        ..Model::default()
    };
    let chain = |[a, b, c]: [f64; 3]| nalgebra::matrix![a + b, -b, 0.0; -b, b + c, -c; 0.0, -c, c];
    let stiffness =
        |near: f64| chain([outer, inner[0], inner[1]]) + nalgebra::Matrix3::from_diagonal(&[far, near, 0.0].into());
    let inertia = nalgebra::Matrix3::from_diagonal(&masses.into()) * (omega * omega);
    let dynamic = (stiffness(near) - inertia).zip_map(&(chain(damping) * omega), Complex64::new);
    let moved = dynamic.lu().solve(&nalgebra::Vector3::from([0.0, 0.0, vibration].map(Complex64::from))).unwrap();
    let mean_force = limit - near * moved[1].norm();
    let expected = stiffness(0.0).lu().solve(&nalgebra::Vector3::new(0.0, -mean_force, load)).unwrap();
    let system = model.assemble().unwrap();
    for method in [&EventDriven as &dyn Method, &HarmonicBalance::default()] {
        let found = orbit(method, &system, omega);
        assert_eq!(found.evidence.stuck, ["near", "far"], "{}", method.name());
        for (place, expected) in found.places.iter().zip(&expected) {
            assert!((place.mean / expected - 1.0).abs() < 1e-6, "{}: {place:?}, {expected}", method.name());
        }
    }
}

/// If the motion from static equilibrium exceeds the limit, the slider moves only as far as
/// necessary. The orbit then just reaches its limit.
#[test]
fn a_stuck_spring_at_its_limit() {
    // the second harmonic due to the gap makes the mean differ from the middle of the extremes
    let stiffness = 2e4;
    let gap: SharedLaw = Arc::new(Gap { gap: 0.0, stiffness: 8e4 });
    let wide = mass(&[Arc::new(Jenkins { stiffness, limit: 1e3 }), gap.clone()], 20.0, 0.0);
    let found = orbit(&EventDriven, &wide, 150.0);
    let (low, high) = found.joints[0].displacement[0];
    // no load acts before the vibration
    let furthest = high.max(-low);
    assert!(furthest > 1.02 * 0.5 * (high - low), "{low} {high}");
    // a limit between half of the travel and the larger extreme: the slider is stuck in the
    // orbit, but would slip on the path to it
    let limit = stiffness * 0.5 * (furthest + 0.5 * (high - low));
    let system = mass(&[Arc::new(Jenkins { stiffness, limit }), gap], 20.0, 0.0);
    let (a, b) = (orbit(&EventDriven, &system, 150.0), orbit(&HarmonicBalance::default(), &system, 150.0));
    assert!((a.places[0].amplitude() / b.places[0].amplitude() - 1.0).abs() < 2e-3, "{:?} {:?}", a.places, b.places);
    for found in [&a, &b] {
        let largest = (0..4000).map(|i| found.sample(found.period() * f64::from(i) / 4000.0).joints[0].force[0].abs());
        let largest = largest.fold(0.0, f64::max);
        assert!((largest / limit - 1.0).abs() < 1e-2, "{}: {largest} of {limit}", found.method);
    }
}

/// A symmetric motion is unique, even with stuck joints.
#[test]
fn a_mirrored_orbit_has_no_history() {
    let system = mass(&[Arc::new(Jenkins { stiffness: 2e4, limit: 40.0 })], 5.0, 0.0);
    let orbit = orbit(&EventDriven, &system, 100.0);
    assert_eq!(orbit.symmetry, Symmetry::HalfPeriod);
    assert!(orbit.evidence.history_dependent.is_empty());
}

/// Two masses on a rotating shaft, with a gyroscopic and with a one-sided damping matrix.
/// Without a joint, the methods agree with a direct solution; with a joint, they agree with
/// each other.
#[test]
fn methods_agree_with_gyroscopic_damping() {
    let (mass, stiffness) = (dmatrix![1.0, 0.0; 0.0, 0.3], dmatrix![12e3, -2e3; -2e3, 4.5e3]);
    let omega = 100.5;
    for damping in [dmatrix![2.0, 50.0; -50.0, 2.0], dmatrix![2.0, 3.0; 0.0, 2.0]] {
        for joint in [false, true] {
            let names = vec!["a".into(), "b".into()];
            let structure = Structure::new(names, mass.clone(), damping.clone(), stiffness.clone()).unwrap();
            let mut builder = System::builder(structure).force(0, 1, Complex64::new(8.0, 0.0));
            if joint {
                let law: SharedLaw = Arc::new(Jenkins { stiffness: 2e3, limit: 0.5 });
                builder = builder.joint("j", law, vec![Axis::new(vec![(0, 1.0), (1, -1.0)])]);
            }
            let system = builder.build().unwrap();
            let amplitudes = |method: &dyn Method| {
                let orbit = orbit(method, &system, omega);
                [orbit.places[0].amplitude(), orbit.places[1].amplitude()]
            };
            let exact = amplitudes(&EventDriven);
            let precise = HarmonicBalance { tolerance: Some(1e-5), ..HarmonicBalance::default() };
            let settled = amplitudes(&Transient::default());
            for (other, bound) in [(amplitudes(&precise), 3e-5), (settled, 1e-7)] {
                for (a, b) in exact.iter().zip(other) {
                    assert!((a / b - 1.0).abs() < bound, "{damping} {joint}: {exact:?} {other:?}");
                }
            }
            if !joint {
                let complex = |m: &nalgebra::DMatrix<f64>| m.map(|x| Complex64::new(x, 0.0));
                let s = Complex64::new(0.0, omega);
                let matrix = complex(&mass) * (s * s) + complex(&damping) * s + complex(&stiffness);
                let force = nalgebra::dvector![Complex64::new(8.0, 0.0), Complex64::new(0.0, 0.0)];
                let direct = matrix.lu().solve(&force).unwrap();
                for (a, b) in exact.iter().zip(direct.iter()) {
                    assert!((a / b.norm() - 1.0).abs() < 1e-10, "{damping}: {exact:?} {direct}");
                }
            }
        }
    }
}

/// A law may have a stiffness on top of its slip limit. The reported force is the one that
/// moves the other mass: `m x'' + c x' + k x`.
#[test]
fn forces_beyond_a_slip_limit_are_reported_whole() {
    let law = Valanis { stiffness: 2e3, slip_stiffness: 200.0, lambda: 3e3, kappa: 0.7 };
    let model = Model {
        masses: vec![Mass::new("a", 0.5), Mass::new("b", 0.3)],
        springs: vec![
            Spring { between: ["a".into(), GROUND.into()], stiffness: 5e3, damping: 2.0 },
            Spring { between: ["b".into(), GROUND.into()], stiffness: 2.5e3, damping: 1.5 },
        ],
        joints: vec![Joint { name: "j".into(), between: ["a".into(), "b".into()], law: Arc::new(law) }],
        forces: vec![Force { on: "a".into(), amplitude: 20.0, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    };
    let system = model.assemble().unwrap();
    let omega = 103.0;
    for method in [&Shooting::default() as &dyn Method, &Transient::default()] {
        let orbit = orbit(method, &system, omega);
        let period = std::f64::consts::TAU / omega;
        let (mut worst, mut largest) = (0.0f64, 0.0f64);
        for i in 0..400 {
            let now = orbit.sample(period * (f64::from(i) + 0.5) / 400.0);
            let balance = 0.3 * now.acceleration[1] + 1.5 * now.velocity[1] + 2.5e3 * now.displacement[1];
            worst = worst.max((balance - now.joints[0].force[0]).abs());
            largest = largest.max(balance.abs());
        }
        assert!(largest > 1.2 * stickslip::law::Law::force_scale(&law), "{largest}: the slip limit is not passed");
        assert!(worst < 1e-3 * largest, "{}: {worst} of {largest}", method.name());
    }
}

/// Largest error of a series in reported errors, as the book states. Extreme values have a
/// larger error than the reported root mean square.
const FACTOR: f64 = 3.0;

/// A contact slips, sticks and separates in every period. Shooting, `transient` and harmonic
/// balance agree within their reported errors.
#[test]
fn methods_agree_on_a_contact_that_opens_and_closes() {
    let contact = FrictionContact { tangential: 5e3, normal: 8e3, friction: 0.3, preload: 4.0, tangents: 1 };
    let both = |value: f64| dmatrix![value, 0.0; 0.0, value];
    let places = vec!["along".into(), "across".into()];
    let structure = Structure::new(places, both(1.0), both(40.0), both(1e4)).unwrap();
    let axes = vec![Axis::new(vec![(0, 1.0)]), Axis::new(vec![(1, 1.0)])];
    for (omega, across) in [(80.0, 12.0), (110.0, 20.0)] {
        let system = System::builder(structure.clone())
            .joint("rub".to_owned(), Arc::new(contact), axes.clone())
            .force(0, 1, Complex64::from_polar(10.0, 1.0))
            .force(1, 1, Complex64::new(across, 0.0))
            .build()
            .unwrap();
        let series = orbit(&HarmonicBalance { harmonics: Some(63), ..HarmonicBalance::default() }, &system, omega);
        let error = |orbit: &Orbit| orbit.evidence.error_estimate.expect("an estimate");
        let shooting = Shooting { tolerance: 1e-9, ..Shooting::default() };
        for found in [orbit(&shooting, &system, omega), orbit(&Transient::default(), &system, omega)] {
            // the test requires separation, friction and partial slip
            let force = |i: i32| found.sample(found.period() * f64::from(i) / 1000.0).joints[0].force;
            let pressed: Vec<f64> = (0..1000).map(|i| force(i)[1]).collect();
            assert!(pressed.contains(&0.0) && pressed.iter().any(|force| *force > contact.preload), "{omega}");
            assert!((0.05..0.95).contains(&found.joints[0].slip_fraction), "{}", found.joints[0].slip_fraction);
            let allowed = error(&found) + FACTOR * error(&series);
            for (a, b) in found.places.iter().zip(&series.places) {
                let off = (a.maximum - b.maximum).abs().max((a.minimum - b.minimum).abs()) / a.amplitude();
                assert!(off < allowed, "{} {omega}: {off:.1e} of {allowed:.1e}", found.method);
            }
        }
    }
}

/// Bodies that friction alone holds against a constant force. The force along the face slips at
/// first and shakes down. In the settled motion one body stands still, and the other has the
/// amplitude `F/|k - m Ω²|`. If stuck springs carried no mean force, all bodies would drift.
#[test]
fn friction_that_never_slips_carries_what_nothing_else_does() {
    let between = |a: &str, b: &str| [a.to_owned(), b.to_owned()];
    let joint = |name: &str, between, law: SharedLaw| Joint { name: name.into(), between, law };
    let force = |amplitude, harmonic| Force { on: "b".into(), amplitude, phase: 0.0, harmonic };
    let (spring, elastic, tie, mass, omega) = (1899.3, 895.2, 1671.5, 0.657, 25.0);
    for tied in [true, false] {
        let mut joints = vec![
            joint("rigid", between("a", GROUND), Arc::new(Coulomb { limit: 3.51 })),
            joint("elastic", between("b", GROUND), Arc::new(Jenkins { stiffness: elastic, limit: 3.6 })),
        ];
        if tied {
            joints.push(joint("tie", between("a", "b"), Arc::new(Jenkins { stiffness: tie, limit: 2.41 })));
        }
        let model = Model {
            masses: vec![Mass::new("a", 0.21), Mass::new("b", mass)],
            springs: vec![Spring { between: between("a", "b"), stiffness: spring, damping: 1.0 }],
            joints,
            forces: vec![force(3.55, 1), force(1.42, 0)],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let stiffness = spring + elastic + if tied { tie } else { 0.0 };
        let amplitude = 3.55 / f64::hypot(stiffness - mass * omega * omega, omega);
        let methods: [&dyn Method; 3] = [&EventDriven, &HarmonicBalance::default(), &Transient::default()];
        for method in methods {
            let found = orbit(method, &system, omega);
            let error = found.places[1].amplitude() / amplitude - 1.0;
            assert!(error.abs() < 1e-6, "{}: {error:.1e}", method.name());
            assert!(found.places[0].amplitude() < 1e-9 * amplitude, "{}: {:?}", method.name(), found.places);
            assert!(
                found.evidence.energy_gap < 1e-6 && !found.evidence.history_dependent.is_empty(),
                "{:?}",
                found.evidence
            );
        }
    }
}
