//! Dynamic stiffness of a tuned ring in travelling waves, from one sector.

use super::factored::FactoredStiffness;
use super::harmonic_dynamics::{Directions, HarmonicDynamics, diagonal, rate};
use super::uncoupled_modes::UndampedResonance;
use crate::method::harmonic_balance::equations::regularization::regularizing_stiffness;
use crate::model::CyclicSymmetry;
use crate::structure::{RingSector, Structure, WaveStiffness, unit_root};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::cell::RefCell;
use std::sync::Arc;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Waves on a ring, with the factors of the present excitation frequency.
#[derive(Debug, Clone)]
pub(super) struct TravellingWaves {
    pub cyclic: CyclicSymmetry,
    pub sector: Arc<RingSector>,
    directions: Directions,
    factors: RefCell<Vec<(usize, FactoredStiffness<WaveStiffness>)>>,
}

impl TravellingWaves {
    pub fn new(structure: &Structure, cyclic: CyclicSymmetry, directions: &Directions) -> Option<Self> {
        let sector = structure.ring_sector(cyclic.sectors)?;
        Some(TravellingWaves { cyclic, sector, directions: directions.clone(), factors: RefCell::default() })
    }

    /// Returns the waves of the ring with springs along the axes of every sector, N/m. Returns
    /// `None` if an entry is then not finite.
    pub fn with_springs(&self, springs: &[f64]) -> Option<Self> {
        let sector = Arc::new(self.sector.with_springs(self.directions.iter().zip(springs.iter().copied()))?);
        Some(TravellingWaves { sector, directions: self.directions.clone(), factors: RefCell::default(), ..*self })
    }

    /// Replaces complex forces on the first sector by its displacements in a wave, column by
    /// column.
    fn solve(
        &self,
        diameter: usize,
        (s, omega): (Complex64, f64),
        loads: &mut [Complex64],
    ) -> Result<(), UndampedResonance> {
        self.factor(diameter, s, omega)?.solve(loads);
        Ok(())
    }

    /// Returns the factored dynamic stiffness. It is kept until the excitation frequency
    /// changes.
    fn factor(&self, diameter: usize, s: Complex64, omega: f64) -> Result<Arc<WaveStiffness>, UndampedResonance> {
        let mut factors = self.factors.borrow_mut();
        factors.retain(|(_, kept)| kept.omega == omega);
        if let Some((_, kept)) = factors.iter().find(|(d, kept)| *d == diameter && kept.rate == s) {
            return kept.factor.clone();
        }
        let wave = self.sector.wave(diameter).map_err(|_| UndampedResonance)?;
        let factor =
            wave.dynamic_stiffness(s, regularizing_stiffness(s, omega)).map(Arc::new).map_err(|_| UndampedResonance);
        factors.push((diameter, FactoredStiffness { rate: s, omega, factor: factor.clone() }));
        factor
    }

    /// Returns `Wᴴ` in a wave, n × q: the forces on the first sector under unit forces along
    /// the axes of its joints. Rows of neighbouring sectors enter with their phase.
    fn columns(&self, diameter: usize) -> DMatrix<Complex64> {
        let n = self.sector.dofs();
        let mut columns = DMatrix::from_element(n, self.directions.len(), ZERO);
        for (q, rows) in self.directions.iter().enumerate() {
            rows.iter().for_each(|&(i, w)| columns[(i % n, q)] += self.phase(diameter, i / n).conj() * w);
        }
        columns
    }

    /// Returns the phase of a sector in a wave.
    fn phase(&self, diameter: usize, sector: usize) -> Complex64 {
        unit_root((diameter * sector) as i64, self.cyclic.sectors)
    }

    /// Returns the receptance of the axes in a wave, q × q.
    fn wave_receptance(&self, diameter: usize, at: (Complex64, f64)) -> Result<DMatrix<Complex64>, UndampedResonance> {
        let columns = self.columns(diameter);
        let mut moved = columns.clone();
        self.solve(diameter, at, moved.as_mut_slice())?;
        Ok(columns.adjoint() * moved)
    }
}

impl HarmonicDynamics for TravellingWaves {
    fn receptance(&self, harmonic: usize, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        self.wave_receptance(self.cyclic.diameter(harmonic), (rate(harmonic, omega), omega))
    }

    fn respond(
        &self,
        harmonic: usize,
        omega: f64,
        force: &DVector<Complex64>,
    ) -> Result<DVector<Complex64>, UndampedResonance> {
        let (n, diameter) = (self.sector.dofs(), self.cyclic.diameter(harmonic));
        let mut one = force.as_slice()[..n].to_vec();
        self.solve(diameter, (rate(harmonic, omega), omega), &mut one)?;
        let phases: Vec<Complex64> = (0..self.cyclic.sectors).map(|k| self.phase(diameter, k)).collect();
        Ok(DVector::from_fn(force.len(), |i, _| one[i % n] * phases[i / n]))
    }

    /// With the same force on all sectors.
    fn static_receptances(&self, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        Ok(diagonal(&self.wave_receptance(0, (ZERO, omega))?))
    }

    /// Without forces on the other sectors: the mean over all waves.
    fn direct_receptances(&self, rate: f64, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        let sectors = self.cyclic.sectors;
        let mut own = vec![0.0; self.directions.len()];
        for diameter in 0..=sectors / 2 {
            // a wave and its reverse have the same stiffness
            let both = if (2 * diameter).is_multiple_of(sectors) { 1.0 } else { 2.0 };
            let receptance = self.wave_receptance(diameter, (Complex64::new(rate, 0.0), omega))?;
            own.iter_mut().enumerate().for_each(|(q, own)| *own += both * receptance[(q, q)].re / sectors as f64);
        }
        Ok(own)
    }
}
