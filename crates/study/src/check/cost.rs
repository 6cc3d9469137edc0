//! Estimates of size and time of a study: counts of rows, columns and orbits times measured
//! costs of the methods.
//!
//! Each study kind supplies the counts.

use crate::case::study::{Case, Study};
use crate::check::survey::{SurveyedCase, frequency_range};
use crate::results::decimation::MAX_ROWS;
use crate::run::work::UNITS_AHEAD;
use crate::run::{basis_check, output_columns};
use crate::syntax::error::{Problem, StudyError};
use crate::syntax::format::format_bytes;
use std::collections::BTreeSet;
use std::f64::consts::{LN_10, TAU};
use stickslip::curve::sweep::BLOCK;
use stickslip::law::SharedLaw;
use stickslip::method::{Method, auto::Auto, event_driven, evidence_steps, harmonic_balance};
use stickslip::model::System;

/// The size of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StudySize {
    /// Rows of its tables.
    pub rows: u64,
    /// Size of its tables as numbers of eight bytes, bytes.
    pub results: u64,
    /// Peak memory of a run that writes its tables as it proceeds, bytes; a rough estimate.
    pub memory: u64,
    /// Peak memory of a run that holds all tables, bytes.
    pub memory_all_tables: u64,
}

/// Bytes of a number in a table.
const NUMBER: f64 = 8.0;
/// Bytes of a word in a table: its handle and its heap allocation.
const WORD: f64 = 56.0;
/// Bytes of a cell as text in a CSV file. Measured: 85 for three numbers and a word.
const CSV_CELL_BYTES: f64 = 20.0;
/// Bytes of a point of a figure, in the dataset and drawn in all formats. Measured: 220 in
/// HTML.
const FIGURE_POINT_BYTES: f64 = 240.0;
/// Bytes of an orbit: of exact laws per entry of its state and per switch, of smooth laws per
/// entry.
///
/// Measured: exact 8 kB for the couple and 170 kB for 8 masses and joints; smooth 80 kB and 600
/// kB.
const ORBIT_ENTRY: f64 = 500.0;
const SMOOTH_ENTRY: f64 = 24_000.0;
/// Bytes per harmonic coefficient of a place or joint while harmonic balance solves an orbit.
///
/// Measured: 15 kB for the couple, 130 kB for 8 masses and joints, at 15 harmonics.
const SERIES_ENTRY: f64 = 80.0;
/// Bytes of the samples of force and contact of a joint over a period.
///
/// Measured: a ring of 480 blades and joints with seven harmonics takes 87 MB on two threads,
/// including the orbits that are next to be solved.
const SERIES_SAMPLES: f64 = 40.0 * 1024.0;
/// Bytes of a complex coefficient.
///
/// An orbit keeps one for every degree of freedom, for each harmonic, the mean and the initial
/// state. Its equations have one for each direction of a joint.
const COEFFICIENT: f64 = 16.0;
const DIRECTIONS: f64 = 3.0;
/// Bytes of the measured quantities of a place, including its name.
const PLACE_BYTES: f64 = 100.0;
/// Samples per period at which [`SERIES_SAMPLES`] was measured.
const REFERENCE_SAMPLES: f64 = 1024.0;
/// Numbers per entry of a full matrix for a method that integrates in time.
///
/// These are three matrices of the structure, the inverse mass, and the return map with its
/// products, which has twice the rows.
const TIME_METHOD_MATRICES: f64 = 16.0;
/// Bytes of the motion at one instant, per mass and joint.
const SAMPLE: f64 = 64.0;
/// Points per case of a curve with adaptive frequencies. Measured: 100 to 600 at tolerances of
/// 1 %.
const ADAPTIVE: f64 = 300.0;
/// Switching points per period and joint, in addition to the requested instants.
const SWITCHES: f64 = 4.0;

/// The shape of a planned table: rows and columns.
#[derive(Debug, Clone, Copy, Default)]
pub struct TableShape {
    /// Rows.
    pub rows: f64,
    /// Columns of numbers and flags.
    pub numbers: f64,
    /// Columns of words.
    pub words: f64,
}

/// The cost of a study, as its kind estimates it.
#[derive(Debug, Default)]
pub struct Cost {
    /// Shapes of its tables.
    pub tables: Vec<TableShape>,
    /// Number of points in figures.
    pub drawn: f64,
    /// Memory of one unit of work during its computation, without its tables, bytes.
    ///
    /// At most one unit per thread is computed at a time. The tables of units that wait are
    /// counted with the tables.
    pub unit: f64,
    /// Time of the methods on one thread, s.
    pub work: f64,
    /// Part of the work that is needed only for some results, s, and a text that says when it
    /// is skipped.
    pub conditional_work: Option<(f64, &'static str)>,
}

/// Data for a cost estimate: counts, and the cost of one orbit. The first case represents all
/// cases.
#[derive(Debug, Clone)]
pub struct CostInputs<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its first case.
    pub case: &'a Case,
    /// Number of cases.
    pub cases: f64,
    /// Number of frequencies of a case; a typical number for adaptive frequencies.
    pub frequencies: f64,
    /// Number of varied parameters, one column each.
    pub varied: f64,
    /// Number of degrees of freedom.
    pub dofs: f64,
    /// Number of places with results; every degree of freedom of a mass is one.
    pub places: f64,
    /// Number of joints.
    pub joints: f64,
    /// Number of sliders in all joints; a joint without sliders counts as one.
    sliders: f64,
    surveyed: &'a SurveyedCase,
    /// True if a law is smooth, or is made smooth by `width`.
    smooth: bool,
    has_states: bool,
    /// True if a law has no rate form; integration then uses equal time steps.
    equal_steps: bool,
    /// True if the friction of a law falls with velocity.
    falling_friction: bool,
    /// True if the force of a law is unbounded.
    unbounded_force: bool,
    /// True if the method of the study is harmonic balance.
    harmonic_balance: bool,
    /// Memory of one factor of the dynamic stiffness in all rows, bytes; zero if none is made.
    /// Stored here because computing it takes seconds for a large structure.
    factor_bytes: f64,
    pace: Difficulty,
}

