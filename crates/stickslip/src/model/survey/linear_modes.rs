//! Modes of masses with springs and rigid constraints.
//!
//! A single eigenvalue problem cannot resolve stiffnesses of very different magnitude. They are
//! split into levels: for the lower modes, the stiffest springs count as rigid.

use super::rigid_body::DisjointSets;
use super::{LinearModes, NaturalMode};
use crate::structure::reduction::natural;
use crate::structure::{Matrices, free_vibrations};
use nalgebra::{Cholesky, DMatrix, DVector};
use stickslip_numerics::eigen;
use stickslip_numerics::sparse::multi_vector;

/// A spring and damper along a direction of the free places.
pub(super) struct SpringDamper {
    pub(super) at: Vec<(usize, f64)>,
    pub(super) stiffness: f64,
    pub(super) damping: f64,
}

/// The modes of a linear structure, with their shapes.
#[derive(Debug, Clone)]
pub(super) struct LinearStructure {
    pub(super) modes: LinearModes,
    /// Shapes of the elastic modes with `φᵀMφ = 1`, one per column. `None` if some stiffnesses
    /// had to count as rigid.
    pub(super) shapes: Option<DMatrix<f64>>,
    /// True if the damping has a gyroscopic part. Modes are then those of free vibration;
    /// shapes are those without that part.
    pub(super) gyroscopic: bool,
}

/// A pivot below this fraction of its original value is zero.
const ZERO: f64 = 1e-12;
/// Largest number of degrees of freedom for which modes are computed; more would take longer
/// than a second. Measured: 0.35 s at 500, growing with the third power.
pub(super) const MAX_DOFS: usize = 700;

/// A structure in its undamped modes, `q'' + D q' + Λ q`.
struct ModalStructure {
    /// Λ, squared frequencies in ascending order.
    squares: Vec<f64>,
    /// Number of free motions among them.
    free: usize,
    shapes: DMatrix<f64>,
    damping: DMatrix<f64>,
}

impl ModalStructure {
    fn new(full: &Matrices, links: &[&SpringDamper], rigid: &[&[(usize, f64)]]) -> Option<ModalStructure> {
        let n = full.mass.nrows();
        let order: Vec<usize> = (0..n).collect();
        let basis = ConstraintBasis::new(n, &order, rigid);
        let mut turn = DMatrix::zeros(n, basis.kept.len());
        for (row, parts) in basis.rows.iter().enumerate() {
            parts.iter().for_each(|(column, weight)| turn[(row, *column)] += weight);
        }
        let mut stiffness = full.stiffness.clone();
        links.iter().for_each(|link| add(&mut stiffness, &link.at, link.stiffness));
        let part = |matrix: &DMatrix<f64>| match rigid.is_empty() {
            true => matrix.clone(),
            false => turn.tr_mul(&(matrix * &turn)),
        };
        let mut damping = full.damping.clone();
        links.iter().for_each(|link| add(&mut damping, &link.at, link.damping));
        let (mass, damping, stiffness) = (part(&full.mass), part(&damping), part(&stiffness));
        let (mut squares, shapes) = natural(&mass, &stiffness)?;
        // a coordinate without mass follows the others and has no mode
        squares.truncate(squares.partition_point(|value| value.is_finite()));
        let usual = squares.get(squares.len() / 2).copied().unwrap_or(0.0);
        // For matrix structures: eigenvalues below this fraction of the median are free motions.
        // This suits matrices with ten digits.
        let free = squares.partition_point(|value| *value < 1e-10 * usual);
        let mut shapes = shapes.columns(0, squares.len()).into_owned();
        let r = shapes.nrows();
        separate_by_damping(&squares, &mut shapes, |x| x.dot(&(&damping * x)));
        let moved = multi_vector::combine(r, damping.as_slice(), &shapes);
        let damping = multi_vector::inner_products(r, shapes.as_slice(), &moved);
        let shapes = if rigid.is_empty() { shapes } else { turn * shapes };
        Some(ModalStructure { squares, free, shapes, damping })
    }

    fn elastic_shapes(&self) -> DMatrix<f64> {
        self.shapes.columns(self.free, self.squares.len() - self.free).into_owned()
    }

    /// Returns a mode without the gyroscopic part of the damping.
    fn mode(&self, k: usize) -> NaturalMode {
        let omega = self.squares[k].max(0.0).sqrt();
        NaturalMode { omega, damping: self.damping[(k, k)] / (2.0 * omega) }
    }

