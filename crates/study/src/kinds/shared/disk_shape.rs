//! Pictures of a disk at the instant of the largest displacement of its worst place.
//!
//! Displacements are drawn as distances from a circle, sector by sector. The picture shows
//! nodal diameters and the participating blades.

use crate::results::columns::place_and_sector;
use crate::results::dataset::{Axis, Panel, Series};
use crate::results::drawing::join_title;
use std::f64::consts::TAU;
use stickslip_numerics::tie_break::first_largest;

/// A place of every sector: its name, and sector, amplitude and phase (degrees) of each.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::kinds) struct PlaceInSectors {
    pub(in crate::kinds) place: String,
    pub(in crate::kinds) sectors: Vec<(usize, f64, f64)>,
}

impl PlaceInSectors {
    /// Returns a place of every sector in a travelling wave; each sector leads the previous one
    /// by `diameter / sectors` of a turn.
    pub(in crate::kinds) fn from_wave(
        place: String,
        size: f64,
        phase: f64,
        diameter: usize,
        sectors: usize,
    ) -> PlaceInSectors {
        let lead = |sector: usize| 360.0 * (diameter * sector % sectors) as f64 / sectors as f64;
        PlaceInSectors { place, sectors: (0..sectors).map(|sector| (sector, size, phase + lead(sector))).collect() }
    }

    /// Groups places of a ring, with amplitude and phase, by their name in the sector.
    ///
    /// Returns `None` if a place belongs to no sector.
    pub(in crate::kinds) fn from_ring<'a>(
        places: impl IntoIterator<Item = (&'a str, f64, f64)>,
    ) -> Option<Vec<PlaceInSectors>> {
        let mut all: Vec<PlaceInSectors> = Vec::new();
        for (name, size, phase) in places {
            let (place, sector) = place_and_sector(name)?;
            match all.iter_mut().find(|around| around.place == place) {
                Some(around) => around.sectors.push((sector, size, phase)),
                None => all.push(PlaceInSectors { place, sectors: vec![(sector, size, phase)] }),
            }
        }
        Some(all)
    }

    fn largest(&self) -> f64 {
        self.sectors.iter().map(|(_, size, _)| *size).filter(|size| size.is_finite()).fold(0.0, f64::max)
    }
}

/// Length of the largest displacement as a share of the radius of the circle.
const LARGEST_DISPLACEMENT: f64 = 0.35;
/// Largest number of places in a picture: those that move most. More places hide each other.
pub(in crate::kinds) const MAX_PLACES: usize = 4;

/// Returns the indices of at most `most` places that move most, in ascending order.
pub(in crate::kinds) fn largest_places(places: &[PlaceInSectors], most: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|a, b| places[*b].largest().total_cmp(&places[*a].largest()));
    order.truncate(most);
    order.sort_unstable();
    order
}

/// States how many of the places are shown, if not all.
pub(in crate::kinds) fn left_out(shown: usize, places: usize) -> String {
    if shown < places { format!("{shown} of {places} places") } else { String::new() }
}

