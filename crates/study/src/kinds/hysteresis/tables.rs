//! The tables of hysteresis loops: names, columns, and their content as typed values.

use crate::case::study::{Study, VariedValue};
use crate::case::values::hertz;
use crate::results::columns::FREQUENCY;
use crate::results::dataset::{Dataset, Table};
use crate::results::{Results, ResultsError};
use std::ops::Range;

/// Name of the kind.
pub(super) const NAME: &str = "hysteresis";
/// One row per instant.
pub(super) const LOOPS: &str = "loops";
/// One row per loop.
pub(super) const SUMMARY: &str = "loops_summary";
/// The joint or moved place of the loop.
pub(super) const JOINT: &str = "joint";
/// Instant, s.
pub(super) const TIME: &str = "time_s";
/// Displacement, m.
pub(super) const DISPLACEMENT: &str = "displacement_m";
/// Force, N.
pub(super) const FORCE: &str = "force_N";
/// Loss per period, J.
pub(super) const DISSIPATION: &str = "dissipation_J";
/// Equivalent stiffness, N/m.
pub(super) const STIFFNESS: &str = "equivalent_stiffness_N_per_m";
/// Equivalent damping, kg/s.
pub(super) const DAMPING: &str = "equivalent_damping_kg_per_s";

/// A loop of force over displacement, over one period.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// The varied parameters of its case.
    pub varied: Vec<VariedValue>,
    /// Excitation frequency, Hz.
    pub frequency: f64,
    /// The joint or moved place of the loop; for a sum all its joints, `a + b`.
    pub joint: String,
    /// Instants, s, including both ends of the period.
    pub time: Vec<f64>,
    /// Displacement, m.
    pub displacement: Vec<f64>,
    /// Force, N.
    pub force: Vec<f64>,
    /// Loss per period, J.
    pub dissipation: f64,
    /// Stiffness of the first harmonic, N/m.
    pub equivalent_stiffness: f64,
    /// Damping of the first harmonic, kg/s.
    pub equivalent_damping: f64,
}

/// Divides rows of the loop table into single loops.
///
/// A loop begins at a new joint, a new frequency, or where time restarts. A missing column of a
/// table from another source is ignored.
pub(super) fn split_loops(table: &Table, rows: Range<usize>) -> Vec<Range<usize>> {
    let (joints, frequencies, times) = (table.texts(JOINT), table.numbers(FREQUENCY), table.numbers(TIME));
    let continues = |a: usize, b: usize| {
        joints.is_none_or(|joints| joints[a] == joints[b])
            && frequencies.is_none_or(|frequencies| frequencies[a] == frequencies[b])
            && times.is_none_or(|times| times[b] >= times[a])
    };
    let mut loops = Vec::new();
    let mut from = rows.start;
    while from < rows.end {
        let to = (from + 1..rows.end).find(|row| !continues(row - 1, *row)).unwrap_or(rows.end);
        loops.push(from..to);
        from = to;
    }
    loops
}

/// Returns the loops of a hysteresis study in table order: by case, frequency and joint.
///
/// Points without an orbit have no loop.
///
/// # Errors
/// Returns a [`ResultsError`] if the dataset is of another kind or is not the result of
/// [`run`](crate::run::run()) for this study.
///
/// # Example
/// ```
/// use stickslip_study::{kinds::hysteresis, read_study, run::{Context, run}};
/// let text = stickslip_study::templates::find("element").unwrap().study;
/// let study = read_study("element.toml", text, &[]).unwrap();
/// let dataset = run(&study, &Context::without_progress(1)).unwrap();
/// let loops = hysteresis::loops(&study, &dataset).unwrap();
/// assert!((loops[1].dissipation - 4e-6).abs() < 1e-15);   // 4 Ft (a - Ft/kt), a = 2 mm
/// ```
pub fn loops(study: &Study, dataset: &Dataset) -> Result<Vec<Loop>, ResultsError> {
    let results = Results::new(NAME, study, dataset)?;
    let (Some(points), Some(summary)) = (results.table(LOOPS)?, results.table(SUMMARY)?) else {
        return Ok(Vec::new());
    };
    let (joint, time) = (points.texts(JOINT)?, points.numbers(TIME)?);
    let (displacement, force) = (points.numbers(DISPLACEMENT)?, points.numbers(FORCE)?);
    let (named, dissipation) = (summary.texts(JOINT)?, summary.numbers(DISSIPATION)?);
    let (stiffness, damping) = (summary.numbers(STIFFNESS)?, summary.numbers(DAMPING)?);
    let mut loops = Vec::new();
    for case_rows in results.case_rows(&points, study.varied().len())? {
        // a study of one frequency has no frequency column
        let only = || study.case(case_rows.case).ok()?.frequencies?.get(0).map(hertz);
        for rows in split_loops(points.table, case_rows.rows) {
            let row = loops.len();
            if named.get(row) != Some(&joint[rows.start]) {
                return Err(summary.foreign_rows());
            }
            let listed = points.table.numbers(FREQUENCY).map(|frequency| frequency[rows.start]);
            loops.push(Loop {
                varied: case_rows.varied.clone(),
                frequency: listed.or_else(only).ok_or_else(|| points.foreign_rows())?,
                joint: named[row].clone(),
                time: time[rows.clone()].to_vec(),
                displacement: displacement[rows.clone()].to_vec(),
                force: force[rows].to_vec(),
                dissipation: dissipation[row],
                equivalent_stiffness: stiffness[row],
                equivalent_damping: damping[row],
            });
        }
    }
    if loops.len() == named.len() { Ok(loops) } else { Err(summary.foreign_rows()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::dataset::{CellValues, Column};

    /// A loop ends where joint, frequency or period end, even if the next loop has equal
    /// values.
    #[test]
    fn rows_are_cut_into_single_loops() {
        let column = |name: &str, values| Column { name: name.to_owned(), values };
        let mut table = Table {
            name: LOOPS.to_owned(),
            columns: vec![
                column(FREQUENCY, CellValues::Number(vec![1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0])),
                column(JOINT, CellValues::Text(["a", "a", "b", "b", "b", "b", "b"].map(str::to_owned).to_vec())),
                column(TIME, CellValues::Number(vec![0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 0.0])),
            ],
        };
        assert_eq!(split_loops(&table, 0..7), [0..2, 2..4, 4..6, 6..7]);
        assert_eq!(split_loops(&table, 1..3), [1..2, 2..3]);
        assert_eq!(split_loops(&table, 3..3), []);
        table.columns.truncate(1);
        assert_eq!(split_loops(&table, 0..7), [0..4, 4..7]);
    }
}
