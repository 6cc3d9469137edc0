//! Layout of the interactive figure in plotly's format: panels, axes, titles and colour bar.

use super::palette::{FINE_GRID, GRID, GROUND, LINE, Palette, TEXT, ZERO, axis_name, plain, power};
use crate::figure::axis::{self, AxisRange};
use crate::figure::colour::Colour;
use crate::figure::font;
use crate::figure::panels::{self, Axes};
use serde_json::{Value, json};
use stickslip_study::dataset::{Axis, Figure, Panel, Scale};

/// Sizes of the interactive figure, px where nothing else is said.
#[derive(Debug, Clone)]
struct LayoutSettings {
    /// Height of the toolbar in the upper margin, above the titles of the panels.
    toolbar: f64,
    /// Height of the lower margin.
    bottom: f64,
    /// Distance between rows of panels.
    row_gap: f64,
    /// Distance between columns of panels.
    column_gap: f64,
    /// Text size of panel titles.
    title_text: f64,
    /// Text size of axis titles.
    label_text: f64,
    /// Text size of tick labels.
    tick_text: f64,
    /// Line height relative to the text size.
    leading: f64,
    /// Margins of the page and of the outer axes.
    page_margins: f64,
    /// Maximum line length of a panel title on a narrow page, which can have a width of 390.
    narrow_line: f64,
    /// Height of the colour bar below the panels of a narrow page.
    colour_bar_height: f64,
    /// Number of ticks of an axis with names, on which twice as many fit.
    named_ticks: f64,
    /// Smallest distance between labels at 1, 2 and 5 times a power of ten, in decades.
    finest_decades: f64,
    /// Space for a label along the horizontal and the vertical axis.
    label_room: [f64; 2],
}

impl Default for LayoutSettings {
    fn default() -> Self {
        LayoutSettings {
            toolbar: 36.0,
            bottom: 60.0,
            row_gap: 92.0,
            column_gap: 85.0,
            title_text: 15.0,
            label_text: 14.0,
            tick_text: 13.0,
            leading: 1.3,
            page_margins: 150.0,
            narrow_line: 250.0,
            colour_bar_height: 90.0,
            named_ticks: 6.0,
            finest_decades: 0.301,
            label_room: [42.0, 18.0],
        }
    }
}

/// Page widths below which the layout has one column, by the number of columns of the wide
/// layout.
///
/// The plots of a wide layout have at least this width minus the margins of the page and of the
/// outer axes.
pub(super) const NARROW: [f64; 3] = [600.0, 900.0, 1100.0];

fn broken(lines: &[String]) -> String {
    lines.iter().map(|l| plain(l)).collect::<Vec<_>>().join("<br>")
}

/// Page width that a layout is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PageWidth {
    Wide,
    /// Panels are in one column.
    Narrow,
}

