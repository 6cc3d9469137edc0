//! Nonlinear solution: Newton's method with line search, and the searches that follow if it
//! fails.
//!
//! Systems with many contacts iterate on coarse samples first. If Newton's method fails on
//! rigid friction, the interior point method follows, then the proximal point method. The last
//! search is a homotopy in the slip limits, from the solution in which all joints stick.

use super::aft::{Port, Ports};
use super::budget::{LEAST_ELIMINATIONS, SEARCH_LIMIT, SEARCH_MULTIPLICATIONS, WorkShare};
use super::dynamics::banded::StepParameters;
use super::equations::{DerivativeScope, Discretization, HarmonicSolution};
use super::globalization::found_by::FoundBy;
use super::globalization::homotopy::{GIVEN_EQUATIONS, Homotopy, RESIDUAL_TOLERANCE};
use super::linear_solve::newton_krylov::{FORMED_UNKNOWNS, StepStart, product_work};
use num_complex::Complex64;
use stickslip_numerics::{dense, interrupt};

/// Newton iterations; 3 to 15 are usual.
const ITERATIONS: usize = 60;
/// Total Newton iterations while slip limits are raised. One is enough at limits at which all
/// joints stick.
const MOST_RAISING: usize = 200;
/// Newton iterations at one raised limit if only contacts support the structure. One iteration
/// from static equilibrium reaches the solution in which all joints stick, if the limits are
/// high enough.
const STUCK_ITERATIONS: usize = 6;
/// Total Newton iterations while slip limits are lowered; a few hundred are usual.
const MOST_ITERATIONS: usize = 3000;
/// Residual at which a stagnating search counts as converged. Forces are differentiable
/// functions of the harmonics, so the remainder is the rounding of structures whose stiffnesses
/// differ widely.
const STAGNATION_TOLERANCE: f64 = 1e-8;
/// Iterations without a halved least residual after which a search counts as stagnating.
const STAGNATION_ITERATIONS: usize = 8;
/// Residual at which a search on coarse samples ends, for 1024 full samples. For fewer samples
/// it grows with the square of their spacing. The sampling error of the coarse samples has this
/// size.
const COARSE_TOLERANCE: f64 = 8e-4;
/// Residual below which a step with the Jacobian of coarse samples must leave at most
/// [`COARSE_JACOBIAN_REDUCTION`].
const COARSE_JACOBIAN_FROM: f64 = 1e-3;
/// Largest share of the residual that such a step may leave. A larger share ends the use of
/// coarse Jacobians.
const COARSE_JACOBIAN_REDUCTION: f64 = 0.1;
/// Share of the residual below which the next step reuses the Jacobian of coarse samples. A new
/// one would have the same sampling error, and would not leave less.
const REUSE_REDUCTION: f64 = 0.1;
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
/// Halvings of a step in the line search.
pub(super) const HALVINGS: usize = 7;
/// Growth of the residual in one step beyond which the search has diverged.
pub(super) const DIVERGENCE: f64 = 100.0;
/// Sufficient decrease in the line search: a step of fraction `t` must reduce the residual to at
/// most `1 - t SUFFICIENT_DECREASE` of its value.
pub(super) const SUFFICIENT_DECREASE: f64 = 1e-3;
/// Mean displacement, relative to the extent of the motion, beyond which a body has left the
/// contacts that alone support it. The mean of a supported body stays within about its
/// vibration amplitude.
const LEFT_CONTACTS: f64 = 10.0;
/// Stiffness of the springs that regularize a step whose mean is too long, relative to closed
/// contacts.
const REGULARIZING_SHARES: [f64; 6] = [0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0];
/// Share of the residual below which even a long step counts as leading to the solution.
const NEAR_SOLUTION: f64 = 0.1;
/// Mean displacement of a step, relative to the extent of the motion, above which regularized
/// steps are tried too. It applies if only contacts support a body.
const LONG_MEAN_STEP: f64 = 2.0;
/// Multiplications of one evaluation per sample and axis: both Fourier transforms and the law.
/// Measured: 15 µs for 2048 samples.
const EVALUATION_COST: f64 = 40.0;
/// Multiplications per sample and axis for friction that falls with velocity. Its force is
/// solved for at six instants of each sample. Measured: 0.4 µs.
const FALLING_EVALUATION_COST: f64 = 2000.0;
/// Time steps of laws with memory in the work limit of a search, unless [`EVALUATIONS`] ask for
/// more. A converging search of one joint takes a few hundred thousand. With a stiff law this
/// limit takes ten seconds.
const MOST_TIME_STEPS: usize = 3_000_000;
/// Number of evaluations of all laws that the work limit of a search always covers. Homotopies
/// take hundreds.
const EVALUATIONS: usize = 800;
/// Rough number of periods over which a law with memory is integrated in one evaluation.
const PERIODS_PER_EVALUATION: usize = 4;
/// Largest number of samples per period that enters this limit. With more samples, hundreds of
/// evaluations would take minutes.
const COUNTED_SAMPLES: usize = 1024;
/// Rough number of products with the Jacobian in one step by GMRES.
const PRODUCTS_PER_STEP: f64 = 30.0;

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
}

