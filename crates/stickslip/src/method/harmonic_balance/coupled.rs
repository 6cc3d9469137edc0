//! Newton's step where the structure couples many joints: the derivative `δ r_y - r_u R f_y` is multiplied with, and not formed.
//!
//! Laws couple harmonics, the structure joints. Products need both one after the other, and a solution by minimal residuals takes a few tens of them if
//! one knows roughly what it is. That is the same equations with the mean stiffness of every joint over the period:
//! - per harmonic, each with the mean stiffness that it sees: a complex matrix over the axes, factored in every step; few joints with long series, where
//!   rigid friction couples the lowest harmonics by more than their mean, have a matrix of all these together;
//! - of large structures in their modes, `R = S + Φ diag(g) Φᵀ`: what modes far above the harmonics add, S, is the same for all of these, and so is the
//!   factor of `1 + S K` with one stiffness for all; the others enter it by as many rows as they are (Woodbury). It is kept from step to step and from
//!   frequency to frequency for as long as it helps.
//!
//! Memory: per harmonic two complex matrices over the axes, or in modes two real ones over the axes and one over axes and modes.

use super::ease::SOLVED;
use super::linear::Linear;
use super::ports::{MANY_DIRECTIONS, Port, Ports};
use super::receptance::{Modal, Receptance};
use super::rest::CACHED;
use nalgebra::DMatrix;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::complex_gemv::ComplexGemv;
use stickslip_numerics::dense::{ComplexLu, DenseLu, ProductShape, Transpose, multiply_blocked};
use stickslip_numerics::gmres::{Gmres, GmresLimits};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Unknowns from which products are faster than elimination, whose derivatives are by all samples: of 8 and 10 nodes of three directions with six harmonics, 288
/// and 360 unknowns, a point takes 2.4 and 3.2 ms instead of 5.7 and 8.0. Rigid friction, whose lowest harmonics are eliminated in any case, has its own.
const MANY: usize = 200;
const MANY_OF_FORCES: usize = 400;
/// Unknowns up to which a matrix is formed all the same where products do not lead to the step: 130 MB, seconds.
pub(super) const FORMED: usize = 4096;
/// The same for few directions with rigid friction, whose series are long: a step of 10 joints with 128 harmonics, 2560 unknowns, takes 80 products, an
/// eighth of its elimination.
const LONG: usize = 2048;
/// Unknowns of the lowest harmonics that are eliminated together to precondition such a step. With a quarter of the harmonics it takes 80 products, with
/// an eighth 150, and with none, each by its mean, it is not found in hundreds.
const LOWEST: usize = 1000;
/// Whether a level with so many unknowns along the ports is solved by products.
pub(super) fn by_products(size: usize, ports: &Ports) -> bool {
    let many = if ports.has_forces() { MANY_OF_FORCES } else { MANY };
    let many = size >= many && ports.count() >= MANY_DIRECTIONS;
    size > FORMED || many || (size > LONG && ports.has_forces())
}

/// Share of Newton's residual to which its equations are solved, and at most: derivatives of laws cost as much as tens of products, so that fewer steps
/// count for more.
const SHARE: f64 = 0.1;
const COARSEST: f64 = 1e-6;
/// The same at most by products with modes, which cost more than derivatives do: of 1000 nodes one takes 50 ms, all derivatives 0.3 s.
const COARSEST_OF_MODES: f64 = 1e-2;
/// The same at least by derivatives that are sketched, which are off by as much. Measured: with a tenth of it a point of 16 nodes takes 2 % longer.
const FINEST_OF_SKETCHES: f64 = 1e-2;
/// Vectors that are kept, and products in all.
const VECTORS: usize = 80;
const PRODUCTS: usize = 320;
/// Residual of Newton's equations up to which a step is one.
const USEFUL: f64 = 0.1;
/// Products beyond which a preconditioner that was kept is made anew.
const STALE: usize = 25;
/// Products that steps took more than the one for which a preconditioner was made, together, beyond which it is not kept for the next: a new one costs as much.
const PAID: usize = 10;
/// Modes with frequencies above this multiple of the highest harmonic answer it nearly as at rest.
const ABOVE: f64 = 3.0;

/// What modes above a bound add, of a split that was given up.
type Above = (f64, Arc<Vec<f64>>);

/// What Newton's steps by products keep.
#[derive(Debug, Clone, Default)]
pub(super) struct Coupled {
    gmres: Gmres,
    /// Of receptances that are matrices, by the derivatives of this motion or of one nearby.
    harmonics: Option<Harmonics>,
    split: Option<Split>,
    above: Option<Above>,
    /// Unknowns as forces, and what they move.
    force: Vec<Complex64>,
    moved: Vec<Complex64>,
    /// Those of one port, real and imaginary parts.
    parts: Vec<f64>,
}

