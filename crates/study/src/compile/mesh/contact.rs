//! Contacts from geometry: a pair of faces becomes a joint for every node of the first face.
//!
//! The node `a` is joined to the closest point of the second face, as a sum of that face's nodes
//! with the values of their shape functions, or to the ground. The second face may belong to the
//! next sector of a disk. The normal is the mean of the
//! normal of the node and the opposite of that of the face. The law states stiffnesses, forces and
//! dampings per area; the joint has them times the area of the node
//! ([`stickslip_formats::mesh::Face`] tells how areas are shared).

use super::preload::{NodalPreload, PreloadSummary};
use super::{MeshSource, NO_PARAMETERS, entry, fixed_number, node_entry, set_problem, table_of_node};
use crate::case::values::ResolvedValue;
use crate::compile::compiled::{CompiledEntry, CompiledTable, CompiledValue, LawCoordinate};
use crate::data::DataTable;
use crate::syntax::error::{Location, Problem};
use crate::syntax::expression::quantity_text;
use crate::syntax::format::{format_significant, plural_suffix};
use serde_json::{Value as Json, json};
use stickslip::dimension::Dimension;
use stickslip::model::{Frame, GROUND, NEXT};
use stickslip::structure::CoordinateAxis;
use stickslip_formats::mesh::{Patch, PatchNode, ProjectedPoint};
use stickslip_numerics::vector::dot;

/// A contact after its pairs are known.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ContactSummary {
    /// Name of the contact; its joints are `NAME_NODE`.
    pub name: String,
    /// The names of both sets, or the ground.
    pub between: [String; 2],
    /// Number of joints.
    pub joints: usize,
    /// Area of the joints and of the first face, m².
    pub area: [f64; 2],
    /// Smallest and largest distance along the normal, m, negative where the faces overlap; `None`
    /// on the ground.
    pub gaps: Option<[f64; 2]>,
    /// Smallest and largest distance of the nodes from the position of the body that they touch, m.
    pub body_distances: Option<[f64; 2]>,
    /// Largest angle between both faces, rad.
    pub angle: f64,
    /// The pairs of all joints, for a picture.
    pub pairs: Vec<ContactPair>,
    /// Nodes of the first face that no face opposes within the distance.
    pub unpaired: Vec<i64>,
    /// The preload from a static step, if it is stated.
    pub preload: Option<PreloadSummary>,
}

/// A node of the first face and its counterpart, in the coordinates and the unit of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactPair {
    /// The node of the first face.
    pub node: [f64; 3],
    /// The point of the second face; `None` on the ground and on a body.
    pub counterpart: Option<[f64; 3]>,
}

/// The places and joints of a contact.
pub(crate) struct ExpandedContact {
    pub places: Vec<CompiledTable>,
    pub joints: Vec<CompiledTable>,
    /// Constant forces that balance the preloads of a static step.
    pub forces: Vec<CompiledTable>,
    /// Area of each joint, by name, m².
    pub areas: Vec<(String, f64)>,
    pub summary: ContactSummary,
}

/// A node of the first face with its counterpart, in the axes of the second face's sector.
struct Pair {
    node: PatchNode,
    /// The point of the second face; `None` on the ground.
    opposite: Option<ProjectedPoint>,
    /// Unit normal out of the first face.
    normal: [f64; 3],
}

/// The rotation between the axes of a sector and those of the next one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SectorRotation {
    /// The axis of the disk.
    pub axis: CoordinateAxis,
    /// Angle of a sector, rad.
    pub angle: f64,
}

impl SectorRotation {
    /// Returns a vector of the sector along the axes of the next one.
    fn in_next(self, vector: [f64; 3]) -> [f64; 3] {
        self.rotated(vector, -self.angle)
    }

    /// Returns a vector of the next sector along the axes of this one.
    fn in_own(self, vector: [f64; 3]) -> [f64; 3] {
        self.rotated(vector, self.angle)
    }

    fn rotated(self, vector: [f64; 3], angle: f64) -> [f64; 3] {
        self.axis.rotation(angle).map(|row| dot(&row, &vector))
    }
}

/// Weight of a node of a face below which it does not take part: rounding of coordinates in files.
const NEGLIGIBLE_WEIGHT: f64 = 1e-6;

