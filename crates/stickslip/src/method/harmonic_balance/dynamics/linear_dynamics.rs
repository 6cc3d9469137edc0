//! Dynamics of the linear part: displacements of all places under harmonic
//! forces, in closed form for every frequency.
//!
//! With the modes `(λ, φ)` of `M x'' + C x' + K x`, computed once, the response to `Re(F e^{st})`
//! is a sum of `φ (ψᵀF) / (s - λ)`. A frequency costs the number of modes times the square of the
//! number of joints, and no matrix is factored. For sparse structures, and for those so large that
//! their modes would take seconds, the dynamic stiffness is factored at every frequency instead.
//!
//! For a ring in a travelling wave, only the joints of the first sector have ports. Harmonic h
//! moves as the wave of its nodal diameter, whose matrices are those of one sector.
//! Displacements and forces are still those of the whole ring.

use super::closed_contacts;
use super::modal_sum::{ComplexModes, partial_fractions, rigid_body_fraction};
use super::travelling_wave::{FactoredStiffness, TravellingWaves};
use super::uncoupled_modes::{UncoupledDynamics, UndampedResonance};
use crate::method::harmonic_balance::aft::{KRYLOV_AXES, Ports};
use crate::method::harmonic_balance::equations::regularization::regularizing_stiffness;
use crate::model::System;
use crate::structure::{DynamicStiffness, Matrices, Structure};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::sync::Arc;
use stickslip_numerics::dense::DenseLu;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Number of axes up to which a complex matrix fits in the cache of the processor, 260 kB.
pub(crate) const CACHED: usize = 128;
/// Limits of the linear dynamics.
#[derive(Debug, Clone, Copy)]
struct LinearDynamicsSettings {
    /// Share of the largest static receptance below which springs hold a direction. The largest is
    /// that of a soft spring, if one holds a direction alone.
    held_receptance: f64,
    /// Number of degrees of freedom beyond which modes of full matrices are not computed: at 200
    /// they take a second, with the third power.
    modal_dofs: usize,
    /// Number of axes from which receptances of a structure in modes are not formed: products with
    /// either take equally long.
    modal_axes: usize,
    /// Number of right sides that a factor solves at once.
    right_sides: usize,
    /// Harmonics above this are ignored.
    highest_harmonic: f64,
    /// Memory limit of kept factors, bytes. Measured: 1.7 GB for each harmonic of a block of
    /// 60,000 degrees of freedom, 11.5 GB in all with five harmonics and an estimate of their
    /// error. A discarded factor is computed again when needed.
    factor_bytes: usize,
    /// Memory limit of kept motions under unit forces, bytes. Measured: 54 MB for each harmonic of
    /// a blade of 69,930 rows with 16 contacts of three directions, whose factors take 1.3 GB.
    response_bytes: usize,
}

impl Default for LinearDynamicsSettings {
    fn default() -> Self {
        LinearDynamicsSettings {
            held_receptance: 1e-5,
            modal_dofs: 200,
            modal_axes: 150,
            right_sides: 64,
            highest_harmonic: 1e6,
            factor_bytes: 2_000_000_000,
            response_bytes: 1_000_000_000,
        }
    }
}

/// Receptance of the structure without its joints.
#[derive(Debug, Clone)]
pub(crate) struct LinearDynamics {
    n: usize,
    modal: Option<ComplexModes>,
    /// Modes of a large structure whose damping does not couple them.
    uncoupled: Option<Arc<UncoupledDynamics>>,
    /// True if the dynamic stiffness is factored at every frequency.
    factored: bool,
    /// Factors of the dynamic stiffness of a large structure at the last
    /// excitation frequency, by rate.
    factors: RefCell<Vec<FactoredStiffness>>,
    /// Receptances at the last frequency. A longer series requests those of a shorter one again.
    receptances: RefCell<ReceptanceCache>,
    /// Displacements of all places under unit forces along the axes at that frequency, by rate.
    /// For a large structure they take less memory than its factors, and save a second
    /// factorization.
    unit_responses: RefCell<Vec<UnitResponses>>,
    structure: Structure,
    /// Directions of the axes: rows in ascending order, with their weights.
    directions: Vec<Vec<(usize, f64)>>,
    /// Travelling waves of a ring.
    travelling_waves: Option<TravellingWaves>,
    /// Stiffness of closed contacts along the axes, N/m.
    springs: Vec<f64>,
    /// The structure with these springs, if they alone hold some motion of it.
    closed: OnceCell<Option<ClosedContacts>>,
}

