//! The statement of a model: its lists, files and template, and the location of a model error
//! in them.

use crate::case::names::ModelNames;
use crate::case::stress_stiffening::StressStiffening;
use crate::case::values::ResolvedValue;
use crate::compile::compiled::{CompiledTable, CompiledValue};
use crate::compile::mesh::MeshUse;
use crate::syntax::error::{Location, Problem};
use crate::syntax::expression::quantity_text;
use crate::syntax::suggest::{alternatives, suggest};
use std::collections::BTreeSet;
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::model::{Element, Model, ModelError, NEXT, ROTATIONS};
use stickslip::structure::{Component, NodeCoordinates, Reduction, ReductionKind};
use stickslip_numerics::sparse::SparseMatrix;

/// The statement of a model: lists of the study file or of a template, and matrices.
#[derive(Debug, Clone)]
pub(crate) struct SourceModel {
    pub lists: ModelLists,
    pub template: Option<TemplateSource>,
    pub matrices: Option<MatrixSource>,
    pub mesh: MeshUse,
}

/// Stresses from the displacements of a structure.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StressMatrix {
    /// Names of the stresses.
    pub names: Vec<String>,
    /// For each stress the rows of the structure and their weights, Pa/m.
    pub rows: Vec<Vec<(usize, f64)>>,
}

/// `[structure]`, with the contents of its files.
#[derive(Debug, Clone)]
pub(crate) struct MatrixSource {
    pub table: CompiledTable,
    /// The structure; `None` if the files were not read.
    pub component: Option<Component>,
    /// The stiffness that rotation adds.
    pub stress_stiffening: Option<StressStiffening>,
    /// Number of constrained rows in the files, which the component does not contain.
    pub constrained_rows: usize,
    /// The matrix of stresses, if one is named.
    pub stress: Option<Arc<StressMatrix>>,
}

impl MatrixSource {
    /// Returns whether `model` rotates at a speed that changes its stiffness.
    fn is_stiffened(&self, model: &Model) -> bool {
        let (own, of_model) = (self.component.as_ref(), model.substructure.as_ref().map(|own| &own.component));
        own.zip(of_model).is_some_and(|(own, of_model)| own.matrices().2 != of_model.matrices().2)
    }

    /// Returns a CRC-32 of the names of rows and of all entries. It detects files that changed
    /// between two runs.
    pub fn checksum(&self) -> Option<String> {
        let component = self.component.as_ref()?;
        let mut hasher = crc32fast::Hasher::new();
        component.rows().iter().for_each(|name| hasher.update(name.as_bytes()));
        let (mass, damping, stiffness) = component.matrices();
        let more = self.stress_stiffening.as_ref().map(StressStiffening::difference);
        for (number, matrix) in [Some(mass), damping, Some(stiffness), more].into_iter().enumerate() {
            for (row, column, value) in matrix.into_iter().flat_map(SparseMatrix::entries) {
                let place = [number, row, column].map(|index| index as u64);
                place.iter().for_each(|index| hasher.update(&index.to_le_bytes()));
                hasher.update(&value.to_le_bytes());
            }
        }
        for (name, weights) in self.stress.iter().flat_map(|stress| stress.names.iter().zip(&stress.rows)) {
            hasher.update(name.as_bytes());
            for (row, weight) in weights {
                hasher.update(&(*row as u64).to_le_bytes());
                hasher.update(&weight.to_le_bytes());
            }
        }
        Some(format!("{:08x}", hasher.finalize()))
    }
}

/// The template that a study names.
#[derive(Debug, Clone)]
pub(crate) struct TemplateSource {
    /// The table `[model]`.
    pub table: CompiledTable,
    /// Index of the template's file in the sources.
    pub source: usize,
    /// For every parameter: the names of the parameters that the study sets and that it depends
    /// on, itself included.
    pub given: Vec<Vec<String>>,
}

impl TemplateSource {
    /// Rewords a problem in the template's file for a user who has not written that file. The
    /// location becomes that of the template's name in the study.
    pub fn reword(&self, element: Element, table: &CompiledTable, problem: &mut Problem) {
        if problem.location.source == self.source {
            problem.message = self.describe_error(element, Some(table), &problem.key, &problem.message);
            problem.location = self.table.location_of("template", None).clone();
        }
    }

