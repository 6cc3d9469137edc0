//! A structure given by its matrices, before it becomes a part of a model.
//!
//! The matrices come from finite-element programs. A component has named rows and gives its
//! full or reduced form for observed places.

use super::reduction::{
    AutomaticReduction, EXTENTS, FullStructure, MistunedModes, MistuningError, NominalRing, ReducedMatrices,
    ReducedSector, Reduction, ReductionDeviation, ReductionError, ReductionKind, ReferenceReceptance, RingModes, Row,
    RubinBasis, STEPS, SectorBasis, SectorReduction, StructureDamping,
};
use super::reduction_store::{KeptReductions, ReductionStore};
use super::sector_boundary::{Blade, BladeError, Boundary, CyclicSector, DIRECTIONS};
use super::{ModalDamping, StructureError, free_vibrations, symmetric};
use nalgebra::DMatrix;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use stickslip_numerics::definiteness::sparse_definite_with_order;
use stickslip_numerics::sparse::{ModeSelection, NaturalModes, SparseMatrix, multi_vector};

/// Matrices of a structure and the names of their rows.
///
/// A copy is a reference to the same matrices and to their stored reductions.
///
/// # Example
/// A rod of 400 masses that a model observes at its end.
/// ```
/// use std::f64::consts::TAU;
/// use stickslip::structure::{Component, Reduction};
/// use stickslip_numerics::sparse::SparseMatrix;
/// let n = 400;
/// let stiffness = (0..n).flat_map(|i| {
///     let linked = if i > 0 {
///         vec![(i - 1, i - 1, 1e6), (i - 1, i, -1e6), (i, i - 1, -1e6)]
///     } else {
///         vec![]
///     };
///     linked.into_iter().chain([(i, i, 1e6)])
/// });
/// let stiffness = SparseMatrix::from_triplets(n, stiffness)?;
/// let mass = SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 0.001)))?;
/// let rod = Component::new((1..=n).map(|i| format!("{i}.x")).collect(), mass, None, stiffness)?;
/// let end = vec![(rod.row("400.x").unwrap(), 1.0)];
/// let seen = rod.reduced(&[end], &Reduction::up_to(TAU * 100.0))?;
/// assert!(seen.dofs() < 12 && seen.error() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Component(Arc<ComponentData>);

struct ComponentData {
    rows: Vec<String>,
    index: OnceLock<HashMap<String, usize>>,
    /// The result of [`Component::rotation_radius`].
    rotation_radius: OnceLock<Option<f64>>,
    whole: FullStructure,
    /// True if the mass matrix is positive definite.
    definite_mass: bool,
    /// Reductions that are kept between runs.
    kept: OnceLock<KeptReductions>,
    /// Stored reductions by request, because the cases of a study repeat requests.
    reductions: Cache<ReductionRequest, ReducedResult>,
    /// Stored shapes of the coordinates of reductions.
    shapes: Cache<ReductionRequest, ShapesResult>,
    /// Stored modal damping, by ratio and largest frequency.
    damped: Cache<(f64, f64), Damped>,
    /// Stored numbers of modes below a frequency.
    counts: Cache<f64, Option<usize>>,
    /// The component as a sector of a ring, by boundary and number of sectors.
    sectors: Mutex<Vec<(Boundary, usize, Arc<SectorCache>)>>,
}

/// A component as a sector of a ring, with its stored results.
#[derive(Debug)]
pub(crate) struct SectorCache {
    pub sector: CyclicSector,
    kept: Option<KeptReductions>,
    reductions: Cache<ReductionRequest, ReducedResult>,
    sized: Cache<SizedRequest, ReducedResult>,
    blades: Cache<Vec<usize>, KeptBlade>,
}

/// The blade of a sector, with its stored results.
#[derive(Debug)]
pub(crate) struct BladeCache {
    blade: Blade,
    entries: OnceLock<Vec<(usize, usize, f64)>>,
    /// Stored reductions, by request and number of steps of blade vectors.
    reductions: Cache<(ReductionRequest, usize), ReducedRingResult>,
    /// Stored results, by request and deviations of all blades.
    mistuned: Cache<MistuningPattern, Arc<ReducedComponent>>,
}

type KeptBlade = Result<Arc<BladeCache>, BladeError>;
/// A request, and the deviations of all blades.
type MistuningPattern = (ReductionRequest, Vec<f64>);
type ReducedRingResult = Result<Arc<ReducedRing>, ReductionError>;

/// A reduced sector, the ring in its coordinates, and the estimate of its error.
#[derive(Debug)]
struct ReducedRing {
    component: Arc<ReducedComponent>,
    ring: NominalRing,
    lacking: MistuningError,
}

/// Requests with their results.
type Cache<K, V> = Mutex<Vec<(K, V)>>;
type ReductionRequest = (Vec<Row>, Reduction);
/// Observed rows, upper end of the frequency range (rad/s) and size of a basis.
type SizedRequest = (Vec<Row>, f64, SectorBasis);
type ReducedResult = Result<Arc<ReducedComponent>, ReductionError>;

