//! Linear dynamics of the structure: displacements under harmonic forces along the joints and on
//! all places.
//!
//! The form ([`HarmonicDynamics`]) is chosen once. Small structures are a sum over their modes,
//! large ones a sum over uncoupled modes if the damping allows, and the dynamic stiffness of others
//! is factored at every frequency. In addition, the mean position of bodies that only contacts
//! support is that of the structure with closed contacts.
//!
//! For a ring in a travelling wave, only the joints of the first sector have ports. Harmonic h
//! moves as the wave of its nodal diameter, whose matrices are those of one sector.
//! Displacements and forces are still those of the whole ring.

use super::closed_contacts;
use super::factored::FactoredDynamics;
use super::harmonic_dynamics::{Directions, HarmonicDynamics};
use super::modal_sum::ComplexModes;
use super::travelling_wave::TravellingWaves;
use super::uncoupled_modes::{UncoupledDynamics, UndampedResonance};
use crate::method::harmonic_balance::aft::{KRYLOV_AXES, Ports};
use crate::method::harmonic_balance::equations::regularization::REGULARIZING_FREQUENCY;
use crate::model::System;
use crate::structure::Structure;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::sync::Arc;
use stickslip_numerics::dense::DenseLu;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Limits of the linear dynamics.
#[derive(Debug, Clone, Copy)]
struct LinearDynamicsSettings {
    /// Number of degrees of freedom beyond which modes of full matrices are not computed: at 200
    /// they take a second, with the third power.
    modal_dofs: usize,
    /// Number of axes from which receptances of a structure in modes are not formed: products with
    /// either take equally long.
    modal_axes: usize,
    /// Harmonics above this are ignored.
    highest_harmonic: f64,
}

impl Default for LinearDynamicsSettings {
    fn default() -> Self {
        LinearDynamicsSettings { modal_dofs: 200, modal_axes: 150, highest_harmonic: 1e6 }
    }
}

/// Form of the dynamics.
#[derive(Debug, Clone)]
enum Form {
    /// Travelling waves of a tuned ring.
    Waves(TravellingWaves),
    /// Modes of a large structure, or of one in modes with many axes, whose damping does not
    /// couple them.
    Uncoupled(Arc<UncoupledDynamics>),
    /// Modes of a small structure.
    Modes(Box<ComplexModes>),
    /// Factors of any other structure.
    Factored(FactoredDynamics),
}

impl Form {
    fn new(system: &System, ports: &Ports, directions: &Directions) -> Self {
        let structure = system.structure();
        if let Some(waves) = ports.wave().and_then(|wave| TravellingWaves::new(structure, wave, directions)) {
            return Form::Waves(waves);
        }
        let settings = LinearDynamicsSettings::default();
        let is_large = structure.is_sparse() || structure.dofs() > settings.modal_dofs;
        // in a reduced model the coordinates are modes, and receptances are computed in blocks
        let is_modal = structure.diagonals().is_some();
        if (is_large || (directions.len() >= KRYLOV_AXES && is_modal))
            && let Some(uncoupled) = UncoupledDynamics::new(structure, directions)
        {
            return Form::Uncoupled(Arc::new(uncoupled));
        }
        let modes = if is_large { None } else { ComplexModes::new(system, directions) };
        modes.map_or_else(
            || Form::Factored(FactoredDynamics::new(structure, directions)),
            |modes| Form::Modes(Box::new(modes)),
        )
    }

    fn dynamics(&self) -> &dyn HarmonicDynamics {
        match self {
            Form::Waves(waves) => waves,
            Form::Uncoupled(uncoupled) => &**uncoupled,
            Form::Modes(modes) => &**modes,
            Form::Factored(factored) => factored,
        }
    }
}

