//! Compiled statements of a study file: expressions are parsed and locations are known, but
//! nothing is evaluated.

use super::frequency_amplitude::FrequencyAmplitude;
use super::torsion::of_rotation;
use crate::case::study;
use crate::case::values::{FitRange, Frequencies, ResolvedValue, Values};
use crate::syntax::error::{Location, Problem};
use crate::syntax::expression::{Expression, ExpressionValue, dimension_text, quantity_text};
use crate::syntax::key::Bounds;
use crate::syntax::suggest::excerpt;
use std::collections::{BTreeMap, BTreeSet};
use stickslip::dimension::Dimension;
use stickslip::law::{LawError, LawInfo, Parameter, SharedLaw};

/// A quantity as it stands in a text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CompiledQuantity {
    pub location: Location,
    /// Start of its text in the source, see [`crate::syntax::document::TomlValue::Text`].
    pub text_start: Option<usize>,
    pub text: String,
    pub expression: Expression,
}

#[derive(Debug, Clone)]
pub(crate) struct CompiledTable {
    pub location: Location,
    /// The indices of the repetition that states the table, in words; empty without a
    /// repetition.
    pub repetition: String,
    pub entries: Vec<CompiledEntry>,
}

#[derive(Debug, Clone)]
pub(crate) struct CompiledEntry {
    pub key: &'static str,
    /// Location of the value; that of the table if the value is a default.
    pub location: Location,
    pub value: CompiledValue,
}

/// Names of rows with their locations and weights.
pub(crate) type Weights = Vec<(String, Location, CompiledQuantity)>;

/// Permitted order of the ends of a range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RangeOrder {
    Rising,
    /// The second end may lie below the first, but must differ from it.
    Any,
}

