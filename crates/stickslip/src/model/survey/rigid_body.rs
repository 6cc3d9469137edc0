//! Detects bodies that no spring holds.

use super::super::{Body, GROUND, Mass, Model, System};
use super::LooseBody;
use super::stuck_joint::{StuckAxis, StuckState};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use stickslip_numerics::definiteness::sparse_definite;
use stickslip_numerics::sparse::SparseMatrix;

impl Model {
    /// Returns the bodies that no spring connects to the ground or to a moved place.
    pub(super) fn loose(&self, system: &System, joints: &[StuckAxis]) -> Vec<LooseBody> {
        let mut index: HashMap<String, usize> = HashMap::from([(GROUND.to_owned(), 0)]);
        for motion in &self.motions {
            index.insert(motion.on.clone(), 0); // moved places count as fixed, like the ground
        }
        // without a free motion all parts of the structure are held
        let held = system.reduced().is_none_or(|component| component.free_modes() == 0);
        let parts = if held { None } else { self.loose_parts() };
        let own = self.places.iter().filter(|place| place.view_of.is_none());
        // each place with the number of its loose part, from 1
        let of_component: Vec<(String, usize)> = own
            .flat_map(|place| {
                let mut rows = place.rows.iter().flatten().filter(|(_, weight)| *weight != 0.0);
                let part = match &parts {
                    None => usize::from(!held),
                    Some(parts) => {
                        rows.find_map(|(row, _)| parts.get(*row).filter(|part| **part > 0)).map_or(0, |p| *p)
                    }
                };
                place.places().into_iter().map(move |name| (name, part))
            })
            .collect();
        let of_bodies = self.bodies.iter().flat_map(Body::places);
        let mut places: Vec<String> = self.masses.iter().flat_map(Mass::places).chain(of_bodies).collect();
        for (i, place) in places.iter().enumerate() {
            index.entry(place.clone()).or_insert(i + 1);
        }
        let component = places.len();
        for (place, part) in &of_component {
            index.entry(place.clone()).or_insert(if *part == 0 { 0 } else { component + part });
        }
        let count = of_component.iter().map(|(_, part)| *part).max().unwrap_or(0);
        places.extend(of_component.into_iter().filter(|(_, part)| *part > 0).map(|(place, _)| place));
        let mut bodies = DisjointSets::new(component + count + 1);
        for body in self.bodies.iter().map(Body::places) {
            body.windows(2).for_each(|pair| bodies.union(index[&pair[0]], index[&pair[1]]));
        }
        for place in &self.places {
            // a second view of a node belongs to the body of the node
            let mass = self.masses.iter().find(|mass| place.view_of.as_ref() == Some(&mass.name)).map(Mass::places);
            let body = || self.bodies.iter().find(|body| place.view_of.as_ref() == Some(&body.name)).map(Body::places);
            let node = mass.or_else(body);
            let node: Vec<usize> = node.unwrap_or_default().iter().map(|name| index[name]).collect();
            node.windows(2).for_each(|pair| bodies.union(pair[0], pair[1]));
            if let Some(first) = node.first() {
                index.extend(place.places().into_iter().map(|name| (name, *first)));
            }
        }
        let ends = |between: &[String; 2]| Some((*index.get(&between[0])?, *index.get(&between[1])?));
        self.springs
            .iter()
            .filter(|s| s.stiffness > 0.0)
            .filter_map(|s| ends(&s.between))
            .for_each(|(a, b)| bodies.union(a, b));
        let (mut gripped, mut held) = (bodies.clone(), bodies.clone());
        let carry: BTreeSet<usize> =
            joints.iter().filter(|j| j.state != StuckState::Nothing).map(|j| j.joint).collect();
        let faces: BTreeSet<usize> = joints.iter().filter(|j| j.pressed.is_some()).map(|j| j.joint).collect();
        // joints with faces at each body: with contact force (touched) and without
        let (mut pressing, mut touching) = (Vec::<(usize, &str)>::new(), Vec::<(usize, &str)>::new());
        for (number, (joint, labels)) in self.joints.iter().zip(self.joint_labels()).enumerate() {
            // joints between nodes act along each direction
            let along = |name: &String, label: &String| match label.strip_prefix(joint.name.as_str()) {
                Some(rest) if !rest.is_empty() && name != GROUND => format!("{name}{rest}"),
                _ => name.clone(),
            };
            for label in labels {
                let between = [along(&joint.between[0], &label), along(&joint.between[1], &label)];
                let Some((a, b)) = ends(&between) else { continue };
                let carries = carry.contains(&number);
                if carries {
                    gripped.union(a, b);
                }
                if carries || joint.law.force_scale().is_infinite() && joint.law.closed_stiffness().is_none() {
                    held.union(a, b);
                }
                if faces.contains(&number) {
                    let found = if carries { &mut pressing } else { &mut touching };
                    found.extend([(a, joint.name.as_str()), (b, joint.name.as_str())]);
                }
            }
        }
        let mut loose: Vec<LooseBody> = Vec::new();
        let mut known: HashMap<usize, usize> = HashMap::new();
        for place in &places {
            let at = index[place];
            let body = bodies.find(at);
            if body == bodies.find(0) {
                continue;
            }
            match known.get(&body) {
                Some(one) => loose[*one].masses.push(place.clone()),
                None => {
                    let held_by_friction = gripped.find(at) == gripped.find(0);
                    let held_in_motion = !held_by_friction && held.find(at) == held.find(0);
                    known.insert(body, loose.len());
                    let of_body = |found: &[(usize, &str)]| {
                        let mut names: Vec<String> = Vec::new();
                        for (_, name) in found.iter().filter(|(end, _)| bodies.find(*end) == body) {
                            if names.last().is_none_or(|last| last != name) {
                                names.push((*name).to_owned());
                            }
                        }
                        names
                    };
                    let (contacts, faces) = (of_body(&pressing), of_body(&touching));
                    loose.push(LooseBody {
                        masses: vec![place.clone()],
                        held_by_friction,
                        held_in_motion,
                        contacts,
                        faces,
                    });
                }
            }
        }
        loose
    }

