//! Results of an orbit from its closed-form segments.

use super::mechanics::{JointPart, PartShare};
use super::segments::{Segment, SegmentedMotion};
use super::settings::{EventDrivenSettings, NAME};
use crate::law::Contact;
use crate::method::IntegrationError;
use crate::method::orbit_search::return_map::{ClosedState, norm};
use crate::method::orbit_search::vibration_share;
use crate::model::{Axis, System};
use crate::orbit::postprocess::{CONSERVATIVE_WORK, ContactFractions, ContactSummary, PathSignals, results};
use crate::orbit::{Accuracy, Evidence, JointSample, Orbit, Path, Sample, Symmetry, history_dependent_joints, laws};
use num_complex::Complex64;
use std::cell::RefCell;
use std::sync::Arc;
use stickslip_numerics::signal::{ExponentialBasis, FourierIntegrals, ProductIntegrals, real_dot};
use stickslip_numerics::signal_range::{RangeScratch, SignalSegment, ValueRange};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// The closed-form segments of one return, with the data for their evaluation.
#[derive(Debug, Clone)]
pub(crate) struct ExactPath {
    system: Arc<System>,
    pieces: Vec<PathSegment>,
    /// Ideal parts of the joints.
    parts: Arc<[JointPart]>,
    /// Shares of the joints in these parts.
    shares: Arc<[PartShare]>,
    symmetry: Symmetry,
    period: f64,
    rates: Vec<f64>,
    omega: f64,
}

#[derive(Debug, Clone)]
struct PathSegment {
    segment: Segment,
    velocity: Vec<Complex64>,
}

/// Creates the orbit from the last run of the flow, which started from the state `closed`.
/// `weights` define the norm of states.
pub(super) fn orbit(
    system: &Arc<System>,
    contracts: bool,
    flow: &SegmentedMotion,
    (omega, periods): (f64, usize),
    symmetry: Symmetry,
    (closed, weights): (ClosedState, &[f64]),
) -> Result<Orbit, IntegrationError> {
    let settings = EventDrivenSettings::default();
    let period = periods as f64 * std::f64::consts::TAU / omega;
    let path = ExactPath::new(system.clone(), flow, symmetry, period);
    let measured = results(system, &ExactMeasurement::new(&path), omega, (symmetry, period))?;
    let rest = settings.rest_fraction * flow.energy_scale;
    let share = vibration_share::fraction(&path, (symmetry, period), &closed.state, (weights, rest));
    // An orbit with the residual of a converged orbit can have gained or lost this fraction of the
    // stored energy. Below it, the work is not a suitable reference for the energy gap.
    let unresolved = settings.residual / settings.energy_gap;
    let stored = share * norm(weights, &closed.state).powi(2);
    let stuck = measured.stuck_names();
    let mut orbit = Orbit {
        method: NAME,
        omega,
        periods,
        symmetry,
        initial_state: closed.state,
        evidence: Evidence {
            residual: closed.residual,
            energy_gap: measured.energy_gap(f64::max(CONSERVATIVE_WORK * rest * rest, unresolved * stored)),
            switches: measured.joints.iter().map(|joint| joint.switches).sum(),
            iterations: closed.iterations,
            harmonics: None,
            error_estimate: closed.distance,
            return_defect: Some(closed.residual),
            accuracy: Accuracy::Converged,
            history_dependent: history_dependent_joints(laws(system), &measured.joints, &stuck, symmetry),
            stuck,
            history_spread: None,
            found_by: NAME,
            fallback_from: None,
        },
        places: measured.places,
        joints: measured.joints,
        energy: measured.energy,
        return_map: closed.derivative,
        contracts,
        path: Arc::new(path),
        series: None,
    };
    vibration_share::rescale_evidence(&mut orbit.evidence, share);
    Ok(orbit)
}

