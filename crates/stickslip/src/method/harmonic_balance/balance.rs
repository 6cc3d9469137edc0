//! The solver: searches for the harmonics of one orbit after the other.

use super::budget::{self, POINT, Work, is_affordable};
use super::equations::{self, Level, Solution};
use super::found_by::FoundBy;
use super::kept::Kept;
use super::options::{FIRST, HarmonicBalance, NAME, TOLERANCE};
use super::ports::Ports;
use super::recent::{RECENT, Recent};
use super::rest::Rest;
use super::solve::Lost;
use super::sparse::{self, Sparse};
use super::static_equilibrium::{SolvedEquilibrium, static_equilibrium};
use super::storage::{MEMORY, check_memory, level_memory};
use super::{coupled, path, work};
use crate::method::evidence::Judge;
use crate::method::guess::Guess;
use crate::method::{MethodError, OrbitError, Solver};
use crate::model::System;
use crate::orbit::{Course, Orbit};
use nalgebra::DVector;
use num_complex::Complex64;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Newton iterations from a neighbouring orbit, which take 2 to 5.
const NEARBY: usize = 20;
/// Laws of velocity begin with this many harmonics at most, and double them from there: the sets of slipping samples are then nearly
/// known.
const COLD: usize = 15;
/// Unknowns beyond which no error is estimated by elimination: one would take seconds, and a search takes ten and more.
pub(super) const LARGEST: usize = 2600;
/// Harmonics times axes squared up to which products with all of them take a tenth of a second, so that an error is estimated.
const ESTIMATED: f64 = 1e7;

/// The solver of a system.
pub(super) struct Balance {
    pub(super) system: Arc<System>,
    pub(super) method: HarmonicBalance,
    /// Periods of the drive in one of the motion; harmonics count those of the motion.
    pub(super) periods: usize,
    /// The drive's frequency, rad/s; that of the motion is `omega` everywhere here.
    pub(super) drive: f64,
    /// Of a ring in a travelling wave those of the first sector.
    pub(super) ports: Ports,
    /// And those of the whole ring.
    pub(super) around: Option<Ports>,
    pub(super) rest: Rest,
    /// One harmonic in banded form, of which the others need multiples, if that is the system's.
    pub(super) banded: Option<Sparse>,
    pub(super) kept: Kept,
    pub(super) first: usize,
    /// Whether a law was met whose force samples see as a jump.
    pub(super) steep: bool,
    pub(super) judge: Judge,
    /// The state of static equilibrium: displacements, velocities (zero), states of the joints.
    pub(super) static_start: Option<Vec<f64>>,
    pub(super) levels: BTreeMap<usize, Level>,
    /// Points in a row, the last ones, whose searches took long and found nothing, see [`budget::ENOUGH`].
    pub(super) in_vain: usize,
    /// The last orbits, the newest first.
    pub(super) recent: VecDeque<Recent>,
    /// A state, perhaps of none of these, from which others are sought, and its frequency, rad/s.
    pub(super) begun: Option<(f64, Vec<f64>)>,
    /// Frequencies (rad/s) at which the motion was followed and no orbit was found, and what it did.
    pub(super) followed: Vec<(f64, Course, Vec<f64>)>,
    /// How often it was followed to find one.
    pub(super) tried_in_time: usize,
    /// By the highest harmonic, of many contacts the last solution that was compared with one of twice the harmonics, and that.
    pub(super) compared: BTreeMap<usize, [Solution; 2]>,
}

