//! Bladed disks: one sector with phase-shifted harmonics against the whole ring, against closed
//! forms, and under aliased engine orders.

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use stickslip::law::{Coulomb, FrictionContact, Gap, Jenkins, JenkinsArctan, SharedLaw};
use stickslip::method::event_driven::EventDriven;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::shooting::Shooting;
use stickslip::method::transient::Transient;
use stickslip::model::{Disk, SectorDistribution, normal_deviations};
use stickslip::{Force, GROUND, Joint, Mass, Method, Model, Orbit, Spring};
use stickslip_verification::close;
use stickslip_verification::newmark_reference::Reference;

fn between(a: &str, b: &str) -> [String; 2] {
    [a.to_owned(), b.to_owned()]
}

fn spring(a: &str, b: &str, stiffness: f64, damping: f64) -> Spring {
    Spring { between: between(a, b), stiffness, damping }
}

fn force(on: &str, amplitude: f64, harmonic: u32) -> Force {
    Force { on: on.to_owned(), amplitude, phase: 0.3, harmonic }
}

/// Returns a blade on its disk sector. Springs connect the sector to the next one, a joint
/// connects neighbouring blades.
fn sector(law: SharedLaw) -> Model {
    Model {
        masses: vec![Mass::new("disk", 2.0), Mass::new("blade", 0.3)],
        springs: vec![
            spring("disk", GROUND, 30.0, 0.01),
            spring("disk", "next.disk", 20.0, 0.02),
            spring("blade", "disk", 3.0, 0.01),
        ],
        joints: vec![Joint { name: "shroud".into(), between: between("blade", "next.blade"), law }],
        forces: vec![force("blade", 1.0, 1)],
        ..Model::default()
    }
}

fn ring(sector: &Model, sectors: usize, forces: &[SectorDistribution]) -> Model {
    let disk = Disk { sectors, forces: forces.to_vec(), motions: Vec::new() };
    disk.ring(|_| sector.clone()).unwrap()
}

/// Returns the same ring without the information on its symmetry.
fn whole(mut model: Model) -> Model {
    model.ring = None;
    model
}

fn orbit(model: &Model, method: &dyn Method, omega: f64) -> Orbit {
    method.solver(&model.assemble().unwrap()).unwrap().orbit(omega).unwrap()
}

/// Returns the largest difference of two orbits: amplitudes relative to the largest amplitude,
/// losses relative to the largest loss or to 1 N times the largest amplitude.
fn distance(a: &Orbit, b: &Orbit) -> f64 {
    let size = b.places.iter().fold(0.0f64, |m, place| m.max(place.amplitude()));
    let loss = b.joints.iter().fold(size * 1.0, |m, joint| m.max(joint.dissipation));
    let places =
        a.places.iter().zip(&b.places).map(|(a, b)| {
            (a.amplitude() - b.amplitude()).abs().max((a.first_harmonic - b.first_harmonic).norm()) / size
        });
    let joints = a.joints.iter().zip(&b.joints).map(|(a, b)| (a.dissipation - b.dissipation).abs() / loss);
    assert_eq!((a.places.len(), a.joints.len()), (b.places.len(), b.joints.len()));
    places.chain(joints).fold(0.0, f64::max)
}

/// Theory 12: harmonic balance of one sector with phase-shifted harmonics equals that of the
/// full ring.
#[test]
fn a_tuned_sector_is_the_full_ring() {
    let laws: [SharedLaw; 4] = [
        Arc::new(Jenkins { stiffness: 1.0, limit: 0.4 }),
        Arc::new(Coulomb { limit: 0.2 }),
        Arc::new(JenkinsArctan { stiffness: 1.0, limit: 0.4, alpha: 0.5 }),
        Arc::new(Gap { gap: 0.3, stiffness: 0.1 }),
    ];
    for (sectors, order, omega) in [(7, 2, 3.05), (8, -3, 3.3), (6, 3, 3.2), (24, 5, 3.1)] {
        // some laws are sampled: the sectors agree to the last digit only if the lag is a whole
        // number of samples
        let samples = Some(sectors * 128);
        let balance = HarmonicBalance { harmonics: Some(9), samples, ..HarmonicBalance::default() };
        for law in &laws {
            let model = ring(&sector(law.clone()), sectors, &[SectorDistribution::EngineOrder(order)]);
            let one = orbit(&model, &balance, omega);
            let all = orbit(&whole(model), &balance, omega);
            let apart = distance(&one, &all);
            // both residuals are below 1e-10
            assert!(apart < 1e-9, "{} sectors, order {order}, {}: {apart:.1e}", sectors, law.name());
            assert!(one.evidence.energy_gap < 1e-8);
            let slips = one.joints.iter().all(|joint| joint.dissipation > 1e-3);
            assert!(slips || law.name() == "gap", "{}: a test without slip tests nothing", law.name());
        }
    }
}

