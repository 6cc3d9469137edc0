//! Transitions between stick and slip, open and closed: determines the pattern that begins at
//! an instant.
//!
//! Sliders with a relative velocity continue to slip. For rigid sliders at zero velocity,
//! accelerations and friction forces solve a box complementarity problem for all of them
//! together. The result does not depend on their order. A nonzero acceleration means slip; a
//! force inside its limit means stick. At the end of stick, the force is usually exactly at its
//! limit and the acceleration is zero. Then the same problem for the next derivative decides,
//! and so on.
//!
//! A slider whose static limit exceeds its dynamic one loses force at the onset of slip, so
//! that both stick and slip can be possible. Sliders stick as long as possible. The problem is
//! first solved with static limits. Sliders that slip in this solution receive their dynamic
//! limits, all at once. The problem is then solved again for the others. A slider that the new
//! forces drive backwards sticks again.
//!
//! Forces of springs and stops are continuous. The first nonzero derivative decides on their
//! next contact state.
//!
//! Source: Glocker, "Set-Valued Force Laws" (2001), Ch. 10; Leine and Nijmeijer (2004), Ch. 6.

use super::mechanics::{JointPart, Mechanics, PartKind};
use super::settings::EventDrivenSettings;
use crate::law::Contact;
use crate::method::flow::excitation::HarmonicExcitation;
use nalgebra::{DMatrix, DVector};
use stickslip_numerics::complementarity;

/// The contacts after a transition, with the accelerations.
#[derive(Debug, Clone)]
pub(crate) struct Transition {
    pub contacts: Vec<Contact>,
    /// Acceleration right after the instant, length n, m/s².
    pub acceleration: DVector<f64>,
    /// Largest force on a mass without those of rigid sliders at zero velocity, N.
    pushed: f64,
    /// Accelerations due to unit forces of the sliders, `M⁻¹ W`, n × sliders. `delassus`
    /// contains the relative accelerations, `Wᵀ M⁻¹ W`.
    response: DMatrix<f64>,
    delassus: DMatrix<f64>,
    free: DVector<f64>,
    at_rest: Vec<usize>,
    /// Rigid sliders at zero velocity whose force has not dropped. `dropped` contains those
    /// whose force has dropped.
    resting: Vec<usize>,
    dropped: Vec<usize>,
    /// Undecided sliders, with the sign of their force.
    undecided: Vec<(usize, f64)>,
    problem: ContactProblem,
    /// x, v, a, jerk, …: each is the derivative of the previous one.
    derivatives: Vec<DVector<f64>>,
}

/// Magnitude of the terms of accelerations: the largest force on a mass (N), the imposed
/// accelerations (m/s²), and their rates of change (rad/s) for each part.
struct AccelerationScale<'a> {
    force: f64,
    imposed: f64,
    omega: f64,
    fastest: &'a [f64],
}

impl AccelerationScale<'_> {
    /// Returns the magnitude of the terms in the derivative of this order (2: acceleration) of
    /// the motion along a part. `response` contains the accelerations due to a unit force of
    /// the part.
    fn size(&self, part: usize, response: &DMatrix<f64>, order: u32) -> f64 {
        let acceleration = response.column(part).amax() * self.force + self.imposed;
        acceleration * self.omega.max(self.fastest[part]).powi(order as i32 - 2)
    }
}

/// The complementarity problem of the sliders at zero velocity, with its solution.
#[derive(Debug, Clone, Default)]
struct ContactProblem {
    /// `Wᵀ M⁻¹ W`
    delassus: DMatrix<f64>,
    push: DVector<f64>,
    low: DVector<f64>,
    high: DVector<f64>,
    lambda: DVector<f64>,
    /// Relative acceleration: `push` minus the effect of the forces `lambda`.
    relative: DVector<f64>,
    /// Effect of the forces `lambda`.
    held: DVector<f64>,
}

impl ContactProblem {
    fn resize(&mut self, count: usize) {
        if self.push.len() != count {
            self.delassus = DMatrix::zeros(count, count);
            for vector in
                [&mut self.push, &mut self.low, &mut self.high, &mut self.lambda, &mut self.relative, &mut self.held]
            {
                *vector = DVector::zeros(count);
            }
        }
    }

