//! Tests of the command line: exit status, files, messages and bits of the results.

use assert_cmd::Command;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use tempfile::TempDir;

fn stickslip(folder: &Path, arguments: &[&str]) -> Output {
    Command::cargo_bin("stickslip").unwrap().current_dir(folder).args(arguments).output().unwrap()
}

/// Creates a folder with the starting study of a template after `edits`.
fn folder(template: &str, edits: &[(&str, &str)]) -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let mut text = stickslip_study::templates::find(template).unwrap().study.to_owned();
    for (from, to) in edits {
        assert!(text.contains(from), "{from} is not in the template");
        text = text.replacen(from, to, 1);
    }
    let path = folder.path().join("study.toml");
    fs::write(&path, text).unwrap();
    (folder, path)
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("ended by itself")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_study_runs_and_every_output_is_there() {
    let (folder, _) = folder("blade-couple", &[("points = 241", "points = 13")]);
    let output = stickslip(folder.path(), &["run", "study.toml"]);
    assert_eq!((code(&output), output.stdout.len()), (0, 0), "{}", stderr(&output));
    let out = folder.path().join("stickslip-out/study");
    for file in ["curve.csv", "peaks.csv", "figure.svg", "figure.png", "figure.html", "record.json"] {
        assert!(fs::metadata(out.join(file)).unwrap().len() > 100, "{file}");
    }
    let curve = fs::read_to_string(out.join("curve.csv")).unwrap();
    let header: Vec<&str> = curve.lines().next().unwrap().split(',').collect();
    let expected = [
        "Ft_N",
        "frequency_Hz",
        "blade1_amplitude_m",
        "blade1_mean_m",
        "blade1_phase_deg",
        "contact_amplitude_m",
        "contact_mean_m",
        "contact_phase_deg",
        "blade3_amplitude_m",
        "blade3_mean_m",
        "blade3_phase_deg",
        "shroud_dissipation_J",
        "shroud_slip_fraction",
        "stable",
        "residual",
        "energy_gap",
        "truncation",
        "iterations",
        "found_by",
        "status",
    ];
    assert_eq!(header, expected);
    assert_eq!(curve.lines().count(), 1 + 4 * 13);
    // 119.5 Hz to 122.5 Hz in 13 points, as a user would type them.
    let typed: Vec<String> = (0..13).map(|i| format!("2.0,{:?},", 119.5 + 0.25 * f64::from(i))).collect();
    assert!(curve.lines().skip(1).zip(&typed).all(|(line, typed)| line.starts_with(typed)), "{curve}");
    assert!(curve.lines().skip(1).all(|line| line.ends_with(",converged")));
}

