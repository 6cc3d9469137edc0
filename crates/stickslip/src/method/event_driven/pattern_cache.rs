//! Cache of the patterns of a motion, with a memory limit.
//!
//! A structure with `s` sliders has `2^s` patterns, and each takes some multiples of n²
//! numbers. One return uses few of them, and the next return uses mostly the same ones.
//! Therefore the cache drops the least recently used patterns first. A recomputed pattern has
//! the same bits, so that the cache affects computing time only.

use super::mechanics::Mechanics;
use super::pattern::{ForcedResponse, Pattern};
use crate::law::Contact;
use crate::method::flow::excitation::HarmonicExcitation;
use std::collections::BTreeMap;
use std::sync::Arc;
use stickslip_numerics::quadratic_modes::DefectiveModes;

struct CachedPattern {
    pattern: Arc<Pattern>,
    /// Response to the present excitation, computed at the first use of the pattern under it.
    driven: Option<Arc<ForcedResponse>>,
    /// Time of the last use, as a counter of all uses.
    used: u64,
    bytes: usize,
}

/// Patterns by their stuck parts.
pub(super) struct PatternCache {
    slots: BTreeMap<Vec<bool>, CachedPattern>,
    bytes: usize,
    limit: usize,
    uses: u64,
    /// Key of the requested pattern.
    stuck: Vec<bool>,
}

impl Default for PatternCache {
    fn default() -> Self {
        // Memory limit in bytes, for each of the flows that run in parallel. A return of a ring of
        // 48 blades uses one to two hundred patterns of a quarter of a megabyte.
        PatternCache { slots: BTreeMap::new(), bytes: 0, limit: 64 << 20, uses: 0, stuck: Vec::new() }
    }
}

impl PatternCache {
    /// Returns the pattern of these contacts, with its response to the excitation.
    pub fn pattern(
        &mut self,
        mechanics: &Mechanics,
        excitation: &HarmonicExcitation,
        contacts: &[Contact],
    ) -> Result<(Arc<Pattern>, Arc<ForcedResponse>), DefectiveModes> {
        self.stuck.clear();
        self.stuck.extend(contacts.iter().map(|contact| *contact == Contact::Stick));
        self.uses += 1;
        if let Some(CachedPattern { pattern, driven: Some(driven), used, .. }) = self.slots.get_mut(&self.stuck) {
            *used = self.uses;
            return Ok((pattern.clone(), driven.clone()));
        }
        let stuck = self.stuck.clone();
        let pattern = match self.slots.remove(&stuck) {
            Some(slot) => {
                self.bytes -= slot.bytes;
                slot.pattern
            }
            None => Arc::new(Pattern::new(mechanics, &stuck)?),
        };
        let driven = Arc::new(pattern.excitation(mechanics, excitation));
        let bytes = pattern.bytes() + driven.bytes();
        if self.bytes + bytes > self.limit {
            self.evict(self.limit / 2);
        }
        self.bytes += bytes;
        let slot = CachedPattern { pattern: pattern.clone(), driven: Some(driven.clone()), used: self.uses, bytes };
        self.slots.insert(stuck, slot);
        Ok((pattern, driven))
    }

    /// Drops all data that depend on the excitation.
    pub fn change_drive(&mut self) {
        self.slots.values_mut().for_each(|slot| slot.driven = None);
    }

    /// Drops the least recently used patterns until the others use at most `bytes`.
    fn evict(&mut self, bytes: usize) {
        let mut uses: Vec<(u64, usize)> = self.slots.values().map(|slot| (slot.used, slot.bytes)).collect();
        uses.sort_unstable();
        let mut oldest = 0;
        for (used, size) in uses {
            if self.bytes <= bytes {
                break;
            }
            self.bytes -= size;
            oldest = used;
        }
        self.slots.retain(|_, slot| slot.used > oldest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Jenkins;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring};
    use std::sync::Arc;

    /// A chain of masses, each with its slider.
    fn chain(n: usize) -> (Mechanics, HarmonicExcitation) {
        let name = |i: usize| format!("m{i}");
        let before = |i: usize| if i == 0 { GROUND.to_owned() } else { name(i - 1) };
        let model = Model {
            masses: (0..n).map(|i| Mass::new(name(i), 1.0 + 0.1 * i as f64)).collect(),
            springs: (0..n)
                .map(|i| Spring { between: [before(i), name(i)], stiffness: 100.0 + i as f64, damping: 0.1 })
                .collect(),
            joints: (0..n)
                .map(|i| Joint {
                    name: format!("j{i}"),
                    between: [name(i), GROUND.to_owned()],
                    law: Arc::new(Jenkins { stiffness: 50.0, limit: 1.0 }),
                })
                .collect(),
            forces: vec![Force { on: name(0), amplitude: 1.0, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let mechanics = Mechanics::new(&system, "test").unwrap();
        let excitation = HarmonicExcitation::new(&system, &mechanics.part_joints(), 3.0);
        (mechanics, excitation)
    }

    fn contacts(n: usize, number: usize) -> Vec<Contact> {
        (0..n).map(|i| if number >> i & 1 == 1 { Contact::SlipForward } else { Contact::Stick }).collect()
    }

    /// With more patterns than fit, the memory stays below the limit and equals that of the
    /// stored patterns. The most recent ones remain available, and a dropped pattern is
    /// recomputed with the same numbers.
    #[test]
    fn memory_stays_below_its_limit() {
        let n = 8;
        let (mechanics, excitation) = chain(n);
        let mut memory = PatternCache::default();
        let (first, _) = memory.pattern(&mechanics, &excitation, &contacts(n, 0)).unwrap();
        let one = memory.bytes;
        assert!(one > 16 * n * n && one < 16 * 40 * n * n, "{one} bytes for a pattern of {n} places");
        memory.limit = 20 * one;
        for number in 0..1 << n {
            memory.pattern(&mechanics, &excitation, &contacts(n, number)).unwrap();
            assert!(memory.bytes <= memory.limit, "{} bytes", memory.bytes);
            assert_eq!(memory.bytes, memory.slots.values().map(|slot| slot.bytes).sum::<usize>());
        }
        let kept = memory.slots.len();
        assert!((10..=21).contains(&kept), "{kept}");
        let stuck = |number: usize| contacts(n, number).iter().map(|c| *c == Contact::Stick).collect::<Vec<_>>();
        assert!((246..256).all(|number| memory.slots.contains_key(&stuck(number))), "the last ten are there");
        assert!(!memory.slots.contains_key(&stuck(0)));
        let (again, _) = memory.pattern(&mechanics, &excitation, &contacts(n, 0)).unwrap();
        assert_eq!(again.lambda, first.lambda);
        assert_eq!(again.shape, first.shape);
    }

    /// Slip directions share a pattern. A change of the excitation recomputes only the
    /// response.
    #[test]
    fn directions_share_a_pattern() {
        let (mechanics, excitation) = chain(3);
        let mut memory = PatternCache::default();
        let (forward, driven) = memory.pattern(&mechanics, &excitation, &[Contact::SlipForward; 3]).unwrap();
        let (backward, _) = memory.pattern(&mechanics, &excitation, &[Contact::SlipBackward; 3]).unwrap();
        assert!(Arc::ptr_eq(&forward, &backward));
        memory.change_drive();
        let (again, other) = memory.pattern(&mechanics, &excitation, &[Contact::SlipForward; 3]).unwrap();
        assert!(Arc::ptr_eq(&forward, &again) && !Arc::ptr_eq(&driven, &other));
        assert_eq!(memory.bytes, memory.slots.values().map(|slot| slot.bytes).sum::<usize>());
    }
}
