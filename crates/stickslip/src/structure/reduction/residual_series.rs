//! Receptance of the ports as a modal sum and a power series of the residual, for methods that
//! need receptances only.
//!
//! `R(ω) = Σ φ φᵀ / (λ - ω² + jω c) + Σⱼ (z - σ)ʲ Qⱼ / (1 + jω β)`,
//! `z = (ω² - jω α) / (1 + jω β)`. Here `Qⱼ = Fᵀ Xⱼ` with the residual vectors X, and
//! `α M + β K` is the damping outside the modes. J orders of vectors yield 2 J terms, because
//! `Q₍ᵢ₊ⱼ₊₁₎ = Xᵢᵀ M Xⱼ`. The error decreases like `((ω² - σ) / (λ - σ))²ᴶ`, with λ of the
//! first omitted mode.
//!
//! Sources: Hansteen and Bell (1979); Dickens, Nakagawa and Wittbrodt (1997), as in
//! `residual_flexibility`.

use super::{ReductionError, RubinBasis, StructureDamping};
use nalgebra::{Complex, DMatrix};

/// Modes and residual terms of the ports' receptance.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualSeries {
    /// λ of the modes, rad²/s².
    values: Vec<f64>,
    /// Displacements of the ports in every mode, p × k.
    shapes: DMatrix<f64>,
    /// `Q₀, …`, p × p each.
    terms: Vec<DMatrix<f64>>,
    /// σ, rad²/s².
    shift: f64,
    damping: StructureDamping,
}

impl ResidualSeries {
    /// Creates a series from the first `modes` modes, with two terms per order of residual
    /// vectors.
    ///
    /// # Errors
    /// [`ReductionError::SeriesDamping`] for a structure with a damping matrix.
    ///
    /// # Panics
    /// If `free` has fewer modes.
    pub fn new(free: &RubinBasis, modes: usize) -> Result<Self, ReductionError> {
        assert!(modes <= free.modes(), "{modes} of {} modes", free.modes());
        let damping = free.whole().damping.clone();
        if matches!(damping, StructureDamping::Matrix(_)) {
            return Err(ReductionError::SeriesDamping);
        }
        let blocks: Vec<DMatrix<f64>> = (0..free.counts.1).map(|order| free.residual_vectors(modes, order)).collect();
        let term = |j: usize| match j.checked_sub(1) {
            None => &free.ports * &blocks[0],
            Some(last) => blocks[last / 2].transpose() * &free.mass * &blocks[j / 2],
        };
        let terms = (0..2 * blocks.len()).map(|j| super::symmetric(term(j))).collect();
        let shapes = free.ports.columns(0, modes).into_owned();
        Ok(ResidualSeries { values: free.values[..modes].to_vec(), shapes, terms, shift: free.shift, damping })
    }

    /// Returns the number of residual terms `Q`.
    pub fn terms(&self) -> usize {
        self.terms.len()
    }

    /// Returns the receptance of the ports at ω (rad/s), p × p, m/N.
    pub fn receptance(&self, omega: f64) -> DMatrix<Complex<f64>> {
        let modal = |value: f64| self.damping.of_mode(value.max(0.0).sqrt()).unwrap_or(0.0);
        let (alpha, beta) = self.damping.proportional().unwrap_or((0.0, 0.0));
        self.sum(omega, modal, alpha, beta)
    }

    /// Returns the receptance without damping.
    pub(super) fn undamped(&self, omega: f64) -> DMatrix<Complex<f64>> {
        self.sum(omega, |_| 0.0, 0.0, 0.0)
    }

    fn sum(&self, omega: f64, modal: impl Fn(f64) -> f64, alpha: f64, beta: f64) -> DMatrix<Complex<f64>> {
        let complex = |matrix: &DMatrix<f64>| matrix.map(|v| Complex::new(v, 0.0));
        let shapes = complex(&self.shapes);
        let mut weighted = shapes.clone();
        for (k, value) in self.values.iter().enumerate() {
            let stiffness = Complex::new(value - omega * omega, omega * modal(*value));
            weighted.column_mut(k).iter_mut().for_each(|v| *v /= stiffness);
        }
        let mut receptance = weighted * shapes.transpose();
        let loss = Complex::new(1.0, omega * beta);
        let step = Complex::new(omega * omega, -omega * alpha) / loss - self.shift;
        let mut power = loss.inv();
        for term in &self.terms {
            receptance += complex(term) * power;
            power *= step;
        }
        receptance
    }
}
