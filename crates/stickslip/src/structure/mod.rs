//! The linear part of a system: mass, damping and stiffness.
//!
//! No other module stores these matrices: copies of a structure share them.

mod component;
mod dynamic;
mod free_vibration;
mod modal_damping;
pub mod reduction;
mod reduction_store;
mod sector;
mod sector_boundary;
mod sector_faces;
mod uncoupled_modes;

pub(crate) use component::{BladeCache, ReducedForm, SectorCache};
pub use component::{CommonBasisComponent, Component, ReducedComponent, SectorComponent};
pub use dynamic::DynamicStiffness;
pub(crate) use free_vibration::free_vibrations;
pub use modal_damping::ModalDamping;
pub use reduction::{Reduction, ReductionKind, SectorBasis};
pub use reduction_store::ReductionStore;
pub use sector::{RingSector, Wave, WaveStiffness};
pub(crate) use sector::{sector_entries, unit_root};
pub use sector_boundary::{BladeError, Boundary, BoundaryError, CoordinateAxis};
pub(crate) use sector_boundary::{CyclicSector, RingEntry, RingRow};
pub use sector_faces::{FacesError, NodeCoordinates, SectorFaces};
pub(crate) use uncoupled_modes::UncoupledModes;

use nalgebra::{DMatrix, DVectorView};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use stickslip_numerics::definiteness::{is_semidefinite, semidefinite_rank, sparse_definite};
use stickslip_numerics::sparse::{Asymmetry, MatrixError, SparseMatrix, SymbolicAnalysis};

/// `M x'' + C x' + K x`, over the places that are free to move.
///
/// The mass matrix need not be diagonal. A copy is a reference to the same matrices. Matrices
/// are stored full if there are few degrees of freedom or many entries, otherwise sparse. A ring
/// of equal sectors stores the matrices of its first sector. The storage affects the computing
/// time, but not the results.
#[derive(Debug, Clone)]
pub struct Structure(Arc<StructureData>);

#[derive(Debug)]
struct StructureData {
    places: Vec<String>,
    form: Storage,
    /// Largest absolute entries of mass, damping and stiffness.
    largest: [f64; 3],
    dissipates: OnceLock<bool>,
    uncoupled: OnceLock<Option<Arc<UncoupledModes>>>,
    /// The first sector, by the number of equal sectors; none if the sectors differ.
    ring_sectors: Mutex<BTreeMap<usize, Option<Arc<RingSector>>>>,
}

#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // one per structure, behind a reference
enum Storage {
    Full(Arc<Matrices>),
    Sparse {
        mass: SparseMatrix,
        damping: SparseMatrix,
        stiffness: SparseMatrix,
        /// Modal damping in addition to the damping matrix.
        modes: Option<ModalDamping>,
        analysis: OnceLock<SymbolicAnalysis>,
        /// Full copy, created when a method first requests it.
        full: OnceLock<Arc<Matrices>>,
    },
    /// A ring of equal sectors, by its first sector.
    Ring {
        sector: Arc<RingSector>,
        /// The matrices of all sectors, created when a method first requests them.
        expanded: OnceLock<Structure>,
    },
}

/// Mass (kg), damping (kg/s) and stiffness (N/m), each n × n, with all zeros stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrices {
    /// `M`.
    pub mass: DMatrix<f64>,
    /// `C`.
    pub damping: DMatrix<f64>,
    /// `K`.
    pub stiffness: DMatrix<f64>,
}

/// Largest number of degrees of freedom for methods with full matrices. At this size, a product
/// of two takes seconds, and each uses 32 MB.
pub const MAX_FULL_DOFS: usize = 2000;
/// Number of degrees of freedom from which matrices are stored sparse.
pub const MIN_SPARSE_DOFS: usize = 40;

/// The reason why matrices do not form a valid structure.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StructureError {
    /// The size of a matrix differs from the number of places.
    #[error("the {matrix} matrix is {rows} x {columns}; for {places} places it must be {places} x {places}")]
    Size {
        /// Name of the matrix.
        matrix: &'static str,
        /// Its number of rows.
        rows: usize,
        /// Its number of columns.
        columns: usize,
        /// Number of places.
        places: usize,
    },
    /// A number is not finite.
    #[error("the {matrix} matrix has {value} in row {row}, column {column}; every entry must be finite")]
    NotFinite {
        /// Name of the matrix.
        matrix: &'static str,
        /// Row, from 1.
        row: usize,
        /// Column, from 1.
        column: usize,
        /// The entry.
        value: f64,
    },
    /// A matrix is not symmetric, although it must be.
    #[error(
        "the {matrix} matrix is not symmetric: {value:e} in row {row}, column {column}, but {mirrored:e} in the \
         mirrored entry; provide both triangles, or their mean if they differ by rounding"
    )]
    NotSymmetric {
        /// Name of the matrix.
        matrix: &'static str,
        /// Row, from 1.
        row: usize,
        /// Column, from 1.
        column: usize,
        /// The entry.
        value: f64,
        /// The entry across the diagonal.
        mirrored: f64,
    },
    /// The mass matrix is not positive semidefinite.
    #[error("the mass matrix is not positive semidefinite: some motion has negative kinetic energy")]
    NegativeMass,
    /// Two places have the same name.
    #[error("the name `{0}` appears twice among the places")]
    DuplicateName(String),
}

