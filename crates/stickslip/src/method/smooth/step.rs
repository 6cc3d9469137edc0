//! One step of Radau IIA-5 for a linear structure with smooth joints.
//!
//! Only the joints are non-linear, so the structure is eliminated once per step length: the stage velocities of the joints are
//! `u'ᵢ = (linear in the state and the loads) + Σ G fₖ`, and Newton's method runs on 3 unknowns per joint (and per internal
//! state of a law), however many masses there are. Step lengths are powers of two times a tick, so that a few eliminations serve
//! a whole orbit.

use crate::law::{Law, RatePoint, Relative, SharedLaw};
use nalgebra::{DMatrix, DVector, Dim, Dyn, LU, Matrix, StorageMut};
use stickslip_numerics::radau::{A, C, STAGES, squared};

/// The structure and its joints as the smooth methods see them.
#[derive(Debug, Clone)]
pub(crate) struct Structure {
    pub n: usize,
    pub mass: DMatrix<f64>,
    pub inverse_mass: DMatrix<f64>,
    pub damping: DMatrix<f64>,
    pub stiffness: DMatrix<f64>,
    /// `M⁻¹C` and `M⁻¹K`.
    pub damping_rate: DMatrix<f64>,
    pub stiffness_rate: DMatrix<f64>,
    pub joints: Vec<SmoothJoint>,
    /// Internal states of all laws.
    pub internal: usize,
}

#[derive(Debug, Clone)]
pub(crate) struct SmoothJoint {
    pub direction: DVector<f64>,
    /// `M⁻¹` times the direction: accelerations that a unit force takes away.
    pub mobility: DVector<f64>,
    pub law: SharedLaw,
    /// Index of its first internal state.
    pub first_state: usize,
    pub states: usize,
    /// Slip limit, for the report of stick and slip.
    pub limit: f64,
}

impl Structure {
    /// Length of the state `(x, v, internal states)`.
    pub fn states(&self) -> usize {
        2 * self.n + self.internal
    }
    /// Unknowns of a step: a velocity per joint and the internal states, for every stage.
    fn unknowns(&self) -> usize {
        STAGES * (self.joints.len() + self.internal)
    }
}

/// Most internal states that a law may have here.
pub(crate) const MOST_STATES: usize = 1;
/// Arguments of a law: u, u', internal states.
const ARGUMENTS: usize = 2 + MOST_STATES;

/// Force and rates of a law at one instant, with derivatives with respect to (u, u', z).
#[derive(Debug, Clone, Copy)]
pub(crate) struct LawPoint {
    pub force: f64,
    pub force_slope: [f64; ARGUMENTS],
    pub rate: [f64; MOST_STATES],
    pub rate_slope: [[f64; ARGUMENTS]; MOST_STATES],
}

impl LawPoint {
    #[inline]
    pub fn new(law: &dyn Law, u: f64, velocity: f64, z: &[f64]) -> Self {
        let mut point = RatePoint::new(1, z.len());
        if let Some(rate) = law.rate() {
            rate.linearise(1, &Relative::along(u, velocity), z, &mut point);
        }
        let slopes = |row: &[f64]| std::array::from_fn(|i| row.get(i).copied().unwrap_or(0.0));
        LawPoint {
            force: point.force[0],
            force_slope: slopes(point.force_slope(0)),
            rate: std::array::from_fn(|s| point.rate.get(s).copied().unwrap_or(0.0)),
            rate_slope: std::array::from_fn(
                |s| if s < z.len() { slopes(point.rate_slope(s)) } else { [0.0; ARGUMENTS] },
            ),
        }
    }
}

/// The eliminated structure for one step length.
#[derive(Debug, Clone)]
pub(crate) struct Eliminated {
    pub length: f64,
    /// Joint stage velocities from the state: (3 joints) × 2n.
    velocity_from_state: DMatrix<f64>,
    /// Joint stage velocities from stage loads: (3 joints) × 3n.
    velocity_from_load: DMatrix<f64>,
    /// Joint stage velocities from stage joint forces: (3 joints) × (3 joints).
    velocity_from_force: DMatrix<f64>,
    /// All stage displacements and velocities (6n: X₁X₂X₃V₁V₂V₃) from the state, stage loads, stage joint forces.
    stage_from_state: DMatrix<f64>,
    stage_from_load: DMatrix<f64>,
    stage_from_force: DMatrix<f64>,
}

