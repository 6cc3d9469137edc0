//! Values of a table of the study file, resolved for one case: checked, in SI.

use crate::compile::frequency_amplitude::FrequencyPolynomial;
use crate::syntax::expression::quantity_text;
use crate::syntax::units;
use serde_json::{Map, Value as Json, json};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use stickslip::curve::adaptive;
use stickslip::dimension::Dimension;
use stickslip::law::SharedLaw;

/// Returns the unit in which tables give quantities of this dimension: as the end of a column's
/// name, and as text for a study file.
///
/// The unit is SI, except hertz and degrees, which users type. Returns `None` for a pure
/// number.
pub(crate) fn table_unit(dimension: Dimension) -> Option<(String, String)> {
    let unit = match dimension {
        Dimension::NONE => return None,
        Dimension::FREQUENCY => "Hz".to_owned(),
        Dimension::SWEEP_RATE => "Hz/s".to_owned(),
        Dimension::ANGLE => "deg".to_owned(),
        other => match other.name_and_unit() {
            Some((_, unit)) => unit.to_owned(),
            None => other.to_string(),
        },
    };
    let name = unit.replace("^-", "_to_minus_").replace('^', "").replace('/', "_per_").replace(' ', "_");
    Some((name, unit))
}

/// Converts `si` to the unit of [`table_unit`].
///
/// The result is the shortest number that a user could have typed for this SI value, if there
/// is one. 119.5 Hz stays 119.5 and does not become 119.49999999999999 after the conversion to
/// rad/s and back.
pub(crate) fn in_table_unit(si: f64, dimension: Dimension) -> f64 {
    let unit = match dimension {
        Dimension::FREQUENCY | Dimension::SWEEP_RATE => "Hz",
        Dimension::ANGLE => "deg",
        _ => return si,
    };
    if unit == "Hz" {
        let near = nearest_decimal(si / TAU, decimals(si / TAU));
        if let Some(near) = near.filter(|near| radians(*near) == si) {
            return near;
        }
    }
    let Some(unit) = units::find(unit).filter(|_| si.is_finite()) else { return si };
    let near = si / unit.si_value("1");
    // 17 digits distinguish all doubles; 15 digits of any decimal number survive in a double
    let typed = (15..=17).map(|digits| format!("{near:.*e}", digits - 1)).find(|text| unit.signed_si_value(text) == si);
    typed.and_then(|text| text.parse().ok()).unwrap_or(near)
}

/// Converts cycles to radians with the rounding of the unit `Hz` in a study file.
fn radians(cycles: f64) -> f64 {
    2.0 * cycles * PI
}

/// Returns the number of decimals that gives a number of this size 15 digits, which a double
/// preserves.
fn decimals(size: f64) -> i32 {
    14i32.saturating_sub(size.abs().log10().floor() as i32) // the logarithm of zero is infinite
}

/// Returns the decimal number with `decimals` decimals nearest to `value`; `None` if it needs
/// more than one rounding.
fn nearest_decimal(value: f64, decimals: i32) -> Option<f64> {
    // These powers of ten and whole numbers of 15 digits are exact, so the quotient is the
    // double nearest to the decimal number.
    let power = (0..=22).contains(&decimals).then(|| 10f64.powi(decimals))?;
    let whole = (value * power).round();
    (whole.abs() <= 1e15).then(|| whole / power)
}

/// Converts a frequency in rad/s to the hertz that a user would have typed; see the column
/// `frequency_Hz` of the tables.
///
/// # Example
/// ```
/// use std::f64::consts::TAU;
/// use stickslip_study::hertz;
/// let typed = || (0..2000).map(|i| f64::from(i) / 10.0);
/// assert!(typed().any(|f| f * TAU / TAU != f));
/// assert!(typed().all(|f| hertz(f * TAU) == f));
/// ```
pub fn hertz(omega: f64) -> f64 {
    in_table_unit(omega, Dimension::FREQUENCY)
}

