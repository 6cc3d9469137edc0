//! Newton steps by GMRES, for structures that couple many joints.
//!
//! GMRES needs only products with the Jacobian `δ r_y - r_u R f_y`, which is not formed.
//! Laws couple harmonics, the structure couples joints. A product applies the laws and then the
//! structure. GMRES takes a few tens of products if its preconditioner is close to the Jacobian,
//! see `harmonic_preconditioner` and, for large structures in modes, `modal_preconditioner`.
//!
//! Preconditioners are kept from step to step, and in modes from frequency to
//! frequency, for as long as they help.
//!
//! Memory: per harmonic two complex matrices over the axes; in modes, two real
//! matrices over the axes and one over axes and modes.

use super::harmonic_preconditioner::{HarmonicPreconditioner, HarmonicPreconditionerSettings};
use super::linearization::LinearizedEquations;
use super::modal_preconditioner::ModalPreconditioner;
use crate::method::harmonic_balance::aft::{KRYLOV_AXES, Port, Ports};
use crate::method::harmonic_balance::dynamics::receptance::Receptance;
use crate::method::harmonic_balance::equations::homotopy::RESIDUAL_TOLERANCE;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::dense::{ProductShape, Transpose, multiply_blocked};
use stickslip_numerics::gmres::{Gmres, GmresLimits};
use stickslip_numerics::vector::dot;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Settings of Newton's method with GMRES.
#[derive(Debug, Clone, Copy)]
struct KrylovSettings {
    /// Number of unknowns from which GMRES is faster than elimination, with derivatives by all
    /// samples. Measured: for 8 and 10 nodes of three directions with six harmonics, 288 and 360
    /// unknowns, a point takes 2.4 and 3.2 ms instead of 5.7 and 8.0.
    unknowns: usize,
    /// Number of unknowns from which GMRES is used with rigid friction. It is larger, because the
    /// lowest harmonics of rigid friction are eliminated in any case.
    unknowns_with_forces: usize,
    /// Number of unknowns from which GMRES is used for few directions with rigid friction, whose
    /// series are long. Measured: a step of 10 joints with 128 harmonics, 2560 unknowns, takes 80
    /// products, an eighth of its elimination.
    long_series_unknowns: usize,
    /// Relative tolerance of GMRES, as a share of Newton's residual.
    forcing_term: f64,
    /// Upper bound of this tolerance. Derivatives of laws cost as much as tens of products, so
    /// that fewer Newton steps count more.
    coarsest: f64,
    /// Upper bound with modes, whose products cost more than derivatives do: for 1000 nodes one
    /// product takes 50 ms, all derivatives 0.3 s.
    coarsest_with_modes: f64,
    /// Lower bound with coarse derivatives, which have an error of this size. Measured: with a
    /// tenth of it, a point of 16 nodes takes 2 % longer.
    finest_with_coarse_derivatives: f64,
    /// Maximum number of Krylov vectors.
    vectors: usize,
    /// Maximum number of products.
    products: usize,
    /// Relative residual of the linear equations up to which a step is used.
    useful: f64,
    /// Number of products beyond which a kept preconditioner is replaced.
    kept_products: usize,
    /// Number of products that later steps may take in total in excess of the step for which a
    /// preconditioner was made. Beyond it, the next step makes a new one, which costs as much.
    excess_products: usize,
    /// Number of harmonics above which derivatives of laws do not fit in the cache.
    cached_harmonics: usize,
    /// Cost factor of products with the derivatives of unknown forces, whose series are long:
    /// every product reads them from memory. Measured: 21 ms a product of 11 joints with 512
    /// harmonics.
    uncached_cost: f64,
}

impl Default for KrylovSettings {
    fn default() -> Self {
        KrylovSettings {
            unknowns: 200,
            unknowns_with_forces: 400,
            long_series_unknowns: 2048,
            forcing_term: 0.1,
            coarsest: 1e-6,
            coarsest_with_modes: 1e-2,
            finest_with_coarse_derivatives: 1e-2,
            vectors: 80,
            products: 320,
            useful: 0.1,
            kept_products: 25,
            excess_products: 10,
            cached_harmonics: 64,
            uncached_cost: 8.0,
        }
    }
}

