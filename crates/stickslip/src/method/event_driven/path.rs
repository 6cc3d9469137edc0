//! The orbit's numbers from its closed-form segments.

use super::NAME;
use super::flow::{Flow, Segment};
use super::mechanics::Part;
use crate::law::Contact;
use crate::method::Breakdown;
use crate::method::drive::Drive;
use crate::method::periodic::Closed;
use crate::model::System;
use crate::orbit::{
    Accuracy, Energy, Evidence, JointMotion, JointSample, Orbit, Path, PlaceMotion, Sample, Symmetry, history, laws,
};
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::signal::{Basis, Begin, FirstZero, FourierIntegrals, Products, Scratch, real_dot, size_of};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Work below this fraction of (force times velocity) of the period is no yardstick for the energy gap: the motion is conservative.
const NO_WORK: f64 = 1e-6;

/// Work below this fraction of the stored energy is none either: an orbit that is closed to `CLOSED` of its state may have gained or lost that
/// much, and the gap that this makes must stay below what is allowed.
const STORED: f64 = super::CLOSED / super::ENERGY_GAP;

/// The closed-form segments of one return, with all that is needed to evaluate them.
#[derive(Debug, Clone)]
pub(crate) struct ExactPath {
    system: Arc<System>,
    pieces: Vec<Piece>,
    /// Ideal parts of the joints.
    parts: Arc<[Part]>,
    symmetry: Symmetry,
    period: f64,
    rates: Vec<f64>,
    omega: f64,
}

#[derive(Debug, Clone)]
struct Piece {
    segment: Segment,
    velocity: Vec<Complex64>,
    /// The basis functions at its end.
    at_end: Vec<Complex64>,
}

/// Makes the orbit of the flow's last run, which began at the state `closed` with the energy `stored`, J.
pub(super) fn orbit(
    system: &Arc<System>,
    contracts: bool,
    flow: &Flow,
    (omega, periods): (f64, usize),
    symmetry: Symmetry,
    (closed, stored): (Closed, f64),
) -> Result<Orbit, Breakdown> {
    let path = ExactPath::new(system.clone(), flow, symmetry, periods as f64 * std::f64::consts::TAU / omega);
    let places = path.places(omega)?;
    let joints = path.joints()?;
    let energy = path.energy(flow, &joints);
    let stuck = joints
        .iter()
        .zip(system.joints())
        .enumerate()
        .filter(|(j, (motion, _))| motion.slip_fraction == 0.0 && path.of_joint(*j).any(|s| path.parts[s].is_slider()))
        .map(|(_, (_, joint))| joint.name().to_owned());
    let stuck: Vec<String> = stuck.collect();
    let rest = super::NEAR_REST * flow.energy_scale;
    let reference =
        energy.work_in.abs().max(NO_WORK * path.exchanged(&flow.drive)).max(NO_WORK * rest * rest).max(STORED * stored);
    let balance = energy.work_in - energy.viscous - energy.friction;
    Ok(Orbit {
        method: NAME,
        omega,
        periods,
        symmetry,
        start: closed.state,
        evidence: Evidence {
            residual: closed.residual,
            energy_gap: if reference > 0.0 { balance.abs() / reference } else { balance.abs() },
            switches: joints.iter().map(|joint| joint.switches).sum(),
            iterations: closed.iterations,
            truncation: closed.missing,
            return_defect: Some(closed.residual),
            accuracy: Accuracy::Converged,
            history: history(laws(system), &joints, &stuck, symmetry),
            stuck,
        },
        places,
        joints,
        energy,
        return_map: closed.derivative,
        contracts,
        path: Arc::new(path),
    })
}

