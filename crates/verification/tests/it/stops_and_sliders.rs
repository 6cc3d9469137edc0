//! The exact method with all kinds of pieces: stops, alone and with sliders, and sliders with a
//! static limit above the dynamic one.
//!
//! References: closed forms, time integration, and orbits that SciPy integrated
//! (`data/static_friction`).

#![allow(clippy::print_stdout)] // tests print measured values

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use stickslip::law::{Contact, Coulomb, Gap, IdealElement, Jenkins, Law, LawInfo, Parameter, SharedLaw, Stribeck};
use stickslip::method::event_driven::{EventDriven, SubharmonicEventDriven};
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::time_history::{Excitation, TimeHistory};
use stickslip::method::{Method, auto::Auto, shooting::Shooting};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Motion, Spring};
use stickslip::orbit::{Orbit, Sample, Seed};
use stickslip_verification::{close, exact, near, number, table};

/// Returns a mass of 1 kg on a spring (N/m) and a damper (kg/s), with these joints to the
/// ground.
fn oscillator(stiffness: f64, damping: f64, laws: &[SharedLaw]) -> Model {
    let between = || ["m".to_owned(), GROUND.to_owned()];
    let joint = |(i, law): (usize, &SharedLaw)| Joint { name: format!("j{i}"), between: between(), law: law.clone() };
    Model {
        masses: vec![Mass::new("m", 1.0)],
        springs: vec![Spring { between: between(), stiffness, damping }],
        joints: laws.iter().enumerate().map(joint).collect(),
        ..Model::default()
    }
}

fn force(on: &str, amplitude: f64, harmonic: u32) -> Force {
    Force { on: on.into(), amplitude, phase: 0.0, harmonic }
}

/// Returns samples of the first displacement of a free motion from rest at `start`.
fn free(model: &Model, start: f64, step: f64, duration: f64) -> Vec<f64> {
    let motion = TimeHistory {
        displacement: vec![start],
        velocity: vec![0.0],
        states: Vec::new(),
        excitation: Excitation::Free,
        duration,
        step,
        width: None,
        tolerance: None,
    };
    let mut all = Vec::new();
    let mut keep = |_: f64, _: f64, state: &Sample| {
        all.push(state.displacement[0]);
        true
    };
    motion.run(&model.assemble().unwrap(), &mut keep).unwrap_or_else(|error| panic!("{model:?}: {error}"));
    all
}

/// A free oscillator moves in one sine on each side of a stop. For a gap of zero its frequency
/// is `2 w1 w2 / (w1 + w2)`.
#[test]
fn bilinear_oscillator_swings_with_its_frequency() {
    let (k, stop) = (100.0f64, 800.0);
    let model = oscillator(k, 0.0, &[Arc::new(Gap { gap: 0.0, stiffness: stop })]);
    let (w1, w2) = (k.sqrt(), (k + stop).sqrt());
    let period = TAU / (2.0 * w1 * w2 / (w1 + w2));
    for start in [-0.3, 0.05] {
        let x = free(&model, start, period / 4.0, 20.0 * period);
        for (i, x) in x.iter().enumerate().step_by(4) {
            near("after a period", *x, start, 1e-12 * (i + 1) as f64);
        }
    }
    // the other turning point is lower by the ratio of the frequencies
    let turning = free(&model, -0.3, 0.5 * period, 0.5 * period);
    near("turning point", turning[1], 0.3 * w1 / w2, 1e-13);
}

/// With a gap, open or compressed at rest, and a constant force, the motion consists of two
/// sines about two equilibria, with equal energy.
#[test]
fn preloaded_oscillator_swings_with_its_period() {
    let (k, stop) = (100.0f64, 800.0);
    for (gap, constant) in [(0.02, 0.0), (-0.02, 0.0), (0.01, 3.0), (-0.01, -5.0)] {
        let mut model = oscillator(k, 0.0, &[Arc::new(Gap { gap, stiffness: stop })]);
        model.forces.push(force("m", constant, 0));
        let start = gap - 0.1;
        let (w1, w2) = (k.sqrt(), (k + stop).sqrt());
        let (open, closed) = (constant / k, (constant + stop * gap) / (k + stop));
        let (a, at) = (open - start, gap - open);
        let t1 = (at / -a).acos() / w1;
        let v = w1 * (a * a - at * at).sqrt();
        // beyond the gap: `x = closed + b sin(w2 t + p)`, with the velocity v at the gap
        let b = (v * v / (w2 * w2) + (gap - closed).powi(2)).sqrt();
        let t2 = 0.5 * PI / w2 - ((gap - closed) / b).asin() / w2;
        let period = 2.0 * (t1 + t2);
        let x = free(&model, start, 0.5 * period, 10.0 * period);
        for (i, x) in x.iter().enumerate() {
            let expected = if i % 2 == 0 { start } else { closed + b };
            near("turning point", *x, expected, 1e-12 * (i + 1) as f64);
        }
    }
}

