//! Computations for the page: the study itself, one of its orbits, or the peak over one or
//! two of its parameters.
//!
//! A view replaces `[study]` of the changed file. It is again a study file, which the page can
//! save.

use super::fit::{self, FitTarget};
use serde::Deserialize;
use stickslip_study::kinds;
use toml_edit::{Array, DocumentMut, InlineTable, Item, Table, TableLike, Value};

/// Subject of the computation.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum View {
    /// The study itself.
    Study {
        /// A smaller number of frequencies, for a curve that follows a moving slider.
        points: Option<i64>,
        /// Additional columns, as in `output`.
        #[serde(default)]
        output: Vec<String>,
        /// True adds the linear responses with all joints free and stuck.
        #[serde(default)]
        references: bool,
        /// `linear` or `log`, for the vertical axis.
        scale: Option<String>,
        /// `cases` or `masses`: the items with their own panels.
        panels: Option<String>,
    },
    /// One orbit.
    Orbit {
        /// Frequency, Hz.
        frequency: f64,
        /// Values of the varied parameters.
        #[serde(default)]
        case: Vec<Fixed>,
        /// Instants of the period at which the displacements of all nodes of a mesh are computed.
        fields: Option<i64>,
    },
    /// The peak over one parameter.
    Performance {
        /// The parameter.
        over: Range,
    },
    /// The largest blade of mistuned disks, relative to the tuned disk.
    Mistuning {
        /// The parameter or part that differs from blade to blade.
        of: String,
        /// Its standard deviation, such as `1 %`.
        deviation: String,
        /// Number of disks.
        disks: i64,
    },
    /// Parameters fitted to a measured curve, from their present values.
    Fit {
        /// The measured curve.
        target: FitTarget,
        /// The fitted parameters and their ranges; their numbers of points have no effect.
        parameters: Vec<Range>,
        /// Further starts of the search, spread over the ranges.
        starts: i64,
    },
    /// The peak over two parameters.
    Map {
        /// The parameter of the horizontal axis.
        x: Range,
        /// The parameter of the vertical axis.
        y: Range,
    },
}

/// A varied parameter with one value.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fixed {
    /// Name of the parameter.
    pub name: String,
    /// Its value in SI, without a unit: the bits of the case.
    pub value: String,
}

/// The range of a parameter.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Name of the parameter.
    pub name: String,
    /// First value.
    pub from: String,
    /// Last value.
    pub to: String,
    /// Number of values.
    pub points: i64,
    /// True for equal ratios between the values.
    #[serde(default)]
    pub log: bool,
}

/// Limits of views.
#[derive(Debug, Clone, Copy)]
pub struct ViewSettings {
    /// Samples of an orbit per period. Default 256: a loop is smooth on a screen.
    pub samples: i64,
    /// Largest number of frequencies of a performance curve or a map. Default 61: the peak is
    /// refined from this grid, as in the studies of the gallery.
    pub frequencies: i64,
}

impl Default for ViewSettings {
    fn default() -> Self {
        ViewSettings { samples: 256, frequencies: 61 }
    }
}

/// Why a view is impossible for a study.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ViewError(pub String);