    fn linear(self) -> LinearStructure {
        let elastic = (self.free..self.squares.len()).map(|k| self.mode(k)).collect();
        let modes = LinearModes { elastic, rigid: self.free, unresolved: 0 };
        LinearStructure { modes, shapes: Some(self.elastic_shapes()), gyroscopic: false }
    }

    /// Returns the modes of free vibration if the damping has a gyroscopic part, otherwise
    /// `None`. Only the 200 lowest modes include that part.
    fn gyroscopic_modes(&self) -> Option<Vec<NaturalMode>> {
        let n = self.squares.len().min(200);
        let found = free_vibrations(&self.squares[..n], &self.damping.view((0, 0), (n, n)).into_owned())?;
        let found = found.into_iter().map(|one| NaturalMode { omega: one.omega, damping: one.damping });
        let mut elastic: Vec<NaturalMode> = found.chain((n..self.squares.len()).map(|k| self.mode(k))).collect();
        elastic.sort_by(|a, b| a.omega.total_cmp(&b.omega));
        Some(elastic)
    }
}

impl LinearStructure {
    /// Returns the modes of a structure with springs at joints and constraints `Σ w x = 0`.
    /// With a gyroscopic matrix, they are the modes of free vibration.
    pub(super) fn of_matrices(full: &Matrices, links: &[&SpringDamper], rigid: &[&[(usize, f64)]]) -> LinearStructure {
        let Some(modal) = ModalStructure::new(full, links, rigid) else { return LinearStructure::unknown(full) };
        match modal.gyroscopic_modes() {
            Some(elastic) => {
                let modes = LinearModes { elastic, rigid: modal.free, unresolved: 0 };
                LinearStructure { modes, shapes: Some(modal.elastic_shapes()), gyroscopic: true }
            }
            None => modal.linear(),
        }
    }

    /// Returns the modes of a structure in a travelling wave, which has twice the size.
    /// Gyroscopic damping is not included.
    pub(super) fn of_wave(full: &Matrices, links: &[&SpringDamper], rigid: &[&[(usize, f64)]]) -> LinearStructure {
        ModalStructure::new(full, links, rigid).map_or_else(|| LinearStructure::unknown(full), |modal| modal.linear())
    }

    fn unknown(full: &Matrices) -> LinearStructure {
        LinearStructure {
            modes: LinearModes { unresolved: full.mass.nrows(), ..LinearModes::default() },
            shapes: None,
            gyroscopic: false,
        }
    }

    /// Returns the modes of masses with springs and constraints `Σ w x = 0`. A place without
    /// mass has zero in `mass`.
    pub(super) fn new(mass: &[f64], links: &[&SpringDamper], rigid: &[&[(usize, f64)]]) -> LinearStructure {
        let total = reduced(mass, links, rigid);
        let (elastic, rigid_motions) = (total.elastic(), rigid_motions(mass, links, rigid));
        let dofs = total.frequencies.len();
        let expected = dofs - rigid_motions.min(dofs);
        if elastic.len() >= expected {
            let shapes = total.shapes(expected);
            let lowest = elastic.len() - expected; // rounding can give a rigid motion a frequency
            let modes = LinearModes { elastic: elastic[lowest..].to_vec(), rigid: rigid_motions, unresolved: 0 };
            return LinearStructure { modes, shapes: Some(shapes), gyroscopic: false };
        }
        // some modes are too far below the stiffest springs; those springs count as rigid for
        // these modes
        let mut high = elastic;
        let (mut links, mut rigid) = (links.to_vec(), rigid.to_vec());
        // Number of stiffness levels.
        for _ in 0..4 {
            let stiffest = links.iter().map(|link| link.stiffness).fold(0.0, f64::max);
            // Springs above this fraction of the stiffest spring determine the highest modes.
            let (above, below): (Vec<&SpringDamper>, Vec<&SpringDamper>) =
                links.iter().partition(|link| link.stiffness > 1e-4 * stiffest);
            if below.is_empty() {
                break;
            }
            rigid.extend(above.iter().map(|link| link.at.as_slice()));
            links = below;
            let lower = reduced(mass, &links, &rigid);
            if lower.frequencies.len() + high.len() != dofs {
                break; // these springs do not cause the gap
            }
            let mut elastic = lower.elastic();
            elastic.extend(high);
            high = elastic;
            if high.len() >= expected {
                break;
            }
        }
        high.drain(..high.len().saturating_sub(expected));
        if high.len() < expected {
            // take all eigenvalues above rounding, with the digits that they have
            // Relative eigenvalue below which the value is rounding.
            let mut all = total.above(1e-13);
            all.drain(..all.len().saturating_sub(expected));
            if all.len() > high.len() {
                high = all;
            }
        }
        let unresolved = expected - high.len();
        LinearStructure {
            modes: LinearModes { elastic: high, rigid: rigid_motions, unresolved },
            shapes: None,
            gyroscopic: false,
        }
    }
}

