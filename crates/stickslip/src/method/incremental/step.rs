//! One step of average acceleration for a linear structure with joints.
//!
//! `M (v₁ - v₀) = h/2 (r₀ + r₁)`, `x₁ = x₀ + h/2 (v₀ + v₁)`, with the forces `r = F - C v - K x - W f`. The velocities of the axes at the end are
//! `w = (linear in the state and the loads) - h/2 G (f₀ + f₁)`: Newton's method runs on one unknown per axis, however many masses there are.

use super::law::{At, Follower};
use crate::law::Relative;
use crate::method::assembly::{Assembly, PlacedLaw};
use crate::method::drive::Drive;
use nalgebra::{DMatrix, DVector};
use stickslip_numerics::lu::Lu;

/// The structure eliminated for one step length.
#[derive(Debug, Clone)]
pub(super) struct Eliminated {
    pub length: f64,
    /// Velocities at the end from displacements and velocities at the start (n × 2n), from loads at both instants added (n × n), from forces at
    /// both instants added (n × axes).
    from_state: DMatrix<f64>,
    from_load: DMatrix<f64>,
    from_force: DMatrix<f64>,
    /// The last along the axes, axes × axes: `-h/2 G`.
    along_from_force: DMatrix<f64>,
}

impl Eliminated {
    /// `None` if the numbers are out of range.
    pub fn new(assembly: &Assembly, h: f64) -> Option<Self> {
        let n = assembly.n;
        let (c, k) = (&assembly.damping * (0.5 * h), &assembly.stiffness * (0.25 * h * h));
        let left = &assembly.mass + &c + &k;
        let inverse = if n == 0 { left } else { left.try_inverse()? };
        let mut right = DMatrix::zeros(n, 2 * n);
        right.view_mut((0, 0), (n, n)).copy_from(&(&assembly.stiffness * -h));
        right.view_mut((0, n), (n, n)).copy_from(&(&assembly.mass - c - k));
        let from_force = &inverse * &assembly.directions * (-0.5 * h);
        Some(Eliminated {
            length: h,
            from_state: &inverse * right,
            along_from_force: assembly.directions.transpose() * &from_force,
            from_force,
            from_load: inverse * (0.5 * h),
        })
    }
}

/// The motion along the axes at an instant.
type Relatives = Vec<Relative<f64>>;

/// Memory and result of a step.
#[derive(Debug, Clone)]
pub(super) struct Step {
    /// What the laws answer, one for each joint.
    pub laws: Vec<Follower>,
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
    sum: DVector<f64>,
    residual: Vec<f64>,
    lu: Lu,
    z: Vec<f64>,
    /// Derivatives of the forces at the start by the state at the start of the run, axes × columns.
    pub carried: DMatrix<f64>,
}

/// Newton iterations of a step; 2 to 5 are usual, kinks take some more.
const ITERATIONS: usize = 60;
/// Iterations after which only half a step is taken: a cycle between two sides of a kink ends so.
const PATIENCE: usize = 20;
/// A correction below this fraction of the velocity's scale ends the iteration: it is rounding.
const SMALL: f64 = 1e-13;
/// One below this is good enough where rounding keeps the iteration from coming closer.
const ENOUGH: f64 = 1e-9;

impl Step {
    pub fn new(assembly: &Assembly) -> Self {
        let (n, j) = (assembly.n, assembly.axes.len());
        let still = vec![Relative::along(0.0, 0.0); assembly.joints.len()];
        Step {
            laws: assembly.joints.iter().map(Follower::new).collect(),
            before: DVector::zeros(j),
            force: DVector::zeros(j),
            from: still.clone(),
            to: still,
            unknown: vec![0.0; j],
            free: vec![0.0; j],
            loads: [vec![0.0; n], vec![0.0; n]],
            sum: DVector::zeros(n),
            residual: vec![0.0; j],
            lu: Lu::default(),
            z: vec![0.0; assembly.internal],
            carried: DMatrix::zeros(0, 0),
        }
    }

