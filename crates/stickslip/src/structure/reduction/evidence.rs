//! How far a reduction is from the whole structure: receptances of the ports at sample frequencies.
//!
//! Samples stand in the middle between modes, where anti-resonances are, next to modes, where a shifted frequency shows, and at the end of
//! the range. Modal and
//! Rayleigh damping are the same function of mass and stiffness before and after the reduction and add no error of their own, so that both
//! are compared
//! without: the whole takes real factors then, a fourth of the memory. With a damping matrix both are compared with it.
//! The error at a frequency is the norm of the difference relative to the norm, each port scaled by its usual receptance, so that units do
//! not count.

use super::{Damping, Reduced, ReductionError, Series, Whole};
use nalgebra::{Complex, DMatrix};
use stickslip_numerics::sparse::{Matrix, NaturalModes};

/// Samples at most: each takes a factor of the whole structure.
const SAMPLES: usize = 9;
/// Distance of a sample from a mode, relative to its frequency, if damping does not say more: a resonance of this half width.
const BESIDE: f64 = 1e-3;
/// Samples closer than this, relative to the frequency, are one.
const SAME: f64 = 1e-4;
/// A sample at a mode of the whole structure moves by this share.
const NUDGE: f64 = 3e-5;
/// Attempts to sample beside a mode.
const ATTEMPTS: usize = 5;

/// Receptances of the whole structure.
#[derive(Debug, Clone)]
pub struct Reference {
    /// (ω, receptance), rad/s and p × p, m/N.
    samples: Vec<(f64, DMatrix<Complex<f64>>)>,
    damped: bool,
    /// One by the usual size of every port, √(N/m).
    scales: Vec<f64>,
}

/// How far a reduction is from the whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// The largest relative error among the samples.
    pub error: f64,
    /// Where, rad/s.
    pub omega: f64,
}

impl Reference {
    /// Samples up to `up_to` (rad/s), placed by `modes` of the whole structure.
    ///
    /// # Errors
    /// [`ReductionError::Singular`] if a sample stays at a mode.
    pub fn new(whole: &Whole, modes: &NaturalModes, up_to: f64) -> Result<Self, ReductionError> {
        Self::at(whole, &frequencies(whole, modes, up_to))
    }

    /// Samples at these frequencies, rad/s.
    ///
    /// # Errors
    /// [`ReductionError::Singular`] if a sample stays at a mode.
    pub fn at(whole: &Whole, frequencies: &[f64]) -> Result<Self, ReductionError> {
        let samples: Vec<_> = frequencies.iter().map(|omega| sample(whole, *omega)).collect::<Result<_, _>>()?;
        let usual = |port: usize| {
            let mut sizes: Vec<f64> = samples.iter().map(|(_, r)| r[(port, port)].norm()).collect();
            sizes.sort_by(f64::total_cmp);
            sizes.get(sizes.len() / 2).copied().unwrap_or(1.0)
        };
        let scales = (0..whole.ports.len()).map(|port| usual(port).max(f64::MIN_POSITIVE).sqrt().recip()).collect();
        Ok(Reference { samples, damped: matches!(whole.damping, Damping::Matrix(_)), scales })
    }

    /// Frequencies of the samples, rad/s.
    pub fn frequencies(&self) -> impl Iterator<Item = f64> + '_ {
        self.samples.iter().map(|(omega, _)| *omega)
    }

    /// How far a reduced structure is from the whole; infinite where it is singular.
    pub fn deviation(&self, reduced: &Reduced) -> Deviation {
        let bare = Reduced { damping: &reduced.damping * 0.0, basis: vec![], n: 0, ..reduced.clone() };
        let reduced = if self.damped { reduced } else { &bare };
        self.worst(|omega| reduced.receptance(omega).ok())
    }

    /// How far a series is from the whole.
    pub fn deviation_of_series(&self, series: &Series) -> Deviation {
        self.worst(|omega| Some(series.undamped(omega)))
    }

    fn worst(&self, receptance: impl Fn(f64) -> Option<DMatrix<Complex<f64>>>) -> Deviation {
        let mut worst = Deviation { error: 0.0, omega: 0.0 };
        for (omega, whole) in &self.samples {
            let norm = |matrix: &DMatrix<Complex<f64>>| {
                let scaled = |i: usize, k: usize| (matrix[(i, k)] * self.scales[i] * self.scales[k]).norm_sqr();
                let columns = (0..matrix.ncols()).flat_map(|k| (0..matrix.nrows()).map(move |i| (i, k)));
                columns.map(|(i, k)| scaled(i, k)).sum::<f64>().sqrt()
            };
            let error = receptance(*omega).map_or(f64::INFINITY, |r| norm(&(r - whole)) / norm(whole));
            // what is no number is no small error
            let error = if error.is_nan() { f64::INFINITY } else { error };
            if error > worst.error {
                worst = Deviation { error, omega: *omega };
            }
        }
        worst
    }
}

