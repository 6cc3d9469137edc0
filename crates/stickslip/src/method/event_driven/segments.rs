//! The motion over a time interval: closed-form segments joined at the switches, with exact
//! sensitivity.

use super::mechanics::{JointPart, Mechanics, PartKind};
use super::pattern::{ForcedResponse, Pattern, PatternScratch, SegmentStart};
use super::pattern_cache::PatternCache;
use super::settings::EventDrivenSettings;
use super::transition::Transition;
use crate::law::Contact;
use crate::method::IntegrationError;
use crate::method::flow::excitation::HarmonicExcitation;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::interrupt;
use stickslip_numerics::signal::{ExponentialBasis, FirstZero, InitialSign, ZeroScratch, real_dot};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// One closed-form segment of the motion.
#[derive(Debug, Clone, Default)]
pub(crate) struct Segment {
    /// Start, s.
    pub start: f64,
    /// Length, s.
    pub length: f64,
    /// Contact states.
    pub contacts: Vec<Contact>,
    /// Response of its pattern to the excitation, with the basis of its signals.
    pub driven: Arc<ForcedResponse>,
    /// Coefficients of the displacements, n × basis, row by row.
    pub displacement: Vec<Complex64>,
    /// Forces of the parts of joints, parts × basis, row by row.
    pub force: Vec<Complex64>,
    /// The basis functions at its end.
    pub at_end: Vec<Complex64>,
}

impl Segment {
    /// Returns the memory of its signals, bytes.
    fn bytes(&self) -> usize {
        16 * (self.displacement.len() + self.force.len() + self.at_end.len())
    }

    /// Returns the basis of its signals.
    pub fn basis(&self) -> &ExponentialBasis {
        &self.driven.basis
    }
}

/// Computes the motion; stores patterns, scratch memory and the segments of the last run.
pub(crate) struct SegmentedMotion {
    pub mechanics: Mechanics,
    pub excitation: HarmonicExcitation,
    /// Square root of an energy that the loads can cause, √J.
    pub energy_scale: f64,
    /// A velocity well below those of the moving structure, m/s: the velocity scale near rest.
    moving: f64,
    memory: PatternCache,
    segments: Vec<Segment>,
    /// Number of segments of the last run.
    used: usize,
    /// Number of switches of the last run.
    switches: usize,
    decision: Transition,
    work: PatternScratch,
    scratch: ZeroScratch,
    values: Vec<Complex64>,
    velocity: Vec<Complex64>,
    acceleration: Vec<Complex64>,
    signals: Vec<Complex64>,
    begins: Vec<InitialSign>,
    watched: Vec<usize>,
    /// Marks parts that are monitored for a switch in the forward and in the backward
    /// direction.
    nearest: Vec<[bool; 2]>,
    before: DVector<f64>,
    after: DVector<f64>,
    row: DVector<f64>,
    /// Displacements and velocities at the start of the segment.
    from: Vec<f64>,
    rate: Vec<Complex64>,
}

impl SegmentedMotion {
    pub fn new(mechanics: Mechanics, excitation: HarmonicExcitation) -> Self {
        let (work, decision) = (PatternScratch::new(&mechanics, excitation.rates.len()), Transition::new(&mechanics));
        let states = mechanics.states();
        SegmentedMotion {
            mechanics,
            excitation,
            energy_scale: 0.0,
            moving: 0.0,
            memory: PatternCache::default(),
            segments: Vec::new(),
            used: 0,
            switches: 0,
            decision,
            work,
            scratch: ZeroScratch::default(),
            values: Vec::new(),
            velocity: Vec::new(),
            acceleration: Vec::new(),
            signals: Vec::new(),
            begins: Vec::new(),
            watched: Vec::new(),
            nearest: Vec::new(),
            before: DVector::zeros(states),
            after: DVector::zeros(states),
            row: DVector::zeros(states),
            from: Vec::new(),
            rate: Vec::new(),
        }
    }

