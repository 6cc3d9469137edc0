//! `[parameters]`, values from outside the file, and `vary`: which there are, in which order they can be evaluated, how many cases they make.

use super::reader::Reader;
use crate::document::{Content, Entry, Node, Table};
use crate::error::Problem;
use crate::expression::is_reserved;
use crate::near::{nearest, one_of, shown};
use crate::schema::{self, MOST_POINTS};
use crate::statement::{Stated, StatedTable};
use crate::study::{Parameter, Replaced, Varied, VariedPoints, evaluate};
use std::collections::HashMap;
use stickslip::model::is_identifier;

impl Reader {
    /// The parameters: those `given` by a template, whose values the file may replace, and those that the file adds.
    pub(super) fn parameters(
        &mut self,
        root: &Table,
        given: Vec<Parameter>,
        overrides: &[(String, String)],
    ) -> Option<Vec<Parameter>> {
        let mut stated: Vec<(usize, &Node)> = Vec::new();
        if let Some(entry) = root.get("parameters") {
            let Content::Table(table) = &entry.node.value else {
                let message = format!("expected a table of quantities, found {}", entry.node.value.described());
                self.problems.push(Problem::new(&entry.node.place, "parameters", message));
                return None;
            };
            for entry in &table.entries {
                let problem = |message: String| Problem::new(&entry.key_place, shown(&entry.key), message);
                if !is_identifier(&entry.key) {
                    let message = "no name of a parameter: a letter first, then letters, digits and `_`";
                    self.problems.push(problem(message.to_owned()));
                } else if is_reserved(&entry.key) {
                    self.problems.push(problem(format!("`{}` has a meaning of its own in expressions", entry.key)));
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
        self.settle_dimensions(parameters, &self.index.values().copied().collect::<Vec<_>>())?;
        for (name, text) in overrides {
            let place = self.text(format!("--set {}", shown(name)), text.clone());
            let Some(&index) = self.index.get(name) else {
                let message = format!("there is no parameter `{}` to set", shown(name));
                let help = match nearest(name, self.names.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None if self.names.is_empty() => "the file has no [parameters]".to_owned(),
                    None => format!(
                        "the parameters are {}",
                        one_of(self.names.iter().take(20).map(String::as_str)).replace(" or ", ", ")
                    ),
                };
                self.problems.push(Problem::new(&place, shown(name), message).help(help));
                continue;
            };
            let node = Node { place, value: Content::Text { text: text.clone(), inner: Some(0) } };
            if let Some(quantity) = self.quantity(name, &node) {
                parameters[index].quantity = quantity;
            }
        }
        Some(())
    }

    /// Gives these parameters the dimension that they have in the file, so that other values must have it too.
    pub(super) fn settle_dimensions(&mut self, parameters: &mut [Parameter], which: &[usize]) -> Option<()> {
        let order = self.order(parameters, &[])?;
        let values = match evaluate(&self.names, parameters, &order, &HashMap::new(), &[]) {
            Ok(values) => values,
            Err(problem) => {
                self.problems.push(problem);
                return None;
            }
        };
        for &index in which {
            parameters[index].dimension = parameters[index].dimension.or(values[index].dimension);
        }
        Some(())
    }

    pub(super) fn vary(&mut self, entry: &Entry, parameters: &mut [Parameter]) -> Option<Vec<Varied>> {
        let Content::Table(table) = &entry.node.value else {
            let message = format!("expected a table from parameters to values, found {}", entry.node.value.described());
            let problem = Problem::new(&entry.node.place, "vary", message);
            self.problems.push(problem.help("write it as in vary = { Ft = [\"2 N\", \"4 N\"] }"));
            return None;
        };
        let mut varied = Vec::new();
        for entry in &table.entries {
            let Some(&index) = self.index.get(&entry.key) else {
                let message = format!("there is no parameter `{}` to vary", shown(&entry.key));
                let help = match nearest(&entry.key, self.names.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("add it to [parameters] and use it in the model: {} = \"…\"", shown(&entry.key)),
                };
                self.problems.push(Problem::new(&entry.key_place, shown(&entry.key), message).help(help));
                continue;
            };
            let points = match &entry.node.value {
                Content::List(list) => self.quantities(&entry.key, list, &entry.node.place).map(VariedPoints::List),
                Content::Table(table) => self
                    .range(table, schema::RANGE, &entry.key)
                    .map(|(from, to, points)| VariedPoints::Range { from, to, points }),
                _ => self.quantity(&entry.key, &entry.node).map(|quantity| VariedPoints::List(vec![quantity])),
            };
            varied.extend(points.map(|points| Varied { index, place: entry.node.place.clone(), points }));
        }
        let which: Vec<usize> = varied.iter().map(|varied| varied.index).collect();
        if self.problems.is_empty() {
            self.settle_dimensions(parameters, &which)?;
        }
        Some(varied)
    }

    /// A value from outside the file stands for all values that `vary` gives its parameter: one case has it.
    pub(super) fn replace(
        &self,
        varied: &mut [Varied],
        parameters: &[Parameter],
        overrides: &[(String, String)],
    ) -> Vec<Replaced> {
        let mut replaced = Vec::new();
        for varied in varied {
            let name = &self.names[varied.index];
            let Some((_, text)) = overrides.iter().rfind(|(set, _)| set == name) else { continue };
            replaced.push(Replaced { name: name.clone(), text: text.trim().to_owned(), values: varied.points.len() });
            let quantity = parameters[varied.index].quantity.clone();
            varied.place = quantity.place.clone();
            varied.points = VariedPoints::List(vec![quantity]);
        }
        replaced
    }

    /// The order in which parameters can be evaluated; a circle is an error.
    pub(super) fn order(&mut self, parameters: &[Parameter], varied: &[Varied]) -> Option<Vec<usize>> {
        let mut needs: Vec<Vec<usize>> =
            parameters.iter().map(|p| p.quantity.expression.parameters().collect()).collect();
        // a circle goes through one entry of each varied parameter, and the outer product contains that combination
        for varied in varied {
            needs[varied.index] = varied.points.quantities().flat_map(|q| q.expression.parameters()).collect();
        }
        match sorted(&needs) {
            Ok(order) => Some(order),
            Err(circle) => {
                let first = circle[0];
                let place = match varied.iter().find(|varied| varied.index == first) {
                    Some(varied) => &varied.place,
                    None => &parameters[first].quantity.place,
                };
                let mut shown: Vec<&str> = circle.iter().map(|&i| self.names[i].as_str()).collect();
                shown.push(shown[0]);
                if shown.len() > 12 {
                    shown.splice(6..shown.len() - 5, ["…"]);
                }
                let message = format!("the parameters need each other in a circle: {}", shown.join(" -> "));
                let problem = Problem::new(place, self.names[first].clone(), message);
                self.problems.push(problem.help("give one of them a value of its own"));
                None
            }
        }
    }

    pub(super) fn limit_points(&mut self, study: &StatedTable, varied: &[Varied]) -> Option<()> {
        let cases = varied.iter().fold(1usize, |product, varied| product.saturating_mul(varied.points.len()));
        let frequency = study.entry("frequency");
        let frequencies = match frequency.map(|entry| &entry.value) {
            Some(Stated::List(list)) => list.len(),
            Some(Stated::Range { points, .. }) => *points,
            _ => 1,
        };
        if cases.saturating_mul(frequencies) <= MOST_POINTS {
            return Some(());
        }
        let (place, key) = match (frequency, varied.first()) {
            (Some(entry), _) if frequencies >= cases => (&entry.place, "frequency"),
            (_, Some(varied)) => (&varied.place, "vary"),
            _ => (&study.place, "frequency"),
        };
        let message =
            format!("{cases} cases times {frequencies} frequencies are too many: the limit is {MOST_POINTS} points");
        self.problems.push(Problem::new(place, key, message).help("split the study, or take fewer points"));
        None
    }
}

/// Topological order of a graph, or a circle in it (starting at its lowest index). Not recursive: chains can be long.
fn sorted(needs: &[Vec<usize>]) -> Result<Vec<usize>, Vec<usize>> {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done,
    }
    let mut state = vec![State::New; needs.len()];
    let mut order = Vec::with_capacity(needs.len());
    for root in 0..needs.len() {
        if state[root] != State::New {
            continue;
        }
        let mut path = vec![(root, 0)];
        state[root] = State::Open;
        while let Some((node, next)) = path.last_mut() {
            let node = *node;
            match needs[node].get(*next) {
                None => {
                    state[node] = State::Done;
                    order.push(node);
                    path.pop();
                }
                Some(&need) => {
                    *next += 1;
                    match state[need] {
                        State::New => {
                            state[need] = State::Open;
                            path.push((need, 0));
                        }
                        State::Open => {
                            let start = path.iter().position(|(n, _)| *n == need).unwrap_or(0);
                            let mut circle: Vec<usize> = path[start..].iter().map(|(n, _)| *n).collect();
                            let lowest = (0..circle.len()).min_by_key(|i| circle[*i]).unwrap_or(0);
                            circle.rotate_left(lowest);
                            return Err(circle);
                        }
                        State::Done => {}
                    }
                }
            }
        }
    }
    Ok(order)
}
