//! Alternating frequency-time (AFT): the signals of a port over a period, and
//! helpers of all kernels.

use super::workspace::PERIODICITY_TOLERANCE;
use super::{Port, StaticState};
use crate::law::MAX_DIRECTIONS;
use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip_numerics::fourier::FourierPlan;

pub(super) const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Signals, transforms and scratch memory for one list of harmonics and one number of samples.
#[derive(Debug, Clone)]
pub(in super::super) struct FrequencyTime {
    /// Factor of the joints' [`StaticState`]: the share of the constant
    /// loads, divided by the factor of the slip limits.
    pub static_share: f64,
    /// Number of steps of laws with memory in the present search.
    pub law_steps: usize,
    /// Change of the states over a period, relative to their size, at which they count as
    /// periodic.
    pub periodicity_tolerance: f64,
    pub harmonics: Vec<usize>,
    pub fourier: FourierPlan,
    pairs: Vec<(usize, Complex64)>,
    /// A scratch signal.
    pub signal: Vec<f64>,
    /// Forces of the port evaluated last along its axes, per sample, N. Kernels that do not
    /// sample, such as sliders, set them only in [`FrequencyTime::sample`].
    pub force: [Vec<f64>; MAX_DIRECTIONS],
    /// Displacements and velocities of the port along its axes, for kernels that use them.
    pub(super) displacement: [Vec<f64>; MAX_DIRECTIONS],
    pub(super) velocity: [Vec<f64>; MAX_DIRECTIONS],
    /// True at the samples that slip, for a port whose kernel tells slip.
    pub slips: Vec<bool>,
    /// Derivative of the force by ω in rad/s, [axis][harmonic], of the motion
    /// port whose derivative was evaluated last. It is not zero for laws that
    /// depend on velocity. `None` unless ω is an unknown.
    pub by_frequency: Option<Vec<Complex64>>,
    /// Internal states at t = 0 of the port evaluated last.
    pub state: Vec<f64>,
    /// States at the samples, for step laws.
    pub(super) states_at_samples: Vec<f64>,
    /// Known states with which the next port with memory begins. The evaluation consumes them.
    pub known_state: InitialState,
    /// True if the law dissipates in the motion evaluated last, so that its states follow from the
    /// period alone.
    pub dissipates: bool,
    /// `(1 - Π)⁻¹` of the port with memory whose derivative was evaluated last, see
    /// [`InitialState`].
    pub forgetting_inverse: Vec<f64>,
    /// `e^{2πji/N}` for every sample i.
    pub(super) rotations: Vec<Complex64>,
    pub(super) argument: Vec<Complex64>,
    pub(super) work: Vec<f64>,
    pub(super) slopes: Vec<Vec<f64>>,
    pub(super) spectra: [Vec<Complex64>; 3],
    pub(super) column: Vec<Complex64>,
    pub(super) row: Vec<Complex64>,
    pub(super) moment: Vec<f64>,
    pub(super) intervals: Vec<super::events::Interval>,
    pub(super) extremes: Vec<super::events::TurningPoint>,
    pub(super) branches: super::masing::MasingBranches,
    pub(super) grid: super::events::BracketingGrid,
    pub(super) workspace: super::workspace::StepWorkspace,
}

/// Known states of a port with memory in a nearby motion.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct InitialState {
    /// States at t = 0; empty if they follow from static equilibrium, as those of a joint that
    /// sticks.
    pub state: Vec<f64>,
    /// `(1 - Π)⁻¹`, row-major. `Π` is the derivative of the states after a period by the states
    /// before. Empty if it is unknown, or if some state is never forgotten.
    pub forgetting_inverse: Vec<f64>,
}

impl InitialState {
    /// Returns itself if the law forgets its initial states, else the default. A state that is
    /// never forgotten must begin in static equilibrium.
    pub fn if_forgotten(&self) -> Self {
        if self.forgetting_inverse.is_empty() { InitialState::default() } else { self.clone() }
    }
}

impl FrequencyTime {
    /// Returns the states at t = 0 in the motion evaluated last; none without dissipation.
    pub fn dissipating_state(&self) -> &[f64] {
        if self.dissipates { &self.state } else { &[] }
    }