/// Displacements of all rows in each coordinate of a reduction.
type ShapesResult = Result<Arc<DMatrix<f64>>, ReductionError>;
/// Factor of the stiffness, s, and the remaining modal damping.
type Damped = Result<(f64, ModalDamping), ReductionError>;

/// A reduced component, with its error relative to the full component.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ReducedComponent {
    form: ReducedForm,
    deviation: ReductionDeviation,
    /// Computed frequencies of the full component, rad/s.
    frequencies: Vec<f64>,
    /// Number of free motions among them.
    free: usize,
    /// Upper end of the frequency range in which the error holds, rad/s.
    up_to: f64,
    /// Highest frequency for which the basis is intended, rad/s.
    serves: f64,
    /// The size of the basis of a sector, if it follows from the required error.
    basis: Option<SectorBasis>,
}

/// A reduced component that also serves a second stiffness; see
/// [`Component::reduced_for_two_stiffnesses`].
#[derive(Debug, Clone)]
pub struct CommonBasisComponent {
    /// The reduced component with its own stiffness.
    pub component: Component,
    /// The second stiffness in the same coordinates, N/m.
    pub other_stiffness: SparseMatrix,
    /// The observed displacements, over the coordinates.
    pub seen: Vec<Row>,
    /// Description of the reduction.
    pub kind: String,
    /// Largest relative error of the observed displacements, for both stiffnesses and between
    /// them.
    pub error: f64,
    /// Upper end of the frequency range in which the error holds, rad/s.
    pub up_to: f64,
}

/// A reduced sector of a ring, again as a sector: its rows are its coordinates, followed by
/// those of the next sector.
#[derive(Debug, Clone)]
pub struct SectorComponent {
    /// The component, with rows named `number.q`.
    pub component: Component,
    /// Node numbers of its low and its high side.
    pub pairs: Vec<(String, String)>,
    /// The observed displacements, over its rows.
    pub seen: Vec<Row>,
    /// Description of the reduction.
    pub kind: String,
    /// Largest relative error of the observed displacements.
    pub error: f64,
    /// Upper end of the frequency range in which the error holds, rad/s.
    pub up_to: f64,
}

/// The reduced matrices.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) enum ReducedForm {
    /// A single component, without its basis.
    Alone(Arc<ReducedMatrices>),
    /// One sector of a ring.
    Sector(Arc<ReducedSector>),
    /// A ring with different blades.
    #[serde(skip)]
    Ring(Arc<RingModes>),
}

impl Component {
    /// Creates a component from row names and symmetric sparse matrices.
    ///
    /// The matrices are mass (kg), damping (kg/s), if any, and stiffness (N/m). The name of a
    /// row may be empty.
    ///
    /// # Errors
    /// [`StructureError`]: sizes that differ, an unsymmetric mass or stiffness matrix, a mass
    /// matrix that is not positive semidefinite.
    pub fn new(
        rows: Vec<String>,
        mass: SparseMatrix,
        damping: Option<SparseMatrix>,
        stiffness: SparseMatrix,
    ) -> Result<Self, StructureError> {
        let places = rows.len();
        for (matrix, size) in [("mass", mass.n()), ("stiffness", stiffness.n())]
            .into_iter()
            .chain(damping.as_ref().map(|damping| ("damping", damping.n())))
        {
            if size != places {
                return Err(StructureError::Size { matrix, rows: size, columns: size, places });
            }
        }
        let (mass, stiffness) = (symmetric("mass", mass)?, symmetric("stiffness", stiffness)?);
        let damping =
            damping.map_or(StructureDamping::Rayleigh { mass: 0.0, stiffness: 0.0 }, StructureDamping::Matrix);
        // sizes and symmetry are already checked
        let whole = FullStructure::without_ports(mass, damping, stiffness).map_err(|_| StructureError::NegativeMass)?;
        let definite = sparse_definite_with_order(&whole.mass, &whole.analysis);
        let definite_mass = definite.ok_or(StructureError::NegativeMass)?;
        let (index, reductions, shapes) = (OnceLock::new(), Mutex::default(), Mutex::default());
        let (damped, counts, sectors) = (Mutex::default(), Mutex::default(), Mutex::default());
        Ok(Component(Arc::new(ComponentData {
            rows,
            index,
            rotation_radius: OnceLock::new(),
            whole,
            definite_mass,
            kept: OnceLock::new(),
            reductions,
            shapes,
            damped,
            counts,
            sectors,
        })))
    }

