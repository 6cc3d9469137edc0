//! The numbers of a periodic motion: amplitudes, first harmonics, means, energies, slip; from any path whose signals can be integrated.
//!
//! A method says what its signals are ([`Signals`]): closed forms, values at the nodes of a quadrature, samples. What is asked of them is
//! written once, here, and is independent of how the motion was found.

use super::{Energy, JointMotion, PlaceMotion, Symmetry};
use crate::law::Contact;
use crate::model::{Axis, System};
use crate::structure::DampedModes;
use num_complex::Complex64;
use stickslip_numerics::radau::quintic;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// The signals of a motion over one return: half a period or a whole one.
pub(crate) trait Signals {
    /// A function of time over the return.
    type Signal: Clone;
    /// Why a number could not be had.
    type Error;
    /// Displacement of a degree of freedom, m.
    fn displacement(&self, row: usize) -> Self::Signal;
    /// Velocity of a degree of freedom, m/s.
    fn velocity(&self, row: usize) -> Self::Signal;
    /// Relative velocity along an axis, m/s; axes count over all joints.
    fn relative_velocity(&self, axis: usize) -> Self::Signal;
    /// Force along an axis, N.
    fn force(&self, axis: usize) -> Self::Signal;
    /// `Re Σ a e^{jωt}` of (ω in rad/s, a).
    fn harmonics(&self, parts: &[(f64, Complex64)]) -> Self::Signal;
    /// Adds a multiple.
    fn add(&self, to: &mut Self::Signal, signal: &Self::Signal, factor: f64);
    /// Integral of a product over the return.
    fn product(&self, a: &Self::Signal, b: &Self::Signal) -> f64;
    /// `∫ signal e^{-jωt} dt` over the return.
    fn fourier(&self, signal: &Self::Signal, omega: f64) -> Complex64;
    /// Least and largest displacement of a place, m.
    fn range(&self, place: &Axis) -> Result<(f64, f64), Self::Error>;
    /// Least and largest relative displacement along an axis, m.
    fn relative_range(&self, axis: usize) -> Result<(f64, f64), Self::Error>;
    /// What the faces of a joint do.
    fn faces(&self, joint: usize) -> Faces;
    /// Of signals of the degrees of freedom that of a place.
    fn along(&self, place: &Axis, of: impl Fn(usize) -> Self::Signal) -> Self::Signal {
        match *place.rows() {
            [(row, 1.0)] => of(row),
            ref rows => {
                let mut sum = self.harmonics(&[]);
                rows.iter().for_each(|(row, weight)| self.add(&mut sum, &of(*row), *weight));
                sum
            }
        }
    }
    /// Displacement of a place, m.
    fn seen(&self, place: &Axis) -> Self::Signal {
        self.along(place, |row| self.displacement(row))
    }
    /// What the `force` along an axis takes from the motion in the return, J.
    fn dissipation(&self, axis: usize, force: &Self::Signal) -> f64 {
        self.product(force, &self.relative_velocity(axis))
    }
}

/// What the faces of a joint do in a return.
pub(crate) struct Faces {
    /// In which shares of it.
    pub shares: Shares,
    /// How often that, or the direction of slip, changes.
    pub switches: usize,
    /// Whether it sticks all the time; one that is open all the time neither slips nor sticks.
    pub rests: bool,
}

/// Samples in which a joint that sticks may slip: it comes up to its limit, at the edge of a continuum of orbits, and how far beyond is less than samples tell.
const EDGE: usize = 1;

/// Whether a joint that does this at the samples of a return sticks all the time.
pub(crate) fn sticks(mut contact: impl Iterator<Item = Contact>) -> bool {
    let mut slips = 0;
    contact.all(|contact| {
        slips += usize::from(contact != Contact::Stick);
        slips <= EDGE && !matches!(contact, Contact::Touch | Contact::Open)
    })
}

