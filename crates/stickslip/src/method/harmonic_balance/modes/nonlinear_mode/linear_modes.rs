//! Linear modes of the structure without its joints, where nonlinear modes begin.

use super::{ModeEquations, ModeState, PlacedPort, ZERO};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use stickslip_numerics::eigen;

/// Settings of the modes at small amplitude.
#[derive(Debug, Clone, Copy)]
struct LinearModeSettings {
    /// Share of the joints' stiffness that separates equal modes of a structure without joints.
    joint_share: f64,
    /// Squared frequency, relative to that of the joints' share alone, up to which a mode is a
    /// rigid-body motion.
    rigid_body: f64,
    /// Relative distance of two squared frequencies up to which modes count as equal. It is well
    /// above `joint_share`.
    equal_frequencies: f64,
    /// Rounding error of squared frequencies relative to the largest, per degree of freedom.
    rounding: f64,
    /// Share of the size of a mode below which an entry is ignored.
    negligible_entry: f64,
    /// Iterations between the frequency and the stiffness of joints at small amplitude, which may
    /// depend on the frequency.
    iterations: usize,
}

impl Default for LinearModeSettings {
    fn default() -> Self {
        LinearModeSettings {
            joint_share: 1e-9,
            rigid_body: 2.0,
            equal_frequencies: 1e-7,
            rounding: 64.0 * f64::EPSILON,
            negligible_entry: 1e-6,
            iterations: 5,
        }
    }
}

/// Linear mode of the structure without its joints.
#[derive(Debug, Clone)]
pub(crate) struct LinearMode {
    /// Squared frequency, (rad/s)².
    pub squared_frequency: f64,
    /// Shape φ with φᴴ M φ = 1, 1/√kg.
    ///
    /// It is real, unless neither the structure nor its joints separate a pair of equal modes.
    /// Then it is one of the two travelling waves `(φ₁ ± jφ₂)/√2`. These do not depend on the
    /// basis φ₁, φ₂ of the pair.
    pub shape: DVector<Complex64>,
    /// For such a wave, the standing mode of the pair with the same number.
    pub standing_mode: Option<DVector<f64>>,
}

impl LinearMode {
    /// Returns the standing mode in place of a wave, or `None` for a mode that is not a wave.
    pub fn standing(&self) -> Option<LinearMode> {
        let shape = real(self.standing_mode.as_ref()?);
        Some(LinearMode { squared_frequency: self.squared_frequency, shape, standing_mode: None })
    }
}

/// Linear mode of small motions about the equilibrium.
#[derive(Debug, Clone)]
pub(crate) struct SmallMode {
    /// The mode as a motion. Of a pair of equal modes, a travelling wave.
    pub state: ModeState,
    /// For such a wave, the standing motion of the pair with the same number.
    pub standing: Option<ModeState>,
}

fn real(shape: &DVector<f64>) -> DVector<Complex64> {
    shape.map(|x| Complex64::new(x, 0.0))
}

/// Returns the travelling waves of a pair of real modes.
///
/// In the first wave a place leads the previous ones, as under a positive engine order with
/// places numbered sector by sector. The first place with a significant phase decides.
fn waves(one: &DVector<f64>, other: &DVector<f64>) -> [DVector<Complex64>; 2] {
    let settings = LinearModeSettings::default();
    let size = one.amax().max(other.amax());
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let wave = one.zip_map(other, |re, im| Complex64::new(half * re, half * im));
    let from = wave.iter().find(|x| x.norm() > settings.negligible_entry * size).copied().unwrap_or(ZERO);
    let leads = wave
        .iter()
        .map(|x| (from.conj() * x).im)
        .find(|leads| leads.abs() > settings.negligible_entry * size * from.norm());
    let back = wave.map(|x| x.conj());
    if leads.is_some_and(|leads| leads < 0.0) { [back, wave] } else { [wave, back] }
}