    /// Keeps all further reductions in a store, and reads them from there, also those of this
    /// component as a sector with equal blades. A second call has no effect.
    ///
    /// # Example
    /// ```
    /// use std::collections::HashMap;
    /// use std::sync::{Arc, Mutex};
    /// use stickslip::structure::{Component, Reduction, ReductionStore};
    /// use stickslip_numerics::sparse::SparseMatrix;
    /// #[derive(Default)]
    /// struct Memory(Mutex<HashMap<String, Vec<u8>>>);
    /// impl ReductionStore for Memory {
    ///     fn load(&self, key: &str) -> Option<Vec<u8>> {
    ///         self.0.lock().unwrap().get(key).cloned()
    ///     }
    ///     fn save(&self, key: &str, bytes: &[u8]) {
    ///         self.0.lock().unwrap().insert(key.to_owned(), bytes.to_vec());
    ///     }
    /// }
    /// let store = Arc::new(Memory::default());
    /// let diagonal = |k: f64| SparseMatrix::from_triplets(2, [(0, 0, k), (1, 1, 9.0 * k)]);
    /// for stiffness in [1.0, 1.0, 2.0] {
    ///     let (mass, stiffness) = (diagonal(1.0)?, diagonal(stiffness)?);
    ///     let component = Component::new(vec![String::new(); 2], mass, None, stiffness)?;
    ///     component.keep_reductions(store.clone());
    ///     component.reduced(&[vec![(0, 1.0)]], &Reduction::up_to(0.5))?;
    /// }
    /// assert_eq!(store.0.lock().unwrap().len(), 2); // the second component equals the first
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn keep_reductions(&self, store: Arc<dyn ReductionStore>) {
        self.0.kept.get_or_init(|| KeptReductions::new(store, self.matrices()));
    }

    /// Keeps the reductions of this component where those of another one are kept.
    pub fn keep_reductions_like(&self, other: &Component) {
        if let Some(kept) = other.0.kept.get() {
            self.keep_reductions(kept.store());
        }
    }

    /// Returns the number of rows of the matrices.
    pub fn dofs(&self) -> usize {
        self.0.rows.len()
    }

    /// Returns the names of the rows; unnamed rows have an empty name.
    pub fn rows(&self) -> &[String] {
        &self.0.rows
    }

    /// Returns whether a row is a rotation: its name ends with `.rx`, `.ry` or `.rz`.
    pub(crate) fn is_rotation(&self, row: usize) -> bool {
        let [_, rotations] = &DIRECTIONS;
        self.0.rows[row].rsplit_once('.').is_some_and(|(_, along)| rotations.contains(&along))
    }

    /// Returns the radius (m) at which a rotation of the structure counts as a displacement, from
    /// the stiffnesses of rotations and displacements; `None` if it has only one of both.
    pub(crate) fn rotation_radius(&self) -> Option<f64> {
        *self.0.rotation_radius.get_or_init(|| {
            if !(0..self.rows().len()).any(|row| self.is_rotation(row)) {
                return None;
            }
            let largest = |rotations: bool| {
                let rows = (0..self.rows().len()).filter(|row| self.is_rotation(*row) == rotations);
                rows.map(|row| self.0.whole.stiffness.get(row, row)).fold(0.0, f64::max)
            };
            let radius = (largest(true) / largest(false)).sqrt();
            (radius.is_finite() && radius > 0.0).then_some(radius)
        })
    }

    /// Returns the row with a name.
    pub fn row(&self, name: &str) -> Option<usize> {
        let index = self.0.index.get_or_init(|| {
            let named = self.0.rows.iter().enumerate().filter(|(_, name)| !name.is_empty());
            named.map(|(row, name)| (name.clone(), row)).collect()
        });
        index.get(name).copied()
    }

    /// Returns mass (kg), damping (kg/s), if any, and stiffness (N/m).
    pub fn matrices(&self) -> (&SparseMatrix, Option<&SparseMatrix>, &SparseMatrix) {
        let FullStructure { mass, damping, stiffness, .. } = &self.0.whole;
        let own = match damping {
            StructureDamping::Matrix(own) => Some(own),
            _ => None,
        };
        (mass, own, stiffness)
    }

    /// Returns whether the mass matrix is positive definite. Time integration requires this.
    pub fn has_definite_mass(&self) -> bool {
        self.0.definite_mass
    }

    /// Returns the lowest natural frequencies, rad/s, in ascending order. Free motions have a
    /// frequency of zero up to rounding.
    ///
    /// # Errors
    /// [`ReductionError::Modes`].
    pub fn frequencies(&self, count: usize) -> Result<Vec<f64>, ReductionError> {
        let FullStructure { mass, stiffness, analysis, .. } = &self.0.whole;
        let modes = NaturalModes::new(analysis, stiffness, mass, ModeSelection::Lowest(count))?;
        Ok(natural(&modes))
    }

