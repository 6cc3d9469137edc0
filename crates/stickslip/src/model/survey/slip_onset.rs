//! Loads of stuck joints under the excitation, and the motion at which they begin to slip.

use super::linear_modes::SpringDamper;
use super::stuck_joint::{StuckAxis, StuckState};
use super::{SlipOnset, Survey};
use nalgebra::{Cholesky, DMatrix, DVector};
use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip_numerics::golden_section::golden_section;

impl Survey {
    /// Returns the loads of the stuck joints under the model's excitation, relative to their
    /// limits.
    ///
    /// The excitation frequencies are from `from` to `to` (rad/s), which may be equal. Constant
    /// forces are not included, because their distribution over the joints depends on the
    /// history.
    ///
    /// Returns `None` if the model is too large for a quick answer, or if it has no linear
    /// response in the range.
    pub fn onset(&self, from: f64, to: f64) -> Option<Vec<SlipOnset>> {
        let omegas = self.frequencies(from, to)?;
        if self.joints.is_empty() {
            return Some(Vec::new());
        }
        let shares: Vec<Vec<f64>> = omegas.iter().map(|omega| self.relative_loads(*omega)).collect::<Option<_>>()?;
        if shares.iter().flatten().any(|share| share.is_nan()) {
            return None;
        }
        (0..self.joints.len()).map(|joint| self.onset_of(joint, &omegas, &shares)).collect()
    }

    /// Returns the frequencies (rad/s) of undamped modes that the excitation drives at
    /// resonance, with all joints free.
    ///
    /// Linear motion is unbounded there. The range applies to the excitation frequency.
    pub fn undamped_resonances(&self, from: f64, to: f64) -> Vec<f64> {
        let Some(shapes) = &self.free.shapes else { return Vec::new() };
        let driven = |index: usize, omega: f64| {
            let shape = shapes.column(index);
            self.system.excitation_harmonics().iter().filter(|load| load.harmonic > 0).any(|load| {
                let at = omega / f64::from(load.harmonic);
                let (mut power, mut size) = (Complex64::ZERO, 0.0);
                for (force, x) in load.amplitudes_at(at).iter().zip(shape.iter()) {
                    power += *force * *x;
                    size += (*force * *x).norm();
                }
                (from..=to).contains(&at) && power.norm() > 1e-9 * size
            })
        };
        let modes = self.free.modes.elastic.iter().enumerate();
        // Damping ratio that counts as zero, and relative work of an excitation on a mode that
        // counts as zero. Both are rounding errors.
        let bare = modes.filter(|(_, mode)| mode.damping.abs() <= 1e-12);
        bare.filter(|(index, mode)| driven(*index, mode.omega)).map(|(_, mode)| mode.omega).collect()
    }

    /// Returns the modal amplitude (m √kg) at which the first joint slips in a mode of the stuck
    /// structure. `index` counts the modes from 0.
    ///
    /// For two modes of equal frequency, it applies to their waves, `(φ₁ ± jφ₂)/√2`. Returns
    /// `None` if the mode does not exist or loads no joint.
    pub fn slip_amplitude(&self, index: usize) -> Option<f64> {
        let modes = &self.stuck.modes.elastic;
        let omega = modes.get(index)?.omega;
        // Relative distance of frequencies up to which two modes form a pair.
        let equal: Vec<usize> = (0..modes.len()).filter(|&k| (modes[k].omega / omega - 1.0).abs() <= 1e-9).collect();
        let members = if equal.len() == 2 { equal } else { vec![index] };
        let mut squares = vec![0.0; self.joints.len()];
        for &member in &members {
            for (square, share) in squares.iter_mut().zip(self.relative_modal_loads(member)?) {
                *square += share * share / members.len() as f64;
            }
        }
        let largest = squares.into_iter().fold(0.0, f64::max).sqrt();
        (largest > 0.0).then(|| 1.0 / largest)
    }

