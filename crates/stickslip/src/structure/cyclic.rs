//! One sector of a disk by its matrices, with both its sides, as a part of a ring.
//!
//! What lies on the high side of a sector lies on the low side of the next: `x_high(s) = R x_low(s+1)`, turned by `2π/N` about the axis, since every
//! sector has its displacements along axes of its own. The high side gives way, `x(s) = T₀ q(s) + T₁ q(s+1)`, and each matrix becomes
//! `A₀ = T₀ᵀAT₀ + T₁ᵀAT₁` on the sector itself, `A₁ = T₀ᵀAT₁` towards the next and `A₋₁ = T₁ᵀAT₀` towards the one before.
//!
//! Source: Thomas (1979), "Dynamics of rotationally periodic structures", Int. J. Numer. Meth. Engng 14, 81-102.

use super::reduction::{Damping, ReductionError, Row, Whole};
use super::sector::in_wave;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use stickslip_numerics::sparse::{Analysis, Matrix};

/// How both sides of a sector belong together.
///
/// # Example
/// A sector of two rows: what is row 1 here is row 0 of the next sector.
/// ```
/// use stickslip::structure::{Boundary, Component};
/// use stickslip_numerics::sparse::Matrix;
/// let spring = [(0, 0, 2.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0)];
/// let stiffness = Matrix::from_triplets(2, spring).unwrap();
/// let mass = Matrix::from_triplets(2, [(0, 0, 0.5), (1, 1, 0.5)]).unwrap();
/// let rows = vec!["1.x".to_owned(), "2.x".to_owned()];
/// let sector = Component::new(rows, mass, None, stiffness).unwrap();
/// let boundary = Boundary::of_nodes(sector.rows(), &[("1".into(), "2".into())], None).unwrap();
/// assert_eq!(boundary.high_rows().collect::<Vec<_>>(), [1]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Boundary {
    /// Rows (low, high) that are the same along axes that turn with the sectors.
    alike: Vec<[usize; 2]>,
    /// Rows along x, y, z of the low and of the high side, which the next sector has turned.
    turned: Vec<[[Option<usize>; 3]; 2]>,
    axis: Option<Axis>,
}

/// The axis of a disk: displacements are along x, y and z, and the next sector is turned about it by the right-hand rule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

/// Why two sides do not belong together.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BoundaryError {
    /// No pair.
    #[error("there are no node pairs; every node of the low side needs a partner on the high side")]
    Empty,
    /// Neither node has a row.
    #[error("the structure has no rows of node `{0}`")]
    NoRows(String),
    /// A node stands twice.
    #[error("node `{0}` appears twice on the {1} side")]
    Twice(String, &'static str),
    /// A node of both sides.
    #[error(
        "node `{0}` is on both sides, but a node on the axis cannot be coupled to itself; constrain it, or remove it from the model"
    )]
    Both(String),
    /// A node without any row, whose other has some.
    #[error(
        "the structure has rows of node `{1}`, but none of its partner `{0}`; check the name, and constrain both sides equally"
    )]
    Unknown(String, String),
    /// A direction is missing.
    #[error(
        "node `{high}` of the high side moves along {along}, but node `{low}` of the low side lacks the \
         corresponding direction; constrain both equally"
    )]
    Constrained {
        /// Of the low side.
        low: String,
        /// Of the high side.
        high: String,
        /// Direction of the row.
        along: String,
    },
    /// A direction that nobody knows how to turn.
    #[error(
        "row `{0}` cannot be rotated, because it is not along x, y, z, rx, ry or rz; remove the axis if the rows rotate with the sectors"
    )]
    Direction(String),
}

/// Names of directions that are turned together.
const DIRECTIONS: [[&str; 3]; 2] = [["x", "y", "z"], ["rx", "ry", "rz"]];

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(DIRECTIONS[0][*self as usize])
    }
}

impl Axis {
    /// Distance of a point from it.
    pub(super) fn radius(self, at: [f64; 3]) -> f64 {
        let [a, b] = self.across(at);
        a.hypot(b)
    }

