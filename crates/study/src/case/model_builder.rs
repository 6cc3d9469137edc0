//! Builds the model from the lists of a study: the whole model, or one sector of a disk with
//! its excitation pattern.

use crate::case::substructure::{self, fault_in};
use crate::case::values::Values;
use crate::compile::compiled::{CompiledTable, CompiledValue, Environment};
use crate::compile::frequency_amplitude::FrequencyPolynomial;
use crate::compile::source_model::{ModelLists, SourceModel};
use crate::syntax::error::Problem;
use crate::syntax::key::DAMPING_RATIO;
use std::collections::BTreeMap;
use stickslip::law::{SharedLaw, TANGENTS};
use stickslip::model::{
    Body, Element, Force, FrequencyForce, GROUND, Joint, Mass, Model, Motion, NEXT, ROTATIONS, SectorDistribution,
    Spring, inertia_matrix, with_rotations,
};

/// Returns the places of the structure given by matrices.
fn structure_places(lists: &ModelLists) -> impl Iterator<Item = &CompiledTable> {
    lists.place.iter().filter(|table| table.entry("of").is_none())
}

/// Builds the model that the lists state, and the distribution of its forces and imposed
/// motions over the sectors.
pub(crate) fn build_model(
    structure: &SourceModel,
    environment: &Environment<'_>,
    problems: &mut Vec<Problem>,
) -> (Model, Vec<SectorDistribution>, Vec<SectorDistribution>) {
    let SourceModel { lists, template, matrices, .. } = structure;
    let (mut forces, mut motions, mut wrong) = (Vec::new(), Vec::new(), Vec::new());
    let mut model = Model::default();
    let component = matrices.as_ref().and_then(|matrices| matrices.component.as_ref());
    match (matrices, component) {
        (Some(matrices), Some(component)) => {
            model.substructure = Some(substructure::structure_from_table(matrices, component, environment, problems));
            for table in structure_places(lists) {
                model.places.extend(substructure::place(table, component, environment, problems));
            }
        }
        // the matrices were not read: masses stand in for the places, and only their names
        // count
        (Some(_), None) => {
            let values = structure_places(lists).map(|table| (table, table.values(environment, problems)));
            model.masses.extend(values.map(|(table, values)| substructure::placeholder_mass(table, &values)));
        }
        (None, _) => {
            if let Some(place) = structure_places(lists).next() {
                let message = "this place belongs to a structure, but the study has no [structure]";
                let help = "add [structure] with `stiffness` and `mass`; for a point mass use [[mass]]; for a point \
                    or a face of a [[body]] or [[mass]] add `of` to the place";
                problems.push(Problem::new(&place.location, "place", message).help(help));
            }
        }
    }
    let mut resolve = |element: Element, table: &CompiledTable| {
        let before = problems.len();
        let values = table.values(environment, problems);
        if let Some(template) = template {
            problems[before..].iter_mut().for_each(|problem| template.reword(element, table, problem));
        }
        values
    };
    let text = |values: &Values, key: &str| values.text(key).unwrap_or_default().to_owned();
    let number = |values: &Values, key: &str| values.quantity(key).unwrap_or(0.0);
    let between = |values: &Values| match values.names("between") {
        Some([a, b]) => [a.clone(), b.clone()],
        _ => Default::default(),
    };
    let harmonic = |values: &Values| values.count("harmonic").and_then(|h| u32::try_from(h).ok()).unwrap_or(1);
    for (i, table) in lists.mass.iter().enumerate() {
        let values = resolve(Element::Mass(i), table);
        model.masses.push(Mass {
            name: text(&values, "name"),
            mass: number(&values, "mass"),
            directions: values.names("directions").unwrap_or_default().to_vec(),
        });
    }
    for (i, table) in lists.body.iter().enumerate() {
        let values = resolve(Element::Body(i), table);
        let stated: Vec<&str> = values.names("directions").unwrap_or_default().iter().map(String::as_str).collect();
        let directions = with_rotations(&stated);
        // an unreadable value was reported already
        let stated = values.quantities("inertia").map(|stated| inertia_matrix(&directions, stated));
        let inertia = stated.unwrap_or_else(|| Ok(Default::default())).unwrap_or_else(|fault| {
            wrong.push(fault_in(table, &fault));
            Default::default()
        });
        model.bodies.push(Body { name: text(&values, "name"), mass: number(&values, "mass"), inertia, directions });
    }
    for (i, table) in lists.place.iter().enumerate().filter(|(_, table)| table.entry("of").is_some()) {
        let values = resolve(Element::Place(i), table);
        if values.entries.len() < table.entries.len() {
            continue; // an unreadable value was reported already
        }
        match substructure::place_on_element(table, &values, &model) {
            Ok(place) => model.places.push(place),
            Err(problem) => wrong.push(*problem),
        }
    }
    for (i, table) in lists.spring.iter().enumerate() {
        let values = resolve(Element::Spring(i), table);
        let mut spring = Spring {
            between: between(&values),
            stiffness: number(&values, "stiffness"),
            damping: number(&values, "damping"),
        };
        // an unknown end is reported when the model is checked
        let is_known = spring.between.iter().all(|end| is_known_end(end, lists, &model));
        if let Some(ratio) = values.quantity(DAMPING_RATIO).filter(|_| is_known) {
            match critical_damping(&spring, lists, &model.masses) {
                Ok(critical) => spring.damping = ratio * critical,
                Err(why) => wrong.push(damping_ratio_problem(table, &why)),
            }
        }
        model.springs.push(spring);
    }
    let displacements = |directions: &[String]| {
        let turns = |along: &&String| ROTATIONS.contains(&along.as_str());
        directions.len() - directions.iter().filter(turns).count()
    };
    let of_bodies = model.bodies.iter().map(|body| (body.name.clone(), displacements(&body.directions)));
    let nodes = model.nodes().map(|(name, directions)| (name.to_owned(), directions.len()));
    let nodes: BTreeMap<String, usize> = nodes.chain(of_bodies).collect();
    for (i, table) in lists.joint.iter().enumerate() {
        let values = resolve(Element::Joint(i), table);
        // without a law there is a problem, and the model is not used
        if let Some(law) = values.law("law") {
            let between = between(&values);
            let law = with_node_tangents(law, table, &between, &nodes);
            model.joints.push(Joint { name: text(&values, "name"), between, law });
        }
    }
    for (i, table) in lists.force.iter().enumerate() {
        let values = resolve(Element::Force(i), table);
        let (amplitude, phase) = (number(&values, "amplitude"), number(&values, "phase"));
        forces.push(sector_distribution(table, &values, &mut wrong));
        // a record replaces the amplitude when the motion is computed
        if table.has_time_history() {
            model.forces.push(Force { on: text(&values, "on"), amplitude: 0.0, phase: 0.0, harmonic: 0 });
            continue;
        }
        let over_frequency = values.over_frequency("amplitude");
        if let Some(FrequencyPolynomial { linear, quadratic, .. }) = over_frequency {
            model.frequency_forces.push(FrequencyForce { force: model.forces.len(), linear, quadratic });
        }
        let amplitude = over_frequency.map_or(amplitude, |polynomial| polynomial.constant);
        model.forces.push(Force { on: text(&values, "on"), amplitude, phase, harmonic: harmonic(&values) });
    }
    for (i, table) in lists.motion.iter().enumerate() {
        let values = resolve(Element::Motion(i), table);
        let (amplitude, phase) = (number(&values, "amplitude"), number(&values, "phase"));
        let from_record = table.has_time_history();
        if from_record && text(&values, "on") == GROUND {
            continue;
        }
        motions.push(sector_distribution(table, &values, &mut wrong));
        if from_record {
            model.motions.push(Motion { on: text(&values, "on"), amplitude: 0.0, phase: 0.0, harmonic: 0 });
            continue;
        }
        model.motions.push(Motion { on: text(&values, "on"), amplitude, phase, harmonic: harmonic(&values) });
    }
    problems.append(&mut wrong);
    (model, forces, motions)
}

