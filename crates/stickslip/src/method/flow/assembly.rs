//! The system in the form that the time integrations use: full matrices, joint axes, and laws
//! with the indices of their axes and states.

use super::excitation::HarmonicExcitation;
use crate::law::{RelativeMotion, SharedLaw};
use crate::method::{IntegrationError, MethodError};
use crate::model::{Axis, System};
use crate::structure::Matrices;
use nalgebra::DMatrix;
use std::ops::Deref;
use std::sync::Arc;

/// Matrices, axes and laws, independent of the excitation.
#[derive(Debug, Clone)]
pub(crate) struct Assembly {
    /// Number of degrees of freedom n.
    pub n: usize,
    /// Mass, damping and stiffness, shared with the structure.
    matrices: Arc<Matrices>,
    pub inverse_mass: DMatrix<f64>,
    /// Axes of all joints, in the order of the joints.
    pub axes: Vec<Axis>,
    /// The axes as columns, n × axes.
    pub directions: DMatrix<f64>,
    pub joints: Vec<IndexedLaw>,
    /// Number of internal states of all laws.
    pub internal: usize,
    /// Names of the places, and their axes in the coordinates.
    places: Vec<(String, Axis)>,
}

/// A law with the indices of its axes and states.
#[derive(Debug, Clone)]
pub(crate) struct IndexedLaw {
    /// Name of the joint.
    pub joint: String,
    pub law: SharedLaw,
    pub first_axis: usize,
    pub directions: usize,
    /// Index of its first internal state.
    pub first_state: usize,
    pub states: usize,
    /// Typical size of its internal states.
    pub state_scale: f64,
}

impl IndexedLaw {
    /// Returns the indices of its axes.
    pub fn axes(&self) -> std::ops::Range<usize> {
        self.first_axis..self.first_axis + self.directions
    }
    /// Returns the indices of its internal states.
    pub fn internal(&self) -> std::ops::Range<usize> {
        self.first_state..self.first_state + self.states
    }
    /// Returns the derivative of an output by the final velocity along direction `e`, for a
    /// step of average acceleration of length `h`.
    ///
    /// `slopes` holds the derivatives by `(u₀, u₀', z₀, u₁, u₁')`.
    pub fn derivative_by_end_velocity(&self, slopes: &[f64], e: usize, h: f64) -> f64 {
        let after = 2 * self.directions + self.states;
        0.5 * h * slopes[after + e] + slopes[after + self.directions + e]
    }
    /// Returns the error that the law answers with NaN or infinity.
    pub fn not_finite_error(&self, time: f64) -> IntegrationError {
        IntegrationError::NotFinite { time, joint: self.joint.clone(), law: self.law.name() }
    }
}

/// Gives access to mass, damping and stiffness as fields.
impl Deref for Assembly {
    type Target = Matrices;
    fn deref(&self) -> &Matrices {
        &self.matrices
    }
}

impl Assembly {
    /// Assembles the system. For each joint, `states` returns the law to integrate, the number
    /// of its states and their size, or the missing property of the law.
    ///
    /// # Errors
    /// Fails if `states` refuses a joint, a place has no mass, or the mass matrix is singular.
    pub fn new(
        system: &System,
        method: &'static str,
        mut states: impl FnMut(&SharedLaw) -> Result<(SharedLaw, usize, f64), &'static str>,
    ) -> Result<Self, MethodError> {
        let (structure, n) = (system.structure(), system.dofs());
        if let Some(error) = MethodError::too_large(method, system) {
            return Err(error);
        }
        if let Some(i) = (0..n).find(|&i| structure.diagonal_mass(i) <= 0.0) {
            return Err(MethodError::needs_mass(method, system, i));
        }
        let inverse_mass = structure.mass().clone().try_inverse().filter(|_| structure.has_definite_mass());
        let inverse_mass = inverse_mass.ok_or_else(|| MethodError::mass_not_positive(method))?;
        let (mut joints, mut first_axis, mut internal) = (Vec::new(), 0, 0);
        for joint in system.joints() {
            let (law, count, state_scale) =
                states(joint.law()).map_err(|misses| MethodError::law(method, joint, misses))?;
            let directions = joint.axes().len();
            joints.push(IndexedLaw {
                joint: joint.name().to_owned(),
                law,
                first_axis,
                directions,
                first_state: internal,
                states: count,
                state_scale,
            });
            first_axis += directions;
            internal += count;
        }
        let axes: Vec<_> = system.axes().map(|(_, axis)| axis.dense(n)).collect();
        Ok(Assembly {
            n,
            matrices: structure.full().clone(),
            inverse_mass,
            axes: system.axes().map(|(_, axis)| axis.clone()).collect(),
            directions: DMatrix::from_fn(n, first_axis, |row, axis| axes[axis][row]),
            joints,
            internal,
            places: system.places().iter().cloned().zip(system.place_axes().iter().cloned()).collect(),
        })
    }

    /// Returns the length of the state `(x, v, internal states)`.
    pub fn states(&self) -> usize {
        2 * self.n + self.internal
    }

    /// Returns the place with the largest displacement.
    pub fn farthest(&self, state: &[f64]) -> Option<String> {
        let far = |axis: &Axis| axis.component(&state[..self.n]).abs();
        let farthest = self.places.iter().max_by(|(_, a), (_, b)| far(a).total_cmp(&far(b)));
        farthest.map(|(place, _)| place.clone())
    }

    /// Returns the relative displacement and velocity along an axis.
    pub fn relative(&self, axis: usize, state: &[f64], excitation: &HarmonicExcitation, time: f64) -> (f64, f64) {
        let (g, speed) = excitation.relative_at(axis, time);
        let (x, v) = state.split_at(self.n);
        (self.axes[axis].component(x) + g, self.axes[axis].component(v) + speed)
    }