/// Dynamics of the structure without its joints.
#[derive(Debug, Clone)]
pub(crate) struct LinearDynamics {
    n: usize,
    form: Form,
    structure: Structure,
    /// Directions of the axes.
    directions: Directions,
    /// Stiffness of closed contacts along the axes, N/m.
    springs: Vec<f64>,
    /// The structure with these springs, if they alone hold some motion of it.
    closed: OnceCell<Option<ClosedContacts>>,
    /// Masses that nothing supports, see [`LinearDynamics::unsupported_masses`].
    unsupported: OnceCell<Vec<f64>>,
}

/// The structure at rest with its contacts closed, see [`closed_contacts`].
#[derive(Debug, Clone)]
pub(crate) struct ClosedContacts {
    /// Stiffness of the contacts along the axes, N/m.
    pub springs: Vec<f64>,
    form: ClosedForm,
}

#[derive(Debug, Clone)]
enum ClosedForm {
    Rows(Box<Form>),
    Modes(closed_contacts::ClosedModes),
}

impl ClosedContacts {
    /// Returns the factored stiffness between modes, if the structure is in modes.
    pub fn modal_factor(&self, omega: f64) -> Option<Result<Arc<DenseLu<f64>>, UndampedResonance>> {
        match &self.form {
            ClosedForm::Rows(_) => None,
            ClosedForm::Modes(modes) => Some(modes.factor(omega)),
        }
    }

    fn respond(&self, omega: f64, force: &DVector<Complex64>) -> Result<DVector<Complex64>, UndampedResonance> {
        match &self.form {
            ClosedForm::Rows(form) => form.dynamics().respond(0, omega, force),
            ClosedForm::Modes(modes) => modes.respond(omega, force),
        }
    }

    fn receptance(&self, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        match &self.form {
            ClosedForm::Rows(form) => form.dynamics().receptance(0, omega),
            ClosedForm::Modes(modes) => modes.receptance(omega),
        }
    }
}

impl LinearDynamics {
    pub fn new(system: &System, ports: &Ports) -> Self {
        let directions: Directions = (0..ports.count())
            .map(|q| {
                let mut rows = BTreeMap::new();
                ports.axis(system, q).rows().iter().for_each(|(i, w)| *rows.entry(*i).or_insert(0.0) += w);
                rows.into_iter().collect()
            })
            .collect();
        LinearDynamics {
            n: system.dofs(),
            form: Form::new(system, ports, &directions),
            structure: system.structure().clone(),
            springs: closed_contacts::closed_stiffness(ports),
            closed: OnceCell::new(),
            unsupported: OnceCell::new(),
            directions,
        }
    }

    /// Returns the structure at rest with its contacts closed, if these alone hold some motion
    /// of it. Decided once, at the first frequency.
    pub fn closed(&self, omega: f64) -> Option<&ClosedContacts> {
        let own = |omega: f64| self.form.dynamics().static_receptances(omega);
        let find = || {
            let largest = self.structure.largest()[2];
            if closed_contacts::need_contact_support(&self.springs, own, omega, largest) {
                self.with_closed_contacts()
            } else {
                None
            }
        };
        self.closed.get_or_init(find).as_ref()
    }

    /// Returns per axis the mass (kg) that moves with it along a direction that neither springs
    /// nor closed contacts support, and zero for a supported axis. Empty if the structure is
    /// singular at rest. Decided once, at the first frequency.
    pub fn unsupported_masses(&self, omega: f64) -> &[f64] {
        let own = |omega: f64| match self.closed(omega) {
            Some(closed) => closed.receptance(omega).map(|all| all.diagonal().iter().map(|r| r.re).collect()),
            None => self.form.dynamics().static_receptances(omega),
        };
        let find = || {
            let (Ok(once), Ok(stiffer)) = (own(omega), own(2.0 * omega)) else { return Vec::new() };
            let free = closed_contacts::unsupported(&once, &stiffer, self.structure.largest()[2]);
            let mass = |receptance: f64| 1.0 / (receptance * (REGULARIZING_FREQUENCY * omega).powi(2));
            once.iter().zip(free).map(|(r, free)| if free { mass(*r) } else { 0.0 }).collect()
        };
        self.unsupported.get_or_init(find)
    }