/// Modes of the places with mass. Squared frequencies are in ascending order and can be
/// rounding errors around zero.
struct CondensedModes {
    frequencies: Vec<f64>,
    damping: Vec<f64>,
    /// Shapes with `φᵀMφ = 1` at the places of the model, one per column.
    vectors: DMatrix<f64>,
}

impl CondensedModes {
    fn above(&self, share: f64) -> Vec<NaturalMode> {
        let floor = share * self.frequencies.last().map_or(0.0, |w| w.abs());
        let pairs = self.frequencies.iter().zip(&self.damping).filter(|(w, _)| **w > floor);
        pairs.map(|(w, c)| NaturalMode { omega: w.sqrt(), damping: c / (2.0 * w.sqrt()) }).collect()
    }

    fn elastic(&self) -> Vec<NaturalMode> {
        // Relative eigenvalue below which fewer than six digits are significant. For modes below
        // it, the stiffest springs count as rigid. Symmetric QR has errors of about 1e-15 of the
        // largest eigenvalue.
        self.above(1e-9)
    }

    fn shapes(&self, count: usize) -> DMatrix<f64> {
        self.vectors.columns(self.vectors.ncols() - count, count).into_owned()
    }
}

/// Returns the number of motions with mass that neither a spring nor a constraint resists.
fn rigid_motions(mass: &[f64], links: &[&SpringDamper], rigid: &[&[(usize, f64)]]) -> usize {
    let n = mass.len();
    let held = links.iter().filter(|link| link.stiffness > 0.0).map(|link| link.at.as_slice());
    let held: Vec<&[(usize, f64)]> = held.chain(rigid.iter().copied()).collect();
    let mut groups = DisjointSets::new(n + 1); // place n is the ground
    for at in &held {
        match at {
            [(a, _)] => groups.union(*a, n),
            [(a, p), (b, q)] if a != b && p + q == 0.0 => groups.union(*a, *b),
            // along an oblique direction or in a wave, the rank of all directions decides
            _ => return unrestrained_dimension(mass, &held),
        }
    }
    let ground = groups.find(n);
    let mut bodies: Vec<usize> = (0..n).filter(|i| mass[*i] > 0.0).map(|i| groups.find(i)).collect();
    bodies.sort_unstable();
    bodies.dedup();
    bodies.into_iter().filter(|body| *body != ground).count()
}

/// Returns this number for arbitrary directions: the dimension that they leave free, minus that
/// of the places without mass alone.
fn unrestrained_dimension(mass: &[f64], held: &[&[(usize, f64)]]) -> usize {
    let (light, heavy): (Vec<usize>, Vec<usize>) = (0..mass.len()).partition(|i| mass[*i] == 0.0);
    let all = [light.as_slice(), &heavy].concat();
    ConstraintBasis::new(mass.len(), &all, held).kept.len() - ConstraintBasis::new(mass.len(), &light, held).kept.len()
}