/// Shares of a return in which the faces of a joint rest on each other, slide, and are apart. What is missing to one is a stop that touches.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Shares {
    pub stick: f64,
    pub slip: f64,
    pub open: f64,
}

impl Shares {
    /// Of contacts, each as long as its weight. All sums run in one order, so that a joint that always slips has a share of exactly one.
    pub fn of(contacts: impl Iterator<Item = (Contact, f64)>) -> Shares {
        let (mut times, mut all) = (Shares::default(), 0.0);
        for (contact, weight) in contacts {
            all += weight;
            times.stick += if contact == Contact::Stick { weight } else { 0.0 };
            times.slip += if contact.slips() { weight } else { 0.0 };
            times.open += if contact == Contact::Open { weight } else { 0.0 };
        }
        Shares { stick: times.stick / all, slip: times.slip / all, open: times.open / all }
    }
}

/// The numbers of a periodic motion.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Measured {
    pub places: Vec<PlaceMotion>,
    pub joints: Vec<JointMotion>,
    pub energy: Energy,
    /// Force amplitudes times velocity amplitudes times period, J: the work that could be exchanged.
    pub possible: f64,
    /// Names of joints that stick for the whole period.
    pub stuck: Vec<String>,
}

/// Measures a motion under a drive of `omega` (rad/s) that repeats after `period` (s).
pub(crate) fn measure<S: Signals>(
    system: &System,
    signals: &S,
    omega: f64,
    (symmetry, period): (Symmetry, f64),
) -> Result<Measured, S::Error> {
    let half = symmetry == Symmetry::HalfPeriod;
    let times = if half { 2.0 } else { 1.0 };
    let mirrored = |(low, high): (f64, f64)| {
        let most = high.max(-low);
        if half { (-most, most) } else { (low, high) }
    };
    let mut places = Vec::with_capacity(system.places().len());
    for (name, place) in system.places().iter().zip(system.seen()) {
        let (minimum, maximum) = mirrored(signals.range(place)?);
        let x = signals.seen(place);
        places.push(PlaceMotion {
            name: name.clone(),
            maximum,
            minimum,
            mean: if half { 0.0 } else { signals.fourier(&x, 0.0).re / period },
            first_harmonic: signals.fourier(&x, omega) * (2.0 * times / period),
            radius: place.is_rotation().then(|| place.length()),
        });
    }
    let forces: Vec<S::Signal> = system.axes().enumerate().map(|(axis, _)| signals.force(axis)).collect();
    let (mut joints, mut stuck, mut first) = (Vec::with_capacity(system.joints().len()), Vec::new(), 0);
    for (j, joint) in system.joints().iter().enumerate() {
        let axes = first..first + joint.axes().len();
        first = axes.end;
        let dissipation: f64 = axes.clone().map(|axis| signals.dissipation(axis, &forces[axis])).sum();
        let displacement = axes.map(|axis| signals.relative_range(axis).map(mirrored)).collect::<Result<_, _>>()?;
        let Faces { shares, switches, rests } = signals.faces(j);
        // a law without a limit never slips, and a smooth one gives way however little: neither is stuck, and their orbits are none of many
        if rests && joint.law().scale().is_finite() && joint.law().rate().is_none() {
            stuck.push(joint.name().to_owned());
        }
        joints.push(JointMotion {
            name: joint.name().to_owned(),
            dissipation: times * dissipation,
            slip_fraction: shares.slip,
            stick_fraction: shares.stick,
            open_fraction: shares.open,
            displacement,
            switches: switches * if half { 2 } else { 1 },
        });
    }
    let (energy, possible) = energy(system, signals, omega, &forces);
    let friction = joints.iter().map(|joint| joint.dissipation).sum();
    let energy = Energy { work_in: times * energy.0, viscous: times * energy.1, friction };
    Ok(Measured { places, joints, energy, possible: times * possible, stuck })
}

