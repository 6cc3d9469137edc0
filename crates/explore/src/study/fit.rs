//! Fits to the measured data of a study: the curves that a fit can explain, the study of a fit, and
//! its result in the units of the file.

use super::quantities::quantities;
use super::view::{Range, ViewError, range_table, replace_study, value};
use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};
use stickslip::dimension::Dimension;
use stickslip_study::dataset::Dataset;
use stickslip_study::{Study, units};
use toml_edit::{Array, DocumentMut, InlineTable, Item, Table, TableLike, Value};

/// A measured curve, as an entry of `targets` in a study of kind `identify`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitTarget {
    /// Name of the table of `[[data]]`.
    pub data: String,
    /// `response` or `loop`.
    pub is: String,
    /// The place, or the joint of a loop.
    pub at: String,
    /// The measured quantity of the place.
    pub quantity: String,
    /// Title of the column with the response, if its name is that of the place.
    pub column: Option<String>,
}

/// Largest number of places and joints with their own targets.
const NAMED_TARGETS: usize = 60;

/// Returns the measured curves that a fit of a study can explain: a table with `frequency` and a
/// column for a place or for `response`, or one with `displacement` and `force` of a joint.
pub(crate) fn targets(study: &Study) -> Vec<FitTarget> {
    let Ok(case) = study.case(0) else { return Vec::new() };
    let mut found = Vec::new();
    for data in study.data_names() {
        let column = |role: &str, dimension| study.data_column(data, role, dimension).is_some();
        if column("frequency", Dimension::FREQUENCY) {
            let places = case.model.assemble().map(|system| system.places().to_vec()).unwrap_or_default();
            let own: Vec<FitTarget> = places.iter().filter_map(|place| response(study, data, place, place)).collect();
            let only = || places.iter().filter_map(|place| response(study, data, place, "response")).collect();
            found.extend(if own.is_empty() { only() } else { own });
        }
        if column("displacement", Dimension::LENGTH) && column("force", Dimension::FORCE) {
            let joints = case.model.joints.iter().filter(|joint| joint.law.directions() == 1);
            found.extend(joints.map(|joint| FitTarget {
                data: data.to_owned(),
                is: "loop".to_owned(),
                at: joint.name.clone(),
                quantity: "displacement".to_owned(),
                column: None,
            }));
        }
    }
    found.truncate(NAMED_TARGETS);
    found
}

/// Returns the target of a column with the response of a place; `None` without such a column.
fn response(study: &Study, data: &str, place: &str, role: &str) -> Option<FitTarget> {
    let known = [
        ("displacement", Dimension::LENGTH),
        ("velocity", Dimension::VELOCITY),
        ("acceleration", Dimension { kg: 0, m: 1, s: -2, rad: 0 }),
    ];
    let (quantity, _) = known.into_iter().find(|(_, of)| study.data_column(data, role, *of).is_some())?;
    let column = (role != "response").then(|| study.data_title(data, role)).flatten();
    Some(FitTarget {
        data: data.to_owned(),
        is: "response".to_owned(),
        at: place.to_owned(),
        quantity: quantity.to_owned(),
        column,
    })
}

/// Turns a study into the fit of some of its parameters, which starts at their present values.
///
/// # Errors
/// A [`ViewError`]: no parameter is chosen, or there is no such table of data.
pub(crate) fn fit(
    document: &mut DocumentMut,
    target: &FitTarget,
    parameters: &[Range],
    starts: i64,
) -> Result<(), ViewError> {
    if parameters.is_empty() {
        return Err(ViewError("choose the parameters that the fit may change".to_owned()));
    }
    if let Some(title) = &target.column {
        let unknown = || ViewError(format!("there are no data `{}`", target.data));
        let data = document.get_mut("data").and_then(|data| entry(data, &target.data)).ok_or_else(unknown)?;
        let columns = data.entry("columns").or_insert(Item::Value(Value::InlineTable(InlineTable::new())));
        if let Some(columns) = columns.as_table_like_mut() {
            columns.insert("response", value(title.as_str()));
        }
    }
    let mut study = Table::new();
    study.insert("kind", value("identify"));
    let ranges = parameters.iter().map(|range| {
        let mut table = range_table(range);
        table.remove("points");
        (range.name.as_str(), Value::InlineTable(table))
    });
    study.insert("fit", Item::Value(Value::InlineTable(ranges.collect())));
    let mut keys = vec![("data", &target.data), ("is", &target.is), ("at", &target.at)];
    if target.is == "response" {
        keys.push(("quantity", &target.quantity));
    }
    let stated: InlineTable = keys.into_iter().map(|(key, text)| (key, Value::from(text.as_str()))).collect();
    study.insert("targets", Item::Value(Value::Array(Array::from_iter([Value::InlineTable(stated)]))));
    study.insert("starts", value(starts.clamp(0, 1000)));
    document.remove("sample");
    replace_study(document, study);
    Ok(())
}

/// Returns the entry of `[[data]]` with a name.
fn entry<'a>(data: &'a mut Item, name: &str) -> Option<&'a mut dyn TableLike> {
    let named = |item: &Item| item.get("name").and_then(Item::as_str) == Some(name);
    let index = (0..).map_while(|index| data.get(index)).position(named)?;
    data.get_mut(index)?.as_table_like_mut()
}

/// Returns the fitted parameters in the units of the file, with their errors; null for another
/// kind.
pub(crate) fn fitted(study: &Study, dataset: &Dataset) -> Option<Vec<Json>> {
    let table = dataset.tables.iter().find(|table| table.name == "parameters" && dataset.kind == "identify")?;
    let (names, of_si, status) = (table.texts("parameter")?, table.texts("unit")?, table.texts("status")?);
    let columns = ["value", "standard_error", "low_95", "high_95"].map(|name| table.numbers(name));
    let [number, error, low, high] = columns;
    let (number, error, low, high) = (number?, error?, low?, high?);
    let known = quantities(&study.text().parse().ok()?);
    let rows = names.iter().enumerate().map(|(row, name)| {
        let own = known.iter().find(|quantity| quantity.group == "parameters" && quantity.name == *name);
        let stated = own.map(|own| own.unit.as_str()).unwrap_or_default();
        let (unit, factor) = match units::ratio(&of_si[row], stated) {
            Some(factor) => (stated, factor),
            None => (of_si[row].as_str(), 1.0),
        };
        let shown = |value: f64| value * factor;
        json!({
            "name": name,
            "unit": unit,
            "value": shown(number[row]),
            "error": shown(error[row]),
            "low": shown(low[row]),
            "high": shown(high[row]),
            "status": status[row],
        })
    });
    Some(rows.collect())
}
