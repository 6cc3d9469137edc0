//! A tuned ring in travelling waves: what one sector does under harmonic forces, for all.

use super::hold::soft_spring;
use super::uncoupled::Resonant;
use crate::model::Cyclic;
use crate::structure::{DynamicStiffness, Sector, Structure, Wave, WaveStiffness, turn};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::Arc;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// A dynamic stiffness at a rate (1/s), made at a drive frequency (rad/s); singular at a resonance without damping.
#[derive(Debug, Clone)]
pub(super) struct Factored<F = DynamicStiffness> {
    pub rate: Complex64,
    pub omega: f64,
    pub factor: Result<Arc<F>, Resonant>,
}

/// The waves on a ring: one per nodal diameter that a harmonic has met.
#[derive(Debug, Clone)]
pub(super) struct Waves {
    pub cyclic: Cyclic,
    pub sector: Sector,
    met: RefCell<BTreeMap<usize, Result<Arc<Wave>, Resonant>>>,
    factors: RefCell<Vec<(usize, Factored<WaveStiffness>)>>,
}

impl Waves {
    pub fn new(structure: &Structure, cyclic: Cyclic) -> Option<Self> {
        let sector = Sector::of(structure, cyclic.sectors)?;
        Some(Waves { cyclic, sector, met: RefCell::default(), factors: RefCell::default() })
    }

    /// Displacements of the first sector in a wave under complex forces on it, in place, columns one after the other.
    fn solve(&self, diameter: usize, (s, omega): (Complex64, f64), loads: &mut [Complex64]) -> Result<(), Resonant> {
        self.factor(diameter, s, omega)?.solve(loads);
        Ok(())
    }

    /// Kept as long as the drive frequency stays.
    fn factor(&self, diameter: usize, s: Complex64, omega: f64) -> Result<Arc<WaveStiffness>, Resonant> {
        let mut factors = self.factors.borrow_mut();
        factors.retain(|(_, kept)| kept.omega == omega);
        if let Some((_, kept)) = factors.iter().find(|(d, kept)| *d == diameter && kept.rate == s) {
            return kept.factor.clone();
        }
        let mut met = self.met.borrow_mut();
        let wave = met
            .entry(diameter)
            .or_insert_with(|| self.sector.wave(diameter).map(Arc::new).map_err(|_| Resonant))
            .clone()?;
        let factor = wave.dynamic_stiffness(s, soft_spring(s, omega)).map(Arc::new).map_err(|_| Resonant);
        factors.push((diameter, Factored { rate: s, omega, factor: factor.clone() }));
        factor
    }

    /// `Wᴴ` in a wave: forces on the first sector under unit forces along the axes of its joints and, with their lag, of its neighbours', n × q.
    fn columns(&self, diameter: usize, directions: &[Vec<(usize, f64)>]) -> DMatrix<Complex64> {
        let n = self.sector.dofs();
        let mut columns = DMatrix::from_element(n, directions.len(), ZERO);
        for (q, rows) in directions.iter().enumerate() {
            rows.iter().for_each(|&(i, w)| columns[(i % n, q)] += self.phase(diameter, i / n).conj() * w);
        }
        columns
    }

    fn phase(&self, diameter: usize, sector: usize) -> Complex64 {
        turn((diameter * sector) as i64, self.cyclic.sectors)
    }

    pub fn receptance(
        &self,
        diameter: usize,
        at: (Complex64, f64),
        directions: &[Vec<(usize, f64)>],
    ) -> Result<DMatrix<Complex64>, Resonant> {
        let columns = self.columns(diameter, directions);
        let mut moved = columns.clone();
        self.solve(diameter, at, moved.as_mut_slice())?;
        Ok(columns.adjoint() * moved)
    }

    /// Displacements along the axes under unit forces along each alone, without its neighbours': the mean of all waves. At a real rate.
    pub fn own(&self, (rate, omega): (f64, f64), directions: &[Vec<(usize, f64)>]) -> Result<Vec<f64>, Resonant> {
        let sectors = self.cyclic.sectors;
        let mut own = vec![0.0; directions.len()];
        for diameter in 0..=sectors / 2 {
            // a wave the other way around is as stiff
            let both = if (2 * diameter).is_multiple_of(sectors) { 1.0 } else { 2.0 };
            let receptance = self.receptance(diameter, (Complex64::new(rate, 0.0), omega), directions)?;
            own.iter_mut().enumerate().for_each(|(q, own)| *own += both * receptance[(q, q)].re / sectors as f64);
        }
        Ok(own)
    }

    /// Displacements of the ring under forces on it that travel.
    pub fn respond(
        &self,
        diameter: usize,
        at: (Complex64, f64),
        force: &DVector<Complex64>,
    ) -> Result<DVector<Complex64>, Resonant> {
        let n = self.sector.dofs();
        let mut one = force.as_slice()[..n].to_vec();
        self.solve(diameter, at, &mut one)?;
        let phases: Vec<Complex64> = (0..self.cyclic.sectors).map(|k| self.phase(diameter, k)).collect();
        Ok(DVector::from_fn(force.len(), |i, _| one[i % n] * phases[i / n]))
    }
}