#[test]
fn parameters_and_methods_change_from_outside() {
    let (folder, _) = folder("element", &[]);
    let output = stickslip(folder.path(), &["run", "study.toml", "--set", "Ft=2mN", "--only", "csv", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let dataset: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // 4 Ft (a - Ft/kt) at a = 2.75 mm, Ft = 2 mN, kt = 1 N/m.
    let summary = &dataset["tables"]["loops_summary"][2];
    assert_eq!(summary["a_m"], 0.00275);
    let last = summary["dissipation_J"].as_f64().unwrap();
    assert!((last - 6e-6).abs() < 1e-15, "{last}");
    assert!(!folder.path().join("stickslip-out/study/figure.png").exists());
    let output = stickslip(folder.path(), &["run", "study.toml", "--method", "shooting"]);
    assert_eq!(code(&output), 2);
    let text = stderr(&output);
    assert!(text.contains("shooting does not accept the law `jenkins`"), "{text}");
}

#[test]
fn wrong_input_names_its_place_and_writes_nothing() {
    // LINE stands for the line of the edit.
    let cases: &[(&str, &str, &[&str])] = &[
        ("stiffness = \"kt\"", "stifness = \"kt\"", &["study.toml:LINE:1", "stifness", "did you mean `stiffness`?"]),
        ("stiffness = \"kt\"", "stiffness = \"10 kg\"", &["study.toml:LINE:", "stiffness", "mass"]),
        ("k = \"105103 N/m\"", "k = \"105103 N/\"", &["study.toml:LINE:", "unit"]),
        ("k = \"105103 N/m\"", "k = nan", &["study.toml:LINE:"]),
        ("k = \"105103 N/m\"", "k = inf", &["study.toml:LINE:"]),
        ("m = \"182 g\"", "m = \"-182 g\"", &["study.toml:", "mass"]),
        (
            "between = [\"contact\", \"blade3\"]",
            "between = [\"contact\", \"blade4\"]",
            &["study.toml:LINE:", "blade4", "did you mean"],
        ),
        ("name = \"contact\"", "name = \"blade1\"", &["study.toml:LINE:", "twice"]),
        ("m1 = \"m / 100\"", "m1 = \"kt / 100 * m1 / m1\"", &["study.toml:LINE:", "in a cycle"]),
        ("mass = \"m1\"", "mass = \"m1 +\"", &["study.toml:LINE:"]),
        ("from = \"119.5 Hz\"", "from = \"123.5 Hz\"", &["study.toml:", "from"]),
        ("points = 241", "points = 1000000000", &["study.toml:", "100000000"]),
        ("\"coulomb\"", "\"colomb\"", &["study.toml:", "did you mean `coulomb`"]),
        ("[study]", "[study", &["study.toml:"]),
    ];
    let template = stickslip_study::templates::find("blade-couple").unwrap().study;
    for (from, to, words) in cases {
        let line = template[..template.find(from).unwrap()].matches('\n').count() + 1;
        let (folder, _) = folder("blade-couple", &[(from, to)]);
        let output = stickslip(folder.path(), &["run", "study.toml"]);
        let text = stderr(&output);
        assert_eq!(code(&output), 2, "{to}: {text}");
        for word in words.iter().map(|word| word.replace("LINE", &line.to_string())) {
            assert!(text.contains(&word), "{to}: no `{word}` in\n{text}");
        }
        assert!(!folder.path().join("stickslip-out").exists(), "{to}: something was written");
    }
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("binary.toml"), [0x73, 0xff, 0xfe]).unwrap();
    for (file, word) in [("nowhere.toml", "no such file"), ("binary.toml", "UTF-8"), (".", "folder")] {
        let output = stickslip(folder.path(), &["run", file]);
        assert_eq!(code(&output), 2, "{file}");
        assert!(stderr(&output).contains(word), "{file}: {}", stderr(&output));
    }
}

#[test]
fn one_wrong_file_keeps_the_others_from_running() {
    let (folder, path) = folder("element", &[]);
    fs::copy(&path, folder.path().join("good.toml")).unwrap();
    fs::write(&path, "schema = 2").unwrap();
    let output = stickslip(folder.path(), &["run", "good.toml", "study.toml"]);
    assert_eq!(code(&output), 2);
    assert!(!folder.path().join("stickslip-out").exists());
}

#[test]
fn the_bits_do_not_depend_on_threads() {
    let (folder, _) = folder("blade-couple", &[]);
    let tables: Vec<Vec<Vec<u8>>> = ["1", "2", "3"]
        .iter()
        .map(|threads| {
            let output = stickslip(folder.path(), &["run", "study.toml", "--threads", threads, "-o", threads]);
            assert_eq!(code(&output), 0, "{}", stderr(&output));
            ["curve.csv", "peaks.csv", "figure.svg"]
                .iter()
                .map(|file| fs::read(folder.path().join(threads).join("study").join(file)).unwrap())
                .collect()
        })
        .collect();
    assert!(tables[0] == tables[1] && tables[1] == tables[2]);
}

/// An undamped resonance without slip has no periodic orbit: the point fails, the others stay.
#[test]
fn a_failed_point_stays_in_the_curve_and_ends_with_3() {
    let text = r#"
schema = 1
title = "Undamped oscillator through its resonance"
[[mass]]
name = "body"
mass = "1 kg"
[[spring]]
between = ["body", "ground"]
stiffness = "1 N/m"
[[force]]
on = "body"
amplitude = "1 N"
[study]
kind = "response"
frequency = ["0.5 rad/s", "1 rad/s", "2 rad/s"]
"#;
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("study.toml"), text).unwrap();
    let output = stickslip(folder.path(), &["run", "study.toml", "--only", "csv,json"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("failed at frequency = 0.159155 Hz"), "{}", stderr(&output));
    let curve = fs::read_to_string(folder.path().join("stickslip-out/study/curve.csv")).unwrap();
    let rows: Vec<&str> = curve.lines().skip(1).collect();
    assert_eq!(rows.len(), 3);
    assert!(rows[0].ends_with("converged") && rows[2].ends_with("converged"));
    assert!(!rows[1].contains("converged") || rows[1].ends_with("not-converged"), "{}", rows[1]);
}

/// Methods that estimate their truncation error have a column for it, also for failed or stuck
/// points.
///
/// Three harmonics are too few for rigid friction with a contact mass. The points keep their
/// numbers, but none has the status converged.
#[test]
fn a_series_that_is_too_short_says_so_and_ends_with_3() {
    let series = "\n[method]\nkind = \"harmonic-balance\"\nharmonics = 3\n";
    let (folder, path) = folder("blade-couple", &[("points = 241", "points = 13")]);
    let text = fs::read_to_string(&path).unwrap() + series;
    fs::write(&path, &text).unwrap();
    let output = stickslip(folder.path(), &["run", "study.toml", "--only", "csv,json"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("truncated: the estimated error exceeds the tolerance"), "{}", stderr(&output));
    let out = folder.path().join("stickslip-out/study");
    let curve = fs::read_to_string(out.join("curve.csv")).unwrap();
    let column = curve.lines().next().unwrap().split(',').position(|name| name == "truncation").unwrap();
    let mut truncated = 0;
    for line in curve.lines().skip(1) {
        let error: f64 = line.split(',').nth(column).unwrap().parse().unwrap();
        assert!(line.ends_with(if error > 1e-3 { ",truncated" } else { ",converged" }), "{line}");
        truncated += usize::from(error > 1e-3);
    }
    assert!(truncated > 10);
    assert!(fs::read_to_string(out.join("record.json")).unwrap().contains("the series is too short"));
    // A user can accept an error of one half.
    fs::write(&path, text + "tolerance = 0.5\n").unwrap();
    assert_eq!(code(&stickslip(folder.path(), &["run", "study.toml", "--only", "csv"])), 0);
}

#[test]
fn every_method_fills_the_table() {
    let edits = [
        ("points = 241", "points = 5"),
        ("from = \"119.5 Hz\", to = \"122.5 Hz\"", "from = \"110 Hz\", to = \"121 Hz\""),
    ];
    let (folder, _) = folder("blade-couple-massless", &edits);
    for method in stickslip::method::TABLE.iter().map(|row| row.name).filter(|name| *name != "shooting") {
        for kind in ["response", "orbit"] {
            let path = folder.path().join(format!("{kind}.toml"));
            let text = fs::read_to_string(folder.path().join("study.toml")).unwrap();
            fs::write(&path, text.replace("kind = \"response\"", &format!("kind = \"{kind}\""))).unwrap();
            let file = path.to_str().unwrap();
            let output = stickslip(folder.path(), &["run", file, "--method", method, "--only", "csv", "--out", method]);
            assert!([0, 3].contains(&code(&output)), "{method} {kind}: {}", stderr(&output));
            let table = if kind == "response" { "curve.csv" } else { "orbits.csv" };
            let text = fs::read_to_string(folder.path().join(method).join(kind).join(table)).unwrap();
            let mut lines = text.lines();
            let column = lines.next().unwrap().split(',').position(|name| name == "truncation").unwrap();
            let estimates = ["transient", "harmonic-balance"].contains(&method);
            assert_eq!(lines.next().unwrap().split(',').nth(column).unwrap() != "", estimates, "{method} {kind}");
        }
    }
}

/// Returns the output of a long run of `study.toml` after this signal.
#[cfg(unix)]
fn interrupted(folder: &Path, signal: &str) -> Output {
    let child = std::process::Command::new(assert_cmd::cargo::cargo_bin("stickslip"))
        .current_dir(folder)
        .args(["run", "study.toml", "--only", "csv,json", "--threads", "1"])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // The run takes half a minute on one thread. After this time it has started even on a busy
    // machine.
    std::thread::sleep(std::time::Duration::from_secs(3));
    let kill = std::process::Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    child.wait_with_output().unwrap()
}

/// Ctrl-C and the signals of job schedulers keep the finished points readable during a long
/// sweep.
#[cfg(unix)]
#[test]
fn an_interrupt_keeps_the_finished_points() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        an_interrupt_keeps(signal);
    }
}

#[cfg(unix)]
fn an_interrupt_keeps(signal: &str) {
    let (folder, _) = folder("blade-couple", &[("points = 241", "points = 200000")]);
    let output = interrupted(folder.path(), signal);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    let curve = fs::read_to_string(folder.path().join("stickslip-out/study/curve.csv")).unwrap();
    let rows = curve.lines().count() - 1;
    assert!(rows > 100 && rows < 800_000, "{rows}");
    assert!(curve.lines().skip(1).all(|line| line.ends_with("converged")));
    let record = fs::read_to_string(folder.path().join("stickslip-out/study/record.json")).unwrap();
    assert!(record.contains("\"interrupted\": true"));
}

