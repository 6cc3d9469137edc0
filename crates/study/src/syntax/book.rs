//! The study file reference in the book, generated from the schema, the lists of laws and
//! methods, and the templates.

use crate::compile::templates;
use crate::kinds;
use crate::kinds::kind::Kind;
use crate::syntax::schema::{FILE, Key, Presence, SAMPLE, STUDY, ValueType, describe_value};
use stickslip::{law, method};

/// Returns the reference of study files, key by key, as Markdown tables.
pub fn markdown() -> String {
    let mut book = String::new();
    let rows = |book: &mut String, heading: &str, intro: &str, keys: &[Key]| {
        book.push_str(&format!("## {heading}\n\n"));
        if !intro.is_empty() {
            book.push_str(&format!("{intro}\n\n"));
        }
        book.push_str("| key | value | default | meaning | example |\n| --- | --- | --- | --- | --- |\n");
        for key in keys.iter().filter(|key| key.is_supported()) {
            let absent = match key.presence {
                Presence::Required => "required".to_owned(),
                Presence::Optional => String::new(),
                Presence::Default(value) => format!("`{value}`"),
            };
            let example = if key.example == "[]" { String::new() } else { format!("`{} = {}`", key.name, key.example) };
            let cells = [format!("`{}`", key.name), describe_value(&key.takes), absent, key.doc.to_owned(), example];
            book.push_str(&format!("| {} |\n", cells.map(|cell| cell.replace('|', "\\|")).join(" | ")));
        }
        book.push('\n');
    };
    // nested tables follow the table that contains them
    let inner = |book: &mut String, of: &str, keys: &[Key]| {
        for key in keys.iter().filter(|key| key.is_supported()) {
            if let ValueType::Table(keys) | ValueType::TableOrFalse(keys) | ValueType::Tables(keys) = key.takes {
                rows(book, &format!("`{}` of {of}", key.name), key.doc, keys);
            }
        }
    };
    rows(&mut book, "Top of the file", "", FILE);
    for key in FILE {
        let (heading, keys) = match key.takes {
            ValueType::List(keys) | ValueType::Tables(keys) => (format!("`[[{}]]`", key.name), keys),
            ValueType::Table(keys) => (format!("`[{}]`", key.name), keys),
            ValueType::Sample => (format!("`[{}]`", key.name), SAMPLE),
            _ => continue,
        };
        rows(&mut book, &heading, key.doc, keys);
        inner(&mut book, &heading, keys);
    }
    rows(&mut book, "`[study]`", "The keys of every kind; each kind adds its own.", STUDY);
    for Kind { info: kind, .. } in kinds::TABLE {
        rows(&mut book, &format!("`[study]` with `kind = \"{}\"`", kind.name), kind.summary, kind.keys);
        inner(&mut book, &format!("`{}`", kind.name), kind.keys);
    }
    let named = |book: &mut String, name: &str, summary: &str, keys: &[(&str, String, &str)]| {
        book.push_str(&format!("- `{name}`: {summary}\n"));
        for (key, takes, doc) in keys {
            book.push_str(&format!("  - `{key}` ({takes}): {doc}\n"));
        }
    };
    let described = crate::syntax::expression::dimension_text;
    book.push_str("## Laws\n\n");
    for row in law::TABLE {
        let keys: Vec<_> = row.parameters.iter().map(|p| (p.key, p.describe_values(), p.doc)).collect();
        named(&mut book, row.name, row.summary, &keys);
    }
    book.push_str("\n## Methods\n\n");
    for row in method::TABLE {
        let keys: Vec<_> = row.options.iter().map(|o| (o.key, described(o.dimension), o.doc)).collect();
        named(&mut book, row.name, row.summary, &keys);
    }
    book.push_str("\n## Templates\n\n");
    for row in templates::TABLE {
        let parameters = row.parameters();
        let keys: Vec<_> =
            parameters.iter().map(|p| (p.key.as_str(), described(p.dimension), p.doc.as_str())).collect();
        named(&mut book, row.name, row.summary(), &keys);
    }
    book
}
