//! What the static and the interactive figure share: the grid of panels, ranges and ticks, the legend, the palette.

use stickslip_study::dataset::{Axis, Figure, Panel, Series, Style};

/// Colours that readers with any colour vision can tell apart (Okabe and Ito, 2008), without the yellow that vanishes
/// on paper. `Series::colour` counts through them and starts again.
pub(crate) const PALETTE: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#222222"];

/// Legend colour of a label that is drawn in several colours.
pub(crate) const MANY_COLOURS: &str = "#555555";

pub(crate) fn colour(index: usize) -> &'static str {
    PALETTE[index % PALETTE.len()]
}

/// Columns and rows of the grid for this many panels: one; two side by side; two by two; then rows of three.
pub(crate) fn grid(panels: usize) -> (usize, usize) {
    let columns = match panels {
        0 | 1 => 1,
        2..=4 => 2,
        _ => 3,
    };
    (columns, panels.div_ceil(columns).max(1))
}

/// The points of a series: pairs, as many as both lists have.
pub(crate) fn points(series: &Series) -> impl Iterator<Item = (f64, f64)> + '_ {
    series.x.iter().copied().zip(series.y.iter().copied())
}

/// Whether a point can be drawn.
pub(crate) fn drawable((x, y): (f64, f64)) -> bool {
    x.is_finite() && y.is_finite()
}

/// Whether the panel has anything to draw.
pub(crate) fn has_data(panel: &Panel) -> bool {
    panel.series.iter().any(|series| points(series).any(drawable))
}

/// An entry of the legend: what all series of one label look like.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    pub label: String,
    pub colour: &'static str,
    /// Line style, if a line carries the label.
    pub line: Option<Style>,
    /// Whether marks carry the label.
    pub marks: bool,
}

/// The legend of a figure: every label once, in order of appearance; a series without label or points has none.
pub(crate) fn legend(figure: &Figure) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    for series in figure.panels.iter().flat_map(|panel| &panel.series) {
        if series.label.trim().is_empty() || !points(series).any(drawable) {
            continue;
        }
        let (line, marks) = match series.style {
            Style::Marks => (None, true),
            style => (Some(style), false),
        };
        match entries.iter_mut().find(|entry| entry.label == series.label) {
            Some(entry) => {
                if entry.colour != colour(series.colour) {
                    entry.colour = MANY_COLOURS;
                }
                entry.line = entry.line.or(line);
                entry.marks |= marks;
            }
            None => entries.push(Entry { label: series.label.clone(), colour: colour(series.colour), line, marks }),
        }
    }
    entries
}

/// Interval of an axis, finite and not empty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range {
    pub from: f64,
    pub to: f64,
}

/// Values beyond this are drawn at the edge, so that differences of two of them stay finite.
const LARGEST: f64 = 1e307;
/// A range narrower than this part of its values is drawn as a constant: ticks could not tell its ends apart.
const NARROWEST: f64 = 1e-12;
/// Free space beyond the data, part of the range.
const MARGIN: f64 = 0.05;
/// Panels of one quantity share their range if none would use less than this part of it.
const SHARE: f64 = 0.2;

impl Range {
    fn around(values: impl Iterator<Item = f64>) -> Option<Range> {
        values.filter(|v| v.is_finite()).map(|v| v.clamp(-LARGEST, LARGEST)).fold(None, |range: Option<Range>, v| {
            Some(range.map_or(Range { from: v, to: v }, |r| Range { from: r.from.min(v), to: r.to.max(v) }))
        })
    }

    fn union(self, other: Range) -> Range {
        Range { from: self.from.min(other.from), to: self.to.max(other.to) }
    }

    pub(crate) fn span(self) -> f64 {
        self.to - self.from
    }

    fn size(self) -> f64 {
        self.from.abs().max(self.to.abs())
    }

    /// Widens by `margin` of the span on both ends; a constant gets a range around it.
    fn widened(self, margin: f64) -> Range {
        let pad = match self.size() {
            size if size < 1.0 / LARGEST => 1.0,
            size if self.span() <= NARROWEST * size => 0.1 * size,
            _ => margin * self.span(),
        };
        Range { from: self.from - pad, to: self.to + pad }
    }
}

