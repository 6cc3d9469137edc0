//! Mean position of bodies that only contacts support: the structure at rest with closed
//! contacts.
//!
//! The static receptance of an unsupported structure is that of the regularizing springs
//! ([`REGULARIZING_FREQUENCY`]), ten orders of magnitude above the compliance of contacts. Mean
//! positions would be small differences of large numbers, and residuals their rounding. For the
//! mean, the contact stiffness `k` of sticking joints with closed faces is added to the structure
//! and subtracted from the forces:
//!
//! `(K + W k Wᵀ) x = F - W (f - k u)`, `u = Wᵀ x`.
//!
//! This is the same equation for any `k`, and all its terms have the size of the motion. For a
//! sticking joint `f - k u` is constant, so one Newton step finds the static equilibrium with
//! all joints stuck.

use super::uncoupled_modes::{UncoupledDynamics, UndampedResonance};
use crate::method::harmonic_balance::aft::Ports;
use crate::method::harmonic_balance::equations::regularization::REGULARIZING_FREQUENCY;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::cell::RefCell;
use std::sync::Arc;
use stickslip_numerics::dense::{DenseLu, ProductShape, Transpose, multiply_blocked};

/// Returns the stiffness of closed contacts along the axes, N/m.
pub(crate) fn closed_stiffness(ports: &Ports) -> Vec<f64> {
    let all = ports.iter().flat_map(|port| (0..port.axes).map(|axis| port.closed_stiffness(axis)));
    all.map(|k| if k.is_finite() && k > 0.0 { k } else { 0.0 }).collect()
}

/// Returns true if contacts with these stiffnesses support a direction that nothing else
/// supports.
///
/// `own` returns the static receptance of each axis alone, with [`REGULARIZING_FREQUENCY`] of a
/// frequency. `largest` is the largest entry of the stiffness matrix, N/m.
pub(crate) fn need_contact_support(
    springs: &[f64],
    own: impl Fn(f64) -> Result<Vec<f64>, UndampedResonance>,
    omega: f64,
    largest: f64,
) -> bool {
    if springs.iter().all(|k| *k == 0.0) {
        return false;
    }
    let Ok(once) = own(omega) else { return false };
    // Receptance of the structure, relative to the compliance of a closed contact, up to which the
    // structure is well supported. Two digits are lost at this value.
    let well_supported = 1e2;
    if springs.iter().zip(&once).all(|(k, own)| k * own <= well_supported) {
        return false;
    }
    let Ok(stiffer) = own(2.0 * omega) else { return false };
    let free = unsupported(&once, &stiffer, largest);
    springs.iter().zip(&once).zip(free).any(|((k, own), free)| free && k * own > well_supported)
}

/// Tells per axis whether only the regularizing frequency supports it, from the static receptances
/// (m/N) with that of a frequency (`once`) and of twice the frequency (`stiffer`). `largest` is
/// the largest entry of the stiffness matrix, N/m.
pub(crate) fn unsupported(once: &[f64], stiffer: &[f64], largest: f64) -> impl Iterator<Item = bool> {
    // Ratio of the receptances at the frequency and at twice the frequency above which the
    // regularizing frequency alone supports a direction. Its springs are four times as stiff at
    // twice the frequency.
    let regularized = 2.0;
    // Stiffness that is the rounding of the matrix. Six units of rounding were found in a reduced
    // structure of 163 coordinates. A real spring that is as soft may count as none, because the
    // form with closed contacts holds for any structure.
    let rounding = 1e4 * f64::EPSILON * largest;
    once.iter().zip(stiffer).map(move |(once, stiffer)| *once > regularized * stiffer || once * rounding > 1.0)
}

/// Structure in uncoupled modes, which the closed contacts couple.
#[derive(Debug, Clone)]
pub(crate) struct ClosedModes {
    structure: Arc<UncoupledDynamics>,
    /// Modal stiffness of the closed contacts, `Φᵀ k Φ`.
    coupling: Vec<f64>,
    factor: RefCell<Option<(f64, Arc<DenseLu<f64>>)>>,
}