impl Discretization {
    /// Newton's method.
    ///
    /// If there are coarse samples, it first iterates on them, and then on all samples with the
    /// coarse Jacobian. If that fails, it iterates on all samples from the initial guess.
    pub(super) fn newton(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
        homotopy: Homotopy,
        (most, goal): (usize, StopCriterion),
    ) -> Result<(), SolveError> {
        if !self.uses_coarse || self.coarse.is_none() {
            return self.search(ports, omega, motion, homotopy, (most, goal));
        }
        let start = motion.clone();
        let taken = (self.evaluations, self.eliminations, self.products);
        self.exchange_samples();
        let rough = self.search(ports, omega, motion, homotopy, (most, StopCriterion::Rough(self.coarse_tolerance())));
        if rough.is_ok() {
            // the periodic state is known on these samples
            self.complete_derivatives(ports, omega, motion, (homotopy, false));
            self.keeps_tangents = true;
        }
        self.exchange_samples();
        if rough.is_ok() && self.search(ports, omega, motion, homotopy, (most, goal)).is_ok() {
            return Ok(());
        }
        // this retry happens once per search and gets the full work limit again
        let before = self.work_used(ports).multiplications;
        (self.evaluations, self.eliminations, self.products) = taken;
        self.work_before.multiplications += before - self.work_used(ports).multiplications;
        self.uses_coarse = false;
        *motion = HarmonicSolution { iterations: motion.iterations, ..start };
        self.search(ports, omega, motion, homotopy, (most, goal))
    }

    /// Returns the residual at which a search on coarse samples ends, see [`COARSE_TOLERANCE`].
    fn coarse_tolerance(&self) -> f64 {
        COARSE_TOLERANCE * (COUNTED_SAMPLES as f64 / self.all_samples() as f64).powi(2).max(1.0)
    }

