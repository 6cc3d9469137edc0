//! Further tables of a transient, on request: work done on the joints over time, spectra by Welch's
//! method, shock response spectra.
//!
//! Sources: P. D. Welch (1967), with Hann windows of half overlap and the degrees of freedom of
//! D. B. Percival, A. T. Walden (1993), section 6.17; D. O. Smallwood (1981), the ramp-invariant
//! filter of ISO 18431-4.

use super::record::Records;
use crate::results::table_builder::TableBuilder;
use crate::run::work::PreparedCase;
use std::f64::consts::TAU;
use stickslip::orbit::Sample;
use stickslip_numerics::fourier::FourierPlan;
use stickslip_numerics::random::normal_quantile;

/// Work done on every joint over time.
pub(super) const JOINT_WORK: &str = "joint_work";
/// Power spectral density of every place.
pub(super) const SPECTRUM: &str = "spectrum";
/// Largest acceleration of oscillators on every place.
pub(super) const SHOCK_SPECTRUM: &str = "shock_spectrum";

/// The tables, in the order in which the kind lists them.
pub(super) const ALL: [&str; 3] = [JOINT_WORK, SPECTRUM, SHOCK_SPECTRUM];

/// Instants per sample for the work and the shock response spectrum. At 20 samples a period, the
/// work of a harmonic force and motion is then exact to 1e-4.
pub(super) const INSTANTS: usize = 8;
/// Half-overlapping segments of a spectrum.
const SEGMENTS: usize = 8;
/// Damping ratio of the oscillators of a shock response spectrum.
const SHOCK_DAMPING: f64 = 0.05;
/// Their frequencies per octave.
const PER_OCTAVE: f64 = 12.0;

/// The samples of a motion, with all that the wanted tables need.
#[derive(Debug, Default)]
pub(super) struct History {
    /// The names of the tables.
    wanted: Vec<String>,
    times: Vec<f64>,
    /// Displacements of the samples, place by place.
    displacement: Vec<Vec<f64>>,
    /// Accelerations, with that of the ground, at the first sample and at [`INSTANTS`] in every
    /// later one, place by place.
    acceleration: Vec<Vec<f64>>,
    /// Work on every direction of the joints since the beginning, [sample][direction].
    work: Vec<Vec<f64>>,
    /// Relative displacement and force of every direction at the last instant.
    before: Vec<[f64; 2]>,
}

impl History {
    pub fn new(wanted: &[String]) -> Self {
        History { wanted: wanted.to_vec(), ..History::default() }
    }

    fn wants(&self, table: &str) -> bool {
        self.wanted.iter().any(|wanted| wanted == table)
    }

    /// Adds a sample. `since` returns the motion since the previous one.
    pub fn add(
        &mut self,
        prepared: &PreparedCase,
        records: Option<&Records>,
        (time, sample): (f64, &Sample),
        since: &dyn Fn(f64) -> Sample,
    ) {
        if self.wants(SPECTRUM) {
            push_places(&mut self.displacement, prepared, &sample.displacement);
        }
        if self.wants(JOINT_WORK) || self.wants(SHOCK_SPECTRUM) {
            let mut work = self.work.last().cloned().unwrap_or_default();
            if let Some(last) = self.times.last().copied() {
                for k in 1..INSTANTS {
                    let instant = last + (time - last) * k as f64 / INSTANTS as f64;
                    self.advance(prepared, records, (instant, &since(instant)), &mut work);
                }
            }
            self.advance(prepared, records, (time, sample), &mut work);
            self.work.push(work);
        }
        self.times.push(time);
    }

    /// Adds an instant, and its work to that of the previous one.
    fn advance(
        &mut self,
        prepared: &PreparedCase,
        records: Option<&Records>,
        (time, sample): (f64, &Sample),
        work: &mut Vec<f64>,
    ) {
        if self.wants(SHOCK_SPECTRUM) {
            let mut acceleration = sample.acceleration.clone();
            if let Some(records) = records {
                let ground = records.ground_acceleration(time);
                acceleration.iter_mut().zip(ground).for_each(|(own, ground)| *own += ground);
            }
            push_places(&mut self.acceleration, prepared, &acceleration);
        }
        let joints = prepared.system.joints().iter().zip(&sample.joints);
        let now: Vec<[f64; 2]> = joints
            .flat_map(|(joint, state)| (0..joint.axes().len()).map(|a| [state.displacement[a], state.force[a]]))
            .collect();
        work.resize(now.len(), 0.0);
        for ((done, [u, force]), before) in work.iter_mut().zip(&now).zip(&self.before) {
            *done += 0.5 * (force + before[1]) * (u - before[0]);
        }
        self.before = now;
    }

