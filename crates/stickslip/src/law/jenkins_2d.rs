//! Elastic dry friction in a plane: a spring in series with a slider, isotropic, with the
//! friction disk as limit.
//!
//! `f = k (u - s)`; the slider sticks while `|f| < limit` and slips in the direction of f with
//! `|f| = limit`.
//! Source: Menq and Yang, "Non-linear spring resistance and friction damping of frictional
//! constraint having two-dimensional motion" (1998); step by Krieg and Key (1977), exact for
//! straight steps.

use super::kernels::planar_slip;
use super::{
    DisplacementBox, Jenkins, Jenkins2dArctan, Law, LawInfo, MAX_DIRECTIONS, Parameter, SharedLaw, StepDerivatives,
    StepLaw, StepView,
};
use crate::dimension::Dimension;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "jenkins-2d",
    summary: "spring and slider in series in a plane, f = kt (u - s), |f| <= limit",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "tangential contact stiffness"),
        Parameter::limit("slip limit: magnitude of the force during slip"),
    ],
    sample: &[10_000.0, 2.0],
    build: |values| Arc::new(Jenkins2d { stiffness: values[0], limit: values[1] }),
};

/// Spring and slider in two directions. The internal states are the force components, N.
///
/// # Example
/// ```
/// use stickslip::law::{Jenkins2d, StepLaw};
/// let law = Jenkins2d { stiffness: 1.0, limit: 2.0 };
/// let mut z = [0.0_f64; 2];
/// assert_eq!(law.advance(&[0.0; 3], &[0.6, 0.8, 0.0], &mut z)[..2], [0.6, 0.8]);
/// let slipping = law.advance(&[0.6, 0.8, 0.0], &[6.0, 8.0, 0.0], &mut z);
/// assert!((slipping[0] - 1.2).abs() < 1e-15 && (slipping[1] - 1.6).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jenkins2d {
    /// Stiffness of the spring `kt`, N/m.
    pub stiffness: f64,
    /// Slip limit, N.
    pub limit: f64,
}

impl Law for Jenkins2d {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.limit]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn directions(&self) -> usize {
        2
    }
    fn force_scale(&self) -> f64 {
        self.limit
    }
    fn with_limit_factor(&self, factor: f64) -> Option<SharedLaw> {
        Some(Arc::new(Jenkins2d { limit: factor * self.limit, ..*self }))
    }
    fn step(&self) -> Option<&dyn StepView> {
        Some(self)
    }
    fn smooth_counterpart(&self, width: f64) -> Option<SharedLaw> {
        Some(Arc::new(Jenkins2dArctan { stiffness: self.stiffness, limit: self.limit, alpha: 1.0 / width }))
    }
    fn is_incrementally_passive(&self) -> bool {
        // the spring stores |δf|²/(2 kt), and the slider moves along the normal of a convex disk
        true
    }
    /// Motion in one direction gives the Jenkins element.
    fn describing_function(&self, amplitude: f64, omega: f64) -> Complex64 {
        Jenkins { stiffness: self.stiffness, limit: self.limit }.describing_function(amplitude, omega)
    }
}

impl StepLaw for Jenkins2d {
    fn states(&self) -> usize {
        2
    }
    fn state_scale(&self) -> f64 {
        if self.limit > 0.0 { self.limit } else { 1.0 }
    }
    #[inline]
    fn advance<S: Real>(
        &self,
        from: &[S; MAX_DIRECTIONS],
        to: &[S; MAX_DIRECTIONS],
        z: &mut [S],
    ) -> [S; MAX_DIRECTIONS] {
        let increment = [to[0] - from[0], to[1] - from[1]];
        let force = planar_slip::step([z[0], z[1]], increment, self.stiffness, [S::from(self.limit); 2]);
        z.copy_from_slice(&force);
        [force[0], force[1], S::from(0.0)]
    }
    fn analytic_derivatives(
        &self,
        from: &[f64; MAX_DIRECTIONS],
        to: &[f64; MAX_DIRECTIONS],
        z: &mut [f64],
        StepDerivatives { force: forces, state: states, .. }: StepDerivatives<'_>,
    ) -> Option<[f64; MAX_DIRECTIONS]> {
        let increment = [to[0] - from[0], to[1] - from[1]];
        let (force, slopes) = planar_slip::step_with_slopes([z[0], z[1]], increment, self.stiffness, [self.limit; 2]);
        z.copy_from_slice(&force);
        for (a, row) in states.chunks_exact_mut(6).enumerate() {
            let (increment, before) = (slopes.by_increment[a], slopes.by_force[a]);
            row.copy_from_slice(&[-increment[0], -increment[1], increment[0], increment[1], before[0], before[1]]);
        }
        forces.copy_from_slice(states);
        Some([force[0], force[1], 0.0])
    }
    fn sticks_throughout(
        &self,
        (from, z): (&[f64; MAX_DIRECTIONS], &[f64]),
        DisplacementBox { mean, half_width }: DisplacementBox<'_>,
    ) -> bool {
        let at_mean = |a: usize| z[a] + self.stiffness * (mean[a] - from[a]);
        at_mean(0).hypot(at_mean(1)) + self.stiffness * half_width[0].hypot(half_width[1]) < self.limit
    }
}