    /// Returns the loads of all joints in mode `index` at a modal amplitude of one, relative to
    /// their stick limits.
    fn relative_modal_loads(&self, index: usize) -> Option<Vec<f64>> {
        // with gyroscopic damping, the shapes of free vibration differ from these
        let shapes = self.stuck.shapes.as_ref().filter(|_| !self.stuck.gyroscopic)?;
        let omega = self.stuck.modes.elastic.get(index)?.omega;
        let shape = shapes.column(index).into_owned();
        let motion = |joint: &StuckAxis| joint.at.iter().map(|(i, w)| w * shape[*i]).sum::<f64>();
        let (n, rigid) = (self.dofs(), self.rigid());
        // the constraint forces balance springs and inertia: W f = ω²Mφ - Kφ - W k u
        let mut rest =
            self.system.structure().mass() * &shape * (omega * omega) - self.system.structure().stiffness() * &shape;
        for joint in &self.joints {
            if let StuckState::Spring { stiffness, .. } = joint.state {
                let force = stiffness * motion(joint);
                joint.at.iter().for_each(|(i, w)| rest[*i] -= w * force);
            }
        }
        let mut w = DMatrix::<f64>::zeros(n, rigid.len());
        for (column, joint) in rigid.iter().enumerate() {
            self.joints[*joint].at.iter().for_each(|(i, value)| w[(*i, column)] += value);
        }
        let normal = w.transpose() * &w + DMatrix::from_diagonal(&DVector::from_vec(self.compliances(&rigid)));
        let forces = Cholesky::new(normal)?.solve(&(w.transpose() * rest));
        let share = |(index, joint): (usize, &StuckAxis)| match joint.state {
            StuckState::Nothing => 0.0,
            // any motion causes partial slip
            StuckState::Spring { .. } if joint.gradual => {
                if motion(joint) == 0.0 {
                    0.0
                } else {
                    f64::INFINITY
                }
            }
            StuckState::Spring { displacement, .. } => motion(joint).abs() / displacement,
            StuckState::Rigid { limit } => {
                rigid.iter().position(|r| *r == index).map_or(0.0, |column| forces[column].abs() / limit)
            }
        };
        Some(self.joints.iter().enumerate().map(share).collect())
    }

    /// Returns the compliances of rigid joints, relative to that of the structure.
    fn compliances(&self, rigid: &[usize]) -> Vec<f64> {
        let limit = |joint: &usize| match self.joints[*joint].state {
            StuckState::Rigid { limit } => limit,
            StuckState::Nothing | StuckState::Spring { .. } => f64::INFINITY,
        };
        let least = rigid.iter().map(limit).fold(f64::INFINITY, f64::min);
        // Compliance of a rigid joint, relative to that of the structure. It distributes the
        // load over redundant joints.
        // Lower bound of the factor on that compliance for joints with larger limits. A joint
        // with a larger limit carries a larger part of a shared load. Joints along one line
        // carry the load in proportion to their limits and slip together.
        rigid.iter().map(|joint| 1e-10 * (least / limit(joint)).max(1e-3)).collect()
    }

    fn rigid(&self) -> Vec<usize> {
        let rigid = |joint: &StuckAxis| matches!(joint.state, StuckState::Rigid { .. }) && !joint.at.is_empty();
        (0..self.joints.len()).filter(|j| rigid(&self.joints[*j])).collect()
    }

    /// Returns excitation frequencies that resolve the loads of stuck joints: uniform over the
    /// range, and denser around modes that a harmonic of the excitation meets.
    fn frequencies(&self, from: f64, to: f64) -> Option<Vec<f64>> {
        // without shapes, the stiffnesses are too different to compute a response
        self.stuck.shapes.as_ref()?;
        if !(from > 0.0 && from <= to && to.is_finite()) {
            return None;
        }
        let unknowns = (self.dofs() + self.rigid().len()) as f64;
        let harmonics = self.harmonics();
        let cost = (unknowns.powi(3) / 3.0).max(1.0) * harmonics.len().max(1) as f64;
        // Limit of complex multiplications for an estimate of first slip: about 0.1 s.
        let affordable = (2.5e7 / cost) as usize;
        if from == to {
            return (affordable > 0).then(|| vec![from]);
        }
        // Number of frequencies sampled in a range, in addition to those around its modes.
        let count = 200.min(affordable / 2);
        // Smallest number of frequencies; fewer would miss maxima between modes.
        if count < 24 {
            return None;
        }
        let mut omegas: Vec<f64> =
            (0..=count).map(|i| from + (to - from) * i as f64 / count as f64).map(|w| w.min(to)).collect();
        let mut around = Vec::new();
        for mode in &self.stuck.modes.elastic {
            let width = mode.damping.clamp(1e-6, 0.1) * mode.omega;
            for h in &harmonics {
                // Sample points around a mode, in units of its damping ratio times its
                // frequency.
                let points = [0.0, 0.3, 0.6, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0]
                    .iter()
                    .flat_map(|a| [mode.omega - a * width, mode.omega + a * width]);
                around.extend(points.map(|w| w / f64::from(*h)).filter(|w| (from..=to).contains(w)));
            }
        }
        around.truncate(affordable / 2);
        omegas.extend(around);
        omegas.sort_by(f64::total_cmp);
        omegas.dedup();
        Some(omegas)
    }

