//! Coordinates of a model, and its places as weighted sums of them.
//!
//! The order is: coordinates of the substructure (all its rows, or those of its reduction), one
//! coordinate for each direction of each mass, and those of the rigid bodies. A ring has the
//! coordinates of its first sector, then those of the second, and so on.
//!
//! Places with an imposed motion are coordinates too. Each replaces the coordinate on which it
//! depends most: `x = T (q, u)` with the moved displacements `u` at the end. `Tᵀ M T` contains
//! their coupling with the other coordinates.

use super::Model;
use super::body::Body;
use super::error::{Element, ModelError};
use super::name_resolution::{PlaceSource, Places};
use super::place::Place;
use super::substructure::{Entries, RingEntries, SubstructureParts};
use crate::structure::reduction::Row;
use crate::structure::{ModalDamping, ReducedComponent};
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::sync::Arc;
use stickslip_numerics::eigen;

/// Coordinates of a model.
pub(super) struct Coordinates {
    /// Number of free coordinates.
    pub free: usize,
    /// Number of moved coordinates, which follow the free ones.
    pub moved: usize,
    /// Names of the free coordinates.
    pub names: Vec<String>,
    /// The declared places, over the free and then the moved coordinates.
    pub places: Vec<Row>,
    /// Marks places without results: places of a body that follow an imposed motion of that
    /// body.
    pub without_results: Vec<bool>,
    /// Mass, damping and stiffness of the substructure and the bodies.
    pub entries: [Entries; 3],
    /// Matrices of equal sectors, in addition; none if a motion is imposed.
    pub ring: Option<RingEntries>,
    /// Modal damping in addition to the damping entries, over the free and then the moved
    /// coordinates.
    pub modes: Option<ModalDamping>,
    pub reduced: Option<Arc<ReducedComponent>>,
    order: SectorOrder,
    elimination: MotionElimination,
}

/// Relative tolerance: a moved place whose free part is smaller depends on other places and is
/// not a separate coordinate.
const DEPENDENCE_TOLERANCE: f64 = 1e-10;

impl Coordinates {
    pub fn new(model: &Model, places: &Places) -> Result<Self, ModelError> {
        let part = model
            .substructure
            .as_ref()
            .map_or_else(|| Ok(SubstructureParts::default()), |own| SubstructureParts::new(own, model))?;
        let of_disk = model.substructure.as_ref().is_some_and(|own| own.disk.is_some());
        let masses: usize = model.masses.iter().map(|mass| mass.directions.len().max(1)).sum();
        let bodies: usize = model.bodies.iter().map(|body| body.directions.len()).sum();
        // a ring of masses without matrices and bodies is already in the order of its sectors
        let ring = model.ring.filter(|ring| of_disk || whole_sectors(ring.sectors, [part.names.len(), masses, bodies]));
        let sectors = ring.map_or(1, |ring| ring.sectors);
        let [part_each, masses_each, bodies_each] = [part.names.len(), masses, bodies].map(|count| count / sectors);
        let order = SectorOrder { sectors, part: part_each, masses: masses_each, bodies: bodies_each };
        let mut names = vec![String::new(); part.names.len() + masses + bodies];
        let of_bodies = BodyCoordinates::new(model, &order);
        part.names.into_iter().enumerate().for_each(|(at, name)| names[order.of_part(at)] = name);
        let mut own = 0;
        let mut rows: Vec<Row> = Vec::with_capacity(places.stated.len());
        for place in &places.stated {
            rows.push(match place.of {
                PlaceSource::Component(index, along) => match part.places.get(index) {
                    Some(rows) => rows[along].iter().map(|(at, weight)| (order.of_part(*at), *weight)).collect(),
                    None => {
                        let message = "the model has no structure for this place; add [structure]";
                        return Err(ModelError::new(Element::Place(index), "name", message));
                    }
                },
                // filled in below, after the rows of the nodes
                PlaceSource::View(..) => Row::new(),
                PlaceSource::Own(_) => {
                    let at = if own < masses { order.of_mass(own) } else { names.len() };
                    match names.get_mut(at) {
                        Some(name) => name.clone_from(&place.name),
                        None => names.push(place.name.clone()),
                    }
                    own += 1;
                    vec![(at, 1.0)]
                }
                PlaceSource::Body(index, along) => {
                    let at = of_bodies.first[index];
                    names[at + along].clone_from(&place.name);
                    model.bodies[index].coordinates(&model.bodies[index].directions[along], at)
                }
            });
        }
        for (place, stated) in places.stated.iter().enumerate() {
            if let PlaceSource::View(index, along) = stated.of {
                rows[place] = node_view(&model.places[index], along, places, &rows);
            }
        }
        let of_part = |entries: Entries| -> Entries {
            entries.into_iter().map(|(row, column, v)| (order.of_part(row), order.of_part(column), v)).collect()
        };
        let mut entries = part.entries.map(of_part);
        let mut ring_entries = part.ring;
        if places.stated.iter().any(|place| place.moved)
            && let Some(ring) = ring_entries.take()
        {
            entries = ring.around(names.len() / ring.sectors);
        }
        entries[0].extend(of_bodies.mass(model));
        let modes = part.modes.map(|modes| {
            let mut columns = vec![0.0; modes.iter().count() * names.len()];
            for (column, own) in columns.chunks_exact_mut(names.len().max(1)).zip(modes.iter()) {
                own.iter().enumerate().for_each(|(at, value)| column[order.of_part(at)] = *value);
            }
            ModalDamping::new(names.len(), Arc::new(columns))
        });
        let moved: Vec<(&str, &Row)> = places
            .stated
            .iter()
            .zip(&rows)
            .filter(|(place, _)| place.moved)
            .map(|(place, row)| (place.name.as_str(), row))
            .collect();
        let mut turned = MotionElimination::new(names.len(), &moved)?;
        // a body has more points than coordinates, so that a moved point moves other points
        let of_body: Vec<bool> = match model.bodies.is_empty() {
            true => vec![false; rows.len()],
            false => places.stated.iter().map(|place| model.is_of_body(&place.name)).collect(),
        };
        let others = places.stated.iter().zip(&rows).zip(&of_body);
        let others = others.filter(|((place, _), of_body)| !place.moved && !**of_body).map(|(other, _)| other);
        turned.decouple(&others.map(|(_, row)| turned.row(row)).collect::<Vec<Row>>());
        let placed: Vec<Row> = rows.iter().map(|row| turned.row(row)).collect();
        let without_results = check_followers(model, places, (&placed, &of_body), turned.free)?;
        Ok(Coordinates {
            free: turned.free,
            moved: moved.len(),
            names: names.into_iter().zip(&turned.pivot).filter(|(_, pivot)| !**pivot).map(|(name, _)| name).collect(),
            places: placed,
            without_results,
            entries: entries.map(|entries| turned.entries(entries)),
            ring: ring_entries,
            modes: modes.map(|modes| turned.modes(&modes, moved.len())),
            reduced: part.reduced,
            order,
            elimination: turned,
        })
    }

