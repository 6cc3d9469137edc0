//! Interior point method for rigid friction: all slip limits at once.
//!
//! Newton's method with a line search takes one step length for all joints. Hundreds of samples
//! of many joints may change between stick and slip, and some sample always asks for a short
//! step. The number of steps then grows with the number of joints. The equations are a
//! variational inequality: in a dissipative structure the forces are monotone in the motions.
//!
//! The interior point method follows a central path, on which the complementarity products of
//! all samples equal μ > 0, see [`InteriorPort`]. A product is the distance of a force from its
//! limit times the multiplier of that limit. Each step first predicts the decrease of the
//! products with μ = 0, chooses μ from it, and then corrects. The number of steps hardly depends
//! on the number of joints. Newton's method takes a few steps from the end of the path to the
//! solution.
//!
//! Sources: Mehrotra (1992), "On the implementation of a primal-dual interior point method";
//! Wright, "Primal-Dual Interior-Point Methods" (1997).

use super::SearchSettings;
use crate::method::harmonic_balance::aft::{FrequencyTime, InteriorPort, Port, Ports, tangent_range};
use crate::method::harmonic_balance::equations::homotopy::{GIVEN_EQUATIONS, SearchContext};
use crate::method::harmonic_balance::equations::{
    CLOSED_CONTACT_SIGN, DerivativeScope, Discretization, HarmonicSolution,
};
use crate::method::harmonic_balance::linear_solve::newton_krylov::StepStart;
use crate::method::harmonic_balance::newton::SolveError;
use crate::method::harmonic_balance::settings::InteriorPointSettings;
use num_complex::Complex64;
use stickslip_numerics::interrupt;

/// Point on the path.
struct CentralPath {
    /// Barriers of the ports with rigid friction along one axis.
    barriers: Vec<Option<InteriorPort>>,
    aft: FrequencyTime,
    /// Harmonics of the argument `λ + ε u'` of one barrier.
    argument: Vec<Complex64>,
}

impl CentralPath {
    /// Returns the barriers that exist.
    fn each(&self) -> impl Iterator<Item = &InteriorPort> {
        self.barriers.iter().flatten()
    }

    /// Returns the mean complementarity product after a fraction of the step.
    fn gap(&self, share: f64) -> f64 {
        self.each().map(|barrier| barrier.gap(share)).sum::<f64>() / self.each().count() as f64
    }
}

impl Discretization {
    /// Solves by the interior point method from `motion`. Its rigid friction forces are
    /// ignored.
    pub(crate) fn interior_point_method(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
    ) -> Result<(), SolveError> {
        self.begin_search(ports);
        if !self.follow_central_path(ports, omega, motion) {
            return Err(SolveError::not_converged(motion.iterations, f64::INFINITY));
        }
        self.newton(
            SearchContext::given(ports, omega),
            motion,
            SearchSettings { iterations: InteriorPointSettings::default().iterations, ..SearchSettings::default() },
        )
    }

    /// Follows the path. Returns true if its end was reached.
    fn follow_central_path(&mut self, ports: &Ports, omega: f64, motion: &mut HarmonicSolution) -> bool {
        let Some(mut along) = self.start_central_path(ports, omega, motion) else { return false };
        let settings = InteriorPointSettings::default();
        let (mut mark, mut waited) = (f64::INFINITY, 0);
        for _ in 0..settings.steps {
            interrupt::check();
            let left = along.each().map(InteriorPort::remaining_gap).fold(0.0, f64::max);
            if left <= settings.end_of_path {
                return true;
            }
            (mark, waited) = if left < 0.5 * mark { (left, 0) } else { (mark, waited + 1) };
            if !left.is_finite() || waited > settings.stagnation_steps || self.is_budget_used(ports) {
                return false;
            }
            self.work.evaluations += 1;
            self.motion_port_forces(SearchContext::given(ports, omega), motion, DerivativeScope::All);
            self.structure_motion(motion, GIVEN_EQUATIONS);
            let length = self.motion_scale(motion);
            self.set_residual_units(ports, motion, length);
            for (p, port) in ports.iter().enumerate().filter(|(_, port)| port.is_force()) {
                let tangent = tangent_range(&self.blocks, p, port, self.harmonics().len());
                argument((self, p, port), omega, motion, &mut along.argument);
                match &mut along.barriers[p] {
                    Some(barrier) => {
                        barrier.linearize(&mut along.aft, &along.argument, &mut self.workspace.tangents[tangent]);
                    }
                    None => {
                        self.force_port_residual(SearchContext::given(ports, omega), p, motion, DerivativeScope::All)
                    }
                }
            }
            self.workspace.previous.copy_from(motion);
            let near = StepStart { length, residual: 1.0, coarse: false, same_derivatives: false };
            let Some(ahead) = self.interior_step(ports, omega, motion, &mut along, (0.0, near)) else { return false };
            let gap = along.gap(0.0) * (along.gap(ahead) / along.gap(0.0)).powi(3);
            motion.copy_from(&self.workspace.previous);
            self.structure_motion(motion, GIVEN_EQUATIONS);
            let Some(share) = self.interior_step(ports, omega, motion, &mut along, (gap, near)) else { return false };
            motion.iterations += 1;
            self.apply_step(ports, motion, share, length);
            along.barriers.iter_mut().flatten().for_each(|barrier| barrier.advance(share));
        }
        false
    }

