//! Incremental writer of an SVG document: lines, areas, marks and text.

use super::style::{AXIS, LABEL, MARK, TEXT};
use crate::figure::clip::Point;
use crate::figure::font::{self, Weight};
use std::fmt::Write;

/// Style of a line.
pub(super) struct Pen<'a> {
    pub(super) colour: &'a str,
    pub(super) width: f64,
    pub(super) dashes: Option<&'static str>,
    pub(super) opacity: f64,
}

/// Position and style of a line of text.
pub(super) struct Text {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) size: f64,
    pub(super) weight: Weight,
    pub(super) anchor: &'static str,
    pub(super) colour: &'static str,
    /// `true` rotates the text by 90° to read upwards.
    pub(super) upright: bool,
}

impl Text {
    /// Centres the text at x, with the baseline at y.
    pub(super) fn at(x: f64, y: f64) -> Text {
        Text { x, y, size: LABEL, weight: Weight::Regular, anchor: "middle", colour: TEXT, upright: false }
    }
}

/// The document. Writing to a string cannot fail, so results of `write!` are ignored.
pub(super) struct Svg(String);

impl Svg {
    pub(super) fn new(width: f64, height: f64, title: &str) -> Svg {
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

    pub(super) fn finish(mut self) -> String {
        self.0.push_str("</svg>\n");
        self.0
    }

    pub(super) fn open(&mut self, label: &str) {
        let _ = writeln!(self.0, "<g aria-label=\"{}\">", escape(label));
    }

    pub(super) fn close(&mut self) {
        self.0.push_str("</g>\n");
    }

    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), colour: &str) {
        let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(short);
        let _ = writeln!(self.0, "<path d=\"M{x1} {y1}L{x2} {y2}\" stroke=\"{colour}\"/>");
    }

    pub(super) fn frame(&mut self, left: f64, top: f64, width: f64, height: f64) {
        let [x, y, w, h] = [left, top, width, height].map(short);
        let _ = writeln!(
            self.0,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"none\" stroke=\"{AXIS}\"/>"
        );
    }

    pub(super) fn polyline(&mut self, points: &[Point], pen: &Pen<'_>) {
        self.path(points);
        let Pen { colour, width, .. } = pen;
        let _ =
            write!(self.0, "\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"");
        if let Some(dashes) = pen.dashes {
            let _ = write!(self.0, " stroke-dasharray=\"{dashes}\"");
        }
        if pen.opacity < 1.0 {
            let _ = write!(self.0, " stroke-opacity=\"{}\"", pen.opacity);
        }
        self.0.push_str("/>\n");
    }

    /// Writes a filled polygon.
    pub(super) fn area(&mut self, points: &[Point], colour: &str, opacity: f64) {
        if points.len() < 3 {
            return;
        }
        self.path(points);
        let _ = write!(self.0, "Z\" fill=\"{colour}\"");
        if opacity < 1.0 {
            let _ = write!(self.0, " fill-opacity=\"{opacity}\"");
        }
        self.0.push_str("/>\n");
    }

    /// Writes a filled polygon without visible seams to adjacent polygons.
    pub(super) fn tile(&mut self, points: &[Point], colour: &str) {
        if points.len() >= 3 {
            self.path(points);
            let _ = writeln!(self.0, "Z\" fill=\"{colour}\" shape-rendering=\"crispEdges\"/>");
        }
    }

    /// Writes the start of a path element, up to its last point.
    pub(super) fn path(&mut self, points: &[Point]) {
        self.0.push_str("<path d=\"");
        let mut last = None;
        for (i, point) in points.iter().enumerate() {
            let now = (short(point.0), short(point.1));
            if last.as_ref() == Some(&now) && i + 1 < points.len() {
                continue; // The point is not visible.
            }
            let _ = write!(self.0, "{}{} {}", if i == 0 { 'M' } else { 'L' }, now.0, now.1);
            last = Some(now);
        }
    }

    pub(super) fn mark(&mut self, (x, y): Point, colour: &str, radius: f64) {
        let (x, y) = (short(x), short(y));
        let (fill, stroke) = if radius < MARK { (colour, 0.6) } else { ("#ffffff", 1.6) };
        let _ = writeln!(
            self.0,
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"{stroke}\"/>"
        );
    }

    /// Writes a cross, which marks a point without a value.
    pub(super) fn cross(&mut self, (x, y): Point, colour: &str) {
        let reach = 2.8;
        let [left, right, top, bottom] = [x - reach, x + reach, y - reach, y + reach].map(short);
        let _ = writeln!(
            self.0,
            "<path d=\"M{left} {top}L{right} {bottom}M{left} {bottom}L{right} {top}\" stroke=\"{colour}\" stroke-width=\"1.4\"/>"
        );
    }

    /// Writes a triangle, which marks a point to doubt.
    pub(super) fn triangle(&mut self, (x, y): Point, colour: &str) {
        let [left, right, top, bottom] = [x - 4.0, x + 4.0, y - 4.4, y + 2.6].map(short);
        let _ = writeln!(
            self.0,
            "<path d=\"M{left} {bottom}L{} {top}L{right} {bottom}Z\" fill=\"#ffffff\" stroke=\"{colour}\" stroke-width=\"1.4\"/>",
            short(x)
        );
    }

    pub(super) fn dot(&mut self, (x, y): Point, colour: &str) {
        let _ = writeln!(self.0, "<circle cx=\"{}\" cy=\"{}\" r=\"2\" fill=\"{colour}\"/>", short(x), short(y));
    }

    pub(super) fn text(&mut self, content: &str, text: Text) {
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

/// Formats a length to 0.01 px.
fn short(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Escapes text for XML and HTML, and removes characters that XML 1.0 forbids.
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
