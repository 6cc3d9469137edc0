//! Parts shared by the static and the interactive figure.
//!
//! These are the grid of panels, the axis ranges, the drawing order, the legend and the
//! colours.

use crate::figure::axis::{AxisRange, MARGIN};
use crate::figure::colour::{Colour, PALETTE};
use stickslip_study::dataset::{Axis, Emphasis, Figure, Panel, Scale, Series, Sharing, Style};

/// Returns the number of columns and rows of the grid of panels.
///
/// One panel fills the grid. Up to four panels have two columns, more have three. Panels that
/// alternate between two or three quantities, case by case, have one column per quantity.
pub(crate) fn grid(figure: &Figure) -> (usize, usize) {
    let panels = &figure.panels;
    let in_turn = |period: usize| {
        let same = |i: usize, j: usize| panels[i].y.quantity == panels[j].y.quantity;
        panels.len() > period
            && panels.len().is_multiple_of(period)
            && (period..panels.len()).all(|i| same(i, i - period))
            && (1..period).all(|i| !same(i, 0))
    };
    let columns = match panels.len() {
        0 | 1 => 1,
        2..=4 => 2,
        _ if in_turn(2) => 2,
        _ => 3,
    };
    (columns, panels.len().div_ceil(columns).max(1))
}

/// Returns the points of a series, up to the length of the shorter list.
///
/// A point that the axes cannot show is NaN.
pub(crate) fn points<'a>(panel: &Panel, series: &'a Series) -> impl Iterator<Item = (f64, f64)> + 'a {
    let (x_scale, y_scale) = (panel.x.scale, panel.y.scale);
    let nothing = (f64::NAN, f64::NAN);
    let shown = move |(x, y): &(f64, f64)| AxisRange::accepts(x_scale, *x) && AxisRange::accepts(y_scale, *y);
    series.x.iter().copied().zip(series.y.iter().copied()).map(move |p| if shown(&p) { p } else { nothing })
}

/// Returns `true` if a point can be drawn.
pub(crate) fn drawable(x: f64, y: f64) -> bool {
    x.is_finite() && y.is_finite()
}

/// Returns the points that can be drawn.
pub(crate) fn drawn<'a>(panel: &Panel, series: &'a Series) -> impl Iterator<Item = (f64, f64)> + 'a {
    points(panel, series).filter(|p| drawable(p.0, p.1))
}

/// Returns the lower edge of a band or the foot of a bar at a point.
///
/// `None` means the lower end of a logarithmic axis.
pub(crate) fn base(panel: &Panel, series: &Series, index: usize) -> Option<f64> {
    let base = series.base.get(index).copied().unwrap_or(0.0);
    AxisRange::accepts(panel.y.scale, base).then_some(base)
}

/// Returns `true` if the panel has at least one point to draw.
pub(crate) fn has_data(panel: &Panel) -> bool {
    panel.series.iter().any(|series| drawn(panel, series).next().is_some())
}

/// Returns the series of a panel in drawing order, background first.
pub(crate) fn drawing_order(panel: &Panel) -> Vec<&Series> {
    let mut series: Vec<&Series> = panel.series.iter().collect();
    series.sort_by_key(|s| match (s.style, s.emphasis) {
        (style, _) if style.is_marks() => 5,
        (_, Emphasis::Reference | Emphasis::OwnReference) => 0,
        (Style::Band | Style::Stripe, _) => 1,
        (Style::Bars, _) => 2,
        (_, Emphasis::Pale) => 3,
        _ => 4,
    });
    series
}

/// Returns the line style to draw. A solid reference becomes dashed. Solid lines whose colours
/// repeat are dashed in the second round of the palette and dotted in the third, unless colours
/// follow values.
pub(crate) fn line_style(series: &Series) -> Style {
    let round = if series.value.is_some() { 0 } else { series.colour / PALETTE.len() };
    match (series.emphasis, series.style, round) {
        (Emphasis::Reference, Style::Solid, _) | (_, Style::Solid, 1) => Style::Dashed,
        (_, Style::Solid, 2) => Style::Dotted,
        (_, style, _) => style,
    }
}

