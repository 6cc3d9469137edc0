//! Decimation of long tables for their figure, in bounded memory.
//!
//! Tables of up to [`MAX_ROWS`] rows are kept whole. A longer table first loses cases. A study
//! with draws keeps the first cases, which are a sample themselves; other studies keep every
//! n-th case. Figures state how many cases they show.
//!
//! If too many rows remain, every block of neighbouring rows keeps only the rows with the
//! smallest and the largest value of each column. The curve through them has the same envelope
//! as the full curve, and all its points were computed.

use crate::case::study::Study;
use crate::results::dataset::{CellValues, Column, FIELDS, Table};
use crate::results::drawing::MAX_CURVES;

/// Largest number of rows of a table that are held in memory for its figure.
pub const MAX_ROWS: usize = 500_000;

/// Takes tables block by block and keeps the rows that their figure needs.
///
/// # Example
/// ```
/// use stickslip_study::{
///     decimation::Decimation,
///     read_study,
///     run::{Context, check},
/// };
/// let text = stickslip_study::templates::find("blade-couple").unwrap().study;
/// let study = read_study("couple.toml", text, &[]).unwrap();
/// let block = check(&study).unwrap().block(0..4, &Context::without_progress(1)).unwrap();
/// let rows: Vec<_> =
///     block.tables.iter().map(|table| (table.name.as_str(), table.rows())).collect();
/// let mut decimation = Decimation::new(&study, &rows);
/// block.tables.iter().cloned().for_each(|table| decimation.add(table));
/// assert!(decimation.keeps_all());
/// assert_eq!(format!("{:?}", decimation.tables()), format!("{:?}", block.tables));
/// ```
#[derive(Debug)]
pub struct Decimation {
    tables: Vec<DecimatedTable>,
}

impl Decimation {
    /// For tables of a study with these names and numbers of rows.
    pub fn new(study: &Study, tables: &[(&str, usize)]) -> Decimation {
        Decimation {
            tables: tables.iter().map(|(name, rows)| DecimatedTable::new(study, name, *rows, MAX_ROWS)).collect(),
        }
    }

    /// Returns whether every row is kept.
    pub fn keeps_all(&self) -> bool {
        self.tables.iter().all(|table| table.cases == CaseSelection::All && table.bin.is_none())
    }

    /// Adds the next rows of a table.
    pub fn add(&mut self, table: Table) {
        if let Some(known) = self.tables.iter_mut().find(|known| known.rows.name == table.name) {
            known.add(table);
        }
    }

    /// Returns the kept rows.
    pub fn tables(self) -> Vec<Table> {
        self.tables.into_iter().map(DecimatedTable::finished).collect()
    }
}

/// The cases of a table that are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CaseSelection {
    All,
    /// The first cases, up to this number.
    First(usize),
    /// Every n-th case.
    EveryNth(usize),
}

/// The kept rows of a table.
#[derive(Debug)]
struct DecimatedTable {
    rows: Table,
    cases: CaseSelection,
    /// Number of neighbouring rows in a bin, of which only the extremes stay.
    bin: Option<usize>,
    /// Number of leading columns that identify a case.
    key_columns: usize,
    /// Key and number of the current case.
    current_case: Option<(Vec<u64>, usize)>,
    open_bin: Table,
}

impl DecimatedTable {
    fn new(study: &Study, name: &str, rows: usize, most: usize) -> DecimatedTable {
        let empty = Table { name: name.to_owned(), columns: Vec::new() };
        let keys = study.varied().len();
        let (mut cases, mut bin) = (CaseSelection::All, None);
        // the figure does not show this table, but the files of the mesh need all its rows
        if rows > most && name != FIELDS {
            let rows_per_case = rows.div_ceil(study.cases());
            let kept = if study.draws().is_some() {
                let first = (most / rows_per_case).clamp(1, study.cases());
                cases = CaseSelection::First(first);
                first
            } else {
                let each = study.cases().div_ceil(MAX_CURVES);
                cases = CaseSelection::EveryNth(each);
                study.cases().div_ceil(each)
            };
            // a bin keeps at most two rows for every column: a few dozen
            // Approximate number of rows that a bin keeps: a table has about a dozen columns
            // with extremes at different rows.
            bin = (kept * rows_per_case > most).then(|| (rows_per_case * kept).div_ceil(most).max(1) * 24);
        }
        DecimatedTable { rows: empty.clone(), cases, bin, key_columns: keys, current_case: None, open_bin: empty }
    }

