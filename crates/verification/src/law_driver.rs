//! A law alone under a given motion, evaluated through each of its views and without any
//! method.

use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use stickslip::law::{IdealElement, Law, MAX_DIRECTIONS, ProxView, RatePoint, RateView, RelativeMotion, StepView};

use crate::Random;

/// Displacement (m) and velocity (m/s) along all directions.
pub type Instant = ([f64; MAX_DIRECTIONS], [f64; MAX_DIRECTIONS]);

/// A given motion as a function of time, from zero on.
pub type Motion<'a> = &'a dyn Fn(f64) -> Instant;

/// A view of a law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum View {
    Pieces,
    Step,
    Rate,
    Prox,
}

/// Returns the views that a law offers.
pub fn views(law: &dyn Law) -> Vec<View> {
    let offered = [
        (View::Pieces, law.ideal_elements().is_some()),
        (View::Step, law.step().is_some()),
        (View::Rate, law.rate().is_some()),
        (View::Prox, law.prox().is_some()),
    ];
    offered.into_iter().filter(|(_, has)| *has).map(|(view, _)| view).collect()
}

/// Returns the forces of a law (N) at the `times`, from a contact that has not moved. The times
/// rise from zero.
///
/// Pieces and steps move straight from sample to sample. Rates are integrated between samples
/// by the two-stage Radau IIA method, of order 3. Resolvents behind a spring use implicit Euler
/// steps, of order 1.
///
/// # Panics
/// If the law does not offer the view.
pub fn forces(law: &dyn Law, view: View, motion: Motion<'_>, times: &[f64]) -> Vec<[f64; MAX_DIRECTIONS]> {
    match view {
        View::Pieces => pieces(&law.ideal_elements().expect("pieces"), motion, times),
        View::Step => step(law.step().expect("a step"), motion, times),
        View::Rate => rate(law.directions(), law.rate().expect("a rate"), motion, times),
        View::Prox => prox(law.directions(), law.prox().expect("a resolvent"), motion, times),
    }
}

fn pieces(pieces: &[IdealElement], motion: Motion<'_>, times: &[f64]) -> Vec<[f64; MAX_DIRECTIONS]> {
    let mut held = vec![0.0; pieces.len()];
    let mut before = motion(times[0]).0[0];
    times
        .iter()
        .map(|&time| {
            let (u, v) = motion(time);
            let (u, v, way) = (u[0], v[0], u[0] - before);
            before = u;
            let each = pieces.iter().zip(&mut held).map(|(piece, held)| match *piece {
                IdealElement::Slider(slider) => {
                    *held = match slider.stiffness {
                        Some(stiffness) => (*held + stiffness * way).clamp(-slider.limit, slider.limit),
                        None if v != 0.0 => slider.limit * v.signum(),
                        None => *held,
                    };
                    *held
                }
                IdealElement::Stop { gap, stiffness } => stiffness * (u - gap).max(0.0),
            });
            [each.sum(), 0.0, 0.0]
        })
        .collect()
}

fn step(step: &dyn StepView, motion: Motion<'_>, times: &[f64]) -> Vec<[f64; MAX_DIRECTIONS]> {
    let mut z = vec![0.0; step.states()];
    let mut before = motion(times[0]).0;
    times
        .iter()
        .map(|&time| {
            let to = motion(time).0;
            let force = step.advance_values(&before, &to, &mut z);
            before = to;
            force
        })
        .collect()
}

/// Nodes and matrix of the two-stage Radau IIA method, of order 3. It damps processes that are
/// too fast for a step, without oscillation.
pub const NODES: [f64; 2] = [1.0 / 3.0, 1.0];
const STAGES: [[f64; 2]; 2] = [[5.0 / 12.0, -1.0 / 12.0], [0.75, 0.25]];

/// Returns the states of a rate law at the end of a step of length `h` (s), from the
/// states before it. `motion` holds the motion at the [`NODES`].
///
/// # Panics
/// If the equations of the step are singular.
#[must_use]
pub fn radau_step(
    law: &dyn RateView,
    directions: usize,
    h: f64,
    motion: &[RelativeMotion<f64>; 2],
    z: &[f64],
) -> Vec<f64> {
    // Largest change of a stage per iteration, because some states are logarithms of physical
    // quantities.
    let stride = 2.0;
    let n = law.states();
    let mut point = RatePoint::new(directions, n);
    let mut stages = DVector::from_fn(2 * n, |i, _| z[i % n]);
    // Newton iterations for the stages of a step.
    for _ in 0..if n == 0 || h == 0.0 { 0 } else { 30 } {
        let mut rates = vec![0.0; 2 * n];
        let mut slopes = DMatrix::zeros(2 * n, n);
        for s in 0..2 {
            law.evaluate_with_derivatives(directions, &motion[s], &stages.as_slice()[s * n..(s + 1) * n], &mut point);
            rates[s * n..(s + 1) * n].copy_from_slice(&point.rate);
            for i in 0..n {
                for j in 0..n {
                    slopes[(s * n + i, j)] = point.rate_slope(i)[2 * directions + j];
                }
            }
        }
        let residual = DVector::from_fn(2 * n, |i, _| {
            stages[i] - z[i % n] - h * (0..2).map(|t| STAGES[i / n][t] * rates[t * n + i % n]).sum::<f64>()
        });
        let jacobian = DMatrix::from_fn(2 * n, 2 * n, |i, j| {
            f64::from(u8::from(i == j)) - h * STAGES[i / n][j / n] * slopes[(j / n * n + i % n, j % n)]
        });
        let mut change = jacobian.lu().solve(&residual).expect("a regular step");
        let longest = change.amax();
        if longest > stride {
            change *= stride / longest;
        }
        stages -= &change;
        if longest < 1e-14 * (1.0 + stages.amax()) {
            break;
        }
    }
    stages.as_slice()[n..].to_vec()
}

