//! Multiplications: of a Newton step and of an orbit, counted before anything is computed, for
//! method `auto`; and those of a search, relative to its work limit. Also the memory of factors.

use super::aft::{Port, Ports};
use super::budget::WorkShare;
use super::dynamics::banded::BandedForm;
use super::equations::Discretization;
use super::equations::harmonic_set::HarmonicSet;
use super::linear_solve::newton_krylov::{krylov_step_work, product_work, uses_krylov};
use super::options::FIRST_HARMONICS;
use super::settings::WorkSettings;
use crate::law::IdealElement;
use crate::model::System;
use num_complex::Complex64;

/// Returns the multiplications of a Newton step with harmonics up to `top`.
///
/// Newton steps take most of the time of a search. The result is zero if harmonic balance does
/// not take the system.
fn step_work(system: &System, top: usize) -> f64 {
    let Ok((ports, _)) = Ports::for_sector(system) else { return 0.0 };
    let harmonics = HarmonicSet::new(system, |z| z != Complex64::new(0.0, 0.0)).up_to(top).len();
    step_multiplications(BandedForm::new(system, &ports, &[1]).as_ref(), &ports, harmonics)
}

/// Returns the multiplications of a step with this number of harmonics. `banded` is one
/// harmonic in banded form, if the system has that form.
pub(super) fn step_multiplications(banded: Option<&BandedForm>, ports: &Ports, harmonics: usize) -> f64 {
    let size = 2 * harmonics * ports.count();
    match banded {
        Some(banded) => banded.work(harmonics),
        None if uses_krylov(size, ports) => krylov_step_work(ports, harmonics),
        None => (size as f64).powi(3) / 3.0,
    }
}

/// Returns the memory of the factored dynamic stiffness of one harmonic, in bytes.
///
/// The result is zero unless the whole structure is factored for every harmonic at every
/// frequency.
pub fn factor_bytes(system: &System) -> usize {
    let Ok((ports, _)) = Ports::for_sector(system) else { return 0 };
    let is_banded = || BandedForm::new(system, &ports, &[1]).is_some();
    if ports.wave().is_some() || is_banded() { 0 } else { system.structure().factor_bytes() }
}

/// Returns the multiplications of one step at each series length, doubled from the first up to
/// `longest`, plus one step at twice each length for its error estimate.
fn doubling_work(system: &System, longest: f64) -> f64 {
    let tops = std::iter::successors(Some(FIRST_HARMONICS), |top| ((*top as f64) < longest).then_some(2 * top));
    tops.map(|top| step_work(system, top) + step_work(system, 2 * top)).sum()
}

/// Highest harmonic that rigid friction usually needs.
const USUAL_HARMONICS: f64 = 31.0;
/// Newton steps at each series length. Measured with [`USUAL_HARMONICS`]: 14 trees of 8 to 30
/// masses took 0.02 to 2 s per point, with 15 to 255 harmonics. Rings of 8 to 24 masses took 0.15
/// to 0.6 s.
const STEPS_PER_LENGTH: f64 = 3.0;
/// Multiplications per degree of freedom of everything except Newton steps: motions at the
/// samples of a period.
const PER_DOF: f64 = 2e5;
/// Multiplications per slider or stop, for its law at the samples of a period. Measured in
/// sweeps: rings of 12, 24 and 36 `jenkins` took 5, 7 and 12 ms; an `iwan` of 32 and 100
/// sliders took 7 and 22 ms. A model of 60 masses took 2 ms with two `jenkins` and 3 ms without
/// a joint.
const PER_PIECE: f64 = 7e5;

