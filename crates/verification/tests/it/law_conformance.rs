//! Conformance tests for every law of the table, through each view that it offers.
//!
//! A law creates no energy and stays at rest without motion. Its derivatives equal differences,
//! and its own statements about itself hold. All of its views agree. The smoothed law tends to
//! the law. It refuses invalid parameters.

#![allow(clippy::print_stdout)] // tests print measured values

use num_complex::Complex64;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use stickslip::law::{
    BuildError, LawError, LawInfo, MAX_DIRECTIONS, Range, RatePoint, RelativeMotion, SharedLaw, StepPoint, TABLE, find,
};
use stickslip::method::Method;
use stickslip::method::auto::Auto;
use stickslip::model::{GROUND, Joint, Mass, Model, Motion, Spring};
use stickslip_verification::law_driver::{Instant, View, dissipated, forces, random_motion, steps, views};
use stickslip_verification::{Random, exact, near};

/// Samples of a period, fine enough for the smooth laws. Their steepest slope spans a
/// thousandth of the largest velocity.
const SAMPLES: usize = 2000;

/// Largest energy that the trapezoidal rule may seem to create, over the largest force times
/// the path length. For a lossless spring the error is 1e-6.
const QUADRATURE: f64 = 1e-5;

/// Returns the largest size of the forces.
fn largest(forces: &[[f64; MAX_DIRECTIONS]]) -> f64 {
    forces.iter().flatten().fold(0.0, |most, force| most.max(force.abs()))
}

/// Returns the length of the path between the times.
fn way(motion: &dyn Fn(f64) -> Instant, times: &[f64]) -> f64 {
    let places: Vec<_> = times.iter().map(|&time| motion(time).0).collect();
    let each = |pair: &[[f64; MAX_DIRECTIONS]]| {
        (0..MAX_DIRECTIONS).map(|a| (pair[1][a] - pair[0][a]).powi(2)).sum::<f64>().sqrt()
    };
    places.windows(2).map(each).sum()
}

#[test]
fn rows_are_complete() {
    let mut names = BTreeSet::new();
    for row in TABLE {
        let law = row.sample();
        assert!(names.insert(row.name), "{} appears twice", row.name);
        assert!(std::ptr::eq(find(row.name).unwrap(), *row));
        assert!((1..=MAX_DIRECTIONS).contains(&law.directions()), "{}", row.name);
        assert!(!views(&*law).is_empty(), "{} offers no view", row.name);
        assert_eq!(law.values(), row.sample, "{}: values come back as they were given", row.name);
        assert!(law.check().is_ok() && law.force_scale() > 0.0, "{}", row.name);
        assert!(std::ptr::eq(law.info(), *row));
        let keys: BTreeSet<_> = row.parameters.iter().map(|p| p.key).collect();
        assert_eq!(keys.len(), row.parameters.len(), "{}: a key appears twice", row.name);
        for parameter in row.parameters {
            assert!(parameter.power.is_none_or(|power| keys.contains(power)), "{}: {}", row.name, parameter.key);
            assert!(
                parameter.default.is_none_or(|value| parameter.range.contains(value)),
                "{}: {}",
                row.name,
                parameter.key
            );
        }
    }
}

