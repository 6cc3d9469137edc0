//! Newton's method for the equations of a search, by [`DampedNewton`].
//!
//! Systems with many contacts iterate on coarse samples first. The searches that follow if it
//! fails stand in `globalization`.

use super::aft::Ports;
use super::dynamics::banded::StepParameters;
use super::equations::homotopy::{RESIDUAL_TOLERANCE, SearchContext};
use super::equations::{DerivativeScope, Discretization, HarmonicSolution};
use super::globalization::SearchSettings;
use super::linear_solve::newton_krylov::{FORMED_UNKNOWNS, StepStart};
use super::settings::NewtonSettings;
use num_complex::Complex64;
use stickslip_numerics::dense;
use stickslip_numerics::newton::{AcceptedStep, DampedNewton, NewtonEnd, NewtonEquations};

/// Residual at which a search ends.
#[derive(Debug, Clone, Copy)]
pub(super) enum StopCriterion {
    /// The tolerance [`RESIDUAL_TOLERANCE`], or rounding.
    Solved,
    /// This residual, on coarse samples.
    Rough(f64),
    /// This share of the initial residual.
    Share(f64),
}

/// Failure of a search.
#[derive(Debug, Clone, Copy)]
pub(super) struct SolveError {
    pub iterations: usize,
    pub residual: f64,
    /// A resonance without damping, rad/s.
    pub resonance: Option<f64>,
    /// True if the mean displacement left the contacts that alone support a body.
    pub left_contacts: bool,
}

impl SolveError {
    /// Failure of the iteration after `iterations` with this residual.
    pub fn not_converged(iterations: usize, residual: f64) -> Self {
        SolveError { iterations, residual, resonance: None, left_contacts: false }
    }

    /// Failure at a resonance without damping, rad/s.
    pub fn resonance(resonance: f64) -> Self {
        SolveError { resonance: Some(resonance), ..SolveError::not_converged(0, f64::INFINITY) }
    }

    /// Returns the failure of two searches for the same solution, the other one later.
    pub fn and(self, other: SolveError) -> Self {
        SolveError {
            iterations: other.iterations,
            residual: self.residual.min(other.residual),
            resonance: self.resonance.or(other.resonance),
            left_contacts: self.left_contacts || other.left_contacts,
        }
    }
}

/// Newton's method on the equations of a search.
struct SearchIteration<'a> {
    equations: &'a mut Discretization,
    context: SearchContext<'a>,
    motion: &'a mut HarmonicSolution,
    /// Unit of motions, m.
    length: f64,
    /// True if the residual is that of coarse samples.
    on_coarse_samples: bool,
    /// True while the Jacobian on coarse samples reduces the residual on all samples enough.
    may_use_coarse_jacobian: bool,
    /// True if the Jacobian of the last step is that of coarse samples.
    has_coarse_jacobian: bool,
    /// True if the next step keeps the Jacobian of the last one.
    keeps_jacobian: bool,
}

impl NewtonEquations for SearchIteration<'_> {
    fn solve_step(&mut self, residual: f64) -> bool {
        if !self.keeps_jacobian {
            self.has_coarse_jacobian =
                self.equations.complete_derivatives(self.context, self.motion, self.may_use_coarse_jacobian);
        }
        let start = StepStart {
            length: self.length,
            residual,
            coarse: self.has_coarse_jacobian || self.on_coarse_samples,
            same_derivatives: self.keeps_jacobian,
        };
        self.equations.workspace.previous.copy_from(self.motion);
        let solved = self.equations.regularized_step(self.context, self.motion, start);
        self.motion.iterations += usize::from(solved);
        solved
    }

    fn move_by(&mut self, fraction: f64) -> f64 {
        self.equations.apply_step(self.context.ports, self.motion, fraction, self.length);
        self.equations.evaluate(self.context, self.motion, self.length, DerivativeScope::Cheap)
    }

    fn accept(&mut self, step: AcceptedStep) -> Option<f64> {
        let reduced = step.after < NewtonSettings::default().coarse.reduction * step.before;
        self.may_use_coarse_jacobian &= reduced;
        self.keeps_jacobian = self.has_coarse_jacobian && reduced && self.equations.search.linearized;
        if step.is_least {
            self.equations.workspace.best.copy_from(self.motion);
        }
        let now = self.equations.motion_scale(self.motion);
        if now >= 0.5 * self.length && now <= 2.0 * self.length {
            return None;
        }
        // the motion was far from its initial guess; rescale with its own size
        self.length = now;
        Some(self.equations.evaluate(self.context, self.motion, now, DerivativeScope::Cheap))
    }

    fn has_exact_jacobian(&self) -> bool {
        !self.has_coarse_jacobian
    }

    fn is_budget_used(&self) -> bool {
        self.equations.is_budget_used(self.context.ports)
    }
}

