//! Arc-length continuation of a nonlinear mode: predictor along the tangent, corrector.
//!
//! The amplitude `a` is an unknown, so the curve may have turning points in it. The unknowns
//! are the shape `y = x/a`, the forces along laws of velocity, ω, ζ and `ln a`.
//! [`ModeEquations::apply_metric`] defines the arc length.
//!
//! Source: Keller (1977); Allgower and Georg, "Introduction to Numerical Continuation Methods"
//! (2003), Ch. 6.

use super::nonlinear_mode::{ModeEquations, ModeSettings, ModeState};
use crate::method::harmonic_balance::line_search::LineSearch;
use crate::method::harmonic_balance::settings::NewtonSettings;
use num_complex::Complex64;
use stickslip_numerics::min_norm::{min_norm_step, null_directions};
use stickslip_numerics::vector::dot;
use stickslip_numerics::{dense, interrupt};

/// Point of the curve: modal amplitude, m √kg, and motion.
#[derive(Debug, Clone)]
pub(crate) struct ModeArc {
    pub amplitude: f64,
    pub state: ModeState,
    /// Unit tangent by shape, forces, ω, ζ and `ln a`.
    pub tangent: Vec<f64>,
    /// Sign of the determinant of the Jacobian bordered by the tangent.
    ///
    /// It is constant along a smooth curve. A change means that another branch was crossed, or
    /// that the step has jumped to one. It is zero if the equations are singular and the
    /// determinant is rounding.
    pub determinant_sign: f64,
}

impl ModeArc {
    /// Returns the same point with the curve followed in the opposite direction.
    pub fn reversed(&self) -> ModeArc {
        let tangent = self.tangent.iter().map(|t| -t).collect();
        ModeArc { tangent, determinant_sign: -self.determinant_sign, ..self.clone() }
    }

    /// Returns the point at arc length `length` along the tangent, with the same tangent.
    fn predictor(&self, length: f64) -> ModeArc {
        let mut next = self.clone();
        next.shift(&self.tangent, length);
        next
    }

    /// Changes shape, forces, ω, ζ and `ln a` by a multiple of `direction`.
    fn shift(&mut self, direction: &[f64], length: f64) {
        let n = direction.len() - 1;
        let after = self.amplitude * (length * direction[n]).exp();
        let pairs = direction.chunks_exact(2);
        for (x, d) in self.state.x.iter_mut().zip(pairs.clone()) {
            *x = (*x / self.amplitude + Complex64::new(d[0], d[1]) * length) * after;
        }
        for (force, d) in self.state.force.iter_mut().zip(pairs.skip(self.state.x.len())) {
            *force += Complex64::new(d[0], d[1]) * length;
        }
        self.state.omega += length * direction[n - 2];
        self.state.damping += length * direction[n - 1];
        self.amplitude = after;
    }

    /// Returns the difference from here to `other`, in the unknowns of the tangent.
    fn difference_to(&self, other: &ModeArc) -> Vec<f64> {
        let mut way = Vec::with_capacity(self.tangent.len());
        let shapes = self.state.x.iter().zip(&other.state.x);
        let forces = self.state.force.iter().zip(&other.state.force);
        for z in shapes.map(|(a, b)| b / other.amplitude - a / self.amplitude).chain(forces.map(|(a, b)| b - a)) {
            way.extend([z.re, z.im]);
        }
        way.extend([
            other.state.omega - self.state.omega,
            other.state.damping - self.state.damping,
            (other.amplitude / self.amplitude).ln(),
        ]);
        way
    }

    /// Returns the point at amplitude `a` on the straight line between two points.
    pub fn interpolated(&self, other: &ModeArc, a: f64) -> ModeState {
        let whole = (other.amplitude / self.amplitude).ln();
        let share = if whole == 0.0 { 0.0 } else { (a / self.amplitude).ln() / whole };
        let mut point = self.clone();
        point.shift(&self.difference_to(other), share);
        point.state
    }
}

/// Result of a step.
pub(crate) struct ModeStep {
    pub to: ModeArc,
    /// Newton iterations.
    pub iterations: usize,
    /// Distance between the predicted and the corrected point.
    pub predictor_distance: f64,
    /// Cosine of the angle between the tangents at both ends.
    pub tangent_cosine: f64,
}