    /// Returns the first point of the path, without rigid friction. Returns `None` if no port
    /// has it.
    fn start_central_path(&mut self, ports: &Ports, omega: f64, motion: &mut HarmonicSolution) -> Option<CentralPath> {
        let nh = self.harmonics().len();
        let top = self.harmonics().last().copied().unwrap_or(0);
        let samples = (InteriorPointSettings::default().samples_per_wave * (top + 1)).next_power_of_two();
        let mut along = CentralPath {
            barriers: Vec::with_capacity(ports.len()),
            aft: FrequencyTime::new(self.harmonics().to_vec(), samples),
            argument: vec![Complex64::default(); nh],
        };
        let limits: Vec<Option<f64>> =
            ports.iter().zip(&self.linear.contacts).map(|(port, e)| port.limit().filter(|_| !e.is_imposed())).collect();
        if limits.iter().all(Option::is_none) {
            return None;
        }
        for (port, _) in ports.iter().zip(&limits).filter(|(_, limit)| limit.is_some()) {
            motion.force[port.first_axis * nh..][..nh].fill(Complex64::default());
        }
        self.motion_port_forces(SearchContext::given(ports, omega), motion, DerivativeScope::None);
        self.structure_motion(motion, GIVEN_EQUATIONS);
        for (p, (port, limit)) in ports.iter().zip(limits).enumerate() {
            argument((self, p, port), omega, motion, &mut along.argument);
            along.barriers.push(limit.map(|limit| InteriorPort::new(limit, &mut along.aft, &along.argument)));
        }
        Some(along)
    }

    /// Solves for the step to complementarity products of `gap`, and moves `motion` by the full
    /// step.
    ///
    /// With `gap` above zero the step contains the second-order correction by the previous
    /// step. Returns the largest fraction of the step that stays inside all bounds, or `None`
    /// if there is no step.
    fn interior_step(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
        along: &mut CentralPath,
        (gap, near): (f64, StepStart),
    ) -> Option<f64> {
        let nh = self.harmonics().len();
        let corrected = gap > 0.0;
        for (p, port) in ports.iter().enumerate() {
            let Some(barrier) = &mut along.barriers[p] else { continue };
            barrier.set_targets(gap, corrected, &mut along.aft, &mut self.workspace.image[..nh]);
            let range = port.first_axis * nh..(port.first_axis + 1) * nh;
            for (at, (force, image)) in range.clone().zip(motion.force[range].iter().zip(&self.workspace.image)) {
                let r = force - image;
                (self.workspace.residual[2 * at], self.workspace.residual[2 * at + 1]) = (r.re, r.im);
            }
        }
        let found = match corrected {
            true => self.newton_step_same_jacobian(SearchContext::given(ports, omega), near),
            false => self.newton_step(SearchContext::given(ports, omega), near),
        };
        if !found {
            return None;
        }
        self.apply_step(ports, motion, 1.0, near.length);
        self.step_forces(ports, motion, near.length);
        for (p, port) in ports.iter().enumerate().filter(|(_, port)| !port.is_force()) {
            self.add_springs(p, port, CLOSED_CONTACT_SIGN);
        }
        self.structure_motion(motion, GIVEN_EQUATIONS);
        let mut share = 1.0f64;
        for (p, port) in ports.iter().enumerate() {
            if let Some(barrier) = &mut along.barriers[p] {
                argument((self, p, port), omega, motion, &mut along.argument);
                share = share.min(barrier.step(&mut along.aft, &along.argument));
            }
        }
        Some(share)
    }
}

