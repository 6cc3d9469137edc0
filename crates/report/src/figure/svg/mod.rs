//! Writes the figure as SVG: panels in a grid below one legend, with text as text elements.
//!
//! The crate writes SVG itself instead of using a plotting library, for these reasons:
//! - The bytes must not depend on earlier drawings of the process; kuva 0.6 numbers its clip
//!   paths per process.
//! - Ranges below 2e-16 must not collapse.
//! - A `$` in a title must stay.
//! - The legend must have rows and must not cover curves.
//!
//! Every text is measured in the embedded font before it is placed.

mod document;
mod layout;
mod style;

pub(crate) use document::escape;

use crate::figure::clip::{self, Point};
use crate::figure::colour::Colour;
use crate::figure::font::Weight;
use crate::figure::panels::{self, AREA, ColourScheme, PALE};
use crate::output::result_file::{File, Output, ReportError};
use document::{Pen, Svg, Text};
use layout::{Bar, Layout, PlacedEntry, PlotArea, SAMPLE};
use stickslip_study::dataset::{Dataset, Emphasis, Figure, Panel, Series, Style};
use style::{
    AXIS, COLOUR_BAR_WIDTH, FINE_GRID, GRID, LABEL, LEADING, LINE, MARGIN, MARK, MINOR_LENGTH, PANEL_TITLE, TICK,
    TICK_LENGTH, TITLE,
};

/// The output `svg`.
pub const OUTPUT: Output =
    Output { name: "svg", summary: "figure.svg, for papers and slides", make: files, sink: None, is_default: true };

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    Ok(vec![File::new("figure.svg", to_svg(&dataset.figure))])
}

/// Returns the figure as a complete SVG document. Equal figures give equal bytes.
pub fn to_svg(figure: &Figure) -> String {
    let layout = Layout::new(figure);
    let mut svg = Svg::new(layout.width, layout.height, &figure.title);
    for (i, line) in layout.title.iter().enumerate() {
        let y = MARGIN + TITLE * (0.8 + LEADING * i as f64);
        svg.text(line, Text { size: TITLE, weight: Weight::Bold, ..Text::at(layout.width / 2.0, y) });
    }
    for placed in &layout.legend {
        draw_entry(&mut svg, placed);
    }
    for (panel, plot) in figure.panels.iter().zip(&layout.panels) {
        draw_panel(&mut svg, panel, plot, &layout.scheme);
    }
    if let Some(bar) = &layout.bar {
        draw_bar(&mut svg, bar);
    }
    svg.finish()
}

/// Returns the dash pattern of a line style, if it has one.
fn dashes(style: Style) -> Option<&'static str> {
    match style {
        Style::Dashed => Some("7 4"),
        Style::Dotted => Some("2 3"),
        _ => None,
    }
}

fn draw_entry(svg: &mut Svg, PlacedEntry { entry, lines, x, y }: &PlacedEntry) {
    let colour = &entry.colour.light;
    let opacity = if entry.pale { PALE } else { 1.0 };
    match entry.area {
        Some(Style::Warning) => svg.triangle((x + SAMPLE.0 / 2.0, *y), colour),
        Some(Style::Missing) => svg.cross((x + SAMPLE.0 / 2.0, *y), colour),
        Some(Style::Band) => svg.area(&box_around(*x, y - 5.0, SAMPLE.0, 10.0), colour, AREA),
        Some(_) => svg.area(&box_around(x + 8.0, y - 6.0, 14.0, 12.0), colour, opacity),
        None => {}
    }
    if let Some(style) = entry.line {
        let pen = Pen { colour, width: LINE, dashes: dashes(style), opacity };
        svg.polyline(&[(*x, *y), (x + SAMPLE.0, *y)], &pen);
    }
    if entry.marks {
        svg.mark((x + SAMPLE.0 / 2.0, *y), colour, MARK);
    }
    for (i, line) in lines.iter().enumerate() {
        let at = Text::at(x + SAMPLE.0 + SAMPLE.1, y + (0.36 + LEADING * i as f64) * LABEL);
        svg.text(line, Text { anchor: "start", ..at });
    }
}

