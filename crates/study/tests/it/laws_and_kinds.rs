//! A study that passed the check is not refused when it runs: all refusals come before the
//! computation.

use std::collections::BTreeSet;
use stickslip::law::{LawInfo, TABLE};
use stickslip::method;
use stickslip_study::dataset::Dataset;
use stickslip_study::run::{Context, check, run};
use stickslip_study::{StudyError, kinds, read_study};

/// A small study of every kind: its keys in `[study]`, which may vary the mass `m`, and
/// `[figure]`.
const STUDIES: &[(&str, &str)] = &[
    ("orbit", "frequency = \"15 Hz\"\nsamples = 16"),
    ("response", "frequency = [\"12 Hz\", \"15 Hz\"]\n[figure]\nreferences = true"),
    ("hysteresis", "frequency = \"15 Hz\"\nsamples = 16"),
    ("performance", "frequency = { from = \"14 Hz\", to = \"16 Hz\", points = 3 }\nvary = { m = [1, 2, 3] }"),
    (
        "map",
        "frequency = { from = \"14 Hz\", to = \"16 Hz\", points = 3 }\nover = { m = { from = 1, to = 2, points = 2 }, \
         f = { from = 1, to = 2, points = 2 } }",
    ),
    ("branch", "frequency = { from = \"12 Hz\", to = \"13 Hz\", points = 2 }\nsteps = 2\nharmonics = 3\nsamples = 64"),
    ("modes", "amplitude = { from = \"1 um\", to = \"1 mm\", points = 3 }\nharmonics = 3\nsamples = 64"),
    ("transient", "frequency = \"15 Hz\"\ncycles = 1"),
    ("campbell", "speed = { from = \"1 Hz\", to = \"10 Hz\", points = 3 }"),
    ("nodal-diameter", "modes = 2\n[disk]\nsectors = 3"),
];

/// A node with the directions of the law, each on a spring, and the law between it and the
/// ground.
fn model(row: &LawInfo, mass: &str) -> String {
    let count = row.sample().directions();
    let directions = &["x", "y", "z"][..count];
    let places: Vec<String> =
        directions.iter().map(|d| if count > 1 { format!("a.{d}") } else { "a".to_owned() }).collect();
    let mut text =
        format!("schema = 1\n[parameters]\nm = {mass}\nf = 1\n[[mass]]\nname = \"a\"\nmass = \"m * 1 kg\"\n");
    if count > 1 {
        text += &format!("directions = {directions:?}\n");
    }
    for place in &places {
        text += &format!("[[spring]]\nbetween = [\"{place}\", \"ground\"]\nstiffness = 1e4\ndamping = 20\n");
        text += &format!("[[force]]\non = \"{place}\"\namplitude = \"f * 5 N\"\n");
    }
    let values: Vec<String> =
        row.parameters.iter().zip(row.sample).map(|(p, value)| format!("{} = {value:?}", p.key)).collect();
    // whole numbers are written without a decimal point
    let values = values.join(", ").replace(".0,", ",");
    let values = values.strip_suffix(".0").unwrap_or(&values);
    text + &format!(
        "[[joint]]\nname = \"j\"\nbetween = [\"a\", \"ground\"]\nlaw = {{ kind = \"{}\", {values} }}\n",
        row.name
    )
}

/// Returns whether a sentence refuses a model.
fn refuses(text: &str) -> bool {
    ["does not accept", "needs a mass", "positive definite", "no method accepts"]
        .iter()
        .any(|words| text.contains(words))
}

/// Returns the sentences of a run that refuse a model.
fn refusals(outcome: &Result<Dataset, StudyError>) -> Vec<String> {
    match outcome {
        Err(error) => vec![error.to_string()],
        Ok(dataset) => {
            let failures = dataset.failures.iter().map(ToString::to_string);
            failures.chain(dataset.notes.clone()).filter(|text| refuses(text)).collect()
        }
    }
}

/// Checks and runs a study; returns whether it was accepted.
fn hold(what: &str, text: &str) -> bool {
    let study = read_study("study.toml", text, &[]).unwrap_or_else(|error| panic!("{what}: {error}\n{text}"));
    let (checked, run) = (check(&study), run(&study, &Context::without_progress(1)));
    match checked {
        Ok(_) => assert_eq!(refusals(&run), Vec::<String>::new(), "{what}: checked, and refused when it runs"),
        // the run refuses in the same words
        Err(error) => {
            assert!(error.help_text().is_some(), "{what}: {error}: and what to do?");
            let late = run.err().unwrap_or_else(|| panic!("{what}: runs, and {error}"));
            assert_eq!((error.message(), error.help_text()), (late.message(), late.help_text()), "{what}");
            return false;
        }
    }
    true
}

#[test]
fn every_kind_has_a_study_here() {
    // an identification needs data of the same model: tests/identify.rs
    let here: BTreeSet<&str> = STUDIES.iter().map(|(kind, _)| *kind).chain(["identify"]).collect();
    assert_eq!(here, kinds::TABLE.iter().map(|kind| kind.info.name).collect());
}

#[test]
fn checked_studies_are_not_refused() {
    let (mut taken, mut refused) = (0, 0);
    for row in TABLE {
        for (kind, keys) in STUDIES {
            for mass in ["1", "0"] {
                if mass == "0" && row.name.starts_with("stribeck") && ["response", "hysteresis"].contains(kind) {
                    // These two kinds need half a minute to find that the motion of a massless
                    // body jumps. The refusals are those of kind `orbit`, which is tested.
                    continue;
                }
                let text = format!("{}[study]\nkind = \"{kind}\"\n{keys}\n", model(row, mass));
                match hold(&format!("{}, {kind}, mass {mass}", row.name), &text) {
                    true => taken += 1,
                    false => refused += 1,
                }
            }
        }
    }
    assert!(taken > TABLE.len() * STUDIES.len() / 2 && refused > 0, "{taken} {refused}");
}

/// Repeats the test for every method by its name, on one orbit.
#[test]
fn a_method_is_refused_or_taken_when_it_is_checked() {
    for row in TABLE {
        for method in method::TABLE {
            let (_, keys) = STUDIES[0];
            // two periods are enough here: the transient need not settle
            let waits = method.options.iter().any(|option| option.key == "periods");
            let few = if waits { "\nperiods = 2" } else { "" };
            let named = format!("{keys}\n[method]\nkind = \"{}\"{few}", method.name);
            let text = format!("{}[study]\nkind = \"orbit\"\n{named}\n", model(row, "1"));
            hold(&format!("{}, {}", row.name, method.name), &text);
        }
    }
}

/// A transient refuses a law that no integrator follows, and advises a width. With the advised
/// width it runs.
#[test]
fn transients_advise_a_width() {
    let mut smoothed = 0;
    for row in TABLE {
        let (_, keys) = STUDIES.iter().find(|(kind, _)| *kind == "transient").unwrap();
        let text = format!("{}[study]\nkind = \"transient\"\n{keys}\n", model(row, "1"));
        let Err(error) = check(&read_study("study.toml", &text, &[]).unwrap()) else { continue };
        let help = error.help_text().unwrap();
        assert!(help.contains("width"), "{}: {help}", row.name);
        // as the help advises: [method] with kind = "…" and width = "…"
        let words: Vec<&str> = help.split('"').collect();
        let advised = format!("{text}[method]\nkind = \"{}\"\nwidth = \"{}\"\n", words[1], words[3]);
        assert!(hold(row.name, &advised), "{}: {help}", row.name);
        smoothed += 1;
    }
    assert!(smoothed > 0);
}