    /// The angle from one point to another about it, rad, from -π to π.
    pub(super) fn angle(self, from: [f64; 3], to: [f64; 3]) -> f64 {
        let ([a, b], [c, d]) = (self.across(from), self.across(to));
        (a * d - b * c).atan2(a * c + b * d)
    }

    fn across(self, at: [f64; 3]) -> [f64; 2] {
        let own = self as usize;
        [at[(own + 1) % 3], at[(own + 2) % 3]]
    }

    /// Displacements along fixed axes of what moved along x, y, z of a sector that lies further by `angle` (rad).
    pub(super) fn turn(self, angle: f64) -> [[f64; 3]; 3] {
        let (sin, cos) = angle.sin_cos();
        let own = self as usize;
        let (a, b) = ((own + 1) % 3, (own + 2) % 3);
        let mut turn = [[0.0; 3]; 3];
        turn[own][own] = 1.0;
        (turn[a][a], turn[a][b], turn[b][a], turn[b][b]) = (cos, -sin, sin, cos);
        turn
    }
}

impl Boundary {
    /// Of nodes (low, high) of a structure with these rows: they are called `node.direction`. Without an axis the rows of both nodes that have the same direction are the same;
    /// with one their directions are x, y, z (rx, ry, rz), and the high side is where the sector ends by the right-hand rule about it.
    ///
    /// # Errors
    /// [`BoundaryError`]: nodes without rows, or whose rows do not belong together.
    pub fn of_nodes(rows: &[String], pairs: &[(String, String)], axis: Option<Axis>) -> Result<Self, BoundaryError> {
        if pairs.is_empty() {
            return Err(BoundaryError::Empty);
        }
        let mut of_node: BTreeMap<&str, BTreeMap<&str, usize>> = BTreeMap::new();
        for (row, name) in rows.iter().enumerate() {
            if let Some((node, along)) = name.rsplit_once('.') {
                of_node.entry(node).or_default().insert(along, row);
            }
        }
        let mut sides = BTreeMap::new();
        for (low, high) in pairs {
            for (node, side) in [(low, "low"), (high, "high")] {
                match sides.insert(node.as_str(), side) {
                    Some(before) if before == side => return Err(BoundaryError::Twice(node.clone(), side)),
                    Some(_) => return Err(BoundaryError::Both(node.clone())),
                    None => {}
                }
            }
        }
        let mut boundary = Boundary { alike: Vec::new(), turned: Vec::new(), axis };
        let none = BTreeMap::new();
        for (low, high) in pairs {
            let [own, other] = [low, high].map(|node| of_node.get(node.as_str()).unwrap_or(&none));
            match (own.is_empty(), other.is_empty()) {
                (true, true) => return Err(BoundaryError::NoRows(high.clone())),
                (true, false) => return Err(BoundaryError::Unknown(low.clone(), high.clone())),
                (false, true) => return Err(BoundaryError::Unknown(high.clone(), low.clone())),
                (false, false) => {}
            }
            boundary.tie(own, other).map_err(|along| match along {
                (along, true) => BoundaryError::Direction(format!("{high}.{along}")),
                (along, false) => BoundaryError::Constrained { low: low.clone(), high: high.clone(), along },
            })?;
        }
        Ok(boundary)
    }

    /// Ties one node to another; a direction that cannot be, and whether nobody knows how it turns.
    fn tie(&mut self, low: &BTreeMap<&str, usize>, high: &BTreeMap<&str, usize>) -> Result<(), (String, bool)> {
        let all = || low.keys().chain(high.keys()).copied();
        let Some(axis) = self.axis else {
            for along in all() {
                let (Some(&low), Some(&high)) = (low.get(along), high.get(along)) else {
                    return Err((along.to_owned(), false));
                };
                self.alike.push([low, high]);
            }
            self.alike.sort_unstable();
            self.alike.dedup();
            return Ok(());
        };
        if let Some(along) = all().find(|along| !DIRECTIONS.iter().flatten().any(|known| known == along)) {
            return Err((along.to_owned(), true));
        }
        for directions in DIRECTIONS {
            let rows = [low, high].map(|side| directions.map(|along| side.get(along).copied()));
            for (k, along) in directions.iter().enumerate() {
                // along the axis a row stays itself, across it two mix
                let mixed = (0..3).filter(|&i| i == k || (i != axis as usize && k != axis as usize));
                let have = mixed.flat_map(|i| [rows[0][i], rows[1][i]]).collect::<Vec<_>>();
                if have.iter().any(Option::is_some) != have.iter().all(Option::is_some) {
                    return Err(((*along).to_owned(), false));
                }
            }
            if rows[1].iter().any(Option::is_some) {
                self.turned.push(rows);
            }
        }
        Ok(())
    }

