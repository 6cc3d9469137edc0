//! How much a study will hold and how long it will take, by counting: rows, columns, orbits; and by what each method was
//! measured to need. How many of these a study has, its kind says.

use crate::error::{Problem, StudyError};
use crate::extra;
use crate::farther;
use crate::study::{Case, Study};
use crate::survey::{Surveyed, range};
use crate::thinning::MOST_ROWS;
use crate::words::bytes_text;
use crate::work::AHEAD;
use std::collections::BTreeSet;
use std::f64::consts::{LN_10, TAU};
use stickslip::curve::sweep::BLOCK;
use stickslip::law::SharedLaw;
use stickslip::method::{Method, auto::Auto, event_driven, evidence_steps, harmonic_balance};
use stickslip::model::System;

/// What a study will hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Size {
    /// Rows of its tables.
    pub rows: u64,
    /// Its tables as numbers of eight bytes.
    pub results: u64,
    /// Most memory at one time, bytes, of a run that writes its tables while it goes on: rough.
    pub memory: u64,
    /// The same of a run that keeps them all.
    pub whole: u64,
}

/// Bytes of a number in a table.
const NUMBER: f64 = 8.0;
/// Bytes of a word in a table: its handle, and its own piece of memory.
const WORD: f64 = 56.0;
/// Bytes of a cell as text of a CSV file. Measured: 85 for three numbers and a word.
const WRITTEN: f64 = 20.0;
/// Bytes of a point of a figure, in the dataset and drawn in all formats. Measured: 220 in HTML.
const DRAWN: f64 = 240.0;
/// Bytes of an orbit of an exact law, per entry of its state and per switch; and of a smooth law per entry. Measured:
/// exact 8 kB for the couple and 170 kB for 8 masses and joints, smooth 80 kB and 600 kB.
const ORBIT_ENTRY: f64 = 500.0;
const SMOOTH_ENTRY: f64 = 24_000.0;
/// Bytes of a series while it is sought, per harmonic coefficient of a place or joint. Measured: 15 kB for the couple,
/// 130 kB for 8 masses and joints, at 15 harmonics.
const SERIES_ENTRY: f64 = 80.0;
/// Bytes of the samples of a joint's forces and contact over a period. Measured: a ring of 480 blades and joints with seven harmonics takes
/// 87 MB on two threads, those that are about to be solved included.
const SERIES_SAMPLES: f64 = 40.0 * 1024.0;
/// Bytes of a complex coefficient: of the motion that an orbit keeps, one for every harmonic, the mean and the state at its start, of every degree of
/// freedom; of its equations, along the directions of a joint.
const COEFFICIENT: f64 = 16.0;
const DIRECTIONS: f64 = 3.0;
/// Bytes of what is measured of a place, with its name.
const MEASURED: f64 = 100.0;
/// Samples per period for which those of the joints were measured.
const SAMPLED: f64 = 1024.0;
/// Numbers, per entry of a full matrix, of a method that follows the motion in time: three of the structure, its inverse mass, and the return
/// map with its products, of twice as many rows.
const IN_TIME: f64 = 16.0;
/// Bytes of the motion at one instant, per mass and joint.
const SAMPLE: f64 = 64.0;
/// Points that a curve with adaptive frequencies takes, per case. Measured: 100 to 600 at tolerances of 1 %.
const ADAPTIVE: f64 = 300.0;
/// Points per period, per joint, that are there beside those that were asked for: the switches.
const SWITCHES: f64 = 4.0;

/// A table to be: rows and columns.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shape {
    /// Rows.
    pub rows: f64,
    /// Columns of numbers and flags.
    pub numbers: f64,
    /// Columns of words.
    pub words: f64,
}

/// What a study of a kind costs; the kind says it.
#[derive(Debug, Default)]
pub struct Cost {
    /// Its tables.
    pub tables: Vec<Shape>,
    /// Points of figures.
    pub drawn: f64,
    /// What one unit of work keeps while it is computed, beside its tables, bytes. Of the units only as many are computed at a time as
    /// there are threads; the tables of those that wait are counted with the tables.
    pub unit: f64,
    /// Time of the methods on one thread, s.
    pub work: f64,
    /// How much of it there is only where the results ask for it, s, and where it is spared, in words.
    pub spared: Option<(f64, &'static str)>,
}

/// What is known of a study when its cost is asked: counts, and what one orbit takes. The first case stands for all.
#[derive(Debug, Clone)]
pub struct Costing<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its first case.
    pub case: &'a Case,
    /// Cases.
    pub cases: f64,
    /// Frequencies of a case; of adaptive ones how many they are likely to be.
    pub frequencies: f64,
    /// Varied parameters, a column each.
    pub varied: f64,
    /// Degrees of freedom, a few for each mass.
    pub masses: f64,
    /// Places that results are given at: of masses every degree of freedom.
    pub places: f64,
    /// Joints.
    pub joints: f64,
    /// Sliders of the joints that have any, one for every other joint.
    sliders: f64,
    surveyed: &'a Surveyed,
    /// Whether a law is smooth, or made so, and whether one has internal states, which makes the flow stiff.
    smooth: bool,
    has_states: bool,
    /// Whether a law has no rate: integration then goes in equal steps.
    stepped: bool,
    /// Whether friction falls with velocity somewhere.
    falls: bool,
    /// Whether nothing bounds the force of a law.
    unbounded: bool,
    /// Whether the method of the study finds series of harmonics.
    series: bool,
    /// Memory of a factor of the dynamic stiffness in all rows, bytes; zero where none is made. To know it of a large structure takes seconds.
    factor_bytes: f64,
    pace: Pace,
}

