//! The commands of the book's page "From a mesh", at a reduced size. They need CalculiX, `ccx`;
//! without it only the study files are compared with the page.

use assert_cmd::Command;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// Returns the lines of all blocks of a language.
fn blocks(page: &str, language: &str) -> Vec<String> {
    let begin = format!("```{language}");
    let mut inside = false;
    let mut lines = Vec::new();
    for line in page.lines() {
        match line {
            _ if line == begin => inside = true,
            "```" => inside = false,
            _ if inside && !line.is_empty() => lines.push(line.to_owned()),
            _ => {}
        }
    }
    lines
}

#[test]
fn the_study_files_are_those_of_the_page() {
    let page = fs::read_to_string(root().join("docs/src/meshes.md")).expect("the page");
    let without_comment = |line: &str| line.split(" #").next().unwrap_or_default().trim_end().to_owned();
    let files = ["best_load.toml", "motion.toml"].map(|file| {
        let text = fs::read_to_string(root().join("studies/calculix").join(file)).expect("a study");
        text.lines().map(without_comment).collect::<BTreeSet<String>>()
    });
    let lines = blocks(&page, "toml");
    assert!(lines.len() > 20, "{lines:?}");
    for line in lines {
        let line = without_comment(&line);
        assert!(files.iter().any(|file| file.contains(&line)), "{line}");
    }
}

#[test]
fn the_commands_of_the_page_run() {
    if Command::new("ccx").arg("-v").output().is_err() {
        eprintln!("CalculiX (`ccx`) is not installed: the commands were not run");
        return;
    }
    let page = fs::read_to_string(root().join("docs/src/meshes.md")).expect("the page");
    let folder = tempfile::tempdir().expect("a folder");
    for entry in fs::read_dir(root().join("studies/calculix")).expect("the studies") {
        let path = entry.expect("a file").path();
        let text = fs::read_to_string(&path).expect("a text");
        let smaller = text.replace("points = 31", "points = 3").replace("points = 7", "points = 2");
        let smaller = smaller.replace("to = 6,", "to = 3,").replace("fields = 24", "fields = 2");
        fs::write(folder.path().join(path.file_name().expect("a name")), smaller).expect("a copy");
    }
    let commands = blocks(&page, "sh");
    assert_eq!(commands.len(), 6, "{commands:?}");
    for command in &commands {
        let words: Vec<&str> = command.split_whitespace().collect();
        let mut process = match words[0] {
            "stickslip" => Command::cargo_bin("stickslip").expect("the command"),
            other => Command::new(other),
        };
        let output = process.current_dir(folder.path()).args(&words[1..]).output().expect("an output");
        // an export of matrices ends like a failure, and points may be truncated
        let is_expected = words[0] == "ccx" || matches!(output.status.code(), Some(0 | 3));
        let text = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
        assert!(is_expected, "{command}: {text}");
        if words[1] == "check" {
            let line = blocks(&page, "text").into_iter().find(|line| line.starts_with("  contacts")).expect("the line");
            assert!(text.contains(&line) && text.contains("nothing wrong"), "{text}");
        }
    }
    for file in ["blade.png", "contacts.png", "press.frd", "matrices.sti"] {
        assert!(folder.path().join(file).exists(), "{file}");
    }
    let results = folder.path().join("stickslip-out");
    for file in ["best_load/performance.csv", "motion/fields.pvd", "motion/fields_0001.vtu"] {
        assert!(results.join(file).exists(), "{file}");
    }
    let orbits = fs::read_to_string(results.join("motion/orbits.csv")).expect("the orbit");
    assert!(orbits.contains("pad_dissipation_J") && orbits.contains("converged"), "{orbits}");
}
