//! One step of average acceleration for a linear structure with joints.
//!
//! `M (v₁ - v₀) = h/2 (r₀ + r₁)`, `x₁ = x₀ + h/2 (v₀ + v₁)`, with the forces
//! `r = F - C v - K x - W f`. The velocities of the axes at the end are
//! `w = (linear in the state and the loads) - h/2 G (f₀ + f₁)`. Newton's method has one unknown
//! per axis, for any number of masses.

use super::law_step::{LawInstant, LawIntegrator};
use crate::law::RelativeMotion;
use crate::method::flow::assembly::{Assembly, IndexedLaw};
use crate::method::flow::excitation::HarmonicExcitation;
use nalgebra::{DMatrix, DVector};
use stickslip_numerics::interrupt;
use stickslip_numerics::small_lu::SmallLu;

/// The eliminated structure for one step size.
#[derive(Debug, Clone)]
pub(super) struct AccelerationElimination {
    pub length: f64,
    /// Matrices of the velocities at the end, as a function of displacements and velocities at
    /// the start (n × 2n). `from_load` multiplies the sum of the loads at start and end
    /// (n × n), `from_force` the sum of the forces (n × axes).
    from_state: DMatrix<f64>,
    from_load: DMatrix<f64>,
    from_force: DMatrix<f64>,
    /// The effect of forces along the axes, axes × axes: `-h/2 G`.
    pub along_from_force: DMatrix<f64>,
    /// Transposed matrices for sensitivities, 2n × n and axes × n.
    pub from_state_transposed: DMatrix<f64>,
    pub from_force_transposed: DMatrix<f64>,
}

impl AccelerationElimination {
    /// Eliminates the structure. Returns `None` if the matrix is singular.
    pub fn new(assembly: &Assembly, h: f64) -> Option<Self> {
        let n = assembly.n;
        let (c, k) = (&assembly.damping * (0.5 * h), &assembly.stiffness * (0.25 * h * h));
        let left = &assembly.mass + &c + &k;
        let inverse = if n == 0 { left } else { left.try_inverse()? };
        let mut right = DMatrix::zeros(n, 2 * n);
        right.view_mut((0, 0), (n, n)).copy_from(&(&assembly.stiffness * -h));
        right.view_mut((0, n), (n, n)).copy_from(&(&assembly.mass - c - k));
        let from_force = &inverse * &assembly.directions * (-0.5 * h);
        let from_state = &inverse * right;
        Some(AccelerationElimination {
            length: h,
            from_state_transposed: from_state.transpose(),
            from_force_transposed: from_force.transpose(),
            from_state,
            along_from_force: assembly.directions.transpose() * &from_force,
            from_force,
            from_load: inverse * (0.5 * h),
        })
    }
}

/// The motion along the axes at an instant.
type Relatives = Vec<RelativeMotion<f64>>;

/// Scratch memory and result of a step.
#[derive(Debug, Clone)]
pub(super) struct AccelerationStep {
    /// Evaluated laws, one per joint.
    pub laws: Vec<LawIntegrator>,
    /// Forces along the axes at the start and at the end, N.
    pub before: DVector<f64>,
    pub force: DVector<f64>,
    /// Motion of the joints at the start and at the end.
    from: Relatives,
    to: Relatives,
    /// Velocities of the structure along the axes at the end.
    unknown: Vec<f64>,
    free: Vec<f64>,
    loads: [Vec<f64>; 2],
    load: DVector<f64>,
    sum: DVector<f64>,
    residual: Vec<f64>,
    /// The factored equations at the end.
    pub lu: SmallLu,
    z: Vec<f64>,
}

/// Settings of Newton's method for a step.
#[derive(Debug, Clone, Copy)]
struct AccelerationStepSettings {
    /// Largest number of Newton iterations of a step; 2 to 5 are typical, kinks need a few more.
    iterations: usize,
    /// Number of iterations after which the Newton step is halved, which ends a cycle between two
    /// sides of a kink.
    full_steps: usize,
    /// Correction relative to the velocity scale that ends the iteration: it is at the level of
    /// rounding.
    tolerance: f64,
    /// Relative correction that is accepted if rounding prevents further convergence.
    accepted_correction: f64,
}

