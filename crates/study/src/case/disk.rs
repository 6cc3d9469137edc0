//! `[disk]`: the ring of a model that states one sector, tuned or mistuned.

use crate::case::model_builder::{build_model, whole_number};
use crate::case::values::Values;
use crate::compile::compiled::{CompiledTable, CompiledValue, Environment};
use crate::compile::source_model::{DiskSource, SourceModel, model_problem};
use crate::syntax::error::Problem;
use crate::syntax::expression::ExpressionValue;
use crate::syntax::key::MAX_MASSES;
use crate::syntax::suggest::{excerpt, suggest};
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use stickslip::model::{
    Disk, DiskPart, Element, MIN_SECTORS, MistunedProperty, Model, NEXT, deviation_error, normal_deviations,
};
use stickslip::structure::{Boundary, Component, CoordinateAxis, FacesError, NodeCoordinates, Reduction, SectorFaces};

/// The quantity that differs from sector to sector.
enum MistunedQuantity {
    /// A parameter, by index.
    Parameter(usize),
    /// A part of the sector.
    Part(MistunedProperty),
}

/// Quantities of a blade given by matrices that may deviate.
const BLADE_QUANTITIES: [(&str, MistunedProperty); 2] =
    [("blade.stiffness", MistunedProperty::BladeStiffness), ("blade.frequency", MistunedProperty::BladeFrequency)];

/// Evaluates the parameters with some of them changed: (index, value in SI).
pub(crate) type Reevaluate<'a> = &'a dyn Fn(&[(usize, f64)]) -> Result<Vec<ExpressionValue>, Problem>;

/// Builds the model of the ring.
pub(crate) fn ring_of(
    structure: &SourceModel,
    disk: &DiskSource,
    environment: &Environment<'_>,
    again: Reevaluate<'_>,
    problems: &mut Vec<Problem>,
) -> Model {
    // Limit on the rows of all sectors of a disk without reduction: matrices of several GB.
    let max_rows: usize = 1_000_000;
    let before = problems.len();
    let (mut first, forces, motions) = build_model(structure, environment, problems);
    let values = disk.table.values(environment, problems);
    if problems.len() > before {
        return first;
    }
    let made = sectors(disk, &values).and_then(|sectors| {
        tie_sectors(structure, disk, sectors, &mut first).map_err(|problem| vec![problem])?;
        let around = Disk { sectors, forces, motions };
        let deviations = deviations(disk, &values, sectors)?;
        let all = match &deviations {
            None => Vec::new(),
            Some(deviations) => mistuned_sectors(structure, disk, environment, again, (&first, deviations))?,
        };
        let most = MAX_MASSES / (first.masses.len() + first.bodies.len()).max(1);
        if sectors > most {
            let message =
                format!("{sectors} sectors of {} masses: the limit is {MAX_MASSES} masses", first.masses.len());
            return Err(vec![Problem::new(disk.table.location_of("sectors", None), "sectors", message)]);
        }
        let rows = first.substructure.as_ref().filter(|own| matches!(own.reduction, Reduction::None { .. }));
        let rows = rows.map_or(0, |own| own.component.dofs());
        if rows * sectors > max_rows {
            let message = format!("{sectors} sectors of {rows} rows: the limit without a reduction is {max_rows} rows");
            let problem = Problem::new(disk.table.location_of("sectors", None), "sectors", message);
            return Err(vec![
                problem.help("remove `reduce = false` from [structure]: all sectors then share one reduced model"),
            ]);
        }
        let ring = around.ring(|s| all.get(s).unwrap_or(&first).clone());
        ring.map_err(|error| {
            vec![if error.element == Element::Whole {
                Problem::new(disk.table.location_of(error.key, None), error.key, error.message.clone())
            } else {
                model_problem(structure, &error, &first)
            }]
        })
    });
    made.unwrap_or_else(|found| {
        problems.extend(found);
        first
    })
}

/// Returns the coordinate axis of this name.
pub(crate) fn coordinate_axis(name: &str) -> Option<CoordinateAxis> {
    [("x", CoordinateAxis::X), ("y", CoordinateAxis::Y), ("z", CoordinateAxis::Z)]
        .into_iter()
        .find_map(|(known, axis)| (known == name).then_some(axis))
}

