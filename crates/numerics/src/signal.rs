//! Real signals that are sums of complex exponentials: values, derivatives,
//! integrals, bounds and first zeros.
//!
//! The response of a linear system to harmonic forces is
//! `g(τ) = Re Σ_b c_b B_b(τ)`. The basis functions `B_b` are
//! - `e^{s τ}` for the modes of the system and for the harmonics of the excitation,
//! - `(e^{(s+δ) τ} - e^{s τ}) / δ` for a mode `s` in (near) resonance with the excitation `s + δ`,
//! - `1` for constant forces, and `τ, τ²/2` for bodies that are free to move.
//!
//! Values, derivatives, integrals and bounds of such a signal have closed forms. A bound on the
//! second derivative gives a step without any zero of the signal. [`ExponentialBasis::first_zero`]
//! advances by such steps and therefore misses no zero.

use crate::quadrature;
use num_complex::Complex64;

/// The basis functions `B_b(τ)` that all signals of one time interval share.
///
/// The order of the coefficients is: exponentials, resonant pairs, the
/// constant, and `τ, τ²/2` if `drifts` is set.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExponentialBasis {
    /// Exponents `s`, rad/s.
    pub exponents: Vec<Complex64>,
    /// Resonant pairs `(s, δ)`, rad/s.
    pub resonant: Vec<(Complex64, Complex64)>,
    /// Index into `exponents` of `s + δ` for every resonant pair.
    pub driven_by: Vec<usize>,
    /// If true, `τ, τ²/2` are among the functions.
    pub drifts: bool,
}

/// Below this `|δ τ|` the quotient `(e^{δτ} - 1)/δ` loses digits. Its series up
/// to the 4th power is then exact to rounding.
const SERIES_BELOW: f64 = 1e-3;

/// Returns `(e^z - 1) / z`, accurate for every `z`.
#[inline]
fn phi1(z: Complex64) -> Complex64 {
    if z.norm_sqr() < SERIES_BELOW * SERIES_BELOW { phi1_series(z) } else { (z.exp() - 1.0) / z }
}

/// Returns [`phi1`] for a known `e^z`.
#[inline]
fn phi1_from_exp(z: Complex64, exp: Complex64) -> Complex64 {
    if z.norm_sqr() < SERIES_BELOW * SERIES_BELOW { phi1_series(z) } else { (exp - 1.0) / z }
}

fn phi1_series(z: Complex64) -> Complex64 {
    Complex64::new(1.0, 0.0) + z * (0.5 + z * (1.0 / 6.0 + z * (1.0 / 24.0 + z / 120.0)))
}

/// The result of a search for the first zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FirstZero {
    /// No signal vanishes before the end.
    None,
    /// Signal `index` reaches zero at `time`.
    Found {
        /// Index of the signal.
        index: usize,
        /// Time of the zero, s.
        time: f64,
    },
    /// The search did not reach the end within the work limit: the signals
    /// oscillate too fast for the interval.
    TooManySteps,
}

/// The state of a monitored signal at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InitialSign {
    /// The signal is positive.
    Positive,
    /// The signal is zero within this tolerance and expected to rise. Its first nonzero derivative
    /// decides. A signal that rises too slowly to be told from zero is raised by twice the
    /// tolerance, or by more if it begins further below zero.
    Zero(f64),
}

impl ExponentialBasis {
    /// Returns the number of coefficients of a signal.
    pub fn len(&self) -> usize {
        self.constant() + if self.drifts { 3 } else { 1 }
    }
    /// Returns false: every basis contains at least the constant.
    pub fn is_empty(&self) -> bool {
        false
    }
    /// Returns the index of the constant among the coefficients.
    #[inline]
    pub fn constant(&self) -> usize {
        self.exponents.len() + self.resonant.len()
    }

    /// Computes the basis functions at `time` into `out` (length [`ExponentialBasis::len`]).
    #[inline]
    pub fn evaluate(&self, time: f64, out: &mut [Complex64]) {
        self.evaluate_and(time, out, |_, _| {});
    }