/// Inputs of a contact from the rest of the study.
#[derive(Clone, Copy)]
pub(crate) struct ContactInputs<'a> {
    pub source: &'a MeshSource,
    /// The rotation of the sectors of a disk, if it is known.
    pub rotation: Option<SectorRotation>,
    /// The tables of the study, if they could be read.
    pub data: Option<&'a Vec<DataTable>>,
    pub bodies: &'a [CompiledTable],
}

/// Returns the places and joints that an entry of `[[contact]]` states.
pub(crate) fn expand(contact: &CompiledTable, inputs: ContactInputs<'_>) -> Result<ExpandedContact, Problem> {
    let ContactInputs { source, rotation, data, bodies } = inputs;
    let preload = data.map(|data| NodalPreload::new(contact, data)).transpose()?.flatten();
    let (sets, location) = between(contact)?;
    let patch = |set: &str| source.mesh.patch(set).map_err(|error| set_problem(error, "between", location));
    let find = |name: &str| bodies.iter().find(|body| body.name() == Some(name));
    if find(&sets[0]).is_some() {
        let message = format!("`{}` is a body, but the first side must be a set of the mesh", sets[0]);
        let help = format!("write between = [\"{}\", \"{}\"]", sets[1], sets[0]);
        return Err(Problem::new(location, "between", message).help(help));
    }
    let body = find(&sets[1]).map(|body| ContactBody::new(body, source, location)).transpose()?;
    if let (None, Some(next)) = (&body, sets[0].strip_prefix(NEXT)) {
        let message = "the first side must be a set of the sector itself, except in a contact with a body";
        let help = format!("write between = [\"{}\", \"{NEXT}{next}\"]", sets[1].trim_start_matches(NEXT));
        return Err(Problem::new(location, "between", message).help(help));
    }
    let next_set = if body.is_some() { sets[0].strip_prefix(NEXT) } else { sets[1].strip_prefix(NEXT) };
    let first = patch(if body.is_some() { next_set.unwrap_or(&sets[0]) } else { &sets[0] })?;
    let rotation = match (next_set, rotation) {
        (None, _) => None,
        (Some(_), Some(rotation)) => Some(rotation),
        (Some(_), None) => {
            let message = "a contact with the next sector needs the rotation of the sectors";
            let help = "write [disk] with a number of `sectors`, and the `axis` of the disk";
            return Err(Problem::new(location, "between", message).help(help));
        }
    };
    // the nodes along the axes of the second side
    let in_second = |vector: [f64; 3]| match (rotation, &body) {
        (None, _) => vector,
        (Some(rotation), None) => rotation.in_next(vector),
        (Some(rotation), Some(_)) => rotation.in_own(vector),
    };
    let second = match (&body, sets[1] == GROUND) {
        (Some(_), _) | (_, true) => None,
        _ => Some(patch(next_set.unwrap_or(&sets[1]))?),
    };
    let limit = match fixed_number(contact, "distance", "a parameter cannot change which nodes are in contact")? {
        Some(meters) => meters / source.length,
        None => second.as_ref().map_or(0.0, default_distance),
    };
    let (mut pairs, mut unpaired, mut nearest) = (Vec::new(), Vec::new(), f64::INFINITY);
    for own in first.nodes() {
        let node = PatchNode { position: in_second(own.position), normal: in_second(own.normal), ..*own };
        match &second {
            None => pairs.push(Pair { node, opposite: None, normal: node.normal }),
            Some(second) => match second.closest(&node) {
                Some(found) if found.point.distance <= limit => {
                    let normal = unit([0, 1, 2].map(|axis| node.normal[axis] - found.point.normal[axis]));
                    pairs.push(Pair { node, opposite: Some(found), normal });
                }
                found => {
                    nearest = found.map_or(nearest, |found| nearest.min(found.point.distance));
                    unpaired.push(source.number(node.node));
                }
            },
        }
    }
    if pairs.is_empty() {
        let length = |in_mesh: f64| quantity_text(in_mesh * source.length, Some(Dimension::LENGTH));
        let (message, help) = match nearest.is_finite() {
            true => (
                format!(
                    "no node of {} has a face of {} in front of it within {}; the nearest is {} away",
                    sets[0],
                    sets[1],
                    length(limit),
                    length(nearest)
                ),
                "state a larger `distance`, or the sides that touch each other",
            ),
            false => (
                format!("no face of {} and node of {} face each other", sets[1], sets[0]),
                "state the sides that touch each other; `stickslip inspect` with `--picture` draws the sets",
            ),
        };
        return Err(Problem::new(location, "between", message).help(help));
    }
    let mut expanded = ExpandedContact {
        places: Vec::new(),
        joints: Vec::new(),
        forces: Vec::new(),
        areas: Vec::new(),
        summary: summary(contact, source, &first, &pairs, unpaired),
    };
    let in_first = |vector: [f64; 3]| rotation.map_or(vector, |rotation| rotation.in_own(vector));
    let shown = |pair: &Pair| ContactPair {
        node: source.mesh.nodes()[pair.node.node].position,
        counterpart: pair.opposite.as_ref().map(|found| in_first(found.point.position)),
    };
    expanded.summary.pairs = pairs.iter().map(shown).collect();
    expanded.summary.body_distances = body.as_ref().and_then(|body| {
        range(pairs.iter().map(|pair| {
            let to_node = [0, 1, 2].map(|axis| pair.node.position[axis] * source.length - body.position[axis]);
            dot(&to_node, &to_node).sqrt()
        }))
    });
    let mut areas = Vec::with_capacity(pairs.len());
    for pair in &pairs {
        let number = source.number(pair.node.node);
        let area = pair.node.area * source.length * source.length;
        let mut frames = [pair.normal; 2].map(|normal| FrameVectors { normal, tangent: None });
        // both tangents are the same direction in space
        match (rotation, &body) {
            (Some(rotation), None) => {
                frames[0].normal = rotation.in_own(pair.normal);
                let tangent = tangent(contact, frames[0].normal)?;
                frames[0].tangent = Some(tangent);
                frames[1].tangent = Some(rotation.in_next(tangent));
            }
            (Some(rotation), Some(_)) => {
                frames[0].normal = rotation.in_next(pair.normal);
                let tangent = tangent(contact, pair.normal)?;
                frames[0].tangent = Some(rotation.in_next(tangent));
                frames[1].tangent = Some(tangent);
            }
            (None, _) => {}
        }
        let mut side = |suffix: &str, rows: CompiledEntry, frame: FrameVectors| {
            expanded.places.push(place(contact, &format!("{number}_{suffix}"), rows, Some(frame)));
        };
        side("a", node_entry(number, location), frames[0]);
        if let Some(opposite) = &pair.opposite {
            side("b", opposite_rows(opposite, source, location), frames[1]);
        }
        if let Some(body) = &body {
            let mut point = place(contact, &format!("{number}_b"), body.entry(location), Some(frames[1]));
            point.entries.push(body.offset(pair.node.position, source.length, location));
            expanded.places.push(point);
        }
        let has_pair = pair.opposite.is_some() || body.is_some();
        let mut joint = joint(contact, number, &sets, area);
        if let Some(preload) = &preload {
            let pressure = preload.pressure(number, area);
            set_preload(&mut joint, preload, number, pressure)?;
            let sides = ["a", "b"].into_iter().take(1 + usize::from(has_pair));
            let places: Vec<String> = sides.map(|side| format!("{}_{side}", name_of_node(contact, number))).collect();
            expanded.forces.extend(preload.balance(contact, &places, pressure * area));
        }
        expanded.joints.push(joint);
        expanded.areas.push((name_of_node(contact, number), area));
        areas.push((number, area));
    }
    expanded.summary.preload = preload.map(|preload| preload.summary(&areas)).transpose()?;
    Ok(expanded)
}

