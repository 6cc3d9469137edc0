//! Large structures in a few coordinates `x = T q`, and how far their receptance is from that of the whole.
//!
//! A finite-element model moves in thousands of degrees of freedom and is touched in a few: at joints, where forces act, where one looks. These are
//! its *ports*, weighted sums of rows. `M̂ = Tᵀ M T`, `Ĉ = Tᵀ C T`, `K̂ = Tᵀ K T` keep its symmetry and its signs, whatever the columns of `T` are:
//!
//! | kind | columns of T | file |
//! | --- | --- | --- |
//! | Rubin, MacNeal | free modes, and what the others add to the static answer at the ports | `free` |
//! | Craig-Bampton | modes with the ports held, and static answers to unit motions of the ports | `craig_bampton` |
//!
//! and harmonic balance, which wants receptances only, may take modes and a series of residuals (`series`), of which residual vectors of J orders make the
//! first 2 J terms exact in any method. Every reduction can be held against the
//! whole structure (`evidence`; `mistuned` for a ring whose blades differ), and [`Reduce`] takes as many modes as a given error asks for. A sector of a ring is reduced for all its waves at once
//! (`ring`). One basis may serve two
//! stiffnesses and all between (`between`). A ring whose blades differ is brought into its own modes (`nominal`).
//!
//! Damping is a part of the whole structure and is reduced like the other matrices; [`Damping`] says what a modal damping ratio means
//! beyond the modes that
//! are kept.

mod between;
mod choice;
mod craig_bampton;
mod evidence;
mod free;
mod mistuned;
mod nominal;
mod request;
mod residual;
mod ring;
mod series;

pub use choice::{Chosen, Reduce};
pub use evidence::{Deviation, Reference};
pub use free::Free;
pub(in crate::structure) use mistuned::Lacking;
pub(crate) use nominal::RingModes;
pub(in crate::structure) use nominal::{EXTENTS, Mixed, NominalRing};
pub use request::{Reduction, ReductionKind};
pub(crate) use ring::ReducedSector;
pub(in crate::structure) use ring::STEPS;
pub use series::Series;

use nalgebra::{Complex, DMatrix, DVector};
use std::ops::Range;
use std::sync::Arc;
use stickslip_numerics::dense::{ComplexLu, Lu};
use stickslip_numerics::eigen;
use stickslip_numerics::sparse::{Analysis, Matrix, ModesError, NaturalModes, Singular, Wanted, columns};

/// A weighted sum of degrees of freedom, as (index from 0, weight).
pub type Row = Vec<(usize, f64)>;

/// Frequencies above so many times the highest `√(k_ii/m_ii)` are no frequencies of interest, but mistaken ones: no mode is near.
const ABOVE_ALL: f64 = 100.0;
/// Modes beyond these are refused: as many numbers as degrees of freedom for each.
const MOST_MODES: usize = 600;
/// Columns as long as the structure that are worked on at once: more would fill the memory where there are thousands.
const AT_ONCE: usize = 64;
/// Kinetic energy of a reduced mode relative to its stiffness, in the units of the largest, below which it has no frequency.
const MASSLESS: f64 = 1e-14;
/// A negative shift, relative to the ratio of stiffness and mass, by which free motions have a factor.
const SHIFT: f64 = 1e-6;
/// Eigenvalues below this share of the shift are the rounding of the stiffness, and the motion is free: its root would damp it by a ratio of nothing.
const FREE: f64 = 1e-9;

/// Damping of the whole structure.
#[derive(Debug, Clone, PartialEq)]
pub enum Damping {
    /// Every mode up to a frequency has the same share of critical damping. What is above, and with it the residual and constraint vectors,
    /// is damped in
    /// proportion to its stiffness, continuously: `2 ratio / up_to`, so that a mode at ω has the ratio `ratio ω / up_to`.
    Ratio {
        /// Share of critical damping, 1.
        ratio: f64,
        /// Upper end of the frequencies of interest, rad/s.
        up_to: f64,
    },
    /// `C = mass M + stiffness K`.
    Rayleigh {
        /// 1/s.
        mass: f64,
        /// s.
        stiffness: f64,
    },
    /// `C`, kg/s; it may have a gyroscopic part.
    Matrix(Matrix),
}

