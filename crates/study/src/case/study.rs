//! A study that was read and checked: its parameters, its model and its cases.
//!
//! A case is one combination of the varied parameters. The study builds the model of a case and
//! the numbers of its keys, in SI, when they are needed.

use crate::case::assembled::LastAssembled;
use crate::case::disk::{self, Reevaluate};
use crate::case::model_builder::{build_model, refuse_without_disk};
use crate::case::sample::{DrawnParameter, SampleSettings};
use crate::case::stress_stiffening::StiffnessExports;
use crate::case::substructure;
use crate::case::values::{
    Frequencies, ResolvedValue, Values, in_table_unit, log_range_point, quantity_json, range_point, table_unit,
};
use crate::check::overstiff::{overstiff_element, too_slow, too_soft};
use crate::check::{figure, memory_limit};
use crate::compile::bare_numbers::literal_unit;
use crate::compile::compiled::{
    CompiledEntry, CompiledQuantity, CompiledTable, CompiledValue, Environment, RangeScale, check_positive, check_range,
};
use crate::compile::mesh::{MeshSource, NamedMembers};
use crate::compile::source_model::{MatrixSource, SourceModel, model_problem};
use crate::compile::template_errors;
use crate::compile::torsion::of_rotation;
use crate::data::DataTable;
use crate::kinds::info::{KeyError, KindInfo};
use crate::syntax::error::{Location, Problem, Source, StudyError};
use crate::syntax::expression::{ExpressionValue, quantity_text};
use crate::syntax::key::VERSION;
use crate::syntax::suggest::{alternatives, excerpt, suggest};
use crate::syntax::units;
use serde_json::{Value as Json, json};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::method::{self, Options, transient};
use stickslip::model::{Model, ModelError};

/// A study file, read and checked.
#[derive(Debug, Clone)]
pub struct Study {
    pub(crate) name: String,
    pub(crate) title: String,
    pub(crate) source: Option<String>,
    pub(crate) text: String,
    pub(crate) kind: &'static KindInfo,
    pub(crate) overrides: Vec<(String, String)>,
    pub(crate) sources: Vec<Arc<Source>>,
    pub(crate) names: Vec<String>,
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) order: Vec<usize>,
    /// Drawn parameters come first; they change together, and slowest.
    pub(crate) varied: Vec<VariedParameter>,
    pub(crate) sample: Option<SampleSettings>,
    pub(crate) replaced: Vec<ReplacedParameter>,
    pub(crate) structure: SourceModel,
    pub(crate) study: CompiledTable,
    pub(crate) method: CompiledTable,
    pub(crate) figure: CompiledTable,
    /// The tables of `[[data]]`.
    pub(crate) data: Arc<Vec<DataTable>>,
    /// Memory limit of a run, bytes, if the user set one.
    pub(crate) memory: Option<u64>,
    /// The last assembled model.
    pub(crate) assembled: LastAssembled,
}

/// A parameter: its value as stated, and its required dimension if that is known.
#[derive(Debug, Clone)]
pub(crate) struct Parameter {
    pub quantity: CompiledQuantity,
    pub dimension: Option<Dimension>,
}

/// A parameter of `vary` or `[sample]`.
#[derive(Debug, Clone)]
pub(crate) struct VariedParameter {
    pub index: usize,
    pub location: Location,
    pub points: ParameterValues,
}

/// A parameter of `vary` that an override replaced.
#[derive(Debug, Clone)]
pub(crate) struct ReplacedParameter {
    pub name: String,
    /// The value as it was typed.
    pub text: String,
    /// Number of values in the file.
    pub values: usize,
}

#[derive(Debug, Clone)]
pub(crate) enum ParameterValues {
    List(Vec<CompiledQuantity>),
    Range { from: CompiledQuantity, to: CompiledQuantity, points: usize, scale: RangeScale },
    Drawn(DrawnParameter),
}

impl ParameterValues {
    pub fn len(&self) -> usize {
        match self {
            ParameterValues::Drawn(drawn) => drawn.sample.count,
            ParameterValues::List(list) => list.len(),
            ParameterValues::Range { points, .. } => *points,
        }
    }

    pub fn quantities(&self) -> impl Iterator<Item = &CompiledQuantity> {
        let (list, ends, drawn): (&[CompiledQuantity], [Option<&CompiledQuantity>; 2], Option<&DrawnParameter>) =
            match self {
                ParameterValues::List(list) => (list, [None, None], None),
                ParameterValues::Range { from, to, .. } => (&[], [Some(from), Some(to)], None),
                ParameterValues::Drawn(drawn) => (&[], [None, None], Some(drawn)),
            };
        list.iter().chain(ends.into_iter().flatten()).chain(drawn.into_iter().flat_map(DrawnParameter::quantities))
    }

    fn is_drawn(&self) -> bool {
        matches!(self, ParameterValues::Drawn(_))
    }
}

/// The method of a study with its options.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodChoice {
    /// Name, a row of [`stickslip::method::TABLE`].
    pub name: String,
    /// The options that were given, in SI.
    pub options: Options,
}

