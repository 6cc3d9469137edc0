//! The equations of harmonic balance.
//!
//! The receptance `R` of the structure between the axes of the ports gives the motion per
//! harmonic: `u = u_lin - R f`. A port `q` has unknowns `y`, forces `f(y)` and a residual
//! `r(y, u)`:
//! - A motion port has its motion as the unknown: `f = f(y)`, `r = y - u`.
//! - A force port has its force as the unknown, `y = λ`: `f = y`,
//!   `r = λ - P J(λ + ε u' + κ ū)`. `J` is the resolvent of the law, and `P` truncates to
//!   the harmonics of the series. `κ` acts on the mean `ū` where such contacts alone support the
//!   structure, see `contact_parameter`. In stick the force is then free to take the value
//!   that the motion requires, and no velocity is multiplied by a penalty stiffness.
//!
//! The Jacobian is one formula for both: `δ_qp r_y - r_u R_qp f_y`. Motion ports have `r_y = 1`,
//! `-r_u = 1`, `f_y = K`; force ports have `r_y = 1 - T`, `-r_u = T (ε d/dt + κ)`, `f_y = 1`.
//!
//! If contacts alone hold a body, `R` of the mean contains the springs of closed contacts, and
//! their force is subtracted from `f`, see `closed_contacts`.
//!
//! `ε` is not a free parameter: it is the impedance of the structure at the contact at the
//! highest harmonic, the resolution of the series (see
//! [`contact_parameter`](super::equations::contact_parameter::contact_parameter)). Another ε
//! changes the solution no more than the missing harmonics do.
//!
//! Source: Nacivet, Pierre, Thouverez, Jezequel (2003), "A dynamic Lagrangian
//! frequency-time method".
//!
//! - `excitation`: the equations at one frequency, and the initial guess
//! - `harmonic_set`: the harmonics in the series of a motion
//! - `homotopy`: parameters between easier equations and the given ones, and the tolerance
//! - `scaling`: units of motions and residuals
//! - `scaled_unknowns`: the equations as a function of unknowns of order one
//! - `coarse_sampling`: fewer samples for derivatives of many contacts
//! - `contact_parameter`: the parameters ε and κ of a rigid contact
//! - `regularization`: terms for equations that the model leaves singular

mod coarse_sampling;
pub(super) mod contact_parameter;
mod excitation;
pub(super) mod harmonic_set;
pub(super) mod homotopy;
pub(super) mod regularization;
mod scaled_unknowns;
mod scaling;

use super::aft::{FrequencyTime, InitialState, Port, Ports, StaticState, tangent_range, tangent_ranges};
use super::budget::WorkCounter;
use super::dynamics::banded::BandedForm;
use super::dynamics::receptance::{Receptance, ReceptanceMatrices};
use super::equations::contact_parameter::ContactParameters;
use super::equations::harmonic_set::velocity_weight;
use super::found_by::FoundBy;
use super::linear_solve::linearization::LinearizedEquations;
use super::linear_solve::newton_krylov::{NewtonKrylov, StepStart, uses_krylov};
use crate::model::CyclicSymmetry;
use crate::orbit::JointSeries;
use homotopy::{Homotopy, SearchContext};
use nalgebra::DVector;
use num_complex::Complex64;
use stickslip_numerics::vector::dot;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Factor of the springs of closed contacts in a law's derivative, if the structure contains them.
pub(super) const CLOSED_CONTACT_SIGN: f64 = -1.0;

/// The discretized equations by one list of harmonics.
///
/// The solver keeps one for every number of harmonics, and prepares it for each frequency.
#[derive(Debug, Clone)]
pub(super) struct Discretization {
    pub aft: FrequencyTime,
    /// The linear part of the equations at the present frequency.
    pub(super) linear: LinearPart,
    /// Banded form of a large system, in place of receptance and Jacobian.
    pub banded: Option<BandedForm>,
    /// GMRES with its preconditioner, in place of the Jacobian, for many joints that the structure
    /// couples.
    pub(super) newton_krylov: Option<NewtonKrylov>,
    /// True if the Jacobian is needed as a matrix, and the receptances with it.
    with_matrix: bool,
    /// Coarse sampling of the period, for derivatives of many contacts: see
    /// [`Discretization::complete_derivatives`].
    pub(super) coarse: Option<FrequencyTime>,
    /// Sampling with twice the samples, created on first use, see
    /// [`Discretization::correct_twice_the_samples`].
    pub(super) twice: Option<FrequencyTime>,
    /// Displacements along the axes in static equilibrium, m; empty if unknown.
    pub equilibrium: Vec<f64>,
    /// Per axis: true if its unknown is a force.
    forces: Vec<bool>,
    /// Numbers of derivatives per port in [`Workspace::tangents`], see [`tangent_ranges`].
    pub(super) blocks: Vec<usize>,
    pub(super) workspace: Workspace,
    pub(super) search: SearchState,
    pub(super) work: WorkCounter,
}