/// Colours of a figure: from the palette, or by value if the series have many values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ColourScheme {
    /// Quantity and range of the colour scale, if colours follow values.
    pub bar: Option<(Axis, AxisRange)>,
}

impl ColourScheme {
    pub(crate) fn of(figure: &Figure) -> ColourScheme {
        ColourScheme { bar: ColourScheme::bar(figure) }
    }

    fn bar(figure: &Figure) -> Option<(Axis, AxisRange)> {
        let axis = figure.varied.as_ref()?;
        let mut values: Vec<f64> = figure
            .panels
            .iter()
            .flat_map(|panel| panel.series.iter().filter(|s| drawn(panel, s).next().is_some()))
            .filter_map(|series| series.value.filter(|v| v.is_finite()))
            .collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let stripes = figure.panels.iter().flat_map(|panel| &panel.series).flat_map(|series| &series.shades);
        let shaded: Vec<f64> = stripes.copied().filter(|v| v.is_finite()).collect();
        let positive = values.first().is_some_and(|v| *v > 0.0);
        // A smallest value that is not positive makes the colour scale linear.
        let axis = Axis { scale: if positive { axis.scale } else { Scale::Linear }, ..axis.clone() };
        let all = values.iter().chain(&shaded).copied();
        let range = AxisRange::fixed(&axis).or_else(|| AxisRange::around(all, axis.scale))?.widened(0.0);
        // Up to this number of values, the palette and the legend distinguish the series.
        (values.len() > 7 || !shaded.is_empty()).then_some((axis, range))
    }

    /// Returns the value of a series as text if its colour shows it: `kt = 8 N/mm`.
    pub(crate) fn value(&self, series: &Series) -> Option<String> {
        let ((axis, _), value) = (self.bar.as_ref()?, series.value?);
        let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
        let unit = if axis.unit.is_empty() { String::new() } else { format!(" {}", axis.unit) };
        Some(format!("{} = {rounded}{unit}", axis.quantity))
    }

    /// Returns the colour of a series.
    pub(crate) fn colour(&self, series: &Series) -> Colour {
        match (&self.bar, series.value) {
            _ if series.emphasis == Emphasis::Reference => Colour::reference(),
            _ if series.emphasis == Emphasis::Contour => Colour::background(),
            (Some((_, range)), Some(value)) if value.is_finite() => Colour::sequential(range.fraction(value)),
            _ => Colour::palette(series.colour),
        }
    }
}

/// Returns the lower and the upper edge of a stripe.
pub(crate) fn stripe_edges(series: &Series) -> Option<[f64; 2]> {
    let y = *series.y.first()?;
    Some(series.base.first().map_or([y - 0.5, y + 0.5], |low| [*low, y]))
}

/// Cell of a stripe.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StripeCell {
    pub from: f64,
    pub to: f64,
    pub colour: Colour,
}

/// Returns the cells of a stripe.
///
/// Each point occupies the interval up to half the distance to the adjacent points. Adjacent
/// points with the same colour share a cell.
pub(crate) fn cells(series: &Series, x: AxisRange, scheme: &ColourScheme) -> Vec<StripeCell> {
    // Number of colour steps; with this number the scale looks continuous.
    let colour_steps = 100.0;
    let Some((_, range)) = &scheme.bar else { return Vec::new() };
    let count = series.x.len().min(series.shades.len());
    let edges = edges(&series.x[..count], x);
    let mut cells: Vec<StripeCell> = Vec::new();
    for (i, value) in series.shades[..count].iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let step = (range.fraction(*value).clamp(0.0, 1.0) * colour_steps).round() / colour_steps;
        let colour = Colour::sequential(step);
        match cells.last_mut() {
            Some(cell) if cell.colour == colour && cell.to == edges[i] => cell.to = edges[i + 1],
            _ => cells.push(StripeCell { from: edges[i], to: edges[i + 1], colour }),
        }
    }
    cells
}