    /// Returns the lowest frequencies of free vibration, rad/s, in ascending order, for damping
    /// with a gyroscopic part.
    ///
    /// Returns `None` if the damping is symmetric. The computation uses four times `count`
    /// modes without damping.
    ///
    /// # Errors
    /// [`ReductionError::Modes`].
    ///
    /// # Example
    /// A shaft in two directions: `ω = g/2 ± sqrt(g²/4 + ω₀²)`.
    /// ```
    /// use stickslip::structure::Component;
    /// use stickslip_numerics::sparse::SparseMatrix;
    /// let diagonal = |value: f64| SparseMatrix::from_triplets(2, [(0, 0, value), (1, 1, value)]);
    /// let turning = SparseMatrix::from_triplets(2, [(0, 1, 6.0), (1, 0, -6.0)])?;
    /// let shaft =
    ///     Component::new(vec![String::new(); 2], diagonal(1.0)?, Some(turning), diagonal(16.0)?)?;
    /// let found = shaft.free_vibration(2)?.unwrap();
    /// assert!((found[0] - 2.0).abs() < 1e-12 && (found[1] - 8.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn free_vibration(&self, count: usize) -> Result<Option<Vec<f64>>, ReductionError> {
        let FullStructure { mass, stiffness, analysis, .. } = &self.0.whole;
        let Some(damping) = self.matrices().1.filter(|damping| damping.asymmetry(0.0).is_some()) else {
            return Ok(None);
        };
        let modes = NaturalModes::new(analysis, stiffness, mass, ModeSelection::Lowest(count.saturating_mul(4)))?;
        let products =
            multi_vector::inner_products(self.dofs(), &modes.shapes, &damping.multiply_columns(&modes.shapes));
        let found = free_vibrations(&modes.values, &products);
        Ok(found.map(|found| found.iter().take(count).map(|one| one.omega).collect()))
    }

    /// Returns the number of natural modes below `omega` (rad/s), from the inertia of one
    /// factorization.
    ///
    /// The result is stored for repeated calls. Returns `None` if the matrix is singular up to
    /// rounding.
    ///
    /// # Example
    /// ```
    /// use stickslip::structure::Component;
    /// use stickslip_numerics::sparse::SparseMatrix;
    /// let diagonal = |values: [f64; 3]| {
    ///     SparseMatrix::from_triplets(3, values.into_iter().enumerate().map(|(i, v)| (i, i, v)))
    /// };
    /// let three = Component::new(
    ///     vec![String::new(); 3],
    ///     diagonal([1.0; 3])?,
    ///     None,
    ///     diagonal([1.0, 4.0, 9.0])?,
    /// )?;
    /// assert_eq!(three.modes_below(2.5), Some(2));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn modes_below(&self, omega: f64) -> Option<usize> {
        let FullStructure { mass, stiffness, analysis, .. } = &self.0.whole;
        cached(&self.0.counts, &omega, || {
            analysis.factor(&[(1.0, stiffness), (-omega * omega, mass)]).ok().map(|factor| factor.negative_pivots())
        })
    }

    /// Returns the reduced component, observed at these weighted sums of its rows. The result
    /// is stored for repeated calls.
    ///
    /// # Errors
    /// [`ReductionError`]: no place, a failure of the mode computation, or no reduction within
    /// the tolerance.
    pub fn reduced(&self, seen: &[Row], how: &Reduction) -> ReducedResult {
        cached(&self.0.reductions, &(seen.to_vec(), *how), || {
            load_or_compute(self.0.kept.get(), &(seen, how), || {
                self.0.whole.with_ports(seen.to_vec()).and_then(|whole| reduce(&whole, how)).map(Arc::new)
            })
        })
    }

    /// Returns the displacements of all rows in each coordinate of [`Component::reduced`], rows
    /// by coordinates. The reduction is computed again, because it does not keep its basis; the
    /// result is stored for repeated calls.
    ///
    /// # Errors
    /// See [`Component::reduced`].
    pub fn shapes(&self, seen: &[Row], how: &Reduction) -> ShapesResult {
        cached(&self.0.shapes, &(seen.to_vec(), *how), || {
            load_or_compute(self.0.kept.get(), &("shapes", seen, how), || {
                let whole = self.0.whole.with_ports(seen.to_vec())?;
                Ok(Arc::new(reduce_whole(&whole, how)?.reduced.scaled_to_metres().columns()))
            })
        })
    }

    /// Returns a reduced component whose basis also serves a second stiffness `K₁`, such as
    /// that at a speed of rotation.
    ///
    /// It serves all stiffnesses `K + s (K₁ - K)` with s from 0 to 1, observed at these
    /// weighted sums of its rows.
    ///
    /// # Errors
    /// [`ReductionError`]: sizes that differ, no place, a failure of the mode computation, or
    /// no reduction within the tolerance.
    ///
    /// # Example
    /// A mass on a rod of springs, which tension stiffens.
    /// ```
    /// use stickslip::structure::{Component, Reduction, ReductionKind};
    /// use stickslip_numerics::sparse::SparseMatrix;
    /// let rod = |k: f64| {
    ///     SparseMatrix::from_triplets(
    ///         3,
    ///         [
    ///             (0, 0, 2.0 * k),
    ///             (0, 1, -k),
    ///             (1, 0, -k),
    ///             (1, 1, 2.0 * k),
    ///             (1, 2, -k),
    ///             (2, 1, -k),
    ///             (2, 2, k),
    ///         ],
    ///     )
    /// };
    /// let mass = SparseMatrix::from_triplets(3, (0..3).map(|i| (i, i, 1.0)))?;
    /// let rest = Component::new(vec![String::new(); 3], mass, None, rod(1e4)?)?;
    /// let how = Reduction::Modes { modes: 1, kind: ReductionKind::Rubin, orders: 1, up_to: 0.0 };
    /// let few = rest.reduced_for_two_stiffnesses(&rod(1.5e4)?, &[vec![(2, 1.0)]], &how)?;
    /// assert_eq!(few.component.dofs(), few.other_stiffness.n());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn reduced_for_two_stiffnesses(
        &self,
        there: &SparseMatrix,
        seen: &[Row],
        how: &Reduction,
    ) -> Result<CommonBasisComponent, ReductionError> {
        let tolerance = match *how {
            Reduction::UpTo { tolerance, .. } => tolerance,
            _ => f64::INFINITY,
        };
        let reduce = |whole: &FullStructure| reduce_whole(whole, how).map(|few| (few.reduced, few.up_to));
        let few = self.0.whole.with_ports(seen.to_vec())?.between(there, reduce, tolerance)?;
        let ReducedMatrices { mass, damping, stiffness, ports, kind, .. } = few.own;
        let damping = if self.matrices().1.is_some() { Some(sparse(&damping)?) } else { None };
        let component = Component::new(vec![String::new(); mass.nrows()], sparse(&mass)?, damping, sparse(&stiffness)?);
        let seen = ports.row_iter().map(|row| row.iter().copied().enumerate().filter(|part| part.1 != 0.0).collect());
        Ok(CommonBasisComponent {
            component: component.map_err(|_| ReductionError::OutOfRange)?,
            other_stiffness: sparse(&few.other.stiffness)?,
            seen: seen.collect(),
            kind,
            error: few.deviation.error,
            up_to: few.up_to,
        })
    }

    /// Reduces the component as one of `sectors` sectors of a ring. The result is again a
    /// sector of such a ring.
    ///
    /// It is `Tᵀ M T` over its own coordinates and those of the next sector, which its high
    /// side follows. The matrices stay positive semidefinite, and they describe the ring of the
    /// reduced sectors.
    ///
    /// # Errors
    /// See [`Component::reduced`].
    pub fn reduced_sector(
        &self,
        boundary: &Boundary,
        sectors: usize,
        seen: &[Row],
        how: &Reduction,
    ) -> Result<SectorComponent, ReductionError> {
        let kept = self.sector(boundary, sectors);
        let few = kept.reduced(seen, how)?;
        let ReducedForm::Sector(reduced) = few.form() else { return Err(ReductionError::NoPorts) };
        let r = reduced.dofs();
        let columns = kept.sector.whole_columns(&reduced.basis);
        let (mass, damping, stiffness) = self.matrices();
        let project = |matrix: &SparseMatrix| {
            multi_vector::inner_products(self.dofs(), &columns, &matrix.multiply_columns(&columns))
        };
        // symmetric up to rounding
        let symmetric = |matrix: &SparseMatrix| {
            let product = project(matrix);
            sparse(&((&product + product.transpose()) * 0.5))
        };
        let damping = damping.map(|damping| sparse(&project(damping))).transpose()?;
        let rows = (1..=2 * r).map(|number| format!("{number}.q")).collect();
        let component = Component::new(rows, symmetric(mass)?, damping, symmetric(stiffness)?);
        let mut places = vec![Row::new(); seen.len()];
        for &(port, at, shift, weight) in &reduced.ports {
            places[port].push((at + if shift == 0 { 0 } else { r }, weight));
        }
        Ok(SectorComponent {
            component: component.map_err(|_| ReductionError::OutOfRange)?,
            pairs: (1..=r).map(|low| (low.to_string(), (low + r).to_string())).collect(),
            seen: places,
            kind: few.kind().to_owned(),
            error: few.error(),
            up_to: few.up_to(),
        })
    }

    /// Returns the number of stored reductions, modal dampings and mistuned disks, which grows
    /// with every different request. A request in progress is not counted.
    pub fn stored_reductions(&self) -> usize {
        let sector = |(.., sector): &(Boundary, usize, Arc<SectorCache>)| sector.stored_reductions();
        let sectors = self.0.sectors.try_lock().map_or(0, |known| known.iter().map(sector).sum());
        sectors + stored(&self.0.reductions) + stored(&self.0.shapes) + stored(&self.0.damped)
    }

    /// Returns damping with one ratio for all modes up to a frequency (rad/s), and proportional
    /// to the stiffness above. The result is stored.
    pub(crate) fn modal_damping(&self, ratio: f64, up_to: f64) -> Damped {
        cached(&self.0.damped, &(ratio, up_to), || {
            let (beta, columns) = self.0.whole.modal_damping(ratio, up_to)?;
            Ok((beta, ModalDamping::new(self.dofs(), Arc::new(columns))))
        })
    }

    /// Returns the component as one of `sectors` sectors of a ring.
    pub(crate) fn sector(&self, boundary: &Boundary, sectors: usize) -> Arc<SectorCache> {
        let mut known = self.0.sectors.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., kept)) = known.iter().find(|(own, count, _)| own == boundary && *count == sectors) {
            return kept.clone();
        }
        let sector = CyclicSector::new(self.matrices(), boundary, sectors);
        let kept = Arc::new(SectorCache {
            sector,
            kept: self.0.kept.get().map(|kept| kept.with_input(&(boundary, sectors))),
            reductions: Mutex::default(),
            sized: Mutex::default(),
            blades: Mutex::default(),
        });
        known.push((boundary.clone(), sectors, kept.clone()));
        kept
    }
}