/// Ties a sector given by matrices to the next sector.
fn tie_sectors(structure: &SourceModel, disk: &DiskSource, sectors: usize, sector: &mut Model) -> Result<(), Problem> {
    let table = &disk.table;
    let problem = |key: &'static str, message: String| Problem::new(table.location_of(key, None), key, message);
    if structure.matrices.is_none() {
        return match ["boundary", "nodes", "axis", "blade"].into_iter().find(|key| table.entry(key).is_some()) {
            Some(key) => Err(problem(
                key,
                format!("`{key}` is only for a sector given by matrices, and the study has no [structure]"),
            )
            .help("connect masses and springs of adjacent sectors by `next.NAME`")),
            None => Ok(()),
        };
    }
    // only names are known
    let touching = nodes_of_joints_across(sector);
    let Some(substructure) = &mut sector.substructure else { return Ok(()) };
    let axis = table.text("axis").and_then(coordinate_axis);
    let component = &substructure.component;
    let pairs = pairs(disk, (component, &touching), axis, sectors)?;
    let boundary =
        Boundary::of_nodes(component.rows(), &pairs, axis).map_err(|error| problem("boundary", error.to_string()))?;
    let nodes = disk.blade.as_deref();
    let blade = blade_rows(component, nodes.unwrap_or_default());
    let blade =
        blade.map_err(|node| problem("blade", format!("the structure has no rows of node `{}`", excerpt(node))))?;
    if nodes.is_some() && blade.is_empty() {
        let help = "list all nodes of the blade, without the nodes of the disk";
        return Err(problem("blade", "the file contains no node".to_owned()).help(help));
    }
    let shared: HashSet<usize> = boundary.low_rows().chain(boundary.high_rows()).collect();
    if let Some(row) = blade.iter().find(|row| shared.contains(*row)) {
        let message = format!(
            "row `{}` of the blade is on the boundary of the sector, so it would belong to two blades",
            excerpt(&component.rows()[*row])
        );
        return Err(problem("blade", message).help("remove the nodes that `boundary` lists"));
    }
    substructure.disk = Some(DiskPart { boundary, blade, deviations: Vec::new(), basis: None });
    Ok(())
}

/// Returns the nodes at both ends of the joints with the next sector.
fn nodes_of_joints_across(sector: &Model) -> HashSet<String> {
    let Some(substructure) = &sector.substructure else { return HashSet::new() };
    let names = substructure.component.rows();
    let across = sector.joints.iter().filter(|joint| joint.between.iter().any(|end| end.starts_with(NEXT)));
    let ends: HashSet<&str> =
        across.flat_map(|joint| &joint.between).map(|end| end.strip_prefix(NEXT).unwrap_or(end)).collect();
    let places = sector.places.iter().filter(|place| place.view_of.is_none() && ends.contains(place.name.as_str()));
    let rows = places.flat_map(|place| place.rows.iter().flatten());
    rows.filter_map(|(row, _)| Some(names.get(*row)?.rsplit_once('.')?.0.to_owned())).collect()
}