    /// Computes the basis functions like [`ExponentialBasis::evaluate`]. `size` receives
    /// the magnitude of every exponential that decays or grows.
    #[inline]
    pub(crate) fn evaluate_and(&self, time: f64, out: &mut [Complex64], mut size: impl FnMut(usize, f64)) {
        let e = self.exponents.len();
        if time == 0.0 {
            out[..e].fill(Complex64::new(1.0, 0.0));
            out[e..].fill(Complex64::new(0.0, 0.0));
            out[self.constant()] = Complex64::new(1.0, 0.0);
            return;
        }
        for (b, (value, s)) in out[..e].iter_mut().zip(&self.exponents).enumerate() {
            let (sin, cos) = (s.im * time).sin_cos();
            if s.re == 0.0 {
                *value = Complex64::new(cos, sin);
            } else {
                let decay = (s.re * time).exp();
                size(b, decay);
                *value = Complex64::new(decay * cos, decay * sin);
            }
        }
        for (value, (s, delta)) in out[e..].iter_mut().zip(&self.resonant) {
            *value = (s * time).exp() * time * phi1(delta * time);
        }
        let c = self.constant();
        out[c] = Complex64::new(1.0, 0.0);
        if self.drifts {
            out[c + 1] = Complex64::new(time, 0.0);
            out[c + 2] = Complex64::new(0.5 * time * time, 0.0);
        }
    }

    /// Returns the value of a signal at `τ = 0`: the coefficients of the exponentials and of
    /// the constant. Resonant pairs contribute nothing.
    pub fn initial_value(&self, coefficients: &[Complex64]) -> f64 {
        coefficients[..self.exponents.len()].iter().map(|c| c.re).sum::<f64>() + coefficients[self.constant()].re
    }

    /// Computes the coefficients of the derivative of a signal into `out`.
    #[inline]
    pub fn differentiate(&self, coefficients: &[Complex64], out: &mut [Complex64]) {
        let e = self.exponents.len();
        for ((d, c), s) in out[..e].iter_mut().zip(coefficients).zip(&self.exponents) {
            *d = c * s;
        }
        // B' = s B + e^{(s+δ)τ}
        for (r, (s, _)) in self.resonant.iter().enumerate() {
            out[e + r] = coefficients[e + r] * s;
            out[self.driven_by[r]] += coefficients[e + r];
        }
        let c = self.constant();
        out[c] = Complex64::new(0.0, 0.0);
        if self.drifts {
            (out[c], out[c + 1], out[c + 2]) = (coefficients[c + 1], coefficients[c + 2], out[c]);
        }
    }

    /// Computes the coefficients of `factor · g(time + τ)` as a signal of τ into `out`.
    /// `values` are the basis functions at `time`.
    pub fn shift(
        &self,
        coefficients: &[Complex64],
        time: f64,
        values: &[Complex64],
        factor: f64,
        out: &mut [Complex64],
    ) {
        let (e, c) = (self.exponents.len(), self.constant());
        for ((o, g), value) in out[..e].iter_mut().zip(coefficients).zip(values) {
            *o = g * value * factor;
        }
        for (r, (s, _)) in self.resonant.iter().enumerate() {
            // D(a + τ) = e^{sa} D(τ) + D(a) e^{(s+δ)τ}
            let g = coefficients[e + r] * factor;
            out[e + r] = g * (s * time).exp();
            out[self.driven_by[r]] += g * values[e + r];
        }
        out[c] = coefficients[c] * factor;
        if self.drifts {
            let (one, linear, square) = (coefficients[c], coefficients[c + 1], coefficients[c + 2]);
            out[c] = (one + linear * time + square * (0.5 * time * time)) * factor;
            out[c + 1] = (linear + square * time) * factor;
            out[c + 2] = square * factor;
        }
    }

    /// Computes the magnitudes of the exponents into `out`.
    pub(crate) fn exponent_magnitudes(&self, out: &mut [f64]) {
        let every = self.exponents.iter().chain(self.resonant.iter().map(|(s, _)| s));
        out.iter_mut().zip(every).for_each(|(speed, s)| *speed = magnitude(s));
    }

