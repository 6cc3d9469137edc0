//! One step of Radau IIA-9 for a linear structure with smooth joints.
//!
//! Only the joints are nonlinear. Therefore the structure is eliminated once per step size: the
//! stage velocities along the joints' axes are
//! `u'ᵢ = (linear in the state and the loads) + Σ G fₖ`. Newton's method has five unknowns per
//! axis and per internal state of a law, for any number of masses. Step sizes are powers of two
//! times a tick, so that a few eliminations serve a whole orbit. The filter of the error
//! estimate is eliminated in the same way.

use crate::law::{RatePoint, RelativeMotion};
use crate::method::IntegrationError;
use crate::method::flow::assembly::{Assembly, IndexedLaw};
use crate::method::flow::excitation::HarmonicExcitation;
use crate::method::flow::step_record::StepRecord;
use crate::orbit::Contact;
use nalgebra::{DMatrix, DVector};
use stickslip_numerics::interrupt;
use stickslip_numerics::radau::{BUTCHER_MATRIX, ERROR_WEIGHTS, NODES, REAL_EIGENVALUE, STAGES, matrix_squared};
use stickslip_numerics::small_lu::SmallLu;
use stickslip_numerics::small_matvec::{add_matmul_row_major, add_matvec, axpy};

/// The eliminated structure for one step size.
#[derive(Debug, Clone)]
pub(crate) struct RadauElimination {
    pub length: f64,
    /// The Runge-Kutta matrix times the step size.
    weights: [[f64; STAGES]; STAGES],
    /// Stage velocities of the axes as functions of the state, the stage loads and the stage
    /// forces: (5 axes) × 2n, 5n, 5 axes.
    velocity_from_state: DMatrix<f64>,
    velocity_from_load: DMatrix<f64>,
    velocity_from_force: DMatrix<f64>,
    /// All stage displacements and velocities (10n: X₁…X₅V₁…V₅) as functions of the state, the
    /// stage loads and the stage forces.
    stage_from_state: DMatrix<f64>,
    stage_from_load: DMatrix<f64>,
    stage_from_force: DMatrix<f64>,
    /// The state at the end as a function of the state, the stage loads and the stage forces,
    /// 2n rows.
    end: [DMatrix<f64>; 3],
    /// The weighted increments of the error estimate, in the same form, 2n rows.
    increments: [DMatrix<f64>; 3],
    /// `P = (γM + C + K/γ)⁻¹` of the filter, with `γ = REAL_EIGENVALUE/h`; `P W` and `Wᵀ P W`.
    filter: [DMatrix<f64>; 3],
}

impl RadauElimination {
    pub fn new(assembly: &Assembly, h: f64) -> Self {
        let (n, j) = (assembly.n, assembly.axes.len());
        let a2 = matrix_squared();
        // (M + h C A + h² K A²) acc = load - W f - C v - K (x + c h v)
        let mut left = DMatrix::zeros(STAGES * n, STAGES * n);
        let mut from_state = DMatrix::zeros(STAGES * n, 2 * n);
        for i in 0..STAGES {
            for k in 0..STAGES {
                let mut block = left.view_mut((i * n, k * n), (n, n));
                block += &assembly.damping * (h * BUTCHER_MATRIX[i][k]) + &assembly.stiffness * (h * h * a2[i][k]);
                if i == k {
                    block += &assembly.mass;
                }
            }
            from_state.view_mut((i * n, 0), (n, n)).copy_from(&(-&assembly.stiffness));
            let v = -(&assembly.damping + &assembly.stiffness * (NODES[i] * h));
            from_state.view_mut((i * n, n), (n, n)).copy_from(&v);
        }
        let inverse = inverted(left);
        let acceleration_from_state = &inverse * from_state;
        let mut directions = DMatrix::zeros(STAGES * n, STAGES * j);
        for i in 0..STAGES {
            directions.view_mut((i * n, i * j), (n, j)).copy_from(&assembly.directions);
        }
        let acceleration_from_force = -&inverse * &directions;
        // X = x + c h v + h² A² acc, V = v + h A acc
        let stages = |acceleration: &DMatrix<f64>| {
            let mut out = DMatrix::zeros(2 * STAGES * n, acceleration.ncols());
            for i in 0..STAGES {
                for k in 0..STAGES {
                    let rows = acceleration.view((k * n, 0), (n, acceleration.ncols()));
                    for (first, share) in [(i * n, h * h * a2[i][k]), ((STAGES + i) * n, h * BUTCHER_MATRIX[i][k])] {
                        let mut sum = out.view_mut((first, 0), (n, acceleration.ncols()));
                        sum.zip_apply(&rows, |sum, a| *sum += a * share);
                    }
                }
            }
            out
        };
        let mut stage_from_state = stages(&acceleration_from_state);
        for i in 0..STAGES {
            for row in 0..n {
                stage_from_state[(i * n + row, row)] += 1.0;
                stage_from_state[(i * n + row, n + row)] += NODES[i] * h;
                stage_from_state[((STAGES + i) * n + row, n + row)] += 1.0;
            }
        }
        let (stage_from_load, stage_from_force) = (stages(&inverse), stages(&acceleration_from_force));
        let along = directions.transpose();
        let velocity = |stage: &DMatrix<f64>| &along * stage.rows(STAGES * n, STAGES * n);
        let all = [&stage_from_state, &stage_from_load, &stage_from_force];
        let weighted = |stage: &DMatrix<f64>, weights: [f64; STAGES]| {
            let mut out = DMatrix::zeros(2 * n, stage.ncols());
            for (i, weight) in weights.into_iter().enumerate() {
                let mut x = out.rows_mut(0, n);
                x += stage.rows(i * n, n) * weight;
                let mut v = out.rows_mut(n, n);
                v += stage.rows((STAGES + i) * n, n) * weight;
            }
            out
        };
        let mut increments = all.map(|stage| weighted(stage, ERROR_WEIGHTS.map(|weight| weight / h)));
        for row in 0..2 * n {
            increments[0][(row, row)] -= ERROR_WEIGHTS.iter().sum::<f64>() / h;
        }
        let rate = REAL_EIGENVALUE / h;
        let p = inverted(&assembly.mass * rate + &assembly.damping + &assembly.stiffness / rate);
        let pw = &p * &assembly.directions;
        RadauElimination {
            length: h,
            weights: BUTCHER_MATRIX.map(|row| row.map(|a| h * a)),
            velocity_from_state: velocity(&stage_from_state),
            velocity_from_load: velocity(&stage_from_load),
            velocity_from_force: velocity(&stage_from_force),
            end: all.map(|stage| weighted(stage, std::array::from_fn(|i| f64::from(u8::from(i == STAGES - 1))))),
            increments,
            filter: [p, pw.clone(), assembly.directions.transpose() * pw],
            stage_from_state,
            stage_from_load,
            stage_from_force,
        }
    }
}

