//! Several joints: a chain of eight blades, joints that switch at the same instant, and joints
//! listed in another order.

#![allow(clippy::print_stdout)] // tests print measured values

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;
use stickslip::law::{Coulomb, Jenkins, JenkinsArctan, SharedLaw};
use stickslip::method::{Method, event_driven::EventDriven, shooting::Shooting};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring};
use stickslip::orbit::{Orbit, Seed};
use stickslip_verification::{close, exact, near, number, random_model, table};

fn force(on: &str, amplitude: f64, phase: f64) -> Force {
    Force { on: on.into(), amplitude, phase, harmonic: 1 }
}

fn spring(a: &str, b: &str, stiffness: f64, damping: f64) -> Spring {
    Spring { between: [a.into(), b.into()], stiffness, damping }
}

fn joint(name: &str, a: &str, b: &str, law: SharedLaw) -> Joint {
    Joint { name: name.into(), between: [a.into(), b.into()], law }
}

/// Returns the chain of `data/smooth_orbits/chain8.py`: eight mistuned blades, with a joint of
/// a different limit between any two neighbours.
fn chain(forces: &[Force], law: impl Fn(f64) -> SharedLaw) -> Model {
    let blade = |i: usize| format!("blade{i}");
    Model {
        masses: (1..=8).map(|i| Mass::new(blade(i), 0.182)).collect(),
        springs: (1..=8)
            .map(|i| spring(&blade(i), GROUND, 105_103.0 * (1.0 + 0.002 * (i as f64 - 4.5)), 0.2))
            .collect(),
        joints: (1..=7)
            .map(|j| joint(&format!("joint{j}"), &blade(j), &blade(j + 1), law(1.0 + 0.5 * j as f64)))
            .collect(),
        forces: forces.to_vec(),
        ..Model::default()
    }
}

const KT: f64 = 1e4;
const OMEGA: f64 = TAU * 121.3;

fn smooth_law(alpha: f64) -> impl Fn(f64) -> SharedLaw {
    move |limit| Arc::new(JenkinsArctan { stiffness: KT, limit, alpha })
}

fn exact_law(limit: f64) -> SharedLaw {
    Arc::new(Jenkins { stiffness: KT, limit })
}

fn shoot(model: &Model, tolerance: f64) -> Orbit {
    let system = model.assemble().unwrap();
    Shooting { tolerance, width: None, ..Shooting::default() }.solver(&system).unwrap().orbit(OMEGA).unwrap()
}

/// Returns an excitation under which several joints slip: all blades, with the phases of an
/// engine order.
fn travelling(amplitude: f64) -> Vec<Force> {
    (1..=8).map(|i| force(&format!("blade{i}"), amplitude, 1.9 * i as f64)).collect()
}

#[test]
fn chain_of_eight_agrees_with_scipy() {
    let rows = table("smooth_orbits/chain8.csv");
    for drive in [10.0, 60.0] {
        let orbit = shoot(&chain(&[force("blade1", drive, 0.0)], smooth_law(25e3)), 1e-10);
        let (mut worst, mut count) = (0.0f64, 0);
        for row in rows.iter().filter(|row| number(row, "force_N") == drive) {
            let index = row["number"].parse::<usize>().map_or(0, |n| n - 1);
            let expected = number(row, "value");
            let (found, digits) = match row["quantity"].as_str() {
                "blade_amplitude" => (orbit.places[index].amplitude(), 1e-8),
                "joint_loss" => (orbit.joints[index].dissipation, 1e-7),
                "work_in" => (orbit.energy.work_in, 1e-8),
                "viscous_loss" => (orbit.energy.viscous, 1e-8),
                "blade_phase" => (orbit.places[index].phase_deg(), 1e-8),
                _ => continue,
            };
            if row["quantity"] == "joint_loss" && index > 0 {
                // joints that do not slip creep, with losses down to 1e-9 of the work. The
                // creep (multiplier 0.9995) amplifies the residual of the closed orbit, 1e-11,
                // two thousand times; these losses have the digits of the work
                near(&format!("{row:?}"), found, expected, 1e-12 * orbit.energy.work_in + digits * expected);
            } else {
                worst = worst.max((found / expected - 1.0).abs());
                close(&format!("{row:?}"), found, expected, digits);
            }
            count += 1;
        }
        println!("{drive} N: {count} numbers of SciPy, largest relative difference {worst:.1e}");
        assert_eq!(count, 25);
        assert!(orbit.evidence.energy_gap < 1e-8, "{:?}", orbit.evidence);
    }
}

/// Returns the smooth law's state near the exact orbit: in slip the slider moves with the
/// joint, in stick it creeps.
fn start_near(orbit: &Orbit, alpha: f64) -> Vec<f64> {
    let mut start = orbit.initial_state[..16].to_vec();
    for (j, joint) in orbit.sample(0.0).joints.iter().enumerate() {
        let limit = 1.5 + 0.5 * j as f64;
        let slips = joint.force[0].abs() > 0.999 * limit;
        start.push(if slips { alpha * joint.velocity[0] } else { (FRAC_PI_2 * joint.force[0] / limit).tan() }.asinh());
    }
    start
}

