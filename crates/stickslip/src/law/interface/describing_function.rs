//! The describing function of a law: the first harmonic of its periodic force under a harmonic
//! motion.

use crate::law::{IdealElement, Law, MAX_DIRECTIONS, RatePoint, RateView, RelativeMotion, Slider};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::f64::consts::{PI, TAU};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Samples per cycle. The result serves as an initial guess, so an error of 1 % is acceptable.
const SAMPLES: usize = 128;

/// Simulated cycles. Hysteresis is periodic by then, and states with slow relaxation are close
/// to it.
const CYCLES: usize = 3;

/// Returns the complex stiffness, N/m, at an amplitude (m) and a frequency (rad/s). It uses the
/// first view that the law has: ideal elements, rate, step, resolvent.
pub(in crate::law) fn complex_stiffness<L: Law + ?Sized>(law: &L, amplitude: f64, omega: f64) -> Complex64 {
    // At zero amplitude, use a tiny amplitude. The limit of small motion would need a length
    // scale of the law.
    let a = if amplitude > 0.0 { amplitude } else { f64::MIN_POSITIVE.sqrt() };
    if let Some(ideal_elements) = law.ideal_elements() {
        return ideal_elements.iter().map(|element| slider_or_stop(element, amplitude)).sum();
    }
    if let Some(rate) = law.rate() {
        let at_once = if rate.is_batched() { batched_rate_law(rate, a, omega) } else { None };
        return at_once.unwrap_or_else(|| rate_law(rate, a, omega));
    }
    if let Some(step) = law.step() {
        let mut z = vec![0.0; step.states()];
        let mut before = [0.0; MAX_DIRECTIONS];
        return first_harmonic(a, |theta| {
            let to = [a * theta.cos(), 0.0, 0.0];
            let force = step.advance_values(&before, &to, &mut z)[0];
            before = to;
            force
        });
    }
    let Some(prox) = law.prox() else { return ZERO };
    // Penalty times velocity amplitude. The resolvent then evaluates the law at a velocity that
    // differs by `1e-6 λ` of the velocity amplitude.
    let penalty = 1e6 / (a * omega);
    let rigid = first_harmonic(a, |theta| {
        let y = -penalty * a * omega * theta.sin();
        let (mut force, mut slope) = ([0.0; MAX_DIRECTIONS], [0.0; MAX_DIRECTIONS * MAX_DIRECTIONS]);
        prox.resolve(&[y, 0.0, 0.0][..law.directions()], penalty, &mut force, &mut slope);
        force[0]
    });
    // add the spring in series
    if prox.compliance() > 0.0 { rigid / (1.0 + rigid * prox.compliance()) } else { rigid }
}

/// Returns the complex stiffness of one ideal part in closed form.
pub(in crate::law) fn slider_or_stop(element: &IdealElement, amplitude: f64) -> Complex64 {
    match *element {
        IdealElement::Slider(Slider { limit: 0.0, .. }) => ZERO,
        IdealElement::Slider(Slider { stiffness: None, limit, .. }) => {
            Complex64::new(0.0, 4.0 * limit / (PI * amplitude))
        }
        IdealElement::Slider(Slider { stiffness: Some(stiffness), limit, .. }) => {
            let hold = limit / stiffness;
            if amplitude <= hold {
                return Complex64::new(stiffness, 0.0);
            }
            let slip = (1.0 - 2.0 * hold / amplitude).acos(); // phase at which slip begins
            let (sin, cos) = slip.sin_cos();
            Complex64::new(slip - sin * cos, sin * sin) * (stiffness / PI)
        }
        // closed while cos θ > gap / amplitude
        IdealElement::Stop { gap, stiffness } => {
            let share = if amplitude > 0.0 { gap / amplitude } else { f64::INFINITY.copysign(gap) };
            let closed = share.clamp(-1.0, 1.0).acos();
            let (sin, cos) = closed.sin_cos();
            Complex64::new((closed - sin * cos) * stiffness / PI, 0.0)
        }
    }
}

