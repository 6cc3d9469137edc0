//! Nonlinear solution: Newton's method with line search, and the searches that follow if it
//! fails.
//!
//! Systems with many contacts iterate on coarse samples first. If Newton's method fails on
//! rigid friction, the interior point method follows, then the proximal point method. The last
//! search is a homotopy in the slip limits, from the solution in which all joints stick.

use super::aft::{Port, Ports};
use super::budget::{FEWEST, SEARCH, WORK, WorkShare};
use super::dynamics::banded::StepParameters;
use super::equations::{DerivativeScope, Discretization, HarmonicSolution};
use super::globalization::found_by::FoundBy;
use super::globalization::homotopy::{GIVEN, Homotopy, SOLVED};
use super::linear_solve::newton_krylov::{FORMED, StepStart, product_work};
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
const STICKS: usize = 6;
/// Total Newton iterations while slip limits are lowered; a few hundred are usual.
const MOST_ITERATIONS: usize = 3000;
/// Residual at which a stagnating search counts as converged. Forces are differentiable
/// functions of the harmonics, so the remainder is the rounding of structures whose stiffnesses
/// differ widely.
const ROUNDED: f64 = 1e-8;
/// Iterations without a halved least residual after which a search counts as stagnating.
const PATIENCE: usize = 8;
/// Residual at which a search on coarse samples ends, for 1024 full samples. For fewer samples
/// it grows with the square of their spacing. The sampling error of the coarse samples has this
/// size.
const ROUGH: f64 = 8e-4;
/// Residual below which a step with the Jacobian of coarse samples must leave at most
/// [`SKETCH`].
const NEAR: f64 = 1e-3;
/// Largest share of the residual that such a step may leave. A larger share ends the use of
/// coarse Jacobians.
const SKETCH: f64 = 0.1;
/// Share of the residual below which the next step reuses the Jacobian of coarse samples. A new
/// one would have the same sampling error, and would not leave less.
const KEPT: f64 = 0.1;
/// Number of last residuals in the non-monotone line search on coarse samples. A step is
/// accepted if its residual is below the largest of them.
///
/// At the onset of slip and of opening, residuals rise before the solution is reached, and
/// monotone steps become short and many. Four residuals save a third of the steps at the onset
/// of slip of 16 to 300 nodes.
///
/// Source: Grippo, Lampariello, Lucidi (1986), "A nonmonotone line search technique for
/// Newton's method".
const REMEMBERED: usize = 4;
/// Halvings of a step in the line search.
pub(super) const HALVINGS: usize = 7;
/// Growth of the residual in one step beyond which the search has diverged.
pub(super) const GROWS: f64 = 100.0;
/// Sufficient decrease in the line search: a step of fraction `t` must reduce the residual to at
/// most `1 - t SHORTENS` of its value.
pub(super) const SHORTENS: f64 = 1e-3;
/// Mean displacement, relative to the extent of the motion, beyond which a body has left the
/// contacts that alone support it. The mean of a supported body stays within about its
/// vibration amplitude.
const AWAY: f64 = 10.0;
/// Stiffness of the springs that regularize a step whose mean is too long, relative to closed
/// contacts.
const HELD: [f64; 6] = [0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0];
/// Share of the residual below which even a long step counts as leading to the solution.
const NEARLY: f64 = 0.1;
/// Mean displacement of a step, relative to the extent of the motion, above which regularized
/// steps are tried too. It applies if only contacts support a body.
const REACH: f64 = 2.0;
/// Multiplications of one evaluation per sample and axis: both Fourier transforms and the law.
/// Measured: 15 µs for 2048 samples.
const EVALUATED: f64 = 40.0;
/// Multiplications per sample and axis for friction that falls with velocity. Its force is
/// solved for at six instants of each sample. Measured: 0.4 µs.
const EVALUATED_FALLING: f64 = 2000.0;
/// Time steps of laws with memory in the work limit of a search, unless [`EVALUATIONS`] ask for
/// more. A converging search of one joint takes a few hundred thousand. With a stiff law this
/// limit takes ten seconds.
const MARCHED: usize = 3_000_000;
/// Number of evaluations of all laws that the work limit of a search always covers. Homotopies
/// take hundreds.
const EVALUATIONS: usize = 800;
/// Rough number of periods over which a law with memory is integrated in one evaluation.
const PERIODS: usize = 4;
/// Largest number of samples per period that enters this limit. With more samples, hundreds of
/// evaluations would take minutes.
const SAMPLES: usize = 1024;
/// Rough number of products with the Jacobian in one step by GMRES.
const PRODUCTS: f64 = 30.0;

