//! Compiled statements of a study file: expressions are parsed and locations are known, but
//! nothing is evaluated.

use crate::error::{Location, Problem};
use crate::expression::{Expression, Value, described, displayed};
use crate::key::Within;
use crate::values::{Frequencies, Given, Values};
use std::collections::BTreeMap;
use stickslip::dimension::Dimension;
use stickslip::law::{LawError, LawInfo, Parameter, SharedLaw};

/// A quantity as it stands in a text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Quantity {
    pub location: Location,
    /// Start of its text in the source, see [`crate::document::Content::Text`].
    pub inner: Option<usize>,
    pub text: String,
    pub expression: Expression,
}

#[derive(Debug, Clone)]
pub(crate) struct StatedTable {
    pub location: Location,
    /// The indices of the repetition that states the table, in words; empty without a
    /// repetition.
    pub turn: String,
    pub entries: Vec<StatedEntry>,
}

#[derive(Debug, Clone)]
pub(crate) struct StatedEntry {
    pub key: &'static str,
    /// Location of the value; that of the table if the value is a default.
    pub location: Location,
    pub value: Stated,
}

/// Names of rows with their locations and weights.
pub(crate) type Weights = Vec<(String, Location, Quantity)>;

/// Permitted order of the ends of a range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    Rising,
    /// The second end may lie below the first, but must differ from it.
    Any,
}

