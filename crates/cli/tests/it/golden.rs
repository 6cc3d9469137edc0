//! Texts as users read them, as golden files in `snapshots/`: `check`, lists, messages.
//!
//! After an intended change, write them again and read the difference:
//! `INSTA_UPDATE=always cargo test -p stickslip-cli --test it golden`.

use assert_cmd::Command;
use insta::assert_snapshot;
use std::fs;
use tempfile::TempDir;

/// Runs the program on `study.toml` with this text. Returns its status and what it prints.
fn printed(study: &str, arguments: &[&str]) -> String {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("study.toml"), study).unwrap();
    let output = Command::cargo_bin("stickslip").unwrap().current_dir(folder.path()).args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    // the expected time is measured, and the memory depends on the number of processors
    let line = |line: &str| match (line.contains(" on one thread"), line.rsplit_once(", ")) {
        (true, _) => "[expected time]\n".to_owned(),
        (_, Some((rest, memory))) if memory.contains(" of memory") => format!("{rest}, [memory]\n"),
        _ => format!("{line}\n"),
    };
    let printed: String = (text(&output.stdout) + &text(&output.stderr)).lines().map(line).collect();
    format!("status {}\n{printed}", output.status.code().expect("ended by itself"))
}

fn template(name: &str) -> &'static str {
    stickslip_study::templates::find(name).unwrap().study
}

#[test]
fn check_of_templates() {
    for name in ["blade-couple", "blade-couple-massless", "element", "under-platform-wedge", "bladed-ring"] {
        assert_snapshot!(format!("check_{name}"), printed(template(name), &["check", "study.toml"]));
    }
}

#[test]
fn lists() {
    for what in ["laws", "methods", "templates", "studies", "outputs"] {
        assert_snapshot!(format!("list_{what}"), printed("", &["list", what]));
    }
}

/// Every message names the place, what was expected, and what to do.
#[test]
fn messages_about_wrong_studies() {
    let wrong = [
        ("unknown_key", "stiffness = \"k\"", "stifness = \"k\""),
        ("wrong_dimension", "stiffness = \"k\"", "stiffness = \"10 kg\""),
        ("negative_limit", "limit = \"Ft\"", "limit = \"-2 N\""),
        ("unknown_law", "\"coulomb\"", "\"columb\""),
        ("unknown_place", "on = \"blade1\"", "on = \"blad1\""),
        ("empty_range", "from = \"119.5 Hz\"", "from = \"123 Hz\""),
        ("missing_unit", "F0 = \"10 N\"", "F0 = \"10 N/\""),
        ("other_schema", "schema = 1", "schema = 2"),
        ("not_toml", "schema = 1", "schema is 1"),
        ("unused_parameter", "F0 = \"10 N\"", "F0 = \"10 N\"\nspare = \"1 N\""),
    ];
    for (name, from, to) in wrong {
        let text = template("blade-couple");
        assert!(text.contains(from), "{from} is not in the template");
        assert_snapshot!(format!("message_{name}"), printed(&text.replacen(from, to, 1), &["check", "study.toml"]));
    }
}
