//! The search for a solution: Newton's method with the exact derivative, of many contacts by fewer samples first; where it fails, interior points, then
//! proximal points, and then slip limits that are lowered from where everything sticks.

use super::budget::{FEWEST, SEARCH, WORK, Work};
use super::coupled::{FORMED, Near, product_work};
use super::ease::{Ease, GIVEN, SOLVED};
use super::equations::{Level, Slopes, Solution};
use super::found_by::FoundBy;
use super::ports::{Port, Ports};
use super::sparse::Along;
use num_complex::Complex64;
use stickslip_numerics::{dense, interrupt};

/// Newton iterations; 3 to 15 are usual.
const ITERATIONS: usize = 60;
/// Newton iterations in all while slip limits are raised: where they hold, one is enough.
const MOST_RAISING: usize = 200;
/// Newton iterations at one of these, where contacts alone hold: from rest one leads to what sticks under limits that hold.
const STICKS: usize = 6;
/// Newton iterations in all while they are lowered; a few hundred are usual.
const MOST_ITERATIONS: usize = 3000;
/// Residual at which a search that comes no closer has found all that there is: forces are differentiable functions of the harmonics, and what is
/// left is the rounding of structures whose springs are far apart.
const ROUNDED: f64 = 1e-8;
/// Iterations without half of the least residual after which a search comes no closer.
const PATIENCE: usize = 8;
/// Residual with which a search by fewer samples ends where there are 1024 in all, more by the square where there are fewer: what they leave out is of this
/// size.
const ROUGH: f64 = 8e-4;
/// Residual from which on a step by sketched derivatives is to leave no more than a share; where it leaves more they are given up.
const NEAR: f64 = 1e-3;
const SKETCH: f64 = 0.1;
/// Share of the residual that a step by sketched derivatives leaves where the next one goes by the same: new ones would leave no less, since what fewer
/// samples leave out is in them too.
const KEPT: f64 = 0.1;
/// Steps by fewer samples, of whose residuals one has only to come below the largest: where contacts begin to slip and to open, the way to the solution
/// leads over larger ones, and steps that never do are short and many. Four take a third of the steps fewer at the onset of slip of 16 to 300 nodes.
/// Source: Grippo, Lampariello, Lucidi (1986), "A nonmonotone line search technique for Newton's method".
const REMEMBERED: usize = 4;
/// Halvings of a step.
pub(super) const HALVINGS: usize = 7;
/// Growth of the residual in a whole step beyond which the search is lost.
pub(super) const GROWS: f64 = 100.0;
/// Share of its length by which a step has to shorten the residual.
pub(super) const SHORTENS: f64 = 1e-3;
/// Mean beyond which such a motion has left its contacts, relative to the motion: what stands on them goes about as far as it swings.
const AWAY: f64 = 10.0;
/// Shares of the stiffness of closed contacts that hold the mean back in a step which goes farther.
const HELD: [f64; 6] = [0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0];
/// Share of the residual that a step leaves which leads nearly to the solution.
const NEARLY: f64 = 0.1;
/// Mean motion of one step where contacts alone hold, relative to the motion, from which on other steps are tried.
const REACH: f64 = 2.0;
/// Multiplications of an evaluation, per sample and axis: transforms to and fro, and the law. Measured: 15 µs for 2048 samples.
const EVALUATED: f64 = 40.0;
/// The same of friction that falls with velocity, which is sought at six instants of a sample. Measured: 0.4 µs.
const EVALUATED_FALLING: f64 = 2000.0;
/// Steps of laws with a memory in one search, but for [`EVALUATIONS`] in any case. A search of one joint that is to end takes a few hundred
/// thousand; where a law is stiff these take ten seconds.
const MARCHED: usize = 3_000_000;
/// Evaluations of all laws that a search may take in any case: homotopies take hundreds.
const EVALUATIONS: usize = 800;
/// Periods that a law with a memory is followed for one of them, roughly.
const PERIODS: usize = 4;
/// Samples of a period that count for that: series of more are so long that a search of hundreds of evaluations would take minutes.
const SAMPLES: usize = 1024;
/// Products with the derivative that a step takes, roughly.
const PRODUCTS: f64 = 30.0;

/// Where a search ends.
#[derive(Debug, Clone, Copy)]
pub(super) enum Goal {
    /// Where the equations count as solved.
    Solved,
    /// At a residual, on the way by fewer samples.
    Rough(f64),
    /// At this share of the residual that it began with.
    Share(f64),
}

