//! What every law of the table must do, whatever it is: give no energy, stay at rest, be the same at any speed if it claims to be
//! rate-independent, tend to its exact neighbour, and have the tangent that its dual numbers say.

#![allow(clippy::print_stdout)] // tests say what they measured

use std::f64::consts::TAU;
use stickslip::law::{RateLaw, Relative, SharedLaw, TABLE};
use stickslip::method::auto::Auto;
use stickslip::method::{Method, shooting::Shooting};
use stickslip::model::{GROUND, Joint, Mass, Model, Motion, Spring};
use stickslip::orbit::Orbit;
use stickslip_numerics::dual::Dual;
use stickslip_verification::{Random, exact, near};

/// A displacement history of up to four harmonics, closed over a period; half of them have even harmonics too.
fn history(seed: u64) -> Vec<Motion> {
    let mut random = Random::new(seed);
    let harmonics: &[u32] = if seed.is_multiple_of(2) { &[1, 3, 5] } else { &[1, 2, 3, 4] };
    harmonics
        .iter()
        .map(|&harmonic| Motion {
            on: "mover".into(),
            amplitude: random.between(1e-4, 1e-3) / f64::from(harmonic),
            phase: random.between(0.0, TAU),
            harmonic,
        })
        .collect()
}

/// The law alone between a place that is moved and the ground.
fn moved(law: SharedLaw, motions: Vec<Motion>) -> Model {
    Model {
        joints: vec![Joint { name: "joint".into(), between: ["mover".into(), GROUND.into()], law }],
        motions,
        ..Model::default()
    }
}

fn orbit(model: &Model, omega: f64) -> Orbit {
    Auto.solver(&model.assemble().unwrap()).unwrap().orbit(omega, None).unwrap()
}

/// The displacement and its velocity at a phase, and the phases at which it turns.
fn kinematics(motions: &[Motion], theta: f64) -> (f64, f64) {
    let mut out = (0.0, 0.0);
    for motion in motions {
        let (sin, cos) = (f64::from(motion.harmonic) * theta + motion.phase).sin_cos();
        out.0 += motion.amplitude * cos;
        out.1 -= motion.amplitude * f64::from(motion.harmonic) * sin;
    }
    out
}

/// Displacements at the turning points over a period, in order.
fn turning_points(motions: &[Motion]) -> Vec<f64> {
    let velocity = |theta: f64| kinematics(motions, theta).1;
    let steps = 4000;
    (0..steps)
        .filter_map(|k| {
            let [a, b] = [k, k + 1].map(|k| TAU * f64::from(k) / f64::from(steps));
            (velocity(a) * velocity(b) < 0.0)
                .then(|| kinematics(motions, stickslip_verification::zero(velocity, [a, b])).0)
        })
        .collect()
}

#[test]
fn no_energy_is_created_over_closed_histories() {
    for row in TABLE {
        let law = row.sample();
        let (mut least, mut most) = (f64::INFINITY, 0.0f64);
        for seed in 0..24 {
            for omega in [1.0, 300.0] {
                let orbit = orbit(&moved(law, history(seed)), omega);
                let (friction, work) = (orbit.energy.friction, orbit.energy.work_in);
                // the largest force times the whole way is the most that can be lost
                let points = turning_points(&history(seed));
                let way: f64 = (0..points.len()).map(|k| (points[(k + 1) % points.len()] - points[k]).abs()).sum();
                assert!(friction >= -1e-12 * law.scale() * way, "{}, seed {seed}: {friction}", row.name);
                assert!(friction <= law.scale() * way * (1.0 + 1e-9), "{}, seed {seed}: {friction}", row.name);
                near(&format!("{}, seed {seed}: work in", row.name), work, friction, 1e-7 * law.scale() * way);
                for k in 0..200 {
                    let force = orbit.sample(orbit.period() * f64::from(k) / 200.0).joints[0].force[0];
                    assert!(force.abs() <= law.scale() * (1.0 + 1e-9), "{}: {force}", row.name);
                }
                least = least.min(friction / (law.scale() * way));
                most = most.max(friction / (law.scale() * way));
            }
        }
        println!("{}: lost {least:.3} to {most:.3} of limit times way", row.name);
    }
}

/// Exact laws against a replay from turning point to turning point: all that a rate-independent law can see.
#[test]
fn exact_laws_equal_the_replay_of_their_sliders() {
    let mut compared = 0;
    for row in TABLE {
        let Some(branches) = row.sample().sliders() else { continue };
        for seed in 0..40 {
            let points = turning_points(&history(seed));
            let mut loss = 0.0;
            for branch in &branches {
                match branch.stiffness {
                    // a rigid slider loses its limit over the whole way
                    None => {
                        let way: f64 =
                            (0..points.len()).map(|k| (points[(k + 1) % points.len()] - points[k]).abs()).sum();
                        loss += branch.limit * way;
                    }
                    // behind a spring: the force follows until it meets the limit; the second round is periodic
                    Some(stiffness) => {
                        let (mut force, mut at) = (0.0, points[points.len() - 1]);
                        for round in 0..3 {
                            for &to in &points {
                                let trial: f64 = force + stiffness * (to - at);
                                let clamped = trial.clamp(-branch.limit, branch.limit);
                                if round == 2 {
                                    loss += branch.limit * (trial - clamped).abs() / stiffness;
                                }
                                (force, at) = (clamped, to);
                            }
                        }
                    }
                }
            }
            let orbit = exact(&moved(row.sample(), history(seed)).assemble().unwrap(), 10.0);
            near(&format!("{}, seed {seed}", row.name), orbit.energy.friction, loss, 1e-9 * loss.max(1e-9));
            compared += 1;
        }
    }
    assert_eq!(compared, 80, "coulomb and jenkins");
}

