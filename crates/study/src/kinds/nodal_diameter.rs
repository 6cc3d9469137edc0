//! Frequencies of a tuned disk over its nodal diameters, with all joints free and all stuck,
//! and mode shapes.

use super::shared::disk_shape::{self, PlaceInSectors, place_and_sector};
use super::shared::keys::no_requirements;
use crate::case::values::{Values, hertz};
use crate::check::cost::{Cost, CostInputs, TableShape};
use crate::kinds::info::{KeyError, KindInfo};
use crate::kinds::kind::Kind;
use crate::results::columns::{FREQUENCY, phase_of, shape_of};
use crate::results::dataset::{Axis, Figure, Panel, Series, Style, Table};
use crate::results::draw_panels;
use crate::results::drawing::{CaseRows, FigureInput, MAX_PANELS, join_title, largest, numbers, words};
use crate::results::table_builder::TableBuilder;
use crate::run::work::{CONVERGED, Computed, PreparedCase, UnitResult, UnitSize, UnitTask};
use crate::syntax::format::format_significant;
use crate::syntax::key::{ValueType, default, optional};
use stickslip::dimension::Dimension;
use stickslip::model::{Model, WaveModes};

/// Names of the table and its columns.
const TABLE: &str = "nodal_diameters";
const DIAMETER: &str = "nodal_diameter";
const MODE: &str = "mode";
const JOINTS: &str = "joints";
/// Both states of the joints, as written in the column `joints`.
pub(super) const STATES: [&str; 2] = ["free", "stuck"];
/// Largest number of shapes drawn per case.
const MAX_SHAPES: usize = 4;

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "nodal-diameter",
        summary: "natural frequencies of a tuned disk over its nodal diameters, with all joints free and all stuck, \
            and mode shapes",
        keys: &[
            default("modes", ValueType::Count(1, 100), "4", "lowest modes of every nodal diameter", "4"),
            default(SHAPES, ValueType::Flag, "true", "draws the mode shapes; the table always contains them", "false"),
            optional(
                DIAMETER,
                ValueType::Count(0, 100_000),
                "the nodal diameter whose lowest modes are drawn; default: the first mode (or `mode`) of the lowest \
                 nodal diameters",
                "3",
            ),
            optional(
                MODE,
                ValueType::Count(1, 100),
                "number of the drawn mode, by ascending frequency in its nodal diameter",
                "1",
            ),
            default(
                JOINTS,
                ValueType::Choice(states),
                STATES[0],
                "state of the joints in the drawn shapes",
                "\"stuck\"",
            ),
        ],
        check,
        axes: [Some(Dimension::NONE), Some(Dimension::FREQUENCY)],
        uses_method: false,
        needs: no_requirements,
        adapts: false,
        tables: &[TABLE],
    },
    unit_size: |_| UnitSize::Case,
    cost,
    warnings: |_| Vec::new(),
    compute,
    draw,
};

const SHAPES: &str = "shapes";

fn states() -> Vec<(&'static str, &'static str)> {
    vec![(STATES[0], "no joint carries a force"), (STATES[1], "no joint slips")]
}

fn check(values: &Values, model: &Model, _: usize) -> Result<(), KeyError> {
    check_disk(model)?;
    let (most, sectors) = (values.count("modes").unwrap_or(4), model.ring.map_or(0, |ring| ring.sectors as u64));
    if let Some(diameter) = values.count(DIAMETER).filter(|diameter| 2 * diameter > sectors) {
        let message = format!("a disk of {sectors} sectors has no {diameter} nodal diameters");
        return Err(KeyError::new(DIAMETER, message, format!("choose a nodal diameter from 0 to {}", sectors / 2)));
    }
    if let Some(mode) = values.count(MODE).filter(|mode| *mode > most) {
        let message = format!("mode {mode} is not among the {most} lowest that are computed");
        return Err(KeyError::new(MODE, message, format!("write modes = {mode}, or a mode from 1 to {most}")));
    }
    Ok(())
}

/// Checks that the model is a disk of equal sectors.
fn check_disk(model: &Model) -> Result<(), KeyError> {
    match model.ring {
        Some(ring) if ring.equal => Ok(()),
        Some(_) => {
            let message = "the sectors differ, so the modes of this mistuned disk have no nodal diameter";
            Err(KeyError::new(
                "kind",
                message,
                "remove `mistuning` from [disk], or use kind = \"modes\" for the modes of the whole ring",
            ))
        }
        None => {
            let message = "the model is not a disk; only disks have nodal diameters";
            Err(KeyError::new("kind", message, "state one sector, and add [disk] with `sectors`"))
        }
    }
}

