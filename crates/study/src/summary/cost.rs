//! How much a study will hold and how long it will take, by counting: units of work, samples, columns; and by what
//! each method was measured to need.

use super::{Surveyed, range};
use crate::error::{Problem, StudyError};
use crate::study::{Case, Study};
use std::f64::consts::TAU;
use stickslip::law::{Law, RateLaw};
use stickslip::model::System;

/// Memory that a run may take unless it is told otherwise, bytes. What the machine has free may be less.
pub const MEMORY_LIMIT: u64 = 2_000_000_000;

/// What a study will hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Size {
    /// Rows of its tables.
    pub rows: u64,
    /// Its tables as numbers of eight bytes.
    pub results: u64,
    /// Most memory at one time, bytes: rough.
    pub memory: u64,
}

/// Bytes of a number in a table.
const NUMBER: f64 = 8.0;
/// Bytes of a word in a table: its handle, and its own piece of memory.
const WORD: f64 = 56.0;
/// Bytes of a cell as text of a CSV file. Measured: 85 for three numbers and a word.
const WRITTEN: f64 = 20.0;
/// Bytes of a point of a figure, in the dataset and drawn in all formats. Measured: 220 in HTML.
const DRAWN: f64 = 240.0;
/// Bytes of a case that waits to be computed, beside its matrices. Measured: 5.9 kB for seven elements.
const CASE: f64 = 3_500.0;
const CASE_ELEMENT: f64 = 250.0;
/// Bytes of an orbit of an exact law, per entry of its state and per switch; and of a smooth law per entry. Measured:
/// exact 8 kB for the couple and 170 kB for 8 masses and joints, smooth 80 kB and 600 kB.
const ORBIT_ENTRY: f64 = 500.0;
const SMOOTH_ENTRY: f64 = 24_000.0;
/// Samples of a motion are held whole until they are written, bytes per number and per sample.
const SAMPLE: f64 = 130.0;

/// A table to be: rows and columns.
#[derive(Debug, Clone, Copy, Default)]
struct Shape {
    rows: f64,
    numbers: f64,
    words: f64,
}

/// What a kind holds.
#[derive(Debug, Default)]
struct Holds {
    tables: Vec<Shape>,
    /// Points of figures.
    drawn: f64,
    /// What else it keeps until the end, bytes.
    kept: f64,
}

/// Counts that every kind knows.
struct Counts {
    cases: f64,
    frequencies: f64,
    varied: f64,
    n: f64,
    joints: f64,
    smooth: bool,
}

impl Counts {
    fn new(study: &Study, surveyed: &Surveyed) -> Self {
        let system = surveyed.survey.system();
        Counts {
            cases: study.cases() as f64,
            frequencies: surveyed.case.frequencies.as_ref().map_or(1, |f| f.len()) as f64,
            varied: surveyed.case.varied.len() as f64,
            n: system.dofs() as f64,
            joints: system.joints.len() as f64,
            smooth: system.joints.iter().any(|joint| joint.law.network().is_none()),
        }
    }

    fn points(&self) -> f64 {
        self.cases * self.frequencies
    }

    /// The column of the frequency, where a table has it for several frequencies only.
    fn several(&self) -> f64 {
        if self.frequencies > 1.0 { 1.0 } else { 0.0 }
    }

    /// Columns of one orbit: amplitude, mean, phase of each mass; dissipation and slip of each joint; evidence.
    fn orbit_columns(&self) -> (f64, f64) {
        (self.varied + 3.0 * self.n + 2.0 * self.joints + 6.0, 1.0)
    }

    /// Columns of one instant: time and frequency, displacement and velocity of each mass, three of each joint and its
    /// contact.
    fn instant_columns(&self) -> (f64, f64) {
        (self.varied + 2.0 + 2.0 * self.n + 3.0 * self.joints, self.joints)
    }

    fn orbit_bytes(&self) -> f64 {
        let state = 2.0 * self.n + self.joints + 1.0;
        if self.smooth { SMOOTH_ENTRY * state } else { ORBIT_ENTRY * state * (2.0 + 4.0 * self.joints) }
    }
}

/// Instants of a period beside the samples that were asked for: both ends, and the switches.
fn instants(case: &Case, joints: f64) -> f64 {
    case.values.count("samples").unwrap_or(720) as f64 + 1.0 + 4.0 * joints
}