#[test]
fn rest_stays_at_rest() {
    for row in TABLE {
        let model = Model {
            masses: vec![Mass::new("m", 0.3)],
            springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: 100.0, damping: 0.1 }],
            joints: vec![Joint { name: "joint".into(), between: ["m".into(), GROUND.into()], law: row.sample() }],
            ..Model::default()
        };
        for omega in [0.1, 18.0, 500.0] {
            let orbit = orbit(&model, omega);
            assert_eq!(orbit.places[0].amplitude(), 0.0, "{}", row.name);
            assert_eq!((orbit.energy.work_in, orbit.energy.friction), (0.0, 0.0), "{}", row.name);
        }
    }
}

/// Ten times faster: the same loop, for laws that are networks of ideal sliders. The smooth ones depend on speed, and their
/// group `alpha w` brings the loop back.
#[test]
fn loops_do_not_depend_on_speed() {
    for row in TABLE {
        let law = row.sample();
        let faster = match law {
            Arc::new(mut law) => {
                law.alpha /= 10.0;
                Arc::new(law)
            }
            Arc::new(mut law) => {
                law.alpha /= 10.0;
                Arc::new(law)
            }
            rate_independent => {
                assert!(rate_independent.sliders().is_some());
                rate_independent
            }
        };
        for seed in 0..10 {
            let (slow, fast) = (orbit(&moved(law, history(seed)), 20.0), orbit(&moved(faster, history(seed)), 200.0));
            near(
                row.name,
                fast.energy.friction,
                slow.energy.friction,
                1e-9 * slow.energy.friction.max(1e-3 * law.scale()),
            );
            for k in 0..101 {
                let [a, b] =
                    [&slow, &fast].map(|orbit| orbit.sample(orbit.period() * (f64::from(k) + 0.3) / 101.0).joints[0]);
                near(row.name, b.displacement, a.displacement, 1e-15);
                near(row.name, b.force, a.force, 1e-7 * law.scale());
            }
        }
    }
}

/// The regularised law tends to the exact one: the loss as width for a rigid slider, as width^(2/3) behind a spring.
#[test]
fn regularised_tends_to_exact() {
    for row in TABLE {
        let law = row.sample();
        let Some(_) = law.regularised(1.0) else {
            assert!(law.sliders().is_none(), "{} is exact and has no smooth neighbour", row.name);
            continue;
        };
        let order =
            if law.sliders().unwrap().iter().all(|branch| branch.stiffness.is_none()) { 1.0 } else { 2.0 / 3.0 };
        let motion = vec![Motion { on: "mover".into(), amplitude: 1e-3, phase: 0.0, harmonic: 1 }];
        let omega = 100.0;
        let reference = exact(&moved(law, motion.clone()).assemble().unwrap(), omega).energy.friction;
        let errors: Vec<f64> = [1e-5, 1e-6, 1e-7]
            .iter()
            .map(|width| {
                let system = moved(law.regularised(*width).unwrap(), motion.clone()).assemble().unwrap();
                let method = Shooting { tolerance: 1e-11, width: None, ..Shooting::default() };
                let loss = method.solver(&system).unwrap().orbit(omega, None).unwrap().energy.friction;
                (loss / reference - 1.0).abs()
            })
            .collect();
        let orders: Vec<f64> = errors.windows(2).map(|pair| (pair[0] / pair[1]).log10()).collect();
        println!("{}: widths 1e-5 to 1e-7 m/s: errors {errors:?}, orders {orders:?}", row.name);
        near(&format!("{}: order", row.name), orders[1], order, 0.05);
    }
}