impl MethodChoice {
    /// Returns the relative error of time histories: the `tolerance` of method `transient`.
    pub(crate) fn time_history_tolerance(&self) -> Option<f64> {
        self.options.get("tolerance").filter(|_| self.name == transient::NAME).copied()
    }
}

/// The value of a varied parameter in one case.
#[derive(Debug, Clone, PartialEq)]
pub struct VariedValue {
    /// Name of the parameter.
    pub name: String,
    /// Its value in SI; for a parameter without a unit, the number as written.
    pub si: f64,
    /// Its dimension, if the file determines it.
    pub dimension: Option<Dimension>,
    /// The unit in which the file states it, such as `rpm`, if it has one.
    pub unit: Option<String>,
    /// For legends: `Ft = 2 N`.
    pub text: String,
}

/// Names of table columns, without units, that a parameter could also have.
const RESERVED_COLUMNS: [&str; 12] = [
    "amplitude",
    "frequency",
    "drive_frequency",
    "time",
    "displacement",
    "force",
    "dissipation",
    "damping_ratio",
    "status",
    "mass",
    "joint",
    "loop",
];

impl VariedValue {
    /// Returns its column in a table: the name with the unit at its end, `Ft_N`, and the value
    /// in that unit.
    ///
    /// Values are in SI, except hertz and degrees. A parameter without a known dimension has
    /// its bare name.
    pub fn column(&self) -> (String, f64) {
        // tables already have columns of these names
        let prefix = if RESERVED_COLUMNS.contains(&self.name.as_str()) { "parameter_" } else { "" };
        match self.dimension.and_then(|dimension| Some((table_unit(dimension)?, dimension))) {
            Some(((unit, _), dimension)) => {
                (format!("{prefix}{}_{unit}", self.name), in_table_unit(self.si, dimension))
            }
            None => (format!("{prefix}{}", self.name), self.si),
        }
    }

    /// Returns the value and the unit as the file states them, for a colour scale.
    pub fn in_file_unit(&self) -> (f64, String) {
        match self.unit.as_deref().and_then(|unit| Some((unit, units::parse(unit)?))) {
            Some((name, unit)) => (without_rounding(self.si / unit.si_value("1")), name.to_owned()),
            None => self.in_axis_unit(),
        }
    }

    /// Returns the factor from the values of the column to those in the unit of the file.
    pub fn file_unit_factor(&self) -> f64 {
        let Some(unit) = self.unit.as_deref().and_then(units::parse) else { return 1.0 };
        let one = VariedValue { si: unit.si_value("1"), ..self.clone() };
        1.0 / one.column().1
    }

    /// Returns the value and the unit for the axis of a figure, as in [`VariedValue::column`].
    pub fn in_axis_unit(&self) -> (f64, String) {
        let unit = self.dimension.and_then(table_unit).map_or(String::new(), |(_, unit)| unit);
        (self.column().1, unit)
    }
}

/// Removes the rounding error of a change of units.
fn without_rounding(value: f64) -> f64 {
    format!("{value:.12e}").parse().unwrap_or(value)
}

/// One case of a study: one combination of the varied parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Its number, from 0; the first varied parameter changes slowest.
    pub index: usize,
    /// The varied parameters, in the order of [`Study::varied`].
    pub varied: Vec<VariedValue>,
    /// Value and dimension of every parameter. The value is in SI; without a unit it is the
    /// number as written.
    pub parameters: BTreeMap<String, (f64, Option<Dimension>)>,
    /// The model; it was checked to assemble.
    pub model: Model,
    /// The values of the kind's keys of `[study]`.
    pub values: Values,
    /// The excitation frequencies, if the study has any.
    pub frequencies: Option<Frequencies>,
    /// The method.
    pub method: MethodChoice,
    /// Number of forces and motions that take their values from records.
    pub records: usize,
    /// True for a model of rotation: moments of inertia, angles and moments.
    pub is_torsional: bool,
    /// The sets of the mesh that places and contacts name.
    pub sets: Arc<Vec<NamedMembers>>,
}

impl Case {
    /// Describes the varied parameters: `Ft = 2 N, kt = 1000 N/m`; empty if nothing is varied.
    pub fn label(&self) -> String {
        varied_text(&self.varied)
    }
}

/// Describes varied parameters in words.
pub(crate) fn varied_text(varied: &[VariedValue]) -> String {
    varied.iter().map(|varied| varied.text.as_str()).collect::<Vec<_>>().join(", ")
}

/// Help for a draw with values that no model can have.
const INVALID_DRAW_HELP: &str = "[sample] draws invalid values such as this one: bound the distribution with \
    `within = [least, most]`, or use a distribution without such values, such as `lognormal`";

impl Study {
    /// Returns the stem of the file's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the title; the name if the file gives none.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// Returns the source that the file cites, if any.
    pub fn source(&self) -> Option<&str> {
        self.source.as_deref()
    }

    /// Returns the text of the file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the mesh of the structure, if the file names one.
    pub fn mesh(&self) -> Option<&MeshSource> {
        self.structure.mesh.source.as_deref()
    }

