//! What few coordinates of a structure leave out of the harmonics that joints make: where these slip, some points solved again in coordinates that reach
//! farther.
//!
//! The error of a reduction is that of harmonic forces up to a frequency. Friction makes harmonics above it, and a mode that one of them meets is missing.
//! So such an orbit is sought once more, by the same method and from rest, in coordinates that know the modes far above.

use crate::expression::displayed;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use stickslip::curve::sweep::BLOCK;
use stickslip::dimension::Dimension;
use stickslip::method::Method;
use stickslip::model::{Model, System};
use stickslip::orbit::Orbit;
use stickslip_numerics::leading::leading;

/// Coordinates that reach so many times as far stand for all rows: the first of which there are few enough. Measured on chains of 80 and 300 masses with a
/// slider of 2 N/um or a rigid one at the driven end, against all rows: coordinates up to fifteen harmonics were off by 3 to 8 %, those that reach twice as far
/// by 2 %, four times 0.3 to 0.8 %, eight times 0.02 to 0.3 %.
const TIMES: [f64; 2] = [8.0, 4.0];
/// Points of a unit of work that are solved again: the largest, and others from end to end, as the error goes with which mode a harmonic meets. Measured on
/// 300 masses: 0.8 % at the largest of 21 points, 9 % at the worst.
const POINTS: usize = 4;
/// The first units of work of a study, of which each has its turn: where cases differ in a slip limit, so do the harmonics that it makes. One of three gave 0.6 %
/// where the others were wrong by 2.6 %.
const FIRST: usize = 16;
/// Modes up to there of which there may be so many: methods that follow motions in time are slow with more.
const MODES: usize = 60;
/// Rows beyond which nothing is solved again: to reduce so many takes ten seconds.
pub(crate) const ROWS: usize = 30_000;
/// Difference relative to the largest amplitude above which it shows in a response, and one must be told what to do.
const SHOWS: f64 = 0.01;

/// Points at which joints slip on a structure in few coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Slipping {
    points: usize,
    /// The lowest frequency up to which the error of the coordinates is known, rad/s.
    up_to: f64,
    /// Those of a unit of work, in order, until some were solved again.
    #[serde(skip)]
    all: Vec<Point>,
    /// What came of it: the worst.
    again: Option<Again>,
}

/// A point of a curve.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Point {
    omega: f64,
    /// Of every place, m.
    amplitudes: Vec<f64>,
}

/// A point that was solved again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Again {
    /// The largest difference of the amplitudes, relative to the largest amplitude, and the place that has it.
    pub error: f64,
    place: String,
    /// Where, in words, and how many were solved.
    at: String,
    of: usize,
    coordinates: usize,
    /// How far they reach, rad/s.
    up_to: f64,
}

/// Whether it is the turn of a unit of work of so many points: [`POINTS`] of every [`BLOCK`] or so are solved again, and of each of the first units.
pub(crate) fn has_turn(unit: usize, points: usize) -> bool {
    unit < FIRST || unit.is_multiple_of((BLOCK / points.max(1)).max(1))
}

/// How many of so many points, in so many cases, are solved again where joints slip at all of them.
pub(crate) fn count(points: f64, cases: f64) -> f64 {
    (POINTS as f64 * (points / BLOCK as f64).ceil().max(cases.min(FIRST as f64))).min(points)
}

impl Slipping {
    /// At a point, on coordinates whose error is known up to `up_to` (rad/s); `None` where no joint slips, and of a series without harmonics above.
    pub(crate) fn of(orbit: &Orbit, up_to: f64) -> Option<Slipping> {
        let highest = orbit.evidence.harmonics.map(|h| h as f64 * orbit.omega / orbit.periods as f64);
        let slips = orbit.joints.iter().any(|joint| joint.slip_fraction > 0.0);
        let amplitudes = orbit.places.iter().map(|place| place.size()).collect();
        let all = vec![Point { omega: orbit.omega, amplitudes }];
        let counts = slips && highest.is_none_or(|highest| highest > up_to);
        counts.then_some(Slipping { points: 1, up_to, all, again: None })
    }

    /// Takes in those of other points, which follow these.
    pub(crate) fn join(&mut self, more: &Slipping) {
        let error = |again: &Option<Again>| again.as_ref().map_or(-1.0, |again| again.error);
        self.points += more.points;
        self.up_to = self.up_to.min(more.up_to);
        self.all.extend(more.all.iter().cloned());
        if error(&more.again) > error(&self.again) {
            self.again.clone_from(&more.again);
        }
    }

