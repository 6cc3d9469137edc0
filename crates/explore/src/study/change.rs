//! Changes of a study file.
//!
//! A change sets or removes the value of one key. Comments, order and spaces of the file stay.
//! Only keys that hold numbers, laws and cases can be changed: no change can name a file.

use super::quantities::{Step, takes};
use serde::Deserialize;
use stickslip::law::{self, LawInfo, Parameter};
use stickslip_study::schema::ValueType;
use toml_edit::{Array, DocumentMut, InlineTable, Item, Table, TableLike, Value};

/// One change.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Change {
    /// The key and the tables that contain it, from outside.
    pub path: Vec<Step>,
    /// Its new value.
    pub value: NewValue,
}

/// The new value of a key.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NewValue {
    /// A quantity or an expression, as in a study file.
    Text(String),
    /// A number without a unit.
    Number(f64),
    /// A whole number.
    Count(i64),
    /// A list of quantities.
    List(Vec<String>),
    /// A law with this name, with typical values for the parameters that the present law does
    /// not have.
    Law(String),
    /// The key is removed.
    Remove,
}

/// Why a change is impossible.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ChangeError {
    /// States what is wrong.
    pub message: String,
}

impl ChangeError {
    fn new(message: impl Into<String>) -> ChangeError {
        ChangeError { message: message.into() }
    }
}

/// Applies changes to the text of a study file.
///
/// # Errors
/// A [`ChangeError`]: the text is not TOML, or a key cannot be changed.
///
/// # Example
/// ```
/// use stickslip_explore::change::{Change, NewValue, changed};
/// use stickslip_explore::quantities::Step;
/// let text = "[parameters]\nFt = \"2 N\"   # slip limit\n";
/// let change = Change {
///     path: vec![Step::Key("parameters".into()), Step::Key("Ft".into())],
///     value: NewValue::Text("3.5 N".into()),
/// };
/// let changed = changed(text, &[change]).unwrap();
/// assert_eq!(changed.to_string(), "[parameters]\nFt = \"3.5 N\"   # slip limit\n");
/// ```
pub fn changed(text: &str, changes: &[Change]) -> Result<DocumentMut, ChangeError> {
    let parsed = text.parse::<DocumentMut>();
    let mut document =
        parsed.map_err(|error| ChangeError::new(format!("the text is not TOML: {}", error.message())))?;
    changes.iter().try_for_each(|change| apply(&mut document, change))?;
    remove_empty_vary(&mut document);
    Ok(document)
}

fn apply(document: &mut DocumentMut, Change { path, value }: &Change) -> Result<(), ChangeError> {
    let words = || path.iter().map(Step::to_string).collect::<Vec<_>>().join(".");
    let takes = takes(document.as_item(), path).filter(is_open);
    let takes = takes.ok_or_else(|| ChangeError::new(format!("the key `{}` cannot be changed", words())))?;
    let (Some(last), Some(around)) = (path.last(), path.len().checked_sub(1)) else {
        return Err(ChangeError::new("the path of a change is empty"));
    };
    let mut at = document.as_item_mut();
    for step in &path[..around] {
        // `[parameters]` of a study with a template may be absent
        if *step == Step::Key("parameters".to_owned())
            && at.get("parameters").is_none()
            && let Some(root) = at.as_table_like_mut()
        {
            root.insert("parameters", Item::Table(Table::new()));
        }
        let next = match step {
            Step::Key(key) => at.get_mut(key.as_str()),
            Step::Index(index) => at.get_mut(*index),
        };
        at = next.ok_or_else(|| ChangeError::new(format!("there is no `{}`", words())))?;
    }
    let new = match (value, takes) {
        (NewValue::Remove, _) => return remove(at, last, &words()),
        (NewValue::Law(name), ValueType::Law) => {
            let row = law::find(name).ok_or_else(|| ChangeError::new(format!("there is no law `{name}`")))?;
            let present = step_into(at, last).and_then(|item| item.as_table_like());
            Value::InlineTable(law_table(row, present))
        }
        (NewValue::Text(text), _) => Value::from(text.as_str()),
        (NewValue::Number(number), _) if number.is_finite() => Value::from(*number),
        (NewValue::Count(count), _) => Value::from(*count),
        (NewValue::List(list), _) => Value::Array(list.iter().map(String::as_str).collect::<Array>()),
        (NewValue::Number(_) | NewValue::Law(_), _) => {
            return Err(ChangeError::new(format!("`{}` cannot have this value", words())));
        }
    };
    set(at, last, new, &words())
}

/// Returns whether a key may be changed. Keys with names, texts and files may not.
fn is_open(takes: &ValueType) -> bool {
    matches!(
        takes,
        ValueType::Quantity(..)
            | ValueType::Quantities(..)
            | ValueType::Count(..)
            | ValueType::Flag
            | ValueType::Parameters
            | ValueType::Vary
            | ValueType::Law
            | ValueType::Frequencies(_)
    )
}

fn step_into<'a>(item: &'a Item, step: &Step) -> Option<&'a Item> {
    match step {
        Step::Key(key) => item.get(key.as_str()),
        Step::Index(index) => item.get(*index),
    }
}

/// Sets a key and keeps the spaces and comments around its value.
fn set(at: &mut Item, last: &Step, mut new: Value, words: &str) -> Result<(), ChangeError> {
    if let Some(old) = step_into(at, last).and_then(Item::as_value) {
        *new.decor_mut() = old.decor().clone();
    }
    let place = match last {
        Step::Key(key) => match at.as_table_like_mut() {
            Some(table) => {
                if table.get(key).is_none() {
                    table.insert(key, Item::Value(new));
                    return Ok(());
                }
                table.get_mut(key)
            }
            None => None,
        },
        Step::Index(index) => at.get_mut(*index),
    };
    match place {
        Some(place) => {
            *place = Item::Value(new);
            Ok(())
        }
        None => Err(ChangeError::new(format!("there is no `{words}`"))),
    }
}