/// Number of unknowns up to which the Jacobian is formed if GMRES does not
/// converge: 130 MB, seconds.
pub(crate) const FORMED_UNKNOWNS: usize = 4096;
/// Tells whether a discretization with `size` unknowns uses GMRES.
pub(crate) fn uses_krylov(size: usize, ports: &Ports) -> bool {
    let settings = KrylovSettings::default();
    let many = if ports.has_forces() { settings.unknowns_with_forces } else { settings.unknowns };
    let many = size >= many && ports.count() >= KRYLOV_AXES;
    size > FORMED_UNKNOWNS || many || (size > settings.long_series_unknowns && ports.has_forces())
}

/// Residual flexibility of the modes above a bound, from a discarded preconditioner.
type KeptResidualFlexibility = (f64, Arc<Vec<f64>>);

/// GMRES and the preconditioners that it keeps.
#[derive(Debug, Clone, Default)]
pub(crate) struct NewtonKrylov {
    gmres: Gmres,
    /// Preconditioner for receptances as matrices, with the derivatives of this
    /// motion or a nearby one.
    harmonics: Option<KeptHarmonics>,
    modes: Option<ModalPreconditioner>,
    flexibility: Option<KeptResidualFlexibility>,
    /// Forces of a product, and the motions that they cause.
    force: Vec<Complex64>,
    moved: Vec<Complex64>,
    /// Forces of one port, real and imaginary parts.
    parts: Vec<f64>,
}

/// A kept preconditioner of the harmonics, and its use.
#[derive(Debug, Clone)]
struct KeptHarmonics {
    preconditioner: HarmonicPreconditioner,
    /// Products of the step for which it was made, and the total excess of later steps over it.
    products: usize,
    excess: usize,
}

enum Preconditioner<'a> {
    Harmonics(&'a HarmonicPreconditioner),
    Modes(&'a ModalPreconditioner),
}

impl Preconditioner<'_> {
    /// Replaces a residual in units by a step in units.
    fn apply(&self, linear: &LinearizedEquations, v: &mut [f64]) {
        match self {
            Preconditioner::Harmonics(harmonics) => harmonics.apply(linear, v),
            Preconditioner::Modes(modes) => modes.apply(linear, v),
        }
    }
}

/// The state in which a Newton step begins.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepStart {
    /// The length of motions, m, see `Discretization::motion_scale`.
    pub length: f64,
    /// The size of the residual.
    pub residual: f64,
    /// True if derivatives, or all of the equations, use the coarse sampling,
    /// see `Discretization::complete_derivatives`.
    pub coarse: bool,
    /// True if the derivatives are those of the last step, whose preconditioner then fits.
    pub same_derivatives: bool,
}

impl NewtonKrylov {
    /// Returns the memory of the kept preconditioner, bytes.
    #[cfg(test)]
    pub(crate) fn bytes(&self) -> usize {
        self.harmonics.as_ref().map_or(0, |kept| kept.preconditioner.bytes())
    }

