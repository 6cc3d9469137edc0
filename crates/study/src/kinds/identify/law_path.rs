//! The force of a law along a given path of its displacement.
//!
//! Ideal sliders and step laws are exact along straight steps. Rates are integrated by the
//! embedded Runge-Kutta method of Dormand and Prince (1980), orders 5 and 4, over each step.

use stickslip::law::{IdealElement, Law, MAX_DIRECTIONS, RateView, RelativeMotion};

/// A path of the displacement: straight from row to row.
#[derive(Debug, Clone)]
pub(super) struct LoadPath {
    /// Displacements, m.
    pub displacement: Vec<f64>,
    /// Rising times, s; without them the path has no velocity.
    pub time: Option<Vec<f64>>,
}

impl LoadPath {
    /// Returns the path twice, the second directly after the first.
    pub fn twice(&self) -> LoadPath {
        let again = |time: &Vec<f64>| {
            let (first, last) = (time.first().copied().unwrap_or(0.0), time.last().copied().unwrap_or(0.0));
            let step = if time.len() > 1 { (last - first) / (time.len() - 1) as f64 } else { 1.0 };
            let shifted = time.iter().map(|time| time - first + last + step);
            time.iter().copied().chain(shifted).collect()
        };
        LoadPath {
            displacement: [&self.displacement[..], &self.displacement].concat(),
            time: self.time.as_ref().map(again),
        }
    }

    pub fn scaled(&self, factor: f64) -> LoadPath {
        LoadPath { displacement: self.displacement.iter().map(|u| factor * u).collect(), time: self.time.clone() }
    }

    /// Returns the velocity at row `i`: the mean of the steps before and after it, m/s.
    pub fn velocity(&self, i: usize) -> f64 {
        let Some(time) = &self.time else { return 0.0 };
        let (from, to) = (i.saturating_sub(1), (i + 1).min(time.len() - 1));
        if from == to { 0.0 } else { (self.displacement[to] - self.displacement[from]) / (time[to] - time[from]) }
    }
}

/// Returns the forces of a law at the rows of a path, N. The contact has not moved before.
///
/// # Errors
/// The law depends on velocity and the path has no time, or it has no view along a path.
pub(super) fn forces_along(law: &dyn Law, path: &LoadPath) -> Result<Vec<f64>, String> {
    if let Some(elements) = law.ideal_elements() {
        return Ok(ideal(&elements, &path.displacement));
    }
    if let Some(step) = law.step() {
        let mut states = vec![0.0; step.states()];
        let at = |u: f64| {
            let mut place = [0.0; MAX_DIRECTIONS];
            place[0] = u;
            place
        };
        // the path begins at the unloaded position
        let mut before = at(0.0);
        let advance = |u: &f64| {
            let force = step.advance_values(&before, &at(*u), &mut states)[0];
            before = at(*u);
            force
        };
        return Ok(path.displacement.iter().map(advance).collect());
    }
    match law.rate() {
        Some(rate) => rates(law, rate, path),
        None => Err(format!(
            "the law `{}` cannot be evaluated along a measured path; use a target with `is = \"settled\"` or `is = \"response\"`",
            law.info().name
        )),
    }
}

fn ideal(elements: &[IdealElement], path: &[f64]) -> Vec<f64> {
    let mut held = vec![0.0; elements.len()];
    let mut before = 0.0;
    path.iter()
        .map(|u| {
            let way = u - before;
            before = *u;
            let each = elements.iter().zip(&mut held).map(|(element, held)| match *element {
                IdealElement::Slider(slider) => {
                    *held = match slider.stiffness {
                        Some(stiffness) => {
                            let trial = *held + stiffness * way;
                            // stick holds up to the static limit, slip has the lower one
                            if trial.abs() <= slider.static_limit && held.abs() < slider.limit {
                                trial
                            } else {
                                trial.clamp(-slider.limit, slider.limit)
                            }
                        }
                        None if way != 0.0 => slider.limit * way.signum(),
                        None => *held,
                    };
                    *held
                }
                IdealElement::Stop { gap, stiffness } => stiffness * (u - gap).max(0.0),
            });
            each.sum()
        })
        .collect()
}

/// Largest error of a state per step, relative to its scale. The steps differ at neighbouring
/// parameters, so differences over a ten-thousandth of a range have 1e4 times this error.
const TOLERANCE: f64 = 1e-12;
/// Most steps between two rows.
const MAX_STEPS: usize = 100_000;

fn rates(law: &dyn Law, rate: &dyn RateView, path: &LoadPath) -> Result<Vec<f64>, String> {
    // without time, each step takes one second; a law that depends on velocity is refused
    if path.time.is_none() && !is_rate_independent(rate) {
        return Err(format!("the law `{}` depends on velocity, but the data have no column `time`", law.info().name));
    }
    let count = path.displacement.len();
    let time = |i: usize| path.time.as_ref().map_or(i as f64, |time| time[i]);
    let mut states = vec![0.0; rate.states()];
    let mut forces = Vec::with_capacity(count);
    let (mut before, mut at) = (0.0, time(0) - if count > 1 { time(1) - time(0) } else { 1.0 });
    for i in 0..count {
        let (u, end) = (path.displacement[i], time(i));
        let velocity = (u - before) / (end - at);
        let step = StraightStep { from: before, velocity, duration: end - at };
        step.integrate(rate, &mut states)?;
        let motion = RelativeMotion::along(u, velocity);
        forces.push(rate.evaluate_values(&motion, &states, &mut vec![0.0; states.len()])[0]);
        (before, at) = (u, end);
    }
    Ok(forces)
}