    fn with_closed_contacts(&self) -> Option<ClosedContacts> {
        let springs = self.springs.clone();
        if let Form::Uncoupled(uncoupled) = &self.form {
            let modes = closed_contacts::ClosedModes::new(&springs, uncoupled);
            return Some(ClosedContacts { springs, form: ClosedForm::Modes(modes) });
        }
        let form = match &self.form {
            Form::Waves(waves) => Form::Waves(waves.with_springs(&springs)?),
            _ => {
                let all: Vec<_> = self.directions.iter().cloned().zip(springs.iter().copied()).collect();
                Form::Factored(FactoredDynamics::new(&self.structure.with_springs(&all)?, &self.directions))
            }
        };
        Some(ClosedContacts { springs, form: ClosedForm::Rows(Box::new(form)) })
    }

    /// Returns the number of sectors of a ring and the size of one; (1, 0) for any other
    /// structure.
    fn sectors(&self) -> (usize, usize) {
        match &self.form {
            Form::Waves(waves) => (waves.cyclic.sectors, waves.sector.dofs()),
            _ => (1, 0),
        }
    }

    /// Returns the modes that replace receptances, if these would be large
    /// matrices and all ports need only their products.
    pub fn modes_for(&self, ports: &Ports) -> Option<&Arc<UncoupledDynamics>> {
        match &self.form {
            Form::Uncoupled(uncoupled)
                if ports.count() >= LinearDynamicsSettings::default().modal_axes && !ports.has_forces() =>
            {
                Some(uncoupled)
            }
            _ => None,
        }
    }

    /// Returns the structure with closed contacts if the harmonic is the mean,
    /// which alone is at rest.
    fn closed_at(&self, harmonic: usize, omega: f64) -> Option<&ClosedContacts> {
        if harmonic == 0 { self.closed(omega) } else { None }
    }

    /// Returns the displacements along the axes under unit forces along them, at `s = jhΩ`, q × q,
    /// m/N. The mean has closed contacts if these alone hold the structure, see
    /// [`LinearDynamics::closed`].
    ///
    /// # Errors
    /// An undamped resonance.
    pub fn receptance(&self, harmonic: usize, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        match self.closed_at(harmonic, omega) {
            Some(closed) => closed.receptance(omega),
            None => self.form.dynamics().receptance(harmonic, omega),
        }
    }

    /// Returns the displacement along each axis under a unit force along it alone, m/N, at a
    /// rate on the positive real axis, which is free of resonances.
    ///
    /// # Errors
    /// A structure that is singular at that rate.
    pub fn direct_receptances(&self, rate: f64, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        self.form.dynamics().direct_receptances(rate, omega)
    }

    /// Returns the displacements of all places under the complex forces `force` (length n, N),
    /// m. For the mean, see [`LinearDynamics::receptance`].
    ///
    /// # Errors
    /// An undamped resonance.
    pub fn respond(
        &self,
        harmonic: usize,
        omega: f64,
        force: &DVector<Complex64>,
    ) -> Result<DVector<Complex64>, UndampedResonance> {
        match self.closed_at(harmonic, omega) {
            Some(closed) => closed.respond(omega, force),
            None => self.form.dynamics().respond(harmonic, omega, force),
        }
    }

    /// Returns the displacements of all places under forces along the axes, one for each.
    ///
    /// # Errors
    /// An undamped resonance.
    pub fn respond_along(
        &self,
        harmonic: usize,
        omega: f64,
        along: impl Fn(usize) -> Complex64,
    ) -> Result<DVector<Complex64>, UndampedResonance> {
        // at rest, sum the forces first: the large motions of a free body must
        // not cancel each other
        let known = if harmonic > 0 { self.form.dynamics().known_unit_responses(harmonic, omega) } else { None };
        match known {
            Some(moved) => Ok(&*moved * DVector::from_fn(self.directions.len(), |q, _| along(q))),
            None => self.respond(harmonic, omega, &self.force_on_places(harmonic, along)),
        }
    }

