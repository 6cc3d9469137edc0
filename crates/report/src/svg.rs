//! The figure as SVG: panels in a grid, one legend above them, text as text.
//!
//! Written here and not through a plotting library because the bytes must not depend on what else the process has
//! drawn (kuva 0.6 counts its clip paths per process), ranges below 2e-16 must not collapse, `$` in a title must stay,
//! and the legend must stand in rows beside no curve. Every text is measured in the embedded font before it is placed.

use crate::font::{self, Weight};
use crate::frame::{self, Entry, Range, Ticks};
use crate::output::{File, Output, ReportError};
use std::fmt::Write;
use stickslip_study::dataset::{Dataset, Figure, Panel, Series, Style};

/// The output `svg`.
pub const OUTPUT: Output = Output { name: "svg", summary: "figure.svg, for papers and slides", make: files };

/// Sizes of text, px. A figure of two columns printed 170 mm wide shows the ticks at 6 to 7 pt.
const TITLE: f64 = 18.0;
const PANEL_TITLE: f64 = 15.0;
const LABEL: f64 = 15.0;
const TICK: f64 = 13.5;
/// Height of a line of text, part of its size.
const LEADING: f64 = 1.3;
/// Outer margin of the figure and space between panels, px.
const MARGIN: f64 = 16.0;
const GAP: f64 = 26.0;
const TICK_LENGTH: f64 = 5.0;
const LINE: f64 = 1.8;
const MARK: f64 = 3.8;
const TEXT: &str = "#1a1a1a";
const AXIS: &str = "#444444";
const GRID: &str = "#e3e3e3";
/// A polyline with more points than this is thinned to what the eye can see.
const DENSE: usize = 4000;

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    Ok(vec![File::new("figure.svg", to_svg(&dataset.figure))])
}

/// The figure as a complete SVG document; the same figure gives the same bytes.
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
    for (panel, place) in figure.panels.iter().zip(&layout.panels) {
        draw_panel(&mut svg, panel, place);
    }
    svg.finish()
}

/// The dashes of a line style, if it has any.
fn dashes(style: Style) -> Option<&'static str> {
    match style {
        Style::Solid | Style::Marks | Style::Band | Style::Bars => None,
        Style::Dashed => Some("7 4"),
        Style::Dotted => Some("2 3"),
    }
}

/// Where everything stands.
struct Layout {
    width: f64,
    height: f64,
    title: Vec<String>,
    legend: Vec<Placed>,
    panels: Vec<Place>,
}

/// A legend entry and the left end of its middle line.
struct Placed {
    entry: Entry,
    x: f64,
    y: f64,
}

/// The plot area of a panel with its axes and texts.
struct Place {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    x: Range,
    y: Range,
    x_ticks: Ticks,
    y_ticks: Ticks,
    title: Vec<String>,
    x_title: Vec<String>,
    y_title: Vec<String>,
    /// Distance from the axis to the near edge of the y title.
    y_title_offset: f64,
}