impl Damping {
    /// That its numbers are some that damping can have.
    fn check(&self) -> Result<(), ReductionError> {
        let number = |what, value: f64, must, holds: bool| match value.is_finite() && holds {
            true => Ok(()),
            false => Err(ReductionError::Number { what, value, must }),
        };
        match *self {
            Damping::Ratio { ratio, up_to } => {
                number("the damping ratio", ratio, "zero or more", ratio >= 0.0)?;
                number("the upper end of the frequency range (rad/s)", up_to, "positive", up_to > 0.0)?;
            }
            Damping::Rayleigh { mass, stiffness } => {
                number("the mass-proportional damping (1/s)", mass, "zero or more", mass >= 0.0)?;
                number("the stiffness-proportional damping (s)", stiffness, "zero or more", stiffness >= 0.0)?;
            }
            Damping::Matrix(_) => {}
        }
        Ok(())
    }

    /// `C = α M + β K` of what is not kept as a mode; none of a matrix.
    fn proportional(&self) -> Option<(f64, f64)> {
        match *self {
            Damping::Ratio { ratio, up_to } => Some((0.0, 2.0 * ratio / up_to)),
            Damping::Rayleigh { mass, stiffness } => Some((mass, stiffness)),
            Damping::Matrix(_) => None,
        }
    }

    /// `φᵀ C φ` of a mode of unit mass at ω (rad/s), in 1/s.
    fn of_mode(&self, omega: f64) -> Option<f64> {
        match *self {
            Damping::Ratio { ratio, up_to } if omega < up_to => Some(2.0 * ratio * omega),
            _ => self.proportional().map(|(alpha, beta)| alpha + beta * omega * omega),
        }
    }
}

/// A structure before its reduction, with its ports.
#[derive(Debug, Clone)]
pub struct Whole {
    pub(super) mass: Arc<Matrix>,
    pub(super) damping: Damping,
    pub(super) stiffness: Arc<Matrix>,
    ports: Vec<Row>,
    pub(super) analysis: Arc<Analysis>,
}

/// Why a structure is not reduced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReductionError {
    /// Matrices of different sizes.
    #[error("the {matrix} matrix has {rows} rows, but the stiffness matrix has {n}; both must have the same size")]
    Size {
        /// Which.
        matrix: &'static str,
        /// Its rows.
        rows: usize,
        /// Rows of the stiffness.
        n: usize,
    },
    /// A matrix that must be symmetric is not.
    #[error("the {matrix} matrix is not symmetric: rows {row} and {column} (from 0) differ across the diagonal")]
    NotSymmetric {
        /// Which.
        matrix: &'static str,
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
    },
    /// A port of nothing, outside, or not finite.
    #[error("port {port} (from 0) is invalid: it needs finite weights, not all zero, for rows below {n}")]
    Port {
        /// Which, from 0.
        port: usize,
        /// Degrees of freedom.
        n: usize,
    },
    /// Nothing is seen of the structure.
    #[error("the structure has no port; name at least one joint, force or observed place")]
    NoPorts,
    /// A number that makes no damping or no range.
    #[error("{what} is {value}; it must be {must}")]
    Number {
        /// Of what.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        must: &'static str,
    },
    /// Modes far above all that there are: units that were mistaken, or a drive that needs no modes.
    #[error(
        "the reduction requests all modes up to {:.6} Hz, but the structure has no modes far above {:.6} Hz; check the unit",
        omega / std::f64::consts::TAU,
        highest / std::f64::consts::TAU
    )]
    AboveAll {
        /// Up to which they were asked for, rad/s.
        omega: f64,
        /// The highest `√(k_ii/m_ii)`, rad/s.
        highest: f64,
    },
    /// No modes.
    #[error(transparent)]
    Modes(#[from] ModesError),
    /// A dynamic stiffness has no inverse.
    #[error("at {omega:.6e} rad/s {singular}")]
    Singular {
        /// Where, rad/s.
        omega: f64,
        /// Why.
        singular: Singular,
    },
    /// The ports do not hold the structure.
    #[error(
        "with all ports fixed, the structure still has {count} free motion{}, so that its static response does not \
         exist; use free modes instead of Craig-Bampton",
        if *count == 1 { "" } else { "s" }
    )]
    NotHeld {
        /// Free motions.
        count: usize,
    },
    /// A series needs proportional or modal damping.
    #[error(
        "a residual series needs modal or Rayleigh damping, but the structure has a damping matrix; use free modes"
    )]
    SeriesDamping,
    /// No reduction is close enough.
    #[error(
        "no reduction reaches the tolerance {tolerance:.1e}: the best one has an error of {best:.1e} at {:.7} Hz \
         with {dofs} coordinates; increase the tolerance, reduce the frequency range, or use free modes with residual \
         vectors, which need fewer coordinates",
        at / std::f64::consts::TAU
    )]
    OutOfReach {
        /// The least relative error.
        best: f64,
        /// Where, rad/s.
        at: f64,
        /// Its coordinates.
        dofs: usize,
        /// What was asked for.
        tolerance: f64,
    },
    /// Numbers left the range.
    #[error("the entries of the reduced matrices overflow; choose other units")]
    OutOfRange,
}