/// The linear part of the equations at one frequency.
#[derive(Debug, Clone)]
pub(super) struct LinearPart {
    /// Receptance of the axes; empty in the banded form.
    pub receptance: Receptance,
    /// Parameters of the force equations, per port.
    pub contacts: Vec<ContactParameters>,
    /// Force that would hold the contacts against the motion without friction, N: the largest
    /// product of an ε and a velocity.
    pub largest_holding_force: f64,
    /// Motion of the axes without friction, [axis][harmonic].
    pub motion: Vec<Complex64>,
    /// Constant load on all places, N; `None` without one.
    pub mean_load: Option<DVector<Complex64>>,
    /// Motion of all places without friction, per harmonic.
    pub free_response: Vec<DVector<Complex64>>,
    /// Mean of the imposed motion along the axes, m.
    pub imposed: Vec<f64>,
    /// Compliances in series with the axes, m/N.
    pub series: Vec<f64>,
    /// Stiffness of closed contacts along the axes (N/m) that the structure contains for the mean;
    /// empty if it is held without them.
    pub closed_stiffness: Vec<f64>,
}

/// Scratch memory of the equations. Its contents are valid within one step of a search.
#[derive(Debug, Clone)]
pub(super) struct Workspace {
    /// Derivatives K or T of all ports in sequence, see [`tangent_ranges`].
    pub tangents: Vec<f64>,
    pub jacobian: Vec<f64>,
    pub residual: Vec<f64>,
    /// Units of the residual.
    pub units: Vec<f64>,
    /// Newton step, in units of the unknowns.
    pub step: Vec<f64>,
    /// The solution before this step, and the best solution of the search.
    pub previous: HarmonicSolution,
    pub best: HarmonicSolution,
    /// Forces on the structure: those of the ports minus those of the springs of closed contacts,
    /// [axis][harmonic], N.
    pub acting: Vec<Complex64>,
    /// Motions along the axes under the forces, [axis][harmonic].
    pub moved: Vec<Complex64>,
    pub image: Vec<Complex64>,
    pub product: Vec<f64>,
}

/// State of the present search.
#[derive(Debug, Clone)]
pub(super) struct SearchState {
    /// Forces to which [`Homotopy::proximal_weight`] draws the force unknowns, [axis][harmonic], N.
    pub anchor: Vec<Complex64>,
    /// Springs of the proximal point method for static equilibrium.
    pub tether: Option<ProximalSprings>,
    /// Per port with memory: the states at t = 0 in the motion evaluated last, if it slips there,
    /// and how they are forgotten.
    pub states: Vec<InitialState>,
    /// True if laws that forget their initial states begin the next motion with these. They reach
    /// the same states as from static equilibrium, in fewer periods.
    pub reuses_states: bool,
    /// True if the search uses the coarse sampling.
    pub uses_coarse: bool,
    /// True if the tangents are those of the present search, without added springs.
    pub linearized: bool,
    /// True if the tangents are those of the initial guess of the next search, by coarse sampling.
    pub keeps_tangents: bool,
}

/// Springs along the axes that tie the mean to an anchor.
#[derive(Debug, Clone)]
pub(super) struct ProximalSprings {
    /// Stiffness relative to the springs of closed contacts.
    pub relative_stiffness: f64,
    /// Displacements at which the springs are relaxed, m.
    pub anchor: Vec<f64>,
}

/// A solution or an initial guess.
#[derive(Debug, Clone, Default)]
pub(super) struct HarmonicSolution {
    /// Harmonics of the motions along the axes, [axis][harmonic], m.
    pub c: Vec<Complex64>,
    /// Harmonics of the forces along them, N.
    pub force: Vec<Complex64>,
    pub residual: f64,
    pub iterations: usize,
    pub found_by: FoundBy,
}

impl HarmonicSolution {
    pub fn zero(length: usize) -> Self {
        HarmonicSolution { c: vec![ZERO; length], force: vec![ZERO; length], ..HarmonicSolution::default() }
    }

    /// Returns the initial guess that an orbit's series is.
    pub fn from_series(series: &JointSeries) -> Self {
        HarmonicSolution { c: series.motions.clone(), force: series.forces.clone(), ..HarmonicSolution::default() }
    }

    /// Converts the solution to the series of an orbit.
    pub fn into_series(self, highest_harmonic: usize) -> JointSeries {
        JointSeries { highest_harmonic, motions: self.c, forces: self.force }
    }

    /// Copies `other` without new memory.
    pub fn copy_from(&mut self, other: &HarmonicSolution) {
        self.c.clone_from(&other.c);
        self.force.clone_from(&other.force);
        (self.residual, self.iterations) = (other.residual, other.iterations);
        self.found_by = other.found_by;
    }
}