fn remove(at: &mut Item, last: &Step, words: &str) -> Result<(), ChangeError> {
    let removed = match (at.as_table_like_mut(), last) {
        (Some(table), Step::Key(key)) => table.remove(key),
        _ => None,
    };
    removed.map(drop).ok_or_else(|| ChangeError::new(format!("there is no `{words}`")))
}

/// Removes a `vary` without parameters.
fn remove_empty_vary(document: &mut DocumentMut) {
    let study = document.get_mut("study").and_then(Item::as_table_like_mut);
    if let Some(study) = study
        && study.get("vary").and_then(Item::as_table_like).is_some_and(TableLike::is_empty)
    {
        study.remove("vary");
    }
}

/// Returns a law as in a study file: values of the present law where it has the same parameter
/// of the same dimension, typical values elsewhere.
fn law_table(row: &LawInfo, present: Option<&dyn TableLike>) -> InlineTable {
    let mut table = InlineTable::new();
    table.insert("kind", Value::from(row.name));
    let of = |name: &str| law::find(name);
    let old = present.and_then(|table| of(table.get("kind")?.as_str()?));
    let kept = |parameter: &Parameter| {
        let same = old?.parameters.iter().find(|other| other.key == parameter.key)?;
        (same.dimension == parameter.dimension).then_some(present?.get(parameter.key)?.as_value()?)
    };
    for (parameter, sample) in row.parameters.iter().zip(row.sample) {
        // a new value keeps its ratio to a known one of the same dimension: a static limit stays
        // above the limit
        let of_dimension = |(other, scale): (&Parameter, &f64)| {
            let text = kept(other).filter(|_| other.dimension == parameter.dimension && *scale > 0.0)?.as_str()?;
            Some(format!("{} * ({text})", sample / scale))
        };
        let value = match kept(parameter) {
            Some(value) => value.clone(),
            None if parameter.default.is_some() => continue,
            None => match row.parameters.iter().zip(row.sample).find_map(of_dimension) {
                Some(text) => Value::from(text),
                None => typical(parameter, *sample),
            },
        };
        table.insert(parameter.key, value);
    }
    table.fmt();
    table
}

/// Returns a value in SI as a study file states it.
fn typical(parameter: &Parameter, value: f64) -> Value {
    match parameter.dimension.name_and_unit() {
        Some((_, unit)) if parameter.power.is_none() && unit.starts_with(char::is_alphabetic) => {
            Value::from(format!("{value} {unit}"))
        }
        _ if value.fract() == 0.0 => Value::from(value as i64),
        _ => Value::from(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::quantities::path;
    use stickslip_study::{read_study, templates};

    fn with(text: &str, at: &str, value: NewValue) -> Result<String, ChangeError> {
        changed(text, &[Change { path: path(at), value }]).map(|document| document.to_string())
    }

    #[test]
    fn a_change_keeps_every_other_byte() {
        let text = templates::find("blade-couple").unwrap().study;
        let made = with(text, "parameters.kt", NewValue::Text("1.25e4 N/m".into())).unwrap();
        assert_eq!(made, text.replace("\"10000 N/m\"", "\"1.25e4 N/m\""));
        let made = with(text, "joint.0.law.limit", NewValue::Text("3 N".into())).unwrap();
        assert_eq!(made, text.replace("limit = \"Ft\"", "limit = \"3 N\""));
        let made = with(text, "study.frequency.points", NewValue::Count(61)).unwrap();
        assert_eq!(made, text.replace("points = 241", "points = 61"));
    }

    #[test]
    fn the_last_varied_parameter_takes_vary_with_it() {
        let text = templates::find("blade-couple").unwrap().study;
        let made = with(text, "study.vary.Ft", NewValue::Remove).unwrap();
        assert!(!made.contains("vary"));
        assert_eq!(read_study("a.toml", &made, &[]).unwrap().cases(), 1);
    }

    #[test]
    fn no_change_can_name_a_file() {
        let text = "schema = 1\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\n[disk]\nsectors = 3\n\
                    boundary = \"b.csv\"\n[study]\nkind = \"response\"\nfrequency = \"1 Hz\"\n";
        for at in
            ["structure.stiffness", "structure.mass", "disk.boundary", "title", "study.kind", "new", "", "mass.7.mass"]
        {
            let refused = with(text, at, NewValue::Text("/etc/passwd".into()));
            assert!(refused.is_err(), "{at}: {refused:?}");
        }
    }

    /// Every law can replace every other law of one direction, and the result is a study.
    #[test]
    fn a_new_law_gets_typical_values() {
        let text = templates::find("blade-couple").unwrap().study;
        for row in law::TABLE.iter().filter(|row| row.sample().directions() == 1) {
            let made = with(text, "joint.0.law", NewValue::Law(row.name.into())).unwrap();
            if let Err(error) = read_study("a.toml", &made, &[]) {
                panic!("{}: {error}\n{made}", row.name);
            }
            if row.parameters.iter().any(|parameter| parameter.key == "limit") {
                assert!(made.contains("limit = \"Ft\""), "{made}");
            }
        }
        assert!(with(text, "joint.0.law", NewValue::Law("glue".into())).is_err());
    }
}
