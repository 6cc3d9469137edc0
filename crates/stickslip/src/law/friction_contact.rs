//! A frictional contact with separation: an elastic normal direction, and elastic friction in
//! one or two tangential directions.
//!
//! Normal: `N = max(preload + kn un, 0)` with `un > 0` closing. Tangential: `T = kt (u - s)`,
//! `|T| <= mu N`, slip in the direction of T; the friction disk couples two tangential
//! directions. At zero N the faces are separated, and T is zero. Faces that close again start
//! with zero T.
//! All of `T` and `N`, including the preload, acts on the structure: the preload pushes the
//! places apart, and the springs of the structure carry it.
//! Source: Yang, Chu, Menq, "Stick-slip-separation analysis and non-linear stiffness and damping
//! characterization of friction contacts having variable normal load" (1998), and for three
//! directions Yang and Menq (1998).
//!
//! A step with a straight path is exact. The normal load changes linearly along it. A step that
//! closes the contact counts only its closed part. Slip in a plane is integrated in closed form.
//! The law has no regularized version: the state rate of a tangential spring with an arctangent
//! slider is unbounded as the load goes to zero.

use super::kernels::planar_slip;
use super::{
    Contact, DisplacementBox, Law, LawInfo, MAX_DIRECTIONS, Parameter, Range, SharedLaw, StepDerivatives, StepLaw,
    StepView, TANGENTS,
};
use crate::dimension::Dimension;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "friction-contact",
    summary: "contact with separation, N = max(preload + kn un, 0), elastic friction |T| <= friction N along one or two tangents",
    parameters: &[
        Parameter::positive("tangential", Dimension::STIFFNESS, "tangential contact stiffness, kt"),
        Parameter::positive("normal", Dimension::STIFFNESS, "normal contact stiffness, kn"),
        Parameter::new("friction", Dimension::NONE, Range::ZeroOrMore, "coefficient of friction"),
        Parameter::new(
            "preload",
            Dimension::FORCE,
            Range::Any,
            "normal load at zero displacement; an elastic structure relieves part of it; negative: a gap of -preload/normal",
        )
        .with_default(0.0),
        Parameter::new(
            TANGENTS,
            Dimension::NONE,
            Range::Count(2),
            "number of tangential directions; by default that of the nodes",
        )
        .with_default(2.0),
    ],
    sample: &[10_000.0, 15_000.0, 0.3, 6.0, 2.0],
    build: |values| {
        Arc::new(FrictionContact {
            tangential: values[0],
            normal: values[1],
            friction: values[2],
            preload: values[3],
            tangents: values[4] as usize,
        })
    },
};

/// A frictional contact with separation. Its directions are the tangential ones, then the
/// normal. The internal states are the tangential force components, N.
///
/// # Example
/// ```
/// use stickslip::law::{FrictionContact, StepLaw};
/// let law =
///     FrictionContact { tangential: 1.0, normal: 2.0, friction: 0.5, preload: 4.0, tangents: 1 };
/// let mut z = [0.0];
/// // normal load 4 N + 2 N/m · 1 m, slip at half of it
/// assert_eq!(law.advance(&[0.0; 3], &[9.0, 1.0, 0.0], &mut z)[..2], [3.0, 6.0]);
/// // separated
/// assert_eq!(law.advance(&[9.0, 1.0, 0.0], &[9.0, -2.0, 0.0], &mut z)[..2], [0.0, 0.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionContact {
    /// Tangential stiffness `kt`, N/m.
    pub tangential: f64,
    /// Normal stiffness `kn`, N/m.
    pub normal: f64,
    /// Coefficient of friction `mu`.
    pub friction: f64,
    /// Normal load at zero displacement, N; negative if there is a gap.
    pub preload: f64,
    /// Number of tangential directions, 1 or 2.
    pub tangents: usize,
}

