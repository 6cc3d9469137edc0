//! Evaluation of a law over a step: the force and the states at its end, with all derivatives.
//!
//! A law with a step view is evaluated by it. In a plane, a step resolves the direction of slip
//! only to first order. Therefore it is also evaluated in two halves and extrapolated:
//! `2 (two halves) - (whole)`. The force of an ideal slider in series with a spring follows the
//! displacement up to its limit; a stop depends on the displacement alone. A law with a rate
//! view is integrated by the trapezoidal rule, `z₁ = z₀ + h/2 (g₀ + g₁)`.

use crate::law::{Contact, IdealElement, MAX_DIRECTIONS, RatePoint, RelativeMotion, SharedLaw, StepPoint};
use crate::method::flow::assembly::IndexedLaw;
use stickslip_numerics::small_lu::SmallLu;

/// The view used to evaluate a law.
#[derive(Debug, Clone, Copy, PartialEq)]
enum LawView {
    IdealElements,
    Step,
    Rate,
}

/// Returns the view of a law, if it has one: ideal elements without rigid sliders, a step, or a
/// rate.
fn view(law: &SharedLaw) -> Option<LawView> {
    let steps = |element: &IdealElement| match element {
        IdealElement::Slider(slider) => {
            slider.static_limit == 0.0 || (slider.stiffness.is_some() && slider.static_limit == slider.limit)
        }
        IdealElement::Stop { .. } => true,
    };
    if law.ideal_elements().is_some_and(|elements| elements.iter().all(steps)) {
        return Some(LawView::IdealElements);
    }
    match (law.step(), law.rate()) {
        (Some(_), _) => Some(LawView::Step),
        (None, Some(_)) => Some(LawView::Rate),
        (None, None) => None,
    }
}

/// Returns the ideal elements with a nonzero force.
fn elements(law: &SharedLaw) -> Vec<IdealElement> {
    let carries =
        |element: &IdealElement| !matches!(element, IdealElement::Slider(slider) if slider.static_limit == 0.0);
    law.ideal_elements().unwrap_or_default().into_iter().filter(carries).collect()
}

/// Returns stiffness (N/m) and limit (N) of the sliders whose forces are the states of a law
/// evaluated by its ideal elements, in their order.
pub(super) fn springs(law: &SharedLaw) -> Vec<(f64, f64)> {
    if view(law) != Some(LawView::IdealElements) {
        return Vec::new();
    }
    let slider = |element: IdealElement| match element {
        IdealElement::Slider(slider) => Some((slider.stiffness?, slider.limit)),
        IdealElement::Stop { .. } => None,
    };
    elements(law).into_iter().filter_map(slider).collect()
}

/// Returns the states of a law after a slow straight motion within one second.
///
/// A law that depends on the path alone takes one step; a law with a rate view takes many small
/// ones. The states are unchanged if a step has no solution.
pub(crate) fn states_after_motion(
    law: &SharedLaw,
    (directions, state_scale): (usize, f64),
    (from, states): ([f64; MAX_DIRECTIONS], &[f64]),
    to: [f64; MAX_DIRECTIONS],
) -> Vec<f64> {
    let placed = IndexedLaw {
        joint: String::new(),
        law: law.clone(),
        first_axis: 0,
        directions,
        first_state: 0,
        states: states.len(),
        state_scale,
    };
    let mut follower = LawIntegrator::new(&placed);
    // Number of steps of a slow motion for a law with a rate view. The trapezoidal rule then has a
    // relative error below 1e-6.
    let steps = if follower.view == LawView::Rate { 2000 } else { 1 };
    let at = |step: usize| RelativeMotion {
        displacement: std::array::from_fn(|a| from[a] + (to[a] - from[a]) * step as f64 / steps as f64),
        velocity: std::array::from_fn(|a| to[a] - from[a]),
    };
    let mut z = states.to_vec();
    for step in 1..=steps {
        let begin = LawInstant { motion: at(step - 1), z: &z };
        follower.begin(law, begin);
        if !follower.advance(law, begin, &at(step), 1.0 / steps as f64) {
            return states.to_vec();
        }
        z.clone_from(&follower.state);
    }
    z
}

