//! A structure by its matrices that rotation stiffens: `K + (Ω/Ω₁)² (K₁ - K)`, of two exports, one of them prestressed at the speed Ω₁.
//!
//! The stress of rotation grows with the square of the speed, and what it adds to the stiffness in proportion to it. So does what rotation takes
//! away (spin softening), so that one export may have both.

use std::sync::{Arc, Mutex, PoisonError};
use stickslip::structure::{Component, StructureError};
use stickslip_numerics::sparse::{Matrix, MatrixError};

/// Components at so many speeds are kept: reductions belong to a component, and cases at one speed share it.
const KEPT: usize = 16;

/// Both exports of a study's structure.
#[derive(Debug, Clone)]
pub struct Exports {
    /// At rest.
    pub rest: Component,
    /// The stiffness at a speed, N/m.
    pub there: Matrix,
    /// That speed, rad/s.
    pub at: f64,
    /// The speed of the study, as its file states it.
    pub speed: String,
}

/// What the second export has more.
#[derive(Debug, Clone)]
pub(crate) struct Stiffened {
    more: Matrix,
    /// By the bits of the share.
    kept: Arc<Mutex<Vec<(u64, Component)>>>,
}

impl Stiffened {
    /// From the stiffness at rest and at the speed of the second export.
    pub fn new(rest: &Matrix, there: &Matrix) -> Result<Self, MatrixError> {
        let less = rest.entries().map(|(row, column, value)| (row, column, -value));
        let more = Matrix::from_triplets(rest.n(), there.entries().chain(less))?;
        Ok(Stiffened { more, kept: Arc::default() })
    }

    /// The component with this share, `(Ω/Ω₁)²`, of what the second export has more.
    pub fn at(&self, component: &Component, share: f64) -> Result<Component, StructureError> {
        if share == 0.0 {
            return Ok(component.clone());
        }
        let bits = share.to_bits();
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = kept.iter().find(|(of, _)| *of == bits) {
            return Ok(found.clone());
        }
        let (mass, damping, rest) = component.matrices();
        let more = self.more.entries().map(|(row, column, value)| (row, column, share * value));
        // entries of both lie inside, and their sums are as finite as the share
        let stiffness = Matrix::from_triplets(rest.n(), rest.entries().chain(more)).map_err(|_| not_finite(share))?;
        let found = Component::new(component.rows().to_vec(), mass.clone(), damping.cloned(), stiffness)?;
        if kept.len() == KEPT {
            kept.remove(0);
        }
        kept.push((bits, found.clone()));
        Ok(found)
    }

    /// The entries that it adds.
    pub fn more(&self) -> &Matrix {
        &self.more
    }
}

fn not_finite(value: f64) -> StructureError {
    StructureError::NotFinite { matrix: "stiffness", row: 1, column: 1, value }
}