impl Law for FrictionContact {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.tangential, self.normal, self.friction, self.preload, self.tangents as f64]
    }
    fn directions(&self) -> usize {
        self.tangents + 1
    }
    fn normal(&self) -> Option<usize> {
        Some(self.tangents)
    }
    fn with_preload(&self, force: f64) -> Option<SharedLaw> {
        (self.preload <= 0.0).then(|| Arc::new(FrictionContact { preload: force, ..*self }) as SharedLaw)
    }
    fn with_limit_factor(&self, factor: f64) -> Option<SharedLaw> {
        Some(Arc::new(FrictionContact { friction: factor * self.friction, ..*self }))
    }
    fn closed_stiffness(&self) -> Option<Vec<f64>> {
        // faces without friction never stick
        let tangential = if self.friction > 0.0 { self.tangential } else { 0.0 };
        Some((0..self.tangents).map(|_| tangential).chain([self.normal]).collect())
    }
    /// The slip limit at zero displacement; infinite without a preload or friction.
    fn force_scale(&self) -> f64 {
        let limit = self.friction * self.preload;
        if limit > 0.0 { limit } else { f64::INFINITY }
    }
    fn step(&self) -> Option<&dyn StepView> {
        Some(self)
    }
    /// Closing and opening differ.
    fn is_odd(&self) -> bool {
        false
    }
    fn contact_state(&self, velocity: &[f64], force: &[f64]) -> Contact {
        let normal = force[self.tangents];
        if normal <= 0.0 {
            return Contact::Open;
        }
        Contact::of_sticking_law(self.friction * normal, &velocity[..self.tangents], &force[..self.tangents])
    }
}

impl StepLaw for FrictionContact {
    fn states(&self) -> usize {
        self.tangents
    }
    fn state_scale(&self) -> f64 {
        if self.force_scale().is_finite() { self.force_scale() } else { 1.0 }
    }
    #[inline]
    fn advance<S: Real>(
        &self,
        from: &[S; MAX_DIRECTIONS],
        to: &[S; MAX_DIRECTIONS],
        z: &mut [S],
    ) -> [S; MAX_DIRECTIONS] {
        let zero = S::from(0.0);
        let load = |u: &[S; MAX_DIRECTIONS]| u[self.tangents] * self.normal + self.preload;
        let (before, after) = (load(from), load(to));
        let mut out = [zero; MAX_DIRECTIONS];
        if after.re() <= 0.0 {
            z.fill(zero);
            return out;
        }
        // the fraction of the path on which the faces touch
        let (first, closed) = if before.re() < 0.0 {
            z.fill(zero);
            (zero, after / (after - before))
        } else {
            (before * self.friction, S::from(1.0))
        };
        let last = after * self.friction;
        match z {
            [force] => {
                // In one direction, both bounds of the force change linearly, so the limit at
                // the end of the step decides.
                let trial = *force + (to[0] - from[0]) * closed * self.tangential;
                *force = if trial.re() > last.re() {
                    last
                } else if trial.re() < -last.re() {
                    -last
                } else {
                    trial
                };
            }
            [one, two, ..] => {
                let increment = [0, 1].map(|a| (to[a] - from[a]) * closed);
                [*one, *two] = planar_slip::step([*one, *two], increment, self.tangential, [first, last]);
            }
            [] => {}
        }
        out.iter_mut().zip(&*z).for_each(|(out, z)| *out = *z);
        out[self.tangents] = after;
        out
    }
    fn analytic_derivatives(
        &self,
        from: &[f64; MAX_DIRECTIONS],
        to: &[f64; MAX_DIRECTIONS],
        z: &mut [f64],
        slopes: StepDerivatives<'_>,
    ) -> Option<[f64; MAX_DIRECTIONS]> {
        let (t, directions) = (self.tangents, slopes.directions);
        let load = |u: &[f64; MAX_DIRECTIONS]| u[t] * self.normal + self.preload;
        let (before, after) = (load(from), load(to));
        slopes.force.fill(0.0);
        slopes.state.fill(0.0);
        let mut out = [0.0; MAX_DIRECTIONS];
        if after <= 0.0 {
            z.fill(0.0);
            return Some(out);
        }
        let closes = before < 0.0;
        // the closed fraction of the path, and its derivatives with respect to the normal
        // displacement before and after
        let (closed, by_normal) = if closes {
            z.fill(0.0);
            let whole = after - before;
            (after / whole, [after / whole, -before / whole].map(|part| part * self.normal / whole))
        } else {
            (1.0, [0.0; 2])
        };
        let limits = [if closes { 0.0 } else { before * self.friction }, after * self.friction];
        let increment: [f64; 2] = std::array::from_fn(|a| if a < t { (to[a] - from[a]) * closed } else { 0.0 });
        let (force, own) = match z {
            [force] => {
                let (force, own) = line_step_with_derivatives(*force, increment[0], self.tangential, limits[1]);
                ([force, 0.0], own)
            }
            _ => planar_slip::step_with_slopes([z[0], z[1]], increment, self.tangential, limits),
        };
        z.iter_mut().zip(force).for_each(|(z, force)| *z = force);
        let slip = [if closes { 0.0 } else { self.friction }, self.friction].map(|by| by * self.normal);
        let width = 2 * directions + t;
        for (a, row) in slopes.state.chunks_exact_mut(width).enumerate() {
            for b in 0..t {
                let by = own.by_increment[a][b];
                row[b] = -by * closed;
                row[directions + b] = by * closed;
                row[t] += by * (to[b] - from[b]) * by_normal[0];
                row[directions + t] += by * (to[b] - from[b]) * by_normal[1];
                row[2 * directions + b] = if closes { 0.0 } else { own.by_force[a][b] };
            }
            row[t] += own.by_limits[a][0] * slip[0];
            row[directions + t] += own.by_limits[a][1] * slip[1];
        }
        slopes.force[..t * width].copy_from_slice(slopes.state);
        slopes.force[t * width + directions + t] = self.normal;
        out.iter_mut().zip(&*z).for_each(|(out, z)| *out = *z);
        out[t] = after;
        Some(out)
    }
    fn sticks_throughout(
        &self,
        (from, z): (&[f64; MAX_DIRECTIONS], &[f64]),
        DisplacementBox { mean, half_width }: DisplacementBox<'_>,
    ) -> bool {
        let t = self.tangents;
        let closed = self.preload + self.normal * from[t];
        let least = self.preload + self.normal * (mean[t] - half_width[t]);
        let at_mean = (0..t).map(|a| z[a] + self.tangential * (mean[a] - from[a]));
        let length = |squares: f64| squares.sqrt();
        let pull = length(at_mean.map(|f| f * f).sum())
            + self.tangential * length(half_width[..t].iter().map(|u| u * u).sum());
        // A straight path between two states inside the friction cone stays inside it.
        closed > 0.0 && least > 0.0 && pull < self.friction * least
    }
}

