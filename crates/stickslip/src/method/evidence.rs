//! What an independent flow says of an orbit: whether its state at t = 0 returns, and what becomes of small disturbances.
//!
//! A series that solves its own equations proves nothing by that. The motion that starts at the orbit's state is therefore followed over one
//! return, exactly for laws that are exact and by implicit integration for others. How far it comes back from the start is the return
//! defect; its derivative is the return map that stability asks for, where no theorem answers it ([`System::contracts`]).

use super::assembly::NEAR_REST;
use super::flow::Flow;
use super::followed::{self, Kind};
use super::incremental::flow::IncrementalFlow;
use super::periodic::{newton_step, norm};
use super::vibration;
use crate::model::System;
use crate::orbit::{Path, Symmetry};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip_numerics::eigen;

/// Degrees of freedom up to which orbits are judged without being asked: the return map is dense, and its cost grows with the cube. Beyond, one period
/// of motion takes ten times as long as its orbit by harmonic balance, and [`crate::orbit::Orbit::return_defect`] follows it when it is asked.
const LARGEST: usize = 24;
/// Joints up to which the return of a motion whose stability is proven is followed all the same.
const JOINTS: usize = 12;
/// What the limits of joints that never slip are multiplied by where the derivative of the return is sought: a power of two, which leaves no rounding.
const HELD: f64 = 2.0;
/// Distance of the largest multiplier from one, in return defects, within which it may be on the other side: multipliers where stops open and close err by two to
/// three times the error of the motion.
const MARGIN: f64 = 10.0;
/// Newton steps from there to the orbit of the flow: each leaves the square of what was missing.
const STEPS_NEARER: usize = 3;
/// Share of the distance from its return that such a step leaves at most.
const LEFT: f64 = 0.5;
/// Relative error per step of the integration of smooth laws.
const TOLERANCE: f64 = 1e-8;
/// Equal steps per return for laws that know only steps: they follow the motion to about 1e-6.
const STEPS: usize = 4096;

/// Equal steps in which the return of each orbit by harmonic balance is followed, which takes longer than the orbit itself, and whether with their
/// derivatives; none where it is not followed, or by longer steps.
///
/// # Example
/// ```
/// use stickslip::method::evidence_steps;
/// let couple = stickslip::model::example::blade_couple().assemble().unwrap();
/// assert_eq!(evidence_steps(&couple), None); // from event to event
/// ```
pub fn evidence_steps(system: &System) -> Option<(usize, bool)> {
    if system.dofs() > LARGEST || Kind::of(system, None) != Kind::Incremental {
        return None;
    }
    let judge = Judge::new(system);
    judge.flow.as_ref().map(|_| (STEPS, !judge.proven))
}

/// The flow of a system between two returns.
pub(crate) struct Judge {
    /// `None` if the system is too large, or if no flow takes its laws.
    flow: Option<Box<dyn Flow>>,
    /// No two motions separate.
    proven: bool,
}

/// What a flow says of an orbit.
#[derive(Debug, Clone, Default)]
pub(crate) struct Judged {
    /// Derivative of the return with respect to the state at t = 0; `None` where stability is proven, or where no flow follows the motion.
    pub derivative: Option<DMatrix<f64>>,
    /// Distance between the state and its return, relative to the vibration, in the energy norm.
    pub defect: Option<f64>,
}

impl Judge {
    pub fn new(system: &System) -> Self {
        let proven = system.contracts();
        if system.dofs() > LARGEST || (proven && system.joints().len() > JOINTS) {
            return Judge { flow: None, proven };
        }
        Judge { proven, ..Judge::of_any_size(system) }
    }

    /// A flow, also where it is not needed or long.
    pub fn of_any_size(system: &System) -> Self {
        let name = "the judge of stability"; // no error of it is ever shown
        let flow: Option<Box<dyn Flow>> = match Kind::of(system, None) {
            _ if system.dofs() == 0 => None,
            Kind::Incremental => IncrementalFlow::new(system, None, name).ok().map(|mut flow| -> Box<dyn Flow> {
                flow.count = STEPS;
                Box::new(flow)
            }),
            Kind::Exact | Kind::Smooth => followed::of(system, None, TOLERANCE, name).ok(),
        };
        Judge { flow, proven: false }
    }

    /// Whether stability is proven.
    pub fn proves(&self) -> bool {
        self.proven
    }