/// The assumed difficulty of finding orbits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Difficulty {
    /// The typical case.
    Typical,
    /// The hard case: many orbits are not found, or only after long searches.
    Hard,
}

impl Difficulty {
    fn select<T>(self, usual: T, slow: T) -> T {
        match self {
            Difficulty::Typical => usual,
            Difficulty::Hard => slow,
        }
    }
}

/// Returns true if the method of a case is harmonic balance.
fn finds_series(case: &Case, system: &System) -> bool {
    match case.method.name.as_str() {
        "harmonic-balance" => true,
        "auto" => Auto.choice(system).method == harmonic_balance::NAME,
        _ => false,
    }
}

impl<'a> CostInputs<'a> {
    /// Returns the inputs for a study whose orbits are hard to find.
    pub(crate) fn new(study: &'a Study, surveyed: &'a SurveyedCase) -> Self {
        let (case, system) = (&surveyed.case, surveyed.survey.system());
        // the option `width` makes exact laws smooth
        let width = case.method.options.get("width");
        let followed = |law: &SharedLaw| width.and_then(|width| law.regularised(*width)).unwrap_or_else(|| law.clone());
        let laws: Vec<SharedLaw> = system.joints().iter().map(|joint| followed(joint.law())).collect();
        let given = case.frequencies.as_ref().map_or(1, |f| f.len()) as f64;
        let series = finds_series(case, system);
        let factor_bytes = if series { harmonic_balance::factor_bytes(system) } else { 0 };
        CostInputs {
            study,
            case,
            cases: study.cases() as f64,
            frequencies: if study.is_adaptive() { ADAPTIVE } else { given },
            varied: case.varied.len() as f64,
            dofs: system.dofs() as f64,
            places: system.places().len() as f64,
            joints: system.joints().len() as f64,
            sliders: laws.iter().map(|law| law.sliders().map_or(1, |all| all.len().max(1)) as f64).sum(),
            surveyed,
            smooth: laws.iter().any(|law| law.ideal_elements().is_none()),
            equal_steps: laws.iter().any(|law| law.rate().is_none() && !law.carries_no_force()),
            falling_friction: laws.iter().any(|law| law.prox().is_some() && !law.is_incrementally_passive()),
            unbounded_force: laws.iter().any(|law| law.force_scale().is_infinite()),
            has_states: laws.iter().any(|law| law.rate().is_some_and(|rate| rate.states() > 0)),
            harmonic_balance: series,
            factor_bytes: factor_bytes as f64,
            pace: Difficulty::Hard,
        }
    }

    /// Returns the inputs for the same study with typical orbits.
    pub(crate) fn typical(&self) -> Self {
        CostInputs { pace: Difficulty::Typical, ..self.clone() }
    }

    /// Returns the system of the first case.
    pub fn system(&self) -> &System {
        self.surveyed.survey.system()
    }

    /// Returns the number of points: cases times frequencies.
    pub fn points(&self) -> f64 {
        self.cases * self.frequencies
    }

    /// Returns the number of groups of cases that differ in the last parameter of `vary` only.
    pub fn curves(&self) -> f64 {
        self.cases / self.study.values_per_curve().max(1) as f64
    }

    /// Returns the number of frequency columns: 1 for several frequencies, otherwise 0.
    pub fn frequency_columns(&self) -> f64 {
        if self.frequencies > 1.0 { 1.0 } else { 0.0 }
    }

    /// Returns the shape of a table with one row for each of `rows` orbits.
    ///
    /// The columns are frequency; amplitude, mean and phase of each place; dissipation and slip
    /// of each joint; the columns of `output`; evidence; status.
    pub fn orbits(&self, rows: f64) -> TableShape {
        let extra = output_columns::columns(self.case, self.system()).len() as f64;
        let numbers = self.varied + 3.0 * self.places + 2.0 * self.joints + extra + 6.0;
        TableShape { rows, numbers, words: 1.0 }
    }

    /// Returns the shape of a table with one row for each of `rows` instants.
    ///
    /// The columns are time and frequency; displacement and velocity of each place; three
    /// numbers and the contact state of each joint.
    pub fn motion(&self, rows: f64) -> TableShape {
        TableShape { rows, numbers: self.varied + 2.0 + 2.0 * self.places + 3.0 * self.joints, words: self.joints }
    }

    /// Returns the instants of a period in a table: `samples` steps, both ends, and the
    /// switches.
    pub fn instants(&self) -> f64 {
        self.case.values.count("samples").unwrap_or(720) as f64 + 1.0 + SWITCHES * self.joints
    }