/// Returns the inverse. A structure without masses has no rows. A singular matrix yields NaN,
/// which later checks detect.
fn inverted(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    if n == 0 { matrix } else { matrix.try_inverse().unwrap_or_else(|| DMatrix::from_element(n, n, f64::NAN)) }
}

/// The loads on one step, at its stages: forces on the masses and imposed relative motion along
/// the axes.
#[derive(Debug, Clone, Default)]
pub(crate) struct StageLoads {
    /// Forces on the masses, length 5n.
    pub force: DVector<f64>,
    /// Imposed relative displacement and velocity along the axes, stage by stage.
    pub stage: Vec<(f64, f64)>,
}

impl StageLoads {
    /// Sets the loads on a step of length `h` (s) that begins at `time` (s).
    pub fn set(&mut self, assembly: &Assembly, excitation: &HarmonicExcitation, time: f64, h: f64) {
        let n = assembly.n;
        if self.force.len() != STAGES * n {
            self.force.resize_vertically_mut(STAGES * n, 0.0);
        }
        self.stage.clear();
        for (i, c) in NODES.iter().enumerate() {
            let at = time + c * h;
            excitation.load(at, &mut self.force.as_mut_slice()[i * n..(i + 1) * n]);
            self.stage.extend((0..assembly.axes.len()).map(|axis| excitation.relative_at(axis, at)));
        }
    }
}

/// Returns the weights of the stages in the collocation polynomial of a step at `s`, where `s`
/// is relative to the step size.
pub(in crate::method) fn extrapolation_weights(s: f64) -> [f64; STAGES] {
    std::array::from_fn(|q| (0..STAGES).filter(|r| *r != q).map(|r| (s - NODES[r]) / (NODES[q] - NODES[r])).product())
}

/// Scratch memory and result of a step.
#[derive(Debug, Clone)]
pub(crate) struct RadauStep {
    /// Unknowns: stage velocities along the axes (stage by stage), then internal states (stage
    /// by stage).
    pub unknown: Vec<f64>,
    /// Marks axes at rest. Their unknown is not a velocity but an argument of the law: the law
    /// converts it to the force that keeps the velocity at zero.
    pub held: Vec<bool>,
    /// Stage forces along the axes.
    pub force: DVector<f64>,
    /// The laws at the stages, stage by stage. The last stage is the end of the step.
    pub points: Vec<RatePoint>,
    /// Displacements and velocities at the start.
    linear: DVector<f64>,
    /// All stage displacements and velocities, X₁…X₅V₁…V₅, valid after [`RadauStep::set_stages`].
    pub stages: DVector<f64>,
    free: DVector<f64>,
    structural: Vec<f64>,
    /// Structural stage velocities without the imposed ones, axis by axis.
    moving: Vec<[f64; STAGES]>,
    residual: Vec<f64>,
    lu: SmallLu,
    /// Scratch memory for a sensitivity: stage velocities and internal states, forces of the
    /// laws, end of the step.
    right: Vec<f64>,
    answer: Vec<f64>,
    carried: Vec<f64>,
    filter: Filter,
}

/// Subtracts `by(gain)` for each gain from the first rows of one column of a matrix, row by
/// row.
fn subtract(matrix: &mut [f64], columns: usize, column: usize, gains: &[f64], by: impl Fn(f64) -> f64) {
    let mut at = column;
    for gain in gains {
        matrix[at] -= by(*gain);
        at += columns;
    }
}

/// Returns the index of a stage's internal state among the unknowns.
fn state_index(assembly: &Assembly, stage: usize, s: usize) -> usize {
    STAGES * assembly.axes.len() + stage * assembly.internal + s
}

impl RadauStep {
    pub fn new(assembly: &Assembly) -> Self {
        let (j, unknowns) = (assembly.axes.len(), STAGES * (assembly.axes.len() + assembly.internal));
        RadauStep {
            unknown: vec![0.0; unknowns],
            held: vec![false; j],
            force: DVector::zeros(STAGES * j),
            points: (0..STAGES).flat_map(|_| evaluation_points(assembly)).collect(),
            linear: DVector::zeros(2 * assembly.n),
            stages: DVector::zeros(2 * STAGES * assembly.n),
            free: DVector::zeros(STAGES * j),
            structural: vec![0.0; j],
            moving: vec![[0.0; STAGES]; j],
            residual: vec![0.0; unknowns],
            lu: SmallLu::default(),
            right: Vec::new(),
            answer: Vec::new(),
            carried: Vec::new(),
            filter: Filter::new(assembly),
        }
    }