    /// Returns for every row of the structure the number of its part, from 1, or 0 if the part is
    /// held. Parts are not connected by the stiffness. `None` if the structure is one part, or a
    /// sector of a disk.
    fn loose_parts(&self) -> Option<Vec<usize>> {
        let own = self.substructure.as_ref().filter(|own| own.disk.is_none())?;
        let stiffness = own.component.matrices().2;
        let n = stiffness.n();
        let mut connected = DisjointSets::new(n);
        stiffness.entries().filter(|entry| entry.2 != 0.0).for_each(|(row, column, _)| connected.union(row, column));
        let mut rows: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        (0..n).for_each(|row| rows.entry(connected.find(row)).or_default().push(row));
        if rows.len() == 1 {
            return None;
        }
        let (mut parts, mut count) = (vec![0; n], 0);
        for rows in rows.values() {
            let number: HashMap<usize, usize> = rows.iter().enumerate().map(|(new, row)| (*row, new)).collect();
            let entries = rows.iter().flat_map(|column| {
                let new = number[column];
                let entries = stiffness.column(*column).filter(|(_, value)| *value != 0.0);
                entries.map(move |(row, value)| (row, new, value)).collect::<Vec<_>>()
            });
            let block =
                SparseMatrix::from_triplets(rows.len(), entries.map(|(row, new, value)| (number[&row], new, value)));
            if block.is_ok_and(|block| sparse_definite(&block) != Some(true)) {
                count += 1;
                rows.iter().for_each(|row| parts[*row] = count);
            }
        }
        Some(parts)
    }
}

/// Disjoint sets of connected items.
#[derive(Debug, Clone)]
pub(super) struct DisjointSets {
    parent: Vec<usize>,
}

impl DisjointSets {
    pub(super) fn new(count: usize) -> Self {
        DisjointSets { parent: (0..count).collect() }
    }

    /// Returns the lowest member of the group of `i`.
    pub(super) fn find(&self, mut i: usize) -> usize {
        while self.parent[i] != i {
            i = self.parent[i];
        }
        i
    }

    pub(super) fn union(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b)] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use crate::model::{Model, Place, Substructure, SubstructureDamping};
    use crate::structure::{Component, Reduction, ReductionKind};
    use stickslip_numerics::sparse::SparseMatrix;

    /// A held chain and a free one in the same matrices: only the free one is loose.
    #[test]
    fn parts_of_a_structure_are_separate_bodies() {
        let stiffness = [(0, 0, 3.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)];
        let free = [(2, 2, 2.0), (2, 3, -2.0), (3, 2, -2.0), (3, 3, 2.0)];
        let stiffness = SparseMatrix::from_triplets(4, stiffness.into_iter().chain(free)).unwrap();
        let mass = SparseMatrix::from_triplets(4, (0..4).map(|i| (i, i, 1.0))).unwrap();
        let model = Model {
            places: vec![Place::new("held", vec![(1, 1.0)]), Place::new("free", vec![(3, 1.0)])],
            substructure: Some(Substructure {
                component: Component::new(vec![String::new(); 4], mass, None, stiffness).unwrap(),
                damping: SubstructureDamping::Own,
                reduction: Reduction::Modes { modes: 3, kind: ReductionKind::Rubin, orders: 1, up_to: 0.0 },
                earlier_reduction: None,
                disk: None,
            }),
            ..Model::default()
        };
        let survey = model.survey().unwrap();
        let loose: Vec<&[String]> = survey.loose().iter().map(|one| one.masses.as_slice()).collect();
        assert_eq!(loose, [["free".to_owned()]]);
    }
}