/// How hard orbits are to find.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pace {
    /// As they mostly are.
    Usual,
    /// Where many are not found, or only after long searches.
    Slow,
}

impl Pace {
    fn of<T>(self, usual: T, slow: T) -> T {
        match self {
            Pace::Usual => usual,
            Pace::Slow => slow,
        }
    }
}

/// Whether the method of a case finds series of harmonics.
fn finds_series(case: &Case, system: &System) -> bool {
    match case.method.name.as_str() {
        "harmonic-balance" => true,
        "auto" => Auto.choice(system).method == harmonic_balance::NAME,
        _ => false,
    }
}

impl<'a> Costing<'a> {
    /// Of a study whose orbits are hard to find.
    pub(crate) fn new(study: &'a Study, surveyed: &'a Surveyed) -> Self {
        let (case, system) = (&surveyed.case, surveyed.survey.system());
        // a width makes exact laws smooth
        let width = case.method.options.get("width");
        let followed = |law: &SharedLaw| width.and_then(|width| law.regularised(*width)).unwrap_or_else(|| law.clone());
        let laws: Vec<SharedLaw> = system.joints().iter().map(|joint| followed(joint.law())).collect();
        let given = case.frequencies.as_ref().map_or(1, |f| f.len()) as f64;
        let series = finds_series(case, system);
        let factor_bytes = if series { harmonic_balance::factor_bytes(system) } else { 0 };
        Costing {
            study,
            case,
            cases: study.cases() as f64,
            frequencies: if study.is_adaptive() { ADAPTIVE } else { given },
            varied: case.varied.len() as f64,
            masses: system.dofs() as f64,
            places: system.places().len() as f64,
            joints: system.joints().len() as f64,
            sliders: laws.iter().map(|law| law.sliders().map_or(1, |all| all.len().max(1)) as f64).sum(),
            surveyed,
            smooth: laws.iter().any(|law| law.pieces().is_none()),
            stepped: laws.iter().any(|law| law.rate().is_none() && !law.is_free()),
            falls: laws.iter().any(|law| law.prox().is_some() && !law.is_incrementally_passive()),
            unbounded: laws.iter().any(|law| law.scale().is_infinite()),
            has_states: laws.iter().any(|law| law.rate().is_some_and(|rate| rate.states() > 0)),
            series,
            factor_bytes: factor_bytes as f64,
            pace: Pace::Slow,
        }
    }

    /// Of the same study, where orbits are as easy to find as they mostly are.
    pub(crate) fn usual(&self) -> Self {
        Costing { pace: Pace::Usual, ..self.clone() }
    }

    /// The system of the first case.
    pub fn system(&self) -> &System {
        self.surveyed.survey.system()
    }

    /// Cases times frequencies.
    pub fn points(&self) -> f64 {
        self.cases * self.frequencies
    }

    /// Groups of cases that differ in the last parameter of `vary` only.
    pub fn curves(&self) -> f64 {
        self.cases / self.study.last_varied().max(1) as f64
    }

    /// The column of the frequency, where a table has it for several frequencies only.
    pub fn several(&self) -> f64 {
        if self.frequencies > 1.0 { 1.0 } else { 0.0 }
    }

    /// A table with a row for each of `rows` orbits: frequency, amplitude, mean and phase of each mass, dissipation and slip of each joint,
    /// what `output` asks for, evidence, status.
    pub fn orbits(&self, rows: f64) -> Shape {
        let extra = extra::columns(self.case, self.system()).len() as f64;
        let numbers = self.varied + 3.0 * self.places + 2.0 * self.joints + extra + 6.0;
        Shape { rows, numbers, words: 1.0 }
    }

    /// A table with a row for each of `rows` instants: time and frequency, displacement and velocity of each mass, three of each joint and
    /// its contact.
    pub fn motion(&self, rows: f64) -> Shape {
        Shape { rows, numbers: self.varied + 2.0 + 2.0 * self.places + 3.0 * self.joints, words: self.joints }
    }

    /// Instants of a period in a table: `samples` steps, both ends, and the switches.
    pub fn instants(&self) -> f64 {
        self.case.values.count("samples").unwrap_or(720) as f64 + 1.0 + SWITCHES * self.joints
    }