    /// The rows that give way to those of the next sector.
    pub fn high_rows(&self) -> impl Iterator<Item = usize> + '_ {
        let turned = self.turned.iter().flat_map(|[_, high]| high.iter().flatten().copied());
        self.alike.iter().map(|[_, high]| *high).chain(turned)
    }

    /// The rows of the low side, which the sector before shares.
    pub fn low_rows(&self) -> impl Iterator<Item = usize> + '_ {
        let turned = self.turned.iter().flat_map(|[low, _]| low.iter().flatten().copied());
        self.alike.iter().map(|[low, _]| *low).chain(turned)
    }

    /// Every row of the high side as (row, rows of the low side of the next sector with their weights), on a disk of so many sectors.
    fn ties(&self, sectors: usize) -> Vec<(usize, Row)> {
        let mut ties: Vec<(usize, Row)> = self.alike.iter().map(|[low, high]| (*high, vec![(*low, 1.0)])).collect();
        if let Some(axis) = self.axis {
            let turn = axis.turn(TAU / sectors as f64);
            for [low, high] in &self.turned {
                for (k, high) in high.iter().enumerate() {
                    let Some(high) = high else { continue };
                    let parts = (0..3).filter(|&i| turn[k][i] != 0.0).filter_map(|i| Some((low[i]?, turn[k][i])));
                    ties.push((*high, parts.collect()));
                }
            }
        }
        ties
    }
}

/// An entry of a ring's matrix in the rows of one sector: row, column, by how many sectors the column lies further, value.
pub(crate) type RingEntry = (usize, usize, i64, f64);
/// A weighted sum of rows: row, by how many sectors it lies further, weight.
pub(crate) type RingRow = Vec<(usize, i64, f64)>;

/// A component as one of the equal sectors of a ring: without the rows of its high side.
#[derive(Debug, Clone)]
pub(crate) struct CyclicSector {
    pub sectors: usize,
    /// Rows that are left.
    pub dofs: usize,
    /// Of every row of the component: what it is of those that are left.
    rows: Vec<RingRow>,
    /// Which rows of the component are left.
    pub kept: Vec<usize>,
    pub mass: Vec<RingEntry>,
    /// Of a damping matrix.
    pub damping: Option<Vec<RingEntry>>,
    pub stiffness: Vec<RingEntry>,
}

impl CyclicSector {
    /// Of mass, damping and stiffness of one sector.
    pub fn new(
        (mass, damping, stiffness): (&Matrix, Option<&Matrix>, &Matrix),
        boundary: &Boundary,
        sectors: usize,
    ) -> Self {
        let n = mass.n();
        let ties: BTreeMap<usize, Row> = boundary.ties(sectors).into_iter().collect();
        let kept: Vec<usize> = (0..n).filter(|row| !ties.contains_key(row)).collect();
        let mut new = vec![usize::MAX; n];
        kept.iter().enumerate().for_each(|(at, row)| new[*row] = at);
        let rows: Vec<RingRow> = (0..n)
            .map(|row| match ties.get(&row) {
                Some(low) => low.iter().map(|(at, weight)| (new[*at], 1, *weight)).collect(),
                None => vec![(new[row], 0, 1.0)],
            })
            .collect();
        let part = |matrix: &Matrix| eliminated(matrix, &rows);
        let symmetric = |matrix: &Matrix| symmetrised(part(matrix), |shift| -shift);
        let (mass, damping, stiffness) = (symmetric(mass), damping.map(part), symmetric(stiffness));
        CyclicSector { sectors, dofs: kept.len(), rows, kept, mass, damping, stiffness }
    }