    /// Sets the initial guess of the unknowns to the collocation polynomial of the previous step,
    /// with the weights of its stages for each stage of this step.
    pub fn extrapolate(&mut self, assembly: &Assembly, previous: &[f64], weights: &[[f64; STAGES]; STAGES]) {
        let (j, internal) = (assembly.axes.len(), assembly.internal);
        for (i, weights) in weights.iter().enumerate() {
            for (offset, count) in [(0, j), (STAGES * j, internal)] {
                for k in 0..count {
                    let at = |stage: usize| offset + stage * count + k;
                    self.unknown[at(i)] = (0..STAGES).map(|q| weights[q] * previous[at(q)]).sum();
                }
            }
        }
    }

    /// Solves the step from `state`, with `self.unknown` as the initial guess.
    ///
    /// `derivatives` requests the factors at the solution for [`RadauStep::carry`]. Returns false
    /// if the iteration does not converge.
    pub fn solve(
        &mut self,
        assembly: &Assembly,
        eliminated: &RadauElimination,
        loads: &StageLoads,
        state: &[f64],
        (velocity_scale, derivatives): (f64, bool),
    ) -> bool {
        let (n, j, internal) = (assembly.n, assembly.axes.len(), assembly.internal);
        self.linear.copy_from_slice(&state[..2 * n]);
        self.free.fill(0.0);
        add_matvec(eliminated.velocity_from_state.as_slice(), self.linear.as_slice(), self.free.as_mut_slice());
        add_matvec(eliminated.velocity_from_load.as_slice(), loads.force.as_slice(), self.free.as_mut_slice());
        for (free, (_, velocity)) in self.free.iter_mut().zip(&loads.stage) {
            *free += velocity;
        }
        for (structural, axis) in self.structural.iter_mut().zip(&assembly.axes) {
            *structural = axis.component(&state[..n]);
        }
        let mut previous = f64::INFINITY;
        // Largest number of Newton iterations per step. With the extrapolated initial guess, 2 to
        // 4 are typical; a step that needs more is halved.
        for iteration in 0..12 {
            interrupt::check();
            self.evaluate(assembly, eliminated, loads);
            self.linearize(assembly, eliminated, state);
            if !self.lu.factor() {
                return false;
            }
            self.lu.solve(&mut self.residual);
            let mut size = 0.0f64;
            for (unknown, step) in self.unknown[..STAGES * j].iter_mut().zip(&self.residual) {
                *unknown -= step;
                size = size.max(step.abs() / velocity_scale);
            }
            for joint in &assembly.joints {
                for stage in 0..STAGES {
                    for s in joint.internal() {
                        let at = STAGES * j + stage * internal + s;
                        self.unknown[at] -= self.residual[at];
                        size = size.max(self.residual[at].abs() / joint.state_scale);
                    }
                }
            }
            // max ignores NaN
            if !size.is_finite() || self.residual.iter().any(|r| !r.is_finite()) {
                return false;
            }
            // Relative correction of the unknowns that ends the iteration: the next correction
            // would be at the level of rounding.
            if size <= 1e-9 {
                self.evaluate(assembly, eliminated, loads);
                if derivatives {
                    self.linearize(assembly, eliminated, state);
                    return self.lu.factor();
                }
                return true;
            }
            if iteration > 5 && size > previous {
                return false;
            }
            previous = size;
        }
        false
    }

    /// Returns the reason why no step is small enough: a law that returned NaN in the last attempt,
    /// or equations that are too stiff.
    pub fn stalled(&self, assembly: &Assembly, time: f64, step: f64) -> IntegrationError {
        let broken = |point: &RatePoint| point.force.iter().chain(&point.rate).any(|value| value.is_nan());
        let mut joints = assembly.joints.iter().cycle().zip(&self.points);
        match joints.find(|(_, point)| broken(point)) {
            Some((joint, _)) => joint.not_finite_error(time),
            None => IntegrationError::Stalled { time, step },
        }
    }

