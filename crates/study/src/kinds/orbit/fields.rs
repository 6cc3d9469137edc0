//! The table `fields`: displacements and contact states of all nodes over one period, and the
//! pressure, friction and loss per area at the nodes of contacts between meshes.

use super::word;
use crate::case::study::Study;
use crate::case::values::{Values, hertz};
use crate::check::size::{SizeInputs, TableShape};
use crate::kinds::info::KeyError;
use crate::results::notes::Note;
use crate::results::table_builder::TableBuilder;
use crate::run::work::{PreparedCase, UnitResult};
use std::collections::{BTreeMap, HashMap};
use stickslip::model::{DisplacementField, Model};
use stickslip::orbit::{JointSample, Orbit};

/// Columns with quantities per area at the nodes of contacts.
const PER_AREA: [&str; 3] = ["pressure_Pa", "friction_Pa", "loss_J_per_m2"];
/// Directions of a node, in the names of its rows.
const DIRECTIONS: [&str; 3] = ["x", "y", "z"];

/// Refuses a model whose nodes have no known displacements.
pub(super) fn check(values: &Values, model: &Model) -> Result<(), KeyError> {
    match values.count("fields").and_then(|_| DisplacementField::refusal(model)) {
        Some(message) => Err(KeyError::new("fields", message, "remove `fields`")),
        None => Ok(()),
    }
}

/// Returns the shape of the table.
pub(super) fn size(inputs: &SizeInputs<'_>) -> TableShape {
    let instants = inputs.case.values.count("fields").unwrap_or(0) as f64;
    let rows = inputs.case.model.substructure.as_ref().map_or(0, |structure| structure.component.dofs());
    let nodes = rows.div_ceil(DIRECTIONS.len()) as f64;
    TableShape { rows: inputs.points() * instants * nodes, numbers: inputs.varied + 9.0, words: 1.0 }
}

/// The nodes of a structure.
pub(super) struct Fields {
    field: DisplacementField,
    instants: usize,
    /// The row of each direction, by the number of the node; `None` for a constrained one.
    nodes: BTreeMap<u64, [Option<usize>; 3]>,
    /// The joint that begins at a node, by the number of the node.
    joints: HashMap<u64, JointOfNode>,
}

/// The joint of a node.
#[derive(Clone, Copy)]
struct JointOfNode {
    index: usize,
    /// Its area, m², if the joint belongs to a contact between meshes.
    area: Option<f64>,
    /// The direction of its law in which the faces press on each other.
    normal: Option<usize>,
}

impl JointOfNode {
    /// Returns pressure, magnitude of the friction (Pa) and loss per period (J/m²); NaN if the area
    /// is unknown.
    fn per_area(self, orbit: &Orbit, sample: &JointSample) -> [f64; 3] {
        let directions = orbit.joints[self.index].displacement.len();
        let square = |direction: usize| sample.force[direction] * sample.force[direction];
        let friction = (0..directions).filter(|direction| Some(*direction) != self.normal).map(square).sum::<f64>();
        let pressing = self.normal.map_or(0.0, |normal| sample.force[normal]);
        let area = self.area.unwrap_or(f64::NAN);
        [pressing, friction.sqrt(), orbit.joints[self.index].dissipation].map(|value| value / area)
    }
}

impl Fields {
    /// Finds the nodes of a case; `None` if the study does not ask for them.
    pub fn new(study: &Study, prepared: &PreparedCase, part: &mut UnitResult) -> Option<Fields> {
        let (case, model) = (&prepared.case, &prepared.case.model);
        let instants = case.values.count("fields")? as usize;
        let component = &model.substructure.as_ref()?.component;
        let field = match DisplacementField::new(model) {
            Ok(field) => field,
            Err(error) => {
                let text = format!("the displacements of all nodes are unknown: {error}.");
                Note::for_case(&case.label(), text).merge_into(&mut part.notes);
                return None;
            }
        };
        let mut nodes: BTreeMap<u64, [Option<usize>; 3]> = BTreeMap::new();
        for (row, name) in component.rows().iter().enumerate() {
            if let Some((node, axis)) = node_and_axis(name) {
                nodes.entry(node).or_default()[axis] = Some(row);
            }
        }
        let node_of = |name: &str| {
            let place = model.places.iter().find(|place| place.name == name && place.view_of.is_none())?;
            let single = |row: &Vec<(usize, f64)>| matches!(row[..], [(_, 1.0)]);
            let (row, _) = *place.rows.first()?.first()?;
            place.rows.iter().all(single).then(|| node_and_axis(&component.rows()[row])).flatten()
        };
        let with_faces = model.joints.iter().enumerate().filter(|(_, joint)| joint.law.has_faces());
        let areas = &study.structure.mesh.areas;
        let joints = with_faces.filter_map(|(index, joint)| {
            let area = areas.get(&joint.name).copied();
            Some((node_of(&joint.between[0])?.0, JointOfNode { index, area, normal: joint.law.normal() }))
        });
        let joints = joints.collect();
        Some(Fields { field, instants, nodes, joints })
    }

    /// Writes a row for every node at every instant.
    pub fn write(&self, prepared: &PreparedCase, orbit: &Orbit, rows: &mut TableBuilder) {
        for instant in 0..self.instants {
            let time = orbit.period() * instant as f64 / self.instants as f64;
            let sample = orbit.sample(time);
            let displacement = self.field.rows(&sample.displacement);
            for (node, along) in &self.nodes {
                rows.varied(&prepared.case);
                rows.number("frequency_Hz", hertz(orbit.omega));
                rows.number("time_s", time);
                rows.integer("node", *node);
                for (axis, row) in DIRECTIONS.iter().zip(along) {
                    rows.number(&format!("{axis}_m"), row.map_or(0.0, |row| displacement[row]));
                }
                let joint = self.joints.get(node).map(|joint| (joint, &sample.joints[joint.index]));
                rows.text("contact", joint.map(|(_, sample)| word(sample.contact)).unwrap_or_default());
                let values = joint.map_or([0.0; 3], |(joint, sample)| joint.per_area(orbit, sample));
                for (name, value) in PER_AREA.iter().zip(values) {
                    rows.number(name, value);
                }
                rows.end_row();
            }
        }
    }
}

/// Returns the number of a node and the index of a direction for the name of a row, `17.y`.
fn node_and_axis(name: &str) -> Option<(u64, usize)> {
    let (node, along) = name.rsplit_once('.')?;
    Some((node.parse().ok()?, DIRECTIONS.iter().position(|axis| *axis == along)?))
}
