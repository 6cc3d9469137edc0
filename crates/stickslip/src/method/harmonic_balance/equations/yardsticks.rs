//! What is large and what is small: the length of a motion, the units of residuals, the penalty of contacts, the limits that nothing reaches.

use super::super::kept::weight;
use super::super::ports::{Port, Ports};
use super::{Level, Solution};
use num_complex::Complex64;

/// Where contacts alone hold, the length of a motion counts up to so many times that of its harmonics and of rest.
const FAR: f64 = 4.0;
/// Share of the mean displacement that constant loads cause on closed contacts, below which no motion is solved more exactly than this share: the
/// residual is then at the mean's rounding.
const STANDING: f64 = 1e-5;
/// Length of a motion that is none, m: its square is a number still.
const NOTHING: f64 = 1e-150;

impl Level {
    /// The yardstick of motions: their size, or a hundredth of that without friction, as velocities relative to the drive frequency.
    pub fn length(&self, motion: &Solution) -> f64 {
        let nh = self.alternation.harmonics.len();
        // the mean without friction is far away where only laws hold a direction
        let norm = |c: &[Complex64], from: usize| {
            let harmonics = c.iter().enumerate().map(|(i, z)| (z.norm_sqr(), self.alternation.harmonics[i % nh]));
            harmonics.filter(|(_, h)| *h >= from).map(|(square, h)| square * weight(h)).sum::<f64>().sqrt()
        };
        let mut size = norm(&motion.c, 0);
        if self.stands() {
            // a mean that goes far is no yardstick
            let standing = norm(&self.linear, 0);
            size = size.min(FAR * (norm(&motion.c, 1) + standing)).max(STANDING * standing);
        }
        (size + 1e-2 * norm(&self.linear, 1)).max(NOTHING)
    }

    /// Units of the residual: the motion's length, or the law's scale, but no more than the forces that there are: a limit that nothing reaches says
    /// nothing of them. Where only laws hold a direction, the mean of the motion is the small difference of large ones, and its unit the larger of these.
    pub(in super::super) fn measure(&mut self, ports: &Ports, motion: &Solution, length: f64) {
        let nh = self.harmonics().len();
        let forces = ports.iter().filter(|port| port.is_force()).flat_map(Port::range);
        let largest =
            forces.flat_map(|q| &motion.force[q * nh..(q + 1) * nh]).map(|f| f.norm_sqr()).fold(0.0, f64::max);
        let in_play = (self.holding + largest.sqrt()).max(NOTHING);
        for port in ports.iter() {
            let unit = port.unit(length);
            let unit = if port.is_force() { unit.min(in_play) } else { unit };
            self.units[2 * nh * port.first..2 * nh * (port.first + port.axes)].fill(unit);
            if port.is_force() || self.alternation.harmonics[0] != 0 {
                continue;
            }
            for q in port.range() {
                let moved = match self.sparse {
                    Some(_) => 0.0,
                    None => self.receptance.mean(q) * motion.force[q * nh].norm(),
                };
                let large = unit + self.linear[q * nh].norm().min(moved);
                (self.units[2 * q * nh], self.units[2 * q * nh + 1]) = (large, large);
            }
        }
    }

    /// Factor on slip limits from which nothing slips, not even what moves as if there were no friction.
    pub fn sticking(&self, ports: &Ports) -> f64 {
        let limits = ports.iter().filter(|port| port.is_force()).map(|port| port.scale);
        let least = limits.filter(|limit| *limit > 0.0).fold(f64::INFINITY, f64::min);
        Some(4.0 * self.holding / least).filter(|factor| factor.is_finite()).unwrap_or(1.0)
    }
}
