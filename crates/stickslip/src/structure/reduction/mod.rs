//! Reduced models of large structures, `x = T q`, with the error of their receptance.
//!
//! A finite-element model has thousands of degrees of freedom, but joints, forces and observers
//! use only a few displacements. These are its *ports*, weighted sums of rows. `M̂ = Tᵀ M T`,
//! `Ĉ = Tᵀ C T`, `K̂ = Tᵀ K T` preserve symmetry and definiteness for any columns of `T`:
//!
//! - Rubin, MacNeal (`rubin`): free modes, and the static response of the omitted modes at the
//!   ports.
//! - Craig-Bampton (`craig_bampton`): modes with fixed ports, and static responses to unit
//!   displacements of the ports.
//!
//! Harmonic balance needs receptances only and can also use modes and a series of residuals
//! (`residual_series`). Residual vectors of J orders make the first 2 J terms of this series
//! exact in any method.
//!
//! The other files:
//!
//! - `receptance_error` compares a reduction with the whole structure; `mistuning_error` does
//!   this for a ring with different blades.
//! - `automatic`: [`AutomaticReduction`] uses as many modes as a given error requires.
//! - `cyclic_basis` reduces a sector for all waves of its ring at once; `computed_wave` has the
//!   modes and residual vectors of one wave.
//! - `common_basis` builds one basis for two stiffnesses and all between them.
//! - `nominal_modes` transforms a ring with different blades to its own modes.
//!
//! Damping is a part of the whole structure and is reduced like the other matrices.
//! [`StructureDamping`] defines a modal damping ratio beyond the retained modes.

mod automatic;
mod common_basis;
mod computed_wave;
mod craig_bampton;
mod cyclic_basis;
mod mistuning_error;
mod nominal_modes;
mod receptance_error;
mod request;
mod residual_flexibility;
mod residual_series;
mod rubin;

pub use automatic::{AutomaticReduction, SelectedReduction};
pub(crate) use cyclic_basis::ReducedSector;
pub use cyclic_basis::SectorBasis;
pub(in crate::structure) use cyclic_basis::{STEPS, SectorReduction};
pub(in crate::structure) use mistuning_error::MistuningError;
pub(in crate::structure) use nominal_modes::{EXTENTS, MistunedModes, NominalRing};
pub(crate) use nominal_modes::{RingModes, RingShapes};
pub use receptance_error::{ReductionDeviation, ReferenceReceptance};
pub use request::{Reduction, ReductionKind};
pub use residual_series::ResidualSeries;
pub use rubin::RubinBasis;

