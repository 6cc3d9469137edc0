//! One sector of a disk given by matrices, with both its sides, as a part of a ring.
//!
//! The high side of a sector coincides with the low side of the next one:
//! `x_high(s) = R x_low(s+1)`. `R` is a rotation by `2π/N` about the axis, because every sector
//! has its own axes of displacement. The high side is eliminated, `x(s) = T₀ q(s) + T₁ q(s+1)`.
//! Each matrix becomes `A₀ = T₀ᵀAT₀ + T₁ᵀAT₁` within the sector, `A₁ = T₀ᵀAT₁` to the next and
//! `A₋₁ = T₁ᵀAT₀` to the previous sector.
//!
//! Source: Thomas (1979), "Dynamics of rotationally periodic structures", Int. J. Numer. Meth.
//! Engng 14, 81-102.

use super::reduction::{FullStructure, ReductionError, Row, StructureDamping};
use super::sector::{symmetric_wave_entries, wave_entries};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::sync::{Arc, OnceLock};
use stickslip_numerics::parallel::map_array;
use stickslip_numerics::sparse::{SparseMatrix, SymbolicAnalysis};

/// The coupling between the two sides of a sector.
///
/// # Example
/// A sector of two rows: row 1 is row 0 of the next sector.
/// ```
/// use stickslip::structure::{Boundary, Component};
/// use stickslip_numerics::sparse::SparseMatrix;
/// let spring = [(0, 0, 2.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0)];
/// let stiffness = SparseMatrix::from_triplets(2, spring).unwrap();
/// let mass = SparseMatrix::from_triplets(2, [(0, 0, 0.5), (1, 1, 0.5)]).unwrap();
/// let rows = vec!["1.x".to_owned(), "2.x".to_owned()];
/// let sector = Component::new(rows, mass, None, stiffness).unwrap();
/// let boundary = Boundary::of_nodes(sector.rows(), &[("1".into(), "2".into())], None).unwrap();
/// assert_eq!(boundary.high_rows().collect::<Vec<_>>(), [1]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Boundary {
    /// Pairs of rows (low, high) that are equal along axes that rotate with the sectors.
    equal_rows: Vec<[usize; 2]>,
    /// Rows along x, y, z of the low and of the high side, which are rotated in the next
    /// sector.
    rotated_rows: Vec<[[Option<usize>; 3]; 2]>,
    axis: Option<CoordinateAxis>,
}

/// The axis of a disk. Displacements are along x, y and z; the next sector is rotated about the
/// axis by the right-hand rule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CoordinateAxis {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

/// The reason why the two sides of a sector do not match.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BoundaryError {
    /// There is no pair.
    #[error("there are no node pairs; every node of the low side needs a partner on the high side")]
    Empty,
    /// Neither node has a row.
    #[error("the structure has no rows of node `{0}`")]
    NoRows(String),
    /// A node occurs twice on one side.
    #[error("node `{0}` appears twice on the {1} side")]
    Duplicate(String, &'static str),
    /// A node occurs on both sides.
    #[error(
        "node `{0}` is on both sides, but a node on the axis cannot be coupled to itself; constrain it, or remove it from the model"
    )]
    Both(String),
    /// One node of a pair has no rows, but the other has.
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
        /// Node of the low side.
        low: String,
        /// Node of the high side.
        high: String,
        /// Direction of the row.
        along: String,
    },
    /// The rotation of a direction is unknown.
    #[error(
        "row `{0}` cannot be rotated, because it is not along x, y, z, rx, ry or rz; remove the axis if the rows rotate with the sectors"
    )]
    Direction(String),
}

/// Names of directions that rotate together.
pub(super) const DIRECTIONS: [[&str; 3]; 2] = [["x", "y", "z"], ["rx", "ry", "rz"]];

impl std::fmt::Display for CoordinateAxis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(DIRECTIONS[0][*self as usize])
    }
}

impl CoordinateAxis {
    /// Returns the distance of a point from the axis.
    pub(super) fn radius(self, at: [f64; 3]) -> f64 {
        let [a, b] = self.across(at);
        a.hypot(b)
    }

    /// Returns the angle from one point to another about the axis, rad, from -π to π.
    pub(super) fn angle(self, from: [f64; 3], to: [f64; 3]) -> f64 {
        let ([a, b], [c, d]) = (self.across(from), self.across(to));
        (a * d - b * c).atan2(a * c + b * d)
    }

    fn across(self, at: [f64; 3]) -> [f64; 2] {
        let own = self as usize;
        [at[(own + 1) % 3], at[(own + 2) % 3]]
    }