/// Turns a study file into that of a view.
///
/// # Errors
/// A [`ViewError`]: the study has no frequencies for a search, or a parameter does not exist.
pub fn show(document: &mut DocumentMut, view: &View, settings: &ViewSettings) -> Result<(), ViewError> {
    let missing = || ViewError("the file has no [study]".to_owned());
    match view {
        View::Study { points, output, references, scale, panels } => {
            let study = document.get_mut("study").and_then(Item::as_table_like_mut).ok_or_else(missing)?;
            let kind = study.get("kind").and_then(Item::as_str).unwrap_or_default().to_owned();
            coarse(study, *points);
            if !output.is_empty() && has_key(&kind, "output") {
                add_output(study, output);
            }
            if *references && kind == "response" && document.get("sample").is_none() {
                set_figure(document, "references", Value::from(true));
            }
            if let Some(scale) = scale.as_deref().filter(|scale| ["linear", "log"].contains(scale)) {
                set_figure(document, "y", Value::from(scale));
            }
            if let Some(panels) = panels.as_deref().filter(|panels| ["cases", "masses"].contains(panels)) {
                set_figure(document, "panels", Value::from(panels));
            }
        }
        View::Orbit { frequency, case, fields } => {
            let old = document.get("study").and_then(Item::as_table_like).ok_or_else(missing)?;
            let mut study = Table::new();
            study.insert("kind", value("orbit"));
            study.insert("frequency", value(format!("{frequency:?} Hz")));
            study.insert("samples", value(settings.samples));
            study.insert("multipliers", value(true));
            if let Some(instants) = fields {
                study.insert("fields", value(*instants));
            }
            study.insert("output", Item::Value(Value::Array(["harmonics", "contact"].into_iter().collect())));
            let varied = old.get("vary").and_then(Item::as_table_like);
            let mut fixed = InlineTable::new();
            for (name, values) in varied.into_iter().flat_map(TableLike::iter) {
                let chosen = case.iter().find(|chosen| chosen.name == name).map(|chosen| chosen.value.as_str());
                let first = values.as_array().and_then(|list| list.get(0)?.as_str());
                if let Some(one) = chosen.or(first) {
                    fixed.insert(name, Value::from(one));
                }
            }
            if !fixed.is_empty() {
                study.insert("vary", Item::Value(Value::InlineTable(fixed)));
            }
            // a drawn parameter has the value of the case
            let drawn = document.remove("sample").is_some();
            let parameters = document.get_mut("parameters").and_then(Item::as_table_like_mut);
            if let Some(parameters) = parameters.filter(|_| drawn) {
                let others =
                    case.iter().filter(|chosen| study.get("vary").is_none_or(|vary| vary.get(&chosen.name).is_none()));
                others.for_each(|chosen| _ = parameters.insert(&chosen.name, value(chosen.value.as_str())));
            }
            replace_study(document, study);
        }
        View::Performance { over } => {
            let mut study = search(document, "performance", settings, &[over])?;
            let mut vary = outer(document, &[over]);
            vary.insert(&over.name, Value::Array(values(over)?.iter().map(String::as_str).collect::<Array>()));
            study.insert("vary", Item::Value(Value::InlineTable(vary)));
            replace_study(document, study);
        }
        View::Mistuning { of, deviation, disks } => mistuned(document, settings, of, deviation, *disks)?,
        View::Fit { target, parameters, starts } => fit::fit(document, target, parameters, *starts)?,
        View::Map { x, y } => {
            let mut study = search(document, "map", settings, &[x, y])?;
            let fixed = outer(document, &[x, y]);
            if !fixed.is_empty() {
                study.insert("vary", Item::Value(Value::InlineTable(fixed)));
            }
            let over = [x, y].map(|range| (range.name.as_str(), Value::InlineTable(range_table(range))));
            study.insert("over", Item::Value(Value::InlineTable(over.into_iter().collect())));
            replace_study(document, study);
        }
    }
    Ok(())
}

pub(super) fn value(value: impl Into<Value>) -> Item {
    Item::Value(value.into())
}

fn has_key(kind: &str, key: &str) -> bool {
    kinds::find(kind).is_some_and(|kind| kind.info.keys.iter().any(|known| known.name == key))
}

/// Reduces the number of frequencies of a range and leaves out its peaks.
fn coarse(study: &mut dyn TableLike, points: Option<i64>) {
    let Some(points) = points.filter(|points| *points >= 2) else { return };
    let range = study.get_mut("frequency").and_then(Item::as_table_like_mut);
    let Some(stated) = range.and_then(|range| range.get_mut("points")) else { return };
    if stated.as_integer().is_some_and(|present| present > points) {
        *stated = value(points);
        if study.get("kind").and_then(Item::as_str) == Some("response") {
            study.insert("peaks", value(false));
        }
    }
}

fn add_output(study: &mut dyn TableLike, names: &[String]) {
    let present = study.get("output").and_then(Item::as_value);
    let mut all: Vec<String> = match present {
        Some(Value::Array(list)) => list.iter().filter_map(Value::as_str).map(str::to_owned).collect(),
        Some(Value::String(one)) => vec![one.value().clone()],
        _ => Vec::new(),
    };
    all.extend(names.iter().filter(|name| !all.contains(name)).cloned().collect::<Vec<_>>());
    study.insert("output", Item::Value(Value::Array(all.iter().map(String::as_str).collect())));
}

fn set_figure(document: &mut DocumentMut, key: &str, new: Value) {
    let figure = document.entry("figure").or_insert(Item::Table(Table::new()));
    if let Some(table) = figure.as_table_like_mut() {
        table.insert(key, Item::Value(new));
    }
}

/// Replaces `[study]`. The settings of the figure belong to the former kind.
pub(super) fn replace_study(document: &mut DocumentMut, study: Table) {
    document.insert("study", Item::Table(study));
    document.remove("figure");
}

