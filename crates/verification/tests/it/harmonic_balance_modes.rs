//! Nonlinear modes with laws of velocity. References: describing functions, the elastic law in
//! the limit, and the linear modes at both ends.

use nalgebra::DMatrix;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use stickslip::curve::modes::{Mode, ModePoint, ModeRequest, nonlinear_mode};
use stickslip::law::{Coulomb, CoulombArctan, Jenkins, JenkinsArctan, SharedLaw};
use stickslip::model::{Axis, GROUND, Joint, Mass, Model, Spring, System};
use stickslip::structure::Structure;
use stickslip_study::templates;

/// Returns a mass of 1 kg on a spring of 1 N/m with a joint to the ground.
fn oscillator(law: SharedLaw) -> System {
    Model {
        masses: vec![Mass::new("m", 1.0)],
        springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: 1.0, damping: 0.0 }],
        joints: vec![Joint { name: "damper".into(), between: ["m".into(), GROUND.into()], law }],
        ..Model::default()
    }
    .assemble()
    .unwrap()
}

/// Returns the mode, and asserts that it is complete.
fn followed(system: &System, request: ModeRequest) -> Mode {
    let mode = nonlinear_mode(system, request).unwrap();
    assert_eq!(mode.ended, None, "{request:?}");
    assert_eq!(mode.points.len(), request.points);
    mode
}

/// Relative error of a frequency or a damping ratio. They are solved to 1e-11; a damping ratio
/// up to 20 makes the equations stiffer.
const ROUNDING: f64 = 1e-8;

/// Error of a linear velocity over one of 4096 samples: `(2π/4096)²/6` at a sharp zero
/// crossing, and five times that for a law that is curved everywhere.
const SAMPLES: f64 = 2e-6;

/// Penalty on the oscillator's force with one harmonic, N s/m, at 1 rad/s: the sum of the
/// impedances of mass and spring, 1 + 30 times.
const PENALTY: f64 = 62.0;

/// Rigid friction with one harmonic: the force is `4 Ft/π` against the velocity `a ω`. Thus
/// `ω² = k/m` and `ζ = (4 Ft/π)/(2 ω² m a) = 2 Ft/(π k a)`.
#[test]
fn rigid_friction_is_its_describing_function() {
    let limit = 1.5;
    let system = oscillator(Arc::new(Coulomb { limit }));
    let request = ModeRequest { mode: 0, range: (0.05, 100.0), points: 41, harmonics: 1, samples: 4096 };
    for point in followed(&system, request).points {
        assert!((point.omega - 1.0).abs() < ROUNDING, "{point:?}");
        let expected = 2.0 * limit / (PI * point.amplitude);
        // the force is a cosine of amplitude ε a ω, clipped at the limit, instead of a
        // rectangle: an error of `(limit/(ε a ω))²/6`
        let blurred = (limit / (PENALTY * point.amplitude)).powi(2) / 6.0;
        assert!((point.damping / expected - 1.0).abs() < blurred + SAMPLES, "{point:?} instead of {expected}");
    }
}

/// The arctangent with one harmonic, (3.1).
#[test]
fn arctangent_is_its_describing_function() {
    for alpha in [0.1, 1.0, 30.0, 1e4] {
        let system = oscillator(Arc::new(CoulombArctan { limit: 1.0, alpha }));
        let request = ModeRequest { mode: 0, range: (0.1, 100.0), points: 31, harmonics: 1, samples: 4096 };
        for point in followed(&system, request).points {
            assert!((point.omega - 1.0).abs() < ROUNDING, "{point:?}");
            let z = alpha * point.amplitude;
            let expected = 2.0 / (PI * point.amplitude) * z / ((1.0 + z * z).sqrt() + 1.0);
            let blurred = MISSING / (PENALTY * point.amplitude);
            let error = point.damping / expected - 1.0;
            assert!(error.abs() < blurred + SAMPLES, "{alpha}: {point:?} instead of {expected}");
        }
    }
}

/// Largest effect of the missing harmonics of the force on the first one, as a fraction of the
/// slip limit over ε times the velocity. They are at most a third of the force, and enter the
/// resolvent as the velocity λ₃/ε. They matter only where the law is curved. Measured: 0.047.
const MISSING: f64 = 0.06;