/// Ports that move by less than this share of the largest displacement of a shape do not see it.
const UNSEEN: f64 = 1e-9;

/// Difference of an entry and its mirror image, relative to the largest, that counts as rounding of a program that wrote ten digits.
const SYMMETRIC: f64 = 1e-9;

impl Whole {
    /// Of sparse symmetric matrices (kg, N/m), damping, and ports: whatever a joint, a force or an observer sees.
    ///
    /// # Errors
    /// [`ReductionError`]: sizes that differ, a matrix that is not symmetric, a port that is none, a negative damping ratio.
    pub fn new(mass: Matrix, damping: Damping, stiffness: Matrix, ports: Vec<Row>) -> Result<Self, ReductionError> {
        Whole::unseen(mass, damping, stiffness)?.seen_at(ports)
    }

    /// The same before anything is seen of it.
    pub(super) fn unseen(mass: Matrix, damping: Damping, stiffness: Matrix) -> Result<Self, ReductionError> {
        let n = stiffness.n();
        let own = match &damping {
            Damping::Matrix(c) => Some(c),
            _ => None,
        };
        for (name, matrix) in [("mass", Some(&mass)), ("stiffness", Some(&stiffness)), ("damping", own)] {
            let Some(matrix) = matrix else { continue };
            if matrix.n() != n {
                return Err(ReductionError::Size { matrix: name, rows: matrix.n(), n });
            }
            if name != "damping"
                && let Some(pair) = matrix.asymmetry(SYMMETRIC * matrix.largest())
            {
                return Err(ReductionError::NotSymmetric { matrix: name, row: pair.row, column: pair.column });
            }
        }
        damping.check()?;
        let analysed: Vec<&Matrix> = [Some(&stiffness), Some(&mass), own].into_iter().flatten().collect();
        let analysis = Arc::new(Analysis::new(&analysed));
        Ok(Whole { mass: Arc::new(mass), damping, stiffness: Arc::new(stiffness), ports: Vec::new(), analysis })
    }

    /// The same structure with other ports; the matrices are shared.
    ///
    /// # Errors
    /// [`ReductionError`]: no port, or one that is none.
    pub fn seen_at(&self, ports: Vec<Row>) -> Result<Self, ReductionError> {
        if ports.is_empty() {
            return Err(ReductionError::NoPorts);
        }
        let n = self.dofs();
        let wrong = |row: &Row| {
            row.iter().any(|(at, weight)| *at >= n || !weight.is_finite())
                || row.iter().all(|(_, weight)| *weight == 0.0)
        };
        if let Some(port) = ports.iter().position(wrong) {
            return Err(ReductionError::Port { port, n });
        }
        Ok(Whole { ports, ..self.clone() })
    }

