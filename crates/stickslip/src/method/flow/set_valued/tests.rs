//! Compares orbits and sensitivities between located switches with closed forms, independent
//! integrations, and differences.

use super::super::integrator_choice::IntegratorKind;
use super::located_switches::SetValuedFlow;
use crate::law::{Coulomb, Cubic, SharedLaw, Stribeck};
use crate::method::event_driven::EventDriven;
use crate::method::flow::Flow;
use crate::method::shooting::Shooting;
use crate::method::transient::Transient;
use crate::method::{Method, auto::Auto};
use crate::model::{Axis, System};
use crate::orbit::Orbit;
use crate::structure::Structure;
use nalgebra::{DMatrix, dmatrix};
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;

/// A mass of 1 kg on a spring (N/m) and a damper (N s/m) under a force, with laws to the ground.
fn oscillator(laws: &[SharedLaw], stiffness: f64, damping: f64, force: f64) -> System {
    let one = |value: f64| dmatrix![value];
    let structure = Structure::new(vec!["m".into()], one(1.0), one(damping), one(stiffness)).unwrap();
    let mut builder = System::builder(structure);
    for (j, law) in laws.iter().enumerate() {
        builder = builder.joint(format!("j{j}"), law.clone(), vec![Axis::new(vec![(0, 1.0)])]);
    }
    builder.force(0, 1, Complex64::new(force, 0.0)).build().unwrap()
}

fn orbit(method: &dyn Method, system: &System, omega: f64) -> Orbit {
    method.solver(system).unwrap().orbit(omega).unwrap()
}

/// A law without force. It forces the use of time integration for the friction next to it.
fn nothing() -> SharedLaw {
    Arc::new(Cubic { stiffness: 0.0 })
}

/// Reference for 1e4 N/m, 3 N s/m, 6 N, and friction that decreases from 3 N to 2 N over 20
/// mm/s. Columns: frequency (Hz), amplitude (m), largest modulus of the multipliers of half a
/// period. Computed by SciPy's DOP853 with separate event location at 1e-13 and differences of
/// the return map.
const STRIBECK: [(f64, f64, f64); 7] = [
    (4.0, 5.012_554_110_668_944e-4, 0.708_411_65),
    (8.0, 8.617_465_690_777_892e-4, 0.989_911_39),
    (12.0, 1.300_152_205_669_650_3e-3, 0.709_209_16),
    (15.0, 4.238_580_668_976_167e-3, 0.901_964_13),
    (15.9, 1.150_996_081_300_167e-2, 0.953_765_31),
    (18.0, 1.793_507_805_448_722_4e-3, 0.878_958_91),
    (25.0, 3.337_338_492_943_542e-4, 0.760_907_90),
];

#[test]
fn falling_friction_has_its_orbits() {
    let law: SharedLaw = Arc::new(Stribeck { limit: 2.0, static_limit: 3.0, velocity: 0.02 });
    let system = oscillator(&[law], 1e4, 3.0, 6.0);
    assert_eq!(IntegratorKind::of(&system, None), IntegratorKind::Switched);
    assert_eq!(Auto.choice(&system).method, "shooting");
    for (frequency, amplitude, multiplier) in STRIBECK {
        let found = orbit(&Auto, &system, TAU * frequency);
        let off = (found.places[0].amplitude() / amplitude - 1.0).abs();
        assert!(off < 1e-9, "{frequency}: {off:.1e} {:?}", found.evidence);
        assert!(found.evidence.energy_gap < 1e-8 && found.evidence.residual < 1e-9, "{:?}", found.evidence);
        let largest = found.multipliers().unwrap()[0].norm().sqrt();
        assert!((largest - multiplier).abs() < 1e-5, "{frequency}: {largest} {multiplier}");
    }
    let waited = orbit(&Transient::default(), &system, TAU * 8.0);
    assert!((waited.places[0].amplitude() / STRIBECK[1].1 - 1.0).abs() < 1e-7, "{:?}", waited.evidence);
}

