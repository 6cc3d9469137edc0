//! The equations at one excitation frequency: receptances, the motion without
//! friction, the parameters of rigid contacts, and the initial guess.

use super::contact_parameter::contact_parameter;
use super::regularization::{LEAST_EPSILON_RATIO, REGULARIZING_FREQUENCY};
use super::{Discretization, HarmonicSolution, ZERO};
use crate::method::harmonic_balance::aft::{PortMember, Ports};
use crate::method::harmonic_balance::dynamics::linear_dynamics::LinearDynamics;
use crate::method::harmonic_balance::dynamics::receptance::{ModalReceptance, Receptance, ReceptanceMatrices};
use crate::method::orbit_search::describing_guess::DescribingGuess;
use crate::model::System;
use nalgebra::DVector;
use num_complex::Complex64;

/// Receptance at the highest harmonic `top` below which a motion counts as imposed, relative to
/// `1/max(K, Ω² M)/top²` with the largest entries K and M of the structure.
const IMPOSED_RECEPTANCE: f64 = 1e-14;

impl Discretization {
    /// Prepares the equations for an excitation frequency.
    ///
    /// # Errors
    /// Returns the frequency (rad/s) of an undamped resonance of the structure without its joints.
    pub fn set_frequency(
        &mut self,
        system: &System,
        ports: &Ports,
        dynamics: &LinearDynamics,
        omega: f64,
    ) -> Result<(), f64> {
        let n = system.dofs();
        let excitation = system.excitation(omega);
        let nh = self.harmonics().len();
        for port in ports.iter() {
            self.linear.series[port.range()].fill(port.series_compliance);
        }
        let closed = if self.aft.harmonics[0] == 0 { dynamics.closed(omega) } else { None };
        self.linear.closed_stiffness.clear();
        self.linear.closed_stiffness.extend(closed.iter().flat_map(|closed| &closed.springs));
        self.linear.free_response.clear();
        if let Some(banded) = &mut self.banded {
            // at a singular frequency, take the next floating-point number
            banded.set_closed_contacts(&self.linear.closed_stiffness);
            banded
                .factor_dynamic_stiffness(omega)
                .or_else(|_| banded.factor_dynamic_stiffness(omega * (1.0 + f64::EPSILON)))?;
        } else {
            self.linear.receptance = self.receptance(ports, dynamics, omega)?;
        }
        self.linear.mean_load = excitation.iter().find(|(h, _)| *h == 0).map(|(_, load)| load.clone());
        for k in 0..nh {
            let h = self.aft.harmonics[k];
            let load = excitation.iter().find(|(number, _)| *number as usize == h);
            let mut free = DVector::from_element(n, ZERO);
            if let Some(banded) = &mut self.banded {
                if let Some((_, force)) = load {
                    banded.respond(k, |i| force[i], free.as_mut_slice());
                }
            } else {
                if let Some((_, force)) = load {
                    free = dynamics.respond(h, omega, force).map_err(|_| h as f64 * omega)?;
                }
            }
            for q in 0..ports.count() {
                let axis = ports.axis(system, q);
                self.linear.motion[q * nh + k] = axis.complex_component(&free) + axis.imposed_at(h as u32);
            }
            self.linear.free_response.push(free);
        }
        for (q, imposed) in self.linear.imposed.iter_mut().enumerate() {
            *imposed = ports.axis(system, q).imposed_at(0).re;
        }
        if !ports.has_forces() {
            return Ok(());
        }
        let top = self.aft.harmonics[nh - 1].max(1);
        let [mass, _, stiffness] = system.structure().largest();
        let stiff = stiffness.max(omega * omega * mass);
        let soft = 1.0 / stiff.max(f64::MIN_POSITIVE);
        // at a real rate: the impedance of the highest harmonic without the resonances near it
        let rate = top as f64 * omega;
        let smooth = match &mut self.banded {
            Some(banded) => banded.direct_receptances(rate),
            None => dynamics.direct_receptances(rate, omega).map_err(|_| rate)?,
        };
        let masses = if self.aft.harmonics[0] == 0 { dynamics.unsupported_masses(omega) } else { &[] };
        for (contact, port) in self.linear.contacts.iter_mut().zip(ports.iter()).filter(|(_, port)| port.is_force()) {
            // one ε for all axes of a port, so that its plane has no preferred direction
            let mean = port.range().map(|q| smooth[q]).sum::<f64>() / port.axes as f64;
            let receptance = mean + port.series_compliance;
            let imposed = port.series_compliance == 0.0 && receptance <= IMPOSED_RECEPTANCE * soft / (top * top) as f64;
            contact.epsilon = if imposed {
                f64::INFINITY
            } else {
                contact_parameter(receptance, top, omega).max(LEAST_EPSILON_RATIO * port.least_penalty)
            };
            let mass = masses.iter().skip(port.first_axis).take(port.axes).fold(0.0, |a: f64, &b| a.max(b));
            contact.mean_stiffness = mass * (REGULARIZING_FREQUENCY * omega).powi(2);
        }
        self.linear.largest_holding_force = 0.0;
        for (contact, port) in self.linear.contacts.iter().zip(ports.iter()).filter(|(_, port)| port.is_force()) {
            for q in port.range() {
                let moving = self.linear.motion[q * nh..(q + 1) * nh].iter().zip(&self.aft.harmonics);
                let velocity = moving.map(|(c, h)| *h as f64 * omega * c.norm()).fold(0.0, f64::max);
                if velocity > 0.0 {
                    self.linear.largest_holding_force =
                        self.linear.largest_holding_force.max(contact.epsilon * velocity);
                }
            }
        }
        Ok(())
    }

