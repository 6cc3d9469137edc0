//! Harmonic balance: the orbit as a Fourier series, friction sampled over the period.
//!
//! - `ports`: from the harmonics of relative motions to those of the laws' forces, with the exact derivative;
//! - `rest`: the receptance of the linear rest, in closed form from its modes;
//! - `closed`: the mean of bodies that nothing but contacts holds;
//! - `equations`: those along the joints, and their derivative;
//! - `linear`: their derivative as a matrix; `coupled`: steps by its products;
//! - `solve`: Newton's method on them; `estimate`: the error by a finer solution; `sampling`: what samples leave out; `interior`: all rigid joints at once;
//!   `proximal`: the way to forces that nothing decides;
//! - `path`: the orbit's numbers from its harmonics.
//!
//! The unknowns are the harmonics of the joints' relative motions, or of their forces where the velocity alone decides them: the cost
//! follows joints and harmonics, not degrees of freedom. Only multiples of the excitation's common divisor occur, and only the odd ones if
//! it has no others. The error of a solution is estimated from a second one with twice the harmonics.
//! Source: Krack and Gross, "Harmonic Balance for Nonlinear Vibration Problems" (2019); Cameron and Griffin (1989).

mod arc;
mod branch;
mod budget;
mod closed;
mod coupled;
mod ease;
mod equations;
mod estimate;
mod hold;
mod interior;
mod kept;
mod linear;
mod mode;
mod open;
mod path;
mod ports;
mod proximal;
mod receptance;
mod rest;
mod sampling;
mod solve;
mod sparse;
mod uncoupled;
mod work;

use super::guess::Guess;
use super::{Method, MethodError, MethodInfo, MethodOption, Options, OrbitError, PERIOD, Solver, periods};
use crate::dimension::Dimension;
use crate::method::course::course;
use crate::method::evidence::Judge;
use crate::method::repeated::Afresh;
use crate::model::System;
use crate::orbit::{Course, JointSample, Orbit, Path};
pub(crate) use arc::{ModeArc, Step as ModeStep};
pub(crate) use branch::BranchEquations;
use budget::{POINT, Work, is_affordable};
use equations::{Level, Solution};
use estimate::{Compared, estimate};
use kept::Kept;
pub(crate) use mode::{LinearMode, ModeEquations, ModeState};
use nalgebra::DVector;
use num_complex::Complex64;
use ports::{Port, Ports};
use rest::Rest;
use sampling::{samples_for, samples_of_steps};
use solve::{Goal, Lost};
use sparse::Sparse;
use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::TAU;
use std::sync::Arc;
pub use work::{doubling_work, factor_bytes, most_work, orbit_work, step_work};

/// Its name in study files.
pub const NAME: &str = "harmonic-balance";

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "Fourier series along the joints, friction sampled over the period, with an error estimate",
    options: &[
        MethodOption {
            key: "harmonics",
            dimension: Dimension::NONE,
            count: true,
            doc: "highest harmonic; absent: doubled until the estimated error is below `tolerance`",
        },
        MethodOption {
            key: "samples",
            dimension: Dimension::NONE,
            count: true,
            doc: "samples per period, even, at least 4 (harmonics + 1), and 16 per harmonic if `harmonics` is absent; absent: 16 per \
                  harmonic, at least 1024, and 128 per harmonic for steep laws and for friction in a plane; fewer for laws in steps, such as contacts \
                  that part, where `tolerance` is above 0.001",
        },
        MethodOption {
            key: "tolerance",
            dimension: Dimension::NONE,
            count: false,
            doc: "error of the motion relative to the largest amplitude: aimed at when `harmonics` is absent, and beyond it a \
                  point is `truncated`; 0.001",
        },
        PERIOD,
    ],
    build: |options| {
        let balance = HarmonicBalance::from_options(options)?;
        Ok(match periods(NAME, options)? {
            1 => Box::new(balance),
            period => Box::new(Subharmonic { balance, period }),
        })
    },
};

