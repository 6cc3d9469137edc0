//! Modes, residual vectors and receptance of one wave of a ring.
//!
//! A complex wave `a + jb` has the real form `(a, b)`, in which every mode has the partner
//! `j (a + jb) = (-b, a)` of the same frequency. The unit force on the imaginary part of a port
//! has the response `j` times that on the real part. Partners split into the same columns `a` and
//! `b` of a sector, so that a basis needs one of each pair.

use super::{FullStructure, ModeSelection, ReductionError, ReferenceReceptance, Row, residual_flexibility};
use crate::structure::sector_boundary::Blade;
use std::sync::Arc;
use stickslip_numerics::sparse::{NaturalModes, multi_vector};

/// A computed wave.
pub(super) struct ComputedWave {
    pub diameter: usize,
    /// The matrices; none while they are not needed.
    pub whole: Option<FullStructure>,
    pub modes: NaturalModes,
    /// Multiple of the frequency of interest up to which modes are computed.
    pub extent: f64,
    /// None for a basis whose error is not computed.
    pub reference: Option<ReferenceReceptance>,
    vectors: Option<WaveVectors>,
}

/// Modes and residual vectors of the ports, one of each pair of partners, by columns.
struct WaveVectors {
    /// Number of modes.
    modes: usize,
    /// Number of residual vectors of each order.
    ports: usize,
    /// Number of orders.
    order: usize,
    columns: Vec<f64>,
}

impl ComputedWave {
    /// Creates a wave with its modes up to a multiple of the frequency of interest.
    pub fn new(
        diameter: usize,
        whole: FullStructure,
        (modes, extent): (NaturalModes, f64),
        reference: Option<ReferenceReceptance>,
    ) -> Self {
        ComputedWave { diameter, whole: Some(whole), modes, extent, reference, vectors: None }
    }

    /// Replaces the modes by those up to `extent` times the frequency of interest.
    pub fn set_modes(&mut self, modes: NaturalModes, extent: f64) {
        (self.modes, self.extent, self.vectors) = (modes, extent, None);
    }

    /// Returns the matrices, which `make` computes if they are not stored.
    pub fn whole(
        &mut self,
        make: impl FnOnce(usize) -> Result<FullStructure, ReductionError>,
    ) -> Result<&FullStructure, ReductionError> {
        if self.whole.is_none() {
            self.whole = Some(make(self.diameter)?);
        }
        self.whole.as_ref().ok_or(ReductionError::NoPorts)
    }

    /// Returns whether [`ComputedWave::vectors`] needs no matrices.
    pub fn has_vectors(&self, order: usize) -> bool {
        self.vectors.as_ref().is_some_and(|known| known.order >= order)
    }

    /// Returns the modes and residual vectors of orders below `order`, one of each pair of
    /// partners, by columns. They are kept for lower orders. `sector_dofs` is the number of rows of
    /// a sector.
    pub fn vectors(&mut self, order: usize, sector_dofs: usize) -> Result<&[f64], ReductionError> {
        if self.vectors.as_ref().is_none_or(|known| known.order < order) {
            let whole = self.whole.as_ref().ok_or(ReductionError::NoPorts)?;
            let single = self.single_modes(whole, sector_dofs);
            let mut columns: Vec<f64> = single.iter().flat_map(|&mode| self.modes.shape(mode)).copied().collect();
            let ports = whole.ports().len() * sector_dofs / whole.dofs();
            columns.extend(self.residual_vectors(whole, whole.ports()[..ports].to_vec(), order)?);
            self.vectors = Some(WaveVectors { modes: single.len(), ports, order, columns });
        }
        let known = self.vectors.as_ref().ok_or(ReductionError::NoPorts)?;
        let length = known.columns.len() / (known.modes + known.ports * known.order).max(1);
        Ok(&known.columns[..length * (known.modes + known.ports * order)])
    }

    /// Returns the basis of Craig and Bampton, by columns.
    pub fn craig_bampton(&self) -> Result<Vec<f64>, ReductionError> {
        let whole = self.whole.as_ref().ok_or(ReductionError::NoPorts)?;
        let omega = self.modes.values.last().map_or(0.0, |value| value.max(0.0).sqrt());
        let wanted = ModeSelection::UpTo { value: omega * omega, most: super::MAX_MODES };
        Ok(Arc::unwrap_or_clone(whole.fixed_interface(wanted)?.basis))
    }

