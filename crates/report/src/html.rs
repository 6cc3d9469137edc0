//! The interactive figure as a page: zoom, pan, values under the pointer; works offline, in light and in dark.
//!
//! The plotting script (plotly.js, MIT) comes embedded in the `plotly` crate and is written once per output folder;
//! pages refer to it by its relative path, and show the static figure where it is missing. The figure itself is plain
//! data for the script, written here because the crate's layout knows eight axes at most. The legend is part of the
//! page, not of the plot: it breaks into lines at any width, and nothing lies above it.

use crate::axis::{self, Range};
use crate::colour::Colour;
use crate::file::{File, Output, ReportError};
use crate::font;
use crate::frame::{self, AREA, Axes, Entry, PALE, Shades};
use crate::svg::escape;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::OnceLock;
use stickslip_study::dataset::{Axis, Dataset, Emphasis, Figure, Panel, Scale, Series, Style};

/// The output `html`.
pub const OUTPUT: Output = Output {
    name: "html",
    summary: "figure.html, interactive, with one script for all figures beside their folders",
    make: files,
};

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    let page = to_html(&dataset.figure, &format!("../{}", script_name()));
    Ok(vec![File::new("figure.html", page), File::shared(script_name(), script())])
}

/// The figure as a complete page. `script_path` leads from the page to the script, a file named [`script_name`] of the
/// content [`script`].
pub fn to_html(figure: &Figure, script_path: &str) -> String {
    let title = escape(&figure.title);
    let body = format!("<h1>{title}</h1>\n{}", fragment(figure, "figure"));
    document(&title, "body { max-width: 1280px; } h1 { text-align: center; }", &body, script_path)
}

/// A whole page around a body that contains figures. `title` is already escaped.
pub(crate) fn document(title: &str, style: &str, body: &str, script_path: &str) -> String {
    let path = escape(script_path);
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{title}</title>\n<style>\n{STYLE}{style}\n</style>\n\
         <noscript><style>.live, .legend {{ display: none; }} .still {{ display: block; }}</style></noscript>\n\
         <script src=\"{path}\" onerror=\"document.documentElement.classList.add('missing')\"></script>\n\
         <script>{DRAW}</script>\n</head>\n<body>\n\
         <p class=\"lost\">The file <code>{path}</code> is missing, so figures cannot be zoomed: it belongs to the folder \
         of results from which this page was taken.</p>\n{body}\n</body>\n</html>\n"
    )
}

