//! Sensitivities of a run with respect to its initial state, carried over step by step.
//!
//! A step is linear in them: the direct effect of the start of the step, and the effect of the
//! axis velocities at its end through the laws. Each derivative of a coordinate is contiguous
//! in memory, with one entry per column, so that all columns are carried at once.

use super::acceleration_step::AccelerationElimination;
use super::law_step::LawIntegrator;
use crate::method::flow::assembly::{Assembly, IndexedLaw};
use nalgebra::DMatrix;
use stickslip_numerics::small_lu::SmallLu;

/// Derivatives with respect to the initial state of a run. Each matrix has one column per
/// coordinate.
pub(super) struct Sensitivity {
    /// Derivatives of the state, columns × states.
    state: DMatrix<f64>,
    /// Derivatives of the forces along the axes, N, columns × axes.
    force: DMatrix<f64>,
    /// Derivatives of the velocities at the end of the step, columns × n.
    velocity: DMatrix<f64>,
    /// Derivatives of displacements and then velocities along the axes at the start of the
    /// step. `direct` contains their effect on the forces, `unknown` the derivatives of the
    /// velocities along the axes at the end. Stored row by row.
    along: Vec<f64>,
    direct: Vec<f64>,
    unknown: Vec<f64>,
    /// Derivatives of the laws' states at the end.
    internal: Vec<f64>,
}

/// Computes `out += factor · column`.
fn add(out: &mut [f64], factor: f64, column: &[f64]) {
    if factor != 0.0 {
        out.iter_mut().zip(column).for_each(|(out, value)| *out += factor * value);
    }
}

impl Sensitivity {
    /// Starts a run after the laws were evaluated for a step of zero length.
    pub fn new(assembly: &Assembly, laws: &[LawIntegrator], sensitivity: &DMatrix<f64>) -> Self {
        let (n, axes, columns) = (assembly.n, assembly.axes.len(), sensitivity.ncols());
        let mut carried = Sensitivity {
            state: sensitivity.transpose(),
            force: DMatrix::zeros(columns, axes),
            velocity: DMatrix::zeros(columns, n),
            along: vec![0.0; 2 * axes * columns],
            direct: vec![0.0; axes * columns],
            unknown: vec![0.0; axes * columns],
            internal: vec![0.0; assembly.internal * columns],
        };
        carried.read_along(assembly);
        for (joint, law) in assembly.joints.iter().zip(laws) {
            for (d, axis) in joint.axes().enumerate() {
                let out = &mut carried.force.as_mut_slice()[axis * columns..(axis + 1) * columns];
                // start and end of a step of zero length coincide
                add_known_terms(out, law.force_slope(d), (joint, axes), (&carried.along, &carried.state, 2 * n), 0.0);
                let (after, width) = (2 * joint.directions + joint.states, joint.directions);
                for (e, other) in joint.axes().enumerate() {
                    add(out, law.force_slope(d)[after + width + e], row(&carried.along, axes + other, columns));
                }
            }
        }
        carried
    }

    /// Writes the derivatives of the state, states × columns.
    pub fn write(&self, sensitivity: &mut DMatrix<f64>) {
        self.state.transpose_to(sensitivity);
    }

