//! Summary of a structure given by matrices: its size, its reduction, its lowest frequencies.

use crate::case::study::Study;
use crate::check::survey::SurveyedCase;
use crate::syntax::format::{format_significant, plural_suffix};
use serde_json::{Value as Json, json};
use std::f64::consts::TAU;
use stickslip::model::{ReductionAccuracy, Substructure, TRANSLATIONS};
use stickslip_numerics::sparse::SparseMatrix;

/// Returns the number of a node and the index of a direction for the name of a row, `17.y`.
pub(crate) fn node_and_axis(name: &str) -> Option<(u64, usize)> {
    let (node, along) = name.rsplit_once('.')?;
    Some((node.parse().ok()?, TRANSLATIONS.iter().position(|axis| *axis == along)?))
}

/// A structure given by matrices.
#[derive(Debug, Clone, PartialEq)]
pub struct StructureSummary {
    /// Number of rows.
    pub rows: usize,
    /// Number of constrained rows of the files, which are left out.
    pub constrained_rows: usize,
    /// Numbers of nonzero entries of stiffness and mass.
    pub entries: [usize; 2],
    /// Mass along x, y and z without the constrained rows, kg; `None` along a direction that no
    /// row name has.
    pub mass: [Option<f64>; 3],
    /// Error of an earlier reduction that produced the files.
    pub earlier_reduction: Option<ReductionAccuracy>,
    /// The reduced model; `None` if all rows are degrees of freedom.
    pub reduced: Option<ReducedSummary>,
}

/// A reduced model.
#[derive(Debug, Clone, PartialEq)]
pub struct ReducedSummary {
    /// Number of coordinates.
    pub coordinates: usize,
    /// Type of the coordinates.
    pub kind: String,
    /// Largest relative error at the places.
    pub error: f64,
    /// Frequency limit of the error, rad/s.
    pub up_to: f64,
    /// Number of rigid-body motions of the whole structure; `None` for a sector, because the
    /// disk has a different number.
    pub rigid_body_modes: Option<usize>,
    /// Its lowest elastic frequencies, rad/s.
    pub frequencies: Vec<f64>,
}

impl StructureSummary {
    pub(super) fn new(study: &Study, one: &SurveyedCase) -> Option<Self> {
        let Substructure { component, earlier_reduction, .. } = one.case.model.substructure.as_ref()?;
        let (mass, _, stiffness) = component.matrices();
        let reduced = one.survey.system().reduced().map(|reduced| ReducedSummary {
            coordinates: reduced.dofs(),
            kind: reduced.kind().to_owned(),
            error: reduced.error(),
            up_to: reduced.up_to(),
            rigid_body_modes: Some(reduced.free_modes()).filter(|_| one.case.model.ring.is_none()),
            // Largest number of listed frequencies.
            frequencies: reduced.frequencies().iter().skip(reduced.free_modes()).take(6).copied().collect(),
        });
        Some(StructureSummary {
            rows: component.dofs(),
            constrained_rows: study.structure.matrices.as_ref().map_or(0, |matrices| matrices.constrained_rows),
            entries: [stiffness.len(), mass.len()],
            mass: TRANSLATIONS.map(|along| mass_along(component.rows(), component.matrices().0, along)),
            earlier_reduction: *earlier_reduction,
            reduced,
        })
    }

    /// Returns the lines for a terminal: a name and a text each.
    pub(super) fn lines(&self) -> Vec<(&'static str, String)> {
        let Self { rows, constrained_rows: left_out, entries: [stiffness, mass], .. } = self;
        let mut text = format!(
            "{rows} rows, {stiffness} nonzero entries of stiffness and {mass} of mass, symmetric, mass positive definite or semidefinite"
        );
        if *left_out > 0 {
            text += &format!("; {left_out} constrained row{} left out", plural_suffix(*left_out));
        }
        let mut lines = vec![("structure", text), ("mass", self.mass_words())];
        let hertz = |omega: f64| format_significant(omega / TAU, 6);
        let within = |error: f64, up_to: f64| {
            format!("error {} % up to {} Hz", format_significant(100.0 * error, 2), hertz(up_to))
        };
        let before = self
            .earlier_reduction
            .map(|earlier| format!("by an earlier reduction, {}", within(earlier.error, earlier.up_to)));
        let Some(reduced) = &self.reduced else {
            lines.push(("reduced", before.unwrap_or_else(|| "no".to_owned())));
            return lines;
        };
        lines.extend(before.map(|before| ("reduced", before)));
        let own: Vec<String> = reduced.frequencies.iter().map(|omega| hertz(*omega)).collect();
        let own = if own.is_empty() { "none computed".to_owned() } else { format!("{} Hz", own.join(", ")) };
        let free = match reduced.rigid_body_modes {
            None | Some(0) => String::new(),
            Some(free) => format!(", {free} rigid-body mode{}", plural_suffix(free)),
        };
        lines.push(("frequencies", own + &free));
        let ReducedSummary { coordinates, kind, error, up_to, .. } = reduced;
        lines.push(("reduced", format!("{coordinates} coordinates ({kind}), {}", within(*error, *up_to))));
        lines
    }

