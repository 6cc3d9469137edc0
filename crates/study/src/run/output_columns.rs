//! Additional columns of an orbit that `output` selects. Each is one row of [`TABLE`].

use crate::case::study::Case;
use crate::results::columns;
use crate::run::period_samples::{INSTANTS, PeriodSamples};
use crate::run::set_columns;
use crate::run::work::PreparedCase;
use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip::model::{Axis, System, SystemJoint};
use stickslip::orbit::{JointMotion, Orbit};

/// A group of columns that `output` can select.
pub(crate) struct OutputColumns {
    /// Name in `output`.
    pub name: &'static str,
    /// One-line description.
    pub doc: &'static str,
    /// Names of its columns.
    columns: fn(&Case, &System) -> Vec<String>,
    /// Its numbers, one for each column.
    values: fn(&PreparedCase, &Orbit, &PeriodSamples) -> Vec<f64>,
}

/// All choices of `output`.
pub(crate) const TABLE: &[OutputColumns] = &[
    OutputColumns {
        name: "joint_force",
        doc: "half the peak-to-peak value of the force of every joint",
        columns: |_, system| joint_columns(system, "force_amplitude_N"),
        values: |prepared, _, samples| {
            let joints = prepared.system.joints().iter().enumerate();
            let axes = joints.flat_map(|(j, joint)| (0..joint.axes().len()).map(move |a| (j, a)));
            axes.map(|(j, a)| half_range(samples.all().iter().map(|sample| sample.joints[j].force[a]))).collect()
        },
    },
    OutputColumns {
        name: "joint_mean",
        doc: "mean force of every joint over the period; for a contact the mean normal load",
        columns: |_, system| joint_columns(system, "force_mean_N"),
        values: |prepared, _, samples| {
            let joints = prepared.system.joints().iter().enumerate();
            let axes = joints.flat_map(|(j, joint)| (0..joint.axes().len()).map(move |a| (j, a)));
            let sum =
                |j: usize, a: usize| -> f64 { samples.even().iter().map(|sample| sample.joints[j].force[a]).sum() };
            axes.map(|(j, a)| sum(j, a) / INSTANTS as f64).collect()
        },
    },
    OutputColumns {
        name: "joint_motion",
        doc: "half the peak-to-peak value of the relative displacement of every joint",
        columns: |_, system| joint_columns(system, "amplitude_m"),
        values: |_, orbit, _| {
            let axes = orbit.joints.iter().flat_map(|joint| &joint.displacement);
            axes.map(|(low, high)| 0.5 * (high - low).abs()).collect()
        },
    },
    OutputColumns {
        name: "contact",
        doc: "fraction of the period in which every joint sticks, and in which its faces are apart, in addition to the \
            fraction with slip",
        columns: |_, system| {
            let joints = system.joints().iter();
            joints
                .flat_map(|joint| [columns::stick_fraction(joint.name()), columns::open_fraction(joint.name())])
                .collect()
        },
        values: |prepared, orbit, _| {
            let joints = prepared.system.joints().iter().zip(&orbit.joints);
            // a spring has no faces
            let shares = |(joint, motion): (&SystemJoint, &JointMotion)| match joint.law().has_faces() {
                true => [motion.stick_fraction, motion.open_fraction],
                false => [f64::NAN; 2],
            };
            joints.flat_map(shares).collect()
        },
    },
    OutputColumns {
        name: "velocity",
        doc: "half the peak-to-peak value of the velocity of every place",
        columns: |_, system| place_columns(system, |unit| format!("velocity_amplitude_{unit}_per_s")),
        values: |prepared, _, samples| {
            let places = prepared.system.place_axes().iter();
            places
                .map(|place| half_range(samples.all().iter().map(|sample| place.component(&sample.velocity))))
                .collect()
        },
    },
    OutputColumns {
        name: "acceleration",
        doc: "half the peak-to-peak value of the acceleration of every place",
        columns: |_, system| place_columns(system, |unit| format!("acceleration_amplitude_{unit}_per_s2")),
        values: |prepared, _, samples| {
            let places = prepared.system.place_axes().iter();
            places
                .map(|place| half_range(samples.all().iter().map(|sample| place.component(&sample.acceleration))))
                .collect()
        },
    },
    OutputColumns {
        name: "harmonics",
        doc: "amplitudes of harmonics 1 to 5 of the displacement of every place",
        columns: |_, system| {
            let places = system.places().iter().zip(system.place_axes());
            let all = |(place, along): (&String, &Axis)| {
                (1..=HARMONICS).map(|h| format!("{place}_harmonic{h}_{}", along.unit())).collect::<Vec<_>>()
            };
            places.flat_map(all).collect()
        },
        values: |prepared, _, samples| harmonics(prepared, samples),
    },
    OutputColumns {
        name: "receptance",
        doc: "amplitude of the first harmonic of every place per unit of the largest force",
        columns: |_, system| place_columns(system, |unit| format!("receptance_{unit}_per_N")),
        values: |prepared, orbit, _| {
            let model = &prepared.case.model;
            let forces = model.forces.iter().enumerate();
            let forces = forces.filter(|(_, force)| force.harmonic == 1 && !model.is_rotation(&force.on));
            let omega = TAU / orbit.period();
            let largest = forces.map(|(i, _)| model.force_amplitude(i, omega).abs()).fold(0.0, f64::max);
            let unit = |x: Complex64| if largest > 0.0 { x.norm() / largest } else { f64::NAN };
            orbit.places.iter().map(|place| unit(place.first_harmonic)).collect()
        },
    },
    OutputColumns {
        name: "sets",
        doc: "for every contact between meshes: the dissipation of all its joints, and the means of slip and separation \
            over its area; for every place on a set: the largest distance of a node from rest",
        columns: |case, _| set_columns::columns(case),
        values: set_columns::values,
    },
];

