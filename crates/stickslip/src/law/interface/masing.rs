//! Hysteresis by Masing's rules with memory: a curve of first loading and the return points of
//! the motion.
//!
//! The force of first loading is `B(u)`, odd in the displacement u. After a return point
//! `(u_r, f_r)` the force follows `f_r + 2 B((u - u_r)/2)` until the motion passes the previous
//! return point. That closes a loop: both points are deleted, and the motion continues on the
//! branch that the loop interrupted. Any parallel connection of ideal sliders, with any springs
//! and limits, obeys these rules exactly.
//!
//! A history is stored as legs, the displacements between return points. The first leg `z₁`
//! begins at zero; `z₂, z₃, …` have alternating signs. Each leg is nested in the one before it
//! (`|z₂| ≤ 2 |z₁|`, `|z₃| ≤ |z₂|`, …). The last leg ends at the present displacement. Therefore
//! the force is a function of the legs alone: `f = B(z₁) + Σ 2 B(z_k/2)`.
//! Source: Masing (1926); Jennings (1964) for the rules of closed loops; Brokate and Sprekels,
//! "Hysteresis and Phase Transitions" (1996), Ch. 2, for the equivalence with sliders.

use num_complex::Complex64;
use std::f64::consts::PI;
use std::fmt::Debug;
use stickslip_numerics::dual::Real;
use stickslip_numerics::quadrature;

/// The Masing view: the curve of first loading.
pub trait MasingView: Debug + Send + Sync {
    /// Returns the force of first loading (N) at a non-negative displacement (m), and its slope
    /// (N/m).
    fn backbone(&self, displacement: f64) -> (f64, f64);
    /// Returns the displacement of macro-slip, m. Beyond it the force is constant, and the
    /// history is erased.
    fn slip_displacement(&self) -> f64;
}

/// Number of legs in a state. A motion with more nested return points, such as a long decay, is
/// stored with fewer legs that carry the same force.
pub(in crate::law) const MAX_LEGS: usize = 16;

/// Adds a displacement `increment` to the legs of a history of a law that slips at `slips_at`.
/// `force` returns the contribution of a leg from its index and length, see [`leg_force`].
pub(in crate::law) fn advance_legs<S: Real>(
    legs: &mut [S],
    increment: S,
    slips_at: f64,
    force: impl Fn(usize, f64) -> f64,
) {
    // A loop closes when a leg reaches this fraction of the previous leg. The margin to 1 covers
    // rounding: a periodic motion repeats its return points only up to rounding, and must close
    // its loops each time.
    let loop_closure = 1.0 - 1e-9;
    let mut count = leg_count(legs);
    while let Some(k) = first_unreversed_leg(&legs[..count]) {
        // Two consecutive legs may have the same sign after an extrapolation between two step
        // sizes.
        let joined = legs[k];
        legs[k - 1] += joined;
        legs[k..count].rotate_left(1);
        count -= 1;
    }
    if count == 0 || increment.re() * legs[count - 1].re() >= 0.0 {
        count = count.max(1);
        legs[count - 1] += increment;
    } else {
        if count == legs.len() {
            merge_legs(legs, force);
            count -= 2;
        }
        legs[count] = increment;
        count += 1;
    }
    loop {
        let length = |k: usize| legs[k].re().abs();
        if count > 2 && length(count - 1) >= loop_closure * length(count - 2) {
            let beyond = legs[count - 2] + legs[count - 1];
            legs[count - 3] += beyond;
            (legs[count - 2], legs[count - 1]) = (S::from(0.0), S::from(0.0));
            count -= 2;
        } else if count == 2 && length(1) >= loop_closure * 2.0 * length(0) {
            // the motion exceeds the first leg on the opposite side: first loading again
            let end = legs[0] + legs[1];
            (legs[0], legs[1]) = (end, S::from(0.0));
            count = 1;
        } else {
            break;
        }
    }
    legs[count..].fill(S::from(0.0));
    if legs[0].re().abs() > slips_at {
        legs[0] = S::from(slips_at.copysign(legs[0].re()));
    }
}