/// Where a step of Newton's method begins.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    /// The yardstick of motions there, m, see `Level::length`.
    pub length: f64,
    /// The size of the residual.
    pub residual: f64,
    /// Whether derivatives, or all that is solved, are by fewer samples, see `Level::follow_slopes`.
    pub sketched: bool,
    /// Whether they are those of the last step, whose preconditioner is theirs too.
    pub kept: bool,
}

impl Coupled {
    /// Memory of what is kept to precondition steps, bytes.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> usize {
        let Some(Harmonics { lowest, others, .. }) = &self.harmonics else { return 0 };
        let of = |answer: &Answer| match answer {
            Answer::Inverse(inverse) => inverse.bytes(),
            Answer::Factor(factor) => factor.bytes(),
        };
        others.iter().map(of).sum::<usize>() + lowest.transposed.bytes()
    }

    /// The Newton step from the residual in units, in `step`, into it. Whether it was found, and the products that it took; a step that was not found
    /// is the residual still.
    pub(super) fn step(
        &mut self,
        linear: &Linear<'_>,
        receptance: &mut Receptance,
        step: &mut [f64],
        near: Near,
    ) -> (bool, usize) {
        let coarsest = if matches!(receptance, Receptance::Modal(_)) { COARSEST_OF_MODES } else { COARSEST };
        let (residual, finest) = (near.residual, if near.sketched { FINEST_OF_SKETCHES } else { 0.0 });
        let wanted = (SHARE * residual).min(coarsest).max(SHARE * SOLVED / residual.max(SOLVED)).max(finest);
        let limits = GmresLimits { tolerance: wanted, restart: VECTORS, products: PRODUCTS };
        let right = step.to_vec();
        let (mut fresh, mut products) = (false, 0);
        let Coupled { gmres, harmonics, split, above, force, moved, parts } = self;
        // where forces are unknown the lowest harmonics are coupled by which samples slip
        harmonics.take_if(|_| !near.kept && linear.ports.has_forces());
        let found = loop {
            let Some(preconditioner) =
                linear.preconditioner(receptance, (&mut *harmonics, &mut *split, &mut *above), &mut fresh)
            else {
                break false;
            };
            let most = if fresh { limits } else { GmresLimits { products: STALE, restart: STALE, ..limits } };
            let outcome = gmres.solve(
                step,
                most,
                |v, out| linear.multiply(receptance, (&mut *force, &mut *moved, &mut *parts), v, out),
                |v| preconditioner.apply(linear, v),
            );
            products += outcome.products;
            if let Some(known) = harmonics.as_mut().filter(|_| fresh) {
                known.products = outcome.products;
            }
            harmonics.take_if(|known| {
                known.excess += outcome.products.saturating_sub(known.products);
                known.excess > PAID
            });
            if fresh || outcome.solved {
                break outcome.solved || outcome.residual <= USEFUL;
            }
            // a stiffness of another motion
            *harmonics = None;
            *above = split.take().map(|split| (split.bound, split.above));
            step.copy_from_slice(&right);
        };
        if !found {
            step.copy_from_slice(&right);
        }
        (found && step.iter().all(|d| d.is_finite()), products)
    }
}

/// Numbers of the factor of the lowest harmonics, where these are eliminated together.
pub(super) fn of_lowest(ports: &Ports, harmonics: usize) -> usize {
    (2 * ports.count() * lowest(ports, harmonics)).pow(2)
}

/// How many of the lowest harmonics are eliminated together: of none if there would be no two of them.
fn lowest(ports: &Ports, harmonics: usize) -> usize {
    let count = if ports.has_forces() { LOWEST / (2 * ports.count()) } else { 0 };
    if count < 2 { 0 } else { count.min(harmonics) }
}

