//! Preloads of a contact from a static step: a pressure or a force for each node, from `[[data]]`.
//!
//! The preload of a joint is the pressure at its node times the area of the node, or the force of
//! the node. A node without a row has no preload. A node without pressure and with a `gap` has the
//! negative preload that closes at this gap. `scale` multiplies gaps too: faces without an initial
//! gap lift off in proportion to the load.
//!
//! These are the forces after the static step has deformed the structure, so that displacements
//! count from there: constant forces on both places of a joint balance its preload. They stand for
//! the loads of the static step. Without them the structure would relax and lose contact force.

use super::{Expected, NO_PARAMETERS, entry, fixed_number, table_of_node};
use crate::case::values::ResolvedValue;
use crate::compile::compiled::{CompiledEntry, CompiledQuantity, CompiledTable, CompiledValue};
use crate::data::{ColumnError, DataTable};
use crate::syntax::error::{Location, Problem};
use crate::syntax::expression::Expression;
use crate::syntax::format::format_significant;
use crate::syntax::key::Bounds;
use std::collections::{BTreeMap, HashSet};
use stickslip::dimension::Dimension;

/// Relative difference of the sum of all forces from the stated one above which it is an error.
/// Areas of nodes shared otherwise in the static step change it by less.
const LARGEST_DIFFERENCE: f64 = 0.02;

/// The key of a law that the preload of its node replaces.
const LAW_KEY: &str = "preload";

/// The preload of a contact for the summary of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct PreloadSummary {
    /// Sum of the forces of all joints before `scale`, N.
    pub total: f64,
    /// Smallest and largest pressure before `scale`, Pa.
    pub pressures: [f64; 2],
    /// True unless `scale` is the number 1.
    pub is_scaled: bool,
    /// Number of joints whose node has no row.
    pub joints_without_row: usize,
    /// Number of rows above zero whose node has no joint.
    pub rows_without_joint: usize,
}

/// The preload of a contact: values by node.
pub(super) struct NodalPreload {
    values: BTreeMap<i64, f64>,
    is_force: bool,
    /// Gaps of nodes without pressure, m.
    gaps: BTreeMap<i64, f64>,
    scale: CompiledQuantity,
    total: Option<f64>,
    location: Location,
}

impl NodalPreload {
    /// Reads the preload of a contact; `None` if it states none.
    pub fn new(contact: &CompiledTable, data: &[DataTable]) -> Result<Option<NodalPreload>, Problem> {
        let Some(CompiledValue::Table(stated)) = contact.entry(LAW_KEY).map(|entry| &entry.value) else {
            return Ok(None);
        };
        if let Some(entry) = stated.entry("scale")
            && let CompiledValue::Quantity { quantity, dimension, within, example } = &entry.value
            && quantity.expression.parameters().next().is_none()
        {
            let expected = Expected { dimension: *dimension, within: *within };
            quantity.number("scale", expected, example, &NO_PARAMETERS)?;
        }
        let scale = stated.entry("scale").map(|entry| &entry.value);
        let (Some(name), Some(CompiledValue::Quantity { quantity: scale, .. })) = (stated.text("data"), scale) else {
            return Ok(None);
        };
        let why = "this force belongs to the values of the file, so no parameter can change it";
        let total = fixed_number(stated, "total", why)?;
        let (scale, location) = (scale.clone(), stated.location.clone());
        let (values, gaps) = (BTreeMap::new(), BTreeMap::new());
        let mut preload = NodalPreload { values, is_force: false, gaps, scale, total, location };
        let read = DataTable::find_in(data, name).and_then(|table| preload.read(table));
        read.map_err(|error| Problem::new(stated.location_of("data", None), "data", error.message).help(error.help))?;
        Ok(Some(preload))
    }

    /// Reads the values of all nodes.
    fn read(&mut self, table: &DataTable) -> Result<(), ColumnError> {
        let name = &table.name;
        let error = |message: String, help: &str| ColumnError { message, help: help.to_owned() };
        if table.has("pressure") && table.has("force") {
            let message = format!("`{name}` has a column `pressure` and a column `force`");
            return Err(error(message, "rename one of them; the other is used"));
        }
        self.is_force = table.has("force");
        let (role, dimension) =
            if self.is_force { ("force", Dimension::FORCE) } else { ("pressure", Dimension::PRESSURE) };
        let (nodes, values) = (table.plain_numbers("node")?, table.values(role, dimension)?);
        if table.has("gap") && !table.has_unit("gap") {
            let message = format!("the column `gap` of `{name}` has no unit");
            return Err(error(message, "state it in [[data]]: columns = { gap = \"NAME [mm]\" }"));
        }
        let gaps = if table.has("gap") { table.values("gap", Dimension::LENGTH)? } else { Vec::new() };
        if nodes.len() != values.len() {
            let (nodes, values) = (nodes.len(), values.len());
            let message =
                format!("the column `node` of `{name}` has {nodes} rows, but the column `{role}` has {values}");
            return Err(error(message, "name columns of one result in [[data]]"));
        }
        for (row, (node, value)) in nodes.into_iter().zip(values).enumerate() {
            let wrong = |what: String| {
                let help = "correct the file: each row has the number of a node, and a value of zero or more that \
                            presses the faces together";
                error(format!("row {} of `{name}` {what}", row + 1), help)
            };
            if node.fract() != 0.0 || !node.is_finite() {
                return Err(wrong(format!("has the node {node}, which is not a whole number")));
            }
            if !(value.is_finite() && value >= 0.0) {
                return Err(wrong(format!("has the {role} {value} at node {node}")));
            }
            if self.values.insert(node as i64, value).is_some_and(|before| before != value) {
                return Err(wrong(format!("states another {role} of node {node} again")));
            }
            if let Some(gap) = gaps.get(row).filter(|gap| value == 0.0 && **gap > 0.0) {
                self.gaps.insert(node as i64, *gap);
            }
        }
        Ok(())
    }