impl ClosedModes {
    /// Makes the modal stiffness of a structure with these springs along the axes, N/m.
    pub fn new(springs: &[f64], structure: &Arc<UncoupledDynamics>) -> Self {
        let (p, n) = (structure.axes, structure.modal_coefficients().len());
        let weighted: Vec<f64> =
            structure.at.chunks_exact(p.max(1)).flat_map(|at| at.iter().zip(springs).map(|(a, k)| a * k)).collect();
        let mut coupling = vec![0.0; n * n];
        // the columns of `at` are modes, so the first factor is transposed
        let rows: Vec<f64> =
            (0..p).flat_map(|q| (0..n).map(move |m| (q, m))).map(|(q, m)| weighted[m * p + q]).collect();
        multiply_blocked(
            &rows,
            &structure.at,
            &mut coupling,
            ProductShape { rows: n, inner: p, columns: n },
            Transpose::No,
        );
        ClosedModes { structure: structure.clone(), coupling, factor: RefCell::default() }
    }

    /// Returns the factored modal stiffness. It is kept until the excitation frequency changes.
    pub fn factor(&self, omega: f64) -> Result<Arc<DenseLu<f64>>, UndampedResonance> {
        let mut kept = self.factor.borrow_mut();
        if let Some((of, factor)) = &*kept
            && *of == omega
        {
            return Ok(factor.clone());
        }
        let n = self.structure.modal_coefficients().len();
        let mut matrix = self.coupling.clone();
        for (m, [mass, _, stiffness]) in self.structure.modal_coefficients().iter().enumerate() {
            matrix[m * n + m] += stiffness + (REGULARIZING_FREQUENCY * omega).powi(2) * mass;
        }
        let factor = Arc::new(DenseLu::new(matrix, n).map_err(|_| UndampedResonance)?);
        *kept = Some((omega, factor.clone()));
        Ok(factor)
    }

    /// Returns the displacements of all places (m) under constant forces on them, N.
    pub fn respond(&self, omega: f64, force: &DVector<Complex64>) -> Result<DVector<Complex64>, UndampedResonance> {
        let factor = self.factor(omega)?;
        // a mean has no imaginary part
        let mut modal = self.structure.modal_forces(&force.map(|f| f.re));
        factor.solve(modal.as_mut_slice());
        Ok(self.structure.physical_displacements(&modal).map(|x| Complex64::new(x, 0.0)))
    }

    /// Returns the displacements along the axes under unit forces along them, m/N.
    pub fn receptance(&self, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        let factor = self.factor(omega)?;
        let (p, n) = (self.structure.axes, self.structure.modal_coefficients().len());
        let at = &self.structure.at;
        let mut moved: Vec<f64> = (0..p).flat_map(|q| (0..n).map(move |m| at[m * p + q])).collect();
        factor.solve(&mut moved);
        let mut product = vec![0.0; p * p];
        multiply_blocked(at, &moved, &mut product, ProductShape { rows: p, inner: n, columns: p }, Transpose::No);
        Ok(DMatrix::from_iterator(p, p, product.into_iter().map(|r| Complex64::new(r, 0.0))))
    }
}

#[cfg(test)]
mod tests {
    use super::super::banded::BandedForm;
    use super::super::linear_dynamics::LinearDynamics;
    use super::*;
    use crate::law::{FrictionContact, SharedLaw};
    use crate::method::harmonic_balance::HarmonicBalance;
    use crate::method::{Method, OrbitError};
    use crate::model::{Axis, CyclicSymmetry, System};
    use crate::orbit::Orbit;
    use crate::structure::Structure;

    const TANGENTIAL: f64 = 1.5e5;
    const NORMAL: f64 = 2e5;
    const FRICTION: f64 = 0.5;

    fn contact(preload: f64) -> SharedLaw {
        let (tangential, normal) = (TANGENTIAL, NORMAL);
        Arc::new(FrictionContact { tangential, normal, friction: FRICTION, preload, tangents: 1 })
    }

    fn structure(mass: DMatrix<f64>, stiffness: DMatrix<f64>) -> Structure {
        damped(mass, stiffness, 0.0)
    }

    /// Returns a structure whose free motions are damped too, at `rate` (1/s).
    fn damped(mass: DMatrix<f64>, stiffness: DMatrix<f64>, rate: f64) -> Structure {
        let n = mass.nrows();
        let names = (0..n).map(|i| i.to_string()).collect();
        let damping = &stiffness * 1e-5 + &mass * rate;
        Structure::new(names, mass, damping, stiffness).unwrap()
    }

    fn orbit(system: &System, harmonics: usize, omega: f64) -> Result<Orbit, OrbitError> {
        let method = HarmonicBalance { harmonics: Some(harmonics), ..HarmonicBalance::default() };
        method.solver(system).unwrap().orbit(omega)
    }

