//! The smallest reduction of a given error.

use super::{Deviation, Free, Reduced, ReductionError, ReductionKind, Reference, Whole};
use std::ops::RangeInclusive;
use stickslip_numerics::sparse::{ModesError, NaturalModes};

/// Modes are computed up to these multiples of the frequency of interest, one after the other until a reduction is close enough.
const EXTENTS: [f64; 2] = [1.5, 3.0];
/// The same before all others where there are many ports: an order of residual vectors has a coordinate for every port, and the modes up to these are fewer.
const EXTENTS_OF_MANY: [f64; 2] = [3.0, 6.0];
/// How often the last multiple is doubled for Craig-Bampton where it is asked for, until 600 modes or all are taken: its error falls slowly. Measured
/// on bricks of 144 rows up to 5 kHz: 2e-3 at 48 times that, with 53 modes.
const DOUBLED: i32 = 12;
/// Of these, up to these shares are tried.
const SHARES: [f64; 4] = [0.67, 0.8, 0.9, 1.0];
/// Ports beyond which more modes are tried before more orders, and all modes are taken at once: beside hundreds of residual vectors some modes fewer are
/// no gain.
const MANY: usize = 96;
/// Orders of residual vectors that are tried.
const ORDERS: usize = 3;
/// Numbers of all residual vectors that are held at once: 1 GB.
const NUMBERS: usize = 1 << 27;

/// Orders of residual vectors, fewer where many ports of a large structure would fill the memory with them.
fn orders(whole: &Whole) -> usize {
    (NUMBERS / (whole.dofs() * whole.ports().len()).max(1)).clamp(1, ORDERS)
}

/// What is asked of a reduction.
///
/// # Example
/// ```
/// use std::f64::consts::TAU;
/// use stickslip::structure::reduction::{Damping, Reduce, Whole};
/// use stickslip_numerics::sparse::Matrix;
/// // a rod of 400 masses, held at one end and seen at the other
/// let n = 400;
/// let stiffness = (0..n).flat_map(|i| {
///     let linked = if i > 0 { vec![(i - 1, i - 1, 1e6), (i - 1, i, -1e6), (i, i - 1, -1e6)] } else { vec![] };
///     linked.into_iter().chain([(i, i, 1e6)])
/// });
/// let stiffness = Matrix::from_triplets(n, stiffness)?;
/// let mass = Matrix::from_triplets(n, (0..n).map(|i| (i, i, 0.001)))?;
/// let up_to = TAU * 100.0;
/// let whole = Whole::new(mass, Damping::Ratio { ratio: 0.005, up_to }, stiffness, vec![vec![(n - 1, 1.0)]])?;
/// let chosen = Reduce { up_to, tolerance: 1e-4, kind: None }.of(&whole)?;
/// assert!(chosen.reduced.dofs() < 12 && chosen.deviation.error < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reduce {
    /// The largest frequency of interest, rad/s: of the drive with all harmonics that count.
    pub up_to: f64,
    /// The largest error of the ports' receptance up to there, relative.
    pub tolerance: f64,
    /// Of one kind only, if it is named.
    pub kind: Option<ReductionKind>,
}

/// Modes up to a multiple of the frequency of interest, and the orders of residual vectors that are tried with them.
struct Attempt {
    extent: f64,
    orders: RangeInclusive<usize>,
    /// Whether more follow that try other ways than still more modes.
    early: bool,
}

/// A reduction with its error.
#[derive(Debug, Clone)]
pub struct Chosen {
    /// The structure in few coordinates.
    pub reduced: Reduced,
    /// How far it is from the whole.
    pub deviation: Deviation,
    /// Modes of the whole structure.
    pub modes: NaturalModes,
}

