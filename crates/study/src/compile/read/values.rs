//! Converts the tables of a study file to typed values: names, quantities, ranges, lists.
//! Reports unknown and missing keys and values of a wrong type.

use super::kinds::tables_with_key;
use super::reader::Reader;
use crate::case::values::ResolvedValue;
use crate::compile::bare_numbers::bare_number_problem;
use crate::compile::compiled::{
    CompiledEntry, CompiledFitRange, CompiledQuantity, CompiledTable, CompiledValue, RangeOrder, RangeScale, Weights,
};
use crate::syntax::document::{TomlEntry, TomlNode, TomlTable, TomlValue};
use crate::syntax::error::{Location, Problem};
use crate::syntax::expression::Expression;
use crate::syntax::schema::{self, Bounds, Key, MAX_POINTS, Presence, ValueType};
use crate::syntax::suggest::{alternatives, excerpt, suggest};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use stickslip::model::{NEXT, is_identifier, is_place};

impl Reader {
    /// Reports unknown and missing keys.
    pub(super) fn check_keys(&mut self, table: &TomlTable, keys: &[Key], owner: &str) {
        let mut misspelt = Vec::new();
        for entry in &table.entries {
            if !keys.iter().any(|key| key.name == entry.key) {
                let near = suggest(&entry.key, keys.iter().map(|key| key.name));
                misspelt.extend(near);
                let help = match near {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => {
                        let taken = keys.iter().filter(|key| key.is_supported()).map(|key| key.name);
                        let taken = format!("the keys of {owner} are {}", alternatives(taken).replace(" or ", ", "));
                        match tables_with_key(&entry.key, keys)[..] {
                            [] => taken,
                            ref homes => format!("`{}` is a key of {}; {taken}", entry.key, homes.join(" and of ")),
                        }
                    }
                };
                let help = self.step_help(table, entry, keys).unwrap_or(help);
                let message = format!("{owner} has no key `{}`", excerpt(&entry.key));
                self.problems.push(Problem::new(&entry.key_location, excerpt(&entry.key), message).help(help));
            }
        }
        for key in keys.iter().filter(|key| key.presence == Presence::Required) {
            if table.get(key.name).is_none() && !misspelt.contains(&key.name) {
                let message =
                    format!("`{}` is missing in {owner}; expected {}", key.name, schema::describe_value(&key.takes));
                let help = match key.takes {
                    ValueType::Study => "add a table [study] with kind = \"response\" and a frequency".to_owned(),
                    _ => format!("add {} = {}", key.name, key.example),
                };
                self.problems.push(Problem::new(&table.location, key.name, message).help(help));
            }
        }
    }

    /// Returns the help for a `step` in a range, which has a number of points or a tolerance
    /// instead.
    fn step_help(&self, table: &TomlTable, entry: &TomlEntry, keys: &[Key]) -> Option<String> {
        let is_range = keys.iter().any(|key| key.name == "from") && keys.iter().any(|key| key.name == "to");
        if !is_range || suggest(&entry.key, ["step", "steps", "increment", "spacing"]).is_none() {
            return None;
        }
        let number = |key: &str| match &table.get(key)?.node.value {
            TomlValue::Text { text, .. } => self.compile(text).ok()?.evaluate(&[]).ok().map(|value| value.si),
            TomlValue::Number { value, .. } => Some(*value),
            _ => None,
        };
        let steps = || Some((number("to")? - number("from")?) / number(&entry.key)?);
        let count = steps().filter(|steps| steps.is_finite() && *steps >= 1.0).map(|steps| steps.round() + 1.0);
        let points = count.map_or_else(|| "`points`".to_owned(), |count| format!("points = {count}"));
        Some(match table.get("tolerance") {
            Some(_) => format!(
                "with `tolerance` the solver chooses the points, so there is no step; for equal steps remove both \
                 keys and write {points}"
            ),
            None => format!("write the number of values, both ends included: {points}"),
        })
    }

    pub(super) fn table(&mut self, table: &TomlTable, keys: &[Key], owner: &str) -> CompiledTable {
        self.check_keys(table, keys, owner);
        self.compile_table(table, keys)
    }