    /// Returns the segments of the last run.
    pub fn segments(&self) -> &[Segment] {
        &self.segments[..self.used]
    }

    /// Computes the motion from `state`, which becomes the end state, over
    /// `[start, start + duration]`. `sensitivity`, if given, is multiplied from the left by the
    /// derivative of the end state with respect to the initial state.
    pub fn run(
        &mut self,
        state: &mut [f64],
        start: f64,
        duration: f64,
        mut sensitivity: Option<&mut DMatrix<f64>>,
    ) -> Result<(), IntegrationError> {
        let settings = EventDrivenSettings::default();
        self.used = 0;
        self.switches = 0;
        let n = self.mechanics.n;
        self.from.resize(2 * n, 0.0);
        for part in self.mechanics.parts.iter() {
            if let PartKind::Elastic { limit, state: s, .. } = part.kind {
                state[2 * n + s] = state[2 * n + s].clamp(-limit, limit);
            }
        }
        let velocity_scale = self.velocity_scale(state);
        let end = start + duration;
        let mut time = start;
        let (mut at_once, mut idle, mut bytes) = (0, 0, 0);
        if !self.decision.determine(&self.mechanics, &self.excitation, time, state, velocity_scale) {
            return Err(IntegrationError::NoContactState { time });
        }
        loop {
            interrupt::check();
            let (pattern, driven) = self
                .memory
                .pattern(&self.mechanics, &self.excitation, &self.decision.contacts)
                .map_err(|defective| match defective.lambda.norm() {
                    lambda if lambda.is_finite() => IntegrationError::Defective { time, lambda },
                    _ => IntegrationError::OutOfRange { time },
                })?;
            self.start_segment(time, &pattern, driven, state);
            let eased = idle > settings.idle_switches * (1 + self.mechanics.parts.len());
            self.set_event_signals(&pattern, &state[2 * n..], velocity_scale, eased);
            self.from.copy_from_slice(&state[..2 * n]);
            let rest = end - time;
            let basis = self.segments[self.used].basis();
            let zero = basis.first_zero(&self.signals, &self.begins, rest, &mut self.scratch);
            let (length, event) = match zero {
                FirstZero::None => (rest, None),
                FirstZero::Found { index, time } => (time, Some(self.watched[index])),
                FirstZero::TooManySteps => return Err(IntegrationError::TooFast { time }),
            };
            self.finish_segment(&pattern, length, state, sensitivity.as_deref_mut());
            let Some(part) = event else { return Ok(()) };
            time += length;
            self.switches += 1;
            at_once = if length <= f64::EPSILON * end.abs() { at_once + 1 } else { 0 };
            idle = if self.moved(state) <= settings.zero_velocity * velocity_scale { idle + 1 } else { 0 };
            bytes += self.segments[self.used - 1].bytes();
            let many = self.switches > settings.switches || bytes > settings.segment_memory;
            if many || at_once > settings.simultaneous_switches * (1 + self.mechanics.parts.len()) {
                let joint = self.mechanics.names[self.mechanics.parts[part].joint].clone();
                if pattern.redundant {
                    return Err(IntegrationError::Redundant { time, joint });
                }
                return Err(IntegrationError::Chatter { time, switches: self.switches, joint });
            }
            self.set_to_limit(part, state);
            if !self.decision.determine(&self.mechanics, &self.excitation, time, state, velocity_scale) {
                return Err(IntegrationError::NoContactState { time });
            }
            if let Some(sensitivity) = sensitivity.as_deref_mut() {
                self.apply_saltation(part, &pattern, time, state, sensitivity);
            }
        }
    }

    /// Returns the change of the state since the start of the segment, as a velocity, m/s.
    fn moved(&self, state: &[f64]) -> f64 {
        let n = self.mechanics.n;
        let far = |range: std::ops::Range<usize>| range.map(|i| (state[i] - self.from[i]).abs()).fold(0.0, f64::max);
        far(n..2 * n).max(far(0..n) * self.excitation.omega.max(self.mechanics.fastest))
    }

