//! Postprocessing of a periodic motion: amplitudes, first harmonics, means, energies, slip.
//!
//! A method supplies its signals ([`PathSignals`]) as closed forms, values at quadrature nodes, or
//! samples. This file computes all results from them, independently of the method.

use super::{Energy, JointMotion, PlaceMotion, Symmetry};
use crate::law::Contact;
use crate::model::{Axis, System};
use crate::structure::ModalDamping;
use num_complex::Complex64;
use stickslip_numerics::radau::quintic;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// The signals of a motion over one return: half a period or a full period.
pub(crate) trait PathSignals {
    /// A function of time over the return.
    type Signal: Clone;
    /// Why a result cannot be computed.
    type Error;
    /// Returns the displacement of a degree of freedom, m.
    fn displacement(&self, row: usize) -> Self::Signal;
    /// Returns the velocity of a degree of freedom, m/s.
    fn velocity(&self, row: usize) -> Self::Signal;
    /// Returns the relative velocity along an axis, m/s. Axes are numbered over all joints.
    fn relative_velocity(&self, axis: usize) -> Self::Signal;
    /// Returns the force along an axis, N.
    fn force(&self, axis: usize) -> Self::Signal;
    /// Returns `Re Σ a e^{jωt}` of pairs (ω in rad/s, a).
    fn harmonics(&self, parts: &[(f64, Complex64)]) -> Self::Signal;
    /// Adds a multiple of a signal to another one.
    fn add(&self, to: &mut Self::Signal, signal: &Self::Signal, factor: f64);
    /// Returns the integral of a product over the return.
    fn product(&self, a: &Self::Signal, b: &Self::Signal) -> f64;
    /// Returns `∫ signal e^{-jωt} dt` over the return.
    fn fourier(&self, signal: &Self::Signal, omega: f64) -> Complex64;
    /// Returns the smallest and the largest displacement of a place, m.
    fn range(&self, place: &Axis) -> Result<(f64, f64), Self::Error>;
    /// Returns the smallest and the largest relative displacement along an axis, m.
    fn relative_range(&self, axis: usize) -> Result<(f64, f64), Self::Error>;
    /// Returns the contact states of a joint.
    fn faces(&self, joint: usize) -> ContactSummary;
    /// Combines signals of the degrees of freedom into the signal of a place.
    fn at_place(&self, place: &Axis, of: impl Fn(usize) -> Self::Signal) -> Self::Signal {
        match *place.rows() {
            [(row, 1.0)] => of(row),
            ref rows => {
                let mut sum = self.harmonics(&[]);
                rows.iter().for_each(|(row, weight)| self.add(&mut sum, &of(*row), *weight));
                sum
            }
        }
    }
    /// Returns the displacement of a place, m.
    fn place_displacement(&self, place: &Axis) -> Self::Signal {
        self.at_place(place, |row| self.displacement(row))
    }
    /// Returns the energy that the damping of the structure dissipates in the return, J, from the
    /// velocities of all degrees of freedom.
    fn viscous_loss(&self, system: &System, velocity: &[Self::Signal]) -> f64 {
        self.viscous_loss_of_entries(system, velocity)
    }
    /// Returns [`PathSignals::viscous_loss`] from the entries of the matrices.
    fn viscous_loss_of_entries(&self, system: &System, velocity: &[Self::Signal]) -> f64 {
        let structure = system.structure();
        let entries = structure.damping_entries();
        let mut loss: f64 =
            entries.map(|(row, column, damping)| damping * self.product(&velocity[row], &velocity[column])).sum();
        for shape in structure.damped_modes().into_iter().flat_map(ModalDamping::iter) {
            let mut along = self.harmonics(&[]);
            shape.iter().zip(velocity).for_each(|(share, velocity)| self.add(&mut along, velocity, *share));
            loss += self.product(&along, &along);
        }
        loss
    }
    /// Returns the energy that the `force` along an axis dissipates in the return, J.
    fn dissipation(&self, axis: usize, force: &Self::Signal) -> f64 {
        self.product(force, &self.relative_velocity(axis))
    }
}