/// The ports whose derivatives an evaluation computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DerivativeScope {
    None,
    /// All ports except those whose laws are integrated through the period:
    /// derivatives that cost little more than forces.
    Cheap,
    All,
}

impl Discretization {
    pub fn new(harmonics: Vec<usize>, samples: usize, ports: &Ports, banded: Option<BandedForm>) -> Self {
        let mut discretization = Discretization::without_solver(FrequencyTime::new(harmonics, samples), ports, banded);
        let size = discretization.workspace.residual.len();
        discretization.newton_krylov =
            (discretization.banded.is_none() && uses_krylov(size, ports)).then(NewtonKrylov::default);
        if discretization.newton_krylov.is_some() && !ports.has_forces() {
            discretization.create_coarse_sampling();
        }
        discretization
    }

    /// Returns the discretization with a Jacobian that is a matrix, whatever its size.
    pub fn with_matrix(self) -> Self {
        Discretization { with_matrix: true, ..self }
    }

    /// Creates the discretization without the solver for Newton steps.
    fn without_solver(aft: FrequencyTime, ports: &Ports, banded: Option<BandedForm>) -> Self {
        let (nh, axes) = (aft.harmonics.len(), ports.count());
        let size = 2 * nh * axes;
        let (blocks, tangents) = tangent_ranges(ports, nh);
        let widest = ports.iter().map(|port| port.axes).max().unwrap_or(0);
        let length = nh * axes;
        Discretization {
            aft,
            linear: LinearPart {
                receptance: Receptance::Formed(ReceptanceMatrices::default()),
                contacts: vec![ContactParameters::supported(0.0); ports.len()],
                largest_holding_force: 0.0,
                motion: vec![ZERO; length],
                mean_load: None,
                free_response: Vec::new(),
                imposed: vec![0.0; axes],
                series: ports.iter().flat_map(|port| vec![port.series_compliance; port.axes]).collect(),
                closed_stiffness: Vec::new(),
            },
            banded,
            newton_krylov: None,
            with_matrix: false,
            coarse: None,
            twice: None,
            equilibrium: ports.equilibrium().to_vec(),
            forces: ports.iter().flat_map(|port| vec![port.is_force(); port.axes]).collect(),
            blocks,
            workspace: Workspace {
                tangents: vec![0.0; tangents],
                jacobian: Vec::new(),
                residual: vec![0.0; size],
                units: vec![1.0; size],
                step: vec![0.0; size],
                previous: HarmonicSolution::zero(length),
                best: HarmonicSolution::zero(length),
                acting: Vec::new(),
                moved: vec![ZERO; length],
                image: vec![ZERO; nh * widest],
                product: Vec::new(),
            },
            search: SearchState {
                anchor: Vec::new(),
                tether: None,
                states: vec![InitialState::default(); ports.len()],
                reuses_states: false,
                uses_coarse: false,
                linearized: false,
                keeps_tangents: false,
            },
            work: WorkCounter::default(),
        }
    }

    pub fn harmonics(&self) -> &[usize] {
        &self.aft.harmonics
    }

    /// Tells whether GMRES computes the Newton steps, see [`uses_krylov`].
    pub fn uses_krylov(&self) -> bool {
        self.newton_krylov.is_some()
    }

    /// Extends a motion of one sector to the whole ring, for postprocessing:
    /// the returned discretization cannot be solved. `ports` are those of the ring.
    /// Every sector moves with the phase of the travelling wave.
    pub fn over_ring(
        &self,
        cyclic: CyclicSymmetry,
        ports: &Ports,
        motion: &HarmonicSolution,
    ) -> (Discretization, HarmonicSolution) {
        let (nh, own) = (self.harmonics().len(), motion.c.len());
        let all = |values: &[Complex64]| -> Vec<Complex64> {
            let lead = |s: usize, i: usize| cyclic.phase_factor(self.harmonics()[i % nh], s);
            (0..cyclic.sectors).flat_map(|s| (0..own).map(move |i| values[i] * lead(s, i))).collect()
        };
        let motion = HarmonicSolution { c: all(&motion.c), force: all(&motion.force), ..*motion };
        let mut discretization = Discretization::without_solver(self.aft.clone(), ports, None);
        let own = &self.linear.contacts;
        discretization.linear.contacts = (0..ports.len()).map(|p| own[p % own.len()]).collect();
        (discretization, motion)
    }