/// Returns the borders of the cells of ascending points.
///
/// The first and last borders are at the first and last points. On a logarithmic axis the other
/// borders are geometric means. A single point occupies the whole axis.
pub(crate) fn edges(points: &[f64], x: AxisRange) -> Vec<f64> {
    match points {
        [] => Vec::new(),
        [_] => vec![x.from, x.to],
        [first, .., last] => {
            let between = points.windows(2).map(|pair| match x.scale {
                Scale::Linear => 0.5 * (pair[0] + pair[1]),
                Scale::Log => (pair[0] * pair[1]).sqrt(),
            });
            std::iter::once(*first).chain(between).chain([*last]).collect()
        }
    }
}

/// Legend entry: the common appearance of all series with one label.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LegendEntry {
    pub label: String,
    pub colour: Colour,
    /// Line style, if a series with this label is a line.
    pub line: Option<Style>,
    /// `true` if a series with this label has marks.
    pub marks: bool,
    /// Style of the band, the bars or the crosses, if a series with this label has them.
    pub area: Option<Style>,
    /// `true` if all series with this label are pale.
    pub pale: bool,
    /// `true` if the label belongs to a reference.
    pub reference: bool,
}

/// Maximum number of legend entries. The legend states only the number of further labels.
const MAX_LEGEND_ENTRIES: usize = 24;

/// Returns the legend of a figure and the number of labels that it omits.
///
/// - Each label has one entry, in order of appearance. Labels with marks or crosses only come after
///   the others, and references come last.
/// - A series without a label or without points has no entry.
/// - A series whose colour shows its value has no entry, unless its label stands for several
///   values and is not the panel's title.
pub(crate) fn legend(figure: &Figure) -> (Vec<LegendEntry>, usize) {
    let scheme = ColourScheme::of(figure);
    let mut entries: Vec<(LegendEntry, Option<f64>, bool)> = Vec::new();
    let all = figure.panels.iter().flat_map(|panel| panel.series.iter().map(move |series| (panel, series)));
    for (panel, series) in all {
        if series.label.trim().is_empty() || drawn(panel, series).next().is_none() {
            continue;
        }
        let colour = scheme.colour(series);
        // References, missing points and points to doubt apply to all colours, so they always
        // have a legend entry.
        let nameless = !series.emphasis.is_reference() && !matches!(series.style, Style::Missing | Style::Warning);
        let value = series.value.filter(|_| scheme.bar.is_some() && nameless);
        let (line, marks, area) = match line_style(series) {
            Style::Marks => (None, true, None),
            style @ (Style::Missing | Style::Warning | Style::Band | Style::Bars) => (None, false, Some(style)),
            style => (Some(style), false, None),
        };
        let pale = series.emphasis == Emphasis::Pale;
        match entries.iter_mut().find(|(entry, _, _)| entry.label == series.label) {
            Some((entry, known, named)) => {
                if entry.colour != colour {
                    entry.colour = Colour::several();
                }
                *named |= value.is_none() || *known != value && panel.title != series.label;
                entry.line = entry.line.or(line);
                entry.area = entry.area.or(area);
                entry.marks |= marks;
                entry.pale &= pale;
            }
            None => {
                let label = series.label.clone();
                let reference = series.emphasis.is_reference();
                entries.push((
                    LegendEntry { label, colour, line, marks, area, pale, reference },
                    value,
                    value.is_none(),
                ));
            }
        }
    }
    let mut entries: Vec<LegendEntry> =
        entries.into_iter().filter(|(_, _, named)| *named).map(|(entry, ..)| entry).collect();
    entries.sort_by_key(|entry| match entry.area {
        _ if entry.reference => 2,
        Some(Style::Missing | Style::Warning) => 1,
        area => u8::from(entry.line.is_none() && area.is_none()),
    });
    let more = entries.len().saturating_sub(MAX_LEGEND_ENTRIES);
    entries.truncate(MAX_LEGEND_ENTRIES);
    (entries, more)
}