    /// Computes bounds on the magnitudes of the coefficients of a derivative into `out`.
    /// `sizes` are those of the signal.
    #[inline]
    pub(crate) fn differentiate_sizes(&self, sizes: &[f64], exponent_magnitudes: &[f64], out: &mut [f64]) {
        let (e, c) = (self.exponents.len(), self.constant());
        for ((out, size), speed) in out[..c].iter_mut().zip(sizes).zip(exponent_magnitudes) {
            *out = size * speed;
        }
        for (r, &driven_by) in self.driven_by.iter().enumerate() {
            out[driven_by] += sizes[e + r];
        }
        out[c] = 0.0;
        if self.drifts {
            (out[c], out[c + 1], out[c + 2]) = (sizes[c + 1], sizes[c + 2], 0.0);
        }
    }

    /// Computes the bounds `max |B_b|` over `[0, end]` into `out`.
    pub(crate) fn magnitudes(&self, end: f64, out: &mut [f64]) {
        let e = self.exponents.len();
        for (value, s) in out[..e].iter_mut().zip(&self.exponents) {
            *value = if s.re > 0.0 { (s.re * end).exp() } else { 1.0 };
        }
        for (value, (s, delta)) in out[e..].iter_mut().zip(&self.resonant) {
            // |e^{sτ} τ φ(δτ)| ≤ τ e^{max(Re s, Re (s+δ), 0) τ}
            *value = end * (s.re.max(s.re + delta.re).max(0.0) * end).exp();
        }
        let c = self.constant();
        out[c] = 1.0;
        if self.drifts {
            (out[c + 1], out[c + 2]) = (end, 0.5 * end * end);
        }
    }

    /// Returns the first time in `(0, end]` at which one of the `signals` vanishes.
    ///
    /// `signals` contains the coefficients of all signals, and `begins` the state of each at
    /// the start. All signals are positive before the first zero. A step h satisfies
    /// `g + g' h - max|g''| h²/2 > 0`, so no zero is missed. The value of the second derivative
    /// and a bound on the third may permit a longer step. Close to a simple zero the steps
    /// converge cubically, from the left. `scratch` is scratch memory.
    pub fn first_zero(
        &self,
        signals: &[Complex64],
        begins: &[InitialSign],
        end: f64,
        scratch: &mut ZeroScratch,
    ) -> FirstZero {
        let (nb, count) = (self.len(), begins.len());
        scratch.prepare(nb, count);
        let ZeroScratch {
            values,
            magnitudes,
            exponent_magnitudes,
            first,
            second,
            second_weights,
            third_weights,
            zero_free_until,
            raised,
            rising,
        } = scratch;
        self.exponent_magnitudes(exponent_magnitudes);
        for k in 0..count {
            let range = k * nb..(k + 1) * nb;
            self.differentiate(&signals[range.clone()], &mut first[range.clone()]);
            self.differentiate(&first[range.clone()], &mut second[range.clone()]);
            let (weights, signal) = (&mut second_weights[range.clone()], &second[range.clone()]);
            weights.iter_mut().zip(signal).for_each(|(weight, c)| *weight = magnitude(c));
            self.differentiate_sizes(weights, exponent_magnitudes, &mut third_weights[range]);
        }
        self.magnitudes(end, magnitudes);
        for k in 0..count {
            (zero_free_until[k], raised[k]) = match begins[k] {
                InitialSign::Positive => (0.0, 0.0),
                InitialSign::Zero(tolerance) => {
                    let range = k * nb..(k + 1) * nb;
                    let Some((until, value)) = self.rises_until(&first[range.clone()], magnitudes, rising) else {
                        return FirstZero::Found { index: k, time: 0.0 };
                    };
                    // ten times the rounding errors of a signal
                    let resolved = 1e-12 * signals[range.clone()].iter().map(magnitude).sum::<f64>();
                    let raise = || 2.0 * tolerance.max(-self.initial_value(&signals[range]));
                    (until, if value > resolved { 0.0 } else { raise() })
                }
            };
        }
        let mut time = 0.0;
        // Shortest step as a fraction of the interval: about the rounding of the time.
        let resolution = 4e-16 * end;
        // Maximum number of steps of a search, and the number from which on all steps may use
        // higher derivatives. A period of an orbit takes 10 to 100.
        for steps in 0..100_000 {
            let is_slow = steps >= 1000;
            self.evaluate_and(time, values, |b, size| {
                if self.exponents[b].re < 0.0 {
                    magnitudes[b] = size; // it decays from here on
                }
            });
            let (mut step, mut nearest, mut converged) = (f64::INFINITY, 0, false);
            for k in 0..count {
                if time < zero_free_until[k] {
                    if zero_free_until[k] - time < step {
                        (step, nearest, converged) = (zero_free_until[k] - time, k, false);
                    }
                    continue;
                }
                let range = k * nb..(k + 1) * nb;
                let g = real_dot(&signals[range.clone()], values) + raised[k];
                if g <= 0.0 {
                    return FirstZero::Found { index: k, time };
                }
                let slope = real_dot(&first[range.clone()], values);
                let bound = magnitude_bound(&second_weights[range.clone()], magnitudes);
                let safe = first_root(g, slope, -bound);
                if raised[k] > 0.0 || is_slow {
                    let flat = self.flat_until(&first[range.clone()], (values, magnitudes), g, rising);
                    if flat > safe {
                        if flat < step {
                            (step, nearest, converged) = (flat, k, false);
                        }
                        continue;
                    }
                }
                if safe >= step {
                    continue;
                }
                // Over twice that step the second derivative stays within `change` of its value.
                let reach = 2.0 * safe;
                let curvature = real_dot(&second[range.clone()], values);
                let change = reach * magnitude_bound(&third_weights[range], magnitudes);
                let (mut first_possible, mut last_possible) = (safe, f64::INFINITY);
                if curvature - change > -bound {
                    first_possible = first_root(g, slope, curvature - change).min(reach);
                    last_possible = first_root(g, slope, curvature + change);
                }
                if first_possible < step {
                    // The interval of the zero is below the resolution of the time.
                    let converged_here = last_possible <= reach && last_possible - first_possible <= resolution;
                    (step, nearest, converged) = (first_possible, k, converged_here);
                }
            }
            if time + step >= end {
                return FirstZero::None;
            }
            if converged {
                return FirstZero::Found { index: nearest, time: time + step };
            }
            if step <= resolution {
                let range = nearest * nb..(nearest + 1) * nb;
                if real_dot(&first[range], values) <= 0.0 {
                    return FirstZero::Found { index: nearest, time };
                }
                step = resolution; // the signal touches zero and rises again
            }
            time += step;
        }
        FirstZero::TooManySteps
    }