/// A steep arctangent behind a spring tends to a slider behind a spring. The two series
/// truncate different unknowns, the slider's force and the motion, so their distance decreases
/// with the harmonics.
#[test]
fn steep_jenkins_arctan_is_jenkins() {
    let (stiffness, limit) = (0.2, 1.0);
    let distance = |harmonics: usize| {
        let request = ModeRequest { mode: 0, range: (0.5, 1e3), points: 41, harmonics, samples: 4096 };
        let elastic = followed(&oscillator(Arc::new(Jenkins { stiffness, limit })), request);
        let steep = Arc::new(JenkinsArctan { stiffness, limit, alpha: 1e6 });
        let steep = followed(&oscillator(steep), request);
        let apart = |read: fn(&ModePoint) -> f64| {
            let pairs = steep.points.iter().zip(&elastic.points);
            pairs.map(|(a, b)| (read(a) - read(b)).abs()).fold(0.0, f64::max)
        };
        (apart(|point| point.omega), apart(|point| point.damping))
    };
    let (few, many) = (distance(15), distance(63));
    // the force has kinks, so its harmonics fall as 1/h²; the distance falls by more than a
    // factor of four from 15 to 63
    assert!(many.0 < 0.25 * few.0 && many.1 < 0.25 * few.1, "{few:?} {many:?}");
    // the frequency changes by a tenth along the mode, the damping ratio goes up to 0.029
    assert!(many.0 < 1e-4 && many.1 < 1e-4, "{many:?}");
}

/// Returns the smaller and the larger solution λ of `a λ² - b λ + c = 0`.
fn roots(a: f64, b: f64, c: f64) -> (f64, f64) {
    let root = (b * b - 4.0 * a * c).sqrt();
    ((b - root) / (2.0 * a), (b + root) / (2.0 * a))
}

/// Effect of a friction of 2 N at an amplitude of 1 m √kg. It changes ω and ζ by at most its
/// force relative to the elastic ones, 2/(105 103 · 2), here doubled.
const FAINT: f64 = 2e-5;

/// The symmetric couple from free to stuck.
///
/// In antiphase and free slip, blade and contact mass are a chain of two. In stick, the contact
/// masses stand still. In phase nothing ever slips, and the mode is linear.
#[test]
fn symmetric_couple_from_free_to_stuck() {
    let (blade, small, k, kt, b) = (0.182 - 0.00091, 0.00091, 105_103.0, 1e4, 0.2);
    let system = templates::find("symmetric-couple").unwrap().model().assemble().unwrap();
    let chain = roots(blade * small, (k + kt) * small + kt * blade, (k + kt) * kt - kt * kt).0.sqrt();
    let stuck = ((k + kt) / blade).sqrt();
    for harmonics in [1, 3, 9, 15, 31] {
        let request = ModeRequest { mode: 1, range: (1e-7, 1.0), points: 43, harmonics, samples: 1024 };
        let against = followed(&system, request).points;
        let (smallest, largest) = (&against[0], &against[42]);
        assert!((smallest.omega / stuck - 1.0).abs() < ROUNDING, "{harmonics}: {smallest:?} instead of {stuck}");
        assert!((smallest.damping - b / (2.0 * blade * stuck)).abs() < ROUNDING, "{harmonics}: {smallest:?}");
        assert!(smallest.places[1].norm() < ROUNDING * smallest.places[0].norm(), "{harmonics}: {smallest:?}");
        assert!((largest.omega / chain - 1.0).abs() < FAINT, "{harmonics}: {largest:?} instead of {chain}");
        // modal damping of the free chain; the amplitude of the contact mass is
        // `kt/(kt - ω² small)` of the blade's
        let ratio = kt / (kt - chain * chain * small);
        let free = b / (2.0 * chain * (blade + ratio * ratio * small));
        assert!((largest.damping - free).abs() < FAINT, "{harmonics}: {largest:?} instead of {free}");
        for point in followed(&system, ModeRequest { mode: 0, ..request }).points {
            assert!((point.omega / chain - 1.0).abs() < ROUNDING, "{harmonics}: {point:?} instead of {chain}");
        }
    }
}

