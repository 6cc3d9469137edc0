//! The parameters of a law, and the errors of their values.

use crate::dimension::Dimension;
use std::fmt;

/// Key of the slip limit.
pub(in crate::law) const LIMIT: &str = "limit";
/// Key of the static slip limit.
pub(in crate::law) const STATIC_LIMIT: &str = "static_limit";
/// Key of the number of tangential directions, for laws that support one or two.
pub const TANGENTS: &str = "tangents";

/// The range of a parameter. All values must be finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// More than zero.
    Positive,
    /// Zero or more.
    ZeroOrMore,
    /// Any number.
    Any,
    /// From the first number to the second, both included.
    Within(f64, f64),
    /// An integer from 1 to this number.
    Count(u32),
    /// An integer from 0 to this number.
    UpTo(u32),
}

impl Range {
    /// Tells whether `value` lies in the range.
    pub fn contains(self, value: f64) -> bool {
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

/// One parameter of a law: key in a study file, dimension, meaning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Key in `law = { kind = …, KEY = … }`.
    pub key: &'static str,
    /// Physical dimension, for units and error messages.
    pub dimension: Dimension,
    /// Key of another parameter; its value is the exponent to which the dimension is raised. See
    /// [`Parameter::dimension_for`].
    pub power: Option<&'static str>,
    /// Permitted values.
    pub range: Range,
    /// Value if the key is absent, SI; `None` if the key is required.
    pub default: Option<f64>,
    /// One line for the documentation and for editors.
    pub doc: &'static str,
}

impl Parameter {
    /// Creates a parameter with a range.
    pub const fn new(key: &'static str, dimension: Dimension, range: Range, doc: &'static str) -> Self {
        Parameter { key, dimension, power: None, range, default: None, doc }
    }

    /// Creates a parameter that is more than zero.
    pub const fn positive(key: &'static str, dimension: Dimension, doc: &'static str) -> Self {
        Parameter::new(key, dimension, Range::Positive, doc)
    }

    /// Creates the slip limit, N. At zero the joint carries no force, which is the frictionless
    /// reference of a damper.
    pub const fn limit(doc: &'static str) -> Self {
        Parameter::new(LIMIT, Dimension::FORCE, Range::ZeroOrMore, doc)
    }

    /// Returns the parameter with its dimension raised to the value of another parameter.
    pub const fn with_power_of(self, power: &'static str) -> Self {
        Parameter { power: Some(power), ..self }
    }

    /// Returns the dimension for given values of the other parameters. `None` if the exponent is
    /// not an integer. The parameter is then a plain number in SI, without a unit.
    pub fn dimension_for(&self, value: impl Fn(&str) -> Option<f64>) -> Option<Dimension> {
        match self.power {
            None => Some(self.dimension),
            Some(power) => self.dimension.pow(value(power)?),
        }
    }

    /// Describes the permitted values in words: dimension, range and default.
    ///
    /// # Example
    /// ```
    /// let parameter = |law, key| {
    ///     let row = stickslip::law::find(law).unwrap();
    ///     row.parameters.iter().find(|p| p.key == key).unwrap().describe_values()
    /// };
    /// assert_eq!(parameter("dahl", "limit"), "force (N), zero or more");
    /// assert_eq!(
    ///     parameter("bouc-wen", "gamma"),
    ///     "inverse length (1/m) to the power `exponent`, of either sign"
    /// );
    /// assert_eq!(
    ///     parameter("friction-contact", "tangents"),
    ///     "a whole number from 1 to 2; default 2"
    /// );
    /// ```
    pub fn describe_values(&self) -> String {
        let power = self.power.map(|power| format!(" to the power `{power}`")).unwrap_or_default();
        let what = match (self.range, self.dimension) {
            (Range::Count(_) | Range::UpTo(_), _) => self.range.to_string(),
            (range, Dimension::NONE) => format!("pure number{power}, {range}"),
            (range, dimension) => format!("{dimension}{power}, {range}"),
        };
        what + &self.default.map(|value| format!("; default {value}")).unwrap_or_default()
    }

    /// Returns the parameter with a default value, SI.
    pub const fn with_default(self, default: f64) -> Self {
        Parameter { default: Some(default), ..self }
    }
}

/// Returns the dimension in words; "number" if it is dimensionless.
fn dimension_text(dimension: Dimension) -> String {
    if dimension == Dimension::NONE { "number".to_owned() } else { dimension.to_string() }
}

/// Why the parameters of a law are rejected.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LawError {
    /// A value is out of range.
    #[error("{law}: `{key}` is {value}; it must be a finite {}, {range}", dimension_text(*.dimension))]
    Value {
        /// Name of the law.
        law: &'static str,
        /// Key of the parameter.
        key: &'static str,
        /// Dimension of the parameter.
        dimension: Dimension,
        /// Permitted values.
        range: Range,
        /// The given value, SI.
        value: f64,
    },
    /// The values are not consistent with each other.
    #[error("{law}: {message}")]
    Inconsistent {
        /// Name of the law.
        law: &'static str,
        /// Description of the inconsistency.
        message: String,
    },
}

impl LawError {
    /// Returns the key of the invalid parameter, if the error concerns a single one.
    pub fn key(&self) -> Option<&'static str> {
        match self {
            LawError::Value { key, .. } => Some(key),
            LawError::Inconsistent { .. } => None,
        }
    }
}

/// Why a law cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// Parameters are missing.
    #[error("law `{law}` needs values for {}", .keys.iter().map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", "))]
    Missing {
        /// Name of the law.
        law: &'static str,
        /// Keys of the missing parameters.
        keys: Vec<&'static str>,
    },
    /// A value is rejected.
    #[error(transparent)]
    Value(#[from] LawError),
}