#[derive(Debug, Clone)]
pub(crate) enum CompiledValue {
    Fixed(ResolvedValue),
    Names(Vec<(String, Location)>),
    Quantity {
        quantity: CompiledQuantity,
        dimension: Dimension,
        within: Bounds,
        example: &'static str,
    },
    List(Vec<CompiledQuantity>, Bounds),
    Range {
        from: CompiledQuantity,
        to: CompiledQuantity,
        points: usize,
        within: Bounds,
        order: RangeOrder,
    },
    Adaptive {
        from: CompiledQuantity,
        to: CompiledQuantity,
        tolerance: CompiledQuantity,
    },
    ByName(Vec<(String, Location, CompiledQuantity)>, Dimension),
    Vector(Vec<CompiledQuantity>, Dimension, &'static str),
    Quantities(Vec<CompiledQuantity>, Dimension, Bounds, &'static str),
    Sums(Vec<Weights>),
    Law(&'static LawInfo, CompiledTable, LawCoordinate),
    /// An amplitude that depends on the excitation frequency.
    OverFrequency(FrequencyAmplitude),
    Table(CompiledTable),
    Tables(Vec<CompiledTable>),
    Fit(Vec<CompiledFitRange>),
}

/// The coordinate along which a law acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LawCoordinate {
    /// A displacement, with forces.
    Displacement,
    /// An angle, with moments.
    Angle,
    /// A displacement on a face of this area, m², with forces per area.
    Face { area: f64 },
}

impl LawCoordinate {
    /// Returns the dimension in which a parameter of a law is stated.
    pub fn dimension(self, of_law: Dimension) -> Dimension {
        match self {
            LawCoordinate::Displacement => of_law,
            LawCoordinate::Angle => of_rotation(of_law),
            // a kilogram stands for a force
            LawCoordinate::Face { .. } => Dimension { m: of_law.m - 2 * of_law.kg, ..of_law },
        }
    }

    /// Converts a stated parameter to that of the law.
    fn value(self, stated: f64, of_law: Dimension) -> f64 {
        match self {
            LawCoordinate::Face { area } => stated * area.powi(i32::from(of_law.kg)),
            _ => stated,
        }
    }
}

/// The range of a fitted parameter.
#[derive(Debug, Clone)]
pub(crate) struct CompiledFitRange {
    pub name: String,
    pub location: Location,
    pub from: CompiledQuantity,
    pub to: CompiledQuantity,
    pub is_log: bool,
}

impl CompiledFitRange {
    fn resolve(&self, environment: &Environment<'_>) -> Result<FitRange, Problem> {
        let index = environment.names.iter().position(|name| *name == self.name);
        let dimension = index.and_then(|index| environment.values[index].dimension);
        let end = |quantity: &CompiledQuantity| {
            let value = quantity.parameter_value(&self.name, dimension, environment)?;
            if value.si.is_finite() {
                Ok(value.si)
            } else {
                Err(quantity.problem(&self.name, "this is not a finite number"))
            }
        };
        let (from, to) = (end(&self.from)?, end(&self.to)?);
        if from >= to {
            let message = format!("must be more than `from`, found {}", quantity_text(to, dimension));
            return Err(self.to.problem("to", message));
        }
        if self.is_log && from <= 0.0 {
            let message =
                format!("must be more than zero on a logarithmic scale, found {}", quantity_text(from, dimension));
            return Err(self.from.problem("from", message));
        }
        Ok(FitRange { name: self.name.clone(), dimension, from, to, is_log: self.is_log })
    }
}

impl CompiledTable {
    /// Returns the name of the entry of a list.
    pub fn name(&self) -> Option<&str> {
        self.text("name")
    }

    /// Returns the text of a key.
    pub fn text(&self, key: &str) -> Option<&str> {
        match &self.entry(key)?.value {
            CompiledValue::Fixed(ResolvedValue::Text(text)) => Some(text),
            _ => None,
        }
    }

    pub fn entry(&self, key: &str) -> Option<&CompiledEntry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    /// Returns whether a force or a motion has a time history: a record or a signal.
    pub fn has_time_history(&self) -> bool {
        self.entry("data").is_some() || self.entry("signal").is_some()
    }

    /// Appends the indices of the repetition to a message.
    pub fn with_repetition(&self, message: &str) -> String {
        if self.repetition.is_empty() { message.to_owned() } else { format!("{message} ({})", self.repetition) }
    }

    /// Calls `each` with the key, the quantity and its dimension (if the schema defines it) for
    /// every quantity in the table.
    pub fn each_quantity(&self, each: &mut dyn FnMut(&'static str, &CompiledQuantity, Option<Dimension>)) {
        for entry in &self.entries {
            match &entry.value {
                CompiledValue::Fixed(_) | CompiledValue::Names(_) => {}
                CompiledValue::Quantity { quantity, dimension, .. } => each(entry.key, quantity, Some(*dimension)),
                CompiledValue::Vector(parts, dimension, _) | CompiledValue::Quantities(parts, dimension, ..) => {
                    parts.iter().for_each(|q| each(entry.key, q, Some(*dimension)));
                }
                CompiledValue::Sums(sums) => {
                    sums.iter().flatten().for_each(|(_, _, q)| each(entry.key, q, Some(Dimension::NONE)));
                }
                CompiledValue::List(list, _) => {
                    list.iter().for_each(|q| each(entry.key, q, Some(Dimension::FREQUENCY)))
                }
                CompiledValue::Range { from, to, .. } => {
                    each(entry.key, from, None);
                    each(entry.key, to, None);
                }
                CompiledValue::Adaptive { from, to, tolerance } => {
                    each(entry.key, from, None);
                    each(entry.key, to, None);
                    each(entry.key, tolerance, Some(Dimension::NONE));
                }
                CompiledValue::ByName(list, dimension) => {
                    list.iter().for_each(|(_, _, q)| each(entry.key, q, Some(*dimension)));
                }
                CompiledValue::Law(_, table, _) | CompiledValue::Table(table) => table.each_quantity(each),
                CompiledValue::OverFrequency(amplitude) => {
                    each(entry.key, &amplitude.quantity, Some(amplitude.dimension));
                }
                CompiledValue::Tables(tables) => tables.iter().for_each(|table| table.each_quantity(each)),
                CompiledValue::Fit(ranges) => ranges.iter().for_each(|range| {
                    each(entry.key, &range.from, None);
                    each(entry.key, &range.to, None);
                }),
            }
        }
    }

    /// Returns the location of a key's value, or of a name in it; that of the table if the key
    /// is absent.
    pub fn location_of(&self, key: &str, name: Option<&str>) -> &Location {
        let Some(entry) = self.entry(key) else { return &self.location };
        let inside = name.and_then(|name| match &entry.value {
            CompiledValue::Names(names) => names.iter().find(|(n, _)| n == name).map(|(_, location)| location),
            CompiledValue::ByName(names, _) => {
                names.iter().find(|(n, _, _)| n == name).map(|(_, location, _)| location)
            }
            CompiledValue::Sums(sums) => {
                sums.iter().flatten().find(|(n, _, _)| n == name).map(|(_, location, _)| location)
            }
            CompiledValue::Fit(ranges) => ranges.iter().find(|range| range.name == name).map(|range| &range.location),
            _ => None,
        });
        inside.unwrap_or(&entry.location)
    }
}

/// The values of the parameters of one case, by index.
pub(crate) struct Environment<'a> {
    pub names: &'a [String],
    /// The parameters as stated; empty if errors need not name their places.
    pub parameters: &'a [study::Parameter],
    pub values: Vec<ExpressionValue>,
}

/// The dimension and the range that a key requires of a quantity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Expected {
    pub dimension: Dimension,
    pub within: Bounds,
}

impl Expected {
    /// Any finite number of this dimension.
    fn finite(dimension: Dimension) -> Self {
        Expected { dimension, within: Bounds::Finite }
    }
}

impl CompiledQuantity {
    /// Returns the value, of any dimension.
    pub fn value(&self, key: &str, environment: &Environment<'_>) -> Result<ExpressionValue, Problem> {
        self.expression
            .evaluate(&environment.values)
            .map_err(|fault| Problem::from_text_error(&self.location, self.text_start, key, fault))
    }