/// Under excitation, with and without preload, the event-driven orbit agrees with the
/// integration of the law's rate. The stability agrees too.
#[test]
fn stops_agree_with_integration() {
    let (mut worst, mut unstable) = (0.0f64, 0);
    for (gap, stiffness, constant) in
        [(0.0, 4.0, 0.0), (0.5, 10.0, 0.0), (-0.3, 4.0, 0.0), (0.2, 2.0, 0.7), (0.1, 4.0, -0.5)]
    {
        let mut model = oscillator(1.0, 0.1, &[Arc::new(Gap { gap, stiffness })]);
        model.forces = vec![force("m", 1.0, 1), force("m", constant, 0)];
        let system = model.assemble().unwrap();
        assert_eq!(Auto.choice(&system).method, "event-driven");
        for omega in [0.4, 0.8, 1.3, 1.9, 2.6, 3.1] {
            let orbit = EventDriven.solver(&system).unwrap().orbit(omega).unwrap();
            let shooting = Shooting { tolerance: 1e-10, ..Shooting::default() };
            let other = shooting.solver(&system).unwrap().orbit_near(omega, Some(&orbit.seed())).unwrap();
            let (a, b) = (&orbit.places[0], &other.places[0]);
            let scale = a.amplitude();
            for (a, b) in [(a.maximum, b.maximum), (a.minimum, b.minimum), (a.mean, b.mean)] {
                worst = worst.max((a - b).abs() / scale);
            }
            let largest = |orbit: &Orbit| orbit.multipliers().unwrap()[0].norm();
            // the kink of the force falls inside a step of the integration, which limits its
            // derivative
            near("multiplier", largest(&orbit), largest(&other), 1e-4);
            assert_eq!(orbit.is_stable(), other.is_stable());
            unstable += usize::from(orbit.is_stable() == Some(false));
            assert_eq!((orbit.joints[0].slip_fraction, orbit.joints[0].dissipation), (0.0, 0.0));
            assert!(!orbit.is_in_continuum(), "a stop does not stick");
            // all work of the excitation goes into the damper, none into the stop
            assert!(orbit.evidence.energy_gap < 1e-10, "{}", orbit.evidence.energy_gap);
            for i in 0..20 {
                let at = &orbit.sample(orbit.period() * f64::from(i) / 20.0).joints[0];
                let depth = at.displacement[0] - gap;
                near("force", at.force[0], stiffness * depth.max(0.0), 1e-12 * stiffness * scale);
                assert_eq!(at.contact, if depth > 0.0 { Contact::Touch } else { Contact::Open });
            }
        }
    }
    println!("worst difference of displacements {worst:.1e}, {unstable} unstable orbits");
    assert!(worst < 1e-7, "{worst}");
    assert!(unstable > 0, "no unstable orbit was met");
}

