//! One reduction basis for a structure, the same structure with another stiffness, and all
//! between: `K + s (K₁ - K)` with s from 0 to 1.
//!
//! An example is a rotor at standstill and with the stiffness of rotation. The columns of the
//! reductions at both ends form one basis. It is compared with the whole structure at both ends
//! and between. Where the error is too large, the basis receives the columns of a reduction at
//! that point.
//!
//! Source: Balmès (1996), "Parametric families of reduced finite element models: theory and
//! applications", Mech. Syst. Signal Process. 10, 381-394.

use super::rubin::independent;
use super::{FullStructure, ReducedMatrices, ReductionDeviation, ReductionError, ReferenceReceptance};
use nalgebra::DMatrix;
use stickslip_numerics::sparse::{SparseMatrix, multi_vector};

/// A structure with both stiffnesses in the same coordinates.
#[derive(Debug, Clone)]
pub(in crate::structure) struct CommonBasis {
    /// With its own stiffness.
    pub own: ReducedMatrices,
    /// With the other stiffness.
    pub other: ReducedMatrices,
    /// Largest error at both ends and between, and its frequency.
    pub deviation: ReductionDeviation,
    /// Upper end of the frequency range in which the error holds, rad/s.
    pub up_to: f64,
}

impl FullStructure {
    /// Reduces the structure with a basis that also serves another stiffness and all between,
    /// with an error of at most `tolerance`.
    ///
    /// `reduce` returns a reduction and the frequency (rad/s) up to which it is intended.
    pub(in crate::structure) fn between(
        &self,
        there: &SparseMatrix,
        reduce: impl Fn(&FullStructure) -> Result<(ReducedMatrices, f64), ReductionError>,
        tolerance: f64,
    ) -> Result<CommonBasis, ReductionError> {
        // Values of s at which a basis is compared with the whole structure.
        let checked_fractions = [0.0, 0.25, 0.5, 0.75, 1.0];
        let n = self.dofs();
        if there.n() != n {
            return Err(ReductionError::Size { matrix: "other stiffness", rows: there.n(), n });
        }
        let wholes = checked_fractions.map(|share| self.with_share(there, share));
        let wholes: Vec<FullStructure> = wholes.into_iter().collect::<Result<_, _>>()?;
        let last = checked_fractions.len() - 1;
        let (mut vectors, mut up_to, mut taken) = (Vec::new(), f64::INFINITY, Vec::new());
        let mut take = |at: usize| -> Result<_, ReductionError> {
            let (reduced, own) = reduce(&wholes[at])?;
            vectors.extend_from_slice(reduced.columns().as_slice());
            up_to = own.min(up_to);
            taken.push(at);
            Ok((self.common(&vectors, up_to)?, up_to, taken.clone()))
        };
        take(0)?;
        let (mut basis, up_to, mut taken) = take(last)?;
        let mut references = Vec::new();
        for whole in &wholes {
            references.push(ReferenceReceptance::new(whole, &whole.modes(up_to)?, up_to)?);
        }
        loop {
            let kind = format!("a common basis of {} reductions for both stiffnesses", taken.len());
            let project = |whole: &FullStructure| ReducedMatrices::project(whole, kind.clone(), basis.clone());
            let mut worst = (ReductionDeviation { error: 0.0, omega: 0.0 }, 0);
            for (at, reference) in references.iter().enumerate() {
                let one = reference.deviation(&project(&wholes[at])?);
                if one.error > worst.0.error {
                    worst = (one, at);
                }
            }
            let (deviation, at) = worst;
            if deviation.error <= tolerance {
                let (own, other) = (
                    project(&wholes[0])?.scaled_to_metres().without_basis(),
                    project(&wholes[last])?.scaled_to_metres().without_basis(),
                );
                return Ok(CommonBasis { own, other, deviation, up_to });
            }
            if taken.contains(&at) {
                let (ReductionDeviation { error: best, omega: at }, dofs) = (deviation, basis.len() / n.max(1));
                return Err(ReductionError::ToleranceNotReached { best, at, dofs, tolerance });
            }
            (basis, _, taken) = take(at)?;
        }
    }

    /// Returns the structure with a fraction of the difference to another stiffness.
    fn with_share(&self, there: &SparseMatrix, share: f64) -> Result<FullStructure, ReductionError> {
        let own = self.stiffness.entries().map(|(row, column, value)| (row, column, (1.0 - share) * value));
        let other = there.entries().map(|(row, column, value)| (row, column, share * value));
        let stiffness =
            SparseMatrix::from_triplets(self.dofs(), own.chain(other)).map_err(|_| ReductionError::OutOfRange)?;
        FullStructure::new((*self.mass).clone(), self.damping.clone(), stiffness, self.ports.clone())
    }

    /// Returns independent combinations of columns.
    fn common(&self, vectors: &[f64], up_to: f64) -> Result<Vec<f64>, ReductionError> {
        let n = self.dofs();
        let mut energies = multi_vector::inner_products(n, vectors, &self.stiffness.multiply_columns(vectors));
        // free motions have kinetic energy only
        energies += multi_vector::inner_products(n, vectors, &self.mass.multiply_columns(vectors)) * (up_to * up_to);
        let all = energies.ncols();
        let weights = independent(&DMatrix::identity(all, all), &energies).ok_or(ReductionError::OutOfRange)?;
        Ok(multi_vector::combine(n, vectors, &weights))
    }
}