/// Returns the first harmonic of the force in the last cycle, divided by the amplitude of the
/// motion.
fn first_harmonic(amplitude: f64, mut force: impl FnMut(f64) -> f64) -> Complex64 {
    let mut sum = ZERO;
    for i in 0..=CYCLES * SAMPLES {
        let theta = TAU * i as f64 / SAMPLES as f64;
        let value = force(theta);
        if i > (CYCLES - 1) * SAMPLES {
            sum += Complex64::cis(-theta) * value;
        }
    }
    sum * (2.0 / (SAMPLES as f64 * amplitude))
}

/// Integrates the states by the implicit Euler method, which is stable for any stiffness.
fn rate_law(rate: &dyn RateView, amplitude: f64, omega: f64) -> Complex64 {
    let states = rate.states();
    let length = TAU / (omega * SAMPLES as f64);
    let mut z = vec![0.0; states];
    let mut rates = vec![0.0; states];
    let mut point = RatePoint::new(1, states);
    first_harmonic(amplitude, |theta| {
        let (sin, cos) = theta.sin_cos();
        let motion = RelativeMotion::along(amplitude * cos, -amplitude * omega * sin);
        let before = z.clone();
        // Newton iterations for the states at a sample.
        for _ in 0..if states == 0 { 0 } else { 8 } {
            rate.evaluate_with_derivatives(1, &motion, &z, &mut point);
            let residual = DVector::from_fn(states, |s, _| z[s] - before[s] - length * point.rate[s]);
            let jacobian = DMatrix::from_fn(states, states, |s, t| {
                f64::from(u8::from(s == t)) - length * point.rate_slope(s)[2 + t]
            });
            let Some(change) = jacobian.lu().solve(&residual) else { break };
            z.iter_mut().zip(change.iter()).for_each(|(z, d)| *z -= d);
        }
        if z.iter().any(|z| !z.is_finite()) {
            z = before;
        }
        rate.evaluate_values(&motion, &z, &mut rates)[0]
    })
}

/// Integrates the states as [`rate_law`] does, but solves all steps together by Newton's method
/// with one evaluation of all samples per iteration. Returns `None` if it does not converge.
fn batched_rate_law(rate: &dyn RateView, amplitude: f64, omega: f64) -> Option<Complex64> {
    let (m, n) = (rate.states(), CYCLES * SAMPLES + 1);
    let length = TAU / (omega * SAMPLES as f64);
    let motions: Vec<RelativeMotion<f64>> = (0..n)
        .map(|i| (TAU * i as f64 / SAMPLES as f64).sin_cos())
        .map(|(sin, cos)| RelativeMotion::along(amplitude * cos, -amplitude * omega * sin))
        .collect();
    let mut z = vec![0.0; n * m];
    let mut points = vec![RatePoint::new(1, m); n];
    // With exact derivatives, 5 to 10 iterations are typical.
    for _ in 0..30 {
        rate.evaluate_many_with_derivatives(1, &motions, &z, &mut points);
        let (mut before, mut largest) = (vec![0.0; m], 0.0f64);
        for (z, point) in z.chunks_exact_mut(m.max(1)).zip(&points) {
            let residual = DVector::from_fn(m, |s, _| z[s] - before[s] - length * point.rate[s]);
            let jacobian =
                DMatrix::from_fn(m, m, |s, t| f64::from(u8::from(s == t)) - length * point.rate_slope(s)[2 + t]);
            let change = jacobian.lu().solve(&residual)?;
            largest = change.iter().fold(largest, |largest, change| largest.max(change.abs()));
            z.iter_mut().zip(change.iter()).for_each(|(z, change)| *z -= change);
            before.copy_from_slice(z);
        }
        if !z.iter().all(|z| z.is_finite()) {
            return None;
        }
        // the forces belong to the states before this change
        if largest <= 1e-6 * rate.state_scale() {
            let mut forces = points.iter().map(|point| point.force[0]);
            return Some(first_harmonic(amplitude, |_| forces.next().unwrap_or(0.0)));
        }
    }
    None
}