// the scroll bar has its place from the start: figures take the width that is there when they are drawn
const STYLE: &str = "\
html { overflow-y: scroll; }
body { margin: 0 auto; padding: 1.5rem; font: 16px/1.55 system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif; color: #1a1a1a; background: #fff; }
h1 { font-size: 1.45rem; line-height: 1.25; margin: 0 0 .75rem; overflow-wrap: anywhere; }
.figure { width: 100%; margin: .5rem 0 1rem; overflow-x: clip; }
.legend { display: flex; flex-wrap: wrap; justify-content: center; gap: .1rem .4rem; margin: .3rem 0; }
.legend button { --colour: var(--light); display: inline-flex; align-items: center; gap: .45rem; max-width: 100%; padding: .1rem .5rem; border: 0; border-radius: .4rem; background: none; color: inherit; font: inherit; font-size: .9rem; line-height: 1.35; text-align: left; overflow-wrap: anywhere; cursor: pointer; }
.legend button:hover { background: #8883; }
.legend button[aria-pressed=false] { opacity: .4; text-decoration: line-through; }
.legend svg { flex: none; }
.legend .more { padding: .1rem .5rem; font-size: .9rem; }
.still { display: none; text-align: center; }
.still svg { max-width: 100%; height: auto; }
.lost { display: none; padding: .5rem .8rem; border: 1px solid #b8860b; border-radius: .4rem; }
.missing .lost, .missing .still { display: block; }
.missing .live, .missing .legend { display: none; }
@media (max-width: 600px) { body { padding: 1rem .5rem; } }
@media screen and (prefers-color-scheme: dark) {
  body { color: #e4e6ea; background: #16181d; }
  .legend button { --colour: var(--dark); }
}
@media print { .live, .legend, .lost { display: none !important; } .still { display: block; } }
";

/// Draws a figure into its place: the same panels below each other where the page is narrow, in the colours that the
/// reader's screen asks for. An image taken of it has title and legend, and is light.
const DRAW: &str = "
function stickslip(id, figure) {
  const place = document.getElementById(id);
  if (!window.Plotly) { return; }
  const narrow = window.matchMedia('(max-width: ' + figure.break + 'px)');
  const dark = window.matchMedia('(prefers-color-scheme: dark)');
  const words = new Set(['text', 'name', 'legendgroup', 'hovertemplate']);
  const tint = (value) => JSON.parse(JSON.stringify(value),
    (key, v) => typeof v === 'string' && !words.has(key) && figure.dark[v] || v);
  const image = () => {
    const layout = JSON.parse(JSON.stringify(figure.wide));
    for (const key of Object.keys(layout)) {
      if (/^[xy]axis/.test(key) && place.layout[key]) { layout[key].range = place.layout[key].range; }
    }
    Object.assign(layout, {showlegend: true, title: {text: '<b>' + figure.title + '</b>', yref: 'container', y: 1, yanchor: 'top', pad: {t: 16}}, autosize: false});
    layout.margin.t += 40;
    layout.height += 40;
    const data = figure.data.filter((trace) => trace.visible !== false);
    Plotly.downloadImage({data, layout}, {format: 'svg', filename: 'figure', width: 1200, height: layout.height});
  };
  const draw = (plot) => {
    const layout = narrow.matches ? figure.narrow : figure.wide;
    const [data, frame] = dark.matches ? [tint(figure.data), tint(layout)] : [figure.data, JSON.parse(JSON.stringify(layout))];
    plot(place, data, frame, {responsive: true, displaylogo: false,
      modeBarButtonsToRemove: ['select2d', 'lasso2d', 'toImage'],
      modeBarButtonsToAdd: [{name: 'image', title: 'Save as SVG', icon: Plotly.Icons.camera, click: image}]});
  };
  // a colour bar that turns over in place would leave its labels behind
  const anew = () => { Plotly.purge(place); draw(Plotly.newPlot); };
  anew();
  narrow.addEventListener('change', anew);
  dark.addEventListener('change', anew);
  for (const button of document.querySelectorAll('#' + id + '-legend button')) {
    button.addEventListener('click', () => {
      const show = button.getAttribute('aria-pressed') === 'false';
      button.setAttribute('aria-pressed', show);
      for (const trace of figure.data) { if (trace.legendgroup === button.dataset.label) { trace.visible = show; } }
      draw(Plotly.react);
    });
  }
}
";

/// plotly.js without the mathematics typesetter (2 MB) that the crate puts behind it.
pub fn script() -> &'static str {
    static SCRIPT: OnceLock<String> = OnceLock::new();
    SCRIPT.get_or_init(|| {
        let both = plotly::Plot::offline_js_sources();
        let first = both.split_once('>').map_or("", |(_, rest)| rest);
        first.split_once("</script>").map_or(first, |(script, _)| script).trim_start().to_owned()
    })
}

/// Name of the script's file: `plotly-3.0.1.min.js`, with the version that the script itself tells.
pub fn script_name() -> String {
    let version = script().split_once("plotly.js v").map_or("", |(_, rest)| rest);
    let end = version.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(0);
    match version[..end].trim_matches('.') {
        "" => "plotly.min.js".to_owned(),
        version => format!("plotly-{version}.min.js"),
    }
}

/// Colours of all that is no curve, and their partners on dark: text, background, axes, grid, fine grid, zero.
const TEXT: &str = "#1a1a1a";
const GROUND: &str = "#ffffff";
const LINE: &str = "#444444";
const GRID: &str = "#e3e3e3";
const FINE_GRID: &str = "#f2f2f2";
const ZERO: &str = "#b0b0b0";
const DARK: [[&str; 2]; 6] = [
    [TEXT, "#e4e6ea"],
    [GROUND, "#16181d"],
    [LINE, "#9aa0a8"],
    [GRID, "#2e323a"],
    [FINE_GRID, "#22252b"],
    [ZERO, "#5a606a"],
];

/// The figure inside a page: live on the screen, static on paper and where no script runs.
pub(crate) fn fragment(figure: &Figure, id: &str) -> String {
    let (columns, _) = frame::grid(figure);
    let mut ink = Ink::new(figure);
    let data = traces(figure, &mut ink);
    let wide = layout(figure, Page::Wide, &mut ink);
    let narrow = layout(figure, Page::Narrow, &mut ink);
    let height = wide["height"].as_f64().unwrap_or(0.0);
    let data = json!({
        "data": data, "wide": wide, "narrow": narrow, "dark": ink.dark, "title": plain(&figure.title),
        "break": NARROW[columns.clamp(1, 3) - 1],
    });
    // `<` would let a label end the script element
    let data = data.to_string().replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029");
    format!(
        "<div class=\"figure\">\n{}<div id=\"{id}\" class=\"live\" style=\"min-height: {height}px\"></div>\n\
         <div class=\"still\">{}</div>\n</div>\n<script>stickslip(\"{id}\", {data});</script>",
        legend(figure, id),
        crate::svg::to_svg(figure)
    )
}

/// The legend: buttons that show and hide what they name.
fn legend(figure: &Figure, id: &str) -> String {
    let (entries, more) = frame::legend(figure);
    if entries.is_empty() {
        return String::new();
    }
    let mut out = format!("<div class=\"legend\" id=\"{id}-legend\">\n");
    for entry in &entries {
        let label = escape(&entry.label);
        let _ = writeln!(
            out,
            "<button type=\"button\" aria-pressed=\"true\" data-label=\"{label}\" style=\"--light: {}; --dark: {}\">{}{label}</button>",
            entry.colour.light,
            entry.colour.dark,
            sample(entry)
        );
    }
    if more > 0 {
        let _ = writeln!(out, "<span class=\"more\">… and {more} more</span>");
    }
    out.push_str("</div>\n");
    out
}

/// What the curves of a legend entry look like, as a small drawing in the colour of the page.
fn sample(entry: &Entry) -> String {
    let mut out = "<svg width=\"30\" height=\"14\" aria-hidden=\"true\">".to_owned();
    let opacity = if entry.pale { PALE } else { 1.0 };
    let area = |x: u32, width: u32, opacity: f64| {
        format!(
            "<rect x=\"{x}\" y=\"1\" width=\"{width}\" height=\"12\" style=\"fill: var(--colour)\" opacity=\"{opacity}\"/>"
        )
    };
    match entry.area {
        Some(Style::Band) => out.push_str(&area(0, 30, AREA)),
        Some(_) => out.push_str(&area(8, 14, opacity)),
        None => {}
    }
    if let Some(style) = entry.line {
        let dashes = match style {
            Style::Dashed => " stroke-dasharray=\"7 4\"",
            Style::Dotted => " stroke-dasharray=\"2 3\"",
            _ => "",
        };
        let _ = write!(
            out,
            "<path d=\"M0 7H30\" style=\"stroke: var(--colour)\" stroke-width=\"2\" opacity=\"{opacity}\"{dashes}/>"
        );
    }
    if entry.marks {
        out.push_str(
            "<circle cx=\"15\" cy=\"7\" r=\"4\" style=\"stroke: var(--colour); fill: none\" stroke-width=\"2\"/>",
        );
    }
    out + "</svg>"
}

/// The colours of a figure on white, and what they become on dark.
struct Ink {
    shades: Shades,
    dark: BTreeMap<String, String>,
}

impl Ink {
    fn new(figure: &Figure) -> Ink {
        let dark = DARK.iter().map(|[light, dark]| ((*light).to_owned(), (*dark).to_owned())).collect();
        Ink { shades: Shades::of(figure), dark }
    }

    /// The colour as the script takes it, its partner noted.
    fn use_of(&mut self, colour: &Colour) -> String {
        self.dark.insert(colour.light.clone(), colour.dark.clone());
        colour.light.clone()
    }

    /// The same, transparent.
    fn area(&mut self, colour: &Colour) -> String {
        let [light, dark] = [&colour.light, &colour.dark].map(|c| format!("{c}{:02x}", (AREA * 255.0).round() as u8));
        self.dark.insert(light.clone(), dark);
        light
    }
}

/// Names the axis of a panel the way plotly counts: x, x2, x3, …
fn axis_name(letter: &str, panel: usize) -> String {
    if panel == 0 { letter.to_owned() } else { format!("{letter}{}", panel + 1) }
}

fn traces(figure: &Figure, ink: &mut Ink) -> Vec<Value> {
    let mut traces = Vec::new();
    let mut seen = BTreeSet::new();
    let (entries, _) = frame::legend(figure);
    let listed: BTreeSet<&str> = entries.iter().map(|e| e.label.as_str()).collect();
    // in an image, a label of several colours stands in the legend in grey, as a trace without points
    for entry in entries.iter().filter(|e| e.colour == Colour::many()) {
        let mode = match (entry.line, entry.marks) {
            (None, _) => "markers",
            (_, true) => "lines+markers",
            (_, false) => "lines",
        };
        seen.insert(entry.label.clone());
        let colour = ink.use_of(&entry.colour);
        traces.push(json!({
            "type": "scatter", "x": [null], "y": [null], "mode": mode, "legendrank": 2000,
            "name": plain(&entry.label), "legendgroup": entry.label, "showlegend": true,
            "line": { "color": colour, "width": 2, "dash": dash(entry.line.unwrap_or(Style::Solid)) },
            "marker": { "color": GROUND, "size": 8, "line": { "color": colour, "width": 2 } },
        }));
    }
    let several = figure.panels.len() > 1;
    for (i, (panel, axes)) in figure.panels.iter().zip(frame::axes(figure)).enumerate() {
        let crowd = frame::crowded(panel);
        let (x_form, y_form) = (Form::of(axes.x), Form::of(axes.y));
        for series in frame::layers(panel) {
            let named = listed.contains(series.label.as_str());
            let said = panel.title.is_empty() || panel.title == series.label;
            let place = if several && !said { format!("<br>{}", plain(&panel.title)) } else { String::new() };
            let value = ink.shades.value(series).filter(|text| !series.label.contains(text.as_str()));
            let value = value.map_or(String::new(), |text| format!("<br>{}", plain(&text)));
            let (x, y) = (hover("x", &panel.x, x_form.power), hover("y", &panel.y, y_form.power));
            let mut trace = json!({
                "type": if series.x.len() > 5000 { "scattergl" } else { "scatter" },
                "x": x_form.numbers(frame::points(panel, series).map(|p| p.0)),
                "y": y_form.numbers(frame::points(panel, series).map(|p| p.1)),
                "xaxis": axis_name("x", i), "yaxis": axis_name("y", i),
                "name": plain(&series.label), "legendgroup": series.label,
                "showlegend": named && frame::drawn(panel, series).next().is_some() && seen.insert(series.label.clone()),
                "connectgaps": false,
                "hovertemplate": format!("{x}<br>{y}<extra>{}{value}{place}</extra>", plain(&series.label)),
            });
            let shade = ink.shades.colour(series);
            let colour = ink.use_of(&shade);
            let pale = series.emphasis == Emphasis::Pale;
            if pale {
                trace["opacity"] = json!(PALE);
            }
            match series.style {
                Style::Marks => {
                    trace["mode"] = json!("markers");
                    trace["marker"] = if crowd {
                        json!({ "color": colour, "size": 4 })
                    } else {
                        json!({ "color": GROUND, "size": 8, "line": { "color": colour, "width": 2 } })
                    };
                }
                Style::Band => {
                    let (x, y) = outline(panel, series, axes.y);
                    trace["x"] = json!(x_form.numbers(x.into_iter()));
                    trace["y"] = json!(y_form.numbers(y.into_iter()));
                    trace["type"] = json!("scatter");
                    trace["mode"] = json!("lines");
                    trace["fill"] = json!("toself");
                    trace["fillcolor"] = json!(ink.area(&shade));
                    trace["line"] = json!({ "width": 0, "color": colour });
                    trace["hoverinfo"] = json!("skip");
                    trace["hovertemplate"] = Value::Null;
                }
                Style::Bars => {
                    trace["type"] = json!("bar");
                    trace["marker"] = json!({ "color": colour });
                    if !series.base.is_empty() {
                        // the script counts the bar from its foot
                        let feet = |i: usize| frame::base(panel, series, i).unwrap_or(axes.y.from);
                        let count = series.x.len().min(series.y.len());
                        trace["base"] = json!(y_form.numbers((0..count).map(feet)));
                        trace["y"] =
                            json!(y_form.numbers(frame::points(panel, series).enumerate().map(|(i, p)| p.1 - feet(i))));
                    }
                }
                Style::Solid | Style::Dashed | Style::Dotted => {
                    let alone = lonely(panel, series);
                    if !alone.is_empty() {
                        let mut dots = trace.clone();
                        dots["x"] = Value::from(x_form.numbers(alone.iter().map(|p| p.0)));
                        dots["y"] = Value::from(y_form.numbers(alone.iter().map(|p| p.1)));
                        dots["mode"] = json!("markers");
                        dots["marker"] = json!({ "color": colour, "size": 5 });
                        dots["showlegend"] = json!(false);
                        traces.push(dots);
                    }
                    let width = if pale || crowd { 1.0 } else { 2.0 };
                    let dash = dash(frame::line_style(series));
                    trace["mode"] = json!("lines");
                    trace["line"] = json!({ "color": colour, "width": width, "simplify": false, "dash": dash });
                }
            }
            traces.push(trace);
        }
    }
    if let Some((_, range)) = &ink.shades.bar {
        // carries the colour bar
        let value = range.measure(range.from);
        traces.push(json!({
            "type": "scatter", "x": [null], "y": [null], "mode": "markers", "showlegend": false, "hoverinfo": "skip",
            "marker": { "color": [value], "coloraxis": "coloraxis" },
        }));
    }
    traces
}

/// The outlines of the pieces of a band: along the upper edge, back along the lower, a gap.
fn outline(panel: &Panel, series: &Series, range: Range) -> (Vec<f64>, Vec<f64>) {
    let points: Vec<(usize, (f64, f64))> = frame::points(panel, series).enumerate().collect();
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for piece in points.split(|(_, p)| !frame::drawable(*p)).filter(|piece| !piece.is_empty()) {
        let lower = piece.iter().rev().map(|(i, p)| (p.0, frame::base(panel, series, *i).unwrap_or(range.from)));
        for p in piece.iter().map(|(_, p)| *p).chain(lower).chain([(f64::NAN, f64::NAN)]) {
            x.push(p.0);
            y.push(p.1);
        }
    }
    (x, y)
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
fn lonely(panel: &Panel, series: &Series) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = frame::points(panel, series).collect();
    points
        .split(|p| !frame::drawable(*p))
        .filter_map(|piece| if let [point] = piece { Some(*point) } else { None })
        .collect()
}

/// How the numbers of an axis are written.
struct Form {
    /// The power of ten taken out of them, the same as in the static figure.
    power: i32,
    /// Digits after the point; on a logarithmic axis all digits after the first.
    digits: usize,
    scale: Scale,
}

/// Digits of a number, counted from the first digit of the length of its axis: a reader may zoom in ten thousand times
/// before a thousandth of the picture moves.
const DIGITS: i32 = 8;

impl Form {
    fn of(range: Range) -> Form {
        let power = power(range);
        let first = axis::log10(axis::scaled(range.to - range.from, power)).floor() as i32;
        let digits = match range.scale {
            Scale::Linear => (DIGITS - 1 - first).clamp(0, 300),
            Scale::Log => DIGITS - 1,
        };
        Form { power, digits: digits as usize, scale: range.scale }
    }

    /// Numbers for the page; what does not exist is null and interrupts the curve.
    fn numbers(&self, values: impl Iterator<Item = f64>) -> Vec<Value> {
        let digits = self.digits;
        let number = |v: f64| {
            let v = axis::scaled(v, self.power);
            let text = if self.scale == Scale::Log { format!("{v:.digits$e}") } else { format!("{v:.digits$}") };
            text.parse::<f64>().ok().filter(|v| v.is_finite()).map(|v| v + 0.0)
        };
        // a whole number without its point is shorter
        let value = |v: f64| if v.abs() < 1e15 && v.fract() == 0.0 { Value::from(v as i64) } else { Value::from(v) };
        values.map(|v| number(v).map_or(Value::Null, value)).collect()
    }
}

/// `frequency = 121.25 Hz` for the value under the pointer.
fn hover(letter: &str, shown: &Axis, power: i32) -> String {
    let quantity = if shown.quantity.trim().is_empty() { letter } else { shown.quantity.trim() };
    format!("{} = %{{{letter}:.6~g}} {}", plain(quantity), plain(&axis::unit(shown, power)))
}

/// Text that plotly, which reads some tags and templates, shows literally.
fn plain(text: &str) -> String {
    escape(text).replace("&quot;", "\"").replace("&#39;", "'").replace("%{", "%\u{200b}{")
}

/// Sizes of the interactive figure, px. The toolbar stands in the upper margin, above the titles of the panels.
const TOOLBAR: f64 = 36.0;
const BOTTOM: f64 = 60.0;
const ROW_GAP: f64 = 92.0;
const COLUMN_GAP: f64 = 85.0;
const TITLE: f64 = 15.0;
const LABEL: f64 = 14.0;
const TICK: f64 = 13.0;
/// Height of a line of text, part of its size.
const LEADING: f64 = 1.3;
/// Pages narrower than this have one column, by the columns of the wide figure; a wide figure is at least as wide less
/// the margins of the page and of its outer axes.
const NARROW: [f64; 3] = [600.0, 900.0, 1100.0];
const PAGE_MARGINS: f64 = 150.0;
/// Longest line of a title above or below a panel of a narrow page, which may be 390 wide.
const NARROW_LINE: f64 = 250.0;
/// Height that the colour bar needs below the panels of a narrow page.
const BAR: f64 = 90.0;

/// The power of ten that the axis of this range takes out, the same as in the static figure.
fn power(range: Range) -> i32 {
    axis::ticks(range, 6.0).power
}

/// The title of an axis in lines; a panel that does not share the axis of its like says so.
fn axis_title(shown: &Axis, range: Range, own: bool, limit: f64) -> Vec<String> {
    let own = if own { ", own range" } else { "" };
    let text = format!("{}{own}", axis::axis_title(shown, power(range)));
    font::wrap(&text, LABEL, font::Weight::Regular, limit)
}

fn broken(lines: &[String]) -> String {
    lines.iter().map(|l| plain(l)).collect::<Vec<_>>().join("<br>")
}

/// The page that a layout is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Page {
    Wide,
    /// One panel below the other.
    Narrow,
}

fn layout(figure: &Figure, page: Page, ink: &mut Ink) -> Value {
    let count = figure.panels.len().max(1);
    let narrow = page == Page::Narrow;
    let columns = if narrow { 1 } else { frame::grid(figure).0 };
    let rows = count.div_ceil(columns);
    let plot_height = match (columns, rows) {
        (1, 1) => 460.0,
        (1, _) => 270.0,
        (2, 1) => 380.0,
        _ => 270.0,
    };
    let axes = frame::axes(figure);
    let widest = |axes: &Axes| {
        let ticks = axis::ticks(axes.y, 6.0);
        ticks.labels.iter().map(|l| font::width(l, TICK, font::Weight::Regular)).fold(0.0, f64::max)
    };
    let most = |lines: &[Vec<String>]| lines.iter().map(Vec::len).max().unwrap_or(0).max(1) as f64 - 1.0;
    let least = NARROW[columns.clamp(1, 3) - 1] - PAGE_MARGINS;
    let y_titles: Vec<Vec<String>> =
        (figure.panels.iter().zip(&axes)).map(|(p, a)| axis_title(&p.y, a.y, a.own_y, plot_height)).collect();
    let beside = axes.iter().map(widest).fold(0.0, f64::max) + 60.0 + LEADING * LABEL * most(&y_titles);
    let column_gap = if columns == 1 { 0.0 } else { COLUMN_GAP.max(beside) / least };
    let plot_width = ((1.0 - column_gap * (columns as f64 - 1.0)) / columns as f64).max(0.1);
    let limit = if narrow { NARROW_LINE } else { least * plot_width };
    let x_titles: Vec<Vec<String>> =
        (figure.panels.iter().zip(&axes)).map(|(p, a)| axis_title(&p.x, a.x, a.own_x, limit)).collect();
    let titles: Vec<Vec<String>> =
        figure.panels.iter().map(|p| font::wrap(&p.title, TITLE, font::Weight::Bold, limit)).collect();
    // titles of several lines push the rows apart
    let titled = if titles.iter().all(Vec::is_empty) { 0.0 } else { LEADING * TITLE * (1.0 + most(&titles)) };
    let below = LEADING * LABEL * most(&x_titles);
    let bar = if narrow && ink.shades.bar.is_some() { BAR } else { 0.0 };
    let (top, bottom) = (TOOLBAR + titled, BOTTOM + below + bar);
    let row_gap = ROW_GAP - LEADING * TITLE + titled + below;
    let inside = rows as f64 * plot_height + (rows as f64 - 1.0) * row_gap;
    let font = json!({ "family": "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif", "size": LABEL, "color": TEXT });
    let mut layout = json!({
        "height": inside + top + bottom, "autosize": true, "font": font,
        "margin": { "l": if narrow { 60 } else { 70 }, "r": if narrow { 12 } else { 20 }, "t": top, "b": bottom },
        "paper_bgcolor": GROUND, "plot_bgcolor": GROUND, "hovermode": "closest", "dragmode": "zoom",
        "hoverlabel": { "bgcolor": GROUND, "font": { "size": TICK, "color": TEXT } },
        "modebar": { "orientation": "h", "bgcolor": GROUND, "color": LINE, "activecolor": TEXT },
        "barmode": "group", "bargap": 0.2, "showlegend": false, "separators": ".",
        // showing and hiding keeps what the reader has zoomed into
        "uirevision": 1,
        // for images: below the panels
        "legend": { "orientation": "h", "x": 0.5, "xanchor": "center", "y": -(bottom + 4.0) / inside, "yanchor": "top", "font": { "size": LABEL } },
    });
    let mut notes = Vec::new();
    for (i, (panel, own)) in figure.panels.iter().zip(&axes).enumerate() {
        let (column, row) = ((i % columns) as f64, (i / columns) as f64);
        let left = (column * (plot_width + column_gap)).min(1.0);
        let right = (left + plot_width).min(1.0);
        let top = (1.0 - row * (plot_height + row_gap) / inside).clamp(0.0, 1.0);
        let bottom = (top - plot_height / inside).max(0.0);
        let panels = &figure.panels;
        let x_partner = (0..i).find(|&j| frame::alike(&panels[j].x, &panel.x) && axes[j].x == own.x);
        let y_partner = (0..i).find(|&j| frame::alike(&panels[j].y, &panel.y) && axes[j].y == own.y);
        let mut x =
            axis(own.x, [left, right], axis_name("y", i), x_partner.map(|j| axis_name("x", j)), [limit, ROOM[0]]);
        x["title"]["text"] = json!(broken(&x_titles[i]));
        if own.x.scale == Scale::Linear {
            x["nticks"] = json!(if narrow || columns == 3 { 6 } else { 8 });
        }
        layout[axis_name("xaxis", i)] = x;
        let mut y =
            axis(own.y, [bottom, top], axis_name("x", i), y_partner.map(|j| axis_name("y", j)), [plot_height, ROOM[1]]);
        y["title"]["text"] = json!(broken(&y_titles[i]));
        layout[axis_name("yaxis", i)] = y;
        let note = json!({ "x": (left + right) / 2.0, "xref": "paper", "yref": "paper", "xanchor": "center", "showarrow": false });
        let mut title = note.clone();
        title["text"] = json!(format!("<b>{}</b>", broken(&titles[i])));
        title["y"] = json!(top);
        title["yanchor"] = json!("bottom");
        title["yshift"] = json!(2);
        title["font"] = json!({ "size": TITLE });
        if !titles[i].is_empty() {
            notes.push(title);
        }
        if !frame::has_data(panel) {
            let mut empty = note;
            empty["text"] = json!("no data");
            empty["y"] = json!((top + bottom) / 2.0);
            notes.push(empty);
        }
    }
    layout["annotations"] = Value::from(notes);
    if let Some((shown, range)) = ink.shades.bar.clone() {
        layout["coloraxis"] = colour_axis(&shown, range, narrow, -(BOTTOM + below) / inside, ink);
    }
    layout
}

/// The colour bar: upright at the right, or lying below the panels of a narrow page.
fn colour_axis(shown: &Axis, range: Range, narrow: bool, below: f64, ink: &mut Ink) -> Value {
    const STEPS: u32 = 16;
    let scale: Vec<Value> = (0..=STEPS)
        .map(|i| f64::from(i) / f64::from(STEPS))
        .map(|part| json!([part, ink.use_of(&Colour::sequential(part))]))
        .collect();
    let ticks = axis::ticks(range, if narrow { 5.0 } else { 7.0 });
    let title = plain(&axis::axis_title(shown, ticks.power));
    let mut bar = json!({
        "thickness": 16, "outlinecolor": LINE, "outlinewidth": 1, "ticks": "outside", "tickcolor": LINE,
        "tickmode": "array", "tickvals": ticks.at.iter().map(|v| range.measure(*v)).collect::<Vec<_>>(),
        "ticktext": ticks.labels, "tickfont": { "size": TICK }, "title": { "text": title, "side": "right", "font": { "size": LABEL } },
    });
    if narrow {
        bar["orientation"] = json!("h");
        bar["title"]["side"] = json!("top");
        bar["y"] = json!(below);
        bar["yanchor"] = json!("top");
    } else {
        bar["x"] = json!(1.02);
    }
    json!({ "cmin": range.measure(range.from), "cmax": range.measure(range.to), "colorscale": scale, "colorbar": bar })
}

/// The shortest distance between labels at 1, 2 and 5 times a power of ten, decades.
const FINEST: f64 = 0.301;
/// Room that a label needs beside the next, across and upright, px.
const ROOM: [f64; 2] = [42.0, 18.0];

/// An axis; `partner` is the earlier axis of the same quantity and range that it zooms with. `length` and the room of a
/// label are in px.
fn axis(range: Range, domain: [f64; 2], anchor: String, partner: Option<String>, [length, room]: [f64; 2]) -> Value {
    let power = power(range);
    let log = range.scale == Scale::Log;
    let end = |v: f64| if log { axis::log10(v) } else { axis::scaled(v, power) };
    let mut value = json!({
        "domain": domain, "anchor": anchor, "type": if log { "log" } else { "linear" }, "range": [end(range.from), end(range.to)],
        "title": { "standoff": 8, "font": { "size": LABEL } },
        "showline": true, "mirror": true, "linecolor": LINE, "gridcolor": GRID, "zerolinecolor": ZERO,
        "ticks": "outside", "tickcolor": LINE, "exponentformat": if log { "power" } else { "none" }, "separatethousands": false,
        "nticks": 8, "automargin": true, "zeroline": !log && range.from < 0.0, "tickfont": { "size": TICK },
    });
    if log {
        // the script chooses steps of whole decades beyond 0.7 decades per tick, 1, 2 and 5 beyond 0.3
        let digits = FINEST * length / range.span() >= room;
        value["nticks"] = json!((range.span() / if digits { 0.31 } else { 0.71 }).floor().clamp(2.0, 8.0));
        if range.from >= 1e-3 && range.to <= 1e4 {
            value["tickformat"] = json!("~g");
        }
        value["minor"] =
            json!({ "ticks": "outside", "ticklen": 3, "tickcolor": LINE, "showgrid": true, "gridcolor": FINE_GRID });
    }
    if let Some(partner) = partner {
        value["matches"] = json!(partner);
    }
    value
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::samples;

    /// The figure as the script gets it.
    fn made(figure: &Figure) -> (Vec<Value>, Value, Value) {
        let mut ink = Ink::new(figure);
        (traces(figure, &mut ink), layout(figure, Page::Wide, &mut ink), layout(figure, Page::Narrow, &mut ink))
    }

    /// What stands outside of the scripts: nothing there may load anything.
    pub(crate) fn markup(html: &str) -> String {
        let (first, others) = html.split_once("<script>").unwrap_or((html, ""));
        let after = others.split("<script>").map(|part| part.split_once("</script>").map_or(part, |(_, rest)| rest));
        std::iter::once(first).chain(after).collect()
    }

    #[test]
    fn the_page_loads_the_one_script_of_its_folder_and_nothing_else() {
        for dataset in samples::all() {
            let path = format!("../{}", script_name());
            let html = to_html(&dataset.figure, &path);
            let markup = markup(&html);
            assert_eq!(markup.matches("src=").count(), 1);
            assert!(markup.contains(&format!("<script src=\"{path}\"")));
            assert!(markup.contains(&format!("The file <code>{path}</code> is missing")));
            assert!(!markup.contains("href=") && !markup.contains("@import") && !markup.contains("url("));
        }
        assert!(script().contains("plotly.js v") && script().len() > 1_000_000 && !script().contains("MathJax-script"));
        let name = script_name();
        let version = name.strip_prefix("plotly-").and_then(|n| n.strip_suffix(".min.js")).unwrap();
        assert_eq!(version.split('.').filter(|part| part.parse::<u32>().is_ok()).count(), 3, "{name}");
    }

    #[test]
    fn pages_are_small() {
        // the curves twice: as numbers for the script, and as the static figure
        let size = |figure: &Figure| to_html(figure, "").len();
        assert!(size(&samples::response().figure) < 150_000, "{}", size(&samples::response().figure));
        let many = size(&samples::cases(400).figure);
        assert!(many < 6_000_000, "{many}");
    }

    #[test]
    fn a_label_cannot_end_its_script_or_become_a_tag() {
        let html = to_html(&samples::hostile().figure, "a\"><script>alert(1)</script>");
        let markup = markup(&html);
        assert!(!html.contains("<script>alert") && !markup.contains("<b>bold") && !markup.contains("</title><"));
        assert_eq!(html.matches("<script").count(), html.matches("</script>").count());
    }

    #[test]
    fn every_panel_has_axes_and_every_label_one_legend_entry() {
        for dataset in samples::all() {
            let figure = &dataset.figure;
            let (traces, wide, narrow) = made(figure);
            for layout in [wide, narrow] {
                for (i, panel) in figure.panels.iter().enumerate() {
                    let text = layout[axis_name("xaxis", i)]["title"]["text"].as_str().unwrap().replace("<br>", " ");
                    assert!(text.starts_with(&plain(&axis::axis_title(&panel.x, 0))), "{text}");
                    let domain = &layout[axis_name("yaxis", i)]["domain"];
                    assert!(domain[0].as_f64().unwrap() >= 0.0 && domain[0].as_f64() < domain[1].as_f64());
                }
            }
            let shown = traces.iter().filter(|t| t["showlegend"] == true).count();
            let (entries, _) = frame::legend(figure);
            assert_eq!(shown, entries.len());
            let buttons = legend(figure, "figure");
            for entry in entries {
                assert_eq!(buttons.matches(&format!("data-label=\"{}\"", escape(&entry.label))).count(), 1);
            }
        }
    }

    #[test]
    fn every_colour_has_a_partner_on_dark() {
        fn colours(value: &Value, found: &mut BTreeSet<String>) {
            match value {
                Value::String(text) if text.starts_with('#') => {
                    found.insert(text.clone());
                }
                Value::Array(list) => list.iter().for_each(|v| colours(v, found)),
                Value::Object(map) => map.values().for_each(|v| colours(v, found)),
                _ => {}
            }
        }
        for dataset in samples::all() {
            let mut ink = Ink::new(&dataset.figure);
            let mut found = BTreeSet::new();
            traces(&dataset.figure, &mut ink).iter().for_each(|t| colours(t, &mut found));
            colours(&layout(&dataset.figure, Page::Wide, &mut ink), &mut found);
            assert!(found.len() > 5);
            for colour in found {
                assert!(ink.dark.contains_key(&colour), "{}: {colour}", dataset.name);
            }
        }
    }

    #[test]
    fn many_values_have_a_colour_bar_and_logarithmic_axes_their_type() {
        let (traces, wide, narrow) = made(&samples::cases(400).figure);
        assert_eq!(wide["coloraxis"]["colorbar"]["title"]["text"], "Ft (N)");
        assert_eq!((&wide["coloraxis"]["cmin"], &wide["coloraxis"]["cmax"]), (&json!(1.0), &json!(400.0)));
        assert_eq!(narrow["coloraxis"]["colorbar"]["orientation"], "h");
        assert_eq!(traces.iter().filter(|t| t["marker"]["coloraxis"] == "coloraxis").count(), 1);
        // where the labels name something else, the value stands under the pointer
        let (traces, wide, _) = made(&samples::masses().figure);
        let hover = |text: &str| {
            traces.iter().filter(|t| t["hovertemplate"].as_str().is_some_and(|h| h.contains(text))).count()
        };
        assert_eq!(hover("<extra>blade<br>kt = 8 N/mm</extra>"), 1);
        assert_eq!(wide["coloraxis"]["colorbar"]["ticktext"], json!(["1", "3", "10", "30", "100", "300", "1000"]));
        assert_eq!(wide["yaxis3"]["matches"], "y");
        let (_, wide, _) = made(&samples::envelope().figure);
        assert_eq!((&wide["yaxis"]["type"], &wide["yaxis"]["range"]), (&json!("log"), &json!([-1.0, 1.0])));
        assert_eq!(wide["xaxis"]["range"], json!([110.0, 140.0]));
        assert!(wide["coloraxis"].is_null());
    }

    #[test]
    fn gaps_are_null_and_numbers_have_the_digits_of_their_axis() {
        let form = Form::of(Range { from: 0.0, to: 2.0, scale: Scale::Linear });
        assert_eq!(
            json!(form.numbers([1.0, f64::NAN, f64::INFINITY, 0.1 + 0.2].into_iter())),
            json!([1, null, null, 0.3])
        );
        let log = Form::of(Range { from: 1e-9, to: 1e3, scale: Scale::Log });
        assert_eq!(json!(log.numbers([1.234_567_891e-9, 100.0].into_iter())), json!([1.2345679e-9, 100]));
        // an offset takes no digits away from what is seen
        let offset = Form::of(Range { from: 1e6, to: 1e6 + 1e-3, scale: Scale::Linear });
        let values: Vec<f64> = offset.numbers([1e6 + 3e-7].into_iter()).iter().filter_map(Value::as_f64).collect();
        assert!((values[0] - (1e6 + 3e-7)).abs() < 2e-10);
    }
}