    /// Returns the nonzero harmonics of the excitation without the constant part, ascending and
    /// without duplicates.
    pub fn harmonics(&self) -> Vec<u32> {
        let mut harmonics = self.system.harmonics_of_excitation(|z| z != Complex64::ZERO);
        harmonics.retain(|h| *h > 0);
        harmonics.sort_unstable();
        harmonics.dedup();
        harmonics
    }

    /// Returns the largest load over limit of every joint in one period at the excitation
    /// frequency `omega`, all joints stuck.
    fn relative_loads(&self, omega: f64) -> Option<Vec<f64>> {
        let harmonics = self.harmonics();
        let loads = harmonics.iter().map(|h| self.joint_loads(*h, omega)).collect::<Option<Vec<_>>>()?;
        let largest = |joint: usize| match &loads[..] {
            [] => 0.0,
            [one] => one[joint].norm(),
            several => {
                let highest = harmonics.last().copied().unwrap_or(1) as usize;
                // Instants per period of the highest harmonic, if there are several harmonics.
                // The largest value has a relative error of (π/64)²/2, about 0.1 %.
                // Largest number of instants; harmonics up to 64 have the full number.
                let instants = (64 * highest).min(4096);
                let at = |i: usize| {
                    let terms = several.iter().zip(&harmonics);
                    let phase = |h: u32| TAU * ((i * h as usize) % instants) as f64 / instants as f64;
                    terms.map(|(load, h)| (load[joint] * Complex64::from_polar(1.0, phase(*h))).re).sum::<f64>()
                };
                (0..instants).map(|i| at(i).abs()).fold(0.0, f64::max)
            }
        };
        Some((0..self.joints.len()).map(largest).collect())
    }