    /// Describes an error of an element, with the parameters on which its key `key` depends.
    fn describe_error(&self, element: Element, table: Option<&CompiledTable>, key: &str, message: &str) -> String {
        let (mut own, mut all) = (BTreeSet::new(), BTreeSet::new());
        if let Some(table) = table {
            table.each_quantity(&mut |of, quantity, _| {
                let template_parameters =
                    quantity.expression.parameters().filter_map(|index| self.given.get(index)).flatten();
                let names: Vec<String> = template_parameters.map(|name| format!("`{name}`")).collect();
                own.extend(names.iter().filter(|_| of == key).cloned());
                all.extend(names);
            });
        }
        let names: Vec<String> = if own.is_empty() { all } else { own }.into_iter().collect();
        let owner = match &names[..] {
            [] => "with these parameters,".to_owned(),
            [one] => format!("with this value of {one},"),
            several => format!("with these values of {},", several.join(", ")),
        };
        format!("{owner} {element} of the template is invalid: `{key}` {message}")
    }
}

#[derive(Debug, Clone, Default)]
pub(crate) struct ModelLists {
    pub place: Vec<CompiledTable>,
    pub mass: Vec<CompiledTable>,
    pub body: Vec<CompiledTable>,
    pub spring: Vec<CompiledTable>,
    pub joint: Vec<CompiledTable>,
    pub force: Vec<CompiledTable>,
    pub motion: Vec<CompiledTable>,
    /// The contacts of a mesh, until they become places and joints.
    pub contact: Vec<CompiledTable>,
    /// `[disk]`; then the lists state one sector.
    pub disk: Option<DiskSource>,
    /// True for a model of rotation, whose masses are moments of inertia.
    pub is_torsional: bool,
}

impl ModelLists {
    pub fn get_mut(&mut self, name: &str) -> Option<&mut Vec<CompiledTable>> {
        match name {
            "place" => Some(&mut self.place),
            "mass" => Some(&mut self.mass),
            "body" => Some(&mut self.body),
            "spring" => Some(&mut self.spring),
            "joint" => Some(&mut self.joint),
            "force" => Some(&mut self.force),
            "motion" => Some(&mut self.motion),
            "contact" => Some(&mut self.contact),
            _ => None,
        }
    }

    /// Returns the entries of forces and motions that have a time history: list and
    /// number.
    pub fn records(&self) -> Vec<(&'static str, usize)> {
        let of = |list: &'static str, tables: &[CompiledTable]| {
            let has = |(index, table): (usize, &CompiledTable)| table.has_time_history().then_some((list, index));
            tables.iter().enumerate().filter_map(has).collect::<Vec<_>>()
        };
        [of("force", &self.force), of("motion", &self.motion)].concat()
    }

    /// Returns all lists, in order.
    pub fn all(&self) -> [&Vec<CompiledTable>; 7] {
        [&self.place, &self.mass, &self.body, &self.spring, &self.joint, &self.force, &self.motion]
    }

    /// Gives quantities at rotations of bodies the dimensions of moments and angles.
    pub fn use_rotation_dimensions(&mut self) {
        let bodies: BTreeSet<String> = self.body.iter().filter_map(|table| table.name().map(str::to_owned)).collect();
        let turns = |place: &str| {
            let split = place.strip_prefix(NEXT).unwrap_or(place).split_once('.');
            split.is_some_and(|(body, along)| ROTATIONS.contains(&along) && bodies.contains(body))
        };
        for table in self.spring.iter_mut().chain(&mut self.force).chain(&mut self.motion) {
            let turned = table.entries.iter().any(|entry| match &entry.value {
                CompiledValue::Fixed(ResolvedValue::Text(name)) => entry.key == "on" && turns(name),
                CompiledValue::Names(names) => names.iter().any(|(name, _)| turns(name)),
                _ => false,
            });
            for entry in table.entries.iter_mut().filter(|_| turned) {
                if let CompiledValue::Quantity { dimension, example, .. } = &mut entry.value
                    && let Some(of_rotation) = ROTATION_DIMENSIONS.iter().find(|row| row.displacement == *dimension)
                {
                    (*dimension, *example) = (of_rotation.rotation, of_rotation.example);
                }
            }
        }
    }

    pub fn get(&self, name: &str) -> &[CompiledTable] {
        match name {
            "place" => &self.place,
            "mass" => &self.mass,
            "body" => &self.body,
            "spring" => &self.spring,
            "joint" => &self.joint,
            "force" => &self.force,
            "motion" => &self.motion,
            _ => &[],
        }
    }
}