impl Linear<'_> {
    /// The derivative times a step, both in units.
    fn multiply(
        &self,
        receptance: &mut Receptance,
        (force, moved, parts): (&mut Vec<Complex64>, &mut Vec<Complex64>, &mut Vec<f64>),
        v: &[f64],
        out: &mut [f64],
    ) {
        let nh = self.harmonics.len();
        let pair = 2 * nh;
        force.resize(v.len() / 2, ZERO);
        moved.resize(v.len() / 2, ZERO);
        // f_y
        for (p, port) in self.ports.iter().enumerate() {
            let wide = pair * port.axes;
            let unit = port.unit(self.length);
            let v = &v[port.first * pair..][..wide];
            let force = &mut force[port.first * nh..][..wide / 2];
            if port.is_force() {
                force.iter_mut().zip(v.chunks_exact(2)).for_each(|(f, v)| *f = Complex64::new(v[0], v[1]) * unit);
                continue;
            }
            parts.resize(wide, 0.0);
            // row after row it is the transpose
            multiply_blocked(
                v,
                self.tangent(p, port),
                parts,
                ProductShape { rows: 1, inner: wide, columns: wide },
                Transpose::No,
            );
            force.iter_mut().zip(parts.chunks_exact(2)).for_each(|(f, z)| *f = Complex64::new(z[0], z[1]) * unit);
        }
        receptance.apply(force, moved);
        for (p, port) in self.ports.iter().enumerate() {
            let wide = pair * port.axes;
            let range = port.first * pair..port.first * pair + wide;
            let unit = port.unit(self.length);
            let (v, out, units) = (&v[range.clone()], &mut out[range.clone()], &self.units[range]);
            let moved = &moved[port.first * nh..][..wide / 2];
            if !port.is_force() {
                for (i, out) in out.iter_mut().enumerate() {
                    let u = moved[i / 2];
                    *out = (unit * v[i] + if i % 2 == 0 { u.re } else { u.im }) / units[i];
                }
                continue;
            }
            // λ less T of what changes in λ + ε u', u = -R f
            let penalty = self.penalty[p];
            let changed: Vec<f64> = moved
                .iter()
                .enumerate()
                .flat_map(|(i, u)| {
                    let rate =
                        if penalty.is_finite() { penalty * self.harmonics[i % nh] as f64 * self.omega } else { 0.0 };
                    let z = Complex64::new(v[2 * i], v[2 * i + 1]) * unit - Complex64::new(0.0, rate) * u;
                    [z.re, z.im]
                })
                .collect();
            for (i, (out, row)) in out.iter_mut().zip(self.tangent(p, port).chunks_exact(wide)).enumerate() {
                let kept = 1.0 + self.ease.stay(self.harmonics[i % pair / 2]);
                *out = (kept * unit * v[i] - dot(row, &changed)) / units[i];
            }
        }
    }

    /// What the tangent of a port does to harmonic number `k` on the whole, between two of its axes.
    fn mean(&self, tangent: &[f64], axes: usize, (a, b): (usize, usize), k: usize) -> Complex64 {
        let pair = 2 * self.harmonics.len();
        let wide = pair * axes;
        let at = |i: usize, j: usize| tangent[(a * pair + 2 * k + i) * wide + b * pair + 2 * k + j];
        if self.harmonics[k] == 0 {
            return Complex64::new(at(0, 0), 0.0);
        }
        Complex64::new(at(0, 0) + at(1, 1), at(1, 0) - at(0, 1)) * 0.5
    }

    /// `None` if it has no factor. `fresh` becomes whether it is of this motion.
    fn preconditioner<'b>(
        &self,
        receptance: &Receptance,
        (harmonics, kept, above): (&'b mut Option<Harmonics>, &'b mut Option<Split>, &mut Option<Above>),
        fresh: &mut bool,
    ) -> Option<Preconditioner<'b>> {
        match receptance {
            Receptance::Formed(formed) => {
                *fresh = harmonics.is_none();
                if harmonics.is_none() {
                    let lowest = self.lowest(&formed.matrices)?;
                    let rest = formed.matrices.iter().enumerate().skip(lowest.count);
                    let others = rest.map(|(k, matrix)| self.of_harmonic(k, matrix)).collect::<Option<_>>()?;
                    *harmonics = Some(Harmonics { lowest, others, products: 0, excess: 0 });
                }
                harmonics.as_ref().map(Preconditioner::Harmonics)
            }
            Receptance::Modal(modal) => {
                let (bound, usable) = (Split::bound(modal), kept.take());
                let usable = usable.filter(|split| split.bound == bound);
                *fresh = usable.is_none();
                let mut split = match usable {
                    Some(split) => split,
                    None => Split::new(
                        modal,
                        (bound, above.take().filter(|(of, _)| *of == bound).map(|(_, above)| above)),
                        |p, port, a, b| {
                            let tangent = self.tangent(p, port);
                            let (first, count) = (usize::from(modal.closed.is_some()), self.harmonics.len());
                            let means = (first..count).map(|k| self.mean(tangent, port.axes, (a, b), k).re);
                            means.sum::<f64>() / (count - first).max(1) as f64
                        },
                        self.ports,
                    )?,
                };
                split.drive(modal)?;
                Some(Preconditioner::Split(kept.insert(split)))
            }
        }
    }

    /// The equations of the lowest harmonics, factored, where forces are unknown.
    fn lowest(&self, receptance: &[DMatrix<Complex64>]) -> Option<Lowest> {
        let count = lowest(self.ports, self.harmonics.len());
        let mut matrix = Vec::new();
        self.matrix(receptance, count, (&mut Vec::new(), &mut matrix));
        // row after row it is the transpose
        let transposed = DenseLu::new(matrix, 2 * count * self.ports.count()).ok()?;
        Some(Lowest { count, transposed })
    }

    /// The equations of one harmonic with the mean tangents, factored.
    fn of_harmonic(&self, k: usize, receptance: &DMatrix<Complex64>) -> Option<Answer> {
        let size = receptance.nrows();
        let moved = |q: usize| &receptance.as_slice()[q * size..][..size];
        let mut matrix = vec![ZERO; size * size];
        // R f_y
        for (p, port) in self.ports.iter().enumerate() {
            for b in 0..port.axes {
                let column = &mut matrix[(port.first + b) * size..][..size];
                if port.is_force() {
                    column.copy_from_slice(moved(port.first + b));
                    continue;
                }
                for a in 0..port.axes {
                    let stiffness = self.mean(self.tangent(p, port), port.axes, (a, b), k);
                    column.iter_mut().zip(moved(port.first + a)).for_each(|(out, r)| *out += r * stiffness);
                }
            }
        }
        let h = self.harmonics[k];
        for (p, port) in self.ports.iter().enumerate() {
            if !port.is_force() {
                port.range().for_each(|q| matrix[q * size + q] += 1.0);
                continue;
            }
            let penalty = self.penalty[p];
            let rate = if penalty.is_finite() { Complex64::new(0.0, penalty * h as f64 * self.omega) } else { ZERO };
            let turn: Vec<Complex64> = (0..port.axes * port.axes)
                .map(|ab| self.mean(self.tangent(p, port), port.axes, (ab / port.axes, ab % port.axes), k))
                .collect();
            for column in matrix.chunks_exact_mut(size) {
                let moved: Vec<Complex64> = port.range().map(|q| column[q] * rate).collect();
                for (a, q) in port.range().enumerate() {
                    column[q] = (0..port.axes).map(|b| turn[a * port.axes + b] * moved[b]).sum();
                }
            }
            for (a, q) in port.range().enumerate() {
                matrix[q * size + q] += 1.0 + self.ease.stay(h);
                for (b, column) in port.range().enumerate() {
                    matrix[column * size + q] -= turn[a * port.axes + b];
                }
            }
        }
        ComplexLu::new(matrix, size).ok().map(|factor| Answer::new(factor, size))
    }
}