/// Excitation frequencies, rad/s. A range is computed on demand, so its number of points costs
/// no memory.
///
/// The points of a range are equally spaced decimal numbers in hertz: 119 Hz to 123 Hz in 41
/// points contains 119.3 Hz.
#[derive(Debug, Clone, PartialEq)]
pub enum Frequencies {
    /// The frequencies listed in the file.
    List(Vec<f64>),
    /// Equally spaced, both ends included.
    Range {
        /// First frequency, rad/s.
        from: f64,
        /// Last frequency, rad/s.
        to: f64,
        /// Number of points, two or more.
        points: usize,
    },
    /// Placed by the curvature of the response; their number is not known before the run.
    Adaptive {
        /// First frequency, rad/s.
        from: f64,
        /// Last frequency, rad/s.
        to: f64,
        /// Distance of the curve from the straight lines between its points, relative to its
        /// largest amplitude.
        tolerance: f64,
    },
}

impl Frequencies {
    /// Returns the number of frequencies. Adaptive frequencies count their equally spaced
    /// initial points.
    pub fn len(&self) -> usize {
        match self {
            Frequencies::Adaptive { .. } => adaptive::INITIAL_INTERVALS + 1,
            Frequencies::List(list) => list.len(),
            Frequencies::Range { points, .. } => *points,
        }
    }

    /// Returns whether there are no frequencies.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the frequency at `index`, rad/s.
    pub fn get(&self, index: usize) -> Option<f64> {
        match self {
            Frequencies::List(list) => list.get(index).copied(),
            Frequencies::Range { from, to, points } => {
                (index < *points).then(|| range_point(*from, *to, Some(Dimension::FREQUENCY), index, *points))
            }
            Frequencies::Adaptive { from, to, .. } => {
                let points = self.len();
                (index < points).then(|| range_point(*from, *to, Some(Dimension::FREQUENCY), index, points))
            }
        }
    }

    /// Returns the frequency at `index`, Hz, as a user would have typed it.
    pub fn hertz(&self, index: usize) -> Option<f64> {
        self.get(index).map(hertz)
    }

    /// Returns the lowest frequency, rad/s.
    pub fn lowest(&self) -> Option<f64> {
        match self {
            Frequencies::List(list) => list.iter().copied().reduce(f64::min),
            Frequencies::Range { from, to, .. } | Frequencies::Adaptive { from, to, .. } => Some(from.min(*to)),
        }
    }

    /// Returns the highest frequency, rad/s.
    pub fn highest(&self) -> Option<f64> {
        match self {
            Frequencies::List(list) => list.iter().copied().reduce(f64::max),
            Frequencies::Range { from, to, .. } | Frequencies::Adaptive { from, to, .. } => Some(from.max(*to)),
        }
    }

    /// Returns whether no frequency is below the one before it. For a range, its ends decide.
    pub fn is_rising(&self) -> bool {
        match self {
            Frequencies::List(list) => list.is_sorted(),
            Frequencies::Range { from, to, .. } | Frequencies::Adaptive { from, to, .. } => from <= to,
        }
    }

    /// Returns all frequencies, rad/s.
    pub fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.len()).filter_map(|index| self.get(index))
    }
}

/// Returns point `index` of `points` points from `from` to `to` (SI of this dimension).
///
/// Both ends are exact. The points between are the intended decimal numbers in the unit of the
/// tables: 0.1 to 0.7 in seven points contains 0.3, not 0.30000000000000004.
pub(crate) fn range_point(from: f64, to: f64, dimension: Option<Dimension>, index: usize, points: usize) -> f64 {
    if index == 0 || index + 1 >= points {
        return if index == 0 { from } else { to };
    }
    let dimension = dimension.unwrap_or(Dimension::NONE);
    let (start, end) = (in_table_unit(from, dimension), in_table_unit(to, dimension));
    let value = start + (end - start) * (index as f64 / (points - 1) as f64);
    // 15 digits of the larger end: less than the rounding of the sum, and more than users type
    let digits = decimals(start.abs().max(end.abs()));
    let cycles = matches!(dimension, Dimension::FREQUENCY | Dimension::SWEEP_RATE);
    if let Some(value) = nearest_decimal(value, digits).filter(|_| dimension != Dimension::ANGLE) {
        return if cycles { radians(value) } else { value };
    }
    let decimal = match usize::try_from(digits) {
        // Largest number of decimals. A value that needs more is far below 1 in its unit and
        // stays as computed.
        Ok(digits @ ..=300) => format!("{value:.digits$}"),
        _ => format!("{value:e}"),
    };
    let unit = if dimension == Dimension::ANGLE { "deg" } else { "Hz" };
    match units::find(unit).filter(|_| cycles || dimension == Dimension::ANGLE) {
        Some(unit) => unit.signed_si_value(&decimal),
        None => decimal.parse().unwrap_or(value),
    }
}