/// Converts a small dense matrix to a sparse one.
fn sparse(dense: &DMatrix<f64>) -> Result<SparseMatrix, ReductionError> {
    let all = (0..dense.ncols()).flat_map(|k| (0..dense.nrows()).map(move |i| (i, k)));
    let entries = all.map(|at| (at.0, at.1, dense[at])).filter(|entry| entry.2 != 0.0);
    SparseMatrix::from_triplets(dense.nrows(), entries).map_err(|_| ReductionError::OutOfRange)
}

/// Returns a stored result, or computes it once. Concurrent identical requests wait for the
/// first one.
fn cached<K: PartialEq + Clone, V: Clone>(known: &Cache<K, V>, asked: &K, compute: impl FnOnce() -> V) -> V {
    let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, answer)) = known.iter().find(|(key, _)| key == asked) {
        return answer.clone();
    }
    let answer = compute();
    known.push((asked.clone(), answer.clone()));
    answer
}

/// Returns the result of a request from the store, if there is one, or computes it.
fn load_or_compute<T: Serialize + DeserializeOwned>(
    kept: Option<&KeptReductions>,
    request: &impl std::fmt::Debug,
    compute: impl FnOnce() -> Result<Arc<T>, ReductionError>,
) -> Result<Arc<T>, ReductionError> {
    match kept {
        Some(kept) => kept.with_input(request).load_or_compute(compute),
        None => compute(),
    }
}