use nalgebra::{Complex, DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;
use stickslip_numerics::dense::{ComplexLu, DenseLu};
use stickslip_numerics::eigen;
use stickslip_numerics::sparse::{
    ModeSelection, ModesError, NaturalModes, Singular, SparseMatrix, SymbolicAnalysis, multi_vector,
};

/// A weighted sum of degrees of freedom, as (index from 0, weight).
pub type Row = Vec<(usize, f64)>;

/// Largest number of modes; each needs one number per degree of freedom.
const MAX_MODES: usize = 600;
/// Number of columns of full length processed at once. More would exhaust the memory for
/// thousands of columns.
const COLUMN_BLOCK: usize = 64;

/// Damping of the whole structure.
#[derive(Debug, Clone, PartialEq)]
pub enum StructureDamping {
    /// Every mode up to a frequency has the same fraction of critical damping.
    ///
    /// Motion above it, and with it the residual and constraint vectors, has damping
    /// proportional to its stiffness, `2 ratio / up_to`. The transition is continuous: a mode
    /// at ω has the ratio `ratio ω / up_to`.
    Ratio {
        /// Fraction of critical damping, 1.
        ratio: f64,
        /// Upper end of the frequency range of interest, rad/s.
        up_to: f64,
    },
    /// `C = mass M + stiffness K`.
    Rayleigh {
        /// Factor of the mass matrix, 1/s.
        mass: f64,
        /// Factor of the stiffness matrix, s.
        stiffness: f64,
    },
    /// `C`, kg/s; it may have a gyroscopic part.
    Matrix(SparseMatrix),
}

impl StructureDamping {
    /// Checks that its parameters are valid.
    fn check(&self) -> Result<(), ReductionError> {
        let number = |what, value: f64, must, holds: bool| match value.is_finite() && holds {
            true => Ok(()),
            false => Err(ReductionError::Number { what, value, must }),
        };
        match *self {
            StructureDamping::Ratio { ratio, up_to } => {
                number("the damping ratio", ratio, "zero or more", ratio >= 0.0)?;
                number("the upper end of the frequency range (rad/s)", up_to, "positive", up_to > 0.0)?;
            }
            StructureDamping::Rayleigh { mass, stiffness } => {
                number("the mass-proportional damping (1/s)", mass, "zero or more", mass >= 0.0)?;
                number("the stiffness-proportional damping (s)", stiffness, "zero or more", stiffness >= 0.0)?;
            }
            StructureDamping::Matrix(_) => {}
        }
        Ok(())
    }

    /// Returns α and β of `C = α M + β K` for motion outside the retained modes; `None` for a
    /// damping matrix.
    fn proportional(&self) -> Option<(f64, f64)> {
        match *self {
            StructureDamping::Ratio { ratio, up_to } => Some((0.0, 2.0 * ratio / up_to)),
            StructureDamping::Rayleigh { mass, stiffness } => Some((mass, stiffness)),
            StructureDamping::Matrix(_) => None,
        }
    }

    /// Returns `φᵀ C φ` of a mode of unit mass at ω (rad/s), in 1/s.
    fn of_mode(&self, omega: f64) -> Option<f64> {
        match *self {
            StructureDamping::Ratio { ratio, up_to } if omega < up_to => Some(2.0 * ratio * omega),
            _ => self.proportional().map(|(alpha, beta)| alpha + beta * omega * omega),
        }
    }
}

/// A structure before its reduction, with its ports.
#[derive(Debug, Clone)]
pub struct FullStructure {
    pub(super) mass: Arc<SparseMatrix>,
    pub(super) damping: StructureDamping,
    pub(super) stiffness: Arc<SparseMatrix>,
    ports: Vec<Row>,
    pub(super) analysis: Arc<SymbolicAnalysis>,
}

/// The reason why a structure cannot be reduced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReductionError {
    /// The sizes of the matrices differ.
    #[error("the {matrix} matrix has {rows} rows, but the stiffness matrix has {n}; both must have the same size")]
    Size {
        /// Name of the matrix.
        matrix: &'static str,
        /// Its number of rows.
        rows: usize,
        /// Number of rows of the stiffness matrix.
        n: usize,
    },
    /// A matrix is not symmetric, although it must be.
    #[error("the {matrix} matrix is not symmetric: its entries ({}, {}) and ({}, {}) differ; export the whole matrix", .row + 1, .column + 1, .column + 1, .row + 1)]
    NotSymmetric {
        /// Name of the matrix.
        matrix: &'static str,
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
    },
    /// A port is zero, out of range, or not finite.
    #[error("place {} is invalid: it needs finite weights, not all zero, of rows 1 to {n}", .port + 1)]
    Port {
        /// Index of the port, from 0.
        port: usize,
        /// Number of degrees of freedom.
        n: usize,
    },
    /// The structure has no ports.
    #[error("the structure has no place to keep; name at least one joint, force or observed place")]
    NoPorts,
    /// A parameter of damping or of a range is invalid.
    #[error("{what} is {value}; it must be {must}")]
    Number {
        /// Name of the parameter.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its valid range.
        must: &'static str,
    },
    /// The requested frequency is far above all modes: a wrong unit, or an excitation that
    /// needs no modes.
    #[error(
        "the reduction requests all modes up to {:.6} Hz, but the structure has no modes far above {:.6} Hz; check the unit",
        omega / std::f64::consts::TAU,
        highest / std::f64::consts::TAU
    )]
    FrequencyTooHigh {
        /// Upper end of the requested range, rad/s.
        omega: f64,
        /// The highest `√(k_ii/m_ii)`, rad/s.
        highest: f64,
    },
    /// The computation of modes failed.
    #[error(transparent)]
    Modes(#[from] ModesError),
    /// A dynamic stiffness is singular.
    #[error("at {:.6} Hz {singular}", omega / std::f64::consts::TAU)]
    Singular {
        /// Frequency, rad/s.
        omega: f64,
        /// The singular pivot.
        singular: Singular,
    },
    /// The structure with fixed ports has free motions.
    #[error(
        "with all places fixed, the structure still has {count} rigid-body mode{}, so that its static response does \
         not exist; use free-interface modes instead of Craig-Bampton",
        if *count == 1 { "" } else { "s" }
    )]
    FreeInterfaceMotion {
        /// Number of free motions.
        count: usize,
    },
    /// A series needs proportional or modal damping.
    #[error(
        "a residual series needs modal or Rayleigh damping, but the structure has a damping matrix; use free modes"
    )]
    SeriesDamping,
    /// No reduction reaches the tolerance.
    #[error(
        "no reduction reaches the tolerance {tolerance:.1e}: the best one has an error of {best:.1e} at {:.7} Hz \
         with {dofs} coordinates; increase the tolerance, reduce the frequency range, or use free modes with residual \
         vectors, which need fewer coordinates",
        at / std::f64::consts::TAU
    )]
    ToleranceNotReached {
        /// Smallest relative error.
        best: f64,
        /// Frequency of that error, rad/s.
        at: f64,
        /// Number of its coordinates.
        dofs: usize,
        /// Required tolerance.
        tolerance: f64,
    },
    /// Numbers overflow.
    #[error("the entries of the reduced matrices overflow; choose other units")]
    OutOfRange,
}