    /// States the mass, which reveals wrong `units` if mass and stiffness are wrong by the same
    /// factor.
    fn mass_words(&self) -> String {
        let known: Vec<(&str, f64)> =
            TRANSLATIONS.iter().zip(self.mass).filter_map(|(along, mass)| Some((*along, mass?))).collect();
        let Some(&(_, first)) = known.first() else {
            return "unknown, because no row name has a direction, as in `449.x`; `units` cannot be checked".to_owned();
        };
        let kilograms = |mass: f64| format!("{} kg", format_significant(mass, 4));
        // Masses along several directions that differ by less than this share are stated once.
        // The constrained rows of a structure cause small differences.
        let alike = known.iter().all(|(_, mass)| (mass - first).abs() <= 1e-3 * first.abs());
        let text = if alike {
            let along: Vec<&str> = known.iter().map(|(along, _)| *along).collect();
            format!("{} along {}", kilograms(first), along.join(", "))
        } else {
            let each: Vec<String> =
                known.iter().map(|(along, mass)| format!("{} along {along}", kilograms(*mass))).collect();
            each.join(", ")
        };
        format!("{text}, without constrained rows; if this is not the mass of the structure, `units` are wrong")
    }

    /// Returns the entry of the run record, SI, with frequencies in Hz.
    pub(super) fn to_json(&self) -> Json {
        let reduced = self.reduced.as_ref().map(|reduced| {
            json!({
                "coordinates": reduced.coordinates,
                "kind": reduced.kind,
                "reduction_error": reduced.error,
                "up_to_Hz": reduced.up_to / TAU,
                "free_motions": reduced.rigid_body_modes,
                "frequencies_Hz": reduced.frequencies.iter().map(|omega| omega / TAU).collect::<Vec<_>>(),
            })
        });
        json!({
            "rows": self.rows,
            "constrained_rows": self.constrained_rows,
            "entries_of_stiffness": self.entries[0],
            "entries_of_mass": self.entries[1],
            "mass_kg": self.mass,
            "reduced_before": self.earlier_reduction.map(|earlier| {
                json!({ "reduction_error": earlier.error, "up_to_Hz": earlier.up_to / TAU })
            }),
            "reduced": reduced,
        })
    }
}

/// Returns the mass in a unit translation along `along`, in the units of the matrix.
///
/// All rows of that direction (`449.x`) move by one, except internal variables, whose node
/// number is negative (`-3.x`). Returns `None` if no row name has the direction.
pub fn mass_along(rows: &[String], mass: &SparseMatrix, along: &str) -> Option<f64> {
    let is_moved = |(node, direction): (&str, &str)| direction == along && !node.starts_with('-');
    let motion: Vec<f64> = rows.iter().map(|name| f64::from(name.rsplit_once('.').is_some_and(is_moved))).collect();
    let moved = motion.contains(&1.0);
    moved.then(|| mass.multiply(&motion).iter().zip(&motion).map(|(force, motion)| force * motion).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of an internal variable do not move with the structure.
    #[test]
    fn internal_variables_have_no_mass_along_a_direction() {
        let rows = ["7.x", "7.y", "-1.x"].map(str::to_owned);
        let mass = SparseMatrix::from_triplets(3, [(0, 0, 2.0), (1, 1, 2.0), (2, 2, 1.0), (2, 0, 0.5)]).unwrap();
        assert_eq!(mass_along(&rows, &mass, "x"), Some(2.0));
        assert_eq!(mass_along(&rows, &mass, "z"), None);
    }
}