/// Returns `true` if the number of results requires thin lines and small marks.
pub(crate) fn crowded(panel: &Panel) -> bool {
    let is_result = |s: &&Series| s.emphasis == Emphasis::Normal && !matches!(s.style, Style::Missing | Style::Warning);
    let results = panel.series.iter().filter(is_result);
    // A panel with more results than this is crowded.
    results.count() > 40
}

/// Opacity of pale curves and of areas.
pub(crate) const PALE: f64 = 0.4;
pub(crate) const AREA: f64 = 0.25;

/// Axis ranges of a panel, and flags for a range that differs from other panels of the same
/// quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Axes {
    pub x: AxisRange,
    pub y: AxisRange,
    pub x_differs: bool,
    pub y_differs: bool,
}

/// Returns the axes of every panel.
pub(crate) fn axes(figure: &Figure) -> Vec<Axes> {
    let raw: Vec<Option<(AxisRange, AxisRange)>> = figure.panels.iter().map(extent).collect();
    let x = shared(figure, &raw, |panel| &panel.x, |pair| pair.0);
    let y = shared(figure, &raw, |panel| &panel.y, |pair| pair.1);
    let ranges: Vec<(AxisRange, AxisRange)> = figure
        .panels
        .iter()
        .zip(x.into_iter().zip(y))
        .map(|(panel, (x, y))| {
            // A curve over a parameter fills its axis completely; a loop gets a margin.
            let curve = panel.series.iter().all(|series| is_curve(panel, series));
            let floor = y.scale == Scale::Linear && y.from >= 0.0 && y.from <= 0.4 * y.to && y.to > 0.0;
            let wide = y.widened(MARGIN);
            let y = if floor { AxisRange { from: 0.0, ..wide } } else { wide };
            let x = x.widened(if curve { 0.0 } else { MARGIN });
            (AxisRange::fixed(&panel.x).unwrap_or(x), AxisRange::fixed(&panel.y).unwrap_or(y))
        })
        .collect();
    let differs = |i: usize, axis: fn(&Panel) -> &Axis, range: fn(&(AxisRange, AxisRange)) -> AxisRange| {
        let panels = &figure.panels;
        raw[i].is_some()
            && (0..panels.len()).any(|j| {
                raw[j].is_some()
                    && same_quantity(axis(&panels[i]), axis(&panels[j]))
                    && range(&ranges[i]) != range(&ranges[j])
            })
    };
    (0..ranges.len())
        .map(|i| Axes {
            x: ranges[i].0,
            y: ranges[i].1,
            x_differs: differs(i, |p| &p.x, |r| r.0),
            y_differs: differs(i, |p| &p.y, |r| r.1),
        })
        .collect()
}

/// Returns `true` if two axes show the same quantity with the same unit and scale.
pub(crate) fn same_quantity(a: &Axis, b: &Axis) -> bool {
    (&a.quantity, &a.unit, a.scale) == (&b.quantity, &b.unit, b.scale)
}