#[derive(Debug, Clone)]
pub(crate) enum Stated {
    Fixed(Given),
    Names(Vec<(String, Location)>),
    Quantity { quantity: Quantity, dimension: Dimension, within: Within, example: &'static str },
    List(Vec<Quantity>, Within),
    Range { from: Quantity, to: Quantity, points: usize, within: Within, order: Order },
    Adaptive { from: Quantity, to: Quantity, tolerance: Quantity },
    ByName(Vec<(String, Location, Quantity)>, Dimension),
    Vector(Vec<Quantity>, Dimension, &'static str),
    Quantities(Vec<Quantity>, Dimension, Within, &'static str),
    Sums(Vec<Weights>),
    Law(&'static LawInfo, StatedTable),
    Table(StatedTable),
}

impl StatedTable {
    pub fn entry(&self, key: &str) -> Option<&StatedEntry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    /// Appends the indices of the repetition to a message.
    pub fn with_turn(&self, message: &str) -> String {
        if self.turn.is_empty() { message.to_owned() } else { format!("{message} ({})", self.turn) }
    }

    /// Calls `each` with the key, the quantity and its dimension (if the schema defines it) for
    /// every quantity in the table.
    pub fn each_quantity(&self, each: &mut dyn FnMut(&'static str, &Quantity, Option<Dimension>)) {
        for entry in &self.entries {
            match &entry.value {
                Stated::Fixed(_) | Stated::Names(_) => {}
                Stated::Quantity { quantity, dimension, .. } => each(entry.key, quantity, Some(*dimension)),
                Stated::Vector(parts, dimension, _) | Stated::Quantities(parts, dimension, ..) => {
                    parts.iter().for_each(|q| each(entry.key, q, Some(*dimension)));
                }
                Stated::Sums(sums) => {
                    sums.iter().flatten().for_each(|(_, _, q)| each(entry.key, q, Some(Dimension::NONE)));
                }
                Stated::List(list, _) => list.iter().for_each(|q| each(entry.key, q, Some(Dimension::FREQUENCY))),
                Stated::Range { from, to, .. } => {
                    each(entry.key, from, None);
                    each(entry.key, to, None);
                }
                Stated::Adaptive { from, to, tolerance } => {
                    each(entry.key, from, None);
                    each(entry.key, to, None);
                    each(entry.key, tolerance, Some(Dimension::NONE));
                }
                Stated::ByName(list, dimension) => {
                    list.iter().for_each(|(_, _, q)| each(entry.key, q, Some(*dimension)));
                }
                Stated::Law(_, table) | Stated::Table(table) => table.each_quantity(each),
            }
        }
    }

    /// Returns the location of a key's value, or of a name in it; that of the table if the key
    /// is absent.
    pub fn location_of(&self, key: &str, name: Option<&str>) -> &Location {
        let Some(entry) = self.entry(key) else { return &self.location };
        let inside = name.and_then(|name| match &entry.value {
            Stated::Names(names) => names.iter().find(|(n, _)| n == name).map(|(_, location)| location),
            Stated::ByName(names, _) => names.iter().find(|(n, _, _)| n == name).map(|(_, location, _)| location),
            Stated::Sums(sums) => sums.iter().flatten().find(|(n, _, _)| n == name).map(|(_, location, _)| location),
            _ => None,
        });
        inside.unwrap_or(&entry.location)
    }
}

/// The values of the parameters of one case, by index.
pub(crate) struct Environment<'a> {
    pub names: &'a [String],
    pub values: Vec<Value>,
}

impl Quantity {
    /// Returns the value, of any dimension.
    pub fn value(&self, key: &str, environment: &Environment<'_>) -> Result<Value, Problem> {
        self.expression
            .evaluate(&environment.values)
            .map_err(|fault| Problem::fault(&self.location, self.inner, key, fault))
    }

    /// Returns the value in SI. It must have this dimension and lie in this range.
    pub fn number(
        &self,
        key: &str,
        (dimension, within): (Dimension, Within),
        example: &str,
        environment: &Environment<'_>,
    ) -> Result<f64, Problem> {
        let value = self.value(key, environment)?;
        let number = self.convert(value, dimension, key, example, environment)?;
        if within.holds(number) {
            return Ok(number);
        }
        let message = format!("must be {}, found {}", within.described(), displayed(number, Some(dimension)));
        Err(self.problem(key, message))
    }

    /// Converts `value`, the value of this quantity, to a number of this dimension.
    pub fn convert(
        &self,
        value: Value,
        dimension: Dimension,
        key: &str,
        example: &str,
        environment: &Environment<'_>,
    ) -> Result<f64, Problem> {
        let number = value.written_as(&self.text, dimension).map_err(|(message, help)| {
            let bare = self.expression.parameters().find(|i| environment.values[*i].dimension.is_none());
            let help = help
                .or_else(|| {
                    let name = &environment.names[bare?];
                    Some(format!(
                        "`{name}` has no unit and counts as a pure number in this product; give it a unit in \
                         [parameters]"
                    ))
                })
                .or_else(|| (!example.is_empty()).then(|| format!("write it as in {key} = {example}")));
            self.problem(key, message).maybe_help(help)
        })?;
        if number.is_finite() {
            return Ok(number);
        }
        Err(self.problem(key, "this is not a finite number"))
    }

    /// Returns the value of this quantity for the parameter `name`, in the dimension that the
    /// parameter must have.
    pub fn settled(
        &self,
        name: &str,
        dimension: Option<Dimension>,
        environment: &Environment<'_>,
    ) -> Result<Value, Problem> {
        let value = self.value(name, environment)?;
        self.in_dimension(value, name, dimension, environment)
    }

    /// Converts `value`, the value of this quantity, to the dimension that the parameter `name`
    /// must have.
    pub fn in_dimension(
        &self,
        value: Value,
        name: &str,
        dimension: Option<Dimension>,
        environment: &Environment<'_>,
    ) -> Result<Value, Problem> {
        let Some(dimension) = dimension else { return Ok(value) };
        let number = self.convert(value, dimension, name, "", environment).map_err(|problem| match problem.help {
            None => problem.help(format!("the parameter `{name}` is {}", described(dimension))),
            Some(_) => problem,
        })?;
        Ok(Value::of(number, dimension))
    }

    pub fn problem(&self, key: &str, message: impl Into<String>) -> Problem {
        let span = match self.inner {
            Some(start) => start..start + self.text.len(),
            None => self.location.span.clone(),
        };
        Problem::new(&Location { source: self.location.source, span }, key, message)
    }
}

impl StatedTable {
    /// Returns the values of all keys. Errors go to `problems`; their keys are left out.
    pub fn values(&self, environment: &Environment<'_>, problems: &mut Vec<Problem>) -> Values {
        let before = problems.len();
        let mut entries = Vec::with_capacity(self.entries.len());
        for entry in &self.entries {
            match entry.value.given(entry.key, environment, problems) {
                Ok(given) => entries.push((entry.key, given)),
                Err(problem) => problems.push(problem),
            }
        }
        if !self.turn.is_empty() {
            for problem in &mut problems[before..] {
                problem.message = self.with_turn(&problem.message);
            }
        }
        Values { entries }
    }
}

impl Stated {
    fn given(
        &self,
        key: &'static str,
        environment: &Environment<'_>,
        problems: &mut Vec<Problem>,
    ) -> Result<Given, Problem> {
        Ok(match self {
            Stated::Fixed(given) => given.clone(),
            Stated::Names(names) => Given::Names(names.iter().map(|(name, _)| name.clone()).collect()),
            Stated::Quantity { quantity, dimension, within, example } => {
                Given::Quantity(quantity.number(key, (*dimension, *within), example, environment)?, *dimension)
            }
            Stated::List(list, within) => {
                let frequency = (Dimension::FREQUENCY, *within);
                let numbers = list.iter().map(|q| q.number(key, frequency, "\"121 Hz\"", environment));
                Given::Frequencies(Frequencies::List(numbers.collect::<Result<_, _>>()?))
            }
            Stated::Range { from, to, points, within, order } => {
                let frequency = (Dimension::FREQUENCY, *within);
                let start = from.number("from", frequency, "\"119 Hz\"", environment)?;
                let end = to.number("to", frequency, "\"123 Hz\"", environment)?;
                if *order == Order::Rising || start == end {
                    not_empty(start, end, to, Some(Dimension::FREQUENCY))?;
                }
                Given::Frequencies(Frequencies::Range { from: start, to: end, points: *points })
            }
            Stated::Adaptive { from, to, tolerance } => {
                let frequency = (Dimension::FREQUENCY, Within::Positive);
                let start = from.number("from", frequency, "\"119 Hz\"", environment)?;
                let end = to.number("to", frequency, "\"123 Hz\"", environment)?;
                not_empty(start, end, to, Some(Dimension::FREQUENCY))?;
                let share =
                    tolerance.number("tolerance", (Dimension::NONE, Within::Positive), "\"1 %\"", environment)?;
                if !(FINEST..=COARSEST).contains(&share) {
                    let message = format!("must lie between {FINEST} and {COARSEST}, found {share}");
                    return Err(tolerance.problem("tolerance", message).help("1 % makes a smooth figure"));
                }
                Given::Frequencies(Frequencies::Adaptive { from: start, to: end, tolerance: share })
            }
            Stated::ByName(names, dimension) => {
                let mut table = BTreeMap::new();
                for (name, _, quantity) in names {
                    let number = quantity.number(name, (*dimension, Within::Finite), "", environment)?;
                    table.insert(name.clone(), number);
                }
                Given::ByName(table, *dimension)
            }
            Stated::Vector(parts, dimension, example) => {
                let mut vector = [0.0; 3];
                for (value, part) in vector.iter_mut().zip(parts) {
                    *value = part.number(key, (*dimension, Within::Finite), example, environment)?;
                }
                Given::Vector(vector)
            }
            Stated::Quantities(parts, dimension, within, example) => {
                let number = |part: &Quantity| part.number(key, (*dimension, *within), example, environment);
                Given::Quantities(parts.iter().map(number).collect::<Result<_, _>>()?, *dimension)
            }
            Stated::Sums(sums) => {
                let one = |sum: &Weights| {
                    let weight = |(name, _, quantity): &(String, Location, Quantity)| {
                        let weight = quantity.number(name, (Dimension::NONE, Within::Finite), "", environment)?;
                        Ok((name.clone(), weight))
                    };
                    sum.iter().map(weight).collect::<Result<Vec<_>, Problem>>()
                };
                Given::Sums(sums.iter().map(one).collect::<Result<_, Problem>>()?)
            }
            Stated::Law(row, table) => Given::Law(law(row, table, key, environment, problems)?),
            Stated::Table(table) => Given::Table(table.values(environment, problems)),
        })
    }
}

/// Builds a law from the values of its table. A parameter whose dimension depends on another
/// parameter (as an exponent) is read after that one.
fn law(
    row: &'static LawInfo,
    table: &StatedTable,
    key: &'static str,
    environment: &Environment<'_>,
    problems: &mut Vec<Problem>,
) -> Result<SharedLaw, Problem> {
    let before = problems.len();
    let mut numbers: BTreeMap<&str, f64> = BTreeMap::new();
    let (raised, plain): (Vec<&Parameter>, Vec<&Parameter>) = row.parameters.iter().partition(|p| p.power.is_some());
    for parameter in plain.into_iter().chain(raised) {
        let Some(entry) = table.entry(parameter.key) else { continue };
        let Stated::Quantity { quantity, within, example, .. } = &entry.value else { continue };
        let value = |key: &str| {
            let default = || row.parameters.iter().find(|p| p.key == key)?.default;
            numbers.get(key).copied().or_else(default)
        };
        // with an exponent that is not a whole number: a plain number in SI
        let dimension = parameter.dimension_for(value).unwrap_or(Dimension::NONE);
        match quantity.number(parameter.key, (dimension, *within), example, environment) {
            Ok(value) if !parameter.range.contains(value) => {
                let Parameter { key, range, .. } = *parameter;
                let error = LawError::Value { law: row.name, key, dimension, range, value };
                problems.push(quantity.problem(key, error.to_string()));
                // the parameters with this exponent cannot be checked
                break;
            }
            Ok(value) => {
                numbers.insert(parameter.key, value);
            }
            Err(problem) => problems.push(problem),
        }
    }
    if problems.len() > before {
        // The error was reported already. The caller only needs to know that there is no law.
        return Err(problems.pop().unwrap_or_else(|| Problem::new(&table.location, key, "")));
    }
    row.build(&numbers).map_err(|error| Problem::new(&table.location, key, error.to_string()))
}

/// Bounds of the tolerance of adaptive frequencies. A finer tolerance costs too many points, a
/// coarser one hides the shape of the curve.
const FINEST: f64 = 1e-5;
const COARSEST: f64 = 0.5;

/// Refuses a range whose end is not above its start.
pub(crate) fn not_empty(from: f64, to: f64, end: &Quantity, dimension: Option<Dimension>) -> Result<(), Problem> {
    if from < to {
        return Ok(());
    }
    let (from, to) = (displayed(from, dimension), displayed(to, dimension));
    Err(end
        .problem("to", format!("the range is empty: `to` must be greater than `from`, found {from} to {to}"))
        .help("exchange both values, or write a single value"))
}