/// One joint slips, then four, then all seven. The smooth orbits tend to the exact one with the
/// order alpha^(-2/3), as for the couple.
#[test]
fn chain_of_eight_exact_against_smooth() {
    for (forces, slipping) in [(vec![force("blade1", 10.0, 0.0)], 1), (travelling(4.0), 4), (travelling(20.0), 7)] {
        let reference = exact(&chain(&forces, exact_law).assemble().unwrap(), OMEGA);
        assert_eq!(reference.joints.iter().filter(|joint| joint.slip_fraction > 0.0).count(), slipping);
        assert_eq!(reference.is_stable(), Some(true));
        let losses: f64 = reference.joints.iter().map(|joint| joint.dissipation).sum();
        close("energy balance", reference.energy.work_in, reference.energy.viscous + losses, 1e-9);
        let size = reference.places.iter().map(|place| place.first_harmonic.norm()).fold(0.0, f64::max);
        let distance = |alpha: f64| {
            let system = chain(&forces, smooth_law(alpha)).assemble().unwrap();
            let mut solver = Shooting { tolerance: 1e-8, width: None, ..Shooting::default() }.solver(&system).unwrap();
            let orbit =
                solver.orbit_near(OMEGA, Some(&Seed::from_state(OMEGA, start_near(&reference, alpha)))).unwrap();
            assert!(orbit.evidence.energy_gap < 1e-7 && orbit.evidence.residual < 1e-9, "{:?}", orbit.evidence);
            let pairs = orbit.places.iter().zip(&reference.places);
            pairs.map(|(s, e)| (s.first_harmonic - e.first_harmonic).norm() / size).fold(0.0, f64::max)
        };
        let errors: Vec<f64> = [25e3, 25e4, 25e5].into_iter().map(distance).collect();
        let orders: Vec<f64> = errors.windows(2).map(|pair| (pair[0] / pair[1]).log10()).collect();
        let (switches, gap) = (reference.evidence.switches, reference.evidence.energy_gap);
        println!(
            "{slipping} joints slip, {switches} switches, energy gap {gap:.1e}; alpha 25e3 … 25e5: {errors:?}, {orders:?}"
        );
        assert!(errors[2] < 1e-4);
        for measured in orders {
            near("order", measured, 2.0 / 3.0, 0.05);
        }
    }
}

/// Returns a driven central mass with equal masses around it; an equal joint connects each of
/// them to the centre.
fn star(count: usize, law: &dyn Fn() -> SharedLaw, order: &[usize], turned: &[usize]) -> Model {
    let arm = |i: usize| format!("arm{i}");
    let mut model = Model {
        masses: vec![Mass::new("centre", 1.0)],
        springs: vec![spring("centre", GROUND, 1000.0, 0.5)],
        forces: vec![force("centre", 10.0, 0.3)],
        ..Model::default()
    };
    for i in 0..count {
        model.masses.push(Mass::new(arm(i), 0.5));
        model.springs.push(spring(&arm(i), GROUND, 300.0, 0.2));
    }
    for &i in order {
        let (a, b) = if turned.contains(&i) { (arm(i), "centre".into()) } else { ("centre".into(), arm(i)) };
        model.joints.push(Joint { name: format!("joint{i}"), between: [a, b], law: law() });
    }
    model
}

/// Equal joints switch at the same instants: by symmetry, every switch is a switch of all
/// joints.
#[test]
fn joints_switch_together_by_symmetry() {
    type Make = Box<dyn Fn() -> SharedLaw>;
    let laws: [(&str, Make); 2] = [
        ("coulomb", Box::new(|| Arc::new(Coulomb { limit: 1.2 }))),
        ("jenkins", Box::new(|| Arc::new(Jenkins { stiffness: 800.0, limit: 1.2 }))),
    ];
    for (name, law) in &laws {
        for count in [2, 3] {
            let order: Vec<usize> = (0..count).collect();
            let mut regimes = [0, 0];
            for k in 0..30 {
                let omega = 12.0 + f64::from(k);
                let orbit = exact(&star(count, law, &order, &[1]).assemble().unwrap(), omega);
                let first = &orbit.joints[0];
                let slipping = first.slip_fraction > 0.0;
                regimes[usize::from(slipping && first.slip_fraction < 1.0)] += 1;
                for joint in &orbit.joints {
                    assert_eq!(joint.switches, first.switches, "{name}, {count} arms, {omega} rad/s: {orbit:?}");
                    near("slip fraction", joint.slip_fraction, first.slip_fraction, 1e-12);
                    near("loss", joint.dissipation, first.dissipation, 1e-11 * orbit.energy.work_in);
                }
                assert_eq!(orbit.evidence.switches, count * first.switches);
                // between the switches all contacts have the same state (the reversed joint
                // slips in the other direction)
                let times = orbit.transition_times();
                for pair in times.windows(2).filter(|pair| pair[1] - pair[0] > 1e-9 * orbit.period()) {
                    let joints = orbit.sample(0.5 * (pair[0] + pair[1])).joints;
                    for (i, joint) in joints.iter().enumerate() {
                        let sign = if i == 1 { -1.0 } else { 1.0 };
                        assert_eq!(sign * joint.contact.sign(), joints[0].contact.sign(), "{name}, {omega} rad/s");
                    }
                }
                for pair in times.windows(2) {
                    let gap = pair[1] - pair[0];
                    assert!(
                        !(1e-13 * orbit.period()..1e-9 * orbit.period()).contains(&gap),
                        "{name}, {omega} rad/s: {times:?}"
                    );
                }
                for (a, b) in orbit.places[1..].iter().zip(&orbit.places[2..]) {
                    near("equal arms", a.amplitude(), b.amplitude(), 1e-11 * a.amplitude());
                }
            }
            println!("{name}, {count} arms: {} orbits with stick and slip of 30", regimes[1]);
            assert!(regimes[1] >= 5, "{name}, {count} arms: {regimes:?}");
        }
    }
}