    /// Returns the largest expected relative velocity, from the state, the imposed motion and
    /// the loads.
    fn velocity_scale(&self, state: &[f64]) -> f64 {
        let n = self.mechanics.n;
        let fastest = state[n..2 * n].iter().fold(0.0f64, |a, v| a.max(v.abs()));
        // displacements count times a frequency, so that a start at a reversal has a scale too
        let widest =
            state[..n].iter().fold(0.0f64, |a, x| a.max(x.abs())) * self.excitation.omega.max(self.mechanics.fastest);
        fastest.max(widest).max(self.moving).max(f64::MIN_POSITIVE)
    }

    /// Changes the excitation; patterns stay.
    pub fn set_excitation(&mut self, excitation: HarmonicExcitation) {
        let settings = EventDrivenSettings::default();
        self.work.set_harmonics(excitation.rates.len());
        let mechanics = &self.mechanics;
        let springs = mechanics.parts.iter().filter_map(|part| match part.kind {
            PartKind::Rigid { .. } => None,
            PartKind::Elastic { stiffness, limit, .. } => Some(limit / stiffness.sqrt()),
            // its force in the initial position
            PartKind::Stop { stiffness, gap } => Some((-gap).max(0.0) * stiffness.sqrt()),
        });
        let loads = excitation.energy_scale(&mechanics.mass, &mechanics.stiffness);
        // a limit that the loads never reach does not affect the motion
        let most = if loads > 0.0 { settings.preload_ratio * loads } else { f64::INFINITY };
        self.energy_scale = loads + springs.map(|energy| energy.min(most)).sum::<f64>();
        let mobility = if mechanics.n == 0 { 0.0 } else { mechanics.inverse_mass.amax().sqrt() };
        self.moving = excitation.imposed_velocity().max(settings.rest_fraction * self.energy_scale * mobility);
        self.excitation = excitation;
        self.memory.change_drive();
    }

    fn start_segment(&mut self, time: f64, shape: &Pattern, driven: Arc<ForcedResponse>, state: &[f64]) {
        if self.segments.len() == self.used {
            self.segments.push(Segment::default());
        }
        let segment = &mut self.segments[self.used];
        let (n, nb, parts) = (self.mechanics.n, driven.basis.len(), self.mechanics.parts.len());
        (segment.start, segment.driven) = (time, driven);
        segment.contacts.clone_from(&self.decision.contacts);
        let driven = &segment.driven;
        segment.displacement.resize(n * nb, ZERO);
        segment.force.resize(parts * nb, ZERO);
        let beginning = SegmentStart { driven, contacts: &segment.contacts, time, state };
        shape.displacement(&self.mechanics, &self.excitation, beginning, &mut self.work, &mut segment.displacement);
        self.velocity.resize(n * nb, ZERO);
        self.acceleration.resize(n * nb, ZERO);
        for row in 0..n {
            let range = row * nb..(row + 1) * nb;
            driven.basis.differentiate(&segment.displacement[range.clone()], &mut self.velocity[range.clone()]);
            driven.basis.differentiate(&self.velocity[range.clone()], &mut self.acceleration[range]);
        }
        self.forces(time, shape, state);
    }

