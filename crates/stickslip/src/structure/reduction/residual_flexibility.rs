//! Residual vectors of any order: the response of the omitted modes at the ports.
//!
//! It is a power series in λ around σ,
//!
//! `Σ φ φᵀ F / (λₖ - λ) = Σⱼ (λ - σ)ʲ Xⱼ`, `X₀ = R F`, `Xⱼ₊₁ = R M Xⱼ`, where `R = (K - σM)⁻¹`
//! without the retained modes.
//!
//! `X₀` at σ = 0 is the residual flexibility. If the structure has free motions, `K⁻¹` does not
//! exist. Then the inertia of these motions makes the forces self-equilibrated, and one degree
//! of freedom per free motion is fixed. The reaction forces are zero, so that springs of any
//! stiffness can fix them.
//!
//! Sources: MacNeal (1971), "A hybrid method of component mode synthesis"; Rubin (1975),
//! "Improved component-mode representation for structural dynamic analysis"; Hansteen and Bell
//! (1979), "On the accuracy of mode superposition analysis in structural dynamics"; Dickens,
//! Nakagawa and Wittbrodt (1997), "A critique of mode acceleration and modal truncation
//! augmentation methods for modal response analysis".

use super::{COLUMN_BLOCK, FullStructure, ReductionError};
use stickslip_numerics::interrupt;
use stickslip_numerics::sparse::{LdlFactor, NaturalModes, SparseMatrix, multi_vector};

/// Returns the modes and the blocks `X₀, …` up to `order`, n × (k + p J), and the shift,
/// rad²/s². The modes are projected out of the blocks.
pub(super) fn basis(
    whole: &FullStructure,
    modes: &NaturalModes,
    shift: f64,
    order: usize,
) -> Result<(Vec<f64>, f64), ReductionError> {
    let (n, ports) = (whole.dofs(), whole.ports().len());
    let (factor, shift) = factor(whole, modes, shift)?;
    let heavy = whole.mass.multiply_columns(&modes.shapes);
    let clear = |some: &mut [f64]| {
        let along = multi_vector::inner_products(n, &heavy, some);
        multi_vector::add(n, some, -1.0, &modes.shapes, &along);
    };
    let mut basis = Vec::with_capacity(modes.shapes.len() + n * ports * order);
    basis.extend_from_slice(&modes.shapes);
    for block in 0..order {
        for first in (0..ports).step_by(COLUMN_BLOCK) {
            interrupt::check();
            let numbers = first..ports.min(first + COLUMN_BLOCK);
            let mut some = match block.checked_sub(1) {
                Some(last) => {
                    let at = modes.shapes.len() + last * ports * n;
                    whole.mass.multiply_columns(&basis[at + numbers.start * n..at + numbers.end * n])
                }
                None => whole.forces(numbers),
            };
            // removes the modal part of the forces, A F = (1 - M Φ Φᵀ) F, which makes them
            // self-equilibrated
            let along = multi_vector::inner_products(n, &modes.shapes, &some);
            multi_vector::add(n, &mut some, -1.0, &heavy, &along);
            factor.solve(&mut some);
            clear(&mut some);
            clear(&mut some);
            basis.extend_from_slice(&some);
        }
    }
    Ok((basis, shift))
}

/// Factors `K - σM`. At zero shift, it adds springs where the free motions are largest.
fn factor(whole: &FullStructure, modes: &NaturalModes, shift: f64) -> Result<(LdlFactor, f64), ReductionError> {
    if shift == 0.0 {
        let supports = supports(whole, modes)?;
        let sum: [(f64, &SparseMatrix); 2] = [(1.0, &whole.stiffness), (1.0, &supports)];
        let factor = whole.analysis.factor(&sum);
        return Ok((factor.map_err(|singular| ReductionError::Singular { omega: 0.0, singular })?, 0.0));
    }
    let mut failed = None;
    // Attempts to factor next to an eigenvalue; each moves the shift by a thousandth.
    for attempt in 0..8 {
        let shift = shift * (1.0 + 1e-3 * attempt as f64);
        match whole.analysis.factor(&[(1.0, &whole.stiffness), (-shift, &whole.mass)]) {
            Ok(factor) => return Ok((factor, shift)),
            Err(singular) => failed = Some(ReductionError::Singular { omega: shift.max(0.0).sqrt(), singular }),
        }
    }
    Err(failed.unwrap_or(ReductionError::OutOfRange))
}

/// Returns springs that fix each free motion once. The first spring is at the degree of freedom
/// that moves most. The next one is at that with the largest motion when the first is fixed,
/// and so on.
fn supports(whole: &FullStructure, modes: &NaturalModes) -> Result<SparseMatrix, ReductionError> {
    let n = whole.dofs();
    let (stiffness, mass) = (&whole.stiffness, &whole.mass);
    let mut motions: Vec<Vec<f64>> = (0..modes.rigid_body_count()).map(|mode| modes.shape(mode).to_vec()).collect();
    let mut springs = Vec::new();
    while !motions.is_empty() {
        let places = (0..motions.len()).flat_map(|k| (0..n).map(move |i| (k, i)));
        let largest = places.max_by(|&(a, i), &(b, k)| motions[a][i].abs().total_cmp(&motions[b][k].abs()));
        let Some((k, at)) = largest else { break };
        let motion = motions.swap_remove(k);
        for other in &mut motions {
            let share = other[at] / motion[at];
            other.iter_mut().zip(&motion).for_each(|(x, y)| *x -= share * y);
        }
        // as stiff as its surroundings
        springs.push((at, at, stiffness.get(at, at).max(modes.scale * mass.get(at, at))));
    }
    SparseMatrix::from_triplets(n, springs).map_err(|_| ReductionError::OutOfRange)
}
