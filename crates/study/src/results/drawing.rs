//! Tools for kinds to draw figures from finished tables, computed in this run or read from
//! disk.

use crate::case::study::{Study, VariedValue};
use crate::case::values::Values;
use crate::results::dataset::{Axis, CellValues, Table, column_name};
use crate::syntax::format::prefixed_unit;
use crate::syntax::units;
use std::collections::BTreeMap;
use std::ops::Range;
use stickslip::model::System;

/// A study and its finished tables.
#[derive(Debug, Clone, Copy)]
pub struct FigureInput<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its tables.
    pub tables: &'a [Table],
}

/// The rows of a table that belong to one case.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CaseRows {
    /// Number of the case.
    pub case: usize,
    /// Values of the varied parameters.
    pub varied: Vec<VariedValue>,
    /// Range of rows.
    pub rows: Range<usize>,
}

impl CaseRows {
    /// Returns the varied parameters in words.
    pub fn label(&self) -> String {
        crate::case::study::varied_text(&self.varied)
    }
}

/// Largest number of curves in a panel. Further curves are left out evenly, and the panel
/// states this.
pub(crate) const MAX_CURVES: usize = 400;

/// The assignment of curves to panels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PanelLayout {
    /// One panel per case, with a curve for every mass.
    Cases,
    /// One panel per mass, with a curve for every case.
    Masses,
}

impl<'a> FigureInput<'a> {
    /// Returns the values of `[figure]`.
    pub(crate) fn options(&self) -> Values {
        self.study.figure_values()
    }

    /// Returns true if the figure shows a mass or joint of this name.
    pub(crate) fn shows(&self, name: &str) -> bool {
        let sectors = self.study.structure.lists.disk.is_some();
        let is =
            |shown: &String| shown == name || is_direction_of(shown, name) || (sectors && is_of_sector(shown, name));
        self.options().names("only").is_none_or(|names| names.iter().any(is))
    }

    /// Returns the places that the figure shows, with their indices.
    ///
    /// Rotations are left out, because the axis has lengths.
    pub(crate) fn displacements(&self, system: &System) -> Vec<(String, usize)> {
        let places = system.places().iter().zip(system.place_axes()).enumerate();
        let shown = places.filter(|(_, (name, along))| !along.is_rotation() && self.shows(name));
        shown.map(|(place, (name, _))| (name.clone(), place)).collect()
    }

    /// Chooses the layout for this number of masses and cases, with `panels` panels per case.
    ///
    /// Random draws are shown by percentiles for every mass.
    pub(crate) fn layout(&self, masses: usize, cases: usize, panels: usize) -> PanelLayout {
        if self.study.draws().is_some() {
            return PanelLayout::Masses;
        }
        match self.options().text("panels") {
            Some("cases") => return PanelLayout::Cases,
            Some("masses") => return PanelLayout::Masses,
            _ => {}
        }
        match self.options().flag("overlay") {
            Some(true) => PanelLayout::Masses,
            Some(false) => PanelLayout::Cases,
            None if cases > 1 && cases * panels > MAX_PANELS => PanelLayout::Masses,
            // Up to this number of cases each case has a panel with all masses; beyond it each
            // mass has a panel with all cases.
            None if masses > 1 && cases <= 6 => PanelLayout::Cases,
            None => PanelLayout::Masses,
        }
    }

    /// Returns an axis of the figure (0 or 1) and the factor from table values, which are in
    /// `si`.
    ///
    /// The unit is the requested one, or else one that suits `largest`.
    pub(crate) fn axis(&self, which: usize, quantity: &str, largest: f64, si: &'static str) -> (Axis, f64) {
        let si = self.unit(si);
        let options = self.options();
        let (unit_key, scale_key) = [("x_unit", "x"), ("y_unit", "y")][which];
        let asked = options.text(unit_key).and_then(|text| Some((text.to_owned(), units::parse(text)?)));
        let (unit, factor) = match asked {
            Some((text, unit)) => (text, units::parse(si).map_or(1.0, |si| si.si_value("1")) / unit.si_value("1")),
            None if si == "Hz" => (si.to_owned(), 1.0),
            None => prefixed_unit(largest, si),
        };
        let axis = Axis::new(quantity, unit);
        (if options.text(scale_key) == Some("log") { axis.log() } else { axis }, factor)
    }