pub(super) fn layout(figure: &Figure, page: PageWidth, palette: &mut Palette) -> Value {
    let settings = LayoutSettings::default();
    let count = figure.panels.len().max(1);
    let narrow = page == PageWidth::Narrow;
    let columns = if narrow { 1 } else { panels::grid(figure).0 };
    let rows = count.div_ceil(columns);
    let plot_height = match (columns, rows) {
        (1, 1) => 460.0,
        (1, _) => 270.0,
        (2, 1) => 380.0,
        _ => 270.0,
    };
    let axes = panels::axes(figure);
    let widest = |(panel, axes): (&Panel, &Axes)| {
        let ticks = axis::axis_ticks(&panel.y, axes.y, settings.named_ticks);
        ticks.labels.iter().map(|l| font::width(l, settings.tick_text, font::Weight::Regular)).fold(0.0, f64::max)
    };
    let most = |lines: &[Vec<String>]| lines.iter().map(Vec::len).max().unwrap_or(0).max(1) as f64 - 1.0;
    let least = NARROW[columns.clamp(1, 3) - 1] - settings.page_margins;
    let y_titles: Vec<Vec<String>> = (figure.panels.iter().zip(&axes))
        .map(|(p, a)| settings.axis_title(&p.y, a.y, a.y_differs, plot_height))
        .collect();
    let beside = figure.panels.iter().zip(&axes).map(widest).fold(0.0, f64::max)
        + 60.0
        + settings.leading * settings.label_text * most(&y_titles);
    let column_gap = if columns == 1 { 0.0 } else { settings.column_gap.max(beside) / least };
    let plot_width = ((1.0 - column_gap * (columns as f64 - 1.0)) / columns as f64).max(0.1);
    let limit = if narrow { settings.narrow_line } else { least * plot_width };
    let x_titles: Vec<Vec<String>> =
        (figure.panels.iter().zip(&axes)).map(|(p, a)| settings.axis_title(&p.x, a.x, a.x_differs, limit)).collect();
    let titles: Vec<Vec<String>> =
        figure.panels.iter().map(|p| font::wrap(&p.title, settings.title_text, font::Weight::Bold, limit)).collect();
    // Titles with several lines increase the distance between rows.
    let titled = if titles.iter().all(Vec::is_empty) {
        0.0
    } else {
        settings.leading * settings.title_text * (1.0 + most(&titles))
    };
    let below = settings.leading * settings.label_text * most(&x_titles);
    let bar = if narrow && palette.scheme.bar.is_some() { settings.colour_bar_height } else { 0.0 };
    let (top, bottom) = (settings.toolbar + titled, settings.bottom + below + bar);
    let row_gap = settings.row_gap - settings.leading * settings.title_text + titled + below;
    let inside = rows as f64 * plot_height + (rows as f64 - 1.0) * row_gap;
    let font = json!({ "family": "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif", "size": settings.label_text, "color": TEXT });
    let mut layout = json!({
        "height": inside + top + bottom, "autosize": true, "font": font,
        "margin": { "l": if narrow { 60 } else { 70 }, "r": if narrow { 12 } else { 20 }, "t": top, "b": bottom },
        "paper_bgcolor": GROUND, "plot_bgcolor": GROUND, "hovermode": "closest", "dragmode": "zoom",
        "hoverlabel": { "bgcolor": GROUND, "font": { "size": settings.tick_text, "color": TEXT } },
        "modebar": { "orientation": "h", "bgcolor": GROUND, "color": LINE, "activecolor": TEXT },
        "barmode": "group", "bargap": 0.2, "showlegend": false, "separators": ".",
        // Showing and hiding curves keeps the zoom.
        "uirevision": 1,
        // The legend of saved images, below the panels.
        "legend": { "orientation": "h", "x": 0.5, "xanchor": "center", "y": -(bottom + 4.0) / inside, "yanchor": "top", "font": { "size": settings.label_text } },
    });
    let mut notes = Vec::new();
    for (i, (panel, own)) in figure.panels.iter().zip(&axes).enumerate() {
        let (column, row) = ((i % columns) as f64, (i / columns) as f64);
        let left = (column * (plot_width + column_gap)).min(1.0);
        let right = (left + plot_width).min(1.0);
        let top = (1.0 - row * (plot_height + row_gap) / inside).clamp(0.0, 1.0);
        let bottom = (top - plot_height / inside).max(0.0);
        let panels = &figure.panels;
        let x_partner =
            (0..i).find(|&j| !panel.equal_axes && panels::same_quantity(&panels[j].x, &panel.x) && axes[j].x == own.x);
        let y_partner =
            (0..i).find(|&j| !panel.equal_axes && panels::same_quantity(&panels[j].y, &panel.y) && axes[j].y == own.y);
        let mut x = settings.axis(
            own.x,
            [left, right],
            axis_name("y", i),
            x_partner.map(|j| axis_name("x", j)),
            [limit, settings.label_room[0]],
        );
        x["title"]["text"] = json!(broken(&x_titles[i]));
        if own.x.scale == Scale::Linear {
            x["nticks"] = json!(if narrow || columns == 3 { 6 } else { 8 });
        }
        let mut y = settings.axis(
            own.y,
            [bottom, top],
            axis_name("x", i),
            y_partner.map(|j| axis_name("y", j)),
            [plot_height, settings.label_room[1]],
        );
        y["title"]["text"] = json!(broken(&y_titles[i]));
        for (shown, range, made) in [(&panel.x, own.x, &mut x), (&panel.y, own.y, &mut y)] {
            let ticks = axis::axis_ticks(shown, range, settings.named_ticks);
            if shown.whole && ticks.positions.windows(2).all(|pair| pair[1] - pair[0] <= 1.0) {
                (made["tick0"], made["dtick"]) = (json!(0), json!(1));
            }
            if !shown.names.is_empty() {
                made["tickmode"] = json!("array");
                made["tickvals"] = json!(ticks.positions);
                made["ticktext"] = json!(ticks.labels.iter().map(|name| plain(name)).collect::<Vec<_>>());
            }
        }
        if panel.equal_axes {
            (x["visible"], y["visible"]) = (json!(false), json!(false));
            y["scaleanchor"] = json!(axis_name("x", i));
        }
        layout[axis_name("xaxis", i)] = x;
        layout[axis_name("yaxis", i)] = y;
        let note = json!({ "x": (left + right) / 2.0, "xref": "paper", "yref": "paper", "xanchor": "center", "showarrow": false });
        let mut title = note.clone();
        title["text"] = json!(format!("<b>{}</b>", broken(&titles[i])));
        title["y"] = json!(top);
        title["yanchor"] = json!("bottom");
        title["yshift"] = json!(2);
        title["font"] = json!({ "size": settings.title_text });
        if !titles[i].is_empty() {
            notes.push(title);
        }
        if !panels::has_data(panel) {
            let mut empty = note;
            empty["text"] = json!("no data");
            empty["y"] = json!((top + bottom) / 2.0);
            notes.push(empty);
        }
    }
    layout["annotations"] = Value::from(notes);
    if let Some((shown, range)) = palette.scheme.bar.clone() {
        layout["coloraxis"] = settings.colour_axis(&shown, range, narrow, -(settings.bottom + below) / inside, palette);
    }
    layout
}

