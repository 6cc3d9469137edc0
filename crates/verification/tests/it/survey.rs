//! The survey of a model before any solution, against closed forms and SciPy.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::law::{Coulomb, FrictionContact, Jenkins, Parameter, SharedLaw, Stribeck, TABLE};
use stickslip::model::{Force, GROUND, Joint, LinearModes, Mass, Model, Motion, SlipOnset, Spring, Survey};
use stickslip_study::templates;

fn couple(template: &str, changes: &[(&str, f64)]) -> Survey {
    templates::find(template).unwrap().model_with(changes).unwrap().survey().unwrap()
}

fn mass(name: impl Into<String>, mass: f64) -> Mass {
    Mass::new(name, mass)
}

fn spring(a: impl Into<String>, b: impl Into<String>, stiffness: f64, damping: f64) -> Spring {
    Spring { between: [a.into(), b.into()], stiffness, damping }
}

fn joint(name: impl Into<String>, a: impl Into<String>, b: impl Into<String>, law: SharedLaw) -> Joint {
    Joint { name: name.into(), between: [a.into(), b.into()], law }
}

fn force(on: &str, amplitude: f64, phase: f64, harmonic: u32) -> Force {
    Force { on: on.to_owned(), amplitude, phase, harmonic }
}

fn jenkins(stiffness: f64, limit: f64) -> SharedLaw {
    Arc::new(Jenkins { stiffness, limit })
}

fn coulomb(limit: f64) -> SharedLaw {
    Arc::new(Coulomb { limit })
}

fn omegas(modes: &LinearModes) -> Vec<f64> {
    modes.elastic.iter().map(|mode| mode.omega).collect()
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= tolerance * b.abs(), "{found:?} {expected:?}");
    }
}

/// Relative rounding error of eigenvalues and linear solutions of small, well-conditioned
/// models.
const ROUNDING: f64 = 1e-11;

/// Returns the natural frequencies of two coupled masses: the roots of the quadratic equation
/// of `[K - ω²M]`.
fn two_masses(k1: f64, k2: f64, coupling: f64, m1: f64, m2: f64) -> [f64; 2] {
    let (a, b) = ((k1 + coupling) / m1, (k2 + coupling) / m2);
    let root = ((a - b) * (a - b) / 4.0 + coupling * coupling / (m1 * m2)).sqrt();
    [(0.5 * (a + b) - root).sqrt(), (0.5 * (a + b) + root).sqrt()]
}

#[test]
fn the_couple_free_and_stuck() {
    let survey = couple("blade-couple", &[]);
    let (m, m1, k, kt, b) = (0.182, 0.00182, 105_103.0, 1e4, 0.2);
    let star: f64 = m - 0.5 * m1;
    // free: blade 1 alone, blade 3 with the contact mass
    let [low, high] = two_masses(k, 0.0, kt, star, m1);
    close(&omegas(survey.free()), &[low, (k / star).sqrt(), high], ROUNDING);
    let alone = survey.free().elastic[1];
    assert!((alone.omega / TAU - 121.25).abs() < 1e-3);
    close(&[alone.damping], &[b / (2.0 * (k * star).sqrt())], ROUNDING);
    // stuck, theory 6.7: the contact mass moves with blade 1
    let stuck = two_masses(k, k, kt, star + m1, star);
    close(&omegas(survey.stuck()), &stuck, ROUNDING);
    assert_eq!((survey.free().rigid, survey.stuck().rigid, survey.loose().len()), (0, 0, 0));
}

/// Returns the onset of the only joint.
fn onset(survey: &Survey, from: f64, to: f64) -> SlipOnset {
    survey.onset(from * TAU, to * TAU).unwrap().remove(0)
}

fn hertz(slips: &[(f64, f64)]) -> Vec<f64> {
    slips.iter().flat_map(|(a, b)| [a / TAU, b / TAU]).collect()
}

/// The theory's frequencies are rounded to 1e-4 Hz, its forces to 1e-4 N.
const PRINTED: f64 = 5e-6;