impl Layout {
    fn new(figure: &Figure) -> Layout {
        let (columns, rows) = frame::grid(figure.panels.len());
        let (plot_width, plot_height) = match columns {
            1 => (620.0, 380.0),
            2 => (430.0, if rows == 1 { 330.0 } else { 270.0 }),
            _ => (350.0, 240.0),
        };
        let mut panels: Vec<Place> = figure
            .panels
            .iter()
            .zip(frame::ranges(figure))
            .map(|(panel, (x, y))| Place::new(panel, x, y, plot_width, plot_height))
            .collect();
        // where neighbours have the same axis, its title stands once, at the outside
        for i in 0..panels.len() {
            if i + columns < panels.len() && panels[i].x_title == panels[i + columns].x_title {
                panels[i].x_title.clear();
            }
        }
        for i in (0..panels.len()).rev() {
            if i % columns > 0 && panels[i].y_title == panels[i - 1].y_title {
                panels[i].y_title.clear();
            }
        }

        let mut right = MARGIN;
        for column in 0..columns {
            let members: Vec<usize> = (column..panels.len()).step_by(columns).collect();
            let left = members.iter().map(|&i| panels[i].left_side()).fold(0.0, f64::max);
            for &i in &members {
                panels[i].left = right + left;
            }
            let overhang = members.iter().map(|&i| panels[i].overhang()).fold(0.0, f64::max);
            right += left + plot_width + if column + 1 < columns { overhang.max(GAP) } else { overhang };
        }
        let width = right + MARGIN;

        let title = font::wrap(&figure.title, TITLE, Weight::Bold, width - 2.0 * MARGIN);
        let mut y = MARGIN + TITLE * LEADING * title.len() as f64;
        let (legend, bottom) = place_legend(frame::legend(figure), width, y);
        y = bottom + 4.0;
        for row in 0..rows {
            let members = (row * columns)..((row + 1) * columns).min(panels.len());
            let lines = panels[members.clone()].iter().map(|p| p.title.len()).max().unwrap_or(0);
            let top = y + 8.0 + PANEL_TITLE * LEADING * lines as f64;
            let below = panels[members.clone()].iter().map(Place::bottom_side).fold(0.0, f64::max);
            for place in &mut panels[members] {
                place.top = top;
            }
            y = top + plot_height + below + if row + 1 < rows { 10.0 } else { 0.0 };
        }
        Layout { width, height: y + MARGIN, title, legend, panels }
    }
}

impl Place {
    fn new(panel: &Panel, x: Range, y: Range, width: f64, height: f64) -> Place {
        let y_ticks = frame::ticks(y, height / 46.0);
        let widest =
            |ticks: &Ticks| ticks.labels.iter().map(|l| font::width(l, TICK, Weight::Regular)).fold(0.0, f64::max);
        // as many ticks as their labels leave room for
        let fits = |ticks: &Ticks| (widest(ticks) + 16.0) * ticks.labels.len() as f64 <= width;
        let x_ticks =
            (3..=8).rev().map(|n| frame::ticks(x, f64::from(n))).find(fits).unwrap_or_else(|| frame::ticks(x, 2.0));
        let y_title_offset = TICK_LENGTH + 5.0 + widest(&y_ticks) + 9.0;
        Place {
            left: 0.0,
            top: 0.0,
            width,
            height,
            title: font::wrap(&panel.title, PANEL_TITLE, Weight::Bold, width),
            x_title: font::wrap(&frame::axis_title(&panel.x, x_ticks.power), LABEL, Weight::Regular, width),
            y_title: font::wrap(&frame::axis_title(&panel.y, y_ticks.power), LABEL, Weight::Regular, height),
            x,
            y,
            x_ticks,
            y_ticks,
            y_title_offset,
        }
    }

    /// Space that the y axis needs left of the plot area.
    fn left_side(&self) -> f64 {
        self.y_title_offset + LABEL * LEADING * self.y_title.len() as f64
    }

    /// Space that the x axis needs below the plot area.
    fn bottom_side(&self) -> f64 {
        let title = if self.x_title.is_empty() { 0.0 } else { 5.0 + LABEL * LEADING * self.x_title.len() as f64 };
        TICK_LENGTH + 3.0 + TICK * LEADING + title
    }

    /// How far the last x label reaches beyond the plot area.
    fn overhang(&self) -> f64 {
        let (Some(at), Some(label)) = (self.x_ticks.at.last(), self.x_ticks.labels.last()) else { return 0.0 };
        (self.map((*at, self.y.from)).0 - self.left + 0.5 * font::width(label, TICK, Weight::Regular) - self.width)
            .max(0.0)
    }

    /// The place of a point.
    fn map(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let part = |v: f64, r: Range| ((v - r.from) / r.span()).clamp(0.0, 1.0);
        (self.left + self.width * part(x, self.x), self.top + self.height * (1.0 - part(y, self.y)))
    }
}

/// Length of the line before a label, space after it and between entries, px.
const SAMPLE: (f64, f64, f64) = (30.0, 7.0, 24.0);

