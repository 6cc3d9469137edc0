//! Slip in a plane: the force of a spring-slider at the end of a straight step, with a slip
//! limit that changes linearly along the step.
//!
//! During slip the force `T = R n` has the magnitude of the limit R and turns towards the
//! motion. Let ψ be the angle between force and motion and s the path length. Then
//! `ψ' = -(k / R) sin ψ`, so `tan(ψ/2)` decreases by the factor `exp(-k ∫ ds / R)`. At a
//! constant limit this is the closed form of Krieg and Key. At a linearly changing limit the
//! integral is a logarithm.
//! Slip lasts until the end of the step, because ψ only decreases. Its beginning is the root of
//! a quadratic equation. The step is therefore exact for a straight path and a linear limit.
//! Source: Krieg and Key, "Implementation of a time-independent plasticity theory into
//! structural computer programs" (1977). The changing limit is derived here.

use stickslip_numerics::dual::Real;

/// `a · b`.
pub(in crate::law) fn dot<S: Real>(a: [S; 2], b: [S; 2]) -> S {
    a[0] * b[0] + a[1] * b[1]
}

/// `a + s b`.
fn axpy<S: Real>(a: [S; 2], s: S, b: [S; 2]) -> [S; 2] {
    [a[0] + b[0] * s, a[1] + b[1] * s]
}

/// Returns the direction of a force that slipped in the previous step and continues to slip. `b`
/// is the growth of the force along the path, `c` its distance from the limit, see [`step`].
/// The force is normalized by the limit instead of its length. The square roots and the
/// exponential of a step then do not wait for the result of the previous step.
#[inline]
fn continued_slip_direction<S: Real>(force: [S; 2], first: S, b: S, c: S) -> Option<[S; 2]> {
    let square = first.re() * first.re();
    // Relative tolerance between the squared force and the squared limit at which the force
    // counts as being at the limit. It covers the rounding of the previous step.
    let on = b.re() > 0.0 && square >= f64::MIN_POSITIVE && c.re().abs() <= 1e-14 * square;
    on.then(|| {
        let inverse = first.recip();
        // 1 / |force| to first order in the rounding error
        let scale = inverse * (-dot(force, force) * (inverse * inverse) * 0.5 + 1.5);
        [force[0] * scale, force[1] * scale]
    })
}

/// `ln(to / from) / (to - from)`: the reciprocal of the logarithmic mean.
#[inline]
fn inverse_mean<S: Real>(from: S, to: S) -> S {
    let sum = to + from;
    let change = (to - from) / sum;
    // Below this difference of the limits, relative to their sum, the logarithm is replaced by
    // its series. The ninth term is then below rounding.
    if change.re().abs() < 0.1 {
        // ln((1 + x) / (1 - x)) / 2x
        let square = change * change;
        let high = ((square * (1.0 / 15.0) + 1.0 / 13.0) * square + 1.0 / 11.0) * square + 1.0 / 9.0;
        let series = (((high * square + 1.0 / 7.0) * square + 0.2) * square + 1.0 / 3.0) * square + 1.0;
        return series * 2.0 / sum;
    }
    (to / from).ln() / (to - from)
}

