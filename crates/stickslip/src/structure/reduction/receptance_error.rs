//! Error of a reduction: compares receptances of the ports at sample frequencies.
//!
//! Samples are in the middle between modes (anti-resonances), next to modes (where a frequency
//! shift is visible), and at the end of the range.
//!
//! Modal and Rayleigh damping are the same function of mass and stiffness before and after the
//! reduction and add no error. Therefore both structures are compared without damping; real
//! factors then need a quarter of the memory. A damping matrix is included in the comparison.
//!
//! The error at a frequency is the norm of the difference relative to the norm. Each port is
//! scaled by its typical receptance, so that units do not matter.

use super::{FullStructure, ReducedMatrices, ReductionError, ResidualSeries, StructureDamping};
use nalgebra::{Complex, DMatrix};
use serde::{Deserialize, Serialize};
use stickslip_numerics::interrupt;
use stickslip_numerics::random::SplitMix64;
use stickslip_numerics::sparse::{LdlFactor, NaturalModes, SparseMatrix};

/// ω in rad/s, and displacements of the ports under the loads in m.
type ReceptanceSample = (f64, DMatrix<Complex<f64>>);

/// Receptances of the whole structure.
#[derive(Debug, Clone)]
pub struct ReferenceReceptance {
    samples: Vec<ReceptanceSample>,
    /// Forces on the ports, one column per load.
    loads: DMatrix<f64>,
    damped: bool,
    /// Reciprocal of the typical size of every port, √(N/m), and of the loads.
    scales: Vec<f64>,
    of_loads: Vec<f64>,
}

/// Error of a reduction relative to the whole structure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReductionDeviation {
    /// Largest relative error of the samples.
    pub error: f64,
    /// Frequency of this error, rad/s.
    pub omega: f64,
}

impl ReferenceReceptance {
    /// Computes samples up to `up_to` (rad/s), at frequencies derived from `modes` of the whole
    /// structure.
    ///
    /// # Errors
    /// [`ReductionError::Singular`] if a sample coincides with a mode after all shifts.
    pub fn new(whole: &FullStructure, modes: &NaturalModes, up_to: f64) -> Result<Self, ReductionError> {
        // Largest number of samples; each needs a factorization of the whole structure.
        Self::with_samples(whole, modes, up_to, 9)
    }

    /// Computes at most `most` samples.
    pub(super) fn with_samples(
        whole: &FullStructure,
        modes: &NaturalModes,
        up_to: f64,
        most: usize,
    ) -> Result<Self, ReductionError> {
        Self::at_frequencies(whole, &frequencies(whole, modes, up_to, most))
    }

    /// Computes samples at these frequencies, rad/s.
    ///
    /// # Errors
    /// [`ReductionError::Singular`] if a sample coincides with a mode after all shifts.
    pub fn at_frequencies(whole: &FullStructure, frequencies: &[f64]) -> Result<Self, ReductionError> {
        let probes = 48;
        let ports = whole.ports.len();
        // Number of ports up to which each port is loaded separately. More ports are loaded all
        // together, with `probes` vectors of random signs. Separate loads would need one
        // solution per port and sample. The norm of the response to random signs is on average
        // that of the matrix, here within a tenth.
        let alone = ports <= 96;
        let local = local_sizes(whole);
        let mut factors = Factors { whole, last: None };
        let loads = match alone {
            true => DMatrix::identity(ports, ports),
            false => DMatrix::from_fn(ports, probes, |i, k| sign(i * probes + k) / local[i].sqrt()),
        };
        let together = (!alone).then_some(&loads);
        let samples: Vec<_> =
            frequencies.iter().map(|omega| factors.sample(*omega, together)).collect::<Result<_, _>>()?;
        let usual = |port: usize| {
            let mut sizes: Vec<f64> = samples.iter().map(|(_, r)| r[(port, port)].norm()).collect();
            sizes.sort_by(f64::total_cmp);
            sizes.get(sizes.len() / 2).copied().unwrap_or(1.0)
        };
        let size = |port: usize| if alone { usual(port) } else { local[port] };
        let scales: Vec<f64> = (0..ports).map(|port| size(port).max(f64::MIN_POSITIVE).sqrt().recip()).collect();
        let of_loads = if alone { scales.clone() } else { vec![1.0; probes] };
        Ok(ReferenceReceptance {
            samples,
            loads,
            damped: matches!(whole.damping, StructureDamping::Matrix(_)),
            scales,
            of_loads,
        })
    }

