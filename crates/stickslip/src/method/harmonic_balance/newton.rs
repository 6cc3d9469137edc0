//! Newton's method with a line search.
//!
//! Systems with many contacts iterate on coarse samples first. The searches that follow if it
//! fails stand in `globalization`.

use super::aft::{Port, Ports};
use super::budget::WorkShare;
use super::dynamics::banded::StepParameters;
use super::equations::{DerivativeScope, Discretization, HarmonicSolution};
use super::globalization::SearchSettings;
use super::globalization::homotopy::{RESIDUAL_TOLERANCE, SearchContext};
use super::line_search::LineSearch;
use super::linear_solve::newton_krylov::{FORMED_UNKNOWNS, StepStart, product_work};
use super::settings::{NewtonSettings, WorkSettings};
use num_complex::Complex64;
use stickslip_numerics::{dense, interrupt};

/// Number of last residuals in the non-monotone line search on coarse samples. A step is
/// accepted if its residual is below the largest of them.
///
/// At the onset of slip and of opening, residuals rise before the solution is reached, and
/// monotone steps become short and many. Four residuals save a third of the steps at the onset
/// of slip of 16 to 300 nodes.
///
/// Source: Grippo, Lampariello, Lucidi (1986), "A nonmonotone line search technique for
/// Newton's method".
const NONMONOTONE_MEMORY: usize = 4;
/// Residual at which a search ends.
#[derive(Debug, Clone, Copy)]
pub(super) enum StopCriterion {
    /// The tolerance [`RESIDUAL_TOLERANCE`].
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

/// Course of the residual in one search.
struct Convergence {
    residual: f64,
    /// Least residual, infinite before the first step.
    least: f64,
    /// Residual that must be halved, and the number of steps since it was set.
    to_halve: f64,
    stagnating: usize,
    /// The last residuals, for the non-monotone line search.
    recent: [f64; NONMONOTONE_MEMORY],
}

impl Convergence {
    fn new(residual: f64) -> Self {
        let recent = [residual; NONMONOTONE_MEMORY];
        Convergence { residual, least: f64::INFINITY, to_halve: residual, stagnating: 0, recent }
    }

    /// Adds the residual after a step. Returns true if it is the least one.
    fn add(&mut self, residual: f64, iteration: usize) -> bool {
        self.residual = residual;
        self.recent[iteration % NONMONOTONE_MEMORY] = residual;
        let is_least = residual < self.least;
        self.least = self.least.min(residual);
        if self.least < 0.5 * self.to_halve {
            (self.to_halve, self.stagnating) = (self.least, 0);
        } else {
            self.stagnating += 1;
        }
        is_least
    }

    /// Continues with the residual in other units.
    fn rescale(&mut self, residual: f64) {
        (self.residual, self.least, self.recent) = (residual, f64::INFINITY, [residual; NONMONOTONE_MEMORY]);
    }

    fn largest_recent(&self) -> f64 {
        self.recent.iter().fold(self.residual, |most, r| most.max(*r))
    }

    fn is_solved(&self, tolerance: f64) -> bool {
        self.residual <= tolerance || self.is_rounding(self.least)
    }

    /// Returns true if the search stagnates at a residual that is rounding.
    fn is_rounding(&self, residual: f64) -> bool {
        let settings = NewtonSettings::default();
        self.stagnating > settings.stagnation_iterations && residual <= settings.stagnation_tolerance
    }

    fn stagnates_beyond(&self, patience: usize) -> bool {
        self.stagnating > patience && self.least < f64::INFINITY
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
            return self.search(context, motion, settings);
        }
        let start = motion.clone();
        let taken = (self.work.evaluations, self.work.eliminations, self.work.products);
        self.exchange_samples();
        let rough = self.search(
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
        if rough.is_ok() && self.search(context, motion, settings).is_ok() {
            return Ok(());
        }
        // this retry happens once per search and gets the full work limit again
        let before = self.work_used(ports).multiplications;
        (self.work.evaluations, self.work.eliminations, self.work.products) = taken;
        self.work.before.multiplications += before - self.work_used(ports).multiplications;
        self.search.uses_coarse = false;
        *motion = HarmonicSolution { iterations: motion.iterations, ..start };
        self.search(context, motion, settings)
    }

    /// Returns the residual at which a search on coarse samples ends, see
    /// [`CoarseSettings`](super::settings::CoarseSettings).
    fn coarse_tolerance(&self) -> f64 {
        let spacing = 1024.0 / self.all_samples() as f64;
        NewtonSettings::default().coarse.tolerance * spacing.powi(2).max(1.0)
    }

