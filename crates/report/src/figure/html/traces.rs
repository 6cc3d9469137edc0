//! The curves of the interactive figure as plotly traces.

use super::palette::{GROUND, Palette, axis_name, plain, power};
use crate::figure::axis::{self, AxisRange};
use crate::figure::colour::Colour;
use crate::figure::panels::{self, Axes, LegendEntry, PALE};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use stickslip_study::dataset::{Axis, Emphasis, Figure, Panel, Scale, Series, Style};

pub(super) fn traces(figure: &Figure, palette: &mut Palette) -> Vec<Value> {
    let (entries, _) = panels::legend(figure);
    // In an image, a label with several colours has a grey legend entry from a trace without
    // points.
    let several: Vec<&LegendEntry> = entries.iter().filter(|entry| entry.colour == Colour::several()).collect();
    let mut traces: Vec<Value> = several.iter().map(|entry| legend_trace(entry, palette)).collect();
    let mut seen: BTreeSet<&str> = several.iter().map(|entry| entry.label.as_str()).collect();
    let listed: BTreeSet<&str> = entries.iter().map(|entry| entry.label.as_str()).collect();
    for (index, (panel, axes)) in figure.panels.iter().zip(panels::axes(figure)).enumerate() {
        let said = figure.panels.len() == 1;
        let drawn =
            PanelTraces { index, panel, axes, alone: said, x: NumberFormat::of(axes.x), y: NumberFormat::of(axes.y) };
        for series in panels::drawing_order(panel) {
            let label = series.label.as_str();
            let named = listed.contains(label) && panels::drawn(panel, series).next().is_some() && seen.insert(label);
            traces.extend(drawn.traces(series, named, palette));
        }
    }
    traces.extend(palette.scheme.bar.as_ref().map(|(_, range)| bar_trace(*range)));
    traces
}

/// Returns a trace without points for the legend of an image.
fn legend_trace(entry: &LegendEntry, palette: &mut Palette) -> Value {
    let mode = match (entry.line, entry.marks) {
        (None, _) => "markers",
        (_, true) => "lines+markers",
        (_, false) => "lines",
    };
    let colour = palette.register(&entry.colour);
    json!({
        "type": "scatter", "x": [null], "y": [null], "mode": mode, "legendrank": 2000,
        "name": plain(&entry.label), "legendgroup": entry.label, "showlegend": true,
        "line": { "color": colour, "width": 2, "dash": dash(entry.line.unwrap_or(Style::Solid)) },
        "marker": { "color": GROUND, "size": 8, "line": { "color": colour, "width": 2 } },
    })
}

/// Returns a trace without points that carries the colour bar.
fn bar_trace(range: AxisRange) -> Value {
    let value = range.to_linear(range.from);
    json!({
        "type": "scatter", "x": [null], "y": [null], "mode": "markers", "showlegend": false, "hoverinfo": "skip",
        "marker": { "color": [value], "coloraxis": "coloraxis" },
    })
}

/// A panel whose curves are drawn.
struct PanelTraces<'f> {
    index: usize,
    panel: &'f Panel,
    axes: Axes,
    /// `true` if the figure has no other panel.
    alone: bool,
    x: NumberFormat,
    y: NumberFormat,
}