/// Tables, figures and record of a folder belong to one run. An interrupted run replaces no
/// complete run.
#[cfg(unix)]
#[test]
fn results_belong_to_one_run() {
    let (folder, path) = folder("blade-couple", &[("points = 241", "points = 5")]);
    assert_eq!(code(&stickslip(folder.path(), &["run", "study.toml"])), 0);
    let out = folder.path().join("stickslip-out/study");
    fs::write(out.join("mine.txt"), "mine").unwrap();
    let output = stickslip(folder.path(), &["run", "study.toml", "--set", "Ft=3N", "--only", "csv"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let names = |folder: &Path| {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    assert_eq!(names(&out), ["curve.csv", "mine.txt", "peaks.csv", "record.json"]);
    let record = fs::read_to_string(out.join("record.json")).unwrap();
    assert!(record.contains("Ft = 3N from `--set` replaces the 4 values of `vary`."), "{record}");

    let text = fs::read_to_string(&path).unwrap().replace("points = 5", "points = 200000");
    fs::write(&path, text).unwrap();
    let output = interrupted(folder.path(), "-INT");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains("the complete run in stickslip-out/study/ is unchanged"), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(out.join("record.json")).unwrap(), record);
    let cut_short = folder.path().join("stickslip-out/study.interrupted");
    // Peaks exist if a stretch of the curve was finished.
    let found: Vec<String> = names(&cut_short).into_iter().filter(|name| name != "peaks.csv").collect();
    assert_eq!(found, ["curve.csv", "record.json"]);
}

/// An unusable results folder is reported before the computation.
#[test]
fn an_unwritable_folder_is_found_first() {
    let (folder, _) = folder("blade-couple", &[("points = 241", "points = 200000")]);
    fs::write(folder.path().join("taken"), "").unwrap();
    for arguments in [&["run", "study.toml", "--out", "taken"][..], &["paper", "--out", "taken/deeper"][..]] {
        let output = stickslip(folder.path(), arguments);
        assert_eq!(code(&output), 1);
        assert!(stderr(&output).contains("cannot write taken"), "{}", stderr(&output));
        // The study takes minutes: a run that computes first reports its progress.
        assert!(!stderr(&output).contains("points"), "{}", stderr(&output));
    }
}

#[test]
fn a_study_comes_from_standard_input() {
    let folder = TempDir::new().unwrap();
    let text = stickslip_study::templates::find("element").unwrap().study;
    let run = |text: &str, arguments: &[&str]| {
        let mut command = Command::cargo_bin("stickslip").unwrap();
        command.current_dir(folder.path()).args(arguments).write_stdin(text).output().unwrap()
    };
    let output = run(text, &["run", "-", "--only", "csv"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(folder.path().join("stickslip-out/stdin/loops.csv").is_file());
    assert_eq!(code(&run(text, &["check", "-"])), 0);
    let output = run("schema = 2", &["run", "-"]);
    assert!(code(&output) == 2 && stderr(&output).contains("stdin:1:"), "{}", stderr(&output));
    assert_eq!(code(&run("", &["run", "-"])), 2);
    assert_eq!(code(&run(text, &["run", "-", "--watch"])), 2);
}

/// Asks in intervals until the condition holds. A test that fails must end, so the number of
/// questions is limited; they take two minutes.
#[cfg(unix)]
fn until(what: &str, so: &dyn Fn() -> bool) {
    let held = (0..2400).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(50));
        so()
    });
    assert!(held, "did not happen: {what}");
}

/// A changed file runs again. A temporarily wrong file is reported and does not end the
/// program.
#[cfg(unix)]
#[test]
fn a_watched_file_runs_again() {
    let (folder, path) = folder("element", &[]);
    let log = folder.path().join("log");
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("stickslip"))
        .current_dir(folder.path())
        .args(["run", "study.toml", "--watch", "--only", "csv,json"])
        .stderr(fs::File::create(&log).unwrap())
        .spawn()
        .unwrap();
    let read = |file: &Path| fs::read_to_string(file).unwrap_or_default();
    let record = folder.path().join("stickslip-out/study/record.json");
    let text = read(&path);
    let title = |title: &str| text.replacen("title = \"", &format!("title = \"{title} "), 1);
    until("the first run", &|| read(&record).contains("\"title\""));
    fs::write(&path, title("Second")).unwrap();
    until("the second run", &|| read(&record).contains("\"title\": \"Second "));
    fs::write(&path, "schema = 2").unwrap();
    until("the error", &|| read(&log).contains("reads schema 1"));
    fs::write(&path, title("Third")).unwrap();
    until("the third run", &|| read(&record).contains("\"title\": \"Third "));
    until("the end of the third run", &|| read(&log).matches("waiting for a change").count() == 4);
    assert!(std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(0), "{}", read(&log));
}

/// `--open` passes the figure to the desktop. Without a desktop, the results exist
/// nevertheless.
#[cfg(target_os = "linux")]
#[test]
fn the_figure_is_shown() {
    use std::os::unix::fs::PermissionsExt;
    let (folder, _) = folder("element", &[]);
    let desktop = folder.path().join("bin");
    fs::create_dir(&desktop).unwrap();
    let run = |only: &str| {
        let mut command = Command::cargo_bin("stickslip").unwrap();
        command.current_dir(folder.path()).env("PATH", &desktop);
        command.args(["run", "study.toml", "--open", "--only", only]).output().unwrap()
    };
    let output = run("svg");
    assert!(code(&output) == 0 && stderr(&output).contains("cannot open"), "{}", stderr(&output));
    let shown = folder.path().join("shown");
    let script = desktop.join("xdg-open");
    fs::write(&script, format!("#!/bin/sh\necho \"$1\" > {}\n", shown.display())).unwrap();
    fs::set_permissions(&script, fs::Permissions::from_mode(0o755)).unwrap();
    let output = run("svg,html");
    assert!(code(&output) == 0 && output.stderr.is_empty(), "{}", stderr(&output));
    let path = fs::read_to_string(&shown).unwrap();
    assert!(path.starts_with('/') && path.trim_end().ends_with("stickslip-out/study/figure.html"), "{path}");
    assert!(stderr(&run("csv")).contains("no figure to open"));
}

#[test]
fn lists_templates_schema_and_completions() {
    let folder = TempDir::new().unwrap();
    for what in ["laws", "methods", "templates", "studies"] {
        let output = stickslip(folder.path(), &["list", what]);
        assert!(code(&output) == 0 && output.stdout.len() > 100, "{what}");
    }
    let all = String::from_utf8(stickslip(folder.path(), &["list"]).stdout).unwrap();
    for word in ["LAWS", "coulomb", "METHODS", "event-driven", "TEMPLATES", "blade-couple", "STUDIES", "response"] {
        assert!(all.contains(word), "{word}");
    }
    let output = stickslip(folder.path(), &["schema"]);
    let schema: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(schema["properties"]["study"].is_object());
    assert_eq!(code(&stickslip(folder.path(), &["completions", "bash"])), 0);
    for template in stickslip_study::templates::TABLE {
        let file = format!("{}.toml", template.name);
        let output = stickslip(folder.path(), &["new", template.name]);
        assert!(code(&output) == 0 && output.stdout.is_empty() && stderr(&output).contains(&file), "{output:?}");
        assert_eq!(fs::read_to_string(folder.path().join(&file)).unwrap(), template.study);
        assert_eq!(code(&stickslip(folder.path(), &["check", &file])), 0);
        assert_eq!(code(&stickslip(folder.path(), &["new", template.name])), 2, "an existing file stays");
        assert_eq!(code(&stickslip(folder.path(), &["new", template.name, &file])), 2, "an existing file stays");
        let printed = stickslip(folder.path(), &["new", template.name, "-"]);
        assert!(code(&printed) == 0 && printed.stdout == template.study.as_bytes());
    }
    let output = stickslip(folder.path(), &["new", "blade-cuple"]);
    assert!(code(&output) == 2 && stderr(&output).contains("did you mean `blade-couple`?"), "{}", stderr(&output));
    let output = stickslip(folder.path(), &["new", "bladed-rign"]);
    assert!(code(&output) == 2 && stderr(&output).contains("did you mean `bladed-ring`?"), "{}", stderr(&output));
    assert!(!folder.path().join("bladed-rign.toml").exists());
    let output = stickslip(folder.path(), &["inspect", "."]);
    assert!(code(&output) == 2 && stderr(&output).contains("the path is a folder, not a file"), "{}", stderr(&output));
}