/// Returns the number of stored results; zero while one is computed.
fn stored<K, V>(known: &Cache<K, V>) -> usize {
    known.try_lock().map_or(0, |known| known.len())
}

impl SectorCache {
    fn stored_reductions(&self) -> usize {
        let blade = |(_, blade): &(Vec<usize>, KeptBlade)| {
            blade.as_ref().map_or(0, |blade| stored(&blade.reductions) + stored(&blade.mistuned))
        };
        let blades = self.blades.try_lock().map_or(0, |known| known.iter().map(blade).sum());
        blades + stored(&self.reductions) + stored(&self.sized)
    }

    /// Returns the reduced sector.
    pub fn reduced(&self, seen: &[Row], how: &Reduction) -> ReducedResult {
        cached(&self.reductions, &(seen.to_vec(), *how), || {
            load_or_compute(self.kept.as_ref(), &(seen, how), || self.chosen(seen, how, None))
        })
    }

    /// Returns the sector reduced by a basis of this size with modes up to a higher frequency,
    /// rad/s, see [`CyclicSector::reduced_by_size`].
    pub fn reduced_by_size(&self, seen: &[Row], up_to: f64, basis: SectorBasis) -> ReducedResult {
        cached(&self.sized, &(seen.to_vec(), up_to, basis), || {
            load_or_compute(self.kept.as_ref(), &(seen, up_to, basis), || {
                Ok(ReducedComponent::of_sector(self.sector.reduced_by_size(seen, up_to, basis, None)?))
            })
        })
    }

    fn chosen(&self, seen: &[Row], how: &Reduction, blade: Option<(&Blade, usize)>) -> ReducedResult {
        Ok(ReducedComponent::of_sector(self.sector.reduced(seen, how, blade)?))
    }

    /// Returns the blade that consists of the rows `blade` of the component.
    pub fn blade(&self, component: &Component, blade: &[usize]) -> KeptBlade {
        cached(&self.blades, &blade.to_vec(), || {
            let blade = self.sector.blade(component.rows(), component.matrices().2, blade)?;
            let (reductions, mistuned) = (Mutex::default(), Mutex::default());
            Ok(Arc::new(BladeCache { blade, entries: OnceLock::new(), reductions, mistuned }))
        })
    }