/// Turns a study of a disk into one of many disks that are mistuned at random.
fn mistuned(
    document: &mut DocumentMut,
    settings: &ViewSettings,
    of: &str,
    deviation: &str,
    disks: i64,
) -> Result<(), ViewError> {
    // a name that the study cannot have yet
    let seed = "explorer_seed";
    let mut study = search(document, "response", settings, &[])?;
    // all blades, not the first one
    let blades = study.get("peak_of").and_then(Item::as_str).map(|place| {
        place.rsplit_once('_').filter(|(_, sector)| sector.parse::<usize>().is_ok()).map_or(place, |(name, _)| name)
    });
    let only = blades.map(str::to_owned);
    if let Some(blades) = &only {
        study.insert("peak_of", value(blades.as_str()));
    }
    study.insert("amplification", value(true));
    let mut seeds = InlineTable::new();
    seeds.insert("from", Value::from(1));
    seeds.insert("to", Value::from(disks.clamp(2, 1000)));
    seeds.insert("points", Value::from(disks.clamp(2, 1000)));
    let mut vary = InlineTable::new();
    vary.insert(seed, Value::InlineTable(seeds));
    study.insert("vary", Item::Value(Value::InlineTable(vary)));
    let disk = document.get_mut("disk").and_then(Item::as_table_like_mut);
    let disk = disk.ok_or_else(|| ViewError("mistuning needs a study with [disk]".to_owned()))?;
    let mistuning = [("of", of), ("deviation", deviation), ("seed", seed)];
    disk.insert("mistuning", Item::Value(Value::InlineTable(mistuning.into_iter().collect())));
    let parameters = document.entry("parameters").or_insert(Item::Table(Table::new()));
    if let Some(parameters) = parameters.as_table_like_mut() {
        parameters.insert(seed, value(1));
    }
    document.remove("sample");
    replace_study(document, study);
    if let Some(only) = only {
        set_figure(document, "only", Value::from(only));
    }
    Ok(())
}

/// Returns `[study]` of a search for peaks: the kind, the range of frequencies and `peak_of`.
fn search(
    document: &mut DocumentMut,
    kind: &str,
    settings: &ViewSettings,
    over: &[&Range],
) -> Result<Table, ViewError> {
    if kind == "map" {
        document.remove("sample");
    }
    let known =
        |range: &&&Range| document.get("parameters").is_some_and(|table| table.get(range.name.as_str()).is_some());
    if let Some(unknown) = over.iter().find(|range| !known(range) && document.get("model").is_none()) {
        return Err(ViewError(format!("there is no parameter `{}`", unknown.name)));
    }
    let old = document.get("study").and_then(Item::as_table_like);
    let frequency = old.and_then(|old| old.get("frequency")).cloned();
    let mut frequency = frequency.filter(|frequency| frequency.as_table_like().is_some()).ok_or_else(|| {
        ViewError("a search for peaks needs a study with a range of frequencies, { from, to, points }".to_owned())
    })?;
    if let Some(range) = frequency.as_table_like_mut() {
        range.remove("tolerance");
        let points = range.get("points").and_then(Item::as_integer).unwrap_or(settings.frequencies);
        range.insert("points", value(points.clamp(3, settings.frequencies)));
    }
    let mut study = Table::new();
    study.insert("kind", value(kind));
    study.insert("frequency", frequency);
    if let Some(places) = old.and_then(|old| old.get("peak_of")) {
        study.insert("peak_of", places.clone());
    }
    Ok(study)
}

/// Returns the parameters of `vary` that a search does not vary itself.
fn outer(document: &DocumentMut, over: &[&Range]) -> InlineTable {
    let varied = document.get("study").and_then(|study| study.get("vary")).and_then(Item::as_table_like);
    let others =
        varied.into_iter().flat_map(TableLike::iter).filter(|(name, _)| over.iter().all(|range| range.name != *name));
    others.filter_map(|(name, item)| Some((name, item.clone().into_value().ok()?))).collect()
}

pub(super) fn range_table(range: &Range) -> InlineTable {
    let mut table = InlineTable::new();
    table.insert("from", Value::from(range.from.as_str()));
    table.insert("to", Value::from(range.to.as_str()));
    table.insert("points", Value::from(range.points.clamp(2, 100)));
    if range.log {
        table.insert("scale", Value::from("log"));
    }
    table
}

