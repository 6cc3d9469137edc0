//! A frozen corpus of models and studies: records what the program computes, and compares two
//! records. It proves that a change of the code changes no result.
//!
//! ```text
//! cargo run --release -p stickslip-verification --bin corpus -- record DIR [CLASS]... [--part 1/4]
//! cargo run --release -p stickslip-verification --bin corpus -- compare OLD NEW
//! ```
//!
//! - `classes`: the items of each class;
//! - `record`: runs them and writes their tables;
//! - `compare`: differences in values, statuses, work and algorithms.

#![allow(clippy::print_stdout, clippy::print_stderr)] // a command

#[path = "../../../../study/tests/it/random/mod.rs"]
mod random;

mod classes;
mod compare;
mod record;

use std::path::Path;
use std::process::ExitCode;

const USAGE: &str = "usage:
  corpus record DIR [CLASS]... [--part K/N] [--files FOLDER]
  corpus compare OLD NEW
classes: paper, gallery, random, audit, rows, loose, files (the studies below FOLDER); all but files by default";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let done = match args[..] {
        ["record", folder, ref rest @ ..] => {
            record::Selection::parse(rest).and_then(|what| record::record(Path::new(folder), &what)).map(|()| true)
        }
        ["compare", old, new] => compare::compare(Path::new(old), Path::new(new)),
        _ => Err(USAGE.to_owned()),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(message) => {
            eprintln!("{message}");
            ExitCode::from(2)
        }
    }
}
