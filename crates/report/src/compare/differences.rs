//! Differences between runs: the largest in every column, and all differences of peaks and
//! optima.

use super::column_roles::{ColumnRoles, RunTable, with_parameter_columns};
use super::row_matching::{MatchedRow, TablePair, difference, pairs};
use crate::run::stored::Stored;
use std::collections::BTreeMap;
use stickslip_study::dataset::{CellValues, Column, Table};

/// Prefix of columns with values of the first run.
pub(super) const FIRST: &str = "first_";
/// Name of the table of the largest differences.
pub(super) const DIFFERENCES: &str = "differences";
/// Tables whose rows are also compared one by one in a separate table.
const ONE_BY_ONE: [&str; 2] = ["peaks", "optimum"];

/// The largest difference in a column.
#[derive(Debug, Default)]
struct Largest {
    difference: f64,
    /// Largest absolute value in the first run.
    size: f64,
    at: String,
    values: (f64, f64),
    points: u64,
}

/// A run with its label in the comparison.
#[derive(Clone, Copy)]
pub(super) struct LabelledRun<'a> {
    pub(super) run: &'a Stored,
    pub(super) label: &'a str,
}

/// The tables of differences, extended with every run.
#[derive(Debug, Default)]
pub(super) struct Differences {
    rows: Vec<DifferenceRow>,
    found: Vec<Table>,
    pub(super) notes: Vec<String>,
}

#[derive(Debug)]
struct DifferenceRow {
    table: String,
    column: String,
    run: String,
    how: &'static str,
    largest: Largest,
}

impl Differences {
    /// Adds the differences between the first run and another run.
    pub(super) fn add(&mut self, first: LabelledRun<'_>, other: LabelledRun<'_>) {
        let (LabelledRun { run: first, label }, LabelledRun { run: other, label: run }) = (first, other);
        for table in &first.dataset.tables {
            let Some(with) = other.dataset.tables.iter().find(|t| t.name == table.name) else {
                self.notes.push(format!("{}: {run} does not contain this table.", table.name));
                continue;
            };
            let (ours, theirs) = (RunTable { run: first, table }, RunTable { run: other, table: with });
            let (table, with) = (&with_parameter_columns(ours, theirs), &with_parameter_columns(theirs, ours));
            let (reading, reading_with) = (ColumnRoles::new(first, table), ColumnRoles::new(other, with));
            if reading.keys != reading_with.keys || reading.abscissa != reading_with.abscissa {
                let words = |reading: &ColumnRoles| {
                    let keys: Vec<&str> = reading.keys.iter().chain(&reading.abscissa).map(String::as_str).collect();
                    if keys.is_empty() { "nothing".to_owned() } else { keys.join(", ") }
                };
                self.notes.push(format!(
                    "{}: not compared, because its rows are identified by {} in {label}, but by {} in {run}.",
                    table.name,
                    words(&reading),
                    words(&reading_with)
                ));
                continue;
            }
            self.table(TablePair { first: table, other: with }, &reading, run, label);
        }
    }

    fn table(&mut self, tables: TablePair<'_>, reading: &ColumnRoles, run: &str, label: &str) {
        let TablePair { first: table, other: with } = tables;
        let groups = reading.groups(table);
        let others: BTreeMap<String, Vec<usize>> = reading.groups(with).into_iter().collect();
        let columns: Vec<&str> =
            reading.values(table).into_iter().filter(|name| with.numbers(name).is_some()).collect();
        let mut largest: Vec<Largest> = columns.iter().map(|_| Largest::default()).collect();
        let (mut interpolates, mut exact, mut common) = (false, false, 0);
        let mut one_by_one: Vec<MatchedRow> = Vec::new();
        for (key, rows) in &groups {
            let Some(rows_with) = others.get(key) else { continue };
            common += 1;
            let (rows, rows_with) = (inside(table, rows), inside(with, rows_with));
            if reading.abscissa.is_none() && rows.len() != rows_with.len() {
                let place = if key.is_empty() { String::new() } else { format!(" at {key}") };
                self.notes.push(format!(
                    "{}: {} rows{place} in {label}, but {} in {run}.",
                    table.name,
                    rows.len(),
                    rows_with.len()
                ));
            }
            let Some((pairs, interpolated)) = pairs(tables, reading.abscissa.as_deref(), &rows, &rows_with) else {
                let place = if key.is_empty() { String::new() } else { format!(" at {key}") };
                self.notes.push(format!(
                    "{}: not compared{place}, because the curves have different numbers of turning points.",
                    table.name
                ));
                continue;
            };
            interpolates |= interpolated && !pairs.is_empty();
            exact |= !interpolated && !pairs.is_empty();
            for (name, largest) in columns.iter().zip(&mut largest) {
                let (Some(a), Some(b)) = (table.numbers(name), with.numbers(name)) else { continue };
                for pair in &pairs {
                    largest.add(name, a[pair.first], pair.value(name, b), &|| {
                        let x = reading.abscissa.as_deref().and_then(|name| table.column(name));
                        let x = x.map(|x| format!("{} = {}", x.name, crate::output::csv::cell(&x.values, pair.first)));
                        [Some(key.clone()), x]
                            .into_iter()
                            .flatten()
                            .filter(|t| !t.is_empty())
                            .collect::<Vec<_>>()
                            .join(", ")
                    });
                }
            }
            one_by_one.extend(pairs);
        }
        if common < groups.len().max(others.len()) {
            self.notes.push(format!(
                "{}: only the cases and places of both runs are compared ({common}); {label} has {}, {run} has {}.",
                table.name,
                groups.len(),
                others.len()
            ));
        }
        let how = match (interpolates, exact) {
            (true, true) => "partly interpolated",
            (true, false) => "interpolated",
            (false, _) => "row by row",
        };
        if interpolates {
            let x = reading.abscissa.as_deref().unwrap_or_default();
            self.notes.push(format!("{}: {run} is interpolated linearly to {x} of {label}.", table.name));
        }
        if ONE_BY_ONE.contains(&table.name.as_str()) && !one_by_one.is_empty() {
            self.found(tables, reading, &columns, &one_by_one, run);
        }
        for (name, largest) in columns.into_iter().zip(largest).filter(|(_, largest)| largest.points > 0) {
            self.rows.push(DifferenceRow {
                table: table.name.clone(),
                column: name.to_owned(),
                run: run.to_owned(),
                how,
                largest,
            });
        }
    }