    /// Returns the frequencies of the samples, rad/s.
    pub fn frequencies(&self) -> impl Iterator<Item = f64> + '_ {
        self.samples.iter().map(|(omega, _)| *omega)
    }

    /// Returns the error of a reduced structure; infinite where it is singular.
    pub fn deviation(&self, reduced: &ReducedMatrices) -> ReductionDeviation {
        let bare = ReducedMatrices { damping: &reduced.damping * 0.0, ..reduced.clone() };
        let reduced = if self.damped { reduced } else { &bare };
        self.worst(|omega| reduced.answers(omega, &self.loads).ok())
    }

    /// Returns the error of a series.
    pub fn deviation_of_series(&self, series: &ResidualSeries) -> ReductionDeviation {
        let loads = self.loads.map(|v| Complex::new(v, 0.0));
        self.worst(|omega| Some(series.undamped(omega) * &loads))
    }

    fn worst(&self, receptance: impl Fn(f64) -> Option<DMatrix<Complex<f64>>>) -> ReductionDeviation {
        let mut worst = ReductionDeviation { error: 0.0, omega: 0.0 };
        for (omega, whole) in &self.samples {
            let norm = |matrix: &DMatrix<Complex<f64>>| {
                let scaled = |i: usize, k: usize| (matrix[(i, k)] * self.scales[i] * self.of_loads[k]).norm_sqr();
                let columns = (0..matrix.ncols()).flat_map(|k| (0..matrix.nrows()).map(move |i| (i, k)));
                columns.map(|(i, k)| scaled(i, k)).sum::<f64>().sqrt()
            };
            let error = receptance(*omega).map_or(f64::INFINITY, |r| norm(&(r - whole)) / norm(whole));
            // NaN counts as an infinite error
            let error = if error.is_nan() { f64::INFINITY } else { error };
            if error > worst.error {
                worst = ReductionDeviation { error, omega: *omega };
            }
        }
        worst
    }
}

/// Successive factors of the whole structure.
struct Factors<'a> {
    whole: &'a FullStructure,
    /// The last factor, whose memory the next one reuses.
    last: Option<LdlFactor>,
}

impl Factors<'_> {
    /// Computes the receptance of the whole structure at ω, or slightly above if ω is at a
    /// mode. `together` contains loads on all ports; `None` loads each port separately.
    fn sample(&mut self, omega: f64, together: Option<&DMatrix<f64>>) -> Result<ReceptanceSample, ReductionError> {
        interrupt::check();
        let mut failed = ReductionError::OutOfRange;
        // Attempts to shift a sample away from a mode.
        for attempt in 0..5 {
            // Relative shift of a sample that coincides with a mode of the whole structure.
            let omega = omega * (1.0 + 3e-5 * attempt as f64);
            match self.answers(omega, together) {
                Ok(receptance) => return Ok((omega, receptance)),
                Err(error) => failed = error,
            }
        }
        Err(failed)
    }

    fn answers(
        &mut self,
        omega: f64,
        together: Option<&DMatrix<f64>>,
    ) -> Result<DMatrix<Complex<f64>>, ReductionError> {
        let whole = self.whole;
        let (mass, stiffness): (&SparseMatrix, &SparseMatrix) = (&whole.mass, &whole.stiffness);
        let singular = |singular| ReductionError::Singular { omega, singular };
        let see = |columns: usize, value: &dyn Fn(usize) -> Complex<f64>| {
            DMatrix::from_fn(whole.ports.len(), columns, |i, k| {
                whole.ports[i].iter().map(|(at, weight)| value(k * whole.dofs() + at) * *weight).sum()
            })
        };
        if let StructureDamping::Matrix(damping) = &whole.damping {
            let sum = [(1.0, 0.0), (0.0, omega), (-omega * omega, 0.0)].map(|(re, im)| Complex::new(re, im));
            let sum = [(sum[0], stiffness), (sum[1], damping), (sum[2], mass)];
            let factor = whole.analysis.factor_complex(&sum).map_err(singular)?;
            let mut complex: Vec<Complex<f64>> =
                forces(whole, together).iter().map(|v| Complex::new(*v, 0.0)).collect();
            factor.solve(&mut complex);
            return Ok(see(complex.len() / whole.dofs(), &|at| complex[at]));
        }
        let sum = [(1.0, stiffness), (-omega * omega, mass)];
        let factor = match self.last.take() {
            Some(last) => last.refactor(&sum),
            None => whole.analysis.factor(&sum),
        };
        let factor = self.last.insert(factor.map_err(singular)?);
        if together.is_none() {
            return Ok(factor.compliance(&whole.ports).map(|v| Complex::new(v, 0.0)));
        }
        let mut real = forces(whole, together);
        factor.solve(&mut real);
        Ok(see(real.len() / whole.dofs(), &|at| Complex::new(real[at], 0.0)))
    }
}

