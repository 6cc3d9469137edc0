//! Iwan model with Segalman's four-parameter distribution: micro-slip with power-law
//! dissipation.
//!
//! The model consists of parallel Jenkins elements. The elements that begin to slip at
//! displacements between φ and φ + dφ have the stiffness ρ(φ) dφ. The density is `ρ = R φ^χ` up
//! to `φmax`, plus a spring S that slips at φmax. With the initial stiffness `KT` and the slip
//! limit `FS`:
//! `φmax = FS (1 + β) / (KT (β + (χ+1)/(χ+2)))`,
//! `R = FS (χ+1) / (φmax^(χ+2) (β + (χ+1)/(χ+2)))`,
//! `S = (FS/φmax) β / (β + (χ+1)/(χ+2))`.
//! A cycle of amplitude u below φmax dissipates `4 R u^(χ+3) / ((χ+2) (χ+3))`.
//!
//! The force of first loading is `B(u) = KT (u - φmax x^(χ+2) / ((1+β) (χ+2)))` with
//! `x = u/φmax` up to 1, and FS beyond. All other branches follow from it exactly by Masing's
//! rules (see `masing.rs`), without discrete sliders.
//! Source: Segalman, "A four-parameter Iwan model for lap-type joints" (2005); Iwan (1966).
//!
//! With a positive number of `elements`, the distribution is divided into bins with geometric
//! grading. Each bin becomes one slider with the bin's stiffness and limit, for methods that
//! need discrete sliders. The force of first loading is then exact at the edges of the bins and
//! too large between them.

use super::interface::describing_function;
use super::interface::ideal_elements::UNREACHABLE_LIMIT;
use super::interface::masing::{
    MAX_LEGS, MasingView, advance_legs, complex_stiffness, first_unreversed_leg, leg_count, leg_force,
};
use super::{IdealElement, Law, LawInfo, MAX_DIRECTIONS, Parameter, Range, StepDerivatives, StepLaw, StepView};
use crate::dimension::Dimension;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "iwan",
    summary: "parallel spring-sliders with the continuous four-parameter distribution of Segalman",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "initial stiffness, KT"),
        Parameter::limit("slip limit, FS"),
        Parameter::new(
            "chi",
            Dimension::NONE,
            Range::Within(-1.0, 0.0),
            "exponent of the distribution, not -1 itself; a cycle dissipates an energy proportional to u^(chi+3)",
        ),
        Parameter::new(
            "beta",
            Dimension::NONE,
            Range::ZeroOrMore,
            "stiffness of the sliders that slip together at the slip limit, divided by that of all others",
        ),
        Parameter::new(
            "elements",
            Dimension::NONE,
            Range::UpTo(1000),
            "number of sliders that approximate the distribution, needed for `event-driven`; 0: continuous distribution",
        )
        .with_default(0.0),
    ],
    sample: &[10_000.0, 2.0, -0.5, 0.3, 0.0],
    build: |values| {
        Arc::new(Iwan {
            stiffness: values[0],
            limit: values[1],
            chi: values[2],
            beta: values[3],
            elements: values[4] as u32,
        })
    },
};

/// Parallel sliders with a four-parameter distribution.
///
/// # Example
/// ```
/// use stickslip::law::{Iwan, Law};
/// let law = Iwan { stiffness: 1e4, limit: 2.0, chi: -0.5, beta: 0.3, elements: 0 };
/// // the force of first loading at macro-slip
/// let far = law.slip_displacement();
/// assert!((law.masing().unwrap().backbone(far).0 - 2.0).abs() < 1e-14);
/// // 32 sliders and the spring that slips last
/// assert_eq!(Iwan { elements: 32, ..law }.ideal_elements().unwrap().len(), 33);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iwan {
    /// Initial stiffness `KT`, N/m.
    pub stiffness: f64,
    /// Slip limit `FS`, N.
    pub limit: f64,
    /// Exponent `χ` of the distribution, above -1, at most 0.
    pub chi: f64,
    /// Ratio `β` of the stiffness that slips last, at φmax, to that of the distribution.
    pub beta: f64,
    /// Number of sliders that approximate the distribution; 0: the exact distribution.
    pub elements: u32,
}

