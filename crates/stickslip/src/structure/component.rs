//! A structure by its matrices, as finite-element programs write them, before it becomes a part of a model: what its rows are called, and what
//! a model sees of it, in few coordinates or in all.

use super::cyclic::{BladeError, Boundary, CyclicSector};
use super::reduction::{
    Damping, Deviation, Free, Reduce, Reduced, ReducedSector, ReductionError, Reference, Row, Whole,
};
use super::{StructureError, symmetric};
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use stickslip_numerics::definite::sparse_definite;
use stickslip_numerics::sparse::{Matrix, NaturalModes, Wanted};

/// Matrices of a structure and the names of their rows. A copy is a reference to the same matrices, and to the reductions made of them.
///
/// # Example
/// A rod of 400 masses that a model will see at its end.
/// ```
/// use std::f64::consts::TAU;
/// use stickslip::structure::{Component, Reduction};
/// use stickslip_numerics::sparse::Matrix;
/// let n = 400;
/// let stiffness = (0..n).flat_map(|i| {
///     let linked = if i > 0 { vec![(i - 1, i - 1, 1e6), (i - 1, i, -1e6), (i, i - 1, -1e6)] } else { vec![] };
///     linked.into_iter().chain([(i, i, 1e6)])
/// });
/// let stiffness = Matrix::from_triplets(n, stiffness)?;
/// let mass = Matrix::from_triplets(n, (0..n).map(|i| (i, i, 0.001)))?;
/// let rod = Component::new((1..=n).map(|i| format!("{i}.x")).collect(), mass, None, stiffness)?;
/// let end = vec![(rod.row("400.x").unwrap(), 1.0)];
/// let seen = rod.reduced(&[end], &Reduction::up_to(TAU * 100.0))?;
/// assert!(seen.dofs() < 12 && seen.error() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Component(Arc<Kept>);

struct Kept {
    rows: Vec<String>,
    index: OnceLock<HashMap<String, usize>>,
    whole: Whole,
    /// What was asked for, and what came of it: cases of a study ask the same.
    reductions: Mutex<Vec<(Asked, Answer)>>,
    /// As one of so many sectors of a ring.
    sectors: Mutex<Vec<(Boundary, usize, Arc<KeptSector>)>>,
}

/// A component as a sector of a ring, and what was asked of it.
#[derive(Debug)]
pub(crate) struct KeptSector {
    pub sector: CyclicSector,
    reductions: Mutex<Vec<(Asked, Answer)>>,
    blades: Mutex<Vec<(OfBlade, Relieved)>>,
}

/// Rows of a blade, and the reduction in whose coordinates it is asked for.
type OfBlade = (Vec<usize>, Option<Asked>);

/// What a share of one of the blade's stiffness adds, over the coordinates of a sector.
type Relieved = Result<Arc<Vec<(usize, usize, f64)>>, BladeError>;

type Asked = (Vec<Row>, Reduction);
type Answer = Result<Arc<ReducedComponent>, ReductionError>;

/// How a component is brought into few coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reduction {
    /// Not at all: all its rows are degrees of freedom, and its dynamic stiffness is factored at every frequency.
    None,
    /// With as many modes as the error asks for.
    UpTo {
        /// The largest frequency of interest, rad/s: of the drive with all harmonics that count.
        up_to: f64,
        /// The largest relative error of what the model sees up to there.
        tolerance: f64,
        /// Of one kind only, if it is named.
        kind: Option<ReductionKind>,
    },
    /// With so many modes.
    Modes {
        /// How many.
        modes: usize,
        /// Of which kind.
        kind: ReductionKind,
    },
}

/// Kinds of reduction, see [`reduction`](super::reduction).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReductionKind {
    /// Free modes, and what the others add at the places.
    Rubin,
    /// Modes with the places held, and static answers to unit motions of them.
    CraigBampton,
}

impl Reduction {
    /// The relative error of what is seen that is small beside that of any law of friction.
    pub const TOLERANCE: f64 = 1e-4;

    /// As many modes as that error asks for, of whatever kind, up to a frequency in rad/s.
    pub fn up_to(up_to: f64) -> Self {
        Reduction::UpTo { up_to, tolerance: Self::TOLERANCE, kind: None }
    }
}

/// A component in few coordinates, and how far it is from the whole.
#[derive(Debug, Clone)]
pub struct ReducedComponent {
    form: Form,
    deviation: Deviation,
    /// Frequencies of the whole, rad/s, as far as they were computed.
    frequencies: Vec<f64>,
    /// Of which so many are free motions.
    free: usize,
    /// The error holds up to there, rad/s.
    up_to: f64,
}

