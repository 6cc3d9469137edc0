//! Ports: the interface between a law and the equations of harmonic balance.
//!
//! A joint's law becomes one or several ports, by the view that is chosen for it. A port has
//! one axis for each direction of the law, and one complex unknown per axis and harmonic:
//! - A *motion port* (sliders and stops, Masing, rate, step) has the motion `u`
//!   as its unknown. It computes the force `f(u)`.
//! - A *force port* (prox) has the force `λ` as its unknown. It computes the
//!   image `P J(λ + ε u')`, which must equal `λ`. `J` is the resolvent of the
//!   law, `P` the truncation to the harmonics of the series.
//!
//! Both kinds return the exact derivative by all unknowns of the port. The equations use nothing
//! else of a law. Joints with proportional motions may share one force port, see [`grouping`].
//!
//! From harmonics to time and back:
//! - `frequency_time`: signals of a port over a period, and helpers of all kernels
//! - `series`: a motion at any phase: value, derivatives, zeros, range
//! - `events`: turning points, and intervals in which a slider's force is linear
//!
//! The kernels:
//! - `sliders`: sliders behind springs, and stops, exact for the series
//! - `masing`: laws that obey Masing's rules, exact for the series
//! - `rate`, `step`: laws in rate form and in step form
//! - `periodic_state`: states of laws with memory that repeat after a period
//! - `prox`: laws of velocity by their resolvent
//! - `interior_point`: interior-point form of rigid friction
//!
//! Others:
//! - `grouping`: from joints to ports
//! - `workspace`: scratch memory of laws with memory
//! - `tests`: tests of every kind of port

mod events;
mod frequency_time;
mod grouping;
mod interior_point;
mod masing;
mod periodic_state;
mod prox;
mod rate;
mod series;
mod sliders;
mod step;
#[cfg(test)]
mod tests;
mod workspace;

pub(super) use frequency_time::{FrequencyTime, InitialState};
use grouping::PortBuilder;
pub(super) use interior_point::InteriorPort;
use prox::{RigidFriction, ScaledLaw};
use sliders::ElasticPart;
pub(super) use workspace::{PERIODICITY_TOLERANCE, derivative_batch};

use crate::law::{MAX_DIRECTIONS, MasingView, ProxView, SharedLaw};
use crate::method::MethodError;
use crate::method::harmonic_balance::equations::contact_parameter::ContactParameters;
use crate::model::{Axis, CyclicSymmetry, System, SystemJoint};
use num_complex::Complex64;

/// Number of axes from which GMRES may replace elimination. With few axes and many harmonics,
/// GMRES converges slowly and the matrix is small.
pub(super) const KRYLOV_AXES: usize = 24;

/// The law of a port, by the view that is used.
#[derive(Debug, Clone)]
enum Kernel {
    /// Sliders behind springs, and stops, in parallel along one axis. The force
    /// is exact for the series.
    Sliders(Vec<ElasticPart>),
    /// Rigid sliders in parallel along one axis, combined into one.
    Rigid(RigidFriction),
    /// A law by its resolvent.
    Prox(ScaledLaw),
    /// A law by its curve of first loading. The force is exact for the series.
    Masing(SharedLaw),
    /// A law by its return map.
    Step(SharedLaw),
    /// A law by the rates of its states.
    Rate(SharedLaw),
}

/// A joint that acts at a port. Each axis of the port corresponds to the
/// joint's axis of the same number.
#[derive(Debug, Clone, Copy)]
pub(super) struct PortMember {
    pub joint: usize,
    /// Motion of the joint divided by the motion of the port.
    pub motion_ratio: f64,
    /// Force of the joint divided by the force of the port.
    pub force_ratio: f64,
}

/// Displacements and states of a joint in static equilibrium under the constant
/// loads. The history of every motion begins there.
#[derive(Debug, Clone, Default)]
pub(super) struct StaticState {
    /// Displacements along the axes of the port, m.
    pub displacement: [f64; MAX_DIRECTIONS],
    /// Internal states of the law, or the forces of its sliders (N); empty if the law has none.
    pub states: Vec<f64>,
}