impl Discretization {
    /// Newton's method.
    ///
    /// If there are coarse samples, it first iterates on them, and then on all samples with the
    /// coarse Jacobian. If that fails, it iterates on all samples from the initial guess.
    pub(super) fn newton(
        &mut self,
        context: SearchContext<'_>,
        motion: &mut HarmonicSolution,
        settings: SearchSettings,
    ) -> Result<(), SolveError> {
        let ports = context.ports;
        if !self.search.uses_coarse || self.coarse.is_none() {
            return self.newton_on_these_samples(context, motion, settings);
        }
        let start = motion.clone();
        let taken = (self.work.evaluations, self.work.eliminations, self.work.products);
        self.exchange_samples();
        let rough = self.newton_on_these_samples(
            context,
            motion,
            SearchSettings { goal: StopCriterion::Rough(self.coarse_tolerance()), ..settings },
        );
        if rough.is_ok() {
            // the periodic state is known on these samples
            self.complete_derivatives(context, motion, false);
            self.search.keeps_tangents = true;
        }
        self.exchange_samples();
        if rough.is_ok() && self.newton_on_these_samples(context, motion, settings).is_ok() {
            return Ok(());
        }
        // this retry happens once per search and gets the full work limit again
        let before = self.work_used(ports).multiplications;
        (self.work.evaluations, self.work.eliminations, self.work.products) = taken;
        self.work.before.multiplications += before - self.work_used(ports).multiplications;
        self.search.uses_coarse = false;
        *motion = HarmonicSolution { iterations: motion.iterations, ..start };
        self.newton_on_these_samples(context, motion, settings)
    }

    /// Returns the residual at which a search on coarse samples ends, see
    /// [`CoarseSettings`](super::settings::CoarseSettings).
    fn coarse_tolerance(&self) -> f64 {
        let spacing = 1024.0 / self.all_samples() as f64;
        NewtonSettings::default().coarse.tolerance * spacing.powi(2).max(1.0)
    }

    /// Newton's method to a given residual, on the samples that are set.
    fn newton_on_these_samples(
        &mut self,
        context: SearchContext<'_>,
        motion: &mut HarmonicSolution,
        settings: SearchSettings,
    ) -> Result<(), SolveError> {
        let defaults = NewtonSettings::default();
        let on_coarse_samples = matches!(settings.goal, StopCriterion::Rough(_));
        let length = self.motion_scale(motion);
        self.search.reuses_states = self.search.uses_coarse;
        let first = self.evaluate(context, motion, length, DerivativeScope::Cheap);
        let solved_at = match settings.goal {
            StopCriterion::Solved => RESIDUAL_TOLERANCE,
            StopCriterion::Rough(solved) => solved,
            StopCriterion::Share(share) => RESIDUAL_TOLERANCE.max(share * first),
        };
        // a residual changes the mean of a direction without support much more than the vibration,
        // so the iteration for an orbit goes on to rounding
        let is_unsupported = self.linear.contacts.iter().any(|contact| contact.mean_stiffness > 0.0);
        let to_rounding = is_unsupported && matches!(settings.goal, StopCriterion::Solved);
        let newton = DampedNewton {
            tolerance: if to_rounding { 0.0 } else { solved_at },
            rounding: defaults.rounding,
            iterations: settings.iterations,
            // forces that do not settle are soon left to the proximal point method
            patience: if context.ports.has_forces() { defaults.stagnation_iterations } else { settings.patience },
            ..DampedNewton::default()
        };
        let may_use_coarse_jacobian = self.search.uses_coarse && !on_coarse_samples;
        let keeps_jacobian = self.search.keeps_tangents && may_use_coarse_jacobian;
        let mut iteration = SearchIteration {
            equations: self,
            context,
            motion,
            length,
            on_coarse_samples,
            may_use_coarse_jacobian,
            has_coarse_jacobian: keeps_jacobian,
            keeps_jacobian,
        };
        let result = newton.run(&mut iteration, first);
        let (length, mut residual) = (iteration.length, result.residual);
        let solved = matches!(result.end, NewtonEnd::Converged | NewtonEnd::Rounding);
        if !solved && result.least < f64::INFINITY {
            motion.c.clone_from(&self.workspace.best.c);
            motion.force.clone_from(&self.workspace.best.force);
            residual = self.evaluate(context, motion, length, DerivativeScope::None);
        }
        let is_rounding = result.end == NewtonEnd::Stagnated && residual <= newton.rounding;
        let solved = solved || is_rounding || residual <= solved_at;
        self.search.reuses_states = false;
        self.search.keeps_tangents = false;
        motion.residual = residual;
        if solved {
            Ok(())
        } else {
            Err(SolveError {
                left_contacts: self.left_contacts(motion),
                ..SolveError::not_converged(motion.iterations, residual)
            })
        }
    }

