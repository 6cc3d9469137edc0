//! Keys of the tables of a study file: the values that a key takes, its presence and its
//! default.

use stickslip::dimension::Dimension;
use stickslip::law;

/// The schema version that this program reads.
pub const VERSION: i64 = 1;

/// Largest number of masses, repetitions included. Measured: a ring of 20,000 masses and joints
/// is read and checked in 1.2 s of processor time. The time grows with their number.
pub const MAX_MASSES: usize = 20_000;

/// Largest number of points of a study: cases times frequencies.
pub const MAX_POINTS: usize = 100_000_000;

/// Largest number of cases of a study. Each case is resolved and assembled once before anything
/// is computed.
pub const MAX_CASES: usize = 1_000_000;

/// One key of a table.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// Name of the key.
    pub name: &'static str,
    /// The values that it takes.
    pub takes: ValueType,
    /// Presence: required, optional, or optional with a default.
    pub presence: Presence,
    /// One line that describes it.
    pub doc: &'static str,
    /// An example of the value, as TOML.
    pub example: &'static str,
}

/// Presence of a key in its table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Presence {
    /// The key is required.
    Required,
    /// The key may be absent and has no default.
    Optional,
    /// The key may be absent. The default is the content of a TOML string, or a bare value.
    Default(&'static str),
}