    /// Returns the relative motion of a joint.
    pub fn motion_of(
        &self,
        joint: &IndexedLaw,
        state: &[f64],
        excitation: &HarmonicExcitation,
        time: f64,
    ) -> RelativeMotion<f64> {
        let mut motion = RelativeMotion::along(0.0, 0.0);
        for (d, axis) in joint.axes().enumerate() {
            (motion.displacement[d], motion.velocity[d]) = self.relative(axis, state, excitation, time);
        }
        motion
    }

    /// Returns the largest error relative to the scales of displacement and velocity and to the
    /// internal states; infinite if an error is not finite.
    pub fn error_size(&self, error: &[f64], state: &[f64], scale: (f64, f64)) -> f64 {
        if error.iter().any(|e| !e.is_finite()) {
            return f64::INFINITY;
        }
        let n = self.n;
        let moving = (0..n).map(|i| (error[i].abs() / scale.0).max(error[n + i].abs() / scale.1));
        let internal = self.joints.iter().flat_map(|joint| {
            let size = move |s: usize| joint.state_scale + state[2 * n + s].abs();
            joint.internal().map(move |s| error[2 * n + s].abs() / size(s))
        });
        moving.chain(internal).fold(0.0, f64::max)
    }

    /// Computes the acceleration (length n) of a state under loads and joint forces. `net_force`
    /// enters as the loads and leaves as the resulting forces on the masses.
    pub fn accelerate(&self, state: &[f64], net_force: &mut [f64], force: &[f64], out: &mut [f64]) {
        let n = self.n;
        let (x, v) = state.split_at(n);
        let Matrices { stiffness, damping, .. } = &*self.matrices;
        for i in 0..n {
            for k in 0..n {
                net_force[i] -= stiffness[(i, k)] * x[k] + damping[(i, k)] * v[k];
            }
        }
        for (axis, force) in self.axes.iter().zip(force) {
            for &(i, w) in axis.rows() {
                net_force[i] -= w * force;
            }
        }
        for i in 0..n {
            out[i] = (0..n).map(|k| self.inverse_mass[(i, k)] * net_force[k]).sum();
        }
    }

    /// Returns the largest acceleration of the masses due to forces along the axes, m/s².
    pub fn largest_acceleration(&self, force: &[f64]) -> f64 {
        let on_masses = &self.directions * nalgebra::DVectorView::from_slice(force, force.len());
        if self.n == 0 { 0.0 } else { (&self.inverse_mass * on_masses).amax() }
    }

    /// Returns the excitation at `omega` (rad/s) along the axes; at zero, only the constant
    /// forces.
    pub fn excitation(&self, system: &System, omega: f64) -> HarmonicExcitation {
        let axes: Vec<usize> = (0..self.axes.len()).collect();
        HarmonicExcitation::at(system, &axes, omega)
    }

    /// Returns the square root of an energy that the loads can supply, √J.
    pub fn energy_scale(&self, excitation: &HarmonicExcitation) -> f64 {
        excitation.energy_scale(&self.mass, &self.stiffness)
    }

    /// Returns the weights of the energy norm.
    ///
    /// A displacement is weighted by the larger of its stiffness and its inertia, an internal
    /// state by the scale of the motion.
    pub fn weights(&self, excitation: &HarmonicExcitation) -> Vec<f64> {
        let (n, omega, rest) = (self.n, excitation.omega, NEAR_REST * self.energy_scale(excitation));
        let mut weights = vec![1.0; self.states()];
        for i in 0..n {
            let inertia = omega * omega * self.mass[(i, i)];
            weights[i] = self.stiffness[(i, i)].max(inertia).sqrt();
            weights[n + i] = self.mass[(i, i)].sqrt();
        }
        for joint in &self.joints {
            let weight = if rest > 0.0 { rest } else { 1.0 } / joint.state_scale;
            joint.internal().for_each(|s| weights[2 * n + s] = weight);
        }
        weights
    }

    /// Returns the scales of displacement and velocity for error norms. They cover the state,
    /// the imposed motion and the response to the loads.
    pub fn scales(&self, state: &[f64], excitation: &HarmonicExcitation) -> (f64, f64) {
        let n = self.n;
        let natural = (0..n).map(|i| (self.stiffness[(i, i)] / self.mass[(i, i)]).sqrt());
        // without excitation, the structure's natural frequencies set the time scale
        let rate = if excitation.omega > 0.0 { excitation.omega } else { natural.fold(f64::MIN_POSITIVE, f64::max) };
        let x = state[..n].iter().fold(0.0f64, |a, x| a.max(x.abs()));
        let v = state[n..2 * n].iter().fold(0.0f64, |a, v| a.max(v.abs()));
        let mobility = if n == 0 { 0.0 } else { self.inverse_mass.amax().sqrt() };
        let loads = self.energy_scale(excitation) * mobility;
        let velocity = v.max(x * rate).max(excitation.imposed_velocity()).max(NEAR_REST * loads).max(f64::MIN_POSITIVE);
        (velocity / rate, velocity)
    }
}

/// A state smaller than this fraction of the response to the loads counts as at rest.
pub(crate) const NEAR_REST: f64 = 1e-3;

/// Returns true if a law carries no force: it is free, or it consists only of sliders with zero
/// limit.
pub(crate) fn carries_nothing(law: &SharedLaw) -> bool {
    law.carries_no_force() || law.sliders().is_some_and(|sliders| sliders.is_empty())
}