/// Contact states of a joint over a return.
pub(crate) struct ContactSummary {
    /// Fractions of the return in each state.
    pub shares: ContactFractions,
    /// Number of changes of the state or of the slip direction.
    pub switches: usize,
    /// Number of samples or segments of the path in which the joint slips.
    pub slips: usize,
    /// False if the joint opens or is a stop; such a joint does not stick.
    pub stays_closed: bool,
}

impl ContactSummary {
    /// Summarizes the contact states at the samples of a return.
    pub fn of_samples(
        shares: ContactFractions,
        switches: usize,
        contacts: impl Iterator<Item = Contact>,
    ) -> ContactSummary {
        let mut summary = ContactSummary { shares, switches, slips: 0, stays_closed: true };
        for contact in contacts {
            summary.slips += usize::from(contact.slips());
            summary.stays_closed &= !matches!(contact, Contact::Touch | Contact::Open);
        }
        summary
    }

    /// Tells whether the joint sticks during the whole return. `loss` computes the dissipated
    /// energy divided by its upper bound, the product of the norms of force and velocity.
    ///
    /// At the edge of a continuum of orbits the force just reaches its limit, and the error of
    /// the motion makes some samples slip. In one sample the excess cannot be resolved. More
    /// samples are judged by their loss: if the force of a Jenkins element exceeds its limit by
    /// the fraction ε, the loss is 4ε/π.
    fn sticks(&self, loss: impl FnOnce() -> f64) -> bool {
        self.stays_closed && (self.slips <= 1 || (self.shares.slip <= 0.01 && loss() <= 1e-6))
    }
}

/// Fractions of a return in which the faces stick, slip, and are separated. If a stop touches,
/// the sum is less than one.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct ContactFractions {
    pub stick: f64,
    pub slip: f64,
    pub open: f64,
}

impl ContactFractions {
    /// Computes the fractions from contact states and their durations. All sums run in the same
    /// order, so a joint that always slips has a fraction of exactly one.
    pub fn of(contacts: impl Iterator<Item = (Contact, f64)>) -> ContactFractions {
        let (mut times, mut all) = (ContactFractions::default(), 0.0);
        for (contact, weight) in contacts {
            all += weight;
            times.stick += if contact == Contact::Stick { weight } else { 0.0 };
            times.slip += if contact.slips() { weight } else { 0.0 };
            times.open += if contact == Contact::Open { weight } else { 0.0 };
        }
        ContactFractions { stick: times.stick / all, slip: times.slip / all, open: times.open / all }
    }
}

/// Results of a periodic motion.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OrbitResults {
    pub places: Vec<PlaceMotion>,
    pub joints: Vec<JointMotion>,
    pub energy: Energy,
    /// Force amplitudes times velocity amplitudes times period, J: an upper bound of the
    /// exchanged work.
    pub work_bound: f64,
    /// Numbers of the joints that stick for the whole period.
    pub stuck: Vec<usize>,
}

impl OrbitResults {
    /// Returns the names of the joints that stick for the whole period.
    pub fn stuck_names(&self) -> Vec<String> {
        self.stuck.iter().map(|&joint| self.joints[joint].name.clone()).collect()
    }
}