    /// Returns a time until which a signal that starts at zero stays positive, and its least value
    /// then; or `None` if it falls. `slope` is its derivative.
    fn rises_until(
        &self,
        slope: &[Complex64],
        magnitudes: &[f64],
        memory: &mut [Vec<Complex64>; 2],
    ) -> Option<(f64, f64)> {
        let [current, next] = memory;
        current.clear();
        current.extend_from_slice(slope);
        next.resize(slope.len(), Complex64::new(0.0, 0.0));
        let mut factorial = 1.0;
        for order in 1..=4 {
            factorial *= f64::from(order);
            if order > 1 {
                self.differentiate(current, next);
                std::mem::swap(current, next);
            }
            let value = self.initial_value(current);
            let size: f64 = current[..=self.constant()].iter().map(magnitude).sum();
            // A derivative of a signal counts as zero at the start if it is below this fraction
            // of its bound. The solution that leads to it has rounding errors of about 1e-13.
            if value.abs() > 1e-9 * size {
                if value < 0.0 {
                    return None;
                }
                self.differentiate(current, next);
                let bound: f64 = next.iter().zip(magnitudes).map(|(c, m)| magnitude(c) * m).sum();
                if bound == 0.0 {
                    return Some((f64::INFINITY, f64::INFINITY));
                }
                // g ≥ value τ^k/k! - bound τ^{k+1}/(k+1)!, half of the first term at this τ
                let until = 0.5 * f64::from(order + 1) * value / bound;
                return Some((until, 0.5 * value * until.powi(order) / factorial));
            }
        }
        Some((0.0, 0.0)) // flat, such as the force of a contact that stays exactly at its limit
    }