/// The search did not end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lost {
    pub iterations: usize,
    pub residual: f64,
    /// A resonance without damping, rad/s.
    pub resonance: Option<f64>,
    /// The mean went away from the contacts that alone hold it.
    pub away: bool,
}

impl Lost {
    /// After so many iterations, with this residual.
    pub fn after(iterations: usize, residual: f64) -> Self {
        Lost { iterations, residual, resonance: None, away: false }
    }

    /// By the structure alone.
    pub fn at(resonance: f64) -> Self {
        Lost { resonance: Some(resonance), ..Lost::after(0, f64::INFINITY) }
    }
}

impl Level {
    /// Newton's method. Where there is a sketch the way to the neighbourhood of the solution is gone with its samples, and from there with its
    /// derivatives; where that leads nowhere, with all samples.
    pub(super) fn newton(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut Solution,
        ease: Ease,
        (most, goal): (usize, Goal),
    ) -> Result<(), Lost> {
        if !self.sketches || self.sketch.is_none() {
            return self.search(ports, omega, motion, ease, (most, goal));
        }
        let start = motion.clone();
        let taken = (self.assembled, self.eliminated, self.products);
        self.exchange_samples();
        let rough = self.search(ports, omega, motion, ease, (most, Goal::Rough(self.rough())));
        if rough.is_ok() {
            // from where the motion repeats is known by these samples
            self.follow_slopes(ports, omega, motion, (ease, false));
            self.keeps_slopes = true;
        }
        self.exchange_samples();
        if rough.is_ok() && self.search(ports, omega, motion, ease, (most, goal)).is_ok() {
            return Ok(());
        }
        // once in a search, so that what it took is as much again at most
        let before = self.taken(ports).eliminated;
        (self.assembled, self.eliminated, self.products) = taken;
        self.spent.eliminated += before - self.taken(ports).eliminated;
        self.sketches = false;
        *motion = Solution { iterations: motion.iterations, ..start };
        self.search(ports, omega, motion, ease, (most, goal))
    }

    /// See [`ROUGH`].
    fn rough(&self) -> f64 {
        ROUGH * (SAMPLES as f64 / self.all_samples() as f64).powi(2).max(1.0)
    }

