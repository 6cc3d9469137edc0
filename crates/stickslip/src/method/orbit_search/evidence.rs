//! Evidence for an orbit from an independent time integration: its return defect and the
//! derivative of its return.
//!
//! A series that solves its own equations does not prove that the motion exists. This file
//! therefore integrates the motion from the orbit's state at t = 0 over one return. Exact laws
//! are integrated exactly, other laws implicitly. The return defect is the distance between the
//! start and the end. The derivative of the return gives the stability where no theorem
//! ([`System::is_incrementally_stable`]) proves it.
//!
//! A travelling wave on a ring returns, rotated by some sectors, after a fraction of the
//! period.

use super::return_map::{newton_step, norm};
use super::vibration_share;
use crate::method::IntegrationError;
use crate::method::flow::Flow;
use crate::method::flow::assembly::NEAR_REST;
use crate::method::flow::average_acceleration::equal_steps::AverageAccelerationFlow;
use crate::method::flow::integrator_choice::{self, IntegratorKind};
use crate::method::flow::step_record::extrapolate;
use crate::model::{CyclicSymmetry, System};
use crate::orbit::{Path, Symmetry};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip_numerics::eigen;

/// Settings of the check of an orbit by time integration.
#[derive(Debug, Clone, Copy)]
struct OrbitCheckSettings {
    /// Most degrees of freedom for which every orbit is checked. The return map is dense, and its
    /// cost grows with the cube of the size. In larger systems one period of integration takes ten
    /// times as long as the orbit by harmonic balance. [`crate::orbit::Orbit::return_defect`]
    /// integrates those on request.
    dofs: usize,
    /// Most joints for which the return is integrated although stability is proven.
    joints: usize,
    /// Factor on the limits of permanently stuck joints while the derivative of the return is
    /// computed. A power of two avoids rounding.
    limit_factor: f64,
    /// Distance of the largest multiplier from one, in return defects, below which its side of one
    /// is uncertain. With stops that open and close, multipliers err by two to three times the
    /// error of the motion.
    margin: f64,
    /// Newton steps from the given state to the orbit of the time integration; convergence is
    /// quadratic.
    newton_steps: usize,
    /// Largest ratio of the distances from the return after and before a Newton step.
    largest_ratio: f64,
    /// Relative error per step of the integration of smooth laws.
    tolerance: f64,
    /// Equal steps per return for laws with a step only. With the extrapolation from half as many
    /// steps they follow the motion to about 1e-6.
    steps: usize,
}

impl Default for OrbitCheckSettings {
    fn default() -> Self {
        OrbitCheckSettings {
            dofs: 24,
            joints: 12,
            limit_factor: 2.0,
            margin: 10.0,
            newton_steps: 3,
            largest_ratio: 0.5,
            tolerance: 1e-8,
            steps: 1024,
        }
    }
}

/// Integrates a system over one return and compares the end with the start.
pub(crate) struct OrbitCheck {
    /// `None` if the system is too large, or if no integration takes its laws.
    flow: Option<Box<dyn Flow>>,
    /// True if stability is proven: no two motions of the system separate.
    proven: bool,
}

/// Evidence from the time integration of an orbit.
#[derive(Debug, Clone, Default)]
pub(crate) struct ReturnEvidence {
    /// Derivative of the return by the state at t = 0. `None` if stability is proven, or if no
    /// integration follows the motion.
    pub derivative: Option<DMatrix<f64>>,
    /// Distance between the state and its return in the energy norm, relative to the vibration.
    pub defect: Option<f64>,
    /// One Newton step from the state to the orbit of the integration: displacements, velocities,
    /// states of the joints. `None` without a derivative.
    pub step: Option<DVector<f64>>,
}

impl OrbitCheck {
    pub fn new(system: &System) -> Self {
        let settings = OrbitCheckSettings::default();
        let proven = system.is_incrementally_stable();
        if system.dofs() > settings.dofs || (proven && system.joints().len() > settings.joints) {
            return OrbitCheck { flow: None, proven };
        }
        OrbitCheck { proven, ..OrbitCheck::of_any_size(system) }
    }

