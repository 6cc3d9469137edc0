//! Selects the smallest reduction with a given error.

use super::{
    FullStructure, ReducedMatrices, ReductionDeviation, ReductionError, ReductionKind, ReferenceReceptance, RubinBasis,
};
use std::ops::RangeInclusive;
use stickslip_numerics::sparse::{ModesError, NaturalModes};

/// Modes are computed up to these multiples of the frequency of interest, one after the other,
/// until a reduction reaches the tolerance.
const EXTENTS: [f64; 2] = [1.5, 3.0];
/// Number of ports above which more modes are tried before more orders, and all modes are used
/// at once. Compared with hundreds of residual vectors, fewer modes save little.
const MANY_PORTS: usize = 96;

/// Returns the largest order of residual vectors, reduced for large structures with many ports
/// to limit memory.
fn orders(whole: &FullStructure) -> usize {
    // At most 2²⁷ numbers in all residual vectors, 1 GB, and the order three.
    ((1 << 27) / (whole.dofs() * whole.ports().len()).max(1)).clamp(1, 3)
}

/// Parameters of an automatic reduction.
///
/// # Example
/// ```
/// use std::f64::consts::TAU;
/// use stickslip::structure::reduction::{AutomaticReduction, FullStructure, StructureDamping};
/// use stickslip_numerics::sparse::SparseMatrix;
/// // a rod of 400 masses, held at one end and seen at the other
/// let n = 400;
/// let stiffness = (0..n).flat_map(|i| {
///     let linked = if i > 0 {
///         vec![(i - 1, i - 1, 1e6), (i - 1, i, -1e6), (i, i - 1, -1e6)]
///     } else {
///         vec![]
///     };
///     linked.into_iter().chain([(i, i, 1e6)])
/// });
/// let stiffness = SparseMatrix::from_triplets(n, stiffness)?;
/// let mass = SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 0.001)))?;
/// let up_to = TAU * 100.0;
/// let whole = FullStructure::new(
///     mass,
///     StructureDamping::Ratio { ratio: 0.005, up_to },
///     stiffness,
///     vec![vec![(n - 1, 1.0)]],
/// )?;
/// let chosen = AutomaticReduction { up_to, tolerance: 1e-4, kind: None }.apply(&whole)?;
/// assert!(chosen.reduced.dofs() < 12 && chosen.deviation.error < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AutomaticReduction {
    /// Highest frequency of interest, rad/s, including all significant harmonics of the
    /// excitation.
    pub up_to: f64,
    /// Largest relative error of the ports' receptance up to this frequency.
    pub tolerance: f64,
    /// Kind of reduction; `None` allows all.
    pub kind: Option<ReductionKind>,
}

/// Modes up to a multiple of the frequency of interest, with the orders of residual vectors to
/// try.
struct Attempt {
    extent: f64,
    orders: RangeInclusive<usize>,
    /// True if later attempts use other options than more modes.
    has_alternative: bool,
}

/// A reduction with its error.
#[derive(Debug, Clone)]
pub struct SelectedReduction {
    /// The reduced structure.
    pub reduced: ReducedMatrices,
    /// Its error relative to the whole structure.
    pub deviation: ReductionDeviation,
    /// Modes of the whole structure.
    pub modes: NaturalModes,
}

