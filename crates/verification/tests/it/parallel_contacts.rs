//! Contacts with proportional motions in harmonic balance: they act as one contact with the sum
//! of their forces, and each carries its share.

use nalgebra::{DMatrix, dmatrix};
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::curve::continuation::BranchContinuation;
use stickslip::curve::modes::{ModeRequest, nonlinear_mode};
use stickslip::law::{Coulomb, Coulomb2d, CoulombArctan, Jenkins, JenkinsArctan, SharedLaw, Stribeck};
use stickslip::method::Method;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::model::{
    Axis, Disk, Force, GROUND, Joint, Mass, Model, SectorDistribution, Spring, System, SystemBuilder,
};
use stickslip::orbit::{Accuracy, Orbit};
use stickslip::structure::Structure;
use stickslip_verification::{close, exact, near};

/// A contact with its law; its motion is this factor times the motion along the first axes.
type Contact = (f64, SharedLaw);

/// Relative difference of two solutions of equations that agree up to rounding. Both are solved
/// to 1e-10, and the structures are near resonance.
const SOLVED: f64 = 1e-8;

fn balance(harmonics: usize) -> HarmonicBalance {
    HarmonicBalance { harmonics: Some(harmonics), ..HarmonicBalance::default() }
}

fn orbit(method: &dyn Method, system: &System, omega: f64) -> Orbit {
    method.solver(system).unwrap().orbit(omega).unwrap()
}

/// Returns three coordinates with full matrices under a force, with natural frequencies of
/// about 0.8, 1.3 and 1.8 rad/s.
fn structure(amplitude: f64) -> SystemBuilder {
    let stiffness = dmatrix![1.9, -0.5, 0.1; -0.5, 1.6, -0.4; 0.1, -0.4, 1.4];
    let mass = dmatrix![1.0, 0.2, 0.0; 0.2, 0.9, 0.1; 0.0, 0.1, 0.8];
    let names = ["p", "q", "r"].map(str::to_owned).to_vec();
    let structure = Structure::new(names, mass, &stiffness * 0.02, stiffness).unwrap();
    System::builder(structure).force(0, 1, Complex64::from_polar(amplitude, 0.4)).force(
        2,
        1,
        Complex64::from(0.3 * amplitude),
    )
}

const LINE: [(usize, f64); 2] = [(0, 1.0), (2, -0.7)];
const ACROSS: [(usize, f64); 2] = [(1, 1.0), (2, 0.4)];

/// Returns a multiple of an axis; a negative factor also reverses the order of its rows.
fn along(factor: f64, rows: &[(usize, f64)]) -> Axis {
    let mut rows: Vec<(usize, f64)> = rows.iter().map(|(row, weight)| (*row, factor * weight)).collect();
    if factor < 0.0 {
        rows.reverse();
    }
    Axis::new(rows)
}

/// Returns the structure with these contacts and two other joints among them.
fn system(amplitude: f64, contacts: &[Contact]) -> System {
    let mut builder = structure(amplitude);
    let others: [SharedLaw; 2] = [Arc::new(Jenkins { stiffness: 0.5, limit: 0.1 }), Arc::new(Coulomb { limit: 0.05 })];
    for (j, (factor, law)) in contacts.iter().enumerate() {
        let axes = [LINE, ACROSS][..law.directions()].iter().map(|rows| along(*factor, rows)).collect();
        builder = builder.joint(format!("j{j}"), law.clone(), axes);
        if let Some(other) = others.get(j) {
            // the elastic one acts on the same line, the rigid one on another
            let rows: &[(usize, f64)] = if j == 0 { &LINE } else { &[(1, 1.0)] };
            builder = builder.joint(format!("other{j}"), other.clone(), vec![along(1.0, rows)]);
        }
    }
    if contacts.len() == 1 {
        builder = builder.joint("other1", others[1].clone(), vec![along(1.0, &[(1, 1.0)])]);
    }
    builder.build().unwrap()
}