    /// Estimates the number of resonance peaks of a place strictly inside the frequency range.
    ///
    /// Each resonance raises the given frequency nearest to it. The typical number is the
    /// smaller of the counts with all joints free and with all joints stuck; the upper number
    /// is the larger of both. Returns `None` if the resonances or the frequencies are unknown.
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
        self.pace.select(peaks().min(), peaks().max()).map(|peaks| peaks as f64)
    }

    /// Returns the lowest and highest excitation frequency, rad/s.
    pub fn range(&self) -> Option<(f64, f64)> {
        frequency_range(self.case)
    }

    /// Returns the lowest natural frequency with all joints stuck, rad/s; zero without one.
    pub fn slowest_mode(&self) -> f64 {
        self.surveyed.survey.stuck().elastic.first().map_or(0.0, |mode| mode.omega)
    }

    /// Returns the bytes of the orbits that a unit of frequencies keeps at a time.
    pub fn kept_orbits(&self) -> f64 {
        let orbits = self.frequencies.min(BLOCK as f64);
        if self.is_series() {
            let option = |name: &str, default: f64| self.case.method.options.get(name).copied().unwrap_or(default);
            let kept =
                self.kept_series_bytes(option("harmonics", SERIES_HARMONICS), option("samples", REFERENCE_SAMPLES));
            return orbits * kept + self.orbit_bytes();
        }
        orbits * self.orbit_bytes()
    }

    /// Returns the bytes of a converged orbit with this number of harmonics.
    ///
    /// Measured: 1.0 MB for a ring of 12 sectors with 1188 coordinates and 12 joints of three
    /// directions, at 15 harmonics.
    pub fn kept_series_bytes(&self, harmonics: f64, samples: f64) -> f64 {
        let coefficients = (harmonics + 2.0) * (self.dofs + DIRECTIONS * self.joints);
        COEFFICIENT * coefficients
            + PLACE_BYTES * self.places
            + SERIES_SAMPLES * samples / REFERENCE_SAMPLES * self.joints
    }

    /// Returns the bytes of an orbit in memory while it is computed.
    pub fn orbit_bytes(&self) -> f64 {
        let state = 2.0 * self.dofs + self.joints + 1.0;
        if self.is_series() {
            let harmonics = self.case.method.options.get("harmonics").copied().unwrap_or(SERIES_HARMONICS);
            return self.series_bytes(harmonics) + SERIES_SAMPLES * self.joints;
        }
        let matrices = TIME_METHOD_MATRICES * NUMBER * self.dofs * self.dofs;
        matrices + if self.smooth { SMOOTH_ENTRY * state } else { ORBIT_ENTRY * state * (2.0 + SWITCHES * self.joints) }
    }

    /// Returns true if the method of the study is harmonic balance.
    pub fn is_series(&self) -> bool {
        self.harmonic_balance
    }

    /// Returns the bytes of the motion at the instants of one period.
    pub fn samples_bytes(&self) -> f64 {
        self.instants() * SAMPLE * (2.0 + self.dofs + self.joints)
    }

    /// Returns the bytes that harmonic balance needs to solve an orbit of this number of
    /// harmonics.
    pub fn series_bytes(&self, harmonics: f64) -> f64 {
        SERIES_ENTRY * (2.0 * harmonics + 1.0) * (2.0 * self.dofs + 4.0 * self.joints)
    }
}

impl Cost {
    fn rows(&self) -> f64 {
        self.tables.iter().map(|table| table.rows).sum()
    }

    fn cells(&self, number: f64, word: f64) -> f64 {
        self.tables.iter().map(|table| table.rows * (number * table.numbers + word * table.words)).sum()
    }

    /// Returns the cells of at most as many rows as a figure shows.
    fn figure_cells(&self, number: f64, word: f64) -> f64 {
        let rows = |table: &TableShape| table.rows.min(MAX_ROWS as f64);
        self.tables.iter().map(|table| rows(table) * (number * table.numbers + word * table.words)).sum()
    }
}

impl CostInputs<'_> {
    /// Returns the size of a study of this cost, divided into `units` units of work.
    pub(crate) fn size(&self, cost: &Cost, units: usize) -> StudySize {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let tables = cost.cells(NUMBER + CSV_CELL_BYTES, WORD + CSV_CELL_BYTES);
        // finished units wait until they are in order; a figure reads back at most
        // [`MAX_ROWS`] rows of a table
        let waiting = tables * ((UNITS_AHEAD * threads) as f64 / units.max(1) as f64).min(1.0);
        let shown = cost.figure_cells(NUMBER + CSV_CELL_BYTES, WORD + CSV_CELL_BYTES);
        let drawn = FIGURE_POINT_BYTES * cost.drawn.min(MAX_ROWS as f64 * (self.places + self.joints));
        let factor = self.factor_bytes;
        let factors = factor + (STORED_FACTORS.0 * factor).min(STORED_FACTORS.1);
        let working = units.min(threads) as f64 * (cost.unit + factors);
        // a float above the largest value of the type becomes that value
        let whole = |value: f64| value as u64;
        StudySize {
            rows: whole(cost.rows()),
            results: whole(cost.cells(NUMBER, NUMBER)),
            memory: whole(tables.min(waiting + shown) + drawn + working),
            memory_all_tables: whole(tables + drawn + working),
        }
    }

    /// Estimates the time of a study of this cost on one thread, s.
    pub(crate) fn seconds(&self, cost: &Cost) -> f64 {
        let elements = self.dofs + self.joints;
        // the modes of large models are not computed
        let modes = if self.surveyed.survey.is_too_large() { 0.0 } else { MODES * self.dofs.powi(3) };
        let preparing = self.cases * (CASE_SECONDS + modes + ELEMENT_SECONDS * elements);
        let writing = CELL_SECONDS * cost.cells(1.0, 1.0);
        OVERHEAD
            + SAFETY_FACTOR
                * (cost.work
                    + self.reduction_seconds()
                    + self.basis_check_seconds()
                    + preparing
                    + writing
                    + FIGURE_POINT_SECONDS * cost.drawn)
    }

    /// Returns the time to read and reduce a structure given by matrices, s; all cases share
    /// it.
    fn reduction_seconds(&self) -> f64 {
        let reduced = self.system().reduced().and(self.case.model.substructure.as_ref());
        let rows = reduced.map_or(0.0, |substructure| substructure.component.dofs() as f64);
        MATRICES.0 * rows.powf(MATRICES.1) + PLACE_PER_ROW * rows * self.places
    }

    /// Returns the time of the basis check, s: points with slip are solved again in a larger
    /// reduction basis.
    fn basis_check_seconds(&self) -> f64 {
        let Some(reduced) = self.system().reduced() else { return 0.0 };
        let rows = self.case.model.substructure.as_ref().map_or(0, |own| own.component.dofs());
        let harmonics = self.case.method.options.get("harmonics").filter(|_| self.is_series());
        let highest = harmonics.zip(self.range()).map(|(harmonics, (_, drive))| harmonics * drive);
        let within = highest.is_some_and(|highest| highest <= reduced.up_to());
        if self.joints == 0.0 || within || rows > basis_check::MAX_ROWS || !self.study.kind().uses_method {
            return 0.0;
        }
        BASIS_CHECK.0 * self.reduction_seconds()
            + BASIS_CHECK.1 * basis_check::checked_points(self.points(), self.cases) * self.orbit()
    }
}