    /// Makes an [`OrbitCheck`] for any system, even where stability is proven or the integration
    /// is slow.
    pub fn of_any_size(system: &System) -> Self {
        let settings = OrbitCheckSettings::default();
        let name = "the judge of stability"; // this name appears in no message
        let flow: Option<Box<dyn Flow>> = match IntegratorKind::of(system, None) {
            _ if system.dofs() == 0 => None,
            IntegratorKind::Incremental => {
                AverageAccelerationFlow::new(system, None, name).ok().map(|mut flow| -> Box<dyn Flow> {
                    flow.count = settings.steps;
                    Box::new(flow)
                })
            }
            IntegratorKind::Exact | IntegratorKind::Smooth | IntegratorKind::Switched => {
                integrator_choice::integrator(system, None, settings.tolerance, name).ok()
            }
        };
        OrbitCheck { flow, proven: false }
    }

    /// Returns true if stability is proven.
    pub fn proves(&self) -> bool {
        self.proven
    }

    /// Integrates from `start` over this number of returns, then records one period. Returns
    /// `None` if no integration follows the system.
    pub fn settle_and_record(
        &mut self,
        system: &System,
        omega: f64,
        mut start: Vec<f64>,
        returns: usize,
    ) -> Option<Arc<dyn Path>> {
        let flow = self.flow.as_mut()?;
        let period = TAU / omega;
        flow.set_excitation(system, omega);
        flow.set_step_fraction(1.0);
        start.resize(flow.states(), 0.0);
        for _ in 0..returns {
            flow.run(&mut start, period, None).ok()?;
            if start.iter().any(|z| !z.is_finite()) {
                return None;
            }
        }
        flow.set_recording(true);
        let run = flow.run(&mut start, period, None);
        flow.set_recording(false);
        run.ok()?;
        Some(flow.path(&Arc::new(system.clone()), Symmetry::FullPeriod, period))
    }

    /// Checks the return of a path from its state at t = 0, which begins with `start`. The
    /// joints `stuck` are permanently stuck.
    pub fn check(
        &mut self,
        system: &System,
        omega: f64,
        (path, symmetry): (&dyn Path, Symmetry),
        start: &[f64],
        stuck: &[usize],
    ) -> ReturnEvidence {
        self.follow(system, omega, (path, symmetry), start, (!self.proven).then_some(stuck))
    }