    /// Evaluates forces and residual at the unknowns in `motion`, and updates the other part of
    /// `motion`. Writes the derivatives of the ports into `self.workspace.tangents`, see
    /// [`DerivativeScope`]. Returns the relative size of the residual.
    pub fn evaluate(
        &mut self,
        context: SearchContext<'_>,
        motion: &mut HarmonicSolution,
        length: f64,
        slopes: DerivativeScope,
    ) -> f64 {
        let ports = context.ports;
        self.work.evaluations += usize::from(slopes != DerivativeScope::None);
        self.motion_port_forces(context, motion, slopes);
        self.structure_motion(motion, context.homotopy);
        self.force_port_residuals(context, motion, slopes);
        self.set_residual_units(ports, motion, length);
        // relative to the units of the residual; motions are weighted as velocities
        let nh = self.harmonics().len();
        let mut sum = 0.0;
        for port in ports.iter() {
            for q in port.range() {
                for (k, &h) in self.aft.harmonics.iter().enumerate() {
                    let at = 2 * (q * nh + k);
                    let square = self.workspace.residual[at] * self.workspace.residual[at]
                        + self.workspace.residual[at + 1] * self.workspace.residual[at + 1];
                    let unit = self.workspace.units[at];
                    sum += square * if port.is_force() { 1.0 } else { velocity_weight(h) } / (unit * unit);
                }
            }
        }
        sum.sqrt()
    }

    /// Computes the forces of motion ports, and their derivatives.
    pub(super) fn motion_port_forces(
        &mut self,
        context: SearchContext<'_>,
        motion: &mut HarmonicSolution,
        slopes: DerivativeScope,
    ) {
        let SearchContext { ports, omega, homotopy } = context;
        let nh = self.harmonics().len();
        self.aft.static_share = self.load_factor(homotopy) / homotopy.limit_factor;
        for (p, port) in ports.iter().enumerate().filter(|(_, port)| !port.is_force()) {
            let range = port.first_axis * nh..(port.first_axis + port.axes) * nh;
            let wanted =
                slopes == DerivativeScope::All || (slopes == DerivativeScope::Cheap && !port.has_memory_steps());
            let slot = wanted.then_some(&mut self.workspace.tangents[tangent_range(&self.blocks, p, port, nh)]);
            let (c, force) = (&motion.c[range.clone()], &mut motion.force[range]);
            if port.has_memory_steps() && self.search.reuses_states {
                self.aft.known_state = self.search.states[p].if_forgotten();
            }
            self.aft.motion_port_force(port, (omega, homotopy.limit_factor), c, force, slot);
            if wanted {
                self.add_springs(p, port, CLOSED_CONTACT_SIGN + self.proximal_stiffness());
            }
            if port.has_memory_steps() {
                self.search.states[p].state.clear();
                self.search.states[p].state.extend(self.aft.dissipating_state());
            }
        }
    }

    /// Computes the motion of the structure under the forces. Writes the
    /// residual of motion ports, and the motion of force ports.
    pub(super) fn structure_motion(&mut self, motion: &mut HarmonicSolution, homotopy: Homotopy) {
        let nh = self.harmonics().len();
        let share = self.load_factor(homotopy);
        self.compute_structure_forces(motion, share);
        let acting = if self.linear.closed_stiffness.is_empty() { &motion.force } else { &self.workspace.acting };
        if self.banded.is_none() {
            self.linear.receptance.apply(acting, &mut self.workspace.moved);
        }
        for k in 0..nh {
            let (residual, linear, forces) = (&mut self.workspace.residual, &self.linear.motion, &self.forces);
            let c = &mut motion.c;
            let share = if self.aft.harmonics[k] == 0 { share } else { 1.0 };
            let mut follow = |q: usize, u: Complex64| {
                let at = q * nh + k;
                let moved = linear[at] * share - u;
                if forces[q] {
                    c[at] = moved;
                } else {
                    let r = c[at] - moved;
                    (residual[2 * at], residual[2 * at + 1]) = (r.re, r.im);
                }
            };
            match &mut self.banded {
                Some(banded) => {
                    banded.response_along_axes(k, |q| acting[q * nh + k], follow);
                }
                None => {
                    self.workspace.moved.chunks_exact(nh).enumerate().for_each(|(q, u)| follow(q, u[k]));
                }
            }
        }
    }

    /// Computes the residual of all force ports, and its derivatives.
    fn force_port_residuals(&mut self, context: SearchContext<'_>, motion: &HarmonicSolution, slopes: DerivativeScope) {
        let ports = context.ports;
        for p in (0..ports.len()).filter(|p| ports[*p].is_force()) {
            self.force_port_residual(context, p, motion, slopes);
        }
    }