    /// Returns a mass along (x, z) on one contact with the ground. The preload is 10 N.
    /// Constant forces act along both directions and a harmonic one along x.
    fn block(constant: [f64; 2], amplitude: f64) -> System {
        let structure = structure(DMatrix::identity(2, 2) * 0.7, DMatrix::zeros(2, 2));
        let axes = vec![Axis::new(vec![(0, 1.0)]), Axis::new(vec![(1, 1.0)])];
        let force = |i: usize| Complex64::new(constant[i], 0.0);
        let builder = System::builder(structure).joint("contact", contact(10.0), axes);
        let builder = builder.force(0, 0, force(0)).force(1, 0, force(1));
        builder.force(0, 1, Complex64::new(amplitude, 0.0)).build().unwrap()
    }

    /// While the contact sticks, a free block is an oscillator on its springs: `F/|kt - m Ω²|`,
    /// below and above its resonance. The normal force equals the applied force to rounding.
    #[test]
    fn a_stuck_free_block_is_a_linear_oscillator() {
        for (pressed, ratio) in [(10.0, 0.01), (10.0, 0.6), (10.0, 1.7), (10.0, 20.0), (25.0, 0.6), (4.0, 0.6)] {
            let omega = ratio * (TANGENTIAL / 0.7).sqrt();
            let found = orbit(&block([0.0, pressed], 0.3), 3, omega).unwrap();
            let amplitude = 0.3 / (TANGENTIAL - 0.7 * omega * omega).abs();
            let (x, z) = (&found.places[0], &found.places[1]);
            assert!((x.amplitude() / amplitude - 1.0).abs() < 1e-9, "{ratio}: {} {amplitude}", x.amplitude());
            assert!((z.mean - (pressed - 10.0) / NORMAL).abs() < 1e-9 * 10.0 / NORMAL, "{pressed}: {}", z.mean);
            assert!(found.evidence.residual < 1e-10, "{:?}", found.evidence);
            assert!((found.sample(0.0).joints[0].force[1] / pressed - 1.0).abs() < 1e-9);
        }
    }

    /// Friction carries a constant load `Q` along the face below the limit. The mean is `Q/kt`,
    /// and the vibration about it is the same as without the load: `F/|kt - m Ω²| cos Ωt`. The
    /// load may reach the limit together with the vibration.
    #[test]
    fn friction_carries_a_constant_load() {
        let (pressed, limit) = (10.0, 5.0);
        for (load, ratio) in [(3.0f64, 0.6), (-4.2, 0.6), (4.99, 0.01), (2.0, 1.7), (-1.0, 20.0)] {
            let omega = ratio * (TANGENTIAL / 0.7).sqrt();
            let amplitude = 0.3 / (TANGENTIAL - 0.7 * omega * omega).abs();
            // choose a harmonic load that leaves one hundredth of the limit
            let share = 0.99f64.min((limit - load.abs()) / (TANGENTIAL * amplitude));
            let found = orbit(&block([load, pressed], 0.3 * share), 3, omega).unwrap();
            let (x, z) = (&found.places[0], &found.places[1]);
            // the spring that regularizes a free mean carries (1e-5 Ω)² m of it
            let held = 1e-9 + 2e-10 * ratio * ratio;
            assert!((x.mean * TANGENTIAL / load - 1.0).abs() < held, "{load}, {ratio}: {}", x.mean * TANGENTIAL);
            assert!((x.amplitude() / (share * amplitude) - 1.0).abs() < 1e-6, "{load}, {ratio}: {}", x.amplitude());
            assert!(z.mean.abs() < 1e-9 * 10.0 / NORMAL, "{}", z.mean);
            assert!(found.joints[0].dissipation.abs() < 1e-9 * limit * amplitude, "{:?}", found.joints);
        }
    }

