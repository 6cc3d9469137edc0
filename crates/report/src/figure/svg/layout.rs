//! Layout of a figure: positions of all parts. Every text is measured before it is placed.

use super::style::{COLOUR_BAR_WIDTH, GAP, LABEL, LEADING, MARGIN, PANEL_TITLE, TICK, TICK_LENGTH, TITLE};
use crate::figure::axis::{self, AxisRange, Ticks};
use crate::figure::clip::{ClipRect, Point};
use crate::figure::colour::Colour;
use crate::figure::font::{self, Weight};
use crate::figure::panels::{self, Axes, ColourScheme, LegendEntry};
use stickslip_study::dataset::{Axis, Figure, Panel};

/// Positions of all parts of a figure.
pub(super) struct Layout {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) title: Vec<String>,
    pub(super) legend: Vec<PlacedEntry>,
    pub(super) panels: Vec<PlotArea>,
    pub(super) scheme: ColourScheme,
    pub(super) bar: Option<Bar>,
}

/// A legend entry and the left end of its first line.
pub(super) struct PlacedEntry {
    pub(super) entry: LegendEntry,
    pub(super) lines: Vec<String>,
    pub(super) x: f64,
    pub(super) y: f64,
}

/// The colour bar.
pub(super) struct Bar {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) height: f64,
    pub(super) range: AxisRange,
    pub(super) ticks: Ticks,
    pub(super) title: Vec<String>,
    /// Distance from the bar to the near edge of its title.
    pub(super) title_offset: f64,
}

/// The plot area of a panel with its axes and texts.
pub(super) struct PlotArea {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) x: AxisRange,
    pub(super) y: AxisRange,
    pub(super) x_differs: bool,
    pub(super) y_differs: bool,
    pub(super) x_ticks: Ticks,
    pub(super) y_ticks: Ticks,
    pub(super) title: Vec<String>,
    pub(super) x_title: Vec<String>,
    pub(super) y_title: Vec<String>,
    /// Distance from the axis to the near edge of the y title.
    pub(super) y_title_offset: f64,
}

