//! The same period by fewer samples, for derivatives of many contacts.

use super::super::ease::Ease;
use super::super::ports::{Alternation, Ports, REPEATS, block};
use super::{Level, OPEN, Solution};

/// All samples for one of a sketch, at most, and how many a sketch has at least for the wave of the highest harmonic; it has half of all at most.
/// Measured: a step by so few leaves 0.01 of the residual, which the next one by the same leaves of that; with five for the wave the error that five harmonics leave
/// of 16 nodes is known to 0.12 instead of 0.05.
const FEWER: usize = 6;
const SKETCHED: usize = 8;
/// Distance of the states from those a period later, relative to their size, at which sketched derivatives are taken: what fewer samples leave out.
const ALMOST: f64 = 1e-3;

impl Level {
    /// Keeps fewer samples beside all, if that is enough for a sketch.
    pub(in super::super) fn keep_sketch(&mut self) {
        let top = self.harmonics().last().copied().unwrap_or(0);
        let all = self.alternation.samples();
        let least = (SKETCHED * (top + 1)).max(all / FEWER);
        let few = [2, 3].map(|base: usize| base * least.div_ceil(base).next_power_of_two());
        let few = few.into_iter().min().filter(|few| 2 * few <= all);
        self.sketch = few.map(|few| Alternation::new(self.harmonics().to_vec(), few));
    }

    /// The derivatives that [`Slopes::Cheap`] left out, at the motion that was evaluated last. If they are `sketched` those of return maps are taken by
    /// fewer samples, where the level has such: a step of Newton's method by them leaves some thousandths of the residual, whose own samples are all
    /// there. Whether some are so.
    pub fn follow_slopes(
        &mut self,
        ports: &Ports,
        omega: f64,
        motion: &mut Solution,
        (ease, sketched): (Ease, bool),
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
            // what holds was not sampled
            any |= rough && !alternation.state.is_empty();
            self.states[p].forgets.clone_from(&alternation.forgets);
            self.add_springs(p, port, OPEN + self.tether_share());
        }
        self.linearised = true;
        any
    }

    /// Samples of a period, also while those of a sketch stand in for them.
    pub fn all_samples(&self) -> usize {
        self.sketch.iter().map(|sketch| sketch.samples()).fold(self.alternation.samples(), usize::max)
    }

    /// Whether there are fewer samples beside all.
    pub fn keeps_sketch(&self) -> bool {
        self.sketch.is_some()
    }

    /// The sketch becomes what is sampled, and back: forces by fewer samples then, and derivatives that are theirs.
    pub fn exchange_samples(&mut self) {
        let Some(sketch) = &mut self.sketch else { return };
        sketch.marched = self.alternation.marched;
        std::mem::swap(&mut self.alternation, sketch);
    }
}
