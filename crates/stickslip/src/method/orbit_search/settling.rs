//! Classification of the motion from static equilibrium where no orbit was found.
//!
//! The motion is integrated in time. It settles, repeats after several periods, drifts away, or
//! does none of these. If it settles, the caller can search for the orbit again from its end.

use crate::law::Contact;
use crate::method::flow::Flow;
use crate::method::flow::average_acceleration::equal_steps::AverageAccelerationFlow;
use crate::method::flow::integrator_choice::IntegratorKind;
use crate::model::{Axis, System, soft_spring};
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
    /// `drift_distance` of a slow drift, in amplitudes of the place. It is above rounding.
    creep_distance: f64,
    /// Largest relative difference of the displacements in both halves of the window, in a drift
    /// and in a slow one. A transient with a decay time of 300 periods has 5 %.
    drift_evenness: f64,
    creep_evenness: f64,
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
            creep_distance: 1e-4,
            drift_evenness: 1.0,
            creep_evenness: 0.05,
            instants: 128,
        }
    }
}

/// A motion that was integrated.
pub(crate) struct ClassifiedMotion {
    pub course: ObservedMotion,
    /// A drift that is so slow that the motion counts as settled.
    pub creep: Option<ObservedMotion>,
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
        let returns: &[Vec<f64>] = returns.make_contiguous();
        let course = classified(system, omega, (count, returns), &samples);
        let may_settle = matches!(course, ObservedMotion::Settling { .. } | ObservedMotion::Irregular { .. });
        next *= 2;
        if !may_settle || next > settings.most_periods || multiplications(next) > most_multiplications {
            let creep =
                if course == ObservedMotion::Settles { slow_drift(system, omega, returns, &samples) } else { None };
            return Some(ClassifiedMotion { course, creep, path, state, multiplications: multiplications(count) });
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
    // displacements, and velocities divided by Ω
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
    let (joint, open_fraction) = most_open_joint(system, samples);
    // points of a body drift with it; a body comes before its points
    let displacements = system.place_axes().iter().zip(system.places()).filter(|(axis, _)| !axis.is_rotation());
    let drifts = displacements.map(|(axis, place)| (drift(axis, returns, settings.drift_evenness), (axis, place)));
    let farthest = drifts.reduce(|a, b| if b.0.abs() > 1.01 * a.0.abs() { b } else { a });
    match farthest {
        Some((drift, along)) if drift.abs() > settings.drift_distance * swing => {
            drifting(system, omega, along, (drift, last), (joint, open_fraction))
        }
        _ => ObservedMotion::Irregular { periods, joint, open_fraction },
    }
}

/// Returns the fastest drift of a motion that counts as settled, relative to the vibration of each
/// place; `None` if there is none. A place that springs pull back does not drift.
fn slow_drift(system: &System, omega: f64, returns: &[Vec<f64>], samples: &[Sample]) -> Option<ObservedMotion> {
    let settings = SettlingSettings::default();
    let moved: Vec<f64> =
        returns[returns.len() - 1].iter().zip(&returns[0]).map(|(last, first)| last - first).collect();
    let (mut force, mut largest) = (vec![0.0; system.dofs()], vec![0.0; system.dofs()]);
    for (row, column, stiffness) in system.structure().stiffness_entries() {
        force[row] += stiffness * moved[column];
        largest[row] += (stiffness * moved[column]).abs();
    }
    let is_held = |axis: &Axis| {
        let largest: f64 = axis.rows().iter().map(|(row, weight)| weight.abs() * largest[*row]).sum();
        axis.component(&force).abs() > 0.5 * largest
    };
    let places = system.place_axes().iter().zip(system.places()).filter(|(axis, _)| !is_held(axis));
    let relative = places.map(|(axis, place)| {
        let swing = samples.iter().map(|now| axis.component(&now.velocity).abs() / omega).fold(0.0, f64::max);
        let drift = drift(axis, returns, settings.creep_evenness);
        (if swing > 0.0 { drift.abs() / swing } else { 0.0 }, drift, (axis, place))
    });
    let (size, drift, along) = relative.reduce(|a, b| if b.0 > 1.01 * a.0 { b } else { a })?;
    let (last, open) = (returns.len() - 1, most_open_joint(system, samples));
    (size > settings.creep_distance).then(|| drifting(system, omega, along, (drift, last), open))
}

/// Returns the displacement along an axis over all returns, m (rad for a rotation); zero unless
/// both halves of the returns have the same direction and, within `evenness`, the same size.
fn drift(axis: &Axis, returns: &[Vec<f64>], evenness: f64) -> f64 {
    let last = returns.len() - 1;
    let at = |k: usize| axis.component(&returns[k]);
    let halves = [at(last / 2) - at(0), at(last) - at(last / 2)];
    let sum = halves[0] + halves[1];
    let is_steady = halves[0] * halves[1] > 0.0 && (halves[0] - halves[1]).abs() <= 0.5 * evenness * sum.abs();
    if is_steady { sum } else { 0.0 }
}

/// Returns the joint that is separated for the largest fraction of the samples, with this fraction.
fn most_open_joint(system: &System, samples: &[Sample]) -> (String, f64) {
    let open = |j: usize| {
        samples.iter().filter(|now| now.joints[j].contact == Contact::Open).count() as f64 / samples.len() as f64
    };
    let widest = (0..system.joints().len()).map(|j| (j, open(j))).fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    (system.joints().get(widest.0).map_or_else(String::new, |joint| joint.name().to_owned()), widest.1)
}

/// Describes a drift over some periods.
fn drifting(
    system: &System,
    omega: f64,
    (axis, place): (&Axis, &String),
    (drift, periods): (f64, usize),
    (joint, open_fraction): (String, f64),
) -> ObservedMotion {
    let squares: f64 = axis.rows().iter().map(|(_, weight)| weight * weight).sum();
    let mass = axis.rows().iter().map(|(row, weight)| weight * weight * system.structure().diagonal_mass(*row));
    let mass = mass.sum::<f64>() / (squares * squares);
    ObservedMotion::Drifts {
        place: place.as_str().into(),
        is_rotation: axis.is_rotation(),
        periods: periods as u32,
        load: axis.component(system.constant_forces().as_slice()) / squares,
        speed: drift * omega / (periods as f64 * TAU),
        spring: soft_spring(mass, omega),
        joint: joint.into(),
        open_fraction,
    }
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
        block_on_springs(load, 0.0)
    }