/// Computes the results of a motion under an excitation of `omega` (rad/s) that repeats after
/// `period` (s).
pub(crate) fn results<S: PathSignals>(
    system: &System,
    signals: &S,
    omega: f64,
    (symmetry, period): (Symmetry, f64),
) -> Result<OrbitResults, S::Error> {
    let half = symmetry == Symmetry::HalfPeriod;
    let times = if half { 2.0 } else { 1.0 };
    let mirrored = |(low, high): (f64, f64)| {
        let most = high.max(-low);
        if half { (-most, most) } else { (low, high) }
    };
    let mut places = Vec::with_capacity(system.places().len());
    for (name, place) in system.places().iter().zip(system.place_axes()) {
        let (minimum, maximum) = mirrored(signals.range(place)?);
        let x = signals.place_displacement(place);
        places.push(PlaceMotion {
            name: name.clone(),
            maximum,
            minimum,
            mean: if half { 0.0 } else { signals.fourier(&x, 0.0).re / period },
            first_harmonic: signals.fourier(&x, omega) * (2.0 * times / period),
            rotation_radius: place.is_rotation().then(|| place.length_scale()),
        });
    }
    let forces: Vec<S::Signal> = system.axes().enumerate().map(|(axis, _)| signals.force(axis)).collect();
    let (mut joints, mut stuck, mut first) = (Vec::with_capacity(system.joints().len()), Vec::new(), 0);
    for (j, joint) in system.joints().iter().enumerate() {
        let axes = first..first + joint.axes().len();
        first = axes.end;
        let dissipation: f64 = axes.clone().map(|axis| signals.dissipation(axis, &forces[axis])).sum();
        let loss = || {
            let bound = axes.clone().map(|axis| {
                let velocity = signals.relative_velocity(axis);
                (signals.product(&forces[axis], &forces[axis]) * signals.product(&velocity, &velocity)).sqrt()
            });
            dissipation.abs() / bound.sum::<f64>()
        };
        let displacement =
            axes.clone().map(|axis| signals.relative_range(axis).map(mirrored)).collect::<Result<_, _>>()?;
        let contact = signals.faces(j);
        // A law without a slip limit never slips, and a smooth law always creeps. Neither counts
        // as stuck, because their orbits are unique. The limit of a contact follows its pressure.
        let slips = joint.law().force_scale().is_finite() || joint.law().normal().is_some();
        if slips && joint.law().rate().is_none() && contact.sticks(loss) {
            stuck.push(j);
        }
        joints.push(JointMotion {
            name: joint.name().to_owned(),
            dissipation: times * dissipation,
            slip_fraction: contact.shares.slip,
            stick_fraction: contact.shares.stick,
            open_fraction: contact.shares.open,
            displacement,
            switches: contact.switches * if half { 2 } else { 1 },
        });
    }
    let (energy, possible) = energy(system, signals, omega, &forces);
    let friction = joints.iter().map(|joint| joint.dissipation).sum();
    let energy = Energy { work_in: times * energy.0, viscous: times * energy.1, friction };
    Ok(OrbitResults { places, joints, energy, work_bound: times * possible, stuck })
}

