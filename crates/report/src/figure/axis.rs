//! Axes: range, position of a value, ticks and title.

use libm::exp10;
use stickslip_study::dataset::{Axis, Scale};

/// Range of an axis: finite and not empty. Both ends are positive on a logarithmic axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AxisRange {
    pub from: f64,
    pub to: f64,
    pub scale: Scale,
}

/// Larger values are drawn at the edge, so that the difference of two values stays finite.
const LARGEST: f64 = 1e307;
/// Margin around the data, relative to the range.
pub(crate) const MARGIN: f64 = 0.05;

impl AxisRange {
    /// Returns the default range of an axis without data.
    pub(crate) fn unit(scale: Scale) -> AxisRange {
        AxisRange { from: if scale == Scale::Log { 0.1 } else { 0.0 }, to: 1.0, scale }
    }

    /// Returns the range given for the axis, if it is valid.
    pub(crate) fn fixed(axis: &Axis) -> Option<AxisRange> {
        let [from, to] = axis.range?;
        let good = from.is_finite() && to.is_finite() && from < to && (axis.scale == Scale::Linear || from > 0.0);
        let range = AxisRange { from, to, scale: axis.scale };
        (good && range.span().is_finite() && range.span() > 0.0).then_some(range)
    }

    /// Returns `true` if the axis can show the value.
    pub(crate) fn accepts(scale: Scale, value: f64) -> bool {
        value.is_finite() && (scale == Scale::Linear || value > 0.0)
    }

    pub(crate) fn around(values: impl Iterator<Item = f64>, scale: Scale) -> Option<AxisRange> {
        let range = values.filter(|v| AxisRange::accepts(scale, *v)).map(|v| v.clamp(-LARGEST, LARGEST)).fold(
            None,
            |range: Option<AxisRange>, v| {
                Some(range.map_or(AxisRange { from: v, to: v, scale }, |r| AxisRange {
                    from: r.from.min(v),
                    to: r.to.max(v),
                    scale,
                }))
            },
        )?;
        Some(match scale {
            Scale::Linear => range,
            // Maximum length of an automatic logarithmic axis, in decades below the largest
            // value. Smaller values are rounding errors.
            Scale::Log => AxisRange { from: range.from.max(range.to * power_of_ten(-16)), ..range },
        })
    }

    pub(crate) fn union(self, other: AxisRange) -> AxisRange {
        AxisRange { from: self.from.min(other.from), to: self.to.max(other.to), ..self }
    }

    /// Converts a value to the linear measure of the axis: the value or its logarithm to base
    /// 10.
    pub(crate) fn to_linear(self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => value,
            Scale::Log => log10(value),
        }
    }

    /// Returns the length of the axis in its linear measure.
    pub(crate) fn span(self) -> f64 {
        self.to_linear(self.to) - self.to_linear(self.from)
    }

    /// Returns the relative position of a value: 0 at the lower end, 1 at the upper end.
    pub(crate) fn fraction(self, value: f64) -> f64 {
        (self.to_linear(value) - self.to_linear(self.from)) / self.span()
    }

    /// Returns the value at a relative position: the inverse of [`AxisRange::fraction`].
    pub(crate) fn value_at(self, part: f64) -> f64 {
        match self.scale {
            Scale::Linear => self.from + part * (self.to - self.from),
            Scale::Log => exp10(self.to_linear(self.from) + part * self.span()),
        }
    }

    pub(crate) fn contains(self, value: f64) -> bool {
        value >= self.from && value <= self.to
    }

    fn size(self) -> f64 {
        self.from.abs().max(self.to.abs())
    }

    /// Extends both ends by `margin` times the span. A constant gets a range around it.
    pub(crate) fn widened(self, margin: f64) -> AxisRange {
        // A range narrower than this, relative to its values, is drawn as a constant. Tick
        // labels could not distinguish its ends.
        let narrowest = 1e-12;
        if self.scale == Scale::Log {
            let pad = if self.span() <= narrowest { 0.5 } else { margin * self.span() };
            let factor = exp10(pad);
            let least = f64::MIN_POSITIVE;
            return AxisRange {
                from: (self.from / factor).max(least),
                to: (self.to * factor).clamp(2.0 * least, LARGEST),
                ..self
            };
        }
        let pad = match self.size() {
            size if size < 1.0 / LARGEST => 1.0,
            size if self.span() <= narrowest * size => 0.1 * size,
            _ => margin * self.span(),
        };
        AxisRange { from: self.from - pad, to: self.to + pad, ..self }
    }
}

