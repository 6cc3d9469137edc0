//! Measures on results: peaks and differences of response curves, corners and areas of loops.

use stickslip_study::dataset::Dataset;
use stickslip_study::kinds::{hysteresis, response};
use stickslip_study::results::Peak;
use stickslip_study::{Study, VariedValue};

/// The response at one slip limit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// Slip limit in N.
    pub limit: f64,
    /// Frequencies in Hz.
    pub frequency: Vec<f64>,
    /// Amplitudes in m by mass, then by frequency.
    pub amplitude: Vec<Vec<f64>>,
    /// Highest refined peak of every mass.
    pub peak: Vec<Peak>,
}

/// A loop of force over displacement.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Loop {
    /// Tangential stiffness in N/m.
    pub stiffness: f64,
    /// Amplitude of the imposed motion in m.
    pub amplitude: f64,
    /// Times in s, including both ends of the period.
    pub time: Vec<f64>,
    /// Displacement in m.
    pub displacement: Vec<f64>,
    /// Force in N.
    pub force: Vec<f64>,
    /// Dissipation per cycle in J.
    pub area: f64,
}

/// Returns a varied parameter of a case in SI units.
fn value(varied: &[VariedValue], name: &str) -> Option<f64> {
    varied.iter().find(|varied| varied.name == name).map(|varied| varied.si)
}

/// Returns the curves of a response study that varies `Ft`.
///
/// Returns `None` for another study, or if a mass has no peak.
pub fn curves(study: &Study, dataset: &Dataset) -> Option<Vec<Curve>> {
    let curves = response::curves(study, dataset).ok()?;
    let measured = curves.into_iter().map(|curve| {
        Some(Curve {
            limit: value(&curve.varied, "Ft")?,
            frequency: curve.frequency,
            peak: curve.masses.iter().map(response::MassCurve::highest_peak).collect::<Option<_>>()?,
            amplitude: curve.masses.into_iter().map(|mass| mass.amplitude).collect(),
        })
    });
    measured.collect()
}

/// Returns the loops of a hysteresis study that varies `kt` and `a`, or `None` for another
/// study.
pub fn loops(study: &Study, dataset: &Dataset) -> Option<Vec<Loop>> {
    let loops = hysteresis::loops(study, dataset).ok()?;
    let measured = loops.into_iter().map(|found| {
        Some(Loop {
            stiffness: value(&found.varied, "kt")?,
            amplitude: value(&found.varied, "a")?,
            time: found.time,
            displacement: found.displacement,
            force: found.force,
            area: found.dissipation,
        })
    });
    measured.collect()
}

/// Returns the largest number, or NaN for an empty list.
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::NAN, f64::max)
}

impl Curve {
    /// Returns the highest peak in m.
    pub fn highest(&self) -> f64 {
        self.peak.iter().map(|peak| peak.amplitude).fold(f64::NAN, f64::max)
    }

    /// Returns the largest difference to `factor` times another curve, relative to the highest
    /// peak.
    ///
    /// Both curves must have the same frequencies.
    pub fn difference(&self, other: &Curve, factor: f64) -> f64 {
        let pairs = self.amplitude.iter().zip(&other.amplitude).flat_map(|(a, b)| a.iter().zip(b));
        let largest = pairs.map(|(a, b)| (a - factor * b).abs()).fold(f64::NAN, f64::max);
        largest / self.highest()
    }

    /// Returns the largest difference between the masses' amplitudes at one frequency, and that
    /// frequency.
    ///
    /// The difference is relative to the highest peak, the frequency is in Hz.
    pub fn spread(&self) -> (f64, f64) {
        let at = |i: usize| {
            let values = || self.amplitude.iter().map(|a| a[i]);
            values().fold(f64::NAN, f64::max) - values().fold(f64::NAN, f64::min)
        };
        let mut widest = (f64::NAN, f64::NAN);
        for i in 0..self.frequency.len() {
            if widest.0.is_nan() || at(i) > widest.0 {
                widest = (at(i), self.frequency[i]);
            }
        }
        (widest.0 / self.highest(), widest.1)
    }

    /// Returns the difference between the highest and the lowest peak of the masses, relative
    /// to the highest.
    pub fn peak_spread(&self) -> f64 {
        let lowest = self.peak.iter().map(|peak| peak.amplitude).fold(f64::NAN, f64::min);
        1.0 - lowest / self.highest()
    }
}