// ------------------------------------------------------------------------------------------
// memory limit

impl StudySize {
    /// Returns the error that refuses a study which needs more memory than the limit.
    pub(crate) fn refusal(&self, study: &Study, memory: u64) -> Option<StudyError> {
        let limit = study.memory_limit();
        if memory <= limit {
            return None;
        }
        let message = format!(
            "the study needs about {} of memory for {} rows of results; the limit is {}",
            format_bytes(memory),
            self.rows,
            format_bytes(limit)
        );
        let lengths = ["samples", "samples_per_cycle", "cycles", "duration", "steps"].into_iter();
        let given: Vec<String> =
            lengths.filter(|key| study.study.entry(key).is_some()).map(|key| format!("lower `{key}`, ")).collect();
        let fewer = if study.points() > study.cases() { "use fewer frequencies, " } else { "" };
        let split = if study.cases() > 1 { "split `vary` over several files, " } else { "" };
        let help = format!("{}{fewer}{split}or allow more with --memory", given.concat());
        // the error stands at the key that contributes most
        let place = match (study.varied.first(), study.points() / study.cases().max(1)) {
            (Some(varied), frequencies) if study.cases() >= frequencies => &varied.location,
            _ => study.study.location_of("frequency", None),
        };
        Some(StudyError::at_location(&study.sources, Problem::new(place, "memory", message).help(help)))
    }
}

// ------------------------------------------------------------------------------------------
// time

