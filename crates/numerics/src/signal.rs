//! Real signals that are sums of complex exponentials, and what can be known of them exactly.
//!
//! The motion of a linear system under harmonic forces is
//! `g(τ) = Re Σ_b c_b B_b(τ)`, where the basis functions `B_b` are
//! - `e^{s τ}` for the modes of the system and for the harmonics of the drive,
//! - `(e^{(s+δ) τ} - e^{s τ}) / δ` for a mode `s` that the drive `s + δ` hits (nearly) exactly,
//! - `1, τ, τ²/2` for constant forces and for bodies that are free to move.
//!
//! Values, derivatives, integrals and bounds of such a signal are closed forms. The bound on the second derivative gives a step
//! over which the signal provably has no zero: [`Basis::first_zero`] marches with such steps and therefore misses none.

use num_complex::Complex64;

/// Number of polynomial basis functions: `1, τ, τ²/2`.
pub const POLYNOMIALS: usize = 3;

/// The functions `B_b(τ)` that the signals of one stretch of time share.
///
/// Coefficients are ordered: exponentials, resonant pairs, polynomials.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Basis {
    /// Exponents `s`, rad/s.
    pub exponents: Vec<Complex64>,
    /// Resonant pairs `(s, δ)`, rad/s.
    pub resonant: Vec<(Complex64, Complex64)>,
    /// Index into `exponents` of `s + δ` for every resonant pair.
    pub driven_by: Vec<usize>,
}

/// Below this `|δ τ|` the quotient `(e^{δτ} - 1)/δ` loses digits, and its series (to the 4th power) is exact to rounding.
const SERIES_BELOW: f64 = 1e-3;

/// `(e^z - 1) / z`, accurate for every `z`.
#[inline]
fn phi1(z: Complex64) -> Complex64 {
    if z.norm_sqr() < SERIES_BELOW * SERIES_BELOW {
        Complex64::new(1.0, 0.0) + z * (0.5 + z * (1.0 / 6.0 + z * (1.0 / 24.0 + z / 120.0)))
    } else {
        (z.exp() - 1.0) / z
    }
}

/// Where a march for the first zero ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FirstZero {
    /// None of the signals vanishes up to the end.
    None,
    /// Signal `index` reaches zero at `time`.
    At {
        /// Which signal.
        index: usize,
        /// When, s.
        time: f64,
    },
    /// The march did not reach the end within the allowed steps: the signals oscillate too fast for the interval.
    TooManySteps,
}

/// How a monitored signal begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Begin {
    /// It is positive at the start.
    Positive,
    /// It starts from zero and is expected to rise: its first non-vanishing derivative decides.
    Zero,
}

/// Steps after which a march gives up. A period of an orbit takes 10 to 100.
const MARCH_STEPS: usize = 100_000;

/// A step is never shorter than this fraction of the interval: about the rounding error of time itself.
const TIME_RESOLUTION: f64 = 4e-16;

/// A derivative counts as zero at the start of a signal when it is below this fraction of its own bound; the solution that
/// leads to it carries rounding errors of about 1e-13.
const VANISHES: f64 = 1e-9;

impl Basis {
    /// Number of coefficients of a signal.
    pub fn len(&self) -> usize {
        self.exponents.len() + self.resonant.len() + POLYNOMIALS
    }
    /// A basis is never empty: it has at least the polynomials.
    pub fn is_empty(&self) -> bool {
        false
    }
    /// Index of the constant among the coefficients.
    #[inline]
    pub fn constant(&self) -> usize {
        self.exponents.len() + self.resonant.len()
    }