/// Counts the legs in use; the others are zero.
pub(in crate::law) fn leg_count<S: Real>(legs: &[S]) -> usize {
    legs.iter().position(|leg| leg.re() == 0.0).unwrap_or(legs.len())
}

/// Returns the index of the first leg that has the same sign as the leg before it.
pub(in crate::law) fn first_unreversed_leg<S: Real>(legs: &[S]) -> Option<usize> {
    (1..legs.len()).find(|&k| legs[k].re() * legs[k - 1].re() > 0.0)
}

/// Replaces four consecutive legs by two, at the position at which legs of the same sign differ
/// least in length. The two legs have the same total displacement and the same total force as
/// the four, so the force does not jump. Their lengths lie between those that they replace.
/// `force` returns the contribution of a leg from its index and length.
fn merge_legs<S: Real>(legs: &mut [S], force: impl Fn(usize, f64) -> f64) {
    let apart = |k: usize| 1.0 - (legs[k + 2].re() / legs[k].re()).abs();
    let Some(first) = (1..legs.len() - 3).min_by(|a, b| apart(*a).total_cmp(&apart(*b))) else { return };
    let four = [0, 1, 2, 3].map(|k| legs[first + k].re());
    let (sign, sum) = (four[0].signum(), legs[first] + legs[first + 1] + legs[first + 2] + legs[first + 3]);
    let carried: f64 = four.iter().map(|leg| force(1, *leg)).sum();
    // The slope of the force falls with the length. Of two pairs of legs with the same sum, the
    // pair of shorter legs carries more force.
    let (mut low, mut high) = (four[0].abs() - four[1].abs() + four[2].abs(), four[0].abs());
    while high - low > f64::EPSILON * high {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        let more = sign * (force(1, sign * middle) + force(1, sum.re() - sign * middle) - carried) > 0.0;
        if more { low = middle } else { high = middle }
    }
    legs[first] = S::from(sign * high);
    legs[first + 1] = sum - sign * high;
    legs[first + 2..].rotate_left(2);
    let end = legs.len() - 2;
    legs[end..].fill(S::from(0.0));
}

/// Returns the contribution of a leg to the force. The leg at place 0 is first loading; the
/// others are branches.
pub(in crate::law) fn leg_force<S: Real>(place: usize, leg: S, backbone: impl Fn(S) -> S) -> S {
    let scale = if place == 0 { 1.0 } else { 2.0 };
    let force = backbone(leg.abs() / scale) * scale;
    if leg.re() < 0.0 { -force } else { force }
}

