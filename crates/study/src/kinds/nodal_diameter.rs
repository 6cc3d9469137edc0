//! Frequencies of a tuned disk over its nodal diameters, with all joints free and with all of them stuck.

use super::keys::anything;
use crate::columns::FREQUENCY;
use crate::cost::{Cost, Costing, Shape};
use crate::dataset::{Axis, Figure, Panel, Series, Style};
use crate::drawing::{Drawing, MOST_PANELS, Stretch, largest, numbers, words};
use crate::info::{Complaint, KindInfo};
use crate::key::{Takes, default};
use crate::kind::Kind;
use crate::rows::Rows;
use crate::values::hertz;
use crate::work::{CONVERGED, Computed, Grain, Part, Prepared, Work};
use stickslip::dimension::Dimension;
use stickslip::model::{Model, WaveModes};

/// The table, and its columns.
const TABLE: &str = "nodal_diameters";
const DIAMETER: &str = "nodal_diameter";
const MODE: &str = "mode";
const JOINTS: &str = "joints";
/// Both states of the joints, as in the column of that name.
pub(super) const STATES: [&str; 2] = ["free", "stuck"];

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "nodal-diameter",
        summary: "frequencies of a tuned disk over its nodal diameters, all joints free and all joints stuck",
        keys: &[default("modes", Takes::Count(1, 100), "4", "lowest modes of every nodal diameter", "4")],
        check: |_, model, _| check_disk(model),
        axes: [Some(Dimension::NONE), Some(Dimension::FREQUENCY)],
        uses_method: false,
        needs: anything,
        adapts: false,
        tables: &[TABLE],
    },
    grain: |_| Grain::Case,
    cost,
    warnings: |_| Vec::new(),
    compute,
    draw,
};

/// Whether the model is a disk of equal sectors.
fn check_disk(model: &Model) -> Result<(), Complaint> {
    match model.ring {
        Some(ring) if ring.equal => Ok(()),
        Some(_) => {
            let message = "the sectors differ, and a mistuned disk has no nodal diameters";
            Err(Complaint::new("kind", message, "leave `mistuning` out of [disk]; its modes are those of a response"))
        }
        None => {
            let message = "the model is no disk, and only disks have nodal diameters";
            Err(Complaint::new("kind", message, "state one sector, and add [disk] with `sectors`"))
        }
    }
}

fn cost(costing: &Costing<'_>) -> Cost {
    let modes = costing.case.values.count("modes").unwrap_or(4) as f64;
    let sectors = costing.case.model.ring.map_or(2.0, |ring| ring.sectors as f64);
    let (waves, each) = (sectors / 2.0 + 1.0, 2.0 * costing.masses / sectors);
    let rows = costing.cases * waves * 2.0 * modes;
    Cost {
        tables: vec![Shape { rows, numbers: costing.varied + 4.0, words: 1.0 }],
        drawn: rows,
        unit: 8.0 * each * each,
        work: costing.cases * waves * each.powi(3) * EIGEN,
    }
}

/// Time of an eigenvalue problem over the cube of its size, s.
const EIGEN: f64 = 1e-8;

/// What is wrong with sectors that have no modes.
const TOO_LARGE: &str = "the sectors are too large for all of their modes, or without masses; of a sector by its matrices take fewer coordinates \
                         with `reduce`";

/// The lowest modes by nodal diameter, or that the sectors are too large for that.
pub(super) fn waves(model: &Model, most: usize) -> Result<Vec<WaveModes>, String> {
    match model.wave_modes(most) {
        Ok(Some(waves)) => Ok(waves),
        Ok(None) => Err(TOO_LARGE.to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

fn compute(work: &Work<'_>) -> Computed {
    let prepared = work.case();
    let mut part = Part::default();
    let mut rows = Rows::default();
    let most = prepared.case.values.count("modes").unwrap_or(4) as usize;
    match waves(&prepared.case.model, most) {
        Ok(waves) => {
            part.count(|| place_of(prepared), CONVERGED, None);
            write(prepared, &waves, &mut rows);
        }
        Err(reason) => part.count(|| place_of(prepared), "failed", Some(reason)),
    }
    (work.context.finished)();
    part.tables = vec![rows];
    Ok(part)
}

fn place_of(prepared: &Prepared) -> String {
    prepared.case.label()
}

fn write(prepared: &Prepared, waves: &[WaveModes], rows: &mut Rows) {
    let most = prepared.case.values.count("modes").unwrap_or(4) as usize;
    for (state, name) in STATES.into_iter().enumerate() {
        for wave in waves {
            let modes = if state == 0 { &wave.free } else { &wave.stuck };
            for (mode, found) in modes.elastic.iter().take(most).enumerate() {
                rows.varied(&prepared.case);
                rows.text(JOINTS, name);
                rows.integer(DIAMETER, wave.diameter as u64);
                rows.integer(MODE, mode as u64 + 1);
                rows.number(FREQUENCY, hertz(found.omega));
                rows.number("damping_ratio", found.damping);
                rows.end();
            }
        }
    }
}

/// A panel for every case: a line with marks for every mode, joints free and joints stuck.
fn draw(drawing: &Drawing<'_>) -> Figure {
    let Some(table) = drawing.table(TABLE) else { return Figure::default() };
    let (y, factor) = drawing.axis(1, "frequency", largest(table, [FREQUENCY.to_owned()]), "Hz");
    let panel = |stretch: &Stretch| Panel {
        title: stretch.label(),
        x: Axis::new("nodal diameters", "").whole(),
        y: y.clone(),
        series: lines(table, stretch, factor),
        ..Panel::default()
    };
    Figure { panels: drawing.stretches(table).iter().take(MOST_PANELS).map(panel).collect(), ..Figure::default() }
}

fn lines(table: &crate::dataset::Table, stretch: &Stretch, factor: f64) -> Vec<Series> {
    let (Some(diameters), Some(modes)) = (table.integers(DIAMETER), table.integers(MODE)) else { return Vec::new() };
    let states = words(table, JOINTS);
    let frequencies = numbers(table, FREQUENCY, 0..table.rows());
    let highest = stretch.rows.clone().map(|row| modes[row]).max().unwrap_or(0);
    let mut series = Vec::new();
    for (colour, state) in STATES.into_iter().enumerate() {
        for mode in 1..=highest {
            let rows = || stretch.rows.clone().filter(|row| modes[*row] == mode && states[*row] == state);
            let x: Vec<f64> = rows().map(|row| diameters[row] as f64).collect();
            let y: Vec<f64> = rows().map(|row| frequencies[row] * factor).collect();
            let style = if colour == 0 { Style::Solid } else { Style::Dashed };
            let line = Series::line(format!("joints {state}"), x.clone(), y.clone(), colour);
            series.push(Series { style, ..line });
            series.push(Series::marks("", x, y, colour));
        }
    }
    series
}