    /// Returns the unit of a displacement (m) or a force (N) of this study: rad or N m in a model
    /// of rotation.
    pub(crate) fn unit(&self, si: &'static str) -> &'static str {
        match (self.study.is_torsional(), si) {
            (true, "m") => "rad",
            (true, "N") => "N m",
            _ => si,
        }
    }

    /// Returns the colour axis of curves that differ in the varied parameter number `which`.
    ///
    /// Returns `None` without such a parameter.
    pub(crate) fn varied_axis(&self, cases: &[CaseRows], which: usize) -> Option<Axis> {
        let last = cases.first()?.varied.get(which)?;
        let values: Vec<f64> =
            cases.iter().filter_map(|case_rows| Some(case_rows.varied.get(which)?.in_file_unit().0)).collect();
        let unit = last.in_file_unit().1;
        let axis = Axis {
            whole: unit.is_empty() && values.iter().all(|value| value.fract() == 0.0),
            ..Axis::new(&last.name, unit)
        };
        // values spaced by ratios get a logarithmic scale
        let positive = values.iter().all(|value| *value > 0.0);
        let (low, high) = values.iter().fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(*v), high.max(*v)));
        let middle = values.get(values.len() / 2).copied().unwrap_or(0.0);
        // Ratio of largest to smallest parameter value above which a logarithmic scale is
        // considered.
        let by_ratio = positive && high > 10.0 * low && (middle / (low * high).sqrt()).ln().abs() < 0.7;
        Some(if by_ratio { axis.log() } else { axis })
    }

    /// Groups the cases by their parameters of `vary`, without drawn parameters: text and cases.
    pub(crate) fn group_draws<'s>(&self, cases: &'s [CaseRows]) -> Vec<(String, Vec<&'s CaseRows>)> {
        let (drawn, combinations) = (self.study.drawn_parameter_count(), self.study.cases_per_draw());
        let mut groups: BTreeMap<usize, Vec<&CaseRows>> = BTreeMap::new();
        cases.iter().for_each(|case_rows| groups.entry(case_rows.case % combinations).or_default().push(case_rows));
        let words =
            |case_rows: &CaseRows| crate::case::study::varied_text(case_rows.varied.get(drawn..).unwrap_or_default());
        groups.into_values().map(|group| (group.first().map_or_else(String::new, |s| words(s)), group)).collect()
    }

    /// States in words how many of the draws are shown.
    pub(crate) fn draws(&self, shown: usize) -> String {
        match self.study.draws() {
            Some(all) if all > shown => format!("the first {shown} of {all} draws"),
            _ => format!("{shown} draws"),
        }
    }

    /// States how many of the cases are shown, if not all.
    pub(crate) fn shown_cases_text(&self, shown: usize) -> Option<String> {
        let all = self.study.cases();
        (shown < all && self.study.draws().is_none()).then(|| format!("{shown} of {all} cases"))
    }

    /// Returns a table by name; `None` if it has no rows.
    pub(crate) fn table(&self, name: &str) -> Option<&'a Table> {
        self.tables.iter().find(|table| table.name == name && table.rows() > 0)
    }

    /// Returns the system of the first case; the other cases differ in numbers only.
    pub(crate) fn system(&self) -> Option<System> {
        self.study.assembled.system(&self.study.case(0).ok()?.model).ok()
    }

    /// Returns the rows of `table` case by case.
    ///
    /// The first columns of the table are the varied parameters, all of them or all but the
    /// last.
    pub(crate) fn case_rows(&self, table: &Table) -> Vec<CaseRows> {
        self.case_rows_by(table, self.study.varied().len())
    }

    /// Does the same by the first `keys` varied parameters; `case` is the first case of each
    /// group.
    pub(crate) fn case_rows_by(&self, table: &Table, keys: usize) -> Vec<CaseRows> {
        let columns: Vec<&[f64]> = table
            .columns
            .iter()
            .take(keys)
            .filter_map(|column| match &column.values {
                CellValues::Number(values) => Some(values.as_slice()),
                _ => None,
            })
            .collect();
        let same = |a: usize, b: usize| columns.iter().all(|column| column[a].to_bits() == column[b].to_bits());
        let mut cases: Vec<CaseRows> = Vec::new();
        let mut from = 0;
        let mut case = 0;
        while from < table.rows() {
            let mut to = from + 1;
            while to < table.rows() && same(from, to) {
                to += 1;
            }
            // rows are in the order of the cases; a case may have no rows
            while case < self.study.cases() {
                let varied = self.study.varied_values(case).unwrap_or_default();
                if varied
                    .iter()
                    .zip(&columns)
                    .all(|(value, column)| value.column().1.to_bits() == column[from].to_bits())
                {
                    cases.push(CaseRows { case, varied, rows: from..to });
                    break;
                }
                case += 1;
            }
            case += usize::from(keys == self.study.varied().len());
            from = to;
        }
        cases
    }
}