/// Difference between an entry and its mirror image that counts as rounding, relative to the
/// largest entry. Programs that write ten digits cause such differences.
const SYMMETRIC: f64 = 1e-9;

impl Structure {
    /// Creates a structure from places and full matrices (kg, kg/s, N/m), n × n. Mass and
    /// stiffness are symmetric; damping may have a gyroscopic part.
    ///
    /// # Errors
    /// [`StructureError`]: a wrong size, an entry that is not finite, an unsymmetric mass or
    /// stiffness matrix, a mass matrix that is not positive semidefinite.
    ///
    /// # Example
    /// ```
    /// use nalgebra::dmatrix;
    /// use stickslip::structure::Structure;
    /// let (m, k) = (dmatrix![1.0, 0.4; 0.4, 1.0], dmatrix![2.0, -1.0; -1.0, 2.0]);
    /// let structure =
    ///     Structure::new(vec!["a".into(), "b".into()], m, dmatrix![0.1, 0.0; 0.0, 0.1], k)
    ///         .unwrap();
    /// assert_eq!(structure.dofs(), 2);
    /// ```
    pub fn new(
        places: Vec<String>,
        mass: DMatrix<f64>,
        damping: DMatrix<f64>,
        stiffness: DMatrix<f64>,
    ) -> Result<Self, StructureError> {
        let n = places.len();
        for (matrix, values) in [("mass", &mass), ("damping", &damping), ("stiffness", &stiffness)] {
            let (rows, columns) = values.shape();
            if (rows, columns) != (n, n) {
                return Err(StructureError::Size { matrix, rows, columns, places: n });
            }
        }
        let full = Matrices { mass, damping, stiffness };
        let filled = [&full.mass, &full.damping, &full.stiffness]
            .map(|matrix| matrix.iter().filter(|value| **value != 0.0).count());
        if is_full(n, filled) {
            return Structure::checked(places, Storage::Full(Arc::new(full)));
        }
        let entries = |matrix: &DMatrix<f64>| {
            let all = (0..n).flat_map(|column| (0..n).map(move |row| (row, column)));
            SparseMatrix::from_triplets(n, all.map(|at| (at.0, at.1, matrix[at])).filter(|entry| entry.2 != 0.0))
        };
        let [mass, damping, stiffness] =
            [("mass", &full.mass), ("damping", &full.damping), ("stiffness", &full.stiffness)]
                .map(|(name, matrix)| entries(matrix).map_err(|error| StructureError::of(name, &error)));
        Structure::sparse(places, mass?, damping?, stiffness?)
    }

    /// Creates a structure from sparse matrices.
    ///
    /// # Errors
    /// See [`Structure::new`].
    ///
    /// # Example
    /// A chain of 50,000 masses, which would need 60 GB as full matrices.
    /// ```
    /// use num_complex::Complex64;
    /// use stickslip::structure::Structure;
    /// use stickslip_numerics::sparse::SparseMatrix;
    /// let n = 50_000;
    /// let places = (0..n).map(|i| format!("m{i}")).collect();
    /// let diagonal =
    ///     |value: f64| SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, value))).unwrap();
    /// let springs = (1..n)
    ///     .flat_map(|i| [(i, i, 1.0), (i - 1, i - 1, 1.0), (i, i - 1, -1.0), (i - 1, i, -1.0)]);
    /// let stiffness = SparseMatrix::from_triplets(n, springs.chain([(0, 0, 1.0)])).unwrap();
    /// let chain = Structure::sparse(places, diagonal(1.0), diagonal(0.1), stiffness).unwrap();
    /// // pulled at its end, each of the springs carries the force
    /// let mut x = vec![Complex64::ZERO; n];
    /// x[n - 1].re = 2.0;
    /// chain.dynamic_stiffness(Complex64::ZERO).unwrap().solve(&mut x);
    /// assert!((x[n - 1].re - 2.0 * n as f64).abs() < 1e-3);
    /// ```
    pub fn sparse(
        places: Vec<String>,
        mass: SparseMatrix,
        damping: SparseMatrix,
        stiffness: SparseMatrix,
    ) -> Result<Self, StructureError> {
        let n = places.len();
        for (name, matrix) in [("mass", &mass), ("damping", &damping), ("stiffness", &stiffness)] {
            if matrix.n() != n {
                let (rows, columns) = (matrix.n(), matrix.n());
                return Err(StructureError::Size { matrix: name, rows, columns, places: n });
            }
        }
        let (analysis, full) = (OnceLock::new(), OnceLock::new());
        let form = if is_full(n, [&mass, &damping, &stiffness].map(SparseMatrix::len)) {
            Storage::Full(Arc::new(all_full(&mass, &damping, &stiffness)))
        } else {
            let (mass, stiffness) = (symmetric("mass", mass)?, symmetric("stiffness", stiffness)?);
            Storage::Sparse { mass, damping, stiffness, modes: None, analysis, full }
        };
        Structure::checked(places, form)
    }