impl Iwan {
    /// `β + (χ+1)/(χ+2)`.
    fn denominator(&self) -> f64 {
        self.beta + (self.chi + 1.0) / (self.chi + 2.0)
    }

    /// Returns the displacement `φmax` of macro-slip, m.
    pub fn slip_displacement(&self) -> f64 {
        self.limit * (1.0 + self.beta) / (self.stiffness * self.denominator())
    }

    /// Returns the force of first loading (N) at a non-negative displacement. With a limit of
    /// `UNREACHABLE_LIMIT` or more, the law is the linear spring `KT`. Without this special case,
    /// a distribution with χ near -1 would slip in part at any displacement.
    fn first_loading<S: Real>(&self, u: S) -> S {
        let far = self.slip_displacement();
        if self.limit >= UNREACHABLE_LIMIT {
            return u * self.stiffness;
        }
        if u.re() >= far {
            return S::from(self.limit);
        }
        if u.re() <= 0.0 {
            // powers of zero have no derivative
            return u * self.stiffness;
        }
        let slipped = (u / far).powf(self.chi + 2.0) * (far / ((1.0 + self.beta) * (self.chi + 2.0)));
        (u - slipped) * self.stiffness
    }
}

impl Law for Iwan {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.limit, self.chi, self.beta, f64::from(self.elements)]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        self.limit
    }
    fn macro_slip_displacement(&self) -> Option<f64> {
        (self.limit > 0.0).then(|| self.slip_displacement())
    }
    /// Available with a positive number of elements. A slip limit of zero gives no parts.
    fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
        if self.limit == 0.0 {
            return Some(Vec::new());
        }
        if self.elements == 0 {
            return None;
        }
        let (far, chi, count) = (self.slip_displacement(), self.chi, self.elements);
        // In units of φmax and FS, the stiffness of all sliders up to x is proportional to
        // x^(χ+1), their limit to x^(χ+2).
        let stiffness = 1.0 / self.denominator();
        let limit = stiffness * (chi + 1.0) / (chi + 2.0);
        let edge = |bin: u32| match bin {
            0 => 0.0,
            // Ratio of successive bin edges is `exp(1.5 / √elements)`. More elements make
            // both the bins and the first bin smaller.
            bin => (-1.5 / f64::from(count).sqrt() * f64::from(count - bin)).exp(),
        };
        let mut pieces: Vec<IdealElement> = (0..count)
            .map(|bin| {
                let [from, to] = [edge(bin), edge(bin + 1)];
                let spring = stiffness * (to.powf(chi + 1.0) - from.powf(chi + 1.0));
                let slip = limit * (to.powf(chi + 2.0) - from.powf(chi + 2.0));
                IdealElement::slider(Some(spring * self.limit / far), slip * self.limit)
            })
            .collect();
        if self.beta > 0.0 {
            let last = self.limit * self.beta / self.denominator();
            pieces.push(IdealElement::slider(Some(last / far), last));
        }
        Some(pieces)
    }
    fn masing(&self) -> Option<&dyn MasingView> {
        (self.elements == 0 && self.limit > 0.0).then_some(self)
    }
    fn step(&self) -> Option<&dyn StepView> {
        (self.elements == 0 && self.limit > 0.0).then_some(self)
    }
    fn describing_function(&self, amplitude: f64, omega: f64) -> Complex64 {
        match (self.masing(), amplitude > 0.0) {
            (Some(law), true) => complex_stiffness(law, amplitude),
            (Some(_), false) => self.stiffness.into(),
            (None, _) => describing_function::complex_stiffness(self, amplitude, omega),
        }
    }
    fn is_incrementally_passive(&self) -> bool {
        true // each spring-slider is passive
    }
    fn check_consistency(&self) -> Result<(), String> {
        if self.chi > -1.0 {
            return Ok(());
        }
        Err("`chi` must be above -1; otherwise the initial stiffness is infinite".to_owned())
    }
}