/// Sets `y` to the harmonics of `λ + ε u' + κ ū` along the axis of a port with one axis.
fn argument(
    (discretization, p, port): (&Discretization, usize, &Port),
    omega: f64,
    motion: &HarmonicSolution,
    y: &mut [Complex64],
) {
    let at = port.first_axis * y.len();
    let own = motion.c[at..].iter().zip(&motion.force[at..]).zip(discretization.harmonics());
    for (y, ((c, force), h)) in y.iter_mut().zip(own) {
        *y = force + c * discretization.linear.contacts[p].motion_derivative(*h, omega);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Jenkins};
    use crate::method::harmonic_balance::dynamics::banded::BandedForm;
    use crate::method::harmonic_balance::dynamics::linear_dynamics::LinearDynamics;
    use crate::method::harmonic_balance::equations::homotopy::RESIDUAL_TOLERANCE;
    use crate::model::{
        Disk, Force, GROUND, Joint, Mass, Model, SectorDistribution, Spring, System, normal_deviations,
    };
    use std::f64::consts::TAU;
    use std::sync::Arc;

    /// Frequency near the resonances of the blades, Hz.
    const NEAR: f64 = 16.2;

    /// Returns a ring of blades at 16 Hz, 1 % mistuned, with rigid friction between neighbours.
    fn ring(blades: usize, limit: f64) -> System {
        let deviations = normal_deviations(blades, 0.01, 7);
        let disk = Disk { sectors: blades, forces: vec![SectorDistribution::EngineOrder(3)], motions: vec![] };
        let ring = disk.ring(|s| {
            let between = |other: &str| ["b".to_owned(), other.to_owned()];
            let own = 1e4 * (1.0 + deviations[s]);
            Model {
                masses: vec![Mass::new("b", 1.0)],
                springs: vec![
                    Spring { between: between(GROUND), stiffness: own, damping: 0.5 },
                    Spring { between: between("next.b"), stiffness: 300.0, damping: 0.0 },
                ],
                joints: vec![Joint { name: "j".into(), between: between("next.b"), law: Arc::new(Coulomb { limit }) }],
                forces: vec![Force { on: "b".into(), amplitude: 1.0, phase: 0.0, harmonic: 1 }],
                ..Model::default()
            }
        });
        ring.unwrap().assemble().unwrap()
    }

    /// Returns the equations of a ring at a frequency, in banded form if the ring is large.
    fn discretization(system: &System, hertz: f64) -> (Discretization, Ports) {
        let ports = Ports::new(system).unwrap();
        let harmonics: Vec<usize> = (1..=15).step_by(2).collect();
        let mut discretization =
            Discretization::new(harmonics.clone(), 1024, &ports, BandedForm::new(system, &ports, &harmonics));
        discretization.set_frequency(system, &ports, &LinearDynamics::new(system, &ports), TAU * hertz).unwrap();
        (discretization, ports)
    }

    /// The interior point method and the proximal point method find the same solution.
    #[test]
    fn interior_point_and_proximal_point_solutions_agree() {
        let system = ring(12, 0.5);
        let (mut discretization, ports) = discretization(&system, NEAR);
        let start = discretization.frictionless_motion();
        let (mut one, mut other) = (start.clone(), start);
        discretization.interior_point_method(&ports, TAU * NEAR, &mut one).unwrap();
        discretization.proximal_point_method(&ports, TAU * NEAR, &mut other).unwrap();
        let size = other.c.iter().map(|c| c.norm()).fold(0.0, f64::max);
        let apart = one.c.iter().zip(&other.c).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(apart < 1e-6 * size, "{apart:.1e} of {size:.1e}");
    }

    /// Eight times the blades take at most twice the steps: at a resonance and away from it,
    /// from much slip to much stick.
    #[test]
    fn steps_hardly_grow_with_the_blades() {
        for hertz in [15.5, NEAR, 17.0] {
            for limit in [0.1, 0.5, 1.5] {
                let steps = [12, 96].map(|blades| {
                    let system = ring(blades, limit);
                    let (mut discretization, ports) = discretization(&system, hertz);
                    let mut motion = discretization.frictionless_motion();
                    discretization.interior_point_method(&ports, TAU * hertz, &mut motion).unwrap();
                    assert!(motion.residual <= RESIDUAL_TOLERANCE);
                    motion.iterations
                });
                assert!(steps[1] <= 2 * steps[0].max(20), "{hertz} Hz, {limit} N: {steps:?}");
            }
        }
    }

    /// Without rigid friction there is no path.
    #[test]
    fn elastic_friction_has_no_central_path() {
        let mut couple = crate::model::example::blade_couple_massless();
        couple.joints[0].law = Arc::new(Jenkins { stiffness: 1e4, limit: 2.0 });
        let (mut discretization, ports) = discretization(&couple.assemble().unwrap(), 121.0);
        let mut motion = discretization.frictionless_motion();
        assert!(discretization.interior_point_method(&ports, TAU * 121.0, &mut motion).is_err());
    }
}
