//! The study file with the values that an identification found.

use crate::results::dataset::Dataset;
use crate::syntax::document::{self, TomlValue};
use std::collections::BTreeMap;

/// Returns the text of the study with the fitted values in `[parameters]`; `None` for another
/// kind, without a result, or with several cases.
///
/// Everything else stays as it is, so the file belongs into the folder of the study, where its
/// data are.
///
/// # Example
/// ```
/// use stickslip_study::dataset::Dataset;
/// assert_eq!(stickslip_study::results::fitted_study(&Dataset::default()), None);
/// ```
pub fn fitted_study(dataset: &Dataset) -> Option<String> {
    let text = dataset.record.study.get("file")?.as_str()?;
    let table = dataset.tables.iter().find(|table| table.name == "parameters" && dataset.kind == "identify")?;
    let (names, units, values) = (table.texts("parameter")?, table.texts("unit")?, table.numbers("value")?);
    let mut fitted = BTreeMap::new();
    for ((name, unit), value) in names.iter().zip(units).zip(values) {
        let written = if unit.is_empty() { format!("{value:e}") } else { format!("\"{value:e} {unit}\"") };
        // several cases have several values
        if fitted.insert(name.as_str(), written).is_some() {
            return None;
        }
    }
    let root = document::parse(text, 0).ok()?;
    let TomlValue::Table(parameters) = &root.get("parameters")?.node.value else { return None };
    let mut changes: Vec<_> = parameters
        .entries
        .iter()
        .filter_map(|entry| Some((entry.node.location.span.clone(), fitted.get(entry.key.as_str())?)))
        .collect();
    changes.sort_by_key(|(span, _)| span.start);
    let mut out = String::with_capacity(text.len() + 100);
    let mut at = 0;
    for (span, written) in changes {
        out.push_str(text.get(at..span.start)?);
        out.push_str(written);
        at = span.end;
    }
    out.push_str(text.get(at..)?);
    Some(out)
}