    /// Returns the rotation by `angle` (rad): it maps displacements along x, y, z of the
    /// rotated sector to fixed axes.
    pub fn rotation(self, angle: f64) -> [[f64; 3]; 3] {
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
    /// Creates the coupling from pairs of nodes (low, high) of a structure with these rows,
    /// named `node.direction`.
    ///
    /// Without an axis, rows of the same direction are equal. With an axis, the directions are
    /// x, y, z (rx, ry, rz). The high side is then the end of the sector by the right-hand rule
    /// about the axis.
    ///
    /// # Errors
    /// [`BoundaryError`]: nodes without rows, or nodes whose rows do not match.
    pub fn of_nodes(
        rows: &[String],
        pairs: &[(String, String)],
        axis: Option<CoordinateAxis>,
    ) -> Result<Self, BoundaryError> {
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
                    Some(before) if before == side => return Err(BoundaryError::Duplicate(node.clone(), side)),
                    Some(_) => return Err(BoundaryError::Both(node.clone())),
                    None => {}
                }
            }
        }
        let mut boundary = Boundary { equal_rows: Vec::new(), rotated_rows: Vec::new(), axis };
        let none = BTreeMap::new();
        for (low, high) in pairs {
            let [own, other] = [low, high].map(|node| of_node.get(node.as_str()).unwrap_or(&none));
            match (own.is_empty(), other.is_empty()) {
                (true, true) => return Err(BoundaryError::NoRows(high.clone())),
                (true, false) => return Err(BoundaryError::Unknown(low.clone(), high.clone())),
                (false, true) => return Err(BoundaryError::Unknown(high.clone(), low.clone())),
                (false, false) => {}
            }
            boundary.couple(own, other).map_err(|along| match along {
                (along, true) => BoundaryError::Direction(format!("{high}.{along}")),
                (along, false) => BoundaryError::Constrained { low: low.clone(), high: high.clone(), along },
            })?;
        }
        Ok(boundary)
    }

    /// Couples one node to another. The error is a direction that cannot be coupled, and
    /// whether its rotation is unknown.
    fn couple(&mut self, low: &BTreeMap<&str, usize>, high: &BTreeMap<&str, usize>) -> Result<(), (String, bool)> {
        let all = || low.keys().chain(high.keys()).copied();
        let Some(axis) = self.axis else {
            for along in all() {
                let (Some(&low), Some(&high)) = (low.get(along), high.get(along)) else {
                    return Err((along.to_owned(), false));
                };
                self.equal_rows.push([low, high]);
            }
            self.equal_rows.sort_unstable();
            self.equal_rows.dedup();
            return Ok(());
        };
        if let Some(along) = all().find(|along| !DIRECTIONS.iter().flatten().any(|known| known == along)) {
            return Err((along.to_owned(), true));
        }
        for directions in DIRECTIONS {
            let rows = [low, high].map(|side| directions.map(|along| side.get(along).copied()));
            for (k, along) in directions.iter().enumerate() {
                // the row along the axis is unchanged; the two rows across it mix
                let mixed = (0..3).filter(|&i| i == k || (i != axis as usize && k != axis as usize));
                let have = mixed.flat_map(|i| [rows[0][i], rows[1][i]]).collect::<Vec<_>>();
                if have.iter().any(Option::is_some) != have.iter().all(Option::is_some) {
                    return Err(((*along).to_owned(), false));
                }
            }
            if rows[1].iter().any(Option::is_some) {
                self.rotated_rows.push(rows);
            }
        }
        Ok(())
    }

    /// Returns the axis about which displacements rotate from sector to sector; `None` if the axes
    /// of displacements rotate with the sectors.
    pub fn axis(&self) -> Option<CoordinateAxis> {
        self.axis
    }

    /// Returns the rows of the high side, which those of the next sector replace.
    pub fn high_rows(&self) -> impl Iterator<Item = usize> + '_ {
        let turned = self.rotated_rows.iter().flat_map(|[_, high]| high.iter().flatten().copied());
        self.equal_rows.iter().map(|[_, high]| *high).chain(turned)
    }

    /// Returns the rows of the low side, which the previous sector shares.
    pub fn low_rows(&self) -> impl Iterator<Item = usize> + '_ {
        let turned = self.rotated_rows.iter().flat_map(|[low, _]| low.iter().flatten().copied());
        self.equal_rows.iter().map(|[low, _]| *low).chain(turned)
    }

    /// Returns every row of the high side as a weighted sum of rows of the next sector's low
    /// side. The rotation depends on the number of sectors.
    fn constraints(&self, sectors: usize) -> Vec<(usize, Row)> {
        let mut ties: Vec<(usize, Row)> =
            self.equal_rows.iter().map(|[low, high]| (*high, vec![(*low, 1.0)])).collect();
        if let Some(axis) = self.axis {
            let turn = axis.rotation(TAU / sectors as f64);
            for [low, high] in &self.rotated_rows {
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

/// An entry of a ring's matrix in the rows of one sector: row, column, offset of the column in
/// sectors, value.
pub(crate) type RingEntry = (usize, usize, i64, f64);
/// A weighted sum of rows: row, offset in sectors, weight.
pub(crate) type RingRow = Vec<(usize, i64, f64)>;

/// A component as one of the equal sectors of a ring, without the rows of its high side.
#[derive(Debug, Clone)]
pub(crate) struct CyclicSector {
    pub sectors: usize,
    /// Number of remaining rows.
    pub dofs: usize,
    /// Every row of the component, in terms of the remaining rows.
    rows: Vec<RingRow>,
    /// Indices in the component of the remaining rows.
    pub kept: Vec<usize>,
    pub mass: Vec<RingEntry>,
    /// Entries of the damping matrix, if any.
    pub damping: Option<Vec<RingEntry>>,
    pub stiffness: Vec<RingEntry>,
    /// Analyses of the matrices of real and of complex waves.
    analyses: [OnceLock<Arc<SymbolicAnalysis>>; 2],
}

impl CyclicSector {
    /// Creates a sector from its mass, damping and stiffness.
    pub fn new(
        (mass, damping, stiffness): (&SparseMatrix, Option<&SparseMatrix>, &SparseMatrix),
        boundary: &Boundary,
        sectors: usize,
    ) -> Self {
        let n = mass.n();
        let ties: BTreeMap<usize, Row> = boundary.constraints(sectors).into_iter().collect();
        let kept: Vec<usize> = (0..n).filter(|row| !ties.contains_key(row)).collect();
        let mut new = vec![usize::MAX; n];
        kept.iter().enumerate().for_each(|(at, row)| new[*row] = at);
        let rows: Vec<RingRow> = (0..n)
            .map(|row| match ties.get(&row) {
                Some(low) => low.iter().map(|(at, weight)| (new[*at], 1, *weight)).collect(),
                None => vec![(new[row], 0, 1.0)],
            })
            .collect();
        let part = |matrix: &SparseMatrix| eliminated(matrix, &rows);
        let symmetric = |matrix: &SparseMatrix| symmetrized(part(matrix));
        let [mass, stiffness] = map_array([mass, stiffness], rayon::current_num_threads(), symmetric);
        let damping = damping.map(part);
        let analyses = Default::default();
        CyclicSector { sectors, dofs: kept.len(), rows, kept, mass, damping, stiffness, analyses }
    }

    /// Returns the matrix of a sector with the adjacent sectors fixed.
    pub fn with_fixed_adjacent(
        &self,
        entries: impl Iterator<Item = RingEntry>,
    ) -> Result<SparseMatrix, ReductionError> {
        let own = entries.filter(|entry| entry.2 == 0).map(|(row, column, _, value)| (row, column, value));
        SparseMatrix::from_triplets(self.dofs, own).map_err(|_| ReductionError::OutOfRange)
    }

    /// Returns every row of the component, in terms of the remaining rows.
    pub fn rows(&self) -> &[RingRow] {
        &self.rows
    }

    /// Converts a weighted sum of the component's rows to the remaining rows.
    pub fn row(&self, row: &Row) -> RingRow {
        let parts =
            row.iter().flat_map(|(at, w)| self.rows[*at].iter().map(move |(to, shift, v)| (*to, *shift, w * v)));
        parts.collect()
    }

    /// Returns the columns `basis` over all rows of the component: first for the coordinates of
    /// this sector, then for those of the next one.
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

    /// Returns the structure of a wave, observed at these weighted sums of the component's
    /// rows. There is one port for the real part and, if the wave is complex, one for the
    /// imaginary part.
    pub fn wave(&self, diameter: usize, seen: &[Row]) -> Result<FullStructure, ReductionError> {
        let (n, sectors) = (self.dofs, self.sectors);
        let copies = if super::sector::is_real(diameter, sectors) { 1 } else { 2 };
        let sparse =
            |triplets| SparseMatrix::from_triplets(copies * n, triplets).map_err(|_| ReductionError::OutOfRange);
        let damping = match &self.damping {
            Some(damping) => {
                StructureDamping::Matrix(sparse(wave_entries(damping.iter().copied(), [n, n], diameter, sectors))?)
            }
            None => StructureDamping::Rayleigh { mass: 0.0, stiffness: 0.0 },
        };
        let symmetric = |entries: &[RingEntry]| sparse(symmetric_wave_entries(entries, n, diameter, sectors));
        let (mass, stiffness) = (symmetric(&self.mass)?, symmetric(&self.stiffness)?);
        let whole = FullStructure::from_valid(mass, damping, stiffness, self.analysis(copies)?);
        let mut ports = vec![Row::new(); copies * seen.len()];
        for (p, row) in seen.iter().enumerate() {
            let all = self.row(row).into_iter().map(|(at, shift, weight)| (p, at, shift, weight));
            // the ports of the imaginary part follow all ports of the real part
            for (port, at, weight) in wave_entries(all, [seen.len(), n], diameter, sectors) {
                ports[port].push((at, weight));
            }
        }
        whole.with_ports(ports)
    }

    /// Returns the analysis of the matrices of all real waves (one copy of the rows) or of all
    /// complex ones (two copies).
    fn analysis(&self, copies: usize) -> Result<Arc<SymbolicAnalysis>, ReductionError> {
        if let Some(known) = self.analyses[copies - 1].get() {
            return Ok(known.clone());
        }
        let n = self.dofs;
        let matrices = [Some(&self.mass), Some(&self.stiffness), self.damping.as_ref()];
        let entries = matrices.into_iter().flatten().flatten();
        // entries within a sector have no imaginary part; in a wave, others may cancel
        let triplets = entries.flat_map(|&(row, column, shift, _)| {
            let blocks = (0..copies).flat_map(move |i| (0..copies).map(move |k| (i, k)));
            let blocks = blocks.filter(move |(i, k)| i == k || shift != 0);
            blocks.map(move |(i, k)| (i * n + row, k * n + column, 1.0))
        });
        let pattern = SparseMatrix::from_triplets(copies * n, triplets).map_err(|_| ReductionError::OutOfRange)?;
        Ok(self.analyses[copies - 1].get_or_init(|| Arc::new(SymbolicAnalysis::new(&[&pattern]))).clone())
    }

    /// Returns the stiffness change per unit `δ` if the component's rows `blade` have their
    /// stiffness scaled by `1 + δ`.
    ///
    /// It is the strain energy of the blade in excess of a static motion that follows its
    /// foundation, over the remaining rows.
    pub fn blade(&self, names: &[String], stiffness: &SparseMatrix, blade: &[usize]) -> Result<Blade, BladeError> {
        if blade.is_empty() {
            return Err(BladeError::Empty);
        }
        // low side, shared with the previous sector
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
        let own = SparseMatrix::from_triplets(n, own).map_err(|_| BladeError::NotHeld)?;
        let analysis = SymbolicAnalysis::new(&[&own]);
        let factor = analysis.factor(&[(1.0, &own)]).map_err(|_| BladeError::NotHeld)?;
        if factor.negative_pivots() > 0 || towards.is_empty() {
            return Err(BladeError::NotHeld);
        }
        Ok(Blade { at: inside.into_values().collect(), own, towards, factor })
    }
}

/// The reason why a set of rows is not a valid blade.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BladeError {
    /// The blade reaches the boundary of the sector.
    #[error(
        "row `{0}` of the blade is on or next to the boundary of the sector; only rows inside the sector can be mistuned"
    )]
    OnBoundary(String),
    /// The set of rows is empty.
    #[error("the blade has no node")]
    Empty,
    /// The blade is not a cantilever.
    #[error(
        "the blade is not a cantilever: it can move with all other rows fixed, or it has no connection to them; name \
         all nodes of the blade, and none of the disk"
    )]
    NotHeld,
}