    /// The motion to which one from `start` comes after so many returns, over one period; `None` where no flow follows the system.
    pub fn approach(
        &mut self,
        system: &System,
        omega: f64,
        mut start: Vec<f64>,
        returns: usize,
    ) -> Option<Arc<dyn Path>> {
        let flow = self.flow.as_mut()?;
        let period = TAU / omega;
        flow.set_drive(system, omega);
        start.resize(flow.states(), 0.0);
        for _ in 0..returns {
            flow.run(&mut start, period, None).ok()?;
            if start.iter().any(|z| !z.is_finite()) {
                return None;
            }
        }
        flow.keep(true);
        let run = flow.run(&mut start, period, None);
        flow.keep(false);
        run.ok()?;
        Some(flow.path(&Arc::new(system.clone()), Symmetry::FullPeriod, period))
    }

    /// Follows the return of a path, in which the joints `stuck` never slip, from its state at t = 0, which begins with `start`.
    pub fn judge(
        &mut self,
        system: &System,
        omega: f64,
        (path, symmetry): (&dyn Path, Symmetry),
        start: &[f64],
        stuck: &[usize],
    ) -> Judged {
        self.follow(system, omega, (path, symmetry), start, (!self.proven).then_some(stuck))
    }

    /// How far the motion from `start` is from it after a return, relative to its vibration, without the derivative that costs most.
    pub fn defect(
        &mut self,
        system: &System,
        omega: f64,
        (path, symmetry): (&dyn Path, Symmetry),
        start: &[f64],
    ) -> Option<f64> {
        self.follow(system, omega, (path, symmetry), start, None).defect
    }

    fn follow(
        &mut self,
        system: &System,
        omega: f64,
        (path, symmetry): (&dyn Path, Symmetry),
        start: &[f64],
        sensitive: Option<&[usize]>,
    ) -> Judged {
        let Some(flow) = &mut self.flow else { return Judged::default() };
        let (part, sign) = if symmetry == Symmetry::HalfPeriod { (0.5, -1.0) } else { (1.0, 1.0) };
        flow.set_drive(system, omega);
        let (weights, rest) = (flow.weights(), NEAR_REST * flow.energy_scale());
        let share = vibration::share(path, (symmetry, TAU / omega), start, (&weights, rest));
        flow.set_tolerance(share * TOLERANCE);
        let states = flow.states();
        let mut state = start.to_vec();
        state.resize(states, 0.0);
        let duration = part * TAU / omega;
        let mut derivative = sensitive.map(|_| DMatrix::identity(states, states));
        let stuck = sensitive.unwrap_or_default();
        let alone = derivative.as_mut().filter(|_| stuck.is_empty());
        if flow.run(&mut state, duration, alone).is_err() {
            return Judged::default();
        }
        // what sticks up to its very limit slips for an instant by the error of the orbit, and the derivative would be that of slip
        if !stuck.is_empty() {
            let mut again = start.to_vec();
            again.resize(states, 0.0);
            flow.strengthen(stuck, HELD);
            let run = flow.run(&mut again, duration, derivative.as_mut());
            flow.strengthen(stuck, 1.0 / HELD);
            derivative = derivative.filter(|_| run.is_ok());
        }
        // states that the method does not know begin wrong, and their return says nothing of the orbit
        let known = start.len() == states;
        let gap = DVector::from_iterator(start.len(), start.iter().zip(&state).map(|(start, end)| start - sign * end));
        let size = share * norm(&weights, start).max(rest).max(f64::MIN_POSITIVE);
        let defect = known.then(|| norm(&weights, gap.as_slice()) / size);
        if let (Some(defect), Some(of_series), true) = (defect, &derivative, stuck.is_empty())
            && eigen::largest_modulus(of_series).is_some_and(|modulus| (modulus - 1.0).abs() <= MARGIN * defect)
        {
            let near = of_the_orbit_beside(&mut **flow, (start, gap, of_series), (sign, duration, &weights));
            derivative = near.or(derivative);
        }
        Judged { derivative, defect }
    }
}