    /// Peaks of a place between the first and the last frequency that resonances make: each lifts the frequency that is nearest to it. Usually there
    /// are as many as both with all joints free and with all stuck, at most as many as with either. `None` where the resonances or the frequencies are
    /// not known.
    pub fn resonances(&self) -> Option<f64> {
        let given = self.case.frequencies.as_ref().filter(|_| !self.study.is_adaptive())?;
        let survey = &self.surveyed.survey;
        let all: Vec<Vec<f64>> = if survey.is_too_large() {
            vec![survey.system().reduced()?.frequencies().to_vec()]
        } else {
            [survey.free(), survey.stuck()].map(|modes| modes.elastic.iter().map(|mode| mode.omega).collect()).into()
        };
        let inner = |omega: &f64| {
            let above = given.count_below(*omega);
            let below = above.checked_sub(1)?;
            let nearest = if omega - given.get(below)? < given.get(above)? - omega { below } else { above };
            (nearest > 0 && nearest + 1 < given.len()).then_some(nearest)
        };
        let peaks = || all.iter().map(|modes| modes.iter().filter_map(inner).collect::<BTreeSet<_>>().len());
        self.pace.of(peaks().min(), peaks().max()).map(|peaks| peaks as f64)
    }

    /// Lowest and highest drive frequency, rad/s.
    pub fn range(&self) -> Option<(f64, f64)> {
        range(self.case)
    }

    /// Lowest natural frequency with all joints stuck, rad/s; zero if there is none.
    pub fn slowest_mode(&self) -> f64 {
        self.surveyed.survey.stuck().elastic.first().map_or(0.0, |mode| mode.omega)
    }

    /// Bytes of the orbits that a unit of frequencies keeps at a time.
    pub fn kept_orbits(&self) -> f64 {
        let orbits = self.frequencies.min(BLOCK as f64);
        if self.is_series() {
            let option = |name: &str, default: f64| self.case.method.options.get(name).copied().unwrap_or(default);
            let kept = self.kept_series_bytes(option("harmonics", SERIES_HARMONICS), option("samples", SAMPLED));
            return orbits * kept + self.orbit_bytes();
        }
        orbits * self.orbit_bytes()
    }

    /// Bytes of an orbit that is a series of so many harmonics, once it is found. Measured: 1.0 MB for a ring of 12 sectors with 1188 coordinates and 12
    /// joints of three directions, at 15 harmonics.
    pub fn kept_series_bytes(&self, harmonics: f64, samples: f64) -> f64 {
        let coefficients = (harmonics + 2.0) * (self.masses + DIRECTIONS * self.joints);
        COEFFICIENT * coefficients + MEASURED * self.places + SERIES_SAMPLES * samples / SAMPLED * self.joints
    }

    /// Bytes of an orbit in memory.
    pub fn orbit_bytes(&self) -> f64 {
        let state = 2.0 * self.masses + self.joints + 1.0;
        if self.is_series() {
            let harmonics = self.case.method.options.get("harmonics").copied().unwrap_or(SERIES_HARMONICS);
            return self.series_bytes(harmonics) + SERIES_SAMPLES * self.joints;
        }
        let matrices = IN_TIME * NUMBER * self.masses * self.masses;
        matrices + if self.smooth { SMOOTH_ENTRY * state } else { ORBIT_ENTRY * state * (2.0 + SWITCHES * self.joints) }
    }

    /// Whether the method of the study finds series of harmonics.
    pub fn is_series(&self) -> bool {
        self.series
    }

    /// Bytes of the motion at the instants of one period.
    pub fn samples_bytes(&self) -> f64 {
        self.instants() * SAMPLE * (2.0 + self.masses + self.joints)
    }

    /// Bytes that a series of so many harmonics takes while it is sought.
    pub fn series_bytes(&self, harmonics: f64) -> f64 {
        SERIES_ENTRY * (2.0 * harmonics + 1.0) * (2.0 * self.masses + 4.0 * self.joints)
    }
}

impl Cost {
    fn rows(&self) -> f64 {
        self.tables.iter().map(|table| table.rows).sum()
    }

    fn cells(&self, number: f64, word: f64) -> f64 {
        self.tables.iter().map(|table| table.rows * (number * table.numbers + word * table.words)).sum()
    }

    /// The same, of no more rows than a figure shows.
    fn shown(&self, number: f64, word: f64) -> f64 {
        let rows = |table: &Shape| table.rows.min(MOST_ROWS as f64);
        self.tables.iter().map(|table| rows(table) * (number * table.numbers + word * table.words)).sum()
    }
}

