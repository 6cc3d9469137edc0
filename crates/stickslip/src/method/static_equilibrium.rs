//! Static equilibrium under the constant loads, from which every method begins.
//!
//! `K x + W f(0 → Wᵀx) = F₀`, solved by harmonic balance of order zero.
//!
//! A contact that is stuck for a whole period keeps the mean friction force of its past, so the
//! same vibration has many solutions. All methods choose one by the same rule. Constant forces
//! and preloads grow from zero in one ramp, and joints slip where their limits require it. The
//! vibration then begins from there. A slider that the vibration does not move stays where the
//! ramp left it; another slider moves only as far as necessary.
//!
//! The force of rigid friction depends on velocities alone. During the ramp, a stiff spring with
//! its slip limit takes its place.

use super::flow::average_acceleration::law_step;
use super::harmonic_balance;
use crate::law::{IdealElement, Jenkins, Jenkins2d, Law, MAX_DIRECTIONS, SharedLaw};
use crate::model::{Axis, System, SystemJoint};
use crate::orbit::Orbit;
use num_complex::Complex64;
use std::sync::Arc;

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
    /// Internal states of all joints, in the order of the joints.
    states: Vec<f64>,
}

impl StaticEquilibrium {
    /// Computes the static equilibrium of a system. Returns `None` if no stiffness carries a
    /// constant load, or if the iteration does not converge.
    pub fn of(system: &System) -> Option<Self> {
        StaticEquilibrium::holding(system, &[])
    }

    /// Computes the static equilibrium with some places held: axes, and their displacements (m,
    /// or rad for rotations). Returns `None` as [`StaticEquilibrium::of`] does.
    ///
    /// A stiff spring pulls every place towards a target, and the targets are corrected until
    /// each place is at its displacement. An axis may be any combination of degrees of freedom,
    /// as for a point of a reduced structure.
    ///
    /// # Example
    /// Two springs in series; the outer end is pulled to 4 mm.
    /// ```
    /// use stickslip::method::StaticEquilibrium;
    /// use stickslip::model::{GROUND, Mass, Model, Spring};
    /// let spring = |a: &str, b: &str, stiffness| Spring {
    ///     between: [a.into(), b.into()],
    ///     stiffness,
    ///     damping: 0.0,
    /// };
    /// let model = Model {
    ///     masses: vec![Mass::new("a", 1.0), Mass::new("b", 1.0)],
    ///     springs: vec![spring("a", "b", 3e3), spring("b", GROUND, 1e3)],
    ///     ..Model::default()
    /// };
    /// let system = model.assemble().unwrap();
    /// let pulled = [(system.place_axes()[0].clone(), 4e-3)];
    /// let held = StaticEquilibrium::holding(&system, &pulled).unwrap();
    /// assert!((held.displacement()[1] - 3e-3).abs() < 1e-12);
    /// ```
    pub fn holding(system: &System, held: &[(Axis, f64)]) -> Option<Self> {
        let given = system;
        let system = &given.with_laws(|joint| rigid_friction_spring(given, joint));
        let made = |orbit: Orbit| StaticEquilibrium {
            states: states_of(given, &orbit.initial_state[2 * given.dofs()..]),
            dofs: given.dofs(),
            orbit,
        };
        if held.is_empty() {
            return harmonic_balance::static_equilibrium_of(system).map(|found| made(found.orbit));
        }
        let largest = held.iter().fold(0.0f64, |largest, (_, value)| largest.max(value.abs()));
        let axis_stiffnesses: Vec<f64> = held.iter().map(|(axis, _)| stiffness_along(system, axis)).collect();
        let mut targets: Vec<f64> = held.iter().map(|(_, value)| *value).collect();
        // stiffness of the springs relative to that of the structure; each pass leaves less than
        // its inverse of the distances
        let mut factor = 100.0;
        let mut left = f64::INFINITY;
        for _ in 0..20 {
            let springs = held.iter().zip(&targets).zip(&axis_stiffnesses).map(|(((axis, _), target), along)| {
                let stiffness = factor * along;
                (axis, stiffness, stiffness * target)
            });
            let pulled = system.with_springs(&springs.collect::<Vec<_>>())?;
            let mut orbit = harmonic_balance::static_equilibrium_of(&pulled)?.orbit;
            let displacement = &orbit.initial_state[..system.dofs()];
            let distances: Vec<f64> = held.iter().map(|(axis, value)| value - axis.component(displacement)).collect();
            let farthest = distances.iter().fold(0.0f64, |farthest, distance| farthest.max(distance.abs()));
            // the distance no longer shrinks: it is rounding, or the spring is too soft
            let stalls = farthest > 0.1 * left;
            if farthest <= if stalls { 1e-9 } else { 1e-12 } * largest {
                for (axis, value) in held {
                    if let [(row, 1.0)] = *axis.rows() {
                        orbit.initial_state[row] = *value;
                    }
                }
                return Some(made(orbit));
            }
            if stalls {
                factor *= 100.0;
            }
            left = farthest;
            targets.iter_mut().zip(&distances).for_each(|(target, distance)| *target += distance);
        }
        None
    }

