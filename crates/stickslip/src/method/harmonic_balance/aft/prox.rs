//! Force ports: a law of velocity by its resolvent, rigid, steep or smooth.
//!
//! For any `ε > 0`, `λ = φ(v)` is equivalent to `λ = J(λ + ε v)` with `J = (1 + ε φ⁻¹)⁻¹`. For
//! rigid friction `J` is the projection onto `[-limit, limit]`. If φ does not fall with
//! velocity, the slope of `J` is at most 1, however steep φ is.
//!
//! Source: Alart and Curnier (1991); Nacivet et al. (2003); Parikh and Boyd,
//! "Proximal Algorithms" (2014).
//!
//! Steep maps change within a sample. Along one axis the mean of the map over the
//! sample is taken, for an argument `y + eξ`, `-1 < ξ < 1`, that is linear there.
//! The mean locates a zero of the velocity within its sample, and the forces stay
//! the gradient of a convex function. In a plane the argument turns rather than
//! passes through zero, and the value in the middle of the sample is taken.

use super::Port;
use super::frequency_time::{FrequencyTime, add_block, amplitude_factor, as_block, spectrum_pair};
use crate::law::{MAX_DIRECTIONS, ProxView, SampleMeans, SharedLaw};
use num_complex::Complex64;
use std::f64::consts::TAU;

/// Rigid friction along one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RigidFriction {
    /// Slip limit, N.
    pub limit: f64,
}

impl ProxView for RigidFriction {
    fn resolve(&self, y: &[f64], _penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        force[0] = y[0].clamp(-self.limit, self.limit);
        slope[0] = if y[0].abs() < self.limit { 1.0 } else { 0.0 };
    }
    fn resolvent_means(&self, y: f64, e: f64, _penalty: f64) -> SampleMeans {
        let mean = clamp_means(y / self.limit, e / self.limit);
        SampleMeans { zeroth: self.limit * mean.zeroth, first: self.limit * mean.first, ..mean }
    }
}

/// A law with a resolvent `J`, and its forces multiplied by τ: `τ φ` has the
/// resolvent `τ J(y/τ)` with the penalty `ε/τ`.
#[derive(Debug, Clone)]
pub(super) struct ScaledLaw {
    pub law: SharedLaw,
    pub times: f64,
}

impl ScaledLaw {
    fn one(&self) -> &dyn ProxView {
        self.law.prox().expect("a law without a resolvent has another kernel")
    }
}

impl ProxView for ScaledLaw {
    fn resolve(&self, y: &[f64], penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        let mut share = [0.0; MAX_DIRECTIONS];
        share.iter_mut().zip(y).for_each(|(share, y)| *share = y / self.times);
        self.one().resolve(&share[..y.len()], penalty / self.times, force, slope);
        force.iter_mut().for_each(|force| *force *= self.times);
    }
    fn force_at_velocity(&self, velocity: f64) -> Option<(f64, f64)> {
        let (force, slope) = self.one().force_at_velocity(velocity)?;
        Some((self.times * force, self.times * slope))
    }
    fn compliance(&self) -> f64 {
        self.one().compliance() / self.times
    }
    fn minimum_penalty(&self) -> f64 {
        self.one().minimum_penalty() * self.times
    }
    fn resolvent_means(&self, y: f64, e: f64, penalty: f64) -> SampleMeans {
        // the derivative of a resolvent is dimensionless
        let mean = self.one().resolvent_means(y / self.times, e / self.times, penalty / self.times);
        SampleMeans { zeroth: self.times * mean.zeroth, first: self.times * mean.first, ..mean }
    }
    fn mean_at_velocity(&self, velocity: f64, e: f64) -> Option<SampleMeans> {
        let mean = self.one().mean_at_velocity(velocity, e)?;
        Some(SampleMeans {
            zeroth: self.times * mean.zeroth,
            first: self.times * mean.first,
            slope: self.times * mean.slope,
            slope_first: self.times * mean.slope_first,
            slope_second: self.times * mean.slope_second,
        })
    }
}

impl FrequencyTime {
    /// Adds the harmonics of the resolvent of the signal `y`, [axis][harmonic],
    /// to `image`, and their derivative to `tangent`.
    pub(super) fn resolve(
        &mut self,
        prox: &dyn ProxView,
        port: &Port,
        penalty: f64,
        y: &[Complex64],
        image: &mut [Complex64],
        tangent: Option<&mut [f64]>,
    ) {
        if port.axes == 1 {
            // the projection always has kinks
            let mean = port.is_rigid() || self.changes_by(y, 1.0 / port.scale);
            // in stick the map is the identity and the force must equal the signal: the effect
            // of the mean over a sample is undone first
            return self.apply_on_line(
                |y, e| prox.resolvent_means(y, e, penalty),
                (mean, mean),
                port.scale,
                y,
                image,
                tangent,
            );
        }
        self.apply_in_plane(prox, port.axes, penalty, y, image, tangent);
    }