    /// Computes the forces of all parts as signals.
    fn forces(&mut self, time: f64, shape: &Pattern, state: &[f64]) {
        let Segment { force, displacement, contacts, driven, .. } = &mut self.segments[self.used];
        let (n, basis) = (self.mechanics.n, &driven.basis);
        let (nb, constant, modes) = (basis.len(), basis.constant(), shape.lambda.len());
        let turns = &self.work.turn;
        force.fill(ZERO);
        for (i, part) in self.mechanics.parts.iter().enumerate() {
            let row = &mut force[i * nb..(i + 1) * nb];
            let (kt, begins) = match (contacts[i], part.kind) {
                (Contact::Stick, PartKind::Rigid { .. }) => continue,
                (Contact::Stick, PartKind::Elastic { stiffness, state: s, .. }) => {
                    let stretch = part.along(&state[..n]) + self.excitation.imposed_at(i, time, 0);
                    (stiffness, state[2 * n + s] - stiffness * stretch)
                }
                (contact @ Contact::Stick, PartKind::Stop { stiffness, .. }) => {
                    (stiffness, part.constant_force(contact))
                }
                (contact, _) => (0.0, part.constant_force(contact)),
            };
            row[constant].re = begins;
            if kt > 0.0 {
                for k in 0..n {
                    add(row, &displacement[k * nb..(k + 1) * nb], kt * part.direction[k]);
                }
                for (h, turn) in turns.iter().enumerate() {
                    row[modes + h] += self.excitation.imposed[h][i] * turn * kt;
                }
            }
        }
        // stuck rigid sliders: λ = multiplier (F - C v - K x - other parts) + inverse_delassus
        // g''
        for (s, &held) in shape.stuck_rigid.iter().enumerate() {
            let (before, rest) = force.split_at_mut(held * nb);
            let (row, after) = rest.split_at_mut(nb);
            for (h, turn) in turns.iter().enumerate() {
                row[modes + h] = driven.held[h][s] * turn;
            }
            row[constant].re = driven.held_constant[s];
            for k in 0..n {
                add(row, &self.velocity[k * nb..(k + 1) * nb], -shape.held_by_velocity[(s, k)]);
                add(row, &displacement[k * nb..(k + 1) * nb], -shape.held_by_displacement[(s, k)]);
            }
            for (i, contact) in contacts.iter().enumerate() {
                if shape.stuck_rigid.contains(&i) {
                    continue; // the multipliers are computed here
                }
                let (factor, elastic) = (-shape.held_by_parts[(s, i)], *contact == Contact::Stick);
                let other = if i < held { &before[i * nb..] } else { &after[(i - held - 1) * nb..] };
                if elastic {
                    add(row, &other[..nb], factor);
                } else {
                    row[constant].re += other[constant].re * factor;
                }
            }
        }
    }