fn sample(row: &'static LawInfo) -> BTreeMap<&'static str, f64> {
    row.parameters.iter().map(|p| p.key).zip(row.sample.iter().copied()).collect()
}

#[test]
fn parameters_out_of_range_are_refused_with_their_key() {
    for row in TABLE {
        assert!(row.build(&sample(row)).unwrap() == row.sample(), "{}", row.name);
        for parameter in row.parameters {
            let mut wrong = vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
            match parameter.range {
                Range::Positive => wrong.extend([0.0, -1.0]),
                Range::ZeroOrMore => wrong.push(-1e-9),
                Range::Any => {}
                Range::Within(least, most) => wrong.extend([least - 1e-9, most + 1e-9]),
                Range::UpTo(most) => wrong.extend([-1.0, 1.5, f64::from(most) + 1.0]),
                Range::Count(most) => wrong.extend([0.0, -1.0, 1.5, f64::from(most) + 1.0]),
            }
            for value in wrong {
                let mut values = sample(row);
                values.insert(parameter.key, value);
                match row.build(&values) {
                    Err(BuildError::Value(LawError::Value { key, law, .. })) => {
                        assert_eq!((key, law), (parameter.key, row.name));
                    }
                    other => panic!("{}: `{}` = {value} gave {other:?}", row.name, parameter.key),
                }
            }
            let mut values = sample(row);
            values.remove(parameter.key);
            match (row.build(&values), parameter.default) {
                (Ok(law), Some(default)) => assert_eq!(law.value(parameter.key), Some(default), "{}", row.name),
                (Err(BuildError::Missing { keys, .. }), None) => assert_eq!(keys, [parameter.key]),
                // a default may require another value together with it
                (Err(BuildError::Value(LawError::Inconsistent { .. })), Some(_)) => {}
                (other, _) => panic!("{}: without `{}` {other:?}", row.name, parameter.key),
            }
        }
    }
}

/// In the fifth of equal periods the state repeats, and the energy lost over it is never
/// negative.
#[test]
fn no_energy_is_created_over_closed_histories() {
    for row in TABLE {
        let law = row.sample();
        let (mut least, mut most) = (f64::INFINITY, 0.0f64);
        for view in views(&*law) {
            for seed in 0..4 {
                for speed in [0.1, 20.0] {
                    let motion = random_motion(seed, law.directions(), speed);
                    let times = steps(1.0 / speed, 5, SAMPLES);
                    let found = forces(&*law, view, &motion, &times);
                    let (times, found) = (&times[4 * SAMPLES..], &found[4 * SAMPLES..]);
                    let share = dissipated(&motion, times, found)
                        / (largest(found) * way(&motion, times)).max(f64::MIN_POSITIVE);
                    assert!((-QUADRATURE..=1.0).contains(&share), "{} by {view:?}, seed {seed}: {share}", row.name);
                    (least, most) = (least.min(share), most.max(share));
                }
            }
        }
        println!("{}: lost {least:.1e} to {most:.3} of largest force times way", row.name);
    }
}

/// Without motion the only force is a preload along a normal, and it stays constant.
#[test]
fn rest_stays_at_rest() {
    for row in TABLE {
        let law = row.sample();
        for view in views(&*law) {
            let found = forces(&*law, view, &|_| ([0.0; 3], [0.0; 3]), &steps(1.0, 1, 100));
            for force in &found {
                assert_eq!(force, &found[0], "{} by {view:?}", row.name);
                let pressed = if law.is_odd() { law.directions() } else { law.directions() - 1 };
                assert!(force[..pressed].iter().all(|force| *force == 0.0), "{} by {view:?}: {force:?}", row.name);
            }
        }
    }
}

/// A body at rest stays at rest with every law of one direction that `auto` takes.
#[test]
fn bodies_without_a_force_stay_at_rest() {
    for row in TABLE {
        let model = Model {
            masses: vec![Mass::new("m", 0.3)],
            springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: 100.0, damping: 0.1 }],
            joints: vec![Joint { name: "joint".into(), between: ["m".into(), GROUND.into()], law: row.sample() }],
            ..Model::default()
        };
        if row.sample().directions() > 1 {
            continue;
        }
        let system = model.assemble().unwrap();
        let Ok(mut solver) = Auto.solver(&system) else { continue };
        for omega in [0.1, 18.0, 500.0] {
            let orbit = solver.orbit(omega).unwrap();
            assert_eq!(orbit.places[0].amplitude(), 0.0, "{}", row.name);
            assert_eq!((orbit.energy.work_in, orbit.energy.friction), (0.0, 0.0), "{}", row.name);
        }
    }
}