/// Dimensions of one quantity for a displacement and for a rotation.
struct RotationDimension {
    displacement: Dimension,
    rotation: Dimension,
    example: &'static str,
}

/// The pairs of dimensions.
const ROTATION_DIMENSIONS: [RotationDimension; 4] = [
    RotationDimension { displacement: Dimension::LENGTH, rotation: Dimension::ANGLE, example: "\"0.1 deg\"" },
    RotationDimension { displacement: Dimension::FORCE, rotation: Dimension::ENERGY, example: "\"2 N m\"" },
    RotationDimension {
        displacement: Dimension::STIFFNESS,
        rotation: Dimension::ANGULAR_STIFFNESS,
        example: "\"500 N m/rad\"",
    },
    RotationDimension {
        displacement: Dimension::DAMPING,
        rotation: Dimension::ANGULAR_DAMPING,
        example: "\"0.01 N m s/rad\"",
    },
];

/// `[disk]` as it is stated.
#[derive(Debug, Clone)]
pub(crate) struct DiskSource {
    pub table: CompiledTable,
    /// The deviations in the pattern file.
    pub pattern: Option<Vec<f64>>,
    /// Pairs of nodes on the low and the high side of a sector given by matrices.
    pub boundary: Option<Vec<(String, String)>>,
    /// Coordinates of its nodes.
    pub nodes: Option<Vec<NodeCoordinates>>,
    /// Names of the nodes of its blade.
    pub blade: Option<Vec<String>>,
}

impl DiskSource {
    /// Returns the index of the parameter that differs from sector to sector, if there is one.
    pub fn mistuned_parameter(&self, names: &[String]) -> Option<usize> {
        let CompiledValue::Table(table) = &self.table.entry("mistuning")?.value else { return None };
        match &table.entry("of")?.value {
            CompiledValue::Names(of) if of.len() == 1 => names.iter().position(|name| *name == of[0].0),
            _ => None,
        }
    }
}

/// Converts a model error to a problem at its location in the file. `model` provides the
/// existing names.
pub(crate) fn model_problem(structure: &SourceModel, error: &ModelError, model: &Model) -> Problem {
    let (list, index) = error.element.entry();
    let whole = Location::default();
    // if the export at rest is valid, the error lies in its sum with the second export
    let softened =
        structure.matrices.as_ref().is_some_and(|matrices| error.key == "stiffness" && matrices.is_stiffened(model));
    let key = if softened { "stiffened" } else { error.key };
    let (location, message) = match &structure.template {
        None => {
            let matrices = structure.matrices.as_ref().filter(|_| list == "structure");
            let table =
                matrices.map(|matrices| &matrices.table).or_else(|| structure.lists.get(list).get(index.unwrap_or(0)));
            let location = table.map_or(&whole, |table| table.location_of(key, error.wrong_name.as_deref()));
            let end = missing_frequency_range(model).filter(|_| error.key == "reduce");
            let message = end.map_or(&error.message[..], |(message, _)| message);
            (location, table.map_or_else(|| message.to_owned(), |table| table.with_repetition(message)))
        }
        Some(template) => {
            let location = template.table.location_of(if error.key == "law" { "law" } else { "template" }, None);
            let table = index.and_then(|index| structure.lists.get(list).get(index));
            (location, template.describe_error(error.element, table, error.key, &error.message))
        }
    };
    let places = model.place_names();
    let nodes = ModelNames::places(model);
    let help = match &error.wrong_name {
        Some(wrong) => Some(match (nodes.directions_of(wrong), suggest(wrong, places.iter().map(String::as_str))) {
            (Some(directions), _) => format!("write {}", alternatives(directions.iter().map(String::as_str))),
            (None, Some(near)) => format!("did you mean `{near}`?"),
            (None, None) => {
                format!(
                    "the places are {}",
                    alternatives(places.iter().take(20).map(String::as_str)).replace(" or ", ", ")
                )
            }
        }),
        None if error.element == Element::Whole && model.substructure.is_some() => {
            Some("add a [[place]] with a name and a dof".to_owned())
        }
        None if error.element == Element::Whole => Some("add a [[mass]], a [[body]] or a [[motion]]".to_owned()),
        None if error.key == "reduce" => reduction_advice(model),
        None if softened => Some(
            "lower `speed`: the stiffness at this speed, extrapolated from both files, is not positive definite; or check \
             that the second file has the prestressed stiffness at the speed `at`"
                .to_owned(),
        ),
        None if error.key == "name" => Some("choose another name".to_owned()),
        None => None,
    };
    Problem::new(location, key, message).maybe_help(help)
}