/// Returns the values of a range as texts with the unit of its first value.
fn values(range: &Range) -> Result<Vec<String>, ViewError> {
    let wrong = || ViewError(format!("the range of `{}` needs two plain quantities of one unit", range.name));
    let split = |text: &str| {
        let end = text.find(|c: char| c.is_alphabetic() && c != 'e' && c != 'E' || c == '%').unwrap_or(text.len());
        Some((text[..end].trim().parse::<f64>().ok()?, text[end..].trim().to_owned()))
    };
    let ((from, unit), (to, same)) = (split(&range.from).ok_or_else(wrong)?, split(&range.to).ok_or_else(wrong)?);
    if unit != same || from.partial_cmp(&to) != Some(std::cmp::Ordering::Less) || (range.log && from <= 0.0) {
        return Err(wrong());
    }
    let last = range.points.clamp(3, 200) - 1;
    let at = |index: i64| {
        let part = index as f64 / last as f64;
        let exact = if range.log { from * (to / from).powf(part) } else { from + part * (to - from) };
        let rounded: f64 = format!("{exact:.5e}").parse().unwrap_or(exact);
        format!("{rounded} {unit}").trim_end().to_owned()
    };
    Ok((0..=last).map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_study::run::{Context, run};
    use stickslip_study::{Study, read_study, templates};

    fn shown(view: &View) -> Study {
        let text = templates::find("blade-couple").unwrap().study;
        let mut document = text.parse().unwrap();
        show(&mut document, view, &ViewSettings::default()).unwrap();
        let text = document.to_string();
        read_study("couple.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}\n{text}"))
    }

    fn range(name: &str, from: &str, to: &str) -> Range {
        Range { name: name.into(), from: from.into(), to: to.into(), points: 4, log: true }
    }

    /// An orbit of a view has the amplitude of the curve at its frequency.
    #[test]
    fn an_orbit_belongs_to_the_curve() {
        let curve = shown(&View::Study { points: None, output: vec![], references: false, scale: None, panels: None });
        let curve = run(&curve, &Context::without_progress(2)).unwrap();
        let table = &curve.tables[0];
        let row = 241 * 2 + 100;
        let frequency = table.numbers("frequency_Hz").unwrap()[row];
        let case = vec![Fixed { name: "Ft".into(), value: "6 N".into() }];
        let orbit = run(&shown(&View::Orbit { frequency, case, fields: None }), &Context::without_progress(1)).unwrap();
        let found = orbit.tables.iter().find(|table| table.name == "orbits").unwrap();
        let [a, b] =
            [table.numbers("blade1_amplitude_m").unwrap()[row], found.numbers("blade1_amplitude_m").unwrap()[0]];
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        assert!(orbit.tables.iter().any(|table| table.name == "multipliers" && table.rows() > 0));
    }

    #[test]
    fn searches_keep_the_other_varied_parameters() {
        let study = shown(&View::Performance { over: range("kt", "1e3 N/m", "1e5 N/m") });
        assert_eq!((study.kind().name, study.varied(), study.cases()), ("performance", vec!["Ft", "kt"], 16));
        let study = shown(&View::Map { x: range("Ft", "1 N", "10 N"), y: range("kt", "1e3 N/m", "1e5 N/m") });
        assert_eq!((study.kind().name, study.varied(), study.cases()), ("map", vec!["Ft", "kt"], 16));
    }

    /// Every seed is another disk, whose largest blade is compared with the tuned disk.
    #[test]
    fn disks_are_mistuned_at_random() {
        let text = templates::find("bladed-ring").unwrap().study;
        let mut document = text.replace("points = 181", "points = 21").parse().unwrap();
        let view = View::Mistuning { of: "k".into(), deviation: "1 %".into(), disks: 3 };
        show(&mut document, &view, &ViewSettings::default()).unwrap();
        let study = read_study("ring.toml", &document.to_string(), &[]).unwrap();
        assert_eq!((study.cases(), study.varied()), (3, vec!["explorer_seed"]));
        let found = run(&study, &Context::without_progress(2)).unwrap();
        let table = found.tables.iter().find(|table| table.name == "amplification").unwrap();
        let ratios = table.numbers("amplification").unwrap();
        assert!(ratios.len() == 3 && ratios.iter().all(|ratio| *ratio > 1.0) && ratios[0] != ratios[1], "{ratios:?}");
        let couple = templates::find("blade-couple").unwrap().study;
        assert!(show(&mut couple.parse().unwrap(), &view, &ViewSettings::default()).is_err());
    }

    #[test]
    fn a_moving_slider_gets_fewer_points() {
        let view = |points| View::Study {
            points,
            output: vec!["velocity".into()],
            references: true,
            scale: Some("log".into()),
            panels: None,
        };
        assert_eq!(shown(&view(Some(31))).points(), 4 * 31);
        assert_eq!(shown(&view(Some(500))).points(), 964);
        assert!(shown(&view(None)).wants_references());
    }

    #[test]
    fn impossible_views_say_why() {
        let text = templates::find("element").unwrap().study;
        for view in [
            View::Performance { over: range("Ft", "1 N", "2 N") },
            View::Performance { over: range("none", "1 N", "2 N") },
            View::Performance { over: range("Ft", "2 N", "1 N") },
        ] {
            let refused = show(&mut text.parse().unwrap(), &view, &ViewSettings::default());
            assert!(refused.is_err(), "{view:?}");
        }
    }
}