/// Small matrices.
#[derive(Debug, Clone)]
pub(crate) enum Form {
    /// Of a component; without its basis.
    Alone(Reduced),
    /// Of one sector of a ring.
    Sector(ReducedSector),
}

/// A mode that is kept, in multiples of the frequency up to which it serves: the last ones only complete those below.
const BEYOND: f64 = 1.5;

impl Component {
    /// Of named rows (empty where a row has no name) and symmetric sparse matrices of mass (kg), damping (kg/s) if there is one, and
    /// stiffness (N/m).
    ///
    /// # Errors
    /// [`StructureError`]: sizes that differ, mass or stiffness that is not symmetric, a mass matrix that is not positive semidefinite.
    pub fn new(
        rows: Vec<String>,
        mass: Matrix,
        damping: Option<Matrix>,
        stiffness: Matrix,
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
        let negative = mass.entries().any(|(row, column, value)| row == column && value < 0.0);
        if negative || sparse_definite(&mass).is_none() {
            return Err(StructureError::NegativeMass);
        }
        let damping = damping.map_or(Damping::Rayleigh { mass: 0.0, stiffness: 0.0 }, Damping::Matrix);
        // sizes and symmetry were looked at
        let whole = Whole::unseen(mass, damping, stiffness).map_err(|_| StructureError::NegativeMass)?;
        let (index, reductions, sectors) = (OnceLock::new(), Mutex::default(), Mutex::default());
        Ok(Component(Arc::new(Kept { rows, index, whole, reductions, sectors })))
    }

    /// Rows of the matrices.
    pub fn dofs(&self) -> usize {
        self.0.rows.len()
    }

    /// Names of the rows; an empty one where a row has none.
    pub fn rows(&self) -> &[String] {
        &self.0.rows
    }

    /// The row of that name.
    pub fn row(&self, name: &str) -> Option<usize> {
        let index = self.0.index.get_or_init(|| {
            let named = self.0.rows.iter().enumerate().filter(|(_, name)| !name.is_empty());
            named.map(|(row, name)| (name.clone(), row)).collect()
        });
        index.get(name).copied()
    }

    /// Mass (kg), damping (kg/s) if it has one, and stiffness (N/m).
    pub fn matrices(&self) -> (&Matrix, Option<&Matrix>, &Matrix) {
        let Whole { mass, damping, stiffness, .. } = &self.0.whole;
        let own = match damping {
            Damping::Matrix(own) => Some(own),
            _ => None,
        };
        (mass, own, stiffness)
    }

    /// Its lowest natural frequencies, rad/s, rising; free motions have none to rounding.
    ///
    /// # Errors
    /// [`ReductionError::Modes`].
    pub fn frequencies(&self, count: usize) -> Result<Vec<f64>, ReductionError> {
        let Whole { mass, stiffness, analysis, .. } = &self.0.whole;
        let modes = NaturalModes::new(analysis, stiffness, mass, Wanted::Lowest(count))?;
        Ok(natural(&modes))
    }

    /// The component in few coordinates, seen at these weighted sums of its rows; computed once for all that ask the same.
    ///
    /// # Errors
    /// [`ReductionError`]: no place, modes that cannot be had, or no reduction that is close enough.
    pub fn reduced(&self, seen: &[Row], how: &Reduction) -> Answer {
        once(&self.0.reductions, &(seen.to_vec(), *how), || {
            self.0.whole.seen_at(seen.to_vec()).and_then(|whole| reduce(&whole, how)).map(Arc::new)
        })
    }

    /// The component as one of `sectors` sectors of a ring.
    pub(crate) fn sector(&self, boundary: &Boundary, sectors: usize) -> Arc<KeptSector> {
        let mut known = self.0.sectors.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., kept)) = known.iter().find(|(own, count, _)| own == boundary && *count == sectors) {
            return kept.clone();
        }
        let sector = CyclicSector::new(self, boundary, sectors);
        let kept = Arc::new(KeptSector { sector, reductions: Mutex::default(), blades: Mutex::default() });
        known.push((boundary.clone(), sectors, kept.clone()));
        kept
    }
}

/// An answer that is computed once: whoever asks the same at the same time waits for the one who computes.
fn once<K: PartialEq + Clone, V: Clone>(known: &Mutex<Vec<(K, V)>>, asked: &K, compute: impl FnOnce() -> V) -> V {
    let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, answer)) = known.iter().find(|(key, _)| key == asked) {
        return answer.clone();
    }
    let answer = compute();
    known.push((asked.clone(), answer.clone()));
    answer
}