    /// Returns the study kind.
    pub fn kind(&self) -> &'static KindInfo {
        self.kind
    }

    /// Returns the names of the varied parameters: drawn ones first, then those of `vary` in
    /// the order of the file.
    pub fn varied(&self) -> Vec<&str> {
        self.varied.iter().map(|varied| self.names[varied.index].as_str()).collect()
    }

    /// Returns the differences from the file as sentences for the reader of the results.
    pub fn notes(&self) -> Vec<String> {
        let note = |ReplacedParameter { name, text, values }: &ReplacedParameter| {
            let values = if *values == 1 { "the value".to_owned() } else { format!("the {values} values") };
            format!("{name} = {text} from `--set` replaces {values} of `vary`.")
        };
        self.replaced.iter().map(note).collect()
    }

    /// Returns the number of cases: the product of the number of draws and the numbers of
    /// values in `vary`; 1 if nothing is drawn or varied.
    pub fn cases(&self) -> usize {
        self.draws().unwrap_or(1) * self.cases_per_draw()
    }

    /// Returns the number of draws of the uncertain parameters, if there are any.
    pub fn draws(&self) -> Option<usize> {
        self.sample.map(|sample| sample.count)
    }

    /// Returns the number of cases with the same draw: the combinations of `vary`.
    pub(crate) fn cases_per_draw(&self) -> usize {
        self.vary_parameters().map(|varied| varied.points.len()).product()
    }

    /// Returns the parameters of `vary`.
    fn vary_parameters(&self) -> impl DoubleEndedIterator<Item = &VariedParameter> {
        self.varied.iter().filter(|varied| !varied.points.is_drawn())
    }

    /// Returns the number of drawn parameters, which come first in [`Study::varied`].
    pub(crate) fn drawn_parameter_count(&self) -> usize {
        self.varied.len() - self.vary_parameters().count()
    }

    /// Returns the seed of the draws, if there are any.
    pub fn seed(&self) -> Option<u64> {
        self.sample.map(|sample| sample.seed)
    }

    /// Sets the memory limit of a run, bytes.
    pub fn with_memory_limit(mut self, bytes: u64) -> Study {
        self.memory = Some(bytes);
        self
    }

    /// Returns the memory limit of a run, bytes: the limit that was set, or
    /// [`DEFAULT_MEMORY_LIMIT`](memory_limit::DEFAULT_MEMORY_LIMIT), or the machine's free memory
    /// if that is less.
    pub fn memory_limit(&self) -> u64 {
        self.memory.unwrap_or_else(memory_limit::default_limit)
    }

    /// Returns the number of points: cases times frequencies.
    pub fn points(&self) -> usize {
        let frequencies = match self.study.entry("frequency").map(|entry| &entry.value) {
            Some(CompiledValue::List(list, _)) => list.len(),
            Some(CompiledValue::Range { points, .. }) => *points,
            Some(CompiledValue::Adaptive { .. }) => stickslip::curve::adaptive::INITIAL_INTERVALS + 1,
            _ => 1,
        };
        self.cases() * frequencies
    }

    /// Returns the number of values of the last varied parameter, which changes fastest; 1 if
    /// nothing is varied.
    pub(crate) fn values_per_curve(&self) -> usize {
        self.vary_parameters().next_back().map_or(1, |varied| varied.points.len())
    }

    /// Returns the number of values of every varied parameter, in the order of
    /// [`Study::varied`], and their spacing if they are a range.
    pub(crate) fn value_counts(&self) -> Vec<(usize, Option<RangeScale>)> {
        let scale = |points: &ParameterValues| match points {
            ParameterValues::Range { scale, .. } => Some(*scale),
            ParameterValues::List(_) | ParameterValues::Drawn(_) => None,
        };
        self.varied.iter().map(|varied| (varied.points.len(), scale(&varied.points))).collect()
    }

    /// Returns the varied parameters of a case without its model; `None` if there is no such
    /// case.
    pub(crate) fn varied_values(&self, index: usize) -> Option<Vec<VariedValue>> {
        let choice = self.value_indices(index);
        let environment = evaluate(&self.names, &self.parameters, &self.order, &choice, &[]).ok()?;
        Some(self.varied_of(&environment, &choice))
    }

    /// Returns whether the frequencies are adaptive, so that their number is unknown before the
    /// run.
    pub fn is_adaptive(&self) -> bool {
        matches!(self.study.entry("frequency").map(|entry| &entry.value), Some(CompiledValue::Adaptive { .. }))
    }

    /// Returns both exports of a structure that rotation stiffens (`stiffened`), at the values
    /// of the first case.
    pub fn stiffened(&self) -> Option<StiffnessExports> {
        let MatrixSource { table, component, stress_stiffening: stiffened, .. } = self.structure.matrices.as_ref()?;
        let CompiledValue::Table(spin) = &table.entry("stiffened")?.value else { return None };
        let CompiledValue::Quantity { quantity: speed, .. } = &spin.entry("speed")?.value else { return None };
        let values = evaluate(&self.names, &self.parameters, &self.order, &self.value_indices(0), &[]).ok()?;
        let environment = Environment { names: &self.names, parameters: &self.parameters, values };
        let at = spin.values(&environment, &mut Vec::new()).quantity("at")?;
        let rest = component.clone()?;
        let there = stiffened.as_ref()?.component_at(&rest, 1.0).ok()?.matrices().2.clone();
        Some(StiffnessExports { at_rest: rest, at_speed: there, export_speed: at, speed: speed.text.clone() })
    }

    /// Returns whether the model is one of rotation, whose masses are moments of inertia.
    pub fn is_torsional(&self) -> bool {
        self.structure.lists.is_torsional
    }

    /// Returns the values of `[figure]`.
    pub(crate) fn figure_values(&self) -> Values {
        // no key of `[figure]` takes a quantity
        let environment = Environment { names: &self.names, parameters: &[], values: Vec::new() };
        self.figure.values(&environment, &mut Vec::new())
    }

    /// Returns the case with this number.
    ///
    /// # Errors
    /// [`StudyError`] if there is no such case. The cases of a study that was read have been
    /// checked.
    pub fn case(&self, index: usize) -> Result<Case, StudyError> {
        self.build_case(index, &[])
    }

    /// Returns case `index` with the parameter `name` at another value (SI), for searches
    /// between the cases.
    ///
    /// # Errors
    /// [`StudyError`]: there is no such case or parameter, or the model cannot have this value.
    pub fn case_with_parameter(&self, index: usize, name: &str, si: f64) -> Result<Case, StudyError> {
        self.case_with_parameters(index, &[(name, si)])
    }

    /// Returns case `index` with several parameters at other values (SI).
    ///
    /// # Errors
    /// [`StudyError`]: there is no such case or parameter, or the model cannot have these values.
    pub fn case_with_parameters(&self, index: usize, values: &[(&str, f64)]) -> Result<Case, StudyError> {
        let mut fixed = Vec::with_capacity(values.len());
        for (name, si) in values {
            let Some(parameter) = self.names.iter().position(|n| n == name) else {
                let message = format!("there is no parameter `{}`", excerpt(name));
                return Err(StudyError::file(&self.sources[0].name, message, None));
            };
            fixed.push((parameter, *si));
        }
        self.build_case(index, &fixed)
    }

    fn build_case(&self, index: usize, fixed: &[(usize, f64)]) -> Result<Case, StudyError> {
        if index >= self.cases() {
            let message = format!("there is no case {index}; the study has {} cases", self.cases());
            return Err(StudyError::file(&self.sources[0].name, message, None));
        }
        let mut problems = Vec::new();
        let parts = self.resolve_with_case_name(index, CheckScope::NumbersOnly(fixed), &mut problems);
        let error = StudyError::from_problems(&self.sources, problems);
        match (parts, error) {
            (Some(parts), None) => Ok(self.finish_case(index, parts)),
            (_, Some(error)) => Err(error),
            (None, None) => {
                Err(StudyError::file(&self.sources[0].name, "the values of this case could not be computed", None))
            }
        }
    }

    /// Returns the study with another method. Options are kept if the file names this method.
    ///
    /// # Errors
    /// [`StudyError`] if there is no such method.
    pub fn with_method(mut self, name: &str) -> Result<Study, StudyError> {
        let Some(row) = method::find(name) else {
            let words = method::TABLE.iter().map(|row| row.name);
            let source = Arc::new(Source { name: "--method".to_owned(), text: name.to_owned() });
            let location = Location { source: 0, span: 0..name.len() };
            let message = format!("there is no method `{}`, expected {}", excerpt(name), alternatives(words.clone()));
            let help = suggest(name, words).map(|near| format!("did you mean `{near}`?"));
            return Err(StudyError::at_location(
                &[source],
                Problem::new(&location, "method", message).maybe_help(help),
            ));
        };
        let same = |entry: &CompiledEntry| matches!(&entry.value, CompiledValue::Fixed(ResolvedValue::Text(text)) if text == row.name);
        if !self.method.entry("kind").is_some_and(same) {
            let location = self.method.location.clone();
            let kind = CompiledValue::Fixed(ResolvedValue::Text(row.name.to_owned()));
            self.method.entries = vec![CompiledEntry { key: "kind", location, value: kind }];
        }
        Ok(self)
    }

    /// Returns whether a flag of `[study]` is set.
    pub(crate) fn has_flag(&self, key: &str) -> bool {
        matches!(self.study.entry(key).map(|entry| &entry.value), Some(CompiledValue::Fixed(ResolvedValue::Flag(true))))
    }

    /// Returns the study without the mistuning of its disk.
    pub(crate) fn without_mistuning(&self) -> Study {
        let mut study = self.clone();
        if let Some(disk) = &mut study.structure.lists.disk {
            disk.table.entries.retain(|entry| entry.key != "mistuning");
            disk.pattern = None;
        }
        study
    }

    /// Returns whether a run must compute the reference curves of `[figure]`. A study with
    /// draws has none, because each draw has its own references.
    pub fn wants_references(&self) -> bool {
        self.draws().is_none() && self.requests_references()
    }

    /// Returns whether `[figure]` asks for reference curves, with or without draws.
    pub(crate) fn requests_references(&self) -> bool {
        self.figure_values().flag("references") == Some(true)
    }

    /// Returns the study with the title and the `[figure]` of another study.
    #[must_use]
    pub fn with_figure_of(mut self, other: &Study) -> Study {
        self.title.clone_from(&other.title);
        self.figure = other.figure.clone();
        self
    }

    /// Builds an error that only appears when the study runs, located at a key of the file.
    ///
    /// `table` is `study`, `method`, `mass`, `joint`, …; `index` is the element of a list. If
    /// the key is absent, the location is the table or the file.
    pub fn error_at(
        &self,
        table: &str,
        index: usize,
        key: &str,
        message: impl Into<String>,
        help: Option<String>,
    ) -> StudyError {
        let stated = match (table, &self.structure.template) {
            ("study", _) => Some(&self.study),
            ("method", _) => Some(&self.method),
            ("figure", _) => Some(&self.figure),
            (_, Some(template)) => Some(&template.table),
            ("structure", None) => self.structure.matrices.as_ref().map(|matrices| &matrices.table),
            (_, None) => {
                // on a ring: the element of its sector
                let list = self.structure.lists.get(table);
                list.get(if self.structure.lists.disk.is_some() { index % list.len().max(1) } else { index })
            }
        };
        let whole = Location::default();
        let location = stated.map_or(&whole, |table| match (table.entry(key), &self.structure.template) {
            (None, Some(_)) => table.location_of("template", None),
            _ => table.location_of(key, None),
        });
        StudyError::at_location(&self.sources, Problem::new(location, key, message).maybe_help(help))
    }

    /// Returns the names of the tables of `[[data]]`.
    pub fn data_names(&self) -> impl Iterator<Item = &str> {
        self.data.iter().map(|table| table.name.as_str())
    }

    /// Returns a column of a table of `[[data]]` in SI. `role` is its use or its name.
    ///
    /// `None` if there is no such column, or if it has another dimension.
    pub fn data_column(&self, table: &str, role: &str, dimension: Dimension) -> Option<Vec<f64>> {
        self.data.iter().find(|known| known.name == table)?.values(role, dimension).ok()
    }

    /// Returns the title of a column of a table of `[[data]]`. `role` is its use or its name.
    pub fn data_title(&self, table: &str, role: &str) -> Option<String> {
        self.data.iter().find(|known| known.name == table)?.title(role)
    }

    /// Returns a checksum of the matrices of `[structure]` and of the sector's files; `None`
    /// without matrices.
    pub fn matrices_checksum(&self) -> Option<String> {
        let own = self.structure.matrices.as_ref().and_then(MatrixSource::checksum)?;
        let sector = self.structure.lists.disk.as_ref().map_or(0, |disk| {
            let files = format!("{:?} {:?} {:?} {:?}", disk.pattern, disk.boundary, disk.nodes, disk.blade);
            crc32fast::hash(files.as_bytes())
        });
        Some(format!("{own}{sector:08x}"))
    }

    /// Returns a checksum of the matrices and of the files of `[[data]]`; `None` without files.
    pub fn files_checksum(&self) -> Option<String> {
        let data = self.data.iter().map(DataTable::checksum);
        let all: Vec<String> = self.matrices_checksum().into_iter().chain(data).collect();
        (!all.is_empty()).then(|| all.join("-"))
    }

    /// Returns the study as it was understood, for the record of a run. All values are in SI;
    /// the file's text is included.
    pub fn to_record(&self) -> Json {
        let mut cases = Vec::new();
        // Largest number of cases that `Study::to_record` lists. A run can be repeated from the
        // text alone.
        for index in 0..self.cases().min(1_000) {
            if let Ok(case) = self.case(index) {
                let quantities = case.parameters.iter().map(|(name, (si, d))| (name.clone(), quantity_json(*si, *d)));
                cases.push(json!({
                    "varied": case.varied.iter().map(|v| (v.name.clone(), quantity_json(v.si, v.dimension)))
                        .collect::<serde_json::Map<_, _>>(),
                    "parameters": quantities.collect::<serde_json::Map<_, _>>(),
                    "model": case.model,
                    "study": case.values.to_json(),
                    "method": { "kind": case.method.name, "options": case.method.options },
                }));
            }
        }
        json!({
            "schema": VERSION,
            "name": self.name,
            "title": self.title,
            "source": self.source,
            "kind": self.kind.name,
            "file": self.text,
            "set": self.overrides.iter().map(|(name, text)| json!([name, text])).collect::<Vec<_>>(),
            "replaced": self.replaced.iter().map(|r| json!({ "parameter": r.name, "value": r.text, "values_in_file": r.values }))
                .collect::<Vec<_>>(),
            "number_of_cases": self.cases(),
            "seed": self.seed(),
            "matrices": self.matrices_checksum(),
            "data": self.data.iter().map(|data| json!({ "name": data.name, "file": data.file, "crc": data.checksum() }))
                .collect::<Vec<_>>(),
            "units": self.written_units(),
            "cases": cases,
        })
    }

    // ------------------------------------------------------------------------------ one case

    /// Checks all cases. The first one is assembled; the others differ from it only in numbers.
    pub(crate) fn check(&self) -> Result<(), StudyError> {
        if self.is_adaptive() && !self.kind.adapts {
            let message = format!("a study of kind `{}` needs a fixed number of frequencies", self.kind.name);
            let help =
                "write { from = …, to = …, points = … }; only kind = \"response\" accepts a tolerance".to_owned();
            return Err(self.error_at("study", 0, "frequency", message, Some(help)));
        }
        let mut sectors = None;
        for index in 0..self.cases() {
            let mut problems = Vec::new();
            let parts = self.resolve_with_case_name(index, CheckScope::First, &mut problems);
            if let Some(found) = parts.and_then(|parts| parts.model.ring).map(|ring| ring.sectors)
                && *sectors.get_or_insert(found) != found
            {
                let message = "the number of sectors differs between cases, but the columns of the results are named \
                    after the sectors";
                let location =
                    self.structure.lists.disk.as_ref().map(|disk| disk.table.location_of("sectors", None).clone());
                let problem = Problem::new(&location.unwrap_or_default(), "sectors", message);
                return Err(StudyError::at_location(
                    &self.sources,
                    problem.help("write one study for each number of sectors"),
                ));
            }
            if let Some(error) = StudyError::from_problems(&self.sources, problems) {
                return Err(error);
            }
        }
        Ok(())
    }

    fn resolve_with_case_name(
        &self,
        index: usize,
        look: CheckScope<'_>,
        problems: &mut Vec<Problem>,
    ) -> Option<ResolvedCase> {
        let parts = self.resolve(index, look, problems);
        if !problems.is_empty() && self.cases() > 1 {
            // a problem of both the first and the last case does not depend on the case
            let mut others = Vec::new();
            if index == 0 {
                self.resolve(self.cases() - 1, look, &mut others);
            }
            for problem in problems.iter_mut().filter(|problem| !others.contains(problem)) {
                problem.message = format!("{} ({})", problem.message, self.case_words(index));
                if problem.help.is_none() && self.sample.is_some() {
                    problem.help = Some(INVALID_DRAW_HELP.to_owned());
                }
            }
        }
        parts
    }

    /// Describes a case with its number: `N = 0 N, case 1 of 8`.
    pub(crate) fn case_words(&self, index: usize) -> String {
        let choice = self.value_indices(index);
        let words = match evaluate(&self.names, &self.parameters, &self.order, &choice, &[]) {
            Ok(environment) => varied_text(&self.varied_of(&environment, &choice)),
            // without values: the texts of the file
            Err(_) => {
                let words = self.varied.iter().filter_map(|varied| match (&varied.points, choice.get(&varied.index)) {
                    (ParameterValues::List(list), Some((_, point))) => {
                        Some(format!("{} = {}", self.names[varied.index], excerpt(list[*point].text.trim())))
                    }
                    _ => None,
                });
                words.collect::<Vec<_>>().join(", ")
            }
        };
        let number = format!("case {} of {}", index + 1, self.cases());
        if words.is_empty() { number } else { format!("{words}, {number}") }
    }

    /// Returns the index of the point of every varied parameter in a case.
    fn value_indices(&self, index: usize) -> HashMap<usize, (&VariedParameter, usize)> {
        let mut remainder = index;
        let mut choice = HashMap::new();
        for varied in self.vary_parameters().rev() {
            choice.insert(varied.index, (varied, remainder % varied.points.len()));
            remainder /= varied.points.len();
        }
        // all drawn parameters belong to the same draw
        let drawn = self.varied.iter().filter(|varied| varied.points.is_drawn());
        choice.extend(drawn.map(|varied| (varied.index, (varied, remainder))));
        choice
    }

    fn varied_of(
        &self,
        environment: &[ExpressionValue],
        choice: &HashMap<usize, (&VariedParameter, usize)>,
    ) -> Vec<VariedValue> {
        let values = self.varied.iter().map(|varied| {
            let name = self.names[varied.index].clone();
            let value = environment[varied.index];
            let literal = match &varied.points {
                ParameterValues::List(list) => choice.get(&varied.index).and_then(|(_, point)| list.get(*point)),
                ParameterValues::Range { .. } | ParameterValues::Drawn(_) => None,
            };
            let unit = self.written_unit(varied).filter(|(_, dimension)| value.dimension == Some(*dimension));
            let unit = unit.map(|(unit, _)| unit);
            // the user's text, if it is a number with a unit
            let text = match literal.filter(|q| q.text_start.is_some() && q.expression.is_literal()) {
                Some(quantity)
                    if quantity.text.contains(|c: char| c == '%' || (c.is_alphabetic() && c != 'e' && c != 'E')) =>
                {
                    quantity.text.trim().to_owned()
                }
                _ => match unit.as_deref().and_then(|unit| Some((unit, units::parse(unit)?))) {
                    Some((name, unit)) => format!("{} {name}", quantity_text(value.si / unit.si_value("1"), None)),
                    None => quantity_text(value.si, value.dimension),
                },
            };
            VariedValue { text: format!("{name} = {text}"), name, si: value.si, dimension: value.dimension, unit }
        });
        values.collect()
    }

    /// Returns the unit of the values of a varied parameter, or else of the parameter, with its
    /// dimension.
    fn written_unit(&self, varied: &VariedParameter) -> Option<(String, Dimension)> {
        let own = &self.parameters[varied.index].quantity;
        let mut all = varied.points.quantities().chain([own]);
        all.find_map(literal_unit).map(|(unit, _, dimension)| (unit.to_owned(), dimension))
    }

    /// Returns the units of the file for the table columns that are in SI, by column.
    fn written_units(&self) -> serde_json::Map<String, Json> {
        let varied = self.varied_values(0).unwrap_or_default();
        let varied_units = varied.iter().filter_map(|value| Some((value.column().0, Json::from(value.unit.clone()?))));
        let frequency = self.study.entry("frequency").and_then(|entry| match &entry.value {
            CompiledValue::List(list, _) => list.first(),
            CompiledValue::Range { from, .. } | CompiledValue::Adaptive { from, .. } => Some(from),
            _ => None,
        });
        let frequency_unit =
            frequency.and_then(literal_unit).map(|(unit, ..)| ("frequency_Hz".to_owned(), Json::from(unit)));
        varied_units.chain(frequency_unit).collect()
    }

    fn resolve(&self, index: usize, look: CheckScope<'_>, problems: &mut Vec<Problem>) -> Option<ResolvedCase> {
        let (first_look, fixed) = match look {
            CheckScope::First => (index == 0, &[][..]),
            CheckScope::NumbersOnly(fixed) => (false, fixed),
        };
        let choice = self.value_indices(index);
        let values = match evaluate(&self.names, &self.parameters, &self.order, &choice, fixed) {
            Ok(values) => values,
            Err(problem) => {
                let template = self.structure.template.as_ref().map(|template| template.source);
                problems.push(template_errors::locate_at_user_value(
                    problem,
                    template,
                    &self.names,
                    &stated_parameters(&self.parameters, &choice),
                ));
                return None;
            }
        };
        let environment = Environment { names: &self.names, parameters: &self.parameters, values };
        let reevaluate = |changed: &[(usize, f64)]| {
            let fixed: Vec<_> = fixed.iter().chain(changed).copied().collect();
            evaluate(&self.names, &self.parameters, &self.order, &choice, &fixed)
        };
        let mut model = case_model(&self.structure, &environment, &reevaluate, problems);
        let values = self.study.values(&environment, problems);
        let method = self.method.values(&environment, problems);
        substructure::set_frequency_range(&mut model, &values, &method);
        if !problems.is_empty() {
            return None;
        }
        if (first_look || !numbers_in_range(&model))
            && let Err(error) = self.assembled.system(&model)
        {
            problems.push(self.model_problem(&error, &model));
            return None;
        }
        let lowest = values.frequencies("frequency").and_then(Frequencies::lowest);
        if let Some(complaint) = lowest.and_then(|omega| too_slow(&model, omega)) {
            problems.push(self.key_problem(complaint));
            return None;
        }
        let highest = values.frequencies("frequency").and_then(Frequencies::highest);
        let unseen = lowest.and_then(|omega| overstiff_element(&model, omega));
        if let Some(error) = unseen.or_else(|| highest.and_then(|omega| too_soft(&model, omega))) {
            problems.push(self.model_problem(&error, &model));
            return None;
        }
        if let Err(complaint) = (self.kind.check)(&values, &model, self.values_per_curve()) {
            problems.push(self.key_problem(complaint));
            return None;
        }
        if first_look && let Err(complaint) = figure::check(&self.figure_values(), &self.axis_dimensions(), &model) {
            let location = self.figure.location_of(complaint.key, complaint.name.as_deref());
            problems.push(Problem::new(location, complaint.key, complaint.message).maybe_help(complaint.help));
            return None;
        }
        Some(ResolvedCase { environment: environment.values, model, values, method })
    }

    fn finish_case(&self, index: usize, parts: ResolvedCase) -> Case {
        let ResolvedCase { environment, model, values, method } = parts;
        let varied = self.varied_of(&environment, &self.value_indices(index));
        let parameters = self
            .names
            .iter()
            .zip(&environment)
            .map(|(name, value)| (name.clone(), (value.si, value.dimension)))
            .collect();
        let options = method.entries.iter().filter_map(|(key, given)| match given {
            ResolvedValue::Quantity(value, _) => Some(((*key).to_owned(), *value)),
            ResolvedValue::Count(count) => Some(((*key).to_owned(), *count as f64)),
            _ => None,
        });
        let method =
            MethodChoice { name: method.text("kind").unwrap_or("auto").to_owned(), options: options.collect() };
        let frequencies = values.frequencies("frequency").cloned();
        let records = self.structure.lists.records().len();
        let is_torsional = self.is_torsional();
        let sets = self.structure.mesh.sets.clone();
        Case { index, varied, parameters, model, values, frequencies, method, records, is_torsional, sets }
    }

    /// Returns name and dimensions of the axes of the kind's figure.
    fn axis_dimensions(&self) -> figure::AxisDimensions {
        let turned = |axis: Option<Dimension>| if self.is_torsional() { axis.map(of_rotation) } else { axis };
        figure::AxisDimensions { kind: self.kind.name, axes: self.kind.axes.map(turned) }
    }

    fn model_problem(&self, error: &ModelError, model: &Model) -> Problem {
        match model.ring {
            // element numbers of the file: those of one sector
            Some(ring) => {
                let element = ring.in_sector(error.element, model);
                model_problem(&self.structure, &ModelError { element, ..error.clone() }, model)
            }
            None => model_problem(&self.structure, error, model),
        }
    }

    fn key_problem(&self, complaint: KeyError) -> Problem {
        let location = self.study.location_of(complaint.key, complaint.name.as_deref());
        Problem::new(location, complaint.key, complaint.message).maybe_help(complaint.help)
    }
}