/// Residual at which a search ends.
#[derive(Debug, Clone, Copy)]
pub(super) enum StopCriterion {
    /// The tolerance [`SOLVED`].
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
    pub away: bool,
}

impl SolveError {
    /// Failure of the iteration after `iterations` with this residual.
    pub fn after(iterations: usize, residual: f64) -> Self {
        SolveError { iterations, residual, resonance: None, away: false }
    }

    /// Failure at a resonance without damping, rad/s.
    pub fn at(resonance: f64) -> Self {
        SolveError { resonance: Some(resonance), ..SolveError::after(0, f64::INFINITY) }
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
        ease: Homotopy,
        (most, goal): (usize, StopCriterion),
    ) -> Result<(), SolveError> {
        if !self.sketches || self.sketch.is_none() {
            return self.search(ports, omega, motion, ease, (most, goal));
        }
        let start = motion.clone();
        let taken = (self.assembled, self.eliminated, self.products);
        self.exchange_samples();
        let rough = self.search(ports, omega, motion, ease, (most, StopCriterion::Rough(self.rough())));
        if rough.is_ok() {
            // the periodic state is known on these samples
            self.follow_slopes(ports, omega, motion, (ease, false));
            self.keeps_slopes = true;
        }
        self.exchange_samples();
        if rough.is_ok() && self.search(ports, omega, motion, ease, (most, goal)).is_ok() {
            return Ok(());
        }
        // this retry happens once per search and gets the full work limit again
        let before = self.taken(ports).eliminated;
        (self.assembled, self.eliminated, self.products) = taken;
        self.spent.eliminated += before - self.taken(ports).eliminated;
        self.sketches = false;
        *motion = HarmonicSolution { iterations: motion.iterations, ..start };
        self.search(ports, omega, motion, ease, (most, goal))
    }

    /// Returns the residual at which a search on coarse samples ends, see [`ROUGH`].
    fn rough(&self) -> f64 {
        ROUGH * (SAMPLES as f64 / self.all_samples() as f64).powi(2).max(1.0)
    }

    /// Newton's method with a line search, to a given residual.
    ///
    /// The line search halves the step until the residual decreases. If no fraction decreases
    /// it, the whole step is taken, which may break a cycle of slipping samples. On coarse
    /// samples the line search is non-monotone, see [`REMEMBERED`].
    fn search(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
        ease: Homotopy,
        (most, goal): (usize, StopCriterion),
    ) -> Result<(), SolveError> {
        let rough = matches!(goal, StopCriterion::Rough(_));
        let mut length = self.length(motion);
        self.nearby = self.sketches;
        let mut residual = self.evaluate(ports, omega, motion, ease, length, DerivativeScope::Cheap);
        let solved = match goal {
            StopCriterion::Solved => SOLVED,
            StopCriterion::Rough(solved) => solved,
            StopCriterion::Share(share) => SOLVED.max(share * residual),
        };
        let mut sketched = self.sketches && !rough;
        let mut kept = self.keeps_slopes && sketched;
        let mut rough_slopes = kept;
        let mut recent = [residual; REMEMBERED];
        let mut least = f64::INFINITY;
        // residual that must be halved, and iterations since it was set
        let (mut mark, mut waited) = (residual, 0);
        // the proximal point method finds forces that do not settle
        let hope = if ports.has_forces() { PATIENCE } else { most };
        for _ in 0..most {
            interrupt::check();
            let found = residual <= solved || (waited > PATIENCE && least <= ROUNDED);
            if found || self.is_exhausted(ports) || (waited > hope && least < f64::INFINITY) {
                break;
            }
            if !kept {
                rough_slopes = self.follow_slopes(ports, omega, motion, (ease, sketched));
            }
            let near = StepStart { length, residual, sketched: rough_slopes || rough, kept };
            self.before.copy(motion);
            if !self.bounded_step(ports, (omega, ease), motion, near) {
                break;
            }
            motion.iterations += 1;
            let beaten = if rough { recent.iter().fold(residual, |most, r| most.max(*r)) } else { residual };
            let mut fraction = 1.0;
            let mut after = f64::INFINITY;
            let settles = self.can_settle(ports);
            for halving in 0..=HALVINGS + 1 {
                if halving > HALVINGS {
                    fraction = 1.0;
                }
                self.advance(ports, motion, fraction, length);
                after = self.evaluate(ports, omega, motion, ease, length, DerivativeScope::Cheap);
                if after < (1.0 - SHORTENS * fraction) * beaten || self.is_exhausted(ports) {
                    break;
                }
                if settles && halving == 0 && after.is_finite() {
                    // the step may be right for most contacts; solve for the others separately
                    if let Some(settled) = self.settle(ports, (omega, ease), motion, (length, beaten)) {
                        after = settled;
                        break;
                    }
                }
                fraction *= 0.5;
            }
            if !after.is_finite() || after > GROWS * residual {
                break;
            }
            sketched &= after < SKETCH * residual || residual > NEAR;
            kept = rough_slopes && after < KEPT * residual && self.linearised;
            residual = after;
            recent[motion.iterations % REMEMBERED] = residual;
            if residual < least {
                least = residual;
                self.best.copy(motion);
            }
            (mark, waited) = if least < 0.5 * mark { (least, 0) } else { (mark, waited + 1) };
            let now = self.length(motion);
            if now < 0.5 * length || now > 2.0 * length {
                // the motion was far from its initial guess; rescale with its own size
                length = now;
                residual = self.evaluate(ports, omega, motion, ease, length, DerivativeScope::Cheap);
                recent = [residual; REMEMBERED];
                least = f64::INFINITY;
            }
        }
        if residual > solved && least < f64::INFINITY {
            let iterations = motion.iterations;
            motion.c.clone_from(&self.best.c);
            motion.force.clone_from(&self.best.force);
            motion.iterations = iterations;
            residual = self.evaluate(ports, omega, motion, ease, length, DerivativeScope::None);
        }
        self.nearby = false;
        self.keeps_slopes = false;
        motion.residual = residual;
        if residual <= solved || (waited > PATIENCE && residual <= ROUNDED) {
            Ok(())
        } else {
            Err(SolveError { away: self.is_away(motion), ..SolveError::after(motion.iterations, residual) })
        }
    }