/// (11.13): where the orbit of one period is unstable, it reports this, and the orbit of two
/// periods is found and is stable.
#[test]
fn subharmonic_motion_beside_an_unstable_one() {
    let mut model = oscillator(1.0, 0.1, &[Arc::new(Gap { gap: 0.0, stiffness: 4.0 })]);
    model.forces = vec![force("m", 1.0, 1)];
    let system = model.assemble().unwrap();
    let omega = 2.6;
    let single = EventDriven.solver(&system).unwrap().orbit(omega).unwrap();
    assert_eq!(single.is_stable(), Some(false));
    multiplied(&single, [-1.878_280_613_595_553, -0.418_107_055_970_699].map(Complex64::from));
    let double = SubharmonicEventDriven { period: 2 }
        .solver(&system)
        .unwrap()
        .orbit_near(omega, Some(&Seed::from_state(omega, vec![-1.0, 0.3])))
        .unwrap();
    let other = Shooting { period: 2, tolerance: 1e-10, ..Shooting::default() };
    let other = other.solver(&system).unwrap().orbit_near(omega, Some(&double.seed())).unwrap();
    close("maximum", double.places[0].maximum, other.places[0].maximum, 1e-7);
    assert_eq!(double.is_stable(), Some(true));
    let later = double.sample(TAU / omega).displacement[0];
    assert!((double.initial_state[0] - later).abs() > 0.1, "it repeats after one period");
    multiplied(&double, [1.0, -1.0].map(|sign| Complex64::new(0.446_922_437_899_297, sign * 0.645_748_845_388_059)));
}

/// (11.13): an orbit of one period that has just become unstable. Its multipliers are -1.18 and
/// `-e^{-c T}/1.18`.
#[test]
fn a_multiplier_of_1_18_is_unstable() {
    let mut model = oscillator(1.0, 0.1, &[Arc::new(Gap { gap: 0.0, stiffness: 4.0 })]);
    model.forces = vec![force("m", 1.0, 1)];
    let system = model.assemble().unwrap();
    let omega: f64 = 2.292_216_110_276_591;
    let start = [-0.427_335_512_599_994, 0.041_289_347_296_247_5];
    let shrinks = (-0.1 * TAU / omega).exp();
    // error of 127 harmonics, due to the kink of the force
    const SERIES: f64 = 1e-6;
    let balance = HarmonicBalance { harmonics: Some(127), ..HarmonicBalance::default() };
    for (method, digits) in [(&EventDriven as &dyn Method, PRINTED), (&balance, SERIES)] {
        let orbit = method.solver(&system).unwrap().orbit(omega).unwrap();
        assert_eq!(orbit.is_stable(), Some(false), "{}", orbit.method);
        within(&orbit, [-1.18, -shrinks / 1.18].map(Complex64::from), digits);
    }
    let orbit = EventDriven.solver(&system).unwrap().orbit(omega).unwrap();
    for (found, expected) in orbit.initial_state.iter().zip(start) {
        near("start", *found, expected, PRINTED);
    }
}

/// Tolerance on starts and multipliers, which are printed with fifteen digits. The printed
/// values are products of exponentials between the times of contact, closed by Newton's method
/// in 25 digits with mpmath, without this code. Orbits are closed to some 1e-12.
const PRINTED: f64 = 1e-10;

/// Asserts the multipliers of an orbit of one mass of 1 kg with one damper. Their product is
/// the contraction of areas, `e^{-c T}`.
#[track_caller]
fn multiplied(orbit: &Orbit, expected: [Complex64; 2]) {
    within(orbit, expected, PRINTED);
}

/// Asserts the multipliers to a given tolerance.
#[track_caller]
fn within(orbit: &Orbit, expected: [Complex64; 2], digits: f64) {
    let found = orbit.multipliers().unwrap();
    for one in expected {
        let nearest = found.iter().map(|other| (other - one).norm()).fold(f64::INFINITY, f64::min);
        assert!(nearest < digits, "{found:?} {expected:?} {nearest:e}");
    }
}