impl ModeEquations<'_> {
    /// Starts a curve towards smaller amplitudes from a solution. Returns `None` if the point
    /// is singular.
    pub fn start_curve(&mut self, state: &ModeState, amplitude: f64) -> Option<ModeArc> {
        let mut row = vec![0.0; self.size() + 1];
        row[self.size()] = -1.0;
        let point = ModeArc { amplitude, state: state.clone(), tangent: row.clone(), determinant_sign: 1.0 };
        self.corrector(point, &row, false).map(|(point, _)| point)
    }

    /// Takes a step of the given arc length. Returns `None` if the corrector does not converge.
    ///
    /// A `bold` step takes the full Newton step if no fraction of it reduces the residual. This
    /// passes over kinks, but a long step may then jump to another branch.
    pub fn step(&mut self, from: &ModeArc, length: f64, bold: bool) -> Option<ModeStep> {
        let row = self.apply_metric(from, &from.tangent);
        let predicted = from.predictor(length);
        if !(predicted.state.omega > 0.0 && predicted.amplitude.is_finite()) {
            return None;
        }
        let (to, iterations) = self.corrector(predicted.clone(), &row, bold)?;
        let off = self.length(from, &predicted.difference_to(&to));
        let straight = dot(&row, &to.tangent);
        Some(ModeStep { to, iterations, predictor_distance: off, tangent_cosine: straight })
    }

    /// Returns the arc length from a point to a motion along the straight line.
    pub fn distance(&self, from: &ModeArc, state: &ModeState, amplitude: f64) -> f64 {
        let to = ModeArc { amplitude, state: state.clone(), tangent: Vec::new(), determinant_sign: 1.0 };
        self.length(from, &from.difference_to(&to))
    }

    /// Returns the length of a direction at a point.
    fn length(&self, at: &ModeArc, direction: &[f64]) -> f64 {
        self.inner(at, direction, direction).max(0.0).sqrt()
    }

    /// Returns the inner product of two directions at a point in the metric of the arc length.
    pub(crate) fn inner(&self, at: &ModeArc, one: &[f64], other: &[f64]) -> f64 {
        dot(&self.apply_metric(at, one), other)
    }

    /// Returns the metric of the arc length times a direction.
    ///
    /// The metric measures the shape by the kinetic energy of its change, and forces by the
    /// slip limits. It measures the relative motion of sliders behind springs by its size, or
    /// by the reach of the spring if that is larger. ω and 1 + ζ count relatively, and the
    /// amplitude by its logarithm. Without the terms for forces and relative motions, the onset
    /// and the end of slip would be corners of the curve.
    fn apply_metric(&self, at: &ModeArc, direction: &[f64]) -> Vec<f64> {
        let (n, last) = (self.system.dofs(), self.size());
        let nh = self.aft.harmonics.len();
        let mut out = vec![0.0; last + 1];
        for k in 0..nh {
            let first = 2 * k * n;
            for i in 0..n {
                for l in 0..n {
                    let m = self.system.structure().mass()[(i, l)];
                    out[first + 2 * i] += m * direction[first + 2 * l];
                    out[first + 2 * i + 1] += m * direction[first + 2 * l + 1];
                }
            }
        }
        let axes: usize = self.motion_ports.iter().map(|placed| placed.directions.len()).sum();
        for (placed, w) in
            self.motion_ports.iter().flat_map(|placed| placed.directions.iter().map(move |w| (placed, w)))
        {
            let along =
                |k: usize, value: &dyn Fn(usize) -> f64| -> f64 { (0..n).map(|i| w[i] * value(k * n + i)).sum() };
            let square: f64 = (0..nh)
                .map(|k| along(k, &|i| at.state.x[i].re).powi(2) + along(k, &|i| at.state.x[i].im).powi(2))
                .sum();
            let reach = placed.port.slip_displacement();
            // Relative motion below which its changes do not count, relative to the modal
            // amplitude (1/√kg). It is above rounding.
            let size = square + reach * reach + (1e-6 * at.amplitude).powi(2);
            let weight = at.amplitude * at.amplitude / (size * axes as f64);
            for k in 0..nh {
                for part in 0..2 {
                    let change = weight * along(k, &|i| direction[2 * i + part]);
                    for i in 0..n {
                        out[2 * (k * n + i) + part] += w[i] * change;
                    }
                }
            }
        }
        for placed in &self.force_ports {
            let first = 2 * nh * (n + placed.port.first_axis);
            for i in first..first + 2 * nh * placed.port.axes {
                out[i] = direction[i] / (placed.port.scale * placed.port.scale);
            }
        }
        let (omega, zeta) = (at.state.omega, 1.0 + at.state.damping.abs());
        out[last - 2] = direction[last - 2] / (omega * omega);
        out[last - 1] = direction[last - 1] / (zeta * zeta);
        // Weight of `ln a` in the arc length. A tenth of the shape counts as much as a fifth of
        // the amplitude.
        let weight = 0.5;
        out[last] = direction[last] * weight * weight;
        out
    }

    /// Newton's method in the plane through `point` with the normal `row`.
    ///
    /// The line search halves steps as in [`ModeEquations::solve`]. Returns the solution with
    /// its unit tangent, on the side of `row`, and the iterations.
    fn corrector(&mut self, mut point: ModeArc, row: &[f64], bold: bool) -> Option<(ModeArc, usize)> {
        let settings = ModeSettings::default();
        let size = self.size();
        let (mut residual, mut jacobian) = (vec![0.0; size], vec![0.0; size * size]);
        let (mut bordered, mut right) = (vec![0.0; (size + 1) * (size + 1)], vec![0.0; size + 1]);
        let start = point.clone();
        let scale = self.units(&start.state, start.amplitude);
        let norm = |r: &[f64]| r.iter().zip(&scale).map(|(r, s)| (r / s) * (r / s)).sum::<f64>().sqrt();
        let evaluate = |this: &mut Self, point: &ModeArc, residual: &mut [f64], jacobian: &mut [f64]| {
            this.evaluate(&point.state, (&start.state, point.amplitude), residual, Some(jacobian));
            norm(residual)
        };
        let mut now = evaluate(self, &point, &mut residual, &mut jacobian);
        let mut enough = settings.tolerance;
        let mut iteration = 0;
        while iteration <= settings.step_iterations {
            interrupt::check();
            let solved = now <= enough;
            self.border(&point, &scale, &jacobian, row, &mut bordered);
            if solved {
                right.fill(0.0);
                right[size] = 1.0;
            } else {
                for i in 0..size {
                    right[i] = residual[i] / scale[i];
                }
                right[size] = 0.0;
            }
            let open = if self.may_be_singular { null_directions(&bordered, size + 1) } else { Vec::new() };
            let mut sign = dense::solve_with_determinant_sign(&mut bordered, size + 1, &mut right)?;
            if !open.is_empty() {
                sign = 0.0;
                min_norm_step(&mut right, open, &|one, other| self.inner(&point, one, other));
            }
            if solved {
                let length = self.length(&point, &right);
                if !(length > 0.0 && length.is_finite()) {
                    return None;
                }
                right.iter_mut().for_each(|t| *t /= length);
                point.tangent.copy_from_slice(&right);
                point.determinant_sign = sign;
                return Some((point, iteration));
            }
            iteration += 1;
            let mut trial = point.clone();
            let mut step = |this: &mut Self, fraction: f64| {
                trial.clone_from(&point);
                trial.shift(&right, -fraction);
                let sensible = trial.state.omega > 0.0 && trial.amplitude.is_finite() && trial.amplitude > 0.0;
                if sensible { evaluate(this, &trial, &mut residual, &mut jacobian) } else { f64::INFINITY }
            };
            match LineSearch::default().run(now, |fraction| step(self, fraction)) {
                Some(after) => (point, now) = (trial, after),
                None if now <= settings.rounded => {
                    // rounding prevents a smaller residual
                    enough = settings.rounded;
                    now = evaluate(self, &point, &mut residual, &mut jacobian);
                }
                None => {
                    let after = Some(step(self, 1.0))
                        .filter(|after| bold && *after < NewtonSettings::default().divergence * now)?;
                    (point, now) = (trial, after);
                }
            }
        }
        None
    }

    /// Sets `out` to the Jacobian by shape, forces, ω, ζ and `ln a`, in units of `scale`, with
    /// the last row `row`.
    fn border(&self, point: &ModeArc, scale: &[f64], jacobian: &[f64], row: &[f64], out: &mut [f64]) {
        let size = self.size();
        let motions = 2 * point.state.x.len();
        for i in 0..size {
            let from = &jacobian[i * size..(i + 1) * size];
            let to = &mut out[i * (size + 1)..(i + 1) * (size + 1)];
            let mut by_amplitude = 0.0;
            for (k, x) in point.state.x.iter().enumerate() {
                by_amplitude += from[2 * k] * x.re + from[2 * k + 1] * x.im;
            }
            for k in 0..size {
                to[k] = from[k] / scale[i] * if k < motions { point.amplitude } else { 1.0 };
            }
            // amplitude and phase conditions depend on the shape alone
            to[size] = if i + 2 < size { by_amplitude / scale[i] } else { 0.0 };
        }
        out[size * (size + 1)..].copy_from_slice(row);
    }
}