    /// Solves for the Newton step from the previous solution into the workspace. Returns false if
    /// there is none.
    ///
    /// If only contacts support a body, a step that opens all of them, or slips in all, loses
    /// the restoring stiffness. A step that moves the mean far is then compared with
    /// regularized ones, in which springs hold the mean. Their stiffness rises from soft to
    /// stiff. The step with the least residual is taken.
    fn regularized_step(&mut self, context: SearchContext<'_>, motion: &mut HarmonicSolution, at: StepStart) -> bool {
        let (ports, settings) = (context.ports, NewtonSettings::default().mean);
        if !self.newton_step(context, at) {
            return false;
        }
        let extent = self.extent(motion);
        if !self.is_held_by_contacts() || self.mean_change(ports, at.length) <= settings.long_step * extent {
            return true;
        }
        let mut best = (f64::INFINITY, self.workspace.step.clone());
        let mut held = 0.0;
        for share in [0.0].into_iter().chain(settings.springs) {
            if share > 0.0 {
                // restore the residual at the start of the step; evaluations without
                // derivatives keep the tangents
                motion.copy_from(&self.workspace.previous);
                self.evaluate(context, motion, at.length, DerivativeScope::None);
                for (p, port) in ports.iter().enumerate() {
                    self.add_springs(p, port, share - held);
                }
                held = share;
                if !self.newton_step(context, StepStart { same_derivatives: false, ..at }) {
                    break;
                }
            }
            self.apply_step(ports, motion, 1.0, at.length);
            let after = self.evaluate(context, motion, at.length, DerivativeScope::None);
            // a step that moves the mean far must lead almost to the solution
            let near = self.mean_change(ports, at.length) <= settings.left_contacts * extent
                || after <= settings.near_solution * at.residual;
            if near && after < best.0 {
                best = (after, self.workspace.step.clone());
            }
        }
        for (p, port) in ports.iter().enumerate() {
            self.add_springs(p, port, -held);
        }
        self.search.linearized = false;
        motion.copy_from(&self.workspace.previous);
        self.workspace.step.clone_from(&best.1);
        best.0.is_finite()
    }

    /// Returns the largest change of the mean along any axis in the step, m.
    fn mean_change(&self, ports: &Ports, length: f64) -> f64 {
        let nh = self.harmonics().len();
        let motions = ports.iter().filter(|port| !port.is_force());
        motions
            .flat_map(|port| port.range())
            .map(|q| self.workspace.step[2 * q * nh].abs() * length)
            .fold(0.0, f64::max)
    }

    /// Returns the extent of a motion, m: the largest of the displacements in static
    /// equilibrium, the harmonics without joints, and the harmonics of this motion.
    fn extent(&self, motion: &HarmonicSolution) -> f64 {
        let nh = self.harmonics().len();
        let swing = motion.c.iter().enumerate().filter(|(i, _)| i % nh > 0).map(|(_, c)| c.norm());
        let still = self.static_solution(1.0).c.into_iter().step_by(nh).map(|c| c.norm());
        self.linear.motion.iter().map(|c| c.norm()).chain(swing).chain(still).fold(0.0, f64::max)
    }

