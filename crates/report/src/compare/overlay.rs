//! Combines the figures of several runs in one.

use stickslip_study::dataset::{Axis, Figure, Panel, Series, Style};
use stickslip_study::units;

/// Line styles of successive runs: a dashed curve does not hide a curve below it.
const STYLES: [Style; 3] = [Style::Solid, Style::Dashed, Style::Dotted];

/// Combines figures. Panels with the same title and quantities become one.
///
/// If there are several curve names, the title assigns a line style to each run.
pub(super) fn overlay(figures: &[(&str, &Figure)]) -> Figure {
    let names = curve_names(figures);
    let mut panels: Vec<Panel> = Vec::new();
    for (run, (label, figure)) in figures.iter().enumerate() {
        let run = OverlaidRun { index: run, label, names: &names };
        let (places, by_order) = match_panels(&panels, figure);
        for (panel, place) in figure.panels.iter().zip(places) {
            let at = place.unwrap_or_else(|| {
                panels.push(Panel { series: Vec::new(), ..panel.clone() });
                panels.len() - 1
            });
            let target = &mut panels[at];
            if by_order && !target.title.is_empty() {
                target.title = format!("{} | {}", target.title, panel.title);
            }
            run.add(panel, target);
        }
    }
    // Curves with the same name have the same colour, and each run has its line style.
    let title = if names.len() > 1 { style_key(figures) } else { String::new() };
    Figure { title, panels, sharing: figures[0].1.sharing, varied: figures[0].1.varied.clone() }
}

fn is_curve(series: &Series) -> bool {
    !series.style.is_marks() && !series.emphasis.is_reference()
}

/// Returns the labels of all curves without repetition.
fn curve_names<'f>(figures: &[(&str, &'f Figure)]) -> Vec<&'f str> {
    let mut names: Vec<&str> = Vec::new();
    let panels = figures.iter().flat_map(|(_, figure)| &figure.panels);
    for series in panels.flat_map(|panel| &panel.series).filter(|series| is_curve(series)) {
        if !names.contains(&series.label.as_str()) {
            names.push(&series.label);
        }
    }
    names
}

/// Assigns the panels of a figure to known panels.
///
/// If all titles differ but the axes agree, panels are assigned in order, and the flag is
/// `true`: the titles then name what differs between the runs.
fn match_panels(known: &[Panel], figure: &Figure) -> (Vec<Option<usize>>, bool) {
    let key = |panel: &Panel| (panel.title.clone(), panel.x.quantity.clone(), panel.y.quantity.clone());
    let fits =
        |a: &Panel, b: &Panel| a.x.quantity == b.x.quantity && a.y.quantity == b.y.quantity && factors(b, a).is_some();
    let same = |panel: &Panel| known.iter().position(|p| key(p) == key(panel) && fits(p, panel));
    let found: Vec<Option<usize>> = figure.panels.iter().map(same).collect();
    let by_order = found.iter().all(Option::is_none)
        && figure.panels.len() == known.len()
        && figure.panels.iter().zip(known).all(|(panel, p)| fits(p, panel));
    if by_order { ((0..known.len()).map(Some).collect(), true) } else { (found, false) }
}

/// Returns the line styles of the runs as text.
fn style_key(figures: &[(&str, &Figure)]) -> String {
    let words = |style: &Style| match style {
        Style::Dashed => "dashed",
        Style::Dotted => "dotted",
        _ => "solid",
    };
    let styles = figures.iter().zip(STYLES.iter().cycle());
    styles.map(|((label, _), style)| format!("{}: {label}", words(style))).collect::<Vec<_>>().join(", ")
}

/// One of the runs in a combined figure.
struct OverlaidRun<'f> {
    index: usize,
    label: &'f str,
    /// Labels of the curves of all runs.
    names: &'f [&'f str],
}