impl Eliminated {
    pub fn new(structure: &Structure, h: f64) -> Self {
        let (n, j) = (structure.n, structure.joints.len());
        let a2 = squared();
        // (M + h C A + h² K A²) acc = load - W f - C v - K (x + c h v)
        let mut left = DMatrix::zeros(STAGES * n, STAGES * n);
        let mut from_state = DMatrix::zeros(STAGES * n, 2 * n);
        for i in 0..STAGES {
            for k in 0..STAGES {
                let mut block = left.view_mut((i * n, k * n), (n, n));
                block += &structure.damping * (h * A[i][k]) + &structure.stiffness * (h * h * a2[i][k]);
                if i == k {
                    block += &structure.mass;
                }
            }
            from_state.view_mut((i * n, 0), (n, n)).copy_from(&(-&structure.stiffness));
            let v = -(&structure.damping + &structure.stiffness * (C[i] * h));
            from_state.view_mut((i * n, n), (n, n)).copy_from(&v);
        }
        let inverse =
            if n == 0 { left } else { left.try_inverse().unwrap_or_else(|| DMatrix::zeros(STAGES * n, STAGES * n)) };
        let acceleration_from_state = &inverse * from_state;
        let mut directions = DMatrix::zeros(STAGES * n, STAGES * j);
        for (q, joint) in structure.joints.iter().enumerate() {
            for i in 0..STAGES {
                directions.view_mut((i * n, i * j + q), (n, 1)).copy_from(&joint.direction);
            }
        }
        let acceleration_from_force = -&inverse * &directions;
        // X = x + c h v + h² A² acc, V = v + h A acc
        let stages = |acceleration: &DMatrix<f64>| {
            let mut out = DMatrix::zeros(2 * STAGES * n, acceleration.ncols());
            for i in 0..STAGES {
                for k in 0..STAGES {
                    let rows = acceleration.view((k * n, 0), (n, acceleration.ncols()));
                    let mut x = out.view_mut((i * n, 0), (n, acceleration.ncols()));
                    x += rows * (h * h * a2[i][k]);
                    let mut v = out.view_mut(((STAGES + i) * n, 0), (n, acceleration.ncols()));
                    v += rows * (h * A[i][k]);
                }
            }
            out
        };
        let mut stage_from_state = stages(&acceleration_from_state);
        for i in 0..STAGES {
            for row in 0..n {
                stage_from_state[(i * n + row, row)] += 1.0;
                stage_from_state[(i * n + row, n + row)] += C[i] * h;
                stage_from_state[((STAGES + i) * n + row, n + row)] += 1.0;
            }
        }
        let (stage_from_load, stage_from_force) = (stages(&inverse), stages(&acceleration_from_force));
        let along = directions.transpose();
        let velocity = |stage: &DMatrix<f64>| &along * stage.rows(STAGES * n, STAGES * n);
        Eliminated {
            length: h,
            velocity_from_state: velocity(&stage_from_state),
            velocity_from_load: velocity(&stage_from_load),
            velocity_from_force: velocity(&stage_from_force),
            stage_from_state,
            stage_from_load,
            stage_from_force,
        }
    }
}

/// The loads on one step: forces on the masses and imposed relative motion of the joints, at its stages.
#[derive(Debug, Clone, Default)]
pub(crate) struct StageLoads {
    /// 3n.
    pub force: DVector<f64>,
    /// Imposed relative displacement and velocity of the joints, stage after stage.
    pub stage: Vec<(f64, f64)>,
}

/// Memory and result of a step.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    /// Unknowns: stage velocities of the joints (stage after stage), then internal states (stage after stage).
    pub unknown: DVector<f64>,
    /// Stage displacements and velocities, 6n.
    pub stages: DVector<f64>,
    /// Stage forces of the joints.
    pub force: DVector<f64>,
    free: DVector<f64>,
    points: Vec<LawPoint>,
    residual: DVector<f64>,
    jacobian: DMatrix<f64>,
    factor: Option<LU<f64, Dyn, Dyn>>,
    structural: DVector<f64>,
}

/// Newton iterations per step; from the extrapolated start 2 to 4 are usual, a step that needs more is halved.
const ITERATIONS: usize = 12;
/// A correction of the unknowns below this fraction of their scale ends the iteration: the next one would be at rounding.
const SMALL: f64 = 1e-9;

impl Step {
    pub fn new(structure: &Structure) -> Self {
        let (j, unknowns) = (structure.joints.len(), structure.unknowns());
        let zero = LawPoint { force: 0.0, force_slope: [0.0; 3], rate: [0.0; 1], rate_slope: [[0.0; 3]; 1] };
        Step {
            unknown: DVector::zeros(unknowns),
            stages: DVector::zeros(2 * STAGES * structure.n),
            force: DVector::zeros(STAGES * j),
            free: DVector::zeros(STAGES * j),
            points: vec![zero; STAGES * j],
            residual: DVector::zeros(unknowns),
            jacobian: DMatrix::zeros(unknowns, unknowns),
            factor: None,
            structural: DVector::zeros(j),
        }
    }