/// Returns the force (N) of a spring-slider after a straight step `increment` (m), from the
/// `force` before it. Meanwhile the slip limit changes linearly from the first to the second of
/// `limits` (N, not negative). The initial force does not exceed the first limit.
#[inline]
pub(in crate::law) fn step<S: Real>(force: [S; 2], increment: [S; 2], stiffness: f64, limits: [S; 2]) -> [S; 2] {
    let [first, last] = limits;
    let zero = S::from(0.0);
    if last.re() <= 0.0 {
        return [zero; 2];
    }
    let trial = [force[0] + increment[0] * stiffness, force[1] + increment[1] * stiffness];
    let beyond_limit = dot(trial, trial) - last * last;
    if beyond_limit.re() <= 0.0 {
        return trial;
    }
    if dot(increment, increment).re() == 0.0 {
        // the limit falls below the force of a joint that does not move
        let size = dot(trial, trial).sqrt();
        return [trial[0] * last / size, trial[1] * last / size];
    }
    // |force + stiffness s increment| reaches the limit at the fraction s of the path. It solves
    // a s² + b s + c = 0 with c <= 0 and a + b + c > 0.
    let change = last - first;
    let a = dot(increment, increment) * (stiffness * stiffness) - change * change;
    let b = (dot(force, increment) * stiffness - first * change) * 2.0;
    let c = dot(force, force) - first * first;
    let length = dot(increment, increment).sqrt();
    let ahead = [increment[0] / length, increment[1] / length];
    // A pass with derivatives always solves for the beginning of slip.
    let on = if S::NDERIV == 0 { continued_slip_direction(force, first, b, c) } else { None };
    let (share, size, direction) = match on {
        Some(direction) => (zero, first, direction),
        None => {
            let discriminant = b * b - a * c * 4.0;
            let share = if discriminant.re() <= 0.0 {
                zero // it slips at once, with the motion across the force
            } else if b.re() > 0.0 {
                c * -2.0 / (b + discriminant.sqrt())
            } else {
                (discriminant.sqrt() - b) / (a * 2.0)
            };
            let held = axpy(force, share * stiffness, increment);
            let size = dot(held, held).sqrt();
            if size.re() <= 0.0 {
                // contact that begins here slips along the motion
                return [ahead[0] * last, ahead[1] * last];
            }
            (share, size, [held[0] / size, held[1] / size])
        }
    };
    let exponent = length * (S::from(1.0) - share) * stiffness * inverse_mean(size, last);
    let factor = (-exponent).exp();
    let cosine = dot(direction, ahead);
    // cos ψ = (1 - tan²) / (1 + tan²) of ψ/2; rounding may move the cosine out of -1 to 1
    let above = |x: S| if x.re() > 0.0 { x } else { zero };
    let (plus, minus) = (above(cosine + 1.0), above(-cosine + 1.0));
    let denominator = plus + minus * factor * factor;
    if denominator.re() <= 0.0 {
        // the force is exactly opposite to the motion and stays there
        return [direction[0] * last, direction[1] * last];
    }
    let along = (plus - minus * factor * factor) / denominator;
    let turned = factor * 2.0 / denominator;
    let across = axpy(direction, -cosine, ahead);
    let out = axpy([ahead[0] * along, ahead[1] * along], turned, across);
    [out[0] * last, out[1] * last]
}

/// Derivatives of the force after a step, `[component][by component]`, with respect to the force
/// before, the path, and the two limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::law) struct PlanarDerivatives {
    pub(in crate::law) by_force: [[f64; 2]; 2],
    pub(in crate::law) by_increment: [[f64; 2]; 2],
    pub(in crate::law) by_limits: [[f64; 2]; 2],
}

impl PlanarDerivatives {
    pub(in crate::law) const NONE: PlanarDerivatives =
        PlanarDerivatives { by_force: [[0.0; 2]; 2], by_increment: [[0.0; 2]; 2], by_limits: [[0.0; 2]; 2] };
}

/// Derivatives of a scalar with respect to the components of the force, those of the path, and
/// the limits.
#[derive(Debug, Clone, Copy)]
struct ScalarGradient {
    force: [f64; 2],
    increment: [f64; 2],
    limits: [f64; 2],
}

impl ScalarGradient {
    const NONE: ScalarGradient = ScalarGradient { force: [0.0; 2], increment: [0.0; 2], limits: [0.0; 2] };

    /// `a self + b other`.
    fn combined(self, a: f64, other: ScalarGradient, b: f64) -> ScalarGradient {
        let pair = |x: [f64; 2], y: [f64; 2]| [a * x[0] + b * y[0], a * x[1] + b * y[1]];
        ScalarGradient {
            force: pair(self.force, other.force),
            increment: pair(self.increment, other.increment),
            limits: pair(self.limits, other.limits),
        }
    }
}

/// `radial δsize + size across δangle`, for a force `size radial`.
#[inline]
fn force_derivatives(radial: [f64; 2], last: f64, angle: ScalarGradient) -> PlanarDerivatives {
    let across = [-radial[1] * last, radial[0] * last];
    let outer = |by: [f64; 2]| across.map(|across| [across * by[0], across * by[1]]);
    let mut slopes = PlanarDerivatives {
        by_force: outer(angle.force),
        by_increment: outer(angle.increment),
        by_limits: outer(angle.limits),
    };
    for (slope, radial) in slopes.by_limits.iter_mut().zip(radial) {
        slope[1] += radial;
    }
    slopes
}

