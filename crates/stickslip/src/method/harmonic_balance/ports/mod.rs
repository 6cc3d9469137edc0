//! Ports: where a law meets the equations.
//!
//! A joint's law becomes one or several ports, by the view that is chosen for it. A port has an axis for each of the law's directions, and an
//! unknown per axis and harmonic:
//! - a *motion port* (sliders and stops, rate, step) has the motion `u` and makes the force `f(u)` of it;
//! - a *force port* (prox) has the force `λ`, and makes `P J(λ + ε u')` of it, which it must be.
//!
//! Both give the derivative by the unknowns exactly, over all axes and harmonics at once. The equations know nothing else of a law.
//! Joints that move alike may have one force port together, see [`gathered`].

mod alternation;
mod barrier;
mod events;
mod gathered;
mod march;
mod masing;
mod memory;
mod prox;
mod rate;
mod series;
mod sliders;
mod step;
#[cfg(test)]
mod tests;

pub(super) use alternation::{Alternation, Beginning};
pub(super) use barrier::Barrier;
use gathered::Gathered;
pub(super) use memory::{REPEATS, at_once};
use prox::{Rigid, Times};
use sliders::Part;

use crate::law::{MAX_DIRECTIONS, MasingView, ProxView, SharedLaw};
use crate::method::MethodError;
use crate::model::{Axis, CyclicSymmetry, System, SystemJoint};
use nalgebra::DMatrix;
use num_complex::Complex64;

/// Directions of joints from which what the structure couples among them is multiplied with and not eliminated: few with many harmonics have steps that are
/// hard to find by products, and a small matrix.
pub(super) const MANY_DIRECTIONS: usize = 24;

/// What acts at a port.
#[derive(Debug, Clone)]
enum Kernel {
    /// Sliders behind springs, and stops, side by side along one axis: the force is exact for the series.
    Sliders(Vec<Part>),
    /// Rigid sliders side by side along one axis, as one.
    Rigid(Rigid),
    /// A law by its resolvent.
    Prox(Times),
    /// A law by its curve of first loading: the force is exact for the series.
    Masing(SharedLaw),
    /// A law by its return map.
    Step(SharedLaw),
    /// A law by its rates.
    Rate(SharedLaw),
}

/// A joint that acts at a port, along each of the port's axes by its own axis of the same number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    pub joint: usize,
    /// Its motion per that of the port.
    pub factor: f64,
    /// Its force per that of the port.
    pub share: f64,
}

/// Displacements and states of a joint in static equilibrium under the constant loads, where every vibration begins.
#[derive(Debug, Clone, Default)]
pub(super) struct StaticState {
    /// Along the axes of the port, m.
    pub displacement: [f64; MAX_DIRECTIONS],
    /// Internal states of its law, or the forces of its sliders (N); none where the law has none.
    pub states: Vec<f64>,
}

/// A relative motion along one to three axes with what acts along it: that of a joint, of several that move alike, or of their inner sliders behind
/// springs.
#[derive(Debug, Clone)]
pub(super) struct Port {
    /// Its joints; it has the axes of the first.
    pub members: Vec<Member>,
    /// Number of its first axis among those of all ports.
    pub first: usize,
    /// How many it has.
    pub axes: usize,
    /// Compliance of the spring between the joint and this port, m/N; zero if it is the joint's own motion.
    pub series: f64,
    /// Size of its forces, N; infinite if nothing bounds them. Finite for a force port.
    pub scale: f64,
    /// The penalty above which its resolvent is single-valued, N s/m.
    pub least_penalty: f64,
    /// Where its joint is before it vibrates.
    pub static_state: StaticState,
    kernel: Kernel,
}

impl Port {
    /// Its unknown is the force.
    pub fn is_force(&self) -> bool {
        matches!(self.kernel, Kernel::Rigid(_) | Kernel::Prox(_))
    }

    /// Unit of its unknowns: the motion's length, m, or the law's scale, N.
    pub fn unit(&self, length: f64) -> f64 {
        if self.is_force() { self.scale } else { length }
    }

    /// Whether its law is followed through the period, step by step, so that derivatives cost many times what forces cost.
    pub fn marches(&self) -> bool {
        self.steps() || self.stateful().is_some()
    }

    /// Whether it is followed by its return map.
    pub fn steps(&self) -> bool {
        matches!(self.kernel, Kernel::Step(_))
    }

