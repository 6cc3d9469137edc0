//! The results of a run for the page: the figure as data for plotly.js, tables, and what says
//! how far to trust them.

use super::description::cases;
use super::fit;
use super::measured;
use super::response_quantity::ResponseQuantity;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use stickslip_report::html;
use stickslip_study::Study;
use stickslip_study::dataset::{CellValues, Dataset, FIELDS, Table};
use stickslip_study::result_block::Block;
use stickslip_study::results::worst_evidence;
use stickslip_study::run::figure_of_tables;

/// Tables that every answer contains: those with few rows.
const SMALL_TABLES: [&str; 7] =
    ["peaks", "optimum", "turns", "decay_summary", "modes_summary", "loops_summary", "amplification"];
/// Largest number of failures that an answer names.
const NAMED_FAILURES: usize = 40;

/// Which parts of the results an answer contains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tables {
    /// The tables with one row for each result, such as peaks.
    Small,
    /// All tables except the displacements of all nodes, and these as the motion of a surface.
    Motion,
    /// All tables.
    All,
}

/// Returns the results of a run.
pub fn answer(study: &Study, dataset: &Dataset, tables: Tables, quantity: Option<ResponseQuantity>) -> Value {
    let own = quantity.and_then(|quantity| quantity.figure(study, dataset));
    let mut figure = own.unwrap_or_else(|| dataset.figure.clone());
    measured::add(study, &mut figure);
    let evidence = worst_evidence(dataset);
    json!({
        "event": "result",
        "kind": dataset.kind,
        "title": dataset.title,
        "plot": html::plot(&figure),
        "cases": cases(study),
        "tables": tables_json(&dataset.tables, tables),
        "fitted": fit::fitted(study, dataset),
        "solid": (tables == Tables::Motion).then(|| stickslip_report::moving_surface(dataset)),
        "notes": dataset.notes,
        "failures": dataset.failures.iter().take(NAMED_FAILURES).collect::<Vec<_>>(),
        "failed": dataset.failures.len(),
        "points": dataset.record.points,
        "methods": dataset.record.methods,
        "found_by": found_by(dataset),
        "residual": evidence.residual,
        "energy_gap": evidence.energy_gap,
        "seconds": dataset.record.wall_time_s,
        "interrupted": dataset.record.interrupted,
    })
}

/// Returns the results of the units that are finished, during a run.
pub(crate) fn partial_answer(study: &Study, block: &Block) -> Value {
    let mut figure = figure_of_tables(study, &block.tables);
    measured::add(study, &mut figure);
    json!({
        "event": "partial",
        "kind": study.kind().name,
        "plot": html::plot(&figure),
        "cases": cases(study),
        "tables": tables_json(&block.tables, Tables::Small),
        "points": block.tally.points(),
    })
}

fn tables_json(all: &[Table], tables: Tables) -> Map<String, Value> {
    let shown = |table: &&Table| match tables {
        Tables::Small => SMALL_TABLES.contains(&table.name.as_str()),
        Tables::Motion => table.name != FIELDS,
        Tables::All => true,
    };
    all.iter().filter(shown).map(|table| (table.name.clone(), table_json(table))).collect()
}

/// Returns a table as lists of values. A missing number is null.
fn table_json(table: &Table) -> Value {
    let column = |column: &stickslip_study::dataset::Column| {
        let values = match &column.values {
            CellValues::Number(values) => json!(values),
            CellValues::Integer(values) => json!(values),
            CellValues::Text(values) => json!(values),
            CellValues::Flag(values) => json!(values),
        };
        json!({ "name": column.name, "unit": column.unit(), "values": values })
    };
    table.columns.iter().map(column).collect()
}

/// Counts the algorithms that found the orbits.
fn found_by(dataset: &Dataset) -> BTreeMap<&str, usize> {
    let mut counts = BTreeMap::new();
    let names = dataset.tables.iter().filter_map(|table| table.texts("found_by")).flatten();
    names.filter(|name| !name.is_empty()).for_each(|name| *counts.entry(name.as_str()).or_default() += 1);
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_study::run::{Context, run};
    use stickslip_study::{read_study, templates};

    #[test]
    fn an_answer_has_the_figure_the_peaks_and_the_evidence() {
        let text = templates::find("blade-couple").unwrap().study;
        let study = read_study("couple.toml", text, &[]).unwrap();
        let dataset = run(&study, &Context::without_progress(2)).unwrap();
        let small = answer(&study, &dataset, Tables::Small, None);
        assert_eq!(small["points"]["converged"], 964);
        assert_eq!(small["cases"][1]["values"][0]["text"], "4 N");
        assert_eq!(small["plot"]["axes"][0]["x"]["unit"], "Hz");
        assert!(small["energy_gap"].as_f64().unwrap() < 1e-6 && small["tables"]["curve"].is_null());
        let all = answer(&study, &dataset, Tables::All, Some(ResponseQuantity::Dissipation));
        let column = &all["tables"]["curve"][2];
        assert_eq!(column["values"][7].as_f64(), Some(dataset.tables[0].numbers("blade1_amplitude_m").unwrap()[7]));
        assert_eq!(all["plot"]["axes"][0]["y"]["quantity"], "dissipation per cycle");
        assert_eq!(all["found_by"].as_object().unwrap().values().filter_map(Value::as_u64).sum::<u64>(), 964);
    }
}
