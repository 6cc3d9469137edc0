//! What an independent flow says of an orbit: whether its state at t = 0 returns, and what becomes of small disturbances.
//!
//! A series that solves its own equations proves nothing by that. The motion that starts at the orbit's state is therefore followed over one
//! return, exactly for laws that are exact and by implicit integration for others. How far it comes back from the start is the return
//! defect; its derivative is the return map that stability asks for, where no theorem answers it ([`System::contracts`]).
//!
//! A ring in a travelling wave returns to itself, turned by some sectors, after a fraction of the
//! period already.

use super::assembly::NEAR_REST;
use super::flow::Flow;
use super::followed::{self, Kind};
use super::incremental::flow::IncrementalFlow;
use super::periodic::{newton_step, norm};
use super::vibration;
use crate::model::{Cyclic, System};
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
            Kind::Exact | Kind::Smooth | Kind::Switched => followed::of(system, None, TOLERANCE, name).ok(),
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
        flow.set_share(1.0);
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
        let back = Return::of(system, symmetry);
        flow.set_drive(system, omega);
        let (weights, rest) = (flow.weights(), NEAR_REST * flow.energy_scale());
        let share = vibration::share(path, (symmetry, TAU / omega), start, (&weights, rest));
        flow.set_tolerance(share * TOLERANCE);
        let states = flow.states();
        let mut state = start.to_vec();
        state.resize(states, 0.0);
        let duration = back.part * TAU / omega;
        flow.set_share(back.share);
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
        let end = back.returned(&state, system.dofs());
        let mut gap = DVector::from_iterator(start.len(), start.iter().zip(&end).map(|(start, end)| start - end));
        // a history told by return points has many faces: a loop that just closes, or just does not. What it does to the motion counts
        if system.joints().iter().any(|joint| joint.law().masing().is_some()) {
            gap.iter_mut().skip(2 * system.dofs()).for_each(|gap| *gap = 0.0);
        }
        let size = share * norm(&weights, start).max(rest).max(f64::MIN_POSITIVE);
        let defect = known.then(|| norm(&weights, gap.as_slice()) / size);
        let mut of_return = derivative.map(|derivative| back.derivative(&derivative, system.dofs()));
        if let (Some(defect), Some(of_series), true) = (defect, &of_return, stuck.is_empty())
            && eigen::largest_modulus(of_series)
                .is_some_and(|modulus| (modulus.powi(back.times as i32) - 1.0).abs() <= MARGIN * defect)
        {
            let near =
                of_the_orbit_beside(&mut **flow, (start, gap, of_series), (&back, system.dofs()), (duration, &weights));
            of_return = near.or(of_return);
        }
        Judged { derivative: of_return.map(|derivative| back.whole(&derivative, system.dofs())), defect }
    }
}

/// After which share of the period a motion comes back to its start, and as what: its opposite, or
/// a ring turned by some sectors.
struct Return {
    /// Share of the period.
    part: f64,
    /// Share of the steps of a period that it is followed in.
    share: f64,
    sign: f64,
    /// Sectors of a ring, or one, and by how many of them what comes back is turned.
    sectors: usize,
    turned: usize,
    /// Returns after which everything is where it was, up to a turn.
    times: usize,
}

impl Return {
    fn of(system: &System, symmetry: Symmetry) -> Self {
        let whole = Return { part: 1.0, share: 1.0, sign: 1.0, sectors: 1, turned: 0, times: 1 };
        match (symmetry, system.cyclic()) {
            (Symmetry::HalfPeriod, _) => Return { part: 0.5, sign: -1.0, ..whole },
            (Symmetry::FullPeriod, Some(Cyclic { sectors, order })) if order > 0 => {
                // a sector does what the first one does, earlier by `order/sectors` of a period
                // for every sector between them
                let (mut a, mut b) = (sectors, order);
                while b > 0 {
                    (a, b) = (b, a % b);
                }
                let turned = (1..=sectors).find(|turned| order * turned % sectors == a % sectors).unwrap_or(0);
                let times = sectors / a;
                Return { part: 1.0 / times as f64, share: 1.0 / times as f64, sign: 1.0, sectors, turned, times }
            }
            (Symmetry::FullPeriod, _) => whole,
        }
    }

    /// Where a coordinate of a state stands after a turn by so many sectors: displacements,
    /// velocities and states of joints stand sector by sector.
    fn place(&self, at: usize, (dofs, states): (usize, usize), turned: usize) -> usize {
        let (first, length) = match at / dofs.max(1) {
            0 => (0, dofs),
            1 => (dofs, dofs),
            _ => (2 * dofs, states - 2 * dofs),
        };
        first + (at - first + turned * (length / self.sectors)) % length
    }

    /// What the end of a return is compared with the start as.
    fn returned(&self, end: &[f64], dofs: usize) -> Vec<f64> {
        let mut out = vec![0.0; end.len()];
        end.iter().enumerate().for_each(|(i, z)| out[self.place(i, (dofs, end.len()), self.turned)] = self.sign * z);
        out
    }

    /// The derivative of a return that is turned like this, without its sign.
    fn derivative(&self, derivative: &DMatrix<f64>, dofs: usize) -> DMatrix<f64> {
        self.rows_turned(derivative, dofs, self.turned)
    }