/// Entries in centred rows below `top`; returns them and the lower edge.
fn place_legend(entries: Vec<Entry>, width: f64, top: f64) -> (Vec<Placed>, f64) {
    let limit = width - 2.0 * MARGIN;
    let length = |entry: &Entry| SAMPLE.0 + SAMPLE.1 + font::width(&entry.label, LABEL, Weight::Regular);
    let mut rows: Vec<(f64, Vec<Entry>)> = Vec::new();
    for entry in entries {
        let more = length(&entry);
        match rows.last_mut() {
            Some((used, row)) if *used + SAMPLE.2 + more <= limit => {
                *used += SAMPLE.2 + more;
                row.push(entry);
            }
            _ => rows.push((more, vec![entry])),
        }
    }
    let mut placed = Vec::new();
    let mut y = top;
    for (used, row) in rows {
        let mut x = ((width - used) / 2.0).max(MARGIN);
        y += LABEL * 1.5;
        for entry in row {
            let step = length(&entry) + SAMPLE.2;
            placed.push(Placed { entry, x, y: y - 0.5 * LABEL });
            x += step;
        }
    }
    (placed, y)
}

fn draw_entry(svg: &mut Svg, Placed { entry, x, y }: &Placed) {
    if let Some(style) = entry.line {
        svg.polyline(&[(*x, *y), (x + SAMPLE.0, *y)], entry.colour, dashes(style));
    }
    if entry.marks {
        svg.mark((x + SAMPLE.0 / 2.0, *y), entry.colour);
    }
    let at = Text::at(x + SAMPLE.0 + SAMPLE.1, y + 0.36 * LABEL);
    svg.text(&entry.label, Text { anchor: "start", ..at });
}

fn draw_panel(svg: &mut Svg, panel: &Panel, place: &Place) {
    let (right, bottom, middle) = (place.left + place.width, place.top + place.height, place.left + place.width / 2.0);
    svg.open(&panel.title);
    for (i, line) in place.title.iter().enumerate() {
        let y = place.top - 8.0 - PANEL_TITLE * LEADING * (place.title.len() - 1 - i) as f64;
        svg.text(line, Text { size: PANEL_TITLE, weight: Weight::Bold, ..Text::at(middle, y) });
    }
    let x_at: Vec<f64> = place.x_ticks.at.iter().map(|x| place.map((*x, place.y.from)).0).collect();
    let y_at: Vec<f64> = place.y_ticks.at.iter().map(|y| place.map((place.x.from, *y)).1).collect();
    for x in &x_at {
        svg.line((*x, place.top), (*x, bottom), GRID);
    }
    for y in &y_at {
        svg.line((place.left, *y), (right, *y), GRID);
    }
    // the axes through zero of a loop
    for (inside, from, to) in [
        (place.x.from < 0.0 && place.x.to > 0.0, place.map((0.0, place.y.from)), place.map((0.0, place.y.to))),
        (place.y.from < 0.0 && place.y.to > 0.0, place.map((place.x.from, 0.0)), place.map((place.x.to, 0.0))),
    ] {
        if inside {
            svg.line(from, to, "#b0b0b0");
        }
    }
    svg.frame(place);
    for (x, label) in x_at.iter().zip(&place.x_ticks.labels) {
        svg.line((*x, bottom), (*x, bottom + TICK_LENGTH), AXIS);
        svg.text(label, Text { size: TICK, ..Text::at(*x, bottom + TICK_LENGTH + 3.0 + TICK * 0.95) });
    }
    for (y, label) in y_at.iter().zip(&place.y_ticks.labels) {
        svg.line((place.left - TICK_LENGTH, *y), (place.left, *y), AXIS);
        let at = Text::at(place.left - TICK_LENGTH - 5.0, y + 0.36 * TICK);
        svg.text(label, Text { size: TICK, anchor: "end", ..at });
    }
    for (i, line) in place.x_title.iter().enumerate() {
        let y = bottom + TICK_LENGTH + 3.0 + TICK * LEADING + 5.0 + LABEL * (0.9 + LEADING * i as f64);
        svg.text(line, Text::at(middle, y));
    }
    for (i, line) in place.y_title.iter().enumerate() {
        let x = place.left - place.y_title_offset - LABEL * (0.25 + LEADING * (place.y_title.len() - 1 - i) as f64);
        svg.text(line, Text { upright: true, ..Text::at(x, place.top + place.height / 2.0) });
    }
    if !frame::has_data(panel) {
        svg.text("no data", Text { colour: "#777777", ..Text::at(middle, place.top + place.height / 2.0) });
    }
    // marks stand above all lines
    for series in panel.series.iter().filter(|s| s.style != Style::Marks) {
        draw_line(svg, series, place);
    }
    for series in panel.series.iter().filter(|s| s.style == Style::Marks) {
        for point in frame::points(series).filter(|p| frame::drawable(*p)) {
            svg.mark(place.map(point), frame::colour(series.colour));
        }
    }
    svg.close();
}