impl FullStructure {
    /// Creates a structure from sparse symmetric matrices (kg, N/m), damping, and ports, the
    /// displacements that joints, forces and observers use.
    ///
    /// # Errors
    /// [`ReductionError`]: sizes that differ, an unsymmetric matrix, an invalid port, a
    /// negative damping ratio.
    pub fn new(
        mass: SparseMatrix,
        damping: StructureDamping,
        stiffness: SparseMatrix,
        ports: Vec<Row>,
    ) -> Result<Self, ReductionError> {
        FullStructure::without_ports(mass, damping, stiffness)?.with_ports(ports)
    }

    /// Creates a structure without ports.
    pub(super) fn without_ports(
        mass: SparseMatrix,
        damping: StructureDamping,
        stiffness: SparseMatrix,
    ) -> Result<Self, ReductionError> {
        let n = stiffness.n();
        let own = match &damping {
            StructureDamping::Matrix(c) => Some(c),
            _ => None,
        };
        for (name, matrix) in [("mass", Some(&mass)), ("stiffness", Some(&stiffness)), ("damping", own)] {
            let Some(matrix) = matrix else { continue };
            if matrix.n() != n {
                return Err(ReductionError::Size { matrix: name, rows: matrix.n(), n });
            }
            // Difference between an entry and its mirror image that counts as rounding of a
            // program that writes ten digits. It is relative to the largest entry.
            if name != "damping"
                && let Some(pair) = matrix.asymmetry(1e-9 * matrix.max_abs())
            {
                return Err(ReductionError::NotSymmetric { matrix: name, row: pair.row, column: pair.column });
            }
        }
        damping.check()?;
        let analysed: Vec<&SparseMatrix> = [Some(&stiffness), Some(&mass), own].into_iter().flatten().collect();
        let analysis = Arc::new(SymbolicAnalysis::new(&analysed));
        Ok(FullStructure::from_valid(mass, damping, stiffness, analysis))
    }

    /// Creates a structure without ports from valid matrices and their analysis.
    pub(super) fn from_valid(
        mass: SparseMatrix,
        damping: StructureDamping,
        stiffness: SparseMatrix,
        analysis: Arc<SymbolicAnalysis>,
    ) -> Self {
        FullStructure { mass: Arc::new(mass), damping, stiffness: Arc::new(stiffness), ports: Vec::new(), analysis }
    }