/// A sector with preload, two directions and several harmonics of excitation equals its ring.
#[test]
fn a_sector_with_normal_contact_is_its_ring() {
    let law = FrictionContact { tangential: 2.0, normal: 3.0, friction: 0.3, preload: 0.6, tangents: 1 };
    let sector = Model {
        masses: vec![Mass::new("blade", 0.3).along(&["x", "z"])],
        springs: vec![
            spring("blade.x", GROUND, 3.0, 0.02),
            spring("blade.z", GROUND, 4.0, 0.02),
            spring("blade.x", "next.blade.z", 0.2, 0.0),
        ],
        joints: vec![Joint { name: "shroud".into(), between: between("blade", "next.blade"), law: Arc::new(law) }],
        forces: vec![force("blade.x", 0.3, 1), force("blade.z", 0.1, 2), force("blade.z", 0.2, 0)],
        ..Model::default()
    };
    let orders =
        [SectorDistribution::EngineOrder(2), SectorDistribution::EngineOrder(4), SectorDistribution::EngineOrder(0)];
    let balance = HarmonicBalance { harmonics: Some(7), samples: Some(9 * 64), ..HarmonicBalance::default() };
    let model = ring(&sector, 9, &orders);
    assert_eq!(model.ring.unwrap().order, Some(2));
    for omega in [2.9, 3.6] {
        let apart = distance(&orbit(&model, &balance, omega), &orbit(&whole(model.clone()), &balance, omega));
        assert!(apart < 1e-10, "{apart:.1e}");
    }
}

/// Time integrations do not use the travelling wave. They integrate the ring, and find the
/// wave.
#[test]
fn methods_in_time_find_the_wave() {
    let balance = HarmonicBalance { harmonics: Some(63), ..HarmonicBalance::default() };
    let exact =
        ring(&sector(Arc::new(Jenkins { stiffness: 1.0, limit: 0.4 })), 5, &[SectorDistribution::EngineOrder(1)]);
    let apart = distance(&orbit(&exact, &balance, 3.1), &orbit(&exact, &EventDriven, 3.1));
    assert!(apart < 1e-6, "{apart:.1e}");
    let law = JenkinsArctan { stiffness: 1.0, limit: 0.4, alpha: 0.5 };
    let smooth = ring(&sector(Arc::new(law)), 4, &[SectorDistribution::EngineOrder(1)]);
    let shooting = Shooting { tolerance: 1e-9, ..Shooting::default() };
    let apart = distance(&orbit(&smooth, &balance, 3.1), &orbit(&smooth, &shooting, 3.1));
    assert!(apart < 1e-5, "{apart:.1e}");
}

/// The engine orders e and e + N give the same excitation; -e gives its mirror image.
#[test]
fn engine_orders_alias() {
    let balance = HarmonicBalance { harmonics: Some(7), ..HarmonicBalance::default() };
    let law: SharedLaw = Arc::new(Jenkins { stiffness: 1.0, limit: 0.4 });
    let find = |order| orbit(&ring(&sector(law.clone()), 24, &[SectorDistribution::EngineOrder(order)]), &balance, 3.1);
    let (first, same, back) = (find(5), find(29), find(-19));
    for other in [&same, &back] {
        assert!(first.places.iter().zip(&other.places).all(|(a, b)| a == b), "to the last bit");
    }
    let mirrored = find(-5);
    for s in 0..24 {
        let (a, b) = (&first.places[2 * s + 1], &mirrored.places[2 * ((24 - s) % 24) + 1]);
        assert!((a.amplitude() - b.amplitude()).abs() < 1e-10 * a.amplitude());
        assert!((a.first_harmonic - b.first_harmonic).norm() < 1e-10 * a.amplitude());
    }
    // linear: order e excites the nodal diameter n alone if and only if e = jN ± n
    let free = Model { joints: Vec::new(), ..sector(law.clone()) };
    for (order, diameter) in [(3, 3), (21, 3), (27, 3), (45, 3), (12, 12), (25, 1)] {
        let orbit = orbit(&ring(&free, 24, &[SectorDistribution::EngineOrder(order)]), &EventDriven, 3.1);
        for n in 0..=12 {
            let share: Complex64 = (0..24)
                .map(|s| {
                    let shape = |sign: f64| Complex64::cis(sign * TAU * f64::from(n) * s as f64 / 24.0);
                    let x = orbit.places[2 * s + 1].first_harmonic;
                    x * shape(1.0).conj() + Complex64::new(0.0, 1.0) * x * shape(-1.0).conj()
                })
                .sum();
            let size = 24.0 * orbit.places[1].first_harmonic.norm();
            assert!((share.norm() > 0.5 * size) == (n == diameter), "order {order}, diameter {n}: {}", share.norm());
            assert!(n == diameter || share.norm() < 1e-10 * size);
        }
    }
}

