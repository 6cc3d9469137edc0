//! One sector of a ring of equal sectors, and its matrices in a travelling wave.
//!
//! If all sectors move with the same phase lag, `x_s = X e^{j d θ s}` with `θ = 2π/N` and the
//! nodal diameter `d`. The ring's matrices then reduce to those of one sector,
//! `K_d = Σ_s K_{0s} e^{j d θ s}`: Hermitian, of the size of a sector. In real numbers, this is
//! a symmetric matrix of twice the size, `[[Re K_d, -Im K_d], [Im K_d, Re K_d]]` over
//! `(x, -jx)`.
//!
//! Source: Thomas (1979), "Dynamics of rotationally periodic structures", Int. J. Numer. Meth.
//! Engng 14, 81-102.

use super::sector_boundary::RingEntry;
use super::{Structure, StructureError, is_full, to_full};
use nalgebra::DMatrix;
use num_complex::Complex64;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::rc::Rc;
use std::sync::{Mutex, PoisonError};
use stickslip_numerics::definiteness::{is_semidefinite, sparse_definite};
use stickslip_numerics::sparse::{Singular, SparseMatrix};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);
/// Difference between the matrices of a sector and those of the first one that counts as rounding
/// of sums in another order. It is relative to the largest entry.
const SECTOR_ROUNDING: f64 = 1e-12;

/// Row, column, offset of the column in sectors, values of mass, damping, stiffness.
type SectorEntry = (usize, usize, usize, [f64; 3]);

/// Returns the entries sorted, with those of the same row, column and offset summed.
fn summed(mut entries: Vec<SectorEntry>) -> Vec<SectorEntry> {
    // stable, so that sums keep their order
    entries.sort_by_key(|entry| (entry.0, entry.1, entry.2));
    entries.dedup_by(|next, kept| {
        let same = (next.0, next.1, next.2) == (kept.0, kept.1, kept.2);
        if same {
            (0..3).for_each(|k| kept.3[k] += next.3[k]);
        }
        same
    });
    entries.shrink_to_fit();
    entries
}

/// The rows of the first sector in the matrices of a ring.
#[derive(Debug)]
pub struct RingSector {
    sectors: usize,
    places: Vec<String>,
    /// They are sorted.
    entries: Vec<SectorEntry>,
    /// Waves that were requested before, by nodal diameter.
    waves: Mutex<BTreeMap<usize, Wave>>,
}

/// The matrices of a wave with one nodal diameter on the sectors of a ring.
#[derive(Debug, Clone)]
pub struct Wave {
    sectors: usize,
    diameter: usize,
    dofs: usize,
    /// A sector of twice the size, or of single size if the matrices of the wave are real.
    structure: Structure,
}

/// Returns `e^{j 2π k/n}`. Equivalent arguments give identical bits, and quarter turns are
/// exact.
pub(crate) fn unit_root(k: i64, n: usize) -> Complex64 {
    let n = n as i64;
    let k = k.rem_euclid(n);
    match 4 * k {
        0 => Complex64::new(1.0, 0.0),
        q if q == n => Complex64::new(0.0, 1.0),
        q if q == 2 * n => Complex64::new(-1.0, 0.0),
        q if q == 3 * n => Complex64::new(0.0, -1.0),
        // the second half mirrors the first, so that waves in both directions are exact mirror
        // images
        _ if 2 * k > n => Complex64::cis(TAU * (n - k) as f64 / n as f64).conj(),
        _ => Complex64::cis(TAU * k as f64 / n as f64),
    }
}

/// Returns the function from the offset of a sector to its phase factor `e^{jdθs}` in a wave with
/// one nodal diameter.
fn phases(diameter: usize, sectors: usize) -> impl Fn(i64) -> Complex64 {
    let all: Vec<Complex64> = (0..sectors).map(|offset| unit_root((diameter * offset) as i64, sectors)).collect();
    move |offset| all[offset.rem_euclid(sectors as i64) as usize]
}

/// Returns whether the matrices of a wave are real: adjacent sectors move in phase or in
/// antiphase.
pub(crate) fn is_real(diameter: usize, sectors: usize) -> bool {
    (2 * diameter).is_multiple_of(sectors)
}