    /// Returns the mistuned ring in its own modes, for these relative deviations of blade
    /// stiffness.
    ///
    /// The sector basis receives as many blade vectors as the error requires, or the number
    /// with the smallest error.
    pub fn mistuned(&self, blade: &BladeCache, deviations: &[f64], seen: &[Row], how: &Reduction) -> ReducedResult {
        let asked = ((seen.to_vec(), *how), deviations.to_vec());
        let known = blade.mistuned.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, answer)) = known.iter().find(|(key, _)| *key == asked) {
            return Ok(answer.clone());
        }
        // other patterns need not wait
        drop(known);
        let answer = self.best_mistuned(blade, (deviations, seen), how, false)?;
        let mut known = blade.mistuned.lock().unwrap_or_else(PoisonError::into_inner);
        // Number of mistuning patterns whose modes are stored. A case is assembled several times
        // in succession, and a campaign has a million patterns. The modes of 240 blades with
        // five places each use 40 MB.
        if known.len() >= 16 {
            known.remove(0);
        }
        known.push((asked, answer.clone()));
        Ok(answer)
    }

    /// Returns the mistuned ring in a sector basis of a known size, with the modes of a range up to
    /// `up_to`, rad/s. Its error is not computed.
    pub fn mistuned_by_size(
        &self,
        blade: &BladeCache,
        (deviations, seen): (&[f64], &[Row]),
        (up_to, basis): (f64, SectorBasis),
    ) -> ReducedResult {
        let sized = self.sector.reduced_by_size(seen, up_to, basis, Some(&blade.blade))?;
        let component = ReducedComponent::of_sector(sized);
        let ring = self.nominal_ring(&component, blade)?;
        let (modes, _) = ring.modes(&ring.mistuned_modes(deviations, EXTENTS[0])?, false)?;
        Ok(Arc::new(ReducedComponent {
            form: ReducedForm::Ring(Arc::new(modes)),
            ..ReducedComponent::clone(&component)
        }))
    }

    /// Returns the mistuned ring as [`SectorCache::mistuned`] does, with the shapes of its modes.
    pub fn mistuned_with_shapes(
        &self,
        blade: &BladeCache,
        deviations: &[f64],
        seen: &[Row],
        how: &Reduction,
    ) -> ReducedResult {
        self.best_mistuned(blade, (deviations, seen), how, true)
    }

    fn best_mistuned(
        &self,
        blade: &BladeCache,
        (deviations, seen): (&[f64], &[Row]),
        how: &Reduction,
        with_shapes: bool,
    ) -> ReducedResult {
        // the number of modes is fixed, without blade vectors
        let (steps, enough) = match *how {
            Reduction::UpTo { tolerance, .. } => (1..STEPS.len(), tolerance),
            _ => (0..1, f64::INFINITY),
        };
        let mut best: Option<(Arc<ReducedRing>, MistunedModes, ReductionDeviation)> = None;
        let mut reached = None;
        for step in steps {
            // the step before has already gone to this basis, or beyond it
            if reached.is_some_and(|position| STEPS[step] <= position) {
                continue;
            }
            // a later failure keeps the earlier result
            let few = match (self.reduced_ring(blade, seen, how, step), &best) {
                (Ok(few), _) => few,
                (Err(_), Some(_)) => continue,
                (Err(error), None) => return Err(error),
            };
            reached = few.component.basis.and_then(|basis| basis.position());
            let mixed = few.ring.mistuned_modes(deviations, EXTENTS[0])?;
            let (own, found) =
                (few.component.deviation, few.lacking.deviation(&mixed.values, &mixed.shapes, deviations));
            let deviation = if found.error > own.error { found } else { own };
            if best.as_ref().is_none_or(|(.., best)| deviation.error < best.error) {
                best = Some((few, mixed, deviation));
            }
            if deviation.error <= enough {
                break;
            }
        }
        let (few, mixed, deviation) = best.ok_or(ReductionError::NoPorts)?;
        let (mut modes, mut left_out) = few.ring.modes(&mixed, with_shapes)?;
        for extent in EXTENTS.into_iter().skip(1).filter(|_| enough.is_finite()) {
            if left_out.error > enough {
                (modes, left_out) = few.ring.modes(&few.ring.mistuned_modes(deviations, extent)?, with_shapes)?;
            }
        }
        let deviation = if left_out.error > deviation.error { left_out } else { deviation };
        let form = ReducedForm::Ring(Arc::new(modes));
        Ok(Arc::new(ReducedComponent { form, deviation, ..ReducedComponent::clone(&few.component) }))
    }

    /// Reduces the sector with the blade vectors of this step; step 0 has none.
    fn reduced_ring(&self, blade: &BladeCache, seen: &[Row], how: &Reduction, step: usize) -> ReducedRingResult {
        cached(&blade.reductions, &((seen.to_vec(), *how), step), || {
            let component = match step {
                0 => self.reduced(seen, how)?,
                _ => self.chosen(seen, how, Some((&blade.blade, step)))?,
            };
            let ReducedForm::Sector(sector) = &component.form else { return Err(ReductionError::NoPorts) };
            let lacking = MistuningError::new((&self.sector, seen), &blade.blade, sector, component.up_to)?;
            let ring = self.nominal_ring(&component, blade)?;
            Ok(Arc::new(ReducedRing { component, ring, lacking }))
        })
    }

    /// Returns the tuned ring of a reduced sector, with the stiffness of its blades.
    fn nominal_ring(&self, component: &ReducedComponent, blade: &BladeCache) -> Result<NominalRing, ReductionError> {
        let ReducedForm::Sector(sector) = &component.form else { return Err(ReductionError::NoPorts) };
        let of_blade = blade.blade.projected(sector.n, &sector.basis);
        NominalRing::new(sector, of_blade, self.sector.sectors, component.up_to)
    }
}

impl BladeCache {
    /// Returns the stiffness entries for a relative deviation of one, over all remaining rows.
    pub fn entries(&self) -> &[(usize, usize, f64)] {
        self.entries.get_or_init(|| self.blade.entries())
    }
}

impl std::fmt::Debug for Component {
    /// Writes the size, not the matrices.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (mass, _, stiffness) = self.matrices();
        write!(f, "Component of {} rows, {} and {} entries", self.dofs(), stiffness.len(), mass.len())
    }
}

impl PartialEq for Component {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || (self.0.rows == other.0.rows && self.matrices() == other.matrices())
    }
}