    fn solve(&mut self) -> bool {
        if !complementarity::solve_into(&self.delassus, &self.push, &self.low, &self.high, &mut self.lambda) {
            return false;
        }
        multiply(&self.delassus, &self.lambda, &mut self.held);
        for ((relative, push), held) in self.relative.iter_mut().zip(&self.push).zip(&self.held) {
            *relative = push - held;
        }
        true
    }
}

impl Transition {
    pub fn new(mechanics: &Mechanics) -> Self {
        let settings = EventDrivenSettings::default();
        let count = mechanics.parts.len();
        let mut response = DMatrix::zeros(mechanics.n, count);
        for (i, part) in mechanics.parts.iter().enumerate() {
            response.set_column(i, &(&mechanics.inverse_mass * &part.direction));
        }
        let delassus = DMatrix::from_fn(count, count, |a, b| mechanics.parts[a].direction.dot(&response.column(b)));
        Transition {
            response,
            delassus,
            contacts: vec![Contact::Stick; count],
            acceleration: DVector::zeros(mechanics.n),
            pushed: 0.0,
            free: DVector::zeros(mechanics.n),
            at_rest: Vec::new(),
            resting: Vec::new(),
            dropped: Vec::new(),
            undecided: Vec::new(),
            problem: ContactProblem::default(),
            derivatives: vec![DVector::zeros(mechanics.n); settings.derivatives as usize + 3],
        }
    }

    /// Determines the contacts at `time` for `state`. `velocity_scale` is the largest relative
    /// velocity of the motion (m/s).
    ///
    /// Returns false if the complementarity problem has no solution, which requires an
    /// indefinite mass matrix. It also returns false if sliders with dropping forces drive each
    /// other back and forth.
    pub fn determine(
        &mut self,
        mechanics: &Mechanics,
        excitation: &HarmonicExcitation,
        time: f64,
        state: &[f64],
        velocity_scale: f64,
    ) -> bool {
        let settings = EventDrivenSettings::default();
        let n = mechanics.n;
        let (x, v) = (&state[..n], &state[n..2 * n]);
        let still = settings.zero_velocity * velocity_scale;
        self.resting.clear();
        self.dropped.clear();
        let mut springs_undecided = false;
        for (i, part) in mechanics.parts.iter().enumerate() {
            let velocity = part.along(v) + excitation.imposed_at(i, time, 1);
            self.contacts[i] = match part.kind {
                PartKind::Rigid { .. } if velocity.abs() > still => Contact::slip(velocity),
                PartKind::Rigid { .. } => {
                    self.resting.push(i);
                    Contact::Stick
                }
                PartKind::Elastic { limit, state: s, .. } => {
                    let force = state[2 * n + s];
                    if force.abs() < limit * (1.0 - settings.at_limit) {
                        Contact::Stick
                    } else if velocity.abs() > still {
                        if velocity * force > 0.0 { Contact::slip(force) } else { Contact::Stick }
                    } else {
                        springs_undecided = true;
                        Contact::Stick
                    }
                }
                PartKind::Stop { gap, .. } => {
                    let depth = part.along(x) + excitation.imposed_at(i, time, 0) - gap;
                    if depth.abs() > mechanics.contact_tolerance(part, excitation.omega, velocity_scale) {
                        closed(depth)
                    } else if velocity.abs() > still {
                        closed(velocity)
                    } else {
                        springs_undecided = true;
                        Contact::Open
                    }
                }
            };
        }
        // each round releases sliders or returns one to stick
        for _ in 0..=2 * self.resting.len() {
            self.accelerate(mechanics, excitation, time, state);
            self.at_rest.clone_from(&self.resting);
            if !self.decide_rigid(mechanics, excitation, time, state) {
                return false;
            }
            if !self.release(mechanics, excitation, time) {
                if springs_undecided {
                    self.decide_springs(mechanics, excitation, time, state, velocity_scale);
                }
                return true;
            }
        }
        false
    }