/// Returns the ranges of the data of a panel.
fn extent(panel: &Panel) -> Option<(AxisRange, AxisRange)> {
    let fixed = AxisRange::fixed(&panel.x);
    let inside = |p: &(f64, f64)| fixed.is_none_or(|range| range.contains(p.0));
    let values = |reference: bool| {
        let shown = panel.series.iter().filter(|series| series.style != Style::Missing);
        shown.filter(move |s| s.emphasis.is_reference() == reference).flat_map(move |series| {
            let tiles = series.style == Style::Stripe && !series.base.is_empty();
            let area = tiles || matches!(series.style, Style::Band | Style::Bars);
            points(panel, series)
                .enumerate()
                .filter(|(_, p)| drawable(p.0, p.1))
                .filter(move |(_, p)| inside(p))
                .flat_map(move |(i, (_, y))| [Some(y), base(panel, series, i).filter(|_| area)].into_iter().flatten())
        })
    };
    let mut x = AxisRange::around(panel.series.iter().flat_map(|s| drawn(panel, s).map(|p| p.0)), panel.x.scale)?;
    if x.scale == Scale::Linear && panel.series.iter().any(|s| s.style == Style::Bars) {
        // The distance from an outer bar to the frame equals that between two bars.
        let half = 0.5 * bar_slot(panel, x) / BAR_WIDTH_FRACTION;
        x = AxisRange { from: x.from - half, to: x.to + half, ..x };
    }
    let results = AxisRange::around(values(false), panel.y.scale);
    let references = AxisRange::around(values(true), panel.y.scale);
    let y = match (results, references) {
        (Some(results), Some(references)) if results.scale == Scale::Linear => {
            // References extend the vertical range to at most this multiple of the results. A
            // resonance without friction would otherwise flatten the curves of interest.
            let reach = 2.0 * results.from.abs().max(results.to.abs());
            let cut = |v: f64| if reach > 0.0 { v.clamp(-reach, reach) } else { v };
            results.union(AxisRange { from: cut(references.from), to: cut(references.to), ..references })
        }
        (Some(results), Some(references)) => results.union(references),
        // All data lie outside the fixed range.
        (results, references) => results.or(references).unwrap_or(AxisRange::unit(panel.y.scale)),
    };
    Some((x, y))
}

/// Widens one of two ranges so that a unit has the same length on both axes.
///
/// `aspect` is the width of the plot divided by its height.
pub(crate) fn equal_scale(x: AxisRange, y: AxisRange, aspect: f64) -> (AxisRange, AxisRange) {
    let around = |range: AxisRange, span: f64| {
        let middle = 0.5 * (range.from + range.to);
        AxisRange { from: middle - 0.5 * span, to: middle + 0.5 * span, ..range }
    };
    let high = y.span().max(x.span() / aspect);
    (around(x, high * aspect), around(y, high))
}

/// Width of the bars relative to the smallest distance between two of them.
const BAR_WIDTH_FRACTION: f64 = 0.8;

/// Returns the width of all bars at one abscissa, in axis measure (logarithmic if the axis is).
pub(crate) fn bar_slot(panel: &Panel, x: AxisRange) -> f64 {
    let bars = panel.series.iter().filter(|s| s.style == Style::Bars);
    let mut at: Vec<f64> = bars.flat_map(|s| drawn(panel, s).map(|p| x.to_linear(p.0))).collect();
    at.sort_by(f64::total_cmp);
    let gap = at.windows(2).map(|w| w[1] - w[0]).filter(|gap| *gap > 1e-9).fold(f64::INFINITY, f64::min);
    BAR_WIDTH_FRACTION
        * match x.scale {
            _ if gap.is_finite() => gap,
            Scale::Linear => 1.0,
            Scale::Log => 0.3,
        }
}

/// Returns the vertical position of a row of crosses, relative to the panel height.
pub(crate) fn row_of_crosses(series: &Series) -> f64 {
    // Distance between rows of crosses, and from the first row to the lower edge, relative to
    // the panel height.
    0.03 * series.y.first().copied().unwrap_or(1.0)
}

/// Returns `true` if x never decreases. Marks are always accepted.
fn is_curve(panel: &Panel, series: &Series) -> bool {
    if series.style.is_marks() {
        return true;
    }
    let mut last = f64::NEG_INFINITY;
    drawn(panel, series).all(|(x, _)| std::mem::replace(&mut last, x) <= x)
}