impl ExactPath {
    /// Creates a path from the segments of the last run. `period` is the time after which they
    /// repeat, or with half-period symmetry, twice the time after which they repeat with
    /// opposite sign.
    pub fn new(system: Arc<System>, flow: &SegmentedMotion, symmetry: Symmetry, period: f64) -> Self {
        let pieces = flow
            .segments()
            .iter()
            .map(|segment| {
                let basis = segment.basis();
                PathSegment { velocity: derivative(basis, &segment.displacement), segment: segment.clone() }
            })
            .collect();
        let (rates, omega) = (flow.excitation.rates.clone(), flow.excitation.omega);
        let (parts, shares) = (flow.mechanics.parts.clone(), flow.mechanics.shares.clone());
        ExactPath { system, pieces, parts, shares, symmetry, period, rates, omega }
    }

    /// Iterates over the shares of a joint in the parts.
    fn of_joint(&self, joint: usize) -> impl Iterator<Item = &PartShare> {
        self.shares.iter().filter(move |share| share.joint == joint)
    }

    /// Returns the contact state of a joint in a segment: slip if a slider slips, else stick if
    /// one sticks, else touch if a stop touches, else open. Returns `None` for a joint without
    /// force.
    fn contact_of(&self, joint: usize, segment: &Segment) -> Option<Contact> {
        let of_part = |share: &PartShare| match segment.contacts[share.part] {
            Contact::Stick if !self.parts[share.part].is_slider() => Contact::Touch,
            contact => share.contact(contact),
        };
        let of_parts = || self.of_joint(joint).map(of_part);
        of_parts().find(|contact| contact.slips()).or_else(|| of_parts().min())
    }

    /// Returns the continuation after the return of the contact at its end.
    fn next_of(&self, last: Contact) -> Contact {
        if self.symmetry == Symmetry::HalfPeriod { last.mirrored() } else { last }
    }

    /// Adds `Re Σ G_h e^{jhΩt}` to a signal of the piece.
    fn add_imposed(&self, piece: &PathSegment, imposed: &[(u32, Complex64)], signal: &mut [Complex64]) {
        for &(harmonic, amplitude) in imposed {
            self.add_harmonic(piece, f64::from(harmonic) * self.omega, amplitude, signal);
        }
    }

    /// Adds `Re a e^{jωt}` of (ω, a) to a signal of the piece.
    fn add_harmonic(&self, piece: &PathSegment, rate: f64, amplitude: Complex64, signal: &mut [Complex64]) {
        if rate == 0.0 {
            signal[piece.basis().constant()].re += amplitude.re;
            return;
        }
        let Some(h) = self.rates.iter().position(|r| (r - rate).abs() < 0.5 * self.omega) else {
            return; // without excitation, the place does not move
        };
        signal[piece.segment.driven.modes + h] += amplitude * Complex64::new(0.0, rate * piece.segment.start).exp();
    }

    /// Adds the relative displacement along an axis to a signal of the piece.
    fn add_relative(&self, piece: &PathSegment, axis: &Axis, signal: &mut [Complex64]) {
        let nb = piece.basis().len();
        for &(row, w) in axis.rows() {
            let x = &piece.segment.displacement[row * nb..(row + 1) * nb];
            signal.iter_mut().zip(x).for_each(|(u, x)| *u += x * w);
        }
        self.add_imposed(piece, axis.imposed(), signal);
    }

    /// Returns displacement and velocity of a moved place as signals.
    fn moved_motion(&self, piece: &PathSegment, m: usize) -> (Vec<Complex64>, Vec<Complex64>) {
        let mut motion = vec![ZERO; piece.basis().len()];
        self.add_imposed(piece, &self.system.moved_places()[m].motion, &mut motion);
        let mut speed = motion.clone();
        piece.basis().differentiate(&motion, &mut speed);
        (motion, speed)
    }