    /// Returns a time over which a signal with the value `g > 0` stays positive, by its first four
    /// derivatives and a bound on the fifth: each term may take a fifth of `g`. It is long if these
    /// derivatives are small, where a bound on the second derivative would permit short steps only.
    fn flat_until(
        &self,
        slope: &[Complex64],
        (values, magnitudes): (&[Complex64], &[f64]),
        g: f64,
        memory: &mut [Vec<Complex64>; 2],
    ) -> f64 {
        let [current, next] = memory;
        current.clear();
        current.extend_from_slice(slope);
        next.resize(slope.len(), Complex64::new(0.0, 0.0));
        let (mut least, mut factorial) = (f64::INFINITY, 1.0);
        for order in 1..=5 {
            factorial *= f64::from(order);
            let fall = match order {
                5 => current.iter().zip(magnitudes).map(|(c, m)| magnitude(c) * m).sum::<f64>(),
                _ => -real_dot(current, values),
            };
            if fall > 0.0 {
                least = f64::min(least, (0.2 * g * factorial / fall).powf(1.0 / f64::from(order)));
            }
            self.differentiate(current, next);
            std::mem::swap(current, next);
        }
        least
    }

    /// Returns true if a signal has no resonant and no drifting terms.
    fn is_exponential(&self, coefficients: &[Complex64]) -> bool {
        let zero = Complex64::new(0.0, 0.0);
        let c = self.constant();
        coefficients.iter().enumerate().skip(self.exponents.len()).all(|(b, value)| b == c || *value == zero)
    }
}

/// Integrals of products of two signals over one time interval, in closed form for exponentials.
///
/// With `e_b` the exponentials and the constant, the integrals `∫ e_b e_c dτ` and
/// `∫ e_b e_c* dτ` serve all signals of a basis.
#[derive(Debug, Clone, Default)]
pub struct ProductIntegrals {
    length: f64,
    /// Number of exponentials plus one for the constant.
    terms: usize,
    /// `∫ e_b e_c dτ`, terms × terms.
    plain: Vec<Complex64>,
    /// `∫ e_b e_c* dτ`, terms × terms.
    mixed: Vec<Complex64>,
}

impl ProductIntegrals {
    /// Computes the integrals over `[0, length]`. `at_end` contains the basis
    /// functions at `length`.
    pub fn new(basis: &ExponentialBasis, at_end: &[Complex64], length: f64) -> Self {
        let (e, zero, one) = (basis.exponents.len(), Complex64::new(0.0, 0.0), Complex64::new(1.0, 0.0));
        let terms = e + 1;
        let term = |b: usize| if b < e { (basis.exponents[b], at_end[b]) } else { (zero, one) };
        let (mut plain, mut mixed) = (vec![zero; terms * terms], vec![zero; terms * terms]);
        for b in 0..terms {
            let (s, s_end) = term(b);
            for c in 0..=b {
                let (r, r_end) = term(c);
                let value = phi1_from_exp((s + r) * length, s_end * r_end) * length;
                plain[b * terms + c] = value;
                plain[c * terms + b] = value;
                let value = phi1_from_exp((s + r.conj()) * length, s_end * r_end.conj()) * length;
                mixed[b * terms + c] = value;
                mixed[c * terms + b] = value.conj();
            }
        }
        ProductIntegrals { length, terms, plain, mixed }
    }

    /// Returns `∫ g h dτ`.
    pub fn integral(&self, basis: &ExponentialBasis, g: &[Complex64], h: &[Complex64]) -> f64 {
        if !(basis.is_exponential(g) && basis.is_exponential(h)) {
            return quadrature(Signal { basis, coefficients: g }, Signal { basis, coefficients: h }, self.length);
        }
        let zero = Complex64::new(0.0, 0.0);
        let coefficient =
            |coefficients: &[Complex64], b: usize| coefficients[if b + 1 < self.terms { b } else { basis.constant() }];
        let mut sum = 0.0;
        for b in 0..self.terms {
            let c = coefficient(g, b);
            if c == zero {
                continue;
            }
            // Re a Re b = Re (a b + a b*) / 2
            let mut inner = zero;
            for k in 0..self.terms {
                let d = coefficient(h, k);
                inner += d * self.plain[b * self.terms + k] + d.conj() * self.mixed[b * self.terms + k];
            }
            sum += 0.5 * (c * inner).re;
        }
        sum
    }
}