/// Asserts that several contacts act as one: equal motions, and for each joint its share of
/// force and loss. `shares` holds the factor of the motion and the force per force of the
/// single contact. Returns the stick fraction.
fn one_for_all(what: &str, [many, one]: [&System; 2], (harmonics, omega): (usize, f64), shares: &[(f64, f64)]) -> f64 {
    let method = balance(harmonics);
    let (many, one) = (orbit(&method, many, omega), orbit(&method, one, omega));
    assert!(many.evidence.residual <= 1e-10, "{what}: {}", many.evidence.residual);
    assert!(many.evidence.iterations <= one.evidence.iterations + 2, "{what}: {}", many.evidence.iterations);
    for (many, one) in many.places.iter().zip(&one.places) {
        close(&format!("{what}: amplitude"), many.amplitude(), one.amplitude(), SOLVED);
    }
    let (whole, lost) = (&one.joints[0], one.energy.work_in);
    let whole_sticks = whole.stick_fraction;
    let mine: Vec<usize> = (0..many.joints.len()).filter(|j| many.joints[*j].name.starts_with('j')).collect();
    for (&j, (factor, share)) in mine.iter().zip(shares) {
        let joint = &many.joints[j];
        near(
            &format!("{what}: loss of {}", joint.name),
            joint.dissipation,
            factor * share * whole.dissipation,
            SOLVED * lost,
        );
        near(&format!("{what}: stick of {}", joint.name), joint.stick_fraction, whole.stick_fraction, 1e-12);
    }
    let sum: f64 = mine.iter().map(|&j| many.joints[j].dissipation).sum();
    near(&format!("{what}: loss"), sum, whole.dissipation, SOLVED * lost);
    let largest = |orbit: &Orbit, a: usize| {
        (0..32).map(|i| orbit.sample(orbit.period() * i as f64 / 32.0).joints[0].force[a].abs()).fold(0.0, f64::max)
    };
    for step in 0..16 {
        // instants that are no samples of the series
        let time = (f64::from(step) + 0.37) / 16.0 * TAU / omega;
        let (now, whole) = (many.sample(time), &one.sample(time).joints[0]);
        for (&j, (factor, share)) in mine.iter().zip(shares) {
            for a in 0..one.joints[0].displacement.len() {
                let force = now.joints[j].force[a];
                near(
                    &format!("{what}: force {j}.{a}"),
                    force,
                    share * whole.force[a],
                    1e-7 * share.abs() * largest(&one, a),
                );
                let velocity = now.joints[j].velocity[a];
                near(&format!("{what}: velocity {j}.{a}"), velocity, factor * whole.velocity[a], SOLVED);
            }
        }
    }
    whole_sticks
}

fn coulomb(limit: f64) -> SharedLaw {
    Arc::new(Coulomb { limit })
}

/// Rigid contacts along one line: reversed, with levers, and of very different sizes.
#[test]
fn rigid_contacts_along_one_line_are_one() {
    let cases: [(&str, &[(f64, f64)]); 4] = [
        ("quarters", &[(1.0, 0.25), (1.0, 0.25), (1.0, 0.25), (1.0, 0.25)]),
        ("reversed", &[(1.0, 0.3), (-1.0, 0.5), (1.0, 0.2)]),
        ("levers", &[(1.0, 0.2), (-2.0, 0.1), (0.3, 1.0), (-1.7, 0.2)]),
        ("tiny beside large", &[(1.0, 1e-9), (1.0, 3.0), (-1.0, 1e-3)]),
    ];
    for (what, contacts) in cases {
        let sum: f64 = contacts.iter().map(|(factor, limit)| factor.abs() * limit).sum();
        let shares: Vec<(f64, f64)> =
            contacts.iter().map(|(factor, limit)| (*factor, factor.signum() * limit / sum)).collect();
        let list: Vec<Contact> = contacts.iter().map(|(factor, limit)| (*factor, coulomb(*limit))).collect();
        // at two resonances: almost permanent slip, stick and slip, and permanent stick
        for (amplitude, omega, sticks) in
            [(12.0, 1.31, 0.0..0.1), (4.0, 1.31, 0.1..0.9), (1.4, 1.9, 0.0..0.1), (1.5, 0.83, 1.0..2.0)]
        {
            let systems = [&list[..], &[(1.0, coulomb(sum))]].map(|contacts| system(amplitude * sum, contacts));
            let found = one_for_all(&format!("{what}, {amplitude}"), [&systems[0], &systems[1]], (31, omega), &shares);
            assert!(sticks.contains(&found), "{what}, {amplitude}: sticks {found}");
        }
    }
}

/// The exact method gives the same shares, within the error of the series.
#[test]
fn the_exact_method_shares_alike() {
    let contacts = [(1.0, 0.2), (-2.0, 0.1), (0.3, 1.0)].map(|(factor, limit)| (factor, coulomb(limit)));
    let many = system(3.0, &contacts);
    let (found, expected) = (orbit(&HarmonicBalance::default(), &many, 1.31), exact(&many, 1.31));
    assert_eq!(found.evidence.accuracy, Accuracy::Converged);
    let error = 3.0 * found.evidence.error_estimate.unwrap();
    for (a, b) in found.joints.iter().zip(&expected.joints) {
        near(&a.name, a.dissipation, b.dissipation, error * expected.energy.work_in);
    }
    assert!(expected.joints[0].dissipation > 0.01 * expected.energy.work_in, "a test without slip tests nothing");
}

