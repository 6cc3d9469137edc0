//! Reads the lists of a model, `[[mass]]` and the others; `repeat` makes one entry state
//! several.

use super::reader::Reader;
use crate::compile::compiled::{CompiledTable, CompiledValue};
use crate::compile::frequency_amplitude::FrequencyAmplitude;
use crate::compile::repeat::{Index, Repetition};
use crate::compile::source_model::ModelLists;
use crate::syntax::document::{TomlEntry, TomlNode, TomlTable, TomlValue};
use crate::syntax::error::{Location, Problem};
use crate::syntax::expression::is_reserved;
use crate::syntax::key::DAMPING_RATIO;
use crate::syntax::schema::{Bounds, FILE, Key, MAX_ELEMENTS, MAX_MASSES, ValueType};
use crate::syntax::suggest::excerpt;
use stickslip::dimension::Dimension;
use stickslip::model::is_identifier;

/// Converts a damping in percent to a damping ratio.
fn percent(spring: &mut CompiledTable) {
    for entry in spring.entries.iter_mut().filter(|entry| entry.key == "damping") {
        if let CompiledValue::Quantity { quantity, dimension, within, example } = &mut entry.value
            && quantity.text.trim_end().ends_with('%')
        {
            (entry.key, *dimension, *within, *example) =
                (DAMPING_RATIO, Dimension::NONE, Bounds::AtLeastZero, "\"2 %\"");
        }
    }
}

impl Reader {
    pub(super) fn lists(&mut self, root: &TomlTable) -> Option<ModelLists> {
        let mut lists = ModelLists::default();
        for key in FILE {
            let (node, name) = match root.get(key.name) {
                Some(entry) => (&entry.node, key.name),
                None => continue,
            };
            match (key.takes, &node.value) {
                (ValueType::Table(keys), TomlValue::Table(table)) if name == "disk" => {
                    lists.disk = self.disk(table, keys);
                }
                // read elsewhere, together with its files
                (ValueType::Table(_), _) if name == "structure" => {}
                (ValueType::Table(keys), TomlValue::Table(table)) => {
                    self.table(table, keys, &format!("[{name}]"));
                }
                (ValueType::Table(_), _) => {
                    self.wrong_type(key, node);
                }
                (ValueType::List(keys), TomlValue::List(list)) => {
                    let most = if matches!(name, "mass" | "body") { MAX_MASSES } else { MAX_ELEMENTS };
                    let mut elements = 0;
                    for (i, node) in list.iter().enumerate() {
                        match &node.value {
                            TomlValue::Table(table) => {
                                let owner = format!("{name} {}", i + 1);
                                let Some(repetition) = self.repetition(table, &owner) else { continue };
                                elements = repetition.count().saturating_add(elements);
                                if elements > most {
                                    let message = format!("{elements} elements; the limit is {most}");
                                    self.problems.push(Problem::new(&node.location, name, message));
                                    break;
                                }
                                let stated = self.repeated(table, keys, &owner, repetition);
                                lists.get_mut(name)?.extend(stated);
                            }
                            other => {
                                let message = format!("expected a table, found {}", other.described());
                                let problem = Problem::new(&node.location, name, message);
                                self.problems.push(problem.help(format!("write [[{name}]] and its keys below")));
                            }
                        }
                    }
                }
                (ValueType::List(_), other) => {
                    let message = format!("expected a list of tables, found {}", other.described());
                    let problem = Problem::new(&node.location, name, message);
                    self.problems.push(problem.help(format!("write [[{name}]] with two brackets")));
                }
                _ => {}
            }
        }
        self.require_amplitudes("force", &lists.force, "\"10 N\"");
        self.require_amplitudes("motion", &lists.motion, "\"2 mm\"");
        lists.use_rotation_dimensions();
        lists.force.iter_mut().for_each(use_frequency);
        lists.spring.iter_mut().for_each(percent);
        for spring in &lists.spring {
            if let (Some(_), Some(ratio)) = (spring.entry("damping"), spring.entry(DAMPING_RATIO)) {
                let message = format!("`damping` and `{DAMPING_RATIO}` exclude each other");
                self.problems.push(Problem::new(&ratio.location, DAMPING_RATIO, message).help("remove one of them"));
            }
            if spring.entry("stiffness").is_none() && spring.entry("damping").is_none() && self.problems.is_empty() {
                let message = "a spring needs a stiffness, a damping, or both";
                self.problems
                    .push(Problem::new(&spring.location, "stiffness", message).help("add stiffness = \"105103 N/m\""));
            }
        }
        Some(lists)
    }

    /// Reports forces or motions with neither an amplitude nor a record, or with both.
    fn require_amplitudes(&mut self, list: &str, tables: &[CompiledTable], example: &str) {
        for (i, table) in tables.iter().enumerate() {
            let stated: Vec<_> =
                ["amplitude", "data", "signal"].into_iter().filter_map(|key| table.entry(key)).collect();
            let problem = match stated[..] {
                [] => {
                    let message = format!("`amplitude` is missing in {list} {}", i + 1);
                    Problem::new(&table.location, "amplitude", message)
                        .help(format!("add amplitude = {example}, or data = \"record\" in a transient"))
                }
                [first, second, ..] => {
                    let message = format!("`{}` and `{}` exclude each other", first.key, second.key);
                    Problem::new(&second.location, second.key, message).help("remove one of them")
                }
                _ => continue,
            };
            // an unreadable amplitude was reported already
            if self.problems.is_empty() {
                self.problems.push(problem);
            }
        }
    }