/// The order of the joints in the list has no effect, even with simultaneous switches.
#[test]
fn order_of_listing_does_not_matter() {
    let law = || -> SharedLaw { Arc::new(Coulomb { limit: 1.2 }) };
    for omega in [14.0, 20.0, 25.0, 28.0, 33.0, 40.0] {
        let orbits: Vec<Orbit> = [[0, 1, 2], [2, 1, 0], [1, 2, 0]]
            .iter()
            .map(|order| exact(&star(3, &law, order, &[]).assemble().unwrap(), omega))
            .collect();
        for orbit in &orbits[1..] {
            for (a, b) in orbits[0].places.iter().zip(&orbit.places) {
                close("amplitude", b.amplitude(), a.amplitude(), 1e-12);
            }
            near("loss", orbit.energy.friction, orbits[0].energy.friction, 1e-11 * orbit.energy.work_in);
        }
    }
    // random models with reversed joints: no simultaneous switches, but every decision involves
    // a set of joints
    let (mut compared, mut worst) = (0, 0.0f64);
    for seed in 0..150 {
        let (mut model, omega) = random_model(seed);
        let orbit = EventDriven.solver(&model.assemble().unwrap()).unwrap().orbit(omega);
        model.joints.reverse();
        let reversed = EventDriven.solver(&model.assemble().unwrap()).unwrap().orbit(omega);
        let (Ok(orbit), Ok(reversed)) = (orbit, reversed) else { continue };
        if model.joints.len() < 2 || orbit.is_in_continuum() {
            continue; // the offset of a stuck joint is free
        }
        compared += 1;
        let size = orbit.places.iter().map(|place| place.amplitude()).fold(0.0, f64::max);
        for (a, b) in orbit.places.iter().zip(&reversed.places) {
            worst = worst.max((a.amplitude() - b.amplitude()).abs() / size);
        }
    }
    println!("{compared} random models with their joints listed backwards, largest difference {worst:.1e}");
    assert!(compared > 20 && worst < 1e-9, "{worst}");
}

/// Opposite forces pull two blades apart from a central one. The centre stays at rest, and both
/// joints switch together.
#[test]
fn opposite_drives_leave_the_centre_at_rest() {
    let mut model = star(2, &|| Arc::new(Coulomb { limit: 1.2 }), &[0, 1], &[]);
    model.forces = vec![force("arm0", 4.0, 0.0), force("arm1", -4.0, 0.0)];
    for omega in [15.0, 20.0, 30.0] {
        let orbit = exact(&model.assemble().unwrap(), omega);
        assert!(orbit.joints[0].slip_fraction > 0.0);
        assert_eq!(orbit.joints[0].switches, orbit.joints[1].switches);
        near("centre", orbit.places[0].amplitude(), 0.0, 1e-12 * orbit.places[1].amplitude());
        close("equal losses", orbit.joints[0].dissipation, orbit.joints[1].dissipation, 1e-12);
        // a single arm that rubs on the ground has the same motion
        let alone = Model {
            masses: vec![Mass::new("arm", 0.5)],
            springs: vec![spring("arm", GROUND, 300.0, 0.2)],
            joints: vec![joint("rub", "arm", GROUND, Arc::new(Coulomb { limit: 1.2 }))],
            forces: vec![force("arm", 4.0, 0.0)],
            ..Model::default()
        };
        let single = exact(&alone.assemble().unwrap(), omega);
        close("amplitude", orbit.places[1].amplitude(), single.places[0].amplitude(), 1e-10);
        close("loss", orbit.joints[0].dissipation, single.joints[0].dissipation, 1e-10);
    }
}