/// Returns the node pairs of both sides of a sector.
///
/// Named pairs are checked against the node coordinates if these are known. Without named
/// pairs, the coordinates determine them. Nodes `touching` the next sector by a joint may coincide
/// with its nodes without being tied to them.
fn pairs<'a>(
    disk: &'a DiskSource,
    (component, touching): (&Component, &HashSet<String>),
    axis: Option<CoordinateAxis>,
    sectors: usize,
) -> Result<Cow<'a, [(String, String)]>, Problem> {
    let table = &disk.table;
    let problem = |key: &'static str, message: String| Problem::new(table.location_of(key, None), key, message);
    let Some(nodes) = &disk.nodes else {
        return disk.boundary.as_deref().map(Cow::from).ok_or_else(|| {
            let message = "a sector given by matrices needs `boundary`: the node pairs of its low and high side";
            problem("boundary", message.to_owned()).help(
                "write axis = \"z\" and either boundary = \"pairs.csv\", a file with the columns low,high, or \
                 nodes = \"sector.inp\", which determines the pairs",
            )
        });
    };
    let Some(axis) = axis else {
        let message = "`nodes` needs `axis` to find the sides of the sector by rotation";
        return Err(problem("nodes", message.to_owned()).help("add axis = \"z\", or remove `nodes`"));
    };
    // a fixed node or a centre of rotation has no rows and cannot be tied
    let moving = component.rows().iter().filter_map(|row| Some(row.rsplit_once('.')?.0));
    let moving = moving.filter(|node| !touching.contains(*node));
    let named = disk.boundary.iter().flatten().flat_map(|(low, high)| [low.as_str(), high.as_str()]);
    let counts: HashSet<&str> = moving.chain(named).collect();
    let missing: Vec<NodeCoordinates> =
        nodes.iter().filter(|(name, _)| counts.contains(name.as_str())).cloned().collect();
    let faces = SectorFaces::new(&missing, axis, sectors);
    let key = if disk.boundary.is_some() { "boundary" } else { "nodes" };
    let found = match &disk.boundary {
        Some(named) => faces.check(named).map(|()| Cow::from(named.as_slice())),
        None => faces.pairs().map(Cow::from),
    };
    found.map_err(|error| {
        let help = match &error {
            FacesError::Unknown(_) => "add every node of both sides to the file `nodes`",
            FacesError::Missing { .. } => "add the pair, or remove `boundary`; `nodes` then determines the pairs",
            FacesError::Apart { .. } | FacesError::None { .. } => {
                "correct the pairs, `axis` or `sectors`; without `boundary`, `nodes` determines the pairs"
            }
        };
        problem(key, error.to_string()).help(help)
    })
}

/// Returns the rows of these nodes, or the first node without rows as the error.
fn blade_rows<'a>(component: &Component, nodes: &'a [String]) -> Result<Vec<usize>, &'a str> {
    let mut met: HashMap<&str, bool> = nodes.iter().map(|node| (node.as_str(), false)).collect();
    let mut rows = Vec::new();
    for (row, name) in component.rows().iter().enumerate() {
        if let Some(met) = name.rsplit_once('.').and_then(|(node, _)| met.get_mut(node)) {
            *met = true;
            rows.push(row);
        }
    }
    nodes.iter().find(|node| !met[node.as_str()]).map_or(Ok(rows), |node| Err(node))
}

fn sectors(disk: &DiskSource, values: &Values) -> Result<usize, Vec<Problem>> {
    let sectors = whole_number(&disk.table, values, "sectors").map_err(|problem| vec![problem])?.unwrap_or(0);
    usize::try_from(sectors).ok().filter(|sectors| *sectors >= MIN_SECTORS).ok_or_else(|| {
        let message = format!("a disk needs at least {MIN_SECTORS} sectors, found {sectors}");
        vec![Problem::new(disk.table.location_of("sectors", None), "sectors", message)]
    })
}

/// Returns the deviation of every sector; `None` for a tuned disk.
fn deviations(disk: &DiskSource, values: &Values, sectors: usize) -> Result<Option<Vec<f64>>, Vec<Problem>> {
    let Some((table, mistuning)) = mistuning(disk, values) else { return Ok(None) };
    if let Some(pattern) = &disk.pattern {
        if pattern.len() != sectors {
            let message = format!("the pattern has {} sectors, but the disk has {sectors}", pattern.len());
            return Err(vec![Problem::new(table.location_of("file", None), "file", message)]);
        }
        return Ok(Some(pattern.clone()));
    }
    let seed = whole_number(table, mistuning, "seed").map_err(|problem| vec![problem])?.unwrap_or(0);
    let deviation = mistuning.quantity("deviation").unwrap_or(0.0);
    Ok(Some(normal_deviations(sectors, deviation, seed as u64)))
}

fn mistuning<'a>(disk: &'a DiskSource, values: &'a Values) -> Option<(&'a CompiledTable, &'a Values)> {
    let CompiledValue::Table(table) = &disk.table.entry("mistuning")?.value else { return None };
    Some((table, values.table("mistuning")?))
}