impl Costing<'_> {
    /// Size of a study of this cost whose work is cut into so many units.
    pub(crate) fn size(&self, cost: &Cost, units: usize) -> Size {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let tables = cost.cells(NUMBER + WRITTEN, WORD + WRITTEN);
        // units wait for their turn; of the tables as many rows are read back as a figure shows
        let waiting = tables * ((AHEAD * threads) as f64 / units.max(1) as f64).min(1.0);
        let shown = cost.shown(NUMBER + WRITTEN, WORD + WRITTEN);
        let drawn = DRAWN * cost.drawn.min(MOST_ROWS as f64 * (self.places + self.joints));
        let factor = self.factor_bytes;
        let factors = factor + (KEPT_FACTORS.0 * factor).min(KEPT_FACTORS.1);
        let working = units.min(threads) as f64 * (cost.unit + factors);
        // a float that is too large for the type becomes its largest value
        let whole = |value: f64| value as u64;
        Size {
            rows: whole(cost.rows()),
            results: whole(cost.cells(NUMBER, NUMBER)),
            memory: whole(tables.min(waiting + shown) + drawn + working),
            whole: whole(tables + drawn + working),
        }
    }

    /// Rough time of a study of this cost on one thread, s.
    pub(crate) fn seconds(&self, cost: &Cost) -> f64 {
        let elements = self.masses + self.joints;
        // the modes of large models are not asked for
        let modes = if self.surveyed.survey.is_too_large() { 0.0 } else { MODES * self.masses.powi(3) };
        let preparing = self.cases * (PREPARING + modes + ASSEMBLING * elements);
        let writing = CELL * cost.cells(1.0, 1.0);
        OVERHEAD + GENEROUS * (cost.work + self.matrices() + self.again() + preparing + writing + POINT * cost.drawn)
    }

    /// Time to bring a structure by its matrices into few coordinates, s, which all cases share.
    fn matrices(&self) -> f64 {
        let reduced = self.system().reduced().and(self.case.model.substructure.as_ref());
        let rows = reduced.map_or(0.0, |substructure| substructure.component.dofs() as f64);
        MATRICES.0 * rows.powf(MATRICES.1) + SEEN * rows * self.places
    }

    /// Time to solve points again where joints slip on a structure in few coordinates, s.
    fn again(&self) -> f64 {
        let Some(reduced) = self.system().reduced() else { return 0.0 };
        let rows = self.case.model.substructure.as_ref().map_or(0, |own| own.component.dofs());
        let harmonics = self.case.method.options.get("harmonics").filter(|_| self.is_series());
        let highest = harmonics.zip(self.range()).map(|(harmonics, (_, drive))| harmonics * drive);
        let within = highest.is_some_and(|highest| highest <= reduced.up_to());
        if self.joints == 0.0 || within || rows > farther::ROWS || !self.study.kind().uses_method {
            return 0.0;
        }
        AGAIN.0 * self.matrices() + AGAIN.1 * farther::count(self.points(), self.cases) * self.orbit()
    }
}

// ------------------------------------------------------------------------------------------ the limit

impl Size {
    /// Why a study is not run that needs so much memory, if that is more than it may take.
    pub(crate) fn refusal(&self, study: &Study, memory: u64) -> Option<StudyError> {
        let limit = study.memory_limit();
        if memory <= limit {
            return None;
        }
        let message = format!(
            "this would need about {} of memory for {} rows of results; the limit is {}",
            bytes_text(memory),
            self.rows,
            bytes_text(limit)
        );
        let lengths = ["samples", "samples_per_cycle", "cycles", "duration", "steps"].into_iter();
        let given: Vec<String> =
            lengths.filter(|key| study.study.entry(key).is_some()).map(|key| format!("lower `{key}`, ")).collect();
        let fewer = if study.points() > study.cases() { "take fewer frequencies, " } else { "" };
        let split = if study.cases() > 1 { "split `vary` over several files, " } else { "" };
        let help = format!("{}{fewer}{split}or allow more with --memory", given.concat());
        // at what makes most of it
        let place = match (study.varied.first(), study.points() / study.cases().max(1)) {
            (Some(varied), frequencies) if study.cases() >= frequencies => &varied.location,
            _ => study.study.location_of("frequency", None),
        };
        Some(StudyError::at(&study.sources, Problem::new(place, "memory", message).help(help)))
    }
}

// ------------------------------------------------------------------------------------------ time

