//! The quantities of a study file that can be changed.
//!
//! The tables of keys of the study crate say which keys take quantities and in which range. A
//! value is either a plain quantity (a number and a unit), which gets a slider, or an expression
//! over parameters, which is a text.

use serde::{Deserialize, Serialize};
use std::fmt;
use stickslip::law;
use stickslip_study::expression::Expression;
use stickslip_study::schema::{Bounds, FILE, Key, METHOD, STUDY, ValueType};
use stickslip_study::{kinds, templates};
use toml_edit::{DocumentMut, Item, TableLike, Value};

/// One step of a path in a study file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Step {
    /// Element of a list, from 0.
    Index(usize),
    /// Key of a table.
    Key(String),
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Step::Index(index) => write!(f, "{index}"),
            Step::Key(key) => write!(f, "{key}"),
        }
    }
}

/// Returns the path that a text such as `joint.0.law.limit` states.
pub fn path(text: &str) -> Vec<Step> {
    let step = |step: &str| step.parse().map_or_else(|_| Step::Key(step.to_owned()), Step::Index);
    text.split('.').filter(|step| !step.is_empty()).map(step).collect()
}

/// A quantity of a study file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// Its place in the file.
    pub path: Vec<Step>,
    /// Its name, the last key.
    pub name: String,
    /// Owner of the quantity, such as `joint shroud`.
    pub group: String,
    /// One line that describes it.
    pub doc: String,
    /// Its value as text.
    pub text: String,
    /// Its number, if it is plain.
    pub number: Option<f64>,
    /// The unit of the number.
    pub unit: String,
    /// Its range.
    pub range: QuantityRange,
    /// True if the value is that of a template and the file does not state it.
    pub inherited: bool,
    /// The values of `vary` or the ends of a range, if the parameter is varied.
    pub varied: Option<Vec<String>>,
}

/// The numbers that a quantity can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum QuantityRange {
    /// Any number.
    Any,
    /// Zero or more.
    Zero,
    /// More than zero.
    Positive,
    /// A whole number from 1.
    Count,
}

impl From<Bounds> for QuantityRange {
    fn from(bounds: Bounds) -> QuantityRange {
        match bounds {
            Bounds::Finite => QuantityRange::Any,
            Bounds::AtLeastZero => QuantityRange::Zero,
            Bounds::Positive => QuantityRange::Positive,
        }
    }
}

/// Returns the quantities of a study in the order of its file.
///
/// # Example
/// ```
/// use stickslip_explore::quantities::quantities;
/// let text = stickslip_study::templates::find("blade-couple").unwrap().study;
/// let all = quantities(&text.parse().unwrap());
/// let limit = all.iter().find(|quantity| quantity.name == "Ft").unwrap();
/// assert_eq!((limit.number, limit.unit.as_str()), (Some(2.0), "N"));
/// assert_eq!(limit.doc, "slip limit");
/// assert_eq!(limit.varied.as_ref().unwrap().len(), 4);
/// ```
pub fn quantities(document: &DocumentMut) -> Vec<Quantity> {
    let mut found = Vec::new();
    walk(document.as_item(), FILE, &Place { path: Vec::new(), group: String::new() }, &mut found);
    inherited(document, &mut found);
    for quantity in found.iter_mut().filter(|quantity| quantity.group == PARAMETERS) {
        quantity.varied = varied(document, &quantity.name);
    }
    found
}

/// Group of the entries of `[parameters]`.
const PARAMETERS: &str = "parameters";

/// A table during the search, and the group of its quantities.
struct Place {
    path: Vec<Step>,
    group: String,
}

impl Place {
    fn below(&self, step: Step, group: String) -> Place {
        Place { path: self.path.iter().cloned().chain([step]).collect(), group }
    }
}

