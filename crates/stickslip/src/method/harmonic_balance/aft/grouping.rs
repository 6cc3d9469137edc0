//! Grouping of joints into ports.
//!
//! Joints with proportional relative motions and proportional forces share one
//! force port. While they stick, only the sum of their forces is determined. With
//! one port, rounding cannot make one joint slip before the others. Each joint
//! has a share of the sum; parallel rigid contacts share it by their limits.

use super::sliders::ElasticPart;
use super::{Kernel, Port, PortMember, Ports, RigidFriction, ScaledLaw, StaticState};
use crate::law::{IdealElement, Slider};
use crate::method::MethodError;
use crate::method::harmonic_balance::NAME;
use crate::model::{CollinearAxis, PARALLEL, SystemJoint};

/// Compliance and scales of a new port.
#[derive(Clone, Copy)]
struct PortScales {
    /// Compliance in series with the law, m/N.
    series_compliance: f64,
    /// Typical force of the law, N.
    force: f64,
    /// Smallest penalty of the resolvent, N s/m.
    least_penalty: f64,
}

impl PortScales {
    /// Returns the scales of a port without compliance and without a smallest penalty.
    fn of_force(force: f64) -> PortScales {
        PortScales { series_compliance: 0.0, force, least_penalty: 0.0 }
    }
}

/// The ports of the joints added so far.
#[derive(Default)]
pub(super) struct PortBuilder {
    ports: Ports,
    /// Number of every force port, and the lines of its axes.
    lines: Vec<(usize, Vec<CollinearAxis>)>,
}

impl PortBuilder {
    /// Adds the ports of joint number `j`.
    ///
    /// # Errors
    /// Refuses a law without a view that harmonic balance can use.
    pub fn push(&mut self, j: usize, joint: &SystemJoint) -> Result<(), MethodError> {
        let law = joint.law();
        let unsupported = |misses| MethodError::law(NAME, joint, misses);
        if law.carries_no_force() {
            return Ok(());
        }
        if joint.axes().len() == 1
            && let Some(elements) = law.ideal_elements()
        {
            if elements.iter().any(IdealElement::has_force_drop) {
                return Err(unsupported("its slip limit drops abruptly at the onset of slip"));
            }
            self.add_ideal_elements(j, joint, &elements);
            return Ok(());
        }
        let scale = law.force_scale();
        if joint.axes().len() == 1 && law.masing().is_some() {
            self.add(j, joint, Kernel::Masing(law.clone()), PortScales::of_force(scale));
            return Ok(());
        }
        if let Some(prox) = law.prox() {
            if !(scale.is_finite() && scale > 0.0) {
                return Err(unsupported("its slip limit must be finite and positive"));
            }
            let scales = PortScales {
                series_compliance: prox.compliance(),
                force: scale,
                least_penalty: prox.minimum_penalty(),
            };
            self.add_force(j, joint, Kernel::Prox(ScaledLaw { law: law.clone(), times: 1.0 }), scales);
        } else if law.step().is_some() {
            self.add(j, joint, Kernel::Step(law.clone()), PortScales::of_force(scale));
        } else if law.rate().is_some() {
            self.add(j, joint, Kernel::Rate(law.clone()), PortScales::of_force(scale));
        } else {
            return Err(unsupported(
                "it has no form that harmonic balance can evaluate (ideal elements along one direction, `prox`, `step` or `rate`)",
            ));
        }
        Ok(())
    }

    fn add(&mut self, j: usize, joint: &SystemJoint, kernel: Kernel, scales: PortScales) {
        let PortScales { series_compliance, force: scale, least_penalty } = scales;
        let (first, axes) = (self.ports.axes.len(), joint.axes().len());
        self.ports.axes.extend((0..axes).map(|a| (j, a)));
        let members = vec![PortMember { joint: j, motion_ratio: 1.0, force_ratio: 1.0 }];
        let mut port = Port {
            members,
            first_axis: first,
            axes,
            series_compliance,
            scale,
            least_penalty,
            static_state: StaticState::default(),
            kernel,
        };
        port.static_state.states = vec![0.0; port.states()];
        self.ports.list.push(port);
    }