    /// Returns the pressure (Pa) at a node with this area (m²), before `scale`.
    pub fn pressure(&self, node: i64, area: f64) -> f64 {
        let value = self.values.get(&node).copied().unwrap_or(0.0);
        if self.is_force { value / area } else { value }
    }

    /// Sets the preload of a law per area at a node with this pressure (Pa).
    pub fn set(&self, law: &mut CompiledTable, node: i64, pressure: f64) -> Result<(), Problem> {
        if law.entry(LAW_KEY).is_some() {
            let message = "the contact and its law both state a preload";
            return Err(Problem::new(law.location_of(LAW_KEY, None), LAW_KEY, message).help("remove one of them"));
        }
        let stiffness = law.entry("normal").map(|entry| &entry.value);
        let quantity = match (self.gaps.get(&node), stiffness) {
            (Some(gap), Some(CompiledValue::Quantity { quantity: normal, .. })) => {
                let pressure = times(normal, -gap, Dimension::LENGTH);
                CompiledQuantity { expression: pressure.expression.times(&self.scale.expression), ..pressure }
            }
            _ => times(&self.scale, pressure, Dimension::PRESSURE),
        };
        let within = Bounds::Finite;
        let value = CompiledValue::Quantity { quantity, dimension: Dimension::PRESSURE, within, example: "\"2 MPa\"" };
        law.entries.push(CompiledEntry { key: LAW_KEY, location: self.location.clone(), value });
        Ok(())
    }

    /// Returns the constant forces that balance a preload (N) along the normals of these places: on
    /// the first along its normal, on the second against it.
    pub fn balance(&self, contact: &CompiledTable, places: &[String], preload: f64) -> Vec<CompiledTable> {
        let force = |(place, sign): (&String, f64)| {
            let quantity = times(&self.scale, sign * preload, Dimension::FORCE);
            let (dimension, within) = (Dimension::FORCE, Bounds::Finite);
            let value = CompiledValue::Quantity { quantity, dimension, within, example: "\"10 N\"" };
            let entries = vec![
                entry("on", ResolvedValue::Text(format!("{place}.n")), &self.location),
                CompiledEntry { key: "amplitude", location: self.location.clone(), value },
                entry("harmonic", ResolvedValue::Count(0), &self.location),
            ];
            table_of_node(contact, place, entries)
        };
        places.iter().zip([1.0, -1.0]).map(force).collect()
    }

    /// Compares the forces of all joints, (node, area) each, with the stated sum.
    pub fn summary(&self, joints: &[(i64, f64)]) -> Result<PreloadSummary, Problem> {
        let pressures = || joints.iter().map(|(node, area)| self.pressure(*node, *area));
        let total: f64 = joints.iter().zip(pressures()).map(|((_, area), pressure)| area * pressure).sum();
        let nodes: HashSet<i64> = joints.iter().map(|(node, _)| *node).collect();
        let summary = PreloadSummary {
            total,
            pressures: [pressures().fold(f64::INFINITY, f64::min), pressures().fold(0.0, f64::max)],
            is_scaled: self.scale.text != "1",
            joints_without_row: nodes.iter().filter(|node| !self.values.contains_key(node)).count(),
            rows_without_joint: self
                .values
                .iter()
                .filter(|(node, value)| **value > 0.0 && !nodes.contains(node))
                .count(),
        };
        if summary.joints_without_row == nodes.len() {
            let message = "no row of the data belongs to a node of the contact";
            return Err(Problem::new(&self.location, LAW_KEY, message).help(
                "check the column `node`: the numbers of nodes in the static step and in the mesh must be equal",
            ));
        }
        if let Some(stated) = self.total.filter(|stated| (total / stated - 1.0).abs() > LARGEST_DIFFERENCE) {
            let number = |force: f64| format_significant(force, 4);
            let message =
                format!("the forces of the joints sum to {} N, but `total` is {} N", number(total), number(stated));
            // pressures at the edge of a partly closed contact belong to parts of the nodes' areas
            let forces = if self.is_force { "" } else { "; forces of nodes are more accurate than pressures" };
            let help = format!(
                "check the units of the columns and the set of the contact: {} rows belong to no joint, and {} of {} \
                 joints have no row{forces}",
                summary.rows_without_joint,
                summary.joints_without_row,
                joints.len()
            );
            return Err(Problem::new(&self.location, LAW_KEY, message).help(help));
        }
        Ok(summary)
    }
}

/// Returns a stated quantity times another one.
fn times(stated: &CompiledQuantity, si: f64, dimension: Dimension) -> CompiledQuantity {
    CompiledQuantity { expression: stated.expression.times(&Expression::quantity(si, dimension)), ..stated.clone() }
}
