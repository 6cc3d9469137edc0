//! The derivatives of a run by its start, carried over one step after the other.
//!
//! A step is linear in them: what the start of the step does by itself, and what the velocities of the axes at its end do through the laws. Every
//! derivative of a coordinate is one stretch of memory with an entry for each column, so that all columns are carried at once.

use super::law::Follower;
use super::step::Eliminated;
use crate::method::assembly::{Assembly, PlacedLaw};
use nalgebra::DMatrix;
use stickslip_numerics::lu::Lu;

/// Derivatives by the state at the start of a run, one column of each matrix for a coordinate.
pub(super) struct Carried {
    /// Of the state, columns × states.
    state: DMatrix<f64>,
    /// Of the forces along the axes, N, columns × axes.
    force: DMatrix<f64>,
    /// Of the velocities at the end of the step, columns × n.
    velocity: DMatrix<f64>,
    /// Of displacements and then of velocities along the axes at the start of the step, of what they do to the forces, and of the velocities along the
    /// axes at the end: one row after the other.
    along: Vec<f64>,
    direct: Vec<f64>,
    unknown: Vec<f64>,
    /// Of the laws' states at the end.
    internal: Vec<f64>,
}

/// `out += factor · column`.
fn add(out: &mut [f64], factor: f64, column: &[f64]) {
    if factor != 0.0 {
        out.iter_mut().zip(column).for_each(|(out, value)| *out += factor * value);
    }
}

impl Carried {
    /// At the start of a run, where the laws have answered to a step that goes nowhere.
    pub fn new(assembly: &Assembly, laws: &[Follower], sensitivity: &DMatrix<f64>) -> Self {
        let (n, axes, columns) = (assembly.n, assembly.axes.len(), sensitivity.ncols());
        let mut carried = Carried {
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
                // a step of no length begins where it ends
                known(out, law.force_slope(d), (joint, axes), (&carried.along, &carried.state, 2 * n), 0.0);
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

    /// Over the step that the laws were followed over last, whose equations are factored.
    pub fn advance(&mut self, assembly: &Assembly, eliminated: &Eliminated, laws: &[Follower], lu: &Lu) {
        let (n, axes, h) = (assembly.n, assembly.axes.len(), eliminated.length);
        let columns = self.state.nrows();
        if columns == 0 {
            return; // a joint that is only moved, without states
        }
        self.velocity.gemm(1.0, &self.state.columns(0, 2 * n), &eliminated.from_state_transposed, 0.0);
        self.velocity.gemm(1.0, &self.force, &eliminated.from_force_transposed, 1.0);
        self.read_along(assembly);
        self.direct.fill(0.0);
        for (joint, law) in assembly.joints.iter().zip(laws) {
            for (d, axis) in joint.axes().enumerate() {
                let out = &mut self.direct[axis * columns..(axis + 1) * columns];
                known(out, law.force_slope(d), (joint, axes), (&self.along, &self.state, 2 * n), h);
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
                known(out, slope, (joint, axes), (&self.along, &self.state, 2 * n), h);
                for (e, axis) in joint.axes().enumerate() {
                    add(out, joint.by_end(slope, e, h), row(&self.unknown, axis, columns));
                }
            }
            for (d, axis) in joint.axes().enumerate() {
                let out = &mut self.force.as_mut_slice()[axis * columns..(axis + 1) * columns];
                for (e, other) in joint.axes().enumerate() {
                    add(out, joint.by_end(law.force_slope(d), e, h), row(&self.unknown, other, columns));
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

    /// Displacements and velocities along the axes.
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

/// One of rows that stand one after the other.
fn row(rows: &[f64], index: usize, columns: usize) -> &[f64] {
    &rows[index * columns..(index + 1) * columns]
}

/// Adds what all but the velocities at the end of a step of length `h` does to an answer of a law with these slopes: motion along the axes, of which there
/// are so many, and states, the first of them a column of the state's derivatives.
fn known(
    out: &mut [f64],
    slope: &[f64],
    (joint, axes): (&PlacedLaw, usize),
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
