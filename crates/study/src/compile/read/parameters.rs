//! Reads `[parameters]`, values from the command line, `vary` and `[sample]`.
//!
//! It determines the parameters, the order of their evaluation, and the number of cases.

use super::reader::Reader;
use super::values::StatedRange;
use crate::case::sample::{DESIGNS, DISTRIBUTIONS, Design, DrawnParameter, MAX_SOBOL, SampleSettings, WITHIN};
use crate::case::study::{Parameter, ParameterValues, ReplacedParameter, VariedParameter, evaluate, stated_parameters};
use crate::case::values::ResolvedValue;
use crate::compile::bare_numbers::bare_number_problem;
use crate::compile::compiled::{CompiledQuantity, CompiledTable, CompiledValue};
use crate::compile::template_errors;
use crate::syntax::document::{TomlEntry, TomlNode, TomlTable, TomlValue};
use crate::syntax::error::Problem;
use crate::syntax::expression::is_reserved;
use crate::syntax::schema::{self, Key, MAX_CASES, MAX_POINTS, SAMPLE, ValueType};
use crate::syntax::suggest::{alternatives, excerpt, suggest};
use std::collections::HashMap;
use stickslip::model::is_identifier;

/// Name, numbers, and bounds.
type StatedDistribution = (&'static str, Vec<CompiledQuantity>, Option<[CompiledQuantity; 2]>);

impl Reader {
    /// Reads the parameters: those `given` by a template, whose values the file may replace,
    /// and those that the file adds.
    pub(super) fn parameters(
        &mut self,
        root: &TomlTable,
        given: Vec<Parameter>,
        overrides: &[(String, String)],
    ) -> Option<Vec<Parameter>> {
        let mut stated: Vec<(usize, &TomlNode)> = Vec::new();
        if let Some(entry) = root.get("parameters") {
            let TomlValue::Table(table) = &entry.node.value else {
                let message = format!("expected a table of quantities, found {}", entry.node.value.described());
                self.problems.push(Problem::new(&entry.node.location, "parameters", message));
                return None;
            };
            for entry in &table.entries {
                let problem = |message: String| Problem::new(&entry.key_location, excerpt(&entry.key), message);
                if !is_identifier(&entry.key) {
                    let message = "not a valid parameter name: use a letter first, then letters, digits and `_`";
                    self.problems.push(problem(message.to_owned()));
                } else if is_reserved(&entry.key) {
                    self.problems.push(problem(format!("`{}` is a reserved word in expressions", entry.key)));
                } else if let Some(&index) = self.index.get(&entry.key) {
                    stated.push((index, &entry.node));
                } else {
                    stated.push((self.names.len(), &entry.node));
                    self.index.insert(entry.key.clone(), self.names.len());
                    self.names.push(entry.key.clone());
                }
            }
        }
        let before = self.problems.len();
        let mut parameters = given;
        for (index, node) in stated {
            let name = self.names[index].clone();
            let Some(quantity) = self.quantity(&name, node) else { continue };
            match parameters.get_mut(index) {
                Some(parameter) => parameter.quantity = quantity,
                None => parameters.push(Parameter { quantity, dimension: None }),
            }
        }
        if self.problems.len() > before || parameters.len() < self.names.len() {
            return None;
        }
        self.override_with(&mut parameters, overrides)?;
        Some(parameters)
    }

    fn override_with(&mut self, parameters: &mut [Parameter], overrides: &[(String, String)]) -> Option<()> {
        if overrides.is_empty() {
            return Some(());
        }
        self.fix_dimensions(parameters, &self.index.values().copied().collect::<Vec<_>>())?;
        for (name, text) in overrides {
            let location = self.text(format!("--set {}", excerpt(name)), text.clone());
            let Some(&index) = self.index.get(name) else {
                let message = format!("there is no parameter `{}` to set", excerpt(name));
                let help = match suggest(name, self.names.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None if self.names.is_empty() => "the file has no [parameters]".to_owned(),
                    None => format!(
                        "the parameters are {}",
                        alternatives(self.names.iter().take(20).map(String::as_str)).replace(" or ", ", ")
                    ),
                };
                self.problems.push(Problem::new(&location, excerpt(name), message).help(help));
                continue;
            };
            let node = TomlNode { location, value: TomlValue::Text { text: text.clone(), inner: Some(0) } };
            if let Some(quantity) = self.quantity(name, &node) {
                let own = &parameters[index].quantity;
                if self.template != Some(own.location.source) {
                    self.problems.extend(bare_number_problem(name, [own, &quantity]));
                }
                parameters[index].quantity = quantity;
            }
        }
        Some(())
    }

    /// Fixes the dimension of these parameters to the one in the file; other values must have
    /// the same.
    pub(super) fn fix_dimensions(&mut self, parameters: &mut [Parameter], which: &[usize]) -> Option<()> {
        let order = self.order(parameters, &[])?;
        let values = match evaluate(&self.names, parameters, &order, &HashMap::new(), &[]) {
            Ok(values) => values,
            Err(problem) => {
                let stated = stated_parameters(parameters, &HashMap::new());
                let problem = template_errors::locate_at_user_value(problem, self.template, &self.names, &stated);
                self.problems.push(problem);
                return None;
            }
        };
        for &index in which {
            parameters[index].dimension = parameters[index].dimension.or(values[index].dimension);
        }
        Some(())
    }

    pub(super) fn vary(&mut self, entry: &TomlEntry, parameters: &mut [Parameter]) -> Option<Vec<VariedParameter>> {
        let TomlValue::Table(table) = &entry.node.value else {
            let message = format!("expected a table from parameters to values, found {}", entry.node.value.described());
            let problem = Problem::new(&entry.node.location, "vary", message);
            self.problems.push(problem.help("write it as in vary = { Ft = [\"2 N\", \"4 N\"] }"));
            return None;
        };
        let mut varied = Vec::new();
        for entry in &table.entries {
            let Some(index) = self.parameter(entry, "vary") else { continue };
            let before = self.problems.len();
            let points = match &entry.node.value {
                TomlValue::List(list) => {
                    self.quantities(&entry.key, list, &entry.node.location).map(ParameterValues::List)
                }
                TomlValue::Table(table) => {
                    self.range(table, schema::PARAMETER_RANGE, &entry.key).map(ParameterValues::from)
                }
                _ => self.quantity(&entry.key, &entry.node).map(|quantity| ParameterValues::List(vec![quantity])),
            };
            // the unit in [parameters] counts too, but not that in a template, which the user
            // does not see
            let own = &parameters[index].quantity;
            if let Some(points) = points.as_ref().filter(|_| self.template != Some(own.location.source)) {
                let known = self.problems.len();
                let beside = bare_number_problem(&entry.key, std::iter::once(own).chain(points.quantities()));
                self.problems.extend(beside.filter(|_| known == before));
            }
            varied.extend(points.map(|points| VariedParameter {
                index,
                location: entry.node.location.clone(),
                points,
            }));
        }
        let indices: Vec<usize> = varied.iter().map(|varied| varied.index).collect();
        if self.problems.is_empty() {
            self.fix_dimensions(parameters, &indices)?;
        }
        Some(varied)
    }

    /// Reads `over`: the ranges of the two parameters of a map. `listed` are those of `vary`.
    pub(super) fn over(
        &mut self,
        root: &TomlTable,
        entry: &TomlEntry,
        parameters: &mut [Parameter],
        listed: &[VariedParameter],
    ) -> Option<Vec<VariedParameter>> {
        let example = "write it as in over = { Ft = { from = \"1 N\", to = \"20 N\", points = 25 }, kt = { from = \
            \"1 N/mm\", to = \"100 N/mm\", points = 25, scale = \"log\" } }";
        let table = match &entry.node.value {
            TomlValue::Table(table) if table.entries.len() == 2 => table,
            found => {
                let found = match found {
                    TomlValue::Table(table) => format!("{} of them", table.entries.len()),
                    other => other.described(),
                };
                let message = format!("a map needs the ranges of two parameters, found {found}");
                self.problems.push(Problem::new(&entry.node.location, "over", message).help(example));
                return None;
            }
        };
        if let Some(sample) = root.get("sample") {
            let message = "a map has no random draws";
            let help = "remove [sample], or use kind = \"performance\", whose figure shows percentiles";
            self.problems.push(Problem::new(&sample.key_location, "sample", message).help(help));
        }
        let mut mapped = Vec::new();
        for entry in &table.entries {
            let Some(index) = self.parameter(entry, "map") else { continue };
            let TomlValue::Table(range) = &entry.node.value else {
                let message = format!("expected a range, found {}", entry.node.value.described());
                self.problems.push(Problem::new(&entry.node.location, excerpt(&entry.key), message).help(example));
                continue;
            };
            if listed.iter().any(|varied| varied.index == index) {
                let message = format!("`{}` is also in `vary`: remove it from one of them", excerpt(&entry.key));
                self.problems.push(Problem::new(&entry.key_location, excerpt(&entry.key), message));
                continue;
            }
            let Some(range) = self.range(range, schema::PARAMETER_RANGE, &entry.key) else { continue };
            let own = &parameters[index].quantity;
            if self.template != Some(own.location.source) {
                self.problems.extend(bare_number_problem(&entry.key, [own, &range.from, &range.to]));
            }
            let (location, points) = (entry.node.location.clone(), range.into());
            mapped.push(VariedParameter { index, location, points });
        }
        let indices: Vec<usize> = mapped.iter().map(|varied| varied.index).collect();
        if self.problems.is_empty() {
            self.fix_dimensions(parameters, &indices)?;
        }
        Some(mapped)
    }

    /// Reads `[sample]`: the design of the draws, and the drawn parameters.
    pub(super) fn sample(
        &mut self,
        root: &TomlTable,
        parameters: &mut [Parameter],
        listed: &[VariedParameter],
    ) -> Option<(Option<SampleSettings>, Vec<VariedParameter>)> {
        let Some(entry) = root.get("sample") else { return Some((None, Vec::new())) };
        let TomlValue::Table(table) = &entry.node.value else {
            let message = format!("expected a table, found {}", entry.node.value.described());
            let help = "write [sample] and below it count = 1000 and of = { Ft = { normal = [\"2 N\", \"0.2 N\"] } }";
            self.problems.push(Problem::new(&entry.node.location, "sample", message).help(help));
            return None;
        };
        self.check_keys(table, SAMPLE, "`[sample]`");
        let rest: Vec<Key> =
            SAMPLE.iter().copied().filter(|key| !matches!(key.takes, ValueType::Distributions)).collect();
        let stated = self.compile_table(table, &rest);
        let count = |key: &str| match stated.entry(key).map(|entry| &entry.value) {
            Some(CompiledValue::Fixed(ResolvedValue::Count(count))) => Some(*count),
            _ => None,
        };
        let design = match stated.entry("design").map(|entry| &entry.value) {
            Some(CompiledValue::Fixed(ResolvedValue::Text(name))) => {
                DESIGNS.iter().find(|(known, ..)| known == name).map(|row| row.2)
            }
            _ => None,
        };
        let distributions = &table.get("of")?.node;
        let TomlValue::Table(of) = &distributions.value else {
            let message =
                format!("expected a table from parameters to distributions, found {}", distributions.value.described());
            let help = "write it as in of = { Ft = { normal = [\"2 N\", \"0.2 N\"] } }";
            self.problems.push(Problem::new(&table.get("of")?.node.location, "of", message).help(help));
            return None;
        };
        let sample =
            SampleSettings { count: usize::try_from(count("count")?).ok()?, seed: count("seed")?, design: design? };
        if of.entries.is_empty() {
            let message = "no parameter is drawn: name at least one";
            self.problems.push(Problem::new(&table.get("of")?.node.location, "of", message));
        }
        if sample.design == Design::Sobol && of.entries.len() > MAX_SOBOL {
            let message = format!("the Sobol design supports up to {MAX_SOBOL} parameters, found {}", of.entries.len());
            let help = "use design = \"latin-hypercube\"";
            self.problems.push(Problem::new(&table.get("of")?.node.location, "design", message).help(help));
        }
        let mut drawn = Vec::new();
        for (coordinate, entry) in of.entries.iter().enumerate() {
            let Some(index) = self.parameter(entry, "draw") else { continue };
            if listed.iter().any(|varied| varied.index == index) {
                let message =
                    format!("`{}` is also in `vary`: a parameter is either listed or drawn", excerpt(&entry.key));
                self.problems.push(Problem::new(&entry.key_location, excerpt(&entry.key), message));
                continue;
            }
            let Some((distribution, numbers, within)) = self.distribution(entry) else { continue };
            let points = ParameterValues::Drawn(DrawnParameter { sample, coordinate, distribution, numbers, within });
            drawn.push(VariedParameter { index, location: entry.node.location.clone(), points });
        }
        let indices: Vec<usize> = drawn.iter().map(|drawn| drawn.index).collect();
        if self.problems.is_empty() {
            self.fix_dimensions(parameters, &indices)?;
        }
        Some((Some(sample), drawn))
    }

    /// Reads a distribution: `{ normal = [mean, deviation], within = [least, most] }`.
    fn distribution(&mut self, entry: &TomlEntry) -> Option<StatedDistribution> {
        let names = || DISTRIBUTIONS.iter().map(|(name, ..)| *name);
        let example = "write it as in { normal = [\"2 N\", \"0.2 N\"] }";
        let TomlValue::Table(table) = &entry.node.value else {
            let message = format!("expected a distribution, found {}", entry.node.value.described());
            self.problems.push(Problem::new(&entry.node.location, excerpt(&entry.key), message).help(example));
            return None;
        };
        let (mut found, mut within) = (None, None);
        for part in &table.entries {
            let TomlValue::List(list) = &part.node.value else {
                let message = format!("expected a list of quantities, found {}", part.node.value.described());
                self.problems.push(Problem::new(&part.node.location, excerpt(&part.key), message).help(example));
                return None;
            };
            let quantities = self.quantities(&entry.key, list, &part.node.location)?;
            let row = DISTRIBUTIONS.iter().find(|(name, ..)| *name == part.key);
            match (row, <[CompiledQuantity; 2]>::try_from(quantities)) {
                (None, Ok(bounds)) if part.key == WITHIN => within = Some(bounds),
                (None, Err(_)) if part.key == WITHIN => {
                    let message = "expected two bounds: the least and the largest value";
                    self.problems.push(Problem::new(&part.node.location, WITHIN, message));
                    return None;
                }
                (Some((name, ..)), quantities) if found.is_none() => {
                    found = Some((*name, quantities.map_or_else(|all| all, Vec::from)));
                }
                (Some(_), _) => {
                    let message = "a parameter has one distribution";
                    self.problems.push(Problem::new(&part.key_location, excerpt(&part.key), message));
                    return None;
                }
                (None, _) => {
                    self.unknown_word("distribution", &part.key, &part.key_location, names().chain([WITHIN]).collect());
                    return None;
                }
            }
        }
        match found {
            Some((name, numbers)) => Some((name, numbers, within)),
            None => {
                let message = format!("a distribution is missing: one of {}", alternatives(names()));
                self.problems.push(Problem::new(&entry.node.location, excerpt(&entry.key), message).help(example));
                None
            }
        }
    }

    /// Returns the parameter that an entry of `vary`, of `fit` or of a sample names.
    pub(super) fn parameter(&mut self, entry: &TomlEntry, what: &str) -> Option<usize> {
        if let Some(&index) = self.index.get(&entry.key) {
            return Some(index);
        }
        let message = format!("there is no parameter `{}` to {what}", excerpt(&entry.key));
        let help = match suggest(&entry.key, self.names.iter().map(String::as_str)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("add it to [parameters] and use it in the model: {} = \"…\"", excerpt(&entry.key)),
        };
        self.problems.push(Problem::new(&entry.key_location, excerpt(&entry.key), message).help(help));
        None
    }

    /// Replaces all values of a varied parameter by its value from the command line, which
    /// leaves one value.
    pub(super) fn replace(
        &self,
        varied: &mut [VariedParameter],
        parameters: &[Parameter],
        overrides: &[(String, String)],
    ) -> Vec<ReplacedParameter> {
        let mut replaced = Vec::new();
        for varied in varied {
            let name = &self.names[varied.index];
            let Some((_, text)) = overrides.iter().rfind(|(set, _)| set == name) else { continue };
            replaced.push(ReplacedParameter {
                name: name.clone(),
                text: text.trim().to_owned(),
                values: varied.points.len(),
            });
            let quantity = parameters[varied.index].quantity.clone();
            varied.location = quantity.location.clone();
            varied.points = ParameterValues::List(vec![quantity]);
        }
        replaced
    }

    /// Returns an order in which the parameters can be evaluated. A cycle is an error.
    pub(super) fn order(&mut self, parameters: &[Parameter], varied: &[VariedParameter]) -> Option<Vec<usize>> {
        let mut needs: Vec<Vec<usize>> =
            parameters.iter().map(|p| p.quantity.expression.parameters().collect()).collect();
        // a cycle needs one value of each varied parameter, and the cases contain every
        // combination
        for varied in varied {
            needs[varied.index] = varied.points.quantities().flat_map(|q| q.expression.parameters()).collect();
        }
        match topological_order(&needs) {
            Ok(order) => Some(order),
            Err(circle) => {
                let first = circle[0];
                let location = match varied.iter().find(|varied| varied.index == first) {
                    Some(varied) => &varied.location,
                    None => &parameters[first].quantity.location,
                };
                let mut shown: Vec<&str> = circle.iter().map(|&i| self.names[i].as_str()).collect();
                shown.push(shown[0]);
                if shown.len() > 12 {
                    shown.splice(6..shown.len() - 5, ["…"]);
                }
                let message = format!("the parameters depend on each other in a cycle: {}", shown.join(" -> "));
                let problem = Problem::new(location, self.names[first].clone(), message);
                self.problems.push(problem.help("give one of them a fixed value"));
                None
            }
        }
    }

    pub(super) fn limit_points(
        &mut self,
        study: &CompiledTable,
        varied: &[VariedParameter],
        sample: Option<SampleSettings>,
    ) -> Option<()> {
        let listed = varied.iter().filter(|varied| !matches!(varied.points, ParameterValues::Drawn(_)));
        let draws = sample.map_or(1, |sample| sample.count);
        let cases = listed.fold(draws, |product, varied| product.saturating_mul(varied.points.len()));
        let frequency = study.entry("frequency");
        let frequencies = match frequency.map(|entry| &entry.value) {
            Some(CompiledValue::List(list, _)) => list.len(),
            Some(CompiledValue::Range { points, .. }) => *points,
            _ => 1,
        };
        if cases <= MAX_CASES && cases.saturating_mul(frequencies) <= MAX_POINTS {
            return Some(());
        }
        let (location, key) = match (frequency, varied.first()) {
            (Some(entry), _) if frequencies >= cases => (&entry.location, "frequency"),
            (_, Some(varied)) => (&varied.location, "vary"),
            _ => (&study.location, "frequency"),
        };
        let message = format!(
            "{cases} cases times {frequencies} frequencies exceed the limit of {MAX_CASES} cases and {MAX_POINTS} \
             points"
        );
        self.problems.push(Problem::new(location, key, message).help("split the study, or use fewer points"));
        None
    }
}

impl From<StatedRange> for ParameterValues {
    fn from(StatedRange { from, to, points, scale }: StatedRange) -> ParameterValues {
        ParameterValues::Range { from, to, points, scale }
    }
}

/// Returns a topological order of a graph, or a cycle that starts at its lowest index.
///
/// The function is not recursive, because chains can be long.
fn topological_order(needs: &[Vec<usize>]) -> Result<Vec<usize>, Vec<usize>> {
    #[derive(Clone, Copy, PartialEq)]
    enum VisitState {
        New,
        Open,
        Done,
    }
    let mut state = vec![VisitState::New; needs.len()];
    let mut order = Vec::with_capacity(needs.len());
    for root in 0..needs.len() {
        if state[root] != VisitState::New {
            continue;
        }
        let mut path = vec![(root, 0)];
        state[root] = VisitState::Open;
        while let Some((node, next)) = path.last_mut() {
            let node = *node;
            match needs[node].get(*next) {
                None => {
                    state[node] = VisitState::Done;
                    order.push(node);
                    path.pop();
                }
                Some(&need) => {
                    *next += 1;
                    match state[need] {
                        VisitState::New => {
                            state[need] = VisitState::Open;
                            path.push((need, 0));
                        }
                        VisitState::Open => {
                            let start = path.iter().position(|(n, _)| *n == need).unwrap_or(0);
                            let mut circle: Vec<usize> = path[start..].iter().map(|(n, _)| *n).collect();
                            let lowest = (0..circle.len()).min_by_key(|i| circle[*i]).unwrap_or(0);
                            circle.rotate_left(lowest);
                            return Err(circle);
                        }
                        VisitState::Done => {}
                    }
                }
            }
        }
    }
    Ok(order)
}