    /// Solves for the Newton step from `self.before` into `self.step`. Returns false if there
    /// is none.
    ///
    /// If only contacts support a body, a step that opens all of them, or slips in all, loses
    /// the restoring stiffness. A step that moves the mean far is then compared with
    /// regularized ones, in which springs hold the mean. Their stiffness rises from soft to
    /// stiff. The step with the least residual is taken.
    fn bounded_step(
        &mut self,
        ports: &Ports,
        (omega, ease): (f64, Homotopy),
        motion: &mut HarmonicSolution,
        at: StepStart,
    ) -> bool {
        if !self.newton_step(ports, omega, ease, at) {
            return false;
        }
        let extent = self.extent(motion);
        if !self.stands() || self.mean_step(ports, at.length) <= REACH * extent {
            return true;
        }
        let mut best = (f64::INFINITY, self.step.clone());
        let mut held = 0.0;
        for share in HELD {
            if share > 0.0 {
                // restore the residual at the start of the step; evaluations without
                // derivatives keep the tangents
                motion.copy(&self.before);
                self.evaluate(ports, omega, motion, ease, at.length, DerivativeScope::None);
                for (p, port) in ports.iter().enumerate() {
                    self.add_springs(p, port, share - held);
                }
                held = share;
                if !self.newton_step(ports, omega, ease, StepStart { kept: false, ..at }) {
                    break;
                }
            }
            self.advance(ports, motion, 1.0, at.length);
            let after = self.evaluate(ports, omega, motion, ease, at.length, DerivativeScope::None);
            // a step that moves the mean far must lead almost to the solution
            let near = self.mean_step(ports, at.length) <= AWAY * extent || after <= NEARLY * at.residual;
            if near && after < best.0 {
                best = (after, self.step.clone());
            }
        }
        for (p, port) in ports.iter().enumerate() {
            self.add_springs(p, port, -held);
        }
        self.linearised = false;
        motion.copy(&self.before);
        self.step.clone_from(&best.1);
        best.0.is_finite()
    }

    /// Returns the largest change of the mean along any axis in the step, m.
    fn mean_step(&self, ports: &Ports, length: f64) -> f64 {
        let nh = self.harmonics().len();
        let motions = ports.iter().filter(|port| !port.is_force());
        motions.flat_map(|port| port.range()).map(|q| self.step[2 * q * nh].abs() * length).fold(0.0, f64::max)
    }

    /// Returns the extent of a motion, m: the largest of the displacements in static
    /// equilibrium, the harmonics without joints, and the harmonics of this motion.
    fn extent(&self, motion: &HarmonicSolution) -> f64 {
        let nh = self.harmonics().len();
        let swing = motion.c.iter().enumerate().filter(|(i, _)| i % nh > 0).map(|(_, c)| c.norm());
        let still = self.at_rest(1.0).c.into_iter().step_by(nh).map(|c| c.norm());
        self.linear.iter().map(|c| c.norm()).chain(swing).chain(still).fold(0.0, f64::max)
    }