    /// What a sector has of these entries with its neighbours held.
    pub fn alone(&self, entries: &[RingEntry]) -> Result<Matrix, ReductionError> {
        let own = entries.iter().filter(|entry| entry.2 == 0).map(|&(row, column, _, value)| (row, column, value));
        Matrix::from_triplets(self.dofs, own).map_err(|_| ReductionError::OutOfRange)
    }

    /// A weighted sum of the component's rows, over those that are left.
    pub fn row(&self, row: &Row) -> RingRow {
        let parts =
            row.iter().flat_map(|(at, w)| self.rows[*at].iter().map(move |(to, shift, v)| (*to, *shift, w * v)));
        parts.collect()
    }

    /// All rows of the component, by columns: first over coordinates of the rows that are left, then over the same of the next sector.
    pub fn whole_columns(&self, basis: &[f64]) -> Vec<f64> {
        let (n, all) = (self.dofs.max(1), self.rows.len());
        let half = basis.len() / n * all;
        let mut columns = vec![0.0; 2 * half];
        for (k, column) in basis.chunks_exact(n).enumerate() {
            for (row, parts) in self.rows.iter().enumerate() {
                for &(at, shift, weight) in parts {
                    let next = if shift == 0 { 0 } else { half };
                    columns[next + k * all + row] += weight * column[at];
                }
            }
        }
        columns
    }

    /// The structure of a wave, seen at these weighted sums of the component's rows: along the real and, if the wave has one, the
    /// imaginary part.
    pub fn wave(&self, diameter: usize, seen: &[Row]) -> Result<Whole, ReductionError> {
        let (n, sectors) = (self.dofs, self.sectors);
        let copies = if super::sector::is_real(diameter, sectors) { 1 } else { 2 };
        let matrix = |entries: &[RingEntry]| {
            let triplets = in_wave(entries.iter().copied(), [n, n], diameter, sectors);
            Matrix::from_triplets(copies * n, triplets).map_err(|_| ReductionError::OutOfRange)
        };
        let damping = match &self.damping {
            Some(damping) => Damping::Matrix(matrix(damping)?),
            None => Damping::Rayleigh { mass: 0.0, stiffness: 0.0 },
        };
        let whole = Whole::unseen(matrix(&self.mass)?, damping, matrix(&self.stiffness)?)?;
        let mut ports = vec![Row::new(); copies * seen.len()];
        for (p, row) in seen.iter().enumerate() {
            let all = self.row(row).into_iter().map(|(at, shift, weight)| (p, at, shift, weight));
            // the ports of the imaginary part follow all of the real part
            for (port, at, weight) in in_wave(all, [seen.len(), n], diameter, sectors) {
                ports[port].push((at, weight));
            }
        }
        whole.seen_at(ports)
    }

    /// What `δ` of all stiffness of the component's rows `blade` adds to the stiffness, for `δ` = 1: the energy of the blade beyond that of
    /// following its foundation, over the rows that are left.
    pub fn blade(&self, names: &[String], stiffness: &Matrix, blade: &[usize]) -> Result<Blade, BladeError> {
        if blade.is_empty() {
            return Err(BladeError::Empty);
        }
        // what the sector before ends with
        let low: BTreeSet<usize> = self.rows.iter().flatten().filter(|part| part.1 == 1).map(|part| part.0).collect();
        let mut inside = BTreeMap::new();
        for &row in blade {
            match self.rows[row][..] {
                [(at, 0, 1.0)] if !low.contains(&at) => inside.insert(row, at),
                _ => return Err(BladeError::OnBoundary(names[row].clone())),
            };
        }
        let rows: Vec<usize> = inside.keys().copied().collect();
        let number: BTreeMap<usize, usize> = rows.iter().enumerate().map(|(k, row)| (*row, k)).collect();
        let (mut own, mut towards) = (Vec::new(), Vec::new());
        for (column, &row) in rows.iter().enumerate() {
            for (other, value) in stiffness.column(row) {
                if let Some(at) = number.get(&other) {
                    own.push((*at, column, value));
                } else if value != 0.0 {
                    match self.rows[other][..] {
                        [(at, 0, 1.0)] => towards.push((column, at, value)),
                        _ => return Err(BladeError::OnBoundary(names[row].clone())),
                    }
                }
            }
        }
        let n = rows.len();
        let own = Matrix::from_triplets(n, own).map_err(|_| BladeError::NotHeld)?;
        let analysis = Analysis::new(&[&own]);
        let factor = analysis.factor(&[(1.0, &own)]).map_err(|_| BladeError::NotHeld)?;
        if factor.negative() > 0 || towards.is_empty() {
            return Err(BladeError::NotHeld);
        }
        Ok(Blade { at: inside.into_values().collect(), own, towards, factor })
    }
}