/// Tolerance when none is given.
const TOLERANCE: f64 = 1e-3;
/// First number of harmonics when none is given.
const FIRST: usize = 7;
/// Highest harmonic that the program chooses itself; it is checked with twice as many.
const MOST: usize = 511;
/// Newton iterations from a neighbouring orbit, which take 2 to 5.
const NEARBY: usize = 20;
/// Frequencies without an orbit at which the motion is followed, for seconds each, to say what it does; of a sweep in every one of its blocks.
const MOST_FOLLOWED: usize = 8;
/// Degrees of freedom up to which it is followed to find an orbit: steps of integrations multiply full matrices.
const MOST_DOFS_IN_TIME: usize = 60;
/// Orbits whose harmonics are kept as starts for their neighbours: those between which a peak is refined.
const RECENT: usize = 8;
/// Distance from the last frequency, relative to that between the last two, up to which many contacts begin on the line through both motions.
const AHEAD: f64 = 1.5;
/// Unknowns beyond which no error is estimated by elimination: one would take seconds, and a search takes ten and more.
const LARGEST: usize = 2600;
/// Memory of the equations, bytes, beyond which nothing is begun: 1000 nodes of three directions with five harmonics need half of it without modes.
const MEMORY: f64 = 4e9;
/// Harmonics times axes squared up to which products with all of them take a tenth of a second, so that an error is estimated.
const ESTIMATED: f64 = 1e7;
/// Laws of velocity begin with this many harmonics at most, and double them from there: the sets of slipping samples are then nearly
/// known.
const COLD: usize = 15;
/// Power of the number of harmonics by which the error of rigid friction falls at most: no series is refused that may be long enough. Between 1 and 3/2 are
/// usual, see [`estimate`]; 80 masses left 3.0e-3 with 31 harmonics and less than 1e-3 with 63.
const ORDER: f64 = 2.0;
/// Where friction is rigid or steep, one doubling is not believed to have left less than this share of the distance of the one before: two
/// motions may be near each other by chance, as 1.3e-3 where the error is 1e-2.
const CHANCE: f64 = 0.1;
/// Share of the residual that a shorter series leaves in the longer one to which that is solved for an estimate of the error: the estimate is off by about as
/// much of itself. One step of Newton's method leaves less where friction is elastic, so that the second one is spared.
const KNOWN: f64 = 1e-3;
/// Samples per period, at least, and per harmonic. Sliders and stops need them to tell turning points apart only; laws with a memory
/// need as many as [`samples_for`] the tolerance.
const SAMPLES: usize = 1024;
const SAMPLES_PER_HARMONIC: usize = 16;
/// The same for laws that are steep or turn in a plane, whose samples place a change of sign to a sample only: they then grow with the
/// harmonics, so that the longer series sees what the samples of the shorter one missed.
const SAMPLES_OF_STEEP: usize = 128;

/// Harmonic balance.
///
/// # Example
/// ```
/// use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
/// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
/// let method = HarmonicBalance { harmonics: Some(15), ..HarmonicBalance::default() };
/// let orbit = method.solver(&system).unwrap().orbit(std::f64::consts::TAU * 121.0, None).unwrap();
/// assert!(orbit.evidence.truncation.unwrap() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HarmonicBalance {
    /// Highest harmonic; chosen by the estimated error if absent.
    pub harmonics: Option<usize>,
    /// Samples per period; chosen if absent.
    pub samples: Option<usize>,
    /// Error relative to the largest amplitude: aimed at when `harmonics` is absent; an orbit beyond it is [`Accuracy::Truncated`].
    ///
    /// [`Accuracy::Truncated`]: crate::orbit::Accuracy::Truncated
    pub tolerance: Option<f64>,
}

impl HarmonicBalance {
    fn from_options(options: &Options) -> Result<Self, MethodError> {
        let count = |key: &str| options.get(key).map(|value| *value as usize);
        let method = HarmonicBalance {
            harmonics: count("harmonics"),
            samples: count("samples"),
            tolerance: options.get("tolerance").copied(),
        };
        method.check(0)?;
        Ok(method)
    }

    /// Whether it has a port for every law of a system.
    pub(crate) fn takes_laws(system: &System) -> bool {
        Ports::new(system).is_ok()
    }