/// Returns the logarithm to base 10 of a positive number, with the same bits on every machine. The
/// logarithms of system libraries differ in the last bit.
pub(crate) fn log10(value: f64) -> f64 {
    if value.is_nan() || value <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let log = libm::log10(value);
    // The logarithm of a power of ten is an integer.
    let whole = log.round();
    let is_power = (log - whole).abs() < 1e-14 * whole.abs() && power_of_ten(whole as i32) == value;
    if is_power { whole } else { log }
}

/// Returns a correctly rounded power of ten, which may underflow to zero or overflow to
/// infinity.
pub(crate) fn power_of_ten(power: i32) -> f64 {
    format!("1e{power}").parse().unwrap_or(f64::INFINITY)
}

/// Ticks of an axis: positions, labels, minor ticks, and the power of ten factored out of the
/// labels.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Ticks {
    pub positions: Vec<f64>,
    pub labels: Vec<String>,
    pub minor: Vec<f64>,
    pub power: i32,
}

/// Returns about `count` ticks at round values inside the range.
pub(crate) fn ticks(range: AxisRange, count: f64) -> Ticks {
    match range.scale {
        // A logarithmic axis with fewer decades has the ticks of a linear axis, because it may
        // contain no power of ten.
        Scale::Log if range.span() >= 0.7 => logarithmic(range, count),
        _ => linear(range, count),
    }
}

/// Returns the ticks of `axis`: its names if it has any, integers only if its values are
/// integers.
pub(crate) fn axis_ticks(axis: &Axis, range: AxisRange, count: f64) -> Ticks {
    if !axis.names.is_empty() {
        return named(&axis.names, range, count);
    }
    let ticks = ticks(range, count);
    if axis.whole && ticks.positions.iter().any(|at| at.fract() != 0.0) { whole(range, count) } else { ticks }
}

/// Places ticks at every first, second or fifth integer. Wider steps are integers anyway.
fn whole(range: AxisRange, count: f64) -> Ticks {
    let steps = [1.0, 2.0, 5.0];
    let step = steps.into_iter().find(|step| range.to - range.from <= step * count).unwrap_or(steps[2]);
    let (first, last) = ((range.from / step).ceil() as i64, (range.to / step).floor() as i64);
    let at: Vec<f64> = (first..=last).map(|i| i as f64 * step).collect();
    let labels = at.iter().map(|v| signed(format!("{v:.0}"))).collect();
    Ticks { positions: at, labels, minor: vec![], power: 0 }
}

/// Shows all names, or every second, fifth, tenth and so on.
fn named(names: &[String], range: AxisRange, count: f64) -> Ticks {
    let inside: Vec<usize> = (0..names.len()).filter(|i| range.contains(*i as f64)).collect();
    let steps = (0..6).flat_map(|power| [1, 2, 5].map(|digit| digit * 10usize.pow(power)));
    // Number of names per numeric tick: names may stand closer together.
    let fits = |step: &usize| inside.len().div_ceil(*step) as f64 <= 2.0 * count;
    let step = steps.into_iter().find(fits).unwrap_or(usize::MAX);
    let shown: Vec<usize> = inside.into_iter().filter(|i| i.is_multiple_of(step)).collect();
    let labels = shown.iter().map(|i| names[*i].clone()).collect();
    Ticks { positions: shown.iter().map(|i| *i as f64).collect(), labels, minor: vec![], power: 0 }
}

