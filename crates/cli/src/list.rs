//! `stickslip list`: prints the tables of laws, methods, templates, study kinds and outputs.

use crate::args::ListTopic;
use clap::ValueEnum;
use stickslip::{law, method};
use stickslip_study::{kinds, templates};

/// Returns one list as text, or all lists with headings.
pub fn text(what: Option<ListTopic>) -> String {
    let all = ListTopic::value_variants()
        .iter()
        .map(|what| format!("{}\n\n{}", format!("{what:?}").to_uppercase(), one(*what)));
    what.map_or_else(|| all.collect::<Vec<_>>().join("\n"), one)
}

fn one(what: ListTopic) -> String {
    let mut out = String::new();
    let mut entry = |name: &str, summary: &str, keys: &[(String, String)]| {
        out += &format!("{name}\n    {summary}\n");
        let width = keys.iter().map(|(key, _)| key.chars().count()).max().unwrap_or(0);
        for (key, doc) in keys {
            out += &format!("      {key:width$}  {doc}\n");
        }
    };
    match what {
        ListTopic::Laws => {
            for row in law::TABLE {
                let keys: Vec<_> = row
                    .parameters
                    .iter()
                    .map(|p| (p.key.to_owned(), format!("{}: {}", p.doc, p.describe_values())))
                    .collect();
                entry(row.name, row.summary, &keys);
            }
        }
        ListTopic::Methods => {
            for row in method::TABLE {
                let keys: Vec<_> = row.options.iter().map(|o| (o.key.to_owned(), o.doc.to_owned())).collect();
                entry(row.name, row.summary, &keys);
            }
        }
        ListTopic::Templates => {
            for row in templates::TABLE {
                let keys: Vec<_> =
                    row.parameters().into_iter().map(|p| (format!("{} = {}", p.key, p.default), p.doc)).collect();
                entry(row.name, row.summary(), &keys);
            }
        }
        ListTopic::Studies => {
            for row in kinds::TABLE.iter().map(|kind| kind.info) {
                let keys: Vec<_> = row.keys.iter().map(|k| (k.name.to_owned(), k.doc.to_owned())).collect();
                entry(row.name, row.summary, &keys);
            }
        }
        ListTopic::Outputs => kinds::outputs().iter().for_each(|(name, doc)| entry(name, doc, &[])),
    }
    out
}
