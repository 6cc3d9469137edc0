//! Sensitivity of amplitudes to the history of joints that never slip.
//!
//! By convention their residual traction is that of the static equilibrium. To measure the
//! effect of other histories, the equations are solved again with the friction forces of static
//! equilibrium removed, and with them reversed.

use crate::method::harmonic_balance::equations::HarmonicSolution;
use crate::method::harmonic_balance::solver::HarmonicBalanceSolver;
use crate::orbit::Orbit;
use nalgebra::DVector;
use num_complex::Complex64;

impl HarmonicBalanceSolver {
    /// Returns the largest change of a place's vibration under another history, relative to the
    /// largest vibration.
    ///
    /// Returns `None` if the orbit has no history, if all joints stick, or if no other orbit
    /// was found. With all joints stuck the equations are linear, and nothing changes.
    pub(crate) fn history_spread(&mut self, orbit: &Orbit, omega: f64) -> Option<f64> {
        let sticks = orbit.joints.iter().all(|joint| joint.slip_fraction == 0.0 && joint.open_fraction == 0.0);
        if orbit.evidence.history_dependent.is_empty() || sticks {
            return None;
        }
        let series = orbit.series.as_ref()?;
        let (top, motion) = (series.highest_harmonic, HarmonicSolution::from_series(series));
        let own = self.places(top, omega, &motion).ok()?;
        let states = self.ports.static_states();
        let mut spread: Option<f64> = None;
        // Factors on the friction forces of static equilibrium.
        for factor in [0.0, -1.0] {
            let mut scaled = states.clone();
            scaled.iter_mut().flat_map(|state| &mut state.states).for_each(|force| *force *= factor);
            self.ports.set_history(&scaled);
            let other = self.solve_with_history(top, omega, &motion);
            self.ports.set_history(&states);
            if let Some(other) = other {
                let apart = self.vibration_change(top, &own, &other);
                spread = Some(spread.map_or(apart, |spread| spread.max(apart)));
            }
        }
        spread
    }

    /// Returns the harmonics of all places in the orbit near a motion, with the static states
    /// that are set.
    fn solve_with_history(
        &mut self,
        top: usize,
        omega: f64,
        motion: &HarmonicSolution,
    ) -> Option<Vec<DVector<Complex64>>> {
        let mut other = HarmonicSolution { iterations: 0, ..motion.clone() };
        let discretization = self.discretizations.get_mut(&top)?;
        // Newton iterations from the orbit.
        discretization.newton_from(&self.ports, omega, &mut other, 20).ok()?;
        self.places(top, omega, &other).ok()
    }

    /// Returns the largest change of a place's vibration, relative to the largest vibration.
    fn vibration_change(&self, top: usize, one: &[DVector<Complex64>], other: &[DVector<Complex64>]) -> f64 {
        let harmonics = self.harmonic_set.up_to(top);
        let moving: Vec<usize> = (0..one.len()).filter(|k| harmonics[*k] > 0).collect();
        let vibration = |of: &dyn Fn(usize) -> Complex64| moving.iter().map(|k| of(*k).norm_sqr()).sum::<f64>().sqrt();
        let (mut apart, mut size) = (0.0f64, 0.0f64);
        for axis in self.system.place_axes() {
            let (a, b) = (|k: usize| axis.complex_component(&one[k]), |k: usize| axis.complex_component(&other[k]));
            size = size.max(vibration(&a));
            apart = apart.max((vibration(&a) - vibration(&b)).abs());
        }
        if size > 0.0 { apart / size } else { 0.0 }
    }
}