    /// Evaluates the laws at the present unknowns.
    fn evaluate(&mut self, assembly: &Assembly, eliminated: &RadauElimination, loads: &StageLoads) {
        let j = assembly.axes.len();
        let (unknown, stages) = (&self.unknown[..STAGES * j], &loads.stage[..STAGES * j]);
        for (axis, moving) in self.moving.iter_mut().enumerate() {
            *moving = std::array::from_fn(|k| unknown[k * j + axis] - stages[k * j + axis].1);
        }
        let joints = assembly.joints.len();
        for (q, joint) in assembly.joints.iter().enumerate() {
            let motions: [RelativeMotion<f64>; STAGES] = std::array::from_fn(|stage| {
                let mut motion = RelativeMotion::along(0.0, 0.0);
                for (d, axis) in joint.axes().enumerate() {
                    // structural displacement from the collocation of structural velocities,
                    // without imposed motion
                    let mut u = self.structural[axis] + loads.stage[stage * j + axis].0;
                    let moving = eliminated.weights[stage].iter().zip(&self.moving[axis]);
                    moving.for_each(|(weight, velocity)| u += weight * velocity);
                    motion.displacement[d] = u;
                    motion.velocity[d] = self.unknown[stage * j + axis];
                }
                motion
            });
            let states = |stage: usize| {
                let first = state_index(assembly, stage, joint.first_state);
                first..first + joint.states
            };
            match joint.law.rate() {
                // one call of a law in another language costs more than several points
                Some(rate) if rate.is_batched() => {
                    let z: Vec<f64> = (0..STAGES).flat_map(|stage| self.unknown[states(stage)].to_vec()).collect();
                    let mut points = vec![RatePoint::new(joint.directions, joint.states); STAGES];
                    rate.evaluate_many_with_derivatives(joint.directions, &motions, &z, &mut points);
                    for (stage, point) in points.into_iter().enumerate() {
                        self.points[stage * joints + q] = point;
                    }
                }
                Some(rate) => {
                    for (stage, motion) in motions.iter().enumerate() {
                        let point = &mut self.points[stage * joints + q];
                        rate.evaluate_with_derivatives(joint.directions, motion, &self.unknown[states(stage)], point);
                    }
                }
                None => {}
            }
            for stage in 0..STAGES {
                for (d, axis) in joint.axes().enumerate() {
                    self.force[stage * j + axis] = self.points[stage * joints + q].force[d];
                }
            }
        }
    }

    /// Computes residual and Jacobian from the laws at the present unknowns.
    fn linearize(&mut self, assembly: &Assembly, eliminated: &RadauElimination, state: &[f64]) {
        // constant sizes for the compiler: one axis, without states
        match (assembly.axes.len(), self.unknown.len()) {
            (1, STAGES) => self.differentiate(assembly, eliminated, state, (1, STAGES)),
            lengths => self.differentiate(assembly, eliminated, state, lengths),
        }
    }

    #[inline(always)]
    fn differentiate(
        &mut self,
        assembly: &Assembly,
        eliminated: &RadauElimination,
        state: &[f64],
        (j, unknowns): (usize, usize),
    ) {
        let (n, h, joints) = (assembly.n, eliminated.length, assembly.joints.len());
        let jacobian = self.lu.zeros(unknowns);
        for at in 0..unknowns {
            jacobian[at * unknowns + at] = 1.0;
        }
        let held = |at: usize| self.held[at % j];
        for at in (0..STAGES * j).filter(|at| held(*at)) {
            jacobian[at * unknowns + at] = 0.0;
        }
        // velocities
        let g = eliminated.velocity_from_force.as_slice(); // column by column
        for row in 0..STAGES * j {
            self.residual[row] = if held(row) { -self.free[row] } else { self.unknown[row] - self.free[row] };
        }
        for stage in 0..STAGES {
            for (q, joint) in assembly.joints.iter().enumerate() {
                let point = &self.points[stage * joints + q];
                let directions = joint.directions;
                let first = state_index(assembly, stage, joint.first_state);
                for (d, axis) in joint.axes().enumerate() {
                    let column = stage * j + axis;
                    let gains = &g[column * STAGES * j..(column + 1) * STAGES * j];
                    let (slope, force) = (point.force_slope(d), point.force[d]);
                    self.residual[..STAGES * j].iter_mut().zip(gains).for_each(|(r, gain)| *r -= gain * force);
                    for e in 0..directions {
                        let moved = joint.first_axis + e;
                        subtract(jacobian, unknowns, stage * j + moved, gains, |gain| gain * slope[directions + e]);
                        if slope[e] != 0.0 {
                            for k in 0..STAGES {
                                subtract(jacobian, unknowns, k * j + moved, gains, |gain| {
                                    gain * slope[e] * h * BUTCHER_MATRIX[stage][k]
                                });
                            }
                        }
                    }
                    for s in 0..joint.states {
                        subtract(jacobian, unknowns, first + s, gains, |gain| gain * slope[2 * directions + s]);
                    }
                }
            }
        }
        // internal states
        for (q, joint) in assembly.joints.iter().enumerate() {
            let directions = joint.directions;
            for s in 0..joint.states {
                for stage in 0..STAGES {
                    let row = state_index(assembly, stage, joint.first_state + s);
                    self.residual[row] = self.unknown[row] - state[2 * n + joint.first_state + s];
                    let entries = &mut jacobian[row * unknowns..(row + 1) * unknowns];
                    for k in 0..STAGES {
                        let weight = h * BUTCHER_MATRIX[stage][k];
                        let point = &self.points[k * joints + q];
                        let slope = point.rate_slope(s);
                        self.residual[row] -= weight * point.rate[s];
                        for e in 0..directions {
                            entries[k * j + joint.first_axis + e] -= weight * slope[directions + e];
                            if slope[e] != 0.0 {
                                for l in 0..STAGES {
                                    entries[l * j + joint.first_axis + e] -=
                                        weight * slope[e] * h * BUTCHER_MATRIX[k][l];
                                }
                            }
                        }
                        let first = state_index(assembly, k, joint.first_state);
                        for t in 0..joint.states {
                            entries[first + t] -= weight * slope[2 * directions + t];
                        }
                    }
                }
            }
        }
    }

    /// Computes the state at the end of the last solved step.
    pub fn end(&self, assembly: &Assembly, eliminated: &RadauElimination, loads: &StageLoads, out: &mut [f64]) {
        let n = assembly.n;
        self.combine(&eliminated.end, loads, &mut out[..2 * n]);
        let last = state_index(assembly, STAGES - 1, 0);
        out[2 * n..].copy_from_slice(&self.unknown[last..last + assembly.internal]);
    }