#[test]
fn check_says_what_is_known_before_a_run() {
    let (folder, _) = folder("blade-couple", &[]);
    let output = stickslip(folder.path(), &["check", "study.toml"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!((code(&output), stderr(&output).as_str()), (0, ""));
    // Free 121.25 Hz, stuck 120.94 Hz, largest stuck force 19.72 N at 120.9589 Hz, limit 2 N.
    for word in [
        "nothing wrong",
        "3 degrees of freedom",
        "121.25",
        "120.94",
        "0.101 times the excitation makes it slip at 120.9589 Hz",
        " on one thread",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
}

#[test]
fn warnings_stand_on_standard_error_and_in_the_record() {
    let edits = [("points = 241", "points = 25"), ("F0 = \"10 N\"", "F0 = \"10 N\"\nspare = \"1 N\"")];
    let (folder, _) = folder("blade-couple", &edits);
    let output = stickslip(folder.path(), &["check", "study.toml"]);
    assert!(String::from_utf8_lossy(&output.stdout).contains("1 warning\n"));
    assert!(
        stderr(&output).starts_with("warning: no value of the study uses the parameter `spare`"),
        "{}",
        stderr(&output)
    );
    let output = stickslip(folder.path(), &["run", "study.toml", "--only", "json"]);
    assert_eq!((code(&output), output.stdout.len(), stderr(&output).matches("warning").count()), (0, 0, 1));
    let record = fs::read_to_string(folder.path().join("stickslip-out/study/record.json")).unwrap();
    let record: serde_json::Value = serde_json::from_str(&record).unwrap();
    assert!(record["notes"][0].as_str().unwrap().starts_with("warning: no value"), "{record}");
    assert_eq!(record["study"]["summary"]["degrees_of_freedom"], 3);
}

#[test]
fn an_optimum_at_the_edge_is_warned_of_in_a_pipe() {
    let edits = [("points = 241", "points = 9"), ("\"response\"", "\"performance\""), ("\"6 N\", \"8 N\"", "\"5 N\"")];
    let (folder, _) = folder("blade-couple", &edits);
    let output = stickslip(folder.path(), &["run", "study.toml", "--only", "csv"]);
    assert!(
        stderr(&output).contains("warning: the lowest peak is at an end of the values of Ft"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn a_run_that_needs_too_much_memory_is_refused_in_advance() {
    let edits = [
        ("frequency = \"1 rad/s\"", "frequency = \"1 rad/s\"\nsamples = 100000"),
        ("[\"1.25 mm\", \"2 mm\", \"2.75 mm\"]", "{ from = \"1.25 mm\", to = \"2 mm\", points = 100 }"),
    ];
    let (folder, _) = folder("element", &edits);
    for command in ["check", "run"] {
        let output = stickslip(folder.path(), &[command, "study.toml", "--memory", "200MB"]);
        assert_eq!(code(&output), 2, "{}", stderr(&output));
        let text = stderr(&output).replace("\n  \u{2502} ", " ");
        for word in ["MB of memory", "the limit is 200 MB", "--memory"] {
            assert!(text.contains(word), "{command} {word}: {text}");
        }
    }
    assert!(!folder.path().join("stickslip-out").exists());
    assert_eq!(code(&stickslip(folder.path(), &["check", "study.toml", "--memory", "50 GB"])), 0);
    assert_eq!(code(&stickslip(folder.path(), &["check", "study.toml", "--memory", "lots"])), 2);
}

/// A rod of equal masses, clamped at one end and excited at the other.
///
/// `x/F` at the tip follows from eliminating one mass after another: `d₁ = 2k - mω²`,
/// `dᵢ = 2k - mω² - k²/dᵢ₋₁`, with a single k at the tip. The error of the reduction stays
/// within its reported error in three cases: reduced in the study, read from the saved files,
/// or reduced once more. In the last case the errors add.
#[test]
fn a_reduction_that_is_saved_keeps_its_error() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    let (n, k, m) = (120, 1e7, 0.01);
    let mut stiffness = format!("%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {}\n", 2 * n - 1);
    for i in 1..=n {
        stiffness += &format!("{i} {i} {:e}\n", if i < n { 2.0 * k } else { k });
        if i < n {
            stiffness += &format!("{} {i} {:e}\n", i + 1, -k);
        }
    }
    write("k.mtx", &stiffness);
    let diagonal: String = (1..=n).map(|i| format!("{i} {i} {m}\n")).collect();
    write("m.mtx", &format!("%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {n}\n{diagonal}"));
    // Between the resonances, near 66, 197 and 328 Hz, and the antiresonances.
    let hertz = [20.0, 100.0, 230.0, 300.0];
    let exact = |hertz: f64| {
        let own = m * (std::f64::consts::TAU * hertz).powi(2);
        let before = (1..n - 1).fold(2.0 * k - own, |d, _| 2.0 * k - own - k * k / d);
        1.0 / (k - own - k * k / before).abs()
    };
    let response = "[[force]]\non = \"tip\"\namplitude = \"1 N\"\n[study]\nkind = \"response\"\n\
                    frequency = [\"20 Hz\", \"100 Hz\", \"230 Hz\", \"300 Hz\"]\n\
                    [method]\nkind = \"harmonic-balance\"\nharmonics = 1\n";
    // The largest error over all rows.
    let errs = |study: &str| -> f64 {
        let out = format!("{}-out", study.replace('/', "-"));
        let run = stickslip(folder.path(), &["run", study, "--out", &out]);
        assert_eq!(code(&run), 0, "{}", stderr(&run));
        let mut table = csv::Reader::from_path(folder.path().join(&out).join("study/curve.csv")).unwrap();
        let columns = table.headers().unwrap().clone();
        let at = |name: &str| columns.iter().position(|column| column == name).unwrap_or_else(|| panic!("no {name}"));
        let (amplitude, error) = (at("tip_amplitude_m"), at("reduction_error"));
        let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
        assert_eq!(rows.len(), hertz.len());
        for (row, hertz) in rows.iter().zip(hertz) {
            let [found, error]: [f64; 2] = [amplitude, error].map(|at| row[at].parse().unwrap());
            let off = (found / exact(hertz) - 1.0).abs();
            assert!(error > 0.0 && off <= error, "{study} at {hertz} Hz: {off:e} and said {error:e}");
        }
        rows[0][error].parse().unwrap()
    };
    let reduce = "reduce = { up_to = \"400 Hz\" }";
    let structure = format!(
        "[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\n{reduce}\n[[place]]\nname = \"tip\"\ndof = {n}\n"
    );
    write("study.toml", &format!("schema = 1\n{structure}{response}"));
    let saved = |study: &str, out: &str| {
        let saved = stickslip(folder.path(), &["reduce", study, "--out", out]);
        assert_eq!(code(&saved), 0, "{}", stderr(&saved));
        fs::read_to_string(folder.path().join(out).join("structure.toml")).unwrap()
    };
    let few = saved("study.toml", "few");
    write("few/study.toml", &format!("schema = 1\n{few}{response}"));
    let (spot, read) = (errs("study.toml"), errs("few/study.toml"));
    assert!(spot == read && spot < 1e-4, "{spot:e} {read:e}");
    let said = stickslip(folder.path(), &["check", "few/study.toml"]);
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.contains("by an earlier reduction, error") && said.contains("up to 400 Hz"), "{said}");
    // Places of a mass stay in the study file.
    let block = "[[mass]]\nname = \"block\"\nmass = \"1 g\"\ndirections = [\"x\", \"z\"]\n\
                 [[place]]\nname = \"face\"\nof = \"block\"\nnormal = [0, 0, 1]\n";
    write("block.toml", &format!("schema = 1\n{structure}{block}{response}"));
    assert_eq!(saved("block.toml", "with-block"), few);
    // A structure that is already reduced has nothing to save.
    let said = stickslip(folder.path(), &["reduce", "few/study.toml", "--out", "fewer"]);
    assert_eq!(said.status.code(), Some(2), "{}", String::from_utf8_lossy(&said.stderr));
    assert!(
        String::from_utf8_lossy(&said.stderr).contains("nothing to reduce") && !folder.path().join("fewer").exists()
    );
    // A second reduction with fewer coordinates.
    let again = few.replace("reduce = false", "reduce = { modes = 5 }");
    write("few/again.toml", &format!("schema = 1\n{again}{response}"));
    let fewer = saved("few/again.toml", "fewer");
    assert_eq!(fewer.matches("reduced = {").count(), 1, "{fewer}");
    write("fewer/study.toml", &format!("schema = 1\n{fewer}{response}"));
    let twice = errs("fewer/study.toml");
    assert!(twice > read, "{twice:e} {read:e}");
}

/// The saved reduced sector of a disk is a sector again.
///
/// Its rows stand for its coordinates and for those of the next sector. The study of the saved
/// sector has the results of the study with the reduction. Both deviate from the full sector by
/// at most their reported errors. The nodes rotate about z, and one observed node is on the
/// high side.
#[test]
fn the_sector_of_a_disk_is_saved_and_read_again() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    // Node 1 is on the low side, node 2 on the high side, and nodes 3 to 14 are a blade on node
    // 1.
    let nodes = 14;
    let springs =
        std::iter::once((1, 2, 3e6)).chain((3..=nodes).map(|node| (if node == 3 { 1 } else { node - 1 }, node, 2e6)));
    let mut entries = std::collections::BTreeMap::<(usize, usize), f64>::new();
    let mut add = |row: usize, column: usize, value: f64| {
        *entries.entry((row.max(column), row.min(column))).or_default() += value;
    };
    for (a, b, k) in springs {
        for along in 1..=3 {
            // The stiffness differs along each axis and couples x and y, so that the rotation
            // of the sides matters.
            let (a, b, k) = (3 * a - 3 + along, 3 * b - 3 + along, k / along as f64);
            [(a, a, k), (b, b, k), (a, b, -k)].into_iter().for_each(|(row, column, k)| add(row, column, k));
        }
    }
    (1..=3).for_each(|row| add(row, row, 4e6));
    add(1, 2, 5e5);
    let lines: String = entries.iter().map(|((row, column), value)| format!("{row} {column} {value:e}\n")).collect();
    let head = |count: usize| format!("%%MatrixMarket matrix coordinate real symmetric\n{0} {0} {count}\n", 3 * nodes);
    write("k.mtx", &(head(entries.len()) + &lines));
    let masses: String = (1..=3 * nodes).map(|row| format!("{row} {row} 0.01\n")).collect();
    write("m.mtx", &(head(3 * nodes) + &masses));
    let named = |row: usize| format!("{row},{}.{}\n", row.div_ceil(3), ["x", "y", "z"][(row - 1) % 3]);
    write("rows.csv", &("row,name\n".to_owned() + &(1..=3 * nodes).map(named).collect::<String>()));
    write("sides.csv", "low,high\n1,2\n");
    let tables = |damping: &str, reduce: &str| {
        format!(
            "[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\ndofs = \"rows.csv\"\nunits = \"m-kg-s\"\n{damping}\n{reduce}\n\
             [disk]\nsectors = 7\naxis = \"z\"\nboundary = \"sides.csv\"\n\
             [[place]]\nname = \"tip\"\ndof = \"14.y\"\n[[place]]\nname = \"rim\"\ndofs = [\"2.x\", \"2.y\"]\n"
        )
    };
    let response = "[[force]]\non = \"tip\"\namplitude = \"1 N\"\nengine_order = 2\n\
                    [[joint]]\nname = \"shroud\"\nbetween = [\"tip\", \"next.tip\"]\n\
                    law = { kind = \"jenkins\", stiffness = \"1e5 N/m\", limit = \"0.3 N\" }\n\
                    [study]\nkind = \"response\"\nfrequency = [\"100 Hz\", \"260 Hz\", \"400 Hz\"]\n\
                    [method]\nkind = \"harmonic-balance\"\nharmonics = 7\ntolerance = 0.1\n";
    let columns = ["tip_0_amplitude_m", "tip_3_phase_deg", "rim_0_x_amplitude_m", "rim_6_y_amplitude_m"];
    let found = |study: &str| -> Vec<Vec<f64>> {
        let out = format!("{}-out", study.replace('/', "-"));
        let stem = Path::new(study).file_stem().unwrap();
        let run = stickslip(folder.path(), &["run", study, "--out", &out]);
        assert_eq!(code(&run), 0, "{study}: {}", stderr(&run));
        let mut table = csv::Reader::from_path(folder.path().join(&out).join(stem).join("curve.csv")).unwrap();
        let names = table.headers().unwrap().clone();
        let at =
            columns.map(|name| names.iter().position(|own| own == name).unwrap_or_else(|| panic!("{name}: {names:?}")));
        let error = names.iter().position(|name| name == "reduction_error");
        let row = |row: csv::StringRecord| -> Vec<f64> {
            at.iter().copied().chain(error).map(|at| row[at].parse().unwrap()).collect()
        };
        table.records().map(|record| row(record.unwrap())).collect()
    };
    for (damping, bound) in [("rayleigh = { stiffness = \"1e-5 s\" }", 1e-9), ("modal_damping = \"1 %\"", 3e-4)] {
        let spot = tables(damping, "reduce = { up_to = \"1200 Hz\" }");
        write("study.toml", &format!("schema = 1\n{spot}{response}"));
        let saved = stickslip(folder.path(), &["reduce", "study.toml", "--out", "few"]);
        assert_eq!(code(&saved), 0, "{}", stderr(&saved));
        let said = String::from_utf8_lossy(&saved.stdout).into_owned();
        assert!(said.contains("replace [structure], [[place]] and [disk] by few/structure.toml"), "{said}");
        let few = fs::read_to_string(folder.path().join("few/structure.toml")).unwrap();
        assert!(few.contains("sectors = 7\nboundary = \"boundary.csv\"") && few.contains("name = \"rim\""), "{few}");
        write("few/study.toml", &format!("schema = 1\n{few}{response}"));
        let (spot, read) = (found("study.toml"), found("few/study.toml"));
        let whole = (bound < 1e-5).then(|| {
            write("whole.toml", &format!("schema = 1\n{}{response}", tables(damping, "reduce = false")));
            found("whole.toml")
        });
        for (point, (a, b)) in spot.iter().zip(&read).enumerate() {
            let error = b[columns.len()];
            assert!(error > 0.0 && error >= a[columns.len()] * (1.0 - 1e-9), "{damping}: {a:?} {b:?}");
            for k in 0..columns.len() {
                assert!((a[k] - b[k]).abs() <= bound * a[k].abs(), "{damping}: {}: {a:?} {b:?}", columns[k]);
                // Close to resonances, damping amplifies a small frequency shift by up to
                // fifty.
                let exact = whole.as_ref().map_or(b[k], |whole| whole[point][k]);
                assert!((b[k] - exact).abs() <= 50.0 * error * exact.abs(), "{}: {b:?} {exact}", columns[k]);
            }
        }
    }
    // A disk that cannot be saved gives an error with a remedy.
    write("blade.csv", &("node\n".to_owned() + &(4..=nodes).map(|node| format!("{node}\n")).collect::<String>()));
    let mistuned = "[disk]\nblade = \"blade.csv\"\nmistuning = { of = \"blade.stiffness\", deviation = \"1 %\" }\n";
    let tables = tables("", "reduce = { up_to = \"1200 Hz\" }").replace("[disk]\n", mistuned);
    write("study.toml", &format!("schema = 1\n{tables}{response}"));
    let saved = stickslip(folder.path(), &["reduce", "study.toml", "--out", "none"]);
    assert_eq!(code(&saved), 2);
    assert!(stderr(&saved).contains("remove `blade` and `mistuning`"), "{}", stderr(&saved));
    assert!(!folder.path().join("none").exists());
}

/// One set of coordinates serves all speeds of a structure with rotational stiffening.
///
/// From rest to the speed of the second export, the saved structure has the frequencies of the
/// full structure within the reported error. Its damping follows them.
#[test]
fn a_structure_that_rotation_stiffens_is_saved_for_all_speeds() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    let n = 24;
    // A rod clamped at one end; the tension falls from there to the tip.
    let rod = |pull: f64| {
        let mut text = format!("%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {}\n", 2 * n - 1);
        let spring = |i: usize| if i > n { 0.0 } else { 1e6 * (1.0 + pull * (1.0 - (i as f64 / n as f64).powi(2))) };
        for i in 1..=n {
            text += &format!("{i} {i} {:e}\n", spring(i) + spring(i + 1));
            if i < n {
                text += &format!("{} {i} {:e}\n", i + 1, -spring(i + 1));
            }
        }
        text
    };
    write("k.mtx", &rod(0.0));
    write("k100.mtx", &rod(0.8));
    let diagonal: String = (1..=n).map(|i| format!("{i} {i} 0.01\n")).collect();
    write("m.mtx", &format!("%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {n}\n{diagonal}"));
    let joint = "[[joint]]\nname = \"rub\"\nbetween = [\"tip\", \"ground\"]\n\
                 law = { kind = \"jenkins\", stiffness = \"1e4 N/m\", limit = \"1 N\" }\n";
    let campbell = "[study]\nkind = \"campbell\"\nspeed = { from = \"1 Hz\", to = \"100 Hz\", points = 7 }\nmodes = 3\nengine_orders = 2\n";
    let response = "[[force]]\non = \"tip\"\namplitude = \"3 N\"\n[study]\nkind = \"response\"\n\
                    frequency = { from = \"90 Hz\", to = \"140 Hz\", points = 6 }\n[method]\nkind = \"harmonic-balance\"\nharmonics = 9\n";
    let head = "schema = 1\n[parameters]\nspeed = \"60 Hz\"\n";
    for damping in ["modal_damping = \"0.5 %\"", "rayleigh = { stiffness = \"1e-6 s\" }"] {
        let structure = format!(
            "[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\n{damping}\nreduce = {{ up_to = \"1500 Hz\" }}\n\
             stiffened = {{ file = \"k100.mtx\", at = \"100 Hz\", speed = \"speed\" }}\n[[place]]\nname = \"tip\"\ndof = {n}\n"
        );
        write("study.toml", &format!("{head}{structure}{joint}{campbell}"));
        let saved = stickslip(folder.path(), &["reduce", "study.toml", "--out", "few"]);
        assert_eq!(code(&saved), 0, "{}", stderr(&saved));
        let said = String::from_utf8_lossy(&saved.stdout).into_owned();
        assert!(said.contains("at all speeds up to 6000.0"), "{said}");
        let few = fs::read_to_string(folder.path().join("few/structure.toml")).unwrap();
        let both = |kind: &str, table: &str, wanted: [&str; 2]| {
            let rows = |study: &str, structure: &str| -> Vec<Vec<f64>> {
                write(study, &format!("{head}{structure}{joint}{kind}"));
                let out = format!("{}-out", study.replace('/', "-"));
                let run = stickslip(folder.path(), &["run", study, "--out", &out]);
                assert_eq!(code(&run), 0, "{}", stderr(&run));
                let mut table = csv::Reader::from_path(folder.path().join(&out).join("study").join(table)).unwrap();
                let columns = table.headers().unwrap().clone();
                let at = wanted.map(|name| columns.iter().position(|column| column == name).unwrap());
                table.records().map(|row| at.map(|k| row.as_ref().unwrap()[k].parse().unwrap()).to_vec()).collect()
            };
            let (whole, few) = (rows("study.toml", &structure), rows("few/study.toml", &few));
            assert!(whole.len() == few.len() && whole.len() >= 6, "{} {}", whole.len(), few.len());
            for (a, b) in whole.iter().zip(&few) {
                // Each of the two reductions has a relative error of at most 1e-4 close to a
                // resonance.
                assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 3e-4 * a.abs()), "{damping}: {a:?} {b:?}");
            }
            whole
        };
        both(response, "curve.csv", ["frequency_Hz", "tip_amplitude_m"]);
        let whole = both(campbell, "campbell.csv", ["speed_Hz", "frequency_Hz"]);
        let tightened = |speed: f64| whole.iter().find(|row| row[0] == speed).unwrap()[1];
        assert!(tightened(100.0) > 1.2 * tightened(1.0), "{whole:?}");
    }
}