/// Returns point `index` of `points` points with equal ratios between two positive ends (SI).
///
/// Both ends are exact. The points between are rounded to six significant digits, which a user
/// can type. `libm` gives the same values on every machine.
pub(crate) fn log_range_point([from, to]: [f64; 2], index: usize, points: usize) -> f64 {
    if index == 0 || index + 1 >= points {
        return if index == 0 { from } else { to };
    }
    let part = index as f64 / (points - 1) as f64;
    let value = from * libm::exp(part * libm::log(to / from));
    format!("{value:.5e}").parse().unwrap_or(value).clamp(from, to)
}

/// One resolved value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ResolvedValue {
    Text(String),
    Names(Vec<String>),
    Quantity(f64, Dimension),
    Count(u64),
    Flag(bool),
    Frequencies(Frequencies),
    ByName(BTreeMap<String, f64>, Dimension),
    Vector([f64; 3]),
    Quantities(Vec<f64>, Dimension),
    Sums(Vec<Vec<(String, f64)>>),
    Law(SharedLaw),
    Table(Values),
    Tables(Vec<Values>),
    Texts(BTreeMap<String, String>),
    Fit(Vec<FitRange>),
    OverFrequency(FrequencyPolynomial),
}

/// A fitted parameter with the range of its values, in SI.
#[derive(Debug, Clone, PartialEq)]
pub struct FitRange {
    /// Name of the parameter.
    pub name: String,
    /// Its dimension, if the file determines it.
    pub dimension: Option<Dimension>,
    /// Smallest value.
    pub from: f64,
    /// Largest value.
    pub to: f64,
    /// True if ratios of the parameter count, not differences.
    pub is_log: bool,
}

/// The values of a table by key. An absent key with a default has its default here.
///
/// Every accessor returns `None` if the key is absent or has a value of another type.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Values {
    pub(crate) entries: Vec<(&'static str, ResolvedValue)>,
}