/// For laws that consist of sliders, an orbit of the exact method agrees with a replay.
#[test]
fn exact_orbits_equal_the_replay_of_their_sliders() {
    for row in TABLE {
        let law = row.sample();
        let Some(sliders) = law.sliders() else { continue };
        for seed in 0..10 {
            let mut random = Random::new(seed);
            let motions: Vec<Motion> = [1u32, 2 + u32::from(seed % 2 == 0)]
                .map(|harmonic| Motion {
                    on: "mover".into(),
                    amplitude: random.between(1e-4, 1e-3) / f64::from(harmonic),
                    phase: random.between(0.0, TAU),
                    harmonic,
                })
                .into();
            let place = |theta: f64| -> f64 {
                motions.iter().map(|m| m.amplitude * (f64::from(m.harmonic) * theta + m.phase).cos()).sum()
            };
            // step from sample to sample; the second period is periodic. Turning points between
            // samples have an error of the square of the step
            let count = 200_000;
            let mut held = vec![0.0; sliders.len()];
            let (mut loss, mut before) = (0.0, place(0.0));
            for k in 1..=2 * count {
                let to = place(TAU * f64::from(k) / f64::from(count));
                for (slider, held) in sliders.iter().zip(&mut held) {
                    let slipped = match slider.stiffness {
                        None => (to - before).abs(),
                        Some(stiffness) => {
                            let trial: f64 = *held + stiffness * (to - before);
                            *held = trial.clamp(-slider.limit, slider.limit);
                            (trial - *held).abs() / stiffness
                        }
                    };
                    loss += if k > count { slider.limit * slipped } else { 0.0 };
                }
                before = to;
            }
            let model = Model {
                joints: vec![Joint {
                    name: "joint".into(),
                    between: ["mover".into(), GROUND.into()],
                    law: law.clone(),
                }],
                motions,
                ..Model::default()
            };
            let orbit = exact(&model.assemble().unwrap(), 10.0);
            near(&format!("{}, seed {seed}", row.name), orbit.energy.friction, loss, 1e-8 * loss.max(1e-6));
        }
    }
}

/// All views of a law give the same force. A law with pieces or a step does not depend on time,
/// so its other views agree at ten times the speed.
#[test]
fn views_agree_at_any_speed_that_they_know() {
    for row in TABLE {
        let law = row.sample();
        let views = views(&*law);
        let timeless = views.iter().any(|view| matches!(view, View::Pieces | View::Step));
        for seed in 0..3 {
            let run = |view: View, speed: f64| {
                let motion = random_motion(seed, law.directions(), speed);
                forces(&*law, view, &motion, &steps(1.0 / speed, 2, 4 * SAMPLES))
            };
            let reference = run(views[0], 0.5);
            let speeds: &[f64] = if timeless { &[0.5, 5.0] } else { &[0.5] };
            for &view in &views {
                for &speed in speeds {
                    let other = run(view, speed);
                    let differences = reference.iter().zip(&other).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
                    // single samples at a reversal of a rigid slider may differ; the mean may
                    // not
                    let mean = differences.sum::<f64>() / reference.len() as f64;
                    assert!(mean <= 1e-3 * largest(&reference), "{}: {view:?} differs by {mean}", row.name);
                }
            }
        }
    }
}

/// Compares a derivative with central differences. The tolerance is the difference between the
/// one-sided differences, which is large only at a kink.
fn derivative_is_difference(what: &str, value: impl Fn(f64) -> f64, derivative: f64, h: f64) {
    let [down, here, up] = [-h, 0.0, h].map(&value);
    let central = (up - down) / (2.0 * h);
    let one_sided = ((up - here) / h - (here - down) / h).abs();
    let rounding = 1e-14 * (up.abs() + down.abs() + here.abs()) / h;
    near(what, derivative, central, one_sided + rounding + 1e-8 * derivative.abs());
}