/// Motions of all places at a rate (1/s) and an excitation frequency (rad/s): n
/// × q, one column for a unit force along each axis.
#[derive(Debug, Clone)]
struct UnitResponses {
    rate: Complex64,
    omega: f64,
    columns: Arc<DMatrix<Complex64>>,
}

/// Receptances at the harmonics of an excitation frequency, rad/s.
#[derive(Debug, Clone, Default)]
struct ReceptanceCache {
    omega: f64,
    receptances: BTreeMap<usize, DMatrix<Complex64>>,
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
    Rows(Box<LinearDynamics>),
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
            ClosedForm::Rows(dynamics) => dynamics.respond(0, omega, force),
            ClosedForm::Modes(modes) => modes.respond(omega, force),
        }
    }

    fn receptance(&self, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        match &self.form {
            ClosedForm::Rows(dynamics) => dynamics.receptance(0, omega),
            ClosedForm::Modes(modes) => modes.receptance(omega),
        }
    }
}

impl LinearDynamics {
    pub fn new(system: &System, ports: &Ports) -> Self {
        let n = system.dofs();
        let directions = (0..ports.count())
            .map(|q| {
                let mut rows = BTreeMap::new();
                ports.axis(system, q).rows().iter().for_each(|(i, w)| *rows.entry(*i).or_insert(0.0) += w);
                rows.into_iter().collect()
            })
            .collect::<Vec<Vec<(usize, f64)>>>();
        let waves = ports.wave().and_then(|wave| TravellingWaves::new(system.structure(), wave));
        let factored = is_factored(system.structure());
        let alone = waves.is_none();
        LinearDynamics {
            n,
            modal: if factored || !alone { None } else { ComplexModes::new(system, &columns(n, &directions)) },
            uncoupled: if alone && (factored || (directions.len() >= KRYLOV_AXES && is_modal(system.structure()))) {
                UncoupledDynamics::new(system.structure(), &directions).map(Arc::new)
            } else {
                None
            },
            factored,
            factors: RefCell::default(),
            receptances: RefCell::default(),
            unit_responses: RefCell::default(),
            structure: system.structure().clone(),
            springs: closed_contacts::closed_stiffness(ports),
            closed: OnceCell::new(),
            directions,
            travelling_waves: waves,
        }
    }

    /// Returns the structure at rest with its contacts closed, if these alone hold some motion
    /// of it. Decided once, at the first frequency.
    pub fn closed(&self, omega: f64) -> Option<&ClosedContacts> {
        let own = |omega: f64| self.static_receptances(omega);
        let find = || {
            if closed_contacts::need_contact_support(&self.springs, own, omega) {
                self.with_closed_contacts()
            } else {
                None
            }
        };
        self.closed.get_or_init(find).as_ref()
    }

    fn with_closed_contacts(&self) -> Option<ClosedContacts> {
        let springs = self.springs.clone();
        if let Some(uncoupled) = &self.uncoupled {
            let modes = closed_contacts::ClosedModes::new(&springs, uncoupled);
            return Some(ClosedContacts { springs, form: ClosedForm::Modes(modes) });
        }
        let (sectors, size) = self.sectors();
        // in a ring, each direction in every sector
        let around: Vec<(Vec<(usize, f64)>, f64)> = (0..sectors)
            .flat_map(|sector| self.directions.iter().zip(&springs).map(move |(rows, k)| (sector, rows, *k)))
            .map(|(sector, rows, k)| (rows.iter().map(|&(i, w)| ((i + sector * size) % self.n, w)).collect(), k))
            .collect();
        let structure = self.structure.with_springs(&around)?;
        let waves = match &self.travelling_waves {
            Some(waves) => Some(TravellingWaves::new(&structure, waves.cyclic)?),
            None => None,
        };
        let dynamics = LinearDynamics {
            n: self.n,
            modal: None,
            uncoupled: None,
            factored: true,
            factors: RefCell::default(),
            receptances: RefCell::default(),
            unit_responses: RefCell::default(),
            structure,
            directions: self.directions.clone(),
            travelling_waves: waves,
            springs: Vec::new(),
            closed: OnceCell::from(None),
        };
        Some(ClosedContacts { springs, form: ClosedForm::Rows(Box::new(dynamics)) })
    }

    /// Returns the displacement along each axis at rest under a constant unit
    /// force along it alone, m/N.
    fn static_receptances(&self, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        if let Some(uncoupled) = &self.uncoupled {
            let own = uncoupled.diagonal_receptance(&uncoupled.modal_receptances(ZERO, omega)?);
            return Ok(own.iter().map(|r| r.norm()).collect());
        }
        let receptance = match &self.travelling_waves {
            Some(waves) => waves.receptance(0, (ZERO, omega), &self.directions)?,
            None => {
                // not from modes: for damped free motions, their rounding acts as a stiffness
                let mut own = vec![0.0; self.directions.len()];
                self.for_each_unit_response(ZERO, omega, |q, moved| {
                    own[q] = self.directions[q].iter().map(|&(i, w)| moved[i] * w).sum::<Complex64>().norm();
                })?;
                return Ok(own);
            }
        };
        Ok((0..self.directions.len()).map(|q| receptance[(q, q)].norm()).collect())
    }