    /// Degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.stiffness.n()
    }

    /// What is seen of the structure, p rows.
    pub fn ports(&self) -> &[Row] {
        &self.ports
    }

    /// All natural modes up to `omega`, rad/s.
    ///
    /// # Errors
    /// [`ReductionError::Modes`].
    pub fn modes(&self, omega: f64) -> Result<NaturalModes, ReductionError> {
        let own = |i: usize| (self.stiffness.get(i, i), self.mass.get(i, i));
        let ratios =
            (0..self.dofs()).map(own).filter(|(_, mass)| *mass > 0.0).map(|(stiffness, mass)| stiffness / mass);
        let highest = ratios.fold(0.0, f64::max).sqrt();
        if highest > 0.0 && omega > ABOVE_ALL * highest {
            return Err(ReductionError::AboveAll { omega, highest });
        }
        let wanted = Wanted::UpTo { value: omega * omega, most: MOST_MODES };
        Ok(NaturalModes::new(&self.analysis, &self.stiffness, &self.mass, wanted)?)
    }

    /// The lowest natural modes, or all if there are fewer.
    ///
    /// # Errors
    /// [`ReductionError::Modes`].
    pub fn lowest_modes(&self, count: usize) -> Result<NaturalModes, ReductionError> {
        if !(1..=MOST_MODES).contains(&count) {
            let must = "a whole number from 1 to 600";
            return Err(ReductionError::Number { what: "the number of modes", value: count as f64, must });
        }
        Ok(NaturalModes::new(&self.analysis, &self.stiffness, &self.mass, Wanted::Lowest(count))?)
    }

    /// The damping of every mode up to `up_to` (rad/s) by one share of the critical one, as in [`Damping::Ratio`], over all degrees of freedom: `β K + U Uᵀ`.
    /// β in s, and the columns of U.
    ///
    /// # Errors
    /// [`ReductionError`]: numbers that no damping has, modes that cannot be had.
    pub(super) fn modal_damping(&self, ratio: f64, up_to: f64) -> Result<(f64, Vec<f64>), ReductionError> {
        let law = Damping::Ratio { ratio, up_to };
        law.check()?;
        let beta = law.proportional().map_or(0.0, |(_, beta)| beta);
        let modes = self.modes(up_to)?;
        let mut columns = Vec::new();
        for (k, value) in modes.values.iter().enumerate() {
            let omega = value.max(0.0).sqrt();
            // none of a free motion, of which rounding would make some
            let more = law.of_mode(omega).filter(|_| k >= modes.free()).map_or(0.0, |c| c - beta * omega * omega);
            if more > 0.0 {
                columns.extend(self.mass.times(modes.shape(k)).iter().map(|u| more.sqrt() * u));
            }
        }
        Ok((beta, columns))
    }

    /// The ports' displacements over columns as long as the structure.
    fn rows_of(&self, columns: &[f64]) -> DMatrix<f64> {
        seen(&self.ports, self.dofs(), columns)
    }

    /// Unit forces at some of the ports, n × their number.
    fn forces(&self, ports: Range<usize>) -> Vec<f64> {
        let n = self.dofs();
        let mut forces = vec![0.0; n * ports.len()];
        for (port, row) in self.ports[ports].iter().enumerate() {
            row.iter().for_each(|(at, weight)| forces[port * n + at] += weight);
        }
        forces
    }
}