impl MasingView for Iwan {
    fn backbone(&self, displacement: f64) -> (f64, f64) {
        let far = self.slip_displacement();
        let slope = match displacement / far {
            _ if self.limit >= UNREACHABLE_LIMIT => self.stiffness,
            x if x >= 1.0 => 0.0,
            x if x <= 0.0 => self.stiffness,
            x => self.stiffness * (1.0 - x.powf(self.chi + 1.0) / (1.0 + self.beta)),
        };
        (self.first_loading(displacement), slope)
    }
    fn slip_displacement(&self) -> f64 {
        Iwan::slip_displacement(self)
    }
}

impl StepLaw for Iwan {
    /// The legs of the history.
    fn states(&self) -> usize {
        MAX_LEGS
    }
    fn state_scale(&self) -> f64 {
        self.slip_displacement()
    }
    fn advance<S: Real>(
        &self,
        from: &[S; MAX_DIRECTIONS],
        to: &[S; MAX_DIRECTIONS],
        z: &mut [S],
    ) -> [S; MAX_DIRECTIONS] {
        advance_legs(z, to[0] - from[0], self.slip_displacement(), |k, leg| {
            leg_force(k, leg, |u| self.first_loading(u))
        });
        let legs = z.iter().take_while(|leg| leg.re() != 0.0).enumerate();
        let force: S = legs.map(|(k, leg)| leg_force(k, *leg, |u| self.first_loading(u))).sum();
        // a leg of zero length still has a slope
        let force = if z[0].re() == 0.0 { force + z[0] * self.stiffness } else { force };
        [force, S::from(0.0), S::from(0.0)]
    }
    /// All legs but the last are unchanged. The last leg is the sum of the step and the legs
    /// that it merges with.
    fn analytic_derivatives(
        &self,
        from: &[f64; MAX_DIRECTIONS],
        to: &[f64; MAX_DIRECTIONS],
        z: &mut [f64],
        slopes: StepDerivatives<'_>,
    ) -> Option<[f64; MAX_DIRECTIONS]> {
        let before = leg_count(z);
        // The step may drop or merge legs.
        if before == z.len() || first_unreversed_leg(&z[..before]).is_some() {
            return None;
        }
        let force = self.advance(from, to, z);
        let (last, width) = (leg_count(z).max(1) - 1, 2 + z.len());
        slopes.state.fill(0.0);
        slopes.force.fill(0.0);
        let slipping = z[0].abs() >= self.slip_displacement();
        for (k, row) in slopes.state.chunks_exact_mut(width).enumerate().take(last + 1) {
            if k < last {
                row[2 + k] = 1.0;
            } else if k > 0 || !slipping {
                (row[0], row[1]) = (-1.0, 1.0);
                row[2 + k..2 + before.max(k)].fill(1.0);
            }
            let scale = if k == 0 { 1.0 } else { 2.0 };
            let slope = self.backbone(z[k].abs() / scale).1;
            slopes.force.iter_mut().zip(row).for_each(|(force, by)| *force += slope * *by);
        }
        Some(force)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the force of first loading and the energy dissipated per cycle of the sliders.
    fn of_pieces(pieces: &[IdealElement], u: f64) -> (f64, f64) {
        pieces.iter().fold((0.0, 0.0), |(force, loss), piece| {
            let IdealElement::Slider(slider) = piece else { panic!("{piece:?}") };
            let hold = slider.limit / slider.stiffness.unwrap();
            (force + slider.limit * (u / hold).min(1.0), loss + 4.0 * slider.limit * (u - hold).max(0.0))
        })
    }

    /// Returns the exact values, by the formulas in the module documentation.
    fn exact(law: &Iwan, u: f64) -> (f64, f64) {
        let (chi, far, d) = (law.chi, law.slip_displacement(), law.denominator());
        let r = law.limit * (chi + 1.0) / (far.powf(chi + 2.0) * d);
        let s = law.limit / far * law.beta / d;
        let force =
            r * u.powf(chi + 2.0) / (chi + 2.0) + u * (r * (far.powf(chi + 1.0) - u.powf(chi + 1.0)) / (chi + 1.0) + s);
        (force, 4.0 * r * u.powf(chi + 3.0) / ((chi + 2.0) * (chi + 3.0)))
    }

    /// Hand-written derivatives agree with those of dual numbers, in loops that open, close and
    /// are erased by macro-slip.
    #[test]
    fn slopes_are_those_of_dual_numbers() {
        use stickslip_numerics::dual::{Dual, partials, variable};
        let law = Iwan { stiffness: 10.0, limit: 1.0, chi: -0.4, beta: 0.2, elements: 0 };
        let (mut z, mut u, mut deepest) = ([0.0; MAX_LEGS], 0.0, 0);
        for k in 0..3000 {
            let noise = ((k * 7919 + 13) as f64).sin();
            let to = u + noise * law.slip_displacement() * if k % 50 == 0 { 4.0 } else { 0.6 };
            let mut dual: [Dual<18>; MAX_LEGS] = std::array::from_fn(|i| variable(z[i], 2 + i));
            let (a, b): (Dual<18>, Dual<18>) = (variable(u, 0), variable(to, 1));
            let zero = Dual::<18>::from(0.0);
            let force = law.advance(&[a, zero, zero], &[b, zero, zero], &mut dual)[0];
            let (mut of_force, mut of_state) = (vec![0.0; 18], vec![0.0; 18 * MAX_LEGS]);
            let slopes = StepDerivatives { directions: 1, force: &mut of_force, state: &mut of_state };
            let full = z[MAX_LEGS - 1] != 0.0;
            let found = law.analytic_derivatives(&[u, 0.0, 0.0], &[to, 0.0, 0.0], &mut z, slopes);
            assert_eq!(found.is_none(), full);
            if let Some(found) = found {
                assert!((found[0] - force.re).abs() < 1e-14);
                for (i, exact) in partials(&force).into_iter().enumerate() {
                    assert!((of_force[i] - exact).abs() < 1e-11 * (1.0 + exact.abs()), "{k} {i}: {of_force:?}");
                }
                for (leg, row) in dual.iter().zip(of_state.chunks_exact(18)) {
                    assert!(partials(leg).iter().zip(row).all(|(a, b)| (a - b).abs() < 1e-14), "{k}: {row:?}");
                }
            } else {
                z = dual.map(|leg| leg.re);
            }
            deepest = deepest.max(z.iter().filter(|leg| **leg != 0.0).count());
            u = to;
        }
        assert!(deepest > 4, "{deepest}");
    }

    #[test]
    fn backbone_and_loss_are_met_to_the_stated_error() {
        for chi in [-0.9, -0.5, -0.2, 0.0] {
            for beta in [0.0, 0.3, 5.0] {
                let law = Iwan { stiffness: 10.0, limit: 1.0, chi, beta, elements: 32 };
                let pieces = law.ideal_elements().unwrap();
                let sum = |of: fn(&super::super::Slider) -> f64| {
                    let each = pieces
                        .iter()
                        .map(|piece| if let IdealElement::Slider(slider) = piece { of(slider) } else { 0.0 });
                    each.sum::<f64>()
                };
                assert!((sum(|slider| slider.limit) - 1.0).abs() < 1e-13, "all limits are FS");
                assert!((sum(|slider| slider.stiffness.unwrap()) - 10.0).abs() < 1e-12, "all springs are KT");
                let (mut force, mut loss) = (0.0f64, 0.0f64);
                for k in 0..=2000 {
                    let u = law.slip_displacement() * 500f64.powf(-f64::from(k) / 2000.0);
                    let (found, expected) = (of_pieces(&pieces, u), exact(&law, u));
                    assert!(found.0 >= expected.0 * (1.0 - 1e-12), "it is never below the exact force");
                    force = force.max(found.0 / expected.0 - 1.0);
                    loss = loss.max((found.1 / expected.1 - 1.0).abs());
                }
                assert!(force < 0.014 && loss < 0.04, "chi {chi}, beta {beta}: {force} {loss}");
            }
        }
    }
}