    /// Returns a coordinate of the substructure over the free and then the moved coordinates.
    pub fn of_substructure(&self, at: usize) -> Row {
        self.elimination.row(&vec![(self.order.of_part(at), 1.0)])
    }

    /// Returns the number of a declared place among the moved places.
    pub fn moved_number(&self, places: &Places, place: usize) -> Option<usize> {
        places.stated[place].moved.then(|| places.stated[..place].iter().filter(|place| place.moved).count())
    }
}

/// Returns one direction of a place that is a second view of a node, over the coordinates of
/// that node.
fn node_view(place: &Place, along: usize, places: &Places, rows: &[Row]) -> Row {
    let of = place.view_of.as_deref().unwrap_or_default();
    let is_of = |name: &str| name == of || name.split_once('.').is_some_and(|(node, _)| node == of);
    let node: Vec<&Row> =
        places.stated.iter().zip(rows).filter(|(stated, _)| is_of(&stated.name)).map(|(_, row)| row).collect();
    let shares = &place.displacements(&place.rows)[along];
    shares
        .iter()
        .flat_map(|(direction, share)| node[*direction].iter().map(move |(at, weight)| (*at, weight * share)))
        .collect()
}

/// The order of the coordinates of a substructure, of masses and of bodies: sector by sector.
struct SectorOrder {
    sectors: usize,
    /// Number of coordinates of the substructure in a sector.
    part: usize,
    masses: usize,
    bodies: usize,
}

impl SectorOrder {
    fn of_part(&self, at: usize) -> usize {
        at + at / self.part * (self.masses + self.bodies)
    }

    fn of_mass(&self, at: usize) -> usize {
        let sector = (at / self.masses.max(1)).min(self.sectors - 1);
        at + (sector + 1) * self.part + sector * self.bodies
    }

    fn of_body(&self, at: usize) -> usize {
        let sector = (at / self.bodies.max(1)).min(self.sectors - 1);
        at + (sector + 1) * (self.part + self.masses)
    }
}

/// Returns whether each count divides into equal parts per sector.
fn whole_sectors(sectors: usize, counts: [usize; 3]) -> bool {
    counts.iter().all(|count| count.is_multiple_of(sectors))
}