    /// The basis functions at `time`, into `out` (length [`Basis::len`]).
    #[inline]
    pub fn evaluate(&self, time: f64, out: &mut [Complex64]) {
        let e = self.exponents.len();
        for (value, s) in out[..e].iter_mut().zip(&self.exponents) {
            let (sin, cos) = (s.im * time).sin_cos();
            let decay = if s.re == 0.0 { 1.0 } else { (s.re * time).exp() };
            *value = Complex64::new(decay * cos, decay * sin);
        }
        for (value, (s, delta)) in out[e..].iter_mut().zip(&self.resonant) {
            *value = (s * time).exp() * time * phi1(delta * time);
        }
        let c = self.constant();
        out[c] = Complex64::new(1.0, 0.0);
        out[c + 1] = Complex64::new(time, 0.0);
        out[c + 2] = Complex64::new(0.5 * time * time, 0.0);
    }

    /// Coefficients of the derivative of a signal, into `out`.
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
        out[c] = coefficients[c + 1];
        out[c + 1] = coefficients[c + 2];
        out[c + 2] = Complex64::new(0.0, 0.0);
    }

    /// Coefficients of `factor · g(time + τ)` as a signal of τ, into `out`.
    pub fn shift(&self, coefficients: &[Complex64], time: f64, factor: f64, out: &mut [Complex64]) {
        let (e, c) = (self.exponents.len(), self.constant());
        for ((o, g), s) in out[..e].iter_mut().zip(coefficients).zip(&self.exponents) {
            *o = g * (s * time).exp() * factor;
        }
        for (r, (s, delta)) in self.resonant.iter().enumerate() {
            // D(a + τ) = e^{sa} D(τ) + D(a) e^{(s+δ)τ}
            let g = coefficients[e + r] * factor;
            out[e + r] = g * (s * time).exp();
            out[self.driven_by[r]] += g * (s * time).exp() * time * phi1(delta * time);
        }
        let (one, linear, square) = (coefficients[c], coefficients[c + 1], coefficients[c + 2]);
        out[c] = (one + linear * time + square * (0.5 * time * time)) * factor;
        out[c + 1] = (linear + square * time) * factor;
        out[c + 2] = square * factor;
    }

    /// Bounds `max |B_b|` over `[start, end]`, into `out`.
    #[inline]
    fn magnitudes(&self, start: f64, end: f64, out: &mut [f64]) {
        let e = self.exponents.len();
        for (value, s) in out[..e].iter_mut().zip(&self.exponents) {
            *value = if s.re == 0.0 { 1.0 } else { (s.re * if s.re > 0.0 { end } else { start }).exp() };
        }
        for (value, (s, delta)) in out[e..].iter_mut().zip(&self.resonant) {
            // |e^{sτ} τ φ(δτ)| ≤ τ e^{max(Re s, Re (s+δ), 0) τ}
            *value = end * (s.re.max(s.re + delta.re).max(0.0) * end).exp();
        }
        let c = self.constant();
        out[c] = 1.0;
        out[c + 1] = end;
        out[c + 2] = 0.5 * end * end;
    }

    /// The first time in `(0, end]` at which one of the `signals` vanishes.
    ///
    /// `signals` holds the coefficients one after the other, `begins` says of each how it starts. Every signal is positive until
    /// then. The march steps over `h` with `g + g' h - max|g''| h²/2 > 0`, so no zero is missed, and close to a simple zero the
    /// step is Newton's: it converges quadratically from the left. Scratch memory comes from the caller.
    pub fn first_zero(&self, signals: &[Complex64], begins: &[Begin], end: f64, scratch: &mut Scratch) -> FirstZero {
        let (nb, count) = (self.len(), begins.len());
        scratch.prepare(nb, count);
        let Scratch { values, magnitudes, first, second, weights, clear_until } = scratch;
        for k in 0..count {
            let g = &signals[k * nb..(k + 1) * nb];
            self.differentiate(g, &mut first[k * nb..(k + 1) * nb]);
            self.differentiate(&first[k * nb..(k + 1) * nb], &mut second[k * nb..(k + 1) * nb]);
            for b in 0..nb {
                weights[k * nb + b] = second[k * nb + b].norm_sqr().sqrt(); // no overflow here: hypot would only cost
            }
        }
        self.magnitudes(0.0, end, magnitudes);
        for k in 0..count {
            clear_until[k] = match begins[k] {
                Begin::Positive => 0.0,
                Begin::Zero => match self.rises_until(&signals[k * nb..(k + 1) * nb], magnitudes) {
                    Some(until) => until,
                    None => return FirstZero::At { index: k, time: 0.0 },
                },
            };
        }
        let mut time = 0.0;
        let resolution = TIME_RESOLUTION * end;
        for _ in 0..MARCH_STEPS {
            self.evaluate(time, values);
            self.magnitudes(time, end, magnitudes);
            let (mut step, mut nearest) = (f64::INFINITY, 0);
            for k in 0..count {
                if time < clear_until[k] {
                    if clear_until[k] - time < step {
                        (step, nearest) = (clear_until[k] - time, k);
                    }
                    continue;
                }
                let range = k * nb..(k + 1) * nb;
                let g = real_dot(&signals[range.clone()], values);
                if g <= 0.0 {
                    return FirstZero::At { index: k, time };
                }
                let slope = real_dot(&first[range.clone()], values);
                let bound: f64 = weights[range].iter().zip(&*magnitudes).map(|(w, m)| w * m).sum();
                // the positive root of g + slope h - bound h²/2, in the form that does not cancel
                let root = (slope * slope + 2.0 * bound * g).sqrt();
                let safe = if slope < 0.0 { 2.0 * g / (root - slope) } else { (slope + root) / bound };
                if safe < step {
                    (step, nearest) = (safe, k);
                }
            }
            if time + step >= end {
                return FirstZero::None;
            }
            if step <= resolution {
                let range = nearest * nb..(nearest + 1) * nb;
                if real_dot(&first[range], values) <= 0.0 {
                    return FirstZero::At { index: nearest, time };
                }
                step = resolution; // it touches zero and rises again
            }
            time += step;
        }
        FirstZero::TooManySteps
    }

    /// For a signal that starts at zero: how long it certainly stays positive, or `None` if it falls.
    fn rises_until(&self, signal: &[Complex64], magnitudes: &[f64]) -> Option<f64> {
        let nb = self.len();
        let mut current = signal.to_vec();
        let mut next = vec![Complex64::new(0.0, 0.0); nb];
        for order in 1..=4 {
            self.differentiate(&current, &mut next);
            std::mem::swap(&mut current, &mut next);
            // polynomials contribute their constant at τ = 0, exponentials their coefficient, resonant pairs nothing
            let value: f64 =
                current[..self.exponents.len()].iter().map(|c| c.re).sum::<f64>() + current[self.constant()].re;
            let size: f64 = current[..=self.constant()].iter().map(|c| c.norm()).sum();
            if value.abs() > VANISHES * size {
                if value < 0.0 {
                    return None;
                }
                self.differentiate(&current, &mut next);
                let bound: f64 = next.iter().zip(magnitudes).map(|(c, m)| c.norm() * m).sum();
                // g ≥ value τ^k/k! - bound τ^{k+1}/(k+1)!
                return Some(if bound == 0.0 { f64::INFINITY } else { 0.5 * f64::from(order + 1) * value / bound });
            }
        }
        Some(f64::INFINITY) // flat: a contact that stays exactly at its limit
    }

    /// `∫ g dτ` over `[0, length]`.
    pub fn integral(&self, coefficients: &[Complex64], length: f64) -> f64 {
        self.fourier_integral(coefficients, 0.0, length).re
    }

    /// `∫ g e^{-jντ} dτ` over `[0, length]`.
    pub fn fourier_integral(&self, coefficients: &[Complex64], nu: f64, length: f64) -> Complex64 {
        let probe = Basis { exponents: vec![Complex64::new(0.0, nu)], ..Basis::default() };
        let part = |turn: Complex64| {
            let mut harmonic = [Complex64::new(0.0, 0.0); 1 + POLYNOMIALS];
            harmonic[0] = turn;
            integral_of_product((self, coefficients), (&probe, &harmonic), length)
        };
        // Re e^{jντ} = cos ντ, Re(-j e^{jντ}) = sin ντ
        Complex64::new(part(Complex64::new(1.0, 0.0)), -part(Complex64::new(0.0, -1.0)))
    }

    fn is_exponential(&self, coefficients: &[Complex64]) -> bool {
        let zero = Complex64::new(0.0, 0.0);
        let c = self.constant();
        coefficients.iter().enumerate().skip(self.exponents.len()).all(|(b, value)| b == c || *value == zero)
    }
}