/// (11.13): stable orbits of one, three and five periods coexist. Source of starts and
/// multipliers: see [`PRINTED`].
#[test]
fn motions_of_one_three_and_five_periods_side_by_side() {
    let (omega, damping) = (4.9, 0.05);
    let mut model = oscillator(1.0, damping, &[Arc::new(Gap { gap: 0.0, stiffness: 8.0 })]);
    model.forces = vec![force("m", 1.0, 1)];
    let system = model.assemble().unwrap();
    for (period, start, multiplier) in [
        (1, [-0.073_211_207_490_364, 0.002_435_470_111_715], [-0.881_520_500_208_283, 0.401_023_133_264_624]),
        (3, [-0.174_251_875_614_075, 0.009_158_848_693_814], [0.427_379_231_597_667, 0.801_480_703_521_666]),
        (5, [-0.080_541_913_512_218, 0.024_359_534_443_732], [0.255_525_431_900_043, 0.812_675_526_262_775]),
    ] {
        let multiplier = Complex64::new(multiplier[0], multiplier[1]);
        let shrinks = (-damping * f64::from(period) * TAU / omega).exp();
        assert!((multiplier.norm_sqr() - shrinks).abs() < PRINTED, "{period}");
        let method = SubharmonicEventDriven { period: period as usize };
        let orbit =
            method.solver(&system).unwrap().orbit_near(omega, Some(&Seed::from_state(omega, start.to_vec()))).unwrap();
        for (found, expected) in orbit.initial_state.iter().zip(start) {
            near("start", *found, expected, PRINTED);
        }
        assert_eq!(orbit.is_stable(), Some(true), "{period}");
        multiplied(&orbit, [multiplier, multiplier.conj()]);
        let repeats = |later: i32| {
            let now = orbit.sample(f64::from(later) * TAU / omega);
            (now.displacement[0] - start[0]).hypot(now.velocity[0] - start[1]) < 1e-6
        };
        assert!(repeats(period) && !(1..period).any(repeats), "{period}");
    }
}

/// A motion just touches the stop, just misses it, or presses it a little. Velocity and depth
/// vanish together at the turning point. The orbit equals the linear one up to the compression
/// of the stop.
#[test]
fn grazing_a_stop_is_no_jump() {
    let (omega, damping) = (0.5f64, 0.1);
    let amplitude = 1.0 / ((1.0 - omega * omega).powi(2) + (damping * omega).powi(2)).sqrt();
    for off in [-1e-4, -1e-6, -1e-8, -1e-10, -1e-12, -1e-14, 0.0, 1e-14, 1e-12, 1e-10, 1e-8, 1e-4] {
        let mut model = oscillator(1.0, damping, &[Arc::new(Gap { gap: amplitude * (1.0 + off), stiffness: 50.0 })]);
        model.forces = vec![force("m", 1.0, 1)];
        let orbit = exact(&model.assemble().unwrap(), omega);
        let place = &orbit.places[0];
        // the compression of the stop is less than the overlap
        let pressed = f64::max(-off, 0.0) * amplitude;
        near("largest", place.maximum, amplitude, pressed + 1e-10);
        near("smallest", place.minimum, -amplitude, pressed + 1e-10);
        assert_eq!(orbit.is_stable(), Some(true), "{off:e}");
        assert!(off.abs() < 1e-9 || orbit.joints[0].switches == if off < 0.0 { 2 } else { 0 }, "{off:e}");
    }
}

/// A stop with a moving wall: a mean imposed motion acts as a smaller gap.
#[test]
fn a_moved_wall_counts_with_its_mean() {
    let wall = |mean: f64, gap: f64| {
        let mut model = oscillator(1.0, 0.1, &[]);
        let law: SharedLaw = Arc::new(Gap { gap, stiffness: 5.0 });
        model.joints.push(Joint { name: "stop".into(), between: ["m".into(), "wall".into()], law });
        let motion = |amplitude: f64, harmonic: u32| Motion { on: "wall".into(), amplitude, phase: 0.4, harmonic };
        model.motions = vec![motion(0.3, 1)];
        if mean != 0.0 {
            model.motions.push(Motion { phase: 0.0, ..motion(mean, 0) });
        }
        model.forces = vec![force("m", 0.5, 1)];
        model.assemble().unwrap()
    };
    let (moved, still) = (wall(0.2, 0.1), wall(0.0, 0.3));
    let (a, b) = (exact(&moved, 1.2), exact(&still, 1.2));
    close("maximum", a.places[0].maximum, b.places[0].maximum, 1e-11);
    let shooting = Shooting { tolerance: 1e-10, ..Shooting::default() };
    let other = shooting.solver(&moved).unwrap().orbit(1.2).unwrap();
    close("maximum", a.places[0].maximum, other.places[0].maximum, 1e-7);
    close("work", a.energy.work_in, other.energy.work_in, 1e-6);
}

/// A law of an elastic slider, a rigid slider and a stop in parallel.
#[derive(Debug)]
struct Mixed;