/// Largest number of panels in a figure; the tables hold all cases.
pub(crate) const MAX_PANELS: usize = 12;

/// Returns at most `most` of `all`, evenly chosen, including both ends.
pub(crate) fn evenly_chosen<T>(all: &[T], most: usize) -> Vec<&T> {
    if all.len() <= most {
        return all.iter().collect();
    }
    (0..most).map(|i| &all[i * (all.len() - 1) / (most - 1)]).collect()
}

/// Joins the non-empty parts of a title.
pub(crate) fn join_title(parts: impl IntoIterator<Item = String>) -> String {
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", ")
}

/// Returns the numbers of a column in some rows; NaN without such a column.
pub(crate) fn numbers(table: &Table, column: &str, rows: Range<usize>) -> Vec<f64> {
    match table.numbers(&column_name(column)) {
        Some(values) => values[rows].to_vec(),
        None => vec![f64::NAN; rows.len()],
    }
}

/// Returns the words of a column.
pub(crate) fn words<'t>(table: &'t Table, column: &str) -> &'t [String] {
    table.texts(column).unwrap_or_default()
}

/// Returns the largest finite magnitude in the columns of these names.
pub(crate) fn largest(table: &Table, columns: impl IntoIterator<Item = String>) -> f64 {
    let index = table.index();
    let columns = columns.into_iter().filter_map(|column| index.get(&*column_name(&column))?.as_numbers());
    columns.flatten().map(|value| value.abs()).filter(|value| value.is_finite()).fold(0.0, f64::max)
}

/// Returns true if `name` is an axis or direction of `whole`: `root.x` of `root`.
fn is_direction_of(whole: &str, name: &str) -> bool {
    name.strip_prefix(whole).is_some_and(|rest| rest.starts_with('.'))
}

/// Returns true if `name` is the place `whole` in one sector of a disk.
///
/// Examples: `blade_3` and `blade_3.x` for `blade`; `blade_3.x` for `blade.x`.
fn is_of_sector(whole: &str, name: &str) -> bool {
    let (node, along) = whole.split_once('.').map_or((whole, None), |(node, along)| (node, Some(along)));
    let (in_ring, direction) = name.split_once('.').map_or((name, None), |(node, along)| (node, Some(along)));
    let number = in_ring.strip_prefix(node).and_then(|rest| rest.strip_prefix('_'));
    number.is_some_and(|number| number.parse::<usize>().is_ok()) && (along.is_none() || along == direction)
}