    /// Returns the distance of `start` from its return, relative to the vibration, without the
    /// expensive derivative.
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
    ) -> ReturnEvidence {
        let settings = OrbitCheckSettings::default();
        let Some(flow) = &mut self.flow else { return ReturnEvidence::default() };
        let back = ReturnSymmetry::of(system, symmetry);
        flow.set_excitation(system, omega);
        let (weights, rest) = (flow.weights(), NEAR_REST * flow.energy_scale());
        let share = vibration_share::fraction(path, (symmetry, TAU / omega), start, (&weights, rest));
        flow.set_tolerance(share * settings.tolerance);
        let states = flow.states();
        let mut state = start.to_vec();
        state.resize(states, 0.0);
        let duration = back.part * TAU / omega;
        let one_return = OneReturn { duration, step_fraction: back.share };
        let mut derivative = sensitive.map(|_| DMatrix::identity(states, states));
        let stuck = sensitive.unwrap_or_default();
        let alone = derivative.as_mut().filter(|_| stuck.is_empty());
        if one_return.run(&mut **flow, &mut state, alone).is_err() {
            return ReturnEvidence::default();
        }
        // a joint may stick right up to its limit. The error of the orbit would make it slip
        // for an instant, and the derivative would be that of slip
        if !stuck.is_empty() {
            let mut again = start.to_vec();
            again.resize(states, 0.0);
            flow.scale_limits(stuck, settings.limit_factor);
            let run = flow.run(&mut again, duration, derivative.as_mut());
            flow.scale_limits(stuck, 1.0 / settings.limit_factor);
            derivative = derivative.filter(|_| run.is_ok());
        }
        // internal states that the method does not compute start wrong; their return does not
        // test the orbit
        let known = start.len() == states;
        let end = back.returned(&state, system.dofs());
        let mut gap = DVector::from_iterator(start.len(), start.iter().zip(&end).map(|(start, end)| start - end));
        // return points can describe the same history in several ways, as a loop may or may not
        // just close; only the effect on the motion counts
        if system.joints().iter().any(|joint| joint.law().masing().is_some()) {
            gap.iter_mut().skip(2 * system.dofs()).for_each(|gap| *gap = 0.0);
        }
        let size = share * norm(&weights, start).max(rest).max(f64::MIN_POSITIVE);
        let defect = known.then(|| norm(&weights, gap.as_slice()) / size);
        let mut of_return = derivative.map(|derivative| back.derivative(&derivative, system.dofs()));
        if let (Some(defect), Some(of_series), true) = (defect, &of_return, stuck.is_empty())
            && eigen::largest_modulus(of_series)
                .is_some_and(|modulus| (modulus.powi(back.times as i32) - 1.0).abs() <= settings.margin * defect)
        {
            let near = derivative_at_nearby_orbit(
                &mut **flow,
                (start, gap.clone(), of_series),
                (&back, system.dofs()),
                (one_return, &weights),
            );
            of_return = near.or(of_return);
        }
        let step = of_return.as_ref().filter(|_| known);
        let step = step.map(|derivative| newton_step(derivative, &gap, back.sign, &weights));
        ReturnEvidence {
            step,
            derivative: of_return.map(|derivative| back.over_full_cycle(&derivative, system.dofs())),
            defect,
        }
    }
}

/// The integration over one return.
#[derive(Clone, Copy)]
struct OneReturn {
    /// Duration of the return, s.
    duration: f64,
    /// Fraction of the steps of a full period.
    step_fraction: f64,
}

impl OneReturn {
    /// Integrates from `state` to its end, with the derivative if there is memory for it.
    ///
    /// The end of equal steps is extrapolated from half as many steps. The derivative is that of
    /// the steps, because an extrapolation would make undamped multipliers larger than one.
    fn run(
        self,
        flow: &mut dyn Flow,
        state: &mut [f64],
        derivative: Option<&mut DMatrix<f64>>,
    ) -> Result<(), IntegrationError> {
        let mut coarse = state.to_vec();
        if flow.has_equal_steps() {
            flow.set_step_fraction(0.5 * self.step_fraction);
            flow.run(&mut coarse, self.duration, None)?;
        }
        flow.set_step_fraction(self.step_fraction);
        flow.run(state, self.duration, derivative)?;
        if flow.has_equal_steps() {
            extrapolate(&mut coarse, state);
            state.copy_from_slice(&coarse);
        }
        Ok(())
    }
}

/// The fraction of a period after which a motion returns, and the transformation of the return:
/// a sign, or a rotation of a ring by some sectors.
struct ReturnSymmetry {
    /// Fraction of the period.
    part: f64,
    /// Fraction of the steps of a full period.
    share: f64,
    sign: f64,
    /// Number of sectors of a ring, or one; and the rotation of the return in sectors.
    sectors: usize,
    turned: usize,
    /// Number of returns after which the motion is back at its start up to a rotation.
    times: usize,
}

