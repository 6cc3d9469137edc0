//! Files of data that other programs wrote, read to the last bit; and damaged ones.

use proptest::prelude::*;
use std::path::{Path, PathBuf};
use stickslip_formats::data::{TABLE, read, read_bytes};

use crate::fuzz::{Random, damaged, number_of_variable, peak_memory};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/measured")
}

/// A column by its name, with its values.
type ExpectedColumn = (String, Vec<f64>);

/// Returns the blocks of `expected.txt`: a file, and its columns.
fn expected() -> Vec<(String, Vec<ExpectedColumn>)> {
    let text = std::fs::read_to_string(folder().join("expected.txt")).expect("the expected values");
    let column = |line: &str| {
        let mut words = line.split(' ');
        let name = words.next().expect("a name").to_owned();
        (name, words.map(|word| word.parse().expect("a number")).collect())
    };
    let block = |block: &str| {
        let mut lines = block.trim_end().lines();
        (lines.next().expect("a file").to_owned(), lines.map(column).collect())
    };
    text.split("\n\n").map(block).collect()
}

#[test]
fn files_of_other_programs_are_read_to_the_last_bit() {
    let mut formats = Vec::new();
    for (name, columns) in expected() {
        let file = read(folder().join(&name)).unwrap_or_else(|error| panic!("{error}"));
        let found: Vec<ExpectedColumn> =
            file.columns.iter().map(|column| (column.name.clone(), column.values.clone())).collect();
        for (column, values) in &columns {
            let found = found.iter().find(|(name, _)| name == column).unwrap_or_else(|| panic!("{name}: no {column}"));
            let same = |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan();
            let is_same = found.1.len() == values.len() && found.1.iter().zip(values).all(same);
            assert!(is_same, "{name}, {column}: {:?} instead of {values:?}", found.1);
        }
        assert_eq!(
            found.len(),
            columns.len(),
            "{name}: {:?}",
            file.columns.iter().map(|c| &c.name).collect::<Vec<_>>()
        );
        formats.push(file.format);
    }
    for format in TABLE {
        assert!(formats.contains(&format.name), "no file of {}", format.name);
    }
}

#[test]
fn what_is_not_read_is_listed() {
    let file = read(folder().join("packed.mat")).expect("a file");
    assert_eq!(file.notes, ["run(1).title = first", "run(2).title = ", "cells{2} = word"]);
    let file = read(folder().join("geometry.uff")).expect("a file");
    assert!(file.notes.iter().any(|note| note.starts_with("units: 1 SI; 1 m is 1")), "{:?}", file.notes);
    let file = read(folder().join("snappy.parquet")).expect("a file");
    let reasons = [
        "`title` has no numbers",
        "`list.list.element` is a list",
        "`day` is a date or a time; save it as a number of seconds",
        "`price` has no numbers",
    ];
    assert_eq!(file.skipped, reasons);
    let file = read(folder().join("germany.csv")).expect("a file");
    assert_eq!(file.notes, ["line 6 is left out: it has 2 of 3 fields", "Prüfstand 3"]);
}

#[test]
fn incomplete_results_of_finite_element_programs_are_refused() {
    for (name, length, words) in [
        ("contact.frd", 2000, "no results at nodes"),
        ("contact.frd", 8978, "the last result is not complete"),
        ("contact.dat", 1500, "different numbers of values"),
        ("contact.rpt", 400, "no table of values"),
    ] {
        let bytes = std::fs::read(folder().join(name)).expect("a file");
        let error = read_bytes(&bytes[..length]).expect_err(name).to_string();
        assert!(error.contains(words), "{name}: {error}");
    }
}

fn files() -> Vec<Vec<u8>> {
    expected().iter().map(|(name, _)| std::fs::read(folder().join(name)).expect("a file")).collect()
}

/// Reads damaged copies of the files with one ending, `count` of each; returns how many are
/// still data.
fn fuzz(ending: &str, seed: u64, count: usize) -> usize {
    let mut random = Random::new(seed);
    let mut readable = 0;
    for (name, _) in expected().iter().filter(|(name, _)| name.ends_with(ending)) {
        let file = std::fs::read(folder().join(name)).expect("a file");
        for _ in 0..count {
            let bytes = damaged(&file, &mut random);
            let memory = peak_memory(|| readable += usize::from(read_bytes(&bytes).is_ok()));
            assert!(memory < (64 << 20) + 1000 * bytes.len() as u64, "{name}: {memory} bytes for {}", bytes.len());
        }
    }
    readable
}

#[test]
fn damaged_files_take_memory_in_proportion_to_their_size() {
    assert!(fuzz("", 0x2468_ace0, 200) > 200);
}

/// Many damages: `cargo test -p stickslip-formats --test it data_files -- --ignored`.
/// `STICKSLIP_FUZZ_RUNS` is the number for every file, `STICKSLIP_FUZZ_FORMAT` the ending of the
/// names, as `uff`.
#[test]
#[ignore = "takes minutes"]
fn many_damaged_data_files() {
    let count = number_of_variable("STICKSLIP_FUZZ_RUNS", 20_000) as usize;
    let ending = std::env::var("STICKSLIP_FUZZ_FORMAT").unwrap_or_default();
    fuzz(&ending, 0x1357_9bdf, count);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Damaged files give data or an error; columns never outgrow the file.
    #[test]
    fn damaged_files_are_read_or_refused(
        which in any::<prop::sample::Index>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let files = files();
        let mut bytes = files[which.index(files.len())].clone();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(file) = read_bytes(&bytes) {
            let numbers: usize = file.columns.iter().map(|column| column.values.len()).sum();
            prop_assert!(numbers <= 1_000 * bytes.len().max(1000), "{numbers} numbers of {} bytes", bytes.len());
        }
    }

    /// Any bytes after the beginning of a format give data or an error.
    #[test]
    fn random_bytes_are_read_or_refused(
        start in prop::sample::select(vec![
            &b""[..], b"    -1\n    58\n", b"    -1\n    58b     1     2          11    16\n", b"    -1\n  2412\n", b"    -1\n    55\n",
            b"RIFF\x00\x00\x00\x00WAVEfmt ", b"\x93NUMPY\x01\x00", b"PK\x03\x04", b"PAR1", b"a;b\n1;2\n",
        ]),
        rest in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let _ = read_bytes(&[start, &rest].concat());
    }
}
