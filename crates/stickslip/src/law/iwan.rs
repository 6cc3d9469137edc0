//! Iwan's parallel sliders with Segalman's distribution of four parameters: micro-slip with a power law of loss.
//!
//! Sliders behind springs, side by side; those that slip at a displacement between φ and φ + dφ have the stiffness ρ(φ) dφ:
//! `ρ = R φ^χ` up to `φmax`, and a spring S more at φmax. With the stiffness at rest `KT` and the slip limit `FS`, the rest is
//! `φmax = FS (1 + β) / (KT (β + (χ+1)/(χ+2)))`, `R = FS (χ+1) / (φmax^(χ+2) (β + (χ+1)/(χ+2)))`, `S = (FS/φmax) β / (β + (χ+1)/(χ+2))`.
//! A cycle of amplitude u below φmax loses `4 R u^(χ+3) / ((χ+2) (χ+3))`.
//! Source: Segalman, "A four-parameter Iwan model for lap-type joints" (2005); Iwan (1966).
//!
//! Here the distribution is cut into bins, graded geometrically, and each bin is one slider with the bin's stiffness and the bin's limit. The
//! force of first loading is then exact at the bins' edges and above it between them. See [`ELEMENTS`] for the error.

use super::{Law, LawInfo, Parameter, Piece, Range};
use crate::dimension::Dimension;
use std::sync::Arc;

/// Sliders of the distribution unless `elements` says otherwise. For every χ from -0.9 to 0 and every β, at amplitudes from φmax/500 to φmax, the
/// force of first loading is then within 1.4 % of the exact one and the loss per cycle within 4 % (2.4 % at χ = -0.5, 1.8 % at -0.9). Both errors fall
/// in proportion to `1 / elements`; below the first bin nothing slips.
pub const ELEMENTS: f64 = 32.0;

/// The most sliders: what is more is no law of a joint but a model.
const MOST: u32 = 1000;

/// Bins are graded by `exp(GRADING / √elements)`: with more elements both the bins and the first one get smaller.
const GRADING: f64 = 1.5;

/// The row of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "iwan",
    summary: "parallel spring-sliders with the four-parameter distribution of Segalman, exact but for their number",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "stiffness at rest, KT"),
        Parameter::limit("slip limit, FS"),
        Parameter::new(
            "chi",
            Dimension::NONE,
            Range::Within(-1.0, 0.0),
            "exponent of the distribution, above -1: a cycle loses u^(chi+3)",
        ),
        Parameter::new(
            "beta",
            Dimension::NONE,
            Range::ZeroOrMore,
            "stiffness that slips last over that of the distribution",
        ),
        Parameter::new("elements", Dimension::NONE, Range::Count(MOST), "number of sliders of the distribution")
            .or(ELEMENTS),
    ],
    sample: &[10_000.0, 2.0, -0.5, 0.3, 8.0],
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

/// Parallel sliders with a distribution of four parameters.
///
/// # Example
/// ```
/// use stickslip::law::{Iwan, Law};
/// let law = Iwan { stiffness: 1e4, limit: 2.0, chi: -0.5, beta: 0.3, elements: 32 };
/// assert_eq!(law.pieces().unwrap().len(), 33);
/// // all of its stiffness in motion that slips nothing
/// assert!((law.linearised(1e-9, 1.0).re - 1e4).abs() < 1e-8);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iwan {
    /// Stiffness at rest `KT`, N/m.
    pub stiffness: f64,
    /// Slip limit `FS`, N.
    pub limit: f64,
    /// Exponent of the distribution `χ`, above -1, at most 0.
    pub chi: f64,
    /// `β`: the stiffness that slips last, at φmax, over that of the distribution.
    pub beta: f64,
    /// Sliders that stand for the distribution.
    pub elements: u32,
}

impl Iwan {
    /// `β + (χ+1)/(χ+2)`.
    fn denominator(&self) -> f64 {
        self.beta + (self.chi + 1.0) / (self.chi + 2.0)
    }