    /// A body on two contacts shakes down: one contact is loaded while the other is unloaded.
    /// Both slip at first, then carry opposite mean forces, and neither slips any more. The
    /// motion is then that of the springs. The mean forces that each contact would reach alone
    /// do not balance.
    #[test]
    fn a_body_on_two_contacts_shakes_down() {
        let (mass, sides, pressed) = (0.7, [1.0, -0.9], 10.0);
        // along x and z, and a rotation
        let body = structure(DMatrix::identity(3, 3) * mass, DMatrix::zeros(3, 3));
        let mut builder = System::builder(body);
        for (i, side) in sides.into_iter().enumerate() {
            let (tangent, normal) = (Axis::new(vec![(0, 1.0)]), Axis::new(vec![(1, 1.0), (2, side)]));
            builder = builder.joint(format!("contact{i}"), contact(pressed), vec![tangent, normal]);
        }
        let sum = |power: i32| sides.iter().map(|side: &f64| side.powi(power)).sum::<f64>();
        for (row, power) in [(1, 0), (2, 1)] {
            builder = builder.force(row, 0, Complex64::new(pressed * sum(power), 0.0));
        }
        // loads that move the springs in phase, by 4.5 N along x, and by 8 N and -7.2 N across
        // the faces
        let (pull, swing) = (4.5, 8.0);
        let omega = 0.5 * (TANGENTIAL / mass).sqrt();
        let [x, turned] = [pull / TANGENTIAL, swing / NORMAL];
        let inertia = mass * omega * omega;
        let loads = [(2.0 * TANGENTIAL - inertia) * x, NORMAL * sum(1) * turned, (NORMAL * sum(2) - inertia) * turned];
        for (row, load) in loads.into_iter().enumerate() {
            builder = builder.force(row, 1, Complex64::new(load, 0.0));
        }
        let found = orbit(&builder.build().unwrap(), 5, omega).unwrap();
        assert!((found.places[0].amplitude() / x - 1.0).abs() < 1e-6, "{}", found.places[0].amplitude() / x);
        assert!((found.places[2].amplitude() / turned - 1.0).abs() < 1e-6);
        let samples = 256;
        let mut alone = 0.0;
        for (i, side) in sides.into_iter().enumerate() {
            let force = |k: usize| found.sample(found.period() * k as f64 / samples as f64).joints[i].force[0];
            let mean = (0..samples).map(force).sum::<f64>() / samples as f64;
            // |T + 4.5 c| <= μ (10 + 8 side c) at both ends c = ±1 of the vibration
            let ends = [-1.0, 1.0].map(|c: f64| (FRICTION * (pressed + swing * side * c), pull * c));
            let low = ends.iter().fold(f64::NEG_INFINITY, |m, (limit, pull)| m.max(-limit - pull));
            let high = ends.iter().fold(f64::INFINITY, |m, (limit, pull)| m.min(limit - pull));
            assert!(low <= high && low * high > 0.0, "without a mean it slips: {low} {high}");
            assert!(mean > low - 1e-6 && mean < high + 1e-6, "{i}: {mean} within {low} and {high}");
            alone += 0.0f64.clamp(low, high);
        }
        assert!(alone.abs() > 0.3, "{alone}");
    }

    /// A load that lifts the block, or drags it by more than the friction limit, has no
    /// equilibrium.
    #[test]
    fn unsupported_loads_drift() {
        for constant in [[0.0, -1.0], [6.0, 10.0]] {
            let error = orbit(&block(constant, 0.3), 3, 200.0).unwrap_err();
            assert_eq!(error.status(), "drifts", "{constant:?}: {error}");
        }
    }

    /// Returns the normal forces of a wedge in static equilibrium under `pull` along z.
    ///
    /// Each face may stick or slip to either side. Friction allows one of these nine
    /// combinations. The faces have the axes `face` (tangent, normal) along x and z.
    fn pressed_wedge(faces: &[[[f64; 2]; 2]; 2], preloads: [f64; 2], pull: f64) -> [f64; 2] {
        for slips in 0..9 {
            // 0: sticks; 1 and 2: slips with a friction force of this sign
            let signs = [slips % 3, slips / 3].map(|kind| [0.0, 1.0, -1.0][kind as usize]);
            let (mut matrix, mut right) = (DMatrix::zeros(2, 2), DVector::from_vec(vec![0.0, pull]));
            for ((face, preload), sign) in faces.iter().zip(preloads).zip(signs) {
                let [t, n] = face.map(|axis| DVector::from_row_slice(&axis));
                let slope = if sign == 0.0 { &t * TANGENTIAL } else { &n * (sign * FRICTION * NORMAL) };
                matrix += &t * slope.transpose() + &n * n.transpose() * NORMAL;
                right -= &n * preload + &t * (sign * FRICTION * preload);
            }
            let x = matrix.lu().solve(&right).unwrap();
            let along = |axis: &[f64; 2]| axis[0] * x[0] + axis[1] * x[1];
            let normal = [0, 1].map(|i| preloads[i] + NORMAL * along(&faces[i][1]));
            let admissible = (0..2).all(|i| {
                let (trial, limit) = (TANGENTIAL * along(&faces[i][0]), FRICTION * normal[i]);
                normal[i] > 0.0 && if signs[i] == 0.0 { trial.abs() <= limit } else { trial * signs[i] >= limit }
            });
            if admissible {
                return normal;
            }
        }
        panic!("no equilibrium");
    }

