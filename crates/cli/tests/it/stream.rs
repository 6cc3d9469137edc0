//! Runs that are killed, sharded, or lose their disk give the same results as an undisturbed
//! run.
#![cfg(unix)]

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;
use tempfile::TempDir;

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("stickslip"));
    command.current_dir(folder).args(arguments).stderr(Stdio::piped()).stdout(Stdio::piped());
    command
}

fn stickslip(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = stickslip(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    stderr(&output)
}

/// Returns the error output of a refused command.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = stickslip(folder, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
    stderr(&output)
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Creates a folder with the study of the couple for `points` frequencies and four slip limits.
fn couple(points: usize) -> TempDir {
    let folder = TempDir::new().unwrap();
    let text = stickslip_study::templates::find("blade-couple").unwrap().study;
    let text = text.replace("points = 241", &format!("points = {points}"));
    fs::write(folder.path().join("couple.toml"), text).unwrap();
    folder
}

/// Returns the files of a run, without the entries of the record that differ between runs.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries
        .map(|entry| {
            let (name, mut bytes) = (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap());
            if name == "record.json" {
                let mut record: Value = serde_json::from_slice(&bytes).unwrap();
                record["wall_time_s"] = Value::Null;
                record["threads"] = Value::Null;
                bytes = serde_json::to_vec_pretty(&record).unwrap();
            }
            (name, bytes)
        })
        .collect()
}

fn same(a: &Path, b: &Path) {
    let (a, b) = (files(a), files(b));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(*bytes == b[name], "{name}: {} and {} bytes", bytes.len(), b[name].len());
    }
}

/// Waits, then kills the run. Returns `true` if it had already ended.
fn killed(mut child: Child, after: Duration) -> bool {
    let interval = Duration::from_millis(5);
    for _ in 0..after.div_duration_f64(interval).ceil() as usize {
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "{status}");
            return true;
        }
        std::thread::sleep(interval);
    }
    child.kill().unwrap();
    child.wait().unwrap();
    false
}

fn events(text: &str, name: &str) -> Vec<Value> {
    let lines = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    lines.filter(|event| event["event"] == name).collect()
}

/// Times of the kills in s. They are arbitrary, but equal in every test run.
fn instants() -> impl Iterator<Item = Duration> {
    (1u64..).map(|i| Duration::from_millis(i.wrapping_mul(2_654_435_761) % 1_700))
}

/// Kills and resumes runs `kills` times. Every completed run must have the bytes of the
/// undisturbed run.
fn killed_at(points: usize, kills: usize) {
    let folder = couple(points);
    let outputs = ["--only", "csv,parquet,svg"];
    done(folder.path(), &[&["run", "couple.toml", "--out", "whole"][..], &outputs].concat());
    let mut instants = instants();
    let mut left = kills;
    let (results, running) = (folder.path().join("killed/couple"), folder.path().join("killed/couple.running"));
    while left > 0 {
        let (mut by_itself, mut over, mut runs, mut reported) = (false, false, 0, 0);
        while !over {
            let arguments = ["run", "couple.toml", "--out", "killed", "--resume", "--progress", "json"];
            let log = folder.path().join("log");
            let mut command = command(folder.path(), &[&arguments[..], &outputs].concat());
            let child = command.stderr(fs::File::create(&log).unwrap()).spawn().unwrap();
            let after = if left > 0 { instants.next().unwrap() } else { Duration::from_secs(600) };
            by_itself = killed(child, after);
            // A kill may come after the results are written and the journal is removed. No run
            // remains to resume.
            over = by_itself || results.join("record.json").exists() && !running.join("journal").exists();
            left -= usize::from(!by_itself);
            runs += 1;
            // The units reported as kept are on disk.
            let log = fs::read_to_string(&log).unwrap();
            for begin in events(&log, "begin") {
                assert!(begin["kept"].as_u64().unwrap() >= reported, "{log}");
            }
            let kept = events(&log, "progress").iter().filter_map(|event| event["kept"].as_u64()).max();
            reported = reported.max(kept.unwrap_or(0));
        }
        assert!(runs > 1, "the machine is so fast that nothing was killed");
        same(&folder.path().join("whole/couple"), &results);
        assert!(!by_itself || !running.exists());
        fs::remove_dir_all(folder.path().join("killed")).unwrap();
    }
}

