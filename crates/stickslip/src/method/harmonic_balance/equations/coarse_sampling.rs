//! Coarse sampling of the period, for derivatives of many contacts.

use super::{CLOSED_CONTACT_SIGN, Discretization, HarmonicSolution};
use crate::method::harmonic_balance::aft::{FrequencyTime, PERIODICITY_TOLERANCE, tangent_range};
use crate::method::harmonic_balance::equations::homotopy::SearchContext;

/// The coarse sampling has at least `1/MOST_REDUCTION` of all samples, at least
/// `SAMPLES_PER_WAVE` samples per wave of the highest harmonic, and at most half of all samples.
///
/// Measured: a Newton step with coarse derivatives leaves 0.01 of the residual; so does the
/// next step with the same derivatives. With five samples per wave, the error of five harmonics
/// of 16 nodes is known to 0.12 instead of 0.05.
const MOST_REDUCTION: usize = 6;
const SAMPLES_PER_WAVE: usize = 8;
/// Change of the states over a period, relative to their size, at which coarse derivatives are
/// taken. Fewer samples cause an error of this size.
const COARSE_PERIODICITY: f64 = 1e-3;

impl Discretization {
    /// Creates the coarse sampling, if it has at most half of all samples.
    pub(in super::super) fn create_coarse_sampling(&mut self) {
        let top = self.harmonics().last().copied().unwrap_or(0);
        let all = self.aft.samples();
        let least = (SAMPLES_PER_WAVE * (top + 1)).max(all / MOST_REDUCTION);
        let few = [2, 3].map(|base: usize| base * least.div_ceil(base).next_power_of_two());
        let few = few.into_iter().min().filter(|few| 2 * few <= all);
        self.coarse = few.map(|few| FrequencyTime::new(self.harmonics().to_vec(), few));
    }

    /// Computes the derivatives that [`DerivativeScope::Cheap`](super::DerivativeScope::Cheap)
    /// omits, at the motion evaluated last. With `sketched`, derivatives of return maps use the
    /// coarse sampling, if there is one.
    ///
    /// A Newton step with coarse derivatives leaves some thousandths of the residual, which has
    /// all samples itself. Returns whether some derivatives are coarse.
    pub fn complete_derivatives(
        &mut self,
        context: SearchContext<'_>,
        motion: &mut HarmonicSolution,
        sketched: bool,
    ) -> bool {
        let SearchContext { ports, omega, homotopy } = context;
        let nh = self.harmonics().len();
        self.aft.static_share = self.load_factor(homotopy) / homotopy.limit_factor;
        let mut any = false;
        for (p, port) in ports.iter().enumerate().filter(|(_, port)| port.has_memory_steps()) {
            let range = port.first_axis * nh..(port.first_axis + port.axes) * nh;
            let slot = &mut self.workspace.tangents[tangent_range(&self.blocks, p, port, nh)];
            let (c, force) = (&motion.c[range.clone()], &mut motion.force[range.clone()]);
            let mut aft = &mut self.aft;
            let mut rough = false;
            if let Some(coarse) = self.coarse.as_mut().filter(|_| sketched && port.uses_return_map()) {
                let image = &mut self.workspace.image[..range.len()];
                coarse.static_share = aft.static_share;
                coarse.known_state.clone_from(&self.search.states[p]);
                coarse.periodicity_tolerance = COARSE_PERIODICITY;
                coarse.motion_port_force(port, (omega, homotopy.limit_factor), c, image, Some(&mut *slot));
                coarse.periodicity_tolerance = PERIODICITY_TOLERANCE;
                rough = image.iter().all(|f| f.is_finite());
                if rough {
                    aft = coarse;
                }
            }
            if !rough {
                aft.known_state.clone_from(&self.search.states[p]);
                aft.motion_port_force(port, (omega, homotopy.limit_factor), c, force, Some(slot));
            }
            // a port that sticks throughout was not sampled
            any |= rough && !aft.state.is_empty();
            self.search.states[p].forgetting_inverse.clone_from(&aft.forgetting_inverse);
            self.add_springs(p, port, CLOSED_CONTACT_SIGN + self.proximal_stiffness());
        }
        self.search.linearized = true;
        any
    }

    /// Returns the number of samples of a period, also while the coarse sampling is in use.
    pub fn all_samples(&self) -> usize {
        self.coarse.iter().map(|coarse| coarse.samples()).fold(self.aft.samples(), usize::max)
    }

    /// Tells whether there is a coarse sampling.
    pub fn has_coarse_sampling(&self) -> bool {
        self.coarse.is_some()
    }

    /// Exchanges the samplings: forces and their derivatives use the coarse
    /// one, until the next call.
    pub fn exchange_samples(&mut self) {
        let Some(coarse) = &mut self.coarse else { return };
        coarse.law_steps = self.aft.law_steps;
        std::mem::swap(&mut self.aft, coarse);
    }
}