    /// Begins a run: the forces of the state, and their derivatives if `derivatives`.
    pub fn start(&mut self, assembly: &Assembly, state: &[f64], drive: &Drive, sensitivity: Option<&DMatrix<f64>>) {
        let (n, columns) = (assembly.n, sensitivity.map_or(0, DMatrix::ncols));
        self.carried = DMatrix::zeros(assembly.axes.len(), columns);
        drive.load(0.0, &mut self.loads[1]);
        for (q, joint) in assembly.joints.iter().enumerate() {
            self.to[q] = relative(assembly, q, state, drive, 0.0);
            let internal = joint.internal();
            let at = At { motion: self.to[q], z: &state[2 * n + internal.start..2 * n + internal.end] };
            let law = &mut self.laws[q];
            law.rest(&joint.law, at);
            for (d, axis) in joint.axes().enumerate() {
                self.force[axis] = law.force[d];
                let Some(sensitivity) = sensitivity else { continue };
                let slope = law.force_slope(d);
                let (directions, after) = (joint.directions, 2 * joint.directions + joint.states);
                for c in 0..columns {
                    let column = sensitivity.column(c);
                    let (x, rest) = column.as_slice().split_at(n);
                    let (v, z) = rest.split_at(n);
                    let mut value = 0.0;
                    for (e, other) in joint.axes().enumerate() {
                        let along = &assembly.axes[other];
                        // a step that goes nowhere begins where it ends
                        value += (slope[e] + slope[after + e]) * along.along(x);
                        value += (slope[directions + e] + slope[after + directions + e]) * along.along(v);
                    }
                    let through = joint.internal().enumerate().map(|(s, own)| slope[2 * directions + s] * z[own]);
                    self.carried[(axis, c)] = value + through.sum::<f64>();
                }
            }
        }
    }