    /// Returns true if the mean displacement left the contacts that alone support a body.
    fn is_away(&self, motion: &HarmonicSolution) -> bool {
        let nh = self.harmonics().len();
        let mean = motion.c.iter().step_by(nh).fold(0.0, |m: f64, c| m.max(c.norm()));
        self.stands() && mean > AWAY * self.extent(motion)
    }

    /// Returns the work of the present search relative to [`WORK`] and [`MARCHED`].
    pub(super) fn taken(&self, ports: &Ports) -> WorkShare {
        let size = self.residual.len() as f64;
        let of_port =
            |port: &Port| port.axes as f64 * if port.least_penalty > 0.0 { EVALUATED_FALLING } else { EVALUATED };
        let evaluated = (self.all_samples() * self.assembled) as f64 * ports.iter().map(of_port).sum::<f64>();
        let (taken, one, fewest) = match self.sparse {
            Some(ref sparse) => (self.eliminated, sparse.work(self.harmonics().len()), FEWEST),
            // GMRES counts its products; the line search takes none
            None if self.coupled.is_some() => {
                (self.products, product_work(ports, self.harmonics().len()), FEWEST * PRODUCTS)
            }
            None => (self.eliminated, size * size * size / 3.0, FEWEST),
        };
        let counted = taken as f64 * one + if self.coupled.is_some() { 0.0 } else { evaluated };
        let most = if self.prolongs && ports.has_forces() { WORK } else { WORK.max(fewest * one) };
        let marched = EVALUATIONS * PERIODS * self.all_samples().min(SAMPLES) * ports.len();
        WorkShare { eliminated: counted / most, marched: self.alternation.marched as f64 / MARCHED.max(marched) as f64 }
    }

    /// Returns the work of all searches of the point on these equations.
    pub(super) fn taken_of_point(&self, ports: &Ports) -> WorkShare {
        self.spent.and(self.taken(ports))
    }

    /// Returns true if the search has used its work limit or that of its point.
    pub(super) fn is_exhausted(&self, ports: &Ports) -> bool {
        self.taken(ports).is_beyond(SEARCH) || self.elsewhere.and(self.taken_of_point(ports)).is_beyond(self.allowed)
    }

    /// Solves for the Newton step into `self.step`, in units of the unknowns.
    pub(super) fn newton_step(&mut self, ports: &Ports, omega: f64, ease: Homotopy, near: StepStart) -> bool {
        self.eliminated += 1;
        if let Some(sparse) = &mut self.sparse {
            let along = StepParameters { penalty: &self.penalty, ease };
            if !sparse.linearise(ports, &along, &self.tangents) {
                return false;
            }
        }
        self.newton_step_again(ports, omega, ease, near)
    }

    /// Solves for the step of another residual with the Jacobian of the last step. The banded
    /// form reuses its factors.
    pub(super) fn newton_step_again(&mut self, ports: &Ports, omega: f64, ease: Homotopy, near: StepStart) -> bool {
        let pair = 2 * self.harmonics().len();
        self.step.copy_from_slice(&self.residual);
        match &mut self.sparse {
            Some(sparse) => {
                if !sparse.step(ports, &self.tangents, &mut self.step) {
                    return false;
                }
                for port in ports.iter() {
                    let steps = &mut self.step[pair * port.first..pair * (port.first + port.axes)];
                    steps.iter_mut().for_each(|d| *d /= port.unit(near.length));
                }
                true
            }
            None => {
                for (d, unit) in self.step.iter_mut().zip(&self.units) {
                    *d /= unit;
                }
                if self.coupled.is_some() && self.coupled_step(ports, omega, ease, near) {
                    return true;
                }
                let size = self.step.len();
                if self.coupled.is_some() && size > FORMED {
                    return false;
                }
                self.assemble(ports, omega, ease, near.length) && dense::solve(&mut self.jacobian, size, &mut self.step)
            }
        }
    }

    /// Sets `motion` to `self.before` minus a fraction of the step.
    pub(super) fn advance(&self, ports: &Ports, motion: &mut HarmonicSolution, fraction: f64, length: f64) {
        let nh = self.harmonics().len();
        for port in ports.iter() {
            let range = port.first * nh..(port.first + port.axes) * nh;
            let (values, before) =
                if port.is_force() { (&mut motion.force, &self.before.force) } else { (&mut motion.c, &self.before.c) };
            for i in range {
                let d = Complex64::new(self.step[2 * i], self.step[2 * i + 1]);
                values[i] = before[i] - d * (fraction * port.unit(length));
            }
        }
    }