fn cost(costing: &CostInputs<'_>) -> Cost {
    let modes = costing.case.values.count("modes").unwrap_or(4) as f64;
    let sectors = costing.case.model.ring.map_or(2.0, |ring| ring.sectors as f64);
    let (waves, each) = (sectors / 2.0 + 1.0, 2.0 * costing.dofs / sectors);
    let rows = costing.cases * waves * 2.0 * modes;
    let shapes = 2.0 * costing.places / sectors;
    Cost {
        tables: vec![TableShape { rows, numbers: costing.varied + 4.0 + shapes, words: 1.0 }],
        drawn: rows,
        unit: if each > MAX_DENSE_SIZE { FACTOR * each } else { 8.0 * each * each },
        conditional_work: None,
        work: costing.cases
            * waves
            * if each > MAX_DENSE_SIZE { LOWEST_MODES * each.powf(1.5) } else { EIGEN * each.powi(3) },
    }
}

/// Size above which sparse factors give only the lowest modes.
const MAX_DENSE_SIZE: f64 = 700.0;
/// Time of an eigenvalue problem per cube of its size, s.
const EIGEN: f64 = 1e-8;
/// Time of the lowest modes of a wave, free and stuck, per size to the power of 1.5, s.
/// Measured: 8 s for a sector of 1935 rows in seven waves.
const LOWEST_MODES: f64 = 4.6e-6;
/// Bytes of matrices and factors per row. Measured: 0.7 GB for 61,000 rows.
const FACTOR: f64 = 12e3;

/// Error text for sectors whose modes cannot be computed.
const TOO_LARGE: &str = "the sectors are too large to compute all their modes, or have no mass; for a sector given \
    by matrices, set `reduce` in [structure]";