impl Default for AccelerationStepSettings {
    fn default() -> Self {
        AccelerationStepSettings { iterations: 60, full_steps: 20, tolerance: 1e-13, accepted_correction: 1e-9 }
    }
}

impl AccelerationStep {
    pub fn new(assembly: &Assembly) -> Self {
        let (n, j) = (assembly.n, assembly.axes.len());
        let still = vec![RelativeMotion::along(0.0, 0.0); assembly.joints.len()];
        AccelerationStep {
            laws: assembly.joints.iter().map(LawIntegrator::new).collect(),
            before: DVector::zeros(j),
            force: DVector::zeros(j),
            from: still.clone(),
            to: still,
            unknown: vec![0.0; j],
            free: vec![0.0; j],
            loads: [vec![0.0; n], vec![0.0; n]],
            load: DVector::zeros(n),
            sum: DVector::zeros(n),
            residual: vec![0.0; j],
            lu: SmallLu::default(),
            z: vec![0.0; assembly.internal],
        }
    }

    /// Starts a run with the forces of the initial state.
    pub fn start(&mut self, assembly: &Assembly, state: &[f64], excitation: &HarmonicExcitation) {
        let n = assembly.n;
        excitation.load(0.0, &mut self.loads[1]);
        for (q, joint) in assembly.joints.iter().enumerate() {
            self.to[q] = assembly.motion_of(&assembly.joints[q], state, excitation, 0.0);
            let internal = joint.internal();
            let at = LawInstant { motion: self.to[q], z: &state[2 * n + internal.start..2 * n + internal.end] };
            let law = &mut self.laws[q];
            law.evaluate(&joint.law, at);
            joint.axes().zip(&law.force).for_each(|(axis, force)| self.force[axis] = *force);
        }
    }

    /// Advances `state` at `time` by one step. Returns false if Newton's method does not
    /// converge.
    pub fn advance(
        &mut self,
        assembly: &Assembly,
        eliminated: &AccelerationElimination,
        excitation: &HarmonicExcitation,
        (time, state): (f64, &mut [f64]),
        scale: f64,
    ) -> bool {
        let settings = AccelerationStepSettings::default();
        let (n, j, h) = (assembly.n, assembly.axes.len(), eliminated.length);
        // the end of the last step is the start of this one
        std::mem::swap(&mut self.before, &mut self.force);
        std::mem::swap(&mut self.from, &mut self.to);
        let [old, new] = &mut self.loads;
        std::mem::swap(old, new);
        excitation.load(time + h, new);
        self.load.iter_mut().zip(&*old).zip(&*new).for_each(|((load, old), new)| *load = old + new);
        let linear = nalgebra::DVectorView::from_slice(&state[..2 * n], 2 * n);
        self.sum.gemv(1.0, &eliminated.from_state, &linear, 0.0);
        self.sum.gemv(1.0, &eliminated.from_load, &self.load, 1.0);
        self.sum.gemv(1.0, &eliminated.from_force, &self.before, 1.0);
        self.z.copy_from_slice(&state[2 * n..]);
        for (axis, along) in assembly.axes.iter().enumerate() {
            self.free[axis] = along.component(self.sum.as_slice());
            self.unknown[axis] = along.component(&state[n..2 * n]);
        }
        for (q, joint) in assembly.joints.iter().enumerate() {
            let at = LawInstant { motion: self.from[q], z: &self.z[joint.internal()] };
            self.laws[q].begin(&joint.law, at);
        }
        let mut converged = j == 0;
        let mut previous = f64::INFINITY;
        for iteration in 0..settings.iterations {
            interrupt::check();
            if !self.evaluate(assembly, eliminated, excitation, (time, &state[n..2 * n])) || !self.lu.factor() {
                return false;
            }
            if converged {
                break;
            }
            self.lu.solve(&mut self.residual);
            let size = self.residual.iter().fold(0.0f64, |size, r| size.max(r.abs())) / scale;
            if !self.residual.iter().all(|r| r.is_finite()) {
                return false;
            }
            let share = if iteration < settings.full_steps { 1.0 } else { 0.5 };
            self.unknown.iter_mut().zip(&self.residual).for_each(|(w, step)| *w -= share * step);
            converged = size <= settings.tolerance || (size <= settings.accepted_correction && size >= previous);
            previous = size;
        }
        if !converged {
            return false;
        }
        let (x, rest) = state.split_at_mut(n);
        let (v, internal) = rest.split_at_mut(n);
        self.sum.gemv(1.0, &eliminated.from_force, &self.force, 1.0);
        for i in 0..n {
            x[i] += 0.5 * h * (v[i] + self.sum[i]);
            v[i] = self.sum[i];
        }
        for (joint, law) in assembly.joints.iter().zip(&self.laws) {
            internal[joint.internal()].copy_from_slice(&law.state);
        }
        true
    }