/// The pieces between the gaps of a curve; a piece of one point is a dot.
fn draw_line(svg: &mut Svg, series: &Series, place: &Place) {
    let points: Vec<(f64, f64)> = frame::points(series).collect();
    let colour = frame::colour(series.colour);
    for piece in points.split(|p| !frame::drawable(*p)) {
        match piece {
            [] => {}
            [point] => svg.dot(place.map(*point), colour),
            _ => svg.polyline(&thin(piece.iter().map(|p| place.map(*p)).collect()), colour, dashes(series.style)),
        }
    }
}

/// Keeps of a dense line, in every quarter of a pixel, the first and last and the extreme points.
fn thin(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.len() <= DENSE {
        return points;
    }
    let column = |p: &(f64, f64)| (p.0 * 4.0).floor();
    let mut kept = Vec::new();
    for run in points.chunk_by(|a, b| column(a) == column(b)) {
        let by =
            |sign: f64| (0..run.len()).max_by(|i, j| (sign * run[*i].1).total_cmp(&(sign * run[*j].1))).unwrap_or(0);
        let mut indices = [0, by(1.0), by(-1.0), run.len() - 1];
        indices.sort_unstable();
        kept.extend(indices.iter().enumerate().filter(|(i, k)| *i == 0 || indices[i - 1] != **k).map(|(_, k)| run[*k]));
    }
    kept
}

/// A line of text: where and how.
struct Text {
    x: f64,
    y: f64,
    size: f64,
    weight: Weight,
    anchor: &'static str,
    colour: &'static str,
    /// Reads from below.
    upright: bool,
}

impl Text {
    /// Centred on x, its baseline at y.
    fn at(x: f64, y: f64) -> Text {
        Text { x, y, size: LABEL, weight: Weight::Regular, anchor: "middle", colour: TEXT, upright: false }
    }
}

/// The document as it grows. Writing into a string cannot fail, so the results of `write!` are dropped.
struct Svg(String);

impl Svg {
    fn new(width: f64, height: f64, title: &str) -> Svg {
        let mut text = String::new();
        let _ = write!(
            text,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
             font-family=\"{family}\">\n<title>{title}</title>\n<rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n",
            w = width.ceil(),
            h = height.ceil(),
            family = font::FAMILY,
            title = escape(title),
        );
        Svg(text)
    }

    fn finish(mut self) -> String {
        self.0.push_str("</svg>\n");
        self.0
    }

    fn open(&mut self, label: &str) {
        let _ = writeln!(self.0, "<g aria-label=\"{}\">", escape(label));
    }

    fn close(&mut self) {
        self.0.push_str("</g>\n");
    }

    fn line(&mut self, from: (f64, f64), to: (f64, f64), colour: &str) {
        let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(short);
        let _ = writeln!(self.0, "<path d=\"M{x1} {y1}L{x2} {y2}\" stroke=\"{colour}\"/>");
    }