/// Returns the multiplications for an orbit of a system of sliders and stops, with the usual
/// number of harmonics.
///
/// # Example
/// ```
/// use stickslip::method::{event_driven, harmonic_balance};
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// assert!(harmonic_balance::orbit_work(&system) > event_driven::orbit_work(&system).unwrap());
/// ```
pub fn orbit_work(system: &System) -> f64 {
    let pieces = system.joints().iter().flat_map(|joint| joint.law().ideal_elements().unwrap_or_default());
    let (mut count, mut rigid) = (0.0, false);
    for piece in pieces.filter(|piece| !piece.carries_no_force()) {
        count += 1.0;
        rigid |= matches!(piece, IdealElement::Slider(slider) if slider.stiffness.is_none());
    }
    let searched = if rigid { STEPS_PER_LENGTH * doubling_work(system, USUAL_HARMONICS) } else { 0.0 };
    PER_DOF * system.dofs() as f64 + PER_PIECE * count + searched
}

impl Discretization {
    /// Returns the work of the present search relative to the limits of [`WorkSettings`].
    pub(super) fn work_used(&self, ports: &Ports) -> WorkShare {
        let settings = WorkSettings::default();
        let (size, harmonics) = (self.workspace.residual.len() as f64, self.harmonics().len());
        let of_port = |port: &Port| {
            let falls = port.least_penalty > 0.0;
            port.axes as f64 * if falls { settings.falling_evaluation } else { settings.evaluation }
        };
        let evaluated = (self.all_samples() * self.work.evaluations) as f64 * ports.iter().map(of_port).sum::<f64>();
        let (taken, least) = match &self.banded {
            Some(banded) => {
                let one = banded.work(harmonics);
                (self.work.eliminations as f64 * one + evaluated, settings.eliminations * one)
            }
            // GMRES counts its products; the line search takes none
            None if self.newton_krylov.is_some() => {
                let one = product_work(ports, harmonics);
                (self.work.products as f64 * one, settings.eliminations * settings.products_per_step * one)
            }
            None => {
                let one = size.powi(3) / 3.0;
                (self.work.eliminations as f64 * one + evaluated, settings.eliminations * one)
            }
        };
        let most = if self.work.extends_shorter && ports.has_forces() {
            settings.multiplications
        } else {
            settings.multiplications.max(least)
        };
        // four periods of at most 1024 samples in one evaluation
        let stepped = settings.evaluations * 4 * self.all_samples().min(1024) * ports.len();
        WorkShare {
            multiplications: taken / most,
            time_steps: self.aft.law_steps as f64 / settings.time_steps.max(stepped) as f64,
        }
    }

    /// Returns the work of all searches of the point on these equations.
    pub(super) fn point_work_used(&self, ports: &Ports) -> WorkShare {
        self.work.before.and(self.work_used(ports))
    }

    /// Returns true if the search has used its work limit or that of its point.
    pub(super) fn is_budget_used(&self, ports: &Ports) -> bool {
        self.work_used(ports).exceeds(WorkShare { multiplications: 1.0, time_steps: 1.0 })
            || self.work.elsewhere.and(self.point_work_used(ports)).exceeds(self.work.limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Coulomb;
    use crate::model::{GROUND, Joint, Mass, Model, Spring};
    use std::sync::Arc;

    /// Returns the multiplications, per harmonic cubed, for a chain with a joint at every mass.
    fn chain(masses: usize) -> f64 {
        let mut model = Model::default();
        for i in 0..masses {
            let name = format!("m{i}");
            let other = if i == 0 { GROUND.into() } else { format!("m{}", i - 1) };
            model.masses.push(Mass::new(name.clone(), 1.0));
            model.springs.push(Spring { between: [name.clone(), other.clone()], stiffness: 1.0, damping: 0.1 });
            model.joints.push(Joint {
                name: format!("j{i}"),
                between: [name, other],
                law: Arc::new(Coulomb { limit: 0.1 }),
            });
        }
        step_work(&model.assemble().unwrap(), 100) / 100f64.powi(3)
    }

    /// The work of a long chain is proportional to its length, because its equations are
    /// banded. A short chain is eliminated as a full matrix.
    #[test]
    fn work_is_proportional_to_the_chain_length() {
        let (long, longer) = (chain(60), chain(120));
        assert!((longer / long - 2.0).abs() < 0.1, "{long:.1} {longer:.1}");
        assert!(chain(4) > 0.0 && chain(4) < long);
    }
}