    /// Returns the value at an excitation frequency (rad/s), of any dimension.
    pub fn value_at(&self, omega: f64, key: &str, environment: &Environment<'_>) -> Result<ExpressionValue, Problem> {
        self.expression
            .evaluate_at(Some(omega), &environment.values)
            .map_err(|fault| Problem::from_text_error(&self.location, self.text_start, key, fault))
    }

    /// Returns the value in SI. It must have this dimension and lie in this range.
    pub fn number(
        &self,
        key: &str,
        expected: Expected,
        example: &str,
        environment: &Environment<'_>,
    ) -> Result<f64, Problem> {
        let Expected { dimension, within } = expected;
        let value = self.value(key, environment)?;
        let number = self.convert(value, dimension, key, example, environment)?;
        if within.contains(number) {
            return Ok(number);
        }
        let message = format!("must be {}, found {}", within.description(), quantity_text(number, Some(dimension)));
        Err(self.problem(key, message))
    }

    /// Converts `value`, the value of this quantity, to a number of this dimension.
    pub fn convert(
        &self,
        value: ExpressionValue,
        dimension: Dimension,
        key: &str,
        example: &str,
        environment: &Environment<'_>,
    ) -> Result<f64, Problem> {
        let number = value.written_as(&self.text, dimension).map_err(|(message, help)| match help {
            Some(help) => self.problem(key, message).help(help),
            None => self.dimension_problem(key, message, example, environment),
        })?;
        if number.is_finite() {
            return Ok(number);
        }
        Err(self.problem(key, "this is not a finite number"))
    }

    /// Returns the problem that this quantity has another dimension. If the expression uses one
    /// parameter without a unit, the problem is at that parameter.
    fn dimension_problem(&self, key: &str, message: String, example: &str, environment: &Environment<'_>) -> Problem {
        let without_unit = |index: &usize| environment.values[*index].dimension.is_none();
        let bare: BTreeSet<usize> = self.expression.parameters().filter(without_unit).collect();
        let names: Vec<String> = bare.iter().map(|index| format!("`{}`", environment.names[*index])).collect();
        let parameter = bare.first().filter(|_| bare.len() == 1).and_then(|index| environment.parameters.get(*index));
        match (parameter, &names[..]) {
            (Some(parameter), [name]) => {
                let text = excerpt(self.text.trim());
                let message = format!("{name} has no unit and counts as a pure number in `{key} = {text}`: {message}");
                let help = format!("if {name} is a quantity, give it its unit here");
                parameter.quantity.problem(name.trim_matches('`'), message).help(help)
            }
            (_, []) => {
                let help = (!example.is_empty()).then(|| format!("write it as in {key} = {example}"));
                self.problem(key, message).maybe_help(help)
            }
            _ => {
                let names = names.join(", ");
                let help = format!("{names} have no unit and count as pure numbers here; give units in [parameters]");
                self.problem(key, message).help(help)
            }
        }
    }

    /// Returns the value of this quantity for the parameter `name`, in the dimension that the
    /// parameter must have.
    pub fn parameter_value(
        &self,
        name: &str,
        dimension: Option<Dimension>,
        environment: &Environment<'_>,
    ) -> Result<ExpressionValue, Problem> {
        let value = self.value(name, environment)?;
        self.convert_parameter(value, name, dimension, environment)
    }