macro_rules! accessors {
    ($($(#[$doc:meta])* $name:ident -> $type:ty { $pattern:pat => $value:expr })*) => {
        impl Values {
            $($(#[$doc])*
            pub fn $name(&self, key: &str) -> Option<$type> {
                match self.get(key)? { $pattern => Some($value), _ => None }
            })*
        }
    };
}

accessors! {
    /// A text, a name, or the word of a choice.
    text -> &str { ResolvedValue::Text(text) => text }
    /// One or several names.
    names -> &[String] { ResolvedValue::Names(names) => names }
    /// A quantity in SI (rad/s for frequencies).
    quantity -> f64 { ResolvedValue::Quantity(value, _) => *value }
    /// A whole number.
    count -> u64 { ResolvedValue::Count(count) => *count }
    /// True or false.
    flag -> bool { ResolvedValue::Flag(flag) => *flag }
    /// Frequencies, rad/s.
    frequencies -> &Frequencies { ResolvedValue::Frequencies(frequencies) => frequencies }
    /// Quantities in SI by name.
    by_name -> &BTreeMap<String, f64> { ResolvedValue::ByName(table, _) => table }
    /// Three numbers.
    vector -> [f64; 3] { ResolvedValue::Vector(vector) => *vector }
    /// One or several quantities, in SI.
    quantities -> &[f64] { ResolvedValue::Quantities(list, _) => list }
    /// Weighted sums of rows.
    sums -> &[Vec<(String, f64)>] { ResolvedValue::Sums(sums) => sums }
    /// A friction law.
    law -> &SharedLaw { ResolvedValue::Law(law) => law }
    /// A table inside the table.
    table -> &Values { ResolvedValue::Table(table) => table }
    /// A list of tables inside the table.
    tables -> &[Values] { ResolvedValue::Tables(tables) => tables }
    /// Texts by name.
    texts -> &BTreeMap<String, String> { ResolvedValue::Texts(texts) => texts }
    /// Fitted parameters.
    fit -> &[FitRange] { ResolvedValue::Fit(ranges) => ranges }
}

impl Values {
    /// An amplitude over the excitation frequency.
    pub(crate) fn over_frequency(&self, key: &str) -> Option<FrequencyPolynomial> {
        match self.get(key)? {
            ResolvedValue::OverFrequency(polynomial) => Some(*polynomial),
            _ => None,
        }
    }

    pub(crate) fn get(&self, key: &str) -> Option<&ResolvedValue> {
        self.entries.iter().find(|(name, _)| *name == key).map(|(_, given)| given)
    }

    /// Converts the values to JSON. A quantity has its number in SI and its reading with a
    /// unit.
    pub fn to_json(&self) -> Json {
        Json::Object(self.entries.iter().map(|(key, given)| ((*key).to_owned(), given.to_json())).collect())
    }
}

impl ResolvedValue {
    fn to_json(&self) -> Json {
        match self {
            ResolvedValue::Text(text) => json!(text),
            ResolvedValue::Names(names) => json!(names),
            ResolvedValue::Quantity(value, dimension) => quantity_json(*value, Some(*dimension)),
            ResolvedValue::Count(count) => json!(count),
            ResolvedValue::Flag(flag) => json!(flag),
            ResolvedValue::Frequencies(Frequencies::List(list)) => json!({ "rad_per_s": list }),
            ResolvedValue::Frequencies(Frequencies::Range { from, to, points }) => {
                json!({ "from_rad_per_s": from, "to_rad_per_s": to, "points": points })
            }
            ResolvedValue::Frequencies(Frequencies::Adaptive { from, to, tolerance }) => {
                json!({ "from_rad_per_s": from, "to_rad_per_s": to, "tolerance": tolerance })
            }
            ResolvedValue::ByName(table, dimension) => {
                let entry = |(name, value): (&String, &f64)| (name.clone(), quantity_json(*value, Some(*dimension)));
                Json::Object(table.iter().map(entry).collect())
            }
            ResolvedValue::Vector(vector) => json!(vector),
            ResolvedValue::Quantities(list, dimension) => {
                json!(list.iter().map(|value| quantity_json(*value, Some(*dimension))).collect::<Vec<_>>())
            }
            ResolvedValue::Sums(sums) => json!(sums),
            ResolvedValue::Law(law) => json!(law),
            ResolvedValue::OverFrequency(FrequencyPolynomial { constant, linear, quadratic }) => {
                json!({ "constant": constant, "per_rad_per_s": linear, "per_rad2_per_s2": quadratic })
            }
            ResolvedValue::Table(table) => table.to_json(),
            ResolvedValue::Tables(tables) => json!(tables.iter().map(Values::to_json).collect::<Vec<_>>()),
            ResolvedValue::Texts(texts) => json!(texts),
            ResolvedValue::Fit(ranges) => {
                let one = |range: &FitRange| {
                    let end = |si: f64| quantity_json(si, range.dimension);
                    (range.name.clone(), json!({ "from": end(range.from), "to": end(range.to), "log": range.is_log }))
                };
                Json::Object(ranges.iter().map(one).collect())
            }
        }
    }
}

/// Formats a quantity as `{ "si": 0.182, "reads": "0.182 kg" }`.
pub(crate) fn quantity_json(si: f64, dimension: Option<Dimension>) -> Json {
    let mut object = Map::new();
    object.insert("si".to_owned(), json!(si));
    object.insert("reads".to_owned(), json!(quantity_text(si, dimension)));
    Json::Object(object)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_has_exact_ends_and_costs_no_memory() {
        let range = Frequencies::Range { from: 0.1, to: 0.7, points: 10_000_000 };
        assert_eq!((range.len(), range.get(0), range.get(9_999_999)), (10_000_000, Some(0.1), Some(0.7)));
        assert_eq!(range.get(10_000_000), None);
        let range = Frequencies::Range { from: TAU, to: 3.0 * TAU, points: 3 };
        assert_eq!(range.iter().collect::<Vec<_>>(), [TAU, 2.0 * TAU, 3.0 * TAU]);
    }

    #[test]
    fn values_come_back_as_typed() {
        let omega = |text: &str| units::find("Hz").unwrap().si_value(text);
        // numbers of up to eight digits
        for i in 1..20_000u32 {
            for text in [format!("{}", f64::from(i) / 40.0), format!("{:.5}", f64::from(i) * 1.7e-4)] {
                assert_eq!(hertz(omega(&text)), text.parse::<f64>().unwrap(), "{text}");
            }
        }
        let lost = (1..2000).filter(|&i| f64::from(i) / 10.0 * TAU / TAU != f64::from(i) / 10.0).count();
        assert!(lost > 100, "the division alone loses {lost} of 2000");
        for (i, text) in ["30", "0.1", "-45", "12.345678", "0"].iter().enumerate() {
            let si = units::find("deg").unwrap().signed_si_value(text);
            assert_eq!(in_table_unit(si, Dimension::ANGLE), text.parse::<f64>().unwrap(), "{i}");
        }
        // the fast path and the unit agree bitwise, also beyond the powers of ten that are
        // exact
        for i in 1..2_000 {
            for text in [format!("{}", f64::from(i) / 40.0), format!("{i}e-20"), format!("{i}e30")] {
                let typed: f64 = text.parse().unwrap();
                assert_eq!((radians(typed), hertz(omega(&text))), (omega(&text), typed), "{text}");
            }
        }
        // a frequency that is not a short number in hertz is the quotient
        assert_eq!(hertz(760.0), 760.0 / TAU);
        assert!(hertz(f64::NAN).is_nan() && hertz(0.0) == 0.0);
    }

    #[test]
    fn points_of_a_range_are_decimal_numbers() {
        let at = |i| range_point(0.1, 0.7, None, i, 7);
        assert_eq!((0..7).map(at).collect::<Vec<_>>(), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]);
        let range = Frequencies::Range { from: 119.0 * TAU, to: 123.0 * TAU, points: 41 };
        for i in 0..41 {
            let typed: f64 = format!("{:.1}", 119.0 + 0.1 * f64::from(i)).parse().unwrap();
            assert_eq!(range.hertz(i as usize), Some(typed));
            assert_eq!(range.get(i as usize), Some(typed * TAU), "typed alone it is the same frequency");
        }
        // many points
        let range = Frequencies::Range { from: 119.5 * TAU, to: 760.0, points: 100_000 };
        let sum: f64 = range.iter().map(hertz).sum();
        assert!((sum / 1e5 - 0.5 * (119.5 + 760.0 / TAU)).abs() < 1e-6, "{sum}");
        // very large and very small ends, a range through zero, and ends that are not decimal
        // numbers
        assert_eq!(range_point(1e-320, 3e-320, None, 1, 3), 2e-320);
        assert_eq!(range_point(1e300, 3e300, None, 1, 3), 2e300);
        assert_eq!(range_point(-0.3, 0.3, None, 3, 7), 0.0);
        let third = range_point(1.0 / 3.0, 2.0 / 3.0, None, 1, 3);
        assert!((third - 0.5).abs() < 1e-15);
    }

    /// Queries on a range do not visit its points: for this range, that would take hours.
    #[test]
    fn range_queries_do_not_visit_points() {
        let most = 1_000_000_000_000;
        let range = Frequencies::Range { from: TAU, to: 101.0 * TAU, points: most + 1 };
        assert_eq!((range.lowest(), range.highest(), range.is_rising()), (Some(TAU), Some(101.0 * TAU), true));
        assert!(!Frequencies::Range { from: 2.0, to: 1.0, points: 3 }.is_rising());
        let list = Frequencies::List(vec![1.0, 3.0, 2.0]);
        assert_eq!((list.is_rising(), list.lowest(), list.highest()), (false, Some(1.0), Some(3.0)));
    }

    #[test]
    fn columns_end_with_their_unit() {
        let name = |dimension| table_unit(dimension).map(|(name, _)| name);
        assert_eq!(name(Dimension::STIFFNESS).as_deref(), Some("N_per_m"));
        assert_eq!(name(Dimension::FREQUENCY).as_deref(), Some("Hz"));
        assert_eq!(name(Dimension::ANGLE).as_deref(), Some("deg"));
        assert_eq!(name(Dimension::INVERSE_VELOCITY).as_deref(), Some("s_per_m"));
        assert_eq!(name(Dimension { kg: 0, m: 2, s: -1, rad: 0 }).as_deref(), Some("m2_s_to_minus_1"));
        assert_eq!(name(Dimension::NONE), None);
    }
}