    /// Newton's method with a line search, to a given residual.
    ///
    /// The line search halves the step until the residual decreases. If no fraction decreases
    /// it, the whole step is taken, which may break a cycle of slipping samples. On coarse
    /// samples the line search is non-monotone, see [`NONMONOTONE_MEMORY`].
    fn search(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
        homotopy: Homotopy,
        (most, goal): (usize, StopCriterion),
    ) -> Result<(), SolveError> {
        let rough = matches!(goal, StopCriterion::Rough(_));
        let mut length = self.motion_scale(motion);
        self.reuses_states = self.uses_coarse;
        let mut residual = self.evaluate(ports, omega, motion, homotopy, length, DerivativeScope::Cheap);
        let solved = match goal {
            StopCriterion::Solved => RESIDUAL_TOLERANCE,
            StopCriterion::Rough(solved) => solved,
            StopCriterion::Share(share) => RESIDUAL_TOLERANCE.max(share * residual),
        };
        let mut sketched = self.uses_coarse && !rough;
        let mut kept = self.keeps_tangents && sketched;
        let mut rough_slopes = kept;
        let mut recent = [residual; NONMONOTONE_MEMORY];
        let mut least = f64::INFINITY;
        // residual that must be halved, and iterations since it was set
        let (mut to_halve, mut stagnating) = (residual, 0);
        // the proximal point method finds forces that do not settle
        let most_stagnating = if ports.has_forces() { STAGNATION_ITERATIONS } else { most };
        for _ in 0..most {
            interrupt::check();
            let found = residual <= solved || (stagnating > STAGNATION_ITERATIONS && least <= STAGNATION_TOLERANCE);
            if found || self.is_budget_used(ports) || (stagnating > most_stagnating && least < f64::INFINITY) {
                break;
            }
            if !kept {
                rough_slopes = self.complete_derivatives(ports, omega, motion, (homotopy, sketched));
            }
            let near = StepStart { length, residual, coarse: rough_slopes || rough, same_derivatives: kept };
            self.previous.copy_from(motion);
            if !self.regularized_step(ports, (omega, homotopy), motion, near) {
                break;
            }
            motion.iterations += 1;
            let reference = if rough { recent.iter().fold(residual, |most, r| most.max(*r)) } else { residual };
            let mut fraction = 1.0;
            let mut after = f64::INFINITY;
            let settles = self.can_eliminate(ports);
            for halving in 0..=HALVINGS + 1 {
                if halving > HALVINGS {
                    fraction = 1.0;
                }
                self.apply_step(ports, motion, fraction, length);
                after = self.evaluate(ports, omega, motion, homotopy, length, DerivativeScope::Cheap);
                if after < (1.0 - SUFFICIENT_DECREASE * fraction) * reference || self.is_budget_used(ports) {
                    break;
                }
                if settles && halving == 0 && after.is_finite() {
                    // the step may be right for most contacts; solve for the others separately
                    if let Some(settled) =
                        self.eliminate_nonlinear(ports, (omega, homotopy), motion, (length, reference))
                    {
                        after = settled;
                        break;
                    }
                }
                fraction *= 0.5;
            }
            if !after.is_finite() || after > DIVERGENCE * residual {
                break;
            }
            sketched &= after < COARSE_JACOBIAN_REDUCTION * residual || residual > COARSE_JACOBIAN_FROM;
            kept = rough_slopes && after < REUSE_REDUCTION * residual && self.linearised;
            residual = after;
            recent[motion.iterations % NONMONOTONE_MEMORY] = residual;
            if residual < least {
                least = residual;
                self.best.copy_from(motion);
            }
            (to_halve, stagnating) = if least < 0.5 * to_halve { (least, 0) } else { (to_halve, stagnating + 1) };
            let now = self.motion_scale(motion);
            if now < 0.5 * length || now > 2.0 * length {
                // the motion was far from its initial guess; rescale with its own size
                length = now;
                residual = self.evaluate(ports, omega, motion, homotopy, length, DerivativeScope::Cheap);
                recent = [residual; NONMONOTONE_MEMORY];
                least = f64::INFINITY;
            }
        }
        if residual > solved && least < f64::INFINITY {
            let iterations = motion.iterations;
            motion.c.clone_from(&self.best.c);
            motion.force.clone_from(&self.best.force);
            motion.iterations = iterations;
            residual = self.evaluate(ports, omega, motion, homotopy, length, DerivativeScope::None);
        }
        self.reuses_states = false;
        self.keeps_tangents = false;
        motion.residual = residual;
        if residual <= solved || (stagnating > STAGNATION_ITERATIONS && residual <= STAGNATION_TOLERANCE) {
            Ok(())
        } else {
            Err(SolveError {
                left_contacts: self.left_contacts(motion),
                ..SolveError::not_converged(motion.iterations, residual)
            })
        }
    }