/// Computes [`step`] with its derivatives. At the end of slip the force is `R (cos α, sin α)`.
/// Let `ψ₁` be the angle at which slip begins. Then `tan(ψ₂/2) = e⁻ᴱ tan(ψ₁/2)` gives
/// `δψ₂ = t δψ₁ - sin ψ₂ δE` with `t = sin ψ₂ / sin ψ₁`.
#[inline]
pub(in crate::law) fn step_with_slopes(
    force: [f64; 2],
    increment: [f64; 2],
    stiffness: f64,
    limits: [f64; 2],
) -> ([f64; 2], PlanarDerivatives) {
    let [first, last] = limits;
    if last <= 0.0 {
        return ([0.0; 2], PlanarDerivatives::NONE);
    }
    let trial = axpy(force, stiffness, increment);
    if dot(trial, trial) <= last * last {
        let one = [[1.0, 0.0], [0.0, 1.0]];
        return (
            trial,
            PlanarDerivatives {
                by_force: one,
                by_increment: one.map(|row| row.map(|x| stiffness * x)),
                ..PlanarDerivatives::NONE
            },
        );
    }
    let length = dot(increment, increment).sqrt();
    if length == 0.0 {
        let size = dot(trial, trial).sqrt();
        let radial = [trial[0] / size, trial[1] / size];
        let by_force = [-radial[1] / size, radial[0] / size];
        let angle =
            ScalarGradient { force: by_force, increment: by_force.map(|x| stiffness * x), ..ScalarGradient::NONE };
        return ([radial[0] * last, radial[1] * last], force_derivatives(radial, last, angle));
    }
    let ahead = [increment[0] / length, increment[1] / length];
    let heading = ScalarGradient { increment: [-ahead[1] / length, ahead[0] / length], ..ScalarGradient::NONE };
    // beginning of slip
    let change = last - first;
    let a = length * length * (stiffness * stiffness) - change * change;
    let b = (dot(force, increment) * stiffness - first * change) * 2.0;
    let c = dot(force, force) - first * first;
    let (share, root, held, size, direction) = match continued_slip_direction(force, first, b, c) {
        Some(direction) => (0.0, b, force, first, direction),
        None => {
            let root = (b * b - a * c * 4.0).max(0.0).sqrt();
            let share = if root <= 0.0 {
                0.0
            } else if b > 0.0 {
                c * -2.0 / (b + root)
            } else {
                (root - b) / (a * 2.0)
            };
            let held = axpy(force, share * stiffness, increment);
            let size = dot(held, held).sqrt();
            if size <= 0.0 {
                return ([ahead[0] * last, ahead[1] * last], force_derivatives(ahead, last, heading));
            }
            (share, root, held, size, [held[0] / size, held[1] / size])
        }
    };
    // derivatives of the fraction s, from |held| = first + s · change
    let begins = if root > 0.0 {
        let by = -2.0 / root;
        ScalarGradient {
            force: [by * held[0], by * held[1]],
            increment: held.map(|x| by * share * stiffness * x),
            limits: [-by * size * (1.0 - share), -by * size * share],
        }
    } else {
        ScalarGradient::NONE
    };
    // derivatives of a component of `held`
    let of_held = |along: [f64; 2]| {
        let own =
            ScalarGradient { force: along, increment: along.map(|x| share * stiffness * x), ..ScalarGradient::NONE };
        own.combined(1.0, begins, stiffness * dot(increment, along))
    };
    let turns = of_held([-direction[1] / size, direction[0] / size]);
    let (mean, by_last) = inverse_mean_with_slope(size, last);
    let by_size = -(mean + last * by_last) / size;
    let rest = length * (1.0 - share) * stiffness;
    let factor = (-rest * mean).exp();
    let cosine = dot(direction, ahead);
    let (plus, minus) = ((1.0 + cosine).max(0.0), (1.0 - cosine).max(0.0));
    let denominator = plus + minus * factor * factor;
    if denominator <= 0.0 {
        return ([direction[0] * last, direction[1] * last], force_derivatives(direction, last, turns));
    }
    let along = (plus - minus * factor * factor) / denominator;
    let turned = factor * 2.0 / denominator;
    let across = axpy(direction, -cosine, ahead);
    let out = axpy([ahead[0] * along, ahead[1] * along], turned, across);
    // signed sine of the angle from the motion to the force
    let sine = ahead[0] * out[1] - ahead[1] * out[0];
    let of_rest = ScalarGradient {
        increment: ahead.map(|x| (1.0 - share) * stiffness * mean * x),
        limits: [0.0, rest * by_last],
        ..ScalarGradient::NONE
    };
    let exponent =
        of_rest.combined(1.0, begins, -length * stiffness * mean).combined(1.0, of_held(direction), rest * by_size);
    let angle = heading.combined(1.0 - turned, turns, turned).combined(1.0, exponent, -sine);
    ([out[0] * last, out[1] * last], force_derivatives(out, last, angle))
}

/// Returns [`inverse_mean`] and its derivative with respect to `to`. The derivative with respect
/// to `from` follows because the function is homogeneous of degree -1.
#[inline]
fn inverse_mean_with_slope(from: f64, to: f64) -> (f64, f64) {
    let change = to / from - 1.0;
    let mean = inverse_mean(from, to);
    // Below this relative change of the limit, the derivative is replaced by its series. The
    // fifth term is then below rounding.
    let slope = if change.abs() < 1e-3 {
        (((change * 0.8 - 0.75) * change + 2.0 / 3.0) * change - 0.5) / (from * from)
    } else {
        (1.0 / to - mean) / (to - from)
    };
    (mean, slope)
}