/// A body that touches the mesh.
struct ContactBody {
    name: String,
    /// Position of its centre of mass, m.
    position: [f64; 3],
}

impl ContactBody {
    fn new(body: &CompiledTable, source: &MeshSource, location: &Location) -> Result<ContactBody, Problem> {
        let name = body.name().unwrap_or_default().to_owned();
        let refuse = |message: String, help: &str| Err(Problem::new(location, "between", message).help(help));
        if source.mesh.sets().iter().any(|set| set.name == name) {
            return refuse(format!("`{name}` is a body and a set of the mesh"), "rename the body");
        }
        let directions = match body.entry("directions").map(|entry| &entry.value) {
            Some(CompiledValue::Names(names)) => names.iter().map(|(name, _)| name.as_str()).collect(),
            Some(CompiledValue::Fixed(ResolvedValue::Names(names))) => names.iter().map(String::as_str).collect(),
            _ => Vec::new(),
        };
        if !["x", "y", "z"].iter().all(|along| directions.contains(along)) {
            return refuse(
                format!(
                    "the face of a mesh has three directions, but the body `{name}` does not move along all of them"
                ),
                "write directions = [\"x\", \"y\", \"z\"] in its [[body]], and springs for those in which it is held",
            );
        }
        let position =
            body.entry("position").map(|entry| entry.value.evaluate("position", &NO_PARAMETERS, &mut Vec::new()));
        match position {
            Some(Ok(ResolvedValue::Vector(position))) => Ok(ContactBody { name, position }),
            Some(_) => refuse(
                format!("a parameter cannot change the position of `{name}`, which touches the mesh"),
                "write three lengths",
            ),
            None => refuse(
                format!("the position of the body `{name}` is unknown"),
                "add to its [[body]] position = [\"60 mm\", 0, \"5 mm\"], its centre of mass in the coordinates of the \
                 mesh",
            ),
        }
    }

