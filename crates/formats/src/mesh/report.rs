//! A mesh in a few lines: sizes, elements, extent and sets.

use super::{Members, Mesh};
use crate::report::counted;
use std::collections::BTreeMap;
use std::fmt;

/// Most sets and notes that a report lists.
const LISTED: usize = 40;

/// Describes a mesh for a user.
pub struct MeshReport<'a>(pub &'a Mesh);

impl fmt::Display for MeshReport<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let MeshReport(mesh) = self;
        let mut shapes: BTreeMap<String, usize> = BTreeMap::new();
        mesh.elements().iter().for_each(|element| *shapes.entry(element.shape.to_string()).or_default() += 1);
        let shapes: Vec<String> = shapes.iter().map(|(shape, count)| format!("{count} {shape}")).collect();
        let shapes = if shapes.is_empty() { "no elements".to_owned() } else { shapes.join(", ") };
        writeln!(f, "mesh of {} nodes, {shapes}, from {}", mesh.nodes().len(), mesh.format())?;
        if let Some(extent) = mesh.extent() {
            let ends = extent.iter().flat_map(|range| [range.start, range.end]);
            let largest = ends.fold(0.0, |most: f64, end| most.max(end.abs()));
            // coordinates that are rounding, as those of a rotated system, are shown as zero
            let end = |end: f64| short(if end.abs() < 1e-9 * largest { 0.0 } else { end });
            let ranges = ["x", "y", "z"].iter().zip(&extent);
            let ranges: Vec<String> =
                ranges.map(|(axis, range)| format!("{axis} {} to {}", end(range.start), end(range.end))).collect();
            writeln!(f, "extent {}", ranges.join(", "))?;
        }
        let faces = mesh.outer_faces();
        if !faces.is_empty() {
            let area = faces.iter().map(super::Face::area).sum();
            writeln!(f, "{}, area {}", counted(faces.len(), "outer face"), short(area))?;
        }
        for set in mesh.sets().iter().take(LISTED) {
            let members = match &set.members {
                Members::Nodes(nodes) => counted(nodes.len(), "node"),
                Members::Elements(elements) => counted(elements.len(), "element"),
                Members::Sides(sides) => counted(sides.len(), "side") + " of elements",
            };
            write!(f, "set {}: {members}", set.name)?;
            // the patch of the set that the name selects
            match mesh.set(&set.name).is_ok_and(|found| std::ptr::eq(found, set)).then(|| mesh.patch(&set.name)) {
                Some(Ok(patch)) => {
                    writeln!(f, ", {}, area {}", counted(patch.faces().len(), "outer face"), short(patch.area()))?
                }
                _ => writeln!(f)?,
            }
        }
        if mesh.sets().len() > LISTED {
            writeln!(f, "… and {} more sets", mesh.sets().len() - LISTED)?;
        }
        for note in mesh.notes().iter().take(LISTED) {
            writeln!(f, "note: {note}")?;
        }
        Ok(())
    }
}

/// Returns a number with six significant digits.
fn short(value: f64) -> String {
    let digits: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    digits.to_string()
}