/// Safety factor on times measured on one core of 2020: estimates are high rather than low.
const SAFETY_FACTOR: f64 = 2.0;
/// Time for reading, drawing and writing, s.
const OVERHEAD: f64 = 0.2;
/// Time for one cell of a table and its text, s. Measured: 0.4 s for 200,000 rows of ten.
const CELL_SECONDS: f64 = 3e-7;
/// Time for one point of a figure, s. Measured: 1 s for 800,000 in HTML, the same for SVG.
const FIGURE_POINT_SECONDS: f64 = 3e-6;
/// Event-driven: time for the closed forms of an orbit, s, with and without an orbit at a near
/// frequency. Measured: 19 to 49 µs for the couple.
const EVENT_DRIVEN: (f64, f64) = (3e-5, 2e-4);
/// Factor on the time of an orbit that Newton's method finds only after waiting.
const WAITING_FACTOR: f64 = 3.0;
/// Tolerance of harmonic balance at which its time was measured.
const SERIES_TOLERANCE: f64 = 1e-3;
/// Harmonic balance: time per mass and joint at 15 harmonics, s, in the hard case.
///
/// Measured for sliders behind springs: 54 µs for the massless couple, 3 ms for a ring of 48
/// blades and joints, 12 ms for a chain of 300. That is a tenth of this value; points that are
/// not found take the rest.
const SERIES: f64 = 5e-4;
/// Time of [`SERIES`] in the typical case, in which orbits are found.
const SERIES_TYPICAL: f64 = 1.5e-5;
/// Factors for rigid sliders and smooth laws, which need more harmonics and more Newton steps.
///
/// Measured: 20 ms at 4 blades, 0.9 s at 32. With given harmonics they need only more Newton
/// steps, with a warm start and without one. Measured with five harmonics: 0.8 and 2.1 s for
/// rings of 100 and 300.
const RIGID_FACTOR: f64 = 40.0;
const HARD_RIGID: (f64, f64) = (3.0, 80.0);
const HARD_SMOOTH: f64 = 10.0;
/// Factors for friction that falls with velocity, which needs the most harmonics and Newton
/// steps.
///
/// Measured: 0.16 to 0.4 s for two masses and a joint; 2.4 s for a point at which 511 harmonics
/// do not converge.
const HARD_FALLING: (f64, f64) = (120.0, 500.0);
/// Time of one multiplication in an elimination, s.
///
/// Measured: 2.8e-10 in bands, for Newton steps of a ring of 96 blades with 96 rigid joints and
/// 15 harmonics; 1e-10 in blocks.
const MULTIPLICATION_SECONDS: f64 = 2e-10;
/// Newton steps of rigid friction with given harmonics, and with the harmonics of the error
/// estimate.
///
/// Typical: from a warm start. Hard: Newton's method alone does not converge. Measured: 3 to 5
/// for rings of 12 and 24 blades, 30 to 55 for 48 to 192; 4 to 8 for an estimate.
const RIGID_STEPS_TYPICAL: (f64, f64) = (8.0, 4.0);
const RIGID_STEPS: (f64, f64) = (60.0, 8.0);
/// Newton steps of rigid friction per number of harmonics if the method chooses the harmonics;
/// typical and hard.
const RIGID_STEPS_PER_HARMONIC: (f64, f64) = (3.0, 8.0);
/// Harmonics that rigid friction needs for [`SERIES_TOLERANCE`], typical and hard, and the
/// exponent of their growth with one over the tolerance.
///
/// The order of the error is between 1 and 3/2. Measured: 14 trees of 8 to 30 masses took 0.02
/// to 2 s per point, with 15 to 255 harmonics.
const RIGID_HARMONICS: (f64, f64) = (31.0, 255.0);
const RIGID_ORDER: f64 = 2.0 / 3.0;
/// Time of the derivatives of laws with memory in a model with rigid planar friction, s per
/// pair of directions.
///
/// Such friction needs hundreds of harmonics and tens of thousands of samples. Typical: few are
/// enough. Measured: 0.3 to 14.5 s per point with four to eight pairs.
const MEMORY_LAWS_WITH_RIGID: (f64, f64) = (0.0, 1.5);
/// Upper bound of that time per point, s.
const MAX_MEMORY_LAWS_WITH_RIGID: f64 = 15.0;
/// Largest number of harmonics in harmonic balance.
const MAX_HARMONICS: f64 = 511.0;
/// Order of the truncation error in the number of harmonics for forces with corners, and
/// exponent of the time in the number of harmonics.
///
/// Measured for two masses and a `jenkins`: twice the time from 1e-3 to 1e-7; 0.1, 0.25 and 2.4
/// ms for 15, 60 and 240 harmonics. With `bouc-wen`, nine times the time from 1e-3 to 1e-6.
const SERIES_ORDER: f64 = 3.0;
const SERIES_LENGTH: f64 = 1.5;
/// Number of factorizations per orbit for a sparse structure in all rows.
///
/// One for every harmonic of the series and of its estimate, and a few more for loads and the
/// mean.
const FACTORS: (f64, f64) = (2.0, 6.0);
/// Time of a factorization, s: coefficient and exponent of its number of entries.
///
/// Measured: 0.057 s for 2.35 million entries of 3,168 rows, 8 s for 163 million of 69,930
/// rows.
const FACTOR: (f64, f64) = (2.1e-9, 1.17);
/// Memory of stored factors and motions: number of factors, and bytes at most. The factor that
/// is being computed comes in addition.
const STORED_FACTORS: (f64, f64) = (2.0, 3e9);
/// Time for contacts that a reduced structure couples all with all, per square of their
/// directions, s, as for a smooth law.
///
/// Measured with five harmonics on a block in which many contacts slip: 0.05, 0.29 and 1.1 s
/// for 10, 100 and 300 nodes of three directions; a fifth of that if they stick.
const COUPLED_CONTACTS: f64 = 4e-8;
/// Factors on the time of an orbit if only contacts hold some bodies of a structure that is not
/// solved by one sector.
///
/// With a warm start, and without one: no neighbouring frequency is within [`NEAR_WIDTHS`]
/// widths of a resonance. Measured: 0.4 s and 4 s for 12 mistuned blades with wedges.
const CONTACT_HELD: (f64, f64) = (14.0, 200.0);
const NEAR_WIDTHS: f64 = 10.0;
/// Number of harmonics for which [`SERIES`] holds.
const SERIES_HARMONICS: f64 = 15.0;
/// Shooting: time per square of masses and joints, s, without and with internal states of the
/// laws.
///
/// Measured: 25 ms for two masses, 0.6 s for four.
const SHOOTING: (f64, f64) = (1e-3, 1.5e-2);
/// Times of [`SHOOTING`] in a sweep with warm starts.
///
/// Measured for two masses and a joint: 0.7 ms with `coulomb-arctan` and `cubic`, 1.5 to 3.5 ms
/// with laws that have states.
const SHOOTING_TYPICAL: (f64, f64) = (5e-5, 3e-4);
/// Shooting with equal steps: the periods of transient motion that take the time of one orbit.
///
/// Measured: 0.29 s per point for a body on a contact of two directions, 0.33 s for three
/// bodies with two such contacts.
const EQUAL_STEP_PERIODS: f64 = 40.0;
/// Method `transient`: periods in which the mode with the least damping loses one digit, at
/// least and at most.
///
/// Measured at a damping ratio of 7e-4: exact laws 20 ms, 0.1 s, 0.5 s for 2, 4, 8 masses;
/// smooth laws 0.9 s and 8 s for 2 and 4. At 1.6 % a ring took 80 periods. The shortest windows
/// of two decays take 16.
const SETTLING_PERIODS: (f64, f64) = (30.0, 50_000.0);
/// The excitation moves modes up to this multiple of its highest frequency.
const EXCITED_FREQUENCY_FACTOR: f64 = 2.0;
/// Periods after which method `transient` gives up if the motion does not settle.
///
/// A law with unbounded force (a gap, a cubic spring) can cause this at some points. The factor
/// 2 counts the restart from rest after a warm start that did not settle.
const UNSETTLED_PERIODS: f64 = 2.0 * 4096.0;
/// Share of points that do not settle, averaged over studies with unbounded laws.
///
/// Measured: one in five of two masses on a hard cubic spring with little damping, none with
/// more.
const UNSETTLED_SHARE: f64 = 0.05;
/// Time of a period of integration, per square of masses and joints, s, without and with
/// internal states.
const PERIOD: (f64, f64) = (2.5e-4, 1.3e-3);
/// Time of an event-driven period per mass and slider, s, and per cube of their number, for the
/// decomposition of each new pattern.
///
/// Measured: 0.6, 3.5 and 21 ms for rings of 12, 24 and 48 masses and joints, 4 ms for three
/// masses and a joint of 32 sliders.
const PERIOD_EVENTS: (f64, f64) = (2e-5, 2.4e-8);
/// Time to decompose a new pattern of stick and slip, per cube of the degrees of freedom, s.
/// Measured: 4 ms for a ring of 20 blades on a rim.
const PATTERN: f64 = 6e-8;
/// New patterns per slider and period of a motion that does not repeat: a slider stops and
/// starts twice.
const PATTERNS: f64 = 2.0;
/// Number of digits to which an undamped fast oscillation shortens the integration steps: the
/// digits of the step tolerance.
const STEP_DIGITS: f64 = 9.0;
/// Excitation periods whose integration takes as long as one oscillation of the fastest mode; a
/// lower bound.
///
/// Measured: 0.8 s for four masses, 1000 oscillations at 18 kHz in 8 periods at 151 Hz.
const FAST_OSCILLATION: f64 = 0.2;
/// Equal steps per period, typical and hard, including the solutions with two and four times
/// the steps.
///
/// Measured: 0.7 to 2 ms per period for a body on a joint with little slip, 10 to 24 ms with
/// much slip.
const STEPS_PER_PERIOD: (f64, f64) = (2500.0, 25_000.0);
/// Time of one equal step, s: per direction of a joint, per pair of directions, and per pair of
/// masses.
///
/// Measured with little and much slip: 3 and 20 ms per period for five directions, 12 and 107
/// for eight that friction couples, 35 and 296 for 16 of these; the same for one joint of one
/// mass and of eight.
const STEP: (f64, f64, f64) = (7.5e-7, 5e-8, 4e-9);
/// Time that derivatives add to such a step, s, per pair of masses.
///
/// Measured for returns of 4096 steps: 6 ms for two masses and a contact of two directions,
/// 37 ms for 13 coordinates and a contact of three.
const STEP_DERIVATIVES: f64 = 4e-8;
/// Time to resolve and assemble a case, s.
const CASE_SECONDS: f64 = 2e-4;
/// Time of the modes of a case, s, per cube of its masses. Measured: 0.35 s for 500.
const MODES: f64 = 2.8e-9;
/// Time to read a structure given by matrices, with its factors, modes and samples of the
/// whole: coefficient (s) and exponent of its rows; and the time per place and row.
///
/// Measured: 0.2 s for 3,200 rows, 3 to 5 s for 28,000, 10 to 15 s for 70,000; 900 places of
/// 31,500 rows take 7.
const MATRICES: (f64, f64) = (2.4e-6, 1.4);
const PLACE_PER_ROW: f64 = 2e-7;
/// Basis check: time of the larger reduction in multiples of the first one, and time of a cold
/// orbit in it in multiples of an orbit.
///
/// Measured: twice as long for 3,200 rows; 57 instead of 10 coordinates of a chain of 300
/// masses, 0.3 s instead of 0.03.
const BASIS_CHECK: (f64, f64) = (2.0, 10.0);
/// Time to read, check and assemble, s, per mass and joint.
const ELEMENT_SECONDS: f64 = 5e-5;
/// Time to evaluate the motion at one instant, per mass and joint, s.
const INSTANT_SECONDS: f64 = 5e-7;