/// Draws some places of a ring in colours from `colour`. Sector 0 is at the top, and sector 1
/// follows clockwise.
pub(in crate::kinds) fn panel(
    places: &[PlaceInSectors],
    sectors: usize,
    title: String,
    colour: usize,
) -> Option<Panel> {
    // Half the width of the picture in radii of the circle; all pictures have the same size.
    let half_width = 1.0 + LARGEST_DISPLACEMENT + 0.05;
    // Smallest number of sectors for a picture.
    let min_sectors = 3;
    // Number of points of the circle at rest.
    let circle: usize = 180;
    let largest = places.iter().map(PlaceInSectors::largest).fold(0.0, f64::max);
    let all = places.iter().flat_map(|around| &around.sectors);
    // the first of equal displacements determines the instant
    let (_, _, now) = *all.clone().nth(first_largest(all.map(|(_, size, _)| *size))?)?;
    if sectors < min_sectors || places.iter().all(|around| around.sectors.len() < min_sectors) {
        return None;
    }
    let shown = largest_places(places, MAX_PLACES);
    let left_out = left_out(shown.len(), places.len());
    let point = |turn: f64, radius: f64| (radius * (TAU * turn).sin(), radius * (TAU * turn).cos());
    let rest = (0..=circle).map(|i| point(i as f64 / circle as f64, 1.0)).unzip();
    let (x, y): (Vec<f64>, Vec<f64>) = rest;
    let mut series = vec![Series::line("at rest", x, y, 0).reference()];
    for place in shown {
        let tip = |(sector, size, phase): &(usize, f64, f64)| {
            let displacement = size / largest * (phase - now).to_radians().cos();
            let turn = *sector as f64 / sectors as f64;
            (point(turn, 1.0), point(turn, 1.0 + LARGEST_DISPLACEMENT * displacement))
        };
        let PlaceInSectors { place: name, sectors: of } = &places[place];
        let mut tips: Vec<_> = of.iter().map(tip).collect();
        // spokes from the circle at rest
        let nothing = (f64::NAN, f64::NAN);
        let (x, y) = tips.iter().flat_map(|(foot, tip)| [*foot, *tip, nothing]).unzip();
        series.push(Series::line("", x, y, colour + place).pale());
        if of.len() == sectors {
            tips.extend(tips.first().copied());
        }
        let (x, y) = tips.iter().map(|(_, tip)| *tip).unzip();
        series.push(Series::line(name, x, y, colour + place));
    }
    let first = series.iter().rev().find_map(|line| Some((*line.x.first()?, *line.y.first()?)))?;
    series.push(Series::marks("sector 0", vec![first.0], vec![first.1], 6));
    let title = join_title([title, left_out]);
    let axis = || Axis::default().with_range(-half_width, half_width);
    Some(Panel { title, x: axis(), y: axis(), series, equal_axes: true })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave of two nodal diameters on eight sectors has the displacements `cos(2·2π s/8)`.
    ///
    /// The first of equal displacements determines the instant.
    #[test]
    fn a_wave_has_its_nodal_diameters() {
        let wave = PlaceInSectors::from_wave("blade".to_owned(), 2.0, 30.0, 2, 8);
        let found = panel(&[wave], 8, String::new(), 0).unwrap();
        let line = found.series.iter().find(|line| line.label == "blade").unwrap();
        let radii: Vec<f64> = line.x.iter().zip(&line.y).map(|(x, y)| x.hypot(*y)).collect();
        for (sector, radius) in radii.iter().enumerate() {
            let out = (std::f64::consts::FRAC_PI_2 * sector as f64).cos();
            assert!((radius - 1.0 - 0.35 * out).abs() < 1e-12, "{sector}: {radius}");
        }
        assert_eq!(radii.len(), 9);
        // sector 2 of 8 is at the right
        assert!(line.x[2] > 0.6 && line.y[2].abs() < 1e-12);
    }

    /// The picture shows the four places that move most, each in its usual colour.
    #[test]
    fn a_wheel_is_not_crowded() {
        let size = [1.0, 5.0, 2.0, 0.5, 3.0, 4.0];
        let all: Vec<PlaceInSectors> =
            size.iter().map(|size| PlaceInSectors::from_wave(format!("p{size}"), *size, 0.0, 1, 6)).collect();
        let found = panel(&all, 6, "mode 1".to_owned(), 2).unwrap();
        let drawn: Vec<(&str, usize)> =
            found.series.iter().filter(|s| s.label.starts_with('p')).map(|s| (s.label.as_str(), s.colour)).collect();
        assert_eq!(drawn, [("p5", 3), ("p2", 4), ("p3", 6), ("p4", 7)]);
        assert_eq!(found.title, "mode 1, 4 of 6 places");
    }

    #[test]
    fn places_of_a_ring_by_their_sector() {
        let all = PlaceInSectors::from_ring([("a_0", 1.0, 0.0), ("b_0", 2.0, 0.0), ("a_1", 3.0, 0.0)]).unwrap();
        assert_eq!(
            all.iter().map(|around| (around.place.as_str(), around.sectors.len())).collect::<Vec<_>>(),
            [("a", 2), ("b", 1)]
        );
        assert!(PlaceInSectors::from_ring([("rotor", 1.0, 0.0)]).is_none());
    }
}