    fn block_on_springs(load: [f64; 2], stiffness: f64) -> System {
        let law = FrictionContact { tangential: 1e5, normal: 2e5, friction: 0.5, preload: 10.0, tangents: 1 };
        let names = vec!["x".into(), "z".into()];
        let one = DMatrix::identity(2, 2);
        let structure = Structure::new(names, one.clone(), &one * 60.0, one * stiffness).unwrap();
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
            assert!((spring / (0.1 * OMEGA * OMEGA) - 1.0).abs() < 1e-12, "{spring}");
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
        // a thousandth of the amplitude per period counts as settled; if it goes on, the block
        // creeps
        let creeping = returns(&|k| 1e-3 * k as f64);
        assert_eq!(classified(&system, OMEGA, (settings.periods, &creeping), &samples), ObservedMotion::Settles);
        let Some(ObservedMotion::Drifts { speed, .. }) = slow_drift(&system, OMEGA, &creeping, &samples) else {
            panic!("no drift")
        };
        assert!((speed / (1e-3 * OMEGA / TAU) - 1.0).abs() < 1e-9, "{speed}");
        assert_eq!(slow_drift(&block_on_springs([0.0, 10.0], 1e4), OMEGA, &creeping, &samples), None);
        let decaying = returns(&|k| 1e-3 * (-0.02 * k as f64).exp());
        assert_eq!(slow_drift(&system, OMEGA, &decaying, &samples), None);
        let none = classified(&system, OMEGA, (settings.periods, &returns(&|k| ((k * k) as f64).sin())), &samples);
        assert!(matches!(none, ObservedMotion::Irregular { periods, .. } if periods == settings.periods), "{none}");
    }
}
