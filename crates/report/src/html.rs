//! The interactive figure as one self-contained page: zoom, pan, values under the pointer; works offline.
//!
//! The plotting script (plotly.js, MIT) comes embedded in the `plotly` crate. The figure itself is plain data for it,
//! written here because the crate's layout knows eight axes at most.

use crate::font;
use crate::frame::{self, Range};
use crate::output::{File, Output, ReportError};
use crate::svg::escape;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::sync::OnceLock;
use stickslip_study::dataset::{Axis, Dataset, Figure, Series, Style};

/// The output `html`.
pub const OUTPUT: Output = Output { name: "html", summary: "figure.html, interactive, self-contained", make: files };

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    Ok(vec![File::new("figure.html", to_html(&dataset.figure))])
}

/// The figure as a complete page with its script.
pub fn to_html(figure: &Figure) -> String {
    let title = escape(&figure.title);
    let body = format!("<h1>{title}</h1>\n{}", fragment(figure, "figure"));
    document(&title, "body { max-width: 1280px; } h1 { text-align: center; }", &body)
}

/// A whole page around a body that contains figures; the script stands once. `title` is already escaped.
pub(crate) fn document(title: &str, style: &str, body: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{STYLE}{style}\n</style>\n\
         <noscript><style>.live {{ display: none; }} .still {{ display: block; }}</style></noscript>\n<script>{}</script>\n<script>{DRAW}</script>\n</head>\n\
         <body>\n{body}\n</body>\n</html>\n",
        script()
    )
}

const STYLE: &str = "\
body { margin: 0 auto; padding: 1.5rem; font: 16px/1.55 system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif; color: #1a1a1a; background: #fff; }
h1 { font-size: 1.45rem; line-height: 1.25; margin: 0 0 .75rem; overflow-wrap: anywhere; }
.figure { width: 100%; margin: .5rem 0 1rem; overflow-x: clip; }
.still { display: none; text-align: center; }
.still svg { max-width: 100%; height: auto; }
@media print { .live { display: none; } .still { display: block; } }
";

/// Draws a figure into its place: the same panels below each other where the page is narrow.
const DRAW: &str = "
function stickslip(id, figure) {
  const place = document.getElementById(id), narrow = window.matchMedia('(max-width: 900px)');
  const draw = () => {
    const layout = narrow.matches ? figure.narrow : figure.wide;
    Plotly.react(place, figure.data, layout, {responsive: true, displaylogo: false,
      modeBarButtonsToRemove: ['select2d', 'lasso2d'], toImageButtonOptions: {format: 'svg', filename: 'figure'}});
  };
  draw();
  narrow.addEventListener('change', draw);
}
";

/// plotly.js without the mathematics typesetter (2 MB) that the crate puts behind it.
fn script() -> &'static str {
    static SCRIPT: OnceLock<String> = OnceLock::new();
    SCRIPT.get_or_init(|| {
        let both = plotly::Plot::offline_js_sources();
        let first = both.split_once('>').map_or("", |(_, rest)| rest);
        first.split_once("</script>").map_or(first, |(script, _)| script).to_owned()
    })
}

/// The figure inside a page: live on the screen, static on paper and where no script runs.
pub(crate) fn fragment(figure: &Figure, id: &str) -> String {
    let (columns, _) = frame::grid(figure.panels.len());
    let data = json!({ "data": traces(figure), "wide": layout(figure, columns), "narrow": layout(figure, 1) });
    // `<` would let a label end the script element
    let data = data.to_string().replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029");
    let height = layout(figure, columns)["height"].as_f64().unwrap_or(0.0);
    format!(
        "<div class=\"figure\">\n<div id=\"{id}\" class=\"live\" style=\"min-height: {height}px\"></div>\n\
         <div class=\"still\">{}</div>\n</div>\n<script>stickslip(\"{id}\", {data});</script>",
        crate::svg::to_svg(figure)
    )
}

/// Names the axis of a panel the way plotly counts: x, x2, x3, …
fn axis_name(letter: &str, panel: usize) -> String {
    if panel == 0 { letter.to_owned() } else { format!("{letter}{}", panel + 1) }
}

