//! Search with a vibration that grows slowly from static equilibrium.
//!
//! A joint that sticks keeps the residual force that its history left. The equations follow the
//! history of each joint alone: from static equilibrium to the periodic motion, with its final mean
//! from the beginning. If several joints slip before they stick, such a motion may not balance,
//! because the mean of the real motion adapts while they slip. Here the excitation grows in steps,
//! and the history of each step begins in the state that the previous one left.

use crate::method::harmonic_balance::aft::{Port, StaticState};
use crate::method::harmonic_balance::equations::HarmonicSolution;
use crate::method::harmonic_balance::equations::homotopy::SearchContext;
use crate::method::harmonic_balance::found_by::FoundBy;
use crate::method::harmonic_balance::globalization::SearchSettings;
use crate::method::harmonic_balance::solver::HarmonicBalanceSolver;
use crate::method::{ErrorEstimate, Request};
use crate::orbit::Orbit;
use num_complex::Complex64;

/// Settings of the growth.
#[derive(Debug, Clone, Copy)]
struct GrowthSettings {
    /// Growth of the first step, as a fraction of the excitation. A step that fails is halved.
    first_step: f64,
    /// Smallest step.
    least_step: f64,
    /// Largest number of Newton iterations of a search, and of those that do not halve the
    /// residual: without a solution, it stagnates soon.
    iterations: usize,
    patience: usize,
    /// Largest number of searches of a step. Each begins at the best approximation of the previous
    /// one, also in its history. If several joints have slipped until they stick, a small change of
    /// the mean can then balance their forces: some of them stick.
    searches: usize,
}

impl Default for GrowthSettings {
    fn default() -> Self {
        GrowthSettings { first_step: 0.25, least_step: 1.0 / 64.0, iterations: 10, patience: 2, searches: 4 }
    }
}

impl HarmonicBalanceSolver {
    /// Searches with the history of a vibration that grows, with a budget as large as that of a
    /// point. An orbit between others has the history of the last orbit that was found in this
    /// way, if it exists. Returns `None` if no law has a history or no orbit is found.
    pub(in crate::method::harmonic_balance) fn solve_with_growing_vibration(
        &mut self,
        request: &Request<'_>,
        omega: f64,
    ) -> Option<Orbit> {
        if self.periods > 1 || !self.ports.iter().any(Port::has_memory_steps) {
            return None;
        }
        let equilibrium = self.ports.static_states();
        let near = self.grown_history.take().and_then(|history| {
            self.set_history(&history);
            let (top, motion) = self.series_of(request.seed?)?;
            self.search_near(top, omega, motion, request.estimate)
        });
        let orbit = near.or_else(|| {
            self.set_history(&equilibrium);
            self.begin_second_search();
            let top = self.method.harmonics.unwrap_or(self.first);
            let motion = self.grow_vibration(top, omega)?;
            self.search_near(top, omega, motion, request.estimate)
        });
        self.grown_history = orbit.is_some().then(|| self.ports.static_states());
        self.set_history(&equilibrium);
        orbit
    }

    fn search_near(
        &mut self,
        top: usize,
        omega: f64,
        motion: HarmonicSolution,
        estimate: ErrorEstimate,
    ) -> Option<Orbit> {
        let motion = HarmonicSolution { found_by: FoundBy::GrowingVibration, ..motion };
        match estimate {
            ErrorEstimate::Skipped => self.solve_nearby(top, omega, &motion).ok(),
            ErrorEstimate::Required => self.converge(top, omega, Some((top, motion))).ok(),
        }
    }

    /// Lets the vibration grow. Leaves the history of the last step.
    fn grow_vibration(&mut self, top: usize, omega: f64) -> Option<HarmonicSolution> {
        let settings = GrowthSettings::default();
        let GrowthSettings { iterations, patience, .. } = settings;
        let search = SearchSettings { iterations, patience, ..SearchSettings::default() };
        self.discretization(top, omega).ok()?;
        let discretization = self.discretizations.get(&top)?;
        let harmonics = discretization.harmonics().to_vec();
        let vibration = |values: &mut [Complex64], factor: f64| {
            let moving = values.iter_mut().zip(harmonics.iter().cycle()).filter(|(_, h)| **h > 0);
            moving.for_each(|(value, _)| *value *= factor);
        };
        let full = discretization.linear.motion.clone();
        let mut motion = discretization.static_solution(1.0);
        let (mut share, mut step) = (0.0, settings.first_step);
        while share < 1.0 {
            if step < settings.least_step {
                return None;
            }
            let next = f64::min(share + step, 1.0);
            let mut start = motion.clone();
            let growth = if share > 0.0 { next / share } else { 0.0 };
            vibration(&mut start.c, growth);
            vibration(&mut start.force, growth);
            let before = self.ports.static_states();
            let mut excitation = full.clone();
            vibration(excitation.as_mut_slice(), next);
            self.discretizations.get_mut(&top)?.linear.motion = excitation;
            let found = (0..settings.searches).any(|_| {
                let Some(discretization) = self.discretizations.get_mut(&top) else { return false };
                discretization.begin_search(&self.ports);
                let found = discretization.newton(SearchContext::given(&self.ports, omega), &mut start, search).is_ok();
                self.continue_history(top, omega, &start);
                found
            });
            self.discretizations.get_mut(&top)?.linear.motion.clone_from(&full);
            if found {
                (motion, share) = (start, next);
            } else {
                self.set_history(&before);
                step *= 0.5;
            }
        }
        Some(motion)
    }

    /// Lets the history begin in the states of a motion at the beginning of its period.
    fn continue_history(&mut self, top: usize, omega: f64, motion: &HarmonicSolution) {
        let Some(discretization) = self.discretizations.get_mut(&top) else { return };
        let mut history = self.ports.static_states();
        for (p, _) in self.ports.iter().enumerate().filter(|(_, port)| port.has_memory_steps()) {
            let state = discretization.initial_state_of(&self.ports, p, omega, motion);
            if state.states.len() == history[p].states.len() {
                history[p] = state;
            }
        }
        self.set_history(&history);
    }

    fn set_history(&mut self, history: &[StaticState]) {
        self.ports.set_history(history);
        self.ring_ports.iter_mut().for_each(|ring| ring.set_history(history));
    }
}