    /// Creates the structure of a ring of equal sectors, of which it stores the first one.
    ///
    /// # Errors
    /// See [`Structure::new`].
    pub(crate) fn ring(places: Vec<String>, sector: RingSector) -> Result<Self, StructureError> {
        sector.check()?;
        let form = Storage::Ring { sector: Arc::new(sector), expanded: OnceLock::new() };
        Structure::checked(places, form)
    }

    /// Returns the structure with the matrices of all sectors; any other than a ring is itself.
    pub(in crate::structure) fn expanded(&self) -> &Structure {
        let Storage::Ring { sector, expanded } = &self.0.form else { return self };
        expanded.get_or_init(|| {
            let n = self.dofs();
            let matrix = |kind: usize| {
                let all = sector.ring_entries().map(|(row, column, values)| (row, column, values[kind]));
                // the entries of a checked ring are finite and in range
                SparseMatrix::from_triplets(n, all.filter(|entry| entry.2 != 0.0)).expect("entries of a checked ring")
            };
            let [mass, damping, stiffness] = [0, 1, 2].map(matrix);
            let form = if is_full(n, [&mass, &damping, &stiffness].map(SparseMatrix::len)) {
                Storage::Full(Arc::new(all_full(&mass, &damping, &stiffness)))
            } else {
                let (analysis, full) = (OnceLock::new(), OnceLock::new());
                Storage::Sparse { mass, damping, stiffness, modes: None, analysis, full }
            };
            Structure::from_parts(self.0.places.clone(), form, self.0.largest)
        })
    }

    /// Returns this structure with additional springs. Each has a direction, as rows with
    /// weights, and a stiffness, N/m. Returns `None` if an entry is then not finite.
    pub(crate) fn with_springs(&self, springs: &[(Vec<(usize, f64)>, f64)]) -> Option<Structure> {
        let added = springs.iter().flat_map(|(rows, k)| {
            rows.iter().flat_map(move |&(i, w)| rows.iter().map(move |&(l, v)| (i, l, w * v * k)))
        });
        let form = match &self.0.form {
            Storage::Full(full) => {
                let mut full = Matrices::clone(full);
                added.for_each(|(i, l, k)| full.stiffness[(i, l)] += k);
                Storage::Full(Arc::new(full))
            }
            Storage::Sparse { mass, damping, stiffness, modes, .. } => {
                let stiffness = SparseMatrix::from_triplets(self.dofs(), stiffness.entries().chain(added)).ok()?;
                let (mass, damping, modes) = (mass.clone(), damping.clone(), modes.clone());
                Storage::Sparse { mass, damping, stiffness, modes, analysis: OnceLock::new(), full: OnceLock::new() }
            }
            Storage::Ring { .. } => return self.expanded().with_springs(springs),
        };
        let largest = match &form {
            Storage::Full(full) => full.stiffness.amax(),
            Storage::Sparse { stiffness, .. } => stiffness.max_abs(),
            Storage::Ring { sector, .. } => sector.largest()[2],
        };
        let [mass, damping, _] = self.0.largest;
        let (places, largest) = (self.0.places.clone(), [mass, damping, largest]);
        largest[2].is_finite().then(|| Structure::from_parts(places, form, largest))
    }

    /// Returns this structure with additional modal damping.
    ///
    /// # Panics
    /// If the length of the columns differs from the size of the structure.
    #[must_use]
    pub fn with_damped_modes(&self, of: &ModalDamping) -> Structure {
        let n = self.dofs();
        assert_eq!(of.n(), n, "columns of another length");
        let [mass, mut most, stiffness] = self.0.largest;
        let form = match &self.0.form {
            Storage::Full(full) => {
                let mut full = Matrices::clone(full);
                of.add_to(&mut full.damping);
                most = full.damping.amax();
                Storage::Full(Arc::new(full))
            }
            Storage::Sparse { mass, damping, stiffness, .. } => {
                let (mass, damping, stiffness) = (mass.clone(), damping.clone(), stiffness.clone());
                // the largest entry of a positive semidefinite matrix is on the diagonal
                most = (0..n).fold(most, |most, i| most.max((damping.get(i, i) + of.get(i, i)).abs()));
                let (modes, analysis, full) = (Some(of.clone()), OnceLock::new(), OnceLock::new());
                Storage::Sparse { mass, damping, stiffness, modes, analysis, full }
            }
            Storage::Ring { .. } => return self.expanded().with_damped_modes(of),
        };
        Structure::from_parts(self.0.places.clone(), form, [mass, most, stiffness])
    }