/// `∫ g h dτ` over `[0, length]` of two signals, in closed form for exponentials.
pub fn integral_of_product(
    (g_basis, g): (&Basis, &[Complex64]),
    (h_basis, h): (&Basis, &[Complex64]),
    length: f64,
) -> f64 {
    if !(g_basis.is_exponential(g) && h_basis.is_exponential(h)) {
        return quadrature((g_basis, g), (h_basis, h), length);
    }
    let zero = Complex64::new(0.0, 0.0);
    let terms = |basis: &Basis, coefficients: &[Complex64]| {
        let constant = (zero, coefficients[basis.constant()]);
        basis.exponents.iter().copied().zip(coefficients.iter().copied()).chain([constant]).collect::<Vec<_>>()
    };
    let mut sum = 0.0;
    let inner = terms(h_basis, h);
    for (s, c) in terms(g_basis, g) {
        if c == zero {
            continue;
        }
        for &(r, d) in &inner {
            if d != zero {
                // Re a Re b = Re (a b + a b*) / 2
                let both = c * d * phi1((s + r) * length) + c * d.conj() * phi1((s + r.conj()) * length);
                sum += 0.5 * both.re;
            }
        }
    }
    sum * length
}

/// Nodes and weights of the 8-point Gauss-Legendre rule on `[-1, 1]`, positive half. Abramowitz and Stegun, Table 25.4.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
];