/// Returns undamped blades of 1 kg and 1 N/m with a damper between neighbours.
fn dampers(stiffness: f64, limit: f64, load: f64) -> Model {
    Model {
        masses: vec![Mass::new("blade", 1.0)],
        springs: vec![spring("blade", GROUND, 1.0, 0.0)],
        joints: vec![Joint {
            name: "damper".into(),
            between: between("blade", "next.blade"),
            law: Arc::new(Jenkins { stiffness, limit }),
        }],
        forces: vec![force("blade", load, 1)],
        ..Model::default()
    }
}

/// Returns the largest amplitude of the first place between two frequencies (rad/s) by harmonic
/// balance.
fn largest(model: &Model, harmonics: usize, [mut low, mut high]: [f64; 2]) -> f64 {
    let system = model.assemble().unwrap();
    let balance = HarmonicBalance { harmonics: Some(harmonics), ..HarmonicBalance::default() };
    let mut solver = balance.solver(&system).unwrap();
    let mut at = |omega: f64| solver.orbit(omega).unwrap().places[0].amplitude();
    for _ in 0..60 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(a) < at(b) { low = a } else { high = b }
    }
    at(0.5 * (low + high))
}

/// Theory (10.5): dampers between the blades of a tuned disk, one harmonic, no viscous damping.
/// The optimal limit is `π F0/(4 sin(θ/2))`; the amplitude there is `π F0/(4 kd sin²(θ/2))`.
#[test]
fn eq10_5_optimum_of_dampers_between_blades() {
    let (sectors, diameter, stiffness, load) = (24, 3, 0.2, 1.0);
    let half = PI * diameter as f64 / sectors as f64; // θ/2
    let best = PI * load / (4.0 * half.sin());
    let amplitude = PI * load / (4.0 * stiffness * half.sin().powi(2));
    assert!((best - 2.052_344_3).abs() < 1e-7 && (amplitude - 26.815_170_6).abs() < 1e-7, "{best} {amplitude}");
    // peak: phase resonance at `ω² = k + 4 sin²(θ/2) Re K_J(2 A sin(θ/2))`, evaluated at the
    // optimal limit and near it
    let peak = |limit: f64| {
        let system = ring(&dampers(stiffness, limit, load), sectors, &[SectorDistribution::EngineOrder(diameter)]);
        largest(&system, 1, [1.0, 1.06])
    };
    let found = peak(best);
    assert!((found / amplitude - 1.0).abs() < 1e-7, "{found} {amplitude}");
    for limit in [0.97 * best, 1.03 * best] {
        assert!(peak(limit) > amplitude * (1.0 + 1e-5));
    }
}

/// Theory (10.5) in time, from rest: at the optimum the settled motion has the amplitude of the
/// closed form within 0.2 %.
///
/// References are method `transient` and small steps without any method of the library. More
/// harmonics give the part that one harmonic lacks, but no larger peak. The 24 sectors under
/// engine order 3 are three rings of 8 sectors under engine order 1, with the same θ.
#[test]
fn eq10_5_optimum_in_time() {
    const ONE_TERM: f64 = 2e-3;
    const SETTLED: f64 = 1e-7;
    // remaining wave in the opposite direction after this number of periods; friction hardly
    // damps it. It raises one blade and lowers another by the same amount
    const PERIODS: usize = 300;
    const OTHER_WAVE: f64 = 5e-3;
    // the square of that wave, and the error of 1000 steps per period
    const SMALL_STEPS: f64 = 1e-4;
    let (sectors, stiffness, load) = (8, 0.2, 1.0);
    let half = PI / f64::from(sectors);
    let best = PI * load / (4.0 * half.sin());
    let amplitude = PI * load / (4.0 * stiffness * half.sin().powi(2));
    let omega = (1.0 + 2.0 * stiffness * half.sin().powi(2)).sqrt();
    let model = ring(&dampers(stiffness, best, load), sectors as usize, &[SectorDistribution::EngineOrder(1)]);
    let waited = orbit(&model, &Transient::default(), omega);
    let balance = HarmonicBalance { harmonics: Some(63), ..HarmonicBalance::default() };
    let balanced = orbit(&model, &balance, omega);
    let system = model.assemble().unwrap();
    let rest = vec![0.0; system.dofs()];
    let (stepped, _) = Reference::new(&system, omega, 1000, &rest, &rest).settle(PERIODS, 0.0);
    for (blade, stepped) in stepped.iter().enumerate() {
        let found = waited.places[blade].amplitude();
        close("waited for", found, amplitude, ONE_TERM);
        close("63 harmonics", balanced.places[blade].amplitude(), found, SETTLED);
        close("small steps, with the other wave", *stepped, found, OTHER_WAVE);
    }
    let mean = stepped.iter().sum::<f64>() / f64::from(sectors);
    close("small steps", mean, waited.places[0].amplitude(), SMALL_STEPS);
    // the peak over all frequencies
    close("peak", largest(&model, 63, [1.0, 1.06]), amplitude, ONE_TERM);
}

