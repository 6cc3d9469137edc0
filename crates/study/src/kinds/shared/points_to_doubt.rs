//! Points of a table that a reader should doubt, for the triangles of figures.

use super::peak_search::SOME_FAILED;
use crate::results::dataset::Table;
use std::collections::BTreeSet;
use stickslip::orbit::Accuracy;

/// Points that are unstable, less exact than requested, or peaks near which orbits are missing.
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
        let (stable, status) = (curve.flags("stable"), curve.texts("status"));
        let with_status = |sought: &str| -> BTreeSet<usize> {
            let status = status.iter().flat_map(|status| status.iter().enumerate());
            status.filter(|(_, status)| *status == sought).map(|(row, _)| row).collect()
        };
        let unstable = stable.iter().flat_map(|stable| stable.iter().enumerate());
        let unstable = unstable.filter(|(_, stable)| **stable == Some(false)).map(|(row, _)| row).collect();
        let groups = [
            (unstable, "unstable"),
            (with_status(Accuracy::Truncated.status()), "less exact than requested"),
            (with_status(SOME_FAILED), "with missing orbits"),
        ];
        let counts = groups.iter().filter(|(rows, _)| !rows.is_empty());
        let counts: Vec<String> = counts.map(|(rows, text)| format!("{} {text}", rows.len())).collect();
        let label = format!("points: {}", counts.join(", "));
        PointsToDoubt { rows: groups.into_iter().flat_map(|(rows, _)| rows).collect(), label }
    }
}
