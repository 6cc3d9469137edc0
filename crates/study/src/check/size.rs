//! Size of a study before its run: rows, bytes of its tables, and peak memory.
//!
//! Each study kind counts its rows and columns; the memory of a method is its measured bytes per
//! entry. A study above its memory limit is refused.

use crate::case::study::{Case, Study};
use crate::check::survey::{SurveyedCase, frequency_range};
use crate::results::decimation::MAX_ROWS;
use crate::run::output_columns;
use crate::run::work::UNITS_AHEAD;
use crate::syntax::error::{Problem, StudyError};
use crate::syntax::format::format_bytes;
use stickslip::curve::sweep::BLOCK;
use stickslip::law::SharedLaw;
use stickslip::method::{Method, auto::Auto, harmonic_balance};
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

/// Bytes and counts from which the memory of a run is estimated.
#[derive(Debug, Clone)]
struct MemoryModel {
    /// Bytes of a number in a table.
    number: f64,
    /// Bytes of a word in a table: its handle and its heap allocation.
    word: f64,
    /// Bytes of a cell as text in a CSV file. Measured: 85 for three numbers and a word.
    csv_cell: f64,
    /// Bytes of a point of a figure, in the dataset and drawn in all formats. Measured: 220 in
    /// HTML.
    figure_point: f64,
    /// Bytes of an orbit of exact laws per entry of its state and per switch.
    ///
    /// Measured: 8 kB for the couple and 170 kB for 8 masses and joints.
    orbit_entry: f64,
    /// Bytes of an orbit of smooth laws per entry of its state.
    ///
    /// Measured: 80 kB for the couple and 600 kB for 8 masses and joints.
    smooth_entry: f64,
    /// Bytes per harmonic coefficient of a place or joint while harmonic balance solves an orbit.
    ///
    /// Measured: 15 kB for the couple, 130 kB for 8 masses and joints, at 15 harmonics.
    series_entry: f64,
    /// Bytes of the samples of force and contact of a joint over a period.
    ///
    /// Measured: a ring of 480 blades and joints with seven harmonics takes 87 MB on two threads,
    /// including the orbits that are next to be solved.
    series_samples: f64,
    /// Bytes of a complex coefficient.
    ///
    /// An orbit keeps one for every degree of freedom, for each harmonic, the mean and the initial
    /// state.
    coefficient: f64,
    /// Complex coefficients per joint and harmonic: one for each direction.
    directions: f64,
    /// Bytes of the measured quantities of a place, including its name.
    place: f64,
    /// Samples per period at which `series_samples` was measured.
    reference_samples: f64,
    /// Numbers per entry of a full matrix for a method that integrates in time.
    ///
    /// These are three matrices of the structure, the inverse mass, and the return map with its
    /// products, which has twice the rows.
    time_method_matrices: f64,
    /// Bytes of the motion at one instant, per mass and joint.
    sample: f64,
    /// Points per case of a curve with adaptive frequencies. Measured: 100 to 600 at tolerances of
    /// 1 %.
    adaptive: f64,
    /// Switching points per period and joint, in addition to the requested instants.
    switches: f64,
    /// Harmonics of a series whose number is not given.
    series_harmonics: f64,
}

impl Default for MemoryModel {
    fn default() -> Self {
        MemoryModel {
            number: 8.0,
            word: 56.0,
            csv_cell: 20.0,
            figure_point: 240.0,
            orbit_entry: 500.0,
            smooth_entry: 24_000.0,
            series_entry: 80.0,
            series_samples: 40.0 * 1024.0,
            coefficient: 16.0,
            directions: 3.0,
            place: 100.0,
            reference_samples: 1024.0,
            time_method_matrices: 16.0,
            sample: 64.0,
            adaptive: 300.0,
            switches: 4.0,
            series_harmonics: 15.0,
        }
    }
}

/// Memory of stored factors and motions: number of factors, and bytes at most. The factor that
/// is being computed comes in addition.
const STORED_FACTORS: (f64, f64) = (2.0, 3e9);

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