    /// Returns an approximate solution near `start`, on the coarse samples if there are any.
    pub fn approach(&mut self, ports: &Ports, omega: f64, start: &HarmonicSolution) -> Option<HarmonicSolution> {
        self.begin_anew(ports);
        let mut motion = HarmonicSolution { iterations: 0, ..start.clone() };
        self.exchange_samples();
        let found = self.search(ports, omega, &mut motion, GIVEN, (ITERATIONS, StopCriterion::Rough(self.rough())));
        self.exchange_samples();
        (found.is_ok() && !self.is_away(&motion)).then_some(motion)
    }

    /// Newton's method from a `motion` near the solution, with at most `most` iterations.
    pub fn polish(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
        most: usize,
    ) -> Result<(), SolveError> {
        self.begin_anew(ports);
        self.newton(ports, omega, motion, GIVEN, (most, StopCriterion::Solved))
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
        self.begin_anew(ports);
        let mut motion = start.clone();
        if self.newton(ports, omega, &mut motion, GIVEN, (ITERATIONS, goal)).is_ok() && !self.is_away(&motion) {
            return Ok(motion);
        }
        let mut nearest = f64::INFINITY;
        if ports.has_forces() {
            let iterations = motion.iterations;
            motion = HarmonicSolution { iterations, ..start.clone() };
            if self.by_interior_points(ports, omega, &mut motion).is_ok() {
                return Ok(HarmonicSolution { found_by: FoundBy::InteriorPoints, ..motion });
            }
            motion = HarmonicSolution { iterations: motion.iterations, ..start };
            match self.by_proximal_points(ports, omega, &mut motion) {
                Ok(()) => return Ok(HarmonicSolution { found_by: FoundBy::ProximalPoints, ..motion }),
                Err(lost) => nearest = lost.residual,
            }
        }
        let away = self.is_away(&motion);
        match self.lower_limits(ports, omega, &mut motion) {
            Ok(()) if !self.is_away(&motion) => Ok(HarmonicSolution { found_by: FoundBy::SlipLimitHomotopy, ..motion }),
            Ok(()) => Err(SolveError { away: true, ..SolveError::after(motion.iterations, motion.residual) }),
            Err(lost) => Err(SolveError { away: away || lost.away, residual: lost.residual.min(nearest), ..lost }),
        }
    }

    /// Homotopy in the slip limits, from limits at which all joints stick to the given ones.
    fn lower_limits(&mut self, ports: &Ports, omega: f64, motion: &mut HarmonicSolution) -> Result<(), SolveError> {
        let mut good = HarmonicSolution { iterations: motion.iterations, ..self.unhindered() };
        let mut limits: f64 = 1.0;
        // with all joints stuck, the equations are linear
        let mut held = Err(SolveError::after(good.iterations, f64::INFINITY));
        for attempt in 0..60 {
            limits *= 4.0;
            if attempt == 1 {
                // steep friction, such as friction that falls with velocity, needs far higher
                // limits
                limits = limits.max(self.sticking(ports));
            }
            let iterations = good.iterations;
            good = match self.stands() {
                true => HarmonicSolution { iterations, ..self.at_rest(limits) },
                false => HarmonicSolution { iterations, ..self.unhindered() },
            };
            let most = if self.stands() { STICKS } else { ITERATIONS };
            held = self.newton(ports, omega, &mut good, Homotopy { limits, ..GIVEN }, (most, StopCriterion::Solved));
            if held.is_ok() || self.is_exhausted(ports) || good.iterations - motion.iterations > MOST_RAISING {
                break;
            }
        }
        held?;
        let mut factor: f64 = 0.5;
        while limits > 1.0 {
            motion.copy(&good);
            let next = (limits * factor).max(1.0);
            let done = self.newton(
                ports,
                omega,
                motion,
                Homotopy { limits: next, ..GIVEN },
                (ITERATIONS, StopCriterion::Solved),
            );
            good.iterations = motion.iterations;
            match done {
                Ok(()) => {
                    good.copy(motion);
                    limits = next;
                }
                Err(lost) => {
                    factor = factor.sqrt();
                    if factor > 0.995 || self.is_exhausted(ports) || good.iterations > MOST_ITERATIONS {
                        return Err(lost);
                    }
                }
            }
        }
        motion.copy(&good);
        Ok(())
    }
}