#[test]
fn the_couple_slips_where_the_stuck_force_exceeds_the_limit() {
    // theory 6.8
    let strongest = onset(&couple("blade-couple", &[("Ft", 1.0)]), 119.5, 122.5);
    close(&[strongest.largest, strongest.omega / TAU], &[19.7237, 120.9589], PRINTED);
    close(
        &hertz(&onset(&couple("blade-couple", &[("Ft", 4.0)]), 120.6, 122.5).slip_ranges),
        &[120.7455, 122.5],
        PRINTED,
    );
    close(
        &hertz(&onset(&couple("blade-couple", &[("Ft", 8.0)]), 119.5, 122.5).slip_ranges),
        &[120.8218, 121.4421],
        PRINTED,
    );
    let two = hertz(&onset(&couple("blade-couple", &[("Ft", 2.0)]), 119.5, 122.5).slip_ranges);
    close(&two, &[119.5, 120.2704, 120.6697, 122.5], PRINTED);
    assert!(onset(&couple("blade-couple", &[("Ft", 20.0)]), 119.5, 122.5).slip_ranges.is_empty());
}

#[test]
fn the_symmetric_couple_slips_in_the_antiphase_mode() {
    // theory 4.2
    let survey = couple("symmetric-couple", &[("Ft", 4.0)]);
    // blades in antiphase, the contact at rest
    let antiphase = ((105_103.0f64 + 1e4) / (0.182 - 0.00091)).sqrt();
    assert!(survey.stuck().elastic.iter().any(|mode| (mode.omega / antiphase - 1.0).abs() < ROUNDING));
    close(&hertz(&onset(&survey, 110.0, 122.5).slip_ranges), &[119.7995, 122.5], PRINTED);
    close(
        &hertz(&onset(&couple("symmetric-couple", &[("Ft", 2.0)]), 110.0, 122.5).slip_ranges),
        &[112.26, 122.5],
        5e-5,
    );
    let one = onset(&survey, 121.25, 121.25);
    close(&[one.largest * 4.0], &[4.9997], 1e-5);
}

#[test]
fn the_elements_of_the_paper() {
    // without mass nothing vibrates; a moved place slips if its motion exceeds limit /
    // stiffness
    let element = couple("element", &[]);
    assert_eq!((element.dofs(), element.free().elastic.len(), element.stuck().elastic.len()), (0, 0, 0));
    let (slip, at) = (&element.first_slip()[0], element.onset(1.0, 1.0).unwrap().remove(0));
    close(&[slip.limit, slip.displacement.unwrap(), at.largest], &[1e-3, 1e-3, 2.0], ROUNDING);
    // with mass: `sqrt(kt/m1)` free (theory 3.3); in stick the slider stands still and carries
    // `kt a`
    let slider = couple("element-with-mass", &[]);
    close(&omegas(slider.free()), &[(1.0f64 / 0.002).sqrt()], ROUNDING);
    assert_eq!((slider.stuck().elastic.len(), slider.first_slip()[0].displacement), (0, None));
    close(&[slider.onset(1.0, 1.0).unwrap()[0].largest], &[2.0], 1e-9);
}

/// Returns four masses and a massless place, with one joint of each kind. The expected values
/// are from SciPy 1.x: `eigh` of the structure condensed onto its masses, `numpy.linalg.solve`
/// of the stuck structure, and `brentq`.
fn network() -> Model {
    Model {
        masses: vec![mass("a", 0.5), mass("b", 1.2), mass("c", 0.8), mass("d", 2.0), mass("p", 0.0)],
        springs: vec![
            spring("a", GROUND, 2000.0, 0.5),
            spring("a", "b", 3000.0, 0.2),
            spring("b", "c", 1500.0, 0.0),
            spring("c", "p", 4000.0, 0.0),
            spring("p", "d", 6000.0, 0.3),
            spring("d", GROUND, 1000.0, 1.0),
        ],
        joints: vec![joint("ad", "a", "d", jenkins(700.0, 2.0)), joint("bg", "b", GROUND, coulomb(5.0))],
        forces: vec![force("c", 3.0, 0.4, 1), force("d", 7.0, 0.0, 0)],
        ..Model::default()
    }
}