    /// Computes the displacements and velocities at all stages of the last solved step.
    pub fn set_stages(&mut self, eliminated: &RadauElimination, loads: &StageLoads) {
        let out = &mut self.stages;
        out.gemv(1.0, &eliminated.stage_from_state, &self.linear, 0.0);
        out.gemv(1.0, &eliminated.stage_from_load, &loads.force, 1.0);
        out.gemv(1.0, &eliminated.stage_from_force, &self.force, 1.0);
    }

    /// Records the stages of the last solved step, which began at `time`. `contact` returns the
    /// state of a joint from its index, velocity and force.
    pub fn record<'a>(
        &mut self,
        (assembly, eliminated, loads): (&'a Assembly, &RadauElimination, &StageLoads),
        time: f64,
        steps: &mut StepRecord,
        contact: impl Fn(usize, &'a IndexedLaw, &[f64], &[f64]) -> Contact,
    ) {
        let (n, j) = (assembly.n, assembly.axes.len());
        self.set_stages(eliminated, loads);
        let (x, v) = self.stages.as_slice().split_at(STAGES * n);
        steps.spans.push((time, eliminated.length));
        for i in 0..STAGES {
            let at_stage = i * j..(i + 1) * j;
            let moving = self.unknown[at_stage.clone()].iter().zip(&self.held);
            let velocity: Vec<f64> = moving.map(|(velocity, held)| if *held { 0.0 } else { *velocity }).collect();
            let force = &self.force.as_slice()[at_stage];
            let contacts = assembly.joints.iter().enumerate();
            let contacts = contacts.map(|(q, joint)| contact(q, joint, &velocity[joint.axes()], &force[joint.axes()]));
            let of = i * n..(i + 1) * n;
            steps.push_node([&x[of.clone()], &v[of]], [&velocity, force], contacts);
        }
    }

    fn combine(&self, [state, load, force]: &[DMatrix<f64>; 3], loads: &StageLoads, out: &mut [f64]) {
        out.fill(0.0);
        add_matvec(state.as_slice(), self.linear.as_slice(), out);
        add_matvec(load.as_slice(), loads.force.as_slice(), out);
        add_matvec(force.as_slice(), self.force.as_slice(), out);
    }

    /// Carries a sensitivity over the last solved step: row by row, states × columns. The
    /// operations act on whole rows, because these matrices are small and only the rows are
    /// long.
    pub fn carry(
        &mut self,
        assembly: &Assembly,
        eliminated: &RadauElimination,
        derivative: &mut [f64],
        columns: usize,
    ) {
        if derivative.is_empty() {
            return; // a joint with imposed motion only, without states
        }
        let (n, velocities, internal) = (assembly.n, STAGES * assembly.axes.len(), assembly.internal);
        for (memory, rows) in
            [(&mut self.right, self.unknown.len()), (&mut self.answer, velocities), (&mut self.carried, 2 * n)]
        {
            memory.clear();
            memory.resize(rows * columns, 0.0);
        }
        add_rows(&eliminated.velocity_from_state, derivative, &mut self.right, columns);
        self.forces_from_start(assembly, eliminated.length, derivative, columns);
        add_rows(&eliminated.velocity_from_force, &self.answer, &mut self.right, columns);
        self.lu.solve_rows(&mut self.right, columns);
        self.add_forces_from_stages(assembly, eliminated.length, columns);
        add_rows(&eliminated.end[0], derivative, &mut self.carried, columns);
        add_rows(&eliminated.end[2], &self.answer, &mut self.carried, columns);
        let (linear, inside) = derivative.split_at_mut(2 * n * columns);
        linear.copy_from_slice(&self.carried);
        let last = state_index(assembly, STAGES - 1, 0) * columns;
        inside.copy_from_slice(&self.right[last..last + internal * columns]);
    }

    /// Computes the effect of the displacements and internal states at the start of a step
    /// through the laws: forces in `answer`, internal states in `right`.
    fn forces_from_start(&mut self, assembly: &Assembly, h: f64, start: &[f64], columns: usize) {
        let (n, j, joints) = (assembly.n, assembly.axes.len(), assembly.joints.len());
        for (q, joint) in assembly.joints.iter().enumerate() {
            for stage in 0..STAGES {
                for (d, axis) in joint.axes().enumerate() {
                    let slope = self.points[stage * joints + q].force_slope(d);
                    let out = row_mut(&mut self.answer, stage * j + axis, columns);
                    for (e, moved) in joint.axes().enumerate() {
                        for &(place, weight) in assembly.axes[moved].rows() {
                            axpy(slope[e] * weight, row(start, place, columns), out);
                        }
                    }
                }
                for s in 0..joint.states {
                    let at = state_index(assembly, stage, joint.first_state + s);
                    let out = row_mut(&mut self.right, at, columns);
                    axpy(1.0, row(start, 2 * n + joint.first_state + s, columns), out);
                    for (e, moved) in joint.axes().enumerate() {
                        let slope =
                            |k: usize| h * BUTCHER_MATRIX[stage][k] * self.points[k * joints + q].rate_slope(s)[e];
                        let through: f64 = (0..STAGES).map(slope).sum();
                        for &(place, weight) in assembly.axes[moved].rows() {
                            axpy(through * weight, row(start, place, columns), out);
                        }
                    }
                }
            }
        }
    }

    /// Adds to `answer` the effect of the stages in `right` through the laws.
    fn add_forces_from_stages(&mut self, assembly: &Assembly, h: f64, columns: usize) {
        let (j, joints) = (assembly.axes.len(), assembly.joints.len());
        for stage in 0..STAGES {
            for (q, joint) in assembly.joints.iter().enumerate() {
                let first = state_index(assembly, stage, joint.first_state);
                for (d, axis) in joint.axes().enumerate() {
                    let slope = self.points[stage * joints + q].force_slope(d);
                    let out = row_mut(&mut self.answer, stage * j + axis, columns);
                    for (e, other) in joint.axes().enumerate() {
                        axpy(slope[joint.directions + e], row(&self.right, stage * j + other, columns), out);
                        if slope[e] != 0.0 {
                            for k in 0..STAGES {
                                axpy(
                                    slope[e] * h * BUTCHER_MATRIX[stage][k],
                                    row(&self.right, k * j + other, columns),
                                    out,
                                );
                            }
                        }
                    }
                    for s in 0..joint.states {
                        axpy(slope[2 * joint.directions + s], row(&self.right, first + s, columns), out);
                    }
                }
            }
        }
    }

    /// Computes the embedded error estimate of the last solved step, before its filter. `slope`
    /// is the time derivative of the state at its start.
    pub fn raw_error(
        &self,
        assembly: &Assembly,
        eliminated: &RadauElimination,
        loads: &StageLoads,
        (state, slope): (&[f64], &[f64]),
        out: &mut [f64],
    ) {
        let n = assembly.n;
        self.combine(&eliminated.increments, loads, &mut out[..2 * n]);
        for s in 0..assembly.internal {
            let increments = ERROR_WEIGHTS.iter().enumerate().map(|(i, weight)| {
                weight / eliminated.length * (self.unknown[state_index(assembly, i, s)] - state[2 * n + s])
            });
            out[2 * n + s] = increments.sum();
        }
        out.iter_mut().zip(slope).for_each(|(o, s)| *o += s);
    }

    /// Prepares the filter for the laws `at` the start of the step. Returns false if it is
    /// singular.
    pub fn prepare_filter(&mut self, assembly: &Assembly, eliminated: &RadauElimination, at: &[RatePoint]) -> bool {
        self.filter.prepare(assembly, eliminated, at, &self.held)
    }

    /// Applies the filter to an error estimate, so that stiff components do not dominate.
    pub fn filter(&mut self, assembly: &Assembly, eliminated: &RadauElimination, at: &[RatePoint], error: &mut [f64]) {
        self.filter.apply(assembly, eliminated, at, error);
    }

    /// Applies the filter with the laws at the end of the last solved step. Returns false if
    /// that filter is singular.
    pub fn filter_at_end(&mut self, assembly: &Assembly, eliminated: &RadauElimination, error: &mut [f64]) -> bool {
        let at = &self.points[(STAGES - 1) * assembly.joints.len()..];
        let regular = self.filter.prepare(assembly, eliminated, at, &self.held);
        if regular {
            self.filter.apply(assembly, eliminated, at, error);
        }
        regular
    }
}

fn row(matrix: &[f64], at: usize, columns: usize) -> &[f64] {
    &matrix[at * columns..(at + 1) * columns]
}

fn row_mut(matrix: &mut [f64], at: usize, columns: usize) -> &mut [f64] {
    &mut matrix[at * columns..(at + 1) * columns]
}

/// Adds `matrix x` to the first rows of `out`; `x` and `out` are stored row by row.
fn add_rows(matrix: &DMatrix<f64>, x: &[f64], out: &mut [f64], columns: usize) {
    add_matmul_row_major(matrix.as_slice(), matrix.nrows(), x, out, columns);
}

/// Creates one evaluation point per law.
pub(crate) fn evaluation_points(assembly: &Assembly) -> Vec<RatePoint> {
    assembly.joints.iter().map(|joint| RatePoint::new(joint.directions, joint.states)).collect()
}

/// The operator `(γ - J)⁻¹` with the Jacobian `J` of the motion, eliminated onto the axes.
///
/// Their velocities `w` satisfy `(1 + G T) w = Wᵀ P b - G t`, with the forces `T w + t` of the
/// laws.
#[derive(Debug, Clone)]
struct Filter {
    /// Elimination of the internal states of every law.
    states: Vec<SmallLu>,
    /// The matrix `T` of every law, directions × directions.
    answers: Vec<Vec<f64>>,
    axes: SmallLu,
    rate: f64,
    z: Vec<f64>,
    b: DVector<f64>,
    v: DVector<f64>,
    w: Vec<f64>,
    force: DVector<f64>,
}

impl Filter {
    fn new(assembly: &Assembly) -> Self {
        let most = assembly.joints.iter().map(|joint| joint.states).max().unwrap_or(0);
        Filter {
            states: vec![SmallLu::default(); assembly.joints.len()],
            answers: assembly.joints.iter().map(|joint| vec![0.0; joint.directions * joint.directions]).collect(),
            axes: SmallLu::default(),
            rate: 1.0,
            z: vec![0.0; most],
            b: DVector::zeros(assembly.n),
            v: DVector::zeros(assembly.n),
            w: vec![0.0; assembly.axes.len()],
            force: DVector::zeros(assembly.axes.len()),
        }
    }