    /// Compares every peak or optimum with that of the first run.
    fn found(
        &mut self,
        tables: TablePair<'_>,
        reading: &ColumnRoles,
        columns: &[&str],
        pairs: &[MatchedRow],
        run: &str,
    ) {
        let TablePair { first: table, other: with } = tables;
        let mut made: Vec<Column> = vec![Column::texts("run", pairs.iter().map(|_| run.to_owned()).collect())];
        for key in reading.keys.iter().filter_map(|key| table.column(key)) {
            made.push(match &key.values {
                CellValues::Number(values) => {
                    Column::numbers(&key.name, pairs.iter().map(|p| values[p.first]).collect())
                }
                values => {
                    Column::texts(&key.name, pairs.iter().map(|p| crate::output::csv::cell(values, p.first)).collect())
                }
            });
        }
        for name in columns {
            let (Some(a), Some(b)) = (table.numbers(name), with.numbers(name)) else { continue };
            let (a, b): (Vec<f64>, Vec<f64>) = pairs.iter().map(|p| (a[p.first], p.value(name, b))).unzip();
            let relative = a.iter().zip(&b).map(|(a, b)| if a == b { 0.0 } else { (b - a) / a.abs() }).collect();
            made.push(Column::numbers(&format!("{FIRST}{name}"), a));
            made.push(Column::numbers(name, b));
            made.push(Column::numbers(&format!("{}_change", without_unit(name)), relative));
        }
        match self.found.iter_mut().find(|t| t.name == table.name) {
            None => self.found.push(Table { name: table.name.clone(), columns: made }),
            // A run with different columns is omitted.
            Some(t) if t.columns.iter().map(|c| &c.name).ne(made.iter().map(|c| &c.name)) => {}
            Some(t) => {
                for (column, more) in t.columns.iter_mut().zip(made) {
                    match (&mut column.values, more.values) {
                        (CellValues::Number(a), CellValues::Number(b)) => a.extend(b),
                        (CellValues::Text(a), CellValues::Text(b)) => a.extend(b),
                        _ => {}
                    }
                }
            }
        }
    }

    pub(super) fn tables(self) -> Vec<Table> {
        let rows = &self.rows;
        let words =
            |name: &str, of: &dyn Fn(&DifferenceRow) -> String| Column::texts(name, rows.iter().map(of).collect());
        let numbers =
            |name: &str, of: &dyn Fn(&DifferenceRow) -> f64| Column::numbers(name, rows.iter().map(of).collect());
        let columns = vec![
            words("table", &|row| row.table.clone()),
            words("column", &|row| row.column.clone()),
            words("run", &|row| row.run.clone()),
            numbers("largest_difference", &|row| row.largest.difference),
            numbers("relative", &|row| row.largest.relative()),
            words("at", &|row| row.largest.at.clone()),
            words("how", &|row| row.how.to_owned()),
            Column {
                name: "points".into(),
                values: CellValues::Integer(rows.iter().map(|row| row.largest.points).collect()),
            },
            numbers("first_value", &|row| row.largest.values.0),
            numbers("value", &|row| row.largest.values.1),
        ];
        let differences = Table { name: DIFFERENCES.into(), columns };
        self.found.into_iter().chain([differences]).collect()
    }
}

/// Returns the rows of peaks inside the frequency range, or all rows of other tables.
fn inside(table: &Table, rows: &[usize]) -> Vec<usize> {
    match table.column("at_range_end").map(|column| &column.values) {
        Some(CellValues::Flag(ends)) if table.name == "peaks" => {
            rows.iter().copied().filter(|row| ends[*row] != Some(true)).collect()
        }
        _ => rows.to_vec(),
    }
}

/// Returns the name of a column without its unit.
fn without_unit(name: &str) -> &str {
    ["_Hz", "_m", "_N", "_rad"].iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name)
}

impl Largest {
    /// Compares a value `a` of the first run with the value `b` of another run.
    fn add(&mut self, name: &str, a: f64, b: f64, at: &dyn Fn() -> String) {
        let difference = difference(name, a, b);
        if !difference.is_finite() {
            return;
        }
        if difference.abs() > self.difference || self.points == 0 {
            (self.difference, self.at, self.values) = (difference.abs(), at(), (a, b));
        }
        self.points += 1;
        self.size = self.size.max(a.abs());
    }

    fn relative(&self) -> f64 {
        if self.difference == 0.0 { 0.0 } else { self.difference / self.size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_go_the_short_way_around() {
        let mut largest = Largest::default();
        largest.add("blade_phase_deg", 179.0, -179.0, &String::new);
        assert_eq!((largest.difference, largest.points), (2.0, 1));
        largest.add("blade_phase_deg", f64::NAN, 1.0, &String::new);
        assert_eq!(largest.points, 1);
        // This also holds between two points of a curve.
        let half = MatchedRow { first: 0, other: (0, 1, 0.5) };
        assert_eq!(half.value("blade_phase_deg", &[179.0, -179.0]), 180.0);
        assert_eq!(half.value("blade_amplitude_m", &[179.0, -179.0]), 0.0);
    }
}
