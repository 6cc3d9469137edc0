//! Writes the interactive figure as a page with zoom, pan and values under the pointer.
//!
//! The page works offline and in light and dark mode. The `plotly` crate carries the plotting
//! script (plotly.js, MIT). The script is written once per output folder, and pages load it by
//! a relative path. A page without the script shows the static figure.
//!
//! This module writes the figure's data as JSON, because the layout types of the crate have at
//! most eight axes. The legend is part of the page and not of the plot: it wraps at any width
//! and covers nothing.

mod layout;
mod palette;
mod traces;

use crate::figure::panels::{self, AREA, LegendEntry, PALE};
use crate::figure::svg::escape;
use crate::output::result_file::{File, Output, ReportError};
use layout::{NARROW, PageWidth, layout};
use palette::{Palette, plain};
use serde_json::json;
use std::fmt::Write;
use std::sync::OnceLock;
use stickslip_study::dataset::{Dataset, Figure, Style};
use traces::traces;

/// The output `html`.
pub const OUTPUT: Output = Output {
    name: "html",
    summary: "figure.html, interactive; all figures share one script in the folder above",
    make: files,
    sink: None,
    is_default: true,
};

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    let page = to_html(&dataset.figure, &format!("../{}", script_name()));
    Ok(vec![File::new("figure.html", page), File::shared(script_name(), script())])
}

/// Returns the figure as a complete page.
///
/// `script_path` is the path from the page to a file with the name [`script_name`] and the
/// content [`script`].
pub fn to_html(figure: &Figure, script_path: &str) -> String {
    let title = escape(&figure.title);
    let body = format!("<h1>{title}</h1>\n{}", fragment(figure, "figure"));
    document(&title, "body { max-width: 1280px; } h1 { text-align: center; }", &body, script_path)
}

/// Returns a complete page around a body with figures. `title` must already be escaped.
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
         <p class=\"lost\">The file <code>{path}</code> is missing, so the figures are static. Copy it from the \
         folder of results that this page comes from.</p>\n{body}\n</body>\n</html>\n"
    )
}

// The scroll bar is always visible, because figures use the page width at the time of drawing.
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

/// Draws a figure in its element: in one column on a narrow page, and in light or dark colours.
///
/// A saved image has a title and a legend, and is light.
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

/// Returns plotly.js without the mathematics typesetter (2 MB) that the crate appends.
pub fn script() -> &'static str {
    static SCRIPT: OnceLock<String> = OnceLock::new();
    SCRIPT.get_or_init(|| {
        let both = plotly::Plot::offline_js_sources();
        let first = both.split_once('>').map_or("", |(_, rest)| rest);
        first.split_once("</script>").map_or(first, |(script, _)| script).trim_start().to_owned()
    })
}

/// Returns the script's file name with its version: `plotly-3.0.1.min.js`.
pub fn script_name() -> String {
    let version = script().split_once("plotly.js v").map_or("", |(_, rest)| rest);
    let end = version.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(0);
    match version[..end].trim_matches('.') {
        "" => "plotly.min.js".to_owned(),
        version => format!("plotly-{version}.min.js"),
    }
}

/// Returns the figure for a page: interactive on screen, static in print or without the script.
pub(crate) fn fragment(figure: &Figure, id: &str) -> String {
    let data = traces_and_layouts(figure);
    let height = data["wide"]["height"].as_f64().unwrap_or(0.0);
    // A `<` in a label could close the script element.
    let data = data.to_string().replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029");
    format!(
        "<div class=\"figure\">\n{}<div id=\"{id}\" class=\"live\" style=\"min-height: {height}px\"></div>\n\
         <div class=\"still\">{}</div>\n</div>\n<script>stickslip(\"{id}\", {data});</script>",
        legend(figure, id),
        crate::figure::svg::to_svg(figure)
    )
}

