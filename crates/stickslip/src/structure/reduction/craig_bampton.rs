//! Craig-Bampton reduction: modes with fixed ports, and static responses to unit displacements
//! of the ports.
//!
//! The degrees of freedom of the ports (`b`) are retained. The others (`i`) are
//! `x_i = Φ q + Ψ x_b` with the modes Φ of `(K_ii, M_ii)` and `Ψ = -K_ii⁻¹ K_ib`. The static
//! response is exact for any number of modes.
//!
//! Source: Craig and Bampton (1968), "Coupling of substructures for dynamic analyses".

use super::{FullStructure, MAX_MODES, ReducedMatrices, ReductionError};
use stickslip_numerics::sparse::{ModeSelection, NaturalModes, SparseMatrix, SymbolicAnalysis};

impl FullStructure {
    /// Reduces the structure to the degrees of freedom of its ports and all fixed-interface
    /// modes up to `omega` (rad/s).
    ///
    /// # Errors
    /// [`ReductionError`]: free motions remain with fixed ports, or the mode computation fails.
    pub fn craig_bampton(&self, omega: f64) -> Result<ReducedMatrices, ReductionError> {
        self.fixed_interface(ModeSelection::UpTo { value: omega * omega, most: MAX_MODES })
    }

    /// Reduces the structure with the modes that `wanted` specifies.
    pub(in crate::structure) fn fixed_interface(
        &self,
        wanted: ModeSelection,
    ) -> Result<ReducedMatrices, ReductionError> {
        let n = self.dofs();
        let mut boundary: Vec<usize> = self.ports.iter().flatten().map(|(at, _)| *at).collect();
        boundary.sort_unstable();
        boundary.dedup();
        // row numbers with the interior first
        let interior: Vec<usize> = (0..n).filter(|i| boundary.binary_search(i).is_err()).collect();
        let mut row = vec![usize::MAX; n];
        interior.iter().enumerate().for_each(|(at, &i)| row[i] = at);
        let part = |matrix: &SparseMatrix| {
            let inner = matrix.entries().filter(|(i, k, _)| row[*i] != usize::MAX && row[*k] != usize::MAX);
            SparseMatrix::from_triplets(interior.len(), inner.map(|(i, k, v)| (row[i], row[k], v)))
        };
        let out_of_range = |_| ReductionError::OutOfRange;
        let stiffness = part(&self.stiffness).map_err(out_of_range)?;
        let mass = part(&self.mass).map_err(out_of_range)?;
        let analysis = SymbolicAnalysis::new(&[&stiffness, &mass]);
        let modes = NaturalModes::new(&analysis, &stiffness, &mass, wanted)?;
        if modes.rigid_body_count() > 0 {
            return Err(ReductionError::FreeInterfaceMotion { count: modes.rigid_body_count() });
        }
        let (inner, outer) = (interior.len(), boundary.len());
        let mut answers = vec![0.0; inner * outer];
        for (k, &column) in boundary.iter().enumerate() {
            for (i, value) in self.stiffness.column(column).filter(|(i, _)| row[*i] != usize::MAX) {
                answers[k * inner + row[i]] = -value;
            }
        }
        let factor = analysis.factor(&[(1.0, &stiffness)]);
        factor.map_err(|_| ReductionError::FreeInterfaceMotion { count: 1 })?.solve(&mut answers);
        let mut basis = vec![0.0; n * (modes.count() + outer)];
        for k in 0..modes.count() + outer {
            let column = &mut basis[k * n..(k + 1) * n];
            let from = match k.checked_sub(modes.count()) {
                None => modes.shape(k),
                Some(answer) => {
                    column[boundary[answer]] = 1.0;
                    &answers[answer * inner..(answer + 1) * inner]
                }
            };
            interior.iter().zip(from).for_each(|(&i, x)| column[i] = *x);
        }
        let count = modes.count();
        let word = if count == 1 { "mode" } else { "modes" };
        ReducedMatrices::project(
            self,
            format!("Craig-Bampton: {count} fixed-interface {word}, {outer} interface degrees of freedom"),
            basis,
        )
    }
}