impl Loop {
    /// Returns the slopes of the straight pieces in order. Adjacent slopes differ, also
    /// cyclically.
    pub fn slopes(&self) -> Vec<f64> {
        let largest = self.displacement.iter().fold(0.0f64, |a, u| a.max(u.abs()));
        let mut slopes: Vec<f64> = Vec::new();
        let steepest = std::cell::Cell::new(0.0f64);
        // Smallest change of slope that counts as a corner, relative to the steepest slope.
        // Rounding of the samples is a million times smaller. A corner of the exact loop changes
        // the slope by its full value.
        let new = |last: f64, slope: f64| (slope - last).abs() > 0.01 * steepest.get().max(slope.abs());
        for (u, f) in self.displacement.windows(2).zip(self.force.windows(2)) {
            // Near its turning points the imposed motion is too small for a slope.
            if (u[1] - u[0]).abs() < 1e-6 * largest {
                continue;
            }
            let slope = (f[1] - f[0]) / (u[1] - u[0]);
            if slopes.last().is_none_or(|last| new(*last, slope)) {
                slopes.push(slope);
            }
            steepest.set(steepest.get().max(slope.abs()));
        }
        if slopes.len() > 1 && !new(slopes[0], slopes[slopes.len() - 1]) {
            slopes.pop();
        }
        slopes
    }

    /// Returns the number of break points in one cycle, at which the slope changes.
    pub fn break_points(&self) -> usize {
        match self.slopes().len() {
            1 => 0,
            pieces => pieces,
        }
    }

    /// Returns the largest force in N.
    pub fn highest(&self) -> f64 {
        self.force.iter().fold(0.0f64, |a, f| a.max(f.abs()))
    }

    /// Returns the number of turns of the force in one cycle that exceed `small` (N).
    ///
    /// A loop with flat or rounded sides has two.
    pub fn turns(&self, small: f64) -> usize {
        let (mut turns, mut rising, mut extreme) = (0, None, self.force.first().copied().unwrap_or(0.0));
        // The first pass through the cycle finds the direction at its start, the second counts.
        for round in 0..2 {
            for force in &self.force {
                let up = rising == Some(true);
                if rising.is_some() && (force - extreme) * if up { 1.0 } else { -1.0 } >= 0.0 {
                    extreme = *force;
                } else if (force - extreme).abs() > small {
                    rising = Some(*force > extreme);
                    extreme = *force;
                    turns += round;
                }
            }
        }
        turns
    }

    /// Returns the largest distance of a point of either loop from the other loop.
    ///
    /// Displacements are relative to the amplitude of the motion, forces to `limit` (N).
    pub fn distance(&self, other: &Loop, limit: f64) -> f64 {
        let scaled = |l: &Loop| -> Vec<(f64, f64)> {
            l.displacement.iter().zip(&l.force).map(|(u, f)| (u / self.amplitude, f / limit)).collect()
        };
        let (a, b) = (scaled(self), scaled(other));
        let farthest = |from: &[(f64, f64)], to: &[(f64, f64)]| {
            let nearest = |p: &(f64, f64)| to.windows(2).map(|s| from_segment(*p, s[0], s[1])).fold(f64::NAN, f64::min);
            from.iter().map(nearest).fold(f64::NAN, f64::max)
        };
        farthest(&a, &b).max(farthest(&b, &a))
    }

    /// Returns the force at `time` by linear interpolation.
    fn force_at(&self, time: f64) -> f64 {
        let next = self.time.partition_point(|t| *t < time).clamp(1, self.time.len() - 1);
        let (t, f) = (&self.time[next - 1..=next], &self.force[next - 1..=next]);
        f[0] + (f[1] - f[0]) * ((time - t[0]) / (t[1] - t[0])).clamp(0.0, 1.0)
    }

    /// Returns the largest difference of the force to another loop of the same motion, in N.
    pub fn difference(&self, other: &Loop) -> f64 {
        if other.time.len() < 2 {
            return f64::NAN;
        }
        self.time.iter().zip(&self.force).map(|(t, f)| (f - other.force_at(*t)).abs()).fold(f64::NAN, f64::max)
    }
}