    /// Samples at a number of harmonics: what the user gave holds for the user's harmonics; the solution that checks it takes as many as
    /// it needs, so that too few are seen in the estimate.
    fn samples_at(&self, top: usize, ports: &Ports) -> usize {
        let each = if ports.has_steep() { SAMPLES_OF_STEEP } else { SAMPLES_PER_HARMONIC };
        let remembered = ports.iter().any(Port::marches);
        let tolerance = self.tolerance.unwrap_or(TOLERANCE);
        let steps = !ports.is_empty() && ports.iter().all(Port::steps);
        let (few, least) = match remembered {
            true if steps => (samples_of_steps(tolerance), 0),
            true => (samples_for(tolerance), SAMPLES),
            false => (0, SAMPLES),
        };
        let needed = (each * (top + 1)).max(few).next_power_of_two();
        match (self.samples, self.harmonics) {
            (Some(samples), Some(harmonics)) if top <= harmonics => samples,
            (Some(samples), Some(_)) => samples.max(needed).max(least),
            (Some(samples), None) => samples.max(needed),
            (None, _) => needed.max(least),
        }
    }

    /// Whether the options fit each other and excitation up to harmonic `highest`.
    fn check(&self, highest: usize) -> Result<(), MethodError> {
        let option = |key, message| Err(MethodError::Option { method: NAME, key, message });
        if let Some(harmonics) = self.harmonics
            && (harmonics < highest.max(1) || harmonics > 10_000)
        {
            let least = highest.max(1);
            return option("harmonics", format!("must be {least} (the excitation's) to 10000, found {harmonics}"));
        }
        if let Some(samples) = self.samples {
            let least = 4 * (self.harmonics.unwrap_or(FIRST.max(highest)) + 1);
            if samples < least || samples % 2 == 1 {
                return option("samples", format!("must be even and at least {least}, found {samples}"));
            }
        }
        if let Some(tolerance) = self.tolerance
            && !(tolerance > 0.0 && tolerance < 1.0)
        {
            return option("tolerance", format!("must be between 0 and 1, found {tolerance}"));
        }
        Ok(())
    }
}

/// What there may be less of: a motion of several periods of the drive has as many times the harmonics.
fn fewer(periods: usize) -> (&'static str, &'static str) {
    if periods > 1 { (PERIOD.key, "fewer periods, ") } else { ("harmonics", "") }
}

/// Whether what equations with so many harmonics need, `bytes`, fits into memory.
fn check_memory(bytes: f64, ports: &Ports, (harmonics, periods): (usize, usize)) -> Result<(), MethodError> {
    if bytes <= MEMORY {
        return Ok(());
    }
    let (key, fewer) = fewer(periods);
    let message = format!(
        "the equations of {} directions of joints and {harmonics} harmonics would fill {:.0} GB, and {:.0} are allowed: {fewer}fewer harmonics, or fewer joints",
        ports.count(),
        1e-9 * bytes,
        1e-9 * MEMORY
    );
    Err(MethodError::Option { method: NAME, key, message })
}

/// Memory of a level that is not banded, bytes: derivatives of the ports; receptances and their factors, or modes along the axes with the factor of
/// what most of them add; and where a matrix may be formed, that.
fn memory(ports: &Ports, rest: &Rest, harmonics: usize, always: bool) -> f64 {
    let (axes, pair) = (ports.count() as f64, 2.0 * harmonics as f64);
    let size = pair * axes;
    let structure = match rest.modes_for(ports).filter(|_| !always) {
        Some(structure) => structure.at.len() as f64 + 3.0 * axes * axes,
        None => 4.0 * harmonics as f64 * axes * axes,
    };
    // whoever needs it in any case has it beside a factor of it and that of the step before
    let formed = match always {
        true => 3.0 * size * size,
        false if size <= coupled::FORMED as f64 => size * size,
        false => 0.0,
    };
    tangents(ports, harmonics) + 8.0 * (structure + formed)
}

/// Memory of a level, bytes; of one in banded form if one harmonic of that is given.
fn level_memory(banded: Option<&Sparse>, ports: &Ports, rest: &Rest, harmonics: usize) -> f64 {
    match banded {
        Some(banded) => tangents(ports, harmonics) + banded.memory(harmonics),
        None => memory(ports, rest, harmonics, false),
    }
}

/// Memory of the derivatives of the ports, bytes.
fn tangents(ports: &Ports, harmonics: usize) -> f64 {
    8.0 * ports.iter().map(|port| (2.0 * (harmonics * port.axes) as f64).powi(2)).sum::<f64>()
}

impl Method for HarmonicBalance {
    fn name(&self) -> &'static str {
        NAME
    }
    fn closes_motions(&self, _system: &System) -> bool {
        false
    }
    fn prepare<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        Ok(Box::new(Balance::new(system.clone(), *self, 1)?))
    }
}