    /// Computes the Newton step. `step` contains the residual in units on
    /// entry, and the step on return. Returns whether it was found, and the
    /// number of products. If it was not found, `step` is the residual again.
    pub(crate) fn step(
        &mut self,
        linear: &LinearizedEquations<'_>,
        receptance: &mut Receptance,
        step: &mut [f64],
        near: StepStart,
    ) -> (bool, usize) {
        let settings = KrylovSettings::default();
        let coarsest =
            if matches!(receptance, Receptance::Modal(_)) { settings.coarsest_with_modes } else { settings.coarsest };
        let (residual, finest) =
            (near.residual, if near.coarse { settings.finest_with_coarse_derivatives } else { 0.0 });
        let wanted = (settings.forcing_term * residual)
            .min(coarsest)
            .max(settings.forcing_term * RESIDUAL_TOLERANCE / residual.max(RESIDUAL_TOLERANCE))
            .max(finest);
        let limits = GmresLimits { tolerance: wanted, restart: settings.vectors, products: settings.products };
        let right = step.to_vec();
        let (mut fresh, mut products) = (false, 0);
        let NewtonKrylov { gmres, harmonics, modes, flexibility, force, moved, parts } = self;
        // with unknown forces, the samples that slip couple the lowest harmonics
        harmonics.take_if(|_| !near.same_derivatives && linear.ports.has_forces());
        let found = loop {
            let Some(preconditioner) =
                linear.preconditioner(receptance, (&mut *harmonics, &mut *modes, &mut *flexibility), &mut fresh)
            else {
                break false;
            };
            let most = if fresh {
                limits
            } else {
                GmresLimits { products: settings.kept_products, restart: settings.kept_products, ..limits }
            };
            let outcome = gmres.solve(
                step,
                most,
                |v, out| linear.multiply(receptance, (&mut *force, &mut *moved, &mut *parts), v, out),
                |v| preconditioner.apply(linear, v),
            );
            products += outcome.products;
            if let Some(known) = harmonics.as_mut().filter(|_| fresh) {
                known.products = outcome.products;
            }
            harmonics.take_if(|known| {
                known.excess += outcome.products.saturating_sub(known.products);
                known.excess > settings.excess_products
            });
            if fresh || outcome.solved {
                break outcome.solved || outcome.residual <= settings.useful;
            }
            // the stiffness of another motion
            *harmonics = None;
            *flexibility = modes.take().map(|modes| (modes.bound, modes.residual_flexibility));
            step.copy_from_slice(&right);
        };
        if !found {
            step.copy_from_slice(&right);
        }
        (found && step.iter().all(|d| d.is_finite()), products)
    }
}

impl LinearizedEquations<'_> {
    /// Multiplies the Jacobian by a step, both in units.
    fn multiply(
        &self,
        receptance: &mut Receptance,
        (force, moved, parts): (&mut Vec<Complex64>, &mut Vec<Complex64>, &mut Vec<f64>),
        v: &[f64],
        out: &mut [f64],
    ) {
        let nh = self.harmonics.len();
        let pair = 2 * nh;
        force.resize(v.len() / 2, ZERO);
        moved.resize(v.len() / 2, ZERO);
        // f_y
        for (p, port) in self.ports.iter().enumerate() {
            let wide = pair * port.axes;
            let unit = port.unit(self.length);
            let v = &v[port.first_axis * pair..][..wide];
            let force = &mut force[port.first_axis * nh..][..wide / 2];
            if port.is_force() {
                force.iter_mut().zip(v.chunks_exact(2)).for_each(|(f, v)| *f = Complex64::new(v[0], v[1]) * unit);
                continue;
            }
            parts.resize(wide, 0.0);
            // the tangent is row-major, so that v multiplies its transpose from the left
            multiply_blocked(
                v,
                self.tangent(p, port),
                parts,
                ProductShape { rows: 1, inner: wide, columns: wide },
                Transpose::No,
            );
            force.iter_mut().zip(parts.chunks_exact(2)).for_each(|(f, z)| *f = Complex64::new(z[0], z[1]) * unit);
        }
        receptance.apply(force, moved);
        for (p, port) in self.ports.iter().enumerate() {
            let wide = pair * port.axes;
            let range = port.first_axis * pair..port.first_axis * pair + wide;
            let unit = port.unit(self.length);
            let (v, out, units) = (&v[range.clone()], &mut out[range.clone()], &self.units[range]);
            let moved = &moved[port.first_axis * nh..][..wide / 2];
            if !port.is_force() {
                for (i, out) in out.iter_mut().enumerate() {
                    let u = moved[i / 2];
                    *out = (unit * v[i] + if i % 2 == 0 { u.re } else { u.im }) / units[i];
                }
                continue;
            }
            // λ minus T times the change of λ + ε u' + κ ū, with u = -R f
            let contact = self.contacts[p];
            let changed: Vec<f64> = moved
                .iter()
                .enumerate()
                .flat_map(|(i, u)| {
                    let rate = contact.motion_derivative(self.harmonics[i % nh], self.omega);
                    let z = Complex64::new(v[2 * i], v[2 * i + 1]) * unit - rate * u;
                    [z.re, z.im]
                })
                .collect();
            for (i, (out, row)) in out.iter_mut().zip(self.tangent(p, port).chunks_exact(wide)).enumerate() {
                let kept = 1.0 + self.homotopy.diagonal_term(self.harmonics[i % pair / 2]);
                *out = (kept * unit * v[i] - dot(row, &changed)) / units[i];
            }
        }
    }

    /// Returns a kept preconditioner, or a new one. `None` if it is singular.
    /// `fresh` becomes true if it belongs to this motion.
    fn preconditioner<'b>(
        &self,
        receptance: &Receptance,
        (harmonics, kept, above): (
            &'b mut Option<KeptHarmonics>,
            &'b mut Option<ModalPreconditioner>,
            &mut Option<KeptResidualFlexibility>,
        ),
        fresh: &mut bool,
    ) -> Option<Preconditioner<'b>> {
        match receptance {
            Receptance::Formed(formed) => {
                *fresh = harmonics.is_none();
                if harmonics.is_none() {
                    let preconditioner = HarmonicPreconditioner::new(self, &formed.matrices)?;
                    *harmonics = Some(KeptHarmonics { preconditioner, products: 0, excess: 0 });
                }
                harmonics.as_ref().map(|kept| Preconditioner::Harmonics(&kept.preconditioner))
            }
            Receptance::Modal(modal) => {
                let (bound, usable) = (ModalPreconditioner::bound(modal), kept.take());
                let usable = usable.filter(|split| split.bound == bound);
                *fresh = usable.is_none();
                let mut split = match usable {
                    Some(split) => split,
                    None => ModalPreconditioner::new(
                        modal,
                        (bound, above.take().filter(|(of, _)| *of == bound).map(|(_, above)| above)),
                        |p, port, a, b| {
                            let tangent = self.tangent(p, port);
                            let (first, count) = (usize::from(modal.closed.is_some()), self.harmonics.len());
                            let means = (first..count).map(|k| self.mean(tangent, port.axes, a, b, k).re);
                            means.sum::<f64>() / (count - first).max(1) as f64
                        },
                        self.ports,
                    )?,
                };
                split.set_frequency(modal)?;
                Some(Preconditioner::Modes(kept.insert(split)))
            }
        }
    }
}

