//! Signals as records: a half-sine shock, a chirp, a random process with a constant power spectral
//! density.
//!
//! A record is linear between its rows. A polygon through samples of `sin ωt` at the distance `h`
//! has the first harmonic `sinc²(ωh/2) sin ωt`, so the samples of chirps and random processes are
//! divided by this factor.

use crate::case::values::Values;
use crate::data::ColumnError;
use std::f64::consts::{PI, TAU};
use stickslip_numerics::random::Stream;

/// Rows of a chirp per period. The polygon adds harmonics from the 47th on, below 5e-4.
const CHIRP_ROWS: f64 = 48.0;
/// Rows of a random process per period of its highest frequency. The polygon adds frequencies from
/// 15 times the highest on, below 5e-3.
const RANDOM_ROWS: f64 = 16.0;
/// Rows of a half-sine. Its polygon deviates by 3e-5 of the amplitude.
const SHOCK_ROWS: usize = 200;
/// Largest number of rows, and of rows times frequencies of a random process, which take seconds.
const MAX_ROWS: f64 = 2e6;
const MAX_PRODUCT: f64 = 4e9;

/// A signal by its rows; zero outside of them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SignalRows {
    pub times: Vec<f64>,
    pub values: Vec<f64>,
}

/// Factor by which a polygon with the row distance `h` lowers a sine of the frequency `omega`.
fn polygon_factor(omega: f64, h: f64) -> f64 {
    let half = 0.5 * omega * h;
    if half == 0.0 { 1.0 } else { (half.sin() / half).powi(2) }
}

fn missing(kind: &str, key: &str, example: &str) -> ColumnError {
    ColumnError { message: format!("a signal of kind `{kind}` needs `{key}`"), help: format!("add {key} = {example}") }
}

fn too_long(rows: f64) -> ColumnError {
    let message = format!("the signal needs {rows:.1e} rows; the limit is {MAX_ROWS:.0e}");
    ColumnError { message, help: "shorten it, or lower its highest frequency".to_owned() }
}

impl SignalRows {
    /// Samples a signal.
    ///
    /// # Errors
    /// A key is missing or without meaning, or the signal is too long.
    pub fn new(signal: &Values) -> Result<SignalRows, ColumnError> {
        let kind = signal.text("kind").unwrap_or_default();
        let length = signal.quantity("duration").unwrap_or(0.0);
        let begin = signal.quantity("begin").unwrap_or(0.0);
        let amplitude = || signal.quantity("amplitude").ok_or_else(|| missing(kind, "amplitude", "\"50 N\""));
        let band = || -> Result<[f64; 2], ColumnError> {
            let from = signal.quantity("from").ok_or_else(|| missing(kind, "from", "\"5 Hz\""))?;
            let to = signal.quantity("to").ok_or_else(|| missing(kind, "to", "\"50 Hz\""))?;
            if from == to {
                let message = "`from` and `to` are the same frequency".to_owned();
                return Err(ColumnError { message, help: "write two different frequencies".to_owned() });
            }
            Ok([from, to])
        };
        let mut rows = match kind {
            "chirp" => {
                let is_log = signal.text("scale") == Some("log");
                Chirp { band: band()?, length, is_log }.rows(amplitude()?)?
            }
            "random" => {
                let density = signal.quantity("density").ok_or_else(|| missing(kind, "density", "\"2 N^2/Hz\""))?;
                let seed = signal.count("seed").unwrap_or(1);
                random(density, band()?, length, seed)?
            }
            _ => half_sine(amplitude()?, length),
        };
        rows.times.iter_mut().for_each(|time| *time += begin);
        Ok(rows)
    }
}

fn half_sine(amplitude: f64, length: f64) -> SignalRows {
    let part = |i: usize| i as f64 / SHOCK_ROWS as f64;
    let value = |i: usize| if i == SHOCK_ROWS { 0.0 } else { amplitude * (PI * part(i)).sin() };
    SignalRows {
        times: (0..=SHOCK_ROWS).map(|i| length * part(i)).collect(),
        values: (0..=SHOCK_ROWS).map(value).collect(),
    }
}

/// A sine whose frequency changes.
struct Chirp {
    /// First and last frequency, rad/s.
    band: [f64; 2],
    length: f64,
    is_log: bool,
}

impl Chirp {
    fn frequency(&self, time: f64) -> f64 {
        let ([from, to], part) = (self.band, time / self.length);
        if self.is_log { from * (to / from).powf(part) } else { from + (to - from) * part }
    }

    fn phase(&self, time: f64) -> f64 {
        let [from, to] = self.band;
        if self.is_log {
            let rate = (to / from).ln() / self.length;
            from * (rate * time).exp_m1() / rate
        } else {
            from * time + 0.5 * (to - from) / self.length * time * time
        }
    }

