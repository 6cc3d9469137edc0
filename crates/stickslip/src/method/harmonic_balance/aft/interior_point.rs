//! Interior-point form of rigid friction along one axis: the force of every
//! sample stays strictly inside its limits.
//!
//! With `y = λ + ε v` the force of a sample is the projection `f = Π(y)` onto the limits.
//! Equivalent are the multipliers `ξ, η ≥ 0` with `y - f = ξ - η` and the complementarity
//! conditions `ξ (L - f) = 0` and `η (L + f) = 0`. On the interior-point path both products
//! equal μ > 0, the same at all samples, so that all four factors stay positive. A force at its
//! limit in one step can therefore leave it in the next.

use super::FrequencyTime;
use num_complex::Complex64;

/// The samples of one port.
#[derive(Debug, Clone)]
pub(in super::super) struct InteriorPort {
    /// Slip limit, N.
    limit: f64,
    /// Unit of the products, N²: the limit times the largest `y`, or the limit
    /// squared if that is larger.
    unit: f64,
    /// Variables and step of every sample.
    samples: Vec<BarrierSample>,
}

#[derive(Debug, Clone, Copy, Default)]
struct BarrierSample {
    force: f64,
    multiplier_upper: f64,
    multiplier_lower: f64,
    /// `y`, and the derivative of `f` by it.
    argument: f64,
    slope: f64,
    /// Target values of the products.
    targets: [f64; 2],
    /// Steps of `f`, ξ and η.
    step: [f64; 3],
}

impl BarrierSample {
    /// Returns the distances of the force from its upper and its lower limit.
    fn distances_to_limits(&self, limit: f64) -> [f64; 2] {
        [limit - self.force, limit + self.force]
    }

    /// Returns the term `lack` of the step of `f`, which is `slope (δy + lack)`
    /// after the elimination of ξ and η.
    fn reduced_residual(&self, limit: f64) -> f64 {
        let [above, below] = self.distances_to_limits(limit);
        self.argument - self.force - self.targets[0] / above + self.targets[1] / below
    }
}

impl InteriorPort {
    /// Creates the initial iterate from the harmonics of `y` without the force.
    pub fn new(limit: f64, aft: &mut FrequencyTime, y: &[Complex64]) -> Self {
        aft.synthesise(y, |_| Complex64::new(1.0, 0.0));
        let largest = aft.signal.iter().fold(limit, |most, y| most.max(y.abs()));
        let begin = |y: &f64| {
            // Approximate initial force, relative to the limit, where `y` is largest.
            let share = 0.5;
            let force = share * limit * (y / (share * largest)).tanh();
            let held = y - force;
            // ξ - η = y - f, ξ η = largest²
            let more = 0.5 * (held.abs() + held.hypot(2.0 * largest));
            let less = largest * (largest / more);
            let (upper, lower) = if held > 0.0 { (more, less) } else { (less, more) };
            BarrierSample { force, multiplier_upper: upper, multiplier_lower: lower, ..BarrierSample::default() }
        };
        let samples = aft.signal.iter().map(begin).collect();
        InteriorPort { limit, unit: limit * largest, samples }
    }

    /// Returns the mean of the products after a share of the step, in units of
    /// [`InteriorPort::unit`].
    pub fn gap(&self, share: f64) -> f64 {
        let products = |s: &BarrierSample| {
            let [force, upper, lower] = s.step.map(|step| share * step);
            (s.multiplier_upper + upper) * (self.limit - s.force - force)
                + (s.multiplier_lower + lower) * (self.limit + s.force + force)
        };
        self.samples.iter().map(products).sum::<f64>() / (2.0 * self.samples.len() as f64 * self.unit)
    }

    /// Returns the mean of the present products, in units of the limit squared.
    pub fn remaining_gap(&self) -> f64 {
        self.gap(0.0) * self.unit / (self.limit * self.limit)
    }