/// The values that a key takes.
#[derive(Debug, Clone, Copy)]
pub enum ValueType {
    /// Any text.
    Text,
    /// An identifier.
    Name,
    /// A name or a list of names.
    Names,
    /// Two names of places.
    Pair,
    /// A quantity of a dimension within a range.
    Quantity(Dimension, Bounds),
    /// A whole number within these bounds.
    Count(i64, i64),
    /// `true` or `false`.
    Flag,
    /// Frequencies: one, a list, or a range with these keys.
    Frequencies(&'static [Key]),
    /// A table from a name to a quantity: `{ blade1 = "1 mm" }`.
    ByName(Dimension),
    /// A subtable with these keys.
    Table(&'static [Key]),
    /// A friction law: `{ kind = …, … }`.
    Law,
    /// One of the words that the function lists, each with a line that describes it.
    Choice(fn() -> Vec<(&'static str, &'static str)>),
    /// `[parameters]`: quantities by name.
    Parameters,
    /// `vary`: lists of quantities, or ranges, by parameter.
    Vary,
    /// `over`: the ranges of the two parameters of a map.
    Over,
    /// `[sample]`: the number of draws and the distributions.
    Sample,
    /// `of` in `[sample]`: distributions by parameter.
    Distributions,
    /// `[method]`: `kind` and the options of that method.
    Method,
    /// `[study]`: `kind`, `vary` and the keys of that kind.
    Study,
    /// `repeat`: indices, each with a count or with a first and a last value.
    Repeat,
    /// A list of tables with these keys: `[[mass]]`.
    List(&'static [Key]),
    /// A list of tables with these keys that is read with the tables around it.
    Tables(&'static [Key]),
    /// A table from names to texts.
    Texts,
    /// `fit`: parameters with the range of their values.
    Fit,
    /// A file: its path, or `{ file, name, format }`.
    File,
    /// A table with these keys, or `false`.
    TableOrFalse(&'static [Key]),
    /// A row of the matrices: its name, or its number from 1.
    Row,
    /// A list of rows, or of nodes.
    Rows,
    /// A table from rows to weights, or a list of such tables.
    Weights,
    /// Three numbers, or three quantities of a dimension.
    Vector(Dimension),
    /// A quantity, or a list of quantities.
    Quantities(Dimension, Bounds),
    /// No value, with the reason: a user may look for this key, but the study file has no such
    /// key. The key's `doc` says what to do instead.
    Unsupported(&'static str),
}

/// The range of a quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bounds {
    /// Any finite number.
    Finite,
    /// Zero or more.
    AtLeastZero,
    /// More than zero.
    Positive,
}

/// Returns the range of a law's parameter for the reader. The law itself checks the exact
/// bounds.
pub(crate) fn parameter_bounds(range: law::Range) -> Bounds {
    match range {
        law::Range::Positive | law::Range::Count(_) => Bounds::Positive,
        law::Range::ZeroOrMore | law::Range::UpTo(_) => Bounds::AtLeastZero,
        law::Range::Any | law::Range::Within(..) => Bounds::Finite,
    }
}

impl Bounds {
    /// Returns whether the number is in the range.
    pub fn contains(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Bounds::Finite => true,
                Bounds::AtLeastZero => value >= 0.0,
                Bounds::Positive => value > 0.0,
            }
    }

    /// Describes the range in words.
    pub fn description(self) -> &'static str {
        match self {
            Bounds::Finite => "a finite number",
            Bounds::AtLeastZero => "zero or more",
            Bounds::Positive => "more than zero",
        }
    }
}

impl Key {
    /// Returns whether the key takes a value.
    pub fn is_supported(&self) -> bool {
        !matches!(self.takes, ValueType::Unsupported(_))
    }
}

/// The key of a damping ratio, relative to critical damping.
pub(crate) const DAMPING_RATIO: &str = "damping_ratio";

/// A key that users look for but that does not exist, with the reason and the alternative.
pub const fn unsupported(name: &'static str, why: &'static str, instead: &'static str) -> Key {
    Key { name, takes: ValueType::Unsupported(why), presence: Presence::Optional, doc: instead, example: "" }
}

/// A required key.
pub const fn required(name: &'static str, takes: ValueType, doc: &'static str, example: &'static str) -> Key {
    Key { name, takes, presence: Presence::Required, doc, example }
}

/// A key that may be absent.
pub const fn optional(name: &'static str, takes: ValueType, doc: &'static str, example: &'static str) -> Key {
    Key { name, takes, presence: Presence::Optional, doc, example }
}

/// A key that may be absent, with its default.
pub const fn default(
    name: &'static str,
    takes: ValueType,
    value: &'static str,
    doc: &'static str,
    example: &'static str,
) -> Key {
    Key { name, takes, presence: Presence::Default(value), doc, example }
}

const FROM: Key =
    required("from", ValueType::Quantity(Dimension::FREQUENCY, Bounds::Positive), "first value", "\"119 Hz\"");
const TO: Key = required("to", ValueType::Quantity(Dimension::FREQUENCY, Bounds::Positive), "last value", "\"123 Hz\"");
const POINTS: Key =
    required("points", ValueType::Count(2, MAX_POINTS as i64), "number of values, both ends included", "241");

/// Keys of a range of frequencies.
pub const FREQUENCY_RANGE: &[Key] = &[FROM, TO, POINTS];

/// Keys of the range of a varied parameter.
pub const PARAMETER_RANGE: &[Key] = &[
    FROM,
    TO,
    POINTS,
    default(
        "scale",
        ValueType::Choice(range_scales),
        "linear",
        "spacing of the values: equal differences, or equal ratios",
        "\"log\"",
    ),
];

/// The spacings of the values of a range.
fn range_scales() -> Vec<(&'static str, &'static str)> {
    vec![("linear", "equal differences between neighbours"), ("log", "equal ratios of neighbours")]
}

/// Keys of a range of speeds, which may begin at zero.
pub const SPEED_RANGE: &[Key] = &[
    required("from", ValueType::Quantity(Dimension::FREQUENCY, Bounds::AtLeastZero), "first value", "\"0 rpm\""),
    TO,
    POINTS,
];

/// Keys of a range of frequencies of which only the two ends matter.
pub const END_POINTS_RANGE: &[Key] = &[
    FROM,
    TO,
    default(
        "points",
        ValueType::Count(2, MAX_POINTS as i64),
        "2",
        "number of values of a range; only the two ends of the range matter",
        "2",
    ),
];

/// Keys of a range of frequencies whose points are placed by the curvature of the response.
pub const ADAPTIVE_RANGE: &[Key] = &[
    FROM,
    TO,
    required(
        "tolerance",
        ValueType::Quantity(Dimension::NONE, Bounds::Positive),
        "distance of the curve from the straight lines between its points, relative to its largest amplitude",
        "\"1 %\"",
    ),
];
