//! Newton's method for a nonlinear mode, at a given amplitude or in a plane across its curve.
//!
//! The unknowns are those of `mode_continuation`, at a given amplitude without `ln a`. In a plane
//! with the normal `row`, the last equation is `row · step = 0`.

use super::mode_continuation::ModeArc;
use super::nonlinear_mode::{ModeEquations, ModeSettings, ModeState, scaled_norm};
use stickslip_numerics::dense;
use stickslip_numerics::min_norm::{min_norm_step, null_directions};
use stickslip_numerics::newton::{DampedNewton, NewtonEnd, NewtonEquations};

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

/// Newton's method for a nonlinear mode.
struct ModeIteration<'a, 'e> {
    equations: &'a mut ModeEquations<'e>,
    /// Initial guess, along which the phase is fixed.
    guess: ModeState,
    /// Start of the step.
    start: ModeArc,
    /// Current point.
    solution: ModeSolution,
    /// True if the Jacobian is that of the current point.
    has_jacobian: bool,
    residual: Vec<f64>,
    step: Vec<f64>,
    row: Option<&'a [f64]>,
}

impl ModeIteration<'_, '_> {
    /// Evaluates the residual, and the Jacobian if wanted. Returns the norm of the residual.
    fn evaluate(&mut self, with_jacobian: bool) -> f64 {
        let ModeSolution { point, jacobian, units, .. } = &mut self.solution;
        self.has_jacobian = with_jacobian;
        let jacobian = with_jacobian.then_some(&mut jacobian[..]);
        self.equations.evaluate(&point.state, (&self.guess, point.amplitude), &mut self.residual, jacobian);
        scaled_norm(units, &self.residual)
    }

    fn complete_jacobian(&mut self) {
        if !self.has_jacobian {
            self.evaluate(true);
        }
    }
}

impl NewtonEquations for ModeIteration<'_, '_> {
    fn solve_step(&mut self, _residual: f64) -> bool {
        self.complete_jacobian();
        let ModeIteration { equations, solution, residual, step, row, start, .. } = self;
        let ModeSolution { point, jacobian, units, bordered, .. } = solution;
        step.iter_mut().zip(residual.iter().zip(&*units)).for_each(|(d, (r, unit))| *d = r / unit);
        step[residual.len()] = 0.0;
        start.clone_from(point);
        equations.solve_bordered(point, (jacobian, units), *row, (bordered, step)).is_some()
    }

    /// The Jacobian takes most of the time of an evaluation, and most steps are whole. Shorter
    /// steps are tried without it.
    fn move_by(&mut self, fraction: f64) -> f64 {
        let point = &mut self.solution.point;
        point.clone_from(&self.start);
        point.shift(&self.step, -fraction);
        if !(point.state.omega > 0.0 && point.amplitude.is_finite() && point.amplitude > 0.0) {
            return f64::INFINITY;
        }
        self.evaluate(fraction == 1.0)
    }
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
    pub(super) fn newton(&mut self, point: ModeArc, row: Option<&[f64]>, limits: NewtonLimits) -> Option<ModeSolution> {
        let settings = ModeSettings::default();
        let newton = DampedNewton {
            tolerance: settings.tolerance,
            rounding: settings.rounding,
            iterations: limits.iterations,
            largest_growth: if limits.bold { DampedNewton::default().largest_growth } else { 0.0 },
            ..DampedNewton::default()
        };
        let size = self.size();
        let units = self.units(&point.state, point.amplitude);
        let mut iteration = ModeIteration {
            guess: point.state.clone(),
            start: point.clone(),
            solution: ModeSolution {
                point,
                iterations: 0,
                jacobian: vec![0.0; size * size],
                units,
                bordered: Vec::new(),
            },
            has_jacobian: false,
            residual: vec![0.0; size],
            step: vec![0.0; size + 1],
            row,
            equations: self,
        };
        let first = iteration.evaluate(true);
        let result = newton.run(&mut iteration, first);
        if result.residual > settings.rounding || matches!(result.end, NewtonEnd::Singular | NewtonEnd::Diverged) {
            return None;
        }
        iteration.complete_jacobian();
        Some(ModeSolution { iterations: result.iterations, ..iteration.solution })
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