    /// Solves for the Newton step from `self.before` into `self.step`. Returns false if there
    /// is none.
    ///
    /// If only contacts support a body, a step that opens all of them, or slips in all, loses
    /// the restoring stiffness. A step that moves the mean far is then compared with
    /// regularized ones, in which springs hold the mean. Their stiffness rises from soft to
    /// stiff. The step with the least residual is taken.
    fn regularized_step(
        &mut self,
        ports: &Ports,
        (omega, homotopy): (f64, Homotopy),
        motion: &mut HarmonicSolution,
        at: StepStart,
    ) -> bool {
        if !self.newton_step(ports, omega, homotopy, at) {
            return false;
        }
        let extent = self.extent(motion);
        if !self.is_held_by_contacts() || self.mean_change(ports, at.length) <= LONG_MEAN_STEP * extent {
            return true;
        }
        let mut best = (f64::INFINITY, self.step.clone());
        let mut held = 0.0;
        for share in REGULARIZING_SHARES {
            if share > 0.0 {
                // restore the residual at the start of the step; evaluations without
                // derivatives keep the tangents
                motion.copy_from(&self.previous);
                self.evaluate(ports, omega, motion, homotopy, at.length, DerivativeScope::None);
                for (p, port) in ports.iter().enumerate() {
                    self.add_springs(p, port, share - held);
                }
                held = share;
                if !self.newton_step(ports, omega, homotopy, StepStart { same_derivatives: false, ..at }) {
                    break;
                }
            }
            self.apply_step(ports, motion, 1.0, at.length);
            let after = self.evaluate(ports, omega, motion, homotopy, at.length, DerivativeScope::None);
            // a step that moves the mean far must lead almost to the solution
            let near =
                self.mean_change(ports, at.length) <= LEFT_CONTACTS * extent || after <= NEAR_SOLUTION * at.residual;
            if near && after < best.0 {
                best = (after, self.step.clone());
            }
        }
        for (p, port) in ports.iter().enumerate() {
            self.add_springs(p, port, -held);
        }
        self.linearised = false;
        motion.copy_from(&self.previous);
        self.step.clone_from(&best.1);
        best.0.is_finite()
    }

    /// Returns the largest change of the mean along any axis in the step, m.
    fn mean_change(&self, ports: &Ports, length: f64) -> f64 {
        let nh = self.harmonics().len();
        let motions = ports.iter().filter(|port| !port.is_force());
        motions.flat_map(|port| port.range()).map(|q| self.step[2 * q * nh].abs() * length).fold(0.0, f64::max)
    }

    /// Returns the extent of a motion, m: the largest of the displacements in static
    /// equilibrium, the harmonics without joints, and the harmonics of this motion.
    fn extent(&self, motion: &HarmonicSolution) -> f64 {
        let nh = self.harmonics().len();
        let swing = motion.c.iter().enumerate().filter(|(i, _)| i % nh > 0).map(|(_, c)| c.norm());
        let still = self.static_solution(1.0).c.into_iter().step_by(nh).map(|c| c.norm());
        self.linear_motion.iter().map(|c| c.norm()).chain(swing).chain(still).fold(0.0, f64::max)
    }

    /// Returns true if the mean displacement left the contacts that alone support a body.
    fn left_contacts(&self, motion: &HarmonicSolution) -> bool {
        let nh = self.harmonics().len();
        let mean = motion.c.iter().step_by(nh).fold(0.0, |m: f64, c| m.max(c.norm()));
        self.is_held_by_contacts() && mean > LEFT_CONTACTS * self.extent(motion)
    }

    /// Returns the work of the present search relative to [`SEARCH_MULTIPLICATIONS`] and
    /// [`MOST_TIME_STEPS`].
    pub(super) fn work_used(&self, ports: &Ports) -> WorkShare {
        let size = self.residual.len() as f64;
        let of_port = |port: &Port| {
            port.axes as f64 * if port.least_penalty > 0.0 { FALLING_EVALUATION_COST } else { EVALUATION_COST }
        };
        let evaluated = (self.all_samples() * self.evaluations) as f64 * ports.iter().map(of_port).sum::<f64>();
        let (taken, one, fewest) = match self.banded {
            Some(ref banded) => (self.eliminations, banded.work(self.harmonics().len()), LEAST_ELIMINATIONS),
            // GMRES counts its products; the line search takes none
            None if self.newton_krylov.is_some() => {
                (self.products, product_work(ports, self.harmonics().len()), LEAST_ELIMINATIONS * PRODUCTS_PER_STEP)
            }
            None => (self.eliminations, size * size * size / 3.0, LEAST_ELIMINATIONS),
        };
        let counted = taken as f64 * one + if self.newton_krylov.is_some() { 0.0 } else { evaluated };
        let most = if self.extends_shorter && ports.has_forces() {
            SEARCH_MULTIPLICATIONS
        } else {
            SEARCH_MULTIPLICATIONS.max(fewest * one)
        };
        let marched = EVALUATIONS * PERIODS_PER_EVALUATION * self.all_samples().min(COUNTED_SAMPLES) * ports.len();
        WorkShare {
            multiplications: counted / most,
            time_steps: self.aft.law_steps as f64 / MOST_TIME_STEPS.max(marched) as f64,
        }
    }