impl ExactPath {
    /// The segments of the flow's last run; `period` is the time after which they repeat (or, by symmetry, repeat mirrored twice).
    pub fn new(system: Arc<System>, flow: &Flow, symmetry: Symmetry, period: f64) -> Self {
        let pieces = flow
            .segments()
            .iter()
            .map(|segment| {
                let basis = segment.basis();
                let mut at_end = vec![ZERO; basis.len()];
                basis.evaluate(segment.length, &mut at_end);
                Piece { velocity: derivative(basis, &segment.displacement), at_end, segment: segment.clone() }
            })
            .collect();
        let (rates, omega) = (flow.drive.rates.clone(), flow.drive.omega);
        ExactPath { system, pieces, parts: flow.mechanics.parts.clone(), symmetry, period, rates, omega }
    }

    /// How often the segments are run through in a period.
    fn times(&self) -> f64 {
        if self.symmetry == Symmetry::HalfPeriod { 2.0 } else { 1.0 }
    }

    fn places(&self, omega: f64) -> Result<Vec<PlaceMotion>, Breakdown> {
        let n = self.system.dofs();
        let mut memory = Memory::default();
        let at = |piece: &Piece, nu| FourierIntegrals::new(piece.basis(), &piece.at_end, nu, piece.segment.length);
        // of the drive frequency, what it has turned by the start of the piece, and of the mean where there is one
        let integrals: Vec<_> = self
            .pieces
            .iter()
            .map(|piece| {
                let turn = Complex64::new(0.0, -omega * piece.segment.start).exp();
                (at(piece, omega), turn, (self.symmetry == Symmetry::FullPeriod).then(|| at(piece, 0.0)))
            })
            .collect();
        (0..n)
            .map(|i| {
                let (mut maximum, mut minimum) = (f64::NEG_INFINITY, f64::INFINITY);
                let (mut integral, mut first_harmonic) = (0.0, ZERO);
                for (piece, (fourier, turn, mean)) in self.pieces.iter().zip(&integrals) {
                    let basis = piece.basis();
                    let nb = basis.len();
                    let (x, v) =
                        (&piece.segment.displacement[i * nb..(i + 1) * nb], &piece.velocity[i * nb..(i + 1) * nb]);
                    let (low, high) = piece.extremes(x, v, &mut memory)?;
                    (maximum, minimum) = (maximum.max(high), minimum.min(low));
                    if let Some(mean) = mean {
                        integral += mean.integral(basis, x).re;
                    }
                    first_harmonic += fourier.integral(basis, x) * turn;
                }
                if self.symmetry == Symmetry::HalfPeriod {
                    maximum = maximum.max(-minimum);
                    minimum = -maximum;
                }
                Ok(PlaceMotion {
                    name: self.system.places()[i].clone(),
                    maximum,
                    minimum,
                    mean: integral / self.period,
                    first_harmonic: first_harmonic * (2.0 * self.times() / self.period),
                })
            })
            .collect()
    }

    /// The parts of a joint.
    fn of_joint(&self, joint: usize) -> impl Iterator<Item = usize> {
        self.parts.iter().enumerate().filter(move |(_, part)| part.joint == joint).map(|(s, _)| s)
    }

    /// What the contact at the end of the return goes on as after it.
    fn next_of(&self, last: Contact) -> Contact {
        if self.symmetry == Symmetry::HalfPeriod { last.mirrored() } else { last }
    }