    /// Computes the accelerations without the forces of rigid sliders at zero velocity.
    fn accelerate(&mut self, mechanics: &Mechanics, excitation: &HarmonicExcitation, time: f64, state: &[f64]) {
        let n = mechanics.n;
        let (x, v) = (&state[..n], &state[n..2 * n]);
        self.free.fill(0.0);
        excitation.add_force(time, 0, &mut self.free);
        subtract_product(&mechanics.damping, v, &mut self.free);
        subtract_product(&mechanics.stiffness, x, &mut self.free);
        for (i, part) in mechanics.parts.iter().enumerate() {
            let force = match (part.kind, self.contacts[i]) {
                (PartKind::Elastic { state: s, .. }, _) => state[2 * n + s],
                (PartKind::Stop { stiffness, gap }, Contact::Stick) => {
                    stiffness * (part.along(x) + excitation.imposed_at(i, time, 0) - gap)
                }
                (_, contact) => part.constant_force(contact),
            };
            if force != 0.0 {
                self.free.axpy(-force, &part.direction, 1.0);
            }
        }
        multiply(&mechanics.inverse_mass, &self.free, &mut self.acceleration);
        self.pushed = self.free.amax();
    }

    /// Moves sliders whose force drops from `resting` to `dropped`, or returns one slider that
    /// is driven backwards. Returns whether anything changed.
    fn release(&mut self, mechanics: &Mechanics, excitation: &HarmonicExcitation, time: f64) -> bool {
        let settings = EventDrivenSettings::default();
        let lets_go = |i: usize| self.contacts[i] != Contact::Stick && mechanics.parts[i].force_drops();
        if self.dropped.is_empty() && !self.resting.iter().any(|&i| lets_go(i)) {
            return false;
        }
        let terms = self.terms(mechanics, excitation);
        let back = self.dropped.iter().position(|&i| {
            let relative = mechanics.parts[i].direction.dot(&self.acceleration) + excitation.imposed_at(i, time, 2);
            relative * self.contacts[i].sign() < -settings.zero_acceleration * terms.size(i, &self.response, 2)
        });
        let contacts = &mut self.contacts;
        if let Some(back) = back {
            self.resting.push(self.dropped.swap_remove(back));
            self.resting.sort_unstable();
        }
        let before = self.dropped.len();
        let dropped = &mut self.dropped;
        if back.is_none() {
            self.resting.retain(|&i| {
                let drops = contacts[i] != Contact::Stick && mechanics.parts[i].force_drops();
                if drops {
                    dropped.push(i);
                }
                !drops
            });
        }
        let again = back.is_some() || dropped.len() > before;
        if again {
            self.resting.iter().for_each(|&i| contacts[i] = Contact::Stick);
        }
        again
    }

    /// Decides on rigid sliders at zero velocity: by accelerations first, then by higher
    /// derivatives for those at their limit.
    fn decide_rigid(
        &mut self,
        mechanics: &Mechanics,
        excitation: &HarmonicExcitation,
        time: f64,
        state: &[f64],
    ) -> bool {
        let settings = EventDrivenSettings::default();
        if self.at_rest.is_empty() {
            return true;
        }
        self.set_up_problem(mechanics, excitation, time, 2, None);
        let problem = &mut self.problem;
        for (k, &i) in self.at_rest.iter().enumerate() {
            let limit = mechanics.parts[i].static_limit();
            (problem.low[k], problem.high[k]) = (-limit, limit);
        }
        if !problem.solve() {
            return false;
        }
        self.undecided.clear();
        for (k, &i) in self.at_rest.iter().enumerate() {
            let (relative, lambda) = (problem.relative[k], problem.lambda[k]);
            // relative to the effect of the limits at its own masses, because another joint can
            // connect much lighter masses
            let own = problem.delassus.column(k);
            let held: f64 = own.iter().zip(&problem.high).map(|(d, limit)| d.abs() * limit).sum();
            let size = problem.push[k].abs() + held;
            if relative.abs() > settings.zero_acceleration * size {
                // a joint that only imposed motion moves has no force here
                self.contacts[i] = Contact::slip(relative);
            } else if lambda.abs() >= problem.high[k] * (1.0 - settings.at_limit) {
                self.undecided.push((i, lambda.signum()));
            }
            self.acceleration.axpy(-lambda, &self.response.column(i), 1.0);
        }
        if !self.undecided.is_empty() {
            self.settle_derivatives(mechanics, excitation, time, state);
        }
        true
    }