/// The blade of a sector, clamped at all other rows.
#[derive(Debug)]
pub(crate) struct Blade {
    /// Its rows among the remaining rows.
    at: Vec<usize>,
    own: SparseMatrix,
    /// Row of the blade, remaining row outside the blade, stiffness.
    towards: Vec<(usize, usize, f64)>,
    factor: stickslip_numerics::sparse::LdlFactor,
}

impl Blade {
    /// Returns `[K_bb, K_bi; K_ib, K_ib K_bb⁻¹ K_bi]` over the remaining rows. This is the
    /// energy `(x_b - Ψ x_i)ᵀ K_bb (x_b - Ψ x_i)` with `Ψ = -K_bb⁻¹ K_bi`.
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

    /// Returns the product of [`Blade::entries`] with displacements of the remaining rows, as
    /// forces on these rows.
    pub fn times(&self, displacements: &[f64]) -> Vec<f64> {
        let moved: Vec<f64> = self.at.iter().map(|at| displacements[*at]).collect();
        let mut forces = self.own.multiply(&moved);
        self.towards.iter().for_each(|(row, at, value)| forces[*row] += value * displacements[*at]);
        let mut all = vec![0.0; displacements.len()];
        self.at.iter().zip(&forces).for_each(|(at, force)| all[*at] = *force);
        // forces on the foundation: K_ib K_bb⁻¹ times the forces on the blade
        self.factor.solve(&mut forces);
        self.towards.iter().for_each(|(row, at, value)| all[*at] += value * forces[*row]);
        all
    }

