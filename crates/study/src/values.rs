//! The values of a table of the file, resolved for one case: SI, checked.

use crate::expression::displayed;
use serde_json::{Map, Value as Json, json};
use std::collections::BTreeMap;
use stickslip::dimension::Dimension;
use stickslip::law::Law;

/// Drive frequencies, rad/s. A range is computed on demand, so that its number of points costs no memory.
#[derive(Debug, Clone, PartialEq)]
pub enum Frequencies {
    /// As listed in the file.
    List(Vec<f64>),
    /// Equally spaced, both ends included.
    Range {
        /// First, rad/s.
        from: f64,
        /// Last, rad/s.
        to: f64,
        /// How many, two or more.
        points: usize,
    },
}

impl Frequencies {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Frequencies::List(list) => list.len(),
            Frequencies::Range { points, .. } => *points,
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The frequency at `index`, rad/s.
    pub fn get(&self, index: usize) -> Option<f64> {
        match self {
            Frequencies::List(list) => list.get(index).copied(),
            Frequencies::Range { from, to, points } => (index < *points).then(|| between(*from, *to, index, *points)),
        }
    }

    /// All of them, rad/s.
    pub fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.len()).filter_map(|index| self.get(index))
    }
}

/// Point `index` of `points` from `from` to `to`; both ends are exact.
pub(crate) fn between(from: f64, to: f64, index: usize, points: usize) -> f64 {
    if index + 1 == points { to } else { from + (to - from) * (index as f64 / (points - 1) as f64) }
}

/// One resolved value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Given {
    Text(String),
    Names(Vec<String>),
    Quantity(f64, Dimension),
    Count(u64),
    Flag(bool),
    Frequencies(Frequencies),
    ByName(BTreeMap<String, f64>, Dimension),
    Law(Law),
    Table(Values),
}

/// The values of a table by key; a key that is absent and has a default is here with its default.
///
/// Every accessor gives `None` if the key is absent or takes something else.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Values {
    pub(crate) entries: Vec<(&'static str, Given)>,
}

macro_rules! accessors {
    ($($(#[$doc:meta])* $name:ident -> $type:ty { $pattern:pat => $value:expr })*) => {
        impl Values {
            $($(#[$doc])*
            pub fn $name(&self, key: &str) -> Option<$type> {
                match self.get(key)? { $pattern => Some($value), _ => None }
            })*
        }
    };
}

accessors! {
    /// A text, a name, or the word of a choice.
    text -> &str { Given::Text(text) => text }
    /// One or several names.
    names -> &[String] { Given::Names(names) => names }
    /// A quantity in SI (rad/s for frequencies).
    quantity -> f64 { Given::Quantity(value, _) => *value }
    /// A whole number.
    count -> u64 { Given::Count(count) => *count }
    /// True or false.
    flag -> bool { Given::Flag(flag) => *flag }
    /// Frequencies, rad/s.
    frequencies -> &Frequencies { Given::Frequencies(frequencies) => frequencies }
    /// Quantities in SI by name.
    by_name -> &BTreeMap<String, f64> { Given::ByName(table, _) => table }
    /// A friction law.
    law -> Law { Given::Law(law) => *law }
    /// A table inside the table.
    table -> &Values { Given::Table(table) => table }
}

impl Values {
    pub(crate) fn get(&self, key: &str) -> Option<&Given> {
        self.entries.iter().find(|(name, _)| *name == key).map(|(_, given)| given)
    }

    /// As JSON; a quantity is its number in SI with its reading beside it.
    pub fn to_json(&self) -> Json {
        Json::Object(self.entries.iter().map(|(key, given)| ((*key).to_owned(), given.to_json())).collect())
    }
}

impl Given {
    fn to_json(&self) -> Json {
        match self {
            Given::Text(text) => json!(text),
            Given::Names(names) => json!(names),
            Given::Quantity(value, dimension) => quantity_json(*value, Some(*dimension)),
            Given::Count(count) => json!(count),
            Given::Flag(flag) => json!(flag),
            Given::Frequencies(Frequencies::List(list)) => json!({ "rad_per_s": list }),
            Given::Frequencies(Frequencies::Range { from, to, points }) => {
                json!({ "from_rad_per_s": from, "to_rad_per_s": to, "points": points })
            }
            Given::ByName(table, dimension) => {
                let entry = |(name, value): (&String, &f64)| (name.clone(), quantity_json(*value, Some(*dimension)));
                Json::Object(table.iter().map(entry).collect())
            }
            Given::Law(law) => json!(law),
            Given::Table(table) => table.to_json(),
        }
    }
}

/// `{ "si": 0.182, "reads": "0.182 kg" }`.
pub(crate) fn quantity_json(si: f64, dimension: Option<Dimension>) -> Json {
    let mut object = Map::new();
    object.insert("si".to_owned(), json!(si));
    object.insert("reads".to_owned(), json!(displayed(si, dimension)));
    Json::Object(object)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_has_exact_ends_and_costs_no_memory() {
        let range = Frequencies::Range { from: 0.1, to: 0.7, points: 10_000_000 };
        assert_eq!((range.len(), range.get(0), range.get(9_999_999)), (10_000_000, Some(0.1), Some(0.7)));
        assert_eq!(range.get(10_000_000), None);
        assert_eq!(Frequencies::Range { from: 1.0, to: 3.0, points: 3 }.iter().collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
    }
}