/// Ranges of the axes of every panel, x and y.
pub(crate) fn ranges(figure: &Figure) -> Vec<(Range, Range)> {
    let raw: Vec<Option<(Range, Range)>> = figure
        .panels
        .iter()
        .map(|panel| {
            let all = || panel.series.iter().flat_map(|series| points(series).filter(|p| drawable(*p)));
            Some((Range::around(all().map(|p| p.0))?, Range::around(all().map(|p| p.1))?))
        })
        .collect();
    let x = shared(figure, &raw, |panel| &panel.x, |pair| pair.0);
    let y = shared(figure, &raw, |panel| &panel.y, |pair| pair.1);
    let curves = figure.panels.iter().map(|panel| panel.series.iter().all(is_curve));
    curves
        .zip(x.into_iter().zip(y))
        .map(|(curve, (x, y))| {
            // a curve over a parameter fills its axis from end to end; a loop wants air around it
            let x = x.widened(if curve { 0.0 } else { MARGIN });
            let floor = y.from >= 0.0 && y.from <= 0.4 * y.to && y.to > 0.0;
            let y = y.widened(MARGIN);
            (x, if floor { Range { from: 0.0, ..y } } else { y })
        })
        .collect()
}

/// Whether x never goes back (marks do not count).
fn is_curve(series: &Series) -> bool {
    if series.style == Style::Marks {
        return true;
    }
    let mut last = f64::NEG_INFINITY;
    points(series).filter(|p| drawable(*p)).all(|(x, _)| std::mem::replace(&mut last, x) <= x)
}

/// One range per panel; panels of the same quantity and unit share it where that leaves each of them legible, so that
/// they can be compared by eye.
fn shared(
    figure: &Figure,
    raw: &[Option<(Range, Range)>],
    axis: fn(&Panel) -> &Axis,
    pick: fn(&(Range, Range)) -> Range,
) -> Vec<Range> {
    (0..raw.len())
        .map(|i| {
            let alike: Vec<Range> = (0..raw.len())
                .filter(|&j| axis(&figure.panels[j]) == axis(&figure.panels[i]))
                .filter_map(|j| raw[j].as_ref().map(pick))
                .collect();
            let Some(union) = alike.iter().copied().reduce(Range::union) else { return Range { from: 0.0, to: 1.0 } };
            match &raw[i] {
                None => union,
                Some(_) if alike.iter().all(|r| r.span() >= SHARE * union.span()) => union,
                Some(pair) => pick(pair),
            }
        })
        .collect()
}

/// Ticks of an axis: where they are, what stands there, and the power of ten taken out of them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ticks {
    pub at: Vec<f64>,
    pub labels: Vec<String>,
    pub power: i32,
}

/// About `count` ticks at round values inside the range.
pub(crate) fn ticks(range: Range, count: f64) -> Ticks {
    let rough = range.span() / count.max(1.0);
    let magnitude = 10f64.powf(rough.log10().floor());
    let step =
        [1.0, 2.0, 2.5, 5.0, 10.0].map(|s| s * magnitude).into_iter().find(|s| *s >= 0.999 * rough).unwrap_or(rough);
    let (first, last) = ((range.from / step - 1e-6).ceil(), (range.to / step + 1e-6).floor());
    let number = ((last - first).max(0.0) as usize).min(100);
    let at: Vec<f64> = (0..=number).map(|i| (first + i as f64) * step + 0.0).collect();
    // five figures before the point or three zeros after it are hard to read: take a power of a thousand out
    let size = range.size();
    let exponent = size.log10().floor() as i32;
    // (unless the ticks differ in their last figures only)
    let usual = if range.span() < 1e-3 * size { -4..=9 } else { -2..=4 };
    let power = if usual.contains(&exponent) { 0 } else { 3 * exponent.div_euclid(3) };
    let scaled = |v: f64| scaled(v, power);
    let whole = |d: &i32| {
        let digits = scaled(step) * 10f64.powi(*d);
        digits > 0.5 && (digits - digits.round()).abs() < 1e-6 * digits
    };
    let decimals = (0..15).find(whole).unwrap_or(15) as usize;
    let labels = at.iter().map(|v| signed(format!("{:.decimals$}", scaled(*v)))).collect();
    Ticks { at, labels, power }
}