    /// Returns the complex load over limit of every stuck joint at harmonic `h`:
    /// `Z x + W f = F`, `Wᵀx + g = 0` for rigid joints.
    fn joint_loads(&self, h: u32, omega: f64) -> Option<Vec<Complex64>> {
        let (n, rigid, system) = (self.dofs(), self.rigid(), &self.system);
        let w = f64::from(h) * omega;
        let mut a = DMatrix::<Complex64>::zeros(n + rigid.len(), n + rigid.len());
        let mut b = DVector::<Complex64>::zeros(n + rigid.len());
        for i in 0..n {
            for j in 0..n {
                let real = system.structure().stiffness()[(i, j)] - w * w * system.structure().mass()[(i, j)];
                a[(i, j)] = Complex64::new(real, w * system.structure().damping()[(i, j)]);
            }
        }
        if let Some(excitation) =
            system.excitation_harmonics().iter().find(|load| load.harmonic == h).map(|load| load.amplitudes_at(omega))
        {
            for i in 0..n {
                b[i] = excitation[i];
            }
        }
        let imposed = |index: usize| {
            let StuckAxis { joint, axis, .. } = self.joints[index];
            system.joints()[joint].axes()[axis].imposed_at(h)
        };
        for (index, joint) in self.joints.iter().enumerate() {
            if let Some(SpringDamper { stiffness, damping, .. }) = joint.stuck_link() {
                let stiffness = Complex64::new(stiffness, w * damping);
                for (i, wi) in &joint.at {
                    b[*i] -= imposed(index) * (stiffness * *wi);
                    for (j, wj) in &joint.at {
                        a[(*i, *j)] += stiffness * (wi * wj);
                    }
                }
            }
        }
        let scale = (0..n).map(|i| a[(i, i)].norm()).fold(0.0, f64::max);
        for (row, (joint, compliance)) in rigid.iter().zip(self.compliances(&rigid)).enumerate() {
            for (i, wi) in &self.joints[*joint].at {
                a[(*i, n + row)] += wi;
                a[(n + row, *i)] += wi;
            }
            a[(n + row, n + row)] -= compliance / scale.max(f64::MIN_POSITIVE);
            b[n + row] = -imposed(*joint);
        }
        let x = if n + rigid.len() == 0 { b } else { a.lu().solve(&b)? };
        let share = |(index, joint): (usize, &StuckAxis)| match joint.state {
            StuckState::Nothing => Some(Complex64::ZERO),
            StuckState::Spring { displacement, .. } => {
                Some((joint.at.iter().map(|(i, w)| x[*i] * *w).sum::<Complex64>() + imposed(index)) / displacement)
            }
            StuckState::Rigid { limit } => match rigid.iter().position(|r| *r == index) {
                Some(row) => Some(x[n + row] / limit),
                // a joint between a moved place and the ground or another moved place cannot
                // stick
                None if imposed(index) != Complex64::ZERO => Some(Complex64::new(f64::INFINITY, 0.0)),
                None => Some(Complex64::ZERO),
            },
        };
        self.joints.iter().enumerate().map(share).collect()
    }

    /// Returns the onset of one joint from the samples, with refined maximum and borders.
    fn onset_of(&self, joint: usize, omegas: &[f64], shares: &[Vec<f64>]) -> Option<SlipOnset> {
        let at = |omega: f64| Some(self.relative_loads(omega)?[joint]);
        let value = |i: usize| shares[i][joint];
        let top = (0..omegas.len()).max_by(|&a, &b| value(a).total_cmp(&value(b)))?;
        let mut best = (omegas[top], value(top));
        // refinement is limited to models with few joints; for large ones the samples are
        // accurate enough
        // Largest number of degrees of freedom and joints for which borders are refined.
        let refined = (self.dofs() + self.joints.len()) <= 40;
        if refined && omegas.len() > 1 && best.1.is_finite() {
            let (low, high) = (omegas[top.saturating_sub(1)], omegas[(top + 1).min(omegas.len() - 1)]);
            // Tolerance for the frequency of the largest load, relative to two steps. The load
            // is flat there.
            let close = |a: f64, b: f64| b - a <= 1e-5 * (high - low);
            let found = golden_section((low, high), close, |omega| at(omega).ok_or(())).ok()?;
            if found.1 > best.1 {
                best = found;
            }
        }
        let border = |inside: f64, outside: f64| -> Option<f64> {
            let (mut inside, mut outside) = (inside, outside);
            // Bisections that locate a border between stick and slip: the final interval is
            // 1e-12 of the step.
            for _ in 0..if refined { 40 } else { 0 } {
                let middle = 0.5 * (inside + outside);
                if at(middle)? > 1.0 { inside = middle } else { outside = middle }
            }
            Some(inside)
        };
        // the refined maximum can be a peak between the samples
        let mut points: Vec<(f64, f64)> = omegas.iter().copied().zip((0..omegas.len()).map(value)).collect();
        points.push(best);
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut slip_ranges: Vec<(f64, f64)> = Vec::new();
        let mut begin = points.first().filter(|p| p.1 > 1.0).map(|p| p.0);
        for pair in points.windows(2) {
            let ((w, a), (v, b)) = (pair[0], pair[1]);
            match (a > 1.0, b > 1.0) {
                (false, true) => begin = Some(border(v, w)?),
                (true, false) => slip_ranges.extend(begin.take().zip(Some(border(w, v)?))),
                _ => {}
            }
        }
        slip_ranges.extend(begin.zip(points.last().map(|p| p.0)));
        Some(SlipOnset { largest: best.1, omega: best.0, slip_ranges })
    }
}