/// Returns the sectors, each with its deviation.
fn mistuned_sectors(
    structure: &SourceModel,
    disk: &DiskSource,
    environment: &Environment<'_>,
    again: Reevaluate<'_>,
    (first, deviations): (&Model, &[f64]),
) -> Result<Vec<Model>, Vec<Problem>> {
    let Some(CompiledValue::Table(table)) = disk.table.entry("mistuning").map(|entry| &entry.value) else {
        return Ok(Vec::new());
    };
    let quantity = mistuned_quantity(disk, table, environment, first).map_err(|problem| vec![problem])?;
    if let Some(message) = deviation_error(deviations) {
        let key = if disk.pattern.is_some() { "file" } else { "deviation" };
        let problem = Problem::new(table.location_of(key, None), key, message);
        return Err(vec![problem.help("write deviations as fractions or in percent: 0.02 is 2 %")]);
    }
    let mut models = Vec::with_capacity(deviations.len());
    for (sector, deviation) in deviations.iter().enumerate() {
        models.push(match &quantity {
            MistunedQuantity::Part(part) => part.apply(first, *deviation),
            MistunedQuantity::Parameter(index) => {
                let changed = environment.values[*index].si * (1.0 + deviation);
                let values = again(&[(*index, changed)]).map_err(|problem| vec![problem])?;
                let mut problems = Vec::new();
                let changed = Environment { values, ..*environment };
                let (model, ..) = build_model(structure, &changed, &mut problems);
                if !problems.is_empty() {
                    problems.iter_mut().for_each(|problem| problem.message += &format!(" (sector {sector})"));
                    return Err(problems);
                }
                let mut model = model;
                if let Some((own, first)) = model.substructure.as_mut().zip(first.substructure.as_ref()) {
                    own.disk.clone_from(&first.disk);
                }
                if model.substructure != first.substructure || model.places != first.places {
                    let name = &environment.names[*index];
                    let message = format!(
                        "[structure] or a [[place]] depends on `{name}`, but both must be the same in all sectors"
                    );
                    let problem = Problem::new(table.location_of("of", None), "of", message);
                    return Err(vec![
                        problem.help("to mistune blades given by matrices, write of = \"blade.frequency\""),
                    ]);
                }
                model
            }
        });
    }
    Ok(models)
}

/// Finds the quantity that `of` names.
fn mistuned_quantity(
    disk: &DiskSource,
    table: &CompiledTable,
    environment: &Environment<'_>,
    sector: &Model,
) -> Result<MistunedQuantity, Problem> {
    let names = match table.entry("of").map(|entry| &entry.value) {
        Some(CompiledValue::Names(names)) => names.iter().map(|(name, _)| name.clone()).collect(),
        _ => Vec::new(),
    };
    let place = table.location_of("of", None);
    match &names[..] {
        [name] => {
            if let Some((_, part)) = BLADE_QUANTITIES.into_iter().find(|(known, _)| known == name) {
                if disk.table.entry("blade").is_some() {
                    return Ok(MistunedQuantity::Part(part));
                }
                let message = format!("`{name}` needs the nodes of the blade");
                let help = "add blade = \"blade_nodes.csv\" to [disk], a file with the column node";
                return Err(Problem::new(place, "of", message).help(help));
            }
            if let Some(index) = environment.names.iter().position(|known| known == name) {
                return Ok(MistunedQuantity::Parameter(index));
            }
            let mass = MistunedProperty::Mass(name.clone());
            if mass.is_in(sector) {
                return Ok(MistunedQuantity::Part(mass));
            }
            let known = environment.names.iter().chain(sector.masses.iter().map(|mass| &mass.name));
            let help = match suggest(name, known.map(String::as_str)) {
                Some(near) => format!("did you mean `{near}`?"),
                None => {
                    "name a parameter of [parameters], a mass, or the two ends of a spring: [\"blade\", \"ground\"]"
                        .into()
                }
            };
            Err(Problem::new(place, "of", format!("there is no parameter or mass `{}`", excerpt(name))).help(help))
        }
        [a, b] => {
            let spring = MistunedProperty::Spring([a.clone(), b.clone()]);
            if spring.is_in(sector) {
                return Ok(MistunedQuantity::Part(spring));
            }
            let message = format!("there is no spring between `{}` and `{}`", excerpt(a), excerpt(b));
            Err(Problem::new(place, "of", message).help("write the ends as in [[spring]]"))
        }
        _ => Err(Problem::new(place, "of", "expected one name, or the two ends of a spring")),
    }
}