    /// Returns `Vᵀ D V` over columns of length `n`, with the matrix `D` of [`Blade::entries`].
    pub fn projected(&self, n: usize, basis: &[f64]) -> Vec<(usize, usize, f64)> {
        let forces: Vec<f64> = basis.chunks_exact(n).flat_map(|column| self.times(column)).collect();
        let energy = stickslip_numerics::sparse::multi_vector::inner_products(n, basis, &forces);
        let all = (0..energy.ncols()).flat_map(|k| (0..energy.nrows()).map(move |i| (i, k)));
        all.map(|(i, k)| (i, k, 0.5 * (energy[(i, k)] + energy[(k, i)]))).collect()
    }
}

/// Returns `TᵀAT` in the rows of one sector, sorted, without duplicate entries.
fn eliminated(matrix: &SparseMatrix, rows: &[RingRow]) -> Vec<RingEntry> {
    let mut all: Vec<RingEntry> = Vec::with_capacity(matrix.len());
    for (i, k, value) in matrix.entries() {
        for &(row, own, a) in &rows[i] {
            all.extend(rows[k].iter().map(|&(column, other, b)| (row, column, other - own, value * (a * b))));
        }
    }
    summed(all)
}

/// Sorts the entries and sums duplicates.
fn summed(mut all: Vec<RingEntry>) -> Vec<RingEntry> {
    // a stable sort keeps the order of the sums
    all.sort_by_key(|entry| (entry.0, entry.1, entry.2));
    all.dedup_by(|next, sum| {
        let same = (next.0, next.1, next.2) == (sum.0, sum.1, sum.2);
        if same {
            sum.3 += next.3;
        }
        same
    });
    all.shrink_to_fit();
    all
}