impl CostInputs<'_> {
    /// Returns the time of one orbit by the method of the study, s.
    pub fn orbit(&self) -> f64 {
        let case = self.case;
        let size = self.dofs + self.joints;
        let shooting = self.pace.select(SHOOTING_TYPICAL, SHOOTING);
        let shooting = size * size * self.fast_mode_factor() * if self.has_states { shooting.1 } else { shooting.0 };
        let series = self.series(case.method.options.get("harmonics").copied());
        match case.method.name.as_str() {
            _ if self.is_series() => {
                let whole = series * self.solved_share() * self.contact_held_factor();
                let given = case.method.options.get("harmonics").copied();
                whole.max(self.rigid_series(given))
                    + self.memory_laws_with_rigid(given)
                    + self.factorization_seconds(given)
                    + self.return_check()
            }
            "transient" => {
                let digit = LN_10 / (TAU * self.least_damping());
                let most = case.method.options.get("periods").copied().unwrap_or(SETTLING_PERIODS.1);
                let share = self.pace.select(0.0, UNSETTLED_SHARE);
                let unsettled = if self.unbounded_force { share * UNSETTLED_PERIODS } else { 0.0 };
                (digit.clamp(SETTLING_PERIODS.0, SETTLING_PERIODS.1) + unsettled).min(most) * self.period()
            }
            "shooting" if self.equal_steps => EQUAL_STEP_PERIODS * self.period(),
            _ if self.smooth => shooting,
            _ => self.events(),
        }
    }

    /// Returns the time of one event-driven orbit, s.
    fn events(&self) -> f64 {
        let counted = MULTIPLICATION_SECONDS * event_driven::orbit_work(self.system()).unwrap_or(0.0);
        let far = event_driven::COLD_START_FACTOR * counted;
        let usual = if self.is_dense(NEAR_WIDTHS) { counted } else { far };
        self.pace.select(EVENT_DRIVEN.0 + usual, EVENT_DRIVEN.1 + WAITING_FACTOR * far)
    }

    /// Returns true if there are several frequencies, spaced by at most `widths` widths of a
    /// resonance.
    fn is_dense(&self, widths: f64) -> bool {
        self.range().is_some_and(|(lowest, highest)| {
            self.frequencies > 1.0
                && (highest - lowest) <= (self.frequencies - 1.0) * widths * 2.0 * self.least_damping() * lowest
        })
    }

    /// Returns the time of one orbit of a linear reference, s.
    ///
    /// A linear reference has no joint that slips or opens, so its orbits are easy to find.
    pub fn reference(&self) -> f64 {
        if self.is_series() { self.orbit() / self.contact_held_factor() } else { self.orbit() }
    }

    /// Returns the factor on the time of orbits if only contacts hold some bodies.
    fn contact_held_factor(&self) -> f64 {
        let survey = &self.surveyed.survey;
        let contacts = self.smooth && self.equal_steps;
        if !contacts || survey.free().rigid == 0 || survey.system().cyclic().is_some() {
            return 1.0;
        }
        self.pace.select(if self.is_dense(NEAR_WIDTHS) { CONTACT_HELD.0 } else { CONTACT_HELD.1 }, 1.0)
    }

    /// Returns the number of steps along a curve: `usual` in the typical case, otherwise
    /// `hard`.
    pub fn steps(&self, usual: f64, hard: f64) -> f64 {
        self.pace.select(usual, hard)
    }

    /// Returns the share of the structure that is solved for an orbit.
    ///
    /// A ring in a travelling wave is solved by one sector of twice the size.
    pub fn solved_share(&self) -> f64 {
        self.system().cyclic().map_or(1.0, |ring| (2.0 / ring.sectors as f64).min(1.0))
    }

    /// Returns the time of harmonic balance for the whole structure, s.
    ///
    /// With `harmonics = None` the method chooses the number of harmonics.
    pub fn series(&self, harmonics: Option<f64>) -> f64 {
        let factor = match (self.smooth, self.is_rigid(), harmonics) {
            (_, _, None) if self.falling_friction => self.pace.select(HARD_FALLING.0, HARD_FALLING.1),
            (false, false, _) => 1.0,
            (_, _, None) => RIGID_FACTOR,
            (true, _, Some(_)) => HARD_SMOOTH,
            (false, true, Some(_)) if self.is_dense(NEAR_WIDTHS) => HARD_RIGID.0,
            (false, true, Some(_)) => self.pace.select(HARD_RIGID.1, HARD_RIGID.0),
        };
        let asked = self.case.method.options.get("tolerance").copied().unwrap_or(SERIES_TOLERANCE);
        let length = match harmonics {
            Some(harmonics) => harmonics / SERIES_HARMONICS,
            None => (SERIES_TOLERANCE / asked).powf(SERIES_ORDER.recip()).min(MAX_HARMONICS / SERIES_HARMONICS),
        };
        // friction that falls with velocity is hard to solve in the typical case too
        let usual = if self.falling_friction { SERIES } else { SERIES_TYPICAL };
        let each = self.pace.select(usual, SERIES) * (self.dofs + self.joints).max(1.0);
        (each + self.coupled_contacts()) * factor * length.max(1.0).powf(SERIES_LENGTH)
    }

    /// Returns the time to eliminate `unknowns` unknowns, s.
    pub fn elimination_seconds(&self, unknowns: f64) -> f64 {
        MULTIPLICATION_SECONDS * unknowns.powi(3) / 3.0
    }

    /// Returns the time that contacts add if a reduced structure couples all of them, s.
    fn coupled_contacts(&self) -> f64 {
        let system = self.system();
        let directions: usize = system.joints().iter().map(|joint| joint.law().directions()).sum();
        let all = system.reduced().is_some() && system.cyclic().is_none();
        if all { COUPLED_CONTACTS * (directions as f64).powi(2) } else { 0.0 }
    }

    /// Returns the elimination time of harmonic balance with rigid friction, s; zero without
    /// rigid friction.
    fn rigid_series(&self, harmonics: Option<f64>) -> f64 {
        let system = self.system();
        if self.smooth || !self.is_rigid() {
            return 0.0;
        }
        let step = |harmonics: f64| MULTIPLICATION_SECONDS * harmonic_balance::step_work(system, harmonics as usize);
        if let Some(given) = harmonics {
            let (own, estimate) = self.pace.select(RIGID_STEPS_TYPICAL, RIGID_STEPS);
            return own * step(given) + estimate * step(2.0 * given);
        }
        let asked = self.case.method.options.get("tolerance").copied().unwrap_or(SERIES_TOLERANCE);
        let longest =
            self.pace.select(RIGID_HARMONICS.0, RIGID_HARMONICS.1) * (SERIES_TOLERANCE / asked).powf(RIGID_ORDER);
        let longest = longest.min(MAX_HARMONICS);
        let each = self.pace.select(RIGID_STEPS_PER_HARMONIC.0, RIGID_STEPS_PER_HARMONIC.1);
        let sought = each * harmonic_balance::doubling_work(system, longest);
        MULTIPLICATION_SECONDS * sought.min(harmonic_balance::point_work_limit(system))
    }

    /// Returns the time of laws with memory in a model with rigid planar friction, s.
    ///
    /// Returns zero for given harmonics, which are fewer.
    fn memory_laws_with_rigid(&self, harmonics: Option<f64>) -> f64 {
        let laws = || self.system().joints().iter().map(|joint| joint.law());
        let is_rigid =
            |law: &SharedLaw| law.directions() > 1 && law.prox().is_some_and(|prox| prox.compliance() == 0.0);
        if harmonics.is_some() || !laws().any(is_rigid) {
            return 0.0;
        }
        let has_memory = |law: &&SharedLaw| law.step().is_some() || law.rate().is_some_and(|rate| rate.states() > 0);
        let pairs: usize = laws().filter(has_memory).map(|law| law.directions().pow(2)).sum();
        (self.pace.select(MEMORY_LAWS_WITH_RIGID.0, MEMORY_LAWS_WITH_RIGID.1) * pairs as f64)
            .min(MAX_MEMORY_LAWS_WITH_RIGID)
    }

    /// Returns the time to factor the dynamic stiffness for one orbit, s; zero if no factor is
    /// made.
    fn factorization_seconds(&self, harmonics: Option<f64>) -> f64 {
        let numbers = self.factor_bytes / NUMBER;
        let count = FACTORS.0 * harmonics.unwrap_or(SERIES_HARMONICS) + FACTORS.1;
        count * FACTOR.0 * numbers.powf(FACTOR.1)
    }

    /// Returns true if a joint has a rigid slider.
    fn is_rigid(&self) -> bool {
        let rigid =
            |law: &SharedLaw| law.sliders().is_some_and(|all| all.iter().any(|branch| branch.stiffness.is_none()));
        self.system().joints().iter().any(|joint| rigid(joint.law()))
    }

    /// Returns the time of one period of a transient, s.
    pub fn period(&self) -> f64 {
        let size = self.dofs + self.joints;
        let exact = self.dofs + self.sliders;
        // `width` makes methods integrate sliders that have no smooth replacement
        if self.equal_steps && (self.smooth || self.case.method.options.contains_key("width")) {
            return self.pace.select(STEPS_PER_PERIOD.0, STEPS_PER_PERIOD.1) * self.step();
        }
        match (self.smooth, self.has_states) {
            (false, _) => PERIOD_EVENTS.0 * exact + PERIOD_EVENTS.1 * exact.powi(3),
            (true, false) => PERIOD.0 * size * size * self.fast_mode_factor(),
            (true, true) => PERIOD.1 * size * size * self.fast_mode_factor(),
        }
    }

    /// Returns the time of the return check of a harmonic balance orbit in equal steps, s.
    ///
    /// Returns zero if the check takes no time compared with the orbit.
    fn return_check(&self) -> f64 {
        let Some((steps, with_derivatives)) = evidence_steps(self.system()) else { return 0.0 };
        let derivatives = if with_derivatives { STEP_DERIVATIVES * self.dofs.powi(2) } else { 0.0 };
        steps as f64 * (self.step() + derivatives)
    }

    /// Returns the time of an intermediate orbit, whose return is not checked, s.
    pub fn unchecked_orbit(&self) -> f64 {
        self.orbit() - if self.is_series() { self.return_check() } else { 0.0 }
    }

    /// Returns the time of one equal step, s.
    fn step(&self) -> f64 {
        let joints = self.system().joints();
        let directions = joints.iter().map(|joint| joint.law().directions()).sum::<usize>() as f64;
        STEP.0 * directions + STEP.1 * directions.powi(2) + STEP.2 * self.dofs.powi(2)
    }

    /// Returns the time to decompose the patterns of stick and slip in `periods` periods of a
    /// motion that does not repeat, s.
    pub fn patterns(&self, periods: f64) -> f64 {
        if self.smooth || self.equal_steps {
            return 0.0;
        }
        (periods * PATTERNS * self.sliders).max(1.0) * PATTERN * self.dofs.powi(3)
    }

    /// Returns the factor on the integration time of a period due to the fastest mode that does
    /// not decay within the period.
    fn fast_mode_factor(&self) -> f64 {
        let drive = self.range().map_or(self.slowest_mode(), |(lowest, _)| lowest);
        let modes = &self.surveyed.survey.stuck().elastic;
        let rings = modes.iter().filter(|mode| TAU * mode.damping * mode.omega < STEP_DIGITS * LN_10 * drive);
        (FAST_OSCILLATION * rings.map(|mode| mode.omega).fold(drive, f64::max) / drive.max(f64::MIN_POSITIVE)).max(1.0)
    }

    /// Returns the smallest modal damping ratio with all joints free.
    ///
    /// The hard case takes all modes. The typical case takes only modes that the excitation
    /// moves, because friction damps the others while they are visible.
    fn least_damping(&self) -> f64 {
        let modes = &self.surveyed.survey.free().elastic;
        let highest = self.range().map_or(f64::INFINITY, |(_, highest)| EXCITED_FREQUENCY_FACTOR * highest);
        let driven = modes.iter().filter(|mode| self.pace == Difficulty::Hard || mode.omega <= highest);
        driven.map(|mode| mode.damping).fold(1.0, f64::min).max(f64::MIN_POSITIVE)
    }

    /// Returns the time to evaluate the motion at `instants` instants, s.
    pub fn evaluation(&self, instants: f64) -> f64 {
        INSTANT_SECONDS * instants * (self.dofs + self.joints)
    }

    /// Returns the time to evaluate the columns of `output` for one orbit, s.
    pub fn output_seconds(&self) -> f64 {
        match self.case.values.names("output").unwrap_or_default().len() {
            0 => 0.0,
            some => self.evaluation(some as f64 * output_columns::INSTANTS as f64),
        }
    }
}
