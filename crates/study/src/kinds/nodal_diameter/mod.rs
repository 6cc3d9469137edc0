//! Frequencies of a tuned disk over its nodal diameters, with all joints free and all stuck,
//! and mode shapes.

mod figure;

use super::shared::fields::{self, Fields};
use super::shared::keys::no_requirements;
use super::shared::stress::{self, STRESS, Stresses};
use crate::case::values::{Values, hertz};
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::kinds::info::{KeyError, KindInfo};
use crate::kinds::kind::{Kind, Probe};
use crate::results::columns::{FREQUENCY, phase_of, place_and_sector, shape_of};
use crate::results::dataset::FIELDS;
use crate::results::table_builder::TableBuilder;
use crate::run::work::{CONVERGED, Computed, PreparedCase, UnitResult, UnitSize, UnitTask};
use crate::syntax::key::{ValueType, default, optional};
use num_complex::Complex64;
use stickslip::dimension::Dimension;
use stickslip::model::{CyclicSymmetry, Model, System, WaveModes};

/// Names of the table and its columns.
const TABLE: &str = "nodal_diameters";
const DIAMETER: &str = "nodal_diameter";
const MODE: &str = "mode";
const JOINTS: &str = "joints";
/// Column with the amplitude of a stress in a mode of unit modal mass.
const AMPLITUDE_OF_UNIT_MODE: &str = "amplitude_Pa_per_m_sqrt_kg";
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
                "the nodal diameter whose lowest modes are drawn, and whose `fields` are written; default: the first mode \
                 (or `mode`) of the lowest nodal diameters is drawn",
                "3",
            ),
            optional(
                MODE,
                ValueType::Count(1, 100),
                "number of the mode that is drawn, and whose `fields` are written, by ascending frequency in its nodal \
                 diameter",
                "1",
            ),
            optional(
                JOINTS,
                ValueType::Choice(states),
                "state of the joints in the drawn shapes (default: free) and in `fields` (default: both states)",
                "\"stuck\"",
            ),
            fields::KEY,
        ],
        check,
        axes: [Some(Dimension::NONE), Some(Dimension::FREQUENCY)],
        uses_method: false,
        needs: no_requirements,
        adapts: false,
        tables: &[TABLE, FIELDS, STRESS],
    },
    unit_size: |_| UnitSize::Case,
    size,
    warnings: |_| Vec::new(),
    probe: Probe::Unit { name: "case" },
    compute,
    draw: figure::draw,
};

const SHAPES: &str = "shapes";

fn states() -> Vec<(&'static str, &'static str)> {
    vec![(STATES[0], "no joint carries a force"), (STATES[1], "no joint slips")]
}

