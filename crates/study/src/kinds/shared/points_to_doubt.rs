//! Points of a table that a reader should doubt, for the triangles of figures.

use crate::results::dataset::Table;
use std::collections::BTreeSet;
use stickslip::orbit::Accuracy;

/// Points that are unstable or less exact than requested.
#[derive(Debug, Clone)]
pub(in crate::kinds) struct PointsToDoubt {
    /// Rows of the curve table.
    pub rows: BTreeSet<usize>,
    /// Legend entry.
    pub label: String,
}

impl PointsToDoubt {
    /// Reads the columns `stable` and `status` of a curve table.
    pub fn of(curve: &Table) -> PointsToDoubt {
        let truncated = Accuracy::Truncated.status();
        let unstable: BTreeSet<usize> = match curve.flags("stable") {
            Some(stable) => (0..curve.rows()).filter(|row| stable[*row] == Some(false)).collect(),
            None => BTreeSet::new(),
        };
        let inexact: BTreeSet<usize> = match curve.texts("status") {
            Some(status) => (0..curve.rows()).filter(|row| status[*row] == truncated).collect(),
            None => BTreeSet::new(),
        };
        let counts = [(unstable.len(), "unstable"), (inexact.len(), "less exact than requested")];
        let counts = counts.iter().filter(|(count, _)| *count > 0).map(|(count, text)| format!("{count} {text}"));
        let label = format!("points: {}", counts.collect::<Vec<_>>().join(", "));
        PointsToDoubt { rows: unstable.union(&inexact).copied().collect(), label }
    }
}