impl ModeEquations<'_> {
    /// Returns the linear modes of the structure without its joints, by rising frequency.
    pub fn linear_modes(&self) -> Vec<LinearMode> {
        let settings = LinearModeSettings::default();
        let n = self.system.dofs();
        if n == 0 {
            return Vec::new(); // the motion of every place is given
        }
        // keep a small share of the joints' stiffness, so that equal blades move with or
        // against each other as the joints couple them
        let mut of_joints = DMatrix::zeros(n, n);
        for PlacedPort { port, directions: w } in self.motion_ports.iter().chain(&self.force_ports) {
            let kt = port.stiffness();
            let kt = if kt > 0.0 { kt } else { self.system.structure().stiffness().amax() };
            for w in w {
                of_joints += w * w.transpose() * (settings.joint_share * kt);
            }
        }
        let stiffness = self.system.structure().stiffness() + &of_joints;
        let Some(factor) = self.system.structure().mass().clone().cholesky() else { return Vec::new() };
        let lower = factor.l();
        let Some(inverse) = lower.solve_lower_triangular(&DMatrix::identity(n, n)) else { return Vec::new() };
        let Some(eigen) = eigen::symmetric(&inverse * stiffness * inverse.transpose()) else { return Vec::new() };
        let shapes = inverse.transpose() * eigen.eigenvectors;
        let mut modes: Vec<(f64, DVector<f64>)> =
            (0..n).map(|k| (eigen.eigenvalues[k].max(0.0), shapes.column(k).into_owned())).collect();
        modes.sort_by(|a, b| a.0.total_cmp(&b.0));
        // the joints' share is the only stiffness of a rigid-body motion
        let squared = |square: f64, shape: &DVector<f64>| {
            let share = shape.dot(&(&of_joints * shape));
            if square <= settings.rigid_body * share { 0.0 } else { square }
        };
        let rounding = settings.rounding * n as f64 * modes.last().map_or(0.0, |mode| mode.0);
        let equal = |a: &(f64, DVector<f64>), b: &(f64, DVector<f64>)| b.0 - a.0 <= rounding;
        let mut found = Vec::with_capacity(n);
        for group in modes.chunk_by(equal) {
            match group {
                [(square, one), (_, other)] => {
                    let made = |(shape, stands): (_, &DVector<f64>)| LinearMode {
                        squared_frequency: squared(*square, stands),
                        shape,
                        standing_mode: Some(stands.clone()),
                    };
                    found.extend(waves(one, other).into_iter().zip([one, other]).map(made));
                }
                _ => found.extend(group.iter().map(|(square, shape)| LinearMode {
                    squared_frequency: squared(*square, shape),
                    shape: real(shape),
                    standing_mode: None,
                })),
            }
        }
        found
    }

    /// Returns a linear mode at amplitude `a`. Forces along laws of velocity are zero. Returns
    /// `None` if its frequency is zero.
    pub fn linear_state(&self, mode: &LinearMode, a: f64) -> Option<ModeState> {
        let (n, nh) = (self.system.dofs(), self.aft.harmonics.len());
        let omega = mode.squared_frequency.sqrt();
        let mut x = vec![ZERO; nh * n];
        for i in 0..n {
            x[self.first * n + i] = a * mode.shape[i];
        }
        let damping = self.system.structure().damping().map(|c| Complex64::new(c, 0.0));
        let dissipated = mode.shape.dotc(&(damping * &mode.shape)).re;
        let force = vec![ZERO; nh * self.force_axes()];
        (omega > 0.0).then(|| ModeState { x, force, omega, damping: dissipated / (2.0 * omega) })
    }

    /// Returns the linear mode number `index`, by rising frequency, of small motions about the
    /// equilibrium, as a motion of amplitude `a`.
    ///
    /// A mode that begins at its small end starts there. Returns `None` with rigid friction,
    /// which has no stiffness.
    pub fn small_amplitude_mode(&mut self, index: usize, a: f64) -> Option<SmallMode> {
        let settings = LinearModeSettings::default();
        if !self.force_ports.is_empty() {
            return None;
        }
        let (n, structure) = (self.system.dofs(), self.system.structure());
        let factor = structure.mass().clone().cholesky()?;
        let inverse = factor.l().solve_lower_triangular(&DMatrix::identity(n, n))?;
        // any frequency above zero serves as the first one
        let of_joints = self.motion_ports.iter().map(|placed| placed.port.stiffness()).fold(0.0, f64::max);
        let mut square = (structure.stiffness().amax() + of_joints) / structure.mass().amax();
        let mut found = None;
        for _ in 0..settings.iterations {
            let stiffness = self.small_motion_stiffness(square.sqrt());
            let eigen = eigen::symmetric(&inverse * stiffness.map(|k| k.re) * inverse.transpose())?;
            let mut order: Vec<usize> = (0..n).collect();
            order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
            let own = *order.get(index)?;
            let is_equal = |k: &usize| {
                let apart = eigen.eigenvalues[*k] - eigen.eigenvalues[own];
                apart.abs() <= settings.equal_frequencies * eigen.eigenvalues[own].abs()
            };
            let equal: Vec<usize> = order.iter().copied().filter(is_equal).collect();
            let shape = |k: usize| inverse.transpose() * eigen.eigenvectors.column(k);
            let standing = real(&shape(own));
            let wave = match equal[..] {
                [one, other] => {
                    let [forwards, backwards] = waves(&shape(one), &shape(other));
                    Some(if own == one { forwards } else { backwards })
                }
                _ => None,
            };
            // φᴴ M φ = 1, so ω² + 2 j ζ ω² = φᴴ (K + j ω C) φ
            let whole = standing.dotc(&(stiffness * &standing));
            square = whole.re;
            if square.is_nan() || square <= 0.0 {
                return None;
            }
            found = Some((standing, wave, whole.im / (2.0 * square)));
        }
        let (standing, wave, damping) = found?;
        let motion = |shape: DVector<Complex64>| {
            let mut x = vec![ZERO; self.aft.harmonics.len() * n];
            x[self.first * n..(self.first + 1) * n].copy_from_slice((shape * Complex64::new(a, 0.0)).as_slice());
            ModeState { x, force: Vec::new(), omega: square.sqrt(), damping }
        };
        Some(match wave {
            Some(wave) => SmallMode { state: motion(wave), standing: Some(motion(standing)) },
            None => SmallMode { state: motion(standing), standing: None },
        })
    }

    /// Returns the number of the linear mode of small motions about the equilibrium whose shape is
    /// the most similar to that of a motion. Of modes with equal frequencies, it is `preferred` if
    /// that is one of them.
    ///
    /// Modes without joints have other numbers if joints alone hold a body, or if joints change the
    /// sequence of the frequencies.
    pub fn most_similar_small_mode(&mut self, state: &ModeState, preferred: usize) -> Option<usize> {
        let settings = LinearModeSettings::default();
        let structure = self.system.structure();
        let lower = structure.mass().clone().cholesky()?.l();
        let inverse = lower.solve_lower_triangular(&DMatrix::identity(structure.dofs(), structure.dofs()))?;
        let stiffness = self.small_motion_stiffness(state.omega).map(|k| k.re);
        let eigen = eigen::symmetric(&inverse * stiffness * inverse.transpose())?;
        let x = DVector::from_column_slice(self.first_harmonic(state));
        let parts = [x.map(|x| x.re), x.map(|x| x.im)].map(|part| lower.transpose() * part);
        let share = |k: usize| parts.iter().map(|part| eigen.eigenvectors.column(k).dot(part).powi(2)).sum::<f64>();
        let mut modes: Vec<(f64, f64)> = (0..x.len()).map(|k| (eigen.eigenvalues[k], share(k))).collect();
        modes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let equal = |a: &(f64, f64), b: &(f64, f64)| b.0 - a.0 <= settings.equal_frequencies * b.0.abs();
        let mut first = 0;
        let groups = modes.chunk_by(equal).map(|group| {
            first += group.len();
            (first - group.len()..first, group.iter().map(|mode| mode.1).sum::<f64>())
        });
        let (most_similar, _) = groups.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(if most_similar.contains(&preferred) { preferred } else { most_similar.start })
    }

    /// Returns the complex stiffness for small motions about the equilibrium, N/m.
    fn small_motion_stiffness(&mut self, omega: f64) -> DMatrix<Complex64> {
        let structure = self.system.structure();
        let mut stiffness = structure.stiffness().map(|k| Complex64::new(k, 0.0));
        stiffness += structure.damping().map(|c| Complex64::new(0.0, omega * c));
        self.add_equilibrium_stiffness(omega, &mut stiffness);
        stiffness
    }

    /// Adds the complex stiffness of the joints for small motions about the equilibrium, N/m: the
    /// derivative of the first harmonic of their forces.
    fn add_equilibrium_stiffness(&mut self, omega: f64, stiffness: &mut DMatrix<Complex64>) {
        let (nh, first) = (self.aft.harmonics.len(), self.first);
        let at_rest = self.absolute(&vec![ZERO; nh * self.system.dofs()]);
        for placed in &self.motion_ports {
            let axes = placed.directions.len();
            let wide = 2 * nh * axes;
            let (mut force, mut tangent) = (vec![ZERO; nh * axes], vec![0.0; wide * wide]);
            let c = placed.along(&at_rest, nh);
            self.aft.motion_port_force(&placed.port, (omega, 1.0), &c, &mut force, Some(&mut tangent));
            for (a, v) in placed.directions.iter().enumerate() {
                for (b, w) in placed.directions.iter().enumerate() {
                    let at = 2 * (a * nh + first) * wide + 2 * (b * nh + first);
                    let slope = Complex64::new(tangent[at], tangent[at + wide]);
                    *stiffness += (v * w.transpose()).map(|product| slope * product);
                }
            }
        }
    }

    /// Returns the modal amplitude, m √kg, above which friction is weak in the linear mode
    /// `index`.
    ///
    /// There the first harmonic of friction is at most `share` of the inertia forces. It is also
    /// at most `apart` times the difference of squared frequencies to every other mode.
    pub fn weak_friction_amplitude(&self, modes: &[LinearMode], index: usize, share: f64, apart: f64) -> f64 {
        let settings = LinearModeSettings::default();
        let Some(mode) = modes.get(index) else { return 0.0 };
        // the force of an unbounded law is weak at small amplitudes, if at all
        let bounded = self.motion_ports.iter().chain(&self.force_ports).filter(|placed| placed.port.scale.is_finite());
        let forces: Vec<(&DVector<f64>, f64)> =
            bounded.flat_map(|placed| placed.directions.iter().map(|w| (w, placed.port.scale))).collect();
        let along = |w: &DVector<f64>, shape: &DVector<Complex64>| -> Complex64 {
            w.iter().zip(shape.iter()).map(|(w, x)| x * *w).sum()
        };
        let onto = |shape: &DVector<Complex64>| -> f64 {
            forces.iter().map(|(w, limit)| limit * along(w, shape).norm()).sum()
        };
        let own = onto(&mode.shape) / (share * mode.squared_frequency);
        let others = modes.iter().enumerate().filter(|(k, _)| *k != index).map(|(_, other)| {
            let gap = (other.squared_frequency - mode.squared_frequency).abs();
            if gap <= settings.equal_frequencies * mode.squared_frequency {
                0.0
            } else {
                onto(&other.shape) / (apart * gap)
            }
        });
        4.0 / std::f64::consts::PI * others.fold(own, f64::max)
    }
}