/// Two matrices and a separate file of row names give the lowest frequencies and the mass along
/// x.
///
/// The mass identifies the units. It is the sum of the entries of `bricks.mas` between rows
/// along x, computed by hand.
#[test]
fn inspect_tells_frequencies_and_mass() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../formats/tests/data");
    let inspect = |files: &[&str]| {
        let inspected = stickslip(&data, &[&["inspect"], files].concat());
        assert_eq!(code(&inspected), 0, "{}", stderr(&inspected));
        String::from_utf8_lossy(&inspected.stdout).into_owned()
    };
    let said = inspect(&["bricks.sti", "bricks.mas", "bricks.dof"]);
    for words in [
        "names of 30 rows",
        "bricks.sti as stiffness, bricks.mas as mass",
        "according to their names",
        "mass of the free rows, in the units of the file: along x 1.354889e-8",
        // Millimetre, tonne, second: 1000 kg; inch: 4.4482216152605 N by 0.0254 m.
        "1.3549e-5 kg if units = \"mm-t-s\"",
        "1.3549e-8 kg if units = \"mm-kg-s\"",
        "2.3728e-6 kg if units = \"in-lbf-s\"",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    // Without names there are no directions.
    let unnamed = inspect(&["bricks.sti", "bricks.mas"]);
    assert!(
        unnamed.contains("lowest frequencies")
            && unnamed.contains("mass: unknown, because no row name contains a direction"),
        "{unnamed}"
    );
}