    fn prepare(&mut self, assembly: &Assembly, eliminated: &RadauElimination, at: &[RatePoint], held: &[bool]) -> bool {
        let (rate, j) = (REAL_EIGENVALUE / eliminated.length, assembly.axes.len());
        self.rate = rate;
        for (q, (joint, point)) in assembly.joints.iter().zip(at).enumerate() {
            let (directions, states) = (joint.directions, joint.states);
            let matrix = self.states[q].zeros(states);
            for s in 0..states {
                let slope = point.rate_slope(s);
                for t in 0..states {
                    matrix[s * states + t] = f64::from(u8::from(s == t)) * rate - slope[2 * directions + t];
                }
            }
            if !self.states[q].factor() {
                return false;
            }
            for e in 0..directions {
                for s in 0..states {
                    let slope = point.rate_slope(s);
                    self.z[s] = slope[e] / rate + slope[directions + e];
                }
                self.states[q].solve(&mut self.z[..states]);
                for d in 0..directions {
                    let slope = point.force_slope(d);
                    let through: f64 = (0..states).map(|s| slope[2 * directions + s] * self.z[s]).sum();
                    self.answers[q][d * directions + e] = slope[e] / rate + slope[directions + e] + through;
                }
            }
        }
        let g = &eliminated.filter[2];
        let matrix = self.axes.zeros(j);
        for row in 0..j {
            matrix[row * j + row] = f64::from(u8::from(!held[row]));
            for (joint, answer) in assembly.joints.iter().zip(&self.answers) {
                for (e, column) in joint.axes().enumerate() {
                    let gains = joint.axes().enumerate().map(|(d, a)| g[(row, a)] * answer[d * joint.directions + e]);
                    matrix[row * j + column] += gains.sum::<f64>();
                }
            }
        }
        self.axes.factor()
    }