/// Harmonic balance for motions that repeat after several periods of the drive: a series of its fraction.
///
/// # Example
/// Friction at a constant limit allows no other motion than one that repeats with the drive, and that is found.
/// ```
/// use stickslip::method::{Method, harmonic_balance::{HarmonicBalance, Subharmonic}};
/// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
/// let method = Subharmonic { balance: HarmonicBalance { harmonics: Some(7), ..HarmonicBalance::default() }, period: 3 };
/// let orbit = method.solver(&system).unwrap().orbit(std::f64::consts::TAU * 121.0, None).unwrap();
/// assert_eq!(orbit.periods, 3);
/// assert!((orbit.place("blade1").unwrap().first_harmonic.norm() / orbit.places[0].amplitude() - 1.0).abs() < 0.01);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Subharmonic {
    /// Its options; harmonics and samples count for one period of the drive.
    pub balance: HarmonicBalance,
    /// Periods of the drive after which the motion repeats.
    pub period: usize,
}

impl Method for Subharmonic {
    fn name(&self) -> &'static str {
        NAME
    }
    fn closes_motions(&self, _system: &System) -> bool {
        false
    }
    fn prepare<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let highest = Kept::new(system, |z| z != Complex64::new(0.0, 0.0)).highest;
        self.balance.check(highest)?;
        let (period, times) = (self.period.max(1), |count: usize| count.saturating_mul(self.period.max(1)));
        let too_high = |_| MethodError::Option {
            method: NAME,
            key: PERIOD.key,
            message: format!("{period} periods of harmonic {highest} are more than can be counted"),
        };
        u32::try_from(times(highest)).map_err(too_high)?;
        let HarmonicBalance { harmonics, samples, tolerance } = self.balance;
        let balance = HarmonicBalance { harmonics: harmonics.map(times), samples: samples.map(times), tolerance };
        let slowed = system.slowed(u32::try_from(period).map_err(too_high)?);
        Ok(Box::new(Afresh(Balance::new(slowed, balance, period)?)))
    }
}

/// An orbit that was found.
struct Recent {
    /// Its state at t = 0.
    start: Vec<f64>,
    omega: f64,
    /// Its highest harmonic.
    top: usize,
    motion: Solution,
}

impl Recent {
    /// The motion at a frequency on the line through this one and the one before, up to [`AHEAD`] times as far.
    fn towards(&self, before: &Recent, omega: f64) -> Solution {
        let share = (omega - self.omega) / (self.omega - before.omega);
        let mut motion = self.motion.clone();
        if share.abs() <= AHEAD {
            let line = |now: &mut [Complex64], before: &[Complex64]| {
                now.iter_mut().zip(before).for_each(|(now, before)| *now += (*now - before) * share);
            };
            line(&mut motion.c, &before.motion.c);
            line(&mut motion.force, &before.motion.force);
        }
        motion
    }
}

struct Balance {
    system: Arc<System>,
    method: HarmonicBalance,
    /// Periods of the drive in one of the motion; harmonics count those of the motion.
    periods: usize,
    /// The drive's frequency, rad/s; that of the motion is `omega` everywhere here.
    drive: f64,
    /// Of a ring in a travelling wave those of the first sector.
    ports: Ports,
    /// And those of the whole ring.
    around: Option<Ports>,
    rest: Rest,
    /// One harmonic in banded form, of which the others need multiples, if that is the system's.
    banded: Option<Sparse>,
    kept: Kept,
    first: usize,
    judge: Judge,
    levels: BTreeMap<usize, Level>,
    /// The last orbits, the newest first.
    recent: VecDeque<Recent>,
    /// Frequencies (rad/s) at which the motion was followed and no orbit was found, and what it did.
    followed: Vec<(f64, Course)>,
    /// How often it was followed to find one.
    tried_in_time: usize,
    /// By the highest harmonic, of many contacts the last solution that was compared with one of twice the harmonics, and that.
    compared: BTreeMap<usize, [Solution; 2]>,
}