/// A relative motion along one to three axes, with the law that acts along it.
/// It is the motion of one joint, of several joints with proportional motions,
/// or of their inner sliders behind springs.
#[derive(Debug, Clone)]
pub(super) struct Port {
    /// The joints of the port. The port has the axes of the first one.
    pub members: Vec<PortMember>,
    /// Number of its first axis among the axes of all ports.
    pub first_axis: usize,
    /// Number of axes.
    pub axes: usize,
    /// Compliance of the spring between the joint and this port, m/N; zero if
    /// the port has the joint's own motion.
    pub series_compliance: f64,
    /// Size of its forces, N; infinite if they are unbounded. Finite for a force port.
    pub scale: f64,
    /// The penalty above which its resolvent is single-valued, N s/m.
    pub least_penalty: f64,
    /// Static equilibrium of its joint.
    pub static_state: StaticState,
    kernel: Kernel,
}

impl Port {
    /// Tells whether the unknown is the force.
    pub fn is_force(&self) -> bool {
        matches!(self.kernel, Kernel::Rigid(_) | Kernel::Prox(_))
    }

    /// Returns the unit of its unknowns: the length of the motion (m), or the law's scale (N).
    pub fn unit(&self, length: f64) -> f64 {
        if self.is_force() { self.scale } else { length }
    }

    /// Tells whether the law is integrated through the period, step by step.
    /// Derivatives then cost many times as much as forces.
    pub fn has_memory_steps(&self) -> bool {
        self.uses_return_map() || self.rate_law_with_states().is_some()
    }

    /// Tells whether the law is integrated by its return map.
    pub fn uses_return_map(&self) -> bool {
        matches!(self.kernel, Kernel::Step(_))
    }

    /// Tells whether friction is rigid, so that accelerations jump.
    pub fn is_rigid(&self) -> bool {
        match &self.kernel {
            Kernel::Rigid(_) => true,
            Kernel::Prox(times) => times.force_at_velocity(0.0).is_none(),
            _ => false,
        }
    }

    /// Returns the limit of rigid friction along one axis, N.
    pub fn limit(&self) -> Option<f64> {
        match &self.kernel {
            Kernel::Rigid(rigid) => Some(rigid.limit),
            _ => None,
        }
    }

    /// Tells whether the kernel distinguishes slip from stick at every sample
    /// ([`FrequencyTime::slips`]).
    pub fn samples_slip(&self) -> bool {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().all(|part| matches!(part, ElasticPart::Slider { .. })),
            Kernel::Rigid(_) => true,
            _ => false,
        }
    }

    /// Returns the numbers of its axes among the axes of all ports.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first_axis..self.first_axis + self.axes
    }

    /// Returns the entry of a joint, if the joint belongs to this port.
    pub fn member(&self, joint: usize) -> Option<&PortMember> {
        self.members.iter().find(|member| member.joint == joint)
    }

    /// Tells whether two ports have the same kind, axes and joints, whatever their parameters.
    pub fn is_like(&self, other: &Port) -> bool {
        let kind = |port: &Port| (port.first_axis, port.axes, std::mem::discriminant(&port.kernel));
        let alike = |(own, its): (&PortMember, &PortMember)| own.joint == its.joint;
        kind(self) == kind(other)
            && self.members.len() == other.members.len()
            && self.members.iter().zip(&other.members).all(alike)
    }

    /// Estimates the stiffness at rest along its axes, N/m; zero if the port is rigid.
    pub fn stiffness(&self) -> f64 {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().map(ElasticPart::stiffness).sum(),
            Kernel::Rigid(_) | Kernel::Prox(_) => {
                if self.series_compliance > 0.0 {
                    1.0 / self.series_compliance
                } else {
                    0.0
                }
            }
            Kernel::Masing(law) | Kernel::Step(law) | Kernel::Rate(law) => {
                // for a rate law, at 1 rad/s, where its states are assumed to follow
                let at_rest = crate::method::orbit_search::describing_guess::small_motion_stiffness(&**law, 1.0);
                (0..self.axes).map(|a| at_rest[(a, a)].norm()).fold(0.0, f64::max)
            }
        }
    }

    /// Returns the stiffness along one axis while the faces are closed and stick, N/m. It is
    /// zero for a force port, whose force is an unknown.
    pub fn closed_stiffness(&self, axis: usize) -> f64 {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().map(ElasticPart::closed).sum(),
            Kernel::Rigid(_) | Kernel::Prox(_) => 0.0,
            Kernel::Masing(law) | Kernel::Step(law) | Kernel::Rate(law) => match law.closed_stiffness() {
                Some(closed) => closed[axis],
                None => {
                    crate::method::orbit_search::describing_guess::small_motion_stiffness(&**law, 1.0)[(axis, axis)].re
                }
            },
        }
    }

    /// Returns the largest displacement at which its springs begin to slip, m;
    /// zero without springs.
    pub fn slip_displacement(&self) -> f64 {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().map(ElasticPart::reach).fold(0.0, f64::max),
            Kernel::Masing(law) => law.masing().map_or(0.0, MasingView::slip_displacement),
            _ => 0.0,
        }
    }

    /// Returns the displacement over which the states of a law cross their range, m. `None` for
    /// a law without followed states or with an unbounded force.
    pub fn state_range_displacement(&self) -> Option<f64> {
        self.rate_law_with_states().map(|_| self.scale / self.stiffness()).filter(|layer| layer.is_finite())
    }

    /// Returns the number of internal states of a motion port.
    fn states(&self) -> usize {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().filter(|part| matches!(part, ElasticPart::Slider { .. })).count(),
            Kernel::Step(law) | Kernel::Masing(law) => law.step().map_or(0, |step| step.states()),
            Kernel::Rate(law) => law.rate().map_or(0, |rate| rate.states()),
            Kernel::Rigid(_) | Kernel::Prox(_) => 0,
        }
    }

    /// Returns the law if it is a rate law with internal states.
    fn rate_law_with_states(&self) -> Option<&SharedLaw> {
        match &self.kernel {
            Kernel::Rate(law) if law.rate().is_some_and(|rate| rate.states() > 0) => Some(law),
            _ => None,
        }
    }

    /// Returns the law if its force is bounded, sampled, and decided by the velocity alone.
    fn velocity_law(&self) -> Option<&SharedLaw> {
        match &self.kernel {
            Kernel::Prox(times) => Some(&times.law),
            Kernel::Rate(law) if law.rate().is_some_and(|rate| rate.states() == 0) => {
                self.scale.is_finite().then_some(law)
            }
            _ => None,
        }
    }

    fn prox(&self) -> Option<&dyn ProxView> {
        match &self.kernel {
            Kernel::Rigid(rigid) => Some(rigid),
            Kernel::Prox(times) => Some(times),
            _ => None,
        }
    }
}

