//! Labels of runs: the parameters, methods and options in which they differ, otherwise the
//! folder.

use crate::run::stored::Stored;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// Returns the name of a folder.
pub(super) fn folder_name(folder: &Path) -> String {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    whole.file_name().map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().trim_matches('.').to_owned())
}

/// Returns a label for each run: differing parameters, methods and options, otherwise the
/// folder.
pub(super) fn labels(runs: &[Stored]) -> Vec<String> {
    let cases: Vec<&Value> = runs.iter().map(|run| &run.dataset.record.study["cases"][0]).collect();
    let mut parts = parameters(&cases);
    // Study kinds that compute orbits without a method have no method name.
    let methods: Vec<Option<String>> = runs.iter().map(methods).collect();
    if differ(&methods) {
        parts.iter_mut().zip(methods).for_each(|(parts, method)| parts.extend(method));
    }
    let options = |case: &Value, key: &str| case["method"]["options"].get(key).map(Value::to_string);
    let known = keys(&cases, |case| &case["method"]["options"]);
    add_differing(&mut parts, &cases, &known, options);
    let labels: Vec<String> = parts.iter().map(|parts| parts.join(", ")).collect();
    if unique(&labels) && labels.iter().all(|label| !label.is_empty()) {
        return labels;
    }
    with_folders(runs, &labels)
}

/// Returns the parameters that differ between runs, without varied ones, for each run.
///
/// The lists are empty if more than three differ.
fn parameters(cases: &[&Value]) -> Vec<Vec<String>> {
    let mut parts: Vec<Vec<String>> = vec![Vec::new(); cases.len()];
    let mut known = keys(cases, |case| &case["parameters"]);
    for varied in keys(cases, |case| &case["varied"]) {
        known.remove(&varied);
    }
    let reads = |case: &Value, key: &str| case["parameters"][key]["reads"].as_str().map(str::to_owned);
    // Maximum number of parameters in a label. Runs that differ in more have folder names as
    // labels.
    if add_differing(&mut parts, cases, &known, reads) > 3 {
        parts.iter_mut().for_each(Vec::clear);
    }
    parts
}

/// Returns the keys of an object over all cases.
fn keys(cases: &[&Value], object: impl Fn(&Value) -> &Value) -> BTreeSet<String> {
    cases.iter().flat_map(|case| object(case).as_object().into_iter().flat_map(|map| map.keys().cloned())).collect()
}

/// Adds `key = value` for the keys whose values differ between cases. Returns their number.
fn add_differing(
    parts: &mut [Vec<String>],
    cases: &[&Value],
    keys: &BTreeSet<String>,
    value: impl Fn(&Value, &str) -> Option<String>,
) -> usize {
    let mut differing = 0;
    for key in keys {
        let values: Vec<Option<String>> = cases.iter().map(|case| value(case, key)).collect();
        if differ(&values) {
            differing += 1;
            for (parts, value) in parts.iter_mut().zip(values) {
                parts.extend(value.map(|value| format!("{key} = {value}")));
            }
        }
    }
    differing
}

fn differ(values: &[Option<String>]) -> bool {
    values.iter().any(|value| *value != values[0])
}

fn unique(labels: &[String]) -> bool {
    labels.iter().collect::<BTreeSet<_>>().len() == labels.len()
}

/// Returns the methods of a run without the reasons for their choice.
fn methods(run: &Stored) -> Option<String> {
    let names = run.dataset.record.methods.iter().map(|choice| choice.split(" (").next().unwrap_or(choice));
    let names: BTreeSet<&str> = names.collect();
    (!names.is_empty()).then(|| names.into_iter().collect::<Vec<_>>().join(" and "))
}

/// Adds folder names to the labels.
///
/// Equal names are replaced by paths, and equal paths by numbered labels.
fn with_folders(runs: &[Stored], labels: &[String]) -> Vec<String> {
    let with = |name: &dyn Fn(&Stored) -> String| -> Vec<String> {
        let runs = runs.iter().zip(labels);
        runs.map(|(run, label)| if label.is_empty() { name(run) } else { format!("{}: {label}", name(run)) }).collect()
    };
    let named = with(&|run| folder_name(&run.folder));
    if unique(&named) {
        return named;
    }
    let pathed = with(&|run| run.folder.display().to_string());
    if unique(&pathed) {
        return pathed;
    }
    pathed.iter().enumerate().map(|(i, label)| format!("{}: {label}", i + 1)).collect()
}