    /// Returns the force that moves a place, as a signal.
    fn reaction(&self, piece: &PathSegment, m: usize) -> Vec<Complex64> {
        let (n, nb, place) = (self.system.dofs(), piece.basis().len(), &self.system.moved_places()[m]);
        let mut force = vec![ZERO; nb];
        let add = |force: &mut [Complex64], signal: &[Complex64], factor: f64| {
            if factor != 0.0 {
                force.iter_mut().zip(signal).for_each(|(f, s)| *f += s * factor);
            }
        };
        if !place.force.is_empty() {
            let mut outer = vec![ZERO; nb];
            self.add_imposed(piece, &place.force, &mut outer);
            add(&mut force, &outer, -1.0);
        }
        for (other, (k, c)) in place.stiffness.1.iter().zip(&place.damping.1).enumerate() {
            let (motion, speed) = self.moved_motion(piece, other);
            add(&mut force, &motion, *k);
            add(&mut force, &speed, *c);
            if place.mass.1[other] != 0.0 {
                let mut acceleration = vec![ZERO; nb];
                piece.basis().differentiate(&speed, &mut acceleration);
                add(&mut force, &acceleration, place.mass.1[other]);
            }
        }
        for i in 0..n {
            if place.mass.0[i] != 0.0 {
                let mut acceleration = vec![ZERO; nb];
                piece.basis().differentiate(&piece.velocity[i * nb..(i + 1) * nb], &mut acceleration);
                add(&mut force, &acceleration, place.mass.0[i]);
            }
            add(&mut force, &piece.segment.displacement[i * nb..(i + 1) * nb], place.stiffness.0[i]);
            add(&mut force, &piece.velocity[i * nb..(i + 1) * nb], place.damping.0[i]);
        }
        for share in self.shares.iter() {
            let of_part = &piece.segment.force[share.part * nb..(share.part + 1) * nb];
            add(&mut force, of_part, place.joints[share.joint] * share.of(piece.segment.contacts[share.part]));
        }
        force
    }

    /// Returns the piece at a time within the first return, and the time since its start.
    fn piece(&self, time: f64) -> (&PathSegment, f64) {
        let index = self.pieces.partition_point(|piece| piece.segment.start <= time).max(1) - 1;
        let piece = &self.pieces[index];
        (piece, (time - piece.segment.start).clamp(0.0, piece.segment.length))
    }
}

/// A path during measurement, with the shared data of all integrals.
struct ExactMeasurement<'a> {
    path: &'a ExactPath,
    axes: Vec<&'a Axis>,
    /// First index of each piece's coefficients in a signal, and the total length.
    cuts: Vec<usize>,
    products: Vec<ProductIntegrals>,
    /// Entries by frequency, rad/s: the phase factor at the start of each piece, and the
    /// integrals over it.
    fourier: RefCell<Vec<(f64, PhaseIntegrals)>>,
    memory: RefCell<RangeScratch>,
}

type PhaseIntegrals = Vec<(Complex64, FourierIntegrals)>;

impl<'a> ExactMeasurement<'a> {
    fn new(path: &'a ExactPath) -> Self {
        let mut cuts = vec![0];
        for piece in &path.pieces {
            cuts.push(cuts[cuts.len() - 1] + piece.basis().len());
        }
        let products =
            |piece: &PathSegment| ProductIntegrals::new(piece.basis(), &piece.segment.at_end, piece.segment.length);
        ExactMeasurement {
            path,
            axes: path.system.axes().map(|(_, axis)| axis).collect(),
            cuts,
            products: path.pieces.iter().map(products).collect(),
            fourier: RefCell::default(),
            memory: RefCell::default(),
        }
    }

    fn turning(&self, omega: f64) -> PhaseIntegrals {
        let of = |piece: &PathSegment| {
            let turn = Complex64::new(0.0, -omega * piece.segment.start).exp();
            (turn, FourierIntegrals::new(piece.basis(), &piece.segment.at_end, omega, piece.segment.length))
        };
        self.path.pieces.iter().map(of).collect()
    }

    /// Iterates over the pieces, with the range of their coefficients in a signal.
    fn pieces(&self) -> impl Iterator<Item = (&'a PathSegment, std::ops::Range<usize>)> {
        self.path.pieces.iter().zip(self.cuts.windows(2)).map(|(piece, cut)| (piece, cut[0]..cut[1]))
    }

    /// Builds a signal piece by piece.
    fn made(&self, mut make: impl FnMut(&PathSegment, &mut [Complex64])) -> Vec<Complex64> {
        let mut signal = vec![ZERO; self.cuts[self.cuts.len() - 1]];
        self.pieces().for_each(|(piece, range)| make(piece, &mut signal[range]));
        signal
    }