static MIXED: LawInfo = LawInfo {
    name: "mixed",
    summary: "a law that only tests need",
    parameters: &[Parameter::positive("gap", stickslip::dimension::Dimension::LENGTH, "not read")],
    sample: &[1.0],
    build: |_| Arc::new(Mixed),
};

impl Law for Mixed {
    fn info(&self) -> &'static LawInfo {
        &MIXED
    }
    fn values(&self) -> Vec<f64> {
        vec![1.0]
    }
    fn is_odd(&self) -> bool {
        false
    }
    fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
        let stop = IdealElement::Stop { gap: 0.4, stiffness: 3.0 };
        Some(vec![IdealElement::slider(Some(2.0), 0.3), stop, IdealElement::slider(None, 0.1)])
    }
}

/// The pieces of one law act as three parallel joints: same motion, losses and slip.
#[test]
fn pieces_of_one_law_are_joints_side_by_side() {
    let apart: [SharedLaw; 3] = [
        Arc::new(Jenkins { stiffness: 2.0, limit: 0.3 }),
        Arc::new(Gap { gap: 0.4, stiffness: 3.0 }),
        Arc::new(Coulomb { limit: 0.1 }),
    ];
    for omega in [0.5, 1.1, 2.0] {
        let solve = |laws: &[SharedLaw]| {
            let mut model = oscillator(1.0, 0.02, laws);
            model.forces = vec![force("m", 1.0, 1)];
            exact(&model.assemble().unwrap(), omega)
        };
        let (one, three) = (solve(&[Arc::new(Mixed)]), solve(&apart));
        close("maximum", one.places[0].maximum, three.places[0].maximum, 1e-10);
        close("minimum", one.places[0].minimum, three.places[0].minimum, 1e-10);
        let loss: f64 = three.joints.iter().map(|joint| joint.dissipation).sum();
        close("loss", one.joints[0].dissipation, loss, 1e-10);
        // the rigid slider slips whenever the elastic one does
        close("slip", one.joints[0].slip_fraction, three.joints[2].slip_fraction, 1e-9);
        assert!(one.evidence.energy_gap < 1e-10, "{}", one.evidence.energy_gap);
    }
}

/// Friction with a higher static limit: amplitudes, losses, slip and states of three orbits
/// agree with SciPy.
#[test]
fn static_friction_agrees_with_scipy() {
    type Case = (&'static str, &'static [(f64, f64)], f64, f64);
    let cases: [Case; 3] = [
        ("one_slow", &[(0.5, 0.8)], 0.0, 0.3),
        ("one_fast", &[(0.3, 0.6)], 0.0, 1.4),
        ("two", &[(0.4, 0.6), (0.2, 0.35)], 0.7, 0.55),
    ];
    let rows = table("static_friction/static_limit.csv");
    for (name, limits, coupling, omega) in cases {
        let place = |i: usize| format!("m{}", i + 1);
        let mut model = Model::default();
        for (i, &(limit, static_limit)) in limits.iter().enumerate() {
            let between = || [place(i), GROUND.to_owned()];
            model.masses.push(Mass::new(place(i), 1.0));
            model.springs.push(Spring { between: between(), stiffness: 1.0, damping: 0.05 });
            let law = Arc::new(Stribeck { limit, static_limit, velocity: 0.0 });
            model.joints.push(Joint { name: format!("j{}", i + 1), between: between(), law });
            if i > 0 {
                let between = [place(i - 1), place(i)];
                model.springs.push(Spring { between, stiffness: coupling, damping: 0.0 });
            }
        }
        model.forces = vec![force("m1", 1.0, 1)];
        let system = model.assemble().unwrap();
        assert!(!system.is_incrementally_stable());
        let orbit = exact(&system, omega);
        let state = orbit.sample(0.0);
        for row in rows.iter().filter(|row| row["case"] == name) {
            let (i, expected) = (number(row, "mass") as usize - 1, number(row, "value"));
            let found = match row["quantity"].as_str() {
                "amplitude" => orbit.places[i].amplitude(),
                "slip_fraction" => orbit.joints[i].slip_fraction,
                "loss" => orbit.joints[i].dissipation,
                "switches" => orbit.joints[i].switches as f64,
                "displacement_0" => state.displacement[i],
                "velocity_0" => state.velocity[i],
                "return" => continue,
                other => panic!("{other}"),
            };
            // two runs of the SciPy integration differ by up to 2e-9
            near(&format!("{name}: {} {}", row["quantity"], i + 1), found, expected, 1e-10 * (1.0 + expected.abs()));
        }
        assert!(orbit.evidence.energy_gap < 1e-10, "{}", orbit.evidence.energy_gap);
        println!("{name}: {} iterations, stability {:?}", orbit.evidence.iterations, orbit.stability());
    }
}