/// Returns the mean of a ring's matrix and its transpose, symmetric to the last bit.
fn symmetrized(entries: Vec<RingEntry>) -> Vec<RingEntry> {
    let halves = entries.into_iter().flat_map(|(i, k, shift, value)| {
        let half = 0.5 * value;
        [(i, k, shift, half), (k, i, -shift, half)]
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

    /// A translation of the whole disk is one displacement in all sectors. Along rotated axes,
    /// it follows from that of the next sector.
    #[test]
    fn the_next_sector_is_turned_by_the_right_hand_rule() {
        let rows = ["1.x", "1.y", "1.z", "2.x", "2.y", "2.z"];
        for (axis, across) in [(CoordinateAxis::X, [1, 2]), (CoordinateAxis::Y, [2, 0]), (CoordinateAxis::Z, [0, 1])] {
            let boundary = Boundary::of_nodes(&named(&rows), &pairs(&[("1", "2")]), Some(axis)).unwrap();
            let angle = TAU / 5.0;
            // along the first direction across the axis, which the next sector sees rotated
            // backwards
            let mut next = [0.0; 3];
            (next[across[0]], next[across[1]]) = (angle.cos(), -angle.sin());
            let mut own = [0.0; 3];
            own[across[0]] = 1.0;
            for (row, parts) in boundary.constraints(5) {
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
        assert!(refused(&held, &[("1", "2")], Some(CoordinateAxis::Z)).contains("constrain both equally"));
        // a direction that both sides lack is fixed
        let held = named(&["1.z", "2.z"]);
        assert_eq!(
            Boundary::of_nodes(&held, &pairs(&[("1", "2")]), Some(CoordinateAxis::Z)).unwrap().constraints(7),
            [(1, vec![(0, 1.0)])]
        );
        let radial = named(&["1.r", "2.r"]);
        assert!(refused(&radial, &[("1", "2")], Some(CoordinateAxis::Z)).contains("row `2.r`"));
        assert_eq!(
            Boundary::of_nodes(&radial, &pairs(&[("1", "2")]), None).unwrap().constraints(7),
            [(1, vec![(0, 1.0)])]
        );
    }
}
