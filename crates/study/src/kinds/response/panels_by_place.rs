//! Panels of a response place by place and joint by joint: a curve for every case, or
//! percentiles of draws.

use super::figure_data::{FigureData, MAX_SINGLE_PLACES};
use crate::case::study::varied_text;
use crate::kinds::shared::contact_states::{self, ContactState};
use crate::results::columns::{FREQUENCY as DRIVE, amplitude_of};
use crate::results::dataset::{Panel, Series};
use crate::results::drawing::{CaseRows, MAX_CURVES, MAX_PANELS, evenly_chosen, join_title, numbers};
use crate::results::percentiles::percentiles;

/// Returns x and y of one draw.
type CurveFn<'a> = &'a dyn Fn(&CaseRows) -> (Vec<f64>, Vec<f64>);

impl FigureData<'_> {
    /// Returns a panel for every place, or for the largest amplitude, and a panel for every
    /// joint.
    ///
    /// Each panel has a curve for every case. The last varied parameter distinguishes the
    /// curves of a panel, the other parameters the panels.
    pub(super) fn panels_by_place(&self, cases: &[CaseRows]) -> Vec<Panel> {
        if self.drawing.study.draws().is_some() {
            return self.percentile_panels(cases);
        }
        let outer = |case_rows: &CaseRows| varied_text(&case_rows.varied[..case_rows.varied.len().saturating_sub(1)]);
        let groups: Vec<(&[CaseRows], String)> =
            cases.chunk_by(|a, b| outer(a) == outer(b)).map(|group| (group, outer(&group[0]))).collect();
        let masses: Vec<Option<&str>> =
            if self.draws_each_place() { self.names().into_iter().map(Some).collect() } else { vec![None] };
        let mass_panels = groups.iter().flat_map(|(group, outer)| {
            masses.iter().map(|mass| self.cases_of_mass(*mass, group, outer, masses.len())).collect::<Vec<_>>()
        });
        let [_, of_forces, of_shares] = self.colours();
        let joint_panels = groups.iter().flat_map(|(group, outer)| {
            let joints = self.force_groups().into_iter().zip(of_forces..);
            joints.map(move |(joint, alone)| self.cases_of_joint(&joint, group, outer, alone))
        });
        let share_panels = groups.iter().flat_map(|(group, outer)| {
            let groups = contact_states::groups(&self.contact_joints).into_iter().zip(of_shares..);
            groups.flat_map(move |(joints, alone)| self.shares_in_cases(&joints, group, outer, alone))
        });
        mass_panels.chain(joint_panels).chain(share_panels).take(MAX_PANELS).collect()
    }

    /// Returns the same panels with percentiles of the draws for each combination of `vary`.
    fn percentile_panels(&self, cases: &[CaseRows]) -> Vec<Panel> {
        let groups = self.drawing.group_draws(cases);
        let draws = self.drawing.draws(groups.iter().map(|(_, group)| group.len()).max().unwrap_or(0));
        let some = (groups.len() > MAX_SINGLE_PLACES)
            .then(|| format!("the first {MAX_SINGLE_PLACES} of {} cases", groups.len()));
        let panel = |mut panel: Panel, name: &str, curve: CurveFn<'_>| {
            panel.title = join_title([name.to_owned(), draws.clone()].into_iter().chain(some.clone()));
            for (colour, (words, group)) in groups.iter().take(MAX_SINGLE_PLACES).enumerate() {
                let curves: Vec<_> = group.iter().map(|case_rows| curve(case_rows)).collect();
                panel.series.extend(percentiles(&curves, words, colour));
            }
            panel
        };
        let curve_of = |case_rows: &CaseRows, column: &str| {
            let column_values = |column: &str, factor: f64| -> Vec<f64> {
                numbers(self.curve, column, case_rows.rows.clone()).iter().map(|value| value * factor).collect()
            };
            (column_values(DRIVE, self.factor.0), column_values(column, self.factor.1))
        };
        let mut panels = Vec::new();
        if self.draws_each_place() {
            for (name, _) in &self.shown {
                panels.push(panel(self.panel(String::new()), name, &|case_rows| {
                    curve_of(case_rows, &amplitude_of(name))
                }));
            }
        } else {
            let name = format!("largest of {} places", self.shown.len());
            // without peaks: their frequencies differ between draws
            panels.push(panel(self.panel(String::new()), &name, &|case_rows| self.largest(case_rows)));
        }
        for (name, joints) in self.force_groups() {
            panels
                .push(panel(self.force_panel(String::new()), &name, &|case_rows| self.force_line(case_rows, &joints)));
        }
        for named in contact_states::groups(&self.contact_joints) {
            let case_line = |case_rows: &CaseRows| self.share_line(case_rows, &named.1, ContactState::Slip);
            let shares = self.share_panel(&named, ContactState::Slip, String::new());
            let title = shares.title.clone();
            panels.push(panel(shares, &title, &case_line));
        }
        panels.truncate(MAX_PANELS);
        panels
    }

    /// Draws the cases of a group for one place, or for the largest amplitude of all; the
    /// figure has `panels` such panels.
    fn cases_of_mass(&self, mass: Option<&str>, group: &[CaseRows], outer: &str, panels: usize) -> Panel {
        let named = mass.filter(|_| panels > 1).map(str::to_owned);
        let thinning_text = match group.len() > MAX_CURVES {
            true => Some(format!("{MAX_CURVES} of {} cases", group.len())),
            false => self.case_count_text.clone(),
        };
        let mut panel = self.panel(join_title(named.into_iter().chain([outer.to_owned()]).chain(thinning_text)));
        if mass.is_none() {
            panel.y.quantity = format!("largest amplitude of {} places", self.shown.len());
        } else if panels == 1 && self.system.places().len() > 1 {
            panel.y.quantity = format!("amplitude of {}", self.shown[0].0);
        }
        let cases: Vec<(usize, &CaseRows)> = evenly_chosen(group, MAX_CURVES).into_iter().enumerate().collect();
        panel.series.extend(self.references(&mass.map_or_else(|| self.names(), |mass| vec![mass]), &cases));
        // each case has its row of crosses if few cases have failures
        let failing = cases.iter().filter(|(_, case_rows)| !self.without_orbit(case_rows).is_empty()).count();
        let mut row = 0;
        for (colour, case_rows) in cases {
            if let Some(crosses) = self.failed_points(case_rows, row + 1, colour) {
                let value = case_rows.varied.last().map(|varied| varied.in_file_unit().0);
                panel.series.push(Series { value, ..crosses });
                row += usize::from(failing <= MAX_SINGLE_PLACES);
            }
            let (x, y) = match mass {
                Some(name) => self.line(case_rows, name),
                None => {
                    let (x, y, _) = self.envelope(case_rows);
                    (x, y)
                }
            };
            let line = case_series(case_rows, mass.unwrap_or("largest"), x, y, colour);
            let value = line.value;
            panel.series.push(line);
            let names = mass.map_or_else(|| self.names(), |name| vec![name]);
            panel
                .series
                .extend(self.reverse_sweep_series(case_rows, &names, colour).map(|back| Series { value, ..back }));
            let points = mass.map_or_else(|| self.largest_points(case_rows), |name| self.points(case_rows, name));
            panel.series.extend(self.points_to_doubt(case_rows, points, colour).map(|marks| Series { value, ..marks }));
            if let (Some(name), true) = (mass, group.len() <= MAX_SINGLE_PLACES) {
                panel.series.extend(self.marks(case_rows, name, colour).map(|marks| Series { value, ..marks }));
            }
        }
        panel
    }

    /// Draws the cases of a group for the force of one joint, or the largest of several; a
    /// single case has colour `alone`.
    fn cases_of_joint(
        &self,
        (joint, all): &(String, Vec<String>),
        group: &[CaseRows],
        outer: &str,
        alone: usize,
    ) -> Panel {
        let named = Some(joint.clone()).filter(|_| self.joints.len() > 1 || self.system.joints().len() > 1);
        let mut panel = self.force_panel(join_title(named.into_iter().chain([outer.to_owned()])));
        for (colour, case_rows) in evenly_chosen(group, MAX_CURVES).into_iter().enumerate() {
            let (x, y) = self.force_line(case_rows, all);
            let colour = if case_rows.varied.is_empty() { alone } else { colour };
            panel.series.push(case_series(case_rows, joint, x, y, colour));
        }
        panel
    }

    /// Draws the cases of a group for the slip of one joint or the mean of several, and for
    /// separation if it occurs.
    ///
    /// A single case has colour `alone`.
    fn shares_in_cases(
        &self,
        named: &(String, Vec<String>),
        group: &[CaseRows],
        outer: &str,
        alone: usize,
    ) -> Vec<Panel> {
        let (name, joints) = named;
        let panel = |state: ContactState| {
            let mut panel = self.share_panel(named, state, outer.to_owned());
            for (colour, case_rows) in evenly_chosen(group, MAX_CURVES).into_iter().enumerate() {
                let (x, y) = self.share_line(case_rows, joints, state);
                let colour = if case_rows.varied.is_empty() { alone } else { colour };
                panel.series.push(case_series(case_rows, name, x, y, colour));
            }
            panel
        };
        let occurs = |state: ContactState| contact_states::occurs_in(self.curve, joints, state);
        // the slip of a stop is unknown
        let states: &[ContactState] = match (occurs(ContactState::Slip), occurs(ContactState::Open)) {
            (_, false) => &[ContactState::Slip],
            (true, true) => &[ContactState::Slip, ContactState::Open],
            (false, true) => &[ContactState::Open],
        };
        states.iter().map(|state| panel(*state)).collect()
    }
}

/// Returns the curve of a case with the label of its last varied parameter, or `alone` without
/// one.
fn case_series(case_rows: &CaseRows, alone: &str, x: Vec<f64>, y: Vec<f64>, colour: usize) -> Series {
    let last = case_rows.varied.last();
    let label = last.map_or_else(|| alone.to_owned(), |varied| varied.text.clone());
    Series { value: last.map(|varied| varied.in_file_unit().0), ..Series::line(label, x, y, colour) }
}