/// Why a set of rows is no blade.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BladeError {
    /// It reaches the boundary of the sector.
    #[error(
        "row `{0}` of the blade is on or next to the boundary of the sector; only rows inside the sector can be mistuned"
    )]
    OnBoundary(String),
    /// There is none.
    #[error("the blade has no node")]
    Empty,
    /// It is no cantilever.
    #[error(
        "the blade is not a cantilever: it can move with all other rows fixed, or it has no connection to them; name \
         all nodes of the blade, and none of the disk"
    )]
    NotHeld,
}

/// The blade of a sector, held by all that is no blade.
#[derive(Debug)]
pub(crate) struct Blade {
    /// Its rows among those that are left.
    at: Vec<usize>,
    own: Matrix,
    /// Row of the blade, row that is left and no blade, stiffness.
    towards: Vec<(usize, usize, f64)>,
    factor: stickslip_numerics::sparse::Factor,
}

impl Blade {
    /// `[K_bb, K_bi; K_ib, K_ib K_bb⁻¹ K_bi]` over the rows that are left: the energy `(x_b - Ψ x_i)ᵀ K_bb (x_b - Ψ x_i)` with
    /// `Ψ = -K_bb⁻¹ K_bi`.
    pub fn entries(&self) -> Vec<(usize, usize, f64)> {
        let n = self.at.len();
        let mut all: Vec<(usize, usize, f64)> =
            self.own.entries().map(|(i, k, value)| (self.at[i], self.at[k], value)).collect();
        let mut columns: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for &(row, at, value) in &self.towards {
            all.extend([(self.at[row], at, value), (at, self.at[row], value)]);
            columns.entry(at).or_insert_with(|| vec![0.0; n])[row] += value;
        }
        for (&column, forces) in &columns {
            let mut followed = forces.clone();
            self.factor.solve(&mut followed);
            for (&row, forces) in columns.range(..=column) {
                let energy: f64 = forces.iter().zip(&followed).map(|(a, b)| a * b).sum();
                all.push((row, column, energy));
                if row < column {
                    all.push((column, row, energy));
                }
            }
        }
        all
    }

    /// Their product with displacements of the rows that are left: forces on these.
    pub fn times(&self, displacements: &[f64]) -> Vec<f64> {
        let moved: Vec<f64> = self.at.iter().map(|at| displacements[*at]).collect();
        let mut forces = self.own.times(&moved);
        self.towards.iter().for_each(|(row, at, value)| forces[*row] += value * displacements[*at]);
        let mut all = vec![0.0; displacements.len()];
        self.at.iter().zip(&forces).for_each(|(at, force)| all[*at] = *force);
        // what the foundation feels is what the blade would follow it by
        self.factor.solve(&mut forces);
        self.towards.iter().for_each(|(row, at, value)| all[*at] += value * forces[*row]);
        all
    }

    /// The same over columns of length `n`, `Vᵀ D V`.
    pub fn along(&self, n: usize, basis: &[f64]) -> Vec<(usize, usize, f64)> {
        let forces: Vec<f64> = basis.chunks_exact(n).flat_map(|column| self.times(column)).collect();
        let energy = stickslip_numerics::sparse::columns::products(n, basis, &forces);
        let all = (0..energy.ncols()).flat_map(|k| (0..energy.nrows()).map(move |i| (i, k)));
        all.map(|(i, k)| (i, k, 0.5 * (energy[(i, k)] + energy[(k, i)]))).collect()
    }
}