    /// Returns the entry that makes a place one of the body.
    fn entry(&self, location: &Location) -> CompiledEntry {
        entry("of", ResolvedValue::Text(self.name.clone()), location)
    }

    /// Returns the offset of a point of the mesh with this unit of length, m.
    fn offset(&self, point: [f64; 3], length: f64, location: &Location) -> CompiledEntry {
        let offset = [0, 1, 2].map(|axis| point[axis] * length - self.position[axis]);
        entry("offset", ResolvedValue::Vector(offset), location)
    }
}

/// Returns stand-ins for the places and joints of these nodes, if the mesh is not read.
pub(crate) fn placeholders(contact: &CompiledTable, numbers: &[i64]) -> Result<ExpandedContact, Problem> {
    let (sets, location) = between(contact)?;
    let is_pair = sets[1] != GROUND;
    let mut expanded = ExpandedContact {
        places: Vec::new(),
        joints: Vec::new(),
        forces: Vec::new(),
        areas: Vec::new(),
        summary: ContactSummary::default(),
    };
    for number in numbers {
        for suffix in ["a", "b"].into_iter().take(1 + usize::from(is_pair)) {
            expanded.places.push(place(contact, &format!("{number}_{suffix}"), node_entry(*number, location), None));
        }
        expanded.joints.push(joint(contact, *number, &sets, 1.0));
    }
    Ok(expanded)
}

/// Returns the names of both sets, and where they stand.
fn between(contact: &CompiledTable) -> Result<([String; 2], &Location), Problem> {
    let location = contact.location_of("between", None);
    match contact.entry("between").map(|entry| &entry.value) {
        Some(CompiledValue::Names(names)) if names.len() == 2 => {
            Ok(([names[0].0.clone(), names[1].0.clone()], location))
        }
        _ => Err(Problem::new(location, "between", "a contact is between two sets of the mesh")
            .help("write between = [\"PADS\", \"DAMPER_TOP\"], [\"PADS\", \"ground\"] or, on a disk, [\"HIGH\", \"next.LOW\"]")),
    }
}

/// Returns a tenth of the size of a face, the square root of its area.
fn default_distance(patch: &Patch) -> f64 {
    0.1 * (patch.area() / patch.faces().len() as f64).sqrt()
}

fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = dot(&vector, &vector).sqrt();
    vector.map(|component| component / length)
}

/// Returns the row of each direction at a point of the second face: the node on which it lies, or
/// the weighted sum of the face's nodes.
fn opposite_rows(opposite: &ProjectedPoint, source: &MeshSource, location: &Location) -> CompiledEntry {
    let nodes = opposite.nodes.iter().filter(|(_, weight)| weight.abs() > NEGLIGIBLE_WEIGHT);
    let nodes: Vec<(i64, f64)> = nodes.map(|(node, weight)| (source.number(*node), *weight)).collect();
    if let [(number, _)] = nodes[..] {
        return node_entry(number, location);
    }
    let sum: f64 = nodes.iter().map(|(_, weight)| weight).sum();
    let row = |along: &str| nodes.iter().map(|(number, weight)| (format!("{number}.{along}"), weight / sum)).collect();
    entry("sum", ResolvedValue::Sums(["x", "y", "z"].map(row).to_vec()), location)
}