    /// Reads the values of known keys. [`Reader::check_keys`] reports unknown and missing keys.
    pub(super) fn compile_table(&mut self, table: &TomlTable, keys: &[Key]) -> CompiledTable {
        let mut entries = Vec::with_capacity(keys.len());
        for key in keys {
            let (location, value) = match (table.get(key.name), key.presence) {
                (Some(entry), _) => (entry.node.location.clone(), self.value(key, &entry.node)),
                (None, Presence::Default(text)) => {
                    (table.location.clone(), self.default_value(key, text, &table.location))
                }
                (None, _) => continue,
            };
            entries.extend(value.map(|value| CompiledEntry { key: key.name, location, value }));
        }
        CompiledTable { location: table.location.clone(), repetition: String::new(), entries }
    }

    /// Reads the default value of an absent key.
    fn default_value(&mut self, key: &Key, text: &str, location: &Location) -> Option<CompiledValue> {
        let value = match key.takes {
            ValueType::Count(..) => {
                let whole = text.parse::<i64>().ok();
                TomlValue::Number { value: whole.unwrap_or(0) as f64, whole }
            }
            ValueType::Flag => TomlValue::Flag(text == "true"),
            _ => TomlValue::Text { text: text.to_owned(), inner: None },
        };
        self.value(key, &TomlNode { location: location.clone(), value })
    }

    pub(super) fn wrong_type(&mut self, key: &Key, node: &TomlNode) -> Option<CompiledValue> {
        let expected = schema::describe_value(&key.takes);
        self.problems.push(
            Problem::new(&node.location, key.name, format!("expected {expected}, found {}", node.value.described()))
                .help(format!("write it as in {} = {}", key.name, key.example)),
        );
        None
    }

