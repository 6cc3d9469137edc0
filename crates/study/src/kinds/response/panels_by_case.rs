//! Panels of a response case by case: curves of places, sectors of a disk, forces and contact
//! states of joints.

use super::figure_data::FigureData;
use crate::kinds::shared::contact_states::{self, SharePlot};
use crate::kinds::shared::disk_shape::{self, PlaceInSectors};
use crate::results::columns::FREQUENCY as DRIVE;
use crate::results::dataset::{Axis, Panel, Series, Style};
use crate::results::drawing::{CaseRows, MAX_PANELS, join_title, numbers};
use crate::syntax::format::format_significant;

impl FigureData<'_> {
    /// Returns the panels of each case.
    ///
    /// A case has the curves of every place, the sectors of a disk, and the forces and contact
    /// states of joints. If the figure is full, the first cases are drawn, and the title states
    /// this.
    pub(super) fn panels_by_case(&self, cases: &[CaseRows]) -> Vec<Panel> {
        let each = self.panels_of_a_case().max(1);
        let shown_cases = (MAX_PANELS / each).clamp(1, cases.len().max(1));
        let draws_shapes = shown_cases * (each + 1) <= MAX_PANELS;
        let [of_sectors, of_forces, of_shares] = self.colours();
        let mut panels = Vec::new();
        for case_rows in cases.iter().take(shown_cases) {
            if !self.shown.is_empty() {
                panels.push(self.places_panel(case_rows));
            }
            if let Some([bars, wheel]) = self.sectors_of(case_rows, of_sectors) {
                panels.extend(bars.into_iter().chain(wheel.filter(|_| draws_shapes)));
            }
            if !self.joints.is_empty() {
                let mut panel = self.force_panel(case_rows.label());
                for (i, (name, joints)) in self.force_groups().into_iter().enumerate() {
                    let (x, y) = self.force_line(case_rows, &joints);
                    panel.series.push(Series::line(name, x, y, of_forces + i));
                }
                panels.push(panel);
            }
            let x: Vec<f64> =
                numbers(self.curve, DRIVE, case_rows.rows.clone()).iter().map(|x| x * self.factor.0).collect();
            let label = case_rows.label();
            let plot = SharePlot { x: &x, axis: &self.axes.0, title: &label, first_colour: of_shares };
            panels.extend(contact_states::panels(self.curve, &self.contact_joints, &case_rows.rows, &plot));
        }
        if let Some(first) = panels.first_mut().filter(|_| shown_cases < cases.len()) {
            let some = format!("the first {shown_cases} of {} cases", cases.len());
            first.title = join_title([std::mem::take(&mut first.title), some]);
        }
        panels
    }

    /// Returns the number of panels per case.
    ///
    /// The shape of a disk is not counted, because it is left out if the figure is full.
    pub(super) fn panels_of_a_case(&self) -> usize {
        let shares =
            if self.contact_joints.is_empty() { 0 } else { contact_states::count(self.curve, &self.contact_joints) };
        usize::from(!self.shown.is_empty())
            + usize::from(self.is_disk())
            + usize::from(!self.joints.is_empty())
            + shares
    }

    /// Draws the places of one case: each of them, or the largest amplitude in front of all
    /// others.
    fn places_panel(&self, case_rows: &CaseRows) -> Panel {
        let (mut panel, names) = (self.panel(case_rows.label()), self.names());
        panel.series.extend(self.references(&names, &[(0, case_rows)]));
        // Colour of crosses at points without an orbit: the last of the palette.
        panel.series.extend(self.failed_points(case_rows, 1, 6));
        if self.draws_each_place() {
            // the mass is known only for a place that is one row of the structure
            let mass = |place: usize| match self.system.place_axes()[place].rows() {
                [(row, _)] => self.system.structure().diagonal_mass(*row),
                _ => f64::INFINITY,
            };
            let places = 0..self.system.places().len();
            let heaviest = places.map(mass).filter(|mass| mass.is_finite()).fold(0.0, f64::max);
            for (name, place) in &self.shown {
                let (x, y) = self.line(case_rows, name);
                // A mass below this share of the heaviest mass is drawn dashed, like the contact
                // masses of the paper.
                let light = mass(*place) < 0.5 * heaviest;
                let style = if light { Style::Dashed } else { Style::Solid };
                panel.series.push(Series { style, ..Series::line(name, x, y, self.colour_of(name, *place)) });
            }
            let colour_of = |(name, place): &(String, usize)| self.colour_of(name, *place);
            let reverse_series =
                |shown: &(String, usize)| self.reverse_sweep_series(case_rows, &[&shown.0], colour_of(shown));
            panel.series.extend(self.shown.iter().filter_map(reverse_series));
            for (name, place) in &self.shown {
                let colour = self.colour_of(name, *place);
                panel.series.extend(self.points_to_doubt(case_rows, self.points(case_rows, name), colour));
                panel.series.extend(self.marks(case_rows, name, colour));
            }
            return panel;
        }
        // Largest number of places drawn behind the curve of the largest amplitude; thousands of
        // curves would form one grey area of several megabytes.
        let background = self.highest(case_rows, 100);
        let label = match background.len() < names.len() {
            true => format!("the {} highest of {} places", background.len(), names.len()),
            false => format!("each of {} places", names.len()),
        };
        for name in background {
            let (x, y) = self.line(case_rows, name);
            panel.series.push(Series::line(label.clone(), x, y, 1).pale());
        }
        let (x, y, worst) = self.envelope(case_rows);
        panel.title = join_title([panel.title, worst]);
        panel.series.push(Series::line(format!("largest of {} places", names.len()), x, y, 0));
        panel.series.extend(self.reverse_sweep_series(case_rows, &names, 0));
        panel.series.extend(self.points_to_doubt(case_rows, self.largest_points(case_rows), 0));
        panel
    }

    /// Returns at most `most` of the shown places, those with the largest amplitudes, in model
    /// order.
    fn highest(&self, case_rows: &CaseRows, most: usize) -> Vec<&str> {
        let names = self.names();
        let height = |name: &str| self.amplitudes(name, case_rows.rows.clone()).into_iter().fold(0.0, f64::max);
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
    fn sectors_of(&self, case_rows: &CaseRows, first: usize) -> Option<[Option<Panel>; 2]> {
        let ring = self.drawing.study.case(0).ok()?.model.ring?;
        let (frequency, shape) = self.shape_at_maximum(case_rows)?;
        let all = PlaceInSectors::from_ring(shape)?;
        let places = all.len();
        let shape: Vec<PlaceInSectors> = disk_shape::largest_places(&all, disk_shape::MAX_PLACES)
            .into_iter()
            .map(|place| all[place].clone())
            .collect();
        let bars = |colour: usize| {
            let place = &shape[colour];
            let (x, y) = place.sectors.iter().map(|(sector, size, _)| (*sector as f64, size * self.factor.1)).unzip();
            Series::bars(&place.place, x, y, first + colour)
        };
        // Largest number of bars that remain distinct in a panel: two for each of 60 blades.
        let fit = (120 / ring.sectors.max(1)).clamp(1, disk_shape::MAX_PLACES);
        let series: Vec<Series> = disk_shape::largest_places(&shape, fit).into_iter().map(bars).collect();
        if series.iter().all(|bars| bars.x.len() < 2) {
            return None;
        }
        // bars of equal height, as for a tuned disk, are left out
        // Bars whose heights differ by at most this share belong to equal sectors.
        let differ = |bars: &Series| bars.y.iter().any(|y| (y - bars.y[0]).abs() > 1e-5 * bars.y[0].abs());
        let differ = series.iter().any(differ);
        let title = join_title([case_rows.label(), format!("at {} Hz", format_significant(frequency, 6))]);
        let (x, y) =
            (Axis::new("sector", "").with_whole_numbers(), Axis::new(&self.axes.1.quantity, &self.axes.1.unit));
        let shown_text = disk_shape::left_out(shape.len(), places);
        let shape_panel =
            disk_shape::panel(&shape, ring.sectors, join_title(["shape".to_owned(), title.clone(), shown_text]), first);
        let title = join_title([title, disk_shape::left_out(series.len(), places)]);
        Some([differ.then(|| Panel { title, x, y, series, ..Panel::default() }), shape_panel])
    }
}
