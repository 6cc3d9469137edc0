//! What is known of a structure by its matrices: its size, what was made of it, its lowest frequencies.

use crate::study::Study;
use crate::survey::Surveyed;
use crate::words::{plural, significant};
use serde_json::{Value as Json, json};
use std::f64::consts::TAU;
use stickslip::model::{ReductionEvidence, Substructure};
use stickslip_numerics::sparse::Matrix;

/// Frequencies that are listed.
const LISTED: usize = 6;

/// Directions along which a mass is told.
pub const DIRECTIONS: [&str; 3] = ["x", "y", "z"];
/// Masses along several directions that differ by less than this share are told as one: of a held structure they differ by what is held.
const SAME: f64 = 1e-3;

/// A structure by its matrices.
#[derive(Debug, Clone, PartialEq)]
pub struct StructureSummary {
    /// Rows.
    pub rows: usize,
    /// Rows of the files that are constrained, and left out.
    pub left_out: usize,
    /// Entries of stiffness and mass that are not zero.
    pub entries: [usize; 2],
    /// What it weighs along x, y and z without its constrained rows, kg: `None` along a direction that no row is called by.
    pub mass: [Option<f64>; 3],
    /// What a reduction left out that made the files.
    pub earlier: Option<ReductionEvidence>,
    /// What it was reduced to; none where all its rows are degrees of freedom.
    pub reduced: Option<ReducedSummary>,
}

/// A structure in few coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct ReducedSummary {
    /// Coordinates.
    pub coordinates: usize,
    /// What they are.
    pub kind: String,
    /// The largest relative error of what the places see.
    pub error: f64,
    /// Up to there, rad/s.
    pub up_to: f64,
    /// Free motions of the whole; of a sector `None`, as those of the disk are no multiple of its own.
    pub free: Option<usize>,
    /// Its lowest elastic frequencies, rad/s.
    pub frequencies: Vec<f64>,
}

impl StructureSummary {
    pub(super) fn new(study: &Study, one: &Surveyed) -> Option<Self> {
        let Substructure { component, earlier, .. } = one.case.model.substructure.as_ref()?;
        let (mass, _, stiffness) = component.matrices();
        let reduced = one.survey.system().reduced().map(|reduced| ReducedSummary {
            coordinates: reduced.dofs(),
            kind: reduced.kind().to_owned(),
            error: reduced.error(),
            up_to: reduced.up_to(),
            free: Some(reduced.free()).filter(|_| one.case.model.ring.is_none()),
            frequencies: reduced.frequencies().iter().skip(reduced.free()).take(LISTED).copied().collect(),
        });
        Some(StructureSummary {
            rows: component.dofs(),
            left_out: study.structure.matrices.as_ref().map_or(0, |matrices| matrices.left_out),
            entries: [stiffness.len(), mass.len()],
            mass: DIRECTIONS.map(|along| mass_along(component.rows(), component.matrices().0, along)),
            earlier: *earlier,
            reduced,
        })
    }

    /// For a terminal: a name and a text for each line.
    pub(super) fn lines(&self) -> Vec<(&'static str, String)> {
        let Self { rows, left_out, entries: [stiffness, mass], .. } = self;
        let mut text = format!(
            "{rows} rows, {stiffness} entries of stiffness, {mass} of mass, symmetric, mass definite or semidefinite"
        );
        if *left_out > 0 {
            text += &format!("; {left_out} constrained row{} left out", plural(*left_out));
        }
        let mut lines = vec![("structure", text), ("mass", self.mass_words())];
        let hertz = |omega: f64| significant(omega / TAU, 6);
        let within =
            |error: f64, up_to: f64| format!("error {} % up to {} Hz", significant(100.0 * error, 2), hertz(up_to));
        let before = self.earlier.map(|earlier| format!("before, {}", within(earlier.error, earlier.up_to)));
        let Some(reduced) = &self.reduced else {
            lines.push(("reduced", before.unwrap_or_else(|| "not at all".to_owned())));
            return lines;
        };
        lines.extend(before.map(|before| ("reduced", before)));
        let own: Vec<String> = reduced.frequencies.iter().map(|omega| hertz(*omega)).collect();
        let own = if own.is_empty() { "none computed".to_owned() } else { format!("{} Hz", own.join(", ")) };
        let free = match reduced.free {
            None | Some(0) => String::new(),
            Some(free) => format!(", {free} free motion{}", plural(free)),
        };
        lines.push(("frequencies", own + &free));
        let ReducedSummary { coordinates, kind, error, up_to, .. } = reduced;
        lines.push(("reduced", format!("{coordinates} coordinates ({kind}), {}", within(*error, *up_to))));
        lines
    }

    /// What it weighs, which tells wrong `units` where frequencies cannot: mass and stiffness are wrong by the same factor then.
    fn mass_words(&self) -> String {
        let known: Vec<(&str, f64)> =
            DIRECTIONS.iter().zip(self.mass).filter_map(|(along, mass)| Some((*along, mass?))).collect();
        let Some(&(_, first)) = known.first() else {
            return "no row is called by a direction (449.x), so that nobody can tell it, nor whether `units` are right"
                .to_owned();
        };
        let kilograms = |mass: f64| format!("{} kg", significant(mass, 4));
        let alike = known.iter().all(|(_, mass)| (mass - first).abs() <= SAME * first.abs());
        let text = if alike {
            let along: Vec<&str> = known.iter().map(|(along, _)| *along).collect();
            format!("{} along {}", kilograms(first), along.join(", "))
        } else {
            let each: Vec<String> =
                known.iter().map(|(along, mass)| format!("{} along {along}", kilograms(*mass))).collect();
            each.join(", ")
        };
        format!("{text}, of what is not held; if that is not what it weighs, `units` are wrong")
    }

    /// For the record of a run, SI but for the frequencies in Hz.
    pub(super) fn to_json(&self) -> Json {
        let reduced = self.reduced.as_ref().map(|reduced| {
            json!({
                "coordinates": reduced.coordinates,
                "kind": reduced.kind,
                "reduction_error": reduced.error,
                "up_to_Hz": reduced.up_to / TAU,
                "free_motions": reduced.free,
                "frequencies_Hz": reduced.frequencies.iter().map(|omega| omega / TAU).collect::<Vec<_>>(),
            })
        });
        json!({
            "rows": self.rows,
            "constrained_rows": self.left_out,
            "entries_of_stiffness": self.entries[0],
            "entries_of_mass": self.entries[1],
            "mass_kg": self.mass,
            "reduced_before": self.earlier.map(|earlier| {
                json!({ "reduction_error": earlier.error, "up_to_Hz": earlier.up_to / TAU })
            }),
            "reduced": reduced,
        })
    }
}

/// The mass that moves where all rows of one direction move by one, in the units of the matrix; `None` where no row is called by it (`449.x`).
pub fn mass_along(rows: &[String], mass: &Matrix, along: &str) -> Option<f64> {
    let moves = |name: &String| f64::from(name.rsplit_once('.').is_some_and(|(_, direction)| direction == along));
    let motion: Vec<f64> = rows.iter().map(moves).collect();
    let moved = motion.contains(&1.0);
    moved.then(|| mass.times(&motion).iter().zip(&motion).map(|(force, motion)| force * motion).sum())
}