/// The estimates are of one core of 2020 and are doubled: too long rather than too short.
const GENEROUS: f64 = 2.0;
/// Reading, drawing and writing, s.
const OVERHEAD: f64 = 0.2;
/// Work on a row of a table and its text, per cell, s. Measured: 0.4 s for 200,000 rows of ten.
const CELL: f64 = 3e-7;
/// Work on a point of a figure, s. Measured: 1 s for 800,000 in HTML, as much for SVG.
const POINT: f64 = 3e-6;
/// Event-driven: a closed form per segment where the neighbour's orbit is near, and where it is not. Measured: 19 to 49 µs for the couple.
const EVENT_DRIVEN: (f64, f64) = (3e-5, 2e-4);
/// How many times as much an orbit takes that Newton's method finds only after waiting.
const EVENTS_WAITED: f64 = 3.0;
/// The tolerance of harmonic balance for which its time was measured.
const SERIES_TOLERANCE: f64 = 1e-3;
/// Harmonic balance per mass and joint at 15 harmonics. Measured with springs before the sliders: 54 µs for the massless couple, 3 ms for a
/// ring of 48 blades and joints, 12 ms for a chain of 300; a tenth of this, but points that are not found take the rest.
const SERIES: f64 = 5e-4;
/// The same where they are found.
const SERIES_USUAL: f64 = 1.5e-5;
/// Rigid sliders and smooth laws need more harmonics and more steps: measured 20 ms at 4 blades, 0.9 s at 32. Where
/// the harmonics are given they need more steps only, as a rule from a neighbour and where none is near: 0.8 and 2.1 s for rings of 100 and 300 with five.
const HARD: f64 = 40.0;
const HARD_RIGID: (f64, f64) = (3.0, 80.0);
const HARD_SMOOTH: f64 = 10.0;
/// Friction that falls with velocity needs the most of both. Measured: 0.16 to 0.4 s for two masses and a joint; 2.4 s a point where 511 harmonics are tried
/// in vain.
const HARD_FALLING: (f64, f64) = (120.0, 500.0);
/// A multiplication in an elimination, s. Measured: 2.8e-10 in bands, for steps of a ring of 96 blades with 96 rigid joints and 15 harmonics, and 1e-10 in blocks.
const ELIMINATED: f64 = 2e-10;
/// Steps of rigid friction at the harmonics that are given and at those of the estimate: from a neighbour, and where Newton's method alone finds
/// nothing. Measured: 3 to 5 for rings of 12 and 24 blades, 30 to 55 for 48 to 192; 4 to 8 for an estimate.
const RIGID_STEPS_USUAL: (f64, f64) = (8.0, 4.0);
const RIGID_STEPS: (f64, f64) = (60.0, 8.0);
/// The same where the harmonics are chosen, at each number of them and at twice that; usually and at worst.
const RIGID_EACH: (f64, f64) = (3.0, 8.0);
/// Harmonics that rigid friction needs for [`SERIES_TOLERANCE`], usually and at worst, and the power of one over the tolerance that they go with: the error
/// falls with an order between 1 and 3/2. Measured: 14 trees of 8 to 30 masses took 0.02 to 2 s a point, with 15 to 255.
const RIGID_HARMONICS: (f64, f64) = (31.0, 255.0);
const RIGID_ORDER: f64 = 2.0 / 3.0;
/// Time of the derivatives of a law with memory beside rigid friction in a plane, which asks for hundreds of harmonics and tens of thousands of samples, s for every
/// pair of its directions; usually, where few are enough, and at worst. Measured: 0.3 to 14.5 s a point with four to eight pairs.
const BESIDE_RIGID: (f64, f64) = (0.0, 1.5);
/// What a point spends of it at most, s.
const BESIDE_RIGID_MOST: f64 = 15.0;
/// Where harmonic balance ends.
const MOST_HARMONICS: f64 = 511.0;
/// The order with which the error of a series falls with its length where forces have corners, and the power of its length with which its time grows.
/// Measured for two masses and a `jenkins`: twice the time from 1e-3 to 1e-7; 15, 60 and 240 harmonics 0.1, 0.25 and 2.4 ms. With `bouc-wen` nine times
/// the time from 1e-3 to 1e-6.
const SERIES_ORDER: f64 = 3.0;
const SERIES_LENGTH: f64 = 1.5;
/// Harmonic balance with all rows of a sparse structure: its dynamic stiffness is factored once for every harmonic of the series and of the estimate, and a
/// few times more for loads and the mean.
const FACTORS: (f64, f64) = (2.0, 6.0);
/// A factor, s, by this power of its numbers. Measured: 0.057 s for 2.35 million, of 3,168 rows, 8 s for 163 million, of 69,930.
const FACTOR: (f64, f64) = (2.1e-9, 1.17);
/// Memory of the factors and motions that are kept, in factors and bytes at most: the one that is being made comes to them.
const KEPT_FACTORS: (f64, f64) = (2.0, 3e9);
/// What contacts that the structure couples all with all add, per square of their directions, as a smooth law. Measured with five harmonics on a
/// block, where many slip: 0.05, 0.29 and 1.1 s for 10, 100 and 300 nodes of three directions; a fifth of that where they stick.
const COUPLED: f64 = 4e-8;
/// How much harder orbits are where contacts alone hold some bodies of a structure that is not solved by its sector: from a neighbour, and from one
/// that is farther away than this many widths of a resonance, or none. Measured: 0.4 s and 4 s for 12 mistuned blades with wedges.
const UNHELD: (f64, f64) = (14.0, 200.0);
const FAR: f64 = 10.0;
/// Harmonics of [`SERIES`].
const SERIES_HARMONICS: f64 = 15.0;
/// Shooting, times the square of masses and joints; more where the sliders have springs. Measured: 25 ms for two
/// masses, 0.6 s for four.
const SHOOTING: (f64, f64) = (1e-3, 1.5e-2);
/// The same in a sweep. Measured for two masses and a joint: 0.7 ms with `coulomb-arctan` and `cubic`, 1.5 to 3.5 ms with laws that have states.
const SHOOTING_USUAL: (f64, f64) = (5e-5, 3e-4);
/// Shooting in equal steps: as many periods of a transient does an orbit take. Measured: 0.29 s a point for a body on a contact of two directions, 0.33 s for
/// three with two of them.
const STEPPED: f64 = 40.0;
/// Method `transient`: the periods in which a mode with the least damping loses a digit. Measured at a damping ratio of 7e-4: exact laws
/// 20 ms, 0.1 s, 0.5 s for 2, 4, 8 masses; smooth laws 0.9 s and 8 s for 2 and 4. At 1.6 % a ring took 80 periods. The shortest windows of two decays take 16.
const SETTLING_PERIODS: (f64, f64) = (30.0, 50_000.0);
/// Highest drive frequencies up to which the drive moves a mode.
const DRIVEN: f64 = 2.0;
/// Periods after which it ends where nothing settles, which a force without a bound (a gap, a cubic spring) may make of some points; twice, as
/// a motion that does not settle from its neighbour's is followed from rest again.
const UNSETTLED_PERIODS: f64 = 2.0 * 4096.0;
/// Share of the points at which that happens, of all such studies. Measured: one in five of two masses on a hard cubic spring with little
/// damping, none with more.
const UNSETTLED: f64 = 0.05;
/// A period of a transient: integration, times the square of masses and joints; more with states.
const PERIOD: (f64, f64) = (2.5e-4, 1.3e-3);
/// A period from event to event, per mass and slider, and times their cube, for the decomposition of each new pattern. Measured: 0.6, 3.5 and
/// 21 ms for rings of 12, 24 and 48 masses and joints, 4 ms for three masses and a joint of 32 sliders.
const PERIOD_EVENTS: (f64, f64) = (2e-5, 2.4e-8);
/// The decomposition of a new pattern of stick and slip, per cube of the degrees of freedom, s. Measured: 4 ms for a ring of 20 blades on a rim.
const PATTERN: f64 = 6e-8;
/// New patterns of a slider in a period of a motion that does not repeat: it comes to rest and leaves twice.
const PATTERNS: f64 = 2.0;
/// Digits of a motion that rings that make the steps of an integration short: as many as its error per step.
const RINGING: f64 = 9.0;
/// Periods of the drive that an integration takes as long for as for one oscillation of what rings, at the lowest. Measured: 1000 oscillations at
/// 18 kHz in 8 periods at 151 Hz, 0.8 s for four masses.
const RUNG: f64 = 0.2;
/// Steps of a period in equal steps, usually and at worst: the solutions with two and four times as many, too. Measured: 0.7 to 2 ms a period for a body on
/// a joint where little slips, 10 to 24 ms where much does.
const STEPS: (f64, f64) = (2500.0, 25_000.0);
/// Such a step, s: per direction of a joint, per pair of them, and per pair of masses. Measured, little and much slip: 3 and 20 ms a period for five
/// directions, 12 and 107 for eight that friction couples, 35 and 296 for 16 of these; as much for one joint of one mass and of eight.
const STEP: (f64, f64, f64) = (7.5e-7, 5e-8, 4e-9);
/// What derivatives add to such a step, s, per pair of masses. Measured: returns of 4096 steps in 6 ms for two masses and a contact of two directions, and in
/// 37 ms for 13 coordinates and one of three.
const JUDGED: f64 = 4e-8;
/// Resolving and assembling a case, s.
const PREPARING: f64 = 2e-4;
/// Its modes, times the cube of its masses, s. Measured: 0.35 s for 500.
const MODES: f64 = 2.8e-9;
/// Reading a structure by its matrices, its factors, modes and samples of the whole, s, by this power of its rows; and what a place adds per row.
/// Measured: 0.2 s for 3,200 rows, 3 to 5 s for 28,000, 10 to 15 s for 70,000; 900 places of 31,500 rows take 7.
const MATRICES: (f64, f64) = (2.4e-6, 1.4);
const SEEN: f64 = 2e-7;
/// Solving points again in coordinates that reach farther: their reduction, in multiples of the first, and an orbit from rest in them, in multiples of one.
/// Measured: twice as long for 3,200 rows; 57 instead of 10 coordinates of a chain of 300 masses, 0.3 s instead of 0.03.
const AGAIN: (f64, f64) = (2.0, 10.0);
/// Reading, checking and assembling, s, per mass and joint.
const ASSEMBLING: f64 = 5e-5;
/// Reading the motion at one instant, per mass and joint, s.
const INSTANT: f64 = 5e-7;