    /// Adds the harmonics of the force at the velocities `v`, which the force does not change.
    /// Rigid friction changes its sign over `width` (m/s).
    pub(super) fn velocity(
        &mut self,
        prox: &dyn ProxView,
        port: &Port,
        width: f64,
        v: &mut [Complex64],
        image: &mut [Complex64],
    ) {
        if port.axes == 1
            && let Some((_, slope)) = prox.force_at_velocity(0.0)
        {
            let mean = self.changes_by(v, slope / port.scale);
            let law = |v, e| prox.mean_at_velocity(v, e).unwrap_or_default();
            return self.apply_on_line(law, (mean, false), port.scale, v, image, None);
        }
        // the force reaches the limit at the velocity `width`
        let penalty = port.scale / width;
        v.iter_mut().for_each(|v| *v *= penalty);
        if port.axes == 1 {
            return self.apply_on_line(
                |y, e| prox.resolvent_means(y, e, penalty),
                (true, true),
                port.scale,
                v,
                image,
                None,
            );
        }
        self.apply_in_plane(prox, port.axes, penalty, v, image, None);
    }

    /// Returns true if a signal times `scale` may change over a sample by a tenth or more.
    fn changes_by(&self, y: &[Complex64], scale: f64) -> bool {
        let highest = self.harmonics.last().map_or(1.0, |&h| h as f64);
        let largest: f64 = y.iter().map(|y| y.norm()).sum();
        // Below this change of the argument over a sample, relative to the law's scale, a
        // resolvent counts as smooth. The point value is then exact to spectral accuracy, and more
        // accurate than the mean.
        scale * largest * TAU * highest / self.samples() as f64 >= 0.1
    }

    /// Applies a map along one axis. `mean`: the mean over each sample is taken. `undo`: the
    /// signal is rescaled first, so that the mean of the identity is the identity.
    fn apply_on_line(
        &mut self,
        map: impl Fn(f64, f64) -> SampleMeans,
        (mean, undo): (bool, bool),
        scale: f64,
        y: &[Complex64],
        image: &mut [Complex64],
        tangent: Option<&mut [f64]>,
    ) {
        let n = self.samples();
        let widen = |change: Complex64| if undo { 1.0 / (1.0 + change.norm_sqr() / 3.0) } else { 1.0 };
        self.synthesise(y, |h| Complex64::new(widen(half_sample_change(h, n)), 0.0));
        self.reserve_slopes(3);
        for i in 0..n {
            let y = self.signal[i];
            let (before, after) =
                (self.signal[if i == 0 { n - 1 } else { i - 1 }], self.signal[if i + 1 == n { 0 } else { i + 1 }]);
            let e = if mean { 0.25 * (after - before) } else { 0.0 };
            let value = map(y, e);
            self.slips[i] = y.abs() >= scale;
            self.force[0][i] = value.zeroth;
            self.moment[i] = value.first;
            self.slopes[0][i] = value.slope;
            self.slopes[1][i] = value.slope_first;
            self.slopes[2][i] = value.slope_second;
        }
        self.add_force(0, image);
        if mean {
            self.work.copy_from_slice(&self.moment);
            let sums = self.fourier.transform(&mut self.work);
            for (f, &h) in image.iter_mut().zip(&self.harmonics) {
                *f += sums[h] * amplitude_factor(h, n) * half_sample_change(h, n).conj();
            }
        }
        let Some(tangent) = tangent else { return };
        for slope in 0..if mean { 3 } else { 1 } {
            if !self.slope_spectrum(slope, slope) {
                self.spectra[slope].fill(Complex64::default());
            }
        }
        let size = 2 * self.harmonics.len();
        // once per harmonic: the sines of all pairs would take a third of a Newton step
        self.column.iter_mut().zip(&self.harmonics).for_each(|(change, &h)| *change = half_sample_change(h, n));
        for (a, &h) in self.harmonics.iter().enumerate() {
            for (b, &k) in self.harmonics.iter().enumerate() {
                let (mut minus, mut plus) = spectrum_pair(&self.spectra[0], h, k);
                if mean {
                    let (row, column) = (self.column[a].conj(), self.column[b]);
                    let (minus_1, plus_1) = spectrum_pair(&self.spectra[1], h, k);
                    let (minus_2, plus_2) = spectrum_pair(&self.spectra[2], h, k);
                    minus += (row + column) * minus_1 + row * column * minus_2;
                    plus += (row + column.conj()) * plus_1 + row * column.conj() * plus_2;
                }
                add_block(tangent, size, (a, h), (b, k), as_block(minus, plus).map(|x| widen(self.column[b]) * x));
            }
        }
    }