    fn joints(&self) -> Result<Vec<JointMotion>, Breakdown> {
        let n = self.system.dofs();
        let mut memory = Memory::default();
        let (mut u, mut velocity) = (Vec::new(), Vec::new());
        self.system
            .joints()
            .iter()
            .enumerate()
            .map(|(j, joint)| {
                let parts: Vec<usize> = self.of_joint(j).collect();
                let (mut dissipation, mut slipping, mut switches) = (0.0, 0.0, 0);
                let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
                let mut before: Option<&Piece> = None;
                for piece in &self.pieces {
                    let nb = piece.basis().len();
                    u.clear();
                    u.resize(nb, ZERO);
                    for i in 0..n {
                        let w = joint.axes()[0].dense(n)[i];
                        if w != 0.0 {
                            let x = &piece.segment.displacement[i * nb..(i + 1) * nb];
                            u.iter_mut().zip(x).for_each(|(u, x)| *u += x * w);
                        }
                    }
                    self.add_imposed(piece, joint.axes()[0].imposed(), &mut u);
                    velocity.resize(nb, ZERO);
                    piece.basis().differentiate(&u, &mut velocity);
                    let travel = real_dot(&u, &piece.at_end) - piece.basis().beginning(&u);
                    let (least, most) = piece.extremes(&u, &velocity, &mut memory)?;
                    (low, high) = (low.min(least), high.max(most));
                    for &s in &parts {
                        dissipation += piece.segment.contacts[s].sign() * self.parts[s].limit() * travel;
                    }
                    if parts.iter().any(|&s| piece.segment.contacts[s].slips()) {
                        slipping += piece.segment.length;
                    }
                    if let Some(before) = before {
                        switches +=
                            parts.iter().filter(|&&s| before.segment.contacts[s] != piece.segment.contacts[s]).count();
                    }
                    before = Some(piece);
                }
                if let (Some(first), Some(last)) = (self.pieces.first(), self.pieces.last()) {
                    switches += parts
                        .iter()
                        .filter(|&&s| self.next_of(last.segment.contacts[s]) != first.segment.contacts[s])
                        .count();
                }
                if self.symmetry == Symmetry::HalfPeriod {
                    high = high.max(-low);
                    low = -high;
                }
                Ok(JointMotion {
                    name: joint.name().to_owned(),
                    dissipation: self.times() * dissipation,
                    // a joint that holds nothing slips all the time
                    slip_fraction: if parts.is_empty() { 1.0 } else { self.times() * slipping / self.period },
                    displacement: vec![(low, high)],
                    switches: self.times() as usize * switches,
                })
            })
            .collect()
    }

    /// Adds `Re Σ G_h e^{jhΩt}` to a signal of the piece.
    fn add_imposed(&self, piece: &Piece, imposed: &[(u32, Complex64)], signal: &mut [Complex64]) {
        let omega = self.omega;
        for &(harmonic, amplitude) in imposed {
            if harmonic == 0 {
                signal[piece.basis().constant()].re += amplitude.re;
                continue;
            }
            let rate = f64::from(harmonic) * omega;
            let Some(h) = self.rates.iter().position(|r| (r - rate).abs() < 0.5 * omega) else {
                continue; // without a drive nothing moves the place
            };
            signal[piece.segment.driven.modes + h] += amplitude * Complex64::new(0.0, rate * piece.segment.start).exp();
        }
    }

    /// The force and the force-velocity product as they enter the energy balance; see [`System`] for the meaning of the parts.
    fn energy(&self, flow: &Flow, joints: &[JointMotion]) -> Energy {
        let n = self.system.dofs();
        let (mut work, mut viscous) = (0.0, 0.0);
        let mut force = Vec::new();
        for piece in &self.pieces {
            let basis = piece.basis();
            let nb = basis.len();
            let products = Products::new(basis, &piece.at_end, piece.segment.length);
            let product = |a: &[Complex64], b: &[Complex64]| products.integral(basis, a, b);
            let velocity = |i: usize| &piece.velocity[i * nb..(i + 1) * nb];
            for i in 0..n {
                if self.load(piece, &flow.drive, i, &mut force) {
                    work += product(&force, velocity(i));
                }
                for k in 0..=i {
                    let c = self.system.structure().damping()[(i, k)];
                    if c != 0.0 {
                        viscous += if k == i { c } else { 2.0 * c } * product(velocity(i), velocity(k));
                    }
                }
            }
            for (m, place) in self.system.moved().iter().enumerate() {
                let (motion, speed) = self.moved_motion(piece, m);
                work += product(&self.reaction(piece, m), &speed);
                for i in 0..n {
                    let (k, c) = (place.stiffness.0[i], place.damping.0[i]);
                    // the load on the masses contains what the moved place does to them: that is no work from outside
                    let coupling: Vec<Complex64> = motion.iter().zip(&speed).map(|(u, v)| u * k + v * c).collect();
                    if k != 0.0 || c != 0.0 {
                        work += product(&coupling, velocity(i));
                        viscous += 2.0 * c * product(&speed, velocity(i));
                    }
                }
                for (other, c) in place.damping.1.iter().enumerate() {
                    if *c != 0.0 {
                        viscous += c * product(&speed, &self.moved_motion(piece, other).1);
                    }
                }
            }
        }
        Energy {
            work_in: self.times() * work,
            viscous: self.times() * viscous,
            friction: joints.iter().map(|joint| joint.dissipation).sum(),
        }
    }