    /// Newton's method to a residual: the longest of the halved steps that comes closer, and where none does the whole one, which may lead out of a
    /// set of slipping samples that repeats. On the way by fewer samples one comes closer that is below the residuals of the last steps.
    fn search(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut Solution,
        ease: Ease,
        (most, goal): (usize, Goal),
    ) -> Result<(), Lost> {
        let rough = matches!(goal, Goal::Rough(_));
        let mut length = self.length(motion);
        self.nearby = self.sketches;
        let mut residual = self.evaluate(ports, omega, motion, ease, length, Slopes::Cheap);
        let solved = match goal {
            Goal::Solved => SOLVED,
            Goal::Rough(solved) => solved,
            Goal::Share(share) => SOLVED.max(share * residual),
        };
        let mut sketched = self.sketches && !rough;
        let mut kept = self.keeps_slopes && sketched;
        let mut rough_slopes = kept;
        let mut recent = [residual; REMEMBERED];
        let mut least = f64::INFINITY;
        // the residual that is to be halved, and for how long it was not
        let (mut mark, mut waited) = (residual, 0);
        // forces that wander are found by proximal points
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
            let near = Near { length, residual, sketched: rough_slopes || rough, kept };
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
                after = self.evaluate(ports, omega, motion, ease, length, Slopes::Cheap);
                if after < (1.0 - SHORTENS * fraction) * beaten || self.is_exhausted(ports) {
                    break;
                }
                if settles && halving == 0 && after.is_finite() {
                    // most contacts may be where the step leads them: those that are not take steps of their own
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
                // the motion was far from what it began with: its own size counts
                length = now;
                residual = self.evaluate(ports, omega, motion, ease, length, Slopes::Cheap);
                recent = [residual; REMEMBERED];
                least = f64::INFINITY;
            }
        }
        if residual > solved && least < f64::INFINITY {
            let iterations = motion.iterations;
            motion.c.clone_from(&self.best.c);
            motion.force.clone_from(&self.best.force);
            motion.iterations = iterations;
            residual = self.evaluate(ports, omega, motion, ease, length, Slopes::None);
        }
        self.nearby = false;
        self.keeps_slopes = false;
        motion.residual = residual;
        if residual <= solved || (waited > PATIENCE && residual <= ROUNDED) {
            Ok(())
        } else {
            Err(Lost { away: self.is_away(motion), ..Lost::after(motion.iterations, residual) })
        }
    }

    /// The Newton step from `self.before` into `self.step`. Where contacts alone hold a body, a step that opens all of them, or
    /// slips in all, knows of nothing that brings it back: one that leads the mean far is compared with those in which springs
    /// hold the mean where it is, from soft ones to stiff ones, and the one that leaves the least residual is taken.
    /// False if there is no step.
    fn bounded_step(&mut self, ports: &Ports, (omega, ease): (f64, Ease), motion: &mut Solution, at: Near) -> bool {
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
                // the residual of where the step begins; evaluations without derivatives leave these as they were
                motion.copy(&self.before);
                self.evaluate(ports, omega, motion, ease, at.length, Slopes::None);
                for (p, port) in ports.iter().enumerate() {
                    self.add_springs(p, port, share - held);
                }
                held = share;
                if !self.newton_step(ports, omega, ease, Near { kept: false, ..at }) {
                    break;
                }
            }
            self.advance(ports, motion, 1.0, at.length);
            let after = self.evaluate(ports, omega, motion, ease, at.length, Slopes::None);
            // a step that leads far away has to lead to the solution, or nearly so
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

    /// How far the step leads the mean along any axis, m.
    fn mean_step(&self, ports: &Ports, length: f64) -> f64 {
        let nh = self.harmonics().len();
        let motions = ports.iter().filter(|port| !port.is_force());
        motions.flat_map(|port| port.range()).map(|q| self.step[2 * q * nh].abs() * length).fold(0.0, f64::max)
    }

    /// How far motion on these contacts goes, m: static equilibrium, the motion without friction, the harmonics of this one.
    fn extent(&self, motion: &Solution) -> f64 {
        let nh = self.harmonics().len();
        let swing = motion.c.iter().enumerate().filter(|(i, _)| i % nh > 0).map(|(_, c)| c.norm());
        let still = self.at_rest(1.0).c.into_iter().step_by(nh).map(|c| c.norm());
        self.linear.iter().map(|c| c.norm()).chain(swing).chain(still).fold(0.0, f64::max)
    }

    /// Whether the mean of a motion that contacts alone hold has left them.
    fn is_away(&self, motion: &Solution) -> bool {
        let nh = self.harmonics().len();
        let mean = motion.c.iter().step_by(nh).fold(0.0, |m: f64, c| m.max(c.norm()));
        self.stands() && mean > AWAY * self.extent(motion)
    }

    /// What the present search has taken, relative to what one may take.
    pub(super) fn taken(&self, ports: &Ports) -> Work {
        let size = self.residual.len() as f64;
        let of_port =
            |port: &Port| port.axes as f64 * if port.least_penalty > 0.0 { EVALUATED_FALLING } else { EVALUATED };
        let evaluated = (self.all_samples() * self.assembled) as f64 * ports.iter().map(of_port).sum::<f64>();
        let (taken, one, fewest) = match self.sparse {
            Some(ref sparse) => (self.eliminated, sparse.work(self.harmonics().len()), FEWEST),
            // steps have the products that they take, and shortening them takes none
            None if self.coupled.is_some() => {
                (self.products, product_work(ports, self.harmonics().len()), FEWEST * PRODUCTS)
            }
            None => (self.eliminated, size * size * size / 3.0, FEWEST),
        };
        let counted = taken as f64 * one + if self.coupled.is_some() { 0.0 } else { evaluated };
        let most = if self.prolongs && ports.has_forces() { WORK } else { WORK.max(fewest * one) };
        let marched = EVALUATIONS * PERIODS * self.all_samples().min(SAMPLES) * ports.len();
        Work { eliminated: counted / most, marched: self.alternation.marched as f64 / MARCHED.max(marched) as f64 }
    }

    /// What all searches of the point have taken here.
    pub(super) fn taken_of_point(&self, ports: &Ports) -> Work {
        self.spent.and(self.taken(ports))
    }

    /// Whether the search has taken all the work that it may, or that its point may.
    pub(super) fn is_exhausted(&self, ports: &Ports) -> bool {
        self.taken(ports).is_beyond(SEARCH) || self.elsewhere.and(self.taken_of_point(ports)).is_beyond(self.allowed)
    }

    /// The Newton step into `self.step`, in the unknowns' units.
    pub(super) fn newton_step(&mut self, ports: &Ports, omega: f64, ease: Ease, near: Near) -> bool {
        self.eliminated += 1;
        if let Some(sparse) = &mut self.sparse {
            let along = Along { penalty: &self.penalty, ease };
            if !sparse.linearise(ports, &along, &self.tangents) {
                return false;
            }
        }
        self.newton_step_again(ports, omega, ease, near)
    }

    /// The same from another residual by the derivatives of the last step, whose factors there are in banded form.
    pub(super) fn newton_step_again(&mut self, ports: &Ports, omega: f64, ease: Ease, near: Near) -> bool {
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

    /// `self.before` less a fraction of the step, into `motion`.
    pub(super) fn advance(&self, ports: &Ports, motion: &mut Solution, fraction: f64, length: f64) {
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

    /// A motion near the solution that is near `start`, by fewer samples where there are such.
    pub fn approach(&mut self, ports: &Ports, omega: f64, start: &Solution) -> Option<Solution> {
        self.begin_anew(ports);
        let mut motion = Solution { iterations: 0, ..start.clone() };
        self.exchange_samples();
        let found = self.search(ports, omega, &mut motion, GIVEN, (ITERATIONS, Goal::Rough(self.rough())));
        self.exchange_samples();
        (found.is_ok() && !self.is_away(&motion)).then_some(motion)
    }

    /// The solution that Newton's method finds from `motion`, which is nearby.
    pub fn polish(&mut self, ports: &Ports, omega: f64, motion: &mut Solution, most: usize) -> Result<(), Lost> {
        self.begin_anew(ports);
        self.newton(ports, omega, motion, GIVEN, (most, Goal::Solved))
    }

    /// The solution, from `start`.
    pub fn solve(&mut self, ports: &Ports, omega: f64, start: Solution) -> Result<Solution, Lost> {
        self.solve_to(ports, omega, start, Goal::Solved)
    }

    /// The same where Newton's method leads there by itself to a goal.
    pub fn solve_to(&mut self, ports: &Ports, omega: f64, mut start: Solution, goal: Goal) -> Result<Solution, Lost> {
        start.iterations = 0;
        self.begin_anew(ports);
        let mut motion = start.clone();
        if self.newton(ports, omega, &mut motion, GIVEN, (ITERATIONS, goal)).is_ok() && !self.is_away(&motion) {
            return Ok(motion);
        }
        let mut nearest = f64::INFINITY;
        if ports.has_forces() {
            let iterations = motion.iterations;
            motion = Solution { iterations, ..start.clone() };
            if self.by_interior_points(ports, omega, &mut motion).is_ok() {
                return Ok(Solution { found_by: FoundBy::InteriorPoints, ..motion });
            }
            motion = Solution { iterations: motion.iterations, ..start };
            match self.by_proximal_points(ports, omega, &mut motion) {
                Ok(()) => return Ok(Solution { found_by: FoundBy::ProximalPoints, ..motion }),
                Err(lost) => nearest = lost.residual,
            }
        }
        let away = self.is_away(&motion);
        match self.lower_limits(ports, omega, &mut motion) {
            Ok(()) if !self.is_away(&motion) => Ok(Solution { found_by: FoundBy::SlipLimitHomotopy, ..motion }),
            Ok(()) => Err(Lost { away: true, ..Lost::after(motion.iterations, motion.residual) }),
            Err(lost) => Err(Lost { away: away || lost.away, residual: lost.residual.min(nearest), ..lost }),
        }
    }

    /// From slip limits that hold to those that are given.
    fn lower_limits(&mut self, ports: &Ports, omega: f64, motion: &mut Solution) -> Result<(), Lost> {
        let mut good = Solution { iterations: motion.iterations, ..self.unhindered() };
        let mut limits: f64 = 1.0;
        // where everything sticks the equations are linear
        let mut held = Err(Lost::after(good.iterations, f64::INFINITY));
        for attempt in 0..60 {
            limits *= 4.0;
            if attempt == 1 {
                // steep penalties, as of friction that falls with velocity, take far higher ones
                limits = limits.max(self.sticking(ports));
            }
            let iterations = good.iterations;
            good = match self.stands() {
                true => Solution { iterations, ..self.at_rest(limits) },
                false => Solution { iterations, ..self.unhindered() },
            };
            let most = if self.stands() { STICKS } else { ITERATIONS };
            held = self.newton(ports, omega, &mut good, Ease { limits, ..GIVEN }, (most, Goal::Solved));
            if held.is_ok() || self.is_exhausted(ports) || good.iterations - motion.iterations > MOST_RAISING {
                break;
            }
        }
        held?;
        let mut factor: f64 = 0.5;
        while limits > 1.0 {
            motion.copy(&good);
            let next = (limits * factor).max(1.0);
            let done = self.newton(ports, omega, motion, Ease { limits: next, ..GIVEN }, (ITERATIONS, Goal::Solved));
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
