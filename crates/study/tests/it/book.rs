//! The book under `docs/` and the README: generated parts are up to date, and every study reads
//! and checks.
//!
//! A change of the schema, a law, a method, a template or a study kind changes the generated
//! parts. This command writes them again:
//! `STICKSLIP_UPDATE_BOOK=1 cargo test -p stickslip-study --test it book`.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring, System};
use stickslip::{law, method};
use stickslip_study::{book, read_study, run};

const UPDATE: &str = "STICKSLIP_UPDATE_BOOK";
const HINT: &str = "is stale; run: STICKSLIP_UPDATE_BOOK=1 cargo test -p stickslip-study --test it book";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn text_of(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Compares a file with its expected text, or writes the text if the variable is set.
fn up_to_date(path: &Path, expected: &str) {
    if std::env::var_os(UPDATE).is_some() {
        fs::write(path, expected).unwrap();
    } else {
        assert!(text_of(path) == expected, "{} {HINT}", path.display());
    }
}

/// Returns every page with studies.
fn pages() -> Vec<PathBuf> {
    let folder = root().join("docs/src");
    let mut pages: Vec<PathBuf> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    pages.retain(|path| path.extension().is_some_and(|e| e == "md"));
    pages.sort();
    pages.push(root().join("README.md"));
    pages
}

/// Returns the TOML blocks of a page, each with its first line.
fn blocks(text: &str) -> Vec<(usize, String)> {
    let mut blocks = Vec::new();
    let mut open: Option<(usize, String)> = None;
    for (number, line) in text.lines().enumerate() {
        match &mut open {
            None if line == "```toml" => open = Some((number + 2, String::new())),
            None => {}
            Some(_) if line == "```" => blocks.extend(open.take()),
            Some((_, block)) => *block += &format!("{line}\n"),
        }
    }
    assert!(open.is_none(), "a block does not end");
    blocks
}

/// A block with a schema version is a whole study and must read and check. Any other block must
/// be TOML.
#[test]
fn every_study_in_the_book_checks() {
    let mut studies = 0;
    for page in pages() {
        for (line, block) in blocks(&text_of(&page)) {
            let place = format!("{}:{line}", page.display());
            if !block.contains("schema = ") {
                assert!(toml::from_str::<toml::Value>(&block).is_ok(), "{place} is not TOML");
                continue;
            }
            let study = read_study("example.toml", &block, &[]).and_then(|study| run::check(&study));
            if let Err(error) = study {
                panic!("{place}: {:?}", miette::Report::new(error));
            }
            studies += 1;
        }
    }
    assert!(studies >= 6, "only {studies} studies were found");
}

#[test]
fn the_reference_of_keys_is_up_to_date() {
    let head = "<!-- Generated from the schema by crates/study/tests/it/book.rs; do not edit. -->\n\n# Every key\n\n\
                The column *value* states what the key accepts. A quantity is a string with a unit, an expression over \
                `[parameters]`, or a bare number in SI. The column *default* states the value that applies if the key is absent.\n\n";
    up_to_date(&root().join("docs/src/study_file_keys.md"), &format!("{head}{}", book::markdown()));
}

const METHODS_BY_LAWS: [&str; 2] =
    ["<!-- begin generated: methods x laws -->\n", "<!-- end generated: methods x laws -->"];

/// A mass on a spring with a joint of this law to the ground, along all directions of the law.
fn rubbing(law: law::SharedLaw) -> System {
    let directions = if law.directions() > 1 { &["x", "y", "z"][..law.directions()] } else { &[] };
    let mass = Mass::new("body", 1.0).along(directions);
    let spring = |place| Spring { between: [place, GROUND.to_owned()], stiffness: 1e4, damping: 1.0 };
    Model {
        springs: mass.places().into_iter().map(spring).collect(),
        forces: vec![Force { on: mass.places()[0].clone(), amplitude: 1.0, phase: 0.0, harmonic: 1 }],
        joints: vec![Joint { name: "foot".to_owned(), between: ["body".to_owned(), GROUND.to_owned()], law }],
        masses: vec![mass],
        ..Model::default()
    }
    .assemble()
    .unwrap()
}

/// Lists the laws that each method accepts, by asking the methods.
fn methods_by_laws() -> String {
    let mut list = String::new();
    for row in method::TABLE {
        let has_width = row.options.iter().any(|option| option.key == "width");
        let (mut accepted, mut smoothed) = (Vec::new(), Vec::new());
        for law in law::TABLE {
            let system = rubbing(law.sample());
            let takes = |options: &method::Options| (row.build)(options).unwrap().solver(&system).is_ok();
            if takes(&method::Options::new()) {
                accepted.push(format!("`{}`", law.name));
            } else if has_width && takes(&method::Options::from([("width".to_owned(), 1e-5)])) {
                smoothed.push(format!("`{}`", law.name));
            }
        }
        let every = accepted.len() + smoothed.len() == law::TABLE.len();
        let laws = if every { "every law".to_owned() } else { accepted.join(", ") };
        list += &format!("- `{}`: {laws}", row.name);
        if !smoothed.is_empty() {
            list += &format!("; {} with the option `width`", smoothed.join(", "));
        }
        list += "\n";
    }
    list
}

/// Builds the list of the laws with their descriptions.
fn laws() -> String {
    let mut list = String::new();
    for row in law::TABLE {
        let law = row.sample();
        // the smallest and the largest number of tangents that a law without a fixed number can
        // have
        let directions: BTreeSet<_> = [1.0, 2.0]
            .iter()
            .map(|count| law.with_value(law::TANGENTS, *count).unwrap_or(law.clone()).directions())
            .collect();
        let directions: Vec<_> = directions.iter().map(usize::to_string).collect();
        let directions = match directions.join(" or ") {
            one if one == "1" => String::new(),
            several => format!(", {several} directions"),
        };
        list += &format!("- [`{0}`](#{0}){directions}: {1}\n", row.name, row.summary);
    }
    list
}

/// Replaces the text between two lines of a page.
fn with_generated(page: &str, [begin, end]: [&str; 2], generated: &str) -> String {
    let from = page.find(begin).unwrap_or_else(|| panic!("no `{begin}`")) + begin.len();
    let to = from + page[from..].find(end).unwrap_or_else(|| panic!("no `{end}`"));
    format!("{}{generated}{}", &page[..from], &page[to..])
}

const LAWS: [&str; 2] = ["<!-- begin generated: laws -->\n", "<!-- end generated: laws -->"];

/// The list is generated. A law without a section gets one with its summary, to be completed
/// by an author.
#[test]
fn the_page_of_laws_has_every_law() {
    let path = root().join("docs/src/laws.md");
    let mut page = with_generated(&text_of(&path), LAWS, &laws());
    for row in law::TABLE {
        if !page.contains(&format!("\n## {}\n", row.name)) {
            page += &format!("\n## {}\n\n{}.\n", row.name, row.summary);
        }
    }
    up_to_date(&path, &page);
}

#[test]
fn the_laws_of_each_method_are_up_to_date() {
    for page in ["docs/src/laws_and_methods.md", "README.md"] {
        let path = root().join(page);
        up_to_date(&path, &with_generated(&text_of(&path), METHODS_BY_LAWS, &methods_by_laws()));
    }
}

/// Every page of the summary exists, every page is in the summary, and every link between pages
/// has a target.
#[test]
fn every_page_is_in_the_summary_and_every_link_leads_to_a_file() {
    let folder = root().join("docs/src");
    let summary = text_of(&folder.join("SUMMARY.md"));
    for page in pages() {
        let name = page.file_name().unwrap().to_str().unwrap().to_owned();
        if name != "SUMMARY.md" && name != "README.md" {
            assert!(summary.contains(&format!("]({name})")), "{name} is not in the summary");
        }
        for link in text_of(&page).split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let target = link.split('#').next().unwrap_or_default();
            if !target.is_empty() && !target.contains("://") {
                assert!(page.parent().unwrap().join(target).exists(), "{name}: {link} leads nowhere");
            }
        }
    }
}
