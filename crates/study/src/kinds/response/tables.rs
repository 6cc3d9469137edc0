//! The tables of a response: names, columns, and their content as typed values.

use crate::case::study::{Study, VariedValue};
use crate::results::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY, amplitude_of};
use crate::results::dataset::Dataset;
use crate::results::{Peak, Results, ResultsError};

/// Name of the kind.
pub(super) const NAME: &str = "response";
/// One row per orbit.
pub(super) const CURVE: &str = "curve";
/// One row per peak.
pub(super) const PEAKS: &str = "peaks";
/// All joints free, and all joints stuck.
pub(super) const REFERENCES: &str = "references";
/// One row per case of a mistuned disk.
pub(super) const AMPLIFICATION: &str = "amplification";
/// One row per peak of a disk at which no other place moves more, with the shape there.
pub(super) const SHAPES: &str = "peak_shapes";
/// One row per orbit that only the reverse sweep finds.
pub(super) const REVERSE_SWEEP: &str = "reverse_sweep";
/// Frequency of the peak of the tuned disk.
pub(super) const TUNED_FREQUENCY: &str = "tuned_frequency_Hz";
/// Amplitude of that peak.
pub(super) const TUNED_AMPLITUDE: &str = "tuned_amplitude_m";
/// Largest amplitude over that of the tuned disk.
pub(super) const AMPLIFICATION_RATIO: &str = "amplification";
/// The mass that has a peak.
pub(super) const MASS: &str = "mass";

/// The response of one case.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseCurve {
    /// The varied parameters of the case.
    pub varied: Vec<VariedValue>,
    /// Excitation frequencies, Hz, in table order.
    pub frequency: Vec<f64>,
    /// Curves of every place with a displacement, in model order; the table has the rotations
    /// of bodies.
    pub masses: Vec<MassCurve>,
}

/// The response of one mass.
#[derive(Debug, Clone, PartialEq)]
pub struct MassCurve {
    /// Name of the mass.
    pub mass: String,
    /// Half of peak to peak at every frequency, m; NaN without an orbit.
    pub amplitude: Vec<f64>,
    /// Its refined peaks by frequency. With `peak_of` only those at which it has the largest
    /// amplitude; empty if peaks were not requested.
    pub peaks: Vec<Peak>,
}

impl MassCurve {
    /// Returns the highest of its peaks; of equal ones the last.
    pub fn highest_peak(&self) -> Option<Peak> {
        self.peaks.iter().copied().max_by(|a, b| a.amplitude.total_cmp(&b.amplitude))
    }
}

/// Returns the curves of a response study, case by case.
///
/// Cases that an interrupted run did not reach are absent.
///
/// # Errors
/// Returns a [`ResultsError`] if the dataset is of another kind or is not the result of
/// [`run`](crate::run::run()) for this study.
///
/// # Example
/// ```
/// use stickslip_study::{kinds::response, read_study, run::{Context, run}};
/// let text = r#"
/// schema = 1
/// title = "Oscillator"
/// [[mass]]
/// name = "m"
/// mass = "1 kg"
/// [[spring]]
/// between = ["m", "ground"]
/// stiffness = "1 N/m"
/// damping = "1 kg/s"
/// [[force]]
/// on = "m"
/// amplitude = "1 N"
/// [study]
/// kind = "response"
/// frequency = { from = "0.5 rad/s", to = "1.5 rad/s", points = 3 }
/// "#;
/// let study = read_study("oscillator.toml", text, &[]).unwrap();
/// let dataset = run(&study, &Context::without_progress(1)).unwrap();
/// let curves = response::curves(&study, &dataset).unwrap();
/// assert!((curves[0].masses[0].amplitude[1] - 1.0).abs() < 1e-12);   // F/(c ω) at ω = √(k/m)
/// ```
pub fn curves(study: &Study, dataset: &Dataset) -> Result<Vec<ResponseCurve>, ResultsError> {
    let results = Results::new(NAME, study, dataset)?;
    let Some(curve) = results.table(CURVE)? else { return Ok(Vec::new()) };
    let keys = study.varied().len();
    let frequency = curve.numbers(FREQUENCY)?;
    let system = study.case(0).ok().and_then(|case| study.assembled.system(&case.model).ok());
    let system = system.ok_or_else(|| curve.foreign_rows())?;
    let displacements = system.places().iter().zip(system.place_axes()).filter(|(_, along)| !along.is_rotation());
    let places: Vec<String> = displacements.map(|(place, _)| place.clone()).collect();
    let amplitudes =
        places.iter().map(|place| curve.numbers(&amplitude_of(place))).collect::<Result<Vec<&[f64]>, _>>()?;
    let cases = results.case_rows(&curve, keys)?;
    let mut curves: Vec<ResponseCurve> = cases
        .iter()
        .map(|case_rows| ResponseCurve {
            varied: case_rows.varied.clone(),
            frequency: frequency[case_rows.rows.clone()].to_vec(),
            masses: places
                .iter()
                .zip(&amplitudes)
                .map(|(place, amplitude)| MassCurve {
                    mass: place.clone(),
                    amplitude: amplitude[case_rows.rows.clone()].to_vec(),
                    peaks: Vec::new(),
                })
                .collect(),
        })
        .collect();
    let Some(peaks) = results.table(PEAKS)? else { return Ok(curves) };
    let (masses, frequency) = (peaks.texts(MASS)?, peaks.numbers(FREQUENCY)?);
    let (amplitude, at_range_end) = (peaks.numbers(AMPLITUDE)?, peaks.flags(AT_RANGE_END)?);
    for case_rows in results.case_rows(&peaks, keys)? {
        let case = cases.iter().position(|of_curve| of_curve.case == case_rows.case);
        for row in case_rows.rows {
            let mass = places.iter().position(|place| *place == masses[row]);
            let (Some(case), Some(mass), Some(at_range_end)) = (case, mass, at_range_end[row]) else {
                return Err(peaks.foreign_rows());
            };
            let peak = Peak { frequency: frequency[row], amplitude: amplitude[row], at_range_end };
            curves[case].masses[mass].peaks.push(peak);
        }
    }
    Ok(curves)
}