    /// Steps from `state` at `time`, which becomes the state at the end; false if Newton's method does not converge.
    pub fn advance(
        &mut self,
        assembly: &Assembly,
        eliminated: &Eliminated,
        drive: &Drive,
        (time, state): (f64, &mut [f64]),
        scale: f64,
    ) -> bool {
        let (n, j, h) = (assembly.n, assembly.axes.len(), eliminated.length);
        // the end of the last step is the start of this one
        std::mem::swap(&mut self.before, &mut self.force);
        std::mem::swap(&mut self.from, &mut self.to);
        let [old, new] = &mut self.loads;
        std::mem::swap(old, new);
        drive.load(time + h, new);
        let load = DVector::from_fn(n, |i, _| old[i] + new[i]);
        let linear = nalgebra::DVectorView::from_slice(&state[..2 * n], 2 * n);
        self.sum.gemv(1.0, &eliminated.from_state, &linear, 0.0);
        self.sum.gemv(1.0, &eliminated.from_load, &load, 1.0);
        self.sum.gemv(1.0, &eliminated.from_force, &self.before, 1.0);
        self.z.copy_from_slice(&state[2 * n..]);
        for (axis, along) in assembly.axes.iter().enumerate() {
            self.free[axis] = along.along(self.sum.as_slice());
            self.unknown[axis] = along.along(&state[n..2 * n]);
        }
        for (q, joint) in assembly.joints.iter().enumerate() {
            let at = At { motion: self.from[q], z: &self.z[joint.internal()] };
            self.laws[q].begin(&joint.law, at);
        }
        let mut converged = j == 0;
        let mut previous = f64::INFINITY;
        for iteration in 0..ITERATIONS {
            if !self.evaluate(assembly, eliminated, drive, (time, &state[n..2 * n])) || !self.lu.factorise() {
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
            let share = if iteration < PATIENCE { 1.0 } else { 0.5 };
            self.unknown.iter_mut().zip(&self.residual).for_each(|(w, step)| *w -= share * step);
            converged = size <= SMALL || (size <= ENOUGH && size >= previous);
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

    /// The joint whose law answered the last attempt by what is no number.
    pub fn without_number<'a>(&self, assembly: &'a Assembly) -> Option<&'a PlacedLaw> {
        let broken = |law: &Follower| law.force.iter().chain(&law.state).any(|value| value.is_nan());
        assembly.joints.iter().zip(&self.laws).find_map(|(joint, law)| broken(law).then_some(joint))
    }

    /// Residual and its derivative at the present unknowns, from the velocities `v` at the start.
    fn evaluate(
        &mut self,
        assembly: &Assembly,
        eliminated: &Eliminated,
        drive: &Drive,
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
                let (g, speed) = drive.relative_at(axis, time + h);
                let (before, _) = drive.relative_at(axis, time);
                let travel = 0.5 * h * (assembly.axes[axis].along(v) + self.unknown[axis]);
                self.to[q].displacement[d] = self.from[q].displacement[d] + travel + g - before;
                self.to[q].velocity[d] = self.unknown[axis] + speed;
            }
            let law = &mut self.laws[q];
            let from = At { motion: self.from[q], z: &self.z[joint.internal()] };
            if !law.advance(&joint.law, from, &self.to[q], h) {
                return false;
            }
            for (d, axis) in joint.axes().enumerate() {
                self.force[axis] = law.force[d];
                let gains = eliminated.along_from_force.column(axis);
                for (row, gain) in gains.iter().enumerate() {
                    self.residual[row] -= gain * law.force[d];
                    for (e, other) in joint.axes().enumerate() {
                        matrix[row * j + other] -= gain * by_unknown(law, joint.directions, joint.states, d, e, h);
                    }
                }
            }
        }
        true
    }

    /// Carries the columns of `sensitivity` over the step that was made last.
    pub fn carry(&mut self, assembly: &Assembly, eliminated: &Eliminated, sensitivity: &mut DMatrix<f64>) {
        let (n, j, h) = (assembly.n, assembly.axes.len(), eliminated.length);
        let columns = sensitivity.ncols();
        if columns == 0 {
            return; // a joint that is only moved, without states
        }
        let mut velocity = &eliminated.from_state * sensitivity.rows(0, 2 * n);
        velocity.gemm(1.0, &eliminated.from_force, &self.carried, 1.0);
        let mut w = vec![0.0; j];
        let mut direct = vec![0.0; j];
        for c in 0..columns {
            let column = sensitivity.column(c);
            let (x, rest) = column.as_slice().split_at(n);
            let (v, z) = rest.split_at(n);
            let along: Vec<(f64, f64)> = assembly.axes.iter().map(|axis| (axis.along(x), axis.along(v))).collect();
            // what all but the unknown does
            let known = |slope: &[f64], joint: &PlacedLaw| {
                let (directions, after) = (joint.directions, 2 * joint.directions + joint.states);
                let mut value = 0.0;
                for (e, other) in joint.axes().enumerate() {
                    let (u, speed) = along[other];
                    value += slope[e] * u + slope[directions + e] * speed + slope[after + e] * (u + 0.5 * h * speed);
                }
                value + joint.internal().enumerate().map(|(s, own)| slope[2 * directions + s] * z[own]).sum::<f64>()
            };
            for (joint, law) in assembly.joints.iter().zip(&self.laws) {
                joint.axes().enumerate().for_each(|(d, axis)| direct[axis] = known(law.force_slope(d), joint));
            }
            for (row, w) in w.iter_mut().enumerate() {
                let gains = eliminated.along_from_force.row(row);
                let free = assembly.axes[row].along(velocity.column(c).as_slice());
                *w = free + gains.iter().zip(&direct).map(|(gain, f)| gain * f).sum::<f64>();
            }
            self.lu.solve(&mut w);
            let mut states = vec![0.0; assembly.internal];
            for (joint, law) in assembly.joints.iter().zip(&self.laws) {
                let (directions, after) = (joint.directions, 2 * joint.directions + joint.states);
                for (s, own) in joint.internal().enumerate() {
                    let slope = law.state_slope(s);
                    let moved = joint
                        .axes()
                        .enumerate()
                        .map(|(e, axis)| (0.5 * h * slope[after + e] + slope[after + directions + e]) * w[axis]);
                    states[own] = known(slope, joint) + moved.sum::<f64>();
                }
                for (d, axis) in joint.axes().enumerate() {
                    let moved = joint
                        .axes()
                        .enumerate()
                        .map(|(e, other)| by_unknown(law, directions, joint.states, d, e, h) * w[other]);
                    self.carried[(axis, c)] = direct[axis] + moved.sum::<f64>();
                }
            }
            sensitivity.view_mut((2 * n, c), (assembly.internal, 1)).copy_from_slice(&states);
        }
        velocity.gemm(1.0, &eliminated.from_force, &self.carried, 1.0);
        let mut moved = sensitivity.rows(n, n) + &velocity;
        moved *= 0.5 * h;
        let mut x = sensitivity.rows_mut(0, n);
        x += moved;
        sensitivity.rows_mut(n, n).copy_from(&velocity);
    }
}