/// Returns forces on all rows under the loads of the ports, or under a unit load on each port.
fn forces(whole: &FullStructure, together: Option<&DMatrix<f64>>) -> Vec<f64> {
    let Some(loads) = together else { return whole.forces(0..whole.ports.len()) };
    let n = whole.dofs();
    let mut forces = vec![0.0; n * loads.ncols()];
    for (k, (port, row)) in (0..loads.ncols()).flat_map(|k| whole.ports.iter().enumerate().map(move |row| (k, row))) {
        row.iter().for_each(|(at, weight)| forces[k * n + at] += weight * loads[(port, k)]);
    }
    forces
}

/// Returns the compliances of the ports from the diagonal stiffness alone, m/N. They give the
/// magnitude and the units of the receptances.
fn local_sizes(whole: &FullStructure) -> Vec<f64> {
    let own = |at: usize| whole.stiffness.get(at, at);
    let size = |row: &super::Row| row.iter().filter(|(at, _)| own(*at) > 0.0).map(|(at, w)| w * w / own(*at)).sum();
    whole.ports.iter().map(size).map(|size: f64| if size > 0.0 { size } else { 1.0 }).collect()
}

/// Returns a reproducible pseudo-random sign ±1.
pub(super) fn sign(number: usize) -> f64 {
    let bits = SplitMix64::new(0).skip(number as u64).next_u64();
    if bits & 1 == 0 { 1.0 } else { -1.0 }
}

/// Returns sample frequencies, alternately next to modes and between them, from the first
/// elastic mode to the end of the range.
fn frequencies(whole: &FullStructure, modes: &NaturalModes, up_to: f64, most: usize) -> Vec<f64> {
    // Distance of a sample from a mode, relative to its frequency, unless the damping is larger:
    // the half width of a resonance.
    let mode_distance = 1e-3;
    // Samples closer than this, relative to the frequency, are merged.
    let merge_distance = 1e-4;
    let offset = match whole.damping {
        StructureDamping::Ratio { ratio, .. } => ratio.max(mode_distance),
        _ => mode_distance,
    };
    let inside: Vec<f64> = modes
        .values
        .iter()
        .map(|value| value.max(0.0).sqrt())
        .filter(|omega| *omega > merge_distance * up_to && *omega < up_to)
        .collect();
    let mut all = Vec::new();
    for (k, omega) in inside.iter().enumerate() {
        let next = inside.get(k + 1).copied().unwrap_or(up_to);
        all.extend([omega * (1.0 + offset), 0.5 * (omega + next)]);
    }
    all.push(0.5 * inside.first().copied().unwrap_or(up_to));
    // equal modes, as in a square section, have no middle; at a mode, rounding would dominate
    // the error
    all.retain(|omega| *omega <= up_to && inside.iter().all(|mode| (omega - mode).abs() >= merge_distance * mode));
    all.push(up_to);
    all.sort_by(f64::total_cmp);
    all.dedup_by(|next, kept| *next - *kept < merge_distance * *kept);
    // evenly spaced indices of mixed parity keep both kinds of samples
    let last = all.len() - 1;
    let mut at: Vec<usize> = (0..most.min(all.len())).map(|i| i * last / (most - 1).min(last).max(1)).collect();
    at.dedup();
    at.into_iter().map(|i| all[i]).collect()
}