    /// Returns the number of sectors of a ring and the size of one; (1, 0) for any other
    /// structure.
    fn sectors(&self) -> (usize, usize) {
        self.travelling_waves.as_ref().map_or((1, 0), |waves| (waves.cyclic.sectors, waves.sector.dofs()))
    }

    /// Returns the modes that replace receptances, if these would be large
    /// matrices and all ports need only their products.
    pub fn modes_for(&self, ports: &Ports) -> Option<&Arc<UncoupledDynamics>> {
        let settings = LinearDynamicsSettings::default();
        self.uncoupled.as_ref().filter(|_| ports.count() >= settings.modal_axes && !ports.has_forces())
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
        if self.directions.len() > CACHED {
            return self.compute_receptance(harmonic, omega);
        }
        let mut known = self.receptances.borrow_mut();
        if known.omega != omega {
            *known = ReceptanceCache { omega, receptances: BTreeMap::new() };
        }
        if let Some(receptance) = known.receptances.get(&harmonic) {
            return Ok(receptance.clone());
        }
        let receptance = self.compute_receptance(harmonic, omega)?;
        known.receptances.insert(harmonic, receptance.clone());
        Ok(receptance)
    }

    /// Returns the memory of the kept receptances, bytes.
    #[cfg(test)]
    pub fn bytes(&self) -> usize {
        self.receptances.borrow().receptances.values().map(|matrix| size_of_val(matrix.as_slice())).sum()
    }

    fn compute_receptance(&self, harmonic: usize, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        if let Some(closed) = self.closed_at(harmonic, omega) {
            return closed.receptance(omega);
        }
        let s = Complex64::new(0.0, harmonic as f64 * omega);
        match &self.travelling_waves {
            Some(waves) => waves.receptance(waves.cyclic.diameter(harmonic), (s, omega), &self.directions),
            None => self.receptance_at(s, omega),
        }
    }

    /// Returns the displacement along each axis under a unit force along it alone, m/N, at a
    /// rate on the positive real axis, which is free of resonances.
    ///
    /// # Errors
    /// A structure that is singular at that rate.
    pub fn direct_receptances(&self, rate: f64, omega: f64) -> Result<Vec<f64>, UndampedResonance> {
        match &self.travelling_waves {
            Some(waves) => waves.diagonal_receptance((rate, omega), &self.directions),
            None => {
                let receptance = self.receptance_at(Complex64::new(rate, 0.0), omega)?;
                Ok((0..self.directions.len()).map(|q| receptance[(q, q)].norm()).collect())
            }
        }
    }