    pub(super) fn value(&mut self, key: &Key, node: &TomlNode) -> Option<CompiledValue> {
        match (&key.takes, &node.value) {
            (ValueType::Text, TomlValue::Text { text, .. }) => {
                Some(CompiledValue::Fixed(ResolvedValue::Text(text.clone())))
            }
            (ValueType::Name, TomlValue::Text { text, inner }) => {
                Some(CompiledValue::Fixed(ResolvedValue::Text(self.name(key.name, text, *inner, &node.location)?)))
            }
            (ValueType::Names, TomlValue::Text { text, inner }) => Some(CompiledValue::Names(vec![(
                self.name(key.name, text, *inner, &node.location)?,
                node.location.clone(),
            )])),
            (ValueType::Unsupported(why), _) => {
                self.problems.push(Problem::new(&node.location, key.name, *why).help(key.doc));
                None
            }
            (ValueType::Repeat, _) => None, // read before the other keys, whose values depend on it
            (ValueType::Names, TomlValue::List(list)) if !list.is_empty() => self.names(key, list),
            (ValueType::Pair, TomlValue::List(list)) if list.len() == 2 => self.names(key, list),
            (ValueType::Pair, TomlValue::List(list)) => {
                let message = format!("expected two names of places, found {}", list.len());
                let help = format!("write it as in {} = {}", key.name, key.example);
                self.problems.push(Problem::new(&node.location, key.name, message).help(help));
                None
            }
            (ValueType::Quantity(dimension, within), TomlValue::Text { .. } | TomlValue::Number { .. }) => {
                let quantity = self.quantity(key.name, node)?;
                let (dimension, within, example) = (*dimension, *within, key.example);
                Some(CompiledValue::Quantity { quantity, dimension, within, example })
            }
            (ValueType::Count(from, to), TomlValue::Number { whole: Some(whole), .. }) => {
                self.count(key, *whole, *from..=*to, &node.location)
            }
            (ValueType::Flag, TomlValue::Flag(flag)) => Some(CompiledValue::Fixed(ResolvedValue::Flag(*flag))),
            (ValueType::Frequencies(keys), TomlValue::Text { .. } | TomlValue::Number { .. }) => {
                Some(CompiledValue::List(vec![self.quantity(key.name, node)?], range_bounds(keys)))
            }
            (ValueType::Frequencies(keys), TomlValue::List(list)) => {
                Some(CompiledValue::List(self.quantities(key.name, list, &node.location)?, range_bounds(keys)))
            }
            (ValueType::Frequencies(_), TomlValue::Table(table)) if table.get("tolerance").is_some() => {
                self.adaptive(key, table)
            }
            (ValueType::Frequencies(keys), TomlValue::Table(table)) => {
                let StatedRange { from, to, points, .. } = self.range(table, keys, key.name)?;
                // if only the ends matter, their order gives the direction
                let ends = |key: &Key| key.name == "points" && matches!(key.presence, Presence::Default(_));
                let order = if keys.iter().any(ends) { RangeOrder::Any } else { RangeOrder::Rising };
                Some(CompiledValue::Range { from, to, points, within: range_bounds(keys), order })
            }
            (ValueType::ByName(dimension), TomlValue::Table(table)) => {
                let mut names = Vec::new();
                for entry in &table.entries {
                    let quantity = self.quantity(&entry.key, &entry.node)?;
                    names.push((entry.key.clone(), entry.key_location.clone(), quantity));
                }
                Some(CompiledValue::ByName(names, *dimension))
            }
            (ValueType::File, TomlValue::Text { text, .. }) => {
                Some(CompiledValue::Fixed(ResolvedValue::Text(text.clone())))
            }
            (ValueType::File, TomlValue::Table(table)) => {
                Some(CompiledValue::Table(self.table(table, schema::FILE_KEYS, &format!("`{}`", key.name))))
            }
            (ValueType::TableOrFalse(_), TomlValue::Flag(false)) => {
                Some(CompiledValue::Fixed(ResolvedValue::Flag(false)))
            }
            (ValueType::TableOrFalse(keys), TomlValue::Table(table)) => {
                Some(CompiledValue::Table(self.table(table, keys, &format!("`{}`", key.name))))
            }
            (ValueType::Row, TomlValue::Text { .. } | TomlValue::Number { whole: Some(_), .. }) => {
                Some(CompiledValue::Names(vec![(self.row(key, node)?, node.location.clone())]))
            }
            (ValueType::Rows, TomlValue::List(list)) if !list.is_empty() => {
                let rows = list.iter().map(|node| Some((self.row(key, node)?, node.location.clone())));
                Some(CompiledValue::Names(rows.collect::<Option<_>>()?))
            }
            (ValueType::Weights, TomlValue::Table(table)) if !table.entries.is_empty() => {
                Some(CompiledValue::Sums(vec![self.weights(key, table)?]))
            }
            (ValueType::Weights, TomlValue::List(list)) if !list.is_empty() => {
                let sum = |node: &TomlNode| match &node.value {
                    TomlValue::Table(table) if !table.entries.is_empty() => self.weights(key, table),
                    _ => {
                        self.wrong_type(key, node);
                        None
                    }
                };
                Some(CompiledValue::Sums(list.iter().map(sum).collect::<Option<_>>()?))
            }
            (ValueType::Vector(dimension), TomlValue::List(list)) if list.len() == 3 => {
                Some(CompiledValue::Vector(self.quantities(key.name, list, &node.location)?, *dimension, key.example))
            }
            (ValueType::Quantities(dimension, within), TomlValue::List(list)) => {
                let list = self.quantities(key.name, list, &node.location)?;
                Some(CompiledValue::Quantities(list, *dimension, *within, key.example))
            }
            (ValueType::Quantities(dimension, within), TomlValue::Text { .. } | TomlValue::Number { .. }) => {
                let one = self.quantity(key.name, node)?;
                Some(CompiledValue::Quantities(vec![one], *dimension, *within, key.example))
            }
            (ValueType::Table(keys), TomlValue::Table(table)) => {
                Some(CompiledValue::Table(self.table(table, keys, &format!("`{}`", key.name))))
            }
            (ValueType::Tables(keys), TomlValue::List(list)) if !list.is_empty() => self.tables(key, keys, list),
            (ValueType::Texts, TomlValue::Table(table)) => self.texts(key, table),
            (ValueType::Fit, TomlValue::Table(table)) => self.fit(key, table),
            (ValueType::Law, TomlValue::Table(table)) => self.law(table),
            (ValueType::Choice(words), TomlValue::Text { text, .. }) => {
                let words = words();
                if words.iter().any(|(word, _)| word == text) {
                    return Some(CompiledValue::Fixed(ResolvedValue::Text(text.clone())));
                }
                self.unknown_word(key.name, text, &node.location, words.iter().map(|(word, _)| *word).collect());
                None
            }
            _ => self.wrong_type(key, node),
        }
    }