/// Returns the entries of a ring's matrix in the rows of its first sector; `None` if the sectors
/// differ.
pub(crate) fn sector_entries(matrix: &SparseMatrix, sectors: usize) -> Option<Vec<RingEntry>> {
    let (all, n) = (matrix.n(), matrix.n() / sectors);
    let rounding = SECTOR_ROUNDING * matrix.max_abs();
    let mut entries = Vec::new();
    for column in 0..n {
        let first: Vec<(usize, f64)> = matrix.column(column).collect();
        for sector in 0..sectors {
            let other: Vec<(usize, f64)> = matrix.column(sector * n + column).collect();
            // the rows from those of the column's own sector on, once around the ring
            let start = other.partition_point(|(row, _)| *row < sector * n);
            let turned = other[start..].iter().chain(&other[..start]);
            let equal = other.len() == first.len()
                && first.iter().zip(turned).all(|((row, value), (other_row, other))| {
                    (row + sector * n) % all == *other_row && (value - other).abs() <= rounding
                });
            if !equal {
                return None;
            }
            entries.extend(
                other.iter().take_while(|(row, _)| *row < n).map(|&(row, value)| (row, column, sector as i64, value)),
            );
        }
    }
    Some(entries)
}

/// Converts entries of a ring's matrix in the rows of a sector to the wave of one nodal
/// diameter.
///
/// The input is (row, column, offset of the column in sectors, value) for a matrix of `rows` by
/// `columns`. The output is (row, column, value) at twice the size, or at single size if the
/// wave is real.
pub(super) fn wave_entries(
    entries: impl Iterator<Item = (usize, usize, i64, f64)>,
    [rows, columns]: [usize; 2],
    diameter: usize,
    sectors: usize,
) -> Vec<(usize, usize, f64)> {
    let (real, phase) = (is_real(diameter, sectors), phases(diameter, sectors));
    let mut triplets = Vec::new();
    for (row, column, shift, value) in entries {
        let phase = phase(shift);
        triplets.push((row, column, value * phase.re));
        if !real {
            triplets.push((rows + row, columns + column, value * phase.re));
            triplets.push((row, columns + column, -value * phase.im));
            triplets.push((rows + row, column, value * phase.im));
        }
    }
    triplets
}

/// Returns the result of [`wave_entries`] for a symmetric matrix of `n` rows, whose entries are
/// sorted, column by column.
///
/// The matrix of a wave is Hermitian, so that its columns are the conjugate rows.
pub(super) fn symmetric_wave_entries(
    entries: &[(usize, usize, i64, f64)],
    n: usize,
    diameter: usize,
    sectors: usize,
) -> Vec<(usize, usize, f64)> {
    let (real, phase) = (is_real(diameter, sectors), phases(diameter, sectors));
    // an entry between two sectors has a real and an imaginary part
    let coupled = entries.iter().filter(|entry| entry.2 != 0).count();
    let mut triplets = Vec::with_capacity(if real { entries.len() } else { 2 * (entries.len() + coupled) });
    for copy in 0..if real { 1 } else { 2 } {
        for group in entries.chunk_by(|a, b| a.0 == b.0) {
            let column = copy * n + group[0].0;
            // the upper and the lower half of the column
            for half in 0..if real { 1 } else { 2 } {
                let part = |phase: Complex64| match (half, copy) {
                    (0, 0) | (1, 1) => phase.re,
                    (0, _) => phase.im,
                    _ => -phase.im,
                };
                let all =
                    group.iter().map(|&(_, row, shift, value)| (half * n + row, column, value * part(phase(shift))));
                triplets.extend(all.filter(|entry| entry.2 != 0.0));
            }
        }
    }
    triplets
}