    fn receptance_at(&self, s: Complex64, omega: f64) -> Result<DMatrix<Complex64>, UndampedResonance> {
        let q = self.directions.len();
        if let Some(uncoupled) = &self.uncoupled {
            return uncoupled.receptance(s, omega);
        }
        if self.factored {
            let mut receptance = DMatrix::from_element(q, q, ZERO);
            self.for_each_unit_response(s, omega, |b, moved| {
                for (a, rows) in self.directions.iter().enumerate() {
                    receptance[(a, b)] = rows.iter().map(|&(i, w)| moved[i] * w).sum();
                }
            })?;
            return Ok(receptance);
        }
        let Some(modal) = &self.modal else {
            let inverse = self.dynamic(s).try_inverse().ok_or(UndampedResonance)?;
            let direction = columns(self.n, &self.directions).map(|w| Complex64::new(w, 0.0));
            return Ok(direction.transpose() * inverse * direction);
        };
        let mut sum = DMatrix::from_element(q, q, ZERO);
        for (m, &lambda) in modal.lambda.iter().enumerate() {
            let (up, down) = partial_fractions(s, lambda, omega);
            for b in 0..q {
                for a in 0..q {
                    let product = modal.shape_along[(a, m)] * modal.left_along[(m, b)];
                    sum[(a, b)] += (product * up + product.conj() * down) * 0.5;
                }
            }
        }
        let free = rigid_body_fraction(s, omega);
        for r in 0..modal.free_along.nrows() {
            for b in 0..q {
                for a in 0..q {
                    sum[(a, b)] += modal.free_along[(r, a)] * modal.free_along[(r, b)] * free;
                }
            }
        }
        Ok(sum)
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
        if let Some(closed) = self.closed_at(harmonic, omega) {
            return closed.respond(omega, force);
        }
        let s = Complex64::new(0.0, harmonic as f64 * omega);
        if let Some(uncoupled) = &self.uncoupled {
            return uncoupled.respond(s, omega, force);
        }
        if let Some(waves) = &self.travelling_waves {
            return waves.respond(waves.cyclic.diameter(harmonic), (s, omega), force);
        }
        if self.factored {
            let mut x = force.clone();
            self.factor(s, omega)?.solve(x.as_mut_slice());
            return Ok(x);
        }
        let Some(modal) = &self.modal else {
            return self.dynamic(s).lu().solve(force).ok_or(UndampedResonance);
        };
        let mut x = DVector::from_element(self.n, ZERO);
        for (m, &lambda) in modal.lambda.iter().enumerate() {
            let (up, down) = partial_fractions(s, lambda, omega);
            let (mut one, mut two) = (ZERO, ZERO);
            for i in 0..self.n {
                one += modal.left[(m, i)] * force[i];
                two += modal.left[(m, i)].conj() * force[i];
            }
            let (one, two) = (one * up * 0.5, two * down * 0.5);
            for i in 0..self.n {
                x[i] += modal.shape[(i, m)] * one + modal.shape[(i, m)].conj() * two;
            }
        }
        let free = rigid_body_fraction(s, omega);
        for r in 0..modal.free.ncols() {
            let push: Complex64 = (0..self.n).map(|i| force[i] * modal.free[(i, r)]).sum::<Complex64>() * free;
            for i in 0..self.n {
                x[i] += push * modal.free[(i, r)];
            }
        }
        Ok(x)
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
        let s = Complex64::new(0.0, harmonic as f64 * omega);
        // at rest, sum the forces first: the large motions of a free body must
        // not cancel each other
        let known = if harmonic > 0 { self.kept_unit_responses(s, omega) } else { None };
        match known {
            Some(moved) => Ok(&*moved * DVector::from_fn(self.directions.len(), |q, _| along(q))),
            None => self.respond(harmonic, omega, &self.force_on_places(harmonic, along)),
        }
    }

    /// Returns the motions under unit forces, if they are kept.
    fn kept_unit_responses(&self, s: Complex64, omega: f64) -> Option<Arc<DMatrix<Complex64>>> {
        let moved = self.unit_responses.borrow();
        moved.iter().find(|kept| kept.omega == omega && kept.rate == s).map(|kept| kept.columns.clone())
    }

    /// Passes the motion of a large structure under a unit force along each
    /// axis to `take`. Keeps the motions if memory allows.
    fn for_each_unit_response(
        &self,
        s: Complex64,
        omega: f64,
        mut take: impl FnMut(usize, &[Complex64]),
    ) -> Result<(), UndampedResonance> {
        let settings = LinearDynamicsSettings::default();
        let mut hand = |from: usize, columns: &DMatrix<Complex64>| {
            (0..columns.ncols()).for_each(|b| take(from + b, &columns.as_slice()[b * self.n..(b + 1) * self.n]));
        };
        if let Some(columns) = self.kept_unit_responses(s, omega) {
            hand(0, &columns);
            return Ok(());
        }
        let factor = self.factor(s, omega)?;
        let solved = |some: &[Vec<(usize, f64)>]| {
            let mut columns = columns(self.n, some).map(|w| Complex64::new(w, 0.0));
            factor.solve(columns.as_mut_slice());
            columns
        };
        let mut kept = self.unit_responses.borrow_mut();
        kept.retain(|kept| kept.omega == omega);
        let bytes = size_of::<Complex64>() * self.n * self.directions.len();
        if (kept.len() + 1) * bytes <= settings.response_bytes {
            let columns = Arc::new(solved(&self.directions));
            hand(0, &columns);
            kept.push(UnitResponses { rate: s, omega, columns });
        } else {
            // in groups: all at once would fill the memory
            let some = self.directions.chunks(settings.right_sides).enumerate();
            some.for_each(|(number, some)| hand(number * settings.right_sides, &solved(some)));
        }
        Ok(())
    }

