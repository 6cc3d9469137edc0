//! Tests of `stickslip plot`: figures from stored results, and comparisons of runs.

use assert_cmd::Command;
use std::fs;
use std::path::Path;
use std::process::Output;
use tempfile::TempDir;

fn stickslip(folder: &Path, arguments: &[&str]) -> Output {
    Command::cargo_bin("stickslip").unwrap().current_dir(folder).args(arguments).output().unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("ended by itself")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Creates a folder with the starting study of a template as `study.toml`.
fn folder(template: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("study.toml"), stickslip_study::templates::find(template).unwrap().study).unwrap();
    folder
}

/// Runs `study.toml` into a folder; its results are in `OUT/study`.
fn run(folder: &Path, out: &str, more: &[&str]) {
    let mut arguments = vec!["run", "study.toml", "--out", out, "--only", "csv"];
    arguments.extend(more);
    let output = stickslip(folder, &arguments);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
}

/// Returns the rows of a table as maps from column to cell.
fn rows(path: &Path) -> Vec<std::collections::BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

#[test]
fn a_figure_is_drawn_again_without_computing() {
    let folder = folder("element");
    let folder = folder.path();
    run(folder, "out", &[]);
    let results = folder.join("out/study");
    assert!(!results.join("figure.svg").exists());
    let tables = fs::read(results.join("loops.csv")).unwrap();
    let output = stickslip(folder, &["plot", "out/study"]);
    assert_eq!((code(&output), stdout(&output), stderr(&output)), (0, String::new(), String::new()));
    for file in ["figure.svg", "figure.png", "figure.html"] {
        assert!(fs::metadata(results.join(file)).unwrap().len() > 100, "{file}");
    }
    assert_eq!(fs::read(results.join("loops.csv")).unwrap(), tables);
    // The figure equals that of a run.
    let drawn = fs::read(results.join("figure.svg")).unwrap();
    assert_eq!(code(&stickslip(folder, &["run", "study.toml", "--out", "whole", "--only", "svg"])), 0);
    assert_eq!(fs::read(folder.join("whole/study/figure.svg")).unwrap(), drawn);
    // The study file now has a different `[figure]`.
    let study = fs::read_to_string(folder.join("study.toml")).unwrap();
    fs::write(folder.join("study.toml"), format!("{study}\n[figure]\nx_unit = \"um\"\n")).unwrap();
    let output = stickslip(folder, &["plot", "out/study", "--study", "study.toml", "--only", "svg"]);
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
    assert!(!String::from_utf8_lossy(&drawn).contains("(um)"));
    assert!(fs::read_to_string(results.join("figure.svg")).unwrap().contains("(um)"));
    // The study file now has a different model, which does not match the results.
    let other = fs::read_to_string(folder.join("study.toml")).unwrap().replace("Ft = ", "unused = \"1 N\"\nFt = ");
    fs::write(folder.join("study.toml"), other).unwrap();
    let output = stickslip(folder, &["plot", "out/study", "--study", "study.toml", "--only", "svg"]);
    assert_eq!(code(&output), 0);
    assert!(stderr(&output).contains("differs from the run in more than its figure"), "{}", stderr(&output));
    // An impossible `[figure]`.
    fs::write(folder.join("study.toml"), format!("{study}\n[figure]\nx_unit = \"N\"\n")).unwrap();
    let output = stickslip(folder, &["plot", "out/study", "--study", "study.toml"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("x_unit"), "{}", stderr(&output));
}

#[test]
fn two_slip_limits_differ_by_the_closed_form() {
    let folder = folder("element");
    let folder = folder.path();
    run(folder, "weak", &["--set", "Ft=1mN"]);
    run(folder, "strong", &["--set", "Ft=2mN"]);
    let output = stickslip(folder, &["plot", "weak/study", "strong/study", "--overlay", "--out", "both"]);
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
    let text = stdout(&output);
    assert!(text.contains("dissipation_J") && text.contains("Every run is compared with Ft = 0.001 N"), "{text}");
    let both = folder.join("both/study+study");
    for file in ["differences.csv", "figure.svg", "figure.png", "figure.html", "record.json"] {
        assert!(fs::metadata(both.join(file)).unwrap().len() > 100, "{file}");
    }
    let svg = fs::read_to_string(both.join("figure.svg")).unwrap();
    assert!(svg.contains("Ft = 0.001 N") && svg.contains("Ft = 0.002 N"));
    let differences = rows(&both.join("differences.csv"));
    let loss = differences.iter().find(|row| row["column"] == "dissipation_J").unwrap();
    // 4 Ft (a - Ft/kt) for kt = 1 N/m, over the amplitudes of the study.
    let losses = |limit: f64| {
        rows(&folder.join("weak/study/loops_summary.csv"))
            .iter()
            .map(|row| row["a_m"].parse::<f64>().unwrap())
            .map(|a| 4.0 * limit * (a - limit).max(0.0))
            .collect::<Vec<_>>()
    };
    let (weak, strong) = (losses(1e-3), losses(2e-3));
    let expected = weak.iter().zip(&strong).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max);
    let largest = weak.iter().copied().fold(0.0, f64::max);
    let number = |name: &str| loss[name].parse::<f64>().unwrap();
    // Rounding error of two losses of some µJ.
    assert!((number("largest_difference") - expected).abs() < 1e-18, "{loss:?}");
    assert!((number("relative") - expected / largest).abs() < 1e-12, "{loss:?}");
    // The comparison replaces itself, but not a run.
    assert_eq!(code(&stickslip(folder, &["plot", "weak/study", "strong/study", "--overlay", "--out", "both"])), 0);
    run(folder, "clash", &[]);
    fs::rename(folder.join("clash/study"), folder.join("clash/study+study")).unwrap();
    let output = stickslip(folder, &["plot", "weak/study", "strong/study", "--overlay", "--out", "clash"]);
    assert_eq!(code(&output), 1);
    assert!(stderr(&output).contains("the folder contains the results of a run"), "{}", stderr(&output));
    let output = stickslip(folder, &["plot", "both/study+study"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("give the folders of the compared runs"), "{}", stderr(&output));
}

#[test]
fn methods_and_grids_are_compared_and_told() {
    let folder = folder("blade-couple");
    let folder = folder.path();
    let study = fs::read_to_string(folder.join("study.toml")).unwrap();
    fs::write(folder.join("study.toml"), study.replacen("points = 241", "points = 31", 1)).unwrap();
    run(folder, "exact", &["--set", "Ft=4N"]);
    run(folder, "series", &["--set", "Ft=4N", "--method", "harmonic-balance"]);
    fs::write(folder.join("study.toml"), study.replacen("points = 241", "points = 26", 1)).unwrap();
    run(folder, "coarse", &["--set", "Ft=4N"]);
    let output = stickslip(
        folder,
        &["plot", "exact/study", "series/study", "coarse/study", "--overlay", "--out", "all", "--only", "csv,svg"],
    );
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
    assert!(stdout(&output).contains("is interpolated linearly to frequency_Hz"), "{}", stdout(&output));
    let all = folder.join("all/study+study+1 more");
    let svg = fs::read_to_string(all.join("figure.svg")).unwrap();
    assert!(svg.contains("harmonic-balance") && svg.contains("event-driven"));
    let differences = rows(&all.join("differences.csv"));
    let of = |run: &str, how: &str| {
        let row = differences.iter().find(|row| row["run"].contains(run) && row["column"] == "blade1_amplitude_m");
        let row = row.unwrap_or_else(|| panic!("no row of {run} in {differences:?}"));
        assert_eq!(row["how"], how);
        row["relative"].parse::<f64>().unwrap()
    };
    // Fifteen harmonics of a slipping orbit: less than one percent of the peak.
    assert!(of("harmonic-balance", "row by row") < 0.01);
    // A chord over 0.12 Hz next to a peak with a width of 0.2 Hz.
    let chord = of("coarse", "interpolated");
    assert!(chord > 1e-6 && chord < 0.1, "{chord}");
    // The positions of peaks do not depend on the grid.
    let peaks = rows(&all.join("peaks.csv"));
    let coarse: Vec<_> = peaks.iter().filter(|row| row["run"].contains("coarse")).collect();
    assert!(!coarse.is_empty());
    assert!(coarse.iter().all(|row| row["amplitude_change"].parse::<f64>().unwrap().abs() < 1e-5), "{coarse:?}");
}

#[test]
fn one_case_is_compared_with_the_same_case_of_many() {
    let folder = folder("blade-couple");
    let folder = folder.path();
    let study = fs::read_to_string(folder.join("study.toml")).unwrap();
    fs::write(folder.join("study.toml"), study.replacen("points = 241", "points = 13", 1)).unwrap();
    run(folder, "many", &[]);
    run(folder, "one", &["--set", "Ft=4N"]);
    for (order, words) in
        [(["many/study", "one/study"], [" has 4, ", " has 1."]), (["one/study", "many/study"], [" has 1, ", " has 4."])]
    {
        let output = stickslip(folder, &["plot", order[0], order[1], "--overlay", "--only", "csv"]);
        assert_eq!((code(&output), stderr(&output)), (0, String::new()));
        let text = stdout(&output);
        assert!(text.contains("only the cases and places of both runs are compared (1)"), "{text}");
        assert!(words.iter().all(|words| text.contains(words)), "{text}");
        let differences = rows(&folder.join("stickslip-out/study+study/differences.csv"));
        let points: Vec<&str> =
            differences.iter().filter(|row| row["table"] == "curve").map(|row| row["points"].as_str()).collect();
        assert!(!points.is_empty() && points.iter().all(|points| *points == "13"), "{points:?}");
        // Equal cases give equal bits.
        assert!(differences.iter().all(|row| row["largest_difference"] == "0.0"), "{differences:?}");
    }
}

#[test]
fn what_cannot_be_drawn_is_named() {
    let folder = folder("element");
    let folder = folder.path();
    run(folder, "out", &[]);
    let wrong = |arguments: &[&str]| {
        let output = stickslip(folder, arguments);
        assert_eq!(code(&output), 2, "{arguments:?}: {}", stderr(&output));
        stderr(&output)
    };
    assert!(wrong(&["plot", "nowhere"]).contains("no results in nowhere"));
    assert!(wrong(&["plot", "out"]).contains("these folders inside it have results: out/study"));
    assert!(wrong(&["plot", "out/study", "--overlay"]).contains("needs at least two runs"));
    assert!(wrong(&["plot", "out/study", "--only", "pdf"]).contains("`pdf`"));
    assert!(wrong(&["plot", "out/study", "--study", "study.tom"]).contains("did you mean"));
    wrong(&["plot"]);
    // No tables.
    assert_eq!(code(&stickslip(folder, &["run", "study.toml", "--out", "bare", "--only", "svg"])), 0);
    assert!(wrong(&["plot", "bare/study"]).contains("with `csv` among its outputs"));
    // Different kinds.
    fs::write(
        folder.join("study.toml"),
        stickslip_study::templates::find("blade-couple").unwrap().study.replacen("points = 241", "points = 3", 1),
    )
    .unwrap();
    run(folder, "couple", &[]);
    let text = wrong(&["plot", "out/study", "couple/study", "--overlay"]);
    assert!(
        text.contains("out/study contains results of the kind `hysteresis`, couple/study of the kind `response`"),
        "{text}"
    );
    assert!(
        wrong(&["plot", "out/study", "--study", "study.toml"]).contains("contains results of the kind `hysteresis`")
    );
    // Reference curves require a computation.
    let study = fs::read_to_string(folder.join("study.toml")).unwrap();
    fs::write(folder.join("study.toml"), format!("{study}\n[figure]\nreferences = true\n")).unwrap();
    let output = stickslip(folder, &["plot", "couple/study", "--study", "study.toml", "--only", "svg"]);
    assert_eq!(code(&output), 0);
    assert!(stderr(&output).contains("no reference curves"), "{}", stderr(&output));
    // A table changed by hand.
    let path = folder.join("out/study/loops.csv");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.lines().take(5).collect::<Vec<_>>().join("\n")).unwrap();
    let text = wrong(&["plot", "out/study"]);
    assert!(text.contains("loops.csv, line 5:") && text.contains("the table has 4 rows"), "{text}");
    // An interrupted run is drawn with a warning.
    let path = folder.join("couple/study/record.json");
    let record = fs::read_to_string(&path).unwrap();
    fs::write(&path, record.replacen("\"interrupted\": false", "\"interrupted\": true", 1)).unwrap();
    let output = stickslip(folder, &["plot", "couple/study", "--only", "svg"]);
    assert_eq!(code(&output), 0);
    assert!(stderr(&output).contains("was interrupted"), "{}", stderr(&output));
}