fn rate(directions: usize, law: &dyn RateView, motion: Motion<'_>, times: &[f64]) -> Vec<[f64; MAX_DIRECTIONS]> {
    let mut z = vec![0.0; law.states()];
    let relative = |time: f64| {
        let (displacement, velocity) = motion(time);
        RelativeMotion { displacement, velocity }
    };
    let mut last = times[0];
    times
        .iter()
        .map(|&time| {
            let h = time - last;
            z = radau_step(law, directions, h, &NODES.map(|c| relative(last + c * h)), &z);
            last = time;
            law.evaluate_values(&relative(time), &z, &mut vec![0.0; z.len()])
        })
        .collect()
}

fn prox(directions: usize, law: &dyn ProxView, motion: Motion<'_>, times: &[f64]) -> Vec<[f64; MAX_DIRECTIONS]> {
    let resolve = |y: &[f64], penalty: f64| {
        let (mut force, mut slope) = ([0.0; MAX_DIRECTIONS], [0.0; MAX_DIRECTIONS * MAX_DIRECTIONS]);
        law.resolve(y, penalty, &mut force[..directions], &mut slope[..directions * directions]);
        force
    };
    let mut force = [0.0; MAX_DIRECTIONS];
    let mut before = motion(times[0]).0;
    let mut last = times[0];
    times
        .iter()
        .map(|&time| {
            let (u, v) = motion(time);
            if law.compliance() > 0.0 && time > last {
                // `f = f₀ + k (Δu - h s')`, `f = φ(s')`: one resolvent with the penalty `k h`
                let stiffness = 1.0 / law.compliance();
                let y: Vec<f64> = (0..directions).map(|a| force[a] + stiffness * (u[a] - before[a])).collect();
                force = resolve(&y, stiffness * (time - last));
            } else if law.compliance() == 0.0 {
                // `λ = J(λ + ε v)`: a larger penalty converges faster
                let penalty = 1e6 + 1e3 * law.minimum_penalty();
                for _ in 0..100 {
                    let y: Vec<f64> = (0..directions).map(|a| force[a] + penalty * v[a]).collect();
                    force = resolve(&y, penalty);
                }
            }
            (before, last) = (u, time);
            force
        })
        .collect()
}

/// Returns the energy lost between the samples, `∫ f · du` by the trapezoidal rule, J.
pub fn dissipated(motion: Motion<'_>, times: &[f64], forces: &[[f64; MAX_DIRECTIONS]]) -> f64 {
    let places: Vec<_> = times.iter().map(|&time| motion(time).0).collect();
    let each = |k: usize| -> f64 {
        let along = |a: usize| 0.5 * (forces[k][a] + forces[k + 1][a]) * (places[k + 1][a] - places[k][a]);
        (0..MAX_DIRECTIONS).map(along).sum()
    };
    (0..times.len() - 1).map(each).sum()
}

/// Returns a periodic motion along all directions that begins at zero, with the period 1 s over
/// `speed`. Even seeds give three odd harmonics, odd seeds four harmonics.
pub fn random_motion(seed: u64, directions: usize, speed: f64) -> impl Fn(f64) -> Instant {
    let mut random = Random::new(seed);
    let harmonics: &[f64] = if seed.is_multiple_of(2) { &[1.0, 3.0, 5.0] } else { &[1.0, 2.0, 3.0, 4.0] };
    let mut terms = Vec::new();
    for direction in 0..directions {
        for &harmonic in harmonics {
            terms.push((direction, harmonic, random.between(1e-4, 1e-3) / harmonic, random.between(0.0, TAU)));
        }
    }
    move |time| {
        let (mut u, mut v) = ([0.0; MAX_DIRECTIONS], [0.0; MAX_DIRECTIONS]);
        for &(direction, harmonic, amplitude, phase) in &terms {
            let omega = TAU * harmonic * speed;
            u[direction] += amplitude * ((omega * time + phase).sin() - phase.sin());
            v[direction] += amplitude * omega * (omega * time + phase).cos();
        }
        (u, v)
    }
}

/// Returns `count` equal steps per period over `periods` periods of length `period`, with both
/// ends.
pub fn steps(period: f64, periods: usize, count: usize) -> Vec<f64> {
    (0..=periods * count).map(|k| period * k as f64 / count as f64).collect()
}