/// Computes [`planar_slip::step_with_slopes`] for a single direction, where the limit at the end
/// of the step decides.
fn line_step_with_derivatives(
    force: f64,
    increment: f64,
    stiffness: f64,
    limit: f64,
) -> (f64, planar_slip::PlanarDerivatives) {
    let trial = force + increment * stiffness;
    let mut slopes = planar_slip::PlanarDerivatives::NONE;
    if trial.abs() > limit {
        slopes.by_limits[0][1] = trial.signum();
        return (limit.copysign(trial), slopes);
    }
    (slopes.by_force[0][0], slopes.by_increment[0][0]) = (1.0, stiffness);
    (trial, slopes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step that closes the contact counts only its closed part. It equals two steps that are
    /// separated at the instant of closing.
    #[test]
    fn a_closing_step_equals_two_steps() {
        for tangents in [1, 2] {
            let law = FrictionContact { tangential: 3.0, normal: 2.0, friction: 0.9, preload: -1.0, tangents };
            let at = |t: f64| {
                let mut u = [0.0; 3];
                (u[0], u[1]) = (0.8 * t, -0.5 * t);
                u[tangents] = -1.0 + 3.0 * t;
                u
            };
            let (mut once, mut twice) = (vec![0.7; tangents], vec![0.7; tangents]);
            let one = law.advance(&at(0.0), &at(1.0), &mut once);
            law.advance(&at(0.0), &at(0.5), &mut twice); // N = 0 at t = 0.5
            let two = law.advance(&at(0.5), &at(1.0), &mut twice);
            for a in 0..=tangents {
                assert!((one[a] - two[a]).abs() < 1e-14, "{one:?} {two:?}");
            }
            assert!(one[tangents] > 0.0 && one[0] > 0.0);
        }
    }

    #[test]
    fn one_tangent_equals_two_with_one_at_rest() {
        let one = FrictionContact { tangential: 3.0, normal: 2.0, friction: 0.4, preload: 1.0, tangents: 1 };
        let two = FrictionContact { tangents: 2, ..one };
        let (mut z, mut w) = ([0.0; 1], [0.0; 2]);
        let (mut before, mut wide) = ([0.0; 3], [0.0; 3]);
        for k in 1..400 {
            let t = 0.05 * f64::from(k);
            let u = [t.sin() + 0.4 * (2.3 * t).cos(), 0.9 * (1.3 * t).sin()];
            let (to, to_wide) = ([u[0], u[1], 0.0], [u[0], 0.0, u[1]]);
            let (a, b) = (one.advance(&before, &to, &mut z), two.advance(&wide, &to_wide, &mut w));
            assert!((a[0] - b[0]).abs() < 1e-13 && a[1] == b[2] && b[1] == 0.0, "{k}: {a:?} {b:?}");
            (before, wide) = (to, to_wide);
        }
    }

    /// The law without its hand-written derivatives.
    #[derive(Debug)]
    struct ByDuals(FrictionContact);

    impl StepLaw for ByDuals {
        fn states(&self) -> usize {
            self.0.tangents
        }
        fn advance<S: Real>(
            &self,
            from: &[S; MAX_DIRECTIONS],
            to: &[S; MAX_DIRECTIONS],
            z: &mut [S],
        ) -> [S; MAX_DIRECTIONS] {
            self.0.advance(from, to, z)
        }
    }

    /// Hand-written derivatives agree with those of dual numbers: sticking, slipping, closing,
    /// opening, separated.
    #[test]
    fn derivatives_by_hand_are_those_of_dual_numbers() {
        use crate::law::StepPoint;
        let mut met = [0; 3];
        for k in 0..2000usize {
            let noise = |i: usize| ((k * 7919 + i * 104_729 + 13) as f64).sin();
            let tangents = 1 + k % 2;
            let preload = noise(9) + (k % 3) as f64;
            let law = FrictionContact { tangential: 3.0, normal: 2.0, friction: 0.5, preload, tangents };
            let (mut start, mut from, mut to) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            for a in 0..=tangents {
                (start[a], from[a], to[a]) = (noise(a), noise(a + 3), noise(a + 6));
            }
            // within the limit before the step
            let mut z = vec![0.0; tangents];
            law.advance(&start, &from, &mut z);
            z.iter_mut().for_each(|z| *z *= 0.99);
            let n = tangents + 1;
            let (mut hand, mut dual) = (StepPoint::new(n, tangents), StepPoint::new(n, tangents));
            StepView::advance_with_derivatives(&law, n, &from, &to, &z, &mut hand);
            StepView::advance_with_derivatives(&ByDuals(law), n, &from, &to, &z, &mut dual);
            let load = |u: &[f64; 3]| law.preload + law.normal * u[tangents];
            met[if load(&to) <= 0.0 { 0 } else { 1 + usize::from(load(&from) < 0.0) }] += 1;
            let rows = |point: &StepPoint| -> Vec<f64> {
                let slopes = (0..n).flat_map(|a| point.force_slope(a).to_vec());
                slopes.chain((0..tangents).flat_map(|s| point.state_slope(s).to_vec())).chain(point.force).collect()
            };
            let (hand, dual) = (rows(&hand), rows(&dual));
            let size = dual.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            for (a, b) in hand.iter().zip(&dual) {
                assert!((a - b).abs() <= 1e-11 * size * size, "{k}: {law:?}\n{hand:?}\n{dual:?}");
            }
        }
        assert!(met.iter().all(|count| *count > 100), "{met:?}");
    }

    /// A contact that separates loses its history. A second cycle on the same path therefore
    /// ends early, at the first point with the states of the first cycle.
    #[test]
    fn a_cycle_ends_early_at_known_states() {
        let law = FrictionContact { tangential: 3.0, normal: 2.0, friction: 0.4, preload: 1.0, tangents: 2 };
        let n = 64;
        let angle = |i: usize| std::f64::consts::TAU * i as f64 / n as f64;
        let signal = |of: fn(f64) -> f64| (0..n).map(|i| of(angle(i))).collect::<Vec<f64>>();
        let path = [signal(f64::cos), signal(|t| (2.0 * t).sin()), signal(|t| 0.8 * (t - 1.0).sin())];
        let around = |z: &mut [f64], trail: &mut [f64], force: &mut [Vec<f64>; 3]| {
            StepView::advance_cycle(&law, 3, &path, (z, trail), force, None);
        };
        let fresh = || (vec![f64::NAN; 2 * n], [(); 3].map(|()| vec![0.0; n]));
        let (mut trail, mut force) = fresh();
        let mut z = [0.0; 2];
        around(&mut z, &mut trail, &mut force);
        let (mut whole_trail, mut whole) = fresh();
        let mut end = z;
        around(&mut end, &mut whole_trail, &mut whole);
        let last = std::mem::replace(&mut force[0][n - 1], f64::INFINITY);
        around(&mut z, &mut trail, &mut force);
        assert!(force[0][n - 1].is_infinite(), "followed to its end");
        force[0][n - 1] = last;
        assert_eq!((z, force, trail), (end, whole, whole_trail));
    }

    #[test]
    fn contact_states_follow_force_and_load() {
        let law = FrictionContact { tangential: 1.0, normal: 1.0, friction: 0.5, preload: 1.0, tangents: 2 };
        assert_eq!(law.contact_state(&[1.0, 0.0, 0.0], &[0.0, 0.0, 0.0]), Contact::Open);
        assert_eq!(law.contact_state(&[1.0, 0.0, 0.0], &[0.3, 0.4, 1.0]), Contact::Slip);
        assert_eq!(law.contact_state(&[0.0, 0.0, 0.0], &[0.1, 0.1, 1.0]), Contact::Stick);
    }
}