/// Returns whether the rates of a law are proportional to the velocity, and its force does not
/// depend on it.
fn is_rate_independent(rate: &dyn RateView) -> bool {
    let states = vec![0.1 * rate.state_scale(); rate.states()];
    let evaluate = |velocity: f64| {
        let mut out = vec![0.0; states.len()];
        let force = rate.evaluate_values(&RelativeMotion::along(1e-4, velocity), &states, &mut out)[0];
        (force, out.into_iter().map(|rate| rate / velocity).collect::<Vec<_>>())
    };
    let ((slow_force, slow), (fast_force, fast)) = (evaluate(1e-3), evaluate(1.0));
    let equal = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (a.abs() + b.abs());
    equal(slow_force, fast_force) && slow.iter().zip(&fast).all(|(a, b)| equal(*a, *b))
}

/// Nodes, weights of the stages after the first, and the difference to the method of order 4, of
/// Dormand and Prince. The last stage is the end of the step.
const NODES: [f64; 6] = [0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
const WEIGHTS: [&[f64]; 6] = [
    &[0.2],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
const ERROR: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339_200.0, 22.0 / 525.0, -1.0 / 40.0];

/// A motion with constant velocity.
struct StraightStep {
    from: f64,
    velocity: f64,
    duration: f64,
}

impl StraightStep {
    /// Integrates the states over the step.
    fn integrate(&self, rate: &dyn RateView, states: &mut Vec<f64>) -> Result<(), String> {
        if states.is_empty() || self.duration <= 0.0 {
            return Ok(());
        }
        let derivative = |time: f64, states: &[f64]| {
            let mut out = vec![0.0; states.len()];
            rate.evaluate_values(
                &RelativeMotion::along(self.from + self.velocity * time, self.velocity),
                states,
                &mut out,
            );
            out
        };
        let (mut time, mut length) = (0.0, self.duration);
        let mut first = derivative(0.0, states);
        for _ in 0..MAX_STEPS {
            let h = length.min(self.duration - time);
            let along = |weights: &[f64], slopes: &[Vec<f64>]| -> Vec<f64> {
                let slope = |s: usize| weights.iter().zip(slopes).map(|(weight, slope)| weight * slope[s]).sum::<f64>();
                (0..states.len()).map(|s| states[s] + h * slope(s)).collect()
            };
            let mut slopes = vec![first.clone()];
            let mut end = states.clone();
            for (node, weights) in NODES.iter().zip(WEIGHTS) {
                end = along(weights, &slopes);
                slopes.push(derivative(time + node * h, &end));
            }
            let error = (0..states.len())
                .map(|s| (h * ERROR.iter().zip(&slopes).map(|(weight, slope)| weight * slope[s]).sum::<f64>()).abs())
                .fold(0.0, f64::max)
                / (TOLERANCE * rate.state_scale());
            if !error.is_finite() {
                length = 0.1 * h;
                continue;
            }
            if error <= 1.0 {
                *states = end;
                first = slopes.swap_remove(6);
                time += h;
                if time >= self.duration * (1.0 - f64::EPSILON) {
                    return Ok(());
                }
            }
            length = h * (0.9 * error.max(1e-6).powf(-0.2)).clamp(0.2, 5.0);
        }
        Err("the law is too stiff along the measured path: its states need more than 100,000 steps between two rows"
            .to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip::law::{self, Jenkins};

    fn path(displacement: Vec<f64>) -> LoadPath {
        LoadPath { displacement, time: None }
    }

    #[test]
    fn a_jenkins_element_follows_its_closed_form() {
        let law = Jenkins { stiffness: 1e4, limit: 2.0 };
        let forces = forces_along(&law, &path(vec![1e-4, 5e-4, 4e-4, -1e-3, 0.0])).expect("forces");
        for (force, expected) in forces.iter().zip([1.0, 2.0, 1.0, -2.0, 2.0]) {
            assert!((force - expected).abs() < 1e-12, "{forces:?}");
        }
    }

    /// `z' = u' (A - (beta sign(u' z) + gamma)|z|^n)` with n = 1 and beta = gamma: on first loading
    /// `z = A/(2 beta) (1 - exp(-2 beta u))`.
    #[test]
    fn a_bouc_wen_element_follows_its_closed_form_on_first_loading() {
        let info = law::TABLE.iter().find(|row| row.name == "bouc-wen").expect("the law");
        let law = info.sample();
        let steps: Vec<f64> = (1..=50).map(|i| f64::from(i) * 2e-5).collect();
        let coarse = forces_along(&*law, &path(steps.clone())).expect("forces");
        let fine: Vec<f64> = (1..=500).map(|i| f64::from(i) * 2e-6).collect();
        let fine = forces_along(&*law, &path(fine)).expect("forces");
        for (i, force) in coarse.iter().enumerate() {
            let other = fine[10 * i + 9];
            assert!((force - other).abs() <= 1e-6 * other.abs().max(1e-9), "{force} {other}");
        }
    }

    #[test]
    fn laws_with_velocity_need_time() {
        let of = |name: &str| {
            let info = law::TABLE.iter().find(|row| row.name == name).expect("the law");
            info.sample()
        };
        assert!(forces_along(&*of("lugre"), &path(vec![1e-6, 2e-6])).is_err());
        assert!(forces_along(&*of("dahl"), &path(vec![1e-6, 2e-6])).is_ok());
        assert!(forces_along(&*of("iwan"), &path(vec![1e-6, 2e-6])).is_ok());
    }
}