    /// Returns the harmonics next to the resonances above harmonic `top`.
    pub fn resonances_above(&self, top: usize, omega: f64) -> Vec<usize> {
        let settings = LinearDynamicsSettings::default();
        if self.n > settings.modal_dofs {
            return Vec::new();
        }
        let mut found: Vec<usize> = self
            .form
            .dynamics()
            .natural_frequencies()
            .into_iter()
            .map(|frequency| (frequency / omega).floor())
            .filter(|h| *h < settings.highest_harmonic)
            .flat_map(|h| [h as usize, h as usize + 1])
            .filter(|h| *h > top)
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Returns `W f`: the forces on all places from forces along the axes, at a harmonic.
    pub fn force_on_places(&self, harmonic: usize, along: impl Fn(usize) -> Complex64) -> DVector<Complex64> {
        let mut force = DVector::from_element(self.n, ZERO);
        let (sectors, size) = self.sectors();
        for sector in 0..sectors {
            let lead = match &self.form {
                Form::Waves(waves) => Some(waves.cyclic.phase_factor(harmonic, sector)),
                _ => None,
            };
            for (q, rows) in self.directions.iter().enumerate() {
                let f = lead.map_or_else(|| along(q), |lead| along(q) * lead);
                rows.iter().for_each(|&(i, w)| force[(i + sector * size) % self.n] += f * w);
            }
        }
        force
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Jenkins;
    use crate::method::{Method, event_driven::EventDriven, harmonic_balance::HarmonicBalance};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring};
    use std::f64::consts::PI;

    /// Equal masses of a kilogram on equal springs between walls, with a force
    /// on the first and two joints to the ground.
    fn chain(n: usize, stiffness: f64, damping: f64) -> System {
        let name = |i: usize| if i == 0 || i > n { GROUND.to_owned() } else { format!("m{i}") };
        let mut model = Model::default();
        for i in 1..=n {
            model.masses.push(Mass::new(name(i), 1.0));
        }
        for i in 0..=n {
            model.springs.push(Spring { between: [name(i), name(i + 1)], stiffness, damping });
        }
        model.forces.push(Force { on: name(1), amplitude: 1.0, phase: 0.3, harmonic: 1 });
        for i in [3, n - 1] {
            let law = Arc::new(Jenkins { stiffness: 0.5 * stiffness, limit: 0.05 });
            model.joints.push(Joint { name: format!("j{i}"), between: [name(i), GROUND.into()], law });
        }
        model.assemble().unwrap()
    }

    /// A structure that is too large for its modes responds as the sum of these modes: shapes
    /// `sin(π k i/(n + 1))`, frequencies `2 √(k/m) sin(π k/(2 (n + 1)))`.
    #[test]
    fn receptances_without_modes() {
        let (n, stiffness, damping) = (60, 40.0, 0.02);
        let system = chain(n, stiffness, damping);
        assert!(system.structure().is_sparse());
        let ports = Ports::new(&system).unwrap();
        let dynamics = LinearDynamics::new(&system, &ports);
        let walls = (n + 1) as f64;
        for (h, omega) in [(1, 0.7), (3, 0.7), (1, 2.9), (0, 0.7)] {
            let s = Complex64::new(0.0, h as f64 * omega);
            let exact = |i: f64, l: f64| -> Complex64 {
                let one = |k: usize| {
                    let shape = |i: f64| (2.0 / walls).sqrt() * (PI * k as f64 * i / walls).sin();
                    let square = 4.0 * (0.5 * PI * k as f64 / walls).sin().powi(2);
                    shape(i) * shape(l) / (s * s + s * damping * square + stiffness * square)
                };
                (1..=n).map(one).sum()
            };
            let at = [3.0, (n - 1) as f64];
            let receptance = dynamics.receptance(h, omega).unwrap();
            for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let expected = exact(at[a], at[b]);
                assert!((receptance[(a, b)] - expected).norm() < 1e-9 * exact(at[0], at[0]).norm(), "{a} {b}: {h}");
            }
            let mut force = DVector::from_element(n, ZERO);
            force[9] = Complex64::new(0.0, 2.0);
            let x = dynamics.respond(h, omega, &force).unwrap();
            let pull = [Complex64::new(0.0, 2.0), Complex64::new(-1.0, 0.5)];
            let pulled = dynamics.respond_along(h, omega, |q| pull[q]).unwrap();
            for i in [1, 10, n] {
                let expected = exact(i as f64, 10.0) * Complex64::new(0.0, 2.0);
                assert!((x[i - 1] - expected).norm() < 1e-9 * exact(10.0, 10.0).norm());
                let expected = exact(i as f64, at[0]) * pull[0] + exact(i as f64, at[1]) * pull[1];
                assert!((pulled[i - 1] - expected).norm() < 1e-9 * exact(at[0], at[0]).norm());
            }
            assert!(dynamics.form.dynamics().known_unit_responses(h, omega).is_some());
        }
    }

