//! Coarse sampling of the period, for derivatives of many contacts.

use super::{Discretization, HarmonicSolution, OPEN};
use crate::method::harmonic_balance::aft::{FrequencyTime, Ports, REPEATS, block};
use crate::method::harmonic_balance::globalization::homotopy::Homotopy;

/// The coarse sampling has at least `1/FEWER` of all samples, at least `SKETCHED` samples per
/// wave of the highest harmonic, and at most half of all samples.
///
/// Measured: a Newton step with coarse derivatives leaves 0.01 of the residual; so does the
/// next step with the same derivatives. With five samples per wave, the error of five harmonics
/// of 16 nodes is known to 0.12 instead of 0.05.
const FEWER: usize = 6;
const SKETCHED: usize = 8;
/// Change of the states over a period, relative to their size, at which coarse derivatives are
/// taken. Fewer samples cause an error of this size.
const ALMOST: f64 = 1e-3;

impl Discretization {
    /// Creates the coarse sampling, if it has at most half of all samples.
    pub(in super::super) fn keep_sketch(&mut self) {
        let top = self.harmonics().last().copied().unwrap_or(0);
        let all = self.alternation.samples();
        let least = (SKETCHED * (top + 1)).max(all / FEWER);
        let few = [2, 3].map(|base: usize| base * least.div_ceil(base).next_power_of_two());
        let few = few.into_iter().min().filter(|few| 2 * few <= all);
        self.sketch = few.map(|few| FrequencyTime::new(self.harmonics().to_vec(), few));
    }

    /// Computes the derivatives that [`DerivativeScope::Cheap`] omits, at the motion evaluated last.
    /// With `sketched`, derivatives of return maps use the coarse sampling, if there is one.
    ///
    /// A Newton step with coarse derivatives leaves some thousandths of the residual, which has
    /// all samples itself. Returns whether some derivatives are coarse.
    pub fn follow_slopes(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut HarmonicSolution,
        (ease, sketched): (Homotopy, bool),
    ) -> bool {
        let nh = self.harmonics().len();
        self.alternation.static_share = self.load(ease) / ease.limits;
        let mut any = false;
        for (p, port) in ports.iter().enumerate().filter(|(_, port)| port.marches()) {
            let range = port.first * nh..(port.first + port.axes) * nh;
            let slot = &mut self.tangents[block(&self.blocks, p, port, nh)];
            let (c, force) = (&motion.c[range.clone()], &mut motion.force[range.clone()]);
            let mut alternation = &mut self.alternation;
            let mut rough = false;
            if let Some(sketch) = self.sketch.as_mut().filter(|_| sketched && port.steps()) {
                let image = &mut self.image[..range.len()];
                sketch.static_share = alternation.static_share;
                sketch.begin.clone_from(&self.states[p]);
                sketch.repeats = ALMOST;
                sketch.respond(port, (omega, ease.limits), c, image, Some(&mut *slot));
                sketch.repeats = REPEATS;
                rough = image.iter().all(|f| f.is_finite());
                if rough {
                    alternation = sketch;
                }
            }
            if !rough {
                alternation.begin.clone_from(&self.states[p]);
                alternation.respond(port, (omega, ease.limits), c, force, Some(slot));
            }
            // a port that sticks throughout was not sampled
            any |= rough && !alternation.state.is_empty();
            self.states[p].forgets.clone_from(&alternation.forgets);
            self.add_springs(p, port, OPEN + self.tether_share());
        }
        self.linearised = true;
        any
    }

    /// Returns the number of samples of a period, also while the coarse sampling is in use.
    pub fn all_samples(&self) -> usize {
        self.sketch.iter().map(|sketch| sketch.samples()).fold(self.alternation.samples(), usize::max)
    }

    /// Tells whether there is a coarse sampling.
    pub fn keeps_sketch(&self) -> bool {
        self.sketch.is_some()
    }

    /// Exchanges the samplings: forces and their derivatives use the coarse
    /// one, until the next call.
    pub fn exchange_samples(&mut self) {
        let Some(sketch) = &mut self.sketch else { return };
        sketch.marched = self.alternation.marched;
        std::mem::swap(&mut self.alternation, sketch);
    }
}