    /// Returns residual vectors for the forces of a deviating blade, in the modes up to a
    /// frequency, rad/s.
    pub fn blade_vectors(
        &self,
        blade: &Blade,
        up_to: f64,
        order: usize,
        sector_dofs: usize,
    ) -> Result<Vec<f64>, ReductionError> {
        let whole = self.whole.as_ref().ok_or(ReductionError::NoPorts)?;
        let inside = self.modes.values.partition_point(|value| *value <= up_to * up_to);
        let moving = self.modes.rigid_body_count()..inside;
        let single = self.single_modes(whole, sector_dofs).into_iter().filter(|mode| moving.contains(mode));
        let forces = single.map(|mode| -> Row {
            let parts = self.modes.shape(mode).chunks_exact(sector_dofs).flat_map(|part| blade.times(part));
            parts.enumerate().filter(|(_, force)| *force != 0.0).collect()
        });
        let forces: Vec<Row> = forces.filter(|row| !row.is_empty()).collect();
        if forces.is_empty() { Ok(Vec::new()) } else { self.residual_vectors(whole, forces, order) }
    }

    fn residual_vectors(
        &self,
        whole: &FullStructure,
        ports: Vec<Row>,
        order: usize,
    ) -> Result<Vec<f64>, ReductionError> {
        let (mut basis, _) = residual_flexibility::basis(&whole.with_ports(ports)?, &self.modes, 0.0, order)?;
        Ok(basis.split_off(self.modes.shapes.len()))
    }

    /// Returns the indices of modes whose columns span those of all modes.
    fn single_modes(&self, whole: &FullStructure, sector_dofs: usize) -> Vec<usize> {
        let (n, count) = (whole.dofs(), self.modes.count());
        if n == sector_dofs {
            return (0..count).collect();
        }
        let partners: Vec<f64> = self
            .modes
            .shapes
            .chunks_exact(n)
            .flat_map(|shape| shape[sector_dofs..].iter().map(|b| -b).chain(shape[..sector_dofs].iter().copied()))
            .collect();
        let shares = multi_vector::inner_products(n, &whole.mass.multiply_columns(&partners), &self.modes.shapes);
        let mut single: Vec<usize> = Vec::new();
        for mode in 0..count {
            // A mode is left out if this fraction of its square is in partners of the others. It
            // is one up to rounding for simple pairs. Two pairs of equal frequency are mixed, and
            // then all but a few of their four modes stay.
            if single.iter().map(|&other| shares[(other, mode)].powi(2)).sum::<f64>() < 0.99 {
                single.push(mode);
            }
        }
        single
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::structure::reduction::StructureDamping;
    use nalgebra::DMatrix;
    use stickslip_numerics::sparse::SparseMatrix;

    /// Half of the modes span the motions of a sector, also if pairs have the same frequency.
    #[test]
    fn one_mode_of_each_pair_is_enough() {
        let n = 3;
        for squares in [[1.0, 4.0, 9.0], [1.0, 1.0, 9.0], [2.0, 2.0, 2.0]] {
            let diagonal = |value: &dyn Fn(usize) -> f64| {
                SparseMatrix::from_triplets(2 * n, (0..2 * n).map(|i| (i, i, value(i)))).unwrap()
            };
            let damping = StructureDamping::Rayleigh { mass: 0.0, stiffness: 0.0 };
            let stiffness = diagonal(&|i| squares[i % n]);
            let whole = FullStructure::new(diagonal(&|_| 1.0), damping, stiffness, vec![vec![(0, 1.0)]]).unwrap();
            let modes = whole.lowest_modes(2 * n).unwrap();
            let wave = ComputedWave::new(1, whole.clone(), (modes, 1.0), None);
            let single = wave.single_modes(&whole, n);
            let columns: Vec<f64> = single.iter().flat_map(|&mode| wave.modes.shape(mode)).copied().collect();
            let rank = DMatrix::from_column_slice(n, columns.len() / n, &columns).rank(1e-6);
            assert!(rank == n && single.len() < 2 * n, "{squares:?}: {single:?}");
        }
    }
}
