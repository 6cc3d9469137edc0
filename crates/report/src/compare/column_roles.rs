//! Roles of the columns of a table: keys that identify rows, and the abscissa of its curves.

use crate::run::stored::Stored;
use std::collections::BTreeMap;
use stickslip_study::dataset::{CellValues, Column, Table};
use stickslip_study::{Case, VariedValue};

/// Columns with error measures instead of results.
const EVIDENCE: [&str; 3] = ["residual", "energy_gap", "truncation"];
/// Columns with texts and counts that identify rows.
const KEYS: [&str; 5] = ["mass", "joint", "loop", "index", "stretch"];
/// Tables whose rows are identified by the excitation frequency.
const BY_FREQUENCY: [&str; 5] = ["orbit", "orbits", "multipliers", "loops", "loops_summary"];
/// Roles of the columns of a table.
pub(super) struct ColumnRoles {
    /// Columns that identify rows.
    pub(super) keys: Vec<String>,
    /// Abscissa of the curves in the other columns.
    pub(super) abscissa: Option<String>,
}

impl ColumnRoles {
    pub(super) fn new(run: &Stored, table: &Table) -> ColumnRoles {
        let has = |name: &str| table.columns.iter().any(|column| column.name == name);
        let case = run.study.case(0).ok();
        let names = |values: &[VariedValue]| values.iter().map(|value| value.column().0).collect::<Vec<_>>();
        let varied = case.as_ref().map(|case| names(&case.varied)).unwrap_or_default();
        let last = varied.last().cloned();
        // A parameter that only another run varies is also a column.
        let fixed = case.as_ref().map(|case| names(&fixed(case))).unwrap_or_default();
        // For a branch along a parameter and for an optimum, the last parameter is a result.
        let along = run.dataset.kind == "branch" && !has("frequency_Hz");
        let abscissa = match table.name.as_str() {
            "curve" | "references" => Some("frequency_Hz".to_owned()),
            "orbit" | "loops" | "motion" => Some("time_s".to_owned()),
            "modes" => Some("modal_amplitude_m_sqrt_kg".to_owned()),
            "branch" if !along => Some("frequency_Hz".to_owned()),
            "branch" | "performance" => last.clone(),
            _ => None,
        };
        let found = along || table.name == "optimum";
        let mut given: Vec<String> =
            varied.into_iter().filter(|name| !(found && Some(name) == last.as_ref())).chain(fixed).collect();
        given.sort();
        let frequency = BY_FREQUENCY.contains(&table.name.as_str()).then_some("frequency_Hz");
        let named = KEYS.into_iter().chain(["drive_frequency_Hz"]).chain(frequency).map(str::to_owned);
        let keys = given.into_iter().chain(named).filter(|name| has(name) && Some(name) != abscissa.as_ref()).collect();
        ColumnRoles { keys, abscissa: abscissa.filter(|name| has(name)) }
    }

    /// Returns the rows of each group, in the order of the table.
    pub(super) fn groups(&self, table: &Table) -> Vec<(String, Vec<usize>)> {
        let columns: Vec<&Column> = self.keys.iter().filter_map(|key| table.column(key)).collect();
        let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
        let mut known: BTreeMap<String, usize> = BTreeMap::new();
        for row in 0..table.rows() {
            let key: Vec<String> = columns
                .iter()
                .map(|column| format!("{} = {}", column.name, crate::output::csv::cell(&column.values, row)))
                .collect();
            let key = key.join(", ");
            let at = *known.entry(key.clone()).or_insert_with(|| {
                groups.push((key, Vec::new()));
                groups.len() - 1
            });
            groups[at].1.push(row);
        }
        groups
    }

    /// Returns the columns to compare.
    pub(super) fn values<'t>(&self, table: &'t Table) -> Vec<&'t str> {
        let wanted = |column: &&Column| {
            matches!(column.values, CellValues::Number(_))
                && !self.keys.contains(&column.name)
                && self.abscissa.as_ref() != Some(&column.name)
                && !EVIDENCE.contains(&column.name.as_str())
        };
        table.columns.iter().filter(wanted).map(|column| column.name.as_str()).collect()
    }
}

/// Returns the parameters of a case that are not varied, with their columns.
fn fixed(case: &Case) -> Vec<VariedValue> {
    let fixed = case.parameters.iter().filter(|(name, _)| case.varied.iter().all(|varied| varied.name != **name));
    fixed
        .map(|(name, (si, dimension))| VariedValue {
            name: name.clone(),
            si: *si,
            dimension: *dimension,
            unit: None,
            text: String::new(),
        })
        .collect()
}

/// A table of a run.
#[derive(Clone, Copy)]
pub(super) struct RunTable<'a> {
    pub(super) run: &'a Stored,
    pub(super) table: &'a Table,
}

/// Returns the table with a column for every parameter that only the other run varies.
pub(super) fn with_parameter_columns(own: RunTable<'_>, other: RunTable<'_>) -> Table {
    let mut table = own.table.clone();
    let varied = other.run.study.case(0).map(|case| case.varied);
    let (Ok(case), Ok(varied)) = (own.run.study.case(0), varied) else { return table };
    for value in fixed(&case).iter().filter(|value| varied.iter().any(|varied| varied.name == value.name)) {
        let (name, value) = value.column();
        if other.table.column(&name).is_some() && table.column(&name).is_none() {
            table.columns.insert(0, Column::numbers(&name, vec![value; table.rows()]));
        }
    }
    table
}
