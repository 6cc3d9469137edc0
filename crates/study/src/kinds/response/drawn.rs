//! What the figure of a response draws: curves of places and joints, read off its tables.

use super::super::shares::{self, State};
use super::super::wheel::{self, of_sector};
use crate::columns::{FREQUENCY as DRIVE, amplitude_of, phase_of};
use crate::dataset::{Axis, Column, Panel, Series, Style, Table, column_name};
use crate::drawing::{Drawing, Stretch, join, numbers};
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use stickslip::model::System;
use stickslip_numerics::leading::{EQUAL, leading};

/// Masses that are drawn one by one; of more the largest amplitude is, with the single ones pale behind it.
pub(super) const SINGLE: usize = 7;

/// Colours that the curves of many masses take: the single ones and the largest of them.
const MANY: usize = 2;

/// Names of places with amplitude (m) and phase (degrees) of each.
pub(super) type Shape<'a> = Vec<(&'a str, f64, f64)>;

/// A peak of a mass in a case.
#[derive(Debug, Clone)]
pub(super) struct PeakOf {
    pub(super) case: usize,
    pub(super) mass: String,
    /// Frequency (Hz) and amplitude (m).
    pub(super) at: (f64, f64),
    /// Whether only the way back has it.
    pub(super) way_back: bool,
}