    /// Returns the number of harmonics times the number of samples.
    pub fn resolution(&self) -> usize {
        self.pairs.len() * self.rotations.len()
    }

    pub fn new(harmonics: Vec<usize>, samples: usize) -> Self {
        let zeros = vec![0.0; samples];
        let three = || std::array::from_fn(|_| vec![0.0; samples]);
        let top = harmonics.last().copied().unwrap_or(0);
        FrequencyTime {
            static_share: 1.0,
            law_steps: 0,
            periodicity_tolerance: PERIODICITY_TOLERANCE,
            fourier: FourierPlan::new(samples),
            pairs: harmonics.iter().map(|&h| (h, ZERO)).collect(),
            signal: zeros.clone(),
            force: three(),
            displacement: three(),
            velocity: three(),
            slips: vec![false; samples],
            by_frequency: None,
            state: Vec::new(),
            states_at_samples: Vec::new(),
            known_state: InitialState::default(),
            dissipates: false,
            forgetting_inverse: Vec::new(),
            rotations: (0..samples).map(|i| Complex64::cis(i as f64 * TAU / samples as f64)).collect(),
            argument: Vec::new(),
            work: zeros.clone(),
            moment: zeros,
            slopes: Vec::new(),
            spectra: std::array::from_fn(|_| vec![ZERO; 2 * top + 1]),
            column: vec![ZERO; harmonics.len()],
            row: vec![ZERO; harmonics.len()],
            intervals: Vec::new(),
            extremes: Vec::new(),
            branches: super::masing::MasingBranches::default(),
            grid: super::events::BracketingGrid::new(top),
            workspace: super::workspace::StepWorkspace::default(),
            harmonics,
        }
    }

    pub fn samples(&self) -> usize {
        self.signal.len()
    }

    /// Samples the signal with harmonics `c`, each times `factor(h)`, into `self.signal`.
    pub(super) fn synthesise(&mut self, c: &[Complex64], factor: impl Fn(usize) -> Complex64) {
        for (pair, value) in self.pairs.iter_mut().zip(c) {
            pair.1 = value * factor(pair.0);
        }
        self.fourier.synthesize(&self.pairs, &mut self.signal);
    }

    /// Returns the static equilibrium of a port: displacements (m) along its axes, and states.
    pub(super) fn at_rest(&self, port: &Port) -> ([f64; MAX_DIRECTIONS], Vec<f64>) {
        let StaticState { displacement, states } = &port.static_state;
        (displacement.map(|u| u * self.static_share), states.iter().map(|z| z * self.static_share).collect())
    }

    /// Passes the harmonics `wanted` of the sampled force along an axis to `add`. It skips
    /// those at or above half of the samples.
    pub fn add_harmonics(&mut self, axis: usize, wanted: &[usize], mut add: impl FnMut(usize, Complex64)) {
        let n = self.samples();
        self.work.copy_from_slice(&self.force[axis]);
        let sums = self.fourier.transform(&mut self.work);
        for (k, &h) in wanted.iter().enumerate().filter(|(_, h)| 2 * **h < n) {
            add(k, sums[h] * 2.0 / n as f64);
        }
    }

    /// Adds the harmonics of the sampled force along an axis to `force`.
    pub(super) fn add_force(&mut self, axis: usize, force: &mut [Complex64]) {
        let mut work = std::mem::take(&mut self.work);
        work.copy_from_slice(&self.force[axis]);
        self.add_signal(&mut work, force);
        self.work = work;
    }

    /// Adds the harmonics of a signal to `to`. The transform overwrites the signal.
    pub fn add_signal(&mut self, signal: &mut [f64], to: &mut [Complex64]) {
        let n = self.samples();
        let sums = self.fourier.transform(signal);
        for (to, &h) in to.iter_mut().zip(&self.harmonics) {
            *to += sums[h] * amplitude_factor(h, n);
        }
    }