/// The magnitude of a force along a vector, as a function of the magnitude of the vector.
pub(in crate::law) struct RadialForce {
    /// Magnitude of the force.
    pub value: f64,
    /// Its derivative with respect to the magnitude of the vector.
    pub rise: f64,
}

/// Writes a force along `y` of magnitude `size`, and its derivative with respect to y.
pub(in crate::law) fn radial(y: &[f64], size: f64, magnitude: RadialForce, force: &mut [f64], slope: &mut [f64]) {
    let RadialForce { value, rise } = magnitude;
    // perpendicular to y, only the direction changes
    let across = if size > 0.0 { value / size } else { rise };
    for i in 0..2 {
        force[i] = across * y[i];
        for j in 0..2 {
            let unit = if i == j { 1.0 } else { 0.0 };
            let along = if size > 0.0 { y[i] / size * (y[j] / size) } else { 0.0 };
            slope[2 * i + j] = across * unit + (rise - across) * along;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_numerics::dual::{Dual, partials, variable};

    /// Hand-written derivatives agree with those of dual numbers, in every branch of the step.
    #[test]
    fn slopes_are_those_of_dual_numbers() {
        let mut slid = 0;
        for k in 0..3000usize {
            let noise = |i: usize| ((k * 7919 + i * 104_729 + 13) as f64).sin();
            let limits = match k % 7 {
                0 => [0.8, 0.8],
                1 => [0.8, 0.8 + 4e-4 * noise(1)],
                2 => [0.0, 0.5],
                3 => [0.6, 0.0],
                _ => [1.0 + 0.9 * noise(2), 1.0 + 0.9 * noise(3)],
            };
            let start = [0.0, 0.5, 1.0][k % 3] * limits[0];
            let turn = 3.0 * noise(4);
            let force = [start * turn.cos(), start * turn.sin()];
            let increment = match k % 11 {
                0 => [0.0; 2],
                1 => force.map(|f| 2.0 * f),
                _ => [3.0 * noise(5), 3.0 * noise(6)],
            };
            let stiffness = 0.7;
            let (found, slopes) = step_with_slopes(force, increment, stiffness, limits);
            let seeded = |x: f64, i: usize| -> Dual<6> { variable(x, i) };
            let dual = step(
                [seeded(force[0], 0), seeded(force[1], 1)],
                [seeded(increment[0], 2), seeded(increment[1], 3)],
                stiffness,
                [seeded(limits[0], 4), seeded(limits[1], 5)],
            );
            let value = step(force, increment, stiffness, limits);
            assert!((value[0] - found[0]).hypot(value[1] - found[1]) <= 1e-13, "{k}: {value:?} {found:?}");
            slid += usize::from(found[0].hypot(found[1]) > 0.999_999 * limits[1] && limits[1] > 0.0);
            for a in 0..2 {
                assert!((dual[a].re - found[a]).abs() <= 1e-13, "{k}: {found:?}");
                let by_hand = [slopes.by_force[a], slopes.by_increment[a], slopes.by_limits[a]].concat();
                let exact = partials(&dual[a]);
                if exact.iter().any(|x| !x.is_finite()) {
                    continue; // the square root of zero has no derivative
                }
                // Derivatives grow if the path is nearly tangent to the limit circle, and their
                // rounding errors grow with them.
                let size = exact.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
                for (hand, exact) in by_hand.iter().zip(exact) {
                    assert!((hand - exact).abs() <= 1e-10 * size * size, "{k}: {by_hand:?} {:?}", partials(&dual[a]));
                }
            }
        }
        assert!(slid > 1000, "{slid}");
    }

    /// Radial return in many small steps, a first-order method.
    fn in_small_steps(
        mut force: [f64; 2],
        increment: [f64; 2],
        stiffness: f64,
        limits: [f64; 2],
        steps: u32,
    ) -> [f64; 2] {
        for k in 1..=steps {
            let limit = limits[0] + (limits[1] - limits[0]) * f64::from(k) / f64::from(steps);
            force = axpy(force, stiffness / f64::from(steps), increment);
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
            let increment = [0.2 + 0.05 * f64::from(k), 0.1];
            let found = step(force, increment, 0.9, limits);
            for (worst, steps) in worst.iter_mut().zip([2000, 8000]) {
                let small = in_small_steps(force, increment, 0.9, limits, steps);
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
            let (force, increment) = ([limits[0] * turn.cos(), limits[0] * turn.sin()], [0.4, -0.3]);
            let middle = 0.5 * (limits[0] + limits[1]);
            let half = step(force, [0.2, -0.15], 3.0, [limits[0], middle]);
            let (twice, once) =
                (step(half, [0.2, -0.15], 3.0, [middle, limits[1]]), step(force, increment, 3.0, limits));
            assert!((twice[0] - once[0]).hypot(twice[1] - once[1]) < 1e-13, "{k}: {twice:?} {once:?}");
        }
    }
}