    /// Copies a row of coefficients from the pieces.
    fn kept(&self, row: usize, of: impl Fn(&PathSegment) -> &[Complex64]) -> Vec<Complex64> {
        self.made(|piece, out| out.copy_from_slice(&of(piece)[row * out.len()..(row + 1) * out.len()]))
    }

    /// Returns the least and the largest value of a signal.
    fn range_of(&self, signal: &[Complex64]) -> Result<(f64, f64), IntegrationError> {
        let mut memory = self.memory.borrow_mut();
        let mut range = ValueRange::new(self.path.symmetry == Symmetry::HalfPeriod);
        // values known from all pieces reduce the search in each of them
        for (piece, coefficients) in self.pieces() {
            range.include(piece.basis().initial_value(&signal[coefficients]));
        }
        for (piece, coefficients) in self.pieces() {
            let Segment { start, length, at_end, .. } = &piece.segment;
            let segment = SignalSegment { coefficients: &signal[coefficients], at_end, length: *length };
            piece
                .basis()
                .extend_range(&mut range, segment, &mut memory)
                .map_err(|_| IntegrationError::TooFast { time: *start })?;
        }
        Ok((range.low, range.high))
    }

    fn derivative(&self, signal: &[Complex64]) -> Vec<Complex64> {
        let mut slope = signal.to_vec();
        self.pieces().for_each(|(piece, range)| piece.basis().differentiate(&signal[range.clone()], &mut slope[range]));
        slope
    }

    fn relative(&self, axis: usize) -> Vec<Complex64> {
        self.made(|piece, out| self.path.add_relative(piece, self.axes[axis], out))
    }
}

/// A signal is the list of its coefficients, piece by piece. Each law acts along one axis, so
/// that axes and joints have the same indices.
impl PathSignals for ExactMeasurement<'_> {
    type Signal = Vec<Complex64>;
    type Error = IntegrationError;

    fn displacement(&self, row: usize) -> Vec<Complex64> {
        self.kept(row, |piece| &piece.segment.displacement)
    }
    fn velocity(&self, row: usize) -> Vec<Complex64> {
        self.kept(row, |piece| &piece.velocity)
    }
    fn relative_velocity(&self, axis: usize) -> Vec<Complex64> {
        self.derivative(&self.relative(axis))
    }
    fn force(&self, axis: usize) -> Vec<Complex64> {
        self.made(|piece, out| {
            let nb = out.len();
            for share in self.path.of_joint(axis) {
                let force = &piece.segment.force[share.part * nb..(share.part + 1) * nb];
                let factor = share.of(piece.segment.contacts[share.part]);
                out.iter_mut().zip(force).for_each(|(sum, f)| *sum += f * factor);
            }
        })
    }
    fn harmonics(&self, parts: &[(f64, Complex64)]) -> Vec<Complex64> {
        self.made(|piece, out| {
            parts.iter().for_each(|(rate, amplitude)| self.path.add_harmonic(piece, *rate, *amplitude, out))
        })
    }
    fn add(&self, to: &mut Vec<Complex64>, signal: &Vec<Complex64>, factor: f64) {
        to.iter_mut().zip(signal).for_each(|(to, value)| *to += value * factor);
    }
    fn product(&self, a: &Vec<Complex64>, b: &Vec<Complex64>) -> f64 {
        let integral = |((piece, range), products): ((&PathSegment, std::ops::Range<usize>), &ProductIntegrals)| {
            products.integral(piece.basis(), &a[range.clone()], &b[range])
        };
        self.pieces().zip(&self.products).map(integral).sum()
    }
    fn fourier(&self, signal: &Vec<Complex64>, omega: f64) -> Complex64 {
        let mut known = self.fourier.borrow_mut();
        let at = known.iter().position(|(nu, _)| *nu == omega).unwrap_or_else(|| {
            known.push((omega, self.turning(omega)));
            known.len() - 1
        });
        let mut sum = ZERO;
        for ((piece, range), (turn, integrals)) in self.pieces().zip(&known[at].1) {
            sum += integrals.integral(piece.basis(), &signal[range]) * turn;
        }
        sum
    }
    fn range(&self, place: &Axis) -> Result<(f64, f64), IntegrationError> {
        self.range_of(&self.place_displacement(place))
    }
    fn relative_range(&self, axis: usize) -> Result<(f64, f64), IntegrationError> {
        self.range_of(&self.relative(axis))
    }
    /// Returns the dissipation of the sliders alone, because springs and stops return all their
    /// energy.
    fn dissipation(&self, axis: usize, _force: &Vec<Complex64>) -> f64 {
        let u = self.relative(axis);
        let mut sum = 0.0;
        for (piece, range) in self.pieces() {
            let u = &u[range];
            let travel = real_dot(u, &piece.segment.at_end) - piece.basis().initial_value(u);
            for share in self.path.of_joint(axis) {
                let contact = piece.segment.contacts[share.part];
                sum += contact.sign() * self.path.parts[share.part].limit() * share.of(contact) * travel;
            }
        }
        sum
    }
    fn faces(&self, joint: usize) -> ContactSummary {
        let path = self.path;
        if path.of_joint(joint).next().is_none() {
            // a joint without force slips all the time
            return ContactSummary {
                shares: ContactFractions { slip: 1.0, ..ContactFractions::default() },
                switches: 0,
                slips: 1,
                stays_closed: false,
            };
        }
        let contact = |piece: &PathSegment| path.contact_of(joint, &piece.segment).unwrap_or(Contact::Open);
        let shares = ContactFractions::of(path.pieces.iter().map(|piece| (contact(piece), piece.segment.length)));
        let slips = |segment: &Segment| path.of_joint(joint).any(|share| segment.contacts[share.part].slips());
        let pairs = path.pieces.windows(2).map(|pair| (&pair[0].segment.contacts, &pair[1].segment.contacts));
        let parts = || path.of_joint(joint).map(|share| share.part);
        let mut switches: usize = pairs.map(|(before, after)| parts().filter(|&s| before[s] != after[s]).count()).sum();
        if let (Some(first), Some(last)) = (path.pieces.first(), path.pieces.last()) {
            let (first, last) = (&first.segment.contacts, &last.segment.contacts);
            switches += parts().filter(|&s| path.next_of(last[s]) != first[s]).count();
        }
        // unlike samples, the segments resolve each slip: a joint with one slip does not stick
        let slips = path.pieces.iter().filter(|piece| slips(&piece.segment)).count();
        ContactSummary { shares, switches, slips, stays_closed: slips == 0 }
    }
}