/// Returns the distance of a point from a segment.
fn from_segment(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (d, r) = ((b.0 - a.0, b.1 - a.1), (p.0 - a.0, p.1 - a.1));
    let length = d.0 * d.0 + d.1 * d.1;
    let along = if length > 0.0 { ((r.0 * d.0 + r.1 * d.1) / length).clamp(0.0, 1.0) } else { 0.0 };
    (r.0 - along * d.0).hypot(r.1 - along * d.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[(f64, f64)]) -> Loop {
        let mut points = Vec::new();
        for (i, a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            points.extend((0..50).map(|k| {
                let s = f64::from(k) / 50.0;
                (a.0 + s * (b.0 - a.0), a.1 + s * (b.1 - a.1))
            }));
        }
        points.push(points[0]);
        Loop {
            time: (0..points.len()).map(|i| i as f64).collect(),
            displacement: points.iter().map(|p| p.0).collect(),
            force: points.iter().map(|p| p.1).collect(),
            ..Loop::default()
        }
    }

    #[test]
    fn corners_are_counted_wherever_the_cycle_starts() {
        let parallelogram = [(2.0, 1.0), (0.0, -1.0), (-2.0, -1.0), (0.0, 1.0)];
        assert_eq!(polygon(&parallelogram).break_points(), 4);
        let inside = [(1.0, 1.0), (2.0, 1.0), (0.0, -1.0), (-2.0, -1.0), (0.0, 1.0)];
        assert_eq!(polygon(&inside).break_points(), 4);
        assert_eq!(polygon(&[(1.0, 1.0), (-1.0, -1.0)]).break_points(), 0);
        let hexagon = [(2.0, 1.0), (1.0, -0.5), (0.0, -1.0), (-2.0, -1.0), (-1.0, 0.5), (0.0, 1.0)];
        assert_eq!(polygon(&hexagon).break_points(), 6);
    }

    #[test]
    fn forces_are_compared_at_equal_times() {
        let a = polygon(&[(2.0, 1.0), (0.0, -1.0), (-2.0, -1.0), (0.0, 1.0)]);
        let b = Loop { force: a.force.iter().map(|f| 1.1 * f).collect(), ..a.clone() };
        assert!((a.difference(&b) - 0.1).abs() < 1e-12);
        assert!(a.difference(&Loop::default()).is_nan());
    }

    #[test]
    fn forms_are_compared_by_their_distance() {
        let a = Loop { amplitude: 2.0, ..polygon(&[(2.0, 1.0), (0.0, -1.0), (-2.0, -1.0), (0.0, 1.0)]) };
        let late = Loop { time: a.time.iter().map(|t| t + 1.0).collect(), ..a.clone() };
        assert!(a.distance(&late, 1.0) < 1e-12);
        let high = Loop { force: a.force.iter().map(|f| 1.1 * f).collect(), ..a.clone() };
        assert!((a.distance(&high, 1.0) - 0.1).abs() < 1e-12);
    }

    #[test]
    fn turns_of_the_force_are_counted() {
        let a = polygon(&[(2.0, 1.0), (0.0, -1.0), (-2.0, -1.0), (0.0, 1.0)]);
        assert_eq!(a.turns(0.01), 2);
        let ringing = polygon(&[(2.0, 1.0), (0.0, -1.0), (-1.0, -0.8), (-2.0, -1.0), (0.0, 1.0), (1.0, 0.8)]);
        assert_eq!((ringing.turns(0.01), ringing.turns(0.5)), (6, 2));
    }

    #[test]
    fn curves_are_compared_with_their_peak() {
        let a = Curve {
            limit: 2.0,
            frequency: vec![1.0, 2.0],
            amplitude: vec![vec![1.0, 4.0], vec![1.0, 2.0]],
            peak: [4.0, 2.0].map(|amplitude| Peak { frequency: 2.0, amplitude, at_range_end: false }).to_vec(),
        };
        let tenth = Curve { amplitude: vec![vec![0.1, 0.4], vec![0.1, 0.24]], ..a.clone() };
        assert!((a.difference(&tenth, 10.0) - 0.1).abs() < 1e-12);
        assert_eq!((a.spread(), a.peak_spread()), ((0.5, 2.0), 0.5));
    }
}