impl AutomaticReduction {
    /// Returns the smallest of the tried reductions whose error is within the tolerance.
    ///
    /// It tries free modes with residual vectors of one to three orders, then Craig-Bampton.
    ///
    /// # Errors
    /// [`ReductionError::ToleranceNotReached`] with the smallest error, or the error of the mode
    /// computation.
    pub fn apply(self, whole: &FullStructure) -> Result<SelectedReduction, ReductionError> {
        for (what, value) in [
            ("the largest frequency of a reduction (rad/s)", self.up_to),
            ("the tolerance of a reduction", self.tolerance),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(ReductionError::Number { what, value, must: "positive" });
            }
        }
        let mut best: Option<(ReductionDeviation, usize)> = None;
        let (mut reference, mut last) = (None, None);
        for Attempt { extent, orders, has_alternative } in self.attempts(whole) {
            let modes = match whole.modes(extent * self.up_to) {
                // too many modes; a later attempt uses fewer modes with more orders
                Err(ReductionError::Modes(ModesError::TooMany { .. })) if has_alternative => continue,
                modes => modes?,
            };
            let reference = match &mut reference {
                Some(reference) => reference,
                none => none.insert(ReferenceReceptance::new(whole, &modes, self.up_to)?),
            };
            let mut good = |reduced: &ReducedMatrices| {
                let deviation = reference.deviation(reduced);
                if best.is_none_or(|(least, _)| deviation.error < least.error) {
                    best = Some((deviation, reduced.dofs()));
                }
                (deviation.error <= self.tolerance).then_some(deviation)
            };
            if self.kind != Some(ReductionKind::CraigBampton) && !orders.is_empty() {
                let free = RubinBasis::new(whole, &modes, 0.0, *orders.end())?;
                for (count, order) in self.sizes(&modes, (extent, orders.clone()), whole) {
                    let reduced = match free.reduced(count, order) {
                        Ok(reduced) => reduced,
                        // rounding dominates the last vectors; another number of vectors can
                        // avoid this
                        Err(ReductionError::OutOfRange) => continue,
                        Err(other) => return Err(other),
                    };
                    if let Some(deviation) = good(&reduced) {
                        return Ok(SelectedReduction { reduced, deviation, modes });
                    }
                }
            }
            if self.kind == Some(ReductionKind::Rubin) || has_alternative {
                continue;
            }
            match whole.craig_bampton(extent * self.up_to) {
                Ok(reduced) => {
                    if let Some(deviation) = good(&reduced) {
                        return Ok(SelectedReduction { reduced, deviation, modes });
                    }
                }
                // if the fixed ports leave free motions, only free modes remain
                Err(ReductionError::FreeInterfaceMotion { .. }) if self.kind.is_none() => {}
                Err(other) => return Err(other),
            }
            last = Some(modes);
        }
        if let (Some(ReductionKind::CraigBampton), Some(reference), Some(modes)) = (self.kind, reference, last) {
            // Number of times that the last multiple is doubled for a requested Craig-Bampton
            // reduction, up to 600 modes or all modes. Its error decreases slowly. Measured on
            // bricks of 144 rows up to 5 kHz: 2e-3 at 48 times that frequency, with 53 modes.
            for doubled in 1..=12 {
                let extent = EXTENTS[EXTENTS.len() - 1] * 2.0f64.powi(doubled);
                let reduced = match whole.craig_bampton(extent * self.up_to) {
                    Ok(reduced) => reduced,
                    // too many modes
                    Err(ReductionError::Modes(ModesError::TooMany { .. })) => break,
                    Err(other) => return Err(other),
                };
                let deviation = reference.deviation(&reduced);
                if deviation.error <= self.tolerance {
                    return Ok(SelectedReduction { reduced, deviation, modes });
                }
                if best.is_none_or(|(least, _)| deviation.error < least.error) {
                    best = Some((deviation, reduced.dofs()));
                }
                if reduced.dofs() == whole.dofs() {
                    break;
                }
            }
        }
        let (least, dofs) = best.unwrap_or((ReductionDeviation { error: f64::INFINITY, omega: self.up_to }, 0));
        Err(ReductionError::ToleranceNotReached { best: least.error, at: least.omega, dofs, tolerance: self.tolerance })
    }

    /// Returns the attempts, the cheapest first.
    fn attempts(self, whole: &FullStructure) -> Vec<Attempt> {
        let all = orders(whole);
        let many = whole.ports().len() > MANY_PORTS && self.kind != Some(ReductionKind::CraigBampton);
        // Multiples that are tried first if there are many ports. One order of residual vectors
        // adds a coordinate per port, more than the modes up to these multiples.
        let first = [3.0, 6.0].into_iter().filter(|_| many).map(|extent| (extent, 1..=1, true));
        let usual = EXTENTS.into_iter().map(|extent| (extent, if many { 2 } else { 1 }..=all, false));
        first
            .chain(usual)
            .map(|(extent, orders, has_alternative)| Attempt { extent, orders, has_alternative })
            .collect()
    }

    /// Returns the numbers of modes and orders of residual vectors to try, the smallest total
    /// first.
    fn sizes(
        self,
        modes: &NaturalModes,
        (extent, orders): (f64, RangeInclusive<usize>),
        whole: &FullStructure,
    ) -> Vec<(usize, usize)> {
        // Fractions of each multiple that are tried.
        let shares = [0.67, 0.8, 0.9, 1.0];
        let ports = whole.ports().len();
        let count = |share: f64| {
            let bound = (share * extent * self.up_to).powi(2);
            if share < 1.0 { modes.values.partition_point(|value| *value <= bound) } else { modes.count() }
        };
        let shares = if ports > MANY_PORTS { &shares[shares.len() - 1..] } else { &shares[..] };
        let mut sizes: Vec<(usize, usize)> =
            orders.flat_map(|order| shares.iter().map(move |share| (count(*share), order))).collect();
        sizes.sort_by_key(|&(count, order)| (count + order * ports, order));
        sizes.dedup();
        sizes
    }
}