fn linear(range: AxisRange, count: f64) -> Ticks {
    let span = range.to - range.from;
    let rough = span / count.max(1.0);
    let magnitude = power_of_ten(log10(rough).floor() as i32);
    let step =
        [1.0, 2.0, 2.5, 5.0, 10.0].map(|s| s * magnitude).into_iter().find(|s| *s >= 0.999 * rough).unwrap_or(rough);
    let (first, last) = ((range.from / step - 1e-6).ceil(), (range.to / step + 1e-6).floor());
    let number = ((last - first).max(0.0) as usize).min(100);
    let at: Vec<f64> = (0..=number).map(|i| (first + i as f64) * step + 0.0).collect();
    // Numbers with five digits before the decimal point or three zeros after it are hard to
    // read. A power of 1000 is therefore factored out.
    let size = range.size();
    let exponent = log10(size).floor() as i32;
    // The exception: ticks that differ only in their last digits keep their digits.
    let usual = if span < 1e-3 * size { -4..=9 } else { -2..=4 };
    let power = if usual.contains(&exponent) { 0 } else { 3 * exponent.div_euclid(3) };
    let scaled = |v: f64| scaled(v, power);
    let whole = |d: &i32| {
        let digits = scaled(step) * 10f64.powi(*d);
        digits > 0.5 && (digits - digits.round()).abs() < 1e-6 * digits
    };
    let decimals = (0..15).find(whole).unwrap_or(15) as usize;
    let labels = at.iter().map(|v| signed(format!("{:.decimals$}", scaled(*v)))).collect();
    Ticks { positions: at, labels, minor: vec![], power }
}