    /// Writes the wanted tables of [`ALL`]. `begin` writes the first cells of a row.
    pub fn write(&self, prepared: &PreparedCase, begin: &dyn Fn(&mut TableBuilder), tables: &mut [TableBuilder]) {
        for (table, name) in tables.iter_mut().zip(ALL) {
            if !self.wants(name) || self.times.len() < 2 {
                continue;
            }
            match name {
                JOINT_WORK => self.write_work(prepared, begin, table),
                SPECTRUM => self.write_spectrum(prepared, begin, table),
                _ => self.write_shock(prepared, begin, table),
            }
        }
    }

    fn step(&self) -> f64 {
        (self.times[self.times.len() - 1] - self.times[0]) / (self.times.len() - 1) as f64
    }

    fn write_work(&self, prepared: &PreparedCase, begin: &dyn Fn(&mut TableBuilder), table: &mut TableBuilder) {
        let labels: Vec<String> = prepared.system.joints().iter().flat_map(|joint| joint.labels()).collect();
        for (row, time) in self.times.iter().enumerate() {
            begin(table);
            table.number("time_s", *time);
            for (label, work) in labels.iter().zip(&self.work[row]) {
                table.number(&format!("{label}_work_J"), *work);
            }
            table.end_row();
        }
    }

    fn write_spectrum(&self, prepared: &PreparedCase, begin: &dyn Fn(&mut TableBuilder), table: &mut TableBuilder) {
        let Some(segments) = Segments::new(self.times.len()) else { return };
        let spectra: Vec<Vec<f64>> =
            self.displacement.iter().map(|values| segments.density(values, self.step())).collect();
        let [low, high] = segments.confidence();
        for line in 1..=segments.length / 2 {
            begin(table);
            table.number("frequency_Hz", line as f64 / (segments.length as f64 * self.step()));
            for (place, spectrum) in prepared.system.places().iter().zip(&spectra) {
                table.number(&format!("{place}_displacement_density_m2_per_Hz"), spectrum[line]);
            }
            table.number("low_95_factor", low);
            table.number("high_95_factor", high);
            table.end_row();
        }
    }

    fn write_shock(&self, prepared: &PreparedCase, begin: &dyn Fn(&mut TableBuilder), table: &mut TableBuilder) {
        let step = self.step();
        // from one period in the record to ten samples a period
        let (first, last) = (1.0 / (step * self.times.len() as f64), 0.1 / step);
        let count = (PER_OCTAVE * (last / first).log2()).floor().max(0.0) as usize;
        for i in 0..=count {
            let frequency = first * (i as f64 / PER_OCTAVE).exp2();
            begin(table);
            table.number("frequency_Hz", frequency);
            for (place, values) in prepared.system.places().iter().zip(&self.acceleration) {
                let largest = largest_acceleration(values, TAU * frequency * step / INSTANTS as f64);
                table.number(&format!("{place}_largest_acceleration_m_per_s2"), largest);
            }
            table.end_row();
        }
    }
}

/// Adds a motion of all degrees of freedom to the values of every place.
fn push_places(of_places: &mut Vec<Vec<f64>>, prepared: &PreparedCase, motion: &[f64]) {
    let now = prepared.system.at_places(motion);
    of_places.resize(now.len(), Vec::new());
    of_places.iter_mut().zip(now).for_each(|(values, value)| values.push(value));
}

/// Returns the largest absolute acceleration of an oscillator on a base with this acceleration.
/// `phase` is its natural frequency times the sampling step.
fn largest_acceleration(base: &[f64], phase: f64) -> f64 {
    let decay = (-SHOCK_DAMPING * phase).exp();
    let turn = phase * (1.0 - SHOCK_DAMPING * SHOCK_DAMPING).sqrt();
    let (c, s) = (decay * turn.cos(), decay * turn.sin() / turn);
    let (b, a) = ([1.0 - s, 2.0 * (s - c), decay * decay - s], [-2.0 * c, decay * decay]);
    let (mut x, mut y) = ([0.0; 2], [0.0; 2]);
    let mut largest = 0.0f64;
    for value in base {
        let next = b[0] * value + b[1] * x[0] + b[2] * x[1] - a[0] * y[0] - a[1] * y[1];
        x = [*value, x[0]];
        y = [next, y[0]];
        largest = largest.max(next.abs());
    }
    largest
}