/// Returns the derivatives of consecutive signals.
fn derivative(basis: &ExponentialBasis, signals: &[Complex64]) -> Vec<Complex64> {
    let mut out = vec![ZERO; signals.len()];
    for (signal, out) in signals.chunks_exact(basis.len()).zip(out.chunks_exact_mut(basis.len())) {
        basis.differentiate(signal, out);
    }
    out
}

impl PathSegment {
    fn basis(&self) -> &ExponentialBasis {
        self.segment.basis()
    }
}

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
                let along = |v: &[f64]| joint.axes()[0].component(v);
                let joint_velocity = along(&velocity) + sign * real_dot(&speed, &values);
                let contact = match self.contact_of(j, &piece.segment) {
                    None => Contact::slip(joint_velocity),
                    Some(contact) if sign < 0.0 => contact.mirrored(),
                    Some(contact) => contact,
                };
                let joint_displacement = along(&displacement) + sign * real_dot(&imposed, &values);
                let of_share = |s: &PartShare| s.of(piece.segment.contacts[s.part]) * row(&piece.segment.force, s.part);
                let force = self.of_joint(j).map(of_share).sum();
                JointSample::one_dimensional(joint_displacement, joint_velocity, force, contact)
            })
            .collect();
        let moved = (0..self.system.moved_places().len())
            .map(|m| {
                let (motion, _) = self.moved_motion(piece, m);
                let reaction = self.reaction(piece, m);
                (sign * real_dot(&motion, &values), sign * real_dot(&reaction, &values))
            })
            .collect();
        Sample { acceleration, displacement, velocity, joints, imposed: moved }
    }

    fn transition_times(&self) -> Vec<f64> {
        let inner = self.pieces.iter().skip(1).map(|piece| piece.segment.start);
        // a switch can also coincide with the start of the return
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