/// What solves the equations of one harmonic: of matrices that stay in the cache the inverse, which is exact enough to precondition with and takes a fifth of
/// what a solution by triangles does, which are too short for blocks.
#[derive(Debug, Clone)]
enum Answer {
    Inverse(ComplexGemv),
    Factor(ComplexLu),
}

impl Answer {
    fn new(factor: ComplexLu, size: usize) -> Self {
        if size > CACHED {
            return Answer::Factor(factor);
        }
        let mut inverse = vec![ZERO; size * size];
        inverse.iter_mut().step_by(size + 1).for_each(|diagonal| *diagonal = Complex64::ONE);
        factor.solve(&mut inverse);
        Answer::Inverse(ComplexGemv::new(&inverse, size))
    }

    fn apply(&self, right: &mut [Complex64], memory: &mut Vec<f64>) {
        match self {
            Answer::Inverse(inverse) => inverse.apply(right, memory),
            Answer::Factor(factor) => factor.solve(right),
        }
    }
}

/// The first harmonics together.
#[derive(Debug, Clone)]
struct Lowest {
    count: usize,
    /// In units.
    transposed: DenseLu<f64>,
}

impl Lowest {
    /// From the residual of these harmonics to their step, both in units, and not of the others.
    fn apply(&self, v: &[f64], pair: usize) -> Vec<f64> {
        let mut own: Vec<f64> = v.chunks_exact(pair).flat_map(|v| &v[..2 * self.count]).copied().collect();
        self.transposed.solve_adjoint(&mut own);
        own
    }
}

/// The lowest harmonics together, the others one by one.
#[derive(Debug, Clone)]
struct Harmonics {
    lowest: Lowest,
    others: Vec<Answer>,
    /// Products that the step took for which they were made, and those that others took more, together.
    products: usize,
    excess: usize,
}

enum Preconditioner<'a> {
    Harmonics(&'a Harmonics),
    Split(&'a mut Split),
}

impl Preconditioner<'_> {
    /// From a residual in units to a step in units.
    fn apply(&self, linear: &Linear, v: &mut [f64]) {
        let nh = linear.harmonics.len();
        let together = match self {
            Preconditioner::Harmonics(harmonics) => harmonics.lowest.apply(v, 2 * nh),
            Preconditioner::Split(_) => Vec::new(),
        };
        v.iter_mut().zip(linear.units).for_each(|(v, unit)| *v *= unit);
        match self {
            Preconditioner::Harmonics(Harmonics { lowest, others, .. }) => {
                let (mut column, mut memory) = (vec![ZERO; v.len() / (2 * nh)], Vec::new());
                for (k, factor) in (lowest.count..).zip(others) {
                    for (c, v) in column.iter_mut().zip(v.chunks_exact(2 * nh)) {
                        *c = Complex64::new(v[2 * k], v[2 * k + 1]);
                    }
                    factor.apply(&mut column, &mut memory);
                    for (c, v) in column.iter().zip(v.chunks_exact_mut(2 * nh)) {
                        (v[2 * k], v[2 * k + 1]) = (c.re, c.im);
                    }
                }
            }
            Preconditioner::Split(split) => split.apply(v),
        }
        for port in linear.ports.iter() {
            let unit = port.unit(linear.length);
            v[2 * nh * port.first..2 * nh * (port.first + port.axes)].iter_mut().for_each(|v| *v /= unit);
        }
        if let Preconditioner::Harmonics(Harmonics { lowest: Lowest { count: count @ 1.., .. }, .. }) = self {
            let steps = v.chunks_exact_mut(2 * nh).zip(together.chunks_exact(2 * count));
            steps.for_each(|(v, own)| v[..2 * count].copy_from_slice(own));
        }
    }
}