    /// Displacement `φmax` at which all of it slips, m.
    pub fn slips_at(&self) -> f64 {
        self.limit * (1.0 + self.beta) / (self.stiffness * self.denominator())
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
    fn scale(&self) -> f64 {
        self.limit
    }
    fn pieces(&self) -> Option<Vec<Piece>> {
        if self.limit == 0.0 {
            return Some(Vec::new());
        }
        let (far, chi, count) = (self.slips_at(), self.chi, self.elements.max(1));
        // in units of φmax and FS: stiffness and limit of all sliders up to x are these powers of x
        let stiffness = 1.0 / self.denominator();
        let limit = stiffness * (chi + 1.0) / (chi + 2.0);
        let edge = |bin: u32| match bin {
            0 => 0.0,
            bin => (-GRADING / f64::from(count).sqrt() * f64::from(count - bin)).exp(),
        };
        let mut pieces: Vec<Piece> = (0..count)
            .map(|bin| {
                let [from, to] = [edge(bin), edge(bin + 1)];
                let spring = stiffness * (to.powf(chi + 1.0) - from.powf(chi + 1.0));
                let slip = limit * (to.powf(chi + 2.0) - from.powf(chi + 2.0));
                Piece::slider(Some(spring * self.limit / far), slip * self.limit)
            })
            .collect();
        if self.beta > 0.0 {
            let last = self.limit * self.beta / self.denominator();
            pieces.push(Piece::slider(Some(last / far), last));
        }
        Some(pieces)
    }
    fn is_incrementally_passive(&self) -> bool {
        true // each slider is, behind its spring
    }
    fn consistent(&self) -> Result<(), String> {
        if self.chi > -1.0 {
            return Ok(());
        }
        Err("`chi` must be above -1, or the stiffness at rest has no bound".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Force of first loading and loss per cycle of sliders.
    fn of_pieces(pieces: &[Piece], u: f64) -> (f64, f64) {
        pieces.iter().fold((0.0, 0.0), |(force, loss), piece| {
            let Piece::Slider(slider) = piece else { panic!("{piece:?}") };
            let hold = slider.limit / slider.stiffness.unwrap();
            (force + slider.limit * (u / hold).min(1.0), loss + 4.0 * slider.limit * (u - hold).max(0.0))
        })
    }

    /// The same by the formulas of the heading.
    fn exact(law: &Iwan, u: f64) -> (f64, f64) {
        let (chi, far, d) = (law.chi, law.slips_at(), law.denominator());
        let r = law.limit * (chi + 1.0) / (far.powf(chi + 2.0) * d);
        let s = law.limit / far * law.beta / d;
        let force =
            r * u.powf(chi + 2.0) / (chi + 2.0) + u * (r * (far.powf(chi + 1.0) - u.powf(chi + 1.0)) / (chi + 1.0) + s);
        (force, 4.0 * r * u.powf(chi + 3.0) / ((chi + 2.0) * (chi + 3.0)))
    }

    #[test]
    fn backbone_and_loss_are_met_to_the_stated_error() {
        for chi in [-0.9, -0.5, -0.2, 0.0] {
            for beta in [0.0, 0.3, 5.0] {
                let law = Iwan { stiffness: 10.0, limit: 1.0, chi, beta, elements: ELEMENTS as u32 };
                let pieces = law.pieces().unwrap();
                let sum = |of: fn(&super::super::Slider) -> f64| {
                    let each =
                        pieces.iter().map(|piece| if let Piece::Slider(slider) = piece { of(slider) } else { 0.0 });
                    each.sum::<f64>()
                };
                assert!((sum(|slider| slider.limit) - 1.0).abs() < 1e-13, "all limits are FS");
                assert!((sum(|slider| slider.stiffness.unwrap()) - 10.0).abs() < 1e-12, "all springs are KT");
                let (mut force, mut loss) = (0.0f64, 0.0f64);
                for k in 0..=2000 {
                    let u = law.slips_at() * 500f64.powf(-f64::from(k) / 2000.0);
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