/// `TᵀAT` in the rows of one sector, with each entry once, sorted.
fn eliminated(matrix: &Matrix, rows: &[RingRow]) -> Vec<RingEntry> {
    let mut all: Vec<RingEntry> = Vec::with_capacity(matrix.len());
    for (i, k, value) in matrix.entries() {
        for &(row, own, a) in &rows[i] {
            all.extend(rows[k].iter().map(|&(column, other, b)| (row, column, other - own, value * (a * b))));
        }
    }
    summed(all)
}

/// Each entry once, sorted.
fn summed(mut all: Vec<RingEntry>) -> Vec<RingEntry> {
    // a stable sort: sums are of one order
    all.sort_by_key(|entry| (entry.0, entry.1, entry.2));
    all.dedup_by(|next, sum| {
        let same = (next.0, next.1, next.2) == (sum.0, sum.1, sum.2);
        if same {
            sum.3 += next.3;
        }
        same
    });
    all
}

/// The mean of a ring's matrix and its mirror image, whose columns lie as many sectors back: symmetric to the last bit.
pub(super) fn symmetrised(entries: Vec<RingEntry>, back: impl Fn(i64) -> i64) -> Vec<RingEntry> {
    let halves = entries.into_iter().flat_map(|(i, k, shift, value)| {
        let half = 0.5 * value;
        [(i, k, shift, half), (k, i, back(shift), half)]
    });
    summed(halves.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(rows: &[&str]) -> Vec<String> {
        rows.iter().map(|&name| name.to_owned()).collect()
    }

    fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs.iter().map(|(low, high)| ((*low).to_owned(), (*high).to_owned())).collect()
    }

    /// A translation of the whole disk is one displacement in all sectors: along turned axes it follows from that of the next sector.
    #[test]
    fn the_next_sector_is_turned_by_the_right_hand_rule() {
        let rows = ["1.x", "1.y", "1.z", "2.x", "2.y", "2.z"];
        for (axis, across) in [(Axis::X, [1, 2]), (Axis::Y, [2, 0]), (Axis::Z, [0, 1])] {
            let boundary = Boundary::of_nodes(&named(&rows), &pairs(&[("1", "2")]), Some(axis)).unwrap();
            let angle = TAU / 5.0;
            // along the first of the directions across the axis; the next sector sees it turned back
            let mut next = [0.0; 3];
            (next[across[0]], next[across[1]]) = (angle.cos(), -angle.sin());
            let mut own = [0.0; 3];
            own[across[0]] = 1.0;
            for (row, parts) in boundary.ties(5) {
                let seen: f64 = parts.iter().map(|(at, weight)| next[*at] * weight).sum();
                assert!((seen - own[row - 3]).abs() < 1e-15, "{axis:?}, {row}: {seen}");
            }
        }
    }

    #[test]
    fn sides_that_do_not_belong_together_are_refused() {
        let free = named(&["1.x", "1.y", "1.z", "2.x", "2.y", "2.z"]);
        let refused = |rows: &[String], nodes: &[(&str, &str)], axis| {
            Boundary::of_nodes(rows, &pairs(nodes), axis).unwrap_err().to_string()
        };
        assert!(refused(&free, &[], None).contains("no node pairs"));
        assert!(refused(&free, &[("1", "1")], None).contains("a node on the axis cannot be coupled"));
        assert!(refused(&free, &[("1", "2"), ("1", "3")], None).contains("twice on the low side"));
        assert!(refused(&free, &[("8", "9")], None).contains("no rows of node `9`"));
        let held = named(&["1.x", "1.z", "2.x", "2.y", "2.z"]);
        assert!(refused(&held, &[("1", "2")], Some(Axis::Z)).contains("constrain both equally"));
        // what both sides lack is held
        let held = named(&["1.z", "2.z"]);
        assert_eq!(
            Boundary::of_nodes(&held, &pairs(&[("1", "2")]), Some(Axis::Z)).unwrap().ties(7),
            [(1, vec![(0, 1.0)])]
        );
        let radial = named(&["1.r", "2.r"]);
        assert!(refused(&radial, &[("1", "2")], Some(Axis::Z)).contains("row `2.r`"));
        assert_eq!(Boundary::of_nodes(&radial, &pairs(&[("1", "2")]), None).unwrap().ties(7), [(1, vec![(0, 1.0)])]);
    }
}