/// Returns the figure as data for plotly.js: the traces, a layout for wide and one for narrow
/// pages, and the dark counterpart of every light colour.
fn traces_and_layouts(figure: &Figure) -> serde_json::Value {
    let (columns, _) = panels::grid(figure);
    let mut palette = Palette::new(figure);
    let data = traces(figure, &mut palette);
    let wide = layout(figure, PageWidth::Wide, &mut palette);
    let narrow = layout(figure, PageWidth::Narrow, &mut palette);
    json!({
        "data": data, "wide": wide, "narrow": narrow, "dark": palette.dark, "title": plain(&figure.title),
        "break": NARROW[columns.clamp(1, 3) - 1],
    })
}

/// Returns the figure as data for plotly.js, for a program that draws it itself.
///
/// The object has the traces (`data`), a layout for `wide` and for `narrow` pages, the dark
/// counterpart of every light colour (`dark`), and the `axes` of every panel: quantity, unit,
/// scale, and the power of ten that the traces leave out.
pub fn plot(figure: &Figure) -> serde_json::Value {
    let mut plot = traces_and_layouts(figure);
    let axis = |axis: &stickslip_study::dataset::Axis, range| json!({ "quantity": axis.quantity, "unit": axis.unit, "scale": axis.scale, "power": palette::power(range) });
    let axes = figure.panels.iter().zip(panels::axes(figure));
    plot["axes"] = axes
        .map(|(panel, axes)| json!({ "title": panel.title, "x": axis(&panel.x, axes.x), "y": axis(&panel.y, axes.y) }))
        .collect();
    plot
}

/// Returns the legend: buttons that show and hide curves.
fn legend(figure: &Figure, id: &str) -> String {
    let (entries, more) = panels::legend(figure);
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

/// Returns the sample of a legend entry as a small drawing.
fn sample(entry: &LegendEntry) -> String {
    let mut out = "<svg width=\"30\" height=\"14\" aria-hidden=\"true\">".to_owned();
    let opacity = if entry.pale { PALE } else { 1.0 };
    let area = |x: u32, width: u32, opacity: f64| {
        format!(
            "<rect x=\"{x}\" y=\"1\" width=\"{width}\" height=\"12\" style=\"fill: var(--colour)\" opacity=\"{opacity}\"/>"
        )
    };
    match entry.area {
        Some(Style::Warning) => {
            out.push_str(
                "<path d=\"M11 10L15 3L19 10Z\" fill=\"none\" style=\"stroke: var(--colour)\" stroke-width=\"1.5\"/>",
            );
        }
        Some(Style::Missing) => {
            out.push_str("<path d=\"M12 4L18 10M12 10L18 4\" style=\"stroke: var(--colour)\" stroke-width=\"1.5\"/>");
        }
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

#[cfg(test)]
pub(crate) mod tests {
    use super::palette::axis_name;
    use super::*;
    use crate::figure::axis;
    use crate::samples;
    use serde_json::Value;
    use std::collections::BTreeSet;

    /// Returns traces, wide layout and narrow layout, as the script receives them.
    fn made(figure: &Figure) -> (Vec<Value>, Value, Value) {
        let mut palette = Palette::new(figure);
        (
            traces(figure, &mut palette),
            layout(figure, PageWidth::Wide, &mut palette),
            layout(figure, PageWidth::Narrow, &mut palette),
        )
    }

    /// Returns the page without its scripts; nothing in this part may load a resource.
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
        // The page contains the curves twice: as numbers for the script and in the static
        // figure.
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
            let (entries, _) = panels::legend(figure);
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
            let mut palette = Palette::new(&dataset.figure);
            let mut found = BTreeSet::new();
            traces(&dataset.figure, &mut palette).iter().for_each(|t| colours(t, &mut found));
            colours(&layout(&dataset.figure, PageWidth::Wide, &mut palette), &mut found);
            assert!(found.len() > 5);
            for colour in found {
                assert!(palette.dark.contains_key(&colour), "{}: {colour}", dataset.name);
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
        // If the labels name something else, the pointer shows the value.
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
}