impl PanelTraces<'_> {
    /// Returns the trace of a series, after a trace with the isolated points of a line.
    fn traces(&self, series: &Series, named: bool, palette: &mut Palette) -> Vec<Value> {
        let mut trace = self.trace(series, named, palette);
        let shade = palette.scheme.colour(series);
        let colour = palette.register(&shade);
        let crowd = panels::crowded(self.panel);
        match series.style {
            Style::Marks => {
                trace["mode"] = json!("markers");
                trace["marker"] = if crowd {
                    json!({ "color": colour, "size": 4 })
                } else {
                    json!({ "color": GROUND, "size": 8, "line": { "color": colour, "width": 2 } })
                };
            }
            Style::Warning => {
                trace["mode"] = json!("markers");
                let line = json!({ "color": colour, "width": 1.5 });
                trace["marker"] = json!({ "symbol": "triangle-up", "color": GROUND, "size": 8, "line": line });
            }
            Style::Missing => {
                let y = self.axes.y.value_at(panels::row_of_crosses(series));
                trace["y"] = json!(self.y.numbers(series.x.iter().map(|_| y)));
                trace["mode"] = json!("markers");
                trace["marker"] = json!({ "symbol": "x-thin", "size": 6, "line": { "color": colour, "width": 1.5 } });
                let x = hover("x", &self.panel.x, self.x.power);
                trace["hovertemplate"] = json!(format!("{x}<br>no orbit<extra></extra>"));
            }
            Style::Band => {
                trace["fillcolor"] = json!(palette.area(&shade));
                self.band(series, &mut trace, &colour);
            }
            Style::Bars => self.bars(series, &mut trace, &colour),
            Style::Stripe => return self.stripe(series, palette).into_iter().collect(),
            Style::Solid | Style::Dashed | Style::Dotted => {
                let dots = self.isolated_points(series, &trace, &colour);
                let contour = series.emphasis == Emphasis::Contour;
                let thin = contour || matches!(series.emphasis, Emphasis::Pale | Emphasis::OwnReference);
                let width = if thin || crowd { 1.0 } else { 2.0 };
                let dash = dash(panels::line_style(series));
                trace["mode"] = json!("lines");
                trace["line"] = json!({ "color": colour, "width": width, "simplify": false, "dash": dash });
                if contour {
                    // the tiles below state the value
                    trace["hoverinfo"] = json!("skip");
                    trace["hovertemplate"] = Value::Null;
                }
                return dots.into_iter().chain([trace]).collect();
            }
        }
        vec![trace]
    }

    /// Returns the part common to all styles: points, names and hover text.
    fn trace(&self, series: &Series, named: bool, palette: &Palette) -> Value {
        let panel = self.panel;
        let said = panel.title.is_empty() || panel.title == series.label;
        let place = if self.alone || said { String::new() } else { format!("<br>{}", plain(&panel.title)) };
        let value = palette.scheme.value(series).filter(|text| !series.label.contains(text.as_str()));
        let value = value.map_or(String::new(), |text| format!("<br>{}", plain(&text)));
        let (x, y) = (hover("x", &panel.x, self.x.power), hover("y", &panel.y, self.y.power));
        let mut trace = json!({
            // The graphics processor draws curves with more points than this.
            "type": if series.x.len() > 5000 { "scattergl" } else { "scatter" },
            "x": self.x.numbers(panels::points(panel, series).map(|p| p.0)),
            "y": self.y.numbers(panels::points(panel, series).map(|p| p.1)),
            "xaxis": axis_name("x", self.index), "yaxis": axis_name("y", self.index),
            "name": plain(&series.label), "legendgroup": series.label, "showlegend": named,
            "connectgaps": false,
            "hovertemplate": format!("{x}<br>{y}<extra>{}{value}{place}</extra>", plain(&series.label)),
        });
        if series.emphasis == Emphasis::Pale {
            trace["opacity"] = json!(PALE);
        }
        trace
    }

    fn band(&self, series: &Series, trace: &mut Value, colour: &str) {
        let (x, y) = outline(self.panel, series, self.axes.y);
        trace["x"] = json!(self.x.numbers(x.into_iter()));
        trace["y"] = json!(self.y.numbers(y.into_iter()));
        trace["type"] = json!("scatter");
        trace["mode"] = json!("lines");
        trace["fill"] = json!("toself");
        trace["line"] = json!({ "width": 0, "color": colour });
        trace["hoverinfo"] = json!("skip");
        trace["hovertemplate"] = Value::Null;
    }

    fn bars(&self, series: &Series, trace: &mut Value, colour: &str) {
        trace["type"] = json!("bar");
        trace["marker"] = json!({ "color": colour });
        if series.base.is_empty() {
            return;
        }
        // plotly measures the height of a bar from its foot.
        let feet = |i: usize| panels::base(self.panel, series, i).unwrap_or(self.axes.y.from);
        let count = series.x.len().min(series.y.len());
        trace["base"] = json!(self.y.numbers((0..count).map(feet)));
        let heights = panels::points(self.panel, series).enumerate().map(|(i, p)| p.1 - feet(i));
        trace["y"] = json!(self.y.numbers(heights));
    }

    /// Returns a stripe as a heat map with one row.
    fn stripe(&self, series: &Series, palette: &Palette) -> Option<Value> {
        let ((shown, range), y) = (palette.scheme.bar.as_ref()?, series.y.first()?);
        let [low, high] = panels::stripe_edges(series)?;
        let tiles = !series.base.is_empty();
        let count = series.x.len().min(series.shades.len());
        let shades = NumberFormat::of(*range);
        let name = self.panel.y.names.get(*y as usize).filter(|_| !tiles).cloned().unwrap_or_default();
        let over = if tiles { format!("<br>{}", hover("y", &self.panel.y, self.y.power)) } else { String::new() };
        let value = format!("{} = %{{z:.4~g}} {}", plain(&shown.quantity), plain(&axis::unit(shown, 0)));
        Some(json!({
            "type": "heatmap", "xaxis": axis_name("x", self.index), "yaxis": axis_name("y", self.index),
            // Overlap of stripes, which hides seams.
            "x": self.x.numbers(panels::edges(&series.x[..count], self.axes.x).into_iter()), "y": self.y.numbers([low, high + 0.03 * (high - low)].into_iter()),
            "z": [shades.numbers(series.shades[..count].iter().copied())], "coloraxis": "coloraxis", "showlegend": false,
            "hovertemplate": format!("{}{over}<br>{value}<extra>{}</extra>", hover("x", &self.panel.x, self.x.power), plain(&name)),
        }))
    }

    /// Returns a trace of the points that a line does not show.
    fn isolated_points(&self, series: &Series, trace: &Value, colour: &str) -> Option<Value> {
        let points = isolated(self.panel, series);
        if points.is_empty() {
            return None;
        }
        let mut dots = trace.clone();
        dots["x"] = Value::from(self.x.numbers(points.iter().map(|p| p.0)));
        dots["y"] = Value::from(self.y.numbers(points.iter().map(|p| p.1)));
        dots["mode"] = json!("markers");
        dots["marker"] = json!({ "color": colour, "size": 5 });
        dots["showlegend"] = json!(false);
        Some(dots)
    }
}