    fn add(&mut self, table: Table) {
        if self.cases == CaseSelection::All && self.bin.is_none() {
            return self.rows.append(table);
        }
        let mut from = 0;
        while from < table.rows() {
            let key = key(&table, from, self.key_columns);
            if self.current_case.as_ref().is_none_or(|(now, _)| *now != key) {
                self.close_bin();
                let number = self.current_case.as_ref().map_or(0, |(_, number)| number + 1);
                self.current_case = Some((key, number));
            }
            let (now, number) = match &self.current_case {
                Some((now, number)) => (now, *number),
                None => return,
            };
            let free_rows = self.bin.map_or(usize::MAX, |bin| bin - self.open_bin.rows());
            let more = table.rows().min(from.saturating_add(free_rows));
            let to = (from + 1..more).find(|row| key_differs(&table, *row, now)).unwrap_or(more);
            let keeps = match self.cases {
                CaseSelection::All => true,
                CaseSelection::First(first) => number < first,
                CaseSelection::EveryNth(each) => number % each == 0,
            };
            if keeps {
                self.open_bin.append(rows(&table, &(from..to).collect::<Vec<_>>()));
                if self.bin.is_none_or(|bin| self.open_bin.rows() >= bin) {
                    self.close_bin();
                }
            }
            from = to;
        }
    }

    /// Closes the open bin: keeps all its rows, or its extremes.
    fn close_bin(&mut self) {
        let open = Table { name: self.open_bin.name.clone(), columns: std::mem::take(&mut self.open_bin.columns) };
        if open.rows() == 0 {
            return;
        }
        if self.bin.is_none() {
            return self.rows.append(open);
        }
        let mut kept = vec![0, open.rows() - 1];
        for column in &open.columns {
            if let CellValues::Number(values) = &column.values {
                let compare = |a: &&usize, b: &&usize| values[**a].total_cmp(&values[**b]);
                // a gap in a curve stays a gap
                let (there, gaps): (Vec<usize>, Vec<usize>) = (0..values.len()).partition(|row| !values[*row].is_nan());
                kept.extend(
                    there.iter().min_by(compare).into_iter().chain(there.iter().max_by(compare)).chain(gaps.first()),
                );
            }
        }
        kept.sort_unstable();
        kept.dedup();
        self.rows.append(rows(&open, &kept));
    }

    fn finished(mut self) -> Table {
        self.close_bin();
        self.rows
    }
}

fn key(table: &Table, row: usize, keys: usize) -> Vec<u64> {
    let columns = table.columns.iter().take(keys);
    columns.map(|column| if let CellValues::Number(v) = &column.values { v[row].to_bits() } else { 0 }).collect()
}

fn key_differs(table: &Table, row: usize, key: &[u64]) -> bool {
    table.columns.iter().zip(key).any(|(column, bits)| match &column.values {
        CellValues::Number(values) => values[row].to_bits() != *bits,
        _ => false,
    })
}