/// Theory (10.5) at θ = 0: blades in phase do not rub, at any limit. Their amplitude is that of
/// a single blade, `F0/|k - m ω²|`.
#[test]
fn eq10_5_engine_order_zero_is_not_damped() {
    for limit in [1e-3, 1.0, 1e3] {
        let system = ring(&dampers(0.2, limit, 1.0), 6, &[SectorDistribution::EngineOrder(0)]);
        for omega in [0.7, 0.99, 1.3] {
            let alone = 1.0 / (1.0f64 - omega * omega).abs();
            for method in [&HarmonicBalance::default() as &dyn Method, &EventDriven] {
                let found = orbit(&system, method, omega);
                for place in &found.places {
                    assert!((place.amplitude() / alone - 1.0).abs() < 1e-10, "{limit} {omega}: {place:?} {alone}");
                }
                assert!(found.joints.iter().all(|joint| joint.dissipation.abs() < 1e-12 * alone), "{limit} {omega}");
            }
        }
    }
}

/// Theory (10.5) for a couple with one joint in anti-phase under `F0` on each blade: stiffness
/// `k + 2 K_J`. The optimal limit is `π F0/2`, and the amplitude there is `π F0/(2 kd)`.
#[test]
fn eq10_5_couple_in_anti_phase() {
    let (stiffness, load) = (0.2, 1.0);
    let (best, amplitude) = (PI * load / 2.0, PI * load / (2.0 * stiffness));
    assert!((amplitude - 7.853_981_4).abs() < 1e-6, "{amplitude}");
    let peak = |limit: f64| {
        let opposed = Force { phase: 0.3 + PI, ..force("b", load, 1) };
        let couple = Model {
            masses: vec![Mass::new("a", 1.0), Mass::new("b", 1.0)],
            springs: vec![spring("a", GROUND, 1.0, 0.0), spring("b", GROUND, 1.0, 0.0)],
            joints: vec![Joint {
                name: "damper".into(),
                between: between("a", "b"),
                law: Arc::new(Jenkins { stiffness, limit }),
            }],
            forces: vec![force("a", load, 1), opposed],
            ..Model::default()
        };
        // between the free frequency and the stuck one, `√(1 + 2 kd)`; both are undamped
        largest(&couple, 1, [1.04, 1.14])
    };
    let found = peak(best);
    assert!((found / amplitude - 1.0).abs() < 1e-7, "{found} {amplitude}");
    for limit in [0.97 * best, 1.03 * best] {
        assert!(peak(limit) > amplitude * (1.0 + 1e-5));
    }
}