/// The tables, the figure and the memory of a study, as its kind counts them.
#[derive(Debug, Default)]
pub struct PlannedSize {
    /// Shapes of its tables.
    pub tables: Vec<TableShape>,
    /// Number of points in figures.
    pub drawn: f64,
    /// Memory of one unit of work during its computation, without its tables, bytes.
    ///
    /// At most one unit per thread is computed at a time. The tables of units that wait are
    /// counted with the tables.
    pub unit: f64,
}

/// The counts from which a kind derives the size of a study. The first case represents all
/// cases.
#[derive(Debug, Clone)]
pub struct SizeInputs<'a> {
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
    surveyed: &'a SurveyedCase,
    /// True if a law is smooth, or is made smooth by `width`.
    smooth: bool,
    /// True if the method of the study is harmonic balance.
    harmonic_balance: bool,
    /// Memory of one factor of the dynamic stiffness in all rows, bytes; zero if none is made.
    /// Stored here because computing it takes seconds for a large structure.
    factor_bytes: f64,
    memory: MemoryModel,
}

/// Returns true if the method of a case is harmonic balance.
fn finds_series(case: &Case, system: &System) -> bool {
    match case.method.name.as_str() {
        "harmonic-balance" => true,
        "auto" => Auto.choice(system).method == harmonic_balance::NAME,
        _ => false,
    }
}

impl<'a> SizeInputs<'a> {
    /// Returns the counts of a study with this first case.
    pub(crate) fn new(study: &'a Study, surveyed: &'a SurveyedCase) -> Self {
        let (case, system) = (&surveyed.case, surveyed.survey.system());
        let memory = MemoryModel::default();
        // the option `width` makes exact laws smooth
        let width = case.method.options.get("width");
        let followed =
            |law: &SharedLaw| width.and_then(|width| law.smooth_counterpart(*width)).unwrap_or_else(|| law.clone());
        let laws: Vec<SharedLaw> = system.joints().iter().map(|joint| followed(joint.law())).collect();
        let given = case.frequencies.as_ref().map_or(1, |f| f.len()) as f64;
        let series = finds_series(case, system);
        let factor_bytes = if series { harmonic_balance::factor_bytes(system) } else { 0 };
        SizeInputs {
            study,
            case,
            cases: study.cases() as f64,
            frequencies: if study.is_adaptive() { memory.adaptive } else { given },
            varied: case.varied.len() as f64,
            dofs: system.dofs() as f64,
            places: system.places().len() as f64,
            joints: system.joints().len() as f64,
            surveyed,
            smooth: laws.iter().any(|law| law.ideal_elements().is_none()),
            harmonic_balance: series,
            factor_bytes: factor_bytes as f64,
            memory,
        }
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
        let switches = self.memory.switches * self.joints;
        // those of harmonic balance lie at its samples of the period
        let switches = if self.is_series() { switches.min(self.series_samples()) } else { switches };
        self.case.values.count("samples").unwrap_or(720) as f64 + 1.0 + switches
    }