/// Eliminates constraints and places without mass, and solves for the modes of the remaining
/// places.
fn reduced(mass: &[f64], links: &[&SpringDamper], rigid: &[&[(usize, f64)]]) -> CondensedModes {
    let n = mass.len();
    // places without mass come first, so that constraints eliminate them and the remaining mass
    // matrix stays positive definite
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|i| mass[*i] > 0.0);
    let basis = ConstraintBasis::new(n, &order, rigid);
    let r = basis.kept.len();
    let light = basis.kept.iter().take_while(|place| mass[**place] == 0.0).count();
    let (mut m, mut c, mut k) = (DMatrix::zeros(r, r), DMatrix::zeros(r, r), DMatrix::zeros(r, r));
    for (place, mass) in mass.iter().enumerate().filter(|(_, mass)| **mass > 0.0) {
        let row = basis.rows[place].clone();
        add(&mut m, &row, *mass);
    }
    for link in links {
        let row = basis.along(&link.at);
        add(&mut k, &row, link.stiffness);
        add(&mut c, &row, link.damping);
    }
    let follow = condense(light, &mut c, &mut k);
    let heavy = r - light;
    let part = |matrix: &DMatrix<f64>| matrix.view((light, light), (heavy, heavy)).into_owned();
    let (m, c, k) = (part(&m), part(&c), part(&k));
    // without a solution, every mode is lost
    let unknown = || CondensedModes {
        frequencies: vec![0.0; heavy],
        damping: vec![0.0; heavy],
        vectors: DMatrix::zeros(n, heavy),
    };
    if heavy == 0 {
        return unknown();
    }
    // M = L Lᵀ; the inverse of L transforms to a standard eigenvalue problem
    let Some(inverse) = inverse_root(&m) else { return unknown() };
    let standard = &inverse * k * inverse.transpose();
    let standard = (&standard + standard.transpose()) * 0.5;
    let Some(eigen) = eigen::symmetric(standard) else { return unknown() };
    let mut rising: Vec<usize> = (0..heavy).collect();
    rising.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let frequencies: Vec<f64> = rising.iter().map(|&mode| eigen.eigenvalues[mode]).collect();
    let mut modal = inverse.transpose() * eigen.eigenvectors.select_columns(&rising);
    separate_by_damping(&frequencies, &mut modal, |x| x.dot(&(&c * x)));
    let (mut damping, mut vectors) = (Vec::new(), DMatrix::zeros(n, heavy));
    for (column, shape) in modal.column_iter().enumerate() {
        damping.push(shape.dot(&(&c * shape)));
        // back substitution for the places without mass
        let mut y = DVector::zeros(r);
        y.rows_mut(light, heavy).copy_from(&shape);
        for p in (0..light).rev() {
            y[p] = -(p + 1..r).map(|j| follow[(p, j)] * y[j]).sum::<f64>();
        }
        for place in 0..n {
            vectors[(place, column)] = basis.rows[place].iter().map(|(j, t)| t * y[*j]).sum();
        }
    }
    CondensedModes { frequencies, damping, vectors }
}

/// Relative difference of squared frequencies below which modes count as equal: the rounding of
/// an eigenvalue solver.
const EQUAL_FREQUENCIES: f64 = 1e-9;

/// Turns the shapes of equal frequencies so that damping does not couple them.
///
/// An eigenvalue solver returns any basis of their plane, and each of its shapes would mix the
/// damping ratios. `power` returns `xᵀCx`; `squares` are in ascending order.
pub(super) fn separate_by_damping(squares: &[f64], shapes: &mut DMatrix<f64>, power: impl Fn(&DVector<f64>) -> f64) {
    let mut first = 0;
    while first < squares.len() {
        let count =
            squares[first..].partition_point(|value| *value - squares[first] <= EQUAL_FREQUENCIES * value.abs());
        let count = count.max(1);
        let equal = shapes.columns(first, count).into_owned();
        let coupling = DMatrix::from_fn(count, count, |i, j| match i == j {
            true => power(&equal.column(i).into_owned()),
            false => 0.25 * (power(&(equal.column(i) + equal.column(j))) - power(&(equal.column(i) - equal.column(j)))),
        });
        let coupled = coupling.iter().enumerate().any(|(k, value)| {
            let (i, j) = (k % count, k / count);
            i != j && value.abs() > EQUAL_FREQUENCIES * coupling[(i, i)].abs().max(coupling[(j, j)].abs())
        });
        if coupled && let Some(axes) = eigen::symmetric(coupling) {
            let mut rising: Vec<usize> = (0..count).collect();
            rising.sort_by(|&a, &b| axes.eigenvalues[a].total_cmp(&axes.eigenvalues[b]));
            shapes.columns_mut(first, count).copy_from(&(equal * axes.eigenvectors.select_columns(&rising)));
        }
        first += count;
    }
}

/// Computes `matrix += value · row rowᵀ`.
fn add(matrix: &mut DMatrix<f64>, row: &[(usize, f64)], value: f64) {
    for (i, a) in row {
        for (j, b) in row {
            matrix[(*i, *j)] += value * a * b;
        }
    }
}