    /// Load on degree of freedom `i` as a signal, into `force`; whether there is any.
    fn load(&self, piece: &Piece, drive: &Drive, i: usize, force: &mut Vec<Complex64>) -> bool {
        if drive.constant[i] == 0.0 && drive.forces.iter().all(|f| f[i] == ZERO) {
            return false;
        }
        force.clear();
        force.resize(piece.basis().len(), ZERO);
        force[piece.basis().constant()].re = drive.constant[i];
        for (h, rate) in drive.rates.iter().enumerate() {
            force[piece.segment.driven.modes + h] =
                drive.forces[h][i] * Complex64::new(0.0, rate * piece.segment.start).exp();
        }
        true
    }

    /// Displacement and velocity of a moved place as signals.
    fn moved_motion(&self, piece: &Piece, m: usize) -> (Vec<Complex64>, Vec<Complex64>) {
        let mut motion = vec![ZERO; piece.basis().len()];
        self.add_imposed(piece, &self.system.moved()[m].motion, &mut motion);
        let mut speed = motion.clone();
        piece.basis().differentiate(&motion, &mut speed);
        (motion, speed)
    }

    /// The force that moves a place, as a signal.
    fn reaction(&self, piece: &Piece, m: usize) -> Vec<Complex64> {
        let (n, nb, place) = (self.system.dofs(), piece.basis().len(), &self.system.moved()[m]);
        let mut force = vec![ZERO; nb];
        let add = |force: &mut [Complex64], signal: &[Complex64], factor: f64| {
            if factor != 0.0 {
                force.iter_mut().zip(signal).for_each(|(f, s)| *f += s * factor);
            }
        };
        for (other, (k, c)) in place.stiffness.1.iter().zip(&place.damping.1).enumerate() {
            let (motion, speed) = self.moved_motion(piece, other);
            add(&mut force, &motion, *k);
            add(&mut force, &speed, *c);
            if other == m {
                let mut acceleration = vec![ZERO; nb];
                piece.basis().differentiate(&speed, &mut acceleration);
                add(&mut force, &acceleration, place.mass);
            }
        }
        for i in 0..n {
            add(&mut force, &piece.segment.displacement[i * nb..(i + 1) * nb], place.stiffness.0[i]);
            add(&mut force, &piece.velocity[i * nb..(i + 1) * nb], place.damping.0[i]);
        }
        for (s, part) in self.parts.iter().enumerate() {
            add(&mut force, &piece.segment.force[s * nb..(s + 1) * nb], place.joints[part.joint]);
        }
        force
    }

    /// Force amplitude times velocity amplitude times period: what could be exchanged.
    fn exchanged(&self, drive: &Drive) -> f64 {
        let fastest = |i: usize| {
            let sizes = self.pieces.iter().map(|piece| {
                let nb = piece.basis().len();
                piece.velocity[i * nb..(i + 1) * nb].iter().map(size_of).sum::<f64>()
            });
            sizes.fold(0.0, f64::max)
        };
        let loads: f64 =
            (0..self.system.dofs()).map(|i| drive.forces.iter().map(|f| f[i].norm()).sum::<f64>() * fastest(i)).sum();
        let joints: f64 = self
            .system
            .joints()
            .iter()
            .enumerate()
            .map(|(j, joint)| {
                let limit: f64 = self.of_joint(j).map(|s| self.parts[s].limit()).sum();
                limit * joint.axes()[0].imposed().iter().map(|(h, g)| f64::from(*h) * g.norm()).sum::<f64>()
                    / self.period
            })
            .sum();
        self.period * (loads + joints)
    }