/// Highest harmonic of `harmonics`.
const HARMONICS: usize = 5;
fn joint_columns(system: &System, quantity: &str) -> Vec<String> {
    system.joints().iter().flat_map(|joint| joint.labels()).map(|label| format!("{label}_{quantity}")).collect()
}

fn place_columns(system: &System, quantity: fn(&str) -> String) -> Vec<String> {
    let places = system.places().iter().zip(system.place_axes());
    places.map(|(place, along)| format!("{place}_{}", quantity(along.unit()))).collect()
}

fn half_range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    0.5 * (high - low)
}

/// Returns the amplitudes of the harmonics by the rectangle rule.
///
/// For a smooth periodic motion the error comes only from harmonics near [`INSTANTS`].
fn harmonics(prepared: &PreparedCase, samples: &PeriodSamples) -> Vec<f64> {
    let mut sums = vec![Complex64::new(0.0, 0.0); prepared.system.places().len() * HARMONICS];
    for (instant, sample) in samples.even().iter().enumerate() {
        let turn = TAU * instant as f64 / INSTANTS as f64;
        for (place, x) in prepared.system.at_places(&sample.displacement).into_iter().enumerate() {
            for h in 1..=HARMONICS {
                sums[place * HARMONICS + h - 1] += x * Complex64::from_polar(1.0, -(h as f64) * turn);
            }
        }
    }
    sums.iter().map(|sum| sum.norm() * 2.0 / INSTANTS as f64).collect()
}

/// Iterates over the choices in `output` of a case, in the order of [`TABLE`].
fn selected(case: &Case) -> impl Iterator<Item = &'static OutputColumns> + '_ {
    let names = case.values.names("output").unwrap_or_default();
    TABLE.iter().filter(move |extra| names.iter().any(|name| name == extra.name))
}

/// Returns the names of the columns that `output` selects.
pub(crate) fn columns(case: &Case, system: &System) -> Vec<String> {
    selected(case).flat_map(|extra| (extra.columns)(case, system)).collect()
}

/// Returns the values of these columns.
pub(crate) fn values(prepared: &PreparedCase, orbit: &Orbit) -> Vec<f64> {
    let samples = PeriodSamples::new(orbit);
    selected(&prepared.case).flat_map(|extra| (extra.values)(prepared, orbit, &samples)).collect()
}