/// Places about `count` ticks on a logarithmic axis.
///
/// Ticks are at 1, 2 and 5 times the powers of ten, at 1 and 3 times, at the powers, or at
/// every n-th power.
fn logarithmic(range: AxisRange, count: f64) -> Ticks {
    // Up to this number of decades, minor ticks are at 2 to 9 times each power of ten.
    let max_fine_decades = 9.0;
    let decades = range.span();
    let (first, last) = (log10(range.from).floor() as i32, log10(range.to).ceil() as i32);
    let inside = |v: &f64| *v >= range.from * (1.0 - 1e-9) && *v <= range.to * (1.0 + 1e-9) && *v > 0.0;
    let every = |step: i32, digits: &[f64]| -> Vec<f64> {
        let powers = (first..=last).filter(|p| p.rem_euclid(step.max(1)) == 0);
        powers.flat_map(|p| digits.iter().map(move |d| d * power_of_ten(p))).filter(inside).collect()
    };
    let count = count.max(2.0);
    let at = [&[1.0, 2.0, 5.0][..], &[1.0, 3.0], &[1.0]]
        .into_iter()
        .map(|digits| every(1, digits))
        .find(|at| at.len() as f64 <= count + 1.0)
        .unwrap_or_else(|| every((decades / count).ceil() as i32, &[1.0]));
    let minor = match decades {
        d if d <= max_fine_decades => every(1, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
        d if d <= 10.0 * max_fine_decades => every(1, &[1.0]),
        _ => vec![],
    };
    let minor = minor.into_iter().filter(|m| !at.iter().any(|v| (v - m).abs() <= 1e-9 * m)).collect();
    // All labels are decimals, or all are powers: mixed labels are hard to compare.
    let plain = at.iter().all(|v| (0.999e-3..1.001e4).contains(v));
    let labels = at.iter().map(|v| if plain { decimal(*v) } else { powers(*v) }).collect();
    Ticks { positions: at, labels, minor, power: 0 }
}

/// Formats 0.05, 2 or 1000: a round number without trailing zeros.
fn decimal(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Formats 10⁻⁶ or 2·10⁻⁶.
fn powers(value: f64) -> String {
    let power = (log10(value) + 1e-9).floor() as i32;
    match (value / power_of_ten(power)).round() {
        1.0 => format!("10{}", superscript(power)),
        digit => format!("{digit}·10{}", superscript(power)),
    }
}

/// Divides a value by a power of ten.
pub(crate) fn scaled(value: f64, power: i32) -> f64 {
    // In two factors, because 1e-320 has no finite inverse.
    value / 10f64.powi(power / 2) / 10f64.powi(power - power / 2)
}

/// Formats a number with a true minus sign, and zero without a sign.
fn signed(text: String) -> String {
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text,
    }
}

/// Returns the unit of an axis with the power of ten factored out: `Hz`, `10⁻⁶ J`.
pub(crate) fn unit(axis: &Axis, power: i32) -> String {
    let factor = if power == 0 { String::new() } else { format!("10{}", superscript(power)) };
    [factor.as_str(), axis.unit.trim()].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Returns the title of an axis: `frequency (Hz)`, or `energy (10⁻⁶ J)` with a power of ten.
pub(crate) fn axis_title(axis: &Axis, power: i32) -> String {
    let unit = unit(axis, power);
    match (axis.quantity.trim(), unit.as_str()) {
        (quantity, "") => quantity.to_owned(),
        ("", unit) => unit.to_owned(),
        (quantity, unit) => format!("{quantity} ({unit})"),
    }
}

fn superscript(power: i32) -> String {
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

    fn range(from: f64, to: f64, scale: Scale) -> AxisRange {
        AxisRange { from, to, scale }
    }

    fn labels(from: f64, to: f64) -> (Vec<String>, i32) {
        let t = ticks(range(from, to, Scale::Linear), 6.0);
        (t.labels, t.power)
    }

    #[test]
    fn ticks_are_round_and_short() {
        assert_eq!(labels(119.5, 122.5).0, ["119.5", "120.0", "120.5", "121.0", "121.5", "122.0", "122.5"]);
        assert_eq!(labels(-0.3, 0.3).0, ["−0.3", "−0.2", "−0.1", "0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(0.0, 6e-7), (["0", "100", "200", "300", "400", "500", "600"].map(String::from).to_vec(), -9));
        assert_eq!(labels(0.0, 3e300).1, 300);
        for (from, to) in [(0.0, 1e-299), (-1e300, 1e300), (1e9, 1e9 + 1.0), (1.0, 1.0 + 1e-9), (0.0, 0.7)] {
            let t = ticks(range(from, to, Scale::Linear), 6.0);
            assert!((3..=13).contains(&t.positions.len()), "{from} {to}: {t:?}");
            let mut distinct = t.labels.clone();
            distinct.dedup();
            assert_eq!(distinct, t.labels);
        }
    }

    #[test]
    fn no_tick_stands_between_whole_numbers() {
        let count = |from, to, count| {
            axis_ticks(&Axis::new("disks", "").with_whole_numbers(), range(from, to, Scale::Linear), count)
        };
        assert_eq!(count(0.0, 2.1, 7.0).labels, ["0", "1", "2"]);
        assert_eq!(count(-0.4, 5.4, 3.0).labels, ["0", "2", "4"]);
        assert_eq!(count(0.0, 12.0, 5.0).labels, ["0", "5", "10"]);
        assert_eq!(count(0.0, 120.0, 5.0).labels, ["0", "25", "50", "75", "100"]);
        assert!(count(0.2, 0.8, 5.0).positions.is_empty());
    }

    #[test]
    fn logarithmic_ticks_stand_at_powers_of_ten_and_at_2_and_5() {
        let log = |from, to, count| ticks(range(from, to, Scale::Log), count);
        let t = log(0.8, 120.0, 8.0);
        assert_eq!(t.labels, ["1", "2", "5", "10", "20", "50", "100"]);
        assert_eq!(t.positions, [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
        assert_eq!(t.minor, [0.8, 0.9, 3.0, 4.0, 6.0, 7.0, 8.0, 9.0, 30.0, 40.0, 60.0, 70.0, 80.0, 90.0]);
        assert_eq!(log(0.8, 120.0, 4.0).labels, ["1", "3", "10", "30", "100"]);
        assert_eq!(log(1e-6, 1e-2, 6.0).labels, ["10⁻⁶", "10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²"]);
        assert_eq!(log(1e-6, 3e-5, 6.0).labels, ["10⁻⁶", "2·10⁻⁶", "5·10⁻⁶", "10⁻⁵", "2·10⁻⁵"]);
        assert_eq!(log(1e-12, 1e12, 6.0).labels, ["10⁻¹²", "10⁻⁸", "10⁻⁴", "10⁰", "10⁴", "10⁸", "10¹²"]);
        assert_eq!(log(1e-12, 1e12, 6.0).minor.len(), 25 - 7);
        assert_eq!(log(121.0, 123.0, 4.0).labels, ["121.0", "121.5", "122.0", "122.5", "123.0"]);
        for t in [log(1e-308, 1e307, 6.0), log(1e-3, 1e300, 3.0), log(5e-324, 1e-300, 5.0)] {
            assert!(
                (2..=10).contains(&t.positions.len()) && t.positions.iter().all(|v| v.is_finite() && *v > 0.0),
                "{t:?}"
            );
        }
    }

    #[test]
    fn the_logarithm_is_that_of_the_library_but_for_the_last_bits() {
        for i in 0..4000 {
            let v = 10f64.powf(f64::from(i) * 0.15 - 307.0) * (1.0 + f64::from(i % 7) / 7.0);
            assert!((log10(v) - v.log10()).abs() <= 4e-16 * v.log10().abs().max(1.0), "{v}");
        }
        for p in [-3.7, -0.05, 0.0, 0.5, 2.999] {
            assert!((log10(exp10(p)) - p).abs() < 2e-15, "{p}");
        }
        assert!((log10(5e-324) - 5e-324f64.log10()).abs() < 1e-12);
        assert_eq!((-5..=5).map(|p| log10(power_of_ten(p)) as i32).collect::<Vec<_>>(), (-5..=5).collect::<Vec<_>>());
        assert_eq!([log10(1.0), log10(0.0), log10(-1.0)], [0.0, f64::NEG_INFINITY, f64::NEG_INFINITY]);
    }

    #[test]
    fn places_on_a_logarithmic_axis_are_even_in_ratios() {
        let axis = range(1.0, 1e4, Scale::Log);
        assert_eq!([1.0, 10.0, 100.0, 1e4].map(|v| (axis.fraction(v) * 1e12).round() / 1e12), [0.0, 0.25, 0.5, 1.0]);
        let constant = AxisRange::around([3.0, -1.0, 0.0].into_iter(), Scale::Log).unwrap().widened(0.0);
        assert!(constant.from > 0.9 && constant.from < 1.0 && constant.to > 9.0, "{constant:?}");
        assert!(AxisRange::around([0.0, -1.0, f64::NAN].into_iter(), Scale::Log).is_none());
    }

    #[test]
    fn impossible_ends_count_as_absent() {
        let axis = Axis::new("a", "m");
        assert_eq!(AxisRange::fixed(&axis.clone().with_range(2.0, 1.0)), Some(range(1.0, 2.0, Scale::Linear)));
        for [from, to] in [[1.0, 1.0], [f64::NAN, 1.0], [0.0, f64::INFINITY], [f64::MIN, f64::MAX]] {
            assert_eq!(AxisRange::fixed(&Axis { range: Some([from, to]), ..axis.clone() }), None);
        }
        assert_eq!(AxisRange::fixed(&axis.log().with_range(0.0, 1.0)), None);
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