/// A panel of the quadrature spans at most this phase of the fastest exponential: the 8-point rule is exact to rounding there.
const PANEL_PHASE: f64 = 1.0;

fn quadrature((g_basis, g): (&Basis, &[Complex64]), (h_basis, h): (&Basis, &[Complex64]), length: f64) -> f64 {
    let fastest = g_basis.exponents.iter().chain(&h_basis.exponents).map(|s| s.norm()).fold(0.0, f64::max);
    let panels = (2.0 * fastest * length / PANEL_PHASE).ceil().clamp(1.0, 1e5) as usize;
    let width = length / panels as f64;
    let zero = Complex64::new(0.0, 0.0);
    let (mut gv, mut hv) = (vec![zero; g_basis.len()], vec![zero; h_basis.len()]);
    let mut sum = 0.0;
    for panel in 0..panels {
        let middle = (panel as f64 + 0.5) * width;
        for (node, weight) in GAUSS {
            for sign in [-1.0, 1.0] {
                let time = middle + sign * node * 0.5 * width;
                g_basis.evaluate(time, &mut gv);
                h_basis.evaluate(time, &mut hv);
                sum += weight * real_dot(g, &gv) * real_dot(h, &hv);
            }
        }
    }
    0.5 * width * sum
}

/// `Re Σ c_b B_b`.
#[inline]
pub fn real_dot(coefficients: &[Complex64], values: &[Complex64]) -> f64 {
    coefficients.iter().zip(values).map(|(c, v)| c.re * v.re - c.im * v.im).sum()
}

/// Memory of [`Basis::first_zero`], kept between calls.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    values: Vec<Complex64>,
    magnitudes: Vec<f64>,
    first: Vec<Complex64>,
    second: Vec<Complex64>,
    weights: Vec<f64>,
    clear_until: Vec<f64>,
}