#[test]
fn a_network_agrees_with_scipy() {
    let survey = network().survey().unwrap();
    let free = [22.222134018748115, 42.8301987278175, 77.96266018889015, 109.1722238156762];
    close(&omegas(survey.free()), &free, ROUNDING);
    let damping = [0.007057845737823568, 0.0034289380389855165, 0.0012462280272697126, 0.006178051211629685];
    close(&survey.free().elastic.iter().map(|m| m.damping).collect::<Vec<_>>(), &damping, ROUNDING);
    close(&omegas(survey.stuck()), &[32.54497511360959, 76.22669349514925, 107.02950898537796], ROUNDING);
    let damping = [0.0062285731892485876, 0.001210673343393055, 0.00651227517813112];
    close(&survey.stuck().elastic.iter().map(|m| m.damping).collect::<Vec<_>>(), &damping, ROUNDING);
    let onsets = survey.onset(20.0, 60.0).unwrap();
    // golden-section search ends at 1e-5 of a step of 0.2 rad/s, where the peak is flat
    close(&[onsets[0].largest * 2.0, onsets[1].largest * 5.0], &[43.21330374376658, 113.21943727884297], 1e-9);
    close(&[onsets[0].omega, onsets[1].omega], &[32.544389554113806, 32.54237862334611], 1e-6);
    let flat = |slips: &[(f64, f64)]| slips.iter().flat_map(|(a, b)| [*a, *b]).collect::<Vec<_>>();
    // the compliance that represents rigid joints is 1e-10 of that of the structure
    close(&flat(&onsets[0].slip_ranges), &[28.081772350591542, 36.90272319394895], 1e-9);
    close(&flat(&onsets[1].slip_ranges), &[26.566375940502397, 36.23457606164326], 1e-9);
}

/// Parallel rigid joints share a load in proportion to their limits and slip together; a static
/// limit counts instead of the dynamic one.
#[test]
fn rigid_joints_along_one_line_slip_together() {
    let model = |limits: [(f64, f64); 3]| Model {
        masses: vec![mass("a", 1.0)],
        springs: vec![spring("a", GROUND, 1e4, 2.0)],
        joints: (0..3)
            .map(|i| {
                let law = Stribeck { limit: limits[i].0, static_limit: limits[i].1, velocity: 0.0 };
                joint(format!("j{i}"), "a", GROUND, Arc::new(law))
            })
            .collect(),
        forces: vec![force("a", 6.0, 0.0, 1)],
        ..Model::default()
    };
    for limits in [[(12.75, 12.75), (0.4, 0.4), (1.3, 1.3)], [(1.0, 2.0), (0.5, 3.0), (0.1, 0.1)]] {
        let sum: f64 = limits.iter().map(|(_, holds)| holds).sum();
        let onsets = model(limits).survey().unwrap().onset(20.0, 150.0).unwrap();
        for onset in onsets {
            // compliances of 1e-12 of the structure share the load to the remaining digits
            assert!((onset.largest * sum / 6.0 - 1.0).abs() < 1e-4, "{limits:?}: {} for {}", onset.largest, 6.0 / sum);
        }
    }
}

/// Returns a chain of `n` equal masses, connected to the ground at both ends:
/// `ω_i = 2 √(k/m) sin(iπ / (2(n + 1)))`.
fn chain(n: usize, m: f64, k: f64) -> Model {
    let name = |i: usize| if i == 0 || i == n + 1 { GROUND.to_owned() } else { format!("x{i}") };
    Model {
        masses: (1..=n).map(|i| mass(name(i), m)).collect(),
        springs: (0..=n).map(|i| spring(name(i), name(i + 1), k, 0.0)).collect(),
        ..Model::default()
    }
}