/// Derivative of force `d` by the velocity of the structure along direction `e` at the end of the step.
fn by_unknown(law: &Follower, directions: usize, states: usize, d: usize, e: usize, h: f64) -> f64 {
    let after = 2 * directions + states;
    let slope = law.force_slope(d);
    0.5 * h * slope[after + e] + slope[after + directions + e]
}

/// The motion of a joint in a state.
fn relative(assembly: &Assembly, q: usize, state: &[f64], drive: &Drive, time: f64) -> Relative<f64> {
    let mut motion = Relative::along(0.0, 0.0);
    for (d, axis) in assembly.joints[q].axes().enumerate() {
        (motion.displacement[d], motion.velocity[d]) = assembly.relative(axis, state, drive, time);
    }
    motion
}

#[cfg(test)]
mod tests {
    use super::super::flow::IncrementalFlow;
    use super::*;
    use crate::law::{Cubic, Jenkins2d, SharedLaw};
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use nalgebra::{Matrix2, Vector2};
    use std::sync::Arc;

    /// Places of 1 kg on springs (N/m) and dampers (kg/s), as many as the law has directions, with the law to the ground.
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
        let flow = IncrementalFlow::new(&system, None, "test").unwrap();
        (system, flow.assembly)
    }

    /// The state after so many steps of length `h`, with its derivative by the start.
    fn stepped(
        (system, assembly): &(System, Assembly),
        (h, count): (f64, usize),
        start: &[f64],
    ) -> (Vec<f64>, DMatrix<f64>) {
        let (eliminated, drive) = (Eliminated::new(assembly, h).unwrap(), assembly.drive(system, 1.0));
        let (mut step, mut state) = (Step::new(assembly), start.to_vec());
        let mut derivative = DMatrix::identity(start.len(), start.len());
        step.start(assembly, &state, &drive, Some(&derivative));
        for k in 0..count {
            assert!(step.advance(assembly, &eliminated, &drive, (k as f64 * h, &mut state), 1.0));
            step.carry(assembly, &eliminated, &mut derivative);
        }
        (state, derivative)
    }

    /// Of a linear motion `y' = J y` a step is the trapezoidal rule, `(1 - hJ/2) y₁ = (1 + hJ/2) y₀`, which keeps the energy of one without damping.
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

    /// On a cubic spring halved steps come closer by `2²`.
    #[test]
    fn steps_are_of_order_two() {
        let system = held(4.0, 0.6, Some(Arc::new(Cubic { stiffness: 3.0 })));
        let end = |count: usize| stepped(&system, (0.8 / count as f64, count), &[0.9, -0.4]).0;
        let apart = |a: &[f64], b: &[f64]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let (whole, halves, quarters) = (end(64), end(128), end(256));
        let order = (apart(&whole, &halves) / apart(&halves, &quarters)).log2();
        assert!((order - 2.0).abs() < 0.02, "{order}");
    }

    /// The derivative of the end by the start, of motion and of the forces of a contact that slips, against differences.
    #[test]
    fn the_derivative_is_that_of_the_step() {
        let law = Jenkins2d { stiffness: 5.0, limit: 0.7 };
        let system = held(4.0, 0.6, Some(Arc::new(law)));
        // in motion, the forces near their limit: it sticks at first, then slips on a curve
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