/// Returns the multiplications in a product with the Jacobian: of the structure
/// over the axes, and of the laws over the harmonics.
pub(crate) fn product_work(ports: &Ports, harmonics: usize) -> f64 {
    let settings = KrylovSettings::default();
    let of_law = |port: &Port| {
        (2 * harmonics * port.axes).pow(2) as f64
            * if port.is_force() && harmonics > settings.cached_harmonics { settings.uncached_cost } else { 1.0 }
    };
    4.0 * harmonics as f64 * (ports.count() as f64).powi(2) + ports.iter().map(of_law).sum::<f64>()
}

/// Returns the multiplications in a step by GMRES, with the lowest harmonics of
/// unknown forces factored together.
pub(crate) fn krylov_step_work(ports: &Ports, harmonics: usize) -> f64 {
    let settings = KrylovSettings::default();
    let lowest = HarmonicPreconditionerSettings::default().lowest_unknowns;
    let together = if ports.has_forces() { lowest.min(2 * harmonics * ports.count()) } else { 0 };
    settings.vectors as f64 * product_work(ports, harmonics) + (together as f64).powi(3) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Dahl, Jenkins, Jenkins2d, SharedLaw};
    use crate::method::harmonic_balance::budget::WorkShare;
    use crate::method::harmonic_balance::dynamics::linear_dynamics::LinearDynamics;
    use crate::method::harmonic_balance::dynamics::receptance::ModalReceptance;
    use crate::method::harmonic_balance::dynamics::uncoupled_modes::UncoupledDynamics;
    use crate::method::harmonic_balance::equations::homotopy::SearchContext;
    use crate::method::harmonic_balance::equations::{Discretization, HarmonicSolution};
    use crate::method::harmonic_balance::settings::WorkSettings;
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use nalgebra::DMatrix;

    /// Returns a pseudo-random value between -1 and 1.
    fn noise(i: usize) -> f64 {
        ((i * 7919 + 13) as f64).sin()
    }

    /// A structure that couples all coordinates, with damping proportional to
    /// stiffness, on contacts with the ground.
    fn system(joints: &[(SharedLaw, usize)]) -> System {
        let n = joints.iter().map(|joint| joint.1).sum();
        let spread = DMatrix::from_fn(n, n, |i, k| noise(i * n + k) / (n as f64).sqrt());
        let stiffness = &spread * spread.transpose() * 2.0 + DMatrix::identity(n, n);
        let mass = DMatrix::from_fn(n, n, |i, k| if i == k { 1.0 + 0.2 * noise(i) } else { 0.0 });
        let names = (0..n).map(|i| format!("{i}")).collect();
        let structure = Structure::new(names, mass, &stiffness * 0.04, stiffness).unwrap();
        let mut builder = System::builder(structure);
        let mut first = 0;
        for (number, (law, directions)) in joints.iter().enumerate() {
            let axes = (first..first + directions).map(|i| Axis::new(vec![(i, 1.0)])).collect();
            builder = builder.joint(format!("{number}"), law.clone(), axes);
            first += directions;
        }
        for i in 0..n {
            builder = builder.force(i, 1, Complex64::new(noise(3 * i + 1), noise(3 * i + 2)));
        }
        builder.build().unwrap()
    }

    #[derive(Debug, Clone, Copy, PartialEq)]
    enum SolverForm {
        Eliminated,
        Formed,
        Modal,
        /// Matrices with a coarse sampling first.
        Sketched,
    }

    /// Returns the solution, the number of products, and the number of steps of laws with memory.
    fn solve(system: &System, omega: f64, harmonics: &[usize], form: SolverForm) -> (HarmonicSolution, usize, usize) {
        let ports = Ports::new(system).unwrap();
        let dynamics = LinearDynamics::new(system, &ports);
        let mut discretization = Discretization::new(harmonics.to_vec(), 1024, &ports, None);
        discretization.newton_krylov = (form != SolverForm::Eliminated).then(NewtonKrylov::default);
        if form == SolverForm::Sketched {
            discretization.create_coarse_sampling();
        }
        discretization.set_frequency(system, &ports, &dynamics, omega).unwrap();
        if form == SolverForm::Modal {
            let directions: Vec<_> = (0..ports.count()).map(|q| ports.axis(system, q).rows().to_vec()).collect();
            let structure = Arc::new(UncoupledDynamics::new(system.structure(), &directions).unwrap());
            let series = vec![0.0; ports.count()];
            discretization.linear.receptance =
                Receptance::Modal(ModalReceptance::new((&structure, None), (harmonics, omega), &series).unwrap());
        }
        let start = discretization.initial_guess(system, &ports, None, omega);
        let found = discretization.solve(&ports, omega, start);
        let found = found.unwrap_or_else(|error| panic!("{form:?} at {omega}: {error:?}"));
        (found, discretization.work.products, discretization.aft.law_steps)
    }

    fn agree(system: &System, harmonics: &[usize], forms: &[SolverForm]) {
        for omega in [0.6, 1.7] {
            let (expected, ..) = solve(system, omega, harmonics, SolverForm::Eliminated);
            let size = expected.c.iter().map(|c| c.norm()).fold(0.0, f64::max);
            for form in forms {
                let (found, products, _) = solve(system, omega, harmonics, *form);
                assert!(products > 0 && products < 60 * found.iterations, "{products} in {}", found.iterations);
                for (a, b) in found.c.iter().zip(&expected.c) {
                    assert!((a - b).norm() < 1e-8 * size, "{omega}: {a} {b}");
                }
            }
        }
    }

    /// Elimination, GMRES with receptances and GMRES with modes find the same motion.
    #[test]
    fn gmres_finds_the_motion_of_elimination() {
        let contact = |i: usize| -> (SharedLaw, usize) {
            let stiffness = 1.5 + 0.5 * noise(i);
            match i % 2 {
                0 => (Arc::new(Jenkins2d { stiffness, limit: 0.4 }), 2),
                _ => (Arc::new(Jenkins { stiffness, limit: 0.3 }), 1),
            }
        };
        let contacts: Vec<_> = (0..14).map(contact).collect();
        agree(&system(&contacts), &[0, 1, 2, 3], &[SolverForm::Formed, SolverForm::Modal]);
    }

    /// Contacts that stick, although the motion without them would slip: from rest one step finds
    /// the motion, and a second one its last digits.
    #[test]
    fn contacts_that_stick_are_found_from_rest() {
        let contacts: Vec<(SharedLaw, usize)> =
            (0..14).map(|_| (Arc::new(Jenkins2d { stiffness: 100.0, limit: 3.0 }) as SharedLaw, 2)).collect();
        let system = system(&contacts);
        let (ports, harmonics, omega) = (Ports::new(&system).unwrap(), vec![0, 1, 2, 3], 0.6);
        let dynamics = LinearDynamics::new(&system, &ports);
        let mut discretization = Discretization::new(harmonics, 1024, &ports, None);
        discretization.set_frequency(&system, &ports, &dynamics, omega).unwrap();
        let starts = [discretization.initial_guess(&system, &ports, None, omega), discretization.frictionless_motion()];
        let [rest, frictionless] = starts.map(|start| discretization.solve(&ports, omega, start).unwrap());
        assert!(rest.force.iter().all(|f| f.norm() < 2.0), "all contacts stick");
        assert!(rest.iterations <= 2 && frictionless.iterations > 2, "{} {}", rest.iterations, frictionless.iterations);
    }

    /// With a coarse sampling first, the search finds the motion of all
    /// samples, in fewer steps of the laws.
    #[test]
    fn coarse_sampling_finds_the_motion_of_all_samples() {
        let contact = |i: usize| -> (SharedLaw, usize) {
            (Arc::new(Jenkins2d { stiffness: 1.5 + 0.5 * noise(i), limit: 0.2 + 0.1 * noise(5 * i) }), 2)
        };
        let system = system(&(0..12).map(contact).collect::<Vec<_>>());
        for omega in [0.6, 1.1, 1.7] {
            let (expected, _, all) = solve(&system, omega, &[0, 1, 2, 3], SolverForm::Formed);
            let (found, _, few) = solve(&system, omega, &[0, 1, 2, 3], SolverForm::Sketched);
            let size = expected.c.iter().map(|c| c.norm()).fold(0.0, f64::max);
            let apart = found.c.iter().zip(&expected.c).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(apart < 1e-8 * size, "{omega}: {apart:.1e} of {size:.1e}");
            assert!(few < all, "{omega}: {few} steps, {all} without");
        }
    }

    /// Products are the work of a search; shortened steps are not. The next
    /// point has its full budget.
    #[test]
    fn products_count_as_work() {
        let contacts: Vec<(SharedLaw, usize)> =
            (0..201).map(|_| (Arc::new(Jenkins2d { stiffness: 2.0, limit: 0.3 }) as SharedLaw, 2)).collect();
        let system = system(&contacts);
        let ports = Ports::new(&system).unwrap();
        let mut discretization = Discretization::new(vec![1], 64, &ports, None);
        discretization.begin_search(&ports);
        discretization.work.evaluations = 10_000;
        assert!(discretization.newton_krylov.is_some() && !discretization.is_budget_used(&ports));
        discretization.work.products = 1_000_000;
        assert!(discretization.is_budget_used(&ports));
        discretization.begin_point();
        assert!(!discretization.is_budget_used(&ports));
    }

    /// Work of earlier searches of a point, here or at other discretizations, reduces
    /// the budget of the next search.
    #[test]
    fn searches_of_a_point_share_its_budget() {
        let joints: Vec<_> = (0..3).map(|_| (Arc::new(Coulomb { limit: 0.3 }) as SharedLaw, 1)).collect();
        let ports = Ports::new(&system(&joints)).unwrap();
        let mut discretization = Discretization::new(vec![1, 3], 64, &ports, None);
        discretization.aft.law_steps = usize::MAX / 2;
        assert!(discretization.is_budget_used(&ports));
        discretization.begin_search(&ports);
        assert!(
            discretization.work.before.exceeds(WorkSettings::default().point) && discretization.is_budget_used(&ports),
            "the point has nothing left"
        );
        let share = |share: f64| WorkShare {
            multiplications: share * WorkSettings::default().point.multiplications,
            time_steps: share * WorkSettings::default().point.time_steps,
        };
        (discretization.work.before, discretization.work.elsewhere) = (share(0.6), share(0.3));
        assert!(!discretization.is_budget_used(&ports));
        discretization.work.elsewhere = share(0.5);
        assert!(discretization.is_budget_used(&ports));
        discretization.begin_point();
        assert!(!discretization.is_budget_used(&ports));
    }

    /// GMRES also solves for unknown forces, of rigid friction together with elastic friction.
    #[test]
    fn gmres_solves_for_unknown_forces() {
        let laws: [SharedLaw; 3] = [
            Arc::new(Coulomb { limit: 0.3 }),
            Arc::new(Jenkins { stiffness: 2.0, limit: 0.2 }),
            Arc::new(Dahl { stiffness: 1.5, limit: 0.3 }),
        ];
        let joints: Vec<_> = (0..18).map(|i| (laws[i % 3].clone(), 1)).collect();
        agree(&system(&joints), &[1, 3, 5], &[SolverForm::Formed]);
    }

    /// A few joints with rigid friction and long series: GMRES converges with
    /// the lowest harmonics factored together.
    #[test]
    fn factored_lowest_harmonics_precondition_long_series() {
        let settings = HarmonicPreconditionerSettings::default();
        let laws: [SharedLaw; 2] = [Arc::new(Coulomb { limit: 0.3 }), Arc::new(Jenkins { stiffness: 2.0, limit: 0.2 })];
        let joints: Vec<_> = (0..12).map(|i| (laws[usize::from(i % 3 == 2)].clone(), 1)).collect();
        let harmonics: Vec<usize> = (1..128).step_by(2).collect();
        assert!(settings.lowest_unknowns < 24 * harmonics.len(), "some are left to their means");
        agree(&system(&joints), &harmonics, &[SolverForm::Formed]);
    }

    /// With few joints and long series, products with the laws dominate the
    /// work, and they end a search.
    #[test]
    fn products_with_laws_count_as_work() {
        let joints: Vec<_> = (0..10).map(|_| (Arc::new(Coulomb { limit: 0.3 }) as SharedLaw, 1)).collect();
        let system = system(&joints);
        let ports = Ports::new(&system).unwrap();
        let mut discretization = Discretization::new((1..512).step_by(2).collect(), 8192, &ports, None);
        discretization.begin_search(&ports);
        discretization.work.products = 1_000;
        assert!(discretization.newton_krylov.is_some() && !discretization.is_budget_used(&ports));
        discretization.work.products = 2_000;
        assert!(discretization.is_budget_used(&ports));
    }

    /// The Jacobian is formed on request, also if modes would replace the receptances.
    #[test]
    fn the_matrix_is_formed_where_it_is_needed() {
        let contacts: Vec<(SharedLaw, usize)> =
            (0..201).map(|_| (Arc::new(Jenkins { stiffness: 2.0, limit: 0.3 }) as SharedLaw, 1)).collect();
        let system = system(&contacts);
        let ports = Ports::new(&system).unwrap();
        let dynamics = LinearDynamics::new(&system, &ports);
        assert!(dynamics.modes_for(&ports).is_some());
        for needed in [false, true] {
            let discretization = Discretization::new(vec![1], 64, &ports, None);
            let mut discretization = if needed { discretization.with_matrix() } else { discretization };
            discretization.set_frequency(&system, &ports, &dynamics, 0.7).unwrap();
            let mut motion = discretization.initial_guess(&system, &ports, None, 0.7);
            discretization.evaluate(
                SearchContext::given(&ports, 0.7),
                &mut motion,
                1.0,
                crate::method::harmonic_balance::equations::DerivativeScope::All,
            );
            assert_eq!(discretization.assemble(SearchContext::given(&ports, 0.7), 1.0), needed);
        }
    }
}
