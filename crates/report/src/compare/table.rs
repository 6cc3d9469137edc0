//! A comparison for the terminal: differences with units and in percent, without equal columns.

use super::differences::{DIFFERENCES, FIRST};
use crate::terminal;
use std::collections::BTreeSet;
use stickslip_study::dataset::{CellValues, Column, Dataset, Table};

/// Returns the comparison with units and percentages. Quantities that are equal in all runs are
/// omitted.
#[must_use]
pub fn for_terminal(comparison: &Dataset) -> Dataset {
    let mut formatted = comparison.clone();
    for table in &mut formatted.tables {
        let several = table.column("run").is_some_and(|column| match &column.values {
            CellValues::Text(runs) => runs.iter().any(|run| *run != runs[0]),
            _ => false,
        });
        table.columns.retain(|column| several || column.name != "run");
        // A narrow terminal drops the last columns.
        table.columns.sort_by_key(|column| column.name.starts_with(FIRST));
        for column in &mut table.columns {
            if let (CellValues::Number(values), true) = (&column.values, column.name.ends_with("_change")) {
                column.values = CellValues::Text(values.iter().map(|value| percent(*value, true)).collect());
            }
        }
        if table.name == DIFFERENCES {
            let same = shown_differences(table);
            // Maximum number of names: an orbit of a disk has a hundred equal columns.
            let most = 8;
            let more = same.len().saturating_sub(most);
            let more = if more > 0 { format!(", and {more} more") } else { String::new() };
            if !same.is_empty() {
                let named = &same[..same.len().min(most)];
                formatted.notes.push(format!("Equal in all runs: {}{more}.", named.join(", ")));
            }
        }
    }
    formatted
}

/// Formats the differences. Returns the names of columns without any difference in all runs.
fn shown_differences(table: &mut Table) -> Vec<String> {
    let words = |name: &str| match table.column(name).map(|column| &column.values) {
        Some(CellValues::Text(words)) => words.clone(),
        _ => vec![String::new(); table.rows()],
    };
    let numbers = |name: &str| table.numbers(name).map_or_else(|| vec![f64::NAN; table.rows()], <[f64]>::to_vec);
    let (tables, columns, places, ways) = (words("table"), words("column"), words("at"), words("how"));
    let (differences, relative) = (numbers("largest_difference"), numbers("relative"));
    let runs = table.column("run").map(|_| words("run"));
    let (differ, same): (Vec<usize>, Vec<usize>) = (0..table.rows()).partition(|row| differences[*row] != 0.0);
    let of = |all: &[String]| differ.iter().map(|row| all[*row].clone()).collect::<Vec<_>>();
    let mut made = vec![Column::texts("table", of(&tables)), Column::texts("column", of(&columns))];
    made.extend(runs.map(|runs| Column::texts("run", of(&runs))));
    let column_of = |row: usize| Column::numbers(&columns[row], Vec::new());
    let shown = differ.iter().map(|row| terminal::quantity(&column_of(*row), differences[*row]));
    made.push(Column::texts("largest_difference", shown.collect()));
    made.push(Column::texts("relative", differ.iter().map(|row| percent(relative[*row], false)).collect()));
    made.push(Column::texts("at", without_common_parts(of(&places).iter().map(|place| rounded(place)).collect())));
    made.push(Column::texts("how", of(&ways)));
    table.columns = made;
    let name = |row: &usize| format!("{} of {}", columns[*row], tables[*row]);
    let different: BTreeSet<String> = differ.iter().map(name).collect();
    let mut listed = BTreeSet::new();
    same.iter().map(name).filter(|name| !different.contains(name) && listed.insert(name.clone())).collect()
}

/// Removes the values that are the same in all places, such as `frequency_Hz = 121` of the only
/// orbit, because a narrow column shows only one value. The table file has all of them.
fn without_common_parts(places: Vec<String>) -> Vec<String> {
    let parts: Vec<Vec<&str>> = places.iter().map(|place| place.split(", ").collect()).collect();
    let is_common = |part: &str| parts.len() > 1 && parts.iter().all(|place| place.contains(&part));
    let shortened = parts.iter().zip(&places).map(|(parts, place)| {
        let own: Vec<&str> = parts.iter().copied().filter(|part| !is_common(part)).collect();
        if own.is_empty() { place.clone() } else { own.join(", ") }
    });
    shortened.collect()
}

/// Rounds the numbers in a text.
fn rounded(text: &str) -> String {
    let word = |word: &str| match word.trim_end_matches(',').parse::<f64>() {
        Ok(value) => {
            // Seven digits of abscissa and parameter values; the table file has all digits.
            let short: f64 = format!("{value:.*e}", 6).parse().unwrap_or(value);
            let comma = if word.ends_with(',') { "," } else { "" };
            format!("{short}{comma}")
        }
        Err(_) => word.to_owned(),
    };
    text.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// Formats a ratio in percent with three digits.
fn percent(share: f64, signed: bool) -> String {
    let percent = 100.0 * share;
    let decimals = match percent.abs() {
        size if size == 0.0 || size >= 100.0 => 0,
        // A very small percentage is a rounding error; its digits are not shown.
        size => (2 - size.log10().floor() as i32).clamp(0, 9) as usize,
    };
    match signed && percent > 0.0 {
        _ if !percent.is_finite() => "–".to_owned(),
        true => format!("+{percent:.decimals$} %"),
        false => format!("{percent:.decimals$} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_read_as_percent() {
        assert_eq!(percent(0.0012345, true), "+0.123 %");
        assert_eq!(percent(-0.25, true), "-25.0 %");
        assert_eq!(percent(0.0, true), "0 %");
        assert_eq!(percent(3.4e-6, false), "0.000340 %");
        assert_eq!([percent(12.5, false), percent(f64::NAN, false)], ["1250 %".to_owned(), "–".to_owned()]);
        let quantity = |name: &str, value: f64| terminal::quantity(&Column::numbers(name, Vec::new()), value);
        assert_eq!(quantity("blade1_amplitude_m", 4.987_65e-5), "49.9 µm");
        assert_eq!(quantity("blade1_receptance_m_per_N", 4.7e-4), "470 µm/N");
        assert_eq!(quantity("slip_fraction", 0.038_24), "0.0382");
        let places = ["f_Hz = 121, t_s = 0.1", "f_Hz = 121, t_s = 0.2"].map(str::to_owned);
        assert_eq!(without_common_parts(places.to_vec()), ["t_s = 0.1", "t_s = 0.2"]);
        assert_eq!(without_common_parts(places[..1].to_vec()), places[..1]);
        assert_eq!(rounded("Ft_N = 6.0, time_s = 0.030387205387205383"), "Ft_N = 6, time_s = 0.03038721");
    }
}
