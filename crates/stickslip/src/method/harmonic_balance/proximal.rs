//! Proximal points: rigid friction whose forces are drawn to those of the point before, less and less.
//!
//! Forces that nothing decides, as those of redundant contacts that stick, wander from one Newton step to the next, and with them what slips. A force
//! equation `λ - P J(λ + ε u') + s (λ - λ₀) = 0` decides them: where much draws, `s` large, the motion is that under the forces λ₀, and where little
//! does, that of the given equations. As soon as one is solved its forces are the next λ₀, so that `s` need not vanish: what is left of the given
//! equations is `s |λ - λ₀|`.
//! Source: Rockafellar (1976), "Monotone operators and the proximal point algorithm".

use super::ease::{Ease, GIVEN, SOLVED};
use super::equations::{Level, Slopes, Solution};
use super::ports::Ports;
use super::solve::{Goal, Lost};

/// Share of their distance from the point before by which forces are drawn to it, at first.
const PULL: f64 = 1.0;
/// The same at most: beyond it a point hardly moves.
const MOST_PULL: f64 = 1e4;
/// What is left of that share at the next point after one that was found quickly: usually, and where points were hard to find before.
const LESS: [f64; 2] = [0.1, 0.3];
/// Where half and more of it is left, the next try draws as at the point before, and then more.
const AGAIN: f64 = 0.5;
/// Residual with which a point is the solution where the next is not found: what the sum of redundant contacts carries is then known to this share, a
/// thousandth of what series are usually truncated by, while shares of it still wander among them.
const ENOUGH: f64 = 1e-6;
/// Points and tries at most; ten are usual.
const MOST: usize = 40;
/// Newton iterations to one of them; 2 to 10 are usual.
const ITERATIONS: usize = 30;
/// Up to so many it was found quickly.
const QUICK: usize = 8;

impl Level {
    /// The solution from `motion`, and if there is none the nearest point that was found.
    pub(super) fn by_proximal_points(&mut self, ports: &Ports, omega: f64, motion: &mut Solution) -> Result<(), Lost> {
        self.begin_anew(ports);
        self.anchor.clone_from(&motion.force);
        let mut good = Solution { residual: f64::INFINITY, ..motion.clone() };
        let (mut pull, mut factor) = (PULL, 1.0f64);
        for _ in 0..MOST {
            let next = pull * factor;
            let before = motion.iterations;
            let found = self.newton(ports, omega, motion, Ease { pull: next, ..GIVEN }, (ITERATIONS, Goal::Solved));
            if found.is_ok() {
                let length = self.length(motion);
                motion.residual = self.evaluate(ports, omega, motion, GIVEN, length, Slopes::None);
                if motion.residual <= SOLVED {
                    return Ok(());
                }
                good.copy(motion);
                self.anchor.clone_from(&motion.force);
                pull = next;
                if motion.iterations - before <= QUICK || factor == 1.0 {
                    factor = (factor * factor).clamp(LESS[0], LESS[1]);
                }
            } else {
                good.iterations = motion.iterations;
                motion.copy(&good);
                match factor {
                    ..AGAIN => factor = factor.sqrt(),
                    ..1.0 => factor = 1.0,
                    _ => pull /= LESS[0],
                }
            }
            if pull > MOST_PULL || self.is_exhausted(ports) || (found.is_err() && good.residual <= ENOUGH) {
                break;
            }
        }
        motion.copy(&good);
        if motion.residual <= ENOUGH { Ok(()) } else { Err(Lost::after(motion.iterations, motion.residual)) }
    }
}