/// A mesh has its sizes, its extent and its sets, and a damaged one an error with its line.
#[test]
fn inspect_describes_meshes() {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../formats/tests/meshes");
    let inspected = stickslip(&meshes, &["inspect", "quadratic.inp"]);
    let said = String::from_utf8_lossy(&inspected.stdout).into_owned();
    for words in [
        "mesh of 38 nodes, 1 hexahedra of 20 nodes, 1 tetrahedra of 10 nodes, 2 wedges of 15 nodes",
        "extent x 0 to 2, y 0 to 1, z 0 to 2",
        "14 outer faces, area 11.3251",
        "set FOOT: 14 nodes, 3 outer faces, area 2",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("wrong.inp"), "*NODE\n1,0,0,0\n2,0,x\n").expect("a file");
    let inspected = stickslip(folder.path(), &["inspect", "wrong.inp"]);
    assert!(code(&inspected) == 2 && stderr(&inspected).contains("wrong.inp, line 3"), "{}", stderr(&inspected));
    let picture = folder.path().join("mesh.png");
    let path = picture.to_str().expect("a path");
    let drawn = stickslip(&meshes, &["inspect", "quadratic.inp", "--picture", path]);
    let bytes = fs::read(&picture).expect("a picture");
    assert!(code(&drawn) == 0 && bytes.starts_with(b"\x89PNG"), "{}", stderr(&drawn));
    let drawn = stickslip(&meshes, &["inspect", "quadratic.inp", "quadratic.inp", "--picture", path]);
    assert!(code(&drawn) == 2 && stderr(&drawn).contains("name one file with a mesh"), "{}", stderr(&drawn));
    stickslip(folder.path(), &["new", "element", "element.toml"]);
    let drawn = stickslip(folder.path(), &["check", "element.toml", "--picture", "contacts.png"]);
    assert!(code(&drawn) == 2 && stderr(&drawn).contains("the study has none; remove --picture"), "{}", stderr(&drawn));
    assert!(!folder.path().join("contacts.png").exists());
}