impl OverlaidRun<'_> {
    /// Adds a panel of this run to the common panel.
    fn add(&self, panel: &Panel, target: &mut Panel) {
        let Some(factors) = factors(panel, target) else { return };
        if target.x.range != panel.x.range || target.y.range != panel.y.range {
            (target.x.range, target.y.range) = (None, None);
        }
        for series in &panel.series {
            let converted = converted(series, factors);
            if series.emphasis.is_reference() {
                self.add_reference(converted, target);
            } else {
                let colour = self.colour(series, panel);
                target.series.push(self.styled(converted, colour));
            }
        }
    }

    /// Adds a reference, unless an equal one is already there.
    fn add_reference(&self, series: Series, target: &mut Panel) {
        if target.series.iter().any(|known| is_same_line(known, &series)) {
            return;
        }
        let again = self.index > 0 && target.series.iter().any(|s| s.label == series.label);
        let label = if again { format!("{}, {}", series.label, self.label) } else { series.label.clone() };
        target.series.push(Series { label, ..series });
    }

    /// Returns the colour of the curve's name.
    ///
    /// A figure with one curve name has one colour per run. Runs beyond the number of line
    /// styles also have other colours. Marks have the colour of their curve.
    fn colour(&self, series: &Series, panel: &Panel) -> usize {
        // Number of colours of the palette.
        let colours = crate::figure::colour::PALETTE.len();
        let owner = if is_curve(series) {
            Some(series)
        } else {
            let same = |s: &&Series| is_curve(s) && s.colour == series.colour && s.value == series.value;
            panel.series.iter().find(same)
        };
        let place = owner.and_then(|owner| self.names.iter().position(|name| *name == owner.label)).unwrap_or(0);
        let shift = if self.names.len().is_multiple_of(colours) { colours / 2 } else { self.names.len() };
        let again = if self.names.len() > 1 { self.index / STYLES.len() } else { self.index };
        place + again * shift
    }

    fn styled(&self, series: Series, colour: usize) -> Series {
        let line = matches!(series.style, Style::Solid | Style::Dashed | Style::Dotted);
        Series {
            label: match (series.style, self.names.len()) {
                (Style::Marks, _) => series.label.clone(),
                (Style::Missing | Style::Warning, _) => format!("{}, {}", series.label, self.label),
                (_, 1) => self.label.to_owned(),
                // Runs beyond the number of line styles have separate legend entries.
                (_, _) if self.index >= STYLES.len() => format!("{}, {}", series.label, self.label),
                (_, _) => series.label.clone(),
            },
            colour,
            style: if line { STYLES[self.index % STYLES.len()] } else { series.style },
            ..series
        }
    }
}

/// Returns `true` if two references look the same.
fn is_same_line(a: &Series, b: &Series) -> bool {
    // Relative difference up to which two references count as one line.
    let near = |(a, b): (&f64, &f64)| a == b || (a - b).abs() <= 1e-6 * a.abs().max(b.abs());
    let all = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(near);
    let look = |s: &Series| (s.emphasis, s.style, s.colour);
    look(a) == look(b) && all(&a.x, &b.x) && all(&a.y, &b.y)
}

/// Factors between the units of two panels.
#[derive(Clone, Copy)]
struct UnitFactors {
    x: f64,
    y: f64,
}

/// Returns the factors between the units of two panels, or `None` for different dimensions.
fn factors(from: &Panel, to: &Panel) -> Option<UnitFactors> {
    let of = |from: &Axis, to: &Axis| units::ratio(&from.unit, &to.unit);
    Some(UnitFactors { x: of(&from.x, &to.x)?, y: of(&from.y, &to.y)? })
}