impl RingSector {
    /// Returns the first of `sectors` equal sectors, whose degrees of freedom are stored sector
    /// by sector in `cyclic_basis`.
    ///
    /// Returns `None` if the sectors differ, or if modal damping couples all sectors.
    pub fn from_ring(ring: &Structure, sectors: usize) -> Option<RingSector> {
        let all = ring.dofs();
        if sectors == 0 || !all.is_multiple_of(sectors) || ring.damped_modes().is_some() {
            return None;
        }
        let n = all / sectors;
        let largest = ring.largest();
        let near = |first: &[f64; 3], values: &[f64; 3]| {
            (0..3).all(|k| (first[k] - values[k]).abs() <= SECTOR_ROUNDING * largest[k])
        };
        let mut entries = Vec::new();
        for own in 0..n {
            let first = ring.column(own);
            for sector in 0..sectors {
                let column = if sector == 0 { first.clone() } else { ring.column(sector * n + own) };
                // the rows from those of the column's own sector on, once around the ring
                let start = column.partition_point(|(row, _)| *row < sector * n);
                let turned = column[start..].iter().chain(&column[..start]);
                let equal = column.len() == first.len()
                    && first.iter().zip(turned).all(|((row, values), (other_row, others))| {
                        (row + sector * n) % all == *other_row && near(values, others)
                    });
                if !equal {
                    return None;
                }
                let rows = column.iter().take_while(|(row, _)| *row < n);
                entries.extend(rows.map(|&(row, values)| (row, own, sector, values)));
            }
        }
        entries.sort_unstable_by_key(|entry| (entry.0, entry.1, entry.2));
        let places = ring.places()[..n].to_vec();
        Some(RingSector { sectors, places, entries, waves: Mutex::default() })
    }

    /// Creates the first of `sectors` equal sectors from its places and the entries of mass,
    /// damping and stiffness. Entries of the same row and column are summed.
    pub(crate) fn from_entries(
        places: Vec<String>,
        sectors: usize,
        kinds: [impl Iterator<Item = RingEntry>; 3],
    ) -> Self {
        let mut entries = Vec::with_capacity(kinds.iter().map(|of| of.size_hint().0).sum());
        for (kind, of) in kinds.into_iter().enumerate() {
            entries.extend(of.map(|(row, column, shift, value)| {
                let values: [f64; 3] = std::array::from_fn(|k| if k == kind { value } else { 0.0 });
                (row, column, shift.rem_euclid(sectors as i64) as usize, values)
            }));
        }
        RingSector { sectors, places, entries: summed(entries), waves: Mutex::default() }
    }

    /// Returns this sector with additional springs, which every sector has. Each has a direction,
    /// as rows of the ring with weights, and a stiffness, N/m. Returns `None` if an entry is then
    /// not finite.
    pub(crate) fn with_springs<'a>(
        &self,
        springs: impl IntoIterator<Item = (&'a Vec<(usize, f64)>, f64)>,
    ) -> Option<RingSector> {
        let (n, sectors) = (self.dofs(), self.sectors);
        // the stiffness by the offset of the column in sectors: an axis of a reduced structure has
        // many rows
        let mut added: Vec<DMatrix<f64>> = vec![DMatrix::zeros(0, 0); sectors];
        for (rows, k) in springs {
            for &(i, w) in rows {
                for &(l, v) in rows {
                    let matrix = &mut added[(l / n + sectors - i / n) % sectors];
                    if matrix.is_empty() {
                        *matrix = DMatrix::zeros(n, n);
                    }
                    matrix[(i % n, l % n)] += w * v * k;
                }
            }
        }
        let mut entries = self.entries.clone();
        for (shift, matrix) in added.iter().enumerate().filter(|(_, matrix)| !matrix.is_empty()) {
            let all = (0..n).flat_map(|row| (0..n).map(move |column| (row, column)));
            let own = all.map(|at| (at.0, at.1, shift, [0.0, 0.0, matrix[at]]));
            entries.extend(own.filter(|entry| entry.3[2] != 0.0));
        }
        let sector =
            RingSector { entries: summed(entries), places: self.places.clone(), sectors, waves: Mutex::default() };
        sector.largest()[2].is_finite().then_some(sector)
    }

    /// Returns the largest absolute entries of mass, damping and stiffness.
    pub(super) fn largest(&self) -> [f64; 3] {
        let all = self.entries.iter();
        all.fold([0.0; 3], |most, entry| std::array::from_fn(|k| f64::max(most[k], entry.3[k].abs())))
    }