    fn checked(places: Vec<String>, form: Storage) -> Result<Self, StructureError> {
        let mut names: Vec<&String> = places.iter().collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(StructureError::DuplicateName(pair[0].clone()));
        }
        let largest = match &form {
            Storage::Full(full) => {
                full.check()?;
                [&full.mass, &full.damping, &full.stiffness]
                    .map(|matrix| if matrix.is_empty() { 0.0 } else { matrix.amax() })
            }
            Storage::Sparse { mass, damping, stiffness, .. } => {
                let is_diagonal = mass.entries().all(|(row, column, _)| row == column);
                let negative = mass.entries().any(|(row, column, value)| row == column && value < 0.0);
                if (negative || !is_diagonal) && sparse_definite(mass).is_none() {
                    return Err(StructureError::NegativeMass);
                }
                [mass, damping, stiffness].map(SparseMatrix::max_abs)
            }
            Storage::Ring { sector, .. } => sector.largest(),
        };
        Ok(Structure::from_parts(places, form, largest))
    }

    fn from_parts(places: Vec<String>, form: Storage, largest: [f64; 3]) -> Self {
        Structure(Arc::new(StructureData {
            places,
            form,
            largest,
            dissipates: OnceLock::new(),
            uncoupled: OnceLock::new(),
            ring_sectors: Mutex::default(),
        }))
    }

    /// Returns the number of degrees of freedom, n.
    pub fn dofs(&self) -> usize {
        self.0.places.len()
    }

    /// Returns the names of the degrees of freedom, length n.
    pub fn places(&self) -> &[String] {
        &self.0.places
    }

    /// Returns whether the matrices are stored sparse.
    pub fn is_sparse(&self) -> bool {
        match &self.0.form {
            Storage::Full(_) => false,
            Storage::Sparse { .. } => true,
            Storage::Ring { sector, .. } => !is_full(self.dofs(), sector.ring_entry_counts()),
        }
    }

    /// Returns the full matrices, for methods whose cost grows with the cube of n.
    ///
    /// A sparse structure creates them at the first call, with 24 n² bytes. Callers that need
    /// only entries, products or solutions use [`Structure::entries`] or
    /// [`Structure::dynamic_stiffness`].
    pub fn full(&self) -> &Arc<Matrices> {
        match &self.0.form {
            Storage::Full(full) => full,
            Storage::Sparse { mass, damping, stiffness, modes, full, .. } => full.get_or_init(|| {
                let mut full = all_full(mass, damping, stiffness);
                modes.iter().for_each(|modes| modes.add_to(&mut full.damping));
                Arc::new(full)
            }),
            Storage::Ring { .. } => self.expanded().full(),
        }
    }

    /// Returns the full mass matrix `M`, n × n, kg; see [`Structure::full`].
    pub fn mass(&self) -> &DMatrix<f64> {
        &self.full().mass
    }

    /// Returns the full damping matrix `C`, n × n, kg/s; see [`Structure::full`].
    pub fn damping(&self) -> &DMatrix<f64> {
        &self.full().damping
    }

    /// Returns the full stiffness matrix `K`, n × n, N/m; see [`Structure::full`].
    pub fn stiffness(&self) -> &DMatrix<f64> {
        &self.full().stiffness
    }

    /// Returns the diagonal entry of the mass matrix in a row, kg.
    pub fn diagonal_mass(&self, row: usize) -> f64 {
        match &self.0.form {
            Storage::Full(full) => full.mass[(row, row)],
            Storage::Sparse { mass, .. } => mass.get(row, row),
            Storage::Ring { sector, .. } => sector.diagonal(row % sector.dofs())[0],
        }
    }

    /// Returns the diagonal entry of the stiffness matrix in a row, N/m.
    pub fn diagonal_stiffness(&self, row: usize) -> f64 {
        match &self.0.form {
            Storage::Full(full) => full.stiffness[(row, row)],
            Storage::Sparse { stiffness, .. } => stiffness.get(row, row),
            Storage::Ring { sector, .. } => sector.diagonal(row % sector.dofs())[2],
        }
    }

    /// Returns whether the mass matrix is positive definite up to rounding, so that every
    /// motion has kinetic energy.
    pub fn has_definite_mass(&self) -> bool {
        match &self.0.form {
            Storage::Full(full) => semidefinite_rank(&full.mass) == Some(self.dofs()),
            Storage::Sparse { mass, .. } => sparse_definite(mass) == Some(true),
            Storage::Ring { sector, .. } => sector.every_wave(Structure::has_definite_mass),
        }
    }

    /// Returns the largest absolute entries of mass (kg), damping (kg/s) and stiffness (N/m).
    pub fn largest(&self) -> [f64; 3] {
        self.0.largest
    }

    /// Returns the modal damping in addition to [`Structure::entries`]. Full matrices contain
    /// all damping and return `None`.
    pub fn damped_modes(&self) -> Option<&ModalDamping> {
        match &self.0.form {
            Storage::Full(_) | Storage::Ring { .. } => None,
            Storage::Sparse { modes, .. } => modes.as_ref(),
        }
    }

    /// Iterates over the nonzero entries of (mass, damping, stiffness): row, column, values.
    ///
    /// Full matrices and rings are read row by row, sparse ones column by column. The damping
    /// includes [`Structure::damped_modes`] in addition.
    pub fn entries(&self) -> Box<dyn Iterator<Item = (usize, usize, [f64; 3])> + '_> {
        let n = self.dofs();
        match &self.0.form {
            Storage::Full(full) => Box::new(
                (0..n)
                    .flat_map(move |i| (0..n).map(move |k| (i, k)))
                    .map(|at| (at.0, at.1, [full.mass[at], full.damping[at], full.stiffness[at]]))
                    .filter(|(_, _, values)| values.iter().any(|v| *v != 0.0)),
            ),
            Storage::Sparse { .. } => Box::new((0..n).flat_map(move |column| {
                self.column(column).into_iter().map(move |(row, values)| (row, column, values))
            })),
            Storage::Ring { sector, .. } => Box::new(sector.ring_entries()),
        }
    }

    /// Iterates over the nonzero entries of the damping matrix in the order of
    /// [`Structure::entries`]: row, column, kg/s.
    pub(crate) fn damping_entries(&self) -> Box<dyn Iterator<Item = (usize, usize, f64)> + '_> {
        match &self.0.form {
            Storage::Full(full) => nonzero_entries(&full.damping),
            Storage::Sparse { damping, .. } => Box::new(damping.entries()),
            Storage::Ring { sector, .. } => Box::new(sector.ring_entries_of(1)),
        }
    }

    /// Returns `vᵀ C v` of velocities, W.
    pub(in crate::structure) fn damping_power(&self, velocity: &[f64]) -> f64 {
        match &self.0.form {
            Storage::Full(full) => {
                let velocity = DVectorView::from_slice(velocity, velocity.len());
                velocity.dot(&(&full.damping * velocity))
            }
            _ => self.damping_entries().map(|(row, column, c)| velocity[row] * c * velocity[column]).sum(),
        }
    }

    /// Iterates over the nonzero entries of the stiffness matrix in the order of
    /// [`Structure::entries`]: row, column, N/m.
    pub(crate) fn stiffness_entries(&self) -> Box<dyn Iterator<Item = (usize, usize, f64)> + '_> {
        match &self.0.form {
            Storage::Full(full) => nonzero_entries(&full.stiffness),
            Storage::Sparse { stiffness, .. } => Box::new(stiffness.entries()),
            Storage::Ring { sector, .. } => Box::new(sector.ring_entries_of(2)),
        }
    }

    /// Returns the nonzero entries of one column of (mass, damping, stiffness): row, values. The
    /// rows ascend.
    pub(in crate::structure) fn column(&self, column: usize) -> Vec<(usize, [f64; 3])> {
        match &self.0.form {
            Storage::Full(full) => (0..self.dofs())
                .map(|row| {
                    (row, [full.mass[(row, column)], full.damping[(row, column)], full.stiffness[(row, column)]])
                })
                .filter(|(_, values)| values.iter().any(|value| *value != 0.0))
                .collect(),
            Storage::Sparse { mass, damping, stiffness, .. } => {
                let mut parts = [mass, damping, stiffness].map(|matrix| matrix.column(column).peekable());
                let mut merged = Vec::with_capacity(parts.iter().map(|part| part.size_hint().0).max().unwrap_or(0));
                while let Some(row) = parts.iter_mut().filter_map(|part| part.peek().map(|entry| entry.0)).min() {
                    let take = |part: &mut std::iter::Peekable<_>| part.next_if(|entry: &(usize, f64)| entry.0 == row);
                    merged.push((row, std::array::from_fn(|k| take(&mut parts[k]).map_or(0.0, |entry| entry.1))));
                }
                merged
            }
            Storage::Ring { .. } => self.expanded().column(column),
        }
    }

    /// Returns the first of `sectors` equal sectors; see [`RingSector::from_ring`]. The result is
    /// kept, because several methods need it.
    pub(crate) fn ring_sector(&self, sectors: usize) -> Option<Arc<RingSector>> {
        if let Storage::Ring { sector, .. } = &self.0.form
            && sector.sectors() == sectors
        {
            return Some(sector.clone());
        }
        let mut known = self.0.ring_sectors.lock().unwrap_or_else(PoisonError::into_inner);
        known.entry(sectors).or_insert_with(|| RingSector::from_ring(self, sectors).map(Arc::new)).clone()
    }

    /// Returns whether the structure alone never supplies energy to a motion, and every motion
    /// has mass, damping or stiffness.
    ///
    /// `M`, `K` and the symmetric part of `C` are positive semidefinite, and their sum, each
    /// scaled by its largest entry, is definite.
    pub fn is_dissipative(&self) -> bool {
        *self.0.dissipates.get_or_init(|| match &self.0.form {
            Storage::Full(full) => full.dissipates(),
            Storage::Sparse { mass, damping, stiffness, .. } => {
                let n = self.dofs();
                // the gyroscopic part of the damping does no work
                let halves = damping.entries().flat_map(|(i, k, c)| [(i, k, 0.5 * c), (k, i, 0.5 * c)]);
                let Ok(damping) = SparseMatrix::from_triplets(n, halves) else { return false };
                // modal damping dissipates energy, and only in motions with mass
                let matrices = [mass, &damping, stiffness];
                let [Some(definite), Some(_), Some(_)] = matrices.map(sparse_definite) else { return false };
                definite || {
                    let share = |matrix: &SparseMatrix| 1.0 / matrix.max_abs().max(f64::MIN_POSITIVE);
                    let all = matrices
                        .into_iter()
                        .flat_map(|matrix| matrix.entries().map(move |(i, k, v)| (i, k, v * share(matrix))));
                    SparseMatrix::from_triplets(n, all).is_ok_and(|sum| sparse_definite(&sum) == Some(true))
                }
            }
            Storage::Ring { sector, .. } => sector.every_wave(Structure::is_dissipative),
        })
    }
}