impl Balance {
    pub(super) fn new(system: System, method: HarmonicBalance, periods: usize) -> Result<Self, MethodError> {
        let kept = if periods > 1 {
            Kept::slowed(&system, periods)
        } else {
            Kept::new(&system, |z| z != Complex64::new(0.0, 0.0))
        };
        method.check(kept.highest)?;
        if let Some(error) = MethodError::empty(NAME, &system) {
            return Err(error);
        }
        let (mut ports, mut around) = Ports::of_sector(&system)?;
        let rest = Rest::new(&system, &ports);
        let system = Arc::new(system);
        let first = (FIRST * kept.scale).max(kept.highest);
        let harmonics = kept.up_to(method.harmonics.unwrap_or(first));
        let banded = Sparse::new(&system, &ports, &[1]);
        let steep = ports.has_steep();
        let samples = method.samples_at(method.harmonics.unwrap_or(first), &ports, steep);
        let bytes = level_memory(banded.as_ref(), &ports, &rest, (harmonics.len(), samples));
        check_memory(bytes, &ports, (harmonics.len(), periods))?;
        let mut static_start = None;
        if kept.has(0)
            && let Some(SolvedEquilibrium { orbit, states }) =
                static_equilibrium(&system, (&ports, around.as_ref()), &rest)
        {
            ports.begin_at(&states);
            around.iter_mut().for_each(|around| around.begin_at(&states));
            static_start = Some(orbit.start);
        }
        Ok(Balance {
            method,
            periods,
            drive: 0.0,
            ports,
            around,
            rest,
            banded,
            kept,
            first,
            steep,
            judge: Judge::new(&system),
            system,
            static_start,
            levels: BTreeMap::new(),
            in_vain: 0,
            recent: VecDeque::new(),
            begun: None,
            followed: Vec::new(),
            tried_in_time: 0,
            compared: BTreeMap::new(),
        })
    }

    /// The level of highest harmonic `top`, ready for `omega`.
    ///
    /// # Errors
    /// A resonance without damping.
    pub(super) fn level(&mut self, top: usize, omega: f64) -> Result<&mut Level, Lost> {
        let harmonics = self.kept.up_to(top);
        let samples = self.method.samples_at(top, &self.ports, self.steep);
        let (system, ports) = (&self.system, &self.ports);
        let level = self.levels.entry(top).or_insert_with(|| {
            let sparse = Sparse::new(system, ports, &harmonics);
            Level::new(harmonics, samples, ports, sparse)
        });
        level.drive(&self.system, &self.ports, &self.rest, omega).map_err(Lost::at)?;
        let elsewhere = self.taken(Some(top));
        let allowed = self.allowed();
        let level = self.levels.get_mut(&top).expect("made above");
        (level.elsewhere, level.allowed) = (elsewhere, allowed);
        Ok(level)
    }

    /// Begins a point.
    pub(super) fn begin_point(&mut self, drive: f64) {
        self.drive = drive;
        self.levels.values_mut().for_each(Level::begin_point);
    }

    /// What the searches of the point have taken, but those with harmonics up to one number.
    pub(super) fn taken(&self, but: Option<usize>) -> Work {
        let counted = self.levels.iter().filter(|(top, _)| but != Some(**top));
        counted.map(|(_, level)| level.taken_of_point(&self.ports)).fold(Work::default(), Work::and)
    }

    /// What the searches of the point may take.
    fn allowed(&self) -> Work {
        budget::allowed_after(self.in_vain)
    }

    /// Whether they have taken all that they may.
    pub(super) fn is_spent(&self) -> bool {
        self.taken(None).is_beyond(self.allowed())
    }

    /// Ends a point: what the next one may take.
    fn end_point(&mut self, found: Result<Orbit, OrbitError>) -> Result<Orbit, OrbitError> {
        match &found {
            Ok(_) => self.in_vain = 0,
            Err(_) if self.taken(None).is_beyond(POINT.times(budget::ENOUGH)) => self.in_vain += 1,
            Err(_) => {}
        }
        found
    }

    /// Whether a solution with twice the harmonics takes no more than seconds, of a point that has taken so much.
    pub(super) fn can_compare(&self, top: usize, taken: Work) -> bool {
        let harmonics = self.kept.up_to(self.kept.double(top)).len();
        let axes = self.ports.count();
        let products = (harmonics * axes * axes) as f64;
        let size = 2 * axes * harmonics;
        let multiplied = coupled::by_products(size, &self.ports) && products <= ESTIMATED;
        let few = match &self.banded {
            Some(_) => true,
            None => size <= LARGEST || multiplied,
        };
        let bounded = self.banded.is_some() || self.ports.has_forces();
        let affordable =
            !bounded || is_affordable(work::step(self.banded.as_ref(), &self.ports, harmonics), taken, self.allowed());
        // it is compared with twice the samples, too
        let samples = 2 * self.method.samples_at(self.kept.double(top), &self.ports, self.steep);
        let fits = level_memory(self.banded.as_ref(), &self.ports, &self.rest, (harmonics, samples)) <= MEMORY;
        few && affordable && fits
    }