    /// Adds the harmonics of a signal along an axis to the derivative by ω, if
    /// that is kept. The transform overwrites the signal.
    pub(super) fn add_by_frequency(&mut self, axis: usize, signal: &mut [f64]) {
        let nh = self.harmonics.len();
        let Some(mut by_frequency) = self.by_frequency.take() else { return };
        self.add_signal(signal, &mut by_frequency[axis * nh..(axis + 1) * nh]);
        self.by_frequency = Some(by_frequency);
    }

    /// Computes the spectrum of slope number `slope` into spectrum number `to`.
    /// Returns false if the slope is zero at all samples.
    pub(super) fn slope_spectrum(&mut self, slope: usize, to: usize) -> bool {
        if self.slopes[slope].iter().all(|s| *s == 0.0) {
            return false;
        }
        let n = self.samples();
        self.work.copy_from_slice(&self.slopes[slope]);
        let sums = self.fourier.transform(&mut self.work);
        for (m, value) in self.spectra[to].iter_mut().enumerate() {
            *value = sums[m] / n as f64;
        }
        true
    }

    /// Adds `δf_h = Σ_k (G_{h-k} δy_k + G_{h+k} δy_k*)`, `δy_k = factor(k) δU_k`, from axis `b` of
    /// the motion to axis `a` of the force. `G` is the spectrum of the slope, `self.spectra[0]`.
    pub(super) fn add_slope(
        &self,
        tangent: &mut [f64],
        (a, b): (usize, usize),
        axes: usize,
        factor: impl Fn(usize) -> Complex64,
    ) {
        let nh = self.harmonics.len();
        for (i, &h) in self.harmonics.iter().enumerate() {
            for (l, &k) in self.harmonics.iter().enumerate() {
                let (minus, plus) = spectrum_pair(&self.spectra[0], h, k);
                let by = factor(k);
                let (minus, plus) = (minus * by, plus * by.conj());
                add_block(tangent, 2 * nh * axes, (a * nh + i, h), (b * nh + l, k), as_block(minus, plus));
            }
        }
    }

    /// Allocates at least `count` signals for slopes.
    pub(super) fn reserve_slopes(&mut self, count: usize) {
        let n = self.samples();
        while self.slopes.len() < count {
            self.slopes.push(vec![0.0; n]);
        }
    }
}

/// Returns the factor from a sum over `n` samples to the amplitude of harmonic `h`.
pub(super) fn amplitude_factor(h: usize, n: usize) -> f64 {
    if h == 0 { 1.0 / n as f64 } else { 2.0 / n as f64 }
}

/// Returns the real 2 × 2 block of `δf = minus δU + plus δU*`.
#[inline]
pub(super) fn as_block(minus: Complex64, plus: Complex64) -> [f64; 4] {
    [minus.re + plus.re, plus.im - minus.im, minus.im + plus.im, minus.re - plus.re]
}

/// Returns `G_{h-k}` and `G_{h+k}` of a real signal.
#[inline]
pub(super) fn spectrum_pair(spectrum: &[Complex64], h: usize, k: usize) -> (Complex64, Complex64) {
    (if h >= k { spectrum[h - k] } else { spectrum[k - h].conj() }, spectrum[h + k])
}

/// Adds a 2 × 2 block. The mean has half the weight of the other harmonics and no imaginary part.
#[inline]
pub(super) fn add_block(
    tangent: &mut [f64],
    size: usize,
    row: (usize, usize),
    column: (usize, usize),
    block: [f64; 4],
) {
    let weight = if row.1 == 0 { 0.5 } else { 1.0 };
    add_entries(tangent, size, row, column, block.map(|x| weight * x));
}

/// Adds a 2 × 2 block without the weight. `a` and `b` are numbers of complex
/// unknowns, `h` and `k` their harmonics.
#[inline]
pub(super) fn add_entries(
    tangent: &mut [f64],
    size: usize,
    (a, h): (usize, usize),
    (b, k): (usize, usize),
    block: [f64; 4],
) {
    let at = 2 * a * size + 2 * b;
    tangent[at] += block[0];
    if k > 0 {
        tangent[at + 1] += block[1];
    }
    if h > 0 {
        tangent[at + size] += block[2];
        if k > 0 {
            tangent[at + size + 1] += block[3];
        }
    }
}
