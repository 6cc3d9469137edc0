//! The figures of several runs in one.

use stickslip_study::dataset::{Axis, Emphasis, Figure, Panel, Series, Style};
use stickslip_study::units;
/// Line styles of the runs, in turn: a curve that hides another lets it through.
const STYLES: [Style; 3] = [Style::Solid, Style::Dashed, Style::Dotted];
/// Colours of the palette.
const COLOURS: usize = crate::colour::PALETTE.len();

/// Figures in one: panels of the same title and quantities become one.
pub(super) fn overlay(figures: &[(&str, &Figure)]) -> Figure {
    let names = curve_names(figures);
    let mut panels: Vec<Panel> = Vec::new();
    for (run, (label, figure)) in figures.iter().enumerate() {
        let run = Run { index: run, label, names: &names };
        let (places, by_order) = places(&panels, figure);
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
    // values of a parameter have a scale of colours instead of names
    if figures.iter().any(|(_, figure)| figure.varied.is_some()) && names.len() > COLOURS {
        let key = style_key(figures);
        for panel in &mut panels {
            let title = [panel.title.as_str(), &key];
            panel.title = title.into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join("; ");
        }
    }
    Figure { panels, sharing: figures[0].1.sharing, varied: figures[0].1.varied.clone(), ..Figure::default() }
}

fn is_curve(series: &Series) -> bool {
    series.style != Style::Marks && series.emphasis != Emphasis::Reference
}

/// The labels of all curves, each once.
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

/// The known panel that each panel of a figure belongs to, if any, and whether they go by their order: titles that all differ
/// name what the runs differ in.
fn places(known: &[Panel], figure: &Figure) -> (Vec<Option<usize>>, bool) {
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

/// The styles of the runs in words.
fn style_key(figures: &[(&str, &Figure)]) -> String {
    let words = |style: &Style| match style {
        Style::Dashed => "dashed",
        Style::Dotted => "dotted",
        _ => "solid",
    };
    let styles = figures.iter().zip(STYLES.iter().cycle());
    styles.map(|((label, _), style)| format!("{}: {label}", words(style))).collect::<Vec<_>>().join(", ")
}

/// One of the runs in a figure of several.
struct Run<'f> {
    index: usize,
    label: &'f str,
    /// The labels of the curves of all runs.
    names: &'f [&'f str],
}

impl Run<'_> {
    /// Draws a panel of this run into the one of all runs.
    fn add(&self, panel: &Panel, target: &mut Panel) {
        let Some(factors) = factors(panel, target) else { return };
        if target.x.range != panel.x.range || target.y.range != panel.y.range {
            (target.x.range, target.y.range) = (None, None);
        }
        for series in &panel.series {
            let converted = converted(series, factors);
            if series.emphasis == Emphasis::Reference {
                self.add_reference(converted, target);
            } else {
                let colour = self.colour(series, panel);
                target.series.push(self.styled(converted, colour));
            }
        }
    }

    /// The linear structure is the same one, or one more.
    fn add_reference(&self, series: Series, target: &mut Panel) {
        if target.series.iter().any(|s| (&s.x, &s.y, s.style) == (&series.x, &series.y, series.style)) {
            return;
        }
        let again = target.series.iter().any(|s| s.label == series.label);
        let label = if again { format!("{}, {}", series.label, self.label) } else { series.label.clone() };
        target.series.push(Series { label, ..series });
    }

    /// That of the curve's name, in the shift of this run; marks have the colour of the curve that they stand on.
    fn colour(&self, series: &Series, panel: &Panel) -> usize {
        let owner = if is_curve(series) {
            Some(series)
        } else {
            let same = |s: &&Series| s.style != Style::Marks && s.colour == series.colour && s.value == series.value;
            panel.series.iter().find(same)
        };
        let place = owner.and_then(|owner| self.names.iter().position(|name| *name == owner.label)).unwrap_or(0);
        let shift = if self.names.len().is_multiple_of(COLOURS) { COLOURS / 2 } else { self.names.len() };
        place + self.index * shift
    }

    fn styled(&self, series: Series, colour: usize) -> Series {
        let line = matches!(series.style, Style::Solid | Style::Dashed | Style::Dotted);
        Series {
            label: match (is_curve(&series), self.names.len()) {
                (false, _) => series.label.clone(),
                (true, 1) => self.label.to_owned(),
                (true, _) => format!("{}, {}", series.label, self.label),
            },
            colour,
            style: if line { STYLES[self.index % STYLES.len()] } else { series.style },
            ..series
        }
    }
}

/// Factors from the units of one panel to those of another; `None` if these measure something else.
fn factors(from: &Panel, to: &Panel) -> Option<(f64, f64)> {
    let of = |from: &Axis, to: &Axis| units::ratio(&from.unit, &to.unit);
    Some((of(&from.x, &to.x)?, of(&from.y, &to.y)?))
}

fn converted(series: &Series, (x, y): (f64, f64)) -> Series {
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
        // marks have the colour of their curve, which is not that of the other run
        assert_eq!((series[1].colour, series[4].colour), (series[0].colour, series[3].colour));
        assert_ne!(series[0].colour, series[3].colour);
        // titles that name what differs: by order; other quantities: panels of their own
        assert_eq!(
            overlay(&[("a", &figure("1 N", "mm", 2.0)), ("b", &figure("2 N", "mm", 2.0))]).panels[0].title,
            "1 N | 2 N"
        );
        assert_eq!(overlay(&[("a", &figure("", "mm", 2.0)), ("b", &figure("", "N", 2.0))]).panels.len(), 2);
    }
}
