//! Linearized equations at a motion: the system of a Newton step.
//!
//! The Jacobian is `δ_qp r_y - r_u R_qp f_y`, see `equations`. The matrix has
//! the lowest harmonics alone, or all of them.

use crate::method::harmonic_balance::aft::{Port, Ports, tangent_range};
use crate::method::harmonic_balance::equations::contact_parameter::ContactParameters;
use crate::method::harmonic_balance::equations::homotopy::Homotopy;
use nalgebra::DMatrix;
use num_complex::Complex64;

/// The linearized equations at a motion.
pub(crate) struct LinearizedEquations<'a> {
    pub ports: &'a Ports,
    pub harmonics: &'a [usize],
    pub omega: f64,
    pub homotopy: Homotopy,
    pub length: f64,
    pub contacts: &'a [ContactParameters],
    pub tangents: &'a [f64],
    pub blocks: &'a [usize],
    pub units: &'a [f64],
}

impl LinearizedEquations<'_> {
    /// Returns K or T of a port.
    pub fn tangent(&self, p: usize, port: &Port) -> &[f64] {
        &self.tangents[tangent_range(self.blocks, p, port, self.harmonics.len())]
    }

    /// Returns the complex mean of a port's tangent at harmonic number `k`,
    /// between two of its axes.
    pub fn mean(&self, tangent: &[f64], axes: usize, a: usize, b: usize, k: usize) -> Complex64 {
        let pair = 2 * self.harmonics.len();
        let wide = pair * axes;
        let at = |i: usize, j: usize| tangent[(a * pair + 2 * k + i) * wide + b * pair + 2 * k + j];
        if self.harmonics[k] == 0 {
            return Complex64::new(at(0, 0), 0.0);
        }
        Complex64::new(at(0, 0) + at(1, 1), at(1, 0) - at(0, 1)) * 0.5
    }

    /// Multiplies a residual in units by its units.
    pub fn multiply_by_residual_units(&self, residual: &mut [f64]) {
        residual.iter_mut().zip(self.units).for_each(|(r, unit)| *r *= unit);
    }

    /// Divides a step by the units of steps.
    pub fn divide_by_step_units(&self, step: &mut [f64]) {
        let pair = 2 * self.harmonics.len();
        for port in self.ports.iter() {
            let unit = port.unit(self.length);
            step[pair * port.first_axis..pair * (port.first_axis + port.axes)].iter_mut().for_each(|d| *d /= unit);
        }
    }

    /// Assembles the Jacobian of the first `kept` harmonics without the others, row-major and
    /// in units, into `jacobian`. `product` is scratch memory.
    pub fn matrix(
        &self,
        receptance: &[DMatrix<Complex64>],
        kept: usize,
        (product, jacobian): (&mut Vec<f64>, &mut Vec<f64>),
    ) {
        let (ports, harmonics) = (self.ports, &self.harmonics[..kept]);
        let (whole, pair) = (2 * self.harmonics.len(), 2 * kept);
        let size = pair * ports.count();
        jacobian.clear();
        jacobian.resize(size * size, 0.0);
        for (p, column) in ports.iter().enumerate() {
            let wide = pair * column.axes;
            let other = self.tangent(p, column);
            for (q, row) in ports.iter().enumerate() {
                let own = self.tangent(q, row);
                let tall = pair * row.axes;
                if row.is_force() && self.contacts[q].is_imposed() {
                    continue;
                }
                // R f_y, with f_y = K or 1; R does not couple harmonics
                product.clear();
                product.resize(tall * wide, 0.0);
                for a in 0..row.axes {
                    for b in 0..column.axes {
                        for k in 0..kept {
                            let r = receptance[k][(row.first_axis + a, column.first_axis + b)];
                            let at = (a * pair + 2 * k) * wide;
                            let (first, second) = product[at..at + 2 * wide].split_at_mut(wide);
                            if column.is_force() {
                                let at = b * pair + 2 * k;
                                (first[at], first[at + 1]) = (r.re, -r.im);
                                (second[at], second[at + 1]) = (r.im, r.re);
                                continue;
                            }
                            let across = whole * column.axes;
                            let at = (b * whole + 2 * k) * across;
                            let (re, im) = other[at..at + 2 * across].split_at(across);
                            for c in 0..column.axes {
                                let (re, im) = (&re[c * whole..][..pair], &im[c * whole..][..pair]);
                                let columns = c * pair..(c + 1) * pair;
                                let (first, second) = (&mut first[columns.clone()], &mut second[columns]);
                                for i in 0..pair {
                                    first[i] += r.re * re[i] - r.im * im[i];
                                    second[i] += r.re * im[i] + r.im * re[i];
                                }
                            }
                        }
                    }
                }
                // -r_u = 1, or T (ε d/dt + κ)
                let contact = self.contacts[q];
                for i in 0..tall {
                    let start = (row.first_axis * pair + i) * size + column.first_axis * pair;
                    let out = &mut jacobian[start..start + wide];
                    if !row.is_force() {
                        out.copy_from_slice(&product[i * wide..(i + 1) * wide]);
                        continue;
                    }
                    let slopes = &own[(i / pair * whole + i % pair) * whole * row.axes..][..whole * row.axes];
                    for a in 0..row.axes {
                        for (k, &h) in harmonics.iter().enumerate() {
                            let (at, of) = (a * pair + 2 * k, a * whole + 2 * k);
                            let (re, im) = contact.row((slopes[of], slopes[of + 1]), h, self.omega);
                            if re == 0.0 && im == 0.0 {
                                continue;
                            }
                            if column.is_force() {
                                for b in 0..column.axes {
                                    let i = b * pair + 2 * k;
                                    for i in i..i + 2 {
                                        out[i] += re * product[at * wide + i] + im * product[(at + 1) * wide + i];
                                    }
                                }
                                continue;
                            }
                            let (x, y) = product[at * wide..(at + 2) * wide].split_at(wide);
                            for ((out, x), y) in out.iter_mut().zip(x).zip(y) {
                                *out += re * x + im * y;
                            }
                        }
                    }
                }
            }
        }
        // r_y, and the units
        for (q, row) in ports.iter().enumerate() {
            let own = self.tangent(q, row);
            for i in 0..pair * row.axes {
                let at = row.first_axis * pair + i;
                let line = &mut jacobian[at * size..(at + 1) * size];
                line[at] += 1.0;
                if row.is_force() {
                    line[at] += self.homotopy.diagonal_term(harmonics[i % pair / 2]);
                    let slopes = &own[(i / pair * whole + i % pair) * whole * row.axes..][..whole * row.axes];
                    for (a, slopes) in slopes.chunks_exact(whole).enumerate() {
                        let own = &mut line[(row.first_axis + a) * pair..][..pair];
                        own.iter_mut().zip(slopes).for_each(|(j, t)| *j -= t);
                    }
                }
                let unit_of_row = self.units[row.first_axis * whole + i / pair * whole + i % pair];
                for column in ports.iter() {
                    let scale = column.unit(self.length) / unit_of_row;
                    if scale != 1.0 {
                        let columns = column.first_axis * pair..(column.first_axis + column.axes) * pair;
                        line[columns].iter_mut().for_each(|j| *j *= scale);
                    }
                }
            }
        }
    }
}