fn traces(figure: &Figure) -> Vec<Value> {
    let mut traces = Vec::new();
    let mut seen = BTreeSet::new();
    // a label of several colours stands in the legend in grey, as a trace without points
    for entry in frame::legend(figure).iter().filter(|e| e.colour == frame::MANY_COLOURS) {
        let mode = match (entry.line, entry.marks) {
            (None, _) => "markers",
            (_, true) => "lines+markers",
            (_, false) => "lines",
        };
        seen.insert(entry.label.clone());
        traces.push(json!({
            "type": "scatter", "x": [null], "y": [null], "mode": mode, "legendrank": 2000,
            "name": plain(&entry.label), "legendgroup": entry.label, "showlegend": true,
            "line": { "color": entry.colour, "width": 2, "dash": dash(entry.line.unwrap_or(Style::Solid)) },
            "marker": { "color": "#ffffff", "size": 8, "line": { "color": entry.colour, "width": 2 } },
        }));
    }
    let several = figure.panels.len() > 1;
    for (i, (panel, (x, y))) in figure.panels.iter().zip(frame::ranges(figure)).enumerate() {
        let (x_power, y_power) = (power(x), power(y));
        let lines = panel.series.iter().filter(|s| s.style != Style::Marks);
        for series in lines.chain(panel.series.iter().filter(|s| s.style == Style::Marks)) {
            let named = !series.label.trim().is_empty();
            let place =
                if several && !panel.title.is_empty() { format!("<br>{}", plain(&panel.title)) } else { String::new() };
            let (x, y) = (hover("x", &panel.x, x_power), hover("y", &panel.y, y_power));
            let mut trace = json!({
                "type": if series.x.len() > 5000 { "scattergl" } else { "scatter" },
                "x": numbers(frame::points(series).map(|p| p.0), x_power),
                "y": numbers(frame::points(series).map(|p| p.1), y_power),
                "xaxis": axis_name("x", i), "yaxis": axis_name("y", i),
                "name": plain(&series.label), "legendgroup": series.label,
                "showlegend": named && frame::points(series).any(frame::drawable) && seen.insert(series.label.clone()),
                "connectgaps": false,
                "hovertemplate": format!("{x}<br>{y}<extra>{}{place}</extra>", plain(&series.label)),
            });
            let colour = frame::colour(series.colour);
            if series.style == Style::Marks {
                trace["mode"] = json!("markers");
                trace["marker"] = json!({ "color": "#ffffff", "size": 8, "line": { "color": colour, "width": 2 } });
            } else {
                let alone = lonely(series);
                if !alone.is_empty() {
                    let mut dots = trace.clone();
                    dots["x"] = Value::from(numbers(alone.iter().map(|p| p.0), x_power));
                    dots["y"] = Value::from(numbers(alone.iter().map(|p| p.1), y_power));
                    dots["mode"] = json!("markers");
                    dots["marker"] = json!({ "color": colour, "size": 5 });
                    dots["showlegend"] = json!(false);
                    traces.push(dots);
                }
                trace["mode"] = json!("lines");
                trace["line"] = json!({ "color": colour, "width": 2, "simplify": false, "dash": dash(series.style) });
            }
            traces.push(trace);
        }
    }
    traces
}

/// The dashes of the static figure, in the words of plotly.
fn dash(style: Style) -> &'static str {
    match style {
        Style::Dashed => "7px,4px",
        Style::Dotted => "2px,3px",
        Style::Solid | Style::Marks | Style::Band | Style::Bars => "solid",
    }
}

/// The points with gaps on both sides: a line alone would not show them.
fn lonely(series: &Series) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = frame::points(series).collect();
    points
        .split(|p| !frame::drawable(*p))
        .filter_map(|piece| if let [point] = piece { Some(*point) } else { None })
        .collect()
}

/// Numbers for the page in units of a power of ten, 13 digits; what does not exist is null and interrupts the curve.
fn numbers(values: impl Iterator<Item = f64>, power: i32) -> Vec<Value> {
    let number = |v: f64| format!("{:.12e}", frame::scaled(v, power)).parse::<f64>().ok().filter(|v| v.is_finite());
    values.map(|v| number(v).map_or(Value::Null, Value::from)).collect()
}