/// Harmonics beyond which derivatives of laws do not stay in the cache.
const COUNTED: usize = 64;
/// How many times as long a multiplication with the derivatives of unknown forces takes, whose series are long: they are read from memory in every
/// product. Measured: 21 ms a product of 11 joints with 512 harmonics.
const READ: f64 = 8.0;

/// Multiplications in a product with the derivative: of the structure over the axes, and of the laws over the harmonics.
pub(super) fn product_work(ports: &Ports, harmonics: usize) -> f64 {
    let of_law = |port: &Port| {
        (2 * harmonics * port.axes).pow(2) as f64 * if port.is_force() && harmonics > COUNTED { READ } else { 1.0 }
    };
    4.0 * harmonics as f64 * (ports.count() as f64).powi(2) + ports.iter().map(of_law).sum::<f64>()
}

/// Multiplications in a step by products, with the lowest harmonics of unknown forces eliminated together.
pub(super) fn step_products(ports: &Ports, harmonics: usize) -> f64 {
    let together = if ports.has_forces() { LOWEST.min(2 * harmonics * ports.count()) } else { 0 };
    VECTORS as f64 * product_work(ports, harmonics) + (together as f64).powi(3) / 3.0
}

/// `1 + R K` with one real K for all harmonics, of a structure in modes.
#[derive(Debug, Clone)]
struct Split {
    /// Frequency, rad/s, up to which modes are taken as they are.
    bound: f64,
    /// Whether the mean is that with closed contacts: these are what precondition it.
    closed: bool,
    /// Their numbers.
    low: Vec<usize>,
    /// What the other modes and springs in series add, S: the same for any stiffness of the joints.
    above: Arc<Vec<f64>>,
    /// `1 + S K`.
    factor: DenseLu<f64>,
    /// `Φᵀ K`, modes × axes, and `(1 + S K)⁻¹ Φ`, axes × modes.
    pull: Vec<f64>,
    moved: Vec<f64>,
    /// `Φᵀ K (1 + S K)⁻¹ Φ`.
    core: Vec<f64>,
    /// That with the dynamic stiffness of the modes, per harmonic, at a drive frequency.
    harmonics: Vec<ComplexLu>,
    omega: f64,
}

impl Split {
    /// The same for frequencies that are near each other.
    fn bound(modal: &Modal) -> f64 {
        let top = modal.rates.iter().map(|s| s.im).fold(modal.omega, f64::max);
        ABOVE * top.log2().ceil().exp2()
    }

    /// `stiffness(p, port, a, b)` of the joints; `above` if it is known of the same bound.
    fn new(
        modal: &Modal,
        (bound, above): (f64, Option<Arc<Vec<f64>>>),
        stiffness: impl Fn(usize, &Port, usize, usize) -> f64,
        ports: &Ports,
    ) -> Option<Self> {
        let structure = &modal.structure;
        let (p, n) = (structure.axes, structure.own().len());
        let is_low = |own: &[f64; 3]| own[2] <= bound * bound * own[0];
        let (low, high): (Vec<usize>, Vec<usize>) = (0..n).partition(|&m| is_low(&structure.own()[m]));
        let column = |m: usize| &structure.at[m * p..(m + 1) * p];
        let above = above.unwrap_or_else(|| {
            let above: Vec<f64> = high.iter().flat_map(|&m| column(m)).copied().collect();
            let weighted: Vec<f64> =
                high.iter().flat_map(|&m| column(m).iter().map(move |a| a / structure.own()[m][2])).collect();
            let mut sum = vec![0.0; p * p];
            multiply_blocked(
                &weighted,
                &above,
                &mut sum,
                ProductShape { rows: p, inner: high.len(), columns: p },
                Transpose::Yes,
            );
            (0..p).for_each(|q| sum[q * p + q] += modal.series[q]);
            Arc::new(sum)
        });
        let mut matrix = vec![0.0; p * p];
        let mut pull = vec![0.0; low.len() * p];
        for (number, port) in ports.iter().enumerate() {
            for (a, row) in port.range().enumerate() {
                for (b, q) in port.range().enumerate() {
                    let k = stiffness(number, port, a, b);
                    let moved = &above[row * p..(row + 1) * p];
                    matrix[q * p..(q + 1) * p].iter_mut().zip(moved).for_each(|(out, s)| *out += s * k);
                    for (pull, &m) in pull[q * low.len()..].iter_mut().zip(&low) {
                        *pull += structure.at[m * p + row] * k;
                    }
                }
            }
        }
        (0..p).for_each(|q| matrix[q * p + q] += 1.0);
        let factor = DenseLu::new(matrix, p).ok()?;
        let mut moved: Vec<f64> = low.iter().flat_map(|&m| column(m)).copied().collect();
        factor.solve(&mut moved);
        let l = low.len();
        let mut core = vec![0.0; l * l];
        multiply_blocked(&pull, &moved, &mut core, ProductShape { rows: l, inner: p, columns: l }, Transpose::No);
        let closed = modal.closed.is_some();
        Some(Split { bound, closed, low, above, factor, pull, moved, core, harmonics: Vec::new(), omega: f64::NAN })
    }