    /// Returns the same structure with other ports; the matrices are shared.
    ///
    /// # Errors
    /// [`ReductionError`]: no port, or an invalid one.
    pub fn with_ports(&self, ports: Vec<Row>) -> Result<Self, ReductionError> {
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
        Ok(FullStructure { ports, ..self.clone() })
    }

    /// Returns the number of degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.stiffness.n()
    }

    /// Returns the observed displacements, p rows.
    pub fn ports(&self) -> &[Row] {
        &self.ports
    }

    /// Computes all natural modes up to `omega`, rad/s.
    ///
    /// # Errors [`ReductionError::Modes`], or [`ReductionError::FrequencyTooHigh`] if `omega` is
    /// far above all modes.
    pub fn modes(&self, omega: f64) -> Result<NaturalModes, ReductionError> {
        let own = |i: usize| (self.stiffness.get(i, i), self.mass.get(i, i));
        let ratios =
            (0..self.dofs()).map(own).filter(|(_, mass)| *mass > 0.0).map(|(stiffness, mass)| stiffness / mass);
        let highest = ratios.fold(0.0, f64::max).sqrt();
        // Ratio of a frequency to the highest `√(k_ii/m_ii)` above which the frequency is a
        // mistake: no mode is near.
        if highest > 0.0 && omega > 100.0 * highest {
            return Err(ReductionError::FrequencyTooHigh { omega, highest });
        }
        let wanted = ModeSelection::UpTo { value: omega * omega, most: MAX_MODES };
        Ok(NaturalModes::new(&self.analysis, &self.stiffness, &self.mass, wanted)?)
    }

    /// Computes the lowest natural modes, or all if there are fewer.
    ///
    /// # Errors
    /// [`ReductionError::Modes`], or [`ReductionError::Number`] for an invalid count.
    pub fn lowest_modes(&self, count: usize) -> Result<NaturalModes, ReductionError> {
        if !(1..=MAX_MODES).contains(&count) {
            let must = "a whole number from 1 to 600";
            return Err(ReductionError::Number { what: "the number of modes", value: count as f64, must });
        }
        Ok(NaturalModes::new(&self.analysis, &self.stiffness, &self.mass, ModeSelection::Lowest(count))?)
    }

    /// Computes the damping of [`StructureDamping::Ratio`] over all degrees of freedom: `β K + U
    /// Uᵀ`. Returns β in s, and the columns of U.
    ///
    /// # Errors
    /// [`ReductionError`]: invalid parameters of damping, or a failure of the mode computation.
    pub(super) fn modal_damping(&self, ratio: f64, up_to: f64) -> Result<(f64, Vec<f64>), ReductionError> {
        let law = StructureDamping::Ratio { ratio, up_to };
        law.check()?;
        let beta = law.proportional().map_or(0.0, |(_, beta)| beta);
        let modes = self.modes(up_to)?;
        let mut columns = Vec::new();
        for (k, value) in modes.values.iter().enumerate() {
            let omega = value.max(0.0).sqrt();
            // a free motion has none, although rounding would give it some
            let more =
                law.of_mode(omega).filter(|_| k >= modes.rigid_body_count()).map_or(0.0, |c| c - beta * omega * omega);
            if more > 0.0 {
                columns.extend(self.mass.multiply(modes.shape(k)).iter().map(|u| more.sqrt() * u));
            }
        }
        Ok((beta, columns))
    }

    /// Returns the displacements of the ports for columns of full length.
    fn rows_of(&self, columns: &[f64]) -> DMatrix<f64> {
        evaluate_rows(&self.ports, self.dofs(), columns)
    }

    /// Returns unit forces at a range of ports, n × their number.
    fn forces(&self, ports: Range<usize>) -> Vec<f64> {
        let n = self.dofs();
        let mut forces = vec![0.0; n * ports.len()];
        for (port, row) in self.ports[ports].iter().enumerate() {
            row.iter().for_each(|(at, weight)| forces[port * n + at] += weight);
        }
        forces
    }
}