    /// Computes the residual of one force port, and its derivatives.
    pub(super) fn force_port_residual(
        &mut self,
        context: SearchContext<'_>,
        p: usize,
        motion: &HarmonicSolution,
        slopes: DerivativeScope,
    ) {
        let SearchContext { ports, omega, homotopy } = context;
        let (port, nh) = (&ports[p], self.harmonics().len());
        let range = port.first_axis * nh..(port.first_axis + port.axes) * nh;
        let contact = self.linear.contacts[p];
        let (c, force) = (&motion.c[range.clone()], &motion.force[range.clone()]);
        let slot = &mut self.workspace.tangents[tangent_range(&self.blocks, p, port, nh)];
        let image = &mut self.workspace.image[..range.len()];
        let slot = (slopes != DerivativeScope::None).then(|| {
            slot.fill(0.0);
            slot
        });
        self.aft.force_port_image(port, (omega, contact, homotopy.limit_factor), (c, force), image, slot);
        for (at, (force, image)) in range.zip(force.iter().zip(&*image)) {
            let mut r = force - image;
            if homotopy.proximal_weight > 0.0 {
                r += (force - self.search.anchor[at]) * homotopy.proximal_weight;
            }
            (self.workspace.residual[2 * at], self.workspace.residual[2 * at + 1]) = (r.re, r.im);
        }
    }

    /// Updates the forces of motion ports by the last Newton step and the derivatives of that
    /// step. Removes the springs of closed contacts from these derivatives.
    pub(super) fn step_forces(&mut self, ports: &Ports, motion: &mut HarmonicSolution, length: f64) {
        let pair = 2 * self.harmonics().len();
        for (p, port) in ports.iter().enumerate().filter(|(_, port)| !port.is_force()) {
            self.add_springs(p, port, -CLOSED_CONTACT_SIGN);
            let (wide, unit) = (pair * port.axes, port.unit(length));
            let step = &self.workspace.step[port.first_axis * pair..][..wide];
            let rows = self.workspace.tangents[tangent_range(&self.blocks, p, port, pair / 2)].chunks_exact(2 * wide);
            for (force, rows) in motion.force[port.first_axis * pair / 2..].iter_mut().zip(rows) {
                let (re, im) = rows.split_at(wide);
                *force -= Complex64::new(dot(re, step), dot(im, step)) * unit;
            }
        }
        self.search.linearized = false;
    }

    /// Begins a point. All searches of the point share one work limit.
    pub fn begin_point(&mut self) {
        self.work.begin_point();
        self.aft.law_steps = 0;
    }

    /// Begins a search: resets its work, and forgets the states of laws with memory.
    pub fn begin_search(&mut self, ports: &Ports) {
        self.work.begin_search(self.point_work_used(ports));
        self.aft.law_steps = 0;
        let search = &mut self.search;
        (search.reuses_states, search.linearized, search.keeps_tangents) = (false, false, false);
        search.uses_coarse = self.coarse.is_some();
        search.states.iter_mut().for_each(|known| *known = InitialState::default());
    }

    /// Tells whether the states of a law may cross their range between two
    /// samples of a motion. Such a law is as steep for the series as a law of
    /// velocity, and samples locate its sign change only to within one sample.
    pub fn states_cross_within_sample(&self, ports: &Ports, motion: &HarmonicSolution) -> bool {
        let (nh, samples) = (self.harmonics().len(), self.all_samples() as f64);
        let phase = |k: usize| self.harmonics()[k] as f64 * std::f64::consts::TAU / samples;
        let fastest = |q: usize| (0..nh).map(|k| motion.c[q * nh + k].norm() * phase(k)).sum::<f64>();
        ports
            .iter()
            .any(|port| port.state_range_displacement().is_some_and(|layer| port.range().any(|q| fastest(q) > layer)))
    }

    /// Tells whether contacts alone hold some body.
    pub fn is_held_by_contacts(&self) -> bool {
        !self.linear.closed_stiffness.is_empty()
    }

    /// Returns the static equilibrium times `share`. If it is unknown, returns
    /// the mean without friction, or on closed contacts if these alone hold a body.
    pub fn static_solution(&self, share: f64) -> HarmonicSolution {
        let nh = self.harmonics().len();
        let mut motion = HarmonicSolution::zero(self.linear.motion.len());
        if self.harmonics()[0] != 0 {
            return motion;
        }
        let known = &self.equilibrium;
        let still = |i: usize| known.get(i / nh).map_or(self.linear.motion[i], |u| Complex64::new(*u, 0.0));
        motion.c.iter_mut().enumerate().step_by(nh).for_each(|(i, c)| *c = still(i) * share);
        motion
    }

    /// Returns the factor of the constant loads. If contacts carry the loads, these grow with
    /// the slip limits, so that a contact that sticks under all of them sticks during the
    /// homotopy. The excitation is then smaller relative to the loads.
    fn load_factor(&self, homotopy: Homotopy) -> f64 {
        if self.is_held_by_contacts() { homotopy.limit_factor } else { 1.0 }
    }