/// Returns the number of states of a law in this method, and their scale.
pub(crate) fn states(law: &SharedLaw) -> Option<(usize, f64)> {
    match view(law)? {
        LawView::IdealElements => {
            let sliders = elements(law).iter().filter(|element| matches!(element, IdealElement::Slider(_))).count();
            let scale = law.force_scale();
            Some((sliders, if scale.is_finite() && scale > 0.0 { scale } else { 1.0 }))
        }
        LawView::Step => law.step().map(|step| (step.states(), step.state_scale())),
        LawView::Rate => law.rate().map(|rate| (rate.states(), rate.state_scale())),
    }
}

/// Motion and states of a law at one instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct LawInstant<'a> {
    pub motion: RelativeMotion<f64>,
    pub z: &'a [f64],
}

/// Integrates one law, with its scratch memory.
#[derive(Debug, Clone)]
pub(super) struct LawIntegrator {
    view: LawView,
    elements: Vec<IdealElement>,
    directions: usize,
    states: usize,
    state_scale: f64,
    /// Force (N) and states at the end of the step.
    pub force: [f64; MAX_DIRECTIONS],
    pub state: Vec<f64>,
    /// Derivatives of the forces, then of the states, with respect to (u₀, u₀', z₀, u₁, u₁').
    slopes: Vec<f64>,
    slipping: Option<f64>,
    /// The whole step, and its halves.
    step: StepPoint,
    halves: [StepPoint; 2],
    before: RatePoint,
    after: RatePoint,
    lu: SmallLu,
    change: Vec<f64>,
}

/// Settings of Newton's method for the states at the end of a step.
#[derive(Debug, Clone, Copy)]
struct LawStepSettings {
    /// Largest number of iterations.
    iterations: usize,
    /// Largest change of a state per iteration, in units of its scale. Without this limit, a law
    /// that is exponential in its states would diverge.
    max_state_change: f64,
    /// Relative change of the states that ends the iteration.
    tolerance: f64,
    /// Relative change that is accepted if rounding prevents further convergence.
    accepted_change: f64,
}

impl Default for LawStepSettings {
    fn default() -> Self {
        LawStepSettings { iterations: 60, max_state_change: 2.0, tolerance: 1e-13, accepted_change: 1e-9 }
    }
}

impl LawIntegrator {
    /// Creates it for a law with [`states`].
    pub fn new(joint: &IndexedLaw) -> Self {
        let (directions, states) = (joint.directions, joint.states);
        LawIntegrator {
            view: view(&joint.law).unwrap_or(LawView::Rate),
            elements: elements(&joint.law),
            directions,
            states,
            state_scale: joint.state_scale,
            force: [0.0; MAX_DIRECTIONS],
            state: vec![0.0; states],
            slopes: vec![0.0; (directions + states) * (4 * directions + states)],
            slipping: None,
            step: StepPoint::new(directions, states),
            halves: std::array::from_fn(|_| StepPoint::new(directions, states)),
            before: RatePoint::new(directions, states),
            after: RatePoint::new(directions, states),
            lu: SmallLu::default(),
            change: vec![0.0; states],
        }
    }

    /// Sets the limits of its sliders from the next values of the iterator, N.
    pub fn limit(&mut self, limits: &mut impl Iterator<Item = f64>) {
        for element in &mut self.elements {
            if let (LawView::IdealElements, IdealElement::Slider(slider)) = (self.view, element)
                && let Some(limit) = limits.next()
            {
                (slider.limit, slider.static_limit) = (limit, limit);
            }
        }
    }

    /// Multiplies the limits of its sliders by a factor.
    pub fn scale_limits(&mut self, factor: f64) {
        for element in &mut self.elements {
            if let IdealElement::Slider(slider) = element {
                slider.limit *= factor;
                slider.static_limit *= factor;
            }
        }
    }

    /// Returns the number of arguments of a result.
    fn arguments(&self) -> usize {
        4 * self.directions + self.states
    }

    /// Returns the derivatives of force `d`, in the order u₀, u₀', z₀, u₁, u₁'.
    pub fn force_slope(&self, d: usize) -> &[f64] {
        let width = self.arguments();
        &self.slopes[d * width..(d + 1) * width]
    }

    /// Returns the derivatives of state `s`.
    pub fn state_slope(&self, s: usize) -> &[f64] {
        self.force_slope(self.directions + s)
    }

    /// Returns the contact state at the end of the step.
    pub fn contact(&self, law: &SharedLaw, velocity: &[f64]) -> Contact {
        match self.slipping {
            Some(sign) => Contact::slip(sign),
            // a slider below its limit sticks
            None if self.view == LawView::IdealElements && self.states > 0 => Contact::Stick,
            None => law.contact_state(velocity, &self.force[..self.directions]),
        }
    }