impl Scratch {
    fn prepare(&mut self, nb: usize, count: usize) {
        let zero = Complex64::new(0.0, 0.0);
        self.values.resize(nb, zero);
        self.magnitudes.resize(nb, 0.0);
        self.first.resize(nb * count, zero);
        self.second.resize(nb * count, zero);
        self.weights.resize(nb * count, 0.0);
        self.clear_until.resize(count, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn c(re: f64, im: f64) -> Complex64 {
        Complex64::new(re, im)
    }

    /// cos τ - 0.999 touches zero narrowly: both crossings are found, and 1.001 - cos τ has none.
    #[test]
    fn narrow_dips_are_found_and_near_misses_are_not_zeros() {
        let basis = Basis { exponents: vec![c(0.0, 1.0)], ..Basis::default() };
        let mut scratch = Scratch::default();
        let dip = [c(-1.0, 0.0), c(0.999, 0.0), c(0.0, 0.0), c(0.0, 0.0)];
        // starts below zero at τ = 0, so shift: g(τ) = 0.999 - cos(τ + 1)
        let shifted = [dip[0] * c(0.0, 1.0).exp(), dip[1], dip[2], dip[3]];
        let FirstZero::At { time, .. } = basis.first_zero(&shifted, &[Begin::Positive], 10.0, &mut scratch) else {
            panic!("a zero was missed");
        };
        assert!((time - (2.0 * std::f64::consts::PI - 1.0 - 0.999f64.acos())).abs() < 1e-14, "{time}");
        let near_miss = [dip[0], c(1.000_001, 0.0), dip[2], dip[3]];
        assert_eq!(basis.first_zero(&near_miss, &[Begin::Positive], 100.0, &mut scratch), FirstZero::None);
    }

    /// A signal that leaves zero is not taken for one that returns to it: 1 - cos τ starts with two vanishing derivatives.
    #[test]
    fn a_start_at_zero_is_no_zero() {
        let basis = Basis { exponents: vec![c(0.0, 1.0)], ..Basis::default() };
        let g = [c(-1.0, 0.0), c(1.0, 0.0), c(0.0, 0.0), c(0.0, 0.0)];
        let mut scratch = Scratch::default();
        assert_eq!(basis.first_zero(&g, &[Begin::Zero], 6.0, &mut scratch), FirstZero::None);
        let sine = [c(0.0, -1.0), c(0.0, 0.0), c(0.0, 0.0), c(0.0, 0.0)];
        let FirstZero::At { time, .. } = basis.first_zero(&sine, &[Begin::Zero], 6.0, &mut scratch) else {
            panic!("the zero at pi was missed");
        };
        assert!((time - std::f64::consts::PI).abs() < 1e-14);
        let falling = [c(1.0, 0.0), c(-1.0, 0.0), c(0.0, 0.0), c(0.0, 0.0)];
        assert_eq!(
            basis.first_zero(&falling, &[Begin::Zero], 6.0, &mut scratch),
            FirstZero::At { index: 0, time: 0.0 }
        );
    }

    /// Products of exponentials, polynomials and resonant terms against each other: closed form and quadrature agree.
    #[test]
    fn integrals_agree_with_quadrature() {
        let (s, delta) = (c(-0.1, 2.0), c(0.1, 1e-7));
        let basis =
            Basis { exponents: vec![s, s + delta, c(-30.0, 0.0)], resonant: vec![(s, delta)], driven_by: vec![1] };
        let zero = c(0.0, 0.0);
        let g = [c(1.0, 0.5), c(-0.3, 0.2), c(0.7, 0.0), zero, c(0.4, 0.0), zero, zero];
        let exact = integral_of_product((&basis, &g), (&basis, &g), 3.0);
        let numeric = quadrature((&basis, &g), (&basis, &g), 3.0);
        assert!((exact - numeric).abs() < 1e-13 * exact.abs(), "{exact} {numeric}");
        // derivative of every basis function, by differences
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