/// A value in units of a power of ten.
pub(crate) fn scaled(value: f64, power: i32) -> f64 {
    value / 10f64.powi(power / 2) / 10f64.powi(power - power / 2) // two factors: 1e-320 has no inverse
}

/// A number with a true minus sign, and without the sign of a zero.
fn signed(text: String) -> String {
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text,
    }
}

/// The unit of an axis, with the power of ten taken out of its numbers: `Hz`, `10⁻⁶ J`.
pub(crate) fn unit(axis: &Axis, power: i32) -> String {
    let factor = if power == 0 { String::new() } else { format!("10{}", superscript(power)) };
    [factor.as_str(), axis.unit.trim()].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ")
}

/// What an axis shows: `frequency (Hz)`; with a power of ten taken out, `energy (10⁻⁶ J)`.
pub(crate) fn axis_title(axis: &Axis, power: i32) -> String {
    let unit = unit(axis, power);
    match (axis.quantity.trim(), unit.as_str()) {
        (quantity, "") => quantity.to_owned(),
        ("", unit) => unit.to_owned(),
        (quantity, unit) => format!("{quantity} ({unit})"),
    }
}

pub(crate) fn superscript(power: i32) -> String {
    let digit = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => c.to_digit(10).and_then(|d| char::from_u32(0x2070 + d)).unwrap_or(c),
    };
    power.to_string().chars().map(digit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    fn labels(from: f64, to: f64) -> (Vec<String>, i32) {
        let t = ticks(Range { from, to }, 6.0);
        (t.labels, t.power)
    }

    #[test]
    fn ticks_are_round_and_short() {
        assert_eq!(labels(119.5, 122.5).0, ["119.5", "120.0", "120.5", "121.0", "121.5", "122.0", "122.5"]);
        assert_eq!(labels(-0.3, 0.3).0, ["−0.3", "−0.2", "−0.1", "0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(0.0, 6e-7), (["0", "100", "200", "300", "400", "500", "600"].map(String::from).to_vec(), -9));
        assert_eq!(labels(0.0, 3e300).1, 300);
        for (from, to) in [(0.0, 1e-299), (-1e300, 1e300), (1e9, 1e9 + 1.0), (1.0, 1.0 + 1e-9), (0.0, 0.7)] {
            let t = ticks(Range { from, to }, 6.0);
            assert!((3..=13).contains(&t.at.len()), "{from} {to}: {t:?}");
            let mut distinct = t.labels.clone();
            distinct.dedup();
            assert_eq!(distinct, t.labels);
        }
    }

    #[test]
    fn a_label_stands_once_in_the_legend() {
        let entries = legend(&samples::response().figure);
        assert_eq!(entries.iter().map(|e| e.label.as_str()).collect::<Vec<_>>(), ["a₁", "a₂", "a₃", "peak"]);
        assert_eq!(entries[3], Entry { label: "peak".into(), colour: MANY_COLOURS, line: None, marks: true });
    }

    #[test]
    fn every_range_is_finite_and_holds_its_data() {
        for dataset in samples::all() {
            for ((x, y), panel) in ranges(&dataset.figure).iter().zip(&dataset.figure.panels) {
                assert!(
                    x.span() > 0.0 && y.span() > 0.0 && x.span().is_finite() && y.span().is_finite(),
                    "{}",
                    panel.title
                );
                for point in panel.series.iter().flat_map(points).filter(|p| drawable(*p)) {
                    assert!(
                        point.0 >= x.from && point.0 <= x.to && point.1 >= y.from && point.1 <= y.to,
                        "{}",
                        panel.title
                    );
                }
            }
        }
    }

    #[test]
    fn units_and_powers_stand_in_brackets() {
        let axis = |quantity: &str, unit: &str| Axis::new(quantity, unit);
        assert_eq!(axis_title(&axis("frequency", "Hz"), 0), "frequency (Hz)");
        assert_eq!(axis_title(&axis("energy", "J"), -6), "energy (10⁻⁶ J)");
        assert_eq!(axis_title(&axis("slip fraction", ""), 0), "slip fraction");
        assert_eq!(axis_title(&axis("ratio", ""), 12), "ratio (10¹²)");
    }
}