    fn rows_turned(&self, matrix: &DMatrix<f64>, dofs: usize, turned: usize) -> DMatrix<f64> {
        let mut out = matrix.clone();
        let states = matrix.nrows();
        (0..states).for_each(|i| out.set_row(self.place(i, (dofs, states), turned), &matrix.row(i)));
        out
    }

    /// The derivative over as many returns as bring everything back to where it was.
    fn whole(&self, of_return: &DMatrix<f64>, dofs: usize) -> DMatrix<f64> {
        let power = (1..self.times).fold(of_return.clone(), |power, _| &power * of_return);
        let back = self.sectors - self.turned * self.times % self.sectors;
        self.rows_turned(&power, dofs, back % self.sectors)
    }
}

/// The derivative of the return at the orbit of the flow beside `start`, whose `gap` from its return and derivative are given; `None` where Newton's method does
/// not come nearer to one.
fn of_the_orbit_beside(
    flow: &mut dyn Flow,
    (start, mut gap, of_series): (&[f64], DVector<f64>, &DMatrix<f64>),
    (back, dofs): (&Return, usize),
    (duration, weights): (f64, &[f64]),
) -> Option<DMatrix<f64>> {
    let (mut state, mut nearer) = (start.to_vec(), None);
    for _ in 0..STEPS_NEARER {
        let step = newton_step(nearer.as_ref().unwrap_or(of_series), &gap, back.sign, weights);
        let from: Vec<f64> = state.iter().zip(step.iter()).map(|(z, d)| z + d).collect();
        let (mut end, mut derivative) = (from.clone(), DMatrix::identity(from.len(), from.len()));
        flow.run(&mut end, duration, Some(&mut derivative)).ok()?;
        let end = back.returned(&end, dofs);
        let left = DVector::from_iterator(from.len(), from.iter().zip(&end).map(|(z, end)| z - end));
        let share = norm(weights, left.as_slice()) / norm(weights, gap.as_slice());
        if share.is_nan() || share > LEFT {
            break;
        }
        (state, gap, nearer) = (from, left, Some(back.derivative(&derivative, dofs)));
    }
    nearer
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, FrictionContact, Jenkins, SharedLaw};
    use crate::method::Method;
    use crate::method::harmonic_balance::HarmonicBalance;
    use crate::model::{Axis, Force, GROUND, Joint, Mass, Model, Spring, example};
    use crate::structure::Structure;
    use num_complex::Complex64;
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

    /// A ring of six nodes in a plane with contacts between them, whose wave goes round twice:
    /// known to be one, it is followed for a third of the period, and is
    /// told the same as for the whole of it.
    #[test]
    fn a_travelling_wave_returns_after_a_part_of_the_period() {
        let (nodes, waves) = (6, 2);
        let at = |node: usize, direction: usize| (node % nodes) * 2 + direction;
        let n = 2 * nodes;
        let each = |value: f64| DMatrix::identity(n, n) * value;
        let places = (0..n).map(|i| format!("x{i}")).collect();
        let stiffness = DMatrix::from_fn(n, n, |i, k| if i == k { 1e5 * (1.0 + (i % 2) as f64) } else { 0.0 });
        let law: SharedLaw =
            Arc::new(FrictionContact { tangential: 2e4, normal: 3e4, friction: 0.3, preload: 5.0, tangents: 1 });
        let mut builder = System::builder(Structure::new(places, each(1.0), each(5.0), stiffness).unwrap());
        for node in 0..nodes {
            let axes = (0..2).map(|d| Axis::new(vec![(at(node, d), 1.0), (at(node + 1, d), -1.0)]));
            builder = builder.joint(format!("j{node}"), law.clone(), axes.collect());
            let phase = TAU * (waves * node) as f64 / nodes as f64;
            builder = builder.force(at(node, 0), 1, Complex64::from_polar(20.0, phase));
        }
        let whole = builder.build().unwrap();
        let wave = whole.clone().travelling(Cyclic { sectors: nodes, order: waves }).unwrap();
        let omega = TAU * 55.0;
        let method = HarmonicBalance { harmonics: Some(15), samples: Some(1024), tolerance: Some(0.9) };
        let orbit = method.solver(&wave).unwrap().orbit(omega, None).unwrap();
        let judged = |system: &System| {
            let path = (orbit.path.as_ref(), Symmetry::FullPeriod);
            Judge::new(system).judge(system, omega, path, &orbit.start, &[])
        };
        let (part, all) = (judged(&wave), judged(&whole));
        let largest = |judged: &Judged| eigen::largest_modulus(judged.derivative.as_ref().unwrap()).unwrap();
        let (of_part, of_all) = (largest(&part), largest(&all));
        // the motion that is followed is beside the orbit by the defect, in which the parts of the
        // period differ
        let defect = all.defect.unwrap();
        assert!(defect > 1e-9 && defect < 1e-2, "{defect}");
        assert!((of_part - of_all).abs() < 10.0 * defect * of_all, "{of_part} {of_all} {defect}");
        let apart = (part.derivative.unwrap() - all.derivative.unwrap()).amax();
        assert!(apart < 0.05, "{apart}");
        // three parts of the period may leave three times as much as one, or a third
        let left = part.defect.unwrap();
        assert!(left < 3.0 * defect && 3.0 * left > defect, "{left} {defect}");
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
