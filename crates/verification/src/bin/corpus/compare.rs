//! Compares two records of the corpus: values against their reported errors, statuses, work.

use crate::record::REFUSED;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A table that was read back.
struct Sheet {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Sheet {
    fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let cells = |line: &str| line.split(',').map(str::to_owned).collect();
        let mut lines = text.lines();
        let names = lines.next().map(cells).unwrap_or_default();
        Ok(Sheet { names, rows: lines.map(cells).collect() })
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|other| other == name)
    }

    fn text(&self, row: usize, name: &str) -> &str {
        self.column(name).map_or("", |column| &self.rows[row][column])
    }

    fn number(&self, row: usize, column: usize) -> Option<f64> {
        self.rows[row].get(column)?.parse().ok()
    }

    /// The reported relative error of a row.
    fn error(&self, row: usize) -> f64 {
        let error = self.column("truncation").and_then(|column| self.number(row, column));
        error.filter(|error| error.is_finite()).unwrap_or(0.0)
    }

    fn largest(&self, column: usize) -> f64 {
        let values = (0..self.rows.len()).filter_map(|row| self.number(row, column));
        values.filter(|value| value.is_finite()).fold(0.0, |most, value| most.max(value.abs()))
    }
}

#[derive(Default)]
struct Differences {
    tables: usize,
    equal: usize,
    points: usize,
    /// Points by their old and new status, where these differ.
    statuses: BTreeMap<(String, String), usize>,
    /// CellValues beyond the reported errors: the excess, and the place in words.
    values: Vec<(f64, String)>,
    /// Tables that only one record has, or that have another shape.
    shapes: Vec<String>,
    iterations: [f64; 2],
    found_by: BTreeMap<String, [usize; 2]>,
}

/// Prints the differences by class. Returns true if nothing differs.
pub fn compare(old: &Path, new: &Path) -> Result<bool, String> {
    let mut same = true;
    for class in names(old)?.union(&names(new)?) {
        let mut found = Differences::default();
        let [before, after] = [old, new].map(|record| record.join(class));
        for item in names(&before)?.union(&names(&after)?) {
            let [before, after] = [&before, &after].map(|class| class.join(item));
            for file in names(&before)?.union(&names(&after)?) {
                let [before, after] = [&before, &after].map(|item| item.join(file));
                let place = format!("{class}/{item}/{file}");
                if !before.exists() || !after.exists() {
                    let which = if before.exists() { "old" } else { "new" };
                    found.shapes.push(format!("{place}: only in the {which} record"));
                } else if file != REFUSED {
                    found.add(&place, &Sheet::read(&before)?, &Sheet::read(&after)?);
                }
            }
        }
        same &= found.print(class);
    }
    Ok(same)
}

/// Names in a folder; none if it does not exist.
fn names(folder: &Path) -> Result<BTreeSet<String>, String> {
    if !folder.exists() {
        return Ok(BTreeSet::new());
    }
    let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    Ok(entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect())
}

impl Differences {
    fn add(&mut self, place: &str, old: &Sheet, new: &Sheet) {
        self.tables += 1;
        for (which, sheet) in [old, new].into_iter().enumerate() {
            for row in 0..sheet.rows.len() {
                self.iterations[which] += sheet.text(row, "iterations").parse::<f64>().unwrap_or(0.0);
                let by = sheet.text(row, "found_by");
                if !by.is_empty() {
                    self.found_by.entry(by.to_owned()).or_default()[which] += 1;
                }
            }
        }
        self.points += old.rows.len();
        if old.rows == new.rows {
            self.equal += 1;
            return;
        }
        if (old.rows.len(), old.names.len()) != (new.rows.len(), new.names.len()) {
            let size = |sheet: &Sheet| format!("{} x {}", sheet.rows.len(), sheet.names.len());
            self.shapes.push(format!("{place}: {} before, {} now", size(old), size(new)));
            return;
        }
        for row in 0..old.rows.len() {
            let statuses = (old.text(row, "status"), new.text(row, "status"));
            if statuses.0 != statuses.1 {
                *self.statuses.entry((statuses.0.to_owned(), statuses.1.to_owned())).or_default() += 1;
            }
        }
        let evidence = ["residual", "energy_gap", "truncation", "return_defect", "iterations", "found_by", "status"];
        for (column, name) in old.names.iter().enumerate().filter(|(_, name)| !evidence.contains(&name.as_str())) {
            let size = old.largest(column).max(f64::MIN_POSITIVE);
            for row in 0..old.rows.len() {
                let [Some(a), Some(b)] = [old, new].map(|sheet| sheet.number(row, column)) else { continue };
                let excess = (a - b).abs() / size - old.error(row) - new.error(row);
                // Relative difference of a value, beyond the reported errors, that is always
                // allowed.
                if excess > 1e-9 {
                    self.values.push((excess, format!("{place}, row {row}, {name}: {a:?} before, {b:?} now")));
                }
            }
        }
    }

    fn print(mut self, class: &str) -> bool {
        // Number of the largest differences that are printed.
        let printed = 20;
        let Differences { tables, equal, points, .. } = self;
        let lost: usize = self
            .statuses
            .iter()
            .filter(|((old, new), _)| old == "converged" && new != "truncated")
            .map(|(_, n)| n)
            .sum();
        println!("{class}: {equal} of {tables} tables equal, {points} rows, {lost} no longer converged");
        println!(
            "  iterations {} before, {} now; found by {:?}",
            self.iterations[0], self.iterations[1], self.found_by
        );
        self.statuses.iter().for_each(|((old, new), count)| println!("  {count} points from {old} to {new}"));
        self.shapes.iter().take(printed).for_each(|line| println!("  {line}"));
        self.values.sort_by(|a, b| b.0.total_cmp(&a.0));
        println!("  {} values beyond the reported errors", self.values.len());
        self.values.iter().take(printed).for_each(|(excess, line)| println!("  {excess:.1e}: {line}"));
        equal == tables && self.shapes.is_empty()
    }
}