/// What is drawn.
pub(super) struct Drawn<'a> {
    pub(super) drawing: &'a Drawing<'a>,
    pub(super) curve: &'a Table,
    /// Its columns by name.
    pub(super) index: HashMap<&'a str, &'a Column>,
    /// Names of the masses that are shown, and their numbers.
    pub(super) shown: Vec<(String, usize)>,
    /// The orbits of the way back where they are others, and the rows of each case.
    pub(super) way_back: Option<(&'a Table, Vec<Stretch>)>,
    /// The linear structures, and the rows of each case that has its own.
    pub(super) references: Option<(&'a Table, Vec<Stretch>)>,
    /// Those inside the range.
    pub(super) peaks: Vec<PeakOf>,
    /// What a disk does at its peaks, and the rows of each case.
    pub(super) shapes: Option<(&'a Table, Vec<Stretch>)>,
    /// Names of the joints whose forces are shown.
    pub(super) joints: Vec<String>,
    /// Names of the joints whose shares of stick and slip are shown.
    pub(super) faces: Vec<String>,
    /// The first case's; the others differ in numbers only.
    pub(super) system: &'a System,
    pub(super) axes: (Axis, Axis),
    pub(super) force_axis: Axis,
    /// From the values of tables to those on the axes.
    pub(super) factor: (f64, f64),
    pub(super) force_factor: f64,
    /// Points without an orbit among all that are drawn.
    pub(super) failed: usize,
    /// How many of the cases are shown, if not all.
    pub(super) left_out: Option<String>,
}

impl Drawn<'_> {
    /// Amplitudes of one mass in some rows; NaN where there are none.
    pub(super) fn amplitudes(&self, name: &str, rows: Range<usize>) -> Vec<f64> {
        let column = self.index.get(&*column_name(&amplitude_of(name))).and_then(|column| column.as_numbers());
        column.map_or_else(|| vec![f64::NAN; rows.len()], |values| values[rows.clone()].to_vec())
    }

    /// The curve of one mass in one case, with its peaks among its points.
    pub(super) fn line(&self, stretch: &Stretch, name: &str) -> (Vec<f64>, Vec<f64>) {
        let x = numbers(self.curve, DRIVE, stretch.rows.clone());
        let y = self.amplitudes(name, stretch.rows.clone());
        self.scaled(
            self.with_peaks(stretch, x.into_iter().zip(y).collect(), &|peak| !peak.way_back && peak.mass == name),
        )
    }

    /// The curves of the way back where it has other orbits: of one mass with its peaks, or the largest of several; in the same colour, none in most figures.
    pub(super) fn way_back(&self, stretch: &Stretch, names: &[&str], colour: usize) -> Option<Series> {
        let (table, stretches) = self.way_back.as_ref()?;
        let rows = stretches.iter().find(|of| of.case == stretch.case)?.rows.clone();
        let x = numbers(table, DRIVE, rows.clone());
        let all: Vec<Vec<f64>> = names.iter().map(|name| numbers(table, &amplitude_of(name), rows.clone())).collect();
        let largest = |i: usize| all.iter().map(|y| y[i]).fold(f64::NAN, f64::max);
        let points = (0..x.len()).map(|i| (x[i], largest(i))).collect();
        let mut points = self.with_peaks(stretch, points, &|peak| peak.way_back && names == [peak.mass.as_str()]);
        // where both ways have the same orbits, the line has a gap
        let there = numbers(self.curve, DRIVE, stretch.rows.clone());
        let alike: Vec<f64> = there.into_iter().filter(|omega| !x.contains(omega)).collect();
        let within = points.first().map_or(0.0, |first| first.0)..points.last().map_or(0.0, |last| last.0);
        points.extend(alike.into_iter().filter(|x| within.contains(x)).map(|x| (x, f64::NAN)));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (x, y) = self.scaled(points);
        Some(Series { style: Style::Dotted, ..Series::line("way back", x, y, colour) })
    }

    /// The largest amplitude over the shown masses at the frequencies of the curve.
    pub(super) fn largest(&self, stretch: &Stretch) -> (Vec<f64>, Vec<f64>) {
        self.scaled(self.largest_at(stretch, &self.all(stretch)))
    }

    /// The same with its peaks among the points, and which mass has the largest of all in words.
    pub(super) fn envelope(&self, stretch: &Stretch) -> (Vec<f64>, Vec<f64>, String) {
        let all = self.all(stretch);
        let highest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut heights: Vec<f64> = all.iter().map(|values| highest(values)).collect();
        let alike = leading(heights.iter().copied())
            .is_none_or(|worst| heights.iter().all(|height| *height >= (1.0 - EQUAL) * heights[worst]));
        // between the points of the curve another one may be higher
        for peak in self.peaks_of(stretch).filter(|peak| !peak.way_back) {
            if let Some(i) = self.shown.iter().position(|(name, _)| *name == peak.mass) {
                heights[i] = heights[i].max(peak.at.1);
            }
        }
        let worst = leading(heights.into_iter()).filter(|_| !alike);
        let points = self.largest_at(stretch, &all);
        let below = |omega: f64| {
            let at = points.partition_point(|point| point.0 < omega).clamp(1, points.len().max(2) - 1);
            let ((x0, y0), (x1, y1)) = (points[at - 1], points[at]);
            y0 + (omega - x0) / (x1 - x0) * (y1 - y0)
        };
        // a peak of one mass below another one is none of the envelope
        let counts = |peak: &PeakOf| !peak.way_back && points.len() > 1 && peak.at.1 > below(peak.at.0);
        let (x, y) = self.scaled(self.with_peaks(stretch, points.clone(), &counts));
        (x, y, worst.map_or_else(|| "all are alike".to_owned(), |worst| format!("worst is {}", self.shown[worst].0)))
    }

    /// Amplitudes of every shown mass.
    fn all(&self, stretch: &Stretch) -> Vec<Vec<f64>> {
        self.shown.iter().map(|(name, _)| self.amplitudes(name, stretch.rows.clone())).collect()
    }

    /// The largest of several amplitudes over the frequency.
    fn largest_at(&self, stretch: &Stretch, all: &[Vec<f64>]) -> Vec<(f64, f64)> {
        let largest = |i: usize| all.iter().map(|values| values[i]).fold(f64::NAN, f64::max);
        let x = numbers(self.curve, DRIVE, stretch.rows.clone());
        x.into_iter().enumerate().map(|(i, x)| (x, largest(i))).collect()
    }

    /// Points as they stand on the axes.
    fn scaled(&self, points: Vec<(f64, f64)>) -> (Vec<f64>, Vec<f64>) {
        points.into_iter().map(|(x, y)| (x * self.factor.0, y * self.factor.1)).unzip()
    }

    /// Where the largest of all amplitudes is, Hz, and amplitude (m) and phase (degrees) of every shown place there: at a peak, which lies between the
    /// points of the curve, or where there is none at a point.
    pub(super) fn at_the_highest(&self, stretch: &Stretch) -> Option<(f64, Shape<'_>)> {
        let peaks = self.shapes.as_ref().and_then(|(table, stretches)| {
            Some((*table, stretches.iter().find(|of| of.case == stretch.case)?.rows.clone()))
        });
        let highest = |(table, rows): (&Table, Range<usize>)| {
            let index = table.index();
            let number = |column: String, row: usize| {
                let column = index.get(&*column_name(&column)).and_then(|column| column.as_numbers());
                column.map_or(f64::NAN, |values| values[row])
            };
            let shape = |row: usize| -> Shape<'_> {
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
        let both = [Some((self.curve, stretch.rows.clone())), peaks].into_iter().flatten().filter_map(highest);
        both.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, frequency, shape)| (frequency, shape))
    }

    fn peaks_of(&self, stretch: &Stretch) -> impl Iterator<Item = &PeakOf> {
        self.peaks.iter().filter(|peak| peak.case == stretch.case)
    }

    fn with_peaks(
        &self,
        stretch: &Stretch,
        mut points: Vec<(f64, f64)>,
        counts: &dyn Fn(&PeakOf) -> bool,
    ) -> Vec<(f64, f64)> {
        points.extend(self.peaks_of(stretch).filter(|peak| counts(peak)).map(|peak| peak.at));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    }

    /// Marks at the peaks of one mass.
    pub(super) fn marks(&self, stretch: &Stretch, name: &str, colour: usize) -> impl Iterator<Item = Series> {
        self.peaks_of(stretch).filter(move |peak| peak.mass == name).map(move |PeakOf { at: (x, y), .. }| {
            Series::marks("peak", vec![x * self.factor.0], vec![y * self.factor.1], colour)
        })
    }

    /// Curves of the linear structures of some cases, each with its colour: of one mass, or the largest over the shown ones. Those that all cases share are grey;
    /// where they differ each has the colour of its case, of many cases the first and the last have theirs.
    pub(super) fn references(&self, names: &[&str], cases: &[(usize, &Stretch)]) -> Vec<Series> {
        let Some((table, known)) = &self.references else { return Vec::new() };
        // a case without rows has those of the case before
        let of = |case: usize| known.iter().rev().find(|own| own.case <= case);
        let mut own: Vec<(usize, &Stretch, &Stretch)> = Vec::new();
        for (colour, stretch) in cases {
            let Some(reference) = of(stretch.case) else { continue };
            if own.iter().all(|(_, _, found)| found.rows != reference.rows) {
                own.push((*colour, stretch, reference));
            }
        }
        let found = own.len();
        if found > SINGLE {
            own = vec![own[0], own[own.len() - 1]];
        }
        let (several, thinned) = (own.len() > 1, own.len() < found);
        let mut lines: Vec<Series> = Vec::new();
        for (colour, stretch, reference) in own {
            for line in self.reference(table, reference, names) {
                // curves of one parameter that does not change them stand once
                if lines.iter().any(|known| (&known.x, &known.y) == (&line.x, &line.y)) {
                    continue;
                }
                if !several {
                    lines.push(line.reference());
                    continue;
                }
                let whose = if thinned { stretch.label() } else { "of each case".to_owned() };
                let (label, value) =
                    (format!("{}, {whose}", line.label), stretch.varied.last().map(|v| v.as_written().0));
                lines.push(Series { label, value, colour, ..line.reference_of_its_own() });
            }
        }
        lines
    }

    /// Crosses where a case has no orbit, in this row from below.
    pub(super) fn missing(&self, stretch: &Stretch, row: usize, colour: usize) -> Option<Series> {
        let x = self.without_orbit(stretch);
        let count = self.failed;
        let label = format!("{count} point{} without an orbit", crate::words::plural(count));
        (!x.is_empty()).then(|| Series::missing(label, x, row, colour))
    }

    /// Frequencies, on the axis, at which a case has no orbit.
    pub(super) fn without_orbit(&self, stretch: &Stretch) -> Vec<f64> {
        let all = self.all(stretch);
        let x = numbers(self.curve, DRIVE, stretch.rows.clone());
        let failed = |i: &usize| !all.is_empty() && all.iter().all(|values| values[*i].is_nan());
        (0..x.len()).filter(failed).map(|i| x[i] * self.factor.0).collect()
    }

    /// The two curves of one case.
    fn reference(&self, table: &Table, stretch: &Stretch, names: &[&str]) -> Vec<Series> {
        let rows = stretch.rows.clone();
        let x: Vec<f64> = numbers(table, DRIVE, rows.clone()).iter().map(|x| x * self.factor.0).collect();
        let line = |(what, style): (&str, Style)| {
            let column = |name: &&str| numbers(table, &amplitude_of(&format!("{name}_{what}")), rows.clone());
            let all: Vec<Vec<f64>> = names.iter().map(column).collect();
            let y = (0..x.len()).map(|i| all.iter().map(|y| y[i]).fold(f64::NAN, f64::max) * self.factor.1);
            let of = if names.len() > 1 { ", largest" } else { "" };
            Series { style, ..Series::line(format!("all joints {what}{of}"), x.clone(), y.collect(), 0) }
        };
        // why one is absent stands in the notes
        let lines = [("free", Style::Dashed), ("stuck", Style::Dotted)].into_iter().map(line);
        lines.filter(|line| line.y.iter().any(|y| y.is_finite())).collect()
    }

    pub(super) fn panel(&self, title: String) -> Panel {
        Panel { title, x: self.axes.0.clone(), y: self.axes.1.clone(), ..Panel::default() }
    }

    pub(super) fn force_panel(&self, title: String) -> Panel {
        Panel { y: self.force_axis.clone(), ..self.panel(title) }
    }

    /// A panel of the share in which a joint, or the mean of several, is in one state.
    pub(super) fn share_panel(&self, (name, joints): &(String, Vec<String>), state: State, more: String) -> Panel {
        let words = state.words();
        let title = if joints.len() == 1 { format!("{name} {words}") } else { format!("{name}, {words}") };
        Panel { y: shares::axis("share of the period"), ..self.panel(join([title, more])) }
    }

    /// The share in which joints are in one state, slip for example.
    pub(super) fn share_line(&self, stretch: &Stretch, joints: &[String], state: State) -> (Vec<f64>, Vec<f64>) {
        let x = numbers(self.curve, DRIVE, stretch.rows.clone()).iter().map(|x| x * self.factor.0).collect();
        (x, shares::mean(self.curve, joints, &stretch.rows, state))
    }

    /// The force of a joint, or the largest of several.
    pub(super) fn force_line(&self, stretch: &Stretch, joints: &[String]) -> (Vec<f64>, Vec<f64>) {
        let of = |column: &str, factor: f64| -> Vec<f64> {
            numbers(self.curve, column, stretch.rows.clone()).iter().map(|value| value * factor).collect()
        };
        let all: Vec<Vec<f64>> = joints.iter().map(|joint| of(&force(joint), self.force_factor)).collect();
        let largest = |i: usize| all.iter().map(|forces| forces[i]).fold(f64::NAN, f64::max);
        (of(DRIVE, self.factor.0), (0..stretch.rows.len()).map(largest).collect())
    }

    /// The joints whose forces are drawn as one line, with its name: each for itself, of many those that are one joint in a sector.
    pub(super) fn pulling(&self) -> Vec<(String, Vec<String>)> {
        if self.joints.len() <= SINGLE {
            return self.joints.iter().map(|joint| (joint.clone(), vec![joint.clone()])).collect();
        }
        let mut groups: Vec<(String, Vec<String>)> = Vec::new();
        for joint in &self.joints {
            let place = of_sector(joint).map_or_else(|| "joint".to_owned(), |(place, _)| place);
            match groups.iter_mut().find(|(name, _)| *name == place) {
                Some((_, group)) => group.push(joint.clone()),
                None => groups.push((place, vec![joint.clone()])),
            }
        }
        let named = |(place, group): (String, Vec<String>)| (format!("{place}, largest of {}", group.len()), group);
        groups.into_iter().map(named).collect()
    }

    /// The colour of a place that is drawn by itself: in all figures the same, as long as there are colours for all places of the model.
    pub(super) fn colour_of(&self, name: &str, place: usize) -> usize {
        if self.system.places().len() <= SINGLE {
            return place;
        }
        self.shown.iter().position(|(shown, _)| shown == name).unwrap_or(place)
    }

    /// The first colours of what is drawn in turn, so that no two names have one: of places in a sector, of joints' forces, of joints' shares.
    pub(super) fn colours(&self) -> [usize; 3] {
        let places = match self.single() {
            true => self.shown.len().max(self.system.places().len().min(SINGLE)),
            false => MANY,
        };
        let in_sector: BTreeSet<String> =
            self.shown.iter().filter_map(|(name, _)| Some(of_sector(name)?.0)).filter(|_| self.ring()).collect();
        let joints = places + in_sector.len().min(wheel::MOST);
        [places, joints, joints + if self.joints.is_empty() { 0 } else { self.pulling().len() }]
    }

    /// Whether the sectors of a disk are drawn side by side.
    pub(super) fn ring(&self) -> bool {
        self.drawing.study.case(0).is_ok_and(|case| case.model.ring.is_some())
    }

    /// Whether the masses are drawn one by one.
    pub(super) fn single(&self) -> bool {
        self.shown.len() <= SINGLE
    }

    pub(super) fn names(&self) -> Vec<&str> {
        self.shown.iter().map(|(name, _)| name.as_str()).collect()
    }
}

/// The column of a joint's force.
pub(super) fn force(joint: &str) -> String {
    format!("{joint}_force_amplitude_N")
}