/// A reduced structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReducedMatrices {
    /// Description of the reduction.
    pub kind: String,
    /// `M̂`, r × r.
    pub mass: DMatrix<f64>,
    /// `Ĉ`, r × r.
    pub damping: DMatrix<f64>,
    /// `K̂`, r × r.
    pub stiffness: DMatrix<f64>,
    /// Displacements of the ports as rows over the coordinates, p × r.
    pub ports: DMatrix<f64>,
    /// Columns of full length, and T as combinations of them.
    basis: Arc<Vec<f64>>,
    weights: DMatrix<f64>,
    n: usize,
}

/// A port whose displacement is below this fraction of the largest one of a shape does not
/// observe that shape.
const UNSEEN: f64 = 1e-9;

impl ReducedMatrices {
    /// Computes the Galerkin projection on the columns of `basis`, n × r.
    fn project(whole: &FullStructure, kind: String, basis: Vec<f64>) -> Result<Self, ReductionError> {
        let n = whole.dofs();
        let square = |matrix: &SparseMatrix| multi_vector::inner_products(n, &basis, &matrix.multiply_columns(&basis));
        let (mass, stiffness) = (symmetric(square(&whole.mass)), symmetric(square(&whole.stiffness)));
        let own = match &whole.damping {
            StructureDamping::Matrix(c) => Some(square(c)),
            _ => None,
        };
        let damping = damping(&whole.damping, &mass, &stiffness, own)?;
        let (ports, weights) = (whole.rows_of(&basis), DMatrix::identity(mass.nrows(), mass.nrows()));
        Ok(ReducedMatrices { kind, mass, damping, stiffness, ports, basis: Arc::new(basis), weights, n })
    }

    /// Returns the number of coordinates, r.
    pub fn dofs(&self) -> usize {
        self.mass.nrows()
    }

    /// Returns this structure with another damping, which is not a matrix.
    ///
    /// # Errors
    /// [`ReductionError`]: invalid parameters, or a damping matrix, which must be reduced
    /// together with the other matrices.
    pub fn damped(&self, by: &StructureDamping) -> Result<Self, ReductionError> {
        by.check()?;
        Ok(ReducedMatrices { damping: damping(by, &self.mass, &self.stiffness, None)?, ..self.clone() })
    }

    /// Scales the coordinates to displacements in m.
    ///
    /// The unit is the displacement of the port that moves most in each coordinate, or of the
    /// largest degree of freedom if no port moves. Comparisons between coordinates then compare
    /// metres.
    #[must_use]
    pub(super) fn scaled_to_metres(mut self) -> Self {
        let most = |column: &[f64]| column.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let sizes: Vec<f64> = self.basis.chunks_exact(self.n.max(1)).map(most).collect();
        for k in 0..self.dofs() {
            let port = if self.ports.nrows() > 0 { self.ports.column(k).amax() } else { 0.0 };
            // an upper bound, which avoids the computation of the column
            let bound: f64 = self.weights.column(k).iter().zip(&sizes).map(|(w, size)| (w * size).abs()).sum();
            let size = if port > UNSEEN * bound {
                port
            } else {
                let largest =
                    most(&multi_vector::combine(self.n, &self.basis, &self.weights.columns(k, 1).into_owned()));
                if port > UNSEEN * largest { port } else { largest }
            };
            if size == 0.0 {
                continue;
            }
            let factor = 1.0 / size;
            self.ports.column_mut(k).scale_mut(factor);
            self.weights.column_mut(k).scale_mut(factor);
            for matrix in [&mut self.mass, &mut self.damping, &mut self.stiffness] {
                matrix.row_mut(k).scale_mut(factor);
                matrix.column_mut(k).scale_mut(factor);
            }
        }
        self
    }