/// Receptance of the whole structure at ω, or a little further where that is a mode.
fn sample(whole: &Whole, omega: f64) -> Result<(f64, DMatrix<Complex<f64>>), ReductionError> {
    let mut failed = ReductionError::OutOfRange;
    for attempt in 0..ATTEMPTS {
        let omega = omega * (1.0 + NUDGE * attempt as f64);
        match receptance(whole, omega) {
            Ok(receptance) => return Ok((omega, receptance)),
            Err(error) => failed = error,
        }
    }
    Err(failed)
}

fn receptance(whole: &Whole, omega: f64) -> Result<DMatrix<Complex<f64>>, ReductionError> {
    let (n, p) = (whole.dofs(), whole.ports.len());
    let (mass, stiffness): (&Matrix, &Matrix) = (&whole.mass, &whole.stiffness);
    let singular = |singular| ReductionError::Singular { omega, singular };
    let mut real = whole.forces();
    let see = |value: &dyn Fn(usize) -> Complex<f64>| {
        DMatrix::from_fn(p, p, |i, k| whole.ports[i].iter().map(|(at, weight)| value(k * n + at) * *weight).sum())
    };
    if let Damping::Matrix(damping) = &whole.damping {
        let sum = [(1.0, 0.0), (0.0, omega), (-omega * omega, 0.0)].map(|(re, im)| Complex::new(re, im));
        let sum = [(sum[0], stiffness), (sum[1], damping), (sum[2], mass)];
        let factor = whole.analysis.factor_complex(&sum).map_err(singular)?;
        let mut complex: Vec<Complex<f64>> = real.iter().map(|v| Complex::new(*v, 0.0)).collect();
        factor.solve(&mut complex);
        return Ok(see(&|at| complex[at]));
    }
    let factor = whole.analysis.factor(&[(1.0, stiffness), (-omega * omega, mass)]).map_err(singular)?;
    factor.solve(&mut real);
    Ok(see(&|at| Complex::new(real[at], 0.0)))
}

/// Where to sample: beside modes and between them by turns, from the first elastic mode to the end of the range.
fn frequencies(whole: &Whole, modes: &NaturalModes, up_to: f64) -> Vec<f64> {
    let beside = match whole.damping {
        Damping::Ratio { ratio, .. } => ratio.max(BESIDE),
        _ => BESIDE,
    };
    let inside: Vec<f64> = modes
        .values
        .iter()
        .map(|value| value.max(0.0).sqrt())
        .filter(|omega| *omega > SAME * up_to && *omega < up_to)
        .collect();
    let mut all = Vec::new();
    for (k, omega) in inside.iter().enumerate() {
        let next = inside.get(k + 1).copied().unwrap_or(up_to);
        all.extend([omega * (1.0 + beside), 0.5 * (omega + next)]);
    }
    all.push(up_to);
    all.insert(0, 0.5 * inside.first().copied().unwrap_or(up_to));
    all.retain(|omega| *omega <= up_to);
    all.sort_by(f64::total_cmp);
    all.dedup_by(|next, kept| *next - *kept < SAME * *kept);
    // not of one parity, so that both sorts remain
    let last = all.len() - 1;
    let mut at: Vec<usize> = (0..SAMPLES.min(all.len())).map(|i| i * last / (SAMPLES - 1).min(last).max(1)).collect();
    at.dedup();
    at.into_iter().map(|i| all[i]).collect()
}
