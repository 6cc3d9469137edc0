//! Peak tables for the terminal: the largest peak of every case first, equal sectors merged.

use stickslip_study::dataset::{CellValues, Column, Table};
use stickslip_study::results::place_and_sector;

/// A peak of a case.
struct PeakRow {
    row: usize,
    /// Place without the number of its sector.
    place: String,
    sectors: usize,
    frequency: f64,
    amplitude: f64,
}

/// Sorts the rows of a table of peaks by amplitude within each case, and merges equal sectors.
///
/// Returns `None` if the table is not a table of peaks.
pub(crate) fn worst_first(table: &Table) -> Option<Table> {
    let at = table.columns.iter().position(|column| column.name == "mass")?;
    let (names, frequency, amplitude) = (
        table.texts("mass")?,
        table.numbers("frequency_Hz")?,
        table.numbers("amplitude_m").or_else(|| table.numbers("amplitude_rad"))?,
    );
    let varied: Vec<&[f64]> = table.columns[..at].iter().filter_map(Column::as_numbers).collect();
    let same_case = |a: usize, b: usize| varied.iter().all(|column| column[a].to_bits() == column[b].to_bits());
    let mut shown: Vec<PeakRow> = Vec::new();
    let rows: Vec<usize> = (0..table.rows()).collect();
    for case in rows.chunk_by(|a, b| same_case(*a, *b)) {
        let mut order = case.to_vec();
        order.sort_by(|a, b| amplitude[*b].total_cmp(&amplitude[*a]));
        let first = shown.len();
        for row in order {
            let (frequency, amplitude) = (frequency[row], amplitude[row]);
            // Relative difference up to which the peaks of two sectors are equal: the accuracy
            // of peak refinement.
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-4 * a.abs();
            let place = place_and_sector(&names[row]).map(|(place, _)| place);
            let alike = |peak: &&mut PeakRow| {
                place.as_ref() == Some(&peak.place)
                    && near(peak.frequency, frequency)
                    && near(peak.amplitude, amplitude)
            };
            match shown[first..].iter_mut().find(alike) {
                Some(peak) => peak.sectors += 1,
                None => {
                    let place = place.unwrap_or_else(|| names[row].clone());
                    shown.push(PeakRow { row, place, sectors: 1, frequency, amplitude });
                }
            }
        }
    }
    let word = |peak: &PeakRow| match peak.sectors {
        1 => names[peak.row].clone(),
        sectors => format!("{}, {sectors} sectors", peak.place),
    };
    let picked = |column: &Column| Column {
        name: column.name.clone(),
        values: match &column.values {
            CellValues::Text(_) if column.name == "mass" => CellValues::Text(shown.iter().map(word).collect()),
            CellValues::Number(v) => CellValues::Number(shown.iter().map(|peak| v[peak.row]).collect()),
            CellValues::Integer(v) => CellValues::Integer(shown.iter().map(|peak| v[peak.row]).collect()),
            CellValues::Text(v) => CellValues::Text(shown.iter().map(|peak| v[peak.row].clone()).collect()),
            CellValues::Flag(v) => CellValues::Flag(shown.iter().map(|peak| v[peak.row]).collect()),
        },
    };
    Some(Table { name: table.name.clone(), columns: table.columns.iter().map(picked).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[(f64, &str, f64, f64)]) -> Table {
        let numbers = |of: fn(&(f64, &str, f64, f64)) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
        let columns = vec![
            Column::numbers("Ft_N", numbers(|row| row.0)),
            Column::texts("mass", rows.iter().map(|row| row.1.to_owned()).collect()),
            Column::numbers("frequency_Hz", numbers(|row| row.2)),
            Column::numbers("amplitude_m", numbers(|row| row.3)),
        ];
        Table { name: "peaks".to_owned(), columns }
    }

    #[test]
    fn the_worst_place_comes_first_and_equal_sectors_are_one() {
        let given = [
            (1.0, "blade_0", 50.0, 1e-3),
            (1.0, "disk_0", 50.0, 2e-4),
            (1.0, "blade_1", 50.000_001, 1.000_001e-3),
            (1.0, "disk_1", 50.0, 2e-4),
            (2.0, "a", 40.0, 1e-3),
            (2.0, "b", 41.0, 3e-3),
        ];
        let shown = worst_first(&table(&given)).unwrap();
        assert_eq!(shown.texts("mass").unwrap(), ["blade, 2 sectors", "disk, 2 sectors", "b", "a"]);
        assert_eq!(shown.numbers("Ft_N").unwrap(), [1.0, 1.0, 2.0, 2.0]);
        // Sectors with different peaks have separate rows.
        let differ = [(1.0, "blade_0", 50.0, 1e-3), (1.0, "blade_1", 50.0, 1.2e-3)];
        assert_eq!(worst_first(&table(&differ)).unwrap().texts("mass").unwrap(), ["blade_1", "blade_0"]);
    }
}
