//! Static equilibrium under the constant loads, from which every method begins.
//!
//! `K x + W f(0 → Wᵀx) = F₀`, solved by harmonic balance of order zero.
//!
//! A contact that is stuck for a whole period keeps the mean friction force of its past, so the
//! same vibration has many solutions. All methods choose one by the same rule. Constant forces
//! and preloads grow from zero in one ramp, and joints slip where their limits require it. The
//! vibration then begins from there. A slider that the vibration does not move stays where the
//! ramp left it; another slider moves only as far as necessary.

use super::flow::average_acceleration::law_step;
use super::harmonic_balance;
use crate::law::{IdealElement, Law, MAX_DIRECTIONS, RelativeMotion};
use crate::model::System;
use crate::orbit::Orbit;
use num_complex::Complex64;

/// Displacements, joint states and joint forces under the constant loads.
///
/// # Example
/// A mass of 1 kg hangs on a spring of 1000 N/m and a Jenkins joint of the same stiffness that
/// slips at 2 N. Under 10 N the joint slips, and the spring carries 8 N.
/// ```
/// use std::sync::Arc;
/// use stickslip::law::Jenkins;
/// use stickslip::method::StaticEquilibrium;
/// use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring};
/// let between = || ["m".to_owned(), GROUND.to_owned()];
/// let model = Model {
///     masses: vec![Mass::new("m", 1.0)],
///     springs: vec![Spring { between: between(), stiffness: 1000.0, damping: 1.0 }],
///     joints: vec![Joint {
///         name: "j".into(),
///         between: between(),
///         law: Arc::new(Jenkins { stiffness: 1000.0, limit: 2.0 }),
///     }],
///     forces: vec![Force { on: "m".into(), amplitude: 10.0, phase: 0.0, harmonic: 0 }],
///     ..Model::default()
/// };
/// let equilibrium = StaticEquilibrium::of(&model.assemble().unwrap()).unwrap();
/// assert!((equilibrium.displacement()[0] - 8e-3).abs() < 1e-12);
/// assert!((equilibrium.forces()[0][0] - 2.0).abs() < 1e-9);
/// ```
#[derive(Debug, Clone)]
pub struct StaticEquilibrium {
    /// An orbit without motion.
    orbit: Orbit,
    dofs: usize,
}

impl StaticEquilibrium {
    /// Computes the static equilibrium of a system. Returns `None` if no stiffness carries a
    /// constant load, or if the iteration does not converge.
    pub fn of(system: &System) -> Option<Self> {
        let orbit = harmonic_balance::static_equilibrium_of(system)?;
        Some(StaticEquilibrium { orbit, dofs: system.dofs() })
    }

    /// Computes the static equilibrium; returns `None` also if no constant force, imposed
    /// displacement or preload acts.
    pub fn under_load(system: &System) -> Option<Self> {
        let constant = system.harmonics_of_excitation(|z| z != Complex64::ZERO).contains(&0);
        let loaded = constant || system.joints().iter().any(|joint| is_preloaded(&**joint.law()));
        if loaded { StaticEquilibrium::of(system) } else { None }
    }

    /// Returns the displacements of all degrees of freedom, m.
    pub fn displacement(&self) -> &[f64] {
        &self.orbit.initial_state[..self.dofs]
    }

    /// Returns the forces of each joint along its directions, N.
    pub fn forces(&self) -> Vec<[f64; MAX_DIRECTIONS]> {
        self.orbit.sample(0.0).joints.iter().map(|joint| joint.force).collect()
    }

    /// Returns the internal states of all joints, in the order of the joints.
    pub fn joint_states(&self) -> &[f64] {
        &self.orbit.initial_state[2 * self.dofs..]
    }
}

/// Returns true if a law has a force before its joint moves.
fn is_preloaded(law: &dyn Law) -> bool {
    let rest = [0.0; MAX_DIRECTIONS];
    let force = match (law.step(), law.rate()) {
        (Some(step), _) => step.advance_values(&rest, &rest, &mut vec![0.0; step.states()]),
        (None, Some(rate)) => {
            let mut z = vec![0.0; rate.states()];
            rate.evaluate_values(&RelativeMotion { displacement: rest, velocity: rest }, &z.clone(), &mut z)
        }
        (None, None) => rest,
    };
    let pressed =
        |piece: &IdealElement| matches!(piece, IdealElement::Stop { gap, stiffness } if *gap < 0.0 && *stiffness > 0.0);
    force != rest || law.ideal_elements().is_some_and(|pieces| pieces.iter().any(pressed))
}

/// Returns the internal states of all joints at other displacements (m), after a straight and
/// slow path from static equilibrium.
///
/// Imposed motions are at phase zero of the excitation. `count` is the number of states that
/// the caller's integration has. Without a static equilibrium, or if the joints have another
/// number of states, all states are zero.
pub(crate) fn states_at(
    equilibrium: Option<&StaticEquilibrium>,
    system: &System,
    displacement: &[f64],
    count: usize,
) -> Vec<f64> {
    let Some(equilibrium) = equilibrium else { return vec![0.0; count] };
    let known = equilibrium.joint_states();
    let mut states = Vec::with_capacity(count);
    for joint in system.joints() {
        let axes = joint.axes();
        let Some((own, scale)) = law_step::states(joint.law()) else { continue };
        let along = |x: &[f64], vibrates: bool| -> [f64; MAX_DIRECTIONS] {
            std::array::from_fn(|a| {
                let Some(axis) = axes.get(a) else { return 0.0 };
                let imposed = axis.imposed().iter().filter(|(h, _)| vibrates || *h == 0).map(|(_, g)| g.re);
                axis.component(x) + imposed.sum::<f64>()
            })
        };
        let from = along(equilibrium.displacement(), false);
        let first = states.len();
        let before = known.get(first..first + own).map_or_else(|| vec![0.0; own], <[f64]>::to_vec);
        let to = along(displacement, true);
        states.extend(law_step::states_after_motion(joint.law(), (axes.len(), scale), (from, &before), to));
    }
    if states.len() == count { states } else { vec![0.0; count] }
}