/// Returns the largest amplitude of any blade at the resonances of a mistuned ring under engine
/// order 0, relative to the tuned ring.
///
/// The blades have unit mass, a mistuned stiffness near one, springs between neighbours, and
/// equal dampers to the ground.
fn amplification(pattern: &[f64], coupling: f64) -> f64 {
    let one = |s: usize| Model {
        masses: vec![Mass::new("blade", 1.0)],
        springs: vec![spring("blade", GROUND, 1.0 + pattern[s], DAMPING), spring("blade", "next.blade", coupling, 0.0)],
        forces: vec![force("blade", 1.0, 1)],
        ..Model::default()
    };
    let disk = Disk { sectors: pattern.len(), forces: vec![SectorDistribution::EngineOrder(0)], motions: Vec::new() };
    let ring = disk.ring(one).unwrap();
    let survey = ring.survey().unwrap();
    let system = survey.system();
    // sample around each resonance in fractions of its width; the maximum of two overlapping
    // resonances lies between them
    let detunings = (-8..=8).map(|step| 0.25 * f64::from(step) * DAMPING);
    let around = |omega: f64| detunings.clone().map(move |detuning| omega + detuning);
    let largest = |omega: f64| {
        let mut x = system.excitation(omega)[0].1.clone();
        system.structure().dynamic_stiffness(Complex64::new(0.0, omega)).unwrap().solve(x.as_mut_slice());
        x.iter().fold(0.0f64, |most, z| most.max(z.norm()))
    };
    let found = survey.free().elastic.iter().flat_map(|mode| around(mode.omega)).map(largest).fold(0.0, f64::max);
    // the tuned amplitude is force over damping at ω = 1, up to the square of the damping ratio
    found * DAMPING
}

/// Coupling in N/m and damping in kg/s. The damping is far below the coupling, and both are far
/// below the stiffness.
const COUPLING: f64 = 1e-3;
const DAMPING: f64 = 1e-6;

/// Theory 12: Whitehead's bound `(1 + √N)/2` for small mistuning and equal damping of all
/// modes.
///
/// The bound belongs to a mode in which one blade moves `1 + √N` times as much as each of the
/// others. The stiffness of each blade follows from its equation of motion at ω = 1.
#[test]
fn whiteheads_bound_is_reached_and_not_passed() {
    for sectors in [4, 12] {
        let bound = 0.5 * (1.0 + (sectors as f64).sqrt());
        assert!((amplification(&vec![0.0; sectors], COUPLING) - 1.0).abs() < 1e-5, "the tuned ring");
        let shape = |s: usize| if s == 0 { 1.0 + (sectors as f64).sqrt() } else { 1.0 };
        let best: Vec<f64> = (0..sectors)
            .map(|s| {
                let beside = shape((s + 1) % sectors) + shape((s + sectors - 1) % sectors);
                -COUPLING * (2.0 - beside / shape(s))
            })
            .collect();
        let reached = amplification(&best, COUPLING);
        assert!((reached / bound - 1.0).abs() < 1e-4, "{sectors}: {reached} of {bound}");
        let mut worst = 0.0f64;
        for seed in 0..60 {
            // alternate between mistuning weaker and stronger than the coupling
            let deviation = COUPLING * [0.1, 1.0, 5.0][seed as usize % 3];
            worst = worst.max(amplification(&normal_deviations(sectors, deviation, seed), COUPLING));
        }
        assert!(worst > 1.2 && worst < bound, "{sectors}: {worst} of {bound}");
    }
}

/// Theory 12: strongly mistuned blades exceed Whitehead's bound.
///
/// Damping is viscous, so a mode of the frequency `ω` reaches `1/ω` times the bound. Mistuning
/// up to `δ` thus gives `(1 + √N)/(2 √(1 - δ))` in the limit of weak coupling and damping.
#[test]
fn whiteheads_bound_is_passed_by_soft_blades() {
    const MOST: f64 = 0.6;
    let bound = 1.5;
    // mode 3, 1, 1, 1 at `ω² = 0.4 + 4/3 coupling`; the leading blade has just the largest
    // deviation
    for (coupling, expected) in [(0.08, 2.107), (1e-3, 2.368)] {
        let shape = [3.0, 1.0, 1.0, 1.0];
        let square = 1.0 - MOST + 4.0 / 3.0 * coupling;
        let pattern: Vec<f64> = (0..4)
            .map(|s| square - 1.0 - coupling * (2.0 - (shape[(s + 1) % 4] + shape[(s + 3) % 4]) / shape[s]))
            .collect();
        assert!(pattern.iter().all(|d| d.abs() <= MOST * (1.0 + 1e-12)), "{pattern:?}");
        close("by hand", bound / square.sqrt(), expected, 5e-4);
        close("found", amplification(&pattern, coupling), bound / square.sqrt(), 1e-4);
    }
    // two soft and two stiff blades with the mean stiffness of the tuned ring: the bound of a
    // pair, `(1 + √2)/2`, at the frequency of the soft pair
    let pair = 0.5 * (1.0 + 2f64.sqrt());
    let beside = 2.0 * COUPLING;
    let pattern = [-MOST, beside - MOST, MOST, MOST - beside];
    let found = amplification(&pattern, COUPLING);
    assert!(found > 1.9, "{found}");
    close("pair", found, pair / (1.0 - MOST).sqrt(), 2e-3);
}
