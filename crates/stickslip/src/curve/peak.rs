//! Peaks of response curves, maximised over frequency.

use crate::method::Solver;
use crate::orbit::Orbit;

/// A refined peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Frequency, rad/s.
    pub omega: f64,
    /// The quantity that was maximised.
    pub value: f64,
    /// True if the largest value stands at an end of the range: the real peak may lie beyond.
    pub at_end: bool,
}

/// Relative width of the frequency bracket at which the search ends. The amplitude is flat at its peak (error of second order in
/// the frequency), and at a kink (onset of slip) of first order: there it is found to this.
const BRACKET: f64 = 1e-10;
/// Orbits that one refinement may take; Brent's method takes 10 to 40.
const ORBITS: usize = 80;
/// Grid maxima below this share of the highest cannot hide the highest peak between grid points, unless the grid is far too coarse.
const CANDIDATE: f64 = 0.8;
/// (3 - √5)/2
const GOLDEN: f64 = 0.381_966_011_250_105_1;

/// The highest peak of `quantity` over a curve whose points are `omegas` (rising, rad/s) with `values` (NaN at failed points),
/// refined between its neighbours with orbits of `solver`, by Brent's method.
///
/// Returns `None` if no point converged.
///
/// # Example
/// ```
/// use stickslip::curve::peak::highest;
/// use stickslip::method::{Method, event_driven::EventDriven};
/// let couple = stickslip::model::templates::find("blade-couple").unwrap();
/// let system = couple.model_with(&[("Ft", 4.0)]).unwrap().assemble().unwrap();
/// let mut solver = EventDriven.solver(&system).unwrap();
/// let omegas: Vec<f64> = (0..9).map(|i| std::f64::consts::TAU * (120.9 + 0.1 * f64::from(i))).collect();
/// let values: Vec<f64> = omegas.iter().map(|w| solver.orbit(*w, None).unwrap().places[0].amplitude()).collect();
/// let peak = highest(&mut *solver, &omegas, &values, &|orbit| orbit.places[0].amplitude()).unwrap();
/// assert!((peak.value - 0.032_338).abs() < 1e-6);
/// ```
pub fn highest(
    solver: &mut dyn Solver,
    omegas: &[f64],
    values: &[f64],
    quantity: &dyn Fn(&Orbit) -> f64,
) -> Option<Peak> {
    let n = omegas.len();
    let best = (0..n).filter(|&i| values[i].is_finite()).max_by(|&a, &b| values[a].total_cmp(&values[b]))?;
    let mut peak = Peak { omega: omegas[best], value: values[best], at_end: best == 0 || best + 1 == n };
    for i in 1..n.saturating_sub(1) {
        let (left, here, right) = (values[i - 1], values[i], values[i + 1]);
        if here >= left && here >= right && here >= CANDIDATE * values[best] {
            let refined = refine(solver, [omegas[i - 1], omegas[i], omegas[i + 1]], here, quantity);
            if refined.value > peak.value || (refined.value == peak.value && peak.at_end) {
                peak = refined;
            }
        }
    }
    Some(peak)
}

/// Brent's maximisation inside `[low, middle, high]`. Source: Brent (1973), Ch. 5.
fn refine(
    solver: &mut dyn Solver,
    [low, middle, high]: [f64; 3],
    value: f64,
    quantity: &dyn Fn(&Orbit) -> f64,
) -> Peak {
    let mut start: Option<Vec<f64>> = None;
    let mut at = |omega: f64| match solver.orbit(omega, start.as_deref()) {
        Ok(orbit) => {
            let value = quantity(&orbit);
            start = Some(orbit.start);
            -value
        }
        Err(_) => f64::INFINITY, // a failed orbit is no peak
    };
    let (mut a, mut b) = (low, high);
    let (mut x, mut w, mut v) = (middle, middle, middle);
    let (mut fx, mut fw, mut fv) = (-value, -value, -value);
    let (mut step, mut before): (f64, f64) = (0.0, 0.0);
    for _ in 0..ORBITS {
        let centre = 0.5 * (a + b);
        let tolerance = BRACKET * x.abs();
        if (x - centre).abs() <= 2.0 * tolerance - 0.5 * (b - a) {
            break;
        }
        let mut golden = true;
        if before.abs() > tolerance && fw.is_finite() && fv.is_finite() {
            let (r, q) = ((x - w) * (fx - fv), (x - v) * (fx - fw));
            let mut p = (x - v) * q - (x - w) * r;
            let mut q = 2.0 * (q - r);
            if q > 0.0 {
                p = -p;
            }
            q = q.abs();
            if p.abs() < (0.5 * q * before).abs() && p > q * (a - x) && p < q * (b - x) {
                (before, step) = (step, p / q);
                let trial = x + step;
                if trial - a < 2.0 * tolerance || b - trial < 2.0 * tolerance {
                    step = tolerance.copysign(centre - x);
                }
                golden = false;
            }
        }
        if golden {
            before = if x < centre { b - x } else { a - x };
            step = GOLDEN * before;
        }
        let trial = x + if step.abs() >= tolerance { step } else { tolerance.copysign(step) };
        let f = at(trial);
        if f <= fx {
            if trial < x {
                b = x
            } else {
                a = x
            }
            (v, fv, w, fw, x, fx) = (w, fw, x, fx, trial, f);
        } else {
            if trial < x {
                a = trial
            } else {
                b = trial
            }
            if f <= fw || w == x {
                (v, fv, w, fw) = (w, fw, trial, f);
            } else if f <= fv || v == x || v == w {
                (v, fv) = (trial, f);
            }
        }
    }
    Peak { omega: x, value: -fx, at_end: false }
}