    /// Returns the work of all searches of the point on these equations.
    pub(super) fn point_work_used(&self, ports: &Ports) -> WorkShare {
        self.work_before.and(self.work_used(ports))
    }

    /// Returns true if the search has used its work limit or that of its point.
    pub(super) fn is_budget_used(&self, ports: &Ports) -> bool {
        self.work_used(ports).exceeds(SEARCH_LIMIT)
            || self.work_elsewhere.and(self.point_work_used(ports)).exceeds(self.work_limit)
    }

    /// Solves for the Newton step into `self.step`, in units of the unknowns.
    pub(super) fn newton_step(&mut self, ports: &Ports, omega: f64, homotopy: Homotopy, near: StepStart) -> bool {
        self.eliminations += 1;
        if let Some(banded) = &mut self.banded {
            let along = StepParameters { penalty: &self.penalty, homotopy };
            if !banded.linearise(ports, &along, &self.tangents) {
                return false;
            }
        }
        self.newton_step_same_jacobian(ports, omega, homotopy, near)
    }

    /// Solves for the step of another residual with the Jacobian of the last step. The banded
    /// form reuses its factors.
    pub(super) fn newton_step_same_jacobian(
        &mut self,
        ports: &Ports,
        omega: f64,
        homotopy: Homotopy,
        near: StepStart,
    ) -> bool {
        let pair = 2 * self.harmonics().len();
        self.step.copy_from_slice(&self.residual);
        match &mut self.banded {
            Some(banded) => {
                if !banded.step(ports, &self.tangents, &mut self.step) {
                    return false;
                }
                for port in ports.iter() {
                    let steps = &mut self.step[pair * port.first_axis..pair * (port.first_axis + port.axes)];
                    steps.iter_mut().for_each(|d| *d /= port.unit(near.length));
                }
                true
            }
            None => {
                for (d, unit) in self.step.iter_mut().zip(&self.units) {
                    *d /= unit;
                }
                if self.newton_krylov.is_some() && self.krylov_step(ports, omega, homotopy, near) {
                    return true;
                }
                let size = self.step.len();
                if self.newton_krylov.is_some() && size > FORMED_UNKNOWNS {
                    return false;
                }
                self.assemble(ports, omega, homotopy, near.length)
                    && dense::solve(&mut self.jacobian, size, &mut self.step)
            }
        }
    }