/// The non-symmetric couple from free to stuck.
///
/// Large motions are those of one blade, and of the other blade with the contact mass. Friction
/// draws the two frequencies together until the modes meet at one amplitude. Below it two modes
/// exist again: in one the blades slip against each other and finally stick; in the other they
/// move together and stick. A followed mode may end in either.
#[test]
fn blade_couple_from_free_to_stuck() {
    let (blade, small, k, kt) = (0.182 - 0.00091, 0.00182, 105_103.0_f64, 1e4);
    let system = templates::find("blade-couple").unwrap().model().assemble().unwrap();
    let alone = (k / blade).sqrt();
    let carrying = roots(blade * small, (k + kt) * small + kt * blade, (k + kt) * kt - kt * kt).0.sqrt();
    let heavy = blade + small;
    let stuck = roots(heavy * blade, (k + kt) * (heavy + blade), (k + kt) * (k + kt) - kt * kt);
    for harmonics in [1, 3, 9, 15, 31] {
        let request = ModeRequest { mode: 0, range: (1e-7, 1.0), points: 57, harmonics, samples: 1024 };
        let lower = followed(&system, request).points;
        let upper = followed(&system, ModeRequest { mode: 1, ..request }).points;
        for (mode, free) in [(&lower, carrying), (&upper, alone)] {
            assert!((mode[56].omega / free - 1.0).abs() < FAINT, "{harmonics}: {:?} instead of {free}", mode[56]);
            let away = |square: f64| (mode[0].omega / square.sqrt() - 1.0).abs();
            assert!(
                away(stuck.0).min(away(stuck.1)) < ROUNDING,
                "{harmonics}: {:?} instead of one of {stuck:?}",
                mode[0]
            );
        }
        for (a, b) in lower.iter().zip(&upper).filter(|(a, _)| a.amplitude > TWO) {
            assert!(b.omega - a.omega > TAU * 0.3, "{harmonics}: {a:?} {b:?}");
        }
    }
}

/// Modal amplitude, m √kg, above which the two modes are distinct. With one harmonic they meet
/// where friction compensates half of the difference δ of the free frequencies: at
/// `a = (4 Ft/π)/(2 ω √m δ)` = 1.9e-3.
const TWO: f64 = 4e-3;

/// Relative agreement of frequencies and damping ratios at equal amplitudes, and of the largest
/// damping ratios. The followed curve is the same, so the differences are rounding; the
/// tolerance is far larger.
const SAME: (f64, f64) = (1e-6, 1e-4);

fn same(what: &str, one: &ModePoint, other: &ModePoint) {
    assert!((one.omega / other.omega - 1.0).abs() < SAME.0, "{what}: {one:?} {other:?}");
    assert!((one.damping - other.damping).abs() <= SAME.1 * other.damping.abs() + 1e-12, "{what}: {one:?} {other:?}");
}

/// Asserts that the common points of `some` and `all` agree; returns their number.
fn compare(what: &str, some: &Mode, all: &Mode) -> usize {
    let mut common = 0;
    for one in &some.points {
        if let Some(other) = all.points.iter().find(|p| (p.amplitude / one.amplitude - 1.0).abs() < 1e-9) {
            same(what, one, other);
            common += 1;
        }
    }
    common
}

/// A mode does not depend on the number of points or on the ends of the range. The test follows
/// modes of 30 random models with up to three joints to their ends.
#[test]
fn a_mode_does_not_depend_on_its_points() {
    let mut lost = Vec::new();
    for seed in 0..30 {
        let system = stickslip_verification::random_model(seed).0.assemble().unwrap();
        let number = seed as usize % system.dofs();
        let request = ModeRequest { mode: number, range: (1e-6, 1.0), points: 121, harmonics: 7, samples: 256 };
        let fine = nonlinear_mode(&system, request).unwrap();
        assert!(fine.not_found.is_empty(), "seed {seed}: {:?}", fine.not_found);
        for points in [2, 13] {
            let coarse = nonlinear_mode(&system, ModeRequest { points, ..request }).unwrap();
            assert_eq!(
                (&coarse.turns, &coarse.coalescences, coarse.ended),
                (&fine.turns, &fine.coalescences, fine.ended),
                "seed {seed}"
            );
            assert_eq!(compare(&format!("seed {seed}, {points} points"), &coarse, &fine), coarse.points.len());
            same(&format!("seed {seed}, largest"), &coarse.largest.unwrap(), fine.largest.as_ref().unwrap());
        }
        // a part of the range; its points are points of the whole
        let part = nonlinear_mode(&system, ModeRequest { range: (1e-4, 1e-2), points: 41, ..request }).unwrap();
        assert_eq!(compare(&format!("seed {seed}, part"), &part, &fine), part.points.len());
        lost.extend(fine.ended.map(|lost| (seed, number, lost)));
    }
    assert!(lost.is_empty(), "{lost:?}");
}