    fn frame(&mut self, place: &Place) {
        let [x, y, w, h] = [place.left, place.top, place.width, place.height].map(short);
        let _ = writeln!(
            self.0,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"none\" stroke=\"{AXIS}\"/>"
        );
    }

    fn polyline(&mut self, points: &[(f64, f64)], colour: &str, dashes: Option<&str>) {
        let dashes = dashes.map_or(String::new(), |d| format!(" stroke-dasharray=\"{d}\""));
        self.0.push_str("<path d=\"");
        let mut last = None;
        for (i, point) in points.iter().enumerate() {
            let now = (short(point.0), short(point.1));
            if last.as_ref() == Some(&now) && i + 1 < points.len() {
                continue; // not visible
            }
            let _ = write!(self.0, "{}{} {}", if i == 0 { 'M' } else { 'L' }, now.0, now.1);
            last = Some(now);
        }
        let _ = writeln!(
            self.0,
            "\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{LINE}\" stroke-linejoin=\"round\"{dashes}/>"
        );
    }

    fn mark(&mut self, (x, y): (f64, f64), colour: &str) {
        let (x, y) = (short(x), short(y));
        let _ = writeln!(
            self.0,
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{MARK}\" fill=\"#ffffff\" stroke=\"{colour}\" stroke-width=\"1.6\"/>"
        );
    }

    fn dot(&mut self, (x, y): (f64, f64), colour: &str) {
        let _ = writeln!(self.0, "<circle cx=\"{}\" cy=\"{}\" r=\"2\" fill=\"{colour}\"/>", short(x), short(y));
    }

    fn text(&mut self, content: &str, text: Text) {
        let [x, y] = [text.x, text.y].map(short);
        let weight = if text.weight == Weight::Bold { " font-weight=\"bold\"" } else { "" };
        let turn = if text.upright { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
        let _ = writeln!(
            self.0,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{}\" fill=\"{}\"{weight}{turn}>{}</text>",
            text.size,
            text.anchor,
            text.colour,
            escape(content)
        );
    }
}

/// A length to a hundredth of a pixel.
fn short(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Text that XML and HTML take literally; signs that XML 1.0 forbids are left out.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' | '\r' => out.push(' '),
            c if c.is_control() || c == '\u{fffe}' || c == '\u{ffff}' => {}
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
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
            for entry in frame::legend(&dataset.figure) {
                let titles = dataset.figure.panels.iter().filter(|p| p.title == entry.label).count();
                assert_eq!(texts.iter().filter(|t| **t == entry.label).count(), 1 + titles, "{}", entry.label);
            }
            assert!(!svg.contains("NaN") && !svg.contains("inf\""));
        }
    }

    fn figure_title(figure: &Figure) -> String {
        figure.title.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn axes_have_units_and_lines_their_dashes() {
        let svg = to_svg(&samples::response().figure);
        assert!(svg.contains(">frequency (Hz)<") && svg.contains(">amplitude (cm)<"));
        assert_eq!(svg.matches("stroke-dasharray=\"7 4\"").count(), 4 + 1); // panels and legend
        let svg = to_svg(&samples::hysteresis().figure);
        assert_eq!(svg.matches("stroke-dasharray=\"2 3\"").count(), 2 + 1);
    }

    #[test]
    fn a_gap_interrupts_the_curve() {
        let svg = to_svg(&Figure { panels: samples::hostile().figure.panels[..1].to_vec(), ..Figure::default() });
        // before the gap, after it, after the two single failures; the point between these is a dot; and the legend
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
    fn a_dense_line_is_thinned_without_losing_its_extremes() {
        let points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i) * 0.005, f64::from(i % 97))).collect();
        let kept = thin(points.clone());
        assert!(kept.len() < 10_000 && kept.first() == points.first() && kept.last() == points.last());
        assert!(kept.iter().any(|p| p.1 == 96.0) && kept.iter().any(|p| p.1 == 0.0));
    }

    #[test]
    fn an_empty_figure_is_still_a_figure() {
        let svg = to_svg(&Figure::default());
        assert!(roxmltree::Document::parse(&svg).is_ok());
    }
}
