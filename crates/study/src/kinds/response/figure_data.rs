//! Data of a response figure: curves of places and joints, read from the tables.

use crate::kinds::shared::contact_states::{self, ContactState};
use crate::kinds::shared::disk_shape;
use crate::kinds::shared::points_to_doubt::PointsToDoubt;
use crate::results::columns::{FREQUENCY as DRIVE, amplitude_of, phase_of, place_and_sector};
use crate::results::dataset::{Axis, Column, Panel, Series, Style, Table, column_name};
use crate::results::drawing::{CaseRows, FigureInput, join_title, numbers};
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use stickslip::model::System;
use stickslip_numerics::tie_break::{RELATIVE_TIE, first_largest};

/// Largest number of places drawn one by one. For more places, the largest amplitude is drawn,
/// with pale curves behind it.
pub(super) const MAX_SINGLE_PLACES: usize = 7;

/// Names of places with amplitude (m) and phase (degrees).
pub(super) type DeflectionShape<'a> = Vec<(&'a str, f64, f64)>;

/// A peak of a place in a case.
#[derive(Debug, Clone)]
pub(super) struct CasePeak {
    pub(super) case: usize,
    pub(super) mass: String,
    /// Frequency (Hz) and amplitude (m).
    pub(super) at: (f64, f64),
    /// True if only the reverse sweep has the peak.
    pub(super) reverse_sweep: bool,
}