/// Returns the lowest modes by nodal diameter.
///
/// # Errors
/// Returns a text if the sectors are too large or the modes are not found.
pub(super) fn waves(model: &Model, most: usize) -> Result<Vec<WaveModes>, String> {
    match model.wave_modes(most) {
        Ok(Some(waves)) => Ok(waves),
        Ok(None) => Err(TOO_LARGE.to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let prepared = work.case();
    let mut part = UnitResult::default();
    let mut rows = TableBuilder::default();
    let most = prepared.case.values.count("modes").unwrap_or(4) as usize;
    match waves(&prepared.case.model, most) {
        Ok(waves) => {
            part.count(|| location_of(prepared), CONVERGED, None);
            write(prepared, &waves, &mut rows);
        }
        Err(reason) => part.count(|| location_of(prepared), "failed", Some(reason)),
    }
    (work.context.finished)();
    part.tables = vec![rows];
    Ok(part)
}

fn location_of(prepared: &PreparedCase) -> String {
    prepared.case.label()
}

fn write(prepared: &PreparedCase, waves: &[WaveModes], rows: &mut TableBuilder) {
    let most = prepared.case.values.count("modes").unwrap_or(4) as usize;
    let places = places(&prepared.case.model);
    for (state, name) in STATES.into_iter().enumerate() {
        for wave in waves {
            let (modes, shapes) = [(&wave.free, &wave.free_shapes), (&wave.stuck, &wave.stuck_shapes)][state];
            for (mode, found) in modes.elastic.iter().take(most).enumerate() {
                rows.varied(&prepared.case);
                rows.text(JOINTS, name);
                rows.integer(DIAMETER, wave.diameter as u64);
                rows.integer(MODE, mode as u64 + 1);
                rows.number(FREQUENCY, hertz(found.omega));
                rows.number("damping_ratio", found.damping);
                for (i, (name, place)) in places.iter().enumerate() {
                    // rotations of a mode of unit modal mass are left out: their unit is rad/(m
                    // √kg), not 1/√kg
                    if prepared.case.model.is_rotation(name) {
                        continue;
                    }
                    let at = shapes.get(mode).map(|shape| shape[i].to_polar());
                    rows.number(&shape_of(place), at.map_or(f64::NAN, |(size, _)| size));
                    rows.number(&phase_of(place), at.map_or(f64::NAN, |(_, phase)| phase.to_degrees()));
                }
                rows.reduction_error(prepared.system.reduction_evidence());
                rows.end_row();
            }
        }
    }
}

/// Returns the places of the first sector: name in the ring and name in the sector.
fn places(model: &Model) -> Vec<(String, String)> {
    let both = |name: String| place_and_sector(&name).map(|(place, _)| (name, place));
    model.sector_places().into_iter().filter_map(both).collect()
}

/// Draws a panel per case: a line with marks for every mode, with joints free and joints stuck.
///
/// Shapes follow if the figure has room.
fn draw(drawing: &FigureInput<'_>) -> Figure {
    let Some(table) = drawing.table(TABLE) else { return Figure::default() };
    let (y, factor) = drawing.axis(1, "frequency", largest(table, [FREQUENCY.to_owned()]), "Hz");
    let panel = |case_rows: &CaseRows, title: String| Panel {
        title,
        x: Axis::new("nodal diameters", "").with_whole_numbers(),
        y: y.clone(),
        series: lines(table, case_rows, factor),
        ..Panel::default()
    };
    let cases = drawing.case_rows(table);
    let shapes_fit = cases.len() * (1 + MAX_SHAPES) <= MAX_PANELS;
    let case_panels = |case_rows: &CaseRows, title: String| {
        let shapes = if shapes_fit { wheels(drawing, table, case_rows) } else { Vec::new() };
        std::iter::once(panel(case_rows, title)).chain(shapes).collect::<Vec<_>>()
    };
    Figure { panels: draw_panels::panels(drawing, &cases, &case_panels), ..Figure::default() }
}

/// Returns the shapes of a case.
///
/// These are the lowest modes of one nodal diameter, one mode of the lowest nodal diameters, or
/// one mode of one nodal diameter.
fn wheels(drawing: &FigureInput<'_>, table: &Table, case_rows: &CaseRows) -> Vec<Panel> {
    let Ok(case) = drawing.study.case(case_rows.case) else { return Vec::new() };
    let (Some(ring), values) = (case.model.ring, &case.values) else { return Vec::new() };
    let (Some(diameters), Some(modes)) = (table.integers(DIAMETER), table.integers(MODE)) else { return Vec::new() };
    if values.flag(SHAPES) == Some(false) {
        return Vec::new();
    }
    let (diameter, mode) = (values.count(DIAMETER), values.count(MODE));
    let state = values.text(JOINTS).unwrap_or(STATES[0]);
    let wanted = |row: &usize| {
        words(table, JOINTS).get(*row).is_some_and(|joints| joints == state)
            && diameter.is_none_or(|diameter| diameters[*row] == diameter)
            && match mode {
                Some(mode) => modes[*row] == mode,
                None => diameter.is_some() || modes[*row] == 1,
            }
    };
    let frequencies = numbers(table, FREQUENCY, 0..table.rows());
    let places: Vec<(String, String)> = places(&case.model)
        .into_iter()
        .filter(|(name, _)| drawing.shows(name) && !case.model.is_rotation(name))
        .collect();
    let shape_panel = |row: usize| {
        let (mode, diameter) = (modes[row], diameters[row]);
        let at = |column: &str| numbers(table, column, row..row + 1)[0];
        let place_in_sectors = |(_, place): &(String, String)| {
            let (size, phase) = (at(&shape_of(place)), at(&phase_of(place)));
            PlaceInSectors::from_wave(place.clone(), size, phase, diameter as usize, ring.sectors)
        };
        let many = if diameter == 1 { "" } else { "s" };
        let frequency = format!("{} Hz", format_significant(frequencies[row], 5));
        let joints = if state == STATES[0] { String::new() } else { format!("joints {state}") };
        let title =
            [case_rows.label(), format!("mode {mode}"), format!("{diameter} nodal diameter{many}"), frequency, joints];
        disk_shape::panel(
            &places.iter().map(place_in_sectors).collect::<Vec<_>>(),
            ring.sectors,
            join_title(title),
            STATES.len(),
        )
    };
    case_rows.rows.clone().filter(wanted).take(MAX_SHAPES).filter_map(shape_panel).collect()
}

fn lines(table: &Table, case_rows: &CaseRows, factor: f64) -> Vec<Series> {
    let (Some(diameters), Some(modes)) = (table.integers(DIAMETER), table.integers(MODE)) else { return Vec::new() };
    let states = words(table, JOINTS);
    let frequencies = numbers(table, FREQUENCY, 0..table.rows());
    let highest = case_rows.rows.clone().map(|row| modes[row]).max().unwrap_or(0);
    let mut series = Vec::new();
    for (colour, state) in STATES.into_iter().enumerate() {
        for mode in 1..=highest {
            let rows = || case_rows.rows.clone().filter(|row| modes[*row] == mode && states[*row] == state);
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