    /// Returns the diagonal entries of mass, damping and stiffness in a row.
    pub(super) fn diagonal(&self, row: usize) -> [f64; 3] {
        let found = self.entries.binary_search_by_key(&(row, row, 0), |entry| (entry.0, entry.1, entry.2));
        found.map_or([0.0; 3], |at| self.entries[at].3)
    }

    /// Iterates over the nonzero entries of the ring, row by row: row, column, values of mass,
    /// damping and stiffness.
    pub(super) fn ring_entries(&self) -> impl Iterator<Item = (usize, usize, [f64; 3])> + '_ {
        let (n, sectors) = (self.dofs(), self.sectors);
        (0..sectors).flat_map(move |sector| {
            let of = move |&(row, column, shift, values): &SectorEntry| {
                (sector * n + row, (sector + shift) % sectors * n + column, values)
            };
            self.entries.iter().map(of)
        })
    }

    /// Iterates over the nonzero entries of the mass (0), damping (1) or stiffness matrix (2) of
    /// the ring, row by row.
    pub(super) fn ring_entries_of(&self, kind: usize) -> impl Iterator<Item = (usize, usize, f64)> + use<> {
        let (n, sectors) = (self.dofs(), self.sectors);
        let own = self.entries.iter().filter(|entry| entry.3[kind] != 0.0);
        let own: Rc<[_]> = own.map(|&(row, column, shift, values)| (row, column, shift, values[kind])).collect();
        (0..sectors).flat_map(move |sector| {
            let own = own.clone();
            (0..own.len()).map(move |at| {
                let (row, column, shift, value) = own[at];
                (sector * n + row, (sector + shift) % sectors * n + column, value)
            })
        })
    }

    /// Returns the numbers of entries of mass, damping and stiffness in the ring.
    pub(super) fn ring_entry_counts(&self) -> [usize; 3] {
        [0, 1, 2].map(|kind| self.sectors * self.entries.iter().filter(|entry| entry.3[kind] != 0.0).count())
    }

    /// Returns whether the matrices of two sectors are equal.
    pub(super) fn is_equal(&self, other: &RingSector) -> bool {
        self.sectors == other.sectors && self.entries == other.entries
    }

    /// Returns whether a property of a structure holds for all waves. A ring has it then too, if
    /// it is a definiteness of its matrices.
    pub(super) fn every_wave(&self, holds: impl Fn(&Structure) -> bool) -> bool {
        (0..=self.sectors / 2).all(|diameter| self.wave(diameter).is_ok_and(|wave| holds(wave.structure())))
    }

    /// Returns the number of degrees of freedom of a sector.
    pub fn dofs(&self) -> usize {
        self.places.len()
    }

    /// Returns the number of sectors.
    pub fn sectors(&self) -> usize {
        self.sectors
    }

    /// Returns the matrices of the wave with this nodal diameter. The diameters `d` and `d + N`
    /// are equivalent. The result is kept.
    ///
    /// # Errors
    /// [`StructureError`]: the matrices do not form a valid structure.
    ///
    /// # Example
    /// A chain closed to a ring: the wave of nodal diameter d has the stiffness
    /// `k + 2 kc (1 - cos 2πd/N)`.
    /// ```
    /// use num_complex::Complex64;
    /// use stickslip::structure::{RingSector, Structure};
    /// use stickslip_numerics::sparse::SparseMatrix;
    /// let (n, d) = (12, 5);
    /// let entries = |own: f64, edge: f64| {
    ///     let all = (0..n)
    ///         .flat_map(|i| [(i, i, own), (i, (i + 1) % n, edge), ((i + 1) % n, i, edge)]);
    ///     SparseMatrix::from_triplets(n, all).unwrap()
    /// };
    /// let places = (0..n).map(|i| format!("m{i}")).collect();
    /// let ring =
    ///     Structure::sparse(places, entries(1.0, 0.0), entries(0.1, 0.0), entries(3.0, -0.5))
    ///         .unwrap();
    /// let wave = RingSector::from_ring(&ring, n).unwrap().wave(d).unwrap();
    /// let mut x = vec![Complex64::new(1.0, 0.0)];
    /// wave.dynamic_stiffness(Complex64::ZERO, 0.0).unwrap().solve(&mut x);
    /// let stiffness =
    ///     2.0 + 2.0 * 0.5 * (1.0 - (std::f64::consts::TAU * d as f64 / n as f64).cos());
    /// assert!((x[0] - 1.0 / stiffness).norm() < 1e-14);
    /// ```
    pub fn wave(&self, diameter: usize) -> Result<Wave, StructureError> {
        let diameter = diameter % self.sectors;
        let mut known = self.waves.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(wave) = known.get(&diameter) {
            return Ok(wave.clone());
        }
        let wave = self.new_wave(diameter)?;
        known.insert(diameter, wave.clone());
        Ok(wave)
    }

    fn new_wave(&self, diameter: usize) -> Result<Wave, StructureError> {
        let n = self.dofs();
        let [mass, damping, stiffness] = [0, 1, 2].map(|kind| self.wave_matrix(kind, diameter));
        let mut places = self.places.clone();
        if !is_real(diameter, self.sectors) {
            places.extend(self.places.iter().map(|place| format!("{place}, a quarter period later")));
        }
        let structure = Structure::sparse(places, mass?, damping?, stiffness?)?;
        Ok(Wave { sectors: self.sectors, diameter, dofs: n, structure })
    }

    /// Returns the mass (0), damping (1) or stiffness matrix (2) of a wave in real form.
    fn wave_matrix(&self, kind: usize, diameter: usize) -> Result<SparseMatrix, StructureError> {
        let (n, real) = (self.dofs(), is_real(diameter, self.sectors));
        let phase = phases(diameter, self.sectors);
        // damping by modes couples all sectors: the entries of one row and column are summed
        let mut triplets = Vec::new();
        for group in self.entries.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (row, column, ..) = group[0];
            let sum: Complex64 = group.iter().map(|entry| phase(entry.2 as i64) * entry.3[kind]).sum();
            triplets.push((row, column, sum.re));
            if !real {
                triplets.extend([(n + row, n + column, sum.re), (row, n + column, -sum.im), (n + row, column, sum.im)]);
            }
        }
        let size = if real { n } else { 2 * n };
        SparseMatrix::from_triplets(size, triplets).map_err(|error| StructureError::of("sector's", &error))
    }

    /// Checks that the entries are finite, and that the mass matrix is positive semidefinite.
    pub(super) fn check(&self) -> Result<(), StructureError> {
        for (kind, matrix) in ["mass", "damping", "stiffness"].into_iter().enumerate() {
            if let Some(&(row, column, _, values)) = self.entries.iter().find(|entry| !entry.3[kind].is_finite()) {
                let (row, column) = (row + 1, column + 1);
                return Err(StructureError::NotFinite { matrix, row, column, value: values[kind] });
            }
        }
        for diameter in 0..=self.sectors / 2 {
            let mass = self.wave_matrix(0, diameter)?;
            let is_semidefinite = match is_full(mass.n(), [mass.len(); 3]) {
                true => is_semidefinite(&to_full(&mass)),
                false => sparse_definite(&mass).is_some(),
            };
            if !is_semidefinite {
                return Err(StructureError::NegativeMass);
            }
        }
        Ok(())
    }
}