    /// Returns true if the mean displacement left the contacts that alone support a body.
    pub(super) fn left_contacts(&self, motion: &HarmonicSolution) -> bool {
        let nh = self.harmonics().len();
        let mean = motion.c.iter().step_by(nh).fold(0.0, |m: f64, c| m.max(c.norm()));
        self.is_held_by_contacts() && mean > NewtonSettings::default().mean.left_contacts * self.extent(motion)
    }

    /// Solves for the Newton step into `self.workspace.step`, in units of the unknowns.
    pub(super) fn newton_step(&mut self, context: SearchContext<'_>, near: StepStart) -> bool {
        let SearchContext { ports, homotopy, .. } = context;
        self.work.eliminations += 1;
        if let Some(banded) = &mut self.banded {
            let along = StepParameters { contacts: &self.linear.contacts, homotopy };
            if !banded.linearize(ports, &along, &self.workspace.tangents) {
                return false;
            }
        }
        self.newton_step_same_jacobian(context, near)
    }

    /// Solves for the step of another residual with the Jacobian of the last step. The banded
    /// form reuses its factors.
    pub(super) fn newton_step_same_jacobian(&mut self, context: SearchContext<'_>, near: StepStart) -> bool {
        let ports = context.ports;
        let pair = 2 * self.harmonics().len();
        self.workspace.step.copy_from_slice(&self.workspace.residual);
        match &mut self.banded {
            Some(banded) => {
                if !banded.step(ports, &self.workspace.tangents, &mut self.workspace.step) {
                    return false;
                }
                for port in ports.iter() {
                    let steps = &mut self.workspace.step[pair * port.first_axis..pair * (port.first_axis + port.axes)];
                    steps.iter_mut().for_each(|d| *d /= port.unit(near.length));
                }
                true
            }
            None => {
                for (d, unit) in self.workspace.step.iter_mut().zip(&self.workspace.units) {
                    *d /= unit;
                }
                if self.newton_krylov.is_some() && self.krylov_step(context, near) {
                    return true;
                }
                let size = self.workspace.step.len();
                if self.newton_krylov.is_some() && size > FORMED_UNKNOWNS {
                    return false;
                }
                self.assemble(context, near.length)
                    && dense::solve(&mut self.workspace.jacobian, size, &mut self.workspace.step)
            }
        }
    }

    /// Sets `motion` to `self.workspace.previous` minus a fraction of the step.
    pub(super) fn apply_step(&self, ports: &Ports, motion: &mut HarmonicSolution, fraction: f64, length: f64) {
        let nh = self.harmonics().len();
        for port in ports.iter() {
            let range = port.first_axis * nh..(port.first_axis + port.axes) * nh;
            let (values, before) = if port.is_force() {
                (&mut motion.force, &self.workspace.previous.force)
            } else {
                (&mut motion.c, &self.workspace.previous.c)
            };
            for i in range {
                let d = Complex64::new(self.workspace.step[2 * i], self.workspace.step[2 * i + 1]);
                values[i] = before[i] - d * (fraction * port.unit(length));
            }
        }
    }

    /// Returns an approximate solution near `start`, on the coarse samples if there are any.
    pub fn solve_coarse(&mut self, ports: &Ports, omega: f64, start: &HarmonicSolution) -> Option<HarmonicSolution> {
        self.begin_search(ports);
        let mut motion = HarmonicSolution { iterations: 0, ..start.clone() };
        self.exchange_samples();
        let found = self.newton_on_these_samples(
            SearchContext::given(ports, omega),
            &mut motion,
            SearchSettings { goal: StopCriterion::Rough(self.coarse_tolerance()), ..SearchSettings::default() },
        );
        self.exchange_samples();
        (found.is_ok() && !self.left_contacts(&motion)).then_some(motion)
    }

    /// Newton's method from a `motion` near the solution, with at most `most` iterations.
    pub fn newton_from(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
        most: usize,
    ) -> Result<(), SolveError> {
        self.begin_search(ports);
        self.newton(
            SearchContext::given(ports, omega),
            motion,
            SearchSettings { iterations: most, ..SearchSettings::default() },
        )
    }
}