/// Segments of a record, each of this even length.
struct Segments {
    length: usize,
    count: usize,
}

impl Segments {
    /// Divides `samples` samples; `None` if there are too few.
    fn new(samples: usize) -> Option<Segments> {
        let length = 2 * samples / (SEGMENTS + 1) / 2 * 2;
        (length >= 16).then(|| Segments { length, count: (samples - length) / (length / 2) + 1 })
    }

    /// Returns the one-sided power spectral density at the multiples of the inverse length.
    fn density(&self, values: &[f64], step: f64) -> Vec<f64> {
        let n = self.length;
        let window: Vec<f64> = (0..n).map(|i| 0.5 - 0.5 * (TAU * i as f64 / n as f64).cos()).collect();
        let power: f64 = window.iter().map(|w| w * w).sum();
        let mut plan = FourierPlan::new(n);
        let mut density = vec![0.0; n / 2 + 1];
        for segment in 0..self.count {
            let part = &values[segment * n / 2..segment * n / 2 + n];
            let mean = part.iter().sum::<f64>() / n as f64;
            let mut windowed: Vec<f64> = part.iter().zip(&window).map(|(value, w)| (value - mean) * w).collect();
            for (sum, line) in density.iter_mut().zip(plan.transform(&mut windowed)) {
                *sum += 2.0 * line.norm_sqr() * step / power / self.count as f64;
            }
        }
        density
    }

    /// Returns the ends of the 95 % interval of a density, as factors on its estimate.
    fn confidence(&self) -> [f64; 2] {
        let count = self.count as f64;
        let freedom = 36.0 * count * count / (19.0 * count - 1.0);
        // quantiles of the chi-squared distribution by Wilson and Hilferty (1931)
        let quantile = |z: f64| {
            let part = 2.0 / (9.0 * freedom);
            freedom * (1.0 - part + z * part.sqrt()).powi(3)
        };
        [0.975, 0.025].map(|share| freedom / quantile(normal_quantile(share)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The density of a sine, summed over its lines, is its power.
    #[test]
    fn a_spectrum_has_the_power_of_its_signal() {
        let step = 1e-3;
        let values: Vec<f64> = (0..9000).map(|i| 3.0 * (TAU * 50.0 * step * f64::from(i)).sin() + 7.0).collect();
        let segments = Segments::new(values.len()).expect("segments");
        let density = segments.density(&values, step);
        let width = 1.0 / (segments.length as f64 * step);
        let power: f64 = density.iter().map(|d| d * width).sum();
        assert!((power / 4.5 - 1.0).abs() < 1e-6, "{power}");
        let highest = (0..density.len()).max_by(|a, b| density[*a].total_cmp(&density[*b])).expect("a line");
        assert!((highest as f64 * width - 50.0).abs() < width);
        // eight half-overlapping segments have 15.258 degrees of freedom; the quotients with the
        // quantiles of the chi-squared distribution are 0.54807 and 2.37381 by SciPy
        let [low, high] = segments.confidence();
        assert_eq!(segments.count, SEGMENTS);
        assert!((low / 0.54807 - 1.0).abs() < 1e-3 && (high / 2.37381 - 1.0).abs() < 4e-3, "{low} {high}");
    }

    /// A sine on a resonant oscillator: `|y| = a sqrt(1 + 4ζ²)/(2ζ)`; a soft one hardly moves, and
    /// a stiff one moves with its base.
    #[test]
    fn a_shock_spectrum_has_its_resonance() {
        let values: Vec<f64> = (0..40_000).map(|i| 2.0 * (TAU * 1e-2 * f64::from(i)).sin()).collect();
        let at = |ratio: f64| largest_acceleration(&values, TAU * 1e-2 * ratio);
        let resonant = 2.0 * (1.0 + 4.0 * SHOCK_DAMPING * SHOCK_DAMPING).sqrt() / (2.0 * SHOCK_DAMPING);
        assert!((at(1.0) / resonant - 1.0).abs() < 3e-3, "{} {resonant}", at(1.0));
        assert!(at(0.01) < 0.1 && (at(9.0) / 2.0 - 1.0).abs() < 0.03, "{} {}", at(0.01), at(9.0));
    }
}
