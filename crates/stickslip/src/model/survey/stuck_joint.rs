//! Stiffness, limit and damping of a joint whose sliders do not slip.

use super::super::SystemJoint;
use super::linear_modes::SpringDamper;
use crate::law::{Law, MAX_DIRECTIONS, RatePoint, RelativeMotion, StepPoint};

/// One axis of a joint whose sliders do not slip.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StuckAxis {
    /// Index of the joint in the system.
    pub(super) joint: usize,
    pub(super) axis: usize,
    pub(super) name: String,
    /// The direction `W`, as its entries.
    pub(super) at: Vec<(usize, f64)>,
    pub(super) state: StuckState,
    /// Stiffness of open faces after they close and stick, N/m; zero for all other joints.
    pub(super) closed: f64,
    /// For a normal direction: the force that presses the faces together at zero displacement,
    /// N.
    pub(super) pressed: Option<f64>,
    /// Viscous damping in small motion, without friction and in the stuck state, kg/s.
    pub(super) damping: [f64; 2],
    /// True if the joint slips gradually. `state` then contains the limit of complete slip.
    pub(super) gradual: bool,
}

impl StuckAxis {
    /// Returns one entry per axis of a joint. `law` describes the joint in small motion.
    pub(super) fn of_joint(index: usize, joint: &SystemJoint, law: &dyn Law) -> Vec<Self> {
        let axes = joint.labels().zip(joint.axes()).enumerate();
        axes.map(|(axis, (name, along))| {
            let pressed = (law.normal() == Some(axis)).then(|| law.force_at_rest()[axis]);
            let state =
                pressed.map_or_else(|| StuckState::of(law, axis), |force| StuckState::pressed(law, axis, force));
            let closed = match state {
                StuckState::Nothing => law.closed_stiffness().and_then(|along| along.get(axis).copied()).unwrap_or(0.0),
                StuckState::Spring { .. } | StuckState::Rigid { .. } => 0.0,
            };
            let held = if matches!(state, StuckState::Rigid { .. }) { 0.0 } else { small_damping(law, axis) };
            let damping = [law.frictionless_reference().map_or(0.0, |free| small_damping(&*free, axis)), held];
            let gradual = law.macro_slip_displacement().is_some();
            StuckAxis { joint: index, axis, name, at: along.rows().to_vec(), state, closed, pressed, damping, gradual }
        })
        .collect()
    }
}

impl StuckAxis {
    /// Returns the spring and damper of the stuck joint, if it has any.
    pub(super) fn stuck_link(&self) -> Option<SpringDamper> {
        let stiffness = if let StuckState::Spring { stiffness, .. } = self.state { stiffness } else { 0.0 };
        let damping = self.damping[1];
        (stiffness > 0.0 || damping > 0.0).then(|| SpringDamper { at: self.at.clone(), stiffness, damping })
    }