/// Index of the first coordinate of every body.
struct BodyCoordinates {
    first: Vec<usize>,
}

impl BodyCoordinates {
    fn new(model: &Model, order: &SectorOrder) -> Self {
        let mut next = 0;
        let first = |body: &Body| {
            let at = order.of_body(next);
            next += body.directions.len();
            at
        };
        BodyCoordinates { first: model.bodies.iter().map(first).collect() }
    }

    /// Returns their mass entries. Every coordinate of a body has the mass of the body, because
    /// rotations are scaled by the radius of gyration.
    fn mass(&self, model: &Model) -> Entries {
        let bodies = model.bodies.iter().zip(&self.first);
        bodies.flat_map(|(body, first)| (*first..first + body.directions.len()).map(|at| (at, at, body.mass))).collect()
    }
}

/// Rejects places that follow moved places for any deformation of the structure.
///
/// Results come from the free coordinates alone. Places of moved bodies are not rejected. They
/// are marked as places without results if their imposed motion is not zero.
fn check_followers(
    model: &Model,
    places: &Places,
    (rows, of_body): (&[Row], &[bool]),
    free: usize,
) -> Result<Vec<bool>, ModelError> {
    let mut without_results = vec![false; rows.len()];
    let moved: Vec<&str> = places.stated.iter().filter(|place| place.moved).map(|place| place.name.as_str()).collect();
    let moves = |name: &str| model.motions.iter().any(|motion| motion.on == name && motion.amplitude != 0.0);
    for (number, (place, row)) in places.stated.iter().zip(rows).enumerate().filter(|(_, (place, _))| !place.moved) {
        let size = row.iter().fold(0.0, |most: f64, (_, weight)| most.max(weight.abs()));
        let mut on = row.iter().filter(|(at, weight)| *at >= free && weight.abs() > DEPENDENCE_TOLERANCE * size);
        if of_body[number] {
            without_results[number] = on.any(|(at, _)| moves(moved[at - free]));
            continue;
        }
        let Some((at, _)) = on.next() else { continue };
        let name = moved[at - free];
        let motion = model.motions.iter().position(|motion| motion.on == name).unwrap_or(0);
        let message = format!(
            "`{}` is determined by the imposed motion of `{name}`: both are weighted sums of the same rows, or the \
             reduced model cannot distinguish them; remove the place, or set reduce = false in [structure]",
            place.name
        );
        return Err(ModelError::new(Element::Motion(motion), "on", message));
    }
    Ok(without_results)
}

/// The transformation `x = T (q, u)`, in which moved displacements replace some coordinates.
struct MotionElimination {
    free: usize,
    /// Marks the replaced coordinates.
    pivot: Vec<bool>,
    rows: Vec<Row>,
}