#[test]
fn a_killed_run_goes_on_and_ends_with_the_same_bytes() {
    killed_at(20_000, 8);
}

/// Fifty kills of a run with 200,000 points, which takes minutes.
#[test]
#[ignore = "takes minutes"]
fn fifty_kills_of_a_large_run_change_nothing() {
    killed_at(50_000, 50);
}

#[test]
fn parts_joined_are_the_whole() {
    let folder = couple(500);
    let at = |name: &str| folder.path().join(name);
    done(folder.path(), &["run", "couple.toml", "--out", "whole", "--also", "parquet"]);
    for number in 1..=3 {
        let shard = format!("{number}/3");
        let said = done(folder.path(), &["run", "couple.toml", "--out", "parts", "--shard", &shard, "--threads", "1"]);
        assert!(said.contains("stickslip merge"), "{said}");
    }
    done(folder.path(), &["merge", "parts", "--out", "joined", "--also", "parquet"]);
    same(&at("whole/couple"), &at("joined/couple"));

    let part = |number: usize| format!("parts/couple.shard-{number}-of-3");
    let said = refused(folder.path(), &["merge", &part(1), &part(3), "--out", "no"]);
    assert!(said.contains("are missing in the given shards, after parts/couple.shard-1-of-3"), "{said}");
    let said = refused(folder.path(), &["merge", &part(1), &part(2), "--out", "no"]);
    assert!(said.contains("after parts/couple.shard-2-of-3"), "{said}");
    let said = refused(folder.path(), &["merge", &part(1), &part(2), &part(2), &part(3), "--out", "no"]);
    assert!(said.contains("both contain unit"), "{said}");
    done(folder.path(), &["run", "couple.toml", "--out", "other", "--shard", "2/3", "--set", "kt=9 N/mm"]);
    let said = refused(folder.path(), &["merge", &part(1), "other/couple.shard-2-of-3", &part(3), "--out", "no"]);
    assert!(said.contains("with --set kt=9 N/mm instead of without --set"), "{said}");
    let said = refused(folder.path(), &["merge", "whole", "--out", "no"]);
    assert!(said.contains("no part of a study in whole"), "{said}");
    // An unfinished shard.
    let journal = at(&part(2)).join("journal");
    let bytes = fs::read(&journal).unwrap();
    fs::write(&journal, &bytes[..bytes.len() / 2]).unwrap();
    let said = refused(folder.path(), &["merge", "parts", "--out", "no"]);
    assert!(said.contains("couple.shard-2-of-3 is unfinished"), "{said}");
    assert!(!at("no").exists());
    done(folder.path(), &["run", "couple.toml", "--out", "parts", "--shard", "2/3", "--resume"]);
    done(folder.path(), &["merge", "parts", "--out", "again", "--also", "parquet"]);
    same(&at("whole/couple"), &at("again/couple"));
}