/// The vectors that define the frame of a place.
#[derive(Clone, Copy)]
struct FrameVectors {
    normal: [f64; 3],
    /// `None`: the tangent of the contact.
    tangent: Option<[f64; 3]>,
}

/// Returns the first tangent of a node with this normal. It is a direction of the first sector,
/// so no parameter may change it.
fn tangent(contact: &CompiledTable, normal: [f64; 3]) -> Result<[f64; 3], Problem> {
    let location = contact.location_of("tangent", None);
    let value = |entry: &CompiledEntry| entry.value.evaluate("tangent", &NO_PARAMETERS, &mut Vec::new());
    let stated = match contact.entry("tangent").map(value) {
        Some(Ok(ResolvedValue::Vector(vector))) => Some(vector),
        None => None,
        Some(_) => {
            let message = "a parameter cannot turn the tangent of a contact with the next sector";
            return Err(Problem::new(location, "tangent", message).help("write three numbers"));
        }
    };
    let frame = Frame::new(normal, stated).map_err(|error| Problem::new(location, "tangent", error.to_string()))?;
    Ok(frame.axes()[0])
}

fn place(contact: &CompiledTable, ending: &str, rows: CompiledEntry, frame: Option<FrameVectors>) -> CompiledTable {
    let name = format!("{}_{ending}", contact.name().unwrap_or_default());
    let location = rows.location.clone();
    let mut entries = vec![entry("name", ResolvedValue::Text(name.clone()), contact.location_of("name", None)), rows];
    if let Some(FrameVectors { normal, tangent }) = frame {
        entries.push(entry("normal", ResolvedValue::Vector(normal), &location));
        let own = tangent.map(|tangent| entry("tangent", ResolvedValue::Vector(tangent), &location));
        entries.extend(own.or_else(|| contact.entry("tangent").cloned()));
    } else {
        let frame = ["t1", "t2", "n"].map(str::to_owned).to_vec();
        entries.push(entry("directions", ResolvedValue::Names(frame), &location));
    }
    table_of_node(contact, &name, entries)
}

/// Returns the name of the joint of a node.
fn name_of_node(contact: &CompiledTable, number: i64) -> String {
    format!("{}_{number}", contact.name().unwrap_or_default())
}

/// Returns the joint of a node of the first side with the second.
fn joint(contact: &CompiledTable, number: i64, sets: &[String; 2], area: f64) -> CompiledTable {
    let name = name_of_node(contact, number);
    let location = contact.location_of("between", None);
    let end = |set: &String, side: &str| match set.as_str() {
        GROUND => GROUND.to_owned(),
        set if set.starts_with(NEXT) => format!("{NEXT}{name}_{side}"),
        _ => format!("{name}_{side}"),
    };
    let ends = [end(&sets[0], "a"), end(&sets[1], "b")];
    let ends = CompiledValue::Names(ends.into_iter().map(|end| (end, location.clone())).collect());
    let mut entries = vec![entry("name", ResolvedValue::Text(name.clone()), contact.location_of("name", None))];
    entries.push(CompiledEntry { key: "between", location: location.clone(), value: ends });
    entries.extend(contact.entry("law").cloned().map(|mut law| {
        if let CompiledValue::Law(_, table, coordinate) = &mut law.value {
            *coordinate = LawCoordinate::Face { area };
            per_area(table);
        }
        law
    }));
    table_of_node(contact, &name, entries)
}

/// Sets the preload of a joint, as a pressure (Pa).
fn set_preload(joint: &mut CompiledTable, preload: &NodalPreload, node: i64, pressure: f64) -> Result<(), Problem> {
    let Some(entry) = joint.entries.iter_mut().find(|entry| entry.key == "law") else { return Ok(()) };
    let CompiledValue::Law(info, law, _) = &mut entry.value else { return Ok(()) };
    if info.parameters.iter().all(|parameter| parameter.key != "preload") {
        let message = format!("the law `{}` has no preload", info.name);
        return Err(Problem::new(&entry.location, "law", message).help("use `friction-contact`, or remove `preload`"));
    }
    preload.set(law, node, pressure)
}