    /// Applies a map along several axes.
    fn apply_in_plane(
        &mut self,
        prox: &dyn ProxView,
        axes: usize,
        penalty: f64,
        y: &[Complex64],
        image: &mut [Complex64],
        tangent: Option<&mut [f64]>,
    ) {
        let (n, nh) = (self.samples(), self.harmonics.len());
        for a in 0..axes {
            self.synthesise(&y[a * nh..(a + 1) * nh], |_| Complex64::new(1.0, 0.0));
            self.displacement[a].copy_from_slice(&self.signal);
        }
        self.reserve_slopes(axes * axes);
        let (mut force, mut slope) = ([0.0; MAX_DIRECTIONS], [0.0; MAX_DIRECTIONS * MAX_DIRECTIONS]);
        for i in 0..n {
            let y: [f64; MAX_DIRECTIONS] = std::array::from_fn(|a| self.displacement[a][i]);
            prox.resolve(&y[..axes], penalty, &mut force[..axes], &mut slope[..axes * axes]);
            for a in 0..axes {
                self.force[a][i] = force[a];
            }
            for (signal, slope) in self.slopes.iter_mut().zip(&slope[..axes * axes]) {
                signal[i] = *slope;
            }
        }
        for a in 0..axes {
            self.add_force(a, &mut image[a * nh..(a + 1) * nh]);
        }
        let Some(tangent) = tangent else { return };
        for at in 0..axes * axes {
            if self.slope_spectrum(at, 0) {
                self.add_slope(tangent, (at / axes, at % axes), axes, |_| Complex64::new(1.0, 0.0));
            }
        }
    }
}

/// Returns half of the change of `e^{jhθ}` over a sample, relative to its middle.
fn half_sample_change(h: usize, n: usize) -> Complex64 {
    Complex64::new(0.0, 0.5 * (h as f64 * TAU / n as f64).sin())
}

/// Returns the means of x clamped to [-1, 1].
#[inline]
fn clamp_means(y: f64, e: f64) -> SampleMeans {
    let (at, reach) = (y.abs(), e.abs());
    if at >= 1.0 + reach {
        return SampleMeans { zeroth: y.signum(), ..SampleMeans::default() };
    }
    if at + reach <= 1.0 {
        return SampleMeans {
            zeroth: y,
            first: e / 3.0,
            slope: 1.0,
            slope_second: 1.0 / 3.0,
            ..SampleMeans::default()
        };
    }
    let mut mean = if at - reach >= -1.0 {
        // only the upper end of the ramp lies within the sample, at ξ = t
        let t = ((1.0 - at) / reach).clamp(-1.0, 1.0);
        SampleMeans {
            zeroth: 1.0 - 0.25 * reach * (t + 1.0) * (t + 1.0),
            first: -0.5 * reach * (t * t * t / 6.0 - 0.5 * t - 1.0 / 3.0),
            slope: 0.5 * (t + 1.0),
            slope_first: 0.25 * (t * t - 1.0),
            slope_second: (t * t * t + 1.0) / 6.0,
        }
    } else {
        // both ends of the ramp: from ξ = s to ξ = t
        let (s, t) = ((-1.0 - at) / reach, (1.0 - at) / reach);
        let (s, t) = (s.clamp(-1.0, 1.0), t.clamp(-1.0, 1.0));
        let ramp = |power: i32| (t.powi(power) - s.powi(power)) / f64::from(power);
        let (r1, r2, r3) = (ramp(1), ramp(2), ramp(3));
        SampleMeans {
            zeroth: 0.5 * (at * r1 + reach * r2 + (1.0 - t) - (s + 1.0)),
            first: 0.5 * (at * r2 + reach * r3 + 0.5 * (1.0 - t * t) - 0.5 * (s * s - 1.0)),
            slope: 0.5 * r1,
            slope_first: 0.5 * r2,
            slope_second: 0.5 * r3,
        }
    };
    if y < 0.0 {
        (mean.zeroth, mean.slope_first) = (-mean.zeroth, -mean.slope_first);
    }
    if e < 0.0 {
        (mean.first, mean.slope_first) = (-mean.first, -mean.slope_first);
    }
    mean
}