impl PartialEq for Structure {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
            || (self.0.places == other.0.places
                && match (&self.0.form, &other.0.form) {
                    (Storage::Full(a), Storage::Full(b)) => a == b,
                    (
                        Storage::Sparse { mass: a, damping: b, stiffness: c, modes, .. },
                        Storage::Sparse { mass: d, damping: e, stiffness: f, modes: others, .. },
                    ) => a == d && b == e && c == f && modes == others,
                    (Storage::Ring { sector: a, .. }, Storage::Ring { sector: b, .. })
                        if a.sectors() == b.sectors() =>
                    {
                        a.is_equal(b)
                    }
                    (Storage::Ring { .. }, _) => self.expanded() == other,
                    (_, Storage::Ring { .. }) => self == other.expanded(),
                    _ => false,
                })
    }
}

impl StructureError {
    /// Converts an error of matrix entries.
    fn of(matrix: &'static str, error: &MatrixError) -> Self {
        match *error {
            MatrixError::NotFinite { row, column, value } => {
                StructureError::NotFinite { matrix, row: row + 1, column: column + 1, value }
            }
            MatrixError::OutOfRange { row, column, n } => {
                StructureError::Size { matrix, rows: row + 1, columns: column + 1, places: n }
            }
            MatrixError::TooLarge { n, .. } => StructureError::Size { matrix, rows: n, columns: n, places: n },
        }
    }
}

