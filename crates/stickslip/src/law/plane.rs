//! Slip in a plane: the force of a spring and slider at the end of a straight step, while the slip limit changes linearly along it.
//!
//! While it slips, the force `T = R n` of the size of the limit R turns towards the motion: with the angle ψ between both and the way s,
//! `ψ' = -(k / R) sin ψ`, so that `tan(ψ/2)` falls by the factor `exp(-k ∫ ds / R)`. At a constant limit that is the closed form of Krieg and Key; at
//! one that changes linearly the integral is a logarithm. Slip once begun lasts to the end of the step, since ψ only falls; where it begins is the
//! root of a quadratic. So the step is exact, as long as the way is straight and the limit linear.
//! Source: Krieg and Key, "Implementation of a time-independent plasticity theory into structural computer programs" (1977); with a limit that
//! changes derived here.

use stickslip_numerics::dual::Real;

/// `a · b`.
pub(super) fn dot<S: Real>(a: [S; 2], b: [S; 2]) -> S {
    a[0] * b[0] + a[1] * b[1]
}

/// `a + s b`.
fn beyond<S: Real>(a: [S; 2], s: S, b: [S; 2]) -> [S; 2] {
    [a[0] + b[0] * s, a[1] + b[1] * s]
}

/// Relative change of the limit below which the logarithm is a series; its fifth term is then below rounding.
const FLAT: f64 = 1e-3;

/// `ln(to / from) / (to - from)`: one over the logarithmic mean.
fn inverse_mean<S: Real>(from: S, to: S) -> S {
    let change = to / from - 1.0;
    if change.re().abs() < FLAT {
        // ln(1 + x) / x
        let series = (((change * 0.2 - 0.25) * change + 1.0 / 3.0) * change - 0.5) * change + 1.0;
        return series / from;
    }
    (to / from).ln() / (to - from)
}

/// The force (N) of a spring and slider after a straight `way` (m), from the `force` before it. The slip limit goes from the first to the second of
/// `limits` (N, not negative) meanwhile; the force before is not above the first.
pub(super) fn step<S: Real>(force: [S; 2], way: [S; 2], stiffness: f64, limits: [S; 2]) -> [S; 2] {
    let [first, last] = limits;
    let zero = S::from(0.0);
    if last.re() <= 0.0 {
        return [zero; 2];
    }
    let trial = [force[0] + way[0] * stiffness, force[1] + way[1] * stiffness];
    let beyond_limit = dot(trial, trial) - last * last;
    if beyond_limit.re() <= 0.0 {
        return trial;
    }
    if dot(way, way).re() == 0.0 {
        // the limit has fallen below a force that rests
        let size = dot(trial, trial).sqrt();
        return [trial[0] * last / size, trial[1] * last / size];
    }
    // |force + stiffness s way| meets the limit at the share s of the way: a s² + b s + c = 0, c <= 0, more than zero at s = 1
    let change = last - first;
    let a = dot(way, way) * (stiffness * stiffness) - change * change;
    let b = (dot(force, way) * stiffness - first * change) * 2.0;
    let c = dot(force, force) - first * first;
    let discriminant = b * b - a * c * 4.0;
    let share = if discriminant.re() <= 0.0 {
        zero // it slips at once, across its force
    } else if b.re() > 0.0 {
        c * -2.0 / (b + discriminant.sqrt())
    } else {
        (discriminant.sqrt() - b) / (a * 2.0)
    };
    let length = dot(way, way).sqrt();
    let ahead = [way[0] / length, way[1] / length];
    let held = beyond(force, share * stiffness, way);
    let size = dot(held, held).sqrt();
    if size.re() <= 0.0 {
        // contact that begins here slips along the motion
        return [ahead[0] * last, ahead[1] * last];
    }
    let direction = [held[0] / size, held[1] / size];
    let exponent = length * (S::from(1.0) - share) * stiffness * inverse_mean(size, last);
    let factor = (-exponent).exp();
    let cosine = dot(direction, ahead);
    // cos ψ = (1 - tan²) / (1 + tan²) of half the angle; rounding may put the cosine out of -1 to 1
    let above = |x: S| if x.re() > 0.0 { x } else { zero };
    let (plus, minus) = (above(cosine + 1.0), above(-cosine + 1.0));
    let denominator = plus + minus * factor * factor;
    if denominator.re() <= 0.0 {
        return [direction[0] * last, direction[1] * last]; // exactly against the motion, and it stays so
    }
    let along = (plus - minus * factor * factor) / denominator;
    let turned = factor * 2.0 / denominator;
    let across = beyond(direction, -cosine, ahead);
    let out = beyond([ahead[0] * along, ahead[1] * along], turned, across);
    [out[0] * last, out[1] * last]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radial return in many small steps, which is of first order.
    fn in_small_steps(mut force: [f64; 2], way: [f64; 2], stiffness: f64, limits: [f64; 2], steps: u32) -> [f64; 2] {
        for k in 1..=steps {
            let limit = limits[0] + (limits[1] - limits[0]) * f64::from(k) / f64::from(steps);
            force = beyond(force, stiffness / f64::from(steps), way);
            let size = dot(force, force).sqrt();
            if size > limit {
                force = [force[0] * limit / size, force[1] * limit / size];
            }
        }
        force
    }

    #[test]
    fn a_step_is_the_limit_of_radial_return_in_small_steps() {
        let mut worst = [0.0f64; 2];
        for k in 0..60 {
            let turn = 0.7 * f64::from(k);
            let limits = [[1.0, 1.0], [1.0, 0.4], [0.5, 1.3], [1.0, 0.0], [0.02, 1.0]][k as usize % 5];
            let start = [0.3, 1.0, 0.99][k as usize % 3] * limits[0];
            let force = [start * turn.cos(), start * turn.sin()];
            let way = [0.2 + 0.05 * f64::from(k), 0.1];
            let found = step(force, way, 0.9, limits);
            for (worst, steps) in worst.iter_mut().zip([2000, 8000]) {
                let small = in_small_steps(force, way, 0.9, limits, steps);
                *worst = worst.max((found[0] - small[0]).hypot(found[1] - small[1]));
            }
        }
        assert!(worst[1] < 1e-3 && (3.5..4.5).contains(&(worst[0] / worst[1])), "of first order: {worst:?}");
    }

    #[test]
    fn a_step_in_two_halves_is_one_step() {
        for k in 0..40 {
            let turn = 1.3 * f64::from(k);
            let limits = [0.2 + 0.1 * f64::from(k % 7), 0.1 + 0.2 * f64::from(k % 5)];
            let (force, way) = ([limits[0] * turn.cos(), limits[0] * turn.sin()], [0.4, -0.3]);
            let middle = 0.5 * (limits[0] + limits[1]);
            let half = step(force, [0.2, -0.15], 3.0, [limits[0], middle]);
            let (twice, once) = (step(half, [0.2, -0.15], 3.0, [middle, limits[1]]), step(force, way, 3.0, limits));
            assert!((twice[0] - once[0]).hypot(twice[1] - once[1]) < 1e-13, "{k}: {twice:?} {once:?}");
        }
    }
}