/// Returns a driven mass that rubs on another mass, or on a moved place. The joints have these
/// limits (N, in slip and at rest); every third joint is reversed.
fn rubbing(limits: &[(f64, f64)], moved: bool) -> Model {
    let spring = |place: &str, stiffness: f64, damping: f64| {
        let between = [place.into(), GROUND.into()];
        Spring { between, stiffness, damping }
    };
    let joint = |(i, &(limit, static_limit)): (usize, &(f64, f64))| {
        let law: SharedLaw = if static_limit > limit {
            Arc::new(Stribeck { limit, static_limit, velocity: 0.0 })
        } else {
            Arc::new(Coulomb { limit })
        };
        let between = if i % 3 == 2 { ["b", "a"] } else { ["a", "b"] }.map(str::to_owned);
        Joint { name: format!("j{i}"), between, law }
    };
    let mut model = Model {
        masses: vec![Mass::new("a", 1.0)],
        springs: vec![spring("a", 10e3, 3.0)],
        joints: limits.iter().enumerate().map(joint).collect(),
        forces: vec![Force { phase: 0.9, ..force("a", 20.0, 1) }],
        ..Model::default()
    };
    if moved {
        model.motions = vec![Motion { on: "b".into(), amplitude: 0.3e-3, phase: 0.2, harmonic: 1 }];
    } else {
        model.masses.push(Mass::new("b", 0.5));
        model.springs.push(spring("b", 8e3, 2.0));
    }
    model
}

/// Asserts that parallel contacts share the force of one contact with the summed limits. In
/// stick the shares are proportional to the static limits; in slip each contact carries its own
/// limit. The sign follows the direction of the joint.
fn shares(what: &str, many: &Sample, one: &Sample, limits: &[(f64, f64)]) {
    let (whole, held) = (&one.joints[0], limits.iter().map(|limit| limit.1).sum::<f64>());
    for (i, (joint, &(limit, static_limit))) in many.joints.iter().zip(limits).enumerate() {
        let (contact, sign) = match whole.contact {
            contact if i % 3 == 2 => (contact.mirrored(), -1.0),
            contact => (contact, 1.0),
        };
        assert_eq!(joint.contact, contact, "{what}: joint {i}");
        let force = match joint.contact {
            Contact::SlipForward => limit,
            Contact::SlipBackward => -limit,
            _ => sign * whole.force[0] * static_limit / held,
        };
        // forces in stick carry the accelerations of stiff springs
        near(&format!("{what}: force {i}"), joint.force[0], force, 1e-8 * static_limit);
        near(&format!("{what}: displacement {i}"), joint.displacement[0], sign * whole.displacement[0], 1e-12);
    }
    for (many, one) in many.imposed.iter().zip(&one.imposed) {
        near(&format!("{what}: reaction"), many.1, one.1, 1e-8 * held);
    }
}