    /// Computes the forces minus those of the springs in the structure, into
    /// `self.workspace.acting`.
    fn compute_structure_forces(&mut self, motion: &HarmonicSolution, share: f64) {
        if !self.is_held_by_contacts() {
            return;
        }
        let nh = self.aft.harmonics.len();
        self.workspace.acting.clone_from(&motion.force);
        for (q, (k, imposed)) in self.linear.closed_stiffness.iter().zip(&self.linear.imposed).enumerate() {
            self.workspace.acting[q * nh] -= (motion.c[q * nh] - imposed * share) * *k;
        }
        if let Some(tether) = &self.search.tether {
            for (q, (k, anchor)) in self.linear.closed_stiffness.iter().zip(&tether.anchor).enumerate() {
                self.workspace.acting[q * nh] += (motion.c[q * nh] - anchor) * (tether.relative_stiffness * k);
            }
        }
    }

    /// Returns the forces on the structure in a motion, [axis][harmonic], N,
    /// see [`LinearPart::closed_stiffness`].
    pub fn structure_forces<'a>(&'a mut self, motion: &'a HarmonicSolution) -> &'a [Complex64] {
        self.compute_structure_forces(motion, 1.0);
        if self.is_held_by_contacts() { &self.workspace.acting } else { &motion.force }
    }

    /// Returns the stiffness of the tether, relative to the springs of closed contacts.
    pub(super) fn proximal_stiffness(&self) -> f64 {
        self.search.tether.as_ref().map_or(0.0, |tether| tether.relative_stiffness)
    }

    /// Adds `share` times the springs of closed contacts to the derivative of
    /// the mean at a port. The share is [`CLOSED_CONTACT_SIGN`] if the structure contains
    /// them, and positive to shorten the step of the mean.
    pub(super) fn add_springs(&mut self, p: usize, port: &Port, share: f64) {
        let nh = self.aft.harmonics.len();
        let tall = 2 * nh * port.axes;
        let tangent = &mut self.workspace.tangents[tangent_range(&self.blocks, p, port, nh)];
        for (a, k) in self.linear.closed_stiffness.iter().skip(port.first_axis).take(port.axes).enumerate() {
            let at = 2 * nh * a;
            tangent[at * tall + at] += share * k;
        }
    }

    /// Returns the motion without friction.
    pub fn frictionless_motion(&self) -> HarmonicSolution {
        HarmonicSolution { c: self.linear.motion.clone(), ..HarmonicSolution::zero(self.linear.motion.len()) }
    }

    /// Samples the forces of a port, into `self.aft`.
    pub fn sample(&mut self, ports: &Ports, p: usize, omega: f64, motion: &HarmonicSolution) {
        let nh = self.harmonics().len();
        let port = &ports[p];
        if self.search.linearized && port.has_memory_steps() {
            self.aft.known_state = self.search.states[p].if_forgotten();
        }
        self.aft.static_share = 1.0;
        let range = port.first_axis * nh..(port.first_axis + port.axes) * nh;
        self.aft.sample(port, omega, self.linear.contacts[p], &motion.c[range.clone()], &motion.force[range]);
    }

    /// Returns displacement and internal states of a port at the beginning of the period. The
    /// states are empty if they are not periodic.
    pub fn initial_state_of(&mut self, ports: &Ports, p: usize, omega: f64, motion: &HarmonicSolution) -> StaticState {
        self.sample(ports, p, omega, motion);
        let nh = self.harmonics().len();
        let mut state = StaticState { states: self.aft.state.clone(), ..StaticState::default() };
        for (to, q) in state.displacement.iter_mut().zip(ports[p].range()) {
            *to = motion.c[q * nh..(q + 1) * nh].iter().map(|c| c.re).sum();
        }
        state
    }

    /// Returns the forces along all axes at the harmonics `wanted`, per harmonic, from the
    /// samples. The harmonics may lie above those of the series.
    pub fn forces_at(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &HarmonicSolution,
        wanted: &[usize],
    ) -> Vec<Vec<Complex64>> {
        let mut forces = vec![vec![ZERO; ports.count()]; wanted.len()];
        for (p, port) in ports.iter().enumerate() {
            self.sample(ports, p, omega, motion);
            for q in port.range() {
                self.aft.add_harmonics(q - port.first_axis, wanted, |k, f| forces[k][q] += f);
            }
        }
        forces
    }

    /// Computes the Newton step by GMRES. `self.workspace.step` contains the scaled residual on
    /// entry and the step on return. Returns false if GMRES does not converge.
    pub(super) fn krylov_step(&mut self, context: SearchContext<'_>, near: StepStart) -> bool {
        let SearchContext { ports, omega, homotopy } = context;
        let Some(coupled) = &mut self.newton_krylov else { return false };
        let linear = LinearizedEquations {
            ports,
            harmonics: &self.aft.harmonics,
            omega,
            homotopy,
            length: near.length,
            contacts: &self.linear.contacts,
            tangents: &self.workspace.tangents,
            blocks: &self.blocks,
            units: &self.workspace.units,
        };
        let (found, products) = coupled.step(&linear, &mut self.linear.receptance, &mut self.workspace.step, near);
        self.work.products += products;
        found
    }