    /// Solves the step from `state`, with `self.unknown` as the start of the iteration. Returns false if it does not converge.
    pub fn solve(
        &mut self,
        structure: &Structure,
        eliminated: &Eliminated,
        loads: &StageLoads,
        state: &[f64],
        velocity_scale: f64,
    ) -> bool {
        let (n, j, internal) = (structure.n, structure.joints.len(), structure.internal);
        let linear = DVector::from_column_slice(&state[..2 * n]);
        self.free.gemv(1.0, &eliminated.velocity_from_state, &linear, 0.0);
        self.free.gemv(1.0, &eliminated.velocity_from_load, &loads.force, 1.0);
        for (free, (_, velocity)) in self.free.iter_mut().zip(&loads.stage) {
            *free += velocity;
        }
        for (q, joint) in structure.joints.iter().enumerate() {
            self.structural[q] = (0..n).map(|i| joint.direction[i] * state[i]).sum();
        }
        let mut previous = f64::INFINITY;
        for iteration in 0..ITERATIONS {
            self.evaluate(structure, eliminated, loads, state);
            let Some(factor) = factorised(&self.jacobian) else { return false };
            let mut step = -&self.residual;
            if !solved(&factor, &mut step) || step.iter().any(|s| !s.is_finite()) {
                return false;
            }
            self.unknown += &step;
            self.factor = Some(factor);
            let mut size = 0.0f64;
            for i in 0..STAGES * j {
                size = size.max(step[i].abs() / velocity_scale);
            }
            for i in STAGES * j..STAGES * (j + internal) {
                size = size.max(step[i].abs());
            }
            if size <= SMALL {
                self.evaluate(structure, eliminated, loads, state);
                self.finish(eliminated, loads, &linear);
                return true;
            }
            if iteration > 5 && size > previous {
                return false;
            }
            previous = size;
        }
        false
    }

    /// Residual and Jacobian at the present unknowns.
    fn evaluate(&mut self, structure: &Structure, eliminated: &Eliminated, loads: &StageLoads, state: &[f64]) {
        let (n, j, internal, h) = (structure.n, structure.joints.len(), structure.internal, eliminated.length);
        let z_at = |stage: usize, s: usize| STAGES * j + stage * internal + s;
        for stage in 0..STAGES {
            for (q, joint) in structure.joints.iter().enumerate() {
                let row = stage * j + q;
                // structural displacement from the collocation of structural velocities, imposed motion apart
                let mut u = self.structural[q] + loads.stage[row].0;
                for k in 0..STAGES {
                    u += h * A[stage][k] * (self.unknown[k * j + q] - loads.stage[k * j + q].1);
                }
                let first = z_at(stage, joint.first_state);
                let z = &self.unknown.as_slice()[first..first + joint.states];
                let point = LawPoint::new(&*joint.law, u, self.unknown[row], z);
                self.force[row] = point.force;
                self.points[row] = point;
            }
        }
        // velocities
        self.residual.fill(0.0);
        self.jacobian.fill(0.0);
        let g = &eliminated.velocity_from_force;
        for row in 0..STAGES * j {
            self.residual[row] = self.unknown[row] - self.free[row];
            self.jacobian[(row, row)] += 1.0;
            for column in 0..STAGES * j {
                let gain = g[(row, column)];
                if gain == 0.0 {
                    continue;
                }
                let (stage, q) = (column / j, column % j);
                let point = &self.points[column];
                self.residual[row] -= gain * point.force;
                self.jacobian[(row, column)] -= gain * point.force_slope[1];
                if point.force_slope[0] != 0.0 {
                    for k in 0..STAGES {
                        self.jacobian[(row, k * j + q)] -= gain * point.force_slope[0] * h * A[stage][k];
                    }
                }
                let joint = &structure.joints[q];
                for s in 0..joint.states {
                    self.jacobian[(row, z_at(stage, joint.first_state + s))] -= gain * point.force_slope[2 + s];
                }
            }
        }
        // internal states
        for (q, joint) in structure.joints.iter().enumerate() {
            for s in 0..joint.states {
                for stage in 0..STAGES {
                    let row = z_at(stage, joint.first_state + s);
                    self.residual[row] = self.unknown[row] - state[2 * n + joint.first_state + s];
                    self.jacobian[(row, row)] += 1.0;
                    for k in 0..STAGES {
                        let weight = h * A[stage][k];
                        let point = &self.points[k * j + q];
                        self.residual[row] -= weight * point.rate[s];
                        self.jacobian[(row, k * j + q)] -= weight * point.rate_slope[s][1];
                        for l in 0..STAGES {
                            self.jacobian[(row, l * j + q)] -= weight * point.rate_slope[s][0] * h * A[k][l];
                        }
                        for t in 0..joint.states {
                            self.jacobian[(row, z_at(k, joint.first_state + t))] -= weight * point.rate_slope[s][2 + t];
                        }
                    }
                }
            }
        }
    }