#[test]
fn a_chain_of_five_hundred_masses_has_its_frequencies() {
    let n = 500;
    let mut model = chain(n, 2.0, 800.0);
    model.joints =
        (1..n).map(|i| joint(format!("j{i}"), format!("x{i}"), format!("x{}", i + 1), jenkins(800.0, 1.0))).collect();
    let survey = model.survey().unwrap();
    let expected: Vec<f64> = (1..=n).map(|i| 2.0 * 20.0 * (i as f64 * PI / (2.0 * (n + 1) as f64)).sin()).collect();
    // the lowest squared frequency is 1e-5 of the highest, so it has ten digits
    close(&omegas(survey.free()), &expected, 1e-9);
}

#[test]
fn free_bodies_and_bodies_held_by_friction_differ() {
    // two masses on a spring, free in space: one rigid motion, and the mode of the reduced mass
    let mut model = Model {
        masses: vec![mass("a", 1.0), mass("b", 3.0)],
        springs: vec![spring("a", "b", 300.0, 0.0)],
        ..Model::default()
    };
    let survey = model.survey().unwrap();
    assert_eq!((survey.free().rigid, survey.loose().len()), (1, 1));
    assert_eq!(
        (&survey.loose()[0].masses[..], survey.loose()[0].held_by_friction),
        (&["a".into(), "b".into()][..], false)
    );
    close(&omegas(survey.free()), &[20.0], ROUNDING);
    // a joint to the ground holds the pair while it sticks
    model.joints.push(joint("j", "b", GROUND, jenkins(100.0, 1.0)));
    let survey = model.survey().unwrap();
    assert_eq!((survey.free().rigid, survey.stuck().rigid), (1, 0));
    assert!(survey.loose()[0].held_by_friction);
    close(&omegas(survey.stuck()), &two_masses(0.0, 100.0, 300.0, 1.0, 3.0), ROUNDING);
    // rigidly: b is no longer a degree of freedom
    model.joints[0].law = coulomb(1.0);
    close(&omegas(model.survey().unwrap().stuck()), &[300f64.sqrt()], ROUNDING);
    // a moved place holds like the ground
    model.joints.clear();
    model.springs.push(spring("b", "mover", 100.0, 0.0));
    model.motions.push(Motion { on: "mover".to_owned(), amplitude: 1e-3, phase: 0.0, harmonic: 1 });
    let survey = model.survey().unwrap();
    assert_eq!((survey.loose().len(), survey.free().rigid), (0, 0));
    close(&omegas(survey.free()), &two_masses(0.0, 100.0, 300.0, 1.0, 3.0), ROUNDING);
}

#[test]
fn stiffnesses_of_any_size_keep_the_modes_below() {
    // two masses glued together: one mode of both, one of the glue
    for glue in [1e9, 1e14, 1e20, 1e25] {
        let model = Model {
            masses: vec![mass("a", 1.0), mass("b", 3.0)],
            springs: vec![spring("a", GROUND, 400.0, 0.8), spring("a", "b", glue, 0.0)],
            ..Model::default()
        };
        let modes = model.survey().unwrap().free().clone();
        // the glue yields by 400/glue; six digits remain while it does not count as rigid
        close(&omegas(&modes), &[10.0, (glue * 4.0 / 3.0).sqrt()], 1e-6);
        close(&[modes.elastic[0].damping], &[0.8 / (2.0 * 10.0 * 4.0)], 1e-6);
        assert_eq!(modes.unresolved, 0);
    }
}

#[test]
fn places_without_mass_are_springs_in_series() {
    let series = Model {
        masses: vec![mass("a", 2.0), mass("p", 0.0), mass("q", 0.0)],
        springs: vec![spring("a", "p", 300.0, 0.0), spring("p", "q", 600.0, 0.0), spring("q", GROUND, 200.0, 0.0)],
        // q also has a joint, which adds its spring between q and the ground
        joints: vec![joint("j", "q", GROUND, jenkins(400.0, 1.0))],
        ..Model::default()
    };
    let survey = series.survey().unwrap();
    let stiffness = |ground: f64| 1.0 / (1.0 / 300.0 + 1.0 / 600.0 + 1.0 / ground);
    close(&omegas(survey.free()), &[(stiffness(200.0) / 2.0).sqrt()], ROUNDING);
    close(&omegas(survey.stuck()), &[(stiffness(600.0) / 2.0).sqrt()], ROUNDING);
    // a place on a joint alone does not count
    let hanging = Model {
        masses: vec![mass("a", 2.0), mass("p", 0.0)],
        springs: vec![spring("a", GROUND, 300.0, 0.0)],
        joints: vec![joint("j", "a", "p", coulomb(1.0))],
        ..Model::default()
    };
    close(&omegas(hanging.survey().unwrap().free()), &[150f64.sqrt()], ROUNDING);
    close(&omegas(hanging.survey().unwrap().stuck()), &[150f64.sqrt()], ROUNDING);
}