/// Extent of the check of a case.
#[derive(Debug, Clone, Copy)]
enum CheckScope<'a> {
    /// First check: the first case is assembled and the figure is checked. The other cases
    /// differ only in numbers.
    First,
    /// Later: only the numbers are checked. Some parameters may have other values.
    NumbersOnly(&'a [(usize, f64)]),
}

struct ResolvedCase {
    environment: Vec<ExpressionValue>,
    model: Model,
    values: Values,
    method: Values,
}

/// Evaluates all parameters with the chosen points of the varied ones. Parameters in `fixed`
/// have the given value (SI) instead.
pub(crate) fn evaluate(
    names: &[String],
    parameters: &[Parameter],
    order: &[usize],
    choice: &HashMap<usize, (&VariedParameter, usize)>,
    fixed: &[(usize, f64)],
) -> Result<Vec<ExpressionValue>, Problem> {
    let unknown = vec![ExpressionValue::bare(f64::NAN); parameters.len()];
    let mut environment = Environment { names, parameters, values: unknown };
    for &index in order {
        let (parameter, name) = (&parameters[index], &names[index]);
        let dimension = parameter.dimension;
        let value = match choice.get(&index).map(|(varied, point)| (&varied.points, *point)) {
            None => parameter.quantity.parameter_value(name, dimension, &environment)?,
            Some((ParameterValues::List(list), point)) => list[point].parameter_value(name, dimension, &environment)?,
            Some((ParameterValues::Drawn(drawn), point)) => drawn.value(name, dimension, point, &environment)?,
            Some((ParameterValues::Range { from, to, points, scale }, point)) => {
                let start = from.value("from", &environment)?;
                let end = to.value("to", &environment)?;
                let dimension = dimension.or(start.dimension).or(end.dimension);
                let start = from.convert_parameter(start, name, dimension, &environment)?;
                let end = to.convert_parameter(end, name, dimension, &environment)?;
                check_range(start.si, end.si, to, dimension)?;
                let si = match scale {
                    RangeScale::Linear => range_point(start.si, end.si, dimension, point, *points),
                    RangeScale::Log => {
                        check_positive(start.si, from, dimension)?;
                        log_range_point([start.si, end.si], point, *points)
                    }
                };
                ExpressionValue { si, ..start }
            }
        };
        environment.values[index] = match fixed.iter().rfind(|(parameter, _)| *parameter == index) {
            Some((_, si)) => ExpressionValue { si: *si, ..value },
            None => value,
        };
    }
    Ok(environment.values)
}