    /// Evaluates the force of a state, as a step of zero length. The derivatives with respect
    /// to the motion are stored at u₁ and u₁'.
    pub fn evaluate(&mut self, law: &SharedLaw, at: LawInstant) {
        if self.view == LawView::Rate {
            self.slopes.fill(0.0);
            let (directions, states, width) = (self.directions, self.states, self.arguments());
            if let Some(rate) = law.rate() {
                rate.evaluate_with_derivatives(directions, &at.motion, at.z, &mut self.after);
            }
            self.force = self.after.force;
            self.state.copy_from_slice(at.z);
            for d in 0..directions {
                let slope = self.after.force_slope(d);
                let row = &mut self.slopes[d * width..(d + 1) * width];
                row[2 * directions..2 * directions + states].copy_from_slice(&slope[2 * directions..]);
                row[2 * directions + states..].copy_from_slice(&slope[..2 * directions]);
            }
            return;
        }
        self.begin(law, at);
        self.advance(law, at, &at.motion, 0.0);
    }

    /// Prepares for a step from this instant.
    pub fn begin(&mut self, law: &SharedLaw, from: LawInstant) {
        self.state.copy_from_slice(from.z);
        if let (LawView::Rate, Some(rate)) = (self.view, law.rate()) {
            rate.evaluate_with_derivatives(self.directions, &from.motion, from.z, &mut self.before);
        }
    }

    /// Evaluates the step of size `h` (s) from `from` to `to`. Returns false if the states at
    /// its end are not found.
    pub fn advance(&mut self, law: &SharedLaw, from: LawInstant, to: &RelativeMotion<f64>, h: f64) -> bool {
        self.slopes.fill(0.0);
        match self.view {
            LawView::IdealElements => {
                self.evaluate_ideal_elements(from, to);
                true
            }
            LawView::Step => {
                self.step_over(law, from, to);
                true
            }
            LawView::Rate => self.integrate(law, from, to, h),
        }
    }

    /// Evaluates one step of a law with a step view; in a plane, also two half steps.
    fn step_over(&mut self, law: &SharedLaw, from: LawInstant, to: &RelativeMotion<f64>) {
        let (directions, states, width) = (self.directions, self.states, self.arguments());
        let Some(step) = law.step() else { return };
        let (start, end) = (&from.motion.displacement, &to.displacement);
        step.advance_with_derivatives(directions, start, end, from.z, &mut self.step);
        let (z, after) = (2 * directions, 2 * directions + states);
        let row_of = |point: &StepPoint, row: usize, argument: usize| {
            let slope = if row < directions { point.force_slope(row) } else { point.state_slope(row - directions) };
            slope[argument]
        };
        if directions == 1 {
            self.force = self.step.force;
            self.state.copy_from_slice(&self.step.state);
            for row in 0..directions + states {
                let out = &mut self.slopes[row * width..(row + 1) * width];
                out[0] = row_of(&self.step, row, 0);
                (0..states).for_each(|s| out[z + s] = row_of(&self.step, row, 2 + s));
                out[after] = row_of(&self.step, row, 1);
            }
            return;
        }
        let middle = std::array::from_fn(|d| 0.5 * (start[d] + end[d]));
        let [first, second] = &mut self.halves;
        step.advance_with_derivatives(directions, start, &middle, from.z, first);
        step.advance_with_derivatives(directions, &middle, end, &first.state, second);
        for d in 0..directions {
            self.force[d] = 2.0 * second.force[d] - self.step.force[d];
        }
        for s in 0..states {
            self.state[s] = 2.0 * second.state[s] - self.step.state[s];
        }
        for row in 0..directions + states {
            let out = &mut self.slopes[row * width..(row + 1) * width];
            // chain rule through the state in the middle
            let through = |argument: usize| -> f64 {
                (0..states).map(|s| row_of(second, row, z + s) * first.state_slope(s)[argument]).sum()
            };
            for d in 0..directions {
                let half = 0.5 * (row_of(second, row, d) + through(directions + d));
                out[d] = 2.0 * (half + through(d)) - row_of(&self.step, row, d);
                let ended = row_of(second, row, directions + d);
                out[after + d] = 2.0 * (half + ended) - row_of(&self.step, row, directions + d);
            }
            for s in 0..states {
                out[z + s] = 2.0 * through(z + s) - row_of(&self.step, row, z + s);
            }
        }
    }