    /// Assembles the Jacobian from the tangents, rows and columns in units.
    /// Returns false if the receptances are not matrices.
    pub(super) fn assemble(&mut self, context: SearchContext<'_>, length: f64) -> bool {
        let SearchContext { ports, omega, homotopy } = context;
        let Receptance::Formed(formed) = &self.linear.receptance else { return false };
        let linear = LinearizedEquations {
            ports,
            harmonics: &self.aft.harmonics,
            omega,
            homotopy,
            length,
            contacts: &self.linear.contacts,
            tangents: &self.workspace.tangents,
            blocks: &self.blocks,
            units: &self.workspace.units,
        };
        linear.matrix(
            &formed.matrices,
            linear.harmonics.len(),
            (&mut self.workspace.product, &mut self.workspace.jacobian),
        );
        true
    }
}

/// Returns `motion` with other harmonics. New harmonics are zero.
pub(super) fn with_harmonics(motion: &HarmonicSolution, from: &[usize], to: &[usize]) -> HarmonicSolution {
    let pick = |values: &[Complex64]| {
        let mut out = Vec::with_capacity(values.len() / from.len().max(1) * to.len());
        for values in values.chunks_exact(from.len()) {
            out.extend(to.iter().map(|h| from.binary_search(h).map_or(ZERO, |k| values[k])));
        }
        out
    };
    HarmonicSolution { c: pick(&motion.c), force: pick(&motion.force), ..*motion }
}