fn check(values: &Values, model: &Model, _: usize) -> Result<(), KeyError> {
    check_disk(model)?;
    fields::check(values, model)?;
    let (most, sectors) = (values.count("modes").unwrap_or(4), model.ring.map_or(0, |ring| ring.sectors as u64));
    if let Some(diameter) = values.count(DIAMETER).filter(|diameter| 2 * diameter > sectors) {
        let message = format!("a disk of {sectors} sectors has no modes with {diameter} nodal diameters");
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

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let modes = inputs.case.values.count("modes").unwrap_or(4) as f64;
    let sectors = inputs.case.model.ring.map_or(2.0, |ring| ring.sectors as f64);
    let (waves, each) = (sectors / 2.0 + 1.0, 2.0 * inputs.dofs / sectors);
    let rows = inputs.cases * waves * 2.0 * modes;
    let shapes = 2.0 * inputs.places / sectors;
    let selected = WrittenModes::new(&inputs.case.values);
    let of = |is_stated: bool, all: f64| if is_stated { 1.0 } else { all };
    let written = of(selected.diameter.is_some(), waves) * of(selected.mode.is_some(), modes);
    let nodes = fields::size(inputs, inputs.cases * written * of(selected.joints.is_some(), 2.0));
    PlannedSize {
        drawn: rows + nodes.rows,
        tables: vec![
            TableShape { rows, numbers: inputs.varied + 4.0 + shapes, words: 1.0 },
            nodes,
            stress::size(inputs, rows, 1),
        ],
        // Size above which sparse factors give only the lowest modes.
        // Bytes of matrices and factors per row. Measured: 0.7 GB for 61,000 rows.
        unit: if each > 700.0 { 12e3 * each } else { 8.0 * each * each },
    }
}

/// Error text for sectors whose modes cannot be computed.
const TOO_LARGE: &str = "the sectors are too large to compute all their modes, or have no mass; for a sector given \
    by matrices, set `reduce` in [structure]";

/// Returns the lowest modes by nodal diameter of a model and its system.
///
/// # Errors
/// Returns a text if the sectors are too large or the modes are not found.
pub(super) fn waves(model: &Model, system: &System, most: usize) -> Result<Vec<WaveModes>, String> {
    model.wave_modes_of(system, most).ok_or_else(|| TOO_LARGE.to_owned())
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let prepared = work.case();
    let mut part = UnitResult::default();
    let (mut rows, mut of_nodes) = (TableBuilder::default(), TableBuilder::default());
    let mut of_stresses = TableBuilder::default();
    let most = prepared.case.values.count("modes").unwrap_or(4) as usize;
    match waves(&prepared.case.model, &prepared.system, most) {
        Ok(waves) => {
            part.count(|| location_of(prepared), CONVERGED, None);
            write(prepared, &waves, &mut rows);
            if let Some(nodes) = Fields::new(work.study, prepared, &mut part) {
                let selected = WrittenModes::new(&prepared.case.values);
                each_mode(prepared, &waves, &selected, |head, omega, motion| {
                    nodes.write_harmonic(prepared, omega, motion, head, &mut of_nodes);
                });
            }
            if let Some(stresses) = Stresses::new(work.study, prepared, &mut part) {
                each_mode(prepared, &waves, &WrittenModes::default(), |head, omega, motion| {
                    let head = |rows: &mut TableBuilder| {
                        head(rows);
                        rows.number(FREQUENCY, hertz(omega));
                    };
                    // all sectors have the same amplitudes
                    stresses.write_harmonic(prepared, (0, motion), AMPLITUDE_OF_UNIT_MODE, &head, &mut of_stresses);
                });
            }
        }
        Err(reason) => part.count(|| location_of(prepared), "failed", Some(reason)),
    }
    (work.context.finished)();
    part.tables = vec![rows, of_nodes, of_stresses];
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

/// The modes that are written; all where nothing is stated.
#[derive(Default)]
struct WrittenModes<'a> {
    joints: Option<&'a str>,
    diameter: Option<u64>,
    mode: Option<u64>,
}

impl<'a> WrittenModes<'a> {
    fn new(values: &'a Values) -> Self {
        WrittenModes { joints: values.text(JOINTS), diameter: values.count(DIAMETER), mode: values.count(MODE) }
    }

    fn contains(&self, joints: &str, diameter: usize, mode: usize) -> bool {
        self.joints.is_none_or(|own| own == joints)
            && self.diameter.is_none_or(|own| own == diameter as u64)
            && self.mode.is_none_or(|own| own == mode as u64)
    }
}

/// Calls `write` with every written mode of unit modal mass: its columns in the table, its
/// frequency (rad/s), and its motion of all degrees of freedom of the ring.
fn each_mode(
    prepared: &PreparedCase,
    waves: &[WaveModes],
    written: &WrittenModes<'_>,
    mut write: impl FnMut(&dyn Fn(&mut TableBuilder), f64, &[Complex64]),
) {
    let most = prepared.case.values.count("modes").unwrap_or(4) as usize;
    let sectors = prepared.case.model.ring.map_or(1, |ring| ring.sectors);
    for (state, name) in STATES.into_iter().enumerate() {
        for wave in waves {
            let symmetry = CyclicSymmetry { sectors, order: wave.diameter };
            let (modes, motions) = [(&wave.free, &wave.free_motions), (&wave.stuck, &wave.stuck_motions)][state];
            for (mode, (found, motion)) in modes.elastic.iter().zip(motions).take(most).enumerate() {
                if !written.contains(name, wave.diameter, mode + 1) {
                    continue;
                }
                let turns = (0..sectors).map(|sector| symmetry.phase_factor(1, sector));
                let motion: Vec<Complex64> = turns.flat_map(|turn| motion.iter().map(move |x| x * turn)).collect();
                let head = |rows: &mut TableBuilder| {
                    rows.text(JOINTS, name);
                    rows.integer(DIAMETER, wave.diameter as u64);
                    rows.integer(MODE, mode as u64 + 1);
                };
                write(&head, found.omega, &motion);
            }
        }
    }
}

/// Returns the places of the first sector: name in the ring and name in the sector.
fn places(model: &Model) -> Vec<(String, String)> {
    let both = |name: String| place_and_sector(&name).map(|(place, _)| (name, place));
    model.sector_places().into_iter().filter_map(both).collect()
}