    /// Builds the signals whose zeros are switches.
    ///
    /// For sliders, the signal is `static limit ∓ f` in stick, and the velocity in slip
    /// direction in slip. For stops, it is the depth of a closed one or the remaining gap of an
    /// open one. If `eased`, signals that begin at zero may change sign within the tolerance of
    /// zero.
    fn set_event_signals(&mut self, shape: &Pattern, springs: &[f64], velocity_scale: f64, eased: bool) {
        let settings = EventDrivenSettings::default();
        let segment = &self.segments[self.used];
        monitored_parts(&self.mechanics.parts, &segment.contacts, springs, &mut self.nearest);
        let driven = &segment.driven;
        let (n, nb) = (self.mechanics.n, driven.basis.len());
        let (constant, modes) = (driven.basis.constant(), shape.lambda.len());
        self.values.resize(nb, ZERO);
        driven.basis.evaluate(0.0, &mut self.values);
        self.signals.clear();
        self.begins.clear();
        self.watched.clear();
        for (i, part) in self.mechanics.parts.iter().enumerate() {
            let contact = segment.contacts[i];
            if part.is_slider() && contact == Contact::Stick {
                if shape.immobile[i] && self.excitation.imposed.iter().all(|g| g[i] == ZERO) {
                    continue; // its force is constant; rounding must not cause a switch
                }
                let force = &segment.force[i * nb..(i + 1) * nb];
                let (now, limit) = (real_dot(force, &self.values), part.static_limit());
                let sides = [1.0, -1.0].into_iter().zip(self.nearest[i]);
                for side in sides.filter_map(|(side, nearest)| nearest.then_some(side)) {
                    let at = self.signals.len();
                    self.signals.extend(force.iter().map(|f| f * -side));
                    self.signals[at + constant].re += limit;
                    let signal = &mut self.signals[at + constant];
                    self.begins.push(begin(signal, limit - side * now, settings.at_limit * limit, eased));
                    self.watched.push(i);
                }
                continue;
            }
            if !part.is_slider() && shape.immobile[i] && self.excitation.imposed.iter().all(|g| g[i] == ZERO) {
                continue;
            }
            if !self.nearest[i][usize::from(contact == Contact::SlipBackward)] {
                continue; // it stops together with another part of its joint
            }
            let at = self.signals.len();
            self.signals.resize(at + nb, ZERO);
            let signal = &mut self.signals[at..];
            // signal, sign, order of the derivative, and tolerance for zero
            let (motion, sign, order, zero) = match part.kind {
                PartKind::Stop { gap, .. } => {
                    let sign = if contact == Contact::Stick { 1.0 } else { -1.0 };
                    signal[constant].re = -sign * gap;
                    (
                        &segment.displacement,
                        sign,
                        0,
                        self.mechanics.contact_tolerance(part, self.excitation.omega, velocity_scale),
                    )
                }
                _ => (&self.velocity, contact.sign(), 1, settings.zero_velocity * velocity_scale),
            };
            for k in 0..n {
                add(signal, &motion[k * nb..(k + 1) * nb], sign * part.direction[k]);
            }
            for (h, turn) in self.work.turn.iter().enumerate() {
                let rate =
                    if order == 1 { Complex64::new(0.0, self.excitation.rates[h]) } else { Complex64::new(1.0, 0.0) };
                signal[modes + h] += self.excitation.imposed[h][i] * turn * rate * sign;
            }
            let now = real_dot(signal, &self.values);
            self.begins.push(begin(&mut signal[constant], now, zero, eased));
            self.watched.push(i);
        }
    }

    /// Ends the current segment: computes the end state and the sensitivity.
    fn finish_segment(
        &mut self,
        shape: &Pattern,
        length: f64,
        state: &mut [f64],
        sensitivity: Option<&mut DMatrix<f64>>,
    ) {
        let segment = &mut self.segments[self.used];
        segment.length = length;
        self.used += 1;
        let basis = &segment.driven.basis;
        let (n, nb) = (self.mechanics.n, basis.len());
        segment.at_end.resize(nb, ZERO);
        basis.evaluate(length, &mut segment.at_end);
        let values = &segment.at_end[..];
        for row in 0..n {
            let range = row * nb..(row + 1) * nb;
            state[row] = real_dot(&segment.displacement[range.clone()], values);
            state[n + row] = real_dot(&self.velocity[range.clone()], values);
            self.before[n + row] = real_dot(&self.acceleration[range], values);
        }
        for (i, part) in self.mechanics.parts.iter().enumerate() {
            if let Some(s) = part.state() {
                state[2 * n + s] = real_dot(&segment.force[i * nb..(i + 1) * nb], values);
            }
        }
        if let Some(sensitivity) = sensitivity {
            shape.carry(&self.mechanics, length, values, sensitivity, &mut self.work);
        }
    }

    /// Sets a spring force that reached its limit exactly to the limit.
    fn set_to_limit(&self, part: usize, state: &mut [f64]) {
        let old = self.segments[self.used - 1].contacts[part];
        if let (PartKind::Elastic { limit, state: s, .. }, Contact::Stick) = (self.mechanics.parts[part].kind, old) {
            let force = &mut state[2 * self.mechanics.n + s];
            *force = limit.copysign(*force);
        }
    }