impl MotionElimination {
    fn new(count: usize, moved: &[(&str, &Row)]) -> Result<Self, ModelError> {
        // x_p = Σ a x + Σ b u for every replaced coordinate; the indices of u begin at `count`
        let mut given: BTreeMap<usize, Row> = BTreeMap::new();
        for (k, (name, row)) in moved.iter().enumerate() {
            let row = merge_duplicates(substituted(row, &given));
            let size = row.iter().fold(0.0, |most: f64, (_, weight)| most.max(weight.abs()));
            let free = row.iter().filter(|(at, _)| *at < count);
            let most = free.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()).then(b.0.cmp(&a.0)));
            let Some(&(at, weight)) = most.filter(|(_, weight)| weight.abs() > DEPENDENCE_TOLERANCE * size) else {
                let message =
                    format!("the motion of `{name}` is determined by other imposed motions; remove one of them");
                return Err(ModelError::new(Element::Motion(0), "on", message));
            };
            let mut own: Row = vec![(count + k, 1.0 / weight)];
            own.extend(row.iter().filter(|part| part.0 != at).map(|part| (part.0, -part.1 / weight)));
            let one = BTreeMap::from([(at, own)]);
            given.values_mut().for_each(|other| *other = merge_duplicates(substituted(other, &one)));
            given.extend(one);
        }
        let free = count - given.len();
        let pivot: Vec<bool> = (0..count).map(|at| given.contains_key(&at)).collect();
        let mut new = Vec::with_capacity(count);
        let mut next = 0;
        for gone in &pivot {
            new.push(next);
            next += usize::from(!gone);
        }
        let renumber = |at: usize| if at < count { new[at] } else { free + (at - count) };
        let row = |at: usize| match given.get(&at) {
            Some(row) => row.iter().map(|(at, weight)| (renumber(*at), *weight)).collect(),
            None => vec![(renumber(at), 1.0)],
        };
        Ok(MotionElimination { free, rows: (0..count).map(row).collect(), pivot })
    }

    /// Changes the transformation so that none of the places `others` depends directly on a
    /// moved displacement.
    ///
    /// In a reduced model all places would depend on it, because none of them is a coordinate.
    /// `x = Z q + t u` describes the same structure for every `t` that moves the moved place by
    /// one. This function takes the `t` of the least norm that does not move the other places.
    /// The places stay unchanged if no such `t` exists.
    fn decouple(&mut self, others: &[Row]) {
        let size = |row: &Row| row.iter().fold(0.0, |most: f64, (_, weight)| most.max(weight.abs()));
        let moved = self.rows.iter().flatten().map(|(at, _)| (at + 1).saturating_sub(self.free)).max().unwrap_or(0);
        let follows = |row: &Row| {
            row.iter().any(|(at, weight)| *at >= self.free && weight.abs() > DEPENDENCE_TOLERANCE * size(row))
        };
        // Largest number of places for which `MotionElimination::decouple` decouples the moved
        // displacements. The Gram matrix of more places would be large.
        if others.len() > 2000 || !others.iter().any(follows) {
            return;
        }
        let mut parts = DMatrix::zeros(others.len(), self.free + moved);
        for (place, row) in others.iter().enumerate().filter(|(_, row)| size(row) > 0.0) {
            row.iter().for_each(|(at, weight)| parts[(place, *at)] += weight / size(row));
        }
        let (own, direct) = (parts.columns(0, self.free), parts.columns(self.free, moved));
        let Some(eigen) = eigen::symmetric(own * own.transpose()) else { return };
        let least = DEPENDENCE_TOLERANCE * eigen.eigenvalues.amax();
        let inverse = eigen.eigenvalues.map(|value| if value > least { 1.0 / value } else { 0.0 });
        let shapes = &eigen.eigenvectors;
        let weights = shapes * DMatrix::from_diagonal(&inverse) * (shapes.transpose() * direct);
        let with = own.transpose() * weights * -1.0;
        for row in &mut self.rows {
            let more: Row = (0..moved)
                .map(|k| {
                    (
                        self.free + k,
                        row.iter().filter(|(at, _)| *at < self.free).map(|(at, w)| w * with[(*at, k)]).sum(),
                    )
                })
                .filter(|(_, weight)| *weight != 0.0)
                .collect();
            row.extend(more);
            *row = merge_duplicates(std::mem::take(row));
        }
    }

    /// Transforms a weighted sum of the coordinates to the free and then the moved coordinates.
    fn row(&self, row: &Row) -> Row {
        let parts = row.iter().flat_map(|(at, weight)| self.rows[*at].iter().map(move |(to, w)| (*to, weight * w)));
        merge_duplicates(parts.collect())
    }

    /// Returns `Tᵀ A T`.
    fn entries(&self, entries: Entries) -> Entries {
        if !self.pivot.contains(&true) {
            return entries;
        }
        let mut out = Vec::with_capacity(entries.len());
        for (row, column, value) in entries {
            for &(i, a) in &self.rows[row] {
                out.extend(self.rows[column].iter().map(|&(k, b)| (i, k, value * (a * b))));
            }
        }
        out
    }

    /// Returns `Tᵀ U`.
    fn modes(&self, modes: &ModalDamping, moved: usize) -> ModalDamping {
        let n = self.free + moved;
        let mut columns = vec![0.0; modes.iter().count() * n];
        for (column, own) in columns.chunks_exact_mut(n.max(1)).zip(modes.iter()) {
            for (row, value) in self.rows.iter().zip(own) {
                row.iter().for_each(|(to, weight)| column[*to] += weight * value);
            }
        }
        ModalDamping::new(n, Arc::new(columns))
    }
}

/// Returns a row in which the replaced coordinates are substituted.
fn substituted(row: &Row, given: &BTreeMap<usize, Row>) -> Row {
    let mut out = Row::new();
    for &(at, weight) in row {
        match given.get(&at) {
            Some(other) => out.extend(other.iter().map(|(to, w)| (*to, weight * w))),
            None => out.push((at, weight)),
        }
    }
    out
}

/// Returns the same sum with every coordinate once, in the order of first occurrence.
pub(super) fn merge_duplicates(row: Row) -> Row {
    let mut seen: BTreeMap<usize, usize> = BTreeMap::new();
    let mut out: Row = Vec::with_capacity(row.len());
    for (at, weight) in row {
        match seen.get(&at) {
            Some(&k) => out[k].1 += weight,
            None => {
                seen.insert(at, out.len());
                out.push((at, weight));
            }
        }
    }
    out
}