    /// Reads a list of tables.
    fn tables(&mut self, key: &Key, keys: &[Key], list: &[TomlNode]) -> Option<CompiledValue> {
        let table = |(i, node): (usize, &TomlNode)| match &node.value {
            TomlValue::Table(table) => Some(self.table(table, keys, &format!("{} {}", key.name, i + 1))),
            _ => {
                self.wrong_type(key, node);
                None
            }
        };
        Some(CompiledValue::Tables(list.iter().enumerate().map(table).collect::<Option<_>>()?))
    }

    /// Reads a table from names to texts.
    fn texts(&mut self, key: &Key, table: &TomlTable) -> Option<CompiledValue> {
        let mut texts = BTreeMap::new();
        for entry in &table.entries {
            let TomlValue::Text { text, .. } = &entry.node.value else {
                let message = format!("expected a text in quotes, found {}", entry.node.value.described());
                let help = format!("write it as in {} = {}", key.name, key.example);
                self.problems.push(Problem::new(&entry.node.location, excerpt(&entry.key), message).help(help));
                return None;
            };
            texts.insert(entry.key.clone(), text.clone());
        }
        Some(CompiledValue::Fixed(ResolvedValue::Texts(texts)))
    }

    /// Reads the fitted parameters and the ranges of their values.
    fn fit(&mut self, key: &Key, table: &TomlTable) -> Option<CompiledValue> {
        let mut ranges = Vec::new();
        for entry in &table.entries {
            self.parameter(entry, "fit")?;
            let TomlValue::Table(range) = &entry.node.value else {
                let message = format!("expected a range, found {}", entry.node.value.described());
                let help = format!("write it as in {} = {}", key.name, key.example);
                self.problems.push(Problem::new(&entry.node.location, excerpt(&entry.key), message).help(help));
                return None;
            };
            let before = self.problems.len();
            let mut stated = self.table(range, schema::FIT_RANGE, &format!("the range of `{}`", excerpt(&entry.key)));
            if self.problems.len() > before {
                return None;
            }
            let is_log = matches!(
                stated.entry("scale").map(|entry| &entry.value),
                Some(CompiledValue::Fixed(ResolvedValue::Text(text))) if text == "log"
            );
            let (from, to) = (take_quantity(&mut stated, "from")?, take_quantity(&mut stated, "to")?);
            ranges.push(CompiledFitRange {
                name: entry.key.clone(),
                location: entry.key_location.clone(),
                from,
                to,
                is_log,
            });
        }
        if ranges.is_empty() {
            self.problems.push(Problem::new(&table.location, key.name, "no parameter is fitted: name at least one"));
            return None;
        }
        Some(CompiledValue::Fit(ranges))
    }

    /// Reads a whole number within limits.
    fn count(
        &mut self,
        key: &Key,
        whole: i64,
        within: RangeInclusive<i64>,
        location: &Location,
    ) -> Option<CompiledValue> {
        if within.contains(&whole) {
            return Some(CompiledValue::Fixed(ResolvedValue::Count(u64::try_from(whole).unwrap_or(0))));
        }
        let message = format!("expected {}, found {whole}", schema::describe_value(&key.takes));
        let problem = Problem::new(location, key.name, message);
        let most = *within.end();
        let limit = key.name == "points" && most == MAX_POINTS as i64 && whole > most;
        let help = limit.then(|| format!("the limit of a study is {MAX_POINTS} points"));
        self.problems.push(problem.maybe_help(help));
        None
    }

    /// Reads a range with adaptive points.
    fn adaptive(&mut self, key: &Key, table: &TomlTable) -> Option<CompiledValue> {
        let before = self.problems.len();
        if let Some(entry) = table.entries.iter().find(|entry| entry.key == "points") {
            let message =
                format!("`points` and `tolerance` in the range of `{}` exclude each other", excerpt(key.name));
            let help = "remove one of them: with `tolerance` the solver chooses the points";
            self.problems.push(Problem::new(&entry.key_location, "points", message).help(help));
            return None;
        }
        let mut stated = self.table(table, schema::ADAPTIVE_RANGE, &format!("the range of `{}`", excerpt(key.name)));
        let [from, to, tolerance] = ["from", "to", "tolerance"].map(|key| take_quantity(&mut stated, key));
        if self.problems.len() > before {
            return None;
        }
        Some(CompiledValue::Adaptive { from: from?, to: to?, tolerance: tolerance? })
    }