    /// A wedge between two faces at the angles `a` to the circumference. The preloads equal the
    /// reactions to the load, `N1 = C sin a2/sin(a1 + a2)`, differ from them, or are zero. The
    /// load grows from zero, and friction carries its part.
    #[test]
    fn a_wedge_between_two_faces() {
        let (angles, pull) = ([0.4f64, 0.7], 30.0);
        let sum = (angles[0] + angles[1]).sin();
        let balance = [pull * angles[1].sin() / sum, pull * angles[0].sin() / sum];
        let face = |i: usize| {
            let (a, side) = (angles[i], if i == 0 { -1.0 } else { 1.0 });
            [[a.cos(), -side * a.sin()], [side * a.sin(), a.cos()]]
        };
        let faces = [face(0), face(1)];
        for preloads in [balance, [12.0, 12.0], [0.0, 0.0]] {
            let mut builder = System::builder(structure(DMatrix::identity(2, 2) * 0.004, DMatrix::zeros(2, 2)));
            for (i, (axes, preload)) in faces.iter().zip(preloads).enumerate() {
                let axes = axes.map(|[x, z]| Axis::new(vec![(0, x), (1, z)]));
                builder = builder.joint(format!("face{i}"), contact(preload), axes.to_vec());
            }
            let builder = builder.force(1, 0, Complex64::new(pull, 0.0));
            let system = builder.force(0, 1, Complex64::new(5e-5, 2e-5)).build().unwrap();
            let found = orbit(&system, 5, 900.0).unwrap();
            let expected = pressed_wedge(&faces, preloads, pull);
            if preloads == balance {
                assert!(expected.iter().zip(balance).all(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{expected:?}");
                assert!(found.joints.iter().all(|joint| joint.stick_fraction == 1.0), "{:?}", found.joints);
            }
            let allowed = if preloads == balance { 1e-9 } else { 1e-5 };
            for (i, expected) in expected.iter().enumerate() {
                let samples = 64;
                let force = |k: usize| found.sample(found.period() * k as f64 / samples as f64).joints[i].force[1];
                let mean = (0..samples).map(force).sum::<f64>() / samples as f64;
                // the vibration changes the slip of the static equilibrium by its own size
                assert!((mean / expected - 1.0).abs() < allowed, "{preloads:?}: {mean} {expected}");
            }
        }
    }

    /// Checks small vibration on closed contacts with a preload of 10 N. While all contacts
    /// stick, the series with one harmonic solves one equation for the mean and one for the
    /// first harmonic.
    fn stands(what: &str, system: &System, omega: f64) {
        let structure = system.structure();
        let n = structure.dofs();
        let (mut held, mut loads) =
            (structure.stiffness().clone(), [(); 2].map(|()| DVector::from_element(n, Complex64::ZERO)));
        for (harmonic, force) in system.excitation(omega) {
            loads[harmonic as usize] += force;
        }
        for joint in system.joints() {
            for (axis, k) in joint.axes().iter().zip([TANGENTIAL, NORMAL]) {
                let w = axis.dense(n);
                held += &w * w.transpose() * k;
                if k == NORMAL {
                    loads[0] -= w.map(|w| Complex64::new(10.0 * w, 0.0));
                }
            }
        }
        let found = orbit(system, 1, omega).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(found.evidence.stuck.len(), system.joints().len(), "{what}");
        for (h, load) in loads.into_iter().enumerate() {
            let s = Complex64::new(0.0, h as f64 * omega);
            let at = |i, k| s * s * structure.mass()[(i, k)] + s * structure.damping()[(i, k)] + held[(i, k)];
            let x = DMatrix::from_fn(n, n, at).lu().solve(&load).unwrap();
            let size = x.iter().map(|x| x.norm()).fold(0.0, f64::max);
            assert!(size > 0.0);
            for (place, x) in found.places.iter().zip(x.iter()) {
                let is = if h == 0 { Complex64::new(place.mean, 0.0) } else { place.first_harmonic };
                assert!((is - x).norm() < 1e-8 * size, "{what}, harmonic {h}: {is} {x}");
            }
        }
    }

    /// Returns a normal load that differs from the preload.
    fn pressed(i: usize) -> Complex64 {
        Complex64::new(10.0 + ((i * 7) % 5) as f64, 0.0)
    }

    /// Free chains along (x, z) on contacts, with every form of the receptance.
    #[test]
    fn free_chains_on_closed_contacts() {
        for (masses, every, damping, banded) in
            [(4, 1, 0.0, false), (4, 1, 20.0, false), (30, 1, 20.0, true), (110, 36, 20.0, false)]
        {
            let n = 2 * masses;
            let mut stiffness = DMatrix::zeros(n, n);
            for a in 0..n - 2 {
                let b = a + 2;
                for (r, c, k) in [(a, a, 3e6), (b, b, 3e6), (a, b, -3e6), (b, a, -3e6)] {
                    stiffness[(r, c)] += k;
                }
            }
            let mut builder = System::builder(damped(DMatrix::identity(n, n) * 0.5, stiffness, damping));
            for i in (0..masses).step_by(every) {
                let axes = vec![Axis::new(vec![(2 * i, 1.0)]), Axis::new(vec![(2 * i + 1, 1.0)])];
                builder = builder.joint(format!("contact{i}"), contact(10.0), axes).force(2 * i + 1, 0, pressed(i));
            }
            let system = builder.force(0, 1, Complex64::new(0.2, 0.0)).build().unwrap();
            assert_eq!(BandedForm::new(&system, &Ports::new(&system).unwrap(), &[0, 1]).is_some(), banded);
            stands(&format!("{masses} masses"), &system, 300.0);
        }
    }

    /// A free bar in its modes `cos πmξ` along (x, z), also with a number of contacts for which
    /// receptances are not formed.
    #[test]
    fn free_modes_on_closed_contacts() {
        let modes = 30;
        for contacts in [8, 80] {
            let n = 2 * modes;
            let diagonal =
                |of: &dyn Fn(usize) -> f64| DMatrix::from_fn(n, n, |i, k| if i == k { of(i / 2) } else { 0.0 });
            let mut builder = System::builder(structure(diagonal(&|_| 1.0), diagonal(&|m| 2e5 * (m as f64).powi(4))));
            let mut load = vec![Complex64::ZERO; n];
            for i in 0..contacts {
                let place = (i as f64 + 0.5) / contacts as f64;
                let shape = |m: usize| (std::f64::consts::PI * m as f64 * place).cos();
                let along = |axis: usize| Axis::new((0..modes).map(|m| (2 * m + axis, shape(m))).collect());
                builder = builder.joint(format!("contact{i}"), contact(10.0), vec![along(0), along(1)]);
                (0..modes).for_each(|m| load[2 * m + 1] += pressed(i) * shape(m));
            }
            for (i, force) in load.into_iter().enumerate() {
                builder = builder.force(i, 0, force);
            }
            let system = builder.force(4, 1, Complex64::new(0.2, 0.0)).build().unwrap();
            let ports = Ports::new(&system).unwrap();
            assert_eq!(LinearDynamics::new(&system, &ports).modes_for(&ports).is_some(), contacts == 80);
            stands(&format!("{contacts} contacts"), &system, 300.0);
        }
    }

    /// One sector of a free ring.
    #[test]
    fn free_rings_on_closed_contacts() {
        let (sectors, order) = (7, 2);
        let n = 2 * sectors;
        let mut stiffness = DMatrix::zeros(n, n);
        for a in 0..n {
            let b = (a + 2) % n;
            for (r, c, k) in [(a, a, 3e5), (b, b, 3e5), (a, b, -3e5), (b, a, -3e5)] {
                stiffness[(r, c)] += k;
            }
        }
        let cyclic = CyclicSymmetry { sectors, order };
        let mut builder = System::builder(structure(DMatrix::identity(n, n) * 0.5, stiffness));
        for i in 0..sectors {
            let axes = vec![Axis::new(vec![(2 * i, 1.0)]), Axis::new(vec![(2 * i + 1, 1.0)])];
            builder = builder.joint(format!("contact{i}"), contact(10.0), axes).force(2 * i + 1, 0, pressed(1));
            builder = builder.force(2 * i, 1, cyclic.phase_factor(1, i) * 0.2);
        }
        stands("ring", &builder.build().unwrap().with_cyclic_symmetry(cyclic).unwrap(), 300.0);
    }
}