/// Returns the node of an end of a spring, without its direction.
fn node_of(end: &str) -> &str {
    end.strip_prefix(NEXT).unwrap_or(end).split('.').next().unwrap_or_default()
}

/// Tells whether the end of a spring is the ground, a moved place, or a mass, body or place of
/// the file, perhaps with a direction.
fn is_known_end(end: &str, lists: &ModelLists, model: &Model) -> bool {
    let node = node_of(end);
    end == GROUND
        || model.masses.iter().any(|mass| mass.name == node)
        || model.bodies.iter().any(|body| body.name == node)
        || lists.place.iter().any(|table| table.name() == Some(node))
        || lists.motion.iter().any(|table| table.text("on") == Some(end))
}

/// Returns the critical damping `2 sqrt(k m)` of a spring, kg/s, with `m` the mass at its end.
/// Between two masses, `m = m1 m2/(m1 + m2)`. The error says in words which value is missing.
fn critical_damping(spring: &Spring, lists: &ModelLists, masses: &[Mass]) -> Result<f64, String> {
    let moved = |name: &str| lists.motion.iter().any(|table| table.text("on") == Some(name));
    let inverse_mass = |name: &String| match masses.iter().find(|mass| mass.name == node_of(name)) {
        Some(mass) => Ok(1.0 / mass.mass),
        None if name == GROUND || moved(name) => Ok(0.0),
        None => Err(format!("the mass of `{name}` is unknown here")),
    };
    let [a, b] = &spring.between;
    let compliance = inverse_mass(a)? + inverse_mass(b)?;
    if !(compliance > 0.0 && compliance.is_finite()) {
        return Err("no end of this spring has a mass that can move".to_owned());
    }
    if spring.stiffness <= 0.0 {
        return Err("this spring has no stiffness".to_owned());
    }
    Ok(2.0 * (spring.stiffness / compliance).sqrt())
}