/// Returns the complex stiffness (N/m) of the first harmonic of the periodic force under
/// `u = amplitude cos θ`. In the half period of decreasing u the force is
/// `B(a) - 2 B((a - u)/2)`; the other half mirrors it.
pub(in crate::law) fn complex_stiffness(law: &dyn MasingView, amplitude: f64) -> Complex64 {
    // Number of quadrature panels over the half period in `complex_stiffness`.
    let panels = 8;
    let top = law.backbone(amplitude).0;
    let mut sum = Complex64::ZERO;
    for panel in 0..panels {
        for (node, weight) in quadrature::GAUSS_8 {
            let theta = PI * (f64::from(panel) + 0.5 * (1.0 + node)) / f64::from(panels);
            let force = top - 2.0 * law.backbone(0.5 * amplitude * (1.0 - theta.cos())).0;
            sum += Complex64::cis(-theta) * (force * weight);
        }
    }
    // 2/π times the integral over the half period
    sum / (f64::from(panels) * amplitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Jenkins element: a backbone with a corner.
    fn jenkins(u: f64) -> f64 {
        u.min(1.0)
    }

    fn force(legs: &[f64], backbone: fn(f64) -> f64) -> f64 {
        legs.iter().enumerate().map(|(k, leg)| leg_force(k, *leg, backbone)).sum()
    }

    fn run(legs: &mut [f64], increment: f64, backbone: fn(f64) -> f64, slips_at: f64) -> f64 {
        advance_legs(legs, increment, slips_at, |k, leg| leg_force(k, leg, backbone));
        force(legs, backbone)
    }

    fn noise(k: usize) -> f64 {
        ((k * 7919 + 13) as f64).sin()
    }

    /// Four parallel sliders with different springs and limits have the force history of their
    /// backbone.
    #[test]
    fn parallel_sliders_follow_their_backbone() {
        const SLIDERS: [(f64, f64); 4] = [(1.0, 0.3), (2.0, 0.7), (0.5, 1.1), (0.8, 1.6)];
        fn backbone(u: f64) -> f64 {
            SLIDERS.iter().map(|(k, reach)| k * u.min(*reach)).sum()
        }
        let (mut legs, mut held) = ([0.0; MAX_LEGS], [0.0; 4]);
        for k in 0..5000 {
            // The amplitude changes slowly, so that loops are nested deeply.
            let increment = 1.5 * noise(k) * (0.6 + 0.5 * (0.037 * k as f64).sin());
            let found = run(&mut legs, increment, backbone, 1.6);
            for (f, (k, reach)) in held.iter_mut().zip(SLIDERS) {
                *f = (*f + k * increment).clamp(-k * reach, k * reach);
            }
            let expected: f64 = held.iter().sum();
            assert!((found - expected).abs() < 1e-11, "{k}: {found} {expected}");
        }
    }

    /// A closed inner loop is deleted, and macro-slip erases the history.
    #[test]
    fn closed_loops_are_deleted() {
        let mut legs = [0.0; MAX_LEGS];
        for increment in [0.7, -0.5, 0.2, -0.1, 0.1, -0.2] {
            run(&mut legs, increment, jenkins, 1.0);
        }
        assert!((legs[1] + 0.5).abs() < 1e-15 && legs[2] == 0.0, "{legs:?}");
        run(&mut legs, -9.0, jenkins, 1.0);
        assert_eq!(legs[..2], [-1.0, 0.0]);
    }

    /// A decay has one return point per half cycle, more than are stored. The force stays the
    /// same during the decay. It agrees again in a growing motion after the merged loops are
    /// closed.
    #[test]
    fn a_long_decay_keeps_its_force() {
        fn smooth(u: f64) -> f64 {
            u - 0.5 * u.min(1.0) * u.min(1.0)
        }
        let (mut few, mut many) = ([0.0; MAX_LEGS], [0.0; 400]);
        let mut both = |increment: f64| {
            let forces = [run(&mut few, increment, smooth, 1.0), run(&mut many, increment, smooth, 1.0)];
            (forces[0] - forces[1]).abs()
        };
        let turn = |k: i32| if k % 2 == 0 { 1.0 } else { -1.0 };
        both(0.9);
        for k in 1..300 {
            let apart = both(0.9 * (1.0 + 0.99) * 0.99f64.powi(k) * turn(k));
            assert!(apart < 1e-12, "{k}: {apart:e}");
        }
        let (mut worst, mut last) = (0.0f64, 0.0);
        for k in 300..500 {
            last = both(0.09 * (1.0 + 1.015) * 1.015f64.powi(k - 300) * turn(k));
            worst = worst.max(last);
        }
        assert!(last < 1e-12 && worst < 0.02, "{last:e} {worst:e}");
    }

    /// The derivatives with respect to each step of a history agree with finite differences.
    #[test]
    fn derivatives_follow_the_legs() {
        use stickslip_numerics::dual::{Dual, partials, variable};
        fn smooth<S: Real>(u: S) -> S {
            u - u * u * 0.2
        }
        const INCREMENTS: [f64; 6] = [0.8, -0.9, 0.4, -0.2, 0.5, -0.3];
        fn end<S: Real>(increments: [S; 6]) -> S {
            let mut legs = [S::from(0.0); MAX_LEGS];
            for increment in increments {
                advance_legs(&mut legs, increment, 2.0, |_, _| 0.0);
            }
            legs.iter().enumerate().map(|(k, leg)| leg_force(k, *leg, smooth)).sum()
        }
        let found = partials(&end(std::array::from_fn(|k| -> Dual<6> { variable(INCREMENTS[k], k) })));
        for k in 0..6 {
            let moved = |by: f64| {
                let mut increments = INCREMENTS;
                increments[k] += by;
                end(increments)
            };
            let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((found[k] - difference).abs() < 1e-8, "{k}: {} {difference}", found[k]);
        }
    }
}