/// The couple at 8 N: the largest damping ratio does not depend on the number of points. The
/// two modes almost meet, and both report the amplitude at which they do.
#[test]
fn blade_couple_has_one_largest_damping() {
    let system = stickslip_verification::template("blade-couple", &[("Ft", 8.0)]);
    let range = (4.255467e-6, 4.255467e-2);
    let request = |mode, points| ModeRequest { mode, range, points, harmonics: 15, samples: 1024 };
    let followed: Vec<Mode> = [2, 61, 200].map(|points| nonlinear_mode(&system, request(1, points)).unwrap()).into();
    for one in &followed {
        same("largest", one.largest.as_ref().unwrap(), followed[0].largest.as_ref().unwrap());
        assert_eq!(one.points.len(), [2, 61, 200][followed.iter().position(|other| other == one).unwrap()]);
    }
    let other = nonlinear_mode(&system, request(0, 61)).unwrap();
    for one in [&followed[1], &other] {
        assert_eq!(one.ended, None);
        assert!(one.coalescences.len() == 1 && (6e-3..8e-3).contains(&one.coalescences[0]), "{:?}", one.coalescences);
    }
    // one mode ends with blades in antiphase, which friction damps, the other with blades that
    // move together and stick
    let largest = |mode: &Mode| mode.largest.as_ref().map_or(0.0, |point| point.damping);
    let (against, together) = (largest(&followed[1]).max(largest(&other)), largest(&followed[1]).min(largest(&other)));
    assert!((0.055..0.06).contains(&against) && (0.003..0.004).contains(&together), "{against} {together}");
}

/// Both modes of the couple at 8 N with five harmonics, as modal amplitude, ω, ζ.
///
/// The reference is SciPy's root finder on an independent implementation of the equations:
/// rigid friction by its projection with ε = 62 N s/m, 512 samples, 600 random starts per
/// amplitude. With ε = 20 N s/m, ω changes by 2e-3 rad/s and ζ by 2e-6. The solver's own ε must
/// agree within that.
#[test]
fn blade_couple_agrees_with_a_search_from_random_starts() {
    let system = stickslip_verification::template("blade-couple", &[("Ft", 8.0)]);
    let expected = [
        (0, 2e-2, 758.0188, 0.001_759),
        (1, 2e-2, 761.9564, 0.001_764),
        (0, 8.5e-3, 759.1943, 0.002_660),
        (1, 8.5e-3, 761.5814, 0.003_102),
        (1, 7e-3, 761.1656, 0.003_659),
        (0, 1e-3, 759.8771, 0.000_723),
        (1, 1e-3, 760.4674, 0.026_825),
    ];
    for (number, amplitude, omega, damping) in expected {
        let request =
            ModeRequest { mode: number, range: (amplitude, 2.0 * amplitude), points: 2, harmonics: 5, samples: 512 };
        let found = nonlinear_mode(&system, request).unwrap().points.remove(0);
        assert!((found.omega - omega).abs() < 0.06 && (found.damping - damping).abs() < 2e-3 * damping, "{found:?}");
    }
}

/// A mode does not depend on the coordinates. With displacements as sums of others, all
/// matrices are full; frequencies and damping ratios stay the same.
#[test]
fn full_mass_matrices_are_respected() {
    for seed in [4, 8, 12, 20] {
        let plain = stickslip_verification::random_model(seed).0.assemble().unwrap();
        let n = plain.dofs();
        let turn = |i: usize, k: usize| if i == k { 1.0 } else { 0.3 / (1.0 + (i + 2 * k) as f64) };
        let basis = DMatrix::from_fn(n, n, turn);
        let old = plain.structure();
        let [m, c, k] = [old.mass(), old.damping(), old.stiffness()].map(|a| basis.transpose() * a * &basis);
        assert!(n == 1 || m[(0, 1)].abs() > 1e-2, "{m}");
        let mut builder = System::builder(Structure::new(old.places().to_vec(), m, c, k).unwrap());
        for joint in plain.joints() {
            let turned = basis.transpose() * joint.axes()[0].dense(n);
            let axis = Axis::new(turned.iter().copied().enumerate().collect());
            builder = builder.joint(joint.name(), joint.law().clone(), vec![axis]);
        }
        let full = builder.build().unwrap();
        let request = ModeRequest { mode: 0, range: (1e-3, 1.0), points: 13, harmonics: 5, samples: 256 };
        let (one, other) = (nonlinear_mode(&plain, request).unwrap(), nonlinear_mode(&full, request).unwrap());
        assert_eq!(compare(&format!("seed {seed}"), &one, &other), 13);
    }
}