    /// Solves at `top`, from a motion at another number of harmonics or from the first guess. Where that shows that a law is steep, it is solved by the
    /// samples that such laws need, as is all that follows.
    pub(super) fn solve(&mut self, top: usize, omega: f64, from: Option<(usize, &Solution)>) -> Result<Solution, Lost> {
        let motion = self.solve_as_known(top, omega, from)?;
        if self.steep || !self.levels[&top].jumps(&self.ports, &motion) {
            return Ok(motion);
        }
        self.steep = true;
        self.levels.clear();
        self.compared.clear();
        self.solve_as_known(top, omega, Some((top, &motion)))
    }

    fn solve_as_known(&mut self, top: usize, omega: f64, from: Option<(usize, &Solution)>) -> Result<Solution, Lost> {
        let start = match from {
            Some((other, motion)) => {
                let harmonics = self.kept.up_to(other);
                equations::transfer(motion, &harmonics, self.level(top, omega)?.harmonics())
            }
            None if self.ports.has_forces() && top > COLD * self.kept.scale && top / 2 >= self.first => {
                let coarse = self.solve(top / 2, omega, None)?;
                return self.solve(top, omega, Some((top / 2, &coarse)));
            }
            None => {
                // the guess solves the whole structure densely: large systems begin without friction
                let guess = (self.system.dofs() < sparse::GUESSED).then(|| Guess::new(&self.system, omega));
                self.level(top, omega)?;
                let begun = self.levels[&top].begin(&self.system, &self.ports, guess.as_ref(), omega);
                self.approached(top, omega, guess.as_ref()).unwrap_or(begun)
            }
        };
        let level = self.levels.get_mut(&top).expect("made above");
        level.solve(&self.ports, omega, start)
    }

    pub(super) fn lost(&self, lost: Lost) -> OrbitError {
        if let Some(resonance) = lost.resonance {
            return OrbitError::Resonance { method: NAME, omega: self.drive, resonance };
        }
        if lost.away {
            return OrbitError::drift(NAME, self.drive);
        }
        OrbitError::NotConverged {
            method: NAME,
            omega: self.drive,
            iterations: lost.iterations,
            residual: lost.residual,
            spent: self.is_spent(),
            instead: String::new(),
        }
    }

    /// Harmonics of the places.
    pub(super) fn places(
        &mut self,
        top: usize,
        omega: f64,
        motion: &Solution,
    ) -> Result<Vec<DVector<Complex64>>, Lost> {
        path::places(self.levels.get_mut(&top).expect("solved"), &self.rest, omega, motion).map_err(Lost::at)
    }

    /// The orbit of a solution with its evidence; the next searches begin with it.
    pub(super) fn finish(
        &mut self,
        top: usize,
        omega: f64,
        motion: Solution,
        x: Vec<DVector<Complex64>>,
        truncation: Option<f64>,
    ) -> Result<Orbit, OrbitError> {
        let orbit = self.orbit_of(top, omega, &motion, x, truncation)?;
        self.recent.truncate(RECENT - 1);
        self.recent.push_front(Recent { start: orbit.start.clone(), omega, top, motion });
        Ok(orbit)
    }

    /// The orbit of a solution with its evidence.
    pub(super) fn orbit_of(
        &mut self,
        top: usize,
        omega: f64,
        motion: &Solution,
        x: Vec<DVector<Complex64>>,
        truncation: Option<f64>,
    ) -> Result<Orbit, OrbitError> {
        let setting = path::Setting {
            system: &self.system,
            ports: &self.ports,
            around: self.around.as_ref(),
            omega,
            first: self.periods,
            odd: self.kept.half_period(),
            truncation,
            tolerance: self.method.tolerance.unwrap_or(TOLERANCE),
            judge: Some(&mut self.judge),
        };
        let level = self.levels.get_mut(&top).expect("solved");
        let orbit = path::orbit(setting, level, motion, x).ok_or(OrbitError::drift(NAME, self.drive))?;
        if !path::balances(&self.system, &orbit) {
            let lost = Lost::after(motion.iterations, orbit.evidence.energy_gap);
            return Err(self.lost(lost));
        }
        Ok(Orbit { omega: self.drive, periods: self.periods, ..orbit })
    }