    fn rows(&self, amplitude: f64) -> Result<SignalRows, ColumnError> {
        let count = CHIRP_ROWS * self.phase(self.length) / TAU;
        if count > MAX_ROWS {
            return Err(too_long(count));
        }
        let (mut times, mut values, mut time) = (Vec::new(), Vec::new(), 0.0);
        while time < self.length {
            let omega = self.frequency(time);
            let step = TAU / omega / CHIRP_ROWS;
            times.push(time);
            values.push(amplitude * self.phase(time).sin() / polygon_factor(omega, step));
            time += step;
        }
        times.push(self.length.max(times.last().copied().unwrap_or(0.0) + 1e-9 * self.length));
        values.push(amplitude * self.phase(self.length).sin());
        Ok(SignalRows { times, values })
    }
}

/// Samples a normal process: a sum of cosines and sines at the multiples of the inverse length in
/// the band, with normal factors of the variance `density Δω`.
fn random(density: f64, [from, to]: [f64; 2], length: f64, seed: u64) -> Result<SignalRows, ColumnError> {
    let (from, to) = (from.min(to), from.max(to));
    let step = TAU / length;
    let (first, last) = ((from / step).ceil(), (to / step).floor());
    if last < first {
        let message = "the random process has no frequency: its band is narrower than the inverse duration".to_owned();
        return Err(ColumnError { message, help: "lengthen `duration`, or widen the band".to_owned() });
    }
    let rows = (RANDOM_ROWS * to * length / TAU).ceil();
    if rows > MAX_ROWS || rows * (last - first) > MAX_PRODUCT {
        return Err(too_long(rows));
    }
    let h = length / rows;
    let count = rows as usize;
    let mut values = vec![0.0; count + 1];
    let stream = Stream::new(seed);
    for line in first as u64..=last as u64 {
        let omega = line as f64 * step;
        let size = (density * step).sqrt() / polygon_factor(omega, h);
        let (cosine, sine) = (size * stream.normal(2 * line), size * stream.normal(2 * line + 1));
        // the rotation by ωh from row to row, begun anew so that rounding does not add up
        let (turn_sin, turn_cos) = (omega * h).sin_cos();
        for block in (0..=count).step_by(256) {
            let (mut s, mut c) = (omega * h * block as f64).sin_cos();
            for value in values.iter_mut().skip(block).take(256) {
                *value += cosine * c + sine * s;
                (s, c) = (s * turn_cos + c * turn_sin, c * turn_cos - s * turn_sin);
            }
        }
    }
    Ok(SignalRows { times: (0..=count).map(|i| h * i as f64).collect(), values })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The variance of the process is density times bandwidth, and its mean is zero.
    #[test]
    fn a_random_process_has_its_spectrum() {
        let (density, band, length) = (3.0, [TAU * 5.0, TAU * 45.0], 50.0);
        let rows = random(density, band, length, 1).expect("rows");
        let mean = |f: &dyn Fn(f64) -> f64| rows.values.iter().map(|v| f(*v)).sum::<f64>() / rows.values.len() as f64;
        let variance = mean(&|v| v * v);
        let expected = density * (band[1] - band[0]);
        // 2000 lines: a standard deviation of 1/sqrt(2000); the polygon factor adds up to 2 %
        assert!((variance / expected - 1.0).abs() < 0.08, "{variance} {expected}");
        assert!(mean(&|v| v).abs() < 0.02 * expected.sqrt());
        // power in the lower half of the band, by its Fourier coefficients
        let power = |low: f64, high: f64| -> f64 {
            let lines = (low * length) as usize..(high * length) as usize;
            let n = rows.values.len() - 1;
            lines
                .map(|line| {
                    let turn = |i: usize| TAU * (line * i % n) as f64 / n as f64;
                    let part = |f: fn(f64) -> f64| -> f64 {
                        (0..n).map(|i| rows.values[i] * f(turn(i))).sum::<f64>() * 2.0 / n as f64
                    };
                    0.5 * (part(f64::cos).powi(2) + part(f64::sin).powi(2))
                })
                .sum()
        };
        let lower = power(5.0, 15.0);
        assert!((lower / (density * TAU * 10.0) - 1.0).abs() < 0.2, "{lower}");
        assert!(power(46.0, 60.0) < 1e-6 * lower);
        assert_ne!(rows, random(density, band, length, 2).expect("rows"));
    }

    #[test]
    fn a_chirp_ends_at_its_last_frequency() {
        for is_log in [false, true] {
            for band in [[10.0, 80.0], [80.0, 10.0]] {
                let chirp = Chirp { band, length: 7.0, is_log };
                let h = 1e-5;
                for time in [0.0, 2.0, 7.0 - h] {
                    let slope = (chirp.phase(time + h) - chirp.phase(time)) / h;
                    assert!((slope / chirp.frequency(time + 0.5 * h) - 1.0).abs() < 1e-6, "{time} {slope}");
                }
                assert!((chirp.frequency(7.0) - band[1]).abs() < 1e-9);
                let rows = chirp.rows(2.0).expect("rows");
                assert!(rows.times.windows(2).all(|pair| pair[0] < pair[1]) && rows.values[0] == 0.0);
            }
        }
    }
}
