//! Classification of the motion from static equilibrium where no orbit was found.
//!
//! The motion is integrated in time. It settles, repeats after several periods, drifts away, or
//! does none of these. If it settles, the caller can search for the orbit again from its end.

use crate::law::Contact;
use crate::method::flow::Flow;
use crate::method::flow::average_acceleration::equal_steps::AverageAccelerationFlow;
use crate::method::flow::integrator_choice::IntegratorKind;
use crate::model::{Axis, System};
use crate::orbit::{ObservedMotion, Path, Sample, Symmetry};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Settings of the integration and of the classification.
#[derive(Debug, Clone, Copy)]
struct SettlingSettings {
    /// Steps per period. With 256 steps the ringing of stuck contacts keeps motions from settling
    /// that settle with 1024.
    steps: usize,
    /// Periods over which the excitation grows from zero. An excitation that starts at once
    /// excites vibrations of stuck contacts, which hardly anything damps.
    growth: usize,
    /// Periods until the first classification. While the motion has not settled, the number
    /// doubles.
    periods: usize,
    /// Most periods. This is ten times the decay time of a mode with 0.1 % of critical damping.
    most_periods: usize,
    /// Number of last returns that the classification uses.
    window: usize,
    /// Largest number of periods after which a motion may repeat.
    repeats: usize,
    /// Relative distance, in amplitudes, below which two returns count as equal. It covers the end
    /// of a transient and the error of the steps.
    equal_distance: f64,
    /// Largest ratio of the distances between returns, half a window apart, of a settling motion.
    /// Beats exceed it now and then; the test applies it twice to make errors rare.
    settling_ratio: f64,
    /// Displacement over the window, in amplitudes, above which a place drifts.
    drift_distance: f64,
    /// Instants of the last period at which the contacts are sampled.
    instants: usize,
}

impl Default for SettlingSettings {
    fn default() -> Self {
        SettlingSettings {
            steps: 1024,
            growth: 160,
            periods: 80,
            most_periods: 1280,
            window: 33,
            repeats: 8,
            equal_distance: 2e-3,
            settling_ratio: 0.9,
            drift_distance: 2.0,
            instants: 128,
        }
    }
}

/// A motion that was integrated.
pub(crate) struct ClassifiedMotion {
    pub course: ObservedMotion,
    /// The last period.
    pub path: Arc<dyn Path>,
    /// The state at the end.
    pub state: Vec<f64>,
    /// Number of multiplications of the integration, roughly.
    pub multiplications: f64,
}

/// Classifies the motion from a state with at most about this number of multiplications.
///
/// Returns `None` if the first classification takes more, if no integration in equal steps takes
/// the system, or if it breaks down.
pub(crate) fn classify_motion(
    system: &System,
    omega: f64,
    mut start: Vec<f64>,
    most_multiplications: f64,
) -> Option<ClassifiedMotion> {
    let settings = SettlingSettings::default();
    if IntegratorKind::of(system, None) != IntegratorKind::Incremental {
        return None;
    }
    let mut flow = AverageAccelerationFlow::new(system, None, "what follows a motion").ok()?;
    flow.count = settings.steps;
    let per_period = settings.steps as f64 * flow.step_multiplications();
    let multiplications = |periods: usize| (settings.growth + periods) as f64 * per_period;
    if multiplications(settings.periods) > most_multiplications {
        return None;
    }
    let (n, period) = (system.dofs(), TAU / omega);
    start.resize(flow.states(), 0.0);
    let mut state = start;
    flow.set_excitation(system, omega);
    let excitation = flow.excitation.clone();
    for grown in 1..settings.growth {
        let share = 0.5 - 0.5 * (PI * grown as f64 / settings.growth as f64).cos();
        flow.excitation = excitation.scaled(share);
        flow.run(&mut state, period, None).ok()?;
    }
    flow.excitation = excitation;
    let mut returns = VecDeque::with_capacity(settings.window);
    let (mut count, mut next) = (0, settings.periods);
    loop {
        count += 1;
        flow.set_recording(count == next);
        flow.run(&mut state, period, None).ok()?;
        if returns.len() == settings.window {
            returns.pop_front();
        }
        returns.push_back(state[..2 * n].to_vec());
        if count < next {
            continue;
        }
        let path = flow.path(&Arc::new(system.clone()), Symmetry::FullPeriod, period);
        let samples: Vec<_> =
            (0..settings.instants).map(|i| path.sample(period * i as f64 / settings.instants as f64)).collect();
        let course = classified(system, omega, (count, returns.make_contiguous()), &samples);
        let may_settle = matches!(course, ObservedMotion::Settling { .. } | ObservedMotion::Irregular { .. });
        next *= 2;
        if !may_settle || next > settings.most_periods || multiplications(next) > most_multiplications {
            return Some(ClassifiedMotion { course, path, state, multiplications: multiplications(count) });
        }
    }
}