/// Returns the parameters as stated, with the chosen points of the varied ones.
pub(crate) fn stated_parameters<'a>(
    parameters: &'a [Parameter],
    choice: &HashMap<usize, (&'a VariedParameter, usize)>,
) -> Vec<template_errors::StatedValue<'a>> {
    let from_quantity = |quantity: &'a CompiledQuantity| {
        let CompiledQuantity { text, location, expression, .. } = quantity;
        template_errors::StatedValue { text, location, expression: Some(expression) }
    };
    let one = |(index, parameter): (usize, &'a Parameter)| match choice.get(&index) {
        None => from_quantity(&parameter.quantity),
        Some((VariedParameter { points: ParameterValues::List(list), .. }, point)) => from_quantity(&list[*point]),
        Some((varied, _)) => {
            template_errors::StatedValue { text: "one of its values", location: &varied.location, expression: None }
        }
    };
    parameters.iter().enumerate().map(one).collect()
}

/// Builds the model that the lists state, or the ring of the sector that they state. `again`
/// evaluates the parameters with some of them changed.
pub(crate) fn case_model(
    structure: &SourceModel,
    environment: &Environment<'_>,
    again: Reevaluate<'_>,
    problems: &mut Vec<Problem>,
) -> Model {
    match &structure.lists.disk {
        Some(disk) => disk::ring_of(structure, disk, environment, again, problems),
        None => {
            let tables = structure.lists.force.iter().chain(&structure.lists.motion);
            tables.for_each(|table| refuse_without_disk(table, problems));
            build_model(structure, environment, problems).0
        }
    }
}

/// Returns whether the numbers of a model are in their ranges. Its names are the same in every
/// case.
fn numbers_in_range(model: &Model) -> bool {
    let not_negative = |value: f64| value.is_finite() && value >= 0.0;
    model.masses.iter().all(|mass| not_negative(mass.mass))
        && model.bodies.iter().all(|body| body.is_valid())
        && model.springs.iter().all(|spring| not_negative(spring.stiffness) && spring.damping.is_finite())
        && model.joints.iter().all(|joint| joint.law.check().is_ok())
        && model.forces.iter().all(|force| force.amplitude.is_finite() && force.phase.is_finite())
        && model.motions.iter().all(|motion| motion.amplitude.is_finite() && motion.phase.is_finite())
}