/// The ports of a system. A joint that carries no force has no port.
#[derive(Debug, Clone, Default)]
pub(super) struct Ports {
    list: Vec<Port>,
    /// Joint and axis within the joint, for every axis. A port of several
    /// joints lists the first one.
    axes: Vec<(usize, usize)>,
    wave: Option<CyclicSymmetry>,
    /// Displacements along all axes in static equilibrium, m; empty if unknown.
    equilibrium: Vec<f64>,
}

impl std::ops::Deref for Ports {
    type Target = [Port];
    fn deref(&self) -> &[Port] {
        &self.list
    }
}

impl Ports {
    /// Creates the ports of all joints.
    ///
    /// # Errors
    /// Refuses a law without a view that harmonic balance can use.
    pub fn new(system: &System) -> Result<Self, MethodError> {
        Ports::from_joints(system.joints())
    }

    fn from_joints(joints: &[SystemJoint]) -> Result<Self, MethodError> {
        let mut gathered = PortBuilder::default();
        for (j, joint) in joints.iter().enumerate() {
            gathered.push(j, joint)?;
        }
        Ok(gathered.finish())
    }

    /// Returns the ports of the first sector of a ring in a travelling wave, and the ports of
    /// the whole ring, sector by sector. For any other system, returns all ports and `None`.
    ///
    /// # Errors
    /// See [`Ports::new`].
    pub fn for_sector(system: &System) -> Result<(Self, Option<Self>), MethodError> {
        let Some(cyclic) = system.cyclic() else { return Ok((Ports::new(system)?, None)) };
        let joints = system.joints().len() / cyclic.sectors;
        let first = Ports { wave: Some(cyclic), ..Ports::from_joints(&system.joints()[..joints])? };
        let mut all = Ports::default();
        for sector in 0..cyclic.sectors {
            let (before, axes) = (sector * joints, all.axes.len());
            all.axes.extend(first.axes.iter().map(|(joint, a)| (before + joint, *a)));
            all.list.extend(first.iter().map(|port| {
                let members = port.members.iter().map(|member| PortMember { joint: before + member.joint, ..*member });
                Port { members: members.collect(), first_axis: axes + port.first_axis, ..port.clone() }
            }));
        }
        Ok((first, Some(all)))
    }