/// Returns the problem that a damping ratio has no meaning at this spring.
fn damping_ratio_problem(table: &CompiledTable, why: &str) -> Problem {
    let message = format!("a damping ratio needs a stiffness and a mass, but {why}");
    Problem::new(table.location_of(DAMPING_RATIO, None), DAMPING_RATIO, table.with_repetition(&message)).help(
        "write damping = \"2*zeta*sqrt(k*m)\" with the parameters zeta, k and the moving mass m; for a structure \
         given by matrices use `modal_damping` in [structure]",
    )
}

/// Sets the number of tangents of a law to that of the nodes that the joint connects: all their
/// directions except the normal. A number in the file takes precedence.
fn with_node_tangents(
    law: &SharedLaw,
    joint: &CompiledTable,
    between: &[String; 2],
    nodes: &BTreeMap<String, usize>,
) -> SharedLaw {
    let stated = match joint.entry("law").map(|entry| &entry.value) {
        Some(CompiledValue::Law(_, table, _)) => table.entry(TANGENTS).is_some(),
        _ => true,
    };
    let directions = between.iter().filter_map(|name| nodes.get(name)).copied().max();
    match (stated, directions) {
        (false, Some(directions @ 2..)) => {
            law.with_value(TANGENTS, (directions - 1) as f64).unwrap_or_else(|| law.clone())
        }
        _ => law.clone(),
    }
}

/// Returns the distribution of an entry of a list over the sectors.
pub(crate) fn sector_distribution(
    table: &CompiledTable,
    values: &Values,
    problems: &mut Vec<Problem>,
) -> SectorDistribution {
    let mut found = Vec::new();
    for key in ["engine_order", "nodal_diameter", "sector"] {
        match whole_number(table, values, key) {
            Ok(Some(number)) => found.push((key, number)),
            Ok(None) => {}
            Err(problem) => problems.push(problem),
        }
    }
    match found[..] {
        [] => SectorDistribution::EngineOrder(0),
        [("engine_order", order)] => SectorDistribution::EngineOrder(order),
        [("nodal_diameter", diameter)] => SectorDistribution::NodalDiameter(diameter),
        [(_, sector)] => SectorDistribution::Sector(usize::try_from(sector).unwrap_or(usize::MAX)),
        [(one, _), (other, _), ..] => {
            let message = format!("`{one}` and `{other}` both define the wave");
            let help =
                format!("keep one of them; for two waves write two entries, one with `{one}` and one with `{other}`");
            problems.push(Problem::new(table.location_of(other, None), other, message).help(help));
            SectorDistribution::EngineOrder(0)
        }
    }
}

/// Reports an entry that states a distribution over sectors although the study has no disk.
pub(crate) fn refuse_without_disk(table: &CompiledTable, problems: &mut Vec<Problem>) {
    for key in ["engine_order", "nodal_diameter", "sector"] {
        if let Some(entry) = table.entry(key) {
            let message = format!("`{key}` needs a bladed disk, but the study has no [disk]");
            let help = "add a table [disk] with `sectors`, and state one sector as the model";
            problems.push(Problem::new(&entry.location, key, message).help(help));
        }
    }
}

/// Returns the value of a key, which must be a whole number; `None` if the key is absent.
pub(crate) fn whole_number(table: &CompiledTable, values: &Values, key: &'static str) -> Result<Option<i64>, Problem> {
    let Some(value) = values.quantity(key) else { return Ok(None) };
    // Largest absolute value that is accepted as a whole number.
    if value.fract() == 0.0 && value.abs() <= 1e9 {
        return Ok(Some(value as i64));
    }
    let message = format!("must be a whole number, found {value}");
    Err(Problem::new(table.location_of(key, None), key, message))
}