    /// Prepares for a drive frequency.
    fn drive(&mut self, modal: &Modal) -> Option<()> {
        if self.omega == modal.omega && self.harmonics.len() == modal.rates.len() {
            return Some(());
        }
        let l = self.low.len();
        self.harmonics.clear();
        for rate in &modal.rates {
            let mut matrix: Vec<Complex64> = self.core.iter().map(|x| Complex64::new(*x, 0.0)).collect();
            for (i, &m) in self.low.iter().enumerate() {
                matrix[i * l + i] += modal.structure.stiffness(m, *rate, modal.omega).ok()?;
            }
            self.harmonics.push(ComplexLu::new(matrix, l).ok()?);
        }
        self.omega = modal.omega;
        Some(())
    }

    /// `(1 + R K)⁻¹ v = y - (1 + S K)⁻¹ Φ (1/g + core)⁻¹ Φᵀ K y`, `y = (1 + S K)⁻¹ v`, of [axis][harmonic].
    fn apply(&self, v: &mut [f64]) {
        let (nh, l) = (self.harmonics.len(), self.low.len());
        let wide = 2 * nh;
        let p = v.len() / wide;
        let mut columns = vec![0.0; v.len()];
        for (q, v) in v.chunks_exact(wide).enumerate() {
            v.iter().enumerate().for_each(|(i, v)| columns[i * p + q] = *v);
        }
        self.factor.solve(&mut columns);
        if l > 0 {
            let mut pulled = vec![0.0; l * wide];
            multiply_blocked(
                &self.pull,
                &columns,
                &mut pulled,
                ProductShape { rows: l, inner: p, columns: wide },
                Transpose::No,
            );
            for (k, factor) in self.harmonics.iter().enumerate() {
                let (re, im) = pulled[2 * k * l..2 * (k + 1) * l].split_at_mut(l);
                let mut modal: Vec<Complex64> = re.iter().zip(&*im).map(|(re, im)| Complex64::new(*re, *im)).collect();
                factor.solve(&mut modal);
                for (i, z) in modal.iter().enumerate() {
                    (re[i], im[i]) = (z.re, z.im);
                }
            }
            let mut moved = vec![0.0; p * wide];
            multiply_blocked(
                &self.moved,
                &pulled,
                &mut moved,
                ProductShape { rows: p, inner: l, columns: wide },
                Transpose::No,
            );
            columns.iter_mut().zip(&moved).for_each(|(c, m)| *c -= m);
        }
        for (q, v) in v.chunks_exact_mut(wide).enumerate() {
            let first = if self.closed { 2 } else { 0 };
            v.iter_mut().enumerate().skip(first).for_each(|(i, v)| *v = columns[i * p + q]);
        }
    }
}

