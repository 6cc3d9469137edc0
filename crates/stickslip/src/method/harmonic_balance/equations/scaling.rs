//! Scaling: the length of a motion, the units of residuals, and slip limits that no motion
//! reaches.

use super::harmonic_set::velocity_weight;
use super::{Discretization, HarmonicSolution};
use crate::method::harmonic_balance::aft::{Port, Ports};
use num_complex::Complex64;

/// If contacts alone hold a body, the length of a motion is at most this multiple of the sum of
/// its harmonics and the motion without friction.
const MEAN_BOUND: f64 = 4.0;
/// Least length, relative to the motion without friction with its mean on closed contacts. At a
/// smaller length, the rounding of the mean would dominate the residual.
const LEAST_LENGTH_SHARE: f64 = 1e-5;
/// Length of a zero motion, m. Its square is still positive.
const ZERO_LENGTH: f64 = 1e-150;

impl Discretization {
    /// Returns the length of a motion: its size plus a hundredth of the motion without
    /// friction, both as velocities relative to the excitation frequency.
    pub fn motion_scale(&self, motion: &HarmonicSolution) -> f64 {
        let nh = self.aft.harmonics.len();
        // without friction the mean is very large if only laws hold a direction
        let norm = |c: &[Complex64], from: usize| {
            let harmonics = c.iter().enumerate().map(|(i, z)| (z.norm_sqr(), self.aft.harmonics[i % nh]));
            harmonics.filter(|(_, h)| *h >= from).map(|(square, h)| square * velocity_weight(h)).sum::<f64>().sqrt()
        };
        let mut size = norm(&motion.c, 0);
        if self.is_held_by_contacts() {
            // a large mean must not define the length
            let standing = norm(&self.linear.motion, 0);
            size = size.min(MEAN_BOUND * (norm(&motion.c, 1) + standing)).max(LEAST_LENGTH_SHARE * standing);
        }
        (size + 1e-2 * norm(&self.linear.motion, 1)).max(ZERO_LENGTH)
    }

    /// Computes the units of the residual. The unit of motions is the length. The unit of
    /// forces is the law's scale, but no more than the forces in play: a limit that no force
    /// reaches is no measure. If only laws hold a direction, the mean is the small difference
    /// of large terms, and these increase its unit.
    pub(in super::super) fn set_residual_units(&mut self, ports: &Ports, motion: &HarmonicSolution, length: f64) {
        let nh = self.harmonics().len();
        let forces = ports.iter().filter(|port| port.is_force()).flat_map(Port::range);
        let largest =
            forces.flat_map(|q| &motion.force[q * nh..(q + 1) * nh]).map(|f| f.norm_sqr()).fold(0.0, f64::max);
        let in_play = (self.linear.largest_holding_force + largest.sqrt()).max(ZERO_LENGTH);
        for port in ports.iter() {
            let unit = port.unit(length);
            let unit = if port.is_force() { unit.min(in_play) } else { unit };
            self.workspace.units[2 * nh * port.first_axis..2 * nh * (port.first_axis + port.axes)].fill(unit);
            if port.is_force() || self.aft.harmonics[0] != 0 {
                continue;
            }
            for q in port.range() {
                let moved = match self.banded {
                    Some(_) => 0.0,
                    None => self.linear.receptance.mean_receptance(q) * motion.force[q * nh].norm(),
                };
                let large = unit + self.linear.motion[q * nh].norm().min(moved);
                (self.workspace.units[2 * q * nh], self.workspace.units[2 * q * nh + 1]) = (large, large);
            }
        }
    }

    /// Returns the factor on slip limits above which nothing slips, not even
    /// for the motion without friction.
    pub fn sticking_limit_factor(&self, ports: &Ports) -> f64 {
        let limits = ports.iter().filter(|port| port.is_force()).map(|port| port.scale);
        let least = limits.filter(|limit| *limit > 0.0).fold(f64::INFINITY, f64::min);
        Some(4.0 * self.linear.largest_holding_force / least).filter(|factor| factor.is_finite()).unwrap_or(1.0)
    }
}