    /// The piece at a time within the first return, and the time since its start.
    fn piece(&self, time: f64) -> (&Piece, f64) {
        let index = self.pieces.partition_point(|piece| piece.segment.start <= time).max(1) - 1;
        let piece = &self.pieces[index];
        (piece, (time - piece.segment.start).clamp(0.0, piece.segment.length))
    }
}

/// Memory of [`Piece::extremes`], kept between calls.
#[derive(Debug, Default)]
struct Memory {
    scratch: Scratch,
    values: Vec<Complex64>,
    slope: Vec<Complex64>,
    shifted: Vec<Complex64>,
}

/// Derivatives of signals that follow each other.
fn derivative(basis: &Basis, signals: &[Complex64]) -> Vec<Complex64> {
    let mut out = vec![ZERO; signals.len()];
    for (signal, out) in signals.chunks_exact(basis.len()).zip(out.chunks_exact_mut(basis.len())) {
        basis.differentiate(signal, out);
    }
    out
}

impl Piece {
    fn basis(&self) -> &Basis {
        self.segment.basis()
    }

    /// Least and largest value of `signal`, whose derivative is `slope`, over the piece.
    /// # Errors
    /// [`Breakdown::TooFast`] if it turns too often.
    fn extremes(
        &self,
        signal: &[Complex64],
        slope: &[Complex64],
        memory: &mut Memory,
    ) -> Result<(f64, f64), Breakdown> {
        let basis = self.basis();
        let nb = basis.len();
        let Memory { scratch, values, slope: turning, shifted } = memory;
        values.resize(nb, ZERO);
        shifted.resize(nb, ZERO);
        basis.evaluate(0.0, values);
        let (first, last) = (real_dot(signal, values), real_dot(signal, &self.at_end));
        let (mut low, mut high) = (first.min(last), first.max(last));
        let mut time = 0.0;
        let mut now = real_dot(slope, values);
        // from turning point to turning point: shift the slope to the present time and look for its next zero
        // what is near the rounding of the signal moves no extreme, but turns millions of times where a mode is very fast
        let rounding = NEGLIGIBLE * signal.iter().map(size_of).sum::<f64>();
        turning.clear();
        turning.extend_from_slice(slope);
        for ((slope, c), exponent) in turning.iter_mut().zip(signal).zip(&basis.exponents) {
            if size_of(c) <= rounding && exponent.re <= 0.0 {
                *slope = ZERO;
            }
        }
        let size: f64 = turning.iter().map(size_of).sum();
        let too_fast = Breakdown::TooFast { time: self.segment.start };
        let mut turns = 0;
        let mut sign = if now < 0.0 { -1.0 } else { 1.0 };
        while size > 0.0 && time < self.segment.length {
            basis.shift(turning, time, values, sign, shifted);
            let begin = if now.abs() > FLAT * size { Begin::Positive } else { Begin::Zero };
            match basis.first_zero(shifted, &[begin], self.segment.length - time, scratch) {
                FirstZero::At { time: after, .. } => {
                    if after == 0.0 && begin == Begin::Positive {
                        break;
                    }
                    turns += 1;
                    if turns > MOST_TURNS {
                        return Err(too_fast);
                    }
                    time += after;
                    basis.evaluate(time, values);
                    let value = real_dot(signal, values);
                    (low, high) = (low.min(value), high.max(value));
                    now = 0.0;
                    sign = -sign;
                }
                FirstZero::None => break,
                FirstZero::TooManySteps => return Err(too_fast),
            }
        }
        Ok((low, high))
    }
}

