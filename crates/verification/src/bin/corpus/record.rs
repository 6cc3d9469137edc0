//! Runs the items of the corpus and writes their tables as CSV, one folder per item.

use crate::classes::{CLASSES, FILES, Item, items};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;
use stickslip_study::dataset::{CellValues, Table};

/// Name of the file with the reason why an item has no tables.
pub const REFUSED: &str = "refused.txt";

/// The items of a run.
pub struct Selection {
    classes: Vec<String>,
    /// Number of this part, from 0, and number of parts.
    part: (usize, usize),
    folder: Option<PathBuf>,
}

impl Selection {
    pub fn parse(args: &[&str]) -> Result<Self, String> {
        let mut selection = Selection { classes: Vec::new(), part: (0, 1), folder: None };
        let mut args = args.iter();
        while let Some(arg) = args.next() {
            let mut value = || args.next().copied().ok_or(format!("{arg} needs a value"));
            match *arg {
                "--part" => selection.part = part(value()?)?,
                "--files" => selection.folder = Some(PathBuf::from(value()?)),
                class => selection.classes.push(class.to_owned()),
            }
        }
        if selection.classes.is_empty() {
            selection.classes = CLASSES.map(str::to_owned).to_vec();
        }
        if selection.folder.is_some() && !selection.classes.iter().any(|class| class == FILES) {
            selection.classes.push(FILES.to_owned());
        }
        Ok(selection)
    }
}

fn part(text: &str) -> Result<(usize, usize), String> {
    let numbers: Option<(usize, usize)> =
        text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
    match numbers {
        Some((k, n)) if 1 <= k && k <= n => Ok((k - 1, n)),
        _ => Err(format!("--part {text}: expected K/N with K from 1 to N")),
    }
}

/// Runs the selected items and writes their tables below `folder`.
pub fn record(folder: &Path, selection: &Selection) -> Result<(), String> {
    for class in &selection.classes {
        let all = items(class, selection.folder.as_deref()).ok_or(format!("no class `{class}` (or no --files)"))?;
        let (part, parts) = selection.part;
        let some: Vec<Item> = all.into_iter().skip(part).step_by(parts).collect();
        let begun = Instant::now();
        let found: Vec<Counts> = some
            .par_iter()
            .map(|item| {
                let tables = item.tables();
                write(&folder.join(class).join(&item.name), &tables).map(|()| Counts::of(&tables))
            })
            .collect::<Result<_, _>>()
            .map_err(|error| format!("{}: {error}", folder.display()))?;
        let counts = found.into_iter().fold(Counts::default(), Counts::and);
        println!("{class}: {counts} in {:.1} s", begun.elapsed().as_secs_f64());
    }
    Ok(())
}

fn write(folder: &Path, tables: &Result<Vec<Table>, String>) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    match tables {
        Ok(tables) => {
            tables.iter().try_for_each(|table| std::fs::write(folder.join(format!("{}.csv", table.name)), csv(table)))
        }
        Err(reason) => std::fs::write(folder.join(REFUSED), reason),
    }
}

/// A table as CSV; numbers are written so that they read back bit for bit.
fn csv(table: &Table) -> String {
    let mut text = table.columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>().join(",");
    text.push('\n');
    for row in 0..table.rows() {
        for (k, column) in table.columns.iter().enumerate() {
            let comma = if k > 0 { "," } else { "" };
            let written = match &column.values {
                CellValues::Number(values) => write!(text, "{comma}{:?}", values[row]),
                CellValues::Integer(values) => write!(text, "{comma}{}", values[row]),
                CellValues::Text(values) => write!(text, "{comma}{}", values[row].replace(',', ";")),
                CellValues::Flag(values) => write!(text, "{comma}{:?}", values[row]),
            };
            written.expect("a string takes all text");
        }
        text.push('\n');
    }
    text
}

/// Numbers of points by status and algorithm, and the hash of all values.
#[derive(Default)]
struct Counts {
    items: usize,
    refused: usize,
    status: BTreeMap<String, usize>,
    found_by: BTreeMap<String, usize>,
    iterations: u64,
    hash: u64,
}

impl Counts {
    fn of(tables: &Result<Vec<Table>, String>) -> Self {
        let mut counts = Counts { items: 1, ..Counts::default() };
        let Ok(tables) = tables else { return Counts { refused: 1, ..counts } };
        for (table, column) in tables.iter().flat_map(|table| table.columns.iter().map(move |c| (table, c))) {
            match (&column.values, column.name.as_str()) {
                (CellValues::Text(words), "status") => {
                    words.iter().for_each(|word| *counts.status.entry(word.clone()).or_default() += 1);
                }
                (CellValues::Text(words), "found_by") => {
                    words.iter().for_each(|word| *counts.found_by.entry(word.clone()).or_default() += 1);
                }
                (CellValues::Integer(values), "iterations") => counts.iterations += values.iter().sum::<u64>(),
                _ => {}
            }
            if let CellValues::Number(values) = &column.values {
                let bits = values.iter().flat_map(|value| value.to_bits().to_le_bytes());
                counts.hash = counts.hash.wrapping_add(fnv(table.name.bytes().chain(bits)));
            }
        }
        counts
    }

    fn and(mut self, other: Counts) -> Self {
        for (sum, part) in [(&mut self.status, other.status), (&mut self.found_by, other.found_by)] {
            part.into_iter().for_each(|(word, count)| *sum.entry(word).or_default() += count);
        }
        Counts {
            items: self.items + other.items,
            refused: self.refused + other.refused,
            iterations: self.iterations + other.iterations,
            hash: self.hash.rotate_left(1) ^ other.hash,
            ..self
        }
    }
}

impl std::fmt::Display for Counts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Counts { items, refused, status, found_by, iterations, hash } = self;
        write!(
            f,
            "{items} items, {refused} refused, {status:?}, by {found_by:?}, {iterations} iterations, hash {hash:016x}"
        )
    }
}

/// The 64-bit FNV-1a hash.
fn fnv(bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
