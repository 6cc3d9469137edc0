//! Stress stiffening of a rotating structure: `K + (Ω/Ω₁)² (K₁ - K)` from two exports, one
//! prestressed at the speed Ω₁.
//!
//! The stress of rotation grows with the square of the speed, and the added stiffness is
//! proportional to the stress. Spin softening also grows with the square of the speed, so one
//! export may include both.

use std::sync::{Arc, Mutex, PoisonError};
use stickslip::structure::{Component, StructureError};
use stickslip_numerics::sparse::{MatrixError, SparseMatrix};

/// Both exports of a study's structure.
#[derive(Debug, Clone)]
pub struct StiffnessExports {
    /// The structure at rest.
    pub at_rest: Component,
    /// The stiffness at the speed `export_speed`, N/m.
    pub at_speed: SparseMatrix,
    /// The speed of the second export, rad/s.
    pub export_speed: f64,
    /// The speed of the study, as its file states it.
    pub speed: String,
}

/// Difference between the stiffness of the second export and that at rest.
#[derive(Debug, Clone)]
pub(crate) struct StressStiffening {
    difference: SparseMatrix,
    /// Components by the bits of their factor `(Ω/Ω₁)²`.
    cache: Arc<Mutex<Vec<(u64, Component)>>>,
}

impl StressStiffening {
    /// Computes the difference from the stiffness at rest and that at the speed of the second
    /// export.
    pub fn new(rest: &SparseMatrix, there: &SparseMatrix) -> Result<Self, MatrixError> {
        let less = rest.entries().map(|(row, column, value)| (row, column, -value));
        let more = SparseMatrix::from_triplets(rest.n(), there.entries().chain(less))?;
        Ok(StressStiffening { difference: more, cache: Arc::default() })
    }

    /// Returns the component with `share` times the difference added, where `share` is
    /// `(Ω/Ω₁)²`.
    pub fn component_at(&self, component: &Component, share: f64) -> Result<Component, StructureError> {
        if share == 0.0 {
            return Ok(component.clone());
        }
        let bits = share.to_bits();
        let mut kept = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = kept.iter().find(|(of, _)| *of == bits) {
            return Ok(found.clone());
        }
        let (mass, damping, rest) = component.matrices();
        let more = self.difference.entries().map(|(row, column, value)| (row, column, share * value));
        // both matrices have the same size, so only a factor that is not finite can fail here
        let stiffness =
            SparseMatrix::from_triplets(rest.n(), rest.entries().chain(more)).map_err(|_| not_finite(share))?;
        let found = Component::new(component.rows().to_vec(), mass.clone(), damping.cloned(), stiffness)?;
        found.keep_reductions_like(component);
        // Number of components that are kept, one per speed. Reductions belong to a component,
        // and cases at the same speed share it.
        if kept.len() == 16 {
            kept.remove(0);
        }
        kept.push((bits, found.clone()));
        Ok(found)
    }

    /// Returns the difference of the two stiffness matrices.
    pub fn difference(&self) -> &SparseMatrix {
        &self.difference
    }
}

fn not_finite(value: f64) -> StructureError {
    StructureError::NotFinite { matrix: "stiffness", row: 1, column: 1, value }
}