impl ReturnSymmetry {
    fn of(system: &System, symmetry: Symmetry) -> Self {
        let whole = ReturnSymmetry { part: 1.0, share: 1.0, sign: 1.0, sectors: 1, turned: 0, times: 1 };
        match (symmetry, system.cyclic()) {
            (Symmetry::HalfPeriod, _) => ReturnSymmetry { part: 0.5, sign: -1.0, ..whole },
            (Symmetry::FullPeriod, Some(CyclicSymmetry { sectors, order })) if order > 0 => {
                // each sector repeats the motion of the first, `order/sectors` of a period
                // earlier per sector
                let (mut a, mut b) = (sectors, order);
                while b > 0 {
                    (a, b) = (b, a % b);
                }
                let turned = (1..=sectors).find(|turned| order * turned % sectors == a % sectors).unwrap_or(0);
                let times = sectors / a;
                ReturnSymmetry {
                    part: 1.0 / times as f64,
                    share: 1.0 / times as f64,
                    sign: 1.0,
                    sectors,
                    turned,
                    times,
                }
            }
            (Symmetry::FullPeriod, _) => whole,
        }
    }

    /// Returns the index of a coordinate of a state after a rotation by this number of sectors.
    /// Displacements, velocities and joint states are stored sector by sector.
    fn place(&self, at: usize, dofs: usize, states: usize, turned: usize) -> usize {
        let (first, length) = match at / dofs.max(1) {
            0 => (0, dofs),
            1 => (dofs, dofs),
            _ => (2 * dofs, states - 2 * dofs),
        };
        first + (at - first + turned * (length / self.sectors)) % length
    }

    /// Transforms the end of a return so that it can be compared with the start.
    fn returned(&self, end: &[f64], dofs: usize) -> Vec<f64> {
        let mut out = vec![0.0; end.len()];
        end.iter().enumerate().for_each(|(i, z)| out[self.place(i, dofs, end.len(), self.turned)] = self.sign * z);
        out
    }

    /// Rotates the rows of the derivative of a return like the return, without its sign.
    fn derivative(&self, derivative: &DMatrix<f64>, dofs: usize) -> DMatrix<f64> {
        self.rows_turned(derivative, dofs, self.turned)
    }

    fn rows_turned(&self, matrix: &DMatrix<f64>, dofs: usize, turned: usize) -> DMatrix<f64> {
        let mut out = matrix.clone();
        let states = matrix.nrows();
        (0..states).for_each(|i| out.set_row(self.place(i, dofs, states, turned), &matrix.row(i)));
        out
    }

    /// Returns the derivative over all returns that bring the ring back to its start.
    fn over_full_cycle(&self, of_return: &DMatrix<f64>, dofs: usize) -> DMatrix<f64> {
        let power = (1..self.times).fold(of_return.clone(), |power, _| &power * of_return);
        let back = self.sectors - self.turned * self.times % self.sectors;
        self.rows_turned(&power, dofs, back % self.sectors)
    }
}