    /// The solution near another one, without an estimate of its error, and without the long ways of [`Level::solve`]: a search that asks
    /// for it can do without.
    pub(super) fn nearby(&mut self, top: usize, omega: f64, near: &Solution) -> Result<Orbit, OrbitError> {
        self.level(top, omega).map(|_| ()).map_err(|l| self.lost(l))?;
        let mut motion = Solution { iterations: 0, ..near.clone() };
        let level = self.levels.get_mut(&top).expect("made above");
        let mut found = level.polish(&self.ports, omega, &mut motion, NEARBY);
        if found.is_err() && self.ports.has_forces() {
            motion = Solution { iterations: motion.iterations, ..near.clone() };
            found = level.by_interior_points(&self.ports, omega, &mut motion);
            motion.found_by = FoundBy::InteriorPoints;
            if found.is_err() {
                motion = Solution { iterations: motion.iterations, ..near.clone() };
                found = level.by_proximal_points(&self.ports, omega, &mut motion);
                motion.found_by = FoundBy::ProximalPoints;
            }
        }
        found.map_err(|l| self.lost(l))?;
        let x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        self.finish(top, omega, motion, x, None)
    }

    /// The user's number of harmonics, or as many as are needed, from `first` on.
    pub(super) fn from(
        &mut self,
        first: usize,
        omega: f64,
        warm: Option<(usize, Solution)>,
    ) -> Result<Orbit, OrbitError> {
        match self.method.harmonics {
            Some(top) => self.fixed(top, omega, warm),
            None => self.chosen(first, omega, warm),
        }
    }

    /// Whether a search begins on the line through the last two motions: of many contacts, and of elastic ones where motions do not separate, so that whatever
    /// it begins with leads to the same orbit. Rigid friction jumps from one set of slipping samples to the next.
    pub(super) fn goes_ahead(&self, top: usize) -> bool {
        let unique = self.judge.proves() && !self.ports.has_forces();
        unique || self.levels.get(&top).is_some_and(Level::is_coupled)
    }

    /// Where a search begins: with an orbit of its own; where several orbits exist, with what the state of another solver's orbit leads to.
    pub(super) fn near(&mut self, start: Option<&[f64]>, omega: f64) -> Option<(usize, Solution)> {
        let foreign = start.filter(|start| self.recent.iter().all(|recent| recent.start != *start));
        let led = foreign.filter(|_| omega.is_finite() && omega > 0.0).and_then(|start| self.led(start, omega));
        led.or_else(|| self.warm(start, omega))
    }

    /// Which of the last orbits has this start.
    fn same(&self, start: &[f64]) -> Option<usize> {
        self.recent.iter().position(|recent| recent.start == start)
    }

    /// Which of the last orbits knows what harmonics one beside `start` needs: that one itself, or one of them that is nearer than it.
    fn neighbour(&self, start: &[f64], omega: f64) -> Option<usize> {
        let distance = |at: &usize| (self.recent[*at].omega - omega).abs();
        let nearer = || {
            let (from, _) = self.begun.as_ref().filter(|(_, begun)| begun == start)?;
            let nearest = (0..self.recent.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            (distance(&nearest) <= (from - omega).abs()).then_some(nearest)
        };
        self.same(start).or_else(nearer)
    }

    /// The harmonics of a neighbouring orbit are at hand if it is one of the last; any of these is nearer than a guess.
    pub(super) fn warm(&self, start: Option<&[f64]>, omega: f64) -> Option<(usize, Solution)> {
        self.warm_by(self.same(start?).unwrap_or(0), omega)
    }

    /// Those of one of the last orbits.
    fn warm_by(&self, at: usize, omega: f64) -> Option<(usize, Solution)> {
        let near = self.recent.get(at)?;
        let before = self.recent.iter().skip(at + 1).find(|recent| recent.top == near.top);
        let motion = match before {
            Some(before) if self.goes_ahead(near.top) => near.towards(before, omega),
            _ => near.motion.clone(),
        };
        Some((near.top, Solution { found_by: FoundBy::Newton, ..motion }))
    }
}

impl Solver for Balance {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        self.begin_point(omega);
        let omega = omega / self.periods as f64;
        let warm = self.near(start, omega);
        let found = match self.from(self.first, omega, warm) {
            Err(error @ (OrbitError::NotConverged { .. } | OrbitError::Drift { .. })) => {
                self.by_its_course(omega).unwrap_or_else(|| self.by_time(omega).ok_or(error))
            }
            found => found,
        };
        let mut found = found;
        if let Ok(orbit) = &mut found {
            orbit.evidence.history_spread = self.history_spread(orbit, omega);
        }
        self.end_point(found)
    }