impl LayoutSettings {
    /// Returns the title of an axis in lines. A range that differs from that of similar panels is
    /// stated.
    fn axis_title(&self, shown: &Axis, range: AxisRange, own: bool, limit: f64) -> Vec<String> {
        let own = if own { ", own range" } else { "" };
        let text = format!("{}{own}", axis::axis_title(shown, power(range)));
        font::wrap(&text, self.label_text, font::Weight::Regular, limit)
    }

    /// Returns the colour bar: vertical at the right, or horizontal below the panels of a narrow
    /// page.
    fn colour_axis(&self, shown: &Axis, range: AxisRange, narrow: bool, below: f64, palette: &mut Palette) -> Value {
        const STEPS: u32 = 16;
        let scale: Vec<Value> = (0..=STEPS)
            .map(|i| f64::from(i) / f64::from(STEPS))
            .map(|part| json!([part, palette.register(&Colour::sequential(part))]))
            .collect();
        let ticks = axis::axis_ticks(shown, range, if narrow { 5.0 } else { 7.0 });
        let title = plain(&axis::axis_title(shown, ticks.power));
        let mut bar = json!({
            "thickness": 16, "outlinecolor": LINE, "outlinewidth": 1, "ticks": "outside", "tickcolor": LINE,
            "tickmode": "array", "tickvals": ticks.positions.iter().map(|v| range.to_linear(*v)).collect::<Vec<_>>(),
            "ticktext": ticks.labels, "tickfont": { "size": self.tick_text }, "title": { "text": title, "side": "right", "font": { "size": self.label_text } },
        });
        if narrow {
            bar["orientation"] = json!("h");
            bar["title"]["side"] = json!("top");
            bar["y"] = json!(below);
            bar["yanchor"] = json!("top");
        } else {
            bar["x"] = json!(1.02);
        }
        json!({ "cmin": range.to_linear(range.from), "cmax": range.to_linear(range.to), "colorscale": scale, "colorbar": bar })
    }

    /// Returns an axis. It zooms together with `partner`, an earlier axis of the same quantity and
    /// range.
    ///
    /// `length` and `room` (the space for a label) are in px.
    fn axis(
        &self,
        range: AxisRange,
        domain: [f64; 2],
        anchor: String,
        partner: Option<String>,
        [length, room]: [f64; 2],
    ) -> Value {
        let power = power(range);
        let log = range.scale == Scale::Log;
        let end = |v: f64| if log { axis::log10(v) } else { axis::scaled(v, power) };
        let mut value = json!({
            "domain": domain, "anchor": anchor, "type": if log { "log" } else { "linear" }, "range": [end(range.from), end(range.to)],
            "title": { "standoff": 8, "font": { "size": self.label_text } },
            "showline": true, "mirror": true, "linecolor": LINE, "gridcolor": GRID, "zerolinecolor": ZERO,
            "ticks": "outside", "tickcolor": LINE, "exponentformat": if log { "power" } else { "none" }, "separatethousands": false,
            "nticks": 8, "automargin": true, "zeroline": !log && range.from < 0.0, "tickfont": { "size": self.tick_text },
        });
        if log {
            // plotly uses steps of whole decades above 0.7 decades per tick, and steps at 1, 2 and
            // 5 above 0.3.
            let digits = self.finest_decades * length / range.span() >= room;
            value["nticks"] = json!((range.span() / if digits { 0.31 } else { 0.71 }).floor().clamp(2.0, 8.0));
            if range.from >= 1e-3 && range.to <= 1e4 {
                value["tickformat"] = json!("~g");
            }
            value["minor"] = json!({ "ticks": "outside", "ticklen": 3, "tickcolor": LINE, "showgrid": true, "gridcolor": FINE_GRID });
        }
        if let Some(partner) = partner {
            value["matches"] = json!(partner);
        }
        value
    }
}