/// `a · b`.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::super::budget::{POINT, Work};
    use super::super::ease::GIVEN;
    use super::super::equations::{Level, Solution};
    use super::super::rest::Rest;
    use super::super::uncoupled::Uncoupled;
    use super::*;
    use crate::law::{Coulomb, Dahl, Jenkins, Jenkins2d, SharedLaw};
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use std::sync::Arc;

    /// Values without a pattern between -1 and 1.
    fn noise(i: usize) -> f64 {
        ((i * 7919 + 13) as f64).sin()
    }

    /// A structure that couples all with all, with damping in proportion to its stiffness, on contacts with the ground.
    fn system(joints: &[(SharedLaw, usize)]) -> System {
        let n = joints.iter().map(|joint| joint.1).sum();
        let spread = DMatrix::from_fn(n, n, |i, k| noise(i * n + k) / (n as f64).sqrt());
        let stiffness = &spread * spread.transpose() * 2.0 + DMatrix::identity(n, n);
        let mass = DMatrix::from_fn(n, n, |i, k| if i == k { 1.0 + 0.2 * noise(i) } else { 0.0 });
        let names = (0..n).map(|i| format!("{i}")).collect();
        let structure = Structure::new(names, mass, &stiffness * 0.04, stiffness).unwrap();
        let mut builder = System::builder(structure);
        let mut first = 0;
        for (number, (law, directions)) in joints.iter().enumerate() {
            let axes = (first..first + directions).map(|i| Axis::new(vec![(i, 1.0)])).collect();
            builder = builder.joint(format!("{number}"), law.clone(), axes);
            first += directions;
        }
        for i in 0..n {
            builder = builder.force(i, 1, Complex64::new(noise(3 * i + 1), noise(3 * i + 2)));
        }
        builder.build().unwrap()
    }

    #[derive(Debug, Clone, Copy, PartialEq)]
    enum Form {
        Eliminated,
        Formed,
        Modal,
        /// As formed, with a quarter of the samples on the way.
        Sketched,
    }

    /// The motion, how many products it took, and how many steps of laws with a memory.
    fn solve(system: &System, omega: f64, harmonics: &[usize], form: Form) -> (Solution, usize, usize) {
        let ports = Ports::new(system).unwrap();
        let rest = Rest::new(system, &ports);
        let mut level = Level::new(harmonics.to_vec(), 1024, &ports, None);
        level.coupled = (form != Form::Eliminated).then(Coupled::default);
        if form == Form::Sketched {
            level.keep_sketch();
        }
        level.drive(system, &ports, &rest, omega).unwrap();
        if form == Form::Modal {
            let directions: Vec<_> = (0..ports.count()).map(|q| ports.axis(system, q).rows().to_vec()).collect();
            let structure = Arc::new(Uncoupled::new(system.structure(), &directions).unwrap());
            let series = vec![0.0; ports.count()];
            level.receptance = Receptance::Modal(Modal::new((&structure, None), (harmonics, omega), &series).unwrap());
        }
        let start = level.begin(system, &ports, None, omega);
        let found = level.solve(&ports, omega, start);
        let found = found.unwrap_or_else(|lost| panic!("{form:?} at {omega}: {lost:?}"));
        (found, level.products, level.alternation.marched)
    }

    fn agree(system: &System, harmonics: &[usize], forms: &[Form]) {
        for omega in [0.6, 1.7] {
            let (expected, ..) = solve(system, omega, harmonics, Form::Eliminated);
            let size = expected.c.iter().map(|c| c.norm()).fold(0.0, f64::max);
            for form in forms {
                let (found, products, _) = solve(system, omega, harmonics, *form);
                assert!(products > 0 && products < 60 * found.iterations, "{products} in {}", found.iterations);
                for (a, b) in found.c.iter().zip(&expected.c) {
                    assert!((a - b).norm() < 1e-8 * size, "{omega}: {a} {b}");
                }
            }
        }
    }

    /// The same motion by elimination, by products with receptances, and by products with modes.
    #[test]
    fn products_lead_where_elimination_does() {
        let contact = |i: usize| -> (SharedLaw, usize) {
            let stiffness = 1.5 + 0.5 * noise(i);
            match i % 2 {
                0 => (Arc::new(Jenkins2d { stiffness, limit: 0.4 }), 2),
                _ => (Arc::new(Jenkins { stiffness, limit: 0.3 }), 1),
            }
        };
        let contacts: Vec<_> = (0..14).map(contact).collect();
        agree(&system(&contacts), &[0, 1, 2, 3], &[Form::Formed, Form::Modal]);
    }

    /// Fewer samples on the way lead to the motion of all samples, in fewer steps of the laws.
    #[test]
    fn sketches_lead_to_the_motion_of_all_samples() {
        let contact = |i: usize| -> (SharedLaw, usize) {
            (Arc::new(Jenkins2d { stiffness: 1.5 + 0.5 * noise(i), limit: 0.2 + 0.1 * noise(5 * i) }), 2)
        };
        let system = system(&(0..12).map(contact).collect::<Vec<_>>());
        for omega in [0.6, 1.1, 1.7] {
            let (expected, _, all) = solve(&system, omega, &[0, 1, 2, 3], Form::Formed);
            let (found, _, few) = solve(&system, omega, &[0, 1, 2, 3], Form::Sketched);
            let size = expected.c.iter().map(|c| c.norm()).fold(0.0, f64::max);
            let apart = found.c.iter().zip(&expected.c).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(apart < 1e-8 * size, "{omega}: {apart:.1e} of {size:.1e}");
            assert!(few < all, "{omega}: {few} steps, {all} without");
        }
    }

    /// Steps that are shortened again and again take no products, and end no search; products do. The next point has as many again.
    #[test]
    fn products_are_the_work_of_a_search() {
        let contacts: Vec<(SharedLaw, usize)> =
            (0..201).map(|_| (Arc::new(Jenkins2d { stiffness: 2.0, limit: 0.3 }) as SharedLaw, 2)).collect();
        let system = system(&contacts);
        let ports = Ports::new(&system).unwrap();
        let mut level = Level::new(vec![1], 64, &ports, None);
        level.begin_anew(&ports);
        level.assembled = 10_000;
        assert!(level.coupled.is_some() && !level.is_exhausted(&ports));
        level.products = 1_000_000;
        assert!(level.is_exhausted(&ports));
        level.begin_point();
        assert!(!level.is_exhausted(&ports));
    }

    /// What searches of a point took before, here or at other levels, is missing from what the next one may take.
    #[test]
    fn searches_of_a_point_share_what_it_may_take() {
        let joints: Vec<_> = (0..3).map(|_| (Arc::new(Coulomb { limit: 0.3 }) as SharedLaw, 1)).collect();
        let ports = Ports::new(&system(&joints)).unwrap();
        let mut level = Level::new(vec![1, 3], 64, &ports, None);
        level.alternation.marched = usize::MAX / 2;
        assert!(level.is_exhausted(&ports));
        level.begin_anew(&ports);
        assert!(level.spent.is_beyond(POINT) && level.is_exhausted(&ports), "the point has nothing left");
        let share = |share: f64| Work { eliminated: share * POINT.eliminated, marched: share * POINT.marched };
        (level.spent, level.elsewhere) = (share(0.6), share(0.3));
        assert!(!level.is_exhausted(&ports));
        level.elsewhere = share(0.5);
        assert!(level.is_exhausted(&ports));
        level.begin_point();
        assert!(!level.is_exhausted(&ports));
    }

    /// Unknown forces too, of rigid friction beside elastic.
    #[test]
    fn forces_are_unknowns_of_products_too() {
        let laws: [SharedLaw; 3] = [
            Arc::new(Coulomb { limit: 0.3 }),
            Arc::new(Jenkins { stiffness: 2.0, limit: 0.2 }),
            Arc::new(Dahl { stiffness: 1.5, limit: 0.3 }),
        ];
        let joints: Vec<_> = (0..18).map(|i| (laws[i % 3].clone(), 1)).collect();
        agree(&system(&joints), &[1, 3, 5], &[Form::Formed]);
    }

    /// Few joints of rigid friction with long series: the lowest harmonics together lead to the step, which none of them does by its mean.
    #[test]
    fn lowest_harmonics_together_lead_to_steps_of_long_series() {
        let laws: [SharedLaw; 2] = [Arc::new(Coulomb { limit: 0.3 }), Arc::new(Jenkins { stiffness: 2.0, limit: 0.2 })];
        let joints: Vec<_> = (0..12).map(|i| (laws[usize::from(i % 3 == 2)].clone(), 1)).collect();
        let harmonics: Vec<usize> = (1..128).step_by(2).collect();
        assert!(LOWEST < 24 * harmonics.len(), "some are left to their means");
        agree(&system(&joints), &harmonics, &[Form::Formed]);
    }

    /// Of few joints with long series what the laws multiply is the work, and it ends a search.
    #[test]
    fn the_laws_of_long_series_are_work() {
        let joints: Vec<_> = (0..10).map(|_| (Arc::new(Coulomb { limit: 0.3 }) as SharedLaw, 1)).collect();
        let system = system(&joints);
        let ports = Ports::new(&system).unwrap();
        let mut level = Level::new((1..512).step_by(2).collect(), 8192, &ports, None);
        level.begin_anew(&ports);
        level.products = 1_000;
        assert!(level.coupled.is_some() && !level.is_exhausted(&ports));
        level.products = 2_000;
        assert!(level.is_exhausted(&ports));
    }

    /// Who needs the derivative as a matrix gets it where modes would stand for receptances too.
    #[test]
    fn the_matrix_is_formed_where_it_is_needed() {
        let contacts: Vec<(SharedLaw, usize)> =
            (0..201).map(|_| (Arc::new(Jenkins { stiffness: 2.0, limit: 0.3 }) as SharedLaw, 1)).collect();
        let system = system(&contacts);
        let ports = Ports::new(&system).unwrap();
        let rest = Rest::new(&system, &ports);
        assert!(rest.modes_for(&ports).is_some());
        for needed in [false, true] {
            let level = Level::new(vec![1], 64, &ports, None);
            let mut level = if needed { level.with_matrix() } else { level };
            level.drive(&system, &ports, &rest, 0.7).unwrap();
            let mut motion = level.begin(&system, &ports, None, 0.7);
            level.evaluate(&ports, 0.7, &mut motion, GIVEN, 1.0, super::super::equations::Slopes::All);
            assert_eq!(level.assemble(&ports, 0.7, GIVEN, 1.0), needed);
        }
    }
}
