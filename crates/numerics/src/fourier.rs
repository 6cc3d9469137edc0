//! Fourier series of sampled periodic signals.
//!
//! The signal is `u(θ) = Re Σ_h U_h e^{jhθ}`, with samples at `θ_i = 2π i / N`.

use num_complex::Complex64;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::cell::RefCell;
use std::fmt;
use std::sync::Arc;

thread_local! {
    /// Plans that the thread has made, by length. A plan is a reference to them.
    static PLANNER: RefCell<RealFftPlanner<f64>> = RefCell::new(RealFftPlanner::new());
}

/// A plan for signals of one length, with its scratch memory. Transforms allocate nothing.
///
/// # Example
/// ```
/// use num_complex::Complex64;
/// use stickslip_numerics::fourier::FourierPlan;
/// let mut fourier = FourierPlan::new(16);
/// let mut samples = vec![0.0; 16];
/// fourier
///     .synthesize(&[(0, Complex64::new(0.5, 0.0)), (3, Complex64::new(0.0, -2.0))], &mut samples);
/// assert!((samples[1] - (0.5 + 2.0 * (3.0 * std::f64::consts::TAU / 16.0).sin())).abs() < 1e-14);
/// let sums = fourier.transform(&mut samples); // Σ u_i e^{-jhθ_i}
/// assert!((sums[3] * (2.0 / 16.0) - Complex64::new(0.0, -2.0)).norm() < 1e-14);
/// ```
#[derive(Clone)]
pub struct FourierPlan {
    samples: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    spectrum: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl fmt::Debug for FourierPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FourierPlan").field("samples", &self.samples).finish_non_exhaustive()
    }
}

impl FourierPlan {
    /// Makes a plan for `samples` points per period (even, at least 2).
    pub fn new(samples: usize) -> Self {
        // a solver for every row of measured data would compute the factors again and again
        let (forward, inverse) =
            PLANNER.with_borrow_mut(|planner| (planner.plan_fft_forward(samples), planner.plan_fft_inverse(samples)));
        let scratch = forward.get_scratch_len().max(inverse.get_scratch_len());
        FourierPlan {
            samples,
            forward,
            inverse,
            spectrum: vec![Complex64::default(); samples / 2 + 1],
            scratch: vec![Complex64::default(); scratch],
        }
    }

    /// Returns the number of points per period.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Writes the samples of `Re Σ U_h e^{jhθ}` into `out` (length N), from
    /// pairs (h, U_h) with `h < N/2`.
    pub fn synthesize(&mut self, harmonics: &[(usize, Complex64)], out: &mut [f64]) {
        self.spectrum.fill(Complex64::default());
        for &(h, c) in harmonics {
            // The inverse transform adds the conjugate half, which doubles all
            // harmonics except the mean.
            self.spectrum[h] += if h == 0 { Complex64::new(c.re, 0.0) } else { c * 0.5 };
        }
        let scratch = &mut self.scratch[..self.inverse.get_scratch_len()];
        self.inverse
            .process_with_scratch(&mut self.spectrum, out, scratch)
            .expect("the lengths must equal those of the plan");
    }

    /// Returns `Σ_i u_i e^{-jhθ_i}` for h = 0..=N/2. Overwrites the samples.
    pub fn transform(&mut self, samples: &mut [f64]) -> &[Complex64] {
        let scratch = &mut self.scratch[..self.forward.get_scratch_len()];
        self.forward
            .process_with_scratch(samples, &mut self.spectrum, scratch)
            .expect("the lengths must equal those of the plan");
        &self.spectrum
    }
}
