//! Panels of a response case by case: curves of places, sectors of a disk, forces and contact
//! states of joints.

use super::super::shares;
use super::super::wheel::{self, Around};
use super::drawn::Drawn;
use crate::columns::FREQUENCY as DRIVE;
use crate::dataset::{Axis, Panel, Series, Style};
use crate::drawing::{MOST_PANELS, Stretch, join, numbers};
use crate::words::significant;

/// A mass below this share of the heaviest mass is drawn dashed, like the contact masses of the
/// paper.
const LIGHT: f64 = 0.5;
/// Colour of crosses at points without an orbit: the last of the palette.
const MISSING: usize = 6;
/// Largest number of bars that remain distinct in a panel: two for each of 60 blades.
const BARS: usize = 120;
/// Bars whose heights differ by at most this share belong to equal sectors.
const ALIKE: f64 = 1e-5;
/// Largest number of places drawn behind the curve of the largest amplitude; thousands of
/// curves would form one grey area of several megabytes.
const BEHIND: usize = 100;

impl Drawn<'_> {
    /// Returns the panels of each case.
    ///
    /// A case has the curves of every place, the sectors of a disk, and the forces and contact
    /// states of joints. If the figure is full, the first cases are drawn, and the title states
    /// this.
    pub(super) fn by_case(&self, stretches: &[Stretch]) -> Vec<Panel> {
        let each = self.panels_of_a_case().max(1);
        let room = (MOST_PANELS / each).clamp(1, stretches.len().max(1));
        let wheels = room * (each + 1) <= MOST_PANELS;
        let [of_sectors, of_forces, of_shares] = self.colours();
        let mut panels = Vec::new();
        for stretch in stretches.iter().take(room) {
            if !self.shown.is_empty() {
                panels.push(self.masses_of(stretch));
            }
            if let Some([bars, wheel]) = self.sectors_of(stretch, of_sectors) {
                panels.extend(bars.into_iter().chain(wheel.filter(|_| wheels)));
            }
            if !self.joints.is_empty() {
                let mut panel = self.force_panel(stretch.label());
                for (i, (name, joints)) in self.pulling().into_iter().enumerate() {
                    let (x, y) = self.force_line(stretch, &joints);
                    panel.series.push(Series::line(name, x, y, of_forces + i));
                }
                panels.push(panel);
            }
            let x: Vec<f64> =
                numbers(self.curve, DRIVE, stretch.rows.clone()).iter().map(|x| x * self.factor.0).collect();
            let over = (&x[..], &self.axes.0);
            let label = stretch.label();
            panels.extend(shares::panels(self.curve, &self.faces, &stretch.rows, over, (&label, of_shares)));
        }
        if let Some(first) = panels.first_mut().filter(|_| room < stretches.len()) {
            let some = format!("the first {room} of {} cases", stretches.len());
            first.title = join([std::mem::take(&mut first.title), some]);
        }
        panels
    }

    /// Returns the number of panels per case.
    ///
    /// The shape of a disk is not counted, because it is left out if the figure is full.
    pub(super) fn panels_of_a_case(&self) -> usize {
        let shares = if self.faces.is_empty() { 0 } else { shares::count(self.curve, &self.faces) };
        usize::from(!self.shown.is_empty()) + usize::from(self.ring()) + usize::from(!self.joints.is_empty()) + shares
    }

    /// Draws the places of one case: each of them, or the largest amplitude in front of all
    /// others.
    fn masses_of(&self, stretch: &Stretch) -> Panel {
        let (mut panel, names) = (self.panel(stretch.label()), self.names());
        panel.series.extend(self.references(&names, &[(0, stretch)]));
        panel.series.extend(self.missing(stretch, 1, MISSING));
        if self.single() {
            // the mass is known only for a place that is one row of the structure
            let mass = |place: usize| match self.system.place_axes()[place].rows() {
                [(row, _)] => self.system.structure().diagonal_mass(*row),
                _ => f64::INFINITY,
            };
            let places = 0..self.system.places().len();
            let heaviest = places.map(mass).filter(|mass| mass.is_finite()).fold(0.0, f64::max);
            for (name, place) in &self.shown {
                let (x, y) = self.line(stretch, name);
                let light = mass(*place) < LIGHT * heaviest;
                let style = if light { Style::Dashed } else { Style::Solid };
                panel.series.push(Series { style, ..Series::line(name, x, y, self.colour_of(name, *place)) });
            }
            let colour_of = |(name, place): &(String, usize)| self.colour_of(name, *place);
            let back = |shown: &(String, usize)| self.way_back(stretch, &[&shown.0], colour_of(shown));
            panel.series.extend(self.shown.iter().filter_map(back));
            for (name, place) in &self.shown {
                panel.series.extend(self.marks(stretch, name, self.colour_of(name, *place)));
            }
            return panel;
        }
        let behind = self.highest(stretch, BEHIND);
        let label = match behind.len() < names.len() {
            true => format!("the {} highest of {} places", behind.len(), names.len()),
            false => format!("each of {} places", names.len()),
        };
        for name in behind {
            let (x, y) = self.line(stretch, name);
            panel.series.push(Series::line(label.clone(), x, y, 1).pale());
        }
        let (x, y, worst) = self.envelope(stretch);
        panel.title = join([panel.title, worst]);
        panel.series.push(Series::line(format!("largest of {} places", names.len()), x, y, 0));
        panel.series.extend(self.way_back(stretch, &names, 0));
        panel
    }

    /// Returns at most `most` of the shown places, those with the largest amplitudes, in model
    /// order.
    fn highest(&self, stretch: &Stretch, most: usize) -> Vec<&str> {
        let names = self.names();
        let height = |name: &str| self.amplitudes(name, stretch.rows.clone()).into_iter().fold(0.0, f64::max);
        let mut by_height: Vec<(usize, f64)> = names.iter().map(|name| height(name)).enumerate().collect();
        by_height.sort_by(|a, b| b.1.total_cmp(&a.1));
        by_height.truncate(most);
        by_height.sort_by_key(|(index, _)| *index);
        by_height.into_iter().map(|(index, _)| names[index]).collect()
    }

    /// Draws a bar for every sector of a disk at the frequency of the largest amplitude, and
    /// the shape there.
    ///
    /// Both panels show the places that move most, each in one colour, beginning with colour
    /// `first`.
    fn sectors_of(&self, stretch: &Stretch, first: usize) -> Option<[Option<Panel>; 2]> {
        let ring = self.drawing.study.case(0).ok()?.model.ring?;
        let (frequency, shape) = self.at_the_highest(stretch)?;
        let all = Around::of_ring(shape)?;
        let places = all.len();
        let shape: Vec<Around> =
            wheel::leaders(&all, wheel::MOST).into_iter().map(|place| all[place].clone()).collect();
        let bars = |colour: usize| {
            let around = &shape[colour];
            let (x, y) = around.of.iter().map(|(sector, size, _)| (*sector as f64, size * self.factor.1)).unzip();
            Series::bars(&around.place, x, y, first + colour)
        };
        let fit = (BARS / ring.sectors.max(1)).clamp(1, wheel::MOST);
        let series: Vec<Series> = wheel::leaders(&shape, fit).into_iter().map(bars).collect();
        if series.iter().all(|bars| bars.x.len() < 2) {
            return None;
        }
        // bars of equal height, as for a tuned disk, are left out
        let differ = |bars: &Series| bars.y.iter().any(|y| (y - bars.y[0]).abs() > ALIKE * bars.y[0].abs());
        let differ = series.iter().any(differ);
        let title = join([stretch.label(), format!("at {} Hz", significant(frequency, 6))]);
        let (x, y) = (Axis::new("sector", "").whole(), Axis::new(&self.axes.1.quantity, &self.axes.1.unit));
        let of = wheel::left_out(shape.len(), places);
        let wheel = wheel::panel(&shape, ring.sectors, join(["shape".to_owned(), title.clone(), of]), first);
        let title = join([title, wheel::left_out(series.len(), places)]);
        Some([differ.then(|| Panel { title, x, y, series, ..Panel::default() }), wheel])
    }
}