    /// Newton's method with a line search, to a given residual.
    ///
    /// The line search halves the step until the residual decreases. If no fraction decreases
    /// it, the whole step is taken, which may break a cycle of slipping samples. On coarse
    /// samples the line search is non-monotone, see [`NONMONOTONE_MEMORY`].
    fn search(
        &mut self,
        context: SearchContext<'_>,
        motion: &mut HarmonicSolution,
        settings: SearchSettings,
    ) -> Result<(), SolveError> {
        let (ports, newton) = (context.ports, NewtonSettings::default());
        let rough = matches!(settings.goal, StopCriterion::Rough(_));
        let mut length = self.motion_scale(motion);
        self.search.reuses_states = self.search.uses_coarse;
        let first = self.evaluate(context, motion, length, DerivativeScope::Cheap);
        let solved = match settings.goal {
            StopCriterion::Solved => RESIDUAL_TOLERANCE,
            StopCriterion::Rough(solved) => solved,
            StopCriterion::Share(share) => RESIDUAL_TOLERANCE.max(share * first),
        };
        let mut coarse = self.search.uses_coarse && !rough;
        let mut same_derivatives = self.search.keeps_tangents && coarse;
        let mut coarse_derivatives = same_derivatives;
        let mut convergence = Convergence::new(first);
        // the proximal point method finds forces that do not settle
        let patience = if ports.has_forces() { newton.stagnation_iterations } else { settings.patience };
        for _ in 0..settings.iterations {
            interrupt::check();
            if convergence.is_solved(solved) || self.is_budget_used(ports) || convergence.stagnates_beyond(patience) {
                break;
            }
            if !same_derivatives {
                coarse_derivatives = self.complete_derivatives(context, motion, coarse);
            }
            let residual = convergence.residual;
            let near = StepStart { length, residual, coarse: coarse_derivatives || rough, same_derivatives };
            self.workspace.previous.copy_from(motion);
            if !self.regularized_step(context, motion, near) {
                break;
            }
            motion.iterations += 1;
            let reference = if rough { convergence.largest_recent() } else { residual };
            let after = self.line_search(context, motion, length, reference);
            if !after.is_finite() || after > newton.divergence * residual {
                break;
            }
            let reduced = after < newton.coarse.reduction * residual;
            coarse &= reduced;
            same_derivatives = coarse_derivatives && reduced && self.search.linearised;
            if convergence.add(after, motion.iterations) {
                self.workspace.best.copy_from(motion);
            }
            let now = self.motion_scale(motion);
            if now < 0.5 * length || now > 2.0 * length {
                // the motion was far from its initial guess; rescale with its own size
                length = now;
                convergence.rescale(self.evaluate(context, motion, length, DerivativeScope::Cheap));
            }
        }
        if convergence.residual > solved && convergence.least < f64::INFINITY {
            motion.c.clone_from(&self.workspace.best.c);
            motion.force.clone_from(&self.workspace.best.force);
            convergence.residual = self.evaluate(context, motion, length, DerivativeScope::None);
        }
        self.search.reuses_states = false;
        self.search.keeps_tangents = false;
        motion.residual = convergence.residual;
        if convergence.residual <= solved || convergence.is_rounding(convergence.residual) {
            Ok(())
        } else {
            Err(SolveError {
                left_contacts: self.left_contacts(motion),
                ..SolveError::not_converged(motion.iterations, convergence.residual)
            })
        }
    }

    /// Moves to the fraction of the step that reduces the residual below `reference`, or to the
    /// whole step if none does. Returns the residual there.
    fn line_search(
        &mut self,
        context: SearchContext<'_>,
        motion: &mut HarmonicSolution,
        length: f64,
        reference: f64,
    ) -> f64 {
        let mut trial = |fraction: f64| {
            self.apply_step(context.ports, motion, fraction, length);
            self.evaluate(context, motion, length, DerivativeScope::Cheap)
        };
        LineSearch::default().run(reference, &mut trial).unwrap_or_else(|| trial(1.0))
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
        self.search.linearised = false;
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

    /// Returns the work of the present search relative to the limits of [`WorkSettings`].
    pub(super) fn work_used(&self, ports: &Ports) -> WorkShare {
        let settings = WorkSettings::default();
        let (size, harmonics) = (self.workspace.residual.len() as f64, self.harmonics().len());
        let of_port = |port: &Port| {
            let falls = port.least_penalty > 0.0;
            port.axes as f64 * if falls { settings.falling_evaluation } else { settings.evaluation }
        };
        let evaluated = (self.all_samples() * self.work.evaluations) as f64 * ports.iter().map(of_port).sum::<f64>();
        let (taken, least) = match &self.banded {
            Some(banded) => {
                let one = banded.work(harmonics);
                (self.work.eliminations as f64 * one + evaluated, settings.eliminations * one)
            }
            // GMRES counts its products; the line search takes none
            None if self.newton_krylov.is_some() => {
                let one = product_work(ports, harmonics);
                (self.work.products as f64 * one, settings.eliminations * settings.products_per_step * one)
            }
            None => {
                let one = size.powi(3) / 3.0;
                (self.work.eliminations as f64 * one + evaluated, settings.eliminations * one)
            }
        };
        let most = if self.work.extends_shorter && ports.has_forces() {
            settings.multiplications
        } else {
            settings.multiplications.max(least)
        };
        // four periods of at most 1024 samples in one evaluation
        let stepped = settings.evaluations * 4 * self.all_samples().min(1024) * ports.len();
        WorkShare {
            multiplications: taken / most,
            time_steps: self.aft.law_steps as f64 / settings.time_steps.max(stepped) as f64,
        }
    }

    /// Returns the work of all searches of the point on these equations.
    pub(super) fn point_work_used(&self, ports: &Ports) -> WorkShare {
        self.work.before.and(self.work_used(ports))
    }

    /// Returns true if the search has used its work limit or that of its point.
    pub(super) fn is_budget_used(&self, ports: &Ports) -> bool {
        self.work_used(ports).exceeds(WorkShare { multiplications: 1.0, time_steps: 1.0 })
            || self.work.elsewhere.and(self.point_work_used(ports)).exceeds(self.work.limit)
    }

    /// Solves for the Newton step into `self.workspace.step`, in units of the unknowns.
    pub(super) fn newton_step(&mut self, context: SearchContext<'_>, near: StepStart) -> bool {
        let SearchContext { ports, homotopy, .. } = context;
        self.work.eliminations += 1;
        if let Some(banded) = &mut self.banded {
            let along = StepParameters { penalty: &self.linear.penalty, homotopy };
            if !banded.linearise(ports, &along, &self.workspace.tangents) {
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
        let found = self.search(
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