/// Den Hartog's closed form (1931) of an undamped mass under constant friction, and the product
/// of the multipliers of half a period. Its square is that of a period.
#[test]
fn constant_friction_has_den_hartogs_orbit() {
    for (share, ratio, amplitude) in
        [(0.2, 0.8, 2.711_415_255_4), (0.5, 0.8, 2.332_234_987_5), (0.5, 1.2, 1.657_467_471_1)]
    {
        let system = oscillator(&[Arc::new(Coulomb { limit: share }), nothing()], 1.0, 0.0, 1.0);
        let found = orbit(&Shooting::default(), &system, ratio);
        let off = found.places[0].amplitude() - amplitude;
        assert!(off.abs() < 2e-10, "{share} {ratio}: {off:.1e} {:?}", found.evidence);
        let product: f64 = found.multipliers().unwrap().iter().map(|m| m.norm()).product();
        let expected = (amplitude * ratio * ratio - share) / (amplitude * ratio * ratio + share);
        assert!((product.sqrt() - expected).abs() < 1e-8, "{share} {ratio}: {product} {expected}");
    }
}

/// Two masses with friction to the ground and between them.
fn pair(laws: [SharedLaw; 2], more: Option<SharedLaw>) -> System {
    let structure = Structure::new(
        vec!["a".into(), "b".into()],
        dmatrix![1.0, 0.0; 0.0, 0.7],
        dmatrix![0.3, -0.1; -0.1, 0.2],
        dmatrix![5.0, -2.0; -2.0, 3.0],
    );
    let axes = [vec![(0, 1.0)], vec![(0, 1.0), (1, -1.0)]];
    let mut builder = System::builder(structure.unwrap());
    for (j, (law, rows)) in laws.into_iter().zip(axes).enumerate() {
        builder = builder.joint(format!("j{j}"), law, vec![Axis::new(rows)]);
    }
    if let Some(law) = more {
        builder = builder.joint("more".to_owned(), law, vec![Axis::new(vec![(1, 1.0)])]);
    }
    builder.force(0, 1, Complex64::new(2.0, 0.0)).force(1, 1, Complex64::new(0.5, -1.0)).build().unwrap()
}

/// Stick, slip and reversals agree with the event-driven closed forms, and so does the
/// derivative of a period.
#[test]
fn constant_friction_agrees_with_event_driven() {
    let coulomb = |limit: f64| -> SharedLaw { Arc::new(Coulomb { limit }) };
    let laws = || [coulomb(0.9), coulomb(0.4)];
    let (exact, integrated) = (pair(laws(), None), pair(laws(), Some(nothing())));
    for omega in [0.7, 1.3, 2.6] {
        let (one, other) = (orbit(&EventDriven, &exact, omega), orbit(&Shooting::default(), &integrated, omega));
        for (a, b) in one.places.iter().zip(&other.places) {
            assert!((a.amplitude() / b.amplitude() - 1.0).abs() < 1e-8, "{omega}: {a:?} {b:?}");
        }
        for (a, b) in one.joints.iter().zip(&other.joints) {
            assert!((a.slip_fraction - b.slip_fraction).abs() < 1e-6, "{omega}: {a:?} {b:?}");
            assert_eq!(a.switches, b.switches, "{omega}");
        }
        let (a, b) = (one.multipliers().unwrap(), other.multipliers().unwrap());
        for (a, b) in a.iter().zip(&b) {
            assert!((a.norm() - b.norm()).abs() < 1e-6, "{omega}: {a} {b}");
        }
    }
}

/// The sensitivity of a run through stick and slip equals the effect of a small change of the
/// initial state on the end state.
#[test]
fn sensitivities_pass_switches() {
    let stribeck = |limit: f64| -> SharedLaw { Arc::new(Stribeck { limit, static_limit: 1.4 * limit, velocity: 0.2 }) };
    let system = pair([stribeck(0.7), stribeck(0.3)], Some(Arc::new(Cubic { stiffness: 0.8 })));
    let mut flow = SetValuedFlow::new(&system, 1e-11, "test").unwrap();
    flow.set_excitation(&system, 1.3);
    let start = [0.3, -0.2, 0.5, 0.1];
    let mut derivative = DMatrix::identity(4, 4);
    flow.run(&mut start.to_vec(), 6.0, Some(&mut derivative)).unwrap();
    for column in 0..4 {
        let moved = |by: f64, flow: &mut SetValuedFlow| {
            let mut state = start.to_vec();
            state[column] += by;
            flow.run(&mut state, 6.0, None).unwrap();
            state
        };
        let (up, down) = (moved(1e-5, &mut flow), moved(-1e-5, &mut flow));
        for row in 0..4 {
            let difference = (up[row] - down[row]) / 2e-5;
            let found = derivative[(row, column)];
            assert!((found - difference).abs() < 1e-6, "{row} {column}: {found} {difference}");
        }
    }
}