/// `inspect` treats constrained and massless rows in the same way as a study.
///
/// Covered are zero rows of ANSYS, the 1e36 of Abaqus, and rows that are missing in the mass
/// matrix. The structure has two springs of 4 and 9 N/m on 1 kg each, and a third row that is
/// constrained or massless.
#[test]
fn inspect_leaves_out_what_is_constrained() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    let banner = "%%MatrixMarket matrix coordinate real general\n3 3 2\n";
    write("k_zero.mtx", &format!("{banner}1 1 4\n3 3 9\n"));
    write("m_zero.mtx", &format!("{banner}1 1 1\n3 3 1\n"));
    write("k_light.mtx", "1,1, 1,1, 4.\n2,1, 2,1, 9.\n3,1, 3,1, 16.\n");
    write("m_light.mtx", "1,1, 1,1, 1.\n2,1, 2,1, 1.\n");
    write("k_held.mtx", "1,1, 1,1, 4.\n2,1, 2,1, 9.\n3,1, 3,1, 1e36\n");
    write("m_held.mtx", "1,1, 1,1, 1.\n2,1, 2,1, 1.\n3,1, 3,1, 5.\n");
    write("m_other.mtx", "1,1, 1,1, 1.\n2,1, 2,1, 1.\n7,1, 7,1, 5.\n");
    let inspect = |kind: &str, mass: &str| {
        let (stiffness, mass) = (format!("k_{kind}.mtx"), format!("m_{mass}.mtx"));
        let inspected = stickslip(folder.path(), &["inspect", &stiffness, &mass]);
        assert_eq!(code(&inspected), 0, "{}", stderr(&inspected));
        String::from_utf8_lossy(&inspected.stdout).into_owned()
    };
    let lowest = [2.0, 3.0].map(|omega| format!("{:.6e}", omega / std::f64::consts::TAU)).join(", ");
    for (kind, left_out) in [("zero", true), ("light", false), ("held", true)] {
        let said = inspect(kind, kind);
        assert!(
            said.contains(&format!("lowest frequencies, Hz: {lowest} (if the unit of time is s)")),
            "{kind}: {said}"
        );
        assert!(said.contains("the structure has no further frequencies"), "{kind}: {said}");
        assert_eq!(said.contains("1 row is constrained and removed"), left_out, "{kind}: {said}");
        assert_eq!(
            said.contains("positive definite, except for rows without an entry or with 1e36"),
            left_out,
            "{kind}: {said}"
        );
        assert_eq!(said.contains("along x 2.000000e0\n"), kind != "zero", "{kind}: {said}");
    }
    let said = inspect("held", "other");
    assert!(said.contains("no frequencies: row `7.x` of the matrix is not among the 3 given row names"), "{said}");
}

/// Names identify stiffness and mass before the size of their entries does.
///
/// The cases are a heavy mass on a soft spring, and three matrices with one damping matrix. 4
/// N/m and 100 kg give 0.2 rad/s.
#[test]
fn inspect_goes_by_names() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, value: f64| {
        let text = format!("%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 {value:e}\n2 2 {value:e}\n");
        fs::write(folder.path().join(name), text).unwrap();
    };
    for (name, value) in
        [("K.mtx", 4.0), ("M.mtx", 100.0), ("C.mtx", 1.0), ("a.mtx", 400.0), ("b.mtx", 1e4), ("e.mtx", 1.0)]
    {
        write(name, value);
    }
    let inspect = |files: &[&str]| {
        let inspected = stickslip(folder.path(), &[&["inspect"], files].concat());
        assert_eq!(code(&inspected), 0, "{}", stderr(&inspected));
        String::from_utf8_lossy(&inspected.stdout).into_owned()
    };
    for files in [&["K.mtx", "M.mtx"][..], &["M.mtx", "K.mtx"], &["C.mtx", "K.mtx", "M.mtx"]] {
        let said = inspect(files);
        assert!(said.contains("K.mtx as stiffness, M.mtx as mass, according to their names"), "{said}");
        assert!(said.contains(&format!("{:.6e}", 0.2 / std::f64::consts::TAU)), "{said}");
    }
    let said = inspect(&["a.mtx", "b.mtx"]);
    assert!(said.contains("b.mtx as stiffness, a.mtx as mass, because the entries of the first are larger"), "{said}");
    let said = inspect(&["a.mtx", "b.mtx", "e.mtx"]);
    assert!(said.contains("no frequencies: the names do not show which matrix"), "{said}");
}