impl Balance {
    fn new(system: System, method: HarmonicBalance, periods: usize) -> Result<Self, MethodError> {
        let kept = if periods > 1 {
            Kept::slowed(&system, periods)
        } else {
            Kept::new(&system, |z| z != Complex64::new(0.0, 0.0))
        };
        method.check(kept.highest)?;
        let (ports, around) = Ports::of_sector(&system)?;
        let rest = Rest::new(&system, &ports);
        let first = (FIRST * kept.scale).max(kept.highest);
        let harmonics = kept.up_to(method.harmonics.unwrap_or(first));
        let banded = Sparse::new(&system, &ports, &[1]);
        let bytes = level_memory(banded.as_ref(), &ports, &rest, harmonics.len());
        check_memory(bytes, &ports, (harmonics.len(), periods))?;
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
            judge: Judge::new(&system),
            system: Arc::new(system),
            levels: BTreeMap::new(),
            recent: VecDeque::new(),
            followed: Vec::new(),
            tried_in_time: 0,
            compared: BTreeMap::new(),
        })
    }
}

impl Balance {
    /// The level of highest harmonic `top`, ready for `omega`.
    ///
    /// # Errors
    /// A resonance without damping.
    fn level(&mut self, top: usize, omega: f64) -> Result<&mut Level, Lost> {
        let harmonics = self.kept.up_to(top);
        let samples = self.method.samples_at(top, &self.ports);
        let (system, ports) = (&self.system, &self.ports);
        let level = self.levels.entry(top).or_insert_with(|| {
            let sparse = Sparse::new(system, ports, &harmonics);
            Level::new(harmonics, samples, ports, sparse)
        });
        level.drive(&self.system, &self.ports, &self.rest, omega).map_err(Lost::at)?;
        let elsewhere = self.taken(Some(top));
        let level = self.levels.get_mut(&top).expect("made above");
        level.elsewhere = elsewhere;
        Ok(level)
    }

    /// Begins a point.
    fn begin_point(&mut self, drive: f64) {
        self.drive = drive;
        self.levels.values_mut().for_each(Level::begin_point);
    }

    /// What the searches of the point have taken, but those with harmonics up to one number.
    fn taken(&self, but: Option<usize>) -> Work {
        let counted = self.levels.iter().filter(|(top, _)| but != Some(**top));
        counted.map(|(_, level)| level.taken_of_point(&self.ports)).fold(Work::default(), Work::and)
    }

    /// Whether they have taken all that they may.
    fn is_spent(&self) -> bool {
        self.taken(None).is_beyond(POINT)
    }

    /// Whether a solution with twice the harmonics takes no more than seconds, of a point that has taken so much.
    fn can_compare(&self, top: usize, taken: Work) -> bool {
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
        let affordable = !bounded || is_affordable(work::step(self.banded.as_ref(), &self.ports, harmonics), taken);
        few && affordable && level_memory(self.banded.as_ref(), &self.ports, &self.rest, harmonics) <= MEMORY
    }

