//! The parameters of a law, and what is wrong with their values.

use crate::dimension::Dimension;
use std::fmt;

/// The key of a slip limit.
pub(super) const LIMIT: &str = "limit";
/// The key of the force up to which faces hold once they rest.
pub(super) const STATIC_LIMIT: &str = "static_limit";
/// The key of the number of tangential directions, of laws that leave it open.
pub const TANGENTS: &str = "tangents";

/// The values that a parameter may have; all are finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// More than zero.
    Positive,
    /// Zero or more.
    ZeroOrMore,
    /// Any number.
    Any,
    /// From the first number on, up to the second.
    Within(f64, f64),
    /// A whole number from 1 up to this.
    Count(u32),
    /// A whole number from 0 up to this.
    UpTo(u32),
}

impl Range {
    /// Whether `value` lies in it.
    pub fn has(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Range::Positive => value > 0.0,
                Range::ZeroOrMore => value >= 0.0,
                Range::Any => true,
                Range::Within(least, most) => (least..=most).contains(&value),
                Range::Count(most) => value >= 1.0 && value <= f64::from(most) && value.fract() == 0.0,
                Range::UpTo(most) => value >= 0.0 && value <= f64::from(most) && value.fract() == 0.0,
            }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Range::Positive => write!(f, "more than zero"),
            Range::ZeroOrMore => write!(f, "zero or more"),
            Range::Any => write!(f, "of either sign"),
            Range::Within(least, most) => write!(f, "from {least} to {most}"),
            Range::Count(most) => write!(f, "a whole number from 1 to {most}"),
            Range::UpTo(most) => write!(f, "a whole number from 0 to {most}"),
        }
    }
}

/// One parameter of a law: its key in a study file, its dimension, what it means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Key in `law = { kind = …, KEY = … }`.
    pub key: &'static str,
    /// Physical dimension, for units and for error messages.
    pub dimension: Dimension,
    /// The parameter to whose value the dimension is raised, see [`Parameter::dimension_under`].
    pub power: Option<&'static str>,
    /// What it may be.
    pub range: Range,
    /// Its value when the key is absent, SI; `None` if it must be given.
    pub default: Option<f64>,
    /// One line for the documentation and for editors.
    pub doc: &'static str,
}

impl Parameter {
    /// A parameter within a range.
    pub const fn new(key: &'static str, dimension: Dimension, range: Range, doc: &'static str) -> Self {
        Parameter { key, dimension, power: None, range, default: None, doc }
    }

    /// A parameter that is more than zero.
    pub const fn positive(key: &'static str, dimension: Dimension, doc: &'static str) -> Self {
        Parameter::new(key, dimension, Range::Positive, doc)
    }

    /// The slip limit, N; zero is a joint that carries no force: the free reference of a damper.
    pub const fn limit(doc: &'static str) -> Self {
        Parameter::new(LIMIT, Dimension::FORCE, Range::ZeroOrMore, doc)
    }

    /// The same parameter with its dimension raised to the value of another one.
    pub const fn to_the(self, power: &'static str) -> Self {
        Parameter { power: Some(power), ..self }
    }

    /// Its dimension where `value` gives the values of the other parameters: the power's value is what it is raised to. `None` if that is
    /// no whole number; then it is stated by a plain number in SI, which no unit could be asked of.
    pub fn dimension_under(&self, value: impl Fn(&str) -> Option<f64>) -> Option<Dimension> {
        match self.power {
            None => Some(self.dimension),
            Some(power) => self.dimension.to_the(value(power)?),
        }
    }

    /// What it takes, in words: dimension, range, and what holds without it.
    ///
    /// # Example
    /// ```
    /// let parameter = |law, key| {
    ///     let row = stickslip::law::find(law).unwrap();
    ///     row.parameters.iter().find(|p| p.key == key).unwrap().takes()
    /// };
    /// assert_eq!(parameter("dahl", "limit"), "force (N), zero or more");
    /// assert_eq!(parameter("bouc-wen", "gamma"), "inverse length (1/m) to the power `exponent`, of either sign");
    /// assert_eq!(parameter("friction-contact", "tangents"), "a whole number from 1 to 2; 2 if absent");
    /// ```
    pub fn takes(&self) -> String {
        let power = self.power.map(|power| format!(" to the power `{power}`")).unwrap_or_default();
        let what = match (self.range, self.dimension) {
            (Range::Count(_) | Range::UpTo(_), _) => self.range.to_string(),
            (range, Dimension::NONE) => format!("pure number{power}, {range}"),
            (range, dimension) => format!("{dimension}{power}, {range}"),
        };
        what + &self.default.map(|value| format!("; {value} if absent")).unwrap_or_default()
    }

    /// The same parameter with a value for when its key is absent, SI.
    pub const fn or(self, default: f64) -> Self {
        Parameter { default: Some(default), ..self }
    }
}

/// A dimension in words; what has none is a number.
fn measured(dimension: Dimension) -> String {
    if dimension == Dimension::NONE { "number".to_owned() } else { dimension.to_string() }
}

/// Why a law's parameters are refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LawError {
    /// A value is out of its range.
    #[error("{law}: `{key}` must be a finite {}, {range}, found {value}", measured(*.dimension))]
    Value {
        /// Name of the law.
        law: &'static str,
        /// Key of the parameter.
        key: &'static str,
        /// What is measured by it.
        dimension: Dimension,
        /// What it may be.
        range: Range,
        /// The value that was given, SI.
        value: f64,
    },
    /// The values do not fit each other.
    #[error("{law}: {message}")]
    Inconsistent {
        /// Name of the law.
        law: &'static str,
        /// What is wrong.
        message: String,
    },
}

impl LawError {
    /// The key of the parameter that is wrong, if one alone is.
    pub fn key(&self) -> Option<&'static str> {
        match self {
            LawError::Value { key, .. } => Some(key),
            LawError::Inconsistent { .. } => None,
        }
    }
}

/// Why a law could not be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// Parameters are missing.
    #[error("law `{law}` needs {}", .keys.iter().map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", "))]
    Missing {
        /// Name of the law.
        law: &'static str,
        /// The keys that are missing.
        keys: Vec<&'static str>,
    },
    /// A value is refused.
    #[error(transparent)]
    Value(#[from] LawError),
}