/// Rigid contacts between the same two places have one relative motion. They slip and stick
/// together, like one contact with the summed limits, for any number of contacts and any laws.
#[test]
fn rigid_contacts_side_by_side_are_one() {
    type Limits = fn(usize) -> (f64, f64);
    let kinds: [(&str, Limits); 4] = [
        ("coulomb", |_| (0.9, 0.9)),
        ("stribeck", |_| (0.7, 0.91)),
        ("mixed", |i| if i % 2 == 0 { (0.7, 1.3) } else { (0.7, 0.7) }),
        ("unequal", |i| (0.3 + 0.1 * i as f64, 0.4 + 0.13 * (i % 4) as f64 + 0.1 * i as f64)),
    ];
    for (kind, limits) in kinds {
        for count in 2..=12usize {
            // the total limit does not depend on the number, so the contacts slip
            let scale = 5.0 / count as f64;
            let limits: Vec<_> = (0..count).map(limits).map(|(slip, rest)| (scale * slip, scale * rest)).collect();
            let sums = limits.iter().fold((0.0, 0.0), |sum, limit| (sum.0 + limit.0, sum.1 + limit.1));
            for moved in [false, true] {
                let what = format!("{count} {kind}, moved: {moved}");
                let system = |limits: &[(f64, f64)]| rubbing(limits, moved).assemble().unwrap();
                let (side_by_side, whole) = (system(&limits), system(&[sums]));
                let omega = TAU * 6.0;
                let (many, one) = (exact(&side_by_side, omega), exact(&whole, omega));
                assert!(one.joints[0].slip_fraction > 0.0, "{what}");
                for (many, one) in many.places.iter().zip(&one.places) {
                    close(&format!("{what}: amplitude"), many.amplitude(), one.amplitude(), 1e-9);
                }
                let loss = many.joints.iter().map(|joint| joint.dissipation).sum::<f64>();
                near(&format!("{what}: loss"), loss, one.joints[0].dissipation, 1e-9 * one.energy.work_in.abs());
                for (joint, (limit, _)) in many.joints.iter().zip(&limits) {
                    let part = one.joints[0].dissipation * limit / sums.0;
                    near(&format!("{what}: loss of a joint"), joint.dissipation, part, 1e-9 * one.energy.work_in.abs());
                    close(&format!("{what}: slip"), joint.slip_fraction, one.joints[0].slip_fraction, 1e-9);
                    assert_eq!(joint.switches, one.joints[0].switches, "{what}");
                }
                for step in 0..16 {
                    // times between the switches
                    let time = (f64::from(step) + 0.3711) / 16.0 * TAU / omega;
                    shares(&what, &many.sample(time), &one.sample(time), &limits);
                }
                assert_eq!(many.evidence.switches, count * one.evidence.switches, "{what}");
            }
        }
    }
}

/// Parallel rigid contacts also act as one in motions from rest.
#[test]
fn rigid_contacts_side_by_side_start_as_one() {
    for count in [5, 7, 11] {
        for limits in [vec![(0.9, 0.9); count], vec![(0.7, 0.91); count]] {
            let sums = limits.iter().fold((0.0, 0.0), |sum, limit| (sum.0 + limit.0, sum.1 + limit.1));
            let samples = |limits: &[(f64, f64)]| {
                let motion = TimeHistory {
                    displacement: vec![0.0; 2],
                    velocity: vec![0.0; 2],
                    states: Vec::new(),
                    excitation: Excitation::Steady(TAU * 6.0),
                    duration: 2.0,
                    step: 0.01371,
                    width: None,
                    tolerance: None,
                };
                let mut samples = Vec::new();
                let mut keep = |_: f64, _: f64, sample: &Sample| {
                    samples.push(sample.clone());
                    true
                };
                motion.run(&rubbing(limits, false).assemble().unwrap(), &mut keep).unwrap();
                samples
            };
            let (many, one) = (samples(&limits), samples(&[sums]));
            assert!(many.len() > 100 && one.iter().any(|sample| sample.joints[0].contact.slips()));
            for (step, (many, one)) in many.iter().zip(&one).enumerate() {
                let what = format!("{count} of {:?}, sample {step}", limits[0]);
                near(&what, many.displacement[0], one.displacement[0], 1e-12);
                shares(&what, many, one, &limits);
            }
        }
    }
}

/// An overdamped mass creeps towards its final position and reaches it to all digits after a
/// while. Neither this nor a slow approach to a stop is chatter. A mass that slides with
/// `limit` ends where its spring balances the friction and the constant force.
#[test]
fn creeping_to_a_stop_is_no_chatter() {
    let limit = 0.1;
    let laws: [(SharedLaw, f64, f64); 3] = [
        (Arc::new(Coulomb { limit }), limit, 1.0),
        (Arc::new(Jenkins { stiffness: 2.0, limit }), limit, 1.0),
        (Arc::new(Gap { gap: 0.0, stiffness: 2.0 }), 0.0, 3.0),
    ];
    for (law, friction, stiffness) in laws {
        for damping in [1.9, 3.0, 10.0, 50.0] {
            for constant in [0.0, 0.3] {
                let mut model = oscillator(1.0, damping, std::slice::from_ref(&law));
                model.forces = vec![force("m", constant, 0)];
                let x = *free(&model, 1.0, 1.0, 2000.0).last().unwrap();
                let expected = (constant + friction) / stiffness;
                if damping > 1.9 {
                    near(&format!("{law:?}, {damping} kg/s, {constant} N"), x, expected, 1e-9);
                }
                // also under an excitation of zero amplitude
                let system = model.assemble().unwrap();
                let motion = TimeHistory {
                    displacement: vec![1.0],
                    velocity: vec![0.0],
                    states: Vec::new(),
                    excitation: Excitation::Steady(1.0),
                    duration: 2000.0,
                    step: 10.0,
                    width: None,
                    tolerance: None,
                };
                motion.run(&system, &mut |_, _, _| true).unwrap();
            }
        }
    }
}