/// Kills a run after some units are kept, and returns its folder.
fn unfinished(folder: &Path) -> PathBuf {
    let log = folder.join("log");
    let mut child = command(folder, &["run", "couple.toml", "--progress", "json", "--threads", "1", "--only", "csv"])
        .stderr(fs::File::create(&log).unwrap())
        .spawn()
        .unwrap();
    while !events(&fs::read_to_string(&log).unwrap(), "progress").iter().any(|event| event["kept"] != 0) {
        assert!(child.try_wait().unwrap().is_none(), "the run ended and nothing is kept");
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    folder.join("stickslip-out/couple.running")
}

#[test]
fn a_run_is_not_gone_on_with_as_another_one() {
    let folder = couple(100_000);
    assert!(unfinished(folder.path()).join("journal").is_file());
    let said = refused(folder.path(), &["run", "couple.toml", "--resume", "--set", "Ft=3 N"]);
    assert!(said.contains("it ran without --set instead of with --set Ft=3 N"), "{said}");
    let said = refused(folder.path(), &["run", "couple.toml", "--resume", "--method", "transient"]);
    assert!(said.contains("its method is auto instead of transient"), "{said}");
    let text = fs::read_to_string(folder.path().join("couple.toml")).unwrap();
    fs::write(folder.path().join("couple.toml"), text.replace("\"0.2 kg/s\" ", "\"0.3 kg/s\" ")).unwrap();
    let said = refused(folder.path(), &["run", "couple.toml", "--resume"]);
    assert!(said.contains("of its study file is") && said.contains("0.3 kg/s"), "{said}");
}

#[test]
fn a_journal_that_is_taken_away_ends_the_run() {
    let folder = couple(100_000);
    let mut command = command(folder.path(), &["run", "couple.toml", "--threads", "1", "--only", "csv"]);
    let mut child = command.spawn().unwrap();
    let running = folder.path().join("stickslip-out/couple.running");
    while !running.join("journal").exists() {
        assert!(child.try_wait().unwrap().is_none(), "the run ended without a journal");
        std::thread::sleep(Duration::from_millis(5));
    }
    // Another run into the same folder reports this.
    let other = stickslip(folder.path(), &["run", "couple.toml", "--resume"]);
    assert!(other.status.code() == Some(1) && stderr(&other).contains("another run is writing"), "{}", stderr(&other));
    fs::remove_dir_all(&running).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("was removed or replaced during the run"), "{}", stderr(&output));
    assert!(!folder.path().join("stickslip-out/couple").exists());
}

/// A limit on the file size has the same effect on the program as a full disk.
#[test]
fn a_full_disk_ends_the_run_and_loses_nothing() {
    let folder = couple(20_000);
    done(folder.path(), &["run", "couple.toml", "--out", "whole", "--only", "csv"]);
    let program = assert_cmd::cargo::cargo_bin("stickslip");
    // Blocks of 512 bytes. Without the trap, the system ends the program before it can report
    // the error.
    let limited = |blocks: usize| {
        let script = format!(
            "trap '' XFSZ; ulimit -f {blocks}; exec {} run couple.toml --out full --only csv --resume --threads 2",
            program.display()
        );
        Command::new("sh").current_dir(folder.path()).args(["-c", &script]).output().unwrap()
    };
    let output = limited(8_000);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let said = stderr(&output);
    assert!(said.contains("cannot write full/couple.running/journal") && said.contains("--resume"), "{said}");
    // The journal now fits, the table does not.
    let output = limited(35_000);
    let said = stderr(&output);
    assert!(output.status.code() == Some(1) && said.contains("--resume writes the results from them"), "{said}");
    assert!(!folder.path().join("full/couple").exists());
    done(folder.path(), &["run", "couple.toml", "--out", "full", "--only", "csv", "--resume"]);
    same(&folder.path().join("whole/couple"), &folder.path().join("full/couple"));
}

#[test]
fn programs_read_how_a_run_goes_on() {
    let folder = couple(20);
    let said = done(folder.path(), &["run", "couple.toml", "--progress", "json", "--only", "csv"]);
    let lines: Vec<Value> = said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<&str> =
        lines.iter().map(|line| line["event"].as_str().unwrap()).filter(|e| *e != "message").collect();
    assert_eq!(names, ["begin", "progress", "written", "end"]);
    let begin = &events(&said, "begin")[0];
    assert_eq!((&begin["points"], &begin["units"], &begin["kept"]), (&80.into(), &4.into(), &0.into()));
    assert_eq!(events(&said, "progress")[0]["points"], 80);
    let written = &events(&said, "written")[0]["files"];
    assert!(written.as_array().unwrap().iter().any(|file| file == "stickslip-out/couple/curve.csv"), "{written}");
    let end = &events(&said, "end")[0];
    assert_eq!((&end["status"], &end["points"]["converged"]), (&"done".into(), &80.into()));
    // Errors are also reported as events.
    fs::write(folder.path().join("couple.toml"), "schema = 1").unwrap();
    let output = stickslip(folder.path(), &["run", "couple.toml", "--progress", "json"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).lines().all(|line| serde_json::from_str::<Value>(line).is_ok()), "{}", stderr(&output));
}