impl Wave {
    /// Returns its nodal diameter, which is less than the number of sectors.
    pub fn diameter(&self) -> usize {
        self.diameter
    }

    /// Returns whether [`Wave::structure`] has twice the size of a sector. Each mode then
    /// occurs twice, once for each direction of travel.
    pub fn is_double(&self) -> bool {
        self.structure.dofs() > self.dofs
    }

    /// Returns the structure of the wave: the motion of a sector and the same motion a quarter
    /// of a period later, or the motion alone if the matrices are real.
    pub fn structure(&self) -> &Structure {
        &self.structure
    }

    /// Returns the phase factor of a sector relative to the first one, `e^{j d θ s}`.
    pub fn phase(&self, sector: i64) -> Complex64 {
        unit_root(self.diameter as i64 * sector, self.sectors)
    }

    /// Factors `s² M_d + s C_d + K_d`, with additional springs of `hold` (1/s²) times the mass
    /// matrix.
    ///
    /// # Errors
    /// [`Singular`]: an undamped resonance.
    pub fn dynamic_stiffness(&self, s: Complex64, hold: f64) -> Result<WaveStiffness, Singular> {
        if self.is_double() && !self.structure.is_sparse() {
            let factor = self.structure.complex_dynamic_stiffness(s, hold)?;
            return Ok(WaveStiffness { dofs: self.dofs, double: false, factor });
        }
        let factor = self.structure.shifted_dynamic_stiffness(s, hold)?;
        Ok(WaveStiffness { dofs: self.dofs, double: self.is_double(), factor })
    }