/// Returns the selected rows of a table.
fn rows(table: &Table, which: &[usize]) -> Table {
    let column = |column: &Column| Column {
        name: column.name.clone(),
        values: match &column.values {
            CellValues::Number(v) => CellValues::Number(which.iter().map(|row| v[*row]).collect()),
            CellValues::Integer(v) => CellValues::Integer(which.iter().map(|row| v[*row]).collect()),
            CellValues::Text(v) => CellValues::Text(which.iter().map(|row| v[*row].clone()).collect()),
            CellValues::Flag(v) => CellValues::Flag(which.iter().map(|row| v[*row]).collect()),
        },
    };
    Table { name: table.name.clone(), columns: table.columns.iter().map(column).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_study;

    fn study(extra: &str) -> Study {
        let text = crate::compile::templates::find("blade-couple").unwrap().study;
        let text = text.replace("vary = { Ft = [\"2 N\", \"4 N\", \"6 N\", \"8 N\"] }", extra);
        read_study("couple.toml", &text, &[]).unwrap()
    }

    fn table(cases: usize, rows: usize) -> Table {
        let all = 0..cases * rows;
        let numbers = |value: &dyn Fn(usize) -> f64| CellValues::Number(all.clone().map(value).collect());
        let column = |name: &str, values| Column { name: name.to_owned(), values };
        Table {
            name: "curve".to_owned(),
            columns: vec![
                column("Ft_N", numbers(&|i| (i / rows) as f64)),
                column("x", numbers(&|i| (i % rows) as f64)),
                column("y", numbers(&|i| (i as f64 * 0.1).sin() + if i % rows == rows / 3 { 50.0 } else { 0.0 })),
                column("z", numbers(&|i| if i % 100_000 == 777 { f64::NAN } else { -(i as f64 * 0.01).cos() })),
                column("status", CellValues::Text(all.clone().map(|_| "converged".to_owned()).collect())),
            ],
        }
    }

    fn decimate(mut kept: DecimatedTable, table: &Table, step: usize) -> Table {
        let all: Vec<usize> = (0..table.rows()).collect();
        all.chunks(step).for_each(|chunk| kept.add(rows(table, chunk)));
        kept.finished()
    }

    /// Every block keeps the smallest and the largest value of every column at their places, in
    /// bounded memory.
    #[test]
    fn a_long_curve_keeps_its_envelope() {
        let (study, most) = (study("vary = { Ft = [\"2 N\"] }"), 5000);
        let table = table(1, 400_000);
        let kept = decimate(DecimatedTable::new(&study, "curve", table.rows(), most), &table, 1009);
        assert!(kept.rows() < most && kept.rows() > most / 10, "{}", kept.rows());
        let (x, y) = (kept.numbers("x").unwrap(), kept.numbers("y").unwrap());
        assert!(x.is_sorted_by(|a, b| a < b));
        let all = table.numbers("y").unwrap();
        // ten parts of the figure: each has the same height as with all points
        for part in 0..10 {
            let within = |x: f64| (part * 40_000..(part + 1) * 40_000).contains(&(x as usize));
            let highest = |points: &mut dyn Iterator<Item = (f64, f64)>| {
                points.filter(|(x, _)| within(*x)).map(|(_, y)| y).fold(f64::NEG_INFINITY, f64::max)
            };
            let found = highest(&mut x.iter().copied().zip(y.iter().copied()));
            assert_eq!(found, highest(&mut (0..400_000).map(|i| (i as f64, all[i]))), "{part}");
        }
        assert!(y.contains(&all[400_000 / 3]));
        let gaps = kept.numbers("z").unwrap().iter().filter(|value| value.is_nan()).count();
        assert_eq!(gaps, 4);
        // the result does not depend on the size of the blocks
        let other = decimate(DecimatedTable::new(&study, "curve", table.rows(), most), &table, 70_001);
        assert!(format!("{other:?}") == format!("{kept:?}"));
    }

    #[test]
    fn kept_cases_are_complete() {
        let listed = study("vary = { Ft = { from = \"1 N\", to = \"9 N\", points = 1000 } }");
        let table = table(1000, 20);
        let kept = decimate(DecimatedTable::new(&listed, "curve", table.rows(), 10_000), &table, 33);
        let cases = kept.numbers("Ft_N").unwrap();
        assert!(cases.iter().all(|case| (*case as usize).is_multiple_of(3)), "every third");
        assert_eq!(kept.rows(), 334 * 20);
        // of draws, the first ones
        let drawn = study("[sample]\ncount = 1000\nof = { Ft = { uniform = [\"1 N\", \"9 N\"] } }");
        let kept = decimate(DecimatedTable::new(&drawn, "curve", table.rows(), 10_000), &table, 33);
        // compared as text, because of the NaN values
        assert!(format!("{kept:?}") == format!("{:?}", rows(&table, &(0..10_000).collect::<Vec<_>>())));
    }
}