    /// Carries the derivatives over the last step of the laws, whose equations are factored.
    pub fn advance(
        &mut self,
        assembly: &Assembly,
        eliminated: &AccelerationElimination,
        laws: &[LawIntegrator],
        lu: &SmallLu,
    ) {
        let (n, axes, h) = (assembly.n, assembly.axes.len(), eliminated.length);
        let columns = self.state.nrows();
        if columns == 0 {
            return; // a joint with imposed motion only, without states
        }
        self.velocity.gemm(1.0, &self.state.columns(0, 2 * n), &eliminated.from_state_transposed, 0.0);
        self.velocity.gemm(1.0, &self.force, &eliminated.from_force_transposed, 1.0);
        self.read_along(assembly);
        self.direct.fill(0.0);
        for (joint, law) in assembly.joints.iter().zip(laws) {
            for (d, axis) in joint.axes().enumerate() {
                let out = &mut self.direct[axis * columns..(axis + 1) * columns];
                add_known_terms(out, law.force_slope(d), (joint, axes), (&self.along, &self.state, 2 * n), h);
            }
        }
        for (axis, out) in self.unknown.chunks_exact_mut(columns).enumerate() {
            out.fill(0.0);
            for &(i, weight) in assembly.axes[axis].rows() {
                add(out, weight, row(self.velocity.as_slice(), i, columns));
            }
            for (other, direct) in self.direct.chunks_exact(columns).enumerate() {
                add(out, eliminated.along_from_force[(axis, other)], direct);
            }
        }
        lu.solve_rows(&mut self.unknown, columns);
        self.internal.fill(0.0);
        self.force.as_mut_slice().copy_from_slice(&self.direct);
        for (joint, law) in assembly.joints.iter().zip(laws) {
            for (s, own) in joint.internal().enumerate() {
                let (slope, out) = (law.state_slope(s), &mut self.internal[own * columns..(own + 1) * columns]);
                add_known_terms(out, slope, (joint, axes), (&self.along, &self.state, 2 * n), h);
                for (e, axis) in joint.axes().enumerate() {
                    add(out, joint.derivative_by_end_velocity(slope, e, h), row(&self.unknown, axis, columns));
                }
            }
            for (d, axis) in joint.axes().enumerate() {
                let out = &mut self.force.as_mut_slice()[axis * columns..(axis + 1) * columns];
                for (e, other) in joint.axes().enumerate() {
                    add(
                        out,
                        joint.derivative_by_end_velocity(law.force_slope(d), e, h),
                        row(&self.unknown, other, columns),
                    );
                }
            }
        }
        self.velocity.gemm(1.0, &self.force, &eliminated.from_force_transposed, 1.0);
        let (moving, internal) = self.state.as_mut_slice().split_at_mut(2 * n * columns);
        let (x, v) = moving.split_at_mut(n * columns);
        for ((x, v), new) in x.iter_mut().zip(v).zip(self.velocity.as_slice()) {
            *x += 0.5 * h * (*v + new);
            *v = *new;
        }
        internal.copy_from_slice(&self.internal);
    }

    /// Computes displacements and velocities along the axes.
    fn read_along(&mut self, assembly: &Assembly) {
        let (n, axes, columns) = (assembly.n, assembly.axes.len(), self.state.nrows());
        self.along.fill(0.0);
        let (displacement, velocity) = self.along.split_at_mut(axes * columns);
        let state = self.state.as_slice();
        for (axis, along) in assembly.axes.iter().enumerate() {
            let own = axis * columns..(axis + 1) * columns;
            for &(i, weight) in along.rows() {
                add(&mut displacement[own.clone()], weight, row(state, i, columns));
                add(&mut velocity[own.clone()], weight, row(state, n + i, columns));
            }
        }
    }
}

/// Returns one of several consecutive rows.
fn row(rows: &[f64], index: usize, columns: usize) -> &[f64] {
    &rows[index * columns..(index + 1) * columns]
}

/// Adds the effect of all quantities except the end velocities of a step of size `h` on a
/// result of a law with these slopes.
///
/// These are the motion along the `axes` and the states of the law. `first` is the column of
/// the first law state in the derivatives of the state.
fn add_known_terms(
    out: &mut [f64],
    slope: &[f64],
    (joint, axes): (&IndexedLaw, usize),
    (along, state, first): (&[f64], &DMatrix<f64>, usize),
    h: f64,
) {
    let (columns, directions, after) = (out.len(), joint.directions, 2 * joint.directions + joint.states);
    for (e, axis) in joint.axes().enumerate() {
        add(out, slope[e] + slope[after + e], row(along, axis, columns));
        add(out, slope[directions + e] + 0.5 * h * slope[after + e], row(along, axes + axis, columns));
    }
    for (s, own) in joint.internal().enumerate() {
        add(out, slope[2 * directions + s], row(state.as_slice(), first + own, columns));
    }
}