/// A mode whose part of a signal is below this fraction of it is rounding: the orbit is closed to 1e-12 of its state.
const NEGLIGIBLE: f64 = 64.0 * f64::EPSILON;
/// A slope below this fraction of its terms is a turning point.
const FLAT: f64 = 1e-12;
/// Turning points of one signal between two switches beyond which a mode is too fast to be followed. A mode that rings undamped at a hundred
/// times the drive frequency turns two hundred times in a period.
const MOST_TURNS: usize = 5000;

impl Path for ExactPath {
    fn sample(&self, time: f64) -> Sample {
        let half = 0.5 * self.period;
        let (time, sign) = match self.symmetry {
            Symmetry::HalfPeriod if time >= half => (time - half, -1.0),
            _ => (time, 1.0),
        };
        let (piece, since) = self.piece(time);
        let (n, nb) = (self.system.dofs(), piece.basis().len());
        let mut values = vec![ZERO; nb];
        piece.basis().evaluate(since, &mut values);
        let row = |coefficients: &[Complex64], i: usize| sign * real_dot(&coefficients[i * nb..(i + 1) * nb], &values);
        let rows = |coefficients: &[Complex64]| (0..n).map(|i| row(coefficients, i)).collect::<Vec<f64>>();
        let (displacement, velocity) = (rows(&piece.segment.displacement), rows(&piece.velocity));
        let acceleration = rows(&derivative(piece.basis(), &piece.velocity));
        let joints = self
            .system
            .joints()
            .iter()
            .enumerate()
            .map(|(j, joint)| {
                let mut imposed = vec![ZERO; nb];
                self.add_imposed(piece, joint.axes()[0].imposed(), &mut imposed);
                let mut speed = vec![ZERO; nb];
                piece.basis().differentiate(&imposed, &mut speed);
                let along = |v: &[f64]| joint.axes()[0].along(v);
                let mine = || self.of_joint(j);
                let joint_velocity = along(&velocity) + sign * real_dot(&speed, &values);
                let of_parts = || mine().map(|s| piece.segment.contacts[s]);
                // a joint slips if a part of it does, rests if one does, and is open if all its stops are
                let contact = match of_parts().find(|c| c.slips()).or_else(|| of_parts().min()) {
                    None => Contact::slip(joint_velocity),
                    Some(contact) if sign < 0.0 => contact.mirrored(),
                    Some(contact) => contact,
                };
                let joint_displacement = along(&displacement) + sign * real_dot(&imposed, &values);
                let force = mine().map(|s| row(&piece.segment.force, s)).sum();
                JointSample::along(joint_displacement, joint_velocity, force, contact)
            })
            .collect();
        let moved = (0..self.system.moved().len())
            .map(|m| {
                let (motion, _) = self.moved_motion(piece, m);
                let reaction = self.reaction(piece, m);
                (sign * real_dot(&motion, &values), sign * real_dot(&reaction, &values))
            })
            .collect();
        Sample { acceleration, displacement, velocity, joints, moved }
    }

    fn switch_times(&self) -> Vec<f64> {
        let inner = self.pieces.iter().skip(1).map(|piece| piece.segment.start);
        // a switch may also fall on the instant at which the return is cut
        let at_cut = self.pieces.first().zip(self.pieces.last()).is_some_and(|(first, last)| {
            first.segment.contacts.iter().zip(&last.segment.contacts).any(|(f, l)| self.next_of(*l) != *f)
        });
        let first: Vec<f64> = at_cut.then_some(0.0).into_iter().chain(inner).collect();
        match self.symmetry {
            Symmetry::FullPeriod => first,
            Symmetry::HalfPeriod => {
                let second: Vec<f64> = first.iter().map(|t| t + 0.5 * self.period).collect();
                first.into_iter().chain(second).collect()
            }
        }
    }
}
