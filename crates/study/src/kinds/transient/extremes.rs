//! Largest displacement and RMS value of a place, from samples of its motion.
//!
//! Between two samples the motion is the cubic with their displacements and velocities. The
//! cubic through the neighbours of a sample shows whether the samples follow the motion.

/// Time (s), displacement (m) and velocity (m/s).
type MotionSample = [f64; 3];

/// Largest displacement and RMS value of a place.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Extremes {
    /// Largest displacement, m.
    pub largest: f64,
    /// Its time, s.
    pub time: f64,
    /// Largest distance of a sample from the cubic through its neighbours, m.
    pub unresolved: f64,
    squares: f64,
    count: usize,
    /// The last sample, and the one before.
    before: [Option<MotionSample>; 2],
}

impl Extremes {
    pub fn add(&mut self, sample: MotionSample) {
        let [time, x, _] = sample;
        self.squares += x * x;
        self.count += 1;
        self.see(time, x);
        if let Some(last) = self.before[0] {
            for part in turning_points(last, sample) {
                self.see(last[0] + part * (time - last[0]), cubic(last, sample, part));
            }
            if let Some(first) = self.before[1] {
                let between = cubic(first, sample, (last[0] - first[0]) / (time - first[0]));
                self.unresolved = self.unresolved.max((last[1] - between).abs());
            }
        }
        self.before = [Some(sample), self.before[0]];
    }

    fn see(&mut self, time: f64, x: f64) {
        if x.abs() > self.largest {
            (self.largest, self.time) = (x.abs(), time);
        }
    }

    /// Returns the RMS value of the samples, m.
    pub fn rms(&self) -> f64 {
        (self.squares / self.count as f64).sqrt()
    }
}

/// Returns the cubic between two samples at a fraction of their distance.
fn cubic([t0, x0, v0]: MotionSample, [t1, x1, v1]: MotionSample, s: f64) -> f64 {
    let h = t1 - t0;
    let rise = x1 - x0;
    x0 + s * (h * v0 + s * (3.0 * rise - h * (2.0 * v0 + v1) + s * (h * (v0 + v1) - 2.0 * rise)))
}

/// Returns the turning points of the cubic between two samples, as fractions of their distance.
fn turning_points([t0, x0, v0]: MotionSample, [t1, x1, v1]: MotionSample) -> impl Iterator<Item = f64> {
    let h = t1 - t0;
    // its velocity times h: c + 2 b s + 3 a s²
    let (c, b, a) = (h * v0, 3.0 * (x1 - x0) - h * (2.0 * v0 + v1), h * (v0 + v1) - 2.0 * (x1 - x0));
    let root = (b * b - 3.0 * a * c).max(0.0).sqrt();
    // the form of both roots without a difference of nearly equal numbers
    let sum = -(b + root.copysign(b));
    [sum / (3.0 * a), c / sum].into_iter().filter(|s| (0.0..=1.0).contains(s))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extremes(per_period: f64) -> Extremes {
        let mut extremes = Extremes::default();
        for k in 0..200 {
            let t = std::f64::consts::TAU * (f64::from(k) + 0.37) / per_period;
            extremes.add([t, 0.1 + t.sin(), t.cos()]);
        }
        extremes
    }

    /// The cubic between samples of a sine has an error of `(2π/n)⁴/384` at n samples a period, and
    /// that over two steps 16 times as much.
    #[test]
    fn the_largest_value_lies_between_samples() {
        for per_period in [10.0, 20.0, 40.0] {
            let found = extremes(per_period);
            let error = (std::f64::consts::TAU / per_period).powi(4) / 384.0;
            assert!((found.largest - 1.1).abs() <= error, "{found:?}");
            assert!(((found.time / std::f64::consts::TAU).fract() - 0.25).abs() < 0.01, "{found:?}");
            assert!((found.unresolved / (16.0 * error) - 1.0).abs() < 0.2, "{found:?} {error}");
            assert!((found.rms() - f64::sqrt(0.51)).abs() < 1e-3);
        }
    }
}
