//! Reads tables whose keys depend on `kind`: laws, `[method]`, `[study]`; and `[figure]`.

use super::reader::Reader;
use crate::compile::compiled::{CompiledTable, CompiledValue, LawCoordinate};
use crate::kinds;
use crate::kinds::info::KindInfo;
use crate::syntax::document::{TomlEntry, TomlNode, TomlTable, TomlValue};
use crate::syntax::error::{Location, Problem};
use crate::syntax::schema::{self, Bounds, FILE, Key, Presence, STUDY, ValueType};
use crate::syntax::suggest::alternatives;
use stickslip::dimension::Dimension;
use stickslip::law::{self, LawInfo};
use stickslip::method;

/// Returns the tables of a study file that have a key of this name.
///
/// Tables that contain all keys in `own` are left out, because the name was found in such a
/// table.
pub(super) fn tables_with_key(name: &str, own: &[Key]) -> Vec<String> {
    let names = |keys: &[Key]| keys.iter().filter(|key| key.is_supported()).map(|key| key.name).collect::<Vec<_>>();
    let tables = FILE.iter().filter_map(|table| {
        let (keys, title) = match table.takes {
            ValueType::Table(keys) => (names(keys), format!("[{}]", table.name)),
            ValueType::List(keys) | ValueType::Tables(keys) => (names(keys), format!("[[{}]]", table.name)),
            ValueType::Study => {
                let of_kinds = kinds::TABLE.iter().flat_map(|row| names(row.info.keys));
                (names(STUDY).into_iter().chain(of_kinds).collect(), format!("[{}]", table.name))
            }
            ValueType::Method => {
                let options = method::TABLE.iter().flat_map(|row| row.options).map(|option| option.key);
                (names(schema::METHOD).into_iter().chain(options).collect(), format!("[{}]", table.name))
            }
            _ => return None,
        };
        let it_may_be = own.iter().all(|key| keys.contains(&key.name));
        (keys.contains(&name) && !it_may_be).then_some(title)
    });
    tables.collect()
}

/// The table `[study]`.
pub(super) struct StudyRequest<'a> {
    pub kind: &'static KindInfo,
    /// The values of the keys of the kind.
    pub stated: CompiledTable,
    /// The parameters of `vary`.
    pub vary: Option<&'a TomlEntry>,
    /// The two parameters of a map.
    pub over: Option<&'a TomlEntry>,
}

impl Reader {
    /// Returns the row that `kind` names in a table of laws, methods or study kinds.
    fn kind<T: 'static>(
        &mut self,
        table: &TomlTable,
        what: &str,
        example: &str,
        rows: &'static [T],
        name: fn(&T) -> &'static str,
    ) -> Option<&'static T> {
        let words: Vec<&str> = rows.iter().map(name).collect();
        let Some(entry) = table.get("kind") else {
            let message = format!("`kind` is missing in {what}; expected one of {}", alternatives(words));
            self.problems
                .push(Problem::new(&table.location, "kind", message).help(format!("add kind = \"{example}\"")));
            return None;
        };
        let location = &entry.node.location;
        match &entry.node.value {
            TomlValue::Text { text, .. } => match rows.iter().find(|row| name(row) == text) {
                Some(row) => Some(row),
                None => {
                    self.unknown_word("kind", text, location, words);
                    None
                }
            },
            other => {
                let message = format!("expected one of {}, found {}", alternatives(words), other.described());
                self.problems.push(Problem::new(location, "kind", message));
                None
            }
        }
    }

    pub(super) fn law(&mut self, table: &TomlTable) -> Option<CompiledValue> {
        let row: &'static LawInfo = *self.kind(table, "the law", "coulomb", law::TABLE, |row| row.name)?;
        let mut keys = vec![schema::required("kind", ValueType::Text, "law", "\"coulomb\"")];
        keys.extend(row.parameters.iter().map(|p| Key {
            name: p.key,
            takes: ValueType::Quantity(p.dimension, crate::syntax::key::parameter_bounds(p.range)),
            presence: if p.default.is_some() { Presence::Optional } else { Presence::Required },
            doc: p.doc,
            example: example_of(p.dimension),
        }));
        let before = self.problems.len();
        let stated = self.table(table, &keys, &format!("law `{}`", row.name));
        for problem in
            self.problems[before..].iter_mut().filter(|problem| keys.iter().all(|key| key.name != problem.key))
        {
            problem.help = unknown_law_key_help(row, &problem.key).or(problem.help.take());
        }
        Some(CompiledValue::Law(row, stated, LawCoordinate::Displacement))
    }

    pub(super) fn method(&mut self, root: &TomlTable) -> Option<CompiledTable> {
        let absent = TomlTable::default();
        let table = match root.get("method").map(|entry| &entry.node) {
            None => &absent,
            Some(TomlNode { value: TomlValue::Table(table), .. }) => table,
            Some(node) => {
                let message = format!("expected a table, found {}", node.value.described());
                self.problems
                    .push(Problem::new(&node.location, "method", message).help("write [method] and below it its kind"));
                return None;
            }
        };
        let row = match table.get("kind") {
            None => method::find("auto")?,
            Some(_) => self.kind(table, "[method]", "auto", method::TABLE, |row| row.name)?,
        };
        let mut keys = schema::METHOD.to_vec();
        keys.extend(row.options.iter().map(|option| Key {
            name: option.key,
            takes: if option.count {
                ValueType::Count(1, 1_000_000)
            } else {
                ValueType::Quantity(option.dimension, Bounds::Positive)
            },
            presence: Presence::Optional,
            doc: option.doc,
            example: if option.count { "15" } else { example_of(option.dimension) },
        }));
        let before = self.problems.len();
        let stated = self.table(table, &keys, &format!("method `{}`", row.name));
        // an option of another method is not a misspelling
        for problem in &mut self.problems[before..] {
            let others = || method::TABLE.iter().filter(|other| other.options.iter().any(|o| o.key == problem.key));
            if keys.iter().all(|key| key.name != problem.key) && others().next().is_some() {
                let names = alternatives(others().map(|other| other.name));
                problem.help = Some(format!("`{}` is a key of {names}: set `kind` to that method", problem.key));
            }
        }
        Some(stated)
    }

    pub(super) fn request<'a>(&mut self, root: &'a TomlTable) -> Option<StudyRequest<'a>> {
        let node = &root.get("study")?.node;
        let TomlValue::Table(table) = &node.value else {
            let message = format!("expected a table, found {}", node.value.described());
            self.problems
                .push(Problem::new(&node.location, "study", message).help("write [study] and below it its kind"));
            return None;
        };
        let kind = &self.kind(table, "[study]", "response", kinds::TABLE, |row| row.info.name)?.info;
        let mut keys = STUDY.to_vec();
        keys.extend(kind.keys);
        // `vary` and `over` are no values of the kind: they define the cases
        let owner = format!("a study of kind `{}`", kind.name);
        self.check_keys(table, &keys, &owner);
        let defines_cases = |key: &Key| matches!(key.takes, ValueType::Vary | ValueType::Over);
        let over = keys.iter().any(|key| matches!(key.takes, ValueType::Over)).then(|| table.get("over")).flatten();
        let rest: Vec<Key> = keys.into_iter().filter(|key| !defines_cases(key)).collect();
        let stated = self.compile_table(table, &rest);
        Some(StudyRequest { kind, stated, vary: table.get("vary"), over })
    }

    /// Reads `[figure]`; the result is empty if the table is absent.
    pub(super) fn figure(&mut self, root: &TomlTable) -> CompiledTable {
        let key = FILE.iter().find(|key| key.name == "figure");
        let stated = root.get("figure").zip(key).and_then(|(entry, key)| self.value(key, &entry.node));
        match stated {
            Some(CompiledValue::Table(table)) => table,
            _ => CompiledTable { location: Location::default(), entries: Vec::new(), repetition: Default::default() },
        }
    }
}

