//! The table `fields`: displacements and velocities of all nodes over one period of an orbit or a
//! mode. In an orbit also contact states, and the pressure, friction and loss per area at the nodes
//! of contacts between meshes.
//!
//! For a disk the table has all sectors. Their displacements are along the fixed axes x, y, z.

use super::contact_states::contact_word;
use crate::case::study::Study;
use crate::case::values::{Values, hertz};
use crate::check::size::{SizeInputs, TableShape};
use crate::check::summary::node_and_axis;
use crate::kinds::info::KeyError;
use crate::results::notes::Note;
use crate::results::table_builder::TableBuilder;
use crate::run::work::{PreparedCase, UnitResult};
use crate::syntax::key::{Key, ValueType, optional};
use num_complex::Complex64;
use std::collections::{BTreeMap, HashMap};
use std::f64::consts::TAU;
use stickslip::model::{DisplacementField, Model, Place, System, TRANSLATIONS};
use stickslip::orbit::{JointSample, Orbit};

/// The key `fields`.
pub(in crate::kinds) const KEY: Key = optional(
    "fields",
    ValueType::Count(1, 1000),
    "number of instants of the period at which the motions of all nodes of the structure are written to \
     `fields.csv`, and with a `mesh` to `fields.pvd` for ParaView",
    "24",
);

/// Columns with quantities per area at the nodes of contacts.
const PER_AREA: [&str; 3] = ["pressure_Pa", "friction_Pa", "loss_J_per_m2"];

/// Refuses a model without nodes, and a disk whose sectors have no known rotation.
pub(in crate::kinds) fn check(values: &Values, model: &Model) -> Result<(), KeyError> {
    if values.count("fields").is_none() {
        return Ok(());
    }
    let refuse = |message: &str, help: &str| Err(KeyError::new("fields", message, help));
    match &model.substructure {
        None => refuse("only a structure given by matrices has the displacements of nodes", "remove `fields`"),
        Some(own) if !own.component.rows().iter().any(|name| node_and_axis(name).is_some()) => refuse(
            "the rows of the matrices do not name nodes, as in `17.y`",
            "add to [structure] dofs = \"blade.dof\", the names of the rows; a reduced model has no nodes",
        ),
        Some(own) if own.disk.as_ref().is_some_and(|disk| disk.boundary.axis().is_none()) => refuse(
            "the displacements of all nodes of a disk need its axis",
            "add axis = \"z\" to [disk], or remove `fields`",
        ),
        Some(_) => Ok(()),
    }
}

/// Returns the shape of the table for this number of motions.
pub(in crate::kinds) fn size(inputs: &SizeInputs<'_>, motions: f64) -> TableShape {
    let instants = inputs.case.values.count("fields").unwrap_or(0) as f64;
    let rows = inputs.case.model.substructure.as_ref().map_or(0, |structure| structure.component.dofs());
    let sectors = inputs.case.model.ring.map_or(1, |ring| ring.sectors);
    let nodes = (rows.div_ceil(TRANSLATIONS.len()) * sectors) as f64;
    TableShape { rows: motions * instants * nodes, numbers: inputs.varied + 13.0, words: 1.0 }
}