/// Duration of one transient (s) and the number of its samples.
fn transient(case: &Case) -> (f64, f64) {
    let values = &case.values;
    let (low, high) = range(case).unzip();
    let period = |omega: f64| TAU / omega;
    let cycles = values.count("cycles").zip(low).map(|(cycles, omega)| cycles as f64 * period(omega));
    let run_up = values.table("run_up").and_then(|table| table.quantity("duration"));
    let duration = values.quantity("duration").or(cycles).or(run_up).unwrap_or(0.0);
    let per_cycle = values.count("samples_per_cycle").unwrap_or(64) as f64;
    let step = values.quantity("time_step").or(high.map(|omega| period(omega) / per_cycle));
    (duration, step.filter(|step| *step > 0.0).map_or(0.0, |step| duration / step + 1.0))
}

/// Points of a branch for each of the steps that were asked for: it shortens them where it bends. Measured: 3 to 15,
/// and 109 for a ring of three whose branch turns at every border of stick.
const BRANCH_POINTS: f64 = 5.0;
/// Bytes of an orbit that is a series, per harmonic coefficient of a place or joint. Measured: 15 kB for the couple,
/// 130 kB for 8 masses and joints, at 15 harmonics.
const SERIES_ENTRY: f64 = 80.0;
/// Panels of motions that are drawn.
const PANELS: f64 = 12.0;

/// What each kind holds; a kind that is not named here holds one row per point.
fn holds(study: &Study, surveyed: &Surveyed) -> Holds {
    let case = &surveyed.case;
    let counts = Counts::new(study, surveyed);
    let (points, n) = (counts.points(), counts.n);
    let (orbit_numbers, orbit_words) = counts.orbit_columns();
    let orbits = Shape { rows: points, numbers: orbit_numbers, words: orbit_words };
    match study.kind().name {
        "hysteresis" => {
            let loops = case.values.names("loop").map_or(counts.joints.max(1.0), |names| names.len() as f64);
            let rows = points * loops * instants(case, counts.joints);
            let table = Shape { rows, numbers: counts.varied + counts.several() + 3.0, words: 1.0 };
            let numbers = counts.varied + counts.several() + 5.0;
            let summary = Shape { rows: points * loops, numbers, words: 2.0 };
            Holds { tables: vec![table, summary], drawn: rows, kept: points * counts.orbit_bytes() }
        }
        "orbit" => {
            let rows = points * instants(case, counts.joints);
            let (numbers, words) = counts.instant_columns();
            let multipliers = Shape { rows: points * 2.0 * n, numbers: counts.varied + 5.0, words: 0.0 };
            let drawn = rows * (n + counts.joints);
            // beyond some panels the points are made, but not drawn
            let kept = points * counts.orbit_bytes() + drawn * 2.0 * NUMBER;
            let drawn = drawn.min(PANELS * instants(case, counts.joints) * (n + counts.joints));
            Holds { tables: vec![Shape { rows, numbers, words }, orbits, multipliers], drawn, kept }
        }
        "transient" => {
            let samples = transient(case).1;
            let rows = points * samples;
            let (numbers, words) = counts.instant_columns();
            let numbers = numbers + counts.several();
            let kept = rows * (SAMPLE + NUMBER * (2.0 * n + 4.0 * counts.joints));
            let drawn = points.min(PANELS) * samples * n;
            Holds { tables: vec![Shape { rows, numbers, words }], drawn, kept }
        }
        "performance" => {
            let table = Shape { rows: counts.cases, numbers: counts.varied + 4.0, words: 1.0 };
            let curves = counts.cases / study.varied_points().last().map_or(1.0, |last| *last as f64).max(1.0);
            let optimum = Shape { rows: curves, numbers: counts.varied + 2.0, words: 1.0 };
            Holds { tables: vec![table, optimum], drawn: counts.cases, kept: 0.0 }
        }
        "modes" => {
            let rows = counts.cases * mode_points(case);
            let table = Shape { rows, numbers: counts.varied + 3.0 + n, words: 0.0 };
            Holds { tables: vec![table], drawn: 2.0 * rows, kept: 0.0 }
        }
        "branch" => {
            let rows = branches(study, case) * steps(case) * BRANCH_POINTS;
            let table = Shape { rows, numbers: orbit_numbers, words: orbit_words };
            let harmonics = case.values.count("harmonics").unwrap_or(15) as f64;
            let kept = rows * SERIES_ENTRY * (2.0 * harmonics + 1.0) * (2.0 * n + 4.0 * counts.joints);
            Holds { tables: vec![table], drawn: rows * n, kept }
        }
        _ => {
            let peaks = Shape { rows: counts.cases * n, numbers: counts.varied + 3.0, words: 1.0 };
            Holds { tables: vec![orbits, peaks], drawn: points * n, kept: 0.0 }
        }
    }
}

fn mode_points(case: &Case) -> f64 {
    case.values.table("amplitude").and_then(|table| table.count("points")).unwrap_or(61) as f64
}

fn steps(case: &Case) -> f64 {
    case.values.count("steps").unwrap_or(100) as f64
}