/// Eliminates the first `light` coordinates, which have no mass, from damping and stiffness.
///
/// They move so that their springs balance. A coordinate without a spring follows its dampers.
/// Returns their rows `x_p = -Σ follow[p, j] x_j`, j > p.
fn condense(light: usize, c: &mut DMatrix<f64>, k: &mut DMatrix<f64>) -> DMatrix<f64> {
    let r = k.nrows();
    let mut follow = DMatrix::zeros(light, r);
    let before: Vec<f64> = (0..light).map(|p| k[(p, p)]).collect();
    for p in 0..light {
        let (kpp, cpp) = (k[(p, p)], c[(p, p)]);
        let springs = kpp > ZERO * before[p] && kpp > 0.0;
        if !springs && cpp <= 0.0 {
            continue;
        }
        let g: Vec<(usize, f64)> = (p + 1..r)
            .map(|j| (j, if springs { k[(p, j)] / kpp } else { c[(p, j)] / cpp }))
            .filter(|(_, g)| *g != 0.0)
            .collect();
        for (j, g) in &g {
            follow[(p, *j)] = *g;
        }
        let pivot: Vec<(f64, f64)> = (0..r).map(|j| (k[(p, j)], c[(p, j)])).collect();
        // congruence with x_p = -Σ g_j x_j changes only rows and columns coupled to p
        let tied: Vec<usize> = (p + 1..r).filter(|&j| pivot[j] != (0.0, 0.0)).collect();
        for &i in &tied {
            for &j in &tied {
                let (gi, gj) = (follow[(p, i)], follow[(p, j)]);
                k[(i, j)] += if springs { -gi * pivot[j].0 } else { 0.0 };
                c[(i, j)] += gi * gj * cpp - gi * pivot[j].1 - pivot[i].1 * gj;
            }
        }
    }
    follow
}

/// Returns `L⁻¹` of `M = L Lᵀ`.
fn inverse_root(m: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = m.nrows();
    let diagonal = (0..n).all(|i| (0..n).all(|j| i == j || m[(i, j)] == 0.0));
    if diagonal {
        return Some(DMatrix::from_diagonal(&m.diagonal().map(|m| 1.0 / m.sqrt())));
    }
    Cholesky::new(m.clone())?.l().solve_lower_triangular(&DMatrix::identity(n, n))
}

/// Coordinates that satisfy constraints: every place as a sum of the kept places.
struct ConstraintBasis {
    /// The kept places, in the order of the input.
    kept: Vec<usize>,
    /// Pairs (coordinate, factor) of every place.
    rows: Vec<Vec<(usize, f64)>>,
}

impl ConstraintBasis {
    fn new(n: usize, order: &[usize], rigid: &[&[(usize, f64)]]) -> ConstraintBasis {
        let mut a = DMatrix::<f64>::zeros(rigid.len(), n);
        for (row, at) in rigid.iter().enumerate() {
            at.iter().for_each(|(place, w)| a[(row, *place)] += w);
        }
        // Gauss-Jordan elimination; a redundant constraint leaves a row of zeros
        let mut pivots: Vec<usize> = Vec::new();
        for &column in order {
            let next = pivots.len();
            let best = (next..a.nrows()).max_by(|&p, &q| a[(p, column)].abs().total_cmp(&a[(q, column)].abs()));
            let Some(best) = best.filter(|p| a[(*p, column)].abs() > ZERO) else { continue };
            a.swap_rows(next, best);
            let pivot = a[(next, column)];
            a.row_mut(next).apply(|v| *v /= pivot);
            let used: Vec<(usize, f64)> = (0..n).map(|j| (j, a[(next, j)])).filter(|(_, v)| *v != 0.0).collect();
            for row in (0..a.nrows()).filter(|row| *row != next) {
                let factor = a[(row, column)];
                if factor != 0.0 {
                    used.iter().for_each(|(j, v)| a[(row, *j)] -= factor * v);
                    a[(row, column)] = 0.0;
                }
            }
            pivots.push(column);
        }
        let kept: Vec<usize> = order.iter().copied().filter(|place| !pivots.contains(place)).collect();
        let mut rows = vec![Vec::new(); n];
        for (coordinate, &place) in kept.iter().enumerate() {
            rows[place].push((coordinate, 1.0));
            for (row, &pivot) in pivots.iter().enumerate() {
                if a[(row, place)].abs() > ZERO {
                    rows[pivot].push((coordinate, -a[(row, place)]));
                }
            }
        }
        ConstraintBasis { kept, rows }
    }