    /// Returns the magnitude of the terms of accelerations, for all parts together.
    fn terms<'a>(&self, mechanics: &'a Mechanics, excitation: &HarmonicExcitation) -> AccelerationScale<'a> {
        let limit = mechanics.parts.iter().filter(|p| p.is_slider()).map(JointPart::static_limit).fold(0.0, f64::max);
        let imposed = excitation
            .rates
            .iter()
            .zip(&excitation.imposed)
            .map(|(rate, g)| rate * rate * g.iter().map(|g| g.norm()).fold(0.0, f64::max));
        AccelerationScale {
            force: self.pushed + limit,
            imposed: imposed.sum(),
            omega: excitation.omega,
            fastest: &mechanics.fastest_along,
        }
    }

    /// Sets up the problem of the sliders at zero velocity, without its bounds.
    ///
    /// The unknown is their relative acceleration (`order` 2) or a higher derivative. It comes
    /// from the derivative with index `derivative`, or from the acceleration, plus the imposed
    /// motion.
    fn set_up_problem(
        &mut self,
        mechanics: &Mechanics,
        excitation: &HarmonicExcitation,
        time: f64,
        order: u32,
        derivative: Option<usize>,
    ) {
        let problem = &mut self.problem;
        problem.resize(self.at_rest.len());
        let motion = derivative.map_or(&self.acceleration, |at| &self.derivatives[at]);
        for (a, &i) in self.at_rest.iter().enumerate() {
            for (b, &j) in self.at_rest.iter().enumerate() {
                problem.delassus[(a, b)] = self.delassus[(i, j)];
            }
            problem.push[a] = mechanics.parts[i].direction.dot(motion) + excitation.imposed_at(i, time, order);
        }
    }

    /// Stores displacement, velocity and acceleration in the list of derivatives.
    fn begin_derivatives(&mut self, n: usize, state: &[f64]) {
        self.derivatives[0].copy_from_slice(&state[..n]);
        self.derivatives[1].copy_from_slice(&state[n..2 * n]);
        self.derivatives[2].copy_from(&self.acceleration);
    }

    /// Decides on sliders exactly at their limit with zero acceleration. `undecided` contains
    /// them with the sign of their force.
    fn settle_derivatives(&mut self, mechanics: &Mechanics, excitation: &HarmonicExcitation, time: f64, state: &[f64]) {
        let settings = EventDrivenSettings::default();
        self.begin_derivatives(mechanics.n, state);
        let terms = self.terms(mechanics, excitation);
        for level in 1..settings.derivatives {
            self.at_rest.retain(|i| self.contacts[*i] == Contact::Stick);
            self.free_derivative(mechanics, excitation, time, level);
            let next = level as usize + 2;
            multiply(&mechanics.inverse_mass, &self.free, &mut self.derivatives[next]);
            self.set_up_problem(mechanics, excitation, time, level + 2, Some(next));
            let problem = &mut self.problem;
            for (k, i) in self.at_rest.iter().enumerate() {
                // a force at its limit can only decrease
                let sign = self.undecided.iter().find(|(s, _)| s == i).map_or(0.0, |(_, sign)| *sign);
                problem.low[k] = if sign < 0.0 { 0.0 } else { f64::NEG_INFINITY };
                problem.high[k] = if sign > 0.0 { 0.0 } else { f64::INFINITY };
            }
            if !problem.solve() {
                return;
            }
            let (contacts, at_rest, response) = (&mut self.contacts, &self.at_rest, &self.response);
            self.undecided.retain(|&(i, sign)| {
                let Some(k) = at_rest.iter().position(|&rest| rest == i) else { return false };
                let size = problem.push[k].abs().max(problem.held[k].abs()).max(terms.size(i, response, level + 2));
                if problem.relative[k] * sign > settings.zero_acceleration * size && size > 0.0 {
                    contacts[i] = Contact::slip(sign);
                    return false;
                }
                problem.lambda[k] * sign * problem.delassus[(k, k)] > -settings.zero_acceleration * size
            });
            for (k, &i) in self.at_rest.iter().enumerate() {
                self.derivatives[next].axpy(-problem.lambda[k], &self.response.column(i), 1.0);
            }
            if self.undecided.is_empty() {
                return;
            }
        }
    }

    /// Computes the `level`-th derivative of all forces except those of rigid sliders at zero
    /// velocity, in `self.free`.
    fn free_derivative(&mut self, mechanics: &Mechanics, excitation: &HarmonicExcitation, time: f64, level: u32) {
        let (l, derivatives) = (level as usize, &self.derivatives);
        self.free.fill(0.0);
        excitation.add_force(time, level, &mut self.free);
        subtract_product(&mechanics.damping, derivatives[l + 1].as_slice(), &mut self.free);
        subtract_product(&mechanics.stiffness, derivatives[l].as_slice(), &mut self.free);
        for (i, part) in mechanics.parts.iter().enumerate() {
            if let (Some(kt), Contact::Stick) = (part.stiffness(), self.contacts[i]) {
                let force = kt * (part.direction.dot(&derivatives[l]) + excitation.imposed_at(i, time, level));
                self.free.axpy(-force, &part.direction, 1.0);
            }
        }
    }

    /// Decides on sliders in series with springs at their limit and on stops at their gap, for
    /// zero relative velocity. The first nonzero derivative decides.
    fn decide_springs(
        &mut self,
        mechanics: &Mechanics,
        excitation: &HarmonicExcitation,
        time: f64,
        state: &[f64],
        velocity_scale: f64,
    ) {
        let settings = EventDrivenSettings::default();
        let n = mechanics.n;
        let still = settings.zero_velocity * velocity_scale;
        let mut undecided: Vec<(usize, f64)> = (0..mechanics.parts.len())
            .filter_map(|i| {
                let part = &mechanics.parts[i];
                let velocity = part.along(&state[n..2 * n]) + excitation.imposed_at(i, time, 1);
                let (at_border, sign) = match part.kind {
                    PartKind::Rigid { .. } => return None,
                    PartKind::Elastic { limit, state: s, .. } => {
                        let force = state[2 * n + s];
                        (force.abs() >= limit * (1.0 - settings.at_limit), force.signum())
                    }
                    PartKind::Stop { gap, .. } => {
                        let depth = part.along(&state[..n]) + excitation.imposed_at(i, time, 0) - gap;
                        (depth.abs() <= mechanics.contact_tolerance(part, excitation.omega, velocity_scale), 1.0)
                    }
                };
                (at_border && velocity.abs() <= still).then_some((i, sign))
            })
            .collect();
        self.begin_derivatives(n, state);
        let terms = self.terms(mechanics, excitation);
        for level in 1..=settings.derivatives {
            let order = level + 1;
            undecided.retain(|&(i, sign)| {
                let size = terms.size(i, &self.response, order);
                let part = &mechanics.parts[i];
                let slope =
                    part.direction.dot(&self.derivatives[order as usize]) + excitation.imposed_at(i, time, order);
                if slope.abs() <= settings.zero_acceleration * size {
                    return true;
                }
                if slope * sign > 0.0 {
                    self.contacts[i] = if part.is_slider() { Contact::slip(sign) } else { Contact::Stick };
                }
                false
            });
            if undecided.is_empty() || level == settings.derivatives {
                return;
            }
            // the next derivative with the present contacts: rigid sliders at zero velocity
            // stick
            self.at_rest.retain(|i| self.contacts[*i] == Contact::Stick);
            self.free_derivative(mechanics, excitation, time, level);
            let next = level as usize + 2;
            multiply(&mechanics.inverse_mass, &self.free, &mut self.derivatives[next]);
            if !self.at_rest.is_empty() {
                self.set_up_problem(mechanics, excitation, time, level + 2, Some(next));
                self.problem.low.fill(f64::NEG_INFINITY);
                self.problem.high.fill(f64::INFINITY);
                if !self.problem.solve() {
                    return;
                }
                for (k, &i) in self.at_rest.iter().enumerate() {
                    self.derivatives[next].axpy(-self.problem.lambda[k], &self.response.column(i), 1.0);
                }
            }
        }
    }
}

