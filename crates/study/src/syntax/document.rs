//! A TOML text as a tree in which every key and value knows its location.

use crate::syntax::error::{Location, Problem};
use crate::syntax::format::plural_suffix;
use crate::syntax::suggest::excerpt;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// A value of the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TomlNode {
    pub location: Location,
    pub value: TomlValue,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum TomlValue {
    /// A string; `inner` is the byte of the source at which its content begins, if the source
    /// contains the string without escapes.
    Text {
        text: String,
        inner: Option<usize>,
    },
    /// A number; `whole` is set if it was written as an integer that fits.
    Number {
        value: f64,
        whole: Option<i64>,
    },
    Flag(bool),
    Date,
    List(Vec<TomlNode>),
    Table(TomlTable),
}

/// A table, its entries in file order.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct TomlTable {
    /// Location of its header, or of the whole inline table.
    pub location: Location,
    pub entries: Vec<TomlEntry>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TomlEntry {
    pub key: String,
    pub key_location: Location,
    pub node: TomlNode,
}

impl TomlValue {
    /// Describes the value for messages.
    pub fn described(&self) -> String {
        match self {
            TomlValue::Text { text, .. } => format!("the text \"{}\"", excerpt(text)),
            TomlValue::Number { value, whole: None } => format!("the number {value}"),
            TomlValue::Number { whole: Some(whole), .. } => format!("the number {whole}"),
            TomlValue::Flag(flag) => format!("`{flag}`"),
            TomlValue::Date => "a date".to_owned(),
            TomlValue::List(values) => {
                let is_table = |entry: &TomlNode| matches!(entry.value, TomlValue::Table(_));
                let noun = if values.iter().all(is_table) { "table" } else { "value" };
                format!("a list of {} {noun}{}", values.len(), plural_suffix(values.len()))
            }
            TomlValue::Table(_) => "a table".to_owned(),
        }
    }
}

impl TomlTable {
    pub fn get(&self, key: &str) -> Option<&TomlEntry> {
        self.entries.iter().find(|entry| entry.key == key)
    }
}

/// Parses a TOML text; `source` is its index among the sources.
pub(crate) fn parse(text: &str, source: usize) -> Result<TomlTable, Problem> {
    let tree = DeTable::parse(text).map_err(|error| {
        let span = error.span().unwrap_or(0..0);
        let mut message = error.message().replace('\n', ", ");
        let mut help = None;
        let mut key = "";
        if message.starts_with("duplicate key") {
            key = text.get(span.clone()).unwrap_or("").trim();
            message = format!("the key `{}` appears twice in one table", excerpt(key));
            help = Some("remove one of them; for several masses, write `[[mass]]` several times".to_owned());
        } else if let Some(rest) = message.strip_prefix("cannot recurse further") {
            message = format!("brackets are nested too deeply{}", if rest.is_empty() { "" } else { " (80 at most)" });
        } else {
            message = format!("this is not TOML: {message}");
            help = Some("write texts and quantities in quotes: mass = \"182 g\"".to_owned());
        }
        Problem::new(&Location { source, span }, excerpt(key), message).maybe_help(help)
    })?;
    let reader = TreeBuilder { text, source };
    Ok(reader.table(tree.get_ref(), 0..0))
}

struct TreeBuilder<'a> {
    text: &'a str,
    source: usize,
}

impl TreeBuilder<'_> {
    fn location(&self, span: Range<usize>) -> Location {
        Location { source: self.source, span }
    }

    // the parser refuses more than 80 levels, so this recursion is shallow
    fn table(&self, table: &DeTable<'_>, span: Range<usize>) -> TomlTable {
        let mut entries: Vec<TomlEntry> = table
            .iter()
            .map(|(key, value)| TomlEntry {
                key: key.get_ref().to_string(),
                key_location: self.location(key.span()),
                node: self.node(value.get_ref(), value.span(), key.span()),
            })
            .collect();
        entries.sort_by_key(|entry| entry.key_location.span.start);
        TomlTable { location: self.location(span), entries }
    }

    fn node(&self, value: &DeValue<'_>, span: Range<usize>, key: Range<usize>) -> TomlNode {
        // tables made by dotted keys have no span
        let span = if span.is_empty() { key.clone() } else { span };
        let value = match value {
            DeValue::String(text) => {
                let raw = self.text.get(span.clone()).unwrap_or("");
                let quoted = |quote: char| raw.strip_prefix(quote).and_then(|r| r.strip_suffix(quote)) == Some(text);
                let inner = (quoted('"') || quoted('\'')).then_some(span.start + 1);
                TomlValue::Text { text: text.to_string(), inner }
            }
            DeValue::Integer(integer) => {
                let whole = i64::from_str_radix(integer.as_str(), integer.radix()).ok();
                let value = match whole {
                    Some(whole) => whole as f64,
                    None => integer.as_str().parse().unwrap_or(f64::INFINITY),
                };
                TomlValue::Number { value, whole }
            }
            DeValue::Float(float) => {
                TomlValue::Number { value: float.as_str().parse().unwrap_or(f64::NAN), whole: None }
            }
            DeValue::Boolean(flag) => TomlValue::Flag(*flag),
            DeValue::Datetime(_) => TomlValue::Date,
            DeValue::Array(list) => {
                TomlValue::List(list.iter().map(|v| self.node(v.get_ref(), v.span(), key.clone())).collect())
            }
            DeValue::Table(table) => TomlValue::Table(self.table(table, span.clone())),
        };
        TomlNode { location: self.location(span), value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_node_has_its_location() {
        let text = "a = \"2 mm\"\n[[mass]]\nname = 'x'\nmass = 0x10\n";
        let tree = parse(text, 0).unwrap();
        let a = tree.get("a").unwrap();
        assert_eq!(&text[a.node.location.span.clone()], "\"2 mm\"");
        assert_eq!(a.node.value, TomlValue::Text { text: "2 mm".into(), inner: Some(5) });
        let TomlValue::List(list) = &tree.get("mass").unwrap().node.value else { panic!() };
        let TomlValue::Table(mass) = &list[0].value else { panic!() };
        assert_eq!(&text[mass.location.span.clone()], "[[mass]]");
        assert_eq!(mass.get("mass").unwrap().node.value, TomlValue::Number { value: 16.0, whole: Some(16) });
    }

    #[test]
    fn an_escaped_text_is_underlined_as_a_whole() {
        let tree = parse("a = \"2\\u0020mm\"", 0).unwrap();
        assert_eq!(tree.get("a").unwrap().node.value, TomlValue::Text { text: "2 mm".into(), inner: None });
    }

    #[test]
    fn syntax_errors_have_a_place() {
        let problem = parse("a = 1\nb = = 2\n", 0).unwrap_err();
        assert_eq!(problem.location.span.start, 10, "{problem:?}");
        let problem = parse("a = 1\na = 2\n", 0).unwrap_err();
        assert_eq!((problem.location.span.start, problem.key.as_str()), (6, "a"));
        assert!(parse(&format!("a = {}", "[".repeat(10_000)), 0).is_err());
    }
}