/// Returns the work of the loads and of imposed motion, the loss in dampers, and the bound of
/// the exchanged work, over the return.
fn energy<S: PathSignals>(system: &System, signals: &S, omega: f64, forces: &[S::Signal]) -> ((f64, f64), f64) {
    let n = system.dofs();
    let velocity: Vec<S::Signal> = (0..n).map(|row| signals.velocity(row)).collect();
    let excitation = system.excitation(omega);
    let (mut work, mut viscous, mut possible) = (0.0, 0.0, 0.0);
    for row in 0..n {
        let parts: Vec<(f64, Complex64)> = excitation
            .iter()
            // a constant load does no work over a return
            .filter(|(h, load)| *h > 0 && load[row] != ZERO)
            .map(|(h, load)| (f64::from(*h) * omega, load[row]))
            .collect();
        if !parts.is_empty() {
            let load = signals.harmonics(&parts);
            work += signals.product(&load, &velocity[row]);
            // upper bound of ∫|f v|, by the Cauchy-Schwarz inequality
            possible += (signals.product(&load, &load) * signals.product(&velocity[row], &velocity[row])).sqrt();
        }
    }
    viscous += signals.viscous_loss(system, &velocity);
    let moved: Vec<[S::Signal; 3]> = system
        .moved_places()
        .iter()
        .map(|place| {
            let derivative = |order: u32| {
                let parts: Vec<(f64, Complex64)> = place
                    .motion
                    .iter()
                    .map(|&(h, g)| {
                        let rate = f64::from(h) * omega;
                        (rate, g * Complex64::new(0.0, rate).powu(order))
                    })
                    .collect();
                signals.harmonics(&parts)
            };
            [derivative(0), derivative(1), derivative(2)]
        })
        .collect();
    for (m, place) in system.moved_places().iter().enumerate() {
        let [motion, speed, _] = &moved[m];
        // The inertia that the place shares with degrees of freedom is omitted. Its work here is
        // ∫ m a ġ = -∫ m v g̈, and it is already part of their loads.
        let mut reaction = signals.harmonics(&[]);
        for (other, (k, c)) in place.stiffness.1.iter().zip(&place.damping.1).enumerate() {
            signals.add(&mut reaction, &moved[other][2], place.mass.1[other]);
            signals.add(&mut reaction, &moved[other][0], *k);
            signals.add(&mut reaction, &moved[other][1], *c);
            viscous += c * signals.product(speed, &moved[other][1]);
        }
        for row in 0..n {
            let (k, c) = (place.stiffness.0[row], place.damping.0[row]);
            if k == 0.0 && c == 0.0 {
                continue;
            }
            signals.add(&mut reaction, &signals.displacement(row), k);
            signals.add(&mut reaction, &velocity[row], c);
            // The load on the masses includes the force of the moved place, which is not
            // external work.
            work += k * signals.product(motion, &velocity[row]) + c * signals.product(speed, &velocity[row]);
            viscous += 2.0 * c * signals.product(speed, &velocity[row]);
        }
        work += signals.product(&reaction, speed);
        possible += (signals.product(&reaction, &reaction) * signals.product(speed, speed)).sqrt();
    }
    // work of imposed motion on the joints
    for ((_, axis), force) in system.axes().zip(forces) {
        let parts: Vec<(f64, Complex64)> = axis
            .imposed()
            .iter()
            .map(|&(h, g)| (f64::from(h) * omega, g * Complex64::new(0.0, f64::from(h) * omega)))
            .collect();
        if !parts.is_empty() {
            let speed = signals.harmonics(&parts);
            work += signals.product(force, &speed);
            possible += (signals.product(force, force) * signals.product(&speed, &speed)).sqrt();
        }
    }
    ((work, viscous), possible)
}

/// Returns the smallest and the largest value of a signal over intervals. Each interval has its
/// length, and value, slope and curvature at both ends; the signal is a quintic between them.
pub(crate) fn extremes(spans: impl Iterator<Item = (f64, [f64; 3], [f64; 3])>) -> (f64, f64) {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (length, from, to) in spans {
        let mut take = |value: f64| (low, high) = (low.min(value), high.max(value));
        take(from[0]);
        take(to[0]);
        if from[1] * to[1] < 0.0 {
            // one turning point inside: bisection on the velocity
            let (mut left, mut right) = (0.0, 1.0);
            // Bisection of a turning point ends at this fraction of the interval.
            while right - left > 1e-12 {
                let middle = 0.5 * (left + right);
                if quintic(middle, length, from, to).1 * from[1] > 0.0 { left = middle } else { right = middle }
            }
            take(quintic(0.5 * (left + right), length, from, to).0);
        }
    }
    (low, high)
}

/// Work below this fraction of its bound is no reference for the energy gap, because the motion
/// is nearly conservative.
pub(crate) const CONSERVATIVE_WORK: f64 = 1e-6;

impl OrbitResults {
    /// Returns `|work in - viscous - friction|` relative to the work. `least` is the smallest
    /// reference energy, J.
    pub fn energy_gap(&self, least: f64) -> f64 {
        let balance = (self.energy.work_in - self.energy.viscous - self.energy.friction).abs();
        let reference = self
            .energy
            .work_in
            .abs()
            .max(CONSERVATIVE_WORK * (self.work_bound + self.energy.friction.abs()))
            .max(least);
        if reference > 0.0 { balance / reference } else { balance }
    }
}
