//! Orbits over one period, in time.

mod figure;

use super::shared::contact_states::contact_word;
use super::shared::keys::{FREQUENCY, OUTPUT, SAMPLES, check_output, no_requirements};
use super::shared::stress::{self, STRESS, Stresses};
use super::shared::{fields, orbit_sweep};
use crate::case::values::hertz;
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::warnings::excitation_warnings;
use crate::kinds::info::KindInfo;
use crate::kinds::kind::{Kind, Probe};
use crate::results::dataset::FIELDS;
use crate::results::notes::Note;
use crate::results::table_builder::TableBuilder;
use crate::run::point_row::{PointRow, describe_location};
use crate::run::work::{Computed, PreparedCase, UnitResult, UnitTask};
use crate::syntax::key::{ValueType, default};
use stickslip::dimension::Dimension;
use stickslip::orbit::{Orbit, Sample, Symmetry};

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "orbit",
        summary: "an orbit over one period: displacements, velocities, joint forces",
        keys: &[
            FREQUENCY,
            SAMPLES,
            OUTPUT,
            default(
                "multipliers",
                ValueType::Flag,
                "false",
                "computes all Floquet multipliers into `multipliers.csv`; `stable` needs only the largest one",
                "true",
            ),
            fields::KEY,
        ],
        check: |values, model, _| check_output(values).and_then(|()| fields::check(values, model)),
        axes: [Some(Dimension::TIME), None],
        uses_method: true,
        needs: no_requirements,
        adapts: false,
        tables: &["orbit", "orbits", "multipliers", FIELDS, STRESS],
    },
    unit_size: orbit_sweep::grain,
    size,
    warnings: excitation_warnings,
    probe: Probe::Points { compute, excluded: |_| None },
    compute,
    draw: figure::draw,
};

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let points = inputs.points();
    let rows = points * inputs.instants();
    let orbits = inputs.orbits(points);
    let wanted = inputs.case.values.flag("multipliers") == Some(true);
    let multipliers = if wanted { points * 2.0 * inputs.dofs } else { 0.0 };
    let fields = fields::size(inputs, points);
    let sectors = inputs.case.model.ring.map_or(1, |ring| ring.sectors);
    PlannedSize {
        tables: vec![
            inputs.motion(rows),
            TableShape { numbers: orbits.numbers + 4.0, ..orbits },
            TableShape { rows: multipliers, numbers: inputs.varied + 5.0, words: 0.0 },
            fields,
            stress::size(inputs, points, sectors),
        ],
        // two panels of each orbit, also beyond the limit of panels; all fields are held until they
        // are written
        drawn: rows * 2.0 * (inputs.places + inputs.joints).min(figure::MAX_CURVES as f64) + fields.rows,
        unit: inputs.kept_orbits(),
    }
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let mut part = UnitResult::default();
    let (mut motion, mut summary, mut multipliers) =
        (TableBuilder::default(), TableBuilder::default(), TableBuilder::default());
    let (mut of_nodes, mut of_stresses) = (TableBuilder::default(), TableBuilder::default());
    let prepared = work.case();
    let nodes = fields::Fields::new(work.study, prepared, &mut part);
    let stresses = Stresses::new(work.study, prepared, &mut part);
    for (orbit, stable) in orbit_sweep::converged_orbits(work, &mut part)? {
        let omega = orbit.omega;
        continuum_note(prepared, &orbit).into_iter().for_each(|note| note.merge_into(&mut part.notes));
        summary.varied(&prepared.case);
        summary.number("frequency_Hz", hertz(omega));
        let mut row = PointRow::with_stability(prepared, &orbit, stable);
        // Length of the state, with the states of joints, up to which the return of an orbit is
        // checked for every method. Measured: 12 s for a mistuned ring of 48 blades and joints,
        // whose state has length 144.
        if orbit.initial_state.len() <= 200 {
            row.return_defect = orbit.return_defect().unwrap_or(f64::NAN);
        }
        row.write(prepared, &mut summary);
        summary.number("work_in_J", orbit.energy.work_in);
        summary.number("viscous_J", orbit.energy.viscous);
        summary.number("friction_J", orbit.energy.friction);
        summary.integer("switches", orbit.evidence.switches as u64);
        summary.end_row();
        let wanted = prepared.case.values.flag("multipliers") == Some(true);
        let all = if wanted { orbit.multipliers() } else { Some(Vec::new()) };
        if all.is_none() {
            let place = describe_location(&prepared.case, omega);
            let text = "the multipliers are unknown, because the orbit has no return map.";
            Note::for_case(&place, text).merge_into(&mut part.notes);
        }
        for (index, multiplier) in all.unwrap_or_default().iter().enumerate() {
            multipliers.varied(&prepared.case);
            multipliers.number("frequency_Hz", hertz(omega));
            multipliers.integer("index", index as u64 + 1);
            multipliers.number("real", multiplier.re);
            multipliers.number("imaginary", multiplier.im);
            multipliers.number("modulus", multiplier.norm());
            multipliers.reduction_error(prepared.system.reduction_evidence());
            multipliers.end_row();
        }
        for time in orbit_sweep::times(&orbit, prepared.case.values.count("samples").unwrap_or(720) as usize) {
            motion.varied(&prepared.case);
            motion.number("frequency_Hz", hertz(omega));
            motion.number("time_s", time);
            write_sample(prepared, &orbit.sample(time), &mut motion);
            motion.end_row();
        }
        if let Some(nodes) = &nodes {
            nodes.write_orbit(prepared, &orbit, &mut of_nodes);
        }
        if let Some(stresses) = &stresses {
            stresses.write_orbit(prepared, &orbit, &mut of_stresses);
        }
    }
    part.tables = vec![motion, summary, multipliers, of_nodes, of_stresses];
    Ok(part)
}

/// Returns the note that a permanently stuck joint makes the orbit one of a continuum.
///
/// It covers orbits with half-period symmetry; [`Note::StuckOffset`] covers the others.
fn continuum_note(prepared: &PreparedCase, orbit: &Orbit) -> Option<Note> {
    (orbit.is_in_continuum() && orbit.symmetry == Symmetry::HalfPeriod).then(|| {
        let stuck = orbit.evidence.stuck.join(", ");
        let text =
            format!("permanently stuck: {stuck}; the orbit is one of a continuum, and the symmetric orbit is shown.");
        Note::for_case(&describe_location(&prepared.case, orbit.omega), text)
    })
}

/// Writes the cells of one instant.
pub(super) fn write_sample(prepared: &PreparedCase, sample: &Sample, rows: &mut TableBuilder) {
    let system = &prepared.system;
    for (place, along) in system.places().iter().zip(system.place_axes()) {
        let (what, unit) = if along.is_rotation() { ("rotation", "rad") } else { ("displacement", "m") };
        rows.number(&format!("{place}_{what}_{unit}"), along.component(&sample.displacement));
        rows.number(&format!("{place}_velocity_{unit}_per_s"), along.component(&sample.velocity));
    }
    for (joint, state) in prepared.system.joints().iter().zip(&sample.joints) {
        for (a, label) in joint.labels().enumerate() {
            rows.number(&format!("{label}_displacement_m"), state.displacement[a]);
            rows.number(&format!("{label}_velocity_m_per_s"), state.velocity[a]);
            rows.number(&format!("{label}_force_N"), state.force[a]);
        }
        let contact = if joint.law().has_faces() { contact_word(state.contact) } else { "" };
        rows.text(&format!("{}_contact", joint.name()), contact);
    }
}
