//! Warns of a mesh that does not belong to the matrices of the structure.
//!
//! A small rotation of the whole structure strains nothing: `K (ω × r) = 0` at every row whose
//! neighbours all move along. The rows next to constraints and springs to the ground are those
//! with a force under a translation.

use crate::check::summary::structure::node_and_axis;
use crate::compile::mesh::MeshSource;
use std::collections::HashMap;
use stickslip::structure::Component;

/// Settings of the comparison.
#[derive(Debug, Clone, Copy)]
struct MeshFitSettings {
    /// Force of a row under a translation, relative to the sum of the magnitudes of its terms, up
    /// to which the row is compared. Text files with seven digits have 1e-7.
    translation: f64,
    /// Relative force under a rotation from which a row disagrees. The stresses of a loaded
    /// structure cause 1e-3, wrong coordinates 1e-2 to 1e-1.
    rotation: f64,
    /// Fraction of disagreeing rows from which there is a warning.
    disagreeing: f64,
    /// Number of compared rows from which there is a warning.
    compared: usize,
}

impl Default for MeshFitSettings {
    fn default() -> Self {
        MeshFitSettings { translation: 1e-6, rotation: 1e-2, disagreeing: 0.03, compared: 10 }
    }
}

/// Returns the warning if the coordinates of the mesh contradict the stiffness.
pub(super) fn mesh_misfit(component: &Component, source: &MeshSource) -> Option<String> {
    let nodes = source.mesh.nodes().iter().map(|node| (node.number, node.position));
    let (disagreeing, compared) = disagreeing_rows(component, &nodes.collect())?;
    Some(format!(
        "the mesh does not fit the matrices: a small rotation of the whole structure causes forces at {disagreeing} of \
         {compared} rows. The files may be of different models, or the rows along other axes than the coordinates; \
         contacts, pressures and pictures are then wrong"
    ))
}

/// Returns the numbers of rows that disagree with the coordinates, and of rows that are compared;
/// `None` if too few disagree.
fn disagreeing_rows(component: &Component, nodes: &HashMap<i64, [f64; 3]>) -> Option<(usize, usize)> {
    let settings = MeshFitSettings::default();
    let positions: Vec<Option<(usize, [f64; 3])>> = component.rows().iter().map(|name| position(name, nodes)).collect();
    let stiffness = component.matrices().2;
    // three translations, then three rotations about the middle of the structure
    let known = || positions.iter().flatten();
    let middle: [f64; 3] =
        std::array::from_fn(|i| known().map(|(_, at)| at[i]).sum::<f64>() / known().count().max(1) as f64);
    let moved = |(axis, at): (usize, [f64; 3])| -> [f64; 6] {
        let [x, y, z] = std::array::from_fn(|i| at[i] - middle[i]);
        let rotated = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]][axis];
        std::array::from_fn(|i| if i < 3 { f64::from(i == axis) } else { rotated[i - 3] })
    };
    let moved: Vec<[f64; 6]> = positions.iter().map(|position| position.map_or([0.0; 6], moved)).collect();
    let mut forces = vec![([0.0; 6], [0.0; 6]); component.dofs()];
    for (row, column, value) in stiffness.entries() {
        let (sum, magnitude) = &mut forces[row];
        for i in 0..6 {
            let term = value * moved[column][i];
            sum[i] += term;
            magnitude[i] += term.abs();
        }
    }
    let relative = |(sum, magnitude): &([f64; 6], [f64; 6]), i: usize| {
        if magnitude[i] > 0.0 { (sum[i] / magnitude[i]).abs() } else { 0.0 }
    };
    let compared = forces
        .iter()
        .zip(&positions)
        .filter(|(force, position)| position.is_some() && (0..3).all(|i| relative(force, i) <= settings.translation));
    let disagrees = compared.map(|(force, _)| (3..6).any(|i| relative(force, i) > settings.rotation));
    let disagrees: Vec<bool> = disagrees.collect();
    let count = disagrees.iter().filter(|disagrees| **disagrees).count();
    let is_misfit =
        disagrees.len() >= settings.compared && count as f64 > settings.disagreeing * disagrees.len() as f64;
    is_misfit.then_some((count, disagrees.len()))
}

/// Returns direction and position of a row `17.y`, if the mesh has the node.
fn position(row: &str, nodes: &HashMap<i64, [f64; 3]>) -> Option<(usize, [f64; 3])> {
    let (node, axis) = node_and_axis(row)?;
    Some((axis, *nodes.get(&i64::try_from(node).ok()?)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_numerics::sparse::SparseMatrix;

    /// A cube of 4 x 4 x 4 nodes with bars of stiffness 1 between all nodes of a cell; the first
    /// layer is constrained. A bar has the stiffness `n nᵀ` along its direction n.
    fn truss() -> (Component, HashMap<i64, [f64; 3]>) {
        let at = |i: usize| [i % 4, i / 4 % 4, i / 16].map(|x| x as f64);
        let free = |i: usize| i >= 16;
        let mut entries = Vec::new();
        for (a, b) in (0..64).flat_map(|a| (0..a).map(move |b| (a, b))) {
            let along: [f64; 3] = std::array::from_fn(|i| at(a)[i] - at(b)[i]);
            if along.iter().any(|x| x.abs() > 1.0) {
                continue;
            }
            let square: f64 = along.iter().map(|x| x * x).sum();
            for (i, k) in (0..3).flat_map(|i| (0..3).map(move |k| (i, k))) {
                let stiffness = along[i] * along[k] / square;
                for (p, q, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                    if free(p) && free(q) {
                        entries.push((3 * (p - 16) + i, 3 * (q - 16) + k, sign * stiffness));
                    }
                }
            }
        }
        let n = 3 * 48;
        let rows = (0..n).map(|row| format!("{}.{}", 16 + row / 3, ["x", "y", "z"][row % 3])).collect();
        let stiffness = SparseMatrix::from_triplets(n, entries).unwrap();
        let mass = SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 1.0))).unwrap();
        let component = Component::new(rows, mass, None, stiffness).unwrap();
        (component, (0..64).map(|i| (i as i64, at(i).map(|x| 10.0 * x - 7.0))).collect())
    }

    /// Two layers of 16 nodes do not touch the constrained layer: 96 rows are compared.
    #[test]
    fn another_mesh_disagrees_with_the_stiffness() {
        let (component, own) = truss();
        assert_eq!(disagreeing_rows(&component, &own), None);
        let changed = |change: &dyn Fn(i64, [f64; 3]) -> [f64; 3]| -> HashMap<i64, [f64; 3]> {
            own.iter().map(|(number, at)| (*number, change(*number, *at))).collect()
        };
        let renumbered = changed(&|number, _| own[&((number + 5) % 64)]);
        let exchanged = changed(&|_, [x, y, z]| [y, x, z]);
        for other in [renumbered, exchanged] {
            let (disagreeing, compared) = disagreeing_rows(&component, &other).unwrap();
            assert!(compared == 96 && disagreeing > 48, "{disagreeing} {compared}");
        }
        // the unit of length and the origin do not matter
        assert_eq!(disagreeing_rows(&component, &changed(&|_, at| at.map(|x| 1e-3 * x + 4.0))), None);
        // without known nodes nothing is compared
        assert_eq!(disagreeing_rows(&component, &HashMap::new()), None);
    }
}