/// Other laws of velocity with proportional forces: in a plane, steep, falling, and behind
/// springs.
#[test]
fn laws_of_velocity_that_are_multiples_are_one() {
    /// A law with its usual forces times a factor.
    type OfSize = fn(f64) -> SharedLaw;
    let cases: [(&str, OfSize); 5] = [
        ("coulomb-2d", |share| Arc::new(Coulomb2d { limit: 0.7 * share })),
        ("coulomb-arctan", |share| Arc::new(CoulombArctan { limit: 0.7 * share, alpha: 30.0 })),
        ("jenkins-arctan", |share| Arc::new(JenkinsArctan { stiffness: 4.0 * share, limit: 0.7 * share, alpha: 30.0 })),
        ("stribeck", |share| Arc::new(Stribeck { limit: 0.6 * share, static_limit: 0.7 * share, velocity: 0.8 })),
        ("coulomb", |share| coulomb(0.7 * share)),
    ];
    for (what, law) in cases {
        for shares in [&[0.5, 0.5][..], &[0.1, 0.7, 0.2]] {
            let signed = |i: usize, share: f64| if i % 2 == 1 { (-1.0, -share) } else { (1.0, share) };
            let shares: Vec<(f64, f64)> = shares.iter().enumerate().map(|(i, share)| signed(i, *share)).collect();
            let contacts: Vec<Contact> = shares.iter().map(|(factor, share)| (*factor, law(share.abs()))).collect();
            let [many, one] = [&contacts[..], &[(1.0, law(1.0))]].map(|contacts| system(3.0, contacts));
            let sticks = one_for_all(&format!("{what}, {}", shares.len()), [&many, &one], (9, 1.31), &shares);
            assert!(sticks < 0.99, "{what}: a test without slip tests nothing");
        }
    }
}

/// A contact whose force is not a multiple of the other one keeps its own force. This includes
/// a faster motion if the force depends on velocity.
#[test]
fn what_differs_is_not_shared() {
    let law = |limit: f64, alpha: f64| -> SharedLaw { Arc::new(CoulombArctan { limit, alpha }) };
    let of = |contacts: &[Contact]| orbit(&balance(15), &system(3.0, contacts), 1.31);
    // twice the velocity is equivalent to a law that is twice as steep
    let (lever, steeper) =
        (of(&[(1.0, law(0.3, 5.0)), (2.0, law(0.1, 5.0))]), of(&[(1.0, law(0.3, 5.0)), (1.0, law(0.2, 10.0))]));
    for (a, b) in lever.places.iter().zip(&steeper.places) {
        close("amplitude", a.amplitude(), b.amplitude(), SOLVED);
    }
    near("loss", lever.joints[2].dissipation, steeper.joints[2].dissipation, SOLVED * lever.energy.work_in);
}

/// Modes without excitation: four parts of a contact, some reversed, have the frequency and the
/// damping of the whole.
#[test]
fn modes_are_those_of_the_one() {
    let parts = [(1.0, 0.25), (-1.0, 0.25), (2.0, 0.0625), (0.5, 0.75)].map(|(factor, limit)| (factor, coulomb(limit)));
    let request = ModeRequest { mode: 0, range: (0.3, 30.0), points: 15, harmonics: 9, samples: 1024 };
    let [many, one] =
        [&parts[..], &[(1.0, coulomb(1.0))]].map(|contacts| nonlinear_mode(&system(0.0, contacts), request).unwrap());
    assert_eq!((many.ended, many.points.len()), (None, 15));
    for (many, one) in many.points.iter().zip(&one.points) {
        close("frequency", many.omega, one.omega, SOLVED);
        close("damping", many.damping, one.damping, SOLVED);
    }
    let damping = |i: usize| one.points[i].damping;
    assert!((0..15).map(damping).fold(0.0, f64::max) > 0.05, "a test without slip tests nothing");
}

/// Branches along frequency have the same points, with the shares.
#[test]
fn branches_are_those_of_the_one() {
    let parts = [(1.0, 0.35), (-2.0, 0.15), (1.0, 0.35)].map(|(factor, limit)| (factor, coulomb(limit)));
    let follow = |contacts: &[Contact]| {
        let system = system(4.0, contacts);
        BranchContinuation {
            system_at: &|omega| (system.clone(), omega),
            method: balance(9),
            range: (0.6, 1.6),
            step: 0.1,
            quantity: &|orbit: &Orbit| orbit.places[0].amplitude(),
        }
        .branch()
        .unwrap()
    };
    let (many, one) = (follow(&parts), follow(&[(1.0, coulomb(1.0))]));
    assert_eq!(many.end, one.end);
    assert_eq!(many.points.len(), one.points.len());
    for (many, one) in many.peaks.iter().zip(&one.peaks) {
        close("peak at", many.0, one.0, 1e-6);
        close("peak", many.1, one.1, SOLVED);
    }
}