    /// Returns `vᴴ C v` of complex velocities of the first sector, W: twice the mean power that
    /// its damping dissipates.
    pub(crate) fn damping_power(&self, velocity: &[Complex64]) -> f64 {
        let (real, imaginary) = (velocity.iter().map(|v| v.re), velocity.iter().map(|v| v.im));
        match self.is_double() {
            true => self.structure.damping_power(&real.chain(imaginary).collect::<Vec<_>>()),
            false => {
                let parts: [Vec<f64>; 2] = [real.collect(), imaginary.collect()];
                parts.iter().map(|part| self.structure.damping_power(part)).sum()
            }
        }
    }
}

/// The factored dynamic stiffness of a wave at one complex frequency.
#[derive(Debug, Clone)]
pub struct WaveStiffness {
    dofs: usize,
    /// True if the factor is that of the real form, of twice the size.
    double: bool,
    factor: super::DynamicStiffness,
}

impl WaveStiffness {
    /// Computes complex displacements of the first sector (m) from the forces on it (N) in
    /// place. The columns are stored one after the other.
    pub fn solve(&self, loads: &mut [Complex64]) {
        if !self.double {
            return self.factor.solve(loads);
        }
        let n = self.dofs;
        let mut twice = vec![ZERO; 2 * loads.len()];
        for (load, twice) in loads.chunks_exact(n).zip(twice.chunks_exact_mut(2 * n)) {
            for i in 0..n {
                (twice[i], twice[n + i]) = (load[i], load[i] * Complex64::new(0.0, -1.0));
            }
        }
        self.factor.solve(&mut twice);
        for (load, twice) in loads.chunks_exact_mut(n).zip(twice.chunks_exact(2 * n)) {
            load.copy_from_slice(&twice[..n]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Two masses per sector, an asymmetric coupling to the next sector, a gyroscopic pair.
    fn ring(sectors: usize, spoiled: f64) -> Structure {
        let n = 2 * sectors;
        let [mut m, mut c, mut k] = [(); 3].map(|()| DMatrix::<f64>::zeros(n, n));
        for s in 0..sectors {
            let (a, b, next) = (2 * s, 2 * s + 1, 2 * ((s + 1) % sectors));
            (m[(a, a)], m[(b, b)]) = (1.0, 0.7);
            (c[(a, b)], c[(b, a)]) = (0.05, -0.05);
            c[(b, b)] += 0.02;
            for (i, l, value) in [(a, b, 2.0), (b, next, 0.6), (a, next, 0.3)] {
                for (i, l, value) in [(i, i, value), (l, l, value), (i, l, -value), (l, i, -value)] {
                    k[(i, l)] += value;
                }
            }
            k[(a, a)] += 0.4;
        }
        k[(0, 0)] += spoiled;
        Structure::new((0..n).map(|i| format!("p{i}")).collect(), m, c, k).unwrap()
    }

    /// The sector responds to a travelling force like the ring.
    #[test]
    fn a_sector_is_its_ring() {
        for sectors in [2, 3, 7, 24, 30] {
            let ring = ring(sectors, 0.0);
            let sector = RingSector::from_ring(&ring, sectors).unwrap();
            for diameter in 0..sectors {
                let wave = sector.wave(diameter).unwrap();
                assert_eq!(wave.is_double(), 2 * diameter % sectors != 0);
                let load = [Complex64::new(1.0, 0.2), Complex64::new(-0.4, 0.3)];
                for s in [ZERO, Complex64::new(0.0, 0.83), Complex64::new(1.7, 0.0)] {
                    let mut one = load.to_vec();
                    wave.dynamic_stiffness(s, 0.0).unwrap().solve(&mut one);
                    let phase = |s: usize| wave.phase(s as i64);
                    let mut all: Vec<Complex64> = (0..2 * sectors).map(|i| load[i % 2] * phase(i / 2)).collect();
                    ring.dynamic_stiffness(s).unwrap().solve(&mut all);
                    let size = all.iter().fold(0.0f64, |m, x| m.max(x.norm()));
                    for (i, x) in all.iter().enumerate() {
                        assert!((x - one[i % 2] * phase(i / 2)).norm() < 1e-12 * size, "{sectors} {diameter}: {i}");
                    }
                }
            }
        }
    }

    /// A ring that stores its first sector has the matrices of the whole ring.
    #[test]
    fn a_stored_sector_is_its_ring() {
        for sectors in [2, 3, 7, 30] {
            let whole = ring(sectors, 0.0);
            let first = RingSector::from_ring(&whole, sectors).unwrap();
            let of = |kind: usize| -> Vec<RingEntry> {
                first.entries.iter().map(|entry| (entry.0, entry.1, entry.2 as i64, entry.3[kind])).collect()
            };
            let [mass, damping, stiffness] = [0, 1, 2].map(of);
            let kinds = [mass, damping, stiffness].map(Vec::into_iter);
            let sector = RingSector::from_entries(first.places.clone(), sectors, kinds);
            let stored = Structure::ring(whole.places().to_vec(), sector).unwrap();
            assert_eq!((&stored, stored.is_sparse()), (stored.expanded(), whole.is_sparse()));
            assert_eq!(stored.has_definite_mass(), whole.has_definite_mass());
            assert_eq!(stored.is_dissipative(), whole.is_dissipative());
            // the sums of the whole ring have another order
            let near = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).amax() < 1e-14;
            assert!(near(stored.mass(), whole.mass()) && near(stored.stiffness(), whole.stiffness()));
            assert!(near(stored.damping(), whole.damping()));
            for (a, b) in [
                (stored.largest()[2], whole.largest()[2]),
                (stored.diagonal_mass(3), whole.diagonal_mass(3)),
                (stored.diagonal_stiffness(2), whole.diagonal_stiffness(2)),
            ] {
                assert!((a - b).abs() < 1e-14, "{a} {b}");
            }
            let sum = |entries: Box<dyn Iterator<Item = (usize, usize, f64)> + '_>| {
                let mut sum = DMatrix::zeros(whole.dofs(), whole.dofs());
                entries.for_each(|(row, column, value)| sum[(row, column)] += value);
                sum
            };
            assert_eq!(&sum(stored.stiffness_entries()), stored.stiffness());
            assert_eq!(&sum(stored.damping_entries()), stored.damping());
            assert_ne!(stored, ring(sectors, 1e-6));
            assert_ne!(ring(sectors, 1e-6), stored);
        }
        let kinds = [vec![(0, 0, 0, 1.0), (0, 0, 1, -1.0)], vec![], vec![]].map(Vec::into_iter);
        let sector = RingSector::from_entries(vec!["a".into()], 3, kinds);
        let names = vec!["0".to_owned(), "1".into(), "2".into()];
        assert_eq!(Structure::ring(names, sector).unwrap_err(), StructureError::NegativeMass);
    }

    /// The power of a wave on one sector is its part of the power on the whole ring.
    #[test]
    fn all_sectors_lose_the_same_power() {
        let (sectors, diameter) = (7, 2);
        let whole = ring(sectors, 0.0);
        let wave = RingSector::from_ring(&whole, sectors).unwrap().wave(diameter).unwrap();
        let own = [Complex64::new(1.0, 0.2), Complex64::new(-0.4, 0.3)];
        let all: Vec<Complex64> = (0..2 * sectors).map(|i| own[i % 2] * wave.phase(i as i64 / 2)).collect();
        let entries = whole.damping_entries().map(|(row, column, c)| c * (all[row].conj() * all[column]).re);
        assert!((wave.damping_power(&own) * sectors as f64 / entries.sum::<f64>() - 1.0).abs() < 1e-12);
    }

    /// Column by column, the entries of a wave are those of the general form.
    #[test]
    fn sorted_entries_are_those_of_the_wave() {
        let (n, sectors) = (2, 7);
        let entries: Vec<RingEntry> =
            vec![(0, 0, 0, 3.0), (0, 1, -1, 0.5), (0, 1, 0, -1.0), (1, 0, 0, -1.0), (1, 0, 1, 0.5), (1, 1, 0, 2.0)];
        for diameter in 0..sectors {
            let sorted = symmetric_wave_entries(&entries, n, diameter, sectors);
            assert!(sorted.is_sorted_by_key(|entry| (entry.1, entry.0)));
            let general = wave_entries(entries.iter().copied(), [n, n], diameter, sectors);
            let [sorted, general] = [sorted, general].map(|all| SparseMatrix::from_triplets(2 * n, all).unwrap());
            assert!(
                sorted
                    .entries()
                    .zip(general.entries())
                    .all(|(a, b)| { (a.0, a.1) == (b.0, b.1) && (a.2 - b.2).abs() < 1e-15 })
            );
            assert_eq!(sorted.len(), general.len());
        }
    }

    /// Springs of one sector, also to the next and to the previous one, are those of the whole
    /// ring in every sector.
    #[test]
    fn every_sector_gets_the_springs_of_the_first() {
        let (sectors, n) = (5, 2);
        let whole = ring(sectors, 0.0);
        let all = sectors * n;
        let springs = [(vec![(0, 1.0), (n + 1, -0.5)], 3.0), (vec![(1, 1.0), (all - 2, -1.0)], 7.0)];
        let turned = |sector: usize| {
            let turn = move |rows: &Vec<(usize, f64)>| rows.iter().map(|&(i, w)| ((i + sector * n) % all, w)).collect();
            springs.iter().map(move |(rows, k)| (turn(rows), *k)).collect::<Vec<_>>()
        };
        let around: Vec<_> = (0..sectors).flat_map(turned).collect();
        let expected = RingSector::from_ring(&whole.with_springs(&around).unwrap(), sectors).unwrap();
        let sector = RingSector::from_ring(&whole, sectors).unwrap();
        let found = sector.with_springs(springs.iter().map(|(rows, k)| (rows, *k))).unwrap();
        let entries = |sector: &RingSector| -> Vec<(usize, usize, [f64; 3])> { sector.ring_entries().collect() };
        let (found, expected) = (entries(&found), entries(&expected));
        assert_eq!(found.len(), expected.len());
        for (own, other) in found.iter().zip(&expected) {
            let near = own.2.iter().zip(other.2).all(|(a, b)| (a - b).abs() < 1e-12 * (1.0 + b.abs()));
            assert!((own.0, own.1) == (other.0, other.1) && near, "{own:?} {other:?}");
        }
        assert!(sector.with_springs([(&springs[0].0, f64::INFINITY)]).is_none());
    }

    #[test]
    fn unequal_sectors_are_none() {
        assert!(RingSector::from_ring(&ring(7, 1e-6), 7).is_none());
        assert!(RingSector::from_ring(&ring(7, 0.0), 4).is_none());
        assert!(RingSector::from_ring(&ring(7, 0.0), 0).is_none());
        // a smaller number of sectors is valid: each then comprises several of the original
        // ones
        assert_eq!(RingSector::from_ring(&ring(6, 0.0), 3).unwrap().dofs(), 4);
    }

    #[test]
    fn turns_are_exact_where_they_can_be() {
        assert_eq!(unit_root(6, 8), Complex64::new(0.0, -1.0));
        assert_eq!(unit_root(-5, 24), unit_root(19, 24));
        assert_eq!(unit_root(5, 24), unit_root(19, 24).conj());
        assert!((unit_root(7, 24) - Complex64::cis(TAU * 7.0 / 24.0)).norm() < 1e-15);
    }
}