/// `frequency = 121.25 Hz` for the value under the pointer.
fn hover(letter: &str, axis: &Axis, power: i32) -> String {
    let quantity = if axis.quantity.trim().is_empty() { letter } else { axis.quantity.trim() };
    format!("{} = %{{{letter}:.6~g}} {}", plain(quantity), plain(&frame::unit(axis, power)))
}

/// Text that plotly, which reads some tags and templates, shows literally.
fn plain(text: &str) -> String {
    escape(text).replace("&quot;", "\"").replace("&#39;", "'").replace("%{", "%\u{200b}{")
}

/// Sizes of the interactive figure, px.
const WIDTH: f64 = 1200.0;
const TOP: f64 = 92.0;
const BOTTOM: f64 = 60.0;
const ROW_GAP: f64 = 92.0;
const COLUMN_GAP: f64 = 85.0;
const TITLE: f64 = 15.0;

/// The power of ten that the axis of this range takes out, the same as in the static figure.
fn power(range: Range) -> i32 {
    frame::ticks(range, 6.0).power
}

fn layout(figure: &Figure, columns: usize) -> Value {
    let count = figure.panels.len().max(1);
    let (columns, rows) = (columns.min(count), count.div_ceil(columns));
    let plot_height = match (columns, rows) {
        (1, 1) => 460.0,
        (1, _) => 270.0,
        (2, 1) => 380.0,
        _ => 270.0,
    };
    let ranges = frame::ranges(figure);
    let widest = |range: &(Range, Range)| {
        let ticks = frame::ticks(range.1, 6.0);
        ticks.labels.iter().map(|l| font::width(l, 13.0, font::Weight::Regular)).fold(0.0, f64::max)
    };
    let widest = ranges.iter().map(widest).fold(0.0, f64::max);
    let column_gap = if columns == 1 { 0.0 } else { COLUMN_GAP.max(widest + 60.0) / WIDTH };
    let plot_width = (1.0 - column_gap * (columns as f64 - 1.0)) / columns as f64;
    let limit = if columns == 1 { 420.0 } else { 0.85 * WIDTH * plot_width };
    let titles: Vec<Vec<String>> =
        figure.panels.iter().map(|p| font::wrap(&p.title, TITLE, font::Weight::Bold, limit)).collect();
    let lines = titles.iter().map(Vec::len).max().unwrap_or(0).max(1) as f64;
    // titles of several lines push the rows apart and the legend up
    let more = 1.3 * TITLE * (lines - 1.0);
    let (top, row_gap) = (TOP + more, ROW_GAP + more);
    let inside = rows as f64 * plot_height + (rows as f64 - 1.0) * row_gap;
    let entries = frame::legend(figure);
    let font = json!({ "family": "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif", "size": 14, "color": "#1a1a1a" });
    let mut layout = json!({
        "height": inside + top + BOTTOM, "autosize": true, "font": font,
        "margin": { "l": 70, "r": 20, "t": top, "b": BOTTOM },
        "paper_bgcolor": "#ffffff", "plot_bgcolor": "#ffffff", "hovermode": "closest", "dragmode": "zoom",
        "hoverlabel": { "bgcolor": "#ffffff", "font": { "size": 13 } },
        "showlegend": !entries.is_empty(),
        "legend": { "orientation": "h", "x": 0.5, "xanchor": "center", "y": 1.0 + (30.0 + more) / inside, "yanchor": "bottom", "font": { "size": 14 } },
    });
    let mut notes = Vec::new();
    for (i, (panel, (x, y))) in figure.panels.iter().zip(&ranges).enumerate() {
        let (column, row) = ((i % columns) as f64, (i / columns) as f64);
        let left = (column * (plot_width + column_gap)).min(1.0);
        let right = (left + plot_width).min(1.0);
        let top = 1.0 - row * (plot_height + row_gap) / inside;
        let bottom = (top - plot_height / inside).max(0.0);
        let x_partner = (0..i).find(|&j| figure.panels[j].x == panel.x && ranges[j].0 == *x);
        let y_partner = (0..i).find(|&j| figure.panels[j].y == panel.y && ranges[j].1 == *y);
        layout[axis_name("xaxis", i)] =
            axis(&panel.x, *x, [left, right], axis_name("y", i), x_partner.map(|j| axis_name("x", j)));
        layout[axis_name("yaxis", i)] =
            axis(&panel.y, *y, [bottom, top], axis_name("x", i), y_partner.map(|j| axis_name("y", j)));
        let note = json!({ "x": (left + right) / 2.0, "xref": "paper", "yref": "paper", "xanchor": "center", "showarrow": false });
        let mut title = note.clone();
        let text = titles[i].iter().map(|l| plain(l)).collect::<Vec<_>>().join("<br>");
        title["text"] = json!(format!("<b>{text}</b>"));
        title["y"] = json!(top);
        title["yanchor"] = json!("bottom");
        title["yshift"] = json!(4);
        title["font"] = json!({ "size": TITLE });
        notes.push(title);
        if !frame::has_data(panel) {
            let mut empty = note;
            empty["text"] = json!("no data");
            empty["y"] = json!((top + bottom) / 2.0);
            notes.push(empty);
        }
    }
    layout["annotations"] = Value::from(notes);
    layout
}