fn converted(series: &Series, factors: UnitFactors) -> Series {
    let UnitFactors { x, y } = factors;
    let times = |values: &[f64], factor: f64| -> Vec<f64> {
        if factor == 1.0 { values.to_vec() } else { values.iter().map(|value| value * factor).collect() }
    };
    Series { x: times(&series.x, x), y: times(&series.y, y), base: times(&series.base, y), ..series.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(title: &str, unit: &str, y: f64) -> Figure {
        let series = vec![
            Series::line("blade", vec![1.0, 2.0], vec![y, y], 0),
            Series::marks("peak", vec![2.0], vec![y], 0),
            Series::line("all joints free", vec![1.0, 2.0], vec![7.0, 7.0], 0).reference(),
        ];
        let panel = Panel {
            title: title.into(),
            x: Axis::new("frequency", "Hz"),
            y: Axis::new("amplitude", unit),
            series,
            ..Panel::default()
        };
        Figure { panels: vec![panel], ..Figure::default() }
    }

    #[test]
    fn panels_join_in_the_units_of_the_first() {
        let whole = overlay(&[("exact", &figure("", "mm", 2.0)), ("series", &figure("", "µm", 2500.0))]);
        assert_eq!(whole.panels.len(), 1);
        let series = &whole.panels[0].series;
        let lines: Vec<(&str, f64, Style)> = series.iter().map(|s| (s.label.as_str(), s.y[0], s.style)).collect();
        assert_eq!(lines[0], ("exact", 2.0, Style::Solid));
        assert_eq!(lines[3].0, "series");
        assert!((lines[3].1 - 2.5).abs() < 1e-15 && lines[3].2 == Style::Dashed, "{lines:?}");
        // Marks have the colour of their curve, which differs from that of the other run.
        assert_eq!((series[1].colour, series[4].colour), (series[0].colour, series[3].colour));
        assert_ne!(series[0].colour, series[3].colour);
        // Panels with different titles combine in order; other quantities get separate panels.
        assert_eq!(
            overlay(&[("a", &figure("1 N", "mm", 2.0)), ("b", &figure("2 N", "mm", 2.0))]).panels[0].title,
            "1 N | 2 N"
        );
        assert_eq!(overlay(&[("a", &figure("", "mm", 2.0)), ("b", &figure("", "N", 2.0))]).panels.len(), 2);
    }

    /// Each case has one line per reference, unless the references of two runs differ.
    #[test]
    fn references_of_the_cases_stand_once() {
        let cases = |factor: f64| {
            let mut figure = figure("", "mm", 2.0);
            let own = |case: usize| {
                let y = factor * (case as f64 + 1.0);
                let line = Series::line("all joints free, for each case", vec![1.0, 2.0], vec![y, y], case);
                line.case_reference()
            };
            figure.panels[0].series = (0..3).map(own).collect();
            figure
        };
        let labels = |factor: f64| {
            let whole = overlay(&[("exact", &cases(1.0)), ("series", &cases(factor))]);
            whole.panels[0].series.iter().map(|series| series.label.clone()).collect::<Vec<_>>()
        };
        assert_eq!(labels(1.0 + 1e-9), vec!["all joints free, for each case"; 3]);
        assert_eq!(labels(1.5)[3..], vec!["all joints free, for each case, series"; 3]);
    }

    /// Colours show cases, line styles show runs, and the title explains the line styles.
    #[test]
    fn cases_keep_their_colours_in_every_run() {
        let cases = |y: f64| {
            let mut figure = figure("", "mm", y);
            let line = |label: &str, colour: usize| Series::line(label, vec![1.0, 2.0], vec![y, y], colour);
            figure.panels[0].series = vec![line("Ft = 1 N", 0), line("Ft = 2 N", 1)];
            figure.panels[0].series.push(Series::missing("3 points without an orbit", vec![1.5], 1, 1));
            figure
        };
        let whole = overlay(&[("exact", &cases(2.0)), ("series", &cases(3.0))]);
        let drawn: Vec<(&str, usize, Style)> =
            whole.panels[0].series.iter().map(|s| (s.label.as_str(), s.colour, s.style)).collect();
        let expected = [
            ("Ft = 1 N", 0, Style::Solid),
            ("Ft = 2 N", 1, Style::Solid),
            ("3 points without an orbit, exact", 1, Style::Missing),
            ("Ft = 1 N", 0, Style::Dashed),
            ("Ft = 2 N", 1, Style::Dashed),
            ("3 points without an orbit, series", 1, Style::Missing),
        ];
        assert_eq!(drawn, expected);
        assert_eq!(whole.title, "solid: exact, dashed: series");
    }
}