/// Fourier integrals `∫ g e^{-jντ} dτ` of signals over one time interval, in
/// closed form for exponentials.
#[derive(Debug, Clone, Default)]
pub struct FourierIntegrals {
    nu: f64,
    length: f64,
    /// `∫ e_b e^{-jντ} dτ` and `∫ e_b* e^{-jντ} dτ` for the exponentials and the constant.
    terms: Vec<(Complex64, Complex64)>,
}

impl FourierIntegrals {
    /// Computes the integrals over `[0, length]` at `nu` (rad/s). `at_end`
    /// contains the basis functions at `length`.
    pub fn new(basis: &ExponentialBasis, at_end: &[Complex64], nu: f64, length: f64) -> Self {
        let (sin, cos) = (nu * length).sin_cos();
        let (rate, turn) = (Complex64::new(0.0, -nu), Complex64::new(cos, -sin));
        let constant = (Complex64::new(0.0, 0.0), Complex64::new(1.0, 0.0));
        let terms = basis.exponents.iter().copied().zip(at_end.iter().copied()).chain([constant]).map(|(s, end)| {
            let part = |s: Complex64, end: Complex64| phi1_from_exp((s + rate) * length, end * turn) * length;
            (part(s, end), part(s.conj(), end.conj()))
        });
        FourierIntegrals { nu, length, terms: terms.collect() }
    }

    /// Returns `∫ g e^{-jντ} dτ`.
    pub fn integral(&self, basis: &ExponentialBasis, g: &[Complex64]) -> Complex64 {
        if !basis.is_exponential(g) {
            let probe =
                ExponentialBasis { exponents: vec![Complex64::new(0.0, self.nu)], ..ExponentialBasis::default() };
            let part = |turn: Complex64| {
                let wave = [turn, Complex64::new(0.0, 0.0)];
                let signal = Signal { basis, coefficients: g };
                quadrature(signal, Signal { basis: &probe, coefficients: &wave }, self.length)
            };
            // Re e^{jντ} = cos ντ, Re(-j e^{jντ}) = sin ντ
            return Complex64::new(part(Complex64::new(1.0, 0.0)), -part(Complex64::new(0.0, -1.0)));
        }
        let constant = g[basis.constant()];
        let coefficients = g[..basis.exponents.len()].iter().chain([&constant]);
        // Re a = (a + a*) / 2
        coefficients.zip(&self.terms).map(|(c, (plain, conjugate))| c * plain + c.conj() * conjugate).sum::<Complex64>()
            * 0.5
    }
}

/// Quadrature nodes and weights of a panel.
const NODES: [(f64, f64); 8] = quadrature::from_center(quadrature::GAUSS_8);

/// A signal with its basis.
#[derive(Clone, Copy)]
struct Signal<'a> {
    basis: &'a ExponentialBasis,
    coefficients: &'a [Complex64],
}

/// Returns `∫ g h dτ` over `[0, length]` by Gauss-Legendre quadrature in panels.
fn quadrature(g: Signal, h: Signal, length: f64) -> f64 {
    let fastest = g.basis.exponents.iter().chain(&h.basis.exponents).map(|s| s.norm()).fold(0.0, f64::max);
    // A panel has a phase of at most one of the fastest exponential: the 8-point rule is then
    // exact to rounding.
    let panels = (2.0 * fastest * length).ceil().clamp(1.0, 1e5) as usize;
    let width = length / panels as f64;
    let zero = Complex64::new(0.0, 0.0);
    let (mut gv, mut hv) = (vec![zero; g.basis.len()], vec![zero; h.basis.len()]);
    let mut sum = 0.0;
    for panel in 0..panels {
        let middle = (panel as f64 + 0.5) * width;
        for (node, weight) in NODES {
            let time = middle + node * 0.5 * width;
            g.basis.evaluate(time, &mut gv);
            h.basis.evaluate(time, &mut hv);
            sum += weight * real_dot(g.coefficients, &gv) * real_dot(h.coefficients, &hv);
        }
    }
    0.5 * width * sum
}