/// Work of the loads and of imposed motion, loss in dampers, and the work that could be exchanged, over the return.
fn energy<S: Signals>(system: &System, signals: &S, omega: f64, forces: &[S::Signal]) -> ((f64, f64), f64) {
    let n = system.dofs();
    let velocity: Vec<S::Signal> = (0..n).map(|row| signals.velocity(row)).collect();
    let excitation = system.excitation(omega);
    let (mut work, mut viscous, mut possible) = (0.0, 0.0, 0.0);
    for row in 0..n {
        let parts: Vec<(f64, Complex64)> = excitation
            .iter()
            .filter(|(h, load)| *h > 0 && load[row] != ZERO) // a constant one does no work over a return
            .map(|(h, load)| (f64::from(*h) * omega, load[row]))
            .collect();
        if !parts.is_empty() {
            let load = signals.harmonics(&parts);
            work += signals.product(&load, &velocity[row]);
            // ∫|f v| is at most this, by Cauchy and Schwarz
            possible += (signals.product(&load, &load) * signals.product(&velocity[row], &velocity[row])).sqrt();
        }
    }
    for (row, column, [_, damping, _]) in system.structure().entries() {
        if damping != 0.0 {
            viscous += damping * signals.product(&velocity[row], &velocity[column]);
        }
    }
    for shape in system.structure().damped_modes().into_iter().flat_map(DampedModes::iter) {
        let mut along = signals.harmonics(&[]);
        shape.iter().zip(&velocity).for_each(|(share, velocity)| signals.add(&mut along, velocity, *share));
        viscous += signals.product(&along, &along);
    }
    let moved: Vec<[S::Signal; 3]> = system
        .moved()
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
    for (m, place) in system.moved().iter().enumerate() {
        let [motion, speed, _] = &moved[m];
        // the inertia that it shares with degrees of freedom is left out: what it takes here, ∫ m a ġ = -∫ m v g̈, it adds to their loads
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
            // the load on the masses contains what the moved place does to them: that is no work from outside
            work += k * signals.product(motion, &velocity[row]) + c * signals.product(speed, &velocity[row]);
            viscous += 2.0 * c * signals.product(speed, &velocity[row]);
        }
        work += signals.product(&reaction, speed);
        possible += (signals.product(&reaction, &reaction) * signals.product(speed, speed)).sqrt();
    }
    // what joints take from imposed motion
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

/// Turning points are refined until the step in time is below this fraction of the interval.
const REFINED: f64 = 1e-12;

/// Least and largest value of a signal over intervals: their length, with value, slope and curvature at both ends, between which it is a quintic.
pub(crate) fn extremes(spans: impl Iterator<Item = (f64, [f64; 3], [f64; 3])>) -> (f64, f64) {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (length, from, to) in spans {
        let mut take = |value: f64| (low, high) = (low.min(value), high.max(value));
        take(from[0]);
        take(to[0]);
        if from[1] * to[1] < 0.0 {
            // one turning point inside: bisection on the velocity
            let (mut left, mut right) = (0.0, 1.0);
            while right - left > REFINED {
                let middle = 0.5 * (left + right);
                if quintic(middle, length, from, to).1 * from[1] > 0.0 { left = middle } else { right = middle }
            }
            take(quintic(0.5 * (left + right), length, from, to).0);
        }
    }
    (low, high)
}

/// Work below this fraction of what the loads could do is no yardstick for the energy gap: the motion is conservative.
pub(crate) const NO_WORK: f64 = 1e-6;

impl Measured {
    /// `|work in - viscous - friction|` relative to the work, or to what is the least yardstick, J.
    pub fn energy_gap(&self, least: f64) -> f64 {
        let balance = (self.energy.work_in - self.energy.viscous - self.energy.friction).abs();
        let reference =
            self.energy.work_in.abs().max(NO_WORK * (self.possible + self.energy.friction.abs())).max(least);
        if reference > 0.0 { balance / reference } else { balance }
    }
}
