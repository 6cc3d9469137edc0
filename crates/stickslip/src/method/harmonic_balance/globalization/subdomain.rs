//! Subdomain of a large structure around some contacts. Places outside of it are fixed.

use crate::method::harmonic_balance::aft::{Ports, tangent_range};
use crate::method::harmonic_balance::dynamics::banded::BandedForm;
use stickslip_numerics::banded::BandedMatrix;

/// Adjacency of ports and places.
#[derive(Debug, Clone)]
pub(crate) struct Adjacency {
    /// Places of every port.
    of_port: Vec<Vec<usize>>,
    /// Ports at every place, and the places that the structure couples with it.
    at_place: Vec<Vec<usize>>,
    links: Vec<Vec<usize>>,
}

impl Adjacency {
    pub fn new(banded: &BandedForm, ports: &Ports) -> Self {
        let (mut at_place, mut links) = (vec![Vec::new(); banded.places()], vec![Vec::new(); banded.places()]);
        let mut of_port = Vec::new();
        for (p, port) in ports.iter().enumerate() {
            let mut places: Vec<usize> = port.range().flat_map(|q| banded.ends(q)).map(|(i, _)| *i).collect();
            places.sort_unstable();
            places.dedup();
            places.iter().for_each(|i| at_place[*i].push(p));
            of_port.push(places);
        }
        banded.couplings().for_each(|(i, l)| links[i].push(l));
        Adjacency { of_port, at_place, links }
    }

    /// Groups the marked ports into clusters of adjacent ports, with at most
    /// `most` axes each. Ports are in ascending order.
    pub fn clusters(&self, ports: &Ports, marked: &[bool], most: usize) -> Vec<Vec<usize>> {
        let mut left = marked.to_vec();
        let mut clusters = Vec::new();
        for first in 0..ports.len() {
            if !std::mem::take(&mut left[first]) {
                continue;
            }
            let (mut cluster, mut axes, mut next) = (vec![first], ports[first].axes, 0);
            while next < cluster.len() {
                for &place in &self.of_port[cluster[next]] {
                    for p in self.with_adjacent_places(place).flat_map(|near| &self.at_place[near]).copied() {
                        if left[p] && axes + ports[p].axes <= most {
                            left[p] = false;
                            axes += ports[p].axes;
                            cluster.push(p);
                        }
                    }
                }
                next += 1;
            }
            cluster.sort_unstable();
            clusters.push(cluster);
        }
        clusters
    }

    /// Returns a place and the places that the structure couples with it.
    fn with_adjacent_places(&self, place: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::once(place).chain(self.links[place].iter().copied())
    }

    /// Returns the places of some ports, with `times` layers of adjacent places.
    fn subdomain_places(&self, cluster: &[usize], times: usize) -> Vec<usize> {
        let mut inside = vec![false; self.at_place.len()];
        let mut places = Vec::new();
        let mut add = |place: usize, places: &mut Vec<usize>| {
            if !std::mem::replace(&mut inside[place], true) {
                places.push(place);
            }
        };
        cluster.iter().flat_map(|p| &self.of_port[*p]).for_each(|place| add(*place, &mut places));
        let mut begin = 0;
        for _ in 0..times {
            let end = places.len();
            for at in begin..end {
                let place = places[at];
                self.links[place].iter().for_each(|near| add(*near, &mut places));
                self.at_place[place].iter().flat_map(|p| &self.of_port[*p]).for_each(|near| add(*near, &mut places));
            }
            begin = end;
        }
        places
    }
}

/// Memory of the nonlinear elimination.
#[derive(Debug, Clone)]
pub(crate) struct NonlinearElimination {
    pub neighbours: Adjacency,
    /// Derivatives of the forces at the beginning of the step.
    pub tangents: Vec<f64>,
    /// Newton step of all contacts, in units.
    pub step: Vec<f64>,
    /// Nonlinear parts of the forces of clusters, N, and the residual of their equations, m.
    pub nonlinear_forces: Vec<f64>,
    pub residual_steps: Vec<f64>,
    /// True unless the elimination was of little use at this point.
    pub is_useful: bool,
}

impl NonlinearElimination {
    pub fn new(neighbours: Adjacency) -> Self {
        let [tangents, step, beyond, left] = [const { Vec::new() }; 4];
        NonlinearElimination {
            neighbours,
            tangents,
            step,
            nonlinear_forces: beyond,
            residual_steps: left,
            is_useful: true,
        }
    }
}