/// Branches of a study: along the frequency one per case, along a parameter one per combination of the others.
fn branches(study: &Study, case: &Case) -> f64 {
    let one_frequency = case.frequencies.as_ref().is_some_and(|f| f.len() == 1);
    match study.varied_points().last() {
        Some(last) if one_frequency => study.cases() as f64 / (*last).max(1) as f64,
        _ => study.cases() as f64,
    }
}

pub(super) fn size(study: &Study, surveyed: &Surveyed) -> Size {
    let holds = holds(study, surveyed);
    let model = &surveyed.case.model;
    let elements =
        model.masses.len() + model.springs.len() + model.joints.len() + model.forces.len() + model.motions.len();
    let n = surveyed.survey.dofs() as f64;
    let matrices = NUMBER * n * (3.0 * n + 2.0 * model.joints.len() as f64);
    let waiting = study.cases() as f64 * (CASE + CASE_ELEMENT * elements as f64 + matrices);
    let rows: f64 = holds.tables.iter().map(|table| table.rows).sum();
    let cells = |numbers: f64, words: f64| -> f64 {
        holds.tables.iter().map(|table| table.rows * (numbers * table.numbers + words * table.words)).sum()
    };
    let tables = cells(NUMBER + WRITTEN, WORD + WRITTEN);
    // a float that is too large for the type becomes its largest value
    let whole = |value: f64| value as u64;
    Size {
        rows: whole(rows),
        results: whole(cells(NUMBER, NUMBER)),
        memory: whole(tables + DRAWN * holds.drawn + holds.kept + waiting),
    }
}

// ------------------------------------------------------------------------------------------ the limit

impl Size {
    /// Why a study is not run, if it would take more memory than it may.
    pub(crate) fn refusal(&self, study: &Study) -> Option<StudyError> {
        let limit = study.memory_limit();
        if self.memory <= limit {
            return None;
        }
        let message = format!(
            "this would need about {} of memory for {} rows of results; the limit is {}",
            bytes_text(self.memory),
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
            (Some(varied), frequencies) if study.cases() >= frequencies => &varied.place,
            _ => study.study.place_of("frequency", None),
        };
        Some(StudyError::at(&study.sources, Problem::new(place, "memory", message).help(help)))
    }
}

/// What may be used when nobody says: [`MEMORY_LIMIT`], or what the machine has if that is less.
pub(crate) fn default_limit() -> u64 {
    MEMORY_LIMIT.min(available().unwrap_or(MEMORY_LIMIT))
}