    /// Reads the entries that one repeated entry states, up to the first error.
    fn repeated(&mut self, table: &TomlTable, keys: &[Key], owner: &str, repetition: Repetition) -> Vec<CompiledTable> {
        self.repetition = repetition;
        let mut all = Vec::with_capacity(self.repetition.count());
        for number in 0..self.repetition.count() {
            self.turn_number = number;
            let before = self.problems.len();
            let mut stated = self.table(table, keys, owner);
            let iteration = self.iteration().description();
            if !iteration.is_empty() {
                for problem in &mut self.problems[before..] {
                    problem.message = format!("{} ({iteration})", problem.message);
                }
                stated.repetition = format!("{owner}, {iteration}");
            }
            all.push(stated);
            if self.problems.len() > before {
                break;
            }
        }
        (self.repetition, self.turn_number) = (Repetition::default(), 0);
        all
    }

    /// Reads the indices of `repeat`; empty if it is absent.
    fn repetition(&mut self, table: &TomlTable, owner: &str) -> Option<Repetition> {
        let Some(entry) = table.get("repeat") else { return Some(Repetition::default()) };
        let before = self.problems.len();
        let mut refuse = |location: &Location, message: String, help: Option<&str>| {
            let problem = Problem::new(location, "repeat", message);
            self.problems.push(problem.maybe_help(help.map(str::to_owned)));
        };
        let example = Some("write it as in repeat = { i = 12 } or repeat = { i = [2, 11] }");
        let TomlValue::Table(repeat) = &entry.node.value else {
            let message = format!("expected a table of indices in {owner}, found {}", entry.node.value.described());
            refuse(&entry.node.location, message, example);
            return None;
        };
        let mut indices = Vec::new();
        for TomlEntry { key, key_location, node } in repeat.entries.iter().filter(|entry| entry.key != "wrap") {
            let whole = |node: &TomlNode| match node.value {
                // Largest value of an index. It keeps names short and sums of indices exact.
                TomlValue::Number { whole, .. } => whole.filter(|whole| whole.unsigned_abs() <= 1_000_000),
                _ => None,
            };
            let range = match &node.value {
                TomlValue::List(list) if list.len() == 2 => whole(&list[0]).zip(whole(&list[1])),
                _ => whole(node).map(|times| (1, times)),
            };
            if !is_identifier(key) {
                let message = format!(
                    "`{}` is not a valid index name: use a letter first, then letters, digits and `_`",
                    excerpt(key)
                );
                refuse(key_location, message, None);
            } else if is_reserved(key) {
                refuse(key_location, format!("`{key}` is a reserved word in expressions"), None);
            } else if self.index.contains_key(key) {
                let help = Some("give the index another name");
                refuse(key_location, format!("`{key}` is already a parameter"), help);
            } else {
                match range.filter(|(from, to)| from <= to) {
                    Some((from, to)) => indices.push(Index { name: key.clone(), from, to, wrap: false }),
                    None => {
                        let message = format!(
                            "expected a number of repetitions or [first, last], found {}",
                            match &node.value {
                                TomlValue::List(_) => "another list".to_owned(),
                                other => other.described(),
                            }
                        );
                        refuse(&node.location, message, example);
                    }
                }
            }
        }
        if indices.is_empty() && self.problems.len() == before {
            let problem = Problem::new(&entry.node.location, "repeat", format!("an index is missing in {owner}"));
            self.problems.push(problem.maybe_help(example.map(str::to_owned)));
        }
        if let Some(wrap) = repeat.get("wrap") {
            self.wrap(wrap, &mut indices);
        }
        (self.problems.len() == before).then_some(Repetition { indices })
    }

    /// Sets the indices that wrap around: all, none, or the named ones.
    fn wrap(&mut self, entry: &TomlEntry, indices: &mut [Index]) {
        let node = &entry.node;
        let named: Vec<&TomlNode> = match &node.value {
            TomlValue::Flag(flag) => return indices.iter_mut().for_each(|index| index.wrap = *flag),
            TomlValue::List(list) => list.iter().collect(),
            _ => vec![node],
        };
        for node in named {
            let TomlValue::Text { text, .. } = &node.value else {
                let message = format!("expected true, or the name of an index, found {}", node.value.described());
                self.problems.push(Problem::new(&node.location, "wrap", message));
                return;
            };
            match indices.iter_mut().find(|index| index.name == *text) {
                Some(index) => index.wrap = true,
                None => {
                    let message = format!("there is no index `{}` in this entry", excerpt(text));
                    self.problems.push(Problem::new(&node.location, "wrap", message));
                }
            }
        }
    }
}

/// Marks the amplitude of a force that reads the excitation frequency.
fn use_frequency(force: &mut CompiledTable) {
    for entry in force.entries.iter_mut().filter(|entry| entry.key == "amplitude") {
        if let CompiledValue::Quantity { quantity, dimension, example, .. } = &entry.value
            && quantity.expression.reads_frequency()
        {
            let amplitude = FrequencyAmplitude { quantity: quantity.clone(), dimension: *dimension, example };
            entry.value = CompiledValue::OverFrequency(amplitude);
        }
    }
}