    /// Returns a direction of the places in the coordinates.
    fn along(&self, at: &[(usize, f64)]) -> Vec<(usize, f64)> {
        let mut sum: Vec<(usize, f64)> = Vec::new();
        for (place, w) in at {
            for (j, t) in &self.rows[*place] {
                match sum.iter_mut().find(|(known, _)| known == j) {
                    Some((_, value)) => *value += w * t,
                    None => sum.push((*j, w * t)),
                }
            }
        }
        sum.retain(|(_, value)| value.abs() > ZERO);
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constraints_remove_places_without_mass_first() {
        // place 1 has no mass; the constraint 0 = 1 occurs twice
        let at = [(0, 1.0), (1, -1.0)];
        let basis = ConstraintBasis::new(3, &[1, 0, 2], &[&at, &at]);
        assert_eq!(basis.kept, [0, 2]);
        assert_eq!(basis.rows, [vec![(0, 1.0)], vec![(0, 1.0)], vec![(1, 1.0)]]);
        assert!(basis.along(&at).is_empty());
    }

    /// A mass in a plane: one inclined spring leaves one motion, two springs leave none unless
    /// they are parallel. A place without mass adds no motion.
    #[test]
    fn inclined_springs_restrain_their_span() {
        let link = |at: &[(usize, f64)]| SpringDamper { at: at.to_vec(), stiffness: 1.0, damping: 0.0 };
        let along = |angle: f64| link(&[(0, angle.cos()), (1, angle.sin())]);
        let motions =
            |mass: &[f64], links: &[SpringDamper]| rigid_motions(mass, &links.iter().collect::<Vec<_>>(), &[]);
        assert_eq!(motions(&[1.0, 1.0], &[along(0.6)]), 1);
        assert_eq!(motions(&[1.0, 1.0], &[along(0.6), along(2.0)]), 0);
        assert_eq!(motions(&[1.0, 1.0], &[along(0.6), along(0.6)]), 1);
        let chained = [along(0.6), link(&[(1, 1.0), (2, -1.0)])];
        assert_eq!(motions(&[1.0, 1.0, 0.0], &chained), 1);
        assert_eq!(motions(&[1.0, 1.0, 1.0], &chained), 1);
        assert_eq!(motions(&[1.0, 1.0, 0.0], &chained[..1]), 1);
        assert_eq!(motions(&[1.0, 1.0, 1.0], &chained[..1]), 2);
        let elastic = LinearStructure::new(&[1.0, 1.0], &[&along(0.6), &along(2.0)], &[]).modes;
        // two unit springs at an angle of 1.4: 1 ± cos 1.4
        let squares: Vec<f64> = elastic.elastic.iter().map(|mode| mode.omega * mode.omega).collect();
        assert!((squares[0] - 1.0 + 1.4f64.cos()).abs() < 1e-12 && (squares[1] - 1.0 - 1.4f64.cos()).abs() < 1e-12);
    }

    /// A mass in a plane with the same stiffness in all directions and a damper along each of
    /// two inclined axes: each damper damps its own mode.
    #[test]
    fn equal_frequencies_keep_their_own_damping() {
        let along = |angle: f64, stiffness: f64, damping: f64| SpringDamper {
            at: vec![(0, angle.cos()), (1, angle.sin())],
            stiffness,
            damping,
        };
        let (weak, strong) = (along(0.6, 4.0, 0.08), along(0.6 + std::f64::consts::FRAC_PI_2, 4.0, 0.4));
        let ratios = |modes: &LinearModes| modes.elastic.iter().map(|mode| mode.damping).collect::<Vec<_>>();
        let zero = DMatrix::zeros(2, 2);
        let masses = Matrices { mass: DMatrix::identity(2, 2), damping: zero.clone(), stiffness: zero };
        let links = [&weak, &strong];
        for structure in
            [LinearStructure::new(&[1.0, 1.0], &links, &[]), LinearStructure::of_matrices(&masses, &links, &[])]
        {
            let ratios = ratios(&structure.modes);
            assert!((ratios[0] - 0.02).abs() < 1e-12 && (ratios[1] - 0.1).abs() < 1e-12, "{ratios:?}");
        }
    }
}
