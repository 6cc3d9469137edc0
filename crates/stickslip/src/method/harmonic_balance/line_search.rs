//! Line search of Newton's method: the step is halved until the residual decreases.
//!
//! It serves single orbits, nonlinear modes and their continuation. If no fraction of a step
//! decreases the residual, the caller decides whether to take the whole step, which may break a
//! cycle of slipping samples.
//!
//! Source: Dennis and Schnabel, "Numerical Methods for Unconstrained Optimization and Nonlinear
//! Equations" (1996), Ch. 6.

/// Settings of the line search.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineSearch {
    /// Largest number of halvings. Default 7: slip sets change within a hundredth of a step.
    pub halvings: usize,
    /// Sufficient decrease: a step of fraction `t` must reduce the residual to at most
    /// `1 - t decrease` of its value. Default 1e-3: nearly every decrease is accepted.
    pub decrease: f64,
}

impl Default for LineSearch {
    fn default() -> Self {
        LineSearch { halvings: 7, decrease: 1e-3 }
    }
}

impl LineSearch {
    /// Returns true if a step of this fraction reduces the residual enough.
    pub fn accepts(self, fraction: f64, before: f64, after: f64) -> bool {
        after < (1.0 - self.decrease * fraction) * before
    }

    /// Returns the residual after the first fraction of the step that reduces it enough, or
    /// `None` if none does. `trial` moves to a fraction of the step and returns the residual
    /// there.
    pub fn run(self, before: f64, mut trial: impl FnMut(f64) -> f64) -> Option<f64> {
        let mut fraction = 1.0;
        for _ in 0..=self.halvings {
            let after = trial(fraction);
            if self.accepts(fraction, before, after) {
                return Some(after);
            }
            fraction *= 0.5;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Newton's method for `arctan x = 0` diverges from `x = 3` with whole steps and converges
    /// with the line search.
    #[test]
    fn newton_converges_with_the_line_search() {
        let mut x: f64 = 3.0;
        for _ in 0..12 {
            let (at, step) = (x, x.atan() * (1.0 + x * x));
            let found = LineSearch::default().run(at.atan().abs(), |fraction| {
                x = at - fraction * step;
                x.atan().abs()
            });
            assert!(found.is_some() || x == 0.0, "{x}");
        }
        assert!(x.abs() < 1e-14, "{x}");
        assert_eq!(LineSearch::default().run(1.0, |_| f64::NAN), None);
    }
}