/// `inspect` and `check` report invalid matrix files.
///
/// The message contains the file, the line if the file has lines, the expected content and a
/// remedy. No damaged file is accepted.
#[test]
fn wrong_files_of_matrices_say_what_to_do() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../formats/tests/data");
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| fs::read(data.join(name)).unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    let changed = |name: &str, from: &str, to: &str| {
        let text = String::from_utf8(read(name)).unwrap();
        assert!(text.contains(from), "{name}: {from}");
        text.replacen(from, to, 1).into_bytes()
    };
    let cut = |name: &str| {
        let bytes = read(name);
        bytes[..bytes.len() * 6 / 10].to_vec()
    };
    for name in ["bricks.sti", "bricks.mas", "bricks.dof", "hbmat.mapping", "general.mtx", "v5.mat"] {
        write(name, &read(name));
    }
    // The end record of a zip file without entries.
    write("empty.npz", &[b"PK\x05\x06".to_vec(), vec![0; 18]].concat());
    write("coordinate.mtx", &cut("abaqus_coordinate.mtx"));
    write("input.mtx", &cut("abaqus_input.mtx"));
    write("cut.op4", &cut("bigmat_little.op4"));
    write("cut.full", &cut("by_the_letter.full"));
    write("cut.matrix", &cut("hbmat.matrix"));
    write("cut73.mat", &cut("v73.mat"));
    write("complex.pch", &changed("punch.pch", "0       6       2 ", "0       6       3 "));
    write("complex.rua", &changed("general.rua", "RUA", "CUA"));
    write("pointers.rua", &changed("general.rua", " 1 3 3 5", " 1 3 9 5"));
    write("beyond.op4", &changed("dense_text.op4", "6       6       6       2KAA", "6       4       2       2KAA"));
    let inspect = |files: &[&str]| {
        let inspected = stickslip(folder.path(), &[&["inspect"], files].concat());
        (code(&inspected), stderr(&inspected) + &String::from_utf8_lossy(&inspected.stdout))
    };
    for (file, words) in [
        ("empty.npz", &["empty.npz: the file contains no matrix", "export"][..]),
        ("bricks.dof", &["bricks.dof: this file contains row names", "stickslip inspect MATRIX bricks.dof"]),
        ("hbmat.mapping", &["hbmat.mapping: this file contains row names"]),
        ("coordinate.mtx", &["coordinate.mtx, line 11: the file ends within a line", "copy it again"]),
        ("input.mtx", &["input.mtx, line 8: the file ends within a line"]),
        ("cut.op4", &["cut.op4, byte", "the file ends after", "not complete"]),
        ("cut.full", &["cut.full, byte", "the file ends after", "not complete"]),
        ("cut.matrix", &["cut.matrix, line 8", "expected a row for every entry, found nothing"]),
        ("cut73.mat", &["cut73.mat: the HDF5 file cannot be read", "unexpected EOF", "copy the file again"]),
        ("complex.pch", &["complex.pch, `KAAX`: this is not a real matrix: complex", "real part"]),
        ("complex.rua", &["complex.rua: this is not a real matrix: complex"]),
        ("pointers.rua", &["pointers.rua: the pointers run from 0 to 4 for 4 entries; they must begin at 0, ascend"]),
        ("beyond.op4", &["KAA", "beyond.op4, line 4: the entry in row 5", "export it again"]),
    ] {
        let (status, said) = inspect(&[file]);
        assert!(status == 2 && words.iter().all(|words| said.contains(words)), "{file}: {status}, {said}");
    }
    // Names next to a matrix with other rows, and next to a matrix that is not square.
    let (status, said) = inspect(&["bricks.sti", "hbmat.mapping"]);
    assert!(status == 2 && said.contains("hbmat.mapping: the file has 6 names for 30 rows"), "{said}");
    let (status, said) = inspect(&["general.mtx", "bricks.dof"]);
    assert!(
        status == 2 && said.contains("give it together with the square matrix") && said.contains("4 x 3"),
        "{said}"
    );
    // A text and complex numbers in the file of a matrix are not errors.
    let (status, said) = inspect(&["v5.mat"]);
    assert!(status == 0 && said.contains("label (text)") && said.contains("z (complex)"), "{said}");
    let check = |stiffness: &str, mass: &str, more: &str| {
        let text = format!(
            "schema = 1\n[structure]\nstiffness = \"{stiffness}\"\nmass = \"{mass}\"\n{more}\n[[place]]\nname = \"tip\"\ndof = 1\n\
             [[force]]\non = \"tip\"\namplitude = \"1 N\"\n[study]\nkind = \"response\"\nfrequency = \"100 Hz\"\n"
        );
        fs::write(folder.path().join("study.toml"), text).unwrap();
        let checked = stickslip(folder.path(), &["check", "study.toml"]);
        // The lines of a box are as wide as a terminal.
        let said = stderr(&checked);
        (code(&checked), said.split(['\n', '│', ' ']).filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" "))
    };
    let rows = String::from_utf8(read("abaqus_input.mtx")).unwrap();
    let own = |node: &str| -> String {
        let lines = rows.lines().map(|line| line.split(',').map(str::trim).collect::<Vec<_>>());
        let own = lines.filter(|fields| fields[..2] == fields[2..4]);
        own.map(|f| format!("{0},{1}, {0},{1}, 1e-6\n", f[0].replace("10", node), f[1])).collect()
    };
    write("k.mtx", rows.as_bytes());
    write("other.mtx", own("11").as_bytes());
    write("negative.mtx", own("10").replacen("1e-6", "-1e-6", 1).as_bytes());
    let units = "units = \"mm-t-s\"";
    for (stiffness, mass, more, words) in [
        ("k.mtx", "other.mtx", units, &["other.mtx", "row `11.z`", "matrices from one export"][..]),
        ("k.mtx", "negative.mtx", units, &["negative kinetic energy", "is truncated"]),
        ("k.mtx", "negative.mtx", "", &["`units` is missing", "mm-t-s"]),
        ("complex.pch", "k.mtx", units, &["complex.pch", "KAAX", "real part"]),
        ("general.mtx", "k.mtx", units, &["general.mtx", "4 rows and 3 columns"]),
        ("empty.npz", "k.mtx", units, &["empty.npz: the file contains no matrix", "export the matrix again"]),
        ("cut73.mat", "k.mtx", units, &["cut73.mat: the HDF5 file cannot be read"]),
        (
            "bricks.sti",
            "bricks.mas",
            "units = \"mm-t-s\"\ndofs = \"bricks.mas\"",
            &["bricks.mas, line 1: expected row names"],
        ),
        ("bricks.sti", "bricks.mas", "units = \"mm-t-s\"\ndofs = \"hbmat.mapping\"", &["6 names for 30 rows"]),
    ] {
        let (status, said) = check(stiffness, mass, more);
        assert!(status == 2 && words.iter().all(|words| said.contains(words)), "{stiffness} {mass}: {status} {said}");
    }
}
