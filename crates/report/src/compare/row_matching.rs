//! Finds the matching rows of two runs.

use stickslip_study::dataset::Table;

/// A table of the first run and the same table of another run.
#[derive(Clone, Copy)]
pub(super) struct TablePair<'a> {
    pub(super) first: &'a Table,
    pub(super) other: &'a Table,
}

/// A row of the first run, and two rows of the other run with the weight of the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MatchedRow {
    pub(super) first: usize,
    pub(super) other: (usize, usize, f64),
}

impl MatchedRow {
    pub(super) fn rows(first: usize, other: usize) -> MatchedRow {
        MatchedRow { first, other: (other, other, 0.0) }
    }

    pub(super) fn value(&self, column: &str, values: &[f64]) -> f64 {
        let (a, b, share) = self.other;
        if share == 0.0 { values[a] } else { values[a] + share * difference(column, values[a], values[b]) }
    }
}

/// Splits the rows of a curve into pieces with monotonic abscissa.
fn pieces(x: &[f64], rows: &[usize]) -> Vec<Vec<usize>> {
    let mut pieces: Vec<Vec<usize>> = Vec::new();
    for &row in rows.iter().filter(|row| x[**row].is_finite()) {
        let goes_on = match pieces.last().map(Vec::as_slice) {
            Some([.., a, b]) => (x[*b] - x[*a]) * (x[row] - x[*b]) > 0.0,
            Some([b]) => x[row] != x[*b],
            _ => false,
        };
        match pieces.last_mut().filter(|_| goes_on) {
            Some(piece) => piece.push(row),
            None => pieces.push(vec![row]),
        }
    }
    pieces
}

/// Interpolates the other run at the abscissae of the first within their common range.
fn interpolated(x: (&[f64], &[f64]), first: &[usize], other: &[usize]) -> Vec<MatchedRow> {
    let mut sorted = other.to_vec();
    sorted.sort_by(|a, b| x.1[*a].total_cmp(&x.1[*b]));
    let pair = |row: &usize| {
        let at = x.0[*row];
        let next = sorted.partition_point(|row| x.1[*row] < at);
        let right = *sorted.get(next)?;
        if x.1[right] == at {
            return Some(MatchedRow::rows(*row, right));
        }
        let left = sorted[next.checked_sub(1)?];
        Some(MatchedRow { first: *row, other: (left, right, (at - x.1[left]) / (x.1[right] - x.1[left])) })
    };
    first.iter().filter_map(pair).collect()
}

/// Returns the matching rows of two groups, and `true` if values are interpolated.
///
/// Returns `None` if the curves have different numbers of monotonic pieces.
pub(super) fn pairs(
    tables: TablePair<'_>,
    abscissa: Option<&str>,
    first: &[usize],
    other: &[usize],
) -> Option<(Vec<MatchedRow>, bool)> {
    let both = |name: &str| Some((tables.first.numbers(name)?, tables.other.numbers(name)?));
    let one_by_one = || first.iter().zip(other).map(|(a, b)| MatchedRow::rows(*a, *b)).collect::<Vec<_>>();
    let Some(x) = abscissa.and_then(both) else {
        if first.len() == other.len() {
            return Some((one_by_one(), false));
        }
        // Match each peak with the nearest unmatched peak.
        let x = both("frequency_Hz")?;
        let mut left = other.to_vec();
        let mut found = Vec::new();
        for row in first {
            let distance = |other: usize| (x.0[*row] - x.1[other]).abs();
            let nearest = (0..left.len()).min_by(|a, b| distance(left[*a]).total_cmp(&distance(left[*b])));
            found.extend(nearest.map(|at| MatchedRow::rows(*row, left.remove(at))));
        }
        return Some((found, false));
    };
    let same =
        first.len() == other.len() && first.iter().zip(other).all(|(a, b)| x.0[*a].to_bits() == x.1[*b].to_bits());
    if same {
        return Some((one_by_one(), false));
    }
    let (a, b) = (pieces(x.0, first), pieces(x.1, other));
    (a.len() == b.len()).then(|| (a.iter().zip(&b).flat_map(|(a, b)| interpolated(x, a, b)).collect(), true))
}

/// Returns `b - a`. Differences of angles (columns in degrees) are between -180 and 180.
pub(super) fn difference(column: &str, a: f64, b: f64) -> f64 {
    let difference = b - a;
    if column.ends_with("_deg") { difference - 360.0 * (difference / 360.0).round() } else { difference }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_study::dataset::Column;

    #[test]
    fn curves_are_cut_where_they_turn() {
        let x = [1.0, 2.0, 3.0, 2.5, 2.0, f64::NAN, 2.5, 2.5];
        let rows: Vec<usize> = (0..x.len()).collect();
        assert_eq!(pieces(&x, &rows), [vec![0, 1, 2], vec![3, 4], vec![6], vec![7]]);
        assert_eq!(pieces(&x, &[]), Vec::<Vec<usize>>::new());
    }

    #[test]
    fn a_straight_line_is_interpolated_exactly_and_never_beyond_its_ends() {
        let (a, b) = ([0.0, 0.25, 1.5, 3.0], [2.0, 1.0, 0.0]);
        let y: Vec<f64> = b.iter().map(|x| 4.0 * x - 1.0).collect();
        let pairs = interpolated((&a, &b), &[0, 1, 2, 3], &[0, 1, 2]);
        let values: Vec<(usize, f64)> = pairs.iter().map(|pair| (pair.first, pair.value("y_m", &y))).collect();
        assert_eq!(values, [(0, -1.0), (1, 0.0), (2, 5.0)]);
    }

    #[test]
    fn peaks_of_different_number_go_to_the_nearest() {
        let table = |frequencies: &[f64]| Table {
            name: "peaks".into(),
            columns: vec![
                Column::numbers("frequency_Hz", frequencies.to_vec()),
                Column::numbers("amplitude_m", vec![1.0; frequencies.len()]),
            ],
        };
        let (a, b) = (table(&[1.0, 5.0]), table(&[4.9]));
        let (found, interpolated) = pairs(TablePair { first: &b, other: &a }, None, &[0], &[0, 1]).unwrap();
        assert_eq!((found, interpolated), (vec![MatchedRow::rows(0, 1)], false));
    }
}