/// Linear equations of a subdomain: its structure with the derivatives of all its contacts.
#[derive(Debug)]
pub(crate) struct Subdomain {
    /// Per axis of the cluster: (number of the place in the subdomain, direction).
    ends: Vec<Vec<(usize, f64)>>,
    /// Number of unknowns of a place.
    size: usize,
    /// The structure alone, factored.
    structure: BandedMatrix,
    /// The equations, their factor, and the factor with changed derivatives of the cluster.
    matrix: BandedMatrix,
    factored: BandedMatrix,
    changed: BandedMatrix,
    right: Vec<f64>,
}

impl Subdomain {
    /// Creates the subdomain around some ports, with the derivatives `tangents`
    /// of all. `None` if the equations are singular.
    pub fn new(
        banded: &BandedForm,
        neighbours: &Adjacency,
        ports: &Ports,
        (cluster, times): (&[usize], usize),
        (tangents, blocks): (&[f64], &[usize]),
    ) -> Option<Self> {
        let size = banded.unknowns();
        let mut places = neighbours.subdomain_places(cluster, times);
        places.sort_unstable_by_key(|place| banded.position(*place));
        let mut number = vec![None; banded.places()];
        places.iter().enumerate().for_each(|(i, place)| number[*place] = Some(i));
        let mut near: Vec<usize> = places.iter().flat_map(|place| &neighbours.at_place[*place]).copied().collect();
        near.sort_unstable();
        near.dedup();
        let here = |ends: &[(usize, f64)]| -> Vec<(usize, f64)> {
            ends.iter().filter_map(|(place, w)| Some((number[*place]?, *w))).collect()
        };
        let mut band = 0;
        for (i, place) in places.iter().enumerate() {
            let by_ports = neighbours.at_place[*place].iter().flat_map(|p| &neighbours.of_port[*p]);
            let coupled = neighbours.links[*place].iter().chain(by_ports).filter_map(|near| number[*near]);
            band = coupled.map(|l| i.abs_diff(l)).fold(band, usize::max);
        }
        let mut matrix = BandedMatrix::new(places.len() * size, (band + 1) * size - 1);
        banded.add_structure(|place| number[place], &mut matrix);
        let mut alone = matrix.clone();
        if !alone.factor() {
            return None;
        }
        for &p in &near {
            let port = &ports[p];
            let ends: Vec<Vec<(usize, f64)>> = port.range().map(|q| here(banded.ends(q))).collect();
            add_port(&ends, &tangents[tangent_range(blocks, p, port, size / 2)], size, &mut matrix);
        }
        let mut factored = matrix.clone();
        if !factored.factor() {
            return None;
        }
        let ends = cluster.iter().flat_map(|p| ports[*p].range()).map(|q| here(banded.ends(q))).collect();
        Some(Subdomain {
            ends,
            size,
            structure: alone,
            changed: matrix.clone(),
            matrix,
            factored,
            right: vec![0.0; places.len() * size],
        })
    }

    /// Replaces forces along the axes of the cluster by the motion along them.
    pub fn solve(&mut self, forces: &mut [f64]) {
        solve_along(&self.ends, self.size, (&self.factored, &mut self.right), forces);
    }

    /// Replaces forces by the motion of the structure alone.
    pub fn solve_structure(&mut self, forces: &mut [f64]) {
        solve_along(&self.ends, self.size, (&self.structure, &mut self.right), forces);
    }

    /// Factors the equations with the derivatives of the cluster's ports changed by `slopes`,
    /// one block after the other. Returns false if they are singular.
    pub fn factor_changed(&mut self, axes: impl Iterator<Item = usize>, slopes: &[f64]) -> bool {
        self.changed.clone_from(&self.matrix);
        let (mut first, mut from) = (0, 0);
        for axes in axes {
            let entries = (axes * self.size).pow(2);
            add_port(&self.ends[first..first + axes], &slopes[from..from + entries], self.size, &mut self.changed);
            first += axes;
            from += entries;
        }
        self.changed.factor()
    }

    /// Replaces forces by the motion with these changed derivatives.
    pub fn solve_changed(&mut self, forces: &mut [f64]) {
        solve_along(&self.ends, self.size, (&self.changed, &mut self.right), forces);
    }
}

/// Replaces forces along axes by the motions along them.
fn solve_along(
    ends: &[Vec<(usize, f64)>],
    size: usize,
    (matrix, right): (&BandedMatrix, &mut [f64]),
    forces: &mut [f64],
) {
    right.fill(0.0);
    for (ends, forces) in ends.iter().zip(forces.chunks_exact(size)) {
        for &(i, w) in ends {
            right[i * size..(i + 1) * size].iter_mut().zip(forces).for_each(|(sum, f)| *sum += w * f);
        }
    }
    matrix.solve(right);
    for (ends, motion) in ends.iter().zip(forces.chunks_exact_mut(size)) {
        motion.fill(0.0);
        for &(i, w) in ends {
            motion.iter_mut().zip(&right[i * size..(i + 1) * size]).for_each(|(u, x)| *u += w * x);
        }
    }
}