    pub(super) fn unknown_word(&mut self, key: &str, word: &str, location: &Location, words: Vec<&str>) {
        let message = format!("unknown value `{}`, expected {}", excerpt(word), alternatives(words.iter().copied()));
        let help = suggest(word, words).map(|near| format!("did you mean `{near}`?"));
        self.problems.push(Problem::new(location, key, message).maybe_help(help));
    }

    /// Reads a name and fills in the indices of a repetition.
    ///
    /// The name of a place may be a direction of a node, `node.direction`.
    fn name(&mut self, key: &str, text: &str, inner: Option<usize>, location: &Location) -> Option<String> {
        let problem = match self.iteration().name(text) {
            Ok(name) if is_identifier(&name) => return Some(name),
            // a place of the next sector of a disk is allowed too
            Ok(name) if !matches!(key, "name" | "directions") && is_place(name.strip_prefix(NEXT).unwrap_or(&name)) => {
                return Some(name);
            }
            Ok(name) => {
                let message = format!(
                    "`{}` is not a valid name: use a letter first, then letters, digits and `_`",
                    excerpt(&name)
                );
                Problem::new(location, key, message)
            }
            Err(fault) if self.repetition.indices.is_empty() => {
                let help = "braces need an index in the same entry: repeat = { i = 12 }";
                Problem::from_text_error(location, inner, key, fault).help(help)
            }
            Err(fault) => Problem::from_text_error(location, inner, key, fault),
        };
        self.problems.push(problem);
        None
    }

    /// Reads the name or number of a row, and fills in the indices of a repetition.
    fn row(&mut self, key: &Key, node: &TomlNode) -> Option<String> {
        match &node.value {
            TomlValue::Text { text, inner } => self.fill_name(key, text, *inner, &node.location),
            TomlValue::Number { whole: Some(number), .. } => Some(number.to_string()),
            _ => self.wrong_type(key, node).and(None),
        }
    }

    /// Reads rows with their weights.
    fn weights(&mut self, key: &Key, table: &TomlTable) -> Option<Weights> {
        let one = |entry: &TomlEntry| {
            let name = self.fill_name(key, &entry.key, None, &entry.key_location)?;
            Some((name, entry.key_location.clone(), self.quantity(&entry.key, &entry.node)?))
        };
        table.entries.iter().map(one).collect()
    }

    fn fill_name(&mut self, key: &Key, text: &str, inner: Option<usize>, location: &Location) -> Option<String> {
        match self.iteration().name(text) {
            Ok(name) => Some(name),
            Err(fault) => {
                self.problems.push(Problem::from_text_error(location, inner, key.name, fault));
                None
            }
        }
    }

    fn names(&mut self, key: &Key, list: &[TomlNode]) -> Option<CompiledValue> {
        let mut names = Vec::with_capacity(list.len());
        for node in list {
            let TomlValue::Text { text, inner } = &node.value else { return self.wrong_type(key, node) };
            names.push((self.name(key.name, text, *inner, &node.location)?, node.location.clone()));
        }
        Some(CompiledValue::Names(names))
    }

    pub(super) fn quantity(&mut self, key: &str, node: &TomlNode) -> Option<CompiledQuantity> {
        let before = self.problems.len();
        let quantity = self.any_quantity(key, node);
        if let (None, TomlValue::Text { text, .. }) = (&quantity, &node.value)
            && let Some((from, to)) = self.two_quantities(text)
        {
            self.problems.truncate(before);
            let message = "expected one quantity, but this looks like a range";
            let help = format!(
                "if this key takes a range, write {{ from = \"{}\", to = \"{}\", points = 101 }}",
                excerpt(from),
                excerpt(to)
            );
            self.problems.push(Problem::new(&node.location, key, message).help(help));
        }
        quantity
    }