fn classified(
    system: &System,
    omega: f64,
    (periods, returns): (usize, &[Vec<f64>]),
    samples: &[Sample],
) -> ObservedMotion {
    let settings = SettlingSettings::default();
    let n = system.dofs();
    // displacements, and velocities over Ω
    let unit = |i: usize| if i < n { 1.0 } else { omega };
    let velocities = returns.iter().flat_map(|state| &state[n..]).chain(samples.iter().flat_map(|now| &now.velocity));
    let swing = velocities.fold(0.0, |m: f64, v| m.max(v.abs() / omega));
    let last = returns.len() - 1;
    let apart_at = |end: usize, p: usize| {
        let pairs = (0..=settings.repeats).map(|k| (&returns[end - k], &returns[end - k - p]));
        let each = pairs.flat_map(|(a, b)| a.iter().zip(b).enumerate().map(|(i, (a, b))| (a - b).abs() / unit(i)));
        each.fold(0.0, f64::max)
    };
    let apart = |p: usize| apart_at(last, p);
    if let Some(periods) = (1..=settings.repeats).find(|p| apart(*p) <= settings.equal_distance * swing) {
        return if periods == 1 { ObservedMotion::Settles } else { ObservedMotion::Repeats { periods } };
    }
    if apart(1) <= settings.settling_ratio * apart_at(last / 2, 1)
        && apart_at(last / 2, 1) <= settings.settling_ratio * apart_at(settings.repeats + 1, 1)
    {
        return ObservedMotion::Settling { periods };
    }
    let open = |j: usize| {
        samples.iter().filter(|now| now.joints[j].contact == Contact::Open).count() as f64 / samples.len() as f64
    };
    let widest = (0..system.joints().len()).map(|j| (j, open(j))).fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    let joint = system.joints().get(widest.0).map_or_else(String::new, |joint| joint.name().to_owned());
    let share = widest.1;
    // a drift has the same direction in both halves of the window
    let moved =
        |axis: &Axis, from: usize, to: usize| axis.component(&returns[to][..n]) - axis.component(&returns[from][..n]);
    let displacements = system.place_axes().iter().zip(system.places()).filter(|(axis, _)| !axis.is_rotation());
    let farthest = displacements.map(|(axis, place)| {
        let halves = [moved(axis, 0, last / 2), moved(axis, last / 2, last)];
        let steady =
            halves[0] * halves[1] > 0.0 && halves[0].abs().min(halves[1].abs()) > 0.25 * (halves[0] + halves[1]).abs();
        (if steady { halves[0] + halves[1] } else { 0.0 }, Some((axis, place)))
    });
    // points of a body drift with it; a body comes before its points
    let farthest = farthest.fold((0.0, None), |a: (f64, _), b| if b.0.abs() > 1.01 * a.0.abs() { b } else { a });
    if let (drift, Some((axis, place))) = farthest
        && drift.abs() > settings.drift_distance * swing
    {
        let squares: f64 = axis.rows().iter().map(|(_, weight)| weight * weight).sum();
        let mass = axis.rows().iter().map(|(row, weight)| weight * weight * system.structure().diagonal_mass(*row));
        let mass = mass.sum::<f64>() / (squares * squares);
        return ObservedMotion::Drifts {
            place: place.as_str().into(),
            periods: last as u32,
            load: axis.component(system.constant_forces().as_slice()) / squares,
            speed: drift * omega / (last as f64 * TAU),
            spring: 0.01 * mass * omega * omega,
            joint: joint.into(),
            open_fraction: share,
        };
    }
    ObservedMotion::Irregular { periods, joint, open_fraction: share }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::FrictionContact;
    use crate::structure::Structure;
    use nalgebra::DMatrix;
    use num_complex::Complex64;

    const OMEGA: f64 = 200.0;

    /// Returns a mass of 1 kg along (x, z) on a contact with a preload of 10 N and a friction
    /// coefficient of 0.5. A harmonic force of 1 N acts along x, and the constant `load` along
    /// both.
    fn block(load: [f64; 2]) -> System {
        let law = FrictionContact { tangential: 1e5, normal: 2e5, friction: 0.5, preload: 10.0, tangents: 1 };
        let names = vec!["x".into(), "z".into()];
        let one = DMatrix::identity(2, 2);
        let structure = Structure::new(names, one.clone(), one * 60.0, DMatrix::zeros(2, 2)).unwrap();
        let axes = vec![Axis::new(vec![(0, 1.0)]), Axis::new(vec![(1, 1.0)])];
        let mut builder = System::builder(structure).joint("foot", Arc::new(law), axes);
        for (row, load) in load.into_iter().enumerate() {
            builder = builder.force(row, 0, Complex64::new(load, 0.0));
        }
        builder.force(0, 1, Complex64::new(1.0, 0.0)).build().unwrap()
    }

    fn classified_motion(system: &System) -> ClassifiedMotion {
        classify_motion(system, OMEGA, Vec::new(), f64::INFINITY).unwrap()
    }

    /// Nothing is integrated beyond the work limit.
    #[test]
    fn an_integration_keeps_within_its_work_limit() {
        let system = block([2.0, 10.0]);
        let used = classified_motion(&system).multiplications;
        assert!(classify_motion(&system, OMEGA, Vec::new(), 1.01 * used).is_some());
        assert!(classify_motion(&system, OMEGA, Vec::new(), 0.99 * used).is_none());
    }

    /// The block settles on its foot. A drag of 2 N above the friction moves it at
    /// `2 N/(60 kg/s)`; a lift of 3 N moves it at `3 N/(60 kg/s)`. Damping alone then balances
    /// the excess load.
    #[test]
    fn a_block_stays_slides_or_leaves() {
        assert_eq!(classified_motion(&block([2.0, 10.0])).course, ObservedMotion::Settles);
        for (load, along, speed) in [([7.0, 10.0], "x", 2.0 / 60.0), ([0.0, -3.0], "z", 3.0 / 60.0)] {
            let course = classified_motion(&block(load)).course;
            let ObservedMotion::Drifts { ref place, speed: measured, load: push, spring, open_fraction, .. } = course
            else {
                panic!("{course}")
            };
            assert_eq!(&**place, along);
            assert_eq!(push, load[0] + load[1] - if along == "x" { 10.0 } else { 0.0 });
            assert!((measured.abs() / speed - 1.0).abs() < 1e-3, "{measured} {speed}");
            // the block has 1 kg
            assert_eq!(spring, 0.01 * OMEGA * OMEGA);
            assert_eq!(open_fraction, if along == "z" { 1.0 } else { 0.0 });
            assert!(course.to_string().contains(&format!("`{along}`")), "{course}");
            // the force that lifts the block may have been meant to press it
            assert_eq!(course.to_string().contains("exchange the two places"), along == "z", "{course}");
        }
    }

    /// The classification distinguishes a motion that repeats every third period from a slowly
    /// settling and from an irregular one.
    #[test]
    fn what_repeats_is_told_from_what_does_not() {
        let settings = SettlingSettings::default();
        let system = block([0.0, 10.0]);
        let returns =
            |of: &dyn Fn(usize) -> f64| (0..settings.window).map(|k| vec![of(k), 0.0, 0.0, OMEGA]).collect::<Vec<_>>();
        let path = classified_motion(&system).path;
        let samples = [path.sample(0.0)];
        let third = classified(&system, OMEGA, (settings.periods, &returns(&|k| (k % 3) as f64)), &samples);
        assert_eq!(third, ObservedMotion::Repeats { periods: 3 });
        let slow = classified(&system, OMEGA, (settings.periods, &returns(&|k| (-0.02 * k as f64).exp())), &samples);
        assert_eq!(slow, ObservedMotion::Settling { periods: settings.periods });
        let none = classified(&system, OMEGA, (settings.periods, &returns(&|k| ((k * k) as f64).sin())), &samples);
        assert!(matches!(none, ObservedMotion::Irregular { periods, .. } if periods == settings.periods), "{none}");
    }
}