    /// Corrects the mean positions `x` (length n) so that they agree with `along` along the
    /// axes. If only laws hold a direction, positions are the small difference of large terms,
    /// and rounding of the forces would shift them.
    ///
    /// # Errors
    /// A structure that is singular at rest.
    pub fn correct_mean(
        &self,
        omega: f64,
        x: &mut DVector<Complex64>,
        along: impl Fn(usize) -> f64,
    ) -> Result<(), UndampedResonance> {
        let settings = LinearDynamicsSettings::default();
        let q = self.directions.len();
        let unheld = rigid_body_fraction(ZERO, omega).re / self.structure.largest()[0];
        if let Some(uncoupled) = &self.uncoupled {
            // at rest no place moves more than the place under the force
            let own = uncoupled.diagonal_receptance(&uncoupled.modal_receptances(ZERO, omega)?);
            if own.iter().all(|r| r.norm() < settings.held_receptance * unheld) {
                return Ok(());
            }
        }
        let off =
            DVector::from_fn(q, |a, _| along(a) - self.directions[a].iter().map(|&(i, w)| w * x[i].re).sum::<f64>());
        let receptance = self.receptance(0, omega)?.map(|r| r.re);
        let largest = receptance.amax();
        if largest == 0.0 || largest < settings.held_receptance * unheld {
            return Ok(()); // springs hold all that moves, or nothing moves
        }
        // only along directions that nothing else holds
        let Ok(inverse) = receptance.pseudo_inverse(settings.held_receptance * largest) else { return Ok(()) };
        let force = (inverse * off).map(|f| Complex64::new(f, 0.0));
        *x += self.respond_along(0, omega, |a| force[a])?;
        Ok(())
    }

    /// Returns the harmonics next to the resonances above harmonic `top`.
    pub fn resonances_above(&self, top: usize, omega: f64) -> Vec<usize> {
        let settings = LinearDynamicsSettings::default();
        let lambda = self.modal.iter().flat_map(|modal| &modal.lambda);
        let mut found: Vec<usize> = lambda
            .map(|lambda| (lambda.im.abs() / omega).floor())
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
            let lead = self.travelling_waves.as_ref().map(|waves| waves.cyclic.phase_factor(harmonic, sector));
            for (q, rows) in self.directions.iter().enumerate() {
                let f = lead.map_or_else(|| along(q), |lead| along(q) * lead);
                rows.iter().for_each(|&(i, w)| force[(i + sector * size) % self.n] += f * w);
            }
        }
        force
    }

    /// Returns the dynamic stiffness of a small structure.
    fn dynamic(&self, s: Complex64) -> DMatrix<Complex64> {
        let Matrices { mass, damping, stiffness } = &**self.structure.full();
        DMatrix::from_fn(self.n, self.n, |i, k| s * s * mass[(i, k)] + s * damping[(i, k)] + stiffness[(i, k)])
    }

    /// Factors the dynamic stiffness of a large structure. Factors of one
    /// excitation frequency are kept, up to the memory limit.
    fn factor(&self, s: Complex64, omega: f64) -> Result<Arc<DynamicStiffness>, UndampedResonance> {
        let settings = LinearDynamicsSettings::default();
        let mut factors = self.factors.borrow_mut();
        factors.retain(|kept| kept.omega == omega);
        if let Some(kept) = factors.iter().find(|kept| kept.rate == s) {
            return kept.factor.clone();
        }
        let factor = self
            .structure
            .shifted_dynamic_stiffness(s, regularizing_stiffness(s, omega))
            .map(Arc::new)
            .map_err(|_| UndampedResonance);
        let bytes =
            |factor: &Result<Arc<DynamicStiffness>, UndampedResonance>| factor.as_ref().map_or(0, |f| f.bytes());
        while !factors.is_empty()
            && factors.iter().map(|kept| bytes(&kept.factor)).sum::<usize>() + bytes(&factor) > settings.factor_bytes
        {
            factors.remove(0);
        }
        factors.push(FactoredStiffness { rate: s, omega, factor: factor.clone() });
        factor
    }
}

/// Tells whether the dynamic stiffness is factored at every frequency.
fn is_factored(structure: &Structure) -> bool {
    let settings = LinearDynamicsSettings::default();
    structure.is_sparse() || structure.dofs() > settings.modal_dofs
}

/// Tells whether the coordinates are real modes, as in a reduced model.
/// Receptances are then computed in blocks.
fn is_modal(structure: &Structure) -> bool {
    structure.diagonals().is_some()
}

/// Returns the directions as columns, n × q.
fn columns(n: usize, directions: &[Vec<(usize, f64)>]) -> DMatrix<f64> {
    let mut columns = DMatrix::zeros(n, directions.len());
    for (q, rows) in directions.iter().enumerate() {
        rows.iter().for_each(|&(i, w)| columns[(i, q)] = w);
    }
    columns
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
            assert!(dynamics.kept_unit_responses(s, omega).is_some());
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
            assert!(error.to_string().contains("2.0000 rad/s"), "{error}");
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