    /// Whether it holds rigidly, so that accelerations jump.
    pub fn is_rigid(&self) -> bool {
        match &self.kernel {
            Kernel::Rigid(_) => true,
            Kernel::Prox(times) => times.force_at_velocity(0.0).is_none(),
            _ => false,
        }
    }

    /// The limit of rigid friction along one axis, N.
    pub fn limit(&self) -> Option<f64> {
        match &self.kernel {
            Kernel::Rigid(rigid) => Some(rigid.limit),
            _ => None,
        }
    }

    /// Whether the kernel itself tells slip from stick, sample by sample ([`Alternation::slips`]).
    pub fn tells_slip(&self) -> bool {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().all(|part| matches!(part, Part::Slider { .. })),
            Kernel::Rigid(_) => true,
            _ => false,
        }
    }

    /// Numbers of its axes among those of all ports.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.axes
    }

    /// What a joint has of it, if it is one of its own.
    pub fn member(&self, joint: usize) -> Option<&Member> {
        self.members.iter().find(|member| member.joint == joint)
    }

    /// The same kind of port at the same place, whatever the numbers.
    pub fn is_like(&self, other: &Port) -> bool {
        let kind = |port: &Port| (port.first, port.axes, std::mem::discriminant(&port.kernel));
        let alike = |(own, its): (&Member, &Member)| own.joint == its.joint;
        kind(self) == kind(other)
            && self.members.len() == other.members.len()
            && self.members.iter().zip(&other.members).all(alike)
    }

    /// Complex stiffness of small motions about rest at a frequency (rad/s), axes × axes, N/m, of
    /// a motion port.
    pub fn at_rest(&self, omega: f64) -> DMatrix<Complex64> {
        match &self.kernel {
            Kernel::Step(law) | Kernel::Rate(law) => crate::method::guess::at_rest(&**law, omega),
            _ => DMatrix::from_diagonal_element(self.axes, self.axes, Complex64::new(self.stiffness(), 0.0)),
        }
    }

    /// Stiffness at rest along its axes, N/m, roughly; zero if it is rigid.
    pub fn stiffness(&self) -> f64 {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().map(Part::stiffness).sum(),
            Kernel::Rigid(_) | Kernel::Prox(_) => {
                if self.series > 0.0 {
                    1.0 / self.series
                } else {
                    0.0
                }
            }
            Kernel::Masing(law) | Kernel::Step(law) | Kernel::Rate(law) => {
                // a rate law at a frequency at which its states follow
                let at_rest = crate::method::guess::at_rest(&**law, 1.0);
                (0..self.axes).map(|a| at_rest[(a, a)].norm()).fold(0.0, f64::max)
            }
        }
    }

    /// Stiffness along one of its axes while its faces are closed and stick, N/m; zero where it is rigid, so that its force is an unknown.
    pub fn closed(&self, axis: usize) -> f64 {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().map(Part::closed).sum(),
            Kernel::Rigid(_) | Kernel::Prox(_) => 0.0,
            Kernel::Masing(law) | Kernel::Step(law) | Kernel::Rate(law) => match law.closed_stiffness() {
                Some(closed) => closed[axis],
                None => crate::method::guess::at_rest(&**law, 1.0)[(axis, axis)].re,
            },
        }
    }

    /// How far its springs reach before they slip, m; zero if there are none.
    pub fn reach(&self) -> f64 {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().map(Part::reach).fold(0.0, f64::max),
            Kernel::Masing(law) => law.masing().map_or(0.0, MasingView::slip_displacement),
            _ => 0.0,
        }
    }

    /// How far the motion goes while the states of a law cross their range, m; none of a law that has none, or whose force nothing bounds.
    pub fn layer(&self) -> Option<f64> {
        self.stateful().map(|_| self.scale / self.stiffness()).filter(|layer| layer.is_finite())
    }

    /// Internal states of a motion port.
    fn states(&self) -> usize {
        match &self.kernel {
            Kernel::Sliders(parts) => parts.iter().filter(|part| matches!(part, Part::Slider { .. })).count(),
            Kernel::Step(law) | Kernel::Masing(law) => law.step().map_or(0, |step| step.states()),
            Kernel::Rate(law) => law.rate().map_or(0, |rate| rate.states()),
            Kernel::Rigid(_) | Kernel::Prox(_) => 0,
        }
    }

    /// The law, if its states are followed.
    fn stateful(&self) -> Option<&SharedLaw> {
        match &self.kernel {
            Kernel::Rate(law) if law.rate().is_some_and(|rate| rate.states() > 0) => Some(law),
            _ => None,
        }
    }

    /// The law, if the velocity alone decides its bounded force, which is sampled.
    fn steep(&self) -> Option<&SharedLaw> {
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

/// The ports of a system; a joint that carries no force has none.
#[derive(Debug, Clone, Default)]
pub(super) struct Ports {
    list: Vec<Port>,
    /// Joint and number within it of every axis: of several joints the first.
    axes: Vec<(usize, usize)>,
    wave: Option<CyclicSymmetry>,
    /// Displacements along all axes in static equilibrium, m; empty where none is known.
    equilibrium: Vec<f64>,
}

impl std::ops::Deref for Ports {
    type Target = [Port];
    fn deref(&self) -> &[Port] {
        &self.list
    }
}

impl Ports {
    /// # Errors
    /// A law whose views harmonic balance cannot take.
    pub fn new(system: &System) -> Result<Self, MethodError> {
        Ports::of(system.joints())
    }

    fn of(joints: &[SystemJoint]) -> Result<Self, MethodError> {
        let mut gathered = Gathered::default();
        for (j, joint) in joints.iter().enumerate() {
            gathered.push(j, joint)?;
        }
        Ok(gathered.finish())
    }

    /// Those of a ring's first sector in a travelling wave, and those of the whole ring, sector by sector the same; of any other system all of them.
    ///
    /// # Errors
    /// As [`Ports::new`].
    pub fn of_sector(system: &System) -> Result<(Self, Option<Self>), MethodError> {
        let Some(cyclic) = system.cyclic() else { return Ok((Ports::new(system)?, None)) };
        let joints = system.joints().len() / cyclic.sectors;
        let first = Ports { wave: Some(cyclic), ..Ports::of(&system.joints()[..joints])? };
        let mut all = Ports::default();
        for sector in 0..cyclic.sectors {
            let (before, axes) = (sector * joints, all.axes.len());
            all.axes.extend(first.axes.iter().map(|(joint, a)| (before + joint, *a)));
            all.list.extend(first.iter().map(|port| {
                let members = port.members.iter().map(|member| Member { joint: before + member.joint, ..*member });
                Port { members: members.collect(), first: axes + port.first, ..port.clone() }
            }));
        }
        Ok((first, Some(all)))
    }

    /// Displacements along all axes in static equilibrium, m; empty where none is known.
    pub fn equilibrium(&self) -> &[f64] {
        &self.equilibrium
    }

    /// Begins every vibration at these states, one for each port; of a ring they are those of its first sector.
    pub fn begin_at(&mut self, states: &[StaticState]) {
        let of_ports = self.list.iter().zip(states.iter().cycle());
        self.equilibrium = of_ports.flat_map(|(port, state)| state.displacement[..port.axes].to_vec()).collect();
        for (port, state) in self.list.iter_mut().zip(states.iter().cycle()).filter(|(port, _)| !port.is_force()) {
            port.static_state.displacement = state.displacement;
            if state.states.len() == port.states() {
                port.static_state.states.clone_from(&state.states);
            }
        }
    }

    /// Of all ports.
    pub fn static_states(&self) -> Vec<StaticState> {
        self.list.iter().map(|port| port.static_state.clone()).collect()
    }

    /// Begins every vibration at these displacements, with states that are so many times these.
    pub fn scale_static_forces(&mut self, states: &[StaticState], factor: f64) {
        for (port, state) in self.list.iter_mut().zip(states) {
            let own = &mut port.static_state.states;
            own.iter_mut().zip(&state.states).for_each(|(z, known)| *z = factor * known);
        }
    }

    /// The wave in which the other sectors follow, if these are the ports of the first one alone.
    pub fn wave(&self) -> Option<CyclicSymmetry> {
        self.wave
    }

    /// Axes of all ports.
    pub fn count(&self) -> usize {
        self.axes.len()
    }

    /// An axis by its number.
    pub fn axis<'a>(&self, system: &'a System, number: usize) -> &'a Axis {
        let (joint, axis) = self.axes[number];
        &system.joints()[joint].axes()[axis]
    }

    /// The joint of an axis, of several the first, and which of its axes it is.
    pub fn place(&self, number: usize) -> (usize, usize) {
        self.axes[number]
    }

    /// Whether some unknown is a force.
    pub fn has_forces(&self) -> bool {
        self.list.iter().any(Port::is_force)
    }

    /// Whether the velocity alone decides a bounded force that is sampled: friction that is steep, falls with velocity, or turns in a plane.
    pub fn has_steep(&self) -> bool {
        self.list.iter().any(|port| port.steep().is_some())
    }

    /// Whether such a force, or that of a law whose states are followed, may fall with velocity.
    pub fn has_falling(&self) -> bool {
        let laws = self.list.iter().filter_map(|port| port.steep().or_else(|| port.stateful()));
        laws.into_iter().any(|law| !law.is_incrementally_passive())
    }
}