fn walk(item: &Item, keys: &[Key], place: &Place, found: &mut Vec<Quantity>) {
    let Some(table) = item.as_table_like() else { return };
    for (name, item) in table.iter() {
        let Some(key) = keys.iter().find(|key| key.name == name) else { continue };
        let group = if place.group.is_empty() { name.to_owned() } else { place.group.clone() };
        let below = place.below(Step::Key(name.to_owned()), group);
        match key.takes {
            ValueType::Quantity(_, bounds) | ValueType::Quantities(_, bounds) => {
                found.extend(quantity(item, below, key.doc, bounds.into()));
            }
            ValueType::Table(keys) | ValueType::TableOrFalse(keys) => walk(item, keys, &below, found),
            ValueType::List(keys) => list(item, keys, &below, found),
            ValueType::Law => law_parameters(item, &below, found),
            ValueType::Parameters => parameters(item, &below, found),
            ValueType::Frequencies(keys) => match item.as_table_like() {
                Some(_) => walk(item, keys, &Place { group: "frequency".to_owned(), ..below }, found),
                None => found.extend(quantity(item, below, key.doc, QuantityRange::Positive)),
            },
            ValueType::Study => {
                let kind = table_of(item).and_then(|table| kinds::find(table.get("kind")?.as_str()?));
                let keys: Vec<Key> = STUDY.iter().chain(kind.map_or(&[][..], |kind| kind.info.keys)).copied().collect();
                walk(item, &keys, &below, found);
            }
            ValueType::Method => method_options(item, &below, found),
            ValueType::Count(..) if name == "points" => {
                found.extend(quantity(item, below, key.doc, QuantityRange::Count));
            }
            _ => {}
        }
    }
}

fn table_of(item: &Item) -> Option<&dyn TableLike> {
    item.as_table_like()
}

/// Visits the entries of a list such as `[[mass]]`. An entry is named by its `name`, by the
/// places that it connects or on which it acts, or by its number.
fn list(item: &Item, keys: &[Key], place: &Place, found: &mut Vec<Quantity>) {
    for index in 0.. {
        let Some(entry) = item.get(index) else { break };
        let word = |key: &str| entry.get(key).and_then(Item::as_str).map(str::to_owned);
        let pair = entry
            .get("between")
            .and_then(Item::as_array)
            .map(|pair| pair.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(" – "));
        let name = word("name").or(pair).or_else(|| word("on")).unwrap_or_else(|| (index + 1).to_string());
        walk(entry, keys, &place.below(Step::Index(index), format!("{} {name}", place.group)), found);
    }
}

fn law_parameters(item: &Item, place: &Place, found: &mut Vec<Quantity>) {
    let Some(row) = item.get("kind").and_then(Item::as_str).and_then(law::find) else { return };
    for parameter in row.parameters {
        let Some(value) = item.get(parameter.key) else { continue };
        let range = match parameter.range {
            law::Range::Positive => QuantityRange::Positive,
            law::Range::ZeroOrMore => QuantityRange::Zero,
            law::Range::Any | law::Range::Within(..) => QuantityRange::Any,
            law::Range::Count(_) | law::Range::UpTo(_) => QuantityRange::Count,
        };
        let below = place.below(Step::Key(parameter.key.to_owned()), place.group.clone());
        found.extend(quantity(value, below, parameter.doc, range));
    }
}

fn method_options(item: &Item, place: &Place, found: &mut Vec<Quantity>) {
    let Some(table) = item.as_table_like() else { return };
    let name = table.get("kind").and_then(Item::as_str).unwrap_or("auto");
    let Some(row) = stickslip::method::find(name) else { return };
    for option in row.options {
        let Some(value) = table.get(option.key) else { continue };
        let range = if option.count { QuantityRange::Count } else { QuantityRange::Positive };
        found.extend(quantity(
            value,
            place.below(Step::Key(option.key.to_owned()), place.group.clone()),
            option.doc,
            range,
        ));
    }
}

fn parameters(item: &Item, place: &Place, found: &mut Vec<Quantity>) {
    let Some(table) = item.as_table_like() else { return };
    for (name, item) in table.iter() {
        let comment = item.as_value().and_then(|value| value.decor().suffix()?.as_str()).unwrap_or_default();
        let doc = comment.trim().strip_prefix('#').unwrap_or_default().trim();
        let below = place.below(Step::Key(name.to_owned()), place.group.clone());
        // a whole number without a unit counts something, such as blades
        let counts = item.as_integer().is_some_and(|number| number > 1);
        let range = if counts { QuantityRange::Count } else { QuantityRange::Any };
        found.extend(quantity(item, below, doc, range));
    }
}