    /// Returns the displacements along all axes in static equilibrium, m; empty if unknown.
    pub fn equilibrium(&self) -> &[f64] {
        &self.equilibrium
    }

    /// Sets the states from which the history of every motion begins, one for each port. For a
    /// ring, `states` are those of the first sector.
    pub fn set_static_states(&mut self, states: &[StaticState]) {
        let of_ports = self.list.iter().zip(states.iter().cycle());
        self.equilibrium = of_ports.flat_map(|(port, state)| state.displacement[..port.axes].to_vec()).collect();
        for (port, state) in self.list.iter_mut().zip(states.iter().cycle()).filter(|(port, _)| !port.is_force()) {
            port.static_state.displacement = state.displacement;
            if state.states.len() == port.states() {
                port.static_state.states.clone_from(&state.states);
            }
        }
    }

    /// Sets other states from which the history of the joints begins, one for each port. For a
    /// ring, `states` are those of the first sector.
    pub fn set_history(&mut self, states: &[StaticState]) {
        let of_ports = self.list.iter_mut().zip(states.iter().cycle());
        of_ports.for_each(|(port, state)| port.static_state.clone_from(state));
    }

    /// Returns the static states of all ports.
    pub fn static_states(&self) -> Vec<StaticState> {
        self.list.iter().map(|port| port.static_state.clone()).collect()
    }

    /// Returns the travelling wave, if these are the ports of the first sector alone.
    pub fn wave(&self) -> Option<CyclicSymmetry> {
        self.wave
    }

    /// Returns the number of axes of all ports.
    pub fn count(&self) -> usize {
        self.axes.len()
    }

    /// Returns an axis by its number.
    pub fn axis<'a>(&self, system: &'a System, number: usize) -> &'a Axis {
        let (joint, axis) = self.axes[number];
        &system.joints()[joint].axes()[axis]
    }

    /// Returns the joint of an axis (the first joint of its port), and the axis within the joint.
    pub fn joint_axis(&self, number: usize) -> (usize, usize) {
        self.axes[number]
    }

    /// Tells whether any unknown is a force.
    pub fn has_forces(&self) -> bool {
        self.list.iter().any(Port::is_force)
    }

    /// Tells whether any force is bounded, sampled, and decided by the velocity alone: friction
    /// that is steep, falls with velocity, or acts in a plane.
    pub fn has_steep(&self) -> bool {
        self.list.iter().any(|port| port.velocity_law().is_some())
    }

    /// Tells whether such a force, or the force of a rate law with states, may fall with velocity.
    pub fn has_falling(&self) -> bool {
        let laws = self.list.iter().filter_map(|port| port.velocity_law().or_else(|| port.rate_law_with_states()));
        laws.into_iter().any(|law| !law.is_incrementally_passive())
    }
}

impl FrequencyTime {
    /// Computes the harmonics of the force of a motion port that moves with the harmonics `c`,
    /// [axis][harmonic], into `force`. Writes the derivative by (Re, Im) of the harmonics into
    /// `tangent` (row-major, 2 × axes × harmonics squared).
    ///
    /// The law is evaluated at `1/limit_factor` of the motion, and its force is multiplied by
    /// `limit_factor`. A large factor raises the slip limits: every joint sticks, as in a very
    /// small motion.
    pub fn motion_port_force(
        &mut self,
        port: &Port,
        (omega, limit_factor): (f64, f64),
        c: &[Complex64],
        force: &mut [Complex64],
        mut tangent: Option<&mut [f64]>,
    ) {
        let mut motion = std::mem::take(&mut self.argument);
        motion.clear();
        motion.extend(c.iter().map(|c| c / limit_factor));
        force.fill(ZERO);
        if let Some(tangent) = tangent.as_deref_mut() {
            tangent.fill(0.0);
            if let Some(by_frequency) = &mut self.by_frequency {
                by_frequency.clear();
                by_frequency.resize(c.len(), ZERO);
            }
        }
        match &port.kernel {
            Kernel::Sliders(parts) => self.slider_forces(parts, &port.static_state, &motion, force, tangent),
            Kernel::Masing(law) => {
                if let Some(law) = law.masing() {
                    self.masing(law, &port.static_state, &motion, force, tangent);
                }
            }
            Kernel::Rate(law) => {
                if let Some(rate) = law.rate() {
                    self.rate(rate, port, omega, &motion, force, tangent);
                }
            }
            Kernel::Step(law) => {
                if let Some(step) = law.step() {
                    self.step(step, port, &motion, force, tangent);
                }
            }
            Kernel::Rigid(_) | Kernel::Prox(_) => {}
        }
        force.iter_mut().for_each(|f| *f *= limit_factor);
        self.by_frequency.iter_mut().flatten().for_each(|f| *f *= limit_factor);
        self.argument = motion;
    }