    /// Solves some again, if it is the `turn` of these points; the largest difference, if there is any answer. `at` says where a frequency is.
    pub(crate) fn solve_again(
        &mut self,
        turn: bool,
        (model, system, method): (&Model, &System, &dyn Method),
        at: &dyn Fn(f64) -> String,
    ) -> Option<f64> {
        let all = std::mem::take(&mut self.all);
        let farther = if turn { farther(model, system) } else { None }?;
        let mut of = 0;
        for index in chosen(&all) {
            let Some(again) = again(&farther, method, &all[index]) else { continue };
            of += 1;
            if self.again.as_ref().is_none_or(|worst| again.error > worst.error) {
                self.again = Some(Again { at: at(all[index].omega), ..again });
            }
        }
        self.again.iter_mut().for_each(|again| again.of = of);
        self.again.as_ref().map(|again| again.error)
    }

    /// For the reader.
    pub(crate) fn text(&self, warning: &str) -> String {
        let hertz = |omega: f64| displayed(omega, Some(Dimension::FREQUENCY));
        let Slipping { points, up_to, again, .. } = self;
        let slips = format!(
            "at {points} point{} joints slip: `reduction_error` is that of forces up to {}, and not of the harmonics that friction makes above",
            if *points == 1 { "" } else { "s" },
            hertz(*up_to)
        );
        let twice = hertz(2.0 * up_to);
        match again {
            None => format!(
                "A{}. Where one of them meets a mode that is hardly damped, a joint is rigid or stiff, or at the driven place, amplitudes may be \
                 wrong by percent: compare with reduce = {{ up_to = \"{twice}\" }}, or with reduce = false.",
                &slips[1..]
            ),
            Some(Again { error, place, at, of, coordinates, up_to }) => {
                let some = if *of == 1 { "the largest was".to_owned() } else { format!("{of} of a stretch were") };
                let solved = format!(
                    "{some} solved again in {coordinates} coordinates that reach to {}, and the amplitude of `{place}` differs by up to {error:.1e} of \
                     the largest ({at}), at others maybe by more",
                    hertz(*up_to)
                );
                match *error > SHOWS {
                    true => format!(
                        "{warning}{slips}; {solved}: say reduce = {{ up_to = \"{}\" }}, or reduce = false",
                        hertz(*up_to)
                    ),
                    false => format!("A{}; {solved}.", &slips[1..]),
                }
            }
        }
    }
}

impl Point {
    fn largest(&self) -> f64 {
        self.amplitudes.iter().copied().fold(0.0, f64::max)
    }
}

/// The largest of some points, the first if several are, and others from end to end; rising.
fn chosen(points: &[Point]) -> BTreeSet<usize> {
    let heights: Vec<f64> = points.iter().map(Point::largest).collect();
    let others = (0..POINTS - 1).map(|k| k * points.len().saturating_sub(1) / (POINTS - 2));
    leading(heights.iter().copied()).into_iter().chain(others).filter(|index| *index < points.len()).collect()
}

/// The same model in coordinates that reach farther than those of its `system`, if there are few enough.
fn farther(model: &Model, system: &System) -> Option<System> {
    let (own, few) = (model.substructure.as_ref()?, system.reduced()?);
    if own.component.dofs() > ROWS {
        return None;
    }
    let counted = |times: &f64| own.component.modes_below(times * few.serves()).is_some_and(|count| count <= MODES);
    let times = TIMES.into_iter().find(counted)?;
    let model = Model { substructure: Some(own.farther(few, times)), ..model.clone() };
    model.assemble().ok()
}

/// What a point differs from the orbit in other coordinates, if one is found.
fn again(farther: &System, method: &dyn Method, point: &Point) -> Option<Again> {
    let orbit = method.solver(farther).ok()?.orbit(point.omega, None).ok()?;
    let reduced = farther.reduced()?;
    let differences = orbit.places.iter().zip(&point.amplitudes).map(|(there, here)| (there.size() - here).abs());
    let (worst, difference) = differences.enumerate().fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    let error = difference / orbit.places.iter().map(|place| place.size()).fold(0.0, f64::max);
    error.is_finite().then(|| Again {
        error,
        place: orbit.places[worst].name.clone(),
        at: String::new(),
        of: 1,
        coordinates: reduced.dofs(),
        up_to: reduced.up_to(),
    })
}