#[test]
fn derivatives_of_rates_are_differences() {
    for row in TABLE {
        let law = row.sample();
        let Some(rate) = law.rate() else { continue };
        let (n, states) = (law.directions(), rate.states());
        let mut random = Random::new(7);
        for _ in 0..300 {
            // velocities from creep to fast slip
            let mut x: Vec<f64> = (0..n).map(|_| random.between(-1e-3, 1e-3)).collect();
            x.extend(
                (0..n).map(|_| 10f64.powf(random.between(-7.0, 0.0)) * if random.unit() < 0.5 { 1.0 } else { -1.0 }),
            );
            x.extend((0..states).map(|_| rate.state_scale() * random.between(-1.2, 1.2)));
            let value = |x: &[f64], row: usize| {
                let mut motion = RelativeMotion::along(0.0, 0.0);
                motion.displacement[..n].copy_from_slice(&x[..n]);
                motion.velocity[..n].copy_from_slice(&x[n..2 * n]);
                let mut rates = vec![0.0; states];
                let force = rate.evaluate_values(&motion, &x[2 * n..], &mut rates);
                if row < n { force[row] } else { rates[row - n] }
            };
            let mut point = RatePoint::new(n, states);
            let mut motion = RelativeMotion::along(0.0, 0.0);
            motion.displacement[..n].copy_from_slice(&x[..n]);
            motion.velocity[..n].copy_from_slice(&x[n..2 * n]);
            rate.evaluate_with_derivatives(n, &motion, &x[2 * n..], &mut point);
            for out in 0..n + states {
                let slopes = if out < n { point.force_slope(out) } else { point.rate_slope(out - n) };
                for k in 0..x.len() {
                    let scale = if k < n {
                        1e-3
                    } else if k < 2 * n {
                        x[k].abs()
                    } else {
                        rate.state_scale()
                    };
                    let moved = |d: f64| {
                        let mut x = x.clone();
                        x[k] += d;
                        value(&x, out)
                    };
                    derivative_is_difference(
                        &format!("{}: {out} by {k} at {x:?}", row.name),
                        moved,
                        slopes[k],
                        1e-6 * scale,
                    );
                }
            }
        }
    }
}

#[test]
fn derivatives_of_steps_are_differences() {
    for row in TABLE {
        let law = row.sample();
        let Some(step) = law.step() else { continue };
        let (n, states) = (law.directions(), step.states());
        let mut random = Random::new(8);
        for _ in 0..300 {
            let mut x: Vec<f64> = (0..2 * n).map(|_| random.between(-1e-3, 1e-3)).collect();
            // states within the current limit of the contact: the result of a step from zero
            let places = |x: &[f64]| {
                let (mut from, mut to) = ([0.0; 3], [0.0; 3]);
                from[..n].copy_from_slice(&x[..n]);
                to[..n].copy_from_slice(&x[n..2 * n]);
                (from, to)
            };
            let mut z = vec![0.0; states];
            let mut start = places(&x).0;
            start[0] += random.between(-1e-4, 1e-4);
            step.advance_values(&start, &places(&x).0, &mut z);
            x.extend(z.iter().map(|z| 0.99 * z));
            let value = |x: &[f64], row: usize| {
                let (from, to) = places(x);
                let mut z = x[2 * n..].to_vec();
                let force = step.advance_values(&from, &to, &mut z);
                if row < n { force[row] } else { z[row - n] }
            };
            let mut point = StepPoint::new(n, states);
            let (from, to) = places(&x);
            step.advance_with_derivatives(n, &from, &to, &x[2 * n..], &mut point);
            for out in 0..n + states {
                let slopes = if out < n { point.force_slope(out) } else { point.state_slope(out - n) };
                // do not vary an unused leg of a Masing history: a nonzero value of either sign
                // would be another history
                let varies = |k: &usize| *k < 2 * n || x[*k] != 0.0 || law.masing().is_none();
                for k in (0..x.len()).filter(varies) {
                    let scale = if k < 2 * n { 1e-3 } else { step.state_scale() };
                    let moved = |d: f64| {
                        let mut x = x.clone();
                        x[k] += d;
                        value(&x, out)
                    };
                    derivative_is_difference(
                        &format!("{}: {out} by {k} at {x:?}", row.name),
                        moved,
                        slopes[k],
                        1e-6 * scale,
                    );
                }
            }
        }
    }
}