/// Returns the first positive root of `g + slope h + curvature h²/2`, `g > 0`,
/// in the form without cancellation.
#[inline]
fn first_root(g: f64, slope: f64, curvature: f64) -> f64 {
    let square = slope * slope - 2.0 * curvature * g;
    if square < 0.0 || (slope >= 0.0 && curvature >= 0.0) {
        return f64::INFINITY;
    }
    let root = square.sqrt();
    if slope < 0.0 { 2.0 * g / (root - slope) } else { (slope + root) / -curvature }
}

/// Returns a bound of a signal from the magnitudes of its coefficients and of the basis functions.
#[inline]
pub(crate) fn magnitude_bound(weights: &[f64], magnitudes: &[f64]) -> f64 {
    weights.iter().zip(magnitudes).map(|(w, m)| w * m).sum()
}

/// Returns the magnitude of a coefficient. Overflow cannot occur here, so the
/// slower `hypot` is not needed.
#[inline]
pub fn magnitude(c: &Complex64) -> f64 {
    c.norm_sqr().sqrt()
}

/// Returns `Re Σ c_b B_b`.
#[inline]
pub fn real_dot(coefficients: &[Complex64], values: &[Complex64]) -> f64 {
    coefficients.iter().zip(values).map(|(c, v)| c.re * v.re - c.im * v.im).sum()
}

/// Scratch memory of [`ExponentialBasis::first_zero`], reused between calls.
#[derive(Debug, Clone, Default)]
pub struct ZeroScratch {
    values: Vec<Complex64>,
    magnitudes: Vec<f64>,
    exponent_magnitudes: Vec<f64>,
    first: Vec<Complex64>,
    second: Vec<Complex64>,
    second_weights: Vec<f64>,
    third_weights: Vec<f64>,
    zero_free_until: Vec<f64>,
    raised: Vec<f64>,
    rising: [Vec<Complex64>; 2],
}