    /// Drops the displacements of all rows except ports: the basis has the size of the whole
    /// structure.
    #[must_use]
    pub(super) fn without_basis(mut self) -> Self {
        (self.basis, self.weights, self.n) = (Arc::default(), DMatrix::zeros(0, 0), 0);
        self
    }

    /// Returns weighted sums of the degrees of freedom of the whole structure as rows over the
    /// coordinates.
    ///
    /// # Panics
    /// If a row is out of range.
    pub fn rows(&self, rows: &[Row]) -> DMatrix<f64> {
        product(&evaluate_rows(rows, self.n, &self.basis), &self.weights)
    }

    /// Returns all displacements of the whole structure, n × r.
    pub(super) fn columns(&self) -> DMatrix<f64> {
        DMatrix::from_vec(self.n, self.dofs(), multi_vector::combine(self.n, &self.basis, &self.weights))
    }

    /// Returns all displacements of the whole structure for coordinates `q`.
    ///
    /// # Panics
    /// If `q` does not have r entries.
    pub fn expand(&self, q: &[f64]) -> Vec<f64> {
        let weights = product(&self.weights, &DMatrix::from_column_slice(q.len(), 1, q));
        multi_vector::combine(self.n, &self.basis, &weights)
    }

    /// Returns the natural frequencies of the reduced structure, rad/s, in ascending order.
    /// They are infinite for coordinates without mass.
    pub fn frequencies(&self) -> Option<Vec<f64>> {
        Some(natural(&self.mass, &self.stiffness)?.0.iter().map(|v| v.max(0.0).sqrt()).collect())
    }

    /// Returns the receptance of the ports at ω (rad/s): displacements per unit force, p × p,
    /// m/N.
    ///
    /// # Errors
    /// [`ReductionError::Singular`] at an undamped resonance.
    pub fn receptance(&self, omega: f64) -> Result<DMatrix<Complex<f64>>, ReductionError> {
        self.answers(omega, &DMatrix::identity(self.ports.nrows(), self.ports.nrows()))
    }

    /// Returns the displacements of the ports under forces on them, one column per load.
    fn answers(&self, omega: f64, loads: &DMatrix<f64>) -> Result<DMatrix<Complex<f64>>, ReductionError> {
        let at = |i: usize, k: usize| {
            let (m, c, s) = (self.mass[(i, k)], self.damping[(i, k)], self.stiffness[(i, k)]);
            Complex::new(s - omega * omega * m, omega * c)
        };
        let free = ReductionError::Singular { omega, singular: Singular { row: 0 } };
        let forces = multi_vector::inner_products(self.ports.nrows(), self.ports.as_slice(), loads.as_slice());
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

    /// Solves for the coordinates by elimination. Without damping, real numbers need a quarter
    /// of the work.
    fn solved(&self, omega: f64, mut forces: DMatrix<f64>) -> Result<DMatrix<Complex<f64>>, usize> {
        let n = self.dofs();
        let bare = (self.stiffness.iter().zip(self.mass.iter())).map(|(k, m)| k - omega * omega * m);
        if self.damping.iter().all(|c| *c == 0.0) {
            DenseLu::new(bare.collect(), n)?.solve(forces.as_mut_slice());
            return Ok(forces.map(|v| Complex::new(v, 0.0)));
        }
        let damped = bare.zip(self.damping.iter()).map(|(re, c)| Complex::new(re, omega * c));
        let mut moved = forces.map(|v| Complex::new(v, 0.0));
        ComplexLu::new(damped.collect(), n)?.solve(moved.as_mut_slice());
        Ok(moved)
    }
}

/// Returns `A B`.
fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    // columns of length zero cannot be counted
    if a.is_empty() || b.is_empty() {
        return DMatrix::zeros(a.nrows(), b.ncols());
    }
    DMatrix::from_vec(a.nrows(), b.ncols(), multi_vector::combine(a.nrows(), a.as_slice(), b))
}

fn is_diagonal(matrix: &DMatrix<f64>) -> bool {
    let n = matrix.nrows();
    matrix.as_slice().iter().enumerate().all(|(at, value)| *value == 0.0 || at % n == at / n)
}