/// Returns the outlines of the pieces of a band.
///
/// An outline follows the upper edge, returns along the lower edge, and ends with a gap.
fn outline(panel: &Panel, series: &Series, range: AxisRange) -> (Vec<f64>, Vec<f64>) {
    let points: Vec<(usize, (f64, f64))> = panels::points(panel, series).enumerate().collect();
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for piece in points.split(|(_, p)| !panels::drawable(p.0, p.1)).filter(|piece| !piece.is_empty()) {
        let lower = piece.iter().rev().map(|(i, p)| (p.0, panels::base(panel, series, *i).unwrap_or(range.from)));
        for p in piece.iter().map(|(_, p)| *p).chain(lower).chain([(f64::NAN, f64::NAN)]) {
            x.push(p.0);
            y.push(p.1);
        }
    }
    (x, y)
}

/// Returns the dash pattern of the static figure in plotly's format.
fn dash(style: Style) -> &'static str {
    match style {
        Style::Dashed => "7px,4px",
        Style::Dotted => "2px,3px",
        _ => "solid",
    }
}

/// Returns the points between two gaps, which a line does not show.
fn isolated(panel: &Panel, series: &Series) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = panels::points(panel, series).collect();
    points
        .split(|p| !panels::drawable(p.0, p.1))
        .filter_map(|piece| if let [point] = piece { Some(*point) } else { None })
        .collect()
}

/// Number format of an axis.
struct NumberFormat {
    /// Power of ten factored out, as in the static figure.
    power: i32,
    /// Digits after the decimal point. On a logarithmic axis: digits after the leading one.
    digits: usize,
    scale: Scale,
}

impl NumberFormat {
    fn of(range: AxisRange) -> NumberFormat {
        // Digits of a number, counted from the leading digit of the axis length. A reader can
        // zoom in by 10,000 before a point moves by a thousandth of the picture.
        let digits = 8;
        let power = power(range);
        let first = axis::log10(axis::scaled(range.to - range.from, power)).floor() as i32;
        let digits = match range.scale {
            Scale::Linear => (digits - 1 - first).clamp(0, 300),
            Scale::Log => digits - 1,
        };
        NumberFormat { power, digits: digits as usize, scale: range.scale }
    }

    /// Formats numbers for the page. Non-finite values become null, which interrupts a curve.
    fn numbers(&self, values: impl Iterator<Item = f64>) -> Vec<Value> {
        let digits = self.digits;
        let number = |v: f64| {
            let v = axis::scaled(v, self.power);
            let text = if self.scale == Scale::Log { format!("{v:.digits$e}") } else { format!("{v:.digits$}") };
            text.parse::<f64>().ok().filter(|v| v.is_finite()).map(|v| v + 0.0)
        };
        // An integer without a decimal point is shorter.
        let value = |v: f64| if v.abs() < 1e15 && v.fract() == 0.0 { Value::from(v as i64) } else { Value::from(v) };
        values.map(|v| number(v).map_or(Value::Null, value)).collect()
    }
}

/// Returns the hover template of a value, such as `frequency = 121.25 Hz`.
fn hover(letter: &str, shown: &Axis, power: i32) -> String {
    let quantity = if shown.quantity.trim().is_empty() { letter } else { shown.quantity.trim() };
    format!("{} = %{{{letter}:.6~g}} {}", plain(quantity), plain(&axis::unit(shown, power)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_null_and_numbers_have_the_digits_of_their_axis() {
        let form = NumberFormat::of(AxisRange { from: 0.0, to: 2.0, scale: Scale::Linear });
        assert_eq!(
            json!(form.numbers([1.0, f64::NAN, f64::INFINITY, 0.1 + 0.2].into_iter())),
            json!([1, null, null, 0.3])
        );
        let log = NumberFormat::of(AxisRange { from: 1e-9, to: 1e3, scale: Scale::Log });
        assert_eq!(json!(log.numbers([1.234_567_891e-9, 100.0].into_iter())), json!([1.2345679e-9, 100]));
        // An offset does not reduce the visible digits.
        let offset = NumberFormat::of(AxisRange { from: 1e6, to: 1e6 + 1e-3, scale: Scale::Linear });
        let values: Vec<f64> = offset.numbers([1e6 + 3e-7].into_iter()).iter().filter_map(Value::as_f64).collect();
        assert!((values[0] - (1e6 + 3e-7)).abs() < 2e-10);
    }
}