/// Dual numbers against central differences, for every smooth law at random motions and states.
#[test]
fn tangents_are_those_of_dual_numbers() {
    let mut laws = 0;
    for row in TABLE {
        let Some(law) = row.sample().rate() else { continue };
        let mut random = Random::new(7);
        laws += 1;
        assert!(law.states() <= 1, "the variables below are u, u' and one state");
        for _ in 0..200 {
            // velocities from creep to fast slip
            let point = [
                random.between(-1e-3, 1e-3),
                10f64.powf(random.between(-7.0, 0.0)) * if random.unit() < 0.5 { 1.0 } else { -1.0 },
                random.between(-8.0, 8.0),
            ];
            let plain = |x: [f64; 3]| {
                let (states, mut rate) = ([x[2]], [0.0]);
                let n = law.states();
                let force = law.evaluate(&Relative::along(x[0], x[1]), &states[..n], &mut rate[..n]);
                [force[0], rate[0]]
            };
            let zero = Dual::<3> { value: 0.0, partials: [0.0; 3] };
            let (states, mut rate, n) = ([Dual::variable(point[2], 2)], [zero], law.states());
            let contact = Relative::along(Dual::variable(point[0], 0), Dual::variable(point[1], 1));
            let force = law.evaluate(&contact, &states[..n], &mut rate[..n]);
            assert_eq!([force[0].value, rate[0].value], plain(point), "{}", row.name);
            let scales = [1e-3, point[1].abs(), 1.0];
            for k in 0..3 {
                let h = 1e-5 * scales[k];
                let (mut up, mut down) = (point, point);
                up[k] += h;
                down[k] -= h;
                let (up, down) = (plain(up), plain(down));
                for (i, exact) in [force[0].partials[k], rate[0].partials[k]].into_iter().enumerate() {
                    let difference = (up[i] - down[i]) / (2.0 * h);
                    // rounding of the values over the step, and the step squared
                    let digits = 1e-14 * plain(point)[i].abs().max(up[i].abs()) / h + 1e-8 * exact.abs();
                    near(&format!("{} at {point:?}, {i} by {k}", row.name), difference, exact, digits);
                }
            }
        }
    }
    assert_eq!(laws, 2, "coulomb-arctan and jenkins-arctan");
}

/// What each law says of itself. Odd: forces change their sign with the motion. Incrementally passive: from rest, the difference of two motions
/// never gives back more than it took, `∫ δf δu' dt ≥ 0`. By orbits of two different drives that begin with equal states it cannot be tested, so
/// smooth laws are integrated here (implicit midpoint rule, which keeps monotonicity), and exact ones replayed.
#[test]
fn what_laws_say_of_themselves() {
    for row in TABLE {
        let law = row.sample();
        let smooth = law.regularised(1e-4);
        assert!(law.is_odd() && law.is_incrementally_passive(), "{}", row.name);
        assert!(smooth.is_none_or(|smooth| smooth.is_incrementally_passive()), "{}: its smooth neighbour", row.name);
        let (mut least, mut most) = (0.0f64, 0.0f64);
        for seed in 0..20 {
            let (one, two) = (forces(law, &history(seed), 1.0), forces(law, &history(seed + 100), 1.0));
            let mirrored = forces(law, &history(seed), -1.0);
            let mut taken = 0.0;
            for (k, (a, b)) in one.iter().zip(&two).enumerate() {
                taken += (a.1 - b.1) * (a.0 - b.0);
                (least, most) = (least.min(taken), most.max(taken));
                assert!((mirrored[k].1 + a.1).abs() <= 1e-9 * law.scale(), "{}, seed {seed}", row.name);
            }
        }
        println!("{}: the difference of two motions took between {least:.2e} and {most:.2e} J", row.name);
        assert!(least >= -1e-9 * most && most > 0.0, "{}: {least} {most}", row.name);
    }
}

/// Relative motion in each step and force, from rest without force, over two periods of `sign` times the history.
fn forces(law: SharedLaw, motions: &[Motion], sign: f64) -> Vec<(f64, f64)> {
    const STEPS: u32 = 2000;
    let omega = 10.0;
    let step = TAU / omega / f64::from(STEPS);
    let branches = law.sliders();
    let mut held = vec![0.0; branches.as_ref().map_or(0, Vec::len)];
    let mut z = 0.0;
    let place = |k: u32| sign * kinematics(motions, TAU * f64::from(k) / f64::from(STEPS)).0;
    (0..2 * STEPS)
        .map(|k| {
            let way = place(k + 1) - place(k);
            let force = match (&branches, law.rate()) {
                (Some(branches), _) => branches
                    .iter()
                    .zip(&mut held)
                    .map(|(branch, held)| {
                        *held = match branch.stiffness {
                            Some(kt) => (*held + kt * way).clamp(-branch.limit, branch.limit),
                            None => branch.limit * way.signum(),
                        };
                        *held
                    })
                    .sum(),
                (None, Some(smooth)) => {
                    let contact = Relative::along(0.0, way / step);
                    let mut rate = [0.0];
                    let states = smooth.states();
                    if states == 1 {
                        // z - z₀ = h g(z) by bisection: g falls where the state has gone too far
                        let before = z;
                        let (mut low, mut high) = (before - 40.0, before + 40.0);
                        for _ in 0..100 {
                            z = 0.5 * (low + high);
                            smooth.evaluate(&contact, &[z], &mut rate);
                            if z - before - step * rate[0] > 0.0 { high = z } else { low = z }
                        }
                    }
                    smooth.evaluate(&contact, &[z][..states], &mut rate[..states])[0]
                }
                (None, None) => panic!("{} has no view", law.name()),
            };
            (way, force)
        })
        .collect()
}