    /// Sets `motion` to `self.before` minus a fraction of the step.
    pub(super) fn apply_step(&self, ports: &Ports, motion: &mut HarmonicSolution, fraction: f64, length: f64) {
        let nh = self.harmonics().len();
        for port in ports.iter() {
            let range = port.first_axis * nh..(port.first_axis + port.axes) * nh;
            let (values, before) = if port.is_force() {
                (&mut motion.force, &self.previous.force)
            } else {
                (&mut motion.c, &self.previous.c)
            };
            for i in range {
                let d = Complex64::new(self.step[2 * i], self.step[2 * i + 1]);
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
            ports,
            omega,
            &mut motion,
            GIVEN_EQUATIONS,
            (ITERATIONS, StopCriterion::Rough(self.coarse_tolerance())),
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
        self.newton(ports, omega, motion, GIVEN_EQUATIONS, (most, StopCriterion::Solved))
    }

    /// Solves from the initial guess `start`.
    pub fn solve(
        &mut self,
        ports: &Ports,
        omega: f64,
        start: HarmonicSolution,
    ) -> Result<HarmonicSolution, SolveError> {
        self.solve_to(ports, omega, start, StopCriterion::Solved)
    }

    /// Solves from the initial guess `start`. Newton's method stops at `goal`; the searches that
    /// follow it ignore `goal`.
    pub fn solve_to(
        &mut self,
        ports: &Ports,
        omega: f64,
        mut start: HarmonicSolution,
        goal: StopCriterion,
    ) -> Result<HarmonicSolution, SolveError> {
        start.iterations = 0;
        self.begin_search(ports);
        let mut motion = start.clone();
        if self.newton(ports, omega, &mut motion, GIVEN_EQUATIONS, (ITERATIONS, goal)).is_ok()
            && !self.left_contacts(&motion)
        {
            return Ok(motion);
        }
        let mut nearest = f64::INFINITY;
        if ports.has_forces() {
            let iterations = motion.iterations;
            motion = HarmonicSolution { iterations, ..start.clone() };
            if self.interior_point_method(ports, omega, &mut motion).is_ok() {
                return Ok(HarmonicSolution { found_by: FoundBy::InteriorPoints, ..motion });
            }
            motion = HarmonicSolution { iterations: motion.iterations, ..start };
            match self.proximal_point_method(ports, omega, &mut motion) {
                Ok(()) => return Ok(HarmonicSolution { found_by: FoundBy::ProximalPoints, ..motion }),
                Err(error) => nearest = error.residual,
            }
        }
        let away = self.left_contacts(&motion);
        match self.slip_limit_homotopy(ports, omega, &mut motion) {
            Ok(()) if !self.left_contacts(&motion) => {
                Ok(HarmonicSolution { found_by: FoundBy::SlipLimitHomotopy, ..motion })
            }
            Ok(()) => {
                Err(SolveError { left_contacts: true, ..SolveError::not_converged(motion.iterations, motion.residual) })
            }
            Err(error) => Err(SolveError {
                left_contacts: away || error.left_contacts,
                residual: error.residual.min(nearest),
                ..error
            }),
        }
    }

    /// Homotopy in the slip limits, from limits at which all joints stick to the given ones.
    fn slip_limit_homotopy(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
    ) -> Result<(), SolveError> {
        let mut good = HarmonicSolution { iterations: motion.iterations, ..self.frictionless_motion() };
        let mut limits: f64 = 1.0;
        // with all joints stuck, the equations are linear
        let mut raised = Err(SolveError::not_converged(good.iterations, f64::INFINITY));
        for attempt in 0..60 {
            limits *= 4.0;
            if attempt == 1 {
                // steep friction, such as friction that falls with velocity, needs far higher
                // limits
                limits = limits.max(self.sticking_limit_factor(ports));
            }
            let iterations = good.iterations;
            good = match self.is_held_by_contacts() {
                true => HarmonicSolution { iterations, ..self.static_solution(limits) },
                false => HarmonicSolution { iterations, ..self.frictionless_motion() },
            };
            let most = if self.is_held_by_contacts() { STUCK_ITERATIONS } else { ITERATIONS };
            raised = self.newton(
                ports,
                omega,
                &mut good,
                Homotopy { limit_factor: limits, ..GIVEN_EQUATIONS },
                (most, StopCriterion::Solved),
            );
            if raised.is_ok() || self.is_budget_used(ports) || good.iterations - motion.iterations > MOST_RAISING {
                break;
            }
        }
        raised?;
        let mut factor: f64 = 0.5;
        while limits > 1.0 {
            motion.copy_from(&good);
            let next = (limits * factor).max(1.0);
            let done = self.newton(
                ports,
                omega,
                motion,
                Homotopy { limit_factor: next, ..GIVEN_EQUATIONS },
                (ITERATIONS, StopCriterion::Solved),
            );
            good.iterations = motion.iterations;
            match done {
                Ok(()) => {
                    good.copy_from(motion);
                    limits = next;
                }
                Err(error) => {
                    factor = factor.sqrt();
                    if factor > 0.995 || self.is_budget_used(ports) || good.iterations > MOST_ITERATIONS {
                        return Err(error);
                    }
                }
            }
        }
        motion.copy_from(&good);
        Ok(())
    }
}