    /// Adds one port for elastic sliders and stops, and one for rigid sliders.
    /// Both have the same motion.
    fn add_ideal_elements(&mut self, j: usize, joint: &SystemJoint, elements: &[IdealElement]) {
        let mut parts = Vec::new();
        // parallel rigid sliders act as one
        let (mut rigid, mut scale) = (0.0, 0.0);
        for element in elements {
            match *element {
                IdealElement::Slider(Slider { limit: 0.0, .. }) => {}
                IdealElement::Slider(Slider { stiffness: None, limit, .. }) => rigid += limit,
                IdealElement::Slider(Slider { stiffness: Some(stiffness), limit, .. }) => {
                    scale += limit;
                    parts.push(ElasticPart::Slider { stiffness, limit });
                }
                IdealElement::Stop { stiffness: 0.0, .. } => {}
                IdealElement::Stop { gap, stiffness } => {
                    scale = f64::INFINITY;
                    parts.push(ElasticPart::Stop { gap, stiffness });
                }
            }
        }
        if !parts.is_empty() {
            self.add(j, joint, Kernel::Sliders(parts), PortScales::of_force(scale));
        }
        if rigid > 0.0 {
            self.add_force(j, joint, Kernel::Rigid(RigidFriction { limit: rigid }), PortScales::of_force(rigid));
        }
    }

    /// Adds a force port, or adds the joint to an existing port with a proportional motion.
    fn add_force(&mut self, joint: usize, of: &SystemJoint, kernel: Kernel, scales: PortScales) {
        let lines: Vec<CollinearAxis> = of.axes().iter().map(CollinearAxis::of).collect();
        let found = self.lines.iter().find_map(|(port, its)| {
            let factor = motion_ratio(&lines, its)?;
            Some((*port, factor, force_ratio(&kernel, &self.ports.list[*port].kernel, factor)?))
        });
        if let Some((port, factor, times)) = found {
            let share = factor.signum() * times;
            self.ports.list[port].members.push(PortMember { joint, motion_ratio: factor, force_ratio: share });
        } else {
            self.lines.push((self.ports.list.len(), lines));
            self.add(joint, of, kernel, scales);
        }
    }

    /// Sets the force of every port to that of all its joints, and the shares of these joints.
    pub fn finish(mut self) -> Ports {
        for port in &mut self.ports.list {
            // equal virtual work; so far, shares refer to the force of the first joint
            let sum: f64 = port.members.iter().map(|member| member.motion_ratio * member.force_ratio).sum();
            port.members.iter_mut().for_each(|member| member.force_ratio /= sum);
            match &mut port.kernel {
                Kernel::Rigid(rigid) => rigid.limit *= sum,
                Kernel::Prox(of) => of.times *= sum,
                Kernel::Sliders(_) | Kernel::Masing(_) | Kernel::Step(_) | Kernel::Rate(_) => {}
            }
            port.scale *= sum;
            port.series_compliance /= sum;
            port.least_penalty *= sum;
        }
        self.ports
    }
}

/// Returns the factor between all motions along some axes and those along others.
fn motion_ratio(lines: &[CollinearAxis], others: &[CollinearAxis]) -> Option<f64> {
    if lines.len() != others.len() {
        return None;
    }
    let mut factors = lines.iter().zip(others).map(|(line, other)| line.ratio_to(other));
    let first = factors.next()??;
    factors.all(|factor| factor.is_some_and(|f| (f - first).abs() <= PARALLEL * first.abs())).then_some(first)
}