    /// Converts `value`, the value of this quantity, to the dimension that the parameter `name`
    /// must have.
    pub fn convert_parameter(
        &self,
        value: ExpressionValue,
        name: &str,
        dimension: Option<Dimension>,
        environment: &Environment<'_>,
    ) -> Result<ExpressionValue, Problem> {
        let Some(dimension) = dimension else { return Ok(value) };
        let number = self.convert(value, dimension, name, "", environment).map_err(|problem| match problem.help {
            None => problem.help(format!("the parameter `{name}` is {}", dimension_text(dimension))),
            Some(_) => problem,
        })?;
        Ok(ExpressionValue::new(number, dimension))
    }

    pub fn problem(&self, key: &str, message: impl Into<String>) -> Problem {
        let span = match self.text_start {
            Some(start) => start..start + self.text.len(),
            None => self.location.span.clone(),
        };
        Problem::new(&Location { source: self.location.source, span }, key, message)
    }
}

impl CompiledTable {
    /// Returns the values of all keys. Errors go to `problems`; their keys are left out.
    pub fn values(&self, environment: &Environment<'_>, problems: &mut Vec<Problem>) -> Values {
        let before = problems.len();
        let mut entries = Vec::with_capacity(self.entries.len());
        for entry in &self.entries {
            match entry.value.evaluate(entry.key, environment, problems) {
                Ok(given) => entries.push((entry.key, given)),
                Err(problem) => problems.push(problem),
            }
        }
        if !self.repetition.is_empty() {
            for problem in &mut problems[before..] {
                problem.message = self.with_repetition(&problem.message);
            }
        }
        Values { entries }
    }
}

impl CompiledValue {
    pub(super) fn evaluate(
        &self,
        key: &'static str,
        environment: &Environment<'_>,
        problems: &mut Vec<Problem>,
    ) -> Result<ResolvedValue, Problem> {
        // Bounds of the tolerance of adaptive frequencies. A finer tolerance costs too many
        // points, a coarser one hides the shape of the curve.
        let min_adaptive_tolerance = 1e-5;
        let max_adaptive_tolerance = 0.5;
        Ok(match self {
            CompiledValue::Fixed(given) => given.clone(),
            CompiledValue::Names(names) => ResolvedValue::Names(names.iter().map(|(name, _)| name.clone()).collect()),
            CompiledValue::Quantity { quantity, dimension, within, example } => ResolvedValue::Quantity(
                quantity.number(key, Expected { dimension: *dimension, within: *within }, example, environment)?,
                *dimension,
            ),
            CompiledValue::List(list, within) => {
                let frequency = Expected { dimension: Dimension::FREQUENCY, within: *within };
                let numbers = list.iter().map(|q| q.number(key, frequency, "\"121 Hz\"", environment));
                ResolvedValue::Frequencies(Frequencies::List(numbers.collect::<Result<_, _>>()?))
            }
            CompiledValue::Range { from, to, points, within, order } => {
                let frequency = Expected { dimension: Dimension::FREQUENCY, within: *within };
                let start = from.number("from", frequency, "\"119 Hz\"", environment)?;
                let end = to.number("to", frequency, "\"123 Hz\"", environment)?;
                if *order == RangeOrder::Rising || start == end {
                    check_range(start, end, to, Some(Dimension::FREQUENCY))?;
                }
                ResolvedValue::Frequencies(Frequencies::Range { from: start, to: end, points: *points })
            }
            CompiledValue::Adaptive { from, to, tolerance } => {
                let frequency = Expected { dimension: Dimension::FREQUENCY, within: Bounds::Positive };
                let start = from.number("from", frequency, "\"119 Hz\"", environment)?;
                let end = to.number("to", frequency, "\"123 Hz\"", environment)?;
                check_range(start, end, to, Some(Dimension::FREQUENCY))?;
                let positive = Expected { dimension: Dimension::NONE, within: Bounds::Positive };
                let share = tolerance.number("tolerance", positive, "\"1 %\"", environment)?;
                if !(min_adaptive_tolerance..=max_adaptive_tolerance).contains(&share) {
                    let message = format!(
                        "must lie between {min_adaptive_tolerance} and {max_adaptive_tolerance}, found {share}"
                    );
                    return Err(tolerance.problem("tolerance", message).help("1 % makes a smooth figure"));
                }
                ResolvedValue::Frequencies(Frequencies::Adaptive { from: start, to: end, tolerance: share })
            }
            CompiledValue::ByName(names, dimension) => {
                let mut table = BTreeMap::new();
                for (name, _, quantity) in names {
                    let number = quantity.number(name, Expected::finite(*dimension), "", environment)?;
                    table.insert(name.clone(), number);
                }
                ResolvedValue::ByName(table, *dimension)
            }
            CompiledValue::Vector(parts, dimension, example) => {
                let mut vector = [0.0; 3];
                for (value, part) in vector.iter_mut().zip(parts) {
                    *value = part.number(key, Expected::finite(*dimension), example, environment)?;
                }
                ResolvedValue::Vector(vector)
            }
            CompiledValue::Quantities(parts, dimension, within, example) => {
                let number = |part: &CompiledQuantity| {
                    part.number(key, Expected { dimension: *dimension, within: *within }, example, environment)
                };
                ResolvedValue::Quantities(parts.iter().map(number).collect::<Result<_, _>>()?, *dimension)
            }
            CompiledValue::Sums(sums) => {
                let one = |sum: &Weights| {
                    let weight = |(name, _, quantity): &(String, Location, CompiledQuantity)| {
                        let weight = quantity.number(name, Expected::finite(Dimension::NONE), "", environment)?;
                        Ok((name.clone(), weight))
                    };
                    sum.iter().map(weight).collect::<Result<Vec<_>, Problem>>()
                };
                ResolvedValue::Sums(sums.iter().map(one).collect::<Result<_, Problem>>()?)
            }
            CompiledValue::Law(row, table, coordinate) => {
                let statement = LawStatement { row, table, coordinate: *coordinate };
                ResolvedValue::Law(statement.build(key, environment, problems)?)
            }
            CompiledValue::OverFrequency(amplitude) => {
                ResolvedValue::OverFrequency(amplitude.polynomial(key, environment)?)
            }
            CompiledValue::Table(table) => ResolvedValue::Table(table.values(environment, problems)),
            CompiledValue::Tables(tables) => {
                ResolvedValue::Tables(tables.iter().map(|table| table.values(environment, problems)).collect())
            }
            CompiledValue::Fit(ranges) => {
                ResolvedValue::Fit(ranges.iter().map(|range| range.resolve(environment)).collect::<Result<_, _>>()?)
            }
        })
    }
}

/// A law as it is stated.
struct LawStatement<'a> {
    row: &'static LawInfo,
    table: &'a CompiledTable,
    coordinate: LawCoordinate,
}