    fn between(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        let at = omega / self.periods as f64;
        let known = start.filter(|_| omega.is_finite() && omega > 0.0).and_then(|start| self.neighbour(start, at));
        match known.and_then(|known| self.warm_by(known, at)) {
            // the harmonics that the neighbour needed are enough
            Some((top, motion)) => {
                self.begin_point(omega);
                let found = self.nearby(top, at, &motion);
                self.end_point(found)
            }
            // what another orbit needed, far away or of another solver, tells nothing
            _ => self.orbit(omega, start),
        }
    }

    fn begin_at(&mut self, omega: f64, start: &[f64]) {
        self.begun = Some((omega / self.periods as f64, start.to_vec()));
    }

    fn effort(&self) -> f64 {
        let Work { eliminated, marched } = self.taken(None);
        (eliminated / POINT.eliminated).max(marched / POINT.marched)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Coulomb;
    use crate::method::Method;
    use crate::method::event_driven::EventDriven;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, example};

    /// At the end of a curve the joint sticks, and few harmonics are enough: an orbit that is sought back at its peak, where it slips, has as many as it
    /// needs there. It had those of the last orbit, and was 2.4 % too low.
    #[test]
    fn a_peak_that_is_sought_after_the_curve_has_its_own_harmonics() {
        let spring = |on: &str, stiffness, damping| Spring { between: [on.into(), GROUND.into()], stiffness, damping };
        let model = Model {
            masses: vec![Mass::new("a", 1.0), Mass::new("d", 0.2)],
            springs: vec![spring("a", 1e4, 1.0), spring("d", 500.0, 0.1)],
            joints: vec![Joint {
                name: "j".into(),
                between: ["a".into(), "d".into()],
                law: Arc::new(Coulomb { limit: 1.436_363_636_363_64 }),
            }],
            forces: vec![Force { on: "a".into(), amplitude: 2.0, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let rate = |hertz: f64| std::f64::consts::TAU * hertz;
        let mut solver = HarmonicBalance::default().solver(&system).unwrap();
        let mut starts: Vec<Vec<f64>> = Vec::new();
        for i in 0..21 {
            let start = starts.last().map(Vec::as_slice);
            starts.push(solver.orbit(rate(12.0 + 0.35 * f64::from(i)), start).unwrap().start);
        }
        solver.begin_at(rate(15.85), &starts[11]);
        let between = solver.between(rate(15.7276), Some(&starts[11])).unwrap();
        let exact = EventDriven.solver(&system).unwrap().orbit(rate(15.7276), None).unwrap();
        let error = (between.places[0].amplitude() / exact.places[0].amplitude() - 1.0).abs();
        assert!(error < 1e-3, "{error:.1e} with {:?} harmonics", between.evidence.harmonics);
    }

    /// Points that take long in vain leave less to those that follow, and an orbit gives it back.
    #[test]
    fn points_in_vain_leave_less_to_the_next() {
        let system = example::blade_couple_massless().assemble().unwrap();
        let mut balance = Balance::new(system, HarmonicBalance::default(), 1).unwrap();
        let omega = std::f64::consts::TAU * 121.0;
        let vain = |balance: &mut Balance, marched: usize| {
            balance.begin_point(omega);
            balance.level(7, omega).unwrap().alternation.marched = marched;
            balance.end_point(Err(OrbitError::Frequency { omega })).unwrap_err();
            balance.allowed()
        };
        assert_eq!([0, usize::MAX / 2, 0].map(|marched| vain(&mut balance, marched)), [POINT; 3]);
        let less = vain(&mut balance, usize::MAX / 2);
        assert_eq!(less, POINT.times(budget::ENOUGH));
        assert_eq!(balance.level(7, omega).unwrap().allowed, less);
        assert!(balance.effort() > 1.0);
        balance.orbit(omega, None).unwrap();
        assert_eq!(balance.allowed(), POINT);
        assert!(balance.effort() > 0.0 && balance.effort() < 1e-3, "{}", balance.effort());
    }
}