/// Evaluates weighted sums of rows over columns of length `n`.
fn evaluate_rows(rows: &[Row], n: usize, columns: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len() / n.max(1), |i, k| {
        rows[i].iter().map(|(at, weight)| weight * columns[k * n + at]).sum()
    })
}

/// Returns the mean of a matrix and its transpose.
fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    (&matrix + matrix.transpose()) * 0.5
}

/// Returns the reduced damping, or `own` if the structure has a damping matrix.
fn damping(
    by: &StructureDamping,
    mass: &DMatrix<f64>,
    stiffness: &DMatrix<f64>,
    own: Option<DMatrix<f64>>,
) -> Result<DMatrix<f64>, ReductionError> {
    let Some((alpha, beta)) = by.proportional() else {
        return own.ok_or(ReductionError::OutOfRange);
    };
    let mut c = mass * alpha + stiffness * beta;
    if let StructureDamping::Ratio { up_to, .. } = *by
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

/// Solves the eigenvalue problem of a small structure.
///
/// Returns eigenvalues λ (rad²/s², ascending, infinite without mass) and shapes of unit mass,
/// or of unit stiffness for those without mass.
pub(crate) fn natural(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let r = mass.nrows();
    let moves = |i: usize| mass[(i, i)] > 0.0 || (mass[(i, i)] == 0.0 && stiffness[(i, i)] > 0.0);
    if is_diagonal(mass) && is_diagonal(stiffness) && (0..r).all(moves) {
        return Some(natural_diagonal(&mass.diagonal(), &stiffness.diagonal()));
    }
    let ratio = |i: usize| stiffness[(i, i)] / mass[(i, i)];
    let mut ratios: Vec<f64> = (0..r).map(ratio).filter(|v| v.is_finite() && *v > 0.0).collect();
    ratios.sort_by(f64::total_cmp);
    // Negative shift, relative to the ratio of stiffness to mass, that makes the matrix of a
    // structure with free motions nonsingular.
    let shift = 1e-6 * ratios.get(ratios.len() / 2).copied().unwrap_or(1.0);
    let (thetas, mut shapes) = eigen::generalized_symmetric(mass, &(stiffness + mass * shift))?;
    let largest = thetas.iter().fold(0.0f64, |most, theta| most.max(theta.abs()));
    // Kinetic energy of a reduced mode relative to its stiffness, in units of the largest, below
    // which the mode has no frequency.
    let massless = |theta: f64| theta <= 1e-14 * largest;
    // Eigenvalues below this fraction of the shift are rounding of the stiffness, and the motion
    // is free. A nonzero frequency would damp the free motion by a meaningless ratio.
    let free = |value: f64| value.abs() <= 1e-9 * shift;
    let value = |theta: f64| match 1.0 / theta - shift {
        _ if massless(theta) => f64::INFINITY,
        value if free(value) => 0.0,
        value => value,
    };
    for (mut shape, &theta) in shapes.column_iter_mut().zip(&thetas) {
        shape /= if massless(theta) { 1.0 } else { theta.sqrt() };
    }
    // the largest θ has the lowest frequency
    let order: Vec<usize> = (0..r).rev().collect();
    Some((order.iter().map(|&k| value(thetas[k])).collect(), shapes.select_columns(&order)))
}

/// Solves the eigenvalue problem of uncoupled coordinates.
fn natural_diagonal(mass: &DVector<f64>, stiffness: &DVector<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let n = mass.len();
    let value = |i: usize| if mass[i] > 0.0 { stiffness[i] / mass[i] } else { f64::INFINITY };
    let size = |i: usize| if mass[i] > 0.0 { mass[i] } else { stiffness[i] }.sqrt();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| value(a).total_cmp(&value(b)));
    let mut shapes = DMatrix::zeros(n, n);
    order.iter().enumerate().for_each(|(k, &i)| shapes[(i, k)] = 1.0 / size(i));
    (order.into_iter().map(value).collect(), shapes)
}