/// A structure in few coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduced {
    /// How, for people.
    pub kind: String,
    /// `M̂`, r × r.
    pub mass: DMatrix<f64>,
    /// `Ĉ`, r × r.
    pub damping: DMatrix<f64>,
    /// `K̂`, r × r.
    pub stiffness: DMatrix<f64>,
    /// The ports' displacements as rows over the coordinates, p × r.
    pub ports: DMatrix<f64>,
    /// Columns as long as the whole structure, and T as combinations of them.
    basis: Arc<Vec<f64>>,
    weights: DMatrix<f64>,
    n: usize,
}

impl Reduced {
    /// Galerkin's projection on the columns of `basis`, n × r.
    fn project(whole: &Whole, kind: String, basis: Vec<f64>) -> Result<Self, ReductionError> {
        let n = whole.dofs();
        let square = |matrix: &Matrix| columns::products(n, &basis, &matrix.times_columns(&basis));
        let (mass, stiffness) = (symmetric(square(&whole.mass)), symmetric(square(&whole.stiffness)));
        let own = match &whole.damping {
            Damping::Matrix(c) => Some(square(c)),
            _ => None,
        };
        let damping = damping(&whole.damping, &mass, &stiffness, own)?;
        let (ports, weights) = (whole.rows_of(&basis), DMatrix::identity(mass.nrows(), mass.nrows()));
        Ok(Reduced { kind, mass, damping, stiffness, ports, basis: Arc::new(basis), weights, n })
    }

    /// Coordinates, r.
    pub fn dofs(&self) -> usize {
        self.mass.nrows()
    }

    /// The same with another damping, which is none by a matrix.
    ///
    /// # Errors
    /// [`ReductionError`]: numbers that no damping has, or a damping matrix, which is reduced with the others.
    pub fn damped(&self, by: &Damping) -> Result<Self, ReductionError> {
        by.check()?;
        Ok(Reduced { damping: damping(by, &self.mass, &self.stiffness, None)?, ..self.clone() })
    }

    /// The same in coordinates that are displacements: each is that of the port that moves most with it, in m, or of the degree of freedom if
    /// no port moves. What compares coordinates with each other then compares metres. The displacements of all other rows are
    /// forgotten.
    #[must_use]
    pub(super) fn in_metres(mut self) -> Self {
        let most = |column: &[f64]| column.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let sizes: Vec<f64> = self.basis.chunks_exact(self.n.max(1)).map(most).collect();
        for k in 0..self.dofs() {
            let port = if self.ports.nrows() > 0 { self.ports.column(k).amax() } else { 0.0 };
            // what the column cannot pass is known before the column
            let bound: f64 = self.weights.column(k).iter().zip(&sizes).map(|(w, size)| (w * size).abs()).sum();
            let size = if port > UNSEEN * bound {
                port
            } else {
                let largest =
                    most(&columns::combination(self.n, &self.basis, &self.weights.columns(k, 1).into_owned()));
                if port > UNSEEN * largest { port } else { largest }
            };
            if size == 0.0 {
                continue;
            }
            let factor = 1.0 / size;
            self.ports.column_mut(k).scale_mut(factor);
            for matrix in [&mut self.mass, &mut self.damping, &mut self.stiffness] {
                matrix.row_mut(k).scale_mut(factor);
                matrix.column_mut(k).scale_mut(factor);
            }
        }
        // as large as the whole, and whoever asks for metres asks at the ports
        (self.basis, self.weights, self.n) = (Arc::default(), DMatrix::zeros(0, 0), 0);
        self
    }

    /// Any weighted sums of the degrees of freedom of the whole structure, as rows over the coordinates.
    ///
    /// # Panics
    /// If a row lies outside of the whole structure.
    pub fn rows(&self, rows: &[Row]) -> DMatrix<f64> {
        product(&seen(rows, self.n, &self.basis), &self.weights)
    }

    /// All displacements of the whole structure, n × r.
    fn columns(&self) -> DMatrix<f64> {
        DMatrix::from_vec(self.n, self.dofs(), columns::combination(self.n, &self.basis, &self.weights))
    }