    /// Computes the receptances of the axes with the springs in series: by modes if there are
    /// many axes and the modes are known, otherwise as matrices.
    fn receptance(&self, ports: &Ports, dynamics: &LinearDynamics, omega: f64) -> Result<Receptance, f64> {
        let harmonics = self.harmonics();
        if let Some(structure) = dynamics.modes_for(ports).filter(|_| !self.with_matrix) {
            let closed = if harmonics[0] == 0 { dynamics.closed(omega) } else { None };
            let modal = ModalReceptance::new((structure, closed), (harmonics, omega), &self.linear.series);
            return modal.map(Receptance::Modal).map_err(|_| omega);
        }
        let formed = harmonics.iter().map(|&h| {
            let mut receptance = dynamics.receptance(h, omega).map_err(|_| h as f64 * omega)?;
            self.linear.series.iter().enumerate().for_each(|(q, series)| receptance[(q, q)] += series);
            Ok(receptance)
        });
        Ok(Receptance::Formed(ReceptanceMatrices::new(formed.collect::<Result<_, f64>>()?)))
    }

    /// Returns the initial guess: the solution by describing functions, if it is given.
    /// Otherwise, or if contacts alone hold a body, static equilibrium, from which one Newton
    /// step finds the motion in stick. Structures with forces as unknowns, and those in banded
    /// form, begin with the motion without friction.
    pub fn initial_guess(
        &self,
        system: &System,
        ports: &Ports,
        guess: Option<&DescribingGuess>,
        omega: f64,
    ) -> HarmonicSolution {
        let nh = self.harmonics().len();
        let mut motion = self.frictionless_motion();
        let from_rest = guess.is_none() && self.banded.is_none() && !ports.has_forces();
        if self.is_held_by_contacts() || from_rest {
            return self.static_solution(1.0);
        }
        let Some(guess) = guess else { return motion };
        for port in ports.iter() {
            for (rate, x) in &guess.harmonics {
                let h = (rate / omega).round() as usize;
                let Ok(k) = self.harmonics().binary_search(&h) else { continue };
                for q in port.range() {
                    let (_, a) = ports.joint_axis(q);
                    // the force with the virtual work of all members
                    let work = |member: &PortMember| {
                        member.motion_ratio * guess.force(system, (member.joint, a), (h as u32, x))
                    };
                    let force: Complex64 = port.members.iter().map(work).sum();
                    if !force.is_finite() {
                        continue; // rigid friction without motion
                    }
                    let axis = ports.axis(system, q);
                    let moved = axis.complex_component(x) + axis.imposed_at(h as u32);
                    motion.c[q * nh + k] = moved - force * port.series_compliance;
                    motion.force[q * nh + k] = force;
                }
            }
        }
        motion
    }
}