/// Returns the contact state of a stop from the sign of its depth.
fn closed(depth: f64) -> Contact {
    if depth > 0.0 { Contact::Stick } else { Contact::Open }
}

fn subtract_product(matrix: &DMatrix<f64>, vector: &[f64], out: &mut DVector<f64>) {
    for (j, value) in vector.iter().enumerate() {
        if *value != 0.0 {
            out.axpy(-*value, &matrix.column(j), 1.0);
        }
    }
}

fn multiply(matrix: &DMatrix<f64>, vector: &DVector<f64>, out: &mut DVector<f64>) {
    out.gemv(1.0, matrix, vector, 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Stribeck;
    use crate::model::{Force, GROUND, Joint, Mass, Model};
    use std::sync::Arc;

    /// Returns the contacts and accelerations of two masses of 1 kg at rest under constant
    /// forces (N). The first mass has friction with the ground and with the second mass, each
    /// with (dynamic, static limit).
    fn decided(forces: [f64; 2], limits: [(f64, f64); 2]) -> (Vec<Contact>, [f64; 2]) {
        let law = |(limit, static_limit): (f64, f64)| Arc::new(Stribeck { limit, static_limit, velocity: 0.0 });
        let joint = |name: &str, other: &str, limits| Joint {
            name: name.into(),
            between: ["a".into(), other.into()],
            law: law(limits),
        };
        let force = |on: &str, amplitude: f64| Force { on: on.into(), amplitude, phase: 0.0, harmonic: 0 };
        let model = Model {
            masses: vec![Mass::new("a", 1.0), Mass::new("b", 1.0)],
            joints: vec![joint("floor", GROUND, limits[0]), joint("between", "b", limits[1])],
            forces: vec![force("a", forces[0]), force("b", forces[1])],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let mechanics = Mechanics::new(&system, "test").unwrap();
        let excitation = HarmonicExcitation::new(&system, &mechanics.part_joints(), 1.0);
        let mut decision = Transition::new(&mechanics);
        assert!(decision.determine(&mechanics, &excitation, 0.0, &[0.0; 4], 1.0));
        (decision.contacts.clone(), [decision.acceleration[0], decision.acceleration[1]])
    }

    #[test]
    fn what_rests_holds_up_to_its_static_limit() {
        use Contact::{SlipBackward, SlipForward, Stick};
        let check = |forces, limits, contacts: [Contact; 2], acceleration: [f64; 2]| {
            let (found, motion) = decided(forces, limits);
            assert_eq!(found, contacts, "{forces:?}");
            assert!((0..2).all(|i| (motion[i] - acceleration[i]).abs() < 1e-12), "{motion:?}");
        };
        // between both limits, the slider could slip, but it sticks
        check([3.0, 0.0], [(1.0, 5.0), (0.5, 1.0)], [Stick, Stick], [0.0, 0.0]);
        // above the static limit, it slips with the dynamic one: both masses together, 4 N on 2
        // kg, or separately
        check([6.0, 0.0], [(2.0, 5.0), (1.0, 3.0)], [SlipForward, Stick], [2.0, 2.0]);
        check([6.0, 0.0], [(2.0, 5.0), (0.5, 1.0)], [SlipForward, SlipForward], [3.5, 0.5]);
        check([0.0, 6.0], [(0.5, 9.0), (1.0, 2.0)], [Stick, SlipBackward], [0.0, 5.0]);
        // the second slips backwards as long as the ground holds the first with 5 N; the
        // remaining 1 N drives it forwards, so that it sticks again
        check([10.0, 8.0], [(1.0, 5.0), (0.5, 1.0)], [SlipForward, Stick], [8.5, 8.5]);
    }
}
