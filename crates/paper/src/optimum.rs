//! The highest resonance peak over the slip limit, and its minimum.

use stickslip_study::Study;
use stickslip_study::dataset::{Axis, Figure, Panel, Series, Style};
use stickslip_study::kinds::performance;
use stickslip_study::run::{Context, run};

/// The peak of the excited blade over the slip limit.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimum {
    /// Slip limits in N.
    pub limits: Vec<f64>,
    /// Peaks in m.
    pub peaks: Vec<f64>,
    /// Minimum: slip limit (N) and peak (m).
    pub lowest: (f64, f64),
    /// `true` if the minimum lies inside the range: a higher limit increases the peak again.
    pub interior: bool,
}

impl Optimum {
    /// Computes the curve of a performance study that varies `Ft`.
    ///
    /// Returns `None` if the run is stopped or a case fails.
    pub fn new(study: &Study, context: &Context) -> Option<Optimum> {
        let dataset = run(study, context).ok()?;
        let curve = performance::curves(study, &dataset).ok()?.into_iter().next()?;
        let limits: Vec<f64> = curve.points.iter().map(|point| Some(point.varied.last()?.si)).collect::<Option<_>>()?;
        let peaks: Vec<f64> = curve.points.iter().map(|point| Some(point.peak?.amplitude)).collect::<Option<_>>()?;
        let best = (0..peaks.len()).min_by(|a, b| peaks[*a].total_cmp(&peaks[*b]))?;
        let refined = curve.optimum.map(|optimum| (optimum.value, optimum.amplitude));
        let lowest = refined.unwrap_or((limits[best], peaks[best]));
        // Relative excess of the peak at the highest limit over the lowest peak, above which the
        // minimum lies inside the range. The value excludes rounding errors.
        let interior = peaks.last().is_some_and(|last| *last > (1.0 + 1e-3) * lowest.1) && best > 0;
        Some(Optimum { limits, peaks, lowest, interior })
    }

    /// Returns the peak at one of the limits of the curve in m, or NaN for another limit.
    pub fn peak_at(&self, limit: f64) -> f64 {
        self.limits.iter().position(|l| *l == limit).map_or(f64::NAN, |i| self.peaks[i])
    }
}

/// Draws the curves in one panel.
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
            ..Panel::default()
        }],
        ..Figure::default()
    }
}