impl Matrices {
    fn check(&self) -> Result<(), StructureError> {
        let n = self.mass.nrows();
        for (matrix, values) in [("mass", &self.mass), ("damping", &self.damping), ("stiffness", &self.stiffness)] {
            let symmetric = matrix != "damping";
            let rounding = SYMMETRIC * values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            for column in 0..n {
                for row in 0..n {
                    let (value, mirrored) = (values[(row, column)], values[(column, row)]);
                    if !value.is_finite() {
                        return Err(StructureError::NotFinite { matrix, row: row + 1, column: column + 1, value });
                    }
                    if symmetric && (value - mirrored).abs() > rounding {
                        let (row, column) = (row + 1, column + 1);
                        return Err(StructureError::NotSymmetric { matrix, row, column, value, mirrored });
                    }
                }
            }
        }
        // a diagonal matrix needs no factorization
        let off_diagonal = (0..n).any(|i| (0..i).any(|k| self.mass[(i, k)] != 0.0));
        let negative = (0..n).any(|i| self.mass[(i, i)] < 0.0);
        if (negative || off_diagonal) && !is_semidefinite(&self.mass) {
            return Err(StructureError::NegativeMass);
        }
        Ok(())
    }

    fn dissipates(&self) -> bool {
        // the gyroscopic part of the damping does no work
        let damping = (&self.damping + self.damping.transpose()) * 0.5;
        if ![&damping, &self.stiffness].into_iter().all(is_semidefinite) {
            return false;
        }
        let Some(rank) = semidefinite_rank(&self.mass) else { return false };
        let n = self.mass.nrows();
        rank == n || {
            // scaled by the largest entries, because the units differ
            let share = |matrix: &DMatrix<f64>| matrix / matrix.amax().max(f64::MIN_POSITIVE);
            semidefinite_rank(&(share(&self.mass) + share(&damping) + share(&self.stiffness))) == Some(n)
        }
    }
}

/// Returns whether matrices with these numbers of entries are stored full.
fn is_full(n: usize, entries: [usize; 3]) -> bool {
    let most = entries.into_iter().max().unwrap_or(0);
    // Fraction of nonzero entries above which matrices are stored full at any size.
    n < MIN_SPARSE_DOFS || most as f64 > 0.3 * (n as f64) * (n as f64)
}