impl LawStatement<'_> {
    /// Builds the law from the values of its table. A parameter whose dimension depends on another
    /// parameter (as an exponent) is read after that one.
    fn build(
        &self,
        key: &'static str,
        environment: &Environment<'_>,
        problems: &mut Vec<Problem>,
    ) -> Result<SharedLaw, Problem> {
        let LawStatement { row, table, coordinate } = *self;
        let before = problems.len();
        let mut numbers: BTreeMap<&str, f64> = BTreeMap::new();
        let (raised, plain): (Vec<&Parameter>, Vec<&Parameter>) =
            row.parameters.iter().partition(|p| p.power.is_some());
        for parameter in plain.into_iter().chain(raised) {
            let Some(entry) = table.entry(parameter.key) else { continue };
            let CompiledValue::Quantity { quantity, within, example, .. } = &entry.value else { continue };
            let value = |key: &str| {
                let default = || row.parameters.iter().find(|p| p.key == key)?.default;
                numbers.get(key).copied().or_else(default)
            };
            // with an exponent that is not a whole number: a plain number in SI
            let dimension = parameter.dimension_for(value).unwrap_or(Dimension::NONE);
            let expected = Expected { dimension: coordinate.dimension(dimension), within: *within };
            let stated = quantity.number(parameter.key, expected, example, environment);
            match stated.map(|value| coordinate.value(value, dimension)) {
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
}

/// The spacing of the values of a range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RangeScale {
    /// Equal differences.
    Linear,
    /// Equal ratios.
    Log,
}

/// Checks that a logarithmic range begins above zero.
pub(crate) fn check_positive(from: f64, start: &CompiledQuantity, dimension: Option<Dimension>) -> Result<(), Problem> {
    if from > 0.0 {
        return Ok(());
    }
    let message = format!("a logarithmic range begins above zero, found {}", quantity_text(from, dimension));
    Err(start.problem("from", message).help("use a positive value, or remove `scale`"))
}

/// Refuses a range whose end is not above its start.
pub(crate) fn check_range(
    from: f64,
    to: f64,
    end: &CompiledQuantity,
    dimension: Option<Dimension>,
) -> Result<(), Problem> {
    if from < to {
        return Ok(());
    }
    let (from, to) = (quantity_text(from, dimension), quantity_text(to, dimension));
    Err(end
        .problem("to", format!("the range is empty: `to` must be greater than `from`, found {from} to {to}"))
        .help("exchange both values, or write a single value"))
}