    /// Returns the number of samples of a period in harmonic balance.
    fn series_samples(&self) -> f64 {
        self.case.method.options.get("samples").copied().unwrap_or(self.memory.reference_samples)
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
            let harmonics = self.case.method.options.get("harmonics").copied();
            let kept = self.kept_series_bytes(harmonics.unwrap_or(self.memory.series_harmonics), self.series_samples());
            return orbits * kept + self.orbit_bytes();
        }
        orbits * self.orbit_bytes()
    }

    /// Returns the bytes of a converged orbit with this number of harmonics.
    ///
    /// Measured: 1.0 MB for a ring of 12 sectors with 1188 coordinates and 12 joints of three
    /// directions, at 15 harmonics.
    pub fn kept_series_bytes(&self, harmonics: f64, samples: f64) -> f64 {
        let coefficients = (harmonics + 2.0) * (self.dofs + self.memory.directions * self.joints);
        self.memory.coefficient * coefficients
            + self.memory.place * self.places
            + self.memory.series_samples * samples / self.memory.reference_samples * self.joints
    }

    /// Returns the bytes of an orbit in memory while it is computed.
    pub fn orbit_bytes(&self) -> f64 {
        let state = 2.0 * self.dofs + self.joints + 1.0;
        if self.is_series() {
            let harmonics = self.case.method.options.get("harmonics").copied().unwrap_or(self.memory.series_harmonics);
            return self.series_bytes(harmonics) + self.memory.series_samples * self.joints;
        }
        let matrices = self.memory.time_method_matrices * self.memory.number * self.dofs * self.dofs;
        matrices
            + if self.smooth {
                self.memory.smooth_entry * state
            } else {
                self.memory.orbit_entry * state * (2.0 + self.memory.switches * self.joints)
            }
    }

    /// Returns true if the method of the study is harmonic balance.
    pub fn is_series(&self) -> bool {
        self.harmonic_balance
    }

    /// Returns the bytes of the motion at the instants of one period.
    pub fn samples_bytes(&self) -> f64 {
        self.instants() * self.memory.sample * (2.0 + self.dofs + self.joints)
    }

    /// Returns the bytes that harmonic balance needs to solve an orbit of this number of
    /// harmonics.
    pub fn series_bytes(&self, harmonics: f64) -> f64 {
        self.memory.series_entry * (2.0 * harmonics + 1.0) * (2.0 * self.dofs + 4.0 * self.joints)
    }
}

impl PlannedSize {
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

impl SizeInputs<'_> {
    /// Returns the size of a study with these tables, divided into `units` units of work.
    pub(crate) fn size(&self, planned: &PlannedSize, units: usize) -> StudySize {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let tables = planned.cells(self.memory.number + self.memory.csv_cell, self.memory.word + self.memory.csv_cell);
        // finished units wait until they are in order; a figure reads back at most
        // [`MAX_ROWS`] rows of a table
        let waiting = tables * ((UNITS_AHEAD * threads) as f64 / units.max(1) as f64).min(1.0);
        let shown =
            planned.figure_cells(self.memory.number + self.memory.csv_cell, self.memory.word + self.memory.csv_cell);
        let drawn = self.memory.figure_point * planned.drawn.min(MAX_ROWS as f64 * (self.places + self.joints));
        let factor = self.factor_bytes;
        let factors = factor + (STORED_FACTORS.0 * factor).min(STORED_FACTORS.1);
        let working = units.min(threads) as f64 * (planned.unit + factors);
        // a float above the largest value of the type becomes that value
        let whole = |value: f64| value as u64;
        StudySize {
            rows: whole(planned.rows()),
            results: whole(planned.cells(self.memory.number, self.memory.number)),
            memory: whole(tables.min(waiting + shown) + drawn + working),
            memory_all_tables: whole(tables + drawn + working),
        }
    }
}

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
        let lengths = ["samples", "samples_per_cycle", "cycles", "duration", "steps", "fields", "modes"].into_iter();
        let given: Vec<String> =
            lengths.filter(|key| study.study.entry(key).is_some()).map(|key| format!("lower `{key}`, ")).collect();
        let fewer = if study.points() > study.cases() { "use fewer frequencies, " } else { "" };
        let split = if study.cases() > 1 { "split `vary` over several files, " } else { "" };
        let lower = given.concat() + fewer + split;
        let help = format!("{lower}{}allow more with --memory", if lower.is_empty() { "" } else { "or " });
        // the error stands at the key that contributes most
        let place = match (study.varied.first(), study.points() / study.cases().max(1)) {
            (Some(varied), frequencies) if study.cases() >= frequencies => &varied.location,
            _ => study.study.location_of("frequency", None),
        };
        Some(StudyError::at_location(&study.sources, Problem::new(place, "memory", message).help(help)))
    }
}
