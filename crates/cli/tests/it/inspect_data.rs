//! `stickslip inspect` for files of measured data.

use assert_cmd::Command;
use std::path::{Path, PathBuf};

fn inspect(file: &Path) -> (i32, String, String) {
    let output =
        Command::cargo_bin("stickslip").expect("the command").arg("inspect").arg(file).output().expect("a run");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../formats/tests/measured").join(name)
}

#[test]
fn columns_units_sampling_and_a_plot_are_shown() {
    for (name, parts) in [
        ("germany.csv", vec!["delimited-text, 3 columns", "Kraft [kN]", "steps of 1.0", "line 6 is left out"]),
        ("function_text_5_even.uff", vec!["1.imaginary [(m/s^2)/(N)]", "frequency response function 3 -y / 1 +x"]),
        ("packed.mat", vec!["run(2).F_imaginary", "cells{2} = word"]),
        ("plain.npz", vec!["c_real"]),
        ("sound.wav", vec!["channel_2", "steps of 1.25"]),
    ] {
        let (code, out, err) = inspect(&data(name));
        assert_eq!(code, 0, "{name}: {err}");
        parts.iter().for_each(|part| assert!(out.contains(part), "{name}: no `{part}` in {out}"));
        // monotonic columns and words are not drawn
        let drawn = !["packed.mat", "plain.npz"].contains(&name);
        let plot = out.chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c));
        assert!(plot || !drawn, "{name}: no plot in {out}");
    }
}

#[test]
fn a_damaged_table_is_refused_with_its_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("broken.csv");
    std::fs::write(&file, "time,force\n0,1\n1,x\n2,3\n").expect("a file");
    let (code, _, err) = inspect(&file);
    assert!(code == 2 && err.contains("line 3"), "{code} {err}");
}