#[cfg(test)]
mod tests {
    use super::super::dynamics::linear_dynamics::LinearDynamics;
    use super::super::postprocess;
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, Jenkins, JenkinsArctan, SharedLaw};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, System, example};
    use std::sync::Arc;

    /// A row of masses with joints of every law between them, with or without a constant force.
    /// With it, another mass is held by rigid friction alone.
    fn mixed(masses: usize, constant: f64) -> System {
        let name = |i: usize| format!("m{i}");
        let mut model = Model::default();
        let laws: [SharedLaw; 4] = [
            Arc::new(Jenkins { stiffness: 2.0, limit: 0.3 }),
            Arc::new(Coulomb { limit: 0.2 }),
            Arc::new(CoulombArctan { limit: 0.25, alpha: 5.0 }),
            Arc::new(JenkinsArctan { stiffness: 3.0, limit: 0.2, alpha: 8.0 }),
        ];
        for i in 0..masses {
            model.masses.push(Mass::new(name(i), 1.0 + 0.1 * i as f64));
            model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness: 1.0, damping: 0.05 });
            if i > 0 {
                let law = laws[i % if masses < 10 { 4 } else { 3 }].clone();
                model.joints.push(Joint { name: format!("j{i}"), between: [name(i - 1), name(i)], law });
            }
        }
        model.forces.push(Force { on: name(0), amplitude: 1.0, phase: 0.2, harmonic: 1 });
        if constant != 0.0 {
            model.forces.push(Force { on: name(1), amplitude: constant, phase: 0.0, harmonic: 0 });
            model.masses.push(Mass::new("loose", 1.0));
            for i in 0..2 {
                let law = Arc::new(Coulomb { limit: 0.2 });
                model.joints.push(Joint { name: format!("loose{i}"), between: [name(i), "loose".into()], law });
            }
        }
        model.assemble().unwrap()
    }

    struct Case {
        system: System,
        ports: Ports,
        dynamics: LinearDynamics,
        omega: f64,
    }

    impl Case {
        fn new(system: System, omega: f64) -> Self {
            let ports = Ports::new(&system).unwrap();
            let dynamics = LinearDynamics::new(&system, &ports);
            Case { system, ports, dynamics, omega }
        }

        fn discretization(&self, harmonics: Vec<usize>, banded: bool) -> Discretization {
            let banded = banded.then(|| BandedForm::new(&self.system, &self.ports, &harmonics).unwrap());
            let samples = 256.max(16 * harmonics[harmonics.len() - 1]);
            let mut discretization = Discretization::new(harmonics, samples, &self.ports, banded);
            discretization.set_frequency(&self.system, &self.ports, &self.dynamics, self.omega).unwrap();
            let held_by_friction = discretization.linear.contacts.iter().filter(|contact| contact.mean_stiffness > 0.0);
            assert_eq!(held_by_friction.count(), if discretization.harmonics()[0] == 0 { 2 } else { 0 });
            discretization
        }
    }

    /// Returns a pseudo-random value between -1 and 1.
    fn noise(i: usize) -> f64 {
        ((i * 7919 + 13) as f64).sin()
    }

    /// The Jacobian agrees with central differences, for all laws together,
    /// with and without a mean.
    #[test]
    fn the_jacobian_is_the_derivative() {
        for (constant, harmonics) in [(0.0, vec![1, 3, 5]), (0.2, vec![0, 1, 2, 3])] {
            let case = Case::new(mixed(6, constant), 0.9);
            let mut discretization = case.discretization(harmonics, false);
            let size = discretization.workspace.residual.len();
            let mut motion = HarmonicSolution::zero(discretization.linear.motion.len());
            // the mean has no imaginary part
            let real =
                |i: usize| discretization.harmonics()[(i / 2) % discretization.harmonics().len()] == 0 && i % 2 == 1;
            let x: Vec<f64> = (0..size).map(|i| if real(i) { 0.0 } else { 0.4 * noise(i) }).collect();
            let imaginary: Vec<bool> = (0..size).map(real).collect();
            let (mut r, mut j) = (vec![0.0; size], vec![0.0; size * size]);
            let mut at = |x: &[f64], j: Option<&mut [f64]>| {
                discretization.residual_at(&case.ports, case.omega, (x, 1.5), &mut motion, &mut r, j);
                r.clone()
            };
            at(&x, Some(&mut j));
            let step = 1e-6;
            // relative rounding of a difference of the force; the neglected
            // curvature is of second order
            let rounded = 1e-8;
            let largest = j.iter().fold(0.0, |m: f64, j| m.max(j.abs()));
            let mut wrong = 0;
            for k in (0..size).filter(|&k| !imaginary[k]) {
                let moved = |by: f64| {
                    let mut x = x.clone();
                    x[k] += by;
                    x
                };
                let (up, down) = (at(&moved(step), None), at(&moved(-step), None));
                for i in 0..size {
                    let difference = (up[i] - down[i]) / (2.0 * step);
                    wrong += usize::from((difference - j[i * size + k]).abs() > rounded * largest);
                }
            }
            assert_eq!(wrong, 0, "of {}", size * size);
        }
    }

    /// The banded form finds the motion of the dense form, with every law that it supports.
    #[test]
    fn banded_and_dense_agree() {
        for (constant, harmonics) in [(0.0, vec![1, 3, 5]), (0.2, vec![0, 1, 2, 3])] {
            let case = Case::new(mixed(44, constant), 0.9);
            let solve = |banded: bool| {
                let mut discretization = case.discretization(harmonics.clone(), banded);
                let start = discretization.initial_guess(&case.system, &case.ports, None, case.omega);
                discretization.solve(&case.ports, case.omega, start).unwrap()
            };
            let (dense, banded) = (solve(false), solve(true));
            // the mean of an unsupported direction multiplies rounding by 1e10
            let vibrates = |i: &usize| harmonics[i % harmonics.len()] > 0;
            let motions = (0..dense.c.len()).filter(vibrates).map(|i| (dense.c[i], banded.c[i]));
            for (a, b) in motions.chain(dense.force.iter().copied().zip(banded.force)) {
                assert!((a - b).norm() < 1e-8, "{a} {b}");
            }
        }
    }

    /// ε follows the resolution and is not a stiffness. Half or twice of it changes a curve no
    /// more than the missing harmonics do, and less with more harmonics.
    #[test]
    fn the_contact_parameter_matters_no_more_than_missing_harmonics() {
        for limit in [2.0, 4.0, 6.0, 8.0] {
            let (mut missing, mut few, mut many) = (0.0f64, 0.0f64, 0.0f64);
            for hertz in [120.0, 121.0, 121.1, 121.25, 122.0] {
                let mut couple = example::blade_couple();
                couple.joints[0].law = Arc::new(Coulomb { limit });
                let system = couple.assemble().unwrap();
                let case = Case::new(system, std::f64::consts::TAU * hertz);
                let solution = |top: usize, factor: f64| {
                    let mut discretization = case.discretization((1..=top).step_by(2).collect(), false);
                    discretization.linear.contacts[0].epsilon *= factor;
                    let start = discretization.initial_guess(&case.system, &case.ports, None, case.omega);
                    let motion = discretization.solve(&case.ports, case.omega, start).unwrap();
                    postprocess::places(&mut discretization, &case.dynamics, case.omega, &motion).unwrap()
                };
                let distance = |a: &[DVector<Complex64>], b: &[DVector<Complex64>]| {
                    let zero = DVector::from_element(3, ZERO);
                    let apart = b.iter().enumerate().map(|(k, b)| (a.get(k).unwrap_or(&zero) - b).norm_squared());
                    apart.sum::<f64>().sqrt() / b[0].norm()
                };
                let (given, better) = (solution(15, 1.0), solution(63, 1.0));
                missing = missing.max(distance(&given, &better));
                for factor in [0.5, 2.0] {
                    few = few.max(distance(&given, &solution(15, factor)));
                    many = many.max(distance(&better, &solution(63, factor)));
                }
            }
            assert!(few <= missing + 1e-9 && many <= 0.7 * few + 1e-9, "{limit} N: {missing:.1e} {few:.1e} {many:.1e}");
        }
    }
}
