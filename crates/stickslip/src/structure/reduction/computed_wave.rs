//! Modes, residual vectors and receptance of one wave of a ring.
//!
//! A complex wave `a + jb` has the real form `(a, b)`, in which every mode has the partner
//! `j (a + jb) = (-b, a)` of the same frequency. The unit force on the imaginary part of a port
//! has the response `j` times that on the real part. Partners split into the same columns `a` and
//! `b` of a sector, so that a basis needs one of each pair.

use super::{
    FullStructure, ModeSelection, ReductionError, ReductionKind, ReferenceReceptance, Row, residual_flexibility,
};
use crate::structure::sector_boundary::Blade;
use std::sync::Arc;
use stickslip_numerics::sparse::{NaturalModes, multi_vector};

/// A computed wave.
pub(super) struct ComputedWave {
    pub diameter: usize,
    pub whole: FullStructure,
    pub modes: NaturalModes,
    /// Multiple of the frequency of interest up to which modes are computed.
    pub extent: f64,
    /// None for a basis whose error is not computed.
    pub reference: Option<ReferenceReceptance>,
    residual: Option<ResidualVectors>,
}

/// Residual vectors of the ports, one of each pair of partners, order by order.
struct ResidualVectors {
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
        ComputedWave { diameter, whole, modes, extent, reference, residual: None }
    }

    /// Replaces the modes by those up to `extent` times the frequency of interest.
    pub fn set_modes(&mut self, modes: NaturalModes, extent: f64) {
        (self.modes, self.extent, self.residual) = (modes, extent, None);
    }

    /// Returns the modes and residual vectors, one of each pair of partners, by columns. The
    /// residual vectors have orders below `order`; they are kept for lower orders.
    pub fn vectors(
        &mut self,
        kind: ReductionKind,
        order: usize,
        sector_dofs: usize,
    ) -> Result<Vec<f64>, ReductionError> {
        if kind == ReductionKind::CraigBampton {
            let omega = self.modes.values.last().map_or(0.0, |value| value.max(0.0).sqrt());
            let wanted = ModeSelection::UpTo { value: omega * omega, most: super::MAX_MODES };
            return Ok(Arc::unwrap_or_clone(self.whole.fixed_interface(wanted)?.basis));
        }
        let count = self.whole.ports().len() * sector_dofs / self.whole.dofs();
        if self.residual.as_ref().is_none_or(|known| known.order < order) {
            // a request for more than the first order is followed by one for the third
            let order = if self.residual.is_some() { order.max(3) } else { order };
            let columns = self.residual_vectors(self.whole.ports()[..count].to_vec(), order)?;
            self.residual = Some(ResidualVectors { order, columns });
        }
        let mut vectors: Vec<f64> =
            self.single_modes(sector_dofs).into_iter().flat_map(|mode| self.modes.shape(mode)).copied().collect();
        let residual = self.residual.iter().flat_map(|known| &known.columns);
        vectors.extend(residual.take(count * order * self.whole.dofs()));
        Ok(vectors)
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
        let inside = self.modes.values.partition_point(|value| *value <= up_to * up_to);
        let moving = self.modes.rigid_body_count()..inside;
        let single = self.single_modes(sector_dofs).into_iter().filter(|mode| moving.contains(mode));
        let forces = single.map(|mode| -> Row {
            let parts = self.modes.shape(mode).chunks_exact(sector_dofs).flat_map(|part| blade.times(part));
            parts.enumerate().filter(|(_, force)| *force != 0.0).collect()
        });
        let forces: Vec<Row> = forces.filter(|row| !row.is_empty()).collect();
        if forces.is_empty() { Ok(Vec::new()) } else { self.residual_vectors(forces, order) }
    }

    fn residual_vectors(&self, ports: Vec<Row>, order: usize) -> Result<Vec<f64>, ReductionError> {
        let (mut basis, _) = residual_flexibility::basis(&self.whole.with_ports(ports)?, &self.modes, 0.0, order)?;
        Ok(basis.split_off(self.modes.shapes.len()))
    }

    /// Returns the indices of modes whose columns span those of all modes.
    fn single_modes(&self, sector_dofs: usize) -> Vec<usize> {
        let (n, count) = (self.whole.dofs(), self.modes.count());
        if n == sector_dofs {
            return (0..count).collect();
        }
        let partners: Vec<f64> = self
            .modes
            .shapes
            .chunks_exact(n)
            .flat_map(|shape| shape[sector_dofs..].iter().map(|b| -b).chain(shape[..sector_dofs].iter().copied()))
            .collect();
        let shares = multi_vector::inner_products(n, &self.whole.mass.multiply_columns(&partners), &self.modes.shapes);
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