impl Layout {
    pub(super) fn new(figure: &Figure) -> Layout {
        let (columns, rows) = panels::grid(figure);
        let (plot_width, plot_height) = match columns {
            1 => (620.0, 380.0),
            2 => (430.0, if rows == 1 { 330.0 } else { 270.0 }),
            _ => (350.0, 240.0),
        };
        let mut panels: Vec<PlotArea> = figure
            .panels
            .iter()
            .zip(panels::axes(figure))
            .map(|(panel, axes)| PlotArea::new(panel, &axes, plot_width, plot_height))
            .collect();
        // Adjacent panels with the same axis share one title at the outer edge.
        for i in 0..panels.len() {
            if i + columns < panels.len() && !panels[i].x_differs && panels[i].x_title == panels[i + columns].x_title {
                panels[i].x_title.clear();
            }
        }
        for i in (0..panels.len()).rev() {
            // Panels with a different x quantity keep their y titles, because a reader expects
            // them there.
            let same = i > 0 && panels::same_quantity(&figure.panels[i].x, &figure.panels[i - 1].x);
            if same && i % columns > 0 && !panels[i].y_differs && panels[i].y_title == panels[i - 1].y_title {
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
        let scheme = ColourScheme::of(figure);
        let full_height = rows as f64 * plot_height;
        let mut bar = scheme.bar.as_ref().map(|(axis, range)| Bar::new(axis, *range, right + GAP, full_height));
        let width = bar.as_ref().map_or(right, Bar::right) + MARGIN;

        let title = font::wrap(&figure.title, TITLE, Weight::Bold, width - 2.0 * MARGIN);
        let mut y = MARGIN + TITLE * LEADING * title.len() as f64;
        let (entries, more) = panels::legend(figure);
        let (legend, bottom) = place_legend(entries, more, width, y);
        y = bottom + 4.0;
        for row in 0..rows {
            let members = (row * columns)..((row + 1) * columns).min(panels.len());
            let lines = panels[members.clone()].iter().map(|p| p.title.len()).max().unwrap_or(0);
            let top = y + 8.0 + PANEL_TITLE * LEADING * lines as f64;
            let below = panels[members.clone()].iter().map(PlotArea::bottom_side).fold(0.0, f64::max);
            for plot in &mut panels[members] {
                plot.top = top;
            }
            y = top + plot_height + below + if row + 1 < rows { 10.0 } else { 0.0 };
        }
        if let (Some(bar), Some(first), Some(last)) = (&mut bar, panels.first(), panels.last()) {
            bar.top = first.top;
            bar.height = last.top + plot_height - first.top;
        }
        Layout { width, height: y + MARGIN, title, legend, panels, scheme, bar }
    }
}

fn widest(ticks: &Ticks) -> f64 {
    ticks.labels.iter().map(|l| font::width(l, TICK, Weight::Regular)).fold(0.0, f64::max)
}

/// Returns the title of an axis in lines. A range that differs from that of similar panels is
/// stated.
fn title(axis: &Axis, ticks: &Ticks, own: bool, limit: f64) -> Vec<String> {
    let own = if own { ", own range" } else { "" };
    font::wrap(&format!("{}{own}", axis::axis_title(axis, ticks.power)), LABEL, Weight::Regular, limit)
}

impl Bar {
    pub(super) fn new(axis: &Axis, range: AxisRange, left: f64, height: f64) -> Bar {
        let ticks = axis::axis_ticks(axis, range, height / 46.0);
        let title_offset = COLOUR_BAR_WIDTH + TICK_LENGTH + 5.0 + widest(&ticks) + 9.0;
        let title = title(axis, &ticks, false, height);
        Bar { left, top: 0.0, height, range, ticks, title, title_offset }
    }

    pub(super) fn right(&self) -> f64 {
        self.left + self.title_offset + LABEL * LEADING * self.title.len() as f64
    }
}

impl PlotArea {
    pub(super) fn new(panel: &Panel, axes: &Axes, width: f64, height: f64) -> PlotArea {
        if panel.equal_axes {
            return PlotArea::of_picture(panel, axes, width, height);
        }
        let Axes { x, y, x_differs, y_differs } = *axes;
        let y_ticks = axis::axis_ticks(&panel.y, y, height / 46.0);
        // Uses as many ticks as the widths of their labels allow.
        let fits =
            |ticks: &Ticks| (widest(ticks) + 16.0) * ticks.labels.len() as f64 <= width && apart(ticks, x, width);
        let x_ticks = (3..=8).rev().map(|n| axis::axis_ticks(&panel.x, x, f64::from(n))).find(fits);
        let x_ticks = x_ticks.unwrap_or_else(|| axis::axis_ticks(&panel.x, x, 2.0));
        let y_title_offset = TICK_LENGTH + 5.0 + widest(&y_ticks) + 9.0;
        PlotArea {
            left: 0.0,
            top: 0.0,
            width,
            height,
            title: font::wrap(&panel.title, PANEL_TITLE, Weight::Bold, width),
            x_title: title(&panel.x, &x_ticks, x_differs, width),
            y_title: title(&panel.y, &y_ticks, y_differs, height),
            x,
            y,
            x_differs,
            y_differs,
            x_ticks,
            y_ticks,
            y_title_offset,
        }
    }

    /// Lays out a picture: equal scales on both axes, without ticks and titles.
    fn of_picture(panel: &Panel, axes: &Axes, width: f64, height: f64) -> PlotArea {
        let (x, y) = panels::equal_scale(axes.x, axes.y, width / height);
        PlotArea {
            left: 0.0,
            top: 0.0,
            width,
            height,
            title: font::wrap(&panel.title, PANEL_TITLE, Weight::Bold, width),
            x_title: Vec::new(),
            y_title: Vec::new(),
            x,
            y,
            x_differs: true,
            y_differs: true,
            x_ticks: Ticks::default(),
            y_ticks: Ticks::default(),
            y_title_offset: 0.0,
        }
    }

    /// Returns the space that the y axis needs left of the plot area.
    pub(super) fn left_side(&self) -> f64 {
        self.y_title_offset + LABEL * LEADING * self.y_title.len() as f64
    }

    /// Returns the space that the x axis needs below the plot area.
    pub(super) fn bottom_side(&self) -> f64 {
        let title = if self.x_title.is_empty() { 0.0 } else { 5.0 + LABEL * LEADING * self.x_title.len() as f64 };
        TICK_LENGTH + 3.0 + TICK * LEADING + title
    }

    /// Returns the length by which the last x label extends beyond the plot area.
    pub(super) fn overhang(&self) -> f64 {
        let (Some(at), Some(label)) = (self.x_ticks.positions.last(), self.x_ticks.labels.last()) else { return 0.0 };
        (self.map((*at, self.y.from)).0 - self.left + 0.5 * font::width(label, TICK, Weight::Regular) - self.width)
            .max(0.0)
    }

    /// Returns the page position of a point. Distant points are moved closer, without visible
    /// effect on lines.
    pub(super) fn map(&self, (x, y): Point) -> Point {
        // Maximum distance of a point from the plot area, in axis lengths.
        let max_distance = 1e6;
        let part = |v: f64, r: AxisRange| r.fraction(v).clamp(-max_distance, max_distance);
        (self.left + self.width * part(x, self.x), self.top + self.height * (1.0 - part(y, self.y)))
    }

    pub(super) fn clip_rect(&self) -> ClipRect {
        ClipRect { left: self.left, top: self.top, right: self.left + self.width, bottom: self.top + self.height }
    }
}

/// Returns `true` if labels at unequal distances do not touch each other.
fn apart(ticks: &Ticks, range: AxisRange, width: f64) -> bool {
    let edges: Vec<(f64, f64)> = (ticks.positions.iter().zip(&ticks.labels))
        .map(|(at, label)| (width * range.fraction(*at), 0.5 * font::width(label, TICK, Weight::Regular)))
        .collect();
    edges.windows(2).all(|w| w[1].0 - w[1].1 - (w[0].0 + w[0].1) >= 8.0)
}

/// Line sample before a label, space after the sample, and space between entries, in px.
pub(super) const SAMPLE: (f64, f64, f64) = (30.0, 7.0, 24.0);

/// Places legend entries in centred rows below `top`, and a note for `more` omitted ones.
///
/// Returns the placed entries and the lower edge.
fn place_legend(entries: Vec<LegendEntry>, more: usize, width: f64, top: f64) -> (Vec<PlacedEntry>, f64) {
    let limit = width - 2.0 * MARGIN;
    let before = SAMPLE.0 + SAMPLE.1;
    struct Item {
        length: f64,
        lines: Vec<String>,
        entry: LegendEntry,
    }
    let broken = |entry: LegendEntry| {
        let lines = font::wrap(&entry.label, LABEL, Weight::Regular, limit - before);
        let text = lines.iter().map(|l| font::width(l, LABEL, Weight::Regular)).fold(0.0, f64::max);
        Item { length: before + text, lines, entry }
    };
    let rest = (more > 0).then(|| LegendEntry {
        label: format!("… and {more} more"),
        colour: Colour::several(),
        line: None,
        marks: false,
        area: None,
        pale: false,
        reference: false,
    });
    let mut rows: Vec<(f64, Vec<Item>)> = Vec::new();
    for item in entries.into_iter().chain(rest).map(broken) {
        match rows.last_mut() {
            Some((used, row)) if *used + SAMPLE.2 + item.length <= limit => {
                *used += SAMPLE.2 + item.length;
                row.push(item);
            }
            _ => rows.push((item.length, vec![item])),
        }
    }
    let mut placed = Vec::new();
    let mut y = top;
    for (used, row) in rows {
        let mut x = ((width - used) / 2.0).max(MARGIN);
        let lines = row.iter().map(|item| item.lines.len()).max().unwrap_or(1).max(1);
        for Item { length, lines, entry } in row {
            placed.push(PlacedEntry { entry, lines, x, y: y + LABEL });
            x += length + SAMPLE.2;
        }
        y += LABEL * (1.5 + LEADING * (lines - 1) as f64);
    }
    (placed, y)
}
