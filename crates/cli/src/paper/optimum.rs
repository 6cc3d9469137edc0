//! The highest resonance peak over the slip limit: the curve on which the paper's four values lie, and its lowest point.

use rayon::prelude::*;
use stickslip::curve::peak::highest;
use stickslip::curve::sweep::{Watch, sweep};
use stickslip::law::{Coulomb, Law};
use stickslip::method::find;
use stickslip_study::dataset::{Axis, Figure, Panel, Series, Style};
use stickslip_study::run::Context;
use stickslip_study::{Case, Study};

/// Slip limits of the curve, N.
const LIMITS: [f64; 17] = [0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 5.5, 6.0, 6.5, 7.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0];
/// Every this many points of the study's frequencies are enough to find the peak before it is refined.
const COARSE: usize = 3;
/// Width of the bracket of the slip limit at which the search for the lowest peak ends, N.
const BRACKET: f64 = 1e-4;

/// The peak of the excited blade over the slip limit.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimum {
    /// Slip limits, N.
    pub limits: Vec<f64>,
    /// Peaks, m.
    pub peaks: Vec<f64>,
    /// The lowest point: slip limit (N) and peak (m).
    pub lowest: (f64, f64),
    /// Whether the lowest point lies inside the range, so that a higher limit is worse again by more than a thousandth.
    pub interior: bool,
}

impl Optimum {
    /// Computes the curve for the model of a response study with Coulomb friction; `None` if the run is stopped or a case fails.
    pub fn new(study: &Study, context: &Context<'_>) -> Option<Optimum> {
        let case = study.case(0).ok()?;
        let watch = Watch { finished: context.finished, stop: context.stop };
        let peaks: Vec<f64> = LIMITS.par_iter().map(|limit| peak(&case, *limit, watch)).collect::<Option<_>>()?;
        let best = (0..peaks.len()).min_by(|a, b| peaks[*a].total_cmp(&peaks[*b]))?;
        let (left, right) = (LIMITS[best.saturating_sub(1)], LIMITS[(best + 1).min(LIMITS.len() - 1)]);
        let found = golden(left, right, &|limit| peak(&case, limit, watch))?;
        let lowest = if found.1 < peaks[best] { found } else { (LIMITS[best], peaks[best]) };
        let interior = peaks.last().is_some_and(|last| *last > 1.001 * lowest.1) && best > 0;
        Some(Optimum { limits: LIMITS.to_vec(), peaks, lowest, interior })
    }

    /// The peak at one of the limits of the curve, m.
    pub fn at(&self, limit: f64) -> f64 {
        self.limits.iter().position(|l| *l == limit).map_or(f64::NAN, |i| self.peaks[i])
    }
}

/// Golden section; the peak falls and then rises with the limit.
fn golden(mut left: f64, mut right: f64, value: &dyn Fn(f64) -> Option<f64>) -> Option<(f64, f64)> {
    const PART: f64 = 0.618_033_988_749_894_9; // (√5 - 1)/2
    let (mut a, mut b) = (right - PART * (right - left), left + PART * (right - left));
    let (mut fa, mut fb) = (value(a)?, value(b)?);
    while right - left > BRACKET {
        if fa < fb {
            (right, b, fb) = (b, a, fa);
            a = right - PART * (right - left);
            fa = value(a)?;
        } else {
            (left, a, fa) = (a, b, fb);
            b = left + PART * (right - left);
            fb = value(b)?;
        }
    }
    Some(if fa < fb { (a, fa) } else { (b, fb) })
}

/// The highest amplitude of the first mass (the excited blade) over frequency, m.
fn peak(case: &Case, limit: f64, watch: Watch<'_>) -> Option<f64> {
    let mut model = case.model.clone();
    for joint in &mut model.joints {
        joint.law = Law::Coulomb(Coulomb { limit });
    }
    let system = model.assemble().ok()?;
    let method = (find(&case.method.name)?.build)(&case.method.options).ok()?;
    let omegas: Vec<f64> = case.frequencies.as_ref()?.iter().step_by(COARSE).collect();
    let rows = sweep(&*method, &system, omegas.len(), &|i| omegas[i], watch, &|_, orbit| {
        orbit.map_or(f64::NAN, |orbit| orbit.places[0].amplitude())
    });
    let values: Vec<f64> = rows.ok()?.into_iter().collect::<Option<_>>()?;
    let mut solver = method.solver(&system).ok()?;
    Some(highest(&mut *solver, &omegas, &values, &|orbit| orbit.places[0].amplitude())?.value)
}

/// The curves of both elements in one panel.
pub fn figure(curves: &[(&str, &Optimum)]) -> Figure {
    let mut series = Vec::new();
    for (colour, (label, curve)) in curves.iter().enumerate() {
        let y = curve.peaks.iter().map(|p| p * 1e3).collect();
        let x = curve.limits.clone();
        series.push(Series { label: (*label).to_owned(), x, y, style: Style::Solid, colour });
        if curve.interior {
            series.push(Series {
                label: "lowest peak".to_owned(),
                x: vec![curve.lowest.0],
                y: vec![curve.lowest.1 * 1e3],
                style: Style::Marks,
                colour,
            });
        }
    }
    Figure {
        title: "Highest resonance peak of the excited blade over the slip limit".to_owned(),
        panels: vec![Panel {
            title: String::new(),
            x: Axis { quantity: "slip limit Ft".to_owned(), unit: "N".to_owned() },
            y: Axis { quantity: "peak amplitude".to_owned(), unit: "mm".to_owned() },
            series,
        }],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_golden_section_finds_a_kink() {
        let (at, value) = golden(0.0, 3.0, &|x| Some((x - 1.3).abs() + 2.0)).unwrap();
        assert!((at - 1.3).abs() < BRACKET && (value - 2.0).abs() < BRACKET);
        assert_eq!(golden(0.0, 1.0, &|_| None), None);
    }
}