/// The couple with an uncertain slip limit and stiffness.
fn uncertain(count: usize, design: &str) -> TempDir {
    let folder = couple(31);
    let path = folder.path().join("couple.toml");
    let text = fs::read_to_string(&path).unwrap().replace("vary = { Ft = [\"2 N\", \"4 N\", \"6 N\", \"8 N\"] }", "");
    let sample = format!(
        "\n[sample]\ncount = {count}\nseed = 7\ndesign = \"{design}\"\n\
         of = {{ Ft = {{ lognormal = [\"4 N\", \"1 N\"] }}, k = {{ uniform = [\"105 kN/m\", \"105.2 kN/m\"] }} }}\n"
    );
    fs::write(&path, text + &sample).unwrap();
    folder
}

#[test]
fn samples_are_the_same_in_parts_and_on_any_number_of_threads() {
    for design in ["random", "latin-hypercube", "sobol"] {
        let folder = uncertain(32, design);
        done(folder.path(), &["run", "couple.toml", "--out", "two", "--threads", "2"]);
        done(folder.path(), &["run", "couple.toml", "--out", "one", "--threads", "1"]);
        for shard in ["1/2", "2/2"] {
            done(folder.path(), &["run", "couple.toml", "--out", "parts", "--shard", shard]);
        }
        done(folder.path(), &["merge", "parts", "--out", "joined"]);
        let at = |name: &str| folder.path().join(name).join("couple");
        same(&at("two"), &at("one"));
        same(&at("two"), &at("joined"));
        let record: Value = serde_json::from_slice(&fs::read(at("one").join("record.json")).unwrap()).unwrap();
        assert_eq!(record["seed"], 7);
        let curve = fs::read_to_string(at("one").join("curve.csv")).unwrap();
        assert!(curve.starts_with("Ft_N,k_N_per_m,frequency_Hz,"), "{}", &curve[..60]);
        assert_eq!(curve.lines().count(), 1 + 32 * 31);
        let figure = fs::read_to_string(at("one").join("figure.svg")).unwrap();
        assert!(figure.contains("32 draws") && figure.contains("median"), "{design}");
        // The stored results are drawn again.
        let before = figure;
        done(folder.path(), &["plot", "one/couple"]);
        assert_eq!(fs::read_to_string(at("one").join("figure.svg")).unwrap(), before);
    }
}

#[test]
fn impossible_draws_are_refused_at_their_line() {
    let folder = uncertain(50, "random");
    let path = folder.path().join("couple.toml");
    let text = fs::read_to_string(&path).unwrap();
    let edited = |from: &str, to: &str| {
        assert!(text.contains(from));
        fs::write(&path, text.replace(from, to)).unwrap();
        let said = stderr(&stickslip(folder.path(), &["check", "couple.toml"])).replace("\n  \u{2502} ", " ");
        said.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let said = edited("lognormal = [\"4 N\", \"1 N\"]", "normal = [\"1 N\", \"1 N\"]");
    assert!(said.contains("of 50") && said.contains("within = [least, most]") && said.contains("lognormal"), "{said}");
    let said = edited("lognormal = [\"4 N\", \"1 N\"]", "normal = [\"1 N\", \"1 N\"], within = [\"0 N\", \"3 N\"]");
    assert_eq!(said, "");
    for (from, to, words) in [
        ("lognormal", "lognormel", "did you mean `lognormal`?"),
        ("\"1 N\"]", "\"-1 N\"]", "must be more than zero"),
        ("\"1 N\"]", "\"1 kg\"]", "Ft"),
        ("Ft = {", "Fx = {", "there is no parameter `Fx` to draw"),
        ("count = 50", "count = 0", "count"),
        ("design = \"random\"", "design = \"halton\"", "unknown value `halton`"),
        ("kind = \"response\"", "kind = \"response\"\nvary = { Ft = [\"1 N\", \"2 N\"] }", "is also in `vary`"),
        ("\"105 kN/m\", \"105.2 kN/m\"", "\"105 kN/m\"", "`uniform` takes from, to"),
    ] {
        let said = edited(from, to);
        assert!(said.contains(words), "{to}: {said}");
    }
}