fn between(a: &str, b: &str) -> [String; 2] {
    [a.to_owned(), b.to_owned()]
}

/// Returns a ring of blades with these contacts between neighbours, under a travelling wave.
fn ring(sectors: usize, contacts: &[(bool, f64)]) -> Model {
    let spring =
        |a: &str, b: &str, stiffness: f64| Spring { between: between(a, b), stiffness, damping: 0.01 * stiffness };
    let joint = |(i, (turned, limit)): (usize, &(bool, f64))| {
        let between = if *turned { between("next.blade", "blade") } else { between("blade", "next.blade") };
        Joint { name: format!("shroud{i}"), between, law: coulomb(*limit) }
    };
    let sector = Model {
        masses: vec![Mass::new("disk", 2.0), Mass::new("blade", 0.3)],
        springs: vec![spring("disk", GROUND, 30.0), spring("disk", "next.disk", 20.0), spring("blade", "disk", 3.0)],
        joints: contacts.iter().enumerate().map(joint).collect(),
        forces: vec![Force { on: "blade".into(), amplitude: 1.0, phase: 0.3, harmonic: 1 }],
        ..Model::default()
    };
    let disk = Disk { sectors, forces: vec![SectorDistribution::EngineOrder(1)], motions: Vec::new() };
    disk.ring(|_| sector.clone()).unwrap()
}

/// Parallel contacts in a travelling wave, and on the whole ring without the information on its
/// symmetry.
///
/// In a ring of two sectors, the contacts of both sectors lie along one line, so the whole ring
/// groups them. The penalty per force then differs by a factor of two from the wave, and the
/// results differ by the truncation error.
#[test]
fn rings_with_contacts_side_by_side() {
    let parts = [(false, 0.1), (true, 0.06), (false, 0.04)];
    for sectors in [2, 6] {
        let of = |contacts: &[(bool, f64)], wave: bool| {
            let mut model = ring(sectors, contacts);
            model.ring = model.ring.filter(|_| wave);
            let method =
                HarmonicBalance { harmonics: Some(9), samples: Some(sectors * 128), ..HarmonicBalance::default() };
            orbit(&method, &model.assemble().unwrap(), 3.05)
        };
        let one = of(&[(false, 0.2)], true);
        assert!(one.joints[0].dissipation > 1e-3, "a test without slip tests nothing");
        for wave in [true, false] {
            let many = of(&parts, wave);
            let error = if wave || sectors > 2 { SOLVED } else { one.evidence.error_estimate.unwrap() };
            for (a, b) in many.places.iter().zip(&one.places) {
                close(&format!("{sectors} sectors, wave {wave}: amplitude"), a.amplitude(), b.amplitude(), error);
            }
            for (s, whole) in one.joints.iter().enumerate() {
                for (joint, (_, limit)) in many.joints[s * parts.len()..].iter().zip(parts) {
                    let expected = limit / 0.2 * whole.dissipation;
                    near(
                        &format!("{sectors} sectors, {}", joint.name),
                        joint.dissipation,
                        expected,
                        error * whole.dissipation,
                    );
                }
            }
        }
    }
}

/// Two equal planes of rigid friction with automatic harmonics converge. Grouping determines
/// the force of each, which the equations leave free.
#[test]
fn planes_side_by_side_converge_by_themselves() {
    let one = |value: f64| DMatrix::identity(2, 2) * value;
    let structure =
        Structure::new(vec!["x".into(), "y".into()], one(1.0), one(0.1), dmatrix![1.0, 0.2; 0.2, 1.3]).unwrap();
    let of = |limits: &[f64]| {
        let mut builder =
            System::builder(structure.clone()).force(0, 1, Complex64::ONE).force(1, 1, Complex64::new(0.3, 0.5));
        for (j, limit) in limits.iter().enumerate() {
            let axes = vec![Axis::new(vec![(0, 1.0)]), Axis::new(vec![(1, 1.0)])];
            builder = builder.joint(format!("j{j}"), Arc::new(Coulomb2d { limit: *limit }), axes);
        }
        orbit(&HarmonicBalance::default(), &builder.build().unwrap(), 1.05)
    };
    let (many, one) = (of(&[0.25, 0.25]), of(&[0.5]));
    assert_eq!(many.evidence.accuracy, Accuracy::Converged);
    assert!(one.joints[0].dissipation > 0.1 * one.energy.work_in, "a test without slip tests nothing");
    for (a, b) in many.places.iter().zip(&one.places) {
        close("amplitude", a.amplitude(), b.amplitude(), SOLVED);
    }
    near("loss", many.joints[1].dissipation, 0.5 * one.joints[0].dissipation, SOLVED * one.joints[0].dissipation);
}