fn quantity(item: &Item, place: Place, doc: &str, range: QuantityRange) -> Option<Quantity> {
    let (text, bare) = match item.as_value()? {
        Value::String(text) => (text.value().clone(), None),
        Value::Float(number) => (number.value().to_string(), Some(*number.value())),
        Value::Integer(number) => (number.value().to_string(), Some(*number.value() as f64)),
        _ => return None,
    };
    let plain = bare.map(|number| (number, String::new())).or_else(|| split(&text));
    let (number, unit) = plain.map_or((None, String::new()), |(number, unit)| (Some(number), unit));
    let name = place.path.last().map_or_else(String::new, Step::to_string);
    Some(Quantity {
        path: place.path,
        name,
        group: place.group,
        doc: doc.to_owned(),
        text,
        number,
        unit,
        range,
        inherited: false,
        varied: None,
    })
}

/// Splits a plain quantity into its number and its unit; `None` for an expression.
fn split(text: &str) -> Option<(f64, String)> {
    let text = text.trim();
    let ends = text.char_indices().map(|(at, _)| at).skip(1).chain([text.len()]);
    let number = |end: usize| text[..end].trim_end().parse::<f64>().ok().filter(|number| number.is_finite());
    let end = ends.filter(|end| number(*end).is_some()).last()?;
    let unit = text[end..].trim();
    // `2 * 3 N` and `1 N + 1 N` are expressions; a unit must be known
    let is_plain = Expression::compile::<&str>(text, &[]).is_ok_and(|expression| expression.is_literal());
    is_plain.then_some((number(end)?, unit.to_owned()))
}

/// Adds the parameters of a template that the file does not state.
fn inherited(document: &DocumentMut, found: &mut Vec<Quantity>) {
    let name = document.get("model").and_then(|model| model.get("template")?.as_str());
    let Some(template) = name.and_then(templates::find) else { return };
    for parameter in template.parameters() {
        if found.iter().any(|known| known.group == PARAMETERS && known.name == parameter.key) {
            continue;
        }
        let value = Item::Value(Value::from(parameter.default.as_str()));
        let steps = [PARAMETERS, &parameter.key].map(|key| Step::Key(key.to_owned()));
        let place = Place { path: steps.to_vec(), group: PARAMETERS.to_owned() };
        let own = quantity(&value, place, &parameter.doc, QuantityRange::Any);
        found.extend(own.map(|own| Quantity { inherited: true, ..own }));
    }
}

/// Returns the values of a parameter in `vary` as texts.
fn varied(document: &DocumentMut, name: &str) -> Option<Vec<String>> {
    let text = |value: &Value| match value {
        Value::String(text) => text.value().clone(),
        other => other.to_string().trim().to_owned(),
    };
    let item = document.get("study")?.get("vary")?.get(name)?;
    match (item.as_array(), item.as_table_like()) {
        (Some(list), _) => Some(list.iter().map(text).collect()),
        (_, Some(range)) => {
            Some(["from", "to"].iter().filter_map(|key| range.get(key)?.as_value().map(text)).collect())
        }
        _ => item.as_value().map(|value| vec![text(value)]),
    }
}

/// Returns what the key at a path takes; `None` if the tables of a study file have no such key.
pub(crate) fn takes(document: &Item, path: &[Step]) -> Option<ValueType> {
    takes_below(document, FILE, path)
}

