//! Check of the reduction basis: some points with slip are solved again in a larger basis.
//!
//! The error of a reduced model is known for harmonic forces up to a frequency. Friction
//! creates harmonics above it, and the basis lacks the modes that they excite. The check solves
//! such an orbit again by the same method, from a cold start, in a basis with modes of much
//! higher frequency.

use crate::syntax::expression::quantity_text;
use crate::syntax::format::plural_suffix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use stickslip::curve::sweep::BLOCK;
use stickslip::dimension::Dimension;
use stickslip::method::Method;
use stickslip::model::{Model, System};
use stickslip::orbit::Orbit;
use stickslip_numerics::tie_break::first_largest;

/// Points with slip on a reduced structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SlipReductionCheck {
    points: usize,
    /// The lowest frequency limit of the known reduction error, rad/s.
    up_to: f64,
    /// The points of a unit of work in order, until some were solved again.
    #[serde(skip)]
    candidates: Vec<CurvePoint>,
    /// The worst result of solving again.
    again: Option<BasisDifference>,
}

/// A point of a curve.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CurvePoint {
    omega: f64,
    /// Amplitudes of all places, m.
    amplitudes: Vec<f64>,
}

/// A point that was solved again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BasisDifference {
    /// Largest difference of an amplitude, relative to the largest amplitude.
    pub error: f64,
    place: String,
    /// The point in words, and the number of points solved again.
    #[serde(rename = "at")]
    point_text: String,
    #[serde(rename = "of")]
    solved_points: usize,
    coordinates: usize,
    /// Frequency limit of the larger basis, rad/s.
    up_to: f64,
}

/// Returns true if a unit of work with this number of points is checked.
///
/// About four of every [`BLOCK`] points are solved again, and four of each of the
/// first units; of a disk only those of the first unit, because all its cases share the basis
/// of the sector.
pub(crate) fn is_checked(unit: usize, points: usize, is_disk: bool) -> bool {
    if is_disk {
        return unit == 0;
    }
    // Number of first units of work that are all checked. Cases with different slip limits have
    // different harmonics. Measured: one of three cases had an error of 0.6 %, the others 2.6 %.
    unit < 16 || unit.is_multiple_of((BLOCK / points.max(1)).max(1))
}

impl SlipReductionCheck {
    /// Returns the record of one orbit; `up_to` is the frequency limit of the known reduction
    /// error, rad/s.
    ///
    /// Returns `None` if no joint slips, or if the series has no harmonic above the limit.
    pub(crate) fn from_orbit(orbit: &Orbit, up_to: f64) -> Option<SlipReductionCheck> {
        let highest = orbit.evidence.harmonics.map(|h| h as f64 * orbit.omega / orbit.periods as f64);
        let slips = orbit.joints.iter().any(|joint| joint.slip_fraction > 0.0);
        let amplitudes = orbit.places.iter().map(|place| place.length_amplitude()).collect();
        let all = vec![CurvePoint { omega: orbit.omega, amplitudes }];
        let counts = slips && highest.is_none_or(|highest| highest > up_to);
        counts.then_some(SlipReductionCheck { points: 1, up_to, candidates: all, again: None })
    }

    /// Appends the record of the following points.
    pub(crate) fn join(&mut self, more: &SlipReductionCheck) {
        let error = |again: &Option<BasisDifference>| again.as_ref().map_or(-1.0, |again| again.error);
        self.points += more.points;
        self.up_to = self.up_to.min(more.up_to);
        self.candidates.extend(more.candidates.iter().cloned());
        if error(&more.again) > error(&self.again) {
            self.again.clone_from(&more.again);
        }
    }

    /// Discards the points of a unit that is not checked.
    pub(crate) fn discard_points(&mut self) {
        self.candidates = Vec::new();
    }

    /// Solves some points again, and returns the largest difference if a point converged.
    ///
    /// `at` states a frequency in words.
    pub(crate) fn solve_again(
        &mut self,
        model: &Model,
        system: &System,
        method: &dyn Method,
        at: &dyn Fn(f64) -> String,
    ) -> Option<f64> {
        let all = std::mem::take(&mut self.candidates);
        let larger = larger_basis_system(model, system)?;
        let mut solved = 0;
        let chosen: Vec<usize> = chosen(&all).into_iter().collect();
        let again: Vec<_> = chosen.par_iter().map(|&index| compare_point(&larger, method, &all[index])).collect();
        for (index, again) in chosen.into_iter().zip(again) {
            let Some(again) = again else { continue };
            solved += 1;
            if self.again.as_ref().is_none_or(|worst| again.error > worst.error) {
                self.again = Some(BasisDifference { point_text: at(all[index].omega), ..again });
            }
        }
        self.again.iter_mut().for_each(|again| again.solved_points = solved);
        self.again.as_ref().map(|again| again.error)
    }