/// Number of lowest frequencies that a message shows if a structure cannot be reduced.
const SHOWN_FREQUENCIES: usize = 3;

/// Returns the message and the help for a structure without any frequency that limits its
/// reduction.
fn missing_frequency_range(model: &Model) -> Option<(&'static str, &'static str)> {
    match model.substructure.as_ref()?.reduction {
        Reduction::UpTo { up_to, .. } if up_to <= 0.0 => Some((
            "the structure must be reduced, but the study has no excitation frequency that defines the frequency \
             range of the reduced model",
            "add to [structure] reduce = { up_to = \"5 kHz\" }, the highest frequency of interest",
        )),
        Reduction::None { up_to } if up_to <= 0.0 => Some((
            "the study has no excitation frequency that defines the frequency range of `modal_damping`",
            "add reduce = { kind = \"none\", up_to = \"5 kHz\" } with the highest frequency of interest",
        )),
        _ => None,
    }
}

/// Returns advice for a structure that cannot be reduced. Mistaken units shift its frequencies
/// by powers of ten.
fn reduction_advice(model: &Model) -> Option<String> {
    let substructure = model.substructure.as_ref()?;
    if let Some((_, help)) = missing_frequency_range(model) {
        return Some(help.to_owned());
    }
    if matches!(substructure.reduction, Reduction::UpTo { kind: Some(ReductionKind::CraigBampton), .. }) {
        return Some(
            "remove `kind`: free modes with residual vectors need fewer coordinates for the same error".to_owned(),
        );
    }
    let component = &substructure.component;
    let lowest = component.frequencies(SHOWN_FREQUENCIES).ok()?;
    let listed: Vec<String> = lowest.iter().map(|omega| quantity_text(*omega, Some(Dimension::FREQUENCY))).collect();
    let absurd = lowest.iter().all(|omega| *omega < MIN_PLAUSIBLE_FREQUENCY);
    let (mass, _, stiffness) = component.matrices();
    let exchanged = || Component::new(component.rows().to_vec(), stiffness.clone(), None, mass.clone()).ok();
    let advice = match absurd.then(exchanged).flatten().as_ref().and_then(plausible_frequencies) {
        Some(frequencies) => exchange_advice(&frequencies),
        None => format!(
            "check the units; `up_to` and `tolerance` of `reduce` set the frequency range and the error; reduce = false \
             keeps all {} rows",
            component.rows().len()
        ),
    };
    Some(format!("its lowest frequencies are {}: {advice}", listed.join(", ")))
}

/// Limits of plausible frequencies of a structure, rad/s.
const MIN_PLAUSIBLE_FREQUENCY: f64 = 1e-3 * std::f64::consts::TAU;

/// Returns the lowest frequencies of a component (rad/s) if they are plausible: one within the
/// limits, none above.
pub(crate) fn plausible_frequencies(component: &Component) -> Option<Vec<f64>> {
    let max_plausible_frequency = 1e8 * std::f64::consts::TAU;
    let lowest = component.frequencies(SHOWN_FREQUENCIES.min(component.dofs())).ok()?;
    let elastic = |omega: &&f64| (MIN_PLAUSIBLE_FREQUENCY..=max_plausible_frequency).contains(*omega);
    (lowest.iter().any(|omega| elastic(&omega)) && lowest.iter().all(|omega| *omega <= max_plausible_frequency))
        .then_some(lowest)
}

/// Returns the advice to exchange the files of stiffness and mass, with the frequencies that
/// result.
pub(crate) fn exchange_advice(frequencies: &[f64]) -> String {
    let listed: Vec<String> =
        frequencies.iter().map(|omega| quantity_text(*omega, Some(Dimension::FREQUENCY))).collect();
    format!(
        "are the files of `stiffness` and `mass` exchanged? With exchanged files the lowest frequencies are {}",
        listed.join(", ")
    )
}