    /// Splits `14 Hz to 19 Hz`, or other spellings of a range, into its two quantities.
    fn two_quantities<'a>(&self, text: &'a str) -> Option<(&'a str, &'a str)> {
        [" to ", "...", "..", "…", "–", " - ", "; "].iter().find_map(|word| {
            let (from, to) = text.split_once(word)?;
            let (from, to) = (from.trim(), to.trim());
            (self.compile(from).is_ok() && self.compile(to).is_ok()).then_some((from, to))
        })
    }

    fn any_quantity(&mut self, key: &str, node: &TomlNode) -> Option<CompiledQuantity> {
        let location = &node.location;
        let problem = match &node.value {
            TomlValue::Text { text, inner } => match self.compile(text) {
                Ok(expression) => {
                    return Some(CompiledQuantity {
                        location: location.clone(),
                        text_start: *inner,
                        text: text.clone(),
                        expression,
                    });
                }
                Err(fault) => Problem::from_text_error(location, *inner, key, fault),
            },
            TomlValue::Number { value, .. } if value.is_finite() => {
                let text = value.to_string();
                return Some(CompiledQuantity {
                    location: location.clone(),
                    text_start: None,
                    text,
                    expression: Expression::number(*value),
                });
            }
            TomlValue::Number { value, .. } => {
                Problem::new(location, key, format!("expected a finite number, found {value}"))
            }
            other => Problem::new(location, key, format!("expected a quantity, found {}", other.described()))
                .help("write a number with its unit in quotes, as in \"2 N\""),
        };
        self.problems.push(problem);
        None
    }

    pub(super) fn quantities(
        &mut self,
        key: &str,
        list: &[TomlNode],
        location: &Location,
    ) -> Option<Vec<CompiledQuantity>> {
        if list.is_empty() {
            let problem = Problem::new(location, key, "the list is empty: write at least one value");
            self.problems.push(problem);
            return None;
        }
        let quantities: Vec<CompiledQuantity> =
            list.iter().map(|node| self.quantity(key, node)).collect::<Option<_>>()?;
        self.problems.extend(bare_number_problem(key, &quantities));
        Some(quantities)
    }

    pub(super) fn range(&mut self, table: &TomlTable, keys: &[Key], owner: &str) -> Option<StatedRange> {
        let before = self.problems.len();
        let mut stated = self.table(table, keys, &format!("the range of `{}`", excerpt(owner)));
        if self.problems.len() > before {
            return None;
        }
        let mut take = |key: &str| {
            let at = stated.entries.iter().position(|entry| entry.key == key)?;
            Some(stated.entries.swap_remove(at).value)
        };
        let scale = match take("scale") {
            Some(CompiledValue::Fixed(ResolvedValue::Text(word))) if word == "log" => RangeScale::Log,
            _ => RangeScale::Linear,
        };
        match (take("from")?, take("to")?, take("points")?) {
            (
                CompiledValue::Quantity { quantity: from, .. },
                CompiledValue::Quantity { quantity: to, .. },
                CompiledValue::Fixed(ResolvedValue::Count(points)),
            ) => {
                self.problems.extend(bare_number_problem(owner, [&from, &to]));
                Some(StatedRange { from, to, points: usize::try_from(points).ok()?, scale })
            }
            _ => None,
        }
    }
}

/// A range as stated: its ends, the number of its values and their spacing.
pub(super) struct StatedRange {
    pub from: CompiledQuantity,
    pub to: CompiledQuantity,
    pub points: usize,
    pub scale: RangeScale,
}

/// Removes a quantity from a table.
fn take_quantity(table: &mut CompiledTable, key: &str) -> Option<CompiledQuantity> {
    let at = table.entries.iter().position(|entry| entry.key == key)?;
    match table.entries.swap_remove(at).value {
        CompiledValue::Quantity { quantity, .. } => Some(quantity),
        _ => None,
    }
}

/// Returns the limits of the frequencies in a range with these keys.
fn range_bounds(keys: &[Key]) -> Bounds {
    let first = keys.iter().find(|key| key.name == "from").map(|key| key.takes);
    if let Some(ValueType::Quantity(_, within)) = first { within } else { Bounds::Positive }
}