/// An overdamped mass under slow excitation creeps to rest twice a period. The smoothed law
/// gives the same motion.
#[test]
fn creeping_orbits_are_found() {
    for (constant, omega, amplitude) in
        [(0.0, 1e-3, 1.0), (0.0, 1e-3, 10.0), (0.3, 1e-3, 0.3), (0.3, 1e-3, 10.0), (0.3, 0.01, 1.0)]
    {
        let mut model = oscillator(1.0, 300.0, &[Arc::new(Coulomb { limit: 0.1 })]);
        model.forces = vec![force("m", amplitude, 1), force("m", constant, 0)];
        let system = model.assemble().unwrap();
        let orbit = exact(&system, omega);
        let smooth = Shooting { width: Some(1e-9), ..Shooting::default() };
        let smooth = smooth.solver(&system).unwrap().orbit_near(omega, Some(&orbit.seed())).unwrap();
        close("amplitude", orbit.places[0].amplitude(), smooth.places[0].amplitude(), 1e-3);
        close("loss", orbit.energy.friction, smooth.energy.friction, 1e-2);
    }
}

/// A body that only friction holds drifts under a mean force as soon as it slips, and the error
/// gives the reason. Without slip it stays.
#[test]
fn free_bodies_under_a_mean_force_drift() {
    for law in [Arc::new(Coulomb { limit: 0.1 }) as SharedLaw, Arc::new(Jenkins { stiffness: 2.0, limit: 0.1 })] {
        for damping in [0.0, 0.1, 3.0] {
            for (constant, amplitude) in [(0.03, 1.0), (0.09, 0.3), (0.1, 0.3), (0.3, 0.05), (0.3, 1.0)] {
                let mut model = oscillator(0.0, damping, std::slice::from_ref(&law));
                model.forces = vec![force("m", constant, 0), force("m", amplitude, 1)];
                let system = model.assemble().unwrap();
                let error = EventDriven.solver(&system).unwrap().orbit(1.0).unwrap_err();
                assert_eq!(error.status(), "drifts", "{law:?} {damping} {constant} {amplitude}: {error}");
            }
            let mut model = oscillator(0.0, damping, std::slice::from_ref(&law));
            model.forces = vec![force("m", 0.03, 0), force("m", 0.02, 1)];
            assert!(EventDriven.solver(&model.assemble().unwrap()).unwrap().orbit(0.1).is_ok(), "{law:?} {damping}");
        }
    }
}

/// The method refuses a law that it cannot integrate, and names it.
#[test]
fn a_drop_behind_a_spring_is_refused() {
    #[derive(Debug)]
    struct Dropping;
    impl Law for Dropping {
        fn info(&self) -> &'static LawInfo {
            &MIXED
        }
        fn values(&self) -> Vec<f64> {
            vec![1.0]
        }
        fn is_odd(&self) -> bool {
            true
        }
        fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
            let slider = stickslip::law::Slider { stiffness: Some(2.0), limit: 0.3, static_limit: 0.4 };
            Some(vec![IdealElement::Slider(slider)])
        }
    }
    let system = oscillator(1.0, 0.1, &[Arc::new(Dropping)]).assemble().unwrap();
    let refused = EventDriven.solver(&system).map(|_| ()).unwrap_err().to_string();
    assert!(
        refused.contains("`mixed` of joint `j0`") && refused.contains("has a static limit above its dynamic limit"),
        "{refused}"
    );
}