/// The nodes of a structure.
pub(in crate::kinds) struct Fields {
    field: DisplacementField,
    instants: usize,
    /// The row of each direction, by the number of the node; `None` for a constrained one.
    nodes: BTreeMap<u64, [Option<usize>; 3]>,
    /// The joint that begins at a node, by the sector and the number of the node.
    joints: HashMap<(usize, u64), JointOfNode>,
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
        let field = displacement_field(prepared, part)?;
        let mut nodes: BTreeMap<u64, [Option<usize>; 3]> = BTreeMap::new();
        for (row, name) in component.rows().iter().enumerate() {
            if let Some((node, axis)) = node_and_axis(name) {
                nodes.entry(node).or_default()[axis] = Some(row);
            }
        }
        let node_of = |name: &str| {
            let of_name = |place: &&Place| place.name == name && place.view_of.is_none();
            let (index, place) = model.places.iter().enumerate().find(|(_, place)| of_name(place))?;
            let single = |row: &Vec<(usize, f64)>| matches!(row[..], [(_, 1.0)]);
            let (row, _) = *place.rows.first()?.first()?;
            let node = place.rows.iter().all(single).then(|| node_and_axis(&component.rows()[row])).flatten();
            // places are stored sector by sector
            Some((index * field.sectors() / model.places.len(), node?.0))
        };
        let with_faces = model.joints.iter().enumerate().filter(|(_, joint)| joint.law.has_faces());
        let areas = &study.structure.mesh.areas;
        let joints = with_faces.filter_map(|(index, joint)| {
            let stated = if model.ring.is_some() { joint.name.rsplit_once('_')?.0 } else { &joint.name };
            let area = areas.get(stated).copied();
            let normal = joint.law.normal();
            Some((node_of(&joint.between[0])?, JointOfNode { index, area, normal }))
        });
        let joints = joints.collect();
        Some(Fields { field, instants, nodes, joints })
    }

    /// Writes a row for every node at every instant of an orbit.
    pub fn write_orbit(&self, prepared: &PreparedCase, orbit: &Orbit, rows: &mut TableBuilder) {
        for instant in 0..self.instants {
            let time = orbit.period() * instant as f64 / self.instants as f64;
            let sample = orbit.sample(time);
            let imposed = imposed(&prepared.system, orbit.omega, time);
            let motion = [(&sample.displacement[..], &imposed[0][..]), (&sample.velocity, &imposed[1])];
            let head = |rows: &mut TableBuilder| {
                rows.number("frequency_Hz", hertz(orbit.omega));
                rows.number("time_s", time);
            };
            self.write_instant(prepared, motion, Some((orbit, &sample.joints)), &head, rows);
        }
    }

    /// Writes a row for every node at every instant of a harmonic motion, with the columns that
    /// `head` writes. The motion is over all degrees of freedom.
    pub fn write_harmonic(
        &self,
        prepared: &PreparedCase,
        omega: f64,
        motion: &[Complex64],
        head: &dyn Fn(&mut TableBuilder),
        rows: &mut TableBuilder,
    ) {
        let at_rest = vec![0.0; prepared.system.moved_places().len()];
        for instant in 0..self.instants {
            let phase = TAU * instant as f64 / self.instants as f64;
            let displacement: Vec<f64> = motion.iter().map(|x| (x * Complex64::cis(phase)).re).collect();
            let velocity: Vec<f64> = motion.iter().map(|x| -omega * (x * Complex64::cis(phase)).im).collect();
            let head = |rows: &mut TableBuilder| {
                head(rows);
                rows.number("frequency_Hz", hertz(omega));
                rows.number("time_s", phase / omega);
            };
            let motion = [(&displacement[..], &at_rest[..]), (&velocity, &at_rest)];
            self.write_instant(prepared, motion, None, &head, rows);
        }
    }

    /// Writes a row for every node: its displacement and velocity from those of the degrees of
    /// freedom and the imposed ones, and the states of the joints.
    fn write_instant(
        &self,
        prepared: &PreparedCase,
        motion: [(&[f64], &[f64]); 2],
        joints: Option<(&Orbit, &[JointSample])>,
        head: &dyn Fn(&mut TableBuilder),
        rows: &mut TableBuilder,
    ) {
        let sectors = self.field.sectors();
        for sector in 0..sectors {
            let motion = motion.map(|(values, imposed)| self.field.rows(sector, values, imposed));
            let rotation = self.field.axis().map(|axis| axis.rotation(TAU * sector as f64 / sectors as f64));
            for (node, along) in &self.nodes {
                rows.varied(&prepared.case);
                head(rows);
                if prepared.case.model.ring.is_some() {
                    rows.integer("sector", sector as u64);
                }
                rows.integer("node", *node);
                for (values, unit) in motion.iter().zip(["m", "m_per_s"]) {
                    let own = along.map(|row| row.map_or(0.0, |row| values[row]));
                    let fixed = rotation.map_or(own, |to| to.map(|row| (0..3).map(|i| row[i] * own[i]).sum()));
                    for (axis, value) in TRANSLATIONS.iter().zip(fixed) {
                        rows.number(&format!("{axis}_{unit}"), value);
                    }
                }
                if let Some((orbit, samples)) = joints {
                    let joint = self.joints.get(&(sector, *node)).map(|joint| (joint, &samples[joint.index]));
                    rows.text("contact", joint.map(|(_, sample)| contact_word(sample.contact)).unwrap_or_default());
                    let values = joint.map_or([0.0; 3], |(joint, sample)| joint.per_area(orbit, sample));
                    for (name, value) in PER_AREA.iter().zip(values) {
                        rows.number(name, value);
                    }
                }
                rows.end_row();
            }
        }
    }
}

/// Returns the displacements of all rows of a case; `None` with a note if they are unknown.
pub(in crate::kinds) fn displacement_field(
    prepared: &PreparedCase,
    part: &mut UnitResult,
) -> Option<DisplacementField> {
    let field = DisplacementField::new(&prepared.case.model);
    let unknown = |error| {
        let text = format!("the displacements of all nodes are unknown: {error}.");
        Note::for_case(&prepared.case.label(), text).merge_into(&mut part.notes);
    };
    field.map_err(unknown).ok()
}

/// Returns the displacements (m) and the velocities (m/s) of the places with imposed motions.
pub(in crate::kinds) fn imposed(system: &System, omega: f64, time: f64) -> [Vec<f64>; 2] {
    let at = |derivative: i32| {
        let part = |(harmonic, amplitude): &(u32, Complex64)| {
            let rate = f64::from(*harmonic) * omega;
            (amplitude * Complex64::new(0.0, rate).powi(derivative) * Complex64::cis(rate * time)).re
        };
        system.moved_places().iter().map(|place| place.motion.iter().map(part).sum()).collect()
    };
    [at(0), at(1)]
}
