//! Arc-length continuation of a nonlinear mode: predictor along the tangent, corrector.
//!
//! The amplitude `a` is an unknown, so the curve may have turning points in it. The unknowns
//! are the shape `y = x/a`, the forces along laws of velocity, ω, ζ and `ln a`.
//! [`ModeEquations::apply_metric`] defines the arc length.
//!
//! Source: Keller (1977); Allgower and Georg, "Introduction to Numerical Continuation Methods"
//! (2003), Ch. 6.

use super::mode_newton::NewtonLimits;
use super::nonlinear_mode::{ModeEquations, ModeSettings, ModeState};
use num_complex::Complex64;
use stickslip_numerics::vector::dot;

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
    pub(super) fn shift(&mut self, direction: &[f64], length: f64) {
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
        self.corrected_point(point, &row, false).map(|(point, _)| point)
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
        let (to, iterations) = self.corrected_point(predicted.clone(), &row, bold)?;
        let off = self.length(from, &predicted.difference_to(&to));
        let straight = dot(&row, &to.tangent);
        Some(ModeStep { to, iterations, predictor_distance: off, tangent_cosine: straight })
    }

    /// Returns the solution in the plane through `point` with the normal `row`, with its unit
    /// tangent on the side of `row`, and the Newton iterations.
    fn corrected_point(&mut self, point: ModeArc, row: &[f64], bold: bool) -> Option<(ModeArc, usize)> {
        let iterations = ModeSettings::default().step_iterations;
        let mut found = self.newton(point, Some(row), NewtonLimits { iterations, bold })?;
        let (mut tangent, determinant_sign) = self.direction(&mut found, row)?;
        let length = self.length(&found.point, &tangent);
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        tangent.iter_mut().for_each(|t| *t /= length);
        Some((ModeArc { tangent, determinant_sign, ..found.point }, found.iterations))
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
}