impl Reduce {
    /// The smallest of the reductions tried whose error is small enough: free modes with residual vectors of one to three orders, and if
    /// none of them will do, Craig-Bampton.
    ///
    /// # Errors
    /// [`ReductionError::OutOfReach`] with the best error, or whatever keeps modes from being computed.
    pub fn of(self, whole: &Whole) -> Result<Chosen, ReductionError> {
        for (what, value) in [
            ("the largest frequency of a reduction (rad/s)", self.up_to),
            ("the tolerance of a reduction", self.tolerance),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(ReductionError::Number { what, value, must: "positive" });
            }
        }
        let mut best: Option<(Deviation, usize)> = None;
        let (mut reference, mut last) = (None, None);
        for Attempt { extent, orders, early } in self.attempts(whole) {
            let modes = match whole.modes(extent * self.up_to) {
                // more than are ever taken: fewer modes with more orders
                Err(ReductionError::Modes(ModesError::TooMany { .. })) if early => continue,
                modes => modes?,
            };
            let reference = match &mut reference {
                Some(reference) => reference,
                none => none.insert(Reference::new(whole, &modes, self.up_to)?),
            };
            let mut good = |reduced: &Reduced| {
                let deviation = reference.deviation(reduced);
                if best.is_none_or(|(least, _)| deviation.error < least.error) {
                    best = Some((deviation, reduced.dofs()));
                }
                (deviation.error <= self.tolerance).then_some(deviation)
            };
            if self.kind != Some(ReductionKind::CraigBampton) && !orders.is_empty() {
                let free = Free::new(whole, &modes, 0.0, *orders.end())?;
                for (count, order) in self.sizes(&modes, (extent, orders.clone()), whole) {
                    let reduced = match free.reduced(count, order) {
                        Ok(reduced) => reduced,
                        // vectors of which only rounding tells the last apart: other numbers of them have no such one
                        Err(ReductionError::OutOfRange) => continue,
                        Err(other) => return Err(other),
                    };
                    if let Some(deviation) = good(&reduced) {
                        return Ok(Chosen { reduced, deviation, modes });
                    }
                }
            }
            if self.kind == Some(ReductionKind::Rubin) || early {
                continue;
            }
            match whole.craig_bampton(extent * self.up_to) {
                Ok(reduced) => {
                    if let Some(deviation) = good(&reduced) {
                        return Ok(Chosen { reduced, deviation, modes });
                    }
                }
                // ports that do not hold the structure leave the free modes
                Err(ReductionError::NotHeld { .. }) if self.kind.is_none() => {}
                Err(other) => return Err(other),
            }
            last = Some(modes);
        }
        if let (Some(ReductionKind::CraigBampton), Some(reference), Some(modes)) = (self.kind, reference, last) {
            for doubled in 1..=DOUBLED {
                let extent = EXTENTS[EXTENTS.len() - 1] * 2.0f64.powi(doubled);
                let reduced = match whole.craig_bampton(extent * self.up_to) {
                    Ok(reduced) => reduced,
                    // more than are ever taken
                    Err(ReductionError::Modes(ModesError::TooMany { .. })) => break,
                    Err(other) => return Err(other),
                };
                let deviation = reference.deviation(&reduced);
                if deviation.error <= self.tolerance {
                    return Ok(Chosen { reduced, deviation, modes });
                }
                if best.is_none_or(|(least, _)| deviation.error < least.error) {
                    best = Some((deviation, reduced.dofs()));
                }
                if reduced.dofs() == whole.dofs() {
                    break;
                }
            }
        }
        let (least, dofs) = best.unwrap_or((Deviation { error: f64::INFINITY, omega: self.up_to }, 0));
        Err(ReductionError::OutOfReach { best: least.error, at: least.omega, dofs, tolerance: self.tolerance })
    }

    /// What is tried, the cheapest first.
    fn attempts(self, whole: &Whole) -> Vec<Attempt> {
        let all = orders(whole);
        let many = whole.ports().len() > MANY && self.kind != Some(ReductionKind::CraigBampton);
        let first = EXTENTS_OF_MANY.into_iter().filter(|_| many).map(|extent| (extent, 1..=1, true));
        let usual = EXTENTS.into_iter().map(|extent| (extent, if many { 2 } else { 1 }..=all, false));
        first.chain(usual).map(|(extent, orders, early)| Attempt { extent, orders, early }).collect()
    }

    /// Numbers of modes and orders of residual vectors to try, the smallest first.
    fn sizes(
        self,
        modes: &NaturalModes,
        (extent, orders): (f64, RangeInclusive<usize>),
        whole: &Whole,
    ) -> Vec<(usize, usize)> {
        let ports = whole.ports().len();
        let count = |share: f64| {
            let bound = (share * extent * self.up_to).powi(2);
            if share < 1.0 { modes.values.partition_point(|value| *value <= bound) } else { modes.count() }
        };
        let shares = if ports > MANY { &SHARES[SHARES.len() - 1..] } else { &SHARES[..] };
        let mut sizes: Vec<(usize, usize)> =
            orders.flat_map(|order| shares.iter().map(move |share| (count(*share), order))).collect();
        sizes.sort_by_key(|&(count, order)| (count + order * ports, order));
        sizes.dedup();
        sizes
    }
}