/// Adds the derivative of a port with the given ends.
fn add_port(ends: &[Vec<(usize, f64)>], tangent: &[f64], size: usize, matrix: &mut BandedMatrix) {
    for (a, row) in tangent.chunks_exact(size * ends.len()).enumerate() {
        for &(i, w) in &ends[a / size] {
            for (ends, row) in ends.iter().zip(row.chunks_exact(size)) {
                for &(l, v) in ends {
                    for (b, value) in row.iter().enumerate() {
                        matrix.add(i * size + a % size, l * size + b, w * v * value);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::homotopy::GIVEN_EQUATIONS;
    use super::*;
    use crate::law::Jenkins;
    use crate::method::harmonic_balance::aft::tangent_ranges;
    use crate::method::harmonic_balance::dynamics::banded::StepParameters;
    use crate::model::{GROUND, Joint, Mass, Model, Spring};
    use std::sync::Arc;

    const BLADES: usize = 40;
    const HARMONICS: [usize; 2] = [1, 3];

    /// A ring, with pseudo-random derivatives of its forces.
    fn ring() -> (BandedForm, Ports, Vec<f64>, Vec<usize>) {
        let name = |i: usize| format!("b{}", i % BLADES);
        let mut model = Model::default();
        for i in 0..BLADES {
            model.masses.push(Mass::new(name(i), 1.0));
            model.springs.push(Spring {
                between: [name(i), GROUND.into()],
                stiffness: 1.0 + 0.01 * i as f64,
                damping: 0.1,
            });
            let law = Arc::new(Jenkins { stiffness: 1.0, limit: 1.0 });
            model.joints.push(Joint { name: format!("j{i}"), between: [name(i), name(i + 1)], law });
        }
        let system = model.assemble().unwrap();
        let ports = Ports::new(&system).unwrap();
        let mut banded = BandedForm::new(&system, &ports, &HARMONICS).unwrap();
        banded.factor_dynamic_stiffness(2.5).unwrap(); // above all resonances, where motion decays from blade to blade
        let (blocks, size) = tangent_ranges(&ports, HARMONICS.len());
        let tangents: Vec<f64> = (0..size).map(|i| 0.2 * ((i * 7919 + 13) as f64).sin()).collect();
        let along = StepParameters { penalty: &vec![0.0; ports.len()], homotopy: GIVEN_EQUATIONS };
        assert!(banded.linearise(&ports, &along, &tangents));
        (banded, ports, tangents, blocks)
    }

    /// A subdomain with all places around it is the whole structure; one with a
    /// few places is nearly the same.
    #[test]
    fn subdomain_agrees_with_whole_structure() {
        let (mut banded, ports, tangents, blocks) = ring();
        let neighbours = Adjacency::new(&banded, &ports);
        let size = 2 * HARMONICS.len();
        let cluster = [7, 8, 9];
        let mut whole = vec![0.0; BLADES * size];
        (0..3 * size).for_each(|i| whole[7 * size + i] = 1.0 + i as f64);
        let forces = whole[7 * size..10 * size].to_vec();
        banded.solve_along_axes(&mut whole);
        for (around, error) in [(BLADES, 1e-12), (3, 1e-3)] {
            let at = (&cluster[..], around);
            let mut subdomain = Subdomain::new(&banded, &neighbours, &ports, at, (&tangents, &blocks)).unwrap();
            let mut motion = forces.clone();
            subdomain.solve(&mut motion);
            let largest = motion.iter().fold(0.0, |m: f64, u| m.max(u.abs()));
            for (u, v) in motion.iter().zip(&whole[7 * size..]) {
                assert!((u - v).abs() < error * largest, "{around}: {u} {v}");
            }
        }
    }

    /// Adjacent marked ports form one cluster, up to the size limit.
    #[test]
    fn clusters_are_neighbours() {
        let (banded, ports, ..) = ring();
        let neighbours = Adjacency::new(&banded, &ports);
        let marked: Vec<bool> = (0..BLADES).map(|i| [0, 3, 4, 5, 20, BLADES - 1].contains(&i)).collect();
        assert_eq!(neighbours.clusters(&ports, &marked, 8), [vec![0, BLADES - 1], vec![3, 4, 5], vec![20]]);
        assert_eq!(neighbours.clusters(&ports, &marked, 2).len(), 4);
    }
}