fn box_around(x: f64, y: f64, width: f64, height: f64) -> [Point; 4] {
    [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
}

fn draw_bar(svg: &mut Svg, bar: &Bar) {
    svg.open("colours");
    // Each step extends to the upper end and the next covers it, which avoids seams.
    let steps = 96; // they look continuous
    for i in 0..steps {
        let part = |i: i32| f64::from(i) / f64::from(steps);
        let colour = Colour::sequential((f64::from(i) + 0.5) / f64::from(steps)).light;
        svg.area(&box_around(bar.left, bar.top, COLOUR_BAR_WIDTH, bar.height * (1.0 - part(i))), &colour, 1.0);
    }
    svg.frame(bar.left, bar.top, COLOUR_BAR_WIDTH, bar.height);
    let at = |value: f64| bar.top + bar.height * (1.0 - bar.range.fraction(value));
    for minor in &bar.ticks.minor {
        svg.line(
            (bar.left + COLOUR_BAR_WIDTH, at(*minor)),
            (bar.left + COLOUR_BAR_WIDTH + MINOR_LENGTH, at(*minor)),
            AXIS,
        );
    }
    for (value, label) in bar.ticks.positions.iter().zip(&bar.ticks.labels) {
        let y = at(*value);
        svg.line((bar.left + COLOUR_BAR_WIDTH, y), (bar.left + COLOUR_BAR_WIDTH + TICK_LENGTH, y), AXIS);
        let position = Text::at(bar.left + COLOUR_BAR_WIDTH + TICK_LENGTH + 5.0, y + 0.36 * TICK);
        svg.text(label, Text { size: TICK, anchor: "start", ..position });
    }
    for (i, line) in bar.title.iter().enumerate() {
        let x = bar.left + bar.title_offset + LABEL * (0.8 + LEADING * i as f64);
        svg.text(line, Text { upright: true, ..Text::at(x, bar.top + bar.height / 2.0) });
    }
    svg.close();
}

fn draw_panel(svg: &mut Svg, panel: &Panel, plot: &PlotArea, scheme: &ColourScheme) {
    let (right, bottom, middle) = (plot.left + plot.width, plot.top + plot.height, plot.left + plot.width / 2.0);
    svg.open(&panel.title);
    for (i, line) in plot.title.iter().enumerate() {
        let y = plot.top - 8.0 - PANEL_TITLE * LEADING * (plot.title.len() - 1 - i) as f64;
        svg.text(line, Text { size: PANEL_TITLE, weight: Weight::Bold, ..Text::at(middle, y) });
    }
    let x_of = |x: &f64| plot.map((*x, plot.y.from)).0;
    let y_of = |y: &f64| plot.map((plot.x.from, *y)).1;
    for (values, colour) in [(&plot.x_ticks.minor, FINE_GRID), (&plot.x_ticks.positions, GRID)] {
        for x in values.iter().map(x_of) {
            svg.line((x, plot.top), (x, bottom), colour);
        }
    }
    for (values, colour) in [(&plot.y_ticks.minor, FINE_GRID), (&plot.y_ticks.positions, GRID)] {
        for y in values.iter().map(y_of) {
            svg.line((plot.left, y), (right, y), colour);
        }
    }
    // The zero lines of a loop.
    let zeros = if panel.equal_axes { 0 } else { 2 };
    for (inside, from, to) in [
        (plot.x.from < 0.0 && plot.x.to > 0.0, plot.map((0.0, plot.y.from)), plot.map((0.0, plot.y.to))),
        (plot.y.from < 0.0 && plot.y.to > 0.0, plot.map((plot.x.from, 0.0)), plot.map((plot.x.to, 0.0))),
    ]
    .into_iter()
    .take(zeros)
    {
        if inside {
            svg.line(from, to, "#b0b0b0");
        }
    }
    if !panel.equal_axes {
        svg.frame(plot.left, plot.top, plot.width, plot.height);
    }
    for x in plot.x_ticks.minor.iter().map(x_of) {
        svg.line((x, bottom), (x, bottom + MINOR_LENGTH), AXIS);
    }
    for (x, label) in plot.x_ticks.positions.iter().map(x_of).zip(&plot.x_ticks.labels) {
        svg.line((x, bottom), (x, bottom + TICK_LENGTH), AXIS);
        svg.text(label, Text { size: TICK, ..Text::at(x, bottom + TICK_LENGTH + 3.0 + TICK * 0.95) });
    }
    for y in plot.y_ticks.minor.iter().map(y_of) {
        svg.line((plot.left - MINOR_LENGTH, y), (plot.left, y), AXIS);
    }
    for (y, label) in plot.y_ticks.positions.iter().map(y_of).zip(&plot.y_ticks.labels) {
        svg.line((plot.left - TICK_LENGTH, y), (plot.left, y), AXIS);
        let at = Text::at(plot.left - TICK_LENGTH - 5.0, y + 0.36 * TICK);
        svg.text(label, Text { size: TICK, anchor: "end", ..at });
    }
    for (i, line) in plot.x_title.iter().enumerate() {
        let y = bottom + TICK_LENGTH + 3.0 + TICK * LEADING + 5.0 + LABEL * (0.9 + LEADING * i as f64);
        svg.text(line, Text::at(middle, y));
    }
    for (i, line) in plot.y_title.iter().enumerate() {
        let x = plot.left - plot.y_title_offset - LABEL * (0.25 + LEADING * (plot.y_title.len() - 1 - i) as f64);
        svg.text(line, Text { upright: true, ..Text::at(x, plot.top + plot.height / 2.0) });
    }
    if !panels::has_data(panel) {
        svg.text("no data", Text { colour: "#777777", ..Text::at(middle, plot.top + plot.height / 2.0) });
    }
    let crowd = panels::crowded(panel);
    let bars: Vec<&Series> = panel.series.iter().filter(|s| s.style == Style::Bars).collect();
    for series in panels::drawing_order(panel) {
        let colour = &scheme.colour(series).light;
        match series.style {
            Style::Marks | Style::Warning => {
                let size = if crowd { 2.0 } else { MARK };
                let at = panels::drawn(panel, series).map(|p| plot.map(p));
                for point in at.filter(|p| plot.clip_rect().contains(*p)) {
                    match series.style {
                        Style::Warning => svg.triangle(point, colour),
                        _ => svg.mark(point, colour, size),
                    }
                }
            }
            Style::Missing => {
                let y = plot.top + plot.height * (1.0 - panels::row_of_crosses(series));
                for point in series.x.iter().map(|x| (x_of(x), y)).filter(|p| plot.clip_rect().contains(*p)) {
                    svg.cross(point, colour);
                }
            }
            Style::Stripe => draw_stripe(svg, series, plot, scheme),
            Style::Band => draw_band(svg, panel, series, plot, colour),
            Style::Bars => {
                let slot = panels::bar_slot(panel, plot.x);
                let which = bars.iter().position(|s| std::ptr::eq(*s, series)).unwrap_or(0);
                let slot =
                    Slot { width: slot / bars.len() as f64, shift: slot * (which as f64 / bars.len() as f64 - 0.5) };
                draw_bars(svg, panel, series, plot, &slot, colour);
            }
            Style::Solid | Style::Dashed | Style::Dotted => {
                let pale = series.emphasis == Emphasis::Pale;
                let thin = pale || crowd || matches!(series.emphasis, Emphasis::OwnReference | Emphasis::Contour);
                let width = if thin { 1.0 } else { LINE };
                let opacity = if pale { PALE } else { 1.0 };
                let pen = Pen { colour, width, dashes: dashes(panels::line_style(series)), opacity };
                draw_line(svg, panel, series, plot, &pen);
            }
        }
    }
    svg.close();
}

/// Draws the pieces of a curve between its gaps. A single point becomes a dot.
fn draw_line(svg: &mut Svg, panel: &Panel, series: &Series, plot: &PlotArea, pen: &Pen<'_>) {
    let points: Vec<Point> = panels::points(panel, series).collect();
    for piece in points.split(|p| !panels::drawable(p.0, p.1)) {
        let piece: Vec<Point> = piece.iter().map(|p| plot.map(*p)).collect();
        match piece.as_slice() {
            [] => {}
            [point] if plot.clip_rect().contains(*point) => svg.dot(*point, pen.colour),
            [_] => {}
            line => {
                for part in plot.clip_rect().line(line) {
                    svg.polyline(&clip::simplified(part), pen);
                }
            }
        }
    }
}

/// Draws the pieces of a band between its gaps as areas.
fn draw_band(svg: &mut Svg, panel: &Panel, series: &Series, plot: &PlotArea, colour: &str) {
    let floor = plot.top + plot.height;
    let points: Vec<(Point, f64)> = panels::points(panel, series)
        .enumerate()
        .map(|(i, p)| {
            let upper = plot.map(p);
            (upper, panels::base(panel, series, i).map_or(floor, |base| plot.map((p.0, base)).1))
        })
        .collect();
    for piece in points.split(|((x, y), _)| !(x.is_finite() && y.is_finite())) {
        let upper = clip::simplified(piece.iter().map(|(p, _)| *p).collect());
        let lower = clip::simplified(piece.iter().map(|((x, _), base)| (*x, *base)).collect());
        let outline: Vec<Point> = upper.into_iter().chain(lower.into_iter().rev()).collect();
        svg.area(&plot.clip_rect().polygon(&outline), colour, AREA);
    }
}

/// Draws the cells of a stripe, as high as the distance between stripes.
fn draw_stripe(svg: &mut Svg, series: &Series, plot: &PlotArea, scheme: &ColourScheme) {
    let Some([low, high]) = panels::stripe_edges(series) else { return };
    for cell in panels::cells(series, plot.x, scheme) {
        let ((left, top), (right, bottom)) = (plot.map((cell.from, high)), plot.map((cell.to, low)));
        let corners = box_around(left, top, right - left, bottom - top);
        svg.tile(&plot.clip_rect().polygon(&corners), &cell.colour.light);
    }
}

/// Width of a bar, and offset of its left edge from the abscissa, in axis measure.
struct Slot {
    width: f64,
    shift: f64,
}

fn draw_bars(svg: &mut Svg, panel: &Panel, series: &Series, plot: &PlotArea, slot: &Slot, colour: &str) {
    let opacity = if series.emphasis == Emphasis::Pale { PALE } else { 1.0 };
    let scale = plot.width / plot.x.span();
    for (i, point) in panels::points(panel, series).enumerate().filter(|(_, p)| panels::drawable(p.0, p.1)) {
        let (x, y) = plot.map(point);
        let base = panels::base(panel, series, i).map_or(plot.top + plot.height, |base| plot.map((point.0, base)).1);
        let corners = box_around(x + slot.shift * scale, y, slot.width * scale, base - y);
        svg.area(&plot.clip_rect().polygon(&corners), colour, opacity);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::font;
    use crate::samples;

    #[test]
    fn the_document_is_well_formed_and_says_every_label() {
        for dataset in samples::all() {
            let svg = to_svg(&dataset.figure);
            let document = roxmltree::Document::parse(&svg).unwrap();
            let texts: Vec<&str> =
                document.descendants().filter(|n| n.has_tag_name("text")).filter_map(|n| n.text()).collect();
            let all = texts.join(" ");
            assert!(all.starts_with(&figure_title(&dataset.figure)), "{all}");
            for panel in &dataset.figure.panels {
                assert!(
                    all.contains(&panel.title) && all.contains(&panel.x.quantity) && all.contains(&panel.y.quantity)
                );
            }
            for entry in panels::legend(&dataset.figure).0 {
                let titles = dataset.figure.panels.iter().filter(|p| p.title == entry.label).count();
                assert_eq!(texts.iter().filter(|t| **t == entry.label).count(), 1 + titles, "{}", entry.label);
            }
            assert!(!svg.contains("NaN") && !svg.contains("inf\""));
        }
    }

    fn figure_title(figure: &Figure) -> String {
        figure.title.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Returns the texts of the figure without tags.
    fn texts(figure: &Figure) -> Vec<String> {
        let svg = to_svg(figure);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let texts = document.descendants().filter(|n| n.has_tag_name("text"));
        texts.map(|n| n.text().unwrap_or("").to_owned()).collect()
    }

    #[test]
    fn many_values_have_a_colour_bar_with_unit_and_round_ticks() {
        let all = texts(&samples::cases(400).figure);
        assert!(all.contains(&"Ft (N)".to_owned()), "{all:?}");
        for tick in ["50", "100", "200", "400"] {
            assert!(all.contains(&tick.to_owned()), "{tick}");
        }
        assert!(!all.iter().any(|t| t.starts_with("Ft =")));
        let few = texts(&samples::cases(5).figure);
        assert!(!few.contains(&"Ft (N)".to_owned()) && few.contains(&"Ft = 3 N".to_owned()), "{few:?}");
        // The figure has 400 curves of 300 points. The file stays small because invisible
        // points are removed.
        let size = to_svg(&samples::cases(400).figure).len();
        assert!(size < 1_500_000, "{size}");
    }

    #[test]
    fn a_logarithmic_axis_has_powers_of_ten_and_short_ticks_between() {
        let figure = samples::modes().figure;
        let all = texts(&figure);
        for tick in ["0.01", "0.1", "1", "10", "10⁻¹⁰"] {
            assert!(all.contains(&tick.to_owned()), "{tick}: {all:?}");
        }
        // Three panels over four decades have 37 lines each, less nine at labels.
        let fine = to_svg(&figure).matches(FINE_GRID).count();
        assert!(fine >= 3 * 28, "{fine}");
    }

    #[test]
    fn a_fixed_range_cuts_the_curves_at_its_edges() {
        let mut figure = samples::envelope().figure;
        figure.panels.truncate(1);
        let layout = Layout::new(&figure);
        let area = layout.panels[0].clip_rect();
        let svg = to_svg(&figure);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let mut points = 0;
        for path in document.descendants().filter(|n| n.attribute("stroke-linejoin").is_some()) {
            let numbers: Vec<f64> =
                path.attribute("d").unwrap().split(['M', 'L', ' ']).filter_map(|t| t.parse().ok()).collect();
            for p in numbers.chunks(2).map(|c| (c[0], c[1])).filter(|p| p.1 > area.top - 5.0) {
                assert!(area.contains(p), "{p:?} {area:?}");
                points += 1;
            }
        }
        assert!(points > 500, "{points}");
    }

    #[test]
    fn references_are_grey_dashes_behind_the_results() {
        let svg = to_svg(&samples::cases(3).figure);
        let grey = Colour::reference().light;
        let last_reference = svg.rfind(&format!("stroke=\"{grey}\"")).unwrap();
        let panel = svg.find("<g aria-label").unwrap();
        let first_result = panel + svg[panel..].find("stroke=\"#0072b2\"").unwrap();
        assert!(last_reference > panel && last_reference < first_result);
        for line in svg.lines().filter(|l| l.contains(&grey) && l.contains("linejoin")) {
            assert!(line.contains("stroke-dasharray"), "{line}");
        }
    }

    #[test]
    fn bars_stand_side_by_side_on_zero() {
        let svg = to_svg(&samples::spectrum().figure);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let mut boxes: Vec<[f64; 4]> = Vec::new();
        for path in document.descendants().filter(|n| n.has_tag_name("path") && n.attribute("fill-opacity").is_none()) {
            if !path.attribute("d").unwrap().ends_with('Z')
                || path.parent().is_some_and(|p| p.is_root() || !p.has_tag_name("g"))
            {
                continue; // These are legend samples.
            }
            let n: Vec<f64> =
                path.attribute("d").unwrap().split(['M', 'L', 'Z', ' ']).filter_map(|t| t.parse().ok()).collect();
            let (x, y): (Vec<f64>, Vec<f64>) = n.chunks(2).map(|c| (c[0], c[1])).unzip();
            let ends =
                |v: &[f64]| (v.iter().copied().fold(f64::INFINITY, f64::min), v.iter().copied().fold(0.0, f64::max));
            let ((left, right), (top, bottom)) = (ends(&x), ends(&y));
            boxes.push([left, right, top, bottom]);
        }
        assert_eq!(boxes.len(), 3 * 9);
        let foot = boxes[0][3];
        boxes.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert!(boxes.windows(2).all(|w| w[0][1] <= w[1][0] + 0.02), "bars overlap");
        assert!(boxes.iter().all(|b| (b[3] - foot).abs() < 0.02 && b[2] < foot), "bars start at zero");
    }

    #[test]
    fn axes_have_units_and_lines_their_dashes() {
        let svg = to_svg(&samples::response().figure);
        assert!(svg.contains(">frequency (Hz)<") && svg.contains(">amplitude (cm)<"));
        assert_eq!(svg.matches("stroke-dasharray=\"7 4\"").count(), 4 + 1); // Panels and legend.
        let svg = to_svg(&samples::hysteresis().figure);
        assert_eq!(svg.matches("stroke-dasharray=\"2 3\"").count(), 2 + 1);
    }

    #[test]
    fn a_gap_interrupts_the_curve() {
        let svg = to_svg(&Figure { panels: samples::hostile().figure.panels[..1].to_vec(), ..Figure::default() });
        // The curve has three pieces: before the gap, after it, and after the two single
        // failures. The point between the failures is a dot. The legend adds one line.
        assert_eq!(svg.matches("fill=\"none\" stroke=\"#0072b2\"").count(), 3 + 1);
        assert_eq!(svg.matches("r=\"2\"").count(), 1);
    }

    #[test]
    fn nothing_leaves_the_figure_and_no_texts_overlap() {
        for dataset in samples::all() {
            let svg = to_svg(&dataset.figure);
            let document = roxmltree::Document::parse(&svg).unwrap();
            let number = |n: &roxmltree::Node, a: &str| n.attribute(a).unwrap().parse::<f64>().unwrap();
            let root = document.root_element();
            let (width, height) = (number(&root, "width"), number(&root, "height"));
            let mut boxes: Vec<([f64; 4], String)> = Vec::new();
            for node in root.descendants().filter(|n| n.has_tag_name("text")) {
                let text = node.text().unwrap_or("").to_owned();
                let (x, y, size) = (number(&node, "x"), number(&node, "y"), number(&node, "font-size"));
                let weight = if node.has_attribute("font-weight") { Weight::Bold } else { Weight::Regular };
                let long = font::width(&text, size, weight);
                let start = match node.attribute("text-anchor") {
                    Some("start") => 0.0,
                    Some("end") => -long,
                    _ => -long / 2.0,
                };
                let edges = if node.has_attribute("transform") {
                    [x - 0.75 * size, y + start, x + 0.2 * size, y + start + long]
                } else {
                    [x + start, y - 0.75 * size, x + start + long, y + 0.2 * size]
                };
                assert!(
                    edges[0] >= 0.0 && edges[1] >= 0.0 && edges[2] <= width && edges[3] <= height,
                    "{text} {edges:?}"
                );
                for (other, name) in &boxes {
                    let apart =
                        edges[0] >= other[2] || edges[2] <= other[0] || edges[1] >= other[3] || edges[3] <= other[1];
                    assert!(apart, "`{text}` covers `{name}`");
                }
                boxes.push((edges, text));
            }
        }
    }

    #[test]
    fn an_empty_figure_is_still_a_figure() {
        let svg = to_svg(&Figure::default());
        assert!(roxmltree::Document::parse(&svg).is_ok());
    }
}