    /// Returns the joint whose law returned NaN in the last attempt.
    pub fn without_number<'a>(&self, assembly: &'a Assembly) -> Option<&'a IndexedLaw> {
        let broken = |law: &LawIntegrator| law.force.iter().chain(&law.state).any(|value| value.is_nan());
        assembly.joints.iter().zip(&self.laws).find_map(|(joint, law)| broken(law).then_some(joint))
    }

    /// Computes the residual and its derivative at the present unknowns, from the velocities
    /// `v` at the start.
    fn evaluate(
        &mut self,
        assembly: &Assembly,
        eliminated: &AccelerationElimination,
        excitation: &HarmonicExcitation,
        (time, v): (f64, &[f64]),
    ) -> bool {
        let (j, h) = (assembly.axes.len(), eliminated.length);
        let matrix = self.lu.zeros(j);
        for row in 0..j {
            matrix[row * j + row] = 1.0;
            self.residual[row] = self.unknown[row] - self.free[row];
        }
        for (q, joint) in assembly.joints.iter().enumerate() {
            for (d, axis) in joint.axes().enumerate() {
                let (g, speed) = excitation.relative_at(axis, time + h);
                let (before, _) = excitation.relative_at(axis, time);
                let travel = 0.5 * h * (assembly.axes[axis].component(v) + self.unknown[axis]);
                self.to[q].displacement[d] = self.from[q].displacement[d] + travel + g - before;
                self.to[q].velocity[d] = self.unknown[axis] + speed;
            }
            let law = &mut self.laws[q];
            let from = LawInstant { motion: self.from[q], z: &self.z[joint.internal()] };
            if !law.advance(&joint.law, from, &self.to[q], h) {
                return false;
            }
            for (d, axis) in joint.axes().enumerate() {
                self.force[axis] = law.force[d];
                let gains = eliminated.along_from_force.column(axis);
                for (row, gain) in gains.iter().enumerate() {
                    self.residual[row] -= gain * law.force[d];
                    for (e, other) in joint.axes().enumerate() {
                        matrix[row * j + other] -= gain * joint.derivative_by_end_velocity(law.force_slope(d), e, h);
                    }
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::equal_steps::AverageAccelerationFlow;
    use super::super::sensitivity::Sensitivity;
    use super::*;
    use crate::law::{Cubic, Jenkins2d, SharedLaw};
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use nalgebra::{Matrix2, Vector2};
    use std::sync::Arc;

    /// Places of 1 kg on springs (N/m) and dampers (kg/s), one per direction of the law, with
    /// the law to the ground.
    fn held(stiffness: f64, damping: f64, law: Option<SharedLaw>) -> (System, Assembly) {
        let n = law.as_ref().map_or(1, |law| law.directions());
        let each = |value: f64| DMatrix::identity(n, n) * value;
        let places = (0..n).map(|i| format!("x{i}")).collect();
        let structure = Structure::new(places, each(1.0), each(damping), each(stiffness)).unwrap();
        let mut builder = System::builder(structure);
        if let Some(law) = law {
            builder = builder.joint("j".to_owned(), law, (0..n).map(|i| Axis::new(vec![(i, 1.0)])).collect());
        }
        let system = builder.build().unwrap();
        let flow = AverageAccelerationFlow::new(&system, None, "test").unwrap();
        (system, flow.assembly)
    }

    /// Returns the state after `count` steps of size `h`, with its derivative with respect to
    /// the initial state.
    fn stepped(
        (system, assembly): &(System, Assembly),
        (h, count): (f64, usize),
        start: &[f64],
    ) -> (Vec<f64>, DMatrix<f64>) {
        let (eliminated, excitation) =
            (AccelerationElimination::new(assembly, h).unwrap(), assembly.excitation(system, 1.0));
        let (mut step, mut state) = (AccelerationStep::new(assembly), start.to_vec());
        let mut derivative = DMatrix::identity(start.len(), start.len());
        step.start(assembly, &state, &excitation);
        let mut carried = Sensitivity::new(assembly, &step.laws, &derivative);
        for k in 0..count {
            assert!(step.advance(assembly, &eliminated, &excitation, (k as f64 * h, &mut state), 1.0));
            carried.advance(assembly, &eliminated, &step.laws, &step.lu);
        }
        carried.write(&mut derivative);
        (state, derivative)
    }

    /// For a linear motion `y' = J y`, a step is the trapezoidal rule,
    /// `(1 - hJ/2) y₁ = (1 + hJ/2) y₀`, which conserves the energy of an undamped motion.
    #[test]
    fn a_linear_step_is_the_trapezoidal_rule() {
        for (k, c, h) in [(4.0, 0.6, 0.7), (4.0, 0.0, 3.0)] {
            let (z, one) = (Matrix2::new(0.0, 1.0, -k, -c) * (0.5 * h), Matrix2::identity());
            let ratio = (one - z).try_inverse().unwrap() * (one + z);
            let (end, derivative) = stepped(&held(k, c, None), (h, 1), &[0.3, -0.8]);
            let expected = ratio * Vector2::new(0.3, -0.8);
            for i in 0..2 {
                assert!((end[i] - expected[i]).abs() < 1e-14, "{end:?} {expected}");
                assert!((0..2).all(|j| (derivative[(i, j)] - ratio[(i, j)]).abs() < 1e-14), "{derivative} {ratio}");
            }
            let energy = |x: f64, v: f64| 0.5 * (k * x * x + v * v);
            let kept = energy(end[0], end[1]) / energy(0.3, -0.8);
            assert!(if c == 0.0 { (kept - 1.0).abs() < 1e-14 } else { kept < 1.0 }, "{kept}");
        }
    }

    /// With a cubic spring, halving the steps reduces the error by `2²`.
    #[test]
    fn steps_are_of_order_two() {
        let system = held(4.0, 0.6, Some(Arc::new(Cubic { stiffness: 3.0 })));
        let end = |count: usize| stepped(&system, (0.8 / count as f64, count), &[0.9, -0.4]).0;
        let apart = |a: &[f64], b: &[f64]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let (whole, halves, quarters) = (end(64), end(128), end(256));
        let order = (apart(&whole, &halves) / apart(&halves, &quarters)).log2();
        assert!((order - 2.0).abs() < 0.02, "{order}");
    }

    /// Compares the derivative of the end state with respect to the initial state with
    /// differences, for the motion and the forces of a slipping contact.
    #[test]
    fn the_derivative_is_that_of_the_step() {
        let law = Jenkins2d { stiffness: 5.0, limit: 0.7 };
        let system = held(4.0, 0.6, Some(Arc::new(law)));
        // in motion, with forces near their limit: the contact sticks at first, then slips
        // along a curve
        let start = [0.1, -0.2, 1.2, 0.8, 0.5, 0.2];
        let run = |start: &[f64]| stepped(&system, (0.05, 4), start);
        let (end, derivative) = run(&start);
        assert!((end[4].hypot(end[5]) / law.limit - 1.0).abs() < 1e-3, "{end:?}");
        const SMALL: f64 = 1e-6;
        for k in 0..start.len() {
            let moved = |by: f64| {
                let mut start = start;
                start[k] += by;
                run(&start).0
            };
            for (i, (up, down)) in moved(SMALL).iter().zip(moved(-SMALL)).enumerate() {
                let (difference, found) = ((up - down) / (2.0 * SMALL), derivative[(i, k)]);
                assert!((difference - found).abs() < 1e-7, "{i} by {k}: {found} {difference}");
            }
        }
    }
}