/// The derivative of the return at the orbit of the flow beside `start`, whose `gap` from its return and derivative are given; `None` where Newton's method does
/// not come nearer to one.
fn of_the_orbit_beside(
    flow: &mut dyn Flow,
    (start, mut gap, of_series): (&[f64], DVector<f64>, &DMatrix<f64>),
    (sign, duration, weights): (f64, f64, &[f64]),
) -> Option<DMatrix<f64>> {
    let (mut state, mut nearer) = (start.to_vec(), None);
    for _ in 0..STEPS_NEARER {
        let step = newton_step(nearer.as_ref().unwrap_or(of_series), &gap, sign, weights);
        let from: Vec<f64> = state.iter().zip(step.iter()).map(|(z, d)| z + d).collect();
        let (mut end, mut derivative) = (from.clone(), DMatrix::identity(from.len(), from.len()));
        flow.run(&mut end, duration, Some(&mut derivative)).ok()?;
        let left = DVector::from_iterator(from.len(), from.iter().zip(&end).map(|(z, end)| z - sign * end));
        let share = norm(weights, left.as_slice()) / norm(weights, gap.as_slice());
        if share.is_nan() || share > LEFT {
            break;
        }
        (state, gap, nearer) = (from, left, Some(derivative));
    }
    nearer
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, Jenkins, SharedLaw};
    use crate::method::Method;
    use crate::method::harmonic_balance::HarmonicBalance;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, example};
    use std::sync::Arc;

    fn couple(law: SharedLaw) -> System {
        let mut model = example::blade_couple();
        model.joints[0].law = law;
        model.assemble().unwrap()
    }

    /// What a series lacks is seen by its return, for exact and for smooth laws, with states and without; more harmonics leave less. The sharper
    /// the law, the more a short series lacks.
    #[test]
    fn a_short_series_does_not_return() {
        let omega = TAU * 120.75;
        let laws: [SharedLaw; 3] = [
            Arc::new(Jenkins { stiffness: 2e4, limit: 4.0 }),
            Arc::new(Coulomb { limit: 4.0 }),
            Arc::new(CoulombArctan { limit: 4.0, alpha: 100.0 }),
        ];
        for law in laws {
            let system = couple(law);
            let defect = |harmonics: usize| {
                let method = HarmonicBalance { harmonics: Some(harmonics), ..HarmonicBalance::default() };
                let orbit = method.solver(&system).unwrap().orbit(omega, None).unwrap();
                orbit.evidence.return_defect.unwrap()
            };
            let (few, many) = (defect(1), defect(31));
            assert!(few < 0.1 && many < 0.3 * few, "{few} {many}");
        }
    }

    /// Many bodies on springs and joints in a row are not followed at every point of a curve, and are where an orbit is asked for its return: what a
    /// series lacks is seen there too, and a motion from event to event returns to itself.
    #[test]
    fn an_orbit_of_many_bodies_is_followed_when_it_is_asked() {
        let name = |i: usize| format!("b{i}");
        let law: SharedLaw = Arc::new(Jenkins { stiffness: 2e4, limit: 0.3 });
        let held = |i: usize| Spring { between: [name(i), GROUND.into()], stiffness: 105_103.0, damping: 20.0 };
        let tied = |i: usize| Joint { name: format!("j{i}"), between: [name(i - 1), name(i)], law: law.clone() };
        let force = Force { on: name(0), amplitude: 10.0, phase: 0.0, harmonic: 1 };
        let model = Model {
            masses: (0..30).map(|i| Mass::new(name(i), 0.182)).collect(),
            springs: (0..30).map(held).collect(),
            joints: (1..30).map(tied).collect(),
            forces: vec![force],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let omega = TAU * 121.0;
        let defect = |harmonics: usize| {
            let method =
                HarmonicBalance { harmonics: Some(harmonics), tolerance: Some(0.9), ..HarmonicBalance::default() };
            let orbit = method.solver(&system).unwrap().orbit(omega, None).unwrap();
            assert_eq!(orbit.evidence.return_defect, None);
            orbit.return_defect().unwrap()
        };
        let (few, many) = (defect(1), defect(15));
        assert!(few < 0.1 && many < 0.3 * few, "{few} {many}");
        let orbit = crate::method::event_driven::EventDriven.solver(&system).unwrap().orbit(omega, None).unwrap();
        assert_eq!(orbit.return_defect(), Some(orbit.evidence.residual));
    }

    /// A state that is none of an orbit does not return, by as much as it is off; one that has not all states says nothing.
    #[test]
    fn a_wrong_orbit_is_caught() {
        let system = couple(Arc::new(Jenkins { stiffness: 2e4, limit: 4.0 }));
        let omega = TAU * 120.75;
        let orbit = crate::method::event_driven::EventDriven.solver(&system).unwrap().orbit(omega, None).unwrap();
        let mut judge = Judge::new(&system);
        assert!(judge.proves());
        let mut defect =
            |start: &[f64]| judge.judge(&system, omega, (orbit.path.as_ref(), orbit.symmetry), start, &[]).defect;
        assert!(defect(&orbit.start).unwrap() < 1e-11);
        let wrong: Vec<f64> = orbit.start.iter().map(|z| 1.5 * z).collect();
        // the transient of a structure with Q of some hundreds dies by a hundredth per return, friction takes more
        assert!(defect(&wrong).unwrap() > 1e-3, "{:?}", defect(&wrong));
        assert_eq!(defect(&orbit.start[..4]), None);
    }
}