    fn finish(&mut self, eliminated: &Eliminated, loads: &StageLoads, linear: &DVector<f64>) {
        self.stages.gemv(1.0, &eliminated.stage_from_state, linear, 0.0);
        self.stages.gemv(1.0, &eliminated.stage_from_load, &loads.force, 1.0);
        self.stages.gemv(1.0, &eliminated.stage_from_force, &self.force, 1.0);
        self.factor = factorised(&self.jacobian);
    }

    /// Carries the columns of `sensitivity` over the step that was solved last.
    pub fn carry(&self, structure: &Structure, eliminated: &Eliminated, sensitivity: &mut DMatrix<f64>) {
        let (n, j, internal, h) = (structure.n, structure.joints.len(), structure.internal, eliminated.length);
        let Some(factor) = &self.factor else { return };
        let columns = sensitivity.ncols();
        let linear = sensitivity.rows(0, 2 * n).into_owned();
        let mut right = DMatrix::zeros(structure.unknowns(), columns);
        right.rows_mut(0, STAGES * j).gemm(1.0, &eliminated.velocity_from_state, &linear, 0.0);
        // what the displacement at the start does through the laws
        let mut direct = DMatrix::zeros(STAGES * j, columns);
        for (q, joint) in structure.joints.iter().enumerate() {
            let u = joint.direction.transpose() * sensitivity.rows(0, n);
            for stage in 0..STAGES {
                let slope = self.points[stage * j + q].force_slope[0];
                if slope != 0.0 {
                    direct.row_mut(stage * j + q).copy_from(&(&u * slope));
                }
            }
            for s in 0..joint.states {
                for stage in 0..STAGES {
                    let row = STAGES * j + stage * internal + joint.first_state + s;
                    let own = sensitivity.row(2 * n + joint.first_state + s).into_owned();
                    let through: f64 =
                        (0..STAGES).map(|k| h * A[stage][k] * self.points[k * j + q].rate_slope[s][0]).sum();
                    right.row_mut(row).copy_from(&(own + &u * through));
                }
            }
        }
        right.rows_mut(0, STAGES * j).gemm(1.0, &eliminated.velocity_from_force, &direct, 1.0);
        if !solved(factor, &mut right) {
            return;
        }
        let mut force = direct;
        for stage in 0..STAGES {
            for (q, joint) in structure.joints.iter().enumerate() {
                let row = stage * j + q;
                let point = &self.points[row];
                for c in 0..columns {
                    let mut value = point.force_slope[1] * right[(row, c)];
                    for k in 0..STAGES {
                        value += point.force_slope[0] * h * A[stage][k] * right[(k * j + q, c)];
                    }
                    for s in 0..joint.states {
                        value += point.force_slope[2 + s]
                            * right[(STAGES * j + stage * internal + joint.first_state + s, c)];
                    }
                    force[(row, c)] += value;
                }
            }
        }
        let last = |m: &DMatrix<f64>| {
            let mut out = DMatrix::zeros(2 * n, m.ncols());
            out.rows_mut(0, n).copy_from(&m.rows((STAGES - 1) * n, n));
            out.rows_mut(n, n).copy_from(&m.rows((2 * STAGES - 1) * n, n));
            out
        };
        let mut end = last(&eliminated.stage_from_state) * linear;
        end += last(&eliminated.stage_from_force) * force;
        sensitivity.rows_mut(0, 2 * n).copy_from(&end);
        for s in 0..internal {
            let row = STAGES * j + (STAGES - 1) * internal + s;
            sensitivity.row_mut(2 * n + s).copy_from(&right.row(row));
        }
    }
}

fn factorised(jacobian: &DMatrix<f64>) -> Option<LU<f64, Dyn, Dyn>> {
    let factor = jacobian.clone().lu();
    factor.is_invertible().then_some(factor)
}

/// Solves for `right`. A structure without joints has no unknowns, and `nalgebra` counts from one less.
fn solved<C: Dim, S: StorageMut<f64, Dyn, C>>(factor: &LU<f64, Dyn, Dyn>, right: &mut Matrix<f64, Dyn, C, S>) -> bool {
    right.nrows() == 0 || factor.solve_mut(right)
}