    /// All displacements of the whole structure that belong to coordinates `q`.
    ///
    /// # Panics
    /// If `q` has not r entries.
    pub fn expand(&self, q: &[f64]) -> Vec<f64> {
        let weights = product(&self.weights, &DMatrix::from_column_slice(q.len(), 1, q));
        columns::combination(self.n, &self.basis, &weights)
    }

    /// Natural frequencies of the reduced structure, rad/s, rising; those of coordinates without mass are infinite.
    pub fn frequencies(&self) -> Option<Vec<f64>> {
        Some(natural(&self.mass, &self.stiffness)?.0.iter().map(|v| v.max(0.0).sqrt()).collect())
    }

    /// Receptance of the ports at ω (rad/s): displacements by unit forces, p × p, m/N.
    ///
    /// # Errors
    /// [`ReductionError::Singular`] at an undamped resonance.
    pub fn receptance(&self, omega: f64) -> Result<DMatrix<Complex<f64>>, ReductionError> {
        self.answers(omega, &DMatrix::identity(self.ports.nrows(), self.ports.nrows()))
    }

    /// Displacements of the ports under forces on them, columns side by side.
    fn answers(&self, omega: f64, loads: &DMatrix<f64>) -> Result<DMatrix<Complex<f64>>, ReductionError> {
        let at = |i: usize, k: usize| {
            let (m, c, s) = (self.mass[(i, k)], self.damping[(i, k)], self.stiffness[(i, k)]);
            Complex::new(s - omega * omega * m, omega * c)
        };
        let free = ReductionError::Singular { omega, singular: Singular { row: 0 } };
        let forces = columns::products(self.ports.nrows(), self.ports.as_slice(), loads.as_slice());
        let moved = if [&self.mass, &self.damping, &self.stiffness].into_iter().all(is_diagonal) {
            let own: Vec<Complex<f64>> = (0..self.dofs()).map(|i| at(i, i)).collect();
            if own.contains(&Complex::new(0.0, 0.0)) {
                return Err(free);
            }
            DMatrix::from_fn(forces.nrows(), forces.ncols(), |i, k| forces[(i, k)] / own[i])
        } else {
            self.solved(omega, forces).map_err(|row| ReductionError::Singular { omega, singular: Singular { row } })?
        };
        let part = |read: fn(&Complex<f64>) -> f64| product(&self.ports, &moved.map(|z| read(&z)));
        Ok(part(|z| z.re).zip_map(&part(|z| z.im), Complex::new))
    }

    /// The coordinates under forces on them, by elimination: without damping in real numbers, a fourth of the work.
    fn solved(&self, omega: f64, mut forces: DMatrix<f64>) -> Result<DMatrix<Complex<f64>>, usize> {
        let n = self.dofs();
        let bare = (self.stiffness.iter().zip(self.mass.iter())).map(|(k, m)| k - omega * omega * m);
        if self.damping.iter().all(|c| *c == 0.0) {
            Lu::new(bare.collect(), n)?.solve(forces.as_mut_slice());
            return Ok(forces.map(|v| Complex::new(v, 0.0)));
        }
        let damped = bare.zip(self.damping.iter()).map(|(re, c)| Complex::new(re, omega * c));
        let mut moved = forces.map(|v| Complex::new(v, 0.0));
        ComplexLu::new(damped.collect(), n)?.solve(moved.as_mut_slice());
        Ok(moved)
    }
}

/// `A B`.
fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    // columns of length zero cannot be counted
    if a.is_empty() || b.is_empty() {
        return DMatrix::zeros(a.nrows(), b.ncols());
    }
    DMatrix::from_vec(a.nrows(), b.ncols(), columns::combination(a.nrows(), a.as_slice(), b))
}

fn is_diagonal(matrix: &DMatrix<f64>) -> bool {
    let n = matrix.nrows();
    matrix.as_slice().iter().enumerate().all(|(at, value)| *value == 0.0 || at % n == at / n)
}

