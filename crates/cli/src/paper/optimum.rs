//! The highest resonance peak over the slip limit: the curve on which the paper's four values lie, and its lowest point.

use std::sync::Arc;
use stickslip::curve::performance::Performance;
use stickslip::law::Coulomb;
use stickslip::method::find;
use stickslip_study::Study;
use stickslip_study::dataset::{Axis, Figure, Panel, Series, Style};
use stickslip_study::run::Context;

/// Slip limits of the curve, N.
const LIMITS: [f64; 17] = [0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 5.5, 6.0, 6.5, 7.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0];
/// Every this many points of the study's frequencies are enough to find the peak before it is refined.
const COARSE: usize = 3;
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
    pub fn new(study: &Study, context: &Context) -> Option<Optimum> {
        let case = study.case(0).ok()?;
        if context.stopped() {
            return None;
        }
        let frequencies = case.frequencies.as_ref()?;
        let system = |limit: f64| {
            let mut model = case.model.clone();
            for joint in &mut model.joints {
                joint.law = Arc::new(Coulomb { limit });
            }
            model.assemble()
        };
        let performance = Performance {
            system: &system,
            method: &*(find(&case.method.name)?.build)(&case.method.options).ok()?,
            range: (frequencies.get(0)?, frequencies.get(frequencies.len() - 1)?),
            points: frequencies.len() / COARSE + 1,
            // the excited blade is the first mass
            quantity: &|orbit| orbit.places[0].amplitude(),
        };
        let curve = performance.curve(&LIMITS).ok()?;
        let peaks: Vec<f64> = curve.rows.iter().map(|row| row.peak.map(|peak| peak.value)).collect::<Option<_>>()?;
        let best = (0..peaks.len()).min_by(|a, b| peaks[*a].total_cmp(&peaks[*b]))?;
        let refined = curve.optimum.and_then(|row| Some((row.value, row.peak?.value)));
        let lowest = refined.unwrap_or((LIMITS[best], peaks[best]));
        let interior = peaks.last().is_some_and(|last| *last > 1.001 * lowest.1) && best > 0;
        Some(Optimum { limits: LIMITS.to_vec(), peaks, lowest, interior })
    }

    /// The peak at one of the limits of the curve, m.
    pub fn at(&self, limit: f64) -> f64 {
        self.limits.iter().position(|l| *l == limit).map_or(f64::NAN, |i| self.peaks[i])
    }
}

/// The curves of both elements in one panel.
pub fn figure(curves: &[(&str, &Optimum)]) -> Figure {
    let mut series = Vec::new();
    for (colour, (label, curve)) in curves.iter().enumerate() {
        let y = curve.peaks.iter().map(|p| p * 1e3).collect();
        let x = curve.limits.clone();
        series.push(Series { label: (*label).to_owned(), x, y, style: Style::Solid, colour, ..Series::default() });
        if curve.interior {
            series.push(Series {
                label: "lowest peak".to_owned(),
                x: vec![curve.lowest.0],
                y: vec![curve.lowest.1 * 1e3],
                style: Style::Marks,
                colour,
                ..Series::default()
            });
        }
    }
    Figure {
        title: "Highest resonance peak of the excited blade over the slip limit".to_owned(),
        panels: vec![Panel {
            title: String::new(),
            x: Axis::new("slip limit Ft", "N"),
            y: Axis::new("peak amplitude", "mm"),
            series,
        }],
        ..Figure::default()
    }
}