    /// Applies the saltation matrix at a switch of `part` to the sensitivity:
    /// `S = I + (F⁺ - F⁻) ∇g / g'`.
    ///
    /// `shape` is the pattern of the segment that ends. Source: Leine and Nijmeijer (2004),
    /// Sec. 7.
    fn apply_saltation(
        &mut self,
        part: usize,
        shape: &Pattern,
        time: f64,
        state: &[f64],
        sensitivity: &mut DMatrix<f64>,
    ) {
        let n = self.mechanics.n;
        let segment = &self.segments[self.used - 1];
        let contacts = &segment.contacts;
        let body = &self.mechanics.parts[part];
        // rates of the state before and after; displacements are continuously differentiable
        for row in 0..n {
            self.after[n + row] = self.decision.acceleration[row];
            (self.before[row], self.after[row]) = (0.0, 0.0);
        }
        for (i, other) in self.mechanics.parts.iter().enumerate() {
            if let PartKind::Elastic { stiffness: kt, state: s, .. } = other.kind {
                let velocity = other.along(&state[n..2 * n]) + self.excitation.imposed_at(i, time, 1);
                let rate = |contact: Contact| if contact == Contact::Stick { kt * velocity } else { 0.0 };
                self.before[2 * n + s] = rate(contacts[i]);
                self.after[2 * n + s] = rate(self.decision.contacts[i]);
            }
        }
        self.row.fill(0.0);
        let slope = match (contacts[part], body.kind) {
            // the force of a stop is continuous
            (_, PartKind::Stop { .. }) => return,
            (Contact::Stick, PartKind::Elastic { state: s, .. }) => {
                self.row[2 * n + s] = 1.0;
                self.before[2 * n + s]
            }
            // a rigid slider begins to slip with continuous forces, so that there is no jump
            (Contact::Stick, PartKind::Rigid { .. }) if !body.force_drops() => return,
            (Contact::Stick, PartKind::Rigid { .. }) => {
                let Some(held) = shape.stuck_rigid.iter().position(|&h| h == part) else { return };
                // the stick force: λ = multiplier (F - C v - K x - other parts) + …
                for k in 0..n {
                    self.row[k] = -shape.held_by_displacement[(held, k)];
                    self.row[n + k] = -shape.held_by_velocity[(held, k)];
                }
                for (i, other) in self.mechanics.parts.iter().enumerate() {
                    let factor = -shape.held_by_parts[(held, i)];
                    match other.kind {
                        PartKind::Elastic { state: s, .. } if contacts[i] == Contact::Stick => {
                            self.row[2 * n + s] = factor
                        }
                        PartKind::Stop { stiffness, .. } if contacts[i] == Contact::Stick => {
                            self.row.rows_mut(0, n).axpy(factor * stiffness, &other.direction, 1.0);
                        }
                        _ => {}
                    }
                }
                let basis = segment.basis();
                let nb = basis.len();
                self.rate.resize(nb, ZERO);
                basis.differentiate(&segment.force[part * nb..(part + 1) * nb], &mut self.rate);
                real_dot(&self.rate, &segment.at_end)
            }
            _ => {
                for k in 0..n {
                    self.row[n + k] = body.direction[k];
                }
                body.direction.dot(&self.before.rows(n, n)) + self.excitation.imposed_at(part, time, 2)
            }
        };
        if slope == 0.0 {
            // grazing: the derivative does not exist; take the one-sided one without a switch
            return;
        }
        self.after -= &self.before;
        for mut column in sensitivity.column_iter_mut() {
            let along = self.row.dot(&column) / slope;
            column.axpy(along, &self.after, 1.0);
        }
    }
}