    /// Computes the image of the forces λ of a force port along a motion c: `P J(λ + ε c' + κ c̄)`.
    /// If the motion is imposed, the image is the law's force at that velocity, and λ does not
    /// change it. Writes the derivative of the image by the argument of `J` into `tangent`. For
    /// `limit_factor`, see [`FrequencyTime::motion_port_force`].
    pub fn force_port_image(
        &mut self,
        port: &Port,
        (omega, contact, limit_factor): (f64, ContactParameters, f64),
        (c, force): (&[Complex64], &[Complex64]),
        image: &mut [Complex64],
        mut tangent: Option<&mut [f64]>,
    ) {
        image.fill(ZERO);
        if let Some(tangent) = tangent.as_deref_mut() {
            tangent.fill(0.0);
        }
        let Some(prox) = port.prox() else { return };
        let nh = self.harmonics.len();
        let turn = |i: usize, harmonics: &[usize]| Complex64::new(0.0, harmonics[i % nh] as f64 * omega);
        let mut signal = std::mem::take(&mut self.argument);
        signal.clear();
        if contact.is_imposed() {
            let speed: f64 = c.iter().enumerate().map(|(i, c)| (c * turn(i, &self.harmonics)).norm()).sum();
            // Velocity range over which rigid friction changes its sign, relative to the speed. It
            // applies where the motion along a contact is imposed, so that the structure cannot
            // move.
            let width = (1e-9 * speed).max(f64::MIN_POSITIVE);
            signal.extend(c.iter().enumerate().map(|(i, c)| c * turn(i, &self.harmonics) / limit_factor));
            self.velocity(prox, port, width / limit_factor, &mut signal, image);
        } else {
            let moved = c.iter().enumerate().map(|(i, c)| match self.harmonics[i % nh] {
                0 => c * contact.mean_stiffness,
                _ => c * turn(i, &self.harmonics) * contact.epsilon,
            });
            signal.extend(moved.zip(force).map(|(moved, force)| (force + moved) / limit_factor));
            self.resolve(prox, port, contact.epsilon, &signal, image, tangent);
        }
        image.iter_mut().for_each(|f| *f *= limit_factor);
        self.argument = signal;
    }

    /// Samples the forces of a port in a converged motion, see [`FrequencyTime::force`].
    pub fn sample(
        &mut self,
        port: &Port,
        omega: f64,
        contact: ContactParameters,
        c: &[Complex64],
        force: &[Complex64],
    ) {
        if let Kernel::Sliders(parts) = &port.kernel {
            return self.sample_slides(parts, &port.static_state, c);
        }
        if let Kernel::Masing(law) = &port.kernel {
            return self.sample_masing(&**law, &port.static_state, c);
        }
        let mut out = vec![ZERO; c.len()];
        if let Kernel::Step(law) = &port.kernel
            && let Some(step) = law.step()
        {
            self.step_by_step(step, port, c, &mut out, None);
        } else if port.is_force() {
            self.force_port_image(port, (omega, contact, 1.0), (c, force), &mut out, None);
        } else {
            self.motion_port_force(port, (omega, 1.0), c, &mut out, None);
        }
    }
}

const ZERO: Complex64 = Complex64::new(0.0, 0.0);
const _: () = assert!(MAX_DIRECTIONS == 3, "signals of a port are kept for three axes");

/// Returns the start of every port's tangent, and the length of all. A port
/// with d axes has a square of 2 d × harmonics rows.
pub(super) fn tangent_ranges(ports: &Ports, harmonics: usize) -> (Vec<usize>, usize) {
    let mut length = 0;
    let starts = ports
        .iter()
        .map(|port| {
            let start = length;
            length += (2 * harmonics * port.axes).pow(2);
            start
        })
        .collect();
    (starts, length)
}

/// Returns the index range of the tangent of port number `p`.
pub(super) fn tangent_range(blocks: &[usize], p: usize, port: &Port, harmonics: usize) -> std::ops::Range<usize> {
    blocks[p]..blocks[p] + (2 * harmonics * port.axes).pow(2)
}