#[test]
fn resolvents_solve_their_equation_and_have_its_slope() {
    for row in TABLE {
        let law = row.sample();
        let Some(prox) = law.prox() else { continue };
        let n = law.directions();
        let mut random = Random::new(9);
        for _ in 0..300 {
            let penalty = 2.0 * prox.minimum_penalty() + 10f64.powf(random.between(-3.0, 5.0));
            let y: Vec<f64> = (0..n).map(|_| law.force_scale() * random.between(-3.0, 3.0)).collect();
            let resolve = |y: &[f64]| {
                let (mut force, mut slope) = (vec![0.0; n], vec![0.0; n * n]);
                prox.resolve(y, penalty, &mut force, &mut slope);
                (force, slope)
            };
            let (force, slope) = resolve(&y);
            // compare with the law at the velocity that follows from the resolvent
            if n == 1
                && let Some((at, _)) = prox.force_at_velocity((y[0] - force[0]) / penalty)
            {
                near(row.name, at, force[0], 1e-9 * law.force_scale());
            }
            for out in 0..n {
                for k in 0..n {
                    let moved = |d: f64| {
                        let mut y = y.clone();
                        y[k] += d;
                        resolve(&y).0[out]
                    };
                    let what = format!("{}: {out} by {k} at {y:?}, penalty {penalty}", row.name);
                    derivative_is_difference(&what, moved, slope[out * n + k], 1e-6 * law.force_scale());
                }
            }
        }
    }
}

/// The statements of each law about itself hold.
///
/// For an odd law, forces change their sign with the motion; for other laws, a motion shows
/// that they do not. For an incrementally passive law, `∫ δf · δu' dt ≥ 0` from rest: the
/// difference of two motions never gives back more energy than it took.
#[test]
fn oddness_and_passivity_hold() {
    for row in TABLE {
        let sample = row.sample();
        for law in [Some(sample.clone()), sample.smooth_counterpart(1e-4)].into_iter().flatten() {
            let (mut least, mut most, mut oddest) = (0.0f64, 0.0f64, 0.0f64);
            for view in views(&*law) {
                for seed in 0..5 {
                    let times = steps(2.0, 2, SAMPLES);
                    let one = random_motion(seed, law.directions(), 0.5);
                    let two = random_motion(seed + 100, law.directions(), 0.5);
                    let mirrored = |time: f64| {
                        let (u, v) = one(time);
                        (u.map(|u| -u), v.map(|v| -v))
                    };
                    let [f, g, m] = [&one as &dyn Fn(f64) -> Instant, &two, &mirrored]
                        .map(|motion| forces(&*law, view, motion, &times));
                    let odd =
                        f.iter().zip(&m).flat_map(|(f, m)| (0..3).map(|a| (f[a] + m[a]).abs())).fold(0.0, f64::max);
                    oddest = oddest.max(odd / largest(&f).max(1e-12));
                    if !law.is_incrementally_passive() {
                        continue;
                    }
                    let mut taken = 0.0;
                    for k in 0..times.len() - 1 {
                        let way = |motion: &dyn Fn(f64) -> Instant, a: usize| {
                            motion(times[k + 1]).0[a] - motion(times[k]).0[a]
                        };
                        // use the forces after the step, as implicit steps do; this preserves
                        // monotonicity
                        taken +=
                            (0..3).map(|a| (f[k + 1][a] - g[k + 1][a]) * (way(&one, a) - way(&two, a))).sum::<f64>();
                        (least, most) = (least.min(taken), most.max(taken));
                    }
                }
            }
            if law.is_odd() {
                assert!(oddest <= 1e-9, "{} is not odd: {oddest}", law.name());
            } else {
                assert!(oddest > 1e-3, "{} is odd", law.name());
            }
            if law.is_incrementally_passive() {
                println!("{}: the difference of two motions took between {least:.2e} and {most:.2e} J", law.name());
                assert!(least >= -1e-4 * most && most > 0.0, "{}: {least} {most}", law.name());
            }
        }
    }
}