impl ZeroScratch {
    fn prepare(&mut self, nb: usize, count: usize) {
        let zero = Complex64::new(0.0, 0.0);
        self.values.resize(nb, zero);
        self.magnitudes.resize(nb, 0.0);
        self.exponent_magnitudes.resize(nb, 0.0);
        self.first.resize(nb * count, zero);
        self.second.resize(nb * count, zero);
        self.second_weights.resize(nb * count, 0.0);
        self.third_weights.resize(nb * count, 0.0);
        self.zero_free_until.resize(count, 0.0);
        self.raised.resize(count, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn c(re: f64, im: f64) -> Complex64 {
        Complex64::new(re, im)
    }

    /// 0.999 - cos τ dips narrowly below zero, and the search finds it.
    /// 1.000001 - cos τ has no zero.
    #[test]
    fn narrow_dips_are_found_and_near_misses_are_not_zeros() {
        let basis = ExponentialBasis { exponents: vec![c(0.0, 1.0)], ..ExponentialBasis::default() };
        let mut scratch = ZeroScratch::default();
        let dip = [c(-1.0, 0.0), c(0.999, 0.0)];
        // At τ = 0 the signal is below zero, so it is shifted: g(τ) = 0.999 - cos(τ + 1).
        let shifted = [dip[0] * c(0.0, 1.0).exp(), dip[1]];
        let FirstZero::Found { time, .. } = basis.first_zero(&shifted, &[InitialSign::Positive], 10.0, &mut scratch)
        else {
            panic!("a zero was missed");
        };
        assert!((time - (2.0 * std::f64::consts::PI - 1.0 - 0.999f64.acos())).abs() < 1e-14, "{time}");
        let near_miss = [dip[0], c(1.000_001, 0.0)];
        assert_eq!(basis.first_zero(&near_miss, &[InitialSign::Positive], 100.0, &mut scratch), FirstZero::None);
    }

    /// A signal that starts at zero and rises has no zero there: 1 - cos τ
    /// starts with a zero value and a zero slope.
    #[test]
    fn a_start_at_zero_is_no_zero() {
        let basis = ExponentialBasis { exponents: vec![c(0.0, 1.0)], ..ExponentialBasis::default() };
        let g = [c(-1.0, 0.0), c(1.0, 0.0)];
        let mut scratch = ZeroScratch::default();
        assert_eq!(basis.first_zero(&g, &[InitialSign::Zero(1e-10)], 6.0, &mut scratch), FirstZero::None);
        let sine = [c(0.0, -1.0), c(0.0, 0.0)];
        let FirstZero::Found { time, .. } = basis.first_zero(&sine, &[InitialSign::Zero(1e-10)], 6.0, &mut scratch)
        else {
            panic!("the zero at pi was missed");
        };
        assert!((time - std::f64::consts::PI).abs() < 1e-14);
        let falling = [c(1.0, 0.0), c(-1.0, 0.0)];
        assert_eq!(
            basis.first_zero(&falling, &[InitialSign::Zero(1e-10)], 6.0, &mut scratch),
            FirstZero::Found { index: 0, time: 0.0 }
        );
    }

    /// `cos τ - cos 2τ/4 - 3/4` and a constant that rounding has lowered by 1e-13: the signal rises
    /// with the fourth power of time, and its rounding is no zero.
    #[test]
    fn a_slow_rise_is_no_zero() {
        let basis = ExponentialBasis { exponents: vec![c(0.0, 1.0), c(0.0, 2.0)], ..ExponentialBasis::default() };
        let falls = |sign: f64| [c(sign, 0.0), c(-0.25 * sign, 0.0), c(-0.75 * sign - 1e-13, 0.0)];
        let mut scratch = ZeroScratch::default();
        let slow = [InitialSign::Zero(1e-10)];
        assert_eq!(basis.first_zero(&falls(-1.0), &slow, 6.0, &mut scratch), FirstZero::None);
        let found = basis.first_zero(&falls(1.0), &slow, 6.0, &mut scratch);
        assert_eq!(found, FirstZero::Found { index: 0, time: 0.0 });
    }

    /// The closed-form integrals agree with quadrature, and the derivatives of
    /// the basis functions with differences.
    #[test]
    fn integrals_agree_with_quadrature() {
        let (s, delta) = (c(-0.1, 2.0), c(0.1, 1e-7));
        let exponents = vec![s, s + delta, c(-30.0, 0.0)];
        let basis = ExponentialBasis { exponents, resonant: vec![(s, delta)], driven_by: vec![1], drifts: true };
        let zero = c(0.0, 0.0);
        let g = [c(1.0, 0.5), c(-0.3, 0.2), c(0.7, 0.0), zero, c(0.4, 0.0), zero, zero];
        let mut end = vec![zero; basis.len()];
        basis.evaluate(3.0, &mut end);
        let exact = ProductIntegrals::new(&basis, &end, 3.0).integral(&basis, &g, &g);
        let signal = Signal { basis: &basis, coefficients: &g };
        let numeric = quadrature(signal, signal, 3.0);
        assert!((exact - numeric).abs() < 1e-13 * exact.abs(), "{exact} {numeric}");
        let nu = 1.7;
        let of = FourierIntegrals::new(&basis, &end, nu, 3.0).integral(&basis, &g);
        let probe = ExponentialBasis { exponents: vec![c(0.0, nu)], ..ExponentialBasis::default() };
        let part = |turn| quadrature(signal, Signal { basis: &probe, coefficients: &[turn, zero] }, 3.0);
        assert!((of - c(part(c(1.0, 0.0)), -part(c(0.0, -1.0)))).norm() < 1e-13 * of.norm(), "{of}");
        // The derivative of every basis function, by differences.
        for b in 0..basis.len() {
            let mut unit = vec![zero; basis.len()];
            unit[b] = c(0.8, -0.6);
            let (mut d, mut low, mut high) = (unit.clone(), unit.clone(), unit.clone());
            basis.differentiate(&unit, &mut d);
            let (t, h) = (0.9, 1e-5);
            basis.evaluate(t - h, &mut low);
            basis.evaluate(t + h, &mut high);
            let difference = (real_dot(&unit, &high) - real_dot(&unit, &low)) / (2.0 * h);
            let mut at = unit.clone();
            basis.evaluate(t, &mut at);
            assert!((difference - real_dot(&d, &at)).abs() < 1e-7, "function {b}");
        }
    }
}
