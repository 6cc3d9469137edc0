//! Dynamic stiffness that is factored at every frequency.

use super::harmonic_dynamics::{Directions, HarmonicDynamics, columns, diagonal, rate};
use super::uncoupled_modes::UndampedResonance;
use crate::method::harmonic_balance::equations::regularization::regularizing_stiffness;
use crate::structure::{DynamicStiffness, Structure};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::cell::RefCell;
use std::sync::Arc;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Limits of kept factors.
#[derive(Debug, Clone, Copy)]
struct FactoredSettings {
    /// Number of right sides that a factor solves at once.
    right_sides: usize,
    /// Memory limit of kept factors, bytes. Measured: 1.7 GB for each harmonic of a block of
    /// 60,000 degrees of freedom, 11.5 GB in all with five harmonics and an estimate of their
    /// error. A discarded factor is computed again when needed.
    factor_bytes: usize,
    /// Memory limit of kept motions under unit forces, bytes. Measured: 54 MB for each harmonic of
    /// a blade of 69,930 rows with 16 contacts of three directions, whose factors take 1.3 GB.
    response_bytes: usize,
}

impl Default for FactoredSettings {
    fn default() -> Self {
        FactoredSettings { right_sides: 64, factor_bytes: 2_000_000_000, response_bytes: 1_000_000_000 }
    }
}

/// Factored dynamic stiffness at a complex rate (1/s), for an excitation frequency (rad/s). It
/// is singular at a resonance without damping.
#[derive(Debug, Clone)]
pub(super) struct FactoredStiffness<F = DynamicStiffness> {
    pub rate: Complex64,
    pub omega: f64,
    pub factor: Result<Arc<F>, UndampedResonance>,
}

/// Displacements of all places at a rate (1/s) and an excitation frequency (rad/s): n × q, one
/// column for a unit force along each axis.
#[derive(Debug, Clone)]
struct UnitResponses {
    rate: Complex64,
    omega: f64,
    columns: Arc<DMatrix<Complex64>>,
}

/// A large or sparse structure, or one with massless places.
#[derive(Debug, Clone)]
pub(super) struct FactoredDynamics {
    structure: Structure,
    directions: Directions,
    /// Factors at the last excitation frequency, by rate.
    factors: RefCell<Vec<FactoredStiffness>>,
    /// Motions under unit forces at that frequency, by rate. They take less memory than the
    /// factors, and save a second factorization.
    unit_responses: RefCell<Vec<UnitResponses>>,
}

impl FactoredDynamics {
    pub fn new(structure: &Structure, directions: &Directions) -> Self {
        FactoredDynamics {
            structure: structure.clone(),
            directions: directions.clone(),
            factors: RefCell::default(),
            unit_responses: RefCell::default(),
        }
    }

    /// Factors the dynamic stiffness. Factors of one excitation frequency are kept, up to the
    /// memory limit.
    fn factor(&self, s: Complex64, omega: f64) -> Result<Arc<DynamicStiffness>, UndampedResonance> {
        let settings = FactoredSettings::default();
        let mut factors = self.factors.borrow_mut();
        factors.retain(|kept| kept.omega == omega);
        if let Some(kept) = factors.iter().find(|kept| kept.rate == s) {
            return kept.factor.clone();
        }
        let factor = self
            .structure
            .shifted_dynamic_stiffness(s, regularizing_stiffness(s, omega))
            .map(Arc::new)
            .map_err(|_| UndampedResonance);
        let bytes =
            |factor: &Result<Arc<DynamicStiffness>, UndampedResonance>| factor.as_ref().map_or(0, |f| f.bytes());
        while !factors.is_empty()
            && factors.iter().map(|kept| bytes(&kept.factor)).sum::<usize>() + bytes(&factor) > settings.factor_bytes
        {
            factors.remove(0);
        }
        factors.push(FactoredStiffness { rate: s, omega, factor: factor.clone() });
        factor
    }

    /// Returns the motions under unit forces, if they are kept.
    fn kept_unit_responses(&self, s: Complex64, omega: f64) -> Option<Arc<DMatrix<Complex64>>> {
        let moved = self.unit_responses.borrow();
        moved.iter().find(|kept| kept.omega == omega && kept.rate == s).map(|kept| kept.columns.clone())
    }

    /// Passes the motion under a unit force along each axis to `take`. Keeps the motions if
    /// memory allows.
    fn for_each_unit_response(
        &self,
        s: Complex64,
        omega: f64,
        mut take: impl FnMut(usize, &[Complex64]),
    ) -> Result<(), UndampedResonance> {
        let settings = FactoredSettings::default();
        let n = self.structure.dofs();
        let mut hand = |from: usize, columns: &DMatrix<Complex64>| {
            (0..columns.ncols()).for_each(|b| take(from + b, &columns.as_slice()[b * n..(b + 1) * n]));
        };
        if let Some(columns) = self.kept_unit_responses(s, omega) {
            hand(0, &columns);
            return Ok(());
        }
        let factor = self.factor(s, omega)?;
        let solved = |some: &[Vec<(usize, f64)>]| {
            let mut columns = columns(n, some).map(|w| Complex64::new(w, 0.0));
            factor.solve(columns.as_mut_slice());
            columns
        };
        let mut kept = self.unit_responses.borrow_mut();
        kept.retain(|kept| kept.omega == omega);
        let bytes = size_of::<Complex64>() * n * self.directions.len();
        if (kept.len() + 1) * bytes <= settings.response_bytes {
            let columns = Arc::new(solved(&self.directions));
            hand(0, &columns);
            kept.push(UnitResponses { rate: s, omega, columns });
        } else {
            // in groups: all at once would fill the memory
            let some = self.directions.chunks(settings.right_sides).enumerate();
            some.for_each(|(number, some)| hand(number * settings.right_sides, &solved(some)));
        }
        Ok(())
    }

    fn receptance_at(&self, s: Complex64, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        let q = self.directions.len();
        let mut receptance = DMatrix::from_element(q, q, ZERO);
        self.for_each_unit_response(s, omega, |b, moved| {
            for (a, rows) in self.directions.iter().enumerate() {
                receptance[(a, b)] = rows.iter().map(|&(i, w)| moved[i] * w).sum();
            }
        })?;
        Ok(receptance)
    }
}

impl HarmonicDynamics for FactoredDynamics {
    fn receptance(&self, harmonic: usize, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        self.receptance_at(rate(harmonic, omega), omega)
    }

    fn respond(
        &self,
        harmonic: usize,
        omega: f64,
        force: &DVector<Complex64>,
    ) -> Result<DVector<Complex64>, UndampedResonance> {
        let mut x = force.clone();
        self.factor(rate(harmonic, omega), omega)?.solve(x.as_mut_slice());
        Ok(x)
    }

    fn static_receptances(&self, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        let mut own = vec![0.0; self.directions.len()];
        self.for_each_unit_response(ZERO, omega, |q, moved| {
            own[q] = self.directions[q].iter().map(|&(i, w)| moved[i] * w).sum::<Complex64>().norm();
        })?;
        Ok(own)
    }

    fn direct_receptances(&self, rate: f64, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        Ok(diagonal(&self.receptance_at(Complex64::new(rate, 0.0), omega)?))
    }

    fn known_unit_responses(&self, harmonic: usize, omega: f64) -> Option<Arc<DMatrix<Complex64>>> {
        self.kept_unit_responses(rate(harmonic, omega), omega)
    }
}