/// Selects the parts that are monitored, forward and backward. `springs` are the forces of
/// sliders in series with springs.
///
/// The parts of one joint share its displacement. Of the stuck ones, only the part that reaches
/// its limit first is monitored; of the slipping ones, only one.
fn monitored_parts(parts: &[JointPart], contacts: &[Contact], springs: &[f64], out: &mut Vec<[bool; 2]>) {
    out.clear();
    out.resize(parts.len(), [true; 2]);
    let mut first = 0;
    for joint in parts.chunk_by(|a, b| a.joint == b.joint) {
        let range = first..first + joint.len();
        first = range.end;
        if joint.len() == 1 {
            continue;
        }
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            let (mut room, mut sticking, mut slipping) = (f64::INFINITY, None, None);
            for i in range.clone() {
                let PartKind::Elastic { stiffness, limit, state } = parts[i].kind else { continue };
                out[i][side] = false;
                let left = (limit - sign * springs[state]) / stiffness;
                if contacts[i] == Contact::Stick && left < room {
                    (room, sticking) = (left, Some(i));
                } else if contacts[i].sign() == sign {
                    slipping.get_or_insert(i);
                }
            }
            sticking.into_iter().chain(slipping).for_each(|i| out[i][side] = true);
        }
    }
}

/// Adds a multiple of a signal.
#[inline]
fn add(sum: &mut [Complex64], signal: &[Complex64], factor: f64) {
    if factor != 0.0 {
        for (s, x) in sum.iter_mut().zip(signal) {
            *s += x * factor;
        }
    }
}