    fn apply(&mut self, assembly: &Assembly, eliminated: &RadauElimination, at: &[RatePoint], error: &mut [f64]) {
        let (n, rate) = (assembly.n, self.rate);
        let [p, pw, g] = &eliminated.filter;
        let (linear, internal) = error.split_at_mut(2 * n);
        let (x, v) = linear.split_at_mut(n);
        for i in 0..n {
            self.b[i] = (0..n).map(|k| assembly.mass[(i, k)] * v[k] - assembly.stiffness[(i, k)] * x[k] / rate).sum();
        }
        self.v.gemv(1.0, p, &self.b, 0.0);
        // the forces t of the laws at zero velocity of the axes
        for (q, (joint, point)) in assembly.joints.iter().zip(at).enumerate() {
            let (directions, states) = (joint.directions, joint.states);
            let mut u = [0.0; crate::law::MAX_DIRECTIONS];
            joint.axes().enumerate().for_each(|(d, axis)| u[d] = assembly.axes[axis].component(x) / rate);
            for (s, own) in joint.internal().enumerate() {
                let slope = point.rate_slope(s);
                self.z[s] = internal[own] + (0..directions).map(|e| slope[e] * u[e]).sum::<f64>();
            }
            self.states[q].solve(&mut self.z[..states]);
            internal[joint.internal()].copy_from_slice(&self.z[..states]);
            for (d, axis) in joint.axes().enumerate() {
                let slope = point.force_slope(d);
                let direct: f64 = (0..directions).map(|e| slope[e] * u[e]).sum();
                let through: f64 = (0..states).map(|s| slope[2 * directions + s] * self.z[s]).sum();
                self.force[axis] = direct + through;
            }
        }
        for (row, (w, axis)) in self.w.iter_mut().zip(&assembly.axes).enumerate() {
            *w =
                axis.component(self.v.as_slice()) - g.row(row).iter().zip(&self.force).map(|(g, t)| g * t).sum::<f64>();
        }
        self.axes.solve(&mut self.w);
        for (q, (joint, point)) in assembly.joints.iter().zip(at).enumerate() {
            let (directions, states) = (joint.directions, joint.states);
            let w = &self.w[joint.axes()];
            for (d, axis) in joint.axes().enumerate() {
                self.force[axis] += (0..directions).map(|e| self.answers[q][d * directions + e] * w[e]).sum::<f64>();
            }
            for s in 0..states {
                let slope = point.rate_slope(s);
                self.z[s] = (0..directions).map(|e| (slope[e] / rate + slope[directions + e]) * w[e]).sum();
            }
            self.states[q].solve(&mut self.z[..states]);
            internal[joint.internal()].iter_mut().zip(&self.z).for_each(|(error, z)| *error += z);
        }
        self.v.gemv(-1.0, pw, &self.force, 1.0);
        for i in 0..n {
            v[i] = self.v[i];
            x[i] = (x[i] + v[i]) / rate;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Cubic, JenkinsArctan, SharedLaw};
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use nalgebra::{Matrix2, Vector2};
    use std::sync::Arc;

    /// A mass of 1 kg on a spring (N/m) and a damper (kg/s), with these laws to the ground.
    fn oscillator(stiffness: f64, damping: f64, laws: &[SharedLaw]) -> Assembly {
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        let structure = Structure::new(vec!["m".into()], one(1.0), one(damping), one(stiffness)).unwrap();
        let mut builder = System::builder(structure);
        for (i, law) in laws.iter().enumerate() {
            builder = builder.joint(format!("j{i}"), law.clone(), vec![Axis::new(vec![(0, 1.0)])]);
        }
        super::super::assembly(&builder.build().unwrap(), None, "test").unwrap()
    }

    /// Returns the state after `count` steps of size `h` under a load, and the derivative with
    /// respect to `start`, row by row.
    fn stepped(
        assembly: &Assembly,
        (h, count): (f64, usize),
        load: &dyn Fn(f64) -> f64,
        start: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let (eliminated, states) = (RadauElimination::new(assembly, h), assembly.states());
        let mut step = RadauStep::new(assembly);
        let mut state = start.to_vec();
        let mut derivative = DMatrix::<f64>::identity(states, states).as_slice().to_vec();
        for k in 0..count {
            let loads = StageLoads {
                force: DVector::from_fn(STAGES, |i, _| load((k as f64 + NODES[i]) * h)),
                stage: vec![(0.0, 0.0); STAGES * assembly.axes.len()],
            };
            assert!(step.solve(assembly, &eliminated, &loads, &state, (1.0, true)));
            let mut end = state.clone();
            step.end(assembly, &eliminated, &loads, &mut end);
            step.carry(assembly, &eliminated, &mut derivative, states);
            state = end;
        }
        (state, derivative)
    }

    fn still(_: f64) -> f64 {
        0.0
    }

    /// For a linear motion `y' = J y`, a step of Radau IIA of order 9 is
    /// `y₁ = Q(hJ)⁻¹ P(hJ) y₀`, the (4,5) Padé approximation of the exponential.
    ///
    /// Source: Hairer and Wanner, "Solving Ordinary Differential Equations II" (1996),
    /// Sec. IV.3 and IV.5.
    #[test]
    fn a_linear_step_is_the_pade_approximation() {
        let (k, c, h) = (4.0, 0.6, 0.7);
        let (z, one) = (Matrix2::new(0.0, 1.0, -k, -c) * h, Matrix2::identity());
        let above = one + z * (4.0 / 9.0) + z.pow(2) / 12.0 + z.pow(3) / 126.0 + z.pow(4) / 3024.0;
        let below = one - z * (5.0 / 9.0) + z.pow(2) * (5.0 / 36.0) - z.pow(3) * (5.0 / 252.0)
            + z.pow(4) * (5.0 / 3024.0)
            - z.pow(5) / 15120.0;
        let ratio = below.try_inverse().unwrap() * above;
        let (end, derivative) = stepped(&oscillator(k, c, &[]), (h, 1), &still, &[0.3, -0.8]);
        let by_start = [ratio[(0, 0)], ratio[(0, 1)], ratio[(1, 0)], ratio[(1, 1)]];
        assert!(derivative.iter().zip(by_start).all(|(a, b)| (a - b).abs() < 1e-14), "{derivative:?} {ratio}");
        let expected = ratio * Vector2::new(0.3, -0.8);
        for i in 0..2 {
            assert!((end[i] - expected[i]).abs() < 1e-14, "{end:?} {expected}");
        }
    }

    /// A force that is a polynomial of degree 7 in time moves a free mass exactly:
    /// `x = Σ aₙ hⁿ⁺²/((n+1)(n+2))`. For degree 8, only the velocity is exact.
    #[test]
    fn polynomial_loads_are_exact() {
        let h = 1.3f64;
        for (degree, exact) in [(7, true), (8, false)] {
            let load = |t: f64| (0..=degree).map(|n| f64::from(n + 1) * t.powi(n)).sum();
            let (end, _) = stepped(&oscillator(0.0, 0.0, &[]), (h, 1), &load, &[0.0, 0.0]);
            let velocity: f64 = (0..=degree).map(|n| h.powi(n + 1)).sum();
            let place: f64 = (0..=degree).map(|n| h.powi(n + 2) / f64::from(n + 2)).sum();
            assert!((end[1] - velocity).abs() < 1e-13 * velocity, "{degree}: {} {velocity}", end[1]);
            assert_eq!((end[0] - place).abs() < 1e-13 * place, exact, "{degree}: {} {place}", end[0]);
        }
    }

    /// With a cubic spring, halving the steps reduces the error by `2⁹`.
    #[test]
    fn steps_are_of_order_nine() {
        let assembly = oscillator(4.0, 0.6, &[Arc::new(Cubic { stiffness: 3.0 })]);
        let end = |count: usize| stepped(&assembly, (0.8 / count as f64, count), &f64::cos, &[0.9, -0.4]).0;
        let apart = |a: &[f64], b: &[f64]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let (whole, halves, quarters) = (end(4), end(8), end(16));
        let order = (apart(&whole, &halves) / apart(&halves, &quarters)).log2();
        assert!((order - 9.0).abs() < 0.2, "{order}");
    }

    /// Compares the derivative of the end state with respect to the initial state with
    /// differences, for motion and internal state.
    #[test]
    fn the_derivative_is_that_of_the_step() {
        let laws: [SharedLaw; 2] =
            [Arc::new(JenkinsArctan { stiffness: 5.0, limit: 0.7, alpha: 2.0 }), Arc::new(Cubic { stiffness: 3.0 })];
        let assembly = oscillator(4.0, 0.6, &laws);
        let start = [0.4, 0.9, 0.2];
        assert_eq!(assembly.states(), start.len());
        let run = |start: &[f64]| stepped(&assembly, (0.1, 2), &f64::cos, start);
        let derivative = run(&start).1;
        const SMALL: f64 = 1e-5;
        for k in 0..start.len() {
            let moved = |by: f64| {
                let mut start = start;
                start[k] += by;
                run(&start).0
            };
            for (i, (up, down)) in moved(SMALL).iter().zip(moved(-SMALL)).enumerate() {
                let (difference, found) = ((up - down) / (2.0 * SMALL), derivative[i * start.len() + k]);
                assert!((difference - found).abs() < 1e-8, "{i} by {k}: {found} {difference}");
            }
        }
    }
}