/// Weighted sums of rows over columns of length `n`.
fn seen(rows: &[Row], n: usize, columns: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len() / n.max(1), |i, k| {
        rows[i].iter().map(|(at, weight)| weight * columns[k * n + at]).sum()
    })
}

/// The mean of a matrix and its mirror image.
fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    (&matrix + matrix.transpose()) * 0.5
}

/// Reduced damping: `own` if the structure has a matrix.
fn damping(
    by: &Damping,
    mass: &DMatrix<f64>,
    stiffness: &DMatrix<f64>,
    own: Option<DMatrix<f64>>,
) -> Result<DMatrix<f64>, ReductionError> {
    let Some((alpha, beta)) = by.proportional() else {
        return own.ok_or(ReductionError::OutOfRange);
    };
    let mut c = mass * alpha + stiffness * beta;
    if let Damping::Ratio { up_to, .. } = *by
        && beta > 0.0
    {
        let (values, shapes) = natural(mass, stiffness).ok_or(ReductionError::OutOfRange)?;
        let more = |omega: f64| by.of_mode(omega).unwrap_or(0.0) - beta * omega * omega;
        let below: Vec<usize> = (0..values.len()).filter(|&k| values[k] < up_to * up_to).collect();
        let forces = product(mass, &shapes.select_columns(&below));
        let mut weighted = forces.clone();
        for (mut force, &k) in weighted.column_iter_mut().zip(&below) {
            force *= more(values[k].max(0.0).sqrt());
        }
        c += symmetric(product(&weighted, &forces.transpose()));
    }
    Ok(c)
}

/// Eigenvalues λ (rad²/s², rising, infinite without mass) and shapes of unit mass (or unit stiffness without mass) of a small structure.
pub(crate) fn natural(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let r = mass.nrows();
    let moves = |i: usize| mass[(i, i)] > 0.0 || (mass[(i, i)] == 0.0 && stiffness[(i, i)] > 0.0);
    if is_diagonal(mass) && is_diagonal(stiffness) && (0..r).all(moves) {
        return Some(natural_by_themselves(&mass.diagonal(), &stiffness.diagonal()));
    }
    let ratio = |i: usize| stiffness[(i, i)] / mass[(i, i)];
    let mut ratios: Vec<f64> = (0..r).map(ratio).filter(|v| v.is_finite() && *v > 0.0).collect();
    ratios.sort_by(f64::total_cmp);
    let shift = SHIFT * ratios.get(ratios.len() / 2).copied().unwrap_or(1.0);
    let (thetas, mut shapes) = eigen::symmetric_pair(mass, &(stiffness + mass * shift))?;
    let largest = thetas.iter().fold(0.0f64, |most, theta| most.max(theta.abs()));
    let massless = |theta: f64| theta <= MASSLESS * largest;
    let free = |value: f64| value.abs() <= FREE * shift;
    let value = |theta: f64| match 1.0 / theta - shift {
        _ if massless(theta) => f64::INFINITY,
        value if free(value) => 0.0,
        value => value,
    };
    for (mut shape, &theta) in shapes.column_iter_mut().zip(&thetas) {
        shape /= if massless(theta) { 1.0 } else { theta.sqrt() };
    }
    // the largest has the lowest frequency
    let order: Vec<usize> = (0..r).rev().collect();
    Some((order.iter().map(|&k| value(thetas[k])).collect(), shapes.select_columns(&order)))
}

/// The same of coordinates that do not move each other.
fn natural_by_themselves(mass: &DVector<f64>, stiffness: &DVector<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let n = mass.len();
    let value = |i: usize| if mass[i] > 0.0 { stiffness[i] / mass[i] } else { f64::INFINITY };
    let size = |i: usize| if mass[i] > 0.0 { mass[i] } else { stiffness[i] }.sqrt();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| value(a).total_cmp(&value(b)));
    let mut shapes = DMatrix::zeros(n, n);
    order.iter().enumerate().for_each(|(k, &i)| shapes[(i, k)] = 1.0 / size(i));
    (order.into_iter().map(value).collect(), shapes)
}