#[test]
fn rigid_joints_in_a_ring_share_the_load() {
    let names = ["a", "b", "c"];
    let model = Model {
        masses: names.iter().map(|name| mass(*name, 1.0)).collect(),
        springs: names.iter().map(|name| spring(*name, GROUND, 100.0, 0.1)).collect(),
        joints: (0..3).map(|i| joint(format!("j{i}"), names[i], names[(i + 1) % 3], coulomb(1.0))).collect(),
        forces: vec![force("a", 6.0, 0.0, 1)],
        ..Model::default()
    };
    let survey = model.survey().unwrap();
    close(&omegas(survey.stuck()), &[10.0], ROUNDING);
    // b and c move like a, each with a third of the force; no force acts between them
    let onsets = survey.onset(7.0, 7.0).unwrap();
    // the compliance that shares the load is 1e-10 of that of the structure
    close(&[onsets[0].largest, onsets[2].largest], &[2.0, 2.0], 1e-8);
    assert!(onsets[1].largest < 1e-5, "{onsets:?}");
}

#[test]
fn harmonics_add_up_over_the_period() {
    // the joint alone between a moved place and the ground: `u = cos τ + cos 3τ`, twice the
    // amplitude at τ = 0
    let motion = |harmonic, phase| Motion { on: "mover".to_owned(), amplitude: 1e-3, phase, harmonic };
    let model = |phase| Model {
        joints: vec![joint("j", "mover", GROUND, jenkins(1000.0, 1.0))],
        motions: vec![motion(1, 0.0), motion(3, phase)],
        ..Model::default()
    };
    let largest = |phase| model(phase).survey().unwrap().onset(5.0, 5.0).unwrap()[0].largest;
    close(&[largest(0.0)], &[2.0], ROUNDING);
    // in antiphase `cos τ - cos 3τ = 4 cos τ sin² τ`, at most `8/(3√3)` at `cos² τ = 1/3`; the
    // error is due to the distance of the instants
    close(&[largest(PI)], &[8.0 / (3.0 * 3f64.sqrt())], 1.3e-3);
}

#[test]
fn a_mode_slips_first_at_the_amplitude_of_its_joint() {
    // one mass, modal amplitude `√m` times the displacement; a spring slips at limit /
    // stiffness
    let one = |law| Model {
        masses: vec![mass("a", 4.0)],
        springs: vec![spring("a", GROUND, 100.0, 0.0)],
        joints: vec![joint("j", "a", GROUND, law)],
        ..Model::default()
    };
    let survey = one(jenkins(300.0, 6.0)).survey().unwrap();
    close(&[survey.slip_amplitude(0).unwrap()], &[2.0 * 6.0 / 300.0], ROUNDING);
    assert_eq!((survey.slip_amplitude(1), one(coulomb(6.0)).survey().unwrap().slip_amplitude(0)), (None, None));
    // the couple: blade 1 with the contact mass, and blade 3; the higher mode is in antiphase
    let survey = couple("blade-couple", &[("Ft", 3.0)]);
    let (star, m1, k, kt) = (0.182 - 0.00091, 0.00182, 105_103.0, 1e4);
    let omega = two_masses(k, k, kt, star + m1, star)[1];
    // `(k + kt - ω²(m* + m1)) x1 = kt x3`; force = `(kt - ω² m1) x1 - kt x3`, theory 6.8
    let x3 = (k + kt - omega * omega * (star + m1)) / kt;
    let force = (kt - omega * omega * m1) - kt * x3;
    let modal = ((star + m1) + star * x3 * x3).sqrt();
    close(&[survey.slip_amplitude(1).unwrap()], &[3.0 / force.abs() * modal], 1e-8);
}