/// Returns the derivative of the return at the integration's orbit near `start`.
///
/// `gap` and `of_series` are the return defect and the derivative at `start`. Returns `None` if
/// Newton's method does not reduce the gap.
fn derivative_at_nearby_orbit(
    flow: &mut dyn Flow,
    (start, mut gap, of_series): (&[f64], DVector<f64>, &DMatrix<f64>),
    (back, dofs): (&ReturnSymmetry, usize),
    (one_return, weights): (OneReturn, &[f64]),
) -> Option<DMatrix<f64>> {
    let settings = OrbitCheckSettings::default();
    let (mut state, mut nearer) = (start.to_vec(), None);
    for _ in 0..settings.newton_steps {
        let step = newton_step(nearer.as_ref().unwrap_or(of_series), &gap, back.sign, weights);
        let from: Vec<f64> = state.iter().zip(step.iter()).map(|(z, d)| z + d).collect();
        let (mut end, mut derivative) = (from.clone(), DMatrix::identity(from.len(), from.len()));
        one_return.run(flow, &mut end, Some(&mut derivative)).ok()?;
        let end = back.returned(&end, dofs);
        let left = DVector::from_iterator(from.len(), from.iter().zip(&end).map(|(z, end)| z - end));
        let share = norm(weights, left.as_slice()) / norm(weights, gap.as_slice());
        if share.is_nan() || share > settings.largest_ratio {
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

    /// The return defect shows the truncation of a series, for exact and smooth laws, with and
    /// without internal states. More harmonics reduce it. A sharper law makes the truncation of
    /// a short series larger.
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
                let orbit = method.solver(&system).unwrap().orbit(omega).unwrap();
                orbit.evidence.return_defect.unwrap()
            };
            let (few, many) = (defect(1), defect(31));
            assert!(few < 0.1 && many < 0.3 * few, "{few} {many}");
        }
    }

    /// A long chain of bodies is not integrated at every point of a curve, only on request. The
    /// return defect shows the truncation of a series there too, and an event-driven orbit
    /// returns to itself.
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
            let orbit = method.solver(&system).unwrap().orbit(omega).unwrap();
            assert_eq!(orbit.evidence.return_defect, None);
            orbit.return_defect().unwrap()
        };
        let (few, many) = (defect(1), defect(15));
        assert!(few < 0.1 && many < 0.3 * few, "{few} {many}");
        let orbit = crate::method::event_driven::EventDriven.solver(&system).unwrap().orbit(omega).unwrap();
        assert_eq!(orbit.return_defect(), Some(orbit.evidence.residual));
    }

    /// A ring of six nodes in a plane has contacts between them and a wave of order two. As a
    /// travelling wave it is integrated over a third of the period. The results agree with
    /// those of the full period.
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
        let wave = whole.clone().with_cyclic_symmetry(CyclicSymmetry { sectors: nodes, order: waves }).unwrap();
        let omega = TAU * 55.0;
        let method = HarmonicBalance { harmonics: Some(15), samples: Some(1024), tolerance: Some(0.9) };
        let orbit = method.solver(&wave).unwrap().orbit(omega).unwrap();
        let judged = |system: &System| {
            let path = (orbit.path.as_ref(), Symmetry::FullPeriod);
            OrbitCheck::new(system).check(system, omega, path, &orbit.initial_state, &[])
        };
        let (part, all) = (judged(&wave), judged(&whole));
        let largest = |judged: &ReturnEvidence| eigen::largest_modulus(judged.derivative.as_ref().unwrap()).unwrap();
        let (of_part, of_all) = (largest(&part), largest(&all));
        // the integrated motion differs from the orbit by the defect, and the parts of the
        // period differ by that
        let defect = all.defect.unwrap();
        assert!(defect > 1e-9 && defect < 1e-2, "{defect}");
        assert!((of_part - of_all).abs() < 10.0 * defect * of_all, "{of_part} {of_all} {defect}");
        let apart = (part.derivative.unwrap() - all.derivative.as_ref().unwrap()).amax();
        // the steps of a part of the period are not those of the whole period
        assert!(apart < 5e-5 * all.derivative.unwrap().amax(), "{apart}");
        // three parts of the period may have three times the defect of one part, or a third of
        // it
        let left = part.defect.unwrap();
        assert!(left < 3.0 * defect && 3.0 * left > defect, "{left} {defect}");
    }

    /// A state that belongs to no orbit has a return defect of the size of its error. An
    /// incomplete state gives no defect.
    #[test]
    fn a_wrong_orbit_is_caught() {
        let system = couple(Arc::new(Jenkins { stiffness: 2e4, limit: 4.0 }));
        let omega = TAU * 120.75;
        let orbit = crate::method::event_driven::EventDriven.solver(&system).unwrap().orbit(omega).unwrap();
        let mut orbit_check = OrbitCheck::new(&system);
        assert!(orbit_check.proves());
        let mut defect =
            |start: &[f64]| orbit_check.check(&system, omega, (orbit.path.as_ref(), orbit.symmetry), start, &[]).defect;
        assert!(defect(&orbit.initial_state).unwrap() < 1e-11);
        let wrong: Vec<f64> = orbit.initial_state.iter().map(|z| 1.5 * z).collect();
        // a transient decays by 1 % per return at a Q of some hundreds; friction adds to that
        assert!(defect(&wrong).unwrap() > 1e-3, "{:?}", defect(&wrong));
        assert_eq!(defect(&orbit.initial_state[..4]), None);
    }
}