/// The smoothed law tends to the law as its width goes to zero. At a tenth of the width, the
/// mean difference of the forces is less than a third.
#[test]
fn smooth_neighbours_tend_to_the_law() {
    for row in TABLE {
        let law = row.sample();
        if law.smooth_counterpart(1.0).is_none() {
            continue;
        }
        let motion = random_motion(3, law.directions(), 1.0);
        let times = steps(1.0, 2, 4 * SAMPLES);
        let reference = forces(&*law, views(&*law)[0], &motion, &times);
        let errors: Vec<f64> = [1e-3, 1e-4, 1e-5]
            .iter()
            .map(|&width| {
                let smooth = law.smooth_counterpart(width).unwrap();
                let found = forces(&*smooth, View::Rate, &motion, &times);
                let differences = reference.iter().zip(&found).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
                differences.sum::<f64>() / reference.len() as f64 / law.force_scale()
            })
            .collect();
        println!("{}: widths 1e-3 to 1e-5 m/s: mean differences {errors:?} of its scale", row.name);
        assert!(errors[2] < 0.02 && errors.windows(2).all(|pair| pair[1] < pair[0] / 3.0), "{}: {errors:?}", row.name);
    }
}

/// A law without a slip limit carries no force.
#[test]
fn free_laws_carry_no_force() {
    for row in TABLE {
        let Some(law) = row.sample().frictionless_reference() else { continue };
        let motion = random_motion(1, law.directions(), 1.0);
        for view in views(&*law) {
            let found = forces(&*law, view, &motion, &steps(1.0, 1, 100));
            assert!(!law.carries_no_force() || largest(&found) == 0.0, "{} by {view:?}", row.name);
        }
    }
}

/// The describing function, in closed form or not, equals the first harmonic of each view.
#[test]
fn describing_functions_are_first_harmonics() {
    for row in TABLE {
        let law = row.sample();
        for amplitude in [1e-4, 1e-3] {
            // fast compared with the width of the smooth laws; `describing_function` uses their
            // exact laws
            let omega = 300.0;
            let motion = |time: f64| {
                let (sin, cos) = (omega * time).sin_cos();
                ([amplitude * cos, 0.0, 0.0], [-amplitude * omega * sin, 0.0, 0.0])
            };
            let linear = law.describing_function(amplitude, omega);
            for view in views(&*law) {
                let times = steps(TAU / omega, 4, SAMPLES);
                let found = forces(&*law, view, &motion, &times);
                let mut sum = Complex64::new(0.0, 0.0);
                for k in 3 * SAMPLES..4 * SAMPLES {
                    sum += Complex64::cis(-omega * times[k]) * found[k][0];
                }
                let first = sum * (2.0 / (SAMPLES as f64 * amplitude));
                let error = (first - linear).norm() / first.norm().max(1e-3 * largest(&found) / amplitude).max(1e-300);
                assert!(error < 0.05, "{} by {view:?} at {amplitude}: {linear} instead of {first}", row.name);
            }
        }
    }
}

/// Threads can share a law.
#[test]
fn laws_are_shared() {
    fn shared<T: Send + Sync>(_: &T) {}
    for row in TABLE {
        let law: SharedLaw = row.sample();
        shared(&law);
        assert!(*law == *row.sample(), "{}", row.name);
    }
}