/// Where the structure cannot move along a contact, because its motion is imposed, rigid friction changes its sign over this
/// share of the velocity.
const IMPOSED: f64 = 1e-9;

impl Alternation {
    /// Harmonics of the force of a motion port that moves with the harmonics `c`, [axis][harmonic], into `force`; the derivative with respect
    /// to (Re, Im) of the harmonics into `tangent` (row-major, 2 × axes × harmonics squared). The law is taken at `1/share` of the motion
    /// and gives `share` times that force: with a large share every law is what it is at rest, stuck.
    pub fn respond(
        &mut self,
        port: &Port,
        (omega, share): (f64, f64),
        c: &[Complex64],
        force: &mut [Complex64],
        mut tangent: Option<&mut [f64]>,
    ) {
        let mut motion = std::mem::take(&mut self.argument);
        motion.clear();
        motion.extend(c.iter().map(|c| c / share));
        force.fill(ZERO);
        if let Some(tangent) = tangent.as_deref_mut() {
            tangent.fill(0.0);
            if let Some(by_frequency) = &mut self.by_frequency {
                by_frequency.clear();
                by_frequency.resize(c.len(), ZERO);
            }
        }
        match &port.kernel {
            Kernel::Sliders(parts) => self.slide(parts, &port.static_state, &motion, force, tangent),
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
        force.iter_mut().for_each(|f| *f *= share);
        self.by_frequency.iter_mut().flatten().for_each(|f| *f *= share);
        self.argument = motion;
    }

    /// The image of the forces λ of a force port along a motion c: `P J(λ + ε c')`, or the law itself where the motion is imposed, which λ
    /// does not change (`penalty` infinite). The derivative of the image by `λ + ε c'` into `tangent`; `share` as in [`Alternation::respond`].
    pub fn image(
        &mut self,
        port: &Port,
        (omega, penalty, share): (f64, f64, f64),
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
        if penalty.is_infinite() {
            let speed: f64 = c.iter().enumerate().map(|(i, c)| (c * turn(i, &self.harmonics)).norm()).sum();
            let width = (IMPOSED * speed).max(f64::MIN_POSITIVE);
            signal.extend(c.iter().enumerate().map(|(i, c)| c * turn(i, &self.harmonics) / share));
            self.velocity(prox, port, width / share, &mut signal, image);
        } else {
            let moved = c.iter().enumerate().map(|(i, c)| c * turn(i, &self.harmonics) * penalty);
            signal.extend(moved.zip(force).map(|(moved, force)| (force + moved) / share));
            self.resolve(prox, port, penalty, &signal, image, tangent);
        }
        image.iter_mut().for_each(|f| *f *= share);
        self.argument = signal;
    }

    /// Samples of the forces of a port in a motion that has been found, see [`Alternation::force`].
    pub fn sample(&mut self, port: &Port, (omega, penalty): (f64, f64), (c, force): (&[Complex64], &[Complex64])) {
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
            self.image(port, (omega, penalty, 1.0), (c, force), &mut out, None);
        } else {
            self.respond(port, (omega, 1.0), c, &mut out, None);
        }
    }
}

const ZERO: Complex64 = Complex64::new(0.0, 0.0);
const _: () = assert!(MAX_DIRECTIONS == 3, "signals of a port are kept for three axes");

/// Where the tangent of every port begins, and the length of all: a port with d axes has a square of 2 d × harmonics.
pub(super) fn blocks(ports: &Ports, harmonics: usize) -> (Vec<usize>, usize) {
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

/// The tangent of port number `p`.
pub(super) fn block(blocks: &[usize], p: usize, port: &Port, harmonics: usize) -> std::ops::Range<usize> {
    blocks[p]..blocks[p] + (2 * harmonics * port.axes).pow(2)
}