/// An axis; `partner` is the earlier axis of the same quantity and range that it zooms with.
fn axis(axis: &Axis, range: Range, domain: [f64; 2], anchor: String, partner: Option<String>) -> Value {
    let power = power(range);
    let mut value = json!({
        "domain": domain, "anchor": anchor, "range": [frame::scaled(range.from, power), frame::scaled(range.to, power)],
        "title": { "text": plain(&frame::axis_title(axis, power)), "standoff": 8, "font": { "size": 14 } },
        "showline": true, "mirror": true, "linecolor": "#444444", "gridcolor": "#e3e3e3", "zerolinecolor": "#b0b0b0",
        "ticks": "outside", "tickcolor": "#444444", "exponentformat": "none", "separatethousands": false, "nticks": 8, "automargin": true,
        "zeroline": range.from < 0.0, "tickfont": { "size": 13 },
    });
    if let Some(partner) = partner {
        value["matches"] = json!(partner);
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    /// What stands outside of the scripts: nothing there may load anything.
    pub(crate) fn markup(html: &str) -> String {
        html.split("<script>").map(|part| part.split_once("</script>").map_or(part, |(_, rest)| rest)).collect()
    }

    #[test]
    fn the_page_is_self_contained() {
        for dataset in samples::all() {
            let html = to_html(&dataset.figure);
            assert_eq!(html.matches("plotly.js v").count(), 1);
            let markup = markup(&html);
            assert!(
                !markup.contains("src=")
                    && !markup.contains("href=")
                    && !markup.contains("@import")
                    && !markup.contains("url(")
            );
            assert!(!html.contains("MathJax-script"));
            assert!(html.len() < 12_000_000, "{}", html.len());
        }
    }

    #[test]
    fn a_label_cannot_end_its_script_or_become_a_tag() {
        let html = to_html(&samples::hostile().figure);
        let markup = markup(&html);
        assert!(!html.contains("<script>alert") && !markup.contains("<b>bold") && !markup.contains("</title><"));
        assert_eq!(html.matches("<script>").count(), html.matches("</script>").count());
    }

    #[test]
    fn every_panel_has_axes_and_every_label_one_legend_entry() {
        for dataset in samples::all() {
            let figure = &dataset.figure;
            let (columns, _) = frame::grid(figure.panels.len());
            let layout = layout(figure, columns);
            for (i, panel) in figure.panels.iter().enumerate() {
                let text = layout[axis_name("xaxis", i)]["title"]["text"].as_str().unwrap();
                assert_eq!(text, plain(&frame::axis_title(&panel.x, 0)));
                let domain = &layout[axis_name("yaxis", i)]["domain"];
                assert!(domain[0].as_f64().unwrap() >= 0.0 && domain[0].as_f64() < domain[1].as_f64());
            }
            let shown = traces(figure).iter().filter(|t| t["showlegend"] == true).count();
            assert_eq!(shown, frame::legend(figure).len());
        }
    }

    #[test]
    fn gaps_are_null() {
        assert_eq!(
            json!(numbers([1.0, f64::NAN, f64::INFINITY, 0.1 + 0.2].into_iter(), 0)),
            json!([1.0, null, null, 0.3])
        );
    }
}