/// Memory that the machine can give, where Linux tells it.
fn available() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// A number of bytes for people: `4.2 GB`.
pub fn bytes_text(bytes: u64) -> String {
    let value = bytes as f64;
    for (size, unit) in [(1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")] {
        if value >= size {
            let scaled = value / size;
            return if scaled < 10.0 { format!("{scaled:.1} {unit}") } else { format!("{scaled:.0} {unit}") };
        }
    }
    format!("{bytes} B")
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
/// Event-driven: a closed form per segment, and a decomposition for each new pattern of stick and slip, whose number
/// grows with the joints. Measured: 3 ms at 8 masses and joints, 40 ms at 16, 0.23 s at 24.
const EVENT_DRIVEN: (f64, f64) = (2e-4, 3e-3);
/// Masses and joints of the second number.
const EVENT_DRIVEN_SIZE: f64 = 16.0;
/// Harmonic balance per mass and joint at 15 harmonics. Measured with springs before the sliders: 0.3 ms for the
/// couple, 21 ms at 32 blades.
const SERIES: f64 = 5e-4;
/// Rigid sliders and smooth laws need more harmonics and more steps: measured 20 ms at 4 blades, 0.9 s at 32. Where
/// the harmonics are given they need more steps only.
const HARD: f64 = 20.0;
const HARD_RIGID: f64 = 3.0;
const HARD_SMOOTH: f64 = 10.0;
/// Harmonics of [`SERIES`].
const SERIES_HARMONICS: f64 = 15.0;
/// Shooting, times the square of masses and joints; more where the sliders have springs. Measured: 25 ms for two
/// masses, 0.6 s for four.
const SHOOTING: (f64, f64) = (1e-3, 1.5e-2);
/// Method `transient`: the periods in which a mode with the least damping loses a digit, times a share of these.
/// Measured at a damping ratio of 7e-4: exact laws 20 ms, 0.1 s, 0.5 s for 2, 4, 8 masses; smooth laws 0.9 s and 8 s
/// for 2 and 4.
const SETTLING: (f64, f64) = (0.1, 1.0);
/// Fewest and most periods of it.
const SETTLING_PERIODS: (f64, f64) = (20.0, 50_000.0);
/// A period of a transient: events, per mass and joint; integration, times their square.
const PERIOD: (f64, f64, f64) = (3e-4, 2.5e-4, 1.3e-3);
/// Orbits that refine a peak of one mass.
const PEAK: f64 = 20.0;
/// Steps of the search for an optimum.
const OPTIMUM: f64 = 35.0;
/// Solutions per point of a mode, and per step of a branch, which it shortens.
const FOLLOWED: (f64, f64) = (8.0, 15.0);
/// Joints up to which `auto` takes events.
const AUTO: f64 = 12.0;

/// Rough time on one thread, s.
pub(super) fn seconds(study: &Study, surveyed: &Surveyed) -> f64 {
    let case = &surveyed.case;
    let counts = Counts::new(study, surveyed);
    let system = surveyed.survey.system();
    let points = counts.points();
    let orbit = orbit(surveyed, &counts);
    let series = series(system, &counts, case.values.count("harmonics").map(|h| h as f64));
    let work = match study.kind().name {
        "transient" => {
            let fastest = range(case).map_or(0.0, |(_, high)| high);
            let own = surveyed.survey.stuck().elastic.first().map_or(0.0, |mode| mode.omega);
            let periods = transient(case).0 * fastest.max(own) / TAU;
            points * periods * period(system, &counts)
        }
        "performance" => {
            let curves = study.cases() as f64 / study.varied_points().last().copied().unwrap_or(1).max(1) as f64;
            (counts.cases + curves * OPTIMUM) * (counts.frequencies + PEAK) * orbit
        }
        "modes" => counts.cases * mode_points(case) * FOLLOWED.0 * series,
        "branch" => branches(study, case) * steps(case) * FOLLOWED.1 * series,
        "response" if case.values.flag("peaks") != Some(false) && counts.frequencies > 2.0 => {
            (points + counts.cases * counts.n * PEAK) * orbit
        }
        _ => points * orbit,
    };
    let holds = holds(study, surveyed);
    let cells: f64 = holds.tables.iter().map(|table| table.rows * (table.numbers + table.words)).sum();
    OVERHEAD + GENEROUS * (work + CELL * cells + POINT * holds.drawn)
}

/// One orbit by the method of a case.
fn orbit(surveyed: &Surveyed, counts: &Counts) -> f64 {
    let (case, system, modes) = (&surveyed.case, surveyed.survey.system(), &surveyed.survey.free().elastic);
    let size = counts.n + counts.joints;
    let events = EVENT_DRIVEN.0 + EVENT_DRIVEN.1 * (size / EVENT_DRIVEN_SIZE).powi(4);
    let shooting = size * size * if has_states(system) { SHOOTING.1 } else { SHOOTING.0 };
    let series = series(system, counts, case.method.options.get("harmonics").copied());
    match case.method.name.as_str() {
        "harmonic-balance" => series,
        "transient" => {
            let damping = modes.iter().map(|mode| mode.damping).fold(1.0, f64::min).max(f64::MIN_POSITIVE);
            let digit = std::f64::consts::LN_10 / (TAU * damping);
            let share = if counts.smooth { SETTLING.1 } else { SETTLING.0 };
            (share * digit.clamp(SETTLING_PERIODS.0, SETTLING_PERIODS.1)) * period(system, counts)
        }
        _ if counts.smooth => shooting,
        "auto" if counts.joints > AUTO => series,
        _ => events,
    }
}

fn series(system: &System, counts: &Counts, harmonics: Option<f64>) -> f64 {
    let rigid = |law: &Law| law.network().is_some_and(|all| all.iter().any(|branch| branch.stiffness.is_none()));
    let any_rigid = system.joints.iter().any(|joint| rigid(&joint.law));
    let factor = match (counts.smooth, any_rigid, harmonics) {
        (false, false, _) => 1.0,
        (_, _, None) => HARD,
        (true, _, Some(_)) => HARD_SMOOTH,
        (false, true, Some(_)) => HARD_RIGID,
    };
    let length = (harmonics.unwrap_or(SERIES_HARMONICS) / SERIES_HARMONICS).max(1.0);
    SERIES * (counts.n + counts.joints).max(1.0) * factor * length * length
}

fn period(system: &System, counts: &Counts) -> f64 {
    let size = counts.n + counts.joints;
    match (counts.smooth, has_states(system)) {
        (false, _) => PERIOD.0 * size,
        (true, false) => PERIOD.1 * size * size,
        (true, true) => PERIOD.2 * size * size,
    }
}

/// Whether a law has internal states, which makes the flow stiff.
fn has_states(system: &System) -> bool {
    system.joints.iter().any(|joint| joint.law.rate().is_some_and(|law| law.states() > 0))
}