    /// Evaluates stops and ideal sliders in series with springs, whose forces are the states.
    fn evaluate_ideal_elements(&mut self, from: LawInstant, to: &RelativeMotion<f64>) {
        let (states, width) = (self.states, self.arguments());
        let (u0, u1) = (from.motion.displacement[0], to.displacement[0]);
        let (z, after) = (2, 2 + states); // arguments: u₀, u₀', z₀, u₁, u₁'
        self.force = [0.0; MAX_DIRECTIONS];
        self.slipping = None;
        let mut s = 0;
        for element in &self.elements {
            match *element {
                IdealElement::Slider(slider) => {
                    let stiffness = slider.stiffness.unwrap_or(0.0);
                    let stuck = from.z[s] + stiffness * (u1 - u0);
                    let force = stuck.clamp(-slider.limit, slider.limit);
                    if force == stuck {
                        for row in [0, 1 + s] {
                            let slope = &mut self.slopes[row * width..(row + 1) * width];
                            slope[0] -= stiffness;
                            slope[z + s] += 1.0;
                            slope[after] += stiffness;
                        }
                    } else {
                        self.slipping = Some(force);
                    }
                    self.force[0] += force;
                    self.state[s] = force;
                    s += 1;
                }
                IdealElement::Stop { gap, stiffness } => {
                    if u1 > gap {
                        self.force[0] += stiffness * (u1 - gap);
                        self.slopes[after] += stiffness;
                    }
                }
            }
        }
    }

    /// Solves `z₁ = z₀ + h/2 (g₀ + g₁)` by Newton's method, and computes the derivatives.
    fn integrate(&mut self, law: &SharedLaw, from: LawInstant, to: &RelativeMotion<f64>, h: f64) -> bool {
        let settings = LawStepSettings::default();
        let (directions, states, width) = (self.directions, self.states, self.arguments());
        let Some(rate) = law.rate() else { return false };
        let half = 0.5 * h;
        let (mut found, mut previous) = (states == 0, f64::INFINITY);
        for _ in 0..settings.iterations {
            rate.evaluate_with_derivatives(directions, to, &self.state, &mut self.after);
            let matrix = self.lu.zeros(states);
            for s in 0..states {
                let slope = &self.after.rate_slope(s)[2 * directions..];
                for t in 0..states {
                    matrix[s * states + t] = f64::from(u8::from(s == t)) - half * slope[t];
                }
                self.change[s] = from.z[s] + half * (self.before.rate[s] + self.after.rate[s]) - self.state[s];
            }
            if !self.lu.factor() {
                return false;
            }
            if found {
                break;
            }
            self.lu.solve(&mut self.change);
            let size = self.change.iter().fold(0.0f64, |size, c| size.max(c.abs() / self.state_scale));
            let share = if size > settings.max_state_change { settings.max_state_change / size } else { 1.0 };
            self.state.iter_mut().zip(&self.change).for_each(|(z, change)| *z += share * change);
            if !self.state.iter().all(|z| z.is_finite()) {
                self.state.copy_from_slice(from.z);
                return false;
            }
            let largest = self.state.iter().fold(self.state_scale, |size, z| size.max(z.abs())) / self.state_scale;
            found = size <= settings.tolerance * largest || (size <= settings.accepted_change && size >= previous);
            previous = size;
        }
        if !found {
            return false;
        }
        self.force = self.after.force;
        let (z, after) = (2 * directions, 2 * directions + states);
        for argument in 0..width {
            for s in 0..states {
                let (before, now) = (self.before.rate_slope(s), self.after.rate_slope(s));
                self.change[s] = if argument < z {
                    half * before[argument]
                } else if argument < after {
                    let own = if argument - z == s { 1.0 } else { 0.0 };
                    own + half * before[argument]
                } else {
                    half * now[argument - after]
                };
            }
            self.lu.solve(&mut self.change);
            for s in 0..states {
                self.slopes[(directions + s) * width + argument] = self.change[s];
            }
            for d in 0..directions {
                let slope = self.after.force_slope(d);
                let direct = if argument >= after { slope[argument - after] } else { 0.0 };
                let through: f64 = (0..states).map(|s| slope[2 * directions + s] * self.change[s]).sum();
                self.slopes[d * width + argument] = direct + through;
            }
        }
        true
    }
}