/// Iterates over the nonzero entries of a full matrix, row by row.
fn nonzero_entries(matrix: &DMatrix<f64>) -> Box<dyn Iterator<Item = (usize, usize, f64)> + '_> {
    let n = matrix.ncols();
    let all = (0..matrix.nrows()).flat_map(move |row| (0..n).map(move |column| (row, column)));
    Box::new(all.map(|at| (at.0, at.1, matrix[at])).filter(|entry| entry.2 != 0.0))
}

fn to_full(matrix: &SparseMatrix) -> DMatrix<f64> {
    let mut full = DMatrix::zeros(matrix.n(), matrix.n());
    matrix.entries().for_each(|(row, column, value)| full[(row, column)] = value);
    full
}

fn all_full(mass: &SparseMatrix, damping: &SparseMatrix, stiffness: &SparseMatrix) -> Matrices {
    Matrices { mass: to_full(mass), damping: to_full(damping), stiffness: to_full(stiffness) }
}

/// Returns the mean of both triangles, if they differ only by rounding.
fn symmetric(name: &'static str, matrix: SparseMatrix) -> Result<SparseMatrix, StructureError> {
    if matrix.asymmetry(0.0).is_none() {
        return Ok(matrix);
    }
    if let Some(Asymmetry { row, column, value, mirrored }) = matrix.asymmetry(SYMMETRIC * matrix.max_abs()) {
        return Err(StructureError::NotSymmetric { matrix: name, row: row + 1, column: column + 1, value, mirrored });
    }
    let halves = matrix.entries().flat_map(|(i, k, value)| [(i, k, 0.5 * value), (k, i, 0.5 * value)]);
    // the sums of finite, nearly equal halves are finite, and the sparsity pattern is unchanged
    Ok(SparseMatrix::from_triplets(matrix.n(), halves).unwrap_or(matrix))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;
    use num_complex::Complex64;

    fn names() -> Vec<String> {
        vec!["a".into(), "b".into()]
    }

    #[test]
    fn wrong_matrices_are_refused_with_their_place() {
        let (one, k) = (DMatrix::identity(2, 2), dmatrix![2.0, -1.0; -1.0, 2.0]);
        let make = |m: &DMatrix<f64>, c: &DMatrix<f64>, k: &DMatrix<f64>| {
            Structure::new(names(), m.clone(), c.clone(), k.clone()).map(|_| ()).unwrap_err().to_string()
        };
        assert!(make(&DMatrix::zeros(2, 3), &one, &k).contains("2 x 3"));
        assert!(make(&one, &dmatrix![0.0, f64::NAN; 0.0, 0.0], &k).contains("row 1, column 2"));
        assert!(make(&one, &one, &dmatrix![2.0, -1.0; -0.9, 2.0]).contains("not symmetric"));
        assert!(make(&dmatrix![1.0, 2.0; 2.0, 1.0], &one, &k).contains("semidefinite"), "eigenvalues 3 and -1");
        let gyroscopic = dmatrix![0.0, 1.0; -1.0, 0.0];
        assert!(Structure::new(names(), one.clone(), gyroscopic, k.clone()).is_ok());
        let massless = dmatrix![1.0, 0.0; 0.0, 0.0];
        assert!(Structure::new(names(), massless, one.clone(), k.clone()).is_ok());
        let twice = vec!["a".to_owned(), "a".to_owned()];
        assert_eq!(Structure::new(twice, one.clone(), one, k).unwrap_err(), StructureError::DuplicateName("a".into()));
    }

    /// Full matrices of a chain between walls, with dampers to the ground, a gyroscopic pair
    /// and unequal masses.
    fn chain(n: usize) -> [DMatrix<f64>; 3] {
        let k = DMatrix::from_fn(n, n, |i, l| [2.0, -1.0, 0.0][i.abs_diff(l).min(2)]);
        let m = DMatrix::from_fn(n, n, |i, l| [1.0 + 0.1 * (i as f64).sin(), 0.2, 0.0][i.abs_diff(l).min(2)]);
        let mut c = DMatrix::identity(n, n) * 0.05;
        (c[(0, n - 1)], c[(n - 1, 0)]) = (0.3, -0.3);
        [m, c, k]
    }

    fn numbered(n: usize) -> Vec<String> {
        (0..n).map(|i| i.to_string()).collect()
    }

    /// A full and a sparse structure give the same results.
    #[test]
    fn full_and_sparse_agree() {
        let n = MIN_SPARSE_DOFS + 3;
        let [m, c, k] = chain(n);
        let sparse = Structure::new(numbered(n), m.clone(), c.clone(), k.clone()).unwrap();
        assert!(sparse.is_sparse());
        assert_eq!((sparse.mass(), sparse.damping(), sparse.stiffness()), (&m, &c, &k));
        let full =
            Structure::checked(numbered(n), Storage::Full(Arc::new(Matrices { mass: m, damping: c, stiffness: k })))
                .unwrap();
        assert_eq!(sparse.largest(), full.largest());
        assert_eq!((sparse.diagonal_mass(7), sparse.is_dissipative()), (full.diagonal_mass(7), full.is_dissipative()));
        assert!(sparse.is_dissipative());
        let sorted = |structure: &Structure| {
            let mut all: Vec<_> = structure.entries().collect();
            all.sort_by_key(|entry| (entry.0, entry.1));
            all
        };
        assert_eq!(sorted(&sparse), sorted(&full));
        for s in [Complex64::ZERO, Complex64::new(0.0, 0.7), Complex64::new(0.4, 0.0)] {
            let [mut a, mut b] = [(); 2].map(|()| vec![Complex64::new(1.0, -0.5); 2 * n]);
            sparse.dynamic_stiffness(s).unwrap().solve(&mut a);
            full.dynamic_stiffness(s).unwrap().solve(&mut b);
            let size = b.iter().fold(0.0f64, |size, b| size.max(b.norm()));
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).norm() < 1e-11 * size));
        }
        assert_eq!(sparse, sparse.clone());
        assert_ne!(sparse, full, "kept differently");
    }

    /// Large structures reject the same input as small ones, with the same messages.
    #[test]
    fn sparse_and_full_input_have_equal_checks() {
        let n = 2 * MIN_SPARSE_DOFS;
        let [m, c, k] = chain(n);
        type One<'a> = &'a mut DMatrix<f64>;
        let error = |change: &dyn Fn(One, One, One)| {
            let (mut m, mut c, mut k) = (m.clone(), c.clone(), k.clone());
            change(&mut m, &mut c, &mut k);
            Structure::new(numbered(n), m, c, k).unwrap_err().to_string()
        };
        assert!(error(&|_, c, _| c[(2, 5)] = f64::NAN).contains("damping matrix has NaN in row 3, column 6"));
        assert!(error(&|_, _, k| k[(2, 3)] = -0.9).contains("stiffness matrix is not symmetric"));
        assert!(error(&|m, _, _| m[(4, 4)] = 0.01).contains("semidefinite"), "coupled by 0.2");
        assert!(error(&|m, _, _| m[(4, 4)] = -1.0).contains("semidefinite"));
        // matrices from a file with ten digits: the mean of both triangles is used
        let mut rounded = k.clone();
        rounded[(2, 3)] += 1e-10;
        let structure = Structure::new(numbered(n), m.clone(), c.clone(), rounded.clone()).unwrap();
        let mean = 0.5 * (rounded[(2, 3)] + rounded[(3, 2)]);
        assert_eq!([(2, 3), (3, 2)].map(|at| structure.stiffness()[at]), [mean, mean]);
        // a semidefinite mass matrix
        let mut semi = m.clone();
        semi.fill_row(5, 0.0);
        semi.fill_column(5, 0.0);
        assert!(Structure::new(numbered(n), semi, c.clone(), k.clone()).is_ok());
        // a damper that supplies energy
        let mut driven = c;
        driven[(3, 3)] = -0.05;
        assert!(!Structure::new(numbered(n), m, driven, k).unwrap().is_dissipative());
    }

    /// A structure with 100,000 degrees of freedom is checked and solved in seconds.
    #[test]
    fn large_structures() {
        let n = 100_000;
        let triple = |own: f64, off_diagonal: f64| {
            let all = (0..n).flat_map(|i: usize| {
                let below = (i > 0).then(|| [(i, i - 1, off_diagonal), (i - 1, i, off_diagonal)]);
                below.into_iter().flatten().chain([(i, i, own)])
            });
            SparseMatrix::from_triplets(n, all).unwrap()
        };
        let structure = Structure::sparse(numbered(n), triple(1.0, 0.2), triple(0.02, 0.0), triple(2.0, -1.0)).unwrap();
        assert!(structure.is_dissipative());
        // a wave that fits between the walls: k = 2 - 2 cos θ, m = 1 + 0.4 cos θ, θ ≈ π/2;
        // whole turns are removed before they cause rounding
        let (half_waves, walls) = (50_000, n + 1);
        let angle = |number: usize| std::f64::consts::PI * (number % (2 * walls)) as f64 / walls as f64;
        let wave = angle(half_waves);
        let shape = |i: usize| angle(half_waves * (i + 1)).sin();
        let mut x: Vec<Complex64> = (0..n).map(|i| Complex64::new(shape(i), 0.0)).collect();
        let omega = 1.3;
        structure.dynamic_stiffness(Complex64::new(0.0, omega)).unwrap().solve(&mut x);
        let z = Complex64::new(2.0 - 2.0 * wave.cos() - omega * omega * (1.0 + 0.4 * wave.cos()), omega * 0.02);
        assert!((0..n).all(|i| (x[i] - shape(i) / z).norm() < 1e-10));
    }
}