/// Returns the initial sign of a signal, from its value and the tolerance for zero. If `eased`,
/// a signal that begins at zero is raised above zero through its constant part.
fn begin(constant: &mut Complex64, value: f64, zero: f64, eased: bool) -> InitialSign {
    if value > zero {
        InitialSign::Positive
    } else if eased {
        constant.re += 2.0 * zero;
        InitialSign::Positive
    } else {
        InitialSign::Zero(zero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Gap, Iwan, Jenkins, SharedLaw, Stribeck};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring};
    use std::sync::Arc;

    /// Two masses with a law each to the ground and one between them, excited by the first and
    /// third harmonic.
    fn flow(laws: [SharedLaw; 3]) -> SegmentedMotion {
        let between = [["a", GROUND], ["b", GROUND], ["a", "b"]].map(|pair| pair.map(str::to_owned));
        let joints = between.iter().zip(laws).enumerate();
        let model = Model {
            masses: vec![Mass::new("a", 1.0), Mass::new("b", 1.3)],
            springs: between
                .iter()
                .map(|between| Spring { between: between.clone(), stiffness: 0.9, damping: 0.05 })
                .collect(),
            joints: joints
                .map(|(i, (between, law))| Joint { name: format!("j{i}"), between: between.clone(), law })
                .collect(),
            forces: [(1, 1.2), (3, 0.4)]
                .map(|(harmonic, amplitude)| Force { on: "a".into(), amplitude, phase: 0.2, harmonic })
                .to_vec(),
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let mechanics = Mechanics::new(&system, "test").unwrap();
        let excitation = HarmonicExcitation::new(&system, &mechanics.part_joints(), 0.7);
        let mut flow = SegmentedMotion::new(mechanics, HarmonicExcitation::default());
        flow.set_excitation(excitation);
        flow
    }

    /// With many parallel sliders, the sensitivity equals the effect of a small change of the
    /// initial state on the end state. Parts that are not monitored follow their own force.
    #[test]
    fn sensitivities_pass_many_sliders() {
        let many: SharedLaw = Arc::new(Iwan { stiffness: 2.0, limit: 0.6, chi: -0.5, beta: 0.3, elements: 24 });
        let spring: SharedLaw = Arc::new(Jenkins { stiffness: 2.0, limit: 0.2 });
        let mut flow = flow([many.clone(), spring, many]);
        let states = flow.mechanics.states();
        assert!(states > 50);
        let mut start = vec![0.0; states];
        start[..4].copy_from_slice(&[0.5, -0.3, 0.4, -0.6]);
        let mut derivative = DMatrix::identity(states, states);
        let mut end = start.clone();
        flow.run(&mut end, 0.0, 9.0, Some(&mut derivative)).unwrap();
        assert!(flow.segments().len() > 30);
        for segment in flow.segments() {
            let nb = segment.basis().len();
            let mut values = vec![ZERO; nb];
            segment.basis().evaluate(segment.length, &mut values);
            for (i, part) in flow.mechanics.parts.iter().enumerate() {
                let force = real_dot(&segment.force[i * nb..(i + 1) * nb], &values);
                assert!(force.abs() <= part.limit() * (1.0 + 1e-9), "{i}: {force} of {}", part.limit());
            }
        }
        let step = 1e-7;
        for column in (0..states).step_by(3) {
            let mut ends = [start.clone(), start.clone()];
            ends[0][column] += step;
            ends[1][column] -= step;
            for end in &mut ends {
                flow.run(end, 0.0, 9.0, None).unwrap();
            }
            for row in 0..states {
                let (slope, exact) = ((ends[0][row] - ends[1][row]) / (2.0 * step), derivative[(row, column)]);
                assert!((slope - exact).abs() < 1e-5 * (1.0 + exact.abs()), "{row} by {column}: {exact} and {slope}");
            }
        }
    }

    /// The sensitivity equals the effect of a small change of the initial state on the end
    /// state. The motion passes stops that open and close, and sliders with a drop of force
    /// after stuck sliders, springs and stops.
    #[test]
    fn sensitivities_pass_stops_and_drops() {
        let stop: SharedLaw = Arc::new(Gap { gap: 0.1, stiffness: 3.0 });
        let pressed: SharedLaw = Arc::new(Gap { gap: -0.2, stiffness: 1.5 });
        let dropping: SharedLaw = Arc::new(Stribeck { limit: 0.3, static_limit: 0.5, velocity: 0.0 });
        let weak: SharedLaw = Arc::new(Stribeck { limit: 0.1, static_limit: 0.2, velocity: 0.0 });
        let spring: SharedLaw = Arc::new(Jenkins { stiffness: 2.0, limit: 0.2 });
        let rigid: SharedLaw = Arc::new(Coulomb { limit: 0.15 });
        let cases = [
            [stop.clone(), pressed.clone(), spring.clone()],
            [dropping.clone(), stop.clone(), spring.clone()],
            [dropping.clone(), weak.clone(), stop.clone()],
            [dropping.clone(), rigid.clone(), weak.clone()],
            [rigid, dropping, pressed],
        ];
        let mut drops = 0;
        for (case, laws) in cases.into_iter().enumerate() {
            let mut flow = flow(laws);
            let states = flow.mechanics.states();
            for duration in [5.0, 9.0, 14.0] {
                let start: Vec<f64> = (0..states).map(|i| [0.5, -0.3, 0.4, -0.6, 0.05][i]).collect();
                let mut derivative = DMatrix::identity(states, states);
                flow.run(&mut start.clone(), 0.0, duration, Some(&mut derivative)).unwrap();
                for pair in flow.segments().windows(2) {
                    let let_go = |s: &usize| pair[0].contacts[*s] == Contact::Stick && pair[1].contacts[*s].slips();
                    drops += (0..flow.mechanics.parts.len())
                        .filter(|s| flow.mechanics.parts[*s].force_drops() && let_go(s))
                        .count();
                }
                let step = 1e-6;
                for column in 0..states {
                    let mut ends = [start.clone(), start.clone()];
                    ends[0][column] += step;
                    ends[1][column] -= step;
                    for end in &mut ends {
                        flow.run(end, 0.0, duration, None).unwrap();
                    }
                    for row in 0..states {
                        let slope = (ends[0][row] - ends[1][row]) / (2.0 * step);
                        let exact = derivative[(row, column)];
                        let what = format!("case {case}, {duration} s, {row} by {column}: {exact} and {slope}");
                        assert!((slope - exact).abs() < 1e-6 * (1.0 + exact.abs()), "{what}");
                    }
                }
            }
        }
        assert!(drops > 5, "{drops} drops");
    }
}