fn takes_below(item: &Item, keys: &[Key], path: &[Step]) -> Option<ValueType> {
    let (Step::Key(name), rest) = path.split_first()? else { return None };
    let key = keys.iter().find(|key| key.name == *name)?;
    if rest.is_empty() {
        return Some(key.takes);
    }
    let below = item.get(name.as_str());
    match key.takes {
        // a parameter that only a template has may be added
        ValueType::Parameters => (rest.len() == 1).then_some(key.takes),
        ValueType::Vary => (rest.len() == 1).then_some(key.takes),
        ValueType::Table(keys) | ValueType::TableOrFalse(keys) | ValueType::Frequencies(keys) => {
            takes_below(below?, keys, rest)
        }
        ValueType::List(keys) => match rest {
            [Step::Index(index), rest @ ..] => takes_below(below?.get(*index)?, keys, rest),
            _ => None,
        },
        ValueType::Law => {
            let row = law::find(below?.get("kind")?.as_str()?)?;
            let known = |step: &Step| row.parameters.iter().any(|parameter| parameter.key == step.to_string());
            matches!(rest, [step] if known(step))
                .then_some(ValueType::Quantity(stickslip::dimension::Dimension::NONE, Bounds::Finite))
        }
        ValueType::Study => {
            let kind = kinds::find(below?.get("kind")?.as_str()?)?;
            let keys: Vec<Key> = STUDY.iter().chain(kind.info.keys).copied().collect();
            takes_below(below?, &keys, rest)
        }
        ValueType::Method => {
            let row = stickslip::method::find(below?.get("kind").and_then(Item::as_str).unwrap_or("auto"))?;
            let known = |step: &Step| row.options.iter().any(|option| option.key == step.to_string());
            let is_kind = |step: &Step| METHOD.iter().any(|key| key.name == step.to_string());
            matches!(rest, [step] if known(step) && !is_kind(step)).then_some(ValueType::Count(1, i64::MAX))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Vec<Quantity> {
        quantities(&text.parse().unwrap())
    }

    #[test]
    fn plain_quantities_have_a_number_and_expressions_have_not() {
        assert_eq!(split("2 N"), Some((2.0, "N".to_owned())));
        assert_eq!(split("1e3N/m"), Some((1e3, "N/m".to_owned())));
        assert_eq!(split(" -0.5 mm "), Some((-0.5, "mm".to_owned())));
        assert_eq!(split("12"), Some((12.0, String::new())));
        for text in ["m / 100", "2 * 3 N", "Ft", "", "inf N", "2 bananas", "1 N + 1 N"] {
            assert_eq!(split(text), None, "{text}");
        }
    }

    #[test]
    fn all_tables_of_a_model_are_searched() {
        let text = "schema = 1\nparameters = { a = \"1 N\" }\n[[mass]]\nname = \"m\"\nmass = \"2 kg\"\n\
                    [[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"5 N/m\"\ndamping = 0.1\n\
                    [[joint]]\nname = \"j\"\nbetween = [\"m\", \"ground\"]\nlaw = { kind = \"jenkins\", stiffness = \"1 N/m\", limit = \"a\" }\n\
                    [[force]]\non = \"m\"\namplitude = \"1 N\"\n[study]\nkind = \"response\"\n\
                    frequency = { from = \"1 Hz\", to = \"2 Hz\", points = 5 }\n[method]\nkind = \"harmonic-balance\"\nharmonics = 7\n";
        let found: Vec<String> = of(text)
            .iter()
            .map(|quantity| quantity.path.iter().map(Step::to_string).collect::<Vec<_>>().join("."))
            .collect();
        assert_eq!(
            found,
            [
                "parameters.a",
                "mass.0.mass",
                "spring.0.stiffness",
                "spring.0.damping",
                "joint.0.law.stiffness",
                "joint.0.law.limit",
                "force.0.amplitude",
                "study.frequency.from",
                "study.frequency.to",
                "study.frequency.points",
                "method.harmonics",
            ]
        );
        let document: DocumentMut = text.parse().unwrap();
        for place in &found {
            assert!(takes(document.as_item(), &path(place)).is_some(), "{place}");
        }
    }

    #[test]
    fn parameters_of_a_template_can_be_set() {
        let text = "schema = 1\nmodel = { template = \"blade-couple\" }\n[parameters]\nFt = \"3 N\"\n[study]\n\
                    kind = \"response\"\nfrequency = \"121 Hz\"\n";
        let all = of(text);
        let named = |name: &str| all.iter().find(|quantity| quantity.name == name).unwrap();
        assert!(!named("Ft").inherited && named("kt").inherited);
        assert_eq!((named("kt").number, named("kt").doc.as_str()), (Some(1e4), "tangential contact stiffness"));
    }

    #[test]
    fn every_template_has_sliders() {
        for template in templates::TABLE {
            let plain = of(template.study).into_iter().filter(|quantity| quantity.number.is_some()).count();
            assert!(plain >= 3, "{}: {plain}", template.name);
        }
    }
}