impl KeptSector {
    /// The sector in few coordinates.
    pub fn reduced(&self, seen: &[Row], how: &Reduction) -> Answer {
        once(&self.reductions, &(seen.to_vec(), *how), || {
            let chosen = self.sector.reduced(seen, how)?;
            let (deviation, frequencies) = (chosen.deviation, chosen.frequencies);
            let form = Form::Sector(chosen.reduced);
            Ok(Arc::new(ReducedComponent { form, deviation, frequencies, free: chosen.free, up_to: chosen.up_to }))
        })
    }

    /// What a share of one of the stiffness of the blade, the rows `blade` of the component, adds: over the coordinates of that reduction, or
    /// over all rows that are left.
    pub fn blade(&self, component: &Component, blade: &[usize], reduced: Option<(&[Row], &Reduction)>) -> Relieved {
        let asked = reduced.map(|(seen, how)| (seen.to_vec(), *how));
        once(&self.blades, &(blade.to_vec(), asked), || {
            let own = self.sector.blade(component, blade)?;
            let Some((seen, how)) = reduced else { return Ok(Arc::new(own.entries())) };
            let reduced = self.reduced(seen, how).ok();
            let Some(Form::Sector(sector)) = reduced.as_deref().map(ReducedComponent::form) else {
                return Ok(Arc::default()); // its reduction has failed before
            };
            let small = own.along(sector.n, &sector.basis);
            let all = (0..small.ncols()).flat_map(|k| (0..small.nrows()).map(move |i| (i, k)));
            Ok(Arc::new(all.map(|at| (at.0, at.1, small[at])).collect()))
        })
    }
}

impl std::fmt::Debug for Component {
    /// Its size, not its matrices.
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

/// Natural frequencies, rad/s; zero of what rounding makes negative.
fn natural(modes: &NaturalModes) -> Vec<f64> {
    modes.values.iter().map(|value| value.max(0.0).sqrt()).collect()
}

fn reduce(whole: &Whole, how: &Reduction) -> Result<ReducedComponent, ReductionError> {
    let (reduced, deviation, modes, up_to) = match *how {
        Reduction::None => return Err(ReductionError::NoPorts),
        Reduction::UpTo { up_to, tolerance, kind } => {
            let chosen = Reduce { up_to, tolerance, kind }.of(whole)?;
            (chosen.reduced, chosen.deviation, chosen.modes, up_to)
        }
        Reduction::Modes { modes: count, kind } => {
            let modes = whole.lowest_modes(count)?;
            let up_to = natural(&modes).last().map_or(0.0, |last| last / BEYOND);
            let reduced = match kind {
                ReductionKind::Rubin => Free::new(whole, &modes, 0.0, 1)?.reduced(modes.count(), 1)?,
                ReductionKind::CraigBampton => whole.held(Wanted::Lowest(count))?,
            };
            let deviation = Reference::new(whole, &modes, up_to)?.deviation(&reduced);
            (reduced, deviation, modes, up_to)
        }
    };
    let (frequencies, free) = (natural(&modes), modes.free());
    Ok(ReducedComponent { form: Form::Alone(reduced.in_metres()), deviation, frequencies, free, up_to })
}

impl ReducedComponent {
    /// Coordinates; of a sector of a ring those of one sector.
    pub fn dofs(&self) -> usize {
        match &self.form {
            Form::Alone(reduced) => reduced.dofs(),
            Form::Sector(sector) => sector.dofs(),
        }
    }

    /// What it is made of, in words.
    pub fn kind(&self) -> &str {
        match &self.form {
            Form::Alone(reduced) => &reduced.kind,
            Form::Sector(sector) => &sector.kind,
        }
    }

    /// The largest relative error of what is seen, up to [`ReducedComponent::up_to`].
    pub fn error(&self) -> f64 {
        self.deviation.error
    }

    /// Where the error is largest, rad/s.
    pub fn worst_at(&self) -> f64 {
        self.deviation.omega
    }

    /// The error holds up to there, rad/s.
    pub fn up_to(&self) -> f64 {
        self.up_to
    }

    /// Frequencies of the whole component, rad/s, rising, as many as it took.
    pub fn frequencies(&self) -> &[f64] {
        &self.frequencies
    }

    /// How many of its modes are free motions.
    pub fn free(&self) -> usize {
        self.free
    }

    /// Its small matrices.
    pub(crate) fn form(&self) -> &Form {
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