/// Returns natural frequencies, rad/s. Negative eigenvalues due to rounding give zero.
fn natural(modes: &NaturalModes) -> Vec<f64> {
    modes.values.iter().map(|value| value.max(0.0).sqrt()).collect()
}

fn reduce(whole: &FullStructure, how: &Reduction) -> Result<ReducedComponent, ReductionError> {
    let ReductionResult { reduced, deviation, modes, up_to, serves } = reduce_whole(whole, how)?;
    let (frequencies, free) = (natural(&modes), modes.rigid_body_count());
    let form = ReducedForm::Alone(Arc::new(reduced.scaled_to_metres().without_basis()));
    Ok(ReducedComponent { form, deviation, frequencies, free, up_to, serves, basis: None })
}

/// A reduced form of the whole component.
struct ReductionResult {
    reduced: ReducedMatrices,
    deviation: ReductionDeviation,
    /// The modes that it uses.
    modes: NaturalModes,
    /// Upper end of the frequency range in which the error holds, rad/s.
    up_to: f64,
    /// Highest frequency for which the basis is intended, rad/s.
    serves: f64,
}

fn reduce_whole(whole: &FullStructure, how: &Reduction) -> Result<ReductionResult, ReductionError> {
    Ok(match *how {
        Reduction::None { .. } => return Err(ReductionError::NoPorts),
        Reduction::UpTo { up_to, tolerance, kind } => {
            let chosen = AutomaticReduction { up_to, tolerance, kind }.apply(whole)?;
            let (reduced, deviation, modes) = (chosen.reduced, chosen.deviation, chosen.modes);
            ReductionResult { reduced, deviation, modes, up_to, serves: up_to }
        }
        Reduction::Modes { modes: count, kind, orders, up_to } => {
            let modes = whole.lowest_modes(count)?;
            // Ratio of the highest retained frequency to the highest frequency of interest. The
            // last modes only improve those below.
            let serves = natural(&modes).last().map_or(0.0, |last| last / 1.5);
            let up_to = if up_to > 0.0 { up_to } else { serves };
            let reduced = match kind {
                ReductionKind::Rubin => RubinBasis::new(whole, &modes, 0.0, orders)?.reduced(modes.count(), orders)?,
                ReductionKind::CraigBampton => whole.fixed_interface(ModeSelection::Lowest(count))?,
            };
            let deviation = ReferenceReceptance::new(whole, &modes, up_to)?.deviation(&reduced);
            ReductionResult { reduced, deviation, modes, up_to, serves }
        }
    })
}

impl ReducedComponent {
    fn of_sector(chosen: SectorReduction) -> Arc<Self> {
        let SectorReduction { reduced, deviation, frequencies, free, up_to, serves, basis } = chosen;
        let form = ReducedForm::Sector(Arc::new(reduced));
        Arc::new(ReducedComponent { form, deviation, frequencies, free, up_to, serves, basis })
    }

    /// Returns the size of the basis of a sector, if it follows from the required error.
    pub(crate) fn sector_basis(&self) -> Option<SectorBasis> {
        self.basis
    }

    /// Returns the number of coordinates. For a sector of a ring with equal blades, it is that
    /// of one sector.
    pub fn dofs(&self) -> usize {
        match &self.form {
            ReducedForm::Alone(reduced) => reduced.dofs(),
            ReducedForm::Sector(sector) => sector.dofs(),
            ReducedForm::Ring(modes) => modes.own.len(),
        }
    }

    /// Returns a description of the reduction.
    pub fn kind(&self) -> &str {
        match &self.form {
            ReducedForm::Alone(reduced) => &reduced.kind,
            ReducedForm::Sector(sector) => &sector.kind,
            ReducedForm::Ring(modes) => &modes.kind,
        }
    }

    /// Returns the largest relative error of the observed displacements, up to
    /// [`ReducedComponent::up_to`].
    pub fn error(&self) -> f64 {
        self.deviation.error
    }

    /// Returns the frequency of the largest error, rad/s.
    pub fn worst_at(&self) -> f64 {
        self.deviation.omega
    }

    /// Returns the upper end of the frequency range in which the error holds, rad/s.
    pub fn up_to(&self) -> f64 {
        self.up_to
    }

    /// Returns the highest frequency for which the basis is intended, rad/s. A damping ratio
    /// applies to all modes up to this frequency.
    pub fn intended_up_to(&self) -> f64 {
        self.serves
    }

    /// Returns the computed frequencies of the full component, rad/s, in ascending order.
    pub fn frequencies(&self) -> &[f64] {
        &self.frequencies
    }

    /// Returns the number of free motions among its modes.
    pub fn free_modes(&self) -> usize {
        self.free
    }

    /// Returns the reduced matrices.
    pub(crate) fn form(&self) -> &ReducedForm {
        &self.form
    }
}

impl std::fmt::Display for ReducedComponent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} coordinates ({}), error {:.1e} up to {:.6} Hz",
            self.dofs(),
            self.kind(),
            self.error(),
            self.up_to / TAU
        )
    }
}