/// Returns one range per panel.
///
/// Panels with the same quantity and unit share a range according to `Figure::sharing`, so that
/// a reader can compare them.
fn shared(
    figure: &Figure,
    raw: &[Option<(AxisRange, AxisRange)>],
    axis: fn(&Panel) -> &Axis,
    pick: fn(&(AxisRange, AxisRange)) -> AxisRange,
) -> Vec<AxisRange> {
    (0..raw.len())
        .map(|i| {
            let own = axis(&figure.panels[i]);
            let members: Vec<AxisRange> = (0..raw.len())
                .filter(|&j| same_quantity(axis(&figure.panels[j]), own))
                .filter_map(|j| raw[j].as_ref().map(pick))
                .collect();
            let Some(union) = members.iter().copied().reduce(AxisRange::union) else {
                return AxisRange::unit(own.scale);
            };
            // Panels of one quantity share their range if each of them uses at least this part
            // of it.
            let legible = || members.iter().all(|r| r.span() >= 0.2 * union.span());
            match (&raw[i], figure.sharing) {
                (None, _) | (_, Sharing::Always) => union,
                (Some(_), Sharing::WhereLegible) if legible() => union,
                (Some(pair), _) => pick(pair),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn lines_beyond_the_palette_are_dashed_and_dotted() {
        let style = |colour: usize| line_style(&Series::line("a", vec![0.0, 1.0], vec![0.0, 1.0], colour));
        assert_eq!(
            [0, 6, 7, 13, 14].map(style),
            [Style::Solid, Style::Solid, Style::Dashed, Style::Dashed, Style::Dotted]
        );
        let by_value = Series { value: Some(1.0), ..Series::line("a", vec![0.0], vec![0.0], 9) };
        assert_eq!(line_style(&by_value), Style::Solid);
    }

    #[test]
    fn quantities_shown_in_turn_have_a_column_each() {
        let figure = |quantities: &[&str], cases: usize| {
            let panel = |quantity: &&str| Panel { y: Axis::new(*quantity, "m"), ..Panel::default() };
            Figure { panels: quantities.repeat(cases).iter().map(panel).collect(), ..Figure::default() }
        };
        assert_eq!(
            [1, 2, 3, 4, 5, 8].map(|n| grid(&figure(&["a"], n))),
            [(1, 1), (2, 1), (2, 2), (2, 2), (3, 2), (3, 3)]
        );
        assert_eq!(grid(&figure(&["displacement", "force"], 4)), (2, 4));
        assert_eq!(grid(&figure(&["displacement", "velocity", "force"], 3)), (3, 3));
        assert_eq!(grid(&Figure::default()), (1, 1));
    }

    #[test]
    fn a_label_stands_once_in_the_legend() {
        let (entries, more) = legend(&samples::response().figure);
        assert_eq!(entries.iter().map(|e| e.label.as_str()).collect::<Vec<_>>(), ["a₁", "a₂", "a₃", "peak"]);
        let peak = LegendEntry {
            label: "peak".into(),
            colour: Colour::several(),
            line: None,
            marks: true,
            area: None,
            pale: false,
            reference: false,
        };
        assert_eq!((&entries[3], more), (&peak, 0));
    }

    #[test]
    fn many_values_are_told_by_colours_and_few_by_names() {
        let figure = samples::cases(400).figure;
        let (entries, more) = legend(&figure);
        // The label of many values keeps its entry.
        assert_eq!(
            (entries.iter().map(|e| e.label.as_str()).collect::<Vec<_>>(), more),
            (vec!["peak", "free", "stuck"], 0)
        );
        let (axis, range) = ColourScheme::of(&figure).bar.unwrap();
        assert_eq!((axis.quantity.as_str(), range.from, range.to), ("Ft", 1.0, 400.0));
        let scheme = ColourScheme::of(&figure);
        let colours: Vec<Colour> =
            figure.panels[0].series.iter().filter(|s| s.label.starts_with("Ft")).map(|s| scheme.colour(s)).collect();
        assert_eq!((colours.first(), colours.last()), (Some(&Colour::sequential(0.0)), Some(&Colour::sequential(1.0))));
        let few = samples::cases(7).figure;
        let masses = samples::masses().figure;
        assert_eq!(legend(&masses), (vec![], 0)); // The panels have the masses as titles.
        let mut untitled = masses.clone();
        untitled.panels.iter_mut().for_each(|panel| panel.title.clear());
        let names: Vec<String> = legend(&untitled).0.into_iter().map(|e| e.label).collect();
        assert_eq!(names, ["blade", "contact", "shroud"]);
        assert_eq!(ColourScheme::of(&masses).bar.unwrap().1.fraction(64.0), 6.0 / 11.0);
        assert_eq!((legend(&few).0.len(), ColourScheme::of(&few).bar), (7 + 3, None));
        // Without values: the first labels, and the number of further labels.
        let unnamed = Figure { varied: None, ..figure };
        let (entries, more) = legend(&unnamed);
        assert_eq!((entries.len(), more), (MAX_LEGEND_ENTRIES, 400 + 3 - MAX_LEGEND_ENTRIES));
    }

    #[test]
    fn every_range_is_finite_and_holds_its_data() {
        for dataset in samples::all() {
            for (axes, panel) in axes(&dataset.figure).iter().zip(&dataset.figure.panels) {
                let (x, y) = (axes.x, axes.y);
                assert!(
                    x.span() > 0.0 && y.span() > 0.0 && x.span().is_finite() && y.span().is_finite(),
                    "{}",
                    panel.title
                );
                let results = panel.series.iter().filter(|s| !s.emphasis.is_reference() && s.style != Style::Missing);
                for point in results.flat_map(|s| drawn(panel, s)) {
                    let free = panel.x.range.is_none() && panel.y.range.is_none();
                    assert!(!free || x.contains(point.0) && y.contains(point.1), "{}: {point:?}", panel.title);
                }
            }
        }
    }

    #[test]
    fn panels_that_are_compared_share_their_axes_or_say_that_they_do_not() {
        let panel = |height: f64| Panel {
            x: Axis::new("frequency", "Hz"),
            y: Axis::new("amplitude", "mm"),
            series: vec![Series::line("a", vec![1.0, 2.0], vec![0.0, height], 0)],
            ..Panel::default()
        };
        let figure =
            |sharing, heights: [f64; 2]| Figure { sharing, panels: heights.map(panel).to_vec(), ..Figure::default() };
        let tops = |figure: &Figure| {
            axes(figure).iter().map(|a| ((a.y.to * 1e9).round() / 1e9, a.y_differs)).collect::<Vec<_>>()
        };
        assert_eq!(tops(&figure(Sharing::WhereLegible, [2.0, 4.0])), [(4.2, false); 2]);
        assert_eq!(tops(&figure(Sharing::WhereLegible, [0.2, 4.0])), [(0.21, true), (4.2, true)]);
        assert_eq!(tops(&figure(Sharing::Always, [0.2, 4.0])), [(4.2, false); 2]);
        assert_eq!(tops(&figure(Sharing::Never, [2.0, 4.0])), [(2.1, true), (4.2, true)]);
        // A fixed range of one panel does not apply to the other panel.
        let mut fixed = figure(Sharing::Always, [2.0, 4.0]);
        fixed.panels[0].y = fixed.panels[0].y.clone().with_range(0.0, 1.0);
        assert_eq!(tops(&fixed), [(1.0, true), (4.2, true)]);
    }

    #[test]
    fn a_reference_does_not_flatten_the_results() {
        let figure = |top: f64| Figure {
            panels: vec![Panel {
                series: vec![
                    Series::line("a", vec![0.0, 1.0], vec![0.0, 1.0], 0),
                    Series::line("free", vec![0.0, 1.0], vec![0.0, top], 1).reference(),
                ],
                ..Panel::default()
            }],
            ..Figure::default()
        };
        assert!((axes(&figure(50.0))[0].y.to - 2.1).abs() < 1e-12);
        assert!((axes(&figure(1.5))[0].y.to - 1.575).abs() < 1e-12);
    }
}