/// Lower-case names that users give to the coefficient of friction, and to the normal load.
const COEFFICIENTS: [&str; 6] = ["mu", "mue", "coefficient", "friction", "friction_coefficient", "cof"];
const LOADS: [&str; 8] = ["normal", "n", "n0", "fn", "preload", "normal_load", "normal_force", "load"];

/// Returns the help for an unknown key of a law that belongs to another law or names a friction
/// coefficient or load.
fn unknown_law_key_help(row: &LawInfo, key: &str) -> Option<String> {
    let word = key.to_lowercase();
    let own = alternatives(row.parameters.iter().map(|parameter| parameter.key)).replace(" or ", " and ");
    let has = |key: &str| row.parameters.iter().any(|parameter| parameter.key == key);
    if COEFFICIENTS.contains(&word.as_str()) || LOADS.contains(&word.as_str()) {
        let limit =
            "for a constant normal load it is the coefficient of friction times the load: limit = \"0.3 * 10 N\"";
        let contact = "for a normal load that changes with the motion, use the law `friction-contact` with \
            `friction` and `preload`";
        return match (has("friction"), has("limit")) {
            (true, _) => Some(format!(
                "`{}` takes {own}: the coefficient is `friction`, the load in static equilibrium is `preload`",
                row.name
            )),
            (false, true) => {
                Some(format!("`{}` takes {own}: `limit` is the friction force; {limit}; {contact}", row.name))
            }
            (false, false) => Some(format!("`{}` takes {own}; {contact}", row.name)),
        };
    }
    let others = law::TABLE.iter().filter(|other| other.parameters.iter().any(|parameter| parameter.key == key));
    let others: Vec<&str> = others.map(|other| other.name).collect();
    (!others.is_empty())
        .then(|| format!("`{}` takes {own}; `{key}` is a parameter of {}", row.name, alternatives(others)))
}

/// Returns an example of a quantity for messages.
fn example_of(dimension: Dimension) -> &'static str {
    match dimension {
        Dimension::FORCE => "\"2 N\"",
        Dimension::STIFFNESS => "\"10000 N/m\"",
        Dimension::INVERSE_VELOCITY => "\"25 s/mm\"",
        Dimension::VELOCITY => "\"0.1 mm/s\"",
        Dimension::NONE => "1e-9",
        Dimension::FREQUENCY => "\"121 Hz\"",
        Dimension::TIME => "\"1 ms\"",
        Dimension::LENGTH => "\"1 mm\"",
        Dimension::MASS => "\"182 g\"",
        Dimension::DAMPING => "\"0.2 kg/s\"",
        Dimension::CUBIC_STIFFNESS => "\"4e9 N/m^3\"",
        _ => "",
    }
}
