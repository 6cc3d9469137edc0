//! Newton's method for a nonlinear mode, at a given amplitude or in a plane across its curve.
//!
//! The unknowns are those of `mode_continuation`, at a given amplitude without `ln a`. In a plane
//! with the normal `row`, the last equation is `row · step = 0`.

use super::mode_continuation::ModeArc;
use super::nonlinear_mode::{ModeEquations, ModeSettings, ModeState, scaled_norm};
use crate::method::harmonic_balance::line_search::LineSearch;
use crate::method::harmonic_balance::settings::NewtonSettings;
use stickslip_numerics::min_norm::{min_norm_step, null_directions};
use stickslip_numerics::{dense, interrupt};

/// Limits of one iteration.
#[derive(Debug, Clone, Copy)]
pub(super) struct NewtonLimits {
    pub iterations: usize,
    /// True if the whole step is taken when no fraction of it reduces the residual. It may break
    /// a cycle of slipping samples, or pass the amplitude at which two modes coalesce. A long step
    /// along a curve may then jump to another branch.
    pub bold: bool,
}

/// A solution with its Jacobian.
pub(super) struct ModeSolution {
    pub point: ModeArc,
    pub iterations: usize,
    jacobian: Vec<f64>,
    units: Vec<f64>,
    /// Memory for another solution of the bordered equations.
    bordered: Vec<f64>,
}

impl ModeEquations<'_> {
    /// Solves at amplitude `a` from `start`, whose motion is scaled to `a`. Forces along laws
    /// of velocity keep their values, as in slip.
    pub fn solve(&mut self, start: &ModeState, before: f64, a: f64) -> Option<ModeState> {
        let mut state = start.clone();
        state.x.iter_mut().for_each(|x| *x *= a / before);
        let point = ModeArc { amplitude: a, state, tangent: Vec::new(), determinant_sign: 1.0 };
        let limits = NewtonLimits { iterations: ModeSettings::default().iterations, bold: true };
        self.newton(point, None, limits).map(|found| found.point.state)
    }

    /// Newton's method in the plane through `point` with the normal `row`, or at its amplitude.
    pub(super) fn newton(
        &mut self,
        mut point: ModeArc,
        row: Option<&[f64]>,
        limits: NewtonLimits,
    ) -> Option<ModeSolution> {
        let settings = ModeSettings::default();
        let size = self.size();
        let start = point.clone();
        let units = self.units(&start.state, start.amplitude);
        let (mut residual, mut jacobian) = (vec![0.0; size], vec![0.0; size * size]);
        let evaluate = |this: &mut Self, point: &ModeArc, residual: &mut [f64], jacobian: Option<&mut [f64]>| {
            this.evaluate(&point.state, (&start.state, point.amplitude), residual, jacobian);
            scaled_norm(&units, residual)
        };
        let mut now = evaluate(self, &point, &mut residual, Some(&mut jacobian));
        let mut iterations = 0;
        let (mut bordered, mut step) = (Vec::new(), vec![0.0; size + 1]);
        while now > settings.tolerance && iterations < limits.iterations {
            interrupt::check();
            step.iter_mut().zip(residual.iter().zip(&units)).for_each(|(d, (r, unit))| *d = r / unit);
            step[size] = 0.0;
            self.solve_bordered(&point, (&jacobian, &units), row, (&mut bordered, &mut step))?;
            iterations += 1;
            let mut trial = point.clone();
            // The Jacobian takes most of the time of an evaluation, and most steps are whole.
            // Shorter steps are tried without it.
            let mut is_whole = true;
            let mut try_fraction = |fraction: f64| {
                is_whole = fraction == 1.0;
                trial.clone_from(&point);
                trial.shift(&step, -fraction);
                let sensible = trial.state.omega > 0.0 && trial.amplitude.is_finite() && trial.amplitude > 0.0;
                let jacobian = is_whole.then_some(&mut jacobian[..]);
                if sensible { evaluate(self, &trial, &mut residual, jacobian) } else { f64::INFINITY }
            };
            match LineSearch::default().run(now, &mut try_fraction) {
                Some(after) => (point, now) = (trial, after),
                None if now <= settings.rounded => {
                    // rounding prevents a smaller residual
                    now = evaluate(self, &point, &mut residual, Some(&mut jacobian));
                    break;
                }
                None => {
                    let after = Some(try_fraction(1.0))
                        .filter(|after| limits.bold && *after < NewtonSettings::default().divergence * now)?;
                    (point, now) = (trial, after);
                }
            }
            if !is_whole {
                now = evaluate(self, &point, &mut residual, Some(&mut jacobian));
            }
        }
        (now <= settings.rounded).then_some(ModeSolution { point, iterations, jacobian, units, bordered })
    }

    /// Returns the direction of the curve through a solution, on the side of `row`, and the sign of
    /// the determinant, which is zero if the equations are singular.
    pub(super) fn direction(&self, at: &mut ModeSolution, row: &[f64]) -> Option<(Vec<f64>, f64)> {
        let mut direction = vec![0.0; row.len()];
        direction[row.len() - 1] = 1.0;
        let sign =
            self.solve_bordered(&at.point, (&at.jacobian, &at.units), Some(row), (&mut at.bordered, &mut direction))?;
        Some((direction, sign))
    }

    /// Solves for the right-hand side with the Jacobian by shape, forces, ω, ζ and `ln a`, in units
    /// of the residual, and the last row `row`. Without it, `ln a` does not change. `bordered` is
    /// overwritten. Returns the sign of the determinant.
    fn solve_bordered(
        &self,
        point: &ModeArc,
        (jacobian, units): (&[f64], &[f64]),
        row: Option<&[f64]>,
        (bordered, right): (&mut Vec<f64>, &mut [f64]),
    ) -> Option<f64> {
        let size = self.size();
        let n = size + usize::from(row.is_some());
        let motions = 2 * point.state.x.len();
        bordered.resize(n * n, 0.0);
        for (i, (from, unit)) in jacobian.chunks_exact(size).zip(units).enumerate() {
            let to = &mut bordered[i * n..(i + 1) * n];
            let (by_shape, by_others) = (point.amplitude / unit, unit.recip());
            to[..motions].iter_mut().zip(&from[..motions]).for_each(|(to, by)| *to = by * by_shape);
            to[motions..].iter_mut().zip(&from[motions..]).for_each(|(to, by)| *to = by * by_others);
            if row.is_some() {
                let mut by_amplitude = 0.0;
                // amplitude and phase conditions depend on the shape alone
                if i + 2 < size {
                    for (k, x) in point.state.x.iter().enumerate() {
                        by_amplitude += from[2 * k] * x.re + from[2 * k + 1] * x.im;
                    }
                }
                to[size] = by_amplitude * by_others;
            }
        }
        if let Some(row) = row {
            bordered[size * n..].copy_from_slice(row);
        }
        let mut open = if self.may_be_singular { null_directions(bordered, n) } else { Vec::new() };
        let sign = dense::solve_with_determinant_sign(bordered, n, &mut right[..n])?;
        if open.is_empty() {
            return Some(sign);
        }
        open.iter_mut().for_each(|direction| direction.resize(size + 1, 0.0));
        min_norm_step(right, open, &|one, other| self.inner(point, one, other));
        Some(0.0)
    }
}