    /// Returns the damper of the joint without friction, if it has one.
    pub(super) fn free_link(&self) -> Option<SpringDamper> {
        let damping = self.damping[0];
        (damping > 0.0).then(|| SpringDamper { at: self.at.clone(), stiffness: 0.0, damping })
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum StuckState {
    /// The joint carries no force.
    Nothing,
    /// The sum of its springs, N/m; limit and displacement of the slider that slips first.
    Spring {
        stiffness: f64,
        limit: f64,
        displacement: f64,
    },
    Rigid {
        limit: f64,
    },
}

impl StuckState {
    /// Returns the stuck state along one axis of the law.
    fn of(law: &dyn Law, axis: usize) -> StuckState {
        if let Some(displacement) = law.macro_slip_displacement() {
            return StuckState::Spring {
                stiffness: small_stiffness(law, axis),
                limit: law.force_scale(),
                displacement,
            };
        }
        let Some(branches) = law.sliders() else { return StuckState::smooth(law, axis) };
        let branches = || branches.iter().filter(|branch| branch.static_limit > 0.0);
        let rigid = branches().filter(|branch| branch.stiffness.is_none()).map(|branch| branch.static_limit);
        if let Some(limit) = rigid.reduce(|a, b| a + b) {
            return StuckState::Rigid { limit };
        }
        let springs = || branches().filter_map(|branch| Some((branch.stiffness?, branch.limit)));
        let first = springs().min_by(|a, b| (a.1 / a.0).total_cmp(&(b.1 / b.0)));
        let stiffness = springs().map(|(stiffness, _)| stiffness).sum();
        first.map_or(StuckState::Nothing, |(k, limit)| StuckState::Spring { stiffness, limit, displacement: limit / k })
    }

    /// Returns the spring of faces that this force (N) presses together. No load makes them
    /// slip. Faces that only touch carry no force.
    fn pressed(law: &dyn Law, axis: usize, force: f64) -> StuckState {
        let stiffness = small_stiffness(law, axis);
        if force > 0.0 && stiffness > 0.0 {
            StuckState::Spring { stiffness, limit: f64::INFINITY, displacement: f64::INFINITY }
        } else {
            StuckState::Nothing
        }
    }

    /// Returns the stuck state of a smooth law: its spring in small motion, or rigid if its
    /// resistance is viscous. The approximation improves with the slope of the law.
    fn smooth(law: &dyn Law, axis: usize) -> StuckState {
        let (limit, stiffness) = (law.force_scale(), small_stiffness(law, axis));
        match (limit > 0.0, stiffness > 0.0) {
            (false, _) => StuckState::Nothing,
            // faces without friction slide freely
            _ if limit.is_infinite() && law.normal().is_some() => StuckState::Nothing,
            // a law of displacement alone acts as its spring and never slips
            (true, false) if limit.is_infinite() => StuckState::Nothing,
            (true, true) => StuckState::Spring { stiffness, limit, displacement: limit / stiffness },
            (true, false) => StuckState::Rigid { limit },
        }
    }
}

/// Returns the stiffness in motion that is small in every direction, N/m.
fn small_stiffness(law: &dyn Law, axis: usize) -> f64 {
    // a law of velocity alone is as stiff as the spring in series with it, for any
    // regularization
    if let Some(prox) = law.prox() {
        return if prox.compliance() > 0.0 { prox.compliance().recip() } else { 0.0 };
    }
    if law.ideal_elements().is_some() {
        // An amplitude (m) at which no law slips. Its square is still a normal number.
        return law.describing_function(1e-150, 1.0).re;
    }
    let (count, rest) = (law.directions(), [0.0; MAX_DIRECTIONS]);
    if let Some(step) = law.step() {
        let z = vec![0.0; step.states()];
        let mut point = StepPoint::new(count, z.len());
        step.advance_with_derivatives(count, &rest, &rest, &z, &mut point);
        return point.force_slope(axis)[count + axis];
    }
    let Some(rate) = law.rate() else { return 0.0 };
    // includes the immediate response of the states: f_u + f_z z_v
    let z = vec![0.0; rate.states()];
    let mut point = RatePoint::new(count, z.len());
    rate.evaluate_with_derivatives(count, &RelativeMotion { displacement: rest, velocity: rest }, &z, &mut point);
    let by_states = (0..z.len()).map(|s| point.force_slope(axis)[2 * count + s] * point.rate_slope(s)[count + axis]);
    point.force_slope(axis)[axis] + by_states.sum::<f64>()
}

/// Returns the viscous damping in motion that is small in every direction, kg/s: the slope of
/// the force over velocity at constant states.
fn small_damping(law: &dyn Law, axis: usize) -> f64 {
    let Some(rate) = law.rate() else { return 0.0 };
    let (count, rest, z) = (law.directions(), [0.0; MAX_DIRECTIONS], vec![0.0; rate.states()]);
    let mut point = RatePoint::new(count, z.len());
    rate.evaluate_with_derivatives(count, &RelativeMotion { displacement: rest, velocity: rest }, &z, &mut point);
    point.force_slope(axis)[count + axis]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, Gap, Iwan, Jenkins, JenkinsArctan};

    #[test]
    fn stuck_state_is_that_of_small_motion() {
        let spring = StuckState::Spring { stiffness: 1e4, limit: 2.0, displacement: 2e-4 };
        assert_eq!(StuckState::of(&Jenkins { stiffness: 1e4, limit: 2.0 }, 0), spring);
        assert_eq!(StuckState::of(&JenkinsArctan { stiffness: 1e4, limit: 2.0, alpha: 25e3 }, 0), spring);
        // micro-slip from the first motion is not the limit: complete slip begins at FS (1 +
        // β)/(KT (β + (χ + 1)/(χ + 2)))
        let iwan = Iwan { stiffness: 1e4, limit: 2.0, chi: -0.5, beta: 0.3, elements: 0 };
        let StuckState::Spring { stiffness, limit, displacement } = StuckState::of(&iwan, 0) else {
            panic!("{iwan:?}")
        };
        let macro_slip = 2.0 * 1.3 / (1e4 * (0.3 + 0.5 / 1.5));
        assert!(stiffness == 1e4 && limit == 2.0 && (displacement / macro_slip - 1.0).abs() < 1e-12, "{displacement}");
        assert_eq!(StuckState::of(&Coulomb { limit: 2.0 }, 0), StuckState::Rigid { limit: 2.0 });
        assert_eq!(StuckState::of(&CoulombArctan { limit: 2.0, alpha: 25e3 }, 0), StuckState::Rigid { limit: 2.0 });
        // a stop carries force when it is pressed, but not when it only touches
        let stop = |gap: f64| {
            let law = Gap { gap, stiffness: 1e4 };
            StuckState::pressed(&law, 0, (&law as &dyn Law).force_at_rest()[0])
        };
        assert!(matches!(stop(-1e-3), StuckState::Spring { stiffness: 1e4, .. }), "{:?}", stop(-1e-3));
        assert_eq!([0.0, 1e-3].map(stop), [StuckState::Nothing; 2]);
        // without a limit, the joint is free
        assert_eq!(StuckState::of(&Jenkins { stiffness: 1e4, limit: 0.0 }, 0), StuckState::Nothing);
        assert_eq!(StuckState::of(&Coulomb { limit: 0.0 }, 0), StuckState::Nothing);
    }
}