impl Costing<'_> {
    /// Time of one orbit by the method of the study, s.
    pub fn orbit(&self) -> f64 {
        let case = self.case;
        let size = self.masses + self.joints;
        let shooting = self.pace.of(SHOOTING_USUAL, SHOOTING);
        let shooting = size * size * self.ringing() * if self.has_states { shooting.1 } else { shooting.0 };
        let series = self.series(case.method.options.get("harmonics").copied());
        match case.method.name.as_str() {
            _ if self.is_series() => {
                let whole = series * self.sector() * self.unheld();
                let given = case.method.options.get("harmonics").copied();
                whole.max(self.rigid_series(given)) + self.beside_rigid(given) + self.factored(given) + self.judged()
            }
            "transient" => {
                let digit = LN_10 / (TAU * self.least_damping());
                let most = case.method.options.get("periods").copied().unwrap_or(SETTLING_PERIODS.1);
                let share = self.pace.of(0.0, UNSETTLED);
                let restless = if self.unbounded { share * UNSETTLED_PERIODS } else { 0.0 };
                (digit.clamp(SETTLING_PERIODS.0, SETTLING_PERIODS.1) + restless).min(most) * self.period()
            }
            "shooting" if self.stepped => STEPPED * self.period(),
            _ if self.smooth => shooting,
            _ => self.events(),
        }
    }

    /// Time of one orbit from event to event, s.
    fn events(&self) -> f64 {
        let counted = ELIMINATED * event_driven::orbit_work(self.system()).unwrap_or(0.0);
        let far = event_driven::ALONE * counted;
        let usual = if self.is_dense(FAR) { counted } else { far };
        self.pace.of(EVENT_DRIVEN.0 + usual, EVENT_DRIVEN.1 + EVENTS_WAITED * far)
    }

    /// Whether there are neighbouring frequencies, no farther apart than so many widths of a resonance.
    fn is_dense(&self, widths: f64) -> bool {
        self.range().is_some_and(|(lowest, highest)| {
            self.frequencies > 1.0
                && (highest - lowest) <= (self.frequencies - 1.0) * widths * 2.0 * self.least_damping() * lowest
        })
    }

    /// Time of one orbit of a linear reference, s: with no joint that slips or opens nothing is hard to find.
    pub fn reference(&self) -> f64 {
        if self.is_series() { self.orbit() / self.unheld() } else { self.orbit() }
    }

    /// How much harder orbits are to find than those of a structure that holds all of its bodies itself.
    fn unheld(&self) -> f64 {
        let survey = &self.surveyed.survey;
        let contacts = self.smooth && self.stepped;
        if !contacts || survey.free().rigid == 0 || survey.system().cyclic().is_some() {
            return 1.0;
        }
        self.pace.of(if self.is_dense(FAR) { UNHELD.0 } else { UNHELD.1 }, 1.0)
    }

    /// Steps of a curve, of what it usually takes and what it takes where it is hard to follow.
    pub fn steps(&self, (usual, hard): (f64, f64)) -> f64 {
        self.pace.of(usual, hard)
    }

    /// Share of the structure that is solved for an orbit: of a ring in a travelling wave one sector of twice the size.
    pub fn sector(&self) -> f64 {
        self.system().cyclic().map_or(1.0, |ring| (2.0 / ring.sectors as f64).min(1.0))
    }

    /// Time of one series of harmonics of the whole structure, s; of as many as it needs if `None`.
    pub fn series(&self, harmonics: Option<f64>) -> f64 {
        let factor = match (self.smooth, self.is_rigid(), harmonics) {
            (_, _, None) if self.falls => self.pace.of(HARD_FALLING.0, HARD_FALLING.1),
            (false, false, _) => 1.0,
            (_, _, None) => HARD,
            (true, _, Some(_)) => HARD_SMOOTH,
            (false, true, Some(_)) if self.is_dense(FAR) => HARD_RIGID.0,
            (false, true, Some(_)) => self.pace.of(HARD_RIGID.1, HARD_RIGID.0),
        };
        let asked = self.case.method.options.get("tolerance").copied().unwrap_or(SERIES_TOLERANCE);
        let length = match harmonics {
            Some(harmonics) => harmonics / SERIES_HARMONICS,
            None => (SERIES_TOLERANCE / asked).powf(SERIES_ORDER.recip()).min(MOST_HARMONICS / SERIES_HARMONICS),
        };
        // friction that falls with velocity is hard to find everywhere
        let usual = if self.falls { SERIES } else { SERIES_USUAL };
        let each = self.pace.of(usual, SERIES) * (self.masses + self.joints).max(1.0);
        (each + self.coupled()) * factor * length.max(1.0).powf(SERIES_LENGTH)
    }

    /// Time to eliminate so many unknowns, s.
    pub fn eliminated(&self, unknowns: f64) -> f64 {
        ELIMINATED * unknowns.powi(3) / 3.0
    }

    /// What contacts add to a series that a structure in few coordinates couples all with all, s.
    fn coupled(&self) -> f64 {
        let system = self.system();
        let directions: usize = system.joints().iter().map(|joint| joint.law().directions()).sum();
        let all = system.reduced().is_some() && system.cyclic().is_none();
        if all { COUPLED * (directions as f64).powi(2) } else { 0.0 }
    }

    /// Time of the eliminations of such a series where friction is rigid, s; zero where none is.
    fn rigid_series(&self, harmonics: Option<f64>) -> f64 {
        let system = self.system();
        if self.smooth || !self.is_rigid() {
            return 0.0;
        }
        let step = |harmonics: f64| ELIMINATED * harmonic_balance::step_work(system, harmonics as usize);
        if let Some(given) = harmonics {
            let (own, estimate) = self.pace.of(RIGID_STEPS_USUAL, RIGID_STEPS);
            return own * step(given) + estimate * step(2.0 * given);
        }
        let asked = self.case.method.options.get("tolerance").copied().unwrap_or(SERIES_TOLERANCE);
        let longest = self.pace.of(RIGID_HARMONICS.0, RIGID_HARMONICS.1) * (SERIES_TOLERANCE / asked).powf(RIGID_ORDER);
        let longest = longest.min(MOST_HARMONICS);
        let each = self.pace.of(RIGID_EACH.0, RIGID_EACH.1);
        let sought = each * harmonic_balance::doubling_work(system, longest);
        ELIMINATED * sought.min(harmonic_balance::most_work(system))
    }

    /// Time of laws with memory beside rigid friction in a plane, s; zero where harmonics are given, which are fewer.
    fn beside_rigid(&self, harmonics: Option<f64>) -> f64 {
        let laws = || self.system().joints().iter().map(|joint| joint.law());
        let is_rigid =
            |law: &SharedLaw| law.directions() > 1 && law.prox().is_some_and(|prox| prox.compliance() == 0.0);
        if harmonics.is_some() || !laws().any(is_rigid) {
            return 0.0;
        }
        let remembers = |law: &&SharedLaw| law.step().is_some() || law.rate().is_some_and(|rate| rate.states() > 0);
        let pairs: usize = laws().filter(remembers).map(|law| law.directions().pow(2)).sum();
        (self.pace.of(BESIDE_RIGID.0, BESIDE_RIGID.1) * pairs as f64).min(BESIDE_RIGID_MOST)
    }

    /// Time to factor the dynamic stiffness for one orbit, s; zero where none is.
    fn factored(&self, harmonics: Option<f64>) -> f64 {
        let numbers = self.factor_bytes / NUMBER;
        let count = FACTORS.0 * harmonics.unwrap_or(SERIES_HARMONICS) + FACTORS.1;
        count * FACTOR.0 * numbers.powf(FACTOR.1)
    }

    /// Whether friction is rigid somewhere.
    fn is_rigid(&self) -> bool {
        let rigid =
            |law: &SharedLaw| law.sliders().is_some_and(|all| all.iter().any(|branch| branch.stiffness.is_none()));
        self.system().joints().iter().any(|joint| rigid(joint.law()))
    }

    /// Time of a period of a transient, s.
    pub fn period(&self) -> f64 {
        let size = self.masses + self.joints;
        let exact = self.masses + self.sliders;
        // a width makes sliders integrate that no smooth law replaces
        if self.stepped && (self.smooth || self.case.method.options.contains_key("width")) {
            return self.pace.of(STEPS.0, STEPS.1) * self.step();
        }
        match (self.smooth, self.has_states) {
            (false, _) => PERIOD_EVENTS.0 * exact + PERIOD_EVENTS.1 * exact.powi(3),
            (true, false) => PERIOD.0 * size * size * self.ringing(),
            (true, true) => PERIOD.1 * size * size * self.ringing(),
        }
    }

    /// Time in which the return of an orbit by harmonic balance is followed in equal steps, s; zero where it takes no time beside the orbit.
    fn judged(&self) -> f64 {
        let Some((steps, with_derivatives)) = evidence_steps(self.system()) else { return 0.0 };
        let derivatives = if with_derivatives { JUDGED * self.masses.powi(2) } else { 0.0 };
        steps as f64 * (self.step() + derivatives)
    }

    /// Time of an orbit between others, whose return nobody asks for, s.
    pub fn between(&self) -> f64 {
        self.orbit() - if self.is_series() { self.judged() } else { 0.0 }
    }

    /// Time of one of equal steps, s.
    fn step(&self) -> f64 {
        let joints = self.system().joints();
        let directions = joints.iter().map(|joint| joint.law().directions()).sum::<usize>() as f64;
        STEP.0 * directions + STEP.1 * directions.powi(2) + STEP.2 * self.masses.powi(2)
    }

    /// Time to decompose the patterns of stick and slip of a motion of so many periods that does not repeat, s.
    pub fn patterns(&self, periods: f64) -> f64 {
        if self.smooth || self.stepped {
            return 0.0;
        }
        (periods * PATTERNS * self.sliders).max(1.0) * PATTERN * self.masses.powi(3)
    }

    /// How many times as long a period takes to integrate in which the fastest mode rings that is not damped away within it.
    fn ringing(&self) -> f64 {
        let drive = self.range().map_or(self.slowest_mode(), |(lowest, _)| lowest);
        let modes = &self.surveyed.survey.stuck().elastic;
        let rings = modes.iter().filter(|mode| TAU * mode.damping * mode.omega < RINGING * LN_10 * drive);
        (RUNG * rings.map(|mode| mode.omega).fold(drive, f64::max) / drive.max(f64::MIN_POSITIVE)).max(1.0)
    }

    /// Damping ratio of the mode, with all joints free, whose transient dies last: of all, or usually of those that the drive moves, since friction damps
    /// the others as long as they are seen.
    fn least_damping(&self) -> f64 {
        let modes = &self.surveyed.survey.free().elastic;
        let highest = self.range().map_or(f64::INFINITY, |(_, highest)| DRIVEN * highest);
        let driven = modes.iter().filter(|mode| self.pace == Pace::Slow || mode.omega <= highest);
        driven.map(|mode| mode.damping).fold(1.0, f64::min).max(f64::MIN_POSITIVE)
    }

    /// Time to read the motion at so many instants, s.
    pub fn reading(&self, instants: f64) -> f64 {
        INSTANT * instants * (self.masses + self.joints)
    }

    /// Time to read what `output` asks of one orbit, s.
    pub fn extra(&self) -> f64 {
        match self.case.values.names("output").unwrap_or_default().len() {
            0 => 0.0,
            some => self.reading(some as f64 * extra::INSTANTS as f64),
        }
    }
}