    /// Computes the static equilibrium; returns `None` also if no constant force, imposed
    /// displacement or preload acts.
    pub fn under_load(system: &System) -> Option<Self> {
        if StaticEquilibrium::has_load(system) { StaticEquilibrium::of(system) } else { None }
    }

    /// Returns true if a constant force, imposed displacement or preload acts.
    pub fn has_load(system: &System) -> bool {
        let constant = system.harmonics_of_excitation(|z| z != Complex64::ZERO).contains(&0);
        constant || system.joints().iter().any(|joint| is_preloaded(&**joint.law()))
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
        &self.states
    }
}

/// Returns the states of the joints of a system from those of the joints whose rigid friction was
/// replaced by springs, and which have no states themselves.
fn states_of(system: &System, of_all: &[f64]) -> Vec<f64> {
    let mut left = of_all;
    let mut states = Vec::with_capacity(of_all.len());
    for joint in system.joints() {
        let spring = rigid_friction_spring(system, joint);
        let count = law_step::states(spring.as_ref().unwrap_or(joint.law())).map_or(0, |(own, _)| own);
        let (own, rest) = left.split_at(count.min(left.len()));
        if spring.is_none() {
            states.extend(own);
        }
        left = rest;
    }
    states
}

/// Returns a stiffness of the structure along an axis, N/m, from the diagonal of its matrix: exact
/// for modal coordinates without rigid-body motions, otherwise not less than that of the structure.
fn stiffness_along(system: &System, axis: &Axis) -> f64 {
    let structure = system.structure();
    let compliance: f64 = axis
        .rows()
        .iter()
        .map(|(row, weight)| (weight * weight, structure.diagonal_stiffness(*row)))
        .filter(|(_, stiffness)| *stiffness > 0.0)
        .map(|(square, stiffness)| square / stiffness)
        .sum();
    let [mass, _, stiffness] = structure.largest();
    match compliance {
        _ if compliance > 0.0 => 1.0 / compliance,
        _ if stiffness > 0.0 => stiffness,
        _ => mass,
    }
}

/// Returns the spring with a slip limit that acts in place of rigid friction during a slow ramp;
/// `None` for other laws. The friction of a law that drops at the onset of slip is its lower limit.
fn rigid_friction_spring(system: &System, joint: &SystemJoint) -> Option<SharedLaw> {
    /// A stuck joint moves by less than a millionth of its motion without friction.
    const RIGID: f64 = 1e6;
    let law = joint.law();
    let limit = match (law.ideal_elements(), law.sliding()) {
        (Some(elements), _) => {
            let rigid = elements.iter().filter_map(|element| match element {
                IdealElement::Slider(slider) if slider.stiffness.is_none() => Some(slider.limit),
                _ => None,
            });
            rigid.sum()
        }
        (None, Some(sliding)) => sliding.slip_force(0.0).0,
        (None, None) if law.prox().is_some() && law.rate().is_none() => law.force_scale(),
        (None, None) => 0.0,
    };
    if !(limit > 0.0 && limit.is_finite()) {
        return None;
    }
    let stiffest = joint.axes().iter().map(|axis| stiffness_along(system, axis)).fold(0.0, f64::max);
    let stiffness = RIGID * stiffest;
    match joint.axes() {
        [_] => Some(Arc::new(Jenkins { stiffness, limit })),
        [_, _] => Some(Arc::new(Jenkins2d { stiffness, limit })),
        _ => None,
    }
}

/// Returns true if a law has a force before its joint moves.
fn is_preloaded(law: &dyn Law) -> bool {
    let pressed =
        |piece: &IdealElement| matches!(piece, IdealElement::Stop { gap, stiffness } if *gap < 0.0 && *stiffness > 0.0);
    law.force_at_rest() != [0.0; MAX_DIRECTIONS]
        || law.ideal_elements().is_some_and(|pieces| pieces.iter().any(pressed))
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