/// The data of the figure.
pub(super) struct FigureData<'a> {
    pub(super) drawing: &'a FigureInput<'a>,
    pub(super) curve: &'a Table,
    /// Columns of the curve table by name.
    pub(super) index: HashMap<&'a str, &'a Column>,
    /// Names and indices of the shown places.
    pub(super) shown: Vec<(String, usize)>,
    /// Other orbits of the reverse sweep, and the rows of each case.
    pub(super) reverse_sweep: Option<(&'a Table, Vec<CaseRows>)>,
    /// The linear references, and the rows of each case that has different ones.
    pub(super) references: Option<(&'a Table, Vec<CaseRows>)>,
    /// The peaks inside the frequency range.
    pub(super) peaks: Vec<CasePeak>,
    /// Shapes of a disk at its peaks, and the rows of each case.
    pub(super) shapes: Option<(&'a Table, Vec<CaseRows>)>,
    /// Names of the joints whose forces are shown.
    pub(super) joints: Vec<String>,
    /// Names of the joints whose contact states are shown.
    pub(super) contact_joints: Vec<String>,
    /// The system of the first case; the other cases differ in numbers only.
    pub(super) system: &'a System,
    pub(super) axes: (Axis, Axis),
    pub(super) force_axis: Axis,
    /// Factors from table values to axis values.
    pub(super) factor: (f64, f64),
    pub(super) force_factor: f64,
    /// Number of points without an orbit among all drawn points.
    pub(super) failed: usize,
    pub(super) to_doubt: PointsToDoubt,
    /// States how many of the cases are shown, if not all.
    pub(super) case_count_text: Option<String>,
}

impl FigureData<'_> {
    /// Returns the amplitudes of one place in some rows; NaN without such a column.
    pub(super) fn amplitudes(&self, name: &str, rows: Range<usize>) -> Vec<f64> {
        let column = self.index.get(&*column_name(&amplitude_of(name))).and_then(|column| column.as_numbers());
        column.map_or_else(|| vec![f64::NAN; rows.len()], |values| values[rows.clone()].to_vec())
    }

    /// Returns the curve of one place in one case, with its peaks inserted.
    pub(super) fn line(&self, case_rows: &CaseRows, name: &str) -> (Vec<f64>, Vec<f64>) {
        let points = self.points(case_rows, name);
        self.scaled(self.with_peaks(case_rows, points, &|peak| !peak.reverse_sweep && peak.mass == name))
    }

    /// Returns the curve of the reverse sweep if it has other orbits.
    ///
    /// The curve belongs to one place with its peaks, or to the largest of several, in the same
    /// colour. Most figures have no such curve.
    pub(super) fn reverse_sweep_series(&self, case_rows: &CaseRows, names: &[&str], colour: usize) -> Option<Series> {
        let (table, cases) = self.reverse_sweep.as_ref()?;
        let rows = cases.iter().find(|of| of.case == case_rows.case)?.rows.clone();
        let x = numbers(table, DRIVE, rows.clone());
        let all: Vec<Vec<f64>> = names.iter().map(|name| numbers(table, &amplitude_of(name), rows.clone())).collect();
        let largest = |i: usize| all.iter().map(|y| y[i]).fold(f64::NAN, f64::max);
        let points = (0..x.len()).map(|i| (x[i], largest(i))).collect();
        let mut points =
            self.with_peaks(case_rows, points, &|peak| peak.reverse_sweep && names == [peak.mass.as_str()]);
        // the line has a gap at frequencies at which both sweeps have the same orbit
        let there = numbers(self.curve, DRIVE, case_rows.rows.clone());
        let alike: Vec<f64> = there.into_iter().filter(|omega| !x.contains(omega)).collect();
        let within = points.first().map_or(0.0, |first| first.0)..points.last().map_or(0.0, |last| last.0);
        points.extend(alike.into_iter().filter(|x| within.contains(x)).map(|x| (x, f64::NAN)));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (x, y) = self.scaled(points);
        Some(Series { style: Style::Dotted, ..Series::line("reverse sweep", x, y, colour) })
    }

    /// Returns the largest amplitude of the shown places, (Hz, m), without their peaks.
    pub(super) fn largest_points(&self, case_rows: &CaseRows) -> Vec<(f64, f64)> {
        self.largest_at(case_rows, &self.all(case_rows))
    }

    /// Returns the largest amplitude of the shown places at the frequencies of the curve.
    pub(super) fn largest(&self, case_rows: &CaseRows) -> (Vec<f64>, Vec<f64>) {
        self.scaled(self.largest_points(case_rows))
    }

    /// Returns the largest amplitude with the peaks inserted, and states which place has the
    /// maximum.
    pub(super) fn envelope(&self, case_rows: &CaseRows) -> (Vec<f64>, Vec<f64>, String) {
        let all = self.all(case_rows);
        let highest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut heights: Vec<f64> = all.iter().map(|values| highest(values)).collect();
        let alike = first_largest(heights.iter().copied())
            .is_none_or(|worst| heights.iter().all(|height| *height >= (1.0 - RELATIVE_TIE) * heights[worst]));
        // a refined peak may be higher than all points of the curve
        for peak in self.peaks_of(case_rows).filter(|peak| !peak.reverse_sweep) {
            if let Some(i) = self.shown.iter().position(|(name, _)| *name == peak.mass) {
                heights[i] = heights[i].max(peak.at.1);
            }
        }
        let worst = first_largest(heights.into_iter()).filter(|_| !alike);
        let points = self.largest_at(case_rows, &all);
        let below = |omega: f64| {
            let index = points.partition_point(|point| point.0 < omega).clamp(1, points.len().max(2) - 1);
            let ((x0, y0), (x1, y1)) = (points[index - 1], points[index]);
            y0 + (omega - x0) / (x1 - x0) * (y1 - y0)
        };
        // a peak of one place below the curve of another place is not on the envelope
        let counts = |peak: &CasePeak| !peak.reverse_sweep && points.len() > 1 && peak.at.1 > below(peak.at.0);
        let (x, y) = self.scaled(self.with_peaks(case_rows, points.clone(), &counts));
        (
            x,
            y,
            worst.map_or_else(
                || "all places are equal".to_owned(),
                |worst| format!("maximum at {}", self.shown[worst].0),
            ),
        )
    }

    /// Returns the amplitudes of every shown place.
    fn all(&self, case_rows: &CaseRows) -> Vec<Vec<f64>> {
        self.shown.iter().map(|(name, _)| self.amplitudes(name, case_rows.rows.clone())).collect()
    }

    /// Returns the largest of several amplitudes over the frequency.
    fn largest_at(&self, case_rows: &CaseRows, all: &[Vec<f64>]) -> Vec<(f64, f64)> {
        let largest = |i: usize| all.iter().map(|values| values[i]).fold(f64::NAN, f64::max);
        let x = numbers(self.curve, DRIVE, case_rows.rows.clone());
        x.into_iter().enumerate().map(|(i, x)| (x, largest(i))).collect()
    }

    /// Scales points to the axes.
    fn scaled(&self, points: Vec<(f64, f64)>) -> (Vec<f64>, Vec<f64>) {
        points.into_iter().map(|(x, y)| (x * self.factor.0, y * self.factor.1)).unzip()
    }

    /// Returns the frequency (Hz) of the largest amplitude, and amplitude (m) and phase
    /// (degrees) of every shown place there.
    ///
    /// The maximum is a refined peak, or a point of the curve without a higher peak.
    pub(super) fn shape_at_maximum(&self, case_rows: &CaseRows) -> Option<(f64, DeflectionShape<'_>)> {
        let peaks = self
            .shapes
            .as_ref()
            .and_then(|(table, cases)| Some((*table, cases.iter().find(|of| of.case == case_rows.case)?.rows.clone())));
        let highest = |(table, rows): (&Table, Range<usize>)| {
            let index = table.index();
            let number = |column: String, row: usize| {
                let column = index.get(&*column_name(&column)).and_then(|column| column.as_numbers());
                column.map_or(f64::NAN, |values| values[row])
            };
            let shape = |row: usize| -> DeflectionShape<'_> {
                let names = self.shown.iter().map(|(name, _)| name.as_str());
                names.map(|name| (name, number(amplitude_of(name), row), number(phase_of(name), row))).collect()
            };
            let height = |row: usize| {
                let amplitudes = self.shown.iter().map(|(name, _)| number(amplitude_of(name), row));
                amplitudes.fold(f64::NEG_INFINITY, f64::max)
            };
            let row = rows.max_by(|a, b| height(*a).total_cmp(&height(*b)))?;
            Some((height(row), number(DRIVE.to_owned(), row), shape(row)))
        };
        let both = [Some((self.curve, case_rows.rows.clone())), peaks].into_iter().flatten().filter_map(highest);
        both.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, frequency, shape)| (frequency, shape))
    }

    fn peaks_of(&self, case_rows: &CaseRows) -> impl Iterator<Item = &CasePeak> {
        self.peaks.iter().filter(|peak| peak.case == case_rows.case)
    }

    fn with_peaks(
        &self,
        case_rows: &CaseRows,
        mut points: Vec<(f64, f64)>,
        counts: &dyn Fn(&CasePeak) -> bool,
    ) -> Vec<(f64, f64)> {
        points.extend(self.peaks_of(case_rows).filter(|peak| counts(peak)).map(|peak| peak.at));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    }

    /// Returns marks at the peaks of one place.
    pub(super) fn marks(&self, case_rows: &CaseRows, name: &str, colour: usize) -> impl Iterator<Item = Series> {
        self.peaks_of(case_rows).filter(move |peak| peak.mass == name).map(move |CasePeak { at: (x, y), .. }| {
            Series::marks("peak", vec![x * self.factor.0], vec![y * self.factor.1], colour)
        })
    }

    /// Returns the curves of the linear references, for one place or for the largest amplitude.
    ///
    /// Curves that all cases share are grey. Otherwise each curve has the colour of its case;
    /// of many cases only the first and the last are drawn.
    pub(super) fn references(&self, names: &[&str], cases: &[(usize, &CaseRows)]) -> Vec<Series> {
        let Some((table, known)) = &self.references else { return Vec::new() };
        // a case without rows has the references of the previous case
        let reference_of = |case: usize| known.iter().rev().find(|own| own.case <= case);
        let mut own: Vec<(usize, &CaseRows, &CaseRows)> = Vec::new();
        for (colour, case_rows) in cases {
            let Some(reference) = reference_of(case_rows.case) else { continue };
            if own.iter().all(|(_, _, found)| found.rows != reference.rows) {
                own.push((*colour, case_rows, reference));
            }
        }
        let found = own.len();
        if found > MAX_SINGLE_PLACES {
            own = vec![own[0], own[own.len() - 1]];
        }
        let (several, thinned) = (own.len() > 1, own.len() < found);
        let mut lines: Vec<Series> = Vec::new();
        for (colour, case_rows, reference) in own {
            for line in self.reference(table, reference, names) {
                // a parameter that does not change a curve gives it once
                if lines.iter().any(|known| (&known.x, &known.y) == (&line.x, &line.y)) {
                    continue;
                }
                if !several {
                    lines.push(line.reference());
                    continue;
                }
                let case_text = if thinned { case_rows.label() } else { "for each case".to_owned() };
                let (label, value) =
                    (format!("{}, {case_text}", line.label), case_rows.varied.last().map(|v| v.in_file_unit().0));
                lines.push(Series { label, value, colour, ..line.case_reference() });
            }
        }
        lines
    }

    /// Returns crosses at the points of a case without an orbit, in this row from below.
    pub(super) fn failed_points(&self, case_rows: &CaseRows, row: usize, colour: usize) -> Option<Series> {
        let x = self.without_orbit(case_rows);
        let count = self.failed;
        let label = format!("{count} point{} without an orbit", crate::syntax::format::plural_suffix(count));
        (!x.is_empty()).then(|| Series::missing(label, x, row, colour))
    }

    /// Returns triangles at the points to doubt of a curve, whose points (Hz, m) are those of the
    /// case.
    pub(super) fn points_to_doubt(
        &self,
        case_rows: &CaseRows,
        curve: Vec<(f64, f64)>,
        colour: usize,
    ) -> Option<Series> {
        let doubtful = case_rows.rows.clone().zip(curve).filter(|(row, _)| self.to_doubt.rows.contains(row));
        let (x, y) = self.scaled(doubtful.map(|(_, point)| point).filter(|point| point.1.is_finite()).collect());
        (!x.is_empty()).then(|| Series::warning(self.to_doubt.label.clone(), x, y, colour))
    }

    /// Returns the points of a place in a case, (Hz, m), without its peaks.
    pub(super) fn points(&self, case_rows: &CaseRows, name: &str) -> Vec<(f64, f64)> {
        let x = numbers(self.curve, DRIVE, case_rows.rows.clone());
        x.into_iter().zip(self.amplitudes(name, case_rows.rows.clone())).collect()
    }

    /// Returns the frequencies, on the axis, at which a case has no orbit.
    pub(super) fn without_orbit(&self, case_rows: &CaseRows) -> Vec<f64> {
        let all = self.all(case_rows);
        let x = numbers(self.curve, DRIVE, case_rows.rows.clone());
        let failed = |i: &usize| !all.is_empty() && all.iter().all(|values| values[*i].is_nan());
        (0..x.len()).filter(failed).map(|i| x[i] * self.factor.0).collect()
    }

    /// Returns the two reference curves of one case.
    fn reference(&self, table: &Table, case_rows: &CaseRows, names: &[&str]) -> Vec<Series> {
        let rows = case_rows.rows.clone();
        let x: Vec<f64> = numbers(table, DRIVE, rows.clone()).iter().map(|x| x * self.factor.0).collect();
        let line = |(what, style): (&str, Style)| {
            let column = |name: &&str| numbers(table, &amplitude_of(&format!("{name}_{what}")), rows.clone());
            let all: Vec<Vec<f64>> = names.iter().map(column).collect();
            let y = (0..x.len()).map(|i| all.iter().map(|y| y[i]).fold(f64::NAN, f64::max) * self.factor.1);
            let suffix = if names.len() > 1 { ", largest" } else { "" };
            Series { style, ..Series::line(format!("all joints {what}{suffix}"), x.clone(), y.collect(), 0) }
        };
        // the notes state why a reference is missing
        let lines = [("free", Style::Dashed), ("stuck", Style::Dotted)].into_iter().map(line);
        lines.filter(|line| line.y.iter().any(|y| y.is_finite())).collect()
    }

    pub(super) fn panel(&self, title: String) -> Panel {
        Panel { title, x: self.axes.0.clone(), y: self.axes.1.clone(), ..Panel::default() }
    }

    pub(super) fn force_panel(&self, title: String) -> Panel {
        Panel { y: self.force_axis.clone(), ..self.panel(title) }
    }

    /// Returns a panel of the share of one state, for one joint or the mean of several.
    pub(super) fn share_panel(
        &self,
        (name, joints): &(String, Vec<String>),
        state: ContactState,
        more: String,
    ) -> Panel {
        let words = state.words();
        let title = if joints.len() == 1 { format!("{name} {words}") } else { format!("{name}, {words}") };
        Panel { y: contact_states::axis("share of the period"), ..self.panel(join_title([title, more])) }
    }

    /// Returns the share of the period of one state, for example slip, as the mean of the
    /// joints.
    pub(super) fn share_line(
        &self,
        case_rows: &CaseRows,
        joints: &[String],
        state: ContactState,
    ) -> (Vec<f64>, Vec<f64>) {
        let x = numbers(self.curve, DRIVE, case_rows.rows.clone()).iter().map(|x| x * self.factor.0).collect();
        (x, contact_states::mean_share(self.curve, joints, &case_rows.rows, state))
    }

    /// Returns the force of a joint, or the largest of several.
    pub(super) fn force_line(&self, case_rows: &CaseRows, joints: &[String]) -> (Vec<f64>, Vec<f64>) {
        let column_values = |column: &str, factor: f64| -> Vec<f64> {
            numbers(self.curve, column, case_rows.rows.clone()).iter().map(|value| value * factor).collect()
        };
        let all: Vec<Vec<f64>> = joints.iter().map(|joint| column_values(&force(joint), self.force_factor)).collect();
        let largest = |i: usize| all.iter().map(|forces| forces[i]).fold(f64::NAN, f64::max);
        (column_values(DRIVE, self.factor.0), (0..case_rows.rows.len()).map(largest).collect())
    }

    /// Groups the joints whose forces are drawn as one line, with its name.
    ///
    /// Each of a few joints is one group. Of many joints, those with the same name in every
    /// sector form a group.
    pub(super) fn force_groups(&self) -> Vec<(String, Vec<String>)> {
        if self.joints.len() <= MAX_SINGLE_PLACES {
            return self.joints.iter().map(|joint| (joint.clone(), vec![joint.clone()])).collect();
        }
        let mut groups: Vec<(String, Vec<String>)> = Vec::new();
        for joint in &self.joints {
            let place = place_and_sector(joint).map_or_else(|| "joint".to_owned(), |(place, _)| place);
            match groups.iter_mut().find(|(name, _)| *name == place) {
                Some((_, group)) => group.push(joint.clone()),
                None => groups.push((place, vec![joint.clone()])),
            }
        }
        let named = |(place, group): (String, Vec<String>)| (format!("{place}, largest of {}", group.len()), group);
        groups.into_iter().map(named).collect()
    }

    /// Returns the colour of a single place.
    ///
    /// It is the same in all figures if the palette has a colour for every place of the model.
    pub(super) fn colour_of(&self, name: &str, place: usize) -> usize {
        if self.system.places().len() <= MAX_SINGLE_PLACES {
            return place;
        }
        self.shown.iter().position(|(shown, _)| shown == name).unwrap_or(place)
    }

    /// Returns the first colours for places in a sector, joint forces and contact states, so
    /// that no colour is used twice.
    pub(super) fn colours(&self) -> [usize; 3] {
        let places = match self.draws_each_place() {
            true => self.shown.len().max(self.system.places().len().min(MAX_SINGLE_PLACES)),
            // Number of colours for the curves of many places: the single curves and the largest
            // amplitude.
            false => 2,
        };
        let in_sector: BTreeSet<String> = match self.is_disk() {
            true => self.shown.iter().filter_map(|(name, _)| Some(place_and_sector(name)?.0)).collect(),
            false => BTreeSet::new(),
        };
        let joints = places + in_sector.len().min(disk_shape::MAX_PLACES);
        [places, joints, joints + if self.joints.is_empty() { 0 } else { self.force_groups().len() }]
    }

    /// Returns true if the model is a disk, whose sectors are compared in a panel.
    pub(super) fn is_disk(&self) -> bool {
        self.drawing.study.case(0).is_ok_and(|case| case.model.ring.is_some())
    }

    /// Returns true if the places are drawn one by one.
    pub(super) fn draws_each_place(&self) -> bool {
        self.shown.len() <= MAX_SINGLE_PLACES
    }

    pub(super) fn names(&self) -> Vec<&str> {
        self.shown.iter().map(|(name, _)| name.as_str()).collect()
    }
}

/// Returns the column name of the force of a joint.
pub(super) fn force(joint: &str) -> String {
    format!("{joint}_force_amplitude_N")
}
