//! How a disk stands at the instant at which its worst place is farthest out: displacements as distances from a circle, sector by sector, so
//! that nodal diameters are seen.

use crate::dataset::{Panel, Series};
use std::f64::consts::TAU;

/// A place of every sector: its name, and sector, amplitude and phase (degrees) of each.
pub(super) type Around = (String, Vec<(usize, f64, f64)>);

/// Share of the circle's radius that the largest displacement is drawn as.
const LARGEST: f64 = 0.35;
/// Fewer sectors show no shape.
const LEAST: usize = 3;
/// Points of the circle at rest.
const CIRCLE: usize = 180;

/// The picture of some places of a ring of so many sectors. Sector 0 is at the top, the next to the right of it.
pub(super) fn panel(places: &[Around], sectors: usize, title: String) -> Option<Panel> {
    let all = || places.iter().flat_map(|(_, of)| of).filter(|(_, amplitude, _)| amplitude.is_finite());
    let (_, largest, now) = *all().max_by(|a, b| a.1.total_cmp(&b.1))?;
    if largest <= 0.0 || sectors < LEAST || places.iter().all(|(_, of)| of.len() < LEAST) {
        return None;
    }
    let at = |turn: f64, radius: f64| (radius * (TAU * turn).sin(), radius * (TAU * turn).cos());
    let rest = (0..=CIRCLE).map(|i| at(i as f64 / CIRCLE as f64, 1.0)).unzip();
    let (x, y): (Vec<f64>, Vec<f64>) = rest;
    let mut series = vec![Series::line("at rest", x, y, 0).reference()];
    for (colour, (name, of)) in places.iter().enumerate() {
        let tip = |(sector, amplitude, phase): &(usize, f64, f64)| {
            let out = amplitude / largest * (phase - now).to_radians().cos();
            let turn = *sector as f64 / sectors as f64;
            (at(turn, 1.0), at(turn, 1.0 + LARGEST * out))
        };
        let mut tips: Vec<_> = of.iter().map(tip).collect();
        // spokes, each from the circle at rest
        let nothing = (f64::NAN, f64::NAN);
        let (x, y) = tips.iter().flat_map(|(foot, tip)| [*foot, *tip, nothing]).unzip();
        series.push(Series::line("", x, y, colour).pale());
        if of.len() == sectors {
            tips.extend(tips.first().copied());
        }
        let (x, y) = tips.iter().map(|(_, tip)| *tip).unzip();
        series.push(Series::line(name, x, y, colour));
    }
    let first = series.iter().rev().find_map(|line| Some((*line.x.first()?, *line.y.first()?)))?;
    series.push(Series::marks("sector 0", vec![first.0], vec![first.1], 6));
    Some(Panel { title, series, picture: true, ..Panel::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave of two nodal diameters on eight sectors: out and in by turns, `cos(2·2π s/8)`, nothing at the nodes.
    #[test]
    fn a_wave_has_its_nodal_diameters() {
        let wave: Around = ("blade".to_owned(), (0..8).map(|s| (s, 2.0, 90.0 * s as f64)).collect());
        let found = panel(&[wave], 8, String::new()).unwrap();
        let line = found.series.iter().find(|line| line.label == "blade").unwrap();
        let radii: Vec<f64> = line.x.iter().zip(&line.y).map(|(x, y)| x.hypot(*y)).collect();
        // of equal amplitudes the last one counts: that of sector 7, a quarter of the period later
        for (sector, radius) in radii.iter().enumerate() {
            let out = (std::f64::consts::FRAC_PI_2 * (sector as f64 - 7.0)).cos();
            assert!((radius - 1.0 - 0.35 * out).abs() < 1e-12, "{sector}: {radius}");
        }
        assert_eq!(radii.len(), 9);
        // sector 2 of 8 is at the right
        assert!(line.x[2] > 0.6 && line.y[2].abs() < 1e-12);
    }
}