    /// Solves at `top`, from a motion at another number of harmonics or from the first guess.
    fn solve(&mut self, top: usize, omega: f64, from: Option<(usize, &Solution)>) -> Result<Solution, Lost> {
        let start = match from {
            Some((other, motion)) => {
                let harmonics = self.levels[&other].harmonics().to_vec();
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

    /// A start near a motion that repeats after several periods: the describing functions know none, and Newton's method would never leave those
    /// that repeat after one. So the motion is followed in time for a while, if some flow follows the system; where motions do not separate there is
    /// none to be found.
    fn approached(&mut self, top: usize, omega: f64, guess: Option<&Guess>) -> Option<Solution> {
        let start = guess.filter(|_| self.periods > 1 && !self.judge.proves())?.state(self.system.dofs());
        let path = self.judge.approach(&self.system, omega, start)?;
        self.series_of(&*path, top, omega)
    }

    /// Where the search has found no orbit: from the motion that rest comes to in time, `None` where it is not followed. Of frequencies at which there is
    /// more than one orbit it leads to one that attracts.
    fn by_time(&mut self, omega: f64) -> Option<Orbit> {
        // twice the harmonics, since with few of them there may be a motion that leads nowhere
        let top = self.method.harmonics.unwrap_or(self.kept.double(self.first));
        if self.periods > 1 || self.system.dofs() > MOST_DOFS_IN_TIME || self.tried_in_time >= MOST_FOLLOWED {
            return None;
        }
        self.tried_in_time += 1;
        self.level(top, omega).ok()?;
        let path = self.judge.approach(&self.system, omega, vec![0.0; 2 * self.system.dofs()])?;
        let warm = Some((top, self.series_of(&*path, top, omega)?));
        self.from(top, omega, warm).ok()
    }

    /// The harmonics of a motion that was followed over a period.
    fn series_of(&mut self, path: &dyn Path, top: usize, omega: f64) -> Option<Solution> {
        let level = self.levels.get_mut(&top)?;
        let (nh, n) = (level.harmonics().len(), level.alternation.samples());
        let mut motion = Solution::rest(level.linear.len());
        let samples: Vec<_> = (0..n).map(|i| path.sample(TAU / omega * i as f64 / n as f64).joints).collect();
        for port in self.ports.iter() {
            for q in port.range() {
                let (joint, axis) = self.ports.place(q);
                // what does the work of all
                let work = |now: &[JointSample]| -> f64 {
                    port.members.iter().map(|member| member.factor * now[member.joint].force[axis]).sum()
                };
                let force: Vec<f64> = samples.iter().map(|now| work(now)).collect();
                let moved = samples.iter().zip(&force).map(|(now, f)| now[joint].displacement[axis] - f * port.series);
                let range = q * nh..(q + 1) * nh;
                level.alternation.add_signal(&mut moved.collect::<Vec<f64>>(), &mut motion.c[range.clone()]);
                level.alternation.add_signal(&mut force.clone(), &mut motion.force[range]);
            }
        }
        Some(motion)
    }

    fn lost(&self, lost: Lost) -> OrbitError {
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
    fn places(&mut self, top: usize, omega: f64, motion: &Solution) -> Result<Vec<DVector<Complex64>>, Lost> {
        path::places(self.levels.get_mut(&top).expect("solved"), &self.rest, omega, motion).map_err(Lost::at)
    }

    fn finish(
        &mut self,
        top: usize,
        omega: f64,
        motion: Solution,
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
        let orbit = path::orbit(setting, level, &motion, x).ok_or(OrbitError::drift(NAME, self.drive))?;
        if !path::balances(&self.system, &orbit) {
            let lost = Lost::after(motion.iterations, orbit.evidence.energy_gap);
            return Err(self.lost(lost));
        }
        self.recent.truncate(RECENT - 1);
        self.recent.push_front(Recent { start: orbit.start.clone(), omega, top, motion });
        Ok(Orbit { omega: self.drive, periods: self.periods, ..orbit })
    }

    /// The solution near another one, without an estimate of its error, and without the long ways of [`Level::solve`]: a search that asks
    /// for it can do without.
    fn nearby(&mut self, top: usize, omega: f64, near: &Solution) -> Result<Orbit, OrbitError> {
        self.level(top, omega).map(|_| ()).map_err(|l| self.lost(l))?;
        let mut motion = Solution { iterations: 0, ..near.clone() };
        let level = self.levels.get_mut(&top).expect("made above");
        let mut found = level.polish(&self.ports, omega, &mut motion, NEARBY);
        if found.is_err() && self.ports.has_forces() {
            motion = Solution { iterations: motion.iterations, ..near.clone() };
            found = level.by_interior_points(&self.ports, omega, &mut motion);
            if found.is_err() {
                motion = Solution { iterations: motion.iterations, ..near.clone() };
                found = level.by_proximal_points(&self.ports, omega, &mut motion);
            }
        }
        found.map_err(|l| self.lost(l))?;
        let x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        self.finish(top, omega, motion, x, None)
    }

    /// The user's number of harmonics, with an estimate of its error.
    fn fixed(&mut self, top: usize, omega: f64, warm: Option<(usize, Solution)>) -> Result<Orbit, OrbitError> {
        let motion = self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.lost(l))?;
        let x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        let truncation = if self.can_compare(top, Work::default()) {
            // what was asked for is there: its error may take as much again
            self.levels.values_mut().for_each(Level::begin_point);
            self.compare(top, omega, &motion, &x).ok().map(|(error, _)| error)
        } else {
            None
        };
        self.finish(top, omega, motion, x, truncation)
    }

    /// Error of `motion` by one with twice the harmonics, and of laws with a memory with twice the samples too, which is returned.
    fn compare(
        &mut self,
        top: usize,
        omega: f64,
        motion: &Solution,
        x: &[DVector<Complex64>],
    ) -> Result<(f64, Solution), Lost> {
        let double = self.kept.double(top);
        let start = self.refined(top, motion);
        let (few, many) = (self.kept.up_to(top), self.kept.up_to(double));
        let coarse = equations::transfer(motion, &few, &many);
        let shorter = self.levels.get(&top).and_then(|level| level.derivatives(&self.ports));
        self.level(double, omega)?;
        let finer = self.levels.get_mut(&double).expect("made above");
        finer.prolongs = true;
        let goal = if self.ports.iter().any(Port::marches) { Goal::Solved } else { Goal::Share(KNOWN) };
        let better = match finer.approach_by_twice_the_samples(&self.ports, omega, &start, &coarse, shorter.as_ref()) {
            Some(better) => better,
            None => {
                let solved = finer.solve_to(&self.ports, omega, start, goal)?;
                finer.by_twice_the_samples(&self.ports, omega, &solved, &coarse).map_or(solved, |(motion, _)| motion)
            }
        };
        if finer.is_coupled() {
            self.compared.insert(top, [motion.clone(), better.clone()]);
        }
        let y = self.places(double, omega, &better)?;
        let finer = self.levels.get_mut(&double).expect("solved");
        let coarse = Compared { harmonics: &few, places: x, along: &motion.c };
        let at = (self.kept, omega);
        let error = estimate(self.system.seen(), &self.ports, &self.rest, at, &coarse, (finer, &better, &y));
        Ok((error, better))
    }

    /// A start with twice the harmonics: a solution, and what these added to the last one that was compared.
    fn refined(&self, top: usize, motion: &Solution) -> Solution {
        let harmonics = |top: usize| self.kept.up_to(top);
        let (few, many) = (harmonics(top), harmonics(self.kept.double(top)));
        let mut start = equations::transfer(motion, &few, &many);
        if let Some([coarse, fine]) = self.compared.get(&top) {
            let coarse = equations::transfer(coarse, &few, &many);
            let add = |to: &mut [Complex64], coarse: &[Complex64], fine: &[Complex64]| {
                to.iter_mut().zip(fine.iter().zip(coarse)).for_each(|(to, (fine, coarse))| *to += fine - coarse);
            };
            add(&mut start.c, &coarse.c, &fine.c);
            add(&mut start.force, &coarse.force, &fine.force);
        }
        start
    }

    /// The first of the doubled numbers of harmonics that may leave no more than the tolerance of rigid friction, where `top` leave so many times as much.
    fn needed(&self, top: usize, times: f64) -> usize {
        let least = top as f64 * times.powf(1.0 / ORDER);
        let doubled = std::iter::successors(Some(top), |top| Some(self.kept.double(*top)));
        doubled.skip(1).find(|top| *top as f64 >= least || *top > MOST * self.kept.scale).expect("they grow")
    }

    /// As many harmonics as the tolerance needs. The solution that is returned is not the finest that was found, but the one whose error
    /// is known from it.
    fn chosen(&mut self, mut top: usize, omega: f64, warm: Option<(usize, Solution)>) -> Result<Orbit, OrbitError> {
        let tolerance = self.method.tolerance.unwrap_or(TOLERANCE);
        let first = top;
        let mut motion = self.solve(top, omega, warm.as_ref().map(|(t, m)| (*t, m))).map_err(|l| self.lost(l))?;
        let mut x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        // nothing is known of the error until two solutions can be compared
        let (mut checked, mut estimate) = (top, 1.0);
        let mut needed = None;
        while top <= MOST * self.kept.scale && self.can_compare(top, self.taken(None)) {
            let (mut error, finer) = match self.compare(top, omega, &motion, &x) {
                Ok(compared) => compared,
                // what was found has an error that is known
                Err(_) if top > first && self.ports.has_forces() => {
                    needed = self.is_spent().then(|| self.kept.double(top));
                    break;
                }
                Err(_) if top > first && !self.is_spent() => break,
                Err(lost) => return Err(self.lost(lost)),
            };
            if (self.ports.has_forces() || self.ports.has_steep()) && top > first {
                error = error.max(CHANCE * estimate);
            }
            // where friction falls with velocity chance is frequent: the first distance has none before it that would show it
            let shown = top > first || !self.ports.has_falling();
            if error <= tolerance && shown {
                return self.finish(top, omega, motion, x, Some(error));
            }
            (checked, estimate) = (top, error);
            if self.ports.has_forces() && top > first {
                let enough = self.needed(top, error / tolerance);
                if !self.can_compare(enough, self.taken(None)) {
                    needed = Some(enough);
                    break;
                }
            }
            top = self.kept.double(top);
            // the finer one is solved as far as the error asks for, or by other samples
            motion = self.solve(top, omega, Some((top, &finer))).map_err(|l| self.lost(l))?;
            x = self.places(top, omega, &motion).map_err(|l| self.lost(l))?;
        }
        let harmonics = checked / self.periods;
        Err(OrbitError::Truncation {
            method: NAME,
            omega: self.drive,
            harmonics,
            needed: needed.map(|needed| needed / self.periods),
            estimate,
            tolerance,
            instead: String::new(),
        })
    }
}

impl Balance {
    /// The user's number of harmonics, or as many as are needed, from `first` on.
    fn from(&mut self, first: usize, omega: f64, warm: Option<(usize, Solution)>) -> Result<Orbit, OrbitError> {
        match self.method.harmonics {
            Some(top) => self.fixed(top, omega, warm),
            None => self.chosen(first, omega, warm),
        }
    }

    /// Where contacts alone hold, and no orbit was found: the motion from rest leads to one, or shows what there is instead. `None` where it is
    /// not followed.
    fn by_its_course(&mut self, omega: f64) -> Option<Result<Orbit, OrbitError>> {
        let top = self.method.harmonics.unwrap_or(self.first);
        let vibrates = self.system.harmonics_of_excitation(|z| z != Complex64::ZERO).iter().any(|h| *h > 0);
        if self.periods > 1 || !vibrates || !self.levels.get(&top)?.stands() {
            return None;
        }
        let drive = self.drive;
        let no_orbit = |course| Some(Err(OrbitError::NoOrbit { method: NAME, omega: drive, course }));
        if let Some((_, course)) = self.followed.iter().find(|(at, _)| *at == omega) {
            return no_orbit(course.clone());
        }
        if self.followed.len() >= MOST_FOLLOWED {
            return None;
        }
        let (course, path) = course(&self.system, omega)?;
        if matches!(course, Course::Settles | Course::Settling { .. })
            && let Some(motion) = self.series_of(&*path, top, omega)
            && let Ok(orbit) = self.from(top, omega, Some((top, motion)))
        {
            return Some(Ok(orbit));
        }
        self.followed.push((omega, course.clone()));
        no_orbit(course)
    }

    /// Whether a search begins on the line through the last two motions: of many contacts, and of elastic ones where motions do not separate, so that whatever
    /// it begins with leads to the same orbit. Rigid friction jumps from one set of slipping samples to the next.
    fn goes_ahead(&self, top: usize) -> bool {
        let unique = self.judge.proves() && !self.ports.has_forces();
        unique || self.levels.get(&top).is_some_and(Level::is_coupled)
    }

    /// The harmonics of a neighbouring orbit are at hand if it is one of the last; any of these is nearer than a guess.
    fn warm(&self, start: Option<&[f64]>, omega: f64) -> Option<(usize, Solution)> {
        let start = start?;
        let same = self.recent.iter().position(|recent| recent.start == start);
        let near = self.recent.get(same.unwrap_or(0))?;
        let before = self.recent.iter().skip(same.unwrap_or(0) + 1).find(|recent| recent.top == near.top);
        let motion = match before {
            Some(before) if self.goes_ahead(near.top) => near.towards(before, omega),
            _ => near.motion.clone(),
        };
        Some((near.top, motion))
    }
}

impl Solver for Balance {
    fn orbit(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        if !(omega.is_finite() && omega > 0.0) {
            return Err(OrbitError::Frequency { omega });
        }
        self.begin_point(omega);
        let omega = omega / self.periods as f64;
        let warm = self.warm(start, omega);
        match self.from(self.first, omega, warm) {
            Err(error @ (OrbitError::NotConverged { .. } | OrbitError::Drift { .. })) => {
                let by_time = |balance: &mut Self| balance.by_time(omega).ok_or(error);
                self.by_its_course(omega).unwrap_or_else(|| by_time(self))
            }
            found => found,
        }
    }

    fn between(&mut self, omega: f64, start: Option<&[f64]>) -> Result<Orbit, OrbitError> {
        match self.warm(start, omega / self.periods as f64) {
            // the harmonics that the neighbour needed are enough
            Some((top, motion)) if omega.is_finite() && omega > 0.0 => {
                self.begin_point(omega);
                self.nearby(top, omega / self.periods as f64, &motion)
            }
            _ => self.orbit(omega, start),
        }
    }
}