    /// An undamped resonance is reported as such in every form. Equal
    /// oscillators are driven at their natural frequency, uncoupled and
    /// coupled. With coupling it is the frequency of a rigid motion on springs.
    #[test]
    fn an_undamped_resonance_is_reported() {
        for (n, coupling) in [(60, 0.0), (60, 3.0), (230, 0.0)] {
            let name = |i: usize| format!("m{i}");
            let mut model = Model::default();
            for i in 0..n {
                model.masses.push(Mass::new(name(i), 1.0));
                model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness: 4.0, damping: 0.0 });
                if i > 0 && coupling > 0.0 {
                    model.springs.push(Spring { between: [name(i - 1), name(i)], stiffness: coupling, damping: 0.0 });
                }
            }
            model.forces.push(Force { on: name(0), amplitude: 1.0, phase: 0.3, harmonic: 1 });
            let law = Arc::new(Jenkins { stiffness: 0.5, limit: 0.05 });
            model.joints.push(Joint { name: "j".into(), between: [name(3), GROUND.into()], law });
            let system = model.assemble().unwrap();
            let mut solver = HarmonicBalance::default().solver(&system).unwrap();
            let error = solver.orbit(2.0).unwrap_err();
            assert_eq!(error.status(), "resonance", "{n} {coupling}: {error}");
            assert!(error.to_string().contains("0.3183099 Hz"), "{error}");
            assert!(solver.orbit(2.1).is_ok());
        }
    }

    /// The memory of a factor is predicted exactly.
    #[test]
    fn factor_memory_is_predicted() {
        let system = chain(300, 400.0, 0.5);
        let factor = system.structure().dynamic_stiffness(Complex64::new(0.0, 1.03)).unwrap();
        assert_eq!(crate::method::harmonic_balance::factor_bytes(&system), factor.bytes());
    }

    /// Few joints on a large structure: the series agrees with the exact motion.
    #[test]
    fn few_joints_on_a_large_structure() {
        let system = chain(60, 400.0, 0.5);
        let omega = 1.03;
        assert!(super::super::banded::BandedForm::new(&system, &Ports::new(&system).unwrap(), &[1]).is_none());
        let method = HarmonicBalance { harmonics: Some(21), ..HarmonicBalance::default() };
        let series = method.solver(&system).unwrap().orbit(omega).unwrap();
        let exact = EventDriven.solver(&system).unwrap().orbit(omega).unwrap();
        assert!(exact.joints.iter().any(|joint| joint.slip_fraction > 0.1), "{:?}", exact.joints);
        let largest = exact.places.iter().map(|place| place.amplitude()).fold(0.0, f64::max);
        for (a, b) in series.places.iter().zip(&exact.places) {
            assert!((a.amplitude() - b.amplitude()).abs() < 1e-3 * largest, "{} {}", a.amplitude(), b.amplitude());
        }
    }
}
