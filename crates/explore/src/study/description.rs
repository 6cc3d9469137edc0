//! A study for the page: its quantities, its cases, its model, and the laws and kinds to choose
//! from.

use super::catalog::Source;
use super::fit;
use super::quantities::quantities;
use super::solid;
use serde_json::{Value, json};
use stickslip::law;
use stickslip_study::{Study, StudyError};
use toml_edit::DocumentMut;

/// Largest number of cases whose names the page gets.
const NAMED_CASES: usize = 400;

/// Describes a study that was read.
pub(crate) fn describe(study: &Study, document: &DocumentMut) -> Value {
    let case = study.case(0).ok();
    let frequency = case.as_ref().and_then(|case| case.frequencies.as_ref()).map(|frequencies| {
        json!({
            "from": frequencies.lowest().map(stickslip_study::hertz),
            "to": frequencies.highest().map(stickslip_study::hertz),
            "count": frequencies.len(),
        })
    });
    let laws: Vec<Value> = law::TABLE
        .iter()
        .map(|row| json!({ "name": row.name, "summary": row.summary, "directions": row.sample().directions() }))
        .collect();
    json!({
        "name": study.name(),
        "title": study.title(),
        "kind": study.kind().name,
        "summary": study.kind().summary,
        "text": document.to_string(),
        "quantities": quantities(document),
        "cases": cases(study),
        "varied": study.varied(),
        "draws": study.draws(),
        "points": study.points(),
        "adaptive": study.is_adaptive(),
        "frequency": frequency,
        "model": case.as_ref().map(|case| &case.model),
        "places": case.as_ref().and_then(|case| Some(case.model.assemble().ok()?.places().to_vec())),
        "fields": solid::instants(study),
        "targets": fit::targets(study),
        "laws": laws,
    })
}

/// Returns the names of the cases, and the values of their parameters in the unit of the file.
pub(crate) fn cases(study: &Study) -> Vec<Value> {
    let case = |index: usize| {
        let case = study.case(index).ok()?;
        let values: Vec<Value> = case
            .varied
            .iter()
            .map(|value| {
                let (number, unit) = value.in_file_unit();
                // the text of the file gives the bits of the case
                let text = value.text.split_once(" = ").map_or("", |(_, text)| text);
                json!({ "name": value.name, "value": number, "unit": unit, "text": text })
            })
            .collect();
        Some(json!({ "label": case.label(), "values": values }))
    };
    (0..study.cases().min(NAMED_CASES)).filter_map(case).collect()
}

/// An error of a study for the page.
pub(crate) fn error(error: &StudyError, source: &Source) -> Value {
    json!({
        "event": "error",
        "message": error.message(),
        "help": error.help_text(),
        "key": error.key(),
        "line": error.line(),
        "file": source.file,
    })
}