    /// Returns the note for the reader.
    pub(crate) fn text(&self, warning: &str) -> String {
        let hertz = |omega: f64| quantity_text(omega, Some(Dimension::FREQUENCY));
        let SlipReductionCheck { points, up_to, again, .. } = self;
        let limited = |first: &str| {
            format!(
                "{first} {points} point{} with slip, harmonics of friction lie above {}, for which `reduction_error` \
                 does not hold",
                plural_suffix(*points),
                hertz(*up_to)
            )
        };
        let twice = hertz(2.0 * up_to);
        match again {
            None => format!(
                "{}. Amplitudes may have an error of several percent if a harmonic excites a lightly damped mode, \
                 if a joint is rigid or stiff, or if a joint is at the place of the excitation. Compare with \
                 reduce = {{ up_to = \"{twice}\" }} or with reduce = false.",
                limited("At")
            ),
            Some(BasisDifference { error, place, point_text: at, solved_points: of, coordinates, up_to }) => {
                let some = if *of == 1 { "one of them was".to_owned() } else { format!("{of} of them were") };
                let solved = format!(
                    "{some} solved again with {coordinates} coordinates and all modes up to {}: the amplitude of \
                     `{place}` differs by up to {error:.1e} of the largest amplitude ({at}); other points may differ \
                     more",
                    hertz(*up_to)
                );
                // Difference relative to the largest amplitude above which the note becomes a
                // warning with advice.
                match *error > 0.01 {
                    true => format!(
                        "{warning}{}; {solved}. Write reduce = {{ up_to = \"{}\" }} or reduce = false.",
                        limited("at"),
                        hertz(*up_to)
                    ),
                    false => format!("{}; {solved}.", limited("At")),
                }
            }
        }
    }
}

impl CurvePoint {
    fn largest(&self) -> f64 {
        self.amplitudes.iter().copied().fold(0.0, f64::max)
    }
}

/// Returns the indices of the largest point and of others over the whole range, ascending.
fn chosen(points: &[CurvePoint]) -> BTreeSet<usize> {
    // Number of points per unit of work that are solved again: the largest, and others over the
    // whole range. The error depends on which mode a harmonic excites. Measured on 300 masses:
    // 0.8 % at the largest of 21 points, 9 % at the worst.
    let few = 4;
    let heights: Vec<f64> = points.iter().map(CurvePoint::largest).collect();
    let others = (0..few - 1).map(|k| k * points.len().saturating_sub(1) / (few - 2));
    first_largest(heights.iter().copied()).into_iter().chain(others).filter(|index| *index < points.len()).collect()
}

/// Assembles the same model with a larger reduction basis, if it has few enough modes.
fn larger_basis_system(model: &Model, system: &System) -> Option<System> {
    let (own, few) = (model.substructure.as_ref()?, system.reduced()?);
    // Largest number of rows for the check; reducing this size takes ten seconds.
    if own.component.dofs() > 30_000 {
        return None;
    }
    // Largest number of modes in the larger basis; methods that integrate in time are slow with
    // more.
    let counted =
        |times: &f64| own.component.modes_below(times * few.intended_up_to()).is_some_and(|count| count <= 60);
    // Factors on the frequency limit of the basis. The check uses the first factor whose number
    // of modes is at most 60. Measured on chains of 80 and 300 masses, compared with
    // all rows. The driven end has a slider of 2 N/um or a rigid one. A basis up to fifteen
    // harmonics had errors of 3 to 8 %; twice that limit gave 2 %, four times 0.3 to 0.8 %,
    // eight times 0.02 to 0.3 %.
    // All sectors of a disk share a basis of several nodal diameters, whose cost grows with the
    // cube of the modes: on 18 sectors of 1,902 rows, eight times the limit takes four times as
    // long as the study.
    let factors: &[f64] = if own.disk.is_some() { &[4.0] } else { &[8.0, 4.0] };
    let times = factors.iter().copied().find(counted)?;
    let model = Model { substructure: Some(own.with_extended_range(few, times)), ..model.clone() };
    model.assemble().ok()
}

/// Returns the difference of a point from the orbit in the larger basis, if that converges.
fn compare_point(farther: &System, method: &dyn Method, point: &CurvePoint) -> Option<BasisDifference> {
    let orbit = method.solver(farther).ok()?.orbit(point.omega).ok()?;
    let reduced = farther.reduced()?;
    let differences =
        orbit.places.iter().zip(&point.amplitudes).map(|(there, here)| (there.length_amplitude() - here).abs());
    let (worst, difference) = differences.enumerate().fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    let error = difference / orbit.places.iter().map(|place| place.length_amplitude()).fold(0.0, f64::max);
    error.is_finite().then(|| BasisDifference {
        error,
        place: orbit.places[worst].name.clone(),
        point_text: String::new(),
        solved_points: 1,
        coordinates: reduced.dofs(),
        up_to: reduced.up_to(),
    })
}