/// Gives the quantities of a law the dimensions per area.
fn per_area(law: &mut CompiledTable) {
    for entry in &mut law.entries {
        if let CompiledValue::Quantity { dimension, example, .. } = &mut entry.value {
            *dimension = LawCoordinate::Face { area: 1.0 }.dimension(*dimension);
            *example = match *dimension {
                Dimension::PRESSURE => "\"2 MPa\"",
                Dimension::CUBIC_STIFFNESS => "\"1e3 N/mm^3\"",
                _ => example,
            };
        }
    }
}

fn summary(
    contact: &CompiledTable,
    source: &MeshSource,
    first: &Patch,
    pairs: &[Pair],
    unpaired: Vec<i64>,
) -> ContactSummary {
    let gap = |pair: &Pair| {
        let between = &pair.opposite.as_ref()?.point.position;
        Some(dot(&[0, 1, 2].map(|axis| between[axis] - pair.node.position[axis]), &pair.normal) * source.length)
    };
    let angle = |pair: &Pair| -> f64 {
        pair.opposite
            .as_ref()
            .map_or(0.0, |found| (-dot(&pair.node.normal, &found.point.normal)).clamp(-1.0, 1.0).acos())
    };
    let square = source.length * source.length;
    let paired: f64 = pairs.iter().map(|pair| pair.node.area).sum();
    ContactSummary {
        name: contact.name().unwrap_or_default().to_owned(),
        between: between(contact).map_or_else(|_| Default::default(), |(sets, _)| sets),
        joints: pairs.len(),
        area: [paired * square, first.area() * square],
        gaps: range(pairs.iter().filter_map(gap)),
        body_distances: None,
        angle: pairs.iter().map(angle).fold(0.0, f64::max),
        pairs: Vec::new(),
        unpaired,
        preload: None,
    }
}

/// Returns the smallest and the largest value; `None` without values.
fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    values.fold(None, |range: Option<[f64; 2]>, value| {
        let [low, high] = range.unwrap_or([value, value]);
        Some([low.min(value), high.max(value)])
    })
}

impl ContactSummary {
    /// Describes the contact in a line.
    pub(crate) fn text(&self) -> String {
        let Self {
            name,
            between: [first, second],
            joints,
            area: [paired, all],
            gaps,
            body_distances,
            angle,
            unpaired,
            preload,
            ..
        } = self;
        let number = |value: f64| format_significant(value, 4);
        let mut text = format!(
            "{name}: {joints} joint{} of {first} on {second}, area {} of {} mm^2",
            plural_suffix(*joints),
            number(paired * 1e6),
            number(all * 1e6)
        );
        if let Some([low, high]) = gaps {
            text += &format!(
                ", gaps {} to {} mm, angles up to {} deg",
                number(low * 1e3),
                number(high * 1e3),
                // decimals of coordinates in the file turn faces by less
                number((angle.to_degrees() * 1e3).round() * 1e-3)
            );
        }
        if let Some([low, high]) = body_distances {
            text +=
                &format!(", nodes {} to {} mm from the `position` of {second}", number(low * 1e3), number(high * 1e3));
        }
        if let Some(PreloadSummary { total, pressures: [low, high], is_scaled, joints_without_row, .. }) = preload {
            text += &format!(
                ", preload {} N in total, {} to {} MPa{}",
                number(*total),
                number(low * 1e-6),
                number(high * 1e-6),
                if *is_scaled { ", before `scale`" } else { "" }
            );
            if *joints_without_row > 0 {
                text += &format!(", none at {joints_without_row} node{}", plural_suffix(*joints_without_row));
            }
        }
        if !unpaired.is_empty() {
            // Most nodes that a line lists.
            let listed: Vec<String> = unpaired.iter().take(8).map(ToString::to_string).collect();
            let more = if unpaired.len() > listed.len() { ", …" } else { "" };
            let (count, listed) = (unpaired.len(), listed.join(", "));
            text += &format!("; no counterpart for {count} node{}: {listed}{more}", plural_suffix(count));
        }
        text
    }

    /// Returns the contact for the record of a run, in SI.
    pub(crate) fn to_json(&self) -> Json {
        json!({
            "name": self.name,
            "between": self.between,
            "joints": self.joints,
            "area_m2": self.area[0],
            "face_area_m2": self.area[1],
            "gaps_m": self.gaps,
            "distances_from_body_m": self.body_distances,
            "largest_angle_rad": self.angle,
            "unpaired_nodes": self.unpaired,
            "preload_N": self.preload.as_ref().map(|preload| preload.total),
        })
    }
}