    /// Linearizes the conditions at the argument with the harmonics `y`. Writes the derivative
    /// of the harmonics of `f` by those of the argument into `tangent`.
    pub fn linearize(&mut self, aft: &mut FrequencyTime, y: &[Complex64], tangent: &mut [f64]) {
        aft.synthesise(y, |_| Complex64::new(1.0, 0.0));
        aft.reserve_slopes(1);
        for (i, s) in self.samples.iter_mut().enumerate() {
            let [above, below] = s.distances_to_limits(self.limit);
            s.argument = aft.signal[i];
            s.slope = 1.0 / (1.0 + s.multiplier_upper / above + s.multiplier_lower / below);
            aft.slopes[0][i] = s.slope;
        }
        tangent.fill(0.0);
        if aft.slope_spectrum(0, 0) {
            aft.add_slope(tangent, (0, 0), 1, |_| Complex64::new(1.0, 0.0));
        }
    }

    /// Sets the targets of the products to `gap`. With `corrected`, the targets include the
    /// second-order terms of the last step (Mehrotra's corrector). Writes the harmonics of the
    /// force after a step with an unchanged argument into `image`.
    pub fn set_targets(&mut self, gap: f64, corrected: bool, aft: &mut FrequencyTime, image: &mut [Complex64]) {
        let product = gap * self.unit;
        for (s, force) in self.samples.iter_mut().zip(&mut aft.force[0]) {
            let [step, upper, lower] = if corrected { s.step } else { [0.0; 3] };
            s.targets = [product + upper * step, product - lower * step];
            *force = s.force + s.slope * s.reduced_residual(self.limit);
        }
        image.fill(Complex64::default());
        aft.add_force(0, image);
    }

    /// Computes the step to the argument with the harmonics `y`. Returns the
    /// share of it, at most 1, that stays inside all bounds.
    pub fn step(&mut self, aft: &mut FrequencyTime, y: &[Complex64]) -> f64 {
        aft.synthesise(y, |_| Complex64::new(1.0, 0.0));
        // Longest step, as a share of the distance to the nearest bound.
        let longest: f64 = 0.99;
        let mut most = 1.0 / longest;
        for (s, y) in self.samples.iter_mut().zip(&aft.signal) {
            let [above, below] = s.distances_to_limits(self.limit);
            let force = s.slope * (y - s.argument + s.reduced_residual(self.limit));
            let upper = (s.targets[0] + s.multiplier_upper * force) / above - s.multiplier_upper;
            let lower = (s.targets[1] - s.multiplier_lower * force) / below - s.multiplier_lower;
            s.step = [force, upper, lower];
            for (room, step) in
                [(above, -force), (below, force), (s.multiplier_upper, upper), (s.multiplier_lower, lower)]
            {
                if step < 0.0 {
                    most = most.min(-room / step);
                }
            }
        }
        longest * most
    }

    /// Takes a share of the step.
    pub fn advance(&mut self, share: f64) {
        for s in &mut self.samples {
            s.force += share * s.step[0];
            s.multiplier_upper += share * s.step[1];
            s.multiplier_lower += share * s.step[2];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a fixed argument the path ends at the projection of the argument:
    /// at a limit, or between the limits.
    #[test]
    fn the_path_ends_at_the_projection() {
        let limit = 0.7;
        for y in [-30.0, -0.71, -0.2, 0.0, 0.69, 5.0f64] {
            let mut aft = FrequencyTime::new(vec![0], 16);
            let (argument, mut image, mut tangent) = ([Complex64::new(y, 0.0)], [Complex64::default()], [0.0; 4]);
            let mut barrier = InteriorPort::new(limit, &mut aft, &argument);
            while barrier.remaining_gap() > 1e-10 {
                let gap = barrier.gap(0.0);
                barrier.linearize(&mut aft, &argument, &mut tangent);
                barrier.set_targets(0.1 * gap, false, &mut aft, &mut image);
                let share = barrier.step(&mut aft, &argument);
                assert!(share > 0.0 && share <= 1.0);
                barrier.advance(share);
            }
            let found = barrier.samples[0].force;
            // the error that the remaining products allow
            assert!((found - y.clamp(-limit, limit)).abs() < 1e-8, "{y}: {found}");
        }
    }
}