/// Returns the ratio of the force to that of `other`, for a motion that is `factor` times that
/// of `other`. `None` if the ratio depends on the motion.
fn force_ratio(kernel: &Kernel, other: &Kernel, factor: f64) -> Option<f64> {
    match (kernel, other) {
        // rigid friction does not depend on the speed
        (Kernel::Rigid(rigid), Kernel::Rigid(other)) => Some(rigid.limit / other.limit),
        (Kernel::Prox(one), Kernel::Prox(other)) => {
            let as_fast = (factor.abs() - 1.0).abs() <= PARALLEL;
            if as_fast && (factor > 0.0 || other.law.is_odd()) { one.law.force_ratio(&*other.law) } else { None }
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Coulomb2d, CoulombArctan, Jenkins, SharedLaw};
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use nalgebra::DMatrix;
    use std::sync::Arc;

    /// Returns the joints of every port. The contacts act on three coordinates,
    /// given by their laws and the weights of their axes.
    fn members(joints: &[(SharedLaw, &[[f64; 3]])]) -> Vec<Vec<usize>> {
        let places = ["x", "y", "z"].map(str::to_owned).to_vec();
        let structure = Structure::new(places, DMatrix::identity(3, 3), DMatrix::zeros(3, 3), DMatrix::identity(3, 3));
        let mut builder = System::builder(structure.unwrap());
        for (j, (law, axes)) in joints.iter().enumerate() {
            let axis = |weights: &[f64; 3]| Axis::new(weights.iter().copied().enumerate().collect());
            builder = builder.joint(format!("j{j}"), law.clone(), axes.iter().map(axis).collect());
        }
        let ports = Ports::new(&builder.build().unwrap()).unwrap();
        for port in ports.iter() {
            let work: f64 = port.members.iter().map(|member| member.motion_ratio * member.force_ratio).sum();
            assert!((work - 1.0).abs() < 1e-15, "{port:?}");
        }
        ports.iter().map(|port| port.members.iter().map(|member| member.joint).collect()).collect()
    }

    #[test]
    fn rigid_contacts_share_a_line() {
        let rigid = |limit: f64| -> SharedLaw { Arc::new(Coulomb { limit }) };
        let elastic: SharedLaw = Arc::new(Jenkins { stiffness: 3.0, limit: 1.0 });
        let (line, back, other): (&[_], &[_], &[_]) = (&[[1.0, -1.0, 0.0]], &[[-0.2, 0.2, 0.0]], &[[1.0, -1.0, 1e-6]]);
        let joints = [
            (rigid(1.0), line),
            (elastic, line),
            (rigid(1e-9), back),
            (rigid(1.0), other),
            (rigid(0.0), line),
            (rigid(7.0), line),
        ];
        assert_eq!(members(&joints), [vec![0, 2, 5], vec![1], vec![3]]);
    }

    #[test]
    fn laws_of_velocity_share_where_one_is_a_multiple() {
        let plane = |limit: f64| -> SharedLaw { Arc::new(Coulomb2d { limit }) };
        let smooth = |limit: f64, alpha: f64| -> SharedLaw { Arc::new(CoulombArctan { limit, alpha }) };
        let (axes, turned, back, half): (&[_], &[_], &[_], &[_]) = (
            &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            &[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
            &[[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]],
            &[[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]],
        );
        let planes =
            [(plane(1.0), axes), (plane(2.0), back), (plane(1.0), turned), (plane(1.0), half), (plane(0.1), axes)];
        assert_eq!(members(&planes), [vec![0, 1, 4], vec![2], vec![3]]);
        let (line, lever): (&[_], &[_]) = (&[[0.0, 0.0, 1.0]], &[[0.0, 0.0, 2.0]]);
        let lines =
            [(smooth(1.0, 9.0), line), (smooth(2.0, 9.0), line), (smooth(1.0, 8.0), line), (smooth(1.0, 9.0), lever)];
        assert_eq!(members(&lines), [vec![0, 1], vec![2], vec![3]]);
    }
}