#[test]
fn models_that_are_too_large_say_so() {
    let survey = chain(701, 1.0, 1.0).survey().unwrap();
    assert!(survey.is_too_large() && survey.onset(1.0, 2.0).is_none());
    assert_eq!((survey.free().elastic.len(), survey.free().unresolved), (0, 701));
}

/// Returns a node with the directions of a law, on springs of 1000 N/m, with the law between
/// the node and the ground.
fn on_springs(law: SharedLaw) -> Model {
    let names: Vec<String> = ["x", "y", "z"].iter().take(law.directions()).map(|name| (*name).to_owned()).collect();
    let several = names.len() > 1;
    let places = if several { names.iter().map(|d| format!("a.{d}")).collect() } else { vec!["a".to_owned()] };
    Model {
        masses: vec![Mass { name: "a".to_owned(), mass: 1.0, directions: if several { names } else { Vec::new() } }],
        springs: places.iter().map(|place: &String| spring(place.clone(), GROUND, 1000.0, 0.1)).collect(),
        joints: vec![joint("j", "a", GROUND, law)],
        forces: places.iter().map(|place| force(place, 3.0, 0.0, 1)).collect(),
        ..Model::default()
    }
}

#[test]
fn no_law_is_stiffer_at_rest_than_its_stiffnesses() {
    for row in TABLE {
        let law = row.sample();
        let is_stiffness = |p: &&Parameter| p.dimension == Dimension::STIFFNESS;
        let most: f64 = row.parameters.iter().filter(is_stiffness).map(|p| law.value(p.key).unwrap()).sum();
        let survey = on_springs(law.clone()).survey().unwrap();
        let bound = (1000.0 + most).sqrt() * (1.0 + ROUNDING);
        for omega in omegas(survey.stuck()) {
            assert!(omega <= bound, "{}: {omega} rad/s of at most {bound}", row.name);
        }
        let onsets = survey.onset(20.0, 40.0).unwrap();
        for (axis, (slip, onset)) in survey.first_slip().iter().zip(&onsets).enumerate() {
            // a normal direction has a preload and no slip; other directions have no preload
            assert_eq!(law.normal() == Some(axis), slip.preload.is_some(), "{}", row.name);
            if slip.preload.is_some() {
                assert_eq!((onset.largest, onset.slip_ranges.len()), (0.0, 0), "{}", row.name);
            }
            // the displacement at slip is at least the limit over the largest possible
            // stiffness
            if let Some(displacement) = slip.displacement.filter(|u| u.is_finite()) {
                assert!(displacement * most >= slip.limit * (1.0 - ROUNDING), "{}: {slip:?}", row.name);
            }
        }
    }
}

#[test]
fn a_pressed_contact_holds_as_its_springs() {
    let contact = |preload| FrictionContact { tangential: 300.0, normal: 800.0, friction: 0.4, preload, tangents: 1 };
    let survey = on_springs(Arc::new(contact(5.0))).survey().unwrap();
    close(&omegas(survey.stuck()), &[1300f64.sqrt(), 1800f64.sqrt()], ROUNDING);
    let slips = survey.first_slip();
    // the spring of 1000 N/m carries a part of the preload
    let limit = 0.4 * 5.0 * 1000.0 / 1800.0;
    close(&[slips[0].limit, slips[0].displacement.unwrap()], &[limit, limit / 300.0], 1e-10);
    assert_eq!((slips[0].preload, slips[1].preload), (None, Some(5.0)));
    // open: the preload is zero, but "stuck" still means closed
    let survey = on_springs(Arc::new(contact(-5.0))).survey().unwrap();
    close(&omegas(survey.stuck()), &[1300f64.sqrt(), 1800f64.sqrt()], ROUNDING);
    assert_eq!(survey.first_slip()[1].preload, Some(0.0));
}
